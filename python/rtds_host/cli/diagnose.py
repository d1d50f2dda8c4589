"""`rtds diagnose`: where the gap lies, which effect causes it, how far it shrinks."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from rtds_host.cli.answer import AsJson, Quiet, Seed, answer, say_if_seeded

app = typer.Typer(add_completion=False)


@app.command()
def diagnose(
    cases: Annotated[list[Path], typer.Argument(help="Case folders: robot.toml and one sub-folder per run.")],
    out: Annotated[
        Path,
        typer.Option(
            help="Folder for diagnosis.json and report.html; with several cases, "
            "one sub-folder per case, cases.parquet and index.html."
        ),
    ],
    quick: Annotated[
        bool,
        typer.Option(
            "--quick",
            help="A narrower search. Its limit of work is about half a minute, three times that without; most "
            "searches end earlier.",
        ),
    ] = False,
    jobs: Annotated[int, typer.Option(help="Cores to use; 0 = all.", min=0)] = 0,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Hand the cases to this Dask scheduler (tcp://host:8786).")
    ] = None,
    repeat: Annotated[
        bool,
        typer.Option(
            "--repeat",
            help="One case: also diagnose halves of the data; the report says how often each effect was found again.",
        ),
    ] = False,
    seed: Seed = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    mcap: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="One case: write measured, nominal and corrected channels side by side, for Foxglove or PlotJuggler.",
        ),
    ] = None,
) -> None:
    """Say where the gap between simulator and reality lies, and which effect causes it.

    With several cases, an interrupted call resumes where it stopped. The status is 1 if some failed; the others are
    complete.
    """
    from rtds_host.cli.first_use import say_if_first
    from rtds_host.contract import check_writable, check_writable_file, places_of_case, refuse_inputs
    from rtds_host.diagnosis.batch import FILES, run_many, run_one
    from rtds_host.errors import InputError

    check_writable(out)
    if repeat and (len(cases) > 1 or scheduler is not None):
        raise InputError("--repeat: takes one case, without --scheduler; give one case at a time")
    if mcap is not None:
        if len(cases) > 1 or scheduler is not None:
            raise InputError(
                f"--mcap {mcap}: takes one case, without --scheduler; `rtds predict --mcap` writes any run"
            )
        check_writable_file(mcap)
        refuse_inputs([mcap], [*places_of_case(cases[0]), *(out / name for name in FILES)])
    say_if_first(quiet)
    say_if_seeded(seed, quiet)
    if len(cases) == 1 and scheduler is None:
        result, details = run_one(
            cases[0], out, quick=quick, jobs=jobs, summary=not as_json, repeat=repeat, quiet=quiet
        )
        if as_json:
            answer({"folder": out, **result})
        if mcap is not None:
            from rtds_host.correction.close import model_of
            from rtds_host.diagnosis.predict import predicted_columns
            from rtds_host.export.mcap_compare import Compared, write_comparison

            case = details.case
            corrected = model_of(result, case.robot)
            write_comparison(
                mcap,
                [
                    Compared(
                        log,
                        {
                            "nominal": predicted_columns(log, case.robot),
                            "corrected": predicted_columns(log, case.robot, corrected),
                        },
                    )
                    for log in case.runs
                ],
            )
        return
    say = None if as_json else partial(print, flush=True)
    failed = run_many(cases, out, quick=quick, jobs=jobs, scheduler=scheduler, say=say, quiet=quiet)
    if as_json:
        from pyarrow.parquet import read_table

        answer({"folder": out, "cases": read_table(out / "cases.parquet").to_pylist()})
    if failed:
        raise typer.Exit(1)
