"""From the most probable explanation to an account: which effects stand, how sure, how large, what cannot be told apart.

An effect is taken out, the others are fitted again, and the two explanations are compared by what can be believed of the
gain of likelihood between them (`evidence`):

    log odds(present) = log prior odds + min(G, t^2 / 2)

by the likelihood or by the gap's own measure, whichever misses it more: the first feels what is fast, the second what is slow.

It must also be worth naming, on runs that it was not fitted to as well (`left_out`), be of one size in all runs and settings
(`carried`), and not be contradicted by what measured signals say of the blocks that they drive (`localise`).
"""

from __future__ import annotations

import math
from collections.abc import Container
from dataclasses import dataclass, field, replace

from rtds_host.diagnosis.carried import absent, carried, scattered
from rtds_host.diagnosis.chance import MOST, SAME, SLIGHT
from rtds_host.diagnosis.evidence import (
    CONVINCING,
    believed,
    closer,
    compared,
    excess,
    told_apart,
    worth_adding,
    worth_naming,
)
from rtds_host.diagnosis.fit import Fit, Hypothesis
from rtds_host.diagnosis.gap import LEAST
from rtds_host.diagnosis.left_out import left_out_gap
from rtds_host.diagnosis.localise.standins import absences
from rtds_host.diagnosis.screen import available, clashes
from rtds_host.diagnosis.search import Search
from rtds_host.diagnosis.twins import near_twins, twins

# Members that a set of look-alikes may have (contract, section 5).
LARGEST_SET = 3
# Why an effect does not stand that the likelihood sees.
NOTHING = "closes next to nothing of the gap"


@dataclass(frozen=True)
class Standing:
    """What speaks for one effect of an explanation.

    without : the explanation fitted without it; gaps : without and with it; gain : of log likelihood by it; t : the gain over its
    scatter between blocks; share : what it takes off the likelihood's excess over white noise, a share of that without it;
    probability : that it is present.
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

    base : nuisances refitted, no effect; dropped : (effect, side) -> why it was in the most probable explanation and does not
    stand; alike : sets, each holding a blamed one first; alternatives : other explanations and how likely each is beside the
    first, best first; shares : of each blamed effect that has look-alikes, its share of their common probability, by prior.
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
    share = _part(search, fit, without)
    without, gap = _closest(search, fit, without)
    odds = search.log_prior((member,)) + max(believed(gain, t), believed(*closer(search.problem, fit, without)))
    probability = 1.0 / (1.0 + math.exp(-max(min(odds, 50.0), -50.0)))
    return Standing(member, without, (gap, search.problem.gap_as_fitted(fit.model(search.problem))), gain, t, share, probability)


def _closest(search: Search, fit: Fit, without: Fit) -> tuple[Fit, float]:
    """The explanation without an effect, with the nuisances that bring its replay closest, and its gap: those that the
    likelihood prefers beside so large a discrepancy may open the gap, which would flatter the effect."""
    problem = search.problem
    kept = replace(without, z=fit.z, residual=problem.residual(without.model_at(problem, fit.z)))
    tried = [without, kept, *([search.refitted()] if not without.hypothesis else [])]
    gaps = [problem.gap_as_fitted(f.model(problem)) for f in tried]
    k = min(range(len(tried)), key=gaps.__getitem__)
    return tried[k], gaps[k]


def _fallen(search: Search, fit: Fit, standing: list[Standing], steady: set[tuple[str, str]]) -> tuple[Standing, str] | None:
    """The effect that stands least, and why it does not; None where all stand. `steady` as of `_uneven`."""
    if not standing:
        return None
    return (_unlikely(standing) or _fickle(search, fit, standing) or _uneven(search, fit, standing, steady)
            or _poor(search, fit, standing) or _unforetold(search, fit, standing)
            or _contradicted(search, fit, standing))


def _unlikely(standing: list[Standing]) -> tuple[Standing, str] | None:
    """The one that is least likely there, if it is less likely there than not."""
    one = min(standing, key=lambda s: s.probability)
    return None if one.probability >= MOST else (
        one, f"is missed too unevenly to be there (gain {one.gain:.0f}, {one.t:.1f} times its scatter over the runs)")


def _fickle(search: Search, fit: Fit, standing: list[Standing]) -> tuple[Standing, str] | None:
    """The one that carries over to other runs least, if more of it does not than does."""
    over = carried(search.problem, fit)
    one = min(standing, key=lambda s: over[s.member])
    return None if over[one.member] >= MOST else (
        one, ("is of another size in every run (fitted to the others it takes off "
              f"{100 * max(over[one.member], 0.0):.0f} % of what it does fitted to all)"))


def _uneven(search: Search, fit: Fit, standing: list[Standing], steady: set[tuple[str, str]]) -> tuple[Standing, str] | None:
    """The one whose size scatters most over the settings, if it is no constant.

    A machine that the models describe no better than to many times the noise scatters in its constants, by more the worse they are
    described, but each is one for the larger part. steady : effects seen to be of one size beside more others, to which those seen now
    are added. They stay so: what scatters once a stand-in is taken out is the rest that it stood for.
    """
    beyond = scattered(search.problem, fit)
    gap = search.problem.gap(fit.model(search.problem))
    steady |= {member for member, much in beyond.items() if much <= min(SAME * max(gap - 1.0, 1.0), MOST)}
    one = max(standing, key=lambda s: (s.member not in steady, beyond[s.member]))
    return None if one.member in steady else (
        one, f"is of another size in other settings (it scatters by {100 * beyond[one.member]:.0f} %)")


def _poor(search: Search, fit: Fit, standing: list[Standing]) -> tuple[Standing, str] | None:
    """The one that closes least, if it is not worth naming.

    Where no more than noise is left the likelihood tells an effect from a tolerance that nearly takes its place: the gap is that
    without it and all else as it is. One whose place is taken to within noise must open more than noise then.
    """
    poor = []
    exact = excess(search.problem, fit) == 0.0
    for one in standing:
        without, gap = one.gaps
        if exact:
            replaced = excess(search.problem, search.fits[one.without.hypothesis]) == 0.0
            without = search.problem.gap_as_fitted(absent(search.problem, fit, one.member))
            worth = worth_naming(without, gap) and not (replaced and without**2 - gap**2 < 1.0)
        else:
            worth = worth_naming(without, gap, one.share)
        if not worth:
            poor.append((without, one))
    return (min(poor, key=lambda found: found[0])[1], NOTHING) if poor else None


def _unforetold(search: Search, fit: Fit, standing: list[Standing]) -> tuple[Standing, str] | None:
    """Of those that do not bring runs closer that were not used for the fit (contract, section 5), the one without which these are
    foretold best."""
    if excess(search.problem, fit) == 0.0:
        return None
    gap = left_out_gap(search.problem, fit)
    # The nuisances that bring the fitted runs closest are no optimum, and a step from there may lead away from the run left out.
    without = {s.member: min(left_out_gap(search.problem, f) for f in {id(f): f for f in (s.without, search.fits[s.without.hypothesis])}.values())
               for s in standing}
    failed = [s for s in standing if not worth_naming(without[s.member], gap, s.share)]
    one = min(failed, key=lambda s: without[s.member], default=None)
    return None if one is None else (
        one, f"does not bring runs closer that it was not fitted to (their gap is {without[one.member]:.3g} without it, {gap:.3g} with it)")


def _contradicted(search: Search, fit: Fit, standing: list[Standing]) -> tuple[Standing, str] | None:
    """The one that opens the blocks which are driven by measured signals most, if any does beyond chance; else the one that is least its
    own there, if it is more of a cause without a name.

    A track that is wider than declared brings a replay's turns closer where a drag slows them; but then the measured wheels and
    the gyro, which agree, would have to disagree.
    """
    problem = search.problem
    found = absences(problem.looked_at, fit.model(problem), {s.member: absent(problem, fit, s.member) for s in standing})
    if not found.count:
        return None
    one = max(standing, key=lambda s: found.opened[s.member])
    if found.opened[one.member] > 2.0 * math.log(CONVINCING) * (1.0 + found.left / found.count):
        return one, "opens what measured signals close (it leaves more of the blocks that they drive than there is without it)"
    one = min(standing, key=lambda s: found.kept.get(s.member, 1.0))
    kept = found.kept.get(one.member, 1.0)
    return None if kept >= MOST or excess(problem, fit) == 0.0 else (
        one, f"stands in for {found.cause} (beside it {100 * max(kept, 0.0):.0f} % of what it does to the blocks is its own)")


def account(search: Search, fit: Fit) -> Account:
    """Name the effects of the most probable explanation that stand on their own evidence."""
    dropped: dict[tuple[str, str], str] = {}
    spare: list[tuple[str, str]] = []
    steady: set[tuple[str, str]] = set()
    rough, fewest = True, len(fit.hypothesis)
    while True:
        standing = _standing(search, fit, rough)
        fallen = _fallen(search, fit, standing, steady)
        if fallen is not None:
            one, dropped[one.member] = fallen
            spare += [one.member] if fallen[1] == NOTHING else []
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
    alike, rivals = _alike(search, fit, standing, spare)
    for better in _foretelling(search, fit, [f for f in rivals if not dropped.keys() & set(f.hypothesis)]):
        own = _standing(search, better, False)
        if _fallen(search, better, own, set(steady)) is None:
            fit, standing = better, own
            alike, rivals = _alike(search, fit, standing, spare)
            break
    standing.sort(key=lambda s: -s.gain)
    return Account(fit, search.refitted(), tuple(standing), dropped, alike, _alternatives(search, fit, standing, rivals),
                   {members[0]: _share(search, members) for members in alike})


def _foretelling(search: Search, fit: Fit, rivals: list[Fit]) -> list[Fit]:
    """Of the fits that these runs cannot tell from another, those that foretell runs left out better by more than a gap and a tenth of
    the rest, best first."""
    gaps = {f.hypothesis: left_out_gap(search.problem, f) for f in [fit, *rivals]} if rivals else {}
    better = [f for f in rivals if worth_adding(gaps[fit.hypothesis], gaps[f.hypothesis])]
    return sorted(better, key=lambda f: gaps[f.hypothesis])


def _share(search: Search, members: tuple[tuple[str, str], ...]) -> float:
    """Of a set of look-alikes, the first one's share by prior."""
    priors = [math.exp(search.log_prior((member,))) for member in members]
    return priors[0] / sum(priors)


def _alike(search: Search, fit: Fit, standing: list[Standing], spare: list[tuple[str, str]]) -> tuple[tuple[tuple[tuple[str, str], ...], ...], list[Fit]]:
    """Effects that take a blamed one's place and fit as well, and the fits that show it.

    What opens a gap does not, however few blocks of time there are to tell it by. spare : effects that were likely there beside it but
    closed next to nothing: those that do most of what it does may be a part of it.

    A set has room for few. Those that are alike in principle come first and need no fit to be in it; then what is nearly so, if it
    fits as well, and whatever else does; what is nearly so and was not met comes last.
    """
    sets, rivals = [], []
    there = {effect.id for effect in available(search.problem)} & search.wanted
    for one in standing:
        inherent, near = ([member for member in alike if member[0] in there and not clashes(member, fit.hypothesis)]
                          for alike in (twins(search.problem.case, one.member, fit.hypothesis),
                                        near_twins(search.problem.case, one.member)))
        swaps = _swaps(search, fit, one)
        known = {member for member in swaps if member in near or member[0] in search.effects[one.member[0]].confused_with}
        fitting = _fitting(search, fit, swaps, known)
        # What a look-alike is confused with may be one, too: the motor's constant for viscous friction, and a gain for that.
        further = {member for other in fitting for member in _confused(search, other)}
        swaps = {member: swaps.get(member) or search.swapped(fit, one.without, c) for c in search.rivals(one.without, one.member, len(search.effects))
                 if (member := c.member) in further - known and one.member[0] not in search.effects[member[0]].contains}
        fitting |= _fitting(search, fit, swaps, further)
        found = sorted((member not in known, gain, member) for member, (gain, _) in fitting.items())
        rivals += [swapped for _, swapped in fitting.values()]
        part = [member for member in spare if _likened(search, member, one.member)]
        part += [twin for member in part for twin in twins(search.problem.case, member, fit.hypothesis)]
        others = list(dict.fromkeys([*inherent, *part, *(member for *_, member in found), *near]))
        if others:
            sets.append((one.member, *others[:LARGEST_SET - 1]))
    return tuple(sets), rivals


def _likened(search: Search, member: tuple[str, str], other: tuple[str, str]) -> bool:
    """Whether an effect, or one that no run tells from it, is described as doing most of what another does."""
    return any(one[0] in search.effects[other[0]].likened for one in (member, *twins(search.problem.case, member)))


def _fitting(search: Search, fit: Fit, swaps: dict[tuple[str, str], Fit],
             known: Container[tuple[str, str]]) -> dict[tuple[str, str], tuple[float, Fit]]:
    """Of effects in another one's place those that fit as well, and open no gap: what the likelihood gains without each, and its fit.

    What is `known` to be confused with it must be told from it by more than slight a part of what it leaves: the forms of a machine
    that is described no better differ by as much.
    """
    found = {}
    for member, swapped in swaps.items():
        (gain, t), part = compared(search.problem, fit, swapped), _part(search, fit, swapped)
        told = told_apart(gain, t, part, search.problem.block_count, SLIGHT if member in known else 0.0)
        if not told and search.named(swapped) and not _opens(search.gap(swapped), search.gap(fit)):
            found[member] = gain, swapped
    return found


def _confused(search: Search, member: tuple[str, str]) -> set[tuple[str, str]]:
    """What an effect is confused with, on its side where that has sides."""
    effect, side = member
    only = "both" if len(search.problem.robot.sides) == 2 else "left"
    return {(other, (side if search.effects[effect].sided else only) if search.effects[other].sided else "both")
            for other in search.effects[effect].confused_with}


def _swaps(search: Search, fit: Fit, one: Standing) -> dict[tuple[str, str], Fit]:
    """What might be there in an effect's place, each with the fit that has it there: its namesakes, what a screening without it
    promises, and what the search met."""
    swaps = search.namesakes(fit, one.member)

    def other(member: tuple[str, str]) -> bool:
        # What holds the effect is the same with a further parameter, for no better fit.
        return member not in swaps and one.member[0] not in search.effects[member[0]].contains

    for candidate in search.rivals(one.without, one.member, LARGEST_SET):
        if other(candidate.member):
            swaps[candidate.member] = search.swapped(fit, one.without, candidate)
    beside = set(fit.hypothesis) - {one.member}
    for hypothesis, met in search.fits.items():
        if len(hypothesis) == len(fit.hypothesis) and beside <= set(hypothesis) and hypothesis != fit.hypothesis:
            member, = set(hypothesis) - beside
            if other(member):
                swaps[member] = met
    return swaps


def _part(search: Search, fit: Fit, other: Fit) -> float:
    """What one explanation takes off another's excess over white noise, a share of it."""
    return (search.score(other) - search.score(fit)) / max(excess(search.problem, other), 1.0)


def _opens(other: float, gap: float) -> bool:
    """Whether an explanation leaves a gap that is larger than another's by what is worth naming; noise alone is 1."""
    return other >= LEAST and worth_naming(other, max(gap, 1.0))


def _alternatives(search: Search, fit: Fit, standing: list[Standing], rivals: list[Fit]) -> tuple[tuple[Hypothesis, float], ...]:
    others = {f.hypothesis: f for f in [*rivals, *(s.without for s in standing), search.fits[()]] if f is not fit}
    weights = {fit.hypothesis: 1.0}
    for hypothesis, other in others.items():
        gain, t = compared(search.problem, fit, other)
        odds = search.log_prior(hypothesis) - search.log_prior(fit.hypothesis) - believed(gain, t)
        weights[hypothesis] = math.exp(min(odds, 0.0))
    total = sum(weights.values())
    ranked = sorted(weights.items(), key=lambda item: (-item[1], item[0] != fit.hypothesis))
    return tuple((hypothesis, weight / total) for hypothesis, weight in ranked)
