"""rtds_regs through cocotb-bus's Avalon-MM master: every register, and the worst moments."""

import random
from typing import ClassVar

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import NextTimeStep, ReadOnly, RisingEdge
from cocotb_bus.drivers.avalon import AvalonMaster

from rtds_host.link.registers import load_map

MAP = load_map()
OKAY, REFUSED, NO_REGISTER = 0, 2, 3
NOW = [r for r in MAP.registers if r.name.startswith("NOW_")]
CODES = [r for r in MAP.registers if r.name.startswith("CODES_")]


class Master(AvalonMaster):
    """cocotb-bus's master, told that this slave's ports carry _i and _o."""

    _signals: ClassVar = {"address": "address_i"}
    _optional_signals: ClassVar = {
        "readdata": "readdata_o",
        "read": "read_i",
        "write": "write_i",
        "writedata": "writedata_i",
        "readdatavalid": "readdatavalid_o",
    }


class Bench:
    """The register file with everything around it quiet."""

    def __init__(self, dut):
        self.dut = dut
        self.bus = Master(dut, "avs", dut.clk_i)
        self.response = None

    async def reset(self):
        dut = self.dut
        for name in ("idle_i", "event_i", "live_i", "step_i", "serial_error_i", "latency_i", "now_i", "codes_i"):
            getattr(dut, name).value = 0
        dut.idle_i.value = 1
        dut.open_i.value = 1
        dut.fx_ready_i.value = 0
        dut.rst_ni.value = 0
        dut.clk_i.value = 0
        cocotb.start_soon(Clock(dut.clk_i, 20, "ns", impl="gpi").start())
        for _ in range(3):
            await RisingEdge(dut.clk_i)
        dut.rst_ni.value = 1
        await RisingEdge(dut.clk_i)
        cocotb.start_soon(self._watch_response())

    async def _watch_response(self):
        while True:
            await RisingEdge(self.dut.clk_i)
            await ReadOnly()
            if int(self.dut.avs_readdatavalid_o.value) or int(self.dut.avs_writeresponsevalid_o.value):
                self.response = int(self.dut.avs_response_o.value)

    async def read(self, register):
        address = register if isinstance(register, int) else MAP.named(register).address
        word = int(await self.bus.read(address))
        self_response = int(self.dut.avs_response_o.value)
        await RisingEdge(self.dut.clk_i)
        self.response = self_response
        return word

    async def write(self, register, word):
        address = register if isinstance(register, int) else MAP.named(register).address
        self.response = None
        await self.bus.write(address, word)
        for _ in range(3):
            await RisingEdge(self.dut.clk_i)
        assert self.response is not None, "no response to a write"

    def config(self):
        """The set in force, as a list of words."""
        value = int(self.dut.config_o.value)
        return [value >> 32 * k & 0xFFFFFFFF for k in range(len(MAP.config))]


async def bench(dut):
    b = Bench(dut)
    await b.reset()
    return b


@cocotb.test()
async def identity_and_reset_values(dut):
    """Identity, version and build as described; every writable register starts at its described value."""
    b = await bench(dut)
    assert await b.read("ID") == MAP.identity == int.from_bytes(b"RTDS", "big")
    assert await b.read("VERSION") == MAP.version_word
    assert await b.read("BUILD") == 0x1234ABCD
    for register in MAP.registers:
        if register.access in ("rw", "w1c"):
            assert await b.read(register.name) == register.reset, register.name
            assert b.response == OKAY
    assert b.config() == [r.reset for r in MAP.config]


@cocotb.test()
async def every_address_answers_as_described(dut):
    """Writable ones keep what is written, read-only ones refuse and keep, holes say so; no neighbour is touched."""
    b = await bench(dut)
    described = {r.address: r for r in MAP.registers}
    rng = random.Random(31)
    written = {}
    for address in rng.sample(range(256), 256):
        word = rng.getrandbits(32)
        await b.write(address, word)
        register = described.get(address)
        if register is None:
            assert b.response == NO_REGISTER, hex(address)
        elif register.access == "ro":
            assert b.response == REFUSED, register.name
        else:
            assert b.response == OKAY, register.name
            written[register.name] = word
    for address in range(256):
        word = await b.read(address)
        register = described.get(address)
        if register is None:
            assert (word, b.response) == (0, NO_REGISTER), hex(address)
        else:
            assert b.response == OKAY
            if register.name == "CONTROL":
                assert word == written["CONTROL"] & 3
            elif register.name == "FX_ADDRESS":  # no word was taken meanwhile
                assert word == written["FX_ADDRESS"] & 0x3FFF
            elif register.access == "rw":
                assert word == written[register.name], register.name
            elif register.access in ("wo", "w1c"):
                assert word == 0, register.name


@cocotb.test()
async def config_changes_only_by_commit_and_at_once(dut):
    """Writes fill a shadow; the set in force changes in one clock, and never while a step is in hand."""
    b = await bench(dut)
    before = b.config()
    new = [0x3F800000 + k for k in range(len(MAP.config))]
    dut.idle_i.value = 0
    for register, word in zip(MAP.config, new):
        await b.write(register.name, word)
    await b.write("COMMAND", 1)
    for _ in range(50):
        await RisingEdge(dut.clk_i)
        assert b.config() == before
    assert await b.read("LIVE") >> 6 & 1 == 1, "the commit waits"
    # A write between the command and the takeover belongs to the set that is taken over.
    new[3] = 0x40000000
    await b.write(MAP.config[3].name, new[3])
    dut.idle_i.value = 1
    seen = set()
    for _ in range(5):
        await RisingEdge(dut.clk_i)
        await ReadOnly()
        seen.add(tuple(b.config()))
    assert seen == {tuple(before), tuple(new)} or seen == {tuple(new)}
    await RisingEdge(dut.clk_i)
    assert await b.read("LIVE") >> 6 & 1 == 0
    # Without a further command nothing is taken over.
    await b.write("R", 0x41000000)
    for _ in range(5):
        await RisingEdge(dut.clk_i)
    assert b.config() == new


@cocotb.test()
async def a_commit_takes_the_write_of_the_clock_before_it(dut):
    """A word written in one clock, the command in the next, a read of the word in the third, nothing in hand: the set
    in force has the word from the fourth edge on, and the read gives it."""
    b = await bench(dut)
    register, word = MAP.named("R"), 0x41000000
    before = b.config()
    after = list(before)
    after[register.address - MAP.config[0].address] = word
    requests = [
        ("write", register.address, word),
        ("write", MAP.named("COMMAND").address, 1),
        ("read", register.address, 0),
    ]
    seen, read = [], []
    for clock in range(10):
        kind, address, data = requests[clock] if clock < len(requests) else ("", 0, 0)
        dut.avs_write_i.value = kind == "write"
        dut.avs_read_i.value = kind == "read"
        dut.avs_address_i.value = address
        dut.avs_writedata_i.value = data
        await RisingEdge(dut.clk_i)
        await ReadOnly()
        seen.append(b.config())
        if int(dut.avs_readdatavalid_o.value):
            read.append((clock, int(dut.avs_readdata_o.value)))
        await NextTimeStep()
    assert seen == [before] * 3 + [after] * 7
    assert read == [(4, word)]


@cocotb.test()
async def clear_is_one_pulse_between_steps(dut):
    """COMMAND.clear waits for the step in hand and is one clock long, also together with a commit."""
    b = await bench(dut)
    pulses = []

    async def count():
        while True:
            await RisingEdge(dut.clk_i)
            await ReadOnly()
            pulses.append(int(dut.clear_o.value))

    cocotb.start_soon(count())
    dut.idle_i.value = 0
    await b.write("COMMAND", 3)
    for _ in range(20):
        await RisingEdge(dut.clk_i)
    assert sum(pulses) == 0
    dut.idle_i.value = 1
    for _ in range(20):
        await RisingEdge(dut.clk_i)
    assert sum(pulses) == 1


@cocotb.test()
async def words_for_the_effect_unit_carry_ascending_addresses(dut):
    """A write to FX_DATA passes on in one clock and counts the address up; without room nothing passes and it stays."""
    b = await bench(dut)
    seen = []

    async def watch():
        while True:
            await RisingEdge(dut.clk_i)
            if int(dut.fx_valid_o.value):
                seen.append((int(dut.fx_address_o.value), int(dut.fx_data_o.value)))

    cocotb.start_soon(watch())
    rng = random.Random(7)
    address = 0x3FF0
    await b.write("FX_ADDRESS", 0xFFFFC000 | address)
    wanted = []
    for _ in range(40):
        word = rng.getrandbits(32)
        ready = rng.random() < 0.7
        dut.fx_ready_i.value = int(ready)
        await b.write("FX_DATA", word)
        if ready:
            wanted.append((address, word))
            address = (address + 1) & 0x3FFF
        assert await b.read("FX_ADDRESS") == address
    assert seen == wanted
    assert b.config() == [r.reset for r in MAP.config]


@cocotb.test()
async def sticky_status(dut):
    """Each event sets its bit for good; a written 1 clears it, unless the event comes at that very clock."""
    b = await bench(dut)
    fields = MAP.named("STATUS").fields
    for field in fields:
        dut.event_i.value = 1 << field.bit
        await RisingEdge(dut.clk_i)
        dut.event_i.value = 0
        await RisingEdge(dut.clk_i)
        assert await b.read("STATUS") == 1 << field.bit, field.name
        await b.write("STATUS", ~(1 << field.bit) & 0xFFFFFFFF)
        assert await b.read("STATUS") == 1 << field.bit, "cleared by another bit's 1"
        await b.write("STATUS", 1 << field.bit)
        assert await b.read("STATUS") == 0
    # The worst moment: the event at the clock that takes the clearing write.
    await RisingEdge(dut.clk_i)
    dut.avs_address_i.value = MAP.named("STATUS").address
    dut.avs_writedata_i.value = 0x7FF
    dut.avs_write_i.value = 1
    dut.event_i.value = 0x7FF
    await RisingEdge(dut.clk_i)
    dut.avs_write_i.value = 0
    dut.event_i.value = 0
    await RisingEdge(dut.clk_i)
    assert await b.read("STATUS") == 0x7FF


@cocotb.test()
async def counters_are_read_as_64_bits(dut):
    """Across the carry of the low word the halves belong together, however long the reader takes."""
    b = await bench(dut)
    for trial in range(8):
        dut.cycles_q.value = (7 << 32) + 0xFFFFFFF0 + trial
        dut.steps_q.value = (5 << 32) + 0xFFFFFFFE
        dut.step_i.value = 1
        low = await b.read("CYCLES_LO")
        for _ in range(40):
            await RisingEdge(dut.clk_i)
        high = await b.read("CYCLES_HI")
        steps = await b.read("STEPS_HI") << 32 | await b.read("STEPS_LO")
        cycles = high << 32 | low
        since = cycles - ((7 << 32) + 0xFFFFFFF0 + trial)
        assert 0 <= since < 10, hex(cycles)
        assert abs(steps - ((5 << 32) + 0xFFFFFFFE) - since) <= 1, hex(steps)
    dut.step_i.value = 0
    await b.write("COMMAND", 2)
    for _ in range(4):
        await RisingEdge(dut.clk_i)
    await b.read("CYCLES_LO")
    assert (await b.read("STEPS_LO"), await b.read("STEPS_HI")) == (0, 0), "clear starts the count of steps anew"


@cocotb.test()
async def observation(dut):
    """NOW_*, CODES_*, LATENCY, LIVE and SERIAL_ERRORS show what the chip gives."""
    b = await bench(dut)
    now = [0xA0000000 + k for k in range(len(NOW))]
    codes = [0xB0000000 + k for k in range(len(CODES))]
    dut.now_i.value = sum(w << 32 * k for k, w in enumerate(now))
    dut.codes_i.value = sum(w << 32 * k for k, w in enumerate(codes))
    dut.latency_i.value = 0x00450044
    dut.live_i.value = 0x2A
    assert [await b.read(r.name) for r in NOW] == now
    assert [await b.read(r.name) for r in CODES] == codes
    assert await b.read("LATENCY") == 0x00450044
    assert await b.read("LIVE") == 0x2A
    dut.open_i.value = 0
    assert {await b.read(r.name) for r in (*NOW, *CODES, MAP.named("LATENCY"))} == {0}, (
        "what a reset may cut is not read"
    )
    assert await b.read("LIVE") == 0x2A
    dut.open_i.value = 1
    dut.serial_error_i.value = 1
    for _ in range(3):
        await RisingEdge(dut.clk_i)
    dut.serial_error_i.value = 0
    assert await b.read("SERIAL_ERRORS") == 3


@cocotb.test()
async def control_acts_at_once(dut):
    """Run and blank follow CONTROL without a commit."""
    b = await bench(dut)
    assert (int(dut.run_o.value), int(dut.blank_o.value)) == (1, 0)
    await b.write("CONTROL", 2)
    assert (int(dut.run_o.value), int(dut.blank_o.value)) == (0, 1)
    await b.write("CONTROL", 1)
    assert (int(dut.run_o.value), int(dut.blank_o.value)) == (1, 0)
