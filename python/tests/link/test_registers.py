"""The register client: its protocol, a real serial device (a pseudo-terminal), and everything that can go wrong."""

import itertools
import os
import random
import select
import threading
import time
import tty

import pytest

from rtds_host.errors import InputError, LinkError
from rtds_host.link import registers
from rtds_host.link.registers import (
    OP_READ,
    OP_WRITE,
    SOF_REQUEST,
    RegisterClient,
    SerialTransport,
    crc16,
    decode,
    encode_answer,
    encode_request,
    load_map,
    open_serial,
)

MAP = load_map()


class Board:
    """A chip at the far end of a pseudo-terminal, in a thread; `answers` is the number of requests it answers."""

    stuck = False  # takes no more bytes

    def __init__(self, answers=10**6, noise=b"", identity=MAP.identity, damage=0):
        self.master, slave = os.openpty()
        tty.setraw(self.master)
        tty.setraw(slave)
        self.device = os.ttyname(slave)
        self._slave = slave
        self._ended, self._end = os.pipe()
        self.words = {r.address: r.reset for r in MAP.registers}
        self.words[0] = identity
        self.words[1] = MAP.version_word
        self.answers, self.noise, self.damage = answers, noise, damage
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()

    def _serve(self):
        while True:
            while self.stuck:
                time.sleep(0.01)
            request = b""
            while len(request) < 9:
                if self._ended in select.select([self.master, self._ended], [], [])[0]:
                    return
                request += os.read(self.master, 9 - len(request))
            decoded = decode(request, SOF_REQUEST)
            if decoded is None or self.answers == 0:
                continue
            self.answers -= 1
            tag, op, address, data = decoded
            status = 0 if address in self.words else 3
            if op == OP_WRITE and status == 0:
                self.words[address] = data
            answer = bytearray(encode_answer(tag, status, address, self.words.get(address, 0)))
            if self.damage:
                self.damage -= 1
                answer[4] ^= 1
            os.write(self.master, self.noise + bytes(answer))

    def close(self):
        # The thread ends first: the next board gets the same numbers of files, and this one would answer for it.
        self.stuck = False
        os.write(self._end, b"x")
        self.thread.join()
        for file in (self._slave, self.master, self._ended, self._end):
            os.close(file)


@pytest.fixture
def board():
    made = []

    def make(**how):
        made.append(Board(**how))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_crc_is_the_published_one():
    assert crc16(b"123456789") == 0x29B1


def test_requests_and_answers_are_their_own_inverse():
    assert decode(encode_request(3, OP_READ, 0x12, 0xDEADBEEF), SOF_REQUEST) == (3, OP_READ, 0x12, 0xDEADBEEF)
    frame = bytearray(encode_request(3, OP_READ, 0x12))
    for bit in range(8 * len(frame)):
        bad = bytearray(frame)
        bad[bit // 8] ^= 1 << bit % 8
        assert decode(bytes(bad), SOF_REQUEST) is None, f"bit {bit}"


def test_a_serial_device_reads_and_writes(board):
    with open_serial(board().device) as chip:
        assert chip.identify() == MAP.version
        chip.configure({"R": 2.5, "CONFIG": 0x1})
        assert chip.read("R") == 2.5
        chip.write_flags("CONTROL", run=False)
        assert chip.flags("CONTROL") == {"run": False, "blank": False}


def test_noise_before_an_answer_is_passed_over(board):
    with open_serial(board(noise=b"\x00\xff\x12").device) as chip:
        assert chip.read("R") == pytest.approx(8.6)


def test_a_damaged_answer_is_asked_for_again(board):
    with open_serial(board(damage=2).device) as chip:
        assert chip.read("ID") == MAP.identity


def test_a_silent_device_is_one_clear_line(board):
    device = board(answers=0).device
    with pytest.raises(LinkError, match="^" + device + ": bus does not answer$"):
        open_serial(device, timeout_s=0.05)


def test_a_chip_that_falls_silent_is_one_clear_line(board):
    device = board(answers=4).device
    with open_serial(device, timeout_s=0.05) as chip, pytest.raises(LinkError, match="bus does not answer"):
        for _ in range(10):
            chip.read("STATUS")


def test_another_device_is_named(board):
    with pytest.raises(LinkError, match="not this chip"):
        open_serial(board(identity=0x12345678).device)


# What a line may do instead of answering: bytes of one piece, and the seconds before each piece.
def _wrong_sequence():
    return (encode_answer(tag, 0, 0, MAP.identity) for tag in itertools.cycle((9, 10, 11)))


def _random_bytes():
    return (random.Random(k).randbytes(9) for k in itertools.count())


CHATTER = {
    "zeros": (lambda: itertools.repeat(bytes(9)), 0.0),
    "ones": (lambda: itertools.repeat(b"\xff" * 9), 0.0),
    "start bytes": (lambda: itertools.repeat(b"\x5a" * 9), 0.0),
    "random": (_random_bytes, 0.0),
    "answers to something else": (_wrong_sequence, 0.0),
    "the request itself": (lambda: itertools.repeat(encode_request(1, OP_READ, 0)), 0.0),
    "a byte now and then": (lambda: itertools.repeat(b"\x5a"), 0.2),
    "a byte of noise now and then": (lambda: itertools.repeat(b"\x00"), 0.2),
    "a right answer, too slowly": (
        lambda: (encode_answer(1, 0, 0, MAP.identity)[k % 9 :][:1] for k in itertools.count()),
        0.1,
    ),
}


class Clock:
    """Time that only a line's silence lets pass."""

    t = 0.0

    def monotonic(self):
        return self.t


class Chatter:
    """In place of the serial module's port: pieces of bytes, each so long after the last, on a clock of its own."""

    def __init__(self, clock, pieces, every_s, timeout_s):
        self.clock, self.pieces, self.every_s, self.timeout_s = clock, pieces, every_s, timeout_s
        self.due, self.rest, self.reads = every_s, b"", 0

    def write(self, data):
        pass

    def reset_input_buffer(self):
        self.rest = b""

    def read(self, count):
        self.reads += 1
        assert self.reads < 10_000, "it reads on for ever"
        until = self.clock.t + self.timeout_s
        while len(self.rest) < count and self.due <= until:
            self.clock.t = max(self.clock.t, self.due)
            self.due = self.clock.t + self.every_s
            self.rest += next(self.pieces)
        if len(self.rest) < count:
            self.clock.t = until
        got, self.rest = self.rest[:count], self.rest[count:]
        return got


@pytest.mark.parametrize("kind", CHATTER)
def test_a_line_that_does_not_stop_talking_ends_in_one_line_within_the_stated_time(board, monkeypatch, kind):
    pieces, every_s = CHATTER[kind]
    transport = SerialTransport(board().device, timeout_s=0.25)
    clock = Clock()
    monkeypatch.setattr(registers, "time", clock)
    transport.port.close()
    transport.port = Chatter(clock, pieces(), every_s, registers.SLICE_S)
    client = RegisterClient(transport, where="line")
    with pytest.raises(
        LinkError, match=r"^line: bus does not answer to what was asked; \d+ other bytes came on its line$"
    ):
        client.read("ID")
    assert clock.t <= 3 * (0.25 + registers.SLICE_S)


def test_a_real_port_on_which_noise_comes_without_end_is_given_up(board):
    one = board(answers=0)
    stop = threading.Event()

    def talk():
        while not stop.wait(0.0005):
            try:
                os.write(one.master, bytes(64))
            except OSError:
                return

    talker = threading.Thread(target=talk, daemon=True)
    talker.start()
    with pytest.raises(LinkError, match="bus does not answer to what was asked"):
        open_serial(one.device, timeout_s=0.1)
    stop.set()
    talker.join()


def test_answers_to_earlier_requests_before_the_right_one_are_passed_over(board):
    late = encode_answer(9, 0, 0, 1) + encode_answer(10, 0, 0, 2) + b"\x5a\x00"
    with open_serial(board(noise=late).device) as chip:
        assert chip.read("ID") == MAP.identity


def test_a_port_that_takes_no_bytes_is_one_clear_line(board):
    one = board()
    one.stuck = True
    transport = SerialTransport(one.device, write_timeout_s=0.05)
    with pytest.raises(LinkError, match=f"{one.device}: the serial port takes no bytes"):
        transport.send(bytes(1 << 20))


def test_a_missing_device_is_named():
    with pytest.raises(LinkError, match="/dev/no-such-port: cannot open the serial port"):
        SerialTransport("/dev/no-such-port")


def test_a_hole_in_the_map_is_told(board):
    with open_serial(board().device) as chip, pytest.raises(LinkError, match="0x7F: no such register"):
        chip.transfer(OP_READ, 0x7F)


def test_bad_names_and_values_are_refused_before_the_bus():
    chip = RegisterClient(transport=None)  # nothing is sent
    with pytest.raises(InputError, match="'NO_SUCH' is unknown"):
        chip.read("NO_SUCH")
    with pytest.raises(InputError, match="ID is read-only"):
        chip.write("ID", 1)
    with pytest.raises(InputError, match="not a 32-bit word"):
        chip.write("SCRATCH", 2**32)
    with pytest.raises(InputError, match="beyond single precision"):
        chip.write("R", 1e39)
    with pytest.raises(InputError, match="not in the config group"):
        chip.configure({"SCRATCH": 1})
    with pytest.raises(InputError, match="no field 'walk'"):
        chip.map.named("CONTROL").field("walk")


def test_defaults_are_the_default_motor():
    values = {r.name: r.from_word(r.reset) for r in MAP.config}
    assert values["R"] == pytest.approx(8.6) and values["H"] == pytest.approx(1e-5)
    assert registers.BAUD == 1_000_000
