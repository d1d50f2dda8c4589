"""Which effects take an included one's place and fit as well: look-alikes, to be declared and weighed."""

from __future__ import annotations

from collections.abc import Container, Iterable

from rtds_host.diagnosis.choice import EQUIVALENT_GAP_RATIO, HeldOutScore
from rtds_host.diagnosis.evidence import distinguishable, enough_to_include, likelihood_gain
from rtds_host.diagnosis.fit import Fit, Proposal, scaled
from rtds_host.diagnosis.gap import LEAST
from rtds_host.diagnosis.screen import Candidate, available, clashes, start_values
from rtds_host.diagnosis.search.driver import Search
from rtds_host.diagnosis.search.moves import exchanging, renaming
from rtds_host.diagnosis.search.store import Store
from rtds_host.diagnosis.structurally_indistinguishable import nearly_indistinguishable, structurally_indistinguishable
from rtds_host.diagnosis.thresholds import MINOR_SHARE

Cause = tuple[str, str]
# Members that a set of look-alikes may have (contract, section 5).
LARGEST_SET = 3


def practically_indistinguishable(
    search: Search, fit: Fit, included: Iterable[tuple[Cause, Fit]]
) -> tuple[tuple[tuple[Cause, ...], ...], list[Fit]]:
    """Effects that take an included one's place and fit as well, and the fits that show it.

    One that opens a gap does not fit, however few blocks of time there are to distinguish it by. included : included
    effects and the explanation without each.

    A set has few members. Those that are indistinguishable in principle come first; then those that are nearly so, if
    they fit as well, and any others that do; those that are nearly so and were not fitted come last. Each
    was fitted in the effect's place, lies within its bounds there and opens no gap: an upside-down gyro is no track of
    a negative width.
    """
    store = search.store
    sets, shown = [], []
    case, there = store.problem.case, {effect.id for effect in available(store.problem)} & store.wanted
    for one, without in included:
        inherent, near = (
            [cause for cause in equals if cause[0] in there and not clashes(cause, fit.hypothesis)]
            for equals in (
                structurally_indistinguishable(case, one, fit.hypothesis),
                nearly_indistinguishable(case, one),
            )
        )
        swaps, further = substitutes_for(search, fit, one, without), {}
        known = {cause for cause in swaps if cause in near or cause[0] in store.effects[one[0]].confused_with}
        fitting = _fitting(store, fit, swaps, known)
        # What a look-alike is confused with may be one, too: the motor's constant for viscous friction, and a gain for
        # that.
        further = {
            cause: swaps.get(cause) or exchanging.swapped(store, fit, without, candidate)
            for cause, candidate in _further(search, one, without, fitting).items()
            if cause not in known
        }
        fitting |= _fitting(store, fit, further, further)
        found = sorted((cause not in known, gain, cause) for cause, (gain, _) in fitting.items())
        shown += [swap for _, swap in fitting.values()]
        others = list(dict.fromkeys([*inherent, *(cause for *_, cause in found), *near]))
        fitted = {cause: swap for cause, swap in (swaps | further).items() if cause in others}
        fitted |= {cause: swap for cause, (_, swap) in fitting.items()}
        members: list[Cause] = []
        for cause in others:
            if len(members) < LARGEST_SET - 1 and _possible(store, fit, one, without, cause, fitted.get(cause)):
                members.append(cause)
        if members:
            sets.append((one, *members))
    return tuple(sets), shown


def _possible(store: Store, fit: Fit, one: Cause, without: Fit, cause: Cause, met: Fit | None) -> bool:
    """Whether another effect in one's place opens no gap at a size that it can have; `met`: a fit of it there."""

    def fits(swapped: Fit) -> bool:
        if not store.admissible(swapped):
            return False
        if store.within_noise(fit):
            return not opens_gap(store.gap(swapped), store.gap(fit))
        return (
            HeldOutScore.of(store.problem, swapped).gap
            <= EQUIVALENT_GAP_RATIO * HeldOutScore.of(store.problem, fit).gap
        )

    if met is not None and fits(met):
        return True
    effect, own = store.effects[cause[0]], dict(zip(fit.hypothesis, fit.values))[one]
    starts = start_values(effect)
    if "ratio" in own and [p.name for p in effect.parameters] == ["ratio"] and own["ratio"]:
        # Of two factors that do the same, one is the other or its inverse.
        starts = [*({"ratio": ratio} for ratio in (own["ratio"], 1.0 / own["ratio"])), *starts]
    bounds = {p.name: (p.low, p.high) for p in effect.parameters}
    inside = [{name: min(max(v, bounds[name][0]), bounds[name][1]) for name, v in start.items()} for start in starts]
    begun = [
        Proposal.of({**without.parts, cause: scaled(store.effects, (cause,), [values])}, without) for values in inside
    ]
    rough = store.try_fits(begun, rough=True)
    if not rough:
        return False
    return fits(*store.converged([min(rough, key=store.score)]))


def _fitting(
    store: Store, fit: Fit, swaps: dict[Cause, Fit], known: Container[Cause]
) -> dict[Cause, tuple[float, Fit]]:
    """Of effects in another one's place those that fit as well, and open no gap: what the likelihood gains without
    each, and its fit.

    Where a gap remains,
    what leaves a gap within a tenth as large on runs left out fits as well. Elsewhere the likelihood
    tells. What is `known` to be confused with it must be told from it by more than slight a part of what it leaves: the
    forms of a machine that is described no better differ by as much.
    """
    found: dict[Cause, tuple[float, Fit]] = {}
    if not store.within_noise(fit):
        own = HeldOutScore.of(store.problem, fit)
        for cause, swapped in swaps.items():
            gain, _ = likelihood_gain(store.problem, fit, swapped)
            # More parameters always leave a little less.
            plain = len(swapped.u) <= len(fit.u) and store.admissible(swapped)
            if plain and HeldOutScore.of(store.problem, swapped).gap <= EQUIVALENT_GAP_RATIO * own.gap:
                found[cause] = gain, swapped
        return found
    for cause, swapped in swaps.items():
        (gain, t), taken = likelihood_gain(store.problem, fit, swapped), store.excess_reduction(fit, swapped)
        told = distinguishable(gain, t, taken, store.problem.block_count, MINOR_SHARE if cause in known else 0.0)
        if not told and store.admissible(swapped) and not opens_gap(store.gap(swapped), store.gap(fit)):
            found[cause] = gain, swapped
    return found


def _further(search: Search, one: Cause, without: Fit, like: Iterable[Cause]) -> dict[Cause, Candidate]:
    """What look-alikes of an effect are confused with, as far as it could be in its place, and where a fit of it
    begins.
    """
    store = search.store
    wanted = {
        renaming.in_place(store, other, cause) for cause in like for other in store.effects[cause[0]].confused_with
    }
    if not wanted or search.limits.attribution_over_budget():
        return {}
    # What holds the effect is the same with a further parameter, for no better fit.
    return {
        c.cause: c
        for c in exchanging.rivals(store, search.screening.screens(store, without), one, len(store.effects))
        if c.cause in wanted and one[0] not in store.effects[c.cause[0]].contains
    }


def substitutes_for(search: Search, fit: Fit, one: Cause, without: Fit) -> dict[Cause, Fit]:
    """What might be there in an effect's place, each with the fit that has it there: its substitutes, what a screening
    without it promises, and what the search met."""
    store = search.store
    swaps = renaming.substitutes(store, fit, one)

    def other(cause: Cause) -> bool:
        # What holds the effect is the same with a further parameter, for no better fit.
        return cause not in swaps and one[0] not in store.effects[cause[0]].contains

    if not search.limits.attribution_over_budget():
        for rival in exchanging.rivals(store, search.screening.screens(store, without), one, LARGEST_SET):
            if other(rival.cause):
                swaps[rival.cause] = exchanging.swapped(store, fit, without, rival)
    remaining = set(fit.hypothesis) - {one}
    for hypothesis, met in store.fits.items():
        if len(hypothesis) == len(fit.hypothesis) and remaining <= set(hypothesis) and hypothesis != fit.hypothesis:
            (cause,) = set(hypothesis) - remaining
            if other(cause):
                swaps[cause] = met
    return swaps


def opens_gap(other: float, gap: float) -> bool:
    """Whether an explanation leaves a gap that is larger than another's by what is worth naming; noise alone is 1."""
    return other >= LEAST and enough_to_include(other, max(gap, 1.0))
