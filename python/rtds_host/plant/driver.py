"""Driver and supply: from a command to the voltage at a winding."""

from __future__ import annotations

import math

from rtds_host.plant.compiled import law


@law
def clipped(value, limit):
    """A value within -limit and limit, in its unit (contract, section 1: a duty is clipped to ±1)."""
    return min(max(value, -limit), limit)


@law
def duty(volts, supply, curve, deadzone, gain):
    """Voltage behind a driver's curve, dead zone and gain, V, at the nominal bus.

    V = gain (u - sgn(u) min(|u|, deadzone)), u = v (1 + curve (1 - |v| / supply)); a deadzone below zero adds to the
    command. volts, supply, deadzone : V; curve, gain : 1. Source: contract, section 3.
    """
    if curve != 0.0:
        volts *= 1.0 + curve * (1.0 - min(abs(volts) / supply, 1.0))
    if deadzone != 0.0:
        volts -= (
            math.copysign(min(abs(volts), deadzone), volts)
            if deadzone > 0.0
            else (math.copysign(deadzone, volts) if volts != 0.0 else 0.0)
        )
    return volts * gain


@law
def after_bridge_drop(volts, emf, drop):
    """Voltage at a winding, V, behind a drop against its current: V - drop sgn(i) (contract, section 3).

    A drop above zero goes as far as stopping the current; one below zero has its size whatever the current. All in V.
    """
    u = volts - emf
    against = -drop if u > 0.0 else (drop if u < 0.0 else 0.0)
    return volts - (min(max(u, -drop), drop) if drop > 0.0 else against)


@law
def winding_voltage(volts, emf, limit, drop):
    """Voltage at a winding, V, of what a driver is asked for: within its limit, less its drop. All in V."""
    return after_bridge_drop(clipped(volts, limit), emf, drop)


@law
def amplifier(volts, limit, torque_per_volt):
    """Torque at the motor's shaft, N·m, of an ideal current amplifier (contract, section 7, torque mode).

    volts, limit : V; torque_per_volt : N·m/V.
    """
    return clipped(volts, limit) * torque_per_volt


@law
def unloaded_bus(supply, decline, elapsed):
    """Bus without a load, V, `elapsed` s after a run began: supply - decline t (contract, section 3). decline : V/s."""
    return supply - decline * elapsed


@law
def loaded_bus(supply, source, current, decline, elapsed):
    """Bus at a current drawn, V: supply - source i - decline t (contract, section 3). source : ohm; current : A."""
    return supply - source * current - decline * elapsed


@law
def bus_current(current, volts, supply):
    """Current that a bridge draws from its bus, A: i v / supply (pulse-width modulation, contract, section 3)."""
    return current * volts / supply


@law
def sagging(supply, source, level, unloaded, current, slope):
    """Bus under load, V, by one step of Newton: bus = unloaded - source i(bus) (contract, section 3).

    supply, unloaded : V; source : ohm; level : the bus before over the supply, 1; current : A at that bus; slope : A,
    by how much it grows with the level. A higher bus drives more current, which lowers it.
    """
    return level * supply + (unloaded - source * current - level * supply) / (1.0 + source * slope / supply)


@law
def servo(miss, integral, kp, ki, period, limit, release):
    """Voltage, V, and integral, V, of a saturated PI controller on a speed's error (contract, section 7, speed mode).

    miss : rad/s; kp : V·s/rad; ki : V/rad; period : s; limit : V on the integral and on the voltage; release : share of
    what the limit cuts by which the integral gives way (back-calculation: K. J. Åström, R. M. Murray, "Feedback
    Systems", 2008, section 10.4).
    """
    integral = clipped(integral + ki * miss * period, limit)
    wanted = kp * miss + integral
    volts = clipped(wanted, limit)
    return volts, integral + release * (volts - wanted)
