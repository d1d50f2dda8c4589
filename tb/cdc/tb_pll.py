"""pll_adc, the branch for simulation: frequency, phase, lock time, and every way to lose the lock."""

from itertools import pairwise

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import RisingEdge, Timer, with_timeout
from cocotb.utils import get_sim_time


@cocotb.test()
async def frequency_phase_and_lock(dut):
    """40 MHz twice, the second 7.5 ns late; lock LOCK_NS after the reference runs; lost with it, reset or a fault."""
    dut.rst_i.value = 0
    dut.refclk_i.value = 0
    await Timer(5, "us")
    assert int(dut.locked_o.value) == 0, "locked without a reference"
    clock = cocotb.start_soon(Clock(dut.refclk_i, 20, "ns").start())
    begin = get_sim_time("ns")
    await with_timeout(RisingEdge(dut.locked_o), 5, "us")
    assert 1990 <= get_sim_time("ns") - begin <= 2050

    edges = []
    for _ in range(9):
        await RisingEdge(dut.outclk_adc_o)
        edges.append(get_sim_time("ps"))
        await RisingEdge(dut.outclk_cnv_o)
        assert get_sim_time("ps") - edges[-1] == 7500
    assert {b - a for a, b in pairwise(edges)} == {25000}

    dut.rst_i.value = 1
    await Timer(50, "ns")
    assert int(dut.locked_o.value) == 0
    dut.rst_i.value = 0
    await with_timeout(RisingEdge(dut.locked_o), 5, "us")

    dut.fail.value = 1
    await Timer(50, "ns")
    assert int(dut.locked_o.value) == 0
    dut.fail.value = 0
    await with_timeout(RisingEdge(dut.locked_o), 5, "us")

    clock.cancel()
    await Timer(200, "ns")
    assert int(dut.locked_o.value) == 0, "the reference stopped"
