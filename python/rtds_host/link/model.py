"""The bit-exact model behind the link interface, in process."""

from __future__ import annotations

from collections.abc import Sequence

from rtds_host.compat import Self
from rtds_host.errors import InputError, LinkError
from rtds_host.link.base import (
    CLOSED,
    NO_PARAMETERS,
    Exchange,
    exchange_of,
    input_words,
    whole_steps,
)
from rtds_host.link.configured import ConfiguredLink
from rtds_host.motor import MotorPair
from rtds_host.motor.effect_model import EffectPair
from rtds_host.motor.effect_tables import EffectWords


class ModelLink(ConfiguredLink):
    """`rtds_host.motor.MotorPair` as a `Link`: the same bytes as the RTL gives, without a simulator.

    Parameters
    ----------
    energy : keep the energy balance at every step, see `pair`; of ideal motor units only.

    Attributes
    ----------
    pair : the `MotorPair` inside, for what only the model can tell (energy terms, both words of the state).
    effects : with effects, the `EffectPair` that takes its place.
    """

    def __init__(self, energy: bool = False) -> None:
        self.pair = MotorPair(energy=energy)
        self.effects: EffectPair | None = None
        self._energy = energy
        self._closed = False

    def _check_effects(self, left, right, supply) -> None:
        if self._energy and not all(part is None or part.absent for part in (left, right, supply)):
            raise InputError("set_effects: energy terms are kept of ideal motor units only")

    def _load(self, words: EffectWords, values: tuple[float, ...], method: str) -> None:
        if words.ideal:
            self.pair.set_parameters(*values, method)
            self.effects = None
        else:
            self._load_parameters(words, values, method)
            self.effects.load(words)

    def _load_parameters(self, words: EffectWords, values: tuple[float, ...], method: str) -> None:
        self.effects = self.effects or EffectPair()
        self.effects.set_parameters(words.side_values(values), method)

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
