"""An infinity sign and a half."""

import math

import numpy as np

from rtds_host.contract import Robot
from rtds_host.scenario.base import Parameter, Scenario, SpeedMotion, Values, check_ramps, duration, trapezoid


def build(values: Values, robot: Robot) -> SpeedMotion:
    """x = a sin 2p, y = -c - b cos p, p from 0 to 3 pi at a rate that ramps up and down."""
    check_ramps("eight", values, ("ramp_s", "stop_s"))
    scale = values["scale"]
    wide, high, centre = 0.35 * scale, 0.875 * scale, -0.125
    end = 3.0 * math.pi

    def speeds(t: np.ndarray) -> np.ndarray:
        progress, rate = trapezoid(t, values["duration_s"], values["ramp_s"], values["stop_s"])
        p = end * progress
        dx, dy = 2.0 * wide * np.cos(2.0 * p), high * np.sin(p)
        ddx, ddy = -4.0 * wide * np.sin(2.0 * p), high * np.cos(p)
        pace = end * rate
        return np.column_stack([np.hypot(dx, dy) * pace, (dx * ddy - dy * ddx) / (dx**2 + dy**2) * pace])

    return SpeedMotion(values["duration_s"], speeds, start=(0.0, centre - high, 0.0))


SCENARIO = Scenario(
    name="eight",
    about="an infinity sign and a half from (0, -1) to (0, 0.75) in 60 s, on a slope of 0.1 rad without payload",
    build=build,
    parameters={
        "duration_s": duration(60.0),
        "scale": Parameter(1.0, "size of the sign", 0.05, 100.0),
        "ramp_s": Parameter(3.0, "time to speed up", 0.05, 1e3),
        "stop_s": Parameter(3.0, "time to slow down; 0 ends the run at speed", 0.0, 1e3),
    },
    slope_rad=0.1,
    uphill_yaw_rad=math.pi,
    family="paper",
    separates="turning both ways at many speeds, uphill and downhill",
)
