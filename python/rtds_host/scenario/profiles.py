"""Shapes that manoeuvres are put together from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

# A value that changes at a multiple of the period must have changed when it is read there, whatever the rounding.
EDGE_S = 1e-9


def staircase(t: np.ndarray, segments: Sequence[tuple[float, float, float]]) -> np.ndarray:
    """Constant pieces, one after the other, the last one for ever.

    segments : (seconds, left, right). Returns (n, 2).
    """
    ends = np.cumsum([segment[0] for segment in segments])
    levels = np.array([segment[1:] for segment in segments], dtype=float)
    return levels[np.minimum(np.searchsorted(ends, t + EDGE_S, side="right"), len(levels) - 1)]


def length_s(segments: Sequence[tuple[float, ...]]) -> float:
    """Sum of the pieces' lengths, s."""
    return float(sum(segment[0] for segment in segments))


def ramped(t: np.ndarray, segments: Sequence[tuple[float, float, float]], ramp_s: float) -> np.ndarray:
    """As `staircase`, but from zero, back to zero, and from one level to the next in a straight ramp.

    Each piece starts with its ramp; a last ramp to zero is added. Returns (n, 2).
    """
    times, levels, now = [0.0], [(0.0, 0.0)], 0.0
    for seconds, left, right in segments:
        times += [now + ramp_s, now + seconds]
        levels += [(left, right), (left, right)]
        now += seconds
    times.append(now + ramp_s)
    levels.append((0.0, 0.0))
    table = np.array(levels)
    return np.column_stack([np.interp(t, times, table[:, 0]), np.interp(t, times, table[:, 1])])


def triangle(t: np.ndarray, period_s: float) -> np.ndarray:
    """A triangle wave, 0 at t = 0, rising, between -1 and 1 (n,)."""
    phase = np.mod(t / period_s, 1.0)
    return np.where(phase < 0.25, 4.0 * phase, np.where(phase < 0.75, 2.0 - 4.0 * phase, 4.0 * phase - 4.0))
