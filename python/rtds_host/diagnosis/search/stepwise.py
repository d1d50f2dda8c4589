"""Stepwise selection by held-out runs, for cases in which a gap remains.

A beam keeps the explanations of highest likelihood, but held-out runs decide between explanations (`choice`). So the
search continues from the explanation that held-out runs choose. A step adds one effect, exchanges one or two for
others, or two for one, and held-out runs choose again (M. A. Efroymson, Multiple regression analysis, 1960). If they
choose the same one, the next step is taken from the one that comes closest to it: an effect may help only next to
another. The search ends when only noise is left, or after `STEPS` steps. Where the budget is used up before, a step
only adds one effect to the explanation that is chosen.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence
from dataclasses import replace

from rtds_host.diagnosis.choice import MAX_RESIDUAL_RATIO, HeldOutScore, deciding, posterior, residual_ratio
from rtds_host.diagnosis.fit import Fit, Hypothesis
from rtds_host.diagnosis.gap import LEAST
from rtds_host.diagnosis.search.beam import additions, most_probable, screenings, widened
from rtds_host.diagnosis.search.driver import Search
from rtds_host.diagnosis.search.moves import exchanging, removing, renaming

# Numerical: most steps; explanations by additions, and by exchanges, that held-out runs judge at each step; effects of
# each screening that are tried in exchange for one, of an axis (True) and of a robot (False).
STEPS, JUDGED, EXCHANGED = 3, 6, {True: 4, False: 2}


class Selection:
    """The explanations of several searches over the same runs, each with its score on held-out runs."""

    def __init__(self, searches: Sequence[Search]):
        self.searches = searches
        self._judged: dict[Fit, tuple[HeldOutScore, Search]] = {}
        self._seen: set[Fit] = set()  # fits that were looked at, judged or not

    @classmethod
    def of_beams(cls, searches: Sequence[Search], best: Fit) -> Selection:
        """The explanations that a beam of each search finds, and `best`, the first search's most probable one."""
        selection = cls(searches)
        selection.judge(searches[0], [best])
        for search in searches:
            for fits in widened(search).values():
                selection.judge(search, fits)
        return selection

    def judge(self, search: Search, fits: Sequence[Fit]) -> None:
        """Settle explanations of a search, score them on held-out runs and add those that could be chosen; none is
        scored twice."""
        problem, selected = search.problem, self.choice()[1] if self._judged else None
        new = [fit for fit in fits if fit not in self._seen]
        good = [
            fit
            for fit in new
            if selected is None or self.could_be_chosen(HeldOutScore.in_sample(problem, fit), selected)
        ]
        problem.follow_angles(True)
        ends = zip(good, search.store.settled(good), strict=True)
        # A size may move to its bound, or to nothing, where no explanation is.
        settled = [end if search.store.admissible(end) else fit for fit, end in ends]
        problem.follow_angles(False)
        self._seen.update(new, settled)
        self._judged |= {fit: (HeldOutScore.in_few_steps(problem, fit), search) for fit in settled}

    def could_be_chosen(self, one: HeldOutScore, selected: HeldOutScore) -> bool:
        """Whether an explanation with this in-sample score could be chosen, or decide whether one with more effects is.

        With more effects than the selected one it must reduce the residual by enough; else it must be more probable
        than the selected one, or than all that have as few effects as it has.
        """
        count, more = len(one.fit.hypothesis), len(one.fit.hypothesis) - len(selected.fit.hypothesis)
        if more > 0:
            return residual_ratio(one, selected) < MAX_RESIDUAL_RATIO**more
        prior = self.searches[0].store.prior
        rivals = (
            [score for fit, (score, _) in self._judged.items() if len(fit.hypothesis) == count] if more else [selected]
        )
        return not rivals or posterior(one, prior) <= min(posterior(rival, prior) for rival in rivals)

    def choice(
        self, without: Collection[Hypothesis] = (), others: Sequence[tuple[HeldOutScore, Search]] = ()
    ) -> tuple[Search, HeldOutScore]:
        """The score of the explanation that held-out runs choose, and the search that found it.

        without : explanations that are not to be chosen; others : further ones, with the search that each is of.
        """
        while True:
            by_count: dict[int, list[HeldOutScore]] = {}
            found_by: dict[Fit, Search] = {}
            known = [pair for fit, pair in self._judged.items() if fit.hypothesis not in without]
            for score, search in (*known, *others):
                by_count.setdefault(len(score.fit.hypothesis), []).append(score)
                found_by[score.fit] = search
            decisive = deciding(by_count, self.searches[0].store.prior)
            # None of them may owe it to a fit without a run that had failed.
            unconverged = [score for score in decisive if not score.converged]
            if not unconverged:
                return found_by[decisive[-1].fit], decisive[-1]
            for score in unconverged:
                self._judged[score.fit] = HeldOutScore.of(score.problem, score.fit), found_by[score.fit]

    def _most_promising(self, selected: HeldOutScore, tried: set[Hypothesis]) -> HeldOutScore | None:
        """The explanation to take the next steps from: the selected one, or else the one that comes closest to being
        selected; None where steps were tried from all."""

        def excess(one: HeldOutScore) -> float:
            more = len(one.fit.hypothesis) - len(selected.fit.hypothesis)
            return residual_ratio(one, selected) / MAX_RESIDUAL_RATIO**more

        if selected.fit.hypothesis not in tried:
            return selected
        left = [score for fit, (score, _) in self._judged.items() if fit.hypothesis not in tried]
        return min(left, key=excess, default=None)

    def stepwise(self) -> tuple[Search, Fit]:
        """The explanation that held-out runs choose after further steps, and the search that found it."""
        found_by, selected = self.choice()
        found_by.limits.allow_steps()
        tried: set[Hypothesis] = {()}
        # Where the motion is unstable, noise in the initial state alone makes a gap. Whole runs then choose by chance.
        # The more explanations are compared, the more often one is chosen by chance: no step adds any.
        for _ in range(STEPS if self.searches[0].problem.start_gap < LEAST else 0):
            base = self._most_promising(selected, tried)
            if base is None or found_by.store.within_noise(selected.fit):
                break
            tried.add(base.fit.hypothesis)
            if base is selected and found_by.limits.attribution_over_budget():
                # What is chosen may still lack the one effect that leaves least.
                self.judge(found_by, with_one_more(found_by, base.fit))
            for search in self.searches:
                self.judge(search, neighbours(search, _of(search, base)))
            found_by, selected = self.choice()
        return found_by, by_likelihood(found_by, selected.fit)


def by_likelihood(search: Search, fit: Fit) -> Fit:
    """A selected explanation, which may be fitted by ordinary least squares (`Store.local_optima`), with the likelihood
    that its residual has, as any other fit. Where only noise is left, it is fitted again by maximum likelihood.
    """
    fit = replace(fit, noise=search.problem.white().estimated(fit.residual))
    return search.store.converged([fit])[0] if search.store.within_noise(fit) else fit


def _of(search: Search, selected: HeldOutScore) -> Fit:
    """The selected explanation as a fit of this search's problem; fitted again if another search found it."""
    if selected.problem is search.problem:
        return selected.fit
    return search.store.try_fit(selected.fit.hypothesis, selected.fit.u, search.store.fits[()])


def with_one_more(search: Search, fit: Fit) -> list[Fit]:
    """The local optima of the `JUDGED` most probable explanations with one effect more; none where the explanation is
    not admissible."""
    if not search.store.admissible(fit):
        return []
    search.problem.follow_angles(True)
    found = most_probable(search.store, additions(search, fit, screenings(search, fit)(fit)), JUDGED)
    search.problem.follow_angles(False)
    return [optimum for optima in search.store.local_optima(found) for optimum in optima]


def neighbours(search: Search, fit: Fit) -> list[Fit]:
    """The local optima of an explanation and of those one step from it: one effect added, one or two exchanged, or one
    in the place of two.

    Of additions and of exchanges, the `JUDGED` most probable ones. None at all where the budget is used up or the
    explanation is not admissible.
    """
    problem, store, is_axis = search.problem, search.store, search.problem.robot.axis is not None
    if search.limits.attribution_over_budget() or not store.admissible(fit):
        return []
    problem.follow_angles(True)
    screens = screenings(search, fit)
    found = [fit, *most_probable(store, additions(search, fit, screens(fit)), JUDGED)]
    exchanges = []
    for cause, reduced in zip(fit.hypothesis, removing.without(store, fit, *fit.hypothesis)):
        exchanges += renaming.sides(store, fit, cause)
        rivals = exchanging.rivals(store, screens(reduced), [cause], EXCHANGED[is_axis])
        exchanges += [reduced.proposal({rival.cause: rival.start}) for rival in rivals]
    # Two effects are exchanged only where there is work left: there are many pairs.
    two = [] if search.limits.attribution_over_budget() else list(itertools.combinations(fit.hypothesis, 2))
    for pair in two:
        (reduced,) = store.try_fits([fit.proposal({}, without=pair)], rough=True)
        screened = screens(reduced)
        rivals = exchanging.rivals(store, screened, pair, EXCHANGED[is_axis])
        exchanges += [reduced.proposal({rival.cause: rival.start}) for rival in rivals]
        for screen in screened:
            exchanges += exchanging.pairs_for(store, screen, reduced, pair)[: exchanging.PAIRS]
    found += most_probable(store, exchanges, JUDGED)
    problem.follow_angles(False)
    return [optimum for optima in store.local_optima(found) for optimum in optima]
