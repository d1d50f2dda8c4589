"""The chip on a real board: two Analog Discovery 2 at its analog pins, a serial port at its registers, the wall clock.

Device 1: outputs W1 = V_left, W2 = V_right, inputs 1 = I_left, 2 = speed_left.
Device 2: outputs W1 = T_left, W2 = T_right, inputs 1 = I_right, 2 = speed_right.

The outputs reach to 5 V and the ADC's pins do not: every voltage is clamped to 0 to 4.095 V here. The library is
Digilent's WaveForms runtime behind pydwf.

Time is real: exchange k is due one interval after exchange k - 1, whatever the host does in between. How late it began
is kept. One that begins later than half its interval is an overrun: what was asked for belongs to a robot of long ago,
so zero volts and zero torque go out instead, and the schedule starts again. Three in a row, or a lost device, end the
run with the outputs at zero.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from rtds_host.errors import InputError, LinkError
from rtds_host.link.analog import ADC_HIGH_V, ADC_LOW_V, Front, Paths, clamp_to_adc
from rtds_host.link.base import sample_times
from rtds_host.link.chip import STEP_NS, check_status, effect_registers, parameter_registers
from rtds_host.link.configured import ConfiguredLink
from rtds_host.link.registers import RegisterClient, open_serial
from rtds_host.link.scaling import Scaling, default_scaling
from rtds_host.motor.effect_tables import EffectWords
from rtds_host.motor.parameters import Parameters, parameter_words
from rtds_host.vectors import Vector

DEVICES = 2
CHANNELS = 2
INPUT_RANGE_V = 5.0  # peak to peak: the finer of the two ranges, 14 bits of it
LATE_PART = 0.5  # of an interval: an exchange that begins later is an overrun
OVERRUNS_IN_A_ROW = 3
STATUS_EVERY_S = 1.0
SETTLE_S = 0.05
NO_LIBRARY = (
    "ad2: the WaveForms runtime of Digilent cannot be loaded (libdwf); install it from digilent.com, "
    "or use --link chip, which needs no hardware"
)


class Clock(Protocol):
    """The time the loop is paced by, s; any origin."""

    def now(self) -> float: ...

    def sleep_until(self, t_s: float) -> None:
        """Return at `t_s`, or at once when that is over."""


class WallClock:
    """The machine's monotonic clock."""

    def now(self) -> float:
        """Seconds."""
        return time.monotonic()

    def sleep_until(self, t_s: float) -> None:
        """See `Clock.sleep_until`."""
        wait = t_s - time.monotonic()
        if wait > 0:
            time.sleep(wait)


class DiscoveryPair:
    """Two Analog Discovery 2: four voltages out, four in.

    Parameters
    ----------
    serial_numbers : of device 1 and 2; the end of the number is enough where it is unique.

    Raises
    ------
    InputError : not two different numbers.
    LinkError : no vendor's library; a device is missing, in use, or does not answer.
    """

    def __init__(self, serial_numbers: Sequence[str]) -> None:
        numbers = [number.strip().upper().removeprefix("SN:") for number in serial_numbers]  # as pydwf shows them
        if len(numbers) != DEVICES or not all(numbers) or numbers[0] == numbers[1]:
            raise InputError(f"ad2: two different serial numbers are needed, got {', '.join(numbers) or 'none'}")
        try:
            import pydwf
        except ImportError as error:
            raise LinkError(f"ad2: the package pydwf is missing ({error}): pip install 'rtds-host[board]'") from error
        self._dwf = pydwf
        self._devices: list = []
        self.serial_numbers = numbers
        try:
            library = pydwf.DwfLibrary()
        except pydwf.PyDwfError as error:
            raise LinkError(NO_LIBRARY) from error
        try:
            for index in self._choose(library):
                self._devices.append(library.deviceControl.open(index))
            for device in self._devices:
                self._prepare(device)
        except pydwf.PyDwfError as error:
            self.close()
            raise LinkError(f"ad2: {_one_line(error)}") from error
        except BaseException:
            self.close()
            raise

    def _choose(self, library) -> list[int]:
        enumeration = library.deviceEnum
        found = [enumeration.serialNumber(k) for k in range(enumeration.enumerateDevices())]
        chosen = []
        for number in self.serial_numbers:
            match = [k for k, serial in enumerate(found) if serial.upper().endswith(number)]
            if len(match) != 1:
                what = "no device has" if not match else f"{len(match)} devices have"
                raise LinkError(f"ad2: {what} the serial number {number} (connected: {', '.join(found) or 'none'})")
            if enumeration.deviceIsOpened(match[0]):
                raise LinkError(f"ad2: device {found[match[0]]} is in use by another program")
            chosen += match
        if chosen[0] == chosen[1]:
            raise LinkError(f"ad2: both serial numbers name the device {found[chosen[0]]}")
        return chosen

    def _prepare(self, device) -> None:
        dwf = self._dwf
        carrier = dwf.DwfAnalogOutNode.Carrier
        device.paramSet(dwf.DwfDeviceParameter.OnClose, 2)  # outputs off when the device is closed
        device.autoConfigureSet(0)  # a value takes effect with `configure`, not half way
        for channel in range(CHANNELS):
            device.analogOut.nodeFunctionSet(channel, carrier, dwf.DwfAnalogOutFunction.DC)
            device.analogOut.nodeOffsetSet(channel, carrier, (ADC_LOW_V + ADC_HIGH_V) / 2)
            device.analogOut.nodeEnableSet(channel, carrier, 1)
            device.analogOut.configure(channel, 1)
            device.analogIn.channelEnableSet(channel, True)
            device.analogIn.channelRangeSet(channel, INPUT_RANGE_V)
        device.analogIn.configure(True, False)

    def write(self, volts: Vector) -> None:
        """Put (4,) V on the outputs, clamped to the range of the chip's ADC.

        Raises
        ------
        LinkError : a device is lost.
        """
        carrier = self._dwf.DwfAnalogOutNode.Carrier
        for k, value in enumerate(volts):
            place, channel = divmod(k, CHANNELS)
            try:
                out = self._devices[place].analogOut
                out.nodeOffsetSet(channel, carrier, clamp_to_adc(float(value)))
                out.configure(channel, 3)  # apply, without a restart of the generator
            except self._dwf.PyDwfError as error:
                raise self._lost(place, error) from error

    def write_what_answers(self, volts: Vector) -> None:
        """As `write`, on every output that still takes it: for the way to a safe state."""
        for k, value in enumerate(volts):
            place, channel = divmod(k, CHANNELS)
            try:
                out = self._devices[place].analogOut
                out.nodeOffsetSet(channel, self._dwf.DwfAnalogOutNode.Carrier, clamp_to_adc(float(value)))
                out.configure(channel, 3)
            except self._dwf.PyDwfError:
                continue  # this device is lost, the other one counts

    def read(self) -> np.ndarray:
        """(4,) V at the inputs, now.

        Raises
        ------
        LinkError : a device is lost.
        """
        volts = np.empty(DEVICES * CHANNELS)
        for place, device in enumerate(self._devices):
            try:
                device.analogIn.status(False)
                for channel in range(CHANNELS):
                    volts[place * CHANNELS + channel] = device.analogIn.statusSample(channel)
            except self._dwf.PyDwfError as error:
                raise self._lost(place, error) from error
        return volts

    def _lost(self, place: int, error: Exception) -> LinkError:
        return LinkError(f"ad2: device {place + 1} ({self.serial_numbers[place]}) does not answer ({_one_line(error)})")

    def close(self) -> None:
        """Close both devices; their outputs go off."""
        devices, self._devices = self._devices, []
        for device in devices:
            try:
                device.close()
            except self._dwf.PyDwfError:
                continue  # it is gone already


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


class Ad2Link(ConfiguredLink):
    """The board behind two Analog Discovery 2, as a `Link`.

    Parameters
    ----------
    serial_numbers : of the two devices.
    port : serial device of the chip's registers, or an open `RegisterClient`.
    calibration : of the wires; ideal ones without it.
    clock : what paces the loop; the wall clock without it.

    Attributes
    ----------
    front : quantities to volts and back; its `clipped` names what a range cut.
    registers : the client on the serial port.

    Raises
    ------
    InputError : an option is missing or out of its range.
    LinkError : library, device, serial port or chip do not answer.
    """

    def __init__(
        self,
        serial_numbers: Sequence[str] = (),
        port: str | RegisterClient = "",
        calibration: Paths | None = None,
        scaling: Scaling | None = None,
        clock: Clock | None = None,
        open_port: Callable[[str], RegisterClient] = open_serial,
    ) -> None:
        if not port:
            raise InputError("ad2: the serial port of the chip's registers is needed (--serial)")
        self.front = Front(scaling or default_scaling(), calibration)
        self._clock = clock or WallClock()
        self._due: float | None = None
        self._lateness: list[float] = []
        self._overruns = self._in_a_row = self._held = self._samples = 0
        self._next_status = 0.0
        self._closed = False
        self.both = DiscoveryPair(serial_numbers)
        try:
            self._safe()
            self.registers = open_port(port) if isinstance(port, str) else port
        except BaseException:
            self.both.close()
            raise

    def _check_step(self, step_s: float) -> None:
        if round(step_s * 1e9) != STEP_NS:
            raise InputError(f"step: {step_s:g} s: the board makes a step each {1e-9 * STEP_NS:g} s, no other")

    def _load(self, words: EffectWords, values: Parameters, method: str) -> None:
        """Bring the chip to rest with these parameters and effects; the schedule starts again."""
        (left, method_index), (right, _) = (parameter_words(side, method) for side in words.side_values(values))
        self._safe()
        if words.on:
            self.registers.load_effects(words.writes())
        self.registers.configure(
            parameter_registers(left, method_index)
            | self.front.scaling.register_values()
            | effect_registers(words, right)
        )
        self._clock.sleep_until(self._clock.now() + SETTLE_S)
        self.registers.take_status()
        self.registers.write_flags("COMMAND", clear=True)
        self.front.clipped |= check_status(self.registers.flags("STATUS"), "chip")
        self._due = None

    def _run_steps(self, v: np.ndarray, t: np.ndarray, steps: int, every: int) -> np.ndarray:
        """See `ConfiguredLink`. A sample whose successor is due already repeats the one before it.

        Raises
        ------
        LinkError : a device or the chip is lost, or the host does not keep up; the outputs are then at zero.
        """
        interval_s = steps * self.step_s
        times = sample_times(steps, every, self.step_s)
        try:
            start = self._begin(interval_s)
            volts = self.front.to_volts(np.concatenate([v, t]))
            self.both.write(volts if self._in_a_row == 0 else self._zero())
            self._look_at_status(start)
            rows = self._sample(start, times)
        except LinkError as error:
            self.both.write_what_answers(self._zero())
            self.close()
            raise LinkError(f"{error}; the voltages are at zero") from error
        self._due = start + interval_s
        return self.front.from_volts(rows)

    def report(self) -> dict:
        """Figures of the run so far: lateness of the exchanges in s, jitter (its standard deviation), overruns."""
        late = np.array(self._lateness or [0.0])
        return {
            "exchanges": len(self._lateness),
            "lateness_mean_s": float(late.mean()),
            "lateness_max_s": float(late.max()),
            "jitter_s": float(late.std()),
            "overruns": self._overruns,
            "samples": self._samples,
            "samples_held": self._held,
            "cut_by_range": sorted(self.front.clipped),
        }

    # --- what calibration uses, too ---------------------------------------------------------------------------------

    def write_wires(self, volts: np.ndarray) -> None:
        """Put (4,) V on the wires to the chip. Raises LinkError."""
        self.both.write(volts)

    def read_wires(self) -> np.ndarray:
        """(4,) V that come out of the wires from the chip. Raises LinkError."""
        return self.both.read()

    def settle(self) -> None:
        """Let outputs and converters settle."""
        self._clock.sleep_until(self._clock.now() + SETTLE_S)

    def close(self) -> None:
        """Voltages to zero, devices and port closed. May be called more than once."""
        if self._closed:
            return
        self._closed = True
        self.both.write_what_answers(self._zero())
        self.both.close()
        self.registers.close()

    # --- inside -----------------------------------------------------------------------------------------------------

    def _zero(self) -> np.ndarray:
        return Front(self.front.scaling, self.front.calibration).to_volts((0.0, 0.0, 0.0, 0.0))

    def _safe(self) -> None:
        self.both.write(self._zero())

    def _begin(self, interval_s: float) -> float:
        """The time this exchange was due; keeps how late it is, and restarts the schedule on an overrun."""
        now = self._clock.now()
        if self._due is None:
            self._in_a_row = 0
            return now
        if now < self._due:
            self._clock.sleep_until(self._due)
            now = self._clock.now()
        late = now - self._due
        self._lateness.append(late)
        if late <= LATE_PART * interval_s:
            self._in_a_row = 0
            return self._due
        self._overruns += 1
        self._in_a_row += 1
        if self._in_a_row >= OVERRUNS_IN_A_ROW:
            raise LinkError(
                f"ad2: the host does not keep up, {self._in_a_row} exchanges in a row began late "
                f"({1e3 * late:.1f} ms with an interval of {1e3 * interval_s:g} ms)"
            )
        return now

    def _look_at_status(self, now: float) -> None:
        if now < self._next_status:
            return
        self._next_status = now + STATUS_EVERY_S
        self.front.clipped |= check_status(self.registers.flags("STATUS"), "chip")

    def _sample(self, start: float, times: np.ndarray) -> np.ndarray:
        rows = np.empty((len(times), DEVICES * CHANNELS))
        for k, t in enumerate(times):
            over = k + 1 < len(times) and self._clock.now() >= start + times[k + 1]
            if over and k > 0:
                rows[k] = rows[k - 1]
                self._held += 1
            else:
                self._clock.sleep_until(start + t)
                rows[k] = self.both.read()
            self._samples += 1
        return rows
