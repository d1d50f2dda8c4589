"""Straight on, downhill."""

import math

import numpy as np

from rtds_host.contract import Robot
from rtds_host.scenario.base import Parameter, Scenario, SpeedMotion, Values, check_ramps, duration, trapezoid


def build(values: Values, robot: Robot) -> SpeedMotion:
    check_ramps("linear", values, ("ramp_s", "stop_s"))
    length = values["length_m"]

    def speeds(t: np.ndarray) -> np.ndarray:
        _, rate = trapezoid(t, values["duration_s"], values["ramp_s"], values["stop_s"])
        return np.column_stack([length * rate, np.zeros_like(t)])

    return SpeedMotion(values["duration_s"], speeds)


SCENARIO = Scenario(
    name="linear",
    about="4 m straight on in 24 s, down a slope of 0.1 rad with 2 kg",
    build=build,
    parameters={
        "duration_s": duration(24.0),
        "length_m": Parameter(4.0, "length of the way", -1e3, 1e3),
        "ramp_s": Parameter(3.0, "time to speed up", 0.05, 1e3),
        "stop_s": Parameter(3.0, "time to slow down; 0 ends the run at speed", 0.0, 1e3),
    },
    payload_kg=2.0,
    slope_rad=0.1,
    uphill_yaw_rad=math.pi,
    family="paper",
    separates="what acts at one steady speed: friction, gains, radius",
)
