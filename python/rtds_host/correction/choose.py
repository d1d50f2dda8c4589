"""Which effects a run is driven with: from a diagnosis, from the command line, or both."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from rtds_host.contract import Robot
from rtds_host.contract.runlog import read_object
from rtds_host.diagnosis.effects import SIDES, Effect, catalogue, inside
from rtds_host.diagnosis.predict import read_diagnosis
from rtds_host.diagnosis.replay.model import Model, nominal_model
from rtds_host.errors import InputError, did_you_mean


@dataclass(frozen=True)
class Chosen:
    """Effects put together: the replay's model that holds them, and how each is named in a summary."""

    model: Model
    names: tuple[str, ...]


def parse_effect(text: str, effects: dict[str, Effect]) -> tuple[str, str, dict[str, float]]:
    """`coulomb_friction.torque_nm=0.05,side=left` as effect, side and values; `effects`: the catalogue on the robot.

    Parameters that are not given keep the value at which the catalogue calls the effect absent.

    Raises
    ------
    InputError : unknown effect, parameter or side, a value that is no number or out of bounds, nothing given.
    """
    name, dot, rest = text.partition(".")
    effect = effects.get(name.strip())
    if effect is None:
        raise InputError(
            f"--effect {text}: {name.strip()!r} is not in the catalogue (`rtds effects` lists it)"
            f"{did_you_mean(name.strip(), effects)}"
        )
    known = {p.name: p for p in effect.parameters}
    values, side, given = {p.name: p.null for p in effect.parameters}, "both", False
    for part in rest.split(",") if dot else ():
        key, sign, number = (piece.strip() for piece in part.partition("="))
        if not sign:
            raise InputError(f"--effect {text}: {part.strip()!r} must be parameter=number, or side=...")
        if key == "side":
            if number not in effect.sides:
                raise InputError(f"--effect {text}: side {number!r} must be one of {', '.join(effect.sides)}")
            side = number
            continue
        if key not in known:
            raise InputError(
                f"--effect {text}: {key!r} is not a parameter of {effect.id} (it has {', '.join(known)})"
                f"{did_you_mean(key, known)}"
            )
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise InputError(f"--effect {text}: {key}: {number!r} is not a finite number")
        p = known[key]
        held = inside(value, p.low, p.high)
        if held is None:
            raise InputError(
                f"--effect {text}: {key}: is {value:g}, it must lie within {p.low:g} to {p.high:g} {p.unit}"
            )
        values[key], given = held, True
    if not given:
        raise InputError(
            f"--effect {text}: no value given, as in --effect {effect.id}.{effect.parameters[0].name}="
            f"{effect.parameters[0].starts[0]:g}"
        )
    return effect.id, side, values


def effect_text(effect: str, side: str, values: dict[str, float]) -> str:
    """The inverse of `parse_effect`, to a few digits."""
    return f"{effect}." + ",".join(f"{name}={value:.6g}" for name, value in values.items()) + f",side={side}"


def choose(robot: Robot, diagnosis: Path | None = None, effects: list[str] | None = None) -> Chosen | None:
    """The robot with a diagnosis' effects and those named one by one; None if there are none.

    Raises
    ------
    InputError : a diagnosis that cannot be read, or what `parse_effect` refuses.
    """
    if diagnosis is None and not effects:
        return None
    model, names = nominal_model(robot), []
    if diagnosis is not None:
        model = read_diagnosis(diagnosis, robot)
        data = read_object(Path(diagnosis))
        for entry in data.get("effects") or []:
            values = {
                key: value["value"] if isinstance(value, dict) else value
                for key, value in (entry.get("parameters") or {}).items()
            }
            names.append(effect_text(entry["id"], entry["side"], values))
        for suffix, values in (data.get("nominal_fit") or {}).items():
            names.append(f"nominal_fit {suffix}: " + ", ".join(f"{key}={value:.6g}" for key, value in values.items()))
        names += [f"form {e['term']} over {e['over']},side={e['side']}" for e in data.get("forms") or []]
        if not names:
            names.append("a diagnosis without effects")
    there = catalogue(robot)
    for text in effects or []:
        effect, side, values = parse_effect(text, there)
        there[effect].apply(model, SIDES[side], values)
        names.append(effect_text(effect, side, values))
    return Chosen(model, tuple(names))
