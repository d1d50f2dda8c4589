"""What a physics engine has to know of the robot, taken from `robot.toml`.

The motor unit owns the rotor (N^2 J seen at the wheel, and the viscous friction); the physics engine owns body and
wheels. Nothing is counted twice: no rotor inertia, no friction and no gear stand in the engine's model.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rtds_host.contract import GRAVITY_M_S2, Robot
from rtds_host.errors import InputError

SUPPORTS = ("skids", "caster")
# Turtlebot3's caster (its URDF): behind the axle; the wheel's axis stands 23 mm above the base frame.
CASTER_X_M = -0.081
SKID_RADIUS_M = 0.005
# The nominal model rolls without slip and does not pitch. A step of 20 V asks for 17 m/s^2: with the centre of mass 55
# mm up, skids nearer than 0.18 m would take the load off the wheels, and tyres below 3 would slide. Higher robots stand
# wider.
SKID_ARM_M = 0.25
SKID_ARM_OF_HEIGHT = 4.5
TYRE_FRICTION = 10.0


@dataclass(frozen=True)
class Body:
    """Body, wheels and ground, SI. The origin is the point on the ground below the axle's mid-point.

    `wheel_radius_m` is [left, right]; `com_m` is the centre of mass (x forward, y left, z up) of the robot with its
    wheels; the payload sits there too and adds no yaw inertia. `slope_rad` tilts gravity: a robot that heads along
    `uphill_yaw_rad` climbs.
    """

    mass_kg: float
    payload_kg: float
    yaw_inertia_kg_m2: float
    wheel_radius_m: tuple[float, float]
    wheel_inertia_kg_m2: float
    track_width_m: float
    com_m: tuple[float, float, float]
    slope_rad: float = 0.0
    uphill_yaw_rad: float = 0.0
    support: str = "skids"
    tyre_friction: float = TYRE_FRICTION
    skid_arm_m: float = SKID_ARM_M

    @property
    def total_mass_kg(self) -> float:
        """Mass with the payload."""
        return self.mass_kg + self.payload_kg

    @property
    def wheel_mass_kg(self) -> float:
        """Mass of one wheel as a solid disc of its inertia. How the mass is shared between wheels and base plays no
        part in the plane; the sum and the moments are kept. A robot of little yaw inertia gets lighter ones, so that
        a base is left for it."""
        return min(
            2.0 * self.wheel_inertia_kg_m2 / max(self.wheel_radius_m) ** 2,
            0.2 * self.mass_kg,
            0.5 * self.yaw_inertia_kg_m2 / self.track_width_m**2,
        )

    @property
    def gravity_m_s2(self) -> np.ndarray:
        """Gravity (3,) in the axes of the tilted ground."""
        down = math.sin(self.slope_rad)
        return GRAVITY_M_S2 * np.array(
            [-down * math.cos(self.uphill_yaw_rad), -down * math.sin(self.uphill_yaw_rad), -math.cos(self.slope_rad)]
        )


def make_body(
    robot: Robot, payload_kg: float = 0.0, slope_rad: float = 0.0, uphill_yaw_rad: float = 0.0, support: str = "skids"
) -> Body:
    """The body of a nominal robot.

    Raises
    ------
    InputError : a robot without wheels (single axis), a payload below zero, a slope no wheel can stand on.
    """
    if robot.chassis is None:
        raise InputError(f"robot {robot.name!r}: is a single axis, a scenario needs a [chassis]")
    if not (math.isfinite(payload_kg) and 0.0 <= payload_kg <= 1e4):
        raise InputError(f"payload: is {payload_kg:g} kg, it must lie within 0 to 10000")
    if not (math.isfinite(slope_rad) and abs(slope_rad) <= 0.7):
        raise InputError(f"slope: is {slope_rad:g} rad, it must lie within -0.7 to 0.7 (tyres slide beyond)")
    if not abs(uphill_yaw_rad) <= 100.0:
        # What a run.json may hold.
        raise InputError(f"uphill yaw: is {uphill_yaw_rad:g} rad, it must lie within -100 to 100 (degrees?)")
    if support not in SUPPORTS:
        raise InputError(f"support {support!r}: unknown (known: {', '.join(SUPPORTS)})")
    chassis = robot.chassis
    return Body(
        mass_kg=chassis.mass_kg,
        payload_kg=payload_kg,
        yaw_inertia_kg_m2=chassis.yaw_inertia_kg_m2,
        wheel_radius_m=(chassis.wheel_radius_m, chassis.wheel_radius_m),
        wheel_inertia_kg_m2=chassis.wheel_inertia_kg_m2,
        track_width_m=chassis.track_width_m,
        com_m=(chassis.com_x_m, chassis.com_y_m, chassis.com_z_m),
        slope_rad=slope_rad,
        uphill_yaw_rad=uphill_yaw_rad,
        support=support,
        skid_arm_m=max(SKID_ARM_M, SKID_ARM_OF_HEIGHT * chassis.com_z_m),
    )


def inertia_at_wheel_kg_m2(body: Body) -> float:
    """The body's inertia that one motor sees at its wheel: the larger of driving straight, m r^2/2 + J_w, and of
    turning on the spot, 2 I_z r^2/b^2 + J_w."""
    radius = max(body.wheel_radius_m)
    straight = 0.5 * body.total_mass_kg * radius**2
    turning = 2.0 * body.yaw_inertia_kg_m2 * radius**2 / body.track_width_m**2
    return max(straight, turning) + body.wheel_inertia_kg_m2
