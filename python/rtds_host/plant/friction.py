"""Friction of rotor and gear, at the wheel's side.

Dry friction is a complementarity condition on the speed at the end of a step (J. J. Moreau, "Unilateral contact and dry
friction in finite freedom dynamics", 1988): forwards, stuck or backwards, as 1, 0 and -1.
"""

from __future__ import annotations

from rtds_host.contract import GRAVITY_M_S2
from rtds_host.plant.compiled import law


@law
def direction(speed):
    """1, 0 or -1: forwards, at rest, backwards; as a number that a loop over replays can hold."""
    return 1.0 if speed > 0.0 else (-1.0 if speed < 0.0 else 0.0)


@law
def viscous(fluid, asymmetry, speed):
    """Viscous friction, N·m·s/rad, that differs by direction: fluid + sgn(w) asymmetry (contract, section 3)."""
    return fluid + (asymmetry if speed > 0.0 else (-asymmetry if speed < 0.0 else 0.0))


@law
def stribeck(relative, extra, exp_minus):
    """Dry friction beyond Coulomb's near rest, N·m: extra exp(-(w / w_s)²) (contract, section 3).

    relative : w / w_s, 1; extra : N·m; exp_minus : the function y -> exp(-y) to use.
    """
    return extra * exp_minus(relative * relative)


@law
def rolling(coefficient, mass, radius):
    """Rolling resistance as dry friction of a wheel, N·m: c m g / 2 at its rim (contract, section 3).

    coefficient : 1; mass : kg on both wheels; radius : m.
    """
    return coefficient * mass * GRAVITY_M_S2 * 0.5 * radius


@law
def by_load(share, before, behind):
    """Dry friction of a gear, N·m, that grows with the torque it carries: a share of the larger of its two sides'.

    share : 1; before, behind : N·m (contract, section 3).
    """
    return share * max(abs(before), abs(behind))


@law
def bounds(h, dry, asymmetry):
    """Impulses of dry friction over a step, N·m·s, while turning forwards and backwards.

    dry, asymmetry : N·m; asymmetry : forwards less backwards, halved (contract, section 3).
    """
    return h * (dry + asymmetry), -h * (dry - asymmetry)


@law
def impulse(stick, forwards, backwards):
    """Impulse of dry friction, N·m·s, of a rotor that slides in direction `stick` (0: its bearing holds it)."""
    return forwards if stick > 0.0 else (backwards if stick < 0.0 else 0.0)


@law
def breaks_away(need, forwards, backwards):
    """Direction in which a held rotor breaks away, 0 while friction holds it; all N·m·s (need: to hold it)."""
    return 1.0 if need > max(forwards, 0.0) else (-1.0 if need < min(backwards, 0.0) else 0.0)
