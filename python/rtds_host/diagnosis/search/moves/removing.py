"""One effect less, or the same effects in a simpler form."""

from __future__ import annotations

from rtds_host.diagnosis.fit import Fit, Proposal
from rtds_host.diagnosis.screen import clashes
from rtds_host.diagnosis.search.moves.renaming import approximations
from rtds_host.diagnosis.search.store import ROUGHLY, Store


def without(store: Store, fit: Fit, *causes: tuple[str, str]) -> list[Fit]:
    """The explanation less each of some effects, the others roughly fitted again; an earlier fit of that where it is
    better than the fit with the effect."""
    less = [fit.proposal({}, without=[cause]) for cause in causes]
    known = {h: store.fits[h] for h, *_ in less if h in store.fits and store.fits[h].cost < fit.cost}
    store.try_fits([one for one in less if one.hypothesis not in known], rough=True)
    return [known.get(h) or store.fits[h] for h, *_ in less]


def pruned(store: Store, fit: Fit) -> Fit:
    """The explanation without the effects and parameters that the evidence does not support; equal sides become one
    effect. Each round starts from the last one's fits."""
    while fit.hypothesis:
        simpler = without(store, fit, *fit.hypothesis) if len(fit.hypothesis) > 1 else []
        simpler += store.try_fits(merged_sides(fit)) + store.try_fits(simpler_forms(store, fit), rough=True)
        simpler += store.try_fits(merged_effects(store, fit))
        if not simpler:
            break
        best = min(simpler, key=store.score)
        if store.score(best) < store.score(fit) + ROUGHLY:
            (best,) = store.converged([best])
        if store.score(best) >= store.score(fit):
            break
        fit = best
    return fit


def simpler_forms(store: Store, fit: Fit) -> list[Proposal]:
    """The explanation with an effect in its simpler form: without the further parameters."""
    return [
        fit.proposal({(form, side): fit.parts[effect, side][: len(store.effects[form].parameters)]}, [(effect, side)])
        for effect, side in fit.hypothesis
        for form in store.effects[effect].contains
        if not clashes((form, side), tuple(fit.parts_without((effect, side))))
    ]


def merged_sides(fit: Fit) -> list[Proposal]:
    """The explanation with the mean of an effect's sizes on the two sides, as one effect on both."""
    return [
        fit.proposal({(effect, "both"): 0.5 * (u + fit.parts[effect, "right"])}, [(effect, "left"), (effect, "right")])
        for (effect, side), u in fit.parts.items()
        if side == "left" and (effect, "right") in fit.parts
    ]


def merged_effects(store: Store, fit: Fit) -> list[Proposal]:
    """The explanation with two effects that do much the same as one of them: springs in a row."""
    return [
        fit.proposal({other: start}, without=[cause])
        for cause in fit.hypothesis
        for other, start in approximations(store, fit, cause).items()
        if other in fit.hypothesis
    ]
