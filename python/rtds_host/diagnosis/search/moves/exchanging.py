"""Other effects in the place of one or two of an explanation."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Sequence

from rtds_host.diagnosis.evidence import likelihood_gain, log_odds
from rtds_host.diagnosis.fit import Fit, Proposal
from rtds_host.diagnosis.screen import Candidate, Screen, clashes, doubles, excluded
from rtds_host.diagnosis.search.moves.removing import without
from rtds_host.diagnosis.search.moves.renaming import halved, parted_sides, sides, substitutes
from rtds_host.diagnosis.search.screening import NEARLY, Screening, ranked
from rtds_host.diagnosis.search.store import FAR, ROUGHLY, Store

# Numerical: log odds from which an effect is hardly exchanged.
SURE = 12.0
# Numerical: effects of a screening whose pairs are looked at, and pairs tried in the place of two that close the gap.
PAIRED, PAIRS = 12, 3
# Numerical: exchanges of one and of two effects that are fitted to convergence, with what they are compared with.
CONVERGED, CONVERGED_PAIRS = 3, 2


def exchanged(store: Store, screening: Screening, fit: Fit, count: int) -> Fit:
    """The explanation, or a more probable one with an effect on another side, or with another one in its place.

    These are the `count` that each screening without the effect ranks first. Rough fits decide what is mixed and what
    is fitted to convergence.
    """
    starts: list[Proposal] = []
    swaps: list[Proposal] = []
    found: list[Fit] = []
    for cause, alone in zip(fit.hypothesis, without(store, fit, *fit.hypothesis)):
        starts += [*sides(store, fit, cause), *parted_sides(store, alone, cause), *halved(store, fit, cause)]
        found += substitutes(store, fit, cause).values()
        few = 1 if log_odds(*likelihood_gain(store.problem, fit, alone)) > SURE else count
        candidates = ranked(store, screening.screens(store, alone), few)
        swaps += [alone.proposal({one.cause: one.start}) for one in candidates if one.cause != cause]
    others = store.try_fits(swaps, rough=True)
    found += [*store.try_fits(starts, rough=True), *others]
    found += store.try_fits(p for swap, other in zip(swaps, others) for p in mixed(store, fit, swap.near, other))
    tried = sorted([fit, *(f for f in found if store.score(f) < store.score(fit) + ROUGHLY)], key=store.score)
    found = store.converged(f for f in tried[:CONVERGED] if f is not fit)
    most, gap = len(fit.hypothesis), store.gap(fit)
    return store.more_probable(fit, [f for f in found if len(f.hypothesis) <= most or store.supported(f, fit, gap)])


def mixed(store: Store, fit: Fit, alone: Fit, swapped: Fit) -> list[Proposal]:
    """Both of two effects, each at half its size, where one does nearly what the other does: two delays, two gains.

    alone : the fit without one of them; swapped : with the other in its place. No small step leads there from either
    where the misfit is kinked, as it is at a delay of whole samples.
    """
    if swapped.cost - fit.cost > (1.0 - NEARLY) * (alone.cost - fit.cost):
        return []
    (cause,) = set(fit.hypothesis) - set(alone.hypothesis)
    other, *more = set(swapped.hypothesis) - set(alone.hypothesis)
    # One side of an effect of `alone` splits that into two.
    if more or excluded(store.problem, other, fit.hypothesis):
        return []
    return [swapped.proposal({cause: 0.5 * fit.parts[cause], other: 0.5 * swapped.parts[other]})]


def pairs_exchanged(store: Store, screening: Screening, fit: Fit) -> Fit:
    """The explanation, or a more probable one with two other effects in the place of two.

    A gain of the driver and one of the current sensor do what a resistance and a torque constant do, and no exchange of
    one for one leads there. Each pair is screened next to the fit without the two.
    """
    out = list(itertools.combinations(fit.hypothesis, 2))
    proposals = [
        proposal
        for two, alone in zip(out, store.try_fits([fit.proposal({}, without=two) for two in out], rough=True))
        for screen in screening.screens(store, alone)
        for proposal in pairs_for(store, screen, alone, two)[: PAIRS if store.within_noise(fit) else 1]
    ]
    tried = [f for f in store.try_fits(proposals, rough=True) if store.score(f) < store.score(fit) + FAR]
    found = store.converged(sorted(tried, key=store.score)[:CONVERGED_PAIRS])
    return store.more_probable(fit, filter(store.admissible, found))


def pairs_for(store: Store, screen: Screen, alone: Fit, two: Sequence[tuple[str, str]]) -> list[Proposal]:
    """Pairs in the place of two effects, largest predicted gain first; alone: the fit without these, screen: of it."""
    likely = [c.cause for c in screen.candidates()[:PAIRED] if not doubles(store.problem, c.cause, alone.hypothesis)]
    pairs = screen.pairs([*likely, *(m for m in two if m not in likely)])
    own = next((gain for gain, a, b in pairs if {a.cause, b.cause} == set(two)), math.inf)
    return [
        alone.proposal({a.cause: a.start, b.cause: b.start})
        for gain, a, b in pairs
        if not {a.cause, b.cause} & set(two) and gain >= NEARLY * own
    ]


def rivals(store: Store, screens: Sequence[Screen], causes: Collection[tuple[str, str]], count: int) -> list[Candidate]:
    """What else could take the place of some effects, largest predicted gain first; screens: of the fit without
    them."""
    return [
        c for c in ranked(store, screens, count) if c.cause not in causes and not clashes(c.cause, screens[0].taken)
    ]


def swapped(store: Store, fit: Fit, alone: Fit, rival: Candidate) -> Fit:
    """The fit with a rival in an effect's place, a rough one where that is far behind; alone : without either."""
    (rough,) = store.try_fits([alone.proposal({rival.cause: rival.start})], rough=True)
    if log_odds(*likelihood_gain(store.problem, fit, rough)) > SURE and store.score(rough) > store.score(fit) + FAR:
        return rough
    return store.converged([rough])[0]
