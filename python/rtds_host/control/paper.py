"""The paper's controller: the motor's discrete equation, solved for the voltage."""

from __future__ import annotations

import numpy as np

from rtds_host.contract import Motor
from rtds_host.control.base import Observation


class PaperController:
    """Inverse of backward Euler with the exchange interval h as its step.

    With D = (L + hR)(J + hB) + h^2 Kb Km the speed after one step is

        w+ = [ (L + hR)(J w - h T) + h Km (L i + h V) ] / D

    which is solved for V. The interval is measured at each exchange (128 to 130 ms in the paper), far longer than the
    motor's own 18 ms: the equation is then a poor picture of what the motor does in between.
    """

    name = "paper"

    def __init__(self, motor: Motor, limit_v: float):
        self._motor, self._limit = motor, limit_v

    def command(
        self, seen: Observation, now_rad_s: np.ndarray, wanted_rad_s: np.ndarray, interval_s: float
    ) -> np.ndarray:
        m, h = self._motor, interval_s
        electrical = m.inductance_h + h * m.resistance_ohm
        determinant = (
            electrical * (m.rotor_inertia_kg_m2 + h * m.viscous_friction_nm_s_per_rad)
            + h * h * m.back_emf_constant_v_s_per_rad * m.torque_constant_nm_per_a
        )
        free = electrical * (m.rotor_inertia_kg_m2 * seen.speeds_rad_s - h * seen.torques_nm)
        volts = (
            (wanted_rad_s * determinant - free) / (h * m.torque_constant_nm_per_a) - m.inductance_h * seen.currents_a
        ) / h
        return np.clip(volts, -self._limit, self._limit)
