"""adc_scale owes the bits of rtds_host.link.scaling after 13 clocks, all outputs at one edge."""

from __future__ import annotations

import random

import cocotb
import numpy as np
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

from rtds_host.link.scaling import ADC_CHANNELS, AdcScale, default_scaling
from rtds_host.motor.model import canonical_words

LATENCY = 13
OUTPUTS = ("v_l", "v_r", "t_l", "t_r", "p_b", "p_j", "p_km", "p_kb")
SPECIAL = (0x00000000, 0x80000000, 0x3F800000, 0x00000001, 0x807FFFFF, 0x7F7FFFFF, 0x7F800000, 0xFF800000, 0x7FC00000)


def word_pack(words) -> int:
    return sum(int(word) << 32 * place for place, word in enumerate(words))


def float_of(word: int) -> np.float32:
    return np.array([word], dtype=np.uint32).view(np.float32)[0]


class TB:
    def __init__(self, dut):
        self.dut = dut
        self.random = random.Random(11)
        self.expected = {name: 0 for name in OUTPUTS}

    def registers(self, words) -> None:
        """V_l, V_r, T_l, T_r where they do not come from the ADC."""
        for name, word in zip(OUTPUTS[:4], words, strict=True):
            getattr(self.dut, f"{name}_i").value = word

    async def start(self) -> None:
        dut = self.dut
        Clock(dut.clk_i, 20, "ns", impl="gpi").start()
        dut.rst_ni.value = 0
        dut.valid_i.value = 0
        dut.from_adc_i.value = 3
        self.registers(self.random.getrandbits(32) for _ in OUTPUTS[:4])
        self.scales(
            [np.array([s.gain]).view(np.uint32)[0] for s in default_scaling().adc],
            [np.array([s.offset]).view(np.uint32)[0] for s in default_scaling().adc],
        )
        self.record([0] * 5, 0)
        for _ in range(3):
            await FallingEdge(dut.clk_i)
        dut.rst_ni.value = 1
        await FallingEdge(dut.clk_i)

    def scales(self, gains, offsets) -> None:
        """Set the twelve pairs (words), channel 0 first."""
        self.dut.gain_i.value = word_pack(gains)
        self.dut.offset_i.value = word_pack(offsets)
        self.adc = [
            AdcScale(float_of(gain), float_of(offset), place < 4)
            for place, (gain, offset) in enumerate(zip(gains, offsets))
        ]

    def record(self, codes, index: int) -> None:
        """codes: v_l, v_r, t_l, t_r, p."""
        dut = self.dut
        handles = (dut.code_v_l_i, dut.code_v_r_i, dut.code_t_l_i, dut.code_t_r_i, dut.code_p_i)
        for handle, code in zip(handles, codes):
            handle.value = code
        dut.index_p_i.value = index

    def word(self, channel: int, code: int) -> int:
        value = self.adc[channel].decode(np.array([code]))
        return int(canonical_words(value)[0])

    def outputs(self) -> dict[str, int]:
        return {name: int(getattr(self.dut, f"{name}_o").value) for name in OUTPUTS}

    async def convert(self, codes, index: int, pause: int = 0) -> None:
        """One record; checks latency, bits, and that nothing moved before."""
        before = self.expected.copy()
        self.record(codes, index)
        self.dut.valid_i.value = 1
        for place in range(4):
            self.expected[OUTPUTS[place]] = self.word(place, codes[place])
        self.expected[OUTPUTS[4 + index]] = self.word(4 + index, codes[4])
        for clock in range(1, LATENCY + 1):
            await FallingEdge(self.dut.clk_i)
            self.dut.valid_i.value = 0
            self.record([self.random.randrange(4096) for _ in range(5)], self.random.randrange(4))
            done = clock == LATENCY
            assert int(self.dut.valid_o.value) == done, f"valid_o in clock {clock}"
            assert self.outputs() == (self.expected if done else before), f"outputs in clock {clock}"
        for _ in range(pause):
            await FallingEdge(self.dut.clk_i)
            assert int(self.dut.valid_o.value) == 0
            assert self.outputs() == self.expected


@cocotb.test()
async def default_ranges_bit_for_bit(dut):
    """Random codes, corners of the code range, back to back and with pauses."""
    tb = TB(dut)
    await tb.start()
    corners = [0, 1, 2047, 2048, 2049, 4094, 4095]
    for number in range(150):
        draw = corners.__getitem__ if number % 2 else None
        codes = [draw(tb.random.randrange(7)) if draw else tb.random.randrange(4096) for _ in range(5)]
        await tb.convert(codes, number % 4, pause=number % 3)


@cocotb.test()
async def any_gain_and_offset_bit_for_bit(dut):
    """Random words, NaN, infinities, subnormals and zeros as gains and offsets: numpy's float32, with one NaN."""
    tb = TB(dut)
    await tb.start()
    for number in range(150):

        def word() -> int:
            return tb.random.choice(SPECIAL) if tb.random.random() < 0.4 else tb.random.getrandbits(32)

        tb.scales([word() for _ in ADC_CHANNELS], [word() for _ in ADC_CHANNELS])
        await tb.convert([tb.random.randrange(4096) for _ in range(5)], number % 4)


@cocotb.test()
async def what_does_not_come_from_the_adc_follows_its_register(dut):
    """V and T apart: the register's word a clock later, whatever the record; after a change of source the next
    record's.
    """
    tb = TB(dut)
    await tb.start()
    await tb.convert([1, 2, 3, 4, 5], 0)
    for sources in (0, 1, 2, 3, 1, 0, 2):
        dut.from_adc_i.value = sources
        for _ in range(3):
            words = [tb.random.getrandbits(32) for _ in range(4)]
            tb.registers(words)
            await FallingEdge(dut.clk_i)
            for place, word in enumerate(words):
                if not sources >> place // 2 & 1:
                    tb.expected[OUTPUTS[place]] = word
            assert tb.outputs() == tb.expected
        codes = [tb.random.randrange(4096) for _ in range(5)]
        expected = {
            name: tb.word(place, codes[place]) if sources >> place // 2 & 1 else tb.expected[name]
            for place, name in enumerate(OUTPUTS[:4])
        }
        tb.record(codes, 0)
        dut.valid_i.value = 1
        for _ in range(LATENCY):
            await FallingEdge(dut.clk_i)
            dut.valid_i.value = 0
        tb.expected |= expected | {"p_b": tb.word(4, codes[4])}
        assert tb.outputs() == tb.expected


@cocotb.test()
async def parameters_are_valid_when_each_was_read(dut):
    """params_valid_o rises with the fourth different parameter, and a reset takes it back."""
    tb = TB(dut)
    await tb.start()
    for index in (0, 0, 1, 3):
        await tb.convert([2048] * 4 + [100], index)
        assert int(dut.params_valid_o.value) == 0
    await tb.convert([2048] * 4 + [100], 2)
    assert int(dut.params_valid_o.value) == 1
    dut.rst_ni.value = 0
    await FallingEdge(dut.clk_i)
    assert int(dut.params_valid_o.value) == 0 and set(tb.outputs().values()) == {0}


@cocotb.test()
async def a_record_while_busy_is_ignored_and_reset_forgets(dut):
    """A second valid in each clock of a conversion leaves the first one's result; so does a reset leave none."""
    tb = TB(dut)
    await tb.start()
    for clock in range(1, LATENCY):
        codes = [tb.random.randrange(4096) for _ in range(5)]
        tb.record(codes, 1)
        dut.valid_i.value = 1
        count = 0
        for passed in range(1, 3 * LATENCY):
            await FallingEdge(dut.clk_i)
            tb.record([tb.random.randrange(4096) for _ in range(5)], 2)
            dut.valid_i.value = passed == clock
            count += int(dut.valid_o.value)
        assert count == 1
        assert tb.outputs()["v_r"] == tb.word(1, codes[1]) and tb.outputs()["p_j"] == tb.word(5, codes[4])
    for clock in range(1, LATENCY):
        dut.valid_i.value = 1
        for _ in range(clock):
            await FallingEdge(dut.clk_i)
            dut.valid_i.value = 0
        dut.rst_ni.value = 0
        await FallingEdge(dut.clk_i)
        dut.rst_ni.value = 1
        tb.expected = {name: 0 for name in OUTPUTS}
        for _ in range(LATENCY):
            await FallingEdge(dut.clk_i)
            assert int(dut.valid_o.value) == 0
        await tb.convert([1, 2, 3, 4, 5], 3)
