"""How much an effect's size differs between the settings that a robot was met in (contract, section 5, `scatter`).

The blocks of time are put in order of each setting (how fast, how loaded, which way, how late, which run) and cut in
groups that know as much as each other of the effect's size, relative to what was fitted. Of group g alone the size
would be s_g, known to 1/I_g. What these scatter about their mean m beyond chance, Q = sum_g I_g (s_g - m)^2 less what
is expected and what convinces, is a relative scatter of sqrt(Q / sum_g I_g). What the other effects can take up over
all runs is projected off.

Reference: J. Peters, P. Buehlmann, N. Meinshausen, J. R. Stat. Soc. B 78, 2016 (a cause is invariant over settings).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rtds_host.diagnosis.effects import Parameter
from rtds_host.diagnosis.evidence import CONVINCING
from rtds_host.diagnosis.fit import Fit, apply, parameters
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import Model
from rtds_host.diagnosis.settings import settings
from rtds_host.diagnosis.thresholds import MINOR_SHARE, Z90

# Numerical: groups that are left out in turn: runs; where there are fewer of these, stretches of them.
FEWEST_GROUPS = 4


def groups(problem: Problem) -> np.ndarray:
    """Which group of residuals each one belongs to, (N,): its run, or its part of a run where there are few."""
    runs = int(problem.runs_of.max(initial=0)) + 1
    if runs >= FEWEST_GROUPS:
        return problem.runs_of
    parts = -(-FEWEST_GROUPS // runs)
    found = np.empty(problem.size, int)
    for run in range(runs):
        mine = np.flatnonzero(problem.runs_of == run)
        if not mine.size:
            continue
        first, last = problem.blocks[mine].min(), problem.blocks[mine].max() + 1
        found[mine] = run * parts + (problem.blocks[mine] - first) * parts // (last - first)
    return found


def scattered(problem: Problem, fit: Fit) -> dict[tuple[str, str], tuple[float, str | None]]:
    """Relative scatter of each effect's size over the setting with which it scatters most, per the module's head, and
    that setting; None where it does not scatter beyond chance.
    """
    met = settings(problem, fit.model(problem))
    white, jacobian = fit.whitened()
    columns = list(enumerate(parameters(fit.effects, fit.hypothesis), len(fit.z)))
    result = {}
    for cause in fit.hypothesis:
        sized = [(k, p) for k, (effect, side, p) in columns if (effect.id, side) == cause and not p.shape]
        at = [k for k, _ in columns if fit.free[k] and k not in {j for j, _ in sized}]
        of_each = (jacobian[:, k].astype(float) * _size(p, float(fit.u[k - len(fit.z)])) for k, p in sized)
        own = sum(of_each, np.zeros(len(jacobian)))
        own = _apart(fit, jacobian, own, at)
        known = np.bincount(problem.blocks, own * own, minlength=problem.block_count)
        weighted = known - np.bincount(problem.blocks, own * white, minlength=problem.block_count)
        most, setting = max((scatter(values, weighted, known), name) for name, values in met.items())
        result[cause] = (most, setting if most > 0.0 else None)
    return result


@dataclass(frozen=True)
class RunSize:
    """How large an effect or a form is in a run: `size`, relative to all runs together, and half of its 90 % interval;
    infinite where the run says nothing of it."""

    run: str
    size: float
    reach: float


def over_runs(problem: Problem, fit: Fit) -> dict[tuple[str, str], list[RunSize]]:
    """Sizes run by run, in the order of the runs, of what differs between them beyond chance and by more than a slight
    part; effects and forms alike.

    A run's size is that of a fit to it alone along the line from nothing to the size of all runs. What other
    parameters can take up over all runs is projected off. Its error follows from how its blocks of time scatter.
    """
    white, jacobian = fit.whitened()
    columns = list(enumerate(parameters(fit.effects, fit.hypothesis), len(fit.z)))
    run_of = np.zeros(problem.block_count, int)
    run_of[problem.blocks] = problem.runs_of
    found = {}
    for cause in fit.hypothesis:
        sized = [(k, p) for k, (effect, side, p) in columns if (effect.id, side) == cause and not p.shape]
        at = [k for k, _ in columns if fit.free[k] and k not in {j for j, _ in sized}]
        own = np.zeros(len(jacobian))
        for k, p in sized:
            own += jacobian[:, k].astype(float) * _size(p, float(fit.u[k - len(fit.z)]))
        own = _apart(fit, jacobian, own, at)
        known = np.bincount(problem.blocks, own * own, minlength=problem.block_count)
        weighted = known - np.bincount(problem.blocks, own * white, minlength=problem.block_count)
        if scatter(run_of.astype(float), weighted, known) > MINOR_SHARE:
            found[cause] = [
                _of_run(data.log.name, weighted[run_of == k], known[run_of == k])
                for k, data in enumerate(problem.whole)
            ]
    return found


def _of_run(name: str, weighted: np.ndarray, known: np.ndarray) -> RunSize:
    """A run's size from those of its blocks, I_b s_b and I_b, (blocks,) each."""
    total, used = float(known.sum()), known > 0.0
    if total <= 0.0:
        return RunSize(name, 1.0, math.inf)
    size = float(weighted.sum()) / total
    within = float(known[used] @ (weighted[used] / known[used] - size) ** 2)
    chance = max(within / max(int(np.count_nonzero(used)) - 1, 1), 1.0)
    return RunSize(name, size, Z90 * math.sqrt(chance / total))


def _apart(fit: Fit, jacobian: np.ndarray, own: np.ndarray, at: list[int]) -> np.ndarray:
    """What an effect does, whitened (N,), less what the parameters `at` can take up of it."""
    if not at:
        return own
    others = jacobian[:, at].astype(float)
    return own - others @ np.linalg.solve(fit.precision[np.ix_(at, at)], others.T @ own)


def _size(p: Parameter, u: float) -> float:
    """An effect's size in spreads: how far it is from absent; of what is absent far off, a stiff spring, the value
    itself.
    """
    return u if p.null in (0.0, 1.0) else p.value(u) / p.slope(p.value(u))


def scatter(values: np.ndarray, weighted: np.ndarray, known: np.ndarray) -> float:
    """Relative scatter of a size over groups of blocks in the order of `values`, of I_b s_b and I_b, all (blocks,)."""
    distinct, place = np.unique(values, return_inverse=True)
    before = np.cumsum(each := np.bincount(place, known, minlength=len(distinct))) - each
    group = (FEWEST_GROUPS * before / max(float(known.sum()), 1e-300)).astype(int).clip(0, FEWEST_GROUPS - 1)[place]
    counts, sums, cross = (np.bincount(group, what, minlength=FEWEST_GROUPS) for what in (known > 0.0, known, weighted))
    if np.count_nonzero(sums) < 2:
        return 0.0
    sizes = cross / np.where(sums > 0.0, sums, 1.0)
    between = float(sums @ (sizes - cross.sum() / sums.sum()) ** 2)
    used = known > 0.0
    within = float(known[used] @ (weighted[used] / known[used] - sizes[group[used]]) ** 2)
    degrees = np.count_nonzero(sums) - 1
    chance = max(within / max(counts.sum() - degrees - 1, 1), 1.0)
    return math.sqrt(max(between - chance * (degrees + 2.0 * math.log(CONVINCING)), 0.0) / float(sums.sum()))


def absent(problem: Problem, fit: Fit, cause: tuple[str, str]) -> Model:
    """The model of a fit with everything but one of its effects."""
    kept = [(other, values) for other, values in zip(fit.hypothesis, fit.values) if other != cause]
    nominal = problem.with_nuisances(fit.z, fit.start)
    return apply(fit.effects, nominal, tuple(other for other, _ in kept), [values for _, values in kept])
