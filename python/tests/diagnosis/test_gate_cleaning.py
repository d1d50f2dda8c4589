"""What the gate sets aside, cuts and measures: isolated samples, held and clipped stretches, holes, roundings,
clocks.
"""

import dataclasses
import re

import numpy as np
import pytest
from axis_machine import write_axis_case
from diagnosis_cases import changed, make_case, make_run, without

from rtds_host.contract import Case, RunLog, builtin_robot, read_case
from rtds_host.contract.clock import moment
from rtds_host.diagnosis.gap import errors, gap, pooled
from rtds_host.diagnosis.gate import examine, stamps
from rtds_host.diagnosis.gate.rounding import step_of
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.errors import InputError
from rtds_host.plant.schema import OUTPUTS


@pytest.fixture(scope="module")
def case():
    return make_case()


def aside(case, gate):
    """(run, channel) -> rows that the gate set aside."""
    found = {}
    for before, after in zip(case.runs, gate.case.runs):
        for c, values in before.columns.items():
            rows = np.flatnonzero(np.isfinite(values) & ~np.isfinite(after.columns[c]))
            if rows.size:
                found[before.name, c] = list(rows)
    return found


def spoiled(case, channel, size, rows=(300,), run=0):
    """The case with isolated errors of `size` in rows of one run's channel."""
    log = case.runs[run]
    columns = dict(log.columns, **{channel: log.columns[channel].copy()})
    columns[channel][list(rows)] += size
    runs = list(case.runs)
    runs[run] = dataclasses.replace(log, columns=columns)
    return dataclasses.replace(case, runs=tuple(runs))


# ---- times in sentences --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("t", "said"),
    [
        (0.0, "0"),
        (2.99, "2.99"),
        (0.1 + 0.2, "0.3"),
        (20000.125, "20000.125"),
        (1.7e9, "1700000000"),
        (1700000003.0123456, "1700000003.012346"),
        (-1.5, "-1.5"),
        (2e-5, "0.00002"),
    ],
)
def test_a_time_is_said_as_it_stands_in_the_log(t, said):
    assert moment(t) == said


@pytest.mark.parametrize("start", [0.0, 20000.0, 1.7e9])
def test_a_time_in_a_sentence_can_be_found_in_the_log(case, start):
    def edit(t, columns):
        columns["x"][300] += 0.1
        columns["w_r"][200:240] = columns["w_r"][200]
        columns["yaw"] = np.angle(np.exp(3j * columns["yaw"]))
        keep = (t < 5.0) | (t > 6.0)
        for name in columns:
            columns[name] = columns[name][keep]
        return start + t[keep]

    gate = examine(changed(case, edit))
    for kind in ("glitch", "frozen", "wrapped", "gap"):
        assert gate.of(kind)
        for finding in gate.of(kind):
            times = re.findall(r"at t = ([0-9.e+-]+)|from t = ([0-9.e+-]+)", finding.text)
            said = {float(one) for pair in times for one in pair if one}
            rows = 0.01 * np.arange(801)
            assert said and all(np.abs(start + rows - t).min() < 1e-5 for t in said)
            assert not any("e" in one for pair in times for one in pair)


# ---- isolated samples ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("channel", "size"),
    [
        ("x", 0.1),
        ("y", -0.1),
        ("yaw", 0.2),
        ("yaw", 2 * np.pi),
        ("th_l", 0.5),
        ("th_r", -30.0),
        ("w_l", 2.0),
        ("w_r", -40.0),
        ("gyro_z", 0.5),
        ("i_l", 1.0),
        ("i_r", -20.0),
        ("v_bus", 100.0),
        ("v_bus", -9.0),
    ],
)
@pytest.mark.parametrize("run", [0, 1, 2])
def test_one_sample_far_off_is_set_aside_and_nothing_else(case, channel, size, run):
    bad = spoiled(case, channel, size, run=run)
    gate = examine(bad)
    name = case.runs[run].name
    assert aside(bad, gate) == {(name, channel): [300]}
    (glitch,) = gate.of("glitch")
    assert (glitch.run, glitch.channel) == (name, channel) and "at t = 3 s" in glitch.text
    assert glitch.share == 1 / len(case.runs[run].t) and "(0.12 %)" in glitch.text


@pytest.mark.parametrize("row", [0, 1, 800])
@pytest.mark.parametrize(
    ("channel", "size"), [("x", 0.1), ("yaw", 0.2), ("th_l", 0.5), ("w_l", 100.0), ("v_bus", 100.0)]
)
def test_a_start_or_an_end_far_off_is_set_aside_where_the_robot_cannot_do_it(case, channel, size, row):
    bad = spoiled(case, channel, size, rows=(row,))
    assert aside(bad, examine(bad)) == {(case.runs[0].name, channel): [row]}


@pytest.mark.parametrize("off_rad", [3.0, -2 * np.pi, 21.0, 1000.0])
def test_an_angle_that_is_all_there_is_comes_back_within_two_samples_only_as_a_glitch(tmp_path, off_rad):
    """Driven by torque nothing in the file bounds a speed, and no other channel saw the jump; nor is it a turn that was
    wrapped.
    """
    case = read_case(write_axis_case(tmp_path / "case", "linear", "torque", currents=False))
    case = without(case, "w_l")
    assert set(aside(case, examine(case))) == set()
    bad = spoiled(case, "th_l", off_rad, rows=(300, 520))
    gate = examine(bad)
    assert aside(bad, gate) == {(case.runs[0].name, "th_l"): [300, 520]}
    assert not gate.of("wrapped")


def test_more_than_a_handful_are_not_glitches(case):
    # What cannot be may be a tenth of the samples.
    rows = tuple(range(50, 750, 8))
    bad = spoiled(case, "x", 0.2, rows)
    few = spoiled(case, "x", 0.2, rows[::3])
    assert len(aside(few, examine(few))["spin", "x"]) == len(rows[::3])
    gate = examine(spoiled(spoiled(bad, "x", 0.2, rows, run=1), "x", 0.2, rows, run=2))
    assert gate.of("glitch") == () and "none is set aside" in gate.of("isolated")[0].text


@pytest.mark.parametrize(("channel", "size"), [("w_r", -27.0), ("gyro_z", 9.0)])
def test_a_sample_far_off_is_set_aside_where_a_command_steps_next_to_it(case, channel, size):
    log = next(log for log in case.runs if log.name == "steps")
    step = int(np.flatnonzero(np.abs(np.diff(log.columns["v_cmd_l"])) > 3.0)[2])
    bad = spoiled(case, channel, size, rows=(step + 1,), run=case.runs.index(log))
    assert aside(bad, examine(bad)) == {("steps", channel): [step + 1]}


def test_a_sample_that_cannot_be_is_no_witness_of_another_next_to_it(case):
    bad = spoiled(spoiled(case, "th_r", -30.0, rows=(301,)), "w_r", -40.0, rows=(300,))
    name = case.runs[0].name
    assert aside(bad, examine(bad)) == {(name, "th_r"): [301], (name, "w_r"): [300]}


@pytest.mark.parametrize(("channel", "size"), [("gyro_z", 9.0), ("i_l", -3.0)])
def test_at_a_kilohertz_no_turn_or_current_is_back_in_a_row_whatever_the_command(channel, size):
    robot = builtin_robot("burger")
    log = make_run("steps", nominal_model(robot), robot, "steps", 3.0, 3, step_s=0.001)
    step = int(np.flatnonzero(np.abs(np.diff(log.columns["v_cmd_l"])) > 3.0)[0])
    fast = Case("fast", robot, (log,))
    bad = spoiled(fast, channel, size, rows=(step + 2,))
    assert aside(fast, examine(fast)) == {} and aside(bad, examine(bad)) == {("steps", channel): [step + 2]}


def rough(kind, seconds=6.0, step=1, name="run"):
    """A run of the nominal burger with an edited motion: an impact, a stall, a fast start, a step of the pose."""
    robot = builtin_robot("burger")
    log = make_run(name, nominal_model(robot), robot, "steps", seconds, 3)
    columns = {c: v.copy() for c, v in log.columns.items()}
    k, t = 310, log.t
    after = np.exp(-np.maximum(t - t[k], 0.0) / 0.02) * (t >= t[k])
    if kind == "impact":
        # Both wheels stop at once and the motors speed them up again within their time constant.
        for c in ("w_l", "w_r", "gyro_z"):
            columns[c] -= columns[c][k - 1] * after
        for s in "lr":
            columns[f"i_{s}"] += 1.69 * log.columns[f"w_{s}"][k - 1] / 8.6 * after
    elif kind == "stall":
        for c in ("w_l", "i_l"):
            columns[c][k:] = (0.0 if c == "w_l" else columns["v_cmd_l"][k:] / 8.6) + 0.004 * np.sin(37.0 * t[k:])
        columns["th_l"][k:] = columns["th_l"][k]
    elif kind == "jump":
        columns["x"][k:] += 0.3
        columns["yaw"][k:] += 0.5
    elif kind == "inrush":
        columns["v_cmd_l"][k - 20 : k] = 6.0
        columns["v_cmd_l"][k:] = -6.0
        columns["i_l"][k] -= 12.0 / 8.6
    rows = slice(None, None, step)
    return Case("rough", robot, (RunLog(name, log.meta, t[rows], {c: v[rows] for c, v in columns.items()}),))


@pytest.mark.parametrize("step", [1, 2, 5, 10])
@pytest.mark.parametrize("kind", ["", "impact", "stall", "jump", "inrush"])
def test_what_a_robot_does_is_no_glitch(kind, step):
    case = rough(kind, step=step)
    assert aside(case, examine(case)) == {}


@pytest.mark.parametrize(
    "change",
    [
        lambda m: m.add("backlash", 0.1),
        lambda m: m.add("coulomb", 0.2),
        lambda m: m.add("deadzone", 2.0),
        lambda m: m.put("limit", 4.0),
        lambda m: m.add("source_resistance", 3.0),
        lambda m: m.put("measurement_delay", 0.2),
        lambda m: (m.put("stiffness", 0.5), m.put("damping", 0.001)),
        lambda m: m.put("ripple", 0.05),
    ],
)
def test_effects_are_no_glitches(change):
    case = make_case(change)
    assert aside(case, examine(case)) == {}


# ---- stretches -----------------------------------------------------------------------------------------------------


def test_held_samples_are_set_aside_but_the_first(case):
    def edit(_, columns):
        columns["w_r"][200:240] = columns["w_r"][200]

    bad = changed(case, edit)
    assert aside(bad, examine(bad))["spin", "w_r"] == list(range(201, 240))


def test_a_sensor_read_twice_a_sample_was_held_only_where_it_repeats_far_longer(case):
    def edit(_, columns):
        columns["w_r"][1::2] = columns["w_r"][:-1:2]
        columns["w_r"][200:280] = columns["w_r"][200]

    bad = changed(case, edit)
    assert aside(bad, examine(bad))["spin", "w_r"] == list(range(201, 280))
    twice = changed(case, lambda _, columns: columns["w_r"].__setitem__(slice(1, None, 2), columns["w_r"][:-1:2]))
    assert aside(twice, examine(twice)) == {}


def test_a_few_equal_samples_of_a_noisy_channel_were_held(case):
    def edit(_, columns):
        columns["w_r"][200:208] = columns["w_r"][200]

    bad = changed(case, edit)
    assert aside(bad, examine(bad))["spin", "w_r"] == list(range(201, 208))


def test_a_robot_at_rest_whose_encoder_repeats_itself_keeps_every_sample(case):
    def edit(t, columns):
        for c in columns:
            if c.startswith(("w_", "th_", "gyro")):
                columns[c][t < 0.3] = 0.0

    still = changed(case, edit)
    assert aside(still, examine(still)) == {}


def at_rest_until(seconds, channels, **offsets):
    """An edit that makes channels repeat 0 exactly, and shifts others, for the first seconds: encoders at a
    standstill.
    """

    def edit(t, columns):
        for c in channels:
            columns[c][t < seconds] = 0.0
        for c, offset in offsets.items():
            columns[c] += offset

    return edit


def standing(robot=None, **commands):
    """A run of 8 s that stands for 2 s in the middle; `commands` scale the sides."""
    robot = robot or builtin_robot("burger")
    t = np.arange(801) * 0.01
    v = 5.0 * np.sin(2 * np.pi * t / 2.7)[:, None] * np.array([commands.get("left", 1.0), commands.get("right", 1.0)])
    v[(t >= 3.0) & (t < 5.0)] = 0.0
    run = RunLog(
        "stand",
        make_run("stand", nominal_model(robot), robot, "steps").meta,
        t,
        {"v_cmd_l": v[:, 0], "v_cmd_r": v[:, 1]},
    )
    out = replay_run(nominal_model(robot), run_inputs(run, robot))
    return Case(
        "stand", robot, (dataclasses.replace(run, columns={**run.columns, **dict(zip(OUTPUTS, out.T))}),)
    ), robot


def noisy(case, robot, seed=3):
    """The case with the sensors' noise."""
    rng = np.random.default_rng(seed)
    return changed(
        case,
        lambda t, columns: columns.update(
            {c: columns[c] + robot.noise(c) * rng.standard_normal(len(t)) for c in OUTPUTS}
        ),
    )


def test_a_gyro_with_an_offset_does_not_make_a_standing_robot_move(case):
    still = changed(case, at_rest_until(0.3, ("w_l", "w_r", "th_l", "th_r"), gyro_z=0.05))
    assert aside(still, examine(still)) == {}


@pytest.mark.parametrize("missing", [(), ("th_l", "th_r"), ("th_l", "th_r", "gyro_z")])
def test_a_wheel_that_stands_while_the_other_turns_was_not_held(missing):
    clean, robot = standing(left=0.0)
    pivot = changed(noisy(clean, robot), at_rest_until(1.0, ("w_l",)))
    pivot = without(pivot, *missing)
    assert aside(pivot, examine(pivot)) == {}


@pytest.mark.parametrize("missing", [(), ("th_l", "th_r")])
def test_a_wheel_that_turns_while_its_speed_repeats_0_was_held(missing):
    clean, robot = standing()
    held = without(changed(noisy(clean, robot), at_rest_until(1.0, ("w_l",))), *missing)
    assert aside(held, examine(held)) == {("stand", "w_l"): list(range(1, 100))}


def test_a_body_that_goes_straight_may_repeat_its_yaw_rate():
    clean, robot = standing()
    straight = changed(noisy(clean, robot), at_rest_until(1.0, ("gyro_z",)))
    assert aside(straight, examine(straight)) == {}


def test_a_driver_that_is_off_shows_no_current_while_the_other_wheel_turns():
    clean, robot = standing(left=0.0)
    off = changed(noisy(clean, robot), at_rest_until(1.0, ("i_l",)))
    assert aside(off, examine(off)) == {}


def test_a_log_without_noise_that_settles_was_not_held():
    """A simulator's log: a steady speed repeats itself to the last digit that is written."""
    robot = builtin_robot("burger")
    t = np.arange(3001) * 0.004
    v = 5.0 + np.where((t > 5.0) & (t < 7.0), 0.0, 2.0 * np.sin(1.7 * (t - 5.0)))
    run = RunLog(
        "steady", make_run("steady", nominal_model(robot), robot, "steps").meta, t, {"v_cmd_l": v, "v_cmd_r": 0.9 * v}
    )
    out = replay_run(nominal_model(robot), run_inputs(run, robot)).astype(np.float32).astype(float)
    steady = Case("steady", robot, (dataclasses.replace(run, columns={**run.columns, **dict(zip(OUTPUTS, out.T))}),))
    same = np.diff(steady.runs[0].columns["w_l"]) == 0
    assert 0.05 < np.mean(same) < 0.2
    assert aside(steady, examine(steady)) == {}


def test_clipped_samples_are_set_aside(case):
    def edit(_, columns):
        columns["w_l"] = np.clip(columns["w_l"], -3.0, 3.0)

    bad = changed(case, edit)
    found = aside(bad, examine(bad))
    assert set(found) == {(r.name, "w_l") for r in bad.runs if (r.columns["w_l"] == 3.0).sum() > 20}
    for (run, c), rows in found.items():
        values = next(r for r in bad.runs if r.name == run).columns[c][rows]
        assert set(np.abs(values)) == {3.0}


# ---- holes ---------------------------------------------------------------------------------------------------------


def thinned(case, keep):
    runs = tuple(
        dataclasses.replace(r, t=r.t[keep(r.t)], columns={c: v[keep(r.t)] for c, v in r.columns.items()})
        for r in case.runs
    )
    return dataclasses.replace(case, runs=runs)


def test_a_run_is_cut_at_a_hole_and_goes_on_from_the_measured_state(case):
    gate = examine(thinned(case, lambda t: (t < 3.0) | (t > 4.0)))
    assert [r.name for r in gate.case.runs] == ["spin", "spin (2)", "steps", "steps (2)", "weave", "weave (2)"]
    assert all(r.t[0] > 4.0 for r in gate.case.runs[1::2]) and all(r.t[-1] < 3.0 for r in gate.case.runs[::2])
    assert "1.02 s at t = 2.99 s" in gate.of("gap")[0].text and "into 2 run(s)" in gate.of("gap")[0].text


def test_a_part_is_replayed_from_its_measured_state(case):
    part = next(r for r in examine(thinned(case, lambda t: (t < 3.0) | (t > 4.0))).case.runs if r.name == "weave (2)")
    assert abs(part.columns["w_l"][0]) > 1.0
    replayed = replay_run(nominal_model(case.robot), run_inputs(part, case.robot))
    off = pooled([errors(part, case.robot, replayed)])
    # Four seconds hold three windows of a pose: too few to judge.
    assert gap({c: off[c] for c in ("w_l", "w_r", "i_l", "i_r", "gyro_z")}) < 1.05


def test_the_part_after_a_hole_starts_where_every_speed_is_measured(case):
    def edit(t, columns):
        columns["w_r"][(t > 3.5) & (t < 4.25)] = np.nan

    gate = examine(thinned(changed(case, edit), lambda t: (t < 3.0) | (t > 4.0)))
    assert all(4.25 <= r.t[0] < 4.27 for r in gate.case.runs[1::2])
    assert "% of the rows left out" in gate.of("gap")[0].text


def test_without_a_measured_speed_the_part_that_can_start_is_kept_and_said(case):
    gate = examine(thinned(without(case, "w_l", "w_r"), lambda t: (t < 5.0) | (t > 6.0)))
    assert [r.name for r in gate.case.runs] == ["spin", "steps", "weave"]
    assert all(r.t[-1] < 5.0 for r in gate.case.runs)
    assert "cannot start moving" in gate.of("gap")[0].text


def test_a_hole_of_minutes_is_refused(case):
    with pytest.raises(InputError, match=r"spin: t: no row for 180 s after 3.99 s: two recordings"):
        examine(changed(case, lambda t, _: np.where(t < 4.0, t, t + 180.0)))


# ---- noise ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rounding", "step"),
    [
        (lambda v: np.round(v, 2), 0.01),
        (lambda v: np.round(v, 1), 0.1),
        (lambda v: np.round(v * 4), 1.0),
        (lambda v: np.round(v * 651.9) / 651.9, 1 / 651.9),
        (lambda v: np.round(v / 0.024) * 0.024 + 0.007, 0.024),
        (lambda v: np.round(np.round(v * 50) / 50, 6), 0.02),
        (lambda v: v, 0.0),
        (lambda v: v.astype(np.float32), 0.0),
    ],
)
def test_the_step_of_a_rounding_is_found(rounding, step):
    rng = np.random.default_rng(1)
    values = 3.0 * np.sin(np.linspace(0, 20, 2000)) + 0.02 * rng.standard_normal(2000)
    assert step_of(rounding(values)) == pytest.approx(step, rel=0.02, abs=2e-5)


def test_of_significant_digits_the_typical_step_counts():
    rng = np.random.default_rng(1)
    values = 3.0 * np.sin(np.linspace(0, 20, 2000)) + 0.02 * rng.standard_normal(2000)
    digits = np.array([float(f"{v:.3g}") for v in values])
    true = np.sqrt(12) * np.std(digits - values)
    assert step_of(digits) == pytest.approx(true, rel=0.1)


def test_counts_over_uneven_times_show_their_step():
    rng = np.random.default_rng(2)
    t = np.cumsum(0.01 + 0.003 * rng.random(1500))
    counts = np.round(400.0 * np.cumsum(np.diff(t, prepend=0.0) * 3.0 * np.sin(t)))
    speed = np.diff(counts, prepend=0.0) / 400.0 / np.diff(t, prepend=t[0] - 0.01)
    assert step_of(speed, t) == pytest.approx(1 / 400.0 / np.median(np.diff(t)), rel=0.05)


def counted(t, angle, counts):
    """Speed by the counts (a turn) since the sample before, (n,) rad/s, of an angle (n,) rad."""
    step = 2.0 * np.pi / counts
    return np.diff(np.floor(angle / step) * step, prepend=0.0) / np.diff(t, prepend=t[0] - (t[1] - t[0]))


def test_a_speed_of_three_levels_shows_its_step():
    t = np.arange(0.0, 10.0, 0.05)
    speed = counted(t, 8.0 * np.sin(t), 12)
    assert len(np.unique(np.round(speed, 6))) == 3
    assert step_of(speed) == pytest.approx(2.0 * np.pi / 12 / 0.05)
    assert step_of(np.round(speed, 2)) == pytest.approx(2.0 * np.pi / 12 / 0.05, rel=1e-3)


def test_few_levels_on_no_even_grid_and_few_values_show_no_step():
    assert step_of(np.tile([0.0, 1.234567, 3.141593], 50)) == 0.0
    assert step_of(np.linspace(0.0, 0.777777, 8) ** 2) == 0.0


def test_counts_over_uneven_times_show_their_step_behind_decimals():
    rng = np.random.default_rng(2)
    t = np.cumsum(0.05 + 0.01 * rng.random(600))
    assert step_of(np.round(counted(t, 20.0 * np.sin(t), 60), 2), t) == pytest.approx(
        2 * np.pi / 60 / np.median(np.diff(t)), rel=0.05
    )


def test_a_speed_by_few_counts_is_coarse_and_not_clipped(case):
    """Between two of its levels a coarse sensor stands still while the robot moves on; that is no limit."""
    coarse = changed(
        case,
        lambda t, columns: columns.update(w_l=counted(t, columns["th_l"], 24), w_r=counted(t, columns["th_r"], 24)),
    )
    gate = examine(coarse)
    assert not gate.of("clipped") and not gate.of("frozen")
    assert gate.case.robot.noise("w_l") == pytest.approx(2.0 * np.pi / 24 / 0.01 / np.sqrt(12), rel=0.05)


def test_rounding_adds_to_the_declared_noise(case):
    gate = examine(changed(case, lambda _, columns: columns.update(gyro_z=np.round(columns["gyro_z"], 1))))
    assert gate.case.robot.noise("gyro_z") == pytest.approx(np.hypot(0.003, 0.1 / np.sqrt(12)), rel=1e-6)
    assert gate.case.robot.noise("w_l") == pytest.approx(0.02, rel=1e-6)
    assert {f.channel for f in gate.of("rounded")} == {"gyro_z"}


# ---- clock ---------------------------------------------------------------------------------------------------------


def test_jitter_of_the_stamps_is_measured(case):
    rng = np.random.default_rng(5)
    gate = examine(changed(case, lambda t, _: t + 0.001 * rng.standard_normal(len(t))))
    assert gate.timing.jitter_s == pytest.approx(0.001, rel=0.1)
    assert "stamps jitter by 1 ms" in gate.of("jitter")[0].text or "stamps jitter by 0.9" in gate.of("jitter")[0].text
    assert examine(case).timing.jitter_s < 1e-9


def test_a_lag_is_measured_where_it_is_certain():
    lags = examine(make_case(lambda m: m.put("command_delay", 0.33))).timing.lag_s
    assert lags == {"w_l": pytest.approx(0.33, abs=0.003), "w_r": pytest.approx(0.33, abs=0.003)}
    assert examine(make_case()).timing.lag_s == {"w_l": 0.0, "w_r": 0.0}


def test_commands_logged_more_seldom_than_the_motor_answers_are_named(case):
    assert examine(case).timing.commands_enough
    log = case.runs[2]
    seldom = dataclasses.replace(
        case, runs=(dataclasses.replace(log, t=log.t[::5], columns={c: v[::5] for c, v in log.columns.items()}),)
    )
    gate = examine(seldom)
    assert not gate.timing.commands_enough and gate.timing.command_step_s == pytest.approx(0.05)
    assert "between rows is not known" in gate.of("command_rate")[0].text


def test_the_origin_of_time_changes_nothing(case):
    gate, since_1970 = examine(case), examine(changed(case, lambda t, _: t + 1.7e9))
    assert [f.kind for f in since_1970.findings] == [f.kind for f in gate.findings]
    assert since_1970.case.robot.rounding == gate.case.robot.rounding and gate.case.robot.rounding
    assert since_1970.timing.step_s == pytest.approx(0.01, rel=1e-4)


def stamped(case, seconds, seed=5):
    """The case with stamps that are off by so much, one standard deviation, of rows that were taken when they should
    be.
    """
    rng = np.random.default_rng(seed)
    return changed(
        case, lambda t, _: np.maximum.accumulate(t + seconds * rng.standard_normal(len(t))) + 1e-9 * np.arange(len(t))
    )


def uneven(change=None, scatter_s=0.0, drift_s=0.0, seed=2):
    """Three runs that were taken when the stamps say, of rows 10 ms apart: `scatter_s` about a grid, each `drift_s`
    after the last.
    """
    robot = builtin_robot("burger")
    model = nominal_model(robot)
    if change is not None:
        change(model)
    rng = np.random.default_rng(seed)
    runs = []
    for run in make_case().runs:
        n = len(run.t)
        t = np.maximum.accumulate(
            run.t + scatter_s * rng.standard_normal(n) + np.cumsum(drift_s * rng.random(n))
        ) + 1e-9 * np.arange(n)
        columns = {c: v for c, v in run.columns.items() if c.startswith("v_cmd")}
        out = replay_run(model, run_inputs(RunLog(run.name, run.meta, t, columns), robot))
        columns |= {c: out[:, k] + robot.noise(c) * rng.standard_normal(n) for k, c in enumerate(OUTPUTS)}
        runs.append(RunLog(run.name, run.meta, t, columns))
    return Case("uneven", robot, tuple(runs))


def left(runs, robot):
    """The gap that the nominal robot leaves."""
    model = nominal_model(robot)
    return gap(pooled([errors(log, robot, replay_run(model, run_inputs(log, robot))) for log in runs]))


CHANGES = {"sound": None, "delay": lambda m: m.put("command_delay", 0.15), "friction": lambda m: m.put("coulomb", 0.02)}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_rows_that_come_evenly_get_an_even_clock(change):
    """Their stamps scatter; whatever is wrong with the robot, it answers when it was asked."""
    exact = make_case(change)
    gate = examine(stamped(exact, 0.002))
    assert gate.of("even")
    for log, cleaned in zip(exact.runs, gate.case.runs):
        assert np.abs((cleaned.t - cleaned.t[0]) - (log.t - log.t[0])).max() < 5e-4
    assert gate.timing.stamps_s == 0.0


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
@pytest.mark.parametrize(("scatter_s", "drift_s"), [(0.002, 0.0), (0.004, 0.0), (0.0, 0.004)])
def test_rows_that_were_taken_unevenly_keep_their_times(change, scatter_s, drift_s):
    """A logger that reads when it can, and stamps when it read: nothing is wrong with its clock."""
    taken = uneven(change, scatter_s, drift_s)
    gate = examine(taken)
    assert not gate.of("even") and not gate.of("stamps")
    assert all(np.array_equal(a.t, b.t) and not b.unsure for a, b in zip(taken.runs, gate.case.runs))
    assert gate.timing.stamps_s == 0.0 and (gate.timing.jitter_s > 5e-4 or not scatter_s)


def test_a_replay_that_runs_away_says_nothing_of_a_clock(case, monkeypatch):
    late = stamped(case, 0.002)
    monkeypatch.setattr(stamps, "replay_run", lambda _, inputs: np.full((len(inputs[0]), len(OUTPUTS)), np.nan))
    found, told = stamps.evened(late, {c: case.robot.noise(c) for c in OUTPUTS}, 0.0)
    assert found is late and not told


def test_missing_rows_do_not_shift_the_even_clock():
    rng = np.random.default_rng(3)
    even = 5.0 + 0.01 * np.flatnonzero(rng.random(800) > 0.03)
    found = stamps.even_times(even + 0.0015 * rng.standard_normal(len(even)))
    assert np.abs(found - found[0] - (even - even[0])).max() < 2e-4


@pytest.mark.parametrize("n", [50, 5000, 30000])
def test_a_clock_is_even_on_short_logs_and_long_ones(n):
    rng = np.random.default_rng(4)
    even = 1.7e9 + 0.00503 * np.arange(n)
    found = stamps.even_times(even + 0.0005 * rng.standard_normal(n))
    assert np.abs(found - found[0] - (even - even[0])).max() < 5e-4


def test_a_clock_that_is_even_or_walks_is_left_as_it_is():
    rng = np.random.default_rng(5)
    assert stamps.even_times(0.01 * np.arange(500)) is None
    assert stamps.even_times(np.cumsum(0.01 * (0.5 + rng.random(500)))) is None
    assert stamps.even_times(np.sort(5.0 * rng.random(500))) is None


def late_and_uneven(seconds=0.002):
    """Rows that are taken each some 2 ms after they should be, with stamps that are off besides."""
    return stamped(uneven(drift_s=0.004), seconds)


def test_stamps_that_are_off_are_measured_by_the_angles():
    gate = examine(late_and_uneven())
    assert gate.timing.stamps_s == pytest.approx(0.002, rel=0.15)
    assert gate.of("stamps") and not gate.of("even")


def test_what_a_stamp_is_off_counts_as_noise_where_a_channel_changes():
    """The nominal robot leaves a gap of one, though its samples are off by far more than their sensors' noise."""
    late = late_and_uneven()
    assert left(late.runs, late.robot) > 1.1
    assert left(examine(late).case.runs, late.robot) == pytest.approx(1.0, abs=0.1)


# ---- two glitches side by side
# -----------------------------------------------------------------------------------


@pytest.mark.parametrize("apart", [1, 2])
def test_glitches_of_two_channels_next_to_each_other_are_no_witnesses(case, apart):
    """What moved the robot is in all its channels in the same row."""
    both = spoiled(spoiled(case, "w_r", 12.0, rows=(300,)), "gyro_z", 0.6, rows=(300 - apart,))
    assert aside(case, examine(both)) == {("spin", "w_r"): [300], ("spin", "gyro_z"): [300 - apart]}


# ---- glitches among steps of the commands
# -----------------------------------------------------------------------------


def restless(delay=0.0):
    """A run whose commands jump every 0.1 s between two levels, of which every other one turns a wheel about."""
    robot = builtin_robot("burger")
    model = nominal_model(robot)
    model.put("command_delay", delay)
    rng = np.random.default_rng(8)
    run = make_case().runs[0]
    v = 5.0 * np.sign(rng.standard_normal((len(run.t) // 10 + 1, 2)))[np.arange(len(run.t)) // 10]
    columns = {"v_cmd_l": v[:, 0], "v_cmd_r": v[:, 1]}
    out = replay_run(model, run_inputs(RunLog("prbs", run.meta, run.t, columns), robot))
    columns |= {c: out[:, k] + robot.noise(c) * rng.standard_normal(len(run.t)) for k, c in enumerate(OUTPUTS)}
    return Case("restless", robot, (RunLog("prbs", run.meta, run.t, columns),))


@pytest.mark.parametrize(("channel", "size"), [("i_r", 3.0), ("gyro_z", 6.0), ("w_l", -30.0)])
@pytest.mark.parametrize("row", [300, 301, 305])
def test_a_glitch_among_steps_of_the_commands_stands_out_of_what_the_replay_leaves(channel, size, row):
    """The commands could have driven the robot there and back; but they did so elsewhere, too, and the replay was
    there.
    """
    clean = restless()
    assert aside(clean, examine(clean)) == {}
    assert aside(clean, examine(spoiled(clean, channel, size, rows=(row,)))) == {("prbs", channel): [row]}


@pytest.mark.parametrize("delay", [0.004, 0.01, 0.03])
def test_what_comes_late_at_every_step_is_no_glitch(delay):
    late = restless(delay)
    assert aside(late, examine(late)) == {}


def test_what_both_wheels_show_in_one_row_is_no_glitch():
    hit = spoiled(spoiled(restless(), "w_l", -8.0, rows=(305,)), "w_r", -8.0, rows=(305,))
    assert aside(restless(), examine(hit)) == {}


def test_what_follows_the_one_step_of_a_run_is_no_glitch(case):
    """Nothing else in the run tells what a step does."""
    robot = builtin_robot("burger")
    run = case.runs[0]
    columns = {c: np.where(run.t < 4.0, 0.0, 6.0) for c in ("v_cmd_l", "v_cmd_r")}
    out = replay_run(nominal_model(robot), run_inputs(RunLog("step", run.meta, run.t, columns), robot))
    rng = np.random.default_rng(9)
    columns |= {c: out[:, k] + robot.noise(c) * rng.standard_normal(len(run.t)) for k, c in enumerate(OUTPUTS)}
    columns["i_r"][402] += 1.0
    once = Case("once", robot, (RunLog("step", run.meta, run.t, columns),))
    assert aside(once, examine(once)) == {}


def test_a_short_run_s_clock_is_told_by_the_others():
    exact = make_case(seconds=6.0)
    short = dataclasses.replace(exact, runs=(*exact.runs[:2], exact.runs[2].rows(0, 45)))
    gate = examine(stamped(short, 0.002))
    for log, cleaned in zip(short.runs, gate.case.runs):
        assert np.abs((cleaned.t - cleaned.t[0]) - (log.t - log.t[0])).max() < 1e-3
