"""The core with effects on both simulators: every word of every step against the model, and its ports clock by
clock.
"""

from __future__ import annotations

import hashlib
import subprocess
from pathlib import Path

import numpy as np
import pytest
from common.runner import ROOT, SIMULATORS, run_cocotb, verilate

from effects.effect_script import Script, sensible, wild
from rtds_host.motor import effect_program

SOURCES = ["rtl/fp/fp.f", "rtl/core/core.f"]
COLUMNS = ("i_l", "w_l", "i_r", "w_r", "i_l_lo", "w_l_lo", "i_r_lo", "w_r_lo", "fault and nonfinite")
needs_verilator = [s for s in SIMULATORS if s == "verilator"]
needs_icarus = [s for s in SIMULATORS if s == "icarus"]


@pytest.mark.parametrize("name", effect_program.FILES)
def test_the_program_and_its_codes_in_the_rtl_are_those_of_the_model(name):
    assert (ROOT / "rtl/effects" / name).read_text() == effect_program.FILES[name]()


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_the_ports_with_effects_clock_by_clock(simulator):
    run_cocotb("rtds_core", SOURCES, "tb_effects", "tb/effects", simulator)


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_every_border_of_every_cell_of_a_table(simulator):
    run_cocotb("effect_index", ["rtl/effects/effect_index.v"], "tb_index", "tb/effects", simulator)


@pytest.mark.long
@pytest.mark.parametrize("simulator", needs_icarus)
def test_thousands_of_random_steps_with_effects_on_icarus(simulator):
    name = "random_effects_switched_and_changed_while_the_motors_turn"
    more = {"EFFECT_STEPS": "4000"}
    run_cocotb("rtds_core", SOURCES, "tb_effects", "tb/effects", simulator, testcase=name, extra_env=more)


def term(operation: str, *operands: tuple[object, int]) -> tuple:
    """An operation whose two operands, with their signs, may change places; a digest keeps deep terms short."""
    text = repr((operation, sorted(operands, key=repr)))
    return (operation, hashlib.sha256(text.encode()).hexdigest())


class Machine:
    """One side of the engine on terms instead of numbers: what the words of the ROM compute, clock by clock.

    A term is a tuple (operation, operands); operands that stand nowhere any more, or not yet, are None and fail the
    test.
    """

    def __init__(self) -> None:
        self.registers = {address: ("constant", name) for address, name in enumerate(effect_program.CONSTANTS)}
        for k, name in enumerate(effect_program.STATES):
            self.registers[effect_program.STATE_FIRST + 2 * k] = ("state", name)
        self.newer = 0

    def place(self, address: int) -> int:
        return address ^ self.newer if address >= effect_program.STATE_FIRST else address

    def run(self, inputs: dict[str, tuple]) -> dict[str, tuple]:
        """The outputs of a step, and the state after it under the states' names."""
        rom, inputs = effect_program.words(), dict(inputs)
        pipes = {"product": [None] * 3, "sum": [None] * 3}
        stands = dict.fromkeys(("product", "sum", "direct", "slope", "intercept", "limited"))
        read, ready, line, put = {}, {}, [None, None], {}

        def take(codes: tuple[str, ...], code: int, port: str, kind: str) -> tuple:
            source = codes[code]
            if source == "register":
                return ready[port]
            if source == "wrap":
                return ("wrap", stands["sum"])
            return stands[source]

        for clock, fields in enumerate(rom):
            f = {name: fields.get(name, 0) for name in effect_program.FIELDS}
            # results that leave their operators in this clock
            for unit in ("product", "sum"):
                done = pipes[unit].pop(0)
                stands[unit] = done or stands[unit]
            entering = dict.fromkeys(("product", "sum"))
            if f["mul"]:
                factors = [
                    take(effect_program.MUL_A, f["mul_a"], "mul_a", "mul"),
                    take(effect_program.MUL_B, f["mul_b"], "mul_b", "mul"),
                ]
                assert None not in factors, f"clock {clock}: a factor stands nowhere"
                entering["product"] = term("mul", (factors[0], 0), (factors[1], 0))
            if f["add"]:
                terms = [
                    take(effect_program.ADD_A, f["add_a"], "add_a", "add"),
                    take(effect_program.ADD_B, f["add_b"], "add_b", "add"),
                ]
                assert None not in terms, f"clock {clock}: a term stands nowhere"
                entering["sum"] = term("sum", (terms[0], f["minus_a"]), (terms[1], f["minus_b"]))
            pipes["product"].append(entering["product"])
            pipes["sum"].append(entering["sum"])
            # what the end of this clock leaves for the next one
            if f["limit"]:
                stands["limited"] = ("limit", repr(stands["sum"]), repr(ready["add_b"]))
            if f["put"]:
                put[effect_program.OUTPUTS[f["which"]]] = stands["sum"]
            stands["slope"], stands["intercept"] = line[0] or (stands["slope"], stands["intercept"])
            table = effect_program.TABLES[f["table"]] if f["look"] else ""
            line = [
                tuple((f"{table}.{word}", repr(stands["product"])) for word in ("slope", "intercept"))
                if f["look"]
                else None,
                None,
            ]
            stands["direct"] = inputs[effect_program.DIRECT[min(f["direct"], 2)]] if clock >= 3 else None
            if clock < effect_program.DIRECT_FROM["i"] - 1 and f["direct"] < 2:
                stands["direct"] = None
            ready = {port: read.get(port) for port in ("mul_a", "mul_b", "add_a", "add_b")}
            if f["across"]:
                ready["add_a"], ready["add_b"] = ("other", stands["product"]), stands["product"]
            for port in ready:
                address = f[f"read_{port}"]
                value = ("zero",) if address == effect_program.ZERO else self.registers.get(self.place(address))
                read[port] = ("by_sign", value) if port == "mul_a" and f["by_sign"] else value
            if f["write"]:
                source = effect_program.WRITE[f["source"]]
                if source in effect_program.INPUT_FROM:
                    assert clock >= effect_program.INPUT_FROM[source]
                    self.registers[f["target"]] = inputs[source]
                else:
                    self.registers[self.place(f["target"])] = stands[source]
        self.newer ^= 1
        for address in range(effect_program.TEMPORARY_FIRST, effect_program.STATE_FIRST):
            self.registers.pop(address, None)  # a temporary of one step is not read in the next
        for k, name in enumerate(effect_program.STATES):
            put[name] = self.registers[effect_program.STATE_FIRST + 2 * k + self.newer]
        return put


def meant(inputs: dict[str, tuple], states: dict[str, tuple]) -> dict[str, tuple]:
    """The same terms straight from the list of operations."""
    values = {name: ("constant", name) for name in effect_program.CONSTANTS} | inputs | states | {"zero": ("zero",)}
    after = {}
    for result, op, a, b in effect_program.OPERATIONS:
        for operand in (a, b):
            table, _, word = operand.rpartition(".")
            if word in ("slope", "intercept"):
                values[operand] = (operand, repr(values[f"{table}.u"]))
        first = ("other", values[a.removeprefix("other.")]) if a.startswith("other.") else values[a]
        second = values.get(b)
        if op in ("mul", "by_sign"):
            first = ("by_sign", first) if op == "by_sign" else first
            values[result] = term("mul", (first, 0), (second, 0))
        elif op == "limit":
            values[result] = ("limit", repr(first), repr(second))
        elif op == "wrap":
            values[result] = term("sum", (first, 0), (("wrap", first), 0))
        else:
            values[result] = term("sum", (first, 0), (second, int(op == "sub")))
        if result in effect_program.NEW_STATES:
            after[effect_program.NEW_STATES[result]] = values[result]
    return after | {name: values[name] for name in effect_program.OUTPUTS}


def test_the_words_of_the_program_compute_what_the_list_of_operations_means():
    """Two steps, 50 clocks apart, carried out on terms with the engine's latencies: every operand stands where it is
    taken.
    """
    machine = Machine()
    states = {name: ("state", name) for name in effect_program.STATES}
    for step in range(2):
        inputs = {name: (name, step) for name in ("vc", "T", "R", "Kb", "i", "w")}
        want = meant(inputs, states)
        assert machine.run(inputs) == want
        states = {name: want[name] for name in effect_program.STATES}


def test_an_operation_a_clock_earlier_than_its_operands_is_refused(monkeypatch):
    """The schedule's own check is of some use: most operations of the critical path cannot come a clock sooner."""
    refused = 0
    for name in ("draws", "sagged", "scaled", "limited", "driving", "drop.product", "u_v", "angle.new", "rise_lo.new"):
        clocks = dict(effect_program.ISSUE_CLOCKS)
        clocks[name] -= 1
        monkeypatch.setattr(effect_program, "ISSUE_CLOCKS", clocks)
        with pytest.raises(effect_program.ScheduleError):
            effect_program.schedule()
        refused += 1
    assert refused == 9


def assert_every_word_equal(script: Script, folder: Path, extra: int) -> None:
    """Run the script on Verilator; every step's words, flags and latencies are the model's."""
    program = verilate("rtds_core", SOURCES, "tb/effects/effect_bench.cpp", name="rtds_core-effects-bench")
    script.data.astype("<u4").tofile(folder / "script.bin")
    command = [program, folder / "script.bin", folder / "out.bin", str(extra)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    got = np.fromfile(folder / "out.bin", dtype="<u4").reshape(-1, len(COLUMNS))
    want = script.expected
    assert len(got) == len(want)
    wrong = np.argwhere(got != want)
    shown = [f"step {n} {COLUMNS[k]}: {got[n, k]:08x}, model {want[n, k]:08x}" for n, k in wrong[:6]]
    assert not len(wrong), f"{len(wrong)} words differ: {'; '.join(shown)}"


@pytest.mark.parametrize("simulator", needs_verilator)
def test_every_word_of_random_effects_and_motors_equals_the_model(simulator, tmp_path):
    script = sensible(np.random.default_rng(41), parts=100, strobes=60)
    states = script.expected.view(np.float32)[:, :8]
    # The script is worth something: motors turn, stick at exactly zero, and start again.
    for speed in (states[:, 1], states[:, 3]):
        assert np.abs(speed).max() > 100.0
        assert 0.02 < (speed == 0.0).mean() < 0.9
        assert ((speed[1:] != 0.0) & (speed[:-1] == 0.0)).sum() > 20
    assert_every_word_equal(script, tmp_path, extra=3)


@pytest.mark.parametrize("simulator", needs_verilator)
def test_every_word_equals_the_model_with_arbitrary_words_everywhere(simulator, tmp_path):
    assert_every_word_equal(wild(np.random.default_rng(42), parts=150), tmp_path, extra=0)


@pytest.mark.long
@pytest.mark.parametrize("simulator", needs_verilator)
def test_every_word_of_many_random_effects_equals_the_model(simulator, tmp_path):
    assert_every_word_equal(sensible(np.random.default_rng(43), parts=4000, strobes=60), tmp_path, extra=3)
    assert_every_word_equal(wild(np.random.default_rng(44), parts=4000), tmp_path, extra=0)
