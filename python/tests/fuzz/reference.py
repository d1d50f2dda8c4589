"""Readers of the fuzz harness' own: what an input says, or why it says nothing. They share no code with the program.

Each raises `Refused` for an input that must not be accepted. They judge what the contract pins down and leave the rest
open.
"""

from __future__ import annotations

import binascii
import itertools
import json
import math
import struct

from rtds_host.compat import tomllib

KNOWN = (
    "t",
    "v_cmd_l",
    "v_cmd_r",
    "w_cmd_l",
    "w_cmd_r",
    "v_bus",
    "i_l",
    "i_r",
    "w_l",
    "w_r",
    "th_l",
    "th_r",
    "gyro_z",
    "x",
    "y",
    "yaw",
    "w_ref_l",
    "w_ref_r",
)
DIGITS = set("0123456789+-.eE")


class Refused(Exception):
    """The input must not be accepted."""


def text_of(data: bytes) -> str:
    """UTF-8, with or without a byte order mark."""
    try:
        return data.removeprefix(b"\xef\xbb\xbf").decode("utf-8")
    except UnicodeDecodeError as error:
        raise Refused("no text") from error


def number(cell: str) -> float:
    """A decimal number as everybody writes it."""
    if not cell or not set(cell) <= DIGITS:
        raise Refused(f"{cell!r} is no number")
    try:
        value = float(cell)
    except ValueError as error:
        raise Refused(f"{cell!r} is no number") from error
    if not math.isfinite(value):
        raise Refused(f"{cell} is not finite")
    return value


def log_csv(data: bytes) -> dict[str, list[float]]:
    """Columns of a log.csv that the contract names, NaN where a cell is empty; commands hold their last value.

    A last row without an end, whose last cell is shorter than one of the hundred before, was cut: it is no row, but
    what is left of it must be right.
    """
    text = text_of(data)
    lines = [line for line in text.replace("\r\n", "\n").replace("\r", "\n").split("\n")]
    names = [name.strip().strip('"') for name in lines[0].split(",")]
    if len(set(names)) != len(names):
        raise Refused("a column twice")
    columns: dict[str, list[float]] = {name: [] for name in names if name in KNOWN}
    ends = [len(line[line.rfind(",") + 1 :]) for line in lines[1:] if line]
    cut = bool(lines[-1]) and len(ends) > 1 and ends[-1] < max(ends[-101:-1])
    if cut:
        lines[-1] = lines[-1][: len(lines[-1]) - ends[-1]]
        if names[-1] == "t":
            lines.pop()
    for line in lines[1:]:
        if not line:
            continue
        cells = [cell.strip().removeprefix('"').removesuffix('"').strip() for cell in line.split(",")]
        if len(cells) != len(names):
            raise Refused("a row of another length")
        for name, cell in zip(names, cells):
            if name in columns:
                columns[name].append(number(cell) if cell else math.nan)
    for name in ("t", "v_cmd_l", "v_cmd_r"):
        if name not in columns:
            raise Refused(f"no {name}")
    t = columns["t"]
    if len(t) < 2 or any(math.isnan(v) for v in t) or any(b <= a for a, b in itertools.pairwise(t)):
        raise Refused("time does not go on")
    if cut and names[-1] != "t":
        columns = {name: values[:-1] for name, values in columns.items()}
        if len(columns["t"]) < 2:
            raise Refused("no rows")
    for name in ("v_cmd_l", "v_cmd_r"):
        if math.isnan(columns[name][0]):
            raise Refused("no first command")
        for k, value in enumerate(columns[name]):
            if math.isnan(value):
                columns[name][k] = columns[name][k - 1]
    return columns


def json_object(data: bytes, *schemas: str) -> dict:
    """A JSON object of one of the schemas, plain JSON only."""
    try:
        content = json.loads(text_of(data))
    except (ValueError, RecursionError) as error:
        raise Refused("no JSON") from error
    if not isinstance(content, dict) or content.get("schema") not in schemas:
        raise Refused("another schema")
    return content


def real(value: object) -> float:
    """A finite number of JSON or TOML; a truth value is none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise Refused(f"{value!r} is no number")
    try:
        value = float(value)
    except OverflowError as error:
        raise Refused("beyond all numbers") from error
    if not math.isfinite(value):
        raise Refused("not finite")
    return value


def run_json(data: bytes) -> dict[str, float]:
    """The numbers of a run.json."""
    content = json_object(data, "rtds-run/1")
    return {key: real(content.get(key, 0.0)) for key in ("payload_kg", "slope_rad", "uphill_yaw_rad")}


POSITIVE = {
    "motor": (
        "resistance_ohm",
        "inductance_h",
        "torque_constant_nm_per_a",
        "back_emf_constant_v_s_per_rad",
        "rotor_inertia_kg_m2",
        "gear_ratio",
    ),
    "supply": ("voltage_v",),
    "chassis": ("mass_kg", "yaw_inertia_kg_m2", "wheel_radius_m", "track_width_m"),
}
NOT_NEGATIVE = {"motor": ("viscous_friction_nm_s_per_rad",), "chassis": ("wheel_inertia_kg_m2",)}
SENSORS = ("i_a", "w_rad_s", "th_rad", "gyro_rad_s", "xy_m", "yaw_rad", "v_bus_v")


def robot_toml(data: bytes) -> dict[tuple[str, str], float]:
    """(section, key) -> value of a differential drive in voltage mode; {} for another machine, which is not judged."""
    try:
        content = tomllib.loads(text_of(data))
    except (ValueError, RecursionError) as error:
        raise Refused("no TOML") from error
    if content.get("schema") != "rtds-robot/1":
        raise Refused("another schema")
    if "axis" in content or "driver" in content:
        return {}
    found = {}
    for table, low in ((POSITIVE, True), (NOT_NEGATIVE, False)):
        for section, keys in table.items():
            if not isinstance(content.get(section), dict):
                raise Refused(f"no [{section}]")
            for key in keys:
                if key not in content[section]:
                    raise Refused(f"no {key}")
                value = real(content[section][key])
                if value < 0 or (low and value == 0):
                    raise Refused(f"{key} is {value}")
                found[section, key] = value
    sensors = content.get("sensors")
    if not isinstance(sensors, dict):
        raise Refused("no [sensors]")
    for key in SENSORS:
        if key in sensors:
            found["sensors", key] = real(sensors[key])
            if found["sensors", key] <= 0:
                raise Refused(f"{key} is not above 0")
    return found


def diagnosis(
    data: bytes, schemas: tuple[str, ...], effects: dict[str, tuple[tuple[str, ...], tuple[str, ...]]]
) -> list[tuple]:
    """[(id, side, {parameter: value})]; `effects`: id -> (its sides, its parameters)."""
    content = json_object(data, *schemas)
    if not isinstance(content.get("effects"), list):
        raise Refused("no list of effects")
    found, taken = [], set()
    for entry in content["effects"]:
        if not isinstance(entry, dict) or not isinstance(entry.get("id"), str) or entry["id"] not in effects:
            raise Refused("no effect of the catalogue")
        sides, parameters = effects[entry["id"]]
        if entry.get("side") not in sides:
            raise Refused("no such side")
        for side in ("left", "right") if entry["side"] == "both" else (entry["side"],):
            if (entry["id"], side) in taken:
                raise Refused("an effect twice")
            taken.add((entry["id"], side))
        given = entry.get("parameters") or {}
        if not isinstance(given, dict):
            raise Refused("no parameters")
        values = {}
        for name, value in given.items():
            if name not in parameters:
                raise Refused(f"no parameter {name}")
            values[name] = real(value.get("value") if isinstance(value, dict) else value)
        found.append((entry["id"], entry["side"], values))
    for suffix, values in (content.get("nominal_fit") or {}).items():
        if suffix not in ("l", "r") or not isinstance(values, dict):
            raise Refused("no side of a nominal fit")
        for value in values.values():
            if real(value) <= 0:
                raise Refused("not above 0")
    return found


def foreign_csv(data: bytes, delimiter: str, names: tuple[str, ...]) -> dict[str, list[float]]:
    """Columns of a table of another logger, as raw numbers, NaN where there is no sample."""
    lines = text_of(data).splitlines()
    if not lines:
        raise Refused("empty")
    head = [cell.strip() for cell in lines[0].split(delimiter)]
    if any(head.count(name) != 1 for name in names):
        raise Refused("a column missing or twice")
    columns: dict[str, list[float]] = {name: [] for name in names}
    for line in lines[1:]:
        if not line:
            continue
        cells = [cell.strip() for cell in line.split(delimiter)]
        if len(cells) != len(head):
            raise Refused("a row of another length")
        for name in names:
            cell = cells[head.index(name)].strip()
            columns[name].append(math.nan if cell.lower() in ("", "nan", "na", "null", "none", "-") else number(cell))
    t = columns[names[0]]
    if any(math.isnan(v) for v in t) or any(b < a for a, b in itertools.pairwise(t)):
        raise Refused("time goes back")
    return columns


def serial_words(data: bytes, tag: int, address: int) -> set[tuple[int, int]]:
    """(status, word) of every right answer to a request in a stream of bytes; the CRC is the standard library's."""
    found = set()
    for at in range(len(data) - 8):
        frame = data[at : at + 9]
        if (
            frame[0] == 0x5A
            and binascii.crc_hqx(frame[:7], 0xFFFF) == int.from_bytes(frame[7:], "big")
            and frame[1] >> 4 == tag
            and frame[2] == address
        ):
            found.add((frame[1] & 15, int.from_bytes(frame[3:7], "little")))
    return found


def samples_frame(data: bytes, rows: int, steps: int) -> list[tuple[float, ...]]:
    """Rows of an answer of the simulator to a request for so many."""
    if len(data) < 8:
        raise Refused("cut")
    kind, length = struct.unpack_from("<II", data)
    if kind != 5 or length != 16 + 16 * rows or len(data) < 8 + length:
        raise Refused("another frame")
    flags, count, _ = struct.unpack_from("<IIQ", data, 8)
    if flags & 0b1111 or count != steps:
        raise Refused("flags, or another number of steps")
    return [struct.unpack_from("<4f", data, 24 + 16 * k) for k in range(rows)]
