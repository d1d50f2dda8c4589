"""`rtds view`: runs to look at, in a browser on this machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rtds_host.cli.answer import AsJson, answer

app = typer.Typer(add_completion=False)


@app.command()
def view(
    runs: Annotated[list[Path], typer.Argument(help="Run folders, or case folders for all of their runs.")],
    robot: Annotated[
        Path | None,
        typer.Option(
            help="The nominal robot.toml. Default: the one in the run's folder or in its case, if there is one."
        ),
    ] = None,
    diagnosis: Annotated[
        Path | None, typer.Option(help="A diagnosis.json: the replay with it is drawn as well.")
    ] = None,
    port: Annotated[int, typer.Option(help="Port on 127.0.0.1; 0 takes one that is free.", min=0, max=65535)] = 0,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
    as_json: AsJson = False,
) -> None:
    """Show runs in a browser: path over the floor and signals, measured, nominal and corrected. Ctrl-C ends it."""
    from rtds_host.cli.first_use import say_if_first
    from rtds_host.view.command import recorded, serve
    from rtds_host.view.live import Feed

    say_if_first()
    say = (lambda address: answer({"address": address})) if as_json else None
    with serve(Feed(recorded(runs, robot, diagnosis)), port, browser, say) as wait:
        wait()
