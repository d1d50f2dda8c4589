"""The planar world: machines with effects, what they are asked to do, and what their sensors say of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from rtds_host.blind import curve, kernel, unnamed
from rtds_host.blind.gap import channel_gaps
from rtds_host.blind.kernel import SIDE_NAMES, WORLD_NAMES

STEP_S = 50e-6
STEPS_S = (STEP_S, 25e-6, 20e-6, 10e-6)  # divisors of the log's grid of times
GRAVITY_M_S2 = kernel.GRAVITY_M_S2
# Time constants and lengths of what is not there: nothing may be divided by 0.
NEUTRAL = {
    "bus_tau": 1.0,
    "gust_tau": 1.0,
    "dahl_rad": 1.0,
    "grease_tau": 1.0,
    "bump_length": 1.0,
    "relax_tau": 1.0,
    **unnamed.NEUTRAL,
}
CLOSED = ("spin", "circle", "eight", "linear", "teleop")
CONTROLLED_V_S = 258.5 * 6.538e-3  # back-EMF at the gear's output that the controller's gains are meant for
TOLERANCE_NAMES = {
    "resistance_ohm": ("resistance",),
    "torque_constant_nm_per_a": ("torque_constant", "back_emf"),
    "rotor_inertia_kg_m2": ("inertia",),
    "viscous_friction_nm_s_per_rad": ("viscosity",),
}
# Counts of the instruments, as the logs of such robots show them.
QUANTA = {
    "v_bus": 0.01,
    "i": 0.00269,
    "w": 0.001,
    "th": 2 * math.pi / 4096,
    "gyro_z": 1e-4,
    "x": 1e-4,
    "y": 1e-4,
    "yaw": 1e-4,
}


@dataclass
class Sensing:
    """Sensor errors that act after the mechanics (contract, section 3, `sensing`), and those outside of it."""

    speed_gain: np.ndarray = field(default_factory=lambda: np.ones(2))
    current_gain: np.ndarray = field(default_factory=lambda: np.ones(2))
    current_bias: np.ndarray = field(default_factory=lambda: np.zeros(2))
    gyro_bias: float = 0.0
    gyro_gain: float = 1.0
    hold: list = field(default_factory=list)  # (share of the run from, seconds, channel)
    clip_speed: float = math.inf
    encoder_wobble: np.ndarray = field(default_factory=lambda: np.zeros(2))
    current_bend: np.ndarray = field(default_factory=lambda: np.zeros(2))  # 1 / A^2: i reported as i / (1 + c i^2)
    speed_floor: np.ndarray = field(default_factory=lambda: np.zeros(2))  # rad/s, below which a speed reads 0
    current_floor: np.ndarray = field(default_factory=lambda: np.zeros(2))  # A, below which a current reads 0
    gyro_pull: float = 0.0  # rad/s a m/s2 that a gyro reads of the robot's acceleration
    gyro_drift: float = 0.0  # rad/s2
    # A of current that switching makes at half duty, and the frequency, Hz, at which it beats with the samples.
    ripple_amps: np.ndarray = field(default_factory=lambda: np.zeros(2))
    ripple_hz: float = 0.0

    SIDED = ("encoder_wobble", "current_bend", "speed_floor", "current_floor", "ripple_amps")
    WHOLE = ("clip_speed", "gyro_pull", "gyro_drift", "ripple_hz")


@dataclass
class Machine:
    """One physical robot: the kernel's parameters and its sensors."""

    side: np.ndarray
    world: np.ndarray
    sensing: Sensing
    slope_extra: float = 0.0
    mass_extra: float = 0.0
    brakes: tuple | None = None  # (events a run, seconds, torque)
    stalls: dict = field(default_factory=dict)  # of the link: "stalls" a run, "stall_s" seconds each
    tolerance: dict = field(default_factory=dict)
    base_step_s: float = STEP_S
    lever: tuple[float, float] = (0.0, 0.0)  # of an axis: inertia and gravity torque a unit of payload
    curves: np.ndarray = field(default_factory=curve.no_curves)  # laws that were drawn at random, see `curve`

    def set(self, name: str, value, sides=(0, 1)) -> None:
        """Set a kernel parameter by name."""
        if name in WORLD_NAMES:
            self.world[WORLD_NAMES.index(name)] = value
        else:
            for s in sides:
                self.side[SIDE_NAMES.index(name), s] = value

    def get(self, name: str, sides=(0, 1)) -> float:
        """A kernel parameter by name, of the first of some sides."""
        if name in WORLD_NAMES:
            return float(self.world[WORLD_NAMES.index(name)])
        return float(self.side[SIDE_NAMES.index(name), sides[0]])

    @property
    def step_s(self) -> float:
        """Integration step: a wheel loose of its rotor is light and needs a finer one."""
        loose = self.side[SIDE_NAMES.index("backlash")].any() or self.side[SIDE_NAMES.index("stiffness")].any()
        return self.base_step_s / 2 if loose else self.base_step_s

    def scale(self, name: str, ratio: float, sides=(0, 1)) -> None:
        """Multiply a kernel parameter."""
        if name in WORLD_NAMES:
            self.world[WORLD_NAMES.index(name)] *= ratio
        else:
            for s in sides:
                self.side[SIDE_NAMES.index(name), s] *= ratio


def step_for(motor) -> float:
    """Longest step of `STEPS_S` that is a hundredth of the rotor's own mechanical time constant or less."""
    lag = (
        motor.rotor_inertia_kg_m2
        * motor.resistance_ohm
        / (motor.torque_constant_nm_per_a * motor.back_emf_constant_v_s_per_rad)
    )
    return next((step for step in STEPS_S if step <= 0.01 * lag), STEPS_S[-1]) if math.isfinite(lag) else STEP_S


def nominal_axis(robot) -> Machine:
    """A nominal single axis as a machine of this world: a left side whose wheel is the load and has no rim.

    The right side is there as well and stands still.
    """
    motor, axis, torque = robot.motor, robot.axis, robot.driver.mode == "torque"
    machine = Machine(
        np.zeros((len(SIDE_NAMES), 2)), np.zeros(len(WORLD_NAMES)), Sensing(), base_step_s=step_for(motor)
    )
    lever = {
        "inertia": (1.0, 0.0),
        "linear": (axis.metres_per_rad**2, 0.0),
        "pendulum": (axis.length_m**2, GRAVITY_M_S2 * axis.length_m),
    }[axis.kind]
    load = axis.inertia_kg_m2 + (0.0 if axis.kind == "inertia" else axis.mass_kg * lever[0])
    rotor = motor.gear_ratio**2 * motor.rotor_inertia_kg_m2
    teeth = load * rotor / (load + rotor) / kernel.STOP_REDUCED_KG_M2
    for name, value in {
        "resistance": 1.0 if torque else motor.resistance_ohm,
        "inductance": 1e-3 if torque else motor.inductance_h,
        "torque_constant": 0.0 if torque else motor.torque_constant_nm_per_a,
        "back_emf": 0.0 if torque else motor.back_emf_constant_v_s_per_rad,
        "torque_per_volt": robot.driver.torque_nm_per_v if torque else 0.0,
        "inertia": motor.rotor_inertia_kg_m2,
        "viscosity": motor.viscous_friction_nm_s_per_rad,
        "gain": 1.0,
        "limit": math.inf,
        "stribeck_speed": 1.0,
        "voltage": robot.supply_v,
        "gear": motor.gear_ratio,
        "mass": 1.0,
        "yaw_inertia": 1.0,
        "track": 1.0,
        "wheel_inertia": load,
        "tyre": 1.0,
        "pendulum": axis.mass_kg * lever[1],
        "pendulum_zero": axis.zero_rad,
        **NEUTRAL,
        "stop": kernel.STOP_NM_PER_RAD * teeth,
        "stop_damping": kernel.STOP_NM_S_PER_RAD * teeth,
    }.items():
        machine.set(name, value)
    machine.lever = lever
    return machine


def nominal_machine(robot) -> Machine:
    """The nominal robot, or axis, as a machine of this world."""
    if robot.axis is not None:
        return nominal_axis(robot)
    motor, chassis = robot.motor, robot.chassis
    step = step_for(motor)
    # Tyres are as stiff as the lightest thing that they push lets an explicit step be.
    rotor = motor.gear_ratio**2 * motor.rotor_inertia_kg_m2
    lightest = min(
        chassis.wheel_inertia_kg_m2 / chassis.wheel_radius_m**2,
        chassis.mass_kg / 2,
        chassis.yaw_inertia_kg_m2 / (chassis.track_width_m / 2) ** 2,
    )
    heavy = max(1.0, chassis.mass_kg)
    tyre = min(kernel.TYRE_N_PER_M * heavy, 0.1 * lightest / (step / 2) ** 2)
    tyre_damping = min(kernel.TYRE_N_S_PER_M * heavy, 0.8 * lightest / (step / 2))
    wheel = chassis.wheel_inertia_kg_m2
    teeth = wheel * rotor / (wheel + rotor) / kernel.STOP_REDUCED_KG_M2
    machine = Machine(np.zeros((len(SIDE_NAMES), 2)), np.zeros(len(WORLD_NAMES)), Sensing())
    for name, value in {
        "resistance": motor.resistance_ohm,
        "inductance": motor.inductance_h,
        "torque_constant": motor.torque_constant_nm_per_a,
        "back_emf": motor.back_emf_constant_v_s_per_rad,
        "inertia": motor.rotor_inertia_kg_m2,
        "viscosity": motor.viscous_friction_nm_s_per_rad,
        "gain": 1.0,
        "limit": math.inf,
        "radius": chassis.wheel_radius_m,
        "stribeck_speed": 1.0,
        "voltage": robot.supply_v,
        "gear": motor.gear_ratio,
        "mass": chassis.mass_kg,
        "yaw_inertia": chassis.yaw_inertia_kg_m2,
        "track": chassis.track_width_m,
        "wheel_inertia": chassis.wheel_inertia_kg_m2,
        "tyre": tyre,
        "tyre_damping": tyre_damping,
        **NEUTRAL,
        "stop": kernel.STOP_NM_PER_RAD * teeth,
        "stop_damping": kernel.STOP_NM_S_PER_RAD * teeth,
    }.items():
        machine.set(name, value)
    machine.base_step_s = step
    return machine


def apply_effect(machine: Machine, effect: dict) -> None:
    """Build one effect of the contract's catalogue (its section 3) into a machine."""
    p, sides = effect["parameters"], {"both": (0, 1), "left": (0,), "right": (1,)}[effect["side"]]
    name = effect["id"]
    simple = {
        "supply_sag": (("sag", "resistance_ohm"),),
        "battery_decline": (("decline", "rate_v_per_s"),),
        "driver_deadzone": (("deadzone", "volts"),),
        "bridge_drop": (("drop", "volts"),),
        "voltage_limit": (("limit", "volts"),),
        "pwm_curve": (("curve", "curvature"),),
        "winding_heating": (("heat_per_watt", "rise_per_watt"), ("heat_tau", "time_constant_s")),
        "coulomb_friction": (("coulomb", "torque_nm"),),
        "stribeck_friction": (
            ("coulomb", "torque_nm"),
            ("stribeck", "extra_torque_nm"),
            ("stribeck_speed", "speed_rad_s"),
        ),
        "viscous_friction": (("viscous", "nm_s_per_rad"),),
        "friction_asymmetry": (("asym_torque", "torque_nm"), ("asym_viscous", "nm_s_per_rad")),
        "load_friction": (("load_friction", "ratio"),),
        "backlash": (("backlash", "angle_rad"),),
        "gear_compliance": (("stiffness", "stiffness_nm_per_rad"), ("damping", "damping_nm_s_per_rad")),
        "torque_ripple": (
            ("ripple", "amplitude_nm"),
            ("ripple_cycles", "cycles_per_rev"),
            ("ripple_phase", "phase_rad"),
        ),
        "longitudinal_slip": (("slip", "slip_per_newton"),),
        "spin_scrub": (("scrub", "torque_nm"),),
        "rolling_resistance": (("rolling", "coefficient"),),
        "com_offset": (("com_x", "x_m"), ("com_y", "y_m")),
        "speed_filter": (("filter_tau", "time_constant_s"),),
        "command_delay": (("command_delay", "seconds"),),
        "measurement_delay": (("measurement_delay", "seconds"),),
    }
    ratios = {
        "driver_gain": ("gain",),
        "resistance_error": ("resistance",),
        "torque_constant_error": ("torque_constant", "back_emf"),
        "rotor_inertia_error": ("inertia",),
        "wheel_radius_error": ("radius",),
        "track_width_error": ("track",),
        "yaw_inertia_error": ("yaw_inertia",),
    }
    if name in ratios:
        for target in ratios[name]:
            machine.scale(target, p["ratio"], sides)
    elif name in simple:
        if name == "longitudinal_slip":  # a tyre that creeps is soft, too
            for target, softer in (("tyre", kernel.SOFT_TYRE), ("tyre_damping", kernel.SOFT_TYRE_DAMPING)):
                machine.side[SIDE_NAMES.index(target), list(sides)] /= softer
        for target, key in simple[name]:
            if target == "coulomb":  # two effects may both bring dry friction
                machine.side[SIDE_NAMES.index(target), list(sides)] += p[key]
            else:
                machine.set(target, p[key], sides)
    elif name == "payload_error":
        machine.mass_extra += next(iter(p.values()))  # kg, or of an inertia kg m2
    elif name == "slope_error":
        machine.slope_extra += p["slope_rad"]
    elif name == "speed_gain":
        machine.sensing.speed_gain[list(sides)] *= p["ratio"]
    elif name == "current_gain":
        machine.sensing.current_gain[list(sides)] *= p["ratio"]
    elif name == "current_bias":
        machine.sensing.current_bias[list(sides)] += p["amperes"]
    elif name == "gyro_bias":
        machine.sensing.gyro_bias += p["rad_s"]
    elif name == "gyro_gain":
        machine.sensing.gyro_gain *= p["ratio"]
    else:
        raise ValueError(f"effect {name!r} is not in the planar world")


def apply_outside(machine: Machine, outside: dict) -> None:
    """Build one effect that is outside of the catalogue into a machine."""
    name, p = outside["id"], outside["parameters"]
    sides = {"both": (0, 1), "left": (0,), "right": (1,)}[outside["side"]]
    for key, value in p.items():
        if key == "curve":
            machine.curves[list(sides)] = value
        elif key == "hold":
            machine.sensing.hold = [tuple(item) for item in value]
        elif key in Sensing.WHOLE:
            setattr(machine.sensing, key, value)
        elif key in Sensing.SIDED:
            getattr(machine.sensing, key)[list(sides)] = value
        elif key == "brakes":
            machine.brakes = tuple(value)
        elif key in ("stalls", "stall_s"):
            machine.stalls[key] = value
        elif key in SIDE_NAMES or key in WORLD_NAMES:
            machine.set(key, value, sides)
        else:
            raise ValueError(f"{name}: unknown parameter {key!r}")


def add_tolerance(machine: Machine, rng: np.random.Generator, size: float = 0.01, normal: bool = False) -> None:
    """Scatter R, K, J and B of each motor by up to `size`, or by that standard deviation (the contract's nuisances)."""
    for s, label in enumerate("lr"):
        fit = {}
        for key, targets in TOLERANCE_NAMES.items():
            ratio = 1.0 + size * float(np.clip(rng.standard_normal(), -2.5, 2.5) if normal else rng.uniform(-1, 1))
            for target in targets:
                machine.scale(target, ratio, (s,))
                nice = {"torque_constant": "torque_constant_nm_per_a", "back_emf": "back_emf_constant_v_s_per_rad"}.get(
                    target, key
                )
                fit[nice] = float(machine.side[SIDE_NAMES.index(target), s])
        machine.tolerance[label] = fit


def _ramp(t: np.ndarray, knots: list[tuple[float, float]], rate: float) -> np.ndarray:
    """Piecewise constant targets, reached at a limited rate."""
    out = np.zeros_like(t)
    value, k, target = 0.0, 0, 0.0
    dt = np.diff(t, prepend=t[0])
    for n, now in enumerate(t):
        while k < len(knots) and knots[k][0] <= now:
            target = knots[k][1]
            k += 1
        value += min(max(target - value, -rate * dt[n]), rate * dt[n])
        out[n] = value
    return out


# Wheel speed that closed-loop scenarios stay within, rad/s.
TOP = 5.6


def _steps(t: np.ndarray, rng: np.random.Generator, r: float, b: float) -> np.ndarray:
    """Steps of the voltage: both wheels alike, against each other, each its own, or none."""
    v = np.zeros((t.size, 2))
    end = t[-1]
    levels = np.array([3.0, 4.5, 6.0, 8.0, 10.0, 12.0])
    now = 0.4
    while now < end - 0.5:
        mode = rng.choice(4, p=[0.35, 0.3, 0.2, 0.15])
        a, c = rng.choice(levels, 2) * rng.choice([-1, 1], 2)
        pair = [(a, a), (a, -a), (a, c), (0.0, 0.0)][mode]
        v[t >= now] = pair
        now += rng.uniform(0.6, 2.0)
    return v


def _coast(t: np.ndarray, rng: np.random.Generator, r: float, b: float) -> np.ndarray:
    """Steps with pauses, in which the robot coasts."""
    v = np.zeros((t.size, 2))
    end = t[-1]
    now, on = 0.4, True
    while now < end - 0.5:
        a = rng.uniform(4, 11) * rng.choice([-1, 1])
        pair = [(a, a), (a, -a), (a, a / 2), (a / 2, a)][rng.choice(4, p=[0.5, 0.2, 0.15, 0.15])]
        v[t >= now] = pair if on else (0.0, 0.0)
        on = not on
        now += rng.uniform(0.8, 2.0)
    return v


def _prbs(t: np.ndarray, rng: np.random.Generator, r: float, b: float) -> np.ndarray:
    """Pseudo-random binary voltages, each wheel's own."""
    v = np.zeros((t.size, 2))
    end = t[-1]
    high = rng.uniform(3, 10, 2)
    low = -rng.uniform(3, 10, 2)
    hold = rng.uniform(0.08, 0.16)
    for s in range(2):
        now = 0.4
        while now < end:
            v[t >= now, s] = high[s] if rng.random() < 0.5 else low[s]
            now += hold * rng.integers(1, 5)
    v[t > end - 0.4] = 0.0
    return v


def _crawl(t: np.ndarray, rng: np.random.Generator, r: float, b: float) -> np.ndarray:
    """Slow triangles, whose wheels differ a little and part later."""
    v = np.zeros((t.size, 2))
    end = t[-1]
    peak = rng.uniform(1.0, 2.6)
    period = rng.uniform(4.0, 8.0)
    wave = np.where(t < 0.1, 0, peak * 2 / math.pi * np.arcsin(np.sin(2 * math.pi * (t - 0.1) / period)))
    other = rng.uniform(0.85, 1.0)
    flip = np.where(t > end * rng.uniform(0.4, 0.6), -1.0, 1.0)
    order = rng.permutation(2)
    v[:, order[0]], v[:, order[1]] = wave, wave * other * flip
    return v


def _linear(t: np.ndarray, rng: np.random.Generator, r: float, b: float) -> np.ndarray:
    """Straight on: a ramp up and a ramp down."""
    w = np.zeros((t.size, 2))
    end = t[-1]
    peak = rng.uniform(4.8, 5.6)
    line = _ramp(t, [(0.5, peak), (end - 2.5, 0.0)], rng.uniform(3, 6))
    w[:] = line[:, None]
    return w


def _circle(t: np.ndarray, rng: np.random.Generator, r: float, b: float) -> np.ndarray:
    """A circle of 0.5 m."""
    w = np.zeros((t.size, 2))
    end = t[-1]
    peak, radius = rng.uniform(4.8, 5.6), 0.5
    ratio = (radius - b / 2) / (radius + b / 2)
    line = _ramp(t, [(0.5, peak), (end - 2.5, 0.0)], rng.uniform(3, 6))
    order = rng.permutation(2)
    w[:, order[0]], w[:, order[1]] = line, line * ratio
    return w


def _eight(t: np.ndarray, rng: np.random.Generator, r: float, b: float) -> np.ndarray:
    """A lemniscate, turned either way."""
    w = np.zeros((t.size, 2))
    end = t[-1]
    span = end - 2.0
    u = np.clip((t - 0.5) / span, 0, 1)
    s = 2 * math.pi * (u**3 * (10 - 15 * u + 6 * u * u) * 0.15 + 0.85 * u)
    size = rng.uniform(0.5, 0.62)
    fine = np.linspace(0, 2 * math.pi, 4001)
    px, py = size * np.sin(fine), size * np.sin(fine) * np.cos(fine)
    dx, dy = np.gradient(px, fine), np.gradient(py, fine)
    angle = np.unwrap(np.arctan2(dy, dx))
    speed = np.interp(s, fine, np.hypot(dx, dy)) * np.gradient(s, t)
    turn = np.interp(s, fine, np.gradient(angle, fine)) * np.gradient(s, t)
    turn *= rng.choice([-1, 1])
    w[:, 0], w[:, 1] = (speed - turn * b / 2) / r, (speed + turn * b / 2) / r
    w *= min(1.0, rng.uniform(5.0, 5.6) / np.abs(w).max())
    slow = np.clip((t - 0.3) / 1.0, 0, 1) * np.clip((end - 0.3 - t) / 1.0, 0, 1)
    w *= slow[:, None]
    return w


def _spin(t: np.ndarray, rng: np.random.Generator, r: float, b: float) -> np.ndarray:
    """Turns on the spot."""
    w = np.zeros((t.size, 2))
    end = t[-1]
    knots, now = [], 0.4
    while now < end - 1.5:
        knots.append((now, float(rng.choice([-1, 1]) * rng.uniform(0.5, 4.8))))
        now += rng.uniform(1.0, 2.5)
    line = _ramp(t, [*knots, (end - 1.2, 0.0)], rng.uniform(5, 15))
    w[:, 0], w[:, 1] = -line, line
    return w


def _teleop(t: np.ndarray, rng: np.random.Generator, r: float, b: float) -> np.ndarray:
    """A hand on a joystick: speeds and turns, with pauses."""
    w = np.zeros((t.size, 2))
    end = t[-1]
    ahead, around, now = [], [], 0.4
    while now < end - 1.5:
        if rng.random() < 0.2:
            ahead.append((now, 0.0))
            around.append((now, 0.0))
        else:
            ahead.append((now, float(rng.uniform(-0.6, 1.0) * TOP * 0.8)))
            around.append((now, float(rng.choice([0.0, rng.uniform(-0.45, 0.45) * TOP]))))
        now += rng.uniform(0.8, 2.5)
    rate = rng.uniform(4, 12)
    line, turn = _ramp(t, [*ahead, (end - 1.0, 0.0)], rate), _ramp(t, [*around, (end - 1.0, 0.0)], rate)
    w[:, 0], w[:, 1] = np.clip(line - turn, -TOP, TOP), np.clip(line + turn, -TOP, TOP)
    return w


# By name, from t (n,) s, a generator, and the wheels' radius and track, m: references of the speed, (n, 2) rad/s, of
# those in `CLOSED`, and voltages, (n, 2) V, of the others.
DRIVEN = {
    "steps": _steps,
    "coast": _coast,
    "prbs": _prbs,
    "crawl": _crawl,
    "linear": _linear,
    "circle": _circle,
    "eight": _eight,
    "spin": _spin,
    "teleop": _teleop,
}


def scenario(name: str, t: np.ndarray, rng: np.random.Generator, robot) -> tuple[np.ndarray, np.ndarray]:
    """Commands (n, 2) in V of an open-loop scenario, or speed references (n, 2) in rad/s of a closed-loop one.

    Returns
    -------
    (v_cmd, w_ref), one of them zero.
    """
    if name not in DRIVEN:
        raise ValueError(f"scenario {name!r} is not in the planar world")
    r, b = (robot.chassis.wheel_radius_m, robot.chassis.track_width_m) if robot.chassis else (1.0, 1.0)
    found, none = DRIVEN[name](t, rng, r, b), np.zeros((t.size, 2))
    return (none, found) if name in CLOSED else (np.round(found, 3), none)


def coloured(white: np.ndarray, t: np.ndarray, tau: float, share: float) -> np.ndarray:
    """White noise (n,) of unit variance -> noise of unit variance, `share` of it correlated over `tau` seconds."""
    if share <= 0:
        return white
    rng = np.random.default_rng(abs(int(white[0] * 1e9)))
    drive = rng.standard_normal(t.size)
    slow = np.empty_like(white)
    slow[0] = drive[0]
    keep = np.exp(-np.diff(t) / tau)
    for k in range(1, t.size):
        slow[k] = keep[k - 1] * slow[k - 1] + math.sqrt(1 - keep[k - 1] ** 2) * drive[k]
    return math.sqrt(1 - share) * white + math.sqrt(share) * slow


def stem(channel: str) -> str:
    """What a channel is part of: `i_l` of i, `yaw` of the pose."""
    if channel.endswith(("_l", "_r")):
        return channel[:-2]
    return "pose" if channel in ("x", "y", "yaw") else channel


def place_of(run: dict) -> dict:
    """A planned run's payload and slope as `run_machine` takes them."""
    return {"payload_kg": run["payload_kg"], "slope_rad": run["slope_rad"], "uphill": run["uphill_yaw_rad"]}


CHANNELS = ("v_bus", "i_l", "i_r", "w_l", "w_r", "th_l", "th_r", "gyro_z", "x", "y", "yaw")


def run_machine(
    machine: Machine,
    t: np.ndarray,
    v_cmd: np.ndarray,
    start: np.ndarray,
    payload_kg: float,
    slope_rad: float,
    uphill: float,
    closed: bool = False,
    w_ref: np.ndarray | None = None,
    noise_w: np.ndarray | None = None,
    robot=None,
    period_rows: int = 3,
    seed: int = 0,
    step_s: float | None = None,
    world: str = "planar",
) -> dict[str, np.ndarray]:
    """Drive a machine once and return what error-free instruments of that machine would report.

    Parameters
    ----------
    t : (n,) s. v_cmd : (n, 2) V, filled in when `closed`. start : (5,) x, y, yaw, th_l, th_r.
    Other arguments: see `kernel.simulate` and `run.json` of the contract.

    Returns
    -------
    channel -> (n,), sensor gains and biases applied, no noise, no quantisation.
    """
    place = machine.world.copy()
    place[WORLD_NAMES.index("mass")] += payload_kg + machine.mass_extra
    for name, arm in zip(("wheel_inertia", "pendulum"), machine.lever):
        place[WORLD_NAMES.index(name)] += arm * (payload_kg + machine.mass_extra)
    place[WORLD_NAMES.index("slope")] = slope_rad + machine.slope_extra
    place[WORLD_NAMES.index("uphill")] = uphill
    rng = np.random.default_rng(seed)
    events = np.zeros((0, 4))
    if machine.brakes is not None:
        count, seconds, torque = machine.brakes
        begin = rng.uniform(0.5, t[-1], int(count))
        events = np.column_stack(
            [
                begin,
                begin + rng.uniform(0.5, 1.5, begin.size) * seconds,
                rng.integers(0, 2, begin.size),
                torque * rng.uniform(0.6, 1.4, begin.size),
            ]
        )
    if machine.stalls:
        begin = rng.uniform(0.05, 0.9, int(machine.stalls["stalls"])) * t[-1]
        long = machine.stalls["stall_s"] * rng.uniform(0.5, 1.5, begin.size)
        link = np.column_stack([begin, begin + long, np.full(begin.size, -1.0), np.zeros(begin.size)])
        events = np.concatenate([events, link])
    if w_ref is None:
        w_ref = np.zeros((t.size, 2))
    if noise_w is None:
        noise_w = np.zeros((t.size, 2))
    gains = np.array([1.0, 0.0, 0.0, 12.0, *machine.sensing.speed_gain])
    if closed:
        motor = robot.motor
        ke = motor.gear_ratio * motor.back_emf_constant_v_s_per_rad
        kt = motor.gear_ratio * motor.torque_constant_nm_per_a
        drag = motor.gear_ratio**2 * motor.viscous_friction_nm_s_per_rad
        # The burger's controller, in the machine's own volts a speed.
        gains[:4] = (
            ke + motor.resistance_ohm * drag / kt,
            0.35 * ke / CONTROLLED_V_S,
            1.2 * ke / CONTROLLED_V_S,
            robot.supply_v,
        )
    rest = (closed, w_ref, noise_w, period_rows, gains, events, seed % (2**31))
    if world == "mujoco":
        from rtds_host.blind import world as second

        out = second.simulate(t, v_cmd, machine.side, place, start, *rest)
    else:
        out = kernel.simulate(t, v_cmd, machine.side, place, start, step_s or machine.step_s, *rest, machine.curves)
    duty = np.clip(v_cmd / machine.world[WORLD_NAMES.index("voltage")], -1.0, 1.0)
    return apply_sensors({name: out[:, k].copy() for k, name in enumerate(CHANNELS)}, machine, t, duty)


def apply_sensors(
    raw: dict[str, np.ndarray], machine: Machine, t: np.ndarray, duty: np.ndarray | None = None
) -> dict[str, np.ndarray]:
    """Gains, biases and faults of a machine's instruments; `raw` (channel -> (n,)) is changed and returned.

    duty : (n, 2) of the bridge, -1 to 1, whose switching a current's samples see; None without any.
    """
    sensing = machine.sensing
    if sensing.gyro_pull:
        pace = np.gradient(raw["x"], t) * np.cos(raw["yaw"]) + np.gradient(raw["y"], t) * np.sin(raw["yaw"])
        raw["gyro_z"] = raw["gyro_z"] + sensing.gyro_pull * np.gradient(pace, t)
    for s, label in enumerate("lr"):
        raw[f"i_{label}"] = curve.reading(machine.curves[s], curve.CURRENT_READING, raw[f"i_{label}"])
        raw[f"w_{label}"] = curve.reading(machine.curves[s], curve.SPEED_READING, raw[f"w_{label}"])
        wobble = sensing.encoder_wobble[s]
        if wobble:
            angle = raw[f"th_{label}"]
            raw[f"w_{label}"] *= 1 + wobble * np.cos(angle)
            raw[f"th_{label}"] = angle + wobble * np.sin(angle)
        raw[f"w_{label}"] = np.clip(raw[f"w_{label}"] * sensing.speed_gain[s], -sensing.clip_speed, sensing.clip_speed)
        raw[f"th_{label}"] = raw[f"th_{label}"] * sensing.speed_gain[s]
        raw[f"w_{label}"] = np.where(np.abs(raw[f"w_{label}"]) < sensing.speed_floor[s], 0.0, raw[f"w_{label}"])
        if sensing.ripple_amps[s] and duty is not None:
            # Of a triangle whose peaks go with d (1 - d); which part of it a sample meets beats slowly.
            share = np.abs(duty[:, s])
            meets = 2.0 * np.abs(2.0 * ((t * sensing.ripple_hz) % 1.0) - 1.0) - 1.0
            raw[f"i_{label}"] += sensing.ripple_amps[s] * 4.0 * share * (1.0 - share) * meets
        raw[f"i_{label}"] = np.where(np.abs(raw[f"i_{label}"]) < sensing.current_floor[s], 0.0, raw[f"i_{label}"])
        raw[f"i_{label}"] = raw[f"i_{label}"] / (1.0 + sensing.current_bend[s] * raw[f"i_{label}"] ** 2)
        raw[f"i_{label}"] = raw[f"i_{label}"] * sensing.current_gain[s] + sensing.current_bias[s]
    raw["gyro_z"] = curve.reading(machine.curves[0], curve.GYRO_READING, raw["gyro_z"])
    raw["gyro_z"] = raw["gyro_z"] * sensing.gyro_gain + sensing.gyro_bias + sensing.gyro_drift * t
    for share, seconds, channel in sensing.hold:
        begin = share * t[-1]
        held = np.flatnonzero((t >= begin) & (t < begin + seconds))
        if held.size:
            raw[channel][held] = raw[channel][held[0]]
    return raw


def quantum_of(name: str, robot, counts: dict | None = None) -> float:
    """Count of a channel's instrument: the burger's, or `counts` (by stem, in units of the channel's noise)."""
    short = name if name in QUANTA else name.split("_")[0]
    return QUANTA[short] if counts is None else counts[short] * robot.noise(name)


def add_noise(
    raw: dict[str, np.ndarray],
    t: np.ndarray,
    robot,
    rng: np.random.Generator,
    white_w: np.ndarray,
    colour: tuple[float, float] = (0.0, 0.0),
    counts: dict | None = None,
) -> dict[str, np.ndarray]:
    """What instruments report: noise of the declared size (white, or partly coloured) and counts.

    The count's own rounding noise is part of the declared standard deviation.
    """
    out = {}
    for name in CHANNELS:
        sigma = robot.noise(name)
        if sigma is None or (name[-2:] == "_r" and robot.axis is not None):
            continue
        quantum = quantum_of(name, robot, counts)
        own = math.sqrt(max(sigma**2 - quantum**2 / 12, 0.0))
        if name in ("w_l", "w_r"):
            noise = white_w[:, "lr".index(name[-1])]
        else:
            noise = own * coloured(rng.standard_normal(t.size), t, *colour)
        out[name] = np.round((raw[name] + noise) / quantum) * quantum
    return out


def sample_times(
    duration: float, rate: float, jitter: float, dropped: float, rng: np.random.Generator, grid_s: float = 1e-4
) -> np.ndarray:
    """Times of a log's rows, multiples of `grid_s`: uniform, or with jitter (share of the period), some rows lost."""
    n = round(duration * rate)
    t = np.arange(n + 1) / rate
    if jitter > 0:
        t[1:] += rng.uniform(-jitter, jitter, n) / rate
    t = np.round(np.round(t / grid_s) * grid_s, 4)
    if dropped > 0:
        keep = rng.random(t.size) >= dropped
        keep[0] = keep[-1] = True
        t = t[keep]
    return t


def put_ratios(machine: Machine, ratios: dict, robot) -> None:
    """Put a machine's own constants in the place of the file's."""
    for s, label in enumerate("lr"):
        fit = {}
        for name, ratio in ratios[label].items():
            for target in TOLERANCE_NAMES[name]:
                machine.scale(target, ratio, (s,))
            fit[name] = getattr(robot.motor, name) * ratio
        if "torque_constant_nm_per_a" in fit:
            fit["back_emf_constant_v_s_per_rad"] = (
                robot.motor.back_emf_constant_v_s_per_rad * ratios[label]["torque_constant_nm_per_a"]
            )
        machine.tolerance[label] = fit
    axis = robot.axis
    for name, ratio in ratios["whole"].items():
        if axis is None:
            machine.scale({"mass_kg": "mass", "yaw_inertia_kg_m2": "yaw_inertia"}[name], ratio)
            continue
        own = axis.inertia_kg_m2 if name == "inertia_kg_m2" else axis.mass_kg * machine.lever[0]
        weight = 0.0 if name == "inertia_kg_m2" else axis.mass_kg * machine.lever[1]
        for target, value in (("wheel_inertia", own), ("pendulum", weight)):
            machine.world[WORLD_NAMES.index(target)] += value * (ratio - 1.0)


def build_machine(robot, spec: dict, rng: np.random.Generator, effects: bool = True) -> Machine:
    """The physical robot of a spec; `effects` False leaves only its tolerance."""
    machine = nominal_machine(robot)
    if "constants" in spec:
        put_ratios(machine, spec["constants"], robot)
    elif spec["tolerance"]:
        add_tolerance(machine, rng, normal=spec.get("normal_tolerance", False))
    if effects:
        for effect in spec["effects"]:
            apply_effect(machine, effect)
        if spec["outside"]:
            apply_outside(machine, spec["outside"])
        for unmodelled in (spec.get("rest"), *spec.get("forms", ())):
            if unmodelled:
                apply_outside(machine, unmodelled)
    return machine


def control_rows(spec: dict, run: dict) -> int:
    """Rows between two updates of the speed controller: 30 ms, and as much of a run on other machines."""
    return max(1, round(0.03 * spec["rate"] * (run["duration"] / 16.0 if "machine" in spec else 1.0)))


def commands_of(spec: dict, run: dict, t: np.ndarray, rng: np.random.Generator, robot) -> tuple[np.ndarray, np.ndarray]:
    """Commands and references of a planned run, see `scenario`, in the machine's own scales."""
    if "machine" not in spec:
        return scenario(run["name"], t, rng, robot)
    from rtds_host.blind import machines

    return machines.commands(run["name"], t, rng, robot, spec, scenario)


def noises(robot, rounded: dict | None = None) -> dict[str, float]:
    """Noise of each channel that has one; `rounded` holds those that a logger's rounding makes larger."""
    there = [name for name in CHANNELS if name[-2:] not in ("_l", "_r") or name[-1] in robot.sides]
    return {name: robot.noise(name) for name in there if robot.noise(name)} | (rounded or {})


def replay_gap(machine: Machine, robot, run, rounded: dict | None = None) -> dict[str, float]:
    """Gaps by channel of a recorded run (a `RunLog`) replayed by a machine from its commands and first pose.

    `rounded` : see `noises`.
    """
    columns = run.columns
    start = np.array(
        [
            columns[name][0] if name in columns and np.isfinite(columns[name][0]) else 0.0
            for name in ("x", "y", "yaw", "th_l", "th_r")
        ]
    )
    start[3:] /= machine.sensing.speed_gain
    commands = run.commands()
    both = np.column_stack([commands[:, 0], np.zeros(run.t.size)]) if robot.axis is not None else commands.copy()
    # A clock that counts since 1970 resolves a quarter of a microsecond.
    raw = run_machine(
        machine,
        np.round(run.t - run.t[0], 5),
        both,
        start,
        run.meta.payload_kg,
        run.meta.slope_rad,
        run.meta.uphill_yaw_rad,
    )
    return channel_gaps(run.t, columns, raw, noises(robot, rounded))
