"""A torque that repeats with the wheel's angle."""

from __future__ import annotations

from rtds_host.plant.compiled import law
from rtds_host.plant.entry import RTL, Entry
from rtds_host.plant.torque import ANGLE, Torque


@law
def ripple(angle, amplitude, cycles, phase, sin):
    """Torque that repeats with the wheel's angle, N·m: A sin(n th + phi) (formats, section 3).

    angle, phase : rad; amplitude : N·m; cycles : periods a turn, 1; sin : the sine to use.
    """
    return amplitude * sin(cycles * angle + phase)


TORQUE = Torque(
    ripple,
    (
        Entry("ripple", "N·m", 0.0, RTL, "ripple_nm", "amplitude"),
        Entry("ripple_cycles", "1/rev", 1.0, RTL, "ripple_cycles", "of the wheel"),
        Entry("ripple_phase", "rad", 0.0, RTL, "ripple_phase_rad", ""),
    ),
    ANGLE,
    cycles="ripple_cycles",
    phase="ripple_phase",
)
