"""Processor time and memory of a diagnosis over the rows of one run: prints a table.

    python python/tests/reliability/rows.py

The run is the built-in robot's with friction on its left wheel, with noise; each row of the table is a process of its
own.
"""

import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

SIZES = ((10_000, 0.01), (100_000, 0.01), (1_000_000, 0.01), (1_000_000, 0.0005))


def measure(rows: int, step_s: float) -> str:
    """One line of the table."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "diagnosis"))
    from rtds_host.contract import Case, RunLog, RunMeta, builtin_robot
    from rtds_host.diagnosis.diagnose import diagnose
    from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
    from rtds_host.plant.schema import OUTPUTS

    robot = builtin_robot("burger")
    model = nominal_model(robot)
    model.put("coulomb", 0.02, (0,))
    rng = np.random.default_rng(1)
    t = np.arange(rows) * step_s
    held = (t / 0.8).astype(int)
    ahead, turn = rng.uniform(-6, 6, held[-1] + 1)[held], rng.uniform(-2, 2, held[-1] + 1)[held]
    columns = {"v_cmd_l": ahead + turn, "v_cmd_r": ahead - turn}
    out = replay_run(model, run_inputs(RunLog("long", RunMeta(), t, columns), robot))
    for k, channel in enumerate(OUTPUTS):
        columns[channel] = out[:, k] + robot.noise(channel) * rng.standard_normal(rows)
    del out
    began = time.process_time()
    diagnosis, _ = diagnose(Case("long", robot, (RunLog("long", RunMeta(), t, columns),)), quick=True, threads=1)
    spent = time.process_time() - began
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
    named = ", ".join(f"{e['id']} {e['side']}" for e in diagnosis["effects"])
    return f"| {rows:,} | {1 / step_s:g} Hz | {spent:.0f} s | {peak:.1f} GiB | {diagnosis['verdict']}: {named} |"


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(measure(int(sys.argv[1]), float(sys.argv[2])))
    else:
        print("| rows of one run | rate | processor time | peak memory | answer |\n|---|---|---|---|---|", flush=True)
        for rows, step_s in SIZES:
            subprocess.run([sys.executable, __file__, str(rows), str(step_s)], check=True)
