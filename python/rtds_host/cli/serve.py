"""`rtds serve`: the motors of a robot on a socket."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rtds_host.cli.answer import AsJson, answer

app = typer.Typer(add_completion=False)


@app.command()
def serve(
    source: Annotated[
        str, typer.Argument(help="A diagnosis.json, a robot.toml, or the name of a robot in the package.")
    ],
    socket: Annotated[Path | None, typer.Option(help="Unix socket to make and listen on.")] = None,
    port: Annotated[
        int | None, typer.Option(help="Or a TCP port of this computer alone; 0: a free one.", min=0, max=65535)
    ] = None,
    robot: Annotated[Path | None, typer.Option(help="With a diagnosis: the nominal robot.toml.")] = None,
    link: Annotated[str, typer.Option(help="model, or rtl: the Verilog in Verilator.")] = "model",
    runs: Annotated[int, typer.Option(help="End after so many connections; 0: on Ctrl-C.", min=0)] = 0,
    as_json: AsJson = False,
) -> None:
    """Let another program step a robot's two motors. A connection is a run (docs/other-simulators.md)."""
    from rtds_host.errors import InputError, visible
    from rtds_host.link import open_link
    from rtds_host.native.serve import listener, serve_runs
    from rtds_host.native.source import source_of
    from rtds_host.native.words import motor_units

    if (socket is None) == (port is None):
        raise InputError("--socket, --port: give one of them")
    if link not in ("model", "rtl"):
        raise InputError(f"--link {link}: model and rtl can be served")
    found = source_of(source, robot)
    units = motor_units(found.model, found.robot)
    with listener(socket, port) as (listening, place):
        if as_json:
            answer({"robot": found.robot.name, "address": place, "step_s": units.parameters[6]})
        else:
            print(visible(f"{found.robot.name}: listening on {place}, steps of {units.parameters[6]:g} s"), flush=True)
        serve_runs(listening, lambda: open_link(link), units, runs)
