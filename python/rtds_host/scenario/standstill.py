"""Nothing at all: what the sensors say of a robot at rest."""

import numpy as np

from rtds_host.contract import Robot
from rtds_host.scenario.base import Scenario, Values, VoltageMotion, duration


def build(values: Values, robot: Robot) -> VoltageMotion:
    return VoltageMotion(values["duration_s"], lambda t: np.zeros((len(t), 2)))


SCENARIO = Scenario(
    name="standstill",
    about="no voltage on flat ground for 8 s",
    build=build,
    parameters={"duration_s": duration(8.0)},
    exchange_s=0.002,
    separates="biases of the sensors, a battery that declines by itself, a slope nobody told of",
)
