"""Prediction of a run by the nominal robot or by a diagnosis (contract, section 6)."""

from __future__ import annotations

import contextlib
import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from rtds_host.contract import Case, Robot, RunLog
from rtds_host.contract.clock import SETTLED_S
from rtds_host.contract.robot import BOUNDS
from rtds_host.contract.runlog import read_json
from rtds_host.diagnosis.effects import CATALOGUE, SIDES, Effect, catalogue, inside
from rtds_host.diagnosis.forms.reading import apply_forms
from rtds_host.diagnosis.gate.findings import Finding
from rtds_host.diagnosis.gate.limits import limits
from rtds_host.diagnosis.gate.rounding import effective_noise
from rtds_host.diagnosis.gate.stamps import evened
from rtds_host.diagnosis.gate.starts import awake
from rtds_host.diagnosis.nuisances import FORMER_SETUP, SETUP, entries
from rtds_host.diagnosis.replay.model import REPORT_STEP_S, Model, nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.scales import OF_ASKED, OF_RUNS, OF_SPEEDS_MET
from rtds_host.errors import InputError, did_you_mean
from rtds_host.plant.schema import OUTPUTS

# Diagnoses of the first schema hold all that a prediction needs.
DIAGNOSIS_SCHEMAS = ("rtds-diagnosis/3", "rtds-diagnosis/2", "rtds-diagnosis/1")


def read_diagnosis(path: str | os.PathLike, robot: Robot) -> Model:
    """The robot with a diagnosis in it: its `nominal_fit`, its `setup`, its effects and its forms.

    Raises
    ------
    InputError : unreadable, another schema, an effect, side or parameter that the catalogue does not know, a form that
        the plant does not know.
    """
    path = Path(path)
    data = read_json(path)
    if not isinstance(data, dict) or data.get("schema") not in DIAGNOSIS_SCHEMAS:
        raise InputError(f"{path}: schema: this program reads {' and '.join(map(repr, DIAGNOSIS_SCHEMAS))}")
    model = nominal_model(robot)
    _put_refit(model, path, data.get("nominal_fit") or {}, robot)
    _put_setup(model, path, data.get("setup") or {})
    if "effects" not in data:
        raise InputError(f"{path}: effects: missing, it is [] where no effect is named")
    if not isinstance(data["effects"], list):
        raise InputError(f"{path}: effects: is {data['effects']!r}, a list is needed")
    taken: dict[tuple[str, int], str] = {}
    for k, entry in enumerate(data["effects"]):
        place = f"effects[{k}]"
        effect = _effect_of(path, place, entry, robot)
        sides = [s for s in effect.sides if effect.side_on(robot.axis, s) == entry.get("side")]
        if not sides:
            known = dict.fromkeys(effect.side_on(robot.axis, s) for s in effect.sides)
            raise InputError(f"{path}: {place}.side: {entry.get('side')!r} must be one of {', '.join(known)}")
        for side in SIDES[sides[0]]:
            before = taken.setdefault((effect.id, side), place)
            if before != place:
                raise InputError(f"{path}: {place}: {effect.id} on this side is in {before} already")
        effect.apply(model, SIDES[sides[0]], _values_of(path, place, entry, effect, robot))
    apply_forms(model, data.get("forms"), path, robot)
    return model


def _put_refit(model: Model, path: Path, refit: object, robot: Robot) -> None:
    """Put a diagnosis' `nominal_fit` into the model.

    Raises
    ------
    InputError : a side or key that the robot does not have, or a value that a robot's file could not give.
    """
    refitted = entries(robot)
    tables = ("motor", "servo", "chassis" if robot.axis is None else "axis")
    if not isinstance(refit, dict):
        raise InputError(f"{path}: nominal_fit: is {refit!r}, an object with l and r is needed")
    for suffix, values in refit.items():
        if suffix not in ("l", "r") or not isinstance(values, dict):
            raise InputError(f"{path}: nominal_fit: {suffix!r} is not a side, it must be l or r")
        for key, value in values.items():
            place = f"nominal_fit.{suffix}.{key}"
            if key not in refitted:
                raise InputError(f"{path}: {place}: is not a nuisance of [motor], [chassis], [axis] or [servo]")
            # An offset or a travel may be negative, and is calibrated to no other sign.
            below = model.get(refitted[key]) < 0.0
            number = _number(path, place, value, positive=not below)
            if below and number >= 0.0:
                raise InputError(f"{path}: {place}: is {number:g}, it must be below 0")
            low, high = next(BOUNDS[table][key] for table in tables if key in BOUNDS[table])
            held = inside(number, low, high)
            if held is None:
                raise InputError(f"{path}: {place}: is {number:g}, it must lie within {low:g} to {high:g}")
            model.put(refitted[key], held, ("lr".index(suffix),))


def _put_setup(model: Model, path: Path, setup: object) -> None:
    """Put what a diagnosis says of clocks and sensors into the model."""
    if not isinstance(setup, dict):
        raise InputError(f"{path}: setup: is {setup!r}, an object is needed")
    for written, value in setup.items():
        key = FORMER_SETUP.get(written, written)
        if key not in SETUP:
            raise InputError(f"{path}: setup.{key}: is none of {', '.join(SETUP)}")
        number = _number(path, f"setup.{key}", value)
        low = 0.0 if key in ("latency_s", "anti_windup", "command_early_s", "encoder_at_wheel") else -1.0
        high = SETTLED_S if key == "command_early_s" else 1.0
        if not low <= number <= high:
            raise InputError(f"{path}: setup.{key}: is {number:g}, it must lie within {low:g} to {high:g}")
        model.put(SETUP[key], number)


def _effect_of(path: Path, place: str, entry: Any, robot: Robot) -> Effect:
    """The effect that an entry of a diagnosis names.

    Raises
    ------
    InputError : the catalogue does not have it, or not on this robot.
    """
    effects_there = catalogue(robot)
    name = entry.get("id") if isinstance(entry, dict) else None
    effect = effects_there.get(name) if isinstance(name, str) else None
    if effect is None and isinstance(name, str) and name in CATALOGUE:
        raise InputError(
            f"{path}: {place}.id: {name} acts before a speed loop, and [driver] mode is {robot.driver.mode!r}"
        )
    if effect is None:
        raise InputError(
            f"{path}: {place}.id: {entry.get('id') if isinstance(entry, dict) else entry!r} is not in the catalogue"
            f" (see `rtds effects`){did_you_mean(name, effects_there) if isinstance(name, str) else ''}"
        )
    return effect


def _values_of(path: Path, place: str, entry: dict, effect: Effect, robot: Robot) -> dict[str, float]:
    """Values of an effect's parameters, as the model has them.

    Raises
    ------
    InputError : a parameter that is missing, unknown or beyond its bounds.
    """
    # What is a share of what runs show has no bound where no run is known.
    unknown = OF_RUNS | (OF_SPEEDS_MET | OF_ASKED if robot.driver.mode == "torque" else set())
    values = {}
    relative = {p.name: p for p in CATALOGUE[effect.id].parameters}
    given = entry.get("parameters") or {}
    if not isinstance(given, dict):
        raise InputError(f"{path}: {place}.parameters: is {given!r}, an object is needed")
    for former, (present, by) in effect.former.items():
        if former in given and by in given:
            numbers = [_number(path, f"{place}.parameters.{name}", _value(given[name])) for name in (former, by)]
            given = {**{name: one for name, one in given.items() if name != former}, present: math.prod(numbers)}
    parameters = {p.reported(robot.axis)[0] for p in effect.parameters}
    for name in given:
        if name not in parameters:
            raise InputError(
                f"{path}: {place}.parameters.{name}: is not a parameter of {effect.id} "
                f"(known: {', '.join(sorted(parameters))})"
            )
    for p in effect.parameters:
        name, unit, one = p.reported(robot.axis)
        if name not in given and p.optional:
            values[p.name] = p.null
            continue
        if name not in given:
            raise InputError(f"{path}: {place}.parameters.{name}: missing")
        written = _number(path, f"{place}.parameters.{name}", _value(given[name]))
        low, high = (
            (-math.inf if p.low < 0.0 else 0.0, math.inf)
            if relative[p.name].scale in unknown
            else (one * p.low, one * p.high)
        )
        value = inside(written, low, high)
        if value is None:
            raise InputError(
                f"{path}: {place}.parameters.{name}: is {written:g}, it must lie within {low:g} to {high:g} {unit}"
            )
        values[p.name] = value / one if one else p.null
    return values


def _value(entry: object) -> object:
    return entry.get("value") if isinstance(entry, dict) else entry


def _number(path: Path, place: str, value: object, positive: bool = False) -> float:
    number = math.nan
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        with contextlib.suppress(OverflowError):
            number = float(value)
    if not math.isfinite(number):
        raise InputError(f"{path}: {place}: is {str(value)[:40]!r}, a finite number is needed")
    if positive and number <= 0:
        raise InputError(f"{path}: {place}: is {number:g}, it must be above 0")
    return number


def check_body(model: Model, log: RunLog) -> None:
    """Whether the body has mass, and its equations of motion a positive inertia, with what a run carries.

    Raises
    ------
    InputError : it has not; a replay would accelerate it against its force.
    """
    if model.get("axis") > 0:
        return
    mass = model.get("mass") + log.meta.payload_kg
    if mass <= 0.0:
        raise InputError(
            f"{log.path or log.name}: with what the diagnosis adds to it the body has {mass:g} kg, no mass is left"
        )
    if model.get("yaw_inertia") <= mass * model.get("com_y") ** 2:
        raise InputError(
            f"{log.path or log.name}: a yaw inertia of {model.get('yaw_inertia'):g} kg·m² cannot be that of {mass:g} "
            f"kg at y = {model.get('com_y'):g} m away from the axle's mid-point"
        )


def carrying(model: Model, log: RunLog) -> Model:
    """The robot with what a run carries: a payload off the axle's mid-point adds the yaw inertia of its mass.

    The contract has a payload add none, since it sits on the nominal centre of mass. Off it, m y^2 of the whole mass
    must stay below the yaw inertia (parallel axes), which a diagnosis made with less payload knows nothing of. Where it
    does not, the payload's own share of m y^2 is added.
    """
    off = model.get("com_y") ** 2
    payload = log.meta.payload_kg
    if model.get("axis") > 0 or model.get("yaw_inertia") > (model.get("mass") + payload) * off:
        return model
    model = model.copy()
    model.add("yaw_inertia", payload * off)
    return model


def on_its_clock(case: Case, model: Model | None = None) -> tuple[Case, list[Finding]]:
    """The case at the times when its rows were taken, as a diagnosis takes them: a stamp that is off must not count
    against a prediction (`gate.stamps.evened`)."""
    return evened(case, effective_noise(case)[0], model=model)


def predicted_columns(log: RunLog, robot: Robot, model: Model | None = None) -> dict[str, np.ndarray]:
    """The columns of `predicted` alone, with its errors."""
    return predicted(log, robot, model)[0]


def predicted(log: RunLog, robot: Robot, model: Model | None = None) -> tuple[dict[str, np.ndarray], list[Finding]]:
    """Replay a run from its commands, at the times when its rows were taken (`on_its_clock`).

    Returns
    -------
    (columns, findings) : column -> (n,): `t`, the commands, and every channel of the contract's section 1 except
    `w_ref_*`, without noise, at the run's times, of a single axis the left side's alone; and what is said of the run's
    clock.

    Raises
    ------
    InputError : the model's body cannot exist (`check_body`).
    """
    model = carrying(model or nominal_model(robot), log)
    check_body(model, log)
    # A run must not start from what stood in its first rows before a sensor was awake.
    alone = Case(log.name, robot, (log,))
    clean, asleep = awake(alone, limits(alone))
    clocked, told = on_its_clock(clean, model)
    told = asleep + told
    out = replay_run(model, run_inputs(clocked.runs[0], robot), min(REPORT_STEP_S, model.step_s))
    columns = {"t": log.t}
    commands = ("w_cmd_l", "w_cmd_r") if robot.driver.mode == "speed" else ("v_cmd_l", "v_cmd_r")
    for name in commands:
        if name in log.columns and name[-1] in robot.sides:
            columns[name] = log.columns[name]
    for k, name in enumerate(OUTPUTS):
        if robot.axis is not None and (name.endswith("_r") or name in ("gyro_z", "x", "y", "yaw")):
            continue
        columns[name] = out[:, k]
    return columns, told
