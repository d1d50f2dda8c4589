"""Other effects in the place of one or two of an explanation."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from rtds_host.diagnosis.evidence import likelihood_gain, log_odds
from rtds_host.diagnosis.fit import Fit, Proposal
from rtds_host.diagnosis.screen import Candidate, Screen, clashes, doubles
from rtds_host.diagnosis.search.moves.adding import with_one
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
    """The explanation, or a better one with another side of an effect or what the screening without it promises, up to
    `count` of each screening. What is mixed and what is fitted to convergence depends on rough fits."""
    starts: list[Proposal] = []
    swaps: list[Proposal] = []
    found: list[Fit] = []
    for cause, alone in zip(fit.hypothesis, without(store, fit, *fit.hypothesis)):
        starts += [*sides(store, fit, cause), *parted_sides(store, alone, cause), *halved(store, fit, cause)]
        found += substitutes(store, fit, cause).values()
        sure = log_odds(*likelihood_gain(store.problem, fit, alone)) > SURE
        swaps += [
            Proposal.of(with_one(alone, one.cause, one.start), alone)
            for one in ranked(store, screening.screens(store, alone), 1 if sure else count)
            if one.cause != cause
        ]
    others = store.try_fits(swaps, rough=True)
    found += [*store.try_fits(starts, rough=True), *others]
    found += store.try_fits(p for swap, other in zip(swaps, others) for p in mixed(store, fit, swap.near, other))
    tried = sorted([fit, *(f for f in found if store.score(f) < store.score(fit) + ROUGHLY)], key=store.score)
    found = store.converged(f for f in tried[:CONVERGED] if f is not fit)
    most, gap = len(fit.hypothesis), store.gap(fit)
    return store.more_probable(fit, [f for f in found if len(f.hypothesis) <= most or store.supported(f, fit, gap)])


def mixed(store: Store, fit: Fit, alone: Fit, swapped: Fit) -> list[Proposal]:
    """Where to start with both of two effects, each at half its size, where one does nearly what the other does: two
    delays, two gains.

    alone : the fit without one of them; swapped : with the other in its place. No small step leads there from either
    where the misfit is kinked, as it is at a delay of whole samples.
    """
    if swapped.cost - fit.cost > (1.0 - NEARLY) * (alone.cost - fit.cost):
        return []
    (cause,) = set(fit.hypothesis) - set(alone.hypothesis)
    others = set(swapped.hypothesis) - set(alone.hypothesis)
    # One of its own sides parts an effect into two.
    if len(others) > 1:
        return []
    (other,) = others
    if clashes(other, fit.hypothesis) or doubles(store.problem, other, fit.hypothesis):
        return []
    parts = {**swapped.parts, cause: 0.5 * fit.parts[cause], other: 0.5 * swapped.parts[other]}
    return [Proposal.of(parts, swapped)]


def pairs_exchanged(store: Store, screening: Screening, fit: Fit) -> Fit:
    """The explanation, or a better one with two other effects that promise nearly as much together in the place of two:
    a gain of the driver and one of the current sensor do what a resistance and a torque constant do, and no exchange
    of one of them for one of these leads there. Each pair is screened on top of the fit without the two."""
    out = list(itertools.combinations(fit.hypothesis, 2))
    rests = [Proposal.of(fit.parts_without(*two), fit) for two in out]
    proposals = [
        proposal
        for two, alone in zip(out, store.try_fits(rests, rough=True))
        for screen in screening.screens(store, alone)
        for proposal in pairs_for(store, screen, alone, two)[: PAIRS if store.within_noise(fit) else 1]
    ]
    tried = [f for f in store.try_fits(proposals, rough=True) if store.score(f) < store.score(fit) + FAR]
    found = store.converged(sorted(tried, key=store.score)[:CONVERGED_PAIRS])
    return store.more_probable(fit, [f for f in found if store.admissible(f)])


def pairs_for(store: Store, screen: Screen, alone: Fit, two: Sequence[tuple[str, str]]) -> list[Proposal]:
    """Pairs in the place of two effects, most promising first; alone: the fit without these, screen: of that."""
    likely = [c.cause for c in screen.candidates()[:PAIRED] if not doubles(store.problem, c.cause, alone.hypothesis)]
    pairs = screen.pairs([*likely, *(m for m in two if m not in likely)])
    own = next((gain for gain, a, b in pairs if {a.cause, b.cause} == set(two)), math.inf)
    return [
        Proposal.of({**alone.parts, a.cause: a.start, b.cause: b.start}, alone)
        for gain, a, b in pairs
        if not {a.cause, b.cause} & set(two) and gain >= NEARLY * own
    ]


def rivals(store: Store, screens: Sequence[Screen], cause: tuple[str, str], count: int) -> list[Candidate]:
    """What else would take the place of an effect that was taken out, most promising first; screens: of the fit
    without it."""
    return [c for c in ranked(store, screens, count) if c.cause != cause and not clashes(c.cause, screens[0].taken)]


def swapped(store: Store, fit: Fit, alone: Fit, rival: Candidate) -> Fit:
    """The fit with a rival in the effect's place; a rough one where that is far behind already. alone : without
    either."""
    (rough,) = store.try_fits([Proposal.of({**alone.parts, rival.cause: rival.start}, alone)], rough=True)
    if log_odds(*likelihood_gain(store.problem, fit, rough)) > SURE and store.score(rough) > store.score(fit) + FAR:
        return rough
    return store.converged([rough])[0]
