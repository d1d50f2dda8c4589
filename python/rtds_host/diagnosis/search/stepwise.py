"""Stepwise selection by held-out runs, for cases in which a gap remains.

Beams keep what the likelihood ranks first, but held-out runs decide (`choice`). So the search goes on from the
explanation that they choose: one effect is added, or one or two are exchanged, and they choose again. It ends where
no such step leads to another explanation (M. A. Efroymson, Multiple regression analysis, 1960).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

from rtds_host.diagnosis.choice import HeldOutScore, chosen
from rtds_host.diagnosis.fit import Fit, Hypothesis
from rtds_host.diagnosis.gap import LEAST
from rtds_host.diagnosis.search.beam import additions, most_probable, screenings, widened
from rtds_host.diagnosis.search.driver import Search
from rtds_host.diagnosis.search.moves import exchanging, removing, renaming

# Numerical: steps; explanations of each kind of step that are judged; effects that are tried in the place of one, of an
# axis and of a robot; and pairs of effects in the place of two.
STEPS, JUDGED, EXCHANGED, PAIRS = 3, 6, {True: 4, False: 2}, 3


class Selection:
    """Explanations of several searches over the same runs, and which of them held-out runs choose."""

    def __init__(self, searches: Sequence[Search]):
        self.searches = searches
        self._judged: list[tuple[HeldOutScore, Search]] = []

    @classmethod
    def of_beams(cls, searches: Sequence[Search], best: Fit) -> Selection:
        """What beams of these searches find, and the first one's best explanation."""
        selection = cls(searches)
        selection.judge(searches[0], [best])
        for search in searches:
            for fits in widened(search).values():
                selection.judge(search, [fit for fit in fits if fit is not best])
        return selection

    def judge(self, search: Search, fits: Sequence[Fit]) -> None:
        """Take explanations of a search in."""
        self._judged += [(HeldOutScore.of(search.problem, fit), search) for fit in fits]

    def choice(self) -> tuple[Search, HeldOutScore]:
        """The explanation that held-out runs choose, and the search that it is of."""
        found: dict[int, list[HeldOutScore]] = {}
        for score, _ in self._judged:
            found.setdefault(len(score.fit.hypothesis), []).append(score)
        taken = chosen(found, self.searches[0].store.prior)
        return next(search for score, search in self._judged if score is taken), taken

    def stepwise(self) -> tuple[Search, Fit]:
        """The same after steps from there."""
        owner, taken = self.choice()
        seen: set[Hypothesis] = {()}
        # Where the noise of the start alone makes a gap, whole runs choose by chance, the more the more there is.
        for _ in range(STEPS if self.searches[0].problem.start_gap < LEAST else 0):
            if taken.fit.hypothesis in seen or owner.store.within_noise(taken.fit):
                break
            seen.add(taken.fit.hypothesis)
            for search in self.searches:
                self.judge(search, neighbours(search, _of(search, taken)))
            owner, taken = self.choice()
        # What plain squares found is judged by the likelihood as all else is, and fitted by it where that is exact.
        fit = replace(taken.fit, noise=owner.problem.white().estimated(taken.fit.residual))
        return owner, owner.store.converged([fit])[0] if owner.store.within_noise(fit) else fit


def _of(search: Search, taken: HeldOutScore) -> Fit:
    """A chosen explanation as a fit of this search's problem."""
    if taken.problem is search.problem:
        return taken.fit
    return search.store.try_fit(taken.fit.hypothesis, taken.fit.u, search.store.fits[()])


def neighbours(search: Search, fit: Fit) -> list[Fit]:
    """The local optima of an explanation and of those a step away: one effect more, or one or two exchanged.

    Of each kind of step the most probable ones; none beyond the budget.
    """
    problem, store, axis = search.problem, search.store, search.problem.robot.axis is not None
    if search.limits.attribution_over_budget() or not store.admissible(fit):
        return []
    problem.follow_angles(True)
    screens = screenings(search, fit)
    found = [fit, *most_probable(store, additions(search, fit, screens(fit)), JUDGED)]
    if not search.limits.attribution_over_budget():
        exchanged = []
        for cause, alone in zip(fit.hypothesis, removing.without(store, fit, *fit.hypothesis)):
            exchanged += renaming.sides(store, fit, cause)
            rivals = exchanging.rivals(store, screens(alone), cause, EXCHANGED[axis])
            exchanged += [alone.proposal({one.cause: one.start}) for one in rivals]
        for two in itertools.combinations(fit.hypothesis, 2):
            (alone,) = store.try_fits([fit.proposal({}, without=two)], rough=True)
            for screen in screens(alone):
                exchanged += exchanging.pairs_for(store, screen, alone, two)[:PAIRS]
        found += most_probable(store, exchanged, JUDGED)
    problem.follow_angles(False)
    return [optimum for optima in store.local_optima(found) for optimum in optima]
