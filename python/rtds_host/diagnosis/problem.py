"""A case as a fitting problem: its runs prepared (`residual`), replayed (`replayer`), and how they began estimated.

Nothing that a replay depends on changes after a problem is made, but for whether a ripple follows the measured angles.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from rtds_host.contract import Case, RunLog
from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.conditions import measured_turns
from rtds_host.diagnosis.effects import Effect, catalogue
from rtds_host.diagnosis.gate.cuts import start_row
from rtds_host.diagnosis.likelihood import Likelihood
from rtds_host.diagnosis.nuisances import nuisances_of
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
from rtds_host.diagnosis.replayer import STARTS_KEPT, Replayer
from rtds_host.diagnosis.residual import RunData, prepared, run_residual
from rtds_host.diagnosis.start import DECLARED, Start
from rtds_host.diagnosis.thresholds import MAJORITY, SIGNIFICANT

# Numerical: stretches whose residuals are counted as one draw are as long as the gap's windows; shorter where all runs
# together are, so that there are enough of them, of a few rows each.
LEAST_BLOCKS, ROWS_A_BLOCK = 100, 5
# Numerical: longer cases are searched in stretches: by then the models' errors, and not the samples, bound what can be
# learnt.
SEARCHED_S, SEARCHED_ROWS, STRETCH_S = 300.0, 80_000, 20.0
# A piece of an axis' run is as long as what is missing is remembered: what lasts longer is a scale, a bias or a load.
PIECE_S = 0.3
# Numerical: chi2 that chance alone does not bring.
CHI2 = SIGNIFICANT**2
# Numerical: lags that are tried in a run, in delays of the others.
LAGS = np.linspace(0.0, 3.0, 25)
# Places of an axis' measured state in a run's start (`start_state`).
STARTS = {"th_l": (3,), "w_l": (5, 9)}


class Problem:
    """Residuals of a case for any model, of whole runs or (of a single axis) of `pieces` of them.

    `by_run`: the likelihood has one unknown size a channel and run, in place of one a channel and block of time.

    `blocks`: (N,) which block of time a residual belongs to, over all runs; `runs_of`: (N,) which run;
    `channels_of`: (N,) index into `CHANNELS`; `rows`: each run and the rows of its residuals.
    """

    def __init__(self, case: Case, threads: int = 2, pieces: bool = False, by_run: bool = False):
        self.case = case
        # Its noise is that of the samples; `declared`: the noise of the file, the unit of a gap.
        self.robot, self.declared = case.robot, case.robot.as_declared
        self.nominal = nominal_model(case.robot)
        self.nuisances = nuisances_of(case, self.nominal)
        self.effects: dict[str, Effect] = catalogue(case.robot, case.runs)
        self.replayer = Replayer(case.robot, threads)
        self._runs_by_start: dict[tuple[Start, bool], tuple[list[RunData], list[RunData]]] = {}
        self._follow = False
        self._nuisanced: tuple[tuple[bytes, Start], Model] | None = None
        lasted = sum(float(log.t[-1] - log.t[0]) for log in case.runs)
        coarsest = max(float(np.median(np.diff(log.t))) for log in case.runs)
        self.block_s = min(gaps.WINDOW_S, max(lasted / LEAST_BLOCKS, ROWS_A_BLOCK * coarsest))
        self.pieces = pieces
        self.whole = [RunData(log, run_inputs(log, self.robot)) for log in case.runs]
        self.searched = min(1.0, SEARCHED_S / lasted, SEARCHED_ROWS / sum(len(log.t) for log in case.runs))
        self.runs, owners = [], []
        shortfall = 0.0  # of what is to be searched, s, what the runs so far did not give
        for k, log in enumerate(case.runs):
            if pieces:
                parts = self._pieces(log)
            elif self.searched < 1.0:
                shortfall += self.searched * float(log.t[-1] - log.t[0])
                parts = self._stretches(log, shortfall)
                shortfall -= sum(float(part.log.t[-1] - part.log.t[0]) for part in parts)
            else:
                parts = [self._prepared(log, run_inputs(log, self.robot))]
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
    def start_gap(self) -> float:
        """The gap that the noise of the first row makes over whole runs: of an axis, between replays of the nominal
        robot that start one sigma of each of its sensors apart; 0 of a robot, which also stands at first.

        It is large where the motion is unstable: errors of the start then grow exponentially, and with them the number
        of local minima of any fit (A. H. Ribeiro et al., Automatica 121, 109158, 2020).
        """
        errors: list[dict[str, gaps.Squares]] = []
        for data in self.whole if self.robot.axis is not None else ():
            *others, start = data.inputs
            nominal = gaps.errors(data.log, self.robot, replay_run(self.nominal, data.inputs))
            for channel, places in STARTS.items():
                moved = start.copy()
                moved[list(places)] += self.robot.noise(channel) or 0.0
                found = gaps.errors(data.log, self.robot, replay_run(self.nominal, (*others, moved)))
                errors.append({c: gaps.squares(error - nominal[c]) for c, error in found.items()})
        return math.sqrt(len(STARTS)) * gaps.gap(gaps.pooled(errors)) if errors else 0.0

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
            self._prepared(log.rows(first, last), piece_inputs(log, self.robot, first, last))
            for first, last in bounds or [(0, len(log.t))]
        ]

    def _stretches(self, log: RunLog, shortfall: float) -> list[RunData]:
        """Stretches from all over a long run, the run's beginning among them, so that a search takes no longer than of
        short ones.

        shortfall : s, what is to be searched of it and was not of the runs before. No stretch is shorter than two
        windows of an angle: of runs whose share is less some have one, short ones the whole of them, and the others
        none.
        """
        lasted = float(log.t[-1] - log.t[0])
        share, shortest, parts = lasted * self.searched, min(2.0 * gaps.WINDOW_S, lasted), []
        count = math.ceil(share / STRETCH_S) if share >= shortest else int(shortfall >= 0.5 * shortest)
        length = max(share / max(count, 1), shortest)
        for k in range(count):
            begin = log.t[0] + k * lasted / count
            first, last = np.searchsorted(log.t, (begin, begin + length + 1e-9))
            if k > 0:
                first = start_row(log, self.case, np.arange(first, last))
            if first is not None and last - first >= ROWS_A_BLOCK:
                parts.append(
                    self._prepared(
                        log.rows(int(first), int(last)), stretch_inputs(log, self.robot, int(first), int(last))
                    )
                )
        return parts

    def _prepared(self, log: RunLog, inputs: tuple[np.ndarray, ...]) -> RunData:
        return prepared(log, inputs, self.robot, self.block_s)

    @functools.cached_property
    def turns(self) -> dict[str, float]:
        """Turns of each side's wheel in the runs, see `measured_turns`."""
        return {side: measured_turns(self.case, side) for side in self.robot.sides}

    @property
    def threads(self) -> int:
        """Threads that replays share."""
        return self.replayer.threads

    @property
    def work(self) -> float:
        """Done on residuals so far, in steps of a replay in a batch."""
        return self.replayer.work

    @property
    def pool(self) -> ThreadPoolExecutor:
        """The replayer's threads, for other work over runs."""
        return self.replayer.pool

    def runs_starting(self, start: Start) -> list[RunData]:
        """The searched runs, which begin as `start` says. Pieces start from measured states, which nothing changes."""
        return self._started(start)[0]

    def whole_runs_starting(self, start: Start) -> list[RunData]:
        """All runs from end to end, at the headings of `start`: a gap is with speeds as measured and with commands when
        they were given."""
        return self._started(start)[1]

    def _started(self, start: Start) -> tuple[list[RunData], list[RunData]]:
        start = DECLARED if self.pieces else start
        key = start, self._follow
        if key not in self._runs_by_start:
            headings, speeds, command_delays = dict(start.headings), dict(start.speeds), dict(start.command_delays)

            def of(data: RunData, searched: bool) -> RunData:
                state, t_cmd, angles = data.inputs[-1].copy(), data.inputs[1], data.inputs[4]
                name = data.log.name
                state[2] = headings.get(name, state[2])
                if searched:
                    state[5] = state[9] = speeds.get((name, float(data.log.t[0])), state[5])
                    t_cmd = t_cmd + command_delays.get(name, 0.0)
                return replace(data, inputs=(data.inputs[0], t_cmd, *data.inputs[2:4], angles, data.inputs[5], state))

            searched = [of(data, True) for data in self.runs]
            if self._follow:
                logs = [self.whole[k].log for k in self.owners]
                searched = [replace(d, inputs=following(d.inputs, log)) for d, log in zip(searched, logs, strict=True)]
            while len(self._runs_by_start) >= STARTS_KEPT:
                del self._runs_by_start[next(iter(self._runs_by_start))]
            self._runs_by_start[key] = searched, [of(data, False) for data in self.whole]
        return self._runs_by_start[key]

    def _heading_misfit(self, data: RunData, model: Model, heading: float) -> float:
        start = data.inputs[-1].copy()
        start[2] = heading
        residual = run_residual(data, replay_run(model, (*data.inputs[:-1], start)))
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
            return run_residual(data, replay_run(model, (*data.inputs[:-1], moved)))

        initial = start[5]
        at = residual(initial)
        slope = (residual(initial + 0.3 * noise) - at) / (0.3 * noise)
        step = -(slope @ at + (initial - measured) / noise**2) / (slope @ slope + noise**-2)
        return float(np.clip(initial + step, measured - 3 * noise, measured + 3 * noise))

    def aligned(self, model: Model) -> Start:
        """The model's start with the heading estimated at which runs began whose log holds none, where it matters: on a
        slope.

        The contract has such runs begin at zero; a real one begins anywhere, and the slope then pulls another way than
        the replay's. An axis begins at a speed that is known to its sensor's noise only, which is estimated likewise.
        """
        runs = self.runs_starting(model.start)
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
        runs = self.runs_starting(model.start)
        found = {data.log.name: late for data in runs if (late := self._later(data, model, delay))}
        return model.start if 2 * len(found) >= len(runs) else model.start.with_command_delays(found)

    def _later(self, data: RunData, model: Model, delay: float) -> float:
        """By how much later than `delay` the commands of a run act, s; 0 where that does not explain most of its
        misfit.
        """
        was = dict(model.start.command_delays).get(data.log.name, 0.0)

        def missed(out: np.ndarray) -> float:
            residual = run_residual(data, out)
            return float(residual @ residual) - len(residual)

        def beyond(late: float) -> float:
            return missed(replay_run(model, (data.inputs[0], data.inputs[1] + late - was, *data.inputs[2:])))

        as_others = beyond(0.0)
        if as_others < CHI2:
            return 0.0
        extra = delay * (LAGS - 1.0)
        later = [model.copy() for _ in extra]
        for one, delay_more in zip(later, extra):
            one.add("command_delay", delay_more - was)
        values = [missed(out) for out in ReplayBatch([data.inputs]).replay(later)]
        k = int(np.argmin(values))
        from scipy.optimize import minimize_scalar  # a third of a second, which few cases have to spend

        best = minimize_scalar(
            beyond,
            bounds=(extra[max(k - 1, 0)], extra[min(k + 1, len(extra) - 1)]),
            method="bounded",
            options={"xatol": 1e-3},
        )
        return float(best.x) if best.fun < (1.0 - MAJORITY) * as_others else 0.0

    def lag_s(self, start: Start) -> float:
        """How well the mean of the runs' lags is known for what they scatter, one sigma, s."""
        if not start.command_delays:
            return 0.0
        each = [dict(start.command_delays).get(data.log.name, 0.0) for data in self.runs]
        return float(np.std(each, ddof=1)) / math.sqrt(len(each))

    def replay(self, model: Model, step_s: float | None = None) -> list[np.ndarray]:
        """Replays of all runs, each (n, 11), from the model's start; step_s : longest step, s, by default as needed."""
        return [replay_run(model, data.inputs, step_s) for data in self.runs_starting(model.start)]

    def residual(self, model: Model) -> np.ndarray:
        """Whitened residuals of all runs, (N,)."""
        return self.residuals([model])[0]

    def residuals(self, models: list[Model], steps: list[float] | None = None) -> list[np.ndarray]:
        """Residuals of several models, (N,) each, whose runs begin as each model's start says.

        steps : longest step of each, s, by default what it needs. What steps miss is nearly the same in models that are
        alike and take the same: those that are only compared with one another do with longer ones.
        """
        steps = steps or [model.step_s for model in models]
        if len({model.start for model in models}) > 1:
            return self._by_start(models, steps)
        runs = self.runs_starting(models[0].start if models else DECLARED)
        return self.replayer.residuals(runs, [rows for _, rows in self.rows], models, steps)

    def residual_of(self, model: Model, outs: Sequence[np.ndarray]) -> np.ndarray:
        """The residual (N,) of replays (n, 11) as `replay` gives them, with readings that were changed since."""
        return self.replayer.residual_of(self.runs_starting(model.start), [rows for _, rows in self.rows], outs)

    def _by_start(self, models: list[Model], steps: list[float]) -> list[np.ndarray]:
        """The same of models whose runs begin differently: those that begin alike at a time."""
        found: dict[int, np.ndarray] = {}
        for start in dict.fromkeys(model.start for model in models):
            mine = [k for k, model in enumerate(models) if model.start == start]
            found |= zip(mine, self.residuals([models[k] for k in mine], [steps[k] for k in mine]))
        return [found[k] for k in range(len(models))]

    def follow_angles(self, follow: bool) -> None:
        """Whether a ripple follows the measured angles, as it does in a search, or the replay's own, as the gap is
        judged.

        It is set for a whole phase and not with each call: all fits and comparisons of a search take the same.
        """
        self._follow = follow

    def judged(self, start: Start) -> list[tuple[RunData, int]]:
        """What an effect's worth is judged on, and the run that each is of: whole runs, of long ones the stretches that
        are searched, with commands as late in each run as they were fitted (`aligned_commands`)."""
        if start.command_delays or (self.searched < 1.0 and not self.pieces):
            return list(zip(self.runs_starting(start), self.owners, strict=True))
        return [(data, k) for k, data in enumerate(self.whole_runs_starting(start))]

    def gap(self, model: Model) -> float:
        """The gap at the search's steps: of whole runs, of long ones of the stretches that are searched; in units of
        the noise that samples show.
        """
        return self._gaps(model)[0]

    def declared_gap(self, model: Model) -> float:
        """The same in units of the declared noise (contract, section 4)."""
        return self._gaps(model)[1]

    def _gaps(self, model: Model) -> tuple[float, float]:
        searched = self.searched < 1.0 and not self.pieces
        return self.replayer.gaps(
            model, self.runs_starting(model.start) if searched else self.whole_runs_starting(model.start)
        )

    def gap_as_fitted(self, model: Model) -> float:
        """The same with commands as late in each run as they were fitted, `aligned_commands`: what an effect is worth
        next to that.
        """
        return self.replayer.gaps(model, [data for data, _ in self.judged(model.start)])[0]

    def with_nuisances(self, z: np.ndarray, start: Start) -> Model:
        """The nominal model with nuisances z (in units of their prior's sigma), whose runs begin as `start` says.

        The last one is kept, since the derivatives by effects ask for it again and again. Callers change a copy of it.
        """
        key = z.tobytes(), start
        if self._nuisanced is None or self._nuisanced[0] != key:
            model = self.nominal.with_start(start)
            for value, nuisance in zip(z, self.nuisances):
                nuisance.apply(model, float(value))
            self._nuisanced = key, model
        return self._nuisanced[1]
