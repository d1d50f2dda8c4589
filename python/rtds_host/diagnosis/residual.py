"""Whitened residuals of a run: what its replay and its log differ by, in units of noise. Nothing here changes anything.

The residuals hold more than the gap of the contract counts (angles as well as speeds, the bus voltage, window ends
averaged over their neighbours), since each sample that narrows an explanation is welcome in the choice.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rtds_host.contract import Robot, RunLog
from rtds_host.diagnosis.gap import WINDOW_S
from rtds_host.plant.schema import OUTPUT_INDEX

# Numerical: half the span over which a window's end is averaged: long against a sample, short against the motion.
AVERAGE_S = 0.05
# Numerical: the same for angles where no speed is measured, which then have to show what moves fast, too, and for those
# of an axis, whose pieces are shorter: they show a delay of the speed alone.
FINE_WINDOW_S, FINE_AVERAGE_S = 0.1, 0.01
CHANNELS = ("v_bus", "i_l", "i_r", "w_l", "w_r", "th_l", "th_r", "gyro_z", "x", "y", "yaw")


@dataclass(frozen=True)
class _Windows:
    """Averaging of a channel about the ends of windows: rows grouped by `starts` for np.add.reduceat."""

    rows: np.ndarray
    starts: np.ndarray
    counts: np.ndarray
    times: np.ndarray

    def mean(self, values: np.ndarray) -> np.ndarray:
        return np.add.reduceat(values[self.rows], self.starts) / self.counts

    def moves(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and weights of what lies between the means of each two ends one after another, as of one sum each."""
        ends = np.split(self.rows, self.starts[1:])
        rows = [part for before, after in zip(ends, ends[1:]) for part in (after, before)]
        signs = [sign for _ in ends[1:] for sign in (1.0, -1.0)]
        return np.concatenate(rows), np.concatenate(
            [np.full(len(part), sign / len(part)) for sign, part in zip(signs, rows)]
        )

    def unsure(self, log: RunLog, channel: str) -> np.ndarray | float:
        """By how much a channel's change from end to end is less certain than by its noise, sigma, (ends - 1,)."""
        beyond = log.unsure.get(channel)
        if beyond is None:
            return 0.0
        ends = np.sqrt(self.mean(np.square(beyond)) / self.counts)
        return np.hypot(ends[1:], ends[:-1])


def _windows(
    t: np.ndarray, good: np.ndarray, window_s: float = WINDOW_S, average_s: float = AVERAGE_S
) -> _Windows | None:
    rows = np.flatnonzero(good)
    if len(rows) < 2 or t[rows[-1]] - t[rows[0]] < window_s:
        return None
    times = t[rows]
    marks = times[0] + window_s * np.arange(int((times[-1] - times[0]) / window_s + 1e-6) + 1)
    first = np.searchsorted(times, marks - average_s - 1e-9)
    last = np.searchsorted(times, marks + average_s + 1e-9)
    keep = last > first
    first, last, marks = first[keep], last[keep], marks[keep]
    if len(marks) < 2:
        return None
    picked = np.concatenate([rows[a:b] for a, b in zip(first, last)])
    counts = last - first
    return _Windows(picked, np.concatenate([[0], np.cumsum(counts)[:-1]]), counts, marks)


@dataclass(frozen=True)
class _Samples:
    """Channels compared sample by sample, one after another: entries of a replay, flat, and what was measured there.

    `channels` : where all but the first begin. `level` is the part whose mean is no evidence (the bus voltage's), if
    there is one.
    """

    channels: np.ndarray
    entries: np.ndarray
    measured: np.ndarray
    noise: np.ndarray
    level: slice | None


@dataclass(frozen=True)
class RunData:
    """One run prepared: inputs of the replay and what its residual compares."""

    log: RunLog
    inputs: tuple[np.ndarray, ...]
    sampled: _Samples | None = None
    angles: list[tuple[str, int, _Windows, np.ndarray, np.ndarray]] = field(default_factory=list)
    pose: tuple | None = None
    time: np.ndarray = field(default_factory=lambda: np.empty(0))
    block: np.ndarray = field(default_factory=lambda: np.empty(0, int))
    channel: np.ndarray = field(default_factory=lambda: np.empty(0, int))


def prepared(log: RunLog, inputs: tuple[np.ndarray, ...], robot: Robot, block_s: float) -> RunData:
    """A run ready to be compared with its replays; `block_s`: length of the blocks of time, s."""
    angles: list[tuple[str, int, _Windows, np.ndarray, np.ndarray]] = []
    pose: tuple | None = None
    blocks, channels, stamps, sampled = [], [], [], []

    def note(channel: str, times: np.ndarray) -> None:
        blocks.append(((times - log.t[0]) / block_s + 1e-9).astype(int))
        channels.append(np.full(len(times), CHANNELS.index(channel)))
        stamps.append(times)

    for channel in ("v_bus", "i_l", "i_r", "w_l", "w_r", "gyro_z"):
        noise = robot.noise(channel)
        if noise is None or not log.has(channel) or (channel == "v_bus" and robot.driver.bus == "measured"):
            continue
        if channel[0] == "i" and robot.driver.mode == "torque":
            continue
        if channel[-2:] == "_r" and len(robot.sides) == 1:
            continue
        rows = np.flatnonzero(np.isfinite(log.columns[channel]))
        sampled.append((channel, rows, log.columns[channel][rows], log.noise(channel, noise, rows)))
        note(channel, log.t[rows])
    for side in robot.sides:
        channel = f"th_{side}"
        noise = robot.noise(channel)
        if noise is None or not log.has(channel):
            continue
        lone = not log.has(f"w_{side}") or robot.noise(f"w_{side}") is None
        fine = lone or robot.axis is not None
        for spans in ((WINDOW_S, AVERAGE_S), (FINE_WINDOW_S, FINE_AVERAGE_S))[: 2 if fine else 1]:
            windows = _windows(log.t, np.isfinite(log.columns[channel]), *spans)
            if windows is None:
                continue
            scale = noise * np.sqrt(1.0 / windows.counts[1:] + 1.0 / windows.counts[:-1])
            # Averaging does not help against a count that does not change: an encoder's step limits the noise.
            scale = np.hypot(np.maximum(scale, noise), windows.unsure(log, channel))
            measured = np.diff(windows.mean(log.columns[channel]))
            angles.append((channel, OUTPUT_INDEX[channel], windows, measured, scale))
            note(channel, windows.times[:-1])
    full = log.has("x") and log.has("y") and robot.noise("x") is not None
    if robot.axis is None and log.has("yaw") and (full or robot.noise("yaw")):
        good = np.isfinite(log.columns["yaw"])
        if full:
            good = good & np.isfinite(log.columns["x"]) & np.isfinite(log.columns["y"])
        windows = _windows(log.t, good)
        if windows is not None:
            spread = np.sqrt(1.0 / windows.counts[1:] + 1.0 / windows.counts[:-1])
            columns = [log.columns[c] if full or c == "yaw" else np.zeros(len(log.t)) for c in ("x", "y", "yaw")]
            scales = [
                np.hypot(size * spread, windows.unsure(log, c)) if (size := robot.noise(c)) else spread
                for c in ("x", "y", "yaw")
            ]
            counted = tuple(k for k, c in enumerate(("x", "y", "yaw")) if robot.noise(c) and (full or c == "yaw"))
            pose = (counted, windows, _displacements(windows, *columns), scales)
            for k in counted:
                note(("x", "y", "yaw")[k], windows.times[:-1])
    return RunData(
        log,
        inputs,
        _sampled(sampled),
        angles,
        pose,
        np.concatenate(stamps) if stamps else np.empty(0),
        np.concatenate(blocks) if blocks else np.empty(0, int),
        np.concatenate(channels) if channels else np.empty(0, int),
    )


def _sampled(parts: list[tuple[str, np.ndarray, np.ndarray, np.ndarray]]) -> _Samples | None:
    """Channels (name, rows, measured, noise) as one."""
    if not parts:
        return None
    counts = [len(rows) for _, rows, _, _ in parts]
    # The bus is the first channel there is.
    level = slice(0, counts[0]) if parts[0][0] == "v_bus" else None
    return _Samples(
        np.cumsum(counts[:-1]),
        np.concatenate([rows * len(OUTPUT_INDEX) + OUTPUT_INDEX[channel] for channel, rows, _, _ in parts]),
        np.concatenate([measured for _, _, measured, _ in parts]),
        np.concatenate([noise for *_, noise in parts]),
        level,
    )


def _displacements(windows: _Windows, x: np.ndarray, y: np.ndarray, yaw: np.ndarray) -> tuple[np.ndarray, ...]:
    """From the end of each window to the next: ahead and to the left as seen at the first, m, and turned, rad."""
    px, py, heading = windows.mean(x), windows.mean(y), windows.mean(yaw)
    dx, dy = np.diff(px), np.diff(py)
    c, s = np.cos(heading[:-1]), np.sin(heading[:-1])
    return c * dx + s * dy, c * dy - s * dx, np.diff(heading)


def run_residual(data: RunData, out: np.ndarray, into: np.ndarray | None = None) -> np.ndarray:
    """(replayed - measured) / noise of one run, (n,); written to `into` if that is given."""
    result = np.empty(len(data.block)) if into is None else into
    at = 0
    if data.sampled is not None:
        at = len(data.sampled.entries)
        error = result[:at]
        error[:] = (out.ravel()[data.sampled.entries] - data.sampled.measured) / data.sampled.noise
        if data.sampled.level is not None:
            # Its mean depends on the supply, which nobody declares exactly; only its changes are evidence.
            error[data.sampled.level] -= error[data.sampled.level].mean()
    for _, column, windows, measured, scale in data.angles:
        result[at : at + len(measured)] = (np.diff(windows.mean(out[:, column])) - measured) / scale
        at += len(measured)
    if data.pose is not None:
        counted, windows, measured, noise = data.pose
        replayed = _displacements(windows, out[:, 8], out[:, 9], out[:, 10])
        for k in counted:
            result[at : at + len(noise[k])] = (replayed[k] - measured[k]) / noise[k]
            at += len(noise[k])
    return result
