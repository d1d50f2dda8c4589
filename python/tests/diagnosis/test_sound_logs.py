"""No sound log is refused: coasts and brakes, staircases of settled speeds, moments, times since 1970, garbage at the
start, and channels that hold what another should."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import changed, make_case, without

from rtds_host.contract import Axis, Case, RunLog, RunMeta, builtin_robot
from rtds_host.diagnosis.gate import examine
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.errors import InputError
from rtds_host.plant.schema import OUTPUT_INDEX

ROBOT = builtin_robot("burger")
# A gear motor alone, with a wheel in the air.
BENCH = replace(
    ROBOT,
    chassis=None,
    axis=Axis(kind="inertia", inertia_kg_m2=2.0e-5),
    motor=replace(ROBOT.motor, gear_ratio=20.0, resistance_ohm=3.0, rotor_inertia_kg_m2=1.0e-6),
)


def bench_run(name: str, t: np.ndarray, volts: np.ndarray, start: float = 0.0, change=None, seed: int = 0) -> RunLog:
    """A run of one wheel in the air with its sensors' noise, begun at a speed, rad/s."""
    model = nominal_model(BENCH)
    if change is not None:
        change(model)
    log = RunLog(name, RunMeta(scenario=name), t, {"v_cmd_l": volts, "w_l": np.full(len(t), start)})
    out = replay_run(model, run_inputs(log, BENCH))
    rng = np.random.default_rng(seed)
    measured = {
        c: out[:, OUTPUT_INDEX[c]] + BENCH.noise(c) * rng.standard_normal(len(t)) for c in ("i_l", "w_l", "th_l")
    }
    return replace(log, columns={"v_cmd_l": volts, **measured})


def bench_case(*runs: RunLog, channels: tuple[str, ...] = ("i_l", "w_l", "th_l")) -> Case:
    kept = tuple(
        replace(run, columns={c: v for c, v in run.columns.items() if c in ("v_cmd_l", *channels)}) for run in runs
    )
    return Case("bench", BENCH, kept)


def kinds(gate) -> set[tuple[str, str]]:
    return {(f.channel, f.kind) for f in gate.findings}


# ---- nothing commanded ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [-60.0, -8.0, 25.0])
@pytest.mark.parametrize("inertia", [0.3, 1.0, 6.0], ids="{}J".format)
def test_a_brake_that_lasts_longer_or_shorter_than_nominal_proves_nothing_of_a_command_s_unit(start, inertia):
    t = np.arange(0.0, 0.162, 0.001)
    brake = bench_run("brake", t, np.zeros(len(t)), start, lambda m: m.scale("axis_inertia", 20.0 * inertia))
    drive = bench_run("forward", t, np.where(t < 0.08, 2.0, 4.0), change=lambda m: m.scale("axis_inertia", inertia))
    for case in (bench_case(brake), bench_case(brake, drive), bench_case(brake, channels=("w_l",))):
        assert len(examine(case).case.runs) == len(case.runs)


@pytest.mark.parametrize("seconds, rows", [(0.1, 11), (0.1, 101), (0.15, 31)])
@pytest.mark.parametrize("since", [0.0, 1.7e9, -40.0])
def test_a_run_of_a_tenth_of_a_second_is_read_whenever_it_began(seconds, rows, since):
    t = np.linspace(0.0, seconds, rows)
    run = bench_run("moment", t, np.full(rows, 5.0))
    gate = examine(bench_case(replace(run, t=since + t)))
    assert {f.severity for f in gate.of("short")} == {"warning"}


@pytest.mark.parametrize("supply", [7.4, 12.0, 24.0])
def test_a_duty_in_place_of_volts_is_seen_next_to_a_brake(supply):
    t = np.arange(0.0, 0.5, 0.002)
    brake = bench_run("brake", t, np.zeros(len(t)), 30.0)
    drive = bench_run("forward", t, np.where(t < 0.2, 0.4, -0.9) * supply)
    duty = replace(drive, columns={**drive.columns, "v_cmd_l": drive.columns["v_cmd_l"] / supply})
    case = replace(bench_case(brake, duty), robot=replace(BENCH, supply_v=supply))
    with pytest.raises(InputError, match="v_cmd_l: .*a duty"):
        examine(case)


# ---- settled speeds ------------------------------------------------------------------------------------------------


def staircase(step_s: float, rows: int, change=None, before: bool = True) -> RunLog:
    """A row a step: the command until the next row, and the speed that the last one, or (not `before`) this row's own,
    settled at."""
    rng = np.random.default_rng(5)
    volts = rng.uniform(-11.0, 11.0, rows) if rows % 2 else np.linspace(-11.0, 11.0, rows)
    fine = np.arange(0.0, step_s * rows, 0.01)
    held = volts[np.minimum((fine / step_s).astype(int), rows - 1)]
    run = bench_run("fine", fine, held, change=change)
    t = step_s * np.arange(rows)
    at = np.searchsorted(fine, t + (0.0 if before else 0.9 * step_s) - 1e-9)
    return RunLog("stairs", RunMeta(), t, {"v_cmd_l": volts, "w_l": run.columns["w_l"][at]})


@pytest.mark.parametrize("before", [True, False], ids=["before", "own"])
@pytest.mark.parametrize("step_s, rows", [(1.09, 45), (1.0, 60), (0.5, 31), (4.0, 30)])
@pytest.mark.parametrize("friction", [0.0, 0.05])
def test_a_staircase_of_settled_speeds_is_read(step_s, rows, friction, before):
    run = staircase(step_s, rows, lambda m: m.put("coulomb", friction), before)
    gate = examine(bench_case(run, channels=("w_l",)))
    assert kinds(gate) >= {("t", "staircase")} and not gate.of("command_rate")


@pytest.mark.parametrize("step_s, seconds", [(0.001, 0.7), (0.005, 3.0)])
def test_the_same_pace_in_milliseconds_is_refused(step_s, seconds):
    t = np.arange(0.0, seconds, step_s)
    run = bench_run("steps", t, np.where((t / 0.1).astype(int) % 2 == 0, 6.0, -3.0))
    with pytest.raises(InputError, match="t: .*is it in milliseconds"):
        examine(bench_case(replace(run, t=1e3 * t), channels=("w_l",)))


# ---- what stands where a sample should -----------------------------------------------------------------------------


@pytest.mark.parametrize("channels", [("th_l",), ("th_l", "th_r"), ("x", "y"), ("yaw",)], ids=" ".join)
@pytest.mark.parametrize("rows, value", [(3, -8197530.0), (1, 759.7), (5, 4.0e4)])
def test_garbage_before_the_sensors_are_awake_is_set_aside_and_nothing_else(channels, rows, value):
    case = make_case()

    def garbage(_, columns):
        for c in channels:
            columns[c][:rows] = value

    gate = examine(changed(case, garbage))
    assert not gate.of("wrapped") and not gate.of("rounded")
    for log, sound in zip(gate.case.runs, case.runs):
        for c in sound.columns:
            missing = np.flatnonzero(np.isnan(log.columns[c]))
            assert list(missing) == (list(range(rows)) if c in channels else [])


@pytest.mark.parametrize("seed", [3, 4])
@pytest.mark.parametrize(
    "change",
    [
        lambda m: None,
        lambda m: m.put("speed_tau", 0.03),
        lambda m: m.scale("speed_gain", -1.0),
        lambda m: m.add("backlash", 0.05),
    ],
    ids=["nominal", "filter", "swapped", "play"],
)
def test_an_angle_and_its_speed_agree_whatever_effect_there_is(change, seed):
    gate = examine(make_case(change, seed=seed))
    assert not gate.of("contradicts") and not gate.of("start")


@pytest.mark.parametrize("dropped", [(), ("gyro_z",), ("x", "y", "yaw", "i_l", "i_r", "v_bus")], ids=len)
@pytest.mark.parametrize("of, by", [("th_l", "th_r"), ("th_r", "th_l"), ("w_l", "w_r")])
def test_a_channel_that_holds_the_other_wheel_s_is_said_and_set_aside(of, by, dropped):
    def copied(_, columns):
        columns[of] = columns[by].copy()

    gate = examine(changed(without(make_case(seed=2), *dropped), copied))
    assert [f.channel for f in gate.of("contradicts")] == [of]
    assert all(not log.has(of) for log in gate.case.runs) and all(log.has(by) for log in gate.case.runs)


@pytest.mark.parametrize("odd", ["gyro_z", "yaw"])
def test_of_gyro_yaw_and_wheels_the_one_that_two_contradict_is_set_aside(odd):
    rng = np.random.default_rng(4)

    def other(t, columns):
        rate = np.interp(t, np.arange(0.0, 9.0, 0.4), rng.uniform(-1.0, 1.0, 23))
        columns[odd] = rate if odd == "gyro_z" else np.cumsum(rate) * 0.01

    gate = examine(changed(make_case(), other))
    assert [f.channel for f in gate.of("contradicts")] == [odd]


@pytest.mark.parametrize(
    "change",
    [lambda m: m.scale("gyro_gain", -1.0), lambda m: m.scale("gyro_gain", 0.5), lambda m: m.put("gyro_bias", 0.2)],
    ids=["upside down", "half", "offset"],
)
def test_a_gyro_s_gain_and_offset_are_effects_and_no_contradiction(change):
    gate = examine(make_case(change))
    assert not gate.of("contradicts") and all(log.has("gyro_z") for log in gate.case.runs)


@pytest.mark.parametrize("since", [0.0, 1.7e9])
def test_a_run_that_is_given_twice_is_counted_once(since):
    case = make_case()
    again = replace(case.runs[1], name="again", t=since + case.runs[1].t, meta=replace(case.runs[1].meta, notes="x"))
    gate = examine(replace(case, runs=(*case.runs, again)))
    assert [log.name for log in gate.case.runs] == [log.name for log in case.runs]
    assert [f.run for f in gate.of("repeated")] == ["again"]


def test_the_same_drive_once_more_is_another_run():
    case = make_case()
    other = make_case(seed=1)
    gate = examine(replace(case, runs=(*case.runs, replace(other.runs[0], name="other"))))
    assert len(gate.case.runs) == 4 and not gate.of("repeated")
