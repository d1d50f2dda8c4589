"""One stepwise search for the most probable explanation.

Effects are added while the evidence supports them (forward selection) and removed once it no longer does (backward
elimination). Then effects of the explanation are exchanged for others. Both are repeated until no exchange makes the
explanation more probable.
"""

from __future__ import annotations

import math

from rtds_host.diagnosis.fit import Fit, Hypothesis
from rtds_host.diagnosis.likelihood import Likelihood
from rtds_host.diagnosis.problem import CHI2, Problem
from rtds_host.diagnosis.search.moves import adding, exchanging, refining, removing, renaming
from rtds_host.diagnosis.search.screening import Screening
from rtds_host.diagnosis.search.store import Store

# Numerical: how many effects an explanation may have.
MOST_EFFECTS = 7
# Numerical: how many effects in a row may be added that the evidence does not support yet.
MAX_UNSUPPORTED = 1
# Numerical: rounds of forward selection and exchange.
EXCHANGES = 3
# Numerical: budget of work (`Problem.work`) of a search, and of a quick one: about 40 s, and 13 s.
MOST_WORK, QUICK_WORK = 6e8, 2e8
# Numerical: the share of it that an axis has: more found only other explanations of the measured ones.
AXIS_SHARE = 0.32
# Numerical: what is left for steps by runs left out, as a share of the budget.
STEPS_SHARE = 0.25


class Limits:
    """Budgets of work of one search and of the attribution after it, both of the same size.

    `ended`: whether one of them was used up.
    """

    def __init__(self, problem: Problem, quick: bool):
        self.problem, self.quick, self.ended = problem, quick, False
        self.most = (QUICK_WORK if quick else MOST_WORK) * (1.0 if problem.robot.axis is None else AXIS_SHARE)
        self.search_until = self.attribution_until = math.inf

    def begin(self) -> None:
        """Start both budgets. A case of an axis is searched three times, one of a robot twice."""
        self.search_until, self.attribution_until = self.problem.work + self.most, self.problem.work + 2.0 * self.most

    def allow_steps(self) -> None:
        """Leave something for steps by runs left out, whatever was used before: what a beam ends in is rarely the best
        explanation of a measured machine."""
        self.attribution_until = max(self.attribution_until, self.problem.work + STEPS_SHARE * self.most)

    def search_over_budget(self) -> bool:
        """Whether the search has used its budget. It then ends with what it has found."""
        self.ended |= self.problem.work >= self.search_until
        return self.problem.work >= self.search_until

    def attribution_over_budget(self) -> bool:
        """Whether the attribution has used its budget. No further indistinguishable effects are then fitted."""
        self.ended |= self.problem.work >= self.attribution_until
        return self.problem.work >= self.attribution_until


class Search:
    """One case's search over explanations; `trace` lists the steps that changed the explanation."""

    def __init__(self, problem: Problem, quick: bool = False, without: frozenset[str] = frozenset()):
        self.problem, self.quick = problem, quick
        self.store, self.screening, self.limits = Store(problem, without), Screening(quick), Limits(problem, quick)
        self.searched: set[Hypothesis] = set()  # explanations at which all sensitivities were computed again
        self.trace: list[str] = []

    def begin(self) -> Fit:
        """The explanation without any effect, where a search starts."""
        self._align()
        self.limits.begin()
        return self._without_effects(self._discrepancy())

    def run(self) -> Fit:
        """Search; the most probable explanation."""
        store = self.store
        self._align()
        found = self._search()
        suggested = store.fitter.start
        if suggested.headings and not store.within_noise(found):
            # Headings estimated with the nominal robot are biased by unmodelled effects: search with the declared, too.
            first, store.fits = store.fits, {}
            store.fitter.start = suggested.with_headings({}).with_command_delays({})
            other = self._search()
            if store.score(found) < store.score(other):
                store.fits, other = first, found
                store.fitter.start = suggested
            found = other
        found = self._as_declared(found)
        self.problem.follow_angles(False)
        return self._open_loop(found)

    def _align(self) -> None:
        """Evaluate ripples at the measured angles, and estimate the runs' initial states with the nominal robot."""
        self.problem.follow_angles(True)
        fitter = self.store.fitter
        fitter.start = self.problem.aligned(self.problem.nominal.with_start(fitter.start))

    def _discrepancy(self) -> Likelihood:
        """The likelihood estimated from the residual of the nominal robot."""
        nominal = self.problem.nominal.with_start(self.store.fitter.start)
        return self.problem.white().estimated(self.problem.residual(nominal))

    def _without_effects(self, discrepancy: Likelihood) -> Fit:
        """The explanation without any effect; the next screening computes the sensitivities to all effects again."""
        self.screening, self.searched = self.screening.again(), {()}
        return self.store.fit_without_effects(discrepancy)

    def _search(self) -> Fit:
        """Forward selection and exchange in turn, until no exchange is more probable or the budget is used up."""
        store, over_budget, discrepancy = self.store, self.limits.search_over_budget, self._discrepancy()
        self.limits.begin()
        fit = self._without_effects(discrepancy)
        for _ in range(EXCHANGES):
            fit = self.select_forward(fit)
            refined = refining.refine_locally(store, fit, fit.hypothesis)
            count = 1 if over_budget() else 2 if self.quick else 4
            fit = self._traced("exchange", refined, exchanging.exchanged(store, self.screening, refined, count))
            if fit is refined and not over_budget():
                fit = self._traced("exchange", refined, exchanging.pairs_exchanged(store, self.screening, refined))
            if fit is refined or over_budget():
                break
        # Where no gap is left the likelihood decides, even if effects are too small to be included. The attribution
        # removes these.
        fit = fit if store.admissible(fit) else store.best()
        fit = store.more_probable(fit, [store.best()]) if store.within_noise(fit) else fit
        return self._traced("rename", fit, renaming.renamed(store, fit))

    def _traced(self, step: str, fit: Fit, other: Fit) -> Fit:
        """The explanation after a step; the step is written to the trace if it changed the explanation."""
        if other is not fit:
            removed, added = set(fit.hypothesis) - set(other.hypothesis), set(other.hypothesis) - set(fit.hypothesis)
            self.trace.append(f"{step} {removed or ''} -> {added or ''}, {self.store.score(other):.0f}")
        return other

    def _as_declared(self, fit: Fit) -> Fit:
        """The explanation with the declared headings, unless these fit significantly worse."""
        store, start = self.store, self.store.fitter.start
        if start.headings:
            store.fitter.start = start.with_headings({})
            declared = store.fitter.fit(fit.hypothesis, fit.u, fit.z, fit.noise)
            if declared.cost < fit.cost + CHI2:
                store.restrict_to(store.fits[()], declared)
                return store.fits[fit.hypothesis]
            store.fitter.start = start
        return fit

    def _open_loop(self, fit: Fit) -> Fit:
        """The explanation fitted in open loop: with ripples at the simulated angles, as the gap is computed."""
        store = self.store

        def periodic(hypothesis: Hypothesis) -> bool:
            return any(store.effects[e].periodic for e, _ in hypothesis)

        if not periodic(fit.hypothesis):
            return fit
        store.fits = {h: f for h, f in store.fits.items() if not periodic(h)}
        return refining.refine_locally(store, store.converged([fit])[0], fit.hypothesis)

    def extend(self, fit: Fit) -> Fit | None:
        """Add the effect that raises the evidence most; None if there is none."""
        screens, self.screening = self.screening.renewed(self.store, fit)
        return adding.extended(self.store, screens, fit, 5 if self.quick else 10)

    def best_supported(self, accepted: Fit, closest: float) -> Fit | None:
        """The most probable supported explanation, of those fitted so far, with one effect more; None if there is none.

        closest : the smallest gap so far. The effect with the largest gain may be a substitute that a single run
        supports.
        """
        store = self.store
        larger = [
            f
            for f in store.fits.values()
            if set(accepted.hypothesis) < set(f.hypothesis)
            and len(f.hypothesis) == len(accepted.hypothesis) + 1
            and store.admissible(f)
            and store.score(f) < store.score(accepted)
        ]
        supported = (f for f in sorted(larger, key=store.score) if store.supported(f, accepted, closest))
        return next((store.converged([f])[0] for f in supported), None)

    def select_forward(self, fit: Fit) -> Fit:
        """Forward selection: add effects while the evidence supports them.

        Some effects are supported only together with another. So up to `MAX_UNSUPPORTED` unsupported ones in a row are
        added, and removed again if the explanation with the next is not supported either.
        """
        store = self.store
        accepted, unsupported, closest = fit, 0, store.gap(fit)
        while len(fit.hypothesis) < MOST_EFFECTS and not self.limits.search_over_budget():
            extended = self.extend(fit)
            if extended and (unsupported < MAX_UNSUPPORTED or store.supported(extended, accepted, closest)):
                self._traced("add", fit, extended)
                fit = self._traced("prune", extended, removing.pruned(store, extended))
                accepted, fit = self._with_new_initial_states(accepted, fit)
                if store.supported(fit, accepted, closest):
                    accepted, unsupported, closest = fit, 0, min(closest, store.gap(fit))
                else:
                    unsupported += 1
            elif not store.within_noise(accepted) and (other := self.best_supported(accepted, closest)):
                new = set(other.hypothesis) - set(accepted.hypothesis)
                accepted = fit = self._traced("add supported", accepted, refining.refine_locally(store, other, new))
                unsupported, closest = 0, min(closest, store.gap(fit))
            elif accepted.hypothesis in self.searched or store.within_noise(accepted):
                break
            else:
                # A delay or a wrong constant may have masked other effects in the first screening, such as backlash.
                fit, unsupported, self.screening = accepted, 0, self.screening.again()
                self.searched.add(fit.hypothesis)
        return accepted

    def _with_new_initial_states(self, accepted: Fit, fit: Fit) -> tuple[Fit, Fit]:
        """The accepted explanation and its extension, both with the extension's initial states and delays."""
        store, problem = self.store, self.problem
        model = fit.model(problem)
        start = problem.aligned_commands(model.with_start(problem.aligned(model)))
        if start == store.fitter.start:
            return accepted, fit
        # Fits with other initial states or delays are not comparable.
        store.fitter.by_nuisance, store.fitter.start = None, start
        store.restrict_to(store.fits[()], accepted, fit)
        accepted, fit = store.fits[accepted.hypothesis], store.fits[fit.hypothesis]
        # The last effect may have been added because it compensated for wrong initial states: choose it again.
        other = self.extend(accepted) if fit is not accepted else None
        return accepted, min((f for f in (fit, other) if f is not None), key=store.score)
