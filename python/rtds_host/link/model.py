"""The bit-exact model behind the link interface, in process."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

from rtds_host.errors import InputError, LinkError
from rtds_host.link.base import CLOSED, NO_PARAMETERS, Exchange, exchange_of, input_words, whole_steps
from rtds_host.motor import MotorPair


class ModelLink:
    """`rtds_host.motor.MotorPair` as a `Link`: the same bytes as the RTL gives, without a simulator.

    Parameters
    ----------
    energy : keep the energy balance at every step, see `pair`.

    Attributes
    ----------
    pair : the `MotorPair` inside, for what only the model can tell (energy terms, both words of the state).
    """

    def __init__(self, energy: bool = False) -> None:
        self.pair = MotorPair(energy=energy)
        self.step_s = 0.0
        self._closed = False

    def set_parameters(
        self,
        resistance_ohm: float,
        inductance_h: float,
        torque_constant_nm_per_a: float,
        back_emf_constant_v_s_per_rad: float,
        rotor_inertia_kg_m2: float,
        viscous_friction_nm_s_per_rad: float,
        step_s: float,
        method: str = "backward_euler",
    ) -> None:
        """See `Link.set_parameters`."""
        self._check_open()
        self.pair.set_parameters(
            resistance_ohm,
            inductance_h,
            torque_constant_nm_per_a,
            back_emf_constant_v_s_per_rad,
            rotor_inertia_kg_m2,
            viscous_friction_nm_s_per_rad,
            step_s,
            method,
        )
        self.step_s = float(step_s)

    def exchange(
        self,
        voltages: Sequence[float],
        torques: Sequence[float],
        interval_s: float,
        sample_s: float | None = None,
    ) -> Exchange:
        """See `Link.exchange`."""
        self._check_open()
        if self.step_s == 0.0:
            raise InputError(NO_PARAMETERS)
        v, t = input_words("voltages", voltages), input_words("torques", torques)
        steps = whole_steps("interval_s", interval_s, self.step_s)
        sample_steps = steps if sample_s is None else whole_steps("sample_s", sample_s, self.step_s)
        return exchange_of(self.pair.step(v, t, steps, sample_steps), steps, sample_steps, self.step_s)

    def close(self) -> None:
        """See `Link.close`."""
        self._closed = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def _check_open(self) -> None:
        if self._closed:
            raise LinkError(CLOSED)
