"""One case or many: reading, diagnosing, writing, and what to do when one of many fails."""

from __future__ import annotations

import json
import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from rtds_host.contract import read_case, staged_folder
from rtds_host.diagnosis.diagnose import diagnose
from rtds_host.diagnosis.report import print_summary, validate, write_report
from rtds_host.errors import InputError, RtdsError

FILES = ("diagnosis.json", "report.html")


def _cores(jobs: int) -> int:
    return jobs if jobs > 0 else len(os.sched_getaffinity(0))


def write_diagnosis(folder: Path, out: Path, quick: bool, seed: int, threads: int, progress=None) -> tuple:
    """Diagnose one case folder and write both files, together or not at all. Returns (diagnosis, details)."""
    case = read_case(folder)
    result, details = diagnose(case, quick=quick, threads=threads, seed=seed, progress=progress)
    validate(result)
    with staged_folder(out) as scratch:
        (scratch / "diagnosis.json").write_text(json.dumps(result, indent=1, ensure_ascii=False) + "\n")
        (scratch / "report.html").write_text(write_report(result, details), encoding="utf-8")
    return result, details


def run_one(folder: Path, out: Path, quick: bool = False, seed: int = 1, jobs: int = 0) -> None:
    """`rtds diagnose` of one case: progress and a summary on the terminal."""
    errors = Console(stderr=True)
    with Progress(TextColumn("{task.description:<12}"), BarColumn(), TimeElapsedColumn(), console=errors,
                  transient=True, disable=not sys.stderr.isatty()) as bar:
        task = bar.add_task("reading", total=1.0)
        result, details = write_diagnosis(folder, out, quick, seed, _cores(jobs),
                                          lambda stage, share: bar.update(task, description=stage, completed=share))
    print_summary(Console(), result, details)


def _job(folder: str, out: str, quick: bool, seed: int) -> str:
    result, _ = write_diagnosis(Path(folder), Path(out), quick, seed, 1)
    named = ", ".join(f"{e['id']} ({e['side']})" for e in result["effects"])
    return result["verdict"] + (f": {named}" if named else "")


def _done(folder: Path, out: Path) -> bool:
    """Whether both files are there and younger than everything they were made from."""
    if not all((out / name).is_file() for name in FILES):
        return False
    newest = max((p.stat().st_mtime for p in folder.rglob("*") if p.is_file()), default=0.0)
    return min((out / name).stat().st_mtime for name in FILES) > newest


def run_many(cases: list[Path], out: Path, quick: bool = False, seed: int = 1, jobs: int = 0) -> list[str]:
    """`rtds diagnose` of several cases, a process each; what is already done is not done again.

    Returns
    -------
    Names of the cases that failed; the others are complete.

    Raises
    ------
    InputError : two cases of the same name.
    """
    names = [case.resolve().name for case in cases]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"{twice[0]}: two cases have this name; their results would fall into one folder")
    console = Console()
    failed: list[str] = []
    todo = []
    for name, case in zip(names, cases):
        if _done(case, out / name):
            console.print(f"{name}: already done", highlight=False)
        else:
            todo.append((name, case))
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max(1, min(_cores(jobs), len(todo))), mp_context=context) as pool:
        futures = {pool.submit(_job, str(case), str(out / name), quick, seed): name for name, case in todo}
        for future in as_completed(futures):
            name = futures[future]
            try:
                console.print(f"{name}: {future.result()}", highlight=False)
            except RtdsError as error:
                failed.append(name)
                print("rtds: " + " ".join(str(error).split()), file=sys.stderr)
    if failed:
        print(f"rtds: {len(failed)} of {len(cases)} cases failed: {', '.join(sorted(failed))}", file=sys.stderr)
    return sorted(failed)
