"""The gate: what is wrong with a log is named with run, channel and figures; a sound log is left alone."""

import dataclasses

import numpy as np
import pytest
from diagnosis_cases import changed, make_case, without

from rtds_host.contract import Case, RunLog, RunMeta, builtin_robot
from rtds_host.diagnosis.gate import examine
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.errors import InputError
from rtds_host.plant.schema import OUTPUTS


@pytest.fixture(scope="module")
def case():
    return make_case()


def kinds(gate):
    return {(f.channel, f.kind) for f in gate.findings}


def scaled(*channels, factor):
    def edit(_, columns):
        for c in channels:
            columns[c] *= factor

    return edit


# ---- a sound log ---------------------------------------------------------------------------------------------------


def test_a_sound_log_gives_no_finding(case):
    assert examine(case).findings == ()


@pytest.mark.parametrize(
    "change",
    [
        lambda m: m.scale("speed_gain", 1.1),
        lambda m: m.scale("voltage_gain", -1.0),
        lambda m: m.add("coulomb", 0.05),
        lambda m: m.scale("yaw_inertia", 8.0),
        lambda m: m.put("limit", 5.0),
        lambda m: m.add("source_resistance", 1.5),
        lambda m: m.scale("current_gain", 1.8),
        lambda m: m.add("mass", 2.0),
        lambda m: m.put("speed_tau", 0.02),
        lambda m: m.add("backlash", 0.05),
        lambda m: m.add("deadzone", 0.7),
    ],
)
def test_effects_of_the_catalogue_are_no_fault_of_the_data(change):
    found = examine(make_case(change)).findings
    assert [f for f in found if f.severity != "note"] == []
    assert {f.kind for f in found} <= {"sign", "delay"}


# ---- units ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("channels", "factor", "unit"),
    [
        (("w_l", "w_r"), 57.29578, "degrees per second"),
        (("w_l", "w_r"), 9.549297, "revolutions per minute"),
        (("w_l", "w_r"), 0.033, "metres per second at the rim"),
        (("w_l", "w_r"), 258.5, "radians per second of the motor"),
        (("th_l", "th_r"), 57.29578, "degrees"),
        (("i_l", "i_r"), 1000.0, "milliamperes"),
        (("gyro_z",), 57.29578, "degrees per second"),
        (("yaw",), 57.29578, "degrees"),
        (("x", "y"), 1000.0, "millimetres"),
        (("v_bus",), 1000.0, "millivolts"),
        (("v_cmd_l", "v_cmd_r"), 1 / 12, r"shares of the supply \(a duty\)"),
        (("v_cmd_l", "v_cmd_r"), 1000.0, "millivolts"),
    ],
)
def test_a_wrong_unit_ends_a_diagnosis_and_is_named_with_its_channels(case, channels, factor, unit):
    with pytest.raises(InputError, match=rf"{' and '.join(channels)}: .*: in {unit}\?$"):
        examine(changed(case, scaled(*channels, factor=factor)))


@pytest.mark.parametrize(
    ("channels", "factor", "never"),
    [
        (("x", "y"), 100.0, ""),
        (("w_l", "w_r"), 0.033, ""),
        (("w_l",), 60.0 / (2.0 * np.pi), "revolutions per minute"),
        (("i_r",), 1000.0, "milliamperes"),
    ],
)
def test_what_is_in_its_unit_in_other_runs_is_in_no_other_in_one(case, channels, factor, never):
    """A robot that slides down a slope goes as far in metres as its wheels say in centimetres. What no robot can do is
    refused for all that.
    """
    one = dataclasses.replace(
        case,
        runs=(
            *case.runs[:2],
            *changed(dataclasses.replace(case, runs=case.runs[2:]), scaled(*channels, factor=factor)).runs,
        ),
    )
    if never:
        with pytest.raises(InputError, match=never):
            examine(one)
        return
    gate = examine(one)
    told = [f for f in gate.of("scale") if f.channel in channels]
    assert told and all(f.run == case.runs[2].name and "in this run alone" in f.text for f in told)


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1 / 60, "minutes")])
def test_time_in_another_unit_ends_a_diagnosis(case, factor, unit):
    with pytest.raises(InputError, match=rf"t: .*is it in {unit}\?"):
        examine(changed(case, lambda t, _: factor * t))


def test_speeds_alone_give_away_a_clock_in_milliseconds(case):
    alone = without(case, "th_l", "th_r", "gyro_z", "x", "y", "yaw", "i_l", "i_r", "v_bus")
    with pytest.raises(InputError, match="is it in milliseconds"):
        examine(changed(alone, lambda t, _: 1000.0 * t))


@pytest.mark.parametrize("kind", ["w", "th"])
def test_wheels_alone_give_away_a_clock_in_minutes(case, kind):
    alone = without(
        case,
        *({"w_l", "w_r", "th_l", "th_r"} - {f"{kind}_l", f"{kind}_r"}),
        "gyro_z",
        "x",
        "y",
        "yaw",
        "i_l",
        "i_r",
        "v_bus",
    )
    with pytest.raises(InputError, match="t: is it in minutes"):
        examine(changed(alone, lambda t, _: t / 60.0))


@pytest.mark.parametrize(
    "change",
    [
        lambda m: None,
        lambda m: m.scale("speed_gain", -1.0),
        lambda m: m.scale("voltage_gain", 0.4),
        lambda m: m.add("coulomb", 0.1),
        lambda m: m.scale("rotor_inertia", 0.1),
        lambda m: m.put("command_delay", 0.3),
        lambda m: m.put("speed_tau", 0.1),
    ],
)
def test_a_fast_log_of_wheels_alone_is_left_as_it_is(change):
    """At 1 kHz, where minutes could be meant."""
    case = make_case(change, seconds=3.0, step_s=0.001)
    examine(without(case, "th_l", "th_r", "gyro_z", "x", "y", "yaw", "i_l", "i_r", "v_bus"))


@pytest.mark.parametrize(
    "change",
    [
        lambda m: m.scale("speed_gain", 2.0),
        lambda m: m.scale("speed_gain", 0.4),
        lambda m: m.scale("voltage_gain", 2.0),
        lambda m: m.scale("voltage_gain", 0.4),
        lambda m: m.scale("speed_gain", -1.0),
        lambda m: m.scale("gyro_gain", -1.0),
        lambda m: m.scale("current_gain", 2.0),
        lambda m: m.scale("torque_constant", 0.4),
        lambda m: m.scale("radius", 2.0),
        lambda m: (m.scale("voltage_gain", 2.0), m.scale("speed_gain", 2.0), m.scale("gyro_gain", 2.0)),
        lambda m: m.add("coulomb", 0.5),
        lambda m: m.put("command_delay", 0.5),
        lambda m: (m.add("coulomb", 0.1), m.add("viscous_wheel", 0.3), m.scale("speed_gain", 0.4)),
    ],
)
def test_effects_as_large_as_they_come_are_not_refused(change):
    examine(make_case(change))


# ---- sides and signs -----------------------------------------------------------------------------------------------


def test_exchanged_wheels_end_a_diagnosis_and_are_named(case):
    def sensors(_, columns):
        columns["w_l"], columns["w_r"] = columns["w_r"], columns["w_l"]

    def commands(_, columns):
        columns["v_cmd_l"], columns["v_cmd_r"] = columns["v_cmd_r"], columns["v_cmd_l"]

    for edit, names in ((sensors, "w_l and w_r"), (commands, "v_cmd_l and v_cmd_r")):
        with pytest.raises(InputError, match=f"are {names} exchanged"):
            examine(changed(case, edit))


def test_a_wheel_that_is_weaker_than_the_other_is_not_exchanged_with_it(case):
    """On one gentle curve the stronger motor may stand on the side that should be slower: that is a gain, and no
    exchange.
    """
    robot, t = case.robot, np.arange(0.0, 4.0, 0.01)
    volts = np.stack([2.5 * t, 2.4 * t], axis=1)
    model = nominal_model(robot)
    model.scale("voltage_gain", 0.8, (0,))
    commands = {"v_cmd_l": volts[:, 0], "v_cmd_r": volts[:, 1]}
    out = replay_run(model, run_inputs(RunLog("ramp", RunMeta(), t, commands), robot))
    noise = 0.02 * np.random.default_rng(1).standard_normal((2, len(t)))
    columns = {**commands, **{c: out[:, OUTPUTS.index(c)] + n for c, n in zip(("w_l", "w_r"), noise)}}
    examine(Case("curve", robot, (RunLog("ramp", RunMeta(), t, columns),)))


def test_a_short_move_is_seen_though_the_declared_noise_is_too_large(case):
    """The scatter from sample to sample says how noisy a channel is, whatever the file says."""

    def coasts(t, columns):
        for c in ("w_l", "w_r"):
            columns[c] = 0.04 * np.sin(2.0 * t) + 0.004 * np.random.default_rng(1).standard_normal(len(t))

    loud = dataclasses.replace(case.robot, sensors={"w_rad_s": 0.02})
    found = examine(dataclasses.replace(changed(without(case, "th_l", "th_r"), coasts), robot=loud))
    assert not found.of("still")


def test_swapped_leads_are_only_noted_for_the_catalogue_knows_them(case):
    signs = examine(changed(case, scaled("w_l", factor=-1.0))).of("sign")
    assert {(f.channel, f.severity) for f in signs} == {("w_l", "note")}


@pytest.mark.parametrize("missing", [(), ("gyro_z",), ("w_l", "w_r")])
def test_a_yaw_that_counts_to_the_right_ends_a_diagnosis(case, missing):
    with pytest.raises(InputError, match=r"yaw: runs against what the wheels.* counted to the right\?"):
        examine(changed(without(case, *missing), scaled("yaw", factor=-1.0)))


@pytest.mark.parametrize("channel", ["gyro_z", "i_l"])
def test_a_wrong_sign_is_named(case, channel):
    signs = examine(changed(case, scaled(channel, factor=-1.0))).of("sign")
    assert {f.channel for f in signs} == {channel} and all("opposite sign" in f.text for f in signs)


# ---- sensors -------------------------------------------------------------------------------------------------------


def test_a_dead_sensor_is_named_while_the_rest_goes_on(case):
    def edit(_, columns):
        columns["i_l"][:] = 0.012
        columns["gyro_z"][:] = 0.0

    dead = examine(changed(case, edit)).of("dead")
    assert {f.channel for f in dead} == {"i_l", "gyro_z"}


def test_a_clipped_channel_is_named_with_its_limit(case):
    def edit(_, columns):
        columns["w_l"] = np.clip(columns["w_l"], -3.0, 3.0)

    clipped = examine(changed(case, edit)).of("clipped")
    assert {f.channel for f in clipped} == {"w_l"} and "3" in clipped[0].text


def test_held_samples_are_found(case):
    def edit(_, columns):
        columns["w_r"][200:240] = columns["w_r"][200]

    frozen = examine(changed(case, edit)).of("frozen")
    assert {f.channel for f in frozen} == {"w_r"} and "0.39 s" in frozen[0].text


@pytest.mark.parametrize("times", [1.0 / 30.0, 1.0 / 3.0, 1.0])
def test_a_robot_at_rest_holds_no_samples_however_little_noise_its_file_declares(case, times):
    """A speed repeats itself, about nothing, while all others show noise. A file that declares less of it makes no
    motion of that: what is set aside decides names, too."""
    rng, sigmas = np.random.default_rng(7), {c: case.robot.noise(c) for c in ("w_l", "w_r", "i_l", "i_r", "gyro_z")}

    def edit(_, columns):
        for channel, sigma in sigmas.items():
            columns[channel][150:300] = sigma * rng.standard_normal(150)
        columns["w_r"][200:240] = sigmas["w_r"]
        for channel in ("th_l", "th_r", "x", "y", "yaw"):
            columns[channel][150:300] = columns[channel][150]

    rested = changed(case, edit)
    sensors = {key: times * sigma for key, sigma in rested.robot.sensors.items()}
    found = examine(dataclasses.replace(rested, robot=dataclasses.replace(rested.robot, sensors=sensors)))
    assert "w_r" not in {f.channel for f in found.of("frozen")}


def test_a_wrapped_yaw_is_found(case):
    def edit(_, columns):
        columns["yaw"] = np.angle(np.exp(1j * (3 * columns["yaw"])))

    assert ("yaw", "wrapped") in kinds(examine(changed(case, edit)))


def test_a_channel_at_a_lower_rate_is_noted_with_its_rate(case):
    def edit(_, columns):
        columns["x"][np.arange(len(columns["x"])) % 5 > 0] = np.nan

    slow = examine(changed(case, edit)).of("slow")
    assert {f.channel for f in slow} == {"x"} and "20 Hz" in slow[0].text


# ---- time ----------------------------------------------------------------------------------------------------------


def thinned(case, keep):
    runs = tuple(
        RunLog(r.name, r.meta, r.t[keep(r.t)], {c: v[keep(r.t)] for c, v in r.columns.items()}) for r in case.runs
    )
    return Case(case.name, case.robot, runs)


def test_a_hole_in_the_log_is_named_with_its_place(case):
    gaps = examine(thinned(case, lambda t: (t < 2.0) | (t > 2.5))).of("gap")
    assert gaps and "0.51" in gaps[0].text or "0.52" in gaps[0].text


@pytest.mark.parametrize(("heavier", "warned"), [(1.0, True), (100.0, False)], ids=["of 22 ms", "of 180 ms"])
def test_rows_further_apart_than_the_machine_s_mechanical_time_constant_are_warned_of(case, heavier, warned):
    chassis = dataclasses.replace(case.robot.chassis, mass_kg=heavier * case.robot.chassis.mass_kg)
    few = thinned(case, lambda t: np.arange(len(t)) % 5 == 0)
    gate = examine(dataclasses.replace(few, robot=dataclasses.replace(few.robot, chassis=chassis)))
    assert (("t", "rate") in kinds(gate)) == warned


def test_uneven_rows_are_noted(case):
    rng = np.random.default_rng(3)
    gate = examine(changed(case, lambda t, _: t + 0.002 * rng.random(len(t))))
    assert ("t", "jitter") in kinds(gate)


def test_a_late_answer_is_noted_with_its_delay():
    late = examine(make_case(lambda m: m.put("measurement_delay", 0.03))).of("delay")
    assert {f.channel for f in late} == {"w_l", "w_r"}
    assert all("30 ms later" in f.text or "29 ms later" in f.text or "31 ms later" in f.text for f in late)


def test_an_answer_before_the_command_is_warned_of(case):
    def edit(t, columns):
        for c in ("w_l", "w_r"):
            columns[c] = np.interp(t + 0.04, t, columns[c])

    early = examine(changed(case, edit)).of("delay")
    assert early and all(f.severity == "warning" and "earlier" in f.text for f in early)


def test_runs_that_answer_later_and_earlier_are_distinguished(case):
    """One finding for all runs says what is so in all: not that every run is early since one is."""
    shift = iter((0.04, -0.04, 0.04))

    def edit(t, columns):
        by = next(shift)
        for c in ("w_l", "w_r"):
            columns[c] = np.interp(t + by, t, columns[c])

    told = examine(changed(case, edit)).of("delay")
    assert {(f.run, f.severity) for f in told} == {("spin", "warning"), ("steps", "note"), ("weave", "warning")}


def test_a_replay_that_begins_too_fast_makes_no_answer_early():
    """A wheel under friction, in motion when the log begins, and a slow ramp: the nominal robot first runs up to its
    own speed.
    """
    robot = builtin_robot("burger")
    model = nominal_model(robot)
    model.put("coulomb", 0.1)
    t = np.arange(0.0, 3.0, 0.01)
    columns = {c: 2.0 + 0.5 * t for c in ("v_cmd_l", "v_cmd_r")}
    out = replay_run(model, run_inputs(RunLog("ramp", RunMeta(), t, columns), robot))
    rng = np.random.default_rng(5)
    for c in ("w_l", "w_r"):
        columns[c] = out[:, OUTPUTS.index(c)] + robot.noise(c) * rng.standard_normal(len(t))
    late = slice(100, None)
    run = RunLog("ramp", RunMeta(), t[late] - t[late][0], {c: v[late] for c, v in columns.items()})
    assert not [f for f in examine(Case("ramp", robot, (run,))).of("delay") if f.severity == "warning"]


def test_a_wheel_that_turns_steadily_moves(case):
    """It scatters by no more than its noise, about a speed of many times that."""

    def edit(t, columns):
        for c in columns:
            columns[c] = np.full(len(t), 3.0 if c.startswith("v_cmd") else 4.0 if c.startswith("w_") else 0.0)
            if c.startswith("w_"):
                columns[c] += case.robot.noise(c) * np.random.default_rng(1).standard_normal(len(t))

    steady = without(changed(case, edit), "th_l", "th_r", "i_l", "i_r", "gyro_z", "x", "y", "yaw", "v_bus")
    examine(steady)


def test_a_command_beyond_the_supply_is_told(case):
    beyond = examine(changed(case, scaled("v_cmd_l", factor=1.6))).of("beyond_supply")
    assert {f.channel for f in beyond} == {"v_cmd_l"} and "more than the supply's 12 V" in beyond[0].text


def test_one_run_only_works_with_a_caveat(case):
    gate = examine(Case(case.name, case.robot, case.runs[:1]))
    assert len(gate.of("one_run")) == 1


def test_a_wheel_that_only_turns_forwards_is_noted(case):
    def edit(_, columns):
        for c in ("v_cmd_l", "w_l", "th_l"):
            columns[c] = np.abs(columns[c])

    assert ("w_l", "one_sign") in kinds(examine(changed(case, edit)))


# ---- what ends a diagnosis -----------------------------------------------------------------------------------------


def test_nothing_commanded_and_nothing_moving_ends_it(case):
    rng = np.random.default_rng(0)

    def edit(t, columns):
        for c in columns:
            columns[c] = np.zeros(len(t)) if c.startswith("v_cmd") else 0.0001 * rng.standard_normal(len(t))

    with pytest.raises(InputError, match=r"spin.*w_\*, th_\*.*nothing to diagnose"):
        examine(changed(case, edit))


def test_dead_wheel_sensors_end_it(case):
    def edit(t, columns):
        for c in ("w_l", "w_r", "th_l", "th_r"):
            columns[c] = np.zeros(len(t))

    with pytest.raises(InputError, match=r"w_\*, th_\*: constant"):
        examine(changed(case, edit))


def test_runs_of_a_moment_end_it(case):
    with pytest.raises(InputError, match="at least 0.1 s"):
        examine(thinned(case, lambda t: t < 0.095))


def test_a_channel_without_declared_noise_is_shown_but_not_used(case):
    robot = dataclasses.replace(case.robot, sensors={k: v for k, v in case.robot.sensors.items() if k != "gyro_rad_s"})
    assert ("gyro_z", "no_noise") in kinds(examine(Case(case.name, robot, case.runs)))


def test_missing_channels_are_no_fault(case):
    assert examine(without(case, "i_l", "i_r", "x", "y", "yaw", "v_bus")).findings == ()
