"""From ranked explanations to a verdict: what earns its place, what cannot be told apart, none, known or unknown."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np

from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.evidence import Choice, Scored, folds, held_out, log_prior, named, structure
from rtds_host.diagnosis.fit import Fit, Hypothesis
from rtds_host.diagnosis.gap import errors, gap, pooled
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import replay_run

# An added effect must explain at least this share of what the explanation without it leaves above the noise:
# a wrong form leaves a structured rest, of which a further wrong effect always takes some.
EARN_SHARE = 0.4
# Unless nothing else would take nearly as much: a wrong form's rest suits many effects, a right effect's only itself.
SINGULAR, SINGULAR_GAIN = 3.0, 60.0
# An effect smaller than so many of its spreads that explains less than so much of the whole excess (or of the least that
# counts as a gap) is a blemish of model or sensors, not a cause.
BLEMISHES = ((0.06, 0.01), (0.25, 0.005))
# But what takes nearly all of a rest that is a gap by itself is a cause, small as it may be beside a large one.
TAKES_ALL = 0.9
# Of its spreads, from where on an effect is of fair size.
FAIR_SIZE = 0.25
# Sides of one effect whose sizes differ by less are the effect on both sides.
SAME_SIZE = 0.12
# Held-out gain over its block standard error, and the gain itself in units of chi2.
HELD_OUT_T = 2.0
HELD_OUT_GAIN = 9.0
# Explanations whose fits differ by less (in chi2 over dispersion) cannot be told apart: about 2.5 sigma.
ALIKE = 6.0
# Squared sums over 1 s blocks above this many times white noise's are structure.
STRUCTURED = 1.5
# As a rule (contract, section 5) less than this closed, with a structured rest, is not an explanation.
CLOSED_ENOUGH = 0.7
# A true cause brings a fair share of the blocks down to their noise. What leaves a rest everywhere may be a stand-in
# for an effect that the catalogue lacks, and must close more.
CLEAN_SHARE, CLEAN = 0.3, 1.5
CLOSED_ENOUGH_EVERYWHERE = 0.87
# No replay follows the impacts of an erratic effect for long, however right it is.
CLOSED_ENOUGH_ERRATIC = 0.5
# And less where all others together have no part in it: where no explanation without such an effect gains this share of
# what it gains.
CLOSED_ALONE, OTHERS_SHARE = 0.35, 0.2
# Nor may a channel be left open, or opened, where the others are closed: that is what a stand-in does. What is left of its
# gap is measured against its own, or against this where there was hardly one. Half of it is enough: nature's form (of slip
# above all) closes one channel worse than another.
CHANNEL_CLOSED, SMALL_GAP = 0.5, 4.0
# Tolerances do not reach so many of their sigmas: what needs nominal parameters there bends them to what it cannot do
# itself, and must close each channel nearly altogether.
BENT, CLOSED_ENOUGH_BENT = 3.0, 0.9
# Without a named effect a structured rest below a gap of 1.1 counts as none: so small a gap has no closure either (contract,
# section 4).
NO_GAP = 1.1**2 - 1.0


@dataclass
class Decision:
    """What was decided and why.

    fit : the chosen explanation's fit (possibly without effect); verdict : "none", "known" or "unknown";
    ranked : explanations that stand, best first, with probabilities; unknown : probability of none of the catalogue;
    alike : sets of (effect, side) that cannot be told apart, each holding a blamed one; reasons : explanation -> why
    it was rejected; gains : explanation -> (held-out gain per sample, t).
    """

    fit: Fit
    base: Fit
    verdict: str
    ranked: list[Scored]
    unknown: float
    alike: list[list[tuple[str, str]]]
    structured: bool
    closed: float
    reasons: dict[Hypothesis, str] = field(default_factory=dict)
    gains: dict[Hypothesis, tuple[float, float]] = field(default_factory=dict)


def _cost(fit: Fit, scale: float) -> float:
    return fit.chi2 / scale + fit.prior


def _closed(problem: Problem, base: Fit, fit: Fit) -> float:
    """Share of the gap of the refitted nominal model that an explanation closes, 0 to 1."""
    if problem.robot.axis is not None:
        return _gap_closed(problem, base, fit)  # fitted on pieces, judged on whole runs
    before, after = (np.sqrt(max(f.chi2 / problem.size, 1.0)) for f in (base, fit))
    return float(np.clip((before - after) / max(before - 1.0, 1e-9), 0.0, 1.0))


def _gaps(problem: Problem, fit: Fit) -> dict[str, float]:
    """The contract's gap by channel, of whole runs."""
    return pooled([errors(data.log, problem.robot, replay_run(fit.model(problem), data.inputs)) for data in problem.whole])


def _gap_closed(problem: Problem, base: Fit, fit: Fit) -> float:
    """The same of the contract's gap, in which a channel of few samples weighs as much as one of many."""
    before, after = (max(gap(_gaps(problem, f)), 1.0) for f in (base, fit))
    return float(np.clip((before - after) / max(before - 1.0, 1e-9), 0.0, 1.0))


def _bent(fit: Fit) -> bool:
    """Whether a nominal parameter stands where tolerances do not reach."""
    return bool(np.abs(fit.z).max(initial=0.0) > BENT)


def _erratic(fit: Fit) -> bool:
    return any(CATALOGUE[effect].erratic for effect, _ in fit.hypothesis)


def _explains(problem: Problem, choice: Choice, fit: Fit, closed: float) -> bool:
    """Whether an explanation with a structured rest closes enough: of the misfit, and of no channel at another's cost."""
    enough = _enough(problem, choice, fit)
    if closed < enough:
        return False
    if _erratic(fit):
        return _gap_closed(problem, choice.base, fit) >= enough
    bent = _bent(fit)
    least, each = (CLOSED_ENOUGH_BENT,) * 2 if bent else (CLOSED_ENOUGH, CHANNEL_CLOSED)
    return _every_channel(problem, choice.base, fit, each, not bent) and _gap_closed(problem, choice.base, fit) >= least


def _every_channel(problem: Problem, base: Fit, fit: Fit, least: float, lenient: bool) -> bool:
    """Whether an explanation closes at least this share of every channel's gap; `lenient`: a small one may stay."""
    if problem.robot.axis is not None:
        before, after = (np.array(list(_gaps(problem, f).values())) for f in (base, fit))
    else:
        counts = np.maximum(np.bincount(problem.channels_of), 1)
        before, after = (np.sqrt(np.bincount(problem.channels_of, f.residual**2) / counts) for f in (base, fit))
    before, after = before - 1.0, after - 1.0
    # A channel that hardly had a gap may keep it, for a further effect to close; it may not be opened.
    small = np.maximum((1.0 - least) * SMALL_GAP, before if lenient else 0.0)
    return bool((after <= np.where(before < SMALL_GAP, small, (1.0 - least) * before)).all())


def _enough(problem: Problem, choice: Choice, fit: Fit) -> float:
    """Share of the gap that an explanation with a structured rest has to close."""
    if _erratic(fit):
        others = min(f.chi2 for f in choice.fits.values() if not _erratic(f))
        alone = choice.base.chi2 - others < OTHERS_SHARE * (choice.base.chi2 - fit.chi2)
        return CLOSED_ALONE if alone else CLOSED_ENOUGH_ERRATIC
    counts = np.bincount(problem.blocks, minlength=problem.block_count)
    sums = np.bincount(problem.blocks, fit.residual**2, minlength=problem.block_count)
    clean = float(np.mean(sums[counts > 0] < CLEAN * counts[counts > 0]))
    return CLOSED_ENOUGH if clean >= CLEAN_SHARE else CLOSED_ENOUGH_EVERYWHERE


def _at_bound(fit: Fit) -> str:
    """Name of a parameter that ends on a bound other than where its effect is absent; empty where none does."""
    k = len(fit.z)
    for (effect, _), values in zip(fit.hypothesis, fit.values):
        for p in CATALOGUE[effect].parameters:
            if not fit.free[k] and not p.optional and abs(values[p.name] - p.null) > 1e-9:
                return f"{effect}.{p.name}"
            k += 1
    return ""


def _twins(fit: Fit) -> bool:
    """Whether an effect stands on each side with the same parameters."""
    by_side = {(effect, side): values for (effect, side), values in zip(fit.hypothesis, fit.values)}
    for (effect, side), left in by_side.items():
        right = by_side.get((effect, "right"))
        if side == "left" and right is not None and all(
                abs(left[p.name] - right[p.name]) <= SAME_SIZE * max(
                    abs(left[p.name] - p.null), abs(right[p.name] - p.null), 0.5 * p.spread)
                for p in CATALOGUE[effect].parameters if not p.shape):
            return True
    return False


def _smallest(fit: Fit, beside: Hypothesis = ()) -> float:
    """Size of the smallest effect of an explanation that `beside` does not hold, in spreads of its parameters."""
    sizes, k = [], 0
    for member in fit.hypothesis:
        parameters = CATALOGUE[member[0]].parameters
        if member not in beside:
            sizes.append(max(abs(fit.u[k + n]) for n, p in enumerate(parameters) if not p.shape))
        k += len(parameters)
    return float(min(sizes))


def _held_out_gain(problem: Problem, small: np.ndarray, large: np.ndarray, scale: float) -> tuple[float, float]:
    """Gain of chi2 (over dispersion) on held-out blocks, and that gain over its block standard error."""
    difference = (small - large) / scale
    gain = float(difference.sum())
    # Median-centred spread would ignore the few blocks that carry a real effect; the plain one does not.
    error = float(np.sqrt(len(difference)) * difference.std())
    return gain, gain / error if error > 0 else 0.0


def decide(problem: Problem, choice: Choice) -> Decision:
    """Choose among the ranked explanations.

    An explanation stands when each of its effects gains on held-out stretches and explains its share of what the
    rest leaves; the best that stands is blamed.
    """
    scale = choice.dispersion
    fold_of = folds(problem)
    noise = float(problem.size)
    out_of_sample: dict[Hypothesis, np.ndarray] = {}
    reasons: dict[Hypothesis, str] = {}
    gains: dict[Hypothesis, tuple[float, float]] = {}

    def predicted(fit: Fit) -> np.ndarray:
        if fit.hypothesis not in out_of_sample:
            out_of_sample[fit.hypothesis] = held_out(problem, fit, fold_of)
        return out_of_sample[fit.hypothesis]

    def singular(fit: Fit, rival: Fit) -> bool:
        """Whether the effect added to `rival` is of fair size and does what no other effect comes near to doing."""
        added = [h for h in fit.hypothesis if h not in rival.hypothesis]
        promised = choice.growth.get(rival.hypothesis)
        if len(added) != 1 or not promised or _smallest(fit, rival.hypothesis) < FAIR_SIZE:
            return False
        (effect, _), = added
        others = max((gain for name, gain in promised.items() if name != effect), default=0.0)
        gain = (rival.chi2 - fit.chi2) / scale
        return gain > SINGULAR_GAIN and promised.get(effect, 0.0) > SINGULAR * others

    def blemish(fit: Fit, rival: Fit) -> bool:
        """Whether what an explanation adds to `rival` is too small, and explains too little of the excess, to be a cause."""
        share = (rival.chi2 - fit.chi2) / max(choice.base.chi2 - noise, NO_GAP * noise)
        return any(_smallest(fit, rival.hypothesis) < size and share < part for size, part in BLEMISHES)

    def stands(fit: Fit) -> bool:
        if not fit.hypothesis:
            return True
        parts = [fit.hypothesis[:k] + fit.hypothesis[k + 1:] for k in range(len(fit.hypothesis))]
        # One effect on both sides alike is the simpler form of the same effect on each side.
        for effect in {e for e, side in fit.hypothesis if side == "left"} & {e for e, s in fit.hypothesis if s == "right"}:
            rest = tuple(h for h in fit.hypothesis if h[0] != effect)
            parts.append(tuple(sorted((*rest, (effect, "both")))))
        smaller = [choice.fits[p] for p in parts if p in choice.fits]
        if not smaller:
            smaller = [choice.base]
        rival = min(smaller, key=lambda f: _cost(f, scale))
        left = max(rival.chi2 - noise, 0.0)
        if len(fit.hypothesis) > 1:
            whole = left > NO_GAP * noise and rival.chi2 - fit.chi2 > TAKES_ALL * left
            if not whole and blemish(fit, rival):
                small = _smallest(fit, rival.hypothesis)
                reasons[fit.hypothesis] = f"one of its effects is hardly there ({small:.1%} of what is met in practice)"
                return False
            if _twins(fit):
                reasons[fit.hypothesis] = "its sides are alike: that is the effect on both sides"
                return False
        gain, t = _held_out_gain(problem, predicted(rival), predicted(fit), scale)
        base_gain, base_t = _held_out_gain(problem, predicted(choice.base), predicted(fit), scale)
        gains[fit.hypothesis] = (base_gain * scale / noise, base_t)
        if gain < HELD_OUT_GAIN or (t < HELD_OUT_T and gain < 10 * HELD_OUT_GAIN):
            reasons[fit.hypothesis] = f"gains too little on stretches it was not fitted to ({gain:.0f}, t = {t:.1f})"
            return False
        if structure(problem, fit.residual) > STRUCTURED and (bound := _at_bound(fit)):
            reasons[fit.hypothesis] = f"{bound} ends on its bound, and leaves a rest with structure"
            return False
        if len(fit.hypothesis) > 1 and rival.chi2 - fit.chi2 < EARN_SHARE * left and not singular(fit, rival):
            reasons[fit.hypothesis] = (f"its last effect takes {(rival.chi2 - fit.chi2) / left:.0%} of what the others "
                                       "leave")
            return False
        if len(fit.hypothesis) > 1 and len(smaller) > 1 and not stands(rival):
            reasons[fit.hypothesis] = "what is left without its last effect is no explanation"
            return False
        return True

    ranked = choice.ranked
    chosen = None
    standing = []
    for scored in ranked[:25]:
        if scored.probability < 1e-12 and chosen is not None and len(standing) > 12:
            break
        if stands(scored.fit):
            standing.append(scored)
            chosen = chosen or scored
    chosen = chosen or Scored(choice.base, 0.0)
    base = choice.base
    excess = base.chi2 - noise

    def explained(f: Fit) -> bool:
        return structure(problem, f.residual) <= STRUCTURED or _explains(problem, choice, f, _closed(problem, base, f))

    def negligible(f: Fit) -> bool:
        """Whether an explanation of hardly a gap is as small as another formulation of a perfect robot, or noise's colour."""
        if not f.hypothesis:
            return False
        if _smallest(f) < BLEMISHES[0][0] or blemish(f, base):
            return True
        faint = _smallest(f) < FAIR_SIZE or (base.chi2 - f.chi2) / scale < SINGULAR_GAIN
        return (faint and structure(problem, f.residual) > STRUCTURED
                and _closed(problem, base, f) < _enough(problem, choice, f))

    if chosen.fit.hypothesis and excess > NO_GAP * noise and not explained(chosen.fit):
        # A stand-in may fit better on the whole than the cause whose form is not quite nature's.
        rivals = list(itertools.takewhile(lambda s: s.fit.hypothesis, standing))
        passed = list(itertools.takewhile(lambda s: not explained(s.fit), rivals))
        if len(passed) < len(rivals):
            reasons.update({s.fit.hypothesis: "leaves too much of some channel's gap open" for s in passed})
            standing = standing[len(passed):]
            chosen = standing[0]
    if excess <= NO_GAP * noise and negligible(chosen.fit):
        small, whole = chosen, set(chosen.fit.hypothesis)
        parts = [s for s in standing if set(s.fit.hypothesis) < whole and not negligible(s.fit)]
        chosen = parts[0] if parts else Scored(base, small.score)
        dropped = [s for s in standing if s is small or s.score < chosen.score]
        reasons.update({s.fit.hypothesis: "is too small to be a cause where there is hardly a gap" for s in dropped})
        standing = [s for s in standing if s not in dropped]
    fit = chosen.fit
    ranked = [chosen] + [s for s in standing if s is not chosen]
    structured = structure(problem, fit.residual) > STRUCTURED
    closed = _closed(problem, base, fit) if fit.hypothesis else 0.0
    if not fit.hypothesis:
        verdict = "unknown" if structured and excess > NO_GAP * noise else "none"
    else:
        gap_left = structured and excess > NO_GAP * noise
        verdict = "unknown" if gap_left and not _explains(problem, choice, fit, closed) else "known"

    weights = np.exp(-0.5 * (np.array([s.score for s in ranked]) - min(s.score for s in ranked)))
    if verdict == "unknown":
        unknown = 0.9
    elif structured:
        unknown = float(np.clip(1.0 - closed, 0.02, 0.5))
    else:
        unknown = 0.01
    probabilities = weights / weights.sum() * (1.0 - unknown)
    for scored, p in zip(ranked, probabilities):
        scored.probability = float(p)
    alike = _alike(choice, fit, scale) if verdict == "known" else []
    _share(ranked, fit, alike)
    ranked.sort(key=lambda s: (-s.probability, s.score))
    if verdict == "known":
        # What is blamed comes first; its equals follow.
        ranked = [chosen] + [s for s in ranked if s is not chosen]
    return Decision(fit, base, verdict, ranked, unknown, alike, structured, closed, reasons, gains)


def _alike(choice: Choice, fit: Fit, scale: float) -> list[list[tuple[str, str]]]:
    """Sets of (effect, side): a blamed one and those that replace it in the explanation at no loss of fit."""
    best = _cost(fit, scale)
    sets = []
    for member in fit.hypothesis:
        rest = tuple(h for h in fit.hypothesis if h != member)
        rivals = []
        for hypothesis, other in choice.fits.items():
            if len(hypothesis) != len(fit.hypothesis) or hypothesis == fit.hypothesis:
                continue
            if not set(rest) <= set(hypothesis) or not named(other):
                continue
            worse = _cost(other, scale) - best
            # More freedom for no better fit is no rival, but the same explanation with idle parameters.
            if len(other.u) > len(fit.u) and worse > -ALIKE:
                continue
            if worse < ALIKE:
                replaced = next(h for h in hypothesis if h not in rest)
                if replaced[0] == member[0]:
                    # Sides of one effect: the freer one is no rival of the shared one.
                    continue
                rivals.append((worse, replaced))
        rivals.sort()
        if rivals:
            sets.append([member] + [r for _, r in rivals[:2]])
    return sets


def _share(ranked: list[Scored], fit: Fit, alike: list[list[tuple[str, str]]]) -> None:
    """Members of a set share the probability of their explanations by prior."""
    for members in alike:
        rest = [h for h in fit.hypothesis if h != members[0]]
        rows = [s for s in ranked
                if any(s.fit.hypothesis == tuple(sorted(rest + [m])) for m in members)]
        total = sum(s.probability for s in rows)
        weights = np.exp([log_prior(s.fit.hypothesis, len(CATALOGUE)) for s in rows])
        for s, weight in zip(rows, weights / weights.sum() if len(rows) else []):
            s.probability = float(total * weight)
