"""Tables: csv files of anyone's logger, with names and units as a mapping says."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from rtds_host.contract.runlog import twice
from rtds_host.errors import InputError, did_you_mean, listed, shown
from rtds_host.importers.mapping import Mapping, Source, Twist
from rtds_host.importers.series import NS, Series
from rtds_host.importers.units import FIXED
from rtds_host.vectors import given

# Rows and cells as texts take several times the file's size.
LARGEST_BYTES = 2**29
COMPRESSED = {b"\x1f\x8b": "gzip", b"PK\x03\x04": "zip", b"\x28\xb5\x2f\xfd": "zstd", b"BZh": "bzip2", b"\xfd7zX": "xz"}
NO_SAMPLE = ("", "nan", "na", "null", "none", "-")


class Table:
    """A csv file with a header line; an empty cell (or nan, null, -) is no sample.

    Raises
    ------
    InputError : unreadable, no header, no time column, time that is missing or goes back.
    """

    def __init__(self, path: Path, mapping: Mapping):
        self.path = path
        self.mapping = mapping
        self.notices: list[str] = []
        if not path.is_file():
            raise InputError(f"{path}: {'is not a file' if path.exists() else 'does not exist'}")
        try:
            if path.stat().st_size > LARGEST_BYTES:
                raise InputError(
                    f"{path}: is {path.stat().st_size / 2**30:.3g} GiB long, at most {LARGEST_BYTES / 2**30:.2g} "
                    "GiB are read; import parts of it (runs of one case)"
                )
            with open(path, "rb") as stream:
                start = stream.read(4)
            for magic, kind in COMPRESSED.items():
                if start.startswith(magic):
                    raise InputError(f"{path}: is compressed ({kind}), unpack it first")
            text = path.read_bytes().decode("utf-8-sig")
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror})") from error
        except UnicodeDecodeError as error:
            raise InputError(f"{path}: is not text (byte {error.start})") from error
        lines = text.splitlines()[mapping.skip_rows :]
        if not lines or not lines[0].strip():
            raise InputError(
                f"{path}: row {mapping.skip_rows + 1}: a header line with the names of the columns is needed"
            )
        try:
            rows = list(csv.reader(lines, delimiter=mapping.delimiter))
        except csv.Error as error:
            raise InputError(f"{path}: is not a csv file ({error})") from error
        self.names = [name.strip() for name in rows[0]]
        if (double := twice(self.names)) is not None:
            raise InputError(f"{path}: row {mapping.skip_rows + 1}: column {shown(double)} appears twice")
        self.first_row = mapping.skip_rows + 2
        self.rows: list[tuple[int, list[str]]] = []
        for number, row in enumerate(rows[1:], start=self.first_row):
            if not row or row == [""]:
                continue
            if len(row) != len(self.names):
                end = ", the file is truncated" if number == self.first_row + len(rows) - 2 else ""
                raise InputError(f"{path}: row {number}: has {len(row)} cells, the header names {len(self.names)}{end}")
            self.rows.append((number, row))
        if len(self.rows) < 2:
            raise InputError(f"{path}: has {len(self.rows)} rows of numbers, at least 2 are needed")
        self._set_clock()

    def _set_clock(self) -> None:
        """Times of the rows, `t_ns`, from the mapping's column."""
        path, mapping = self.path, self.mapping
        if mapping.time_column is None:
            raise InputError(f"{mapping.path}: [time] column: missing, a table needs the name of its time column")
        t = self._numbers(mapping.time_column, f"{mapping.path}: [time]")
        for k, value in enumerate(t):
            if not math.isfinite(value):
                raise InputError(f"{path}: row {self.rows[k][0]}: {mapping.time_column} is empty")
        # Relative to the first row before scaling: an epoch in ns has more digits than a double.
        relative = (t - t[0]) * FIXED["time"][mapping.time_unit]
        back = np.flatnonzero(np.diff(relative) < 0)
        if back.size:
            k = int(back[0])
            raise InputError(
                f"{path}: row {self.rows[k + 1][0]}: time goes back ({mapping.time_column} is "
                f"{t[k]:.10g}, then {t[k + 1]:.10g})"
            )
        if relative[-1] <= 0:
            raise InputError(f"{path}: all rows have one and the same time")
        self.t_ns = np.round(relative * NS).astype(np.int64)

    def _numbers(self, name: str, place: str) -> np.ndarray:
        if name not in self.names:
            raise InputError(
                f"{self.path}: column {name!r} ({place}): missing, columns are {listed(self.names)}"
                f"{did_you_mean(name, self.names)}"
            )
        k = self.names.index(name)
        values = np.empty(len(self.rows))
        for n, (number, row) in enumerate(self.rows):
            cell = row[k].strip()
            if cell.lower() in NO_SAMPLE:
                values[n] = math.nan
                continue
            try:
                # Python would take 1_0 for 10, and digits of any script.
                if "_" in cell or not cell.isascii():
                    raise ValueError(cell)
                values[n] = float(cell.replace(",", ".") if self.mapping.decimal == "," else cell)
            except ValueError as error:
                raise InputError(f"{self.path}: row {number}: {name} is {shown(cell)}, not a number") from error
            if math.isinf(values[n]):
                raise InputError(f"{self.path}: row {number}: {name} is infinite")
        return values

    @staticmethod
    def _columns(request: Source | Twist) -> tuple[str | None, ...]:
        if isinstance(request, Twist):
            return (request.linear, request.angular)
        return request.pair or (request.column,)

    def read(self, requests: Iterable[Source | Twist]) -> None:
        """Nothing to do: the file is in memory (a bag decodes here)."""

    def available(self, request: Source | Twist) -> bool:
        """Whether the columns are there; a named column that is missing is an error, not an absence."""
        return request.topic is None and all(name is not None for name in self._columns(request))

    def wanting(self, request: Source | Twist) -> str:
        """What the table lacks, for a message."""
        return f"{request.place} names no column"

    def series(self, request: Source | Twist) -> Series:
        """Samples of a request, empty cells dropped.

        Raises
        ------
        InputError : a column is missing, a cell is no number.
        """
        names = [given(name, "column") for name in self._columns(request)]
        parts = [self._numbers(name, request.place) for name in names]
        values = parts[0] if len(parts) == 1 else np.column_stack(parts)
        finite = np.isfinite(values.reshape(len(values), -1)).all(axis=1)
        return Series(self.t_ns, values, f"{self.path.name} {', '.join(names)}").keep(finite)
