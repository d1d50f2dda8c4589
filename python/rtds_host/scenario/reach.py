"""Whether the nominal motors can do what a scenario asks, before anything moves."""

from __future__ import annotations

import math

import numpy as np

from rtds_host.contract import GRAVITY_M_S2, Robot
from rtds_host.errors import InputError
from rtds_host.robot import Body
from rtds_host.scenario.base import Motion, Scenario, SpeedMotion, Values, reference_poses, wheel_references

STEP_S = 0.01
# A speed law's kink is worth a jump of acceleration; the voltage is judged next to it, not on it.
SEARCH_LIMIT = 100.0


def needed_voltage(motion: SpeedMotion, robot: Robot, body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Voltage (n, 2) V that the nominal motors need to follow the motion, and its times (n,) s.

    Inverse dynamics of the contract's nominal model (its section 2), winding in its steady state.
    """
    motor, chassis = robot.motor, robot.wheeled
    steps = max(2, round(motion.duration_s / STEP_S))
    step = motion.duration_s / steps
    t = (np.arange(steps) + 0.5) * step
    wheel = wheel_references(motion, robot, t)
    change = (wheel_references(motion, robot, t + 0.5 * step) - wheel_references(motion, robot, t - 0.5 * step)) / step
    yaw = np.interp(t, np.arange(steps + 1) * step, reference_poses(motion, step)[: steps + 1, 2])
    radius, track = chassis.wheel_radius_m, chassis.track_width_m
    climb = body.total_mass_kg * GRAVITY_M_S2 * math.sin(body.slope_rad) * np.cos(yaw - body.uphill_yaw_rad)
    push = body.total_mass_kg * radius * 0.5 * change.sum(axis=1) + climb
    turn = chassis.yaw_inertia_kg_m2 * radius * (change[:, 1] - change[:, 0]) / track
    force = np.column_stack([0.5 * push - turn / track, 0.5 * push + turn / track])
    torque = chassis.wheel_inertia_kg_m2 * change + radius * force
    ratio = motor.gear_ratio
    current = (
        motor.rotor_inertia_kg_m2 * ratio * change
        + motor.viscous_friction_nm_s_per_rad * ratio * wheel
        + torque / ratio
    ) / motor.torque_constant_nm_per_a
    return motor.resistance_ohm * current + motor.back_emf_constant_v_s_per_rad * ratio * wheel, t


def check_reach(scenario: Scenario, values: Values, robot: Robot, body: Body) -> Motion:
    """Build a motion and make sure that the supply's voltage suffices for it.

    Raises
    ------
    InputError : it does not; names the voltage, the wheel speed and when, the limit of the supply, and the shortest
        duration that would do (where there is one). Also whatever the scenario itself refuses.
    """
    motion = scenario.build(values, robot)
    if not isinstance(motion, SpeedMotion):
        return motion
    volts, t = needed_voltage(motion, robot, body)
    worst, side = np.unravel_index(np.argmax(np.abs(volts)), volts.shape)
    if abs(volts[worst, side]) <= robot.supply_v:
        return motion
    wheel = wheel_references(motion, robot, t)[worst, side]
    free = no_load_speed(robot)
    message = (
        f"scenario {scenario.name!r}: beyond the motors' reach: the {('left', 'right')[side]} wheel's "
        f"{wheel:.3g} rad/s at t = {t[worst]:.2f} s needs {abs(volts[worst, side]):.1f} V, the supply has "
        f"{robot.supply_v:g} V (no-load limit {free:.3g} rad/s = {free * robot.wheeled.wheel_radius_m:.3g} m/s)"
    )
    shortest = _shortest(scenario, values, robot, body)
    raise InputError(message + (f"; a duration from {shortest:.1f} s on would do" if shortest else ""))


def no_load_speed(robot: Robot) -> float:
    """Speed at the wheel, rad/s, of the nominal motor at full supply without a load."""
    motor = robot.motor
    drop = motor.resistance_ohm * motor.viscous_friction_nm_s_per_rad / motor.torque_constant_nm_per_a
    return robot.supply_v / (motor.gear_ratio * (motor.back_emf_constant_v_s_per_rad + drop))


def _shortest(scenario: Scenario, values: Values, robot: Robot, body: Body) -> float | None:
    """The shortest duration within reach, to 0.1 s, or None where a longer run does not help."""
    if "duration_s" not in values:
        return None

    def fits(seconds: float) -> bool:
        motion = scenario.build({**values, "duration_s": seconds}, robot)
        if not isinstance(motion, SpeedMotion):
            return True
        return bool(np.abs(needed_voltage(motion, robot, body)[0]).max() <= robot.supply_v)

    low, high = values["duration_s"], 2.0 * values["duration_s"]
    while not fits(high):
        low, high = high, 2.0 * high
        if high > SEARCH_LIMIT * values["duration_s"]:
            return None
    while high - low > 0.05:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if fits(middle) else (middle, high)
    return math.ceil(high * 10.0) / 10.0
