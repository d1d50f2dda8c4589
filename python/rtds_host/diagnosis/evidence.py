"""What speaks for an explanation: its evidence, and what it gains on stretches it was not fitted to.

Explanations are compared by their evidence (Laplace's approximation: fit, price of each free parameter, prior odds
that count how many explanations of that size there are) on residuals whose weight is cut by the structure that even
the best explanation leaves, and an effect must also gain on stretches of the runs it was not fitted to. In-sample
likelihood alone would blame something in every case with correlated residuals.

References: D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4(3), 1992 (evidence and Occam factor).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.fit import Fit, Hypothesis
from rtds_host.diagnosis.problem import CHANNELS, Problem
from rtds_host.diagnosis.screen import Screen

# Prior odds: no effect, one, two, three.
PRIOR_BY_COUNT = {0: 0.25, 1: 0.55, 2: 0.17, 3: 0.03}
SIDE_PRIOR = {"both": 0.5, "left": 0.25, "right": 0.25}
NUISANCE_BAND = 0.03
# A free parameter that the data do not need costs at least this much of -2 log evidence.
PARSIMONY = 1.0
FOLD_S = 5.0
TRUSTED = 3.0


@dataclass
class Scored:
    """A fit with its standing: `score` = -2 log(evidence x prior)."""

    fit: Fit
    score: float
    probability: float = 0.0


@dataclass
class Choice:
    """What the search found: explanations best first, the refit without effect, the dispersion they were judged by, all
    fits, the screening about the refit, and by explanation what each effect promised to add to it (chi2 over dispersion).
    """

    base: Fit
    ranked: list[Scored]
    dispersion: float
    fits: dict[Hypothesis, Fit] = field(default_factory=dict)
    screen: Screen | None = None
    growth: dict[Hypothesis, dict[str, float]] = field(default_factory=dict)


def dispersion(problem: Problem, residual: np.ndarray, jacobian: np.ndarray) -> float:
    """Variance of block sums of the residuals over that of white noise, pooled over channels, at least 1.

    The mean of squares and the squared sums over blocks of 1 s (correlated errors add up within a block).
    """
    worst = float(np.mean(residual**2)) * len(residual) / max(len(residual) - jacobian.shape[1], 1)
    key = problem.blocks * len(CHANNELS) + problem.channels_of
    sums = np.bincount(key, residual)
    counts = np.bincount(key)
    used = counts > 0
    ratios = sums[used] ** 2 / counts[used]
    # A few blocks of a fast transient must not hide a perfect rest: the mean, but of a limited ratio.
    block = float(np.mean(np.minimum(ratios, 50.0 * max(np.median(ratios), 0.45))))
    worst = max(worst, block)
    return worst if worst > 1.15 else 1.0


def structure(problem: Problem, residual: np.ndarray) -> float:
    """How much structure is left: variance of 1 s block sums over that of white noise, pooled; 1 for white noise."""
    key = problem.blocks * len(CHANNELS) + problem.channels_of
    sums, counts = np.bincount(key, residual), np.bincount(key)
    used = counts > 0
    return float(np.mean(sums[used] ** 2 / counts[used]))


def log_prior(hypothesis: Hypothesis, effects: int) -> float:
    """Log prior probability of an explanation, among explanations of its size."""
    count = len(hypothesis)
    value = np.log(PRIOR_BY_COUNT.get(count, 0.003))
    for k, (effect, side) in enumerate(hypothesis):
        odds = SIDE_PRIOR[side] if CATALOGUE[effect].sided else 1.0
        value += np.log(odds / max(effects - k, 1)) + np.log(k + 1)
    return float(value)


def score(fit: Fit, effects: int, scale: float) -> float:
    """-2 log of evidence and prior (up to a constant of the case), residuals weighted by 1 / scale."""
    precision = fit.gram / scale
    prior = fit.prior_precision()
    # Parameters on a bound are held there.
    keep = np.flatnonzero(fit.free)
    inside = precision[np.ix_(keep, keep)] / np.sqrt(np.outer(prior[keep], prior[keep])) + np.eye(len(keep))
    occam = float(np.linalg.slogdet(inside)[1])
    return (fit.chi2 / scale + fit.prior + occam + PARSIMONY * len(fit.u) - 2 * log_prior(fit.hypothesis, effects))


def named(fit: Fit) -> bool:
    """Whether each effect is big enough to be named: a `ratio` within 3 % of 1 on R, K, J or B is a nuisance."""
    for (effect, _), values in zip(fit.hypothesis, fit.values):
        if CATALOGUE[effect].nuisance and abs(values["ratio"] - 1.0) <= NUISANCE_BAND:
            return False
    return True


def folds(problem: Problem) -> np.ndarray:
    """Stretches of about 5 s of a run, (N,): what is left out together."""
    per = max(int(FOLD_S), 1)
    starts = np.zeros(problem.block_count, int)
    fold = 0
    first = 0
    for run in problem.runs:
        count = int(run.block.max(initial=-1)) + 1
        pieces = max(1, round(count / per))
        starts[first:first + count] = fold + np.minimum(np.arange(count) * pieces // max(count, 1), pieces - 1)
        first += count
        fold += pieces
    return starts[problem.blocks]


def held_out(problem: Problem, fit: Fit, fold_of: np.ndarray) -> np.ndarray:
    """Squared residuals summed by block, each fold predicted from a fit to the others (one linear step)."""
    jacobian = fit.jacobian.astype(float)
    keep = np.flatnonzero(fit.free)
    precision = fit.precision()[np.ix_(keep, keep)]
    # A linear step is trusted for a few of its sigmas: where the misfit is rough, its derivatives are no guide.
    limit = TRUSTED * np.sqrt(np.diag(np.linalg.inv(precision)))
    out = fit.residual.copy()
    for fold in range(fold_of.max() + 1):
        rows = np.flatnonzero(fold_of == fold)
        if not len(rows):
            continue
        j = jacobian[np.ix_(rows, keep)]
        rest = precision - j.T @ j / fit.dispersion
        step = np.linalg.solve(rest + 1e-9 * np.diag(np.diag(precision)), j.T @ fit.residual[rows] / fit.dispersion)
        step = np.clip(step, -limit, limit)
        out[rows] = fit.residual[rows] + j @ step
    return np.bincount(problem.blocks, out * out, minlength=problem.block_count)
