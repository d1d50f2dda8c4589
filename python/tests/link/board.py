"""A board for tests: a compiled fake of the vendor's library, a chip behind its serial port, and a clock to wind on."""

import ctypes
import subprocess
from pathlib import Path

import numpy as np

from rtds_host.link.analog import DAC_OUTPUTS, Paths, dac_volts
from rtds_host.link.registers import (
    FRAME_BYTES,
    OP_WRITE,
    SOF_REQUEST,
    RegisterClient,
    decode,
    encode_answer,
    load_map,
    word_float,
)

V_SERIAL, T_SERIAL = "SN:210321AAAA01", "SN:210321AAAA02"
MAP = load_map()
STATUS = {f.name: 1 << f.bit for f in MAP.named("STATUS").fields}


def build_fake(folder: Path) -> Path:
    """The fake libdwf, compiled."""
    path = folder / "libdwf.so"
    source = Path(__file__).with_name("fake_dwf.cpp")
    subprocess.run(["g++", "-std=c++17", "-O0", "-shared", "-fPIC", "-o", path, source], check=True)
    return path


def load_fake(monkeypatch, path: Path, devices: int = 2) -> ctypes.CDLL:
    """Let pydwf find the fake under the vendor's name; returns it for its fake_* functions."""
    fake = ctypes.CDLL(str(path))
    fake.fake_output.restype = ctypes.c_double
    fake.fake_input.argtypes = (ctypes.c_int, ctypes.c_int, ctypes.c_double)
    fake.fake_reset(devices)

    def load(name):
        assert name == "libdwf.so", "pydwf loads the vendor's library by this name"
        return ctypes.CDLL(str(path))

    monkeypatch.setattr(ctypes.cdll, "LoadLibrary", load)
    return fake


class ManualClock:
    """Time that passes when it is slept or wound on."""

    def __init__(self):
        self.t = 100.0
        self.delays = []  # s, one used up by each sleep: how late it returns

    def now(self):
        return self.t

    def sleep_until(self, t):
        self.t = max(self.t, t) + (self.delays.pop(0) if self.delays else 0.0)


class FakeChip:
    """Registers behind a serial port (a transport), ADC and DAC at the ends of wires."""

    def __init__(self, dwf, wires=None):
        self.dwf, self.wires = dwf, wires or Paths()
        self.words = {r.name: r.reset for r in MAP.registers}
        self.words["ID"], self.words["VERSION"] = MAP.identity, MAP.version_word
        self.shadow = {}
        self.closed = False
        self._answer = b""

    def client(self):
        return RegisterClient(self, where="board")

    def pins(self):
        """Volts at the ADC's pins 0 to 3."""
        outs = [self.dwf.fake_output(k, c) for k in range(2) for c in range(2)]
        return np.array([line.forward(v) for line, v in zip(self.wires.to_chip, outs)])

    def show(self, codes):
        """Let the DAC show four codes."""
        for k, (line, volts) in enumerate(zip(self.wires.from_chip, dac_volts(np.array(codes)))):
            self.dwf.fake_input(*divmod(k, 2), line.forward(volts))

    def send(self, data):
        tag, op, address, word = decode(data, SOF_REQUEST)
        register = next(r for r in MAP.registers if r.address == address)
        name = register.name
        if op == OP_WRITE:
            if name == "STATUS":
                self.words[name] &= ~word
            elif register.group == "config":
                self.shadow[name] = word
            elif name == "COMMAND" and word & 1:
                self.words |= self.shadow
                self._follow()
            elif name != "COMMAND":
                self.words[name] = word
        elif name in ("CODES_V", "CODES_T"):
            codes = np.clip(np.rint(self.pins() / 1e-3), 0, 4095).astype(int)
            low, high = codes[:2] if name == "CODES_V" else codes[2:]
            self.words[name] = int(low) | int(high) << 16
        self._answer = encode_answer(tag, 0, address, self.words[name])

    def _follow(self):
        """The motors rest: each output shows what its offset says."""
        codes = [2048 + round(word_float(self.words[f"DAC_{name.upper()}_OFFSET"])) for name in DAC_OUTPUTS]
        self.show(codes)
        self.words["CODES_L"] = codes[0] | codes[1] << 16
        self.words["CODES_R"] = codes[2] | codes[3] << 16

    def receive(self, count):
        assert count == FRAME_BYTES
        return self._answer

    def flush_input(self):
        self._answer = b""

    def close(self):
        self.closed = True
