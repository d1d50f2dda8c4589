"""The program of the effect unit, and the Verilog ROM and codes that are made from it.

The effect unit (rtl/effects/effect_engine.v) carries out one list of operations in every step, on both sides at once: a
side has one multiplier, one adder, one memory of registers and its tables, and hands a result straight on to the
operation that waits for it. `OPERATIONS` says what is computed, in the names of docs/effect-unit.md; `ISSUE_CLOCKS`
says in which clock after the strobe each operation is issued. `schedule` finds out where each operand comes from at
that clock and when a result is written for later, and refuses a list in which one cannot be had; `word` is what the ROM
says in one clock. The bit-exact model (`effect_model`) does the same arithmetic, written out; the RTL's tests hold the
two together.

    python -m rtds_host.motor.effect_program rtl/effects
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
OUTPUTS = ("u_v", "u_t", "level_f", "level_b")
TABLES = ("command", "drop", "torque", "ripple", "forward", "backward")
# Cell of an argument of zero: tables of both signs have their middle there, the others one cell for what is below.
TABLE_ORIGIN = {"command": 128, "drop": 128, "torque": 128, "ripple": 1, "forward": 1, "backward": 1}
CELLS = 256
SIDES = 2
REGISTERS = 128
TEMPORARY_FIRST = 20
STATE_FIRST = 112  # two places for each: the value before the run and the one it makes change places with every run
ZERO = 127  # reads as zero

# What comes from outside, and the clock after the strobe from which it can be written into the registers.
INPUTS = {"T": 16, "R": 17, "Kb": 18, "vc": 19}
INPUT_FROM = {"T": 2, "R": 2, "Kb": 2, "vc": 3}
# What the multiplier can take without the registers, a clock after its result: i, w are the new state's.
DIRECT = ("i", "w", "vc")
DIRECT_FROM = {"i": 17, "w": 17, "vc": 4}

LATENCY = 3  # clocks of the multiplier and the adder
LOOK = 2  # from the argument of a table to the line of its cell
ACROSS = 1  # from both sides' products to the adders: `own` and `other`, which then need not stand any more
READ = 3  # from the clock of a write to the first operation that can read it
FIRST_READ = 4  # the first clock with operands from the registers: the ROM's first word counts in clock 2
STEP_CLOCKS = 50  # from a strobe to the next one, in whose clock the last result may still be written
# The clock in which the motor units take an output: it is in its register by then.
NEEDED = {"u_t": STEP_CLOCKS - 6, "level_f": STEP_CLOCKS - 5, "level_b": STEP_CLOCKS - 4, "u_v": STEP_CLOCKS - 3}


def _lookup(table: str, argument: str) -> list[tuple[str, ...]]:
    return [(f"{table}.u", "mul", f"{table}_k", argument), (f"{table}.product", "mul", f"{table}.slope", argument)]


def _sum_in_two_words(state: str, increment: str) -> list[tuple[str, ...]]:
    t, hi, z = f"{state}.t", f"{state}.sum", f"{state}.z"
    return [
        (t, "add", increment, f"{state}_lo"),
        (hi, "add", t, state),
        (z, "sub", hi, state),
        (f"{state}_lo.new", "sub", t, z),
    ]


# (result, operation, a, b). `x.new` is what the state x will be, `table.slope` and `table.intercept` are the line that
# `table.u` looked up; `other.draw` is the other side's. `limit`: a, of size b at most. `wrap`: a + 1 if a < 0, a - 1 if
# a >= 1, else a. `by_sign`: which of two constants is decided by the sign of T.
OPERATIONS: tuple[tuple[str, ...], ...] = (
    # what the supply would give without current: command * (1 - decline t / V)
    *_lookup("command", "vc"),
    ("command.offset", "add", "zero", "command.intercept"),
    ("bridge", "add", "command.offset", "command.product"),
    *_sum_in_two_words("fall", "decline"),
    ("full", "sub", "nominal", "fall.sum"),
    ("unsagged", "mul", "full", "bridge"),
    # less command * Rs (i_l v_l + i_r v_r) / V^2
    ("per_draw", "mul", "sag", "bridge"),
    ("draw", "mul", "vc", "i"),
    ("draws", "add", "other.draw", "draw"),
    ("sagged", "mul", "per_draw", "draws"),
    ("scaled", "sub", "unsagged", "sagged"),
    ("limited", "limit", "scaled", "limit"),
    # drop against the driving voltage, hot winding
    ("emf", "mul", "Kb", "w"),
    ("driving", "sub", "limited", "emf"),
    *_lookup("drop", "driving"),
    ("copper", "mul", "R", "i"),
    ("hot", "mul", "rise", "copper"),
    ("cooler", "sub", "limited", "hot"),
    ("cooler.less", "sub", "cooler", "drop.intercept"),
    ("u_v", "sub", "cooler.less", "drop.product"),
    # heat: rise' = heat_in (1 + rise) R i^2 - heat_out rise
    ("all_copper", "add", "copper", "hot"),
    ("power", "mul", "all_copper", "i"),
    ("heated", "mul", "heat_in", "power"),
    ("cooled", "mul", "heat_out", "rise"),
    ("warmed", "sub", "heated", "cooled"),
    *_sum_in_two_words("rise", "warmed"),
    # torque against speed and angle
    *_lookup("torque", "w"),
    ("load", "add", "T", "torque.intercept"),
    ("loaded", "add", "load", "torque.product"),
    ("turned", "mul", "phase", "w"),
    *_sum_in_two_words("angle", "turned"),
    ("angle.new", "wrap", "angle.sum", ""),
    *_lookup("ripple", "angle.new"),
    ("loaded.less", "sub", "loaded", "ripple.intercept"),
    ("u_t", "sub", "loaded.less", "ripple.product"),
    # levels of dry friction; the one backward with a minus
    *_lookup("forward", "w"),
    ("more_f", "by_sign", "load_driving", "T"),
    ("forward.offset", "add", "more_f", "forward.intercept"),
    ("level_f", "add", "forward.offset", "forward.product"),
    *_lookup("backward", "w"),
    ("more_b", "by_sign", "load_driven", "T"),
    ("backward.offset", "sub", "more_b", "backward.intercept"),
    ("level_b", "sub", "backward.offset", "backward.product"),
)
# A sum in two words leaves its high word as the new state but where that is wrapped first.
NEW_STATES = {"fall.sum": "fall", "rise.sum": "rise", "angle.new": "angle"} | {
    f"{s}_lo.new": f"{s}_lo" for s in ("fall", "rise", "angle")
}

# The clock in which each operation is issued (for `limit`: is done). Found by a search over list schedules for the
# shortest step; that it is one the engine can carry out is checked by `schedule`, that it means OPERATIONS by the
# tests.
ISSUE_CLOCKS: dict[str, int] = {
    "command.u": 4, "fall.t": 4, "cooled": 5, "more_f": 6, "fall.sum": 7, "more_b": 7, "command.product": 9,
    "command.offset": 9, "full": 10, "bridge": 12, "fall.z": 15, "unsagged": 16, "draw": 17, "fall_lo.new": 18,
    "backward.u": 18, "turned": 19, "copper": 20, "per_draw": 21, "draws": 21, "angle.t": 22, "forward.u": 22,
    "hot": 23, "backward.offset": 23, "sagged": 24, "torque.u": 25, "angle.sum": 25, "all_copper": 26,
    "backward.product": 26, "scaled": 27, "forward.product": 27, "emf": 28, "angle.new": 28, "power": 29,
    "forward.offset": 29, "limited": 30, "torque.product": 30, "load": 30, "driving": 31, "ripple.u": 31,
    "heated": 32, "level_b": 32, "loaded": 33, "drop.u": 34, "cooler": 34, "warmed": 35, "ripple.product": 36,
    "loaded.less": 36, "level_f": 37, "rise.t": 38, "u_t": 39, "drop.product": 40, "cooler.less": 40, "rise.sum": 41,
    "angle.z": 42, "u_v": 43, "rise.z": 44, "angle_lo.new": 45, "rise_lo.new": 47,
}  # fmt: skip

# Fields of the ROM's word and their bits, the first one uppermost. What is in the word of clock k:
FIELDS = {
    "mul": 1,        # factors enter the multiplier
    "mul_a": 2,      # the first one, a code of MUL_A
    "mul_b": 2,
    "add": 1,        # operands enter the adder
    "add_a": 2,
    "add_b": 2,
    "across": 1,     # the registers' operands of the adder in clock k + 1 are the other side's product and this side's
    "minus_a": 1,
    "minus_b": 1,
    "direct": 2,     # what the multiplier can take directly in clock k + 1, a code of DIRECT
    "look": 1,       # the product that stands is the argument of a table
    "table": 3,
    "limit": 1,      # the sum that stands is limited by what add_b would read
    "put": 1,        # the sum that stands is an output
    "which": 2,
    "write": 1,      # into the registers
    "source": 3,     # a code of WRITE
    "target": 7,
    "read_mul_a": 7,  # addresses, for operands in clock k + 2
    "by_sign": 1,     # of the two load constants read_mul_a's or the other, by the sign of T
    "read_mul_b": 7,
    "read_add_a": 7,
    "read_add_b": 7,
}  # fmt: skip
WORD_BITS = sum(FIELDS.values())
MUL_A = ("register", "slope", "sum")
MUL_B = ("register", "direct", "sum", "product")
ADD_A = ("register", "sum", "limited")
ADD_B = ("register", "product", "intercept", "wrap")
WRITE = ("product", "sum", *INPUTS)
READ_AHEAD = 2
# What the codes of a field's values stand for, in their order.
CODES = {
    "mul_a": MUL_A, "mul_b": MUL_B, "add_a": ADD_A, "add_b": ADD_B, "direct": DIRECT, "source": WRITE, "which": OUTPUTS,
    "table": TABLES,
}  # fmt: skip
# A code counts where its operation is done: the field that says so.
CODED_BY = {
    "mul_a": "mul", "mul_b": "mul", "add_a": "add", "add_b": "add", "table": "look", "which": "put", "source": "write",
    "direct": "direct",
}  # fmt: skip

MADE_BY = "python -m rtds_host.motor.effect_program rtl/effects"


class ScheduleError(ValueError):
    """`ISSUE_CLOCKS` cannot be carried out: the message names the operation, the operand and the clock."""


@dataclass(frozen=True)
class Issue:
    """One operation as the engine carries it out.

    Attributes
    ----------
    clock : after the strobe. unit : "mul", "add" or "limit".
    a, b : (source, which) of the operands, source a code of MUL_A .. ADD_B, which the address of a register or a code
    of DIRECT. minus_a, minus_b : signs of a sum's operands.
    """

    name: str
    clock: int
    unit: str
    a: tuple[str, int | None]
    b: tuple[str, int | None]
    minus_a: bool = False
    minus_b: bool = False


@dataclass(frozen=True)
class Program:
    """`issues`, and `writes` into the registers: (clock, source, address)."""

    issues: tuple[Issue, ...]
    writes: tuple[tuple[int, str, int], ...]


def constant_address(name: str) -> int:
    """Address of a constant in a side's register memory."""
    return CONSTANTS.index(name)


def _unit(op: str) -> str:
    return {"mul": "mul", "by_sign": "mul", "limit": "limit"}.get(op, "add")


class _Scheduler:
    def __init__(self, clocks: dict[str, int]) -> None:
        self.clocks = clocks
        self.kind = {result: op for result, op, *_ in OPERATIONS}
        if set(clocks) != set(self.kind):
            raise ScheduleError(f"clocks: {sorted(set(clocks) ^ set(self.kind))}: not the clocks of the operations")
        self.addresses = {name: k for k, name in enumerate(CONSTANTS)} | INPUTS | {"zero": ZERO}
        for k, name in enumerate(STATES):
            self.addresses[name] = STATE_FIRST + 2 * k
        for result, name in NEW_STATES.items():
            self.addresses.setdefault(result, self.addresses[name] + 1)
        self.results = {
            unit: sorted((clocks[name] + LATENCY, name) for name, op in self.kind.items() if _unit(op) == unit)
            for unit in ("mul", "add")
        }
        for unit, results in self.results.items():
            taken = [clock for clock, _ in results]
            if len(set(taken)) != len(taken):
                raise ScheduleError(f"{unit}: two operations in one clock")
        self.lines = sorted((clocks[f"{table}.u"] + LATENCY + LOOK, table) for table in TABLES)
        self.latest_read: dict[str, int] = {}  # of each result or input, the first clock with it as an operand

    def standing(self, events: list[tuple[int, str]], clock: int) -> str | None:
        """What the last of the events up to this clock left."""
        return max((event for event in events if event[0] <= clock), default=(0, None))[1]

    def source(self, port: str, name: str, clock: int, with_other: bool = False) -> str | None:
        """How an operand can be had at a port in a clock, None if it cannot."""
        if name == "":
            return "wrap" if port == "add_b" else None
        if name in DIRECT and port == "mul_b":
            return "direct" if clock >= DIRECT_FROM[name] else None
        if name.startswith("other."):
            there = self.standing(self.results["mul"], clock - ACROSS) == name.removeprefix("other.")
            return "other" if there and port == "add_a" else None
        if with_other:
            there = self.standing(self.results["mul"], clock - ACROSS) == name
            return "own" if there and port == "add_b" else None
        table, _, word = name.rpartition(".")
        if table in TABLES and word in ("slope", "intercept"):
            there = self.standing(self.lines, clock) == table
            return word if there and port == {"slope": "mul_a", "intercept": "add_b"}[word] else None
        if name == "limited":
            return "limited" if port == "add_a" and clock > self.clocks[name] else None
        if name in self.kind:
            unit = _unit(self.kind[name])
            if self.standing(self.results[unit], clock) == name:
                if unit == "mul" and port in ("mul_b", "add_b"):
                    return "product"
                if unit == "add" and port != "add_b":
                    return "sum"
            return "register" if clock >= self.clocks[name] + LATENCY + READ else None
        if name in INPUTS:
            return "register" if clock >= INPUT_FROM[name] + READ else None
        return "register" if clock >= FIRST_READ else None

    def issue(self, operation: tuple[str, ...]) -> Issue:
        name, op, first, second = operation
        clock = self.clocks[name]
        if op == "limit":
            if self.standing(self.results["add"], clock) != first:
                raise ScheduleError(f"{name}: {first} is not there in clock {clock}")
            return Issue(name, clock, op, ("sum", None), ("register", self.addresses[second]))
        ports = ("mul_a", "mul_b") if _unit(op) == "mul" else ("add_a", "add_b")
        signs = (False, op == "sub")
        for a, b, minus in ((first, second, signs), (second, first, signs[::-1])):
            source_a, source_b = (
                self.source(ports[0], a, clock),
                self.source(ports[1], b, clock, a.startswith("other.")),
            )
            if source_a is not None and source_b is not None and not (op == "wrap" and source_a != "sum"):
                break
        else:
            raise ScheduleError(f"{name} = {op} {first}, {second}: an operand cannot be had in clock {clock}")
        operands = []
        for source, operand in ((source_a, a), (source_b, b)):
            if source == "register":
                self.latest_read[operand] = min(self.latest_read.get(operand, STEP_CLOCKS + READ), clock)
                if operand in self.kind and operand not in self.addresses:
                    taken = [address for address in self.addresses.values() if TEMPORARY_FIRST <= address < STATE_FIRST]
                    self.addresses[operand] = max(taken, default=TEMPORARY_FIRST - 1) + 1
            code = (
                self.addresses[operand]
                if source == "register"
                else DIRECT.index(operand)
                if source == "direct"
                else None
            )
            operands.append((source, code))
        return Issue(name, clock, _unit(op), operands[0], operands[1], *minus)

    def writes(self) -> list[tuple[int, str, int]]:
        """Every result that is read from a register or is a state, written while it stands and early enough."""
        jobs = []  # (last clock, first clock, source, address)
        for unit, results in self.results.items():
            for k, (clock, name) in enumerate(results):
                if name not in self.latest_read and name not in NEW_STATES:
                    continue
                gone = results[k + 1][0] if k + 1 < len(results) else STEP_CLOCKS + 1
                last = min(gone - 1, self.latest_read.get(name, STEP_CLOCKS + READ) - READ)
                jobs.append((last, clock, "product" if unit == "mul" else "sum", self.addresses[name]))
        jobs += [(self.latest_read[name] - READ, INPUT_FROM[name], name, INPUTS[name]) for name in INPUTS]
        done = []
        for clock in range(STEP_CLOCKS + 1):
            ready = [job for job in jobs if job[1] <= clock]
            if ready:
                job = min(ready)
                if job[0] < clock:
                    raise ScheduleError(f"register {job[3]}: no clock to write it from {job[1]} to {job[0]}")
                jobs.remove(job)
                done.append((clock, job[2], job[3]))
        if jobs:
            raise ScheduleError(f"register {jobs[0][3]}: not written within the step")
        return done


def schedule() -> Program:
    """The operations with their operands' sources, and the writes between them.

    Raises
    ------
    ScheduleError : an operation of `ISSUE_CLOCKS` cannot have an operand in its clock, or a result comes too late.
    """
    scheduler = _Scheduler(ISSUE_CLOCKS)
    issues = sorted(
        (scheduler.issue(operation) for operation in OPERATIONS), key=lambda issue: (issue.clock, issue.unit)
    )
    for name, needed in NEEDED.items():
        if ISSUE_CLOCKS[name] + LATENCY >= needed:
            raise ScheduleError(f"{name}: is there in clock {ISSUE_CLOCKS[name] + LATENCY + 1}, needed in {needed}")
    return Program(tuple(issues), tuple(scheduler.writes()))


def words() -> list[dict[str, int]]:
    """The fields of the ROM's word of each clock after the strobe, from clock 0; those left out are 0."""
    program = schedule()
    rom: list[dict[str, int]] = [{} for _ in range(STEP_CLOCKS + 1)]

    def put(clock: int, **fields: int | None) -> None:
        for field, value in fields.items():
            assert field not in rom[clock], (clock, field)
            assert value is not None and 0 <= value < 1 << FIELDS[field], (clock, field, value)
            rom[clock][field] = value

    for issue in program.issues:
        clock, name = issue.clock, issue.name
        (source_a, address_a), (source_b, address_b) = issue.a, issue.b
        if issue.unit == "mul":
            put(clock, mul=1, mul_a=MUL_A.index(source_a), mul_b=MUL_B.index(source_b))
            by_sign = {"by_sign": 1} if name in ("more_f", "more_b") else {}
            if address_a is not None:
                put(clock - READ_AHEAD, read_mul_a=address_a, **by_sign)
            if source_b == "direct":
                put(clock - 1, direct=address_b)
            elif address_b is not None:
                put(clock - READ_AHEAD, read_mul_b=address_b)
            if name.endswith(".u"):
                put(clock + LATENCY, look=1, table=TABLES.index(name.removesuffix(".u")))
        elif issue.unit == "limit":
            put(clock, limit=1)
            put(clock - READ_AHEAD, read_add_b=address_b)
        else:
            across = {"other": "register", "own": "register"}
            put(clock, add=1, add_a=ADD_A.index(across.get(source_a, source_a)), add_b=ADD_B.index(across.get(source_b,
                source_b)),
                minus_a=int(issue.minus_a), minus_b=int(issue.minus_b))  # fmt: skip
            if source_a == "other":
                put(clock - ACROSS, across=1)
            if address_a is not None:
                put(clock - READ_AHEAD, read_add_a=address_a)
            if address_b is not None:
                put(clock - READ_AHEAD, read_add_b=address_b)
            if name in OUTPUTS:
                put(clock + LATENCY, put=1, which=OUTPUTS.index(name))
    for clock, source, address in program.writes:
        put(clock, write=1, source=WRITE.index(source), target=address)
    return rom


def word(fields: dict[str, int]) -> int:
    """The ROM's word of these fields."""
    value = 0
    for field, bits in FIELDS.items():
        value = value << bits | fields.get(field, 0)
    return value


def address_name(address: int) -> str:
    """What is in a register: a constant, an input, a state, zero, or a temporary result by its number."""
    if address == ZERO:
        return "zero"
    if address >= STATE_FIRST:
        return STATES[(address - STATE_FIRST) // 2]
    names = dict(enumerate(CONSTANTS)) | {place: name for name, place in INPUTS.items()}
    return names.get(address, f"temporary {address - TEMPORARY_FIRST}")


def _place(field: str) -> str:
    """The localparam with the field's lowest bit in the word."""
    return f"AT_{field.upper()}"


def _places() -> list[str]:
    """Lines that declare the fields' places, from the word's lower end."""
    lines, bit = [], 0
    for field, bits in reversed(FIELDS.items()):
        lines.append(f"  localparam {_place(field)} = {bit};")
        bit += bits
    return lines[::-1]


def _word_lines(fields: dict[str, int]) -> list[str]:
    """A word as the sum of its fields, one a line with the name of its value; those that are 0 are left out."""
    terms = []
    for field, bits in FIELDS.items():
        value = fields.get(field, 0)
        address = field == "target" or field.startswith("read_")
        if value or address and field in fields or field in CODES and fields.get(CODED_BY[field]):
            if address:
                name = address_name(value)
            elif field in CODES:
                name = CODES[field][value]
            else:
                name = "" if bits == 1 else str(value)
            terms.append((f"{WORD_BITS}'d{value} << {_place(field)}", name))
    width = max(len(term) for term, _ in terms)
    lines = []
    for k, (term, name) in enumerate(terms):
        end = ";" if k == len(terms) - 1 else ""
        sign = "word =" if k == 0 else "     |"
        comment = f"{' ' * (width - len(term) - len(end) + 3)}// {name}" if name else ""
        lines.append(f"        {sign} {term}{end}{comment}")
    return lines


def verilog() -> str:
    """The text of rtl/effects/effect_program.v."""
    rom = words()
    comments: dict[int, list[str]] = {}
    for name, op, a, b in OPERATIONS:
        comments.setdefault(ISSUE_CLOCKS[name], []).append(f"{name} = {op} {a}{', ' + b if b else ''}")
    last = max(clock for clock, fields in enumerate(rom) if fields)
    names = list(FIELDS)
    lines = [
        "// effect_program: what both sides of the effect unit do in each clock of a step. Made by",
        f"//   {MADE_BY}",
        "// from the list of operations there, which also says what the fields mean; a test fails when the two differ.",
        "//",
        "// Purpose    a read-only memory: a clock in, counted from the strobe's, out in the next one what is to be "
        "done then.",
        "// Handshake  rest_i: nothing is done in the next clock. Latency 1.",
        "// Format     each field is an output; nothing is done where it is 0. Codes are those of effect_codes.vh.",
        "// Crossing   none.",
        "`default_nettype none",
        "",
        "module effect_program (",
        "  input  wire        clk_i,",
        "  input  wire        rst_ni,",
        "  input  wire        rest_i,",
        "  input  wire  [5:0] clock_i,",
        "  output wire        last_o,       // clock_i is the last clock with something to do",
    ]
    for name in names:
        bits = FIELDS[name]
        lines.append(
            f"  output wire {f'[{bits - 1}:0]' if bits > 1 else '':>6} {name}_o{',' if name != names[-1] else ''}"
        )
    lines += [
        ");",
        "  // The lowest bit of each field in the word.",
        *_places(),
        "",
        f"  reg [{WORD_BITS - 1}:0] word;",
        f"  reg [{WORD_BITS - 1}:0] word_q;",
        "",
        f"  assign last_o = clock_i == 6'd{last};",
        "  assign {" + ", ".join(f"{name}_o" for name in names[:9]) + ",",
        "          " + ", ".join(f"{name}_o" for name in names[9:16]) + ",",
        "          " + ", ".join(f"{name}_o" for name in names[16:]) + "} = word_q;",
        "",
        "  always @* begin",
        "    case (clock_i)",
    ]
    for clock, fields in enumerate(rom):
        if fields:
            lines += [f"      // {comment}" for comment in comments.get(clock, [])]
            lines += [f"      6'd{clock - 1}:", *_word_lines(fields)]
    lines += [
        f"      default: word = {WORD_BITS}'h0;",
        "    endcase",
        "  end",
        "",
        "  always @(posedge clk_i or negedge rst_ni) begin",
        f"    if (!rst_ni) word_q <= {WORD_BITS}'h0;",
        f"    else word_q <= rest_i ? {WORD_BITS}'h0 : word;",
        "  end",
        "endmodule",
        "",
        "`default_nettype wire",
        "",
    ]
    return "\n".join(lines)


def codes() -> str:
    """The text of rtl/effects/effect_codes.vh."""
    lines = [
        "// Codes of the fields of effect_program, for `include inside effect_side, which carries them out. Made by",
        f"//   {MADE_BY}",
        "// a test fails when the two differ.",
        "// verilator lint_save",
        "// verilator lint_off UNUSEDPARAM",
    ]
    for field, values in CODES.items():
        bits = FIELDS[field]
        lines.append("")
        for code, value in enumerate(values):
            lines.append(f"localparam [{bits - 1}:0] {f'{field}_{value}'.upper()} = {bits}'d{code};")
    first = min(TABLES.index(table) for table, origin in TABLE_ORIGIN.items() if origin == 1)
    driving, driven = (constant_address(f"load_{which}") for which in ("driving", "driven"))
    lines += [
        "",
        "// Tables below this one have arguments of both signs.",
        f"localparam [2:0] TABLE_UNSIGNED = 3'd{first};",
        "",
        "// What the addresses of the two load constants differ in.",
        f"localparam [6:0] OTHER_LOAD = 7'd{driving ^ driven};",
        "",
        "// verilator lint_restore",
        "",
    ]
    return "\n".join(lines)


FILES = {"effect_program.v": verilog, "effect_codes.vh": codes}


def main(arguments: Sequence[str]) -> None:
    """Write the ROM and the codes to the folder named."""
    for name, text in FILES.items():
        (Path(arguments[0]) / name).write_text(text())


if __name__ == "__main__":
    main(sys.argv[1:])
