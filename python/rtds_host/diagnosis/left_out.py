"""What an explanation predicts of runs that it was not fitted to (contract, sections 4 and 5).

Each run is left out in turn, of a single run each half, and the explanation is fitted to the others by a few steps from
the fit to all (`left_out_in_few_steps`). Where such a step fails, the sizes stay as the run itself asked for, and its
prediction is too good. Where that matters, the explanation is fitted to the others until it converges (`left_out`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.fit import Fit, Fitter, Requesting, parameters, prior_weight, side_by_side
from rtds_host.diagnosis.likelihood import multiply_into
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import Model, replay_run
from rtds_host.diagnosis.residual import CHANNELS, RunData, run_residual

# Squares of the errors of one part that was left out, by channel.
Errors = Mapping[str, gaps.Squares]
# Numerical: steps of a fit without a part, for how many of its sigmas one is trusted, and how many make a next one
# needless: the derivatives hold over a part of a sigma.
STEPS, TRUSTED, SHORT = 2, 3.0, 0.25


def left_out(problem: Problem, fit: Fit, parts: Sequence[np.ndarray]) -> list[Model]:
    """The explanation fitted without each of some parts of the residuals: rows (m,) each, all N of them together.

    By a few steps from the fit to all; where one of them fails, to convergence.
    """
    models, failed = left_out_in_few_steps(problem, fit, parts)
    again = [k for k, one in enumerate(failed) if one]
    for k, model in zip(again, _converged(problem, fit, [parts[k] for k in again]), strict=True):
        models[k] = model
    return models


def _converged(problem: Problem, fit: Fit, parts: Sequence[np.ndarray]) -> list[Model]:
    """The explanation fitted to convergence without each of some parts, by the objective that it was fitted by.

    An effect that the others do not show keeps its size: they can neither support nor refute it.
    """
    works = []
    for rows in parts:
        seen = np.ones(len(fit.residual), np.float32)
        seen[rows] = 0.0
        fitter = Fitter(problem, fit.start)
        fitter.effects = fit.effects
        by_nuisance = fit.by_nuisance * seen[:, None]
        plain = fit.noise.root is None
        held = _not_shown(fit, seen)
        work = fitter.fitting(fit.hypothesis, fit.u, fit.z, fit.noise, fixed=plain, by_nuisance=by_nuisance, held=held)
        works.append(_seeing(work, seen))
    return [found.model(problem) for found in side_by_side(problem, works)]


def _not_shown(fit: Fit, seen: np.ndarray) -> list[tuple[str, str]]:
    """Effects of which some residuals, where `seen` (N,) is one, say less than their priors."""
    weighted = (_root(fit, fit.residual) * seen)[:, None] * fit.by_effect
    shown = (weighted**2).sum(axis=0) > prior_weight(fit.z, fit.u)[len(fit.z) :]
    causes = [(effect.id, side) for effect, side, _ in parameters(fit.effects, fit.hypothesis)]
    return [cause for cause in fit.hypothesis if not any(shown[j] for j, of in enumerate(causes) if of == cause)]


def _seeing(work: Requesting[Fit], seen: np.ndarray) -> Requesting[Fit]:
    """A fit to some of the residuals: of the others, where `seen` (N,) is zero, it gets none."""
    try:
        asked = next(work)
        while True:
            found = yield asked
            asked = work.send([residual * seen for residual in found])
    except StopIteration as end:
        return end.value


def left_out_in_few_steps(problem: Problem, fit: Fit, parts: Sequence[np.ndarray]) -> tuple[list[Model], list[bool]]:
    """The explanation fitted without each of some parts of the residuals, and for which of them the last step failed.

    Gauss-Newton steps with the derivatives of the fit to all; the weights of the likelihood are those of the residuals
    that are left, since a run that is left out no longer bends the others. Only steps that lower the cost of the rows
    that are left are taken: steps that come late have kinks, across which a derivative leads astray.
    """
    keep = np.flatnonzero(fit.free)
    others = [np.ones(len(fit.residual), bool) for _ in parts]
    for other, rows in zip(others, parts, strict=True):
        other[rows] = False
    moves = [np.zeros(len(fit.free)) for _ in parts]
    best, taken = list(moves), [_cost(fit, fit.residual, other) for other in others]
    residuals, going = [fit.residual] * len(parts), list(range(len(parts)))
    failed = [False] * len(parts)
    for turn in range(STEPS):
        if not going:
            break
        if turn:
            asked = [_asked(fit, keep, residuals[k], [*parts[:k], *parts[k + 1 :]], moves[k]) for k in going]
        else:
            asked = _asked_at_fit(fit, keep, parts)
        steps = [_step(fit, keep, *one) for one in asked]
        for k, (step, _) in zip(going, steps, strict=True):
            moves[k] = moves[k] + step
        found = problem.residuals([_moved(problem, fit, moves[k]) for k in going])
        for k, residual, (_, sigmas) in zip(going, found, steps, strict=True):
            residuals[k], cost = residual, _cost(fit, residual, others[k])
            failed[k] = sigmas > SHORT and cost >= taken[k]
            if cost < taken[k]:
                best[k], taken[k] = moves[k], cost
        going = [k for k, (_, sigmas) in zip(going, steps, strict=True) if sigmas > SHORT]
    return [_moved(problem, fit, move) for move in best], failed


def _cost(fit: Fit, residual: np.ndarray, others: np.ndarray) -> float:
    """-2 log likelihood of some of the residuals, `others` (N,) of bool."""
    noise = fit.noise.estimated(residual)
    white = np.where(others, noise.whiten(residual), 0.0)
    return float(white @ white + noise.log[others].sum())


def _root(fit: Fit, residual: np.ndarray) -> np.ndarray:
    """Square roots (N,) of the weights of the likelihood at some residuals."""
    root = fit.noise.estimated(residual).root
    return np.ones(len(residual)) if root is None else root


def _normal(
    fit: Fit, keep: np.ndarray, residual: np.ndarray, root: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Hessian (p, p) and gradient (p,) of half the weighted squares of some rows (m,), by the parameters to `keep`."""
    # A run's rows are neighbours: a view of them need not be gathered.
    there = slice(rows[0], rows[-1] + 1) if len(rows) and rows[-1] - rows[0] + 1 == len(rows) else rows
    columns, mine = [*fit.by_nuisance.T, *fit.by_effect.T], root[there]
    jacobian = np.empty((len(rows), len(keep)), order="F")
    for j, into in zip(keep, jacobian.T, strict=True):
        multiply_into(columns[j][there], mine, into)
    return jacobian.T @ jacobian, jacobian.T @ (mine * residual[there])


def _asked_at_fit(fit: Fit, keep: np.ndarray, parts: Sequence[np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Hessian (p, p) and gradient (p,) of half the cost of all rows but those of each part, at the fit to all: an
    optimum, so what its last step left is no part of what the others ask for."""
    root, prior = _root(fit, fit.residual), np.diag(prior_weight(fit.z, fit.u)[keep])
    found = [_normal(fit, keep, fit.residual, root, rows) for rows in parts]
    return [
        (sum((hessian for j, (hessian, _) in enumerate(found) if j != k), prior), -gradient)
        for k, (_, gradient) in enumerate(found)
    ]


def _asked(
    fit: Fit, keep: np.ndarray, residual: np.ndarray, others: Sequence[np.ndarray], move: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Hessian (p, p) and gradient (p,) of half the cost of the rows of some parts, `others`, where `move` led."""
    root = _root(fit, residual)
    at, weight = (np.concatenate([fit.z, fit.u]) + move)[keep], prior_weight(fit.z, fit.u)[keep]
    hessian, gradient = np.diag(weight), weight * at
    for rows in others:
        own, pull = _normal(fit, keep, residual, root, rows)
        hessian, gradient = hessian + own, gradient + pull
    return hessian, gradient


def _step(fit: Fit, keep: np.ndarray, hessian: np.ndarray, gradient: np.ndarray) -> tuple[np.ndarray, float]:
    """A step of all parameters, (k + p,), towards the optimum, and how many sigmas it is; none where the rows that are
    left do not determine it."""
    sigma = np.sqrt(np.diag(np.linalg.inv(hessian)))
    step = np.zeros(len(fit.free))
    step[keep] = -np.clip(np.linalg.solve(hessian, gradient), -TRUSTED * sigma, TRUSTED * sigma)
    return step, float((np.abs(step[keep]) / sigma).max(initial=0.0))


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


@dataclass(frozen=True)
class Prediction:
    """A part of a run and the explanation as fitted without it: the run's index, first row and last (exclusive).

    converged : False where a step of that fit failed, so that its parameters are in part those of the fit to all.
    """

    run: int
    first: int
    last: int
    model: Model
    converged: bool = True


def predicted(problem: Problem, fit: Fit) -> list[Prediction]:
    """The explanation fitted without each run in turn; of a single run without each half."""
    parts = _in_turn(problem)
    models = left_out(problem, fit, [rows for *_, rows in parts])
    return [Prediction(k, first, last, model) for (k, first, last, _), model in zip(parts, models, strict=True)]


def predicted_in_few_steps(problem: Problem, fit: Fit) -> list[Prediction]:
    """The same by a few steps from the fit to all."""
    parts = _in_turn(problem)
    fitted = left_out_in_few_steps(problem, fit, [rows for *_, rows in parts])
    return [
        Prediction(k, first, last, model, not failed)
        for (k, first, last, _), model, failed in zip(parts, *fitted, strict=True)
    ]


def as_fitted(problem: Problem, fit: Fit) -> list[Prediction]:
    """The same parts and the explanation as it was fitted to all of them."""
    model = fit.model(problem)
    return [Prediction(k, first, last, model) for k, first, last, _ in _in_turn(problem)]


def _in_turn(problem: Problem) -> list[tuple[int, int, int, np.ndarray]]:
    """The parts of all runs, see `parted`: a run's index, first row, last (exclusive) and the rows of the residuals."""
    return [(k, *one) for k, mine in enumerate(parted(problem)) for one in mine]


def over_runs(problem: Problem, parts: Sequence[Prediction]) -> list[Errors]:
    """Errors by channel of each part that was left out, at the search's steps, with commands as late as fitted; the
    runs of all parts' models begin alike.
    """
    found: list[dict[str, gaps.Squares]] = [{} for _ in parts]
    if not parts:
        return list(found)
    judged = problem.judged(parts[0].model.start)
    jobs: list[tuple[int, int, slice]] = []  # a part, a run that is judged, and its rows of the part
    for k, one in enumerate(parts):
        t = problem.whole[one.run].log.t
        for n, (data, owner) in enumerate(judged):
            # Of a stretch of a long run what lies in this part.
            begin, end = np.searchsorted(data.log.t, t[[one.first, one.last - 1]])
            if owner == one.run and end > begin:
                jobs.append((k, n, slice(int(begin), int(end) + 1)))
    batch = problem.replayer.batch([data for data, _ in judged])
    outs = batch.replay_each([parts[k].model for k, *_ in jobs], [n for _, n, _ in jobs])
    for (k, n, rows), out in zip(jobs, outs, strict=True):
        log = judged[n][0].log.rows(rows.start, rows.stop)
        for channel, error in gaps.errors(log, problem.robot, out[rows]).items():
            more, before = gaps.squares(error), found[k].get(channel, gaps.Squares(0.0, 0))
            found[k][channel] = gaps.Squares(before.total + more.total, before.count + more.count)
    return list(found)


def over_pieces(problem: Problem, parts: Sequence[Prediction]) -> list[Errors]:
    """The same over pieces of an axis' runs that each start from the measured state; empty for a robot.

    The channels are those that the gap counts (contract, section 4): next to a speed, an angle has no vote.
    """
    if problem.robot.axis is None:
        return []
    pieces = problem.in_pieces
    owned: list[list[tuple[RunData, slice]]] = [[] for _ in problem.whole]
    for owner, of_piece in zip(pieces.owners, pieces.rows, strict=True):
        owned[owner].append(of_piece)

    def errors(one: Prediction) -> Errors:
        t = problem.whole[one.run].log.t
        mine = [
            (data, rows)
            for data, rows in owned[one.run]
            if data.log.t[-1] >= t[one.first] and data.log.t[0] <= t[one.last - 1]
        ]
        if not mine:
            return {}
        residual = np.concatenate([run_residual(data, replay_run(one.model, data.inputs)) for data, _ in mine])
        times, channels = (
            np.concatenate([values[rows] for _, rows in mine]) for values in (pieces.times, pieces.channels_of)
        )
        there = (times >= t[one.first]) & (times <= t[one.last - 1])
        counted = gaps.gap_channels(problem.whole[one.run].log, problem.robot)
        return {
            CHANNELS[c]: gaps.squares(residual[there & (channels == c)])
            for c in np.unique(channels[there])
            if CHANNELS[c] in counted
        }

    return list(problem.pool.map(errors, parts))


def left_out_channels(problem: Problem, fit: Fit) -> dict[str, float]:
    """The gap of an explanation by channel on runs left out in turn."""
    return gaps.pooled(over_runs(problem, predicted(problem, fit)))


def left_out_gap(problem: Problem, fit: Fit) -> float:
    """The same over all channels."""
    return gaps.gap(left_out_channels(problem, fit))
