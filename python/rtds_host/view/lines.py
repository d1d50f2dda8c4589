"""What the page draws of a run: a few layers (measured, nominal, corrected) of columns over time."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rtds_host.contract import Robot, RunLog
from rtds_host.diagnosis.predict import predicted_columns
from rtds_host.diagnosis.replay.model import Model

# Layout: rows that a line keeps; more than a screen has pixels.
ROWS = 1500
# Layout: significant digits of a figure on the page.
DIGITS = 7
COLUMNS = (
    "x",
    "y",
    "yaw",
    "w_l",
    "w_r",
    "w_ref_l",
    "w_ref_r",
    "i_l",
    "i_r",
    "v_cmd_l",
    "v_cmd_r",
    "w_cmd_l",
    "w_cmd_r",
)


def figure(value: float) -> float | None:
    """A figure as JSON takes it: rounded, None where it is no number."""
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None


@dataclass
class Lines:
    """A run as the page takes it.

    layers : layer ("measured", "nominal", "corrected") -> column -> values, all of one layer as long as its "t" (s,
    from the run's start). done : whether nothing more comes.
    """

    name: str
    robot: str
    layers: dict[str, dict[str, list[float | None]]] = field(default_factory=dict)
    done: bool = True

    def json(self, since: int = 0) -> dict[str, Any]:
        """The run from row `since` of its first layer on; a layer that is complete is given whole at 0 only."""
        layers = {
            layer: {name: values[since:] for name, values in columns.items()} for layer, columns in self.layers.items()
        }
        return {"name": self.name, "robot": self.robot, "done": self.done, "since": since, "layers": layers}


def _layer(columns: dict[str, np.ndarray], t: np.ndarray, rows: np.ndarray) -> dict[str, list[float | None]]:
    kept = {"t": [figure(v) for v in (t[rows] - t[0]).tolist()]}
    for name in COLUMNS:
        if name in columns and np.isfinite(columns[name]).any():
            kept[name] = [figure(v) for v in columns[name][rows].tolist()]
    return kept


def lines_of_run(log: RunLog, robot: Robot | None = None, corrected: Model | None = None) -> Lines:
    """A recorded run, with replays next to it.

    Parameters
    ----------
    robot : the nominal robot, for a replay of the commands; None shows what was measured alone.
    corrected : the robot with a diagnosis in it, for a second replay.

    Raises
    ------
    InputError : the model's body cannot exist.
    """
    rows = np.unique(np.linspace(0, len(log.t) - 1, min(ROWS, len(log.t))).round().astype(int))
    lines = Lines(log.name, robot.name if robot is not None else "")
    lines.layers["measured"] = _layer(log.columns, log.t, rows)
    if robot is not None:
        lines.layers["nominal"] = _layer(predicted_columns(log, robot), log.t, rows)
        if corrected is not None:
            lines.layers["corrected"] = _layer(predicted_columns(log, robot, corrected), log.t, rows)
    return lines
