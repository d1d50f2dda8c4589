"""From the most probable explanation to an account: which effects stand, how sure, how large, what cannot be told
apart.

An effect is taken out, the others are fitted again, and the two explanations are compared by what can be believed of
the gain of likelihood between them (`evidence`):

    log odds(present) = log prior odds + min(G, t^2 / 2)

by the likelihood or by the gap's own measure, whichever misses it more: the first feels what is fast, the second what
is slow.

It must also be worth naming, on runs that it was not fitted to as well (`left_out`), be of one size in all runs and
settings (`carried`), and not be contradicted by what measured signals say of the blocks that they drive (`localise`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from rtds_host.diagnosis.carried import absent, carried, scattered
from rtds_host.diagnosis.chance import MOST, SAME
from rtds_host.diagnosis.evidence import (
    CONVINCING,
    believed,
    closer,
    compared,
    excess,
    worth_adding,
    worth_naming,
)
from rtds_host.diagnosis.fit import Fit, Hypothesis, joined
from rtds_host.diagnosis.gap import LEAST
from rtds_host.diagnosis.left_out import left_out_gap
from rtds_host.diagnosis.localise.standins import absences
from rtds_host.diagnosis.lookalikes import LARGEST_SET, lookalikes
from rtds_host.diagnosis.screen import clashes
from rtds_host.diagnosis.search import Search

# Why an effect does not stand that the likelihood sees.
NOTHING = "closes next to nothing of the gap"


@dataclass(frozen=True)
class Standing:
    """What speaks for one effect of an explanation.

    without : the explanation fitted without it; gaps : without and with it; gain : of log likelihood by it; t : the
    gain over its scatter between blocks; share : what it takes off the likelihood's excess over white noise, a share of
    that without it; probability : that it is present.
    """

    member: tuple[str, str]
    without: Fit
    gaps: tuple[float, float]
    gain: float
    t: float
    share: float
    probability: float


@dataclass(frozen=True)
class Account:
    """The effects that stand, in the fit that holds just these, and those that cannot be told from them.

    base : nuisances refitted, no effect; dropped : (effect, side) -> why it was in the most probable explanation and
    does not stand; alike : sets, each holding a blamed one first; alternatives : other explanations and how likely each
    is beside the first, best first; shares : of each blamed effect that has look-alikes, its share of their common
    probability, by prior.
    """

    fit: Fit
    base: Fit
    standing: tuple[Standing, ...]
    dropped: dict[tuple[str, str], str]
    alike: tuple[tuple[tuple[str, str], ...], ...]
    alternatives: tuple[tuple[Hypothesis, float], ...]
    shares: dict[tuple[str, str], float] = field(default_factory=dict)

    def share(self, member: tuple[str, str]) -> float:
        """What of its probability is an effect's own; the rest is that of its look-alikes (contract, section 5)."""
        return self.shares.get(member, 1.0)


def _standing(search: Search, fit: Fit, rough: bool) -> list[Standing]:
    """What speaks for each effect; `rough`: by a rough fit without it, which makes it look stronger than it is."""
    without = search.without(fit, *fit.hypothesis)
    if not rough:
        without = search.try_fits((one.hypothesis, one.u, one) for one in without)
    return [_weighed(search, fit, member, one) for member, one in zip(fit.hypothesis, without)]


def _weighed(search: Search, fit: Fit, member: tuple[str, str], without: Fit) -> Standing:
    gain, t = compared(search.problem, fit, without)
    share = search.takes_off(fit, without)
    without, gap = _closest(search, fit, without)
    odds = search.log_prior((member,)) + max(believed(gain, t), believed(*closer(search.problem, fit, without)))
    probability = 1.0 / (1.0 + math.exp(-max(min(odds, 50.0), -50.0)))
    return Standing(
        member, without, (gap, search.problem.gap_as_fitted(fit.model(search.problem))), gain, t, share, probability
    )


def _closest(search: Search, fit: Fit, without: Fit) -> tuple[Fit, float]:
    """The explanation without an effect, with the nuisances that bring its replay closest, and its gap: those that the
    likelihood prefers beside so large a discrepancy may open the gap, which would flatter the effect."""
    problem = search.problem
    kept = replace(without, z=fit.z, residual=problem.residual(without.model_at(problem, fit.z)))
    tried = [without, kept, *([search.refitted()] if not without.hypothesis else [])]
    gaps = [problem.gap_as_fitted(f.model(problem)) for f in tried]
    k = min(range(len(tried)), key=gaps.__getitem__)
    return tried[k], gaps[k]


def _fallen(
    search: Search, fit: Fit, standing: list[Standing], steady: set[tuple[str, str]]
) -> tuple[Standing, str] | None:
    """The effect that stands least, and why it does not; None where all stand. `steady` as of `_uneven`."""
    if not standing:
        return None
    return (
        _unlikely(standing)
        or _fickle(search, fit, standing)
        or _uneven(search, fit, standing, steady)
        or _poor(search, fit, standing)
        or _unforetold(search, fit, standing)
        or _contradicted(search, fit, standing)
    )


def _unlikely(standing: list[Standing]) -> tuple[Standing, str] | None:
    """The one that is least likely there, if it is less likely there than not."""
    one = min(standing, key=lambda s: s.probability)
    return (
        None
        if one.probability >= MOST
        else (
            one,
            f"is missed too unevenly to be there (gain {one.gain:.0f}, {one.t:.1f} times its scatter over the runs)",
        )
    )


def _fickle(search: Search, fit: Fit, standing: list[Standing]) -> tuple[Standing, str] | None:
    """The one that carries over to other runs least, if more of it does not than does."""
    over = carried(search.problem, fit)
    one = min(standing, key=lambda s: over[s.member])
    return (
        None
        if over[one.member] >= MOST
        else (
            one,
            (
                "is of another size in every run (fitted to the others it takes off "
                f"{100 * max(over[one.member], 0.0):.0f} % of what it does fitted to all)"
            ),
        )
    )


def _uneven(
    search: Search, fit: Fit, standing: list[Standing], steady: set[tuple[str, str]]
) -> tuple[Standing, str] | None:
    """The one whose size scatters most over the settings, if it is no constant.

    A machine that the models describe no better than to many times the noise scatters in its constants, by more the
    worse they are described, but each is one for the larger part. steady : effects seen to be of one size beside more
    others, to which those seen now are added. They stay so: what scatters once a stand-in is taken out is the rest that
    it stood for.
    """
    beyond = scattered(search.problem, fit)
    gap = search.problem.gap(fit.model(search.problem))
    steady |= {member for member, much in beyond.items() if much <= min(SAME * max(gap - 1.0, 1.0), MOST)}
    one = max(standing, key=lambda s: (s.member not in steady, beyond[s.member]))
    return (
        None
        if one.member in steady
        else (one, f"is of another size in other settings (it scatters by {100 * beyond[one.member]:.0f} %)")
    )


def _poor(search: Search, fit: Fit, standing: list[Standing]) -> tuple[Standing, str] | None:
    """The one that closes least, if it is not worth naming.

    Where no more than noise is left the likelihood tells an effect from a tolerance that nearly takes its place: the
    gap is that without it and all else as it is. One whose place is taken to within noise must open more than noise
    then.
    """
    poor = []
    exact = excess(search.problem, fit) == 0.0
    for one in standing:
        without, gap = one.gaps
        if exact:
            replaced = without < LEAST and excess(search.problem, search.fits[one.without.hypothesis]) == 0.0
            without = max(without, search.problem.gap_as_fitted(absent(search.problem, fit, one.member)))
            worth = worth_naming(without, gap) and not (replaced and without**2 - gap**2 < 1.0)
        else:
            worth = worth_naming(without, gap, one.share)
        if not worth:
            poor.append((without, one))
    return (min(poor, key=lambda found: found[0])[1], NOTHING) if poor else None


def _unforetold(search: Search, fit: Fit, standing: list[Standing]) -> tuple[Standing, str] | None:
    """Of those that do not bring runs closer that were not used for the fit (contract, section 5), the one without
    which these are foretold best."""
    if excess(search.problem, fit) == 0.0:
        return None
    gap = left_out_gap(search.problem, fit)
    # The nuisances that bring the fitted runs closest are no optimum, and a step from there may lead away from the run
    # left out.
    without = {
        s.member: min(
            left_out_gap(search.problem, f)
            for f in {id(f): f for f in (s.without, search.fits[s.without.hypothesis])}.values()
        )
        for s in standing
    }
    failed = [s for s in standing if not worth_naming(without[s.member], gap, s.share)]
    one = min(failed, key=lambda s: without[s.member], default=None)
    return (
        None
        if one is None
        else (
            one,
            (
                f"does not bring runs closer that it was not fitted to (their gap is {without[one.member]:.3g} without"
                f" it, {gap:.3g} with it)"
            ),
        )
    )


def _contradicted(search: Search, fit: Fit, standing: list[Standing]) -> tuple[Standing, str] | None:
    """The one that opens the blocks which are driven by measured signals most, if any does beyond chance; else the one
    that is least its own there, if it is more of a cause without a name.

    A track that is wider than declared brings a replay's turns closer where a drag slows them; but then the measured
    wheels and the gyro, which agree, would have to disagree.
    """
    problem = search.problem
    found = absences(
        problem.looked_at, fit.model(problem), {s.member: absent(problem, fit, s.member) for s in standing}
    )
    if not found.count:
        return None
    one = max(standing, key=lambda s: found.opened[s.member])
    if found.opened[one.member] > 2.0 * math.log(CONVINCING) * (1.0 + found.left / found.count):
        return (
            one,
            "opens what measured signals close (it leaves more of the blocks that they drive than there is without it)",
        )
    one = min(standing, key=lambda s: found.kept.get(s.member, 1.0))
    kept = found.kept.get(one.member, 1.0)
    return (
        None
        if kept >= MOST or excess(problem, fit) == 0.0
        else (
            one,
            (
                f"stands in for {found.cause} (beside it {100 * max(kept, 0.0):.0f} % of what it does to the blocks is"
                " its own)"
            ),
        )
    )


def account(search: Search, fit: Fit) -> Account:
    """Name the effects of the most probable explanation that stand on their own evidence."""
    dropped: dict[tuple[str, str], str] = {}
    steady: set[tuple[str, str]] = set()
    doubted: list[tuple[str, str]] = []
    rough, fewest = True, len(fit.hypothesis)
    while True:
        standing = _standing(search, fit, rough)
        fallen = _fallen(search, fit, standing, steady)
        if fallen is not None:
            one, dropped[one.member] = fallen
            doubted += [one.member] if _unlikely(standing) else []
            fit = search.try_fit(one.without.hypothesis, one.without.u, one.without)
        elif len(fit.hypothesis) < fewest:
            # Those that are left may have leant on one that is gone; another of as many may explain more.
            fewest = len(fit.hypothesis)
            other = search.renamed(search.exchange(search.polished(fit, fit.hypothesis), LARGEST_SET))
            if not dropped.keys() & set(other.hypothesis) and search.gap(other) <= search.gap(fit):
                fit = other
        elif rough:
            # What stands may be plainer than it was found: Coulomb friction for Stribeck's.
            plainer, rough = search.prune(fit), False
            fit = plainer if search.named(plainer) and not dropped.keys() & set(plainer.hypothesis) else fit
        else:
            break
    spare = [member for member, reason in dropped.items() if reason == NOTHING]
    alike, rivals = lookalikes(search, fit, [(s.member, s.without) for s in standing], spare)
    possible = [f for f in rivals if not dropped.keys() & set(f.hypothesis)]
    for better in _foretelling(search, fit, [*possible, *_with_doubted(search, possible, doubted)]):
        own = _standing(search, better, False)
        if _fallen(search, better, own, set(steady)) is None:
            fit, standing = better, own
            dropped = {member: reason for member, reason in dropped.items() if member not in fit.hypothesis}
            alike, rivals = lookalikes(search, fit, [(s.member, s.without) for s in standing], spare)
            break
    standing.sort(key=lambda s: -s.gain)
    return Account(
        fit,
        search.refitted(),
        tuple(standing),
        dropped,
        alike,
        _alternatives(search, fit, standing, rivals),
        {members[0]: _share(search, members) for members in alike},
    )


def _with_doubted(search: Search, rivals: list[Fit], doubted: list[tuple[str, str]]) -> list[Fit]:
    """Look-alikes' fits with an effect that was too unlikely beside what they stand in the place of: a driver that
    bends does most of what a gain and dry friction do, and beside it no friction is missed."""
    starts = []
    for member in doubted:
        size = min((f for f in search.fits.values() if member in f.hypothesis), key=search.score).parts[member]
        starts += [
            (*joined({**rival.parts, member: size}), rival) for rival in rivals if not clashes(member, rival.hypothesis)
        ]
    return [f for f in search.try_fits(starts) if search.named(f)]


def _foretelling(search: Search, fit: Fit, rivals: list[Fit]) -> list[Fit]:
    """Of the fits that these runs cannot tell from another, those that foretell runs left out better by more than a gap
    and a tenth of the rest, best first."""
    gaps = {f.hypothesis: left_out_gap(search.problem, f) for f in [fit, *rivals]} if rivals else {}
    better = [f for f in rivals if worth_adding(gaps[fit.hypothesis], gaps[f.hypothesis])]
    return sorted(better, key=lambda f: gaps[f.hypothesis])


def _share(search: Search, members: tuple[tuple[str, str], ...]) -> float:
    """Of a set of look-alikes, the first one's share by prior."""
    priors = [math.exp(search.log_prior((member,))) for member in members]
    return priors[0] / sum(priors)


def _alternatives(
    search: Search, fit: Fit, standing: list[Standing], rivals: list[Fit]
) -> tuple[tuple[Hypothesis, float], ...]:
    others = {f.hypothesis: f for f in [*rivals, *(s.without for s in standing), search.fits[()]] if f is not fit}
    weights = {fit.hypothesis: 1.0}
    for hypothesis, other in others.items():
        gain, t = compared(search.problem, fit, other)
        odds = search.log_prior(hypothesis) - search.log_prior(fit.hypothesis) - believed(gain, t)
        weights[hypothesis] = math.exp(min(odds, 0.0))
    total = sum(weights.values())
    ranked = sorted(weights.items(), key=lambda item: (-item[1], item[0] != fit.hypothesis))
    return tuple((hypothesis, weight / total) for hypothesis, weight in ranked)
