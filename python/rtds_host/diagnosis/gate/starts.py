"""What a log holds before its sensors are awake: first angles and poses that the robot cannot leave so fast."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rtds_host.contract import Case, RunLog
from rtds_host.contract.clock import moment
from rtds_host.diagnosis.gate.findings import Finding, percent
from rtds_host.diagnosis.gate.limits import ROOM, Limits, channels, kind_of
from rtds_host.diagnosis.gate.sensors import without
from rtds_host.diagnosis.thresholds import CLEAR_RATIO, FEWEST_SAMPLES, SIGNIFICANT, few


def awake(case: Case, bounds: Limits) -> tuple[Case, list[Finding]]:
    """The case without first samples that are no measurement, and what is said of them.

    A counter that was not reset yet, a node's buffer and a lost frame stand in the first rows, often the same in each.
    An angle or a pose then jumps by more than the robot can move, once, and goes on from there.
    """
    runs, found = [], []
    for log in case.runs:
        aside = {}
        for c in channels(case.robot):
            if not log.has(c):
                continue
            rows = _asleep(log, c, bounds, case.robot.noise(c) or 0.0)
            if len(rows):
                aside[c] = rows
                n, of = len(rows), int(np.isfinite(log.columns[c]).sum())
                found.append(
                    Finding(
                        log.name,
                        c,
                        "start",
                        "warning",
                        f"the first {'sample' if n == 1 else f'{n} samples'} of {c}, until t = "
                        f"{moment(log.t[rows[-1]])} s, cannot be: set aside ({percent(n / of)}).",
                        n / of,
                    )
                )
        runs.append(without(log, aside))
    return replace(case, runs=tuple(runs)), found


def _asleep(log: RunLog, c: str, bounds: Limits, noise: float) -> np.ndarray:
    """Rows (k,) of a channel's first samples, a handful at most, that what follows shows to be none."""
    rows = np.flatnonzero(np.isfinite(log.columns[c]))
    if len(rows) < FEWEST_SAMPLES:
        return rows[:0]
    v, t = log.columns[c][rows], log.t[rows]
    most = int(max(few(len(rows)), SIGNIFICANT))
    if c in bounds.values:
        wrong = np.abs(v) > bounds.values[c]
        # Isolated samples further on are glitches, and a channel that goes on so is in another unit.
        last = int(np.argmin(wrong)) - 1 if not wrong[most : 2 * most].any() else -1
    elif kind_of(c) in ("th", "x", "y", "yaw"):
        step = np.abs(np.diff(v))
        reach = _reach(log, c, bounds) * np.diff(t) + SIGNIFICANT * noise
        usual = float(np.max(step[most:], initial=0.0))
        last = _last((step > reach) & (step > CLEAR_RATIO * usual) & (np.arange(len(step)) < most))
        # A single sample, far off and back, is a glitch in whatever row it is.
        if last > 0 and abs(v[last + 1] - v[last - 1]) <= reach[last] + reach[last - 1]:
            last = -1
    else:
        last = -1
    return rows[: last + 1]


def _last(where: np.ndarray) -> int:
    """The last of (n,) that is so, -1 where none is."""
    at = np.flatnonzero(where)
    return int(at[-1]) if at.size else -1


def _reach(log: RunLog, c: str, bounds: Limits) -> float:
    """How fast an angle or a pose can change at most, SI a second: as the file bounds it, else as its speed shows."""
    if np.isfinite(bounds.rates.get(c, np.inf)):
        return bounds.rates[c]
    speed = log.columns.get({"yaw": "gyro_z"}.get(c, f"w_{c[-1]}"))
    if speed is None or not np.isfinite(speed).any():
        return 0.0
    return ROOM * float(np.nanmax(np.abs(speed)))
