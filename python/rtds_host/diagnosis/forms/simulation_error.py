"""The simulation error of a whole run, in the units in which system-identification benchmarks give it.

rtds diagnose CASE --out said
python -m rtds_host.diagnosis.forms.simulation_error CASE/RUN --robot CASE/robot.toml --diagnosis said/diagnosis.json

The run is simulated from its commands and its first state alone. Of each channel: the root mean square of the error in
the channel's unit, that over the channel's standard deviation, and the relative error ||y - s|| / ||y||. A linear axis
also has its position, in mm.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from rtds_host.contract import Robot, RunLog, load_robot, read_run
from rtds_host.diagnosis.predict import predicted_columns, read_diagnosis
from rtds_host.diagnosis.replay.model import Model
from rtds_host.diagnosis.report.words import number
from rtds_host.errors import RtdsError

HEAD = ("channel", "RMSE", "RMSE / standard deviation", "relative error, %")
UNITS = {"v": "V", "i": "A", "w": "rad/s", "t": "rad", "g": "rad/s", "x": "m", "y": "m"}


def channels(log: RunLog, robot: Robot, model: Model | None = None) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Measured and simulated values, (n,) each, by channel with its unit; rows that were not measured are left out.

    Parameters
    ----------
    model : the robot with a diagnosis in it, by default the nominal one.
    """
    simulated = predicted_columns(log, robot, model)
    found = {}
    for name, values in log.columns.items():
        if name not in simulated or "cmd" in name:
            continue
        there = np.isfinite(values)
        unit = "rad" if name == "yaw" else UNITS[name[0]]
        found[f"{name}, {unit}"] = values[there], simulated[name][there]
        if name == "th_l" and robot.axis is not None and robot.axis.kind == "linear":
            scale = 1e3 * robot.axis.metres_per_rad
            found["position, mm"] = scale * values[there], scale * simulated[name][there]
    return found


def errors(measured: np.ndarray, simulated: np.ndarray) -> tuple[float, float, float]:
    """RMSE, that over the standard deviation of what was measured, and the relative error in per cent; (n,) each."""
    off = measured - simulated
    rmse = float(np.sqrt(np.mean(off**2)))
    return rmse, rmse / float(np.std(measured)), 100.0 * float(np.linalg.norm(off) / np.linalg.norm(measured))


def table(found: dict[str, tuple[np.ndarray, np.ndarray]]) -> str:
    """Errors by channel, in Markdown."""
    rows = [(name, *(number(value) for value in errors(*pair))) for name, pair in found.items() if np.ptp(pair[0]) > 0]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [HEAD, ("---",) * len(HEAD), *rows])


def main(
    run: Annotated[Path, typer.Argument(help="The run's folder.")],
    robot: Annotated[Path, typer.Option(help="The robot's file.")],
    diagnosis: Annotated[Path | None, typer.Option(help="A diagnosis; without one the nominal robot.")] = None,
) -> None:
    """Print how far a simulation is off a measured run."""
    try:
        machine = load_robot(robot)
        model = None if diagnosis is None else read_diagnosis(diagnosis, machine)
        print(table(channels(read_run(run, machine), machine, model)))
    except RtdsError as error:
        print("rtds: " + " ".join(str(error).split()), file=sys.stderr)
        raise typer.Exit(2) from error


if __name__ == "__main__":
    typer.run(main)
