"""The bit-exact model behind the link interface, in process."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

from rtds_host.errors import InputError, LinkError
from rtds_host.link.base import (
    CLOSED,
    EFFECTS_LATE,
    NO_PARAMETERS,
    Exchange,
    exchange_of,
    input_words,
    whole_steps,
)
from rtds_host.motor import MotorPair
from rtds_host.motor.effect_model import EffectPair
from rtds_host.motor.effect_tables import EffectWords, tables_of
from rtds_host.motor.effects import SupplyEffects, UnitEffects
from rtds_host.motor.parameters import parameter_words


class ModelLink:
    """`rtds_host.motor.MotorPair` as a `Link`: the same bytes as the RTL gives, without a simulator.

    Parameters
    ----------
    energy : keep the energy balance at every step, see `pair`; of ideal motor units only.

    Attributes
    ----------
    pair : the `MotorPair` inside, for what only the model can tell (energy terms, both words of the state).
    effects : with effects, the `EffectPair` that takes its place.
    effect_words : with effects, what it was loaded with, and by how much the tables miss the curves.
    """

    def __init__(self, energy: bool = False) -> None:
        self.pair = MotorPair(energy=energy)
        self.effects: EffectPair | None = None
        self.effect_words: EffectWords | None = None
        self.step_s = 0.0
        self._energy = energy
        self._wanted: tuple[UnitEffects | None, UnitEffects | None, SupplyEffects | None] = (None, None, None)
        self._parameters: tuple[tuple[float, ...], str] | None = None
        self._exchanged = False
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
        values = (
            resistance_ohm,
            inductance_h,
            torque_constant_nm_per_a,
            back_emf_constant_v_s_per_rad,
            rotor_inertia_kg_m2,
            viscous_friction_nm_s_per_rad,
            step_s,
        )
        parameter_words(values, method)
        self._compile(self._wanted, (values, method))
        self.step_s = float(step_s)

    def set_effects(
        self, left: UnitEffects | None, right: UnitEffects | None, supply: SupplyEffects | None = None
    ) -> None:
        """See `Link.set_effects`. Raises InputError also where energy terms are kept, which are those of ideal units."""
        self._check_open()
        if self._exchanged:
            raise InputError(EFFECTS_LATE)
        wanted = (left, right, supply)
        if self._energy and not all(part is None or part.absent for part in wanted):
            raise InputError("set_effects: energy terms are kept of ideal motor units only")
        self._compile(wanted, self._parameters)

    def _compile(self, wanted, parameters) -> None:
        """Take effects and parameters over, once both are known and hold together."""
        if parameters is not None:
            values, method = parameters
            words = tables_of(*wanted, values)
            if words.ideal:
                self.pair.set_parameters(*values, method)
                self.effects = self.effect_words = None
            else:
                pair = self.effects or EffectPair()
                pair.set_parameters(words.side_values(values), method)
                pair.load(words)
                self.effects, self.effect_words = pair, words
        self._wanted, self._parameters = wanted, parameters

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
        self._exchanged = True
        if self.effects is None:
            words = self.pair.step(v, t, steps, sample_steps)
        else:
            words = self.effects.samples(self.effects.step(v, t, steps, sample_steps))
        return exchange_of(words, steps, sample_steps, self.step_s)

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
