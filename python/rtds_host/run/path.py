"""The way of a signal from controller to motor, from robot to motor, and from both to the log.

The nominal path does nothing but clip at the supply's voltage. Whatever a real robot adds on the way, outside the
motor units and the physics engine, is a `SignalPath` of another kind.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Sample:
    """Channels of one row of the log (contract, section 1), SI, wheel side; two-vectors are [left, right]."""

    v_bus: float
    currents_a: np.ndarray
    speeds_rad_s: np.ndarray
    angles_rad: np.ndarray
    gyro_rad_s: float
    x_m: float
    y_m: float
    yaw_rad: float


class SignalPath:
    """The nominal path; subclass it and override what differs. Methods are called in the order of time.

    Where motors and robot exchange torques each engine step (`rtds_host.correction.coupler`) `loads` and `wheels` play
    no part. `watches`: `watch` is to be called with the truth at every engine step (for what remembers).
    """

    watches = False

    def watch(self, t_s: float, sample: Sample) -> None:
        """Take note of the truth."""

    def __init__(self, supply_v: float):
        self.supply_v = supply_v

    def voltages(self, t_s: float, commanded_v: np.ndarray, sample: Sample) -> np.ndarray:
        """Driver: voltages (2,) at the motors from those commanded (2,), once an exchange; `sample` is the truth."""
        return np.clip(commanded_v, -self.supply_v, self.supply_v)

    def loads(self, t_s: float, torques_nm: np.ndarray, sample: Sample) -> np.ndarray:
        """Drivetrain: torques (2,) N m, at the wheel, that load the motors, from those of the engine, once an
        exchange."""
        return torques_nm

    def wheels(self, speeds_rad_s: np.ndarray, torques_nm: np.ndarray) -> np.ndarray:
        """Ground: wheel speeds (n, 2) the engine is given, from those at the gears' outputs; `torques_nm` (2,) are
        the engine's of the interval before."""
        return speeds_rad_s

    def sensors(self, t_s: float, sample: Sample) -> Sample:
        """Sensors: what is measured, from the truth, once a row. The controller sees this too."""
        return sample
