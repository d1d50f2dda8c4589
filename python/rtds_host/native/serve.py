"""Motors on a socket, for simulators in other languages.

Every message is a frame: kind and length (two little-endian uint32), then so many bytes. The server speaks first, then
answers each request with one frame. Numbers are little-endian.

=============  ==================================================  ============================================
request        payload                                             answer
=============  ==================================================  ============================================
(start)        none                                                HELLO: version (uint32), step in s (float64)
PARAMETERS     R L Km Kb J B step (float64), method (uint32)       DONE: empty
EXCHANGE       v_l v_r t_l t_r (float32), steps, every (uint32)    SAMPLES: n times i_l w_l i_r w_r (float32)
CLOSE          empty                                               none, the connection ends
=============  ==================================================  ============================================

Instead of its answer the server may send FAILED with a line of text; the connection stays open. A connection is a run:
its motors start at rest.
"""

from __future__ import annotations

import contextlib
import socket
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from rtds_host.errors import InputError, OutputError, RtdsError, said_of_file
from rtds_host.link import Link
from rtds_host.link.protocol import CLOSE, DONE, EXCHANGE, FAILED, HEADER, HELLO, PARAMETERS, SAMPLES
from rtds_host.motor.parameters import METHODS
from rtds_host.native.words import MotorUnits

VERSION = 1
HELLO_PAYLOAD = struct.Struct("<Id")
PARAMETERS_PAYLOAD = struct.Struct("<7dI")
EXCHANGE_PAYLOAD = struct.Struct("<4fII")
MAX_REQUEST = 4096
MAX_SAMPLES = 1 << 20
HOST = "127.0.0.1"


@contextlib.contextmanager
def listener(path: Path | None, port: int | None) -> Iterator[tuple[socket.socket, str]]:
    """A listening socket and where it is: a Unix socket `path`, removed at the end, or a TCP `port` of this computer.

    Raises
    ------
    OutputError : something is there already, or the system refuses.
    """
    family = socket.AF_INET if path is None else socket.AF_UNIX
    with socket.socket(family, socket.SOCK_STREAM) as listening:
        try:
            if path is None:
                listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                listening.bind((HOST, port))
                place = f"{HOST}:{listening.getsockname()[1]}"
            else:
                listening.bind(str(path))
                place = str(path)
            listening.listen(1)
        except (OSError, ValueError) as error:
            where = path if path is not None else f"{HOST}:{port}"
            why = said_of_file(error) if isinstance(error, OSError) else str(error)
            raise OutputError(f"{where}: {why}") from error
        try:
            yield listening, place
        finally:
            if path is not None:
                path.unlink(missing_ok=True)


def serve_runs(listening: socket.socket, open_it: Callable[[], Link], units: MotorUnits, runs: int = 0) -> None:
    """Serve one connection after the other, each with a link of its own; `runs` of them, or without end.

    Raises
    ------
    LinkError : the link cannot be opened. InputError : it cannot hold the motors.
    """
    served = 0
    while runs == 0 or served < runs:
        connection, _ = listening.accept()
        with connection, open_it() as link:
            if connection.family == socket.AF_INET:
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            link.set_effects(*units.effects)
            link.set_parameters(*units.parameters)
            with contextlib.suppress(ConnectionError, _Ended):
                _send(connection, HELLO, HELLO_PAYLOAD.pack(VERSION, link.step_s))
                _serve(connection, link)
        served += 1


class _Ended(Exception):
    """The client has closed the connection, or sends what is no frame."""


def _serve(connection: socket.socket, link: Link) -> None:
    while True:
        kind, length = HEADER.unpack(_receive(connection, HEADER.size))
        if length > MAX_REQUEST:
            _send(connection, FAILED, f"a request of {length} bytes, at most {MAX_REQUEST} are taken".encode())
            raise _Ended
        payload = _receive(connection, length)
        if kind == CLOSE:
            return
        try:
            answer = _answer(link, kind, payload)
        except RtdsError as error:
            answer = FAILED, str(error).encode()
        _send(connection, *answer)


def _answer(link: Link, kind: int, payload: bytes) -> tuple[int, bytes]:
    if kind == EXCHANGE:
        *inputs, steps, every = _unpack(EXCHANGE_PAYLOAD, "EXCHANGE", payload)
        if steps < 1 or every < 1 or -(-steps // every) > MAX_SAMPLES:
            raise InputError(f"EXCHANGE: {steps} steps, a sample every {every}: 1 to {MAX_SAMPLES} samples are taken")
        got = link.exchange(inputs[:2], inputs[2:], steps * link.step_s, min(every, steps) * link.step_s)
        rows = np.empty((len(got.t_s), 4), "<f4")
        rows[:, 0::2], rows[:, 1::2] = got.currents, got.speeds
        return SAMPLES, rows.tobytes()
    if kind == PARAMETERS:
        r, l, km, kb, j, b, step_s, method = _unpack(PARAMETERS_PAYLOAD, "PARAMETERS", payload)
        if method >= len(METHODS):
            raise InputError(f"PARAMETERS: method {method}: 0 and 1 are known")
        link.set_parameters(r, l, km, kb, j, b, step_s, METHODS[method])
        return DONE, b""
    raise InputError(f"a request of kind {kind} is unknown")


def _unpack(layout: struct.Struct, name: str, payload: bytes) -> tuple:
    if len(payload) != layout.size:
        raise InputError(f"{name}: {layout.size} bytes are needed, got {len(payload)}")
    return layout.unpack(payload)


def _send(connection: socket.socket, kind: int, payload: bytes) -> None:
    connection.sendall(HEADER.pack(kind, len(payload)) + payload)


def _receive(connection: socket.socket, count: int) -> bytes:
    data = bytearray()
    while len(data) < count:
        part = connection.recv(count - len(data))
        if not part:
            raise _Ended
        data += part
    return bytes(data)
