"""The interface of a speed controller, and the list of those that exist."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

# Name -> the exchange interval it was made for, s.
CONTROLLERS = {"exact": 0.032, "paper": 0.128}


@dataclass(frozen=True)
class Observation:
    """What a controller sees when it decides; each (2,) [left, right], SI at the motor shaft.

    `torques_nm` is the load torque that the motor units will hold over the coming interval (positive opposes positive
    rotation).
    """

    speeds_rad_s: np.ndarray
    currents_a: np.ndarray
    torques_nm: np.ndarray


class Controller(Protocol):
    """One controller for both motors."""

    name: str

    def command(
        self, seen: Observation, now_rad_s: np.ndarray, wanted_rad_s: np.ndarray, interval_s: float
    ) -> np.ndarray:
        """Voltages (2,) V to hold over the coming interval.

        `now_rad_s` (2,) is the reference at its start, `wanted_rad_s` (2,) the one at its end.
        """
