"""What host and simulator say to each other over the socket; imported by both.

Every message is a frame: kind and length (two little-endian uint32), then so many bytes. The host asks, the
simulator answers each request with one frame. All numbers are little-endian; words are binary32 patterns.

=============  ==================================================  ==========================================
request        payload                                             answer
=============  ==================================================  ==========================================
(start)        none: the simulator speaks first                    HELLO: JSON {version, top, simulator}
PARAMETERS     7 words R L Km Kb J B h, 6 words R L Km Kb J B of   DONE: empty
               the right motor, method, step_clocks, effects on,
               right motor's own, delay, stride
EFFECTS        n times address, word of the effect unit            DONE: empty
EXCHANGE       4 words v_l v_r t_l t_r, steps, sample_steps        SAMPLES: flags, step count, simulated clocks
                                                                   (uint64), then n times i_l w_l i_r w_r
CHIP_RUN       the chip's harness only: 8 voltages (float64, V)    CHIP_RAN: flags, LDAC edges so far, time in ps
               at the ADC's pins, steps, sample_steps, bytes       and clocks of 50 MHz (uint64), m, n, then the m
               expected on the serial line, clocks (0 idle ones    bytes that came on the serial line, then n times
               left out, 1 all, 2 as 0 with effects), limit in     four uint16 codes of the DAC, A to D
               ns (uint64), then bytes to send on that line
CLOSE          empty                                               none, the simulator ends
=============  ==================================================  ==========================================

Instead of its answer the simulator may send FAILED with a line of text.
"""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Callable

VERSION = 2
FD_VARIABLE = "RTDS_LINK_FD"

HELLO, PARAMETERS, DONE, EXCHANGE, SAMPLES, CLOSE, FAILED, CHIP_RUN, CHIP_RAN, EFFECTS = range(1, 11)

HEADER = struct.Struct("<II")
PARAMETERS_PAYLOAD = struct.Struct("<7I6I6I")
EFFECT_WORD = struct.Struct("<II")
EXCHANGE_PAYLOAD = struct.Struct("<4III")
SAMPLES_HEAD = struct.Struct("<IIQ")
CHIP_RUN_HEAD = struct.Struct("<8d4IQ")
CHIP_RAN_HEAD = struct.Struct("<IIQQII")

FLAG_PARAM_FAULT, FLAG_NONFINITE, FLAG_OVERRUN, FLAG_STUCK = 1, 2, 4, 8
CHIP_FLAG_TIMEOUT, CHIP_FLAG_RESET = 1, 2

MAX_SAMPLES = 32  # rows the simulation top keeps for one request
MAX_PAYLOAD = 1 << 20
LOOK_S = 0.25  # of waiting, after which the time limit is looked at


class Closed(Exception):
    """The other side has closed the socket."""


def send_frame(sock: socket.socket, kind: int, payload: bytes = b"") -> None:
    """Send one frame. Raises OSError as `socket.sendall` does."""
    sock.sendall(HEADER.pack(kind, len(payload)) + payload)


class Deadline:
    """A time limit in which only that time counts in which the other side could have worked.

    Parameters
    ----------
    starved_s : how long it has waited for a processor so far, s.
    """

    def __init__(self, timeout_s: float, starved_s: Callable[[], float] = lambda: 0.0):
        self._starved_s = starved_s
        self._until = time.monotonic() + timeout_s - starved_s()

    def rest_s(self) -> float:
        """What is left of the time, s."""
        return self._until + self._starved_s() - time.monotonic()


def _receive_exactly(sock: socket.socket, count: int, deadline: Deadline | None) -> bytes:
    parts, left = [], count
    while left:
        rest_s = None if deadline is None else deadline.rest_s()
        if rest_s is not None:
            # What has come by the end of the time is still taken: it may be this side that got no processor.
            sock.settimeout(min(max(rest_s, 0.0), LOOK_S))
        try:
            part = sock.recv(left)
        except (TimeoutError, BlockingIOError) as error:
            if rest_s is None or rest_s <= 0.0:
                raise TimeoutError from error
            continue
        if not part:
            raise Closed
        parts.append(part)
        left -= len(part)
    return parts[0] if len(parts) == 1 else b"".join(parts)


def receive_frame(sock: socket.socket, deadline: Deadline | None = None) -> tuple[int, bytes]:
    """Receive one frame as (kind, payload).

    Parameters
    ----------
    deadline : for the whole frame, however its bytes come; without it as the socket says for each piece.

    Raises
    ------
    Closed : the other side is gone.
    ValueError : the frame is longer than any of ours.
    OSError : as `socket.recv`; TimeoutError after the time.
    """
    kind, length = HEADER.unpack(_receive_exactly(sock, HEADER.size, deadline))
    if length > MAX_PAYLOAD:
        raise ValueError(f"frame of {length} bytes announced")
    return kind, _receive_exactly(sock, length, deadline) if length else b""
