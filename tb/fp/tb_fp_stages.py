"""fp_add and fp_mul with each stage enabled for itself: a stage that is not keeps what it has, and no other does."""

import random

import cocotb
import numpy as np
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

from fp.fp_reference import expected, random_pairs

CLOCKS = 3000
SUBTRACT = 1


@cocotb.test()
async def each_stage_is_enabled_for_itself(dut):
    """Random enables of each stage in each clock, and runs of clocks in which one stage alone moves."""
    add = hasattr(dut, "sub_i")
    rng = random.Random(43)
    pairs = random_pairs(CLOCKS, seed=43)
    answers = expected(pairs)
    dut.en_i.value = 0
    dut.clk_i.value = 0
    cocotb.start_soon(Clock(dut.clk_i, 20, "ns", impl="gpi").start())
    stages = [None, None, None]  # the answer to what each stage holds
    enables, held, looked = 0b111, 0, 0
    for clock in range(CLOCKS):
        await FallingEdge(dut.clk_i)
        if stages[2] is not None:
            got = int(dut.y_o.value)
            assert got == stages[2], f"clock {clock}: {got:08x} instead of {stages[2]:08x}"
            looked += 1
        if held == 0:
            enables = 0b111 if clock < 3 else rng.randrange(8)
            held = rng.choice([1, 1, 1, 2, 4])
        held -= 1
        subtract = rng.randrange(2) if add else 0
        a, b = (int(word) for word in pairs[clock])
        dut.a_i.value, dut.b_i.value, dut.en_i.value = a, b, enables
        if add:
            dut.sub_i.value = subtract
        answer = int(answers[clock, SUBTRACT if subtract else 0] if add else answers[clock, 2])
        before = [answer, *stages[:2]]
        stages = [before[k] if enables >> k & 1 else stages[k] for k in range(3)]
    assert looked > CLOCKS - 10 and len(np.unique(answers[:, 0])) > CLOCKS // 2
