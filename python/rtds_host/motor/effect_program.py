"""The program of the effect unit, and the Verilog ROM that is made from it.

The effect unit (rtl/effects/effect_engine.v) carries out one list of operations after every step, for the left side and
one clock later for the right: one multiplier, one adder, one memory of tables. `OPERATIONS` says what is computed, in
the names of docs/effect-unit.md; `schedule` says when, so that no operation reads what is not written yet. The
bit-exact model (`effect_model`) does the same arithmetic, written out; the RTL's tests hold the two together.

    python -m rtds_host.motor.effect_program rtl/effects/effect_program.v
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

# Words the host writes, a word a side, at these addresses of the register memory.
CONSTANTS = (
    "command_k", "drop_k", "torque_k", "ripple_k", "forward_k", "backward_k",  # cells a unit of the argument
    "sag", "decline", "nominal", "limit", "heat_in", "heat_out", "phase", "load_driving", "load_driven",
)  # fmt: skip
# State of the unit between the steps: read as zero in the first run after a clear.
STATES = ("rise", "rise_lo", "fall", "fall_lo", "angle", "angle_lo")
# What comes from outside the memory, with the operand that can take it.
OUTSIDE_A = ("R", "Kb", "vc", "T")
OUTSIDE_B = ("i", "w")
OUTPUTS = ("u_v", "u_t", "level_f", "level_b")
TABLES = ("command", "drop", "torque", "ripple", "forward", "backward")
# Cell of an argument of zero: tables of both signs have their middle there, the others one cell for what is below.
TABLE_ORIGIN = {"command": 128, "drop": 128, "torque": 128, "ripple": 1, "forward": 1, "backward": 1}
CELLS = 256
SIDES = 2
REGISTERS = 128
STATE_FIRST = 112
TEMPORARY_FIRST = 16

# mov: a + 0. pos: a if it is not less than zero, else b, + 0. neg: a if it is less than zero, else b, + 0.
# clamp: a, of size b at most, + 0. wrap: a - 1 if |a| >= 1 and a > 0, a + 1 if a < 0, else a + 0. look: the word of the cell at a.
OPS = ("mul", "add", "sub", "mov", "pos", "neg", "clamp", "wrap", "look")
LATENCY_PAIRS = 3  # an operation may read what one issued so many pairs of clocks earlier has written


def _lookup(table: str, argument: str, result: str) -> list[tuple[str, ...]]:
    u, slope, intercept, product = (f"{result}.{part}" for part in ("u", "slope", "intercept", "product"))
    a, b = (argument, f"{table}_k") if argument in OUTSIDE_A else (f"{table}_k", argument)
    c, d = (argument, slope) if argument in OUTSIDE_A else (slope, argument)
    return [
        (u, "mul", a, b),
        (slope, "look", u, f"{table}.slope"),
        (intercept, "look", u, f"{table}.intercept"),
        (product, "mul", c, d),
        (result, "add", product, intercept),
    ]


def _sum_in_two_words(state: str, increment: str) -> list[tuple[str, ...]]:
    t, hi, z = f"{state}.t", f"{state}.new", f"{state}.z"
    return [
        (t, "add", increment, f"{state}_lo"),
        (hi, "add", state, t),
        (z, "sub", hi, state),
        (f"{state}_lo", "sub", t, z),
    ]


# (result, operation, a, b). A result named like a state is its new value, written when no operation needs the old one
# any more. "left.x", "right.x": the value of that side, on either side.
OPERATIONS: tuple[tuple[str, ...], ...] = (
    # supply: 1 - decline t / V - Rs (i_l v_l + i_r v_r) / V^2
    ("draw", "mul", "vc", "i"),
    ("draws", "add", "left.draw", "right.draw"),
    ("sagged", "mul", "sag", "draws"),
    *_sum_in_two_words("fall", "decline"),
    ("fall", "mov", "fall.new", ""),
    ("full", "sub", "nominal", "fall.new"),
    ("bus", "sub", "full", "sagged"),
    # voltage: command, bus, limit, drop against the driving voltage, hot winding
    *_lookup("command", "vc", "bridge"),
    ("scaled", "mul", "bridge", "bus"),
    ("limited", "clamp", "scaled", "limit"),
    ("emf", "mul", "Kb", "w"),
    ("driving", "sub", "limited", "emf"),
    *_lookup("drop", "driving", "dropped"),
    ("left_over", "sub", "limited", "dropped"),
    ("copper", "mul", "R", "i"),
    ("hot", "mul", "rise", "copper"),
    ("u_v", "sub", "left_over", "hot"),
    # heat: rise' = heat_in (1 + rise) R i^2 - heat_out rise
    ("all_copper", "add", "copper", "hot"),
    ("power", "mul", "all_copper", "i"),
    ("heated", "mul", "heat_in", "power"),
    ("cooled", "mul", "heat_out", "rise"),
    ("warmed", "sub", "heated", "cooled"),
    *_sum_in_two_words("rise", "warmed"),
    ("rise", "mov", "rise.new", ""),
    # torque against speed and angle
    *_lookup("torque", "w", "resisting"),
    ("turned", "mul", "phase", "w"),
    *_sum_in_two_words("angle", "turned"),
    ("angle.wrapped", "wrap", "angle.new", ""),
    ("angle", "mov", "angle.wrapped", ""),
    *_lookup("ripple", "angle.wrapped", "driven"),
    ("load", "add", "T", "resisting"),
    ("u_t", "sub", "load", "driven"),
    # levels of dry friction
    *_lookup("forward", "w", "forward"),
    *_lookup("backward", "w", "backward"),
    ("driving_loss", "mul", "T", "load_driving"),
    ("driven_loss", "mul", "T", "load_driven"),
    ("more_f", "pos", "driving_loss", "driven_loss"),
    ("more_b", "neg", "driving_loss", "driven_loss"),
    ("level_f", "add", "forward", "more_f"),
    ("level_b", "sub", "backward", "more_b"),
)


@dataclass(frozen=True)
class Instruction:
    """One operation as the engine takes it; `pair` is the pair of clocks in which both sides issue it."""

    pair: int
    op: str
    a: int  # address, or index into OUTSIDE_A
    a_outside: bool
    b: int  # address, index into OUTSIDE_B, or {table, word} of a look-up
    b_outside: bool
    across: bool  # a from the left side, b from the right, on both sides
    target: int
    output: int | None

    @property
    def word(self) -> int:
        """As the ROM holds it, 31 bits: {output valid, output (2), op (4), across, a outside, a (7), b outside, b (7),
        target (7)}."""
        output = 0 if self.output is None else 4 | self.output
        fields = ((output, 3), (OPS.index(self.op), 4), (self.across, 1), (self.a_outside, 1), (self.a, 7),
                  (self.b_outside, 1), (self.b, 7), (self.target, 7))  # fmt: skip
        word = 0
        for value, bits in fields:
            assert 0 <= int(value) < 1 << bits
            word = word << bits | int(value)
        return word


def constant_address(name: str) -> int:
    """Address of a constant in a side's register memory."""
    return CONSTANTS.index(name)


def _source(name: str) -> str:
    return name.removeprefix("left.").removeprefix("right.")


def schedule() -> list[Instruction]:
    """The operations in the order and at the pairs of clocks at which the engine issues them (one a pair)."""
    addresses = {name: k for k, name in enumerate(CONSTANTS)}
    addresses |= {name: STATE_FIRST + k for k, name in enumerate(STATES)}
    for result, *_ in OPERATIONS:
        if result not in STATES:
            addresses[result] = TEMPORARY_FIRST + len([name for name in addresses if name not in CONSTANTS + STATES])
    assert max(addresses.values()) < REGISTERS
    temporaries = [a for name, a in addresses.items() if name not in STATES]
    assert max(temporaries) < STATE_FIRST
    assert len(set(addresses.values())) == len(addresses)

    def after(k: int) -> list[tuple[int, int]]:
        """(operation, pairs) that operation k has to follow, and by how much."""
        result, op, *operands = OPERATIONS[k]
        if op == "look":
            operands = operands[:1]  # the other names a table
        found = []
        # What the right side issued a clock later, the left side may not read as soon.
        later = any(name.startswith("right.") for name in operands)
        for j, (other, _, *others) in enumerate(OPERATIONS):
            if other in map(_source, operands) and other not in STATES:
                found.append((j, LATENCY_PAIRS + later))
            if result in STATES and result in others:
                found.append((j, 0))  # the old value has been read
        return found

    order = {k: after(k) for k in range(len(OPERATIONS))}
    longest: dict[int, int] = {}

    def remaining(k: int) -> int:
        """Pairs from issuing k to the end of what hangs on it."""
        if k not in longest:
            longest[k] = max((wait + remaining(j) for j in order for i, wait in order[j] if i == k), default=0)
        return longest[k]

    issued: dict[int, int] = {}
    program = []
    pair = 0
    while len(issued) < len(OPERATIONS):
        ready = [
            k for k in order
            if k not in issued and all(j in issued and issued[j] + wait <= pair for j, wait in order[k])
        ]  # fmt: skip
        if ready:
            k = max(ready, key=lambda k: (remaining(k), -k))
            issued[k] = pair
            program.append(_instruction(pair, OPERATIONS[k], addresses))
        pair += 1
    return program


def _instruction(pair: int, operation: tuple[str, ...], addresses: dict[str, int]) -> Instruction:
    result, op, a, b = operation
    if op == "look":
        table, word = b.split(".")
        b_code, b_outside = TABLES.index(table) << 1 | ("intercept", "slope").index(word), False
    elif b in OUTSIDE_B:
        b_code, b_outside = OUTSIDE_B.index(b), True
    else:
        b_code, b_outside = addresses[_source(b)] if b else 0, False
    a_outside = a in OUTSIDE_A
    return Instruction(
        pair, op, OUTSIDE_A.index(a) if a_outside else addresses[_source(a)], a_outside, b_code, b_outside,
        a.startswith("left."), addresses[result], OUTPUTS.index(result) if result in OUTPUTS else None,
    )  # fmt: skip


def pairs() -> int:
    """Pairs of clocks from the first operation to the last, both included."""
    return schedule()[-1].pair + 1


def verilog() -> str:
    """The text of rtl/effects/effect_program.v."""
    program = {instruction.pair: (instruction, operation) for instruction, operation in _with_operations()}
    last = max(program)
    lines = [
        "// effect_program: what the effect unit does in each pair of clocks. Made by",
        "//   python -m rtds_host.motor.effect_program rtl/effects/effect_program.v",
        "// from the list of operations there; a test fails when the two differ.",
        "//",
        "// Purpose    a read-only memory: pair of clocks in, one operation out, for effect_engine.",
        "// Handshake  none. Latency 0 (logic).",
        "// Format     {output, which (2), op (4), across, a outside, a (7), b outside, b (7), target (7)}; valid_o is 0",
        "//            in a pair in which nothing is issued; last_o marks the last pair.",
        "// Crossing   none.",
        "`default_nettype none",
        "",
        "module effect_program (",
        "  input  wire  [6:0] pair_i,",
        "  output reg         valid_o,",
        "  output reg  [30:0] word_o,",
        "  output wire        last_o",
        ");",
        f"  assign last_o = pair_i == 7'd{last};",
        "",
        "  always @* begin",
        "    valid_o = 1'b1;",
        "    word_o  = 31'd0;",
        "    case (pair_i)",
    ]
    for pair, (instruction, operation) in sorted(program.items()):
        result, op, a, b = operation
        comment = f"{result} = {op} {a}{', ' + b if b else ''}"
        lines.append(f"      7'd{pair}:{' ' * (4 - len(str(pair)))}word_o = 31'h{instruction.word:08X};  // {comment}")
    lines += ["      default: valid_o = 1'b0;", "    endcase", "  end", "endmodule", "", "`default_nettype wire", ""]
    return "\n".join(lines)


def _with_operations() -> list[tuple[Instruction, tuple[str, ...]]]:
    by_target = {}
    addresses_of = {}
    for instruction in schedule():
        by_target[instruction.target] = instruction
    targets = {name: k for k, name in enumerate(CONSTANTS)}
    targets |= {name: STATE_FIRST + k for k, name in enumerate(STATES)}
    count = TEMPORARY_FIRST
    for operation in OPERATIONS:
        if operation[0] not in targets:
            targets[operation[0]] = count
            count += 1
        addresses_of[targets[operation[0]]] = operation
    return [(instruction, addresses_of[target]) for target, instruction in by_target.items()]


def main(arguments: Sequence[str]) -> None:
    """Write the ROM to the file named."""
    Path(arguments[0]).write_text(verilog())


if __name__ == "__main__":
    main(sys.argv[1:])
