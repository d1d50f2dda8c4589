"""Which gap a planted change opens in measured data, how much of it an answer closes, and whether the machine's own
effects take it in.
"""

from __future__ import annotations

import json
import math
from functools import cached_property
from pathlib import Path

import numpy as np

from rtds_host.blind.gap import channel_gaps, total
from rtds_host.blind.measured_answer import Answer
from rtds_host.blind.score import pooled, predicted
from rtds_host.blind.seal import SHOWER
from rtds_host.cleanup import run_supervised, temporary_folder
from rtds_host.contract import Robot, load_robot, read_run
from rtds_host.errors import InputError

# A planted change counts as visible where it outweighs all that the machine leaves anyway: twice its mean square.
VISIBLE = math.sqrt(2.0)
# Seconds that a fit of a diagnosis to a case may take.
FIT_TIMEOUT_S = 900.0
# What is said of a planted change where no gap is measured.
UNKNOWN: dict[str, bool | float | None] = {"visible": None, "taken_in": None, "restored": None}


def carried_over(diagnosis: dict, base: Robot, planted: Robot) -> dict:
    """The base's answer for the planted robot: what it refitted of R, K, J and B is kept relative to what is
    declared.
    """
    fitted = {
        side: {key: value * getattr(planted.motor, key) / getattr(base.motor, key) for key, value in values.items()}
        for side, values in (diagnosis.get("nominal_fit") or {}).items()
    }
    return {**diagnosis, "nominal_fit": fitted}


class Gaps:
    """Gaps of the answers of one check.

    Parameters
    ----------
    out : folder of the check. truths, answers : by case, opened. command : replays a run with a diagnosis. fitter :
    prints the gap of a diagnosis' effects once they are fitted to a case.
    """

    def __init__(
        self,
        out: Path,
        truths: dict[str, dict],
        answers: dict[str, dict],
        command: list[str] | None = None,
        fitter: list[str] | None = None,
    ):
        self.out, self.truths, self.answers = out, truths, answers
        self.command, self.fitter = command, fitter or SHOWER
        self.bases = {truth["set"]: case for case, truth in truths.items() if truth["kind"] == "base"}

    @cached_property
    def rest(self) -> dict[str, float | str | None]:
        """What the untouched case of each data set leaves."""
        return {name: self.of(case, case) for name, case in self.bases.items()}

    @cached_property
    def _refitted_rest(self) -> dict[str, float | None]:
        """The same with its effects fitted again."""
        return {name: self._refitted(case, case) for name, case in self.bases.items() if case in self.answers}

    def of(self, case: str, answer_of: str) -> float | str | None:
        """The gap that the answer to a case leaves of another one of its data set: a number, the prediction's
        complaint, or None without an answer."""
        if answer_of not in self.answers:
            return None
        robots = [self.out / "public" / name / "robot.toml" for name in (answer_of, case)]
        held = self.out / "sealed" / case / "held-out"
        if case == answer_of:
            return _gap(robots[1], held, self.out / "answers" / case / "diagnosis.json", self.command)
        with temporary_folder() as scratch:
            carried = scratch / "diagnosis.json"
            carried.write_text(json.dumps(carried_over(self.answers[answer_of], *map(load_robot, robots))))
            return _gap(robots[1], held, carried, self.command)

    def judged(self, case: str) -> dict:
        """What a planted change opens and its answer leaves, and whether the change is visible and taken in."""
        truth = self.truths[case]
        base = self.bases[truth["set"]]
        opened, left, bottom = self.of(case, base), self.of(case, case), self.rest[truth["set"]]
        found = {"gap_base": bottom, "gap_opened": opened, "gap_left": left, **UNKNOWN}
        if isinstance(opened, float) and isinstance(bottom, float):
            found["visible"] = opened >= VISIBLE * bottom
            if found["visible"]:
                found["taken_in"] = self._taken_in(case, base)
            if found["visible"] and isinstance(left, float):
                found["restored"] = round((opened - left) / (opened - bottom), 4)
        return found

    def _taken_in(self, case: str, base: str) -> bool:
        """Whether the base's effects, with other sizes, leave hardly more of the planted case than of their own."""
        truth = self.truths[case]
        own = Answer(self.answers[base], truth["axis"])
        if any(own.on(want["id"], truth["side"]) for want in truth["same"]):
            return False  # another size is then what was planted
        now, then = self._refitted(case, base), self._refitted_rest[truth["set"]]
        return now is not None and then is not None and now < VISIBLE * then

    def _refitted(self, case: str, answer_of: str) -> float | None:
        """Gap of an answer's effects once their sizes are fitted to a case; None where that machine cannot have them.

        Raises
        ------
        InputError : the command failed by itself.
        """
        folder = self.out / "public" / case
        with temporary_folder() as scratch:
            path = scratch / "diagnosis.json"
            path.write_text(json.dumps(self.answers[answer_of]))
            ended = run_supervised([*self.fitter, str(folder), str(path), "--all"], FIT_TIMEOUT_S, scratch)
        if ended.returncode not in (0, 2):
            raise InputError(f"{folder}: {self.fitter[-1]} ended with status {ended.returncode}")
        return json.loads(ended.stdout)["gap"] if ended.returncode == 0 else None


def _runs(folder: Path) -> list[Path]:
    return sorted(p for p in folder.iterdir() if p.is_dir())


def _gap(robot_path: Path, held_out: Path, diagnosis: Path, command: list[str] | None) -> float | str:
    """Gap of a diagnosis on the withheld runs, or on the case's where none are: a number, or the prediction's
    complaint.
    """
    robot = load_robot(robot_path)
    gaps = []
    for folder in _runs(held_out) or _runs(robot_path.parent):
        run = read_run(folder, robot)
        columns = predicted(folder, robot_path, diagnosis, command)
        if isinstance(columns, str):
            return columns
        noise = {name: size for name in run.columns if (size := robot.noise(name))}
        columns.setdefault("yaw", np.zeros(len(run.t)))  # an axis has no heading
        gaps.append(channel_gaps(run.t, run.columns, columns, noise))
    return total(pooled(gaps))
