"""What the links share that are told parameters and effects in any order: checks, compilation, one call to load
both; and the frame of an exchange.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rtds_host.errors import InputError, LinkError
from rtds_host.link.base import (
    CLOSED,
    EFFECTS_LATE,
    NO_PARAMETERS,
    Closing,
    Exchange,
    exchange_of,
    input_words,
    whole_steps,
)
from rtds_host.motor.effect_tables import EffectWords, tables_of
from rtds_host.motor.effects import MotorParameters, SupplyEffects, UnitEffects
from rtds_host.motor.parameters import Parameters, parameter_words
from rtds_host.vectors import Vector


class ConfiguredLink(Closing):
    """`Link.set_parameters` and `Link.set_effects` by way of `_load`, `Link.exchange` by way of `_run_steps`; a link
    implements both, and `close`.

    Attributes
    ----------
    step_s : see `Link`.
    effect_words : with effects, what the effect unit is loaded with, and by how much the tables miss the curves.
    resistance_lead_steps : steps from a call of `set_resistances` to the first one in which they act.
    resistance_spacing_steps : steps from one such call to the next, at least.
    """

    step_s = 0.0
    resistance_lead_steps = 1
    resistance_spacing_steps = 1
    effect_words: EffectWords | None = None
    _closed = False
    _exchanged = False
    _wanted: tuple[UnitEffects | None, UnitEffects | None, SupplyEffects | None] = (None, None, None)
    _parameters: tuple[Parameters, str] | None = None
    _resistances: tuple[float | None, float | None] | None = None

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
        self._check_step(float(step_s))
        self._compile(self._wanted, (values, method))
        self.step_s = float(step_s)

    def set_effects(
        self, left: UnitEffects | None, right: UnitEffects | None, supply: SupplyEffects | None = None
    ) -> None:
        """See `Link.set_effects`."""
        self._check_open()
        if self._exchanged:
            raise InputError(EFFECTS_LATE)
        self._check_effects(left, right, supply)
        self._compile((left, right, supply), self._parameters)

    def set_resistances(self, ohm: tuple[float | None, float | None]) -> None:
        """Give [left, right] other armature resistances, ohm; None: those of `set_parameters` or of the effects.

        May be called between any two exchanges, the first time before the first of them. They act
        `resistance_lead_steps` later than an input given now: one step, as parameters do, or more where a slow line
        carries them. Nothing else changes: tables and states stay.

        Raises
        ------
        InputError : no parameters yet, the first call is late, a resistance gives no usable coefficients, the call
            before is not `resistance_spacing_steps` ago, or this link cannot change one at an exact step.
        LinkError : the simulator does not answer.
        """
        self._check_open()
        if self._parameters is None:
            raise InputError(NO_PARAMETERS)
        if self._exchanged and self._resistances is None:
            raise InputError(RESISTANCES_LATE)
        values, method = self._parameters
        words = _with_resistances(tables_of(*self._wanted, values), values, ohm)
        for side in words.side_values(values):
            parameter_words(side, method)
        self._load_parameters(words, values, method)
        self._resistances = ohm

    def _compile(
        self,
        wanted: tuple[UnitEffects | None, UnitEffects | None, SupplyEffects | None],
        parameters: tuple[Parameters, str] | None,
    ) -> None:
        """Take effects and parameters over, once both are known and hold together."""
        if parameters is not None:
            values, method = parameters
            words = tables_of(*wanted, values)
            if self._resistances is not None:
                words = _with_resistances(words, values, self._resistances)
            for side in words.side_values(values):
                parameter_words(side, method)
            self._load(words, values, method)
            self.effect_words = None if words.ideal else words
        self._wanted, self._parameters = wanted, parameters

    def _load(self, words: EffectWords, values: Parameters, method: str) -> None:
        """Bring effects and the (7,) parameters of `set_parameters` to where the motors are computed."""
        raise NotImplementedError

    def _load_parameters(self, words: EffectWords, values: Parameters, method: str) -> None:
        """Bring the sides' parameters there, and no effects.

        Raises
        ------
        InputError : this link cannot do so at an exact step.
        """
        raise InputError("set_resistances: this link cannot change a resistance at an exact step")

    def exchange(
        self,
        voltages: Vector,
        torques: Vector,
        interval_s: float,
        sample_s: float | None = None,
    ) -> Exchange:
        """See `Link.exchange`."""
        self._check_open()
        if self.step_s == 0.0:
            raise InputError(NO_PARAMETERS)
        v, t = input_words("voltages", voltages), input_words("torques", torques)
        steps = whole_steps("interval_s", interval_s, self.step_s)
        every = steps if sample_s is None else whole_steps("sample_s", sample_s, self.step_s)
        self._exchanged = True
        return exchange_of(self._run_steps(v, t, steps, every), steps, every, self.step_s)

    def _run_steps(self, v: np.ndarray, t: np.ndarray, steps: int, every: int) -> np.ndarray:
        """Samples (n, 4) float32, i_l w_l i_r w_r, each `every` of `steps` steps and at their end, with the inputs
        (2,) float32 held."""
        raise NotImplementedError

    def close(self) -> None:
        """See `Link.close`."""
        self._closed = True

    def _check_open(self) -> None:
        if self._closed:
            raise LinkError(CLOSED)

    def _check_step(self, step_s: float) -> None:
        """Raises InputError where this link cannot make such a step."""

    def _check_effects(self, left, right, supply) -> None:
        """Raises InputError where this link cannot have such effects."""


RESISTANCES_LATE = "set_resistances: an exchange has been made, the first call comes before the first exchange"


def _with_resistances(words: EffectWords, values: Parameters, ohm: tuple[float | None, float | None]) -> EffectWords:
    """The same words for motors of their own, each with its resistance."""
    sides = [[float(x) for x in side[:6]] for side in words.side_values(values)]
    for side, resistance in zip(sides, ohm):
        if resistance is not None:
            side[0] = float(resistance)
    return replace(words, motors=(MotorParameters(*sides[0]), MotorParameters(*sides[1])))
