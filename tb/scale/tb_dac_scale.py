"""dac_scale owes the codes and flags of rtds_host.link.scaling after 12 clocks, all at one edge."""

from __future__ import annotations

import random

import cocotb
import numpy as np
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

from rtds_host.link.scaling import DAC_OUTPUTS, DacScale, default_scaling

LATENCY = 12
SPECIAL = (0x00000000, 0x80000000, 0x3F800000, 0x00000001, 0x807FFFFF, 0x7F7FFFFF, 0x7F800000, 0xFF800000, 0x7FC00000,
           0xFFFFFFFF, 0x7F800001)  # fmt: skip


def float_of(word: int) -> np.float32:
    return np.array([word], dtype=np.uint32).view(np.float32)[0]


def word_of(value: float) -> int:
    return int(np.array([value], dtype=np.float32).view(np.uint32)[0])


class TB:
    def __init__(self, dut):
        self.dut = dut
        self.random = random.Random(13)
        self.expected = (0, 0, 0)

    async def start(self) -> None:
        dut = self.dut
        Clock(dut.clk_i, 20, "ns", impl="gpi").start()
        dut.rst_ni.value = 0
        dut.valid_i.value = 0
        self.values([0] * 4)
        self.scales(
            [word_of(s.gain) for s in default_scaling().dac], [word_of(s.offset) for s in default_scaling().dac]
        )
        for _ in range(3):
            await FallingEdge(dut.clk_i)
        dut.rst_ni.value = 1
        await FallingEdge(dut.clk_i)

    def scales(self, gains, offsets) -> None:
        self.dut.gain_i.value = sum(word << 32 * place for place, word in enumerate(gains))
        self.dut.offset_i.value = sum(word << 32 * place for place, word in enumerate(offsets))
        self.dac = [DacScale(float_of(gain), float_of(offset)) for gain, offset in zip(gains, offsets)]

    def values(self, words) -> None:
        for name, word in zip(DAC_OUTPUTS, words):
            getattr(self.dut, f"{name}_i").value = word

    def outputs(self) -> tuple[int, int, int]:
        return int(self.dut.code_o.value), int(self.dut.sat_o.value), int(self.dut.nan_o.value)

    async def convert(self, words) -> None:
        """One set; checks latency, codes, flags, and that nothing moved before."""
        before, self.expected = self.expected, self.twin(words)
        self.values(words)
        self.dut.valid_i.value = 1
        for clock in range(1, LATENCY + 1):
            await FallingEdge(self.dut.clk_i)
            self.dut.valid_i.value = 0
            self.values([self.random.getrandbits(32) for _ in range(4)])
            done = clock == LATENCY
            assert int(self.dut.valid_o.value) == done, f"valid_o in clock {clock}"
            assert self.outputs() == (self.expected if done else before), f"clock {clock}, words {words}"

    def twin(self, words) -> tuple[int, int, int]:
        parts = [scale.encode(float_of(word)) for scale, word in zip(self.dac, words)]
        code = sum(int(part[0]) << 12 * place for place, part in enumerate(parts))
        return code, *(sum(int(part[flag]) << place for place, part in enumerate(parts)) for flag in (1, 2))


@cocotb.test()
async def default_ranges_bit_for_bit(dut):
    """Values over and beyond the range, and each code's borders: halves go to the even code."""
    tb = TB(dut)
    await tb.start()
    for number in range(200):
        words = []
        for scale in tb.dac:
            low, high = scale.limits
            steps = tb.random.randrange(-2060, 2060) + tb.random.choice((0.0, 0.5, -0.5))
            value = steps / float(scale.gain) if number % 2 else tb.random.uniform(1.1 * low, 1.1 * high)
            words.append(word_of(np.nextafter(np.float32(value), np.float32(tb.random.choice((value, -9e9, 9e9))))))
        await tb.convert(words)


@cocotb.test()
async def any_word_bit_for_bit(dut):
    """Random words, NaN, infinities, subnormals as values, gains and offsets."""
    tb = TB(dut)
    await tb.start()
    for number in range(200):

        def word() -> int:
            return tb.random.choice(SPECIAL) if tb.random.random() < 0.4 else tb.random.getrandbits(32)

        if number % 2:
            tb.scales([word() for _ in range(4)], [word() for _ in range(4)])
        await tb.convert([word() for _ in range(4)])


@cocotb.test()
async def outputs_are_not_mixed_up(dut):
    """Each output alone away from zero moves its own code and no other; NaN shows mid-scale and its own flags."""
    tb = TB(dut)
    await tb.start()
    for place in range(4):
        words = [0] * 4
        words[place] = word_of(1.0)
        await tb.convert(words)
        codes = [tb.expected[0] >> 12 * k & 0xFFF for k in range(4)]
        assert [k for k in range(4) if codes[k] != 2048] == [place]
        words[place] = 0x7FC00000
        await tb.convert(words)
        assert tb.expected == (sum(2048 << 12 * k for k in range(4)), 1 << place, 1 << place)


@cocotb.test()
async def a_set_while_busy_is_ignored(dut):
    """A second valid in each clock of a conversion leaves the first one's result, once."""
    tb = TB(dut)
    await tb.start()
    for clock in range(1, LATENCY):
        words = [word_of(tb.random.uniform(-1, 1)) for _ in range(4)]
        tb.values(words)
        dut.valid_i.value = 1
        count = 0
        for passed in range(1, 3 * LATENCY):
            await FallingEdge(dut.clk_i)
            tb.values([tb.random.getrandbits(32) for _ in range(4)])
            dut.valid_i.value = passed == clock
            count += int(dut.valid_o.value)
        assert count == 1 and tb.outputs() == tb.twin(words)
