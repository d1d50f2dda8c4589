"""One effect less, or the same effects in a simpler form."""

from __future__ import annotations

from rtds_host.diagnosis.fit import Fit, Proposal
from rtds_host.diagnosis.screen import clashes
from rtds_host.diagnosis.search.moves.renaming import approximated_by
from rtds_host.diagnosis.search.store import ROUGHLY, Store


def without(store: Store, fit: Fit, *causes: tuple[str, str]) -> list[Fit]:
    """The explanation less each of some effects, the others roughly fitted again; where it was met already and fits
    better than with the effect, that fit."""
    less = [Proposal.of(fit.parts_without(cause), fit) for cause in causes]
    met = {h: store.fits[h] for h, *_ in less if h in store.fits and store.fits[h].cost < fit.cost}
    store.try_fits([one for one in less if one.hypothesis not in met], rough=True)
    return [met.get(h) or store.fits[h] for h, *_ in less]


def pruned(store: Store, fit: Fit) -> Fit:
    """The explanation without effects that the evidence does not miss, and parameters; sides that came out alike become
    one effect. It goes on from what the last fits left."""
    while fit.hypothesis:
        simpler = without(store, fit, *fit.hypothesis) if len(fit.hypothesis) > 1 else []
        simpler += store.try_fits(merged(fit)) + store.try_fits(simpler_forms(store, fit), rough=True)
        simpler += store.try_fits(gathered(store, fit))
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
    parts, found = fit.parts, []
    for effect, side in fit.hypothesis:
        remaining = fit.parts_without((effect, side))
        for plain in store.effects[effect].contains:
            if not clashes((plain, side), tuple(remaining)):
                count = len(store.effects[plain].parameters)
                found.append(Proposal.of({**remaining, (plain, side): parts[effect, side][:count]}, fit))
    return found


def merged(fit: Fit) -> list[Proposal]:
    """The explanation with what an effect does on each side as one effect on both."""
    parts, found = fit.parts, []
    for effect, side in fit.hypothesis:
        if side == "left" and (effect, "right") in parts:
            both = 0.5 * (parts[effect, "left"] + parts[effect, "right"])
            found.append(
                Proposal.of({**fit.parts_without((effect, "left"), (effect, "right")), (effect, "both"): both}, fit)
            )
    return found


def gathered(store: Store, fit: Fit) -> list[Proposal]:
    """The explanation with what two effects of much the same do as one of them: springs in a row."""
    return [
        Proposal.of({**fit.parts_without(cause), other: start}, fit)
        for cause in fit.hypothesis
        for other, start in approximated_by(store, fit, cause).items()
        if other in fit.hypothesis
    ]
