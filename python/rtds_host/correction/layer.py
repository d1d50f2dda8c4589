"""What stands between a motor unit and the physics engine: gear, tyre and scrub, at a small step.

The engine's wheels turn as they are told and answer with a torque; a spring, free play, a slipping tyre or a torque
against the yaw rate have no place in it, and fed back an exchange late they would ring. Here they are integrated with
the wheels and the body as the engine has them: its inertia at the wheels M is known, and what else it answered with
(the slope's pull, the centre of mass's) is E = torque - M acceleration, which changes slowly.

The same kernel is used twice an exchange. *Before*, with the motors' equations beside it, it foretells the mean torque
that will load each motor, so that a motor unit hears of its load in the exchange it acts in. *After*, with what the
rotors did as the link gave it, it finds what the wheels did. What was foretold wrongly is made good in the next
exchange: no angular momentum is lost. A rotor behind a rigid gear is taken at its word; one behind a spring or in
free play gets, here, each blow when it falls, while the link gets the mean of an exchange and catches up.

Speeds, torques and inertias are at the wheel's side of the gear, two-vectors are [left, right]. u is the wheel speed
that the ground corresponds to (rolling without slip); w is the wheel's own. Regimes and time stepping are those of
`rtds_host.diagnosis.replay.kernel` (references there).
"""

from __future__ import annotations

import math

import numba
import numpy as np

from rtds_host.plant.gear import BOUNCE_RAD_S
from rtds_host.plant.ground import FLAT, SLIDING

# Columns of a side's parameters.
STIFFNESS, DAMPING, BACKLASH, RESTITUTION, SLIP, SLIP_LENGTH, SLIP_DAMPING, RADIUS = range(8)
# Columns of a rotor's parameters; LEVEL_F and LEVEL_B hold it at rest against torques forwards and backwards.
INERTIA, VISCOUS, KM, KB, RESISTANCE, INDUCTANCE, LEVEL_F, LEVEL_B = range(8)
# Columns of a side's state: rotor's speed, wheel's, ground's, rotor's angle less the wheel's, shear of the tyre, and
# the torque it would give with all the grip there could be.
ROTOR, WHEEL, GROUND, PLAY, TYRE, WHOLE = range(6)

_RIGID, _SPRING, _FREE, _PUSH_F, _PUSH_B = 0, 1, 2, 3, 4
# What is known of a rotor: nothing but its motor's equations, its speed, or the impulse that drives it.
FORETOLD, GIVEN, DRIVEN = 0, 1, 2
# Inertia of a rotor whose speed is given: nothing can change it.
_IMMOVABLE = 1e6


@numba.njit(cache=True, error_model="numpy")
def start_contact(side):
    """Regime of each gear at the start: rigid, spring, or in the middle of its free play."""
    contact = np.zeros(2, np.int64)
    for k in range(2):
        if side[k, STIFFNESS] > 0.0:
            contact[k] = _SPRING
        elif side[k, BACKLASH] > 0.0:
            contact[k] = _FREE
    return contact


@numba.njit(cache=True, error_model="numpy")
def roll(
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
    ground,
    lever,
    scrub,
    spin,
    grip,
    external,
):
    """Integrate n steps of length h.

    Parameters
    ----------
    known : (2,) FORETOLD, GIVEN or DRIVEN; both sides are foretold, or neither.
    given : (n, 2) for each step, speed rad/s at its end (GIVEN) or impulse N m s over it (DRIVEN).
    rotor : (2, 8) columns above; current (2,) A, volts (n, 2) V and disturbance (2,) N m, which brakes, for rotors
        foretold.
    state : (2, 6), contact : (2,), both changed in place. side : (2, 8). wheel_j : kg m², a wheel's own.
    ground : (2, 2) inverse of the body's inertia, wheels left out. lever : (2,) change of the yaw rate with u.
    scrub : N m against the yaw rate. spin : share of it that acts, -1 to 1, where rotors are not foretold (else found).
    grip : (2,) N m, what the torque of a slipping tyre tends to. external : (2,) N m that load the wheels.

    Returns
    -------
    mean torque (2,) N m that the gears delivered to the wheels, and the mean share of the scrub that acted.
    """
    n = volts.shape[0]
    foretold = known[0] == FORETOLD
    total = np.zeros(2)
    acted = 0.0
    w, wr, old_w, old_r = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    am, bm, alpha, beta, f = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    give, shift, amps = np.zeros(2), np.zeros(2), np.zeros(2)
    late, shear, tangent, taken, asked = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    stick, hi, lo = np.zeros(2, np.int64), np.zeros(2), np.zeros(2)
    bounces, apart = np.zeros(2, np.bool_), np.zeros(2)
    g00, g01, g11 = ground[0, 0], ground[0, 1], ground[1, 1]
    gl0, gl1 = g00 * lever[0] + g01 * lever[1], g01 * lever[0] + g11 * lever[1]
    turn = lever[0] * gl0 + lever[1] * gl1
    for k in range(2):
        amps[k] = current[k]
        # 2: free to move; -1, 0, 1: at rest, or just leaving it.
        stick[k] = 0 if (state[k, ROTOR] == 0.0 and rotor[k, LEVEL_F] + rotor[k, LEVEL_B] > 0.0) else 2
    for step in range(n):
        for k in range(2):
            old_r[k], old_w[k] = state[k, ROTOR], state[k, WHEEL]
            bounces[k] = contact[k] == _FREE and side[k, RESTITUTION] > 0.0 and abs(old_r[k] - old_w[k]) > BOUNCE_RAD_S
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
                slack = side[k, SLIP] / (radius * radius)
                tau = side[k, SLIP_DAMPING] * side[k, SLIP] * side[k, SLIP_LENGTH]
                late[k] = max(0.5, 1.0 - tau / h)
                shear[k] = 1.0 / (late[k] * h + tau)
                rolled = abs(radius * old_w[k])
                path = (side[k, SLIP_LENGTH] + late[k] * h * rolled) * shear[k]
                bent = math.tanh(state[k, WHOLE] / grip[k])
                tangent[k], taken[k] = max(1.0 - bent * bent, FLAT), grip[k] * bent
                give[k] = slack * path / tangent[k] / late[k]
                shift[k] = (
                    slack * path * (state[k, WHOLE] - taken[k] / tangent[k])
                    + (rolled - path) * state[k, TYRE] / radius
                    - (1.0 - late[k]) * (old_w[k] - state[k, GROUND])
                ) / late[k]
        u0, u1 = state[0, GROUND], state[1, GROUND]
        rate = lever[0] * u0 + lever[1] * u1
        way = spin
        if scrub != 0.0 and foretold:
            way = 1.0 if rate > 0.0 else (-1.0 if rate < 0.0 else 0.0)
        q = way * h * scrub
        for attempt in range(20):
            for k in range(2):
                kind = contact[k]
                p = 0.0
                if stick[k] == 1:
                    p = hi[k]
                elif stick[k] == -1:
                    p = lo[k]
                held = stick[k] == 0
                if kind == _RIGID:
                    if held:
                        alpha[k], beta[k] = 0.0, 0.0
                    else:
                        a = am[k] + wheel_j
                        alpha[k], beta[k] = (bm[k] - p + wheel_j * old_w[k]) / a, h / a
                elif kind == _SPRING:
                    kap = 0.25 * h * side[k, STIFFNESS] + 0.5 * side[k, DAMPING]
                    t0 = side[k, STIFFNESS] * state[k, PLAY] + kap * (old_r[k] - old_w[k])
                    a = am[k] + h * kap
                    r0 = 0.0 if held else (bm[k] - p - h * t0) / a
                    r1 = 0.0 if held else h * kap / a
                    d = wheel_j + h * kap * (1.0 - r1)
                    alpha[k], beta[k] = (wheel_j * old_w[k] + h * t0 + h * kap * r0) / d, h / d
                elif kind == _FREE:
                    alpha[k], beta[k] = old_w[k], h / wheel_j
                else:
                    # What the rotor is faster than the wheel afterwards.
                    gap = (0.5 if kind == _PUSH_F else -0.5) * side[k, BACKLASH] - state[k, PLAY]
                    apart[k] = gap / h
                    if bounces[k] and (old_r[k] > old_w[k]) == (kind == _PUSH_F):
                        apart[k] = side[k, RESTITUTION] * (old_w[k] - old_r[k])
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
                b0 = alpha[0] - u0 + h * (g00 * e0 + g01 * e1) + gl0 * q - shift[0]
                b1 = alpha[1] - u1 + h * (g01 * e0 + g11 * e1) + gl1 * q - shift[1]
                f[0], f[1] = (a11 * b0 - a01 * b1) / det, (a00 * b1 - a01 * b0) / det
                asked[0], asked[1] = f[0], f[1]
                for k in range(2):
                    if side[k, SLIP] > 0.0 and abs(f[k]) > grip[k]:
                        f[k] = math.copysign(grip[k], f[k])
                        if k == 0:
                            f[1] = (b1 - a01 * f[0]) / a11
                        else:
                            f[0] = (b0 - a01 * f[1]) / a00
                if side[0, SLIP] > 0.0:
                    f[0] = min(max(f[0], -grip[0]), grip[0])
                n0 = u0 + h * (g00 * (f[0] - e0) + g01 * (f[1] - e1)) - gl0 * q
                n1 = u1 + h * (g01 * (f[0] - e0) + g11 * (f[1] - e1)) - gl1 * q
                new_rate = lever[0] * n0 + lever[1] * n1
                if not foretold or scrub == 0.0 or again_scrub == 1 or way * new_rate > 0.0:
                    break
                # The scrub would turn the robot back: the impulse that just stops it, within its bound.
                f0, f1 = (a11 * gl0 - a01 * gl1) / det, (a00 * gl1 - a01 * gl0) / det
                gain = h * (gl0 * f0 + gl1 * f1) - turn
                # Two wheels that stick hold the turn by themselves.
                q = min(max(q - new_rate / gain, -h * scrub), h * scrub) if gain < -1e-9 * turn else 0.0
            again = False
            for k in range(2):
                w[k] = alpha[k] - beta[k] * f[k]
                kind = contact[k]
                need = 0.0
                p = hi[k] if stick[k] == 1 else (lo[k] if stick[k] == -1 else 0.0)
                if kind == _RIGID:
                    wr[k] = w[k]
                    need = bm[k] + wheel_j * old_w[k] - h * f[k]
                elif kind == _SPRING:
                    kap = 0.25 * h * side[k, STIFFNESS] + 0.5 * side[k, DAMPING]
                    t0 = side[k, STIFFNESS] * state[k, PLAY] + kap * (old_r[k] - old_w[k])
                    need = bm[k] - h * (t0 - kap * w[k])
                    wr[k] = 0.0 if stick[k] == 0 else (bm[k] - p - h * t0 + h * kap * w[k]) / (am[k] + h * kap)
                elif kind == _FREE:
                    need = bm[k]
                    wr[k] = 0.0 if stick[k] == 0 else (bm[k] - p) / am[k]
                    moved = state[k, PLAY] + h * (wr[k] - w[k])
                    if moved > 0.5 * side[k, BACKLASH]:
                        contact[k] = _PUSH_F
                        again = True
                    elif moved < -0.5 * side[k, BACKLASH]:
                        contact[k] = _PUSH_B
                        again = True
                else:
                    wr[k] = w[k] + apart[k]
                    push = wheel_j * (w[k] - old_w[k]) + h * f[k]
                    need = bm[k] - push
                    # A gear can push but not pull.
                    if ((kind == _PUSH_F and push < 0.0) or (kind == _PUSH_B and push > 0.0)) and attempt < 10:
                        contact[k] = _FREE
                        again = True
                if stick[k] == 0:
                    if need > hi[k]:
                        stick[k] = 1
                        again = True
                    elif need < lo[k]:
                        stick[k] = -1
                        again = True
                elif stick[k] != 2 and stick[k] * wr[k] < 0.0 and attempt < 10:
                    stick[k] = 0
                    again = True
            if not again:
                break
        for k in range(2):
            total[k] += wheel_j * (w[k] - old_w[k]) / h + f[k]
            if foretold:
                electric = rotor[k, RESISTANCE] + rotor[k, INDUCTANCE] / h
                amps[k] = (volts[step, k] + rotor[k, INDUCTANCE] / h * amps[k] - rotor[k, KB] * wr[k]) / electric
            if contact[k] == _SPRING:
                state[k, PLAY] += 0.5 * h * (old_r[k] + wr[k] - old_w[k] - w[k])
            elif contact[k] >= _PUSH_F and bounces[k] and (wr[k] > w[k]) != (contact[k] == _PUSH_F):
                # To the flank at the speed before, and back for the rest of the step.
                flank = (0.5 if contact[k] == _PUSH_F else -0.5) * side[k, BACKLASH]
                reach = min(max((flank - state[k, PLAY]) / (old_r[k] - old_w[k]), 0.0), h)
                state[k, PLAY] = flank + (h - reach) * apart[k]
                contact[k] = _FREE
            elif contact[k] != _RIGID:
                state[k, PLAY] += h * (wr[k] - w[k])
            state[k, ROTOR], state[k, WHEEL] = wr[k], w[k]
            if side[k, SLIP] > 0.0:
                most = SLIDING * grip[k]
                state[k, WHOLE] = min(max(state[k, WHOLE] + (asked[k] - taken[k]) / tangent[k], -most), most)
                state[k, TYRE] += h * (state[k, WHOLE] / side[k, RADIUS] * side[k, SLIP] - state[k, TYRE]) * shear[k]
        state[0, GROUND], state[1, GROUND] = n0, n1
        acted += q / (h * scrub) if scrub != 0.0 else 0.0
    return total / n, acted / n
