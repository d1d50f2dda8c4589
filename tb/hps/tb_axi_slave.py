"""axi_slave with cocotbext-axi's master on one side and registers with random wait states on the other."""

import itertools
import logging
import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, Timer, with_timeout
from cocotbext.axi import AxiBurstType, AxiBus, AxiMaster, AxiResp

READ_ONLY, NOTHING = 0x40, 0x80  # byte addresses from which on writes, and all accesses, are refused,
MEMORY = 0x100  # and from which on every word is kept


class Registers:
    """Answers the register bus after 0 to 5 clocks; keeps what was written, and every access."""

    def __init__(self, dut):
        self.dut, self.words, self.seen = dut, {}, []
        dut.reg_ready_i.value = 0
        dut.reg_error_i.value = 0
        dut.reg_rdata_i.value = 0
        cocotb.start_soon(self.run())

    async def run(self):
        dut = self.dut
        wait = 0
        while True:
            await FallingEdge(dut.clk_i)  # between two rising edges: all has settled
            if dut.rst_ni.value != 1 or not dut.reg_valid_o.value:
                dut.reg_ready_i.value, wait = 0, random.randint(0, 5)
                continue
            if dut.reg_ready_i.value:
                wait = random.randint(0, 5)  # a new beat in the clock after the last
            if wait:
                wait -= 1
                dut.reg_ready_i.value = 0
                continue
            address, write = int(dut.reg_addr_o.value), bool(dut.reg_write_o.value)
            refused = address < MEMORY and (address >= NOTHING or (write and address >= READ_ONLY))
            if write and not refused:
                self.words[address] = int(dut.reg_wdata_o.value)
            self.seen.append((write, address))
            dut.reg_rdata_i.value = 0 if write else self.words.get(address, address * 0x01010101 & 0xFFFFFFFF)
            dut.reg_error_i.value = int(refused)
            dut.reg_ready_i.value = 1


async def start(dut, late):
    """Clock, reset, master and registers; `late`: pauses of all channels."""
    logging.getLogger("cocotb").setLevel(logging.WARNING)
    cocotb.start_soon(Clock(dut.clk_i, 20, unit="ns", impl="gpi").start())
    dut.rst_ni.value = 0
    registers = Registers(dut)
    await Timer(50, unit="ns")  # Icarus has the outputs unknown until then, and the master looks at them
    master = AxiMaster(AxiBus.from_prefix(dut, "s_axi"), dut.clk_i, dut.rst_ni, reset_active_level=False)
    await Timer(45, unit="ns")
    dut.rst_ni.value = 1
    await RisingEdge(dut.clk_i)
    if late:
        for channel in (
            master.write_if.aw_channel,
            master.write_if.w_channel,
            master.write_if.b_channel,
            master.read_if.ar_channel,
            master.read_if.r_channel,
        ):
            channel.set_pause_generator(itertools.cycle([random.random() < 0.5 for _ in range(97)]))
    return master, registers


async def soon(what):
    return await with_timeout(what, 100, "us")


@cocotb.test()
@cocotb.parametrize(late=[False, True])
async def words_and_bursts_come_back_as_they_were_written(dut, late):
    master, registers = await start(dut, late)
    for _ in range(60):
        count = random.randint(1, 8)
        at = 4 * random.randint(0, 15 - count + 1)
        data = bytes(random.getrandbits(8) for _ in range(4 * count))
        answer = await soon(master.write(at, data, burst=AxiBurstType.INCR))
        assert answer.resp == AxiResp.OKAY
        got = await soon(master.read(at, 4 * count))
        assert got.resp == AxiResp.OKAY and bytes(got.data) == data
    assert len(registers.seen) > 200


@cocotb.test()
@cocotb.parametrize(late=[False, True])
async def what_is_refused_gives_an_error_and_changes_nothing(dut, late):
    master, registers = await start(dut, late)
    assert (await soon(master.write(READ_ONLY, b"1234"))).resp == AxiResp.SLVERR
    assert (await soon(master.read(NOTHING, 4))).resp == AxiResp.SLVERR
    assert (await soon(master.write(NOTHING, b"1234"))).resp == AxiResp.SLVERR
    before = list(registers.seen)
    assert (await soon(master.write(2, b"12"))).resp == AxiResp.SLVERR  # not all strobes
    assert (await soon(master.write(0, b"1", size=0))).resp == AxiResp.SLVERR
    assert (await soon(master.read(0, 2, size=1))).resp == AxiResp.SLVERR
    assert registers.seen == before and not registers.words
    assert (await soon(master.write(0, b"abcd"))).resp == AxiResp.OKAY
    # A burst of which one beat is refused: the others act, the answer says it.
    assert (await soon(master.write(READ_ONLY - 4, b"abcdefgh"))).resp == AxiResp.SLVERR
    assert registers.words == {0: int.from_bytes(b"abcd", "little"), READ_ONLY - 4: int.from_bytes(b"abcd", "little")}


@cocotb.test()
@cocotb.parametrize(late=[False, True])
async def a_burst_that_is_refused_at_once_ends_after_its_last_beat(dut, late):
    master, registers = await start(dut, late)
    for at, count, how in (
        (0x10, 16, {"burst": AxiBurstType.WRAP}),  # four beats round a border
        (0x12, 16, {}),  # no multiple of 4
        (0x11, 1, {"size": 0}),
        (0x10, 6, {"size": 1}),  # three halves of a word
        (0x10, 2, {"size": 0, "burst": AxiBurstType.FIXED}),
    ):
        assert (await soon(master.write(at, bytes(count), **how))).resp == AxiResp.SLVERR
        assert (await soon(master.read(at, count, **how))).resp == AxiResp.SLVERR
    assert not registers.seen
    # What comes next is not mistaken for its rest.
    assert (await soon(master.write(0x10, b"abcd"))).resp == AxiResp.OKAY
    assert bytes((await soon(master.read(0x10, 4))).data) == b"abcd" and len(registers.seen) == 2


@cocotb.test()
async def all_beats_of_a_fixed_burst_are_at_one_address(dut):
    master, registers = await start(dut, late=True)
    for count in range(1, 9):
        at, data = random.randrange(MEMORY, 1 << 21, 4), bytes(random.getrandbits(8) for _ in range(4 * count))
        registers.seen.clear()
        assert (await soon(master.write(at, data, burst=AxiBurstType.FIXED))).resp == AxiResp.OKAY
        got = await soon(master.read(at, 4 * count, burst=AxiBurstType.FIXED))
        assert got.resp == AxiResp.OKAY and bytes(got.data) == data[-4:] * count
        assert registers.seen == [(True, at)] * count + [(False, at)] * count


@cocotb.test()
@cocotb.parametrize(late=[False, True])
async def any_id_address_and_length_is_answered(dut, late):
    master, registers = await start(dut, late)
    ids, page = 1 << len(dut.s_axi_awid), 4096  # no burst crosses a border of so many bytes
    for k in range(60):
        count = 256 if k == 0 else random.randint(1, 20)
        at = random.randrange(MEMORY, 1 << 21, 4)
        at = max(MEMORY, min(at, at // page * page + page - 4 * count))
        data = bytes(random.getrandbits(8) for _ in range(4 * count))
        answer = await with_timeout(master.write(at, data, awid=random.randrange(ids)), 500, "us")
        got = await with_timeout(master.read(at, 4 * count, arid=random.randrange(ids)), 500, "us")
        assert answer.resp == got.resp == AxiResp.OKAY and bytes(got.data) == data
        assert registers.seen[-1] == (False, at + 4 * count - 4)


@cocotb.test()
@cocotb.parametrize(late=[False, True])
async def reads_and_writes_at_once_take_turns(dut, late):
    master, registers = await start(dut, late)
    tasks = [cocotb.start_soon(master.write(4 * k, bytes([k] * 4))) for k in range(16)]
    tasks += [cocotb.start_soon(master.read(0x60, 4)) for _ in range(16)]
    for task in tasks:
        assert (await soon(task)).resp == AxiResp.OKAY
    kinds = [write for write, _ in registers.seen]
    assert kinds.count(True) == kinds.count(False) == 16
    assert max(len(list(group)) for _, group in itertools.groupby(kinds)) < 12


@cocotb.test()
async def after_a_reset_in_the_midst_of_transactions_it_answers(dut):
    master, registers = await start(dut, late=False)
    for _ in range(25):
        for k in range(4):
            cocotb.start_soon(master.write(4 * k, b"5678"))
            cocotb.start_soon(master.read(4 * k, 16))
        await Timer(random.randint(1, 900), unit="ns")
        dut.rst_ni.value = 0
        await Timer(100, unit="ns")
        assert not dut.s_axi_bvalid.value and not dut.s_axi_rvalid.value and not dut.reg_valid_o.value
        dut.rst_ni.value = 1
        for _ in range(2):
            await RisingEdge(dut.clk_i)
        word = bytes(random.getrandbits(8) for _ in range(4))
        assert (await soon(master.write(8, word))).resp == AxiResp.OKAY
        assert bytes((await soon(master.read(8, 4))).data) == word
