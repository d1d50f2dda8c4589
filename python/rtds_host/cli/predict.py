"""`rtds predict`: replay a run from its commands, with or without a diagnosis."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rtds_host.cli.answer import AsJson, Quiet, answer

app = typer.Typer(add_completion=False)
# What the replay puts where its state leaves the finite numbers.
LOST = 1e6


@app.command()
def predict(
    run: Annotated[Path, typer.Argument(help="Run folder: run.json and log.csv or log.parquet.")],
    robot: Annotated[Path, typer.Option(help="The nominal robot.toml.")],
    out: Annotated[Path, typer.Option(help="The csv to write: t and every channel of the log format.")],
    diagnosis: Annotated[Path | None, typer.Option(help="A diagnosis.json to apply.")] = None,
    mcap: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write measured, nominal and, with --diagnosis, corrected channels "
            "side by side too, for Foxglove or PlotJuggler.",
        ),
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Replay a run from its commands, with or without a diagnosis."""
    import io
    import os
    import sys

    from rtds_host.cli.first_use import say_if_first
    from rtds_host.contract import check_writable_file, load_robot, places_of_run, read_run, refuse_inputs, write_atomic
    from rtds_host.contract.clock import moment
    from rtds_host.contract.runlog import COMMANDS
    from rtds_host.diagnosis.predict import predicted, predicted_columns, read_diagnosis
    from rtds_host.errors import OutputError, visible

    check_writable_file(out)
    if mcap is not None:
        check_writable_file(mcap)
    refuse_inputs([place for place in (out, mcap) if place is not None], [*places_of_run(run), robot, diagnosis])
    nominal = load_robot(robot)
    log = read_run(run, nominal)
    if mcap is not None and os.path.realpath(mcap) == os.path.realpath(out):
        raise OutputError(f"{mcap}: --out and --mcap name one file; choose another")
    say_if_first(quiet)
    columns, clock = predicted(log, nominal, read_diagnosis(diagnosis, nominal) if diagnosis else None)
    text = io.StringIO()
    names = list(columns)
    text.write(",".join(names) + "\n")
    # What the log gave is given back to the last digit: a reader may pair rows by their time.
    given = [name in ("t", *COMMANDS[nominal.driver.mode]) for name in names]
    for row in zip(*columns.values()):
        text.write(",".join(repr(float(value)) if exact else f"{value:.9g}" for exact, value in zip(given, row)) + "\n")
    write_atomic(out, text.getvalue())
    if mcap is not None:
        from rtds_host.export.mcap_compare import Compared, write_comparison

        replayed = (
            {"corrected": columns, "nominal": predicted_columns(log, nominal)} if diagnosis else {"nominal": columns}
        )
        write_comparison(mcap, [Compared(log, replayed)])
    notices = [*nominal.notices, *log.notices, *(f"{run}: {told.text}" for told in clock)]
    lost = (columns["w_l"] == LOST) & (columns["i_l"] == LOST)
    if lost.any():
        notices.append(
            f"{run}: from t = {moment(log.t[lost.argmax()])} s on the replay runs away beyond all bounds, its columns "
            f"hold {LOST:g}"
        )
    if as_json:
        answer({"file": out, "rows": len(log.t), "channels": names, "notices": notices})
        return
    for notice in notices:
        print(f"note: {visible(notice)}", file=sys.stderr)
