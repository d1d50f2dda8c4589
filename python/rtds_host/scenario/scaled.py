"""The paper's scenarios on robots of other sizes.

They were made for a robot of 1 kg and 160 mm between its wheels. On another one ways and radii grow with the track and
the payload with the mass, so that the shape of the path stays; the slope stays, and so does the time, but where the
motors could not go so fast.
"""

from __future__ import annotations

import math

from rtds_host.contract import Robot
from rtds_host.errors import InputError
from rtds_host.scenario.base import Scenario
from rtds_host.scenario.reach import no_load_speed

TRACK_M, MASS_KG, TOP_SPEED_M_S = 0.160, 1.0, 0.215
# Parameters that are lengths, or shares of one.
LENGTHS = ("length_m", "radius_m", "scale")


def scaled_values(scenario: Scenario, robot: Robot) -> tuple[dict[str, float], float]:
    """Parameters, and payload in kg, of a scenario for a robot of another size.

    Raises
    ------
    InputError : a robot without wheels (single axis).
    """
    if robot.chassis is None:
        raise InputError(f"robot {robot.name!r}: is a single axis, a scenario needs a [chassis]")
    stretch = robot.chassis.track_width_m / TRACK_M
    values = {
        name: round(stretch * scenario.parameters[name].default, 4) for name in LENGTHS if name in scenario.parameters
    }
    slower = stretch * TOP_SPEED_M_S / (no_load_speed(robot) * robot.chassis.wheel_radius_m)
    if "duration_s" in scenario.parameters and slower > 1.0:
        values["duration_s"] = float(math.ceil(slower * scenario.parameters["duration_s"].default))
    return values, round(scenario.payload_kg * robot.chassis.mass_kg / MASS_KG, 4)
