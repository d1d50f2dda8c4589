"""pll_restart at the board's own values: a PLL that needs its longest time locks."""

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, Timer, with_timeout
from cocotb.utils import get_sim_time

PULSE_NS = 16 * 20
LONGEST_LOCK_NS = 1_000_000  # the longest lock time of a Cyclone V's PLL after its reset (CV-51002, t_LOCK: 1 ms)


@cocotb.test()
async def a_pll_that_needs_a_millisecond_locks(dut):
    """No second pulse comes within twice the longest lock time; one comes within 3 ms."""
    dut.rst_ni.value = 0
    dut.locked_i.value = 0
    dut.clk_i.value = 0
    cocotb.start_soon(Clock(dut.clk_i, 20, "ns", impl="gpi").start())
    await Timer(105, "ns")
    dut.rst_ni.value = 1
    await with_timeout(RisingEdge(dut.rst_o), 1, "us")
    begin = get_sim_time("ns")
    await with_timeout(FallingEdge(dut.rst_o), 1, "us")
    assert get_sim_time("ns") - begin == PULSE_NS
    await with_timeout(RisingEdge(dut.rst_o), 3, "ms")
    assert get_sim_time("ns") - begin >= 2 * LONGEST_LOCK_NS
