"""Effects that are practically indistinguishable on these runs: fitted in an included effect's place, they fit as well.

`structurally_indistinguishable` has those that no runs of this kind could distinguish, as the effects' files say.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Container, Sequence

from rtds_host.diagnosis.choice import EQUIVALENT_GAP_RATIO, HeldOutScore
from rtds_host.diagnosis.evidence import distinguishable, enough_to_include, likelihood_gain
from rtds_host.diagnosis.fit import Fit
from rtds_host.diagnosis.gap import LEAST
from rtds_host.diagnosis.screen import Candidate, available, clashes, start_values
from rtds_host.diagnosis.search.driver import Search
from rtds_host.diagnosis.search.moves import exchanging, renaming
from rtds_host.diagnosis.search.store import Store
from rtds_host.diagnosis.structurally_indistinguishable import nearly_indistinguishable, structurally_indistinguishable
from rtds_host.diagnosis.thresholds import MINOR_SHARE

Cause = tuple[str, str]
# Members that a set of indistinguishable effects may have (contract, section 5).
LARGEST_SET = 3


def practically_indistinguishable(
    search: Search, fit: Fit, included: Sequence[tuple[Cause, Fit]]
) -> tuple[tuple[tuple[Cause, ...], ...], list[Fit]]:
    """Sets of indistinguishable effects, an included one first in each, and the fits of those that fit as well.

    First come those that are structurally indistinguishable, then those nearly so that fit as well, any others that do,
    and those nearly so that were not fitted. Each was fitted in the effect's place, lies within its bounds there and
    opens no gap: a gyro that is upside down is no track of a negative width.

    included : included effects, and the explanation without each.
    """
    if not included:
        return (), []
    store, sets, equivalent = search.store, [], []
    case, ids = store.problem.case, {effect.id for effect in available(store.problem)} & store.wanted
    leaves_as_little = _leaves_as_little(store, fit)
    for one, without in included:
        structurally, nearly = (
            [cause for cause in equals if cause[0] in ids and not clashes(cause, fit.hypothesis)]
            for equals in (
                structurally_indistinguishable(case, one, fit.hypothesis),
                nearly_indistinguishable(case, one),
            )
        )
        swaps = substitutes_for(search, fit, one, without)
        known = {cause for cause in swaps if cause in nearly or cause[0] in store.effects[one[0]].confused_with}
        gains = _as_likely(store, fit, swaps, known, leaves_as_little)
        # What it is confused with may be one without being ranked first, and so may what that is confused with: the
        # motor's constant for viscous friction, and a gain for that.
        confused = {
            renaming.in_place(store, e, cause) for cause in (one, *gains) for e in store.effects[cause[0]].confused_with
        }
        further = {
            rival.cause: swaps.get(rival.cause) or exchanging.swapped(store, fit, without, rival)
            for rival in (_screened(search, one, without, len(store.effects)) if confused else ())
            if rival.cause in confused and rival.cause not in known
        }
        gains |= _as_likely(store, fit, further, further, leaves_as_little)
        swaps |= further
        equivalent += [swaps[cause] for cause in gains]
        likely = sorted(gains, key=lambda cause: (cause not in known, gains[cause], cause))
        others = (
            cause
            for cause in dict.fromkeys([*structurally, *likely, *nearly])
            if cause in swaps
            and leaves_as_little(swaps[cause])
            or _is_possible(store, fit, one, without, cause, leaves_as_little)
        )
        if members := tuple(itertools.islice(others, LARGEST_SET - 1)):
            sets.append((one, *members))
    return tuple(sets), equivalent


def _leaves_as_little(store: Store, fit: Fit) -> Callable[[Fit], bool]:
    """Whether another explanation is admissible and leaves as little: where a gap remains, one on held-out runs that is
    within a tenth as large; else no gap that is worth naming."""
    if store.within_noise(fit):
        return lambda other: store.admissible(other) and not opens_gap(store.gap(other), store.gap(fit))
    most = EQUIVALENT_GAP_RATIO * HeldOutScore.in_few_steps(store.problem, fit).gap
    return lambda other: store.admissible(other) and HeldOutScore.in_few_steps(store.problem, other).gap <= most


def _is_possible(
    store: Store, fit: Fit, one: Cause, without: Fit, cause: Cause, leaves_as_little: Callable[[Fit], bool]
) -> bool:
    """Whether an effect in another one's place leaves as little at a size that it can have."""
    effect, own = store.effects[cause[0]], dict(zip(fit.hypothesis, fit.values))[one]
    starts = start_values(effect)
    if own.get("ratio") and [p.name for p in effect.parameters] == ["ratio"]:
        # Of two factors that do the same, one is the other or its inverse.
        starts = [{"ratio": own["ratio"]}, {"ratio": 1.0 / own["ratio"]}, *starts]
    proposals = [without.proposal({cause: effect.scaled(effect.within(values))}) for values in starts]
    rough = store.try_fits(proposals, rough=True)
    return bool(rough) and leaves_as_little(*store.converged([min(rough, key=store.score)]))


def _as_likely(
    store: Store, fit: Fit, swaps: dict[Cause, Fit], known: Container[Cause], leaves_as_little: Callable[[Fit], bool]
) -> dict[Cause, float]:
    """Of effects in another one's place those that fit as well, with the gain of log likelihood without each.

    Where only noise is left the likelihood decides. Those `known` to be confused with the effect must differ by more
    than a small share of what they leave: forms that describe a robot no better differ by as much.
    """
    found, exact = {}, store.within_noise(fit)
    for cause, swapped in swaps.items():
        gain, t = likelihood_gain(store.problem, fit, swapped)
        if exact:
            least = MINOR_SHARE if cause in known else 0.0
            share = store.excess_reduction(fit, swapped)
            worse = distinguishable(gain, t, share, store.problem.block_count, least)
        else:
            # More parameters always leave a little less. One on its bound does not count, such as no delay of a filter.
            worse = swapped.free[len(swapped.z) :].sum() > fit.free[len(fit.z) :].sum()
        if not worse and leaves_as_little(swapped):
            found[cause] = gain
    return found


def substitutes_for(search: Search, fit: Fit, one: Cause, without: Fit) -> dict[Cause, Fit]:
    """Effects that could be in one's place, each with its fit there: substitutes of the same size, those that a
    screening without it ranks first, and those of earlier fits."""
    store = search.store
    swaps = renaming.substitutes(store, fit, one)
    for rival in _screened(search, one, without, LARGEST_SET):
        if rival.cause not in swaps:
            swaps[rival.cause] = exchanging.swapped(store, fit, without, rival)
    remaining = set(fit.hypothesis) - {one}
    for hypothesis, other in store.fits.items():
        new = set(hypothesis) - remaining
        if len(hypothesis) == len(fit.hypothesis) and len(new) == 1 and hypothesis != fit.hypothesis:
            (cause,) = new
            if cause not in swaps and not _contains(store, cause, one):
                swaps[cause] = other
    return swaps


def _screened(search: Search, one: Cause, without: Fit, count: int) -> list[Candidate]:
    """Effects that a screening without one ranks first in its place; none once the attribution is over budget."""
    if search.limits.attribution_over_budget():
        return []
    found = exchanging.rivals(search.store, search.screening.screens(search.store, without), [one], count)
    return [rival for rival in found if not _contains(search.store, rival.cause, one)]


def _contains(store: Store, cause: Cause, one: Cause) -> bool:
    """Whether an effect is another one with a further parameter: the same, for no better fit."""
    return one[0] in store.effects[cause[0]].contains


def opens_gap(other: float, gap: float) -> bool:
    """Whether an explanation leaves a gap that is larger than another's by what is worth naming; noise alone is 1."""
    return other >= LEAST and enough_to_include(other, max(gap, 1.0))
