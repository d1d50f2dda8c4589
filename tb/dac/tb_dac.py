"""What dac_parallel owes: whole sets at one LDAC after 22 clocks, the part's times kept, a safe value when in doubt."""

from __future__ import annotations

import itertools
import os
import random

import cocotb
from agents.dac7624 import pack, unpack, violated
from cocotb.triggers import ReadOnly, RisingEdge, Timer, ValueChange

SAFE = (0x800,) * 4
WRITE_TO_LDAC = 22
TRANSFER = 25
FAULT_TO_SAFE_AT_MOST = 47


class TB:
    def __init__(self, dut):
        self.dut = dut
        self.random = random.Random(7)
        self.shown: list[tuple[int, ...]] = []
        cocotb.start_soon(self._watch())

    async def _watch(self) -> None:
        """Every value the four outputs ever show together."""
        while True:
            await ValueChange(self.dut.codes)
            await ReadOnly()
            self.shown.append(unpack(int(self.dut.codes.value)))

    def draw(self) -> tuple[int, ...]:
        return tuple(self.random.randrange(4096) for _ in range(4))

    async def clocks(self, count: int) -> None:
        for _ in range(count):
            await RisingEdge(self.dut.clk)

    async def reset(self) -> None:
        """A short reset; returns when the safe value was written."""
        dut = self.dut
        dut.rst_n.value = 0
        dut.write.value = 0
        dut.fault.value = 0
        await self.clocks(2)
        await Timer(1, "ns")
        dut.rst_n.value = 1
        for _ in range(80):
            await self.clocks(1)
            await ReadOnly()
            if int(dut.ready.value):
                break
        else:
            raise AssertionError("not ready 80 clocks after reset")
        await Timer(1, "ns")

    async def write(self, codes) -> None:
        """Give a set; returns just after the edge that took it."""
        self.dut.code.value = pack(codes)
        self.dut.write.value = 1
        await self.clocks(1)
        await Timer(1, "ns")
        self.dut.write.value = 0
        self.dut.code.value = pack(self.draw())  # a set that nobody asked for

    def check(self) -> None:
        wrong = violated(int(self.dut.violations.value))
        assert not wrong, f"DAC7624 data sheet violated: {sorted(wrong)}"


async def started(dut) -> TB:
    tb = TB(dut)
    dut.d_cs.value = dut.d_ldac.value = dut.d_data.value = dut.d_reset.value = 4000
    await tb.reset()
    return tb


@cocotb.test()
async def sets_arrive_whole_with_every_pad_delay(dut):
    """Corners of 3 to 5 ns for CS, LDAC and the bus: back-to-back sets, each shown whole, no time violated."""
    tb = await started(dut)
    for cs, ldac, data in itertools.product((3000, 5000), repeat=3):
        dut.d_cs.value, dut.d_ldac.value, dut.d_data.value = cs, ldac, data
        tb.shown.clear()
        sent = [tb.draw() for _ in range(6)]
        for codes in sent:
            await tb.write(codes)
            await tb.clocks(TRANSFER - 1)
            await ReadOnly()
            assert not int(dut.ready.value)
            await tb.clocks(1)
            await Timer(1, "ns")
            assert int(dut.ready.value)
        assert tb.shown == sent
        assert unpack(int(dut.codes.value)) == sent[-1]
        tb.check()


@cocotb.test()
async def ldac_falls_22_clocks_after_write(dut):
    """The latency is the same for every set, and the outputs do not move before."""
    tb = await started(dut)
    for pause in (0, 1, 2, 7):
        await tb.clocks(pause)
        codes = tb.draw()
        before = int(dut.codes.value)
        await tb.write(codes)
        for clock in range(1, WRITE_TO_LDAC + 1):
            assert int(dut.ldac_n.value) == 1 and int(dut.codes.value) == before, f"clock {clock}"
            assert int(dut.safe.value) == (unpack(before) == SAFE), f"clock {clock}"
            await tb.clocks(1)
            await Timer(1, "ns")
        assert int(dut.ldac_n.value) == 0 and int(dut.safe.value) == 0
        await tb.clocks(TRANSFER - WRITE_TO_LDAC)
        await Timer(1, "ns")
        assert unpack(int(dut.codes.value)) == codes
    tb.check()


@cocotb.test()
async def a_write_while_busy_is_dropped_and_told(dut):
    """At every clock of a transfer: dropped rises, the running set is shown unharmed."""
    tb = await started(dut)
    for clock in range(TRANSFER - 1):
        codes = tb.draw()
        tb.shown.clear()
        await tb.write(codes)
        await tb.clocks(clock)
        await Timer(1, "ns")
        dut.write.value = 1
        await Timer(1, "ns")
        assert int(dut.dropped.value) == 1
        await tb.clocks(1)
        await Timer(1, "ns")
        dut.write.value = 0
        await tb.clocks(TRANSFER)
        await Timer(1, "ns")
        assert tb.shown == [codes]
    tb.check()


@cocotb.test()
async def reset_at_every_clock_leaves_the_safe_value(dut):
    """Reset in each clock of a transfer: the part is reset at once, then shows mid-scale and nothing else."""
    tb = await started(dut)
    part_reset = int(dut.RESET_CODE.value)
    for clock in range(TRANSFER + 1):
        codes = tb.draw()
        await tb.write(codes)
        await tb.clocks(clock)
        await Timer(3, "ns")
        tb.shown.clear()
        dut.rst_n.value = 0
        await Timer(6, "ns")
        assert unpack(int(dut.codes.value)) == (part_reset,) * 4, "reset needs no clock"
        await tb.reset()
        assert int(dut.safe.value) == 1
        assert unpack(int(dut.codes.value)) == SAFE
        assert set(tb.shown) <= {(part_reset,) * 4, SAFE, codes}
        tb.check()


@cocotb.test()
async def the_shortest_reset_is_long_enough_for_the_part(dut):
    """A reset of 2 ns, anywhere in a clock: the part still sees RESET low for 50 ns or more, then mid-scale."""
    tb = await started(dut)
    for delay in range(1, 20, 3):
        await tb.write(tb.draw())
        await Timer(delay, "ns")
        dut.rst_n.value = 0
        await Timer(2, "ns")
        dut.rst_n.value = 1
        await tb.clocks(60)
        await Timer(1, "ns")
        assert unpack(int(dut.codes.value)) == SAFE and int(dut.ready.value) == 1
        tb.check()


@cocotb.test()
async def fault_at_every_clock_ends_in_the_safe_value(dut):
    """Fault in each clock of a transfer and when idle, as a pulse and as a level: safe within 47 clocks, once."""
    tb = await started(dut)
    for clock, length in itertools.product(range(TRANSFER + 3), (1, 60)):
        codes = tb.draw()
        await tb.write(codes)
        await tb.clocks(clock)
        await Timer(1, "ns")
        updates = int(dut.updates.value)
        before_ldac = clock <= WRITE_TO_LDAC  # at 22 the edge is still in the pad
        dut.fault.value = 1
        safe_after = None
        for passed in range(1, 70):
            await tb.clocks(1)
            await Timer(1, "ns")
            if passed == length:
                dut.fault.value = 0
            elif passed < length:
                assert int(dut.ready.value) == 0
            if safe_after is None and int(dut.safe.value):
                safe_after = passed - 1  # the first edge took the fault
        assert safe_after is not None and safe_after <= FAULT_TO_SAFE_AT_MOST, safe_after
        assert clock < TRANSFER or safe_after == WRITE_TO_LDAC, "when idle the safe value goes out at once"
        assert unpack(int(dut.codes.value)) == SAFE
        assert int(dut.updates.value) - updates == before_ldac + 1, "the safe value is written once"
        assert int(dut.ready.value) == 1
        again = tb.draw()
        await tb.write(again)
        await tb.clocks(TRANSFER)
        await Timer(1, "ns")
        assert unpack(int(dut.codes.value)) == again and int(dut.safe.value) == 0
    tb.check()


@cocotb.test()
async def nothing_is_written_while_a_fault_lasts(dut):
    """Writes during a fault are dropped; two faults in a row give the safe value each time."""
    tb = await started(dut)
    for _ in range(2):
        await tb.write(tb.draw())
        await tb.clocks(30)
        await Timer(1, "ns")
        dut.fault.value = 1
        await tb.clocks(60)
        await Timer(1, "ns")
        updates = int(dut.updates.value)
        dut.write.value = 1
        await Timer(1, "ns")
        assert int(dut.dropped.value) == 1
        await tb.write(tb.draw())
        await tb.clocks(60)
        assert int(dut.updates.value) == updates
        assert unpack(int(dut.codes.value)) == SAFE
        await Timer(1, "ns")
        dut.fault.value = 0
        await tb.clocks(2)
        await Timer(1, "ns")
        assert int(dut.ready.value) == 1
    tb.check()


@cocotb.test()
async def a_fault_is_caught(dut):
    """Run with a mutated copy of the RTL (FAULT_EXPECTED names what must be noticed); else a plain transfer."""
    expected = os.environ.get("FAULT_EXPECTED", "")
    tb = TB(dut)
    dut.d_cs.value, dut.d_data.value, dut.d_ldac.value = 5000, 4000, 3000
    await tb.reset()
    noticed = set()
    for late_data in (0, 0, 1, 1):
        if late_data:
            dut.d_cs.value, dut.d_data.value = 3000, 5000
        codes = tb.draw()
        await tb.write(codes)
        await tb.clocks(TRANSFER)
        await Timer(1, "ns")
        if unpack(int(dut.codes.value)) != codes:
            noticed.add("WRONG_CODE")
    noticed |= violated(int(dut.violations.value))
    dut._log.info("noticed: %s", sorted(noticed))
    if expected:
        assert expected in noticed, f"expected {expected}, noticed {sorted(noticed)}"
    else:
        assert not noticed
