"""Fits of an explanation: nuisances and the parameters of its effects, jointly, at maximum posterior probability.

The objective is -2 log of the likelihood (`likelihood`: white noise, and a size of the model's error for each group of
residuals, estimated with the fit) times the prior: nuisances z are normal in units of their tolerance. Effect
parameters u, in units of their spread, are Cauchy about "absent", so that an effect ten times as large as usual is not
impossible but ten squared times rarer.
Gauss-Newton with damping on whitened residuals; the size of the model's error is estimated again after each step. A
step with what its logarithm takes off the Hessian (`Likelihood.curvature`) is tried first.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Collection, Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np

from rtds_host.diagnosis.effects import SIDES, Effect, Parameter
from rtds_host.diagnosis.likelihood import Likelihood
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import Model
from rtds_host.diagnosis.start import DECLARED, Start

Hypothesis = tuple[tuple[str, str], ...]  # ((effect, side), ...), sorted
Effects = dict[str, Effect]

# Numerical: the gain of a step, in -2 log probability, below which a fit has converged, and a rough fit is good enough.
STEP_GAIN, ROUGH_GAIN = 0.2, 2.0
# Numerical: the same as a share of the excess over white noise, where this is more: no choice between explanations that
# leave a gap depends on less.
RELATIVE_GAIN = 1e-3
# Numerical: most steps of a fit, and of a rough one.
ITERATIONS, ROUGH_ITERATIONS = 8, 4
# Numerical: a gain below this shows that the fit has converged, or that the nuisances' derivatives are out of date; how
# often these are taken again.
RENEWED, RENEWALS = 5.0, 1
# Numerical: the same of a settled fit, which is taken on to its optimum: most steps, the gain of a step, also as a
# share of the excess, and how often the nuisances' derivatives are taken again.
SETTLED_GAIN = 0.5
SETTLED = 40, SETTLED_GAIN, 1e-5, 8
# Numerical: factor between the variances of noise by which a fit is graduated.
GRADUATED = 3.0
# Numerical: fits computed together: their replays fill the lanes of a batch, and each keeps its derivatives.
AT_ONCE = 8
# Numerical: shares of the diagonal that are added to the normal equations, and the shortest part of a step without any.
DAMPINGS, SHORTEST = (0.0, 0.03, 1.0, 30.0), 0.05


def parameters(effects: Effects, hypothesis: Hypothesis) -> list[tuple[Effect, str, Parameter]]:
    """Free parameters of an explanation, in the order of a fit's `u`."""
    return [(effects[e], side, p) for e, side in hypothesis for p in effects[e].parameters]


def to_values(effects: Effects, hypothesis: Hypothesis, u: np.ndarray) -> list[dict[str, float]]:
    """Parameters by name, SI, one dictionary an effect, within their bounds."""
    result, k = [], 0
    for effect, _ in hypothesis:
        values = {}
        for p in effects[effect].parameters:
            values[p.name] = p.value(float(u[k]))
            k += 1
        result.append(values)
    return result


def scaled(effects: Effects, hypothesis: Hypothesis, values: list[dict[str, float]]) -> np.ndarray:
    """The inverse of `to_values`."""
    return np.array([p.scaled(v[p.name]) for (e, _), v in zip(hypothesis, values) for p in effects[e].parameters])


def apply(effects: Effects, model: Model, hypothesis: Hypothesis, values: list[dict[str, float]]) -> Model:
    """A copy of the model with the effects in it."""
    model = model.copy()
    for (effect, side), v in zip(hypothesis, values):
        effects[effect].apply(model, SIDES[side], v)
    return model


def split(effects: Effects, hypothesis: Hypothesis, u: np.ndarray) -> dict[tuple[str, str], np.ndarray]:
    """The part of `u` that belongs to each effect."""
    parts, k = {}, 0
    for cause in hypothesis:
        n = len(effects[cause[0]].parameters)
        parts[cause] = u[k : k + n]
        k += n
    return parts


def joined(parts: dict[tuple[str, str], np.ndarray]) -> tuple[Hypothesis, np.ndarray]:
    """An explanation and its `u` from the parts of its effects."""
    hypothesis = tuple(sorted(parts))
    return hypothesis, np.concatenate([parts[h] for h in hypothesis]) if hypothesis else np.empty(0)


def _angle_gain(effects: Effects, parts: Mapping[tuple[str, str], np.ndarray], side: int) -> float:
    """The measured over the true angle of a side's wheel with some effects."""
    return math.prod(
        effects[effect].parameters[0].value(float(u[0]))
        for (effect, on), u in parts.items()
        if "th" in effects[effect].scales and side in SIDES[on]
    )


def prior_cost(z: np.ndarray, u: np.ndarray) -> float:
    """-2 log prior density of nuisances and parameters, less constants."""
    return float(z @ z + 2.0 * np.log1p(u * u).sum())


def prior_weight(z: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Curvature of the parabola that touches half the prior's cost from above, (k + p,)."""
    return np.concatenate([np.ones(len(z)), 2.0 / (1.0 + u * u)])


@dataclass(eq=False)
class Fit:
    """A fitted explanation.

    z (k,) nuisances in sigmas; u (p,) scaled effect parameters; residual (N,) in units of noise; by_nuisance (N, k) and
    by_effect (N, p) its derivatives, float32; `free` (k + p,) False where a parameter lies on its bound or was kept;
    noise: the discrepancy estimated with it; start: how runs began in all of these, so that its replays are those of
    its fit.
    """

    effects: Effects = field(repr=False)
    hypothesis: Hypothesis
    z: np.ndarray
    u: np.ndarray
    residual: np.ndarray = field(repr=False)
    by_nuisance: np.ndarray = field(repr=False)
    by_effect: np.ndarray = field(repr=False)
    free: np.ndarray = field(repr=False)
    noise: Likelihood = field(repr=False)
    start: Start

    @cached_property
    def cost(self) -> float:
        """-2 log of likelihood and prior density at the fit."""
        return self.noise.cost(self.residual) + prior_cost(self.z, self.u)

    @cached_property
    def score(self) -> float:
        """-2 log of the evidence (Laplace's approximation: D. J. C. MacKay, Neural Computation 4(3), 1992); infinite
        where two parameters are one but for rounding: their explanation has a simpler form."""
        keep = np.flatnonzero(self.free)
        sign, occam = np.linalg.slogdet(self.precision[np.ix_(keep, keep)])
        if sign <= 0.0:
            return math.inf
        held = np.flatnonzero(~self.free[len(self.z) :])
        return self.cost + float(occam) + (len(self.u) - len(held)) * math.log(math.pi / 2.0)

    @property
    def values(self) -> list[dict[str, float]]:
        return to_values(self.effects, self.hypothesis, self.u)

    @property
    def parts(self) -> dict[tuple[str, str], np.ndarray]:
        """`u` by effect."""
        return split(self.effects, self.hypothesis, self.u)

    def parts_without(self, *causes: tuple[str, str]) -> dict[tuple[str, str], np.ndarray]:
        """The same less some effects."""
        return {cause: u for cause, u in self.parts.items() if cause not in causes}

    def proposal(
        self, new: Mapping[tuple[str, str], np.ndarray], without: Collection[tuple[str, str]] = ()
    ) -> Proposal:
        """Where to fit this explanation from with other effects, scaled parameters each, and without some of its own.

        One side of an effect that is included on both sides splits that into two. Periods over the wheel's angle start
        in step with the measured angle.
        """
        parts = self.parts_without(*without)
        for effect, side in new:
            if side != "both" and (effect, "both") in parts:
                parts[effect, "right" if side == "left" else "left"] = parts.pop((effect, "both"))
        return Proposal.of(self._in_step({**parts, **new}, new), self)

    def _in_step(
        self, parts: dict[tuple[str, str], np.ndarray], new: Collection[tuple[str, str]]
    ) -> dict[tuple[str, str], np.ndarray]:
        """The parts with as many cycles of each measured turn as this fit has, of effects that are not new.

        A sensor's gain scales the measured angle. A ripple that kept its cycles of each true turn would be out of step
        after a few turns, and no slope leads back.
        """
        for cause in [c for c in parts if self.effects[c[0]].periodic and c not in new]:
            side = SIDES[cause[1]][0]
            now, then = (_angle_gain(self.effects, of, side) for of in (parts, self.parts))
            # None where nothing scales the angle anew; a reversed sign is another matter than a period.
            if now != then and now * then > 0.0:
                cycles = self.effects[cause[0]].parameters[1]
                parts[cause] = parts[cause].copy()
                parts[cause][1] = cycles.scaled(now / then * cycles.value(float(parts[cause][1])))
        return parts

    @property
    def columns(self) -> dict[tuple[str, str], np.ndarray]:
        """Derivatives by effect, (N, n) each."""
        result, k = {}, 0
        for cause in self.hypothesis:
            n = len(self.effects[cause[0]].parameters)
            result[cause] = self.by_effect[:, k : k + n]
            k += n
        return result

    def model(self, problem: Problem) -> Model:
        """The replay's model with nuisances and effects."""
        return apply(self.effects, problem.with_nuisances(self.z, self.start), self.hypothesis, self.values)

    def model_at(self, problem: Problem, z: np.ndarray) -> Model:
        """The same with other nuisances."""
        return apply(self.effects, problem.with_nuisances(z, self.start), self.hypothesis, self.values)

    def whitened(self) -> tuple[np.ndarray, np.ndarray]:
        """Whitened residual (N,) and derivatives (N, k + p) float32."""
        return self.noise.whiten(self.residual), self.noise.whitened([*self.by_nuisance.T, *self.by_effect.T])

    @cached_property
    def precision(self) -> np.ndarray:
        """Hessian of half the objective, (k + p, k + p)."""
        # In double precision: rounded sums of large squares are more than a prior, and no longer positive definite.
        jacobian = self.noise.whitened([*self.by_nuisance.T, *self.by_effect.T], float)
        return jacobian.T @ jacobian + np.diag(prior_weight(self.z, self.u))

    @cached_property
    def covariance(self) -> np.ndarray:
        """Posterior covariance of (z, u), parameters on a bound held."""
        keep = np.flatnonzero(self.free)
        result = np.zeros((len(self.free), len(self.free)))
        result[np.ix_(keep, keep)] = np.linalg.inv(self.precision[np.ix_(keep, keep)])
        return result


# A computation that requests residuals as it goes on: it yields models and the longest step of each (None: what each
# needs), and is sent their residuals, (N,) each.
T = TypeVar("T")
Requesting = Generator[tuple[list[Model], list[float] | None], list[np.ndarray], T]


def side_by_side(problem: Problem, works: Iterable[Requesting[T]]) -> list[T]:
    """Results of computations that go on together: the residuals that several request at a time are replayed in a
    batch, of which each alone would fill few lanes."""
    waiting, asked, results = deque(enumerate(works)), {}, {}

    def on(k: int, work: Requesting[T], answer: list[np.ndarray] | None) -> None:
        try:
            asked[k] = work, *(next(work) if answer is None else work.send(answer))
        except StopIteration as end:
            asked.pop(k, None)
            results[k] = end.value

    while waiting or asked:
        while waiting and len(asked) < AT_ONCE:
            on(*waiting.popleft(), None)
        now = list(asked.items())
        found = iter(
            problem.residuals(
                [model for _, (_, models, _) in now for model in models],
                [step for _, (_, models, steps) in now for step in steps or [m.step_s for m in models]],
            )
        )
        for k, (work, models, _) in now:
            on(k, work, list(itertools.islice(found, len(models))))
    return [results[k] for k in sorted(results)]


def _damped(hessian: np.ndarray, gradient: np.ndarray, keep: np.ndarray, share: float) -> np.ndarray | None:
    """A Gauss-Newton step (n,) of some parameters with a share of the diagonal added to the normal equations.

    None where these are singular: two effects are one there, as Coulomb and Stribeck friction may be, and rounding of
    large squares hides the prior that tells them apart. Such a step needs damping.
    """
    step = np.zeros(len(gradient))
    damped = hessian[keep[:, None], keep]
    damped.flat[:: len(keep) + 1] *= 1.0 + share
    try:
        step[keep] = -np.linalg.solve(damped, gradient[keep])
    except np.linalg.LinAlgError:
        return None
    return step


def _steps(
    hessian: np.ndarray, curvature: np.ndarray, gradient: np.ndarray, keep: np.ndarray, share: float
) -> list[np.ndarray]:
    """Gauss-Newton steps (n,) to try in turn, the surest last; none where the normal equations are singular.

    Without damping the first is by the logarithm's curvature. It is too long where one parameter explains all that is
    left. The weighted squares alone then have the right one.
    """
    hessians = [hessian - curvature, hessian] if share == 0.0 and curvature.any() else [hessian]
    found = (_damped(one, gradient, keep, share) for one in hessians)
    return [step for step in found if step is not None]


class Proposal(NamedTuple):
    """An explanation, scaled parameters (p,) to fit it from, and the fit whose nuisances and discrepancy to begin
    with."""

    hypothesis: Hypothesis
    u: np.ndarray
    near: Fit

    @classmethod
    def of(cls, parts: Mapping[tuple[str, str], np.ndarray], near: Fit) -> Proposal:
        """By the scaled parameters of each effect."""
        return cls(*joined(dict(parts)), near)


class Fitter:
    """Fits explanations of one problem; keeps the nuisances' derivatives about the nominal robot.

    `start`: how runs begin in the fits that are to come. A fit keeps the one that it was made with.
    """

    def __init__(self, problem: Problem, start: Start = DECLARED):
        self.problem = problem
        self.effects = problem.effects
        self.count = len(problem.nuisances)
        self.by_nuisance: np.ndarray | None = None
        self.start = start  # of the fits that are to come

    def model(self, hypothesis: Hypothesis, x: np.ndarray) -> Model:
        k = self.count
        nominal = self.problem.with_nuisances(x[:k], self.start)
        return apply(self.effects, nominal, hypothesis, to_values(self.effects, hypothesis, x[k:]))

    def _bounds(self, hypothesis: Hypothesis) -> tuple[np.ndarray, np.ndarray]:
        ps = [p for _, _, p in parameters(self.effects, hypothesis)]
        low = np.array([n.low for n in self.problem.nuisances] + [p.scaled(p.low) for p in ps])
        high = np.array([n.high for n in self.problem.nuisances] + [p.scaled(p.high) for p in ps])
        return low, high

    def _switched_off(self, hypothesis: Hypothesis, x: np.ndarray) -> list[int]:
        """Places in (z, u) of switches that are off."""
        every = enumerate(parameters(self.effects, hypothesis), self.count)
        return [j for j, (_, _, p) in every if p.switch and x[j] == 0.0]

    def _derivatives(
        self, hypothesis: Hypothesis, x: np.ndarray, r: np.ndarray, which: Iterable[int], high: np.ndarray
    ) -> Requesting[np.ndarray]:
        """Derivatives of the residuals r at x by some parameters, (N, count) float32; zero by a switch that is off."""
        models, steps, columns = [], [], []
        off = set(self._switched_off(hypothesis, x))
        differences = [p.difference for _, _, p in parameters(self.effects, hypothesis)]
        for column, j in enumerate(which := list(which)):
            if j in off:
                continue
            columns.append(column)
            # A share of the parameter's present size: the larger it is, the further its derivatives hold.
            step = 0.3 if j < self.count else differences[j - self.count] * max(1.0, 0.3 * abs(x[j]))
            if x[j] + step > high[j]:
                step = -step
            moved = x.copy()
            moved[j] += step
            models.append(self.model(hypothesis, moved))
            steps.append(step)
        into = np.zeros((len(r), len(which)), np.float32, order="F")
        for j, moved, step in zip(columns, (yield models, None) if models else [], steps):
            np.subtract(moved, r, out=moved)
            np.divide(moved, step, out=into[:, j], casting="same_kind")
        return into

    def _by_effect(
        self,
        hypothesis: Hypothesis,
        known: dict[tuple[str, str], np.ndarray],
        x: np.ndarray,
        r: np.ndarray,
        high: np.ndarray,
    ) -> Requesting[np.ndarray]:
        """Derivatives by all effect parameters, (N, p): those known, and of the others new ones."""
        new = yield from self._derivatives(hypothesis, x, r, self._missing_columns(hypothesis, known), high)
        if not known:
            return new
        columns, at = [], 0
        for cause in hypothesis:
            if cause in known:
                columns.append(known[cause])
            else:
                count = len(self.effects[cause[0]].parameters)
                columns.append(new[:, at : at + count])
                at += count
        return np.concatenate(columns, axis=1) if columns else new

    def _first_lower(
        self,
        hypothesis: Hypothesis,
        trials: Sequence[np.ndarray],
        noise: Likelihood,
        fixed: bool,
        now: float,
    ) -> Requesting[tuple[np.ndarray, np.ndarray, float]]:
        """Of the first parameters that cost less than `now`, or else of the last: these, their residuals and the
        cost; by the weights as they are where these are `fixed`."""
        for x in trials:
            (moved,) = yield [self.model(hypothesis, x)], None
            cost = noise.cost(moved) if fixed else noise.exact_cost(moved)
            cost += prior_cost(x[: self.count], x[self.count :])
            if cost < now:
                break
        return x, moved, cost

    def _with_common_part(self, hypothesis: Hypothesis, x: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """The same robot with the mean deviation of both sides' tolerances moved into a ratio of the same constant.

        A resistance ten per cent off with no tolerance is the same as seven per cent off with both tolerances at three:
        along this line no residual changes and only the prior does, by too little for steps whose derivatives are
        differences.
        """
        for j, (effect, side, p) in enumerate(parameters(self.effects, hypothesis), self.count):
            at = [
                i
                for i, n in enumerate(self.problem.nuisances)
                if effect.nuisance and n.side in SIDES[side] and p.of.removeprefix("motor.") in n.keys
            ]
            if at:
                moved, common = x.copy(), float(x[at].mean())
                moved[at] -= common
                moved[j] += common * self.problem.nuisances[at[0]].sigma / p.prior_width
                inside = np.all((moved >= low) & (moved <= high))
                if inside and prior_cost(moved[: self.count], moved[self.count :]) < prior_cost(
                    x[: self.count], x[self.count :]
                ):
                    x = moved
        return x

    def fit(
        self,
        hypothesis: Hypothesis,
        start: np.ndarray,
        z: np.ndarray,
        noise: Likelihood,
        iterations: int = ITERATIONS,
        known: dict[tuple[str, str], np.ndarray] | None = None,
        fixed: bool = False,
        by_nuisance: np.ndarray | None = None,
        least: float = STEP_GAIN,
        held: Collection[tuple[str, str]] = (),
    ) -> Fit:
        """Fit an explanation from a start, see `fitting`."""
        return side_by_side(
            self.problem,
            [self.fitting(hypothesis, start, z, noise, iterations, known, fixed, by_nuisance, least, held)],
        )[0]

    def fitting_to(self, proposal: Proposal, rough: bool) -> Requesting[Fit]:
        """The fit of a proposal, which asks for the residuals that it needs."""
        hypothesis, u, near = proposal
        z = near.z
        if len(z):
            # Nuisances that compensated for a missing effect are a poor start.
            starts = [z, np.zeros_like(z)]
            values = to_values(self.effects, hypothesis, u)
            models = [
                apply(self.effects, self.problem.with_nuisances(s, self.start), hypothesis, values) for s in starts
            ]
            z = starts[int(np.argmin([float(r @ r) for r in (yield models, [m.coarse_s for m in models])]))]
        known = None
        if rough:
            parts = split(self.effects, hypothesis, u)
            known = {m: c for m, c in near.columns.items() if m in parts and np.array_equal(parts[m], near.parts[m])}
        return (
            yield from self.fitting(
                hypothesis,
                u,
                z,
                near.noise,
                ROUGH_ITERATIONS if rough else ITERATIONS,
                known,
                by_nuisance=near.by_nuisance,
                least=ROUGH_GAIN if rough else STEP_GAIN,
            )
        )

    def graduating(self, plain: Fit) -> Requesting[Fit]:
        """A fit by plain squares taken on to an optimum of the likelihood, by likelihoods of ever less noise.

        Where a gap is left, a group within the sensors' noise is within it by chance, and each such chance is an
        optimum. With noise as large as what is left there are few, and each fit starts from the one before. Graduated
        non-convexity: A. Blake, A. Zisserman, Visual Reconstruction, 1987.
        """
        fit, variance = plain, float(np.mean(np.square(plain.residual)))
        while GRADUATED < variance < math.inf:
            variance /= GRADUATED
            noise = plain.noise.with_variance(variance)
            fit = yield from self.fitting(
                fit.hypothesis, fit.u, fit.z, noise, ROUGH_ITERATIONS, by_nuisance=fit.by_nuisance
            )
        return (yield from self.fitting(fit.hypothesis, fit.u, fit.z, plain.noise, by_nuisance=fit.by_nuisance))

    def settling(self, fit: Fit) -> Requesting[Fit]:
        """A fit taken on to its optimum by the objective that it was fitted by, or itself if that is no better."""
        plain = fit.noise.root is None
        found = yield from self.fitting(
            fit.hypothesis, fit.u, fit.z, fit.noise, fixed=plain, by_nuisance=fit.by_nuisance, settled=True
        )
        return found if found.cost < fit.cost else fit

    def _about_nominal(
        self, hypothesis: Hypothesis, x: np.ndarray, r: np.ndarray, high: np.ndarray
    ) -> Requesting[np.ndarray]:
        """Derivatives (N, k) by the nuisances that fits begin with, taken once, where the first fit starts."""
        if self.by_nuisance is None:
            self.by_nuisance = yield from self._derivatives(hypothesis, x, r, range(self.count), high)
        return self.by_nuisance

    def _missing_columns(self, hypothesis: Hypothesis, known: Mapping[tuple[str, str], np.ndarray]) -> list[int]:
        """Places in (z, u) of the parameters whose derivatives are not known."""
        own, at = [], self.count
        for cause in hypothesis:
            count = len(self.effects[cause[0]].parameters)
            own += [] if cause in known else list(range(at, at + count))
            at += count
        return own

    def _gradient_and_hessian(
        self,
        x: np.ndarray,
        r: np.ndarray,
        noise: Likelihood,
        by_nuisance: np.ndarray,
        by_effect: np.ndarray,
        fixed: bool,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Gradient (k + p,) and Hessian (k + p, k + p) of half the objective, by Gauss and Newton: that of the weighted
        squares, and what the logarithm takes off it unless the weights are `fixed`."""
        # In double precision: next to rounded sums, a change in the seventh digit of the noise leads to other optima.
        jacobian = noise.whitened([*by_nuisance.T, *by_effect.T], float)
        white = noise.whiten(r)
        weight = prior_weight(x[: self.count], x[self.count :])
        hessian = jacobian.T @ jacobian + np.diag(weight)
        curvature = np.zeros_like(hessian) if fixed else noise.curvature(jacobian, white)
        return jacobian.T @ white + weight * x, hessian, curvature

    def derived(self, fit: Fit) -> Requesting[Fit]:
        """A fit with derivatives by all its effects at its own values."""
        x = np.concatenate([fit.z, fit.u])
        (r,) = yield [self.model(fit.hypothesis, x)], None
        every = range(self.count, len(x))
        columns = yield from self._derivatives(fit.hypothesis, x, r, every, self._bounds(fit.hypothesis)[1])
        return replace(fit, residual=r, by_effect=columns)

    def _started(
        self, hypothesis: Hypothesis, start: np.ndarray, held: Collection[tuple[str, str]]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A start (z, u) within its bounds, and the bounds: effects in `held` keep their parameters there, and switches
        that are off stay so."""
        low, high = self._bounds(hypothesis)
        x = np.clip(start, low, high)
        causes = [(effect.id, side) for effect, side, _ in parameters(self.effects, hypothesis)]
        kept = [j for j, cause in enumerate(causes, self.count) if cause in held]
        kept += self._switched_off(hypothesis, x)
        low[kept] = high[kept] = x[kept]
        return x, low, high

    def fitting(
        self,
        hypothesis: Hypothesis,
        start: np.ndarray,
        z: np.ndarray,
        noise: Likelihood,
        iterations: int = ITERATIONS,
        known: dict[tuple[str, str], np.ndarray] | None = None,
        fixed: bool = False,
        by_nuisance: np.ndarray | None = None,
        least: float = STEP_GAIN,
        held: Collection[tuple[str, str]] = (),
        chord: bool = False,
        settled: bool = False,
    ) -> Requesting[Fit]:
        """Fit an explanation from a start.

        Parameters
        ----------
        start : (p,) scaled effect parameters; z : (k,) nuisances to start from; noise : a discrepancy to begin with.
        known : derivatives by the parameters of some of its effects, (N, n) each, that are not taken again: a rough
        fit, good enough to compare it with and without another effect. fixed : keep the discrepancy. by_nuisance :
        (N, k) derivatives by the nuisances to begin with, else those about the nominal robot. least : the gain of
        a step below which it ends, in -2 log probability. held : effects that keep the parameters of the start. chord :
        the start's derivatives alone (chord method), for terms that are linear in most of their parameters. settled :
        take it on to its optimum; `iterations` and `least` then do not count.
        """
        k, known = self.count, known or {}
        fresh = not known and not chord  # whether all derivatives are taken at each step
        x, low, high = self._started(hypothesis, np.concatenate([z, start]), held)
        (r,) = yield [self.model(hypothesis, x)], None
        if by_nuisance is None:
            by_nuisance = yield from self._about_nominal(hypothesis, x, r, high)
        noise = noise if fixed else noise.estimated(r)
        now = noise.cost(r) + prior_cost(x[:k], x[k:])
        damping, since = 0.0, math.inf  # what was gained since the nuisances' derivatives were taken
        iterations, least, share, renewals = SETTLED if settled else (iterations, least, RELATIVE_GAIN, RENEWALS)
        renewals = renewals if len(start) else 0
        by_effect, free = np.empty((len(r), 0), np.float32), np.ones(len(x), bool)
        for turn in range(iterations):
            if not (chord and turn):
                by_effect = yield from self._by_effect(hypothesis, known, x, r, high)
            gradient, hessian, curvature = self._gradient_and_hessian(x, r, noise, by_nuisance, by_effect, fixed)
            free = (low < high) & ~(((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0)))
            keep = np.flatnonzero(free)
            improved, enough = 0.0, max(least, share * (now - len(r)))
            for attempt in DAMPINGS[DAMPINGS.index(damping) :]:
                if not (steps := _steps(hessian, curvature, gradient, keep, attempt)):
                    continue
                predicted = float(abs(gradient @ (step := steps[-1])))
                trials = [np.clip(x + one, low, high) for one in steps]
                trial, moved, after = yield from self._first_lower(hypothesis, trials, noise, fixed, now)
                if after >= now and predicted >= enough and attempt == 0.0:
                    # Along a curved valley a part of the step makes progress where damping would stop it: to the
                    # minimum of the parabola through what is known of the line.
                    part = min(max(predicted / (after - now + 2.0 * predicted), SHORTEST), 0.5)
                    trials = [np.clip(x + part * step, low, high)]
                    trial, moved, after = yield from self._first_lower(hypothesis, trials, noise, fixed, now)
                if after < now:
                    x, r, damping = self._with_common_part(hypothesis, trial, low, high), moved, attempt
                    noise = noise if fixed else noise.estimated(r)
                    improved = now - noise.cost(r) - prior_cost(x[:k], x[k:])
                    break
                # The gain of a further step is too small to matter, or the nuisances' derivatives are out of date.
                if predicted < enough or (renewals and fresh and since >= ROUGH_GAIN):
                    break
            if improved > 0.0:
                # None at all where it is not needed: along a valley that tolerances alone close, any would stop it.
                damping = DAMPINGS[max(DAMPINGS.index(damping) - 1, 0)]
                now = noise.cost(r) + prior_cost(x[:k], x[k:])
            since += improved
            if improved < enough and (not fresh or not renewals or since < ROUGH_GAIN):
                break
            if improved < RENEWED and fresh and renewals and since >= ROUGH_GAIN:
                # Far from where they were taken, the nuisances' derivatives point the wrong way, and hide the valley in
                # which an effect and a tolerance of the same parameter lie.
                by_nuisance = yield from self._derivatives(hypothesis, x, r, range(k), high)
                renewals, since, damping = renewals - 1, 0.0, 0.0
        z, u = np.split(x, [k])
        return Fit(self.effects, hypothesis, z, u, r, by_nuisance, by_effect, free, noise, self.start)
