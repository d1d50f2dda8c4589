"""Sizes of effects in the scales of a machine of any size: stall torque, no-load speed, stall current, weight, track.

The planar world's catalogue (`vocabulary.py`) has ranges in the units of one small robot. Here the same effects, and
the unmodelled ones that only a rest is made of, are drawn as shares of what the machine's own motors and mass can do.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rtds_host.blind.vocabulary import (
    EFFECTS,
    OUTSIDE,
    PLANAR_ONLY,
    UNMODELLED,
    UNNAMED,
    log_uniform,
    random_side,
    with_sign,
)

GRAVITY_M_S2 = 9.80665
# Unmodelled effect -> the parameter that says how much of it there is, and whether more of it means more effect.
STRENGTH = {
    "command_hysteresis": ("hysteresis", 1),
    "command_quantised": ("quantum", 1),
    "command_crosstalk": ("crosstalk", 1),
    "slew_limit": ("slew", -1),
    "magnetic_saturation": ("saturation", -1),
    "rub_spot": ("rub_torque", 1),
    "growing_friction": ("friction_per_s", 1),
    "quadratic_drag": ("quadratic", 1),
    "wheel_eccentricity": ("eccentricity", 1),
    "traction_limit": ("traction", -1),
    "floor_patch": ("patch_force", 1),
    "cable_drag": ("cable", 1),
    "lateral_slope": ("lateral_slope", 1),
    "gusts": ("gust", 1),
    "bus_noise": ("bus_noise", 1),
    "encoder_wobble": ("encoder_wobble", 1),
    "bus_relaxation": ("relax_ohm", 1),
    "dahl_friction": ("dahl", 1),
    "position_friction": ("swing", 1),
    "cold_grease": ("grease", 1),
    "detents": ("detent", 1),
    "turn_drag": ("turn_drag", 1),
    "uneven_floor": ("bumps", 1),
    "current_antialias": ("current_tau", 1),
    "current_bend": ("current_bend", 1),
    "clock_drift": ("clock_drift", 1),
    "supply_choked": ("choke_ohm", 1),
    "current_chopped": ("current_limit", -1),
    "driver_foldback": ("foldback", 1),
    "bad_segment": ("segment", 1),
    "demagnetised": ("demagnetised", 1),
    "slip_elements": ("slip_torque", 1),
    "rest_friction": ("dwell", 1),
    "lagging_drag": ("lag_drag", 1),
    "eddy_drag": ("eddy", 1),
    "growing_tyre": ("growth", 1),
    "caster_swing": ("caster", 1),
    "carpet_nap": ("nap", 1),
    "sloshing": ("slosh", 1),
    "speed_floor": ("speed_floor", 1),
    "current_floor": ("current_floor", 1),
    "gyro_pull": ("gyro_pull", 1),
    "gyro_drift": ("gyro_drift", 1),
    "link_stalls": ("stall_s", 1),
}
# Strengths beyond which an effect is nonsense: a share, or a part of the mass.
MOST = {"demagnetised": 0.6, "sloshing": 0.7}


@dataclass(frozen=True)
class Scale:
    """What a machine can do, at the gear's output: torques N m, speed rad/s, everything SI."""

    volts: float
    amps: float  # stall current
    ohm: float
    torque: float  # stall torque
    speed: float  # no-load speed
    viscous: float  # nominal B at the gear's output
    mass: float
    track: float
    radius: float
    force: float  # on the body by one wheel at stall, what the rotor's inertia keeps to itself left out
    period: float  # between two rows of the log
    duration: float  # of a run

    @property
    def weight(self) -> float:
        """Newton."""
        return self.mass * GRAVITY_M_S2

    @property
    def drag(self) -> float:
        """Stall torque over no-load speed, N·m·s/rad."""
        return self.torque / self.speed


def scale_of(robot, period: float, duration: float) -> Scale:
    """The scales of a nominal robot or axis logged every `period` seconds for about `duration` seconds.

    Without a motor's electrics (torque mode) the speed is a third of what the full torque reaches against B. An axis
    has its mass, or its inertia where it has no mass, in the mass's place.
    """
    motor, chassis = robot.motor, robot.chassis
    gear = motor.gear_ratio
    if robot.axis is not None:
        mass = robot.axis.mass_kg or robot.axis.inertia_kg_m2
        drag = gear**2 * motor.viscous_friction_nm_s_per_rad
        if robot.driver.mode == "torque":
            torque = gear * robot.driver.torque_nm_per_v * robot.supply_v
            return Scale(
                robot.supply_v,
                math.nan,
                math.nan,
                torque,
                torque / (3 * drag),
                drag,
                mass,
                1.0,
                1.0,
                0.0,
                period,
                duration,
            )
        amps = robot.supply_v / motor.resistance_ohm
        return Scale(
            robot.supply_v,
            amps,
            motor.resistance_ohm,
            gear * motor.torque_constant_nm_per_a * amps,
            robot.supply_v / (gear * motor.back_emf_constant_v_s_per_rad),
            drag,
            mass,
            1.0,
            1.0,
            0.0,
            period,
            duration,
        )
    amps = robot.supply_v / motor.resistance_ohm
    torque, radius, half = gear * motor.torque_constant_nm_per_a * amps, chassis.wheel_radius_m, chassis.mass_kg / 2
    force = torque / radius * half / (half + gear**2 * motor.rotor_inertia_kg_m2 / radius**2)
    return Scale(
        robot.supply_v,
        amps,
        motor.resistance_ohm,
        torque,
        robot.supply_v / (gear * motor.back_emf_constant_v_s_per_rad),
        gear**2 * motor.viscous_friction_nm_s_per_rad,
        chassis.mass_kg,
        chassis.track_width_m,
        radius,
        force,
        period,
        duration,
    )


def _ratio(rng: np.random.Generator, low: float, high: float) -> dict:
    return {"ratio": 1.0 + with_sign(rng, low, high)}


def _delay(rng: np.random.Generator, of: Scale, low_rows: float, high_s: float) -> dict:
    low = low_rows * of.period
    return {"seconds": log_uniform(rng, low, max(min(high_s, 0.15 * of.duration), 6 * low))}


def _winding_heating(rng: np.random.Generator, of: Scale) -> dict:
    power = of.volts * of.amps / 4
    return {
        "rise_per_watt": log_uniform(rng, 0.2, 3.0) / power,
        "time_constant_s": log_uniform(rng, 0.15 * of.duration, 3.0 * of.duration),
    }


def _viscous_friction(rng: np.random.Generator, of: Scale) -> dict:
    value = of.drag * log_uniform(rng, 0.004, 0.12)
    return {
        "nm_s_per_rad": -min(value, 0.85 * of.viscous) if rng.random() < 0.25 and of.viscous > 0.01 * of.drag else value
    }


def _friction_asymmetry(rng: np.random.Generator, of: Scale) -> dict:
    sign = 1 if rng.random() < 0.5 else -1
    return {
        "torque_nm": sign * of.torque * log_uniform(rng, 0.0015, 0.02),
        "nm_s_per_rad": sign * of.drag * log_uniform(rng, 0.0015, 0.03),
    }


def _payload_error(rng: np.random.Generator, of: Scale) -> dict:
    value = of.mass * log_uniform(rng, 0.1, 2.0)
    return {"mass_kg": -min(value, 0.4 * of.mass) if rng.random() < 0.2 else value}


# Effect -> its parameters, drawn to the size of a robot.
SIZED: dict[str, Callable[[np.random.Generator, Scale], dict]] = {
    "supply_sag": lambda rng, of: {"resistance_ohm": of.ohm * log_uniform(rng, 0.015, 0.25)},
    "battery_decline": lambda rng, of: {"rate_v_per_s": of.volts / of.duration * log_uniform(rng, 0.008, 0.12)},
    "driver_deadzone": lambda rng, of: {"volts": of.volts * log_uniform(rng, 0.004, 0.07)},
    "bridge_drop": lambda rng, of: {"volts": of.volts * log_uniform(rng, 0.004, 0.07)},
    "driver_gain": lambda rng, of: {"ratio": -1.0} if rng.random() < 0.04 else _ratio(rng, 0.015, 0.3),
    "voltage_limit": lambda rng, of: {"volts": of.volts * float(rng.uniform(0.33, 0.75))},
    "pwm_curve": lambda rng, of: {"curvature": log_uniform(rng, 0.03, 0.95) * (1 if rng.random() < 0.8 else -1)},
    "resistance_error": lambda rng, of: _ratio(rng, 0.05, 0.4),
    "winding_heating": _winding_heating,
    "torque_constant_error": lambda rng, of: _ratio(rng, 0.04, 0.25),
    "coulomb_friction": lambda rng, of: {"torque_nm": of.torque * log_uniform(rng, 0.002, 0.06)},
    "stribeck_friction": lambda rng, of: {
        "torque_nm": of.torque * log_uniform(rng, 0.003, 0.03),
        "extra_torque_nm": of.torque * log_uniform(rng, 0.005, 0.04),
        "speed_rad_s": of.speed * log_uniform(rng, 0.02, 0.2),
    },
    "viscous_friction": _viscous_friction,
    "friction_asymmetry": _friction_asymmetry,
    "load_friction": lambda rng, of: {"ratio": log_uniform(rng, 0.05, 0.45)},
    "backlash": lambda rng, of: {"angle_rad": log_uniform(rng, 0.006, 0.15)},
    "gear_compliance": lambda rng, of: {
        "stiffness_nm_per_rad": of.torque * log_uniform(rng, 0.15, 6.0),
        "damping_nm_s_per_rad": of.drag * log_uniform(rng, 0.006, 0.1),
    },
    "torque_ripple": lambda rng, of: {
        "amplitude_nm": of.torque * log_uniform(rng, 0.003, 0.08),
        "phase_rad": float(rng.uniform(-math.pi, math.pi)),
        "cycles_per_rev": int(rng.choice([1, 2, 3, 4, 5, 6, 8, 10, 12])),
    },
    "rotor_inertia_error": lambda rng, of: _ratio(rng, 0.06, 0.6),
    "wheel_radius_error": lambda rng, of: _ratio(rng, 0.006, 0.1),
    "longitudinal_slip": lambda rng, of: {"slip_per_newton": log_uniform(rng, 0.02, 0.4) / of.force},
    "spin_scrub": lambda rng, of: {"torque_nm": of.weight * of.track * log_uniform(rng, 0.003, 0.07)},
    "rolling_resistance": lambda rng, of: {"coefficient": log_uniform(rng, 0.004, 0.06)},
    "track_width_error": lambda rng, of: _ratio(rng, 0.01, 0.15),
    "payload_error": _payload_error,
    "com_offset": lambda rng, of: {
        "x_m": of.track * with_sign(rng, 0.04, 0.3),
        "y_m": of.track * with_sign(rng, 0.0125, 0.09),
    },
    "slope_error": lambda rng, of: {"slope_rad": with_sign(rng, 0.004, 0.06)},
    "yaw_inertia_error": lambda rng, of: {
        "ratio": log_uniform(rng, 1.6, 7.0) if rng.random() < 0.8 else log_uniform(rng, 0.35, 0.6)
    },
    "speed_gain": lambda rng, of: _ratio(rng, 0.01, 0.15),
    "current_gain": lambda rng, of: {"ratio": -1.0} if rng.random() < 0.04 else _ratio(rng, 0.03, 0.4),
    "current_bias": lambda rng, of: {"amperes": of.amps * with_sign(rng, 0.0015, 0.06)},
    "speed_filter": lambda rng, of: {
        "time_constant_s": log_uniform(
            rng, max(0.4 * of.period, 0.001), max(min(0.08, 0.2 * of.duration), 4 * of.period)
        )
    },
    "gyro_bias": lambda rng, of: {"rad_s": with_sign(rng, 0.002, 0.12)},
    "gyro_gain": lambda rng, of: _ratio(rng, 0.01, 0.15),
    "command_delay": lambda rng, of: _delay(rng, of, 0.3, 0.05),
    "measurement_delay": lambda rng, of: _delay(rng, of, 0.3, 0.05),
}


def _parameters(rng: np.random.Generator, name: str, of: Scale) -> dict:
    if name not in SIZED:
        raise ValueError(f"effect {name!r} is not in the contract")
    return SIZED[name](rng, of)


def draw_sized(rng: np.random.Generator, name: str, of: Scale, axis: str | None = None) -> dict:
    """One effect of the catalogue with a size in a machine's own scales: id, side, subsystem, parameters.

    `axis` is the kind of a single axis: it has but a left side, and an inertia's payload is an inertia.
    """
    subsystem, sided = EFFECTS[name]
    side = random_side(rng, sided) if axis is None else "left"
    parameters = {key: float(f"{value:.5g}") for key, value in _parameters(rng, name, of).items()}
    if axis == "inertia" and name == "payload_error":
        parameters = {"inertia_kg_m2": parameters["mass_kg"]}
    return {"id": name, "side": side, "subsystem": subsystem, "parameters": parameters}


def unmodelled_parameters(rng: np.random.Generator, name: str, of: Scale) -> dict:
    """Middle sizes; `strengthened` brings them to what a case asks for."""
    u, drag = rng.uniform, of.torque / of.speed
    travel = of.speed * of.radius * of.duration  # what the machine could drive in a run
    return {
        "command_hysteresis": lambda: {"hysteresis": 0.06 * of.volts},
        "command_quantised": lambda: {"quantum": 0.1 * of.volts},
        "command_crosstalk": lambda: {"crosstalk": with_sign(rng, 0.05, 0.1)},
        "slew_limit": lambda: {"slew": 5.0 * of.volts},
        "magnetic_saturation": lambda: {"saturation": 0.5 * of.amps},
        "rub_spot": lambda: {
            "rub_torque": 0.04 * of.torque,
            "rub_angle": u(-math.pi, math.pi),
            "rub_width": u(0.15, 0.6),
        },
        "growing_friction": lambda: {"friction_per_s": 0.01 * of.torque / of.duration},
        "quadratic_drag": lambda: {"quadratic": 0.02 * drag / of.speed},
        "wheel_eccentricity": lambda: {"eccentricity": 0.03, "eccentric_phase": u(-math.pi, math.pi)},
        "traction_limit": lambda: {"traction": 0.1 * of.weight},
        "floor_patch": lambda: {"patch_x": 0.1 * travel * u(-1, 1), "patch_force": 0.1 * of.weight},
        "cable_drag": lambda: {"cable": 0.3 * of.weight / max(travel, of.track)},
        "lateral_slope": lambda: {"lateral_slope": with_sign(rng, 0.02, 0.05)},
        "gusts": lambda: {"gust": 0.08 * of.weight, "gust_tau": log_uniform(rng, 0.1, 1.0)},
        "bus_noise": lambda: {"bus_noise": 0.02 * of.volts, "bus_tau": log_uniform(rng, 0.05, 1.0)},
        "encoder_wobble": lambda: {"encoder_wobble": 0.03},
        "bus_relaxation": lambda: {"relax_ohm": 0.1 * of.ohm, "relax_tau": of.duration * log_uniform(rng, 0.05, 0.3)},
        "dahl_friction": lambda: {"dahl": 0.02 * of.torque, "dahl_rad": log_uniform(rng, 0.1, 1.0)},
        "position_friction": lambda: {"swing": 0.03 * of.torque, "swing_phase": u(-math.pi, math.pi)},
        "cold_grease": lambda: {"grease": 0.05 * drag, "grease_tau": of.duration * log_uniform(rng, 0.1, 0.6)},
        "detents": lambda: {
            "detent": 0.04 * of.torque,
            "detent_cycles": int(rng.integers(14, 31)),
            "detent_phase": u(-math.pi, math.pi),
        },
        "turn_drag": lambda: {"turn_drag": 0.2 * of.weight * of.track * of.track / (2 * of.speed * of.radius)},
        "uneven_floor": lambda: {
            "bumps": 0.02,
            "bump_length": max(of.track, 0.05 * travel) * log_uniform(rng, 0.5, 2.0),
        },
        "current_antialias": lambda: {"current_tau": of.period * log_uniform(rng, 1.0, 4.0)},
        "current_bend": lambda: {"current_bend": 0.5 / of.amps**2},
        "clock_drift": lambda: {"clock_drift": 0.001},
        **_unnamed(rng, of),
    }[name]()


def _unnamed(rng: np.random.Generator, of: Scale) -> dict:
    """Middle sizes of the laws of `unnamed.py`, of sensors and of the link: name -> a function that draws them."""
    u, drag = rng.uniform, of.torque / of.speed
    return {
        "supply_choked": lambda: {
            "choke_ohm": 0.3 * of.ohm,
            "choke_amps": 0.15 * of.amps,
            "choke_tau": of.duration * log_uniform(rng, 0.005, 0.02),
        },
        "current_chopped": lambda: {"current_limit": 0.4 * of.amps},
        "driver_foldback": lambda: {
            "foldback": 0.5 / (of.volts * of.amps / 4),
            "foldback_tau": of.duration * log_uniform(rng, 0.1, 0.5),
        },
        "bad_segment": lambda: {"segment": 0.4, "segment_angle": u(-math.pi, math.pi), "segment_width": u(0.3, 0.9)},
        "demagnetised": lambda: {"demagnetised": 0.06, "demagnetise_amps": of.amps * u(0.15, 0.4)},
        "slip_elements": lambda: {"slip_torque": 0.02 * of.torque, "slip_rad": log_uniform(rng, 0.02, 0.15)},
        "rest_friction": lambda: {"dwell": 0.1 * of.torque, "dwell_s": 0.01 * of.duration},
        "lagging_drag": lambda: {"lag_drag": 0.05 * drag, "lag_drag_tau": of.duration * log_uniform(rng, 0.01, 0.05)},
        "eddy_drag": lambda: {"eddy": 0.1 * drag, "eddy_speed": of.speed * u(0.1, 0.4)},
        "growing_tyre": lambda: {"growth": 0.02 / of.speed**2},
        "caster_swing": lambda: {"caster": 0.06 * of.weight * of.track, "caster_length": of.track * u(0.1, 0.3)},
        "carpet_nap": lambda: {"nap": 0.12 * of.weight, "nap_yaw": u(-math.pi, math.pi)},
        "sloshing": lambda: {
            "slosh": 0.25,
            "slosh_rate": 2.0 * math.pi * log_uniform(rng, 2.0, 6.0) * 8.0 / max(of.duration, 1.0),
            "slosh_ratio": u(0.02, 0.15),
        },
        "speed_floor": lambda: {"speed_floor": 0.12 * of.speed},
        "current_floor": lambda: {"current_floor": 0.05 * of.amps},
        "gyro_pull": lambda: {"gyro_pull": with_sign(rng, 0.5, 1.0) * of.speed * of.radius / of.track * of.period},
        "gyro_drift": lambda: {
            "gyro_drift": with_sign(rng, 0.01, 0.03) * of.speed * of.radius / of.track / of.duration
        },
        "link_stalls": lambda: {"stalls": int(rng.integers(15, 40)), "stall_s": of.duration * 0.0025},
    }


def draw_unmodelled(rng: np.random.Generator, of: Scale, world: str = "planar", name: str | None = None) -> dict:
    """One effect that no name of the catalogue describes: id, side, subsystem, the world's parameters.

    Drawn of what no line of the diagnoser knows and what has a strength, unless `name` says another one.
    """
    menu = [item for item in (*OUTSIDE, *UNMODELLED) if item in STRENGTH]
    name = name or str(rng.choice([item for item in menu if world == "planar" or item not in PLANAR_ONLY]))
    subsystem, sided = UNNAMED[name]
    side = random_side(rng, sided)
    parameters = {key: float(f"{value:.5g}") for key, value in unmodelled_parameters(rng, name, of).items()}
    return {"id": name, "side": side, "subsystem": subsystem, "parameters": parameters}


def draw_outside(rng: np.random.Generator, of: Scale, name: str | None = None, world: str = "planar") -> dict:
    """One effect outside of the catalogue on its own: up to five times as strong as a rest's middle size.

    Parameters
    ----------
    name : one of `vocabulary.UNNAMED`, default drawn of `vocabulary.OUTSIDE`.
    """
    name = name or str(rng.choice([item for item in OUTSIDE if world == "planar" or item not in PLANAR_ONLY]))
    if name in STRENGTH:
        return strengthened(draw_unmodelled(rng, of, world, name), log_uniform(rng, 1.0, 5.0))
    subsystem, _ = UNNAMED[name]
    u = rng.uniform
    parameters = {
        "random_brakes": lambda: {
            "brakes": [
                int(rng.integers(3, 9)),
                log_uniform(rng, 0.01, 0.05) * of.duration,
                of.torque * log_uniform(rng, 0.02, 0.2),
            ]
        },
        "speed_dropouts": lambda: {
            "hold": [
                [u(0.02, 0.95), log_uniform(rng, 0.01, 0.05) * of.duration, str(rng.choice(["w_l", "w_r"]))]
                for _ in range(int(rng.integers(5, 15)))
            ]
        },
        "speed_clipped": lambda: {"clip_speed": of.speed * u(0.3, 0.6)},
    }[name]()
    return {"id": name, "side": "both", "subsystem": subsystem, "parameters": parameters}


def strengthened(unmodelled: dict, factor: float) -> dict:
    """The same unmodelled effect, `factor` times as strong."""
    key, sense = STRENGTH[unmodelled["id"]]
    value = min(unmodelled["parameters"][key] * factor**sense, MOST.get(unmodelled["id"], math.inf))
    return {**unmodelled, "parameters": {**unmodelled["parameters"], key: float(f"{value:.5g}")}}
