"""Every hand-set constant of the instrument with its reason: `python -m rtds_host.diagnosis.constants`.

A table in Markdown, read off the sources: whatever a module names in capitals and sets to numbers alone, each name a
row; what is worked out from another constant, or numbers cases from 0, is none. The comment above a constant is its
reason, and the reason's first word its kind:

- Numerical: integration steps, grids, how finely something is looked for; how close to the answer a computation comes;
- Physical: what machines, sensors, loggers and file formats are like; Probability: how likely something is before a run
is seen, or how
  often a rule may be wrong;
- Layout: what a page or a table shows, which steers no answer;
- what the contract sets names its section;
- all else is a judgement.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

from rtds_host.vectors import given

KINDS = ("numerical", "contract", "physical", "probability", "layout", "judgement")
# A reason that begins with one of these is of that kind.
WORDS = {"Numerical": "numerical", "Physical": "physical", "Probability": "probability", "Layout": "layout"}


def _set_by_hand(value: ast.expr) -> bool:
    """Whether an expression is made of numbers alone, with arithmetic and functions of `math` on them."""
    names = [part.id for part in ast.walk(value) if isinstance(part, ast.Name)]
    leaves = [part.value for part in ast.walk(value) if isinstance(part, ast.Constant)]
    fits = all(
        isinstance(
            part,
            (
                ast.Constant,
                ast.Tuple,
                ast.UnaryOp,
                ast.BinOp,
                ast.Call,
                ast.Attribute,
                ast.Name,
                ast.operator,
                ast.unaryop,
                ast.expr_context,
            ),
        )
        for part in ast.walk(value)
    )
    return (
        fits
        and set(names) <= {"math"}
        and bool(leaves)
        and all(isinstance(leaf, (int, float)) and not isinstance(leaf, bool) for leaf in leaves)
    )


def _named(statement: ast.stmt) -> list[tuple[str, ast.expr]]:
    """Names in capitals that a statement sets, each with its value: of names set together to values, and of one
    alone.
    """
    if not isinstance(statement, ast.Assign) or len(statement.targets) != 1:
        return []
    target, value = statement.targets[0], statement.value
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
        pairs = list(zip(target.elts, value.elts))
    else:
        pairs = [(target, value)]
    if len(pairs) > 1 and [of.value if isinstance(of, ast.Constant) else None for _, of in pairs] == list(
        range(len(pairs))
    ):
        return []  # names of cases
    return [
        (name.id, of) for name, of in pairs if isinstance(name, ast.Name) and re.fullmatch("_?[A-Z][A-Z_0-9]*", name.id)
    ]


def constants(root: Path) -> list[tuple[str, str, str, str]]:
    """Module, name, value and reason of each constant below a folder, in the order of the files."""
    rows = []
    for path in sorted(root.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        lines = text.splitlines()
        reasons: dict[int, str] = {}
        for statement in ast.parse(text).body:
            named = _named(statement)
            if not named:
                continue
            first = statement.lineno - 1
            above = first
            while above and lines[above - 1].startswith("# "):
                above -= 1
            # A comment stands for the constants that follow it without an empty line, up to the next.
            last = given(statement.end_lineno, "the line of a statement")
            reasons[last] = (
                " ".join(line[2:] for line in lines[above:first]) if above < first else reasons.get(first, "")
            )
            rows += [
                (str(path.relative_to(root)), name, ast.get_source_segment(text, value) or "", reasons[last])
                for name, value in named
                if _set_by_hand(value)
            ]
    return rows


def kind(reason: str) -> str:
    """Where a constant comes from, by its reason: one of `KINDS`."""
    found = WORDS.get(reason.split(":")[0])
    return found or ("contract" if re.search(r"\(contract[,:]", reason) else "judgement")


def by_folder(rows: list[tuple[str, str, str, str]]) -> dict[str, list[tuple[str, str, str, str]]]:
    """The rows by folder, those of the search and next to the folders as the search and its attribution."""
    found: dict[str, list[tuple[str, str, str, str]]] = {}
    for row in rows:
        folder = row[0].split("/")[0] if "/" in row[0] else "search"
        found.setdefault("search and attribution" if folder == "search" else folder, []).append(row)
    return found


def main() -> None:
    """Print the table, how many each folder has of each kind, and how many are set by hand and affect an answer."""
    rows = constants(Path(__file__).parent)
    print("| module | constant | value | kind | reason |\n|---|---|---|---|---|")
    for row in rows:
        print("| " + " | ".join(cell.replace("|", "\\|") for cell in (*row[:3], kind(row[3]), row[3])) + " |")
    print(
        f"\n| folder | constants | {' | '.join(KINDS)} | beyond numerical, contract and layout"
        f" |\n|---|{'---|' * (len(KINDS) + 2)}"
    )
    for folder, mine in {**by_folder(rows), "all": rows}.items():
        counts = [sum(kind(row[3]) == which for row in mine) for which in KINDS]
        beyond = sum(count for which, count in zip(KINDS, counts) if which in ("physical", "probability", "judgement"))
        print(f"| {folder} | {len(mine)} | {' | '.join(map(str, counts))} | {beyond} |")


if __name__ == "__main__":
    main()
