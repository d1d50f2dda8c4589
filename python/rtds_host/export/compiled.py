"""`rtds export` to what is compiled: FMUs, and the C library with a robot's numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from rtds_host.contract import staged_folder, write_atomic
from rtds_host.correction.translate import places_of, translate
from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.forms.curves import named
from rtds_host.export import fmu
from rtds_host.export.export import Part, Source, comment_of, parts_of
from rtds_host.export.figures import figures_of
from rtds_host.export.table import LEFT_OUT, OWN
from rtds_host.native.library import SOURCES
from rtds_host.native.words import header, motor_units
from rtds_host.plant.forms import WIDTH
from rtds_host.plant.torques import TORQUES

# --to, and what it gives.
TARGETS = {
    "fmu": "the robot on a plane as an FMU",
    "fmu-motors": "its two motor units as an FMU",
    "c": "its two motor units as C sources",
}
LIBRARY = ("rtds_motor.h", "rtds_motor.c")
MOTORS = "motors.h"


def motor_parts(source: Source) -> list[Part]:
    """How the motor units have each effect and form: what acts elsewhere is left to the other simulator."""
    found = []
    between = translate(source.model, source.robot)
    elsewhere = {named(row) for rows in (between.forms, between.sensors.forms) for row in rows.reshape(-1, WIDTH)}
    for part in parts_of(source.content, source.robot, figures_of(source.model, source.robot), "python"):
        if part.form is not None:
            inside = part.form not in elsewhere
        else:
            inside = places_of(CATALOGUE[part.effect], source.robot) == {"rtl"}
        where = "parameters and tables of the motor units" if inside else "no parameter or table of the motor units"
        found.append(replace(part, kind=OWN if inside else LEFT_OUT, where=where))
    return found


def robot_parts(source: Source) -> list[Part]:
    """How the robot's FMU has each effect: it has the Python module's equations, of torques by angle the ripple."""
    others = {e.name for torque in TORQUES.values() for e in torque.entries if e.export not in fmu.TORQUES_IN_C}
    parts = parts_of(source.content, source.robot, figures_of(source.model, source.robot), "python")
    found = []
    for part in parts:
        kind, where = part.kind, "parameters" if part.kind == OWN else part.where
        if part.effect in CATALOGUE and CATALOGUE[part.effect].written(source.robot) & others:
            kind, where = LEFT_OUT, "its equation is not in the compiled robot; that of the motor units has it"
        found.append(replace(part, kind=kind, where=where))
    return found


def write(source: Source, target: str, out: Path) -> list[Part]:
    """Write a target of `TARGETS`: a file, of `c` a folder. Returns how each effect is in it.

    Raises
    ------
    InputError : a robot that cannot be exported. LinkError : no C compiler. OutputError : it cannot be written.
    """
    parts = robot_parts(source) if target == "fmu" else motor_parts(source)
    comment = comment_of(parts, source.name, source.robot, "python")
    name = fmu.identifier(source.robot.name)
    if target == "fmu":
        unit = fmu.robot(figures_of(source.model, source.robot), name, comment)
        write_atomic(out, fmu.build(unit))
        return parts
    units = motor_units(source.model, source.robot)
    if target == "fmu-motors":
        write_atomic(out, fmu.build(fmu.motors(units, f"{name}_motors", comment)))
        return parts
    with staged_folder(out) as scratch:
        for file in LIBRARY:
            (scratch / file).write_bytes((SOURCES / file).read_bytes())
        (scratch / MOTORS).write_text(header(units, comment), encoding="utf-8")
    return parts
