"""The search: what it holds for one effect, what it looks at in a long log, how finely it knows a ripple."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import make_case, make_run, without

from rtds_host.contract import Case, builtin_robot
from rtds_host.diagnosis import ripple
from rtds_host.diagnosis.diagnose import diagnose
from rtds_host.diagnosis.likelihood import Discrepancy, Series
from rtds_host.diagnosis.problem import SEARCHED_S, Problem
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.replay.slots import OUTPUT_INDEX
from rtds_host.diagnosis.twins import twins

POSE = ("x", "y", "yaw")


def forwards(case: Case) -> Case:
    """The case with every command made positive: no reversal."""
    runs = tuple(replace(r, columns={c: np.abs(v) if c.startswith("v_cmd") else v for c, v in r.columns.items()}) for r in case.runs)
    return replace(case, runs=runs)


@pytest.mark.parametrize("case,member,expected", [
    (make_case(), ("command_delay", "both"), []),
    (without(make_case(), *POSE), ("command_delay", "both"), [("measurement_delay", "both")]),
    (without(make_case(), *POSE, "i_l", "i_r", "gyro_z"), ("speed_gain", "left"), [("driver_gain", "left")]),
    (without(make_case(), *POSE, "gyro_z"), ("speed_gain", "left"), []),
    (without(make_case(), "x", "y"), ("wheel_radius_error", "both"), [("track_width_error", "both")]),
    (without(make_case(), "x", "y"), ("wheel_radius_error", "left"), []),
    (without(make_case(), *POSE), ("gyro_gain", "both"), [("track_width_error", "both"), ("wheel_radius_error", "both")]),
    (without(make_case(), "i_l", "i_r"), ("driver_deadzone", "right"), []),
    (without(forwards(make_case()), "i_l", "i_r"), ("driver_deadzone", "right"),
     [("coulomb_friction", "right"), ("bridge_drop", "right")]),
    (forwards(make_case()), ("friction_asymmetry", "both"), [("coulomb_friction", "both")]),
], ids=lambda v: v[0] if isinstance(v, tuple) else "")
def test_twins_are_what_the_runs_lack_the_channels_or_motions_to_part(case, member, expected):
    assert twins(case, member) == expected


def test_a_delay_without_a_pose_is_declared_with_its_twin_and_named_once():
    def late(model):
        model.put("command_delay", 0.02)

    diagnosis, _ = diagnose(without(make_case(late), *POSE), quick=True)
    delays = [e["id"] for e in diagnosis["effects"] if e["id"].endswith("_delay")]
    assert len(delays) == 1
    declared = next(s for s in diagnosis["indistinguishable"] if any(m["id"] == delays[0] for m in s))
    assert {"command_delay", "measurement_delay"} <= {m["id"] for m in declared}


def test_the_spectrum_of_a_ripple_is_as_fine_as_its_peak():
    """Over many turns a peak is narrower than any round number of cycles: here 11.63, as an encoder's scale would make it."""
    robot = builtin_robot("burger")
    model = nominal_model(robot)
    for slot, value in (("ripple", 0.02), ("ripple_cycles", 11.63)):
        model.put(slot, value, (0,))
    case = Case("rippled", robot, tuple(make_run(f"r{k}", model, robot, "weave", 20.0, k) for k in range(2)))
    problem = Problem(case)
    found = ripple.spectra(problem, problem.replay(problem.nominal))
    strongest = found["left"].cycles[np.argmax(found["left"].power)]
    turns = np.ptp(case.runs[0].columns["th_l"]) / (2 * np.pi)
    assert abs(strongest - 11.63) < 0.5 / turns
    assert found["left"].power.max() > 20 * found["right"].power.max()


def test_an_encoders_scale_counts_from_its_zero():
    """Contract, section 3: the angle is reported as ratio times the true one, so a run that begins at 9 rad began at 9 / ratio."""
    robot = builtin_robot("burger")
    log = make_run("r", nominal_model(robot), robot, "steps", 2.0)
    inputs = run_inputs(log, robot)
    start = inputs[6].copy()
    start[3] = 9.0
    scaled = nominal_model(robot)
    scaled.put("speed_gain", 1.5)
    out = replay_run(scaled, (*inputs[:6], start))
    plain = replay_run(nominal_model(robot), (*inputs[:6], np.where(np.arange(11) == 3, 6.0, inputs[6])))
    th = OUTPUT_INDEX["th_l"]
    assert out[0, th] == pytest.approx(9.0)
    np.testing.assert_allclose(out[:, th], 1.5 * plain[:, th], atol=1e-9)


def test_columns_are_whitened_alike_alone_and_together():
    rng = np.random.default_rng(5)
    t = np.cumsum(rng.uniform(0.005, 0.02, 500))
    noise = Discrepancy([Series(0, 0, 500, t)], 500, 1, np.array([3.0]), np.array([0.1]))
    columns = rng.standard_normal((500, 7)).astype(np.float32)
    together = noise.whiten(columns)
    assert not np.allclose(together, columns)
    np.testing.assert_array_equal(together, np.column_stack([noise.whiten(np.ascontiguousarray(c)) for c in columns.T]))


def test_a_long_run_is_searched_in_stretches_from_all_over_and_judged_whole():
    robot = builtin_robot("burger")
    model = nominal_model(robot)
    model.put("coulomb", 0.04, (0,))
    seconds = 2.0 * SEARCHED_S
    case = Case("long", robot, (make_run("hours", model, robot, "weave", seconds, 3),))
    problem = Problem(case)
    assert problem.searched == pytest.approx(0.5, rel=0.01)
    first = [data.inputs[0][0] for data in problem.runs]
    assert first[0] == 0.0
    assert max(first) > 0.9 * seconds
    assert sum(data.inputs[0][-1] - data.inputs[0][0] for data in problem.runs) == pytest.approx(SEARCHED_S, rel=0.02)
    # Each stretch is replayed from what was measured there: the true model leaves noise and no more.
    residual = problem.residual(model)
    assert np.sqrt(np.mean(residual**2)) < 1.2
    diagnosis, details = diagnose(case, quick=True)
    assert [(e["id"], e["side"]) for e in diagnosis["effects"]] == [("coulomb_friction", "left")]
    assert any("50 % of them" in note for note in details.notes)
    assert len(details.traces["hours"]["w_l"].t) == len(case.runs[0].t)
