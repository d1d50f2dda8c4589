"""The analog side of the chip: four wires to its ADC, four from its DAC, and what is known about them.

    host                    wire                chip
    volts -> DAC of the PC  -- gain, offset --> LTC2308, 0 to 4.095 V, 1 mV a step
    volts <- ADC of the PC  <-- gain, offset -- DAC7624 between its references

A `Line` is what a wire, with the converter of the PC at its end, makes of a voltage: ``out = gain * in + offset``.
Three sets of lines meet here: those that a simulated chip is given (deliberate errors), those that `rtds calibrate`
measured, and the ideal ones. One file format holds any of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rtds_host.contract import write_atomic
from rtds_host.contract.inputs import read_toml
from rtds_host.errors import InputError
from rtds_host.link.scaling import ADC_CHANNELS, ADC_VOLTS_PER_STEP, DAC_OUTPUTS, FULL_SCALE, Scaling, default_scaling
from rtds_host.vectors import Vector

TO_CHIP = ADC_CHANNELS[:4]
"""The wires to the chip: v_l v_r t_l t_r, ADC channels 0 to 3."""
FROM_CHIP = DAC_OUTPUTS
"""The wires from the chip: i_l w_l i_r w_r, DAC outputs A to D."""

ADC_LOW_V = 0.0
ADC_HIGH_V = FULL_SCALE * ADC_VOLTS_PER_STEP
DAC_LOW_V = -2.5
"""V_REFL of the DAC's board; mid-scale, code 2048, is 0 V."""
DAC_STEP_V = 5.0 / 4096
"""(V_REFH - V_REFL) / 4096 with V_REFH = 2.5 V."""

# Beyond these a wire is not connected, or connected to something else: no calibration will make it right.
GAIN_LIMITS = (0.5, 2.0)
OFFSET_LIMIT_V = 1.0
FORMAT = 1


@dataclass(frozen=True)
class Line:
    """out = gain * in + offset_v, V."""

    gain: float = 1.0
    offset_v: float = 0.0

    def forward(self, volts):
        """What comes out for a voltage put in; float or array."""
        return self.gain * volts + self.offset_v

    def inverse(self, volts):
        """What has to be put in for a voltage to come out; float or array."""
        return (volts - self.offset_v) / self.gain


IDEAL_LINES = (Line(),) * 4


@dataclass(frozen=True)
class Paths:
    """The eight wires.

    Attributes
    ----------
    to_chip : (4,) in the order of `TO_CHIP`, from the volts asked of the PC's DAC to those the chip's ADC reads.
    from_chip : (4,) in the order of `FROM_CHIP`, from the volts of the DAC's codes to those the PC's ADC gives.
    about : what was measured, when and how well; text and numbers, kept in the file.
    """

    to_chip: tuple[Line, ...] = IDEAL_LINES
    from_chip: tuple[Line, ...] = IDEAL_LINES
    about: Mapping[str, str | float] = field(default_factory=dict)


def load_paths(path: str | Path) -> Paths:
    """Read a file of eight lines, as `rtds calibrate` writes it. A line that is not in it is ideal.

    Raises
    ------
    InputError : names the file and the key that is unknown, missing, no number, or out of all proportion.
    """
    path = Path(path)
    data = read_toml(path)
    if data.get("format") != FORMAT:
        raise InputError(f"{path}: format: {FORMAT} is needed, found {data.get('format')!r}")
    unknown = sorted(set(data) - {"format", "about", "to_chip", "from_chip"})
    if unknown:
        raise InputError(f"{path}: {unknown[0]}: unknown (known: format, about, to_chip, from_chip)")
    about = data.get("about", {})
    if not isinstance(about, dict):
        raise InputError(f"{path}: about: a table is needed")
    return Paths(_lines(path, data, "to_chip", TO_CHIP), _lines(path, data, "from_chip", FROM_CHIP), about)


def _lines(path: Path, data: dict, side: str, names: Sequence[str]) -> tuple[Line, ...]:
    table = data.get(side, {})
    if not isinstance(table, dict):
        raise InputError(f"{path}: {side}: a table is needed")
    for name in table:
        if name not in names:
            raise InputError(f"{path}: {side}.{name}: unknown (known: {', '.join(names)})")
    return tuple(_line(f"{path}: {side}.{name}", table.get(name, {})) for name in names)


def _line(where: str, entry: object) -> Line:
    if not isinstance(entry, dict):
        raise InputError(f"{where}: a table with gain and offset_v is needed")
    for key in entry:
        if key not in ("gain", "offset_v"):
            raise InputError(f"{where}.{key}: unknown (known: gain, offset_v)")
    values = {}
    for key, value in (("gain", entry.get("gain", 1.0)), ("offset_v", entry.get("offset_v", 0.0))):
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise InputError(f"{where}.{key}: {value!r} is not a finite number")
        values[key] = float(value)
    check_line(where, Line(**values))
    return Line(**values)


def check_line(where: str, line: Line) -> None:
    """Raises InputError when a line cannot be a wire with the usual errors of converters."""
    low, high = GAIN_LIMITS
    if not low <= line.gain <= high:
        raise InputError(f"{where}.gain: {line.gain:g} is not between {low:g} and {high:g}")
    if not abs(line.offset_v) <= OFFSET_LIMIT_V:
        raise InputError(f"{where}.offset_v: {line.offset_v:g} V is beyond {OFFSET_LIMIT_V:g} V")


def save_paths(path: str | Path, paths: Paths) -> None:
    """Write the file, whole or not at all.

    Raises
    ------
    OutputError : the place cannot be written.
    """
    text = ["# gain and offset of the wires between PC and chip: out = gain * in + offset_v", f"format = {FORMAT}"]
    if paths.about:
        text += ["", "[about]"]
        text += [f"{key} = {_toml(value)}" for key, value in paths.about.items()]
    for side, names, lines in (("to_chip", TO_CHIP, paths.to_chip), ("from_chip", FROM_CHIP, paths.from_chip)):
        for name, line in zip(names, lines, strict=True):
            text += ["", f"[{side}.{name}]", f"gain = {line.gain!r}", f"offset_v = {line.offset_v!r}"]
    write_atomic(path, "\n".join(text) + "\n")


def _toml(value: str | float) -> str:
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(float(value))


class Front:
    """Quantities to volts and back: the scalings of the chip and the calibration of the wires.

    Parameters
    ----------
    scaling : of the chip; the default ranges without it.
    calibration : of the wires; ideal ones without it.

    Attributes
    ----------
    clipped : names of the quantities that a range cut so far.
    """

    def __init__(self, scaling: Scaling | None = None, calibration: Paths | None = None) -> None:
        self.scaling = scaling or default_scaling()
        self.calibration = calibration or Paths()
        self.clipped: set[str] = set()

    def to_volts(self, values: Vector) -> np.ndarray:
        """Voltages of the PC's DAC for (4,) v_l v_r (V) t_l t_r (N·m): (4,) V, never outside the chip's ADC range.

        Both the voltage wanted at the pin and the one asked of the PC's DAC are clamped to 0 to 4.095 V: the
        DAC of the PC reaches further than the ADC survives.
        """
        volts = np.empty(4)
        for k, (name, line) in enumerate(zip(TO_CHIP, self.calibration.to_chip, strict=True)):
            wanted = float(self.scaling.channel(name).steps(float(values[k]))) * ADC_VOLTS_PER_STEP
            asked = line.inverse(clamp_to_adc(wanted))
            volts[k] = clamp_to_adc(asked)
            # Half a step: what an ideal converter would round to its last code is not cut.
            if not ADC_LOW_V - ADC_VOLTS_PER_STEP / 2 <= wanted <= ADC_HIGH_V + ADC_VOLTS_PER_STEP / 2 or (
                abs(volts[k] - asked) > ADC_VOLTS_PER_STEP / 2
            ):
                self.clipped.add(name)
        return volts

    def from_volts(self, volts: np.ndarray) -> np.ndarray:
        """(n, 4) V at the PC's ADC as (n, 4) float32 i_l w_l i_r w_r, A and rad/s of the motor shaft."""
        volts = np.asarray(volts, dtype=np.float64)
        columns = []
        for k, (name, line) in enumerate(zip(FROM_CHIP, self.calibration.from_chip, strict=True)):
            codes = (line.inverse(volts[:, k]) - DAC_LOW_V) / DAC_STEP_V
            columns.append(self.scaling.output(name).decode(codes))
        return np.stack(columns, axis=1).astype(np.float32)


def clamp_to_adc(volts: float) -> float:
    """A voltage inside the chip's ADC range; 0 V for what is no number."""
    return min(max(volts, ADC_LOW_V), ADC_HIGH_V) if not math.isnan(volts) else ADC_LOW_V


def dac_volts(codes: np.ndarray) -> np.ndarray:
    """Output voltage of the DAC's board for its codes, V."""
    return DAC_LOW_V + np.asarray(codes, dtype=np.float64) * DAC_STEP_V
