"""The serial port at the board's own values: 1 Mbaud on 50 MHz, and the pause that cuts a request."""

import cocotb
from agents.serial_line import SerialLine
from cocotb.clock import Clock
from cocotb.triggers import Timer

from rtds_host.link.registers import OP_READ, SOF_ANSWER, decode, encode_request, load_map

MAP = load_map()
BIT_PS = 1_000_000  # 1 Mbaud
TIMEOUT_BITS = 2000
QUIET_PS = 150 * BIT_PS
HALF = 4  # bytes of the request before its pause


async def ask_with_a_pause(line, tag, bits):
    """A request whose two halves are that many bit times apart, stop bit to start bit; its answer, or None."""
    request = encode_request(tag, OP_READ, 0)
    await line.send(request[:HALF])
    await Timer(bits * BIT_PS, "ps")
    await line.send(request[HALF:])
    return decode(await line.receive(9, QUIET_PS), SOF_ANSWER)


@cocotb.test()
async def a_pause_of_the_boards_time_out_cuts_a_request(dut):
    """A pause just below 2000 bit times is no end of a request (a USB adapter under load makes such pauses); one just
    above is, and it is counted.
    """
    dut.rst_ni.value = 0
    dut.clk_i.value = 0
    cocotb.start_soon(Clock(dut.clk_i, 20, "ns", impl="gpi").start())
    line = SerialLine(dut.rx_i, dut.tx_o, BIT_PS)
    await Timer(100, "ns")
    dut.rst_ni.value = 1
    await Timer(1, "us")
    assert await ask_with_a_pause(line, 1, TIMEOUT_BITS - 15) == (1, 0, 0, MAP.identity)
    await line.send(encode_request(2, OP_READ, 0)[:HALF])
    await Timer((TIMEOUT_BITS + 5) * BIT_PS, "ps")
    await line.send(encode_request(3, OP_READ, MAP.named("SERIAL_ERRORS").address))
    answer = decode(await line.receive(9, QUIET_PS), SOF_ANSWER)
    assert answer == (3, 0, MAP.named("SERIAL_ERRORS").address, 1), "a whole request after a cut one"
