"""A case as a fitting problem: whitened residuals of whole-run replays, in blocks of time.

The residuals hold more than the gap of the contract counts (angles as well as speeds, the bus voltage, window ends
averaged over their neighbours), since each sample that narrows an explanation is welcome in the choice.
"""

from __future__ import annotations

import functools
import math
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numba
import numpy as np

from rtds_host.contract import Case, RunLog
from rtds_host.diagnosis.effects import Effect, catalogue
from rtds_host.diagnosis.effort import spend
from rtds_host.diagnosis.gap import WINDOW_S, errors, gap, pooled
from rtds_host.diagnosis.gate.cuts import start_row
from rtds_host.diagnosis.likelihood import Likelihood
from rtds_host.diagnosis.nuisances import nuisances_of
from rtds_host.diagnosis.replay.layout import OUTPUT_INDEX
from rtds_host.diagnosis.replay.model import (
    Model,
    ReplayBatch,
    following,
    nominal_model,
    piece_inputs,
    replay_run,
    run_inputs,
    stretch_inputs,
)
from rtds_host.diagnosis.replay.simd import SIMD_WIDTH
from rtds_host.diagnosis.start import DECLARED, Start
from rtds_host.diagnosis.thresholds import MAJORITY, SIGNIFICANT

# Numerical: stretches whose residuals are counted as one draw are as long as the gap's windows; shorter where all runs
# together are, so that there are enough of them, of a few rows each.
LEAST_BLOCKS, ROWS_A_BLOCK = 100, 5
# Numerical: half the span over which a window's end is averaged: long against a sample, short against the motion.
AVERAGE_S = 0.05
# Numerical: the same for angles where no speed is measured, which then have to show what moves fast, too, and for those
# of an axis, whose pieces are shorter: they tell a speed that alone is late.
FINE_WINDOW_S, FINE_AVERAGE_S = 0.1, 0.01
# Numerical: longer cases are searched in stretches: by then the models' errors, and not the samples, bound what can be
# learnt.
SEARCHED_S, SEARCHED_ROWS, STRETCH_S = 300.0, 80_000, 20.0
# A piece of an axis' run is as long as what is missing is remembered: what lasts longer is a scale, a bias or a load.
PIECE_S = 0.3
# Numerical: chi2 that chance alone does not bring.
CHI2 = SIGNIFICANT**2
# Numerical: what a step of a replay alone takes, one where lanes wait for each other's free play, and whitening a
# residual, in steps of one in a batch.
ALONE, WAITING, WHITENED = 8.0, 3.0, 0.35
# Numerical: starts whose inputs are kept: the one that is searched, and those that it is compared with.
STARTS_KEPT = 4
# Numerical: lags that are tried in a run, in delays of the others.
LAGS = np.linspace(0.0, 3.0, 25)


@dataclass
class _Windows:
    """Averaging of a channel about the ends of windows: rows grouped by `starts` for np.add.reduceat."""

    rows: np.ndarray
    starts: np.ndarray
    counts: np.ndarray
    times: np.ndarray

    def mean(self, values: np.ndarray) -> np.ndarray:
        return np.add.reduceat(values[self.rows], self.starts) / self.counts

    def unsure(self, log: RunLog, channel: str) -> np.ndarray | float:
        """What a channel's moves from end to end have beyond its noise, one standard deviation, (ends - 1,)."""
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


@dataclass
class _Samples:
    """Channels compared sample by sample, one after another: entries of a replay, flat, and what was measured there.

    `level` is the part whose mean is no evidence (the bus voltage's), if there is one.
    """

    entries: np.ndarray
    measured: np.ndarray
    noise: np.ndarray
    level: slice | None


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _in_noise(replayed, entries, measured, noise, into):
    """Errors in units of noise, (replayed - measured) / noise, at some entries of a replay (none of them negative)."""
    # By themselves, scattered loads do not keep what follows from going several at a time.
    for k in range(len(entries)):
        into[k] = replayed[np.uintp(entries[k])]
    for k in range(len(entries)):
        into[k] = (into[k] - measured[k]) / noise[k]


@dataclass
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


CHANNELS = ("v_bus", "i_l", "i_r", "w_l", "w_r", "th_l", "th_r", "gyro_z", "x", "y", "yaw")

# Numerical: rows of a block whose noise is measured.
NOISE_ROWS = 20


class Problem:
    """Residuals of a case for any model, of whole runs or (of a single axis) of `pieces` of them.

    `by_run`: the likelihood has one unknown size a channel and run, in place of one a channel and block of time.

    `blocks`: (N,) which block of time a residual belongs to, over all runs; `runs_of`: (N,) which run;
    `channels_of`: (N,) index into `CHANNELS`; `rows`: each run and the rows of its residuals.
    """

    def __init__(self, case: Case, threads: int = 2, pieces: bool = False, by_run: bool = False):
        self.case = case
        self.robot = case.robot
        self.nominal = nominal_model(case.robot)
        self.nuisances = nuisances_of(case, self.nominal)
        self.effects: dict[str, Effect] = catalogue(case.robot, case.runs)
        self.threads = max(threads, 1)
        self._begun: dict[tuple[Start, bool], tuple[list[RunData], list[RunData]]] = {}
        self._follow = False
        lasted = sum(float(log.t[-1] - log.t[0]) for log in case.runs)
        coarsest = max(float(np.median(np.diff(log.t))) for log in case.runs)
        self.block_s = min(WINDOW_S, max(lasted / LEAST_BLOCKS, ROWS_A_BLOCK * coarsest))
        self.pieces = pieces
        self._kept: list[ReplayBatch] = []
        self._gaps: dict[tuple, float] = {}
        self.work = 0.0  # done on residuals so far, in steps of a replay in a batch
        self.pool = ThreadPoolExecutor(self.threads)
        self.whole = [RunData(log, run_inputs(log, case.robot)) for log in case.runs]
        self.searched = min(1.0, SEARCHED_S / lasted, SEARCHED_ROWS / sum(len(log.t) for log in case.runs))
        self.runs, owners = [], []
        owed = 0.0  # of what is to be searched, s, what the runs so far did not give
        for k, log in enumerate(case.runs):
            if pieces:
                parts = self._pieces(log)
            elif self.searched < 1.0:
                owed += self.searched * float(log.t[-1] - log.t[0])
                parts = self._stretches(log, owed)
                owed -= sum(float(part.log.t[-1] - part.log.t[0]) for part in parts)
            else:
                parts = [self._prepare(log, run_inputs(log, self.robot))]
            self.runs += parts
            owners += [k] * len(parts)
        self.owners = owners
        offset = 0
        blocks = []
        for run in self.runs:
            blocks.append(run.block + offset)
            offset += int(run.block.max(initial=-1)) + 1
        self.blocks = np.concatenate(blocks)
        self.block_count = offset
        self.runs_of = np.concatenate([np.full(len(r.block), k) for k, r in zip(owners, self.runs)])
        self.channels_of = np.concatenate([r.channel for r in self.runs])
        self.times = np.concatenate([r.time for r in self.runs])
        self.size = len(self.blocks)
        ends = np.cumsum([len(run.block) for run in self.runs])
        self.groups, self.samples = self._grouped(by_run)
        self.rows = [(run, slice(int(end) - len(run.block), int(end))) for run, end in zip(self.runs, ends)]

    @functools.cached_property
    def in_pieces(self) -> Problem:
        """The same case in pieces of its runs, each from its measured state."""
        return self if self.pieces else Problem(self.case, self.threads, pieces=True)

    @functools.cached_property
    def sample_noise(self) -> dict[str, float]:
        """Channel -> the noise that its samples show over the declared one; of channels with enough samples, of which
        most are no copies of the one before.

        By third differences, which motion hardly has: the median over blocks of 20 rows of their root mean square,
        over sqrt(20), that of white noise of one unit.
        """
        found: dict[str, list[float]] = {}
        for log in self.case.runs:
            for channel, values in log.columns.items():
                noise, there = self.robot.noise(channel), values[np.isfinite(values)]
                held = bool(np.median(np.abs(np.diff(there))) == 0.0) if len(there) > 1 else True
                if noise and len(there) >= 2 * NOISE_ROWS and not held:
                    third = np.diff(there, 3) / (math.sqrt(20.0) * noise)
                    blocks = np.array_split(third, len(third) // NOISE_ROWS)
                    found.setdefault(channel, []).extend(float(np.sqrt(np.mean(block**2))) for block in blocks)
        sizes = {channel: float(np.median(blocks)) for channel, blocks in found.items()}
        return {channel: size for channel, size in sizes.items() if size > 0.0}

    @property
    def looked_at(self) -> Case:
        """The case as it is searched: its runs, of long ones the stretches."""
        if self.searched == 1.0 or self.pieces:
            return self.case
        return replace(
            self.case,
            runs=tuple(
                replace(data.log, name=f"{data.log.name}, {data.log.t[0] - self.whole[k].log.t[0]:.3f} s")
                for k, data in zip(self.owners, self.runs)
            ),
        )

    def white(self) -> Likelihood:
        """The likelihood of white noise alone, to estimate another from."""
        return Likelihood(self.groups, self.samples)

    def _grouped(self, by_run: bool) -> tuple[np.ndarray, np.ndarray]:
        """Groups of the likelihood, (N,): a channel in one block of time or in one run. And the blocks of each,
        (m,).
        """
        blocks = self.channels_of.astype(np.int64) * (self.block_count + 1) + self.blocks
        if not by_run:
            found, groups = np.unique(blocks, return_inverse=True)
            return groups, np.ones(len(found))
        runs = self.channels_of.astype(np.int64) * (len(self.whole) + 1) + self.runs_of
        found, groups = np.unique(runs, return_inverse=True)
        return groups, np.array([len(np.unique(blocks[groups == k])) for k in range(len(found))], float)

    def _pieces(self, log: RunLog) -> list[RunData]:
        """A run of a single axis in pieces that each start from the measured state.

        An axis integrates and sticks: over a whole run the misfit has many local minima, over a piece few. A piece is
        as long as what is missing is remembered. What is reported is judged on whole runs all the same.
        """
        length = max(PIECE_S, 2 * ROWS_A_BLOCK * float(np.median(np.diff(log.t))))
        marks = np.searchsorted(log.t, np.arange(log.t[0], log.t[-1], length))
        bounds = [
            (int(first), int(last))
            for first, last in zip(marks, np.append(marks[1:], len(log.t)))
            if last - first >= ROWS_A_BLOCK
        ]
        return [
            self._prepare(log.rows(first, last), piece_inputs(log, self.robot, first, last))
            for first, last in bounds or [(0, len(log.t))]
        ]

    def _stretches(self, log: RunLog, owed: float) -> list[RunData]:
        """Stretches from all over a long run, the run's beginning among them, so that a search takes no longer than of
        short ones.

        owed : s, what is to be searched of it and was not of the runs before. No stretch is shorter than two windows of
        an angle: of runs whose share is less some have one, short ones the whole of them, and the others none.
        """
        lasted = float(log.t[-1] - log.t[0])
        share, shortest, parts = lasted * self.searched, min(2.0 * WINDOW_S, lasted), []
        count = math.ceil(share / STRETCH_S) if share >= shortest else int(owed >= 0.5 * shortest)
        length = max(share / max(count, 1), shortest)
        for k in range(count):
            begin = log.t[0] + k * lasted / count
            first, last = np.searchsorted(log.t, (begin, begin + length + 1e-9))
            if k > 0:
                first = start_row(log, self.case, np.arange(first, last))
            if first is not None and last - first >= ROWS_A_BLOCK:
                parts.append(
                    self._prepare(
                        log.rows(int(first), int(last)), stretch_inputs(log, self.robot, int(first), int(last))
                    )
                )
        return parts

    def _prepare(self, log: RunLog, inputs: tuple[np.ndarray, ...]) -> RunData:
        robot = self.robot
        data = RunData(log, inputs)
        blocks, channels, stamps, sampled = [], [], [], []

        def note(channel: str, times: np.ndarray) -> None:
            blocks.append(((times - log.t[0]) / self.block_s + 1e-9).astype(int))
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
        data.sampled = self._sampled(sampled)
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
                # Averaging does not help against a count that stands still: an encoder's step limits the noise.
                scale = np.hypot(np.maximum(scale, noise), windows.unsure(log, channel))
                measured = np.diff(windows.mean(log.columns[channel]))
                data.angles.append((channel, OUTPUT_INDEX[channel], windows, measured, scale))
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
                data.pose = (counted, windows, self._moves(windows, *columns), scales)
                for k in counted:
                    note(("x", "y", "yaw")[k], windows.times[:-1])
        data.block = np.concatenate(blocks) if blocks else np.empty(0, int)
        data.channel = np.concatenate(channels) if channels else np.empty(0, int)
        data.time = np.concatenate(stamps) if stamps else np.empty(0)
        return data

    @staticmethod
    def _sampled(parts: list[tuple[str, np.ndarray, np.ndarray, np.ndarray]]) -> _Samples | None:
        """Channels (name, rows, measured, noise) as one."""
        if not parts:
            return None
        counts = [len(rows) for _, rows, _, _ in parts]
        # The bus is the first channel there is.
        level = slice(0, counts[0]) if parts[0][0] == "v_bus" else None
        return _Samples(
            np.concatenate([rows * len(OUTPUT_INDEX) + OUTPUT_INDEX[channel] for channel, rows, _, _ in parts]),
            np.concatenate([measured for _, _, measured, _ in parts]),
            np.concatenate([noise for *_, noise in parts]),
            level,
        )

    @staticmethod
    def _moves(windows: _Windows, x: np.ndarray, y: np.ndarray, yaw: np.ndarray) -> tuple[np.ndarray, ...]:
        px, py, heading = windows.mean(x), windows.mean(y), windows.mean(yaw)
        dx, dy = np.diff(px), np.diff(py)
        c, s = np.cos(heading[:-1]), np.sin(heading[:-1])
        return c * dx + s * dy, c * dy - s * dx, np.diff(heading)

    def run_residual(self, data: RunData, out: np.ndarray, into: np.ndarray | None = None) -> np.ndarray:
        """(replayed - measured) / noise of one run, (n,); written to `into` if that is given."""
        result = np.empty(len(data.block)) if into is None else into
        at = 0
        if data.sampled is not None:
            at = len(data.sampled.entries)
            error = result[:at]
            _in_noise(out.ravel(), data.sampled.entries, data.sampled.measured, data.sampled.noise, error)
            if data.sampled.level is not None:
                # Its level is the supply's affair; only how it moves is evidence.
                error[data.sampled.level] -= error[data.sampled.level].mean()
        for _, column, windows, measured, scale in data.angles:
            result[at : at + len(measured)] = (np.diff(windows.mean(out[:, column])) - measured) / scale
            at += len(measured)
        if data.pose is not None:
            counted, windows, measured, noise = data.pose
            replayed = self._moves(windows, out[:, 8], out[:, 9], out[:, 10])
            for k in counted:
                result[at : at + len(noise[k])] = (replayed[k] - measured[k]) / noise[k]
                at += len(noise[k])
        return result

    def begun(self, start: Start) -> list[RunData]:
        """The searched runs, begun as `start` says. A problem in pieces has measured states, which nothing changes."""
        return self._started(start)[0]

    def whole_begun(self, start: Start) -> list[RunData]:
        """All runs from end to end, at the headings of `start`: a gap is with speeds as measured and with commands when
        they were given."""
        return self._started(start)[1]

    def _started(self, start: Start) -> tuple[list[RunData], list[RunData]]:
        start = DECLARED if self.pieces else start
        key = start, self._follow
        if key not in self._begun:
            headings, speeds, lates = dict(start.headings), dict(start.speeds), dict(start.lates)

            def of(data: RunData, searched: bool) -> RunData:
                state, t_cmd, angles = data.inputs[-1].copy(), data.inputs[1], data.inputs[4]
                name = data.log.name
                state[2] = headings.get(name, state[2])
                if searched:
                    state[5] = state[9] = speeds.get((name, float(data.log.t[0])), state[5])
                    t_cmd = t_cmd + lates.get(name, 0.0)
                return replace(data, inputs=(data.inputs[0], t_cmd, *data.inputs[2:4], angles, data.inputs[5], state))

            searched = [of(data, True) for data in self.runs]
            if self._follow:
                logs = [self.whole[k].log for k in self.owners]
                searched = [replace(d, inputs=following(d.inputs, log)) for d, log in zip(searched, logs, strict=True)]
            while len(self._begun) >= STARTS_KEPT:
                del self._begun[next(iter(self._begun))]
            self._begun[key] = searched, [of(data, False) for data in self.whole]
        return self._begun[key]

    def _heading_misfit(self, data: RunData, model: Model, heading: float) -> float:
        start = data.inputs[-1].copy()
        start[2] = heading
        residual = self.run_residual(data, replay_run(model, (*data.inputs[:-1], start)))
        return float(residual @ residual)

    def _settled(self, data: RunData, model: Model) -> float | None:
        """The speed at which a run of an axis began, within the noise of its first sample; None where it has none."""
        noise = self.robot.noise("w_l")
        start = data.inputs[-1]
        if noise is None or not data.log.has("w_l"):
            return None
        measured = float(data.log.columns["w_l"][0])
        if not np.isfinite(measured):
            return None

        def residual(speed: float) -> np.ndarray:
            moved = start.copy()
            moved[5] = moved[9] = speed
            return self.run_residual(data, replay_run(model, (*data.inputs[:-1], moved)))

        begun = start[5]
        at = residual(begun)
        slope = (residual(begun + 0.3 * noise) - at) / (0.3 * noise)
        step = -(slope @ at + (begun - measured) / noise**2) / (slope @ slope + noise**-2)
        return float(np.clip(begun + step, measured - 3 * noise, measured + 3 * noise))

    def aligned(self, model: Model) -> Start:
        """The model's start with the heading estimated at which runs began whose log holds none, where it matters: on a
        slope.

        The contract has such runs begin at zero; a real one begins anywhere, and the slope then pulls another way than
        the replay's. An axis begins at a speed that is known to its sensor's noise only, which is estimated likewise.
        """
        runs = self.begun(model.start)
        if self.robot.axis is not None:
            if self.pieces:
                return model.start
            found = {(data.log.name, float(data.log.t[0])): self._settled(data, model) for data in runs}
            return model.start.with_speeds({key: speed for key, speed in found.items() if speed is not None})
        if self.searched < 1.0:
            return model.start
        headings = dict(model.start.headings)
        for data in runs:
            log = data.log
            if log.has("yaw") or log.meta.slope_rad == 0.0:
                continue
            misfit = functools.partial(self._heading_misfit, data, model)
            grid = np.linspace(-np.pi, np.pi, 24, endpoint=False)
            k = int(np.argmin(list(self.pool.map(misfit, grid))))
            from scipy.optimize import minimize_scalar  # a third of a second, which few cases have to spend

            best = minimize_scalar(
                misfit, bounds=(grid[k] - 0.3, grid[k] + 0.3), method="bounded", options={"xatol": 1e-3}
            )
            known = misfit(data.inputs[-1][2])
            if best.fun < known - CHI2 * max(1.0, best.fun / max(len(data.block), 1)):
                headings[log.name] = float(best.x)
        return model.start.with_headings(headings)

    def aligned_commands(self, model: Model) -> Start:
        """The model's start with an estimate of how much later than in the others commands act in single runs, next to
        a delay.

        A link is set up again for each run, and its lag is not always the same: one delay for all would be bent, and
        all else with it. What is so in half of the runs is the delay. It serves the search alone: every gap of a
        diagnosis is with one delay.
        """
        delay = model.get("command_delay") + model.get("measurement_delay")
        if delay <= 0.0 or self.pieces or self.searched < 1.0:
            return model.start
        runs = self.begun(model.start)
        found = {data.log.name: late for data in runs if (late := self._later(data, model, delay))}
        return model.start if 2 * len(found) >= len(runs) else model.start.with_lates(found)

    def _later(self, data: RunData, model: Model, delay: float) -> float:
        """By how much later than `delay` the commands of a run act, s; 0 where that does not explain most of its
        misfit.
        """
        was = dict(model.start.lates).get(data.log.name, 0.0)

        def missed(out: np.ndarray) -> float:
            residual = self.run_residual(data, out)
            return float(residual @ residual) - len(residual)

        def beyond(late: float) -> float:
            return missed(replay_run(model, (data.inputs[0], data.inputs[1] + late - was, *data.inputs[2:])))

        as_others = beyond(0.0)
        if as_others < CHI2:
            return 0.0
        lates = delay * (LAGS - 1.0)
        if model.batched:
            later = [model.copy() for _ in lates]
            for one, late in zip(later, lates):
                one.add("command_delay", late - was)
            values = [missed(out) for out in ReplayBatch([data.inputs]).replay(later)]
        else:
            values = list(self.pool.map(beyond, lates))
        k = int(np.argmin(values))
        from scipy.optimize import minimize_scalar  # a third of a second, which few cases have to spend

        best = minimize_scalar(
            beyond,
            bounds=(lates[max(k - 1, 0)], lates[min(k + 1, len(lates) - 1)]),
            method="bounded",
            options={"xatol": 1e-3},
        )
        return float(best.x) if best.fun < (1.0 - MAJORITY) * as_others else 0.0

    def lag_s(self, start: Start) -> float:
        """How well the mean of the runs' lags is known for what they scatter, one sigma, s."""
        if not start.lates:
            return 0.0
        each = [dict(start.lates).get(data.log.name, 0.0) for data in self.runs]
        return float(np.std(each, ddof=1)) / math.sqrt(len(each))

    def replay(self, model: Model) -> list[np.ndarray]:
        """Replays of all runs, each (n, 11), begun as the model's start says."""
        return [replay_run(model, data.inputs) for data in self.begun(model.start)]

    def residual(self, model: Model) -> np.ndarray:
        """Whitened residuals of all runs, (N,)."""
        return self.residuals([model])[0]

    def residuals(self, models: list[Model], steps: list[float] | None = None) -> list[np.ndarray]:
        """Residuals of several models, on all cores: shared out by runs, since there are often no more models than
        cores.

        steps : longest step of each, s, by default what it needs. What steps miss is nearly the same in models that are
        alike and take the same: those that are only compared with one another do with longer ones.
        """
        steps = steps or [model.step_s for model in models]
        if len({model.start for model in models}) > 1:
            return self._by_start(models, steps)
        begun = self.begun(models[0].start) if models else self.runs
        found = [np.empty(self.size) for _ in models]
        taken = sum(self._taken(model, step_s) + WHITENED * self.size for model, step_s in zip(models, steps))
        self.work += taken
        spend(taken)
        # Those with springs or free play side by side: what one lane has is computed in all.
        batched = sorted(
            (k for k, model in enumerate(models) if model.batched), key=lambda k: (models[k].slow, steps[k])
        )
        runs = self._batch(begun)
        if not runs.worth([models[k] for k in batched], self.threads):
            batched = []
        alone = sorted(set(range(len(models))) - set(batched))
        jobs = deque(
            functools.partial(self._alone, models[k], data, found[k][rows], steps[k])
            for k in alone
            for data, (_, rows) in zip(begun, self.rows)
        )
        if batched:
            # Lanes are to be full, and shares for all cores, but none so large that its replays leave the cache.
            lanes = len(batched) * len(self.runs) // SIMD_WIDTH
            count = min(len(batched), max(lanes // 4, min(lanes, self.threads), 1))
            jobs.extend(
                functools.partial(
                    self._together, runs, [models[k] for k in part], [found[k] for k in part], [steps[k] for k in part]
                )
                for part in np.array_split(batched, count)
            )

        def do_jobs() -> None:
            # One wait a core: one a job would cost as much as a short replay.
            while True:
                try:
                    job = jobs.popleft()
                except IndexError:
                    return
                job()

        others = [self.pool.submit(do_jobs) for _ in range(min(self.threads, len(jobs)) - 1)]
        do_jobs()
        for other in others:
            other.result()
        return found

    def _by_start(self, models: list[Model], steps: list[float]) -> list[np.ndarray]:
        """The same of models whose runs begin differently: those that begin alike at a time."""
        found: dict[int, np.ndarray] = {}
        for start in dict.fromkeys(model.start for model in models):
            mine = [k for k, model in enumerate(models) if model.start == start]
            found |= zip(mine, self.residuals([models[k] for k in mine], [steps[k] for k in mine]))
        return [found[k] for k in range(len(models))]

    def _taken(self, model: Model, step_s: float) -> float:
        """Work that replays of all runs are: a step from row to row at the least. It hangs on the model, not on how
        many cores there are.
        """
        each = WAITING if model.waits else 1.0 if model.batched else ALONE
        return each * sum(
            max(float(data.inputs[0][-1] - data.inputs[0][0]) / step_s, len(data.inputs[0])) for data in self.runs
        )

    def _alone(self, model: Model, data: RunData, into: np.ndarray, step_s: float) -> None:
        self.run_residual(data, replay_run(model, data.inputs, step_s), into)

    def _together(self, runs: ReplayBatch, models: list[Model], into: list[np.ndarray], steps: list[float]) -> None:
        for found, outs in zip(into, runs.replay(models, steps)):
            for (data, rows), first, last in zip(self.rows, runs.rows, runs.rows[1:]):
                self.run_residual(data, outs[first:last], found[rows])

    def _batch(self, data: list[RunData]) -> ReplayBatch:
        """Some runs, all that are searched or all that are judged, as they are replayed by now."""
        inputs = [one.inputs for one in data]
        for kept in self._kept:
            if len(kept.inputs) == len(inputs) and all(a is b for a, b in zip(kept.inputs, inputs)):
                return kept
        # For what is searched and what is judged, of few starts.
        self._kept, self._gaps = [ReplayBatch(inputs), *self._kept[: STARTS_KEPT - 1]], {}
        return self._kept[0]

    def follow_angles(self, follow: bool) -> None:
        """Whether a ripple follows the measured angles, as it does in a search, or the replay's own, as the gap is
        judged.
        """
        self._follow = follow

    def judged(self, start: Start) -> list[tuple[RunData, int]]:
        """What an effect's worth is judged on, and the run that each is of: whole runs, of long ones the stretches that
        are searched, with commands as late in each run as they were fitted (`aligned_commands`)."""
        if start.lates or (self.searched < 1.0 and not self.pieces):
            return list(zip(self.begun(start), self.owners, strict=True))
        return [(data, k) for k, data in enumerate(self.whole_begun(start))]

    def gap(self, model: Model) -> float:
        """The contract's gap at the search's steps: of whole runs, of long ones of the stretches that are searched."""
        searched = self.searched < 1.0 and not self.pieces
        return self._gap(model, self.begun(model.start) if searched else self.whole_begun(model.start))

    def gap_as_fitted(self, model: Model) -> float:
        """The same with commands as late in each run as they were fitted, `aligned_commands`: what an effect is worth
        next to that.
        """
        return self._gap(model, [data for data, _ in self.judged(model.start)])

    def _gap(self, model: Model, judged: list[RunData]) -> float:
        runs = self._batch(judged)
        # The search asks for the gap of the same explanation time and again.
        asked = (
            runs,
            *(one.inputs[-1].tobytes() for one in judged),
            model.side.tobytes(),
            model.common.tobytes(),
            model.forms.tobytes(),
        )
        if asked not in self._gaps:
            self._gaps[asked] = self._gap_of(model, judged, runs)
        return self._gaps[asked]

    def _gap_of(self, model: Model, judged: list[RunData], runs: ReplayBatch) -> float:
        if model.batched and runs.worth([model], self.threads):
            (out,) = runs.replay([model])
            outs = np.split(out, runs.rows[1:-1])
        else:
            outs = list(self.pool.map(lambda data: replay_run(model, data.inputs), judged))
        return gap(pooled([errors(data.log, self.robot, out) for data, out in zip(judged, outs)]))

    def with_nuisances(self, z: np.ndarray, start: Start) -> Model:
        """The nominal model with nuisances z (in units of their prior's sigma), whose runs begin as `start` says."""
        model = self.nominal.begun(start)
        for value, nuisance in zip(z, self.nuisances):
            nuisance.apply(model, float(value))
        return model
