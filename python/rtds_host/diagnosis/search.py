"""The search for explanations: effects are added while the evidence asks for them, taken out again, exchanged, and
looked for again from where the first ones are missing."""

from __future__ import annotations

import math

import numpy as np

from rtds_host.diagnosis.explanations import ITERATIONS
from rtds_host.diagnosis.fit import Fit, Hypothesis
from rtds_host.diagnosis.neighbours import Neighbours
from rtds_host.diagnosis.problem import CHI2, Problem

# Numerical: how many effects an explanation may have: more than a person could mend at once.
MOST_EFFECTS = 7
# Numerical: how many effects in a row may be added that are not believed yet.
DOUBTFUL = 1
# Numerical: rounds of exchanging effects and looking for more.
EXCHANGES = 3
# Numerical: work (`Problem.work`) after which a search goes no further, and one that is to be quick: a minute and a
# half, and half a minute.
MOST_WORK, QUICK_WORK = 1.2e9, 4e8


class Search(Neighbours):
    """One case's search over explanations."""

    def __init__(self, problem: Problem, quick: bool = False, without: frozenset[str] = frozenset()):
        super().__init__(problem, quick, without)
        self.looked: set[Hypothesis] = set()  # explanations on top of which slow effects were looked for
        self._until = self.last_work = (
            math.inf
        )  # work at which the search ends, and at which the account looks for no more
        self.ended = False  # whether one of them did before it was done

    def begin(self) -> Fit:
        """The explanation without any effect, from which a search goes on."""
        problem = self.problem
        problem.follow_angles(True)
        start = self.fitter.start = problem.aligned(problem.nominal.begun(self.fitter.start))
        most = self._most()
        self._until, self.last_work = problem.work + most, problem.work + 2.0 * most
        self.slow_sensitivities, self.afresh, self.looked = {}, True, {()}
        noise = problem.white().estimated(problem.residual(problem.nominal.begun(start)))
        return self.fits.setdefault((), self.fitter.fit((), np.empty(0), np.zeros(self.fitter.count), noise, 4))

    def run(self) -> Fit:
        """Search; the most probable explanation."""
        problem = self.problem
        problem.follow_angles(True)
        self.fitter.start = problem.aligned(problem.nominal.begun(self.fitter.start))
        found = self._search()
        suggested = self.fitter.start
        if suggested.headings and not self.closed(found):
            # Headings that the nominal robot suggests are bent by what it lacks: once more from the declared ones.
            first, self.fits = self.fits, {}
            self.fitter.start = suggested.with_headings({}).with_lates({})
            other = self._search()
            if self.score(found) < self.score(other):
                self.fits, other = first, found
                self.fitter.start = suggested
            found = other
        found = self._as_declared(found)
        problem.follow_angles(False)
        return self._open_loop(found)

    def _as_declared(self, fit: Fit) -> Fit:
        """The same with runs that began as declared, where the explanation does not ask for anything else."""
        start = self.fitter.start
        if start.headings:
            self.fitter.start = start.with_headings({})
            declared = self.fitter.fit(fit.hypothesis, fit.u, fit.z, fit.noise)
            if declared.cost < fit.cost + CHI2:
                self.fits = {
                    f.hypothesis: self.fitter.fit(f.hypothesis, f.u, f.z, f.noise) for f in (self.fits[()], declared)
                }
                return self.fits[fit.hypothesis]
            self.fitter.start = start
        return fit

    def _search(self) -> Fit:
        problem = self.problem
        noise = problem.white().estimated(problem.residual(problem.nominal.begun(self.fitter.start)))
        self.slow_sensitivities, self.afresh, self.looked = {}, True, {()}
        most = self._most()
        self._until, self.last_work = problem.work + most, problem.work + 2.0 * most
        fit = self.fits[()] = self.fitter.fit((), np.empty(0), np.zeros(self.fitter.count), noise, 4)
        for _ in range(EXCHANGES):
            fit = self.climb(fit)
            fit = self.polished(fit, fit.hypothesis)
            better = self.exchange(fit, 1 if self.spent() else 2 if self.quick else 4)
            better = self.exchange_pairs(fit) if better is fit and not self.spent() else better
            done, fit = better is fit, better
            if done or self.spent():
                break
        # Where no gap is left the likelihood is good enough to decide, blemishes and all; the account leaves these out.
        fit = fit if self.named(fit) else self.best()
        return self.renamed(self._better(fit, [self.best()]) if self.closed(fit) else fit)

    def _most(self) -> float:
        """Work of one search; of an axis there are three searches of each case, of a robot two."""
        return QUICK_WORK if self.quick else MOST_WORK

    def spent(self) -> bool:
        """Whether the search has done the work that it may do: it then ends with what it has found, which is noted
        (`ended`).
        """
        return self._done(self._until)

    def exhausted(self) -> bool:
        """Whether the account has done as much again: no look-alike is then looked for that was not met, which is noted
        likewise.
        """
        return self._done(self.last_work)

    def _done(self, work: float) -> bool:
        if self.problem.work >= work and not self.ended:
            self.trace.append("ends before it is done")
            self.ended = True
        return self.problem.work >= work

    def _open_loop(self, fit: Fit) -> Fit:
        """The explanation fitted with a ripple at the replay's own angle, as the gap is judged."""
        if not any(self.effects[e].periodic for e, _ in fit.hypothesis):
            return fit
        for hypothesis in [h for h in self.fits if any(self.effects[e].periodic for e, _ in h)]:
            del self.fits[hypothesis]
        return self.polished(self.try_fit(fit.hypothesis, fit.u, fit), fit.hypothesis)

    def next_step(self, accepted: Fit, closest: float) -> Fit | None:
        """The most probable explanation met with one effect more that is believed; None if there is none. What promises
        most may be a substitute that no run but one asks for."""
        met = [
            f
            for f in self.fits.values()
            if len(f.hypothesis) == len(accepted.hypothesis) + 1
            and self.named(f)
            and set(accepted.hypothesis) < set(f.hypothesis)
            and self.score(f) < self.score(accepted)
        ]
        for fit in sorted(met, key=self.score):
            if self._believed(fit, accepted, closest):
                return self.try_fit(fit.hypothesis, fit.u, fit)
        return None

    def climb(self, fit: Fit) -> Fit:
        """Add effects while they are believed. One may only be believed once another is in; but one after another that
        is not leads nowhere, and none of them stays."""
        accepted, doubtful, closest = fit, 0, self.gap(fit)
        looked_at = 5 if self.quick else 10
        while len(fit.hypothesis) < MOST_EFFECTS and not self.spent():
            extended = self.extend(fit, looked_at)
            if extended is None or (doubtful == DOUBTFUL and not self._believed(extended, accepted, closest)):
                other = self.next_step(accepted, closest) if not self.closed(accepted) else None
                if other is not None:
                    accepted = fit = self.polished(other, set(other.hypothesis) - set(accepted.hypothesis))
                    self.trace.append(f"add {set(accepted.hypothesis)}, which is believed")
                    doubtful, closest = 0, min(closest, self.gap(fit))
                    continue
                if accepted.hypothesis in self.looked or self.closed(accepted):
                    break
                # What a delay or a wrong constant hid from the first screening: a swinging gear, a slipping tyre.
                fit = accepted
                self.looked.add(fit.hypothesis)
                self.slow_sensitivities, self.afresh, doubtful = {}, True, 0
                continue
            self.trace.append(
                f"add {set(extended.hypothesis) - set(fit.hypothesis)} "
                f"{self.score(fit):.0f} -> {self.score(extended):.0f}"
            )
            fit = self.prune(extended)
            model = fit.model(self.problem)
            start = self.problem.aligned_commands(model.begun(self.problem.aligned(model)))
            if start != self.fitter.start:
                # Runs began elsewhere or later than was thought: what was fitted to other beginnings is of no use.
                self.fitter.by_nuisance, self.fitter.start = None, start
                kept = {f.hypothesis: f for f in (self.fits[()], accepted, fit)}
                self.fits = {h: self.fitter.fit(h, f.u, f.z, f.noise, ITERATIONS) for h, f in kept.items()}
                accepted, fit = self.fits[accepted.hypothesis], self.fits[fit.hypothesis]
                # Where runs began wrongly, what made up for that promised most.
                other = self.extend(accepted, looked_at) if fit is not accepted else None
                fit = min((f for f in (fit, other) if f is not None), key=self.score)
            if self._believed(fit, accepted, closest):
                accepted, doubtful, closest = fit, 0, min(closest, self.gap(fit))
            else:
                doubtful += 1
        return accepted
