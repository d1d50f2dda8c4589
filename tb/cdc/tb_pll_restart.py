"""pll_restart: a pulse at the start and at each loss of the lock, another one each WAIT clocks until it locks."""

import itertools

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import ReadOnly, RisingEdge, Timer

PULSE = 16
WAIT = 200


async def pulses(dut, clocks):
    """(start, length) of each pulse of rst_o within so many clocks from now."""
    found = []
    for clock in range(clocks):
        await RisingEdge(dut.clk_i)
        await ReadOnly()
        if int(dut.rst_o.value):
            if found and sum(found[-1]) == clock:
                found[-1][1] += 1
            else:
                found.append([clock, 1])
    await Timer(1, "ns")
    return [tuple(pulse) for pulse in found]


async def start(dut, locked):
    dut.rst_ni.value = 0
    dut.locked_i.value = locked
    dut.clk_i.value = 0
    cocotb.start_soon(Clock(dut.clk_i, 20, "ns", impl="gpi").start())
    await Timer(105, "ns")
    assert int(dut.rst_o.value) == 0
    dut.rst_ni.value = 1


@cocotb.test()
async def again_until_it_locks(dut):
    """Without a lock: a pulse of PULSE clocks every WAIT + 1 clocks; with one: none."""
    await start(dut, 0)
    found = await pulses(dut, 3 * (WAIT + 1))
    assert [length for _, length in found] == [PULSE] * 3
    assert {after - before for (before, _), (after, _) in itertools.pairwise(found)} == {WAIT + 1}
    dut.locked_i.value = 1
    await pulses(dut, 5)
    assert await pulses(dut, 3 * WAIT) == []


@cocotb.test()
async def once_for_a_lost_lock(dut):
    """A lock that was there and goes: one pulse within 4 clocks, if it is back before WAIT."""
    await start(dut, 1)
    await pulses(dut, 5)
    for trial in range(4):
        await Timer(3 * trial + 1, "ns")
        dut.locked_i.value = 0
        found = await pulses(dut, WAIT // 2)
        assert len(found) == 1 and found[0][0] <= 4 and found[0][1] == PULSE
        dut.locked_i.value = 1
        assert await pulses(dut, WAIT) == []
