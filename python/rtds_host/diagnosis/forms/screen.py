"""The screening of forms: what each would close on runs left out, by derivatives alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rtds_host.diagnosis.fit import Fit, prior_weight
from rtds_host.diagnosis.forms.curves import STEP, Form
from rtds_host.diagnosis.left_out import parted
from rtds_host.diagnosis.likelihood import Likelihood
from rtds_host.diagnosis.problem import Problem

# Numerical: residuals that are screened at most; of longer cases every so manieth block is.
ROWS = 60_000


@dataclass(frozen=True)
class Promise:
    """A form on a side: `left`, what it leaves of the cost of runs left out, a ratio; `start` (n,) its scaled
    coefficients."""

    form: Form
    side: str
    left: float
    start: np.ndarray


def columns(problem: Problem, fit: Fit, form: Form, side: tuple[int, ...], base: np.ndarray) -> np.ndarray:
    """Derivatives (N, n) of the residuals by a form's scaled coefficients on some sides, at coarse steps.

    base : (N,) residuals of the fit at the same steps.
    """
    effect, models = form.effect(), []
    begun = fit.model(problem)
    for p in effect.parameters:
        moved = begun.copy()
        effect.apply(moved, side, {q.name: STEP * q.prior_width if q is p else 0.0 for q in effect.parameters})
        models.append(moved)
    found = problem.residuals(models, [begun.coarse_s] * len(models))
    return np.stack([(one - base) / STEP for one in found], axis=1).astype(np.float32)


def screened(problem: Problem, fit: Fit, forms: list[Form]) -> list[Promise]:
    """All forms on all sides that they may have, most promising first."""
    begun = fit.model(problem)
    (base,) = problem.residuals([begun], [begun.coarse_s])
    keep = np.flatnonzero(fit.free)
    known = np.concatenate([fit.by_nuisance, fit.by_effect], axis=1)[:, keep]
    root = np.ones(problem.size) if fit.noise.root is None else fit.noise.root
    folds = [rows for mine in parted(problem) for *_, rows in mine if len(rows)]
    held = np.full(problem.size, -1)
    for k, rows in enumerate(folds):
        held[rows] = k
    thinned = np.arange(problem.size)
    if problem.size > ROWS:
        thinned = np.flatnonzero(problem.blocks % -(-problem.size // ROWS) == 0)
    held, root, residual = held[thinned], root[thinned], fit.residual[thinned]
    white, known = root * residual, root[:, None] * known[thinned]
    own = prior_weight(fit.z, fit.u)[keep]
    cost = _cost_of(problem, fit.noise, thinned)
    begins = _left_out(white, known, own, held, len(folds))[0]
    plain = cost(begins / root)
    found = []
    for form in forms:
        sides = {"both": tuple(range(len(problem.robot.sides)))}
        parts = [
            root[:, None] * columns(problem, fit, form, one, base)[thinned]
            for one in ([(k,) for k in sides["both"]] if form.effect().sided else [(0, 1)])
        ]
        tried = {"both": sum(parts[1:], parts[0])}
        if len(parts) == 2:
            tried |= {"left": parts[0], "right": parts[1]}
        for side, mine in tried.items():
            weight = np.concatenate([own, np.full(mine.shape[1], 2.0)])
            after, x = _left_out(white, np.hstack([known, mine]), weight, held, len(folds))
            found.append(Promise(form, side, cost(after / root) / plain, x[len(own) :]))
    return sorted(found, key=lambda one: one.left)


def _cost_of(problem: Problem, noise: Likelihood, rows: np.ndarray) -> Callable[[np.ndarray], float]:
    """-2 log likelihood of residuals in some rows, (m,), by a likelihood of all; plain squares without weights.

    Its own size in each group is estimated again. Squares with the weights of before would not do: they weigh a group
    by what it had, so that one which is explained now gains hardly more than one that is off by noise.
    """
    if noise.root is None:
        return lambda residual: float(residual @ residual)
    kept, groups = np.unique(noise.groups[rows], return_inverse=True)
    mine = Likelihood(groups, noise.samples[kept])
    return lambda residual: mine.estimated(residual).cost(residual)


def _left_out(
    white: np.ndarray, jacobian: np.ndarray, prior: np.ndarray, held: np.ndarray, folds: int
) -> tuple[np.ndarray, np.ndarray]:
    """Weighted residuals (N,) of parts left out in turn, and the step (n,) of a fit to all.

    white : (N,) weighted residuals; jacobian : (N, n) weighted derivatives; prior : (n,) curvature about no step; held
    : (N,) the part that each row is of.
    """
    grams = [jacobian[held == k].T @ jacobian[held == k] for k in range(folds)]
    slopes = [jacobian[held == k].T @ white[held == k] for k in range(folds)]
    gram, slope = sum(grams).astype(float) + np.diag(prior), sum(slopes).astype(float)
    after = white.astype(float)
    for k in range(folds):
        step = -np.linalg.solve(gram - grams[k], slope - slopes[k])
        after[held == k] += jacobian[held == k] @ step
    return after, -np.linalg.solve(gram, slope)
