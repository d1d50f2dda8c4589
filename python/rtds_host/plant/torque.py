"""What a torque by a wheel's angle or by its speed is, and one function of all of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from rtds_host.plant.entry import Entry

# What a torque depends on: the wheel's angle, rad, or the speed of the gear's output, rad/s.
ANGLE, SPEED = "angle", "speed"


@dataclass(frozen=True)
class Torque:
    """A torque on the wheel's side of the gear, N·m, forwards where it is positive.

    law : f(angle or speed, *parameters, sin), a law of the plant; of arithmetic, `abs` and the sine that is given, so
    that it takes arrays, too. entries : its parameters in this order. The first is its size: the torque is
    proportional to it, and 0 is none. over : ANGLE or SPEED. cycles, phase : of a torque over the angle, the parameters
    that are its periods a turn of the wheel and its phase, rad; it may have no phase.
    """

    law: Any
    entries: tuple[Entry, ...]
    over: str
    cycles: str = ""
    phase: str = ""

    @property
    def name(self) -> str:
        """The law's name."""
        return str(self.law.py_func.__name__)

    @property
    def size(self) -> str:
        """Its first parameter."""
        return self.entries[0].name

    def at(self, where: Any, numbers: Mapping[str, float], sin: Callable) -> Any:
        """The torque, N·m, at an angle or a speed or an array of them; numbers : its parameters by name."""
        return self.law.py_func(where, *(numbers[entry.name] for entry in self.entries), sin)


def summed(torques: Mapping[str, Torque], arguments: str, place: Callable[[Entry], str]) -> str:
    """Source of `shaped_torque(angle, speed, ..., sin)`, N·m, the sum of all torques, and of `present(...)`.

    arguments : what follows in both, as text; place : the expression, of these, that holds a parameter.
    """
    terms = [f"{t.name}({t.over}, {', '.join(place(entry) for entry in t.entries)}, sin)" for t in torques.values()]
    sizes = [f"{place(t.entries[0])} != 0.0" for t in torques.values()]
    return (
        f"def shaped_torque(angle, speed, {arguments}, sin):\n    return {' + '.join(terms)}\n\n\n"
        f"def present({arguments}):\n    return {' or '.join(sizes)}\n"
    )


def functions(
    torques: Mapping[str, Torque], arguments: str, place: Callable[[Entry], str], plain: bool = False
) -> tuple[Any, Any]:
    """The same as functions, for a compiled loop; `plain`: for Python."""
    found: dict[str, Any] = {t.name: t.law.py_func if plain else t.law for t in torques.values()}
    exec(summed(torques, arguments, place), found)
    return found["shaped_torque"], found["present"]
