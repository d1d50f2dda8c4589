"""The present state of the loop next to an earlier one: the same loops in turn, ratios of each pair."""

from __future__ import annotations

import io
import os
import statistics
import subprocess
import sys
import tarfile
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from rtds_host.bench.measure import STEP_S
from rtds_host.errors import InputError, LinkError
from rtds_host.link.tops import ROOT
from rtds_host.vectors import given

NEEDED = ("python", "rtl", "sim")
# Name, clocks a step, steps an exchange, effects, how many times as fast as 59bd469 it is to be: the state before the
# operators by the host's arithmetic and an evaluation a phase.
LOOPS = (
    ("as few clocks as the core needs", "min", 3200, False, 3.0),
    ("as few clocks as the core needs, effects", "min", 800, True, 2.0),
    ("500 clocks a step", "500", 3200, False, 3.0),
    ("500 clocks a step, effects", "500", 800, True, 2.0),
)


@dataclass(frozen=True)
class Pair:
    """Simulated over the simulator's processor time, one after the other; clocks a step."""

    earlier: float
    present: float
    earlier_clocks: float
    present_clocks: float

    @property
    def ratio(self) -> float:
        """How many times as fast the present state is."""
        return self.present / self.earlier


def earlier_tree(name: str) -> Path:
    """The folder `name`, or the sources of the commit `name`, laid out below build/bench.

    Raises
    ------
    InputError : it is neither.
    """
    if Path(name).is_dir():
        return Path(name).resolve()
    done = subprocess.run(["git", "-C", ROOT, "archive", name, *NEEDED], capture_output=True, check=False)
    if done.returncode != 0:
        raise InputError(f"{name}: neither a folder nor a commit with {', '.join(NEEDED)}")
    folder = ROOT / "build" / "bench" / name.replace("/", "-")
    with tarfile.open(fileobj=io.BytesIO(done.stdout)) as archive:
        archive.extractall(folder)
    return folder


class Served:
    """A program of this folder, run on the package of one tree, that answers a line with a line."""

    def __init__(self, tree: Path, program: str, *arguments: str) -> None:
        command = [sys.executable, str(Path(__file__).with_name(program)), *arguments]
        environment = {**os.environ, "PYTHONPATH": str(tree / "python"), "PYTHONSAFEPATH": "1"}
        self.tree = tree
        self.process = subprocess.Popen(
            command, cwd=tree, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        # Both are pipes, as asked for above.
        self.input: IO[str] = given(self.process.stdin, "the worker's input")
        self.output: IO[str] = given(self.process.stdout, "the worker's output")
        self.answer()

    def answer(self) -> str:
        """The next line. Raises LinkError when there is none."""
        line = self.output.readline()
        if not line:
            raise LinkError(f"{self.tree}: the program ended with status {self.process.wait()}")
        return line

    def ask(self, line: str) -> str:
        """The answer to a line. Raises LinkError when there is none."""
        self.input.write(f"{line}\n")
        self.input.flush()
        return self.answer()

    def close(self) -> None:
        """End it."""
        self.input.close()
        self.process.wait()


class Worker(Served):
    """`worker.py` on the package of one tree."""

    def __init__(self, tree: Path, step_clocks: str, exchange_steps: int, effects: bool) -> None:
        super().__init__(tree, "worker.py", step_clocks, str(exchange_steps), str(int(effects)))

    def measure(self, seconds: float) -> tuple[float, float]:
        """(simulated over processor time, clocks a step) over about so many seconds."""
        steps, clocks, cpu_s = map(float, self.ask(str(seconds)).split())
        return steps * STEP_S / max(cpu_s, 1e-2), clocks / steps


def compare(tree: Path, step_clocks: str, exchange_steps: int, effects: bool, seconds: float, pairs: int) -> list[Pair]:
    """Run the loop on both states in turn."""
    workers = []
    try:
        for place in (tree, ROOT):
            workers.append(Worker(place, step_clocks, exchange_steps, effects))
        found = []
        for _ in range(pairs):
            (earlier, earlier_clocks), (present, present_clocks) = (worker.measure(seconds) for worker in workers)
            found.append(Pair(earlier, present, earlier_clocks, present_clocks))
        return found
    finally:
        for worker in workers:
            worker.close()


def run(name: str, seconds: float, pairs: int) -> None:
    """Measure and print, a line a loop."""
    tree = earlier_tree(name)
    print(
        f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f} before the start; {pairs} pairs of {seconds:g} s a"
        " line"
    )
    print("x cpu: simulated over the simulator's processor time; medians, and the ratio's least and largest\n")
    print(
        f"{'loop on Verilator':<44}{'clocks':>14}{'x cpu ' + name[:10]:>18}"
        f"{'now':>9}{'ratio':>8}{'of pairs':>16}{'wanted':>8}"
    )
    for loop, step_clocks, exchange_steps, effects, wanted in LOOPS:
        found = compare(tree, step_clocks, exchange_steps, effects, seconds, pairs)
        ratios = [pair.ratio for pair in found]
        clocks = f"{found[-1].earlier_clocks:.1f} {found[-1].present_clocks:.1f}"
        print(
            f"{loop:<44}{clocks:>14}{statistics.median(p.earlier for p in found):>18.3g}"
            f"{statistics.median(p.present for p in found):>9.3g}{statistics.median(ratios):>8.2f}"
            f"{f'{min(ratios):.2f} to {max(ratios):.2f}':>16}{wanted:>8g}",
            flush=True,
        )
