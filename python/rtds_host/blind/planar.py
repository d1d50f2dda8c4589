"""The planar world: a fast independent generator of cases with known truth.

``python -m rtds_host.blind.planar --n 40 --tier all --seed 1 --out DIR`` writes ``DIR/public/case-NNN`` (what a
diagnoser may see) and ``DIR/truth/case-NNN.json``.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from rtds_host.blind import kernel
from rtds_host.blind.gap import channel_gaps
from rtds_host.blind.kernel import SIDE_NAMES, WORLD_NAMES
from rtds_host.blind.vocabulary import EFFECTS, OUTSIDE, draw_effect, draw_outside
from rtds_host.contract import RunMeta, builtin_robot_path, load_robot, read_run, write_run

STEP_S = 50e-6
STEPS_S = (STEP_S, 25e-6, 20e-6, 10e-6)      # divisors of the log's grid of times
GRAVITY_M_S2 = kernel.GRAVITY_M_S2
# Time constants and lengths of what is not there: nothing may be divided by 0.
NEUTRAL = {"bus_tau": 1.0, "gust_tau": 1.0, "dahl_rad": 1.0, "grease_tau": 1.0, "bump_length": 1.0, "relax_tau": 1.0}
SCENARIOS = ("coast", "crawl", "steps", "prbs", "spin", "circle", "eight", "linear", "teleop")
CLOSED = ("spin", "circle", "eight", "linear", "teleop")
TIERS = ("all", "tol", "few", "pair", "none", "unknown", "long")
# Drawn only where they are asked for: several causes at once; other machines than the burger, and real loggers.
OTHERS = ("sizes", "loggers")
ACCOUNTS = ("many", "messy", *OTHERS)
KINDS = (*TIERS, *ACCOUNTS)
WORLDS = ("planar", "mujoco")
CONTROLLED_V_S = 258.5 * 6.538e-3      # back-EMF at the gear's output that the controller's gains are meant for
HELD_OUT = 2                  # runs of each sealed case that the diagnoser never sees
SLOW_EFFECTS = ("winding_heating", "battery_decline")
TOLERANCE_NAMES = {"resistance_ohm": ("resistance",), "torque_constant_nm_per_a": ("torque_constant", "back_emf"),
                   "rotor_inertia_kg_m2": ("inertia",), "viscous_friction_nm_s_per_rad": ("viscosity",)}
# Counts of the instruments, as the logs of such robots show them.
QUANTA = {"v_bus": 0.01, "i": 0.00269, "w": 0.001, "th": 2 * math.pi / 4096, "gyro_z": 1e-4, "x": 1e-4, "y": 1e-4,
          "yaw": 1e-4}


@dataclass
class Sensing:
    """Sensor errors that act after the mechanics (contract, section 3, `sensing`), and those outside of it."""

    speed_gain: np.ndarray = field(default_factory=lambda: np.ones(2))
    current_gain: np.ndarray = field(default_factory=lambda: np.ones(2))
    current_bias: np.ndarray = field(default_factory=lambda: np.zeros(2))
    gyro_bias: float = 0.0
    gyro_gain: float = 1.0
    hold: list = field(default_factory=list)          # (share of the run from, seconds, channel)
    clip_speed: float = math.inf
    encoder_wobble: np.ndarray = field(default_factory=lambda: np.zeros(2))
    current_bend: np.ndarray = field(default_factory=lambda: np.zeros(2))      # 1 / A^2: i reported as i / (1 + c i^2)


@dataclass
class Machine:
    """One physical robot: the kernel's parameters and its sensors."""

    side: np.ndarray
    world: np.ndarray
    sensing: Sensing
    slope_extra: float = 0.0
    mass_extra: float = 0.0
    brakes: tuple | None = None                        # (events a run, seconds, torque)
    tolerance: dict = field(default_factory=dict)
    base_step_s: float = STEP_S
    lever: tuple[float, float] = (0.0, 0.0)            # of an axis: inertia and gravity torque a unit of payload

    def set(self, name: str, value, sides=(0, 1)) -> None:
        """Set a kernel parameter by name."""
        if name in WORLD_NAMES:
            self.world[WORLD_NAMES.index(name)] = value
        else:
            for s in sides:
                self.side[SIDE_NAMES.index(name), s] = value

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
    lag = (motor.rotor_inertia_kg_m2 * motor.resistance_ohm
           / (motor.torque_constant_nm_per_a * motor.back_emf_constant_v_s_per_rad))
    return next((step for step in STEPS_S if step <= 0.01 * lag), STEPS_S[-1]) if math.isfinite(lag) else STEP_S


def nominal_axis(robot) -> Machine:
    """A nominal single axis as a machine of this world: a left side whose wheel is the load and has no rim.

    The right side is there as well and stands still.
    """
    motor, axis, torque = robot.motor, robot.axis, robot.driver.mode == "torque"
    machine = Machine(np.zeros((len(SIDE_NAMES), 2)), np.zeros(len(WORLD_NAMES)), Sensing(),
                      base_step_s=step_for(motor))
    lever = {"inertia": (1.0, 0.0), "linear": (axis.metres_per_rad**2, 0.0),
             "pendulum": (axis.length_m**2, GRAVITY_M_S2 * axis.length_m)}[axis.kind]
    load = axis.inertia_kg_m2 + (0.0 if axis.kind == "inertia" else axis.mass_kg * lever[0])
    rotor = motor.gear_ratio**2 * motor.rotor_inertia_kg_m2
    teeth = load * rotor / (load + rotor) / kernel.STOP_REDUCED_KG_M2
    for name, value in {
        "resistance": 1.0 if torque else motor.resistance_ohm, "inductance": 1e-3 if torque else motor.inductance_h,
        "torque_constant": 0.0 if torque else motor.torque_constant_nm_per_a,
        "back_emf": 0.0 if torque else motor.back_emf_constant_v_s_per_rad,
        "torque_per_volt": robot.driver.torque_nm_per_v if torque else 0.0,
        "inertia": motor.rotor_inertia_kg_m2, "viscosity": motor.viscous_friction_nm_s_per_rad,
        "gain": 1.0, "limit": math.inf, "stribeck_speed": 1.0, "voltage": robot.supply_v, "gear": motor.gear_ratio,
        "mass": 1.0, "yaw_inertia": 1.0, "track": 1.0, "wheel_inertia": load, "tyre": 1.0,
        "pendulum": axis.mass_kg * lever[1], "pendulum_zero": axis.zero_rad, **NEUTRAL,
        "stop": kernel.STOP_NM_PER_RAD * teeth, "stop_damping": kernel.STOP_NM_S_PER_RAD * teeth,
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
    lightest = min(chassis.wheel_inertia_kg_m2 / chassis.wheel_radius_m**2, chassis.mass_kg / 2,
                   chassis.yaw_inertia_kg_m2 / (chassis.track_width_m / 2) ** 2)
    heavy = max(1.0, chassis.mass_kg)
    tyre = min(kernel.TYRE_N_PER_M * heavy, 0.1 * lightest / (step / 2) ** 2)
    tyre_damping = min(kernel.TYRE_N_S_PER_M * heavy, 0.8 * lightest / (step / 2))
    wheel = chassis.wheel_inertia_kg_m2
    teeth = wheel * rotor / (wheel + rotor) / kernel.STOP_REDUCED_KG_M2
    machine = Machine(np.zeros((len(SIDE_NAMES), 2)), np.zeros(len(WORLD_NAMES)), Sensing())
    for name, value in {
        "resistance": motor.resistance_ohm, "inductance": motor.inductance_h,
        "torque_constant": motor.torque_constant_nm_per_a, "back_emf": motor.back_emf_constant_v_s_per_rad,
        "inertia": motor.rotor_inertia_kg_m2, "viscosity": motor.viscous_friction_nm_s_per_rad,
        "gain": 1.0, "limit": math.inf, "radius": chassis.wheel_radius_m, "stribeck_speed": 1.0,
        "voltage": robot.supply_v, "gear": motor.gear_ratio, "mass": chassis.mass_kg,
        "yaw_inertia": chassis.yaw_inertia_kg_m2, "track": chassis.track_width_m,
        "wheel_inertia": chassis.wheel_inertia_kg_m2, "tyre": tyre, "tyre_damping": tyre_damping, **NEUTRAL,
        "stop": kernel.STOP_NM_PER_RAD * teeth, "stop_damping": kernel.STOP_NM_S_PER_RAD * teeth,
    }.items():
        machine.set(name, value)
    machine.base_step_s = step
    return machine


def apply_effect(machine: Machine, effect: dict) -> None:
    """Build one effect of the contract's catalogue (its section 3) into a machine."""
    p, sides = effect["parameters"], {"both": (0, 1), "left": (0,), "right": (1,)}[effect["side"]]
    name = effect["id"]
    simple = {
        "supply_sag": (("sag", "resistance_ohm"),), "battery_decline": (("decline", "rate_v_per_s"),),
        "driver_deadzone": (("deadzone", "volts"),), "bridge_drop": (("drop", "volts"),),
        "voltage_limit": (("limit", "volts"),), "pwm_curve": (("curve", "curvature"),),
        "winding_heating": (("heat_per_watt", "rise_per_watt"), ("heat_tau", "time_constant_s")),
        "coulomb_friction": (("coulomb", "torque_nm"),),
        "stribeck_friction": (("coulomb", "torque_nm"), ("stribeck", "extra_torque_nm"),
                              ("stribeck_speed", "speed_rad_s")),
        "viscous_friction": (("viscous", "nm_s_per_rad"),),
        "friction_asymmetry": (("asym_torque", "torque_nm"), ("asym_viscous", "nm_s_per_rad")),
        "load_friction": (("load_friction", "ratio"),), "backlash": (("backlash", "angle_rad"),),
        "gear_compliance": (("stiffness", "stiffness_nm_per_rad"), ("damping", "damping_nm_s_per_rad")),
        "torque_ripple": (("ripple", "amplitude_nm"), ("ripple_cycles", "cycles_per_rev"),
                          ("ripple_phase", "phase_rad")),
        "longitudinal_slip": (("slip", "slip_per_newton"),), "spin_scrub": (("scrub", "torque_nm"),),
        "rolling_resistance": (("rolling", "coefficient"),), "com_offset": (("com_x", "x_m"), ("com_y", "y_m")),
        "speed_filter": (("filter_tau", "time_constant_s"),), "command_delay": (("command_delay", "seconds"),),
        "measurement_delay": (("measurement_delay", "seconds"),),
    }
    ratios = {
        "driver_gain": ("gain",), "resistance_error": ("resistance",),
        "torque_constant_error": ("torque_constant", "back_emf"), "rotor_inertia_error": ("inertia",),
        "wheel_radius_error": ("radius",), "track_width_error": ("track",), "yaw_inertia_error": ("yaw_inertia",),
    }
    if name in ratios:
        for target in ratios[name]:
            machine.scale(target, p["ratio"], sides)
    elif name in simple:
        if name == "longitudinal_slip":       # a tyre that creeps is soft, too
            for target, softer in (("tyre", kernel.SOFT_TYRE), ("tyre_damping", kernel.SOFT_TYRE_DAMPING)):
                machine.side[SIDE_NAMES.index(target), list(sides)] /= softer
        for target, key in simple[name]:
            if target == "coulomb":       # two effects may both bring dry friction
                machine.side[SIDE_NAMES.index(target), list(sides)] += p[key]
            else:
                machine.set(target, p[key], sides)
    elif name == "payload_error":
        machine.mass_extra += next(iter(p.values()))       # kg, or of an inertia kg m2
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
        if key == "hold":
            machine.sensing.hold = [tuple(item) for item in value]
        elif key == "clip_speed":
            machine.sensing.clip_speed = value
        elif key == "encoder_wobble":
            machine.sensing.encoder_wobble[list(sides)] = value
        elif key == "current_bend":
            machine.sensing.current_bend[list(sides)] = value
        elif key == "brakes":
            machine.brakes = tuple(value)
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
                nice = {"torque_constant": "torque_constant_nm_per_a",
                        "back_emf": "back_emf_constant_v_s_per_rad"}.get(target, key)
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


def scenario(name: str, t: np.ndarray, rng: np.random.Generator, robot) -> tuple[np.ndarray, np.ndarray]:
    """Commands (n, 2) in V of an open-loop scenario, or speed references (n, 2) in rad/s of a closed-loop one.

    Returns
    -------
    (v_cmd, w_ref), one of them zero.
    """
    v, w = np.zeros((t.size, 2)), np.zeros((t.size, 2))
    r, b = (robot.chassis.wheel_radius_m, robot.chassis.track_width_m) if robot.chassis else (1.0, 1.0)
    end = t[-1]
    top = 5.6
    if name == "steps":
        levels = np.array([3.0, 4.5, 6.0, 8.0, 10.0, 12.0])
        now = 0.4
        while now < end - 0.5:
            mode = rng.choice(4, p=[0.35, 0.3, 0.2, 0.15])
            a, c = rng.choice(levels, 2) * rng.choice([-1, 1], 2)
            pair = [(a, a), (a, -a), (a, c), (0.0, 0.0)][mode]
            v[t >= now] = pair
            now += rng.uniform(0.6, 2.0)
    elif name == "coast":
        now, on = 0.4, True
        while now < end - 0.5:
            a = rng.uniform(4, 11) * rng.choice([-1, 1])
            pair = [(a, a), (a, -a), (a, a / 2), (a / 2, a)][rng.choice(4, p=[0.5, 0.2, 0.15, 0.15])]
            v[t >= now] = pair if on else (0.0, 0.0)
            on = not on
            now += rng.uniform(0.8, 2.0)
    elif name == "prbs":
        high = rng.uniform(3, 10, 2)
        low = -rng.uniform(3, 10, 2)
        hold = rng.uniform(0.08, 0.16)
        for s in range(2):
            now = 0.4
            while now < end:
                v[t >= now, s] = high[s] if rng.random() < 0.5 else low[s]
                now += hold * rng.integers(1, 5)
        v[t > end - 0.4] = 0.0
    elif name == "crawl":
        peak = rng.uniform(1.0, 2.6)
        period = rng.uniform(4.0, 8.0)
        wave = np.where(t < 0.1, 0, peak * 2 / math.pi * np.arcsin(np.sin(2 * math.pi * (t - 0.1) / period)))
        other = rng.uniform(0.85, 1.0)
        flip = np.where(t > end * rng.uniform(0.4, 0.6), -1.0, 1.0)
        order = rng.permutation(2)
        v[:, order[0]], v[:, order[1]] = wave, wave * other * flip
    elif name == "linear":
        peak = rng.uniform(4.8, 5.6)
        line = _ramp(t, [(0.5, peak), (end - 2.5, 0.0)], rng.uniform(3, 6))
        w[:] = line[:, None]
    elif name == "circle":
        peak, radius = rng.uniform(4.8, 5.6), 0.5
        ratio = (radius - b / 2) / (radius + b / 2)
        line = _ramp(t, [(0.5, peak), (end - 2.5, 0.0)], rng.uniform(3, 6))
        order = rng.permutation(2)
        w[:, order[0]], w[:, order[1]] = line, line * ratio
    elif name == "eight":
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
    elif name == "spin":
        knots, now = [], 0.4
        while now < end - 1.5:
            knots.append((now, float(rng.choice([-1, 1]) * rng.uniform(0.5, 4.8))))
            now += rng.uniform(1.0, 2.5)
        line = _ramp(t, [*knots, (end - 1.2, 0.0)], rng.uniform(5, 15))
        w[:, 0], w[:, 1] = -line, line
    elif name == "teleop":
        ahead, around, now = [], [], 0.4
        while now < end - 1.5:
            if rng.random() < 0.2:
                ahead.append((now, 0.0))
                around.append((now, 0.0))
            else:
                ahead.append((now, float(rng.uniform(-0.6, 1.0) * top * 0.8)))
                around.append((now, float(rng.choice([0.0, rng.uniform(-0.45, 0.45) * top]))))
            now += rng.uniform(0.8, 2.5)
        rate = rng.uniform(4, 12)
        line, turn = _ramp(t, [*ahead, (end - 1.0, 0.0)], rate), _ramp(t, [*around, (end - 1.0, 0.0)], rate)
        w[:, 0], w[:, 1] = np.clip(line - turn, -top, top), np.clip(line + turn, -top, top)
    else:
        raise ValueError(f"scenario {name!r} is not in the planar world")
    return np.round(v, 3), w


def _colour(white: np.ndarray, t: np.ndarray, tau: float, share: float) -> np.ndarray:
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


def run_machine(machine: Machine, t: np.ndarray, v_cmd: np.ndarray, start: np.ndarray, payload_kg: float,
                slope_rad: float, uphill: float, closed: bool = False, w_ref: np.ndarray | None = None,
                noise_w: np.ndarray | None = None, robot=None, period_rows: int = 3, seed: int = 0,
                step_s: float | None = None, world: str = "planar") -> dict[str, np.ndarray]:
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
        events = np.column_stack([begin, begin + rng.uniform(0.5, 1.5, begin.size) * seconds,
                                  rng.integers(0, 2, begin.size), torque * rng.uniform(0.6, 1.4, begin.size)])
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
        gains[:4] = (ke + motor.resistance_ohm * drag / kt, 0.35 * ke / CONTROLLED_V_S, 1.2 * ke / CONTROLLED_V_S,
                     robot.supply_v)
    rest = (closed, w_ref, noise_w, period_rows, gains, events, seed % (2**31))
    if world == "mujoco":
        from rtds_host.blind import world as second

        out = second.simulate(t, v_cmd, machine.side, place, start, *rest)
    else:
        out = kernel.simulate(t, v_cmd, machine.side, place, start, step_s or machine.step_s, *rest)
    return apply_sensors({name: out[:, k].copy() for k, name in enumerate(CHANNELS)}, machine, t)


def apply_sensors(raw: dict[str, np.ndarray], machine: Machine, t: np.ndarray) -> dict[str, np.ndarray]:
    """Gains, biases and faults of a machine's instruments; `raw` (channel -> (n,)) is changed and returned."""
    sensing = machine.sensing
    for s, label in enumerate("lr"):
        wobble = sensing.encoder_wobble[s]
        if wobble:
            angle = raw[f"th_{label}"]
            raw[f"w_{label}"] *= 1 + wobble * np.cos(angle)
            raw[f"th_{label}"] = angle + wobble * np.sin(angle)
        raw[f"w_{label}"] = np.clip(raw[f"w_{label}"] * sensing.speed_gain[s], -sensing.clip_speed,
                                    sensing.clip_speed)
        raw[f"th_{label}"] = raw[f"th_{label}"] * sensing.speed_gain[s]
        raw[f"i_{label}"] = raw[f"i_{label}"] / (1.0 + sensing.current_bend[s] * raw[f"i_{label}"] ** 2)
        raw[f"i_{label}"] = raw[f"i_{label}"] * sensing.current_gain[s] + sensing.current_bias[s]
    raw["gyro_z"] = raw["gyro_z"] * sensing.gyro_gain + sensing.gyro_bias
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


def add_noise(raw: dict[str, np.ndarray], t: np.ndarray, robot, rng: np.random.Generator, white_w: np.ndarray,
              colour: tuple[float, float] = (0.0, 0.0), counts: dict | None = None) -> dict[str, np.ndarray]:
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
            noise = own * _colour(rng.standard_normal(t.size), t, *colour)
        out[name] = np.round((raw[name] + noise) / quantum) * quantum
    return out


def sample_times(duration: float, rate: float, jitter: float, dropped: float, rng: np.random.Generator,
                 grid_s: float = 1e-4) -> np.ndarray:
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


def draw_spec(rng: np.random.Generator, tier: str, world: str = "planar", robot=None) -> dict:
    """What happens in a case of a tier: effects, tolerance, channels, rates, runs, and runs held out of the case.

    `robot` (default the burger) gives the sizes of the kinds with several causes their scale.
    """
    spec = {"tier": tier, "world": world, "effects": [], "outside": None, "rest": None,
            "tolerance": tier in ("tol", "long", *ACCOUNTS), "normal_tolerance": tier in ACCOUNTS, "colour": (0.0, 0.0),
            "rate": float(rng.choice([100.0, 200.0])), "jitter": 0.0, "dropped": 0.0, "missing": [], "slow": {},
            "form": "parquet"}
    if tier in ("all", "tol", "few"):
        spec["effects"] = [draw_effect(rng)]
    elif tier == "pair":
        first = draw_effect(rng)
        second = draw_effect(rng)
        while second["id"] == first["id"]:
            second = draw_effect(rng)
        spec["effects"] = [first, second]
    elif tier == "long":
        slow = str(rng.choice(SLOW_EFFECTS)) if rng.random() < 0.5 else None
        spec["effects"] = [draw_effect(rng, slow)]
    elif tier == "unknown":
        spec["outside"] = draw_outside(rng, world=world)
    elif tier not in ("none", *ACCOUNTS):
        raise ValueError(f"tier {tier!r} is not one of {', '.join(KINDS)}")
    if tier in ("pair", "none", "unknown", "few"):
        spec["tolerance"] = bool(rng.random() < 0.5)
    if rng.random() < 0.35:
        spec["jitter"] = 0.4
    if rng.random() < 0.1:
        spec["dropped"] = float(rng.uniform(0.005, 0.03))
    if rng.random() < (0.5 if tier in ACCOUNTS else 0.15):
        spec["colour"] = (float(rng.uniform(0.01, 0.05)), float(rng.uniform(0.1, 0.4)))
    if rng.random() < 0.2:
        spec["slow"] = {"x": 50, "y": 50, "yaw": 50} if rng.random() < 0.6 else {"gyro_z": 50, "v_bus": 10}
    if tier == "few":
        menus = [["v_bus", "i", "th", "gyro_z", "pose"], ["v_bus", "th", "gyro_z", "pose"], ["v_bus", "pose"],
                 ["pose"], ["i", "v_bus"], ["v_bus", "i", "pose"], ["w", "i", "v_bus"], ["w", "v_bus"],
                 ["gyro_z", "pose"], ["gyro_z"], ["th", "v_bus", "i", "gyro_z"]]
        spec["missing"] = menus[rng.integers(len(menus))]
        # An effect that only changes channels that are not there would be no case at all.
        gone = set(spec["missing"])
        for _ in range(200):
            effect = spec["effects"][0]["id"]
            lost = ((effect.startswith("gyro") and "gyro_z" in gone) or (effect.startswith("current") and "i" in gone)
                    or (effect == "speed_filter" and "w" in gone))
            if not lost:
                break
            spec["effects"] = [draw_effect(rng)]
    if rng.random() < 0.1:
        spec["form"] = "csv"
    if tier in OTHERS:
        from rtds_host.blind import accounts, machines

        machines.draw_conditions(rng, spec, tier == "loggers")
        spec["effects"], _ = accounts.draw_causes(rng, machines.robot_of(spec["robot"]), spec)
        return spec
    count = int(rng.choice([3, 4, 5, 5, 6, 6, 7]))
    names = list(rng.permutation(SCENARIOS))[:count]
    if not set(names) & {"steps", "prbs", "coast"}:
        names[0] = str(rng.choice(["steps", "prbs", "coast"]))
    payload = rng.permutation(np.arange(count) % 2) * 2.0
    slope = rng.permutation(np.arange(count) % 2) * 0.1
    runs = []
    for k, name in enumerate(names):
        uphill = float(rng.choice([0.0, math.pi / 2, rng.uniform(-math.pi, math.pi)]))
        low, high = {"prbs": (10, 13), "spin": (12, 18), "crawl": (14, 18), "steps": (14, 18)}.get(name, (16, 24))
        runs.append({"name": str(name), "payload_kg": float(payload[k]), "slope_rad": float(slope[k]),
                     "uphill_yaw_rad": round(uphill, 4), "duration": round(float(rng.uniform(low, high)), 1)})
    if tier == "long":
        runs = runs[:3]
        for run in runs:
            run["duration"] = round(float(rng.uniform(60, 90)), 1)
    spec["runs"] = sorted(runs, key=lambda run: run["name"])
    spec["held_out"] = []
    for k, name in enumerate(rng.permutation(["teleop", "steps", "coast", "spin", "eight", "prbs"])[:HELD_OUT]):
        spec["held_out"].append({
            "name": str(name), "payload_kg": float(k % 2) * 2.0, "slope_rad": float(rng.integers(2)) * 0.1,
            "uphill_yaw_rad": round(float(rng.uniform(-math.pi, math.pi)), 4),
            "duration": round(float(rng.uniform(40, 60) if tier == "long" else rng.uniform(12, 18)), 1)})
    if tier in ACCOUNTS:
        from rtds_host.blind.accounts import draw_causes

        spec["effects"], spec["rest"] = draw_causes(rng, robot or load_robot(builtin_robot_path("burger")), spec)
    return spec


def build_machine(robot, spec: dict, rng: np.random.Generator, effects: bool = True) -> Machine:
    """The physical robot of a spec; `effects` False leaves only its tolerance."""
    machine = nominal_machine(robot)
    if spec["tolerance"]:
        add_tolerance(machine, rng, normal=spec.get("normal_tolerance", False))
    if effects:
        for effect in spec["effects"]:
            apply_effect(machine, effect)
        if spec["outside"]:
            apply_outside(machine, spec["outside"])
        if spec.get("rest"):
            apply_outside(machine, spec["rest"])
    return machine


def make_case(seed: int, spec: dict | str, folder: Path, robot_path: Path | None = None, sizes: bool = True,
              held_out: Path | None = None) -> dict:
    """Write one case folder and return its truth.

    Parameters
    ----------
    seed : everything that is random follows from it.
    spec : a tier's name, or a dictionary as `draw_spec` returns it.
    folder : the public folder to write; gets nothing that tells the truth.
    robot_path : nominal robot, default the burger.
    sizes : compute `size_gap` and `size_sigma` (eight more replays).
    held_out : folder for the runs that the case does not show; none are made without it.

    Returns
    -------
    dict, schema "rtds-truth/1" plus `tier`, `size_gap` (root mean square change of the replayed channels through the
    effects, in noise units) and `size_sigma` (root of the summed squares of that change, after the part that the
    motors' R, K, J and B can imitate within 1 % is projected off).
    """
    rng = np.random.default_rng(seed)
    if isinstance(spec, str):
        spec = draw_spec(rng, spec)
    robot_path = Path(robot_path or builtin_robot_path("burger"))
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    if "robot" in spec:
        (folder / "robot.toml").write_text(spec["robot"])
    else:
        shutil.copyfile(robot_path, folder / "robot.toml")
    robot = load_robot(folder / "robot.toml")
    logger, counts = spec.get("logger"), spec.get("counts")
    rounding: dict[str, list[float]] = {}
    scatter = int(rng.integers(2**31))
    machine = build_machine(robot, spec, np.random.default_rng(scatter))
    plain = build_machine(robot, spec, np.random.default_rng(scatter), effects=False)
    changes, slopes = [], []
    drives: dict[bool, list] = {False: [], True: []}      # by: held out
    planned = [(run, folder) for run in spec["runs"]]
    if held_out is not None:
        planned += [(run, Path(held_out)) for run in spec["held_out"]]
    for run, place in planned:
        seed_run = int(rng.integers(2**31))
        t = sample_times(run["duration"], spec["rate"], spec["jitter"], spec["dropped"], rng,
                         2e-4 if spec["world"] == "mujoco" else 1e-4)
        v_cmd, w_ref = commands_of(spec, run, t, rng, robot)
        closed = run["name"] in CLOSED
        heading = float(rng.choice([0.0, run["uphill_yaw_rad"], rng.uniform(-math.pi, math.pi)]))
        start = np.array([*rng.uniform(-1, 1, 2), heading, *rng.uniform(-20, 20, 2)])
        # Whoever replays a log without a pose or an angle starts from zero (contract, section 1).
        if "pose" in spec["missing"]:
            start[:3] = 0.0
        if "th" in spec["missing"]:
            start[3:] = 0.0
        if robot.axis is not None and "th" not in spec["missing"]:
            start = np.array([0.0, 0.0, 0.0, robot.axis.zero_rad + rng.uniform(-0.5, 0.5), robot.axis.zero_rad])
        own = math.sqrt(max(robot.noise("w_l") ** 2 - quantum_of("w_l", robot, counts) ** 2 / 12, 0))
        white_w = own * np.column_stack([_colour(rng.standard_normal(t.size), t, *spec["colour"]) for _ in range(2)])
        where = place_of(run)
        raw = run_machine(machine, t, v_cmd, start, closed=closed, w_ref=w_ref, noise_w=white_w, robot=robot,
                          period_rows=control_rows(spec, run), seed=seed_run, **where, world=spec["world"])
        measured = add_noise(raw, t, robot, rng, white_w, spec["colour"], counts)
        if closed:
            for s, label in enumerate("lr"):
                measured[f"w_ref_{label}"] = np.round(w_ref[:, s], 4)
        columns = {"t": t} | {f"v_cmd_{label}": v_cmd[:, s] for s, label in enumerate(robot.sides)}
        for name, values in measured.items():
            if stem(name) in spec["missing"]:
                continue
            slow = spec["slow"].get(name)
            if slow:
                every = max(1, round(spec["rate"] / slow))
                values = np.where(np.arange(t.size) % every == 0, values, np.nan)
            columns[name] = np.round(values, 6 if counts is None else 9)
        if logger is not None:
            columns = _logged(columns, logger, robot, rng, place == folder, rounding)
        meta = RunMeta(scenario=run["name"], payload_kg=run["payload_kg"], slope_rad=run["slope_rad"],
                       uphill_yaw_rad=run["uphill_yaw_rad"])
        write_run(place / run["name"], meta, columns, spec["form"])
        drives[place != folder].append((t, v_cmd, start, where, seed_run))
        if sizes and place == folder and (spec["effects"] or spec["outside"]):
            if spec["world"] != "planar":      # both sides of the difference come from one world
                raw = run_machine(machine, t, v_cmd, start, seed=seed_run, **where)
            a, b = _signature(machine, plain, robot, t, v_cmd, start, where, columns, seed_run, raw)
            changes.append(a)
            slopes.append(b)
    truth = {"schema": "rtds-truth/1", "tier": spec["tier"], "world": spec["world"],
             "verdict": "unknown" if spec["outside"] else ("known" if spec["effects"] else "none"),
             "effects": spec["effects"]}
    if machine.tolerance:
        absent = () if robot.driver.mode != "torque" else ("resistance_ohm", "torque_constant_nm_per_a",
                                                           "back_emf_constant_v_s_per_rad")
        truth["nominal_fit"] = {label: {key: value for key, value in machine.tolerance[label].items() if key not in absent}
                                for label in robot.sides}
    if spec["outside"]:
        truth["outside"] = spec["outside"]
    if changes:
        change, slope = np.concatenate(changes), np.concatenate(slopes)
        truth["size_gap"] = round(float(np.sqrt(np.mean(change**2))), 4)
        gram = slope.T @ slope + np.eye(slope.shape[1])
        seen = slope.T @ change
        truth["size_sigma"] = round(float(np.sqrt(max(change @ change - seen @ np.linalg.solve(gram, seen), 0))), 3)
    if rounding:
        truth["noise"] = {name: float(f"{math.hypot(robot.noise(name), math.sqrt(np.mean(squares))):.6g}")
                          for name, squares in rounding.items()}
    if sizes and spec["effects"]:
        truth.update(_account(robot, spec, scatter, drives, truth.get("noise")))
        if logger is not None and held_out is not None:       # late stamps are no effect: the truth itself leaves a gap
            truth["held_out_gap"] |= {"known": _left(machine, robot, held_out, truth["noise"]),
                                      "before": _left(nominal_machine(robot), robot, held_out, truth["noise"])}
    if "machine" in spec:
        truth["machine"] = spec["machine"]
        truth["logger"] = None if logger is None else asdict(logger)
    truth["conditions"] = {key: spec[key] for key in ("rate", "jitter", "dropped", "missing", "slow", "colour")}
    return truth


def _left(machine: Machine, robot, held_out: Path, rounded: dict) -> float:
    """Gap that a machine leaves on the held-out runs as they were logged, pooled over channels and runs."""
    gaps: dict[str, list[float]] = {}
    for folder in sorted(p for p in Path(held_out).iterdir() if p.is_dir()):
        for name, value in replay_gap(machine, robot, read_run(folder, robot), rounded).items():
            gaps.setdefault(name, []).append(value**2)
    return round(math.sqrt(np.mean([np.mean(values) for values in gaps.values()])), 4)


def control_rows(spec: dict, run: dict) -> int:
    """Rows between two updates of the speed controller: 30 ms, and as much of a run on other machines."""
    return max(1, round(0.03 * spec["rate"] * (run["duration"] / 16.0 if "machine" in spec else 1.0)))


def commands_of(spec: dict, run: dict, t: np.ndarray, rng: np.random.Generator, robot) -> tuple[np.ndarray, np.ndarray]:
    """Commands and references of a planned run, see `scenario`, in the machine's own scales."""
    if "machine" not in spec:
        return scenario(run["name"], t, rng, robot)
    from rtds_host.blind import machines

    return machines.commands(run["name"], t, rng, robot, spec, scenario)


def _logged(columns: dict[str, np.ndarray], logger, robot, rng: np.random.Generator, shown: bool,
            rounding: dict[str, list[float]]) -> dict[str, np.ndarray]:
    """What a logger writes of exact columns; adds each channel's mean squared rounding error to `rounding`.

    Glitches are in the runs that are shown only: what cannot be counted says nothing about a prediction.
    """
    t = columns["t"]
    out = {"t": t + logger.epoch_s}
    if logger.stamp_s:
        late = np.round(rng.normal(0.0, logger.stamp_s, t.size), 4)
        late[0] = 0.0
        # Rows stay in order, 0.1 ms apart at least.
        steps = 1e-4 * np.arange(t.size)
        out["t"] = np.round(np.maximum.accumulate(out["t"] + late - steps) + steps, 4)
    for name, values in columns.items():
        if name == "t":
            continue
        out[name] = logger.rounded(name, values)
        if robot.noise(name):
            rounding.setdefault(name, []).append(float(np.nanmean((out[name] - values) ** 2)))
    keep = np.ones(t.size, bool)
    if logger.hole_rows and t.size > 10 * logger.hole_rows:
        at = int(rng.integers(t.size // 4, 3 * t.size // 4))
        keep[at:at + logger.hole_rows] = False
    if shown:
        names = [name for name in out if name[0] in "iw" or name.startswith(("gyro", "th"))]
        for _ in range(logger.glitches):
            name, row = str(rng.choice(names)), int(rng.integers(t.size // 8, t.size - 2))
            out[name] = out[name].copy()
            out[name][row] += float(rng.choice([-1, 1]) * rng.uniform(2, 10)) * (np.nanmax(np.abs(out[name])) + 1e-9)
    if not keep.all():        # the command of the lost rows acts all the same: a log that loses none of its changes
        changed = np.any([np.diff(values, prepend=values[0]) != 0 for name, values in out.items()
                          if name.startswith("v_cmd")], axis=0)
        keep |= changed
    out = {name: values[keep] for name, values in out.items()}
    return out


def _account(robot, spec: dict, scatter: int, drives: dict[bool, list], noise: dict | None = None) -> dict:
    """What each cause of a case is worth, on its own runs and on those held out (`accounts.worth`).

    Returns
    -------
    {"effects" with `gap_without`, "gap": {"before", "refit", "known"}, "held_out_gap": the same, "rest"}: gaps of the
    nominal robot, of one with the right tolerances, and of one with all named effects. `rest` holds the subsystem, the
    gap without it, and the share of the gap that is left where everything with a name is known.
    """
    from rtds_host.blind.accounts import Drive, worth

    def build(effects, rest, tolerance):
        return build_machine(robot, {**spec, "effects": effects, "rest": rest, "tolerance": tolerance},
                             np.random.default_rng(scatter))

    out = {}
    for held, name in ((False, "gap"), (True, "held_out_gap")):
        if not drives[held]:
            continue
        gaps = worth(noises(robot, noise), build, spec["effects"], spec.get("rest"),
                     [Drive(*drive) for drive in drives[held]], set(spec["missing"]))
        out[name] = {key: round(gaps[key], 4) for key in ("before", "refit", "known")}
        if not held:
            out["effects"] = [{**effect, "gap_without": round(gap, 3)} for effect, gap in zip(spec["effects"], gaps["without"])]
            if spec.get("rest"):
                known, before = gaps["known"], gaps["before"]
                out["rest"] = {**spec["rest"], "gap_without": round(known, 3),
                               "share": round(max(known - 1, 0) / max(before - 1, 1e-9), 4)}
    return out


def _signature(machine, plain, robot, t, v_cmd, start, where, columns, seed, raw):
    """Change of a run's channels through the effects and through 1 % of each nuisance, in noise units.

    Returns
    -------
    (m,), (m, 8); every tenth row, weighted so that sums stand for all rows.
    """
    coarse = {"seed": seed, "step_s": 200e-6 if machine.base_step_s == STEP_S and robot.axis is None
              and robot.chassis.mass_kg < 3.0 else machine.base_step_s}
    exact = run_machine(plain, t, v_cmd, start, **where, seed=seed, step_s=machine.step_s)
    base = run_machine(plain, t, v_cmd, start, **where, **coarse)
    rows = slice(0, None, 10)

    def vector(other: dict, base: dict) -> np.ndarray:
        parts = []
        for name in ("i_l", "i_r", "w_l", "w_r", "gyro_z", "x", "y", "yaw"):
            if name not in columns:
                if name[:2] == "w_" and f"th_{name[-1]}" in columns:
                    name = f"th_{name[-1]}"
                else:
                    continue
            difference = other[name] - base[name]
            weight = math.sqrt(10.0)
            if name in ("x", "y", "yaw", "th_l", "th_r"):     # moves in windows of 1 s, one of them a second
                step = round(1.0 / float(np.median(np.diff(t))))
                difference = difference[step:] - difference[:-step]
                difference = difference / math.sqrt(2.0)
                weight = math.sqrt(10.0 / step)
            parts.append(weight * difference[rows] / robot.noise(name))
        return np.concatenate(parts)

    change = vector(raw, exact)
    columns_out = []
    for s in range(2):
        for targets in TOLERANCE_NAMES.values():
            side = plain.side.copy()
            for target in targets:
                side[SIDE_NAMES.index(target), s] *= 1.01
            moved = Machine(side, plain.world, plain.sensing, base_step_s=plain.base_step_s, lever=plain.lever)
            columns_out.append(vector(run_machine(moved, t, v_cmd, start, **where, **coarse), base))
    return change, np.column_stack(columns_out)


def noises(robot, rounded: dict | None = None) -> dict[str, float]:
    """Noise of each channel that has one; `rounded` holds those that a logger's rounding makes larger."""
    there = [name for name in CHANNELS if name[-2:] not in ("_l", "_r") or name[-1] in robot.sides]
    return {name: robot.noise(name) for name in there if robot.noise(name)} | (rounded or {})


def replay_gap(machine: Machine, robot, run, rounded: dict | None = None) -> dict[str, float]:
    """Gaps by channel of a recorded run (a `RunLog`) replayed by a machine from its commands and first pose.

    `rounded` : see `noises`.
    """
    columns = run.columns
    start = np.array([columns[name][0] if name in columns and np.isfinite(columns[name][0]) else 0.0
                      for name in ("x", "y", "yaw", "th_l", "th_r")])
    start[3:] /= machine.sensing.speed_gain
    commands = run.commands()
    both = np.column_stack([commands[:, 0], np.zeros(run.t.size)]) if robot.axis is not None else commands.copy()
    # A clock that counts since 1970 resolves a quarter of a microsecond.
    raw = run_machine(machine, np.round(run.t - run.t[0], 5), both, start, run.meta.payload_kg, run.meta.slope_rad,
                      run.meta.uphill_yaw_rad)
    return channel_gaps(run.t, columns, raw, noises(robot, rounded))


def main(argv: list[str] | None = None) -> None:
    """Write many cases: ``--n``, ``--tier``, ``--seed``, ``--out``, optionally ``--effect`` and ``--no-sizes``."""
    parser = argparse.ArgumentParser(prog="rtds_host.blind.planar", description=__doc__)
    parser.add_argument("--n", type=int, default=10, help="number of cases")
    parser.add_argument("--tier", choices=KINDS, default="all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--effect", choices=sorted(EFFECTS) + sorted(OUTSIDE), help="always this effect")
    parser.add_argument("--world", choices=WORLDS, default="planar")
    parser.add_argument("--no-sizes", action="store_true", help="do not compute the effects' sizes")
    args = parser.parse_args(argv)
    (args.out / "truth").mkdir(parents=True, exist_ok=True)
    for k in range(args.n):
        rng = np.random.default_rng([args.seed, k, KINDS.index(args.tier)])
        spec = draw_spec(rng, args.tier, args.world)
        if args.effect in OUTSIDE:
            spec["effects"], spec["outside"] = [], draw_outside(rng, args.effect, args.world)
        elif args.effect:
            spec["effects"], spec["outside"] = [draw_effect(rng, args.effect)], None
        name = f"case-{k:03d}"
        truth = make_case(int(rng.integers(2**31)), spec, args.out / "public" / name, sizes=not args.no_sizes)
        (args.out / "truth" / f"{name}.json").write_text(json.dumps(truth, indent=1) + "\n")
        what = ", ".join(f"{e['id']} {e['side']}" for e in truth["effects"]) or truth["verdict"]
        print(f"{name}: {what}  size {truth.get('size_sigma', 0):g} sigma, gap {truth.get('size_gap', 0):g}", flush=True)


if __name__ == "__main__":
    main()
