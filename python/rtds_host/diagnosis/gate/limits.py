"""What the robot of a case can physically do, from robot.toml and the runs: speeds, ways, currents, time constants."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rtds_host.contract import Case, Robot
from rtds_host.plant.schema import OUTPUTS

# Physical: a robot may be twice as fast as its file says and its sensor may report twice that, and the file's own
# values miss a little.
ROOM = 5.0


@dataclass(frozen=True)
class Limits:
    """Bounds that no robot of a file exceeds, effects of the catalogue included.

    values : channel -> largest magnitude, SI (inf where the file does not bound it).
    rates : channel of an angle or of the pose -> largest rate of change, SI a second (inf likewise).
    time_constant_s : of the unloaded nominal motor with its load, R J / (Km Kb); NaN without a back-EMF.
    """

    values: dict[str, float]
    rates: dict[str, float]
    time_constant_s: float


def inertia(robot: Robot) -> float:
    """Inertia that one motor accelerates when the robot drives straight, kg m2 at the gear's output."""
    own = robot.motor.gear_ratio**2 * robot.motor.rotor_inertia_kg_m2
    if robot.chassis is not None:
        body = robot.chassis
        return own + body.wheel_inertia_kg_m2 + 0.5 * body.mass_kg * body.wheel_radius_m**2
    axis = robot.sole_axis
    arm = {"inertia": 0.0, "pendulum": axis.length_m, "linear": axis.metres_per_rad}[axis.kind]
    return own + axis.inertia_kg_m2 + axis.mass_kg * arm**2


def channels(robot: Robot) -> tuple[str, ...]:
    """Measured channels that this robot can have, in the replay's order."""
    names = [c for c in OUTPUTS if not c.endswith("_r") or "r" in robot.sides]
    return tuple(c for c in names if robot.chassis is not None or c not in ("gyro_z", "x", "y", "yaw"))


def limits(case: Case) -> Limits:
    """Bounds for a case. Without a back-EMF (torque mode) nothing in the file bounds a speed: bounds are inf there."""
    robot = case.robot
    motor = robot.motor
    back_emf = motor.back_emf_constant_v_s_per_rad * motor.gear_ratio
    electrical = robot.driver.mode != "torque" and math.isfinite(back_emf)
    # An axis on a slope or a pendulum is also driven by its weight; the room covers what a motor can hold.
    wheel = ROOM * robot.supply_v / back_emf if electrical else math.inf
    # Reversed at full speed, supply and back-EMF act together.
    current = ROOM * 2.0 * robot.supply_v / motor.resistance_ohm if electrical else math.inf
    values = {"v_bus": 2.0 * robot.supply_v, "i": current, "w": wheel}
    rates = {"th": wheel}
    if robot.chassis is not None:
        rim = wheel * robot.chassis.wheel_radius_m
        turn = 2.0 * rim / robot.chassis.track_width_m
        values["gyro"] = turn
        rates.update(x=rim, y=rim, yaw=turn)
    tau = (
        motor.resistance_ohm * inertia(robot) / (motor.torque_constant_nm_per_a * motor.gear_ratio * back_emf)
        if electrical
        else math.nan
    )
    names = channels(robot)
    return Limits(
        {c: values[kind_of(c)] for c in names if kind_of(c) in values},
        {c: rates[kind_of(c)] for c in names if kind_of(c) in rates},
        float(tau),
    )


def kind_of(channel: str) -> str:
    """A channel's quantity: "w" of "w_l", "v_bus" of itself."""
    return channel if channel in ("v_bus", "x", "y", "yaw") else channel.split("_")[0]
