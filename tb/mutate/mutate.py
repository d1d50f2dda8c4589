"""`make mutate`: deliberate faults of the RTL, each of which some test has to see.

Every mutant of mutants.toml is made in a copy of the tree (with a build folder of its own) and run against the smallest
relevant test. A mutant that lives is a hole in the tests: status 1. Before its first mutant each test is run without a
fault: it has to pass, or a failure would prove nothing.
"""

from __future__ import annotations

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


def main(argv: list[str]) -> int:
    """Run all mutants, or those whose name contains one of the arguments."""
    wanted = argv[1:] or [""]
    mutants = [
        m for m in tomllib.loads((HERE / "mutants.toml").read_text())["mutant"] if any(w in m["name"] for w in wanted)
    ]
    folder = WORK / "tree"
    copy_tree(folder)
    healthy = set()
    print(f"| {'mutant':<52} | {'file':<22} | {'test':<10} | {'verdict':<7} | seconds |")
    print(f"|{'-' * 54}|{'-' * 24}|{'-' * 12}|---------|--------:|", flush=True)
    killed = 0
    for m in mutants:
        if m["test"] not in healthy:
            if not run_test(folder, m["test"]):
                print(f"{m['test']}: fails without any fault", file=sys.stderr)
                return 1
            healthy.add(m["test"])
        path = folder / "rtl" / m["file"]
        right = path.read_text()
        if right.count(m["old"]) != 1:
            print(f"{m['name']}: {m['file']} has changed, this mutant no longer fits", file=sys.stderr)
            return 1
        path.write_text(right.replace(m["old"], m["new"]))
        shutil.rmtree(folder / "build", ignore_errors=True)
        begin = time.monotonic()
        dead = not run_test(folder, m["test"])
        path.write_text(right)
        killed += dead
        print(
            f"| {m['name']:<52} | {m['file']:<22} | {m['test']:<10} | {'killed' if dead else 'LIVES':<7} |"
            f" {time.monotonic() - begin:>7.1f} |",
            flush=True,
        )
    print(f"\n{killed} of {len(mutants)} mutants killed")
    return 0 if killed == len(mutants) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv))
