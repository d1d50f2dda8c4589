"""`rtds diff`: how two diagnoses differ."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rtds_host.cli.answer import AsJson, answer

app = typer.Typer(add_completion=False)


@app.command()
def diff(
    first: Annotated[Path, typer.Argument(help="A diagnosis.json, or the folder it lies in.")],
    second: Annotated[Path, typer.Argument(help="Another one.")],
    as_json: AsJson = False,
    html: Annotated[Path | None, typer.Option(metavar="FILE", help="Write it as a page, too.")] = None,
) -> None:
    """Compare two diagnoses: verdicts, gaps, and whether each cause appeared, disappeared or changed in size."""
    from rtds_host.contract import check_writable_file, refuse_inputs, write_atomic
    from rtds_host.diagnosis.differ import compare, label, lines, page, read
    from rtds_host.errors import visible

    if html is not None:
        check_writable_file(html)
        refuse_inputs([html], [place for one in (first, second) for place in (one, one / "diagnosis.json")])
    found = compare(read(first), read(second))
    names = (label(first), label(second))
    if html is not None:
        write_atomic(html, page(found, names))
    if as_json:
        answer(found)
    else:
        print("\n".join(visible(line) for line in lines(found, names)))
