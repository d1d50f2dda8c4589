"""`rtds init`: a robot's file from a data sheet or a built-in robot, a draft mapping from a recording."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from rtds_host.cli.answer import AsJson, answer
from rtds_host.contract import builtin_robots

app = typer.Typer(add_completion=False)


@app.command()
def init(
    out: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder for robot.toml and, with --log, mapping.toml.")],
    like: Annotated[
        str | None, typer.Option(metavar="ROBOT", help=f"Copy a robot of the package: {', '.join(builtin_robots())}.")
    ] = None,
    log: Annotated[
        Path | None, typer.Option(metavar="BAG_OR_CSV", help="Draft a mapping for this recording, its guesses marked.")
    ] = None,
    mjcf: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Read one or two <dcmotor> and the masses of a MuJoCo model."),
    ] = None,
    motor: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="With --mjcf: the <dcmotor> to read; may be given twice."),
    ] = None,
    name: Annotated[str, typer.Option(help="Name of the robot.")] = "",
    voltage: Annotated[float | None, typer.Option(help="Supply voltage of the motors, V.")] = None,
    stall_current: Annotated[float | None, typer.Option(help="Stall current at that voltage, A.")] = None,
    stall_torque: Annotated[float | None, typer.Option(help="Stall torque at the gear's output, N·m.")] = None,
    no_load_rpm: Annotated[float | None, typer.Option(help="No-load speed at the gear's output, rpm.")] = None,
    no_load_current: Annotated[float | None, typer.Option(help="No-load current, A.")] = None,
    gear_ratio: Annotated[float | None, typer.Option(help="Motor turns for one turn of the output.")] = None,
    wheel_radius: Annotated[float | None, typer.Option(help="Wheel radius, m.")] = None,
    track_width: Annotated[float | None, typer.Option(help="Distance between the wheels' centres, m.")] = None,
    mass: Annotated[float | None, typer.Option(help="Mass of the whole robot, kg.")] = None,
    counts: Annotated[float | None, typer.Option(help="Encoder counts for one turn of the shaft it sits on.")] = None,
    encoder: Annotated[str | None, typer.Option(help="Where the encoder sits: motor, gear or wheel.")] = None,
    axis: Annotated[
        str | None,
        typer.Option(metavar="KIND", help="One motor in place of two wheels; its load: inertia, pendulum or linear."),
    ] = None,
    load_inertia: Annotated[
        float | None, typer.Option(help="axis inertia: inertia at the gear's output, kg·m².")
    ] = None,
    load_mass: Annotated[
        float | None, typer.Option(help="axis pendulum, linear: mass at the arm's end, or of the carriage, kg.")
    ] = None,
    arm_length: Annotated[
        float | None, typer.Option(help="axis pendulum: distance of the mass from the axis, m.")
    ] = None,
    travel: Annotated[
        float | None, typer.Option(help="axis linear: travel for one turn of the gear's output, m.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write a commented robot.toml for a robot of your own, and a draft mapping for its recordings.

    In a terminal it asks for missing values. In a script every value must be given. No file is overwritten.
    """
    from rtds_host.contract.robot import builtin_robot_path
    from rtds_host.errors import InputError, OutputError, visible
    from rtds_host.start.datasheet import option
    from rtds_host.start.draft import draft_mapping

    figures = {
        "voltage_v": voltage,
        "stall_current_a": stall_current,
        "no_load_rpm": no_load_rpm,
        "no_load_current_a": no_load_current,
        "stall_torque_nm": stall_torque,
        "gear_ratio": gear_ratio,
        "wheel_radius_m": wheel_radius,
        "track_width_m": track_width,
        "mass_kg": mass,
        "counts": counts,
        "load_inertia_kg_m2": load_inertia,
        "load_mass_kg": load_mass,
        "arm_length_m": arm_length,
        "travel_m": travel,
    }
    asked = any(value is not None for value in figures.values()) or encoder is not None or axis is not None
    if like is not None and asked:
        raise InputError(f"--like {like}: a built-in robot has its own figures; give one or the other")
    if motor and mjcf is None:
        raise InputError(f"--motor {motor[0]}: only with --mjcf")
    alone = [key for key, given in (("axis", axis), ("encoder", encoder)) if given is not None]
    if mjcf is not None and (like is not None or alone or _not_of_model(figures)):
        which = "--like" if like is not None else option((_not_of_model(figures) or alone)[0])
        raise InputError(f"--mjcf {mjcf}: goes without {which}, the model has its own figures")
    for file in ("robot.toml", "mapping.toml", *(("effects.json",) if mjcf is not None else ())):
        if (out / file).exists():
            raise OutputError(f"{out / file}: already exists; choose another folder")
    texts: dict[str, str] = {}
    lost: list[str] = []
    if like is not None:
        texts["robot.toml"] = builtin_robot_path(like).read_text(encoding="utf-8")
    elif mjcf is not None:
        made, lost = _from_mjcf(mjcf, figures, name or out.resolve().name, motor or [])
        texts |= made
    elif asked or log is None:
        texts["robot.toml"] = _from_sheet(figures, encoder, name or out.resolve().name, axis)
    if log is not None:
        texts["mapping.toml"] = draft_mapping(log)
    out.mkdir(parents=True, exist_ok=True)
    from rtds_host.contract import write_atomic

    for file, text in texts.items():
        write_atomic(out / file, text)
    if as_json:
        answer({"folder": out, "files": [out / file for file in texts], "not_read": lost})
        return
    for line in lost:
        print(visible(f"not read: {line}"))
    for file in texts:
        print(visible(f"written: {out / file}"))
    if "effects.json" in texts:
        print(
            visible(f"effects.json holds what robot.toml has no place for: rtds export {out / 'effects.json'} --to ...")
        )
    if "mapping.toml" in texts:
        robot = out / "robot.toml" if "robot.toml" in texts else Path("robot.toml")
        print("Look at each line that says `guess`, then:")
        print(visible(f"rtds import {log} --mapping {out / 'mapping.toml'} --robot {robot} --out case"))


OF_MODEL = ("voltage_v", "wheel_radius_m", "track_width_m", "mass_kg")


def _not_of_model(figures: dict[str, float | None]) -> list[str]:
    """Given figures that a MuJoCo model says itself."""
    return [key for key, value in figures.items() if value is not None and key not in OF_MODEL]


def _from_mjcf(
    path: Path, figures: dict[str, float | None], name: str, motors: list[str]
) -> tuple[dict[str, str], list[str]]:
    import json

    from rtds_host.start.mjcf import check, diagnosis_of, read_mjcf

    found = read_mjcf(path, name, motors, figures)
    check(path, found)
    texts = {"robot.toml": found.text}
    if found.effects:
        texts["effects.json"] = json.dumps(diagnosis_of(found.effects), indent=1) + "\n"
    return texts, list(found.lost)


def _from_sheet(figures: dict[str, float | None], encoder: str | None, name: str, axis: str | None) -> str:
    from rtds_host.errors import InputError
    from rtds_host.start.datasheet import ENCODERS, AxisSheet, Sheet, axis_text, figures_of, option, robot_text

    wanted = figures_of(axis)
    useless = [option(key) for key, value in figures.items() if value is not None and key not in wanted]
    if useless:
        what = f"--axis {axis}" if axis else "a robot on two wheels (--axis says what else)"
        raise InputError(f"{', '.join(useless)}: has no meaning for {what}")
    answers = {key: figures[key] for key in wanted}
    if sys.stdin.isatty():
        for key, (text, _, _) in wanted.items():
            if answers[key] is None:
                optional = key == "stall_torque_nm"
                said = typer.prompt(text, default="" if optional else None, show_default=False, err=True)
                answers[key] = _number(option(key), str(said)) if str(said).strip() else None
        if encoder is None:
            encoder = str(typer.prompt(f"Where the encoder sits ({', '.join(ENCODERS)})", default="motor", err=True))
    missing = [option(key) for key, value in answers.items() if value is None and key != "stall_torque_nm"]
    if missing:
        raise InputError(f"{', '.join(missing)}: missing; or --like ROBOT, or run it in a terminal, which asks")
    if axis is not None:
        return axis_text(AxisSheet(name=name, kind=axis, encoder=encoder or "motor", **answers))  # type: ignore[arg-type]
    return robot_text(Sheet(name=name, encoder=encoder or "motor", **answers))  # type: ignore[arg-type]


def _number(place: str, text: str) -> float:
    from rtds_host.errors import InputError, shown

    try:
        return float(text.replace(",", "."))
    except ValueError as error:
        raise InputError(f"{place}: {shown(text)} is not a number") from error
