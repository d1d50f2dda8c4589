"""What can happen to a robot in the blind worlds: the contract's catalogue with ranges of sizes, and more.

Ranges go from hardly visible to large; magnitudes are drawn log-uniformly.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

# id -> (subsystem, has sides)
EFFECTS = {
    "supply_sag": ("driver", False),
    "battery_decline": ("driver", False),
    "driver_deadzone": ("driver", True),
    "bridge_drop": ("driver", True),
    "driver_gain": ("driver", True),
    "voltage_limit": ("driver", True),
    "pwm_curve": ("driver", True),
    "resistance_error": ("winding", True),
    "winding_heating": ("winding", True),
    "torque_constant_error": ("winding", True),
    "coulomb_friction": ("drivetrain", True),
    "stribeck_friction": ("drivetrain", True),
    "viscous_friction": ("drivetrain", True),
    "friction_asymmetry": ("drivetrain", True),
    "load_friction": ("drivetrain", True),
    "backlash": ("drivetrain", True),
    "gear_compliance": ("drivetrain", True),
    "torque_ripple": ("drivetrain", True),
    "rotor_inertia_error": ("drivetrain", True),
    "wheel_radius_error": ("wheel_ground", True),
    "longitudinal_slip": ("wheel_ground", True),
    "spin_scrub": ("wheel_ground", False),
    "rolling_resistance": ("wheel_ground", False),
    "track_width_error": ("chassis", False),
    "payload_error": ("chassis", False),
    "com_offset": ("chassis", False),
    "slope_error": ("chassis", False),
    "yaw_inertia_error": ("chassis", False),
    "speed_gain": ("sensing", True),
    "current_gain": ("sensing", True),
    "current_bias": ("sensing", True),
    "speed_filter": ("sensing", True),
    "gyro_bias": ("sensing", False),
    "gyro_gain": ("sensing", False),
    "command_delay": ("timing", False),
    "measurement_delay": ("timing", False),
}

# Effects that the catalogue does not hold: id -> (subsystem, has sides). No line of the diagnoser has their form.
OUTSIDE = {
    "command_quantised": ("driver", True),
    "bus_noise": ("driver", False),
    "supply_choked": ("driver", False),
    "current_chopped": ("driver", True),
    "driver_foldback": ("driver", True),
    "bad_segment": ("winding", True),
    "demagnetised": ("winding", True),
    "random_brakes": ("drivetrain", False),
    "slip_elements": ("drivetrain", True),
    "rest_friction": ("drivetrain", True),
    "lagging_drag": ("drivetrain", True),
    "eddy_drag": ("drivetrain", True),
    "growing_tyre": ("wheel_ground", True),
    "caster_swing": ("wheel_ground", False),
    "carpet_nap": ("wheel_ground", False),
    "gusts": ("chassis", False),
    "sloshing": ("chassis", False),
    "speed_dropouts": ("sensing", False),
    "speed_clipped": ("sensing", False),
    "speed_floor": ("sensing", True),
    "current_floor": ("sensing", True),
    "gyro_pull": ("sensing", False),
    "gyro_drift": ("sensing", False),
    "link_stalls": ("timing", False),
}

# What the catalogue does not hold either, and what only the rest of a case with several causes is made of.
UNMODELLED = {
    "dahl_friction": ("drivetrain", True),
    "cold_grease": ("drivetrain", True),
}

# Effects without a name whose form a signature of the diagnoser has (`diagnosis/localise`), found by their equations.
# To find their place is recall, so that no sealed case is drawn from them; the two worlds still have them.
FAMILIAR = {
    "command_hysteresis": ("driver", True),
    "command_crosstalk": ("driver", True),
    "slew_limit": ("driver", True),
    "bus_relaxation": ("driver", False),
    "magnetic_saturation": ("winding", True),
    "rub_spot": ("drivetrain", True),
    "growing_friction": ("drivetrain", True),
    "quadratic_drag": ("drivetrain", True),
    "position_friction": ("drivetrain", True),
    "detents": ("drivetrain", True),
    "wheel_eccentricity": ("wheel_ground", True),
    "traction_limit": ("wheel_ground", True),
    "floor_patch": ("wheel_ground", False),
    "turn_drag": ("wheel_ground", False),
    "uneven_floor": ("wheel_ground", False),
    "cable_drag": ("chassis", False),
    "lateral_slope": ("chassis", False),
    "encoder_wobble": ("sensing", True),
    "current_antialias": ("sensing", True),
    "current_bend": ("sensing", True),
    "clock_drift": ("timing", False),
}
UNNAMED = {**OUTSIDE, **UNMODELLED, **FAMILIAR}

# A wheel that is out of true would lift the other one off the second world's floor; the laws of `unnamed.py` are the
# planar world's.
PLANAR_ONLY = (
    "wheel_eccentricity",
    "supply_choked",
    "current_chopped",
    "driver_foldback",
    "bad_segment",
    "demagnetised",
    "slip_elements",
    "rest_friction",
    "lagging_drag",
    "eddy_drag",
    "growing_tyre",
    "caster_swing",
    "carpet_nap",
    "sloshing",
)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def with_sign(rng: np.random.Generator, low: float, high: float) -> float:
    return log_uniform(rng, low, high) * (1 if rng.random() < 0.5 else -1)


def random_side(rng: np.random.Generator, sided: bool) -> str:
    return str(rng.choice(["both", "left", "right"])) if sided else "both"


def _ratio(rng: np.random.Generator, low: float, high: float) -> dict:
    return {"ratio": 1.0 + with_sign(rng, low, high)}


def _viscous_friction(rng: np.random.Generator) -> dict:
    value = log_uniform(rng, 0.0015, 0.04)
    return {"nm_s_per_rad": -min(value, 0.025) if rng.random() < 0.3 else value}


def _friction_asymmetry(rng: np.random.Generator) -> dict:
    sign = 1 if rng.random() < 0.5 else -1
    return {
        "torque_nm": sign * log_uniform(rng, 0.003, 0.04),
        "nm_s_per_rad": sign * log_uniform(rng, 0.0005, 0.01),
    }


def _gear_compliance(rng: np.random.Generator) -> dict:
    stiffness = log_uniform(rng, 0.3, 15.0)
    return {"stiffness_nm_per_rad": stiffness, "damping_nm_s_per_rad": log_uniform(rng, 0.002, 0.03)}


def _payload_error(rng: np.random.Generator) -> dict:
    value = log_uniform(rng, 0.1, 2.0)
    return {"mass_kg": -min(value, 0.4) if rng.random() < 0.2 else value}


# Effect -> its parameters, drawn to the burger's size.
DRAWN: dict[str, Callable[[np.random.Generator], dict]] = {
    "supply_sag": lambda rng: {"resistance_ohm": log_uniform(rng, 0.15, 2.0)},
    "battery_decline": lambda rng: {"rate_v_per_s": log_uniform(rng, 0.004, 0.08)},
    "driver_deadzone": lambda rng: {"volts": log_uniform(rng, 0.04, 0.8)},
    "bridge_drop": lambda rng: {"volts": log_uniform(rng, 0.04, 0.8)},
    "driver_gain": lambda rng: {"ratio": -1.0} if rng.random() < 0.04 else _ratio(rng, 0.015, 0.2),
    "voltage_limit": lambda rng: {"volts": float(rng.uniform(4.0, 9.0))},
    "pwm_curve": lambda rng: {"curvature": log_uniform(rng, 0.02, 0.9) * (1 if rng.random() < 0.8 else -1)},
    "resistance_error": lambda rng: _ratio(rng, 0.05, 0.4),
    "winding_heating": lambda rng: {
        "rise_per_watt": log_uniform(rng, 0.06, 1.0),
        "time_constant_s": log_uniform(rng, 3.0, 60.0),
    },
    "torque_constant_error": lambda rng: _ratio(rng, 0.04, 0.25),
    "coulomb_friction": lambda rng: {"torque_nm": log_uniform(rng, 0.003, 0.1)},
    "stribeck_friction": lambda rng: {
        "torque_nm": log_uniform(rng, 0.005, 0.06),
        "extra_torque_nm": log_uniform(rng, 0.008, 0.08),
        "speed_rad_s": log_uniform(rng, 0.15, 1.5),
    },
    "viscous_friction": _viscous_friction,
    "friction_asymmetry": _friction_asymmetry,
    "load_friction": lambda rng: {"ratio": log_uniform(rng, 0.05, 0.45)},
    "backlash": lambda rng: {"angle_rad": log_uniform(rng, 0.004, 0.15)},
    "gear_compliance": _gear_compliance,
    "torque_ripple": lambda rng: {
        "amplitude_nm": log_uniform(rng, 0.005, 0.08),
        "cycles_per_rev": int(rng.choice([1, 2, 3, 4, 5, 6, 8, 10, 12])),
        "phase_rad": float(rng.uniform(-math.pi, math.pi)),
    },
    "rotor_inertia_error": lambda rng: _ratio(rng, 0.06, 0.6),
    "wheel_radius_error": lambda rng: _ratio(rng, 0.004, 0.08),
    "longitudinal_slip": lambda rng: {"slip_per_newton": log_uniform(rng, 0.004, 0.08)},
    "spin_scrub": lambda rng: {"torque_nm": log_uniform(rng, 0.004, 0.1)},
    "rolling_resistance": lambda rng: {"coefficient": log_uniform(rng, 0.004, 0.06)},
    "track_width_error": lambda rng: _ratio(rng, 0.008, 0.12),
    "payload_error": _payload_error,
    "com_offset": lambda rng: {"x_m": with_sign(rng, 0.006, 0.05), "y_m": with_sign(rng, 0.002, 0.02)},
    "slope_error": lambda rng: {"slope_rad": with_sign(rng, 0.004, 0.06)},
    "yaw_inertia_error": lambda rng: {
        "ratio": log_uniform(rng, 1.6, 9.0) if rng.random() < 0.8 else log_uniform(rng, 0.3, 0.6)
    },
    "speed_gain": lambda rng: _ratio(rng, 0.008, 0.12),
    "current_gain": lambda rng: {"ratio": -1.0} if rng.random() < 0.04 else _ratio(rng, 0.03, 0.3),
    "current_bias": lambda rng: {"amperes": with_sign(rng, 0.002, 0.06)},
    "speed_filter": lambda rng: {"time_constant_s": log_uniform(rng, 0.004, 0.08)},
    "gyro_bias": lambda rng: {"rad_s": with_sign(rng, 0.001, 0.05)},
    "gyro_gain": lambda rng: _ratio(rng, 0.01, 0.15),
    "command_delay": lambda rng: {"seconds": log_uniform(rng, 0.0015, 0.04)},
    "measurement_delay": lambda rng: {"seconds": log_uniform(rng, 0.0015, 0.04)},
}


def _parameters(rng: np.random.Generator, name: str) -> dict:
    if name not in DRAWN:
        raise ValueError(f"effect {name!r} is not in the contract")
    return DRAWN[name](rng)


def draw_effect(rng: np.random.Generator, name: str | None = None) -> dict:
    """One effect of the catalogue: id, side, subsystem and parameters, drawn at random (id too unless given)."""
    name = name or str(rng.choice(list(EFFECTS)))
    subsystem, sided = EFFECTS[name]
    side = random_side(rng, sided)
    parameters = {key: float(f"{value:.5g}") for key, value in _parameters(rng, name).items()}
    return {"id": name, "side": side, "subsystem": subsystem, "parameters": parameters}
