"""Bags of ROS 2 (sqlite3 and MCAP, a folder or a single file) and of ROS 1 (.bag), read with `rosbags`: no ROS
installation is needed."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import apsw
import numpy as np
from backports import zstd
from rosbags import rosbag1
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag2 import Reader, ReaderError
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore

from rtds_host.contract.inputs import open_regular
from rtds_host.errors import InputError
from rtds_host.importers.bounds import check_bag
from rtds_host.importers.checksums import check_mcap
from rtds_host.importers.mapping import Mapping, Source, Twist
from rtds_host.importers.series import NS, Series
from rtds_host.vectors import given

SUFFIXES = (".mcap", ".db3")
ROS1_SUFFIX, ROS1_MAGIC = ".bag", b"#ROSBAG V2.0\n"
# What a damaged file makes the reader raise, besides its own error: it trusts lengths, indices and texts it reads.
DAMAGE = (
    ReaderError,
    rosbag1.ReaderError,
    apsw.Error,
    struct.error,
    zstd.ZstdError,
    AssertionError,
    IndexError,
    KeyError,
    TypeError,
    ValueError,
    EOFError,
    MemoryError,
    OverflowError,
    RuntimeError,
)
CLOCKS_APART_S = 0.5


# First bytes of recordings that are not read -> what they are, and what to do.
OTHERS = {
    b"#ROSBAG V1": "is a ROS 1 bag of an old format, bring it to format 2.0 with `rosbag fix`",
    b"WPILOG": "is a WPILib data log, name it .wpilog",
    b"\x89HDF": "is an HDF5 file, export its channels as csv and write a mapping",
    b"MATLAB": "is a MATLAB file, export its channels as csv and write a mapping",
    b"PAR1": "is a Parquet file, a csv file is needed",
    b"ULog\x01": "is a PX4 log, turn it into csv with `ulog2csv` and write a mapping",
}

# Of these, what has a reader of its own under this name.
OWN_SUFFIX = {b"WPILOG": ".wpilog"}


def refuse_other(path: Path) -> None:
    """Refuse a recording of another kind by what it is.

    Raises
    ------
    InputError : names the kind, and how to turn it into one that is read.
    """
    if not path.is_file():
        return
    with open_regular(path) as stream:
        start = stream.read(16)
    for magic, what in OTHERS.items():
        if start.startswith(magic) and path.suffix != OWN_SUFFIX.get(magic):
            raise InputError(f"{path}: {what}")


def is_bag(path: Path) -> bool:
    """Whether a path looks like a bag: a folder, or a file named .mcap, .db3 or .bag."""
    return path.is_dir() or path.suffix in (*SUFFIXES, ROS1_SUFFIX)


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())[:160] or type(error).__name__


def _type_names(definition: object) -> Iterator[str]:
    """Names of the message types that a parsed definition mentions."""
    if isinstance(definition, str):
        if "/msg/" in definition:
            yield definition
    elif isinstance(definition, list | tuple):
        for part in definition:
            yield from _type_names(part)


@dataclass
class _Topic:
    """What was read of one topic: record times, header stamps (None without a header), values by request."""

    msgtype: str
    log_ns: np.ndarray
    stamp_ns: np.ndarray | None
    values: dict[Source | Twist, list]


class Bag:
    """An opened recording; `topics` maps the names of topics with messages to their types.

    Raises
    ------
    InputError : no bag, truncated, damaged, unreadable.
    """

    def __init__(self, path: Path, mapping: Mapping):
        self.path = path
        self.mapping = mapping
        self.notices: list[str] = []
        self.file = self._storage(path)
        self.broken: dict[str, str] = {}
        self._read: dict[str, _Topic] = {}
        self._use_record_time = mapping.time_source == "record"
        try:
            check_bag(self.file)
            for file in sorted(self.file.glob("*.mcap")) if self.file.is_dir() else [self.file]:
                if file.suffix == ".mcap":
                    check_mcap(file)
            with self._reader() as reader:
                self.connections = list(reader.connections)
                self.topics = {c.topic: c.msgtype for c in self.connections if c.msgcount > 0}
                if reader.message_count == 0:
                    raise InputError(f"{path}: holds no message")
                if reader.end_time - reader.start_time <= 1:
                    raise InputError(f"{path}: all messages have one and the same time")
        except InputError:
            raise
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
        except DAMAGE as error:
            raise self._damaged(error) from error

    @property
    def is_ros1(self) -> bool:
        """Whether it is a bag of ROS 1."""
        return self.file.suffix == ROS1_SUFFIX

    def _reader(self) -> Reader | rosbag1.Reader:
        """A reader of the bag, not opened yet; both kinds have the same methods."""
        return rosbag1.Reader(self.file) if self.is_ros1 else Reader(self.file)

    def _damaged(self, error: BaseException) -> InputError:
        reason = _one_line(error)
        hints = {".mcap": " (`mcap recover` may save what is there)", ".bag": " (`rosbag reindex` may mend it)"}
        hint = hints.get(self.file.suffix, "")
        return InputError(f"{self.path}: is truncated or damaged: {reason}{hint}")

    def _storage(self, path: Path) -> Path:
        if not path.exists():
            raise InputError(f"{path}: does not exist")
        if not path.is_dir():
            refuse_other(path)
            if not is_bag(path):
                raise InputError(
                    f"{path}: is not a bag (a bag is a folder with metadata.yaml, or a .mcap, .db3 or .bag file)"
                )
            if path.stat().st_size == 0:
                raise InputError(f"{path}: is empty")
            if path.suffix == ROS1_SUFFIX:
                with open_regular(path) as stream:
                    if stream.read(len(ROS1_MAGIC)) != ROS1_MAGIC:
                        raise InputError(f"{path}: is not a ROS 1 bag: it does not begin with '#ROSBAG V2.0'")
            return path
        if (path / "metadata.yaml").is_file():
            return path
        found = sorted(p for suffix in SUFFIXES for p in path.glob(f"*{suffix}"))
        if not found:
            raise InputError(f"{path}: is not a bag: neither metadata.yaml nor a .mcap or .db3 file is there")
        if len(found) > 1:
            raise InputError(
                f"{path}: metadata.yaml is missing and there are {len(found)} files; restore it with "
                "`ros2 bag reindex`, or import the files one by one"
            )
        self.notices.append(f"{path.name}: metadata.yaml is missing, {found[0].name} was read by itself")
        return self._storage(found[0])

    def _typestore(self, needed: dict[str, Connection]):
        """Types of the bag's own definitions; what is missing there from the mapping, then from ROS's own."""
        store = get_typestore(Stores.EMPTY)
        types: dict = {}
        for connection in self.connections:
            if connection.topic not in needed or connection.msgdef.format == MessageDefinitionFormat.NONE:
                continue
            text = connection.msgdef.data
            try:
                if connection.msgdef.format == MessageDefinitionFormat.MSG:
                    types.update(get_types_from_msg(text, connection.msgtype))
                else:
                    line = "=" * 80 + "\n"
                    parts = [p.split("\n", 1)[1] for p in text.split(line)[1:]] if text.startswith(line) else [text]
                    for part in parts:
                        types.update(get_types_from_idl(part))
            except (TypesysError, IndexError) as error:
                self.broken[connection.topic] = (
                    f"{self.path}: topic {connection.topic}: the definition of "
                    f"{connection.msgtype} in the bag cannot be read ({_one_line(error)})"
                )
        for name, text in self.mapping.definitions.items():
            try:
                parsed = get_types_from_msg(text, name)
            except TypesysError as error:
                raise InputError(
                    f"{self.mapping.path}: [definitions] {name}: cannot be read ({_one_line(error)})"
                ) from error
            types = {**parsed, **types}
        standard = get_typestore(Stores.ROS1_NOETIC if self.is_ros1 else Stores.ROS2_JAZZY).fielddefs
        # Only what is needed: registering all of ROS takes longer than reading a small bag.
        todo = [connection.msgtype for connection in needed.values()] + list(types)
        seen: dict = {}
        while todo:
            name = todo.pop()
            if name not in seen and (name in types or name in standard):
                seen[name] = types.get(name, standard.get(name))
                todo += _type_names(seen[name])
        try:
            store.register(seen)
        except TypesysError as error:
            raise InputError(
                f"{self.path}: its message definitions contradict each other ({_one_line(error)})"
            ) from error
        return store

    def definitions(self) -> dict:
        """Definitions of the types of all topics and of what these hold, by name; a type that nobody defines is not
        among them.
        """
        return dict(self._typestore({c.topic: c for c in self.connections}).fielddefs)

    def read(self, requests: Iterable[Source | Twist]) -> None:
        """Decode the topics that are there and that `requests` name; fills what `series` hands out."""
        wanted: dict[str, list] = {}
        for request in requests:
            if request.topic in self.topics:
                wanted.setdefault(request.topic, []).append(request)
        self._read = {
            topic: _Topic(self.topics[topic], np.empty(0, np.int64), None, {r: [] for r in requests})
            for topic, requests in wanted.items()
        }
        store = self._typestore({c.topic: c for c in self.connections if c.topic in wanted})
        logs: dict[str, list[int]] = {topic: [] for topic in wanted}
        stamps: dict[str, list[int]] = {topic: [] for topic in wanted}
        getters: dict[str, list[tuple[Source | Twist, Callable]]] = {}
        counts: dict[int, int] = {}
        try:
            decode = store.deserialize_ros1 if self.is_ros1 else store.deserialize_cdr
            with self._reader() as reader:
                connections = [c for c in reader.connections if c.topic in wanted and c.topic not in self.broken]
                for connection, log_ns, raw in reader.messages(connections=connections) if connections else ():
                    topic = connection.topic
                    counts[connection.id] = counts.get(connection.id, 0) + 1
                    if topic in self.broken:
                        continue
                    try:
                        message = decode(raw, connection.msgtype)
                    except (SerdeError, TypesysError, KeyError) as error:
                        if connection.msgtype not in store.fielddefs:
                            what = f"its type {connection.msgtype} is not defined in the bag, add it to [definitions]"
                        else:
                            what = f"a message does not fit its type {connection.msgtype} ({_one_line(error)})"
                        self.broken[topic] = f"{self.path}: topic {topic}: {what}"
                        continue
                    if topic not in getters:
                        getters[topic] = [
                            (request, self._getter(request, message, connection.msgtype)) for request in wanted[topic]
                        ]
                    logs[topic].append(log_ns)
                    header = getattr(message, "header", None)
                    if header is not None:
                        stamps[topic].append(header.stamp.sec * NS + header.stamp.nanosec)
                    for request, get in getters[topic]:
                        self._read[topic].values[request].append(get(message, len(logs[topic])))
                # An MCAP file's own count is exact. A folder's metadata.yaml counts what the recorder dropped, too.
                for connection in connections if self.file.suffix == ".mcap" else ():
                    if counts.get(connection.id, 0) != connection.msgcount:
                        raise ReaderError(
                            f"topic {connection.topic}: {counts.get(connection.id, 0)} messages are there, its "
                            f"summary counts {connection.msgcount}"
                        )
        except InputError:
            raise
        except OSError as error:
            raise InputError(f"{self.path}: cannot be read ({error.strerror or error})") from error
        except DAMAGE as error:
            raise self._damaged(error) from error
        for topic, data in self._read.items():
            data.log_ns = np.asarray(logs[topic], dtype=np.int64)
            if stamps[topic] and len(stamps[topic]) == len(logs[topic]):
                data.stamp_ns = np.asarray(stamps[topic], dtype=np.int64)
        self._choose_clock()

    def _choose_clock(self) -> None:
        """Header stamps, unless one of them runs on another clock than the recorder (sim time, a remote computer)."""
        if self._use_record_time:
            return
        for topic, data in self._read.items():
            if data.stamp_ns is None or not len(data.log_ns) or all(isinstance(r, Twist) for r in data.values):
                continue
            apart = float(np.median(data.log_ns - data.stamp_ns)) / NS
            if abs(apart) > CLOCKS_APART_S:
                self._use_record_time = True
                self.notices.append(
                    f"{self.path.name}: the stamps in {topic} lie {apart:.3g} s from the recorder's "
                    "clock, so the recorder's times were used for all topics"
                )
                return

    def _getter(self, request: Source | Twist, example: object, msgtype: str) -> Callable:
        if isinstance(request, Twist):
            nested = hasattr(example, "twist")
            names: tuple[str, ...] = (
                request.linear or ("twist.linear.x" if nested else "linear.x"),
                request.angular or ("twist.angular.z" if nested else "angular.z"),
            )
        else:
            names = request.pair or (given(request.field, "field"),)
        paths = [self._path(request, name, example, msgtype) for name in names]
        joint = getattr(request, "joint", None)

        def number(path: list, message: Any, count: int) -> float:
            value = message
            for step in path:
                if isinstance(step, int):
                    if step >= len(value):
                        return math.nan
                    value = value[step]
                else:
                    value = getattr(value, step)
            if hasattr(value, "w") and hasattr(value, "z"):
                return math.atan2(
                    2.0 * (value.w * value.z + value.x * value.y), 1.0 - 2.0 * (value.y * value.y + value.z * value.z)
                )
            if joint is not None:
                if joint not in message.name:
                    raise InputError(
                        f"{self.path}: topic {request.topic}, message {count}: holds no joint {joint!r}, "
                        f"joints there are {', '.join(message.name) or 'none'} ({request.place})"
                    )
                index = list(message.name).index(joint)
                if index >= len(value):
                    return math.nan
                value = value[index]
            if isinstance(value, (list, np.ndarray, str)):
                field = request.field if isinstance(request, Source) else request.topic
                raise InputError(
                    f"{self.path}: topic {request.topic}: field {field!r} holds "
                    f"{type(value).__name__}, one number is needed: name an element, as in "
                    f"{field}[0], or a joint ({request.place})"
                )
            return float(value)

        if len(paths) == 1:
            return lambda message, count: number(paths[0], message, count)
        return lambda message, count: (number(paths[0], message, count), number(paths[1], message, count))

    def _path(self, request: Source | Twist, name: str, example: object, msgtype: str) -> list:
        """Split "a.b[2].c" and check it against a first message."""
        path: list = []
        value = example
        for part in name.split("."):
            match = re.fullmatch(r"(\w+)((?:\[\d+\])*)", part)
            if match is None:
                raise InputError(f"{request.place}: field {name!r} cannot be understood")
            names = [key for key in getattr(value, "__dataclass_fields__", {}) if not key.startswith("__")]
            if match[1] not in names:
                raise InputError(
                    f"{self.path}: topic {request.topic}: is {msgtype}, which has no field {name!r}; "
                    f"{'fields there are ' + ', '.join(names) if names else part + ' is not a message'} "
                    f"({request.place})"
                )
            path.append(match[1])
            value = getattr(value, match[1])
            for index in re.findall(r"\d+", match[2]):
                path.append(int(index))
                if not isinstance(value, (list, np.ndarray)):
                    raise InputError(
                        f"{self.path}: topic {request.topic}: field {match[1]!r} of {msgtype} is not an array "
                        f"({request.place})"
                    )
                value = value[int(index)] if int(index) < len(value) else None
        return path

    def available(self, request: Source | Twist) -> bool:
        """Whether the topic is there and holds messages."""
        return request.topic in self.topics

    def wanting(self, request: Source | Twist) -> str:
        """What the bag lacks, for a message."""
        if request.topic is None:
            return f"{request.place} names no topic"
        return f"no topic {request.topic}"

    def series(self, request: Source | Twist) -> Series:
        """Samples of a request, in the order of their time, NaN dropped.

        Raises
        ------
        InputError : the topic cannot be decoded, its time goes back, a value is infinite.
        """
        topic = given(request.topic, "topic")
        if topic in self.broken:
            raise InputError(self.broken[topic])
        data = self._read[topic]
        # A commanded twist acts when it arrives, whatever the sender's stamp (a laptop's clock, often) says.
        recorded = self._use_record_time or isinstance(request, Twist)
        t_ns = data.log_ns if recorded or data.stamp_ns is None else data.stamp_ns
        back = np.flatnonzero(np.diff(t_ns) < 0)
        if back.size:
            k = int(back[0])
            raise InputError(
                f"{self.path}: topic {topic}, message {k + 2}: time goes back by {(t_ns[k] - t_ns[k + 1]) / NS:.6g} s"
            )
        values = np.asarray(data.values[request], dtype=float)
        shape = (len(t_ns), 2) if isinstance(request, Twist) or request.pair else (len(t_ns),)
        values = values.reshape(shape)
        rows = values.reshape(len(t_ns), 1 if values.ndim == 1 else 2)
        infinite = np.flatnonzero(np.isinf(rows).any(axis=1))
        if infinite.size:
            raise InputError(
                f"{self.path}: topic {topic}, message {infinite[0] + 1}: a value is infinite ({request.place})"
            )
        return Series(t_ns, values, f"{self.path.name} {topic}").keep(np.isfinite(rows).all(axis=1))


def list_topics(path: Path) -> list[tuple[str, str, int]]:
    """Topics of a bag: name, type, number of messages, in the order of their names.

    Raises
    ------
    InputError : no bag, truncated, damaged, unreadable.
    """
    bag = Bag(path, Mapping(path, ""))
    return sorted((c.topic, c.msgtype, c.msgcount) for c in bag.connections)
