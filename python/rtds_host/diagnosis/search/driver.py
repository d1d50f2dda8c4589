"""One search: effects are added while the evidence asks for them, taken out again, exchanged, and looked for again from
where the first ones are missing."""

from __future__ import annotations

import math

from rtds_host.diagnosis.fit import Fit, Hypothesis
from rtds_host.diagnosis.likelihood import Likelihood
from rtds_host.diagnosis.problem import CHI2, Problem
from rtds_host.diagnosis.search.moves import adding, exchanging, polishing, removing, renaming
from rtds_host.diagnosis.search.screening import Screening
from rtds_host.diagnosis.search.store import Store

# Numerical: how many effects an explanation may have: more than a person could mend at once.
MOST_EFFECTS = 7
# Numerical: how many effects in a row may be added that are not believed yet.
DOUBTFUL = 1
# Numerical: rounds of exchanging effects and looking for more.
EXCHANGES = 3
# Numerical: work (`Problem.work`) after which a search goes no further, and one that is to be quick: a minute and a
# half, and half a minute.
MOST_WORK, QUICK_WORK = 1.2e9, 4e8


class Limits:
    """Of one search and of its account, which may do as much again: the work at which each ends. `ended`: whether one
    of them did."""

    def __init__(self, problem: Problem, quick: bool):
        self.problem = problem
        self.quick = quick
        self.ended = False
        self.search_until = self.account_until = math.inf

    def begin(self) -> None:
        """A search begins; of an axis there are three of each case, of a robot two."""
        most = QUICK_WORK if self.quick else MOST_WORK
        self.search_until, self.account_until = self.problem.work + most, self.problem.work + 2.0 * most

    def spent(self) -> bool:
        """Whether the search has done the work that it may do: it then ends with what it has found."""
        return self._reached(self.search_until)

    def exhausted(self) -> bool:
        """Whether the account has: no look-alike is then looked for that was not met."""
        return self._reached(self.account_until)

    def _reached(self, work: float) -> bool:
        reached = self.problem.work >= work
        self.ended |= reached
        return reached


class Search:
    """One case's search over explanations; `trace` says which steps were taken."""

    def __init__(self, problem: Problem, quick: bool = False, without: frozenset[str] = frozenset()):
        self.problem = problem
        self.quick = quick
        self.store = Store(problem, without)
        self.screening = Screening(quick)
        self.limits = Limits(problem, quick)
        self.looked: set[Hypothesis] = set()  # explanations on top of which slow effects were looked for
        self.trace: list[str] = []

    def begin(self) -> Fit:
        """The explanation without any effect, from which a search goes on."""
        self._align()
        self.limits.begin()
        return self._nothing(self._discrepancy())

    def run(self) -> Fit:
        """Search; the most probable explanation."""
        store = self.store
        self._align()
        found = self._search()
        suggested = store.fitter.start
        if suggested.headings and not store.closed(found):
            # Headings that the nominal robot suggests are bent by what it lacks: once more from the declared ones.
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
        """A ripple follows the measured angles, and runs begin where the nominal robot suggests."""
        self.problem.follow_angles(True)
        fitter = self.store.fitter
        fitter.start = self.problem.aligned(self.problem.nominal.begun(fitter.start))

    def _discrepancy(self) -> Likelihood:
        """What the nominal robot leaves."""
        nominal = self.problem.nominal.begun(self.store.fitter.start)
        return self.problem.white().estimated(self.problem.residual(nominal))

    def _nothing(self, discrepancy: Likelihood) -> Fit:
        """The explanation without any effect, on top of which nothing has been looked for yet."""
        self.screening, self.looked = self.screening.again(), {()}
        return self.store.nothing(discrepancy)

    def _search(self) -> Fit:
        store, spent = self.store, self.limits.spent
        discrepancy = self._discrepancy()
        self.limits.begin()
        fit = self._nothing(discrepancy)
        for _ in range(EXCHANGES):
            fit = self.climb(fit)
            fit = polishing.polished(store, fit, fit.hypothesis)
            count = 1 if spent() else 2 if self.quick else 4
            better = self._noted("exchange", fit, exchanging.exchanged(store, self.screening, fit, count))
            if better is fit and not spent():
                better = self._noted("exchange", fit, exchanging.pairs_exchanged(store, self.screening, fit))
            done, fit = better is fit, better
            if done or spent():
                break
        # Where no gap is left the likelihood is good enough to decide, blemishes and all; the account leaves these out.
        fit = fit if store.named(fit) else store.best()
        fit = store.better(fit, [store.best()]) if store.closed(fit) else fit
        return self._noted("rename", fit, renaming.renamed(store, fit))

    def _noted(self, step: str, fit: Fit, other: Fit) -> Fit:
        """The explanation that a step led to, which the trace notes if it is another."""
        if other is not fit:
            out, new = set(fit.hypothesis) - set(other.hypothesis), set(other.hypothesis) - set(fit.hypothesis)
            self.trace.append(f"{step} {out or ''} -> {new or ''}, {self.store.score(other):.0f}")
        return other

    def _as_declared(self, fit: Fit) -> Fit:
        """The same with runs that began as declared, where the explanation does not ask for anything else."""
        store = self.store
        start = store.fitter.start
        if start.headings:
            store.fitter.start = start.with_headings({})
            declared = store.fitter.fit(fit.hypothesis, fit.u, fit.z, fit.noise)
            if declared.cost < fit.cost + CHI2:
                store.keep(store.fits[()], declared)
                return store.fits[fit.hypothesis]
            store.fitter.start = start
        return fit

    def _open_loop(self, fit: Fit) -> Fit:
        """The explanation fitted with a ripple at the replay's own angle, as the gap is judged."""
        store = self.store

        def periodic(hypothesis: Hypothesis) -> bool:
            return any(store.effects[e].periodic for e, _ in hypothesis)

        if not periodic(fit.hypothesis):
            return fit
        store.fits = {h: f for h, f in store.fits.items() if not periodic(h)}
        return polishing.polished(store, store.in_earnest([fit])[0], fit.hypothesis)

    def extend(self, fit: Fit) -> Fit | None:
        """Add the effect that the evidence asks for most; None if there is none."""
        screens, self.screening = self.screening.renewed(self.store, fit)
        return adding.extended(self.store, screens, fit, 5 if self.quick else 10)

    def next_step(self, accepted: Fit, closest: float) -> Fit | None:
        """The most probable explanation met with one effect more that is believed; None if there is none. What promises
        most may be a substitute that no run but one asks for."""
        store = self.store
        met = [
            f
            for f in store.fits.values()
            if len(f.hypothesis) == len(accepted.hypothesis) + 1
            and store.named(f)
            and set(accepted.hypothesis) < set(f.hypothesis)
            and store.score(f) < store.score(accepted)
        ]
        for fit in sorted(met, key=store.score):
            if store.believed(fit, accepted, closest):
                return store.in_earnest([fit])[0]
        return None

    def climb(self, fit: Fit) -> Fit:
        """Add effects while they are believed. One may only be believed once another is in; but one after another that
        is not leads nowhere, and none of them stays."""
        store = self.store
        accepted, doubtful, closest = fit, 0, store.gap(fit)
        while len(fit.hypothesis) < MOST_EFFECTS and not self.limits.spent():
            extended = self.extend(fit)
            if extended is None or (doubtful == DOUBTFUL and not store.believed(extended, accepted, closest)):
                other = self.next_step(accepted, closest) if not store.closed(accepted) else None
                if other is not None:
                    new = set(other.hypothesis) - set(accepted.hypothesis)
                    accepted = fit = self._noted("add believed", accepted, polishing.polished(store, other, new))
                    doubtful, closest = 0, min(closest, store.gap(fit))
                    continue
                if accepted.hypothesis in self.looked or store.closed(accepted):
                    break
                # What a delay or a wrong constant hid from the first screening: a swinging gear, a slipping tyre.
                fit = accepted
                self.looked.add(fit.hypothesis)
                self.screening, doubtful = self.screening.again(), 0
                continue
            self._noted("add", fit, extended)
            fit = self._noted("prune", extended, removing.pruned(store, extended))
            accepted, fit = self._begun_elsewhere(accepted, fit)
            if store.believed(fit, accepted, closest):
                accepted, doubtful, closest = fit, 0, min(closest, store.gap(fit))
            else:
                doubtful += 1
        return accepted

    def _begun_elsewhere(self, accepted: Fit, fit: Fit) -> tuple[Fit, Fit]:
        """The accepted explanation and the one that it led to, both as runs began by the latter."""
        store, problem = self.store, self.problem
        model = fit.model(problem)
        start = problem.aligned_commands(model.begun(problem.aligned(model)))
        if start == store.fitter.start:
            return accepted, fit
        # Runs began elsewhere or later than was thought: what was fitted to other beginnings is of no use.
        store.fitter.by_nuisance, store.fitter.start = None, start
        store.keep(store.fits[()], accepted, fit)
        accepted, fit = store.fits[accepted.hypothesis], store.fits[fit.hypothesis]
        # Where runs began wrongly, what made up for that promised most.
        other = self.extend(accepted) if fit is not accepted else None
        return accepted, min((f for f in (fit, other) if f is not None), key=store.score)
