"""Codes of the converters and the quantities they stand for: the same binary32 arithmetic as the chip's.

`adc_scale` and `dac_scale` of the RTL, in numpy: one rounding after the product, one after the sum, to nearest even.
Quantities are SI at the motor shaft. The default gains are the reset values of the chip's registers
(`registers.toml`), which is the one place they are written down.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rtds_host.errors import InputError
from rtds_host.link.registers import load_map

MID_SCALE = 2048
FULL_SCALE = 4095
ADC_VOLTS_PER_STEP = 1e-3
"""LTC2308, unipolar: 4096 steps of 1 mV."""

ADC_CHANNELS = ("v_l", "v_r", "t_l", "t_r", "b", "j", "km", "kb")
"""Order of the ADC's channels 0 to 7. The first four are signed (offset binary), the parameters are not."""
SIGNED_CHANNELS = 4
DAC_OUTPUTS = ("i_l", "w_l", "i_r", "w_r")
"""Order of the DAC's outputs A to D, all signed."""


@dataclass(frozen=True)
class AdcScale:
    """One ADC channel: value = fl(fl(n * gain) + offset), n = code - 2048 if signed, else the code.

    Attributes
    ----------
    gain, offset : float32, unit a step and unit.
    signed : the quantity is offset-binary.
    """

    gain: np.float32
    offset: np.float32
    signed: bool

    @property
    def zero_code(self) -> int:
        """The code at which n is 0."""
        return MID_SCALE if self.signed else 0

    def decode(self, code: np.ndarray | int) -> np.ndarray:
        """What the chip makes of a code, bit for bit.

        Parameters
        ----------
        code : int or (n,) int, 0 to 4095.

        Returns
        -------
        float32, shape of `code`. Gains and offsets that are no numbers give none.
        """
        n = (np.asarray(code, dtype=np.int64) - self.zero_code).astype(np.float32)
        with np.errstate(all="ignore"):
            return np.asarray(n * self.gain, dtype=np.float32) + self.offset

    def steps(self, value: np.ndarray | float) -> np.ndarray:
        """A quantity in steps of the ADC above its lowest code, float64, neither rounded nor clamped.

        Raises
        ------
        InputError : the gain is zero or not finite: no code stands for any quantity.
        """
        gain, offset = float(self.gain), float(self.offset)
        if gain == 0.0 or not np.isfinite(gain) or not np.isfinite(offset):
            raise InputError(f"scaling: gain {gain} and offset {offset} map no quantity to a code")
        return (np.asarray(value, dtype=np.float64) - offset) / gain + self.zero_code

    def encode(self, value: np.ndarray | float) -> np.ndarray:
        """The code that an ideal source and ADC give for a quantity: nearest step, clamped. int64, shape of `value`."""
        return np.clip(np.rint(self.steps(value)), 0, FULL_SCALE).astype(np.int64)

    def pin_volts(self, value: np.ndarray | float) -> np.ndarray:
        """Voltage at the ADC's pin that stands for a quantity, V, clamped to the ADC's range of 0 to 4.095 V."""
        return np.clip(self.steps(value), 0, FULL_SCALE) * ADC_VOLTS_PER_STEP

    @property
    def limits(self) -> tuple[float, float]:
        """The quantities at codes 0 and 4095."""
        low, high = self.decode(np.array([0, FULL_SCALE]))
        return float(low), float(high)


@dataclass(frozen=True)
class DacScale:
    """One DAC output: code = clamp(2048 + round(fl(fl(x * gain) + offset)), 0, 4095).

    Attributes
    ----------
    gain, offset : float32, steps a unit and steps.
    """

    gain: np.float32
    offset: np.float32

    def encode(self, value: np.ndarray | float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The code the chip sends, bit for bit, with its flags.

        Parameters
        ----------
        value : float or (n,); taken as float32.

        Returns
        -------
        code : int64. saturated : bool, clamped or not a number. nan : bool, not a number (the code is then 2048).
        """
        with np.errstate(all="ignore"):
            steps = np.asarray(np.asarray(value, dtype=np.float32) * self.gain, dtype=np.float32) + self.offset
        nan = np.isnan(steps)
        whole = np.rint(np.where(nan, np.float32(0.0), steps)).astype(np.float64) + MID_SCALE
        code = np.clip(whole, 0, FULL_SCALE).astype(np.int64)
        return code, nan | (whole < 0) | (whole > FULL_SCALE), nan

    def decode(self, code: np.ndarray | int) -> np.ndarray:
        """The quantity a code stands for, float64, shape of `code`.

        Raises
        ------
        InputError : the gain is zero or not finite.
        """
        gain, offset = float(self.gain), float(self.offset)
        if gain == 0.0 or not np.isfinite(gain) or not np.isfinite(offset):
            raise InputError(f"scaling: gain {gain} and offset {offset} map no code to a quantity")
        return (np.asarray(code, dtype=np.float64) - MID_SCALE - offset) / gain

    @property
    def limits(self) -> tuple[float, float]:
        """The quantities at codes 0 and 4095."""
        low, high = self.decode(np.array([0, FULL_SCALE]))
        return float(low), float(high)


@dataclass(frozen=True)
class Scaling:
    """All twelve scalings: `adc` in the order of `ADC_CHANNELS`, `dac` in the order of `DAC_OUTPUTS`."""

    adc: tuple[AdcScale, ...]
    dac: tuple[DacScale, ...]

    def channel(self, name: str) -> AdcScale:
        """The ADC channel of that name."""
        return self.adc[ADC_CHANNELS.index(name)]

    def output(self, name: str) -> DacScale:
        """The DAC output of that name."""
        return self.dac[DAC_OUTPUTS.index(name)]

    def register_values(self) -> dict[str, float]:
        """Register name -> value, to write these scalings to a chip."""
        pairs: list[tuple[str, str, AdcScale | DacScale]] = [
            ("ADC", name, scale) for name, scale in zip(ADC_CHANNELS, self.adc)
        ]
        pairs += [("DAC", name, scale) for name, scale in zip(DAC_OUTPUTS, self.dac)]
        return {
            f"{kind}_{name.upper()}_{what.upper()}": float(getattr(scale, what))
            for what in ("gain", "offset")
            for kind, name, scale in pairs
        }


def scaling_from(read: Callable[[str], float]) -> Scaling:
    """The scalings that a chip has.

    Parameters
    ----------
    read : gives the value of the register of a name, e.g. ``ADC_V_L_GAIN``.
    """

    def pair(kind: str, name: str) -> tuple[np.float32, np.float32]:
        gain, offset = (np.float32(read(f"{kind}_{name.upper()}_{what}")) for what in ("GAIN", "OFFSET"))
        return gain, offset

    adc = tuple(AdcScale(*pair("ADC", name), place < SIGNED_CHANNELS) for place, name in enumerate(ADC_CHANNELS))
    return Scaling(adc, tuple(DacScale(*pair("DAC", name)) for name in DAC_OUTPUTS))


def default_scaling() -> Scaling:
    """The scalings of a chip that was just reset."""
    registers = load_map()

    def reset_value(name: str) -> float:
        register = registers.named(name)
        return float(register.from_word(register.reset))

    return scaling_from(reset_value)
