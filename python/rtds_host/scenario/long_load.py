"""Uphill and down again under load, for long: what only shows with time and heat."""

import numpy as np

from rtds_host.contract import Robot
from rtds_host.scenario.base import Parameter, Scenario, SpeedMotion, Values, duration
from rtds_host.scenario.profiles import EDGE_S

LEG_S = 10.0


def build(values: Values, robot: Robot) -> SpeedMotion:
    ramp = 0.4

    def speeds(t: np.ndarray) -> np.ndarray:
        left = np.maximum(values["duration_s"] - t, 0.0)
        phase = np.mod(t + EDGE_S, LEG_S)
        gain = np.minimum(np.minimum(phase, LEG_S - phase), left) / ramp
        sign = np.where(np.mod(np.floor((t + EDGE_S) / LEG_S), 2) == 0, 1.0, -1.0)
        return np.column_stack([values["speed_m_s"] * sign * np.clip(gain, 0.0, 1.0), np.zeros_like(t)])

    return SpeedMotion(values["duration_s"], speeds)


SCENARIO = Scenario(
    name="long_load",
    about="up and down a slope of 0.1 rad with 2 kg for 120 s",
    build=build,
    parameters={"duration_s": duration(120.0), "speed_m_s": Parameter(0.15, "speed of a leg", 0.0, 10.0)},
    payload_kg=2.0,
    slope_rad=0.1,
    exchange_s=0.004,
    separates="winding heating, battery decline, sag, load friction",
)
