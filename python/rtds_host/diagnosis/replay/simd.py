"""The inner loop of several replays at a time, eight in a SIMD batch.

A step waits for itself: each of its operations needs the one before. Eight replays that do not wait for one another
fill a processor's vector unit instead, each in a lane, which is one element of its registers. Each lane goes through
events and steps of its own and begins the next job when its run is through, so that models with other delays and runs
of other lengths go together. Equations and method are those of `kernel.replay`; a regime that a lane is not in is
computed all the same and passed over, and what no lane has is left out. All models of a batch are of one robot: an
axis has one side and no body.
"""

from __future__ import annotations

import math

import numpy as np

from rtds_host.diagnosis.replay import kernel as one
from rtds_host.diagnosis.replay.kernel import LEAST_LEVEL, TRIALS
from rtds_host.plant import driver, forms, friction, gear, ground, motor, sensors
from rtds_host.plant.compiled import allocation_free, law, loop
from rtds_host.plant.elementary import cos_less_one, exp_minus, sin, sine, tanh
from rtds_host.plant.schema import COMMON, SIDE, SIDE_INDEX, common_indices, side_indices
from rtds_host.plant.torque import functions
from rtds_host.plant.torques import TORQUES

# Numerical: numbers in a vector register of the widest processors; narrower ones take two or four for it.
SIMD_WIDTH = 8
# Numerical: s, the time of what does not come any more.
NEVER = 1e300
# Numerical: s over a span, what its steps may be longer or shorter and still count as alike.
ALIKE_S = 1e-10

# Rows of the state, each `SIMD_WIDTH` long, at these offsets: of a side, twice, its parameters first, in the schema's
# order; of the robot, likewise; and of what is the same in a run.
# fmt: off
(RES, IND, LIM, DROP, ASYM_V, HEAT, HEAT_TAU, ASYM, RADIUS, SPEED_TAU, STRIBECK, STRIBECK_W, W_GAIN, I_GAIN, I_BIAS,
 CURVE, DEADZONE, V_GAIN, SLIP, LENGTH, LOAD, BACKLASH, RESTITUTION, STIFF, DAMP, KNEE, FAST, PERIODS) = (
    k * SIMD_WIDTH for k in side_indices(
        "resistance", "inductance", "limit", "drop", "asymmetry_viscous", "heat_rise", "heat_tau", "asymmetry",
        "radius", "speed_tau", "stribeck", "stribeck_speed", "speed_gain", "current_gain", "current_bias", "pwm_curve",
        "deadzone", "voltage_gain", "slip", "slip_relaxation", "load_share", "backlash", "restitution", "stiffness",
        "damping", "drop_knee", "fast_decay", "pwm_periods"))
_SIDE_ROWS = len(SIDE) + 74
(KE, GKM, INERTIA, FLUID, FRICTION, EXTRA, TH, W, CUR, RISE, WF, VA, VD, STICK, WN, C0, M0, DECAY, RISE_V, MEAN_V,
 MEAN_I, C1, M1, FADE, THETA, PER_SHEAR, AM, BM, RIGID, HI, LO, SHAPED, FORCE, ALPHA, BETA, SHEAR_TAU, GRIP,
 TYRE, WHOLE, GIVE, YIELDS, TANGENT, TAKEN, ASKED, MEAN, INPUT, OUTPUT, WM, WMN, PLAY, CONTACT, WAS, HELD, KAP,
 FREE_I, SPRING_I, HELD_I, BEHIND_I, TURN, APART, BOUNCES, TANGLED, AT, AHEAD, OWN_GKM, OWN_FLUID, OWN_FRICTION,
 OWN_VD, OWN_KE, MADE, DRIVE, PLAIN_VD, DECAYED, GAINED) = (
    k * SIMD_WIDTH for k in range(len(SIDE), _SIDE_ROWS))
_SIDE = _SIDE_ROWS * SIMD_WIDTH
_COMMON = 2 * _SIDE
(SUPPLY, DECLINE, MEASURED, LOAD_J, MASS, COM_X, COM_Y, SCRUB, GYRO_GAIN, GYRO_BIAS, SOURCE, POSE_DELAY, COMMAND_DELAY,
 AT_WHEEL, RATIO, PER_VOLT, SWUNG, ARM, ZERO) = (
    _COMMON + k * SIMD_WIDTH for k in common_indices(
        "supply", "decline", "bus_measured", "wheel_inertia", "mass", "com_x", "com_y", "scrub", "gyro_gain",
        "gyro_bias", "source_resistance", "latency", "command_delay", "encoder_at_wheel", "gear_ratio",
        "torque_per_volt", "axis_mass", "axis_arm", "axis_zero"))
_COMMON_ROWS = len(COMMON) + 38
(H, BEGUN, NOW, DONE, BUS_ROW, I11, I12, I22, HALF, PULL, UP_X, UP_Y, DRY, LEVEL, GX, GZ, X, Y, YAW, V, RATE, DIR_X,
 DIR_Y, RATE_N, V_N, DV, BRAKE, A00, A11, WX, DET, SPIN, H_MAX, DELAY, FOLLOWS, SINCE, PER_SPAN, WEIGHT) = (
    _COMMON + k * SIMD_WIDTH for k in range(len(COMMON), _COMMON_ROWS))
# fmt: on
# Rows that accepting a step changes.
_ACCEPTED: tuple[int, ...] = (X, Y, YAW, DIR_X, DIR_Y, V, RATE)
_ACCEPTED += tuple(o + row for o in (0, _SIDE) for row in (CUR, RISE, TH, WF, PLAY, WHOLE, TYRE, GAINED))
# Regimes of a side's gear, as numbers that a row holds.
_RIGID, _SPRING, _FREE, _PUSH_F, _PUSH_B = map(float, (gear.RIGID, gear.SPRING, gear.FREE, gear.PUSH_F, gear.PUSH_B))
# Numerical: numbers that the state has.
SIZE = _COMMON + _COMMON_ROWS * SIMD_WIDTH
# The sum of torques over the wheel's angle or speed, of a lane's rows.
_torque_of = law(functions(TORQUES, "s, o, l", lambda entry: f"s[o + {SIDE_INDEX[entry.name] * SIMD_WIDTH} + l]")[0])


@allocation_free
def _begin(s, l, side, com, curves, run, start):
    """Set a lane to the start of a run; arguments as of `kernel.replay`."""
    ratio, axis = com[one.GEAR], int(com[one.AXIS])
    mass = com[one.MASS] + run[0]
    dry = 0.0
    sides = 1 if axis > 0 else 2
    for n in range(len(com)):
        s[_COMMON + n * SIMD_WIDTH + l] = com[n]
    for k in range(sides):
        o = k * _SIDE + l
        for n in range(side.shape[1]):
            s[o + n * SIMD_WIDTH] = side[k, n]
        s[o + KE], s[o + GKM] = side[k, one.KB] * ratio, ratio * side[k, one.KM]
        s[o + INERTIA] = ratio * ratio * side[k, one.J]
        s[o + FLUID] = ratio * ratio * side[k, one.B] + side[k, one.VISCOUS_W]
        s[o + FRICTION] = side[k, one.COULOMB] + friction.rolling(com[one.ROLLING], mass, side[k, one.RADIUS])
        # What forms change from step to step is kept without them.
        s[o + OWN_GKM], s[o + OWN_FLUID], s[o + OWN_FRICTION] = s[o + GKM], s[o + FLUID], s[o + FRICTION]
        s[o + OWN_KE], s[o + OWN_VD], s[o + MADE] = s[o + KE], 0.0, 0.0
        s[o + PLAIN_VD] = s[o + DECAYED] = s[o + GAINED] = 0.0
        if one.dry_of(side, k, com) or forms.holds(curves[k]):
            dry = 1.0
        s[o + SHEAR_TAU] = ground.shear_time(side[k, one.SLIP_DAMPING], side[k, one.SLIP], side[k, one.SLIP_LENGTH])
        s[o + GRIP] = ground.grip_of(side[k, one.SLIP_GRIP], mass) if side[k, one.SLIP] != 0.0 else 1.0
        s[o + FORCE] = s[o + INPUT] = s[o + OUTPUT] = s[o + TYRE] = s[o + WHOLE] = 0.0
        s[o + TH] = start[3 + k] / side[k, one.W_GAIN]
        s[o + W] = s[o + WM] = start[5 + k] / side[k, one.W_GAIN]
        s[o + WF] = sensors.behind(
            s[o + W], start[9 + k] / side[k, one.W_GAIN], side[k, one.W_TAU], side[k, one.W_DELAY]
        )
        s[o + CUR] = sensors.initial_current(
            start[7 + k], start[11 + k], start[13 + k], side[k, one.I_GAIN], side[k, one.I_BIAS]
        )
        s[o + CONTACT] = _SPRING if side[k, one.STIFF] > 0.0 else (_FREE if side[k, one.BACKLASH] > 0.0 else _RIGID)
        s[o + PLAY] = s[o + APART] = s[o + BOUNCES] = s[o + FADE] = 0.0
        s[o + RISE] = s[o + VA] = s[o + VD] = s[o + STICK] = s[o + SHAPED] = s[o + EXTRA] = 0.0
    s[H + l] = s[DONE + l] = 0.0
    s[LEVEL + l] = 1.0
    s[FOLLOWS + l] = s[SINCE + l] = s[PER_SPAN + l] = 0.0
    s[DELAY + l] = com[one.MEAS_DELAY] + com[one.LATENCY]
    s[COMMAND_DELAY + l] = com[one.CMD_DELAY] - com[one.CMD_EARLY]
    s[BEGUN + l] = run[3]
    s[MASS + l], s[DRY + l], s[WEIGHT + l] = mass, dry, 0.0
    s[V + l] = s[RATE + l] = 0.0
    if axis > 0:
        s[SWUNG + l] += run[0]
        s[LOAD_J + l] = one.load_inertia(com, run[0])
        return
    s[I22 + l] = 1.0 / (com[one.IZ] - mass * com[one.COM_Y] ** 2)
    s[I12 + l] = com[one.COM_Y] * s[I22 + l]
    s[I11 + l] = 1.0 / mass + com[one.COM_Y] * s[I12 + l]
    s[HALF + l] = 0.5 * com[one.TRACK]
    s[PULL + l] = ground.along_slope(mass, run[1] + com[one.SLOPE_X], math.sin)
    s[UP_X + l], s[UP_Y + l] = math.cos(run[2]), math.sin(run[2])
    s[X + l], s[Y + l], s[YAW + l] = start[0], start[1], start[2]
    s[DIR_X + l], s[DIR_Y + l] = math.cos(start[2]), math.sin(start[2])
    s[V + l] = 0.5 * (s[RADIUS + l] * s[W + l] + s[_SIDE + RADIUS + l] * s[_SIDE + W + l])
    s[RATE + l] = (s[_SIDE + RADIUS + l] * s[_SIDE + W + l] - s[RADIUS + l] * s[W + l]) / com[one.TRACK]


@allocation_free
def _told(curves, model, k, speed):
    """What forms add to a speed's reading, rad/s."""
    return forms.reads(curves[model, k], one.SPEED, one.OVER_W + 1, speed)


@allocation_free
def _read(out, row, curves, model, held_s, l, elapsed):
    """Add what forms do to the readings in a row of `out`, `elapsed` s after the run began.

    Speeds with a delay of their own come later.
    """
    for k in range(2):
        out[row, 1 + k] += forms.reads(curves[model, k], one.CURRENT, one.OVER_I + 1, out[row, 1 + k])
        if held_s[k, l] <= 0.0:
            out[row, 3 + k] += _told(curves, model, k, out[row, 3 + k])
    out[row, 7] += forms.turns_read(curves[model, 0], out[row, 7], elapsed)


@law
def _sticks(stick, speed, need, hi, lo, dry):
    """Which way a rotor turns once its speed, rad/s, is known, 0 while it is stuck, as 1, -1 or 0: a stuck one breaks
    away by the impulse that holding it would need, and one that would turn round stops."""
    breaks = friction.breaks_away(need, hi, lo)
    other = breaks if stick == 0.0 else (0.0 if stick * speed < 0.0 else stick)
    return other if dry > 0.0 else stick


@allocation_free
def _carried(s, ends, job, recalls, which, curves, redone, past):
    """Take what forms remember to the end of a step, which some lanes take once more; arguments: see `replay_batch`."""
    for l in range(SIMD_WIDTH):
        if not recalls[l] or redone[l]:
            continue
        for k in range(ends // _SIDE):
            o = k * _SIDE + l
            delivered = s[LOAD_J + l] * (s[o + W] - s[o + WN]) / s[H + l] + s[o + RADIUS] * s[o + FORCE] - s[WEIGHT + l]
            mean = s[o + M0] - s[o + M1] * s[o + WM]
            forms.remember(curves[which[job[l], 0], k], delivered, mean, s[H + l], past[l, k])


@allocation_free
def _formed(s, ends, job, curved, by_current, which, sides, coms, curves, shaped, about, acts, past):
    """Put into the rows of lanes that have forms what these come to in a step; arguments as in `replay_batch`."""
    for l in range(SIMD_WIDTH):
        if not curved[l]:
            continue
        model = which[job[l], 0]
        rate, v = s[RATE + l], s[V + l]
        half, elapsed = 0.5 * s[H + l], s[NOW + l] + s[DONE + l] - s[H + l] - s[BEGUN + l]
        about[one.OVER_RATE], about[one.OVER_SPEED], about[one.OVER_TURNS] = rate, v, v * rate
        about[one.OVER_T], about[one.OVER_X], about[one.OVER_Y] = elapsed, s[X + l], s[Y + l]
        about[one.OVER_YAW] = s[YAW + l]
        by_torque = coms[model, one.MODE] == 1.0
        for k in range(ends // _SIDE):
            o = k * _SIDE + l
            about[one.OVER_V], about[one.OVER_I], about[one.OVER_W] = s[o + VA], s[o + CUR], s[o + WM]
            about[one.OVER_HISTORY] = past[l, k, forms.DIRECTION] * abs(s[o + VA])
            about[one.OVER_LOAD] = past[l, k, forms.GEAR_LOAD]
            at = s[o + TH] + half * s[o + W]
            if s[FOLLOWS + l] > 0.0:
                share = (s[NOW + l] + s[DONE + l] - half - s[SINCE + l]) * s[PER_SPAN + l]
                at = s[o + AT] + min(max(share, 0.0), 1.0) * s[o + AHEAD]
            about[one.OVER_TH], about[one.OVER_MOTOR] = at, coms[model, one.GEAR] * at
            if by_current[l] and not by_torque:
                emf = s[o + KE] * s[o + WM]
                # What the current comes to with the forms of the step before.
                volts = driver.winding_voltage(
                    (s[o + OWN_VD] + s[o + DECAYED] + s[o + MADE]) * s[LEVEL + l],
                    emf,
                    s[o + LIM],
                    s[o + DROP],
                    s[o + KNEE],
                    s[o + RES],
                )
                decay, rise_v, mean_v, mean_i = s[o + DECAY], s[o + RISE_V], s[o + MEAN_V], s[o + MEAN_I]
                about[forms.MEAN_I] = motor.even_current(s[o + CUR], volts, emf, decay, rise_v, mean_v, mean_i)
            forms.act(curves[model, k], about, past[l, k], acts)
            s[o + SHAPED] = (s[o + SHAPED] if shaped else 0.0) + acts[forms.DRIVE]
            s[o + GKM] = s[o + OWN_GKM] * (1.0 + acts[forms.CONSTANT])
            s[o + FLUID] = s[o + OWN_FLUID] + acts[forms.FLUID]
            s[o + KE] = s[o + OWN_KE] * (1.0 + acts[forms.CONSTANT])
            if not by_torque:
                s[o + C1], s[o + M1] = motor.armature_slopes(s[o + KE] * s[o + MEAN_V], s[o + DECAY], s[o + MEAN_I])
            s[o + MADE] = acts[forms.VOLTS]
            s[o + VD] = s[o + OWN_VD] + s[o + DECAYED] + s[o + MADE]
            s[o + FRICTION] = s[o + OWN_FRICTION] + 0.5 * (acts[forms.FORWARD] + acts[forms.BACKWARD])
            s[o + ASYM] = sides[model, k, one.ASYM] + 0.5 * (acts[forms.FORWARD] - acts[forms.BACKWARD])
            if k == 0:
                s[GX + l] += acts[forms.PUSH]
                s[GZ + l] += acts[forms.TURN]
                s[SCRUB + l] = coms[model, one.SCRUB] + acts[forms.SCRUB]


@law
def _speed_read(s, o, l):
    """What a side's speed sensor has behind its filter (o: that side's offset), rad/s (contract, section 2)."""
    at_encoder = s[o + W] if s[AT_WHEEL + l] > 0.0 else s[o + WM]
    return sensors.speed_read(s[o + WF], at_encoder, s[o + SPEED_TAU], s[o + W_GAIN])


@law
def _is_finite(s, l):
    """Whether a lane's state is within what `kernel.replay` takes for finite."""
    sides = abs(s[W + l]) < 1e6 and abs(s[_SIDE + W + l]) < 1e6 and abs(s[CUR + l]) < 1e6
    return sides and abs(s[_SIDE + CUR + l]) < 1e6 and abs(s[V + l]) < 1e6 and abs(s[RATE + l]) < 1e6


@law
def _rim_gaps(s, l, half, dv, dr):
    """`ground.rim_gaps` of a lane."""
    rim0, rim1 = s[RADIUS + l] * s[ALPHA + l], s[_SIDE + RADIUS + l] * s[_SIDE + ALPHA + l]
    return ground.rim_gaps(s[V + l], s[RATE + l], half, dv, dr, rim0, rim1, s[YIELDS + l], s[_SIDE + YIELDS + l])


@law
def _held_back(s, l, f0, f1, b0, b1, a00, a11, wx):
    """`ground.on_ground` of a lane."""
    slip0, slip1, grip0, grip1 = s[SLIP + l], s[_SIDE + SLIP + l], s[GRIP + l], s[_SIDE + GRIP + l]
    return ground.on_ground(f0, f1, b0, b1, a00, a11, wx, slip0, slip1, grip0, grip1)


@law
def _bus_current_slope(s, o, supply):
    """`motor.bus_current_slope` of a lane's side."""
    return motor.bus_current_slope(s[o + MEAN_V], s[o + MEAN_I], s[o + RISE_V], s[o + VD], s[o + VA], supply)


@law
def _is_free(s, l):
    """Whether a lane's rotor is within its free play."""
    return s[CONTACT + l] == _FREE or s[_SIDE + CONTACT + l] == _FREE


@allocation_free
def _kept_state(s, l, kept, back):
    """Keep what accepting a step changes in a lane, or bring it back."""
    for n, row in enumerate(_ACCEPTED):
        if back:
            s[row + l] = kept[n]
        else:
            kept[n] = s[row + l]


@loop
def replay_batch(inputs, starts, models, h_max, h_play, which, out, out_first):
    """Replay several jobs, each a model on a run.

    Parameters
    ----------
    inputs : all runs one after another, as of `kernel.replay_runs`; starts : (runs, 15).
    models : (models, 2, len(SIDE)), (models, len(COMMON)) and (models, 2, MOST_FORMS, WIDTH) forms.
    h_max : (models,) s, longest steps; h_play : s, the longest within free play, see `kernel.replay`.
    which : (jobs, 2) model and run of each; out : (rows, 11) filled, job by job from rows out_first (jobs,).
    """
    ts, t_first, cmds_t, cmds, buses, cmd_first, angles, angle_first, runs = inputs
    sides, coms, curves = models
    jobs = which.shape[0]
    axis, by_torque, by_speed = int(coms[0, one.AXIS]), coms[0, one.MODE] == 1.0, coms[0, one.MODE] == 2.0
    # Where the rows of the last side end.
    ends = _SIDE if axis > 0 else _COMMON
    if axis > 0:
        out[:] = 0.0
    # A row of lanes within one line of the cache: rows across two take half as long again.
    unaligned = np.zeros(SIZE + SIMD_WIDTH)
    skipped = (-unaligned.ctypes.data // 8) % SIMD_WIDTH
    s = unaligned[skipped : skipped + SIZE]
    # Always all, but not known before: loops of a known few steps are unrolled, and are no longer vectorised.
    lanes = SIMD_WIDTH if jobs > 0 else 0
    job = np.full(SIMD_WIDTH, -1)
    left = np.zeros(SIMD_WIDTH, np.int64)  # steps until the lane's next event
    moment = np.zeros(SIMD_WIDTH)  # time of the next event, s
    # Rows of what comes next in a lane, a sample, its pose, a command, and where they end; and from a sample's row to
    # that of `out`.
    sample, pose, last = np.zeros(SIMD_WIDTH, np.int64), np.zeros(SIMD_WIDTH, np.int64), np.zeros(SIMD_WIDTH, np.int64)
    command, last_command, to_out = np.zeros_like(sample), np.zeros_like(sample), np.zeros_like(sample)
    # When these are due, s.
    next_sample, next_pose, next_command = np.zeros(SIMD_WIDTH), np.zeros(SIMD_WIDTH), np.zeros(SIMD_WIDTH)
    # The next sample of a speed that comes later than that by its own delay, s, where its run begins, and what its
    # sensor read as the last step ended.
    held_s, lagging, begin = np.zeros((2, SIMD_WIDTH)), np.zeros((2, SIMD_WIDTH), np.int64), np.zeros_like(sample)
    reading = np.zeros((2, SIMD_WIDTH))
    lags = np.zeros(SIMD_WIDTH, np.bool_)
    # Of servos: reference, rad/s, integral, V, and when they sample next, s.
    wanted, integral, next_servo = np.zeros((2, SIMD_WIDTH)), np.zeros((2, SIMD_WIDTH)), np.full(SIMD_WIDTH, NEVER)
    shapes = np.zeros(SIMD_WIDTH, np.bool_)
    # Whether a lane has forms, forms of readings, forms that remember, forms over the current, and forms that scrub.
    curved, reads, recalls, by_current, scrubs = np.zeros((5, SIMD_WIDTH), np.bool_)
    about, acts = np.zeros(forms.ABOUT), np.zeros(forms.ACTS)
    past = np.zeros((SIMD_WIDTH, 2, forms.PAST))
    given = 0
    running = 0
    scrubbed = pulled = shaped = heated = faded = filtered = slipping = iterated = flexible = formed = False
    decays = False
    # Free play asks for short steps between its flanks: whether a lane has any, the longest step then and now, and
    # whether its flanks part in this span; whether a step is taken once more, and what it began with.
    plays, fine, limit = np.zeros(SIMD_WIDTH, np.bool_), np.zeros(SIMD_WIDTH), np.zeros(SIMD_WIDTH)
    parts, redone = np.zeros(SIMD_WIDTH, np.bool_), np.zeros(SIMD_WIDTH, np.bool_)
    initial_state = np.zeros((SIMD_WIDTH, len(_ACCEPTED)))
    while True:
        # Whether what hangs on a step's length and a winding's warmth is to be found again.
        renewed = heated
        # ---- events of lanes whose step ends at one; idle lanes stand still
        for l in range(lanes):
            if left[l] > 0:
                if plays[l]:
                    bound = fine[l] if parts[l] or _is_free(s, l) else s[H_MAX + l]
                    if bound != limit[l]:
                        limit[l] = bound
                        remaining = moment[l] - s[NOW + l] - s[DONE + l]
                        count = math.ceil(remaining / bound - 1e-9)
                        if abs(remaining / count - s[H + l]) * count >= ALIKE_S:
                            s[H + l], renewed = remaining / count, True
                        left[l] = count
                left[l] -= 1
                continue
            now = moment[l]
            while True:
                if job[l] < 0:
                    if given == jobs:
                        left[l] = 1 << 60
                        break
                    j = given
                    given += 1
                    job[l] = j
                    running += 1
                    r = which[j, 1]
                    of_model, model, first = sides[which[j, 0]], which[j, 0], cmd_first[r]
                    _begin(s, l, of_model, coms[model], curves[model], runs[r], starts[r])
                    past[l] = 0.0
                    s[H_MAX + l], s[BUS_ROW + l], fine[l] = h_max[model], buses[first], min(h_max[model], h_play)
                    sample[l] = pose[l] = begin[l] = lagging[0, l] = lagging[1, l] = t_first[r]
                    last[l] = t_first[r + 1]
                    held_s[0, l], held_s[1, l] = of_model[0, one.W_DELAY], of_model[1, one.W_DELAY]
                    lags[l] = held_s[0, l] > 0.0 or held_s[1, l] > 0.0
                    reading[0, l], reading[1, l] = _speed_read(s, l, l), _speed_read(s, _SIDE + l, l)
                    command[l], last_command[l], now = first, cmd_first[r + 1], ts[t_first[r]]
                    next_sample[l], next_pose[l] = now - s[DELAY + l], now - s[POSE_DELAY + l]
                    if axis > 0:
                        # It has no pose.
                        pose[l], next_pose[l] = last[l], NEVER
                    next_command[l] = cmds_t[first] + s[COMMAND_DELAY + l] if first < last_command[l] else NEVER
                    to_out[l] = out_first[j] - t_first[r]
                    if by_speed:
                        next_servo[l] = now
                        for k in range(ends // _SIDE):
                            wanted[k, l] = 0.0
                            o = k * _SIDE + l
                            integral[k, l] = one.held_integral(of_model, k, coms[model], s[o + CUR], s[o + W])
                    curved[l] = forms.any_of(curves[model])
                    reads[l], recalls[l] = forms.any_read(curves[model]), forms.any_remembered(curves[model])
                    by_current[l], scrubs[l] = forms.any_over_current(curves[model]), forms.any_scrub(curves[model])
                    shapes[l] = one.shaped_by(of_model, 0) or one.shaped_by(of_model, 1)
                    plays[l] = s[BACKLASH + l] > 0.0 or s[_SIDE + BACKLASH + l] > 0.0
                    shaped = heated = scrubbed = pulled = faded = filtered = slipping = iterated = flexible = False
                    formed = decays = False
                    for i in range(lanes):
                        shaped |= shapes[i]
                        formed |= curved[i]
                        heated |= s[HEAT + i] != 0.0 or s[_SIDE + HEAT + i] != 0.0
                        scrubbed |= s[SCRUB + i] != 0.0 or scrubs[i]
                        pulled |= s[PULL + i] != 0.0 and axis == 0
                        faded |= s[STRIBECK + i] != 0.0 or s[_SIDE + STRIBECK + i] != 0.0
                        filtered |= s[SPEED_TAU + i] > 0.0 or s[_SIDE + SPEED_TAU + i] > 0.0
                        slipping |= s[SLIP + i] != 0.0 or s[_SIDE + SLIP + i] != 0.0
                        flexible |= s[CONTACT + i] != _RIGID or s[_SIDE + CONTACT + i] != _RIGID
                        decays |= not by_torque and (s[FAST + i] != 0.0 or s[_SIDE + FAST + i] != 0.0)
                        iterated |= s[SOURCE + i] != 0.0 or s[LOAD + i] != 0.0 or s[_SIDE + LOAD + i] != 0.0
                due = now + 1e-9
                end = last[l]
                reports = next_sample[l] <= due or next_pose[l] <= due
                if (reports or lags[l]) and not _is_finite(s, l):
                    for k in range(min(sample[l], pose[l]), end):
                        out[to_out[l] + k] = 1e6
                    sample[l] = pose[l] = lagging[0, l] = lagging[1, l] = end
                    next_sample[l] = next_pose[l] = NEVER
                    reports = True
                if next_pose[l] <= due:
                    k = pose[l]
                    while True:
                        row = to_out[l] + k
                        out[row, 8] = s[X + l]
                        out[row, 9] = s[Y + l]
                        out[row, 10] = s[YAW + l]
                        k += 1
                        at = ts[k] - s[POSE_DELAY + l] if k < end else NEVER
                        if not at <= due:
                            break
                    pose[l], next_pose[l] = k, at
                if next_sample[l] <= due:
                    k = sample[l]
                    while True:
                        row = to_out[l] + k
                        current = 0.0
                        if s[SOURCE + l] != 0.0:  # divisions that few replays need
                            current = driver.bus_current(s[CUR + l], s[VA + l], s[SUPPLY + l])
                            current += driver.bus_current(s[_SIDE + CUR + l], s[_SIDE + VA + l], s[SUPPLY + l])
                        elapsed = now - s[BEGUN + l]
                        bus = driver.loaded_bus(s[SUPPLY + l], s[SOURCE + l], current, s[DECLINE + l], elapsed)
                        out[row, 0] = s[BUS_ROW + l] if s[MEASURED + l] > 0.0 else bus
                        for i in range(ends // _SIDE):
                            o = i * _SIDE + l
                            out[row, 1 + i] = sensors.scaled(s[o + CUR], s[o + I_GAIN], s[o + I_BIAS])
                            if held_s[i, l] <= 0.0:
                                out[row, 3 + i] = _speed_read(s, o, l)
                            before = 0.0 if s[AT_WHEEL + l] > 0.0 else s[o + PLAY]
                            out[row, 5 + i] = (s[o + TH] + before) * s[o + W_GAIN]
                        if axis == 0:
                            out[row, 7] = sensors.scaled(s[RATE + l], s[GYRO_GAIN + l], s[GYRO_BIAS + l])
                        if reads[l]:
                            _read(out, row, curves, which[job[l], 0], held_s, l, ts[k] - s[DELAY + l] - s[BEGUN + l])
                        k += 1
                        at = ts[k] - s[DELAY + l] if k < end else NEVER
                        if not at <= due:
                            break
                    sample[l], next_sample[l] = k, at
                if lags[l]:
                    for i in range(2):
                        if held_s[i, l] > 0.0:
                            later = s[DELAY + l] + held_s[i, l]
                            o = i * _SIDE + l
                            k = lagging[i, l]
                            while k < end and ts[k] - later <= due:
                                speed = _speed_read(s, o, l)
                                if reads[l]:
                                    speed += _told(curves, which[job[l], 0], i, speed)
                                if ts[k] - later < ts[begin[l]]:
                                    # As in `kernel.replay`.
                                    initial = starts[which[job[l], 1], 9 + i]
                                    speed = initial + (speed - initial) * (ts[k] - ts[begin[l]]) / later
                                out[to_out[l] + k, 3 + i] = speed
                                k += 1
                            lagging[i, l] = k
                if reports and sample[l] >= end and pose[l] >= end:
                    # Idle lanes stand still: at rest, with nothing that drives them.
                    job[l] = -1
                    next_servo[l] = NEVER
                    running -= 1
                    # A known number of rows, and the compiler unrolls this and finds all their places ahead, at each
                    # lane's every event.
                    row = l
                    while row < len(s):
                        s[row] = 0.0
                        row += lanes
                    s[H + l] = s[LOAD_J + l] = s[SUPPLY + l] = s[I11 + l] = s[I22 + l] = 1.0
                    for o in range(l, _COMMON, _SIDE):
                        s[o + INERTIA] = s[o + GRIP] = s[o + THETA] = s[o + PER_SHEAR] = 1.0
                        s[o + RES] = s[o + IND] = s[o + STRIBECK_W] = s[o + PERIODS] = 1.0
                    shapes[l] = False
                    curved[l] = reads[l] = recalls[l] = scrubs[l] = lags[l] = False
                    plays[l] = False
                    continue
                changed = False
                if next_command[l] <= due:
                    k = command[l]
                    supply = s[SUPPLY + l]
                    while True:
                        k += 1
                        at = cmds_t[k] + s[COMMAND_DELAY + l] if k < last_command[l] else NEVER
                        if not at <= due:
                            break
                    s[BUS_ROW + l] = buses[k - 1]
                    command[l], next_command[l] = k, at
                    r = which[job[l], 1]
                    if (shapes[l] or curved[l]) and angle_first[r + 1] > angle_first[r]:
                        # Between the measured angles of this command's row and the next one's.
                        nearer, to_angle = min(k, last_command[l] - 1), angle_first[r] - cmd_first[r]
                        span_a = cmds_t[nearer] - cmds_t[k - 1]
                        s[FOLLOWS + l], s[SINCE + l] = 1.0, cmds_t[k - 1] + s[COMMAND_DELAY + l]
                        s[PER_SPAN + l] = 1.0 / span_a if span_a > 0.0 else 0.0
                        for i in range(ends // _SIDE):
                            o = i * _SIDE + l
                            here, there = angles[to_angle + k - 1, i], angles[to_angle + nearer, i]
                            s[o + AT], s[o + AHEAD] = here / s[o + W_GAIN], (there - here) / s[o + W_GAIN]
                    for i in range(ends // _SIDE):
                        o = i * _SIDE + l
                        wanted[i, l] = cmds[k - 1, i]
                        if not by_speed:
                            s[o + VA] = cmds[k - 1, i] if by_torque else driver.clipped(cmds[k - 1, i], supply)
                    changed = True
                if next_servo[l] <= due:
                    of_model, com = sides[which[job[l], 0]], coms[which[job[l], 0]]
                    for i in range(ends // _SIDE):
                        o = i * _SIDE + l
                        told = (s[o + W] if s[AT_WHEEL + l] > 0.0 else s[o + WM]) * s[o + W_GAIN]
                        if reads[l]:
                            told += _told(curves, which[job[l], 0], i, told)
                        s[o + VA], integral[i, l] = one.served(of_model, i, com, wanted[i, l], integral[i, l], told)
                    while next_servo[l] <= due:
                        next_servo[l] += com[one.SERVO_T]
                    changed = True
                if changed:
                    for i in range(ends // _SIDE):
                        o = i * _SIDE + l
                        s[o + VD] = driver.duty(s[o + VA], s[SUPPLY + l], s[o + CURVE], s[o + DEADZONE], s[o + V_GAIN])
                        s[o + OWN_VD] = s[o + VD]
                        if s[o + FAST] != 0.0:
                            s[o + PLAIN_VD] = driver.duty(s[o + VA], s[SUPPLY + l], 0.0, s[o + DEADZONE], s[o + V_GAIN])
                        if curved[l]:
                            forms.follow(curves[which[job[l], 0], i], s[o + VA], past[l, i])
                ahead = min(min(next_pose[l], next_sample[l]), min(next_command[l], next_servo[l]))
                span = ahead - now
                if span <= 1e-9:
                    now = ahead
                    continue
                s[NOW + l] = now
                moment[l] = ahead
                parts[l] = False
                limit[l] = fine[l] if plays[l] and _is_free(s, l) else s[H_MAX + l]
                # Most spans are a step: they need not wait for divisions.
                count, h = 1, span
                if span > limit[l] * (1.0 + 1e-9):
                    count = math.ceil(span / limit[l] - 1e-9)
                    h = span / count
                # Spans differ in their last digits.
                if abs(h - s[H + l]) * count >= ALIKE_S:
                    s[H + l], renewed = h, True
                left[l] = count - 1
                s[DONE + l] = 0.0
                break
        if running == 0:
            return
        # ---- constants of armatures, filters and tyres for the step. One exponential after another in each lane took
        # longer than all the rest of an event: all lanes go in a batch, and one whose step is the same finds the same
        # again.
        if renewed:
            for o in range(0, 0 if by_torque else ends, _SIDE):
                for l in range(lanes):
                    res = motor.warm(s[o + RES + l], s[o + RISE + l])
                    decay, rise_v, mean_v, mean_i, c1, m1 = motor.armature_factors(
                        s[H + l], res, s[o + IND + l], s[o + KE + l], exp_minus
                    )
                    s[o + DECAY + l], s[o + RISE_V + l], s[o + MEAN_V + l] = decay, rise_v, mean_v
                    s[o + MEAN_I + l], s[o + C1 + l], s[o + M1 + l] = mean_i, c1, m1
            if filtered:
                for o in range(0, ends, _SIDE):
                    for l in range(lanes):
                        tau = s[o + SPEED_TAU + l]
                        fade = exp_minus(s[H + l] / (tau if tau > 0.0 else 1.0))
                        s[o + FADE + l] = fade if tau > 0.0 else 0.0
            if slipping:
                for o in range(0, ends, _SIDE):
                    for l in range(lanes):
                        theta, factor = ground.shear_step(s[H + l], s[o + SHEAR_TAU + l])
                        s[o + THETA + l], s[o + PER_SHEAR + l] = theta, factor
        # ---- one step of all lanes: torques by angle and speed, the body's forces and the bus
        if shaped:
            for o in range(0, ends, _SIDE):
                for l in range(lanes):
                    half = 0.5 * s[H + l]
                    share = min(max((s[NOW + l] + s[DONE + l] + half - s[SINCE + l]) * s[PER_SPAN + l], 0.0), 1.0)
                    own, measured = s[o + TH + l] + half * s[o + W + l], s[o + AT + l] + share * s[o + AHEAD + l]
                    at = measured if s[FOLLOWS + l] > 0.0 else own
                    s[o + SHAPED + l] = _torque_of(at, s[o + WM + l], s, o, l, sine)
        for l in range(lanes):
            s[DONE + l] += s[H + l]
        if axis == 0:
            for l in range(lanes):
                rate, v = s[RATE + l], s[V + l]
                s[GX + l], s[GZ + l] = ground.offset_forces(s[MASS + l], s[COM_X + l], v, rate)
                s[SPIN + l] = friction.direction(rate)
        if axis == 2:
            for l in range(lanes):
                at = s[TH + l] + 0.5 * s[H + l] * s[W + l] - s[ZERO + l]
                s[WEIGHT + l] = ground.pendulum(s[SWUNG + l], s[ARM + l], at, sine)
        if pulled:
            for l in range(lanes):
                angle = 0.5 * s[H + l] * s[RATE + l]
                q = angle * angle
                c, d = s[DIR_X + l], s[DIR_Y + l]
                dc, ds = 1.0 + cos_less_one(q), sin(angle, q)
                mid_x, mid_y = c * dc - d * ds, d * dc + c * ds
                along, across = mid_x * s[UP_X + l] + mid_y * s[UP_Y + l], mid_y * s[UP_X + l] - mid_x * s[UP_Y + l]
                s[GX + l] -= s[PULL + l] * along
                s[GZ + l] += ground.slope_torque(s[PULL + l], s[COM_X + l], s[COM_Y + l], along, across)
        if decays:
            # As in `kernel.replay`.
            for o in range(0, ends, _SIDE):
                for l in range(lanes):
                    middle = s[o + WM + l] + 0.5 * s[H + l] * s[o + GAINED + l]
                    emf = s[o + KE + l] * middle / max(s[LEVEL + l], LEAST_LEVEL)
                    own, plain, supply = s[o + OWN_VD + l], s[o + PLAIN_VD + l], s[SUPPLY + l]
                    s[o + DECAYED + l] = driver.decay_adds(
                        own, plain, emf, supply, s[o + FAST + l], s[o + PERIODS + l], exp_minus
                    )
                    s[o + VD + l] = s[o + OWN_VD + l] + s[o + DECAYED + l]
        if formed:
            _formed(s, ends, job, curved, by_current, which, sides, coms, curves, shaped, about, acts, past)
        if faded:
            for o in range(0, ends, _SIDE):
                for l in range(lanes):
                    relative = s[o + WM + l] / s[o + STRIBECK_W + l]
                    s[o + EXTRA + l] = friction.stribeck(relative, s[o + STRIBECK + l], exp_minus)
        for o in range(0, ends, _SIDE):
            for l in range(lanes):
                w = s[o + WM + l]
                s[o + WN + l], s[o + WMN + l] = s[o + W + l], w
                s[o + STICK + l] = friction.direction(w)
        if iterated:
            # What the current comes to at the bus before and an even speed.
            for o in range(0, ends, _SIDE):
                for l in range(lanes):
                    w, cur = s[o + WMN + l], s[o + CUR + l]
                    emf = s[o + KE + l] * w
                    volts = driver.winding_voltage(
                        s[o + VD + l] * s[LEVEL + l],
                        emf,
                        s[o + LIM + l],
                        s[o + DROP + l],
                        s[o + KNEE + l],
                        s[o + RES + l],
                    )
                    decay, rise_v, mean_v, mean_i = (
                        s[o + DECAY + l],
                        s[o + RISE_V + l],
                        s[o + MEAN_V + l],
                        s[o + MEAN_I + l],
                    )
                    s[o + MEAN + l] = motor.even_current(cur, volts, emf, decay, rise_v, mean_v, mean_i)
        if flexible:
            for o in range(0, ends, _SIDE):
                for l in range(lanes):
                    s[o + WAS + l], s[o + HELD + l] = s[o + CONTACT + l], s[o + FORCE + l]
                    free, restitution = s[o + CONTACT + l] == _FREE, s[o + RESTITUTION + l]
                    bounces = gear.bounces(free, restitution, s[o + WMN + l], s[o + WN + l])
                    s[o + BOUNCES + l] = 1.0 if bounces else 0.0
        if slipping:
            # As in `kernel.replay`; what its shear would be without slip is nothing.
            for k in range(2):
                o = k * _SIDE
                for l in range(lanes):
                    rim, slip, length = s[o + RADIUS + l] * s[o + WN + l], s[o + SLIP + l], s[o + LENGTH + l]
                    theta, factor, grip = s[o + THETA + l], s[o + PER_SHEAR + l], s[o + GRIP + l]
                    whole, tyre, slid = s[o + WHOLE + l], s[o + TYRE + l], rim - s[V + l]
                    slid -= (2 * k - 1) * s[HALF + l] * s[RATE + l]
                    give, yields, tangent, taken = ground.shear(
                        s[H + l], slip, length, theta, factor, grip, whole, tyre, abs(rim), slid, tanh
                    )
                    s[o + TANGENT + l], s[o + TAKEN + l], s[o + GIVE + l] = tangent, taken, give
                    s[o + YIELDS + l] = yields if slip > 0.0 else 0.0
        trial = 0
        while True:
            # ---- driver, armature and rotor of each side: mean current = m0 - m1 * rotor speed at the end of the step
            if iterated:
                for l in range(lanes):
                    supply, source, level = s[SUPPLY + l], s[SOURCE + l], s[LEVEL + l]
                    # `DONE` is the time at the step's end.
                    elapsed = s[NOW + l] + s[DONE + l] - s[BEGUN + l] - 0.5 * s[H + l]
                    bus = driver.unloaded_bus(supply, s[DECLINE + l], elapsed)
                    # Newton's step: a higher bus drives more current, which lowers it. Both sides in full: a loop over
                    # them here would keep this one out of vector registers.
                    amperes = driver.bus_current(s[MEAN + l], s[VA + l], supply)
                    amperes += driver.bus_current(s[_SIDE + MEAN + l], s[_SIDE + VA + l], supply)
                    slope = _bus_current_slope(s, l, supply) + _bus_current_slope(s, _SIDE + l, supply)
                    stepped = driver.sagging(supply, source, level, bus, amperes, slope)
                    bus = stepped if source != 0.0 else bus
                    s[LEVEL + l] = (s[BUS_ROW + l] if s[MEASURED + l] > 0.0 else bus) / supply
            else:
                for l in range(lanes):
                    elapsed = s[NOW + l] + s[DONE + l] - s[BEGUN + l] - 0.5 * s[H + l]
                    bus = driver.unloaded_bus(s[SUPPLY + l], s[DECLINE + l], elapsed)
                    s[LEVEL + l] = (s[BUS_ROW + l] if s[MEASURED + l] > 0.0 else bus) / s[SUPPLY + l]
            if by_torque:
                for o in range(0, ends, _SIDE):
                    for l in range(lanes):
                        asked = s[o + VD + l] * s[LEVEL + l]
                        s[o + DRIVE + l] = driver.amplifier(asked, s[o + LIM + l], s[PER_VOLT + l]) * s[RATIO + l]
            else:
                for o in range(0, ends, _SIDE):
                    for l in range(lanes):
                        w = s[o + WMN + l]
                        ke = s[o + KE + l]
                        asked = s[o + VD + l] * s[LEVEL + l]
                        volts = driver.winding_voltage(
                            asked, ke * w, s[o + LIM + l], s[o + DROP + l], s[o + KNEE + l], s[o + RES + l]
                        )
                        decay, rise_v, mean_v = s[o + DECAY + l], s[o + RISE_V + l], s[o + MEAN_V + l]
                        c0, m0 = motor.armature(
                            s[o + CUR + l], volts, ke, w, decay, rise_v, mean_v, s[o + MEAN_I + l], s[o + C1 + l]
                        )
                        s[o + C0 + l], s[o + M0 + l], s[o + DRIVE + l] = c0, m0, s[o + GKM + l] * m0
            for o in range(0, ends, _SIDE):
                for l in range(lanes):
                    h, w = s[H + l], s[o + WMN + l]
                    torque = s[o + DRIVE + l] + s[o + SHAPED + l]
                    slope = s[o + GKM + l] * s[o + M1 + l]
                    fluid = friction.viscous(s[o + FLUID + l], s[o + ASYM_V + l], w)
                    am, bm = motor.rotor_balance(h, s[o + INERTIA + l], fluid, torque, slope, w)
                    s[o + AM + l], s[o + BM + l] = am, bm
                    s[o + RIGID + l] = 1.0 / (am + s[LOAD_J + l])
                    output = s[o + RADIUS + l] * s[o + FORCE + l] if trial == 0 and axis == 0 else s[o + OUTPUT + l]
                    f = s[o + FRICTION + l] + s[o + EXTRA + l]
                    f += friction.by_load(s[o + LOAD + l], s[o + INPUT + l], output)
                    s[o + HI + l], s[o + LO + l] = friction.bounds(h, f, s[o + ASYM + l])
            if flexible:
                # Implicit mid-point for the spring: its mean torque = turn + kap * (rotor - wheel), at the end of the
                # step.
                for o in range(0, ends, _SIDE):
                    for l in range(lanes):
                        h, am, load_j = s[H + l], s[o + AM + l], s[LOAD_J + l]
                        kap = gear.spring_gain(h, s[o + STIFF + l], s[o + DAMP + l])
                        spring_i = 1.0 / (am + h * kap)
                        s[o + KAP + l], s[o + SPRING_I + l] = kap, spring_i
                        s[o + FREE_I + l], s[o + HELD_I + l] = 1.0 / am, gear.held_gain(h, load_j, kap)
                        s[o + BEHIND_I + l] = gear.behind_gain(h, load_j, kap, spring_i)
                        play, wmn, wn = s[o + PLAY + l], s[o + WMN + l], s[o + WN + l]
                        s[o + TURN + l] = gear.spring_start(s[o + STIFF + l], play, kap, wmn, wn)
            # ---- velocities at the end of the step; a lane whose guess held finds the same again
            for attempt in range(20):
                if flexible:
                    for o in range(0, ends, _SIDE):
                        for l in range(lanes):
                            h, kind, stick, load_j = s[H + l], s[o + CONTACT + l], s[o + STICK + l], s[LOAD_J + l]
                            stuck = s[DRY + l] > 0.0 and stick == 0.0
                            hi, lo, rigid_i = s[o + HI + l], s[o + LO + l], s[o + RIGID + l]
                            held_i, behind_i = s[o + HELD_I + l], s[o + BEHIND_I + l]
                            p = friction.impulse(stick, hi, lo)
                            bw = load_j * s[o + WN + l] + h * s[WEIGHT + l]
                            bm, turn, kap = s[o + BM + l], s[o + TURN + l], s[o + KAP + l]
                            # What the rotor is faster than the wheel afterwards, in contact with a flank.
                            forwards = kind == _PUSH_F
                            rotor, wheel = s[o + WMN + l], s[o + WN + l]
                            meets = (rotor > wheel) == forwards and s[o + BOUNCES + l] > 0.0
                            to_flank = gear.flank(s[o + BACKLASH + l], forwards) - s[o + PLAY + l]
                            apart = gear.parting(to_flank, h, s[o + RESTITUTION + l], rotor, wheel, meets)
                            apart = apart if kind >= _PUSH_F else 0.0
                            s[o + APART + l] = apart
                            moved = (bm + bw - p - s[o + AM + l] * apart) * rigid_i
                            alpha, inverse = -apart if stuck else moved, 0.0 if stuck else rigid_i
                            rotor = h * kap * ((bm - h * turn - p) * s[o + SPRING_I + l])
                            behind = held_i if stuck else behind_i
                            swung = (bw + h * turn + (0.0 if stuck else rotor)) * behind
                            free_i = 1.0 / load_j
                            rolled = bw * free_i
                            alpha = swung if kind == _SPRING else (rolled if kind == _FREE else alpha)
                            inverse = behind if kind == _SPRING else (free_i if kind == _FREE else inverse)
                            s[o + ALPHA + l], s[o + BETA + l] = alpha, h * s[o + RADIUS + l] * inverse
                elif axis > 0:
                    for l in range(lanes):
                        stick, load = s[STICK + l], s[LOAD_J + l] * s[WN + l] + s[H + l] * s[WEIGHT + l]
                        moves = 0.0 if s[DRY + l] > 0.0 and stick == 0.0 else 1.0
                        p = friction.impulse(stick, s[HI + l], s[LO + l])
                        s[ALPHA + l] = moves * ((s[BM + l] + load - p) * s[RIGID + l])
                else:
                    for l in range(lanes):
                        for k in range(2):
                            o = k * _SIDE + l
                            stick, hi, lo = s[o + STICK], s[o + HI], s[o + LO]
                            moves = 0.0 if s[DRY + l] > 0.0 and stick == 0.0 else 1.0
                            p = friction.impulse(stick, hi, lo)
                            s[o + ALPHA] = moves * ((s[o + BM] + s[LOAD_J + l] * s[o + WN] - p) * s[o + RIGID])
                            s[o + BETA] = moves * (s[H + l] * s[o + RADIUS] * s[o + RIGID])
                if axis > 0:
                    for l in range(lanes):
                        s[W + l] = s[ALPHA + l]
                else:
                    for l in range(lanes):
                        s[BRAKE + l] = s[SPIN + l] * s[H + l] * s[SCRUB + l]
                    for turn in range(2 if scrubbed else 1):
                        if turn == 1:
                            for l in range(lanes):
                                i12, i22, half, most = s[I12 + l], s[I22 + l], s[HALF + l], s[H + l] * s[SCRUB + l]
                                a00, a11, wx, det = s[A00 + l], s[A11 + l], s[WX + l], s[DET + l]
                                # Where the scrub would reverse the turn: the impulse that stops it, within its bound.
                                gain = ground.scrub_gain(s[H + l], i12, i22, half, a00, a11, wx, det)
                                stop = ground.stopping(s[BRAKE + l], s[RATE_N + l], gain, most, i22)
                                reverses = s[SCRUB + l] != 0.0 and s[SPIN + l] * s[RATE_N + l] <= 0.0
                                s[BRAKE + l] = stop if reverses else s[BRAKE + l]
                        for l in range(lanes):
                            h = s[H + l]
                            i11, i12, i22, half = s[I11 + l], s[I12 + l], s[I22 + l], s[HALF + l]
                            w0, w1, wx = ground.wheel_moves(h, i11, i12, i22, half)
                            a00 = s[RADIUS + l] * s[BETA + l] + w0 + s[GIVE + l]
                            a11 = s[_SIDE + RADIUS + l] * s[_SIDE + BETA + l] + w1 + s[_SIDE + GIVE + l]
                            det = 1.0 / (a00 * a11 - wx * wx)
                            dv, dr = ground.body_moves(h, i11, i12, i22, s[GX + l], s[GZ + l], s[BRAKE + l])
                            b0, b1 = _rim_gaps(s, l, half, dv, dr)
                            f0, f1 = ground.tractions(a00, a11, wx, det, b0, b1)
                            s[ASKED + l], s[_SIDE + ASKED + l] = f0, f1
                            f0, f1 = _held_back(s, l, f0, f1, b0, b1, a00, a11, wx)
                            s[FORCE + l], s[_SIDE + FORCE + l], s[DV + l] = f0, f1, dv
                            s[A00 + l], s[A11 + l], s[WX + l], s[DET + l] = a00, a11, wx, det
                            s[RATE_N + l] = s[RATE + l] + dr + ground.yawed(h, i12, i22, half, f0, f1)
                    for l in range(lanes):
                        h, half = s[H + l], s[HALF + l]
                        f0, f1 = s[FORCE + l], s[_SIDE + FORCE + l]
                        s[V_N + l] = s[V + l] + s[DV + l] + ground.pushed(h, s[I11 + l], s[I12 + l], half, f0, f1)
                        s[W + l] = s[ALPHA + l] - s[BETA + l] * f0
                        s[_SIDE + W + l] = s[_SIDE + ALPHA + l] - s[_SIDE + BETA + l] * f1
                if flexible:
                    for o in range(0, ends, _SIDE):
                        for l in range(lanes):
                            h, kind, stick = s[H + l], s[o + CONTACT + l], s[o + STICK + l]
                            load_j, kap, dry = s[LOAD_J + l], s[o + KAP + l], s[DRY + l] > 0.0
                            hi, lo = s[o + HI + l], s[o + LO + l]
                            p = friction.impulse(stick, hi, lo)
                            w, bm, turn, play = s[o + W + l], s[o + BM + l], s[o + TURN + l], s[o + PLAY + l]
                            edge = 0.5 * s[o + BACKLASH + l]
                            swung = (bm - h * turn - p + h * kap * w) * s[o + SPRING_I + l]
                            freed, touched = (bm - p) * s[o + FREE_I + l], w + s[o + APART + l]
                            wm = swung if kind == _SPRING else freed
                            wm = 0.0 if dry and stick == 0.0 else wm
                            swings = kind == _SPRING or kind == _FREE
                            wm = wm if swings else touched
                            s[o + WM + l] = wm
                            # Impulse the rotor passes on; flanks can push but not pull.
                            push = load_j * (w - s[o + WN + l]) + h * s[o + RADIUS + l] * s[o + FORCE + l]
                            push -= h * s[WEIGHT + l]
                            turned = h * (turn - kap * w)
                            push = turned if kind == _SPRING else (0.0 if kind == _FREE else push)
                            need = bm - push
                            moved = play + h * (wm - w)
                            meets = _PUSH_F if moved > edge else (_PUSH_B if moved < -edge else _FREE)
                            pulls = (kind == _PUSH_F and push < 0.0) or (kind == _PUSH_B and push > 0.0)
                            then = meets if kind == _FREE else (_FREE if pulls and attempt < 10 else kind)
                            breaks = friction.breaks_away(need, hi, lo)
                            stops = stick * wm < 0.0 and (attempt < 10 or kind <= _SPRING)
                            other = breaks if stick == 0.0 else (0.0 if stops else stick)
                            other = other if dry else stick
                            s[o + TANGLED + l] = 1.0 if other != stick or then != kind else 0.0
                            s[o + STICK + l], s[o + CONTACT + l] = other, then
                    again = 0
                    for l in range(lanes):
                        again |= 1 if s[TANGLED + l] + s[_SIDE + TANGLED + l] > 0.0 else 0
                    if again == 0:
                        break
                    continue
                again = 0
                if axis > 0:
                    for l in range(lanes):
                        w, stick = s[W + l], s[STICK + l]
                        s[WM + l] = w
                        need = s[BM + l] + s[LOAD_J + l] * s[WN + l] + s[H + l] * s[WEIGHT + l]
                        other = _sticks(stick, w, need, s[HI + l], s[LO + l], s[DRY + l])
                        again |= 1 if other != stick else 0
                        s[STICK + l] = other
                    if again == 0:
                        break
                    continue
                for l in range(lanes):
                    h = s[H + l]
                    for k in range(2):
                        o = k * _SIDE + l
                        force, w = s[o + FORCE], s[o + W]
                        s[o + WM] = w
                        need = s[o + BM] + s[LOAD_J + l] * s[o + WN] - h * s[o + RADIUS] * force
                        stick = s[o + STICK]
                        other = _sticks(stick, w, need, s[o + HI], s[o + LO], s[DRY + l])
                        again |= 1 if other != stick else 0
                        s[o + STICK] = other
                if again == 0:
                    break
            if not iterated:
                break
            for o in range(0, ends, _SIDE):
                for l in range(lanes):
                    w, wn, wm, wmn = s[o + W + l], s[o + WN + l], s[o + WM + l], s[o + WMN + l]
                    mean, plain = s[o + M0 + l] - s[o + M1 + l] * wm, s[o + FLUID + l]
                    s[o + MEAN + l] = mean
                    # With torques there is no current, and so no other drive than as the step began.
                    torque = s[o + DRIVE + l] if by_torque else s[o + GKM + l] * mean
                    inertia = s[o + INERTIA + l]
                    s[o + INPUT + l] = motor.gear_input(s[H + l], torque, plain, inertia, wmn, wm)
                    output = s[LOAD_J + l] * (w - wn) / s[H + l] + s[o + RADIUS + l] * s[o + FORCE + l]
                    s[o + OUTPUT + l] = output - s[WEIGHT + l]
            trial += 1
            if trial == TRIALS:
                break
        # ---- a long step ends where flanks part: once more, in short ones
        again = 0
        redone[:] = False
        if flexible:
            for l in range(lanes):
                parted = s[CONTACT + l] != s[WAS + l] or s[_SIDE + CONTACT + l] != s[_SIDE + WAS + l]
                redone[l] = plays[l] and limit[l] > fine[l] and parted
                if redone[l]:
                    again = 1
                    _kept_state(s, l, initial_state[l], False)
        # ---- accept the step
        for o in range(0, ends, _SIDE):
            for l in range(lanes):
                h, w, wn, tau = s[H + l], s[o + WM + l], s[o + WMN + l], s[o + SPEED_TAU + l]
                mean = s[o + M0 + l] - s[o + M1 + l] * w
                s[o + CUR + l] = s[o + C0 + l] - s[o + C1 + l] * w
                rise = s[o + RISE + l]
                res = motor.warm(s[o + RES + l], rise)
                hotter = motor.warmer(rise, h, s[o + HEAT + l], s[o + HEAT_TAU + l], mean, res)
                s[o + RISE + l] = hotter if s[o + HEAT + l] != 0.0 else rise
                s[o + TH + l] += 0.5 * h * (s[o + WN + l] + s[o + W + l])
                # All are read first: what is read on a condition only would keep this loop out of vector registers.
                wheel, wheel_n, behind = s[o + W + l], s[o + WN + l], s[AT_WHEEL + l] > 0.0
                seen, seen_n = wheel if behind else w, wheel_n if behind else wn
                s[o + WF + l] = sensors.low_pass(s[o + WF + l], seen, seen_n, h, tau, s[o + FADE + l])
        if decays:
            for o in range(0, ends, _SIDE):
                for l in range(lanes):
                    s[o + GAINED + l] = (s[o + WM + l] - s[o + WMN + l]) / s[H + l]
        if flexible:
            for o in range(0, ends, _SIDE):
                for l in range(lanes):
                    h, kind, play, w, wm = s[H + l], s[o + CONTACT + l], s[o + PLAY + l], s[o + W + l], s[o + WM + l]
                    wn, wmn, forwards = s[o + WN + l], s[o + WMN + l], kind == _PUSH_F
                    bent = gear.spring_play(play, h, wmn, wm, wn, w)
                    # To the flank at the speed before, and back for the rest of the step.
                    returns = kind >= _PUSH_F and s[o + BOUNCES + l] > 0.0 and (wm > w) != forwards
                    at_flank = gear.flank(s[o + BACKLASH + l], forwards)
                    nears = wmn if returns else wn + 1.0
                    met = gear.bounced_play(at_flank, play, h, nears, wn, s[o + APART + l])
                    moved = met if returns else play + h * (wm - w)
                    s[o + PLAY + l] = bent if kind == _SPRING else (play if kind == _RIGID else moved)
                    s[o + CONTACT + l] = _FREE if returns else kind
        if axis == 0:
            for l in range(lanes):
                h = s[H + l]
                v_mid, rate_mid = 0.5 * (s[V + l] + s[V_N + l]), 0.5 * (s[RATE + l] + s[RATE_N + l])
                turned = 0.5 * h * rate_mid
                q = turned * turned
                c, d = s[DIR_X + l], s[DIR_Y + l]
                dc, ds = 1.0 + cos_less_one(q), sin(turned, q)
                c, d = c * dc - d * ds, d * dc + c * ds
                s[X + l] += h * v_mid * c
                s[Y + l] += h * v_mid * d
                s[DIR_X + l], s[DIR_Y + l] = c * dc - d * ds, d * dc + c * ds
                s[YAW + l] += h * rate_mid
                s[V + l], s[RATE + l] = s[V_N + l], s[RATE_N + l]
        if slipping:
            for o in range(0, ends, _SIDE):
                for l in range(lanes):
                    whole = ground.sheared(
                        s[o + WHOLE + l], s[o + ASKED + l], s[o + TAKEN + l], s[o + TANGENT + l], s[o + GRIP + l]
                    )
                    s[o + WHOLE + l] = whole
                    tyre, slip, factor = s[o + TYRE + l], s[o + SLIP + l], s[o + PER_SHEAR + l]
                    s[o + TYRE + l] = ground.relaxed(s[H + l], tyre, slip, whole, factor)
        for l in range(lanes):
            if not lags[l] or redone[l]:
                continue
            for i in range(2):
                if held_s[i, l] > 0.0:
                    # A speed that is reported later. A step that ended at each of its samples would double the steps.
                    o, began, h = i * _SIDE + l, reading[i, l], s[H + l]
                    reading[i, l], ended_s = _speed_read(s, o, l), s[NOW + l] + s[DONE + l]
                    later, k = s[DELAY + l] + held_s[i, l], lagging[i, l]
                    while k < last[l] and ts[k] - later <= ended_s:
                        speed = sensors.within_step(began, reading[i, l], (ended_s - (ts[k] - later)) / h)
                        if reads[l]:
                            speed += _told(curves, which[job[l], 0], i, speed)
                        out[to_out[l] + k, 3 + i] = speed
                        k += 1
                    lagging[i, l] = k
        if formed:
            _carried(s, ends, job, recalls, which, curves, redone, past)
        if again > 0:
            for l in range(lanes):
                if redone[l]:
                    _kept_state(s, l, initial_state[l], True)
                    for o in range(l, _COMMON, _SIDE):
                        s[o + W], s[o + WM] = s[o + WN], s[o + WMN]
                        s[o + CONTACT], s[o + FORCE] = s[o + WAS], s[o + HELD]
                    s[DONE + l] -= s[H + l]
                    parts[l], left[l] = True, left[l] + 1
