"""WPILib data logs (.wpilog), read with the project's own library (`robotpy-wpiutil`, the extra `wpilog`).

A log holds entries, each with samples of its own at times of its own, in microseconds since the robot started. A
mapping names an entry as it names a column of a table. Numbers and truth values count, all else (texts, arrays,
structs) is left out. A log that was cut off, as by switching the robot off, is read up to there.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rtds_host.contract.inputs import regular_bytes
from rtds_host.errors import InputError, did_you_mean, shown
from rtds_host.importers.mapping import Mapping, Source, Twist
from rtds_host.importers.series import Series
from rtds_host.importers.table import LARGEST_BYTES, Table
from rtds_host.vectors import given

SUFFIX = ".wpilog"
# How a record of each type of entry that is a number is read.
READ = {"double": "getDouble", "float": "getFloat", "int64": "getInteger", "boolean": "getBoolean"}
US_TO_NS = 1000


def is_wpilog(path: Path) -> bool:
    """Whether a path is named as a WPILib data log."""
    return path.suffix == SUFFIX


def read_entries(path: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Entries that hold numbers: name -> times in ns (n,) int64 and values (n,), in the order of the log.

    Raises
    ------
    InputError : no such log, too large, without a number, or the library is not installed.
    """
    records = _records(path)
    names: dict[int, tuple[str, str]] = {}
    found: dict[str, list[tuple[int, float]]] = {}
    try:
        for record in records:
            if record.isStart():
                start = record.getStartData()
                names[start.entry] = start.name, start.type
            elif not record.isControl() and record.getEntry() in names:
                name, kind = names[record.getEntry()]
                if kind in READ:
                    value = float(getattr(record, READ[kind])())
                    found.setdefault(name, []).append((record.getTimestamp() * US_TO_NS, value))
    except (RuntimeError, ValueError, TypeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: is damaged: {' '.join(str(error).split())[:160]}") from error
    if not found:
        raise InputError(f"{path}: holds no entry with numbers")
    return {
        name: (np.array([t for t, _ in rows], dtype=np.int64), np.array([value for _, value in rows]))
        for name, rows in found.items()
    }


def _records(path: Path) -> Any:
    try:
        from wpiutil.log import DataLogReader
    except ImportError as error:
        raise InputError(
            f"{path}: a WPILib data log needs a library: pip install 'rtds-host[wpilog]'; or export it as csv"
        ) from error
    if not path.exists():
        raise InputError(f"{path}: does not exist")
    if path.is_file() and path.stat().st_size > LARGEST_BYTES:
        raise InputError(
            f"{path}: is {path.stat().st_size / 2**30:.3g} GiB long, at most {LARGEST_BYTES / 2**30:.2g} GiB are read"
        )
    try:
        reader = DataLogReader(regular_bytes(path), path.name)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    if not reader.isValid():
        raise InputError(f"{path}: is not a WPILib data log")
    return reader


class WpiLog(Table):
    """A log's entries as columns, each with a clock of its own.

    Raises
    ------
    InputError : as `read_entries`.
    """

    def __init__(self, path: Path, mapping: Mapping):
        self.path, self.mapping = path, mapping
        self.notices: list[str] = []
        self.entries = read_entries(path)

    def series(self, request: Source | Twist) -> Series:
        """Samples of a request, those that are no finite number dropped.

        Raises
        ------
        InputError : no such entry, its time goes back, or two entries of a pair were not logged together.
        """
        names = [given(name, "column") for name in self._columns(request)]
        parts = [self._entry(name, request.place) for name in names]
        t_ns = parts[0][0]
        if any(not np.array_equal(t_ns, other) for other, _ in parts[1:]):
            raise InputError(f"{self.path}: {', '.join(names)} were not logged at the same times ({request.place})")
        back = np.flatnonzero(np.diff(t_ns) < 0)
        if back.size:
            raise InputError(f"{self.path}: entry {names[0]}, sample {back[0] + 2}: time goes back")
        values = parts[0][1] if len(parts) == 1 else np.column_stack([value for _, value in parts])
        finite = np.isfinite(values.reshape(len(values), -1)).all(axis=1)
        return Series(t_ns, values, f"{self.path.name} {', '.join(names)}").keep(finite)

    def _entry(self, name: str, place: str) -> tuple[np.ndarray, np.ndarray]:
        if name not in self.entries:
            hint = did_you_mean(name, self.entries)
            raise InputError(f"{self.path}: no entry {shown(name)} with numbers is there{hint} ({place})")
        return self.entries[name]
