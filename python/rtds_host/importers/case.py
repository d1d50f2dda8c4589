"""Recordings into a case folder: the nominal robot with its driver section, and one run a recording."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from rtds_host.compat import UTC, tomllib
from rtds_host.contract import Robot, RunMeta, builtin_robot_path, load_robot, read_run, staged_folder, write_run
from rtds_host.contract.robot import SERVO_GAINS
from rtds_host.errors import InputError
from rtds_host.importers.assemble import Imported, assemble
from rtds_host.importers.bag import is_bag, refuse_other
from rtds_host.importers.detect import likely_mapping
from rtds_host.importers.mapping import Mapping, load_mapping
from rtds_host.importers.series import NS
from rtds_host.importers.sysid import is_sysid, read_sysid, tests_in

SERVO_KEYS = ("kp_v_s_per_rad", "ki_v_per_rad", "limit_v", "period_s")


@dataclass(frozen=True)
class ImportedRun:
    """What became of one recording: the run's name, its columns, the start on the recording's clock, notices;
    `assumed`: which mapping and which nominal robot it was read with, and who said so."""

    name: str
    imported: Imported
    meta: RunMeta
    assumed: str = ""


def import_case(
    sources: Sequence[str | os.PathLike],
    out: str | os.PathLike,
    robot: str | None = None,
    mapping: str | os.PathLike | None = None,
    append: bool = False,
    names: Sequence[str] = (),
    meta: RunMeta | None = None,
    start_s: float = 0.0,
    end_s: float = math.inf,
    trust_units: bool = False,
    form: str = "csv",
    namespace: str | None = None,
) -> list[ImportedRun]:
    """Import bags or tables as the runs of one case; the folder is complete afterwards, or untouched.

    Parameters
    ----------
    sources : bags (folders, .mcap, .db3) or csv files, one run each; SysId's .json files, a run a test.
    out : the case's folder; new, unless `append`.
    robot : name of a built-in robot or path of a robot.toml; the mapping's, and with `append` the case's, if None.
    mapping : path or name of a mapping; one that fits the first recording if None.
    append : add runs to a case that exists; its robot and its mode must be the same.
    names : names of the runs, one a source; the sources' own if empty.
    meta : what run.json shall say of every run; the mapping's [runs.NAME] overrides it.
    namespace : of the robot's topics in the bags, such as "/tb3_0"; the only one there is, if None.

    Raises
    ------
    InputError : one line that names the file, the topic, column or key, and what is wrong. OutputError : the place
        cannot be written.
    """
    meta = meta or RunMeta(scenario="", notes="")
    out = Path(out)
    paths = [Path(source) for source in sources]
    _check_sources(paths, start_s, end_s)
    told = "given"
    if mapping is None:
        for path in paths:
            if not is_bag(path) and not is_sysid(path):
                likely_mapping(path)
        mapping, told = likely_mapping(paths[0]), "taken for this recording; --mapping NAME for another"
    mapped = load_mapping(mapping)
    parts = [(path, part) for path in paths for part in (tests_in(read_sysid(path)) if is_sysid(path) else [""])]
    # One file of several tests: the tests name the runs.
    stems = [
        Path(part) if part and len(paths) == 1 else path.with_name(f"{path.stem}-{part}") if part else path
        for path, part in parts
    ]
    nominal_path = _nominal_path(out, robot, mapped, append)
    nominal = load_robot(nominal_path)
    whose = "given" if robot is not None else "the case's" if append else "the mapping's; --robot NAME for another"
    assumed = f"mapping {mapped.name} ({told}); nominal robot {nominal.name} ({whose})"
    runs: list[ImportedRun] = []
    for (path, part), name in zip(parts, _names(stems, names, out if append else None), strict=True):
        said = replace(meta, **mapped.runs.get(name, {}))
        _check_meta(mapped.path, name, said)
        imported = assemble(
            path, mapped, nominal, start_s, end_s, trust_units, said.slope_rad != 0.0, form, namespace, part
        )
        if runs and imported.mode != runs[0].imported.mode:
            raise InputError(
                f"{path}: holds {imported.mode} commands, {runs[0].imported.path} holds "
                f"{runs[0].imported.mode} commands; all runs of a case need the same"
            )
        runs.append(
            ImportedRun(
                name,
                imported,
                replace(said, scenario=said.scenario or name, notes=said.notes or _origin(path, mapped, imported)),
                assumed,
            )
        )

    for k, run in enumerate(runs):
        if mapped.driver.get("bus") == "measured" and "v_bus" not in run.imported.columns:
            told = f"{run.imported.path.name}: v_bus is not there, the bus is taken to hold its nominal voltage"
            runs[k] = replace(run, imported=replace(run.imported, notices=(*run.imported.notices, told)))
    _write(runs, out, case_robot(nominal_path, nominal, mapped, runs[0].imported.mode), append, form)
    return runs


def _check_sources(paths: list[Path], start_s: float, end_s: float) -> None:
    """Whether there is something to import, and the times make sense.

    Raises
    ------
    InputError : there is not; names the option or the file.
    """
    for option, value in (("--start-s", start_s), ("--end-s", end_s)):
        if math.isnan(value) or value < 0 or start_s == math.inf:
            raise InputError(f"{option} {value:g}: a time from the recording's start on is needed, in seconds")
    if start_s >= end_s:
        raise InputError(f"--start-s {start_s:g}: lies not before --end-s {end_s:g}")
    if not paths:
        raise InputError("nothing to import: give at least one bag or csv file")
    for path in paths:
        if not path.exists():
            raise InputError(f"{path}: does not exist")
        refuse_other(path)


def _nominal_path(out: Path, robot: str | None, mapped: Mapping, append: bool) -> Path:
    """Where the nominal robot is read from.

    Raises
    ------
    InputError : no robot is named, or the case is there already, or is not there.
    """
    exists = out.is_dir() and any(out.iterdir())
    if exists and not append:
        raise InputError(f"{out}: exists already; --append adds runs to it")
    if append and not (out / "robot.toml").is_file():
        raise InputError(f"{out / 'robot.toml'}: missing, there is no case to append to")
    if append and robot is None:
        return out / "robot.toml"
    name = robot or mapped.robot
    if name is None:
        raise InputError(f"{out}: no nominal robot: give --robot NAME or --robot FILE (or robot = in the mapping)")
    if os.path.sep not in name and not name.endswith(".toml"):
        return builtin_robot_path(name)
    # A mapping's path is relative to the mapping.
    return Path(name) if robot is not None else mapped.path.parent / name


def _write(runs: list[ImportedRun], out: Path, text: str, append: bool, form: str) -> None:
    """The case, whole or not at all; `text` is its robot.toml."""
    with staged_folder(out) as scratch, _named(scratch, out):
        (scratch / "robot.toml").write_text(text, encoding="utf-8")
        robot_written = load_robot(scratch / "robot.toml")
        if append:
            there = load_robot(out / "robot.toml")
            _same_robot(out / "robot.toml", there, robot_written)
            (scratch / "robot.toml").unlink()
        for run in runs:
            write_run(scratch / run.name, run.meta, run.imported.columns, form)
            read_run(scratch / run.name, robot_written, need_measured=True)


@contextmanager
def _named(scratch: Path, out: Path) -> Iterator[None]:
    """What is wrong with the case is said of the place where it would have stood."""
    try:
        yield
    except InputError as error:
        raise InputError(str(error).replace(str(scratch), str(out))) from error


def _names(paths: list[Path], names: Sequence[str], case: Path | None) -> list[str]:
    if names and len(names) != len(paths):
        raise InputError(f"{len(paths)} recordings but {len(names)} names were given")
    result = []
    wanted: Sequence[str | None] = names or [None] * len(paths)
    for path, name in zip(paths, wanted):
        if name is None:
            stem = path.resolve().name if path.is_dir() else path.stem
            name = re.sub(r"[^A-Za-z0-9_.-]+", "_", stem).strip("._-") or "run"
        elif not re.fullmatch(r"[A-Za-z0-9_-][A-Za-z0-9_.-]*", name):
            raise InputError(f"run name {name!r}: use letters, digits, _ . and - only")
        if name in result:
            raise InputError(f"{path}: two recordings would become the run {name!r}; give --name for each")
        if case is not None and (case / name).exists():
            raise InputError(f"{case / name}: the case has this run already; give another --name")
        result.append(name)
    return result


def _check_meta(path: Path, name: str, meta: RunMeta) -> None:
    bounds = {"payload_kg": (0.0, 1e4), "slope_rad": (-1.2, 1.2), "uphill_yaw_rad": (-100.0, 100.0)}
    for key, (low, high) in bounds.items():
        value = getattr(meta, key)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
            raise InputError(
                f"run {name}: {key} is {value!r}, a number within {low:g} to {high:g} is needed "
                f"(option, or [runs] in {path})"
            )
    for key in ("scenario", "notes"):
        if not isinstance(getattr(meta, key), str):
            raise InputError(f"run {name}: {key} is {getattr(meta, key)!r}, a text is needed ([runs] in {path})")


def _origin(path: Path, mapping: Mapping, imported: Imported) -> str:
    text = f"imported from {path.name} with the mapping {mapping.name}"
    # A clock that counts from 2000 on or later is the wall's.
    if imported.start_ns > 946_684_800 * NS:
        start = datetime.fromtimestamp(imported.start_ns // NS, UTC)
        text += f", recorded {start.isoformat().replace('+00:00', 'Z')}"
    return text


def case_robot(path: Path, nominal: Robot, mapping: Mapping, mode: str) -> str:
    """Text of the case's robot.toml: the nominal robot's own text, its driver section and inner loop set.

    Raises
    ------
    InputError : speed mode, and neither the mapping nor the robot declares the inner loop.
    """
    text = path.read_text(encoding="utf-8-sig")
    data = tomllib.loads(text)
    driver = {"mode": mode, **{k: v for k, v in data.get("driver", {}).items() if k != "mode"}, **mapping.driver}
    if mode != "torque":
        driver.pop("torque_nm_per_v", None)
    blocks = {"driver": driver}
    if mode == "speed":
        servo = {"limit_v": nominal.supply_v, **data.get("servo", {}), **mapping.servo}
        # Gains that nobody knows are estimated from the runs.
        missing = [key for key in SERVO_KEYS if key not in servo and key not in SERVO_GAINS]
        if missing:
            raise InputError(
                f"{mapping.path}: [servo] {missing[0]}: missing; a log without voltages needs the inner "
                "speed loop, in the mapping or in the robot"
            )
        blocks["servo"] = {key: servo[key] for key in SERVO_KEYS if key in servo}
    dropped = {"driver", "servo"}
    if mapping.sensors:
        blocks["sensors"] = {**data.get("sensors", {}), **mapping.sensors}
        dropped.add("sensors")

    kept, inside = [], False
    for line in text.splitlines():
        header = re.match(r"\s*\[\s*([A-Za-z0-9_.-]+)\s*\]", line)
        if header:
            inside = header[1] in dropped
        if not inside:
            kept.append(line)
    while kept and not kept[-1].strip():
        kept.pop()
    for name, table in blocks.items():
        kept += [
            "",
            f"[{name}]"
            + {
                "driver": "                                    # set by rtds import",
                "servo": "                                     # nominal inner speed loop",
            }.get(name, ""),
        ]
        kept += [
            f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value!r}" for key, value in table.items()
        ]
    return "\n".join(kept) + "\n"


def _same_robot(path: Path, there: Robot, new: Robot) -> None:
    if there.driver.mode != new.driver.mode:
        raise InputError(
            f"{path}: the case holds {there.driver.mode} commands, the recording holds {new.driver.mode} "
            "commands; all runs of a case need the same"
        )
    if replace(there, name="") != replace(new, name=""):
        parts = [
            key
            for key in ("motor", "supply_v", "chassis", "axis", "driver", "servo", "sensors", "tolerance")
            if getattr(there, key) != getattr(new, key)
        ]
        raise InputError(
            f"{path}: the case's robot differs from the recording's in {', '.join(parts)}; "
            "all runs of a case belong to one robot"
        )
