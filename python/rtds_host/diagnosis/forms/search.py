"""The search for forms: what named effects leave, as curves in the equations that lack something.

One form is taken after the other, at most three. Derivatives say which are worth a fit; fits say what each leaves of
runs left out, and that decides, as it does between effects (`choice`). So the equation is that which foretells other
runs, and not the one with the largest residual.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.choice import AS_MUCH, WORTH, Judged, pooled
from rtds_host.diagnosis.effects import RESEMBLES, Effect
from rtds_host.diagnosis.fit import Fit, Fitter, joined, parameters
from rtds_host.diagnosis.forms.candidates import candidates
from rtds_host.diagnosis.forms.curves import Form, shapes
from rtds_host.diagnosis.forms.screen import Promise, screened
from rtds_host.diagnosis.problem import Problem
from rtds_host.plant import forms as plant

# What counts as a gap (contract, section 4).
LEAST_GAP = gaps.LEAST
# Numerical: forms that are fitted in earnest at each turn, in a narrow search and in a wide one, and steps of a fit.
TRIED = {True: 3, False: 6}
STEPS = 6
# Numerical: s of processor time after which no further form is looked for, with a narrow search and with a wide one.
SPENT_S = {True: 15.0, False: 90.0}


@dataclass
class Found:
    """Forms of a case, in the order in which they were found: `judged` holds the explanation without any and with one
    after the other. `notes`: what else is to be said."""

    judged: list[Judged]
    forms: list[tuple[Form, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def fit(self) -> Fit:
        """The fit with all forms."""
        return self.judged[-1].fit


def searched(problem: Problem, fit: Fit, quick: bool) -> Found:
    """Forms of what an explanation leaves."""
    began = time.process_time()
    found = Found([Judged.of(problem, fit)])
    known: dict[str, Effect] = dict(fit.effects)
    while len(found.forms) < plant.MOST_FORMS and found.judged[-1].gap >= LEAST_GAP:
        if time.process_time() - began > SPENT_S[quick]:
            break
        best = _next(problem, found, known, quick)
        if best is None:
            break
        promise, judged = best
        found.forms.append((promise.form, promise.side))
        found.judged.append(judged)
    return found


def _next(problem: Problem, found: Found, known: dict[str, Effect], quick: bool) -> tuple[Promise, Judged] | None:
    """The form more that leaves least of runs left out, if it is worth it and no effect makes it as well."""
    now = found.judged[-1]
    taken = {(form.term, form.over) for form, _ in found.forms}
    problem.follow_angles(True)
    forms = [form for form in candidates(problem, now.fit.model(problem)) if (form.term, form.over) not in taken]
    promises = [one for one in screened(problem, now.fit, forms) if one.left < 1.0][: TRIED[quick]]
    # By the likelihood what acts often is seen, by plain squares what is large.
    also = screened(problem, replace(now.fit, noise=problem.white()), forms)
    mine = {(one.form.id, one.side) for one in promises}
    promises += [one for one in also[: TRIED[quick]] if (one.form.id, one.side) not in mine and one.left < 1.0]
    fits = [_fitted(problem, now.fit, known, one) for one in promises]
    problem.follow_angles(False)
    tried = [
        (one, Judged.of(problem, _renewed(problem, fit)))
        for one, fit in zip(promises, fits, strict=True)
        if fit.score < now.fit.score
    ]
    if not tried:
        return None
    promise, judged = min(tried, key=lambda pair: pair[1].gap)
    if pooled(judged, now) > WORTH:
        return None
    name = _named(problem, now, judged, promise)
    if name is not None:
        # Another equation's curve would then stand in for an effect that has a name.
        found.notes.append(f"{promise.form.term} over {promise.form.over}: {name} makes it as well, and is no form")
        return None
    known[promise.form.id] = promise.form.effect()
    return promise, judged


def _renewed(problem: Problem, fit: Fit) -> Fit:
    """A fit with the residuals that it has where nothing follows measured angles."""
    return replace(fit, residual=problem.residual(fit.model(problem)))


def _fitted(problem: Problem, fit: Fit, known: Mapping[str, Effect], one: Promise) -> Fit:
    """An explanation with one form more, all parameters fitted together."""
    fitter = Fitter(problem, fit.start)
    fitter.effects = {**known, one.form.id: one.form.effect()}
    hypothesis, start = joined({**fit.parts, (one.form.id, one.side): one.start})
    return fitter.fit(hypothesis, start, fit.z, fit.noise, STEPS, by_nuisance=fit.by_nuisance)


def _named(problem: Problem, now: Judged, judged: Judged, promise: Promise) -> str | None:
    """The effect of the catalogue that does on runs left out what a form does, None without any."""
    fitter = Fitter(problem, now.fit.start)
    fitter.effects = dict(now.fit.effects)
    for name in RESEMBLES.get((promise.form.term, promise.form.over), ()):
        effect = fitter.effects.get(name)
        side = promise.side if effect is not None and effect.sided else "both"
        if effect is None or any(cause[0] == name for cause in now.fit.hypothesis):
            continue
        for first in effect.parameters[0].starts[:2]:
            start = np.array([p.scaled(first if p is effect.parameters[0] else p.starts[0]) for p in effect.parameters])
            hypothesis, u = joined({**now.fit.parts, (name, side): start})
            fit = fitter.fit(hypothesis, u, now.fit.z, now.fit.noise, STEPS, by_nuisance=now.fit.by_nuisance)
            if Judged.of(problem, fit).gap <= AS_MUCH * judged.gap:
                return name
    return None


def values_of(fit: Fit, form: Form, side: str) -> tuple[np.ndarray, np.ndarray]:
    """A form's values (POINTS,) in a fit, in the term's unit, and the covariance (n, n) of its coefficients in SI."""
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
