"""Series on the rows of a log: windows, gaps, integrals, first-order responses."""

from __future__ import annotations

import numba
import numpy as np

from rtds_host.diagnosis.thresholds import CLEAR_RATIO


class Windows:
    """Removes each window's mean from a series, so that the window's start is free."""

    def __init__(self, t: np.ndarray, length_s: float):
        index = ((t - t[0]) / length_s).astype(int)
        self.starts = np.flatnonzero(np.diff(index, prepend=-1))
        self.counts = np.diff(np.append(self.starts, len(t)))

    def __call__(self, values: np.ndarray) -> np.ndarray:
        return values - np.repeat(np.add.reduceat(values, self.starts) / self.counts, self.counts)

    def whole(self, good: np.ndarray) -> np.ndarray:
        """Rows of windows in which every row is good."""
        return np.repeat(np.logical_and.reduceat(good, self.starts), self.counts)


def near(t: np.ndarray, good: np.ndarray) -> np.ndarray:
    """Rows with a sample close by: filling in over a longer hole would be invention."""
    at = t[good]
    if len(at) < 2:
        return np.zeros(len(t), bool)
    after = np.clip(np.searchsorted(at, t), 1, len(at) - 1)
    distance = np.minimum(np.abs(t - at[after - 1]), np.abs(at[after] - t))
    return distance <= CLEAR_RATIO * float(np.median(np.diff(at)))


@numba.njit(cache=True)
def first_order(drive, decay):
    out = np.zeros(len(drive))
    for j in range(len(decay)):
        out[j + 1] = decay[j] * out[j] + (1.0 - decay[j]) * drive[j + 1]
    return out


def filled(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    good = np.isfinite(values)
    return values if good.all() else np.interp(t, t[good], values[good])


def cumulated(rate: np.ndarray, dt: np.ndarray) -> np.ndarray:
    """Integral of values that hold over each interval: (n - 1,) -> (n,)."""
    return np.concatenate([[0.0], np.cumsum(rate * dt)])


def middles(values: np.ndarray) -> np.ndarray:
    return 0.5 * (values[1:] + values[:-1])


def relaxed(values: np.ndarray, dt: np.ndarray, tau: float) -> np.ndarray:
    """Mean over each interval of a speed that relaxes with `tau` towards where a held voltage drives it, (n - 1,).

    Between two rows of a log the command holds, so that the speed bends the more the longer the interval is
    against the mechanical time constant; the plain mean of the ends would be off by more than the noise.
    """
    part = dt / tau
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # 1 / x - 1 / (exp(x) - 1); of small x the difference of two large numbers.
        weight = np.where(part < 1e-3, 0.5 - part / 12.0, 1.0 / part - 1.0 / np.expm1(part))
    return weight * values[:-1] + (1.0 - weight) * values[1:]


def smooth(values: np.ndarray, half: int) -> np.ndarray:
    width = 2 * half + 1
    padded = np.concatenate([np.full(half, values[0]), values, np.full(half, values[-1])])
    total = np.concatenate([[0.0], np.cumsum(padded)])
    return (total[width:] - total[:-width]) / width
