"""What an explanation foretells of runs that it was not fitted to (contract, sections 4 and 5).

The fit without a run is one Newton step from the fit to all; of a single run each half is left out in turn.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.fit import Fit, parameters
from rtds_host.diagnosis.problem import Problem, RunData
from rtds_host.diagnosis.replay.model import Model, replay_run

# Numerical: one linear step is trusted for so many of its sigmas.
TRUSTED = 3.0


def left_out(problem: Problem, fit: Fit, parts: Iterable[np.ndarray]) -> list[Model]:
    """The explanation fitted without each of some parts of the residuals, given by their rows."""
    white, jacobian = fit.whitened()
    return [_without(problem, fit, white, jacobian, rows) for rows in parts]


def _without(problem: Problem, fit: Fit, white: np.ndarray, jacobian: np.ndarray, rows: np.ndarray) -> Model:
    keep = np.flatnonzero(fit.free)
    j = jacobian[np.ix_(rows, keep)].astype(float)
    precision = fit.precision[np.ix_(keep, keep)]
    rest = precision - j.T @ j
    step = np.zeros(len(fit.free))
    step[keep] = np.linalg.solve(rest + 1e-9 * np.diag(np.diag(precision)), j.T @ white[rows])
    # Where two delays can hardly be parted, rounding leaves a variance below nothing: what is known so badly stays as it is.
    sigma = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    step = np.clip(step, -TRUSTED * sigma - 1e-6, TRUSTED * sigma + 1e-6)
    k = len(fit.z)
    u = fit.u + step[k:]
    ps = [p for _, _, p in parameters(fit.effects, fit.hypothesis)]
    if ps:
        u = np.clip(u, [p.scaled(p.low) for p in ps], [p.scaled(p.high) for p in ps])
    z = np.clip(fit.z + step[:k], [n.low for n in problem.nuisances], [n.high for n in problem.nuisances])
    return replace(fit, z=z, u=u).model(problem)


def parted(problem: Problem) -> list[list[tuple[int, int, np.ndarray]]]:
    """What is left out at once, a list a run: first and last row of its log and the residuals that go with them."""
    runs = [np.flatnonzero(problem.runs_of == k) for k in range(len(problem.whole))]
    if len(runs) > 1:
        return [[(0, len(data.log.t), mine)] for data, mine in zip(problem.whole, runs, strict=True)]
    count, block = len(problem.whole[0].log.t), problem.blocks[runs[0]]
    early = block < np.median(block)
    return [[(0, count // 2, runs[0][early]), (count // 2, count, runs[0][~early])]]


def left_out_gap(problem: Problem, fit: Fit) -> float:
    """The gap of an explanation on runs left out in turn, at the search's steps, with commands as late in each as they were fitted."""
    parts = parted(problem)
    models = iter(left_out(problem, fit, [rows for mine in parts for *_, rows in mine]))
    jobs = []
    for k, mine in enumerate(parts):
        judged = [data for data, owner in problem.judged() if owner == k]
        for first, last, _ in mine:
            model, inside = next(models), problem.whole[k].log.t[first:last]
            if len(judged) == 1:
                jobs.append((model, judged[0], first, last))
            else:
                # Stretches of a long run: those that begin in what is left out.
                jobs += [(model, data, 0, len(data.log.t)) for data in judged if inside[0] <= data.log.t[0] <= inside[-1]]
    return gaps.gap(gaps.pooled(list(problem.pool.map(lambda job: _errors(problem, *job), jobs))))


def _errors(problem: Problem, model: Model, data: RunData, first: int, last: int) -> dict[str, gaps.Squares]:
    out = replay_run(model, data.inputs)[first:last]
    return {c: gaps.squares(error) for c, error in gaps.errors(data.log.rows(first, last), problem.robot, out).items()}
