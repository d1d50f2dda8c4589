"""What the bridges of all simulation tops share: the socket, the order of requests, reading ports.

A bridge for a further top subclasses `Bridge`, fills `handlers` and implements `reset`; its module stands in the
top's entry in `rtds_host.link.tops.TOPS`.
"""

from __future__ import annotations

import json
import os
import socket
import struct
from collections.abc import Awaitable, Callable
from typing import ClassVar

import cocotb
from cocotb.simtime import get_sim_time

from rtds_host.link import protocol


class Refused(Exception):
    """A request cannot be carried out; the text goes to the host."""


def word(port) -> int:
    """A port as an unsigned integer; refuses unknown bits with the port's name."""
    value = port.value
    if not value.is_resolvable:
        raise Refused(f"{port._name} carries unknown bits: {value}")
    return int(value)


def low_bits(port, count: int) -> int:
    """The lowest `count` bits of a wide port as an unsigned integer; refuses unknown bits.

    Bits above may be unknown: they have not been written yet.
    """
    text = str(port.value)[-count:]
    try:
        return int(text, 2)
    except ValueError as error:
        raise Refused(f"{port._name} carries unknown bits in its lowest {count}") from error


def now_ps() -> int:
    """Simulated time in ps."""
    return int(get_sim_time("ps"))


class Bridge:
    """Serves one host over the socket whose descriptor stands in the environment."""

    handlers: ClassVar[dict[int, Callable[[Bridge, bytes], Awaitable[tuple[int, bytes]]]]] = {}

    def __init__(self, dut) -> None:
        self.dut = dut
        self.socket = socket.socket(fileno=int(os.environ[protocol.FD_VARIABLE]))

    async def reset(self) -> None:
        """Bring the top into its start state."""
        raise NotImplementedError

    async def serve(self) -> None:
        """Reset, greet, then answer requests until the host says CLOSE or is gone."""
        await self.reset()
        hello = {
            "version": protocol.VERSION,
            "top": self.dut._name,
            "simulator": f"{cocotb.SIM_NAME} {cocotb.SIM_VERSION}",
        }
        try:
            protocol.send_frame(self.socket, protocol.HELLO, json.dumps(hello).encode())
            while True:
                kind, payload = protocol.receive_frame(self.socket)
                if kind == protocol.CLOSE:
                    return
                try:
                    if kind not in self.handlers:
                        raise Refused(f"request of unknown kind {kind}")
                    answer = await self.handlers[kind](self, payload)
                except Refused as refusal:
                    answer = protocol.FAILED, str(refusal).encode()
                except struct.error as error:
                    answer = protocol.FAILED, f"request of kind {kind} of the wrong length ({error})".encode()
                protocol.send_frame(self.socket, *answer)
        except (protocol.Closed, BrokenPipeError, ConnectionResetError):
            return  # the host is gone: so are we
        finally:
            self.socket.close()
