"""Replays of many models over the runs of a case: worker threads, SIMD batches, and the gaps asked for before.

It holds nothing that an answer depends on: what a model's replay is follows from the model and the runs alone.
"""

from __future__ import annotations

import functools
import math
from collections import deque
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from rtds_host.contract import Robot
from rtds_host.diagnosis.comparison import Comparison
from rtds_host.diagnosis.effort import spend
from rtds_host.diagnosis.gap import errors, gap, pooled
from rtds_host.diagnosis.replay.model import Model, ReplayBatch, replay_run
from rtds_host.diagnosis.replay.simd import SIMD_WIDTH
from rtds_host.diagnosis.residual import RunData, run_residual

# Numerical: what a step takes where lanes wait for each other's free play, and whitening a residual, in steps of a
# replay in a batch; how much longer a step takes whose friction or bus needs its own result.
WAITING, WHITENED, ITERATED = 3.0, 0.35, 1.6
# Numerical: work, in the same unit, below which another thread takes longer to begin than it saves.
SHORT = 1e5
# Numerical: into how many shares the runs of models that go alone are parted, for all cores.
SHARES = 8
# Numerical: how often a share of the models fills all lanes.
LANES = 4
# Numerical: starts whose inputs are kept: the one that is searched, and those that it is compared with.
STARTS_KEPT = 4


class Replayer:
    """Replays runs of one robot; `work`: what was done on residuals so far, in steps of a replay in a batch."""

    def __init__(self, robot: Robot, threads: int):
        self.robot = robot
        self.threads = max(threads, 1)
        self.pool = ThreadPoolExecutor(self.threads)
        self.work = 0.0
        self._kept: list[ReplayBatch] = []
        self._comparisons: dict[ReplayBatch, Comparison] = {}
        self._gaps: dict[tuple, tuple[float, float]] = {}

    def residuals(
        self, runs: Sequence[RunData], rows: Sequence[slice], models: list[Model], steps: list[float]
    ) -> list[np.ndarray]:
        """Residuals of several models over some runs, each in its `rows` of the result, on all cores: shared out by
        runs, since there are often no more models than cores.

        steps : longest step of each, s.
        """
        size = rows[-1].stop
        found = [np.empty(size) for _ in models]
        taken = _taken(models, steps, runs) + len(models) * WHITENED * size
        self.work += taken
        spend(taken)
        threads = self.threads if taken > SHORT else 1
        # Those with springs or free play side by side: what one lane has is computed in all.
        batched = sorted(range(len(models)), key=lambda k: (models[k].slow, steps[k]))
        batch = self.batch(runs)
        alone = []
        if not batch.worth(models):
            alone, batched = sorted(batched), []
        # Few models keep all cores busy by parts of their runs.
        parts = math.ceil(SHARES / len(alone)) if alone and threads > 1 else 1
        shares = np.array_split(np.arange(len(runs)), min(len(runs), parts)) if alone else []
        compared = self._compared(batch, runs)
        jobs = deque(
            functools.partial(_alone, batch, compared, rows, (mine[0], mine[-1] + 1), models[k], found[k], steps[k])
            for k in alone
            for mine in shares
        )
        if batched:
            jobs.extend(
                functools.partial(
                    _together,
                    batch,
                    compared,
                    rows,
                    [models[k] for k in part],
                    [found[k] for k in part],
                    [steps[k] for k in part],
                )
                for part in np.split(batched, shares_of(len(batched), len(runs), threads))
            )

        def do_jobs() -> None:
            # One wait a core: one a job would cost as much as a short replay.
            while True:
                try:
                    job = jobs.popleft()
                except IndexError:
                    return
                job()

        others = [self.pool.submit(do_jobs) for _ in range(min(threads, len(jobs)) - 1)]
        do_jobs()
        for other in others:
            other.result()
        return found

    def residual_of(self, runs: Sequence[RunData], rows: Sequence[slice], outs: Sequence[np.ndarray]) -> np.ndarray:
        """The residual (N,) of given replays (n, 11) of some runs, each in its `rows` of the result."""
        found = np.empty(rows[-1].stop)
        taken = WHITENED * len(found)
        self.work += taken
        spend(taken)
        for run, mine, out in zip(runs, rows, outs, strict=True):
            run_residual(run, out, found[mine])
        return found

    def batch(self, data: Sequence[RunData]) -> ReplayBatch:
        """Some runs, all that are searched or all that are judged, for replays in a batch."""
        inputs = [one.inputs for one in data]
        for kept in self._kept:
            if len(kept.inputs) == len(inputs) and all(a is b for a, b in zip(kept.inputs, inputs)):
                return kept
        # For what is searched and what is judged, of few starts.
        self._kept, self._gaps = [ReplayBatch(inputs), *self._kept[: STARTS_KEPT - 1]], {}
        return self._kept[0]

    def _compared(self, batch: ReplayBatch, runs: Sequence[RunData]) -> Comparison:
        """What the residual of a batch's runs compares, which does not depend on where they begin."""
        if batch not in self._comparisons:
            self._comparisons = {kept: found for kept, found in self._comparisons.items() if kept in self._kept}
            self._comparisons[batch] = Comparison.of(runs)
        return self._comparisons[batch]

    def gaps(self, model: Model, judged: Sequence[RunData]) -> tuple[float, float]:
        """The gap over some runs in units of the noise that samples show, and of the declared one."""
        runs = self.batch(judged)
        # The search asks for the gap of the same explanation time and again.
        asked = (
            runs,
            *(one.inputs[-1].tobytes() for one in judged),
            model.side.tobytes(),
            model.common.tobytes(),
            model.forms.tobytes(),
        )
        if asked not in self._gaps:
            self._gaps[asked] = self._gaps_of(model, judged, runs)
        return self._gaps[asked]

    def _gaps_of(self, model: Model, judged: Sequence[RunData], runs: ReplayBatch) -> tuple[float, float]:
        if runs.worth([model]):
            (out,) = runs.replay([model])
            outs = np.split(out, runs.rows[1:-1])
        else:
            outs = list(self.pool.map(lambda data: replay_run(model, data.inputs), judged))
        shown, declared = (
            gap(pooled([errors(data.log, robot, out) for data, out in zip(judged, outs)]))
            for robot in (self.robot, self.robot.as_declared)
        )
        return shown, declared


def shares_of(models: int, runs: int, threads: int) -> list[int]:
    """Where shares of models begin that are replayed on all runs, but for the first: lanes are to be full, and shares
    for all cores, but none so large that its replays leave the cache."""
    lanes = models * runs // SIMD_WIDTH
    count = min(models, max(lanes // LANES, min(lanes, threads), 1))
    size = math.ceil(models / count)
    if count > threads:
        # So many fill all lanes to the end, where runs are of one length.
        full = SIMD_WIDTH // math.gcd(runs, SIMD_WIDTH)
        size = max(size - size % full, min(full, models))
    return list(range(size, models, size))


def _taken(models: Sequence[Model], steps: Sequence[float], runs: Sequence[RunData]) -> float:
    """Work that replays of all runs are: a step from row to row at the least. It depends on the models, not on how
    many cores there are.

    steps : longest step of each model, s.
    """
    spans = [(float(data.inputs[0][-1] - data.inputs[0][0]), len(data.inputs[0])) for data in runs]
    known: dict[float, float] = {}
    total = 0.0
    for model, longest in zip(models, steps, strict=True):
        step_s = min(longest, model.get("servo_period")) if model.has_servo else longest
        if step_s not in known:
            known[step_s] = sum(max(span / step_s, rows) for span, rows in spans)
        total += (WAITING if model.waits else 1.0) * (ITERATED if model.iterated else 1.0) * known[step_s]
    return total


def _alone(
    batch: ReplayBatch,
    compared: Comparison,
    rows: Sequence[slice],
    share: tuple[int, int],
    model: Model,
    into: np.ndarray,
    step_s: float,
) -> None:
    """Fill in the residual of a share of the runs, from one to before another."""
    first, last = share
    out = batch.replay_alone(model, first, last, step_s)
    compared.residual(out, int(batch.rows[first]), slice(rows[first].start, rows[last - 1].stop), into)


def _together(
    batch: ReplayBatch,
    compared: Comparison,
    rows: Sequence[slice],
    models: list[Model],
    into: list[np.ndarray],
    steps: list[float],
) -> None:
    for found, out in zip(into, batch.replay(models, steps)):
        compared.residual(out, 0, slice(0, rows[-1].stop), found)
