"""The default controller: exact inverse of the motor with inputs held, and an estimate of the torque it did not
know.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from rtds_host.contract import Motor
from rtds_host.control.base import Observation

# Share of a surprise (speed found minus speed predicted) that is taken for a torque and carried on. One would repeat
# the last surprise, noise included; a half averages over two or three exchanges and still dies out in ten.
TRUST = 0.5


class ExactController:
    """Dead-beat in speed: with voltage V and torque T held over the interval h the motor's exact solution is

        x(h) = P x(0) + g_V V + g_T (T + d),    x = (i, w),   [P g; 0 1] = exp(h [A B; 0 0])

    and V follows from its second line so that w(h) is what is aimed at. d is the torque that the nominal model misses
    (friction beyond viscous, a payload not told): estimated from how far the last interval ended from where the
    model put it. It stays at zero while the motor is the nominal one.

    Where the reference ramps by a rad/s^2 the speed cannot follow the ramp with a held voltage: it bends away by

        e(s) = a h (1 - exp(-s/m)) / (1 - exp(-h/m)) - a s,    m the mechanical time constant,

    between two points at which it is right. The aim is shifted by the mean of e, so that the error within an interval
    lies on both sides of zero: its mean square falls by five and no distance is lost.
    """

    name = "exact"

    def __init__(self, motor: Motor, limit_v: float):
        a = np.array(
            [
                [-motor.resistance_ohm / motor.inductance_h, -motor.back_emf_constant_v_s_per_rad / motor.inductance_h],
                [
                    motor.torque_constant_nm_per_a / motor.rotor_inertia_kg_m2,
                    -motor.viscous_friction_nm_s_per_rad / motor.rotor_inertia_kg_m2,
                ],
            ]
        )
        b = np.array([[1.0 / motor.inductance_h, 0.0], [0.0, -1.0 / motor.rotor_inertia_kg_m2]])
        self._generator = np.block([[a, b], [np.zeros((2, 4))]])
        electrical = motor.torque_constant_nm_per_a * motor.back_emf_constant_v_s_per_rad / motor.resistance_ohm
        self._mechanical_s = motor.rotor_inertia_kg_m2 / (motor.viscous_friction_nm_s_per_rad + electrical)
        self._limit = limit_v
        self._steps: dict[float, np.ndarray] = {}
        self._predicted: np.ndarray | None = None
        self._missed_nm = np.zeros(2)
        self._gain = 0.0

    def _step(self, interval_s: float) -> np.ndarray:
        if interval_s not in self._steps:
            self._steps[interval_s] = expm(interval_s * self._generator)
        return self._steps[interval_s]

    def _bend_s(self, interval_s: float) -> float:
        """Mean of e(s) over the interval for a = 1 rad/s^2."""
        decay = np.exp(-interval_s / self._mechanical_s)
        return interval_s / (1.0 - decay) - self._mechanical_s - 0.5 * interval_s

    def command(
        self, seen: Observation, now_rad_s: np.ndarray, wanted_rad_s: np.ndarray, interval_s: float
    ) -> np.ndarray:
        if self._predicted is not None:
            self._missed_nm = self._missed_nm + TRUST * (seen.speeds_rad_s - self._predicted) / self._gain
        step = self._step(interval_s)
        torque = seen.torques_nm + self._missed_nm
        free = step[1, 0] * seen.currents_a + step[1, 1] * seen.speeds_rad_s + step[1, 3] * torque
        aim = wanted_rad_s - self._bend_s(interval_s) * (wanted_rad_s - now_rad_s) / interval_s
        volts = np.clip((aim - free) / step[1, 2], -self._limit, self._limit)
        self._predicted = free + step[1, 2] * volts
        self._gain = step[1, 3]
        return volts
