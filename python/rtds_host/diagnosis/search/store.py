"""The store of a search: the best fit of each explanation so far, and how probable each is.

Their score is -2 log of evidence and prior (`fit`, `Store.log_prior`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from rtds_host.diagnosis import ripple
from rtds_host.diagnosis.evidence import CONVINCING, enough_to_extend, excess, likelihood_gain, log_odds
from rtds_host.diagnosis.fit import (
    ITERATIONS,
    ROUGH_ITERATIONS,
    Fit,
    Fitter,
    Hypothesis,
    Proposal,
    Requesting,
    prior_cost,
    side_by_side,
)
from rtds_host.diagnosis.gap import LEAST
from rtds_host.diagnosis.likelihood import Likelihood
from rtds_host.diagnosis.nuisances import band
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.thresholds import MINOR_SHARE

# Probability: effects that a robot has beyond its tolerances, on average, all and on any side equally probable.
EXPECTED_EFFECTS = 2.0
SIDE_PRIOR = {"both": 0.5, "left": 0.25, "right": 0.25}
# Numerical: how far behind in score a rough fit is certainly the worse one, and how far it may be from convergence.
FAR, ROUGHLY = 200.0, 20.0

# Why an effect is no cause at the size that was fitted.
AT_BOUND = "has a size at the end of what is searched"
ABSENT = "has a size of nothing"
SHOWN_ONCE = "comes back too seldom in these runs: it could be any function of the angle"
TOLERATED = "lies within the tolerance of its constant"


class Store:
    """Explanations of one case; `fits` holds the best fit of each that was tried.

    without : effects left out of the catalogue; `wanted` are the others.
    """

    def __init__(self, problem: Problem, without: frozenset[str] = frozenset()):
        self.problem = problem
        self.effects = problem.effects
        self.wanted = {e for e in problem.effects if e not in without}
        self.fitter = Fitter(problem)
        self.fits: dict[Hypothesis, Fit] = {}
        self._scores: dict[tuple, float] = {}  # scores of fits, by the explanation and where the fit started
        self._nuisances_only: Fit | None = None
        self._local_optima: dict[Hypothesis, tuple[Fit, Fit]] = {}

    # ---- scores

    def log_prior(self, hypothesis: Hypothesis) -> float:
        """Log prior probability of a set of effects, which are independent of one another."""
        each = EXPECTED_EFFECTS / len(self.effects)
        return sum(math.log(each * (SIDE_PRIOR[side] if self.effects[e].sided else 1.0)) for e, side in hypothesis)

    def prior(self, fit: Fit) -> float:
        """-2 log prior density of an explanation with its sizes.

        An effect of one side is on the other side too with a probability of one half, of another size: friction on both
        wheels is one cause that scatters, not two.
        """
        left, right = ({e for e, s in fit.hypothesis if s == side} for side in ("left", "right"))
        alone = math.log(SIDE_PRIOR["right"] * EXPECTED_EFFECTS / len(self.effects))
        log_prior = self.log_prior(fit.hypothesis) + len(left & right) * (math.log(SIDE_PRIOR["both"]) - alone)
        return prior_cost(fit.z, fit.u) - 2.0 * log_prior

    def score(self, fit: Fit) -> float:
        """-2 log of evidence times prior."""
        return fit.score - 2.0 * self.log_prior(fit.hypothesis)

    def excess_reduction(self, fit: Fit, other: Fit) -> float:
        """By how much one explanation reduces another's excess over white noise, as a share of that excess."""
        return (self.score(other) - self.score(fit)) / max(excess(self.problem, other), 1.0)

    def admissible(self, fit: Fit) -> bool:
        """Whether each effect of an explanation can be a cause, see `refused`, and no two of them are one."""
        return math.isfinite(fit.score) and not self.refused(fit)

    def refused(self, fit: Fit) -> dict[tuple[str, str], str]:
        """Effects of an explanation that are no cause at their size, and why.

        A size at its bound replaces something else, and one of nothing is no effect. A ratio within three sigmas of the
        tolerance of R, K, J or B is a nuisance (contract, section 2). What is periodic comes back.
        """
        robot, found = self.problem.robot, {}
        for cause, values in zip(fit.hypothesis, fit.values):
            effect = self.effects[cause[0]]
            if effect.at_its_bound(values):
                found[cause] = AT_BOUND
            elif effect.absent(values, robot):
                found[cause] = ABSENT
            elif any(
                abs(values[p.name] - 1.0) <= band(robot, p.of) for p in effect.parameters if p.name == "ratio" and p.of
            ):
                found[cause] = TOLERATED
            elif effect.periodic and not ripple.comes_back(self.problem, cause[1], values[effect.parameters[1].name]):
                found[cause] = SHOWN_ONCE
        return found

    def best(self) -> Fit:
        """The most probable explanation so far."""
        return min((f for f in self.fits.values() if self.admissible(f)), key=self.score)

    def more_probable(self, fit: Fit, others: Iterable[Fit]) -> Fit:
        """The most probable of an explanation and others; one that leaves no gap is kept unless odds are convincing."""
        best = min(others, key=self.score, default=fit)
        least = 2.0 * math.log(CONVINCING) if self.within_noise(fit) else 0.0
        return best if self.score(best) < self.score(fit) - least else fit

    def gap(self, fit: Fit) -> float:
        return self.problem.gap(fit.model(self.problem))

    def within_noise(self, fit: Fit) -> bool:
        """Whether the gap of an explanation is no larger than noise makes it, as declared or as samples show it: below
        `LEAST`.
        """
        model = fit.model(self.problem)
        return min(self.problem.gap(model), self.problem.declared_gap(model)) < LEAST

    def supported(self, extended: Fit, fit: Fit, closest: float) -> bool:
        """Whether an explanation is more probable than a subset of it, its gain limited by its scatter, and reduces the
        subset's excess over white noise, or the gap, by more than a small share.

        closest : the smallest gap before. One of the two measures suffices: either may say little until other effects
        are included.
        """
        prior = self.log_prior(extended.hypothesis) - self.log_prior(fit.hypothesis)
        if prior + log_odds(*likelihood_gain(self.problem, extended, fit)) < 0.0:
            return False
        gain = self.score(fit) - self.score(extended)
        return gain >= MINOR_SHARE * excess(self.problem, fit) or enough_to_extend(closest, self.gap(extended))

    # ---- fits

    def try_fit(self, hypothesis: Hypothesis, u: np.ndarray, near: Fit, rough: bool = False) -> Fit:
        """The best fit of an explanation so far, also from scaled parameters and another fit's nuisances."""
        return self.try_fits([Proposal(hypothesis, u, near)], rough)[0]

    def try_fits(self, proposals: Iterable[Proposal], rough: bool = False) -> list[Fit]:
        """The same of several proposals, side by side; `rough`: few steps, with the derivatives of the fit that a
        proposal starts from by the effects that both have at the same size."""
        proposals = list(proposals)
        self.scores_of(proposals, rough)
        return [self.fits[one.hypothesis] for one in proposals]

    def converged(self, fits: Iterable[Fit]) -> list[Fit]:
        """Rough fits, each fitted again to convergence from its present parameters."""
        return self.try_fits(Proposal(f.hypothesis, f.u, f) for f in fits)

    def settled(self, fits: Sequence[Fit]) -> list[Fit]:
        """Fits taken on to their optima. Where a gap is left, the usual fits end well before, at places that hang on
        the last digits of the noise, and held-out runs would compare how far each fit came."""
        found = side_by_side(self.problem, map(self.fitter.settling, fits))
        for fit in found:
            best = self.fits.get(fit.hypothesis)
            if fit.noise.root is not None and (best is None or fit.cost < best.cost):
                self.fits[fit.hypothesis] = fit
        return found

    def scores_of(self, proposals: Sequence[Proposal], rough: bool) -> list[float]:
        """Fit as `try_fits` does; the score of each of these fits, which may be worse than an earlier one's."""
        keys = [(one.hypothesis, one.u.tobytes(), one.near.hypothesis, one.near.cost, rough) for one in proposals]
        new = {k: one for k, one in zip(keys, proposals) if k not in self._scores or one.hypothesis not in self.fits}
        works = [self.fitter.fitting_to(one, rough) for one in new.values()]
        for key, fit in zip(new, side_by_side(self.problem, works)):
            best = self.fits.get(fit.hypothesis)
            if best is None or fit.cost < best.cost:
                self.fits[fit.hypothesis] = fit
            self._scores[key] = self.score(fit)
        return [self._scores[key] for key in keys]

    def fit_without_effects(self, noise: Likelihood) -> Fit:
        """The explanation without any effect, roughly fitted from a discrepancy; it replaces an earlier one."""
        self.fits[()] = self.fitter.fit((), np.empty(0), np.zeros(self.fitter.count), noise, ROUGH_ITERATIONS)
        return self.fits[()]

    def restrict_to(self, *fits: Fit) -> None:
        """Keep some explanations only, fitted again with the present initial states and delays of runs."""
        kept = {f.hypothesis: f for f in fits}
        self.fits = {h: self.fitter.fit(h, f.u, f.z, f.noise, ITERATIONS) for h, f in kept.items()}

    def nuisances_only(self) -> Fit:
        """The nominal robot with the nuisances that bring its replay as close as their tolerances allow: fitted by
        white noise, so that what they could explain is not taken for a discrepancy."""
        if self._nuisances_only is None or self._nuisances_only.start != self.fitter.start:
            z, white = np.zeros(self.fitter.count), self.problem.white()
            self._nuisances_only = self.fitter.fit((), np.empty(0), z, white, fixed=True)
        return self._nuisances_only

    def local_optima(self, fits: Sequence[Fit]) -> list[list[Fit]]:
        """Of each explanation the fit, that by plain squares from no nuisance, and that by the likelihood from there.

        A logarithm of squares has many local optima, since what fits a stretch well makes that stretch heavy; plain
        squares have few, and do not depend on the noise that is declared. Held-out runs decide which one is best.
        """
        white = self.problem.white()
        new = [
            f
            for f in fits
            if f.hypothesis not in self._local_optima or self._local_optima[f.hypothesis][0].start != f.start
        ]
        plain = side_by_side(
            self.problem,
            [self.fitter.fitting(f.hypothesis, f.u, np.zeros_like(f.z), white, ITERATIONS, fixed=True) for f in new],
        )
        likely = side_by_side(self.problem, map(self._from_plain, plain))
        for others in zip(plain, likely, strict=True):
            self._local_optima[others[0].hypothesis] = others
        return [[fit, *filter(self.admissible, self._local_optima[fit.hypothesis])] for fit in fits]

    def _from_plain(self, plain: Fit) -> Requesting[Fit]:
        """An explanation that was fitted by plain squares, by the likelihood from there, graduated.

        Not with a rough effect: its misfit has many optima of its own, and by the likelihood of much noise what is
        missing elsewhere would choose among them.
        """
        if any(self.effects[effect].rough for effect, _ in plain.hypothesis):
            return self.fitter.fitting(plain.hypothesis, plain.u, plain.z, plain.noise)
        return self.fitter.graduating(plain)
