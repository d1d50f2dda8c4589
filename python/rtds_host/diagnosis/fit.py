"""Fits of an explanation: nuisances and the parameters of its effects, jointly, by a damped Gauss-Newton method.

The objective is chi2 / dispersion + z'z + (u/3)'(u/3): residuals of whole-run replays in units of noise, nuisances
z in units of their 1 % prior, effect parameters u in units of their spread about "absent". `dispersion` is 1 for
white residuals; it grows with structure no explanation holds, so that priors keep their weight on real machines.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rtds_host.diagnosis.effects import CATALOGUE, SIDES, Effect, Parameter
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import Model

Hypothesis = tuple[tuple[str, str], ...]          # ((effect, side), ...), sorted
NUISANCE_LIMIT = 3.5                              # sigma of the prior
EFFECT_PRIOR = 3.0                                # spreads
STALE_GAIN = 20.0                                 # chi2 that a step promised and did not bring


def parameters(hypothesis: Hypothesis) -> list[tuple[Effect, str, Parameter]]:
    """Free parameters of an explanation, in the order of a fit's `u`."""
    return [(CATALOGUE[e], side, p) for e, side in hypothesis for p in CATALOGUE[e].parameters]


def to_values(hypothesis: Hypothesis, u: np.ndarray) -> list[dict[str, float]]:
    """Parameters by name, one dictionary an effect, within their bounds."""
    result, k = [], 0
    for effect, _ in hypothesis:
        values = {}
        for p in CATALOGUE[effect].parameters:
            values[p.name] = float(min(max(p.null + p.spread * u[k], p.low), p.high))
            k += 1
        result.append(values)
    return result


def scaled(hypothesis: Hypothesis, values: list[dict[str, float]]) -> np.ndarray:
    """The inverse of `to_values`."""
    return np.array([(v[p.name] - p.null) / p.spread for (e, _), v in zip(hypothesis, values)
                     for p in CATALOGUE[e].parameters])


def apply(model: Model, hypothesis: Hypothesis, values: list[dict[str, float]]) -> Model:
    """A copy of the model with the effects in it."""
    model = model.copy()
    for (effect, side), v in zip(hypothesis, values):
        CATALOGUE[effect].apply(model, SIDES[side], v)
    return model


@dataclass
class Fit:
    """A fitted explanation.

    z (k,) nuisances in sigmas; u (p,) scaled effect parameters; residual (N,); jacobian (N, k + p) float32;
    `free` (k + p,) False where a parameter rests on its bound.
    """

    hypothesis: Hypothesis
    z: np.ndarray
    u: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray
    free: np.ndarray
    dispersion: float

    def __post_init__(self) -> None:
        self.chi2 = float(self.residual @ self.residual)

    @property
    def prior(self) -> float:
        return float(self.z @ self.z + (self.u / EFFECT_PRIOR) @ (self.u / EFFECT_PRIOR))

    @property
    def values(self) -> list[dict[str, float]]:
        return to_values(self.hypothesis, self.u)

    def model(self, problem: Problem) -> Model:
        """The replay's model with nuisances and effects."""
        return apply(problem.with_nuisances(self.z), self.hypothesis, self.values)

    def model_at(self, problem: Problem, z: np.ndarray) -> Model:
        """The same with other nuisances."""
        return apply(problem.with_nuisances(z), self.hypothesis, self.values)

    @cached_property
    def gram(self) -> np.ndarray:
        """jacobian' jacobian, (k + p, k + p), to single precision."""
        return (self.jacobian.T @ self.jacobian).astype(float)

    def precision(self) -> np.ndarray:
        """Hessian of half the objective, (k + p, k + p)."""
        jacobian = self.jacobian.astype(float)
        return jacobian.T @ jacobian / self.dispersion + np.diag(self.prior_precision())

    def prior_precision(self) -> np.ndarray:
        return np.concatenate([np.ones(len(self.z)), np.full(len(self.u), EFFECT_PRIOR**-2)])

    def covariance(self) -> np.ndarray:
        """Posterior covariance of (z, u), parameters on a bound held."""
        keep = np.flatnonzero(self.free)
        result = np.zeros((len(self.free), len(self.free)))
        result[np.ix_(keep, keep)] = np.linalg.inv(self.precision()[np.ix_(keep, keep)])
        return result


class Fitter:
    """Fits explanations of one problem; keeps the nuisances' derivatives, which hardly change between them."""

    def __init__(self, problem: Problem):
        self.problem = problem
        self.names = problem.nuisance_names()
        self.count = len(self.names)
        self.nuisance_jacobian: np.ndarray | None = None

    def _model(self, hypothesis: Hypothesis, x: np.ndarray) -> Model:
        k = self.count
        return apply(self.problem.with_nuisances(x[:k]), hypothesis, to_values(hypothesis, x[k:]))

    def _bounds(self, hypothesis: Hypothesis) -> tuple[np.ndarray, np.ndarray]:
        ps = [p for _, _, p in parameters(hypothesis)]
        low = np.array([-NUISANCE_LIMIT] * self.count + [(p.low - p.null) / p.spread for p in ps])
        high = np.array([NUISANCE_LIMIT] * self.count + [(p.high - p.null) / p.spread for p in ps])
        return low, high

    def _derivatives(self, hypothesis: Hypothesis, x: np.ndarray, r: np.ndarray, which: range,
                     high: np.ndarray, into: np.ndarray) -> None:
        """Fill columns of `into` (N, k + p) with the derivatives of the residuals r at x."""
        models, steps = [], []
        differences = [p.difference for _, _, p in parameters(hypothesis)]
        for j in which:
            step = 0.3 if j < self.count else differences[j - self.count]
            if x[j] + step > high[j]:
                step = -step
            moved = x.copy()
            moved[j] += step
            models.append(self._model(hypothesis, moved))
            steps.append(step)
        for j, moved, step in zip(which, self.problem.residuals(models), steps):
            np.subtract(moved, r, out=moved)
            np.divide(moved, step, out=into[:, j], casting="same_kind")

    def fit(self, hypothesis: Hypothesis, start: np.ndarray, z: np.ndarray, dispersion: float,
            iterations: int = 8) -> Fit:
        """Fit an explanation from a start.

        Parameters
        ----------
        start : (p,) scaled effect parameters; z : (k,) nuisances to start from.
        dispersion : residual variance over noise variance, at least 1.
        """
        k = self.count
        low, high = self._bounds(hypothesis)
        x = np.clip(np.concatenate([z, start]), low, high)
        r = self.problem.residual(self._model(hypothesis, x))
        jacobian = np.empty((len(r), len(x)), np.float32, order="F")
        if self.nuisance_jacobian is None:
            self._derivatives(hypothesis, x, r, range(k), high, jacobian)
            self.nuisance_jacobian = jacobian[:, :k].copy(order="F")
        else:
            jacobian[:, :k] = self.nuisance_jacobian
        weight = np.concatenate([np.ones(k), np.full(len(start), EFFECT_PRIOR**-2)])

        def cost(x: np.ndarray, r: np.ndarray) -> float:
            return float(r @ r) / dispersion + float(weight @ (x * x))

        def inside(x: np.ndarray, gradient: np.ndarray) -> np.ndarray:
            """False where a parameter rests on a bound that the cost still falls towards, (k + p,)."""
            return ~(((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0)))

        now, damping = cost(x, r), 1e-3
        free = np.ones(len(x), bool)
        renewed = False
        for _ in range(iterations):
            self._derivatives(hypothesis, x, r, range(k, len(x)), high, jacobian)
            gradient = (jacobian.T @ r.astype(np.float32)).astype(float) / dispersion + weight * x
            hessian = (jacobian.T @ jacobian).astype(float) / dispersion + np.diag(weight)
            improved = 0.0
            for _ in range(4):
                free = inside(x, gradient)
                keep = np.flatnonzero(free)
                damped = hessian[np.ix_(keep, keep)] + damping * np.diag(np.diag(hessian)[keep])
                step = np.zeros(len(x))
                step[keep] = -np.linalg.solve(damped, gradient[keep])
                trial = np.clip(x + step, low, high)
                moved = self.problem.residual(self._model(hypothesis, trial))
                new = cost(trial, moved)
                if new < now:
                    improved = now - new
                    x, r, now = trial, moved, new
                    damping = max(damping * 0.2, 1e-6)
                    break
                if abs(gradient @ step) < 0.2:
                    break                   # what a step could still bring is below the noise of the choice
                damping = max(damping * 30, 1e-2)
            if improved < 0.2 + 1e-6 * now:
                if renewed or not len(start) or abs(gradient @ step) < STALE_GAIN:
                    break
                # Far from where they were taken, the nuisances' derivatives point the wrong way.
                self._derivatives(hypothesis, x, r, range(k), high, jacobian)
                renewed, damping = True, 1e-3
        # Of the point where it ends: the last step may have led onto a bound.
        gradient = (jacobian.T @ r.astype(np.float32)).astype(float) / dispersion + weight * x
        free = inside(x, gradient)
        return Fit(hypothesis, x[:k].copy(), x[k:].copy(), r, jacobian, free, dispersion)
