"""Kills commands at random moments and looks at what is left: `python kills.py --count 50 --seed 1`.

A killed command must leave no process ten seconds later, no shared memory, and no output that is half there. Its
scratch may stay until the same command starts again: when all kills are done each command runs once to its end, and
then nothing but outputs may be left, neither next to them nor among the temporary files.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rtds_host.contract import RunLog, RunMeta, builtin_robot, builtin_robot_path, write_csv, write_run
from rtds_host.diagnosis.predict import predicted_columns

TAG = "RTDS_KILLS_TAG"
GONE_S = 10.0
SHARED_MEMORY = Path("/dev/shm")
MAPPING = """schema = "rtds-mapping/1"
name = "plain"
robot = "burger"
[time]
column = "t"
[signal]
""" + "\n".join(f'{name} = {{ column = "{name}" }}' for name in ("v_cmd_l", "v_cmd_r", "w_l", "w_r", "i_l", "i_r"))


@dataclass(frozen=True)
class Command:
    """Arguments of `rtds`, and each output that is there whole or not at all: its folder, and the files that belong
    together.
    """

    arguments: tuple[str, ...]
    outputs: dict[str, tuple[str, ...]]
    exclusive: bool = False  # it refuses a place where its output is already

    def torn(self, place: Path) -> list[str]:
        """Outputs of which a part is there."""
        found = []
        for folder, files in self.outputs.items():
            there = [name for name in files if (place / folder / name).exists()]
            if there and len(there) < len(files):
                found.append(f"{folder}: only {', '.join(there)}")
            for name in there:
                if name.endswith(".json"):
                    json.loads((place / folder / name).read_text())
        return found


def make_inputs(place: Path) -> None:
    """A case of three short runs, twice, and a table to import."""
    robot = builtin_robot("burger")
    rng = np.random.default_rng(1)
    for case in ("one", "two"):
        for k, run in enumerate(("a", "b", "c")):
            t = np.arange(200) * 0.01
            turn = 1.0 if k else -1.0
            commands = {"v_cmd_l": 5.0 * np.sin((3.0 + k) * t), "v_cmd_r": 5.0 * turn * np.sin((3.0 + k) * t)}
            columns = predicted_columns(RunLog(run, RunMeta(run), t, commands), robot)
            for name, values in columns.items():
                if robot.noise(name):
                    columns[name] = values + robot.noise(name) * rng.standard_normal(len(t))
            write_run(place / case / run, RunMeta(run), columns)
        shutil.copy(builtin_robot_path("burger"), place / case / "robot.toml")
    write_csv(
        place / "log.csv", {name: columns[name] for name in ("t", "v_cmd_l", "v_cmd_r", "w_l", "w_r", "i_l", "i_r")}
    )
    (place / "plain.toml").write_text(MAPPING)


RUN_FILES = ("run.json", "log.csv", "summary.json", "robot.toml")
DIAGNOSIS = ("diagnosis.json", "report.html")
COMMANDS = {
    "run": Command(
        ("run", "steps", "--link", "rtl", "--no-compare", "--set", "stretch=0.3", "--out", "out/run"),
        {"out/run": RUN_FILES},
    ),
    "run all": Command(
        ("run", "all", "--link", "rtl", "--robot", "paper", "--no-compare", "--no-figure", "--out", "out/all"),
        {"out/all": ("robot.toml", "linear/log.csv", "circle/log.csv", "eight/log.csv")},
    ),
    "diagnose one": Command(("diagnose", "one", "--quick", "--out", "out/one"), {"out/one": DIAGNOSIS}),
    "diagnose many": Command(
        ("diagnose", "one", "two", "--quick", "--out", "out/many"),
        {"out/many/one": DIAGNOSIS, "out/many/two": DIAGNOSIS},
    ),
    "close": Command(
        ("close", "one", "--no-causes", "--no-figure", "--out", "out/close"),
        {"out/close": ("close.json", "diagnosis.json")},
    ),
    "import": Command(
        ("import", "log.csv", "--mapping", "plain.toml", "--out", "out/imported"),
        {"out/imported": ("robot.toml", "log/run.json", "log/log.csv")},
        exclusive=True,
    ),
    "blind make": Command(
        (
            "blind",
            "make",
            "--n",
            "3",
            "--tier",
            "none",
            "--world",
            "planar",
            "--seed",
            "1",
            "--jobs",
            "2",
            "--out",
            "out/made",
        ),
        {"out/made/public": ("SEALS.json",)},
        exclusive=True,
    ),
    "blind answer": Command(("blind", "answer", "--quick", "--jobs", "2", "--out", "check"), {}),
}


def tagged(tag: str) -> list[str]:
    """Processes that carry the tag in their environment, living ones."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            if (
                f"{TAG}={tag}".encode() in (entry / "environ").read_bytes().split(b"\0")
                and (entry / "stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
            ):
                found.append(
                    f"{entry.name}"
                    f" {(entry / 'cmdline').read_bytes().replace(bytes(1), b' ').decode(errors='replace')[:80]}"
                )
        except OSError:
            continue
    return found


def starved_s(processes: list[str]) -> float:
    """Longest time that one of these processes has waited for a processor so far, s."""
    longest = 0.0
    for process in processes:
        try:
            longest = max(longest, 1e-9 * int(Path(f"/proc/{process.split()[0]}/schedstat").read_text().split()[1]))
        except OSError:
            continue
    return longest


def scratch(place: Path) -> list[str]:
    """Hidden files and folders below a place that are no output."""
    return sorted(str(p.relative_to(place)) for p in place.rglob(".*") if p.name != ".rtds")


class Bench:
    """A folder with inputs, in which commands are started and killed; `complaints` grows with what must not be."""

    def __init__(self, place: Path):
        self.place = place
        self.temporary = place / "tmp"
        self.temporary.mkdir()
        make_inputs(place)
        self.complaints: list[str] = []
        self.said = place / "said"

    def start(self, command: Command, tag: str) -> subprocess.Popen:
        environment = {**os.environ, TAG: tag, "TMPDIR": str(self.temporary)}
        with open(self.said, "w") as said:
            return subprocess.Popen(
                [sys.executable, "-m", "rtds_host.cli.main", *command.arguments],
                cwd=self.place,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=said,
                start_new_session=True,
            )

    def last_words(self) -> str:
        """Last line that the last command said on standard error."""
        return ([""] + self.said.read_text(errors="replace").splitlines())[-1]

    def finish(self, name: str) -> float:
        """Run a command to its end; seconds it took."""
        self.clear(name)
        began = time.monotonic()
        status = self.start(COMMANDS[name], "end").wait()
        if status != 0:
            self.complaints.append(f"{name}: does not go on after a kill, status {status}: {self.last_words()}")
        torn = COMMANDS[name].torn(self.place)
        missing = [
            f
            for folder, files in COMMANDS[name].outputs.items()
            for f in files
            if not (self.place / folder / f).exists()
        ]
        self.complaints += [f"{name}: at its end {what}" for what in (*torn, *missing)]
        return time.monotonic() - began

    def clear(self, name: str) -> None:
        """Take away what a command that refuses to write twice has finished."""
        command = COMMANDS[name]
        if command.exclusive:
            for folder, files in command.outputs.items():
                if all((self.place / folder / f).exists() for f in files):
                    shutil.rmtree(self.place / folder)

    def kill(self, name: str, after_s: float, how: signal.Signals = signal.SIGKILL) -> str:
        """Start a command, end it after a time, and look; what it had written by then, in a word."""
        self.clear(name)
        tag = uuid.uuid4().hex
        before = set(self.left())
        memory = set(os.listdir(SHARED_MEMORY)) if SHARED_MEMORY.is_dir() else set()
        process = self.start(COMMANDS[name], tag)
        try:
            process.wait(after_s)
        except subprocess.TimeoutExpired:
            process.send_signal(how)
        status = process.wait()
        if how == signal.SIGINT and status not in (0, 130):
            self.complaints.append(f"{name}: Ctrl-C after {after_s:.2f} s gives status {status}: {self.last_words()}")
        began, starved = time.monotonic(), starved_s(tagged(tag))
        # On a busy machine the time in which nobody lets them run does not count.
        while (left := tagged(tag)) and time.monotonic() - began - max(0.0, starved_s(left) - starved) < GONE_S:
            time.sleep(0.1)
        self.complaints += [f"{name}: killed after {after_s:.2f} s leaves process {p}" for p in left]
        more = (
            {m for m in set(os.listdir(SHARED_MEMORY)) - memory if not m.startswith("sem.mp")}
            if memory or SHARED_MEMORY.is_dir()
            else set()
        )
        self.complaints += [f"{name}: killed after {after_s:.2f} s leaves shared memory {m}" for m in more]
        self.complaints += [
            f"{name}: killed after {after_s:.2f} s leaves {what}" for what in COMMANDS[name].torn(self.place)
        ]
        if how == signal.SIGINT:
            self.complaints += [
                f"{name}: Ctrl-C after {after_s:.2f} s leaves {what}" for what in set(self.left()) - before
            ]
        return "done" if status == 0 else "ended"

    def left(self) -> list[str]:
        """Scratch next to the outputs and among the temporary files."""
        return scratch(self.place) + [f"tmp/{name}" for name in os.listdir(self.temporary)]


def main() -> int:
    """Run so many kills, tell what was found, 1 if anything."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", action="append", choices=COMMANDS, help="only these commands")
    options = parser.parse_args()
    rng = random.Random(options.seed)
    names = options.only or list(COMMANDS)
    with tempfile.TemporaryDirectory(prefix="kills-") as folder:
        bench = Bench(Path(folder))
        if "blind answer" in names:
            made = Command(
                (
                    "blind",
                    "make",
                    "--n",
                    "4",
                    "--tier",
                    "none",
                    "--world",
                    "planar",
                    "--seed",
                    "2",
                    "--jobs",
                    "1",
                    "--out",
                    "check",
                ),
                {},
            )
            assert bench.start(made, "make").wait() == 0
            shutil.copytree(bench.place / "check", bench.place / "fresh")
        lengths = {name: bench.finish(name) for name in names}
        print("seconds to the end: " + ", ".join(f"{name} {s:.1f}" for name, s in lengths.items()), flush=True)
        counts = {name: {"ended": 0, "done": 0} for name in names}
        for k in range(options.count):
            name = names[k % len(names)]
            if name == "blind answer":
                shutil.rmtree(bench.place / "check")
                shutil.copytree(bench.place / "fresh", bench.place / "check")
            # Every third by Ctrl-C.
            how = signal.SIGINT if k % 3 == 2 else signal.SIGKILL
            after_s = rng.uniform(0.0, lengths[name])
            counts[name][bench.kill(name, after_s, how)] += 1
            print(f"{k + 1:3} {name}: {how.name} after {after_s:.1f} s, {len(bench.complaints)} complaints", flush=True)
        for name in names:
            bench.finish(name)
        bench.complaints += [f"at the end: {what}" for what in bench.left()]
        for name, count in counts.items():
            print(f"{name:14} {count['ended']:3} ended in the middle, {count['done']:3} were done")
    for line in bench.complaints:
        print(line)
    print(f"{options.count} kills, seed {options.seed}: {len(bench.complaints)} complaints")
    return 1 if bench.complaints else 0


if __name__ == "__main__":
    sys.exit(main())
