"""The block of the gear, the wheels and the body: current -> speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtds_host.contract import GRAVITY_M_S2
from rtds_host.diagnosis.chance import APART, MOVES
from rtds_host.diagnosis.localise.series import cumulated, filled, first_order, middles, near, smooth
from rtds_host.diagnosis.localise.signals import WINDOW_S, Signals
from rtds_host.plant.friction import rolling, stribeck
from rtds_host.plant.ground import pendulum
from rtds_host.plant.torque import ANGLE
from rtds_host.plant.torques import TORQUES

# Numerical: parts of the largest force met that a tyre may pass on, and of the largest current beyond which a motor's
# torque falls behind; and how long a tyre that lost its grip takes to regain it.
TRACTIONS = (0.2, 0.4, 0.6, 0.8)
SLIPPED_S = 0.1
# Numerical: speeds over which friction fades, of the speed without load, and cycles a turn of a ripple.
FADES = (0.04, 0.14)
RIPPLES = (1, 2, 3, 4, 6, 8, 12, 18)
# Numerical: shares of the machine's largest yaw rate, speed without load and stall torque over which a sign turns over.
SIGN_TURN, SIGN_WAY, SIGN_LOAD = 0.01, 0.06, 0.002


def _exp_minus(y: np.ndarray) -> np.ndarray:
    """exp(-y) of an array."""
    return np.exp(-y)


@dataclass(frozen=True)
class _Body:
    """What a robot's body does to one wheel.

    radius : m; lever : yaw rate a wheel speed; pull : (n,) N·m of a slope; climb, side_climb : (n,) sine of the slope
    along and across the heading; turning : (n,) N·m that the yaw acceleration takes; load : (n,) N·m that the wheel
    passes on; yaw_sign : (n - 1,) which way the body turns.
    """

    radius: float
    lever: float
    pull: np.ndarray
    climb: np.ndarray
    side_climb: np.ndarray
    turning: np.ndarray
    load: np.ndarray
    yaw_sign: np.ndarray


@dataclass(frozen=True)
class _Wheel:
    """One wheel of a run: its motor's torque (n - 1,) N·m at the gear's output, friction a speed N·m·s/rad, speed and
    its sign over each interval (n - 1,), angle (n,) rad; the body, of a robot on wheels.
    """

    run: Signals
    k: int
    drive: np.ndarray
    fluid: float
    mid: np.ndarray
    sign: np.ndarray
    angle: np.ndarray
    body: _Body | None

    @property
    def side(self) -> str:
        return self.run.robot.sides[self.k]

    def put(self, cause: str, values: np.ndarray) -> None:
        self.run.torque_columns(cause, self.k, values)


def torque_block(run: Signals, k: int) -> None:
    """Current -> speed, and the mechanical signatures."""
    model, t, dt = run.model, run.t, run.dt
    driven = _motor_torque(run, k)
    if driven is None:
        return
    drive, current_noise = driven
    fluid = model.get("gear_ratio") ** 2 * model.get("viscous", k) + model.get("viscous_wheel", k)
    mid, sign_mid = run.w_mean[k], middles(run.sign[k])
    body = _body(run, k) if run.body else None
    pull = body.pull if body is not None else _axis_pull(run, k)
    torque = drive - fluid * mid + middles(pull)
    # Effects that the model already holds.
    relative = mid / model.get("stribeck_speed", k)
    dry = model.get("coulomb", k) + stribeck.py_func(relative, model.get("stribeck", k), _exp_minus)
    if body is not None:
        dry = dry + rolling.py_func(model.get("rolling"), run.mass, body.radius)
        torque = torque - body.lever * model.get("scrub") * body.yaw_sign
    dry = dry + model.get("load_share", k) * np.abs(drive - fluid * mid)
    # A wheel at rest is held by as much friction as it takes.
    rests = np.abs(middles(smooth(run.w[k], run.half))) < MOVES * run.w_noise[k]
    torque = torque - np.where(rests, np.clip(torque, -dry, dry), dry * sign_mid)
    torque = torque - model.get("asymmetry", k) * np.abs(sign_mid) - model.get("asymmetry_viscous", k) * np.abs(mid)
    th = run.th[k]
    angle = filled(t, th) if th is not None else cumulated(mid, dt)
    for shape in TORQUES.values():
        if model.get(shape.size, k):
            numbers = {entry.name: model.get(entry.name, k) for entry in shape.entries}
            torque = torque + shape.at(middles(angle) if shape.over == ANGLE else mid, numbers, np.sin)
    _residual(run, k, torque, current_noise)
    if not run.signatures:
        return
    wheel = _Wheel(run, k, drive, fluid, mid, sign_mid, angle, body)
    _friction_columns(wheel)
    if body is not None:
        _gear_columns(wheel, body)
    _ripple_columns(wheel)
    _current_columns(wheel)
    if body is not None:
        _body_columns(wheel, body)
        _tyre_columns(wheel, body)


def _motor_torque(run: Signals, k: int) -> tuple[np.ndarray, float] | None:
    """Torque (n - 1,) N·m of the motor at the gear's output over each interval, and the noise of a current, A; None of
    a servo's motor whose current is not measured.
    """
    model, dt = run.model, run.dt
    s = run.robot.sides[k]
    res, tau, ke, _ = run.electric[k]
    w, i = run.w[k], run.i[k]
    if run.robot.driver.mode == "torque":
        _, raw = run.held(run.volts[k], run.delay)
        return raw * model.get("torque_per_volt") * model.get("gear_ratio") * model.get("voltage_gain", k), 0.0
    if run.voltage_mode:
        if APART * tau < float(np.median(dt)):
            # Between rows the current follows voltage and speed; its measured end fixes the level.
            start = (run.v_mean[k] - ke * w[:-1]) / middles(res)
            mean = (
                i[1:]
                + (run.v_mean[k] - run.v_end[k][1:]) / middles(res)
                + ke / middles(res) * (w[1:] - run.w_mean[k])
                + tau / dt * (i[:-1] - start)
            )
        else:
            mean = middles(i)
        noise = (
            run.robot.known_noise(f"i_{s}") / abs(model.get("current_gain", k))
            if run.has_i[k]
            else float(np.mean(ke / res)) * run.w_noise[k]
        )
        return run.km[k] * mean, noise
    if run.has_i[k]:
        return run.km[k] * middles(i), run.robot.known_noise(f"i_{s}")
    return None


def _body(run: Signals, k: int) -> _Body:
    model = run.model
    r = model.get("radius", k)
    climb = np.sin(run.slope) * np.cos(run.heading - run.log.meta.uphill_yaw_rad)
    side_climb = np.sin(run.slope) * np.sin(run.heading - run.log.meta.uphill_yaw_rad)
    lever = (1 if k else -1) * r / model.get("track")
    pull = -0.5 * r * run.mass * GRAVITY_M_S2 * climb
    moment = run.mass * GRAVITY_M_S2 * (model.get("com_x") * side_climb + model.get("com_y") * climb)
    pull = pull + lever * moment
    drive_acc = 0.25 * run.mass * r * r * (run.acc[0] + run.acc[1])
    turn_acc = lever * model.get("yaw_inertia") * r * (run.acc[1] - run.acc[0]) / model.get("track")
    yaw_sign = np.tanh(smooth(run.wheel_rate, run.half) / (SIGN_TURN * run.machine.turn))
    return _Body(r, lever, pull, climb, side_climb, turn_acc, drive_acc + turn_acc - pull, middles(yaw_sign))


def _axis_pull(run: Signals, k: int) -> np.ndarray:
    """Torque (n,) N·m of gravity on a single axis: of a pendulum, 0 of the others."""
    model = run.model
    if int(model.get("axis")) != 2:
        return np.zeros(run.n)
    th = run.th[k]
    if th is not None:
        angle = filled(run.t, th)
    else:
        angle = cumulated(middles(run.w[k]), run.dt) + model.get("axis_zero")
    swung = model.get("axis_mass") + run.log.meta.payload_kg
    return pendulum.py_func(swung, model.get("axis_arm"), angle - model.get("axis_zero"), np.sin)


def _residual(run: Signals, k: int, torque: np.ndarray, current_noise: float) -> None:
    """The block itself: the speed beyond what `torque` (n - 1,) N·m makes of it."""
    t, dt, w = run.t, run.dt, run.w[k]
    momentum = run.inertia[k] * w + (run.cross * run.w[1 - k] if run.body else 0.0)
    residual = run.cut(momentum - cumulated(torque, dt)) / run.inertia[k]
    steps = float(np.median(dt))
    walk = (run.km[k] * current_noise * steps / run.inertia[k]) ** 2 * (WINDOW_S / steps) / 6.0
    white: np.ndarray | float = run.w_noise[k] ** 2 * (1.0 + (run.cross / run.inertia[k]) ** 2)
    if not run.has_w[k]:
        white = run.w_noise[k] ** 2 + run.w_extra[k] ** 2
    known = near(t, run.w_rows[k]) & (near(t, run.i_rows[k]) if run.has_i[k] else True)
    rows = run.w_rows[k] & np.isfinite(residual) & run.cut.whole(known)
    run.block(f"torque_{run.robot.sides[k]}", residual, np.sqrt(white + walk), rows)


def _friction_columns(wheel: _Wheel) -> None:
    """Frictions, and torques over the wheel's angle."""
    run, k, s, put = wheel.run, wheel.k, wheel.side, wheel.put
    model, t, mid, sign_mid, angle = run.model, run.t, wheel.mid, wheel.sign, wheel.angle
    gear = model.get("gear_ratio")
    put(f"drivetrain:coulomb_{s}", -sign_mid)
    put(f"drivetrain:steady_{s}", np.ones(run.n - 1))
    for fade in FADES:
        put(f"drivetrain:stribeck{fade:g}_{s}", -sign_mid * np.exp(-((mid / (fade * run.machine.speed)) ** 2)))
    put(f"drivetrain:viscous_{s}", -max(gear**2 * model.get("viscous", k), 1e-9) * mid)
    put(f"drivetrain:quadratic_{s}", -mid * np.abs(mid))
    put(f"drivetrain:direction_{s}", -np.abs(sign_mid))
    put(f"drivetrain:direction_{s}b", -np.abs(mid))
    put(f"drivetrain:load_{s}", -np.abs(wheel.drive - wheel.fluid * mid) * sign_mid)
    put(f"drivetrain:place_{s}", -sign_mid * np.sin(middles(angle)))
    put(f"drivetrain:place_{s}b", -sign_mid * np.cos(middles(angle)))
    if model.get("ripple", k):
        # One that is of another size at another place of the turn, and may be in another phase there.
        bites = np.sin(model.get("ripple_cycles", k) * middles(angle) + model.get("ripple_phase", k))
        turned = np.cos(model.get("ripple_cycles", k) * middles(angle) + model.get("ripple_phase", k))
        for ahead, wave in (("", bites), ("@1", turned)):
            put(f"drivetrain:detent{ahead}_{s}", wave * np.sin(middles(angle)))
            put(f"drivetrain:detent{ahead}_{s}b", wave * np.cos(middles(angle)))
    put(f"drivetrain:growing_{s}", -sign_mid * middles(t - t[0]))
    own = gear**2 * model.get("rotor_inertia", k)
    run.put(f"drivetrain:inertia_{s}", f"torque_{s}", -run.cut(own * run.w[k]) / run.inertia[k])


def _gear_columns(wheel: _Wheel, body: _Body) -> None:
    """A spring and free play in the gear."""
    run, k, s = wheel.run, wheel.k, wheel.side
    model, t = run.model, run.t
    rate = np.gradient(smooth(body.load, run.half), t)
    knock = np.gradient(np.tanh(smooth(body.load, run.half) / (SIGN_LOAD * run.machine.torque)), t)
    # Speed and angle are those of the gear's output; behind a spring or free play the wheel lags.
    for name, lead in (("spring", rate), ("play", knock)):
        cause = f"drivetrain:{name}_{s}"
        share = 1.0 - model.get("gear_ratio") ** 2 * model.get("rotor_inertia", k) / run.inertia[k]
        run.put(cause, f"torque_{s}", share * run.cut(lead))
        if run.gyro is not None:
            run.put(cause, "turn", -(1 if k else -1) * body.radius / model.get("track") * lead)


def _ripple_columns(wheel: _Wheel) -> None:
    """Torques that repeat over a turn of a wheel whose angle is measured."""
    if wheel.run.th[wheel.k] is None:
        return
    for cycles in RIPPLES:
        wheel.put(f"drivetrain:ripple{cycles}_{wheel.side}", np.sin(cycles * middles(wheel.angle)))
        wheel.put(f"drivetrain:ripple{cycles}_{wheel.side}b", np.cos(cycles * middles(wheel.angle)))


def _current_columns(wheel: _Wheel) -> None:
    """Winding and current sensor, as they show in the torque."""
    run, k, s, put = wheel.run, wheel.k, wheel.side, wheel.put
    res, _, ke, _ = run.electric[k]
    w, i = run.w[k], run.i[k]
    if run.has_i[k] and run.voltage_mode:
        # What the current does between its samples hangs on the winding too.
        within = run.km[k] * ke / middles(res) * (w[1:] - run.w_mean[k])
        put(f"winding:resistance_{s}", -within)
        put(f"winding:constant_{s}", within)
    if run.has_i[k]:
        run.put(f"sensing:current_gain_{s}", f"current_{s}", i)
        put(f"sensing:current_gain_{s}", -run.km[k] * middles(i))
        run.put(f"sensing:current_bias_{s}", f"current_{s}", np.ones(run.n))
        put(f"sensing:current_bias_{s}", np.full(run.n - 1, -run.km[k]))
        # A current sensor that bends, and one that lags.
        run.put(f"sensing:current_bend_{s}", f"current_{s}", i * np.abs(i))
        put(f"sensing:current_bend_{s}", -run.km[k] * middles(i * np.abs(i)))
        # Of the current that follows from voltage and speed: a difference of samples would be the residual's own noise.
        end = run.electric[k][3]
        slope = np.diff(end, prepend=end[0])
        run.put(f"sensing:current_lag_{s}", f"current_{s}", -slope)
        put(f"sensing:current_lag_{s}", run.km[k] * middles(slope))
        # One that lies in whatever way: what it reads beyond what voltage and speed ask for, in the current and in no
        # torque.
        read = smooth(i - end, run.half)
        run.put(f"sensing:current_fault_{s}", f"current_{s}", read)
        put(f"sensing:current_fault_{s}", -run.km[k] * middles(read))
        put(f"winding:constant_{s}", run.km[k] * middles(i))
        put(f"winding:saturation_{s}", -run.km[k] * middles(i * np.abs(i)))
        largest = float(np.max(np.abs(smooth(i, run.half)), initial=0.0))
        for part in TRACTIONS:
            put(
                f"winding:saturation@{part:g}_{s}",
                -run.km[k] * middles(i - np.clip(i, -part * largest, part * largest)),
            )
    elif run.voltage_mode:
        put(f"winding:constant_{s}", wheel.drive)


def _body_columns(wheel: _Wheel, body: _Body) -> None:
    """Rolling and turning resistance, mass and its centre, slope, yaw inertia, drag."""
    run, t, put, r, lever = wheel.run, wheel.run.t, wheel.put, body.radius, body.lever
    weight = GRAVITY_M_S2 * r * 0.5
    put("wheel_ground:rolling", -wheel.sign * weight * run.mass)
    put("wheel_ground:scrub", -lever * body.yaw_sign)
    put("wheel_ground:turn_drag", -lever * middles(run.wheel_rate))
    put("chassis:mass", middles(body.pull) / run.mass - 0.25 * r * r * middles(run.acc[0] + run.acc[1]))
    uphill = run.heading - run.log.meta.uphill_yaw_rad
    put("chassis:slope", -weight * run.mass * middles(np.cos(uphill)))
    put("chassis:slope_side", -weight * run.mass * middles(np.sin(uphill)))
    put(
        "chassis:com_x",
        lever
        * run.mass
        * (GRAVITY_M_S2 * middles(body.side_climb) - middles(0.5 * r * (run.w[0] + run.w[1]) * run.wheel_rate)),
    )
    put("chassis:com_x", 0.5 * r * run.mass * middles(run.wheel_rate) ** 2)
    put("chassis:com_y", lever * run.mass * GRAVITY_M_S2 * middles(body.climb))
    put("chassis:yaw_inertia", -middles(body.turning))
    put("chassis:drag", -0.5 * r * np.tanh(middles(run.w[0] + run.w[1]) / (SIGN_WAY * run.machine.speed)))
    if run.log.has("x") and run.log.has("y"):
        # A tether pulls towards where the run began.
        x, y = (filled(t, run.log.columns[c]) for c in ("x", "y"))
        away = (x - x[0]) * np.cos(run.heading) + (y - y[0]) * np.sin(run.heading)
        put("chassis:tether", -0.5 * r * middles(away))


def _tyre_columns(wheel: _Wheel, body: _Body) -> None:
    """A wheel's radius, and a tyre that gives no more than so much: what it cannot pass on is left to the wheel, and
    lost on the way.
    """
    run, k, s, load = wheel.run, wheel.k, wheel.side, body.load
    wheel.put(f"wheel_ground:radius_{s}", -middles(load))
    most = float(np.max(np.abs(smooth(load, run.half)), initial=0.0))
    for part in TRACTIONS:
        excess = load - np.clip(load, -part * most, part * most)
        wheel.put(f"wheel_ground:traction{part:g}_{s}", middles(excess))
        slipped = -first_order(excess, np.exp(-run.dt / SLIPPED_S))
        run.way_columns(f"wheel_ground:traction{part:g}_{s}b", k, slipped)
        if run.gyro is not None:
            run.put(f"wheel_ground:traction{part:g}_{s}b", "turn", body.lever * slipped)
