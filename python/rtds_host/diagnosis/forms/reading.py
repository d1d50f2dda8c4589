"""Forms of a `diagnosis.json` put into a replay's model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rtds_host.contract import Robot
from rtds_host.diagnosis.effects import SIDES
from rtds_host.diagnosis.forms.curves import BODY, put, read
from rtds_host.diagnosis.replay.model import Model
from rtds_host.errors import InputError, did_you_mean
from rtds_host.plant import forms as plant


def apply_forms(model: Model, entries: object, path: Path, robot: Robot) -> None:
    """Put the forms of a diagnosis into a model, in place; `path`: the file, for messages.

    Raises
    ------
    InputError : no list, a term or quantity that the plant has not, a side, a curve that is no curve, too many.
    """
    if entries is None:
        return
    if not isinstance(entries, list):
        raise InputError(f"{path}: forms: is {entries!r}, a list is needed")
    for k, entry in enumerate(entries):
        place = f"forms[{k}]"
        if not isinstance(entry, dict):
            raise InputError(f"{path}: {place}: is {entry!r}, an object is needed")
        term = _known(path, f"{place}.term", entry.get("term"), list(plant.TERMS))
        over = _known(path, f"{place}.over", entry.get("over"), list(plant.OVERS))
        own = ["both"] if term in BODY else list(SIDES)
        side = _known(path, f"{place}.side", entry.get("side"), own if robot.axis is None else ["left"])
        if term in BODY and robot.axis is not None:
            raise InputError(f"{path}: {place}.term: {term} needs a body, and the robot is a single axis")
        low, high, values = read(_curve(path, f"{place}.curve", entry.get("curve")), over)
        tau = _time_constant(path, f"{place}.time_constant", entry.get("time_constant"), over)
        try:
            put(model, SIDES["both" if robot.axis is not None else side], term, over, low, high, values, tau)
        except ValueError as error:
            raise InputError(f"{path}: {place}: {error}") from None


def _known(path: Path, place: str, value: object, known: Sequence[str]) -> str:
    if not isinstance(value, str) or value not in known:
        hint = did_you_mean(value, known) if isinstance(value, str) else ""
        raise InputError(f"{path}: {place}: {value!r} must be one of {', '.join(known)}{hint}")
    return value


def _time_constant(path: Path, place: str, value: object, over: str) -> float:
    """The time constant of a form over the heat, s; 0 of others, which have none."""
    if over != "heat":
        return 0.0
    if not isinstance(value, int | float) or isinstance(value, bool) or not 0.0 < value < math.inf:
        raise InputError(f"{path}: {place}: is {value!r}, a form over the heat needs seconds above zero")
    return float(value)


def _curve(path: Path, place: str, points: object) -> np.ndarray:
    """A curve's points (n, 2)."""
    if not isinstance(points, list) or len(points) < 2:
        raise InputError(f"{path}: {place}: a list of at least two points is needed")
    found: list[list[float]] = []
    for k, point in enumerate(points):
        numbers = point[:2] if isinstance(point, list) and len(point) >= 2 else []
        if not numbers or not all(
            isinstance(n, int | float) and not isinstance(n, bool) and math.isfinite(n) for n in numbers
        ):
            raise InputError(f"{path}: {place}[{k}]: is {point!r}, [over, value, standard error] is needed")
        if found and numbers[0] <= found[-1][0]:
            raise InputError(f"{path}: {place}[{k}]: {numbers[0]:g} is not above {found[-1][0]:g}")
        found.append([float(n) for n in numbers])
    return np.array(found)
