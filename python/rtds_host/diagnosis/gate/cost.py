"""Time and memory of reading and gating a run of so many rows: `python -m rtds_host.diagnosis.gate.cost ROWS…`."""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from rtds_host.contract import RunLog, RunMeta, builtin_robot, builtin_robot_path, read_case, write_run
from rtds_host.diagnosis.gate import examine
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.plant.schema import OUTPUTS

# Numerical: a run to time the gate on, 100 Hz, a new voltage a second.
STEP_S, HOLD_ROWS, VOLTS, SEED = 0.01, 100, 6.0, 1


def record(folder: Path, rows: int) -> None:
    """Write a case of one run of the nominal burger, steps of a second at 100 Hz, every channel with its noise."""
    robot, rng = builtin_robot("burger"), np.random.default_rng(SEED)
    t = np.arange(rows) * STEP_S
    volts = np.repeat(rng.uniform(-VOLTS, VOLTS, (rows // HOLD_ROWS + 1, 2)), HOLD_ROWS, axis=0)[:rows]
    columns = {"v_cmd_l": volts[:, 0], "v_cmd_r": volts[:, 1]}
    out = replay_run(nominal_model(robot), run_inputs(RunLog("run", RunMeta(), t, columns), robot))
    for k, c in enumerate(OUTPUTS):
        columns[c] = out[:, k] + robot.known_noise(c) * rng.standard_normal(rows)
    (folder / "robot.toml").write_text(builtin_robot_path("burger").read_text())
    write_run(folder / "run", RunMeta(), {"t": t, **columns})


def main(counts: list[int]) -> None:
    """Print a line a count of rows; memory is the process's largest so far, so counts should rise."""
    print("| rows | csv, MB | read, s | gate, s | memory, MB |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        warm = Path(scratch) / "warm"
        warm.mkdir()
        record(warm, 1000)
        examine(read_case(warm))
        for rows in counts:
            folder = Path(scratch) / str(rows)
            folder.mkdir()
            record(folder, rows)
            size = (folder / "run" / "log.csv").stat().st_size / 1e6
            began = time.process_time()
            case = read_case(folder)
            read = time.process_time()
            examine(case)
            done = time.process_time()
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            print(f"| {rows} | {size:.3g} | {read - began:.2g} | {done - read:.2g} | {memory:.0f} |")


if __name__ == "__main__":
    main([int(float(count)) for count in sys.argv[1:]])
