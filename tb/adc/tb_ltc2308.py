"""The model of the LTC2308 itself: at each limit of the data sheet it is content, just beyond it complains.

A master in Python drives the pins with times of its own; each test moves one time.
"""

from __future__ import annotations

import dataclasses

import cocotb
from agents.ltc2308 import pack, violated
from cocotb.triggers import Timer
from cocotb.types import Logic


@dataclasses.dataclass
class Times:
    """Times of one conversion cycle in ps, at the limits of the data sheet where there is one."""

    convst_high: int = 20_000
    first_sck: int = 1_600_000  # from rising CONVST
    period: int = 25_000
    high: int = 12_500
    sdi_before: int = 5_000  # SDI changes this long before the rising SCK
    pulses: int = 12
    cycle: int = 2_000_000
    word: tuple = (1, 1, 0, 1, 1, 0)  # channel 3
    swap_sdi_at: int | None = None  # SDI changes once more, this long after the first rising SCK


async def frame(dut, times: Times, read_at: int | None = None) -> int | None:
    """One conversion cycle on the pins; returns the code read, each bit `read_at` ps after the falling edge before it.

    Bit 11 has no edge before it and is read at the first one.
    """
    events: list[tuple[int, str, object]] = [(0, "convst_i", 1), (times.convst_high, "convst_i", 0)]
    for k in range(times.pulses):
        rise = times.first_sck + k * times.period
        events += [(rise, "sck_i", 1), (rise + times.high, "sck_i", 0)]
        if k < 6:
            events.append((rise - times.sdi_before, "sdi_i", times.word[k]))
        if k == 0 and times.swap_sdi_at is not None:
            events.append((rise + times.swap_sdi_at, "sdi_i", 1 - times.word[0]))
        if read_at is not None:
            events.append((rise + times.high - times.period + read_at if k else rise + times.high, "read", None))
    now, code = 0, 0
    for at, what, value in sorted(events, key=lambda event: (event[0], event[1] != "read")):
        if at > now:
            await Timer(at - now, "ps")
            now = at
        if what == "read":
            code = code << 1 | (dut.sdo_o.value == Logic(1))
        else:
            getattr(dut, what).value = value
    await Timer(times.cycle - now, "ps")
    return code if read_at is not None else None


async def start(dut, t_conv: int = 1_600_000) -> None:
    """Pins low, history and violations forgotten, channel c reads 0x111 * c + 5."""
    for name in ("convst_i", "sck_i", "sdi_i"):
        getattr(dut, name).value = 0
    dut.clear_i.value = 1
    dut.forgive_i.value = 1
    dut.t_conv_ps_i.value = t_conv
    dut.codes_i.value = pack([0x111 * c + 5 for c in range(8)])
    await Timer(10, "us")
    dut.clear_i.value = 0
    dut.forgive_i.value = 0
    await Timer(1, "us")


def limit_test(name: str, good: Times, bad: Times, expected: str):
    """Two cocotb tests: `good` (at the limit) is accepted, `bad` (beyond it) gives `expected` and nothing hides it."""

    async def body(dut):
        last = Times(first_sck=1_605_000)
        await start(dut)
        for times in (last, good, good, last):
            await frame(dut, times)
        refused = violated(int(dut.violations_o.value))
        assert not refused, f"{name}: {refused} at the limit itself"
        for times in (bad, last):
            await frame(dut, times)
        assert expected in violated(int(dut.violations_o.value)), f"{name}: not noticed"

    body.__name__ = body.__qualname__ = f"limit_{name}"
    body.__doc__ = f"{name}: accepted at the limit, {expected} beyond it."
    return cocotb.test()(body)


limit_convst_high = limit_test("convst_high", Times(), Times(convst_high=19_900), "CONVST_SHORT")
limit_convst_low = limit_test("convst_low", Times(convst_high=40_000), Times(convst_high=40_100), "CONVST_LATE_LOW")
limit_cycle = limit_test("cycle", Times(), Times(cycle=1_999_900), "CYCLE_SHORT")
limit_first_sck = limit_test("first_sck", Times(), Times(first_sck=1_599_900), "SCK_EARLY")
limit_period = limit_test("period", Times(), Times(period=24_900), "SCK_FAST")
limit_high = limit_test("high", Times(high=10_000), Times(high=9_900), "SCK_HIGH_SHORT")
limit_low = limit_test("low", Times(high=15_000), Times(high=15_100), "SCK_LOW_SHORT")
limit_setup = limit_test("setup", Times(sdi_before=100), Times(sdi_before=0), "SDI_SETUP")
limit_hold = limit_test("hold", Times(swap_sdi_at=2_500), Times(swap_sdi_at=2_400), "SDI_HOLD")
limit_acquisition = limit_test("acquisition", Times(first_sck=1_610_000), Times(first_sck=1_610_100), "ACQUISITION")
limit_sck_to_convst = limit_test(
    "sck_to_convst",
    Times(period=60_000, cycle=1_600_000 + 11 * 60_000 + 12_500 + 20_000),
    Times(period=60_000, cycle=1_600_000 + 11 * 60_000 + 12_500 + 19_900),
    "SCK_TO_CONVST",
)
limit_count = limit_test("count", Times(), Times(pulses=11), "SCK_COUNT")
limit_word = limit_test("word", Times(word=(1, 0, 1, 1, 1, 0)), Times(word=(0, 1, 1, 0, 1, 1)), "WORD_MODE")


@cocotb.test()
async def the_word_selects_the_conversion_after(dut):
    """The channel sent while a result is read is the one of the next conversion, for all eight words."""
    await start(dut)
    previous = None
    for channel, nibble in enumerate((0x8, 0xC, 0x9, 0xD, 0xA, 0xE, 0xB, 0xF)):
        word = tuple(nibble >> bit & 1 for bit in (3, 2, 1, 0)) + (1, 0)
        code = await frame(dut, Times(word=word, first_sck=1_605_000), read_at=25_000)
        assert code == (0x111 * previous + 5 if previous is not None else code)
        previous = channel
    assert not violated(int(dut.violations_o.value))


@cocotb.test()
async def data_is_valid_from_12_5_ns_to_the_hold_time_only(dut):
    """Read 12.5 ns after the falling edge: right; read 12 ns after it: wrong (alternating bits, so each bit moves)."""
    await start(dut)
    dut.codes_i.value = pack([0xAAA] * 8)
    await frame(dut, Times(first_sck=1_605_000))
    assert await frame(dut, Times(first_sck=1_605_000), read_at=12_600) == 0xAAA
    assert await frame(dut, Times(first_sck=1_605_000), read_at=12_400) != 0xAAA
