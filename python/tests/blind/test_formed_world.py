"""Cases with a random curve in one equation: what is drawn, that it acts there, and how much no name makes up for."""

import math

import numpy as np
import pytest

from rtds_host.blind import curve, formed, formed_world, hard, machines, planar, scales, seal
from rtds_host.blind.hard import Truth
from rtds_host.blind.vocabulary import EFFECTS
from rtds_host.contract import builtin_robot
from rtds_host.diagnosis.forms.candidates import RUNS_OVER
from rtds_host.plant.forms import TERMS

ROBOT = builtin_robot("burger")
OF = scales.scale_of(ROBOT, 0.01, 4.0)
SPEC = {"rate": 100.0, "missing": [], "tolerance": False, "effects": [], "outside": None, "machine": "turtlebot"}
RUN = {"name": "teleop", "payload_kg": 0.0, "slope_rad": 0.0, "uphill_yaw_rad": 0.0, "duration": 4.0, "plan": 5}


def replays(forms: list[dict], run=RUN) -> dict:
    spec = {**SPEC, "constants": {"l": {}, "r": {}, "whole": {}}, "forms": forms, "drive": 0.8}
    return Truth(np.random.default_rng(0), ROBOT, spec, [run]).there[0]


@pytest.mark.parametrize("law", curve.LAWS)
def test_every_law_names_an_equation_and_effects_that_exist(law):
    term, over, place, names = curve.LAWS[law]
    assert term in TERMS and over in RUNS_OVER[term]
    assert set(names) <= set(EFFECTS) and law in formed_world.NEAREST
    assert place in {subsystem for subsystem, *_ in EFFECTS.values()}


@pytest.mark.parametrize("law", curve.LAWS)
def test_a_curve_changes_the_motion_or_in_a_sensor_its_reading_alone(law):
    """On a side it changes that side's current; one of the body changes the pose; a sensor's changes nothing else."""
    low, high = {"th": (0.0, 2 * math.pi), "t": (0.0, 4.0), "x": (-1.0, 1.0)}.get(curve.LAWS[law][1], (-6.0, 6.0))
    if curve.LAWS[law][1] in ("i", "speed", "yaw_rate"):
        low, high = -0.5, 0.5
    made = formed_world.draw_curve(np.random.default_rng(1), ROBOT, law, low, high)
    size = 0.1 * formed_world.large(law, OF, high)
    plain, changed = replays([]), replays([made(size)])
    differ = {name for name in plain if np.abs(plain[name] - changed[name]).max() > 1e-6}
    if law.split("_")[0] in ("speed", "current", "gyro"):
        stems = {"speed": "w", "current": "i", "gyro": "gyro_z"}[law.split("_")[0]]
        assert differ and {planar.stem(name) for name in differ} == {stems}
    else:
        assert {"x", "gyro_z"} & differ and {"i_l", "i_r"} & differ


@pytest.mark.parametrize("law", curve.LAWS)
@pytest.mark.parametrize("seed", range(5))
def test_a_random_curve_is_smooth_and_gives_no_energy_and_nothing_at_rest(law, seed):
    low, high = {"th": (0.0, 2 * math.pi), "t": (0.0, 4.0)}.get(curve.LAWS[law][1], (-2.0, 2.0))
    shape = curve.draw_shape(np.random.default_rng(seed), law, low, high)
    x = np.linspace(low, high, curve.POINTS)
    assert np.abs(shape).max() == pytest.approx(1.0) and np.abs(np.diff(shape)).max() < 0.8
    if law not in ("torque_over_angle", "force_over_place"):
        assert abs(np.interp(0.0, x, shape)) < 1e-3
    if law in curve.PASSIVE:
        assert (shape * x <= 1e-9).all()
    if law == "damping_over_time":
        assert (shape >= 0.0).all()
    if law == "flux_over_current":
        assert shape == pytest.approx(shape[::-1], abs=1e-6)


def test_a_curve_is_straight_between_its_points_and_goes_round_with_an_angle():
    row = np.zeros(curve.WIDTH)
    row[:3] = 1.0, -1.0, 1.0
    row[curve.VALUES :] = np.linspace(-3.0, 3.0, curve.POINTS)
    assert [curve.at(row, x) for x in (-2.0, -0.5, 0.25, 7.0)] == pytest.approx([-3.0, -1.5, 0.75, 3.0])
    row[:3] = curve.TORQUE_ANGLE, 0.0, 2 * math.pi
    assert curve.at(row, 1.0) == pytest.approx(curve.at(row, 1.0 - 2 * math.pi))
    assert curve.at(row, 1.0) == pytest.approx(curve.at(row, 1.0 + 6 * math.pi))


def test_a_reading_is_changed_by_its_own_law_only():
    row = np.zeros(curve.WIDTH)
    row[:3] = curve.SPEED_READING, -1.0, 1.0
    row[curve.VALUES :] = 0.5
    assert curve.reading(row, curve.SPEED_READING, np.array([0.2])) == pytest.approx([0.7])
    assert curve.reading(row, curve.CURRENT_READING, np.array([0.2])) == pytest.approx([0.2])


@pytest.fixture(scope="module")
def spec():
    """A case as the tier draws it, on an axis, whose runs are short."""
    old = machines.CLASSES
    machines.CLASSES = ("inertia",)
    try:
        made = {"tier": "formed", "tolerance": True, "outside": None, "rest": None, "jitter": 0.0}
        formed_world.draw_case(np.random.default_rng(3), made)
        return made
    finally:
        machines.CLASSES = old


def test_the_nearest_machine_leaves_the_curve(spec):
    (form,) = spec["forms"]
    truth = hard.account(spec)
    low, high = formed_world.KEPT_GAP
    assert low <= truth["gap"]["known"] <= high
    assert truth["forms"][0]["gap_beyond_names"] > 1.2
    assert truth["forms"][0]["equation"] == curve.LAWS[form["id"]][0] and not truth["forms"][0]["matters"]
    for effect in truth["effects"]:
        assert effect["gap_without"] ** 2 - 1 > 1.9 * (truth["gap"]["known"] ** 2 - 1)


def test_a_formed_case_is_sealed_and_scored_by_its_curve(tmp_path, monkeypatch, spec):
    monkeypatch.setattr(formed_world, "draw_case", lambda rng, made: made.update(spec, colour=(0.0, 0.0)))
    seal.make(tmp_path, 1, ["formed"], ["planar"], seed=3, jobs=1)
    truth = seal.check_truths(tmp_path)["case-001"]
    (form,) = truth["forms"]
    said = {"forms": [{"term": form["equation"]}]}
    ((law, placed, share, right),) = formed.judged(truth, said, {"effects_alone": 3.0, "after": 1.5})
    assert (law, placed, share, right) == (form["id"], True, 0.75, True)
    other = next(term for term in TERMS if term not in formed.ALIKE.get(form["equation"], (form["equation"],)))
    assert formed.judged(truth, {"forms": [{"term": other}]}, {})[0][1:] == [False, None, False]
    assert formed.false_form(truth, said) is None
    text = "".join(p.read_text() for p in (tmp_path / "public" / "case-001").rglob("*.toml"))
    assert not any(law in text for law in curve.LAWS)
