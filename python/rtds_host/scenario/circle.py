"""One turn counter-clockwise, across a slope."""

import math

import numpy as np

from rtds_host.contract import Robot
from rtds_host.errors import InputError
from rtds_host.scenario.base import Parameter, Scenario, SpeedMotion, Values, check_ramps, duration, trapezoid

# The run ends at speed, when the turn closes: a stop would make both motors brake, and hide that only the left one does
# while it goes round.


def build(values: Values, robot: Robot) -> SpeedMotion:
    check_ramps("circle", values, ("ramp_s", "stop_s"))
    radius, half = values["radius_m"], 0.5 * robot.wheeled.track_width_m
    if radius <= half:
        raise InputError(
            f"scenario 'circle': radius_m is {radius:g}, it must be above half the track ({half:g} m): "
            "below, the inner wheel would have to turn backwards"
        )
    angle = 2.0 * math.pi * values["turns"]

    def speeds(t: np.ndarray) -> np.ndarray:
        _, rate = trapezoid(t, values["duration_s"], values["ramp_s"], values["stop_s"])
        return np.column_stack([radius * abs(angle) * rate, angle * rate])

    return SpeedMotion(values["duration_s"], speeds)


SCENARIO = Scenario(
    name="circle",
    about="one turn counter-clockwise of 0.5 m radius in 24 s, across a slope of 0.1 rad with 2 kg",
    build=build,
    parameters={
        "duration_s": duration(24.0),
        "radius_m": Parameter(0.5, "radius of the circle"),
        "turns": Parameter(1.0, "turns; negative ones go clockwise", -100.0, 100.0),
        "ramp_s": Parameter(3.0, "time to speed up", 0.05, 1e3),
        "stop_s": Parameter(0.0, "time to slow down; 0 ends the run at speed", 0.0, 1e3),
    },
    payload_kg=2.0,
    slope_rad=0.1,
    uphill_yaw_rad=0.5 * math.pi,
    family="paper",
    separates="left from right, track width, friction of a turn, the slope's share",
)
