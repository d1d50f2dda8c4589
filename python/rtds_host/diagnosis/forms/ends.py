"""Where a curve ends, which is one parameter of it more, and is judged on runs left out like the curve itself.

The screening knows a few quantiles of what a case's runs pass through. A bend or a jump of the term that is sought
rarely lies between two points of such a grid: it may lie beyond its end, or between the first two points. The ends of
the curve that was chosen are moved therefore, by factors of four, of two and then of the root of two, as long as
held-out runs gain by it clearly.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rtds_host.diagnosis.choice import HeldOutScore, pooled
from rtds_host.diagnosis.fit import Fit
from rtds_host.diagnosis.forms.curves import Form, put, shapes
from rtds_host.diagnosis.forms.screen import FormCandidate
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import nominal_model
from rtds_host.diagnosis.thresholds import MINOR_SHARE
from rtds_host.plant import forms as plant

# Fits explanations that differ in the ends of one curve, from a start of that curve's scaled coefficients each.
Fits = Callable[[Sequence[FormCandidate]], Sequence[Fit]]
# What other ends must leave at most of what is left: as other curves, all but a slight part.
GAINS = 1.0 - MINOR_SHARE
# Numerical: moves of the ends, in half octaves, coarse ones first: a jump shows only once it lies within the ends.
MOVES = (4, 2, 1)


def movable(form: Form) -> bool:
    """Whether a curve's ends are a guess: those of an angle, a time or a place are known."""
    return form.over not in plant.PERIODIC and form.low == -form.high


def moved(problem: Problem, candidate: FormCandidate, values: np.ndarray, factor: float) -> FormCandidate:
    """A form with other ends, and the coefficients that make the curve there that its values (POINTS,) make."""
    form = replace(candidate.form, low=factor * candidate.form.low, high=factor * candidate.form.high)
    model = nominal_model(problem.robot)
    put(model, (0,), form.term, form.over, candidate.form.low, candidate.form.high, values)
    there = np.array([plant.curve(model.forms[0, 0], x)[0] for x in form.points])
    basis, widths = shapes(form.over)
    coefficients = np.linalg.lstsq(basis, there, rcond=None)[0]
    return replace(candidate, form=form, start=coefficients / (form.prior_width * widths))


def with_ends(
    problem: Problem, fits: Fits, candidate: FormCandidate, best: HeldOutScore, reach: float
) -> tuple[FormCandidate, HeldOutScore]:
    """The form with the ends that leave least of runs left out, and the explanation with it.

    Parameters
    ----------
    best : the explanation with the form as it is; reach : the largest size of what the form runs over, beyond which no
        run says anything.
    """
    if not movable(candidate.form):
        return candidate, best
    at, seen = 0, {0}
    for move in MOVES:
        while True:
            values = _values(best.fit, candidate)
            near = [to for to in (at - move, at + move) if to not in seen]
            tried = [(to, moved(problem, candidate, values, math.sqrt(2.0) ** (to - at))) for to in near]
            tried = [(to, one) for to, one in tried if one.form.high <= 2.0 * reach]
            seen.update(near)
            if not tried:
                break
            fitted = fits([one for _, one in tried])
            judged = [(HeldOutScore.of(problem, fit), to, one) for (to, one), fit in zip(tried, fitted, strict=True)]
            least, to, one = min(judged, key=lambda each: each[0].gap)
            if pooled(least, best) > GAINS:
                break
            at, candidate, best = to, one, least
    return candidate, best


def _values(fit: Fit, candidate: FormCandidate) -> np.ndarray:
    """A form's values (POINTS,) in a fit, in the term's unit."""
    basis, widths = shapes(candidate.form.over)
    return basis @ (fit.parts[candidate.form.id, candidate.side] * candidate.form.prior_width * widths)
