"""Runs cut at holes: the part after a hole becomes a run of its own, from the state measured there."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np

from rtds_host.contract import Case, RunLog
from rtds_host.contract.clock import moment
from rtds_host.diagnosis.gate.findings import Finding, percent
from rtds_host.diagnosis.gate.timing import hole_s, shorter_than_any
from rtds_host.diagnosis.replay.model import START_ROWS
from rtds_host.diagnosis.thresholds import SIGNIFICANT, few

# A sample and those to either side that a start, and what a glitch is, are judged by.
FEWEST_ROWS = 2 * START_ROWS + 1


def start_row(log: RunLog, case: Case, rows: np.ndarray) -> int | None:
    """First of `rows` at which a replay can start: every wheel's speed measured, or the robot at rest; else None.

    Without a measured speed a replay starts at rest (contract, section 2).
    """
    speeds = [f"w_{s}" for s in case.robot.sides]
    if all(log.has(c) for c in speeds):
        good = np.all([np.isfinite(log.columns[c][rows]) for c in speeds], axis=0)
        # Later than half the part would not be worth the name.
        at = np.flatnonzero(good)
        return int(rows[at[0]]) if at.size and at[0] < len(rows) / 2 else None
    angles = [f"th_{s}" for s in case.robot.sides if log.has(f"th_{s}")]
    for c in angles:
        v = log.columns[c][rows]
        v = v[np.isfinite(v)][:FEWEST_ROWS]
        if len(v) < FEWEST_ROWS or np.ptp(v) > math.sqrt(2.0) * SIGNIFICANT * (case.robot.noise(c) or 0.0):
            return None
    return int(rows[0]) if angles else None


def _long_enough(log: RunLog, first: int, last: int) -> bool:
    return last - first >= FEWEST_ROWS and not shorter_than_any(log.t[first:last])


def cut(case: Case) -> tuple[tuple[RunLog, ...], list[Finding]]:
    """Runs of a case, cut at their holes, and what is said of it."""
    runs, found = [], []
    for log in case.runs:
        parts, told = _cut(log, case)
        runs += parts
        found += told
    return tuple(runs), found


def _cut(log: RunLog, case: Case) -> tuple[list[RunLog], list[Finding]]:
    dt = np.diff(log.t)
    holes = np.flatnonzero(dt > hole_s(log.t))
    if not holes.size:
        return [log], []
    worst = int(holes[np.argmax(dt[holes])])
    one = holes.size == 1
    text = (
        f"{'a hole' if one else f'{holes.size} holes'} without a row, {'' if one else 'the longest '}"
        f"{dt[worst]:.3g} s at t = {moment(log.t[worst])} s"
    )
    missing = float(dt[holes].sum() / (log.t[-1] - log.t[0]))
    if holes.size > few(len(log.t)):
        return [log], [
            Finding(
                log.name,
                "t",
                "gap",
                "warning",
                f"{text}: too many to cut the run at ({percent(missing)} of its time); the last command "
                "is taken to hold in each.",
                missing,
            )
        ]
    bounds = np.concatenate([[0], holes + 1, [len(log.t)]])
    starts: list[tuple[int, int] | None] = []
    for k, (a, b) in enumerate(itertools.pairwise(bounds)):
        first = int(a) if k == 0 else start_row(log, case, np.arange(a, b))
        if first is None or not _long_enough(log, first, int(b)):
            starts.append(None)
        else:
            starts.append((first, int(b)))
    kept = [s for s in starts if s is not None]
    unstarted = [
        k for k in range(1, len(starts)) if starts[k] is None and _long_enough(log, int(bounds[k]), int(bounds[k + 1]))
    ]
    if not kept:
        return [log], [Finding(log.name, "t", "gap", "warning", f"{text}: no part of it is long enough.", missing)]
    if unstarted:
        # A part that cannot start on its own is lost, whatever its length: its state is not known.
        ends = "" if len(kept) > 1 else ", the first part is kept"
        text += f"; without a measured speed a run cannot start moving{ends}"
    lost = len(log.t) - sum(b - a for a, b in kept)
    text += f": cut there into {len(kept)} run(s)" + (
        f", {percent(lost / len(log.t))} of the rows left out" if lost else ""
    )
    parts = [
        replace(
            log.rows(a, b), name=log.name if k == 0 else f"{log.name} ({k + 1})", since_s=float(log.t[a] - log.t[0])
        )
        for k, (a, b) in enumerate(kept)
    ]
    return parts, [Finding(log.name, "t", "gap", "warning", f"{text}.", lost / len(log.t))]
