"""The gap between a replay and what was measured (contract, section 4)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rtds_host.contract import Robot, RunLog
from rtds_host.plant.schema import OUTPUT_INDEX

SAMPLED = ("i_l", "i_r", "w_l", "w_r", "gyro_z")
# Over which a pose's move counts (contract, section 4).
WINDOW_S = 1.0
# Below this a gap is none (contract, sections 4 and 5).
LEAST = 1.1


def gap_channels(log: RunLog, robot: Robot) -> tuple[str, ...]:
    """Channels of a run that count: measured, with a declared noise; `th_*` only on a side whose `w_*` does not count;
    no current where torque is commanded, of which a replay knows none."""
    names = [c for c in SAMPLED if log.has(c) and not (c[0] == "i" and robot.driver.mode == "torque")]
    names += [
        f"th_{s}"
        for s in robot.sides
        if log.has(f"th_{s}") and not (log.has(f"w_{s}") and robot.noise(f"w_{s}") is not None)
    ]
    if log.has("x") and log.has("y") and log.has("yaw"):
        names += ["x", "y"]
    if log.has("yaw"):
        names += ["yaw"]
    return tuple(c for c in names if robot.noise(c) is not None)


def window_rows(t: np.ndarray, rows: np.ndarray, window_s: float = WINDOW_S) -> np.ndarray:
    """Rows that bound the complete consecutive windows of `window_s`, of the rows (ascending) that have a sample; what
    is sampled less often, or not for a while, has longer ones."""
    if len(rows) < 2:
        return rows[:0]
    times = t[rows]
    count = int((times[-1] - times[0]) / window_s + 1e-6)
    marks = times[0] + window_s * np.arange(count + 1)
    return rows[np.unique(np.searchsorted(times, marks - 1e-6))]


def displacements(x: np.ndarray, y: np.ndarray, yaw: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, ...]:
    """How far a pose moves in each window, seen from the heading at its start: three arrays (windows,)."""
    dx, dy = np.diff(x[rows]), np.diff(y[rows])
    c, s = np.cos(yaw[rows[:-1]]), np.sin(yaw[rows[:-1]])
    return c * dx + s * dy, c * dy - s * dx, np.diff(yaw[rows])


def errors(log: RunLog, robot: Robot, out: np.ndarray) -> dict[str, np.ndarray]:
    """Error of each channel that counts, in units of its noise.

    Parameters
    ----------
    out : (n, 11) a replay at the log's times, columns as `OUTPUTS`.

    Returns
    -------
    channel -> (samples,) for `i`, `w`, `gyro_z`; (windows,) for `x`, `y`, `yaw`, `th_*`.
    """
    return {channel: error for channel, (_, error) in errors_at(log, robot, out).items()}


def errors_at(log: RunLog, robot: Robot, out: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """As `errors`, with the row of each error (of a window: its first), channel -> (rows, errors)."""
    result = {}
    channels = gap_channels(log, robot)
    for c in channels:
        if c in SAMPLED:
            rows = np.flatnonzero(np.isfinite(log.columns[c]))
            result[c] = (
                rows,
                (out[rows, OUTPUT_INDEX[c]] - log.columns[c][rows]) / log.noise(c, robot.known_noise(c), rows),
            )
        elif c.startswith("th_") or (c == "yaw" and "x" not in channels):
            rows = window_rows(log.t, np.flatnonzero(np.isfinite(log.columns[c])))
            moved = np.diff(out[rows, OUTPUT_INDEX[c]]) - np.diff(log.columns[c][rows])
            result[c] = rows[:-1], moved / _of_moves(log, c, robot.known_noise(c), rows)
    if "x" in channels:
        x, y, yaw = pose = [log.columns[c] for c in ("x", "y", "yaw")]
        rows = window_rows(log.t, np.flatnonzero(np.isfinite(pose).all(axis=0)))
        measured = displacements(x, y, yaw, rows)
        x, y, yaw = (out[:, OUTPUT_INDEX[c]] for c in ("x", "y", "yaw"))
        replayed = displacements(x, y, yaw, rows)
        for c, a, b in zip(("x", "y", "yaw"), measured, replayed):
            if c in channels:
                result[c] = rows[:-1], (b - a) / _of_moves(log, c, robot.known_noise(c), rows)
    return result


def counts(log: RunLog, robot: Robot) -> bool:
    """Whether a run has anything that a gap could be of: a sample, or a whole window of an angle or a pose."""
    there = np.zeros((len(log.t), len(OUTPUT_INDEX)))
    return any(len(error) for error in errors(log, robot, there).values())


def _of_moves(log: RunLog, channel: str, noise: float, rows: np.ndarray) -> np.ndarray:
    """Noise of a channel's change from each of some rows to the next, (rows - 1,)."""
    ends = log.noise(channel, noise, rows)
    return np.hypot(ends[1:], ends[:-1])


@dataclass(frozen=True)
class Squares:
    """What the gap needs of errors: their sum of squares and their number."""

    total: float
    count: int


def squares(errors: np.ndarray) -> Squares:
    """Sum of squares of errors (n,), in units of noise."""
    return Squares(float(errors @ errors), len(errors))


def pooled(parts: Sequence[Mapping[str, np.ndarray | Squares]]) -> dict[str, float]:
    """Root mean square of each channel over several runs, from errors or their squares."""
    total: dict[str, list[Squares]] = {}
    for part in parts:
        for channel, error in part.items():
            total.setdefault(channel, []).append(error if isinstance(error, Squares) else squares(error))
    counts = {channel: sum(one.count for one in found) for channel, found in total.items()}
    return {
        channel: math.sqrt(sum(one.total for one in found) / counts[channel])
        for channel, found in total.items()
        if counts[channel]
    }


def gap(channels: dict[str, float]) -> float:
    """The gap G: root mean square over the channels."""
    return float(np.sqrt(np.mean(np.square(list(channels.values()))))) if channels else float("nan")


def closed(start: float, after: float) -> float | None:
    """Share of the gap closed, (start - after) / (start - 1); None where the start is below 1.1."""
    return None if start < LEAST else (start - after) / (start - 1.0)
