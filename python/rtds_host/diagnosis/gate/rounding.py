"""The step to which a channel's values are rounded: decimals, significant digits, counts, counts over a time."""

from __future__ import annotations

import math

import numpy as np

from rtds_host.contract import Case
from rtds_host.diagnosis.thresholds import FEW_SHARE, MINOR_SHARE, in_a_row

# Numerical: samples that a step is looked for in, in stretches from so many places of a run.
SAMPLES, PLACES = 20_000, 20
# Numerical: how much of a step its values miss it by in the file's last digit.
LAST_DIGIT = 1e-3
# Numerical: parts of the gaps between levels that are tried as the step, and how many steps further a gap still tells
# it.
TRIED, FAR = (0.5, 0.25, 0.1, 0.02), 20.0
# Digits beyond which nobody rounds by hand: single precision holds them.
MOST_DIGITS = np.finfo(np.float32).precision
# So few values that fit a step to a tenth may do so by chance, as a fifth of all do.
FEWEST = math.ceil(in_a_row(2.0 * MINOR_SHARE))
# Share of the values that must fit a step: a handful may be glitches, or written by another hand.
FITTING = 1.0 - FEW_SHARE
# Numerical: how many times as far off as these a value may be that no logger wrote by mistake.
ROOM = 100.0
# Numerical: values that differ by less than this share of their scatter are one level, written by another division.
SAME_LEVEL = 1e-5


def _decimals(values: np.ndarray) -> float:
    """Largest power of ten of which the values are multiples, 0 if none with `MOST_DIGITS` digits of their spread."""
    size = float(np.max(np.abs(values)))
    if size == 0.0:
        return 0.0
    top = math.floor(math.log10(size))
    for exponent in range(top, top - MOST_DIGITS, -1):
        counts = values * 10.0**-exponent
        if np.mean(np.abs(counts - np.round(counts)) < LAST_DIGIT) >= FITTING:
            return 10.0**exponent
    return 0.0


def _digits(values: np.ndarray) -> float:
    """Root mean square step of values with few significant digits, 0 if they have many."""
    values = values[values != 0.0]
    if len(values) < FEWEST:
        return 0.0
    exponents = np.floor(np.log10(np.abs(values)))
    for digits in range(1, MOST_DIGITS + 1):
        steps = 10.0 ** (exponents - digits + 1)
        counts = values / steps
        if np.mean(np.abs(counts - np.round(counts)) < LAST_DIGIT) >= FITTING:
            return float(np.sqrt(np.mean(steps**2)))
    return 0.0


def _grid(values: np.ndarray, same: float = 0.0) -> float:
    """Step of an even grid on which the values lie (an encoder's counts in any unit), 0 if there is none.

    same : values that differ by less are one level.
    """
    levels = np.unique(values)
    gaps = np.diff(levels)
    apart = gaps[gaps > max(SAME_LEVEL * float(np.mean(np.abs(values - np.median(values)))), same)]
    if len(apart) < FEWEST:
        return _coarse(values, apart)
    # Values of one level differ in their last written digit.
    gaps = gaps[gaps > max(LAST_DIGIT * float(np.median(gaps)), same)]
    for quantile in TRIED:
        step = float(np.quantile(gaps, quantile))
        for _ in range(3):
            near = gaps < FAR * step
            counts = np.round(gaps[near] / step)
            if not counts.any():
                break
            step = float(counts @ gaps[near] / (counts @ counts))
        near = gaps < FAR * step
        if (
            near.sum() >= FEWEST
            and np.mean(np.abs(gaps[near] / step - np.round(gaps[near] / step)) < MINOR_SHARE) >= FITTING
        ):
            return step
    return 0.0


def _coarse(values: np.ndarray, apart: np.ndarray) -> float:
    """Step of values on few levels that lie so far apart, 0 if these are not met again and again, or on no even grid.

    A dozen counts a turn, read many times a second, make a speed of three or four levels: as few as they are, each is
    met often.
    """
    if not len(apart) or len(values) < FEWEST * (len(apart) + 1):
        return 0.0
    step = float(apart.min())
    return step if np.all(np.abs(apart / step - np.round(apart / step)) < MINOR_SHARE) else 0.0


def _near(values: np.ndarray) -> np.ndarray:
    """Which values (n,) are no further off the others than those that must fit a step, and some room, (n,)."""
    off = np.abs(values - np.median(values))
    moved = off[off > 0.0]
    return off <= ROOM * np.quantile(moved, FITTING, method="lower") if len(moved) else np.ones(len(values), bool)


def step_of(values: np.ndarray, t: np.ndarray | None = None) -> float:
    """Typical step that values (n,) show, in their unit; 0 where they show none.

    t : (n,) s; with it a speed is also tried as counts over the time since the sample before.
    """
    if len(values) < FEWEST or not np.ptp(values):
        return 0.0
    if len(values) > SAMPLES:
        # A stretch from each of some places: a stride would hide counts over a time.
        length = SAMPLES // PLACES
        starts = np.linspace(0, len(values) - length, PLACES).astype(int)
        rows = (starts[:, None] + np.arange(length)).ravel()
        values, t = values[rows], None if t is None else t[rows]
    # One glitch of ten million would make its own size the step of all others.
    near = _near(values)
    values, t = values[near], None if t is None else t[near]
    if not np.ptp(values):
        return 0.0
    step = max(_decimals(values), _digits(values), _grid(values))
    if t is not None:
        dt = np.diff(t)
        good = dt > 0
        typical = float(np.median(dt[good])) if good.any() else 0.0
        if typical > 0 and np.std(dt[good]) > LAST_DIGIT * typical:
            # Counts over a time are also written with so many decimals.
            step = max(step, _grid((values[1:] * dt)[good & (np.round(dt / typical) < 2)], step * typical) / typical)
    return step


def noise_of(step: float) -> float:
    """One standard deviation of what rounding to steps of this size adds to a sample."""
    return step / math.sqrt(12.0)


def effective_noise(case: Case) -> tuple[dict[str, float], dict[str, float]]:
    """Noise with rounding, channel -> standard deviation, and the step of each channel, channel -> step (SI).

    Channels whose noise the robot declares; over runs the mean square counts, weighted by samples.
    """
    noise, steps = {}, {}
    for channel in dict.fromkeys(c for log in case.runs for c in log.columns):
        declared = case.robot.noise(channel)
        if declared is None:
            continue
        squares = samples = 0.0
        for log in case.runs:
            if not log.has(channel):
                continue
            good = np.isfinite(log.columns[channel])
            if not np.ptp(log.columns[channel][good]):
                # A wheel that stands all the while shows no step, nor that there is none.
                continue
            speed = channel[0] == "w" and len(channel) == 3
            step = step_of(log.columns[channel][good], log.t[good] if speed else None)
            squares += step**2 * good.sum()
            samples += good.sum()
        if samples:
            steps[channel] = math.sqrt(squares / samples)
            noise[channel] = math.hypot(declared, noise_of(steps[channel]))
    return noise, steps
