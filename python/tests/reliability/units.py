"""What a log in wrong units, with exchanged sides or a wrong sign is answered with, as a table: `python units.py`.

A sound case of two runs is written wrong in one way at a time, and `rtds diagnose` is started on it. What cannot be the
robot's must end with the unit named; what the catalogue of effects knows (swapped leads, the sign of a sensor's gain)
must be noted by the gate, and is the diagnosis' to say. The time is the processor's, the start of the program included,
of the whole command where it refuses, else of the same reading and gate that the command begins with.
"""

from __future__ import annotations

import argparse
import math
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rtds_host.contract import RunLog, RunMeta, builtin_robot, builtin_robot_path, write_run
from rtds_host.diagnosis.predict import predicted_columns

LONGEST_S = 2.0
SIDES = ("l", "r")
DEGREES, RPM = 180.0 / math.pi, 30.0 / math.pi
# Reading and gate alone: what `rtds diagnose` does before anything is fitted.
GATE = """
import sys
from rtds_host.contract import read_writable_case
from rtds_host.diagnosis.gate import examine
print("`; `".join(f.text for f in examine(read_writable_case(sys.argv[1])).findings
    if f.severity == "warning" or f.kind == "sign"))
"""
Columns = dict[str, np.ndarray]


def times(*names: str, factor: float) -> Callable[[Columns], None]:
    """The channels of these names, or both sides' of a stem, times a factor."""

    def edit(columns: Columns) -> None:
        for name in columns:
            if name in names or name.removesuffix("_l").removesuffix("_r") in names:
                columns[name] = columns[name] * factor

    return edit


def exchanged(*stems: str) -> Callable[[Columns], None]:
    """Left and right of these channels exchanged."""

    def edit(columns: Columns) -> None:
        for stem in stems:
            columns[f"{stem}_l"], columns[f"{stem}_r"] = columns[f"{stem}_r"], columns[f"{stem}_l"]

    return edit


@dataclass(frozen=True)
class Wrong:
    """One way to write a log wrong, and what must stand in the answer; `refused`, or named while the diagnosis
    goes on.
    """

    what: str
    edit: Callable[[Columns], None]
    words: str
    refused: bool = True
    only: tuple[str, ...] = ()  # channels that the log has; all of them without


ALONE = ("v_cmd", "w")
WRONG = (
    Wrong("`t` in milliseconds", times("t", factor=1e3), "is it in milliseconds?"),
    Wrong("`t` in microseconds", times("t", factor=1e6), "is it in microseconds?"),
    Wrong("`t` in minutes", times("t", factor=1 / 60), "is it in minutes?"),
    Wrong(
        "`t` in milliseconds, commands and wheel speeds alone",
        times("t", factor=1e3),
        "is it in milliseconds?",
        only=ALONE,
    ),
    Wrong(
        "`t` in microseconds, commands and wheel speeds alone",
        times("t", factor=1e6),
        "is it in microseconds?",
        only=ALONE,
    ),
    Wrong(
        "`t` in minutes, commands and wheel speeds alone", times("t", factor=1 / 60), "is it in minutes?", only=ALONE
    ),
    Wrong("wheel angles in degrees", times("th", factor=DEGREES), "th_l and th_r: ... in degrees?"),
    Wrong("`yaw` in degrees", times("yaw", factor=DEGREES), "yaw: ... in degrees?"),
    Wrong("`gyro_z` in degrees per second", times("gyro_z", factor=DEGREES), "gyro_z: ... in degrees per second?"),
    Wrong("wheel speeds in degrees per second", times("w", factor=DEGREES), "w_l and w_r: ... in degrees per second?"),
    Wrong("wheel speeds in rpm", times("w", factor=RPM), "w_l and w_r: ... in revolutions per minute?"),
    Wrong(
        "wheel speeds in rpm, alone", times("w", factor=RPM), "w_l and w_r: ... in revolutions per minute?", only=ALONE
    ),
    Wrong("one wheel's speed in rpm", times("w_l", factor=RPM), "w_l: ... in revolutions per minute?"),
    Wrong("commands in millivolts", times("v_cmd", factor=1e3), "v_cmd_l and v_cmd_r: ... in millivolts?"),
    Wrong("`v_bus` in millivolts", times("v_bus", factor=1e3), "v_bus: ... in millivolts?"),
    Wrong(
        "commands as a duty",
        times("v_cmd", factor=1 / 12),
        "v_cmd_l and v_cmd_r: ... in shares of the supply (a duty)?",
    ),
    Wrong("currents in milliamperes", times("i", factor=1e3), "i_l and i_r: ... in milliamperes?"),
    Wrong("`x`, `y` in millimetres", times("x", "y", factor=1e3), "x: ... in millimetres?"),
    Wrong("commands exchanged, left and right", exchanged("v_cmd"), "are v_cmd_l and v_cmd_r exchanged?"),
    Wrong("wheel speeds exchanged", exchanged("w"), "are w_l and w_r exchanged?"),
    Wrong("one command's sign", times("v_cmd_l", factor=-1), "w_l runs against its command", refused=False),
    Wrong("one wheel speed's sign", times("w_l", factor=-1), "w_l runs against its command", refused=False),
    Wrong("`gyro_z`'s sign", times("gyro_z", factor=-1), "gyro_z has the opposite sign", refused=False),
    Wrong(
        "`yaw`'s sign",
        times("yaw", factor=-1),
        "yaw: runs against what the wheels and the gyro turn: counted to the right?",
    ),
    Wrong("a current's sign", times("i_l", factor=-1), "i_l has the opposite sign", refused=False),
)


def write_case(folder: Path, wrong: Wrong | None) -> None:
    """Two runs of 12 s of a Burger with its sensors' noise, all channels, written wrong in one way."""
    robot = builtin_robot("burger")
    rng = np.random.default_rng(1)
    folder.mkdir(parents=True)
    shutil.copy(builtin_robot_path("burger"), folder / "robot.toml")
    t = np.arange(1200) * 0.01
    # Steps among swings: currents show at the steps only.
    volts = 3.0 * np.sin(1.1 * t) + 4.0 * np.sign(np.sin(2.3 * t))
    for run, turn in (("straight", 1.0), ("turning", -0.6)):
        commands = {"v_cmd_l": volts, "v_cmd_r": turn * volts}
        columns = predicted_columns(RunLog(run, RunMeta(run), t, commands), robot)
        for name in columns:
            if robot.noise(name):
                columns[name] = columns[name] + robot.noise(name) * rng.standard_normal(len(t))
        if wrong is not None:
            columns = {
                name: values
                for name, values in columns.items()
                if not wrong.only or name == "t" or name[:-2] in wrong.only
            }
            wrong.edit(columns)
        write_run(folder / run, RunMeta(run), columns)


def called(*arguments: object) -> tuple[subprocess.CompletedProcess[str], float]:
    """A Python process that was run, and the processor time it took, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, *map(str, arguments)], capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return done, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def answer(wrong: Wrong, place: Path) -> tuple[str, float, bool]:
    """(what is said of a log, processor time in s, whether it is what must be said, in time)."""
    case, out = place / "case", place / "out"
    write_case(case, wrong)
    if wrong.refused:
        done, seconds = called("-m", "rtds_host.cli.main", "diagnose", case, "--quick", "--out", out)
        right = done.returncode == 2 and done.stderr.count("\n") == 1 and not out.exists()
        text = done.stderr.strip().removeprefix("rtds: ")
    else:
        done, seconds = called("-c", GATE, case)
        right, text = done.returncode == 0, done.stdout.strip()
    where = -1
    for part in wrong.words.split(" ... "):
        where = text.find(part, where + 1)
        right &= where >= 0
    return text.replace(f"{case}/", ""), seconds, right and seconds < LONGEST_S


def main() -> int:
    """Print the table, 1 if a row is not as it should be."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="only rows that hold these words")
    chosen = [wrong for wrong in WRONG if parser.parse_args().only in wrong.what]
    with tempfile.TemporaryDirectory(prefix="units-") as folder:
        write_case(Path(folder) / "sound", None)
        sound, _ = called("-c", GATE, Path(folder) / "sound")
        if sound.returncode or sound.stdout.strip():
            print(f"the sound log is not taken for sound: {sound.stdout}{sound.stderr}")
            return 1
        wrong_rows = 0
        print("| written wrong | | said | s |\n|---|---|---|---:|")
        for k, wrong in enumerate(chosen):
            text, seconds, right = answer(wrong, Path(folder) / str(k))
            wrong_rows += not right
            print(
                f"| {wrong.what} | {'refused' if wrong.refused else 'named'}{'' if right else ', NOT AS IT SHOULD BE'}"
                f" | `{text}` | {seconds:.1f} |",
                flush=True,
            )
    print(f"\n{len(chosen)} ways, {wrong_rows} not as they should be")
    return 1 if wrong_rows else 0


if __name__ == "__main__":
    sys.exit(main())
