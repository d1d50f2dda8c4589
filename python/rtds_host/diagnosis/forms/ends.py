"""Where a curve ends, or how slow its heat is: one parameter more, judged on runs left out like the curve itself.

The screening knows a few quantiles of what a case's runs pass through. A bend or a jump of the term that is sought
rarely lies between two points of such a grid: it may lie beyond its end, or between the first two points. The ends of
the curve that was chosen are moved therefore, by factors of four, of two and then of the root of two, as long as
held-out runs gain by it clearly. So is the time constant of a heat, whose ends follow from it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.choice import HeldOutScore, pooled
from rtds_host.diagnosis.fit import Fit
from rtds_host.diagnosis.forms.curves import Form, put, shapes
from rtds_host.diagnosis.forms.screen import FormCandidate
from rtds_host.diagnosis.forms.warmth import longest_run_s, reach
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import Model, nominal_model
from rtds_host.diagnosis.thresholds import MINOR_SHARE
from rtds_host.plant import forms as plant

# Fits explanations that differ in the ends of one curve, from a start of that curve's scaled coefficients each.
Fits = Callable[[Sequence[FormCandidate]], Sequence[Fit]]
# A form, fitted, with what is a guess of it times a factor; None beyond what the runs show.
Moves = Callable[[FormCandidate, Fit, float], FormCandidate | None]
# What other ends must leave at most of what is left: as other curves, all but a slight part.
GAINS = 1.0 - MINOR_SHARE
# Numerical: moves of the ends and of a time constant, in half octaves, coarse ones first: a jump shows only once it is
# within the ends.
MOVES, TAU_MOVES = (4.0, 2.0, 1.0), (4.0, 2.0, 1.0, 0.5)


def movable(form: Form) -> bool:
    """Whether a curve's ends are a guess, or how slow its heat is: those of an angle, a time or a place are known."""
    return form.tau > 0.0 or (form.over not in plant.PERIODIC and form.low == -form.high)


def moved(problem: Problem, candidate: FormCandidate, values: np.ndarray, factor: float) -> FormCandidate:
    """A form with other ends, and the coefficients that make the curve there that its values (points,) make."""
    form = replace(candidate.form, low=factor * candidate.form.low, high=factor * candidate.form.high)
    model = nominal_model(problem.robot)
    put(model, (0,), form.term, form.over, candidate.form.low, candidate.form.high, values)
    there = np.array([plant.curve(model.forms[0, 0], x)[0] for x in form.points])
    basis, widths = shapes(form.over)
    coefficients = np.linalg.lstsq(basis, there, rcond=None)[0]
    return replace(candidate, form=form, start=coefficients / (form.prior_width * widths))


def moves_of(problem: Problem, model: Model, forms: Sequence[Form], form: Form) -> Moves:
    """How a form is moved.

    Parameters
    ----------
    model : whose replays say how far heats get; forms : all that were tried, whose ends say how far its quantity gets.
    """
    if form.tau > 0.0:
        slowest = longest_run_s(problem)

        def slower(one: FormCandidate, fit: Fit, factor: float) -> FormCandidate | None:
            tau = factor * one.form.tau
            if not gaps.WINDOW_S <= tau <= slowest:
                return None
            warm = replace(one.form, tau=tau, high=reach(problem, model, tau))
            # The same curve over shares of its range.
            return replace(one, form=warm, start=fit.parts[one.form.id, one.side])

        return slower
    farthest = max(each.high for each in forms if each.over == form.over)

    def wider(one: FormCandidate, fit: Fit, factor: float) -> FormCandidate | None:
        # Beyond what is reached no run says anything.
        return moved(problem, one, _values(fit, one), factor) if factor * one.form.high <= 2.0 * farthest else None

    return wider


def with_ends(
    problem: Problem, fits: Fits, candidate: FormCandidate, best: HeldOutScore, moves: Moves
) -> tuple[FormCandidate, HeldOutScore]:
    """The form with the ends that leave least of runs left out, and the explanation with it.

    best : the explanation with the form as it is; moves : see `moves_of`.
    """
    if not movable(candidate.form):
        return candidate, best
    at, seen = 0.0, {0.0}
    for move in TAU_MOVES if candidate.form.tau else MOVES:
        while True:
            near = [to for to in (at - move, at + move) if to not in seen]
            moved_by = [(to, moves(candidate, best.fit, math.sqrt(2.0) ** (to - at))) for to in near]
            tried = [(to, one) for to, one in moved_by if one is not None]
            seen.update(near)
            if not tried:
                break
            fitted = fits([one for _, one in tried])
            judged = [
                (HeldOutScore.in_few_steps(problem, fit), to, one) for (to, one), fit in zip(tried, fitted, strict=True)
            ]
            least, to, one = min(judged, key=lambda each: each[0].gap)
            if pooled(least, best) > GAINS:
                break
            at, candidate, best = to, one, least
    return candidate, best


def _values(fit: Fit, candidate: FormCandidate) -> np.ndarray:
    """A form's values (points,) in a fit, in the term's unit."""
    basis, widths = shapes(candidate.form.over)
    return basis @ (fit.parts[candidate.form.id, candidate.side] * candidate.form.prior_width * widths)
