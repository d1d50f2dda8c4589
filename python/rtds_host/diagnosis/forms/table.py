"""A table of diagnoses with and without forms: gaps on runs left out, what is named, and processor time.

python -m rtds_host.diagnosis.forms.table CASE... --out said --quick

A case whose diagnosis is in the folder already is not diagnosed again.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from rtds_host.contract import read_case, write_atomic
from rtds_host.contract.runlog import read_json
from rtds_host.diagnosis.diagnose import diagnose
from rtds_host.diagnosis.report.words import form_name, listed_name, number
from rtds_host.errors import RtdsError

HEAD = ("case", "nominal", "with effects", "with forms", "named", "forms", "processor, s")
SPENT = "processor_s.json"


def diagnosed(case: Path, out: Path, quick: bool) -> tuple[dict[str, Any], float]:
    """A case's diagnosis and the processor time, s, that it took; both are kept in a folder.

    Raises
    ------
    InputError : the case cannot be diagnosed, or the folder holds no diagnosis of this program.
    """
    if (out / SPENT).exists():
        kept: Any = read_json(out / "diagnosis.json")
        spent_before: Any = read_json(out / SPENT)
        return kept, float(spent_before)
    began = time.process_time()
    diagnosis, _ = diagnose(read_case(case), quick)
    spent = time.process_time() - began
    out.mkdir(parents=True, exist_ok=True)
    write_atomic(out / "diagnosis.json", json.dumps(diagnosis, indent=1) + "\n")
    # The time comes last: without it a case counts as not diagnosed.
    write_atomic(out / SPENT, f"{spent:.1f}\n")
    return diagnosis, spent


def row(name: str, diagnosis: dict[str, Any], spent: float) -> tuple[str, ...]:
    """Cells of a case's row, in the order of `HEAD`."""
    gap = diagnosis["gap"]
    formed = gap.get("with_forms")
    return (
        name,
        number(gap["before"]),
        number(gap["after"]),
        "none found" if formed is None else number(formed),
        "; ".join(listed_name(effect) for effect in diagnosis["effects"]) or "nothing",
        "; ".join(form_name(form) for form in diagnosis["forms"]) or "none",
        f"{spent:.0f}",
    )


def written(rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [HEAD, ("---",) * len(HEAD), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def main(
    cases: Annotated[list[Path], typer.Argument(help="Case folders.")],
    out: Annotated[Path, typer.Option(help="Folder for the diagnoses, a sub-folder a case.")],
    quick: Annotated[bool, typer.Option(help="The narrow search.")] = False,
) -> None:
    """Diagnose cases and print their gaps with effects and with forms."""
    try:
        rows = []
        for case in cases:
            rows.append(row(case.name, *diagnosed(case, out / case.name, quick)))
            print(f"{case.name} done", file=sys.stderr)
    except RtdsError as error:
        print("rtds: " + " ".join(str(error).split()), file=sys.stderr)
        raise typer.Exit(2) from error
    print(written(rows))


if __name__ == "__main__":
    typer.run(main)
