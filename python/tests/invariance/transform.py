"""Transformations of a case in memory: what a logger, a clock, a frame or a name may change of one and the same
drive.
"""

from __future__ import annotations

import math
import tempfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rtds_host.contract import Case, RunLog, read_run, write_run
from rtds_host.contract.runlog import MEASURED

SECONDS_SINCE_1970 = 1_700_000_000.0
TURN_RAD, SHIFT_M = 1.1, (12.5, -7.25)
JITTER_S, SKEW_S = 1e-3, 5e-3
# A glitch: so many times the noise beyond the way that the channel goes in its run.
GLITCH_NOISES = 100.0
MISSING_SHARE = 0.15
MIRROR = {"left": "right", "right": "left", "both": "both"}


@dataclass(frozen=True)
class Transformation:
    """A change of a case; `same`: the answer must stay (else only less may be said, nothing else); `mirrored`: sides
    change; `noisier`: samples get other noise than they had.

    `apply` gives None where a case has nothing to change (no such channel).
    """

    name: str
    apply: Callable[[Case], Case | None]
    same: bool = True
    mirrored: bool = False
    noisier: bool = False


def _each(case: Case, change: Callable[[RunLog], RunLog]) -> Case:
    return replace(case, runs=tuple(change(log) for log in case.runs))


def _measured(log: RunLog) -> list[str]:
    return [c for c in MEASURED if log.has(c)]


def _rng(log: RunLog, what: str) -> np.random.Generator:
    return np.random.default_rng(zlib.crc32(f"{what} {len(log.t)} {log.t[-1] - log.t[0]:.6f}".encode()))


def later(case: Case, seconds: float) -> Case:
    """The same runs on a clock that began elsewhere."""
    return _each(case, lambda log: replace(log, t=log.t + seconds))


def turned(case: Case) -> Case | None:
    """The world turned and shifted under the tracking system. On a slope only where the heading is known."""
    if not all(log.has("yaw") or log.meta.slope_rad == 0.0 for log in case.runs):
        return None
    if not any(log.has(c) for log in case.runs for c in ("x", "yaw")):
        return None
    c, s = math.cos(TURN_RAD), math.sin(TURN_RAD)

    def change(log: RunLog) -> RunLog:
        columns = dict(log.columns)
        if log.has("x") and log.has("y"):
            x, y = log.columns["x"], log.columns["y"]
            columns.update(x=SHIFT_M[0] + c * x - s * y, y=SHIFT_M[1] + s * x + c * y)
        if log.has("yaw"):
            columns["yaw"] = log.columns["yaw"] + TURN_RAD
        return replace(log, columns=columns, meta=replace(log.meta, uphill_yaw_rad=log.meta.uphill_yaw_rad + TURN_RAD))

    return _each(case, change)


def mirrored(case: Case) -> Case | None:
    """The robot seen in a mirror: left is right, yaw and y change their sign."""
    if case.robot.chassis is None:
        return None

    def change(log: RunLog) -> RunLog:
        columns = {}
        for name, values in log.columns.items():
            other = name[:-1] + {"l": "r", "r": "l"}[name[-1]] if name[-2:] in ("_l", "_r") else name
            columns[other] = -values if name in ("gyro_z", "y", "yaw") else values
        return replace(log, columns=columns, meta=replace(log.meta, uphill_yaw_rad=-log.meta.uphill_yaw_rad))

    body = replace(case.robot.chassis, com_y_m=-case.robot.chassis.com_y_m)
    return replace(_each(case, change), robot=replace(case.robot, chassis=body))


def renamed(case: Case) -> Case:
    """Runs in another order under other names."""
    return replace(
        case, name="another", runs=tuple(replace(log, name=f"drive-{k}") for k, log in enumerate(reversed(case.runs)))
    )


def stored(case: Case, form: str) -> Case:
    """Written and read again."""
    with tempfile.TemporaryDirectory() as scratch:

        def change(log: RunLog) -> RunLog:
            folder = Path(scratch) / log.name
            write_run(folder, log.meta, {"t": log.t, **log.columns}, form)
            return replace(read_run(folder, case.robot), name=log.name)

        return _each(case, change)


def decimals(case: Case, count: int) -> Case:
    """Every value but the time rounded to so many decimals."""
    return _each(case, lambda log: replace(log, columns={c: np.round(v, count) for c, v in log.columns.items()}))


def digits(case: Case, count: int) -> Case:
    """Every value but the time rounded to so many significant digits."""

    def change(v: np.ndarray) -> np.ndarray:
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = 10.0 ** (np.floor(np.log10(np.abs(v))) - count + 1)
        return np.where((v == 0) | ~np.isfinite(v), v, np.round(v / steps) * steps)

    return _each(case, lambda log: replace(log, columns={c: change(v) for c, v in log.columns.items()}))


def glitch(case: Case, channel: str) -> Case | None:
    """One sample of a channel far off its neighbours, in the first run that has it."""
    at = next((k for k, log in enumerate(case.runs) if log.has(channel)), None)
    if at is None:
        return None
    log = case.runs[at]
    values = log.columns[channel].copy()
    rows = np.flatnonzero(np.isfinite(values))
    row = rows[int(0.37 * len(rows))]
    values[row] += float(np.ptp(values[rows])) + GLITCH_NOISES * (case.robot.noise(channel) or 0.0)
    runs = list(case.runs)
    runs[at] = replace(log, columns={**log.columns, channel: values})
    return replace(case, runs=tuple(runs))


def jittered(case: Case) -> Case:
    """Stamps a millisecond off, or a quarter of a step where that is less."""

    def change(log: RunLog) -> RunLog:
        most = min(JITTER_S, 0.25 * float(np.median(np.diff(log.t))))
        noise = np.clip(_rng(log, "jitter").standard_normal(len(log.t)), -1.9, 1.9) * most
        noise[0] = 0.0
        t = np.maximum.accumulate(log.t + noise)
        return replace(log, t=t + 1e-7 * np.arange(len(t)))

    return _each(case, change)


def skewed(case: Case) -> Case | None:
    """Gyro and pose stamped 5 ms after the rest, in rows of their own."""
    late = ("gyro_z", "x", "y", "yaw")
    if not any(log.has(c) for log in case.runs for c in late):
        return None

    def change(log: RunLog) -> RunLog:
        ticks = np.round((log.t - log.t[0]) * 1e6).astype(np.int64)
        after = ticks + round(SKEW_S * 1e6)
        there = np.zeros(len(ticks), bool)
        for c in late:
            if c in log.columns:
                there |= np.isfinite(log.columns[c])
        union = np.unique(np.concatenate([ticks, after[there]]))
        own, theirs = np.searchsorted(union, ticks), np.searchsorted(union, after[there])
        held = np.searchsorted(ticks, union, side="right") - 1
        columns = {}
        for c, values in log.columns.items():
            if c in late:
                columns[c] = np.full(len(union), np.nan)
                columns[c][theirs] = values[there]
            elif c in MEASURED:
                columns[c] = np.full(len(union), np.nan)
                columns[c][own] = values
            else:
                columns[c] = values[held]
        return replace(log, t=log.t[0] + union * 1e-6, columns=columns)

    return _each(case, change)


def every_second(case: Case) -> Case:
    """Sensors logged in every other row, commands in all."""

    def change(log: RunLog) -> RunLog:
        odd = np.arange(len(log.t)) % 2 == 1
        return replace(
            log, columns={c: np.where(odd, np.nan, v) if c in MEASURED else v for c, v in log.columns.items()}
        )

    return _each(case, change)


def cut_short(case: Case, start: bool) -> Case | None:
    """The logger began late, or ended early; without a measured speed a run cannot begin in motion."""
    if start and not all(log.has(f"w_{s}") for log in case.runs for s in case.robot.sides):
        return None

    def change(log: RunLog) -> RunLog:
        count = int(MISSING_SHARE * len(log.t))
        rows = slice(count, None) if start else slice(None, len(log.t) - count)
        if start:
            # The first row tells how the robot moves.
            good = np.all([np.isfinite(log.columns[f"w_{s}"]) for s in case.robot.sides], axis=0)
            rows = slice(count + int(np.argmax(good[count:])), None)
        return replace(log, t=log.t[rows], columns={c: v[rows] for c, v in log.columns.items()})

    return _each(case, change)


def without(case: Case, channels: tuple[str, ...]) -> Case | None:
    """A case whose logger did not have some channels."""
    if not any(log.has(c) for log in case.runs for c in channels):
        return None
    return _each(case, lambda log: replace(log, columns={c: v for c, v in log.columns.items() if c not in channels}))


CHANNELS = ("v_bus", "i_l", "i_r", "w_l", "w_r", "th_l", "th_r", "gyro_z", "x", "y", "yaw")
TABLE = (
    Transformation("time from 1000 s", lambda c: later(c, 1000.0)),
    Transformation("time since 1970", lambda c: later(c, SECONDS_SINCE_1970)),
    Transformation("turned and shifted world", turned),
    Transformation("mirrored robot", mirrored, mirrored=True),
    Transformation("other names and order", renamed),
    Transformation("parquet", lambda c: stored(c, "parquet")),
    Transformation("csv", lambda c: stored(c, "csv")),
    Transformation("two decimals", lambda c: decimals(c, 2), noisier=True),
    Transformation("three digits", lambda c: digits(c, 3), noisier=True),
    *(Transformation(f"glitch in {channel}", lambda c, channel=channel: glitch(c, channel)) for channel in CHANNELS),
    Transformation("1 ms of jitter", jittered, noisier=True),
    Transformation("5 ms of skew", skewed, same=False),
    Transformation("every second sample", every_second, same=False),
    Transformation("start missing", lambda c: cut_short(c, True), same=False),
    Transformation("end missing", lambda c: cut_short(c, False), same=False),
    Transformation("no current", lambda c: without(c, ("i_l", "i_r")), same=False),
    Transformation("no gyro", lambda c: without(c, ("gyro_z",)), same=False),
    Transformation("no pose", lambda c: without(c, ("x", "y", "yaw")), same=False),
    Transformation("no bus voltage", lambda c: without(c, ("v_bus",)), same=False),
    Transformation("no angles", lambda c: without(c, ("th_l", "th_r")), same=False),
)
