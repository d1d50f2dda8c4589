"""One effect more."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtds_host.diagnosis.fit import Fit, Proposal, apply, joined, to_values
from rtds_host.diagnosis.screen import Candidate, Screen, clashes, sensitivities_of, start_values
from rtds_host.diagnosis.search.moves.refining import refine_locally
from rtds_host.diagnosis.search.screening import ranked
from rtds_host.diagnosis.search.store import FAR, Store

# Numerical: sizes to look at before a fit of one whose misfit is rough, as factors.
COARSE = (0.35, 0.6, 0.88, 1.35, 1.6, 2.0, 3.0, 4.5, 6.5)
# Numerical: rough fits that are fitted to convergence: their error may be more than they differ by.
CONVERGED = 2


def extended(store: Store, screens: Sequence[Screen], fit: Fit, count: int) -> Fit | None:
    """The most probable explanation with one effect more, of the `count` that each screening ranks first; None if none
    is more probable than the fit. Which ones are fitted to convergence depends on their rough fits."""
    found = store.try_fits([with_candidate(store, fit, one) for one in ranked(store, screens, count)], rough=True)
    best = None
    for rough in sorted((f for f in found if store.score(f) < store.score(fit)), key=store.score)[:CONVERGED]:
        if best is None or store.score(rough) < store.score(best) + FAR:
            other = refine_locally(store, store.converged([rough])[0], set(rough.hypothesis) - set(fit.hypothesis))
            best = min([f for f in (best, other) if f and store.admissible(f)], key=store.score, default=None)
    return best


def with_one_of(store: Store, fit: Fit, wanted: set[str]) -> list[Proposal]:
    """One of some effects, on each of its sides from the first screening that has it there."""
    sensitivities = sensitivities_of(store.fitter, fit, {}, wanted, {})
    found: dict[tuple[str, str], Candidate] = {}
    for noise in (fit.noise, store.problem.white()):
        for one in Screen(store.problem, fit, sensitivities, noise).candidates():
            found.setdefault(one.cause, one)
    return [with_candidate(store, fit, one) for one in found.values() if not clashes(one.cause, fit.hypothesis)]


def with_candidate(store: Store, fit: Fit, candidate: Candidate) -> Proposal:
    """The explanation and a candidate, from its own parameters or from a size about these that leaves less to fit."""
    effect, cause = store.effects[candidate.cause[0]], candidate.cause
    if not (effect.rough or effect.steep):
        return fit.proposal({cause: candidate.start})
    (values,) = to_values(store.effects, (cause,), candidate.start)
    # What a delay does at one length says little of what it does at another: a signature may take it for a tenth of
    # what it is.
    trials = [*effect.sizes(values, COARSE), *(start_values(effect) if effect.steep else [])]
    starts = [candidate.start, *map(effect.scaled, trials)]
    models = []
    for start in starts:
        hypothesis, u = joined({**fit.parts, cause: start})
        for z in (fit.z, np.zeros_like(fit.z)):
            nominal = store.problem.with_nuisances(z, fit.start)
            models.append(apply(store.effects, nominal, hypothesis, to_values(store.effects, hypothesis, u)))
    costs = [fit.noise.exact_cost(r) for r in store.problem.residuals(models, [m.coarse_s for m in models])]
    return fit.proposal({cause: starts[int(np.argmin(costs)) // 2]})
