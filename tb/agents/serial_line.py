"""A serial line to a simulated chip: bytes to levels and back, 8N1, and a blocking transport on top of it."""

import cocotb
from cocotb.triggers import Edge, FallingEdge, First, Timer


class SerialLine:
    """Drives `rx` of a chip and listens to its `tx`.

    Parameters
    ----------
    rx, tx : signals, named as the chip sees them.
    bit_ps : length of a bit; `skew` stretches the bits that are sent (a transmitter with a clock that is off).
    """

    def __init__(self, rx, tx, bit_ps=1_000_000, skew=1.0):
        self.rx = rx
        self.tx = tx
        self.bit_ps = bit_ps
        self.skew = skew
        self.received = bytearray()
        self.rx.value = 1
        self.task = cocotb.start_soon(self._listen())

    async def send(self, data, gap_bits=0, stop=1):
        """Send bytes; `stop=0` breaks the stop bit of the last one."""
        bit = round(self.bit_ps * self.skew)
        for index, byte in enumerate(data):
            for level in [0, *(byte >> k & 1 for k in range(8)), stop if index == len(data) - 1 else 1]:
                self.rx.value = level
                await Timer(bit, "ps")
            self.rx.value = 1
            if gap_bits:
                await Timer(gap_bits * bit, "ps")

    async def _listen(self):
        while True:
            await FallingEdge(self.tx)
            await Timer(self.bit_ps // 2, "ps")
            assert int(self.tx.value) == 0, "a start bit shorter than half a bit"
            byte = 0
            for k in range(8):
                await Timer(self.bit_ps, "ps")
                byte |= int(self.tx.value) << k
            await Timer(self.bit_ps, "ps")
            assert int(self.tx.value) == 1, "no stop bit"
            self.received.append(byte)

    async def receive(self, count, timeout_ps):
        """Up to `count` bytes that came in; fewer when the line stays quiet for the whole time-out."""
        step = self.bit_ps
        waited = 0
        while len(self.received) < count and waited < timeout_ps:
            before = len(self.received)
            await First(Timer(step, "ps"), Edge(self.tx))
            await Timer(step, "ps")
            waited = 0 if len(self.received) != before else waited + step
        data = bytes(self.received[:count])
        del self.received[:count]
        return data


class BridgedTransport:
    """The transport of `rtds_host.link.registers` on a simulated line.

    Its methods block, so the client runs in a thread: `await cocotb.task.bridge(function)(...)`.
    """

    def __init__(self, line, timeout_ps=300_000_000):
        from cocotb.task import resume

        self._line = line
        self._send = resume(line.send)
        self._receive = resume(line.receive)
        self._timeout_ps = timeout_ps

    def send(self, data):
        self._send(data)

    def receive(self, count):
        return self._receive(count, self._timeout_ps)

    def flush_input(self):
        self._line.received.clear()

    def close(self):
        self._line.task.cancel()
