"""A bag that unpacks to gigabytes is refused before it is unpacked."""

from __future__ import annotations

import re
import sqlite3

import pytest
from backports import zstd
from import_recordings import turtlebot
from lz4 import frame as lz4
from mcap.writer import CompressionType, Writer

from rtds_host.errors import InputError
from rtds_host.importers import bounds, import_case

ZEROS = 64 * 2**20


def bomb(path, compression, count=1, size=ZEROS):
    """An MCAP file whose chunks hold a message of zeros each."""
    with open(path, "wb") as stream:
        writer = Writer(stream, chunk_size=1024, compression=compression)
        writer.start(profile="ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/chatter", "cdr", schema)
        for k in range(count):
            writer.add_message(channel, log_time=k * 10**9, publish_time=k * 10**9, data=bytes(size))
        writer.finish()
    return path


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Bounds that a test can exceed without a gigabyte of its own."""
    monkeypatch.setattr(bounds, "LARGEST_PIECE", 2**24)
    monkeypatch.setattr(bounds, "LARGEST_BAG", 2**26)


def refuse(path, tmp_path, words):
    with pytest.raises(InputError, match=words) as error:
        import_case([path], tmp_path / "case")
    assert "\n" not in str(error.value) and not (tmp_path / "case").exists()


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_a_chunk_that_says_how_large_it_is(tmp_path, compression):
    path = bomb(tmp_path / "bomb.mcap", compression)
    assert path.stat().st_size < ZEROS / 100
    refuse(path, tmp_path, r"bomb\.mcap: a chunk of \d+ bytes would unpack to 0\.0625 GiB or more, at most 0\.0156 GiB")


def test_a_chunk_that_lies_about_its_size(tmp_path):
    path = bomb(tmp_path / "bomb.mcap", CompressionType.ZSTD)
    data = path.read_bytes()
    # The same number is in the chunk and in the index of chunks.
    declared = next(bounds.chunks_of(path))[1].to_bytes(8, "little")
    assert int.from_bytes(declared, "little") > ZEROS and data.count(declared) == 2
    path.write_bytes(data.replace(declared, (1000).to_bytes(8, "little")))
    refuse(path, tmp_path, r"a chunk of \d+ bytes would unpack to 0\.0\d+ GiB or more")


def test_many_chunks_that_are_each_small_enough(tmp_path):
    path = bomb(tmp_path / "bomb.mcap", CompressionType.ZSTD, count=20, size=2**22)
    refuse(path, tmp_path, r"bomb\.mcap: would unpack to more than 0\.0625 GiB")


def test_a_bag_compressed_as_a_file(tmp_path):
    folder = turtlebot().sqlite(tmp_path / "bag")
    file = folder / "bag_0.db3"
    (folder / "bag_0.db3.zstd").write_bytes(zstd.compress(bytes(2 * ZEROS)))
    file.unlink()
    text = (folder / "metadata.yaml").read_text().replace("bag_0.db3", "bag_0.db3.zstd")
    text = re.sub('compression_format: ""', "compression_format: zstd", text)
    (folder / "metadata.yaml").write_text(re.sub('compression_mode: ""', "compression_mode: FILE", text))
    refuse(folder, tmp_path, r"bag_0\.db3\.zstd: would unpack to more than 0\.0625 GiB")


def test_a_message_compressed_by_itself(tmp_path):
    folder = turtlebot().sqlite(tmp_path / "bag")
    base = sqlite3.connect(folder / "bag_0.db3")
    base.execute("UPDATE messages SET data = ? WHERE id = 5", (zstd.compress(bytes(ZEROS)),))
    base.commit()
    base.close()
    text = (folder / "metadata.yaml").read_text()
    text = re.sub('compression_format: ""', "compression_format: zstd", text)
    (folder / "metadata.yaml").write_text(re.sub('compression_mode: ""', "compression_mode: MESSAGE", text))
    refuse(folder, tmp_path, r"bag: topic /\w+: a message of \d+ bytes would unpack to 0\.0\d+ GiB or more")


def test_compressed_bags_of_ordinary_size_are_read(tmp_path):
    for kind in ("zstd", "lz4"):
        data = turtlebot().mcap()
        pack = zstd.compress(data) if kind == "zstd" else lz4.compress(data)
        assert bounds.unpacked_size(kind, pack, 2**24) == len(data)
        assert bounds.unpacked_size(kind, pack + pack, 2**24) in (len(data), 2 * len(data))
    import_case([turtlebot().mcap_folder(tmp_path / "bag")], tmp_path / "case")
    assert (tmp_path / "case" / "bag" / "log.csv").is_file()
