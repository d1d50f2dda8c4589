"""Where a torque ripple would be: periodograms of the residuals over the wheel's angle.

The number of cycles a turn has no useful derivative until it is nearly right, so it is read off a spectrum first: power
over the measured (or replayed) angle, sorted into bins of it, which needs no even sampling. Runs of many turns have
narrow peaks; the transform is as fine as they are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.thresholds import FEW_SHARE, FEWEST_SAMPLES
from rtds_host.plant.schema import OUTPUT_INDEX

# Physical: most cycles a turn that are looked for: the cogging of a geared motor.
MOST_CYCLES = 400.0
# Numerical: bins a cycle at the most cycles, lines a peak's width, longest transform.
BINS, LINES, LONGEST = 6, 4, 2**21
# Numerical: cycles about a peak that belong to it, and the power that a peak needs for a fit to be started there, in
# that of white noise; the fit decides.
PEAK_CYCLES, LEAST_POWER = 1.0, 8.0
# Physical: what is periodic was the same in another period.
FEWEST_PERIODS = 2.0
# Numerical: how far off a found ripple neighbours are tried, in cycles a turn and in phase, rad.
NEIGHBOURS, PHASES = (-0.08, -0.05, -0.03, -0.02, -0.01, 0.0, 0.01, 0.02, 0.03, 0.05, 0.08), (-0.5, 0.0, 0.5)


@dataclass(frozen=True)
class Spectrum:
    """Power (n,), in units of white noise's mean, over cycles a turn (n,)."""

    cycles: np.ndarray
    power: np.ndarray


def comes_back(problem: Problem, side: str, cycles: float) -> bool:
    """Whether runs show that a ripple comes back. Over fewer periods it can be any function of the angle."""
    sides = problem.robot.sides if side == "both" else (side[0],)
    return cycles * max(problem.turns[one] for one in sides) >= FEWEST_PERIODS


def _channels(problem: Problem, suffix: str) -> list[str]:
    """Channels in which a side's ripple shows: its speed and current, else what the body makes of them."""
    there = [
        c
        for c in (f"w_{suffix}", f"i_{suffix}", "gyro_z")
        if problem.robot.noise(c) is not None and any(data.log.has(c) for data in problem.runs)
    ]
    return [c for c in there if c != "gyro_z"] or there


def _series(problem: Problem, outs: list[np.ndarray], suffix: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Of each channel that shows a side's ripple: the wheel's angles (n,), rad, of all runs, and the residuals there
    (n,).
    """
    result = []
    for channel in _channels(problem, suffix):
        angles, values = [], []
        for data, out in zip(problem.runs, outs):
            log = data.log
            if not log.has(channel):
                continue
            good = np.isfinite(log.columns[channel])
            th = log.columns.get(f"th_{suffix}")
            angle = out[:, OUTPUT_INDEX[f"th_{suffix}"]]
            if th is not None and np.isfinite(th).sum() > 0.5 * good.sum():
                known = np.isfinite(th)
                angle = np.interp(log.t, log.t[known], th[known])
            error = (out[:, OUTPUT_INDEX[channel]] - log.columns[channel]) / problem.robot.noise(channel)
            speed = np.abs(out[:, OUTPUT_INDEX[f"w_{suffix}"]])
            moving = good & (speed > FEW_SHARE * speed.max())
            if moving.sum() > FEWEST_SAMPLES:
                angles.append(angle[moving])
                values.append(error[moving] - error[moving].mean())
        if angles:
            result.append((np.concatenate(angles), np.concatenate(values)))
    return result


def spectra(problem: Problem, outs: list[np.ndarray]) -> dict[str, Spectrum]:
    """Spectra of the residuals by side ("left", "right", "both")."""
    sides = {
        name: _series(problem, outs, "lr"[k]) for k, name in enumerate(("left", "right")[: len(problem.robot.sides)])
    }
    angles = [angle for series in sides.values() for angle, _ in series]
    if not angles:
        return {}
    low = min(float(angle.min()) for angle in angles)
    span = max(float(angle.max()) for angle in angles) - low
    # A turn at least: of less, the number of cycles means nothing.
    span = max(span, 2.0 * math.pi)
    count = min(2 ** math.ceil(math.log2(LINES * span / (2.0 * math.pi) * BINS * MOST_CYCLES)), LONGEST)
    width = LINES * span / count
    cycles = 2.0 * math.pi / (count * width) * np.arange(count // 2 + 1)
    # What comes less than once a turn is none of the wheel's.
    shown = (cycles >= 1.0) & (cycles <= MOST_CYCLES)
    if not shown.any():
        # So many turns that the longest transform does not come to one cycle of them.
        return {}
    result = {}
    for name, series in sides.items():
        powers = [_power(angle - low, value, width, count)[shown] for angle, value in series]
        if powers:
            result[name] = Spectrum(cycles[shown], np.mean(powers, axis=0))
    if len(result) == 2:
        result["both"] = Spectrum(cycles[shown], 0.5 * (result["left"].power + result["right"].power))
    return result


def _power(angle: np.ndarray, value: np.ndarray, width: float, count: int) -> np.ndarray:
    """Power of values (n,) at angles (n,) from 0, rad, in bins of a width, over the lines of a transform of `count`
    bins.
    """
    scale = float(np.sqrt(np.mean(value**2))) or 1.0
    binned = np.bincount((angle / width).astype(int), value / scale, minlength=count)[:count]
    return np.abs(np.fft.rfft(binned)) ** 2 / len(value)


def turned(outs: list[np.ndarray], side: str) -> float:
    """Mean angle of a side's wheel over the samples of all runs, rad."""
    columns = [OUTPUT_INDEX[f"th_{suffix}"] for suffix in "lr" if side in ("both", {"l": "left", "r": "right"}[suffix])]
    return float(np.concatenate([out[:, columns].ravel() for out in outs]).mean())


def neighbours(values: dict[str, float], angle: float) -> list[dict[str, float]]:
    """Ripples close by whose misfit may be lower beyond a rise.

    Over a run a wrong number of cycles drifts out of step, and in again: the misfit has a minimum at each. The number
    is moved with the phase that keeps step at `angle` rad, the middle of the runs. Poles and teeth of what turns with
    the wheel come in whole numbers.
    """
    _, cycles, phase = list(values)[:3]  # names of a periodic effect's first parameters
    whole = round(values[cycles]) - values[cycles]
    return [
        {
            **values,
            cycles: values[cycles] + off,
            phase: math.remainder(values[phase] - off * angle + shift, 2 * math.pi),
        }
        for off in (*NEIGHBOURS, whole)
        for shift in PHASES
        if off or shift
    ]


def starts(
    problem: Problem, outs: list[np.ndarray], effects: Iterable[str], peaks: int = 2
) -> dict[tuple[str, str], list[dict]]:
    """Parameter sets of periodic effects for the screening, by (effect, side): each peak, with two phases."""
    found: dict[str, set[float]] = {"left": set(), "right": set()}
    lines = spectra(problem, outs)
    for name, spectrum in lines.items():
        power = spectrum.power.copy()
        for _ in range(peaks):
            k = int(np.argmax(power))
            if power[k] < LEAST_POWER:
                break
            for side in ("left", "right") if name == "both" else (name,):
                found[side].add(float(spectrum.cycles[k]))
            power[np.abs(spectrum.cycles - spectrum.cycles[k]) <= PEAK_CYCLES] = 0.0
    if "right" in lines:
        shared = found["left"] | found["right"]
        found = {"left": shared, "right": shared}
    sets: dict[tuple[str, str], list[dict]] = {}
    for effect in effects:
        amplitude, turns, phase, *harmonics = problem.effects[effect].parameters
        pure = {p.name: p.null for p in harmonics}
        sets |= {
            (effect, side): [
                {amplitude.name: amplitude.starts[0], turns.name: n, phase.name: at, **pure}
                for n in sorted(cycles)
                for at in (0.0, np.pi / 2)
            ]
            for side, cycles in found.items()
            if side in lines
        }
    return sets
