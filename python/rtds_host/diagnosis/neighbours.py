"""What lies next to an explanation: one effect more, one less, one or two in the place of others, and the same on other
sides or under another name."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from rtds_host.diagnosis import ripple
from rtds_host.diagnosis.evidence import CONVINCING, believed, compared
from rtds_host.diagnosis.explanations import FAR, Explanations, Start, sizes
from rtds_host.diagnosis.fit import Fit, Hypothesis, apply, joined, scaled, to_values
from rtds_host.diagnosis.indistinguishable import indistinguishable
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.screen import (
    Candidate,
    Screen,
    Signature,
    available,
    clashes,
    sensitivities_of,
    splits,
    start_values,
)

# Numerical: sides of an effect that promise this share of what its best one does are tried, too.
NEARLY = 0.8
# Numerical: log odds from which an effect is hardly exchanged.
SURE = 12.0
# Numerical: effects of each screening whose signatures are taken again for the next.
RETAKEN = 8
# Numerical: effects of a screening whose pairs are looked at.
PAIRED = 12
# Numerical: pairs of a screening that are tried in the place of two effects that close the gap.
PAIRS = 3
# Numerical: how far in score a rough fit may be from one in earnest.
ROUGHLY = 20.0
# Numerical: sizes to look at before a fit of one whose misfit is rough, as factors.
COARSE = (0.35, 0.6, 0.88, 1.35, 1.6, 2.0, 3.0, 4.5, 6.5)


class Neighbours(Explanations):
    """Explanations of one case and the steps that lead from one to another; `trace` says which were taken."""

    def __init__(self, problem: Problem, quick: bool = False, without: frozenset[str] = frozenset()):
        super().__init__(problem)
        self.quick = quick
        self.wanted = {e for e in problem.effects if e not in without}
        self.afresh = True  # whether the next screening takes every signature again
        self.slow_sensitivities: dict[Signature, np.ndarray] = {}
        self.sensitivities: dict[Signature, np.ndarray] = {}
        self._flat: Screen | None = None  # the last screening by no discrepancy
        self.trace: list[str] = []

    # ---- screenings

    def _screens(
        self, fit: Fit, sensitivities: dict[Signature, np.ndarray], before: Sequence[Screen | None] = (None, None)
    ) -> list[Screen]:
        """What effects promise on top of a fit, by the discrepancy it leaves and by none; `before`: the same of other
        moves.

        The first hardly feels what is slow, since it may be the discrepancy; the second hardly what is small.
        """
        first, flat = before
        self._flat = Screen(self.problem, fit, sensitivities, self.problem.white(), flat or self._flat)
        return [Screen(self.problem, fit, sensitivities, fit.noise, first), self._flat]

    def screened(self, fit: Fit) -> list[Screen]:
        """Screenings of a fit. What promised little by the signatures of the screening before, and slow effects, keep
        these.

        What an effect promises hangs on the residuals much more than on the robot that it is added to. Before the
        search gives up all signatures are taken again (`afresh`).
        """
        problem = self.problem
        periodic = [effect.id for effect in self.effects.values() if effect.periodic]
        sought = [effect for effect in periodic if effect in self.wanted]
        extra = ripple.starts(problem, problem.replay(fit.model(problem)), sought) if sought else {}
        before: Sequence[Screen | None] = (None, None)
        kept: dict[Signature, np.ndarray] = {}
        if not self.afresh:
            before = screens = self._screens(fit, self.sensitivities)
            ranked = [dict.fromkeys(c.cause[0] for c in screen.candidates()) for screen in screens]
            retaken = {effect for effects in ranked for effect in list(effects)[:RETAKEN]} | set(periodic)
            kept = {s: m for s, m in self.sensitivities.items() if s.effect not in retaken}
        sensitivities = sensitivities_of(
            self.fitter, fit, extra, self.wanted, {**kept, **self.slow_sensitivities}, self.quick and not fit.hypothesis
        )
        if not self.slow_sensitivities:
            self.slow_sensitivities = {s: m for s, m in sensitivities.items() if self.effects[s.effect].nonlinear}
        self.sensitivities, self.afresh = sensitivities, False
        return self._screens(fit, sensitivities, before)

    def promising(self, screens: list[Screen], count: int) -> list[Candidate]:
        """The first effects of each screening, so many of each: the best side, and another that promises nearly as
        much.
        """
        picked: dict[tuple[str, str], Candidate] = {}
        for screen in screens:
            sides: dict[str, list[Candidate]] = {}
            for c in screen.candidates():
                if c.gain > 0.0 and not self._doubles(c.cause, screen.taken):
                    sides.setdefault(c.cause[0], []).append(c)
            for mine in list(sides.values())[:count]:
                for c in mine[:2]:
                    if c.gain >= NEARLY * mine[0].gain:
                        picked.setdefault(c.cause, c)
        return list(picked.values())

    def _doubles(self, cause: tuple[str, str], hypothesis: Hypothesis) -> bool:
        """Whether an explanation holds this effect already, be it of another size, or one that these runs could as well
        be blamed on.
        """
        if clashes(cause, hypothesis) and not splits(cause, hypothesis):
            return True
        return any(equal in hypothesis for equal in indistinguishable(self.problem.case, cause))

    # ---- one more

    def extend(self, fit: Fit, count: int) -> Fit | None:
        """Add the effect that the evidence asks for most; None if there is none."""
        starts = [
            joined(_with(fit, one.cause, self.entered(fit, one))) for one in self.promising(self.screened(fit), count)
        ]
        found = self.try_fits([(*start, fit) for start in starts], rough=True)
        found = sorted((f for f in found if self.score(f) < self.score(fit)), key=self.score)
        # The first two are fitted in earnest: what is rough about a fit may be more than what parts them.
        best = None
        for rough in found[:2]:
            if best is None or self.score(rough) < self.score(best) + FAR:
                other = self.polished(
                    self.try_fit(rough.hypothesis, rough.u, rough), set(rough.hypothesis) - set(fit.hypothesis)
                )
                best = min([f for f in (best, other) if f is not None and self.named(f)], key=self.score, default=None)
        return best

    def with_one_of(self, fit: Fit, wanted: set[str]) -> list[Fit]:
        """The explanation with one of some effects more, each on the sides that promise most."""
        sensitivities = sensitivities_of(self.fitter, fit, {}, wanted, {})
        found: dict[tuple[str, str], Candidate] = {}
        for noise in (fit.noise, self.problem.white()):
            for one in Screen(self.problem, fit, sensitivities, noise).candidates():
                if not clashes(one.cause, fit.hypothesis):
                    found.setdefault(one.cause, one)
        return self.try_fits((*joined({**fit.parts, one.cause: self.entered(fit, one)}), fit) for one in found.values())

    def entered(self, fit: Fit, candidate: Candidate) -> np.ndarray:
        """Scaled parameters from which to fit a candidate: its own, or a size about them from which less is left to
        fit.
        """
        effect = self.effects[candidate.cause[0]]
        if not (effect.rough or effect.steep):
            return candidate.start
        (values,) = to_values(self.effects, (candidate.cause,), candidate.start)
        # What a delay does at one length says little of what it does at another: a signature may take it for a tenth of
        # what it is.
        trials = [*sizes(effect, values, COARSE), *(start_values(effect) if effect.steep else [])]
        starts = [candidate.start, *(scaled(self.effects, (candidate.cause,), [trial]) for trial in trials)]
        models = [
            apply(
                self.effects,
                self.problem.with_nuisances(z, fit.start),
                *self._named_values(fit, candidate.cause, start),
            )
            for start in starts
            for z in (fit.z, np.zeros_like(fit.z))
        ]
        costs = [fit.noise.estimated(r).cost(r) for r in self.problem.residuals(models, [m.coarse_s for m in models])]
        return starts[int(np.argmin(costs)) // 2]

    # ---- one less

    def without(self, fit: Fit, *causes: tuple[str, str]) -> list[Fit]:
        """The explanation less each of some effects, the others fitted again."""
        less = [joined({h: u for h, u in fit.parts.items() if h != cause}) for cause in causes]
        met = {
            hypothesis: self.fits[hypothesis]
            for hypothesis, _ in less
            if hypothesis in self.fits and self.fits[hypothesis].cost < fit.cost
        }
        self.try_fits([(*start, fit) for start in less if start[0] not in met], rough=True)
        return [met.get(hypothesis) or self.fits[hypothesis] for hypothesis, _ in less]

    def prune(self, fit: Fit) -> Fit:
        """Take out effects that the evidence does not miss, and parameters; sides that came out alike become one
        effect.
        """
        while fit.hypothesis:
            simpler = self.without(fit, *fit.hypothesis) if len(fit.hypothesis) > 1 else []
            simpler += self._merged(fit) + self.plainer(fit) + self._gathered(fit)
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

    def plainer(self, fit: Fit) -> list[Fit]:
        """The explanation with an effect in its simpler form: without the further parameters."""
        parts, starts = fit.parts, []
        for effect, side in fit.hypothesis:
            remaining = {h: u for h, u in parts.items() if h != (effect, side)}
            for plain in self.effects[effect].contains:
                if not clashes((plain, side), tuple(remaining)):
                    count = len(self.effects[plain].parameters)
                    starts.append(joined({**remaining, (plain, side): parts[effect, side][:count]}))
        return self.try_fits([(*start, fit) for start in starts], rough=True)

    def _merged(self, fit: Fit) -> list[Fit]:
        parts, starts = fit.parts, []
        for effect, side in fit.hypothesis:
            if side == "left" and (effect, "right") in parts:
                remaining = {h: u for h, u in parts.items() if h[0] != effect}
                remaining[effect, "both"] = 0.5 * (parts[effect, "left"] + parts[effect, "right"])
                starts.append(joined(remaining))
        return self.try_fits((*start, fit) for start in starts)

    def _gathered(self, fit: Fit) -> list[Fit]:
        """The explanation with what two effects of much the same do as one of them: springs in a row."""
        parts = fit.parts
        return self.try_fits(
            [
                (*joined({**{h: u for h, u in parts.items() if h != cause}, other: start}), fit)
                for cause in fit.hypothesis
                for other, start in self.likened(fit, cause).items()
                if other in parts
            ]
        )

    # ---- others in their place

    def exchange(self, fit: Fit, count: int) -> Fit:
        """Exchange an effect for another side of it or for what the screening without it proposes, if the evidence asks
        for it."""
        starts, swaps = [], []
        found: list[Fit] = []
        for cause, alone in zip(fit.hypothesis, self.without(fit, *fit.hypothesis)):
            starts += [*self._sides(fit, cause), *self.parted_sides(alone, cause), *self.halved(fit, cause)]
            found += self.namesakes(fit, cause).values()
            sure = believed(*compared(self.problem, fit, alone)) > SURE
            swaps += [
                (*joined(_with(alone, one.cause, one.start)), alone, cause, one.cause)
                for one in self.promising(self._screens(alone, self.sensitivities), 1 if sure else count)
                if one.cause != cause
            ]
        swapped = self.try_fits([start[:3] for start in swaps], rough=True)
        found += [*self.try_fits(starts, rough=True), *swapped]
        found += self.try_fits(
            mixed
            for (_, _, alone, cause, other), one in zip(swaps, swapped)
            for mixed in self._mixed(fit, alone, one, cause, other)
        )
        tried = sorted([fit, *(f for f in found if self.score(f) < self.score(fit) + ROUGHLY)], key=self.score)[:3]
        found = self.try_fits((f.hypothesis, f.u, f) for f in tried if f is not fit)
        found = [f for f in found if len(f.hypothesis) <= len(fit.hypothesis) or self._believed(f, fit, self.gap(fit))]
        better = self._better(fit, found)
        if better is not fit:
            self.trace.append(
                f"exchange {set(fit.hypothesis) - set(better.hypothesis)} -> "
                f"{set(better.hypothesis) - set(fit.hypothesis)}"
            )
        return better

    def exchange_pairs(self, fit: Fit) -> Fit:
        """Exchange two effects at once for two others that promise nearly as much together, if the evidence asks for
        it: a gain of the driver and one of the current sensor do what a resistance and a torque constant do, and no
        exchange of one of them for one of these leads there."""
        starts = []
        pairs_out = list(itertools.combinations(fit.hypothesis, 2))
        rests = [joined({h: u for h, u in fit.parts.items() if h not in out}) for out in pairs_out]
        for (first, second), alone in zip(
            pairs_out, self.try_fits([(*remaining, fit) for remaining in rests], rough=True)
        ):
            remaining = alone.hypothesis
            for screen in self._screens(alone, self.sensitivities):
                likely = [c.cause for c in screen.candidates()[:PAIRED] if not self._doubles(c.cause, remaining)]
                pairs = screen.pairs([*likely, *(m for m in (first, second) if m not in likely)])
                own = next((gain for gain, a, b in pairs if {a.cause, b.cause} == {first, second}), math.inf)
                for gain, a, b in [
                    pair
                    for pair in pairs
                    if first not in (pair[1].cause, pair[2].cause) and second not in (pair[1].cause, pair[2].cause)
                ][: PAIRS if self.closed(fit) else 1]:
                    if gain >= NEARLY * own:
                        starts.append((*joined({**alone.parts, a.cause: a.start, b.cause: b.start}), alone))
        tried = sorted(
            (f for f in self.try_fits(starts, rough=True) if self.score(f) < self.score(fit) + FAR), key=self.score
        )[:2]
        better = self._better(fit, [f for f in self.try_fits((f.hypothesis, f.u, f) for f in tried) if self.named(f)])
        if better is not fit:
            self.trace.append(
                f"exchange {set(fit.hypothesis) - set(better.hypothesis)} -> "
                f"{set(better.hypothesis) - set(fit.hypothesis)}"
            )
        return better

    def _better(self, fit: Fit, others: list[Fit]) -> Fit:
        """The most probable of an explanation and others; one that leaves no gap gives way to convincing odds alone."""
        best = min(others, key=self.score, default=fit)
        return (
            best
            if self.score(best) < self.score(fit) - (2.0 * math.log(CONVINCING) if self.closed(fit) else 0.0)
            else fit
        )

    def rivals(self, without: Fit, cause: tuple[str, str], count: int) -> list[Candidate]:
        """What else would take the place of an effect that was taken out, most promising first."""
        return [
            c
            for c in self.promising(self._screens(without, self.sensitivities), count)
            if c.cause != cause and not clashes(c.cause, without.hypothesis)
        ]

    def swapped(self, fit: Fit, without: Fit, candidate: Candidate) -> Fit:
        """The fit with such a rival in the effect's place; a rough one where that is far behind already."""
        hypothesis, start = joined({**without.parts, candidate.cause: candidate.start})
        rough = self.try_fit(hypothesis, start, without, rough=True)
        if believed(*compared(self.problem, fit, rough)) > SURE and self.score(rough) > self.score(fit) + FAR:
            return rough
        return self.try_fit(hypothesis, rough.u, rough)

    def _mixed(self, fit: Fit, alone: Fit, swapped: Fit, cause: tuple[str, str], other: tuple[str, str]) -> list[Start]:
        """Where to start with both of two effects, each at half its size, where one does nearly what the other does:
        two delays, two gains.

        No small step leads there from either alone where the misfit is kinked, as it is at a delay of whole samples.
        """
        if swapped.cost - fit.cost > (1.0 - NEARLY) * (alone.cost - fit.cost):
            return []
        if clashes(other, fit.hypothesis) or self._doubles(other, fit.hypothesis):
            return []
        parts = {**swapped.parts, cause: 0.5 * fit.parts[cause], other: 0.5 * swapped.parts[other]}
        return [(*joined(parts), swapped)]

    def halved(self, fit: Fit, cause: tuple[str, str]) -> list[Start]:
        """A lag that may be two of half its length: what no screening on top of their sum promises, and no small step
        leads to.
        """
        others = {other: fit.parts[cause] for other in self._alike(fit, cause)}
        others |= {
            other: start
            for other, start in self.likened(fit, cause).items()
            if other not in fit.hypothesis and (self.effects[cause[0]].steep or self.effects[other[0]].steep)
        }
        return [
            (*joined({**fit.parts, cause: 0.5 * fit.parts[cause], other: 0.5 * start}), fit)
            for other, start in others.items()
        ]

    def _alike(self, fit: Fit, cause: tuple[str, str]) -> list[tuple[str, str]]:
        """Effects with the same parameters as a steep one of an explanation, on its side, that this could as well hold
        in its place.
        """
        effect, remaining = self.effects[cause[0]], tuple(h for h in fit.hypothesis if h != cause)
        names = [p.name for p in effect.parameters]
        others = (
            [
                other
                for other in effect.confused_with
                if other in self.wanted
                and self.effects[other].steep
                and [p.name for p in self.effects[other].parameters] == names
            ]
            if effect.steep
            else []
        )
        return [
            (other, cause[1])
            for other in others
            if not clashes((other, cause[1]), remaining) and not self._doubles((other, cause[1]), remaining)
        ]

    def likened(self, fit: Fit, cause: tuple[str, str]) -> dict[tuple[str, str], np.ndarray]:
        """Effects that do most of what one of an explanation does, on its side where they have sides, and with which
        scaled parameters; together with its own where they are in already."""
        at = dict(zip(fit.hypothesis, fit.values))
        remaining = tuple(h for h in fit.hypothesis if h != cause)
        there = {effect.id for effect in available(self.problem)} & self.wanted
        found = {}
        for other, like in self.effects[cause[0]].likened.items():
            one = self.in_place(other, cause)
            parameters = like(at[cause], existing=at.get(one)) if other in there else None
            if parameters is not None and (one in at or not (clashes(one, remaining) or self._doubles(one, remaining))):
                inside = {
                    p.name: min(max(parameters.get(p.name, p.starts[0]), p.low), p.high)
                    for p in self.effects[other].parameters
                }
                found[one] = scaled(self.effects, (one,), [inside])
        return found

    def in_place(self, other: str, cause: tuple[str, str]) -> tuple[str, str]:
        """Another effect in one's place: on its side where both have sides, on all that there are where only the other
        has.
        """
        if not self.effects[other].sided:
            return other, "both"
        every = "both" if len(self.problem.robot.sides) == 2 else "left"
        return other, cause[1] if self.effects[cause[0]].sided else every

    def _sides(self, fit: Fit, cause: tuple[str, str]) -> list[Start]:
        """The same explanation with one of its effects on other sides."""
        parts = fit.parts
        remaining = {h: u for h, u in parts.items() if h != cause}
        return [
            (*joined({**remaining, (cause[0], side): parts[cause]}), fit)
            for side in self.effects[cause[0]].sides
            if side != cause[1]
            and not clashes((cause[0], side), tuple(remaining))
            and len(self.problem.robot.sides) == 2
        ]

    def parted_sides(self, alone: Fit, cause: tuple[str, str]) -> list[Start]:
        """What is left without an effect of one side, with another one that is on both of a size of its own on each:
        the two sides of a machine differ in one thing more often than in two."""
        if cause[1] == "both":
            return []
        remaining = alone.parts
        return [
            (*joined(_with(alone, (effect, cause[1]), remaining[effect, side])), alone)
            for effect, side in alone.hypothesis
            if side == "both" and self.effects[effect].sided and self.effects[effect].sized
        ]

    def renamed(self, fit: Fit) -> Fit:
        """The explanation, or the better one that blames one of its effects' namesakes at the same size."""
        found = [f for cause in fit.hypothesis for f in self.namesakes(fit, cause).values()]
        better = min([fit, *(f for f in found if self.named(f))], key=self.score)
        if better is not fit:
            self.trace.append(
                f"rename {set(fit.hypothesis) - set(better.hypothesis)} ->"
                f" {set(better.hypothesis) - set(fit.hypothesis)}"
            )
        return better

    def namesakes(self, fit: Fit, cause: tuple[str, str]) -> dict[tuple[str, str], Fit]:
        """The same size as another effect with the same parameters, or that of one that does most of the same, by that,
        where no slope leads from one to the other: of two delays one gives way to the other only if it is as long from
        the start."""
        remaining = {h: u for h, u in fit.parts.items() if h != cause}
        found = {}
        starts = {other: fit.parts[cause] for other in self._alike(fit, cause)}
        starts |= {other: start for other, start in self.likened(fit, cause).items() if other not in remaining}
        for other, start in starts.items():
            named = self.try_fit(*joined({**remaining, other: start}), fit)
            # What is included with a delay may have bent to it; but not by so much.
            found[other] = named if self.score(named) > self.score(fit) + FAR else self.polished(named, remaining)
        return found


def _with(fit: Fit, cause: tuple[str, str], u: np.ndarray) -> dict[tuple[str, str], np.ndarray]:
    """The parts of an explanation and one effect more; a side of an effect that is in on both parts it into two."""
    kept = fit.parts
    if splits(cause, fit.hypothesis):
        kept[cause[0], "right" if cause[1] == "left" else "left"] = kept.pop((cause[0], "both"))
    return {**kept, cause: u}
