"""The RTL behind the link interface: a simulator as a child process at the other end of a socket.

The simulator never outlives its link, and the link never waits for ever: every answer has a time limit, the child's
end is noticed at once (its socket closes with it), and what it last wrote to stderr is quoted in the one line that
the caller gets. Should the host itself die, the simulator sees the socket close and ends.
"""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import time
import weakref
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import find_libpython
import numpy as np

import rtds_host
from rtds_host.errors import InputError, LinkError
from rtds_host.link import protocol
from rtds_host.link.base import NONFINITE
from rtds_host.link.build import SIGNALS, build
from rtds_host.link.child import EXIT_GRACE_S, STDERR_CHARACTERS, Child
from rtds_host.link.configured import ConfiguredLink
from rtds_host.link.tops import ROOT, TOPS, Top
from rtds_host.link.waves import Recording, Waves, read_signals
from rtds_host.motor.effect_tables import EffectWords
from rtds_host.motor.parameters import Parameters, parameter_words

# Clocks a simulator works off in well under a second even on a busy machine: a longer exchange is put in several
# requests, so that the time limit of one answer says something about the simulator and not about the exchange.
REQUEST_CLOCKS = {"verilator": 2_000_000, "icarus": 50_000}
REQUEST_CLOCKS_WITH_WAVES = 50_000  # each of them is written
LEAST_CLOCKS = 27  # of a step, when it is started as soon as the core is ready
LEAST_CLOCKS_WITH_EFFECTS = 51
MAX_STEP_CLOCKS = 0xFFFF
SAMPLE_BYTES = 16  # of a row: two currents, two speeds
_EXIT_GRACE_WITH_WAVES_S = 60.0  # the last block of the file has to be compressed and written


def _to_stderr(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _period(step_clocks: int | str) -> int:
    if step_clocks == "min":
        return 0
    if isinstance(step_clocks, bool) or not isinstance(step_clocks, int) or not 1 <= step_clocks <= MAX_STEP_CLOCKS:
        raise InputError(f"step_clocks: {step_clocks!r} must be 'min' or a whole number from 1 to {MAX_STEP_CLOCKS}")
    return step_clocks


class RtlLink(ConfiguredLink):
    """The Verilog of both motor units in Verilator or Icarus, as a `Link`.

    Parameters
    ----------
    sim : "verilator" or "icarus".
    step_clocks : clocks from one step to the next: 500 as on the board, or "min": the next step starts as soon as the
        unit is ready. Idle clocks change no result, they only take time.
    timeout_s : longest wait for any one answer of the simulator, s.
    start_timeout_s : longest wait for its first sign of life, s.
    top : the simulation top, an entry of `rtds_host.link.tops.TOPS` or a `Top`.
    progress : called with a line when the simulator has to be built first (default: to stderr).
    every_clock : evaluate the idle clocks, too. Otherwise Verilator's main jumps them: states, clocks and results are
    the same.
    plain : Verilator's model as it comes: the RTL's own operators, one evaluation for all clocks. The results are the
        same, it takes three times as long. The environment's RTDS_PLAIN=1 asks for it, too.
    environment : more variables for the simulator's process.
    waves : write waveforms of the RTL (Verilator only). The file and its views are there when the link is closed; no
        result depends on it.

    Attributes
    ----------
    timeout_s : as given; may be changed while the link is open.
    pid : process id of the simulator (with effects another one from the time when it is told them).
    simulator : its name and version, as it says itself.
    clocks : clocks simulated so far, reset included.

    Raises
    ------
    InputError : an option is out of its range.
    LinkError : the simulator cannot be built or started.
    """

    def __init__(
        self,
        sim: str = "verilator",
        step_clocks: int | str = "min",
        timeout_s: float = 20.0,
        start_timeout_s: float = 60.0,
        top: str | Top = "core",
        progress: Callable[[str], None] | None = None,
        every_clock: bool = False,
        plain: bool = False,
        environment: Mapping[str, str] | None = None,
        waves: Waves | None = None,
    ) -> None:
        self.clocks = 0
        self._sim = sim
        self._step_clocks = _period(step_clocks)
        self.timeout_s = timeout_s
        self._steps = 0
        self._closed = False
        self._effects = False
        self._start_timeout_s = start_timeout_s
        self._progress = progress
        self._environment = {**({"RTDS_EVERY_CLOCK": "1"} if every_clock else {}), **(environment or {})}
        self._waves = waves
        self._recording: Recording | None = None
        wanted = TOPS[top] if isinstance(top, str) else top
        if waves is not None:
            wanted = wanted.traced
        self._start(wanted.plain if plain or os.environ.get("RTDS_PLAIN") == "1" else wanted)

    def _start(self, top: Top) -> None:
        """Build the top if need be, start it, take its greeting."""
        self._top = top
        built = build(top, self._sim, self._progress, watched_link)
        if self._waves is not None and self._recording is None:
            chosen = self._waves.chosen(read_signals(built.folder / SIGNALS))
            self._recording = recording = Recording(self._waves, chosen, self._progress or _to_stderr)
            self._close_recording = weakref.finalize(self, recording.close)
        self._child = Child(built, {**_environment(top), **self._environment})
        self._closed = False
        self.pid = self._child.pid
        try:
            self.simulator = self._greeting(self._answer(protocol.HELLO, self._start_timeout_s))
        except BaseException:
            self.close()
            raise

    def _greeting(self, payload: bytes) -> str:
        """The simulator's name, from what it says first."""
        try:
            hello = json.loads(payload)
        except (ValueError, RecursionError):
            hello = None
        if not isinstance(hello, dict) or "version" not in hello:
            raise self._failure("what it said first is not a greeting of the link")
        if hello["version"] != protocol.VERSION:
            raise self._failure(f"it speaks version {str(hello['version'])[:20]} of the link, not {protocol.VERSION}")
        return str(hello.get("simulator", "unmodelled"))

    def _load(self, words: EffectWords, values: Parameters, method: str) -> None:
        # The top that was started is without the effect unit, and faster; nothing has been exchanged with it yet.
        other = words.on and ("EFFECTS", 0) in self._top.parameters
        if self._recording is not None and not self._exchanged:
            # The window of the waveforms is one of steps, whose length is known now.
            self._environment.update(self._recording.environment(values[-1]))
        if other or (self._recording is not None and not self._exchanged):
            self._stop()
            self._start(replace(self._top, parameters=()) if other else self._top)
        if words.on:
            table = b"".join(protocol.EFFECT_WORD.pack(*pair) for pair in words.writes())
            self._check_length(self._ask(protocol.EFFECTS, table, protocol.DONE), 0)
        self._load_parameters(words, values, method)

    def _load_parameters(self, words: EffectWords, values: Parameters, method: str) -> None:
        (left, method_index), (right, _) = (parameter_words(side, method) for side in words.side_values(values))
        payload = protocol.PARAMETERS_PAYLOAD.pack(
            *left.view(np.uint32).tolist(), *right[:6].view(np.uint32).tolist(), method_index, self._step_clocks,
            words.on,
            words.own, words.delay, words.stride,
        )  # fmt: skip
        self._check_length(self._ask(protocol.PARAMETERS, payload, protocol.DONE), 0)
        self._effects = words.on

    def _run_steps(self, v: np.ndarray, t: np.ndarray, steps: int, every: int) -> np.ndarray:
        inputs = np.concatenate([v, t]).view(np.uint32).tolist()
        rows = [
            row if wanted else row[:0]
            for piece, sampled, wanted in self._pieces(steps, every)
            for row in (self._request(inputs, piece, sampled),)
        ]
        return np.concatenate(rows)

    def close(self) -> None:
        """See `Link.close`.

        Raises
        ------
        OutputError : waveforms cannot be put in their place.
        """
        said = self._stop()
        if self._recording is not None:
            recording, self._recording = self._recording, None
            try:
                if said is not None and self._exchanged:
                    recording.finish(said)
            finally:
                self._close_recording()

    def _stop(self) -> str | None:
        """End the simulator; what it wrote to standard error, or None where that is done already."""
        if self._closed:
            return None
        self._closed = True
        child = self._child
        if child.process.poll() is None:
            try:
                child.socket.settimeout(EXIT_GRACE_S)
                protocol.send_frame(child.socket, protocol.CLOSE)
                child.process.wait(EXIT_GRACE_S if self._recording is None else _EXIT_GRACE_WITH_WAVES_S)
            except (OSError, subprocess.TimeoutExpired):
                pass  # it does not leave by itself: it is killed
            finally:
                child.end()
        child.end()
        said = self.said()
        child.stderr.close()
        return said

    def said(self) -> str:
        """What the open simulator has written to its standard error so far."""
        return self._child.said()

    def _pieces(self, steps: int, sample_steps: int) -> list[tuple[int, int, bool]]:
        """An exchange as requests (steps, sample every, are the rows wanted), each small enough for one answer."""
        least = LEAST_CLOCKS_WITH_EFFECTS if self._effects else LEAST_CLOCKS
        clocks = REQUEST_CLOCKS[self._sim] if self._waves is None else REQUEST_CLOCKS_WITH_WAVES
        most = max(1, clocks // max(self._step_clocks, least))
        pieces = []
        done = 0
        while done < steps:
            to_sample = min(sample_steps, steps - done)
            if to_sample > most:  # not even one sample fits: the way to it in pieces, of which the last row counts
                while to_sample > most:
                    pieces.append((most, most, False))
                    to_sample -= most
                    done += most
                pieces.append((to_sample, to_sample, True))
                done += to_sample
            else:
                rows = min(protocol.MAX_SAMPLES, most // to_sample)
                piece = min(rows * sample_steps, steps - done)
                pieces.append((piece, sample_steps, True))
                done += piece
        return pieces

    def _request(self, inputs: list[int], steps: int, every: int) -> np.ndarray:
        """One request; (n, 4) float32 with columns i_l w_l i_r w_r."""
        payload = self._ask(protocol.EXCHANGE, protocol.EXCHANGE_PAYLOAD.pack(*inputs, steps, every), protocol.SAMPLES)
        self._check_length(payload, protocol.SAMPLES_HEAD.size, least=True)
        flags, step_count, clocks = protocol.SAMPLES_HEAD.unpack_from(payload)
        self._steps = (self._steps + steps) & 0xFFFFFFFF
        self.clocks = clocks
        if flags & protocol.FLAG_STUCK:
            raise self._failure("the core gave no ready or valid for thousands of clocks")
        if flags & protocol.FLAG_NONFINITE:
            raise LinkError(NONFINITE)
        if flags & protocol.FLAG_PARAM_FAULT:
            raise self._failure("the parameter unit refuses parameters that the host found usable")
        if flags & protocol.FLAG_OVERRUN or step_count != self._steps:
            raise self._failure(f"the core counted {step_count} steps where {self._steps} were asked for")
        rows = -(-steps // every)
        self._check_length(payload, protocol.SAMPLES_HEAD.size + SAMPLE_BYTES * rows, f"for {rows} rows of samples")
        return np.frombuffer(payload, np.dtype("<f4"), offset=protocol.SAMPLES_HEAD.size).reshape(-1, 4)

    def _check_length(self, payload: bytes, count: int, why: str = "", least: bool = False) -> None:
        if len(payload) < count or (len(payload) > count and not least):
            raise self._failure(
                f"its answer has {len(payload)} bytes, {'at least ' if least else ''}{count} are due"
                + (f" {why}" if why else "")
            )

    def _ask(self, kind: int, payload: bytes, expected: int) -> bytes:
        try:
            self._child.socket.settimeout(self.timeout_s)
            protocol.send_frame(self._child.socket, kind, payload)
        except TimeoutError as error:
            raise self._no_answer(self.timeout_s) from error
        except OSError as error:
            raise self._gone() from error
        return self._answer(expected, self.timeout_s)

    def _answer(self, expected: int, timeout_s: float) -> bytes:
        try:
            kind, payload = protocol.receive_frame(self._child.socket, protocol.Deadline(timeout_s, _Starved(self.pid)))
        except TimeoutError as error:
            raise self._no_answer(timeout_s) from error
        except (OSError, protocol.Closed) as error:
            raise self._gone() from error
        except (ValueError, struct.error) as error:
            raise self._failure(f"cannot make sense of the simulator's answer ({error})") from error
        if kind == protocol.FAILED:
            raise self._failure(" ".join(payload.decode(errors="replace").split())[:STDERR_CHARACTERS])
        if kind != expected:
            raise self._failure(f"the simulator answered with a frame of kind {kind} instead of {expected}")
        return payload

    def _no_answer(self, timeout_s: float) -> LinkError:
        return self._failure(f"no answer for {timeout_s:g} s; it has been ended")

    def _gone(self) -> LinkError:
        return self._failure(self._child.how_it_went())

    def _failure(self, what: str) -> LinkError:
        """End the simulator and put all there is to say into one line."""
        error = self._child.failure(self._sim, what)
        self._recording = None  # a file that was not finished is none
        self.close()
        return error


def watched_link(top: Top, step_clocks: int | str, environment: Mapping[str, str]) -> RtlLink:
    """The simulator that watches itself: an opener of `rtds_host.link.pinning`."""
    return RtlLink(step_clocks=step_clocks, top=top, environment=environment)


class _Starved:
    """How long a process has waited for a processor, s: on a busy machine a simulator is slow and not hung.

    The kernel adds a wait to its figure when it ends, so one that lasts is told by what did not change since the last
    look.
    """

    def __init__(self, pid: int):
        self._schedule, self._status = f"/proc/{pid}/schedstat", f"/proc/{pid}/stat"
        self._seen, self._since = (0, 0, 0), time.monotonic()

    @staticmethod
    def _read(path: str) -> bytes:
        # An exchange asks three times: not through layers that take longer than the exchange's own bytes.
        descriptor = os.open(path, os.O_RDONLY)
        try:
            return os.read(descriptor, 4096)
        finally:
            os.close(descriptor)

    def __call__(self) -> float:
        now = time.monotonic()
        try:
            ran, waited, slices = map(int, self._read(self._schedule).split())
            same = self._seen == (ran, waited, slices)
            waiting = same and self._read(self._status).rsplit(b")", 1)[1].split()[0] == b"R"
        except (OSError, ValueError, IndexError):
            return 0.0  # no such figures on this system
        if not waiting:
            self._seen, self._since = (ran, waited, slices), now
        return 1e-9 * waited + now - self._since


def _environment(top: Top) -> dict[str, str]:
    """Variables that cocotb needs in the simulator's process; none where the main serves the link itself."""
    if not top.bridge:
        return {}
    import cocotb_tools.config

    python = find_libpython.find_libpython()
    if python is None:
        raise LinkError("no shared libpython was found, cocotb needs one: apt-get install libpython3-dev")
    search = [str(ROOT / "sim"), str(Path(rtds_host.__file__).parents[1]), *(path for path in sys.path if path)]
    return {
        "GPI_USERS": f"{python};{cocotb_tools.config.pygpi_entry_point()}",
        "PYGPI_PYTHON_BIN": sys.executable,
        "PYTHONPATH": os.pathsep.join(search),
        "COCOTB_TOPLEVEL": top.module,
        "TOPLEVEL_LANG": "verilog",
        "COCOTB_TEST_MODULES": top.bridge,
        "COCOTB_TESTCASE": "",
        "COCOTB_TEST_FILTER": "",
        "COCOTB_RESULTS_FILE": os.devnull,
        "COCOTB_LOG_LEVEL": "ERROR",
        "GPI_LOG_LEVEL": "ERROR",
    }
