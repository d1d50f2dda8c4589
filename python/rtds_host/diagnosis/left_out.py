"""What an explanation foretells of runs that it was not fitted to (contract, sections 4 and 5).

The fit without a run is a few steps from the fit to all; of a single run each half is left out in turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.fit import Fit, parameters, prior_weight
from rtds_host.diagnosis.problem import Problem, RunData
from rtds_host.diagnosis.replay.model import Model, replay_run

# Numerical: steps of a fit without a part, and for how many of its sigmas one is trusted.
STEPS, TRUSTED = 2, 3.0


def left_out(problem: Problem, fit: Fit, parts: Sequence[np.ndarray]) -> list[Model]:
    """The explanation fitted without each of some parts of the residuals: rows (m,) each, all N of them together.

    Gauss-Newton steps with the derivatives of the fit to all; the weights of the likelihood are those of the residuals
    that are left, since a run that is left out no longer bends the others.
    """
    keep = np.flatnonzero(fit.free)
    jacobian = np.concatenate([fit.by_nuisance, fit.by_effect], axis=1)[:, keep]
    moves, residuals, models = [np.zeros(len(fit.free)) for _ in parts], [fit.residual] * len(parts), []
    at = np.concatenate([fit.z, fit.u])
    for turn in range(STEPS):
        if turn:
            residuals = problem.residuals(models)
        models = []
        for move, residual, rows in zip(moves, residuals, parts, strict=True):
            noise = fit.noise.estimated(residual)
            root = np.ones(len(residual)) if noise.root is None else noise.root
            used = root.copy()
            used[rows] = 0.0
            weighted = jacobian * used.astype(np.float32)[:, None]
            prior = np.diag(prior_weight(fit.z, fit.u)[keep])
            hessian = (weighted.T @ weighted).astype(float) + prior
            pull = prior @ (at + move)[keep]
            gradient = (weighted.T @ (residual * used).astype(np.float32)).astype(float) + pull
            if not turn:
                # The fit to all is an optimum but for what its last step left.
                own = jacobian * root.astype(np.float32)[:, None]
                gradient -= (own.T @ (residual * root).astype(np.float32)).astype(float) + pull
            sigma = np.sqrt(np.diag(np.linalg.inv(hessian)))
            move[keep] -= np.clip(np.linalg.solve(hessian, gradient), -TRUSTED * sigma, TRUSTED * sigma)
            models.append(_moved(problem, fit, move))
    return models


def _moved(problem: Problem, fit: Fit, move: np.ndarray) -> Model:
    """A fit's model with its parameters moved, (k + p,), within their bounds."""
    k = len(fit.z)
    u = fit.u + move[k:]
    ps = [p for _, _, p in parameters(fit.effects, fit.hypothesis)]
    if ps:
        u = np.clip(u, [p.scaled(p.low) for p in ps], [p.scaled(p.high) for p in ps])
    z = np.clip(fit.z + move[:k], [n.low for n in problem.nuisances], [n.high for n in problem.nuisances])
    return replace(fit, z=z, u=u).model(problem)


def parted(problem: Problem) -> list[list[tuple[int, int, np.ndarray]]]:
    """What is left out at once, a list a run: first and last row of its log and the rows (m,) of the residuals that go
    with them; none of a single run whose halves are too short to have a gap."""
    runs = [np.flatnonzero(problem.runs_of == k) for k in range(len(problem.whole))]
    if len(runs) > 1:
        return [[(0, len(data.log.t), mine)] for data, mine in zip(problem.whole, runs, strict=True)]
    # Half of what is searched, which of a long run is not half of its rows.
    log, t = problem.whole[0].log.t, np.concatenate([data.time for data in problem.runs])
    middle = float(np.median(t))
    row, early = int(np.searchsorted(log, middle)), t < middle
    halves = problem.whole[0].log.rows(0, row), problem.whole[0].log.rows(row, len(log))
    if not all(len(half.t) and gaps.counts(half, problem.robot) for half in halves):
        return [[(0, len(log), np.empty(0, int))]]
    return [[(0, row, np.flatnonzero(early)), (row, len(log), np.flatnonzero(~early))]]


def left_out_channels(problem: Problem, fit: Fit) -> dict[str, float]:
    """The gap of an explanation by channel on runs left out in turn, at the search's steps, with commands as late in
    each as they were fitted.
    """
    parts = parted(problem)
    models = iter(left_out(problem, fit, [rows for mine in parts for *_, rows in mine]))
    jobs = []
    for k, mine in enumerate(parts):
        t = problem.whole[k].log.t
        for first, last, _ in mine:
            model = next(models)
            for data in (data for data, owner in problem.judged() if owner == k):
                # Of a stretch of a long run what lies in this part.
                begin, end = np.searchsorted(data.log.t, t[[first, last - 1]])
                if end > begin:
                    jobs.append((model, data, int(begin), int(end) + 1))
    return gaps.pooled(list(problem.pool.map(lambda job: _errors(problem, *job), jobs)))


def left_out_gap(problem: Problem, fit: Fit) -> float:
    """The same over all channels."""
    return gaps.gap(left_out_channels(problem, fit))


def _errors(problem: Problem, model: Model, data: RunData, first: int, last: int) -> dict[str, gaps.Squares]:
    out = replay_run(model, data.inputs)[first:last]
    return {c: gaps.squares(error) for c, error in gaps.errors(data.log.rows(first, last), problem.robot, out).items()}
