"""Bit-exact model of the motor units with the effect unit (rtl/effects).

As in `rtds_host.motor.model` every operation is one binary32 operation, rounded to nearest even, in the RTL's order.
The step itself ends with a projection: what dry friction can take of the speed that the free step would give. After
each step the program of `effect_program` prepares what the next one works with.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from rtds_host.errors import InputError
from rtds_host.motor.effect_program import CONSTANTS, OUTPUTS, STATES, TABLE_ORIGIN, TABLES
from rtds_host.motor.effect_tables import DELAY_ENTRIES, TABLE_WORDS, EffectWords
from rtds_host.motor.model import SAMPLE_COLUMNS, STATE_COLUMNS, canonical_words, step_motors
from rtds_host.motor.parameters import coefficients, parameter_words
from rtds_host.vectors import Vector

_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)
_LAST_CELL = 255
(_COMMAND_K, _DROP_K, _TORQUE_K, _RIPPLE_K, _FORWARD_K, _BACKWARD_K, _SAG, _DECLINE, _NOMINAL, _LIMIT, _HEAT_IN,
 _HEAT_OUT, _PHASE, _DRIVING, _DRIVEN) = range(len(CONSTANTS))  # fmt: skip
_COMMAND, _DROP, _TORQUE, _RIPPLE, _FORWARD, _BACKWARD = range(len(TABLES))
_SIGNED_ORIGIN = TABLE_ORIGIN["command"]
_SIZE_ORIGIN = TABLE_ORIGIN["ripple"]
# Registers of the delay: where the next entry goes, entries so far (at most the delay), step within an entry. And
# whether a step has prepared the next one.
_DELAY_AT, _DELAY_FILLED, _DELAY_PHASE, _PREPARED = range(4)
_COEFFICIENTS = 9  # R, Kb, Km, B, G11, G12, G21, G22, rho


@numba.njit(inline="always")
def _look(tables, m, table, x, k, origin):
    """(slope, intercept) of the table's line at x: that of the cell floor(x k) + origin, held in 0..255."""
    u = x * k
    if math.isnan(u):
        cell = origin
    elif u >= np.float32(256.0):
        cell = _LAST_CELL
    elif u < np.float32(-256.0):
        cell = 0
    else:
        cell = min(max(math.floor(u) + origin, 0), _LAST_CELL)
    return tables[m, table, cell, 1], tables[m, table, cell, 0]


@numba.njit(inline="always")
def _two_words(hi, lo, increment):
    """hi + lo + increment, as the motor units add up their states: (new hi, new lo)."""
    t = increment + lo
    new = hi + t
    return new, t - (new - hi)


@numba.njit(cache=True)
def _prepare(m, i, w, draws, vc, t, c, constants, tables, inner, ahead):
    """What side m's next step works with, into ahead (2, 4): u_v, u_t, level_f, -level_b; inner (2, 6) goes on.

    The order of operations is that of `rtds_host.motor.effect_program.OPERATIONS`.
    """
    k = constants[m]
    rise, rise_lo, fall, fall_lo, angle, angle_lo = inner[m]
    # supply
    fall, fall_lo = _two_words(fall, fall_lo, k[_DECLINE])
    slope, intercept = _look(tables, m, _COMMAND, vc, k[_COMMAND_K], _SIGNED_ORIGIN)
    bridge = (_ZERO + intercept) + slope * vc
    scaled = (k[_NOMINAL] - fall) * bridge - (k[_SAG] * bridge) * draws
    # voltage
    limited = scaled
    if abs(scaled) > abs(k[_LIMIT]):
        limited = np.float32(math.copysign(k[_LIMIT], scaled))
    driving = limited - c[1] * w
    slope, intercept = _look(tables, m, _DROP, driving, k[_DROP_K], _SIGNED_ORIGIN)
    copper = c[0] * i
    hot = rise * copper
    ahead[m, 0] = ((limited - hot) - intercept) - slope * driving
    # heat
    power = (copper + hot) * i
    warmed = k[_HEAT_IN] * power - k[_HEAT_OUT] * rise
    rise, rise_lo = _two_words(rise, rise_lo, warmed)
    # torque
    slope, intercept = _look(tables, m, _TORQUE, w, k[_TORQUE_K], _SIGNED_ORIGIN)
    loaded = (t + intercept) + slope * w
    angle, angle_lo = _two_words(angle, angle_lo, k[_PHASE] * w)
    if angle < _ZERO:
        angle = angle + _ONE
    elif angle >= _ONE:
        angle = angle - _ONE
    slope, intercept = _look(tables, m, _RIPPLE, angle, k[_RIPPLE_K], _SIZE_ORIGIN)
    ahead[m, 1] = (loaded - intercept) - slope * angle
    # friction
    more_f, more_b = t * k[_DRIVING], t * k[_DRIVEN]
    if math.copysign(_ONE, t) < _ZERO:
        more_f, more_b = t * k[_DRIVEN], t * k[_DRIVING]
    slope, intercept = _look(tables, m, _FORWARD, w, k[_FORWARD_K], _SIZE_ORIGIN)
    ahead[m, 2] = (more_f + intercept) + slope * w
    slope, intercept = _look(tables, m, _BACKWARD, w, k[_BACKWARD_K], _SIZE_ORIGIN)
    ahead[m, 3] = (more_b - intercept) - slope * w
    inner[m, 0], inner[m, 1] = rise, rise_lo
    inner[m, 2], inner[m, 3] = fall, fall_lo
    inner[m, 4], inner[m, 5] = angle, angle_lo


@numba.njit(inline="always")
def _step_with_friction(i, w, i_lo, w_lo, c, ahead, prepared):
    """One step of one motor, projected on what dry friction allows (rtl/core with effects on).

    prepared : a step before this one has given `ahead`; without, there are no inputs and no friction yet.
    """
    s1 = c[0] * i + c[1] * w
    s2 = c[2] * i - c[3] * w
    ti = (i_lo - c[4] * s1) - c[5] * s2
    tw = (w_lo - c[6] * s1) + c[7] * s2
    most_f = most_b = _ZERO
    if prepared:
        ti = (ti + c[5] * ahead[1]) + c[4] * ahead[0]
        tw = (tw - c[7] * ahead[1]) + c[6] * ahead[0]
        most_f = c[7] * ahead[2]
        most_b = c[7] * ahead[3]
    free = w + tw
    if free < _ZERO:
        stuck = free >= most_b
        taken = free if stuck else most_b
    else:
        stuck = free == _ZERO or free <= most_f
        taken = free if stuck else most_f
    ti = ti + c[8] * taken
    i_new = i + ti
    i_lo_new = ti - (i_new - i)
    if stuck:
        return i_new, _ZERO, i_lo_new, _ZERO
    tw = tw - taken
    w_new = w + tw
    return i_new, w_new, i_lo_new, tw - (w_new - w)


@numba.njit(cache=True)
def _run_effects(on, state, ahead, inner, c, constants, tables, memory, late, delay, stride, held, v, t, n_steps, every,
                 done, total, out, row):  # fmt: skip
    """`n_steps` of both motors, samples as in `rtds_host.motor.model`; out (m, 2, 4) takes the whole state.

    on : the effect unit runs; without it only the sides' own coefficients c (2, 9) differ from the ideal unit.
    ahead (2, 4), inner (2, 6), memory (DELAY_ENTRIES, 2), late (4,), held (2,): the unit's state.
    """
    end = done + n_steps
    while done < end:
        for m in range(2):
            i, w, i_lo, w_lo = state[m, 0], state[m, 1], state[m, 2], state[m, 3]
            k = c[m]
            if on:
                i, w, i_lo, w_lo = _step_with_friction(i, w, i_lo, w_lo, k, ahead[m], late[_PREPARED] != 0)
            else:
                i, w, i_lo, w_lo = step_motors(
                    i, w, i_lo, w_lo, k[0], k[1], k[2], k[3], k[4], k[5], k[6], k[7], v[m], t[m]
                )
            state[m, 0], state[m, 1], state[m, 2], state[m, 3] = i, w, i_lo, w_lo
        if on:
            if late[_DELAY_PHASE] == 0:
                at = late[_DELAY_AT]
                memory[at, 0], memory[at, 1] = v[0], v[1]
                ready = late[_DELAY_FILLED] >= delay
                there = (at - delay) % DELAY_ENTRIES
                for m in range(2):
                    held[m] = memory[there, m] if ready else _ZERO
                late[_DELAY_AT] = (at + 1) % DELAY_ENTRIES
                if not ready:
                    late[_DELAY_FILLED] += 1
            late[_DELAY_PHASE] = late[_DELAY_PHASE] + 1 if late[_DELAY_PHASE] + 1 < stride else 0
            draws = held[0] * state[0, 0] + held[1] * state[1, 0]
            for m in range(2):
                _prepare(m, state[m, 0], state[m, 1], draws, held[m], t[m], c[m], constants, tables, inner, ahead)
            late[_PREPARED] = 1
        done += 1
        if done % every == 0 or done == total:
            out[row] = state
            row += 1
    return row


def side_coefficients(words: np.ndarray, method: int) -> tuple[np.ndarray, bool]:
    """A side's (9,) coefficients R, Kb, Km, B, G11, G12, G21, G22, rho, and the fault of the parameter unit.

    rho = c / L' = G12 / G22, A/(rad/s), the current that a speed taken by friction leaves: c and L' as in
    `rtds_host.motor.parameters`.
    """
    found, fault = coefficients(words, method)
    r, l, kb, h = np.float32(words[0]), np.float32(words[1]), np.float32(words[3]), np.float32(words[6])
    with np.errstate(all="ignore"):
        th = h * np.float32(0.5 if method else 1.0)
        found[8] = (th * kb) / (l + th * r)
    return found, fault


class EffectPair:
    """Both motors with the effect unit between strobes, as raw words: what the RTL core does with effects.

    Attributes
    ----------
    on : the effect unit runs.
    step_count : steps since the start or the last `clear`.
    """

    def __init__(self) -> None:
        self._state = np.zeros((2, len(STATE_COLUMNS)), np.float32)
        self._c = np.zeros((2, _COEFFICIENTS), np.float32)
        self._next: np.ndarray | None = None
        self.on = False
        self.constants = np.zeros((2, len(CONSTANTS)), np.float32)
        self.tables = np.zeros((2, len(TABLES), _LAST_CELL + 1, 2), np.float32)
        self._delay = 0
        self._stride = 1
        self.step_count = 0
        self._rest()

    def load(self, words: EffectWords) -> None:
        """Take tables, constants and delay over, and run with them; the unit's own state starts again."""
        self.constants[:] = words.constants
        self.tables[:] = words.tables
        self.switch(words.on, words.delay, words.stride)

    def switch(self, on: bool, delay: int = 0, stride: int = 1) -> None:
        """Effects on or off; a unit that was off starts again. `delay` counts entries of `stride` steps each."""
        if not 0 <= delay < DELAY_ENTRIES or stride < 1:
            raise InputError(f"delay, stride: {delay}, {stride}: 0 to {DELAY_ENTRIES - 1} entries of one step or more")
        if not (on and self.on):
            self._rest()
        self.on, self._delay, self._stride = on, delay, stride

    def set_parameters(self, values: np.ndarray, method: str) -> None:
        """(2, 7) parameters of [left, right], SI; they act from the step after next.

        Raises
        ------
        InputError : as `rtds_host.motor.parameters.parameter_words`.
        """
        found = [side_coefficients(*parameter_words(side, method)) for side in values]
        self._next = np.array([c for c, _ in found], np.float32)

    def set_coefficients(self, c: np.ndarray, rho: np.float32 | None = None) -> None:
        """(2, 9) coefficients in force from now on; `rho` in place of both sides' own."""
        self._c[:] = c
        if rho is not None:
            self._c[:, 8] = rho

    def step(self, v: Vector, t: Vector, n_steps: int, sample_every: int | None = None) -> np.ndarray:
        """Steps with the inputs held.

        Parameters
        ----------
        v, t : (2,) V and N·m, [left, right].
        n_steps, sample_every : as in `rtds_host.motor.MotorPair.step`.

        Returns
        -------
        (m, 2, 4) float32: i, w, i_lo, w_lo of [left, right] at each sample.
        """
        volts, torques = np.ascontiguousarray(v, np.float32), np.ascontiguousarray(t, np.float32)
        every = n_steps if sample_every is None else sample_every
        out = np.empty((-(-n_steps // every), 2, len(STATE_COLUMNS)), np.float32)
        done = row = 0
        if self._next is not None:
            row = self._advance(volts, torques, 1, every, 0, n_steps, out, 0)
            self._c, self._next = self._next, None
            done = 1
        if done < n_steps:
            self._advance(volts, torques, n_steps - done, every, done, n_steps, out, row)
        self.step_count = (self.step_count + n_steps) & 0xFFFFFFFF
        return out

    def clear(self) -> None:
        """State of motors and effects, and the step count, to zero; tables and coefficients stay."""
        self._state[:] = 0.0
        self.step_count = 0
        self._rest()

    def words(self) -> np.ndarray:
        """(2, 4) uint32: i, w, i_lo, w_lo of [left, right], NaN in its canonical form."""
        return canonical_words(self._state)

    def samples(self, states: np.ndarray) -> np.ndarray:
        """(m, 4) float32, the high words of `step`, columns as `SAMPLE_COLUMNS`."""
        return np.ascontiguousarray(states[:, :, :2].reshape(-1, len(SAMPLE_COLUMNS)))

    @property
    def inner(self) -> dict[str, np.ndarray]:
        """The effect unit's own state, name -> (2,) float32: rise of R, fall of the bus, angle in periods."""
        return {name: self._inner[:, k].copy() for k, name in enumerate(STATES)}

    def _rest(self) -> None:
        self._ahead = np.zeros((2, len(OUTPUTS)), np.float32)
        self._inner = np.zeros((2, len(STATES)), np.float32)
        self._memory = np.zeros((DELAY_ENTRIES, 2), np.float32)
        self._late = np.zeros(4, np.int64)
        self._held = np.zeros(2, np.float32)

    def _advance(self, v, t, n_steps, every, done, total, out, row) -> int:
        return _run_effects(
            self.on, self._state, self._ahead, self._inner, self._c, self.constants, self.tables, self._memory,
            self._late, self._delay, self._stride, self._held, v, t, n_steps, every, done, total, out, row,
        )  # fmt: skip


class EffectCore:
    """The RTL core with effects strobe by strobe, parameter unit included, on raw words: the oracle of the RTL's tests.

    Attributes
    ----------
    fault : `param_fault_o` after the last strobe and the computation it started.
    """

    def __init__(self) -> None:
        self._pair = EffectPair()
        self._seen: tuple | None = None
        self._rho = np.float32(0.0)
        self.fault = False

    def write(self, address: int, word: int) -> None:
        """A word through the register port, between two steps; addresses that hold nothing are passed over."""
        value = np.uint32(word).view(np.float32)
        if address < TABLE_WORDS:
            side, table, cell, which = address >> 12, (address >> 9) & 7, (address >> 1) & 255, address & 1
            if table < len(TABLES):
                self._pair.tables[side, table, cell, which] = value
        else:
            side, k = (address >> 7) & 1, address & 127
            if k < len(CONSTANTS):
                self._pair.constants[side, k] = value

    def clear(self) -> None:
        """`clear_i`: the state of motors and effects to zero."""
        self._pair.clear()

    def run(
        self, v: np.ndarray, t: np.ndarray, parameters: np.ndarray, method: int, n_steps: int, *, on: bool = True,
        own: np.ndarray | None = None, delay: int = 0, stride: int = 1,
    ) -> np.ndarray:  # fmt: skip
        """`n_steps` strobes with everything held.

        Parameters
        ----------
        v, t : (2,) uint32. parameters : (7,) uint32. method : 0 or 1.
        on, own, delay, stride : as in the core's settings; own is the right motor's (6,) uint32, or None.

        Returns
        -------
        (n_steps, 2, 4) uint32: i, w, i_lo, w_lo of [left, right] after each step.
        """
        v, t = np.asarray(v, np.uint32).view(np.float32), np.asarray(t, np.uint32).view(np.float32)
        self._pair.switch(on, delay, stride)
        first = self._pair.step(v, t, 1, 1)
        words = np.ascontiguousarray(parameters, np.uint32)
        right = words if own is None else np.append(np.asarray(own, np.uint32), words[6])
        seen = (words.tobytes(), right.tobytes(), own is None, method, on)
        if seen != self._seen:
            self._seen = seen
            found = [side_coefficients(side.view(np.float32), method) for side in (words, right)]
            self.fault = any(fault for _, fault in found)
            if on:
                self._rho = found[1][0][8]
            if not self.fault:
                self._pair.set_coefficients(np.array([c for c, _ in found]), None if on else self._rho)
        if n_steps == 1:
            return canonical_words(first)
        return canonical_words(np.concatenate([first, self._pair.step(v, t, n_steps - 1, 1)]))
