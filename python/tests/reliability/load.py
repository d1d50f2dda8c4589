"""How much memory and time large inputs take: `python load.py cases --count 200`, `python load.py long --runs 20
--seconds 600`.

`cases` gives so many small cases to one call of `rtds diagnose` and looks at the memory of its processes as they are
worked off; `long` gives it one case of long runs. Every fourth case, and the long one, has friction that the nominal
robot lacks.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "diagnosis"))

from diagnosis_cases import make_run

from rtds_host.contract import builtin_robot, builtin_robot_path, write_run
from rtds_host.diagnosis.replay.model import nominal_model

LOOK_S = 0.2
KINDS = ("steps", "spin", "weave")


def make_case(folder: Path, runs: int, seconds: float, seed: int, friction_nm: float) -> None:
    """A case of the burger robot in the contract's format."""
    robot = builtin_robot("burger")
    model = nominal_model(robot)
    model.add("coulomb", friction_nm)
    for k in range(runs):
        run = make_run(f"run-{k:02d}", model, robot, KINDS[k % len(KINDS)], seconds, seed + k)
        write_run(folder / run.name, run.meta, {"t": np.round(run.t, 9), **run.columns})
    shutil.copy(builtin_robot_path("burger"), folder / "robot.toml")


def session(leader: int) -> dict[int, float]:
    """Process -> memory in MB, of all processes in a session."""
    found = {}
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            if int((entry / "stat").read_text().rsplit(")", 1)[1].split()[3]) == leader:
                found[int(entry.name)] = int((entry / "statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE") / 1e6
        except OSError:
            continue
    return found


def watched(place: Path, *arguments: object) -> tuple[int, list[tuple[int, float, float]], float, float]:
    """Run `rtds diagnose`: (status, [(cases done, MB of the caller, MB of its largest other process)], seconds,
    processor seconds).
    """
    began, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "rtds_host.cli.main",
            "diagnose",
            *map(str, arguments),
            "--quick",
            "--jobs",
            "1",
            "--out",
            str(place / "out"),
        ],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    done = 0

    def count() -> None:
        nonlocal done
        for line in process.stdout:
            done += line.startswith("case-")

    reader = threading.Thread(target=count)
    reader.start()
    seen = []
    while process.poll() is None:
        memory = session(process.pid)
        seen.append((done, memory.pop(process.pid, 0.0), max(memory.values(), default=0.0)))
        time.sleep(LOOK_S)
    reader.join()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return process.returncode, seen, time.monotonic() - began, used


def cases(place: Path, count: int, seconds: float) -> int:
    """So many cases in one call; a row a fifth of them."""
    for k in range(count):
        make_case(place / f"case-{k:03d}", 1, seconds, k, 0.0 if k % 4 else 0.05)
    status, seen, wall, used = watched(place, *sorted(place.glob("case-*")))
    print("| cases done | MB, caller | MB, worker |\n|---|---:|---:|")
    step = max(1, count // 5)
    for first in range(0, count, step):
        part = [row for row in seen if first <= row[0] < first + step]
        print(f"| {first} to {first + step} | {max(row[1] for row in part):.0f} | {max(row[2] for row in part):.0f} |")
    print(
        f"{count} cases of {seconds:g} s, status {status}: {wall:.0f} s, {used:.0f} s of a processor,"
        f" {used / count:.2f} s a case"
    )
    return status


def long(place: Path, runs: int, seconds: float) -> int:
    """One case of long runs."""
    make_case(place / "case-000", runs, seconds, 0, 0.05)
    status, seen, wall, used = watched(place, place / "case-000")
    print(
        f"{runs} runs of {seconds:g} s, status {status}: {wall:.0f} s, {used:.0f} s of a processor,"
        f" {max(row[1] for row in seen):.0f} MB"
    )
    return status


def main() -> int:
    """Run one of both; the status of `rtds diagnose`."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    kinds = parser.add_subparsers(dest="kind", required=True)
    many = kinds.add_parser("cases")
    many.add_argument("--count", type=int, default=200)
    many.add_argument("--seconds", type=float, default=3.0)
    one = kinds.add_parser("long")
    one.add_argument("--runs", type=int, default=20)
    one.add_argument("--seconds", type=float, default=600.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="load-") as folder:
        if options.kind == "cases":
            return cases(Path(folder), options.count, options.seconds)
        return long(Path(folder), options.runs, options.seconds)


if __name__ == "__main__":
    sys.exit(main())
