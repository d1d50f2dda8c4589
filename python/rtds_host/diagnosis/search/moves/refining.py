"""From an optimum to a lower one of the same effects, where their misfit has many minima."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rtds_host.diagnosis import ripple
from rtds_host.diagnosis.fit import Fit, Proposal, apply, to_values
from rtds_host.diagnosis.search.store import FAR, Store

# Numerical: sizes to look at about one whose misfit is rough (impacts, resonances, steps that come late), as factors.
ROUGH_FACTORS = tuple(sorted({*np.geomspace(0.125, 8.0, 25), 0.88, 0.92, 0.96, 1.04, 1.08, 1.13}))
# Numerical: how often a lower optimum is looked for about the last one.
ROUNDS = 3


def refine_locally(store: Store, fit: Fit, causes: Iterable[tuple[str, str]]) -> Fit:
    """The lowest optimum found about those of some effects; each round looks about the last one."""
    for cause in causes:
        effect = store.effects[cause[0]]
        for values in effect.restarts if not store.within_noise(fit) else ():
            restart = fit.proposal({cause: effect.scaled(dict(values))})
            if store.scores_of([restart], rough=True)[0] < store.score(fit) + FAR:
                fit = store.try_fits([restart])[0]
        for _ in range(ROUNDS):
            moved = min(store.try_fits(lower(store, fit, cause)), key=store.score, default=fit)
            if store.score(moved) >= store.score(fit):
                break
            fit = moved
    return fit


def lower(store: Store, fit: Fit, cause: tuple[str, str]) -> list[Proposal]:
    """The same effects from where their misfit may fall further: the best with the fitted nuisances, and the best
    without any, since these adapt to a size in the wrong valley."""
    trials = [fit.proposal({cause: start}) for start in _around(store, fit, cause)]
    values = [*(to_values(store.effects, fit.hypothesis, one.u) for one in trials), fit.values]
    found: dict[int, None] = {}
    for z in (fit.z, np.zeros_like(fit.z)) if trials else ():
        nominal = store.problem.with_nuisances(z, fit.start)
        models = [apply(store.effects, nominal, fit.hypothesis, v) for v in values]
        residuals = store.problem.residuals(models, [m.coarse_s for m in models])
        found[int(np.argmin([fit.noise.exact_cost(r) for r in residuals]))] = None
    return [trials[k] for k in found if k < len(trials)]


def _around(store: Store, fit: Fit, cause: tuple[str, str]) -> list[np.ndarray]:
    """Other parameters of an effect from which its misfit may fall further, scaled; none where it is smooth."""
    effect, values = store.effects[cause[0]], fit.values[fit.hypothesis.index(cause)]
    found = effect.sizes(values, ROUGH_FACTORS) if effect.rough else []
    if effect.periodic:
        found = ripple.neighbours(values, ripple.turned(store.problem.replay(fit.model(store.problem)), cause[1]))
    return [effect.scaled(trial) for trial in found]
