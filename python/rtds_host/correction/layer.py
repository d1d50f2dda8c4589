"""What is between a motor unit and the physics engine: gear, tyre and scrub, at a small step.

The engine's wheels turn as they are told and answer with a torque; a spring, free play, a slipping tyre or a torque
against the yaw rate have no place in it, and fed back an exchange late they would ring. Here they are integrated with
the wheels and the body as the engine has them: its inertia at the wheels M is known, and what else it answered with
(the slope's pull, the centre of mass's) is E = torque - M acceleration, which changes slowly.

The same kernel is used twice an exchange. *Before*, with the motors' equations next to it, it predicts the mean torque
that will load each motor, so that a motor unit hears of its load in the exchange it acts in. *After*, with what the
rotors did as the link gave it, it finds what the wheels did. What was predicted wrongly is made good in the next
exchange: no angular momentum is lost. A rotor behind a rigid gear is taken at its word; one behind a spring or in
free play gets, here, each blow when it falls, while the link gets the mean of an exchange and catches up.

Speeds, torques and inertias are at the wheel's side of the gear, two-vectors are [left, right]. u is the wheel speed
that the ground corresponds to (rolling without slip); w is the wheel's own. Regimes and time stepping are those of
`rtds_host.plant` (references there).
"""

from __future__ import annotations

import math

import numpy as np

from rtds_host.plant import friction, gear, ground
from rtds_host.plant.compiled import loop

# Columns of a side's parameters.
STIFFNESS, DAMPING, BACKLASH, RESTITUTION, SLIP, SLIP_LENGTH, SLIP_DAMPING, RADIUS = range(8)
# Columns of a rotor's parameters; LEVEL_F and LEVEL_B hold it at rest against torques forwards and backwards.
INERTIA, VISCOUS, KM, KB, RESISTANCE, INDUCTANCE, LEVEL_F, LEVEL_B = range(8)
# Columns of a side's state: rotor's speed, wheel's, ground's, rotor's angle less the wheel's, shear of the tyre, and
# the torque it would give with all the grip there could be.
ROTOR, WHEEL, GROUND, PLAY, TYRE, WHOLE = range(6)

# What is known of a rotor: nothing but its motor's equations, its speed, or the impulse that drives it.
PREDICTED, GIVEN, DRIVEN = 0, 1, 2
# Inertia of a rotor whose speed is given: nothing can change it.
_IMMOVABLE = 1e6


@loop
def start_contact(side):
    """Regime of each gear at the start: rigid, spring, or in the middle of its free play."""
    contact = np.zeros(2, np.int64)
    for k in range(2):
        if side[k, STIFFNESS] > 0.0:
            contact[k] = gear.SPRING
        elif side[k, BACKLASH] > 0.0:
            contact[k] = gear.FREE
    return contact


@loop
def integrate(
    h,
    known,
    given,
    rotor,
    current,
    volts,
    disturbance,
    state,
    contact,
    side,
    wheel_j,
    inverse,
    lever,
    scrub,
    spin,
    grip,
    external,
):
    """Integrate n steps of length h.

    Parameters
    ----------
    known : (2,) PREDICTED, GIVEN or DRIVEN; both sides are predicted, or neither.
    given : (n, 2) for each step, speed rad/s at its end (GIVEN) or impulse N m s over it (DRIVEN).
    rotor : (2, 8) columns above; current (2,) A, volts (n, 2) V and disturbance (2,) N m, which brakes, for rotors
        predicted.
    state : (2, 6), contact : (2,), both changed in place. side : (2, 8). wheel_j : kg m², a wheel's own.
    inverse : (2, 2) of the body's inertia, wheels left out. lever : (2,) change of the yaw rate with u.
    scrub : N m against the yaw rate. spin : share of it that acts, -1 to 1, given unless rotors are predicted.
    grip : (2,) N m, what the torque of a slipping tyre tends to. external : (2,) N m that load the wheels.

    Returns
    -------
    mean torque (2,) N m that the gears delivered to the wheels, and the mean share of the scrub that acted.
    """
    n = volts.shape[0]
    predicted = known[0] == PREDICTED
    total = np.zeros(2)
    acted = 0.0
    w, wr, old_w, old_r = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    am, bm, alpha, beta, f = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    give, shift, amps = np.zeros(2), np.zeros(2), np.zeros(2)
    shear, tangent, taken, asked = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    stick, hi, lo = np.zeros(2, np.int64), np.zeros(2), np.zeros(2)
    bounces, apart = np.zeros(2, np.bool_), np.zeros(2)
    g00, g01, g11 = inverse[0, 0], inverse[0, 1], inverse[1, 1]
    gl0, gl1 = g00 * lever[0] + g01 * lever[1], g01 * lever[0] + g11 * lever[1]
    turn = lever[0] * gl0 + lever[1] * gl1
    for k in range(2):
        amps[k] = current[k]
        # 2: free to move; -1, 0, 1: at rest, or just leaving it.
        stick[k] = 0 if (state[k, ROTOR] == 0.0 and rotor[k, LEVEL_F] + rotor[k, LEVEL_B] > 0.0) else 2
    for step in range(n):
        for k in range(2):
            old_r[k], old_w[k] = state[k, ROTOR], state[k, WHEEL]
            bounces[k] = gear.bounces(contact[k] == gear.FREE, side[k, RESTITUTION], old_r[k], old_w[k])
            if known[k] == GIVEN:
                am[k], bm[k] = _IMMOVABLE, _IMMOVABLE * given[step, k]
                stick[k] = 2
            elif known[k] == DRIVEN:
                am[k] = rotor[k, INERTIA]
                bm[k] = am[k] * old_r[k] + given[step, k]
                stick[k] = 2
            else:
                electric = rotor[k, RESISTANCE] + rotor[k, INDUCTANCE] / h
                drive = rotor[k, KM] * (volts[step, k] + rotor[k, INDUCTANCE] / h * amps[k]) / electric
                am[k] = rotor[k, INERTIA] + h * (rotor[k, VISCOUS] + rotor[k, KM] * rotor[k, KB] / electric)
                if stick[k] == 2:
                    bm[k] = rotor[k, INERTIA] * old_r[k] + h * (drive - disturbance[k])
                else:
                    bm[k] = h * drive
                hi[k], lo[k] = h * rotor[k, LEVEL_F], -h * rotor[k, LEVEL_B]
            give[k] = shift[k] = 0.0
            if side[k, SLIP] > 0.0:
                # As in the replay's kernel, in torques and wheel speeds.
                radius = side[k, RADIUS]
                tau = ground.shear_time(side[k, SLIP_DAMPING], side[k, SLIP], side[k, SLIP_LENGTH])
                theta, shear[k] = ground.shear_step(h, tau)
                give[k], shift[k], tangent[k], taken[k] = ground.shear(
                    h,
                    side[k, SLIP] / (radius * radius),
                    side[k, SLIP_LENGTH],
                    theta,
                    shear[k],
                    grip[k],
                    state[k, WHOLE],
                    state[k, TYRE] / radius,
                    abs(radius * old_w[k]),
                    old_w[k] - state[k, GROUND],
                    math.tanh,
                )
        u0, u1 = state[0, GROUND], state[1, GROUND]
        rate = lever[0] * u0 + lever[1] * u1
        way = spin
        if scrub != 0.0 and predicted:
            way = friction.direction(rate)
        q = way * h * scrub
        for attempt in range(20):
            for k in range(2):
                kind = contact[k]
                p = 0.0 if stick[k] == 2 else friction.impulse(stick[k], hi[k], lo[k])
                held = stick[k] == 0
                if kind == gear.RIGID:
                    if held:
                        alpha[k], beta[k] = 0.0, 0.0
                    else:
                        a = am[k] + wheel_j
                        alpha[k], beta[k] = (bm[k] - p + wheel_j * old_w[k]) / a, h / a
                elif kind == gear.SPRING:
                    kap = gear.spring_gain(h, side[k, STIFFNESS], side[k, DAMPING])
                    t0 = gear.spring_start(side[k, STIFFNESS], state[k, PLAY], kap, old_r[k], old_w[k])
                    a = am[k] + h * kap
                    r0 = 0.0 if held else (bm[k] - p - h * t0) / a
                    r1 = 0.0 if held else h * kap / a
                    d = wheel_j + h * kap * (1.0 - r1)
                    alpha[k], beta[k] = (wheel_j * old_w[k] + h * t0 + h * kap * r0) / d, h / d
                elif kind == gear.FREE:
                    alpha[k], beta[k] = old_w[k], h / wheel_j
                else:
                    # What the rotor is faster than the wheel afterwards.
                    forwards = kind == gear.PUSH_F
                    meets = bounces[k] and (old_r[k] > old_w[k]) == forwards
                    to_flank = gear.flank(side[k, BACKLASH], forwards) - state[k, PLAY]
                    apart[k] = gear.parting(to_flank, h, side[k, RESTITUTION], old_r[k], old_w[k], meets)
                    if held:
                        alpha[k], beta[k] = -apart[k], 0.0
                    else:
                        a = am[k] + wheel_j
                        alpha[k] = (bm[k] - p + wheel_j * old_w[k] - am[k] * apart[k]) / a
                        beta[k] = h / a
            e0, e1 = external[0], external[1]
            a00, a11, a01 = beta[0] + give[0] + h * g00, beta[1] + give[1] + h * g11, h * g01
            det = a00 * a11 - a01 * a01
            for again_scrub in range(2):
                b0 = alpha[0] - u0 + ground.rim_moves(h, g00, g01, e0, e1) + gl0 * q - shift[0]
                b1 = alpha[1] - u1 + ground.rim_moves(h, g01, g11, e0, e1) + gl1 * q - shift[1]
                f[0], f[1] = (a11 * b0 - a01 * b1) / det, (a00 * b1 - a01 * b0) / det
                asked[0], asked[1] = f[0], f[1]
                f[0], f[1] = ground.on_ground(
                    f[0], f[1], b0, b1, a00, a11, a01, side[0, SLIP], side[1, SLIP], grip[0], grip[1]
                )
                n0 = u0 + ground.rim_moves(h, g00, g01, f[0] - e0, f[1] - e1) - gl0 * q
                n1 = u1 + ground.rim_moves(h, g01, g11, f[0] - e0, f[1] - e1) - gl1 * q
                new_rate = lever[0] * n0 + lever[1] * n1
                if not predicted or scrub == 0.0 or again_scrub == 1 or way * new_rate > 0.0:
                    break
                # The scrub would turn the robot back: the impulse that just stops it, within its bound.
                f0, f1 = (a11 * gl0 - a01 * gl1) / det, (a00 * gl1 - a01 * gl0) / det
                gain = ground.rim_moves(h, gl0, gl1, f0, f1) - turn
                q = ground.stopping(q, new_rate, gain, h * scrub, turn)
            again = False
            for k in range(2):
                w[k] = alpha[k] - beta[k] * f[k]
                kind = contact[k]
                need = 0.0
                p = 0.0 if stick[k] == 2 else friction.impulse(stick[k], hi[k], lo[k])
                if kind == gear.RIGID:
                    wr[k] = w[k]
                    need = bm[k] + wheel_j * old_w[k] - h * f[k]
                elif kind == gear.SPRING:
                    kap = gear.spring_gain(h, side[k, STIFFNESS], side[k, DAMPING])
                    t0 = gear.spring_start(side[k, STIFFNESS], state[k, PLAY], kap, old_r[k], old_w[k])
                    need = bm[k] - h * (t0 - kap * w[k])
                    wr[k] = 0.0 if stick[k] == 0 else (bm[k] - p - h * t0 + h * kap * w[k]) / (am[k] + h * kap)
                elif kind == gear.FREE:
                    need = bm[k]
                    wr[k] = 0.0 if stick[k] == 0 else (bm[k] - p) / am[k]
                    moved = state[k, PLAY] + h * (wr[k] - w[k])
                    if moved > gear.flank(side[k, BACKLASH], True):
                        contact[k] = gear.PUSH_F
                        again = True
                    elif moved < gear.flank(side[k, BACKLASH], False):
                        contact[k] = gear.PUSH_B
                        again = True
                else:
                    wr[k] = w[k] + apart[k]
                    push = wheel_j * (w[k] - old_w[k]) + h * f[k]
                    need = bm[k] - push
                    # A gear can push but not pull.
                    if ((kind == gear.PUSH_F and push < 0.0) or (kind == gear.PUSH_B and push > 0.0)) and attempt < 10:
                        contact[k] = gear.FREE
                        again = True
                if stick[k] == 0:
                    stick[k] = int(friction.breaks_away(need, hi[k], lo[k]))
                    again = again or stick[k] != 0
                elif stick[k] != 2 and stick[k] * wr[k] < 0.0 and attempt < 10:
                    stick[k] = 0
                    again = True
            if not again:
                break
        for k in range(2):
            total[k] += wheel_j * (w[k] - old_w[k]) / h + f[k]
            if predicted:
                electric = rotor[k, RESISTANCE] + rotor[k, INDUCTANCE] / h
                amps[k] = (volts[step, k] + rotor[k, INDUCTANCE] / h * amps[k] - rotor[k, KB] * wr[k]) / electric
            if contact[k] == gear.SPRING:
                state[k, PLAY] = gear.spring_play(state[k, PLAY], h, old_r[k], wr[k], old_w[k], w[k])
            elif contact[k] >= gear.PUSH_F and bounces[k] and (wr[k] > w[k]) != (contact[k] == gear.PUSH_F):
                at_flank = gear.flank(side[k, BACKLASH], contact[k] == gear.PUSH_F)
                state[k, PLAY] = gear.bounced_play(at_flank, state[k, PLAY], h, old_r[k], old_w[k], apart[k])
                contact[k] = gear.FREE
            elif contact[k] != gear.RIGID:
                state[k, PLAY] += h * (wr[k] - w[k])
            state[k, ROTOR], state[k, WHEEL] = wr[k], w[k]
            if side[k, SLIP] > 0.0:
                state[k, WHOLE] = ground.sheared(state[k, WHOLE], asked[k], taken[k], tangent[k], grip[k])
                whole = state[k, WHOLE] / side[k, RADIUS]
                state[k, TYRE] = ground.relaxed(h, state[k, TYRE], side[k, SLIP], whole, shear[k])
        state[0, GROUND], state[1, GROUND] = n0, n1
        acted += q / (h * scrub) if scrub != 0.0 else 0.0
    return total / n, acted / n
