"""cocotb tests of rtds_core: the contract of its ports, clock by clock, and its words against the model's.

`CORE_STEPS` and `CORE_SEED` in the environment set the length and the seed of the random test.
"""

from __future__ import annotations

import os
import random

import cocotb
import numpy as np
from cocotb.clock import Clock
from cocotb.triggers import ReadOnly, RisingEdge

from rtds_host.link import core_records
from rtds_host.motor import CoreModel

VALID_CLOCKS = 11
LOW_CLOCKS = 18
READY_CLOCKS = 26
PARAMETER_CLOCKS = 107
FAULT_CLOCKS = 93

NOMINAL = (8.6, 1e-3, 6.538e-3, 6.538e-3, 1e-7, 4.372e-7, 1e-5)
ONE_NAN = 0x7FC00000


def words(values) -> list[int]:
    """float32 words of numbers, as Python integers."""
    with np.errstate(over="ignore"):
        return [int(word) for word in np.asarray(values, dtype=np.float64).astype(np.float32).view(np.uint32)]


class TB:
    """The core, its clock, and the model that it is compared with."""

    def __init__(self, dut) -> None:
        self.dut = dut
        self.model = CoreModel()
        self.parameters = words(NOMINAL)
        self.method = 0
        Clock(dut.clk_i, 20, unit="ns", impl="gpi").start()

    async def reset(self) -> None:
        dut = self.dut
        dut.rst_ni.value = 0
        for port in (dut.strobe_i, dut.clear_i, dut.motor_r_i, dut.word_valid_i, dut.word_i):
            port.value = 0
        self.drive([0, 0], [0, 0])
        for _ in range(3):
            await RisingEdge(dut.clk_i)
        dut.rst_ni.value = 1
        await RisingEdge(dut.clk_i)

    def drive(self, v, t) -> None:
        """Words on the inputs and the parameters."""
        dut = self.dut
        dut.inputs_i.value = core_records.inputs([*v, *t])
        dut.motor_l_i.value = core_records.motor(self.parameters[:6])
        dut.settings_i.value = core_records.settings(self.parameters[6], self.method)

    def high(self) -> list[int]:
        """Words i_l, w_l, i_r, w_r; an X raises."""
        return core_records.state(int(self.dut.state_o.value))

    def low(self) -> list[int]:
        """Their low words."""
        return core_records.state(int(self.dut.low_o.value))

    async def clock(self) -> None:
        """One clock; returns where outputs are those after the edge and no longer change."""
        await RisingEdge(self.dut.clk_i)
        await ReadOnly()

    async def wait_ready(self) -> int:
        """Clocks until ready_o is seen."""
        clocks = 0
        while not int(self.dut.ready_o.value):
            await self.clock()
            clocks += 1
            assert clocks < 400, "ready_o must come back within 400 clocks"
        return clocks

    async def step(self, v, t, hold: bool = False) -> list[list[int]]:
        """One strobe with the inputs given, until ready; asserts words and model equal. Starts and ends ready.

        v, t : [left, right] words; hold : leave the inputs as they are after the strobe, or scramble them.
        Returns the model's (2, 4) words.
        """
        dut = self.dut
        # Out of the read-only phase: values written here act after the edge.
        await RisingEdge(dut.clk_i)
        self.drive(v, t)
        dut.strobe_i.value = 1
        await RisingEdge(dut.clk_i)
        dut.strobe_i.value = 0
        if not hold:  # only the strobe's edge counts
            for port in (dut.inputs_i, dut.motor_l_i, dut.motor_r_i, dut.settings_i):
                port.value = random.getrandbits(len(port))
        await ReadOnly()
        want = self.model.strobe(np.array(v, np.uint32), np.array(t, np.uint32), np.array(self.parameters, np.uint32),
                                 self.method).tolist()  # fmt: skip
        self.clocks_to_valid = self.clocks_to_ready = None
        clocks = 0
        while self.clocks_to_ready is None:
            await self.clock()
            clocks += 1
            assert clocks < 400, "ready_o must come back within 400 clocks"
            if int(dut.valid_o.value):
                assert self.clocks_to_valid is None, "one valid_o a step"
                self.clocks_to_valid = clocks
                assert self.high() == [*want[0][:2], *want[1][:2]], f"high words, inputs {v} {t}"
                assert int(dut.step_count_o.value) == self.model.step_count
                assert int(dut.nonfinite_o.value) == (not self.model.finite)
            if int(dut.ready_o.value):
                # Seen after edge n: a strobe may be given in the clock that follows, taken at edge n + 1.
                self.clocks_to_ready = clocks + 1
        assert self.clocks_to_valid is not None, "valid_o must come"
        assert self.high() == [*want[0][:2], *want[1][:2]], "high words must hold"
        assert self.low() == [*want[0][2:], *want[1][2:]], f"low words, inputs {v} {t}"
        assert int(dut.param_fault_o.value) == self.model.fault
        return want


def random_inputs(rng: random.Random) -> tuple[list[int], list[int]]:
    """Voltages and torques of a motor in its range; now and then words of any kind at all."""
    if rng.random() < 0.01:
        return [rng.getrandbits(32) for _ in "lr"], [rng.getrandbits(32) for _ in "lr"]
    return words([rng.uniform(-12, 12) for _ in "lr"]), words([rng.uniform(-5e-3, 5e-3) for _ in "lr"])


def random_parameters(rng: random.Random) -> list[int]:
    """Parameters near the nominal ones, far from them, or with one that is unusable."""
    spread = rng.choice((0.01, 0.3, 3.0))
    parameters = words([value * 10 ** rng.uniform(-spread, spread) for value in NOMINAL])
    if rng.random() < 0.25:
        bad = rng.choice((0, 0x80000000, ONE_NAN, 0x7F800000, 0xFF800000, 0xBF800000, 1, 0x007FFFFF, 0x7F7FFFFF))
        parameters[rng.randrange(7)] = bad
    return parameters


@cocotb.test()
async def latencies_are_the_documented_ones(dut):
    tb = TB(dut)
    await tb.reset()
    await tb.step(words([12, -12]), words([0, 1e-3]))
    assert (tb.clocks_to_valid, tb.clocks_to_ready) == (VALID_CLOCKS, PARAMETER_CLOCKS)
    for _ in range(50):
        await tb.step(words([12, -12]), words([0, 1e-3]))
        assert (tb.clocks_to_valid, tb.clocks_to_ready) == (VALID_CLOCKS, READY_CLOCKS)
    tb.parameters = words([*NOMINAL[:-1], -1e-5])
    await tb.step(words([12, -12]), words([0, 1e-3]))
    assert (tb.clocks_to_valid, tb.clocks_to_ready) == (VALID_CLOCKS, FAULT_CLOCKS)


@cocotb.test()
async def low_words_settle_when_documented(dut):
    tb = TB(dut)
    await tb.reset()
    await tb.step(words([12, 5]), words([0, 0]))
    for _ in range(20):
        await RisingEdge(dut.clk_i)
        tb.drive(words([12, 5]), words([0, 0]))
        dut.strobe_i.value = 1
        await RisingEdge(dut.clk_i)
        dut.strobe_i.value = 0
        want = tb.model.strobe(np.array(words([12, 5]), np.uint32), np.zeros(2, np.uint32),
                               np.array(tb.parameters, np.uint32), 0).tolist()  # fmt: skip
        for _ in range(LOW_CLOCKS):
            await tb.clock()
        assert tb.low() == [*want[0][2:], *want[1][2:]]
        await tb.wait_ready()


@cocotb.test()
async def input_acts_at_once_and_parameters_one_step_later(dut):
    tb = TB(dut)
    await tb.reset()
    rest = await tb.step(words([12, 12]), words([0, 0]))
    assert rest == [[0] * 4] * 2, "without coefficients the first step rests"
    first = await tb.step(words([12, -12]), words([0, 0]))
    assert first[0][0] == first[1][0] ^ 0x80000000 != 0, "both act in the very next step, with opposite signs"
    twin = CoreModel()
    for model_parameters in (tb.parameters, tb.parameters):
        twin.strobe(np.array(words([12, -12]), np.uint32), np.zeros(2, np.uint32),
                    np.array(model_parameters, np.uint32), 0)  # fmt: skip
    tb.parameters = words([4.3, *NOMINAL[1:]])
    changed = await tb.step(words([12, -12]), words([0, 0]))
    unchanged = twin.strobe(np.array(words([12, -12]), np.uint32), np.zeros(2, np.uint32),
                            np.array(words(NOMINAL), np.uint32), 0).tolist()  # fmt: skip
    assert changed == unchanged, "the step that reads new parameters still uses the old ones"
    changed = await tb.step(words([12, -12]), words([0, 0]))
    unchanged = twin.strobe(np.array(words([12, -12]), np.uint32), np.zeros(2, np.uint32),
                            np.array(words(NOMINAL), np.uint32), 0).tolist()  # fmt: skip
    assert changed != unchanged, "the step after it uses the new ones"


@cocotb.test()
async def unusable_parameters_raise_the_fault_and_keep_the_old_coefficients(dut):
    tb = TB(dut)
    await tb.reset()
    for _ in range(3):
        await tb.step(words([12, 6]), words([0, 0]))
    for index in range(7):
        for bad in (0.0, -NOMINAL[index], float("nan"), float("inf"), 1e-40):
            values = list(NOMINAL)
            values[index] = bad
            tb.parameters = words(values)
            await tb.step(words([12, 6]), words([0, 0]))
            assert int(dut.param_fault_o.value) == 1, f"parameter {index} = {bad}"
            await tb.step(words([12, 6]), words([0, 0]))
    tb.parameters = words([1e30, 1e30, *NOMINAL[2:4], 1e30, *NOMINAL[5:]])
    await tb.step(words([12, 6]), words([0, 0]))
    assert int(dut.param_fault_o.value) == 1, "the determinant overflows"
    tb.parameters = words(NOMINAL)
    await tb.step(words([12, 6]), words([0, 0]))
    assert int(dut.param_fault_o.value) == 0, "a usable set ends the fault"


@cocotb.test()
async def strobe_while_not_ready_is_refused_and_reported(dut):
    tb = TB(dut)
    await tb.reset()
    await tb.step(words([12, 6]), words([0, 0]))
    await RisingEdge(dut.clk_i)
    tb.drive(words([12, 6]), words([0, 0]))
    dut.strobe_i.value = 1  # and stays on: taken every 26th clock, refused at all others
    await RisingEdge(dut.clk_i)
    valids = 0
    for clock in range(1, 3 * READY_CLOCKS):
        await tb.clock()
        assert int(dut.overrun_o.value) == (clock % READY_CLOCKS != 0), f"{clock} clocks after the first strobe"
        if int(dut.valid_o.value):
            valids += 1
            want = tb.model.strobe(np.array(words([12, 6]), np.uint32), np.zeros(2, np.uint32),
                                   np.array(tb.parameters, np.uint32), 0).tolist()  # fmt: skip
            assert tb.high() == [*want[0][:2], *want[1][:2]]
    assert valids == 3


@cocotb.test()
async def clear_zeroes_the_state_and_keeps_the_parameters(dut):
    tb = TB(dut)
    await tb.reset()
    for clocks in range(1, READY_CLOCKS + 1):
        for _ in range(3):
            await tb.step(words([12, 6]), words([0, 0]))
        await RisingEdge(dut.clk_i)
        tb.drive(words([12, 6]), words([0, 0]))
        dut.strobe_i.value = 1
        await RisingEdge(dut.clk_i)
        dut.strobe_i.value = 0
        for _ in range(clocks):
            await RisingEdge(dut.clk_i)
        dut.clear_i.value = 1
        await RisingEdge(dut.clk_i)
        dut.clear_i.value = 0
        await tb.clock()
        tb.model.clear()
        assert tb.high() == tb.low() == [0] * 4, f"cleared {clocks} clocks after the strobe"
        assert int(dut.step_count_o.value) == 0 and int(dut.ready_o.value) == 1 and int(dut.valid_o.value) == 0
        for _ in range(READY_CLOCKS + 2):
            await tb.clock()
            assert not int(dut.valid_o.value), "the step under way was dropped"
    await tb.step(words([12, 6]), words([0, 0]))


@cocotb.test()
async def infinity_and_nan_in_the_state_are_reported_until_cleared(dut):
    tb = TB(dut)
    await tb.reset()
    await tb.step(words([12, 6]), words([0, 0]))
    await tb.step(words([12, float("inf")]), words([0, 0]))
    assert int(dut.nonfinite_o.value) == 1
    for _ in range(3):
        await tb.step(words([12, 6]), words([0, 0]))
    assert tb.high()[2:] == [ONE_NAN, ONE_NAN], "the NaN is the canonical one"
    await RisingEdge(dut.clk_i)
    dut.clear_i.value = 1
    await RisingEdge(dut.clk_i)
    dut.clear_i.value = 0
    tb.model.clear()
    await tb.clock()
    assert int(dut.nonfinite_o.value) == 0
    await tb.step(words([12, 6]), words([0, 0]))


@cocotb.test()
async def random_steps_equal_the_model_word_for_word(dut):
    rng = random.Random(int(os.environ.get("CORE_SEED", "1")))
    tb = TB(dut)
    await tb.reset()
    v, t = words([12, -6]), words([0, 1e-3])
    for _ in range(int(os.environ.get("CORE_STEPS", "400"))):
        if rng.random() < 0.3:
            v, t = random_inputs(rng)
        if rng.random() < 0.15:
            tb.parameters = random_parameters(rng)
            tb.method = rng.randrange(2)
        for _ in range(rng.choice((0, 0, 1, 7))):
            await tb.clock()
        await tb.step(v, t)
        if not tb.model.finite:
            await RisingEdge(dut.clk_i)
            dut.clear_i.value = 1
            await RisingEdge(dut.clk_i)
            dut.clear_i.value = 0
            tb.model.clear()
            await tb.clock()
