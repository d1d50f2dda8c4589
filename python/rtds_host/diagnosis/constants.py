"""Every hand-set constant of the instrument with its reason: `python -m rtds_host.diagnosis.constants`.

A table in Markdown, read off the sources: the comment above a constant is its reason. Tolerances of numerics say "Numerical", what the
contract sets names its section.
"""

from __future__ import annotations

import re
from pathlib import Path

_CONSTANT = re.compile(r"^([A-Z][A-Z_0-9]*(?:, [A-Z_0-9]+)*) = ([-0-9(.].*)$")


def constants(root: Path) -> list[tuple[str, str, str, str]]:
    """Module, names, values and reason of each constant below a folder, in the order of the files."""
    rows = []
    for path in sorted(root.rglob("*.py")):
        reason: list[str] = []
        told = False
        for line in path.read_text(encoding="utf-8").splitlines():
            found = _CONSTANT.match(line)
            if found and not re.search(r'"|_INDEX', line):
                rows.append((str(path.relative_to(root)), found[1], found[2].split("  #")[0].strip(), " ".join(reason)))
                told = True
            elif line.startswith("# "):
                # A comment stands for the constants that follow it, up to the next.
                reason = ([] if told else reason) + [line[2:]]
                told = False
            else:
                reason = []
    return rows


def kind(reason: str) -> str:
    """Where a constant comes from, by its reason."""
    return "numerical" if reason.startswith("Numerical") else "contract" if "contract" in reason else "other"


def by_room(rows: list[tuple[str, str, str, str]]) -> dict[str, list[tuple[str, str, str, str]]]:
    """The rows by folder, those beside the folders as the search and its account."""
    found: dict[str, list[tuple[str, str, str, str]]] = {}
    for row in rows:
        found.setdefault(row[0].split("/")[0] if "/" in row[0] else "search and account", []).append(row)
    return found


def main() -> None:
    """Print the table."""
    rows = constants(Path(__file__).parent)
    print("| module | constant | value | reason |\n|---|---|---|---|")
    for row in rows:
        print("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |")
    print("\n| room | constants | numerical | of the contract | others |\n|---|---|---|---|---|")
    for room, mine in {**by_room(rows), "all": rows}.items():
        numerical, agreed = (sum(kind(row[3]) == which for row in mine) for which in ("numerical", "contract"))
        print(f"| {room} | {len(mine)} | {numerical} | {agreed} | {len(mine) - numerical - agreed} |")


if __name__ == "__main__":
    main()
