"""The planar world's mechanics and electrics: one run, integrated step by step.

Formulation (chosen to differ from a replay that solves the rigid robot's equations):

- the currents are advanced by half steps that are exact for constant voltage and speed (exponential integrator),
  around a full symplectic step of the mechanics (Strang splitting); the brush drop is an exact dry element;
- the body is a mass of its own: wheels push it through stiff tyres (spring, damper and a creep proportional to the
  force, which is the slip), so rolling without slip is an outcome, not an equation;
- dry friction is an elasto-plastic bristle (Prandtl element: a spring that yields at the friction torque), so that
  sticking is a spring's equilibrium instead of a case distinction (Canudas de Wit et al. 1995 survey such models).

Angles and torques of the drive train are at the gear's output, motor values at the shaft.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from rtds_host.blind import curve, unnamed

GRAVITY_M_S2 = 9.80665

SIDE_NAMES = (
    "resistance",
    "inductance",
    "torque_constant",
    "back_emf",
    "inertia",
    "viscosity",
    "gain",
    "deadzone",
    "drop",
    "limit",
    "heat_per_watt",
    "heat_tau",
    "coulomb",
    "stribeck",
    "stribeck_speed",
    "viscous",
    "asym_torque",
    "asym_viscous",
    "load_friction",
    "backlash",
    "stiffness",
    "damping",
    "ripple",
    "ripple_cycles",
    "ripple_phase",
    "radius",
    "slip",
    "rolling",
    "filter_tau",
    # outside of the catalogue
    "hysteresis",
    "quantum",
    "rub_torque",
    "rub_angle",
    "rub_width",
    "eccentricity",
    "eccentric_phase",
    "saturation",
    "quadratic",
    "slew",
    "friction_per_s",
    "crosstalk",
    "traction",
    "tyre",
    "tyre_damping",
    "curve",  # of the catalogue: pwm_curve
    "dahl",
    "dahl_rad",
    "swing",
    "swing_phase",
    "grease",
    "grease_tau",
    "detent",
    "detent_cycles",
    "detent_phase",
    "current_tau",
    *unnamed.SIDE,
)
WORLD_NAMES = (
    "voltage",
    "gear",
    "mass",
    "yaw_inertia",
    "track",
    "wheel_inertia",
    "slope",
    "uphill",
    "com_x",
    "com_y",
    "sag",
    "decline",
    "scrub",
    "command_delay",
    "measurement_delay",
    # outside of the catalogue
    "cable",
    "patch_x",
    "patch_force",
    "lateral_slope",
    "bus_noise",
    "bus_tau",
    "gust",
    "gust_tau",
    "turn_drag",
    "bumps",
    "bump_length",
    "clock_drift",
    "relax_ohm",
    "relax_tau",
    # other machines than the burger: stiffness of teeth; an axis' gravity torque and its zero; torque mode
    "stop",
    "stop_damping",
    "pendulum",
    "pendulum_zero",
    "torque_per_volt",
    *unnamed.WORLD,
)
(
    S_RESISTANCE,
    S_INDUCTANCE,
    S_TORQUE_CONSTANT,
    S_BACK_EMF,
    S_INERTIA,
    S_VISCOSITY,
    S_GAIN,
    S_DEADZONE,
    S_DROP,
    S_LIMIT,
    S_HEAT_PER_WATT,
    S_HEAT_TAU,
    S_COULOMB,
    S_STRIBECK,
    S_STRIBECK_SPEED,
    S_VISCOUS,
    S_ASYM_TORQUE,
    S_ASYM_VISCOUS,
    S_LOAD_FRICTION,
    S_BACKLASH,
    S_STIFFNESS,
    S_DAMPING,
    S_RIPPLE,
    S_RIPPLE_CYCLES,
    S_RIPPLE_PHASE,
    S_RADIUS,
    S_SLIP,
    S_ROLLING,
    S_FILTER_TAU,
    S_HYSTERESIS,
    S_QUANTUM,
    S_RUB_TORQUE,
    S_RUB_ANGLE,
    S_RUB_WIDTH,
    S_ECCENTRICITY,
    S_ECCENTRIC_PHASE,
    S_SATURATION,
    S_QUADRATIC,
    S_SLEW,
    S_FRICTION_PER_S,
    S_CROSSTALK,
    S_TRACTION,
    S_TYRE,
    S_TYRE_DAMPING,
    S_CURVE,
    S_DAHL,
    S_DAHL_RAD,
    S_SWING,
    S_SWING_PHASE,
    S_GREASE,
    S_GREASE_TAU,
    S_DETENT,
    S_DETENT_CYCLES,
    S_DETENT_PHASE,
    S_CURRENT_TAU,
) = range(len(SIDE_NAMES) - len(unnamed.SIDE))
S_UNNAMED = len(SIDE_NAMES) - len(unnamed.SIDE)
(
    W_VOLTAGE,
    W_GEAR,
    W_MASS,
    W_YAW_INERTIA,
    W_TRACK,
    W_WHEEL_INERTIA,
    W_SLOPE,
    W_UPHILL,
    W_COM_X,
    W_COM_Y,
    W_SAG,
    W_DECLINE,
    W_SCRUB,
    W_COMMAND_DELAY,
    W_MEASUREMENT_DELAY,
    W_CABLE,
    W_PATCH_X,
    W_PATCH_FORCE,
    W_LATERAL_SLOPE,
    W_BUS_NOISE,
    W_BUS_TAU,
    W_GUST,
    W_GUST_TAU,
    W_TURN_DRAG,
    W_BUMPS,
    W_BUMP_LENGTH,
    W_CLOCK_DRIFT,
    W_RELAX_OHM,
    W_RELAX_TAU,
    W_STOP,
    W_STOP_DAMPING,
    W_PENDULUM,
    W_PENDULUM_ZERO,
    W_TORQUE_PER_VOLT,
    W_TICK,
    W_CHOKE_OHM,
    W_CHOKE_AMPS,
    W_CHOKE_TAU,
    W_CASTER,
    W_CASTER_LENGTH,
    W_NAP,
    W_NAP_YAW,
    W_SLOSH,
    W_SLOSH_RATE,
    W_SLOSH_RATIO,
) = range(len(WORLD_NAMES))

BRISTLE_RAD = 1e-4  # travel after which a bristle yields: far below an encoder count
TYRE_N_PER_M = 3e6  # a third of a micrometre at 1 N: far below the pose's noise
TYRE_N_S_PER_M = 600.0
SOFT_TYRE = 200.0  # a tyre that creeps is softer by this
SOFT_TYRE_DAMPING = 12.0  # and less damped by this
STOP_NM_PER_RAD = 600.0  # gear teeth in contact, where nothing softer is asked for; they hardly bounce
STOP_NM_S_PER_RAD = 0.8
# Reduced inertia of rotor and wheel that they are meant for, the burger's; heavier ones meet stiffer teeth.
STOP_REDUCED_KG_M2 = 2.07e-5 * (258.5**2 * 1.0e-7) / (2.07e-5 + 258.5**2 * 1.0e-7)


class Diverged(RuntimeError):
    """A world's integration became unstable: what it wrote is no robot's log."""


@njit(cache=True)
def simulate(
    times, v_cmd, side, world, start, step_s, closed, w_ref, w_noise, period_rows, gains, events, seed, curves
):
    """Run one scenario.

    Parameters
    ----------
    times : (n,) s, rows of the log, multiples of `step_s`, increasing from 0.
    v_cmd : (n, 2) V; with `closed` it is filled in by the wheel-speed controller.
    side : (len(SIDE_NAMES), 2), world : (len(WORLD_NAMES),): parameters by name, see above.
    start : (5,) x, y, yaw, th_l, th_r at t = 0; everything else is at rest.
    w_ref : (n, 2) rad/s references, w_noise : (n, 2) rad/s noise on the controller's speed sensor, `period_rows`
        rows between two controller updates, `gains` (feed-forward V s/rad, kp, ki, limit V, speed gain l, r).
    curves : (2, curve.WIDTH) laws that were drawn at random, see `curve`.
    events : (k, 4): from s, to s, side, torque N m of a brake; side -1: the link stalls, no command gets through.

    Returns
    -------
    (n, 11): bus V, i_l, i_r, w_l, w_r (after the speed filter), th_l, th_r, yaw rate at t minus the measurement
    delay; x, y, yaw at t. No sensor errors but filter and delay. `v_cmd` holds the commands.
    """
    n = times.shape[0]
    out = np.zeros((n, 11))
    np.random.seed(seed)
    h = step_s
    gear = world[W_GEAR]
    vn = world[W_VOLTAGE]
    jw = world[W_WHEEL_INERTIA]
    m = world[W_MASS]
    iz = world[W_YAW_INERTIA]
    track = world[W_TRACK]
    cx = world[W_COM_X]
    cy = world[W_COM_Y]
    g_slope = m * GRAVITY_M_S2 * math.sin(world[W_SLOPE])
    g_lateral = m * GRAVITY_M_S2 * math.sin(world[W_LATERAL_SLOPE])
    det = m * iz - (m * cy) ** 2
    delay_c = world[W_COMMAND_DELAY]
    delay_m = world[W_MEASUREMENT_DELAY]
    pace = 1.0 - world[W_CLOCK_DRIFT]  # of the instruments' clock against the one that stamps commands and pose

    x, y, yaw = start[0], start[1], start[2]
    x0, y0 = x, y
    v = 0.0
    yawrate = 0.0
    scrub = 0.0
    bus = vn
    bus_noise = 0.0
    gust = 0.0
    i = np.zeros(2)
    wg = np.zeros(2)  # gear's output
    thg = np.array([start[3], start[4]])
    ww = np.zeros(2)  # wheel, where play or a spring sits between
    thw = thg.copy()
    tyre = np.zeros(2)
    force = np.zeros(2)
    bristle = np.zeros(2)
    rise = np.zeros(2)
    filtered = np.zeros(2)
    played = np.zeros(2)
    slewed = np.zeros(2)
    volts = np.zeros(2)
    asked = np.zeros(2)
    duty = np.zeros(2)
    integral = np.zeros(2)
    preslid = np.zeros(2)
    seen = np.zeros(2)
    relaxed = 0.0
    state = np.zeros((2, unnamed.STATES))
    more = np.ascontiguousarray(side[S_UNNAMED:].T)
    left = np.ones(2)  # of the flux
    taken = np.zeros(2)
    ticks = -1
    choked = 0.0
    cocked = 0.0
    swung = 0.0
    swing_rate = 0.0
    pushed = 0.0  # m/s2, the body's acceleration in the step before
    # Moving means look back by whole steps: angles, and charges for the current.
    back = np.zeros((2, 2), np.int64)
    longest = 1
    for s in range(2):
        back[0, s] = int(round(more[s, unnamed.MEAN_S] / h))
        back[1, s] = int(round(more[s, unnamed.CURRENT_MEAN_S] / h))
        longest = max(longest, back[0, s], back[1, s])
    past = np.zeros((2, 2, longest))
    charge = np.zeros(2)
    for s in range(2):
        past[0, s, :] = thg[s]
    split = np.zeros(2, np.bool_)
    for s in range(2):
        split[s] = side[S_STIFFNESS, s] > 0 or side[S_BACKLASH, s] > 0

    previous = np.zeros(8)
    current = np.zeros(8)
    row = 0  # next row to record and to command
    sample = 0  # next delayed sample
    acting = -1  # row whose command reaches the driver
    steps = round(times[n - 1] / h) + 1
    for k in range(steps):
        t = k * h
        for q in range(8):
            previous[q] = current[q]
        current[0] = bus
        for s in range(2):
            current[1 + s] = seen[s] if side[S_CURRENT_TAU, s] > 0 else i[s]
            current[3 + s] = filtered[s] if side[S_FILTER_TAU, s] > 0 else wg[s]
            current[5 + s] = thg[s]
            if back[0, s] > 0:
                current[3 + s] = (thg[s] - past[0, s, k % back[0, s]]) / (back[0, s] * h)
                past[0, s, k % back[0, s]] = thg[s]
            if back[1, s] > 0:
                current[1 + s] = (charge[s] - past[1, s, k % back[1, s]]) / (back[1, s] * h)
                past[1, s, k % back[1, s]] = charge[s]
        current[7] = yawrate
        if k == 0:
            for q in range(8):
                previous[q] = current[q]
        while sample < n and pace * times[sample] - delay_m <= t + 1e-9:
            part = (pace * times[sample] - delay_m - (t - h)) / h
            part = min(part, 1.0)
            part = max(part, 0.0)
            for q in range(8):
                out[sample, q] = previous[q] + part * (current[q] - previous[q])
            sample += 1
        while row < n and times[row] <= t + 1e-9:
            out[row, 8] = x
            out[row, 9] = y
            out[row, 10] = yaw
            if closed:
                for s in range(2):
                    if row % period_rows == 0:
                        last = max(row - period_rows, 0)
                        dt = times[row] - times[last]
                        measured = out[row, 3 + s] * gains[4 + s] + w_noise[row, s]
                        error = w_ref[row, s] - measured
                        u = gains[0] * w_ref[row, s] + gains[1] * error + gains[2] * integral[s]
                        if abs(u) < gains[3]:
                            integral[s] += error * dt
                        u = min(max(u, -gains[3]), gains[3])
                        v_cmd[row, s] = round(u * 1000.0) / 1000.0
                    else:
                        v_cmd[row, s] = v_cmd[row - 1, s]
            row += 1

        # Command that reaches the driver, averaged over the step.
        stalled = False
        for e in range(events.shape[0]):
            if events[e, 2] < 0.0 and events[e, 0] <= t < events[e, 1]:
                stalled = True
        while not stalled and acting + 1 < n and times[acting + 1] + delay_c <= t + 1e-9:
            acting += 1
        share = 0.0
        if not stalled and acting + 1 < n and times[acting + 1] + delay_c < t + h - 1e-9:
            share = (t + h - times[acting + 1] - delay_c) / h
        for s in range(2):
            now = v_cmd[acting, s] if acting >= 0 else 0.0
            if share > 0.0:
                now += share * (v_cmd[acting + 1, s] - now)
            asked[s] = now
        if world[W_TICK] > 0.0:
            if int(t / world[W_TICK]) != ticks:
                ticks = int(t / world[W_TICK])
                taken[:] = asked
            asked[:] = taken
        bus = vn - world[W_DECLINE] * t
        if world[W_BUS_NOISE] > 0.0:
            bus_noise += (
                -bus_noise * h / world[W_BUS_TAU]
                + world[W_BUS_NOISE] * math.sqrt(2.0 * h / world[W_BUS_TAU]) * np.random.normal()
            )
            bus += bus_noise
        for s in range(2):
            u = asked[s] + side[S_CROSSTALK, s] * asked[1 - s]
            if side[S_QUANTUM, s] > 0.0:
                u = side[S_QUANTUM, s] * math.floor(u / side[S_QUANTUM, s] + 0.5)
            if side[S_HYSTERESIS, s] > 0.0:
                half = 0.5 * side[S_HYSTERESIS, s]
                played[s] = min(max(played[s], u - half), u + half)
                u = played[s]
            if side[S_SLEW, s] > 0.0:
                change = side[S_SLEW, s] * h
                slewed[s] += min(max(u - slewed[s], -change), change)
                u = slewed[s]
            u = min(max(u, -vn), vn)
            duty[s] = u / vn
            u *= side[S_GAIN, s] * (1.0 + side[S_CURVE, s] * (1.0 - abs(u) / vn))
            if u > 0.0:
                u -= min(u, side[S_DEADZONE, s])
            else:
                u += min(-u, side[S_DEADZONE, s])
            if curves[s, curve.LAW] == curve.VOLTAGE_COMMAND:
                u += curve.at(curves[s], asked[s])
            volts[s] = u
        if world[W_SAG] > 0.0:
            bus -= world[W_SAG] * (i[0] * duty[0] + i[1] * duty[1])
        if world[W_RELAX_OHM] > 0.0:
            drawn = i[0] * duty[0] + i[1] * duty[1]
            relaxed += h * (world[W_RELAX_OHM] * drawn - relaxed) / world[W_RELAX_TAU]
            bus -= relaxed
        if world[W_CHOKE_OHM] > 0.0:
            over = max(i[0] * duty[0] + i[1] * duty[1] - world[W_CHOKE_AMPS], 0.0)
            choked += h * (world[W_CHOKE_OHM] * over - choked) / world[W_CHOKE_TAU]
            bus -= choked
        for s in range(2):
            volts[s] *= bus / vn
            volts[s] = min(max(volts[s], -side[S_LIMIT, s]), side[S_LIMIT, s])
            if curves[s, curve.LAW] == curve.VOLTAGE_CURRENT:
                volts[s] += curve.at(curves[s], i[s])
            left[s] = unnamed.flux(more[s], state[s], i[s])
            if curves[s, curve.LAW] == curve.FLUX:
                left[s] += curve.at(curves[s], i[s])
            emf = side[S_BACK_EMF, s] * left[s] * gear * wg[s]
            volts[s] = unnamed.output(more[s], state[s], h, volts[s], i[s], side[S_RESISTANCE, s], emf)

        # First half step of the currents.
        for s in range(2):
            r = unnamed.resistance(more[s], side[S_RESISTANCE, s] * (1.0 + rise[s]), i[s], thg[s])
            z = 0.5 * h * r / side[S_INDUCTANCE, s]
            decay = (1.0 - z / 2.0 + z * z / 12.0) / (1.0 + z / 2.0 + z * z / 12.0)
            emf = side[S_BACK_EMF, s] * left[s] * gear * wg[s]
            end = (volts[s] - emf) / r if world[W_TORQUE_PER_VOLT] == 0.0 else 0.0
            new = end + (i[s] - end) * decay
            pull = side[S_DROP, s] / r * (1.0 - decay)
            if pull > 0.0:
                new = new - pull if new > pull else (new + pull if new < -pull else 0.0)
            i[s] = new

        # Mechanics, one symplectic step.
        fl_fr = 0.0
        turn = 0.0
        for s in range(2):
            sign = 2 * s - 1.0
            radius = side[S_RADIUS, s]
            if side[S_ECCENTRICITY, s] != 0.0:
                radius *= 1.0 + side[S_ECCENTRICITY, s] * math.sin(thg[s] + side[S_ECCENTRIC_PHASE, s])
            w_rim = ww[s] if split[s] else wg[s]
            radius *= 1.0 + more[s, unnamed.GROWTH] * w_rim * w_rim
            w = wg[s]
            ground = v + sign * 0.5 * track * yawrate
            rate = radius * w_rim - ground
            f = side[S_TYRE, s] * tyre[s] + side[S_TYRE_DAMPING, s] * rate
            if side[S_TRACTION, s] > 0.0:
                top = side[S_TRACTION, s]
                if abs(f) > top:
                    f = math.copysign(top, f)
                    tyre[s] = (f - side[S_TYRE_DAMPING, s] * rate) / side[S_TYRE, s]
                    rate = 0.0
            tyre[s] += h * (rate - radius * abs(w_rim) * side[S_SLIP, s] * f)
            force[s] = f
            fl_fr += f
            turn += sign * 0.5 * track * f

            km = side[S_TORQUE_CONSTANT, s] * left[s]
            if side[S_SATURATION, s] > 0.0:
                km /= 1.0 + (i[s] / side[S_SATURATION, s]) ** 2
            motor = km * i[s] if world[W_TORQUE_PER_VOLT] == 0.0 else world[W_TORQUE_PER_VOLT] * volts[s]
            drive = gear * motor - gear * gear * side[S_VISCOSITY, s] * w
            rotor = gear * gear * side[S_INERTIA, s]

            cap = side[S_COULOMB, s] + radius * side[S_ROLLING, s] * m * GRAVITY_M_S2 * 0.5
            if side[S_STRIBECK, s] != 0.0:
                cap += side[S_STRIBECK, s] * math.exp(-((w / side[S_STRIBECK_SPEED, s]) ** 2))
            cap += side[S_FRICTION_PER_S, s] * t + unnamed.aged(more[s], state[s], h, w)
            cap += side[S_SWING, s] * 0.5 * (1.0 + math.cos(thg[s] - side[S_SWING_PHASE, s]))
            if side[S_RUB_TORQUE, s] > 0.0:
                away = (thg[s] - side[S_RUB_ANGLE, s] + math.pi) % (2.0 * math.pi) - math.pi
                if abs(away) < side[S_RUB_WIDTH, s]:
                    cap += side[S_RUB_TORQUE, s] * (1.0 + math.cos(math.pi * away / side[S_RUB_WIDTH, s])) * 0.5
            if world[W_PATCH_FORCE] > 0.0 and x > world[W_PATCH_X]:
                cap += radius * world[W_PATCH_FORCE] * 0.5
            for e in range(events.shape[0]):
                if int(events[e, 2]) == s and events[e, 0] <= t < events[e, 1]:
                    cap += events[e, 3]
            bristle[s] = min(max(bristle[s] + w * h / BRISTLE_RAD, -1.0), 1.0)
            other = 0.0
            if cap > 0.0:
                dry = bristle[s] * cap + 1.4 * math.sqrt(cap / BRISTLE_RAD * rotor) * w
                other -= min(max(dry, -cap), cap)
            other -= side[S_VISCOUS, s] * w + side[S_QUADRATIC, s] * w * abs(w)
            other -= side[S_ASYM_TORQUE, s] * abs(bristle[s]) + side[S_ASYM_VISCOUS, s] * abs(w)
            if side[S_RIPPLE, s] != 0.0:
                other += side[S_RIPPLE, s] * math.sin(side[S_RIPPLE_CYCLES, s] * thg[s] + side[S_RIPPLE_PHASE, s])

            other += unnamed.torque(more[s], state[s], h, w)
            if curves[s, curve.LAW] == curve.TORQUE_SPEED:
                other += curve.at(curves[s], w)
            elif curves[s, curve.LAW] == curve.TORQUE_ANGLE:
                other += curve.at(curves[s], thg[s])
            elif curves[s, curve.LAW] == curve.DAMPING_TIME:
                other -= curve.at(curves[s], t) * w
            if side[S_DAHL, s] > 0.0:
                preslid[s] += w * h / side[S_DAHL_RAD, s] * (1.0 - preslid[s] * math.copysign(1.0, w))
                preslid[s] = min(max(preslid[s], -1.0), 1.0)
                other -= side[S_DAHL, s] * preslid[s]
            if side[S_GREASE, s] > 0.0:
                other -= side[S_GREASE, s] * math.exp(-t / side[S_GREASE_TAU, s]) * w
            if side[S_DETENT, s] != 0.0:
                other += (
                    side[S_DETENT, s]
                    * 0.5
                    * (1.0 + math.cos(thg[s] - side[S_DETENT_PHASE, s]))
                    * math.sin(side[S_DETENT_CYCLES, s] * thg[s])
                )

            if split[s]:
                twist = thg[s] - thw[s]
                half = 0.5 * side[S_BACKLASH, s]
                stiff = side[S_STIFFNESS, s]
                damp = side[S_DAMPING, s]
                if stiff <= 0.0:
                    stiff = world[W_STOP]
                    damp = world[W_STOP_DAMPING]
                spring = 0.0
                if twist > half:
                    spring = stiff * (twist - half) + damp * (w - ww[s])
                    if half > 0.0:
                        spring = max(spring, 0.0)
                elif twist < -half:
                    spring = stiff * (twist + half) + damp * (w - ww[s])
                    if half > 0.0:
                        spring = min(spring, 0.0)
                load = spring
                if side[S_LOAD_FRICTION, s] > 0.0:
                    keep = 1.0 - side[S_LOAD_FRICTION, s] * abs(bristle[s])
                    load = spring / keep if spring * bristle[s] > 0.0 else spring * keep
                ww[s] += h * (spring - radius * f - world[W_PENDULUM] * math.sin(thw[s] - world[W_PENDULUM_ZERO])) / jw
                thw[s] += h * ww[s]
                wg[s] = w + h * (drive + other - load) / rotor
            else:
                rest = other - radius * f - world[W_PENDULUM] * math.sin(thg[s] - world[W_PENDULUM_ZERO])
                if side[S_LOAD_FRICTION, s] > 0.0:
                    # Share of the torque that goes through the gear and is not lost, driving or driven.
                    keep = 1.0 - side[S_LOAD_FRICTION, s] * abs(bristle[s])
                    a = (drive * keep + rest) / (rotor * keep + jw)
                    if (drive - rotor * a) * bristle[s] < 0.0:
                        a = (drive / keep + rest) / (rotor / keep + jw)
                else:
                    a = (drive + rest) / (rotor + jw)
                wg[s] = w + h * a
            thg[s] += h * wg[s]

        # Body.
        rel = yaw - world[W_UPHILL]
        gx = -g_slope * math.cos(rel) - g_lateral * math.sin(rel)
        gy = g_slope * math.sin(rel) - g_lateral * math.cos(rel)
        if world[W_CABLE] != 0.0:
            gx -= world[W_CABLE] * ((x - x0) * math.cos(yaw) + (y - y0) * math.sin(yaw))
        if world[W_GUST] > 0.0:
            gust += (
                -gust * h / world[W_GUST_TAU]
                + world[W_GUST] * math.sqrt(2.0 * h / world[W_GUST_TAU]) * np.random.normal()
            )
            gx += gust * math.cos(yaw)
        if world[W_BUMPS] != 0.0:
            wave = 2.0 * math.pi / world[W_BUMP_LENGTH]
            tilt = world[W_BUMPS] * m * GRAVITY_M_S2
            gx -= tilt * (math.cos(wave * x) * math.cos(yaw) + math.cos(wave * y) * math.sin(yaw))
        if world[W_NAP] != 0.0:
            gx += unnamed.against_nap(world[W_NAP], world[W_NAP_YAW], yaw, v)
        if world[W_SLOSH] > 0.0:
            # What swings is part of the mass: it takes the body's acceleration from it and gives its spring's force.
            turns = world[W_SLOSH_RATE]
            pull = -turns * turns * swung - 2.0 * world[W_SLOSH_RATIO] * turns * swing_rate
            swing_rate += h * (pull - pushed)
            swung += h * swing_rate
            gx += world[W_SLOSH] * m * (pushed - pull)
        if curves[0, curve.LAW] == curve.FORCE_SPEED:
            gx += curve.at(curves[0], v)
        elif curves[0, curve.LAW] == curve.FORCE_PLACE:  # a floor that is not level: it pushes along x
            gx += curve.at(curves[0], x) * math.cos(yaw)
        ax_force = fl_fr + gx + m * cx * yawrate * yawrate
        moment = turn - m * cx * v * yawrate + cx * gy - cy * gx
        moment -= world[W_TURN_DRAG] * yawrate
        if curves[0, curve.LAW] == curve.YAW_TORQUE:
            moment += curve.at(curves[0], yawrate)
        if world[W_CASTER] > 0.0:
            cocked -= h * (yawrate + v / world[W_CASTER_LENGTH] * math.sin(cocked))
            moment -= world[W_CASTER] * math.sin(cocked) * math.tanh(v / unnamed.NAP_M_S)
        if world[W_SCRUB] > 0.0:
            scrub = min(max(scrub + yawrate * h / BRISTLE_RAD, -1.0), 1.0)
            top = world[W_SCRUB]
            dry = scrub * top + 1.4 * math.sqrt(top / BRISTLE_RAD * iz) * yawrate
            moment -= min(max(dry, -top), top)
        dv = (iz * ax_force + m * cy * moment) / det
        dr = (m * moment + m * cy * ax_force) / det
        pushed = dv
        middle = yaw + 0.5 * h * yawrate
        v += h * dv
        yawrate += h * dr
        x += h * v * math.cos(middle)
        y += h * v * math.sin(middle)
        yaw += h * yawrate

        # Second half step of the currents, heat, filter.
        for s in range(2):
            r = unnamed.resistance(more[s], side[S_RESISTANCE, s] * (1.0 + rise[s]), i[s], thg[s])
            z = 0.5 * h * r / side[S_INDUCTANCE, s]
            decay = (1.0 - z / 2.0 + z * z / 12.0) / (1.0 + z / 2.0 + z * z / 12.0)
            emf = side[S_BACK_EMF, s] * left[s] * gear * wg[s]
            end = (volts[s] - emf) / r if world[W_TORQUE_PER_VOLT] == 0.0 else 0.0
            new = end + (i[s] - end) * decay
            pull = side[S_DROP, s] / r * (1.0 - decay)
            if pull > 0.0:
                new = new - pull if new > pull else (new + pull if new < -pull else 0.0)
            i[s] = new
            charge[s] += h * new
            if side[S_CURRENT_TAU, s] > 0.0:
                seen[s] += (i[s] - seen[s]) * (1.0 - math.exp(-h / side[S_CURRENT_TAU, s]))
            if side[S_HEAT_TAU, s] > 0.0:
                power = i[s] * i[s] * r
                rise[s] += h * (side[S_HEAT_PER_WATT, s] * power - rise[s]) / side[S_HEAT_TAU, s]
            if side[S_FILTER_TAU, s] > 0.0:
                filtered[s] += (wg[s] - filtered[s]) * (1.0 - math.exp(-h / side[S_FILTER_TAU, s]))
    return out
