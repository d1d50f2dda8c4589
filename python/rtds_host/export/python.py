"""Python: the source of `standalone.py` with the robot's numbers in it."""

from __future__ import annotations

import inspect
import math
import pprint
import re
from dataclasses import asdict

from rtds_host.export import standalone
from rtds_host.export.figures import Figures
from rtds_host.plant.driver import less_drop
from rtds_host.plant.friction import rolling
from rtds_host.plant.torque import summed
from rtds_host.plant.torques import TORQUES

PLACE = "PARAMETERS = {}\n"
# Where the template imports the plant's laws, the module has their source.
LAWS = re.compile(r"# laws: begin\n.*# laws: end\n", re.DOTALL)
# Laws that those of the template call.
CALLED = (less_drop,)
# Nobody commands more.
NO_LIMIT_V = 1e9


def parameters(figures: Figures) -> dict[str, float | list[float]]:
    """What `standalone.Robot` needs."""
    body = figures.body

    def pair(name: str) -> list[float]:
        return [float(getattr(side, name)) for side in figures.sides]

    dry = [side.dry_nm - rolling.py_func(figures.rolling, body.mass_kg, side.radius_m) for side in figures.sides]
    return {
        "supply_v": figures.supply_v,
        "source_resistance_ohm": figures.source_resistance_ohm,
        "decline_v_per_s": figures.decline_v_per_s,
        "command_delay_s": figures.command_delay_s,
        "measurement_delay_s": figures.measurement_delay_s,
        "mass_kg": body.mass_kg,
        "yaw_inertia_kg_m2": body.yaw_inertia_kg_m2,
        "wheel_inertia_kg_m2": body.wheel_inertia_kg_m2,
        "track_m": body.track_width_m,
        "com_x_m": body.com_m[0],
        "com_y_m": body.com_m[1],
        "slope_extra_rad": figures.slope_extra_rad,
        "rolling": figures.rolling,
        "scrub_nm": figures.scrub_nm,
        "gyro_gain": figures.gyro_gain,
        "gyro_bias_rad_s": figures.gyro_bias_rad_s,
        "dry_nm": [max(f, 0.0) for f in dry],
        "limit_v": [NO_LIMIT_V if math.isinf(side.limit_v) else side.limit_v for side in figures.sides],
        **{
            name: pair(name)
            for name in (
                "resistance_ohm",
                "gear_nm_per_a",
                "back_emf_v_s_per_rad",
                "rotor_kg_m2",
                "viscous_nm_s_per_rad",
                "voltage_gain",
                "deadzone_v",
                "drop_v",
                "pwm_curve",
                "heat_rise_per_w",
                "heat_tau_s",
                "stribeck_nm",
                "stribeck_rad_s",
                "asymmetry_nm",
                "asymmetry_nm_s_per_rad",
                "load_share",
                "radius_m",
                "speed_gain",
                "current_gain",
                "current_bias_a",
                "speed_filter_s",
                "speed_late_s",
                "command_gain",
            )
        },
        **{name: [float(side.torques[name]) for side in figures.sides] for name in figures.sides[0].torques},
        "servo": asdict(figures.loop) if figures.loop else None,
        "noise": dict(figures.noise),
    }


def laws() -> str:
    """Source of the laws that the template imports, and of those that they call, without their decorator."""
    found = [law for law in vars(standalone).values() if hasattr(law, "py_func")]
    shapes = [torque.law for torque in TORQUES.values()]
    texts = [inspect.getsource(law.py_func).partition("\n")[2].rstrip() for law in (*CALLED, *found, *shapes)]
    return "\n\n\n".join([*texts, summed(TORQUES, "p, k", lambda entry: f'p["{entry.export}"][k]')])


def write(figures: Figures, comment: str) -> str:
    """The robot as a Python module; `comment` stands at its head."""
    source = inspect.getsource(standalone)
    head = "".join(f"# {line}".rstrip() + "\n" for line in comment.splitlines())
    numbers = pprint.pformat(parameters(figures), width=120, sort_dicts=False)
    if PLACE not in source or LAWS.search(source) is None:
        raise LookupError(f"standalone.py holds no line {PLACE!r}, or no laws")
    source = LAWS.sub("", source, count=1).replace(PLACE, f"PARAMETERS = {numbers}\n", 1)
    before, mark, after = source.partition("\n\nclass Robot:")
    return f"{head}{before}\n\n{laws()}{mark}{after}"
