"""A bag of ROS 1 becomes the same case as one of ROS 2 with the same messages."""

import bz2
import struct
from pathlib import Path

import pytest
from import_recordings import turtlebot
from rosbags.convert.converter import convert
from rosbags.typesys import Stores, get_typestore

from rtds_host.contract import read_case
from rtds_host.errors import InputError
from rtds_host.importers import bounds, import_case


@pytest.fixture
def bags(tmp_path) -> tuple[Path, Path]:
    """The same drive of a TurtleBot3 as an MCAP file and as a bag of ROS 1."""
    source, bag = tmp_path / "drive.mcap", tmp_path / "drive.bag"
    turtlebot().mcap(source)
    convert([source], bag, None, None, None, "none", get_typestore(Stores.ROS2_JAZZY), None, (), (), (), ())
    return source, bag


def test_it_becomes_the_same_log(bags, tmp_path):
    logs = []
    for k, source in enumerate(bags):
        import_case([source], tmp_path / f"case{k}")
        logs.append((tmp_path / f"case{k}" / "drive" / "log.csv").read_bytes())
    assert logs[0] == logs[1]
    assert len(read_case(tmp_path / "case1").runs[0].t) > 100


def test_a_cut_bag_is_refused_in_one_line(bags, tmp_path):
    bag = bags[1]
    bag.write_bytes(bag.read_bytes()[: bag.stat().st_size // 2])
    with pytest.raises(InputError, match=r"drive\.bag: is truncated or damaged: .*rosbag reindex"):
        import_case([bag], tmp_path / "case")
    assert not (tmp_path / "case").exists()


@pytest.mark.parametrize("start", [b"", b"#ROSBAG V1.2\n", b"\x89MCAP0\r\n"])
def test_another_file_with_its_name_is_refused_by_what_it_is(tmp_path, start):
    bag = tmp_path / "drive.bag"
    bag.write_bytes(start)
    with pytest.raises(InputError, match=r"drive\.bag: (is empty|is a ROS 1 bag of an old format|is not a ROS 1 bag)"):
        import_case([bag], tmp_path / "case")


def test_a_chunk_that_would_fill_the_memory_is_refused_before_it_is_unpacked(bags, tmp_path, monkeypatch):
    """A few kilobytes of bz2 may hold gigabytes of zeros, whatever size they declare."""
    monkeypatch.setattr(bounds, "LARGEST_PIECE", 2**16)
    data = bz2.compress(bytes(2**20))
    fields = b"".join(
        struct.pack("<I", len(field)) + field
        for field in (b"op=\x05", b"compression=bz2", b"size=" + struct.pack("<I", 100))
    )
    chunk = struct.pack("<I", len(fields)) + fields + struct.pack("<I", len(data)) + data
    bag = tmp_path / "bomb.bag"
    bag.write_bytes(b"#ROSBAG V2.0\n" + chunk)
    with pytest.raises(InputError, match="bomb.bag: a chunk of .* bytes would unpack to"):
        import_case([bag], tmp_path / "case")
