"""Machines of other sizes, and logs as loggers write them."""

import math

import numpy as np
import pytest

from rtds_host.blind import accounts, cases, machines, planar, scales
from rtds_host.blind.gap import channel_gaps, total
from rtds_host.blind.vocabulary import EFFECTS
from rtds_host.contract import RunLog, RunMeta, builtin_robot, read_case, read_run
from rtds_host.diagnosis.effects import CATALOGUE, SIDES
from rtds_host.diagnosis.predict import predicted_columns
from rtds_host.diagnosis.replay.model import nominal_model


def drawn(name, seed=0, torque=None):
    """A machine of a class; `torque` asks for an axis with or without torque mode."""
    for k in range(100):
        text = machines.draw_machine(np.random.default_rng([seed, k]), name)
        robot = machines.robot_of(text)
        if torque is None or (robot.driver.mode == "torque") == torque:
            return robot
    raise AssertionError("no such machine")


def driven(robot, name, machine, rate=500.0):
    """A run of steps of the machine, and its commands as a log."""
    seconds = 2.0 if robot.axis else 1.0 / (1 if name == "micromouse" else 0.3)
    t = np.round(np.arange(0, seconds + 1e-9, 1 / rate), 4)
    spec = {"rate": rate, "drive": 0.5, "machine": name}
    volts, _ = machines.commands("steps", t, np.random.default_rng(5), robot, spec, planar.scenario)
    raw = planar.run_machine(machine, t, volts.copy(), np.zeros(5), 0.0, 0.0, 0.0)
    columns = {f"v_cmd_{side}": volts[:, s] for s, side in enumerate(robot.sides)}
    return t, raw, RunLog("steps", RunMeta(scenario="steps"), t, columns)


KINDS = [(name, None) for name in machines.ROBOTS] + [
    (name, torque) for name in machines.AXES for torque in (False, True)
]


@pytest.mark.parametrize(("name", "torque"), KINDS)
def test_the_world_and_the_programs_own_replay_agree_on_every_nominal_machine(name, torque):
    """Two formulations of the same equations: what one of them got wrong at this size would show."""
    for seed in (1, 2):
        robot = drawn(name, seed, torque)
        t, raw, log = driven(robot, name, planar.nominal_machine(robot))
        assert all(np.isfinite(values).all() for values in raw.values())
        assert np.ptp(raw["w_l"]) > 20 * robot.noise("w_l")
        gaps = channel_gaps(
            t, {c: raw[c] for c in planar.noises(robot)}, predicted_columns(log, robot), planar.noises(robot)
        )
        assert max(gaps.values()) < 0.35, gaps


CAUSES = (
    "driver_deadzone",
    "coulomb_friction",
    "load_friction",
    "backlash",
    "gear_compliance",
    "payload_error",
    "rotor_inertia_error",
    "command_delay",
)
CASES = [(name, torque, CAUSES[k % len(CAUSES)]) for k, (name, torque) in enumerate(KINDS)]
CASES += [(name, torque, CAUSES[(k + 3) % len(CAUSES)]) for k, (name, torque) in enumerate(KINDS)]


@pytest.mark.parametrize(("name", "torque", "cause"), CASES)
def test_effects_mean_the_same_at_every_size(name, torque, cause):
    robot = drawn(name, 3, torque)
    of = scales.scale_of(robot, 0.002, 2.0)
    effect = scales.draw_sized(np.random.default_rng(4), cause, of, robot.axis and robot.axis.kind)
    machine = planar.nominal_machine(robot)
    planar.apply_effect(machine, effect)
    _, plain, _ = driven(robot, name, planar.nominal_machine(robot))
    t, raw, log = driven(robot, name, machine)
    model, named = nominal_model(robot), CATALOGUE[cause]
    values = {}
    for parameter in named.parameters:
        name_there, _, one = parameter.reported(robot.axis)
        values[parameter.name] = (
            effect["parameters"][name_there] / one if name_there in effect["parameters"] else parameter.null
        )
    side = next(side for side in named.sides if named.side_on(robot.axis, side) == effect["side"])
    named.apply(model, SIDES[side], values)
    other = predicted_columns(log, robot, model)
    noise = planar.noises(robot)
    seen = {c: raw[c] for c in noise}
    size = total(channel_gaps(t, seen, plain, noise))
    apart = total(channel_gaps(t, seen, other, noise))
    # Impacts of play differ between any two formulations of teeth.
    assert apart < max(0.35, (0.5 if cause == "backlash" else 0.1) * size), (size, apart, effect)


@pytest.mark.parametrize("name", machines.CLASSES)
def test_every_drawn_machine_is_one_that_could_be_built(name):
    for seed in range(20):
        robot = drawn(name, seed)
        assert all(value > 0 for value in robot.sensors.values())
        of = scales.scale_of(robot, 0.01, 2.0)
        assert of.torque > 0 and of.speed > 0
        if robot.chassis:
            low, high = machines.ROBOTS[name][0]
            assert 0.99 * low <= robot.chassis.mass_kg <= 1.01 * high
            assert robot.chassis.yaw_inertia_kg_m2 < robot.chassis.mass_kg * robot.chassis.track_width_m**2


def test_the_burger_keeps_its_tyres_teeth_and_step():
    """The other sizes' rules give the figures that the present kinds were made with."""
    machine = planar.nominal_machine(builtin_robot("burger"))
    names = {
        **{n: machine.side[k, 0] for k, n in enumerate(planar.SIDE_NAMES)},
        **{n: machine.world[k] for k, n in enumerate(planar.WORLD_NAMES)},
    }
    assert (names["tyre"], names["tyre_damping"]) == (planar.kernel.TYRE_N_PER_M, planar.kernel.TYRE_N_S_PER_M)
    assert (names["stop"], names["stop_damping"]) == (planar.kernel.STOP_NM_PER_RAD, planar.kernel.STOP_NM_S_PER_RAD)
    assert machine.step_s == planar.STEP_S


def test_a_machine_has_only_effects_that_it_can_have_and_its_log_can_show():
    pendulum = drawn("pendulum", torque=True)
    menu = accounts.possible(pendulum, ["w", "pose", "gyro_z"])
    assert "payload_error" in menu and "coulomb_friction" in menu
    assert not {"resistance_error", "current_gain", "gyro_bias", "speed_filter", "track_width_error"} & set(menu)
    assert set(accounts.possible(builtin_robot("burger"), [])) == set(EFFECTS)
    assert "longitudinal_slip" not in accounts.possible(drawn("competition"), [])  # its tyres would slide
    effect = scales.draw_sized(
        np.random.default_rng(1), "payload_error", scales.scale_of(drawn("inertia"), 0.01, 2.0), "inertia"
    )
    assert set(effect["parameters"]) == {"inertia_kg_m2"}


def test_loggers_round_as_they_say():
    values = np.array([0.0, 1.23456, -123.456, 0.00123456])
    assert machines.Logger(decimals=2).rounded("w_l", values) == pytest.approx([0, 1.23, -123.46, 0.0])
    assert machines.Logger(digits=3).rounded("w_l", values) == pytest.approx([0, 1.23, -123, 0.00123])
    assert machines.Logger(digits=3).rounded("th_l", values) == pytest.approx(values)


def spec_of(tier, kind, seed=0):
    """A spec of a tier on one class of machine, with one effect."""
    rng = np.random.default_rng(seed)
    spec = cases.draw_spec(rng, "none")
    old, machines.CLASSES = machines.CLASSES, (kind,)
    try:
        machines.draw_conditions(rng, spec, tier == "loggers")
    finally:
        machines.CLASSES = old
    side = "left" if kind in machines.AXES else "both"
    spec.update(
        tier=tier,
        effects=[
            {
                "id": "coulomb_friction",
                "side": side,
                "subsystem": "drivetrain",
                "parameters": {"torque_nm": 0.03 * scales.scale_of(machines.robot_of(spec["robot"]), 0.01, 1.0).torque},
            }
        ],
    )
    return spec


@pytest.mark.parametrize(("tier", "kind"), [("sizes", "micromouse"), ("loggers", "competition"), ("loggers", "linear")])
def test_a_case_of_any_machine_is_readable_and_closes_on_its_own_truth(tmp_path, tier, kind):
    spec = spec_of(tier, kind)
    spec["logger"] = machines.Logger(decimals=2, epoch_s=1.65e9, glitches=6) if tier == "loggers" else None
    spec.update(tolerance=False, colour=(0.0, 0.0), missing=[m for m in spec["missing"] if m not in ("i", "w", "th")])
    truth = cases.make_case(7, spec, tmp_path / "case", held_out=tmp_path / "held")
    case = read_case(tmp_path / "case")
    assert truth["machine"] == kind and truth["effects"][0]["gap_without"] > 1
    assert (case.runs[0].t[0] > 1e9) == (tier == "loggers")
    machine = planar.nominal_machine(case.robot)
    planar.apply_effect(machine, truth["effects"][0])
    held = read_case(tmp_path / "case").robot
    for folder in sorted((tmp_path / "held").iterdir()):
        run = read_run(folder, held)
        assert total(planar.replay_gap(machine, held, run, truth.get("noise"))) == pytest.approx(1.0, abs=0.3)
    if tier == "loggers":
        noise = {**{c: held.noise(c) for c in truth["noise"]}}
        assert all(value >= noise[c] for c, value in truth["noise"].items())
        glitched = max(total(planar.replay_gap(machine, held, run, truth["noise"])) for run in case.runs)
        assert glitched > 1.5 and math.isfinite(glitched)


def test_the_angle_of_an_axis_counts_though_nothing_has_a_heading():
    t = np.arange(0, 3.001, 0.01)
    gaps = channel_gaps(t, {"th_l": t}, {"th_l": 1.002 * t}, {"th_l": 0.001})
    assert gaps == {"th_l": pytest.approx(2 / math.sqrt(2))}


def test_a_lost_row_takes_no_command_with_it():
    """Commands hold until the next row: what is missing between two rows must not have changed them."""
    t = np.arange(0, 4.0, 0.02)
    columns = {"t": t, "v_cmd_l": np.where(t < 2, 3.0, -3.0), "w_l": t}
    robot = drawn("inertia")
    out = cases.as_logged(columns, machines.Logger(hole_rows=7), robot, np.random.default_rng(6), True, {})
    assert t.size - 7 <= out["t"].size < t.size
    held = out["v_cmd_l"][np.searchsorted(out["t"], t, side="right") - 1]
    assert np.array_equal(held, columns["v_cmd_l"])


def test_what_late_stamps_leave_is_not_asked_for_in_the_closure(tmp_path):
    spec = spec_of("loggers", "micromouse")
    spec.update(tolerance=False, dropped=0.0, colour=(0.0, 0.0), logger=machines.Logger(stamp_s=0.0005))
    truth = cases.make_case(7, spec, tmp_path / "case", held_out=tmp_path / "held")
    gaps = truth["held_out_gap"]
    assert truth["gap"]["known"] == 1.0 and 1.1 < gaps["known"] < gaps["before"]
