"""Fits of an explanation with a form more, or with one of its parts less."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from rtds_host.diagnosis.effects import Effect
from rtds_host.diagnosis.fit import ROUGH_GAIN, Fit, Fitter, joined, side_by_side
from rtds_host.diagnosis.forms.screen import FormCandidate, Slopes
from rtds_host.diagnosis.problem import Problem

# An effect or a form and its side.
Cause = tuple[str, str]
# Numerical: steps of a fit.
STEPS, ROUGH_STEPS = 6, 4


def renewed(problem: Problem, fit: Fit) -> Fit:
    """A fit with the residuals that it has where nothing follows measured angles."""
    return renewed_each(problem, [fit])[0]


def renewed_each(problem: Problem, fits: Sequence[Fit]) -> list[Fit]:
    """The same of several fits."""
    found = problem.residuals([fit.model(problem) for fit in fits])
    return [replace(fit, residual=residual) for fit, residual in zip(fits, found, strict=True)]


def _with_form(problem: Problem, fit: Fit, known: Mapping[str, Effect], one: FormCandidate) -> Fitter:
    """What fits an explanation with one form more."""
    fitter = Fitter(problem, fit.start)
    fitter.effects = {**known, one.form.id: one.form.effect()}
    return fitter


def roughly(
    problem: Problem, known: Mapping[str, Effect], by_form: Sequence[Slopes], tried: Sequence[tuple[Fit, FormCandidate]]
) -> list[Fit]:
    """Explanations with one form more each, fitted with the derivatives that the screening had, a replay a step."""
    of = {one.form: one for one in by_form}
    works = []
    for base, one in tried:
        cause = one.form.id, one.side
        hypothesis, start = joined({**base.parts, cause: one.start})
        works.append(
            _with_form(problem, base, known, one).fitting(
                hypothesis,
                start,
                base.z,
                base.noise,
                ROUGH_STEPS,
                {**base.columns, cause: of[one.form].of(one.side)},
                by_nuisance=base.by_nuisance,
                least=ROUGH_GAIN,
            )
        )
    return side_by_side(problem, works)


def fitted(problem: Problem, fit: Fit, known: Mapping[str, Effect], one: FormCandidate) -> Fit:
    """An explanation that has a form already, all parameters fitted together."""
    fitter = _with_form(problem, fit, known, one)
    return fitter.fit(fit.hypothesis, fit.u, fit.z, fit.noise, STEPS, by_nuisance=fit.by_nuisance)


def without(problem: Problem, fit: Fit, cause: Cause) -> Fit:
    """An explanation without one of its effects, the others fitted again with the derivatives that they have."""
    known = {one: columns for one, columns in fit.columns.items() if one != cause}
    fitter = Fitter(problem, fit.start)
    fitter.effects = fit.effects
    hypothesis, start = joined(fit.parts_without(cause))
    return fitter.fit(hypothesis, start, fit.z, fit.noise, STEPS, known, by_nuisance=fit.by_nuisance, least=ROUGH_GAIN)


def refitted_without(problem: Problem, fit: Fit, causes: Sequence[Cause]) -> list[Fit]:
    """Explanations without one of some parts each, all other parameters fitted again with derivatives of their own."""
    return without_all(problem, fit, [[cause] for cause in causes])


def without_all(problem: Problem, fit: Fit, sets: Sequence[Sequence[Cause]]) -> list[Fit]:
    """Explanations without all parts of one of some sets each, the others fitted again as in `refitted_without`."""
    problem.follow_angles(True)
    works = []
    for gone in sets:
        fitter = Fitter(problem, fit.start)
        fitter.effects = fit.effects
        hypothesis, start = joined({cause: u for cause, u in fit.parts.items() if cause not in gone})
        works.append(fitter.fitting(hypothesis, start, fit.z, fit.noise, STEPS, by_nuisance=fit.by_nuisance))
    fits = side_by_side(problem, works)
    problem.follow_angles(False)
    return [renewed(problem, one) for one in fits]


def derived(problem: Problem, fit: Fit) -> Fit:
    """An explanation with derivatives at its own values: a rough fit has those of the screening, of which intervals
    would be rough."""
    fitter = Fitter(problem, fit.start)
    fitter.effects = fit.effects
    problem.follow_angles(True)
    (found,) = side_by_side(problem, [fitter.derived(fit)])
    problem.follow_angles(False)
    return found


def side_by_side_with(
    problem: Problem, known: Mapping[str, Effect], fit: Fit, tried: Sequence[FormCandidate]
) -> list[Fit]:
    """Explanations that have a form already, fitted with the form as given, all parameters together, with the
    derivatives at their start: a curve is linear in its coefficients, and what it does nearly so."""
    problem.follow_angles(True)
    works = []
    for one in tried:
        hypothesis, start = joined({**fit.parts, (one.form.id, one.side): one.start})
        fitter = _with_form(problem, fit, known, one)
        works.append(
            fitter.fitting(hypothesis, start, fit.z, fit.noise, STEPS, by_nuisance=fit.by_nuisance, chord=True)
        )
    fits = side_by_side(problem, works)
    problem.follow_angles(False)
    return [renewed(problem, one) for one in fits]
