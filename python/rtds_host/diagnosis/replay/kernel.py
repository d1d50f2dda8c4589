"""The replay's inner loop: two motors, two gears and a planar body, from commands alone.

Method. Within a step of length h the armature equation is solved exactly for a speed that moves linearly
(so that L, whose time constant is a tenth of the step, neither rings nor is lost); the speed itself follows the
implicit mid-point rule. Dry friction, sticking, free play and the yaw scrub are complementarity conditions on the
velocities at the end of the step (Moreau's time stepping): a regime (forwards, stuck, backwards; touching,
free) is guessed from the step before, the linear system is solved, and the guess is corrected until it agrees. So
a stuck wheel stands still without chatter. Traction forces solve a 2x2 system that couples both wheels
through the body; slip is a compliance in it. Steps end on every command change and every sample, also
delayed ones, so that the result is a smooth function of the delays.

References: contract, section 2 (equations); J. J. Moreau, "Unilateral contact and dry friction in finite
freedom dynamics", 1988 (time stepping with friction); E. Hairer, G. Wanner, "Solving ODEs II", 1996 (mid-point);
H. B. Pacejka, "Tire and Vehicle Dynamics", 2012, sections 7.2.1 and 8.6 (transient slip: a relaxation length, damping,
and a force that saturates).
"""

from __future__ import annotations

import math

import numpy as np

from rtds_host.plant import driver, forms, friction, gear, ground, motor, sensors
from rtds_host.plant.compiled import law, loop
from rtds_host.plant.elementary import exponential
from rtds_host.plant.elementary import turned as turned_by
from rtds_host.plant.schema import SIDE_INDEX, common_indices, side_indices
from rtds_host.plant.torque import functions
from rtds_host.plant.torques import TORQUES

# Numerical: how often a step is taken whose friction or bus hangs on its own currents and forces.
TRIALS = 2
# Numerical: the smallest bus voltage over the nominal one that a back EMF is compared with.
LEAST_LEVEL = 1e-3

R, L, KM, KB, J, B = side_indices("resistance", "inductance", "torque_constant", "back_emf", "rotor_inertia", "viscous")
CURVE, V_GAIN, DEADZONE, DROP, LIMIT, KNEE = side_indices(
    "pwm_curve", "voltage_gain", "deadzone", "drop", "limit", "drop_knee"
)
FAST, PERIODS = side_indices("fast_decay", "pwm_periods")
RADIUS, HEAT_RISE, HEAT_TAU, C_GAIN = side_indices("radius", "heat_rise", "heat_tau", "command_gain")
COULOMB, STRIBECK, STRIBECK_W = side_indices("coulomb", "stribeck", "stribeck_speed")
VISCOUS_W, ASYM, ASYM_V, LOAD = side_indices("viscous_wheel", "asymmetry", "asymmetry_viscous", "load_share")
BACKLASH, RESTITUTION, STIFF, DAMP = side_indices("backlash", "restitution", "stiffness", "damping")
SLIP, SLIP_LENGTH, SLIP_DAMPING, SLIP_GRIP = side_indices("slip", "slip_relaxation", "slip_damping", "slip_grip")
W_GAIN, W_TAU, W_DELAY = side_indices("speed_gain", "speed_tau", "speed_delay")
I_GAIN, I_BIAS = side_indices("current_gain", "current_bias")
GEAR, SUPPLY, SOURCE_R, DECLINE = common_indices("gear_ratio", "supply", "source_resistance", "decline")
MASS, IZ, JW, TRACK, COM_X, COM_Y = common_indices("mass", "yaw_inertia", "wheel_inertia", "track", "com_x", "com_y")
SCRUB, ROLLING, SLOPE_X, GYRO_GAIN, GYRO_BIAS = common_indices(
    "scrub", "rolling", "slope_extra", "gyro_gain", "gyro_bias"
)
CMD_EARLY, CMD_DELAY, MEAS_DELAY, LATENCY = common_indices(
    "command_early", "command_delay", "measurement_delay", "latency"
)
MODE, TORQUE_V, BUS_MEAS, AT_WHEEL = common_indices("mode", "torque_per_volt", "bus_measured", "encoder_at_wheel")
KP, KI, SERVO_LIMIT, SERVO_T = common_indices("servo_kp", "servo_ki", "servo_limit", "servo_period")
RELEASE, AXIS, AX_J, AX_M = common_indices("servo_release", "axis", "axis_inertia", "axis_mass")
AX_ARM, AX_ZERO = common_indices("axis_arm", "axis_zero")
# Torques over the wheel's angle or speed: their sum, and whether there is any, of a side's row.
torque_of, shaped_by = map(law, functions(TORQUES, "side, k", lambda entry: f"side[k, {SIDE_INDEX[entry.name]}]"))


CURRENT, SPEED, GYRO = (forms.TERM_CODE[f"{name}_sensor"] for name in ("current", "speed", "gyro"))
# fmt: off
(OVER_V, OVER_HISTORY, OVER_I, OVER_W, OVER_LOAD, OVER_RATE, OVER_TH, OVER_MOTOR, OVER_TURNS, OVER_SPEED, OVER_T,
 OVER_X, OVER_Y, OVER_YAW, _) = range(len(forms.OVERS))
# fmt: on


@law
def dry_of(side, k, com):
    """Whether a side has dry friction of its parameters."""
    own = side[k, COULOMB] != 0.0 or side[k, STRIBECK] != 0.0 or side[k, ASYM] != 0.0
    return own or side[k, LOAD] != 0.0 or com[ROLLING] != 0.0


@law
def load_inertia(com, payload):
    """Inertia behind a side's gear, kg·m²: a wheel's, or an axis' load, `payload` kg of it carried by a run."""
    axis = int(com[AXIS])
    swung = (com[AX_M] + payload) * com[AX_ARM] ** 2 if axis > 1 else 0.0
    own = com[AX_J] if axis == 1 or axis == 2 else 0.0
    return com[JW] if axis == 0 else own + swung


@law
def held_integral(side, k, com, current, speed):
    """Integral, V, with which a side's servo begins a run; current : A and speed : rad/s as it begins."""
    ratio = com[GEAR]
    # What an axis reports in its first row may be noise, with any sign.
    drawn, brake = (current, side[k, COULOMB]) if com[AXIS] == 0.0 else (0.0, 0.0)
    damping = ratio * ratio * side[k, B] + side[k, VISCOUS_W]
    limit = min(com[SERVO_LIMIT], com[SUPPLY])
    return driver.holding(
        drawn, speed, side[k, R], side[k, KB] * ratio, damping, brake, side[k, V_GAIN], com[KI], limit
    )


@law
def served(side, k, com, wanted, integral, told):
    """Voltage, V, and integral, V, of a side's servo after a sample; wanted, told : asked and measured speed, rad/s."""
    limit = min(com[SERVO_LIMIT], com[SUPPLY])
    miss = wanted * side[k, C_GAIN] - told
    return driver.servo(miss, integral, com[KP], com[KI], com[SERVO_T], limit, com[RELEASE])


@loop
def _followed(angle, t_cmd, kc, k, time):
    """A wheel's measured angle, rad, at a time, s, between the rows of the commands in force and next."""
    nearer = min(kc, t_cmd.shape[0] - 1)
    span_a = t_cmd[nearer] - t_cmd[kc - 1]
    share = min(max((time - t_cmd[kc - 1]) / span_a, 0.0), 1.0) if span_a > 0.0 else 0.0
    return angle[kc - 1, k] + share * (angle[nearer, k] - angle[kc - 1, k])


@loop
def replay(t, t_cmd, cmd, bus_log, angle, side, com, curves, run, start, h_max, h_play, out):
    """Replay one run.

    Parameters
    ----------
    t : (n,) s, times of the samples wanted; the first is where the replay starts.
    t_cmd : (m,) s, times of the commands, which may begin before t; cmd : (m, 2) V (rad/s in speed mode), held until
        the next; bus_log : (m,) V at the same times, used where `bus_measured` is set.
    angle : (m, 2) rad, the wheels' measured angles at the same times, which a ripple then follows, or (0, 2). A replay
        drifts, and what repeats twelve times a turn is soon out of step.
    side : (2, len(SIDE)), com : (len(COMMON),), see `plant.schema`.
    curves : (2, MOST_FORMS, WIDTH), see `plant.forms`; None without any, for which what follows them is not compiled.
    run : (4,) payload kg, slope rad, uphill yaw rad, time s at which the run began.
    start : (15,) x, y, yaw, th_l, th_r, w_l, w_r, i_l, i_r at t[0], w_l, w_r, i_l, i_r as reported there (currents: NaN
        where not), and what of these currents noise may be.
    h_max : s, longest step; h_play : s, the same while a rotor is within its free play, where it meets a flank next.
    out : (n, 11) filled with what the sensors would report, columns as `plant.schema.OUTPUTS`.

    A state that leaves the finite numbers fills the remaining rows with 1e6.
    """
    n = t.shape[0]
    m = t_cmd.shape[0]
    axis = int(com[AXIS])
    mode = int(com[MODE])
    sides = 1 if axis > 0 else 2
    ratio = com[GEAR]
    supply = com[SUPPLY]
    mass = com[MASS] + run[0]
    slope = run[1] + com[SLOPE_X]
    up_x, up_y = math.cos(run[2]), math.sin(run[2])
    pull = ground.along_slope(mass, slope, math.sin)
    half = 0.5 * com[TRACK]
    dc = com[CMD_DELAY] - com[CMD_EARLY]
    dp = com[LATENCY]
    dm = com[MEAS_DELAY] + dp
    scrub = com[SCRUB]

    x, y, yaw = start[0], start[1], start[2]
    th = np.empty(2)  # wheel angles
    w = np.empty(2)  # wheel speeds
    wm = np.empty(2)  # rotor speeds, at the wheel's side of the gear
    play = np.zeros(2)  # rotor angle less wheel angle, at the wheel's side
    cur = np.empty(2)
    rise = np.zeros(2)
    wf = np.empty(2)  # filtered speeds
    contact = np.zeros(2, np.int64)
    stick = np.zeros(2, np.int64)
    force = np.zeros(2)
    integ = np.zeros(2)
    # Constants of motor and gear at the wheel's side; forms may change the first two.
    ke, km, inertia, plain = np.empty(2), np.empty(2), np.empty(2), np.empty(2)
    shaped = shaped_by(side, 0) or shaped_by(side, 1)
    decays = mode != 1 and (side[0, FAST] != 0.0 or side[1, FAST] != 0.0)
    flexible = dry = False
    outer = TRIALS if com[SOURCE_R] != 0.0 or side[0, LOAD] != 0.0 or side[1, LOAD] != 0.0 else 1
    for k in range(2):
        # The start is as sensors report it: an encoder's scale acts on the angle from its zero (contract, section 3).
        th[k] = start[3 + k] / side[k, W_GAIN]
        ke[k], km[k] = side[k, KB] * ratio, ratio * side[k, KM]
        inertia[k], plain[k] = ratio * ratio * side[k, J], ratio * ratio * side[k, B] + side[k, VISCOUS_W]
        w[k] = start[5 + k] / side[k, W_GAIN]
        wm[k] = w[k]
        wf[k] = sensors.behind(w[k], start[9 + k] / side[k, W_GAIN], side[k, W_TAU], side[k, W_DELAY])
        cur[k] = sensors.initial_current(start[7 + k], start[11 + k], start[13 + k], side[k, I_GAIN], side[k, I_BIAS])
        integ[k] = held_integral(side, k, com, cur[k], w[k])
        contact[k] = gear.SPRING if side[k, STIFF] > 0.0 else (gear.FREE if side[k, BACKLASH] > 0.0 else gear.RIGID)
        flexible = flexible or contact[k] != gear.RIGID
        dry = dry or dry_of(side, k, com) or (curves is not None and forms.holds(curves[k]))
    acts = np.zeros((2, forms.ACTS))  # what the forms of a side come to in a step
    about = np.zeros(forms.ABOUT)  # what they run over
    past = np.zeros((2, forms.PAST))  # what they remember
    slipping = side[0, SLIP] != 0.0 or side[1, SLIP] != 0.0
    tyre = np.zeros(2)  # shear of the tyres over their relaxation length
    whole = np.zeros(2)  # force that this shear would give with all the grip there could be
    shear_tau = np.zeros(2)  # damping over stiffness
    theta = np.ones(2)  # weight of a step's end in its equation (theta method)
    give, tangent, taken, asked = np.zeros(2), np.ones(2), np.zeros(2), np.zeros(2)
    yield_z = np.zeros(2)
    grip = np.ones(2)  # N, what a tyre's traction tends to
    if slipping:
        for k in range(2):
            shear_tau[k] = ground.shear_time(side[k, SLIP_DAMPING], side[k, SLIP], side[k, SLIP_LENGTH])
            grip[k] = ground.grip_of(side[k, SLIP_GRIP], mass)
    # Inverse of the body's inertia for (v, yaw rate): the centre of mass next to the axle couples them.
    i22 = 1.0 / (com[IZ] - mass * com[COM_Y] ** 2) if axis == 0 else 1.0
    i12 = com[COM_Y] * i22
    i11 = 1.0 / mass + com[COM_Y] * i12 if axis == 0 else 1.0
    v, rate = 0.0, 0.0
    if axis == 0:
        v = 0.5 * (side[0, RADIUS] * w[0] + side[1, RADIUS] * w[1])
        rate = (side[1, RADIUS] * w[1] - side[0, RADIUS] * w[0]) / com[TRACK]

    # What the step works with, a value a side.
    va = np.zeros(2)  # command in force, clipped
    vd = np.zeros(2)  # voltage behind dead zone and gain, at the nominal bus
    ve = np.zeros(2)  # the same with what fast decay and forms add
    vp, vf = np.zeros(2), np.zeros(2)  # voltage without the driver's curve, and what fast decay adds
    gained = np.zeros(2)  # rad/s², of the rotors in the step before
    c0, c1, m0, m1 = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    im = np.zeros(2)
    am, bm = np.zeros(2), np.zeros(2)
    alpha, beta = np.zeros(2), np.zeros(2)
    hi, lo = np.zeros(2), np.zeros(2)
    wn, wmn, tin, tout = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    # The encoder sits at the gear's output, before any play or spring, or behind them (contract, section 2).
    seen, seen_n, before = (w, wn, 0.0) if com[AT_WHEEL] > 0.0 else (wm, wmn, 1.0)
    bounces = np.zeros(2, np.bool_)
    was = np.zeros(2, np.int64)  # regime and force as a step begins, to take it again
    held = np.zeros(2)
    apart = np.zeros(2)  # rotor's speed less the wheel's after a step in contact
    # Constants of the armature's exact solution, of the step and the resistance they were taken for.
    usual, shear_i = 0.0, np.zeros(2)
    of_h, of_r = np.full(2, -1.0), np.full(2, -1.0)
    decay, rise_v, mean_v, mean_i = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    # Likewise of the mechanics, of a rotor's resistance to a change of speed: its inverse alone, with the load, at a
    # spring whose other end stands still, and a load's behind a spring with its rotor free or held.
    of_a, of_s = np.full(2, -1.0), np.full(2, -1.0)
    free_i, rigid_i, spring_i, behind_i, held_i = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    kap = np.zeros(2)
    of_0, of_1, of_w, det = 0.0, 0.0, 0.0, 0.0
    p = np.zeros(2)
    swung, weight = com[AX_M] + run[0], 0.0  # an axis' mass, kg, and its weight's torque in the step, N·m
    load_j = load_inertia(com, run[0])
    load_i = 1.0 / load_j

    now = t[0]
    kc = 0  # next command to act, at t_cmd[kc] + dc
    ka = 0  # next delayed sample, the state at t[ka] - dm
    kw = np.zeros(2, np.int64)  # next sample of a speed that is later than that by its own delay, where it is
    lagging = side[0, W_DELAY] > 0.0 or side[1, W_DELAY] > 0.0
    reading = np.zeros(2)  # of such a sensor as the last step ended
    for k in range(2):
        reading[k] = sensors.speed_read(wf[k], seen[k], side[k, W_TAU], side[k, W_GAIN])
    kp = 0  # next pose sample, at t[kp] - dp
    if axis > 0:
        # It has no pose.
        kp = n
        out[:, 8:] = 0.0
    servo_next = t[0]
    level = 1.0  # bus over its nominal voltage
    row_bus = bus_log[0]
    wanted = np.zeros(2)  # command in force, as given
    end = t[n - 1]
    while kp < n or ka < n:
        # ---- events at this instant: samples first, then commands (contract, section 1)
        while kp < n and t[kp] - dp <= now + 1e-9:
            out[kp, 8] = x
            out[kp, 9] = y
            out[kp, 10] = yaw
            kp += 1
        while ka < n and t[ka] - dm <= now + 1e-9:
            current = 0.0
            for k in range(sides):
                current += driver.bus_current(cur[k], va[k], supply)
            bus = driver.loaded_bus(supply, com[SOURCE_R], current, com[DECLINE], now - run[3])
            out[ka, 0] = row_bus if com[BUS_MEAS] > 0.0 else bus
            for k in range(2):
                amperes = sensors.scaled(cur[k], side[k, I_GAIN], side[k, I_BIAS])
                speed = sensors.speed_read(wf[k], seen[k], side[k, W_TAU], side[k, W_GAIN])
                if curves is not None:
                    amperes += forms.reads(curves[k], CURRENT, OVER_I + 1, amperes)
                    speed += forms.reads(curves[k], SPEED, OVER_W + 1, speed)
                out[ka, 1 + k] = amperes
                if side[k, W_DELAY] <= 0.0:
                    out[ka, 3 + k] = speed
                out[ka, 5 + k] = (th[k] + before * play[k]) * side[k, W_GAIN]
            out[ka, 7] = sensors.scaled(rate, com[GYRO_GAIN], com[GYRO_BIAS])
            if curves is not None:
                out[ka, 7] += forms.turns_read(curves[0], out[ka, 7], t[ka] - dm - run[3])
            ka += 1
        if lagging:
            for k in range(2):
                later = dm + side[k, W_DELAY]
                while side[k, W_DELAY] > 0.0 and kw[k] < n and t[kw[k]] - later <= now + 1e-9:
                    speed = sensors.speed_read(wf[k], seen[k], side[k, W_TAU], side[k, W_GAIN])
                    if curves is not None:
                        speed += forms.reads(curves[k], SPEED, OVER_W + 1, speed)
                    if t[kw[k]] - later < t[0]:
                        # Before a start the speed is what lies between the start and what is reported then.
                        speed = start[9 + k] + (speed - start[9 + k]) * (t[kw[k]] - t[0]) / later
                    out[kw[k], 3 + k] = speed
                    kw[k] += 1
        if kp >= n and ka >= n:
            break
        changed = False
        while kc < m and t_cmd[kc] + dc <= now + 1e-9:
            changed = True
            row_bus = bus_log[kc]
            for k in range(sides):
                wanted[k] = cmd[kc, k]
                if mode != 2:
                    va[k] = driver.clipped(cmd[kc, k], supply) if mode == 0 else cmd[kc, k]
            kc += 1
        if mode == 2 and servo_next <= now + 1e-9:
            changed = True
            for k in range(sides):
                told = seen[k] * side[k, W_GAIN]
                if curves is not None:
                    told += forms.reads(curves[k], SPEED, OVER_W + 1, told)
                va[k], integ[k] = served(side, k, com, wanted[k], integ[k], told)
            while servo_next <= now + 1e-9:
                servo_next += com[SERVO_T]
        if changed:
            for k in range(sides):
                vd[k] = driver.duty(va[k], supply, side[k, CURVE], side[k, DEADZONE], side[k, V_GAIN])
                ve[k] = vd[k]
                if decays:
                    vp[k] = driver.duty(va[k], supply, 0.0, side[k, DEADZONE], side[k, V_GAIN])
                if curves is not None:
                    forms.follow(curves[k], va[k], past[k])

        # ---- next event
        ahead = min(t[kp] - dp if kp < n else end + 1.0, t[ka] - dm if ka < n else end + 1.0)
        if kc < m:
            ahead = min(ahead, t_cmd[kc] + dc)
        if mode == 2:
            ahead = min(ahead, servo_next)
        span = ahead - now
        if span <= 1e-9:
            now = ahead
            continue
        done = 0.0
        limit = 0.0
        h = span
        dir_x, dir_y = math.cos(yaw), math.sin(yaw)
        parts = False  # whether flanks part in this span
        while span - done > 1e-9:
            bound = h_max
            if flexible:
                for k in range(sides):
                    was[k], held[k] = contact[k], force[k]
                    if contact[k] == gear.FREE or parts:
                        bound = min(h_max, h_play)
            if bound != limit:
                limit = bound
                count = math.ceil((span - done) / limit - 1e-9)
                h = (span - done) / count
                if abs(h - usual) * count < 1e-10:
                    h = usual  # spans differ in their last digits, and much is kept from step to step
                if usual != h:
                    usual = h
                    for k in range(2):
                        theta[k], shear_i[k] = ground.shear_step(h, shear_tau[k])
            elapsed = now + done - run[3]
            done += h
            gx, gz = ground.offset_forces(mass, com[COM_X], v, rate)
            if pull != 0.0:
                mid_x, mid_y = turned_by(dir_x, dir_y, 0.5 * h * rate)
                along, across = mid_x * up_x + mid_y * up_y, mid_y * up_x - mid_x * up_y
                gx -= pull * along
                gz += ground.slope_torque(pull, com[COM_X], com[COM_Y], along, across)
            for k in range(sides):
                wn[k], wmn[k] = w[k], wm[k]
                if flexible:
                    bounces[k] = gear.bounces(contact[k] == gear.FREE, side[k, RESTITUTION], wmn[k], wn[k])
                if mode != 1:
                    res = motor.warm(side[k, R], rise[k])
                    if of_h[k] != h or of_r[k] != res:
                        of_h[k], of_r[k] = h, res
                        decay[k], rise_v[k], mean_v[k], mean_i[k], c1[k], m1[k] = motor.armature_factors(
                            h, res, side[k, L], side[k, KB] * ratio, exponential
                        )
                if decays:
                    # The voltage follows the back EMF: at the speed that the middle of the step is going to have.
                    emf = ke[k] * (wm[k] + 0.5 * h * gained[k]) / max(level, LEAST_LEVEL)
                    vf[k] = driver.decay_adds(vd[k], vp[k], emf, supply, side[k, FAST], side[k, PERIODS], exponential)
                    ve[k] = vd[k] + vf[k]
                if slipping and side[k, SLIP] > 0.0:
                    rim, slip, length = side[k, RADIUS] * wn[k], side[k, SLIP], side[k, SLIP_LENGTH]
                    slid = rim - v - (2 * k - 1) * half * rate
                    give[k], yield_z[k], tangent[k], taken[k] = ground.shear(
                        h, slip, length, theta[k], shear_i[k], grip[k], whole[k], tyre[k], abs(rim), slid, math.tanh
                    )
            if curves is not None:
                about[OVER_RATE], about[OVER_SPEED], about[OVER_TURNS] = rate, v, v * rate
                about[OVER_T], about[OVER_X], about[OVER_Y], about[OVER_YAW] = elapsed, x, y, yaw
                for k in range(sides):
                    about[OVER_V], about[OVER_I], about[OVER_W] = va[k], cur[k], wm[k]
                    about[OVER_HISTORY] = past[k, forms.DIRECTION] * abs(va[k])
                    about[OVER_LOAD] = past[k, forms.GEAR_LOAD]
                    at = th[k] + 0.5 * h * w[k]
                    if angle.shape[0] > 0 and kc > 0:
                        at = _followed(angle, t_cmd, kc, k, now + done - 0.5 * h - dc) / side[k, W_GAIN]
                    about[OVER_TH], about[OVER_MOTOR] = at, ratio * at
                    if mode != 1:
                        # What the current comes to with the forms of the step before.
                        emf = ke[k] * wm[k]
                        volts = (vd[k] + vf[k] + acts[k, forms.VOLTS]) * level
                        volts = driver.winding_voltage(
                            volts, emf, side[k, LIMIT], side[k, DROP], side[k, KNEE], side[k, R]
                        )
                        mean = motor.even_current(cur[k], volts, emf, decay[k], rise_v[k], mean_v[k], mean_i[k])
                        about[forms.MEAN_I] = mean
                    forms.act(curves[k], about, past[k], acts[k])
                    ve[k] = vd[k] + vf[k] + acts[k, forms.VOLTS]
                    # What changes the torque of a current changes the back-EMF of a speed alike.
                    constant = 1.0 + acts[k, forms.CONSTANT]
                    ke[k], km[k] = side[k, KB] * ratio * constant, ratio * side[k, KM] * constant
                    if mode != 1:
                        c1[k], m1[k] = motor.armature_slopes(ke[k] * mean_v[k], decay[k], mean_i[k])
                gx += acts[0, forms.PUSH]
                gz += acts[0, forms.TURN]
                scrub = com[SCRUB] + acts[0, forms.SCRUB]
            if com[SOURCE_R] != 0.0 and mode != 1:
                for k in range(sides):
                    # What the current comes to at the bus before and an even speed.
                    emf = ke[k] * wm[k]
                    volts = driver.winding_voltage(
                        ve[k] * level, emf, side[k, LIMIT], side[k, DROP], side[k, KNEE], side[k, R]
                    )
                    im[k] = motor.even_current(cur[k], volts, emf, decay[k], rise_v[k], mean_v[k], mean_i[k])
            if axis == 2:
                weight = ground.pendulum(swung, com[AX_ARM], th[0] + 0.5 * h * wn[0] - com[AX_ZERO], math.sin)
            for trial in range(outer):
                # ---- driver and armature: mean current = m0 - m1 * rotor speed at the end of the step
                bus = driver.unloaded_bus(supply, com[DECLINE], elapsed + 0.5 * h)
                if com[SOURCE_R] != 0.0:
                    # Newton's step: a higher bus drives more current, which lowers it.
                    current, lowers = 0.0, 0.0
                    for k in range(sides):
                        current += driver.bus_current(im[k], va[k], supply)
                        lowers += motor.bus_current_slope(mean_v[k], mean_i[k], rise_v[k], ve[k], va[k], supply)
                    bus = driver.sagging(supply, com[SOURCE_R], level, bus, current, lowers)
                level = (row_bus if com[BUS_MEAS] > 0.0 else bus) / supply
                for k in range(sides):
                    if mode == 1:
                        drive = driver.amplifier(ve[k] * level, side[k, LIMIT], com[TORQUE_V]) * ratio
                        slope_w = 0.0
                        c0[k], c1[k], m0[k], m1[k] = 0.0, 0.0, 0.0, 0.0
                    else:
                        volts = driver.winding_voltage(
                            ve[k] * level, ke[k] * wmn[k], side[k, LIMIT], side[k, DROP], side[k, KNEE], side[k, R]
                        )
                        c0[k], m0[k] = motor.armature(
                            cur[k], volts, ke[k], wmn[k], decay[k], rise_v[k], mean_v[k], mean_i[k], c1[k]
                        )
                        drive, slope_w = km[k] * m0[k], km[k] * m1[k]
                    # The load's inertia and torques join the rotor's while the gear is rigid.
                    torque = drive
                    if shaped and shaped_by(side, k):
                        at = th[k] + 0.5 * h * wn[k]
                        if angle.shape[0] > 0 and kc > 0:
                            at = _followed(angle, t_cmd, kc, k, now + done - 0.5 * h - dc) / side[k, W_GAIN]
                        torque += torque_of(at, wmn[k], side, k, math.sin)
                    fluid = plain[k]
                    if side[k, ASYM_V] != 0.0:
                        fluid = friction.viscous(fluid, side[k, ASYM_V], wmn[k])
                    if curves is not None:
                        torque += acts[k, forms.DRIVE]
                        fluid += acts[k, forms.FLUID]
                    am[k], bm[k] = motor.rotor_balance(h, inertia[k], fluid, torque, slope_w, wmn[k])
                    if of_a[k] != am[k] or of_s[k] != h:
                        of_a[k], of_s[k] = am[k], h
                        rigid_i[k] = 1.0 / (am[k] + load_j)
                        if flexible:
                            # Implicit mid-point for the spring: its mean torque = t0 + kap * (rotor - wheel).
                            kap[k] = gear.spring_gain(h, side[k, STIFF], side[k, DAMP])
                            free_i[k] = 1.0 / am[k]
                            spring_i[k] = 1.0 / (am[k] + h * kap[k])
                            held_i[k] = gear.held_gain(h, load_j, kap[k])
                            behind_i[k] = gear.behind_gain(h, load_j, kap[k], spring_i[k])
                    if dry:
                        f = side[k, COULOMB]
                        if side[k, STRIBECK] != 0.0:
                            f += friction.stribeck(wmn[k] / side[k, STRIBECK_W], side[k, STRIBECK], exponential)
                        if com[ROLLING] != 0.0 and axis == 0:
                            f += friction.rolling(com[ROLLING], mass, side[k, RADIUS])
                        if side[k, LOAD] != 0.0:
                            if trial == 0:
                                # The torque at the gear's input as the step begins, from the force of the step before.
                                tout[k] = side[k, RADIUS] * force[k] if axis == 0 else tout[k]
                            f += friction.by_load(side[k, LOAD], tin[k], tout[k])
                        hi[k], lo[k] = friction.bounds(h, f, side[k, ASYM])
                        if curves is not None:
                            hi[k] += h * acts[k, forms.FORWARD]
                            lo[k] -= h * acts[k, forms.BACKWARD]

                # ---- velocities at the end of the step
                if dry and trial == 0:
                    for k in range(sides):
                        stick[k] = 1 if wmn[k] > 0.0 else (-1 if wmn[k] < 0.0 else 0)
                spin = friction.direction(rate) if scrub != 0.0 else 0.0
                rate_new, v_new = 0.0, 0.0
                for attempt in range(20):
                    for k in range(sides):
                        rad = side[k, RADIUS]
                        p[k] = 0.0
                        if dry:
                            p[k] = friction.impulse(stick[k], hi[k], lo[k])
                        kind = contact[k]
                        bw = load_j * wn[k] + h * weight
                        if kind == gear.RIGID:
                            if dry and stick[k] == 0:
                                alpha[k], beta[k] = 0.0, 0.0
                            else:
                                alpha[k] = (bm[k] + bw - p[k]) * rigid_i[k]
                                beta[k] = h * rad * rigid_i[k]
                        elif kind == gear.SPRING:
                            t0 = gear.spring_start(side[k, STIFF], play[k], kap[k], wmn[k], wn[k])
                            if dry and stick[k] == 0:
                                alpha[k] = (bw + h * t0) * held_i[k]
                                beta[k] = h * rad * held_i[k]
                            else:
                                rotor0 = (bm[k] - h * t0 - p[k]) * spring_i[k]
                                alpha[k] = (bw + h * t0 + h * kap[k] * rotor0) * behind_i[k]
                                beta[k] = h * rad * behind_i[k]
                        elif kind == gear.FREE:
                            alpha[k] = bw * load_i
                            beta[k] = h * rad * load_i
                        else:
                            # What the rotor is faster than the wheel afterwards.
                            forwards = kind == gear.PUSH_F
                            meets = bounces[k] and (wmn[k] > wn[k]) == forwards
                            to_flank = gear.flank(side[k, BACKLASH], forwards) - play[k]
                            apart[k] = gear.parting(to_flank, h, side[k, RESTITUTION], wmn[k], wn[k], meets)
                            if dry and stick[k] == 0:
                                alpha[k], beta[k] = -apart[k], 0.0
                            else:
                                alpha[k] = (bm[k] + bw - p[k] - am[k] * apart[k]) * rigid_i[k]
                                beta[k] = h * rad * rigid_i[k]
                    if axis > 0:
                        force[0] = 0.0
                        w[0] = alpha[0]
                    else:
                        w0, w1, wx = ground.wheel_moves(h, i11, i12, i22, half)
                        a00 = side[0, RADIUS] * beta[0] + w0
                        a11 = side[1, RADIUS] * beta[1] + w1
                        if slipping:
                            a00 += give[0]
                            a11 += give[1]
                        if a00 != of_0 or a11 != of_1 or wx != of_w:
                            of_0, of_1, of_w = a00, a11, wx
                            det = 1.0 / (a00 * a11 - wx * wx)
                        q = spin * h * scrub
                        for turn in range(2):
                            dv, dr = ground.body_moves(h, i11, i12, i22, gx, gz, q)
                            rim0, rim1 = side[0, RADIUS] * alpha[0], side[1, RADIUS] * alpha[1]
                            b0, b1 = ground.rim_gaps(v, rate, half, dv, dr, rim0, rim1, yield_z[0], yield_z[1])
                            force[0], force[1] = ground.tractions(a00, a11, wx, det, b0, b1)
                            if slipping:
                                asked[0], asked[1] = force[0], force[1]
                                slip0, slip1 = side[0, SLIP], side[1, SLIP]
                                force[0], force[1] = ground.on_ground(
                                    force[0], force[1], b0, b1, a00, a11, wx, slip0, slip1, grip[0], grip[1]
                                )
                            rate_new = rate + dr + ground.yawed(h, i12, i22, half, force[0], force[1])
                            if scrub == 0.0 or turn == 1 or spin * rate_new > 0.0:
                                break
                            # The scrub would reverse the turn: find the impulse that stops it, within its bound.
                            gain = ground.scrub_gain(h, i12, i22, half, a00, a11, wx, det)
                            q = ground.stopping(q, rate_new, gain, h * scrub, i22)
                        v_new = v + dv + ground.pushed(h, i11, i12, half, force[0], force[1])
                        for k in range(2):
                            w[k] = alpha[k] - beta[k] * force[k]
                    # ---- does the guessed regime hold?
                    again = False
                    for k in range(sides):
                        kind = contact[k]
                        stuck = dry and stick[k] == 0
                        if kind == gear.RIGID:
                            wm[k] = w[k]
                            need = bm[k] + load_j * wn[k] - h * side[k, RADIUS] * force[k] + h * weight
                        elif kind == gear.SPRING:
                            t0 = gear.spring_start(side[k, STIFF], play[k], kap[k], wmn[k], wn[k])
                            wm[k] = 0.0 if stuck else (bm[k] - h * t0 - p[k] + h * kap[k] * w[k]) * spring_i[k]
                            need = bm[k] - h * (t0 - kap[k] * w[k])
                        elif kind == gear.FREE:
                            wm[k] = 0.0 if stuck else (bm[k] - p[k]) * free_i[k]
                            need = bm[k]
                            moved = play[k] + h * (wm[k] - w[k])
                            if moved > gear.flank(side[k, BACKLASH], True):
                                contact[k] = gear.PUSH_F
                                again = True
                            elif moved < gear.flank(side[k, BACKLASH], False):
                                contact[k] = gear.PUSH_B
                                again = True
                        else:
                            wm[k] = w[k] + apart[k]
                            # Impulse the rotor passes on; a gear can push but not pull.
                            push = load_j * (w[k] - wn[k]) + h * side[k, RADIUS] * force[k] - h * weight
                            need = bm[k] - push
                            pulls = (kind == gear.PUSH_F and push < 0.0) or (kind == gear.PUSH_B and push > 0.0)
                            if pulls and attempt < 10:
                                contact[k] = gear.FREE
                                again = True
                        if stuck:
                            stick[k] = int(friction.breaks_away(need, hi[k], lo[k]))
                            again = again or stick[k] != 0
                        elif dry and stick[k] * wm[k] < 0.0 and (attempt < 10 or kind <= gear.SPRING):
                            stick[k] = 0
                            again = True
                    if not again:
                        break
                if outer > 1:
                    for k in range(sides):
                        im[k] = m0[k] - m1[k] * wm[k]
                        if side[k, LOAD] != 0.0:
                            torque = ratio * side[k, KM] * im[k]
                            if curves is not None:
                                torque *= 1.0 + acts[k, forms.CONSTANT]
                            if mode == 1:
                                torque = driver.amplifier(ve[k] * level, side[k, LIMIT], com[TORQUE_V]) * ratio
                            tin[k] = motor.gear_input(h, torque, plain[k], inertia[k], wmn[k], wm[k])
                            tout[k] = load_j * (w[k] - wn[k]) / h + side[k, RADIUS] * force[k] - weight

            # ---- a long step ends where flanks part: once more, in short ones
            if flexible and bound > h_play:
                for k in range(sides):
                    if contact[k] != was[k]:
                        parts = True
                if parts:
                    done -= h
                    for k in range(sides):
                        w[k], wm[k] = wn[k], wmn[k]
                        contact[k], force[k] = was[k], held[k]
                    continue

            # ---- accept the step
            for k in range(sides):
                mean = m0[k] - m1[k] * wm[k]
                cur[k] = c0[k] - c1[k] * wm[k]
                if decays:
                    gained[k] = (wm[k] - wmn[k]) / h
                if side[k, HEAT_RISE] != 0.0:
                    res = motor.warm(side[k, R], rise[k])
                    rise[k] = motor.warmer(rise[k], h, side[k, HEAT_RISE], side[k, HEAT_TAU], mean, res)
                th[k] += 0.5 * h * (wn[k] + w[k])
                if flexible:
                    if contact[k] == gear.SPRING:
                        play[k] = gear.spring_play(play[k], h, wmn[k], wm[k], wn[k], w[k])
                    elif contact[k] >= gear.PUSH_F and bounces[k] and (wm[k] > w[k]) != (contact[k] == gear.PUSH_F):
                        at_flank = gear.flank(side[k, BACKLASH], contact[k] == gear.PUSH_F)
                        play[k] = gear.bounced_play(at_flank, play[k], h, wmn[k], wn[k], apart[k])
                        contact[k] = gear.FREE
                    elif contact[k] != gear.RIGID:
                        play[k] += h * (wm[k] - w[k])
                if curves is not None:
                    delivered = load_j * (w[k] - wn[k]) / h + side[k, RADIUS] * force[k] - weight
                    forms.remember(curves[k], delivered, mean, h, past[k])
                tau = side[k, W_TAU]
                if tau > 0.0:
                    wf[k] = sensors.low_pass(wf[k], seen[k], seen_n[k], h, tau, math.exp(-h / tau))
                if side[k, W_DELAY] > 0.0:
                    began, ended_s, later = reading[k], now + done, dm + side[k, W_DELAY]
                    reading[k] = sensors.speed_read(wf[k], seen[k], tau, side[k, W_GAIN])
                    while kw[k] < n and t[kw[k]] - later <= ended_s:
                        speed = sensors.within_step(began, reading[k], (ended_s - (t[kw[k]] - later)) / h)
                        if curves is not None:
                            speed += forms.reads(curves[k], SPEED, OVER_W + 1, speed)
                        out[kw[k], 3 + k] = speed
                        kw[k] += 1
            if axis == 0:
                v_mid = 0.5 * (v + v_new)
                rate_mid = 0.5 * (rate + rate_new)
                turned = 0.5 * h * rate_mid
                if turned != 0.0:
                    dir_x, dir_y = turned_by(dir_x, dir_y, turned)
                x += h * v_mid * dir_x
                y += h * v_mid * dir_y
                if turned != 0.0:
                    dir_x, dir_y = turned_by(dir_x, dir_y, turned)
                yaw += h * rate_mid
                v = v_new
                rate = rate_new
                if slipping:
                    for k in range(2):
                        if side[k, SLIP] > 0.0:
                            whole[k] = ground.sheared(whole[k], asked[k], taken[k], tangent[k], grip[k])
                            tyre[k] = ground.relaxed(h, tyre[k], side[k, SLIP], whole[k], shear_i[k])
        now = ahead
        bad = not (abs(v) < 1e6 and abs(rate) < 1e6)
        for k in range(sides):
            bad = bad or not (abs(w[k]) < 1e6 and abs(cur[k]) < 1e6)
        if bad:
            out[min(ka, kp) :] = 1e6
            return


@loop
def replay_runs(inputs, starts, first, model, steps, out):
    """Replay runs that lie one after another in memory, without a way back to Python between them: pieces of an axis
    are short, and a call would cost more than what it computes.

    Parameters
    ----------
    inputs : times, where each run begins in them (runs + 1,), times of the commands, commands, bus, where each run
        begins in the commands, angles, where each run begins in these, and one row of each run: as of `replay`.
    starts : one row of each run that is wanted, from `first` on.
    model : side, com and curves; steps : h_max and h_play; out : (n, 11) of the runs wanted.
    """
    t, rows, t_cmd, cmd, bus_log, at_cmd, angle, at_angle, runs = inputs
    side, com, curves = model
    h_max, h_play = steps
    for k in range(len(starts)):
        r = first + k
        a, b, c, d, e, f = rows[r], rows[r + 1], at_cmd[r], at_cmd[r + 1], at_angle[r], at_angle[r + 1]
        driven = t[a:b], t_cmd[c:d], cmd[c:d], bus_log[c:d], angle[e:f]
        into = out[a - rows[first] : b - rows[first]]
        replay(*driven, side, com, curves, runs[r], starts[k], h_max, h_play, into)
