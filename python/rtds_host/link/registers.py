"""The chip's registers: their map, the serial protocol that reaches them, and a client.

The map is `registers.toml`, the one description from which the Verilog header and docs/registers.md are made too
(`rtds_host.link.register_files`). The protocol is that of rtl/io/serial_bridge.v: nine bytes a request, nine an
answer, each closed by a CRC-16/CCITT-FALSE. The client knows bytes only; what carries them is a transport:
`SerialTransport` for a board, anything with the same three methods for a simulation.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import resources
from typing import Protocol

from rtds_host.compat import tomllib
from rtds_host.errors import InputError, LinkError
from rtds_host.link.base import Closing

BAUD = 1_000_000
SOF_REQUEST = 0xA5
SOF_ANSWER = 0x5A
OP_READ = 1
OP_WRITE = 2
FRAME_BYTES = 9
STATUS_TEXT = {1: "operation unknown to the chip", 2: "the register is read-only", 3: "no such register in the chip"}
EFFECT_RUN = 128  # words of the effect unit between two looks at the address
EFFECT_ADDRESS_MASK = 0x3FFF
NO_ANSWER = "bus does not answer"
# Bytes passed over on the way to one answer: more is no noise before it but a line that does not stop talking.
NOISE_BYTES = 1024
SLICE_S = 0.02  # of waiting on a serial port, after which the time is looked at


# --- map ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Field:
    """One bit of a register of kind "bits"."""

    name: str
    bit: int
    text: str


@dataclass(frozen=True)
class Register:
    """One 32-bit register; `reset` is the value as a 32-bit word, whatever the kind."""

    name: str
    address: int
    access: str
    kind: str
    text: str
    group: str = ""
    unit: str = ""
    reset: int = 0
    fields: tuple[Field, ...] = ()

    def field(self, name: str) -> Field:
        """The field of that name. Raises InputError when there is none."""
        for candidate in self.fields:
            if candidate.name == name:
                return candidate
        raise InputError(f"register {self.name}: no field {name!r}, it has {', '.join(f.name for f in self.fields)}")

    def to_word(self, value: float) -> int:
        """A value as the 32-bit word on the bus. Raises InputError when it does not fit."""
        if self.kind == "float":
            return float_word(float(value), self.name)
        if value != int(value) or not 0 <= int(value) < 2**32:
            raise InputError(f"register {self.name}: {value!r} is not a 32-bit word")
        return int(value)

    def from_word(self, word: int) -> float | int:
        """The 32-bit word on the bus as float (kind "float") or int."""
        return word_float(word) if self.kind == "float" else word


@dataclass(frozen=True)
class RegisterMap:
    """All registers, in order of address."""

    identity: int
    version: tuple[int, int, int]
    registers: tuple[Register, ...]

    @property
    def version_word(self) -> int:
        """The version as register VERSION shows it."""
        major, minor, patch = self.version
        return major << 16 | minor << 8 | patch

    def named(self, name: str) -> Register:
        """The register of that name. Raises InputError when there is none."""
        for register in self.registers:
            if register.name == name:
                return register
        raise InputError(f"register {name!r} is unknown, see docs/registers.md")

    @property
    def config(self) -> tuple[Register, ...]:
        """The double-buffered group, in order of address."""
        return tuple(r for r in self.registers if r.group == "config")


def float_word(value: float, name: str = "value") -> int:
    """A number rounded to binary32, as its 32-bit word; infinities and NaN pass. Raises InputError on overflow."""
    try:
        return struct.unpack("<I", struct.pack("<f", value))[0]
    except OverflowError as error:
        raise InputError(f"register {name}: {value!r} is beyond single precision") from error


def word_float(word: int) -> float:
    """The binary32 number that a 32-bit word stands for."""
    return struct.unpack("<f", struct.pack("<I", word))[0]


def load_map() -> RegisterMap:
    """Read the map from the package.

    Raises
    ------
    InputError : two registers share an address or a name, or an entry is not one of the known kinds.
    """
    text = (resources.files("rtds_host.link") / "registers.toml").read_text(encoding="utf-8")
    data = tomllib.loads(text)
    registers = []
    for entry in data["register"]:
        fields = tuple(Field(**f) for f in entry.pop("fields", ()))
        reset = entry.pop("reset", 0)
        if entry["kind"] == "float":
            reset = float_word(float(reset), entry["name"])
        registers.append(Register(fields=fields, reset=reset, **entry))
    registers.sort(key=lambda r: r.address)
    names, addresses = set(), set()
    for register in registers:
        if register.name in names or register.address in addresses or not 0 <= register.address < 128:
            raise InputError(f"registers.toml: {register.name} repeats a name or an address, or is beyond 0x7F")
        if register.access not in ("ro", "rw", "wo", "w1c") or register.kind not in ("word", "bits", "float"):
            raise InputError(f"registers.toml: {register.name} has an unknown access or kind")
        names.add(register.name)
        addresses.add(register.address)
    config = [r.address for r in registers if r.group == "config"]
    if config != list(range(config[0], config[0] + len(config))):
        raise InputError("registers.toml: the config group has to be one run of addresses")
    major, minor, patch = data["map"]["version"]
    return RegisterMap(data["map"]["id"], (major, minor, patch), tuple(registers))


# --- protocol -----------------------------------------------------------------------------------------------------


def crc16(data: bytes) -> int:
    """CRC-16/CCITT-FALSE: polynomial 0x1021, start 0xFFFF, no reflection. `crc16(b"123456789") == 0x29B1`."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021) & 0xFFFF if crc & 0x8000 else crc << 1 & 0xFFFF
    return crc


def _frame(start: int, head: int, address: int, data: int) -> bytes:
    body = struct.pack("<BBBI", start, head, address, data)
    return body + struct.pack(">H", crc16(body))


def encode_request(tag: int, op: int, address: int, data: int = 0) -> bytes:
    """The nine bytes of a request: `tag` 0..15 comes back in the answer."""
    return _frame(SOF_REQUEST, (tag & 15) << 4 | op, address, data)


def encode_answer(tag: int, status: int, address: int, data: int) -> bytes:
    """The nine bytes of an answer (what the chip sends; for models of it)."""
    return _frame(SOF_ANSWER, (tag & 15) << 4 | status, address, data)


def decode(frame: bytes, start: int) -> tuple[int, int, int, int] | None:
    """(tag, op or status, address, data) of nine bytes, or None when start or CRC are not right."""
    if len(frame) != FRAME_BYTES or frame[0] != start or crc16(frame[:7]) != int.from_bytes(frame[7:], "big"):
        return None
    _, head, address, data = struct.unpack("<BBBI", frame[:7])
    return head >> 4, head & 15, address, data


# --- transports ---------------------------------------------------------------------------------------------------


class Transport(Protocol):
    """Carries bytes.

    The time for an answer begins with `send`. `receive` returns fewer bytes than asked for when it is over, however
    many came before: a line on which bytes trickle in has no more time than a silent one.
    """

    def send(self, data: bytes) -> None: ...

    def receive(self, count: int) -> bytes: ...

    def flush_input(self) -> None:
        """Forget what came in so far."""

    def close(self) -> None: ...


class SerialTransport:
    """A serial device, 8N1.

    Parameters
    ----------
    timeout_s : for the whole of an answer, from the end of `send` on; `write_timeout_s` for the sending of one request.

    Raises
    ------
    LinkError : the device cannot be opened, or is gone.
    """

    def __init__(self, device: str, baud: int = BAUD, timeout_s: float = 0.25, write_timeout_s: float = 2.0) -> None:
        import serial  # only a board needs it

        self._error, self._busy = serial.SerialException, serial.SerialTimeoutException
        self.device = device
        self._timeout_s = timeout_s
        self._until = 0.0
        try:
            self.port = serial.Serial(
                device, baudrate=baud, timeout=min(SLICE_S, timeout_s), write_timeout=write_timeout_s
            )
        except (serial.SerialException, OSError, ValueError) as error:
            raise LinkError(f"{device}: cannot open the serial port ({error})") from error

    def send(self, data: bytes) -> None:
        """Write all bytes; the time for the answer begins. Raises LinkError when the device takes none, or is gone."""
        try:
            self.port.write(data)
        except self._busy as error:
            raise LinkError(f"{self.device}: the serial port takes no bytes") from error
        except (self._error, OSError) as error:
            raise LinkError(f"{self.device}: the serial port is gone ({error})") from error
        self._until = time.monotonic() + self._timeout_s

    def receive(self, count: int) -> bytes:
        """Up to `count` bytes, fewer when the answer's time is over. Raises LinkError when the device is gone."""
        got = b""
        try:
            while len(got) < count and time.monotonic() < self._until:
                got += self.port.read(count - len(got))
        except (self._error, OSError) as error:
            raise LinkError(f"{self.device}: the serial port is gone ({error})") from error
        return got

    def flush_input(self) -> None:
        """Forget what came in so far. Raises LinkError when the device is gone."""
        try:
            self.port.reset_input_buffer()
        except (self._error, OSError) as error:
            raise LinkError(f"{self.device}: the serial port is gone ({error})") from error

    def close(self) -> None:
        """Close the device."""
        self.port.close()


# --- client -------------------------------------------------------------------------------------------------------


class RegisterClient(Closing):
    """Reads and writes registers by name.

    Parameters
    ----------
    transport : what carries the bytes; `where` names it in messages.
    attempts : how often a request is sent before the bus counts as dead; every operation may be repeated.
    """

    def __init__(self, transport: Transport, where: str = "chip", attempts: int = 3) -> None:
        self.map = load_map()
        self.where = where
        self._transport = transport
        self._attempts = attempts
        self._tag = 0

    def transfer(self, op: int, address: int, data: int = 0) -> int:
        """One request, repeated when its answer is missing or damaged; returns the answer's data word.

        It ends within `attempts` times what the transport grants an answer, whatever comes on the line.

        Raises
        ------
        LinkError : no answer after all attempts, or the chip refuses.
        """
        noise = 0
        for _ in range(self._attempts):
            self._tag = (self._tag + 1) & 15
            self._transport.flush_input()
            self._transport.send(encode_request(self._tag, op, address, data))
            answer, passed = self._receive_answer(self._tag, address)
            if answer is None:
                noise += passed
                continue
            if answer[1] != 0:
                text = STATUS_TEXT.get(answer[1], f"status {answer[1]}")
                raise LinkError(f"{self.where}: register address 0x{address:02X}: {text}")
            return answer[3]
        raise LinkError(
            f"{self.where}: {NO_ANSWER}"
            + (f" to what was asked; {noise} other bytes came on its line" if noise else "")
        )

    def _receive_answer(self, tag: int, address: int) -> tuple[tuple[int, int, int, int] | None, int]:
        """(answer with this tag and address or None, bytes that were none of it).

        Noise and answers to earlier requests are passed over. After a damaged answer nothing is waited for: it was this
        one.
        """
        got, passed = b"", 0
        while passed <= NOISE_BYTES:
            start = got.find(SOF_ANSWER)
            passed += start if start >= 0 else len(got)
            got = got[start:] if start >= 0 else b""
            if len(got) < FRAME_BYTES:
                asked = FRAME_BYTES - len(got)
                more = self._transport.receive(asked)
                got += more
                if len(more) < asked:
                    break
                continue
            answer = decode(got, SOF_ANSWER)
            if answer is not None and answer[0] == tag and answer[2] == address:
                return answer, passed
            if answer is None and SOF_ANSWER not in got[1:]:
                break
            # What looks like a start byte may be noise, so a damaged frame is searched on from its second byte.
            done = len(got) if answer is not None else 1
            passed, got = passed + done, got[done:]
        return None, passed + len(got)

    def read_word(self, name: str) -> int:
        """A register as its 32-bit word. Raises InputError (name), LinkError (bus)."""
        return self.transfer(OP_READ, self.map.named(name).address)

    def read(self, name: str) -> float | int:
        """A register as float or int, by its kind. Raises InputError (name), LinkError (bus)."""
        return self.map.named(name).from_word(self.read_word(name))

    def write(self, name: str, value: float) -> None:
        """Write a register. Raises InputError (name, value, read-only register), LinkError (bus)."""
        register = self.map.named(name)
        if register.access == "ro":
            raise InputError(f"register {name} is read-only")
        self.transfer(OP_WRITE, register.address, register.to_word(value))

    def flags(self, name: str) -> dict[str, bool]:
        """The fields of a register of bits."""
        word = self.read_word(name)
        return {f.name: bool(word >> f.bit & 1) for f in self.map.named(name).fields}

    def write_flags(self, name: str, **flags: bool) -> None:
        """Set or clear fields of a register of bits; the others keep their value (a write-only one starts at 0)."""
        register = self.map.named(name)
        word = 0 if register.access in ("wo", "w1c") else self.read_word(name)
        for key, on in flags.items():
            mask = 1 << register.field(key).bit
            word = word | mask if on else word & ~mask
        self.write(name, word)

    def identify(self) -> tuple[int, int, int]:
        """Check that this chip speaks this map; returns its version.

        Raises
        ------
        LinkError : no answer, another device, or a map with another major version.
        """
        identity = self.read_word("ID")
        if identity != self.map.identity:
            raise LinkError(f"{self.where}: not this chip (identity 0x{identity:08X}, not 0x{self.map.identity:08X})")
        word = self.read_word("VERSION")
        version = (word >> 16, word >> 8 & 255, word & 255)
        if version[0] != self.map.version[0]:
            raise LinkError(f"{self.where}: register map {version[0]}.x, this program speaks {self.map.version[0]}.x")
        return version

    def configure(self, values: dict[str, float | int]) -> None:
        """Write registers of the config group and commit them together: no step sees half of the set."""
        for name, value in values.items():
            if self.map.named(name).group != "config":
                raise InputError(f"register {name} is not in the config group")
            self.write(name, value)
        self.write_flags("COMMAND", commit=True)

    def load_effects(self, writes: Iterable[tuple[int, int]]) -> None:
        """Load words of the effect unit, (address, word), in runs of ascending addresses.

        A request that was repeated because its answer got lost may have been carried out twice: each run ends with a
        look at the address, and is written once more if that is not where it should be.

        Raises
        ------
        LinkError : no answer, or words do not arrive.
        """
        runs: list[tuple[int, list[int]]] = []
        for address, word in writes:
            if not runs or address != runs[-1][0] + len(runs[-1][1]) or len(runs[-1][1]) == EFFECT_RUN:
                runs.append((address, []))
            runs[-1][1].append(word)
        for start, words in runs:
            for _ in range(self._attempts):
                self.write("FX_ADDRESS", start)
                for word in words:
                    self.write("FX_DATA", word)
                if self.read_word("FX_ADDRESS") == (start + len(words)) & EFFECT_ADDRESS_MASK:
                    break
            else:
                raise LinkError(f"{self.where}: words for the effect unit do not arrive")

    def counters(self) -> tuple[int, int]:
        """(clocks since reset, steps since reset or clear) at one instant, 64 bits each."""
        low = self.read_word("CYCLES_LO")  # freezes the other three
        cycles = self.read_word("CYCLES_HI") << 32 | low
        steps = self.read_word("STEPS_HI") << 32 | self.read_word("STEPS_LO")
        return cycles, steps

    def take_status(self) -> dict[str, bool]:
        """The sticky flags, and clear those that were read as set (later events stay)."""
        word = self.read_word("STATUS")
        if word:
            self.write("STATUS", word)
        return {f.name: bool(word >> f.bit & 1) for f in self.map.named("STATUS").fields}

    def close(self) -> None:
        """Close the transport."""
        self._transport.close()


def open_serial(device: str, baud: int = BAUD, timeout_s: float = 0.25) -> RegisterClient:
    """A client on a serial device, its chip identified.

    Raises
    ------
    LinkError : the device cannot be opened, does not answer, or is not this chip.
    """
    client = RegisterClient(SerialTransport(device, baud, timeout_s), where=device)
    try:
        client.identify()
    except LinkError:
        client.close()
        raise
    return client
