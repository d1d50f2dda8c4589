"""A diagnosis written for another simulator, and the list of what that simulator cannot express."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rtds_host import __version__
from rtds_host.contract import Robot
from rtds_host.contract.runlog import read_object
from rtds_host.diagnosis.effects import catalogue
from rtds_host.diagnosis.predict import read_diagnosis
from rtds_host.diagnosis.replay.model import Model
from rtds_host.errors import InputError, did_you_mean, visible
from rtds_host.export import mjcf, python, sdf, urdf, usd
from rtds_host.export.figures import Figures, figures_of
from rtds_host.export.forms import FORMS, lines_of
from rtds_host.export.table import AS_NUMBER, BEHIND_SERVO, DCMOTOR, LEFT_OUT, OWN, SERVO, TABLE, TARGETS, How

WRITERS: dict[str, Callable[[Figures, str], str]] = {
    "mjcf": mjcf.write,
    "urdf": urdf.write,
    "sdf": sdf.write,
    "usd-json": usd.write,
    "python": python.write,
}
# Targets that `rtds_host.export.compiled` writes.
COMPILED = ("fmu", "fmu-motors", "c")
ENDINGS = {"mjcf": ".xml", "urdf": ".urdf", "sdf": ".sdf", "usd-json": ".json", "python": ".py"}


@dataclass(frozen=True)
class Part:
    """One effect of a diagnosis in a target: `effect` and `side` as the diagnosis names them, `values` by parameter,
    `kind` and `where` as of `rtds_host.export.table.How`. `form`: term and quantity of a form."""

    effect: str
    side: str
    values: dict[str, float]
    kind: str
    where: str
    form: tuple[str, str] | None = None

    @property
    def text(self) -> str:
        """The effect with its values, as a line."""
        sizes = ", ".join(f"{name} = {value:.5g}" for name, value in self.values.items())
        return f"{self.effect} ({self.side}) {sizes}".rstrip()


def check_target(target: str, actuator: str = "general") -> None:
    """Whether there is such a target, with such an actuator.

    Raises
    ------
    InputError : there is none.
    """
    if target not in TARGETS:
        every = [*TARGETS, *COMPILED]
        raise InputError(f"--to {target}: unknown (known: {', '.join(every)}){did_you_mean(target, every)}")
    known = mjcf.ACTUATORS
    if actuator not in known:
        raise InputError(f"--actuator {actuator}: unknown (known: {', '.join(known)}){did_you_mean(actuator, known)}")
    if actuator != "general" and target != "mjcf":
        raise InputError(f"--actuator {actuator}: only with --to mjcf")


def parts_of(diagnosis: dict, robot: Robot, figures: Figures, target: str, actuator: str = "general") -> list[Part]:
    """How a target has each effect of a diagnosis of a robot; figures : the robot's with these effects; actuator : of
    MJCF."""
    special: dict[str, How] = dict(BEHIND_SERVO[target]) if figures.loop is not None else {}
    if target == "mjcf":
        special |= DCMOTOR if actuator == "dcmotor" else {}
        # What an effect writes of the plant is what this target may not hold.
        excepted = mjcf.exceptions(figures, actuator)
        special |= {
            name: excepted[parameter]
            for name, effect in catalogue(robot).items()
            for parameter in effect.written(robot)
            if parameter in excepted
        }
    found = []
    for entry in diagnosis.get("effects") or []:
        values = {
            name: float(p["value"] if isinstance(p, dict) else p) for name, p in (entry.get("parameters") or {}).items()
        }
        how = special.get(entry["id"], TABLE[entry["id"]][target])
        where = f"{how.where} ({how.needs})" if how.needs and actuator == "general" else how.where
        found.append(Part(entry["id"], entry["side"], values, how.kind, where))
    for form in diagnosis.get("forms") or []:
        law = f" = {form['formula']}" if form.get("formula") else ""
        values = {name: float(p["value"]) for name, p in (form.get("parameters") or {}).items()}
        how, name = FORMS[target], (form["term"], form["over"])
        found.append(Part(f"{name[0]} over {name[1]}{law}", form["side"], values, how.kind, how.where, name))
    return found


TITLES = {
    OWN: "in the file, and it acts there",
    AS_NUMBER: "in the file as numbers, for whoever feeds commands and reads sensors",
    LEFT_OUT: "not expressible, left out",
}


def said_of_driver(robot: Robot, target: str) -> list[str]:
    """What a target's robot is driven by, where that is not plain volts of a steady supply: lines."""
    lines = []
    if robot.driver.mode == "speed":
        how, body = SERVO[target], robot.wheeled
        there = "acts there" if how.kind == OWN else "is in the file for whoever drives it"
        lines.append(f"Driven by wheel speeds, rad/s, through the servo's loop, which {there}: {how.where}.")
        lines.append(
            f"The robot's firmware makes them of a twist v, u by its nominal sizes: (v - u b/2)/r left, (v + u b/2)/r "
            f"right, r = {body.wheel_radius_m:g} m, b = {body.track_width_m:g} m."
        )
    if robot.driver.bus == "measured":
        lines.append(f"The runs' measured bus is not in it: the supply holds {robot.supply_v:g} V.")
    return lines


DCMOTOR_SAYS = (
    "Each motor is a <dcmotor>, values at its shaft. Where Km and Kb differ or the driver has a gain, its constant and "
    "resistance are those of a motor that is the same to its wheel; an activation times current_per_activation is its "
    "current in ampere. The Python module that was written along has what acts before the motors and behind the "
    "sensors."
)


def comment_of(
    parts: list[Part],
    source: str,
    robot: Robot,
    target: str,
    actuator: str = "general",
    forms: list[dict] | None = None,
) -> str:
    """The head of a file: where it comes from, what is and is not in it, and tables of `forms`. No double hyphen, which
    ends an XML comment.
    """
    lines = [
        f"{robot.name}, by rtds {__version__} export of {source}. SI units; the x axis points forward.",
        *said_of_driver(robot, target),
        *([DCMOTOR_SAYS] if actuator == "dcmotor" else []),
    ]
    for kind, title in TITLES.items():
        mine = [part for part in parts if part.kind == kind]
        if mine:
            lines.append(f"{title[0].upper()}{title[1:]}:")
            lines += [f"  {part.text}: {part.where}" for part in mine]
    if not parts:
        lines.append("No effect is in it.")
    if forms and target in ("urdf", "sdf"):
        lines += ["Tables of terms without a name, [over, value]:", *lines_of(forms)]
    text = "\n".join(visible(line) for line in lines)
    while "--" in text:
        text = text.replace("--", "- -")
    return text + "\n"


@dataclass(frozen=True)
class Source:
    """A diagnosis that was read: `content`, the `model` it makes of a nominal robot, and the `name` of its file."""

    content: dict
    model: Model
    robot: Robot
    name: str


def read_source(path: Path, robot: Robot) -> Source:
    """A diagnosis for a robot.

    Raises
    ------
    InputError : see `read_diagnosis`.
    """
    model = read_diagnosis(path, robot)
    return Source(read_object(path), model, robot, path.name)


def export(source: Source, target: str, actuator: str = "general") -> tuple[str, list[Part]]:
    """The file's text, and how each effect is in it. `actuator`: what MJCF's motors are, one of `mjcf.ACTUATORS`.

    Raises
    ------
    InputError : unknown target or actuator, or a robot that cannot be exported.
    """
    check_target(target, actuator)
    figures = figures_of(source.model, source.robot)
    parts = parts_of(source.content, source.robot, figures, target, actuator)
    comment = comment_of(parts, source.name, source.robot, target, actuator, source.content.get("forms"))
    if target == "mjcf":
        return mjcf.write(figures, comment, actuator), parts
    return WRITERS[target](figures, comment), parts


def default_robot(diagnosis: Path) -> Path:
    """The `robot.toml` next to a diagnosis or in the folder above.

    Raises
    ------
    InputError : there is none, or no such diagnosis.
    """
    if not diagnosis.exists():
        raise InputError(f"{diagnosis}: no such file")
    for folder in (diagnosis.parent, diagnosis.parent.parent):
        if (folder / "robot.toml").is_file():
            return folder / "robot.toml"
    raise InputError(
        f"{diagnosis}: there is no robot.toml in the same folder or the one above; name the nominal robot by --robot"
    )
