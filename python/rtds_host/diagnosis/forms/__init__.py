"""Forms: what has no name among effects, as curves in the equations that lack it (contract, section 5, `forms`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.choice import MAX_RESIDUAL_RATIO, HeldOutScore
from rtds_host.diagnosis.effects import CATALOGUE, SIDES
from rtds_host.diagnosis.fit import Fit, Fitter, joined
from rtds_host.diagnosis.forms.curves import Form, put, shapes, sides_of, written
from rtds_host.diagnosis.forms.fits import STEPS, Cause
from rtds_host.diagnosis.forms.formula import ENOUGH, fitted, laws, sharpened
from rtds_host.diagnosis.forms.horizons import searched_over_both
from rtds_host.diagnosis.forms.search import Found, closes, curves_of_superseded, values_of
from rtds_host.diagnosis.left_out import left_out_in_few_steps, parted
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import REPORT_STEP_S, Model, replay_run
from rtds_host.diagnosis.report.words import OVER_WORDS, TERM_WORDS, effect_name
from rtds_host.diagnosis.thresholds import MINOR_SHARE
from rtds_host.plant import forms as plant


@dataclass
class Forms:
    """Forms of a case as a diagnosis has them: `entries`; `gap` on runs left out with them, None without any; `left`:
    the gap before the first and behind each, at the search's steps; `notes`; `fit`: effects, tolerances and forms as
    they were fitted together to `problem`, None without any form; `superseded`: named effects that the forms
    supersede."""

    entries: list[dict] = field(default_factory=list)
    gap: float | None = None
    left: list[float] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    fit: Fit | None = None
    problem: Problem | None = None
    superseded: tuple[Cause, ...] = ()

    def leaves(self, after: float) -> float:
        """The gap on runs left out with forms, or that with effects alone, `after`, where there is none."""
        return after if self.gap is None else self.gap

    def shared(self, rows: list[dict], after: float) -> list[dict]:
        """The contract's `budget` with forms: what they close is taken off what was left without a name."""
        if not self.entries or self.gap is None or after**2 <= 1.0:
            return rows
        kept = min(max(self.gap**2 - 1.0, 0.0) / (after**2 - 1.0), 1.0)
        residual = sum(row["share"] for row in rows if row["what"] == "rest")
        steps = [max(a**2 - b**2, 0.0) for a, b in zip(self.left, self.left[1:])]
        if not any(steps):  # what they close together, none of them closes by itself
            steps = [1.0] * len(self.entries)
        mine = [
            {
                "what": "form",
                **{key: entry[key] for key in ("term", "side", "over")},
                "share": residual * (1.0 - kept) * step / sum(steps),
            }
            for entry, step in zip(self.entries, steps, strict=True)
        ]
        others = [row for row in rows if row["what"] != "rest"]
        return [*others, *mine, *({**row, "share": kept * row["share"]} for row in rows if row["what"] == "rest")]


def forms_of(
    problem: Problem, fit: Fit, after: float, quick: bool, lacking: Mapping[Cause, Fit] | None = None
) -> Forms:
    """Look for forms in what an explanation leaves.

    Parameters
    ----------
    fit : the explanation that a diagnosis names; after : its gap on runs left out, as reported; lacking : the
        explanation without each effect that a form may supersede.
    """
    given = problem
    problem, found = searched_over_both(given, fit, quick, lacking)
    if not found.forms:
        return Forms(notes=found.notes)
    # Forms have few steps without each run, so they are compared with what names leave by as many.
    gap, after = reported_gap(problem, found.fit), min(after, reported_gap(given, fit))
    # The reported gap has to meet the criterion, too: the search scores runs left out at longer steps.
    if gap >= after or (after >= gaps.LEAST and gap**2 - 1.0 > MAX_RESIDUAL_RATIO * (after**2 - 1.0)):
        return Forms(notes=found.notes)
    notes = [*found.notes, *_superseded_notes(problem, found)]
    refuted = curves_of_superseded(found)
    if found.superseded:
        # What curves close is a share of what the names that are left leave.
        named = found.judged[0].fit
        kept = {cause: u for cause, u in named.parts.items() if cause not in found.superseded}
        bare = Fitter(problem, named.start).fit(*joined(kept), named.z, named.noise, STEPS)
        found.judged[0] = HeldOutScore.in_few_steps(problem, bare)
    entries = [
        _entry(problem, found, form, side, share, refuted.get(form.id, []))
        for (form, side), share in zip(found.forms, closes(found), strict=True)
    ]
    left = [judged.gap for judged in found.judged]
    said = notes + approximate(problem, found)
    return Forms(entries, gap, left, said, found.fit, problem, tuple(found.superseded))


def _superseded_notes(problem: Problem, found: Found) -> list[str]:
    """Notes on named effects that curves supersede."""
    curves = " and ".join(f"{TERM_WORDS[form.term]} over {OVER_WORDS[form.over]}" for form, _ in found.forms)
    return [
        f"{_name(problem, cause)} is superseded by a free curve, {curves}: with the curve and without this effect the "
        f"gap on held-out runs is {found.judged[-1].gap:.3g}, with the effect alone {found.judged[0].gap:.3g}"
        for cause in found.superseded
    ]


def _name(problem: Problem, cause: Cause) -> str:
    return effect_name({"id": cause[0], "side": problem.effects[cause[0]].side_on(problem.robot.axis, cause[1])})


def approximate(problem: Problem, found: Found) -> list[str]:
    """What is said of named effects that are approximations: those in whose own equation a free curve leaves clearly
    less. With the effect or in its place makes no difference, since the effect is one of the curve's shapes."""
    said = []
    for (form, side), before, after in zip(found.forms, found.judged, found.judged[1:]):
        for name, own in before.fit.hypothesis:
            if (name, own) in found.superseded:
                continue
            resembles = CATALOGUE[name].resembles if name in CATALOGUE else ()
            if (form.term, form.over) in resembles and set(SIDES[own]) & set(SIDES[side]):
                curve = f"{TERM_WORDS[form.term]} over {OVER_WORDS[form.over]}"
                said.append(
                    f"{_name(problem, (name, own))} is approximate: with a free curve in its place, {curve}, "
                    f"the gap on held-out runs is {after.gap:.3g} and not {before.gap:.3g}"
                )
    return said


def reported_gap(problem: Problem, fit: Fit) -> float:
    """The gap of an explanation on runs left out in turn by few steps, at the replay steps of what is reported (see
    `heldout`).

    Curves are linear in their coefficients, which few steps find. On to convergence without a run, they leave more
    of it than of runs that no search saw (docs/decisions.md).
    """
    parts = parted(problem)
    models = iter(left_out_in_few_steps(problem, fit, [rows for mine in parts for *_, rows in mine])[0])
    step = min(REPORT_STEP_S, fit.model(problem).step_s)
    squares = []
    for data, mine in zip(problem.whole_runs_starting(fit.start), parts, strict=True):
        for first, last, _ in mine:
            out = replay_run(next(models), data.inputs, step)[first:last]
            errors = gaps.errors(data.log.rows(first, last), problem.declared, out)
            squares.append({channel: gaps.squares(error) for channel, error in errors.items()})
    return gaps.gap(gaps.pooled(squares))


def _entry(problem: Problem, found: Found, form: Form, side: str, share: float, refuted: Sequence[np.ndarray]) -> dict:
    """A form as a diagnosis has it; share : what it closes; refuted : curves (points,) that are no formula of it."""
    values, covariance = values_of(found.fit, form, side)
    basis, _ = shapes(form.over)
    errors = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", basis, covariance, basis), 0.0))
    entry: dict[str, Any] = {
        "term": form.term,
        "side": side if problem.robot.axis is None else "left",
        "over": form.over,
        "units": list(form.units),
        **({"time_constant": float(f"{form.tau:.4g}")} if form.tau else {}),
        "curve": written(form, values, errors),
        "formula": None,
        "parameters": {},
        "closes": float(f"{share:.4g}"),
    }

    def left(one: Form, curve: np.ndarray) -> float:
        return problem.gap(_with(problem, found.fit, one, side, curve))

    with_curve, without = left(form, values), left(form, np.zeros(len(form.points)))
    most = MAX_RESIDUAL_RATIO * (with_curve**2 - 1.0)
    for law in laws(form.over):
        formula = fitted(law, form, values, covariance)
        if formula is None or not np.isfinite(formula.curve).all():
            continue
        if any(alike(formula.curve, curve) for curve in refuted):
            continue
        if without - left(form, formula.curve) >= ENOUGH * (without - with_curve):
            sharp = sharpened(formula, form, left)
            if sharp is not None and left(sharp[1], sharp[0].curve) ** 2 - 1.0 <= most:
                # A free curve cannot hold the jump.
                formula, near = sharp
                entry["curve"] = written(near, formula.curve, np.interp(near.points, form.points, errors))
            return {**entry, "formula": law.text, "parameters": formula.entry()}
    return entry


def alike(curve: np.ndarray, other: np.ndarray) -> bool:
    """Whether a curve (n,) is another one times a factor, but for a slight part of its square."""
    missed = curve - other * (curve @ other) / max(float(other @ other), 1e-300)
    return float(missed @ missed) <= MINOR_SHARE * float(curve @ curve)


def _with(problem: Problem, fit: Fit, form: Form, side: str, values: np.ndarray) -> Model:
    """A fit's model with other values of one of its forms."""
    model = fit.model(problem)
    for k in sides_of(side):
        rows = model.forms[k]
        mine = (rows[:, plant.TERM] == plant.TERM_CODE[form.term]) & (rows[:, plant.OVER] == plant.OVER_CODE[form.over])
        rows[mine] = 0.0
    put(model, sides_of(side), form.term, form.over, form.low, form.high, values, form.tau)
    return model
