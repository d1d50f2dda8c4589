"""The interface of a physics engine: wheel speeds in, wheel torques and pose out."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rtds_host.compat import Self
from rtds_host.errors import InputError, did_you_mean

ENGINES = ("pybullet", "mujoco")
STEP_S = 1e-3
_NO_PYBULLET = f"PyBullet is not installed (it has no wheel for Python {sys.version_info[0]}.{sys.version_info[1]})"


def available_engines() -> tuple[str, ...]:
    """The engines that are installed, the default one first."""
    return tuple(name for name in ENGINES if name != "pybullet" or importlib.util.find_spec("pybullet") is not None)


def default_engine(say: Callable[[str], None] | None = None) -> str:
    """The engine where none is asked for: PyBullet, or MuJoCo where PyBullet has no wheel; then `say` gets a line."""
    name = available_engines()[0]
    if name != ENGINES[0] and say is not None:
        say(f"rtds: {_NO_PYBULLET}; the robot is in MuJoCo")
    return name


def check_engine(name: str, option: str = "engine") -> None:
    """Whether there is such an engine here; `option` is what a message calls it.

    Raises
    ------
    InputError : unknown engine, or one that is not installed.
    """
    if name not in ENGINES:
        raise InputError(f"{option} {name!r}: unknown (known: {', '.join(ENGINES)}){did_you_mean(name, ENGINES)}")
    if name not in available_engines():
        raise InputError(f"{option} {name!r}: {_NO_PYBULLET}; choose mujoco")


@dataclass(frozen=True)
class RobotState:
    """The robot seen from outside, SI, in the tilted plane. Pose is that of the axle's mid-point, yaw not wrapped."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_m_s: float
    yaw_rate_rad_s: float
    pitch_rad: float


class Engine(Protocol):
    """A robot on a plane whose wheels turn as they are told.

    `step_s` is the engine's own step. An engine is a context manager; leaving it frees what it holds.
    """

    step_s: float

    def hold(self) -> np.ndarray:
        """Torque (2,) N m at the wheels that holds the robot at rest where it stands; wheels do not turn."""

    def advance(self, speeds_rad_s: np.ndarray) -> np.ndarray:
        """Go on by n steps, the wheels' speeds at the end of each step being `speeds_rad_s` (n, 2).

        Returns the mean torque (2,) N m over these steps that the gears delivered to the wheels; the acceleration of
        body and wheels is in it, friction in gear and motor is not.
        """

    def state(self) -> RobotState:
        """Pose and speed now."""

    def wheel_speeds(self) -> np.ndarray:
        """Speeds (2,) rad/s that the wheels really have."""

    def energy_j(self) -> float:
        """Kinetic energy of body and wheels plus potential energy in the slope, J; its zero is arbitrary."""

    def close(self) -> None:
        """Free what the engine holds."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *exc) -> None: ...
