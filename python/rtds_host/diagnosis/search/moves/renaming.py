"""The same sizes by another effect, or on another side."""

from __future__ import annotations

import numpy as np

from rtds_host.diagnosis.fit import Fit, Proposal
from rtds_host.diagnosis.screen import available, clashes, excluded
from rtds_host.diagnosis.search.moves.refining import refine_locally
from rtds_host.diagnosis.search.store import FAR, Store

Cause = tuple[str, str]


def substitutes(store: Store, fit: Fit, cause: Cause) -> dict[Cause, Fit]:
    """The explanation with each counterpart of an effect in its place, since no slope leads from one to the other.

    Which of them are refined locally depends on their fits.
    """
    remaining, found = fit.parts_without(cause), {}
    for other, start in counterparts(store, fit, cause).items():
        (named,) = store.try_fits([fit.proposal({other: start}, without=[cause])])
        # What is included with a delay may have adapted to it; but not by so much.
        found[other] = named if store.score(named) > store.score(fit) + FAR else refine_locally(store, named, remaining)
    return found


def renamed(store: Store, fit: Fit) -> Fit:
    """The explanation, or a more probable one with a substitute of one of its effects."""
    found = [f for cause in fit.hypothesis for f in substitutes(store, fit, cause).values()]
    return min([fit, *filter(store.admissible, found)], key=store.score)


def halved(store: Store, fit: Fit, cause: Cause) -> list[Proposal]:
    """A lag that may be two of half its length, which no screening next to their sum and no small step leads to."""
    return [
        fit.proposal({cause: 0.5 * fit.parts[cause], other: 0.5 * start})
        for other, start in counterparts(store, fit, cause).items()
        if store.effects[cause[0]].steep or store.effects[other[0]].steep
    ]


def sides(store: Store, fit: Fit, cause: Cause) -> list[Proposal]:
    """The same explanation with one of its effects on other sides."""
    remaining = tuple(fit.parts_without(cause))
    return [
        fit.proposal({(cause[0], side): fit.parts[cause]}, without=[cause])
        for side in (store.effects[cause[0]].sides if len(store.problem.robot.sides) == 2 else ())
        if side != cause[1] and not clashes((cause[0], side), remaining)
    ]


def parted_sides(store: Store, alone: Fit, cause: Cause) -> list[Proposal]:
    """The explanation without an effect of one side, and another one that is on both with a size for each side.

    The two sides of a robot differ in one thing more often than in two.
    """
    return [
        alone.proposal({(effect, cause[1]): alone.parts[effect, side]})
        for effect, side in alone.hypothesis
        if cause[1] != "both" and side == "both" and store.effects[effect].sided and store.effects[effect].sized
    ]


def counterparts(store: Store, fit: Fit, cause: Cause) -> dict[Cause, np.ndarray]:
    """Effects that could take one's place, on its side, and scaled parameters with which they do nearly the same.

    They have the same parameters, and a misfit that falls only near the right size as well, or approximate it.
    """
    effect, remaining = store.effects[cause[0]], tuple(fit.parts_without(cause))
    names = [p.name for p in effect.parameters]
    found = {
        (other, cause[1]): fit.parts[cause]
        for other in (effect.confused_with if effect.steep else ())
        if other in store.wanted
        and store.effects[other].steep
        and [p.name for p in store.effects[other].parameters] == names
        and not excluded(store.problem, (other, cause[1]), remaining)
    }
    approximate = approximations(store, fit, cause).items()
    return found | {other: start for other, start in approximate if other not in fit.hypothesis}


def approximations(store: Store, fit: Fit, cause: Cause) -> dict[Cause, np.ndarray]:
    """Effects that do most of what one of an explanation does, and with which scaled parameters; together with their
    own where they are included already."""
    at, found = dict(zip(fit.hypothesis, fit.values)), {}
    remaining = tuple(fit.parts_without(cause))
    ids = {effect.id for effect in available(store.problem)} & store.wanted
    for other, converted in store.effects[cause[0]].approximated_by.items():
        one = in_place(store, other, cause)
        parameters = converted(at[cause], existing=at.get(one)) if other in ids else None
        if parameters is not None and (one in at or not excluded(store.problem, one, remaining)):
            found[one] = store.effects[other].scaled(store.effects[other].within(parameters))
    return found


def in_place(store: Store, other: str, cause: Cause) -> Cause:
    """Another effect in one's place: on its side where both have sides, on all sides where only the other has."""
    if not store.effects[other].sided:
        return other, "both"
    every = "both" if len(store.problem.robot.sides) == 2 else "left"
    return other, cause[1] if store.effects[cause[0]].sided else every
