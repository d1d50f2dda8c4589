"""Slow triangles of voltage: where each wheel breaks loose, and where it sticks again."""

import numpy as np

from rtds_host.contract import Robot
from rtds_host.scenario.base import Parameter, Scenario, Values, VoltageMotion, duration
from rtds_host.scenario.profiles import EDGE_S, triangle


def build(values: Values, robot: Robot) -> VoltageMotion:
    def voltages(t: np.ndarray) -> np.ndarray:
        wave = values["peak_v"] * triangle(t, values["period_s"])
        # First together, then against each other: with and without a share of the body's friction.
        return np.column_stack([wave, np.where(t + EDGE_S < values["period_s"] * 2.0, wave, -wave)])

    return VoltageMotion(values["duration_s"], voltages)


SCENARIO = Scenario(
    name="crawl",
    about="voltage in slow triangles through zero, wheels together, then against each other",
    build=build,
    parameters={
        "duration_s": duration(32.0),
        "peak_v": Parameter(1.6, "peak of the triangle", 0.01, 100.0),
        "period_s": Parameter(8.0, "period of the triangle", 0.1, 600.0),
    },
    exchange_s=0.002,
    separates="Coulomb and Stribeck friction, dead zone, bridge drop, backlash, torque ripple",
)
