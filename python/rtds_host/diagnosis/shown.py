"""Which effects of a diagnosis other runs of the same machine show: the gap with each and without it.

``python -m rtds_host.diagnosis.shown CASE diagnosis.json`` fits the diagnosis' effects to the case, all of them and
all but one. It prints one JSON object: effect and side -> [gap with all, gap without it].
With ``--all`` it prints the smallest gap that all leave, over whole runs: {"gap": gap}.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from rtds_host.contract import Case, read_case
from rtds_host.contract.runlog import read_json
from rtds_host.diagnosis.diagnose import taken
from rtds_host.diagnosis.fit import Fit, Fitter, joined
from rtds_host.diagnosis.gate import examine
from rtds_host.diagnosis.problem import Problem
from rtds_host.errors import InputError, RtdsError

# Numerical: steps of a fit.
STEPS = 12
Cause = tuple[str, str]


def cause_of(problem: Problem, entry: dict[str, Any]) -> Cause:
    """The effect and side, as the problem has them, of an effect's entry in a diagnosis.

    Raises
    ------
    InputError : this machine's catalogue does not have it.
    """
    effect = problem.effects.get(entry["id"])
    if effect is None:
        raise InputError(f"{entry['id']}: this machine has no such effect")
    return effect.id, "both" if problem.robot.axis is not None or not effect.sided else entry["side"]


def fit_of(problem: Problem, diagnosis: dict[str, Any]) -> Fit:
    """The explanation of a diagnosis of this program, fitted again from its values.

    Raises
    ------
    InputError : an effect that this machine's catalogue does not have.
    """
    parts = {}
    for entry in diagnosis["effects"]:
        cause = cause_of(problem, entry)
        scaled = []
        for p in problem.effects[cause[0]].parameters:
            name, _, unit = p.reported(problem.robot.axis)
            scaled.append(p.scaled(entry["parameters"][name]["value"] / unit))
        parts[cause] = np.array(scaled)
    return Fitter(problem).fit(*joined(parts), np.zeros(len(problem.nuisances)), problem.white(), STEPS)


def smallest_gap(case: Case, diagnosis: dict[str, Any]) -> float:
    """The smallest gap that the effects of a diagnosis leave over the whole runs of a case, with sizes fitted to it.

    The misfit has many local minima. So the sizes are first fitted by the likelihood, over whole runs and, of an axis,
    over pieces of them. From either they are fitted over whole runs by plain squares, and by the likelihood again.

    Returns
    -------
    Units of the declared noise.

    Raises
    ------
    InputError : an effect that this machine's catalogue does not have.
    """
    problem = Problem(case)
    starts = [problem, problem.in_pieces] if case.robot.axis is not None else [problem]
    fits = [fit for of in starts for fit in _refitted(problem, fit_of(of, diagnosis))]
    return min(problem.declared_gap(fit.model(problem)) for fit in fits)


def _refitted(problem: Problem, start: Fit) -> list[Fit]:
    """The effects of a fit fitted from its values by plain squares, and from there by the likelihood."""
    fitter, white = Fitter(problem), problem.white()
    plain = fitter.fit(start.hypothesis, start.u, start.z, white, STEPS, fixed=True)
    return [plain, fitter.fit(start.hypothesis, plain.u, plain.z, white, STEPS)]


def gaps_without(problem: Problem, diagnosis: dict[str, Any]) -> dict[Cause, tuple[float, float]]:
    """The gap with all effects of a diagnosis and the gap without each, both fitted to the problem's runs.

    Returns
    -------
    (id, side as the diagnosis has it) -> (gap with, gap without), in units of the declared noise.

    Raises
    ------
    InputError : an effect that this machine's catalogue does not have.
    """
    fit, fitter = fit_of(problem, diagnosis), Fitter(problem)
    left, found = problem.declared_gap(fit.model(problem)), {}
    for entry in diagnosis["effects"]:
        kept = {cause: u for cause, u in fit.parts.items() if cause != cause_of(problem, entry)}
        without = fitter.fit(*joined(kept), fit.z, fit.noise, STEPS)
        found[entry["id"], entry["side"]] = left, problem.declared_gap(without.model(problem))
    return found


def main(
    case: Annotated[Path, typer.Argument(help="The case folder.")],
    diagnosis: Annotated[Path, typer.Argument(help="A diagnosis.json of other runs.")],
    together: Annotated[bool, typer.Option("--all", help="Print the gap with all effects alone.")] = False,
) -> None:
    """Print the gap with and without each effect of a diagnosis, fitted to the runs of a case."""
    try:
        read = read_case(case)
        sound = taken(read, examine(read))
        answer: Any = read_json(diagnosis)
        if together:
            said: dict[str, Any] = {"gap": round(smallest_gap(sound, answer), 4)}
        else:
            found = gaps_without(Problem(sound, pieces=read.robot.axis is not None), answer)
            said = {" ".join(cause): [round(gap, 4) for gap in pair] for cause, pair in found.items()}
    except RtdsError as error:
        print("rtds: " + " ".join(str(error).split()), file=sys.stderr)
        raise typer.Exit(2) from error
    print(json.dumps(said))


if __name__ == "__main__":
    typer.run(main)
