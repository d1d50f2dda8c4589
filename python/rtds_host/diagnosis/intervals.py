"""How well the sizes of an explanation's effects are known: 90 % intervals (contract, section 5).

One sigma is the root of the sum of

    (the largest variance of three: the likelihood's, and what follows from how residuals scatter between blocks of time
    and between runs) + (how far the size moves if residuals count as white noise in place of a discrepancy)^2 + (what
    formulations of the effect differ by)^2 + (what the size scatters by over the settings that it was met in, beyond
    chance)^2

and, of a delay, what stamps, links and a servo's latency leave open; of a sensor's lag, where within a row it measures:
a driver that takes its speed from one row's counts is late by half of that already. A size that depends on the
setting is no constant that is known better than it scatters; on a robot that is described to its noise nothing does.

Where something is left unexplained, its part along an effect's sensitivity was taken for a part of the effect. That
part is not seen, and it does not scatter between runs that move alike. What is missing is taken to resemble an effect
of the catalogue, nobody knows which: `bias` is the standard deviation, by the 68 % quantile, of the errors that these
would make, and is added in squares, too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from rtds_host.diagnosis.fit import Fit, parameters, prior_weight
from rtds_host.diagnosis.nuisances import LATENCY, LATENCY_S
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.scatter import scattered
from rtds_host.diagnosis.thresholds import Z90

# Numerical: share of its size that a change must differ by from what a fit can do.
DISTINCT = 1e-3

# An effect with its side, and one of its parameters.
Key = tuple[tuple[str, str], str]


def intervals(
    problem: Problem,
    fit: Fit,
    stamps_s: float = 0.0,
    row_s: float = 0.0,
    missing: Iterable[np.ndarray] = (),
) -> dict[Key, tuple[float, float] | None]:
    """The 90 % interval of each parameter of each effect, within its bounds; None of what may be anything that it can
    be.

    stamps_s : by how much stamps are off, s; row_s : from row to row, s; missing : changes of the residuals, (N,) each,
    by effects that the fit does not have.
    """
    if not fit.hypothesis:
        return {}
    sigma, free = dict(zip(_keys(fit), sigmas_of(problem, fit))), dict(zip(_keys(fit), fit.free[len(fit.z) :]))
    wrong = dict(zip(_keys(fit), bias(fit, missing)[len(fit.z) :]))
    uneven = scattered(problem, fit)
    # Commands have the same stamps as samples: a delay is known no better than these are, or than it is one in all
    # runs, or than the latency of a servo's board, which it is one sum with.
    latency_s = LATENCY_S if any(LATENCY.keys() & n.keys.keys() for n in problem.nuisances) else 0.0
    late = math.hypot(stamps_s, problem.lag_s(fit.start), latency_s)
    result: dict[Key, tuple[float, float] | None] = {}
    for cause, values in zip(fit.hypothesis, fit.values):
        effect = problem.effects[cause[0]]
        for p in effect.parameters:
            key, value = (cause, p.name), values[p.name]
            # Of what is absent far off, a stiff spring, a high limit, the size is the value itself.
            size = abs(value - p.null) if p.null in (0.0, 1.0) else abs(value)
            # Where in its row a sensor measures is known to the row.
            timed = (
                late
                if effect.subsystem == "timing"
                else row_s / math.sqrt(12.0)
                if effect.subsystem == "sensing" and p.unit == "s"
                else 0.0
            )
            spread = Z90 * math.hypot(
                math.hypot(sigma[key], wrong[key]) * p.slope(value),
                effect.form * size,
                timed,
                0.0 if p.shape else uneven[cause][0] * size,
            )
            low, high = max(value - spread, p.low), min(value + spread, p.high)
            result[key] = (low, high) if free[key] and (low > p.low or high < p.high) else None
    return result


def _keys(fit: Fit) -> list[Key]:
    return [((e.id, side), p.name) for e, side, p in parameters(fit.effects, fit.hypothesis)]


def _sandwich(fit: Fit, groups: np.ndarray) -> np.ndarray:
    """Variances of (z, u) that follow from how the residuals really scatter between groups of them, (k + p,).

    H. White, Econometrica 48, 1980, clustered: residuals may be correlated within a group.
    """
    white, jacobian = fit.whitened()
    keep = np.flatnonzero(fit.free)
    sums = np.zeros((int(groups.max(initial=0)) + 1, len(keep)))
    np.add.at(sums, groups, jacobian[:, keep].astype(float) * white[:, None])
    count = len(np.unique(groups))
    sums *= math.sqrt(count / max(count - 1, 1))
    bread = np.linalg.inv(fit.precision[np.ix_(keep, keep)])
    result = np.zeros(len(fit.free))
    result[keep] = np.diag(bread @ (sums.T @ sums) @ bread)
    return result


def command_shift(fit: Fit) -> np.ndarray:
    """How far (z, u) move, (k + p,), if residuals count as white noise in place of a discrepancy.

    J. A. Hausman, Econometrica 46, 1978: two estimates that weigh slow and fast misfits otherwise agree where the
    explanation is whole; what parts them is the residual that one of them took for an effect. Prior and dispersion are
    those of the fit.
    """
    keep = np.flatnonzero(fit.free)
    prior = np.diag(prior_weight(fit.z, fit.u)[keep])
    pull = prior @ np.concatenate([fit.z, fit.u])[keep]
    jacobian = np.concatenate([fit.by_nuisance, fit.by_effect], axis=1)[:, keep].astype(float)
    white, whitened = fit.whitened()
    whitened = whitened[:, keep].astype(float)
    dispersion = max(float(fit.residual @ fit.residual) / len(fit.residual), 1.0)
    moved = [
        np.linalg.solve(j.T @ j / scale + prior, j.T @ r / scale + pull)
        for j, r, scale in ((whitened, white, 1.0), (jacobian, fit.residual, dispersion))
    ]
    result = np.zeros(len(fit.free))
    result[keep] = moved[0] - moved[1]
    # A slope says nothing of where steps that come late would end.
    free = dict(zip(_keys(fit), fit.free[len(fit.z) :]))
    late = {
        (effect.id, side)
        for effect, side, p in parameters(fit.effects, fit.hypothesis)
        if p.steep and free[(effect.id, side), p.name]
    }
    result[len(fit.z) :][[cause in late for cause, _ in _keys(fit)]] = 0.0
    return result


def bias(fit: Fit, missing: Iterable[np.ndarray]) -> np.ndarray:
    """Standard deviation of how far (z, u) are off, (k + p,), by what the fit leaves unexplained; 0 where that is none.

    A missing effect that changes the whitened residuals by c, of any size, moves the parameters by b = P J' c and
    leaves c - J b, where P is their covariance and J their sensitivities. Scaled so that this is as large as what is
    left, b is the error that it makes.

    missing : such changes of the residuals, (N,) each.
    """
    left, result = fit.noise.misfit(fit.residual), np.zeros(len(fit.free))
    keep = np.flatnonzero(fit.free)
    changes = [fit.noise.whiten(change).astype(float) for change in missing] if left > 0.0 and len(keep) else []
    jacobian = fit.whitened()[1][:, keep].astype(float)
    inner = np.linalg.inv(fit.precision[np.ix_(keep, keep)]) @ jacobian.T
    errors = []
    for change in changes:
        error = inner @ change
        seen = float(np.linalg.norm(change - jacobian @ error))
        # What is the sum of effects that are in leaves nothing to be seen.
        if seen > DISTINCT * float(np.linalg.norm(change)):
            errors.append(np.abs(error) * math.sqrt(left) / seen)
    if errors:
        # The share of a normal distribution that is within one standard deviation.
        result[keep] = np.quantile(errors, math.erf(math.sqrt(0.5)), axis=0)
    return result


def sigmas_of(problem: Problem, fit: Fit) -> np.ndarray:
    """One sigma of each parameter, in spreads: the largest of what the likelihood says, what the scatter between blocks
    of time says, and what that between runs does; and by how much it depends on the residual's weights."""
    variances = [np.diag(fit.covariance), _sandwich(fit, problem.blocks)]
    if len(problem.whole) > 2:
        variances.append(_sandwich(fit, problem.runs_of))
    return np.sqrt(np.max(variances, axis=0) + command_shift(fit) ** 2)[len(fit.z) :]
