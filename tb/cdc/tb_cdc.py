"""cdc_handshake: no word lost, none twice, none torn, in a bounded number of clocks."""

import random

import cocotb
from cocotb.triggers import ReadOnly, RisingEdge, Timer

MASK = (1 << 62) - 1
# A word and its complement: a torn word would be neither.
PATTERN = 0x2AAA_AAAA_AAAA_AAAA & MASK


async def jittery_clock(signal, period_ps, phase_ps, jitter_ps, rng):
    """A clock whose every edge is moved by up to jitter_ps; the mean period is kept."""
    now, edge, level = 0, phase_ps, 0
    signal.value = 0
    while True:
        target = max(now + 1, edge + (rng.randint(-jitter_ps, jitter_ps) if jitter_ps else 0))
        await Timer(target - now, "ps")
        now = target
        level ^= 1
        signal.value = level
        edge += period_ps // 2


async def start(dut, src_ps, dst_ps, phase_ps, jitter_ps, rng):
    """Reset both sides and run both clocks; returns the clock tasks."""
    dut.src_rst_ni.value = 0
    dut.dst_rst_ni.value = 0
    dut.src_valid_i.value = 0
    dut.src_data_i.value = 0
    clocks = [
        cocotb.start_soon(jittery_clock(dut.src_clk_i, src_ps, 1000, jitter_ps, rng)),
        cocotb.start_soon(jittery_clock(dut.dst_clk_i, dst_ps, 1000 + phase_ps, jitter_ps, rng)),
    ]
    await Timer(100, "ns")
    # Release in either order: neither may make a word of nothing.
    first, second = random.sample([dut.src_rst_ni, dut.dst_rst_ni], 2)
    first.value = 1
    await Timer(rng.randint(0, 60000), "ps")
    second.value = 1
    return clocks


class Receiver:
    """Collects words at the destination and checks that they hold between two valids."""

    def __init__(self, dut):
        self.dut = dut
        self.words = []
        self.edges = 0  # destination edges so far
        self.arrivals = []
        self.task = cocotb.start_soon(self.run())

    async def run(self):
        held = None
        while True:
            await RisingEdge(self.dut.dst_clk_i)
            self.edges += 1
            await ReadOnly()
            if int(self.dut.dst_rst_ni.value) == 0:
                continue
            data = int(self.dut.dst_data_o.value)
            if int(self.dut.dst_valid_o.value):
                self.words.append(data)
                self.arrivals.append(self.edges)
                held = data
            elif held is not None:
                assert data == held, "the word changed without a valid"


async def send(dut, word):
    """Offer a word until it is taken."""
    dut.src_valid_i.value = 1
    dut.src_data_i.value = word
    while True:
        await ReadOnly()
        ready = int(dut.src_ready_o.value)
        await RisingEdge(dut.src_clk_i)
        if ready:
            break
    dut.src_valid_i.value = 0
    dut.src_data_i.value = ~word & MASK  # the source may change its word at once


@cocotb.test()
async def random_clocks(dut):
    """Any two frequencies from 10 to 200 MHz, bursts and pauses, releases in either order."""
    rng = random.Random(11)
    for _ in range(12):
        src, dst = rng.randrange(5000, 100000, 2), rng.randrange(5000, 100000, 2)
        clocks = await start(dut, src, dst, rng.randint(0, dst), 0, rng)
        receiver = Receiver(dut)
        await RisingEdge(dut.src_clk_i)
        for _ in range(4):
            await RisingEdge(dut.src_clk_i)
        sent = []
        for _ in range(25):
            sent.append(rng.getrandbits(62))
            await send(dut, sent[-1])
            for _ in range(rng.choice([0, 0, 1, 3, 9])):
                await RisingEdge(dut.src_clk_i)
        await Timer(8 * max(src, dst), "ps")
        assert receiver.words == sent, f"sent {len(sent)}, received {len(receiver.words)} at {src} and {dst} ps"
        receiver.task.cancel()
        for clock in clocks:
            clock.cancel()


@cocotb.test()
async def phase_sweep(dut):
    """40 to 50 MHz, the phase swept through a whole period in steps of 100 ps, each edge with +-100 ps of jitter."""
    rng = random.Random(12)
    clocks = await start(dut, 25000, 20000, 0, 100, rng)
    seen = set()
    for step in range(250):
        for clock in clocks:
            clock.cancel()
        dut.src_clk_i.value = 0
        dut.dst_clk_i.value = 0
        await Timer(50, "ns")
        clocks = await start(dut, 25000, 20000, 100 * step, 100, rng)
        receiver = Receiver(dut)
        for _ in range(6):
            await RisingEdge(dut.src_clk_i)
        for k in range(5):
            word = PATTERN if k % 2 else ~PATTERN & MASK
            await send(dut, word)
            taken = receiver.edges
            for _ in range(9):
                await RisingEdge(dut.src_clk_i)
            assert receiver.words and receiver.words[-1] == word and len(receiver.words) == k + 1, f"phase {step}"
            seen.add(receiver.arrivals[-1] - taken)
        receiver.task.cancel()
    # An edge of the destination that falls together with the source's may count as before or after it.
    assert seen <= {3, 4}, f"latencies in destination edges: {sorted(seen)}"


@cocotb.test()
async def offered_too_early(dut):
    """A word offered while one is under way is refused and reported, and the one under way arrives whole."""
    rng = random.Random(13)
    clocks = await start(dut, 25000, 20000, 3000, 0, rng)
    receiver = Receiver(dut)
    for _ in range(6):
        await RisingEdge(dut.src_clk_i)
    await send(dut, 0x123456789)
    dut.src_valid_i.value = 1
    await ReadOnly()
    assert int(dut.src_ready_o.value) == 0 and int(dut.src_dropped_o.value) == 1
    await RisingEdge(dut.src_clk_i)
    dut.src_valid_i.value = 0
    for _ in range(12):
        await RisingEdge(dut.src_clk_i)
    await ReadOnly()
    assert receiver.words == [0x123456789]
    assert int(dut.src_ready_o.value) == 1
    for clock in clocks:
        clock.cancel()
