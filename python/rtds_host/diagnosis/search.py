"""The search for explanations: effects are added while the evidence asks for them, taken out again, exchanged, and looked
for anew from where the first ones are missing.

Explanations are sets of (effect, side). Their score is -2 log of evidence and prior (`fit`, `log_prior`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence

import numpy as np

from rtds_host.diagnosis import ripple
from rtds_host.diagnosis.carried import carried
from rtds_host.diagnosis.chance import MOST, SLIGHT
from rtds_host.diagnosis.effects import Effect
from rtds_host.diagnosis.effects.base import WRITTEN
from rtds_host.diagnosis.evidence import CONVINCING, believed, compared, excess, worth_adding
from rtds_host.diagnosis.fit import (
    ROUGH_GAIN,
    STEP_GAIN,
    Asking,
    Fit,
    Fitter,
    Hypothesis,
    apply,
    joined,
    scaled,
    side_by_side,
    split,
    to_values,
)
from rtds_host.diagnosis.gap import LEAST
from rtds_host.diagnosis.nuisances import BAND
from rtds_host.diagnosis.problem import CHI2, Problem
from rtds_host.diagnosis.screen import Candidate, Screen, Signature, available, clashes, moves_of, splits, start_values
from rtds_host.diagnosis.twins import twins

# Probability: effects that a robot has beyond its tolerances, on average; which ones and on which side is anybody's guess.
EXPECTED_EFFECTS = 2.0
SIDE_PRIOR = {"both": 0.5, "left": 0.25, "right": 0.25}
# Numerical: how many effects an explanation may have: more than a person could mend at once.
MOST_EFFECTS = 7


# Numerical: sides of an effect that promise this share of what its best one does are tried, too.
NEARLY = 0.8
# Numerical: how many effects in a row may be added that are not believed yet, and log odds from which an effect is hardly exchanged.
DOUBTFUL, SURE = 1, 12.0
# Numerical: effects of each screening whose signatures are taken again for the next.
RETAKEN = 8
# Numerical: effects of a screening whose pairs are looked at, and explanations of each number of effects whose gap is.
PAIRED, MET = 12, 8
# Numerical: rounds of exchanging effects and looking for more.
EXCHANGES = 3
# Numerical: work (`Problem.work`) after which a search goes no further, and one that is to be quick: a minute and a half, and half a minute.
MOST_WORK, QUICK_WORK = 1.2e9, 4e8
# Numerical: how far in score a rough fit may be from one in earnest, and how far behind it is certainly the worse one.
ROUGHLY, FAR = 20.0, 200.0
# Numerical: steps of a fit in earnest, and of a rough one.
ITERATIONS, ROUGH_ITERATIONS = 8, 4
# Numerical: sizes to look at about one whose misfit is rough (impacts, resonances, steps that come late), as factors.
COARSE = (0.35, 0.6, 0.88, 1.35, 1.6, 2.0, 3.0, 4.5, 6.5)
ROUGH_FACTORS = tuple(sorted({*np.geomspace(0.125, 8.0, 25), 0.88, 0.92, 0.96, 1.04, 1.08, 1.13}))


# An explanation, scaled parameters to fit it from, and the fit whose nuisances and discrepancy to begin with.
Start = tuple[Hypothesis, np.ndarray, Fit]


class Search:
    """One case's search over explanations; `fits` holds the best fit of each that was tried."""

    def __init__(self, problem: Problem, quick: bool = False, without: frozenset[str] = frozenset()):
        self.problem = problem
        self.effects = problem.effects
        self.fitter = Fitter(problem)
        self.quick = quick
        self.wanted = {e for e in problem.effects if e not in without}
        self.fits: dict[Hypothesis, Fit] = {}
        self._begun: dict[tuple, float] = {}     # explanations that were fitted, what each fit began from, and its score
        self.afresh = True                       # whether the next screening takes every signature anew
        self.slow_moves: dict[Signature, np.ndarray] = {}
        self.moves: dict[Signature, np.ndarray] = {}
        self._flat: Screen | None = None         # the last screening by no discrepancy
        self.looked: set[Hypothesis] = set()     # explanations on top of which slow effects were looked for
        self._refitted: Fit | None = None
        self._until = self._over = math.inf      # work at which the search ends, and at which the account looks for no more
        self.ended = False                       # whether one of them did before it was done
        self.trace: list[str] = []

    # ---- scores

    def log_prior(self, hypothesis: Hypothesis) -> float:
        """Log prior probability of a set: each effect is in or out by itself."""
        each = EXPECTED_EFFECTS / len(self.effects)
        return sum(math.log(each * (SIDE_PRIOR[side] if self.effects[e].sided else 1.0)) for e, side in hypothesis)

    def score(self, fit: Fit) -> float:
        """-2 log of evidence times prior."""
        return fit.score - 2.0 * self.log_prior(fit.hypothesis)

    def takes_off(self, fit: Fit, other: Fit) -> float:
        """What one explanation takes off another's excess over white noise, a share of it."""
        return (self.score(other) - self.score(fit)) / max(excess(self.problem, other), 1.0)

    def named(self, fit: Fit) -> bool:
        """Whether each effect is big enough to be named, and no larger than can be: a `ratio` within 3 % of 1 on R, K, J or B
        is a nuisance, and a size that rests on its bound stands in for something else."""
        return all(not (self.effects[e].nuisance and abs(values["ratio"] - 1.0) <= BAND)
                   and not self._at_its_bound(e, values) for (e, _), values in zip(fit.hypothesis, fit.values))

    def _at_its_bound(self, effect: str, values: dict[str, float]) -> bool:
        p = self.effects[effect].parameters[0]
        # As a logarithm comes back.
        return values[p.name] >= p.high * (1.0 - WRITTEN) or (p.logarithmic and values[p.name] <= p.low * (1.0 + WRITTEN))

    def best(self) -> Fit:
        """The most probable explanation so far."""
        return min((f for f in self.fits.values() if self.named(f)), key=self.score)

    # ---- fits

    def try_fit(self, hypothesis: Hypothesis, start: np.ndarray, beside: Fit, rough: bool = False) -> Fit:
        """Fit an explanation, starting from the nuisances and the discrepancy of another; the better of this and
        an earlier fit. `rough`: with the other's derivatives by the effects that both hold at the same size."""
        return self.try_fits([(hypothesis, start, beside)], rough)[0]

    def try_fits(self, starts: Iterable[Start], rough: bool = False) -> list[Fit]:
        """The same of several explanations and what each starts from, side by side."""
        starts = list(starts)
        self._reached(starts, rough)
        return [self.fits[hypothesis] for hypothesis, _, _ in starts]

    def _reached(self, starts: list[Start], rough: bool) -> list[float]:
        """The same, and the scores of these very fits."""
        keys = [(hypothesis, start.tobytes(), beside.hypothesis, beside.cost, rough) for hypothesis, start, beside in starts]
        new = {key: one for key, one in zip(keys, starts) if key not in self._begun or one[0] not in self.fits}
        for key, fit in zip(new, side_by_side(self.problem, [self._fitting(*one, rough) for one in new.values()])):
            best = self.fits.get(fit.hypothesis)
            if best is None or fit.cost < best.cost:
                self.fits[fit.hypothesis] = fit
            self._begun[key] = self.score(fit)
        return [self._begun[key] for key in keys]

    def _fitting(self, hypothesis: Hypothesis, start: np.ndarray, beside: Fit, rough: bool) -> Asking[Fit]:
        z = beside.z
        if len(z):
            # Nuisances that bent to stand in for an effect are a poor place to start from.
            starts = [z, np.zeros_like(z)]
            values = to_values(self.effects, hypothesis, start)
            models = [apply(self.effects, self.problem.with_nuisances(s), hypothesis, values) for s in starts]
            z = starts[int(np.argmin([float(r @ r) for r in (yield models, [m.coarse_s for m in models])]))]
        known = None
        if rough:
            parts = split(self.effects, hypothesis, start)
            known = {m: c for m, c in beside.columns.items() if m in parts and np.array_equal(parts[m], beside.parts[m])}
        return (yield from self.fitter.fitting(hypothesis, start, z, beside.noise, ROUGH_ITERATIONS if rough else ITERATIONS, known,
                                               by_nuisance=beside.by_nuisance, least=ROUGH_GAIN if rough else STEP_GAIN))

    def refitted(self) -> Fit:
        """The nominal robot with nuisances that bring its replay as close as their tolerance allows, whatever is missing: no
        discrepancy, so that what they could explain is not taken for one."""
        if self._refitted is None:
            flat = self.problem.discrepancy()
            self._refitted = self.fitter.fit((), np.empty(0), np.zeros(self.fitter.count), flat, fixed=True)
        return self._refitted

    def _screens(self, fit: Fit, moves: dict[Signature, np.ndarray], before: Sequence[Screen] = (None, None)) -> list[Screen]:
        """What effects promise on top of a fit, by the discrepancy it leaves and by none; `before`: the same of other moves.

        The first hardly feels what is slow, since it may be the discrepancy; the second hardly what is small.
        """
        first, flat = before
        self._flat = Screen(self.problem, fit, moves, self.problem.discrepancy(), flat or self._flat)
        return [Screen(self.problem, fit, moves, fit.noise, first), self._flat]

    def _screened(self, fit: Fit) -> list[Screen]:
        """Screenings of a fit. What promised little by the signatures of the screening before, and slow effects, keep these.

        What an effect promises hangs on the residuals much more than on the robot that it is added to. Before the search gives
        up all signatures are taken anew (`afresh`).
        """
        problem = self.problem
        extra = ripple.starts(problem, problem.replay(fit.model(problem))) if "torque_ripple" in self.wanted else {}
        before, kept = (None, None), {}
        if not self.afresh:
            before = self._screens(fit, self.moves)
            ranked = [dict.fromkeys(c.member[0] for c in screen.candidates()) for screen in before]
            retaken = {effect for effects in ranked for effect in list(effects)[:RETAKEN]} | {"torque_ripple"}
            kept = {s: m for s, m in self.moves.items() if s.effect not in retaken}
        moves = moves_of(self.fitter, fit, extra, self.wanted, {**kept, **self.slow_moves}, self.quick and not fit.hypothesis)
        if not self.slow_moves:
            self.slow_moves = {s: m for s, m in moves.items() if self.effects[s.effect].nonlinear}
        self.moves, self.afresh = moves, False
        return self._screens(fit, moves, before)

    def promising(self, screens: list[Screen], count: int) -> list[Candidate]:
        """The first effects of each screening, so many of each: the best side, and another that promises nearly as much."""
        picked: dict[tuple[str, str], Candidate] = {}
        for screen in screens:
            sides: dict[str, list[Candidate]] = {}
            for c in screen.candidates():
                if c.gain > 0.0 and not self._doubles(c.member, screen.taken):
                    sides.setdefault(c.member[0], []).append(c)
            for mine in list(sides.values())[:count]:
                for c in mine[:2]:
                    if c.gain >= NEARLY * mine[0].gain:
                        picked.setdefault(c.member, c)
        return list(picked.values())

    def _doubles(self, member: tuple[str, str], hypothesis: Hypothesis) -> bool:
        """Whether an explanation holds this effect already, be it of another size, or one that these runs could as well be blamed on."""
        if clashes(member, hypothesis) and not splits(member, hypothesis):
            return True
        return any(twin in hypothesis for twin in twins(self.problem.case, member))

    def grow(self, fit: Fit, count: int) -> Fit | None:
        """Add the effect that the evidence asks for most; None if there is none."""
        starts = [joined(_with(fit, one.member, self._entered(fit, one))) for one in self.promising(self._screened(fit), count)]
        found = self.try_fits([(*start, fit) for start in starts], rough=True)
        found = sorted((f for f in found if self.score(f) < self.score(fit)), key=self.score)
        # The first two are fitted in earnest: what is rough about a fit may be more than what parts them.
        best = None
        for rough in found[:2]:
            if best is None or self.score(rough) < self.score(best) + FAR:
                other = self.polished(self.try_fit(rough.hypothesis, rough.u, rough), set(rough.hypothesis) - set(fit.hypothesis))
                best = min([f for f in (best, other) if f is not None and self.named(f)], key=self.score, default=None)
        return best

    def _entered(self, fit: Fit, candidate: Candidate) -> np.ndarray:
        """Scaled parameters from which to fit a candidate: its own, or a size about them from which less is left to fit."""
        effect = self.effects[candidate.member[0]]
        if not (effect.rough or effect.steep):
            return candidate.start
        values, = to_values(self.effects, (candidate.member,), candidate.start)
        # What a delay does at one length says little of what it does at another: a signature may take it for a tenth of what it is.
        trials = [*_sizes(effect, values, COARSE), *(start_values(effect) if effect.steep else [])]
        starts = [candidate.start, *(scaled(self.effects, (candidate.member,), [trial]) for trial in trials)]
        models = [apply(self.effects, self.problem.with_nuisances(z), *self._named_values(fit, candidate.member, start))
                  for start in starts for z in (fit.z, np.zeros_like(fit.z))]
        # By a discrepancy of its own: beside one that makes up for a delay, a shorter one serves better than the right one.
        costs = [(fit.noise.estimated(r) if effect.steep else fit.noise).cost(r)
                 for r in self.problem.residuals(models, [m.coarse_s for m in models])]
        return starts[int(np.argmin(costs)) // 2]

    def _named_values(self, fit: Fit, member: tuple[str, str], start: np.ndarray) -> tuple[Hypothesis, list[dict[str, float]]]:
        hypothesis, u = joined({**fit.parts, member: start})
        return hypothesis, to_values(self.effects, hypothesis, u)

    def polished(self, fit: Fit, members: Iterable[tuple[str, str]]) -> Fit:
        """Look about an optimum of some effects whose misfit has many minima, and fit again from what is found there."""
        for member in members:
            for values in self.effects[member[0]].restarts if not self.closed(fit) else ():
                hypothesis, start = joined({**fit.parts, member: scaled(self.effects, (member,), [dict(values)])})
                if self._reached([(hypothesis, start, fit)], rough=True)[0] < self.score(fit) + FAR:
                    fit = self.try_fit(hypothesis, start, fit)
            for _ in range(3):
                moved = min(self.try_fits((fit.hypothesis, start, fit) for start in self._lower(fit, member)), key=self.score, default=fit)
                if self.score(moved) >= self.score(fit):
                    break
                fit = moved
        return fit

    def _lower(self, fit: Fit, member: tuple[str, str]) -> list[np.ndarray]:
        """Starts about an optimum from which its misfit may fall further: the best with the nuisances that were fitted beside
        it, and the best without any, since these bend to a size in the wrong valley."""
        problem = self.problem
        trials = [joined({**fit.parts, member: part})[1] for part in self._about(fit, member)]
        values = [to_values(self.effects, fit.hypothesis, u) for u in trials]
        found = {}
        for z in (fit.z, np.zeros_like(fit.z)) if trials else ():
            models = [apply(self.effects, problem.with_nuisances(z), fit.hypothesis, v) for v in [*values, fit.values]]
            costs = [fit.noise.cost(r) for r in problem.residuals(models, [m.coarse_s for m in models])]
            k = int(np.argmin(costs))
            if k < len(trials):
                found[k] = trials[k]
        return list(found.values())

    def _about(self, fit: Fit, member: tuple[str, str]) -> list[np.ndarray]:
        """Other parameters of an effect from which its misfit may fall further, scaled; none where it is smooth."""
        effect, values = self.effects[member[0]], fit.values[fit.hypothesis.index(member)]
        found = []
        if effect.rough:
            found = _sizes(effect, values, ROUGH_FACTORS)
        if effect.periodic:
            outs = self.problem.replay(fit.model(self.problem))
            found = ripple.neighbours(values, ripple.turned(outs, member[1]))
        return [scaled(self.effects, (member,), [trial]) for trial in found]

    def without(self, fit: Fit, *members: tuple[str, str]) -> list[Fit]:
        """The explanation less each of some effects, the others fitted again."""
        less = [joined({h: u for h, u in fit.parts.items() if h != member}) for member in members]
        met = {hypothesis: self.fits[hypothesis] for hypothesis, _ in less
               if hypothesis in self.fits and self.fits[hypothesis].cost < fit.cost}
        self.try_fits([(*start, fit) for start in less if start[0] not in met], rough=True)
        return [met.get(hypothesis) or self.fits[hypothesis] for hypothesis, _ in less]

    def prune(self, fit: Fit) -> Fit:
        """Take out effects that the evidence does not miss, and parameters; sides that came out alike become one effect."""
        while fit.hypothesis:
            simpler = self.without(fit, *fit.hypothesis) if len(fit.hypothesis) > 1 else []
            simpler += self._merged(fit) + self._plainer(fit) + self._gathered(fit)
            if not simpler:
                break
            best = min(simpler, key=self.score)
            if self.score(best) < self.score(fit) + ROUGHLY:
                best = self.try_fit(best.hypothesis, best.u, best)
            if self.score(best) >= self.score(fit):
                break
            self.trace.append(f"prune {set(fit.hypothesis) - set(best.hypothesis)}")
            fit = best
        return fit

    def _plainer(self, fit: Fit) -> list[Fit]:
        """The explanation with an effect in its simpler form: without the further parameters."""
        parts, starts = fit.parts, []
        for effect, side in fit.hypothesis:
            rest = {h: u for h, u in parts.items() if h != (effect, side)}
            for plain in self.effects[effect].contains:
                if not clashes((plain, side), tuple(rest)):
                    count = len(self.effects[plain].parameters)
                    starts.append(joined({**rest, (plain, side): parts[effect, side][:count]}))
        return self.try_fits([(*start, fit) for start in starts], rough=True)

    def _merged(self, fit: Fit) -> list[Fit]:
        parts, starts = fit.parts, []
        for effect, side in fit.hypothesis:
            if side == "left" and (effect, "right") in parts:
                rest = {h: u for h, u in parts.items() if h[0] != effect}
                rest[effect, "both"] = 0.5 * (parts[effect, "left"] + parts[effect, "right"])
                starts.append(joined(rest))
        return self.try_fits((*start, fit) for start in starts)

    def exchange(self, fit: Fit, count: int) -> Fit:
        """Exchange an effect for another side of it or for what the screening without it proposes, if the evidence asks
        for it."""
        starts, swaps, found = [], [], []
        for member, alone in zip(fit.hypothesis, self.without(fit, *fit.hypothesis)):
            starts += [*self._sides(fit, member), *self._parted(alone, member), *self._halved(fit, member)]
            found += self.namesakes(fit, member).values()
            sure = believed(*compared(self.problem, fit, alone)) > SURE
            swaps += [(*joined(_with(alone, one.member, one.start)), alone, member, one.member)
                      for one in self.promising(self._screens(alone, self.moves), 1 if sure else count) if one.member != member]
        swapped = self.try_fits([start[:3] for start in swaps], rough=True)
        found += [*self.try_fits(starts, rough=True), *swapped]
        found += self.try_fits(mixed for (_, _, alone, member, other), one in zip(swaps, swapped)
                               for mixed in self._mixed(fit, alone, one, member, other))
        tried = sorted([fit, *(f for f in found if self.score(f) < self.score(fit) + ROUGHLY)], key=self.score)[:3]
        found = self.try_fits((f.hypothesis, f.u, f) for f in tried if f is not fit)
        found = [f for f in found if len(f.hypothesis) <= len(fit.hypothesis) or self._believed(f, fit, self.gap(fit))]
        better = self._better(fit, found)
        if better is not fit:
            self.trace.append(f"exchange {set(fit.hypothesis) - set(better.hypothesis)} -> "
                              f"{set(better.hypothesis) - set(fit.hypothesis)}")
        return better

    def exchange_pairs(self, fit: Fit) -> Fit:
        """Exchange two effects at once for two others that promise nearly as much together, if the evidence asks for it: a gain
        of the driver and one of the current sensor do what a resistance and a torque constant do, and no exchange of one of them
        for one of these leads there."""
        starts = []
        pairs_out = list(itertools.combinations(fit.hypothesis, 2))
        rests = [joined({h: u for h, u in fit.parts.items() if h not in out}) for out in pairs_out]
        for (first, second), alone in zip(pairs_out, self.try_fits([(*rest, fit) for rest in rests], rough=True)):
            rest = alone.hypothesis
            for screen in self._screens(alone, self.moves):
                likely = [c.member for c in screen.candidates()[:PAIRED] if not self._doubles(c.member, rest)]
                pairs = screen.pairs([*likely, *(m for m in (first, second) if m not in likely)])
                own = next((gain for gain, a, b in pairs if {a.member, b.member} == {first, second}), math.inf)
                for gain, a, b in [pair for pair in pairs if first not in (pair[1].member, pair[2].member)
                                   and second not in (pair[1].member, pair[2].member)][:1]:
                    if gain >= NEARLY * own:
                        starts.append((*joined({**alone.parts, a.member: a.start, b.member: b.start}), alone))
        tried = sorted((f for f in self.try_fits(starts, rough=True) if self.score(f) < self.score(fit) + FAR), key=self.score)[:2]
        better = self._better(fit, [f for f in self.try_fits((f.hypothesis, f.u, f) for f in tried) if self.named(f)])
        if better is not fit:
            self.trace.append(f"exchange {set(fit.hypothesis) - set(better.hypothesis)} -> "
                              f"{set(better.hypothesis) - set(fit.hypothesis)}")
        return better

    def _better(self, fit: Fit, others: list[Fit]) -> Fit:
        """The most probable of an explanation and others; one that leaves no gap gives way to convincing odds alone."""
        best = min(others, key=self.score, default=fit)
        return best if self.score(best) < self.score(fit) - (2.0 * math.log(CONVINCING) if self.closed(fit) else 0.0) else fit

    def rivals(self, without: Fit, member: tuple[str, str], count: int) -> list[Candidate]:
        """What else would take the place of an effect that was taken out, most promising first."""
        return [c for c in self.promising(self._screens(without, self.moves), count)
                if c.member != member and not clashes(c.member, without.hypothesis)]

    def swapped(self, fit: Fit, without: Fit, candidate: Candidate) -> Fit:
        """The fit with such a rival in the effect's place; a rough one where that is far behind already."""
        hypothesis, start = joined({**without.parts, candidate.member: candidate.start})
        rough = self.try_fit(hypothesis, start, without, rough=True)
        if believed(*compared(self.problem, fit, rough)) > SURE and self.score(rough) > self.score(fit) + FAR:
            return rough
        return self.try_fit(hypothesis, rough.u, rough)

    def _mixed(self, fit: Fit, alone: Fit, swapped: Fit, member: tuple[str, str], other: tuple[str, str]) -> list[Start]:
        """Where to start with both of two effects, each at half its size, where one does nearly what the other does: two delays, two gains.

        No small step leads there from either alone where the misfit is kinked, as it is at a delay of whole samples.
        """
        if swapped.cost - fit.cost > (1.0 - NEARLY) * (alone.cost - fit.cost):
            return []
        if clashes(other, fit.hypothesis) or self._doubles(other, fit.hypothesis):
            return []
        parts = {**swapped.parts, member: 0.5 * fit.parts[member], other: 0.5 * swapped.parts[other]}
        return [(*joined(parts), swapped)]

    def _halved(self, fit: Fit, member: tuple[str, str]) -> list[Start]:
        """A lag that may be two of half its length: what no screening on top of their sum promises, and no small step leads to."""
        others = {other: fit.parts[member] for other in self._alike(fit, member)}
        others |= {other: start for other, start in self._likened(fit, member).items()
                   if other not in fit.hypothesis and (self.effects[member[0]].steep or self.effects[other[0]].steep)}
        return [(*joined({**fit.parts, member: 0.5 * fit.parts[member], other: 0.5 * start}), fit) for other, start in others.items()]

    def _alike(self, fit: Fit, member: tuple[str, str]) -> list[tuple[str, str]]:
        """Effects with the same parameters as a steep one of an explanation, on its side, that this could as well hold in its place."""
        effect, rest = self.effects[member[0]], tuple(h for h in fit.hypothesis if h != member)
        names = [p.name for p in effect.parameters]
        others = [other for other in effect.confused_with if other in self.wanted and self.effects[other].steep
                  and [p.name for p in self.effects[other].parameters] == names] if effect.steep else []
        return [(other, member[1]) for other in others
                if not clashes((other, member[1]), rest) and not self._doubles((other, member[1]), rest)]

    def _likened(self, fit: Fit, member: tuple[str, str]) -> dict[tuple[str, str], np.ndarray]:
        """Effects that do most of what one of an explanation does, on its side where they have sides, and with which scaled parameters;
        together with its own where they are in already."""
        at = dict(zip(fit.hypothesis, fit.values))
        rest = tuple(h for h in fit.hypothesis if h != member)
        there = {effect.id for effect in available(self.problem)} & self.wanted
        found = {}
        for other, like in self.effects[member[0]].likened.items():
            one = self.in_place(other, member)
            parameters = like(at[member], beside=at.get(one)) if other in there else None
            if parameters is not None and (one in at or not (clashes(one, rest) or self._doubles(one, rest))):
                inside = {p.name: min(max(parameters.get(p.name, p.starts[0]), p.low), p.high) for p in self.effects[other].parameters}
                found[one] = scaled(self.effects, (one,), [inside])
        return found

    def in_place(self, other: str, member: tuple[str, str]) -> tuple[str, str]:
        """Another effect in one's place: on its side where both have sides, on all that there are where only the other has."""
        if not self.effects[other].sided:
            return other, "both"
        every = "both" if len(self.problem.robot.sides) == 2 else "left"
        return other, member[1] if self.effects[member[0]].sided else every

    def _gathered(self, fit: Fit) -> list[Fit]:
        """The explanation with what two effects of much the same do as one of them: springs in a row."""
        parts = fit.parts
        return self.try_fits([(*joined({**{h: u for h, u in parts.items() if h != member}, other: start}), fit)
                              for member in fit.hypothesis for other, start in self._likened(fit, member).items() if other in parts])

    def _sides(self, fit: Fit, member: tuple[str, str]) -> list[Start]:
        """The same explanation with one of its effects on other sides."""
        parts = fit.parts
        rest = {h: u for h, u in parts.items() if h != member}
        return [(*joined({**rest, (member[0], side): parts[member]}), fit)
                for side in self.effects[member[0]].sides
                if side != member[1] and not clashes((member[0], side), tuple(rest))
                and len(self.problem.robot.sides) == 2]

    def _parted(self, alone: Fit, member: tuple[str, str]) -> list[Start]:
        """What is left without an effect of one side, with another one that is on both of a size of its own on each: the two
        sides of a machine differ in one thing more often than in two."""
        if member[1] == "both":
            return []
        rest = alone.parts
        return [(*joined(_with(alone, (effect, member[1]), rest[effect, side])), alone)
                for effect, side in alone.hypothesis if side == "both" and self.effects[effect].sided and self.effects[effect].sized]

    def renamed(self, fit: Fit) -> Fit:
        """The explanation, or the better one that blames one of its effects' namesakes at the same size."""
        found = [f for member in fit.hypothesis for f in self.namesakes(fit, member).values()]
        better = min([fit, *(f for f in found if self.named(f))], key=self.score)
        if better is not fit:
            self.trace.append(f"rename {set(fit.hypothesis) - set(better.hypothesis)} -> {set(better.hypothesis) - set(fit.hypothesis)}")
        return better

    def namesakes(self, fit: Fit, member: tuple[str, str]) -> dict[tuple[str, str], Fit]:
        """The same size as another effect with the same parameters, or that of one that does most of the same, by that, where no
        slope leads from one to the other: of two delays one gives way to the other only if it is as long from the start."""
        rest = {h: u for h, u in fit.parts.items() if h != member}
        found = {}
        starts = {other: fit.parts[member] for other in self._alike(fit, member)}
        starts |= {other: start for other, start in self._likened(fit, member).items() if other not in rest}
        for other, start in starts.items():
            named = self.try_fit(*joined({**rest, other: start}), fit)
            # What stands beside a delay may have bent to it; but not by so much.
            found[other] = named if self.score(named) > self.score(fit) + FAR else self.polished(named, rest)
        return found

    def run(self) -> Fit:
        """Search; the most probable explanation."""
        problem = self.problem
        problem.follow_angles(True)
        problem.align(problem.nominal)
        found = self._search()
        suggested, lates = dict(problem.headings), dict(problem.lates)
        if suggested and not self.closed(found):
            # Headings that the nominal robot suggests are bent by what it lacks: once more from the declared ones.
            first, self.fits = self.fits, {}
            problem.begin({}, {})
            other = self._search()
            if self.score(found) < self.score(other):
                self.fits, other = first, found
                problem.begin(suggested, lates)
            found = other
        found = self._as_declared(found)
        problem.follow_angles(False)
        return self._open_loop(found)

    def _as_declared(self, fit: Fit) -> Fit:
        """The same with runs that began as declared, where the explanation does not ask for anything else."""
        problem, headings = self.problem, dict(self.problem.headings)
        if headings:
            problem.begin({}, problem.lates)
            declared = self.fitter.fit(fit.hypothesis, fit.u, fit.z, fit.noise)
            if declared.cost < fit.cost + CHI2:
                self.fits = {f.hypothesis: self.fitter.fit(f.hypothesis, f.u, f.z, f.noise) for f in (self.fits[()], declared)}
                return self.fits[fit.hypothesis]
            problem.begin(headings, problem.lates)
        return fit

    def _search(self) -> Fit:
        problem = self.problem
        noise = problem.discrepancy().estimated(problem.residual(problem.nominal), thorough=True)
        self.slow_moves, self.afresh, self.looked = {}, True, {()}
        most = QUICK_WORK if self.quick else MOST_WORK
        self._until, self._over = problem.work + most, problem.work + 2.0 * most
        fit = self.fits[()] = self.fitter.fit((), np.empty(0), np.zeros(self.fitter.count), noise, 4)
        for _ in range(EXCHANGES):
            fit = self._climb(fit)
            fit = self.polished(fit, fit.hypothesis)
            better = self.exchange(fit, 1 if self._spent() else 2 if self.quick else 4)
            better = self.exchange_pairs(fit) if better is fit and not self._spent() else better
            done, fit = better is fit, better
            if done or self._spent():
                break
        # Where no gap is left the likelihood is good enough to decide, blemishes and all; the account leaves these out.
        fit = fit if self.named(fit) else self.best()
        return self.renamed(self._better(fit, [self.best()]) if self.closed(fit) else self._plain(fit))

    def _spent(self) -> bool:
        """Whether the search has done the work that it may do: it then ends with what it has found, which is noted (`ended`)."""
        return self._done(self._until)

    def exhausted(self) -> bool:
        """Whether the account has done as much again: no look-alike is then looked for that was not met, which is noted likewise."""
        return self._done(self._over)

    def _done(self, work: float) -> bool:
        if self.problem.work >= work and not self.ended:
            self.trace.append("ends before it is done")
            self.ended = True
        return self.problem.work >= work

    def _plain(self, fit: Fit) -> Fit:
        """The explanation, or one of fewer effects that was met and leaves less than half of its rest, with what can be added to it.

        Beside a large discrepancy the likelihood looks at what is fast: several effects that whiten it can be more likely than the
        one that closes the gap.
        """
        met = [f for count in range(1, len(fit.hypothesis))
               for f in sorted((f for f in self.fits.values() if len(f.hypothesis) == count and self.named(f)), key=self.score)[:MET]]
        closest = min(met, key=self.gap, default=fit)
        if self.gap(closest) ** 2 - 1.0 > MOST * (self.gap(fit) ** 2 - 1.0):
            return fit
        self.trace.append(f"begin anew from {set(closest.hypothesis)}")
        grown = self._climb(closest)
        return grown if set(closest.hypothesis) <= set(grown.hypothesis) and self.gap(grown) < self.gap(closest) else closest

    def _open_loop(self, fit: Fit) -> Fit:
        """The explanation fitted with a ripple at the replay's own angle, as the gap is judged."""
        if not any(self.effects[e].periodic for e, _ in fit.hypothesis):
            return fit
        for hypothesis in [h for h in self.fits if any(self.effects[e].periodic for e, _ in h)]:
            del self.fits[hypothesis]
        return self.polished(self.try_fit(fit.hypothesis, fit.u, fit), fit.hypothesis)

    def closed(self, fit: Fit) -> bool:
        """Whether an explanation leaves no gap to speak of."""
        return self.gap(fit) < LEAST

    def _believed(self, grown: Fit, fit: Fit, closest: float) -> bool:
        """Whether an explanation is more likely than a part of it, as far as its gain can be believed, takes off no small part of
        what that leaves beyond noise, or of the gap, and carries over to other runs.

        closest : the smallest gap before. Of the two measures of what is left either may say little before others are in.
        """
        prior = self.log_prior(grown.hypothesis) - self.log_prior(fit.hypothesis)
        if prior + believed(*compared(self.problem, grown, fit)) < 0.0:
            return False
        if (self.score(fit) - self.score(grown) < SLIGHT * excess(self.problem, fit)
                and not worth_adding(closest, self.gap(grown))):
            return False
        over = carried(self.problem, grown)
        return all(over[member] >= MOST for member in set(grown.hypothesis) - set(fit.hypothesis))

    def _next(self, stands: Fit, closest: float) -> Fit | None:
        """The most probable explanation met with one effect more that is believed; None if there is none. What promises most may
        be a stand-in that no run but one asks for."""
        met = [f for f in self.fits.values() if len(f.hypothesis) == len(stands.hypothesis) + 1 and self.named(f)
               and set(stands.hypothesis) < set(f.hypothesis) and self.score(f) < self.score(stands)]
        for fit in sorted(met, key=self.score):
            if self._believed(fit, stands, closest):
                return self.try_fit(fit.hypothesis, fit.u, fit)
        return None

    def gap(self, fit: Fit) -> float:
        return self.problem.gap(fit.model(self.problem))

    def _climb(self, fit: Fit) -> Fit:
        """Add effects while they are believed. One may only be believed once another is in; but one after another that is not
        leads nowhere, and none of them stays."""
        stands, doubtful, closest = fit, 0, self.gap(fit)
        looked_at = 5 if self.quick else 10
        while len(fit.hypothesis) < MOST_EFFECTS and not self._spent():
            grown = self.grow(fit, looked_at)
            if grown is None or (doubtful == DOUBTFUL and not self._believed(grown, stands, closest)):
                other = self._next(stands, closest) if not self.closed(stands) else None
                if other is not None:
                    stands = fit = self.polished(other, set(other.hypothesis) - set(stands.hypothesis))
                    self.trace.append(f"add {set(stands.hypothesis)}, which is believed")
                    doubtful, closest = 0, min(closest, self.gap(fit))
                    continue
                if stands.hypothesis in self.looked or self.closed(stands):
                    break
                # What a delay or a wrong constant hid from the first screening: a swinging gear, a slipping tyre.
                fit = stands
                self.looked.add(fit.hypothesis)
                self.slow_moves, self.afresh, doubtful = {}, True, 0
                continue
            self.trace.append(f"add {set(grown.hypothesis) - set(fit.hypothesis)} {self.score(fit):.0f} -> {self.score(grown):.0f}")
            fit = self.prune(grown)
            model = fit.model(self.problem)
            if max(self.problem.align(model), self.problem.align_commands(model)) > 0.0:
                # Runs began elsewhere or later than was thought: what was fitted to other beginnings is of no use.
                self.fitter.by_nuisance = None
                kept = {f.hypothesis: f for f in (self.fits[()], stands, fit)}
                self.fits = {h: self.fitter.fit(h, f.u, f.z, f.noise, ITERATIONS) for h, f in kept.items()}
                stands, fit = self.fits[stands.hypothesis], self.fits[fit.hypothesis]
                # Where runs began wrongly, what made up for that promised most.
                other = self.grow(stands, looked_at) if fit is not stands else None
                fit = min((f for f in (fit, other) if f is not None), key=self.score)
            if self._believed(fit, stands, closest):
                stands, doubtful, closest = fit, 0, min(closest, self.gap(fit))
            else:
                doubtful += 1
        return stands


def _with(fit: Fit, member: tuple[str, str], u: np.ndarray) -> dict[tuple[str, str], np.ndarray]:
    """The parts of an explanation and one effect more; a side of an effect that is in on both parts it into two."""
    kept = fit.parts
    if splits(member, fit.hypothesis):
        kept[member[0], "right" if member[1] == "left" else "left"] = kept.pop((member[0], "both"))
    return {**kept, member: u}


def _sizes(effect: Effect, values: dict[str, float], factors: Iterable[float]) -> list[dict[str, float]]:
    """Parameters with the effect's size multiplied by each factor, within its bounds."""
    p = effect.parameters[0]
    return [{**values, p.name: min(max(factor * values[p.name], p.low), p.high)} for factor in factors]
