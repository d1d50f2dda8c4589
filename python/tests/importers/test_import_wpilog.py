"""A WPILib data log becomes a case by a mapping of its entries; written here by the format's own description.

Source of the format: wpilibsuite/allwpilib, wpiutil/doc/datalog.adoc. A record is a byte of three lengths, entry, size,
time in microseconds, and data; entry 0 holds control records.
"""

import math
import struct

import numpy as np
import pytest

from rtds_host.contract import RunLog, RunMeta, builtin_robot, read_case
from rtds_host.diagnosis.predict import predicted_columns
from rtds_host.errors import InputError
from rtds_host.importers import import_case
from rtds_host.importers.listing import contents

pytest.importorskip("wpiutil", reason="robotpy-wpiutil has no wheel for this Python")

ROBOT = builtin_robot("frc_cim")
MAPPING = """schema = "rtds-mapping/1"
[signal]
v_cmd_l = { column = "drive/left_voltage", unit = "V" }
v_cmd_r = { column = "drive/right_voltage", unit = "V" }
w_l = { column = "drive/left rate", unit = "rev/s" }
w_r = { column = "drive/right rate", unit = "rev/s" }
"""


def record(entry: int, time_us: int, data: bytes) -> bytes:
    return struct.pack("<BIIQ", 0b1111111, entry, len(data), time_us) + data


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def log(entries: dict[str, tuple[str, list[tuple[int, bytes]]]]) -> bytes:
    """Entries by name: type and samples (time in us, data), written sample by sample in the order of their times."""
    start = b"".join(
        record(0, 0, b"\x00" + struct.pack("<I", k) + text(name) + text(kind) + text(""))
        for k, (name, (kind, _)) in enumerate(entries.items(), start=1)
    )
    samples = [(t, k, data) for k, (_, rows) in enumerate(entries.values(), start=1) for t, data in rows]
    return b"WPILOG" + struct.pack("<HI", 0x0100, 0) + start + b"".join(record(k, t, d) for t, k, d in sorted(samples))


@pytest.fixture
def drive(tmp_path):
    """A robot's drive, its speeds logged half a row after its voltages, with a text and a truth value next to them."""
    t = np.arange(0.0, 6.0, 0.02)
    volts = 3.0 * np.sin(t)
    columns = predicted_columns(RunLog("drive", RunMeta("drive"), t, {"v_cmd_l": volts, "v_cmd_r": volts}), ROBOT)
    times = [5_000_000 + round(1e6 * s) for s in t]
    double = struct.Struct("<d").pack
    entries = {
        **{
            f"drive/{side}_voltage": ("double", [(us, double(v)) for us, v in zip(times, volts)])
            for side in ("left", "right")
        },
        **{
            f"drive/{side} rate": ("double", [(us, double(w / (2 * math.pi))) for us, w in zip(times, columns[name])])
            for side, name in (("left", "w_l"), ("right", "w_r"))
        },
        "enabled": ("boolean", [(times[0], b"\x01")]),
        "messages": ("string", [(times[0], b"hello")]),
    }
    path = tmp_path / "drive.wpilog"
    path.write_bytes(log(entries))
    (tmp_path / "map.toml").write_text(MAPPING)
    return path


def imported(path, tmp_path, **options):
    import_case([path], tmp_path / "case", mapping=tmp_path / "map.toml", robot="frc_cim", **options)
    return read_case(tmp_path / "case").runs[0]


def test_its_entries_become_the_channels_that_a_mapping_names(drive, tmp_path):
    run = imported(drive, tmp_path)
    assert len(run.t) == 300 and np.ptp(run.t) == pytest.approx(5.98)
    assert run.columns["w_l"] == pytest.approx(predicted_columns(run, ROBOT)["w_l"], abs=1e-4)


def test_a_log_that_was_cut_off_is_read_up_to_there(drive, tmp_path):
    drive.write_bytes(drive.read_bytes()[:-4000])
    assert 200 < len(imported(drive, tmp_path).t) < 300


def test_its_entries_are_listed_with_a_guess(drive):
    lines = list(contents(drive))
    assert any("drive/left_voltage" in line and "guess: v_cmd_l, V" in line for line in lines)
    assert not any("messages" in line for line in lines)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda data: b"WPILOG", "is not a WPILib data log"),
        (lambda data: data.replace(b"drive/left rate", b"drive/left rat2"), "no entry 'drive/left rate' with numbers"),
        (lambda data: log({"messages": ("string", [(1, b"a")])}), "holds no entry with numbers"),
        (lambda data: log({"x": ("double", [(1, b"abc")])}), "is damaged"),
    ],
    ids=["no log", "another entry", "texts alone", "a number of three bytes"],
)
def test_what_cannot_be_used_is_refused_in_one_line(drive, tmp_path, change, words):
    drive.write_bytes(change(drive.read_bytes()))
    with pytest.raises(InputError, match=words):
        imported(drive, tmp_path)
    assert not (tmp_path / "case").exists()


def test_without_a_mapping_it_says_that_one_is_needed(drive, tmp_path):
    with pytest.raises(InputError, match="a WPILib data log needs --mapping"):
        import_case([drive], tmp_path / "case", robot="frc_cim")
