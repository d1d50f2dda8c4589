"""Python: the source of `standalone.py` with the robot's numbers in it."""

from __future__ import annotations

import inspect
import math
import pprint
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from types import ModuleType
from typing import Any

from rtds_host.export import settled, standalone
from rtds_host.export.figures import Figures
from rtds_host.plant import forms
from rtds_host.plant.driver import after_bridge_drop
from rtds_host.plant.friction import rolling
from rtds_host.plant.torque import summed
from rtds_host.plant.torques import TORQUES

PLACE = "PARAMETERS: dict = {}\n"
# Where the template imports the plant's laws, the module has their source.
LAWS = re.compile(r"# laws: begin\n.*# laws: end\n", re.DOTALL)
# Laws that those of the template call.
CALLED = (after_bridge_drop, forms.curve, forms.branch, forms.filtered_load, forms.warmed)
# Constants of `rtds_host.plant.forms` that its functions use.
FORM_CONSTANTS = (
    *(
        "POINTS",
        "HALF",
        "MOST_FORMS",
        "TERM",
        "OVER",
        "LOW",
        "HIGH",
        "TAU",
        "VALUES",
        "_LAST_BRANCH",
        "_FIRST_TURN",
        "_LAST_TURN",
    ),
    *("_TORQUE", "_VOLTAGE", "_CONSTANT", "_FORCE", "_YAW", "_GYRO", "_DAMPING"),
    *("_V", "_HISTORY", "_I", "_W", "_LOAD", "_RATE", "_HEADING", "_TIME", "_HEAT", "_X", "_Y"),
    *("EXTREME", "DIRECTION", "GEAR_LOAD", "HEATS", "PAST", "TURNS_BY", "LOAD_S"),
    *("DRIVE", "FORWARD", "BACKWARD", "FLUID"),
    *("VOLTS", "CONSTANT", "PUSH", "TURN", "SCRUB", "ACTS", "ABOUT", "MEAN_I"),
)
READINGS = ("I_READ", "W_READ")
# Nobody commands more.
NO_LIMIT_V = 1e9


def parameters(figures: Figures) -> dict[str, Any]:
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
                "drop_knee_a",
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
                "speed_delay_s",
                "command_gain",
            )
        },
        **{name: [float(side.torques[name]) for side in figures.sides] for name in figures.sides[0].torques},
        "servo": asdict(figures.loop) if figures.loop else None,
        "gear_ratio": figures.gear_ratio,
        "forms": rows_of(figures),
        "noise": dict(figures.noise),
    }


def rows_of(figures: Figures) -> list[list[list[float]]] | None:
    """Rows of forms, a list for each side, see `rtds_host.plant.forms`; None without any."""
    return figures.forms.tolist() if forms.any_of(figures.forms) else None


def form_constants() -> str:
    """Source of the constants that the functions of forms use, and of `settled`."""
    there = {**{name: getattr(forms, name) for name in FORM_CONSTANTS}, **{n: getattr(standalone, n) for n in READINGS}}
    there["V_OVER_I"], there["OVER_LOAD"] = settled.V_OVER_I, forms.OVER_CODE["load"]
    constants = "\n".join(f"{name} = {value!r}" for name, value in there.items())
    return f"{constants}\n\n\n{inspect.getsource(settled.settled).rstrip()}"


def source_of(laws: Iterable[Any]) -> list[str]:
    """Source of laws without their decorator."""
    return [inspect.getsource(law.py_func).partition("\n")[2].rstrip() for law in laws]


def alone(template: ModuleType, mark: str, called: tuple = (), more: Sequence[str] = ()) -> str:
    """Source of a template with the plant's laws before the line `mark`, in the place of their import.

    called : laws that those of the template call. more : source of further functions.
    """
    source = inspect.getsource(template)
    if mark not in source or LAWS.search(source) is None:
        raise LookupError(f"{template.__name__} holds no line {mark!r}, or no laws")
    before, _, after = LAWS.sub("", source, count=1).partition(f"\n\n{mark}")
    found = [law for law in vars(template).values() if hasattr(law, "py_func")]
    texts = "\n\n\n".join([*source_of((*called, *found)), *more]).rstrip()
    return f"{before}\n\n{texts}\n\n\n{mark}{after}"


def write(figures: Figures, comment: str) -> str:
    """The robot as a Python module; `comment` is at its head."""
    head = "".join(f"# {line}".rstrip() + "\n" for line in comment.splitlines())
    numbers = pprint.pformat(parameters(figures), width=120, sort_dicts=False)
    shapes = [form_constants(), *source_of(torque.law for torque in TORQUES.values())]
    shapes.append(summed(TORQUES, "p, k", lambda entry: f'p["{entry.export}"][k]'))
    source = alone(standalone, "class Robot:", CALLED, shapes)
    if PLACE not in source:
        raise LookupError(f"standalone.py holds no line {PLACE!r}")
    return head + source.replace(PLACE, f"PARAMETERS = {numbers}\n", 1)
