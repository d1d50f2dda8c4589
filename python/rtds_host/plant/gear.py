"""Gear between rotor and wheel: a spring with damping, or free play between two flanks that push.

Play is the rotor's angle less the wheel's, rad, at the wheel's side. The spring follows the implicit mid-point rule; a
flank is a complementarity condition on the velocities at a step's end (J. J. Moreau, 1988).
"""

from __future__ import annotations

from rtds_host.plant.compiled import law

# Regimes of a gear in a step: rigid, spring, free play (free, pushing forwards, pushing backwards).
RIGID, SPRING, FREE, PUSH_F, PUSH_B = 0, 1, 2, 3, 4
# Numerical: flanks that meet more slowly stay together.
BOUNCE_RAD_S = 0.05


@law
def spring_gain(h, stiffness, damping):
    """Torque of a spring by the difference of speeds at a step's end, N·m·s/rad: h c / 4 + d / 2.

    stiffness : N·m/rad; damping : N·m·s/rad. The mean torque of a step is `spring_start` + gain (rotor - wheel).
    """
    return 0.25 * h * stiffness + 0.5 * damping


@law
def spring_start(stiffness, play, gain, rotor, wheel):
    """Mean torque of a spring over a step, N·m, as far as speeds at its end do not matter; rotor, wheel : rad/s."""
    return stiffness * play + gain * (rotor - wheel)


@law
def held_gain(h, load, gain):
    """Change of a wheel's speed by an impulse, 1/(kg·m²), behind a spring whose rotor is held; load : kg·m²."""
    return 1.0 / (load + h * gain)


@law
def behind_gain(h, load, gain, rotor_gain):
    """The same with a rotor that follows; rotor_gain : 1/(kg·m²), its own next to the spring."""
    return 1.0 / (load + h * gain * (1.0 - h * gain * rotor_gain))


@law
def spring_play(play, h, rotor_before, rotor, wheel_before, wheel):
    """Play of a spring after a step, rad; speeds, rad/s, before and after."""
    return play + 0.5 * h * (rotor_before + rotor - wheel_before - wheel)


@law
def flank(backlash, forwards):
    """Play at which a flank is met, rad: half of the total to either side."""
    return 0.5 * backlash if forwards else -0.5 * backlash


@law
def bounces(free, restitution, rotor, wheel):
    """Whether flanks that meet in this step part again: free play, and faster than they would stay together."""
    return free and restitution > 0.0 and abs(rotor - wheel) > BOUNCE_RAD_S


@law
def parting(to_flank, h, restitution, rotor, wheel, meets):
    """How much faster the rotor is than the wheel, rad/s, after a step in contact.

    Without a bounce it reaches the flank, `to_flank` rad away, in h s. With one, Newton's law of impact: the relative
    speed turns round and keeps a share `restitution` (W. Goldsmith, "Impact", 1960).
    """
    return restitution * (wheel - rotor) if meets else to_flank / h


@law
def bounced_play(at_flank, play, h, rotor, wheel, apart):
    """Play after a step with a bounce, rad: to the flank at the speeds before, and back for the rest of the step."""
    return at_flank + (h - min(max((at_flank - play) / (rotor - wheel), 0.0), h)) * apart
