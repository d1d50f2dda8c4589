"""`rtds demo`: a diagnosis of example bags that come with the package."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rtds_host.cli.answer import AsJson, Quiet, answer

app = typer.Typer(add_completion=False)

BAGS = ("square.mcap", "spin.mcap", "wander.mcap")


def example_bags() -> list[Path]:
    """The example bags: in the installed package, or in the repository's `examples`.

    Raises
    ------
    InputError : neither place has them.
    """
    from rtds_host.errors import InputError

    package = Path(__file__).resolve().parents[1]
    for folder in (package / "examples", package.parents[1] / "examples"):
        found = [folder / name for name in BAGS]
        if all(path.is_file() for path in found):
            return found
    raise InputError(f"{package / 'examples'}: the example bags are missing; install the package again")


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="New folder for the case and the report.")] = Path("demo"),
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Import three bags of a TurtleBot3 with one fault, and diagnose them.

    Writes OUT/case and OUT/report/report.html. The fault is in examples/truth.json of the repository.
    """
    from rtds_host.cli.first_use import say_if_first
    from rtds_host.contract import check_writable
    from rtds_host.diagnosis.batch import run_one
    from rtds_host.errors import visible
    from rtds_host.importers.case import import_case

    bags = example_bags()
    check_writable(out)
    say_if_first(quiet)
    for run in import_case(bags, out / "case"):
        if not as_json:
            print(visible(f"{out / 'case' / run.name}: {len(run.imported.columns['t'])} rows"))
    found = run_one(out / "case", out / "report", quick=True, jobs=0, summary=not as_json, quiet=quiet)
    if as_json:
        answer({"case": out / "case", "report": out / "report" / "report.html", "diagnosis": found[0]})
        return
    print(visible(f"open {out / 'report' / 'report.html'}"))
