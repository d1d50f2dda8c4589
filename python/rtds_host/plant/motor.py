"""Winding and rotor of a DC motor, by steps.

The armature's equation L i' = V - R i - Kb w is solved exactly over a step in which the speed moves linearly. The rotor
follows the implicit mid-point rule (E. Hairer, G. Wanner, "Solving ODEs II", 1996). Speeds, torques and inertias are at
the wheel's side of the gear; `ke` is Kb times the gear ratio, V·s/rad.
"""

from __future__ import annotations

from rtds_host.plant.compiled import law


@law
def warm(resistance, rise):
    """Resistance of a warm winding, ohm: R (1 + rise) (contract, section 3). rise : 1."""
    return resistance * (1.0 + rise)


@law
def armature_slopes(emf_current, decay, mean_i):
    """c1 and m1 of `armature_factors`, A·s/rad.

    emf_current : A·s/rad, back-EMF a speed over the resistance; decay, mean_i : as returned there.
    """
    c1 = emf_current * (1.0 - (1.0 - decay) * mean_i)
    return c1, 0.5 * emf_current - mean_i * c1


@law
def armature_factors(h, resistance, inductance, ke, exp_minus):
    """Factors of the armature's exact solution over a step of h s, see `armature`.

    resistance : ohm; inductance : H; exp_minus : the function y -> exp(-y) to use. Returns decay exp(-h R / L) (1),
    rise_v (1/ohm), mean_v (1/ohm), mean_i (1), c1 (A·s/rad) and m1 (A·s/rad).
    """
    decay = exp_minus(h * resistance / inductance)
    rise_v = (1.0 - decay) / resistance
    mean_v = 1.0 / resistance
    mean_i = inductance / (h * resistance)
    c1, m1 = armature_slopes(ke / resistance, decay, mean_i)
    return decay, rise_v, mean_v, mean_i, c1, m1


@law
def armature(current, volts, ke, w, decay, rise_v, mean_v, mean_i, c1):
    """Current, A, at a step's end and in its mean, as far as the rotor's speed at the end does not matter.

    End: c0 - c1 w_end; mean: m0 - m1 w_end. current : A and w : rad/s as the step begins; volts : V over it; factors of
    `armature_factors`. Returns c0, m0.
    """
    c0 = decay * current + rise_v * (volts - ke * w) + c1 * w
    return c0, mean_i * (current - c0) + mean_v * (volts - 0.5 * ke * w)


@law
def even_current(current, volts, emf, decay, rise_v, mean_v, mean_i):
    """Mean current of a step, A, at the speed it begins with; current : A, volts and emf : V."""
    end = decay * current + rise_v * (volts - emf)
    return mean_i * (current - end) + mean_v * (volts - emf)


@law
def bus_current_slope(mean_v, mean_i, rise_v, behind, asked, supply):
    """By how much more is drawn from the bus at a higher level of it, A: see `driver.sagging`.

    behind, asked : V, behind the driver's curve and before it, at the nominal bus.
    """
    return (mean_v - mean_i * rise_v) * behind * asked / supply


@law
def rotor_balance(h, inertia, fluid, torque, slope, w):
    """am (kg·m²) and bm (N·m·s) of a rotor alone: am w_end = bm, implicit mid-point.

    J w' = torque - slope w_end - fluid w. inertia : kg·m²; fluid, slope : N·m·s/rad; torque : N·m; w : rad/s as the
    step begins. Source: contract, section 2.
    """
    return inertia + 0.5 * h * fluid + h * slope, inertia * w + h * (torque - 0.5 * fluid * w)


@law
def gear_input(h, torque, fluid, inertia, before, after):
    """Torque that a rotor passes on to its gear over a step, N·m: torque - fluid w - J w' at the mid-point.

    torque : N·m, of the motor; fluid : N·m·s/rad; inertia : kg·m²; before, after : rad/s; all at the wheel's side.
    """
    return torque - 0.5 * fluid * (before + after) - inertia * (after - before) / h


@law
def warmer(rise, h, heat, tau, current, resistance):
    """Relative rise of a winding's resistance after a step: rise' = (heat i² R - rise) / tau (contract, section 3).

    h, tau : s; heat : 1/W; current : A in the mean; resistance : ohm.
    """
    return rise + h * (heat * current * current * resistance - rise) / tau
