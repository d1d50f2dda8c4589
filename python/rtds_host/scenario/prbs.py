"""Random switching between two voltages, each wheel for itself: all frequencies at once."""

import numpy as np

from rtds_host.contract import Robot
from rtds_host.scenario.base import Parameter, Scenario, Values, VoltageMotion, duration
from rtds_host.scenario.profiles import EDGE_S


def build(values: Values, robot: Robot) -> VoltageMotion:
    chip = values["chip_s"]
    count = int(np.ceil(values["duration_s"] / chip)) + 1
    levels = np.random.default_rng(round(values["seed"])).choice([-1.0, 1.0], size=(count, 2))
    rest = min(0.4, 0.1 * values["duration_s"])

    def voltages(t: np.ndarray) -> np.ndarray:
        level = levels[np.floor((t + EDGE_S) / chip).astype(int)]
        moving = (t + EDGE_S >= rest)[:, None]
        return np.where(moving, values["offset_v"] + values["swing_v"] * level, 0.0)

    return VoltageMotion(values["duration_s"], voltages)


SCENARIO = Scenario(
    name="prbs",
    about="random switching between two voltages, each wheel for itself",
    build=build,
    parameters={
        "duration_s": duration(12.0),
        "swing_v": Parameter(4.0, "half the difference of the levels", 0, 100),
        "offset_v": Parameter(1.0, "middle of the levels", -100, 100),
        "chip_s": Parameter(0.15, "shortest time between two switches", 0.01, 60.0),
        "seed": Parameter(1.0, "seed of the random sequence", 0.0, 2**31),
    },
    exchange_s=0.002,
    separates="delays, filters, inertia of rotor and body, gear compliance, backlash",
)
