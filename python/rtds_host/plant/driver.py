"""Motor driver and supply: from a command to the voltage at a winding."""

from __future__ import annotations

import math

from rtds_host.plant.compiled import law


@law
def clipped(value, limit):
    """A value saturated at ±limit, in its unit (contract, section 1: a duty cycle is clipped to ±1)."""
    return min(max(value, -limit), limit)


@law
def duty(volts, supply, curve, deadzone, gain):
    """Output voltage of a driver with a nonlinear curve, a dead zone and a gain, V, at the nominal bus voltage.

    V = gain (u - sgn(u) min(|u|, deadzone)), u = v (1 + curve (1 - |v| / supply)). A negative dead zone subtracts
    |deadzone| sgn(u) instead, even where that changes the sign. volts : the command v, V; supply, deadzone : V; curve,
    gain : 1. Source: contract, section 3.
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
def fast_decay(volts, emf, bus, periods, exp_minus):
    """Mean voltage at a winding, V, over a PWM period of a bridge in fast decay: its current returns to the bus.

    With a duty cycle q = |volts| / bus the current rises from zero for q periods, falls against the bus for
    d = min(ln(1 + (bus - emf) (1 - exp(-q periods)) / (bus + emf)) / periods, 1 - q) of one, and is zero for what is
    left, in which the winding shows its back EMF: bus q - bus d + emf (1 - q - d). At the duty 0 the motor coasts.
    volts, emf, bus : V; periods : a PWM period over L / R, 1; exp_minus : the function y -> exp(-y) to use. Source:
    R. W. Erickson, D. Maksimovic, "Fundamentals of Power Electronics", 2001, chapter 5 (discontinuous conduction).
    """
    along = emf if volts > 0.0 else -emf
    on = min(abs(volts) / bus, 1.0)
    rises = max(bus - along, 0.0) * (1.0 - exp_minus(on * periods))
    # Numerical: a motor driven backwards faster than the bus allows has no finite time to lose its current.
    falls = min(math.log(1.0 + rises / max(bus + along, 1e-9 * bus)) / periods, 1.0 - on)
    mean = bus * (on - falls) + along * (1.0 - on - falls)
    return mean if volts > 0.0 else -mean


@law
def decay_adds(curved, plain, emf, bus, share, periods, exp_minus):
    """What a share of fast decay adds to a driver's voltage, V.

    curved, plain : V, behind dead zone and gain, with the driver's curve and without; share : 1; the rest as of
    `fast_decay`.
    """
    return share * (fast_decay(plain, emf, bus, periods, exp_minus) - curved)


@law
def after_bridge_drop(volts, emf, drop, knee, resistance):
    """Voltage at a winding, V, after the bridge's drop: V - drop tanh(i / knee), and V - drop sgn(i) without a knee
    (contract, section 3).

    volts, emf, drop : V; knee : A; resistance : of the winding, ohm. The current i has the sign of V - emf. Without a
    knee the drop is at most |V - emf|: it can stop the current, not reverse it. A negative drop is subtracted with its
    full size |drop|, even where that reverses the current. With a knee V - emf = R i + drop tanh(i / knee) is solved
    for the drop within 3 % of its full size, as long as the knee is no larger than drop / R.
    """
    u = volts - emf
    against = -drop if u > 0.0 else (drop if u < 0.0 else 0.0)
    against = min(max(u, -drop), drop) if drop > 0.0 else against
    whole = drop + knee * resistance
    per = 1.0 / whole if whole > 0.0 else 0.0
    x = u * per
    # Numerical: about here the largest error is smallest.
    bend = 0.22 * knee * resistance * per
    bent = 0.5 * drop * (math.sqrt((x + 1.0) * (x + 1.0) + bend) - math.sqrt((x - 1.0) * (x - 1.0) + bend))
    return volts - (bent if drop > 0.0 and knee > 0.0 else against)


@law
def winding_voltage(volts, emf, limit, drop, knee, resistance):
    """Voltage at a winding, V: the driver's output saturated at ±limit V, minus the bridge's drop.

    The rest as of `after_bridge_drop`.
    """
    return after_bridge_drop(clipped(volts, limit), emf, drop, knee, resistance)


@law
def amplifier(volts, limit, torque_per_volt):
    """Torque at the motor's shaft, N·m, of an ideal current amplifier (contract, section 7, torque mode).

    volts, limit : V; torque_per_volt : N·m/V.
    """
    return clipped(volts, limit) * torque_per_volt


@law
def unloaded_bus(supply, decline, elapsed):
    """Open-circuit bus voltage, V, `elapsed` s after a run's start: supply - decline t (contract, section 3).

    decline : rate of the battery's discharge, V/s.
    """
    return supply - decline * elapsed


@law
def loaded_bus(supply, source, current, decline, elapsed):
    """Bus voltage under load, V: supply - source i - decline t (contract, section 3).

    source : internal resistance of the supply, ohm; current : drawn from the bus, A; decline, elapsed : as of
    `unloaded_bus`.
    """
    return supply - source * current - decline * elapsed


@law
def bus_current(current, volts, supply):
    """Current that a bridge draws from its bus, A: i v / supply (pulse-width modulation, contract, section 3).

    current : in the winding, A; volts : commanded, V, so that v / supply is the duty cycle.
    """
    return current * volts / supply


@law
def sagging(supply, source, level, unloaded, current, slope):
    """Bus voltage under load, V, by one Newton step for bus = unloaded - source i(bus) (contract, section 3).

    supply : nominal, V; unloaded : open-circuit voltage, V; source : internal resistance, ohm; level : present iterate
    of the bus voltage over supply, 1; current : i at that voltage, A; slope : its derivative with respect to level, A.
    """
    return level * supply + (unloaded - source * current - level * supply) / (1.0 + source * slope / supply)


@law
def holding(current, speed, resistance, constant, damping, friction, gain, ki, limit):
    """A servo's integral, V, at the start of a run that begins in motion: the voltage that holds the speed.

    A log may begin anywhere in a motion, and says nothing of the integral. At a steady speed the control error is
    nearly zero, so the integral is nearly the whole voltage; a loop without one (ki = 0) has none.

    current : as measured, A; 0 where that says nothing, for what the torques need; speed : at the gear's output, rad/s;
    resistance : ohm; constant : V·s/rad and N·m/A there; damping : N·m·s/rad; friction : dry, N·m; gain : of the
    driver, 1; ki : V/rad; limit : of the integral, V.
    """
    if speed == 0.0 or ki == 0.0:
        return 0.0
    torque = damping * speed + math.copysign(friction, speed)
    taken = current if current != 0.0 else torque / constant
    return clipped((resistance * taken + constant * speed) / gain, limit)


@law
def servo(miss, integral, kp, ki, period, limit, release):
    """Voltage, V, and integral, V, of a saturated PI speed controller with anti-windup (contract, section 7).

    miss : control error, reference minus measured speed, rad/s; integral : before this sample, V; kp : V·s/rad; ki :
    V/rad; period : sampling period, s; limit : saturation of the integral and of the voltage, V; release : anti-windup
    gain, 1: the share of saturated minus unsaturated voltage that is added to the integral (back-calculation:
    K. J. Åström, R. M. Murray, "Feedback Systems", 2008, section 10.4).
    """
    integral = clipped(integral + ki * miss * period, limit)
    unsaturated = kp * miss + integral
    volts = clipped(unsaturated, limit)
    return volts, integral + release * (volts - unsaturated)
