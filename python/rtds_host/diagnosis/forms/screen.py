"""The screening of forms: what each would close on runs left out, by derivatives alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rtds_host.diagnosis.fit import Fit, prior_weight
from rtds_host.diagnosis.forms.candidates import NEEDS, of_own_reading
from rtds_host.diagnosis.forms.curves import STEP, Form, shapes
from rtds_host.diagnosis.left_out import parted
from rtds_host.diagnosis.likelihood import Likelihood
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import Model
from rtds_host.plant.schema import OUTPUT_INDEX

# Numerical: residuals that are screened at most; of longer cases every so manieth block is.
ROWS = 60_000


@dataclass(frozen=True)
class FormCandidate:
    """A form on a side: `left`, what it leaves of the cost of runs left out, a ratio; `start` (n,) its scaled
    coefficients."""

    form: Form
    side: str
    left: float
    start: np.ndarray


@dataclass(frozen=True)
class Slopes:
    """Derivatives of the residuals by a form's scaled coefficients: `parts`, (N, n) each, of one side after the other;
    of both at once for what has no side."""

    form: Form
    parts: tuple[np.ndarray, ...]

    @property
    def sides(self) -> tuple[str, ...]:
        """Sides that the form may have."""
        return ("both", "left", "right") if len(self.parts) == 2 else ("both",)

    def of(self, side: str) -> np.ndarray:
        """Those on a side, (N, n)."""
        if side == "both":
            return self.parts[0] if len(self.parts) == 1 else self.parts[0] + self.parts[1]
        return self.parts[("left", "right").index(side)]


def columns(problem: Problem, fit: Fit, form: Form, side: tuple[int, ...], base: np.ndarray) -> np.ndarray:
    """Derivatives (N, n) of the residuals by a form's scaled coefficients on some sides, at coarse steps.

    base : (N,) residuals of the fit at the same steps.
    """
    effect, models = form.effect(), []
    unchanged = fit.model(problem)
    for p in effect.parameters:
        moved = unchanged.copy()
        effect.apply(moved, side, {q.name: STEP * q.prior_width if q is p else 0.0 for q in effect.parameters})
        models.append(moved)
    found = np.empty((len(base), len(models)), np.float32)
    for k, residual in enumerate(problem.residuals(models, [unchanged.coarse_s] * len(models))):
        found[:, k] = np.divide(np.subtract(residual, base, out=residual), STEP, out=residual)
    return found


def only_read(problem: Problem, fit: Fit, form: Form) -> bool:
    """Whether a form changes a sensor's reading alone, by a curve over that reading.

    A speed loop acts on the speed that it reads. Two forms of a sensor both run over its reading without either.
    """
    followed = problem.robot.driver.mode == "speed" and form.term == "speed_sensor"
    another = any(cause.startswith(f"form:{form.term}:") for cause, _ in fit.hypothesis)
    return of_own_reading(form.term, form.over) and not followed and not another


def columns_of_reading(
    problem: Problem, model: Model, outs: Sequence[np.ndarray], form: Form, side: tuple[int, ...], base: np.ndarray
) -> np.ndarray:
    """Derivatives (N, n) of the residuals by a form that `only_read` accepts: one replay with other readings.

    outs : replays (n, 11) of the model; base : (N,) their residual.
    """
    basis, widths = shapes(form.over)
    channels = NEEDS[form.term]
    at = [OUTPUT_INDEX[channels[k]] for k in side if k < len(channels)]
    found = np.empty((len(base), len(widths)), dtype=np.float32)
    for n, width in enumerate(widths):
        moved = [out.copy() for out in outs]
        for out in moved:
            for column in at:
                reading = out[:, column]
                # A curve jumps at zero, and is zero there.
                shape = np.where(reading == 0.0, 0.0, np.interp(reading, form.points, basis[:, n]))
                out[:, column] = reading + STEP * form.prior_width * width * shape
        found[:, n] = (problem.residual_of(model, moved) - base) / STEP
    return found


def slopes(problem: Problem, fit: Fit, forms: list[Form]) -> list[Slopes]:
    """Derivatives by all forms about a fit."""
    unchanged = fit.model(problem)
    (base,) = problem.residuals([unchanged], [unchanged.coarse_s])
    read = [form for form in forms if only_read(problem, fit, form)]
    outs = problem.replay(unchanged, unchanged.coarse_s) if read else []
    found = []
    for form in forms:
        each = [(k,) for k in range(len(problem.robot.sides))] if form.effect().sided else [(0, 1)]
        if form in read:
            parts = [columns_of_reading(problem, unchanged, outs, form, one, base) for one in each]
        else:
            parts = [columns(problem, fit, form, one, base) for one in each]
        found.append(Slopes(form, tuple(parts)))
    return found


def screened(problem: Problem, fit: Fit, known: Sequence[Slopes]) -> list[FormCandidate]:
    """All forms on all sides that they may have, those that leave least first.

    Parameters
    ----------
    known : derivatives by the forms, about this fit or one near it.
    """
    keep = np.flatnonzero(fit.free)
    common = np.concatenate([fit.by_nuisance, fit.by_effect], axis=1)[:, keep]
    root = np.ones(problem.size) if fit.noise.root is None else fit.noise.root
    folds = [rows for mine in parted(problem) for *_, rows in mine if len(rows)]
    held = np.full(problem.size, -1)
    for k, rows in enumerate(folds):
        held[rows] = k
    thinned = np.arange(problem.size)
    if problem.size > ROWS:
        thinned = np.flatnonzero(problem.blocks % -(-problem.size // ROWS) == 0)
    held, root, residual = held[thinned], root[thinned].astype(np.float32), fit.residual[thinned]
    white, common = root * residual, root[:, None] * common[thinned]
    own = prior_weight(fit.z, fit.u)[keep]
    cost = _cost_of(fit.noise, thinned)
    (begins, _), *_ = _left_out(white, common, own, held, len(folds), [np.eye(len(own))])
    plain = cost(begins / root)
    found = []
    for one in known:
        mine = np.hstack([common, *(root[:, None] * part[thinned] for part in one.parts)])
        maps = [_placed(len(own), one, side) for side in one.sides]
        weight = np.concatenate([own, np.full(one.parts[0].shape[1], 2.0)])
        steps = _left_out(white, mine, weight, held, len(folds), maps)
        found += [
            FormCandidate(one.form, side, cost(after / root) / plain, x[len(own) :])
            for side, (after, x) in zip(one.sides, steps, strict=True)
        ]
    return sorted(found, key=lambda candidate: candidate.left)


def distinct(found: Sequence[FormCandidate]) -> list[FormCandidate]:
    """Screened forms, of those that differ only in the time constant of a heat the first: it is moved later."""
    kept: dict[tuple[str, str, float | None], FormCandidate] = {}
    for one in found:
        kept.setdefault((one.form.id, one.side, None if one.form.tau else one.form.high), one)
    return list(kept.values())


def _placed(count: int, one: Slopes, side: str) -> np.ndarray:
    """(count + all parts' columns, count + n) where the coefficients of a form on a side go, behind `count` others."""
    n = one.parts[0].shape[1]
    sides = range(len(one.parts)) if side == "both" else [("left", "right").index(side)]
    found = np.zeros((count + n * len(one.parts), count + n))
    found[:count, :count] = np.eye(count)
    for k in sides:
        found[count + n * k : count + n * (k + 1), count:] = np.eye(n)
    return found


def _cost_of(noise: Likelihood, rows: np.ndarray) -> Callable[[np.ndarray], float]:
    """-2 log likelihood of residuals in some rows, (m,), by a likelihood of all; plain squares without weights.

    Its own size in each group is estimated again. Squares with the weights of before would not do: they weigh a group
    by what it had, so that one which is explained now gains hardly more than one that is off by noise.
    """
    if noise.root is None:
        return lambda residual: float(residual @ residual)
    kept, groups = np.unique(noise.groups[rows], return_inverse=True)
    mine = Likelihood(groups, noise.samples[kept])
    return mine.exact_cost


def _rows_of(held: np.ndarray, part: int) -> np.ndarray | slice:
    """The rows of a part that is left out: as a slice where they are neighbours, which need not be gathered."""
    rows = np.flatnonzero(held == part)
    return slice(rows[0], rows[-1] + 1) if len(rows) and rows[-1] - rows[0] + 1 == len(rows) else rows


def _left_out(
    white: np.ndarray, jacobian: np.ndarray, prior: np.ndarray, held: np.ndarray, folds: int, maps: list[np.ndarray]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Weighted residuals (N,) of parts left out in turn, and the step (n,) of a fit to all, of several sets of columns.

    white : (N,) weighted residuals; jacobian : (N, m) weighted derivatives; prior : (n,) curvature about no step; held
    : (N,) the part that each row is of; maps : (m, n) each, which columns a set has.
    """
    rows = [_rows_of(held, k) for k in range(folds)]
    parts = [jacobian[mine] for mine in rows]
    grams = [(part.T @ part).astype(float) for part in parts]
    slopes = [(part.T @ white[mine]).astype(float) for part, mine in zip(parts, rows, strict=True)]
    n = jacobian.shape[1]
    gram, slope = sum(grams, np.zeros((n, n))), sum(slopes, np.zeros(n))
    found = []
    for place in maps:
        after = white.astype(float)
        curved, level = place.T @ gram @ place + np.diag(prior), place.T @ slope
        for k, mine in enumerate(rows):
            step = -np.linalg.solve(curved - place.T @ grams[k] @ place, level - place.T @ slopes[k])
            after[mine] += parts[k] @ (place @ step).astype(np.float32)
        found.append((after, -np.linalg.solve(curved, level)))
    return found
