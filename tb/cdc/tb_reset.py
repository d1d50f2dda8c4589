"""reset_ctrl: asserted with its cause, released with the clock, held until the lock has been good for LOCK_CLOCKS."""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, ReadOnly, RisingEdge, Timer, with_timeout

LOCK_CLOCKS = 63


async def start(dut, phase_ps=0):
    """Both clocks, button pressed, no lock."""
    dut.ext_rst_ni.value = 0
    dut.pll_locked_i.value = 0
    dut.clk_adc_i.value = 0
    cocotb.start_soon(Clock(dut.clk_sys_i, 20000, "ps", impl="gpi").start())
    await Timer(phase_ps + 1, "ps")
    cocotb.start_soon(Clock(dut.clk_adc_i, 25000, "ps", impl="gpi").start())
    await Timer(200, "ns")


def resets(dut):
    """Of the registers, the computing part, the ADC, the DAC's pin."""
    return tuple(int(getattr(dut, f"rst_{name}_no").value) for name in ("sys", "run", "adc", "pin"))


async def released_with(clock, reset):
    """Wait for the release; it has to come at a rising edge of its clock."""
    await RisingEdge(reset)
    now = cocotb.utils.get_sim_time("ps")
    assert int(clock.value) == 1
    await FallingEdge(clock)
    half = {20000: 10000, 25000: 12500}
    assert cocotb.utils.get_sim_time("ps") - now in half.values(), "released off the clock's edge"


@cocotb.test()
async def held_until_locked(dut):
    """The button frees the registers at once; the rest waits for the lock and its holding time."""
    await start(dut, 7300)
    await ReadOnly()
    assert resets(dut) == (0, 0, 0, 0)
    await Timer(1, "ps")
    dut.ext_rst_ni.value = 1
    await released_with(dut.clk_sys_i, dut.rst_sys_no)
    await Timer(3, "us")
    assert resets(dut) == (1, 0, 0, 0) and int(dut.locked_o.value) == 0
    dut.pll_locked_i.value = 1
    count = 0
    run = cocotb.start_soon(released_with(dut.clk_sys_i, dut.rst_run_no))
    adc = cocotb.start_soon(released_with(dut.clk_adc_i, dut.rst_adc_no))
    while not run.done():
        await RisingEdge(dut.clk_sys_i)
        count += 1
        assert count < 2 * LOCK_CLOCKS
    assert count == LOCK_CLOCKS + 11, f"released {count} clocks after lock"
    await adc
    await Timer(200, "ns")
    assert resets(dut) == (1, 1, 1, 1) and int(dut.locked_o.value) == 1


@cocotb.test()
async def a_lost_lock_is_seen_however_short(dut):
    """A glitch of 1 ns resets ADC and DAC at once, the core soon, the registers not, and is reported exactly once."""
    await start(dut)
    dut.ext_rst_ni.value = 1
    dut.pll_locked_i.value = 1
    await Timer(3, "us")
    assert resets(dut) == (1, 1, 1, 1)
    rng = random.Random(21)
    reports = []

    async def count_reports():
        while True:
            await RisingEdge(dut.clk_sys_i)
            await ReadOnly()
            reports.append(int(dut.lock_lost_o.value))

    cocotb.start_soon(count_reports())
    for trial in range(20):
        await Timer(rng.randint(1, 40000), "ps")
        before = sum(reports)
        dut.pll_locked_i.value = 0
        await Timer(1, "ns")
        assert resets(dut)[2:] == (0, 0), "no clock is needed to assert"
        dut.pll_locked_i.value = 1
        await Timer(80, "ns")
        assert resets(dut) == (1, 0, 0, 0)
        await Timer(LOCK_CLOCKS * 20 - 120, "ns")
        assert resets(dut) == (1, 0, 0, 0), "the lock has to prove itself again"
        await Timer(600, "ns")
        assert resets(dut) == (1, 1, 1, 1)
        assert sum(reports) == before + 1, f"trial {trial}: reported {sum(reports) - before} times"


@cocotb.test()
async def listeners_are_told_before_the_core_is_reset(dut):
    """A lost lock closes open_o for a clock or more before rst_run_no falls, both with the clock; held_o says
    it has.
    """
    await start(dut)
    dut.ext_rst_ni.value = 1
    dut.pll_locked_i.value = 1
    await Timer(3, "us")
    rng = random.Random(23)
    for _ in range(20):
        await Timer(rng.randint(1, 40000), "ps")
        assert int(dut.open_o.value) == 1 and int(dut.held_o.value) == 0
        dut.pll_locked_i.value = 0
        await with_timeout(FallingEdge(dut.open_o), 3, "us")
        closed = cocotb.utils.get_sim_time("ps")
        assert int(dut.clk_sys_i.value) == 1 and int(dut.rst_run_no.value) == 1
        await with_timeout(FallingEdge(dut.rst_run_no), 3, "us")
        assert cocotb.utils.get_sim_time("ps") - closed == 20000, "a whole clock"
        await ReadOnly()
        assert int(dut.held_o.value) == 0, "not yet"
        await with_timeout(RisingEdge(dut.held_o), 3, "us")
        dut.pll_locked_i.value = 1
        await with_timeout(FallingEdge(dut.held_o), 3, "us")
        assert int(dut.rst_run_no.value) == 0, "no longer, before it is released"
        await with_timeout(RisingEdge(dut.rst_run_no), 3, "us")
        assert int(dut.open_o.value) == 1
        await Timer(1, "us")


@cocotb.test()
async def the_button_resets_everything(dut):
    """Asserted without a clock edge in between, in all domains; locks already good are waited for again by run."""
    await start(dut)
    dut.ext_rst_ni.value = 1
    dut.pll_locked_i.value = 1
    await Timer(3, "us")
    rng = random.Random(22)
    for _ in range(20):
        await Timer(rng.randint(1, 40000), "ps")
        dut.ext_rst_ni.value = 0
        await Timer(1, "ps")
        assert resets(dut) == (0, 0, 0, 0)
        await Timer(rng.randint(1, 40000), "ps")
        dut.ext_rst_ni.value = 1
        await Timer(1, "ps")
        assert resets(dut) == (0, 0, 0, 0), "released without a clock"
        await Timer(200, "ns")
        assert resets(dut) == (1, 1, 1, 1)
