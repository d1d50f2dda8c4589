"""Bit-exact model of the RTL's motor units.

Every operation is one binary32 operation, rounded to nearest even, in the RTL's order; the numba functions are
compiled without `fastmath`, so that nothing is reordered or contracted. Each state variable is two words, hi + lo.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numba
import numpy as np

from rtds_host.errors import InputError
from rtds_host.motor.parameters import PARAMETER_NAMES, coefficients, parameter_words
from rtds_host.vectors import Vector

# Columns of the samples, and the order of the RTL's outputs.
SAMPLE_COLUMNS = ("i_l", "w_l", "i_r", "w_r")
# State of one motor: current and speed, high words then low words.
STATE_COLUMNS = ("i", "w", "i_lo", "w_lo")
CANONICAL_NAN = 0x7FC00000
# Terms that `EnergyTerms` sums, in the order in which the kernel keeps them.
_TERMS = 8


@numba.njit(inline="always")
def _increments(i, w, i_lo, w_lo, r, kb, km, b, g11, g12, g21, g22, v, t):
    """What a step adds to (i, w), the low words in it: the order of operations is that of rtl/core/rtds_row.v.

    All but the inputs' products is known before the strobe: so V and T come last.
    """
    s1 = r * i + kb * w  # V
    s2 = km * i - b * w  # N m
    ti = (((i_lo - g11 * s1) - g12 * s2) + g11 * v) + g12 * t
    tw = (((w_lo - g21 * s1) + g22 * s2) + g21 * v) - g22 * t
    return ti, tw


@numba.njit(inline="always")
def step_motors(i, w, i_lo, w_lo, r, kb, km, b, g11, g12, g21, g22, v, t):
    """One step of one motor, all float32: (i, w, i_lo, w_lo) after it."""
    ti, tw = _increments(i, w, i_lo, w_lo, r, kb, km, b, g11, g12, g21, g22, v, t)
    i_new = i + ti
    w_new = w + tw
    return i_new, w_new, ti - (i_new - i), tw - (w_new - w)


@numba.njit(cache=True)
def _run(state, c, v, t, n_steps, every, done, total, out, row):
    """`n_steps` of both motors; a sample where `done` plus the steps made is a multiple of `every`, or `total`."""
    r, kb, km, b, g11, g12, g21, g22 = c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7]
    vl, vr, tl, tr = v[0], v[1], t[0], t[1]
    il, wl, ill, wll = state[0, 0], state[0, 1], state[0, 2], state[0, 3]
    ir, wr, irl, wrl = state[1, 0], state[1, 1], state[1, 2], state[1, 3]
    end = done + n_steps
    while done < end:
        stop = min(end, (done // every + 1) * every)
        for _ in range(stop - done):
            il, wl, ill, wll = step_motors(il, wl, ill, wll, r, kb, km, b, g11, g12, g21, g22, vl, tl)
            ir, wr, irl, wrl = step_motors(ir, wr, irl, wrl, r, kb, km, b, g11, g12, g21, g22, vr, tr)
        done = stop
        if done % every == 0 or done == total:
            out[row, 0], out[row, 1], out[row, 2], out[row, 3] = il, wl, ir, wr
            row += 1
    state[0, 0], state[0, 1], state[0, 2], state[0, 3] = il, wl, ill, wll
    state[1, 0], state[1, 1], state[1, 2], state[1, 3] = ir, wr, irl, wrl
    return row


@numba.njit(cache=True)
def _run_energy(state, c, p, theta, v, t, n_steps, every, done, total, out, row, sums):
    """As `_run`, and the terms of the energy balance summed at every step in float64 into `sums` (2, 8).

    p : (7,) float32 parameters in force, theta : 1 or 0.5.
    """
    r, kb, km, b, g11, g12, g21, g22 = c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7]
    r64, l64, km64, kb64 = np.float64(p[0]), np.float64(p[1]), np.float64(p[2]), np.float64(p[3])
    j64, b64, h64 = np.float64(p[4]), np.float64(p[5]), np.float64(p[6])
    end = done + n_steps
    while done < end:
        stop = min(end, (done // every + 1) * every)
        for m in range(2):
            i, w, i_lo, w_lo = state[m, 0], state[m, 1], state[m, 2], state[m, 3]
            v64, t64 = np.float64(v[m]), np.float64(t[m])
            supplied, recovered, copper, viscous = 0.0, 0.0, 0.0, 0.0
            shaft, conversion, dissipated = 0.0, 0.0, 0.0
            i0, w0 = np.float64(i) + np.float64(i_lo), np.float64(w) + np.float64(w_lo)
            stored = -0.5 * (l64 * i0 * i0 + j64 * w0 * w0)
            for _ in range(stop - done):
                i, w, i_lo, w_lo = step_motors(i, w, i_lo, w_lo, r, kb, km, b, g11, g12, g21, g22, v[m], t[m])
                i1, w1 = np.float64(i) + np.float64(i_lo), np.float64(w) + np.float64(w_lo)
                di, dw = i1 - i0, w1 - w0
                im, wm = i0 + theta * di, w0 + theta * dw  # where the method takes the derivative
                power = v64 * im
                if power >= 0.0:
                    supplied += power
                else:
                    recovered -= power
                copper += im * im
                viscous += wm * wm
                shaft += wm
                conversion += im * wm
                dissipated += l64 * di * di + j64 * dw * dw
                i0, w0 = i1, w1
            stored += 0.5 * (l64 * i0 * i0 + j64 * w0 * w0)
            state[m, 0], state[m, 1], state[m, 2], state[m, 3] = i, w, i_lo, w_lo
            sums[m, 0] += supplied * h64
            sums[m, 1] += recovered * h64
            sums[m, 2] += copper * r64 * h64
            sums[m, 3] += viscous * b64 * h64
            sums[m, 4] += shaft * t64 * h64
            sums[m, 5] += stored
            sums[m, 6] += dissipated * (theta - 0.5)
            sums[m, 7] += conversion * (kb64 - km64) * h64
        done = stop
        if done % every == 0 or done == total:
            for m in range(2):
                out[row, 2 * m], out[row, 2 * m + 1] = state[m, 0], state[m, 1]
            row += 1
    return row


@dataclass(frozen=True)
class EnergyTerms:
    """Energy since the start (or the last `clear`), summed at every step in float64; each (2,) [left, right], J.

    With x_m = x + theta (x+ - x), the point at which the method takes the derivative, the difference equation times
    (i_m, w_m) h gives, exactly and step by step,

        V i_m h = R i_m^2 h + B w_m^2 h + T w_m h + change of (L i^2 + J w^2)/2
                  + (theta - 1/2) (L di^2 + J dw^2) + (Kb - Km) i_m w_m h

    Attributes
    ----------
    supplied_j : electrical energy drawn while V i_m > 0.
    recovered_j : electrical energy given back to the supply while V i_m < 0, as a positive number.
    copper_j : lost in the winding.
    viscous_j : lost to viscous friction.
    shaft_j : work done on the load (negative while the load drives the motor).
    stored_j : change of the magnetic and kinetic energy.
    numerical_j : what backward Euler damps away (no physical loss; 0 for the trapezoidal rule).
    conversion_j : vanishes unless Kb and Km differ in value, when the motor's conversion is not lossless.
    """

    supplied_j: np.ndarray
    recovered_j: np.ndarray
    copper_j: np.ndarray
    viscous_j: np.ndarray
    shaft_j: np.ndarray
    stored_j: np.ndarray
    numerical_j: np.ndarray
    conversion_j: np.ndarray

    @property
    def drawn_j(self) -> np.ndarray:
        """(2,) J, net electrical energy: supplied minus recovered."""
        return self.supplied_j - self.recovered_j

    @property
    def accounted_j(self) -> np.ndarray:
        """(2,) J, where it went: equals `drawn_j` but for the rounding of the model's arithmetic."""
        return self.copper_j + self.viscous_j + self.shaft_j + self.stored_j + self.numerical_j + self.conversion_j

    @property
    def imbalance(self) -> np.ndarray:
        """(2,) drawn minus accounted, over the largest of the terms (0 where nothing happened yet)."""
        largest = np.max([np.abs(getattr(self, field.name)) for field in fields(self)], axis=0)
        return np.abs(self.drawn_j - self.accounted_j) / np.where(largest > 0.0, largest, 1.0)


class MotorPair:
    """Both motors in process, bit for bit what the RTL computes.

    As in the RTL an input acts in the step after it is read and a parameter one step later: the first step after
    `set_parameters` still uses the old coefficients, and the very first step ever, for want of any, rests.

    Parameters
    ----------
    energy : keep the terms of the energy balance at every step (at a little under half the speed).
    """

    def __init__(self, energy: bool = False) -> None:
        self._energy = energy
        self._active = _no_parameters()
        self._pending: _ActiveSet | None = None
        self._state = np.zeros((2, len(STATE_COLUMNS)), dtype=np.float32)
        self._sums = np.zeros((2, _TERMS))
        self.step_count = 0

    @property
    def step_s(self) -> float:
        """Length of a step in s, of the last parameters given; 0 before any."""
        return float((self._pending or self._active).words[6])

    @property
    def finite(self) -> bool:
        """False once a NaN or an infinity is in the state (`nonfinite_o` of the RTL)."""
        return bool(np.isfinite(self._state[:, :2]).all())

    @property
    def energy(self) -> EnergyTerms:
        """The terms so far.

        Raises
        ------
        InputError : the pair was made without ``energy=True``.
        """
        if not self._energy:
            raise InputError("energy: this MotorPair keeps no energy terms, make it with energy=True")
        return EnergyTerms(*self._sums.T.copy())

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
        """Give both motors these parameters (SI at the motor shaft); they act from the step after next.

        Raises
        ------
        InputError : names the parameter that is zero, negative, NaN, infinite or outside single precision, or says
            which coefficient overflows. The old parameters stay in force.
        """
        values = (
            resistance_ohm,
            inductance_h,
            torque_constant_nm_per_a,
            back_emf_constant_v_s_per_rad,
            rotor_inertia_kg_m2,
            viscous_friction_nm_s_per_rad,
            step_s,
        )
        words, method_index = parameter_words(values, method)
        self._pending = _ActiveSet(words, coefficients(words, method_index)[0], 0.5 if method_index else 1.0)

    def clear(self) -> None:
        """State, step count and energy terms to zero (`clear_i` of the RTL); the parameters stay."""
        self._state[:] = 0.0
        self._sums[:] = 0.0
        self.step_count = 0

    def step(self, v2: Vector, t2: Vector, n_steps: int, sample_every: int | None = None) -> np.ndarray:
        """Run `n_steps` steps with the inputs held.

        Parameters
        ----------
        v2 : (2,) V at the terminals, [left, right].
        t2 : (2,) N m at the shaft, [left, right]; positive opposes positive rotation.
        n_steps : number of steps, at least 1.
        sample_every : a sample is kept after every so many steps, and one at the end; only the one at the end
            without it.

        Returns
        -------
        (m, 4) float32, the high words, columns as `SAMPLE_COLUMNS`: A and rad/s.

        Raises
        ------
        InputError : fewer than one step.
        """
        if n_steps < 1 or (sample_every is not None and sample_every < 1):
            raise InputError(f"n_steps, sample_every: {n_steps}, {sample_every} must be at least 1")
        v = np.ascontiguousarray(v2, dtype=np.float32)
        t = np.ascontiguousarray(t2, dtype=np.float32)
        every = n_steps if sample_every is None else sample_every
        out = np.empty((-(-n_steps // every), len(SAMPLE_COLUMNS)), dtype=np.float32)
        done = row = 0
        if self._pending is not None:
            row = self._advance(v, t, 1, every, 0, n_steps, out, 0)
            self._active, self._pending = self._pending, None
            done = 1
        if done < n_steps:
            self._advance(v, t, n_steps - done, every, done, n_steps, out, row)
        self.step_count = (self.step_count + n_steps) & 0xFFFFFFFF
        return out

    def words(self) -> np.ndarray:
        """(2, 4) uint32: i, w, i_lo, w_lo of [left, right] as on the RTL's outputs, NaN in its canonical form."""
        return canonical_words(self._state)

    def state(self) -> np.ndarray:
        """(2, 2) float64: current (A) and speed (rad/s) of [left, right], both words."""
        return self._state[:, :2].astype(np.float64) + self._state[:, 2:]

    def _advance(self, v, t, n_steps, every, done, total, out, row) -> int:
        active = self._active
        if self._energy:
            return _run_energy(
                self._state,
                active.coefficients,
                active.words,
                active.theta,
                v,
                t,
                n_steps,
                every,
                done,
                total,
                out,
                row,
                self._sums,
            )
        return _run(self._state, active.coefficients, v, t, n_steps, every, done, total, out, row)


@dataclass(frozen=True)
class _ActiveSet:
    words: np.ndarray  # (7,) float32
    coefficients: np.ndarray  # (9,) float32
    theta: float


def _no_parameters() -> _ActiveSet:
    return _ActiveSet(np.zeros(len(PARAMETER_NAMES), np.float32), np.zeros(9, np.float32), 1.0)


def canonical_words(values: np.ndarray) -> np.ndarray:
    """float32 values as uint32 words, every NaN replaced by the RTL's one NaN."""
    words = np.ascontiguousarray(values, dtype=np.float32).view(np.uint32).copy()
    words[np.isnan(values)] = CANONICAL_NAN
    return words


@numba.njit(cache=True)
def _trace(state, c, v, t, out):
    """One step for each row of `out` (n, 2, 4) float32, which gets the state after it."""
    for m in range(2):
        i, w, i_lo, w_lo = state[m, 0], state[m, 1], state[m, 2], state[m, 3]
        for k in range(len(out)):
            i, w, i_lo, w_lo = step_motors(i, w, i_lo, w_lo, c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], v[m], t[m])
            out[k, m, 0], out[k, m, 1], out[k, m, 2], out[k, m, 3] = i, w, i_lo, w_lo
        state[m, 0], state[m, 1], state[m, 2], state[m, 3] = i, w, i_lo, w_lo


class CoreModel:
    """The RTL core strobe by strobe, parameter unit included, on raw words: the oracle of the RTL's tests.

    Attributes
    ----------
    fault : `param_fault_o` after the last strobe and the computation it started.
    """

    def __init__(self) -> None:
        self._state = np.zeros((2, len(STATE_COLUMNS)), dtype=np.float32)
        self._coefficients = np.zeros(9, dtype=np.float32)
        self._last_seen: tuple[bytes, int] | None = None
        self.fault = False
        self.step_count = 0

    def strobe(self, v: np.ndarray, t: np.ndarray, parameters: np.ndarray, method: int) -> np.ndarray:
        """One step: `run` with one strobe, (2, 4)."""
        return self.run(v, t, parameters, method, 1)[0]

    def run(self, v: np.ndarray, t: np.ndarray, parameters: np.ndarray, method: int, n_steps: int) -> np.ndarray:
        """`n_steps` strobes with everything held.

        Parameters
        ----------
        v, t : (2,) uint32, binary32 words of the inputs, [left, right].
        parameters : (7,) uint32 in the order of `PARAMETER_NAMES`.
        method : 0 or 1.

        Returns
        -------
        (n_steps, 2, 4) uint32: i, w, i_lo, w_lo of [left, right] after each step. A changed parameter set acts on
        the second.
        """
        inputs = np.asarray(v, np.uint32).view(np.float32), np.asarray(t, np.uint32).view(np.float32)
        out = np.empty((n_steps, 2, len(STATE_COLUMNS)), dtype=np.float32)
        _trace(self._state, self._coefficients, *inputs, out[:1])
        words = np.ascontiguousarray(parameters, np.uint32)
        seen = (words.tobytes(), method)
        if seen != self._last_seen:
            self._last_seen = seen
            new, self.fault = coefficients(words.view(np.float32), method)
            if not self.fault:
                self._coefficients = new
        _trace(self._state, self._coefficients, *inputs, out[1:])
        self.step_count = (self.step_count + n_steps) & 0xFFFFFFFF
        return canonical_words(out)

    def clear(self) -> None:
        """State and step count to zero; coefficients and fault stay."""
        self._state[:] = 0.0
        self.step_count = 0

    @property
    def finite(self) -> bool:
        """False once a NaN or an infinity is in the state's high words."""
        return bool(np.isfinite(self._state[:, :2]).all())
