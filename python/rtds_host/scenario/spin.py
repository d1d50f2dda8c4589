"""Turning on the spot, both ways, at several rates."""

import numpy as np

from rtds_host.contract import Robot
from rtds_host.scenario.base import Parameter, Scenario, SpeedMotion, Values
from rtds_host.scenario.profiles import length_s, ramped

PIECES = (
    (0.5, 0.0, 0.0),
    (2.5, 0.0, 0.3),
    (2.5, 0.0, -0.3),
    (2.5, 0.0, 0.65),
    (2.5, 0.0, -0.65),
    (2.5, 0.0, 1.0),
    (2.5, 0.0, -1.0),
    (1.0, 0.0, 0.0),
)


def build(values: Values, robot: Robot) -> SpeedMotion:
    scale = np.array([0.0, values["rate_rad_s"]])
    return SpeedMotion(length_s(PIECES), lambda t: scale * ramped(t, PIECES, values["ramp_s"]))


SCENARIO = Scenario(
    name="spin",
    about="turns on the spot, both ways, at several rates",
    build=build,
    parameters={
        "rate_rad_s": Parameter(1.6, "the fastest yaw rate", -20.0, 20.0),
        "ramp_s": Parameter(0.2, "time from one rate to the next", 0.05, 0.5),
    },
    exchange_s=0.004,
    separates="track width, radius, gyro, scrub, yaw inertia, rolling resistance from Coulomb friction",
)
