"""A link with the chip's 12-bit converters around another one, ideal ones: nearest code, no noise, no offset."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtds_host.link.base import Around, Exchange, Link
from rtds_host.link.scaling import ADC_CHANNELS, DAC_OUTPUTS, Scaling, default_scaling
from rtds_host.motor.effects import SupplyEffects, UnitEffects
from rtds_host.vectors import Vector

STAGES = ("parameters", "voltages", "torques", "outputs")
"""Where a converter is: four parameters, two voltages, two torques through the ADC, four outputs through the DAC."""


class QuantisedLink(Around):
    """A `Link` with 12-bit converters around another one.

    Parameters
    ----------
    inner : the link that computes the motors; closed with this one.
    scaling : of the chip; the default ranges without it.
    stages : which converters are there, of `STAGES`.

    Attributes
    ----------
    clipped : names of the quantities that a converter's range cut so far.
    """

    def __init__(self, inner: Link, scaling: Scaling | None = None, stages: Sequence[str] = STAGES) -> None:
        super().__init__(inner)
        self.scaling = scaling or default_scaling()
        self.stages = frozenset(stages)
        self.clipped: set[str] = set()

    @property
    def step_s(self) -> float:
        """See `Link`."""
        return self.inner.step_s

    def _read(self, name: str, value: float) -> float:
        channel = self.scaling.adc[ADC_CHANNELS.index(name)]
        low, high = sorted(channel.limits)
        if not low <= value <= high:
            self.clipped.add(name)
        return float(channel.decode(channel.encode(value)))

    def set_parameters(
        self,
        resistance_ohm: float,
        inductance_h: float,
        torque_constant_nm_per_a: float,
        back_emf_constant_v_s_per_rad: float,
        rotor_inertia_kg_m2: float,
        viscous_friction_nm_s_per_rad: float,
        step_s: float,
        method: str = "backward_euler",
    ) -> None:
        """See `Link.set_parameters`; Km, Kb, J and B arrive through the ADC."""
        if "parameters" in self.stages:
            torque_constant_nm_per_a = self._read("km", torque_constant_nm_per_a)
            back_emf_constant_v_s_per_rad = self._read("kb", back_emf_constant_v_s_per_rad)
            rotor_inertia_kg_m2 = self._read("j", rotor_inertia_kg_m2)
            viscous_friction_nm_s_per_rad = self._read("b", viscous_friction_nm_s_per_rad)
        self.inner.set_parameters(
            resistance_ohm,
            inductance_h,
            torque_constant_nm_per_a,
            back_emf_constant_v_s_per_rad,
            rotor_inertia_kg_m2,
            viscous_friction_nm_s_per_rad,
            step_s,
            method,
        )

    def set_effects(
        self, left: UnitEffects | None, right: UnitEffects | None, supply: SupplyEffects | None = None
    ) -> None:
        """See `Link.set_effects`; registers carry them, unquantised."""
        self.inner.set_effects(left, right, supply)

    def set_resistances(self, ohm: tuple[float | None, float | None]) -> None:
        """See `rtds_host.link.configured.ConfiguredLink.set_resistances`; registers carry them, unquantised."""
        self.inner.set_resistances(ohm)  # type: ignore[attr-defined]

    def exchange(self, voltages: Vector, torques: Vector, interval_s: float, sample_s: float | None = None) -> Exchange:
        """See `Link.exchange`; inputs as the ADC reads them, samples as the DAC shows them."""
        if "voltages" in self.stages:
            voltages = [self._read(name, float(value)) for name, value in zip(("v_l", "v_r"), voltages, strict=True)]
        if "torques" in self.stages:
            torques = [self._read(name, float(value)) for name, value in zip(("t_l", "t_r"), torques, strict=True)]
        got = self.inner.exchange(voltages, torques, interval_s, sample_s)
        if "outputs" not in self.stages:
            return got
        shown = {}
        for name, values in zip(DAC_OUTPUTS, columns_of(got), strict=True):
            scale = self.scaling.output(name)
            code, saturated, _ = scale.encode(values)
            if saturated.any():
                self.clipped.add(name)
            shown[name] = scale.decode(code).astype(np.float32)
        return Exchange(
            got.t_s,
            speeds=np.stack([shown["w_l"], shown["w_r"]], axis=1),
            currents=np.stack([shown["i_l"], shown["i_r"]], axis=1),
        )


def columns_of(got: Exchange) -> tuple[np.ndarray, ...]:
    """The samples in the order of `DAC_OUTPUTS`."""
    return got.currents[:, 0], got.speeds[:, 0], got.currents[:, 1], got.speeds[:, 1]
