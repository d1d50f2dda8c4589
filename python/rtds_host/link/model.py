"""The bit-exact model behind the link interface, in process."""

from __future__ import annotations

import numpy as np

from rtds_host.errors import InputError
from rtds_host.link.configured import ConfiguredLink
from rtds_host.motor import MotorPair
from rtds_host.motor.effect_model import EffectPair
from rtds_host.motor.effect_tables import EffectWords
from rtds_host.motor.parameters import Parameters


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

    def _check_effects(self, left, right, supply) -> None:
        if self._energy and not all(part is None or part.absent for part in (left, right, supply)):
            raise InputError("set_effects: energy terms are kept of ideal motor units only")

    def _load(self, words: EffectWords, values: Parameters, method: str) -> None:
        if words.ideal:
            self.pair.set_parameters(*values, method)
            self.effects = None
        else:
            self._effects_with(words, values, method).load(words)

    def _load_parameters(self, words: EffectWords, values: Parameters, method: str) -> None:
        self._effects_with(words, values, method)

    def _effects_with(self, words: EffectWords, values: Parameters, method: str) -> EffectPair:
        """The pair with effects, made where there is none yet, with these parameters."""
        self.effects = self.effects or EffectPair()
        self.effects.set_parameters(words.side_values(values), method)
        return self.effects

    def _run_steps(self, v: np.ndarray, t: np.ndarray, steps: int, sample_steps: int) -> np.ndarray:
        if self.effects is None:
            return self.pair.step(v, t, steps, sample_steps)
        return self.effects.samples(self.effects.step(v, t, steps, sample_steps))
