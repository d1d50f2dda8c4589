"""The whole chip, driven through its pins: a Verilator simulation of `rtds_chip` with its converters around it.

    voltages, torques -> volts -> wires -> LTC2308 -> chip -> DAC7624 -> wires -> volts -> currents, speeds

The simulation (sim/chip_main.cpp) knows volts at the ADC, codes of the DAC and bytes of the serial line, nothing else.
R, L, the step and the rest go through the serial protocol of the registers, as on a board. Simulated time stands still
between two exchanges, and an exchange ends with an LDAC edge, before the chip samples the next voltages: so the only
differences to the ideal link are those of the converters and wires. The chip's sticky status is read while each
exchange runs.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from rtds_host.errors import InputError, LinkError
from rtds_host.link import protocol
from rtds_host.link.analog import ADC_VOLTS_PER_STEP, Front, Paths, dac_volts
from rtds_host.link.registers import (
    FRAME_BYTES,
    OP_READ,
    OP_WRITE,
    SOF_ANSWER,
    RegisterClient,
    decode,
    encode_request,
    float_word,
    load_map,
)
from rtds_host.link.rtl import RtlLink
from rtds_host.link.scaling import ADC_CHANNELS, SIGNED_CHANNELS, Scaling, default_scaling
from rtds_host.motor.effect_tables import EffectWords
from rtds_host.motor.parameters import Parameters, parameter_words

STEP_NS = 10_000  # one ADC sequence, one step
BOARD_CLOCKS = 500  # of 50 MHz, a step
PARAMETER_SOURCES = ("registers", "adc")
PARAMETER_CHANNELS = ADC_CHANNELS[SIGNED_CHANNELS:]

# Of STATUS: a run with one of these is not what it says it is. The rest are ranges that cut, kept in `clipped`.
FATAL = ("overrun", "nonfinite", "adc_silent", "lock_lost", "param_fault", "dropped")
SATURATED = "sat_"
_STATUS_STEPS = 40  # steps within which a register is read over the serial line, twice over
_SERIAL_LIMIT_NS = 2_000_000
_READ_ALL = 8  # steps after which all converters have settled, both parameters and inputs
# A change of resistances on the serial line, at whose rate a byte takes one step: a request and its answer have nine
# bytes each, so the next request begins after so many bytes that the chip passes over.
_PAUSE_BYTES = 12
_IDLE_BYTE = b"\xff"
_CHANGED = ("R", "R_R")
_COMMIT_BYTES = (len(_CHANGED) + 1) * FRAME_BYTES + len(_CHANGED) * _PAUSE_BYTES


def parameter_registers(words: np.ndarray, method: int, source: str = "registers") -> dict[str, float | int]:
    """The chip's configuration for a parameter set: voltages and torques from the ADC.

    Parameters
    ----------
    words : (7,) float32 as `rtds_host.motor.parameters.parameter_words` gives them. method : 0 or 1.
    source : where B, J, Km and Kb come from, of `PARAMETER_SOURCES`. R, L and the step are registers always.
    """
    r, l, km, kb, j, b, h = (float(word) for word in words)
    config = load_map().named("CONFIG")
    bits = {"method": bool(method), "v_from_adc": True, "t_from_adc": True}
    bits |= {f"{name}_from_adc": source == "adc" for name in PARAMETER_CHANNELS}
    word = sum(1 << config.field(name).bit for name, on in bits.items() if on)
    return {"R": r, "L": l, "KM": km, "KB": kb, "J": j, "B": b, "H": h, "CONFIG": word}


def effect_registers(words: EffectWords, right: np.ndarray) -> dict[str, float | int]:
    """The chip's configuration for effects: the right motor's own (7,) parameters, switches and delay."""
    config = load_map().named("EFFECTS")
    on = {"on": words.on, "own": words.own}
    bits = sum(1 << config.field(name).bit for name, wanted in on.items() if wanted)
    names = ("R_R", "L_R", "KM_R", "KB_R", "J_R", "B_R")
    values = dict(zip(names, map(float, right), strict=False))
    return values | {"EFFECTS": bits, "DELAY": words.stride << 16 | words.delay}


def check_status(status: dict[str, bool], where: str) -> set[str]:
    """The outputs that the DAC's range cut, from the sticky flags.

    Raises
    ------
    LinkError : a flag says that the steps since the last look are not to be trusted.
    """
    bad = [name for name in FATAL if status.get(name)]
    if bad:
        texts = {field.name: field.text for field in load_map().named("STATUS").fields}
        raise LinkError(f"{where}: status {bad[0]}: {texts[bad[0]]}")
    return {name.removeprefix(SATURATED) for name, on in status.items() if on and name.startswith(SATURATED)}


class ChipLink(RtlLink):
    """`rtds_chip` between its pins, as a `Link`.

    Parameters
    ----------
    step_clocks : 500 simulates every clock of 50 MHz, "min" leaves out those in which nothing is in hand, which changes
    no
        code (the 40 MHz clock of the ADC always runs).
    calibration : of the wires, used for what is sent and read; ideal wires without it.
    wires : what the simulated wires really are; ideal without it.
    parameters : where the chip takes B, J, Km and Kb from, of `PARAMETER_SOURCES`.
    timeout_s, start_timeout_s, progress : see `RtlLink`.

    Attributes
    ----------
    front : quantities to volts and back; its `clipped` names what a range cut.
    registers : the client on the simulated serial line. Simulated time passes while it is used, with the inputs held.

    Raises
    ------
    InputError : an option is out of its range.
    LinkError : the simulator cannot be built or started.
    """

    # The commit's last byte ends with its step. The next step takes the new words, the one after it computes with them.
    resistance_lead_steps = _COMMIT_BYTES + 1
    # The answer to the commit has come by then.
    resistance_spacing_steps = _COMMIT_BYTES + FRAME_BYTES + 2

    def __init__(
        self,
        step_clocks: int | str = "min",
        calibration: Paths | None = None,
        wires: Paths | None = None,
        parameters: str = "registers",
        scaling: Scaling | None = None,
        timeout_s: float = 120.0,
        start_timeout_s: float = 60.0,
        progress: Callable[[str], None] | None = None,
    ) -> None:
        if step_clocks not in ("min", BOARD_CLOCKS):
            raise InputError(f"step_clocks: {step_clocks!r}: the chip's step is {BOARD_CLOCKS} clocks, or min")
        if parameters not in PARAMETER_SOURCES:
            raise InputError(f"parameters: {parameters!r} is unknown, choose one of {', '.join(PARAMETER_SOURCES)}")
        self._every_clock = step_clocks == BOARD_CLOCKS
        self._idle_later = False
        self._source = parameters
        self.front = Front(scaling or default_scaling(), calibration)
        self.wires = wires or Paths()
        self._pins = np.full(8, self.front.scaling.adc[0].zero_code * ADC_VOLTS_PER_STEP)
        self._wait_for = 0  # bytes of a status answer that are on their way
        self._received = b""
        self._to_send = b""  # requests that begin with the next exchange
        self._identified = False
        self._wall_s = 0.0
        self._chip_steps = 0
        super().__init__("verilator", BOARD_CLOCKS, timeout_s, start_timeout_s, "chip", progress)
        self.registers = RegisterClient(_SimulatedLine(self), where="simulated chip")

    def _load(self, words: EffectWords, values: Parameters, method: str) -> None:
        """Write the parameters, and effects if there are any. The first call also sets currents and speeds to zero at
        its end, as does every one with effects.

        About 3 ms pass in the chip meanwhile (19 requests over the serial line; 0.18 ms for each word of effects), with
        the inputs of the last exchange, as on a board.
        """
        if self._source == "adc" and words.own:
            raise InputError("set_effects: a motor of its own needs parameters from registers, not from the ADC")
        (left, method_index), (right, _) = (parameter_words(side, method) for side in words.side_values(values))
        for k, (name, value) in enumerate(
            zip(PARAMETER_CHANNELS, (values[5], values[4], values[2], values[3]), strict=True)
        ):
            self._pins[SIGNED_CHANNELS + k] = float(self.front.scaling.channel(name).pin_volts(value))
        first = not self._identified
        if first:
            self.write_wires(self.front.to_volts((0.0, 0.0, 0.0, 0.0)))
            self.registers.identify()
        self.run(_READ_ALL)
        settings = parameter_registers(left, method_index, self._source)
        if first:
            settings |= self.front.scaling.register_values()
        if not words.ideal or self.effect_words is not None:
            settings |= effect_registers(words, right)
            self._idle_later = True
        if words.on:
            self.registers.load_effects(words.writes())
        self.registers.configure(settings)
        if first or words.on:
            self.registers.take_status()  # of the time before there was anything to compute with
            self.registers.write_flags("COMMAND", clear=True)
            self._identified = True
        self.run(_READ_ALL)
        self._note(self.registers.flags("STATUS"))

    def _load_parameters(self, words: EffectWords, values: Parameters, method: str) -> None:
        """Have both resistances written during the exchanges that follow, and committed at an exact step.

        Before the first exchange they are written at once, with all else.
        """
        if not self._exchanged:
            self._load(words, values, method)
            return
        if self._wait_for:
            raise InputError(
                "set_resistances: the serial line is still busy with the change before, which takes "
                f"{self.resistance_spacing_steps} steps"
            )
        sides = [float(parameter_words(side, method)[0][0]) for side in words.side_values(values)]
        registers, command = load_map(), load_map().named("COMMAND")
        requests = [
            encode_request(k, OP_WRITE, registers.named(name).address, float_word(ohm))
            for k, (name, ohm) in enumerate(zip(_CHANGED, sides, strict=True))
        ]
        commit = encode_request(len(requests), OP_WRITE, command.address, 1 << command.field("commit").bit)
        self._to_send = (_PAUSE_BYTES * _IDLE_BYTE).join([*requests, commit])

    def report(self) -> dict:
        """Figures of the run so far, for a summary: simulated time and clocks, wall time, what was cut."""
        return {
            "clocks_50_mhz": self.clocks,
            "every_clock": self._every_clock,
            "chip_steps": self._chip_steps,
            "chip_wall_s": self._wall_s,
            "cut_by_range": sorted(self.front.clipped),
        }

    # --- what calibration uses, too ---------------------------------------------------------------------------------

    def write_wires(self, volts: np.ndarray) -> None:
        """Put (4,) V on the wires to the chip, in the order of `rtds_host.link.analog.TO_CHIP`."""
        self._pins[:4] = [line.forward(float(v)) for line, v in zip(self.wires.to_chip, volts, strict=True)]

    def read_wires(self) -> np.ndarray:
        """(4,) V that come out of the wires from the chip, now."""
        return self._wire_volts(self.run(0))[-1]

    def settle(self) -> None:
        """Let the chip take what was written and show what follows of it."""
        self.run(_READ_ALL)

    def run(self, steps: int, every: int = 0, send: bytes = b"", expect: int = 0) -> np.ndarray:
        """Let the chip run; (n, 4) codes of the DAC, one row each `every` steps and one at the end.

        Raises
        ------
        LinkError : the simulator does not answer, or no LDAC edge comes.
        """
        self._check_open()
        limit_ns = 2 * steps * STEP_NS + _SERIAL_LIMIT_NS
        clocks = 1 if self._every_clock else 2 if self._idle_later else 0
        head = protocol.CHIP_RUN_HEAD.pack(*self._pins, steps, every, expect, clocks, limit_ns)
        began = time.perf_counter()
        payload = self._ask(protocol.CHIP_RUN, head + send, protocol.CHIP_RAN)
        self._wall_s += time.perf_counter() - began
        at = protocol.CHIP_RAN_HEAD.size
        self._check_length(payload, at, least=True)
        flags, _, _, self.clocks, count, rows = protocol.CHIP_RAN_HEAD.unpack_from(payload)
        self._check_length(
            payload, at + count + 8 * rows, f"for {count} bytes of the serial line and {rows} rows of codes"
        )
        self._received += payload[at : at + count]
        codes = np.frombuffer(payload, np.dtype("<u2"), offset=at + count).reshape(rows, 4)
        if steps and flags & protocol.CHIP_FLAG_TIMEOUT:
            raise self._failure(f"fewer than {steps} LDAC edges in {1e-6 * limit_ns:g} ms of simulated time")
        due = -(-steps // every) if every else 1
        if rows != due:
            raise self._failure(f"its answer has {rows} rows of codes, {due} are due")
        self._chip_steps += steps
        return codes

    # --- inside -----------------------------------------------------------------------------------------------------

    def _request(self, inputs: list[int], steps: int, every: int) -> np.ndarray:
        """One request of `RtlLink.exchange`; (n, 4) float32 with columns i_l w_l i_r w_r."""
        values = np.array(inputs, np.uint32).view(np.float32)
        self.write_wires(self.front.to_volts(values))
        send, expect = b"", 0
        if self._to_send:
            send, self._to_send = self._to_send, b""
            expect = self._wait_for = (len(_CHANGED) + 1) * FRAME_BYTES
            self._received = b""
        elif not self._wait_for and steps >= _STATUS_STEPS:
            send = encode_request(0, OP_READ, load_map().named("STATUS").address)
            expect = self._wait_for = FRAME_BYTES
            self._received = b""
        codes = self.run(steps, every, send, expect)
        if self._wait_for and len(self._received) >= self._wait_for:
            self._look_at_answers()
        return self.front.from_volts(self._wire_volts(codes))

    def _look_at_answers(self) -> None:
        """Take the answers that came during exchanges: to a read of STATUS, or to a change of resistances."""
        count, self._wait_for, status = self._wait_for, 0, 0
        for at in range(0, count, FRAME_BYTES):
            answer = decode(self._received[at : at + FRAME_BYTES], SOF_ANSWER)
            if answer is None or answer[1]:
                raise self._failure("an answer of the serial line is damaged")
            status = answer[3]
        if count == FRAME_BYTES:
            fields = load_map().named("STATUS").fields
            self._note({field.name: bool(status >> field.bit & 1) for field in fields})

    def _wire_volts(self, codes: np.ndarray) -> np.ndarray:
        volts = dac_volts(codes)
        return np.stack([line.forward(volts[:, k]) for k, line in enumerate(self.wires.from_chip)], axis=1)

    def _note(self, status: dict[str, bool]) -> None:
        self.front.clipped |= check_status(status, "simulated chip")


class _SimulatedLine:
    """The serial line of a `ChipLink` as a transport for `RegisterClient`."""

    def __init__(self, link: ChipLink) -> None:
        self._link = link
        self._out = b""

    def send(self, data: bytes) -> None:
        self._out += data

    def receive(self, count: int) -> bytes:
        link = self._link
        if len(link._received) < count:
            send, self._out = self._out, b""
            link.run(0, send=send, expect=count - len(link._received))
        got, link._received = link._received[:count], link._received[count:]
        return got

    def flush_input(self) -> None:
        if self._link._wait_for:  # the answer to a read during the last exchange
            self._link.run(0, expect=0)
            self._link._wait_for = 0
        self._link._received = b""

    def close(self) -> None:
        self._link.close()
