"""Explanations, sets of (effect, side): how probable each is, and the fits of those that were met.

Their score is -2 log of evidence and prior (`fit`, `log_prior`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from rtds_host.diagnosis import ripple
from rtds_host.diagnosis.effects import Effect
from rtds_host.diagnosis.effects.base import WRITTEN
from rtds_host.diagnosis.evidence import believed, compared, excess, worth_adding
from rtds_host.diagnosis.fit import (
    ROUGH_GAIN,
    STEP_GAIN,
    Asking,
    Fit,
    Fitter,
    Hypothesis,
    apply,
    joined,
    prior_cost,
    scaled,
    side_by_side,
    split,
    to_values,
)
from rtds_host.diagnosis.gap import LEAST
from rtds_host.diagnosis.nuisances import band
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.thresholds import MINOR_SHARE

# Probability: effects that a robot has beyond its tolerances, on average; which ones and on which side is anybody's
# guess.
EXPECTED_EFFECTS = 2.0
SIDE_PRIOR = {"both": 0.5, "left": 0.25, "right": 0.25}
# Numerical: how far behind in score a rough fit is certainly the worse one.
FAR = 200.0
# Numerical: steps of a fit in earnest, and of a rough one.
ITERATIONS, ROUGH_ITERATIONS = 8, 4
# Numerical: sizes to look at about one whose misfit is rough (impacts, resonances, steps that come late), as factors.
ROUGH_FACTORS = tuple(sorted({*np.geomspace(0.125, 8.0, 25), 0.88, 0.92, 0.96, 1.04, 1.08, 1.13}))

# An explanation, scaled parameters to fit it from, and the fit whose nuisances and discrepancy to begin with.
Start = tuple[Hypothesis, np.ndarray, Fit]


class Explanations:
    """Explanations of one case; `fits` holds the best fit of each that was tried."""

    def __init__(self, problem: Problem):
        self.problem = problem
        self.effects = problem.effects
        self.fitter = Fitter(problem)
        self.fits: dict[Hypothesis, Fit] = {}
        self._begun: dict[tuple, float] = {}  # explanations that were fitted, what each fit began from, and its score
        self._refitted: Fit | None = None
        self._optima: dict[Hypothesis, tuple[Fit, Fit]] = {}

    # ---- scores

    def log_prior(self, hypothesis: Hypothesis) -> float:
        """Log prior probability of a set: each effect is in or out by itself."""
        each = EXPECTED_EFFECTS / len(self.effects)
        return sum(math.log(each * (SIDE_PRIOR[side] if self.effects[e].sided else 1.0)) for e, side in hypothesis)

    def prior(self, fit: Fit) -> float:
        """-2 log prior density of an explanation with its sizes.

        An effect of one side is as likely as not on the other, too, of another size: friction on both wheels is one
        cause that scatters, not two.
        """
        left, right = ({e for e, s in fit.hypothesis if s == side} for side in ("left", "right"))
        alone = math.log(SIDE_PRIOR["right"] * EXPECTED_EFFECTS / len(self.effects))
        log_prior = self.log_prior(fit.hypothesis) + len(left & right) * (math.log(SIDE_PRIOR["both"]) - alone)
        return prior_cost(fit.z, fit.u) - 2.0 * log_prior

    def score(self, fit: Fit) -> float:
        """-2 log of evidence times prior."""
        return fit.score - 2.0 * self.log_prior(fit.hypothesis)

    def takes_off(self, fit: Fit, other: Fit) -> float:
        """What one explanation takes off another's excess over white noise, a share of it."""
        return (self.score(other) - self.score(fit)) / max(excess(self.problem, other), 1.0)

    def named(self, fit: Fit) -> bool:
        """Whether each effect is big enough to be named, and no larger than can be: a `ratio` within 3 % of 1 on R, K,
        J or B is a nuisance, and a size that rests on its bound replaces something else."""
        return all(
            not self._within_tolerance(e, values) and not self._at_its_bound(e, values)
            for (e, _), values in zip(fit.hypothesis, fit.values)
        )

    def _within_tolerance(self, effect: str, values: dict[str, float]) -> bool:
        """Whether a ratio is within three sigmas of 1 on a constant that has a tolerance (contract, section 2)."""
        return any(
            abs(values[p.name] - 1.0) <= band(self.problem.robot, p.of)
            for p in self.effects[effect].parameters
            if p.name == "ratio" and p.of
        )

    def _at_its_bound(self, effect: str, values: dict[str, float]) -> bool:
        """Whether a parameter lies at an end of what was looked at, its absence left out; as logarithms come back.

        The end at which a parameter is absent is none of these.
        """
        for p in self.effects[effect].parameters:
            value = values[p.name]
            low, high = p.low + WRITTEN * abs(p.low), p.high - WRITTEN * abs(p.high)
            if value >= high or (value <= low and p.low != p.null):
                return True
        return False

    def best(self) -> Fit:
        """The most probable explanation so far."""
        return min((f for f in self.fits.values() if self.named(f)), key=self.score)

    def gap(self, fit: Fit) -> float:
        return self.problem.gap(fit.model(self.problem))

    def closed(self, fit: Fit) -> bool:
        """Whether an explanation leaves no gap to speak of."""
        return self.gap(fit) < LEAST

    def _believed(self, extended: Fit, fit: Fit, closest: float) -> bool:
        """Whether an explanation is more likely than a part of it, as far as its gain can be believed, and takes off
        no small part of what that leaves beyond noise, or of the gap.

        closest : the smallest gap before. Of the two measures of what is left either may say little before others are
        in.
        """
        prior = self.log_prior(extended.hypothesis) - self.log_prior(fit.hypothesis)
        if prior + believed(*compared(self.problem, extended, fit)) < 0.0:
            return False
        return self.score(fit) - self.score(extended) >= MINOR_SHARE * excess(self.problem, fit) or worth_adding(
            closest, self.gap(extended)
        )

    # ---- fits

    def try_fit(self, hypothesis: Hypothesis, start: np.ndarray, reference: Fit, rough: bool = False) -> Fit:
        """Fit an explanation, starting from the nuisances and the discrepancy of another; the better of this and
        an earlier fit. `rough`: with the other's derivatives by the effects that both hold at the same size."""
        return self.try_fits([(hypothesis, start, reference)], rough)[0]

    def try_fits(self, starts: Iterable[Start], rough: bool = False) -> list[Fit]:
        """The same of several explanations and what each starts from, side by side."""
        starts = list(starts)
        self.reached(starts, rough)
        return [self.fits[hypothesis] for hypothesis, _, _ in starts]

    def reached(self, starts: list[Start], rough: bool) -> list[float]:
        """The same, and the scores of these very fits."""
        keys = [
            (hypothesis, start.tobytes(), reference.hypothesis, reference.cost, rough)
            for hypothesis, start, reference in starts
        ]
        new = {key: one for key, one in zip(keys, starts) if key not in self._begun or one[0] not in self.fits}
        for key, fit in zip(new, side_by_side(self.problem, [self.fitting_to(*one, rough) for one in new.values()])):
            best = self.fits.get(fit.hypothesis)
            if best is None or fit.cost < best.cost:
                self.fits[fit.hypothesis] = fit
            self._begun[key] = self.score(fit)
        return [self._begun[key] for key in keys]

    def optima(self, fits: Sequence[Fit]) -> list[list[Fit]]:
        """Of each explanation the fit, that by plain squares from no nuisance, and that by the likelihood from there.

        A logarithm of squares has many local optima, since what fits a stretch well makes that stretch heavy; plain
        squares have few, and do not hang on the noise that is declared. Which one is best runs left out decide.
        Graduated non-convexity: A. Blake, A. Zisserman, Visual Reconstruction, 1987.
        """
        white = self.problem.white()
        new = [f for f in fits if f.hypothesis not in self._optima or self._optima[f.hypothesis][0].start != f.start]
        plain = side_by_side(
            self.problem,
            [self.fitter.fitting(f.hypothesis, f.u, np.zeros_like(f.z), white, ITERATIONS, fixed=True) for f in new],
        )
        likely = side_by_side(
            self.problem, [self.fitter.fitting(f.hypothesis, f.u, f.z, white, ITERATIONS) for f in plain]
        )
        for others in zip(plain, likely, strict=True):
            self._optima[others[0].hypothesis] = others
        return [[fit, *filter(self.named, self._optima[fit.hypothesis])] for fit in fits]

    def fitting_to(self, hypothesis: Hypothesis, start: np.ndarray, reference: Fit, rough: bool) -> Asking[Fit]:
        z = reference.z
        if len(z):
            # Nuisances that bent to stand in for an effect are a poor place to start from.
            starts = [z, np.zeros_like(z)]
            values = to_values(self.effects, hypothesis, start)
            models = [
                apply(self.effects, self.problem.with_nuisances(s, self.fitter.start), hypothesis, values)
                for s in starts
            ]
            z = starts[int(np.argmin([float(r @ r) for r in (yield models, [m.coarse_s for m in models])]))]
        known = None
        if rough:
            parts = split(self.effects, hypothesis, start)
            known = {
                m: c
                for m, c in reference.columns.items()
                if m in parts and np.array_equal(parts[m], reference.parts[m])
            }
        return (
            yield from self.fitter.fitting(
                hypothesis,
                start,
                z,
                reference.noise,
                ROUGH_ITERATIONS if rough else ITERATIONS,
                known,
                by_nuisance=reference.by_nuisance,
                least=ROUGH_GAIN if rough else STEP_GAIN,
            )
        )

    def refitted(self) -> Fit:
        """The nominal robot with nuisances that bring its replay as close as their tolerance allows, whatever is
        missing: no discrepancy, so that what they could explain is not taken for one."""
        if self._refitted is None or self._refitted.start != self.fitter.start:
            flat = self.problem.white()
            self._refitted = self.fitter.fit((), np.empty(0), np.zeros(self.fitter.count), flat, fixed=True)
        return self._refitted

    def polished(self, fit: Fit, causes: Iterable[tuple[str, str]]) -> Fit:
        """Look about an optimum of some effects whose misfit has many minima, and fit again from what is found
        there.
        """
        for cause in causes:
            for values in self.effects[cause[0]].restarts if not self.closed(fit) else ():
                hypothesis, start = joined({**fit.parts, cause: scaled(self.effects, (cause,), [dict(values)])})
                if self.reached([(hypothesis, start, fit)], rough=True)[0] < self.score(fit) + FAR:
                    fit = self.try_fit(hypothesis, start, fit)
            for _ in range(3):
                moved = min(
                    self.try_fits((fit.hypothesis, start, fit) for start in self.lower_kept(fit, cause)),
                    key=self.score,
                    default=fit,
                )
                if self.score(moved) >= self.score(fit):
                    break
                fit = moved
        return fit

    def lower_kept(self, fit: Fit, cause: tuple[str, str]) -> list[np.ndarray]:
        """Starts about an optimum from which its misfit may fall further: the best with the nuisances that were fitted
        next to it, and the best without any, since these bend to a size in the wrong valley."""
        problem = self.problem
        trials = [joined({**fit.parts, cause: part})[1] for part in self._about(fit, cause)]
        values = [to_values(self.effects, fit.hypothesis, u) for u in trials]
        found = {}
        for z in (fit.z, np.zeros_like(fit.z)) if trials else ():
            models = [
                apply(self.effects, problem.with_nuisances(z, fit.start), fit.hypothesis, v)
                for v in [*values, fit.values]
            ]
            costs = [fit.noise.estimated(r).cost(r) for r in problem.residuals(models, [m.coarse_s for m in models])]
            k = int(np.argmin(costs))
            if k < len(trials):
                found[k] = trials[k]
        return list(found.values())

    def _about(self, fit: Fit, cause: tuple[str, str]) -> list[np.ndarray]:
        """Other parameters of an effect from which its misfit may fall further, scaled; none where it is smooth."""
        effect, values = self.effects[cause[0]], fit.values[fit.hypothesis.index(cause)]
        found = []
        if effect.rough:
            found = sizes(effect, values, ROUGH_FACTORS)
        if effect.periodic:
            outs = self.problem.replay(fit.model(self.problem))
            found = ripple.neighbours(values, ripple.turned(outs, cause[1]))
        return [scaled(self.effects, (cause,), [trial]) for trial in found]

    def _named_values(
        self, fit: Fit, cause: tuple[str, str], start: np.ndarray
    ) -> tuple[Hypothesis, list[dict[str, float]]]:
        hypothesis, u = joined({**fit.parts, cause: start})
        return hypothesis, to_values(self.effects, hypothesis, u)


def sizes(effect: Effect, values: dict[str, float], factors: Iterable[float]) -> list[dict[str, float]]:
    """Parameters with the effect's size multiplied by each factor, within its bounds."""
    p = effect.parameters[0]
    return [{**values, p.name: min(max(factor * values[p.name], p.low), p.high)} for factor in factors]
