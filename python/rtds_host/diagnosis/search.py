"""The search for explanations: none, one effect, several; ranked by their evidence (`evidence`)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rtds_host.diagnosis import ripple
from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.evidence import Choice, Scored, dispersion, named, score, structure
from rtds_host.diagnosis.fit import Fit, Fitter, Hypothesis, apply, scaled, to_values
from rtds_host.diagnosis.problem import HEADING_GAIN, Problem
from rtds_host.diagnosis.screen import Candidate, Screen

# Gain of chi2 (over dispersion) that a screening must promise for a fit.
WORTH = 6.0
# What further parameters of a form must gain in chi2 before it is another explanation than the form without them.
IDLE_GAIN = 8.0
# Nor is it where they are this small a part of their spreads, and explain this little of the whole excess.
IDLE_SIZE, IDLE_SHARE = 0.06, 0.01
# Effects whose misfit has many minima (impacts, resonances), and where to look about one.
ROUGH = ("backlash", "gear_compliance")
# And those whose replays take many small steps. When in a hurry, no two of them are tried together.
SLOW = (*ROUGH, "longitudinal_slip")
ROUGH_FACTORS = (0.6, 0.75, 0.83, 0.88, 0.92, 0.96, 1.04, 1.08, 1.13, 1.2, 1.35, 1.6)
# Looked about again from what was found while what is left of the misfit falls to less than this share.
SCAN_ROUNDS, SCAN_AGAIN = 3, 0.98
# When in a hurry, not where the fit explains less than this share of what the best one does.
SCAN_SHARE = 0.3
# Share of the misfit from which slow effects are looked for on top of others as well (a sixth of the gap), or what is left
# in units of noise, squared.
MUCH_LEFT, OPEN = 0.03, 2.0
# Such an effect is fitted if it promises this share of what the first one does, and on top of an effect that explains so much
# itself where a rough effect is part of the best explanation anyway.
ROUGH_RIVAL, LEADS = 0.5, 0.02
# How much flanks of gears rebound, and at what other sizes to try it.
RESTITUTIONS, REBOUND_FACTORS = (0.15, 0.3, 0.45), (0.8, 0.9, 0.95, 1.0)


class Search:
    """One case's search over explanations."""

    def __init__(self, problem: Problem, quick: bool = False, without: frozenset[str] = frozenset()):
        self.problem = problem
        self.fitter = Fitter(problem)
        self.quick = quick
        self.without = without
        self.fits: dict[Hypothesis, Fit] = {}
        self.growth: dict[Hypothesis, dict[str, float]] = {}
        self.moves: dict[tuple, np.ndarray] = {}  # of the first screening
        self.scale = 1.0
        self.z0 = np.zeros(self.fitter.count)

    def _screen(self, fit: Fit, only: Iterable[str] = ()) -> Screen:
        """Signatures about a fit; `only`: of these effects alone."""
        model = fit.model(self.problem)
        wanted = {e for e in (only or CATALOGUE) if e not in self.without}
        if not only and (self._white(fit) or (self.quick and fit.hypothesis)):
            # Effects that take many small steps to replay are looked for where structure is left, and when in a hurry
            # only once; pairs with them come from the first screening, or from `_under`.
            wanted -= set(SLOW)
        # On top of such an effect every replay takes many small steps, and what another effect changes there is nearly what
        # it changes without.
        moves = self.moves if self.quick and model.slow else {}
        extra = {} if only or "torque_ripple" in self.without else ripple.starts(self.problem, self.problem.replay(model))
        if not fit.hypothesis:
            moves = self.moves = {}
        # A nuisance on its bound makes no more room: what it would imitate if it could is an effect's to explain.
        keep = np.flatnonzero(fit.free)
        return Screen(self.fitter, model, fit.residual, fit.jacobian[:, keep], fit.prior_precision()[keep],
                      np.concatenate([fit.z, fit.u])[keep], fit.dispersion, moves, fit.hypothesis, extra, wanted)

    def _white(self, fit: Fit) -> bool:
        """Whether a fit leaves hardly more than noise."""
        return structure(self.problem, fit.residual) < 1.3 and fit.chi2 < 1.1 * self.problem.size

    def try_fit(self, hypothesis: Hypothesis, start: np.ndarray, z: np.ndarray, iterations: int = 8,
                scan: bool = False) -> Fit:
        """Fit and remember the better of this and an earlier fit of the same explanation; `scan`: look about it anyway."""
        if hypothesis and len(z):
            # Nuisances that bent to stand in for the effect are a poor place to start from.
            starts = [z, np.zeros_like(z)]
            models = [apply(self.problem.with_nuisances(s), hypothesis, to_values(hypothesis, start)) for s in starts]
            costs = [float(r @ r) / self.scale + float(s @ s)
                     for r, s in zip(self.problem.residuals(models), starts)]
            z = starts[int(np.argmin(costs))]
        fit = self.fitter.fit(hypothesis, start, z, self.scale, iterations)
        if scan or not self.quick or (len(hypothesis) == 1 and self._promises(fit)):
            # When in a hurry, a pair starts from what was found about its members alone.
            fit = self._scan(self._restarted(fit, iterations), iterations)
        known = self.fits.get(hypothesis)
        if known is None or fit.chi2 / self.scale + fit.prior < known.chi2 / self.scale + known.prior:
            self.fits[hypothesis] = fit
        return self.fits[hypothesis]

    def _promises(self, fit: Fit) -> bool:
        """Whether a fit explains no far smaller part than the best one known."""
        if () not in self.fits:
            return True
        base = self.fits[()].chi2
        best = min(f.chi2 for f in self.fits.values())
        return base - fit.chi2 > SCAN_SHARE * (base - best)

    def _restarted(self, fit: Fit, iterations: int) -> Fit:
        """The best of a single effect's fit and of those from its other starts, each from unbent nuisances."""
        if len(fit.hypothesis) != 1 or self._white(fit):
            return fit
        others = [self.fitter.fit(fit.hypothesis, scaled(fit.hypothesis, [dict(values)]), self.z0, self.scale, iterations)
                  for values in CATALOGUE[fit.hypothesis[0][0]].restarts]
        return min([fit, *others], key=self.cost)

    def _scan(self, fit: Fit, iterations: int) -> Fit:
        """Look about an optimum of an effect whose misfit is rough, and fit again from what is found there."""
        at = 0
        for k, (effect, _) in enumerate(fit.hypothesis):
            count = len(CATALOGUE[effect].parameters)
            for _ in range(SCAN_ROUNDS):
                trials = [np.concatenate([fit.u[:at], part, fit.u[at + count:]]) for part in self._about(fit, k)]
                if not trials:
                    break
                costs = [float(r @ r) / self.scale for r in self.problem.residuals(
                    [apply(self.problem.with_nuisances(fit.z), fit.hypothesis, to_values(fit.hypothesis, u))
                     for u in trials])]
                best = int(np.argmin(costs))
                if costs[best] >= fit.chi2 / self.scale:
                    break
                before = fit.chi2
                fit = self.fitter.fit(fit.hypothesis, trials[best], fit.z, self.scale, iterations)
                if fit.chi2 - self.problem.size > SCAN_AGAIN * (before - self.problem.size):
                    break
            at += count
        return fit

    def _about(self, fit: Fit, k: int) -> list[np.ndarray]:
        """Other parameters of an effect from which its misfit may fall further, scaled; none where it is smooth."""
        member, values = fit.hypothesis[k:k + 1], fit.values[k]
        (effect, side), = member
        p = CATALOGUE[effect].parameters[0]
        if effect in ROUGH:
            sizes = [min(max(p.null + factor * (values[p.name] - p.null), p.low), p.high) for factor in ROUGH_FACTORS]
            found = [{**values, p.name: size} for size in sizes]
            if "restitution" in values:
                # Flanks that rebound take longer to settle, as more free play does: both are tried at once.
                found += [{**values, p.name: min(max(factor * values[p.name], p.low), p.high), "restitution": e}
                          for e in RESTITUTIONS for factor in REBOUND_FACTORS]
            return [scaled(member, [trial]) for trial in found]
        if effect == "torque_ripple":
            outs = self.problem.replay(fit.model(self.problem))
            return [scaled(member, [moved]) for moved in ripple.neighbours(values, ripple.turned(outs, side))]
        return []

    def cost(self, fit: Fit) -> float:
        return fit.chi2 / self.scale + fit.prior

    def grow(self, fit: Fit, count: int, only: Iterable[str] = ()) -> list[Fit]:
        """Add one effect (one of `only`) to an explanation: screen what it leaves, fit the most promising."""
        screen = self._screen(fit, only)
        result = []
        tried = 0
        # Only a screening of all effects says what none of the others would take.
        promised = self.growth.setdefault(fit.hypothesis, {}) if not only else {}
        for candidate in screen.candidates():
            (effect, side), = candidate.hypothesis
            promised.setdefault(effect, candidate.gain)
            if candidate.gain < 8.0 or tried >= count or (effect in SLOW and self._slow(fit)):
                continue
            if only and candidate.gain < ROUGH_RIVAL * max(promised.values()):
                continue
            mine = [s for e, s in fit.hypothesis if e == effect]
            if mine and ("both" in mine or side == "both" or side in mine):
                continue
            tried += 1
            hypothesis = tuple(sorted(fit.hypothesis + candidate.hypothesis))
            starts = dict(zip(fit.hypothesis, _split(fit.hypothesis, fit.u)))
            starts[candidate.hypothesis[0]] = candidate.start
            start = np.concatenate([starts[h] for h in hypothesis])
            result.append(self.try_fit(hypothesis, start, fit.z, scan=bool(only)))
        return result

    def best(self, count: int | None = None) -> list[Fit]:
        """Fits (of so many effects) by score, best first."""
        total = len(CATALOGUE)
        fits = [f for f in self.fits.values() if (count is None or len(f.hypothesis) == count) and named(f)]
        return sorted(fits, key=lambda f: score(f, total, self.scale))

    def run(self) -> Choice:
        """Search: nothing, singles, pairs, a third on the best pair; then judge all by one dispersion."""
        problem = self.problem
        problem.align(problem.nominal)
        if problem.headings:
            self._from_either()
        else:
            self._singles()
        screen = self.screen
        top = min(self.fits.values(), key=self.cost)
        # Judge by what the best explanation leaves, not by what none would.
        for _ in range(2):
            new = min(self.scale, dispersion(problem, top.residual, top.jacobian))
            if new > 0.8 * self.scale:
                break
            self.scale = new
            self._refresh(5 if self.quick else 8)
            top = min(self.fits.values(), key=self.cost)
        if any(c.gain > WORTH for c in screen.candidates()):
            self._pairs(screen)
            self._under()
            pairs = self.best(2)
            if pairs:
                self._rescale()
                best = self.best()[0]
                if len(best.hypothesis) == 2:
                    self._swap(best)
                    best = self.best()[0]
                    self.grow(best, 2 if self.quick else 4)
                    self._rescale()
        self._prune()
        return self._judge()

    def _from_either(self) -> None:
        """Search for singles from the headings that the contract declares, and from those that the nominal robot suggests:
        a wrong robot suggests wrong ones, which hold its explanation where they are. The better is gone on from."""
        suggested, found = dict(self.problem.headings), []
        for headings in ({}, suggested):
            self.problem.begin(headings)
            self._singles()
            found.append((dict(self.problem.headings), self.fits, self.scale, self.screen, self.moves,
                          self.fitter.nuisance_jacobian))
        scale = min(kept[2] for kept in found)
        headings, self.fits, self.scale, self.screen, self.moves, self.fitter.nuisance_jacobian = min(
            found, key=lambda kept: HEADING_GAIN * len(kept[0]) + min(f.chi2 / scale + f.prior for f in kept[1].values()))
        self.problem.begin(headings)

    def _singles(self) -> None:
        """Nothing and single effects, from the headings as they are, which are estimated again with the best of them."""
        problem, fitter = self.problem, self.fitter
        self.fits, fitter.nuisance_jacobian = {}, None
        nominal = problem.residual(problem.nominal)
        self.scale = dispersion(problem, nominal, np.empty((len(nominal), 0)))
        base = self.try_fit((), np.empty(0), self.z0)
        # Nuisances move little: their derivatives about the refit serve every later fit.
        fitter.nuisance_jacobian = None
        base = self.fits[()] = fitter.fit((), np.empty(0), base.z, self.scale, 3)
        self.screen = screen = self._screen(base)
        singles = [c for c in screen.candidates() if c.gain > WORTH]
        for candidate in self._spread(singles, 7 if self.quick else 12):
            self.try_fit(candidate.hypothesis, candidate.start, base.z)
        self._siblings(screen, 3)
        top = min(self.fits.values(), key=self.cost)
        if problem.align(top.model(problem)) > 0.0:
            self._refresh(len(self.fits))

    def _prune(self) -> None:
        """Take each effect of the leaders away again, starting from what they found: a simpler explanation may have
        been stuck on the way. Sides that came out alike become one effect of both."""
        done: set[Hypothesis] = set()
        while True:
            best = self.best()[0]
            if len(best.hypothesis) < 2 or best.hypothesis in done:
                return
            done.add(best.hypothesis)
            starts = dict(zip(best.hypothesis, _split(best.hypothesis, best.u)))
            simpler = [tuple(h for h in best.hypothesis if h != out) for out in best.hypothesis]
            for effect, side in best.hypothesis:
                if side == "left" and (effect, "right") in starts:
                    starts[effect, "both"] = 0.5 * (starts[effect, "left"] + starts[effect, "right"])
                    rest = [h for h in best.hypothesis if h[0] != effect]
                    simpler.append(tuple(sorted([*rest, (effect, "both")])))
            for hypothesis in simpler:
                if hypothesis:
                    self.try_fit(hypothesis, np.concatenate([starts[h] for h in hypothesis]), best.z, 12)

    def _rescale(self) -> None:
        top = min(self.fits.values(), key=self.cost)
        new = dispersion(self.problem, top.residual, top.jacobian)
        if new < 0.8 * self.scale:
            self.scale = new
            self._refresh(4 if self.quick else 7)

    def _spread(self, candidates: list[Candidate], width: int) -> list[Candidate]:
        """The first of the list, but no more than the sides of an effect that are close to its best one."""
        best: dict[str, float] = {}
        picked = []
        for c in candidates:
            effect = c.hypothesis[0][0]
            best.setdefault(effect, c.gain)
            if c.gain >= 0.6 * best[effect]:
                picked.append(c)
        return picked[:width]

    def _siblings(self, screen: Screen, count: int) -> None:
        """Other sides of the leaders and the known look-alikes of the first, so that none wins for want of a rival."""
        starts = {c.hypothesis: c for c in screen.candidates()}
        leaders = sorted((f for f in self.fits.values() if len(f.hypothesis) == 1), key=self.cost)[:count]
        for leader in leaders[:1]:
            (effect, side), = leader.hypothesis
            for rival in CATALOGUE[effect].confused_with:
                hypothesis = ((rival, side if CATALOGUE[rival].sided else "both"),)
                if hypothesis in starts and hypothesis not in self.fits:
                    self.try_fit(hypothesis, starts[hypothesis].start, self.fits[()].z)
        if self.quick:
            leaders = leaders[:1] + [f for f in leaders[1:] if not self._slow(f)]
        for leader in leaders:
            (effect, side), = leader.hypothesis
            for other in CATALOGUE[effect].sides:
                hypothesis = ((effect, other),)
                if hypothesis in starts and hypothesis not in self.fits:
                    self.try_fit(hypothesis, leader.u, self.fits[()].z)

    def _pairs(self, screen: Screen) -> None:
        leaders = self.best(1)[:2 if self.quick else 3]
        white = bool(leaders) and self._white(leaders[0])
        if white:
            # A leader that leaves noise has no rival that needs a second effect to catch up with it.
            leaders = [f for f in leaders if self.cost(f) < self.cost(leaders[0]) + 100.0]
        leaders = leaders[:1] + [f for f in leaders[1:] if not self._slow(f)]
        for leader in leaders:
            self.grow(leader, 2 if self.quick else 4)
        for candidate in screen.pairs(6 if not self.quick else 0 if white else 3):
            if self.quick and all(effect in SLOW for effect, _ in candidate.hypothesis):
                continue
            if candidate.hypothesis not in self.fits:
                self.try_fit(candidate.hypothesis, candidate.start, self.fits[()].z)

    def _under(self) -> None:
        """When in a hurry, look for slow effects on top of the best others where what was found leaves much: a delay or a
        wrong constant under a swinging gear or a slipping tyre hides it from the first screening."""
        best = min(self.fits.values(), key=self.cost)
        left = (best.chi2 - self.problem.size) / max(self.fits[()].chi2 - self.problem.size, 1e-9)
        if not self.quick or self._white(best) or (left < MUCH_LEFT and best.chi2 < OPEN * self.problem.size):
            return
        others = [f for f in self.best(1) if not self._slow(f)][:2]
        found = {effect for effect, _ in best.hypothesis if effect in ROUGH}
        if found:
            # What was found by itself needs no more than a second way to its pairs.
            least = LEADS * (self.fits[()].chi2 - self.problem.size)
            others = [f for f in others[:1] if self.fits[()].chi2 - f.chi2 > least]
        for leader in others:
            self.grow(leader, 2, found or SLOW)

    def _slow(self, fit: Fit) -> bool:
        """Whether a fit is no place to look for more from in a hurry: each of its replays takes many small steps."""
        return self.quick and fit.model(self.problem).slow

    def _swap(self, best: Fit) -> None:
        """Exchange each member of a pair for what the screening of the other member alone proposes, where the other was never
        fitted alone."""
        for kept in best.hypothesis:
            alone = self.fits.get((kept,))
            if alone is None:
                part = dict(zip(best.hypothesis, _split(best.hypothesis, best.u)))[kept]
                alone = self.try_fit((kept,), part, best.z)
                self.grow(alone, 2 if self.quick else 3)

    def _refresh(self, count: int) -> None:
        """Refit the leaders at the present dispersion, with fresh derivatives of the nuisances."""
        leaders = [f for f in sorted(self.fits.values(), key=lambda f: f.chi2)[:count]
                   if not self._slow(f) or self._promises(f)]
        self.fitter.nuisance_jacobian = None
        for fit in leaders:
            self.fits[fit.hypothesis] = self.fitter.fit(fit.hypothesis, fit.u, fit.z, self.scale, 6)
        base = self.fits[()]
        if base.dispersion != self.scale:
            self.fits[()] = self.fitter.fit((), np.empty(0), base.z, self.scale, 4)

    def _idle(self, fit: Fit) -> bool:
        """Whether an effect's further parameters rest, so that the explanation is a simpler one said twice."""
        for k, (effect, side) in enumerate(fit.hypothesis):
            for simpler in CATALOGUE[effect].contains:
                other = self.fits.get(tuple(sorted(fit.hypothesis[:k] + fit.hypothesis[k + 1:] + ((simpler, side),))))
                if other is None:
                    continue
                own = _split(fit.hypothesis, fit.u)[k]
                shared = len([p for p in CATALOGUE[simpler].parameters if not p.shape])
                further = [u for u, p in zip(own, CATALOGUE[effect].parameters) if not p.shape][shared:]
                faint = bool(further) and max(abs(u) for u in further) < IDLE_SIZE
                if self.cost(other) < self.cost(fit) + IDLE_GAIN or (
                        faint and other.chi2 - fit.chi2 < IDLE_SHARE * (self.fits[()].chi2 - self.problem.size)):
                    return True
        return False

    def _judge(self) -> Choice:
        total = len(CATALOGUE)
        ranked = []
        for fit in self.fits.values():
            if fit.hypothesis and (not named(fit) or self._idle(fit)):
                continue
            ranked.append(Scored(fit, score(fit, total, self.scale)))
        ranked.sort(key=lambda s: s.score)
        weights = np.exp(-0.5 * (np.array([s.score for s in ranked]) - ranked[0].score))
        for s, weight in zip(ranked, weights / weights.sum()):
            s.probability = float(weight)
        return Choice(self.fits[()], ranked, self.scale, self.fits, self.screen, self.growth)


def _split(hypothesis: Hypothesis, u: np.ndarray) -> list[np.ndarray]:
    parts, k = [], 0
    for effect, _ in hypothesis:
        n = len(CATALOGUE[effect].parameters)
        parts.append(u[k:k + n])
        k += n
    return parts
