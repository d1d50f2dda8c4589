"""The one interface between the host program and whatever computes the motors.

Everything here is SI at the **motor shaft**; two-vectors are ordered [left, right]. The gear ratio belongs to
the caller.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rtds_host.compat import Self
from rtds_host.errors import InputError, LinkError
from rtds_host.motor.effects import SupplyEffects, UnitEffects
from rtds_host.vectors import Vector

# A time is accepted as a whole number of steps when it misses one by less than this part of a step: room for the
# rounding of decimal fractions in binary (0.032 / 1e-5), far below anything meant by a caller.
STEP_TOLERANCE = 1e-6
MAX_STEPS = 2**32 - 1


@dataclass(frozen=True)
class Exchange:
    """What one exchange gives back: n samples, the last of them at the end of the interval.

    Attributes
    ----------
    t_s : (n,) float64, s, counted from the start of this exchange (the last entry is the interval).
    speeds : (n, 2) float32, rad/s of the motor shafts, [left, right].
    currents : (n, 2) float32, A, [left, right].
    """

    t_s: np.ndarray
    speeds: np.ndarray
    currents: np.ndarray


class Link(Protocol):
    """Two motors behind one call. Use as a context manager, or call `close`.

    Attributes
    ----------
    step_s : length of one simulation step in s, as given to the last `set_parameters`.
    """

    @property
    def step_s(self) -> float: ...

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
        """Give both motors these parameters; they act one step later than an input given now (as in the paper).

        Raises
        ------
        InputError : unknown method, or a set that gives no usable coefficients (zero, negative, NaN, overflow).
        LinkError : the simulator does not answer.
        """

    def exchange(
        self,
        voltages: Vector,
        torques: Vector,
        interval_s: float,
        sample_s: float | None = None,
    ) -> Exchange:
        """Hold the inputs over the interval and run it.

        Parameters
        ----------
        voltages : (2,) V at the terminals.
        torques : (2,) N·m at the shaft; a positive load opposes positive rotation.
        interval_s : s, a whole number of steps.
        sample_s : s, a whole number of steps; a sample is kept at each multiple of it, and one at the end of the
            interval. Without it the end of the interval is the only sample.

        Raises
        ------
        InputError : an input is not finite, or a time is no whole positive number of steps.
        LinkError : the simulator does not answer, or the state is no longer finite.
        """

    def set_effects(
        self, left: UnitEffects | None, right: UnitEffects | None, supply: SupplyEffects | None = None
    ) -> None:
        """Make the motor units differ from the ideal ones; None is absent, and all absent changes no bit.

        To be called before the first exchange, before or after `set_parameters`.

        Raises
        ------
        InputError : an exchange has been made; or the unit cannot hold something (named, with its side), here or, where
            it takes the motors' parameters to know, in `set_parameters`.
        LinkError : the simulator does not answer.
        """

    def close(self) -> None:
        """End the simulator, if there is one. May be called more than once."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *exc_info: object) -> None: ...


class Closing:
    """What `with` needs of an object that has `close`."""

    def close(self) -> None:
        """Give back what is held. May be called more than once."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()


class Around(Closing):
    """A link around another one, `inner`, that is closed with it."""

    def __init__(self, inner: Link) -> None:
        self.inner = inner

    def close(self) -> None:
        """See `Link.close`."""
        self.inner.close()


def whole_steps(name: str, time_s: float, step_s: float) -> int:
    """The number of steps in `time_s`.

    Raises
    ------
    InputError : not a whole number of steps, fewer than one, or more than 2**32 - 1.
    """
    if not math.isfinite(time_s):
        raise InputError(f"{name}: {time_s} is not a finite time")
    ratio = time_s / step_s
    if ratio > MAX_STEPS:
        raise InputError(f"{name}: {time_s:g} s is more than {MAX_STEPS} simulation steps of {step_s:g} s")
    steps = round(ratio)
    if steps < 1 or abs(ratio - steps) > STEP_TOLERANCE:
        raise InputError(f"{name}: {time_s:g} s is not a whole number of simulation steps of {step_s:g} s")
    return steps


def input_words(name: str, values: Vector) -> np.ndarray:
    """Two inputs [left, right] as float32 (2,).

    Raises
    ------
    InputError : not two numbers, or one that is NaN, infinite or beyond binary32.
    """
    pair = np.asarray(values, dtype=np.float64)
    if pair.shape != (2,):
        raise InputError(f"{name}: two numbers [left, right] are needed, got an array of shape {pair.shape}")
    if not (abs(pair[0]) <= 3.4e38 and abs(pair[1]) <= 3.4e38):
        raise InputError(f"{name}: {pair.tolist()} is not finite, or beyond single precision")
    return pair.astype(np.float32)


def sample_times(steps: int, sample_steps: int, step_s: float) -> np.ndarray:
    """(n,) float64, s: the times of the samples of one exchange, the last of them its end."""
    count = -(-steps // sample_steps)
    at = np.arange(1, count + 1, dtype=np.int64) * sample_steps
    at[-1] = steps
    return at * step_s


def exchange_of(words: np.ndarray, steps: int, sample_steps: int, step_s: float) -> Exchange:
    """Rows of the simulator, (n, 4) float32 with columns i_l w_l i_r w_r, as an `Exchange`.

    Raises
    ------
    LinkError : a row is not finite.
    """
    if not np.isfinite(words).all():
        raise LinkError(NONFINITE)
    return Exchange(sample_times(steps, sample_steps, step_s), words[:, 1::2].copy(), words[:, 0::2].copy())


NO_PARAMETERS = "exchange: no parameters yet, call set_parameters first"
NONFINITE = "exchange: the motors' state is no longer finite (inputs or parameters out of all proportion)"
CLOSED = "the link is closed"
EFFECTS_LATE = "set_effects: an exchange has been made, effects are set before the first"
