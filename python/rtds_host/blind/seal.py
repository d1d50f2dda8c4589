"""Sealing: cases are made and their truth is locked away before anything is diagnosed, and tampering shows.

Folder of one check::

    OUT/public/case-001/…        what a diagnoser may see (contract cases)
    OUT/public/SEALS.json        salted SHA-256 of every truth, published next to the cases before any diagnosis
    OUT/sealed/case-001/truth.json, held-out/…   the truth with its salt, and runs that no diagnoser sees
    OUT/answers/case-001/diagnosis.json          what the diagnoser said
    OUT/answers/LEDGER.jsonl     one line an answer: its SHA-256, its time, and the hash of the line before

A truth's seal covers the held-out runs too. The ledger's first line holds the hash of SEALS.json, so seals cannot be
replaced once answers exist; each line holds the hash of the one before, so answers cannot be replaced one by one.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import shutil
import subprocess
import sys
import time
from contextlib import closing
from functools import partial
from pathlib import Path

import numpy as np

from rtds_host.blind.cases import KINDS, TIERS, WORLDS, draw_spec, make_case
from rtds_host.blind.kernel import Diverged
from rtds_host.cleanup import run_supervised, temporary_folder
from rtds_host.contract import write_atomic
from rtds_host.errors import InputError
from rtds_host.workers import cores, on_cluster, on_threads, process_pool

SEALS_SCHEMA = "rtds-blind-seals/1"
# Prints how well a diagnosis' effects fit a case; the case and the diagnosis come behind it.
SHOWER = [sys.executable, "-m", "rtds_host.diagnosis.shown"]
# Share of the cases a tier gets in a mixed check: one for everyone (60 cases), one for figures (310 cases, so that
# every tier has 30 and "no effect" 60).
WEIGHTS = {
    "all": 16,
    "tol": 8,
    "few": 8,
    "pair": 8,
    "none": 10,
    "unknown": 8,
    "long": 2,
    "many": 8,
    "messy": 8,
    "sizes": 8,
    "loggers": 8,
    "hard": 8,
    "formed": 8,
}
LONG_WEIGHTS = {
    "all": 60,
    "tol": 40,
    "few": 40,
    "pair": 40,
    "none": 60,
    "unknown": 40,
    "long": 30,
    "many": 40,
    "messy": 40,
    "sizes": 40,
    "loggers": 40,
    "hard": 40,
    "formed": 40,
}
LONG_CHECK = 300


def canonical(value: object) -> bytes:
    """JSON bytes that do not depend on the order of keys or on white space."""
    return json.dumps(value, sort_keys=True, separators=(",", ":")).encode()


def seal(salt: str, truth: dict) -> str:
    """Salted SHA-256 of a truth (hexadecimal)."""
    return hashlib.sha256(salt.encode() + b"\n" + canonical(truth)).hexdigest()


def hash_file(path: Path) -> str:
    """SHA-256 of a file (hexadecimal)."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def hash_folder(folder: Path) -> dict[str, str]:
    """Relative path -> SHA-256 of every file below a folder."""
    return {str(p.relative_to(folder)): hash_file(p) for p in sorted(folder.rglob("*")) if p.is_file()}


def shares(count: int, tiers: list[str]) -> list[str]:
    """A tier for each of `count` cases, in proportion to the weights (largest remainders)."""
    weights = LONG_WEIGHTS if count >= LONG_CHECK else WEIGHTS
    total = sum(weights[tier] for tier in tiers)
    exact = [count * weights[tier] / total for tier in tiers]
    whole = [int(value) for value in exact]
    order = sorted(range(len(tiers)), key=lambda k: exact[k] - whole[k], reverse=True)
    for k in order[: count - sum(whole)]:
        whole[k] += 1
    return [tier for tier, n in zip(tiers, whole) for _ in range(n)]


def _make_one(job: tuple[int, str, str, str, str]) -> str:
    seed, tier, world, public, sealed = job
    rng = np.random.default_rng(seed)
    case, hidden = Path(public), Path(sealed)
    held = hidden / "held-out"
    while True:
        spec = draw_spec(rng, tier, world)
        held.mkdir(parents=True, exist_ok=True)
        try:
            return lock(make_case(int(rng.integers(2**31)), spec, case, held_out=held), case, hidden)
        except Diverged:
            # Drawn again: the next one of the same tier.
            shutil.rmtree(case)
            shutil.rmtree(held)


def lock(truth: dict, case: Path, hidden: Path) -> str:
    """Write a truth, with a salt and the hashes of the case's and the held-out runs' files, and return its seal."""
    truth = {**truth, "held_out": hash_folder(hidden / "held-out"), "case": hash_folder(case)}
    salt = secrets.token_hex(16)
    write_atomic(hidden / "truth.json", json.dumps({"salt": salt, "truth": truth}, indent=1) + "\n")
    return seal(salt, truth)


def publish(out: Path, seals: dict[str, str], drawn: dict) -> None:
    """Publish the seals; what was drawn from (the seed among it) stays with the sealed truth."""
    write_atomic(out / "sealed" / "seed.json", json.dumps(drawn) + "\n")
    write_atomic(
        out / "public" / "SEALS.json",
        json.dumps({"schema": SEALS_SCHEMA, "hash": "sha256(salt, newline, truth)", "cases": seals}, indent=1) + "\n",
    )


def refuse_again(out: Path) -> None:
    """Raise InputError where a check with published seals is there already."""
    if (out / "public" / "SEALS.json").exists():
        raise InputError(f"{out / 'public' / 'SEALS.json'}: already exists, a sealed check is not made again")


def make(
    out: Path,
    count: int,
    tiers: list[str] | None = None,
    worlds: list[str] | None = None,
    seed: int | None = None,
    jobs: int | None = None,
    progress=None,
) -> dict[str, str]:
    """Draw and write `count` cases, seal their truths, publish the seals.

    Parameters
    ----------
    out : folder of the check; must not hold one already (an unfinished `make` is resumed with the same seed only).
    tiers, worlds : default the tiers of `cases.TIERS`, and all worlds. seed : default drawn from the system; kept in
    `OUT/sealed/seed.json` and
        nowhere a diagnoser looks. jobs : processes, default all cores. progress : called with (done, count).

    Returns
    -------
    case -> seal.

    Raises
    ------
    InputError : a check with published seals is there already, or an unknown tier or world.
    """
    tiers, worlds = tiers or list(TIERS), worlds or list(WORLDS)
    for name, known, what in [(t, KINDS, "tier") for t in tiers] + [(w, WORLDS, "world") for w in worlds]:
        if name not in known:
            raise InputError(f"{what} {name!r}: unknown (known: {', '.join(known)})")
    if count < 1:
        raise InputError(f"{count} cases: at least 1 is needed")
    public, sealed = out / "public", out / "sealed"
    refuse_again(out)
    seed = secrets.randbits(63) if seed is None else seed
    rng = np.random.default_rng(seed)
    plan = shares(count, tiers)
    plan = [plan[k] for k in rng.permutation(count)]  # order and names say nothing
    seeds = rng.integers(2**62, size=count)
    choice = [worlds[k % len(worlds)] for k in rng.permutation(count)]
    names = [f"case-{k + 1:03d}" for k in range(count)]
    for name in names:  # remains of an interrupted make
        shutil.rmtree(public / name, ignore_errors=True)
        shutil.rmtree(sealed / name, ignore_errors=True)
    work = [(int(seeds[k]), plan[k], choice[k], str(public / names[k]), str(sealed / names[k])) for k in range(count)]
    seals = {}
    jobs = min(jobs or os.cpu_count() or 1, count)
    if jobs == 1:
        results = map(_make_one, work)
        for done, (name, value) in enumerate(zip(names, results), 1):
            seals[name] = value
            if progress:
                progress(done, count)
    else:
        with process_pool(jobs) as pool:
            for done, (name, value) in enumerate(zip(names, pool.map(_make_one, work)), 1):
                seals[name] = value
                if progress:
                    progress(done, count)
    publish(out, seals, {"seed": seed, "count": count, "tiers": tiers, "worlds": worlds})
    return seals


def what_was_drawn(out: Path) -> dict:
    """What `make` drew from: seed, count, and for measured data the names of the data sets.

    Raises
    ------
    InputError : it is not there any more.
    """
    path = out / "sealed" / "seed.json"
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from error


def read_seals(out: Path) -> dict[str, str]:
    """Published seals: case -> hash.

    Raises
    ------
    InputError : no check is there, or its seals are unreadable.
    """
    path = out / "public" / "SEALS.json"
    try:
        data = json.loads(path.read_text())
    except FileNotFoundError as error:
        raise InputError(f"{path}: missing, make a check first (rtds blind make)") from error
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    if data.get("schema") != SEALS_SCHEMA:
        raise InputError(f"{path}: schema: is {data.get('schema')!r}, {SEALS_SCHEMA!r} is needed")
    return dict(data["cases"])


def read_ledger(out: Path) -> list[dict]:
    """Lines of the ledger, its chain checked.

    Raises
    ------
    InputError : a line was changed, removed or inserted, or the seals were replaced after the first answer.
    """
    path = out / "answers" / "LEDGER.jsonl"
    if not path.exists():
        return []
    entries, before = [], hash_file(out / "public" / "SEALS.json")
    for number, line in enumerate(path.read_text().splitlines(), 1):
        try:
            entry = json.loads(line)
        except ValueError as error:
            raise InputError(f"{path}: line {number}: is not JSON ({error})") from error
        if entry.get("before") != before:
            raise InputError(
                f"{path}: line {number}: does not follow the line before it; "
                + ("the seals were changed after the first answer" if number == 1 else "the ledger was changed")
            )
        before = hashlib.sha256(line.encode()).hexdigest()
        entries.append(entry)
    return entries


def _append(out: Path, entry: dict) -> None:
    path = out / "answers" / "LEDGER.jsonl"
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = path.read_text().splitlines() if path.exists() else []
    before = hashlib.sha256(lines[-1].encode()).hexdigest() if lines else hash_file(out / "public" / "SEALS.json")
    lines.append(canonical({**entry, "before": before}).decode())
    write_atomic(path, "\n".join(lines) + "\n")


def diagnoser_command(quick: bool, threads: int = 0) -> list[str]:
    """Command of the project's own diagnoser on so many cores (0 = all); the case and ``--out DIR`` come behind it."""
    return [
        sys.executable,
        "-m",
        "rtds_host.cli.main",
        "diagnose",
        *(["--quick"] if quick else []),
        "--jobs",
        str(threads),
    ]


def _ask(
    command: list[str] | None, quick: bool, threads: int, case: str, files: dict[str, bytes], timeout_s: float
) -> tuple[dict, bytes | None]:
    """One case in a process of its own, which sees a copy of that case and nothing else of the check.

    Needs nothing but its arguments, so that it may run on another machine; returns the ledger's entry and the answer.
    """
    command = command or diagnoser_command(quick, threads)
    with temporary_folder() as scratch:
        place = scratch / "case"
        for name, content in files.items():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (place / name).write_bytes(content)
        target = scratch / "answer"
        begin = time.monotonic()
        try:
            done = run_supervised([*command, str(place), "--out", str(target)], timeout_s, scratch)
            status, said = done.returncode, (done.stderr.strip().splitlines() or [""])[-1]
        except subprocess.TimeoutExpired:
            status, said = -1, f"no answer within {timeout_s:g} s"
        seconds = time.monotonic() - begin
        found = [p for p in (target / "diagnosis.json", target / "case" / "diagnosis.json") if p.is_file()]
        entry = {"case": case, "status": status, "seconds": round(seconds, 2), "sha256": None, "said": said[:300]}
        if not found:
            return entry, None
        content = found[0].read_bytes()
        return {**entry, "sha256": hashlib.sha256(content).hexdigest()}, content


def answer(
    out: Path,
    quick: bool = False,
    jobs: int = 1,
    command: list[str] | None = None,
    timeout_s: float = 600.0,
    progress=None,
    scheduler: str | None = None,
) -> list[dict]:
    """Let a diagnoser answer every case that has no answer yet.

    Each answer is in the ledger as soon as it is there, so that an interrupted call loses only what was in work.

    Parameters
    ----------
    quick : pass ``--quick``. jobs : cases at a time, which share the cores. command : another diagnoser; called with
        a case folder and ``--out DIR``, it writes ``DIR/diagnosis.json``. scheduler : address of a Dask scheduler
        whose workers run the diagnoser in place of this machine; they get public cases only.

    Returns
    -------
    The whole ledger. A case that failed is in it, with its exit status and last word, and is not asked again.

    Raises
    ------
    InputError : no check is there, or its ledger was changed. LinkError : the cluster cannot be used, or is lost;
        call again to go on.
    """
    seals = read_seals(out)
    ledger = read_ledger(out)
    unanswered = [case for case in seals if case not in {entry["case"] for entry in ledger}]
    jobs = max(1, min(jobs, len(unanswered)))
    threads = max(1, cores() // jobs) if scheduler is None else 1

    def question(case: str) -> tuple:
        folder = out / "public" / case
        files = {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}
        return command, quick, threads, case, files, timeout_s

    questions = {case: partial(question, case) for case in unanswered}
    outcomes = on_cluster(_ask, questions, scheduler) if scheduler else on_threads(_ask, questions, jobs)
    with closing(outcomes):
        for done, outcome in enumerate(outcomes if unanswered else (), 1):
            answer: tuple[dict, bytes | None] = outcome.value or (
                {
                    "case": outcome.name,
                    "status": -1,
                    "seconds": 0.0,
                    "sha256": None,
                    "said": (outcome.error or "")[:300],
                },
                None,
            )
            entry, content = answer
            if content is not None:
                write_atomic(out / "answers" / entry["case"] / "diagnosis.json", content)
            _append(out, {**entry, "quick": quick})
            if progress:
                progress(done, len(unanswered))
    return read_ledger(out)


def open_truths(out: Path) -> tuple[dict[str, dict], dict[str, dict], list[dict]]:
    """Open the truth after the answers are in, and check every hash.

    Returns
    -------
    (truths, answers, ledger) by case; a case without an answer is missing in `answers`.

    Raises
    ------
    InputError : no answers yet, or a truth, a case, a held-out run, an answer, the seals or the ledger was changed.
    """
    seals = read_seals(out)
    ledger = read_ledger(out)
    if not ledger:
        raise InputError(f"{out / 'answers'}: no answers yet, the truth stays closed (rtds blind answer)")
    missing = sorted(set(seals) - {entry["case"] for entry in ledger})
    if missing:
        raise InputError(
            f"{out / 'answers'}: {missing[0]} and {len(missing) - 1} more have not been asked yet, "
            "the truth stays closed"
        )
    answers = {}
    for entry in ledger:
        path = out / "answers" / entry["case"] / "diagnosis.json"
        if entry["sha256"] is None:
            if path.exists():
                raise InputError(f"{path}: was added after the ledger was written")
            continue
        if not path.exists() or hash_file(path) != entry["sha256"]:
            raise InputError(f"{path}: is not the answer that was given (SHA-256 differs)")
        answers[entry["case"]] = json.loads(path.read_text())
    return check_truths(out), answers, ledger


def check_truths(out: Path) -> dict[str, dict]:
    """Truths by case, every hash checked; asks for no answer, so it is for whoever made the cases.

    Raises
    ------
    InputError : no check is there, or a truth, a case or a held-out run was changed.
    """
    truths = {}
    for case, expected in read_seals(out).items():
        path = out / "sealed" / case / "truth.json"
        try:
            data = json.loads(path.read_text())
            value = seal(data["salt"], data["truth"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{path}: cannot be opened ({error})") from error
        if value != expected:
            raise InputError(f"{path}: is not the truth that was sealed (SHA-256 differs)")
        for folder, hashes in (
            (out / "sealed" / case / "held-out", data["truth"]["held_out"]),
            (out / "public" / case, data["truth"]["case"]),
        ):
            if hash_folder(folder) != hashes:
                raise InputError(f"{folder}: files were changed after sealing")
        truths[case] = data["truth"]
    return truths
