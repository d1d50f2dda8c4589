"""From an optimum to a lower one of the same effects, where their misfit has many minima."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rtds_host.diagnosis import ripple
from rtds_host.diagnosis.fit import Fit, Proposal, apply, joined, scaled, to_values
from rtds_host.diagnosis.search.store import FAR, Store

# Numerical: sizes to look at about one whose misfit is rough (impacts, resonances, steps that come late), as factors.
ROUGH_FACTORS = tuple(sorted({*np.geomspace(0.125, 8.0, 25), 0.88, 0.92, 0.96, 1.04, 1.08, 1.13}))
# Numerical: how often a lower optimum is looked for about the last one.
ROUNDS = 3


def refine_locally(store: Store, fit: Fit, causes: Iterable[tuple[str, str]]) -> Fit:
    """The lowest optimum found about those of some effects: each round looks about the last one, so it fits."""
    for cause in causes:
        for values in store.effects[cause[0]].restarts if not store.within_noise(fit) else ():
            restart = Proposal.of({**fit.parts, cause: scaled(store.effects, (cause,), [dict(values)])}, fit)
            if store.scores_of([restart], rough=True)[0] < store.score(fit) + FAR:
                fit = store.try_fits([restart])[0]
        for _ in range(ROUNDS):
            moved = min(store.try_fits(lower(store, fit, cause)), key=store.score, default=fit)
            if store.score(moved) >= store.score(fit):
                break
            fit = moved
    return fit


def lower(store: Store, fit: Fit, cause: tuple[str, str]) -> list[Proposal]:
    """The same effects from where their misfit may fall further: the best with the nuisances that were fitted next to
    it, and the best without any, since these bend to a size in the wrong valley."""
    problem = store.problem
    trials = [joined({**fit.parts, cause: part})[1] for part in _about(store, fit, cause)]
    values = [to_values(store.effects, fit.hypothesis, u) for u in trials]
    found = {}
    for z in (fit.z, np.zeros_like(fit.z)) if trials else ():
        models = [
            apply(store.effects, problem.with_nuisances(z, fit.start), fit.hypothesis, v) for v in [*values, fit.values]
        ]
        costs = [fit.noise.estimated(r).cost(r) for r in problem.residuals(models, [m.coarse_s for m in models])]
        k = int(np.argmin(costs))
        if k < len(trials):
            found[k] = Proposal(fit.hypothesis, trials[k], fit)
    return list(found.values())


def _about(store: Store, fit: Fit, cause: tuple[str, str]) -> list[np.ndarray]:
    """Other parameters of an effect from which its misfit may fall further, scaled; none where it is smooth."""
    effect, values = store.effects[cause[0]], fit.values[fit.hypothesis.index(cause)]
    found = []
    if effect.rough:
        found = effect.sizes(values, ROUGH_FACTORS)
    if effect.periodic:
        outs = store.problem.replay(fit.model(store.problem))
        found = ripple.neighbours(values, ripple.turned(outs, cause[1]))
    return [scaled(store.effects, (cause,), [trial]) for trial in found]
