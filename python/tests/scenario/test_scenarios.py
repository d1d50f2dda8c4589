"""Scenarios: what they ask for, where they lead, and what they refuse."""

import math

import numpy as np
import pytest

from rtds_host.contract import builtin_robot
from rtds_host.errors import InputError
from rtds_host.robot import make_body
from rtds_host.scenario import (
    SpeedMotion,
    VoltageMotion,
    check_reach,
    find_scenario,
    reference_poses,
    scenarios,
    wheel_references,
)
from rtds_host.scenario.reach import needed_voltage

STEP_S = 1e-3
BURGER, PAPER = builtin_robot("burger"), builtin_robot("paper")


def motion_of(name, robot=BURGER, **values):
    scenario = find_scenario(name)
    body = make_body(robot, scenario.payload_kg, scenario.slope_rad, scenario.uphill_yaw_rad)
    return check_reach(scenario, scenario.values(values), robot, body)


def test_the_papers_three_come_first_and_every_manoeuvre_is_there():
    names = list(scenarios())
    assert names[:3] == ["linear", "circle", "eight"]
    assert set(names[3:]) >= {
        "standstill",
        "crawl",
        "steps",
        "prbs",
        "spin",
        "coast",
        "teleop",
        "long_load",
        "headings",
    }


@pytest.mark.parametrize("name", list(scenarios()))
@pytest.mark.parametrize("robot", [BURGER, PAPER], ids=["burger", "paper"])
def test_every_scenario_is_within_reach_as_it_stands(name, robot):
    motion = motion_of(name, robot)
    assert motion.duration_s > 0
    t = np.arange(0.0, motion.duration_s, 0.01)
    if isinstance(motion, VoltageMotion):
        assert np.abs(motion.voltages(t)).max() <= robot.supply_v
        assert motion.voltages(t).shape == (len(t), 2)
    else:
        assert motion.speeds(t).shape == (len(t), 2)


def test_linear_goes_4_m_downhill_in_24_s_with_ramps():
    scenario = find_scenario("linear")
    assert (scenario.payload_kg, scenario.slope_rad, scenario.uphill_yaw_rad) == (2.0, 0.1, math.pi)
    motion = motion_of("linear")
    assert motion.duration_s == 24.0
    assert reference_poses(motion, STEP_S)[-1] == pytest.approx([4.0, 0.0, 0.0], abs=1e-9)
    speed = motion.speeds(np.array([0.0, 1.5, 3.0, 12.0, 21.0, 22.5, 24.0]))[:, 0]
    assert speed == pytest.approx(4.0 / 21.0 * np.array([0, 0.5, 1, 1, 1, 0.5, 0]))


def test_circle_is_one_turn_counter_clockwise_of_half_a_metre():
    scenario = find_scenario("circle")
    assert (scenario.payload_kg, scenario.slope_rad, scenario.uphill_yaw_rad) == (2.0, 0.1, math.pi / 2)
    motion = motion_of("circle")
    poses = reference_poses(motion, STEP_S)
    assert poses[-1] == pytest.approx([0.0, 0.0, 2 * math.pi], abs=1e-6)
    assert np.hypot(poses[:, 0], poses[:, 1] - 0.5) == pytest.approx(np.full(len(poses), 0.5), abs=1e-6)
    half = reference_poses(motion_of("circle", turns=-0.5), STEP_S)[-1]
    assert half == pytest.approx([0.0, -1.0, -math.pi], abs=1e-6)


def test_eight_is_the_infinity_sign_and_a_half():
    scenario = find_scenario("eight")
    assert (scenario.payload_kg, scenario.slope_rad) == (0.0, 0.1)
    motion = motion_of("eight")
    assert motion.start == (0.0, -1.0, 0.0)
    assert motion.duration_s == 60.0
    poses = reference_poses(motion, STEP_S)
    assert poses[-1] == pytest.approx([0.0, 0.75, 0.0], abs=1e-6)
    # Every point lies on x = 0.35 sin 2p, y = -0.125 - 0.875 cos p.
    p = np.arccos(np.clip((-0.125 - poses[:, 1]) / 0.875, -1.0, 1.0))
    assert np.abs(np.abs(poses[:, 0]) - np.abs(0.35 * np.sin(2 * p))).max() < 2e-3


def test_wheel_references_follow_the_geometry():
    motion = SpeedMotion(1.0, lambda t: np.tile([0.1, 0.5], (len(t), 1)))
    left, right = wheel_references(motion, BURGER, np.array([0.3]))[0]
    assert 0.033 * (right + left) / 2 == pytest.approx(0.1)
    assert 0.033 * (right - left) / 0.160 == pytest.approx(0.5)


def test_needed_voltage_is_the_nominal_models_at_steady_speed():
    scenario = find_scenario("linear")
    values = scenario.values()
    motion = scenario.build(values, BURGER)
    body = make_body(BURGER, 2.0, 0.1, math.pi)
    volts, t = needed_voltage(motion, BURGER, body)
    w = 4.0 / 21.0 / 0.033
    torque = -0.033 / 2 * 3.0 * 9.80665 * math.sin(0.1)
    current = (4.372e-7 * 258.5 * w + torque / 258.5) / 6.538e-3
    assert volts[np.searchsorted(t, 12.0)] == pytest.approx([8.6 * current + 6.538e-3 * 258.5 * w] * 2, rel=1e-6)


@pytest.mark.parametrize(
    "name, values, words",
    [
        (
            "linear",
            {"duration_s": 15.0},
            (
                r"'linear': beyond the motors' reach.*needs 18\.\d V, the supply has 12 V "
                r"\(no-load limit 6\.53 rad/s = 0\.215 m/s\); a duration from 21\.\d s on"
            ),
        ),
        ("linear", {"length_m": 8.0}, "beyond the motors' reach"),
        ("circle", {"radius_m": 2.0}, "beyond the motors' reach"),
        ("circle", {"radius_m": 0.05}, r"radius_m is 0\.05, it must be above half the track \(0\.08 m\)"),
        ("circle", {"radius_m": -1.0}, "radius_m is -1"),
        ("circle", {"ramp_s": 30.0}, r"ramps \(ramp_s, stop_s\) of 30 s together do not fit into a run of 24 s"),
        ("eight", {"duration_s": 30.0}, "beyond the motors' reach"),
        ("spin", {"rate_rad_s": 8.0}, "'spin': beyond the motors' reach"),
        ("linear", {"radius_m": 1.0}, "'linear': has no parameter 'radius_m' .known: duration_s, length_m"),
        ("linear", {"duration_s": math.nan}, "duration_s is nan"),
        ("linear", {"duration_s": -3.0}, "duration_s is -3, it must lie within 0.1 to 3600"),
    ],
)
def test_what_cannot_be_done_is_refused_with_the_limit(name, values, words):
    with pytest.raises(InputError, match=words):
        motion_of(name, **values)


def test_the_duration_named_as_the_limit_is_within_reach():
    with pytest.raises(InputError) as caught:
        motion_of("linear", duration_s=10.0)
    shortest = float(str(caught.value).split("a duration from ")[1].split(" s")[0])
    assert motion_of("linear", duration_s=shortest).duration_s == shortest
    with pytest.raises(InputError):
        motion_of("linear", duration_s=shortest - 0.2)


def test_unknown_scenario_is_named_with_those_that_exist():
    with pytest.raises(InputError, match="scenario 'waltz': unknown .known: linear, circle, eight, "):
        find_scenario("waltz")


def test_seeded_manoeuvres_repeat_and_differ_by_seed():
    t = np.arange(0.0, 12.0, 0.01)
    assert np.array_equal(motion_of("prbs").voltages(t), motion_of("prbs").voltages(t))
    assert not np.array_equal(motion_of("prbs").voltages(t), motion_of("prbs", seed=2.0).voltages(t))
    assert not np.array_equal(motion_of("teleop").speeds(t), motion_of("teleop", seed=2.0).speeds(t))


def test_steps_change_at_their_edges_whatever_the_rounding():
    motion = motion_of("steps")
    edge = round(0.5 / motion.period_s)
    t = np.arange(2 * edge) * motion.period_s
    volts = motion.voltages(t)
    assert np.all(volts[:edge] == 0.0) and np.all(volts[edge:] == 4.0)


def test_headings_visits_up_across_down_and_across():
    yaw = reference_poses(motion_of("headings"), STEP_S)[:, 2]
    for quarter in range(4):
        assert (np.abs(yaw - quarter * math.pi / 2) < 1e-6).sum() * STEP_S > 2.0
