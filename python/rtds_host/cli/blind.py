"""`rtds blind`: make sealed cases, let the diagnoser answer, open the truth and score."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from rtds_host.cli.answer import AsJson, Quiet
from rtds_host.cli.answer import answer as say
from rtds_host.contract import check_writable, check_writable_file, refuse_inputs, write_atomic
from rtds_host.errors import InputError, visible

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    help="Check the diagnosis on cases whose cause is sealed until the answers are in.",
)
CORES = os.cpu_count() or 1
Folder = Annotated[Path, typer.Option("--out", "-o", help="Folder of the check.")]


@contextmanager
def _bar(title: str, quiet: bool) -> Iterator[Callable[[int, int], None]]:
    console = Console(stderr=True)
    columns = (TextColumn(title), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=quiet or not console.is_terminal) as progress:
        task = progress.add_task(title, total=None)
        yield lambda done, count: progress.update(task, completed=done, total=count)


@app.command()
def make(
    out: Folder,
    n: Annotated[
        int | None,
        typer.Option("--n", help="Number of cases (default 60); with --measured draws a data set (default 20)."),
    ] = None,
    measured: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="CASE",
            help="Plant changes in this case of measured data in place of simulating robots (repeatable).",
        ),
    ] = None,
    tier: Annotated[
        list[str] | None,
        typer.Option(
            help="Only these kinds of cases (repeatable, or with commas). "
            "many, messy, sizes, loggers and hard are drawn only where they "
            "are named."
        ),
    ] = None,
    world: Annotated[list[str] | None, typer.Option(help="Only these worlds: planar, mujoco (repeatable).")] = None,
    seed: Annotated[int | None, typer.Option(help="Default: drawn, and kept with the sealed truth.")] = None,
    jobs: Annotated[int, typer.Option(help="Processes.")] = CORES,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Draw cases, seal their truths and publish the seals."""
    from rtds_host.blind.measured import make_measured
    from rtds_host.blind.seal import make as make_cases

    check_writable(out)
    if measured and (tier or world):
        raise InputError("--measured: has neither tiers nor worlds")
    tier = [name.strip() for item in tier for name in item.split(",")] if tier else None
    with _bar("making cases", quiet) as report:
        seals = (
            make_measured(out, measured, n, seed, report)
            if measured
            else make_cases(out, 60 if n is None else n, tier, world, seed, jobs, report)
        )
    if as_json:
        say({"folder": out / "public", "seals": out / "public" / "SEALS.json", "cases": sorted(seals)})
        return
    Console().print(
        escape(visible(f"{len(seals)} cases in {out / 'public'}, sealed in {out / 'public' / 'SEALS.json'}"))
    )


@app.command()
def answer(
    out: Folder,
    quick: Annotated[bool, typer.Option("--quick", help="The diagnoser's quick mode.")] = False,
    jobs: Annotated[int, typer.Option(help="Cases at a time; they share the cores.")] = CORES,
    timeout: Annotated[float, typer.Option(help="Seconds for a case.")] = 600.0,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Hand the cases to this Dask scheduler (tcp://host:8786).")
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Let the diagnoser, as another process, answer every case that has no answer yet."""
    from rtds_host.blind.seal import answer as answer_cases

    check_writable(out)
    with _bar("diagnosing", quiet) as report:
        ledger = answer_cases(out, quick, jobs, timeout_s=timeout, progress=report, scheduler=scheduler)
    failed = [entry for entry in ledger if entry["sha256"] is None]
    if as_json:
        say({"ledger": out / "answers" / "LEDGER.jsonl", "cases": len(ledger), "answers": ledger})
    else:
        Console().print(
            escape(
                visible(
                    f"{len(ledger) - len(failed)} of {len(ledger)} cases answered, hashes in "
                    f"{out / 'answers' / 'LEDGER.jsonl'}"
                )
            )
        )
    for entry in failed:
        typer.echo(visible(f"{entry['case']}: exit status {entry['status']}: {entry['said']}"), err=True)
    if failed:
        raise typer.Exit(1)


@app.command()
def score(
    out: Folder,
    jobs: Annotated[int, typer.Option(help="Cases at a time.")] = CORES,
    page: Annotated[Path | None, typer.Option(help="Also write the page of figures (and its pictures) here.")] = None,
    closure: Annotated[bool, typer.Option(help="Measure closure on the held-out runs.")] = True,
    diagnoses: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Judge DIR/<case>/diagnosis.json in place of the sealed answers, into DIR/score."
        ),
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Open the truth, check every hash, and judge the answers."""
    from rtds_host.blind.measured import is_measured
    from rtds_host.blind.measured_score import score_measured
    from rtds_host.blind.score import FIGURES, PICTURES, POOLED, share_cell
    from rtds_host.blind.score import score as score_cases
    from rtds_host.blind.seal import read_seals

    check_writable(out)
    if page is not None:
        check_writable_file(page)
        read = [*(out / "public").rglob("*"), *(out / "sealed").rglob("*"), *(out / "answers").rglob("*")]
        read += [] if diagnoses is None else [diagnoses / "cases.parquet", *diagnoses.glob("*/diagnosis.json")]
        refuse_inputs([page, *(page.parent / name for name in PICTURES)], read)
    read_seals(out)
    if is_measured(out):
        if diagnoses:
            raise InputError("--diagnoses: not for draws on measured data, which are judged by their sealed answers")
        with _bar("scoring", quiet) as report:
            judged = score_measured(out, jobs, with_gap=closure, progress=report)
        text = (out / "score" / "page.md").read_text()
        if as_json:
            say(judged)
        else:
            typer.echo(text, nl=False)
        if page is not None:
            write_atomic(page, text)
        return
    with _bar("scoring", quiet) as report:
        result = score_cases(out, jobs, with_closure=closure, progress=report, diagnoses=diagnoses)
    folder = (diagnoses or out) / "score"
    if page is not None:
        write_atomic(page, (folder / "page.md").read_text())
        for name in PICTURES:
            source = folder / name
            if source.is_file():
                write_atomic(page.parent / name, source.read_bytes())
    if as_json:
        say(result)
        return
    console = Console()
    table = Table(title=f"{result['count']} sealed cases, seed {result['seed']}", title_justify="left")
    groups = {"all tiers": result["visible"], **result["tiers"]}
    table.add_column("")
    for name in groups:
        table.add_column(name)
    for name, title in FIGURES:
        table.add_row(title, *(share_cell(group[name]) for group in groups.values()))
    table.add_row(
        "closure, median",
        *("–" if g["closure"]["median"] is None else f"{g['closure']['median']:.2f}" for g in groups.values()),
    )
    table.add_row(
        "of what the known part can close",
        *("–" if g["of_closable"]["median"] is None else f"{g['of_closable']['median']:.2f}" for g in groups.values()),
    )
    for name, title in POOLED:
        table.add_row(title, *(share_cell(g[name]) for g in groups.values()))
    table.add_row(
        "time a case, median",
        *("–" if g["seconds_median"] is None else f"{g['seconds_median']:.0f} s" for g in groups.values()),
    )
    console.print(table)
    console.print(escape(visible(f"figures and pictures in {folder}")))
