"""The search for forms: what named effects leave, as curves in the equations that lack something.

One form is taken after the other, at most three. One that helps, but not enough, may be taken with the next one, as
with effects. Derivatives say which are worth a fit. Fits say what each leaves of runs left out, and that decides, as it
does between effects (`choice`). So the equation is that which predicts other runs, and not the one with the largest
residual. A form that a later one makes needless is dropped (`backward`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.choice import EQUIVALENT_GAP_RATIO, MAX_RESIDUAL_RATIO, HeldOutScore, pooled, residual_ratio
from rtds_host.diagnosis.effects import RESEMBLES, Effect
from rtds_host.diagnosis.fit import ROUGH_GAIN, Fit, Fitter, joined, parameters
from rtds_host.diagnosis.forms.backward import eliminated
from rtds_host.diagnosis.forms.candidates import candidates
from rtds_host.diagnosis.forms.curves import Form, shapes
from rtds_host.diagnosis.forms.ends import GAINS, movable, moves_of, with_ends
from rtds_host.diagnosis.forms.fits import (
    STEPS,
    Cause,
    derived,
    fitted,
    refitted_without,
    renewed,
    renewed_each,
    roughly,
    side_by_side_with,
    without,
    without_all,
)
from rtds_host.diagnosis.forms.formula import ENOUGH
from rtds_host.diagnosis.forms.screen import FormCandidate, distinct, screened, slopes
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.report.words import OVER_WORDS, TERM_WORDS, listed_name
from rtds_host.diagnosis.thresholds import MAJORITY, MINOR_SHARE
from rtds_host.plant import forms as plant

# What counts as a gap (contract, section 4). Nothing below it distinguishes explanations (`choice`), so only what is
# above by more than rounding leaves anything to look for.
LEAST_GAP = (1.0 + 1e-9) * gaps.LEAST
# Numerical: forms of each screening that are fitted roughly at each turn, in a narrow search and in a wide one; how
# many of these to convergence. Of a screening in the place of names as many are fitted roughly.
TRIED, FITTED = {True: 4, False: 6}, {True: 2, False: 4}
# Numerical: what a form leaves at most, of what was left without it, to be taken with the next one alone: it makes half
# of the reduction that is asked, in the logarithm.
WITH_THE_NEXT = MAX_RESIDUAL_RATIO**0.5
# Numerical: parts of the way from an effect's size next to curves to its size without any: the first two are compared,
# the others taken in turn while curves lose their support on the way.
PARTS = (1, 3, 6, 12)
# Numerical: work (`Problem.work`) after which no further form is looked for, with a narrow search and with a wide one:
# about a quarter of a minute, and a minute and a half. No time, or the answer would hang on the processor.
MOST_WORK = {True: 1.7e9, False: 1e10}


@dataclass
class Found:
    """Forms of a case, in the order in which they were found: `judged` holds the explanation without any and with one
    after the other. `notes`: what else is to be said; `rivals`: what is said of a form, by its id, as long as it is
    one; `superseded`: named effects that curves supersede; `made`: those that keep their names though the curves make
    what they do."""

    judged: list[HeldOutScore]
    forms: list[tuple[Form, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    rivals: dict[str, list[str]] = field(default_factory=dict)
    superseded: list[Cause] = field(default_factory=list)
    made: set[Cause] = field(default_factory=set)

    @property
    def fit(self) -> Fit:
        """The fit with all forms."""
        return self.judged[-1].fit


def searched(problem: Problem, fit: Fit, quick: bool, lacking: Mapping[Cause, Fit] | None = None) -> Found:
    """Forms of what an explanation leaves.

    Parameters
    ----------
    lacking : the explanation without each of its effects, the others fitted again: a form may do in such a place, and
        it supersedes the effect. Effects that are not in here do not.
    """
    began = problem.work
    if fit.noise.root is None:
        # Fitted by plain squares, as the explanation without effects is: its evidence is compared with that of fits by
        # the likelihood that its residual has.
        fit = replace(fit, noise=problem.white().estimated(fit.residual))
    found = Found([HeldOutScore.in_few_steps(problem, fit)])
    known: dict[str, Effect] = dict(fit.effects)
    lacking = lacking or {}
    bases: list[Fit] = []
    if found.judged[-1].gap > LEAST_GAP:
        bases = [*lacking.values(), *fewer(problem, fit, lacking)]
    seen: set[frozenset[Cause]] = {frozenset()}
    kept: tuple[list[HeldOutScore], list[tuple[Form, str]]] | None = None  # what there was before a form on trial
    while len(found.forms) < plant.MOST_FORMS and found.judged[-1].gap > LEAST_GAP:
        if problem.work - began > MOST_WORK[quick]:
            break
        # In an effect's place only what is left by named effects alone is known.
        on_trial = kept is not None
        most = MAX_RESIDUAL_RATIO if on_trial else WITH_THE_NEXT
        best = next_form(problem, found, known, quick, bases if not found.forms else [], most)
        if best is None:
            break
        candidate, judged = best
        kept = kept or (found.judged[:], found.forms[:])
        found.forms.append((candidate.form, candidate.side))
        found.judged.append(judged)
        if pooled(judged, kept[0][-1]) > MAX_RESIDUAL_RATIO ** (2 if on_trial else 1):
            if on_trial:
                break
            continue
        kept = None
        drop_needless(problem, found)
        now = frozenset((form.id, side) for form, side in found.forms)
        if now in seen:
            break  # a form dropped and found once more: the search would go in a circle
        seen.add(now)
    if kept is not None:
        found.judged[:], found.forms[:] = kept
    if found.forms and lacking:
        drop_superseded(problem, found, lacking)
    if found.forms:
        keep_sizes(problem, found)
    found.notes += [note for form, _ in found.forms for note in found.rivals.get(form.id, ())]
    return found


def fewer(problem: Problem, fit: Fit, lacking: Mapping[Cause, Fit]) -> list[Fit]:
    """An explanation without the two of its effects that help least, without the three, and so on: several names may
    replace one curve."""
    order = sorted(lacking, key=lambda cause: HeldOutScore.in_few_steps(problem, lacking[cause]).gap)
    return without_all(problem, fit, [order[:count] for count in range(2, len(order) + 1)])


def drop_needless(problem: Problem, found: Found) -> None:
    """Drop forms that are not supported next to the latest one."""
    found.judged, found.forms = eliminated(problem, found.judged, found.forms)


def keep_sizes(problem: Problem, found: Found) -> None:
    """Give effects whose larger part the curves can make the sizes that they have without any, unless other sizes leave
    clearly less: how much of the sum is the effect's no run says, and a curve is what names leave. The same for effects
    that the fit with curves moved to a bound, where none is a cause. Curves that held-out runs no longer support then
    are no forms, and they supersede no name."""
    before, now = found.judged[0].fit, found.fit
    values = dict(zip(now.hypothesis, now.values, strict=True))
    named = [cause for cause in before.hypothesis if cause in values]
    at_bound = [cause for cause in named if now.effects[cause[0]].at_its_bound(values[cause])]
    held = [
        cause
        for cause in named
        if cause in at_bound or cause in found.made or _made_by_curves(found, cause, 1.0 - MAJORITY) is not None
    ]
    if not held:
        return
    # Derivatives hold near where they were taken: one step goes by those at its end, parts by those at each start.
    ways: list[HeldOutScore] = []
    for parts in PARTS:
        ways.append(HeldOutScore.in_few_steps(problem, renewed(problem, _with_sizes_of(problem, found, held, parts))))
        kept = min(ways, key=lambda one: one.gap)
        if len(ways) > 1 and pooled(kept, found.judged[0]) <= MAX_RESIDUAL_RATIO:
            break
    shapes_of_curves = found.made or any(_made_by_curves(found, cause, MINOR_SHARE) is not None for cause in held)
    if not (at_bound or shapes_of_curves) and pooled(found.judged[-1], kept) <= MAX_RESIDUAL_RATIO:
        return  # the runs do say how much of the sum is the effect's
    if pooled(kept, found.judged[0]) <= MAX_RESIDUAL_RATIO:
        found.judged[-1] = kept
    else:
        del found.judged[1:], found.forms[:], found.superseded[:]


def _with_sizes_of(problem: Problem, found: Found, held: Sequence[Cause], parts: int) -> Fit:
    """The fit with forms, but some effects at their sizes without any; what they change the curves take over.

    parts : of the way, with a fit after each; a single one goes by the effects' derivatives at its end.
    """
    before, fit = found.judged[0].fit, found.fit
    curves = [(form.id, side) for form, side in found.forms]
    ends = np.cumsum([len(fit.parts[one]) for one in curves])
    fitter = Fitter(problem, fit.start)
    fitter.effects = fit.effects
    problem.follow_angles(True)
    for left in range(parts, 0, -1):
        now, root = fit.parts, _root(fit)
        moves = {cause: (before.parts[cause] - now[cause]) / left for cause in held}
        columns = before.columns if parts == 1 else fit.columns
        change = sum((columns[cause] @ move for cause, move in moves.items()), np.zeros(len(root)))
        way, *_ = np.linalg.lstsq(root[:, None] * np.hstack([fit.columns[one] for one in curves]), root * change, 1e-6)
        taken_over = {one: now[one] - part for one, part in zip(curves, np.split(way, ends[:-1]), strict=True)}
        hypothesis, start = joined({**now, **taken_over, **{cause: now[cause] + moves[cause] for cause in held}})
        fit = fitter.fit(hypothesis, start, fit.z, fit.noise, STEPS, by_nuisance=fit.by_nuisance, held=held)
    problem.follow_angles(False)
    return fit


def _root(fit: Fit) -> np.ndarray:
    """Roots (N,) of the weights that a fit's residuals have."""
    return np.ones(len(fit.residual)) if fit.noise.root is None else fit.noise.root


def next_form(
    problem: Problem, found: Found, known: dict[str, Effect], quick: bool, lacking: list[Fit], most: float
) -> tuple[FormCandidate, HeldOutScore] | None:
    """The form more that leaves least of runs left out, if it helps enough and no effect makes it as well.

    lacking : explanations in which it may stand for what they lack, next to the one that there is; most : what it may
    leave of what was left without it.
    """
    now = found.judged[-1]
    taken = {(form.term, form.over) for form, _ in found.forms}
    problem.follow_angles(True)
    forms = [form for form in candidates(problem, now.fit.model(problem)) if (form.term, form.over) not in taken]
    known_slopes = slopes(problem, now.fit, forms)
    # By the likelihood what acts often is seen, by plain squares what is large.
    tried = [
        (base, one)
        for base in (now.fit, *lacking)
        for fit in (base, replace(base, noise=problem.white()))
        for one in distinct(screened(problem, fit, known_slopes))[: TRIED[quick] if base is now.fit else FITTED[quick]]
        if one.left < 1.0
    ]
    tried = list({(base.hypothesis, one.form, one.side): (base, one) for base, one in tried}.values())
    rough = roughly(problem, known, known_slopes, tried)
    problem.follow_angles(False)
    kept = [
        (fit, base, one)
        for (base, one), fit in zip(tried, rough, strict=True)
        if fit.score < base.score or movable(one.form)
    ]
    open_loop = renewed_each(problem, [fit for fit, *_ in kept])
    judged = [
        (HeldOutScore.in_few_steps(problem, fit), base, one)
        for fit, (_, base, one) in zip(open_loop, kept, strict=True)
    ]
    judged.sort(key=lambda each: each[0].gap)
    for ended in choices(problem, known, judged, quick):
        candidate, best = _smallest_residual(ended)
        if pooled(best, now) <= GAINS:
            fits, before = partial(side_by_side_with, problem, known, best.fit), candidate
            moves = moves_of(problem, now.fit.model(problem), forms, candidate.form)
            candidate, best = with_ends(problem, fits, candidate, best, moves)
            if candidate is not before:
                best = refined(problem, known, candidate, best)
        best = HeldOutScore.in_few_steps(problem, renewed(problem, derived(problem, best.fit)))
        base = _base(best.fit, candidate, (now.fit, *lacking))
        if best.fit.score < base.score:
            break
    else:
        return None
    if pooled(best, now) > most:
        return None
    name = _named(problem, now, best, candidate)
    if name is not None:
        # Another equation's curve would then stand in for an effect that has a name.
        curve = f"{TERM_WORDS[candidate.form.term]} over {OVER_WORDS[candidate.form.over]}"
        effect = listed_name({"id": name, "side": candidate.side})
        found.notes.append(f"{effect} explains as much as a free curve of {curve}: no form is needed")
        return None
    found.rivals[candidate.form.id] = rivals(ended, candidate.form, now, best)
    known[candidate.form.id] = candidate.form.effect()
    return candidate, best


def refined(
    problem: Problem, known: Mapping[str, Effect], candidate: FormCandidate, rough: HeldOutScore
) -> HeldOutScore:
    """A roughly fitted explanation with a form, fitted to convergence if that leaves less of runs left out."""
    problem.follow_angles(True)
    fit = fitted(problem, rough.fit, known, candidate)
    problem.follow_angles(False)
    return min(rough, HeldOutScore.in_few_steps(problem, renewed(problem, fit)), key=lambda one: one.gap)


def _base(fit: Fit, one: FormCandidate, bases: Sequence[Fit]) -> Fit:
    """The explanation that an explanation with a form more is made from."""
    others = set(fit.hypothesis) - {(one.form.id, one.side)}
    return next(base for base in bases if set(base.hypothesis) == others)


def choices(
    problem: Problem,
    known: Mapping[str, Effect],
    judged: Sequence[tuple[HeldOutScore, Fit, FormCandidate]],
    quick: bool,
) -> list[list[tuple[FormCandidate, HeldOutScore]]]:
    """Forms to choose from, with what each leaves: first all, and where the evidence is against the one that leaves
    least, those alone which it is for.

    A curve with wrong ends may leave little of held-out runs and yet have evidence against it: one that ends before a
    jump makes most of what is missing, and errs wherever the rest is. Its ends are moved before that decides.

    Parameters
    ----------
    judged : rough fits, the explanation without the form, and the form, those that leave least first.
    """
    good = [each for each in judged if each[0].fit.score < each[1].score][: FITTED[quick]]
    problem.follow_angles(True)
    fits = [fitted(problem, rough.fit, known, one) for rough, _, one in good]
    problem.follow_angles(False)
    # What the likelihood ends in may leave more of runs left out than what the rough fit came to. By the screening's
    # derivatives, fits without a run would leave less than they do.
    ended = [
        (one, HeldOutScore.in_few_steps(problem, renewed(problem, fit)))
        for (rough, base, one), converged in zip(good, fits, strict=True)
        for fit in (derived(problem, rough.fit), converged)
        if fit.score < base.score
    ]
    others = [(one, rough) for rough, base, one in judged if rough.fit.score >= base.score]
    least = min((best.gap for _, best in ended), default=np.inf)
    wrong_ends = [pair for pair in others if pair[1].gap < least][:1]
    return [each for each in ([*ended, *wrong_ends] if wrong_ends else [], ended) if each]


def rivals(
    ended: Sequence[tuple[FormCandidate, HeldOutScore]], form: Form, now: HeldOutScore, best: HeldOutScore
) -> list[str]:
    """What is said where another equation's curve leaves as little of runs left out as the form that is taken.

    Parameters
    ----------
    ended : all forms that were fitted, with what each leaves; now : what is left without any of them; best : what the
        form leaves that is taken.
    """
    least: dict[tuple[str, str], HeldOutScore] = {}
    for one, judged in ended:
        place = one.form.term, one.form.over
        if place != (form.term, form.over) and (place not in least or judged.gap < least[place].gap):
            least[place] = judged
    return [
        f"{TERM_WORDS[form.term]} over {OVER_WORDS[form.over]} is hardly distinguishable on these runs from "
        f"{TERM_WORDS[term]} over {OVER_WORDS[over]}: the gaps on held-out runs are {best.gap:.3g} and {judged.gap:.3g}"
        for (term, over), judged in least.items()
        if GAINS * pooled(judged, best) <= 1.0 and pooled(judged, now) <= MAX_RESIDUAL_RATIO
    ]


def _smallest_residual(ended: Sequence[tuple[FormCandidate, HeldOutScore]]) -> tuple[FormCandidate, HeldOutScore]:
    """The form that leaves least of runs left out. The command's history has to leave clearly less than the command
    alone, which is half of what its curve can hold."""
    candidate, best = min(ended, key=lambda pair: pair[1].gap)
    if candidate.form.over == "command_history":
        plain = [pair for pair in ended if pair[0].form.over == "v_cmd" and pair[0].form.term == candidate.form.term]
        if plain:
            other = min(plain, key=lambda pair: pair[1].gap)
            if pooled(best, other[1]) > GAINS:
                return other
    return candidate, best


def drop_superseded(problem: Problem, found: Found, lacking: Mapping[Cause, Fit]) -> None:
    """Take back named effects that help no more once the curves are there, the most needless one first.

    A curve may be what another equation's effect stood in for. What the curve holds itself, as a torque over the speed
    holds dry friction, never helps next to it: such a name stays as an approximation if alone it makes as much of what
    the curve makes as a formula has to.
    """
    named = [cause for cause in found.judged[0].fit.hypothesis if cause in lacking]
    for cause in named:
        # A curve that was taken in an effect's place need not be what makes it needless.
        if cause not in found.fit.hypothesis:
            now = found.judged[-1]
            # Fitted, it may take what the curves had made better: then they keep it.
            fits = (_again(problem, found, cause, held) for held in ((), (cause,)))
            again = min((HeldOutScore.in_few_steps(problem, one) for one in fits), key=lambda one: one.gap)
            helps = residual_ratio(again, now) <= MAX_RESIDUAL_RATIO
            if helps or _keeps_name(problem, found, cause, now, lacking[cause]):
                found.judged[-1] = again
    while True:
        now = found.judged[-1]
        needless = []
        for cause in named:
            if cause not in now.fit.hypothesis:
                continue
            less = HeldOutScore.in_few_steps(problem, _lacking(problem, found, cause))
            helps = residual_ratio(now, less) <= MAX_RESIDUAL_RATIO
            if not (helps or _keeps_name(problem, found, cause, less, lacking[cause])):
                needless.append((less.gap, cause, less))
        if not needless:
            break
        found.judged[-1] = min(needless, key=lambda one: one[0])[2]
    found.superseded = [cause for cause in named if cause not in found.fit.hypothesis]


def _lacking(problem: Problem, found: Found, cause: Cause) -> Fit:
    """An explanation without one of its effects. Where the curves can replace the larger part of the effect they change
    much without it, too much for the derivatives at their present values."""
    if _made_by_curves(found, cause, 1.0 - MAJORITY) is None:
        return without(problem, found.fit, cause)
    (fit,) = refitted_without(problem, found.fit, [cause])
    return fit


def _again(problem: Problem, found: Found, cause: Cause, held: Sequence[Cause]) -> Fit:
    """An explanation with an effect that it had before there were curves, all fitted with the derivatives there are.

    The effect begins absent, since the curves hold what it did: at its former size it would act twice. It stays so if
    it is `held`.
    """
    before, now = found.judged[0].fit, found.fit
    fitter = Fitter(problem, now.start)
    fitter.effects = now.effects
    hypothesis, start = joined({**now.parts, cause: np.zeros_like(before.parts[cause])})
    known = {**now.columns, cause: before.columns[cause]}
    return fitter.fit(
        hypothesis, start, now.z, now.noise, STEPS, known, by_nuisance=now.by_nuisance, least=ROUGH_GAIN, held=held
    )


def makes_larger_part(named: float, curves: float, neither: float) -> bool:
    """Whether a name alone makes the larger part of what curves make in its place, in the logarithm of the residual, as
    in the likelihood of a size that is not known. So curves that leave only noise supersede a name more easily than
    curves that are closer but not right, either.

    named, curves, neither : residual power (`HeldOutScore.residual_power`) with the one, the others and neither.
    """
    return math.log(neither / named) >= MAJORITY * math.log(neither / curves)


def _keeps_name(problem: Problem, found: Found, cause: Cause, less: HeldOutScore, lacking: Fit) -> bool:
    """Whether an effect keeps its name next to curves that make what it does: alone it makes the larger part of what
    they make, or it is a shape of theirs and makes nearly all of that.

    less : with the curves and without the effect; lacking : with neither.
    """
    neither = HeldOutScore.in_few_steps(problem, lacking).residual_power
    named, curves = found.judged[0].residual_power, less.residual_power
    if makes_larger_part(named, curves, neither):
        found.made.add(cause)
        return True
    return _made_by_curves(found, cause, MINOR_SHARE) is not None and neither - named >= ENOUGH * (neither - curves)


def _made_by_curves(found: Found, cause: Cause, most: float) -> np.ndarray | None:
    """Coefficients of the curves, (n, p), that do what an effect's p parameters do; None where these miss more than
    `most` of its square."""
    now = found.fit
    root = _root(now)
    change = root[:, None] * found.judged[0].fit.columns[cause]
    curves = root[:, None] * np.hstack([now.columns[form.id, side] for form, side in found.forms])
    way, *_ = np.linalg.lstsq(curves, change, rcond=1e-6)
    missed = np.square(change - curves @ way).sum()
    return way if missed <= most * np.square(change).sum() else None


def curves_of_superseded(found: Found) -> dict[str, list[np.ndarray]]:
    """Curves (points,) of single forms that do what superseded effects do, by the form's id. A formula of such a shape
    would say that the effect had been right."""
    curves: dict[str, list[np.ndarray]] = {}
    for cause in found.superseded:
        for form, side in found.forms:
            alone = replace(found, forms=[(form, side)])
            way = _made_by_curves(alone, cause, MINOR_SHARE)
            # Several parameters of an effect are no single shape.
            if way is not None and way.shape[1] == 1:
                basis, widths = shapes(form.over)
                curves.setdefault(form.id, []).append(basis @ (way[:, 0] * widths))
    return curves


def _named(problem: Problem, now: HeldOutScore, judged: HeldOutScore, candidate: FormCandidate) -> str | None:
    """The effect of the catalogue that does on runs left out what a form does, None without any."""
    fitter = Fitter(problem, now.fit.start)
    fitter.effects = dict(now.fit.effects)
    for name in RESEMBLES.get((candidate.form.term, candidate.form.over), ()):
        effect = fitter.effects.get(name)
        side = candidate.side if effect is not None and effect.sided else "both"
        if effect is None or any(cause[0] == name for cause in now.fit.hypothesis):
            continue
        for first in effect.parameters[0].starts[:2]:
            start = np.array([p.scaled(first if p is effect.parameters[0] else p.starts[0]) for p in effect.parameters])
            hypothesis, u = joined({**now.fit.parts, (name, side): start})
            fit = fitter.fit(hypothesis, u, now.fit.z, now.fit.noise, STEPS, by_nuisance=now.fit.by_nuisance)
            if HeldOutScore.in_few_steps(problem, fit).gap <= EQUIVALENT_GAP_RATIO * judged.gap:
                return name
    return None


def values_of(fit: Fit, form: Form, side: str) -> tuple[np.ndarray, np.ndarray]:
    """A form's values (points,) in a fit, in the term's unit, and the covariance (n, n) of its coefficients in SI."""
    basis, _ = shapes(form.over)
    ps = parameters(fit.effects, fit.hypothesis)
    at = [k for k, (effect, one, _) in enumerate(ps) if (effect.id, one) == (form.id, side)]
    prior_widths = np.array([ps[k][2].prior_width for k in at])
    rows = len(fit.z) + np.array(at)
    covariance = fit.covariance[np.ix_(rows, rows)] * np.outer(prior_widths, prior_widths)
    return basis @ (fit.u[at] * prior_widths), covariance


def closes(found: Found) -> list[float]:
    """Of what the effects leave, the share that each form closes on runs left out."""
    each = [max(judged.gap, 1.0) for judged in found.judged]
    return [
        min(max((before - after) / max(each[0] - 1.0, gaps.LEAST - 1.0), 0.0), 1.0)
        for before, after in zip(each, each[1:])
    ]
