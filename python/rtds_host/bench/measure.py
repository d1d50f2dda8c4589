"""The measurements. All loops are closed ones as in a run: inputs change at each exchange, samples every ms."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rtds_host.contract import builtin_robot
from rtds_host.link import Link
from rtds_host.link.rtl import RtlLink
from rtds_host.motor import MotorPair
from rtds_host.motor.effects import Curve, UnitEffects

STEP_S = 1e-5
_LEVEL = Curve((0.0, 0.0), (1e-4, 1e-4))  # N·m at the motor's shaft, at any speed
DRY = UnitEffects(friction_forward=_LEVEL, friction_backward=_LEVEL)
TICKS_PER_S = os.sysconf("SC_CLK_TCK")  # unit of the times in /proc/<pid>/stat


@dataclass(frozen=True)
class LoopFigure:
    """Speed of one loop.

    Attributes
    ----------
    steps : simulation steps made (each of both motors).
    clocks : clocks simulated; 0 for the model.
    wall_s : time by the clock on the wall.
    cpu_s : time the simulator (or the model) had a processor: less than `wall_s` on a busy machine.
    """

    steps: int
    clocks: int
    wall_s: float
    cpu_s: float

    @property
    def clocks_per_s(self) -> float:
        return self.clocks / self.wall_s

    @property
    def steps_per_s(self) -> float:
        return self.steps / self.wall_s

    @property
    def times_real_time(self) -> float:
        """Simulated over wall time."""
        return self.steps * STEP_S / self.wall_s

    @property
    def times_real_time_of_a_free_core(self) -> float:
        """Simulated over processor time."""
        return self.steps * STEP_S / max(self.cpu_s, 1.0 / TICKS_PER_S)


@dataclass(frozen=True)
class LatencyFigure:
    """Duration of an exchange of one step, s."""

    median_s: float
    slowest_of_hundred_s: float


def set_burger(link: Link | MotorPair) -> None:
    """Give the link the motor of the default robot, at 10 µs."""
    link.set_parameters(*builtin_robot("burger").motor.constants, STEP_S)


def _processor_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_S


def measure_rtl(
    sim: str,
    step_clocks: int | str,
    exchange_steps: int,
    seconds: float,
    every_clock: bool = False,
    effects: bool = False,
) -> LoopFigure:
    """Run the RTL loop for about so many seconds.

    Parameters
    ----------
    exchange_steps : steps of one exchange; sampled every 100 steps.
    every_clock : evaluate the idle clocks, too (`RtlLink`).
    effects : with dry friction on both sides: the effect unit works in full, whatever the effects are.
    """
    rng = np.random.default_rng(0)
    with RtlLink(sim=sim, step_clocks=step_clocks, every_clock=every_clock) as link:
        if effects:
            link.set_effects(DRY, DRY, None)
        set_burger(link)
        link.exchange([0.0, 0.0], [0.0, 0.0], 10 * STEP_S)
        clocks, cpu, start = link.clocks, _processor_s(link.pid), time.perf_counter()
        steps = 0
        while time.perf_counter() - start < seconds:
            link.exchange(
                rng.uniform(-12.0, 12.0, 2), rng.uniform(-1e-3, 1e-3, 2), exchange_steps * STEP_S, 100 * STEP_S
            )
            steps += exchange_steps
        wall = time.perf_counter() - start
        return LoopFigure(steps, link.clocks - clocks, wall, _processor_s(link.pid) - cpu)


def measure_model(seconds: float, exchange_steps: int = 3200, sample_steps: int = 100) -> LoopFigure:
    """Run the bit-exact model the same way."""
    rng = np.random.default_rng(0)
    pair = MotorPair()
    set_burger(pair)
    pair.step([0.0, 0.0], [0.0, 0.0], 2, 1)  # compiles it
    steps, start, cpu = 0, time.perf_counter(), time.process_time()
    while time.perf_counter() - start < seconds:
        pair.step(rng.uniform(-12.0, 12.0, 2), rng.uniform(-1e-3, 1e-3, 2), exchange_steps, sample_steps)
        steps += exchange_steps
    return LoopFigure(steps, 0, time.perf_counter() - start, time.process_time() - cpu)


def measure_latency(open_it: Callable[[], Link], repeats: int = 2000) -> LatencyFigure:
    """Time exchanges of a single step each, on a link opened for it."""
    durations = []
    with open_it() as link:
        set_burger(link)
        for number in range(repeats + 100):
            start = time.perf_counter()
            link.exchange([1.0, 2.0], [0.0, 0.0], STEP_S)
            if number >= 100:
                durations.append(time.perf_counter() - start)
    return LatencyFigure(statistics.median(durations), sorted(durations)[int(0.99 * len(durations))])
