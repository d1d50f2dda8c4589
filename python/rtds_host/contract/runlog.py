"""Run folders and cases: reading with every check the contract asks for, and writing in the same format."""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rtds_host.contract.output import staged_folder
from rtds_host.contract.robot import Robot, load_robot
from rtds_host.errors import InputError

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
        return {"schema": SCHEMA, "scenario": self.scenario, "payload_kg": self.payload_kg,
                "slope_rad": self.slope_rad, "uphill_yaw_rad": self.uphill_yaw_rad, "notes": self.notes}


@dataclass(frozen=True)
class RunLog:
    """One recorded run.

    `t` (n,) s, strictly increasing; `columns`: name -> (n,) float64 with NaN where a row has no sample
    (commands never have NaN: an empty cell keeps the last); `notices`: what was ignored or repaired.
    """

    name: str
    meta: RunMeta
    t: np.ndarray
    columns: dict[str, np.ndarray]
    path: Path | None = None
    notices: tuple[str, ...] = ()

    def has(self, channel: str) -> bool:
        """Whether at least one sample of the channel exists."""
        column = self.columns.get(channel)
        return column is not None and bool(np.isfinite(column).any())

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
        raise InputError(f"{folder}: neither log.csv nor log.parquet is there")
    if len(found) > 1:
        raise InputError(f"{folder}: both log.csv and log.parquet are there, keep one")
    return found[0]


def read_json(path: Path) -> object:
    """Content of a JSON file, with or without a byte order mark. InputError where it cannot be read or is none."""
    try:
        return json.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not valid JSON ({error})") from error


def _meta_content(path: Path) -> dict:
    data = read_json(path)
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise InputError(f"{path}: schema: is {data.get('schema') if isinstance(data, dict) else data!r}, "
                         f"this program reads {SCHEMA!r}")
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
            raise InputError(f"{path}: {key}: is {value!r}, a finite number is needed")
        if not low <= value <= high:
            hint = " (degrees?)" if key.endswith("_rad") else ""
            raise InputError(f"{path}: {key}: is {str(value)[:20]}, it must lie within {low:g} to {high:g}{hint}")
        return float(value)

    def text(key: str) -> str:
        value = data.get(key, "")
        if not isinstance(value, str | None):
            raise InputError(f"{path}: {key}: is {value!r}, a text is needed")
        return value or ""

    return RunMeta(scenario=text("scenario"), payload_kg=number("payload_kg", 0.0, 1e4),
                   slope_rad=number("slope_rad", -1.2, 1.2), uphill_yaw_rad=number("uphill_yaw_rad", -100.0, 100.0),
                   notes=text("notes"))


def _value(cell: str) -> float:
    """Number in a cell; Python alone would also take `1_0` and the digits of any script."""
    if "_" in cell or not cell.isascii():
        raise ValueError(cell)
    return float(cell)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _read_csv(path: Path) -> tuple[dict[str, np.ndarray], list[int]]:
    """Columns, and the row of the file that each sample stands in."""
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is no text (byte {error.start})") from error
    lines = text.replace("\r\n", "\n").replace("\r", "\n").removesuffix("\n").split("\n")
    if not lines or not lines[0].strip():
        raise InputError(f"{path}: is empty, a header line is needed")
    names = _header(path, lines[0])
    if len(set(names)) != len(names):
        twice = sorted({name for name in names if names.count(name) > 1})
        raise InputError(f"{path}: row 1: column {twice[0]!r} stands twice")
    if text and not text.endswith(("\n", "\r")) and len(lines) > 1 and lines[-1].count(",") != len(names) - 1:
        raise InputError(f"{path}: row {len(lines)}: ends in the middle, the file is truncated")
    full = [number for number, line in enumerate(lines[1:], start=2) if line]
    body = "\n".join(lines[1:])
    try:
        # Fast path: a full table of plain numbers. Digits of other scripts pass for numbers in `loadtxt`, too.
        table = np.loadtxt(io.StringIO(body), delimiter=",", ndmin=2, comments=None) \
            if full and body.isascii() and "_" not in body else np.empty((0, len(names)))
        if table.shape == (len(full), len(names)) and np.isfinite(table).all():
            return {name: table[:, k] for k, name in enumerate(names)}, full
    except ValueError:
        pass
    wanted = [k for k, name in enumerate(names) if name in COLUMNS]
    columns: dict[int, list[float]] = {k: [] for k in wanted}
    for number in full:
        row = _cells(path, number, lines[number - 1])
        if len(row) != len(names):
            raise InputError(f"{path}: row {number}: has {len(row)} cells, the header names {len(names)}"
                             + (", the file is truncated" if number == len(lines) else ""))
        for k in wanted:
            cell = row[k].strip()
            if not cell:
                columns[k].append(math.nan)
                continue
            try:
                value = _value(cell)
            except ValueError as error:
                raise InputError(f"{path}: row {number}: {names[k]} is {cell!r}, no number") from error
            if not math.isfinite(value):
                raise InputError(f"{path}: row {number}: {names[k]} is {cell}, leave a cell empty where there is "
                                 "no sample")
            columns[k].append(value)
    result = {names[k]: np.asarray(values) for k, values in columns.items()}
    rows = len(next(iter(result.values()))) if result else 0
    result.update({name: np.full(rows, math.nan) for name in names if name not in result})
    return result, full


def _cells(path: Path, number: int, line: str) -> list[str]:
    try:
        return next(csv.reader([line]))
    except csv.Error as error:
        raise InputError(f"{path}: row {number}: is no row of a csv file ({error})") from error


def _header(path: Path, line: str) -> list[str]:
    names = [name.strip() for name in _cells(path, 1, line)]
    for other, word in ((";", "semicolons"), ("\t", "tabs")):
        if len(names) == 1 and other in line:
            raise InputError(f"{path}: row 1: its names are separated by {word}, commas are needed")
    if names and all(name and _is_number(name) for name in names):
        raise InputError(f"{path}: row 1: holds numbers, a header line is needed")
    return names


def _read_parquet(path: Path) -> dict[str, np.ndarray]:
    """Columns; sample k stands in row k + 1, a Parquet file has no header line."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(path)
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path}: cannot be read as Parquet ({str(error).splitlines()[0]})") from error
    columns = {}
    for name in table.column_names:
        column = table.column(name)
        if name not in COLUMNS:
            columns[name] = np.full(len(column), math.nan)
            continue
        if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type) or pa.types.is_null(column.type)):
            raise InputError(f"{path}: column {name}: holds {column.type}, numbers are needed")
        # Integers of nanoseconds are no doubles to the last digit.
        columns[name] = np.asarray(column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False), dtype=float).copy()
    return columns


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
        raise InputError(f"{folder}: is no run folder")
    about = _meta_content(folder / "run.json")
    meta = _meta(folder / "run.json", about)
    path = _log_path(folder)
    if path.suffix == ".csv":
        raw, rows = _read_csv(path)
    else:
        raw = _read_parquet(path)
        rows = range(1, 1 + max(map(len, raw.values()), default=0))
    notices = [f"run.json: key {key!r} is not in the contract, ignored" for key in about if key not in META_KEYS]
    notices += [f"{path.name}: column {name!r} is not in the contract, ignored" for name in raw if name not in COLUMNS]
    columns = {name: values for name, values in raw.items() if name in COLUMNS}

    mode = robot.driver.mode if robot else "voltage"
    sides = robot.sides if robot else ("l", "r")
    required = [c for c in COMMANDS[mode] if c.endswith(tuple(f"_{s}" for s in sides))]
    for name in ("t", *required):
        if name not in columns:
            raise InputError(f"{path}: column {name}: missing")
    if robot and robot.driver.bus == "measured" and not np.isfinite(columns.get("v_bus", np.array([]))).any():
        notices.append(f"{path.name}: no v_bus, though [driver] bus is \"measured\": the nominal voltage stands in for it")
    if need_measured and not any(f"{c}_{s}" in columns for c in ("w", "th") for s in sides):
        raise InputError(f"{path}: neither w_* nor th_* is there, a diagnosis needs at least one of them")

    t = columns.pop("t")
    if len(t) < 2:
        raise InputError(f"{path}: has {len(t)} rows, at least 2 are needed")
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        raise InputError(f"{path}: row {rows[bad[0]]}: t is missing or no finite number")
    back = np.flatnonzero(t[1:] <= t[:-1])
    if back.size:
        k = back[0]
        raise InputError(f"{path}: row {rows[k + 1]}: time goes back or stands still ({t[k]:.12g} s, then "
                         f"{t[k + 1]:.12g} s)")
    late = np.flatnonzero(t / 2 - t[0] / 2 > LONGEST_S / 2)
    if late.size:
        raise InputError(f"{path}: row {rows[late[0]]}: t is {t[late[0]]:.12g}, more than {LONGEST_S:g} s after the "
                         "first row (a jump of the clock, or not in seconds?)")
    for name, values in columns.items():
        limit = ABSURD_COMMAND if name in required else ABSURD
        wrong = np.flatnonzero(np.abs(values) > limit)
        if wrong.size:
            raise InputError(f"{path}: row {rows[wrong[0]]}: {name} is {values[wrong[0]]:g}, beyond anything possible")
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
        raise InputError(f"{folder}: is no case folder")
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
            raise InputError(f"{own}: describes another robot than {folder / 'robot.toml'}; "
                             "all runs of a case belong to one robot")
        runs.append(read_run(sub, robot, need_measured))
        notices += [f"{sub.name}/{notice}" for notice in runs[-1].notices]
    if not runs:
        raise InputError(f"{folder}: holds no run (a sub-folder with run.json)")
    wheels = [f"{c}_{s}" for c in ("w", "th") for s in robot.sides]
    if need_measured and not any(robot.noise(c) for run in runs for c in wheels if c in run.columns):
        raise InputError(f"{folder / 'robot.toml'}: [sensors] names the noise of no w_* or th_* that the runs hold, a "
                         "diagnosis has no unit to count in")
    return Case(name=folder.resolve().name, robot=robot, runs=tuple(runs), path=folder, notices=tuple(notices))


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

            arrays = {name: pa.array(np.asarray(values, dtype=float), from_pandas=True)
                      for name, values in columns.items()}
            pq.write_table(pa.table(arrays), scratch / "log.parquet", compression="zstd")
        else:
            write_csv(scratch / "log.csv", columns)
