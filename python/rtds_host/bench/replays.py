"""Replays of the present state next to those of an earlier one: the same digits, and their times as ratios.

`python -m rtds_host.bench --replays 7c008df`. The worker makes its own case from a fixed seed, so nothing but the two
states' packages differs.
"""

from __future__ import annotations

import os
import statistics
from pathlib import Path

import numpy as np

from rtds_host.bench.against import Served, earlier_tree
from rtds_host.cleanup import temporary_folder
from rtds_host.link.tops import ROOT

# What is timed: one replay after another of models with these effects, and batches.
TIMED = ("nominal", "friction", "load", "slip", "free play", "batch", "batch, all effects")
# Measurements of one in a process, of which the least counts: what is beyond it is other programs' doing.
TIMES = 30


class Worker(Served):
    """`replay_worker.py` on the package of one tree."""

    def __init__(self, tree: Path, arrays: Path) -> None:
        super().__init__(tree, "replay_worker.py", str(arrays))

    def measure(self, what: str) -> float:
        """Processor time of one measurement, the least of some, s."""
        return min(float(self.ask(what)) for _ in range(TIMES))


def differing(earlier: Path, present: Path) -> tuple[list[str], list[str]]:
    """Names of all arrays of the present state's file, and of those that differ in any digit or are missing."""
    with np.load(earlier) as one, np.load(present) as other:
        names = list(other)
        return names, [name for name in names if name not in one or one[name].tobytes() != other[name].tobytes()]


def run(name: str, pairs: int) -> None:
    """Measure and print, a line a measurement. Each pair has two new processes, since their places in memory count."""
    tree = earlier_tree(name)
    load = os.getloadavg()[0]
    figures: dict[str, list[tuple[float, float]]] = {what: [] for what in TIMED}
    with temporary_folder() as folder:
        arrays = [folder / "earlier.npz", folder / "present.npz"]
        for _ in range(pairs):
            workers = []
            try:
                for place, file in zip((tree, ROOT), arrays):
                    workers.append(Worker(place, file))
                for what, found in figures.items():
                    earlier, present = (worker.measure(what) for worker in workers)
                    found.append((earlier, present))
            finally:
                for worker in workers:
                    worker.close()
        names, others = differing(*arrays)
    print(f"{len(names)} sets of replays and residuals, {len(names) - len(others)} the same to the last digit")
    for other in others:
        print(f"  differs: {other}")
    print(f"\n{os.cpu_count()} processors, load {load:.1f} before the start; {pairs} pairs of processes")
    print("processor time, ms; medians, and the ratio's least and largest\n")
    print(f"{'replays of five runs':<24}{name[:10]:>12}{'now':>8}{'ratio':>8}{'of pairs':>16}")
    for what, found in figures.items():
        ratios = [present / earlier for earlier, present in found]
        print(
            f"{what:<24}{1e3 * statistics.median(e for e, _ in found):>12.2f}"
            f"{1e3 * statistics.median(p for _, p in found):>8.2f}{statistics.median(ratios):>8.3f}"
            f"{f'{min(ratios):.3f} to {max(ratios):.3f}':>16}"
        )
