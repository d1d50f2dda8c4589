"""One effect more."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtds_host.diagnosis.fit import Fit, Proposal, apply, joined, scaled, to_values
from rtds_host.diagnosis.screen import Candidate, Screen, clashes, sensitivities_of, splits, start_values
from rtds_host.diagnosis.search.moves.refining import refine_locally
from rtds_host.diagnosis.search.screening import ranked
from rtds_host.diagnosis.search.store import FAR, Store

# Numerical: sizes to look at before a fit of one whose misfit is rough, as factors.
COARSE = (0.35, 0.6, 0.88, 1.35, 1.6, 2.0, 3.0, 4.5, 6.5)
# Numerical: rough fits that are fitted to convergence: what is rough about a fit may be more than what parts them.
CONVERGED = 2


def additions(store: Store, screens: Sequence[Screen], fit: Fit, count: int) -> list[Proposal]:
    """One of the effects that a fit's screenings promise most of, `count` of each."""
    return [
        Proposal.of(with_one(fit, one.cause, entered(store, fit, one)), fit) for one in ranked(store, screens, count)
    ]


def extended(store: Store, screens: Sequence[Screen], fit: Fit, count: int) -> Fit | None:
    """The most probable of these, if it is more probable than the fit; None if none is. Which ones are fitted to
    convergence depends on their rough fits."""
    found = store.try_fits(additions(store, screens, fit, count), rough=True)
    found = sorted((f for f in found if store.score(f) < store.score(fit)), key=store.score)
    best = None
    for rough in found[:CONVERGED]:
        if best is None or store.score(rough) < store.score(best) + FAR:
            other = refine_locally(store, store.converged([rough])[0], set(rough.hypothesis) - set(fit.hypothesis))
            best = min(
                [f for f in (best, other) if f is not None and store.admissible(f)], key=store.score, default=None
            )
    return best


def with_one_of(store: Store, fit: Fit, wanted: set[str]) -> list[Proposal]:
    """One of some effects, on each of its sides as the first screening that promises it there has it."""
    sensitivities = sensitivities_of(store.fitter, fit, {}, wanted, {})
    found: dict[tuple[str, str], Candidate] = {}
    for noise in (fit.noise, store.problem.white()):
        for one in Screen(store.problem, fit, sensitivities, noise).candidates():
            if not clashes(one.cause, fit.hypothesis):
                found.setdefault(one.cause, one)
    return [Proposal.of({**fit.parts, one.cause: entered(store, fit, one)}, fit) for one in found.values()]


def entered(store: Store, fit: Fit, candidate: Candidate) -> np.ndarray:
    """Scaled parameters from which to fit a candidate: its own, or a size about them from which less is left to
    fit.
    """
    effect, cause = store.effects[candidate.cause[0]], (candidate.cause,)
    if not (effect.rough or effect.steep):
        return candidate.start
    (values,) = to_values(store.effects, cause, candidate.start)
    # What a delay does at one length says little of what it does at another: a signature may take it for a tenth of
    # what it is.
    trials = [*effect.sizes(values, COARSE), *(start_values(effect) if effect.steep else [])]
    starts = [candidate.start, *(scaled(store.effects, cause, [trial]) for trial in trials)]
    models = []
    for start in starts:
        hypothesis, u = joined({**fit.parts, candidate.cause: start})
        for z in (fit.z, np.zeros_like(fit.z)):
            nominal = store.problem.with_nuisances(z, fit.start)
            models.append(apply(store.effects, nominal, hypothesis, to_values(store.effects, hypothesis, u)))
    costs = [fit.noise.estimated(r).cost(r) for r in store.problem.residuals(models, [m.coarse_s for m in models])]
    return starts[int(np.argmin(costs)) // 2]


def with_one(fit: Fit, cause: tuple[str, str], u: np.ndarray) -> dict[tuple[str, str], np.ndarray]:
    """The parts of an explanation and one effect more; a side of an effect that is in on both parts it into two."""
    kept = fit.parts
    if splits(cause, fit.hypothesis):
        kept[cause[0], "right" if cause[1] == "left" else "left"] = kept.pop((cause[0], "both"))
    return {**kept, cause: u}
