"""A robot's two motor units as the C library takes them, and as C source."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtds_host.contract import Robot
from rtds_host.correction.translate import translate
from rtds_host.diagnosis.replay.model import Model
from rtds_host.errors import InputError
from rtds_host.motor.effect_tables import EffectWords, tables_of
from rtds_host.motor.effects import SupplyEffects, UnitEffects
from rtds_host.motor.parameters import Parameters, parameter_words

STEP_S = 1e-5
FLOAT_MAX = float(np.finfo(np.float32).max)


@dataclass(frozen=True)
class MotorUnits:
    """Two motor units.

    Attributes
    ----------
    values : (2, 7) R, L, Km, Kb, J, B, step of [left, right], SI.
    words : the effect unit's constants, tables and delay.
    effects : arguments of `Link.set_effects` that give the same.
    parameters : (7,) arguments of `Link.set_parameters`.
    """

    values: np.ndarray
    words: EffectWords
    effects: tuple[UnitEffects | None, UnitEffects | None, SupplyEffects | None]
    parameters: Parameters


def motor_units(model: Model, robot: Robot, step_s: float = STEP_S) -> MotorUnits:
    """The motor units of a robot with what a diagnosis' model has of them; the body is left to the caller.

    Raises
    ------
    InputError : see `translate`, `tables_of` and `parameter_words`.
    """
    if robot.chassis is None:
        raise InputError(f"robot {robot.name!r}: is a single axis, a robot on two wheels can be exported")
    correction = translate(model, robot, step_s=step_s)
    left, right = (None if unit.absent else unit for unit in correction.units)
    supply = None if correction.supply.absent else correction.supply
    motor = robot.motor
    parameters = (
        motor.resistance_ohm,
        motor.inductance_h,
        motor.torque_constant_nm_per_a,
        motor.back_emf_constant_v_s_per_rad,
        motor.rotor_inertia_kg_m2,
        motor.viscous_friction_nm_s_per_rad,
        step_s,
    )
    words = tables_of(left, right, supply, parameters)
    values = words.side_values(parameters)
    for side in values:
        parameter_words(side, "backward_euler")
    return MotorUnits(values, words, (left, right, supply), parameters)


def float_text(value: float) -> str:
    """A binary32 number as C and XML read it back to the bit; an absent limit is the largest number."""
    number = min(max(float(np.float32(value)), -FLOAT_MAX), FLOAT_MAX)
    return f"{number:.9g}"


def c_floats(values: np.ndarray) -> str:
    """An array as a C initialiser."""
    if values.ndim == 1:
        return "{" + ",".join(_c_float(value) for value in values) + "}"
    return "{" + ",\n".join(c_floats(part) for part in values) + "}"


def _c_float(value: float) -> str:
    text = float_text(value)
    return "0" if text in ("0", "-0") else text + ("f" if "." in text or "e" in text else ".0f")


def c_effects(words: EffectWords) -> str:
    """An initialiser of `rtds_effects`."""
    head = f"{int(words.on)}, {words.delay}, {words.stride}"
    return f"{{{head},\n{c_floats(words.constants)},\n{c_floats(words.tables)}}}"


def header(units: MotorUnits, comment: str) -> str:
    """The text of `motors.h`: `RTDS_LEFT`, `RTDS_RIGHT` and `RTDS_EFFECTS`."""
    lines = [f"// {line}".rstrip() for line in comment.splitlines()]
    lines += ["#ifndef RTDS_MOTORS_H", "#define RTDS_MOTORS_H", '#include "rtds_motor.h"', ""]
    for name, side in zip(("LEFT", "RIGHT"), units.values, strict=True):
        numbers = ", ".join(repr(float(value)) for value in side)
        lines.append(f"static const double RTDS_{name}[RTDS_PARAMETERS] = {{{numbers}}};")
    lines += [f"static const rtds_effects RTDS_EFFECTS = {c_effects(units.words)};", "#endif", ""]
    return "\n".join(lines)
