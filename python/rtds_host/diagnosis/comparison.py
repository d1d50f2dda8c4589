"""The residual of all runs of a case at once, compiled: what `residual.run_residual` says of one run in NumPy."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numba
import numpy as np

from rtds_host.diagnosis.residual import RunData
from rtds_host.plant.schema import OUTPUT_INDEX


@dataclass(frozen=True)
class Comparison:
    """What the residual of several runs compares, all at once and compiled: `run_residual` of one run after another.

    A sample is an entry of the replay (rows, 11), flat, an angle a weighted sum of entries. A pose is where the robot
    went from the mean at one end of a window to that at the next.

    samples, sums, levels : (n, 2) first and last (exclusive) of the residuals of a run's channel, of its angle, and of
    a part whose mean is no evidence (the bus voltage's);
    first : (N + 1,) where each residual's entries begin; entries, weights : of all of them; measured, noise : (N,);
    moves : (m, 3) residuals of each displacement ahead, to the left and turned, -1 where one is not compared;
    ends : (m, 4) where the entries of its first end's x begin and end in `at_ends`, and those of its second end.
    """

    samples: np.ndarray
    sums: np.ndarray
    levels: np.ndarray
    first: np.ndarray
    entries: np.ndarray
    weights: np.ndarray
    measured: np.ndarray
    noise: np.ndarray
    moves: np.ndarray
    ends: np.ndarray
    at_ends: np.ndarray

    @classmethod
    def of(cls, runs: Sequence[RunData]) -> Comparison:
        """Of prepared runs in the order of their replays."""
        gathered, row = _Gathered(), 0
        for data in runs:
            gathered.add(data, row * len(OUTPUT_INDEX))
            row += len(data.inputs[0])
        return cls(
            samples=np.array(gathered.samples, int).reshape(-1, 2),
            sums=np.array(gathered.sums, int).reshape(-1, 2),
            levels=np.array(gathered.levels, int).reshape(-1, 2),
            first=np.concatenate([[0], np.cumsum(_joined(gathered.counts, int))]),
            entries=_joined(gathered.entries, int),
            weights=_joined(gathered.weights, float),
            measured=_joined(gathered.measured, float),
            noise=_joined(gathered.noise, float),
            moves=_joined(gathered.moves, int, 3),
            ends=_joined(gathered.ends, int, 4),
            at_ends=_joined(gathered.at_ends, int),
        )

    def residual(self, out: np.ndarray, row: int, rows: slice, into: np.ndarray) -> None:
        """Fill in the `rows` of a residual (N,) from the replay of their runs, (n, 11), which begins at a `row`."""
        _compare(
            out.ravel(),
            row * len(OUTPUT_INDEX),
            (rows.start, rows.stop),
            (self.samples, self.sums, self.levels),
            (self.first, self.entries, self.weights, self.measured, self.noise),
            (self.moves, self.ends, self.at_ends),
            into,
        )


def _joined(parts: Sequence[np.ndarray], kind: type, *width: int) -> np.ndarray:
    """Arrays (n, *width) of a kind, one after another; none without any."""
    return np.concatenate([np.empty((0, *width), kind), *parts])


class _Gathered:
    """What a `Comparison` holds, run by run."""

    def __init__(self) -> None:
        self.samples: list[tuple[int, int]] = []
        self.sums: list[tuple[int, int]] = []
        self.levels: list[tuple[int, int]] = []
        self.counts: list[np.ndarray] = []
        self.entries: list[np.ndarray] = []
        self.weights: list[np.ndarray] = []
        self.measured: list[np.ndarray] = []
        self.noise: list[np.ndarray] = []
        self.moves: list[np.ndarray] = []
        self.ends: list[np.ndarray] = []
        self.at_ends: list[np.ndarray] = []
        self.count = 0  # residuals so far
        self.poses = 0  # entries in `at_ends` so far

    def add(self, data: RunData, offset: int) -> None:
        """One run, whose replay begins at the entry `offset`."""
        if data.sampled is not None:
            seen = data.sampled
            if seen.level is not None:
                self.levels.append((self.count + seen.level.start, self.count + seen.level.stop))
            for begin, end in pairwise([0, *seen.channels, len(seen.entries)]):
                self.samples.append((self.count + begin, self.count + end))
            self._take(np.ones(len(seen.entries), int), seen.entries + offset, None, seen.measured, seen.noise)
        for _, column, windows, measured, scale in data.angles:
            rows, weights = windows.moves()
            self.sums.append((self.count, self.count + len(measured)))
            counts = windows.counts[1:] + windows.counts[:-1]
            self._take(counts, rows * len(OUTPUT_INDEX) + column + offset, weights, measured, scale)
        if data.pose is not None:
            self._add_pose(data.pose, offset)

    def _take(
        self,
        counts: np.ndarray,
        entries: np.ndarray,
        weights: np.ndarray | None,
        measured: np.ndarray,
        noise: np.ndarray,
    ) -> None:
        self.counts.append(counts)
        self.entries.append(entries)
        self.weights.append(np.ones(len(entries)) if weights is None else weights)
        self.measured.append(measured)
        self.noise.append(noise)
        self.count += len(measured)

    def _add_pose(self, pose: tuple, offset: int) -> None:
        counted, windows, measured, noise = pose
        moves = np.full((len(windows.counts) - 1, 3), -1)
        for k in counted:
            moves[:, k] = self.count + np.arange(len(moves))
            self._take(np.zeros(len(moves), int), np.empty(0, int), None, measured[k], noise[k])
        begin = self.poses + windows.starts
        ends = np.column_stack([begin, begin + windows.counts])
        self.moves.append(moves)
        self.ends.append(np.hstack([ends[:-1], ends[1:]]))
        self.at_ends.append(windows.rows * len(OUTPUT_INDEX) + OUTPUT_INDEX["x"] + offset)
        self.poses += len(windows.rows)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _compare(replayed, offset, rows, parts, values, poses, into):
    """Fill in some `rows`, from and to, of a residual; the other arguments as of `Comparison.residual`."""
    samples, sums, levels = parts
    first, entries, weights, measured, noise = values
    moves, ends, at_ends = poses
    for n in range(len(samples)):
        if rows[0] <= samples[n, 0] < rows[1]:
            shift = first[samples[n, 0]] - samples[n, 0]
            # By themselves, scattered loads do not keep what follows from going several at a time.
            for k in range(samples[n, 0], samples[n, 1]):
                into[k] = replayed[np.uintp(entries[k + shift] - offset)]
            for k in range(samples[n, 0], samples[n, 1]):
                into[k] = (into[k] - measured[k]) / noise[k]
    for n in range(len(sums)):
        if rows[0] <= sums[n, 0] < rows[1]:
            for k in range(sums[n, 0], sums[n, 1]):
                value = 0.0
                for m in range(first[k], first[k + 1]):
                    value += weights[m] * replayed[entries[m] - offset]
                into[k] = (value - measured[k]) / noise[k]
    for n in range(len(levels)):
        if rows[0] <= levels[n, 0] < rows[1]:
            # Its mean depends on the supply, which nobody declares exactly; only its changes are evidence.
            into[levels[n, 0] : levels[n, 1]] -= into[levels[n, 0] : levels[n, 1]].mean()
    for n in range(len(moves)):
        one = max(moves[n, 0], moves[n, 1], moves[n, 2])
        if rows[0] <= one < rows[1]:
            x, y, yaw = _mean_pose(replayed, offset, at_ends, ends[n, 0], ends[n, 1])
            then_x, then_y, then_yaw = _mean_pose(replayed, offset, at_ends, ends[n, 2], ends[n, 3])
            dx, dy, c, s = then_x - x, then_y - y, math.cos(yaw), math.sin(yaw)
            for k, value in ((0, c * dx + s * dy), (1, c * dy - s * dx), (2, then_yaw - yaw)):
                at = moves[n, k]
                if at >= 0:
                    into[at] = (value - measured[at]) / noise[at]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _mean_pose(replayed, offset, at_ends, begin, end):
    """Mean x, y and yaw over the entries of x in at_ends[begin:end]."""
    x = y = yaw = 0.0
    for k in range(begin, end):
        at = at_ends[k] - offset
        x += replayed[at]
        y += replayed[at + 1]
        yaw += replayed[at + 2]
    return x / (end - begin), y / (end - begin), yaw / (end - begin)
