"""What a scenario is: a declaration of what the robot is asked to do, and where.

A file of this package that holds `SCENARIO = Scenario(...)` is a scenario; nothing else has to be told of it.
"""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from rtds_host.contract import Robot
from rtds_host.errors import InputError, did_you_mean

Pose = tuple[float, float, float]


@dataclass(frozen=True)
class Parameter:
    """A figure of a scenario that the command line can change; its name ends in its unit."""

    default: float
    about: str
    low: float = -math.inf
    high: float = math.inf


@dataclass(frozen=True)
class SpeedMotion:
    """Speeds for a controller to follow.

    `speeds(t)`: (n,) s -> (n, 2), forward speed m/s and yaw rate rad/s of the axle's mid-point.
    """

    duration_s: float
    speeds: Callable[[np.ndarray], np.ndarray]
    start: Pose = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class VoltageMotion:
    """Voltages put on the motors without a controller.

    `voltages(t)`: (n,) s -> (n, 2) V, [left, right]; read once a `period_s` and held.
    """

    duration_s: float
    voltages: Callable[[np.ndarray], np.ndarray]
    period_s: float = 0.01
    start: Pose = (0.0, 0.0, 0.0)


Motion = SpeedMotion | VoltageMotion
Values = Mapping[str, float]


@dataclass(frozen=True)
class Scenario:
    """One scenario.

    `build(values, robot)` makes the motion from the parameters' values; `payload_kg`, `slope_rad`, `uphill_yaw_rad`
    and `exchange_s` are defaults. `exchange_s` None leaves the interval to the controller. `family` is "paper" for
    the three of the paper and "diagnosis" for manoeuvres that separate causes; `separates` says what it is good for.
    """

    name: str
    about: str
    build: Callable[[Values, Robot], Motion]
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    payload_kg: float = 0.0
    slope_rad: float = 0.0
    uphill_yaw_rad: float = 0.0
    exchange_s: float | None = None
    family: str = "diagnosis"
    separates: str = ""

    def values(self, given: Values | None = None) -> dict[str, float]:
        """All parameters' values, `given` ones in place of defaults.

        Raises
        ------
        InputError : a parameter this scenario does not have, no finite number, or out of its range.
        """
        values = {name: parameter.default for name, parameter in self.parameters.items()}
        for name, value in (given or {}).items():
            if name not in self.parameters:
                known = ", ".join(self.parameters) or "none"
                raise InputError(
                    f"scenario {self.name!r}: has no parameter {name!r} (known: {known})"
                    f"{did_you_mean(name, self.parameters)}"
                )
            parameter = self.parameters[name]
            if not math.isfinite(value):
                raise InputError(f"scenario {self.name!r}: {name} is {value:g}, a finite number is needed")
            if not parameter.low <= value <= parameter.high:
                raise InputError(
                    f"scenario {self.name!r}: {name} is {value:g}, it must lie within "
                    f"{parameter.low:g} to {parameter.high:g}"
                )
            values[name] = float(value)
        return values


def scenarios() -> dict[str, Scenario]:
    """All scenarios by name: the paper's three first, then the manoeuvres by name."""
    import rtds_host.scenario as package

    found = []
    for module in pkgutil.iter_modules(package.__path__):
        scenario = getattr(importlib.import_module(f"{package.__name__}.{module.name}"), "SCENARIO", None)
        if scenario is not None:
            found.append(scenario)
    order = {"linear": 0, "circle": 1, "eight": 2}
    found.sort(key=lambda scenario: (order.get(scenario.name, 3), scenario.name))
    return {scenario.name: scenario for scenario in found}


def find_scenario(name: str) -> Scenario:
    """A scenario by its name.

    Raises
    ------
    InputError : no scenario of that name; the message lists those that exist.
    """
    known = scenarios()
    if name not in known:
        raise InputError(f"scenario {name!r}: unknown (known: {', '.join(known)}){did_you_mean(name, known)}")
    return known[name]


def duration(default: float, about: str = "length of the run") -> Parameter:
    """The parameter `duration_s`."""
    return Parameter(default, about, low=0.1, high=3600.0)


def trapezoid(t: np.ndarray, duration_s: float, up_s: float, down_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Travel from 0 to 1 at a rate that ramps up for `up_s`, stays, and ramps down for `down_s` (0: it does not).

    Returns progress (n,) 0..1 and its rate (n,) 1/s.
    """
    top = 1.0 / (duration_s - 0.5 * (up_s + down_s))
    t = np.clip(t, 0.0, duration_s)
    left = duration_s - t
    up = np.minimum(t / up_s, 1.0)
    down = np.minimum(left / down_s, 1.0) if down_s > 0.0 else np.ones_like(t)
    first = 0.5 * top * up_s * up**2
    last = 1.0 - 0.5 * top * down_s * down**2
    progress = np.where(t < up_s, first, np.where(left < down_s, last, top * (t - 0.5 * up_s)))
    return progress, top * np.minimum(up, down)


def check_ramps(name: str, values: Values, keys: tuple[str, ...]) -> None:
    """The ramps named by `keys` must fit into the run.

    Raises
    ------
    InputError : they do not; names the limit.
    """
    ramps = sum(values[key] for key in keys)
    if ramps > values["duration_s"]:
        raise InputError(
            f"scenario {name!r}: ramps ({', '.join(keys)}) of {ramps:g} s together do not fit into a run "
            f"of {values['duration_s']:g} s"
        )


def reference_poses(motion: SpeedMotion, step_s: float) -> np.ndarray:
    """Poses (n + 1, 3), x m, y m, yaw rad, that the asked speeds lead to, one a step from the start on.

    Midpoint rule: second order in the step, below a micrometre at 1 ms for the scenarios here.
    """
    steps = round(motion.duration_s / step_s)
    speed, rate = motion.speeds((np.arange(steps) + 0.5) * step_s).T
    yaw = motion.start[2] + np.concatenate([[0.0], np.cumsum(rate) * step_s])
    middle = 0.5 * (yaw[1:] + yaw[:-1])
    x = motion.start[0] + np.concatenate([[0.0], np.cumsum(speed * np.cos(middle)) * step_s])
    y = motion.start[1] + np.concatenate([[0.0], np.cumsum(speed * np.sin(middle)) * step_s])
    return np.column_stack([x, y, yaw])


def wheel_references(motion: SpeedMotion, robot: Robot, t: np.ndarray) -> np.ndarray:
    """Wheel speeds (n, 2) rad/s, [left, right], at the times `t`; v = r (w_r + w_l)/2, yaw rate = r (w_r - w_l)/b."""
    speed, rate = motion.speeds(t).T
    half = 0.5 * robot.wheeled.track_width_m * rate
    return np.column_stack([speed - half, speed + half]) / robot.wheeled.wheel_radius_m
