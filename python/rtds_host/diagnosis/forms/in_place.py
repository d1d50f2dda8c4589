"""A named effect next to a free curve in its place: what each leaves on runs left out, and a picture of the curve.

rtds diagnose CASE --out said --quick
python -m rtds_host.diagnosis.forms.in_place CASE said/diagnosis.json coulomb_friction --out friction.png
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from rtds_host.contract import check_writable_file, read_case
from rtds_host.contract.runlog import read_json
from rtds_host.diagnosis.choice import MAX_RESIDUAL_RATIO, HeldOutScore, pooled
from rtds_host.diagnosis.diagnose import taken
from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.fit import Fit, Fitter, Hypothesis, joined
from rtds_host.diagnosis.forms.candidates import candidates
from rtds_host.diagnosis.forms.curves import Form, shapes, written
from rtds_host.diagnosis.forms.picture import draw
from rtds_host.diagnosis.forms.screen import screened, slopes
from rtds_host.diagnosis.forms.search import values_of
from rtds_host.diagnosis.gate import examine
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.shown import STEPS, fit_of
from rtds_host.errors import InputError, RtdsError


@dataclass(frozen=True)
class InPlace:
    """An explanation with an effect, and with a free curve in its place, as each leaves runs left out."""

    form: Form
    side: str
    named: HeldOutScore
    curved: HeldOutScore

    @property
    def approximate(self) -> bool:
        """Whether the curve leaves clearly less than the effect."""
        return pooled(self.curved, self.named) <= MAX_RESIDUAL_RATIO

    def entry(self) -> dict[str, Any]:
        """The curve as a diagnosis has a form."""
        values, covariance = values_of(self.curved.fit, self.form, self.side)
        basis, _ = shapes(self.form.over)
        errors = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", basis, covariance, basis), 0.0))
        axis = self.curved.problem.robot.axis
        return {
            "term": self.form.term,
            "side": self.side if axis is None else "left",
            "over": self.form.over,
            "units": list(self.form.units),
            "curve": written(self.form, values, errors),
            "formula": None,
        }


def in_place(problem: Problem, fit: Fit, name: str) -> InPlace:
    """Fit a free curve in the place of a named effect.

    Parameters
    ----------
    fit : an explanation with the effect; name : its id. The curve is of the first term and quantity that the effect
        resembles, on the effect's side.

    Raises
    ------
    InputError : the explanation has no such effect, or the effect is no curve of one quantity.
    """
    mine = [cause for cause in fit.hypothesis if cause[0] == name]
    if not mine:
        raise InputError(f"{name}: the diagnosis does not name it")
    named = HeldOutScore.in_few_steps(problem, fit)
    without: Hypothesis = tuple(cause for cause in fit.hypothesis if cause != mine[0])
    fitter = Fitter(problem, fit.start)
    parts = {cause: u for cause, u in fit.parts.items() if cause in without}
    bare = fitter.fit(*joined(parts), fit.z, fit.noise, STEPS)
    forms = [
        form for form in candidates(problem, fit.model(problem)) if (form.term, form.over) in CATALOGUE[name].resembles
    ]
    if not forms:
        raise InputError(f"{name}: no free curve over one quantity takes its place")
    known = slopes(problem, bare, forms[:1])
    candidate = next(one for one in screened(problem, bare, known) if one.side == mine[0][1])
    fitter.effects = {**problem.effects, candidate.form.id: candidate.form.effect()}
    hypothesis, start = joined({**bare.parts, (candidate.form.id, candidate.side): candidate.start})
    curved = fitter.fit(hypothesis, start, bare.z, bare.noise, STEPS)
    return InPlace(candidate.form, candidate.side, named, HeldOutScore.in_few_steps(problem, curved))


def main(
    case: Annotated[Path, typer.Argument(help="The case folder.")],
    diagnosis: Annotated[Path, typer.Argument(help="Its diagnosis.json.")],
    effect: Annotated[str, typer.Argument(help="The named effect, such as coulomb_friction.")],
    out: Annotated[Path, typer.Option(help="Picture to write, such as friction.png.")],
) -> None:
    """Compare a named effect with a free curve in its place, and draw the curve."""
    try:
        check_writable_file(out)
        read = read_case(case)
        problem = Problem(taken(read, examine(read)), pieces=read.robot.axis is not None)
        answer: Any = read_json(diagnosis)
        found = in_place(problem, fit_of(problem, answer), effect)
        draw([found.entry()], out)
    except RtdsError as error:
        print("rtds: " + " ".join(str(error).split()), file=sys.stderr)
        raise typer.Exit(2) from error
    said = "is approximate" if found.approximate else "describes it as well as the curve does"
    print(
        f"gap on runs left out: with {effect} {found.named.gap:.3g}, with the curve {found.curved.gap:.3g}: it {said}"
    )


if __name__ == "__main__":
    typer.run(main)
