"""Time stamps that are wrong: how far off they are, and what that adds to each sample's noise.

Between two samples at a steady speed w an angle turns by w times the time that really passed, so that the stamps' step less
the angle's, over w, is the difference of two stamps' errors: adjacent ones have one stamp in common, with opposite sign,
and their covariance is minus the variance of a stamp (less the angle's own noise, which stands in them alike).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rtds_host.contract import Case, RunLog
from rtds_host.diagnosis.chance import FEWEST, MEAN_OF_NORMAL, MOVES, SLIGHT
from rtds_host.diagnosis.gate.findings import Finding


def stamp_error(case: Case, noise: dict[str, float]) -> float:
    """Standard deviation of the stamps' errors, s; 0 where angles and speeds do not show any.

    noise : channel -> one standard deviation of a sample, SI.
    """
    found = [_variances(log, f"w_{s}", f"th_{s}", noise) for log in case.runs for s in case.robot.sides
             if log.has(f"w_{s}") and log.has(f"th_{s}") and f"th_{s}" in noise]
    every = np.concatenate(found) if found else np.empty(0)
    if len(every) < FEWEST:
        return 0.0
    mean, scatter = float(every.mean()), float(every.std()) / math.sqrt(len(every))
    return math.sqrt(mean) if mean > MOVES * scatter > 0.0 else 0.0


def _variances(log: RunLog, speed: str, angle: str, noise: dict[str, float]) -> np.ndarray:
    """A stamp's variance by each pair of adjacent steady steps, (pairs,) s^2."""
    rows = np.flatnonzero(np.isfinite(log.columns[speed]) & np.isfinite(log.columns[angle]))
    t, w, th = log.t[rows], log.columns[speed][rows], log.columns[angle][rows]
    mean = 0.5 * (w[1:] + w[:-1])
    # At this speed the angle's noise is slight beside a step.
    slowest = noise[angle] / SLIGHT / float(np.median(np.diff(log.t)))
    steady = (np.abs(np.diff(w)) < SLIGHT * np.abs(mean)) & (np.abs(mean) > slowest)
    safe = np.where(steady, mean, 1.0)
    off = np.diff(t) - np.diff(th) / safe
    pairs = steady[1:] & steady[:-1]
    return (-off[1:] * off[:-1] - (noise[angle] / safe[1:]) ** 2)[pairs]


def unsure(log: RunLog, stamps_s: float, noise: dict[str, float]) -> RunLog:
    """The run with what stamps that are off by `stamps_s` add to each sample's noise: as much as the channel changes in it.

    A current changes by jumps, at some instant between two samples: by all of one, as often as that instant lies between
    the sample and its stamp.
    """
    found = {}
    for channel, sigma in noise.items():
        if not log.has(channel):
            continue
        rows = np.flatnonzero(np.isfinite(log.columns[channel]))
        if len(rows) < 2:
            continue
        dt = np.diff(log.t[rows])
        dt = np.maximum(dt, 0.5 * float(np.median(dt)))
        share = stamps_s / dt
        if channel.startswith("i_"):
            share = np.sqrt(np.minimum(share * MEAN_OF_NORMAL, 1.0))
        squares = share**2 * np.maximum(np.diff(log.columns[channel][rows]) ** 2 - 2.0 * sigma**2, 0.0)
        added = np.zeros(len(log.t))
        added[rows] = np.sqrt(0.5 * (np.append(squares, squares[-1]) + np.append(squares[0], squares)))
        found[channel] = added
    return replace(log, unsure=found)


def settled(case: Case, noise: dict[str, float]) -> tuple[Case, float, list[Finding]]:
    """The case with its stamps' errors in its samples' noise, their standard deviation in s, and what is said of it."""
    stamps_s = stamp_error(case, noise)
    if stamps_s == 0.0:
        return case, 0.0, []
    told = Finding("", "t", "stamps", "note",
                   f"time stamps are off by {1e3 * stamps_s:.2g} ms (one standard deviation: the angles turn as if the rows were "
                   "spaced otherwise): samples where a channel changes fast count less.")
    return replace(case, runs=tuple(unsure(log, stamps_s, noise) for log in case.runs)), stamps_s, [told]
