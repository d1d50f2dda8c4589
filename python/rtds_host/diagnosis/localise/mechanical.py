"""The block of the gear, the wheels and the body: current -> speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtds_host.contract import GRAVITY_M_S2
from rtds_host.diagnosis.localise.series import cumulated, filled, middles, near, smooth
from rtds_host.diagnosis.localise.signals import WINDOW_S, Signals
from rtds_host.diagnosis.thresholds import CLEAR_RATIO, SIGNIFICANT
from rtds_host.plant.friction import rolling, stribeck
from rtds_host.plant.ground import pendulum
from rtds_host.plant.torque import ANGLE
from rtds_host.plant.torques import TORQUES

# Numerical: speeds over which friction fades, of the speed without load, and cycles a turn of a ripple.
FADES = (0.04, 0.14)
RIPPLES = (1, 2, 3, 4, 6, 8, 12, 18)
# Numerical: shares of the machine's largest yaw rate and stall torque over which a sign turns over.
SIGN_TURN, SIGN_LOAD = 0.01, 0.002


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
    rests = np.abs(middles(smooth(run.w[k], run.half))) < SIGNIFICANT * run.w_noise[k]
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
        if CLEAR_RATIO * tau < float(np.median(dt)):
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
    yaw_sign = np.tanh(smooth(run.wheel_rate, run.half) / (SIGN_TURN * run.scales.turn))
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
    """Frictions and the rotor's inertia."""
    run, k, s, put = wheel.run, wheel.k, wheel.side, wheel.put
    model, mid, sign_mid = run.model, wheel.mid, wheel.sign
    gear = model.get("gear_ratio")
    put(f"drivetrain:coulomb_{s}", -sign_mid)
    put(f"drivetrain:steady_{s}", np.ones(run.n - 1))
    for fade in FADES:
        put(f"drivetrain:stribeck{fade:g}_{s}", -sign_mid * np.exp(-((mid / (fade * run.scales.speed)) ** 2)))
    put(f"drivetrain:viscous_{s}", -max(gear**2 * model.get("viscous", k), 1e-9) * mid)
    put(f"drivetrain:direction_{s}", -np.abs(sign_mid))
    put(f"drivetrain:direction_{s}b", -np.abs(mid))
    put(f"drivetrain:load_{s}", -np.abs(wheel.drive - wheel.fluid * mid) * sign_mid)
    own = gear**2 * model.get("rotor_inertia", k)
    run.put(f"drivetrain:inertia_{s}", f"torque_{s}", -run.cut(own * run.w[k]) / run.inertia[k])


def _gear_columns(wheel: _Wheel, body: _Body) -> None:
    """A spring and free play in the gear."""
    run, k, s = wheel.run, wheel.k, wheel.side
    model, t = run.model, run.t
    rate = np.gradient(smooth(body.load, run.half), t)
    knock = np.gradient(np.tanh(smooth(body.load, run.half) / (SIGN_LOAD * run.scales.torque)), t)
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
        # What the current does between its samples depends on the winding too.
        within = run.km[k] * ke / middles(res) * (w[1:] - run.w_mean[k])
        put(f"winding:resistance_{s}", -within)
        put(f"winding:constant_{s}", within)
    if run.has_i[k]:
        run.put(f"sensing:current_gain_{s}", f"current_{s}", i)
        put(f"sensing:current_gain_{s}", -run.km[k] * middles(i))
        run.put(f"sensing:current_bias_{s}", f"current_{s}", np.ones(run.n))
        put(f"sensing:current_bias_{s}", np.full(run.n - 1, -run.km[k]))
        # A sensor that lies in whatever way: what it reads beyond what voltage and speed ask for, in the current and in
        # no torque.
        read = smooth(i - run.electric[k][3], run.half)
        run.put(f"sensing:current_fault_{s}", f"current_{s}", read)
        put(f"sensing:current_fault_{s}", -run.km[k] * middles(read))
        put(f"winding:constant_{s}", run.km[k] * middles(i))
    elif run.voltage_mode:
        put(f"winding:constant_{s}", wheel.drive)


def _body_columns(wheel: _Wheel, body: _Body) -> None:
    """Rolling and turning resistance, mass and its centre, slope, yaw inertia, a wheel's radius."""
    run, put, r, lever = wheel.run, wheel.put, body.radius, body.lever
    weight = GRAVITY_M_S2 * r * 0.5
    put("wheel_ground:rolling", -wheel.sign * weight * run.mass)
    put("wheel_ground:scrub", -lever * body.yaw_sign)
    put("chassis:mass", middles(body.pull) / run.mass - 0.25 * r * r * middles(run.acc[0] + run.acc[1]))
    uphill = run.heading - run.log.meta.uphill_yaw_rad
    put("chassis:slope", -weight * run.mass * middles(np.cos(uphill)))
    put(
        "chassis:com_x",
        lever
        * run.mass
        * (GRAVITY_M_S2 * middles(body.side_climb) - middles(0.5 * r * (run.w[0] + run.w[1]) * run.wheel_rate)),
    )
    put("chassis:com_x", 0.5 * r * run.mass * middles(run.wheel_rate) ** 2)
    put("chassis:com_y", lever * run.mass * GRAVITY_M_S2 * middles(body.climb))
    put("chassis:yaw_inertia", -middles(body.turning))
    put(f"wheel_ground:radius_{wheel.side}", -middles(body.load))
