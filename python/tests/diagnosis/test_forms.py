"""Forms: free curves in the equations, found, written, read and replayed."""

import json

import numpy as np
import pytest
from diagnosis_cases import make_case

from rtds_host.contract import builtin_robot
from rtds_host.correction.translate import translate
from rtds_host.diagnosis.fit import Fit, Fitter
from rtds_host.diagnosis.forms import Forms, forms_of
from rtds_host.diagnosis.forms.curves import points_of, put
from rtds_host.diagnosis.predict import read_diagnosis
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import Model, ReplayBatch, nominal_model, replay_run
from rtds_host.errors import InputError
from rtds_host.plant import forms as plant

TURN = plant.FULL_TURN


def with_form(model: Model, term: str, over: str, low: float, high: float, law, sides=(0, 1)) -> Model:
    """The model with a form whose values are `law` of its points."""
    put(model, sides, term, over, low, high, law(points_of(over, low, high)))
    return model


def explained(change) -> tuple[Problem, Fit]:
    """A case whose truth is `change` of the nominal model, and the fit of its tolerances alone."""
    problem = Problem(make_case(change), 1)
    fit = Fitter(problem).fit((), np.empty(0), np.zeros(len(problem.nuisances)), problem.white())
    return problem, fit


@pytest.fixture(scope="module")
def problem() -> Problem:
    return Problem(make_case(), 1)


@pytest.mark.parametrize(
    ("quantity", "size", "form"),
    [
        ("coulomb", 0.02, ("torque", "w", -20.0, 20.0, lambda x: -0.02 * np.sign(x))),
        ("scrub", 0.03, ("yaw_torque", "yaw_rate", -9.0, 9.0, lambda x: -0.03 * np.sign(x))),
        ("voltage_gain", 0.1, ("voltage", "v_cmd", -12.0, 12.0, lambda x: 0.1 * np.where(np.abs(x) > 0.01, x, 0.0))),
        ("gyro_bias", 0.1, ("gyro_sensor", "yaw_rate", -9.0, 9.0, lambda x: 0.1 + 0.0 * x)),
        ("current_bias", 0.1, ("current_sensor", "i", -2.0, 2.0, lambda x: 0.1 + 0.0 * x)),
    ],
)
def test_a_form_with_an_effects_values_replays_as_the_effect(problem, quantity, size, form):
    effect, formed = nominal_model(problem.robot), nominal_model(problem.robot)
    effect.add(quantity, size)
    with_form(formed, *form)
    inputs = problem.whole[0].inputs
    one, other = replay_run(effect, inputs), replay_run(formed, inputs)
    moving = np.abs(one).max(axis=0) > 0.0
    # Sensors' readings of exactly nothing have no sign, and no form.
    rows = slice(60, None)
    assert np.allclose(one[rows, moving], other[rows, moving], atol=1e-9)


def test_replays_one_by_one_and_in_a_batch_agree_with_every_form(problem):
    models = []
    for term in plant.TERMS:
        for over in plant.OVERS:
            low, high = (0.0, TURN) if over in plant.PERIODIC else (-3.0, 3.0)
            model = with_form(nominal_model(problem.robot), term, over, low, high, lambda x: 0.02 * np.cos(x))
            models.append(with_form(model, "torque", "w", -9.0, 9.0, lambda x: -0.01 * np.sign(x), (1,)))
    batch = ReplayBatch([problem.whole[0].inputs])
    for model, out in zip(models, batch.replay(models), strict=True):
        assert np.allclose(out, replay_run(model, problem.whole[0].inputs), atol=1e-9)


def test_a_robot_with_a_form_does_not_change_its_neighbours_in_a_batch(problem):
    plain = nominal_model(problem.robot)
    formed = with_form(plain.copy(), "torque", "th", 0.0, TURN, np.sin)
    batch = ReplayBatch([data.inputs for data in problem.whole])
    mixed = batch.replay([plain, formed, plain, formed])
    assert np.array_equal(mixed[0], batch.replay([plain, plain])[0])
    assert np.abs(mixed[1] - mixed[0]).max() > 0.1


def found_in(change) -> tuple[Forms, float, float]:
    """Forms of a case, the gap that the tolerances alone leave, and the gap that the truth leaves."""
    problem, fit = explained(change)
    truth = problem.nominal.copy()
    change(truth)
    before = problem.gap(fit.model(problem))
    return forms_of(problem, fit, before, True), before, problem.gap(truth)


WORLDS = {
    # Grids of other ends than the search takes, so that no world is a curve of the search's own.
    "voltage": ("v_cmd", -10.0, 10.0, lambda x: 0.8 * np.sign(x) * (x / 9.0) ** 2),
    "torque": ("th", 0.0, TURN, lambda x: 0.05 * np.sin(2.0 * x + 0.4)),
}


@pytest.mark.parametrize("term", WORLDS)
def test_a_nameless_term_gets_a_curve_in_its_equation_and_a_formula(term):
    over, low, high, law = WORLDS[term]
    forms, before, truth = found_in(lambda model: with_form(model, term, over, low, high, law))
    assert [(entry["term"], entry["over"], entry["side"]) for entry in forms.entries] == [(term, over, "both")]
    (entry,) = forms.entries
    assert before - forms.gap >= 0.9 * (before - truth)
    assert entry["closes"] >= 0.9
    x, y, error = np.array(entry["curve"]).T
    inside = np.abs(x) < 0.8 * high if term == "voltage" else x >= 0.0
    size = np.abs(law(x[inside])).max()
    assert np.abs(y - law(x))[inside].max() < 0.15 * size
    assert (error > 0.0).all()
    assert entry["formula"] == {"voltage": "a·x·|x|", "torque": "a·sin(2·x + φ)"}[term]
    a = entry["parameters"]["a"]
    assert a["ci90"][0] < a["value"] < a["ci90"][1]
    assert a["value"] == pytest.approx({"voltage": 0.8 / 81.0, "torque": 0.05}[term], rel=0.05)


def test_budget_takes_what_forms_close_off_what_has_no_name():
    entry = {"term": "torque", "side": "both", "over": "w"}
    rows = [
        {"what": "effect", "id": "coulomb_friction", "side": "both", "share": 0.4},
        {"what": "rest", "subsystem": "drivetrain", "share": 0.6},
    ]
    shared = Forms([entry], 2.0, [3.0, 2.0]).shared(rows, 3.0)
    assert sum(row["share"] for row in shared) == pytest.approx(1.0)
    assert shared[1] == {"what": "form", **entry, "share": pytest.approx(0.6 * (1.0 - 3.0 / 8.0))}
    assert shared[2]["share"] == pytest.approx(0.6 * 3.0 / 8.0)


def test_no_form_where_nothing_is_missing():
    problem, fit = explained(lambda model: None)
    assert forms_of(problem, fit, problem.gap(fit.model(problem)), True).entries == []


def test_no_form_where_an_effect_of_the_catalogue_makes_it_as_well():
    forms, _, _ = found_in(lambda model: model.add("coulomb", 0.05))
    assert forms.entries == []
    assert any("coulomb_friction" in note for note in forms.notes)


def diagnosis(tmp_path, *forms):
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps({"schema": "rtds-diagnosis/3", "effects": [], "forms": list(forms)}))
    return path


ENTRY = {
    "term": "torque",
    "side": "left",
    "over": "w",
    "units": ["rad/s", "N·m"],
    "curve": [[-10.0, 0.02, 0.001], [-0.001, 0.03, 0.001], [0.001, -0.03, 0.001], [10.0, -0.02, 0.001]],
    "formula": None,
    "parameters": {},
    "closes": 0.5,
}


def test_a_diagnosis_form_goes_into_the_replay(tmp_path):
    model = read_diagnosis(diagnosis(tmp_path, ENTRY), builtin_robot("burger"))
    row = model.forms[0, 0]
    assert plant.curve(row, 5.0)[0] == pytest.approx(-0.025, abs=1e-5)
    assert plant.curve(row, -10.0)[0] == pytest.approx(0.02)
    assert not model.forms[1].any()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"term": "torq"}, r"forms\[0\].term: 'torq' must be one of .* did you mean"),
        ({"over": "warmth"}, r"forms\[0\].over: 'warmth'"),
        ({"side": "front"}, r"forms\[0\].side: 'front'"),
        ({"curve": [[0.0, 1.0, 0.1]]}, r"forms\[0\].curve: a list of at least two points"),
        ({"curve": [[0.0, 1.0], [0.0, 2.0]]}, r"forms\[0\].curve\[1\]: 0 is not above 0"),
        ({"curve": [[0.0, 1.0], [1.0, None]]}, r"forms\[0\].curve\[1\]: is \[1.0, None\]"),
    ],
)
def test_a_form_that_cannot_be_one_is_refused_with_its_place(tmp_path, change, said):
    with pytest.raises(InputError, match=said):
        read_diagnosis(diagnosis(tmp_path, {**ENTRY, **change}), builtin_robot("burger"))


def test_a_fourth_form_on_a_side_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"forms\[3\]: a robot has at most 3 forms a side"):
        read_diagnosis(diagnosis(tmp_path, *[ENTRY] * 4), builtin_robot("burger"))


def test_motor_units_hold_friction_and_command_curves():
    robot = builtin_robot("burger")
    model = with_form(nominal_model(robot), "torque", "w", -20.0, 20.0, lambda x: -0.02 * np.sign(x) - 0.001 * x)
    with_form(model, "voltage", "v_cmd", -10.0, 10.0, lambda x: 0.01 * x * np.abs(x), (0,))
    left, right = translate(model, robot).units
    n = robot.motor.gear_ratio
    assert left.friction_forward.at(10.0 * n) == pytest.approx(0.03 / n)
    assert left.friction_backward.at(10.0 * n) == pytest.approx(0.03 / n)
    assert left.command.at(10.0) == pytest.approx(11.0)
    assert left.command.at(0.0) == 0.0
    assert right.command is None
