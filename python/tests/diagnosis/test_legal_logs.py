"""Logs that the contract allows and hardly anybody has: one wheel measured, no friction, sparse poses, many short runs,
holes.
"""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import commands, make_case, make_run, without

from rtds_host.contract import Axis, Case, RunLog, RunMeta, builtin_robot
from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.diagnose import diagnose
from rtds_host.diagnosis.evidence import gap_gain, likelihood_gain
from rtds_host.diagnosis.gate import examine
from rtds_host.diagnosis.gate.cuts import cut
from rtds_host.diagnosis.left_out import parted
from rtds_host.diagnosis.localise import localise
from rtds_host.diagnosis.localise.series import relaxed
from rtds_host.diagnosis.problem import SEARCHED_S, Problem
from rtds_host.diagnosis.replay.model import nominal_model, piece_inputs, replay_run, run_inputs, stretch_inputs
from rtds_host.diagnosis.scatter import groups
from rtds_host.diagnosis.settings import settings
from rtds_host.diagnosis.structurally_indistinguishable import structurally_indistinguishable
from rtds_host.errors import InputError
from rtds_host.plant.schema import OUTPUT_INDEX, OUTPUTS

ROBOT = builtin_robot("burger")
MEASURED = ("v_bus", "i_l", "i_r", "w_l", "w_r", "th_l", "th_r", "gyro_z", "x", "y", "yaw")


def with_only(case: Case, *channels: str) -> Case:
    return without(case, *(c for c in MEASURED if c not in channels))


def scores(case: Case, model) -> dict[str, float]:
    return {block.name: block.score for block in localise(case, model).blocks if block.n}


@pytest.mark.parametrize(
    "channels",
    [("w_r",), ("w_r", "i_r"), ("w_r", "i_l"), ("w_r", "i_l", "i_r", "yaw"), ("th_l", "i_r", "gyro_z")],
    ids=" ".join,
)
def test_a_robot_of_which_one_wheel_is_measured_is_localised(channels):
    case = with_only(make_case(seconds=4.0), *channels)
    assert all(score < 1.3 for score in scores(case, nominal_model(ROBOT)).values())


def test_a_speed_that_nothing_brakes_is_half_way_between_its_ends():
    values, dt = np.array([0.0, 1.0, 3.0]), np.array([0.01, 0.01])
    assert relaxed(values, dt, 1e9) == pytest.approx([0.5, 2.0]) and relaxed(values, dt, 1e2) == pytest.approx(
        [0.5, 2.0], rel=1e-4
    )
    # Of an interval of many time constants the speed is what it came to.
    assert relaxed(values, dt, 1e-6) == pytest.approx([1.0, 3.0], rel=1e-3)


@pytest.mark.parametrize("quantity, amount", [("pwm_curve", 0.2), ("deadzone", 0.3), ("voltage_gain", -0.1)])
def test_the_current_s_block_knows_what_a_driver_does(quantity, amount):
    case = make_case(lambda model: model.add(quantity, amount), seconds=4.0)
    model = nominal_model(ROBOT)
    assert max(scores(case, model)[f"current_{s}"] for s in "lr") > 1.5
    model.add(quantity, amount)
    assert max(scores(case, model)[f"current_{s}"] for s in "lr") < 1.1


def test_angles_count_next_to_speeds_whose_noise_nobody_declares():
    case = with_only(make_case(seconds=4.0), "w_l", "w_r", "th_l", "th_r")
    robot = replace(ROBOT, sensors={"th_rad": ROBOT.sensors["th_rad"]})
    assert gaps.gap_channels(case.runs[0], robot) == ("th_l", "th_r")


def test_what_has_nothing_that_counts_is_refused():
    case = with_only(make_case(seconds=0.6), "th_l", "th_r")
    with pytest.raises(InputError, match="nothing in it counts"):
        examine(case)


def test_speeds_that_clip_below_what_a_circle_asks_for_make_no_yaw_degrees():
    t = np.arange(0.0, 20.0, 0.01)
    rises = np.minimum(t / 1.0, 1.0)
    volts = {"v_cmd_l": 7.25 * rises, "v_cmd_r": 10.5 * rises}
    log = RunLog("circle", RunMeta(), t, volts)
    out = replay_run(nominal_model(ROBOT), run_inputs(log, ROBOT))
    rng = np.random.default_rng(1)
    measured = {c: out[:, k] + ROBOT.noise(c) * rng.standard_normal(len(t)) for k, c in enumerate(OUTPUTS)}
    measured |= {c: np.minimum(measured[c], 4.0) for c in ("w_l", "w_r")}
    assert examine(Case("case", ROBOT, (replace(log, columns={**volts, **measured}),))).case is not None


def test_a_straight_drive_that_bends_is_in_no_other_unit_of_length():
    robot = replace(ROBOT, sensors={**ROBOT.sensors, "xy_m": 1e-4})
    t = np.arange(0.0, 6.0, 0.01)
    volts = {"v_cmd_l": np.full(len(t), 5.80), "v_cmd_r": np.full(len(t), 5.82)}
    log, model = RunLog("straight", RunMeta(), t, volts), nominal_model(robot)
    drives = replay_run(model, run_inputs(log, robot))
    model.scale("voltage_gain", 1.14, (1,))
    bends = replay_run(model, run_inputs(log, robot))
    # Dozens of times the nominal y, and along with it.
    assert 30.0 < bends[-1, OUTPUT_INDEX["y"]] / drives[-1, OUTPUT_INDEX["y"]] < 150.0
    rng = np.random.default_rng(1)
    measured = {c: bends[:, k] + robot.noise(c) * rng.standard_normal(len(t)) for k, c in enumerate(OUTPUTS)}
    assert examine(Case("case", robot, (replace(log, columns={**volts, **measured}),))).case is not None


def test_a_pose_that_comes_every_other_second_has_windows_as_long():
    case = make_case(seconds=40.0)
    run = case.runs[2]
    sparse = {c: np.where(np.arange(len(run.t)) % 200 == 0, run.columns[c], np.nan) for c in ("x", "y", "yaw")}
    log = replace(run, columns={**run.columns, **sparse})
    found = gaps.errors(log, ROBOT, replay_run(nominal_model(ROBOT), run_inputs(run, ROBOT)))
    assert all(
        len(found[c]) == 20 and found[c].all() and 0.6 < np.sqrt(np.mean(found[c] ** 2)) < 1.4
        for c in ("x", "y", "yaw")
    )


def test_a_place_counts_in_the_fit_where_headings_have_no_declared_noise():
    case = make_case(seconds=4.0)
    robot = replace(ROBOT, sensors={key: value for key, value in ROBOT.sensors.items() if key != "yaw_rad"})
    problem = Problem(replace(case, robot=robot), 1)
    names = {
        ("v_bus", "i_l", "i_r", "w_l", "w_r", "th_l", "th_r", "gyro_z", "x", "y", "yaw")[k] for k in problem.channels_of
    }
    assert {"x", "y"} <= names and "yaw" not in names
    assert np.sqrt(np.mean(problem.residual(problem.nominal) ** 2)) == pytest.approx(1.0, abs=0.05)


def test_a_run_that_was_cut_has_the_battery_that_the_hole_left():
    model = nominal_model(ROBOT)
    model.add("decline", 0.1)
    run = make_run("long", model, ROBOT, "weave", 20.0)
    keep = (run.t < 10.0) | (run.t > 10.3)
    holed = replace(run, t=run.t[keep], columns={c: v[keep] for c, v in run.columns.items()})
    _, part = examine(Case("case", ROBOT, (holed,))).case.runs
    out = replay_run(model, run_inputs(part, ROBOT))
    assert abs(float(np.mean(out[:, 0] - part.columns["v_bus"]))) < 0.02
    assert cut(Case("case", ROBOT, (holed,)))[0][1].since_s == pytest.approx(10.3, abs=0.02)


def test_a_run_without_a_sample_that_counts_is_passed_over():
    case = make_case(seconds=4.0)
    empty = replace(
        case.runs[0],
        columns={c: v if c.startswith("v_cmd") else np.full_like(v, np.nan) for c, v in case.runs[0].columns.items()},
    )
    problem = Problem(replace(case, runs=(empty, *case.runs[1:])), 1)
    assert len(groups(problem)) == problem.size > 0


def test_of_many_short_runs_some_are_searched_whole():
    one = make_run("run", nominal_model(ROBOT), ROBOT, "steps", 2.0)
    short = 1.5 * SEARCHED_S / 2.0
    case = Case("case", ROBOT, tuple(replace(one, name=str(k)) for k in range(int(short))))
    problem = Problem(case, 1)
    assert {len(data.log.t) for data in problem.runs} == {len(one.t)}
    assert sum(float(data.log.t[-1]) for data in problem.runs) == pytest.approx(SEARCHED_S, rel=0.02)


def test_of_some_long_runs_each_has_its_share_of_the_search():
    one = make_run("run", nominal_model(ROBOT), ROBOT, "steps", 60.0)
    case = Case("case", ROBOT, tuple(replace(one, name=str(k)) for k in range(10)))
    problem = Problem(case, 1)
    assert set(problem.owners) == set(range(10))
    assert sum(float(np.ptp(data.log.t)) for data in problem.runs) == pytest.approx(SEARCHED_S, rel=0.05)


def test_the_first_stretch_of_a_run_that_begins_moving_has_the_command_from_before():
    run = make_run("run", nominal_model(ROBOT), ROBOT, "steps", 6.0)
    run = replace(run.rows(250, 600), t=run.t[250:600] - run.t[250])
    model = nominal_model(ROBOT)
    model.put("command_delay", 0.3)
    whole, stretch = (
        replay_run(model, inputs) for inputs in (run_inputs(run, ROBOT), stretch_inputs(run, ROBOT, 0, 200))
    )
    assert np.allclose(whole[:200], stretch)


@pytest.mark.parametrize("start_rad_s", [6.0, 0.0, 0.01])
def test_an_axis_that_begins_moving_was_under_its_first_command_before(start_rad_s):
    """Late by half of a run with one command, it moves as on time. One that begins at rest, or within noise of it, does
    nothing until then.
    """
    robot = replace(ROBOT, chassis=None, axis=Axis("inertia", 1e-3))
    t = np.arange(0.0, 0.4, 0.005)
    log = RunLog("run", RunMeta(), t, {"v_cmd_l": np.full(len(t), 5.0), "w_l": np.full(len(t), start_rad_s)})
    on_time, late = nominal_model(robot), nominal_model(robot)
    late.put("command_delay", 0.2)
    first, second = (replay_run(model, run_inputs(log, robot))[:, OUTPUT_INDEX["w_l"]] for model in (on_time, late))
    if start_rad_s > 1.0:
        assert np.allclose(first, second)
    else:
        assert np.abs(second[t < 0.2]).max() <= start_rad_s < first[t < 0.2].max()


def test_a_piece_of_an_axis_is_replayed_without_angles_to_follow():
    run = make_run("run", nominal_model(ROBOT), ROBOT, "steps", 2.0)
    assert piece_inputs(run, ROBOT, 50, 90)[4].shape == (0, 2)


def test_a_wheel_without_inertia_is_replayed_with_free_play():
    robot = replace(ROBOT, chassis=replace(ROBOT.chassis, wheel_inertia_kg_m2=0.0))
    model = nominal_model(robot)
    model.put("backlash", 0.1)
    out = replay_run(model, run_inputs(make_run("run", nominal_model(ROBOT), ROBOT, "steps", 2.0), robot))
    assert np.abs(out[:, [OUTPUT_INDEX["w_l"], OUTPUT_INDEX["w_r"]]]).max() < 20.0


def test_a_single_run_whose_halves_have_no_gap_has_nothing_left_out():
    case = with_only(make_case(seconds=1.5), "th_l", "th_r")
    problem = Problem(replace(case, runs=case.runs[1:2]), 1)
    ((first, last, rows),) = parted(problem)[0]
    assert (first, last) == (0, len(case.runs[1].t)) and not len(rows)
    diagnosis, details = diagnose(replace(case, runs=case.runs[1:2]), quick=True, threads=1)
    assert np.isfinite(diagnosis["gap"]["after"]) and any("too short to hold a part" in note for note in details.notes)


def test_a_wheel_that_is_braked_and_never_turns_back_moves_one_way():
    t, volts = commands("steps", 6.0)
    volts = np.where((t % 2.0 < 1.5)[:, None], 5.0, 0.6) * np.ones((len(t), 2))
    volts[(t % 2.0 > 1.5) & (t % 2.0 < 1.53)] = -0.3
    log = RunLog("run", RunMeta(), t, {"v_cmd_l": volts[:, 0], "v_cmd_r": volts[:, 1]})
    out = replay_run(nominal_model(ROBOT), run_inputs(log, ROBOT))
    log = replace(log, columns={**log.columns, **{c: out[:, OUTPUTS.index(c)] for c in ("w_l", "w_r", "i_l", "i_r")}})
    assert ("friction_asymmetry", "both") in structurally_indistinguishable(
        Case("case", ROBOT, (log,)), ("coulomb_friction", "both")
    )


def test_speeds_that_are_commanded_are_a_setting():
    run = make_run("run", nominal_model(ROBOT), ROBOT, "steps", 4.0)
    speeds = {f"w_cmd_{s}": run.columns[f"v_cmd_{s}"] for s in "lr"}
    problem = Problem(Case("case", ROBOT, (run,)), 1)
    columns = {**{c: v for c, v in run.columns.items() if not c.startswith("v_cmd")}, **speeds}
    problem.runs[0] = replace(problem.runs[0], log=replace(run, columns=columns))
    assert np.ptp(settings(problem, problem.nominal)["command"]) > 1.0


class _Left:
    """A fit that leaves residuals (n,), judged by a discrepancy that lets pass what is slow."""

    def __init__(self, residual, costs):
        self.residual, self.costs = residual, costs
        self.noise = self

    def blocks(self, *_):
        return self.costs


def test_what_brings_nearly_all_of_a_run_closer_is_missed_by_the_gap_s_measure_whatever_the_likelihood_says():
    rng = np.random.default_rng(1)

    class Forty:
        blocks, block_count = np.repeat(np.arange(40), 50), 40

    left = rng.standard_normal(2000) * 3.0
    fit, other, elsewhere = (
        _Left(left, np.full(40, 1.0)),
        _Left(left + 4.0, np.zeros(40)),
        _Left(left + 40.0 * (Forty.blocks == 7), np.zeros(40)),
    )
    assert likelihood_gain(Forty, fit, other)[0] < 0.0
    gain, t = gap_gain(Forty, fit, other)
    assert gain > 40.0 and t > 5.0
    # A single stretch convinces nobody, however far it is off.
    gain, t = gap_gain(Forty, fit, elsewhere)
    assert 0.0 < gain < 4.0 and t < 2.0
