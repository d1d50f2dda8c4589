"""The likelihood: what a sensor reports is the replay, plus white noise, plus what the model lacks.

On each channel c, in units of its noise, r(t) = d(t) + e(t): e is white of variance 1, d the discrepancy, an
Ornstein-Uhlenbeck process of size s_c and correlation time tau_c that are estimated with every explanation from its
own residuals. The likelihood is that of the innovations of a Kalman filter, exact at uneven sampling and across holes:

    -2 log p(r) = sum_k (v_k^2 / S_k + log S_k)

The filter is linear in r for given (s, tau), so the same recursion whitens residuals and derivatives: least squares on
whitened residuals is maximum likelihood. A residual that an explanation leaves is paid for by its size once per
correlation time, instead of once per sample; what an effect takes off a large rest still counts.

References: M. C. Kennedy, A. O'Hagan, J. R. Stat. Soc. B 63, 2001 (calibration with a discrepancy); N. R. Kristensen,
H. Madsen, S. B. Jorgensen, Automatica 40, 2004 (innovations of a continuous-discrete filter); F. C. Schweppe, IEEE
Trans. Inf. Theory 11, 1965 (likelihood by innovations).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

from rtds_host.plant.elementary import exp_minus

# A discrepancy comes and goes; what lasts longer than this is a scale, a bias or a load, which the catalogue has names
# for.
LONGEST_S = 0.3
# Numerical: sizes and correlation times that are told apart, and how finely they are looked for (in logarithms).
LEAST_SIZE = 1e-3
COARSE_TAUS = 5
PATTERN_STEPS = (1.0, 0.4)
# Numerical: discrepancies whose likelihoods are found abreast, steps that are looked at ahead, and the rows of the
# lanes' state.
LANES, AHEAD = 4, 64
S2, PER_TAU, TOTAL, M, P, A, S, PRODUCT, MOVED, KEEP, TAKE, SQUARES = (k * LANES for k in range(12))


@dataclass(frozen=True)
class Series:
    """Residuals of one channel in one run, in order of time: rows `first` to `last` of the residuals, at times
    t (s).
    """

    channel: int
    first: int
    last: int
    t: np.ndarray


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _nll(r, t, w, ahead):
    """Add -2 log likelihood of one series, per the module's head, less its constant, in each lane of `w`; `ahead`
    (LANES * AHEAD,) is room for what is left of a discrepancy after each of the next steps."""
    begun = filled = 0
    for l in range(LANES):
        w[M + l], w[P + l], w[S + l], w[PRODUCT + l], w[A + l] = 0.0, w[S2 + l], 1.0, 1.0, 1.0
    last_dt = -1.0
    k = 0
    while k < r.shape[0]:
        if k > 0:
            dt = t[k] - t[k - 1]
            if abs(dt - last_dt) > 1e-7 * last_dt:
                last_dt = dt
                if k >= filled:
                    # Many at a time: they do not wait for one another.
                    begun, filled = k, min(k + AHEAD, r.shape[0])
                    for l in range(LANES):
                        for i in range(filled - begun):
                            ahead[l * AHEAD + i] = exp_minus((t[begun + i] - t[begun + i - 1]) * w[PER_TAU + l])
                for l in range(LANES):
                    w[A + l] = ahead[l * AHEAD + k - begun]
        row = r[k]
        k += 1
        for l in range(LANES):
            a = w[A + l]
            m, p = a * w[M + l], a * a * (w[P + l] - w[S2 + l]) + w[S2 + l]
            v, s = row - m, p + 1.0
            per = 1.0 / s
            g = p * per
            w[MOVED + l] = abs(s - w[S + l]) * per
            w[S + l] = s
            w[P + l] = g
            w[PRODUCT + l] *= s
            w[TOTAL + l] += v * v * per
            w[M + l] = m + g * v
        if max(w[PRODUCT], w[PRODUCT + 1], w[PRODUCT + 2], w[PRODUCT + 3]) > 1e200:
            for l in range(LANES):
                w[TOTAL + l] += math.log(w[PRODUCT + l])
                w[PRODUCT + l] = 1.0
        # At even sampling the gain soon stands still: one multiplication and addition lead from each expectation to the
        # next.
        if k > 2 and max(w[MOVED], w[MOVED + 1], w[MOVED + 2], w[MOVED + 3]) < 1e-9:
            first = k
            for l in range(LANES):
                w[KEEP + l], w[TAKE + l] = w[A + l] * (1.0 - w[P + l]), w[A + l] * w[P + l]
                w[M + l] *= w[A + l]
                w[SQUARES + l] = 0.0
            while k < r.shape[0] and abs(t[k] - t[k - 1] - last_dt) <= 1e-7 * last_dt:
                row = r[k]
                for l in range(LANES):
                    v = row - w[M + l]
                    w[SQUARES + l] += v * v
                    w[M + l] = w[KEEP + l] * w[M + l] + w[TAKE + l] * row
                k += 1
            for l in range(LANES):
                # From the next row's expectation back to what is known at this one.
                w[M + l] /= w[A + l]
                w[TOTAL + l] += w[SQUARES + l] / w[S + l] + math.log(w[S + l]) * (k - first)
    for l in range(LANES):
        w[TOTAL + l] += math.log(w[PRODUCT + l])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _nll_of_all(residual, t, first, last, s2, tau):
    """The same of several series by each of several discrepancies s2, tau (m,), four of them abreast, since in each a
    row waits for the one before it: (m,), of rows first to last of residuals and times (N,)."""
    total = np.empty(s2.shape[0])
    w, ahead = np.empty(SQUARES + LANES), np.empty(LANES * AHEAD)
    for begin in range(0, s2.shape[0], LANES):
        for l in range(LANES):
            one = min(begin + l, s2.shape[0] - 1)
            w[S2 + l], w[PER_TAU + l], w[TOTAL + l] = s2[one], 1.0 / tau[one], 0.0
        for k in range(first.shape[0]):
            _nll(residual[first[k] : last[k]], t[first[k] : last[k]], w, ahead)
        for l in range(min(LANES, s2.shape[0] - begin)):
            total[begin + l] = w[TOTAL + l]
    return total


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _gains(t, s2, tau, keep, take, i_out, log_out):
    """Filter of one series: of each sample 1 / sqrt(S) and log S, and how the next one's expectation follows from its
    own and from the sample, keep * expectation + take * sample; nothing follows from the last."""
    if s2 == 0.0:
        keep[:], take[:], i_out[:], log_out[:] = 0.0, 0.0, 1.0, 0.0
        return
    p = s2
    last_dt = -1.0
    a = 1.0
    for k in range(t.shape[0]):
        if k > 0:
            dt = t[k] - t[k - 1]
            if dt != last_dt:
                last_dt = dt
                a = math.exp(-dt / tau)
            keep[k - 1] *= a
            take[k - 1] *= a
            p = a * a * p + s2 * (1.0 - a * a)
        s = p + 1.0
        p = p / s
        last = k + 1 == t.shape[0]
        keep[k] = 0.0 if last else 1.0 - p
        take[k] = 0.0 if last else p
        i_out[k] = 1.0 / math.sqrt(s)
        log_out[k] = math.log(s)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _whiten(column, keep, take, i, out):
    """Innovations over their standard deviations, of one series after another."""
    m = 0.0
    for k in range(column.shape[0]):
        c = column[k]
        out[k] = (c - m) * i[k]
        m = keep[k] * m + take[k] * c


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _whiten_four(c0, c1, c2, c3, keep, take, i, o0, o1, o2, o3):
    """The same of four columns at once: each step waits for the one before it, four do not."""
    m0 = m1 = m2 = m3 = 0.0
    for k in range(c0.shape[0]):
        decay, gain, scale = keep[k], take[k], i[k]
        x0, x1, x2, x3 = c0[k], c1[k], c2[k], c3[k]
        o0[k] = (x0 - m0) * scale
        o1[k] = (x1 - m1) * scale
        o2[k] = (x2 - m2) * scale
        o3[k] = (x3 - m3) * scale
        m0 = decay * m0 + gain * x0
        m1 = decay * m1 + gain * x1
        m2 = decay * m2 + gain * x2
        m3 = decay * m3 + gain * x3


@dataclass(frozen=True)
class _Channel:
    """One channel's series: rows first to last (m,) of residuals, times t (N,), and the correlation times that it can
    show, s.
    """

    first: np.ndarray
    last: np.ndarray
    t: np.ndarray
    shortest: float
    longest: float

    @classmethod
    def of(cls, series: list[Series], count: int) -> _Channel:
        t = np.zeros(count)
        for one in series:
            t[one.first : one.last] = one.t
        steps = np.concatenate([np.diff(one.t) for one in series])
        shortest = 0.5 * float(np.median(steps)) if len(steps) else 0.0
        span = max(float(one.t[-1] - one.t[0]) for one in series)
        first, last = (np.array([getattr(one, end) for one in series], np.int64) for end in ("first", "last"))
        return cls(first, last, t, shortest, max(min(span, LONGEST_S), 2.0 * shortest))

    @property
    def count(self) -> int:
        return int((self.last - self.first).sum())

    def square(self, residual: np.ndarray) -> float:
        """Sum of the squared residuals of the channel."""
        return sum(float(residual[a:b] @ residual[a:b]) for a, b in zip(self.first, self.last))


class Discrepancy:
    """Size s (C,) in units of noise and correlation time tau (C,) s of each channel's discrepancy, and its filter."""

    def __init__(
        self,
        series: list[Series],
        count: int,
        channels: int,
        s: np.ndarray | None = None,
        tau: np.ndarray | None = None,
        channel: dict[int, _Channel] | None = None,
    ):
        self.series, self.count = series, count
        self.channel = (
            channel
            if channel is not None
            else {
                c: _Channel.of([one for one in series if one.channel == c], count)
                for c in sorted({one.channel for one in series})
            }
        )
        self.s = np.zeros(channels) if s is None else s
        self.tau = np.ones(channels) if tau is None else tau
        self.keep, self.take, self.i, self.log = (np.empty(count) for _ in range(4))
        for one in series:
            rows = slice(one.first, one.last)
            _gains(
                one.t,
                self.s[one.channel] ** 2,
                self.tau[one.channel],
                self.keep[rows],
                self.take[rows],
                self.i[rows],
                self.log[rows],
            )

    def whiten(self, column: np.ndarray) -> np.ndarray:
        """A whitened column, (N,), in the type it comes in; itself where there is no discrepancy."""
        if not self.s.any():
            return column
        out = np.empty_like(column)
        _whiten(column, self.keep, self.take, self.i, out)
        return out

    def whitened(self, columns: Sequence[np.ndarray]) -> np.ndarray:
        """Whitened columns, (N,) each, beside one another: (N, p) float32, each in one piece."""
        out = np.empty((self.count, len(columns)), np.float32, order="F")
        self.whiten_into(columns, list(out.T))
        return out

    def whiten_into(self, columns: Sequence[np.ndarray], out: Sequence[np.ndarray]) -> None:
        """Whiten columns (N,) each into others of the same type; copies where there is no discrepancy."""
        if not self.s.any():
            for column, into in zip(columns, out, strict=True):
                into[:] = column
            return
        whole = len(columns) // 4 * 4
        for k in range(0, whole, 4):
            _whiten_four(*columns[k : k + 4], self.keep, self.take, self.i, *out[k : k + 4])
        for column, into in zip(columns[whole:], out[whole:], strict=True):
            _whiten(column, self.keep, self.take, self.i, into)

    def cost(self, residual: np.ndarray) -> float:
        """-2 log likelihood of residuals (N,), less its constant."""
        white = self.whiten(residual)
        return float(white @ white + self.log.sum())

    def blocks(self, residual: np.ndarray, blocks: np.ndarray, count: int) -> np.ndarray:
        """-2 log likelihood by block of time, (count,); `blocks` (N,) says which block a residual is in."""
        white = self.whiten(residual)
        return np.bincount(blocks, white * white + self.log, minlength=count)

    def estimated(self, residual: np.ndarray, thorough: bool = False) -> Discrepancy:
        """The discrepancy that makes these residuals most likely, looked for about this one; `thorough`: anywhere."""
        s, tau = self.s.copy(), self.tau.copy()
        for channel, mine in self.channel.items():
            s[channel], tau[channel] = _most_likely(residual, mine, s[channel], tau[channel], thorough)
        return Discrepancy(self.series, self.count, len(s), s, tau, self.channel)


def _most_likely(residual: np.ndarray, mine: _Channel, s: float, tau: float, thorough: bool) -> tuple[float, float]:
    if mine.shortest <= 0.0:
        return 0.0, 1.0
    size = math.sqrt(max(mine.square(residual) / mine.count, 1e-12))

    def costs(points: list[tuple[float, float]]) -> np.ndarray:
        log_s, log_tau = np.array(points).T
        return _nll_of_all(residual, mine.t, mine.first, mine.last, np.exp(2.0 * log_s), np.exp(log_tau))

    white = mine.square(residual)
    low, high = math.log(mine.shortest), math.log(mine.longest)
    starts = []
    if s > LEAST_SIZE and not thorough:
        starts = [(math.log(s), min(max(math.log(tau), low), high))]
        # Noise that is larger than declared is an optimum of its own, to which no slope leads from slow misfits.
        if size > 1.0 + LEAST_SIZE:
            starts.append((0.5 * math.log(size * size - 1.0), low))
    if not starts or thorough:
        top = math.log(max(size, 10 * LEAST_SIZE))
        starts += [(top - back, at) for at in np.linspace(low, high, COARSE_TAUS) for back in (0.0, 1.0)]
    values = costs(starts)
    k = int(np.argmin(values))
    at, best = starts[k], values[k]
    for step in PATTERN_STEPS if thorough or len(starts) > 2 else PATTERN_STEPS[1:]:
        for _ in range(4):
            trials = [
                (at[0] + ds, min(max(at[1] + dt, low), high))
                for ds, dt in ((-step, 0.0), (step, 0.0), (0.0, -step), (0.0, step))
            ]
            values = costs(trials)
            k = int(np.argmin(values))
            if not values[k] < best - 1e-9:
                break
            at, best = trials[k], values[k]
    if white <= best or at[0] < math.log(LEAST_SIZE):
        return 0.0, math.exp(at[1])
    return math.exp(at[0]), math.exp(at[1])
