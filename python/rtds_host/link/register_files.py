"""Writes what is made from the register map: the Verilog headers and the page docs/registers.md.

``python -m rtds_host.link.register_files ROOT`` writes them below ROOT; tb/regs checks that they are up to date.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from rtds_host.link.registers import Register, RegisterMap, load_map, word_float

HEADER_PATH = "rtl/io/rtds_regs_map.vh"
FIELDS_PATH = "rtl/io/rtds_regs_fields.vh"
PAGE_PATH = "docs/registers.md"
COMMAND = "make registers"


def verilog_header(regs: RegisterMap) -> str:
    """Addresses, field positions and reset values as local parameters, for `include inside a module."""
    lines = [
        "// Register map: addresses (32-bit words), bit positions, reset values.",
        f"// Made from python/rtds_host/link/registers.toml by `{COMMAND}`; do not edit.",
        "// To be included inside a module; a module uses a part of it, hence the waiver.",
        "// verilator lint_off UNUSEDPARAM",
        "",
        f"localparam [31:0] MAP_ID = 32'h{regs.identity:08X};",
        f"localparam [31:0] MAP_VERSION = 32'h{regs.version_word:08X};",
        "",
    ]
    for r in regs.registers:
        lines.append(f"localparam [7:0] ADDR_{r.name} = 8'h{r.address:02X};")
        lines += [f"localparam integer BIT_{r.name}_{f.name.upper()} = {f.bit};" for f in r.fields]
    config = regs.config
    lines += [
        "",
        "// The config group as one vector: word k at bits 32*k+31 : 32*k.",
        f"localparam integer CFG_WORDS = {len(config)};",
        f"localparam [7:0] CFG_FIRST = 8'h{config[0].address:02X};",
    ]
    lines += [f"localparam integer CFG_{r.name} = {k};" for k, r in enumerate(config)]
    lines += ["localparam [32*CFG_WORDS-1:0] CFG_RESET = {"]
    lines += [
        f"  32'h{r.reset:08X}{',' if k else ''}  // {r.name} = {_reset_text(r)}"
        for k, r in reversed(list(enumerate(config)))
    ]
    lines += ["};", ""]
    control = regs.named("CONTROL")
    lines += [f"localparam [31:0] CONTROL_RESET = 32'h{control.reset:08X};", "", "// verilator lint_on UNUSEDPARAM"]
    return "\n".join(lines) + "\n"


def verilog_fields(regs: RegisterMap) -> str:
    """The config group as wires with names, for `include next to a vector `cfg`."""
    lines = [
        (
            "// The config group by names: of the vector `cfg` (config_o of rtds_regs) a wire for each word and each"
            " bit with a name, and"
        ),
        "// one for each row of scalings, the first one lowest.",
        f"// Made from python/rtds_host/link/registers.toml by `{COMMAND}`; do not edit.",
        "// To be included inside a module after `cfg`; a module uses a part of it, hence the waiver.",
        "// verilator lint_save",
        "// verilator lint_off UNUSEDSIGNAL",
        "// verilator coverage_off",
        "",
    ]
    rows: dict[str, list[int]] = {}
    for k, r in enumerate(regs.config):
        name = r.name.lower()
        if not r.fields:
            lines.append(f"wire [31:0] cfg_{name} = cfg[{32 * k}+:32];")
        lines += [f"wire cfg_{name}_{f.name} = cfg[{32 * k + f.bit}];" for f in r.fields]
        if scaling := re.fullmatch(r"(adc|dac)_.*_(gain|offset)", name):
            rows.setdefault(f"{scaling[1]}_{scaling[2]}", []).append(k)
    for name, words in rows.items():
        assert words == list(range(words[0], words[0] + len(words))), f"{name}: not in a row"
        bits = 32 * len(words)
        lines.append(f"wire [{bits - 1}:0] cfg_{name} = cfg[{32 * words[0]}+:{bits}];")
    lines += ["", "// verilator coverage_on", "// verilator lint_restore"]
    return "\n".join(lines) + "\n"


def _reset_text(r: Register) -> str:
    if r.kind == "float":
        return f"{word_float(r.reset):.7g}"
    return f"0x{r.reset:X}"


def markdown_page(regs: RegisterMap) -> str:
    """The register map as a page for people."""
    major, minor, patch = regs.version
    lines = [
        "# Register map and serial protocol",
        "",
        f"Map version {major}.{minor}.{patch}. This page and the Verilog header `{HEADER_PATH}` are made from",
        f"`python/rtds_host/link/registers.toml` by `{COMMAND}`; a test fails when they differ from it.",
        "",
        "Each register has 32 bits; addresses count words. On the chip they sit on an Avalon-MM slave",
        "(`rtl/io/rtds_regs.v`), on the board behind a serial port of 1 Mbaud, 8N1 (`rtl/io/serial_bridge.v`).",
        "Access: ro read; rw read and write; w1c a written 1 clears the bit; wo write only, reads 0.",
        "Registers marked *config* are double-buffered: a write goes to a shadow, which the chip takes over as a",
        "whole, between two steps, on `COMMAND.commit`; a read gives the shadow.",
        "",
        "| address | name | access | reset | unit | meaning |",
        "|---|---|---|---|---|---|",
    ]
    for r in regs.registers:
        group = " *config*" if r.group == "config" else ""
        reset = _reset_text(r) if r.access == "rw" else ""
        lines.append(f"| 0x{r.address:02X} | {r.name} | {r.access}{group} | {reset} | {r.unit} | {r.text} |")
    lines += ["", "## Fields", ""]
    for r in regs.registers:
        if r.fields:
            lines += [f"### {r.name} (0x{r.address:02X}, {r.access})", "", "| bit | field | meaning |", "|---|---|---|"]
            lines += [f"| {f.bit} | {f.name} | {f.text} |" for f in r.fields]
            lines.append("")
    lines += [
        "## Serial protocol",
        "",
        "A request and its answer have nine bytes each:",
        "",
        "| byte | request | answer |",
        "|---|---|---|",
        "| 0 | 0xA5 | 0x5A |",
        "| 1 | tag (bits 7:4), operation (3:0): 1 read, 2 write | the same tag, status (3:0) |",
        "| 2 | address | the same address |",
        "| 3 to 6 | data, low byte first | data read, or written |",
        "| 7, 8 | CRC-16/CCITT-FALSE over bytes 0 to 6, high byte first | the same |",
        "",
        "Status: 0 done, 1 unknown operation, 2 refused (read-only register), 3 no such register. A damaged, cut or",
        "mis-framed request gets no answer: `STATUS.serial_error` is set and `SERIAL_ERRORS` counts. The client times",
        "out and repeats; every operation may be repeated. A pause of more than 2 ms inside a request cuts it.",
        "",
        "From Python:",
        "",
        "```python",
        "from rtds_host.link.registers import open_serial",
        "",
        'with open_serial("/dev/ttyUSB0") as chip:',
        '    chip.configure({"R": 8.6, "L": 1e-3, "H": 1e-5})   # written, then taken over in one piece',
        "    print(chip.take_status(), chip.counters())",
        "```",
        "",
        'Where no chip answers, every call ends in one `LinkError`: "/dev/ttyUSB0: bus does not answer". A request',
        "is made three times. Each answer has 0.25 s (`open_serial(..., timeout_s=)`) from the request on, however its",
        "bytes come. An operation therefore ends within 0.75 s on a silent line, on a noisy one, or where bytes come",
        "one by one. It ends within 2 s on a port that takes no bytes.",
    ]
    return "\n".join(lines) + "\n"


def made_files(regs: RegisterMap) -> dict[str, str]:
    """Path below the root -> text of each file made from the map."""
    return {HEADER_PATH: verilog_header(regs), FIELDS_PATH: verilog_fields(regs), PAGE_PATH: markdown_page(regs)}


def main(argv: list[str]) -> int:
    """Write the files below the folder argv[1] (default: here)."""
    root = Path(argv[1] if len(argv) > 1 else ".")
    for path, text in made_files(load_map()).items():
        (root / path).write_text(text, encoding="utf-8")
        print(f"wrote {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
