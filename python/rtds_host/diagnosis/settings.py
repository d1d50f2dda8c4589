"""The settings in which a machine was met: how fast, how loaded, which way, how late each block of time was, in a
replay.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import Model
from rtds_host.diagnosis.residual import RunData
from rtds_host.plant.schema import OUTPUT_INDEX


def _wheels(out: np.ndarray, quantity: str) -> np.ndarray:
    return out[:, [OUTPUT_INDEX[f"{quantity}_l"], OUTPUT_INDEX[f"{quantity}_r"]]]


def _command(data: RunData) -> np.ndarray:
    mode = "speed" if data.log.has("w_cmd_l") else "voltage"
    return np.abs(data.log.commands(mode)).sum(axis=1)


# Setting -> its value on each row of a run, from the run and its replay (n, 11); units do not matter, only the order
# does.
SETTINGS: dict[str, Callable[[RunData, np.ndarray], np.ndarray]] = {
    "speed": lambda data, out: np.abs(_wheels(out, "w")).sum(axis=1),
    "direction": lambda data, out: _wheels(out, "w").sum(axis=1),
    "turning": lambda data, out: np.abs(np.diff(_wheels(out, "w"), axis=1)[:, 0]),
    "acceleration": lambda data, out: np.abs(np.gradient(_wheels(out, "w"), data.log.t, axis=0)).sum(axis=1),
    "current": lambda data, out: np.abs(_wheels(out, "i")).sum(axis=1),
    "command": lambda data, out: _command(data),
    "uphill": lambda data, out: np.cos(out[:, OUTPUT_INDEX["yaw"]]),
    "across": lambda data, out: np.sin(out[:, OUTPUT_INDEX["yaw"]]),
    "time": lambda data, out: data.log.t - data.log.t[0],
}


def settings(problem: Problem, model: Model) -> dict[str, np.ndarray]:
    """Mean of each of `SETTINGS` in each block of time, (blocks,); "run": which run a block is of."""
    found: dict[str, list[np.ndarray]] = {name: [] for name in (*SETTINGS, "run")}
    for data, out, owner in zip(problem.runs, problem.replay(model), problem.owners):
        count = int(data.block.max(initial=-1)) + 1
        at = np.minimum(((data.log.t - data.log.t[0]) / problem.block_s + 1e-9).astype(int), max(count - 1, 0))
        rows = np.maximum(np.bincount(at, minlength=count)[:count], 1)
        for name, of in SETTINGS.items():
            found[name].append(np.bincount(at, of(data, out), minlength=count)[:count] / rows)
        found["run"].append(np.full(count, owner, float))
    return {name: np.concatenate(parts) for name, parts in found.items()}
