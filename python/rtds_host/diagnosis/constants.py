"""Every hand-set constant of the instrument with its reason: `python -m rtds_host.diagnosis.constants`.

A table in Markdown, read off the sources: the comment above a constant is its reason. Tolerances of numerics say "Numerical".
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


def main() -> None:
    """Print the table."""
    rows = constants(Path(__file__).parent)
    print("| module | constant | value | reason |\n|---|---|---|---|")
    for row in rows:
        print("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |")
    numerical = sum(row[3].startswith("Numerical") for row in rows)
    print(f"\n{len(rows)} constants, {numerical} of them numerical tolerances.")


if __name__ == "__main__":
    main()
