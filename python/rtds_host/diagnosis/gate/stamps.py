"""Time stamps that are wrong: rows that come evenly get an even clock, and what is off for all that adds to each
sample's noise.

Rows that lie on a grid but for a scatter were either taken on the grid and stamped late or early, or taken when they
say. The robot knows: replayed at the grid's times it differs by D from itself at the stamps', and what was measured
differs by D, too, where the stamps are wrong, and by nothing along D where they are right.

Between two samples at a steady speed w an angle turns by w times the time that really passed, so that the stamps' step
less the angle's, over w, is the difference of two stamps' errors: adjacent ones have one stamp in common, with opposite
sign, and their covariance is minus the variance of a stamp (less the angle's own noise, which is in both alike).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rtds_host.contract import Case, RunLog
from rtds_host.diagnosis.gate.findings import Finding
from rtds_host.diagnosis.replay.model import Model, nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.thresholds import FEW_SHARE, FEWEST_SAMPLES, MAJORITY, MEAN_OF_NORMAL, MINOR_SHARE, SIGNIFICANT
from rtds_host.plant.schema import OUTPUT_INDEX

# Numerical: rows by which a grid's period is looked for first, and trials of it within the resolution of what is looked
# at.
FIRST_ROWS, TRIALS = 512, 4


def stamp_error(case: Case, noise: dict[str, float]) -> float:
    """Standard deviation of the stamps' errors, s; 0 where angles and speeds do not show any.

    noise : channel -> one standard deviation of a sample, SI.
    """
    found = [
        _variances(log, f"w_{s}", f"th_{s}", noise)
        for log in case.runs
        for s in case.robot.sides
        if log.has(f"w_{s}") and log.has(f"th_{s}") and f"th_{s}" in noise
    ]
    every = np.concatenate(found) if found else np.empty(0)
    if len(every) < FEWEST_SAMPLES:
        return 0.0
    mean, scatter = float(every.mean()), float(every.std()) / math.sqrt(len(every))
    return math.sqrt(mean) if mean > SIGNIFICANT * scatter > 0.0 else 0.0


def _variances(log: RunLog, speed: str, angle: str, noise: dict[str, float]) -> np.ndarray:
    """A stamp's variance by each pair of adjacent steady steps, (pairs,) s^2."""
    rows = np.flatnonzero(np.isfinite(log.columns[speed]) & np.isfinite(log.columns[angle]))
    t, w, th = log.t[rows], log.columns[speed][rows], log.columns[angle][rows]
    mean = 0.5 * (w[1:] + w[:-1])
    # At this speed the angle's noise is slight against a step.
    slowest = noise[angle] / MINOR_SHARE / float(np.median(np.diff(log.t)))
    steady = (np.abs(np.diff(w)) < MINOR_SHARE * np.abs(mean)) & (np.abs(mean) > slowest)
    safe = np.where(steady, mean, 1.0)
    off = np.diff(t) - np.diff(th) / safe
    pairs = steady[1:] & steady[:-1]
    return (-off[1:] * off[:-1] - (noise[angle] / safe[1:]) ** 2)[pairs]


def unsure(log: RunLog, stamps_s: float, noise: dict[str, float]) -> RunLog:
    """The run with what stamps that are off by `stamps_s` add to each sample's noise: as much as the channel changes in
    it.

    A current changes by jumps, at some instant between two samples: by all of one, as often as that instant lies
    between the sample and its stamp.
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


def even_times(t: np.ndarray, known_hz: float | None = None) -> np.ndarray | None:
    """Times (n,) s of the even grid that stamps scatter about; None where there is none, or no scatter worth the name.

    The period is where the stamps' phases agree best (Rayleigh); rows are numbered by an isotonic regression, since
    some may be missing and each comes after the one before.

    known_hz : the grid's rate where another run has told it.
    """
    if len(t) < FEWEST_SAMPLES:
        return None
    t = t - t[0]
    found = _grid(t, known_hz)
    if found is None:
        return None
    from scipy.optimize import isotonic_regression  # a tenth of a second, which few cases have to spend

    count = np.arange(len(t))
    place = found[0] * t + found[1]
    for _ in range(2):
        number = count + np.round(isotonic_regression(place - count).x)
        slope, start = np.polyfit(number, t, 1)
        place = (t - start) / slope
    off = t - start - slope * number
    deviation = float(off.std())
    if deviation < FEW_SHARE * slope or abs(float(np.mean(off[1:] * off[:-1]))) > MAJORITY * deviation**2:
        return None
    return t - off


def _grid(t: np.ndarray, known_hz: float | None) -> tuple[float, float] | None:
    """Rate, Hz, and phase, turns, that uneven stamps (n,) from 0 agree on beyond chance; None where they are even or
    agree on none.
    """
    step = float(np.median(np.diff(t)))
    steps = np.diff(t) / step
    if float(np.std(steps - np.round(steps))) < FEW_SHARE:
        return None
    rate, rows = known_hz or 1.0 / step, min(len(t), FIRST_ROWS)
    # A median of as many steps is as wrong as their scatter lets it be.
    width = 1.0 / float(t[rows - 1]) if known_hz else SIGNIFICANT / math.sqrt(rows) * rate
    while True:
        span = float(t[rows - 1])
        trials = rate + np.arange(-width, width, 1.0 / (TRIALS * span))
        means = np.array([np.mean(np.exp(-2j * np.pi * trial * t[:rows])) for trial in trials])
        best = int(np.argmax(np.abs(means)))
        # Of phases at random the mean's square is exponential, of mean 1 / rows, in each of the trials.
        if rows * abs(means[best]) ** 2 < 0.5 * SIGNIFICANT**2 + math.log(len(trials)):
            return None
        rate = float(trials[best])
        if rows == len(t):
            return rate, float(np.angle(means[best])) / (2.0 * np.pi)
        rows, width = min(len(t), 2 * rows), 1.0 / span


def evened(
    case: Case, noise: dict[str, float], lag_s: float = 0.0, model: Model | None = None
) -> tuple[Case, list[Finding]]:
    """The case at the times its answers show where rows come evenly and stamps scatter, and what is said of it.

    noise : channel -> one standard deviation of a sample, SI; lag_s : by which the robot answers later than the model,
    s; model : the robot as far as it is known, nominal without it.
    """
    model, regular = model or nominal_model(case.robot), [even_times(log.t) for log in case.runs]
    rates = [1.0 / float(np.median(np.diff(even))) for even in regular if even is not None]
    if rates:
        # One logger wrote all runs: what a short one does not show by itself the others tell.
        regular = [
            even_times(log.t, float(np.median(rates))) if even is None else even
            for log, even in zip(case.runs, regular)
        ]
    along = across = 0.0
    for log, even in zip(case.runs, regular):
        if even is None:
            continue
        replays = []
        for t in (log.t, log.t[0] + even):
            inputs = run_inputs(replace(log, t=t), case.robot)
            replays.append(replay_run(model, (inputs[0], inputs[1] + lag_s, *inputs[2:])))
        for channel, sigma in noise.items():
            # A pose has a clock of its own.
            if log.has(channel) and channel not in ("x", "y", "yaw"):
                rows = np.flatnonzero(np.isfinite(log.columns[channel]))
                given, moved = (out[rows, OUTPUT_INDEX[channel]] for out in replays)
                a, b = _share(log.columns[channel][rows] - given, moved - given, sigma)
                along, across = along + a, across + b
    # A replay that ran away is no number, and says nothing.
    if not along > max(MAJORITY * across, SIGNIFICANT * math.sqrt(across)):
        return case, []
    runs = tuple(log if even is None else replace(log, t=log.t[0] + even) for log, even in zip(case.runs, regular))
    moved_s = math.sqrt(float(np.mean(np.concatenate([(a.t - b.t) ** 2 for a, b in zip(runs, case.runs)]))))
    return replace(case, runs=runs), [
        Finding(
            "",
            "t",
            "even",
            "note",
            f"rows come evenly, but their time stamps scatter by {1e3 * moved_s:.2g} ms: the robot answers "
            "as on an even clock, which is used.",
        )
    ]


def _share(left: np.ndarray, moved: np.ndarray, sigma: float) -> tuple[float, float]:
    """Sums whose quotient is the share of `moved` (n,) in `left` (n,), and whose second is the inverse of its variance.

    Both are whitened by what a sample of `left` says of the next: what a model has wrong is slow, a scatter is not.
    """
    if len(left) < FEWEST_SAMPLES or not moved.any():
        return 0.0, 0.0
    left, moved = left - left.mean(), moved - moved.mean()
    kept = min(max(float(left[1:] @ left[:-1]) / max(float(left @ left), sigma**2), 0.0), 1.0)
    left, moved = np.diff(left) + (1.0 - kept) * left[:-1], np.diff(moved) + (1.0 - kept) * moved[:-1]
    variance = max(float(np.mean(left**2)), sigma**2)
    if variance == 0.0:
        return 0.0, 0.0
    return float(left @ moved) / variance, float(moved @ moved) / variance


def settled(case: Case, noise: dict[str, float]) -> tuple[Case, float, list[Finding]]:
    """The case with its stamps' errors in its samples' noise, their standard deviation in s, and what is said of it."""
    stamps_s = stamp_error(case, noise)
    if stamps_s == 0.0:
        return case, 0.0, []
    told = Finding(
        "",
        "t",
        "stamps",
        "note",
        f"time stamps are off by {1e3 * stamps_s:.2g} ms (one standard deviation: the angles turn as if the rows were "
        "spaced otherwise): samples where a channel changes fast count less.",
    )
    return replace(case, runs=tuple(unsure(log, stamps_s, noise) for log in case.runs)), stamps_s, [told]
