"""Heats that forms may run over: their time constants, and how far a model's replays get.

A heat follows the square of a side's current (`plant.forms.warmed`). How fast is not known, so the screening tries a
few time constants and the chosen one is moved (`ends`).
"""

from __future__ import annotations

import numpy as np

from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import Model
from rtds_host.diagnosis.scales import scales_of
from rtds_host.diagnosis.thresholds import MAJORITY, MINOR_SHARE
from rtds_host.plant import forms as plant
from rtds_host.plant.schema import OUTPUT_INDEX

# Numerical: time constants that are tried, in shares of the longest run. A longer one only adds up what is dissipated,
# as that of half a run nearly does.
SHARES = (1.0 / 2.0, 1.0 / 8.0, 1.0 / 32.0)


def longest_run_s(problem: Problem) -> float:
    """The longest run, s."""
    return max(float(data.log.t[-1] - data.log.t[0]) for data in problem.whole)


def reach(problem: Problem, model: Model, tau: float) -> float:
    """The largest heat in a model's replays, A²; tau : s."""
    most = 0.0
    for data, out in zip(problem.runs_starting(model.start), problem.replay(model), strict=True):
        if np.abs(out).max() < 1e6:
            for side in problem.robot.sides:
                heats = plant.heats(data.inputs[0], out[:, OUTPUT_INDEX[f"i_{side}"]], tau)
                most = max(most, float(heats.max()))
    return most


def time_constants(problem: Problem, model: Model) -> list[tuple[float, float]]:
    """Time constants, s, of heats that a case can show, each with the largest heat, A².

    There is none where no winding is in the model, where runs are searched in parts, and of an axis, which is judged on
    pieces, too: how warm a part begins is not measured. What fades within a window of the gap is hardly a heat. Nor is
    what a current of half of a tenth of that at stall makes: a motor bears a tenth for ever.
    """
    robot = problem.robot
    if robot.driver.mode == "torque" or robot.axis is not None or problem.searched < 1.0:
        return []
    enough = MAJORITY * MINOR_SHARE * scales_of(robot, problem.case.runs).amps
    taus = [share * longest_run_s(problem) for share in SHARES]
    found = [(tau, reach(problem, model, tau)) for tau in taus if tau >= gaps.WINDOW_S]
    return [(tau, high) for tau, high in found if high >= enough**2]
