"""One case or many: reading, diagnosing, writing, going on after an interruption, and a table of all results."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import sys
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from rtds_host import __version__
from rtds_host.bars import stages, watched
from rtds_host.cleanup import scratch_name, sweep
from rtds_host.contract import Case, places_of_case, read_writable_case, refuse_inputs, staged_folder, write_atomic
from rtds_host.contract.inputs import regular_bytes
from rtds_host.diagnosis.diagnose import diagnose
from rtds_host.diagnosis.memory import keep_freed
from rtds_host.diagnosis.overview import overview_page, row_of, table_bytes
from rtds_host.diagnosis.repeat import repeats
from rtds_host.diagnosis.report import print_summary, report_page, validate
from rtds_host.diagnosis.report.made import written
from rtds_host.errors import InputError, OutputError, visible
from rtds_host.vectors import given
from rtds_host.workers import Outcome, check_cluster, cores, on_cluster, on_cores

FILES = ("diagnosis.json", "report.html")
# Next to the results of many cases: what is done, and the lock.
STATE = ".rtds"
SHARED = ("cases.parquet", "index.html")
# Layout: bytes of a case's name; with what is put before and behind it while a file is written, 255 are possible.
LONGEST_NAME = 235

# (case, quick, threads) -> (content of diagnosis.json, report.html, seconds)
Explain = Callable[[Case, bool, int], tuple[dict, str, float]]


def refuse_case(case: Path, out: Path) -> None:
    """OutputError where the results of a case would fall into the case itself, or into one of its runs."""
    refuse_inputs([out, *(out / file for file in FILES)], places_of_case(case))


def write_result(out: Path, result: dict, page: str, case: Path | None = None, quick: bool = False) -> dict[str, str]:
    """Write what a diagnosis gives, both files or none. Returns the text of each.

    case, quick : the case's folder and the option, for the command that the report says it was made with.

    Raises
    ------
    OutputError : `out` cannot be written.
    """
    texts = (json.dumps(result, indent=1, ensure_ascii=False) + "\n", written(page, case, out, quick))
    files = dict(zip(FILES, texts, strict=True))
    with staged_folder(out) as scratch:
        for name, text in files.items():
            (scratch / name).write_text(text, encoding="utf-8")
    return files


# ---- one case --------------------------------------------------------------------------------------------------------


def write_diagnosis(folder: Path, out: Path, quick: bool, threads: int, progress=None, repeat: bool = False) -> tuple:
    """Diagnose one case folder and write both files, together or not at all. Returns (diagnosis, details).

    repeat : say in the report, too, on how many halves of the data each effect was found again.
    """
    keep_freed()
    refuse_case(folder, out)
    case = read_writable_case(folder)
    result, details = diagnose(case, quick=quick, threads=threads, progress=progress)
    validate(result)
    if repeat:
        details.repeats = repeats(case, result, threads, progress or (lambda *_: None))
    write_result(out, result, report_page(result, details), folder, quick)
    return result, details


def run_one(
    folder: Path,
    out: Path,
    quick: bool = False,
    jobs: int = 0,
    summary: bool = True,
    repeat: bool = False,
    quiet: bool = False,
) -> tuple:
    """`rtds diagnose` of one case: progress, unless `quiet`, and with `summary` that on the terminal. Returns
    (diagnosis, details).
    """
    with stages(quiet) as report:
        result, details = write_diagnosis(folder, out, quick, jobs if jobs > 0 else cores(), report, repeat)
    if summary:
        print_summary(Console(), result, details)
    return result, details


# ---- many cases ------------------------------------------------------------------------------------------------------


def explain(case: Case, quick: bool, threads: int) -> tuple[dict, str, float]:
    """A case's diagnosis and report; runs in a process of its own, here or on a cluster, and writes nothing."""
    keep_freed()
    result, details = diagnose(case, quick=quick, threads=threads)
    validate(result)
    return result, report_page(result, details), given(details.seconds, "the time it took")


def name_of(folder: Path) -> str:
    """Name of a case's folder, "" for the root of the file system."""
    # Not `resolve`: a link that leads to itself is an error of its own there.
    return os.path.basename(os.path.realpath(folder))


def _explain_folder(work: Explain, folder: str, quick: bool, threads: int) -> tuple[dict, str, float]:
    return work(read_writable_case(Path(folder)), quick, threads)


def fingerprint(folder: Path, quick: bool) -> str:
    """SHA-256 over everything a result depends on: the case's name and files, how it is searched, the program's
    version.
    """
    digest = hashlib.sha256(json.dumps([__version__, name_of(folder), quick]).encode())
    found = [folder / "robot.toml"]
    for name in ("robot.toml", "run.json", "log.csv", "log.parquet"):
        found += folder.glob(f"*/{name}")
    for path in sorted(found):
        try:
            content = hashlib.sha256(regular_bytes(path)).hexdigest()
        except OSError as error:
            content = type(error).__name__
        digest.update(json.dumps([str(path.relative_to(folder)), content]).encode())
    return digest.hexdigest()


def _sha(text: bytes) -> str:
    return hashlib.sha256(text).hexdigest()


class Results:
    """Folder of many results: which are done, of what input, and whether their files are still the ones written."""

    def __init__(self, out: Path):
        self.out, self.state = out, out / STATE

    def row(self, name: str, key: str) -> dict | None:
        """The table's row of a case that is done, None for one to do."""
        try:
            note = json.loads((self.state / f"{name}.json").read_text(encoding="utf-8"))
            same = note["key"] == key and all(
                _sha((self.out / name / file).read_bytes()) == note["files"][file] for file in FILES
            )
            return note["row"] if same else None
        except (OSError, ValueError, KeyError, TypeError):
            # No note, one of an older program, or files that are gone: done again.
            return None

    def write(self, name: str, key: str, case: Path, quick: bool, result: dict, page: str, seconds: float) -> dict:
        """Write a result; the note that it is done comes last, so that what a kill leaves counts as not done."""
        files = write_result(self.out / name, result, page, case, quick)
        row = row_of(name, result, seconds)
        hashes = {file: _sha(text.encode("utf-8")) for file, text in files.items()}
        write_atomic(self.state / f"{name}.json", json.dumps({"key": key, "files": hashes, "row": row}) + "\n")
        return row

    def drop(self, name: str) -> None:
        """Take away an earlier result of a case that now fails: it would pass for the answer to the new input."""
        note = self.state / f"{name}.json"
        if not note.is_file():
            return
        try:
            for file in FILES:
                (self.out / name / file).unlink(missing_ok=True)
            note.unlink()
            if not any((self.out / name).iterdir()):
                (self.out / name).rmdir()
        except FileNotFoundError:
            # Taken away by hand before.
            return
        except OSError as error:
            raise OutputError(f"{error.filename}: cannot be removed ({error.strerror})") from error

    def sweep(self, names: list[str]) -> None:
        """Remove scratch folders and files that a killed run left."""
        sweep(self.out, *map(scratch_name, (*names, *SHARED)))
        sweep(self.state, *(scratch_name(f"{name}.json") for name in names))

    @contextmanager
    def locked(self) -> Iterator[None]:
        """One run at a time in a folder.

        Raises
        ------
        OutputError : another run writes there, or the folder cannot be written.
        """
        try:
            self.state.mkdir(parents=True, exist_ok=True)
            handle = os.open(self.state / "lock", os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as error:
            raise OutputError(f"{self.out}: cannot write ({error.strerror})") from error
        try:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise OutputError(f"{self.out}: another rtds diagnose writes there") from error
            yield
        finally:
            os.close(handle)


def _unwritable(name: str) -> str | None:
    """Why no results can be kept under a case's name, None where they can."""
    try:
        length = len(name.encode("utf-8"))
    except UnicodeEncodeError:
        return "its name is not text in UTF-8, no result can be kept under it; rename the folder"
    if length > LONGEST_NAME:
        return f"its name has {length} bytes, at most {LONGEST_NAME} are possible; rename the folder"
    if name in (STATE, *SHARED, ""):
        return f"{name or '/'} is not a name for a case, results are kept by names; rename the folder"
    return None


def _checked(cases: list[Path], out: Path) -> dict[str, Path]:
    by_name: dict[str, Path] = {}
    for case in cases:
        name = name_of(case)
        if name in by_name:
            raise InputError(f"{name}: two cases have this name; their results would fall into one folder")
        by_name[name] = case
    places = [place for case in cases for place in places_of_case(case)]
    refuse_inputs([out, *(out / name for name in (STATE, *SHARED, *by_name))], places)
    return by_name


def _bar(quiet: bool) -> Progress:
    """How many cases are done, where somebody looks on."""
    return Progress(
        TextColumn("diagnosing"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
        TextColumn("{task.description}", markup=False),
        console=Console(stderr=True),
        transient=True,
        disable=not watched(quiet),
    )


def _outcomes(
    work: Explain, todo: Mapping[str, Path], quick: bool, jobs: int, scheduler: str | None
) -> Generator[Outcome, None, None]:
    """Outcomes of the cases as they come, here or from a cluster."""
    if scheduler is not None:

        def loaded(case: Path) -> tuple:
            return read_writable_case(case), quick, 1

        return on_cluster(work, {name: partial(loaded, case) for name, case in todo.items()}, scheduler)
    processes = jobs if jobs > 0 else cores()
    threads = max(1, processes // max(1, len(todo)))
    arguments = {name: (work, str(case), quick, threads) for name, case in todo.items()}
    return on_cores(_explain_folder, arguments, processes)


def run_many(
    cases: list[Path],
    out: Path,
    quick: bool = False,
    jobs: int = 0,
    scheduler: str | None = None,
    work: Explain = explain,
    say: Callable[[str], None] | None = partial(print, flush=True),
    quiet: bool = False,
) -> list[str]:
    """`rtds diagnose` of several cases: a process a core, or the workers of a Dask cluster.

    What an earlier call into `out` did from the same input with the same options is not done again. Ends with
    `OUT/cases.parquet`, a row a case, and `OUT/index.html`, an overview with links to the reports.

    Parameters
    ----------
    jobs : processes on this machine, 0 = one a core. scheduler : address of a Dask scheduler, in place of processes.
    work : what is done with a case; found by its name in other processes. say : takes a line of each case that is
    done, None of nobody; failures go to standard error. quiet : no progress on a terminal.

    Returns
    -------
    Names of the cases that failed, for whatever reason; the others are complete.

    Raises
    ------
    InputError : two cases of the same name, or results that would fall into a case. OutputError : `out` cannot be
    written at the start or at the end (what is done stays; a single result that cannot be written is that case's
    failure). LinkError : the cluster cannot be used, or is lost (what is done stays).
    """
    by_name = _checked(cases, out)
    say = say or (lambda line: None)
    results = Results(out)
    if scheduler is not None and not results.state.exists():
        # Nothing is done here yet: a cluster that cannot be used must leave nothing. Where all is done, none is needed.
        check_cluster(scheduler)
    with results.locked():
        results.sweep(list(by_name))
        rows = {
            name: row_of(visible(name), None, None, f"{visible(case)}: {why}")
            for name, case in by_name.items()
            if (why := _unwritable(name)) is not None
        }
        for row in rows.values():
            print(f"rtds: {row['error']}", file=sys.stderr, flush=True)
        keys = {name: fingerprint(case, quick) for name, case in by_name.items() if name not in rows}
        done = {name: kept for name, key in keys.items() if (kept := results.row(name, key)) is not None}
        rows |= done
        todo = {name: case for name, case in by_name.items() if name not in rows}
        if done:
            say(f"{len(done)} of {len(by_name)} cases are done already")
        outcomes = _outcomes(work, todo, quick, jobs, scheduler)
        with closing(outcomes), _bar(quiet) as bar:
            task = bar.add_task("", total=len(by_name), completed=len(rows))
            for outcome in outcomes if todo else ():
                name, error = outcome.name, outcome.error
                if error is None:
                    try:
                        rows[name] = results.write(name, keys[name], todo[name], quick, *outcome.value)
                    except OutputError as refused:
                        # The place may take the next one: a full disk is emptied, a folder in the way is one case's.
                        error = str(refused)
                if error is None:
                    included = ", ".join(f"{e} ({s})" for e, s in zip(rows[name]["effects"], rows[name]["sides"]))
                    say(visible(f"{name}: {rows[name]['verdict']}" + (f": {included}" if included else "")))
                else:
                    results.drop(name)
                    rows[name] = row_of(name, None, None, visible(error))
                    place = "" if name in error else f"{name}: "
                    print(visible(f"rtds: {place}{error}"), file=sys.stderr, flush=True)
                bar.update(task, advance=1, description=visible(name))
        table = [rows[name] for name in by_name]
        write_atomic(out / "cases.parquet", table_bytes(table))
        write_atomic(out / "index.html", overview_page(table))
    failed = sorted(row["case"] for row in table if row["error"] is not None)
    if failed:
        print(visible(f"rtds: {len(failed)} of {len(table)} cases failed: {', '.join(failed)}"), file=sys.stderr)
    return failed
