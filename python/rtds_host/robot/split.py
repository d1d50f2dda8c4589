"""Who carries the body's inertia: the physics engine alone, or the motor units a part of it.

Motor units and engine meet once an exchange: the engine is told the wheels' speeds and answers with the torques that
load the motors in the *next* exchange. With the body's inertia at the wheels M (2, 2) and the rotor's, I_r = N^2 J, a
change of the speeds comes back one exchange late as -M/I_r times itself, less what the motor damps away (the shorter
the exchange, the less). It dies out while the largest eigenvalue of M is below I_r: the *explicit* split, for robots of
high gearing.

Elsewhere the motor units *carry* an inertia m at each wheel next to their rotor, as an armature: it takes part in every
step of theirs, implicitly, and only the rest comes back late, as the correction (M - m) dw/dt and whatever else the
engine answered with. The rest has the eigenvalues (lambda - m)/(I_r + m); with m half the trace of M, the mean of both
lambda > 0,

    |lambda - m| / (I_r + m) = (lambda_max - lambda_min) / (2 I_r + lambda_max + lambda_min) < 1

for every robot, whatever its gear. Nothing is counted twice: what the units carry is taken off what the engine reports.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rtds_host.contract import Motor, Robot
from rtds_host.robot.body import Body
from rtds_host.robot.urdf import yaw_inertia_kg_m2

# Above it an explicit exchange would take long to come to rest (stable below 1).
EXPLICIT_LIMIT = 0.8


def wheel_inertia(body: Body, yaw_inertia: float) -> tuple[np.ndarray, np.ndarray]:
    """The inertia (2, 2) kg m² at the wheels, their own spin left out, of a body with so much yaw inertia about the
    axle's mid-point, and the change (2,) of the yaw rate with the wheels' speeds."""
    return inertia_of(body.total_mass_kg, body.com_m[1], yaw_inertia, body.wheel_radius_m, body.track_width_m)


def inertia_of(
    mass: float, com_y: float, yaw_inertia: float, radius: tuple[float, float], track: float
) -> tuple[np.ndarray, np.ndarray]:
    """As `wheel_inertia`, from plain figures."""
    r_l, r_r = radius
    ways = np.array([[0.5 * r_l, 0.5 * r_r], [-r_l / track, r_r / track]])
    side = mass * com_y
    return ways.T @ np.array([[mass, -side], [-side, yaw_inertia]]) @ ways, ways[1]


@dataclass(frozen=True)
class Split:
    """How a robot's inertia is shared.

    Attributes
    ----------
    ratio : the body's inertia at the wheel over the rotor's; the explicit split is stable below 1.
    reflected_kg_m2 : inertia at each wheel that the motor units carry for the body; 0 with the explicit split.
    returned : largest share of a change of speed that comes back an exchange later, below 1.
    """

    ratio: float
    reflected_kg_m2: float
    returned: float

    def motor(self, motor: Motor) -> Motor:
        """The motor as its unit has it: what is reflected adds to the rotor's inertia."""
        if self.reflected_kg_m2 == 0.0:
            return motor
        return replace(
            motor, rotor_inertia_kg_m2=motor.rotor_inertia_kg_m2 + self.reflected_kg_m2 / motor.gear_ratio**2
        )


def make_split(robot: Robot, body: Body) -> Split:
    """The explicit split where it is quiet (a ratio of up to 0.8), else the one with a reflected inertia."""
    whole = wheel_inertia(body, yaw_inertia_kg_m2(body))[0] + body.wheel_inertia_kg_m2 * np.eye(2)
    return share(whole, robot.motor.gear_ratio**2 * robot.motor.rotor_inertia_kg_m2)


def share(whole: np.ndarray, rotor: float) -> Split:
    """Share the inertia `whole` (2, 2) at the wheels, their own spin included, with a rotor's, all kg m² at the
    wheel.
    """
    values = np.linalg.eigvalsh(whole)
    ratio = float(values[-1]) / rotor
    reflected = 0.0 if ratio <= EXPLICIT_LIMIT else 0.5 * float(np.trace(whole))
    return Split(
        ratio=ratio, reflected_kg_m2=reflected, returned=float(np.abs(values - reflected).max()) / (rotor + reflected)
    )
