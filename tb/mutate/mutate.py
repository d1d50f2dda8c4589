"""`make mutate`: deliberate faults of the RTL, each of which some test has to see.

Every mutant of mutants.toml is made in a copy of the tree (with a build folder of its own) and run against the smallest
relevant test. A mutant that lives is a hole in the tests: status 1. Before its first mutant each test is run without a
fault: it has to pass, or a failure would prove nothing.

What was killed is kept in build/mutate, for this state of the RTL and of what tests it: a run that was interrupted goes
on where it was. `--again` runs all of them.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

from rtds_host.compat import tomllib

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
WORK = ROOT / "build" / "mutate"
COPIED = ("rtl", "tb", "python", "quartus", "sim", "pyproject.toml")
# What a verdict hangs on: the design, its tests and what these use of the package.
JUDGED = ("rtl", "tb", "sim", "quartus", "python/rtds_host/link", "python/rtds_host/motor")
NOT_JUDGED = ("tb/mutate", "tb/pnr", "tb/synth", "tb/formal")

# Short name -> arguments of pytest. Icarus builds at once, so it is the simulator here wherever it can be.
TESTS = {
    "core": ["tb/core/test_core.py", "-k", "contract and icarus"],
    "fp": ["tb/fp/test_fp.py", "-k", "test_every_directed_pair"],
    "chip": ["tb/top/test_top.py", "-k", "test_chip and icarus"],
    "parameters": ["tb/top/test_top.py", "-k", "test_one_fault and unusable_parameters"],
    "scalings": ["tb/top/test_top.py", "-k", "test_one_fault and bad_scalings"],
    "nonfinite": ["tb/top/test_top.py", "-k", "test_one_fault and nonfinite_state"],
    "lost_lock": ["tb/top/test_top.py", "-k", "test_one_fault and of_a_commit"],
    "torn": ["tb/top/test_top.py", "-k", "test_one_fault and worst_moment"],
    "core_busy": ["tb/top/test_top.py", "-k", "test_one_fault and core_is_busy"],
    "falters": ["tb/top/test_top.py", "-k", "test_one_fault and system_clock_falters"],
    "pll_restart": ["tb/cdc/test_cdc.py", "-k", "pll_restart and icarus"],
    "netlist": ["tb/quartus/test_quartus.py", "-k", "test_no_register_hears"],
    "told_once": ["tb/top/test_top.py", "-k", "test_one_fault and told_once"],
    "dead_sdo": ["tb/top/test_top.py", "-k", "test_one_fault and dead_sdo"],
    "resets": ["tb/cdc/test_cdc.py", "-k", "resets and icarus"],
    "cdc": ["tb/cdc/test_cdc.py", "-k", "keeps_every_word and icarus"],
    "uart": ["tb/uart/test_uart.py", "-k", "icarus"],
    "effects": ["tb/effects/test_effects_rtl.py", "-k", "clock_by_clock and icarus"],
    "fx_words": ["tb/effects/test_effects_rtl.py", "-k", "random_effects_and_motors"],
    "wait_of_the_pll": ["tb/cdc/test_cdc.py", "-k", "waits_longer and icarus"],
    "board_port": ["tb/uart/test_uart.py", "-k", "own_pause and icarus"],
    "observed": ["tb/top/test_top.py", "-k", "test_one_view and observed_word"],
    "leds": ["tb/top/test_top.py", "-k", "test_one_view and each_led"],
    "own_lock": ["tb/top/test_top.py", "-k", "test_one_view and proved_itself"],
    "index": ["tb/effects/test_effects_rtl.py", "-k", "border and icarus"],
    "fp_stages": ["tb/fp/test_fp.py", "-k", "each_stage and icarus"],
    "regs": ["tb/regs/test_regs.py", "-k", "register_file and icarus"],
}


def copy_tree(folder: Path) -> None:
    """A fresh copy of everything a test reads."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    ignore = shutil.ignore_patterns("__pycache__", "*.egg-info", "build")
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=ignore)
        else:
            shutil.copy(source, folder / name)


def run_test(folder: Path, test: str) -> bool:
    """True when the test passes in that copy. Raises RuntimeError when it could not be run at all."""
    env = {**os.environ, "PYTHONPATH": str(folder / "python"), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-m", "", *TESTS[test]]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=env, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(f"{test}: pytest gave {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.returncode == 0


def state_key(root: Path) -> str:
    """A hash of all files that a verdict hangs on."""
    digest = hashlib.sha256()
    apart = [root / name for name in NOT_JUDGED]
    for path in sorted(path for name in JUDGED for path in (root / name).rglob("*") if path.is_file()):
        if path.suffix == ".pyc" or any(folder in path.parents for folder in apart):
            continue
        digest.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


class Kept:
    """What is known of one state: tests that pass without a fault, and the seconds after which mutants were killed."""

    def __init__(self, path: Path, again: bool) -> None:
        self._path = path
        self._known = {"healthy": [], "killed": {}}
        if path.is_file() and not again:
            self._known = json.loads(path.read_text())

    @staticmethod
    def _name(mutant: dict[str, str]) -> str:
        return hashlib.sha256(json.dumps(mutant, sort_keys=True).encode()).hexdigest()

    def _write(self) -> None:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        scratch = self._path.with_suffix(".new")
        scratch.write_text(json.dumps(self._known))
        scratch.replace(self._path)

    def healthy(self, test: str) -> bool:
        """Whether the test has passed without a fault."""
        return test in self._known["healthy"]

    def add_healthy(self, test: str) -> None:
        """The test has passed without a fault."""
        self._known["healthy"].append(test)
        self._write()

    def killed(self, mutant: dict[str, str]) -> float | None:
        """Seconds after which it was killed; None where that is not known."""
        return self._known["killed"].get(self._name(mutant))

    def add_killed(self, mutant: dict[str, str], seconds: float) -> None:
        """It was killed."""
        self._known["killed"][self._name(mutant)] = seconds
        self._write()


def try_mutant(folder: Path, mutant: dict[str, str]) -> tuple[bool, float]:
    """(killed, seconds) of one mutant. Raises ValueError when it no longer fits."""
    path = folder / "rtl" / mutant["file"]
    right = path.read_text()
    if right.count(mutant["old"]) != 1:
        raise ValueError(f"{mutant['name']}: {mutant['file']} has changed, this mutant no longer fits")
    path.write_text(right.replace(mutant["old"], mutant["new"]))
    shutil.rmtree(folder / "build", ignore_errors=True)
    begin = time.monotonic()
    try:
        return not run_test(folder, mutant["test"]), time.monotonic() - begin
    finally:
        path.write_text(right)


def main(argv: list[str]) -> int:
    """Run all mutants, or those whose name contains one of the arguments."""
    wanted = [word for word in argv[1:] if word != "--again"] or [""]
    mutants = [
        m for m in tomllib.loads((HERE / "mutants.toml").read_text())["mutant"] if any(w in m["name"] for w in wanted)
    ]
    folder = WORK / "tree"
    copy_tree(folder)
    kept = Kept(WORK / "results" / f"{state_key(folder)}.json", "--again" in argv)
    print(f"| {'mutant':<52} | {'file':<22} | {'test':<10} | {'verdict':<7} | seconds |")
    print(f"|{'-' * 54}|{'-' * 24}|{'-' * 12}|---------|--------:|", flush=True)
    killed = 0
    for m in mutants:
        seconds = kept.killed(m)
        dead = seconds is not None
        if seconds is None:
            if not kept.healthy(m["test"]):
                if not run_test(folder, m["test"]):
                    print(f"{m['test']}: fails without any fault", file=sys.stderr)
                    return 1
                kept.add_healthy(m["test"])
            try:
                dead, seconds = try_mutant(folder, m)
            except ValueError as error:
                print(error, file=sys.stderr)
                return 1
            if dead:
                kept.add_killed(m, seconds)
        killed += dead
        print(
            f"| {m['name']:<52} | {m['file']:<22} | {m['test']:<10} | {'killed' if dead else 'LIVES':<7} |"
            f" {seconds:>7.1f} |",
            flush=True,
        )
    print(f"\n{killed} of {len(mutants)} mutants killed")
    return 0 if killed == len(mutants) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv))
