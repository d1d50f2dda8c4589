"""A torque that repeats with the wheel's angle."""

from __future__ import annotations

import math

from rtds_host.plant.compiled import law
from rtds_host.plant.entry import RTL, Entry
from rtds_host.plant.torque import ANGLE, Torque


@law
def ripple(angle, amplitude, cycles, phase, in_phase, in_quadrature, sin):
    """Torque that repeats with the wheel's angle, N·m: A (sin x + p sin 2x + q cos 2x), x = n th + phi.

    angle, phase : rad; amplitude : A, N·m; cycles : n, periods a turn, 1; in_phase, in_quadrature : p and q, the second
    harmonic's shares of A, 1, 0 in the formats (section 3); sin : the sine to use. Cogging and gear mesh have
    harmonics: Z. Q. Zhu, D. Howe, IEEE Trans. Energy Convers. 15(4), 2000.
    """
    at = cycles * angle + phase
    sine = sin(at)
    cosine = sin(at + 0.5 * math.pi)
    return amplitude * (sine + 2.0 * in_phase * sine * cosine + in_quadrature * (1.0 - 2.0 * sine * sine))


TORQUE = Torque(
    ripple,
    (
        Entry("ripple", "N·m", 0.0, RTL, "ripple_nm", "amplitude"),
        Entry("ripple_cycles", "1/rev", 1.0, RTL, "ripple_cycles", "of the wheel"),
        Entry("ripple_phase", "rad", 0.0, RTL, "ripple_phase_rad", ""),
        Entry("ripple_in_phase", "1", 0.0, RTL, "ripple_in_phase", "share of the second harmonic"),
        Entry("ripple_in_quadrature", "1", 0.0, RTL, "ripple_in_quadrature", "share of the second harmonic"),
    ),
    ANGLE,
    cycles="ripple_cycles",
    phase="ripple_phase",
)
