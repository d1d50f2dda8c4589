"""How often the diagnosis is right: `python -m rtds_host.studies.bench`, against what one would do today.

Cases come from the independent planar world (`rtds_host.blind.cases`, as another process); the same searches are
judged by two common methods: BIC over the candidates, and the largest improvement of fit. Prints a page in Markdown and
writes it where `--page` says. What was examined is kept below `--out`: an interrupted run goes on where it stopped, a
changed diagnosis begins again.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import multiprocessing
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rtds_host.contract import read_case, write_atomic
from rtds_host.diagnosis.diagnose import Investigation, conclude, investigate, taken
from rtds_host.diagnosis.fit import Fit, Hypothesis, prior_cost
from rtds_host.diagnosis.gate import examine

# Layout: truths that move the residuals by fewer sigmas are distinguished, as in the score of sealed cases.
SIZE_SIGMA = 5.0
TIERS = {"all": 60, "tol": 40, "few": 30, "pair": 30, "none": 40, "unknown": 30}
METHODS = ("this program", "BIC over candidates", "largest improvement of fit")


def _bic(found: Investigation) -> Hypothesis:
    """Candidate (none, one or several effects) of the lowest Bayesian information criterion, of white residuals."""
    size = math.log(found.problem.size)
    return min(found.search.store.fits.values(), key=lambda f: _chi2(f) + len(f.u) * size).hypothesis


def _largest(found: Investigation) -> Hypothesis:
    """Single effect that lowers chi2 the most."""
    singles = [f for f in found.search.store.fits.values() if len(f.hypothesis) == 1]
    return min(singles, key=_chi2).hypothesis if singles else ()


def _chi2(fit: Fit) -> float:
    return float(fit.residual @ fit.residual) + prior_cost(fit.z, fit.u)


def _version() -> str:
    """Hash of the diagnosis' sources: rows of another version do not count."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[1]
    for path in [Path(__file__), *sorted((root / "diagnosis").rglob("*.py"))]:
        digest.update(str(path.relative_to(root)).encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def _kept(job: tuple[str, str, str, bool, str | None, str]) -> dict:
    """A row that is there already, or a new one."""
    tier, folder, _, quick, removed, rows = job
    path = Path(rows) / f"{tier}-{Path(folder).name}-{'quick' if quick else 'full'}-{removed or 'whole'}.json"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(path, json.dumps(answers_to(job[:-1])))
    return json.loads(path.read_text())


def answers_to(job: tuple[str, str, str, bool, str | None]) -> dict:
    tier, folder, truth_file, quick, removed = job
    truth = json.loads(Path(truth_file).read_text())
    began = time.process_time()
    case = read_case(folder)
    gate = examine(case)
    found = investigate(
        taken(case, gate), quick=quick, threads=1, without=frozenset([removed]) if removed else frozenset()
    )
    diagnosis, _ = conclude(found, gate)
    seconds = time.process_time() - began
    others = {} if removed else {METHODS[1]: _bic(found), METHODS[2]: _largest(found)}
    return {
        "tier": tier,
        "case": Path(folder).name,
        "truth": truth,
        "diagnosis": diagnosis,
        "seconds": seconds,
        "others": others,
        "removed": removed,
    }


def causes_named(diagnosis: dict) -> set[tuple[str, str]]:
    return {(e["id"], e["side"]) for e in diagnosis["effects"]}


def _true(truth: dict) -> set[tuple[str, str]]:
    return {(e["id"], e["side"]) for e in truth["effects"]}


def _in_set(diagnosis: dict, truth: dict) -> bool:
    named = causes_named(diagnosis)
    sets = [{(m["id"], m["side"]) for m in causes} for causes in diagnosis["indistinguishable"]]
    return (
        diagnosis["verdict"] in ("known", "partial")
        and len(named) == len(_true(truth))
        and all(t in named or any(t in s and len(s) <= 3 for s in sets) for t in _true(truth))
    )


def wilson(hits: int, count: int) -> tuple[float, float]:
    """95 % interval of a share (E. B. Wilson, J. Am. Stat. Assoc. 22, 1927)."""
    if count == 0:
        return 0.0, 1.0
    z, p = 1.96, hits / count
    middle = (p + z * z / (2 * count)) / (1 + z * z / count)
    half = z / (1 + z * z / count) * math.sqrt(p * (1 - p) / count + z * z / (4 * count * count))
    return max(0.0, middle - half), min(1.0, middle + half)


def _share(rows: list[bool]) -> str:
    if not rows:
        return "no case"
    low, high = wilson(sum(rows), len(rows))
    return f"{sum(rows)}/{len(rows)} = {np.mean(rows):.1%} ({low:.0%} to {high:.0%})"


def _coverage(rows: list[dict]) -> list[bool]:
    result = []
    for r in rows:
        truth = {(e["id"], e["side"]): e["parameters"] for e in r["truth"]["effects"]}
        for e in r["diagnosis"]["effects"]:
            for name, value in truth.get((e["id"], e["side"]), {}).items():
                interval = e["parameters"].get(name, {}).get("ci90")
                if interval:
                    if name == "phase_rad":
                        value += 2 * math.pi * round((sum(interval) / 2 - value) / (2 * math.pi))
                    result.append(interval[0] <= value <= interval[1])
    return result


@dataclass(frozen=True)
class Groups:
    """Cases of the table by what they test: all; of a visible effect, a weak one, a single one; of none, of one outside
    the catalogue; with their effect taken out of the catalogue.
    """

    main: list[dict]
    strong: list[dict]
    weak: list[dict]
    single: list[dict]
    none: list[dict]
    unknown: list[dict]
    removed: list[dict]


def grouped(rows: list[dict]) -> Groups:
    """The groups of some answered cases."""
    main = [r for r in rows if not r["removed"]]
    strong = [r for r in main if r["truth"]["verdict"] == "known" and (r["truth"].get("size_sigma") or 0) >= SIZE_SIGMA]
    return Groups(
        main,
        strong,
        [r for r in main if r["truth"]["verdict"] == "known" and r not in strong],
        [r for r in strong if r["tier"] in ("all", "tol")],
        [r for r in main if r["tier"] == "none"],
        [r for r in main if r["tier"] == "unknown"],
        [r for r in rows if r["removed"]],
    )


def exact(r: dict) -> bool:
    """Whether a case's answer is its truth."""
    return r["diagnosis"]["verdict"] in ("known", "partial") and causes_named(r["diagnosis"]) == _true(r["truth"])


def page(rows: list[dict], command: str) -> str:
    """The page: rates with 95 % intervals by Wilson, the comparison, and the confusions."""
    of = grouped(rows)
    lines = [
        "# How often the diagnosis is right",
        "",
        (
            f"Made by `{command}`: {len(of.main)} cases of the planar world, and {len(of.removed)} with their "
            "effect taken out of the catalogue. Truths of at least 5 sigma (nuisances projected off) unless said "
            "otherwise; 95 % intervals."
        ),
        "",
        "| | |",
        "|---|---|",
        *(f"| {name} | {value} |" for name, value in (*_rates(of), *_beyond(of), *_sizes(of))),
    ]
    return "\n".join([*lines, *_against(of), *_confusions(of)])


def _rates(of: Groups) -> Iterator[tuple[str, str]]:
    """How often causes, sides and places are right."""
    yield (
        "right cause and side, all channels, no tolerance",
        _share([exact(r) for r in of.strong if r["tier"] == "all"]),
    )
    yield ("the same with motors off by 1 %", _share([exact(r) for r in of.strong if r["tier"] == "tol"]))
    yield (
        "right or inside a declared set of at most 3 (both)",
        _share([exact(r) or _in_set(r["diagnosis"], r["truth"]) for r in of.single]),
    )
    yield (
        "few channels: right or inside a set",
        _share([exact(r) or _in_set(r["diagnosis"], r["truth"]) for r in of.strong if r["tier"] == "few"]),
    )
    yield (
        "pairs: both",
        _share([exact(r) or _in_set(r["diagnosis"], r["truth"]) for r in of.strong if r["tier"] == "pair"]),
    )
    yield (
        "pairs: at least one",
        _share([bool(causes_named(r["diagnosis"]) & _true(r["truth"])) for r in of.strong if r["tier"] == "pair"]),
    )
    yield (
        "right subsystem (largest share)",
        _share(
            [
                bool(r["diagnosis"]["located"])
                and r["diagnosis"]["located"][0]["subsystem"] in {e["subsystem"] for e in r["truth"]["effects"]}
                for r in of.single
            ]
        ),
    )
    yield ("false cause where there is none", _share([bool(r["diagnosis"]["effects"]) for r in of.none]))
    yield ("unknown recognised (outside effects)", _share([r["diagnosis"]["verdict"] == "unknown" for r in of.unknown]))
    yield ("wrongly unknown", _share([r["diagnosis"]["verdict"] == "unknown" for r in of.single]))


def _beyond(of: Groups) -> Iterator[tuple[str, str]]:
    """What becomes of an effect that the catalogue does not have."""
    same = [r for r in of.removed if r["diagnosis"]["verdict"] == "known" and r["diagnosis"]["gap"]["after"] < 1.1]
    small = [r for r in of.removed if r["diagnosis"]["verdict"] == "none" and r["diagnosis"]["gap"]["refit"] < 1.1]
    yield (
        "unknown, effect taken out of the catalogue, where that leaves a gap and no other effect does the same",
        _share([r["diagnosis"]["verdict"] == "unknown" for r in of.removed if r not in same and r not in small]),
    )
    yield (
        "… others of these: another effect leaves a gap below 1.1; the refit alone does, and nothing is named",
        f"{len(same)} and {len(small)} of {len(of.removed)}",
    )


def _sizes(of: Groups) -> Iterator[tuple[str, str]]:
    """Closure, intervals, weak effects and time."""
    closed = [
        r["diagnosis"]["gap"]["closed"]
        for r in of.strong
        if r["diagnosis"]["verdict"] == "known" and r["diagnosis"]["gap"]["closed"] is not None
    ]
    yield (
        "closure on held-out runs, median (5 % quantile)",
        f"{np.median(closed):.3f} ({np.quantile(closed, 0.05):.3f}), {len(closed)} cases" if closed else "no case",
    )
    yield ("90 % intervals that hold the truth", _share(_coverage([r for r in of.single if exact(r)])))
    yield (
        f"weak effects (below {SIZE_SIGMA:g} sigma): right, none, other",
        " / ".join(
            str(x)
            for x in (
                sum(exact(r) for r in of.weak),
                sum(r["diagnosis"]["verdict"] == "none" for r in of.weak),
                sum(not exact(r) and r["diagnosis"]["verdict"] != "none" for r in of.weak),
            )
        ),
    )
    seconds = [r["seconds"] for r in of.main]
    yield ("CPU seconds a case, median (largest)", f"{np.median(seconds):.1f} ({max(seconds):.0f})")


def _against(of: Groups) -> list[str]:
    """The comparison with other methods on the same fits."""
    lines = [
        "",
        "## Against what one would do today",
        "",
        "The same cases and the same fits.",
        "",
        (
            "| method | right cause and side (all, tol) | pairs: both | false cause where there is none | "
            "unmodelled effect attributed to the catalogue |"
        ),
        "|---|---|---|---|---|",
    ]
    pairs = [r for r in of.strong if r["tier"] == "pair"]

    def answer(r: dict, method: str) -> set[tuple[str, str]]:
        return causes_named(r["diagnosis"]) if method == METHODS[0] else {tuple(x) for x in r["others"][method]}

    def rate(hits: list[bool]) -> str:
        return f"{np.mean(hits):.0%}" if hits else "–"

    for method in METHODS:
        lines.append(
            "| "
            + " | ".join(
                [
                    method,
                    rate([answer(r, method) == _true(r["truth"]) for r in of.single]),
                    rate([answer(r, method) == _true(r["truth"]) for r in pairs]),
                    rate([bool(answer(r, method)) for r in of.none]),
                    rate([bool(answer(r, method)) for r in of.unknown]),
                ]
            )
            + " |"
        )
    return lines


def _confusions(of: Groups) -> list[str]:
    """What single effects were taken for, and how many of each were right."""
    lines = [
        "",
        "## Confusions",
        "",
        "What single effects (all, tol) were taken for, right answers left out.",
        "",
        "| truth | answer | cases |",
        "|---|---|---|",
    ]
    wrong: Counter[tuple[str, str]] = Counter()
    for r in of.single:
        if not exact(r):
            name = ", ".join(sorted(f"{e} ({s})" for e, s in causes_named(r["diagnosis"]))) or r["diagnosis"]["verdict"]
            wrong[(", ".join(sorted(f"{e} ({s})" for e, s in _true(r["truth"]))), name)] += 1
    lines += [f"| {a} | {b} | {n} |" for (a, b), n in sorted(wrong.items())] or ["| – | – | 0 |"]
    right = Counter(e for r in of.single if exact(r) for e, _ in _true(r["truth"]))
    total = Counter(e for r in of.single for e, _ in _true(r["truth"]))
    lines += [
        "",
        "Right of all, by effect: " + ", ".join(f"{e} {right[e]}/{n}" for e, n in sorted(total.items())) + ".",
        "",
    ]
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("build/diagnosis-bench"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--share", type=float, default=1.0, help="of the full number of cases")
    parser.add_argument("--removed", type=int, default=20, help="cases diagnosed again without their effect")
    parser.add_argument("--page", type=Path, help="where to write the page; printed in any case")
    parser.add_argument("--full", action="store_true", help="the full search in place of the quick one")
    options = parser.parse_args()
    jobs = []
    for k, (tier, count) in enumerate(TIERS.items()):
        folder = options.out / f"{tier}-{options.seed}-{count}"
        if not (folder / "complete").exists():
            subprocess.run(
                [
                    sys.executable,
                    "-m",
                    "rtds_host.blind.cases",
                    "--n",
                    str(count),
                    "--tier",
                    tier,
                    "--seed",
                    str(1000 * options.seed + k),
                    "--out",
                    str(folder),
                ],
                check=True,
                stdout=subprocess.DEVNULL,
            )
            (folder / "complete").touch()
        cases = sorted(c for c in (folder / "public").iterdir() if c.is_dir())
        for case in cases[: max(1, round(count * options.share))]:
            jobs.append((tier, str(case), str(folder / "truth" / f"{case.name}.json"), not options.full, None))
    singles = [j for j in jobs if j[0] in ("all", "tol")][: options.removed]
    for tier, case, truth, quick, _ in singles:
        jobs.append((tier, case, truth, quick, json.loads(Path(truth).read_text())["effects"][0]["id"]))
    rows = []
    kept = str(options.out / "rows" / _version())
    with ProcessPoolExecutor(mp_context=multiprocessing.get_context("spawn")) as pool:
        for row in pool.map(_kept, [(*job, kept) for job in jobs]):
            rows.append(row)
            print(f"\r{len(rows)}/{len(jobs)}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    command = (
        "python -m rtds_host.studies.bench"
        + (f" --seed {options.seed}" if options.seed != 1 else "")
        + (" --full" if options.full else "")
        + (f" --share {options.share:g}" if options.share != 1 else "")
    )
    text = page(rows, command)
    print(text)
    if options.page:
        write_atomic(options.page, text)


if __name__ == "__main__":
    main()
