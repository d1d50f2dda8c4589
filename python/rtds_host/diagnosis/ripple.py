"""Where a torque ripple would be: periodograms of the residuals over the wheel's angle.

The number of cycles a turn has no useful derivative until it is nearly right, so it is read off a spectrum first:
least-squares power over the measured (or replayed) angle, which needs no even sampling and knows no Nyquist limit.
"""

from __future__ import annotations

import math

import numpy as np

from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.slots import OUTPUT_INDEX

CYCLES_STEP = 0.25
CYCLES = np.arange(1.0, 400.0, CYCLES_STEP)
SAMPLES = 3000


def _channels(problem: Problem, suffix: str) -> list[str]:
    """Channels in which a side's ripple shows: its speed and current, else what the body makes of them."""
    there = [c for c in (f"w_{suffix}", f"i_{suffix}", "gyro_z")
             if problem.robot.noise(c) is not None and any(data.log.has(c) for data in problem.runs)]
    return [c for c in there if c != "gyro_z"] or there


def spectra(problem: Problem, outs: list[np.ndarray]) -> dict[str, np.ndarray]:
    """Power over `CYCLES` by side ("left", "right", "both"), in units of white noise's mean."""
    result = {}
    for k, name in enumerate(("left", "right")[:len(problem.robot.sides)]):
        suffix = "lr"[k]
        total = np.zeros(len(CYCLES))
        count = 0
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
                moving = good & (np.abs(out[:, OUTPUT_INDEX[f"w_{suffix}"]]) > 0.1)
                if moving.sum() > 20:
                    angles.append(angle[moving])
                    values.append(error[moving] - error[moving].mean())
            if not angles:
                continue
            angle, value = np.concatenate(angles), np.concatenate(values)
            stride = max(1, len(angle) // SAMPLES)
            angle, value = angle[::stride], value[::stride]
            scale = np.sqrt(np.mean(value**2)) or 1.0
            # e^{i n angle} for evenly spaced n by repeated rotation.
            turn = np.exp(-1j * CYCLES_STEP * angle)
            phase = np.exp(-1j * CYCLES[0] * angle) * (value / scale) / np.sqrt(len(value))
            line = np.empty(len(CYCLES), complex)
            for n in range(len(CYCLES)):
                line[n] = phase.sum()
                phase *= turn
            total += np.abs(line) ** 2
            count += 1
        if count:
            result[name] = total / count
    if len(result) == 2:
        result["both"] = 0.5 * (result["left"] + result["right"])
    return result


def turned(outs: list[np.ndarray], side: str) -> float:
    """Mean angle of a side's wheel over the samples of all runs, rad."""
    columns = [OUTPUT_INDEX[f"th_{suffix}"] for suffix in "lr" if side in ("both", {"l": "left", "r": "right"}[suffix])]
    return float(np.concatenate([out[:, columns].ravel() for out in outs]).mean())


def neighbours(values: dict[str, float], angle: float) -> list[dict[str, float]]:
    """Ripples close by whose misfit may be lower beyond a rise.

    Over a run a wrong number of cycles drifts out of step, and in again: the misfit has a minimum at each. The number is
    moved with the phase that keeps step at `angle` rad, the middle of the runs.
    """
    return [{**values, "cycles_per_rev": values["cycles_per_rev"] + off,
             "phase_rad": math.remainder(values["phase_rad"] - off * angle + shift, 2 * math.pi)}
            for off in (-0.08, -0.05, -0.03, -0.02, -0.01, 0.0, 0.01, 0.02, 0.03, 0.05, 0.08)
            for shift in (-0.5, 0.0, 0.5) if off or shift]


def starts(problem: Problem, outs: list[np.ndarray], peaks: int = 2) -> dict[tuple[str, str], list[dict]]:
    """Parameter sets for the screening, by (effect, side): each peak with two phases."""
    powers = spectra(problem, outs)
    found: dict[str, set[float]] = {"left": set(), "right": set()}
    for name, power in powers.items():
        power = power.copy()
        for _ in range(peaks):
            k = int(np.argmax(power))
            if power[k] < 8.0:
                break
            for side in ("left", "right") if name == "both" else (name,):
                found[side].add(float(CYCLES[k]))
            power[max(0, k - 4):k + 5] = 0.0
    if "right" in powers:
        shared = found["left"] | found["right"]
        found = {"left": shared, "right": shared}
    size = problem.effects["torque_ripple"].parameters[0].starts[0]
    return {("torque_ripple", side): [{"amplitude_nm": size, "cycles_per_rev": n, "phase_rad": phase}
                                      for n in sorted(cycles) for phase in (0.0, np.pi / 2)]
            for side, cycles in found.items() if side in powers}
