"""A beam search over sets of effects, for cases in which a gap remains.

Greedy steps follow the effect with the largest gain, which on a real robot is often one that does a part of
everything. A beam keeps several explanations of each number of effects, and held-out runs decide between them
(`choice`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np

from rtds_host.diagnosis.effects.base import Effect
from rtds_host.diagnosis.fit import Fit, Proposal
from rtds_host.diagnosis.screen import Screen, clashes, sensitivities_of
from rtds_host.diagnosis.search.driver import Search
from rtds_host.diagnosis.search.moves.adding import with_candidate
from rtds_host.diagnosis.search.screening import further_starts, ranked
from rtds_host.diagnosis.search.store import FAR, Store

# Numerical: explanations that are kept of each number of effects, those that are fitted to convergence, the most
# effects, and the effects of each screening that are tried on each explanation, of an axis and of a robot, whose sides
# triple them.
WIDTH, CONVERGED, DEPTH = 4, 12, 3
TRIED = {True: 12, False: 5}
# Numerical: factor between the sizes at which a rough effect of an axis is looked at, a seventh of a resonance's
# frequency, and how many maxima of its gain are tried.
FINE, MAXIMA = 1.3, 3


def widened(search: Search) -> dict[int, list[Fit]]:
    """Explanations of each number of effects, most probable first, up to `WIDTH` of each.

    Starts come from two screenings: by the likelihood, which compares ratios of residuals, and by plain squares, which
    show what is large.
    """
    problem, store = search.problem, search.store
    # Greedy steps have been over whole runs of a robot already, which are longer than those of an axis.
    if problem.robot.axis is not None or len(store.fits) == 1:
        problem.follow_angles(True)
        beam = [store.fits[()]]
        for _ in range(DEPTH):
            extended = _extended(search, beam)
            if not extended or store.score(extended[0]) > min(map(store.score, beam)):
                break
            beam = extended
            if search.limits.search_over_budget():
                break
        problem.follow_angles(False)
    found: dict[int, list[Fit]] = {}
    for fit in sorted(filter(store.admissible, store.fits.values()), key=store.score):
        mine = found.setdefault(len(fit.hypothesis), [])
        if len(mine) < WIDTH:
            mine.append(fit)
    for mine in found.values():
        # Where only noise is left the likelihood is exact. What is far behind is the worse one at other optima, too.
        near = [f for f in mine if f.hypothesis and store.score(f) < store.score(mine[0]) + FAR]
        for optima in store.local_optima([f for f in near if not store.within_noise(f)]):
            mine.extend(optima[1:])
    return found


def _extended(search: Search, beam: list[Fit]) -> list[Fit]:
    """The most probable explanations with one effect more than those of the beam, fitted to convergence.

    `WIDTH` of them and, of an axis, the next one that differs by more than an effect that is confused with another:
    four kinds of friction may fill the beam, and would leave nothing else in it.
    """
    proposals = []
    for fit in beam:
        if search.limits.search_over_budget():
            break
        proposals += additions(search, fit, screenings(search, fit)(fit))
    found = most_probable(search.store, proposals, CONVERGED)
    kept = found[:WIDTH]
    different = (fit for fit in found[WIDTH:] if not any(confused(search.store, fit, other) for other in kept))
    return [*kept, *itertools.islice(different, int(search.problem.robot.axis is not None))]


def screenings(search: Search, fit: Fit) -> Callable[[Fit], list[Screen]]:
    """Screens of this fit and of others, by signatures that are taken next to this one."""
    problem, store = search.problem, search.store
    extra = further_starts(store, fit)
    if problem.robot.axis is not None:
        rough = [store.effects[e] for e in sorted(store.wanted) if store.effects[e].rough]
        extra |= {(effect.id, "left"): _fine_sizes(effect) for effect in rough}
    sensitivities = sensitivities_of(store.fitter, fit, extra, store.wanted, {}, coarse=search.quick)
    return lambda of: [Screen(problem, of, sensitivities, noise) for noise in (of.noise, problem.white())]


def additions(search: Search, fit: Fit, screens: Sequence[Screen]) -> list[Proposal]:
    """The explanation with one of the effects more that its screens rank first, and of an axis with a rough one at each
    maximum of its predicted gain.
    """
    is_axis = search.problem.robot.axis is not None
    candidates = ranked(search.store, screens, TRIED[is_axis])
    found = [with_candidate(search.store, fit, c) for c in candidates if not clashes(c.cause, fit.hypothesis)]
    for screen in screens if is_axis else ():
        found += [fit.proposal({c.cause: c.start}) for c in screen.maxima()[:MAXIMA]]
    return found


def _fine_sizes(effect: Effect) -> list[dict[str, float]]:
    """A rough effect's sizes between its first and its last start, `FINE` apart, with the first starts of its shape."""
    size, *shape = effect.parameters
    count = 1 + math.ceil(math.log(size.starts[-1] / size.starts[0]) / math.log(FINE))
    sizes = np.geomspace(size.starts[0], size.starts[-1], count)
    return [{size.name: float(value), **{p.name: p.starts[0] for p in shape}} for value in sizes]


def confused(store: Store, one: Fit, other: Fit) -> bool:
    """Whether two explanations differ by one effect that is confused with another."""
    mine, others = set(one.hypothesis) - set(other.hypothesis), set(other.hypothesis) - set(one.hypothesis)
    if len(mine) != 1 or len(others) != 1:
        return False
    ((a, _),), ((b, _),) = mine, others
    return a == b or a in store.effects[b].confused_with or b in store.effects[a].confused_with


def most_probable(store: Store, proposals: Sequence[Proposal], count: int) -> list[Fit]:
    """The most probable explanations of some proposals, fitted to convergence."""
    rough = {f.hypothesis: f for f in store.try_fits(proposals, rough=True)}
    fitted = store.converged(sorted(rough.values(), key=store.score)[:CONVERGED])
    return sorted(filter(store.admissible, fitted), key=store.score)[:count]
