"""Forms over the heat of a current: the state, where it acts, and how it is found, written and read."""

import json
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from axis_machine import write_axis_case
from diagnosis_cases import commands, make_case

from rtds_host.contract import Case, RunLog, RunMeta, builtin_robot, read_case
from rtds_host.diagnosis.fit import Fit, Fitter
from rtds_host.diagnosis.forms import Forms, forms_of
from rtds_host.diagnosis.forms.candidates import candidates
from rtds_host.diagnosis.forms.curves import Form, put, shapes
from rtds_host.diagnosis.forms.formula import fitted, laws
from rtds_host.diagnosis.forms.screen import FormCandidate, distinct
from rtds_host.diagnosis.forms.warmth import time_constants
from rtds_host.diagnosis.predict import read_diagnosis
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import Model, nominal_model, replay_run
from rtds_host.diagnosis.report.forms import density
from rtds_host.diagnosis.report.forms import shapes as report_of
from rtds_host.errors import InputError
from rtds_host.export.figures import figures_of
from rtds_host.export.python import write
from rtds_host.plant import forms as plant
from rtds_host.plant.schema import OUTPUT_INDEX, OUTPUTS

ROBOT = builtin_robot("burger")
HIGH = 0.03


def warm(model: Model, term: str, law, tau: float, sides=(0, 1)) -> Model:
    """The model with a form over the heat whose values are `law` of its points."""
    put(model, sides, term, "heat", 0.0, HIGH, law(np.linspace(0.0, HIGH, plant.POINTS)), tau)
    return model


def about(volts: float, heat: float, model: Model) -> np.ndarray:
    """What the forms of the left side come to at a command and a heat."""
    quantities, past, acts = np.zeros(plant.ABOUT), np.zeros(plant.PAST), np.zeros(plant.ACTS)
    quantities[plant.OVER_CODE["v_cmd"] - 1] = volts
    past[plant.HEATS] = heat
    plant.act(model.forms[0], quantities, past, acts)
    return acts


def test_a_heat_follows_an_even_current_alike_in_steps_of_any_length():
    heat = 0.0
    for _ in range(4000):
        heat = plant.warmed(heat, 0.2, 5e-4, 3.0)
    assert heat == pytest.approx(plant.warmed(0.0, 0.2, 2.0, 3.0)) == pytest.approx(0.04 * (1.0 - np.exp(-2.0 / 3.0)))


def test_each_form_has_a_heat_of_its_own():
    model = warm(warm(nominal_model(ROBOT), "voltage", lambda x: -x, 1.0), "torque_constant", lambda x: -x, 4.0)
    past = np.zeros(plant.PAST)
    plant.remember(model.forms[0], 0.0, 0.5, 2.0, past)
    assert past[plant.HEATS :] == pytest.approx([0.25 * (1.0 - np.exp(-2.0)), 0.25 * (1.0 - np.exp(-0.5)), 0.0])


def test_a_voltage_over_the_heat_is_a_share_of_the_command():
    model = warm(nominal_model(ROBOT), "voltage", lambda x: -10.0 * x, 1.0)
    for volts in (-6.0, 0.0, 3.0):
        acts = about(volts, 0.02, model)
        assert acts[plant.VOLTS] == pytest.approx(-0.2 * volts)
        assert not np.delete(acts, plant.VOLTS).any()


def test_a_torque_over_the_heat_is_friction_in_both_directions():
    model = warm(nominal_model(ROBOT), "torque", lambda x: -2.0 * x, 1.0)
    assert about(6.0, 0.01, model)[[plant.FORWARD, plant.BACKWARD]] == pytest.approx([0.02, 0.02])
    assert plant.holds(model.forms[0])


def test_viscous_friction_over_the_heat_adds_to_the_friction_by_speed():
    model = warm(nominal_model(ROBOT), "damping", lambda x: -2.0 * x, 1.0)
    acts = about(6.0, 0.01, model)
    assert acts[plant.FLUID] == pytest.approx(-0.02)
    assert not np.delete(acts, plant.FLUID).any()


def test_a_replay_knows_the_heat_in_steps_of_any_length():
    problem = Problem(make_case(seconds=4.0), 1)
    model = warm(nominal_model(ROBOT), "voltage", lambda x: -20.0 * x, 1.5)
    inputs = problem.whole[0].inputs
    long, short = (replay_run(model, inputs, step_s) for step_s in (1e-3, 2.5e-4))
    moved = np.abs(short - replay_run(nominal_model(ROBOT), inputs, 2.5e-4)).max(axis=0)
    assert moved[OUTPUT_INDEX["w_l"]] > 0.05
    errs = np.abs(long - short).max(axis=0)
    assert (errs[OUTPUT_INDEX["w_l"] :] <= 0.02 * moved[OUTPUT_INDEX["w_l"] :] + 1e-9).all()


def test_a_winding_whose_heat_does_nothing_replays_as_without_it():
    problem = Problem(make_case(seconds=2.0), 1)
    model = warm(nominal_model(ROBOT), "voltage", lambda x: 0.0 * x, 1.5)
    inputs = problem.whole[0].inputs
    assert np.allclose(replay_run(model, inputs), replay_run(nominal_model(ROBOT), inputs), atol=1e-9)


def test_a_heat_is_sought_only_where_runs_show_it(tmp_path):
    problem = Problem(make_case(seconds=20.0), 1)
    found = time_constants(problem, problem.nominal)
    assert [tau for tau, _ in found] == pytest.approx([10.0, 2.5])
    forms = [form for form in candidates(problem, problem.nominal) if form.over == "heat"]
    assert {form.term for form in forms} == {"voltage", "torque_constant", "torque", "damping"}
    assert all((form.low, form.high) == (0.0, dict(found)[form.tau]) for form in forms)
    short = Problem(make_case(seconds=1.5), 1)
    assert time_constants(short, short.nominal) == []
    # A current that is next to nothing.
    idle = problem.nominal.copy()
    idle.scale("back_emf", 0.0)
    idle.scale("resistance", 100.0)
    assert time_constants(problem, idle) == []
    # How warm a piece begins is not known.
    axis = Problem(read_case(write_axis_case(tmp_path / "case", "pendulum", "voltage")), 1)
    assert time_constants(axis, axis.nominal) == []


def test_of_time_constants_the_screening_keeps_the_best():
    def one(tau, side, left, over="heat", high=1.0):
        return FormCandidate(Form("voltage", over, 0.0, high, 0.1, tau), side, left, np.zeros(0))

    found = [one(1.0, "both", 0.2), one(4.0, "both", 0.3), one(4.0, "left", 0.4), one(0.0, "both", 0.5, "i", 2.0)]
    found.append(one(0.0, "both", 0.6, "i", 1.0))
    assert distinct(found) == [found[0], *found[2:]]


def test_a_curve_over_the_heat_is_nothing_at_none():
    basis, widths = shapes("heat")
    assert np.abs(basis[0]).max() < 1e-12
    assert (np.diff(widths) < 0.0).all()


def test_what_gives_way_from_a_heat_on_gets_the_place_in_its_formula():
    form = Form("voltage", "heat", 0.0, HIGH, 0.1, 3.0)
    basis, _ = shapes("heat")
    values = -20.0 * np.maximum(form.points - 0.01, 0.0)
    (law,) = [law for law in laws("heat") if law.text == "a·(x - b) for x > b"]
    found = fitted(law, form, values, 1e-8 * np.eye(basis.shape[1]))
    assert found.values == pytest.approx([-20.0, 0.01], rel=0.05)
    assert all(law.of(np.zeros(1), *(1.0 for _ in law.names))[0] == 0.0 for law in laws("heat"))


def explained(case: Case) -> tuple[Problem, Fit]:
    """A case and the fit of its tolerances alone."""
    problem = Problem(case, 1)
    return problem, Fitter(problem).fit((), np.empty(0), np.zeros(len(problem.nuisances)), problem.white())


def found_in(case: Case) -> tuple[Forms, float]:
    """Forms of a case, and the gap that the tolerances alone leave."""
    problem, fit = explained(case)
    before = problem.gap(fit.model(problem))
    return forms_of(problem, fit, before, True), before


@pytest.fixture(scope="module")
def faded() -> tuple[Forms, float]:
    """What is found of a driver that gives less as it gets warm."""
    return found_in(make_case(lambda model: warm(model, "voltage", lambda x: -25.0 * x, 3.8), seconds=20.0))


def test_a_driver_that_fades_with_heat_gets_a_curve_in_its_equation(faded):
    forms, before = faded
    entry = forms.entries[0]
    assert (entry["term"], entry["over"], entry["side"]) == ("voltage", "heat", "both")
    assert entry["units"] == ["A²", "1"]
    assert 1.9 < entry["time_constant"] < 7.6
    assert entry["closes"] > 0.9
    assert forms.gap < 1.0 + 0.1 * (before - 1.0)
    assert entry["formula"] == "a·x"
    assert entry["parameters"]["a"]["value"] == pytest.approx(-25.0, rel=0.2)


def test_a_diagnosis_with_a_heat_predicts_what_was_fitted(faded, tmp_path):
    entry = faded[0].entries[0]
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps({"schema": "rtds-diagnosis/3", "effects": [], "forms": [entry]}))
    row = read_diagnosis(path, ROBOT).forms[1, 0]
    assert row[plant.TAU] == pytest.approx(entry["time_constant"])
    points = np.array(entry["curve"])
    assert [plant.curve(row, x)[0] for x in points[:, 0]] == pytest.approx(points[:, 1], abs=1e-6)
    for value in (None, 0.0, "slow", True):
        path.write_text(
            json.dumps({"schema": "rtds-diagnosis/3", "effects": [], "forms": [{**entry, "time_constant": value}]})
        )
        with pytest.raises(InputError, match=r"forms\[0\].time_constant: .* seconds above zero"):
            read_diagnosis(path, ROBOT)


def test_the_report_says_how_slow_a_heat_is_and_where_the_data_lie(faded):
    forms, _ = faded
    details = SimpleNamespace(case=make_case(seconds=8.0))
    assert density(forms.entries[0], details).any()
    page = report_of({"forms": forms.entries[:1], "gap": {"with_forms": forms.gap}}, details)
    assert f"time constant is {forms.entries[0]['time_constant']:.3g}" in page
    assert "as a share of the command" in page and "winding&#x27;s resistance cold" in page


def test_a_winding_that_heats_up_is_no_form():
    forms, _ = found_in(
        make_case(lambda model: (model.add("heat_rise", 3.0), model.declare(heat_tau=4.0)), seconds=20.0)
    )
    assert not any(entry["over"] == "heat" for entry in forms.entries)


def thinning(seconds: float, size: float = 0.012, fades: float = 5.0) -> np.ndarray:
    """Viscous friction of a grease that thins from the start of a run on, (POINTS,) N·m·s/rad."""
    return size * np.exp(-np.linspace(0.0, seconds, plant.POINTS) / fades)


def test_grease_that_thins_over_a_run_is_viscous_friction_over_time():
    def greased(model):
        put(model, (1,), "damping", "t", 0.0, 20.0, thinning(20.0))

    forms, before = found_in(make_case(greased, seconds=20.0))
    entry = forms.entries[0]
    assert (entry["term"], entry["over"], entry["side"]) == ("damping", "t", "right")
    assert entry["units"] == ["s", "N·m·s/rad"]
    assert entry["formula"] == "a·exp(-x/b)"
    assert entry["parameters"]["a"]["value"] == pytest.approx(0.012, rel=0.2)
    assert forms.gap < 1.0 + 0.1 * (before - 1.0)


def derated(volts: float, degrees: float) -> float:
    """What a driver at so many degrees above the room makes of a command: all until 20, then less in a straight line,
    as thermal derating of power stages is given."""
    return volts * (1.0 - 0.012 * min(max(degrees - 20.0, 0.0), 30.0))


def drive(kind: str, seed: int, seconds: float, payload_kg: float) -> RunLog:
    """A run of the exported robot in plain Python behind a driver that is warmed by its bridge, with sensors' noise."""
    module = ModuleType("plain_robot")
    exec(compile(write(figures_of(nominal_model(ROBOT), ROBOT), ""), "plain_robot.py", "exec"), module.__dict__)
    module.STEP_S = 1e-3
    robot, degrees = module.Robot(None, payload_kg=payload_kg), [0.0, 0.0]
    t, volts = commands(kind, seconds, seed)
    out = np.zeros((len(t), len(OUTPUTS)))
    for k, asked in enumerate(volts.tolist()):
        found = robot.sensors()
        out[k] = [found[name] for name in OUTPUTS]
        robot.step(*(derated(v, d) for v, d in zip(asked, degrees, strict=True)), 0.01)
        # A case of 1 J/K that gives 0.2 W/K to the room, and a bridge that loses by its resistance.
        degrees = [d + 0.01 * (900.0 * i * i - 0.2 * d) for d, i in zip(degrees, robot.i, strict=True)]
    rng = np.random.default_rng(seed)
    noise = np.array([ROBOT.noise(name) for name in OUTPUTS]) * rng.standard_normal(out.shape)
    columns = {"v_cmd_l": volts[:, 0], "v_cmd_r": volts[:, 1]}
    columns |= {name: out[:, n] + noise[:, n] for n, name in enumerate(OUTPUTS)}
    return RunLog(kind + str(seed), RunMeta(scenario=kind, payload_kg=payload_kg), t, columns)


def test_a_driver_of_another_world_gets_its_equation_too():
    runs = tuple(drive("steps", seed, 15.0, load) for seed, load in ((2, 1.0), (6, 1.0), (4, 2.0)))
    forms, before = found_in(Case("derated", ROBOT, runs))
    entry = forms.entries[0]
    assert (entry["term"], entry["over"], entry["side"]) == ("voltage", "heat", "both")
    assert 2.5 < entry["time_constant"] < 10.0
    assert forms.gap < 1.0 + 0.25 * (before - 1.0)
