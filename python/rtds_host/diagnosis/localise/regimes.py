"""Regimes of motion: which rows of a run are slow, reversing, uphill, turning, late in the run."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from rtds_host.contract import RunMeta
from rtds_host.diagnosis.localise.series import smooth
from rtds_host.diagnosis.thresholds import CLEAR_RATIO, MINOR_SHARE

# Layout: what counts as a reversal, to either side of it, s; as steep, rad; as turning at all, rad/s.
REVERSES_S, CLIMBS, TURNS = 0.1, 0.02, 0.05


@dataclass(frozen=True)
class Motion:
    """How a machine moved, on n rows: t (n,) s; w, wheel speeds a side, (n,) rad/s each; heading (n,) rad and yaw_rate
    (n,) rad/s, None for an axis."""

    t: np.ndarray
    w: list[np.ndarray]
    heading: np.ndarray | None = None
    yaw_rate: np.ndarray | None = None


def regimes(motion: Motion, meta: RunMeta, slope_rad: float, half: int) -> dict[str, np.ndarray]:
    """Regime -> which rows are in it, (n,) bool. `half`: rows on each side that speeds are averaged over."""
    t = motion.t
    slow = [smooth(w, half) for w in motion.w]
    speed = np.nanmean(np.abs(slow), axis=0)
    top = float(np.nanmax(speed, initial=0.0))
    forward = np.nanmean(slow, axis=0)
    result = {"slow": CLEAR_RATIO * speed < top, "fast": CLEAR_RATIO * speed >= top}
    turned = np.zeros(len(t), bool)
    for w in motion.w:
        sign = np.sign(np.where(np.abs(w) > MINOR_SHARE * max(top, 1e-9), w, 0.0))
        kept = np.flatnonzero(sign)
        for a, b in itertools.pairwise(kept):
            if sign[a] != sign[b]:
                turned |= (t > t[a] - REVERSES_S) & (t < t[b] + REVERSES_S)
    result["reversal"] = turned
    gain = np.gradient(speed, t) if len(t) > 2 else np.zeros(len(t))
    result["speeding up"], result["slowing down"] = CLEAR_RATIO * gain > top, CLEAR_RATIO * gain < -top
    result["forwards"], result["backwards"] = forward > MINOR_SHARE * top, forward < -MINOR_SHARE * top
    if motion.heading is not None and motion.yaw_rate is not None:
        climb = np.sin(slope_rad) * np.cos(motion.heading - meta.uphill_yaw_rad) * np.sign(forward)
        result["uphill"], result["downhill"] = climb > CLIMBS, climb < -CLIMBS
        result["level"] = np.abs(climb) <= CLIMBS
        turn = smooth(motion.yaw_rate, half)
        fast = float(np.nanmax(np.abs(turn), initial=0.0))
        least = max(MINOR_SHARE * fast, TURNS)
        result["straight"] = np.abs(turn) < least
        result["turning left"], result["turning right"] = turn >= least, turn <= -least
    result["with payload"] = np.full(len(t), meta.payload_kg > 0)
    result["without payload"] = ~result["with payload"]
    middle = 0.5 * (t[0] + t[-1])
    result["first half"], result["second half"] = t < middle, t >= middle
    return result
