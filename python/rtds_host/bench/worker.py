"""One loop of one source tree, timed on request: `against` runs this file with that tree's package on the path.

    worker.py STEP_CLOCKS EXCHANGE_STEPS EFFECTS

Writes a line when the link is open. Each line that comes in is a number of seconds; the answer is a line with the steps
made, the clocks and the processor time of the simulator. Only what every tree since the effect unit has is used here.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import numpy as np

from rtds_host.bench.measure import STEP_S, set_burger
from rtds_host.link.rtl import RtlLink
from rtds_host.motor.effects import Curve, UnitEffects


def processor_s(pid: int) -> float:
    """Processor time of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main(step_clocks: str, exchange_steps: int, effects: bool) -> None:
    """Serve until the input ends."""
    rng = np.random.default_rng(0)
    with RtlLink(sim="verilator", step_clocks=step_clocks if step_clocks == "min" else int(step_clocks)) as link:
        if effects:
            level = Curve((0.0, 0.0), (1e-4, 1e-4))  # N·m at the motor's shaft, at any speed
            unit = UnitEffects(friction_forward=level, friction_backward=level)
            link.set_effects(unit, unit, None)
        set_burger(link)
        link.exchange([0.0, 0.0], [0.0, 0.0], 10 * STEP_S)
        print("open", flush=True)
        for line in sys.stdin:
            clocks, cpu, start, steps = link.clocks, processor_s(link.pid), time.perf_counter(), 0
            while time.perf_counter() - start < float(line):
                link.exchange(
                    rng.uniform(-12.0, 12.0, 2), rng.uniform(-1e-3, 1e-3, 2), exchange_steps * STEP_S, 100 * STEP_S
                )
                steps += exchange_steps
            print(steps, link.clocks - clocks, processor_s(link.pid) - cpu, flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), bool(int(sys.argv[3])))
