"""Serial pins to registers: the client of rtds_host, and everything that may be wrong with a line."""

import random

import cocotb
from agents.serial_line import BridgedTransport, SerialLine
from cocotb.clock import Clock
from cocotb.task import bridge
from cocotb.triggers import RisingEdge, Timer

from rtds_host.errors import LinkError
from rtds_host.link.registers import (
    OP_READ,
    OP_WRITE,
    SOF_ANSWER,
    RegisterClient,
    crc16,
    decode,
    encode_request,
    load_map,
)

MAP = load_map()
BIT_PS = 320_000  # 16 clocks: the chip has 50, tested in tb/top
QUIET_PS = 150 * BIT_PS


async def start(dut, skew=1.0):
    dut.rst_ni.value = 0
    dut.idle_i.value = 1
    dut.rx_i.value = 1
    dut.clk_i.value = 0
    cocotb.start_soon(Clock(dut.clk_i, 20, "ns", impl="gpi").start())
    line = SerialLine(dut.rx_i, dut.tx_o, BIT_PS, skew)
    await Timer(100, "ns")
    dut.rst_ni.value = 1
    await RisingEdge(dut.clk_i)
    return line


async def ask(line, tag, op, address, data=0, **how):
    await line.send(encode_request(tag, op, address, data), **how)
    return decode(await line.receive(9, QUIET_PS), SOF_ANSWER)


async def works(line):
    """The port answers as if nothing had been."""
    assert await ask(line, 5, OP_READ, 0) == (5, 0, 0, MAP.identity)


@cocotb.test()
async def the_client_of_a_board(dut):
    """The Python client over the simulated line: identity, writing, committing, counters, refusals."""
    line = await start(dut)

    def use(transport):
        client = RegisterClient(transport, where="simulation")
        assert client.identify() == MAP.version
        assert client.read_word("BUILD") == 0xC0FFEE11
        client.write("SCRATCH", 0xDEADBEEF)
        assert client.read("SCRATCH") == 0xDEADBEEF
        client.configure({"R": 2.5, "H": 1e-6})
        assert client.read("R") == 2.5 and abs(client.read("H") / 1e-6 - 1) < 1e-7
        first, second = client.counters(), client.counters()
        assert second[0] > first[0] > 0
        client.write_flags("CONTROL", run=False, blank=True)
        assert client.flags("CONTROL") == {"run": False, "blank": True}
        assert not any(client.take_status().values())
        try:
            client.transfer(OP_WRITE, 0, 1)
        except LinkError as error:
            assert str(error) == "simulation: register address 0x00: the register is read-only"
        else:
            raise AssertionError("a read-only register was written")
        try:
            client.transfer(OP_READ, 0x7F)
        except LinkError as error:
            assert "no such register" in str(error)
        else:
            raise AssertionError("a hole in the map answered")

    await bridge(use)(BridgedTransport(line))
    assert int(dut.config_o.value) & 0xFFFFFFFF == 0x40200000, "R is in force after the commit"


@cocotb.test()
async def a_dead_line_is_one_clear_error(dut):
    """A chip in reset: the client gives up by itself and says so in one line."""
    line = await start(dut)
    dut.rst_ni.value = 0

    def use(transport):
        try:
            RegisterClient(transport, where="simulation").read("ID")
        except LinkError as error:
            return str(error)
        raise AssertionError("a chip in reset answered")

    assert await bridge(use)(BridgedTransport(line, QUIET_PS)) == "simulation: bus does not answer"


@cocotb.test()
async def damaged_requests_get_no_answer(dut):
    """Any one bit wrong in any byte: no answer, no register changed, counted, and the next request works."""
    line = await start(dut)
    good = encode_request(1, OP_WRITE, MAP.named("SCRATCH").address, 0x5AA5C33C)
    rng = random.Random(41)
    for index in range(9):
        bad = bytearray(good)
        bad[index] ^= 1 << rng.randrange(8)
        await line.send(bytes(bad))
        await Timer(120 * BIT_PS, "ps")  # over the time-out of the chip
        assert not line.received
    assert (await ask(line, 2, OP_READ, MAP.named("SCRATCH").address))[3] == 0
    # A damaged start byte is no request at all; whatever else may look like one is counted.
    count = (await ask(line, 3, OP_READ, MAP.named("SERIAL_ERRORS").address))[3]
    assert count >= 8
    assert (await ask(line, 4, OP_READ, MAP.named("STATUS").address))[3] == 1 << MAP.named("STATUS").field(
        "serial_error"
    ).bit
    await works(line)


@cocotb.test()
async def unknown_operation(dut):
    """An operation that is none is answered as such, tag and all, and changes nothing."""
    line = await start(dut)
    for op in (0, 3, 15):
        answer = await ask(line, 9, op, MAP.named("SCRATCH").address, 7)
        assert answer is not None and answer[:3] == (9, 1, MAP.named("SCRATCH").address)
    assert (await ask(line, 2, OP_READ, MAP.named("SCRATCH").address))[3] == 0
    await works(line)


@cocotb.test()
async def cut_requests_and_noise(dut):
    """A request cut anywhere, a broken stop bit, glitches, a line held low: the next request works."""
    line = await start(dut)
    good = encode_request(1, OP_READ, 0)
    for length in range(1, 9):
        await line.send(good[:length])
        await Timer(100 * BIT_PS, "ps")
        await works(line)
    await line.send(good, stop=0)
    await Timer(100 * BIT_PS, "ps")
    assert not line.received
    await works(line)
    for width_ns in (20, 60, 120):  # shorter than half a bit: not a start bit
        dut.rx_i.value = 0
        await Timer(width_ns, "ns")
        dut.rx_i.value = 1
        await Timer(20 * BIT_PS, "ps")
    dut.rx_i.value = 0  # a pulled plug
    await Timer(300 * BIT_PS, "ps")
    dut.rx_i.value = 1
    await Timer(20 * BIT_PS, "ps")
    assert not line.received
    await works(line)


@cocotb.test()
async def a_glitch_between_two_bytes_is_no_byte(dut):
    """A low level shorter than half a bit, in a pause inside a request: the next byte's start bit follows while a
    receiver that took the glitch for one would still be collecting bits.
    """
    line = await start(dut)
    request = encode_request(8, OP_READ, 0)
    for width_ns in (20, 60, 120):
        for place in range(1, 9):
            await line.send(request[:place])
            await Timer(2 * BIT_PS, "ps")
            dut.rx_i.value = 0
            await Timer(width_ns, "ns")
            dut.rx_i.value = 1
            await Timer(3 * BIT_PS, "ps")
            await line.send(request[place:])
            answer = decode(await line.receive(9, QUIET_PS), SOF_ANSWER)
            assert answer == (8, 0, 0, MAP.identity), f"a glitch of {width_ns} ns before byte {place}"
            line.received.clear()


@cocotb.test()
async def a_spike_in_every_bit_is_outvoted(dut):
    """Each bit of a byte is wrong for one clock, at the same clock of every bit: two of the three samples decide."""
    line = await start(dut)
    address = MAP.named("SCRATCH").address
    clock_ps = BIT_PS // 16
    for clock in range(1, 15):
        for pattern in (0x5AA5C33C, 0x00FF0FF0):
            for byte in encode_request(3, OP_WRITE, address, pattern ^ clock):
                dut.rx_i.value = 0
                await Timer(BIT_PS, "ps")
                for level in [*(byte >> k & 1 for k in range(8)), 1]:
                    for part, clocks in ((level, clock), (1 - level, 1), (level, 15 - clock)):
                        dut.rx_i.value = part
                        await Timer(clocks * clock_ps, "ps")
            answer = decode(await line.receive(9, QUIET_PS), SOF_ANSWER)
            assert answer == (3, 0, address, pattern ^ clock), f"a spike in clock {clock} of every bit"
            line.received.clear()


@cocotb.test()
async def a_broken_byte_ends_its_request(dut):
    """A framing error inside of a request: the next request, at once, is a request and not the rest of the
    broken one.
    """
    line = await start(dut)
    good = encode_request(4, OP_READ, 0)
    for length in range(2, 9):
        await line.send(encode_request(1, OP_WRITE, MAP.named("SCRATCH").address, 0x5A5A5A5A)[:length], stop=0)
        await Timer(3 * BIT_PS, "ps")
        await line.send(good)
        answer = decode(await line.receive(9, QUIET_PS), SOF_ANSWER)
        assert answer == (4, 0, 0, MAP.identity), f"after a request that broke off in byte {length}"
        line.received.clear()


@cocotb.test()
async def pauses_and_clocks_that_are_off(dut):
    """Gaps between bytes below the time-out, and a transmitter 3 % fast or slow."""
    line = await start(dut)
    assert await ask(line, 5, OP_READ, 0, gap_bits=30) == (5, 0, 0, MAP.identity)
    for skew in (0.97, 1.03):
        line.skew = skew
        for pattern in (0x00000000, 0xFFFFFFFF, 0x55555555, 0xA5A5A5A5):
            address = MAP.named("SCRATCH").address
            assert await ask(line, 6, OP_WRITE, address, pattern) == (6, 0, address, pattern)
            assert await ask(line, 7, OP_READ, address) == (7, 0, address, pattern)


@cocotb.test()
async def a_start_byte_inside_the_data(dut):
    """Data made of start bytes of both directions is data."""
    line = await start(dut)
    address = MAP.named("SCRATCH").address
    for word in (0xA5A5A5A5, 0x5A5A5A5A, 0xA55AA55A):
        assert await ask(line, 10, OP_WRITE, address, word) == (10, 0, address, word)
        assert await ask(line, 5, OP_READ, address) == (5, 0, address, word)


@cocotb.test()
async def a_write_during_a_step_is_taken_over_after_it(dut):
    """A commit over the line while a step is in hand waits for its end."""
    line = await start(dut)
    dut.idle_i.value = 0
    before = int(dut.config_o.value)
    await ask(line, 1, OP_WRITE, MAP.named("R").address, 0x3F800000)
    await ask(line, 2, OP_WRITE, MAP.named("COMMAND").address, 1)
    assert int(dut.config_o.value) == before
    dut.idle_i.value = 1
    for _ in range(4):  # one more than the gap itself: it is taken over on a registered enable
        await RisingEdge(dut.clk_i)
    assert int(dut.config_o.value) & 0xFFFFFFFF == 0x3F800000


@cocotb.test()
async def check_value_of_the_crc(dut):
    """The published check value, so that both sides are the same known CRC and not the same mistake."""
    await start(dut)
    assert crc16(b"123456789") == 0x29B1
