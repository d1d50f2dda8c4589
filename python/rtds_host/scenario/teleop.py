"""As a person drives: forward, back, round corners, stops, by a seeded list of commands."""

import numpy as np

from rtds_host.contract import Robot
from rtds_host.scenario.base import Parameter, Scenario, SpeedMotion, Values, duration
from rtds_host.scenario.profiles import ramped


def build(values: Values, robot: Robot) -> SpeedMotion:
    rng = np.random.default_rng(round(values["seed"]))
    left = values["duration_s"] - 1.5
    pieces = [(0.5, 0.0, 0.0)]
    while left > 1.0:
        seconds = float(min(rng.uniform(0.8, 2.2), left))
        kind = rng.choice(["straight", "curve", "spot", "stop"], p=[0.35, 0.35, 0.2, 0.1])
        speed = float(rng.uniform(0.3, 1.0) * rng.choice([-1.0, 1.0], p=[0.3, 0.7]))
        rate = float(rng.uniform(0.3, 1.0) * rng.choice([-1.0, 1.0]))
        pieces.append(
            {
                "straight": (seconds, speed, 0.0),
                "curve": (seconds, speed, rate),
                "spot": (seconds, 0.0, rate),
                "stop": (seconds, 0.0, 0.0),
            }[str(kind)]
        )
        left -= seconds
    scale = np.array([values["speed_m_s"], values["rate_rad_s"]])
    return SpeedMotion(values["duration_s"], lambda t: scale * ramped(t, pieces, 0.3))


SCENARIO = Scenario(
    name="teleop",
    about="driven as a person would: forward, back, round corners, stops",
    build=build,
    parameters={
        "duration_s": duration(24.0),
        "speed_m_s": Parameter(0.12, "the fastest forward speed", 0.0, 10.0),
        "rate_rad_s": Parameter(0.7, "the fastest yaw rate", 0.0, 20.0),
        "seed": Parameter(1.0, "seed of the list of commands", 0.0, 2**31),
    },
    exchange_s=0.004,
    separates="a bit of everything: a run to judge a diagnosis on, rather than to make it",
)
