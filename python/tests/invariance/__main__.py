"""Run the table of transformations on cases, or on ten kinds of them that are made for it:

PYTHONPATH=python/tests:python/tests/diagnosis python -m invariance [CASE…]
"""

from __future__ import annotations

import argparse
import functools
from pathlib import Path

from invariance.compare import differences
from invariance.kinds import KINDS
from invariance.transform import TABLE
from rtds_host.contract import Case, read_case
from rtds_host.diagnosis.diagnose import diagnose
from rtds_host.errors import InputError


def cells(case: Case, quick: bool, threads: int, only: str = ""):
    """Name and verdict of each cell of a case: "same", "-" where there is nothing to change, or what differs."""
    base, _ = diagnose(case, quick=quick, threads=threads)
    yield (
        "as it is",
        f"{base['verdict']}: " + (", ".join(f"{e['id']} {e['side']}" for e in base["effects"]) or "-"),
        True,
    )
    for change in TABLE:
        if only not in change.name:
            continue
        other = change.apply(case)
        if other is None:
            yield change.name, "-", True
            continue
        try:
            found = differences(base, diagnose(other, quick=quick, threads=threads)[0], change)
        except InputError as error:
            found = [f"refused: {error}"]
        yield change.name, "; ".join(found) or ("same" if change.same else "nothing else"), not found


def main() -> None:
    """Print a line a cell, and how many are as they should be."""
    parser = argparse.ArgumentParser(prog="python -m invariance", description=__doc__.partition("\n")[0])
    parser.add_argument("cases", type=Path, nargs="*", help="case folders, or folders of them; none: ten that are made")
    parser.add_argument("--only", default="", help="transformations whose name holds this text")
    parser.add_argument("--kind", default="", help="of those that are made, the ones whose name holds this text")
    parser.add_argument("--full", action="store_true", help="the full search in place of the quick one")
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    folders = [
        f
        for given in args.cases
        for f in (
            [given]
            if (given / "robot.toml").is_file()
            else sorted(p for p in given.iterdir() if (p / "robot.toml").is_file())
        )
    ]
    made = {name: make for name, make in KINDS.items() if not folders and args.kind in name}
    good = total = 0
    print("| case | transformation | cell | as it should be |\n|---|---|---|---|")
    for title, make in {**{f.name: functools.partial(read_case, f) for f in folders}, **made}.items():
        for name, cell, fine in cells(make(), not args.full, args.threads, args.only):
            print(f"| {title} | {name} | {cell} | {'yes' if fine else 'NO'} |", flush=True)
            if name != "as it is" and cell != "-":
                good, total = good + fine, total + 1
    print(f"\n{good} of {total} cells as they should be")


if __name__ == "__main__":
    main()
