"""Run folders and cases: reading with every check the contract asks for, and writing in the same format."""

from __future__ import annotations

import codecs
import csv
import io
import json
import math
import os
from collections import Counter, deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rtds_host.contract.clock import likely_unit
from rtds_host.contract.inputs import LARGEST_JSON, open_regular, regular_bytes
from rtds_host.contract.output import staged_folder
from rtds_host.contract.robot import Robot, load_robot
from rtds_host.errors import LONGEST_VALUE, InputError, brief, did_you_mean, listed, shown, visible

if TYPE_CHECKING:
    import pandas
    import pyarrow as pa
    import pyarrow.parquet as pq

SCHEMA = "rtds-run/1"
COMMANDS = {"voltage": ("v_cmd_l", "v_cmd_r"), "torque": ("v_cmd_l", "v_cmd_r"), "speed": ("w_cmd_l", "w_cmd_r")}
MEASURED = ("v_bus", "i_l", "i_r", "w_l", "w_r", "th_l", "th_r", "gyro_z", "x", "y", "yaw")
INFORMATION = ("w_ref_l", "w_ref_r")
COLUMNS = ("t", "v_cmd_l", "v_cmd_r", "w_cmd_l", "w_cmd_r", *MEASURED, *INFORMATION)
LOG_NAMES = ("log.csv", "log.parquet")
META_KEYS = ("schema", "scenario", "payload_kg", "slope_rad", "uphill_yaw_rad", "notes")
# No run lasts longer than about a day and nothing on a robot measures more than this: beyond it a unit is wrong, and
# a replay in steps of milliseconds would never end.
LONGEST_S = 1e5
ABSURD_COMMAND, ABSURD = 1e4, 1e9
# Numbers that one run may hold: ten million rows of all columns. A block of text read at a time; cells by which a
# cut one is known; a clock that counts since 1970 is past this.
LARGEST_BYTES = 2**31
BLOCK_BYTES = 2**22
CELLS_BEFORE = 100
# Notices of names that are ignored, one each; names in the one that is said of all of more. Rows of a Parquet file
# that are unpacked at a time.
MOST_NOTICES, FEW_NAMES = 50, 5
BATCH_ROWS = 2**18
# Rows closer than this, s, are no two samples: loggers count nanoseconds at the finest.
CLOSEST_S = 1e-10
SINCE_2000_S = 946_684_800.0


@dataclass(frozen=True)
class RunMeta:
    """What `run.json` says of a run."""

    scenario: str = "run"
    payload_kg: float = 0.0
    slope_rad: float = 0.0
    uphill_yaw_rad: float = 0.0
    notes: str = ""

    def to_json(self) -> dict:
        """The content of `run.json`."""
        return {
            "schema": SCHEMA,
            "scenario": self.scenario,
            "payload_kg": self.payload_kg,
            "slope_rad": self.slope_rad,
            "uphill_yaw_rad": self.uphill_yaw_rad,
            "notes": self.notes,
        }


def as_table(columns: dict[str, np.ndarray]) -> pandas.DataFrame:
    """Channels (n,) by name, `t` among them, as a table over time.

    Raises
    ------
    InputError : pandas is not installed.
    """
    try:
        import pandas
    except ImportError as error:
        raise InputError("pandas is not installed: pip install pandas") from error
    return pandas.DataFrame(columns).set_index("t")


@dataclass(frozen=True)
class RunLog:
    """One recorded run.

    `t` (n,) s, strictly increasing; `columns`: name -> (n,) float64 with NaN where a row has no sample
    (commands never have NaN: an empty cell keeps the last); `notices`: what was ignored or repaired; `unsure`: what a
    sample has beyond its channel's noise, name -> (n,) one standard deviation in the channel's unit, where it has any;
    `since_s`: how long the recording had gone on when this run began, s: of one that was cut, what it lost of its
    battery by then.
    """

    name: str
    meta: RunMeta
    t: np.ndarray
    columns: dict[str, np.ndarray]
    path: Path | None = None
    notices: tuple[str, ...] = ()
    unsure: dict[str, np.ndarray] = field(default_factory=dict)
    since_s: float = 0.0

    def to_pandas(self) -> pandas.DataFrame:
        """The run as a table: index `t`, s, and a column a channel, SI, NaN where a row has no sample.

        Raises
        ------
        InputError : pandas is not installed.
        """
        return as_table({"t": self.t, **self.columns})

    def has(self, channel: str) -> bool:
        """Whether at least one sample of the channel exists."""
        column = self.columns.get(channel)
        return column is not None and bool(np.isfinite(column).any())

    def rows(self, first: int, last: int) -> RunLog:
        """Rows first <= k < last as a run of the same name, with the times they have."""
        part = slice(first, last)
        return replace(
            self,
            t=self.t[part],
            columns={c: v[part] for c, v in self.columns.items()},
            unsure={c: v[part] for c, v in self.unsure.items()},
        )

    def noise(self, channel: str, sigma: float, rows: np.ndarray) -> np.ndarray:
        """One standard deviation of a channel's samples in some rows, of one that is `sigma` everywhere else."""
        beyond = self.unsure.get(channel)
        return np.full(len(rows), sigma) if beyond is None else np.hypot(sigma, beyond[rows])

    def commands(self, mode: str = "voltage") -> np.ndarray:
        """Commands (n, sides): `v_cmd_*` in V, or `w_cmd_*` in rad/s in speed mode."""
        return np.column_stack([self.columns[c] for c in COMMANDS[mode] if c in self.columns])


@dataclass(frozen=True)
class Case:
    """A nominal robot and the runs recorded on one physical robot."""

    name: str
    robot: Robot
    runs: tuple[RunLog, ...]
    path: Path | None = None
    notices: tuple[str, ...] = field(default=())


def _log_path(folder: Path) -> Path:
    found = [folder / name for name in LOG_NAMES if (folder / name).is_file()]
    if not found:
        raise InputError(f"{folder}: contains neither log.csv nor log.parquet")
    if len(found) > 1:
        raise InputError(f"{folder}: both log.csv and log.parquet are there, keep one")
    return found[0]


def read_json(path: Path) -> object:
    """Content of a JSON file, with or without a byte order mark. InputError where it cannot be read or is none."""
    try:
        return json.loads(regular_bytes(path, LARGEST_JSON).decode("utf-8-sig"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not valid JSON ({error})") from error


def read_object(path: Path) -> dict:
    """A JSON file that holds an object.

    Raises
    ------
    InputError : it cannot be read, is no JSON, or holds something else.
    """
    data = read_json(path)
    if not isinstance(data, dict):
        raise InputError(f"{path}: is not a JSON object")
    return data


def _meta_content(path: Path) -> dict:
    data = read_json(path)
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise InputError(
            f"{path}: schema: is {shown(data.get('schema') if isinstance(data, dict) else data)}, "
            f"this program reads {SCHEMA!r}"
        )
    return data


def read_meta(path: str | os.PathLike) -> RunMeta:
    """Read and check a `run.json`.

    Raises
    ------
    InputError : unreadable, not JSON, another schema, a value of the wrong kind or physically impossible.
    """
    path = Path(path)
    return _meta(path, _meta_content(path))


def _meta(path: Path, data: dict) -> RunMeta:
    def number(key: str, low: float, high: float) -> float:
        value = data.get(key, 0.0)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise InputError(f"{path}: {key}: is {shown(value)}, a finite number is needed")
        if not low <= value <= high:
            hint = " (degrees?)" if key.endswith("_rad") else ""
            raise InputError(f"{path}: {key}: is {shown(value, 20)}, it must lie within {low:g} to {high:g}{hint}")
        return float(value)

    def text(key: str) -> str:
        value = data.get(key, "")
        if not isinstance(value, str | None):
            raise InputError(f"{path}: {key}: is {shown(value)}, a text is needed")
        return value or ""

    return RunMeta(
        scenario=text("scenario"),
        payload_kg=number("payload_kg", 0.0, 1e4),
        slope_rad=number("slope_rad", -1.2, 1.2),
        uphill_yaw_rad=number("uphill_yaw_rad", -100.0, 100.0),
        notes=text("notes"),
    )


def _value(cell: str) -> float:
    """Number in a cell; Python alone would also take `1_0` and the digits of any script."""
    if "_" in cell or not cell.isascii():
        raise ValueError(cell)
    return float(cell)


def twice(names: list[str]) -> str | None:
    """The first of the names, in the order of the alphabet, that is there more than once; None where none is."""
    return min((name for name, count in Counter(names).items() if count > 1), default=None)


def _strange(file: str, names: list[str]) -> list[str]:
    """Notices of columns that the contract does not name: one each, or one of all where there are very many."""
    if len(names) > MOST_NOTICES:
        return [f"{file}: {len(names)} columns are not in the format, ignored: {listed(names, FEW_NAMES)}"]
    return [
        f"{file}: column {shown(name)} is not in the format, ignored{did_you_mean(name, COLUMNS)}" for name in names
    ]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


@dataclass
class _Table:
    """What is in a log: the contract's columns, name -> (n,); names it does not have; rows of the file; notices;
    whether the last row was cut, so that it is to be checked as far as it goes and then set aside."""

    columns: dict[str, np.ndarray]
    ignored: list[str]
    rows: np.ndarray
    notices: list[str]
    cut: bool = False


def _blocks(path: Path) -> Iterator[tuple[list[str], bool]]:
    """Lines of a text file in blocks, without their ends, and whether the last of them was ended at all.

    A block at a time: a log of a million rows is a tenth of a gigabyte, its lines as texts are half of one.
    """
    decoder = codecs.getincrementaldecoder("utf-8-sig")()
    newlines = io.IncrementalNewlineDecoder(None, translate=True)
    rest, at = "", 0
    try:
        with open_regular(path) as stream:
            while True:
                data = stream.read(BLOCK_BYTES)
                waiting = len(decoder.getstate()[0])
                try:
                    text = decoder.decode(data, final=not data)
                except UnicodeDecodeError as error:
                    raise InputError(f"{path}: is not text (byte {at - waiting + error.start})") from error
                at += len(data)
                lines = (rest + newlines.decode(text, final=not data)).split("\n")
                rest = lines.pop()
                if len(rest) > BLOCK_BYTES:
                    raise InputError(f"{path}: a row is longer than {BLOCK_BYTES} characters, this is no log")
                if not data:
                    yield (lines + [rest], False) if rest else (lines, True)
                    return
                if lines:
                    yield lines, True
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error


def read_columns(path: Path, known: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Columns of a csv file that a program knows by name, name -> (n,), NaN where a cell is empty; others are ignored.

    Raises
    ------
    InputError : unreadable, no table, a cell that is no number; or a column `t` whose times do not rise, or one row.
    """
    if not path.is_file():
        raise InputError(f"{path}: {'is not a file' if path.exists() else 'does not exist'}")
    table = _read_csv(path, known)
    if "t" in table.columns:
        if len(table.rows) < 2:
            raise InputError(f"{path}: has {len(table.rows)} rows, at least 2 are needed")
        _check_times(path, table.columns["t"], table.rows)
    return table.columns


def _read_csv(path: Path, known: tuple[str, ...] = COLUMNS) -> _Table:
    blocks = _blocks(path)
    lines, ended = next(blocks)
    if not lines or not lines[0].strip():
        raise InputError(f"{path}: is empty, a header line is needed")
    names = _header(path, lines.pop(0))
    if (double := twice(names)) is not None:
        raise InputError(f"{path}: row 1: column {shown(double)} appears twice")
    wanted = [name for name in names if name in known]
    parts: list[np.ndarray] = []
    rows: list[np.ndarray] = []
    notices: list[str] = []
    number, count = 2, 0
    # Last cells of the rows before, by which a cut one is known.
    last: deque[str] = deque(maxlen=CELLS_BEFORE)
    while True:
        cut = None
        if not ended and lines:
            final = number + len(lines) - 1
            if lines[-1].count(",") != len(names) - 1:
                raise InputError(f"{path}: row {final}: ends in the middle, the file is truncated")
            before = [*last, *(line.rsplit(",", 1)[-1] for line in lines[-CELLS_BEFORE - 1 : -1] if line)]
            if before and len(lines[-1].rsplit(",", 1)[-1]) < max(map(len, before)):
                cut = final
                lines[-1] = "" if names[-1] == "t" else lines[-1][: lines[-1].rfind(",") + 1]
                notices.append(f"{path.name}: row {final} ends inside its last cell, it is set aside")
        full = np.flatnonzero([bool(line) for line in lines])
        if full.size:
            parts.append(_block(path, names, wanted, [lines[k] for k in full], full + number))
            rows.append(full + number)
            count += full.size
            if count * max(len(wanted), 1) * 8 > LARGEST_BYTES:
                raise InputError(
                    f"{path}: row {number}: too long, more than {LARGEST_BYTES / 2**30:.2g} GiB of numbers "
                    "in one run; make several runs of it"
                )
        last.extend(line.rsplit(",", 1)[-1] for line in lines[-CELLS_BEFORE:] if line)
        number += len(lines)
        more = None if cut else next(blocks, None)
        if more is None:
            break
        lines, ended = more
    columns = {
        name: np.concatenate([part[:, k] for part in parts]) if parts else np.empty(0) for k, name in enumerate(wanted)
    }
    found = np.concatenate(rows) if rows else np.empty(0, int)
    return _Table(
        columns, [name for name in names if name not in known], found, notices, cut is not None and cut in found[-1:]
    )


def _block(path: Path, names: list[str], wanted: list[str], lines: list[str], numbers: np.ndarray) -> np.ndarray:
    """Numbers (rows, wanted) of some rows, NaN where a cell is empty; `numbers`: the rows of the file they stand in."""
    import pyarrow as pa
    from pyarrow import csv as arrow

    body = "\n".join(lines)
    if wanted and body.isascii() and "_" not in body:
        try:
            table = arrow.read_csv(
                io.BytesIO(body.encode()),
                read_options=arrow.ReadOptions(column_names=names, use_threads=False, block_size=len(body) + 1),
                convert_options=arrow.ConvertOptions(
                    include_columns=wanted, null_values=[""], column_types={name: pa.float64() for name in wanted}
                ),
            )
            chunks = [table.column(name).chunks for name in wanted]
            result = np.column_stack([np.concatenate([np.empty(0), *map(_doubles, each)]) for each in chunks])
            empty = sum(table.column(name).null_count for name in wanted)
            if table.num_rows == len(lines) and np.isfinite(result).sum() == result.size - empty:
                return result
        except pa.ArrowException:
            pass
    # What is not plain is read cell by cell, which knows what to complain of.
    result = np.full((len(lines), len(wanted)), math.nan)
    at = [names.index(name) for name in wanted]
    for k, line in enumerate(lines):
        row = _cells(path, int(numbers[k]), line)
        if len(row) != len(names):
            raise InputError(
                f"{path}: row {numbers[k]}: has {len(row)} cells, the header names {len(names)}"
                + (", the file is truncated" if k == len(lines) - 1 else "")
            )
        for j, column in enumerate(at):
            cell = row[column].strip()
            if not cell:
                continue
            try:
                value = _value(cell)
            except ValueError as error:
                raise InputError(f"{path}: row {numbers[k]}: {wanted[j]} is {shown(cell)}, not a number") from error
            if not math.isfinite(value):
                raise InputError(
                    f"{path}: row {numbers[k]}: {wanted[j]} is {cell[:LONGEST_VALUE]}, leave a cell empty where there "
                    "is no sample"
                )
            result[k, j] = value
    return result


def _doubles(array: pa.DoubleArray) -> np.ndarray:
    """Arrow's doubles (n,), NaN where there are none. Its own `to_numpy` loads pandas where that is installed."""
    there, values = array.buffers()
    count, offset = len(array), array.offset
    found = np.frombuffer(values, float, offset + count)[offset:] if values else np.full(count, math.nan)
    if there is None or not array.null_count:
        return found
    bits = np.unpackbits(np.frombuffer(there, np.uint8), count=offset + count, bitorder="little")[offset:]
    return np.where(bits, found, math.nan)


def _cells(path: Path, number: int, line: str) -> list[str]:
    try:
        return next(csv.reader([line]))
    except csv.Error as error:
        raise InputError(f"{path}: row {number}: is not a row of a csv file ({error})") from error


def _header(path: Path, line: str) -> list[str]:
    names = [name.strip() for name in _cells(path, 1, line)]
    for other, word in ((";", "semicolons"), ("\t", "tabs")):
        if len(names) == 1 and other in line:
            raise InputError(f"{path}: row 1: columns are separated by {word}; use commas")
    if names and all(name and _is_number(name) for name in names):
        raise InputError(f"{path}: row 1: holds numbers, a header line is needed")
    return names


def _read_parquet(path: Path) -> _Table:
    """Columns; sample k is in row k + 1, a Parquet file has no header line."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path) as file:
            names = file.schema_arrow.names
            wanted = [name for name in names if name in COLUMNS]
            for name in wanted:
                kind = file.schema_arrow.field(names.index(name)).type
                if names.count(name) > 1:
                    raise InputError(f"{path}: column {name!r} appears twice")
                if not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_null(kind)):
                    raise InputError(f"{path}: column {name}: holds {kind}, numbers are needed")
            # A few bytes may unpack to anything: what the file says of itself is looked at before it is unpacked.
            groups = [file.metadata.row_group(k) for k in range(file.metadata.num_row_groups)]
            unpacked = max(
                sum(
                    g.column(k).total_uncompressed_size
                    for g in groups
                    for k in range(g.num_columns)
                    if g.column(k).path_in_schema in wanted
                ),
                8 * file.metadata.num_rows * max(len(wanted), 1),
            )
            if unpacked > LARGEST_BYTES:
                raise InputError(
                    f"{path}: would unpack to {unpacked / 2**30:.3g} GiB ({file.metadata.num_rows} rows), at "
                    f"most {LARGEST_BYTES / 2**30:.2g} GiB are read; make several runs of it"
                )
            columns = _unpacked(path, file, wanted)
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path}: cannot be read as Parquet ({brief(str(error).splitlines()[0])})") from error
    count = len(columns[wanted[0]]) if wanted else 0
    return _Table(columns, [name for name in names if name not in COLUMNS], np.arange(1, count + 1), [])


def _unpacked(path: Path, file: pq.ParquetFile, wanted: list[str]) -> dict[str, np.ndarray]:
    """Columns of a Parquet file, name -> (n,), some rows at a time.

    A megabyte may hold forty million rows that all say the same. Times are looked at as they come, so that such a file
    is refused by its first rows.
    """
    import pyarrow as pa

    columns = {name: np.empty(file.metadata.num_rows) for name in wanted}
    done = 0
    for batch in file.iter_batches(BATCH_ROWS, columns=wanted, use_threads=False):
        part = slice(done, done + batch.num_rows)
        for name in wanted:
            # Integers of nanoseconds are no doubles to the last digit.
            columns[name][part] = _doubles(batch.column(name).cast(pa.float64(), safe=False))
        done = part.stop
        if "t" in columns:
            _check_times(path, columns["t"][max(part.start - 1, 0) : done], np.arange(max(part.start, 1), done + 1))
    return {name: values[:done] for name, values in columns.items()}


def _check_times(path: Path, t: np.ndarray, rows: np.ndarray) -> None:
    """Refuse times (n,), of rows (n,) of the file, that are missing, go back, or stand still.

    Raises
    ------
    InputError : names the row.
    """
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        raise InputError(f"{path}: row {rows[bad[0]]}: t is missing or not a finite number")
    back = np.flatnonzero(t[1:] <= t[:-1])
    if back.size:
        k = back[0]
        # Unix times in single precision stand still for two minutes, with six digits for a quarter of an hour.
        few = ": too few digits for times since 1970?" if t[k] > SINCE_2000_S else ""
        raise InputError(
            f"{path}: row {rows[k + 1]}: time goes back or stands still ({t[k]:.12g} s, then {t[k + 1]:.12g} s){few}"
        )
    close = np.flatnonzero(t[1:] / 2 - t[:-1] / 2 < CLOSEST_S / 2)
    if close.size:
        k = close[0]
        raise InputError(
            f"{path}: row {rows[k + 1]}: t is {t[k + 1]:.12g}, {t[k + 1] - t[k]:.3g} s after the row before: "
            "is it in seconds?"
        )


def read_run(folder: str | os.PathLike, robot: Robot | None = None, need_measured: bool = False) -> RunLog:
    """Read one run folder.

    Parameters
    ----------
    folder : holds `run.json` and `log.csv` or `log.parquet`.
    robot : tells which commands are required (its driver's mode, one side or two); without it two voltages.
    need_measured : a diagnosis also needs a `w_*` or `th_*`; a prediction does not.

    Raises
    ------
    InputError : a file, column, row or value that the contract does not allow; the message names it.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: is not a run folder")
    about = _meta_content(folder / "run.json")
    meta = _meta(folder / "run.json", about)
    path = _log_path(folder)
    table = _read_csv(path) if path.suffix == ".csv" else _read_parquet(path)
    columns, rows = table.columns, table.rows
    unknown = [key for key in about if key not in META_KEYS]
    notices = [f"run.json: key {shown(key)} is not in the format, ignored" for key in unknown[:MOST_NOTICES]]
    if len(unknown) > MOST_NOTICES:
        notices.append(f"run.json: {len(unknown) - MOST_NOTICES} more keys are not in the format, ignored")
    notices += _strange(path.name, table.ignored)
    notices += table.notices

    mode = robot.driver.mode if robot else "voltage"
    sides = robot.sides if robot else ("l", "r")
    required = [c for c in COMMANDS[mode] if c.endswith(tuple(f"_{s}" for s in sides))]
    for name in ("t", *required):
        if name not in columns:
            raise InputError(f"{path}: column {name}: missing")
    if robot and robot.driver.bus == "measured" and not np.isfinite(columns.get("v_bus", np.array([]))).any():
        notices.append(f'{path.name}: no v_bus, though [driver] bus is "measured": the nominal voltage is used')
    if need_measured and not any(f"{c}_{s}" in columns for c in ("w", "th") for s in sides):
        raise InputError(f"{path}: neither w_* nor th_* is there, a diagnosis needs at least one of them")

    t = columns.pop("t")
    whole = len(t) - table.cut
    if whole < 2:
        raise InputError(f"{path}: has {whole} rows, at least 2 are needed")
    _check_times(path, t, rows)
    late = np.flatnonzero(t / 2 - t[0] / 2 > LONGEST_S / 2)
    if late.size:
        unit = likely_unit(2.0 * float(np.median(np.diff(t / 2))))
        raise InputError(
            f"{path}: row {rows[late[0]]}: t is {t[late[0]]:.12g}, more than {LONGEST_S:g} s after the "
            f"first row ({f'is it in {unit}?' if unit else 'a jump of the clock, or not in seconds?'})"
        )
    for name, values in columns.items():
        limit = ABSURD_COMMAND if name in required else ABSURD
        wrong = np.flatnonzero(np.abs(values) > limit)
        if wrong.size:
            volts = ", in millivolts?" if name.startswith("v_") and abs(values[wrong[0]]) < 1e3 * limit else ""
            raise InputError(
                f"{path}: row {rows[wrong[0]]}: {name} is {values[wrong[0]]:g}, beyond anything possible{volts}"
            )
    t, columns = t[:whole], {name: values[:whole] for name, values in columns.items()}
    for name in required:
        values = columns[name]
        if not np.isfinite(values[0]):
            raise InputError(f"{path}: row {rows[0]}: {name} is empty, the first row needs a command")
        last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), 0))
        columns[name] = values[last]
    return RunLog(name=folder.name, meta=meta, t=t, columns=columns, path=path, notices=tuple(notices))


def read_case(folder: str | os.PathLike, need_measured: bool = True) -> Case:
    """Read a case: `robot.toml` and every sub-folder that holds a `run.json`, in the order of their names.

    Raises
    ------
    InputError : no robot, no run, a run that belongs to another robot (its own differing `robot.toml`), or
        anything that `read_run` rejects.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: is not a case folder")
    if not any(folder.iterdir()):
        raise InputError(f"{folder}: is empty, a case needs robot.toml and at least one run folder")
    robot = load_robot(folder / "robot.toml")
    notices, runs = list(robot.notices), []
    for sub in sorted(p for p in folder.iterdir() if p.is_dir() and not p.name.startswith(".")):
        if not (sub / "run.json").is_file():
            if any((sub / name).is_file() for name in LOG_NAMES):
                raise InputError(f"{sub / 'run.json'}: missing")
            notices.append(f"{sub.name}: holds no run.json, ignored")
            continue
        own = sub / "robot.toml"
        if own.is_file() and load_robot(own) != robot:
            raise InputError(
                f"{own}: describes another robot than {folder / 'robot.toml'}; all runs of a case belong to one robot"
            )
        runs.append(read_run(sub, robot, need_measured))
        notices += [f"{sub.name}/{notice}" for notice in runs[-1].notices]
    if not runs:
        raise InputError(f"{folder}: holds no run (a sub-folder with run.json)")
    wheels = [f"{c}_{s}" for c in ("w", "th") for s in robot.sides]
    if need_measured and not any(robot.noise(c) for run in runs for c in wheels if c in run.columns):
        raise InputError(
            f"{folder / 'robot.toml'}: [sensors] gives no noise for any w_* or th_* in the runs, so the gap has no unit"
        )
    return Case(name=folder.resolve().name, robot=robot, runs=tuple(runs), path=folder, notices=tuple(notices))


def places_of_run(folder: Path) -> list[Path]:
    """A run folder and the files in it that reading it looks for, there or not."""
    return [folder, *(folder / name for name in ("run.json", "robot.toml", *LOG_NAMES))]


def places_of_case(folder: Path) -> list[Path]:
    """A case folder, its robot, its runs and their files: what a result must not take the place of."""
    try:
        runs = [sub for sub in folder.iterdir() if (sub / "run.json").is_file()]
    except OSError:
        # Not there: reading it says so.
        runs = []
    return [folder, folder / "robot.toml", *(place for run in runs for place in places_of_run(run))]


def read_writable_case(folder: str | os.PathLike) -> Case:
    """`read_case`, where every name in it can be written into a result.

    Raises
    ------
    InputError : it cannot, or as `read_case`.
    """
    case = read_case(folder)
    for name in (case.name, *(run.name for run in case.runs)):
        try:
            name.encode("utf-8")
        except UnicodeEncodeError as error:
            raise InputError(f"{folder}: {visible(name)} is not a name in UTF-8; rename the folder") from error
    return case


def write_csv(path: Path, columns: Mapping[str, np.ndarray], digits: int = 9) -> None:
    """Write columns (each (n,)) as a contract's csv; NaN becomes an empty cell. `t` must be among them.

    `t` has 15 digits, else rows of a clock that counts since 1970 would all stand at one time.
    """
    names = list(columns)
    table = np.column_stack([np.asarray(columns[name], dtype=float) for name in names])
    forms = ["%.15g" if name == "t" else f"%.{digits}g" for name in names]
    with open(path, "w", encoding="ascii", newline="") as stream:
        stream.write(",".join(names) + "\n")
        for row in table:
            cells = ("" if math.isnan(value) else form % value for form, value in zip(forms, row))
            stream.write(",".join(cells) + "\n")


def write_run(folder: str | os.PathLike, meta: RunMeta, columns: Mapping[str, np.ndarray], form: str = "csv") -> None:
    """Write a run folder (`run.json` and the log) whole or not at all.

    Parameters
    ----------
    columns : name -> (n,), `t` first, contract's names only.
    form : "csv" or "parquet".

    Raises
    ------
    OutputError : the place cannot be written. ValueError : a column the contract does not name.
    """
    unknown = [name for name in columns if name not in COLUMNS]
    if unknown or "t" not in columns:
        raise ValueError(f"not in the contract: {unknown or 't is missing'}")
    with staged_folder(folder, owned=LOG_NAMES) as scratch:
        (scratch / "run.json").write_text(json.dumps(meta.to_json(), indent=1) + "\n")
        if form == "parquet":
            import pyarrow as pa
            import pyarrow.parquet as pq

            arrays = {
                name: pa.array(np.asarray(values, dtype=float), from_pandas=True) for name, values in columns.items()
            }
            pq.write_table(pa.table(arrays), scratch / "log.parquet", compression="zstd")
        else:
            write_csv(scratch / "log.csv", columns)
