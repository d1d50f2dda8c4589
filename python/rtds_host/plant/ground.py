"""Wheels on the ground and the body on its wheels.

The body's inverse inertia for (v, yaw rate) is [[i11, i12], [i12, i22]]; `half` is half of the track, m. A tyre's slip
is transient (H. B. Pacejka, "Tire and Vehicle Dynamics", 2012, sections 7.2.1 and 8.6): z' = slip speed - |r w| z /
length, F0 = K (z + tau z'), K = 1 / (k length); the ground takes F = grip tanh(F0 / grip), so that in slow steady
rolling F = slip / k. The state is z / length, which stays finite as the length goes. tanh is taken as its tangent at
the F0 of the step before.
"""

from __future__ import annotations

import math

from rtds_host.contract import GRAVITY_M_S2
from rtds_host.plant.compiled import law

# Numerical: a tyre that slides counts as if its force still grew with its shear by this share, so that it is found
# again.
FLAT = 0.02
# Numerical: and its shear is that of so many times the grip at most.
SLIDING = 20.0


@law
def along_slope(mass, angle, sin):
    """Weight along a slope, N: m g sin(slope) (contract, section 2). mass : kg; angle : rad; sin : the sine to use."""
    return mass * GRAVITY_M_S2 * sin(angle)


@law
def pendulum(mass, arm, angle, sin):
    """Torque of gravity at a pendulum's axis, N·m: -m g l sin(angle from hanging down) (contract, section 7)."""
    return -mass * GRAVITY_M_S2 * arm * sin(angle)


@law
def grip_of(coefficient, mass):
    """Largest traction of a wheel, N, with half of the robot's weight on it (Coulomb); mass : kg."""
    return coefficient * mass * GRAVITY_M_S2 * 0.5


@law
def offset_forces(mass, com_x, v, rate):
    """Force, N, and torque, N·m, on the axle's mid-point of a centre of mass ahead of it: m x r², -m x v r.

    com_x : m; v : m/s; rate : rad/s. Source: contract, section 3, `com_offset`.
    """
    return mass * com_x * rate * rate, -mass * com_x * v * rate


@law
def slope_torque(pull, com_x, com_y, along, across):
    """Torque of a slope's pull about the axle's mid-point, N·m; along, across : uphill's direction seen by the body."""
    return pull * (com_x * across + com_y * along)


@law
def wheel_moves(h, i11, i12, i22, half):
    """Change of the rims' speeds by forces at both rims over a step, 1/kg·s: left, right, and each by the other's."""
    return (
        h * (i11 - 2.0 * half * i12 + half * half * i22),
        h * (i11 + 2.0 * half * i12 + half * half * i22),
        h * (i11 - half * half * i22),
    )


@law
def body_moves(h, i11, i12, i22, push, turn, brake):
    """Changes of v, m/s, and of the yaw rate, rad/s, by forces on the body over a step.

    push : N; turn : N·m; brake : impulse against the yaw rate, N·m·s.
    """
    return h * (i11 * push + i12 * turn) - i12 * brake, h * (i12 * push + i22 * turn) - i22 * brake


@law
def rim_moves(h, own, other, force, force_other):
    """Change of a rim's speed by forces at both over a step: h (own f + other f'), own and other as `wheel_moves` / h.

    force, force_other : at this rim and at the other, N (or torques at wheels, N·m, for their speeds, rad/s).
    """
    return h * (own * force + other * force_other)


@law
def rim_gaps(v, rate, half, dv, dr, rim0, rim1, yields0, yields1):
    """By how much both rims would be faster than the ground under them without traction at the end of a step, m/s.

    v, rate : of the body as the step begins, m/s and rad/s; dv, dr : their changes without traction; rim0, rim1 : the
    rims' speeds without traction; yields0, yields1 : what the tyres' shear takes, m/s.
    """
    return (
        rim0 - (v - half * rate) - dv + half * dr - yields0,
        rim1 - (v + half * rate) - dv - half * dr - yields1,
    )


@law
def tractions(a00, a11, wx, det, b0, b1):
    """Tractions at both rims, N, for changes b0, b1 of their speeds, m/s: Cramer's rule for two wheels on one body.

    a00, a11, wx : resistance of both rims to forces, each to its own and to the other's; det : inverse of their
    determinant.
    """
    return (a11 * b0 - wx * b1) * det, (a00 * b1 - wx * b0) * det


@law
def yawed(h, i12, i22, half, left, right):
    """Change of the yaw rate, rad/s, by tractions at both wheels over a step, N."""
    return h * (i12 * (left + right) + i22 * half * (right - left))


@law
def pushed(h, i11, i12, half, left, right):
    """Change of v, m/s, by tractions at both wheels over a step, N."""
    return h * (i11 * (left + right) + i12 * half * (right - left))


@law
def scrub_gain(h, i12, i22, half, a00, a11, wx, det):
    """Change of the yaw rate, rad/s, by an impulse of 1 N·m·s against it, with wheels that answer by their tractions.

    a00, a11, wx, det : as in `tractions`.
    """
    left, right = tractions(a00, a11, wx, det, i12 - half * i22, i12 + half * i22)
    return yawed(h, i12, i22, half, left, right) - i22


@law
def stopping(brake, rate, gain, most, i22):
    """Impulse of the scrub, N·m·s, that stops a turn within its bound; two wheels that stick hold it by themselves.

    brake : impulse that would reverse the turn; rate : rad/s it would leave; most : bound. Source: contract, section 3.
    """
    return min(max(brake - rate / gain, -most), most) if gain < -1e-9 * i22 else 0.0


@law
def shear_step(h, tau):
    """The theta method's weight of a step's end in a tyre's equation, and its factor 1 / (theta h + tau), 1/s.

    tau : damping over stiffness, s. 0.5 is the mid-point rule; towards 1, the implicit Euler method, it goes where
    damping is too little (E. Hairer, G. Wanner, "Solving ODEs II", 1996, section IV.2).
    """
    theta = max(0.5, 1.0 - tau / h)
    return theta, 1.0 / (theta * h + tau)


@law
def shear_time(damping, slip, length):
    """A tyre's damping over its stiffness, s; damping : N·s/m; slip : 1/N; length : m."""
    return damping * slip * length


@law
def shear(h, slip, length, theta, factor, grip, whole, tyre, rolled, slid, tanh):
    """A tyre's answer to a force over a step, linear about the force before.

    slip : 1/N; length : m; theta, factor : of `shear_step`; grip, whole : N, the largest force and the one that the
    shear would give with all the grip there could be; tyre : shear over length, 1; rolled : |r w|, m/s; slid : speed of
    the rim over the ground, m/s; tanh : to use. Returns give (m/s/N), yields (m/s), tangent (1) and taken (N).
    """
    path = (length + theta * h * rolled) * factor
    bent = tanh(whole / grip)
    tangent = max(1.0 - bent * bent, FLAT)
    taken = grip * bent
    give = slip * path / tangent / theta
    yields = (slip * path * (whole - taken / tangent) + (rolled - path) * tyre - (1.0 - theta) * slid) / theta
    return give, yields, tangent, taken


@law
def sheared(whole, asked, taken, tangent, grip):
    """Force that a tyre's shear would give after a step, N, bounded; asked : the traction that was asked for."""
    most = SLIDING * grip
    return min(max(whole + (asked - taken) / tangent, -most), most)


@law
def relaxed(h, tyre, slip, whole, factor):
    """A tyre's shear over its length after a step, 1."""
    return tyre + h * (whole * slip - tyre) * factor


@law
def on_ground(f0, f1, b0, b1, a00, a11, wx, slip0, slip1, grip0, grip1):
    """Tractions, N, of tyres that slip within what they can hold: a tyre without length has no shear at rest.

    f : tractions that solve [[a00, wx], [wx, a11]] f = b without a bound; a wheel without slip has none.
    """
    slides = slip0 > 0.0 and abs(f0) > grip0
    f0 = math.copysign(grip0, f0) if slides else f0
    f1 = (b1 - wx * f0) / a11 if slides else f1
    slides = slip1 > 0.0 and abs(f1) > grip1
    f1 = math.copysign(grip1, f1) if slides else f1
    f0 = (b0 - wx * f1) / a00 if slides else f0
    held = min(max(f0, -grip0), grip0)
    return held if slip0 > 0.0 else f0, f1
