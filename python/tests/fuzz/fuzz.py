"""Feeds the program inputs that are almost right, and counts what it makes of them: `make fuzz`.

Every input must end in a right answer or in one clear line with status 2, within a minute, with nothing half-written
and nothing left next to it. What is accepted is compared with what a reader of the harness' own (`reference.py`) sees
in it: an answer to something that is not there is a silent misreading. An input is known by seed and number, `--only
SEED NUMBER` shows it; `findings.py` holds what was found before, and comes first.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import io
import json
import math
import multiprocessing
import multiprocessing.connection
import os
import random
import shutil
import socket
import struct
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

import findings
import inputs
import reference
from reference import Refused

from rtds_host.cli.commands import main as rtds
from rtds_host.compat import tomllib
from rtds_host.contract import load_robot, read_case, read_meta, read_run
from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.gate import examine
from rtds_host.diagnosis.predict import DIAGNOSIS_SCHEMAS
from rtds_host.errors import LinkError, RtdsError
from rtds_host.link import protocol
from rtds_host.link.child import Child
from rtds_host.link.registers import NOISE_BYTES, RegisterClient, encode_answer
from rtds_host.link.rtl import RtlLink

HANG_S = 60.0
RIGHT, REFUSED, OPEN, MISREAD, TROUBLE, HANG = (
    "right answer",
    "clean error",
    "accepted, not judged",
    "SILENT MISREADING",
    "TROUBLE",
    "HANG",
)
BAD = (MISREAD, TROUBLE, HANG)
# Numbers of nine digits.
CLOSE = {"rel_tol": 2e-8, "abs_tol": 1e-12}
Result = tuple[str, str]


def command(place: Path, *arguments: object) -> tuple[int, str]:
    """(status, standard error) of `rtds` in this process, with `place` as its folder."""
    said = io.StringIO()
    status: object = None
    before, argv = os.getcwd(), sys.argv
    os.chdir(place)
    sys.argv = ["rtds", *map(str, arguments)]
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
            try:
                rtds()
            except SystemExit as end:
                status = end.code
    finally:
        os.chdir(before)
        sys.argv = argv
    return int(status or 0), said.getvalue()


def one_line(text: str) -> str | None:
    """What is wrong with the words of a refusal, None where nothing is."""
    lines = text.splitlines()
    errors = [line for line in lines if not line.startswith("note: ")]
    if len(errors) != 1 or not errors[0].startswith("rtds: ") or len(errors[0]) < 12:
        return f"not one line: {text[:300]!r}"
    if "internal error" in text or "Traceback" in text:
        return text[:300]
    if not errors[0].isprintable():
        return f"control characters: {errors[0]!r}"
    return None


def told(
    place: Path, status: int, said: str, outputs: tuple[str, ...], before: set[str], judge: Callable[[], Result | None]
) -> Result:
    """What a command's end is worth; `outputs` are there all or not at all, and nothing else may be new."""
    new = inputs.listing(place) - before
    there = [name for name in outputs if name in new]
    if extra := {name for name in new if name.split(os.sep)[0] not in {o.split(os.sep)[0] for o in outputs}}:
        return TROUBLE, f"leaves {sorted(extra)[:3]}"
    if any(os.path.basename(name).startswith(".") for name in new):
        return TROUBLE, "leaves scratch"
    if status == 2:
        if there:
            return TROUBLE, f"refused, but {there[0]} is there"
        wrong = one_line(said)
        return (TROUBLE, wrong) if wrong else (REFUSED, said.strip())
    if status != 0:
        return TROUBLE, f"status {status}: {said[:300]}"
    if len(there) < len(outputs):
        return TROUBLE, f"status 0, but {set(outputs) - set(there)} is not there"
    try:
        return judge() or (RIGHT, "")
    except Refused as why:
        return MISREAD, f"accepted, though {why}"


def alike(name: str, got: np.ndarray, wanted: list[float]) -> Result | None:
    """None where two columns are the same to nine digits, NaN where NaN is."""
    if len(got) != len(wanted):
        return MISREAD, f"{name} has {len(got)} rows, {len(wanted)} stand in the file"
    for k, (a, b) in enumerate(zip(got.tolist(), wanted)):
        if math.isnan(a) != math.isnan(b) or (not math.isnan(a) and not math.isclose(a, b, **CLOSE)):
            return MISREAD, f"{name} of row {k}: {a!r}, in the file stands {b!r}"
    return None


# ---- kinds of input
# ----------------------------------------------------------------------------------------------------


def case_files(rng: random.Random) -> dict[str, bytes]:
    """A right case of one run."""
    return {
        "case/robot.toml": inputs.robot_toml(),
        "case/run/run.json": inputs.run_json(rng),
        "case/run/log.csv": inputs.log_csv(),
    }


def predicted(place: Path, files: dict[str, bytes], *more: object) -> Result:
    """`rtds predict` of the case, everything that it read compared with what stands there."""
    inputs.fill(place, files)
    before = inputs.listing(place)
    status, said = command(place, "predict", "case/run", "--robot", "case/robot.toml", "--out", "p.csv", *more)

    def judge() -> Result | None:
        wanted = reference.log_csv(files["case/run/log.csv"])
        meta = reference.run_json(files["case/run/run.json"])
        machine = reference.robot_toml(files["case/robot.toml"])
        robot = load_robot(place / "case/robot.toml")
        log = read_run(place / "case/run", robot)
        for key, value in meta.items():
            if getattr(read_meta(place / "case/run/run.json"), key) != value or getattr(log.meta, key) != value:
                return MISREAD, f"{key} of run.json"
        for (section, key), value in machine.items():
            got = (
                robot.supply_v
                if section == "supply"
                else robot.sensors.get(key)
                if section == "sensors"
                else getattr(getattr(robot, section), key)
            )
            if got != value:
                return MISREAD, f"[{section}] {key} is {got}, in the file stands {value}"
        if not machine:
            return OPEN, "another kind of machine"
        if wrong := alike("t", log.t, wanted["t"]):
            return wrong
        for name, values in wanted.items():
            if name in log.columns and (wrong := alike(name, log.columns[name], values)):
                return wrong
        table = np.genfromtxt(place / "p.csv", delimiter=",", names=True)
        for name in ("t", "v_cmd_l", "v_cmd_r"):
            if wrong := alike(f"p.csv {name}", np.atleast_1d(table[name]), wanted[name]):
                return wrong
        if not all(np.isfinite(table[name]).all() for name in table.dtype.names):
            return TROUBLE, "p.csv holds what is no number"
        with contextlib.suppress(RtdsError):
            examine(read_case(place / "case"))
        return None

    return told(place, status, said, ("p.csv",), before, judge)


def log(place: Path, rng: random.Random, given: bytes | None = None) -> Result:
    """A log.csv."""
    files = case_files(rng)
    files["case/run/log.csv"] = inputs.spoiled_text(inputs.log_csv(), rng) if given is None else given
    return predicted(place, files)


def robot(place: Path, rng: random.Random, given: bytes | None = None) -> Result:
    """A robot.toml."""
    files = case_files(rng)
    files["case/robot.toml"] = inputs.spoiled_text(inputs.robot_toml(), rng) if given is None else given
    return predicted(place, files)


def run_json(place: Path, rng: random.Random, given: bytes | None = None) -> Result:
    """A run.json."""
    files = case_files(rng)
    files["case/run/run.json"] = inputs.spoiled_text(inputs.run_json(rng), rng) if given is None else given
    return predicted(place, files)


@functools.cache
def effects() -> dict[str, tuple[tuple[str, ...], tuple[str, ...]]]:
    return {e.id: (e.sides, tuple(p.name for p in e.parameters)) for e in CATALOGUE.values()}


def diagnosis(place: Path, rng: random.Random, given: bytes | None = None) -> Result:
    """A diagnosis to apply."""
    files = case_files(rng)
    files["d.json"] = given if given is not None else inputs.diagnosis_json(rng)
    if given is None and rng.random() < 0.7:
        files["d.json"] = inputs.spoiled_text(files["d.json"], rng)
    result = predicted(place, files, "--diagnosis", "d.json")
    if result[0] in (RIGHT, OPEN):
        try:
            reference.diagnosis(files["d.json"], DIAGNOSIS_SCHEMAS, effects())
        except Refused as why:
            return MISREAD, f"accepted, though {why}"
    return result


def imported(place: Path, mapping: bytes, table: bytes) -> Result:
    """`rtds import` of a table of another logger."""
    inputs.fill(place, {"mapping.toml": mapping, "log.csv": table})
    before = inputs.listing(place)
    status, said = command(place, "import", "log.csv", "--mapping", "mapping.toml", "--out", "case")

    def judge() -> Result | None:
        content = tomllib.loads(reference.text_of(mapping))
        signals = content["signal"]
        plain = {"column", "unit", "reverse", "scale"}
        units = {"mV": 1e-3, "V": 1.0, "mA": 1e-3, "A": 1.0, "rpm": math.pi / 30, "rad/s": 1.0}
        if (
            set(content) - {"schema", "name", "robot", "table", "time", "signal"}
            or content["robot"] != "burger"
            or set(content["table"]) - {"delimiter"}
            or content["time"].get("unit") != "ms"
            or any(set(entry) - plain or entry.get("unit") not in units for entry in signals.values())
        ):
            return OPEN, "more of a mapping than the reference knows"
        time_column = content["time"]["column"]
        raw = reference.foreign_csv(
            table,
            content["table"].get("delimiter", ","),
            tuple(dict.fromkeys((time_column, *(e["column"] for e in signals.values())))),
        )
        got = read_run(place / "case/log", load_robot(place / "case/robot.toml"))
        # A run begins where both commands are known.
        known = [
            next((k for k, v in enumerate(raw[signals[name]["column"]]) if not math.isnan(v)), 0)
            for name in ("v_cmd_l", "v_cmd_r")
            if name in signals
        ]
        start = raw[time_column][max(known, default=0)] * 1e-3
        # Rows: the last sample of each microsecond, to which the importer rounds.
        at = {round((v * 1e-3 - start) * 1e6): k for k, v in enumerate(raw[time_column])}
        offset = round(got.t[0] * 1e6)
        # Up to 999 s a row's time is told to the microsecond, then to ten and more.
        times = {round(t * 1e6) - offset for t in got.t}
        for time_us, k in at.items():
            if (
                0 <= time_us < 999e6
                and max(at) < 999e6
                and time_us not in times
                and any(
                    not math.isnan(raw[entry["column"]][k]) for name, entry in signals.items() if name in got.columns
                )
            ):
                return MISREAD, f"row {k} of the file, at {1e-6 * time_us:g} s, is not there"
        for name, entry in signals.items():
            factor = units[entry["unit"]] * entry.get("scale", 1.0) * (-1 if entry.get("reverse") else 1)
            if name not in got.columns or name.startswith("v_cmd"):
                continue
            for t, value in zip(got.t, got.columns[name]):
                k = at.get(round(t * 1e6) - offset)
                if k is None or math.isnan(value):
                    continue
                wanted = raw[entry["column"]][k] * factor
                if not math.isnan(wanted) and not math.isclose(value, wanted, rel_tol=1e-6, abs_tol=1e-9):
                    return (
                        (OPEN, "rows of one time")
                        if len(at) < len(raw[time_column])
                        else (MISREAD, f"{name} at {t:g} s is {value!r}, in the file stands {wanted!r}")
                    )
        return None

    return told(place, status, said, ("case/robot.toml", "case/log/run.json", "case/log/log.csv"), before, judge)


def table(place: Path, rng: random.Random, given: bytes | None = None) -> Result:
    """A table of another logger."""
    delimiter = rng.choice(",;\t") if given is None else ","
    return imported(
        place,
        (inputs.MAPPING % delimiter.replace("\t", "\\t")).encode(),
        inputs.spoiled_text(inputs.foreign_csv(delimiter), rng) if given is None else given,
    )


def mapping(place: Path, rng: random.Random, given: bytes | None = None) -> Result:
    """A mapping."""
    return imported(
        place,
        inputs.spoiled_text((inputs.MAPPING % ",").encode(), rng) if given is None else given,
        inputs.foreign_csv(","),
    )


@functools.cache
def whole_bag(form: str) -> str:
    """The log that the undamaged bag becomes."""
    with tempfile.TemporaryDirectory() as folder:
        inputs.fill(Path(folder), inputs.bag(form))
        status, said = command(Path(folder), "import", next(iter(inputs.bag(form))).split("/")[0], "--out", "case")
        assert status == 0, said
        return (Path(folder) / "case/bag/log.csv").read_text()


def bag(place: Path, rng: random.Random, given: bytes | None = None) -> Result:
    """A bag: MCAP (zstd, lz4, without compression), in a folder, or sqlite3."""
    form = rng.choice(("mcap", "mcap-zstd", "mcap-lz4", "mcap-none", "mcap folder", "sqlite"))
    whole_bag(form)
    files = dict(inputs.bag(form))
    victim = rng.choice(list(files))
    files[victim] = (
        inputs.spoiled_text(files[victim], rng)
        if victim.endswith(".yaml")
        else inputs.spoiled_bytes(files[victim], rng)
    )
    inputs.fill(place, files)
    before = inputs.listing(place)
    status, said = command(place, "import", next(iter(files)).split("/")[0], "--out", "case")

    def judge() -> Result | None:
        if (place / "case/bag/log.csv").read_text() == whole_bag(form):
            return None
        if victim.endswith(".mcap"):
            from mcap.reader import make_reader

            try:
                for _ in make_reader(io.BytesIO(files[victim]), validate_crcs=True).iter_messages():
                    pass
            except Exception as error:  # whatever the library makes of damage
                raise Refused(f"{victim} is damaged ({type(error).__name__}: {str(error)[:80]})") from error
        return OPEN, f"{victim}: another content that is well-formed"

    return told(place, status, said, ("case/robot.toml", "case/bag/run.json", "case/bag/log.csv"), before, judge)


class Line:
    """A transport on which given bytes come, so many a read at most."""

    def __init__(self, data: bytes, rng: random.Random):
        self.data, self.rng, self.sent = data, rng, b""

    def send(self, data: bytes) -> None:
        self.sent = data

    def receive(self, count: int) -> bytes:
        got, self.data = self.data[:count], self.data[count:]
        return got

    def flush_input(self) -> None:
        pass

    def close(self) -> None:
        pass


def serial(place: Path, rng: random.Random, given: bytes | None = None) -> Result:
    """What comes on a serial line."""
    word, address = rng.randrange(2**32), rng.choice((0, 1, 7, 0x20))
    stream = b"".join(
        rng.choice(
            (
                b"",
                bytes(rng.randrange(20)),
                rng.randbytes(rng.randrange(30)),
                b"\x5a" * rng.randrange(4),
                encode_answer(rng.randrange(16), 0, address, rng.randrange(2**32)),
            )
        )
        + (
            inputs.spoiled_bytes(encode_answer(tag, 0, address, word), rng)
            if rng.random() < 0.6
            else encode_answer(tag, 0, address, word)
        )
        for tag in (1, 2, 3)
    )
    stream = stream if rng.random() < 0.9 else stream + rng.randbytes(NOISE_BYTES * 2)
    try:
        got = RegisterClient(Line(stream, rng), where="line").transfer(1, address)
    except LinkError as error:
        return (REFUSED, str(error)) if "\n" not in str(error) else (TROUBLE, repr(error))
    words = {
        value for tag in (1, 2, 3) for status, value in reference.serial_words(stream, tag, address) if status == 0
    }
    return (RIGHT, "") if got in words else (MISREAD, f"{got:#x} stands in no right answer")


class _NoProcess:
    pid = 0

    def poll(self):
        return 0

    def wait(self, timeout=None):
        return 0

    def kill(self):
        pass


class _FakeChild(Child):
    """A simulator's process that has ended, with this end of its socket."""

    def __init__(self, connection: socket.socket) -> None:
        self.socket, self.process, self.stderr, self.pid = connection, _NoProcess(), io.BytesIO(), 0

    def end(self) -> None:
        pass


class _Answered(RtlLink):
    """A link to a simulator whose answer waits in a socket already."""

    def __init__(self, connection: socket.socket) -> None:
        self._closed, self._effects, self._steps, self._sim, self.clocks, self.pid = False, False, 0, "fake", 0, 0
        self._child, self._recording, self.timeout_s = _FakeChild(connection), None, 1.0

    def samples(self, steps: int, every: int) -> np.ndarray:
        return self._request([0, 0, 0, 0], steps, every)

    def end(self) -> None:
        self._child.stderr.close()


def simulator(place: Path, rng: random.Random, given: bytes | None = None) -> Result:
    """What comes from a simulator as the answer to a request for samples."""
    rows, every = rng.randrange(1, 9), rng.randrange(1, 4)
    steps = rows * every
    values = [rng.uniform(-10, 10) for _ in range(4 * rows)]
    right = (
        protocol.HEADER.pack(protocol.SAMPLES, 16 + 16 * rows)
        + protocol.SAMPLES_HEAD.pack(0, steps, 7)
        + struct.pack(f"<{4 * rows}f", *values)
    )
    data = inputs.spoiled_bytes(right, rng) if rng.random() < 0.85 else right
    ours, theirs = socket.socketpair()
    theirs.sendall(data)
    theirs.shutdown(socket.SHUT_WR)
    link = _Answered(ours)
    try:
        got = link.samples(steps, every)
    except LinkError as error:
        return (REFUSED, str(error)) if "\n" not in str(error) else (TROUBLE, repr(error))
    finally:
        ours.close()
        theirs.close()
        link.end()
    try:
        wanted = reference.samples_frame(data, rows, steps)
    except Refused as why:
        return MISREAD, f"accepted, though {why}"
    same = np.array_equal(np.asarray(got, np.float32), np.array(wanted, np.float32), equal_nan=True)
    return (RIGHT, "") if same else (MISREAD, "other samples than the frame's")


def place_of(place: Path, rng: random.Random, given: bytes | None = None) -> Result:
    """Something that is no file where a file is wanted, for any of the arguments that name one."""
    inputs.fill(
        place,
        {
            **case_files(rng),
            "d.json": inputs.diagnosis_json(random.Random(0)),
            "log.csv": inputs.foreign_csv(","),
            "mapping.toml": (inputs.MAPPING % ",").encode(),
        },
    )
    victim = rng.choice(
        ("case/robot.toml", "case/run/run.json", "case/run/log.csv", "case/run", "d.json", "log.csv", "mapping.toml")
    )
    target, kind = place / victim, rng.choice(findings.PLACES)
    shutil.rmtree(target) if target.is_dir() else target.unlink()
    if kind == "a pipe":
        os.mkfifo(target)
    elif kind == "a device":
        target.symlink_to("/dev/zero")
    elif kind == "a link to itself":
        target.symlink_to(target)
    elif kind == "a folder":
        target.mkdir()
    before = inputs.listing(place)
    if victim in ("log.csv", "mapping.toml"):
        status, said = command(place, "import", "log.csv", "--mapping", "mapping.toml", "--out", "out")
    else:
        status, said = command(
            place, "predict", "case/run", "--robot", "case/robot.toml", "--diagnosis", "d.json", "--out", "out"
        )
    return told(place, status, said, ("out",), before, lambda: (MISREAD, f"{kind} in place of {victim} is accepted"))


def full(place: Path, rng: random.Random, given: bytes | None = None) -> Result:
    """A case whose log is spoiled, through the whole diagnosis."""
    files = case_files(rng)
    files["case/run/log.csv"] = inputs.spoiled_text(inputs.log_csv(), rng) if given is None else given
    inputs.fill(place, files)
    before = inputs.listing(place)
    status, said = command(place, "diagnose", "case", "--quick", "--jobs", "1", "--out", "out")

    def judge() -> Result | None:
        reference.log_csv(files["case/run/log.csv"])
        content = json.loads((place / "out/diagnosis.json").read_text())
        return None if content["verdict"] in ("none", "known", "partial", "unknown") else (TROUBLE, "no verdict")

    return told(place, status, said, ("out/diagnosis.json", "out/report.html"), before, judge)


KINDS = {
    "log": log,
    "robot": robot,
    "run.json": run_json,
    "diagnosis": diagnosis,
    "table": table,
    "mapping": mapping,
    "bag": bag,
    "serial": serial,
    "simulator": simulator,
    "place": place_of,
    "full": full,
}
# How often each comes, and how many go through the whole diagnosis (seconds each).
SHARES = {
    "log": 6,
    "robot": 4,
    "run.json": 2,
    "diagnosis": 4,
    "table": 4,
    "mapping": 3,
    "bag": 4,
    "serial": 3,
    "simulator": 3,
    "place": 1,
}


def plan(count: int, whole: int) -> list[tuple[str, str | None]]:
    """(kind, name of a finding or None) of every input; the findings first, then the kinds in turn, the slow
    ones last.
    """
    known = [(kind, name) for kind, found in findings.FINDINGS.items() for name in found]
    turn = [kind for kind, share in SHARES.items() for _ in range(share)]
    random.Random(0).shuffle(turn)
    return (
        known
        + [(turn[k % len(turn)], None) for k in range(max(0, count - len(known) - whole))]
        + [("full", None)] * whole
    )


def attempt(seed: int, number: int, kind: str, name: str | None, place: Path) -> Result:
    """One input; whatever it raises is trouble."""
    given = findings.FINDINGS[kind][name] if name is not None else None
    try:
        return KINDS[kind](place, random.Random(f"{seed} {number} {kind}"), given)
    except BaseException:  # noqa: BLE001 - whatever it is, it is the finding
        return TROUBLE, traceback.format_exc(limit=-4).strip()[-600:]


def work(
    pipe: multiprocessing.connection.Connection, seed: int, first: int, steps: list[tuple[str, str | None]], folder: str
) -> None:
    """Inputs from number `first` on; tells the number before each and the result after it."""
    for number in range(first, len(steps)):
        kind, name = steps[number]
        pipe.send((number, None))
        place = Path(folder) / f"{number}"
        place.mkdir(parents=True)
        result = attempt(seed, number, kind, name, place)
        shutil.rmtree(place, ignore_errors=True)
        pipe.send((number, result))
    pipe.send((len(steps), None))


def answers(pipe: multiprocessing.connection.Connection, pid: int, seconds: float) -> bool:
    """Whether something comes within a time, in which what a busy machine lets the process wait for a processor is not
    counted.
    """

    def starved() -> float:
        try:
            return 1e-9 * int(Path(f"/proc/{pid}/schedstat").read_text().split()[1])
        except OSError:
            return 0.0

    began, before = time.monotonic(), starved()
    while not pipe.poll(1.0):
        if time.monotonic() - began - (starved() - before) > seconds:
            return False
    return True


def campaign(
    seed: int, steps: list[tuple[str, str | None]], seconds: float, show: Callable[[str], None]
) -> dict[str, Counter]:
    """All inputs in a process of its own, which is begun again where one hangs or kills it; kind -> counts of what came
    of them.
    """
    counts: dict[str, Counter] = {}
    until = time.monotonic() + seconds
    number, context = 0, multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        while number < len(steps) and time.monotonic() < until:
            ours, theirs = context.Pipe()
            process = context.Process(
                target=work, args=(theirs, seed, number, steps, f"{folder}/{number}"), daemon=True
            )
            process.start()
            theirs.close()
            # The first input also waits for the program to be loaded.
            allowed = 2 * HANG_S
            while True:
                result: Result | None = None
                try:
                    if not answers(ours, process.pid, allowed):
                        result = HANG, f"no end within {HANG_S:g} s"
                    else:
                        number, result = ours.recv()
                except EOFError:
                    process.join()
                    result = TROUBLE, f"the process died (exit status {process.exitcode})"
                    ended = True
                else:
                    ended = result is not None and result[0] == HANG
                allowed = HANG_S
                if result is not None:
                    kind, name = steps[number]
                    counts.setdefault(kind, Counter())[result[0]] += 1
                    if result[0] in BAD:
                        show(f"{result[0]}: {kind} {number}{f' ({name})' if name else ''}: {result[1]}")
                if ended or number == len(steps) or (result is not None and time.monotonic() > until):
                    break
            process.kill()
            process.join()
            ours.close()
            number += 1
    return counts


def summary(counts: dict[str, Counter]) -> str:
    """Counts as a table in Markdown."""
    columns = (REFUSED, RIGHT, OPEN, *BAD)
    rows = [f"| input | all | {' | '.join(columns)} |", "|---|" + "---:|" * (len(columns) + 1)]
    for kind, count in [*counts.items(), ("all", sum(counts.values(), Counter()))]:
        rows.append(f"| {kind} | {sum(count.values())} | " + " | ".join(str(count[c]) for c in columns) + " |")
    return "\n".join(rows)


def main() -> int:
    """Run it; 1 if anything is bad or the time did not suffice."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=3200, help="inputs in all")
    parser.add_argument("--full", type=int, default=5, help="how many of them go through the whole diagnosis")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=1800.0, help="no new input after this time")
    parser.add_argument("--kind", choices=KINDS, action="append", help="only these kinds")
    parser.add_argument("--only", type=int, metavar="NUMBER", help="this one input, in this process, its files kept")
    options = parser.parse_args()
    steps = plan(options.count, options.full)
    if options.only is not None:
        place = Path(tempfile.mkdtemp(prefix="fuzz-"))
        kind, name = steps[options.only]
        print(kind, name or "", place, *attempt(options.seed, options.only, kind, name, place), sep="\n")
        return 0
    if options.kind:
        steps = [step for step in steps if step[0] in options.kind]
    began = time.monotonic()
    counts = campaign(options.seed, steps, options.seconds, lambda line: print(line, flush=True))
    done = sum(sum(count.values()) for count in counts.values())
    print(summary(counts))
    bad = sum(count[c] for count in counts.values() for c in BAD)
    print(f"{done} of {len(steps)} inputs, seed {options.seed}, {time.monotonic() - began:.0f} s: {bad} bad")
    return 1 if bad or done < len(steps) else 0


if __name__ == "__main__":
    sys.exit(main())
