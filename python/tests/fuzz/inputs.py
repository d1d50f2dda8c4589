"""Inputs of the fuzz harness: right ones, and what spoils them. All of it follows from a seed."""

from __future__ import annotations

import functools
import io
import json
import os
import random
import re
import sys
import tempfile
from pathlib import Path

import numpy as np

from rtds_host.contract import RunLog, RunMeta, builtin_robot, builtin_robot_path, write_csv
from rtds_host.diagnosis.effects import catalogue
from rtds_host.diagnosis.predict import DIAGNOSIS_SCHEMAS, predicted_columns

sys.path.insert(0, str(Path(__file__).parents[1] / "importers"))

NASTY = (
    "1e308",
    "-1e308",
    "1e-308",
    "nan",
    "NaN",
    "inf",
    "-Infinity",
    "",
    " ",
    "-",
    "0",
    "-0",
    "1_000",
    "0x10",
    "1,5",
    "1e400",
    "9" * 400,
    "\u0663",
    "\u00bd",
    "true",
    "null",
    '"',
    "'",
    "\x00",
    "\x1b[2J",
    "</script>",
    "1 2",
    "+1",
    "1.",
    ".5",
    "1e3",
    "#",
    ";",
    "\t",
    "=",
)
KEYS = ("t", "v_cmd_l", "v_cmd_r", "w_l", "w_r", "th_l", "i_r", "gyro_z", "x", "yaw", "w_cmd_l", "schema", "scenario")


@functools.cache
def columns() -> dict[str, np.ndarray]:
    """A run of the built-in robot, half a second, all channels, with noise."""
    robot = builtin_robot("burger")
    t = np.round(np.arange(50) * 0.01, 9)
    commands = {"v_cmd_l": 5.0 * np.sin(9.0 * t), "v_cmd_r": 4.0 * np.cos(7.0 * t)}
    found = predicted_columns(RunLog("run", RunMeta("run"), t, commands), robot)
    rng = np.random.default_rng(1)
    return {name: values + (robot.noise(name) or 0.0) * rng.standard_normal(len(t)) for name, values in found.items()}


@functools.cache
def log_csv() -> bytes:
    """The run as the contract's csv."""
    with tempfile.TemporaryDirectory() as folder:
        write_csv(Path(folder) / "log.csv", columns())
        return (Path(folder) / "log.csv").read_bytes()


@functools.cache
def robot_toml() -> bytes:
    """A robot.toml."""
    return builtin_robot_path("burger").read_bytes()


def run_json(rng: random.Random) -> bytes:
    """A run.json."""
    return json.dumps(
        {
            "schema": "rtds-run/1",
            "scenario": "run",
            "payload_kg": round(rng.uniform(0, 2), 3),
            "slope_rad": round(rng.uniform(-0.2, 0.2), 4),
            "uphill_yaw_rad": 0.5,
            "notes": "n",
        },
        indent=1,
    ).encode()


def diagnosis_json(rng: random.Random) -> bytes:
    """A diagnosis with up to four effects, sometimes on overlapping sides."""
    effects = []
    for _ in range(rng.randint(0, 4)):
        effect = rng.choice(list(catalogue(builtin_robot("burger")).values()))
        values = {
            p.name: {"value": rng.uniform(p.low, p.high) if rng.random() < 0.1 else rng.choice(p.starts), "ci90": None}
            for p in effect.parameters
        }
        effects.append(
            {
                "id": effect.id,
                "side": rng.choice(effect.sides),
                "subsystem": effect.subsystem,
                "probability": 0.9,
                "parameters": values,
            }
        )
    return json.dumps(
        {
            "schema": DIAGNOSIS_SCHEMAS[0],
            "verdict": "known",
            "effects": effects,
            "nominal_fit": {"l": {"resistance_ohm": 8.7}},
        },
        indent=1,
    ).encode()


MAPPING = """schema = "rtds-mapping/1"
name = "fuzz"
robot = "burger"

[table]
delimiter = "%s"

[time]
column = "time_ms"
unit = "ms"

[signal]
v_cmd_l = { column = "u_l", unit = "mV" }
v_cmd_r = { column = "u_r", unit = "mV" }
w_l = { column = "n_l", unit = "rpm" }
w_r = { column = "n_r", unit = "rpm", reverse = true }
i_l = { column = "c_l", unit = "mA" }
"""
FOREIGN = {
    "time_ms": ("t", 1e3),
    "u_l": ("v_cmd_l", 1e3),
    "u_r": ("v_cmd_r", 1e3),
    "n_l": ("w_l", 30 / np.pi),
    "n_r": ("w_r", -30 / np.pi),
    "c_l": ("i_l", 1e3),
}


def foreign_csv(delimiter: str) -> bytes:
    """The run as another logger writes it, in units of its own."""
    run = columns()
    lines = [delimiter.join(FOREIGN)]
    for k in range(len(run["t"])):
        lines.append(delimiter.join(f"{run[name][k] * factor:.10g}" for name, factor in FOREIGN.values()))
    return ("\n".join(lines) + "\n").encode()


@functools.cache
def bag(form: str) -> dict[str, bytes]:
    """A short recording of a stock robot as a bag; file -> content."""
    from import_recordings import turtlebot

    if form == "mcap":
        return {"bag.mcap": turtlebot(2.0).mcap()}
    if form.startswith("mcap-"):
        return {"bag.mcap": recompressed(turtlebot(2.0).mcap(), form.removeprefix("mcap-"))}
    with tempfile.TemporaryDirectory() as folder:
        made = (turtlebot(2.0).sqlite if form == "sqlite" else turtlebot(2.0).mcap_folder)(Path(folder) / "bag")
        return {f"bag/{p.name}": p.read_bytes() for p in sorted(made.iterdir())}


def recompressed(data: bytes, compression: str) -> bytes:
    """An MCAP file with its chunks compressed otherwise."""
    from mcap.reader import make_reader
    from mcap.writer import CompressionType, Writer

    out = io.BytesIO()
    writer = Writer(out, compression=CompressionType[compression.upper()], chunk_size=4096)
    writer.start(profile="ros2", library="fuzz")
    schemas, channels = {}, {}
    for schema, channel, message in make_reader(io.BytesIO(data)).iter_messages():
        if schema.name not in schemas:
            schemas[schema.name] = writer.register_schema(schema.name, schema.encoding, schema.data)
        if channel.topic not in channels:
            channels[channel.topic] = writer.register_channel(
                channel.topic, channel.message_encoding, schemas[schema.name]
            )
        writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
    writer.finish()
    return out.getvalue()


# ---- what spoils them
# --------------------------------------------------------------------------------------------------


def spoiled_text(data: bytes, rng: random.Random) -> bytes:
    """One to three slips of a pen, an editor, a logger or a disk, in a text file."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        data = rng.choice(TEXT_SLIPS)(data, rng)
    return data


def _at(data: bytes, rng: random.Random) -> int:
    return rng.randrange(len(data) + 1) if data else 0


def _splice(data: bytes, rng: random.Random, new: bytes, drop: int) -> bytes:
    k = _at(data, rng)
    return data[:k] + new + data[k + drop :]


def _nasty_number(data: bytes, rng: random.Random) -> bytes:
    found = list(re.finditer(rb"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?", data))
    if not found:
        return data
    one = rng.choice(found)
    return data[: one.start()] + rng.choice(NASTY).encode() + data[one.end() :]


def _lines(change):
    def slip(data: bytes, rng: random.Random) -> bytes:
        lines = data.split(b"\n")
        change(lines, rng)
        return b"\n".join(lines)

    return slip


def _swap(lines, rng):
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[a], lines[b] = lines[b], lines[a]


def _cells(lines, rng):
    k = rng.randrange(len(lines))
    for separator in (b",", b";", b"\t"):
        cells = lines[k].split(separator)
        if len(cells) > 2:
            a = rng.randrange(len(cells))
            what = rng.randrange(4)
            if what == 0:
                cells[a] = b""
            elif what == 1:
                del cells[a]
            elif what == 2:
                cells.insert(a, rng.choice(NASTY).encode())
            else:
                cells[a] = rng.choice((*NASTY, *KEYS)).encode()
            lines[k] = separator.join(cells)
            return


TEXT_SLIPS = (
    _nasty_number,
    _nasty_number,
    _nasty_number,
    _lines(_swap),
    _lines(_cells),
    _lines(_cells),
    _lines(lambda lines, rng: lines.insert(rng.randrange(len(lines) + 1), rng.choice(lines))),
    _lines(lambda lines, rng: lines.pop(rng.randrange(len(lines))) if len(lines) > 1 else None),
    lambda data, rng: data[: _at(data, rng)],
    lambda data, rng: _splice(data, rng, bytes([rng.randrange(256)]), 1),
    lambda data, rng: _splice(data, rng, rng.choice((*NASTY, *KEYS)).encode(), 0),
    lambda data, rng: _splice(data, rng, b"", rng.randrange(1, 40)),
    lambda data, rng: data.replace(b"\n", rng.choice((b"\r\n", b"\r", b"\n\n", b" \n"))),
    lambda data, rng: b"\xef\xbb\xbf" + data,
    lambda data, rng: data.decode("utf-8", "replace").encode(rng.choice(("utf-16", "latin-1", "utf-8")), "replace"),
    lambda data, rng: data.replace(b",", rng.choice((b";", b"\t", b", ", b",,")), rng.choice((1, -1))),
    lambda data, rng: data + rng.choice((b"\x00", b"#", b"1", b"\n\n\n", b",", b"}", b"\x1a")),
    lambda data, rng: b"",
    lambda data, rng: data,
)


def spoiled_bytes(data: bytes, rng: random.Random) -> bytes:
    """What a disk, a copy or a line does to a binary file."""
    what = rng.randrange(6)
    damaged = bytearray(data)
    if what == 0:
        return data[: rng.randrange(len(data) + 1)]
    if what == 1 and data:
        a, b = sorted((rng.randrange(len(data)), rng.randrange(len(data))))
        return data[:a] + data[min(b, a + 500) :]
    if what == 2 and data:
        a = rng.randrange(len(data))
        damaged[a : a + rng.randrange(1, 64)] = bytes(rng.randrange(1, 64))
        return bytes(damaged)
    if what == 3:
        a = _at(data, rng)
        return data[:a] + rng.randbytes(rng.randrange(1, 64)) + data[a:]
    for _ in range(rng.choice((1, 1, 2, 8))):
        if damaged:
            damaged[rng.randrange(len(damaged))] ^= 1 << rng.randrange(8)
    return bytes(damaged)


def fill(place: Path, files: dict[str, bytes]) -> None:
    """Write an input's files."""
    for name, content in files.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_bytes(content)


def listing(place: Path) -> set[str]:
    """All that is below a folder."""
    return {
        os.path.relpath(os.path.join(top, name), place)
        for top, folders, files in os.walk(place)
        for name in (*folders, *files)
    }
