"""Machines of other sizes than the burger, and what loggers make of their signals.

A machine is drawn as people describe theirs (mass, wheel, track, top speed, acceleration at stall, supply), and the
motor's values follow from it, so that every draw is a machine that could be built: micromouse, small desk robot, robot
of the TurtleBot's class, competition robot, and single axes (inertia, pendulum, linear; by voltage or by torque).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rtds_host.blind.scales import GRAVITY_M_S2, Scale, scale_of
from rtds_host.blind.vocabulary import EFFECTS, log_uniform
from rtds_host.cleanup import temporary_folder
from rtds_host.contract import load_robot

# Ranges of robots: kg, wheel radius m, track m, gear, supply V, top speed m/s, acceleration at stall m/s2, rotors'
# share of the inertia that the motors move (as mass at the rim over half of the robot's), rate of the log Hz, run s.
ROBOTS = {
    "micromouse": (
        (0.08, 0.14),
        (0.0115, 0.0135),
        (0.060, 0.080),
        (3, 10),
        (7.4, 8.4),
        (2.5, 5.0),
        (30, 80),
        (0.2, 1.0),
        (1000,),
        (0.3, 0.95),
    ),
    "desk": (
        (0.2, 0.8),
        (0.016, 0.036),
        (0.085, 0.15),
        (30, 120),
        (6.0, 9.0),
        (0.4, 1.0),
        (8, 20),
        (1.0, 6.0),
        (50, 100),
        (1.5, 8.0),
    ),
    "turtlebot": (
        (0.9, 1.8),
        (0.033, 0.035),
        (0.16, 0.29),
        (200, 300),
        (11.1, 12.0),
        (0.2, 0.3),
        (80, 200),
        (8, 14),
        (20, 50, 100),
        (6.0, 18.0),
    ),
    "competition": (
        (40, 60),
        (0.05, 0.0765),
        (0.5, 0.7),
        (8, 11),
        (12.0, 12.6),
        (3.5, 5.5),
        (20, 35),
        (0.05, 0.2),
        (50,),
        (1.5, 6.0),
    ),
}
AXES = ("inertia", "pendulum", "linear")
CLASSES = (*ROBOTS, *AXES)
VIRTUAL_S = 16.0  # length of the burger's run that a run of another machine is drawn after
NO_AXIS = ("wheel_ground", "chassis")
NO_TORQUE = (
    "supply_sag",
    "battery_decline",
    "bridge_drop",
    "pwm_curve",
    "resistance_error",
    "winding_heating",
    "torque_constant_error",
    "current_gain",
    "current_bias",
)
SCENARIOS = ("steps", "coast", "prbs", "crawl", "linear", "circle", "spin", "teleop")
AXIS_SCENARIOS = ("steps", "coast", "prbs", "crawl")


@dataclass(frozen=True)
class Logger:
    """What a logger does to what it is given; see `draw_logger`."""

    decimals: int | None = None  # fixed decimals of every value
    digits: int | None = None  # significant digits of currents, speeds and voltages
    stamp_s: float = 0.0  # standard deviation of a row's time stamp
    epoch_s: float = 0.0  # time of a run's first row
    glitches: int = 0  # samples a run that are nonsense
    hole_rows: int = 0  # rows lost in a row, once a run

    def rounded(self, channel: str, values: np.ndarray) -> np.ndarray:
        """Values as the log shows them."""
        if self.digits is not None and channel[0] in "iwv":
            size = np.where(values == 0, 1.0, np.abs(values))
            step = 10.0 ** (np.floor(np.log10(size)) - self.digits + 1)
            return np.round(values / step) * step
        return values if self.decimals is None else np.round(values, self.decimals)


def draw_logger(rng: np.random.Generator, rate: float) -> Logger:
    """A logger with two or three of the habits of real ones."""
    rounding = rng.choice(["decimals", "digits", "none"], p=[0.4, 0.35, 0.25])
    stamp = min(log_uniform(rng, 0.0005, 0.004), 0.2 / rate)
    return Logger(
        decimals=int(rng.choice([2, 3], p=[0.7, 0.3])) if rounding == "decimals" else None,
        digits=3 if rounding == "digits" else None,
        stamp_s=float(stamp) if rng.random() < 0.4 else 0.0,
        epoch_s=float(1.6e9 + round(float(rng.uniform(0, 1.5e8)), 3)) if rng.random() < 0.35 else 0.0,
        glitches=int(rng.integers(1, 4)) if rng.random() < 0.35 else 0,
        hole_rows=int(rng.integers(2, 8)) if rng.random() < 0.3 else 0,
    )


def robot_toml(name: str, tables: dict[str, dict]) -> str:
    lines = ['schema = "rtds-robot/1"', f'name = "{name}"']
    for table, values in tables.items():
        lines += ["", f"[{table}]"]
        lines += [
            f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {float(f'{value:.4g}')!r}"
            for key, value in values.items()
        ]
    return "\n".join(lines) + "\n"


def _motor(rng, gear: float, volts: float, torque: float, speed: float, rotor: float) -> dict:
    """Values at the shaft of a motor with a stall torque and a no-load speed at the gear's output (N m, rad/s) and a
    rotor's inertia seen from there (kg m2)."""
    km = volts / (gear * speed)
    amps = torque / (gear * km)
    ohm = volts / amps
    idle = log_uniform(rng, 0.015, 0.07)  # no-load current over stall current
    return {
        "resistance_ohm": ohm,
        "inductance_h": ohm * log_uniform(rng, 0.8e-4, 3e-4),
        "torque_constant_nm_per_a": km,
        "back_emf_constant_v_s_per_rad": km,
        "rotor_inertia_kg_m2": rotor / gear**2,
        "viscous_friction_nm_s_per_rad": idle * km * amps / (gear * speed),
        "gear_ratio": gear,
    }


def draw_machine(rng: np.random.Generator, name: str) -> str:
    """`robot.toml` of a machine of a class (`CLASSES`)."""
    return _draw_robot(rng, name) if name in ROBOTS else _draw_axis(rng, name)


def _sensors(rng, amps: float, speed: float, volts: float) -> dict:
    return {
        "i_a": amps * log_uniform(rng, 0.002, 0.006),
        "w_rad_s": speed * log_uniform(rng, 0.0015, 0.005),
        "th_rad": log_uniform(rng, 4e-4, 2e-3),
        "v_bus_v": volts * log_uniform(rng, 0.001, 0.004),
    }


def _draw_robot(rng: np.random.Generator, name: str) -> str:
    mass, radius, track, gear, volts, top, stall, share = (log_uniform(rng, *limits) for limits in ROBOTS[name][:8])
    torque, speed = stall * mass * radius / 2, top / radius
    motor = _motor(rng, gear, volts, torque, speed, share * mass / 2 * radius**2)
    sensors = _sensors(rng, volts / motor["resistance_ohm"], speed, volts)
    turn = 2 * top / track  # a gyro that measures fast turns is no fine one
    sensors |= {
        "gyro_rad_s": max(log_uniform(rng, 0.002, 0.01), 5e-4 * turn),
        "xy_m": log_uniform(rng, 0.0008, 0.002),
        "yaw_rad": max(log_uniform(rng, 0.001, 0.003), 5e-5 * turn),
    }
    chassis = {
        "mass_kg": mass,
        "yaw_inertia_kg_m2": mass * track**2 * log_uniform(rng, 0.08, 0.15),
        "wheel_radius_m": radius,
        "wheel_inertia_kg_m2": 0.5 * mass * log_uniform(rng, 0.02, 0.05) * radius**2,
        "track_width_m": track,
        "com_z_m": radius,
    }
    return robot_toml(name, {"motor": motor, "supply": {"voltage_v": volts}, "chassis": chassis, "sensors": sensors})


def _draw_axis(rng: np.random.Generator, name: str) -> str:
    volts, speed, gear = log_uniform(rng, 5, 48), log_uniform(rng, 5, 120), log_uniform(rng, 1, 200)
    torque, lag = log_uniform(rng, 0.03, 30), log_uniform(rng, 0.02, 0.2)  # lag: the mechanical time constant
    inertia = lag * torque / speed
    part = rng.uniform(0.25, 0.75)  # the load's of it
    axis: dict[str, Any] = {"kind": name}
    if name == "inertia":
        axis["inertia_kg_m2"] = part * inertia
    elif name == "pendulum":
        weight = torque * log_uniform(rng, 0.05, 0.3)  # m g l
        axis["length_m"] = part * inertia * GRAVITY_M_S2 / weight  # so that m l2 is the load's part
        axis["length_m"] = min(max(axis["length_m"], 0.03), 0.6)
        axis["mass_kg"] = weight / (GRAVITY_M_S2 * axis["length_m"])
    else:
        axis["metres_per_rad"] = log_uniform(rng, 0.002, 0.02)
        axis["mass_kg"] = part * inertia / axis["metres_per_rad"] ** 2
    motor = _motor(rng, gear, volts, torque, speed, (1 - part) * inertia)
    tables = {"motor": motor, "supply": {"voltage_v": volts}, "axis": axis}
    sensors = _sensors(rng, volts / motor["resistance_ohm"], speed, volts)
    if rng.random() < 0.35:
        tables["driver"] = {"mode": "torque", "torque_nm_per_v": torque / gear / volts}
        tables["motor"] = {
            "rotor_inertia_kg_m2": motor["rotor_inertia_kg_m2"],
            "gear_ratio": gear,
            "viscous_friction_nm_s_per_rad": torque / speed / gear**2 * rng.uniform(0.5, 1.0),
        }
        del sensors["i_a"]
    return robot_toml(name, {**tables, "sensors": sensors})


def robot_of(text: str):
    """The `Robot` of a `robot.toml` as text."""
    with temporary_folder() as scratch:
        path = scratch / "robot.toml"
        path.write_text(text)
        return load_robot(path)


def menu(robot) -> list[str]:
    """Effects that a machine can have."""
    names = list(EFFECTS)
    if robot.axis is not None:
        names = [n for n in names if EFFECTS[n][0] not in NO_AXIS and not n.startswith("gyro") or n == "payload_error"]
    if robot.driver.mode == "torque":
        names = [n for n in names if n not in NO_TORQUE]
    # Slip in proportion to force is a law for tyres that hold: not for what asks more than its weight of them.
    of = scale_of(robot, 0.01, 1.0)
    return [n for n in names if n != "longitudinal_slip" or of.force < 0.75 * of.weight]


def draw_conditions(
    rng: np.random.Generator,
    spec: dict,
    dirty: bool,
    name: str | None = None,
    span: tuple[float, float] | None = None,
) -> None:
    """Fill a spec with a machine, its channels, rate and runs, and with a logger's habits where `dirty`.

    `name` : its class, default drawn of `CLASSES`. `span` : shortest and longest run, s, default the class's own.
    """
    name = name or str(rng.choice(CLASSES))
    text = draw_machine(rng, name)
    robot = robot_of(text)
    spec.update(
        robot=text,
        machine=name,
        world="planar",
        slow={},
        jitter=0.0,
        dropped=0.0,
        form=str(rng.choice(["csv", "parquet"])),
        drive=float(
            rng.uniform(0.35, 0.6) if name in ("competition", "pendulum", "micromouse") else rng.uniform(0.6, 1.0)
        ),
        counts={stem: log_uniform(rng, 0.02, 1.2) for stem in ("v_bus", "i", "w", "th", "gyro_z", "x", "y", "yaw")},
    )
    if name in ROBOTS:
        rates, shortest, longest = ROBOTS[name][8], *ROBOTS[name][9]
        rate = float(rng.choice(rates))
        menus = [[], ["pose"], ["pose"], ["pose", "v_bus"], ["v_bus"], ["pose", "gyro_z"], ["pose", "i"]]
        spec["missing"] = ["pose", *menus[rng.integers(4)]] if name == "micromouse" else menus[rng.integers(len(menus))]
        scenarios: tuple[str, ...] = SCENARIOS
    else:
        rate, shortest, longest = float(rng.choice([100.0, 250.0, 500.0, 1000.0])), 0.6, 6.0
        spec["missing"] = [
            "gyro_z",
            "pose",
            *[["v_bus"], ["v_bus", "th"], ["v_bus", "w"], ["v_bus", "i"]][rng.integers(4)],
        ]
        scenarios = AXIS_SCENARIOS
    if dirty and name in ("turtlebot", "desk") and rng.random() < 0.6:
        rate, shortest, longest = float(rng.choice([10.0, 20.0])), 8.0, 20.0
    shortest, longest = span or (shortest, longest)
    spec["missing"] = sorted(set(spec["missing"]))
    spec["rate"] = rate
    if dirty:
        spec["logger"] = draw_logger(rng, rate)
        spec["dropped"] = float(rng.uniform(0.005, 0.03)) if rng.random() < 0.3 else 0.0
    load = 0.0 if robot.axis else robot.chassis.mass_kg * rng.uniform(0.3, 1.0)
    count = int(rng.integers(3, 7))

    def run(name: str, k: int) -> dict:
        slope = 0.0 if robot.axis else float(rng.choice([0.0, 0.0, 0.08]))
        return {
            "name": name,
            "payload_kg": round(float(load * (k % 2)), 3),
            "slope_rad": slope,
            "uphill_yaw_rad": round(float(rng.uniform(-math.pi, math.pi)), 4),
            "duration": round(log_uniform(rng, shortest, longest), 2),
        }

    names = [str(item) for item in rng.permutation(scenarios)]
    names = (names * 2)[:count]
    if not set(names) & {"steps", "prbs", "coast"}:
        names[0] = "steps"
    spec["runs"] = [run(item, k) for k, item in enumerate(sorted(set(names)))]
    spec["held_out"] = [run(item, k) for k, item in enumerate(("steps", "coast"))]


def commands(
    name: str, t: np.ndarray, rng: np.random.Generator, robot, spec: dict, plan
) -> tuple[np.ndarray, np.ndarray]:
    """A scenario in a machine's own scales: volts of its supply, speeds of its motors, its run's length for the
    burger's.

    Parameters
    ----------
    plan : the burger's scenarios, (name, t, rng, robot) -> (v_cmd, w_ref).
    """
    of: Scale = scale_of(robot, 1 / spec["rate"], t[-1])
    v, w = plan(name, t * (VIRTUAL_S / t[-1]), rng, robot)
    v *= of.volts / 12.0 * spec["drive"]
    w *= 0.75 * of.speed / 5.6 * spec["drive"]
    if robot.axis is not None:
        v[:, 1] = 0.0
    logger = spec.get("logger") or Logger()
    return np.round(logger.rounded("v_cmd", v), 4), w
