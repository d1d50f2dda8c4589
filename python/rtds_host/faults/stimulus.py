"""Signals of a file, played into the motor units' inputs at their own step."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rtds_host.contract.runlog import read_columns
from rtds_host.errors import InputError

# V at the motors, in place of what the controller asks for; N m at the motor shafts, added to the robot's load.
VOLTAGES, TORQUES = ("v_l", "v_r"), ("t_l", "t_r")


@dataclass(frozen=True)
class Stimulus:
    """Inputs over time; a row is held until the next one begins, the last to the end of the run.

    Attributes
    ----------
    path : the file. t_s : (n,) s, rising from 0 or later. values : column name -> (n,) float64, of `VOLTAGES` (V) and
        `TORQUES` (N m at the motor shaft, an opposing load positive). Before the first row nothing is played.
    """

    path: Path
    t_s: np.ndarray
    values: dict[str, np.ndarray]

    def __str__(self) -> str:
        return f"{self.path.name} played into {', '.join(self.values)}, {len(self.t_s)} rows"


def read_stimulus(path: Path) -> Stimulus:
    """A csv with the column `t`, s, and some of `v_l`, `v_r`, `t_l`, `t_r`.

    Raises
    ------
    InputError : it cannot be read, holds none of these columns, or a cell that is no finite number; names the row.
    """
    columns = read_columns(path, ("t", *VOLTAGES, *TORQUES))
    names = [name for name in (*VOLTAGES, *TORQUES) if name in columns]
    if "t" not in columns or not names:
        raise InputError(f"{path}: row 1: the columns t and some of {', '.join((*VOLTAGES, *TORQUES))} are needed")
    for name in names:
        bad = np.flatnonzero(~(np.abs(columns[name]) <= 3.4e38))
        if bad.size:
            raise InputError(f"{path}: row {bad[0] + 2}: {name} is missing, or not a finite number")
    if columns["t"][0] < 0.0:
        raise InputError(f"{path}: row 2: t is {columns['t'][0]:g} s, a run begins at 0")
    return Stimulus(path, columns["t"], {name: columns[name] for name in names})
