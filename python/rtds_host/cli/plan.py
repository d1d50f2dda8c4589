"""`rtds plan`: the run that would tell, for a robot and a floor."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Annotated

import typer

from rtds_host.cli.answer import AsJson, answer

app = typer.Typer(add_completion=False)
# Rows of the table on the terminal; the csv has all.
SHOWN = 40


@app.command()
def plan(
    source: Annotated[Path, typer.Argument(metavar="SOURCE", help="A diagnosis.json, or a robot.toml.")],
    out: Annotated[Path, typer.Option(help="Folder for commands.csv, drive.py (ROS 2) and plan.json.")],
    robot: Annotated[
        Path | None,
        typer.Option(help="The nominal robot.toml of a diagnosis. Default: next to it, or in the folder above."),
    ] = None,
    floor: Annotated[str, typer.Option(metavar="WxD", help="Free floor, m.")] = "3x3",
    margin: Annotated[
        float, typer.Option(help="Distance to keep clear around the axle's mid-point, m.", min=0.0)
    ] = 0.25,
    speed: Annotated[
        float | None, typer.Option(help="The robot's highest allowed speed, m/s. Default: what its motors reach.")
    ] = None,
    kind: Annotated[
        str | None, typer.Option("--as", help="voltage (each wheel) or cmd_vel. Default: what robot.toml is driven by.")
    ] = None,
    scenario: Annotated[
        str | None, typer.Option(help="This manoeuvre (`rtds run --list`), not the most informative one.")
    ] = None,
    payload: Annotated[float | None, typer.Option(help="Payload, kg. Default: the manoeuvre's.", min=0.0)] = None,
    as_json: AsJson = False,
) -> None:
    """Plan the most informative manoeuvre: commands as a table, csv and a ROS 2 script, fitted to a floor."""
    from rtds_host.cli.first_use import say_if_first
    from rtds_host.contract import check_writable, load_robot, refuse_inputs, staged_folder
    from rtds_host.diagnosis.predict import read_diagnosis
    from rtds_host.diagnosis.replay.model import nominal_model
    from rtds_host.errors import InputError, did_you_mean
    from rtds_host.export.export import default_robot
    from rtds_host.plan.make import KINDS, Floor, check_robot, choose, driven_by_voltage, fit
    from rtds_host.plan.write import FILES, summary, write
    from rtds_host.scenario import find_scenario

    check_writable(out)
    refuse_inputs([out / name for name in FILES], [source, robot])
    if kind is not None and kind not in KINDS:
        raise InputError(f"--as {kind}: unknown (known: {', '.join(KINDS)}){did_you_mean(kind, KINDS)}")
    room = Floor(*_floor(floor), margin)
    if speed is not None and not speed > 0.0:
        raise InputError(f"--speed {speed:g}: it must be above 0")
    diagnosed = source.suffix != ".toml"
    if not diagnosed and robot is not None:
        raise InputError(f"--robot {robot}: {source} is a robot itself")
    nominal = load_robot(robot or default_robot(source)) if diagnosed else load_robot(source)
    kind = kind or ("cmd_vel" if nominal.driver.mode == "speed" else "voltage")
    check_robot(nominal, kind)
    say_if_first()
    model = read_diagnosis(source, nominal) if diagnosed else None
    wheels = driven_by_voltage(nominal)
    models = [nominal_model(wheels)]
    if model is not None and nominal.driver.mode == "voltage":
        models.append(model)
    name, load, why = _wanted(source) if diagnosed else ("", None, "")
    if scenario is not None:
        name, load, why = scenario, None, "asked for"
    limit = math.inf if speed is None else speed
    if name:
        chosen = find_scenario(name)
        load = payload if payload is not None else load if load is not None else chosen.payload_kg
        made = fit(chosen, wheels, kind, room, models, load, limit)
    else:
        made = choose(wheels, kind, room, models, limit)
        why = "of the menu, the one on which the fewest effects of the catalogue look alike"
    with staged_folder(out) as scratch:
        write(made, scratch, why)
    if as_json:
        answer({"folder": out, "files": FILES, **summary(made, why)})
        return
    _show(made, wheels, why, out)


def _floor(text: str) -> tuple[float, float]:
    from rtds_host.errors import InputError

    found = re.fullmatch(r"\s*([0-9.]+)\s*[xX*×]\s*([0-9.]+)\s*m?\s*", text)
    try:
        sides = (float(found[1]), float(found[2])) if found else (0.0, 0.0)
    except ValueError:
        sides = (0.0, 0.0)
    if not all(0.0 < side <= 1e4 for side in sides):
        raise InputError(f"--floor {text}: width and depth in metres are needed, as in --floor 3x3")
    return sides


def _wanted(source: Path) -> tuple[str, float | None, str]:
    """Scenario, payload and reason of a diagnosis' next experiment; where nothing is left to tell, a run to judge it
    on.
    """
    from rtds_host.contract.runlog import read_json
    from rtds_host.errors import InputError

    content = read_json(source)
    wanted = content.get("next_experiment") if isinstance(content, dict) else None
    if not wanted:
        return "teleop", None, "the diagnosis leaves nothing open; this is a run to judge it on"
    words = str(wanted.get("scenario", "")).split() if isinstance(wanted, dict) else []
    if len(words) not in (1, 3) or len(words) == 3 and words[1] != "--payload":
        raise InputError(f"{source}: next_experiment.scenario: is {' '.join(words)!r}, a scenario is needed")
    try:
        payload = float(words[2]) if len(words) == 3 else None
    except ValueError as error:
        raise InputError(f"{source}: next_experiment.scenario: payload {words[2]!r} is not a number") from error
    apart = ", ".join(f"{e['id']} ({e['side']})" for e in wanted.get("separates") or [])
    return words[0], payload, str(wanted.get("why") or f"distinguishes {apart}")


def _show(made, robot, why: str, out: Path) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from rtds_host.errors import visible
    from rtds_host.plan.make import alike_pairs

    console = Console(highlight=False)
    seen, alike, pairs = alike_pairs(made, robot)
    x, y, yaw = made.start
    ground = (
        "level ground"
        if not made.scenario.slope_rad
        else (f"a slope of {made.scenario.slope_rad:g} rad that climbs towards {math.degrees(made.uphill) % 360:.0f}°")
    )
    floor, tops = made.floor, made.tops
    lines = [f"{made.scenario.name}: {made.scenario.about}", f"  why      {why}"]
    lines.append(
        f"  size     {made.scale:.2f} of the menu's; {made.commands.duration_s:.1f} s, payload {made.payload_kg:g} kg,"
        f" {ground}"
    )
    lines.append(
        f"  floor    {floor.width_m:g} x {floor.depth_m:g} m, {floor.margin_m:g} m clear: start at x = {x:.2f} m, "
        f"y = {y:.2f} m from its corner, heading {math.degrees(yaw):.0f}° from its width"
    )
    lines.append(
        f"  replayed covers {made.extent_m[0]:.2f} x {made.extent_m[1]:.2f} m; at most {tops['voltage_v']:.3g} V, "
        f"{tops['forward_m_s']:.3g} m/s, {tops['turn_rad_s']:.3g} rad/s"
    )
    lines.append(f"  shows    {seen} effects of the catalogue, {alike} of {pairs} pairs of them look alike")
    for line in lines:
        console.print(Text(visible(line)))
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    units = ("left, V", "right, V") if made.kind == "voltage" else ("forward, m/s", "turn, rad/s")
    for title in ("  from, s", "to, s", *units):
        table.add_column(title, justify="right")
    pieces = made.commands.pieces()
    for begin, end, first, last in pieces[:SHOWN]:
        table.add_row(
            f"{begin:.2f}",
            f"{end:.2f}",
            *(f"{a:.3f}" if a == b else f"{a:.3f} to {b:.3f}" for a, b in zip(first, last, strict=True)),
        )
    console.print(table)
    if len(pieces) > SHOWN:
        console.print(f"  and {len(pieces) - SHOWN} rows more")
    console.print(Text(visible(f"written to {out}: commands.csv, drive.py (ROS 2), plan.json")))
