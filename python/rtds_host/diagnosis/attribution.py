"""The attribution of a gap: which effects are included, how probable each is, and which are indistinguishable.

Where a gap remains, an effect is included if it reduces the residual on held-out runs (cross-validation, `choice`). The
model is not exact then, and its likelihood overstates the evidence for small improvements. Where only noise is left the
likelihood is exact, and the posterior odds decide.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from rtds_host.diagnosis.choice import MAX_RESIDUAL_RATIO, HeldOutScore, moved, pooled, residual_ratio
from rtds_host.diagnosis.evidence import enough_to_include, excess, gap_gain, likelihood_gain, log_odds
from rtds_host.diagnosis.fit import Fit, Hypothesis, joined
from rtds_host.diagnosis.gap import LEAST
from rtds_host.diagnosis.left_out import left_out_gap
from rtds_host.diagnosis.practically_indistinguishable import practically_indistinguishable
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.scatter import absent
from rtds_host.diagnosis.search.driver import Search
from rtds_host.diagnosis.search.moves import removing
from rtds_host.diagnosis.search.moves.adding import with_one_of
from rtds_host.diagnosis.search.store import Store
from rtds_host.diagnosis.thresholds import FEW_SHARE, MAJORITY

Cause = tuple[str, str]
# Why an effect of the most probable explanation is not included.
NEGLIGIBLE = "closes hardly any of the gap"
NOT_CROSS_VALIDATED = "does not reduce the residual of held-out runs"


@dataclass(frozen=True)
class EffectEvidence:
    """The evidence for one effect of an explanation.

    refitted : the explanation fitted without it; without : the same, with the nuisances that give the smallest gap;
    gaps : without and with it; gain : of log likelihood by it; t : the gain over its standard deviation, estimated from
    its scatter between blocks of time; share : by how much it reduces the likelihood's excess over white noise, as a
    share of that without it; residual_ratio : the residual with it over that without it, on held-out runs
    (`choice.residual_ratio`); closes : by how much the gap is smaller with it, there; probability : that it is present.
    """

    cause: Cause
    without: Fit
    refitted: Fit
    gaps: tuple[float, float]
    gain: float
    t: float
    share: float
    residual_ratio: float
    closes: float
    probability: float


@dataclass(frozen=True)
class Attribution:
    """The included effects, the fit with just these, and the effects that are indistinguishable from them.

    base : the fit without effects; rejected : (effect, side) -> why an effect of the most probable explanation is not
    included; indistinguishable : sets, each with an included effect first; alternatives : explanations with their
    probabilities, best first; shares : included effect with indistinguishable ones -> its share of the probability of
    them all, in proportion to the priors.
    """

    fit: Fit
    base: Fit
    included: tuple[EffectEvidence, ...]
    rejected: dict[Cause, str]
    indistinguishable: tuple[tuple[Cause, ...], ...]
    alternatives: tuple[tuple[Hypothesis, float], ...]
    shares: dict[Cause, float] = field(default_factory=dict)

    def share(self, cause: Cause) -> float:
        """An included effect's share of the probability that it has with its indistinguishable ones; 1 if it has none
        (contract, section 5)."""
        return self.shares.get(cause, 1.0)


def attribute(search: Search, fit: Fit) -> Attribution:
    """The attribution of a gap to the effects of an explanation; each is included or removed by its own evidence."""
    store = search.store
    simple = removing.pruned(store, fit) if store.within_noise(fit) else _simplest(store, fit)
    return _eliminated(search, simple if store.admissible(simple) else fit, {})


def without_effects(search: Search, before: Attribution, removed: dict[Cause, str]) -> Attribution:
    """An attribution without some of its effects; the others are fitted and tested again.

    removed : these effects, and why each is no longer included.
    """
    store, base, rejected = search.store, before.base, before.rejected | removed
    kept = {cause: u for cause, u in before.fit.parts.items() if cause not in removed}
    if not kept:
        return Attribution(base, base, (), rejected, (), _alternatives(store, base, [], []))
    return _eliminated(search, _predicting_best(store, store.try_fit(*joined(kept), before.fit)), rejected)


def with_one_more(search: Search, before: Attribution, names: set[str], curves: float) -> Attribution:
    """An attribution with one of some effects more, that which leaves least of held-out runs, if they support it and it
    makes the larger part of what curves make.

    curves : the residual power that these leave, see `HeldOutScore.residual_power`.
    """
    store, problem = search.store, search.problem
    if not (names := names & store.wanted):
        return before
    problem.follow_angles(True)
    fits = store.settled(store.try_fits(with_one_of(store, before.fit, names)))
    problem.follow_angles(False)
    now = HeldOutScore.of(problem, before.fit)
    scores = [HeldOutScore.of(problem, fit) for fit in fits if store.admissible(fit)]
    best = min(scores, key=lambda one: one.gap, default=now)
    left, most = (one.residual_power for one in (best, now))
    if residual_ratio(best, now) > MAX_RESIDUAL_RATIO or most - left < MAJORITY * (most - curves):
        return before
    found = _eliminated(search, best.fit, dict(before.rejected))
    # It may not stand next to what is left of the others.
    return found if set(found.fit.hypothesis) - set(before.fit.hypothesis) else before


def _predicting_best(store: Store, fit: Fit) -> Fit:
    """Of the local optima of an explanation the one that leaves least of held-out runs, where a gap remains."""
    if store.within_noise(fit):
        return fit
    (optima,) = store.local_optima([fit])
    best = min(optima, key=lambda one: left_out_gap(store.problem, one))
    return best if best is fit else replace(best, noise=store.problem.white().estimated(best.residual))


def _eliminated(search: Search, fit: Fit, rejected: dict[Cause, str]) -> Attribution:
    """The attribution by backward elimination. Effects that are removed are added to `rejected`."""
    store, effects = search.store, []
    while fit.hypothesis:
        gap_left = not store.within_noise(fit)
        if gap_left:
            (fit,) = store.settled([fit])
        if refused := store.refused(fit):
            # Fitted again without another effect, a size may have moved where it is no cause.
            cause, why = next(iter(refused.items()))
            rejected[cause] = why
            (fit,) = store.converged(removing.without(store, fit, cause))
            continue
        refitted = removing.without(store, fit, *fit.hypothesis)
        refitted = store.settled(refitted) if gap_left else store.converged(refitted)
        effects = [_evidence_for(store, fit, cause, one) for cause, one in zip(fit.hypothesis, refitted)]
        removed = _weakest(store, fit, effects)
        if removed is None:
            break
        weakest, reason = removed
        rejected[weakest.cause] = reason
        (fit,) = store.converged([weakest.refitted])
    base = _base(store)
    if fit.hypothesis and left_out_gap(store.problem, fit) > left_out_gap(store.problem, base):
        rejected |= {cause: NOT_CROSS_VALIDATED for cause in fit.hypothesis}
        fit = store.fits[()]
    if not fit.hypothesis:
        fit, effects = base, []
    sets, rivals = practically_indistinguishable(search, fit, [(s.cause, s.refitted) for s in effects])
    effects.sort(key=lambda s: -s.gain)
    alternatives, shares = _alternatives(store, fit, effects, rivals), {s[0]: _share(store, s) for s in sets}
    return Attribution(fit, base, tuple(effects), rejected, sets, alternatives, shares)


def _base(store: Store) -> Fit:
    """The fit without effects: nuisances refitted, or as declared where that predicts held-out runs better."""
    problem, fit = store.problem, store.nuisances_only()
    return min((fit, declared(problem, fit)), key=lambda one: left_out_gap(problem, one))


def declared(problem: Problem, fit: Fit) -> Fit:
    """A fit without effects, with the nuisances fixed at their declared values."""
    residual = problem.residual(problem.nominal.with_start(fit.start))
    return replace(fit, z=np.zeros_like(fit.z), residual=residual, free=np.zeros_like(fit.free))


def _simplest(store: Store, fit: Fit) -> Fit:
    """The explanation with effects in their simpler form, where cross-validation does not support the full form."""
    problem, full = store.problem, HeldOutScore.of(store.problem, fit)
    for rough in sorted(store.try_fits(removing.simpler_forms(store, fit), rough=True), key=store.score):
        (simple,) = store.converged([rough])
        score = HeldOutScore.of(problem, simple)
        if store.admissible(simple) and residual_ratio(full, score) > MAX_RESIDUAL_RATIO:
            # Each effect that replaces another must reduce the residual by enough, too.
            reduced = store.converged(removing.without(store, simple, *set(simple.hypothesis) - set(fit.hypothesis)))
            if all(residual_ratio(score, HeldOutScore.of(problem, one)) <= MAX_RESIDUAL_RATIO for one in reduced):
                return _simplest(store, simple)
    return fit


def _evidence_for(store: Store, fit: Fit, cause: Cause, refitted: Fit) -> EffectEvidence:
    """The evidence for one effect: the largest of the log odds by likelihood, by gap and, where a gap remains, by
    held-out runs, added to the prior's."""
    problem = store.problem
    gain, t = likelihood_gain(problem, fit, refitted)
    without, gap = _smallest_gap(store, fit, refitted)
    score = HeldOutScore.of(problem, fit)
    others = [HeldOutScore.of(problem, one) for one in dict.fromkeys((without, refitted))]
    ratio = max(residual_ratio(score, other) for other in others)
    least = max(pooled(score, other) * moved(score, other) for other in others)
    closes = math.sqrt(1.0 + score.residual_power / least) - score.gap
    evidence = [log_odds(gain, t), log_odds(*gap_gain(problem, fit, without))]
    if not store.within_noise(fit):
        # The log likelihood ratio of held-out runs: each block of time is one Gaussian sample of unknown variance.
        evidence.append(-0.5 * problem.block_count * math.log(ratio))
    odds = store.log_prior((cause,)) + max(evidence)
    probability = 1.0 / (1.0 + math.exp(-max(min(odds, 50.0), -50.0)))
    gaps, share = (gap, problem.gap_as_fitted(fit.model(problem))), store.excess_reduction(fit, refitted)
    return EffectEvidence(cause, without, refitted, gaps, gain, t, share, ratio, closes, probability)


def _smallest_gap(store: Store, fit: Fit, without: Fit) -> tuple[Fit, float]:
    """The explanation without an effect, with the nuisances that give the smallest gap, and that gap. The most probable
    nuisances may give a larger gap, and so overstate the effect's contribution."""
    problem = store.problem
    kept = replace(without, z=fit.z, residual=problem.residual(without.model_at(problem, fit.z)))
    candidates = [without, kept, *([store.nuisances_only()] if not without.hypothesis else [])]
    gaps = [problem.gap_as_fitted(f.model(problem)) for f in candidates]
    k = min(range(len(candidates)), key=gaps.__getitem__)
    return candidates[k], gaps[k]


def _weakest(store: Store, fit: Fit, effects: list[EffectEvidence]) -> tuple[EffectEvidence, str] | None:
    """The effect with the least evidence and the reason to remove it; None if the evidence for each suffices."""
    if store.within_noise(fit):
        one = min(effects, key=lambda s: s.probability)
        if one.probability < MAJORITY:
            uneven = f"gain {one.gain:.0f}, {one.t:.1f} times its scatter"
            return one, f"has evidence that is too uneven over the runs ({uneven})"
        negligible = [(gap, one) for one in effects if (gap := _negligible_gap(store, fit, one)) is not None]
        return (min(negligible, key=lambda found: found[0])[1], NEGLIGIBLE) if negligible else None
    one = max(effects, key=lambda s: s.residual_ratio)
    if one.residual_ratio > MAX_RESIDUAL_RATIO:
        return one, f"{NOT_CROSS_VALIDATED} (it leaves {min(one.residual_ratio, 9.99):.2f} of the unexplained part)"
    # Almost any effect reduces the gap by a small share of the gap without effects.
    one = min(effects, key=lambda s: s.closes)
    return (one, NEGLIGIBLE) if one.closes < FEW_SHARE * store.gap(store.fits[()]) else None


def _negligible_gap(store: Store, fit: Fit, one: EffectEvidence) -> float | None:
    """Where only noise is left: the gap without an effect if the effect does not reduce it enough; else None."""
    problem, (without, gap) = store.problem, one.gaps
    if excess(problem, fit) > 0.0:
        return None if enough_to_include(without, gap, one.share) else without
    # Refitted nuisances may compensate for nearly all of the effect, so that only the likelihood distinguishes the two.
    # So the gap without the effect is computed with all other parameters unchanged. Where the nuisances compensate for
    # it to within noise, its removal must then raise the squared gap by more than that of noise, 1.
    compensated = without < LEAST and excess(problem, store.fits[one.without.hypothesis]) == 0.0
    without = max(without, problem.gap_as_fitted(absent(problem, fit, one.cause)))
    included = enough_to_include(without, gap) and not (compensated and without**2 - gap**2 < 1.0)
    return None if included else without


def _share(store: Store, causes: tuple[Cause, ...]) -> float:
    """The prior probability of the first of a set of indistinguishable effects over the sum of those of the set."""
    priors = [math.exp(store.log_prior((cause,))) for cause in causes]
    return priors[0] / sum(priors)


def _alternatives(
    store: Store, fit: Fit, effects: list[EffectEvidence], rivals: list[Fit]
) -> tuple[tuple[Hypothesis, float], ...]:
    """Explanations with their posterior probabilities, best first; none is more probable than the fit."""
    others = {f.hypothesis: f for f in [*rivals, *(s.without for s in effects), store.fits[()]] if f is not fit}
    weights = {fit.hypothesis: 1.0}
    for hypothesis, other in others.items():
        odds = store.log_prior(hypothesis) - store.log_prior(fit.hypothesis)
        odds -= log_odds(*likelihood_gain(store.problem, fit, other))
        weights[hypothesis] = math.exp(min(odds, 0.0))
    total = sum(weights.values())
    ranked = sorted(weights.items(), key=lambda item: (-item[1], item[0] != fit.hypothesis))
    return tuple((hypothesis, weight / total) for hypothesis, weight in ranked)
