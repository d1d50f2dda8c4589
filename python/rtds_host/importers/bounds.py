"""What a bag unpacks to, looked at before it is unpacked: a few kilobytes may hold gigabytes of zeros."""

from __future__ import annotations

import bz2
import sqlite3
import struct
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from shutil import disk_usage
from typing import cast

from backports import zstd
from lz4.frame import LZ4FrameDecompressor
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.reader import DirectoryReader

from rtds_host.errors import InputError

# A chunk or a message lies in memory as a whole; recorders write chunks of a megabyte, pictures have ten. A bag as a
# whole is gone through chunk by chunk: what takes longer than some minutes to unpack is cut down by its owner first.
LARGEST_PIECE, LARGEST_BAG = 2**28, 2**34
STEP = 2**20
MCAP_MAGIC, ZSTD_MAGIC = b"\x89MCAP0\r\n", b"\x28\xb5\x2f\xfd"
CHUNK = 0x06


def unpacked_size(compression: str, data: bytes, most: int) -> int:
    """Bytes that some data unpack to, counted until there are more than `most`; damaged data count as what came of
    them.
    """
    if not compression:
        return len(data)
    unpackers = {"zstd": zstd.ZstdDecompressor, "lz4": LZ4FrameDecompressor, "bz2": bz2.BZ2Decompressor}
    if compression not in unpackers:
        return 0  # the reader knows no other, and says so
    count = 0
    while data and count <= most:
        unpack = unpackers[compression]()
        try:
            while not unpack.eof and count <= most:
                count += len(unpack.decompress(data, max_length=STEP))
                data = b""
                if unpack.needs_input and not unpack.eof:
                    return count
        except (zstd.ZstdError, RuntimeError, EOFError, OSError):
            return count
        data = unpack.unused_data or b""
    return count


def chunks_of(path: Path) -> Iterator[tuple[str, int, bytes]]:
    """Compression, declared size and data of each chunk of an MCAP file; ends where the file is damaged."""
    with open(path, "rb") as stream:
        if stream.read(len(MCAP_MAGIC)) != MCAP_MAGIC:
            return
        end = path.stat().st_size
        while len(head := stream.read(9)) == 9:
            kind, length = head[0], struct.unpack("<Q", head[1:])[0]
            following = stream.tell() + length
            if following > end:
                return
            if kind == CHUNK and length >= 40:
                declared = struct.unpack("<Q", stream.read(24)[16:])[0]
                name = struct.unpack("<I", stream.read(8)[4:])[0]
                compression = stream.read(min(name, 16)).decode("ascii", "replace")
                stream.seek(following - length + 32 + name)
                size = struct.unpack("<Q", stream.read(8))[0]
                yield compression, declared, stream.read(min(size, following - stream.tell()))
            stream.seek(following)


def ros1_chunks_of(path: Path) -> Iterator[tuple[str, int, bytes]]:
    """The same of a ROS 1 bag, whose records are a header of named fields and data, each after its length.

    Source: the bag file format 2.0 (wiki.ros.org/Bags/Format/2.0).
    """
    with open(path, "rb") as stream:
        if not stream.readline(16).startswith(b"#ROSBAG V2"):
            return
        end = path.stat().st_size
        while len(head := stream.read(4)) == 4:
            length = struct.unpack("<I", head)[0]
            if stream.tell() + length + 4 > end:
                return
            header = stream.read(length)
            size = struct.unpack("<I", stream.read(4))[0]
            following = stream.tell() + size
            if following > end:
                return
            fields = dict(_ros1_fields(header))
            if fields.get(b"op") == b"\x05" and len(fields.get(b"size", b"")) == 4:
                compression = fields.get(b"compression", b"").decode("ascii", "replace")
                declared = struct.unpack("<I", fields[b"size"])[0]
                yield "" if compression == "none" else compression, declared, stream.read(size)
            stream.seek(following)


def _ros1_fields(header: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Names and values of a header's fields; ends where it is damaged."""
    while len(header) >= 4:
        length = struct.unpack("<I", header[:4])[0]
        name, equals, value = header[4 : 4 + length].partition(b"=")
        if not equals:
            return
        yield name, value
        header = header[4 + length :]


def _gib(count: int) -> str:
    return f"{count / 2**30:.3g} GiB"


def check_bag(path: Path) -> None:
    """Refuse a bag (a folder, a .mcap or a .db3 file) that unpacks to more than is read.

    Damage is left to the reader to name.

    Raises
    ------
    InputError : names the file, what it would unpack to, and the bound.
    """
    files = sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path]
    for file in files:
        if file.suffix == ".mcap":
            _check_chunks(file, chunks_of(file), "ros2 bag convert")
        elif file.suffix == ".bag":
            _check_chunks(file, ros1_chunks_of(file), "rosbag filter")
        elif file.suffix == ".db3":
            _check_sqlite(file)
        elif file.suffix == ".zstd":
            # Of a file that is compressed as a whole the reader makes a copy.
            most = min(LARGEST_BAG, disk_usage(tempfile.gettempdir()).free)
            with open(file, "rb") as stream:
                if _streamed(stream, most) > most:
                    raise InputError(
                        f"{file}: would unpack to more than {_gib(most)}, which is the most that is read; cut "
                        "it down with `ros2 bag convert`"
                    )
    if path.is_dir() and (path / "metadata.yaml").is_file():
        _check_messages(path)


def _streamed(stream, most: int) -> int:
    """Bytes that a zstd file unpacks to, counted until there are more than `most`, a step at a time."""
    unpack, count = zstd.ZstdDecompressor(), 0
    try:
        while count <= most:
            data = stream.read(STEP) if unpack.needs_input else b""
            if unpack.needs_input and not data:
                return count
            count += len(unpack.decompress(data, max_length=STEP))
            if unpack.eof:
                rest, unpack = unpack.unused_data, zstd.ZstdDecompressor()
                if rest:
                    count += len(unpack.decompress(rest, max_length=STEP))
    except (zstd.ZstdError, EOFError):
        pass
    return count


def _check_chunks(file: Path, chunks: Iterable[tuple[str, int, bytes]], cut: str) -> None:
    total = 0
    for compression, declared, data in chunks:
        size = declared if declared > LARGEST_PIECE else max(declared, unpacked_size(compression, data, LARGEST_PIECE))
        if size > LARGEST_PIECE:
            raise InputError(
                f"{file}: a chunk of {len(data)} bytes would unpack to {_gib(size)} or more, at most "
                f"{_gib(LARGEST_PIECE)} are read at once"
            )
        total += size
        if total > LARGEST_BAG:
            raise InputError(f"{file}: would unpack to more than {_gib(LARGEST_BAG)}; cut it down with `{cut}`")


def _check_sqlite(file: Path) -> None:
    """A message of a database is stored as it is; one may still claim to be larger than memory."""
    try:
        base = sqlite3.connect(f"file:{file}?mode=ro", uri=True)
        try:
            longest = base.execute("SELECT max(length(data)) FROM messages").fetchone()[0] or 0
        finally:
            base.close()
    except sqlite3.Error:
        return
    if longest > LARGEST_PIECE:
        raise InputError(f"{file}: holds a message of {_gib(longest)}, at most {_gib(LARGEST_PIECE)} are read at once")


def _check_messages(path: Path) -> None:
    """Messages that are compressed one by one."""
    if (
        "message"
        not in (path / "metadata.yaml").read_text(errors="replace").lower().partition("compression_mode:")[2][:20]
    ):
        return
    with Reader(path) as reader:
        total = 0
        for storage in cast(DirectoryReader, reader.storage).storages:
            for connection, _, data in storage.messages(list(storage.connections)):
                size = unpacked_size("zstd", data, LARGEST_PIECE) if data[:4] == ZSTD_MAGIC else len(data)
                total += size
                if size > LARGEST_PIECE or total > LARGEST_BAG:
                    raise InputError(
                        f"{path}: topic {connection.topic}: a message of {len(data)} bytes would unpack to "
                        f"{_gib(size)} or more, at most {_gib(LARGEST_PIECE)} are read at once, "
                        f"{_gib(LARGEST_BAG)} in all"
                    )
