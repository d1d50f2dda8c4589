"""`rtds webots`: a project folder for Webots."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from rtds_host.cli.answer import AsJson, answer

app = typer.Typer(add_completion=False)


@app.command()
def webots(
    out: Annotated[Path, typer.Option(help="Folder of the project to write.")],
    scenario: Annotated[
        list[str] | None, typer.Argument(help="Scenarios, one world each. Default: linear, circle, eight.")
    ] = None,
    robot: Annotated[str, typer.Option(help="Name of a built-in robot, or the path of a robot.toml.")] = "burger",
    scaled: Annotated[
        bool, typer.Option("--scaled", help="Lengths, payload and duration for a robot of this one's size.")
    ] = False,
    link: Annotated[str, typer.Option(help="What computes the motors: rtl, model, chip, ad2 or hps.")] = "rtl",
    sim: Annotated[str, typer.Option(help="Simulator of the RTL: verilator or icarus.")] = "verilator",
    step_clocks: Annotated[str, typer.Option(help="Clocks of the RTL from step to step: a number, or min.")] = "min",
    calibration: Annotated[Path | None, typer.Option(help="chip, ad2: file of `rtds calibrate`.")] = None,
    ad2: Annotated[list[str] | None, typer.Option(help="ad2: serial numbers of both devices; give it twice.")] = None,
    serial: Annotated[str, typer.Option(help="ad2: serial port of the chip's registers.")] = "",
    controller: Annotated[str, typer.Option(help="exact or paper.")] = "exact",
    coupling: Annotated[
        str, typer.Option(help="closed: the wheels follow the motor units; paper: they follow the reference.")
    ] = "closed",
    effects: Annotated[Path | None, typer.Option(help="A diagnosis.json: the robot it describes.")] = None,
    effect: Annotated[
        list[str] | None, typer.Option(help="An effect of the catalogue, as for `rtds run`; may be repeated.")
    ] = None,
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="A parameter of the scenarios, name=number; may be repeated.")
    ] = None,
    time_step: Annotated[int, typer.Option(help="Webots' basicTimeStep, ms.")] = 1,
    against: Annotated[
        str | None, typer.Option(help="Drive once more in pybullet or mujoco and print how far apart both end.")
    ] = None,
    quit_after: Annotated[bool, typer.Option("--quit", help="End Webots after a run, for runs in a batch.")] = False,
    python: Annotated[
        Path | None, typer.Option(help="Python that Webots starts the controller with. Default: this one.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write worlds and a controller for Webots, in which the motor units turn the wheels (docs/webots.md)."""
    from rtds_host.contract import check_writable, refuse_inputs
    from rtds_host.errors import visible
    from rtds_host.robot import check_engine
    from rtds_host.run.plan import robot_path
    from rtds_host.webots.project import PAPER, Settings, write_project

    if against is not None:
        check_engine(against, "--against")
    check_writable(out)
    source = robot_path(robot)
    refuse_inputs([out / "robot.toml"], [source])
    settings = Settings(
        link=link,
        sim=sim,
        step_clocks=step_clocks,
        calibration=None if calibration is None else str(calibration),
        ad2=tuple(ad2 or ()),
        serial=serial,
        controller=controller,
        coupling=coupling,
        scaled=scaled,
        setting=tuple(setting or ()),
        diagnosis=None if effects is None else str(effects),
        effect=tuple(effect or ()),
        time_step_ms=time_step,
        against=against,
        quit=quit_after,
    )
    worlds = write_project(out, settings, source, str(python or sys.executable), scenario or PAPER)
    if as_json:
        answer({"folder": out, "worlds": [out / world for world in worlds]})
        return
    for world in worlds:
        print(visible(str(out / world)))
