"""Mapping files: which topic and field, or which column, holds which channel, and in what unit."""

from __future__ import annotations

import math
import os
import sys
from dataclasses import dataclass, field, fields
from importlib import resources
from pathlib import Path
from typing import overload

from rtds_host.contract.inputs import read_toml
from rtds_host.errors import InputError, did_you_mean, shown
from rtds_host.importers.units import FIXED, QUANTITY

SCHEMA = "rtds-mapping/1"
# A value is read a few samples before its stamp, never minutes.
MOST_DELAY_SAMPLES, MOST_DELAY_S = 1000, 60.0
# Keys that mappings of earlier versions have, and their present names.
FORMER_KEYS = {"late_s": "delay_s", "late_samples": "delay_samples"}
META_KEYS = ("scenario", "payload_kg", "slope_rad", "uphill_yaw_rad", "notes")


@dataclass(frozen=True)
class Source:
    """Where one channel comes from. A bag is asked for `topic` and `field`, a table for `column`.

    `pair` names the two fields (or columns) of a twist, forward speed and yaw rate, from which a wheel's speed
    follows. `delay_samples`, `delay_s`: the value in a message was read that much earlier than its stamp says.
    """

    place: str
    channel: str
    topic: str | None = None
    field: str | None = None
    joint: str | None = None
    column: str | None = None
    pair: tuple[str, str] | None = None
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0
    reverse: bool = False
    full_scale: float | None = None
    counts_per_rev: float | None = None
    wheel_radius_m: float | None = None
    track_width_m: float | None = None
    shaft: str = "wheel"
    delay_samples: int = 0
    delay_s: float = 0.0
    wraps_at: float | None = None
    use: str = "all"

    @property
    def where(self) -> tuple | None:
        """What number of a log this is; None for a pair, from which each side makes its own."""
        return (self.topic, self.field, self.joint, self.column) if self.pair is None else None

    @property
    def named(self) -> str:
        """That number in words."""
        if self.column is not None:
            return f"column {self.column!r}"
        return f"field {self.field!r} of {self.topic}" + (f", joint {self.joint!r}" if self.joint else "")


@dataclass(frozen=True)
class Twist:
    """A commanded twist of the whole robot and what the robot's firmware makes of it, step by step.

    Forward speed and yaw rate are cut toward zero to whole `cut` (m/s and rad/s), held within `linear_limit` and
    `angular_limit`, turned into wheel speeds with the firmware's radius and track, cut toward zero to whole
    `wheel_cut_rad_s`, and held within `wheel_limit_rad_s`.
    """

    place: str
    topic: str | None = None
    linear: str | None = None
    angular: str | None = None
    linear_unit: str = "m/s"
    angular_unit: str = "rad/s"
    cut: float = 0.0
    linear_limit: float = math.inf
    angular_limit: float = math.inf
    wheel_radius_m: float | None = None
    track_width_m: float | None = None
    wheel_cut_rad_s: float = 0.0
    wheel_limit_rad_s: float = math.inf


@dataclass(frozen=True)
class Mapping:
    """A checked mapping file."""

    path: Path
    name: str
    robot: str | None = None
    signals: dict[str, tuple[Source, ...]] = field(default_factory=dict)
    twist: Twist | None = None
    time_source: str = "header"
    time_column: str | None = None
    time_unit: str = "s"
    delimiter: str = ","
    decimal: str = "."
    skip_rows: int = 0
    before_first: float | None = None
    timeout_s: float = math.inf
    driver: dict = field(default_factory=dict)
    servo: dict = field(default_factory=dict)
    sensors: dict = field(default_factory=dict)
    definitions: dict[str, str] = field(default_factory=dict)
    runs: dict[str, dict] = field(default_factory=dict)


def builtin_mappings() -> tuple[str, ...]:
    """Names of the mappings that come with the package."""
    return tuple(sorted(path.stem for path in _folder().glob("*.toml")))


def _folder() -> Path:
    return Path(str(resources.files("rtds_host.importers"))) / "mappings"


def load_mapping(path_or_name: str | os.PathLike, above: tuple[str, ...] = ()) -> Mapping:
    """Read and check a mapping file, or one that comes with the package; `above`: files whose base this one is.

    Raises
    ------
    InputError : unreadable, no TOML, an unknown key or unit, a value of the wrong kind.
    """
    path = Path(path_or_name)
    if not path.exists() and path.name == str(path_or_name) and path.suffix != ".toml":
        if path.name not in builtin_mappings():
            raise InputError(
                f"mapping {str(path_or_name)!r}: unknown (known: {', '.join(builtin_mappings())}; or give "
                f"the path of a .toml file){did_you_mean(path.name, builtin_mappings())}"
            )
        path = _folder() / f"{path.name}.toml"
    data = read_toml(path)
    place = os.path.realpath(path)
    if place in above:
        raise InputError(f"{path}: base: leads back to this very file")
    return _Parser(path, (*above, place)).mapping(data)


def unconfirmed(path: str | os.PathLike) -> int:
    """Lines of a mapping file that still say that they are a guess, as a draft of `rtds init` marks them."""
    lines = Path(path).read_text(encoding="utf-8").splitlines() if Path(path).is_file() else []
    return sum("# guess" in line for line in lines)


TOP_LEVEL = (
    *("schema", "name", "robot", "base", "time", "table", "signal", "twist", "commands"),
    *("driver", "servo", "sensors", "definitions", "runs"),
)


class _Parser:
    def __init__(self, path: Path, above: tuple[str, ...] = ()):
        self.path, self.above = path, above

    def fail(self, place: str, what: str) -> InputError:
        return InputError(f"{self.path}: {place}: {what}")

    def table(self, data: dict, key: str) -> dict:
        value = data.get(key, {})
        if not isinstance(value, dict):
            raise self.fail(key, f"is {shown(value)}, a table [{key}] is needed")
        return value

    def only(self, place: str, table: dict, allowed: tuple[str, ...]) -> None:
        for key in table:
            if key not in allowed:
                raise self.fail(
                    place, f"key {shown(key)} is unknown, known are {', '.join(allowed)}{did_you_mean(key, allowed)}"
                )

    @overload
    def number(
        self,
        place: str,
        table: dict,
        key: str,
        default: float,
        positive: bool = False,
        low: float = -math.inf,
        high: float = math.inf,
    ) -> float: ...

    @overload
    def number(
        self,
        place: str,
        table: dict,
        key: str,
        default: None,
        positive: bool = False,
        low: float = -math.inf,
        high: float = math.inf,
    ) -> float | None: ...

    @overload
    def number(self, place: str, table: dict, key: str, default: float | None) -> float | None: ...

    def number(
        self,
        place: str,
        table: dict,
        key: str,
        default: float | None,
        positive: bool = False,
        low: float = -math.inf,
        high: float = math.inf,
    ) -> float | None:
        if key not in table:
            return default
        value = table[key]
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= sys.float_info.max:
            raise self.fail(place, f"{key} is {shown(value, 20)}, a finite number is needed")
        if positive and value <= 0 or value < low:
            raise self.fail(
                place, f"{key} is {value:g}, it must be " + ("above 0" if positive else f"at least {low:g}")
            )
        if value > high:
            raise self.fail(place, f"{key} is {value:g}, it must be at most {high:g}")
        return float(value)

    @overload
    def text(self, place: str, table: dict, key: str, default: str, choices: tuple[str, ...] | None = None) -> str: ...

    @overload
    def text(
        self, place: str, table: dict, key: str, default: str | None, choices: tuple[str, ...] | None = None
    ) -> str | None: ...

    def text(
        self, place: str, table: dict, key: str, default: str | None, choices: tuple[str, ...] | None = None
    ) -> str | None:
        if key not in table:
            return default
        value = table[key]
        if not isinstance(value, str):
            raise self.fail(place, f"{key} is {shown(value)}, a text is needed")
        if choices and value not in choices:
            raise self.fail(place, f"{key} is {shown(value)}, it must be one of {', '.join(choices)}")
        return value

    def mapping(self, data: dict) -> Mapping:
        if data.get("schema") != SCHEMA:
            raise InputError(f"{self.path}: schema: is {shown(data.get('schema'))}, this program reads {SCHEMA!r}")
        self.only("top level", data, TOP_LEVEL)
        base = self.text("base", data, "base", None)
        below = load_mapping(base, self.above) if base else Mapping(self.path, self.path.stem)

        time = self.table(data, "time")
        self.only("[time]", time, ("source", "column", "unit"))
        table = self.table(data, "table")
        self.only("[table]", table, ("delimiter", "decimal", "skip_rows"))
        commands = self.table(data, "commands")
        self.only("[commands]", commands, ("before_first", "timeout_s"))

        signals = {**below.signals, **self.signals(data)}
        twist = below.twist
        if "twist" in data:
            twist = self.twist(self.table(data, "twist"))
        driver = {**below.driver, **self.table(data, "driver")}
        self.only("[driver]", driver, ("bus",))
        self.text("[driver]", driver, "bus", None, ("nominal", "measured"))
        servo = {**below.servo, **self.table(data, "servo")}
        self.only("[servo]", servo, ("kp_v_s_per_rad", "ki_v_per_rad", "limit_v", "period_s"))
        sensors = {**below.sensors, **self.table(data, "sensors")}
        self.only("[sensors]", sensors, ("i_a", "w_rad_s", "th_rad", "gyro_rad_s", "xy_m", "yaw_rad", "v_bus_v"))
        for name, values in (("[servo]", servo), ("[sensors]", sensors)):
            for key in values:
                self.number(name, values, key, None, low=0.0)
        self.apart(signals)
        definitions = {**below.definitions, **self.table(data, "definitions")}
        for name in definitions:
            self.text("[definitions]", definitions, name, None)
        runs = self.table(data, "runs")
        for name in runs:
            if not isinstance(runs[name], dict):
                raise self.fail(f"[runs.{name}]", f"is {shown(runs[name])}, a table is needed")
            self.only(f"[runs.{name}]", runs[name], META_KEYS)
        decimal = self.text("[table]", table, "decimal", below.decimal, (".", ","))
        delimiter = self.text("[table]", table, "delimiter", ";" if decimal == "," else below.delimiter)
        if len(delimiter) != 1 or delimiter in '"\r\n ' or delimiter == decimal:
            raise self.fail("[table]", f"delimiter is {delimiter!r}, one character that occurs in no number is needed")
        return Mapping(
            path=self.path,
            name=self.text("name", data, "name", self.path.stem),
            robot=self.text("robot", data, "robot", below.robot),
            signals=signals,
            twist=twist,
            time_source=self.text("[time]", time, "source", below.time_source, ("header", "record")),
            time_column=self.text("[time]", time, "column", below.time_column),
            time_unit=self.text("[time]", time, "unit", below.time_unit, tuple(FIXED["time"])),
            delimiter=delimiter,
            decimal=decimal,
            skip_rows=int(self.number("[table]", table, "skip_rows", below.skip_rows, low=0)),
            before_first=self.number("[commands]", commands, "before_first", below.before_first),
            timeout_s=self.number("[commands]", commands, "timeout_s", below.timeout_s, positive=True),
            driver=driver,
            servo=servo,
            sensors=sensors,
            definitions=definitions,
            runs=runs,
        )

    def signals(self, data: dict) -> dict[str, tuple[Source, ...]]:
        """Sources of each channel, as [signal] names them."""
        found = {}
        for channel, entry in self.table(data, "signal").items():
            place = f"[signal.{channel}]"
            if channel not in QUANTITY:
                raise self.fail(
                    place,
                    f"is not a channel of the format; channels are {', '.join(QUANTITY)}"
                    f"{did_you_mean(channel, QUANTITY)}",
                )
            entries = entry if isinstance(entry, list) else [entry]
            if not all(isinstance(item, dict) for item in entries):
                raise self.fail(place, "must be a table or a list of tables")
            found[channel] = tuple(self.source(place, channel, item) for item in entries)
        return found

    def apart(self, signals: dict[str, tuple[Source, ...]]) -> None:
        """One number of a log cannot be two measurements, nor a command and what came of it."""
        owner: dict[tuple, str] = {}
        for channel, sources in signals.items():
            for source in sources:
                # References are information only; two commands that are one are said when they are used.
                if source.where is None or channel.startswith("w_ref"):
                    continue
                other = owner.setdefault(source.where, channel)
                if other != channel and not {other[:5], channel[:5]} <= {"v_cmd", "w_cmd"}:
                    raise self.fail(
                        f"[signal.{channel}]",
                        f"is the same {source.named} as [signal.{other}], one of the two is something else",
                    )

    def source(self, place: str, channel: str, table: dict) -> Source:
        allowed = tuple(f.name for f in fields(Source) if f.name not in ("place", "channel"))
        # Of a key under both names the former is said to be unknown.
        table = {now if (now := FORMER_KEYS.get(key, key)) not in table else key: value for key, value in table.items()}
        self.only(place, table, allowed)
        if ("topic" in table) == ("column" in table) and not ("pair" in table and "topic" not in table):
            raise self.fail(place, "needs a topic (bags) or a column (tables), one of them")
        if "topic" in table and "field" not in table and "pair" not in table:
            raise self.fail(place, "needs the field of the topic")
        pair = table.get("pair")
        if pair is not None:
            if channel not in ("w_l", "w_r", "w_cmd_l", "w_cmd_r"):
                raise self.fail(place, "pair (forward speed, yaw rate) has a meaning for a wheel's speed only")
            if not isinstance(pair, list) or len(pair) != 2 or not all(isinstance(item, str) for item in pair):
                raise self.fail(place, "pair must be two names, of the forward speed [m/s] and the yaw rate [rad/s]")
            pair = tuple(pair)
        if not isinstance(table.get("reverse", False), bool):
            raise self.fail(place, f"reverse is {table['reverse']!r}, true or false is needed")
        delay = self.number(place, table, "delay_samples", 0.0, low=0.0, high=MOST_DELAY_SAMPLES)
        if delay != int(delay):
            raise self.fail(place, f"delay_samples is {delay:g}, a whole number is needed")
        number = self.number
        if number(place, table, "scale", 1.0) == 0:
            raise self.fail(place, "scale is 0, nothing would be left of the channel")
        return Source(
            place=f"{self.path}: {place}",
            channel=channel,
            pair=pair,
            topic=self.text(place, table, "topic", None),
            field=self.text(place, table, "field", None),
            joint=self.text(place, table, "joint", None),
            column=self.text(place, table, "column", None),
            unit=self.text(place, table, "unit", None),
            scale=number(place, table, "scale", 1.0),
            offset=number(place, table, "offset", 0.0),
            reverse=table.get("reverse", False),
            full_scale=number(place, table, "full_scale", None, positive=True),
            counts_per_rev=number(place, table, "counts_per_rev", None, positive=True),
            wheel_radius_m=number(place, table, "wheel_radius_m", None, positive=True),
            track_width_m=number(place, table, "track_width_m", None, positive=True),
            wraps_at=number(place, table, "wraps_at", None, positive=True),
            shaft=self.text(place, table, "shaft", "wheel", ("wheel", "motor")),
            delay_samples=int(delay),
            delay_s=number(place, table, "delay_s", 0.0, low=-MOST_DELAY_S, high=MOST_DELAY_S),
            use=self.text(place, table, "use", "all", ("all", "start")),
        )

    def twist(self, table: dict) -> Twist:
        place = "[twist]"
        allowed = tuple(f.name for f in fields(Twist) if f.name != "place")
        self.only(place, table, allowed)
        if "topic" not in table and not ("linear" in table and "angular" in table):
            raise self.fail(place, "needs a topic (bags), or the columns linear and angular (tables)")
        number = self.number
        return Twist(
            place=f"{self.path}: {place}",
            topic=self.text(place, table, "topic", None),
            linear=self.text(place, table, "linear", None),
            angular=self.text(place, table, "angular", None),
            linear_unit=self.text(place, table, "linear_unit", "m/s", ("m/s", "mm/s")),
            angular_unit=self.text(place, table, "angular_unit", "rad/s", tuple(FIXED["rate"])),
            cut=number(place, table, "cut", 0.0, low=0.0),
            linear_limit=number(place, table, "linear_limit", math.inf, positive=True),
            angular_limit=number(place, table, "angular_limit", math.inf, positive=True),
            wheel_radius_m=number(place, table, "wheel_radius_m", None, positive=True),
            track_width_m=number(place, table, "track_width_m", None, positive=True),
            wheel_cut_rad_s=number(place, table, "wheel_cut_rad_s", 0.0, low=0.0),
            wheel_limit_rad_s=number(place, table, "wheel_limit_rad_s", math.inf, positive=True),
        )
