"""What the ADC sequencer owes: right codes from the right conversions, 500 kSPS, every time of the data sheet."""

from __future__ import annotations

import itertools
import os

import cocotb
from agents.ltc2308 import Ltc2308
from cocotb.triggers import (
    ClockCycles,
    FallingEdge,
    ReadOnly,
    RisingEdge,
    SimTimeoutError,
    Timer,
    ValueChange,
    with_timeout,
)

SEQUENCE_CLOCKS = 400
RECORD_CHANNELS = (2, 3, 0, 1)  # after the parameter: T_l, T_r, V_l, V_r


class TB:
    def __init__(self, dut):
        self.dut = dut
        self.part = Ltc2308(
            dut.codes, dut.conversions, dut.channel, dut.channel_known, dut.t_last_convst, dut.violations
        )

    async def reset(self) -> None:
        """Hold reset (and the part's memory) for some clocks; it ends just after a rising edge."""
        self.dut.rst_n.value = 0
        self.dut.agent_clear.value = 1
        for _ in range(4):
            await RisingEdge(self.dut.clk)
        await Timer(1, "ns")
        self.dut.agent_clear.value = 0
        self.dut.rst_n.value = 1

    async def record(self, timeout_us: float = 40) -> dict:
        """The next record: codes, index of the parameter, the conversions it must have come from."""
        try:
            await with_timeout(ValueChange(self.dut.toggle), timeout_us, "us")
        except SimTimeoutError:
            raise AssertionError(f"no record within {timeout_us} us") from None
        await FallingEdge(self.dut.clk)
        d = self.dut
        return {
            "codes": [int(h.value) for h in (d.code_p, d.code_t_l, d.code_t_r, d.code_v_l, d.code_v_r)],
            "index": int(d.index_p.value),
            "conversions": self.part.log[-5:],
        }

    async def good_record(self) -> dict:
        record = await self.record()
        channels = [conversion.channel for conversion in record["conversions"]]
        assert channels == [4 + record["index"], *RECORD_CHANNELS], f"converted channels {channels}"
        sampled = [conversion.code for conversion in record["conversions"]]
        assert record["codes"] == sampled, f"record {record['codes']} but the part sampled {sampled}"
        return record


async def started(dut) -> TB:
    tb = TB(dut)
    dut.enable.value = 1
    await tb.reset()
    return tb


@cocotb.test()
async def every_pad_delay_and_conversion_time(dut):
    """All corners of 3 to 5 ns on each pin and edge, conversions of 1.3 to 1.6 us: right codes, no violation."""
    tb = await started(dut)
    pads = (dut.d_convst, dut.d_convst_fall, dut.d_sck, dut.d_sck_fall, dut.d_sdi, dut.d_sdo)
    corners = list(itertools.product((3000, 5000), repeat=len(pads)))
    for number, corner in enumerate([*corners, (4000,) * len(pads)]):
        dut.rst_n.value = 0
        dut.agent_clear.value = 1
        for pad, delay in zip(pads, corner, strict=True):
            pad.value = delay
        dut.t_conv.value = (1_300_000, 1_450_000)[number % 2]
        await tb.reset()
        await tb.good_record()
        dut.t_conv.value = 1_600_000
        await tb.good_record()
        tb.part.check()
    # What the design promises in rtl/io/ltc2308_spi.v, as seen by the part, in ps.
    promised = {
        "convst_high_min": 23_000,
        "convst_high_max": 27_000,
        "cycle_min": 2_000_000,
        "first_sck_min": 1_603_000,
        "acquisition_min": 243_000,
        "sck_to_convst_min": 105_500,
        "sck_period_min": 25_000,
        "sck_high_min": 10_500,
        "sck_low_min": 10_500,
        "sdi_setup_min": 10_500,
        "sdi_hold_min": 10_500,
    }
    seen = {name: int(getattr(dut.part, name).value) for name in promised}
    seen["capture_setup_min"] = int(dut.capture_setup_min.value)
    seen["capture_hold_min"] = int(dut.capture_hold_min.value)
    for name, value in seen.items():
        dut._log.info("margin %-18s %9.1f ns", name, value / 1000)
    assert seen == promised | {"capture_setup_min": 2_500, "capture_hold_min": 10_000}


@cocotb.test()
async def pads_of_0_to_5_ns(dut):
    """Each pin's pad anywhere from 0 to 5 ns, the same for both edges, conversions of 1.3 to 1.6 us: the window is just
    met.
    """
    tb = await started(dut)
    ends = {"first_sck_min": set(), "acquisition_min": set()}
    for number, corner in enumerate(itertools.product((0, 2500, 5000), repeat=4)):
        dut.rst_n.value = 0
        dut.agent_clear.value = 1
        for pin, delay in zip(("convst", "sck", "sdi", "sdo"), corner, strict=True):
            getattr(dut, f"d_{pin}").value = delay
            if pin in ("convst", "sck"):
                getattr(dut, f"d_{pin}_fall").value = delay
        dut.t_conv.value = (1_300_000, 1_600_000, 1_450_000)[number % 3]
        await tb.reset()
        await tb.good_record()
        dut.t_conv.value = (1_600_000, 1_300_000, 1_600_000)[number % 3]
        await tb.good_record()
        tb.part.check()
        for name, values in ends.items():
            values.add(int(getattr(dut.part, name).value))
    # SCK earliest against CONVST leaves the conversion 0 ns, latest the acquisition 0 ns.
    assert min(ends["first_sck_min"]) == 1_600_000 and min(ends["acquisition_min"]) == 240_000
    assert int(dut.capture_setup_min.value) == 2_500, "25 ns less 12.5 of the part and twice 5 of pads"


@cocotb.test()
async def parameters_take_turns_and_the_rate_is_exact(dut):
    """Each sequence 10.000 us, conversions 2.000 us apart, parameters B J Km Kb B ... in turn."""
    tb = await started(dut)
    times, indices = [], []
    for _ in range(9):
        record = await tb.good_record()
        indices.append(record["index"])
        times.append([conversion.time_ps for conversion in record["conversions"]])
    assert indices == [0, 1, 2, 3, 0, 1, 2, 3, 0]
    flat = [time for sequence in times for time in sequence]
    assert {b - a for a, b in itertools.pairwise(flat)} == {2_000_000}
    tb.part.check()


@cocotb.test()
async def the_record_changes_at_one_edge_only(dut):
    """All codes, the index and the toggle change together, 400 clocks apart; valid marks the clock after."""
    tb = await started(dut)
    changes, previous = [], None
    for clock in range(558 + 3 * SEQUENCE_CLOCKS + 5):
        await RisingEdge(dut.clk)
        await ReadOnly()
        d = dut
        now = tuple(int(h.value) for h in (d.code_v_l, d.code_v_r, d.code_t_l, d.code_t_r, d.code_p, d.index_p))
        toggle = int(d.toggle.value)
        assert int(d.valid.value) == (previous is not None and toggle != previous[1])
        if previous is not None:
            assert (now != previous[0]) == (toggle != previous[1]), "the record changed without its toggle"
            if toggle != previous[1]:
                changes.append(clock + 1)
        previous = (now, toggle)
    assert changes == [558 + k * SEQUENCE_CLOCKS for k in range(4)]
    tb.part.check()


@cocotb.test()
async def enable_ends_with_a_whole_sequence(dut):
    """Disabled in the middle, the sequence is finished; then no pin moves; enabled again, parameters go on in turn."""
    tb = await started(dut)
    await tb.good_record()
    await Timer(3, "us")
    dut.enable.value = 0
    record = await tb.good_record()
    assert record["index"] == 1
    done = len(tb.part.log)
    for _ in range(3 * SEQUENCE_CLOCKS):
        await RisingEdge(dut.clk)
    assert len(tb.part.log) == done, "a conversion was started while disabled"
    for wait in (0, 1, 37):
        await ClockCycles(dut.clk, wait + 1)
        await Timer(1, "ns")
        dut.enable.value = 1
        done = len(tb.part.log)
        await ClockCycles(dut.clk, 2)
        assert len(tb.part.log) == done + 1, "the first conversion starts with the next clock"
        dut.enable.value = 0
        await tb.good_record()
        await ClockCycles(dut.clk, SEQUENCE_CLOCKS // 2)
    assert int(dut.index_p.value) == 0, "three more sequences: 2, 3, 0"
    tb.part.check()


@cocotb.test()
async def a_dead_line_makes_no_record(dut):
    """SDO stuck at 0, at 1, or (Icarus) undefined: silent, no record; alive again: a right one, silent falls."""
    tb = await started(dut)
    four_states = cocotb.SIM_NAME.lower().startswith("icarus")
    for level in (0, 1, *("XZ" if four_states else "")):
        await tb.good_record()
        toggle = int(dut.toggle.value)
        dut.sdo_level.value = cocotb.types.Logic(level)
        dut.sdo_stuck.value = 1
        for _ in range(2 * SEQUENCE_CLOCKS + 20):
            await RisingEdge(dut.clk)
            await ReadOnly()
            made = int(dut.toggle.value) != toggle or int(dut.valid.value)
            assert not made, "a record was made of a dead line"
        assert int(dut.silent.value) == 1
        await FallingEdge(dut.clk)
        dut.sdo_stuck.value = 0
        # The sequence that is running is partly dead: its record may be mixed, the one after must be right.
        await tb.record()
        await tb.good_record()
        assert int(dut.silent.value) == 0
    tb.part.check()


@cocotb.test()
async def full_scale_inputs_are_not_silence(dut):
    """0 and full scale on the privileged channels are data as long as one channel says otherwise."""
    tb = await started(dut)
    for codes in ([0] * 4 + [1] * 4, [4095] * 4 + [4094] * 4, [0, 4095, 0, 4095, 0, 0, 0, 0]):
        tb.part.fixed = codes
        await tb.record()
        await tb.record()
        record = await tb.good_record()
        assert record["codes"][1:] == [codes[2], codes[3], codes[0], codes[1]]
        assert int(dut.silent.value) == 0


@cocotb.test()
async def reset_at_every_phase(dut):
    """Reset at each clock of a conversion cycle, and between clocks: the next record is right, every time kept."""
    tb = await started(dut)
    await tb.good_record()
    for phase in range(80):
        await ClockCycles(dut.clk, phase + 2)
        await Timer(1 + 7 * (phase % 4), "ns")
        await tb.reset()
        assert int(dut.convst.value) == 0 and int(dut.sck.value) == 0
        record = await tb.good_record()
        assert record["index"] == 0
        tb.part.check()


@cocotb.test()
async def a_fault_is_caught(dut):
    """Run with a mutated copy of the RTL (FAULT_EXPECTED names what must be noticed); else nothing may be noticed."""
    expected = os.environ.get("FAULT_EXPECTED", "")
    tb = await started(dut)
    dut.d_convst.value = 5000
    dut.d_sck.value = 3000
    wrong_code = False
    try:
        for _ in range(4):
            await tb.good_record()
    except AssertionError:
        wrong_code = True
    noticed = set(tb.part.violations) | ({"WRONG_CODE"} if wrong_code else set())
    dut._log.info("noticed: %s", sorted(noticed))
    if expected:
        assert expected in noticed, f"expected {expected}, noticed {sorted(noticed)}"
    else:
        assert not noticed
