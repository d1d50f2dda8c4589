"""Measures gain and offset of the eight wires between PC and chip.

To the chip: known voltages go out, the chip's registers tell which codes its ADC reads. From the chip: the gain of the
DAC's scaling is set to zero and its offset to known codes, the PC reads the voltage. A straight line through each set,
by least squares. The voltages are spread so that they fall on all parts of a code: the rounding of 12 bits then
averages out. At every point the four wires carry different voltages: swapped wires cannot pass.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Protocol

import numpy as np

from rtds_host.compat import UTC
from rtds_host.errors import InputError, LinkError
from rtds_host.link.analog import (
    ADC_VOLTS_PER_STEP,
    DAC_STEP_V,
    FROM_CHIP,
    TO_CHIP,
    Front,
    Line,
    Paths,
    check_line,
    dac_volts,
)
from rtds_host.link.registers import RegisterClient
from rtds_host.link.scaling import MID_SCALE

POINTS = 41
READS = 4
LOWEST_V, HIGHEST_V = 0.3, 3.8  # room for gain and offset below and above
LARGEST_STEPS = 1800  # of the DAC's 2047, for the same reason
RESIDUAL_STEPS = 4.0  # of a 12-bit converter: further off its line a wire is noisy, loose, or bent


class Rig(Protocol):
    """What a calibration needs of a link: `ChipLink` and `Ad2Link` have it."""

    registers: RegisterClient
    front: Front

    def write_wires(self, volts: np.ndarray) -> None: ...

    def read_wires(self) -> np.ndarray: ...

    def settle(self) -> None: ...


@dataclass(frozen=True)
class Measured:
    """A calibration and how well the lines fit.

    Attributes
    ----------
    paths : the eight lines. residuals_v : (8,) largest distance of a point from its line, V, in the order of `TO_CHIP`
        and then `FROM_CHIP`.
    """

    paths: Paths
    residuals_v: np.ndarray


def measure(rig: Rig, link: str, points: int = POINTS, reads: int = READS) -> Measured:
    """Measure all wires; the rig's scalings are as before afterwards.

    Parameters
    ----------
    rig : a link whose parameters are set. link : its name, for the file.
    points : voltages a wire, at least 3. reads : readings a point, averaged.

    Raises
    ------
    InputError : too few points.
    LinkError : the chip does not answer, or a wire does not behave like one.
    """
    if points < 3 or reads < 1:
        raise InputError(f"calibrate: {points} points and {reads} readings: at least 3 and 1 are needed")
    asked, seen = _to_chip(rig, points, reads)
    to_chip = [_fit(f"to_chip.{name}", asked[:, k], seen[:, k], ADC_VOLTS_PER_STEP) for k, name in enumerate(TO_CHIP)]
    rig.write_wires(rig.front.to_volts((0.0, 0.0, 0.0, 0.0)))
    nominal, read = _from_chip(rig, points, reads)
    from_chip = [_fit(f"from_chip.{name}", nominal[:, k], read[:, k], DAC_STEP_V) for k, name in enumerate(FROM_CHIP)]
    residuals = np.array([residual for _, residual in (*to_chip, *from_chip)])
    about: dict[str, str | float] = {
        "measured": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "link": link,
        "points": float(points),
        "largest_residual_to_chip_v": float(residuals[:4].max()),
        "largest_residual_from_chip_v": float(residuals[4:].max()),
    }
    return Measured(Paths(tuple(line for line, _ in to_chip), tuple(line for line, _ in from_chip), about), residuals)


def _spread(low: float, high: float, points: int) -> np.ndarray:
    """(points, 4): every column the same values, each in another order."""
    values = np.linspace(low, high, points)
    return np.stack([np.roll(values, (k * points) // 4) for k in range(4)], axis=1)


def _to_chip(rig: Rig, points: int, reads: int) -> tuple[np.ndarray, np.ndarray]:
    asked = _spread(LOWEST_V, HIGHEST_V, points)
    seen = np.zeros_like(asked)
    for row, volts in enumerate(asked):
        rig.write_wires(volts)
        rig.settle()
        for _ in range(reads):
            words = rig.registers.read_word("CODES_V"), rig.registers.read_word("CODES_T")
            seen[row] += [word >> shift & 0xFFF for word in words for shift in (0, 16)]
    return asked, seen * ADC_VOLTS_PER_STEP / reads


def _from_chip(rig: Rig, points: int, reads: int) -> tuple[np.ndarray, np.ndarray]:
    codes = MID_SCALE + np.rint(_spread(-LARGEST_STEPS, LARGEST_STEPS, points)).astype(np.int64)
    registers = [f"DAC_{name.upper()}" for name in FROM_CHIP]
    before = {
        f"{name}_{what}": rig.registers.read(f"{name}_{what}") for name in registers for what in ("GAIN", "OFFSET")
    }
    read = np.zeros(codes.shape)
    try:
        rig.registers.configure({f"{name}_GAIN": 0.0 for name in registers})
        for row, wanted in enumerate(codes):
            rig.registers.configure(
                {f"{name}_OFFSET": float(code - MID_SCALE) for name, code in zip(registers, wanted, strict=True)}
            )
            rig.settle()
            words = rig.registers.read_word("CODES_L"), rig.registers.read_word("CODES_R")
            shown = [word >> shift & 0xFFF for word in words for shift in (0, 16)]
            if shown != wanted.tolist():
                raise LinkError(f"calibrate: the chip shows the codes {shown} where {wanted.tolist()} were set")
            for _ in range(reads):
                read[row] += rig.read_wires()
    finally:
        rig.registers.configure(before)
        rig.settle()
    return dac_volts(codes), read / reads


def _fit(name: str, x: np.ndarray, y: np.ndarray, step_v: float) -> tuple[Line, float]:
    """The line through the points, and the largest distance from it. Raises LinkError when it is no wire's."""
    gain, offset = np.polyfit(x, y, 1)
    line = Line(float(gain), float(offset))
    residual = float(np.abs(y - line.forward(x)).max())
    try:
        check_line(f"calibrate: {name}", line)
    except InputError as error:
        raise LinkError(f"{error}: not connected, or to something else") from error
    if residual > RESIDUAL_STEPS * step_v:
        raise LinkError(
            f"calibrate: {name}: a point is {1e3 * residual:.1f} mV off its line, {1e3 * RESIDUAL_STEPS * step_v:.1f}"
            " mV are allowed: wires swapped, loose or noisy"
        )
    return line, residual


def ideal_errors(paths: Paths) -> np.ndarray:
    """(8,) V: the largest error that a run without this calibration makes on each wire, over the calibrated range."""
    errors = []
    for line in paths.to_chip:
        errors.append(max(abs(line.forward(v) - v) for v in (LOWEST_V, HIGHEST_V)))
    for line in paths.from_chip:
        ends = dac_volts(np.array([MID_SCALE - LARGEST_STEPS, MID_SCALE + LARGEST_STEPS]))
        errors.append(float(np.abs(line.forward(ends) - ends).max()))
    return np.array(errors)


__all__ = ["Measured", "Rig", "ideal_errors", "measure"]
