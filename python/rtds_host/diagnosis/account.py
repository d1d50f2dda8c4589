"""Which effects of the most probable explanation are included, how sure, and what these runs cannot distinguish.

Where a gap remains an effect is included if it helps on runs that it was not fitted to (`choice`): the model is not
exact then, and a likelihood is sure of anything that is a little closer to the machine's own form. Where nothing but
noise is left the likelihood is exact, and its odds decide.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from rtds_host.diagnosis.choice import WORTH, Judged, leaves
from rtds_host.diagnosis.evidence import believed, closer, compared, excess, worth_naming
from rtds_host.diagnosis.fit import Fit, Hypothesis, joined
from rtds_host.diagnosis.gap import LEAST
from rtds_host.diagnosis.left_out import left_out_gap
from rtds_host.diagnosis.lookalikes import lookalikes
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.scatter import absent
from rtds_host.diagnosis.search.driver import Search
from rtds_host.diagnosis.search.moves import removing
from rtds_host.diagnosis.search.store import Store
from rtds_host.diagnosis.thresholds import FEW_SHARE, MAJORITY

# Why an effect does not stand that the likelihood sees.
NOTHING = "closes next to nothing of the gap"
USELESS = "does not bring runs closer that it was not fitted to"


@dataclass(frozen=True)
class Standing:
    """What speaks for one effect of an explanation.

    without, refitted : the explanation without it, with the nuisances that bring it closest, and as fitted; gaps :
    without and with it; gain : of log likelihood by it; t : the gain over its scatter between blocks; share : what it
    takes off the likelihood's excess over white noise, a share of that without it; left : what it leaves of the squared
    gap on runs left out, a ratio (`choice.leaves`); probability : that it is present.
    """

    cause: tuple[str, str]
    without: Fit
    refitted: Fit
    gaps: tuple[float, float]
    gain: float
    t: float
    share: float
    left: float
    probability: float


@dataclass(frozen=True)
class Account:
    """The effects that stand, in the fit that holds just these, and those that cannot be told from them.

    base : nuisances refitted, no effect; dropped : (effect, side) -> why it was in the most probable explanation and
    is not included; alike : sets, each holding an included one first; alternatives : other explanations and how likely
    each is compared with the first, best first; shares : of each included effect with indistinguishable ones, its share
    of their common probability, by prior.
    """

    fit: Fit
    base: Fit
    standing: tuple[Standing, ...]
    dropped: dict[tuple[str, str], str]
    alike: tuple[tuple[tuple[str, str], ...], ...]
    alternatives: tuple[tuple[Hypothesis, float], ...]
    shares: dict[tuple[str, str], float] = field(default_factory=dict)

    def share(self, cause: tuple[str, str]) -> float:
        """What of its probability is an effect's own; the rest is that of its look-alikes (contract, section 5)."""
        return self.shares.get(cause, 1.0)


def account(search: Search, fit: Fit) -> Account:
    """Name the effects of an explanation that are included on their own evidence."""
    dropped: dict[tuple[str, str], str] = {}
    store = search.store
    plain = removing.pruned(store, fit) if store.closed(fit) else _plainest(store, fit)
    return _accounted(search, plain if store.named(plain) else fit, dropped)


def less(search: Search, before: Account, gone: dict[tuple[str, str], str]) -> Account:
    """An account without some of its effects, the others fitted and weighed again; gone : why each of these is no
    longer included."""
    store, kept = search.store, {cause: u for cause, u in before.fit.parts.items() if cause not in gone}
    if not kept:
        return Account(
            before.base, before.base, (), before.dropped | gone, (), _alternatives(store, before.base, [], [])
        )
    return _accounted(search, store.try_fit(*joined(kept), before.fit), before.dropped | gone)


def _accounted(search: Search, fit: Fit, dropped: dict[tuple[str, str], str]) -> Account:
    """The account of an explanation, without the effects in it that are not worth it, which join `dropped`."""
    store = search.store
    while fit.hypothesis:
        refitted = store.in_earnest(removing.without(store, fit, *fit.hypothesis))
        standing = [_weighed(store, fit, cause, one) for cause, one in zip(fit.hypothesis, refitted)]
        exact = store.closed(fit)
        fallen = (_unlikely(standing) or _poor(store, standing, fit)) if exact else _useless(store, standing)
        if fallen is None:
            break
        one, dropped[one.cause] = fallen
        (fit,) = store.in_earnest([one.refitted])
    else:
        standing = []
    base = _base(store)
    if fit.hypothesis and left_out_gap(store.problem, fit) > left_out_gap(store.problem, base):
        dropped |= {cause: USELESS for cause in fit.hypothesis}
        fit, standing = store.fits[()], []
    if not fit.hypothesis:
        fit = base
    alike, rivals = lookalikes(search, fit, [(s.cause, s.refitted) for s in standing])
    standing.sort(key=lambda s: -s.gain)
    return Account(
        fit,
        base,
        tuple(standing),
        dropped,
        alike,
        _alternatives(store, fit, standing, rivals),
        {causes[0]: _share(store, causes) for causes in alike},
    )


def _base(store: Store) -> Fit:
    """No effect: the nuisances refitted, or as declared where that predicts runs left out better."""
    problem, fit = store.problem, store.refitted()
    return min((fit, declared(problem, fit)), key=lambda one: left_out_gap(problem, one))


def declared(problem: Problem, fit: Fit) -> Fit:
    """A fit without effects with the nuisances as declared, held there."""
    return replace(
        fit,
        z=np.zeros_like(fit.z),
        residual=problem.residual(problem.nominal.begun(fit.start)),
        free=np.zeros_like(fit.free),
    )


def _plainest(store: Store, fit: Fit) -> Fit:
    """The explanation with effects in their simpler form, where the further parameters are not worth an effect."""
    found = Judged.of(store.problem, fit)
    for plain in sorted(store.try_fits(removing.plainer(store, fit), rough=True), key=store.score):
        (plain,) = store.in_earnest([plain])
        one = Judged.of(store.problem, plain)
        if store.named(plain) and leaves(found, one) > WORTH and _worth_it(store, plain, one, fit):
            return _plainest(store, plain)
    return fit


def _worth_it(store: Store, plain: Fit, judged: Judged, fit: Fit) -> bool:
    """Whether the simpler forms of an explanation's effects are worth their place themselves."""
    simpler = set(plain.hypothesis) - set(fit.hypothesis)
    less = store.in_earnest(removing.without(store, plain, *simpler))
    return all(leaves(judged, Judged.of(store.problem, one)) <= WORTH for one in less)


def _weighed(store: Store, fit: Fit, cause: tuple[str, str], refitted: Fit) -> Standing:
    problem = store.problem
    gain, t = compared(problem, fit, refitted)
    share = store.takes_off(fit, refitted)
    without, gap = _closest(store, fit, refitted)
    found = Judged.of(problem, fit)
    others = [Judged.of(problem, one) for one in ((refitted,) if without is refitted else (without, refitted))]
    left = max(leaves(found, one) for one in others)
    evidence = [believed(gain, t), believed(*closer(problem, fit, without))]
    if not store.closed(fit):
        # The likelihood of unknown size a block of time, of runs that the effect was not fitted to.
        evidence.append(-0.5 * problem.block_count * math.log(left))
    odds = store.log_prior((cause,)) + max(evidence)
    probability = 1.0 / (1.0 + math.exp(-max(min(odds, 50.0), -50.0)))
    return Standing(
        cause,
        without,
        refitted,
        (gap, problem.gap_as_fitted(fit.model(problem))),
        gain,
        t,
        share,
        left,
        probability,
    )


def _closest(store: Store, fit: Fit, without: Fit) -> tuple[Fit, float]:
    """The explanation without an effect, with the nuisances that bring its replay closest, and its gap: those that the
    likelihood prefers may open the gap, which would flatter the effect."""
    problem = store.problem
    kept = replace(without, z=fit.z, residual=problem.residual(without.model_at(problem, fit.z)))
    tried = [without, kept, *([store.refitted()] if not without.hypothesis else [])]
    gaps = [problem.gap_as_fitted(f.model(problem)) for f in tried]
    k = min(range(len(tried)), key=gaps.__getitem__)
    return tried[k], gaps[k]


def _useless(store: Store, standing: list[Standing]) -> tuple[Standing, str] | None:
    """The effect that helps least on runs left out, if it leaves more there than it may, or closes hardly a hundredth
    of the gap: what is left next to a cause that closes nearly all may be of any form."""
    one = max(standing, key=lambda s: s.left)
    if one.left > WORTH:
        return one, f"{USELESS} (it leaves {min(one.left, 9.99):.2f} of the unexplained part)"
    least = FEW_SHARE * store.gap(store.fits[()])
    one = min(standing, key=lambda s: s.gaps[0] - s.gaps[1])
    return (one, NOTHING) if one.gaps[0] - one.gaps[1] < least else None


def _unlikely(standing: list[Standing]) -> tuple[Standing, str] | None:
    """The effect that is least likely there, if it is less likely there than not."""
    one = min(standing, key=lambda s: s.probability)
    if one.probability >= MAJORITY:
        return None
    return one, f"is missed too unevenly to be there (gain {one.gain:.0f}, {one.t:.1f} times its scatter over the runs)"


def _poor(store: Store, standing: list[Standing], fit: Fit) -> tuple[Standing, str] | None:
    """Where nothing but noise is left: the effect that closes least, if it closes no gap."""
    poor, exact = [], excess(store.problem, fit) == 0.0
    for one in standing:
        without, gap = one.gaps
        if exact:
            # The likelihood tells an effect from a tolerance that nearly takes its place, the gap does not: it is that
            # without the effect and all else as it is. One whose place is taken to within noise must open more than
            # noise then.
            replaced = without < LEAST and excess(store.problem, store.fits[one.without.hypothesis]) == 0.0
            without = max(without, store.problem.gap_as_fitted(absent(store.problem, fit, one.cause)))
            worth = worth_naming(without, gap) and not (replaced and without**2 - gap**2 < 1.0)
        else:
            worth = worth_naming(without, gap, one.share)
        if not worth:
            poor.append((without, one))
    return (min(poor, key=lambda found: found[0])[1], NOTHING) if poor else None


def _share(store: Store, causes: tuple[tuple[str, str], ...]) -> float:
    """Of a set of look-alikes, the first one's share by prior."""
    priors = [math.exp(store.log_prior((cause,))) for cause in causes]
    return priors[0] / sum(priors)


def _alternatives(
    store: Store, fit: Fit, standing: list[Standing], rivals: list[Fit]
) -> tuple[tuple[Hypothesis, float], ...]:
    others = {f.hypothesis: f for f in [*rivals, *(s.without for s in standing), store.fits[()]] if f is not fit}
    weights = {fit.hypothesis: 1.0}
    for hypothesis, other in others.items():
        gain, t = compared(store.problem, fit, other)
        odds = store.log_prior(hypothesis) - store.log_prior(fit.hypothesis) - believed(gain, t)
        weights[hypothesis] = math.exp(min(odds, 0.0))
    total = sum(weights.values())
    ranked = sorted(weights.items(), key=lambda item: (-item[1], item[0] != fit.hypothesis))
    return tuple((hypothesis, weight / total) for hypothesis, weight in ranked)
