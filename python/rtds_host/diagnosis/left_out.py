"""What an explanation foretells of runs that it was not fitted to (contract, sections 4 and 5).

The fit without a run is one Newton step from the fit to all; of a single run each half is left out in turn.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rtds_host.contract import RunLog
from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.fit import Fit, parameters
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import Model, replay_run

# Numerical: one linear step is trusted for so many of its sigmas.
TRUSTED = 3.0


def left_out(problem: Problem, fit: Fit, rows: np.ndarray, whitened: tuple[np.ndarray, np.ndarray] | None = None) -> Model:
    """The explanation fitted without some residuals, `rows` (n,); `whitened`: as of `fit.whitened`, where it is at hand."""
    white, jacobian = fit.whitened() if whitened is None else whitened
    keep = np.flatnonzero(fit.free)
    j = jacobian[np.ix_(rows, keep)].astype(float)
    precision = fit.precision[np.ix_(keep, keep)]
    rest = precision - j.T @ j
    step = np.zeros(len(fit.free))
    step[keep] = np.linalg.solve(rest + 1e-9 * np.diag(np.diag(precision)), j.T @ white[rows])
    sigma = np.sqrt(np.diag(fit.covariance))
    step = np.clip(step, -TRUSTED * sigma - 1e-6, TRUSTED * sigma + 1e-6)
    k = len(fit.z)
    u = fit.u + step[k:]
    ps = [p for _, _, p in parameters(fit.effects, fit.hypothesis)]
    if ps:
        u = np.clip(u, [p.scaled(p.low) for p in ps], [p.scaled(p.high) for p in ps])
    z = np.clip(fit.z + step[:k], [n.low for n in problem.nuisances], [n.high for n in problem.nuisances])
    return replace(fit, z=z, u=u).model(problem)


def parts_of(problem: Problem, log: RunLog, mine: np.ndarray) -> Iterator[tuple[int, int, np.ndarray]]:
    """What of a run is left out at once: first and last row of the log, and the residuals that go, of `mine` (n,), the run's."""
    if len(problem.whole) > 1:
        yield 0, len(log.t), mine
        return
    middle, half = len(log.t) // 2, np.median(problem.blocks[mine])
    yield 0, middle, mine[problem.blocks[mine] < half]
    yield middle, len(log.t), mine[problem.blocks[mine] >= half]


def left_out_gap(problem: Problem, fit: Fit) -> float:
    """The gap of an explanation on runs left out in turn, at the search's steps, with commands as late in each as they were fitted."""
    whitened = fit.whitened()

    def of_run(k: int) -> list[dict[str, gaps.Squares]]:
        mine, found = np.flatnonzero(problem.runs_of == k), []
        judged = [data for data, owner in problem.judged() if owner == k]
        for first, last, rows in parts_of(problem, problem.whole[k].log, mine) if len(judged) == 1 else [(0, None, mine)]:
            model = left_out(problem, fit, rows, whitened)
            for data in judged:
                out = replay_run(model, data.inputs)[first:last]
                log = data.log.rows(first, len(data.log.t) if last is None else last)
                found.append({c: gaps.squares(error) for c, error in gaps.errors(log, problem.robot, out).items()})
        return found

    return gaps.gap(gaps.pooled([part for parts in problem.pool.map(of_run, range(len(problem.whole))) for part in parts]))
