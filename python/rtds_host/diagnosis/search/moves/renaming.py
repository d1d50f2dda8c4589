"""The same under another name, or on another side."""

from __future__ import annotations

import numpy as np

from rtds_host.diagnosis.fit import Fit, Proposal, scaled
from rtds_host.diagnosis.screen import available, clashes, doubles
from rtds_host.diagnosis.search.moves.adding import with_one
from rtds_host.diagnosis.search.moves.refining import refine_locally
from rtds_host.diagnosis.search.store import FAR, Store


def substitutes(store: Store, fit: Fit, cause: tuple[str, str]) -> dict[tuple[str, str], Fit]:
    """The same size as another effect with the same parameters, or that of one that does most of the same, by that,
    where no slope leads from one to the other: of two delays one gives way to the other only if it is as long from
    the start. Which ones are refine_locally hangs on their fits."""
    remaining = fit.parts_without(cause)
    found = {}
    starts = {other: fit.parts[cause] for other in alike(store, fit, cause)}
    starts |= {other: start for other, start in approximated_by(store, fit, cause).items() if other not in remaining}
    for other, start in starts.items():
        (named,) = store.try_fits([Proposal.of({**remaining, other: start}, fit)])
        # What is included with a delay may have bent to it; but not by so much.
        found[other] = named if store.score(named) > store.score(fit) + FAR else refine_locally(store, named, remaining)
    return found


def renamed(store: Store, fit: Fit) -> Fit:
    """The explanation, or the better one that includes one of its effects' substitutes at the same size."""
    found = [f for cause in fit.hypothesis for f in substitutes(store, fit, cause).values()]
    return min([fit, *(f for f in found if store.admissible(f))], key=store.score)


def halved(store: Store, fit: Fit, cause: tuple[str, str]) -> list[Proposal]:
    """A lag that may be two of half its length: what no screening on top of their sum promises, and no small step
    leads to.
    """
    others = {other: fit.parts[cause] for other in alike(store, fit, cause)}
    others |= {
        other: start
        for other, start in approximated_by(store, fit, cause).items()
        if other not in fit.hypothesis and (store.effects[cause[0]].steep or store.effects[other[0]].steep)
    }
    return [
        Proposal.of({**fit.parts, cause: 0.5 * fit.parts[cause], other: 0.5 * start}, fit)
        for other, start in others.items()
    ]


def sides(store: Store, fit: Fit, cause: tuple[str, str]) -> list[Proposal]:
    """The same explanation with one of its effects on other sides."""
    if len(store.problem.robot.sides) < 2:
        return []
    remaining = fit.parts_without(cause)
    return [
        Proposal.of({**remaining, (cause[0], side): fit.parts[cause]}, fit)
        for side in store.effects[cause[0]].sides
        if side != cause[1] and not clashes((cause[0], side), tuple(remaining))
    ]


def parted_sides(store: Store, alone: Fit, cause: tuple[str, str]) -> list[Proposal]:
    """What is left without an effect of one side, with another one that is on both of a size of its own on each:
    the two sides of a machine differ in one thing more often than in two."""
    if cause[1] == "both":
        return []
    return [
        Proposal.of(with_one(alone, (effect, cause[1]), alone.parts[effect, side]), alone)
        for effect, side in alone.hypothesis
        if side == "both" and store.effects[effect].sided and store.effects[effect].sized
    ]


def alike(store: Store, fit: Fit, cause: tuple[str, str]) -> list[tuple[str, str]]:
    """Effects with the same parameters as a steep one of an explanation, on its side, that this could as well hold
    in its place.
    """
    effect, remaining = store.effects[cause[0]], tuple(fit.parts_without(cause))
    if not effect.steep:
        return []
    names = [p.name for p in effect.parameters]
    others = [
        (other, cause[1])
        for other in effect.confused_with
        if other in store.wanted
        and store.effects[other].steep
        and [p.name for p in store.effects[other].parameters] == names
    ]
    return [one for one in others if not clashes(one, remaining) and not doubles(store.problem, one, remaining)]


def approximated_by(store: Store, fit: Fit, cause: tuple[str, str]) -> dict[tuple[str, str], np.ndarray]:
    """Effects that do most of what one of an explanation does, on its side where they have sides, and with which
    scaled parameters; together with its own where they are in already."""
    at = dict(zip(fit.hypothesis, fit.values))
    remaining = tuple(fit.parts_without(cause))
    there = {effect.id for effect in available(store.problem)} & store.wanted
    found = {}
    for other, like in store.effects[cause[0]].approximated_by.items():
        one = in_place(store, other, cause)
        parameters = like(at[cause], existing=at.get(one)) if other in there else None
        if parameters is not None and (
            one in at or not (clashes(one, remaining) or doubles(store.problem, one, remaining))
        ):
            inside = {
                p.name: min(max(parameters.get(p.name, p.starts[0]), p.low), p.high)
                for p in store.effects[other].parameters
            }
            found[one] = scaled(store.effects, (one,), [inside])
    return found


def in_place(store: Store, other: str, cause: tuple[str, str]) -> tuple[str, str]:
    """Another effect in one's place: on its side where both have sides, on all that there are where only the other
    has.
    """
    if not store.effects[other].sided:
        return other, "both"
    every = "both" if len(store.problem.robot.sides) == 2 else "left"
    return other, cause[1] if store.effects[cause[0]].sided else every
