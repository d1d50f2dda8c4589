"""The motor units behind the bridge of the board's own processor (`rtds_hps`), as a `Link`.

`HpsLink` writes and reads registers; what carries them is a bus: `MemoryBus` on the board (the bridge's addresses in
``/dev/mem``), `SimulatedBus` anywhere (the RTL in Verilator, every access an AXI transaction). The registers' addresses
are read from ``rtl/hps/rtds_hps.v``, which says them once. **On a board this was never run.**
"""

from __future__ import annotations

import mmap
import os
import re
import struct
import time
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from rtds_host.errors import InputError, LinkError
from rtds_host.link.base import NONFINITE
from rtds_host.link.build import build
from rtds_host.link.child import Child
from rtds_host.link.configured import ConfiguredLink
from rtds_host.link.tops import ROOT, TOPS
from rtds_host.motor.effect_tables import EffectWords
from rtds_host.motor.parameters import Parameters, parameter_words

SOURCE = "rtl/hps/rtds_hps.v"
BASE = 0xFF20_0000  # of the lightweight bridge in the ARM's addresses (Cyclone V HPS technical reference manual)
SIZE = 0x1000
IDENTITY, VERSION = 0x5254_4453, 1
CLOCK_HZ = 50_000_000
BUSY, FX_BUSY, STUCK, OVERRUN, FAULT_NONFINITE, PARAM_FAULT = (1 << bit for bit in range(6))
MAX_SAMPLES = 32
REQUEST_STEPS = 50_000  # half a second of real time: then an answer's time limit says something about the board
READ, WRITE, PASS, UNTIL_ZERO = range(4)
RESPONSES = {2: "refused (SLVERR)", 3: "nothing there (DECERR)"}


def addresses() -> dict[str, int]:
    """Byte addresses of the registers by name, from the Verilog that says them.

    Raises
    ------
    LinkError : the source tree is not there.
    """
    try:
        text = (ROOT / SOURCE).read_text()
    except OSError as error:
        raise LinkError(
            f"{ROOT / SOURCE}: cannot read ({error.strerror}); the hps link needs the source tree"
        ) from error
    return {name: int(at, 16) for name, at in re.findall(r"localparam \[11:0\] R_(\w+) = 12'h([0-9A-F]+);", text)}


class Bus(Protocol):
    """Registers of 32 bits at byte addresses."""

    def run(self, orders: Sequence[tuple[int, int, int]]) -> list[int]:
        """Carry out {operation, address, data} in order; the words read, 0 for the others.

        Raises
        ------
        LinkError : an access was refused, or nothing answers.
        """

    def close(self) -> None:
        """Let go of it."""


class MemoryBus:
    """The bridge on the board, through ``/dev/mem``; needs to be root and an enabled bridge.

    Parameters
    ----------
    path : the memory device. base : of the bridge. timeout_s : longest wait for a register's bits, s.

    Raises
    ------
    LinkError : the device cannot be opened or mapped.
    """

    def __init__(self, path: str = "/dev/mem", base: int = BASE, timeout_s: float = 5.0) -> None:
        self.timeout_s = timeout_s
        self._path = path
        try:
            descriptor = os.open(path, os.O_RDWR | os.O_SYNC)
        except OSError as error:
            raise LinkError(f"{path}: cannot open ({error.strerror}); link hps runs as root on the board") from error
        try:
            self._memory = mmap.mmap(descriptor, SIZE, offset=base)
        except (OSError, ValueError) as error:
            raise LinkError(f"{path}: cannot map the bridge at {base:#x} ({error})") from error
        finally:
            os.close(descriptor)
        # One access of 32 bits each: slices of bytes would be copied in any size.
        self._words = memoryview(self._memory).cast("I")

    def run(self, orders: Sequence[tuple[int, int, int]]) -> list[int]:
        """See `Bus.run`."""
        words, found = self._words, []
        for operation, address, data in orders:
            at = address >> 2
            if operation == WRITE:
                words[at] = data
                found.append(0)
            elif operation == READ:
                found.append(words[at])
            elif operation == UNTIL_ZERO:
                deadline = time.monotonic() + self.timeout_s
                while (word := words[at]) & data:
                    if time.monotonic() > deadline:
                        raise LinkError(f"{self._path}: register {address:#x} kept {word:#x} for {self.timeout_s:g} s")
                found.append(word)
            else:
                raise ValueError("time cannot be let pass on a board")
        return found

    def close(self) -> None:
        """See `Bus.close`."""
        self._words.release()
        self._memory.close()


class SimulatedBus:
    """The RTL of `rtds_hps` in Verilator as a child process; every order is an AXI transaction.

    Parameters
    ----------
    timeout_s : longest wait for an answer, s.
    environment : more variables for the simulator, such as RTDS_HPS_STALLS (a master that is late now and then).

    Attributes
    ----------
    reads, writes, clocks : transactions so far, and the clocks they took in all.

    Raises
    ------
    LinkError : it cannot be built or started.
    """

    def __init__(self, timeout_s: float = 60.0, environment: Mapping[str, str] | None = None) -> None:
        self.timeout_s = timeout_s
        self.reads = self.writes = self.clocks = 0
        self._child = Child(build(TOPS["hps"], "verilator"), environment or {})
        self._child.socket.settimeout(timeout_s)
        self.pid = self._child.pid

    def run(self, orders: Sequence[tuple[int, int, int]]) -> list[int]:
        """See `Bus.run`."""
        flat = [word for order in orders for word in order]
        try:
            self._child.socket.sendall(struct.pack(f"<I{len(flat)}I", len(orders), *flat))
            payload = self._receive(12 * len(orders))
        except TimeoutError as error:
            raise self._child.failure("hps", f"no answer for {self.timeout_s:g} s; it has been ended") from error
        except OSError as error:
            raise self._gone() from error
        found = []
        for (operation, address, _), (response, data, clocks) in zip(
            orders, struct.iter_unpack("<3I", payload), strict=True
        ):
            self.clocks += clocks
            self.writes += operation == WRITE
            self.reads += operation == READ
            if response:
                what = "write to" if operation == WRITE else "read of"
                raise LinkError(f"hps bus: {what} {address:#05x} was {RESPONSES.get(response, 'answered oddly')}")
            found.append(data)
        return found

    def _receive(self, count: int) -> bytes:
        parts = []
        while count:
            part = self._child.socket.recv(count)
            if not part:
                raise self._gone()
            parts.append(part)
            count -= len(part)
        return b"".join(parts)

    def _gone(self) -> LinkError:
        return self._child.failure("hps", self._child.how_it_went())

    def close(self) -> None:
        """See `Bus.close`."""
        self._child.end()


class HpsLink(ConfiguredLink):
    """The motor units behind the bridge, as a `Link`.

    Parameters
    ----------
    bus : where the registers are; default: the board's own (`MemoryBus`).
    step_clocks : clocks of 20 ns from step to step: 500 is real time at 10 µs, "min" as fast as the core can. It is
        derived from the step where it is None.

    Attributes
    ----------
    late_clocks : clocks by which strobes came later than their period, so far: 0 is real time kept.

    Raises
    ------
    LinkError : what answers is not this design, or nothing does.
    """

    def __init__(self, bus: Bus | None = None, step_clocks: int | str | None = None) -> None:
        if step_clocks not in (None, "min") and not (isinstance(step_clocks, int) and 1 <= step_clocks <= 0xFFFF):
            raise InputError(f"step_clocks: {step_clocks!r} must be 'min' or a whole number from 1 to 65535")
        self.offsets = addresses()
        self._step_clocks = step_clocks
        self._steps = 0
        self.delayed_clocks = 0
        self._late = 0
        self.bus: Bus = MemoryBus() if bus is None else bus
        try:
            identity, version = self._read("IDENTITY", "VERSION")
            if identity != IDENTITY or version != VERSION:
                raise LinkError(
                    f"the bridge answers {identity:#010x}, version {version}, not {IDENTITY:#010x}, version {VERSION}: "
                    "another design is in the FPGA"
                )
            self._write(("CLEAR", 0))
        except BaseException:
            self.close()
            raise

    def _read(self, *names: str) -> list[int]:
        return self.bus.run([(READ, self.offsets[name], 0) for name in names])

    def _write(self, *pairs: tuple[str, int]) -> None:
        self.bus.run([(WRITE, self.offsets[name], value) for name, value in pairs])

    def _load(self, words: EffectWords, values: Parameters, method: str) -> None:
        if words.on:
            orders: list[tuple[int, int, int]] = []
            for address, data in words.writes():
                orders += [(WRITE, self.offsets["FX_ADDRESS"], address), (WRITE, self.offsets["FX_DATA"], data)]
            self.bus.run(orders)
        self._load_parameters(words, values, method)

    def _load_parameters(self, words: EffectWords, values: Parameters, method: str) -> None:
        (left, index), (right, _) = (parameter_words(side, method) for side in words.side_values(values))
        left_words, right_words = left.view(np.uint32).tolist(), right.view(np.uint32).tolist()
        switches = index | words.on << 1 | words.own << 2 | words.delay << 4 | words.stride << 16
        period = self._step_clocks
        if period is None:
            clocks = round(values[6] * CLOCK_HZ)
        else:
            clocks = 0 if period == "min" else int(period)
        orders = [
            (WRITE, self.offsets[name], value)
            for name, value in (
                ("SWITCHES", switches),
                ("H", left_words[6]),
                ("STEP_CLOCKS", clocks),
            )
        ]
        for name, side in (("MOTOR_L", left_words), ("MOTOR_R", right_words)):
            orders += [(WRITE, self.offsets[name] + 4 * k, side[k]) for k in range(6)]
        self.bus.run(orders)

    def _check_step(self, step_s: float) -> None:
        if self._step_clocks is None and not 1 <= round(step_s * CLOCK_HZ) <= 0xFFFF:
            raise InputError(f"step_s: {step_s:g} s is not between one and 65535 clocks of 20 ns, as real time needs")

    def _run_steps(self, v: np.ndarray, t: np.ndarray, steps: int, every: int) -> np.ndarray:
        words = np.concatenate([v, t]).view(np.uint32).tolist()
        orders = [(WRITE, self.offsets["INPUTS"] + 4 * k, word) for k, word in enumerate(words)]
        rows: list[np.ndarray] = []
        done = 0
        while done < steps:
            piece, sampled = self._piece(done, steps, every)
            found = self._request(orders, piece, min(every, piece))
            orders = []
            done += piece
            if sampled:
                rows.append(found)
        return np.concatenate(rows)

    @staticmethod
    def _piece(done: int, steps: int, every: int) -> tuple[int, bool]:
        """Steps of the next request, and whether its samples are wanted."""
        to_sample = min(every - done % every, steps - done)
        if to_sample > REQUEST_STEPS:
            return REQUEST_STEPS, False
        if done % every or every > REQUEST_STEPS:
            return to_sample, True
        return min(every * max(1, min(MAX_SAMPLES, REQUEST_STEPS // every)), steps - done), True

    def _request(self, orders: list[tuple[int, int, int]], steps: int, every: int) -> np.ndarray:
        """One request; (n, 4) float32 with columns i_l w_l i_r w_r."""
        rows = -(-steps // every)
        at = self.offsets
        begin = [
            *orders,
            (WRITE, at["SAMPLE_STEPS"], every),
            (WRITE, at["GO"], steps),
            (UNTIL_ZERO, at["STATUS"], BUSY),
        ]
        ends = [(READ, at[name], 0) for name in ("STEP_COUNT", "COUNT", "LATE")]
        samples = [(READ, at["SAMPLES"] + 4 * k, 0) for k in range(4 * rows)]
        found = self.bus.run([*begin, *ends, *samples])[len(begin) - 1 :]
        status, counted, kept, late = found[:4]
        self._steps = (self._steps + steps) & 0xFFFF_FFFF
        self.delayed_clocks += (late - self._late) & 0xFFFF_FFFF
        self._late = late
        if status & STUCK:
            raise LinkError("hps: the core gave no ready or valid for thousands of clocks")
        if status & FAULT_NONFINITE:
            raise LinkError(NONFINITE)
        if status & PARAM_FAULT:
            raise LinkError("hps: the parameter unit refuses parameters that the host found usable")
        if status & OVERRUN or counted != self._steps or kept != rows:
            raise LinkError(f"hps: the core counted {counted} steps and {kept} samples, not {self._steps} and {rows}")
        return np.array(found[4:], np.uint32).view(np.float32).reshape(-1, 4)

    def report(self) -> dict[str, object]:
        """What the link has to say about itself: strobes counted, and by how much they were late, s."""
        return {"steps": self._steps, "lateness_s": self.delayed_clocks / CLOCK_HZ}

    def close(self) -> None:
        """See `Link.close`."""
        if not self._closed:
            self._closed = True
            self.bus.close()
