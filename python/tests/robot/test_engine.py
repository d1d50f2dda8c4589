"""What every physics engine must give: exact torques, wheels on target, no slip to speak of, nothing lost."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from rtds_host.contract import GRAVITY_M_S2
from rtds_host.errors import InputError
from rtds_host.robot import STEP_S, available_engines, check_engine, default_engine, make_body, open_engine
from rtds_host.vectors import cross

engines = pytest.mark.parametrize("engine", available_engines())


def ramp(seconds, level, rise=0.5):
    """Wheel speeds (n, 2) that rise to `level` (2,) and stay."""
    t = np.arange(1, round(seconds / STEP_S) + 1) * STEP_S
    return np.minimum(t / rise, 1.0)[:, None] * np.asarray(level, dtype=float)


@engines
@pytest.mark.parametrize(
    "slope, payload, yaw",
    [(math.radians(5), 0.0, 0.0), (0.1, 2.0, 0.0), (0.1, 2.0, math.pi), (0.1, 2.0, 0.7), (-0.1, 0.5, 2.0)],
)
def test_hill_torque_is_exact(burger, engine, slope, payload, yaw):
    body = make_body(burger, payload, slope, uphill_yaw_rad=0.0)
    expected = 0.5 * 0.033 * (1.0 + payload) * GRAVITY_M_S2 * math.sin(slope) * math.cos(yaw)
    with open_engine(engine, body, (0.0, 0.0, yaw)) as robot:
        assert robot.hold() == pytest.approx([expected] * 2, rel=2e-5)
        robot.advance(ramp(1.0, (3.0, 3.0)))
        moving = np.array([robot.advance(np.full((10, 2), 3.0)) for _ in range(20)])
    assert moving == pytest.approx(np.full((20, 2), expected), rel=2e-5)
    assert moving.std(axis=0).max() < 2e-6 * abs(expected)


@engines
def test_slope_about_the_other_axis_asks_no_torque_and_does_not_push_sideways(burger, engine):
    with open_engine(engine, make_body(burger, 2.0, 0.1, uphill_yaw_rad=math.pi / 2)) as robot:
        assert robot.hold() == pytest.approx([0.0, 0.0], abs=1e-6)
        robot.advance(ramp(2.0, (3.0, 3.0)))
        state = robot.state()
    assert abs(state.y_m) < 5e-5 and abs(state.yaw_rad) < 1e-4


@engines
def test_wheels_reach_their_target_and_do_not_slip_under_3_kg_uphill(burger, engine):
    with open_engine(engine, make_body(burger, 2.0, 0.1)) as robot:
        robot.advance(ramp(1.5, (5.0, 5.0)))
        speeds, state = robot.wheel_speeds(), robot.state()
    assert speeds == pytest.approx([5.0, 5.0], rel=1e-3)
    assert state.speed_m_s == pytest.approx(0.033 * speeds.mean(), rel=1e-3)
    # Trapezoidal rule of the speeds asked for: 0.25 s worth of ramp and 1 s at speed.
    assert state.x_m == pytest.approx(0.033 * 5.0 * 1.25, rel=1e-3)


@engines
def test_yaw_rate_follows_from_the_wheels(burger, engine):
    with open_engine(engine, make_body(burger), (0.3, -0.2, 1.0)) as robot:
        robot.advance(ramp(1.0, (2.0, 4.0)))
        state = robot.state()
    rate = 0.033 * 2.0 / 0.160
    assert state.yaw_rate_rad_s == pytest.approx(rate, rel=1e-3)
    assert state.yaw_rad == pytest.approx(1.0 + rate * 0.75, rel=1e-3)


@engines
def test_yaw_is_not_wrapped(burger, engine):
    speeds = ramp(3.0, (-15.0, 15.0), rise=1.0)
    with open_engine(engine, make_body(burger)) as robot:
        turned = []
        for piece in speeds.reshape(-1, 50, 2):
            robot.advance(piece)
            turned.append(robot.state().yaw_rad)
    assert turned[-1] == pytest.approx(0.033 * 30.0 / 0.160 * 2.5, rel=1e-3)
    assert np.all(np.diff(turned) > 0)


@engines
@pytest.mark.parametrize("payload", [0.0, 2.0])
def test_torque_to_speed_up_is_that_of_body_and_wheel_alone(burger, engine, payload):
    """The rotor is in the motor unit: not a bit of it may come back from the engine."""
    with open_engine(engine, make_body(burger, payload)) as robot:
        robot.advance(ramp(0.2, (1.0, 1.0), rise=0.5))
        torque = robot.advance(0.4 + 2.0 * STEP_S * np.arange(1, 101)[:, None] * np.ones(2))
    assert torque == pytest.approx([((1.0 + payload) * 0.033**2 / 2 + 2.07e-5) * 2.0] * 2, rel=2e-3)


@engines
@pytest.mark.parametrize("payload", [0.0, 2.0])
def test_torque_to_turn_is_that_of_the_yaw_inertia(burger, engine, payload):
    side = np.array([-1.0, 1.0])
    with open_engine(engine, make_body(burger, payload)) as robot:
        robot.advance(ramp(0.2, side, rise=0.5))
        torque = robot.advance((0.4 + 2.0 * STEP_S * np.arange(1, 101))[:, None] * side)
    expected = (2 * 2.5e-3 * 0.033**2 / 0.160**2 + 2.07e-5) * 2.0
    assert torque == pytest.approx(expected * side, rel=5e-3)


@engines
def test_nothing_brakes_on_the_flat(burger, engine):
    with open_engine(engine, make_body(burger, 2.0)) as robot:
        robot.advance(ramp(1.0, (5.0, 5.0)))
        assert np.abs(robot.advance(np.full((200, 2), 5.0))).max() < 1e-6
        robot.advance(ramp(1.0, (4.0, 5.0)))
        assert np.abs(robot.advance(np.tile([4.0, 5.0], (200, 1)))).max() < 2e-5


@engines
def test_work_of_the_wheels_is_the_energy_the_robot_gains(burger, engine):
    # The centre of mass ahead of the axle, so that turning moves it too.
    ahead = replace(burger, chassis=replace(burger.chassis, com_x_m=0.02))
    with open_engine(engine, make_body(ahead, 2.0, 0.1)) as robot:
        before, work = robot.energy_j(), 0.0
        speeds = ramp(2.0, (4.0, 5.0))
        for piece in speeds.reshape(-1, 1, 2):
            work += float(robot.advance(piece) @ piece[0]) * STEP_S
        gained = robot.energy_j() - before
    assert gained == pytest.approx(work, rel=2e-3)


@engines
@pytest.mark.parametrize("sides", [(1.0, 1.0), (-1.0, 1.0)])
def test_the_hardest_step_of_voltage_makes_no_tyre_slide(burger, engine, sides):
    """From 10 V one way to 10 V the other: 540 rad/s^2 at the wheels, 18 m/s^2."""
    t = np.arange(1, 101) * STEP_S
    turn = 5.0 * (2.0 * np.exp(-t / 0.0185) - 1.0)
    with open_engine(engine, make_body(burger)) as robot:
        robot.advance(ramp(0.5, 5.0 * np.array(sides), rise=0.4))
        before = robot.state()
        robot.advance(turn[:, None] * np.array(sides))
        after = robot.state()
    travel = 0.033 * STEP_S * (turn.sum() - 0.5 * (turn[-1] - 5.0))
    if sides[0] > 0:
        assert after.x_m - before.x_m == pytest.approx(travel, abs=2e-5)
    else:
        assert after.yaw_rad - before.yaw_rad == pytest.approx(2.0 * travel / 0.160, abs=4e-4)


@engines
def test_robot_stays_level_downhill_on_its_skids(burger, engine):
    with open_engine(engine, make_body(burger, 2.0, 0.1, uphill_yaw_rad=math.pi)) as robot:
        robot.advance(ramp(1.0, (5.0, 5.0)))
        assert abs(robot.state().pitch_rad) < 1e-3


@engines
def test_on_its_true_caster_it_noses_over_downhill(burger, engine):
    with open_engine(engine, make_body(burger, 2.0, 0.1, uphill_yaw_rad=math.pi, support="caster")) as robot:
        robot.advance(ramp(1.0, (5.0, 5.0)))
        assert abs(robot.state().pitch_rad) > 0.3


@engines
def test_on_its_true_caster_it_stands_with_the_mass_behind_the_axle(burger, engine):
    behind = replace(burger, chassis=replace(burger.chassis, com_x_m=-0.03))
    with open_engine(engine, make_body(behind, 2.0, 0.1, support="caster")) as robot:
        robot.advance(ramp(1.0, (3.0, 3.0)))
        assert abs(robot.state().pitch_rad) < 1e-3


@engines
def test_the_same_commands_give_the_same_bits(burger, engine):
    def once():
        with open_engine(engine, make_body(burger, 2.0, 0.1, 0.3)) as robot:
            torques = [robot.advance(piece) for piece in ramp(0.5, (3.0, 5.0)).reshape(-1, 10, 2)]
            return np.concatenate(torques).tobytes(), robot.state()

    assert once() == once()


@engines
def test_run_starts_where_it_is_told(burger, engine):
    with open_engine(engine, make_body(burger, 2.0, 0.1, 0.3), (1.0, -2.0, 0.5)) as robot:
        state = robot.state()
    assert (state.x_m, state.y_m, state.yaw_rad) == pytest.approx((1.0, -2.0, 0.5), abs=1e-12)


def test_unknown_engine_is_named(burger):
    with pytest.raises(InputError, match="engine 'chaos': unknown .known: pybullet, mujoco"):
        open_engine("chaos", make_body(burger))


def test_without_pybullet_the_robot_is_in_mujoco_and_that_is_said(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    said = []
    assert default_engine(said.append) == "mujoco"
    version = f"{sys.version_info[0]}.{sys.version_info[1]}"
    assert said == [f"rtds: PyBullet is not installed (it has no wheel for Python {version}); the robot is in MuJoCo"]
    with pytest.raises(InputError, match=r"--engine 'pybullet': PyBullet is not installed .*; choose mujoco"):
        check_engine("pybullet", "--engine")


def test_the_cross_product_has_the_bits_of_numpys():
    rng = np.random.default_rng(5)
    for a, b in zip(rng.normal(size=(1000, 3)), 10.0 ** rng.uniform(-9, 9, (1000, 3)), strict=True):
        assert cross(a, b).tobytes() == np.cross(a, b).tobytes()
