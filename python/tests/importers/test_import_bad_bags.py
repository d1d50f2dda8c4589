"""Bags that cannot be used: one clear line, and nothing is written."""

from __future__ import annotations

import binascii
import math
import shutil
import sqlite3
import sys

import numpy as np
import pytest
from import_recordings import RADIUS, Recording, stamp, turned, turtlebot, twist, wheel

from rtds_host.cli.commands import main
from rtds_host.errors import InputError
from rtds_host.importers import import_case
from rtds_host.importers.series import NS, Series


def refused(source, tmp_path, **options) -> str:
    """The one line that an import ends with."""
    with pytest.raises(InputError) as caught:
        import_case([source], tmp_path / "case", **options)
    assert not (tmp_path / "case").exists()
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    turtlebot(2.0).mcap(folder / "drive.mcap")
    turtlebot(2.0).sqlite(folder / "humble")
    return folder


@pytest.mark.parametrize("share", np.linspace(0.0, 0.999, 25))
def test_a_truncated_mcap_is_named_whatever_its_length(whole, tmp_path, share):
    data = (whole / "drive.mcap").read_bytes()
    bag = tmp_path / "drive.mcap"
    bag.write_bytes(data[: int(share * len(data))])
    message = refused(bag, tmp_path)
    assert "drive.mcap: is truncated or damaged" in message or "drive.mcap: is empty" in message


@pytest.mark.parametrize("share", np.linspace(0.0, 0.95, 12))
def test_a_truncated_sqlite_file_is_named_whatever_its_length(whole, tmp_path, share):
    shutil.copytree(whole / "humble", tmp_path / "humble")
    file = tmp_path / "humble" / "humble_0.db3"
    file.write_bytes(file.read_bytes()[: int(share * file.stat().st_size)])
    assert "humble: is truncated or damaged" in refused(tmp_path / "humble", tmp_path)


@pytest.mark.parametrize("seed", range(30))
def test_damaged_bytes_end_in_one_line_or_do_no_harm(whole, tmp_path, seed):
    rng = np.random.default_rng(seed)
    data = bytearray((whole / "drive.mcap").read_bytes())
    for at in rng.integers(0, len(data), 8):
        data[at] ^= int(rng.integers(1, 256))
    bag = tmp_path / "drive.mcap"
    bag.write_bytes(data)
    try:
        import_case([bag], tmp_path / "case")
    except InputError as error:
        assert "\n" not in str(error) and "drive.mcap" in str(error)
        assert not (tmp_path / "case").exists()


@pytest.mark.parametrize("seed", range(15))
def test_damaged_databases_end_in_one_line_or_do_no_harm(whole, tmp_path, seed):
    rng = np.random.default_rng(seed)
    shutil.copytree(whole / "humble", tmp_path / "humble")
    file = tmp_path / "humble" / "humble_0.db3"
    data = bytearray(file.read_bytes())
    for at in rng.integers(0, len(data), 40):
        data[at] ^= int(rng.integers(1, 256))
    file.write_bytes(data)
    try:
        import_case([tmp_path / "humble"], tmp_path / "case")
    except InputError as error:
        assert "\n" not in str(error) and "humble" in str(error)
        assert not (tmp_path / "case").exists()


def summary(data: bytes) -> int:
    """Where the summary of an MCAP file begins."""
    return int.from_bytes(data[-28:-20], "little")


def without_checksum(data: bytes) -> bytearray:
    """An MCAP file that says of its summary that no checksum was computed."""
    return bytearray(data[:-12] + bytes(4) + data[-8:])


@pytest.mark.parametrize("seed", range(30))
def test_a_flipped_bit_of_the_summary_is_refused(whole, tmp_path, seed):
    rng = np.random.default_rng(seed)
    data = bytearray((whole / "drive.mcap").read_bytes())
    data[rng.integers(summary(data), len(data))] ^= 1 << int(rng.integers(8))
    (tmp_path / "drive.mcap").write_bytes(data)
    assert "drive.mcap: is truncated or damaged" in refused(tmp_path / "drive.mcap", tmp_path)


def channels(data: bytes) -> list[int]:
    """Where the numbers of the channels stand in the summary of an MCAP file."""
    found, at = [], summary(data)
    while data[at] != 0x02:
        if data[at] == 0x04:
            found.append(at + 9)
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    return found


def test_a_topic_that_a_flipped_bit_takes_away_is_missed_without_a_checksum_too(whole, tmp_path):
    whole_data = (whole / "drive.mcap").read_bytes()
    places = channels(whole_data)
    assert len(places) == 6
    for at in places:
        data = without_checksum(whole_data)
        data[at + 1] ^= 8
        (tmp_path / "drive.mcap").write_bytes(data)
        assert "its summary counts messages of channel" in refused(tmp_path / "drive.mcap", tmp_path)


def test_fewer_messages_than_the_summary_counts_are_refused(whole, tmp_path):
    data = without_checksum((whole / "drive.mcap").read_bytes())
    at = summary(data)
    while data[at] != 0x0B:
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    number = int.from_bytes(
        data[at + 57 : at + 65], "little"
    )  # of the first channel: after 46 bytes and the channel's number
    data[at + 57] ^= 1
    (tmp_path / "drive.mcap").write_bytes(data)
    assert f"{number} messages are there, its summary counts {number ^ 1}" in refused(tmp_path / "drive.mcap", tmp_path)


def test_a_checksum_of_all_data_is_checked(whole, tmp_path):
    data = bytearray((whole / "drive.mcap").read_bytes())
    end = summary(data) - 13
    assert data[end] == 0x0F
    data[end + 9 : end + 13] = binascii.crc32(data[:end]).to_bytes(4, "little")
    (tmp_path / "drive.mcap").write_bytes(data)
    import_case([tmp_path / "drive.mcap"], tmp_path / "whole")
    data[30] ^= 1  # in the name of the library that wrote it
    (tmp_path / "drive.mcap").write_bytes(data)
    assert "the checksum of its data is another" in refused(tmp_path / "drive.mcap", tmp_path)


def test_files_that_are_no_bags(tmp_path):
    (tmp_path / "notes.txt").write_text("hello")
    (tmp_path / "empty").mkdir()
    (tmp_path / "fake.mcap").write_bytes(b"hello, this is no mcap file at all")
    (tmp_path / "fake.db3").write_bytes(b"hello, this is no database file at all, not at all")
    (tmp_path / "odd").mkdir()
    (tmp_path / "odd" / "metadata.yaml").write_text("- not\n- a\n- bag\n")
    assert "needs --mapping" in refused(tmp_path / "notes.txt", tmp_path)
    assert "neither metadata.yaml nor a .mcap or .db3 file" in refused(tmp_path / "empty", tmp_path)
    assert "magic" in refused(tmp_path / "fake.mcap", tmp_path)
    assert "fake.db3: is truncated or damaged" in refused(tmp_path / "fake.db3", tmp_path)
    assert "odd" in refused(tmp_path / "odd", tmp_path)


def test_a_recorder_that_was_killed_leaves_no_metadata_but_its_file_is_read(whole, tmp_path):
    shutil.copytree(whole / "humble", tmp_path / "humble")
    (tmp_path / "humble" / "metadata.yaml").unlink()
    run = import_case([tmp_path / "humble"], tmp_path / "case")[0]
    assert any("metadata.yaml is missing" in notice for notice in run.imported.notices)
    shutil.copy(tmp_path / "humble" / "humble_0.db3", tmp_path / "humble" / "humble_1.db3")
    with pytest.raises(InputError, match="ros2 bag reindex"):
        import_case([tmp_path / "humble"], tmp_path / "other")


def test_a_bag_without_messages(tmp_path):
    Recording().mcap(tmp_path / "none.mcap")
    assert "none.mcap: holds no message" in refused(tmp_path / "none.mcap", tmp_path)


def test_the_missing_command_is_named_with_what_is_there(tmp_path):
    turtlebot(2.0).drop("/cmd_vel").mcap(tmp_path / "drive.mcap")
    message = refused(tmp_path / "drive.mcap", tmp_path)
    assert "no command signal: neither voltages (v_cmd_l, v_cmd_r) nor wheel speeds (w_cmd_l, w_cmd_r)" in message
    assert "no topic /cmd_vel" in message and "/joint_states" in message


def test_a_topic_that_the_metadata_promises_and_the_file_does_not_hold_is_noted(whole, tmp_path):
    shutil.copytree(whole / "humble", tmp_path / "humble")
    base = sqlite3.connect(tmp_path / "humble" / "humble_0.db3")
    base.execute("DELETE FROM messages WHERE topic_id = (SELECT id FROM topics WHERE name = '/imu')")
    base.commit()
    base.close()
    run = import_case([tmp_path / "humble"], tmp_path / "case")[0]
    assert any("/imu: angular_velocity.z holds nothing, gyro_z is left out" in n for n in run.imported.notices)


def test_missing_measurements_are_named(tmp_path):
    turtlebot(2.0).drop("/joint_states", "/sensor_state", "/odom").mcap(tmp_path / "drive.mcap")
    message = refused(tmp_path / "drive.mcap", tmp_path)
    assert "no measured wheel speed or angle" in message and "no topic /joint_states; no topic /odom" in message


def test_what_else_is_missing_is_only_noted(tmp_path):
    turtlebot(2.0).drop("/imu", "/battery_state").mcap(tmp_path / "drive.mcap")
    run = import_case([tmp_path / "drive.mcap"], tmp_path / "case")[0]
    assert any("gyro_z is left out, no topic /imu" in notice for notice in run.imported.notices)
    assert run.imported.counts["v_bus"] == 40  # from /sensor_state


def test_a_topic_of_another_type_is_named_with_its_fields(tmp_path):
    recording = turtlebot(2.0)
    recording.messages = [
        (t, topic, "std_msgs/String" if topic == "/imu" else kind, {"data": "x"} if topic == "/imu" else message)
        for t, topic, kind, message in recording.messages
    ]
    recording.mcap(tmp_path / "drive.mcap")
    message = refused(tmp_path / "drive.mcap", tmp_path)
    assert (
        "topic /imu: is std_msgs/msg/String, which has no field 'angular_velocity.z'; fields there are data" in message
    )


def test_a_joint_that_does_not_exist_is_named(tmp_path):
    recording = turtlebot(2.0)
    for _, topic, _, message in recording.messages:
        if topic == "/joint_states":
            message["name"] = ["left", "right"]
    recording.mcap(tmp_path / "drive.mcap")
    assert "holds no joint 'wheel_left_joint', joints there are left, right" in refused(
        tmp_path / "drive.mcap", tmp_path
    )


def test_a_whole_array_is_no_number(tmp_path):
    turtlebot(2.0).mcap(tmp_path / "drive.mcap")
    mapping = tmp_path / "map.toml"
    mapping.write_text(
        'schema = "rtds-mapping/1"\nbase = "turtlebot3"\n[signal.w_l]\ntopic = "/joint_states"\n'
        'field = "velocity"\nunit = "m/s"\n'
    )
    assert "name an element, as in velocity[0], or a joint" in refused(
        tmp_path / "drive.mcap", tmp_path, mapping=mapping
    )


def test_stamps_that_go_back_are_named(tmp_path):
    recording = turtlebot(2.0)
    for t, topic, _, message in recording.messages:
        if topic == "/imu" and 1.0 < t < 1.04:
            message["header"] = {"stamp": stamp(0.62), "frame_id": ""}
    recording.mcap(tmp_path / "drive.mcap")
    assert "topic /imu, message 21: time goes back by 0.33 s" in refused(tmp_path / "drive.mcap", tmp_path)


def test_a_repeated_stamp_keeps_the_last_value(tmp_path):
    recording = turtlebot(2.0)
    for t, topic, _, message in recording.messages:
        if topic == "/imu" and 1.0 < t < 1.04:
            message["header"] = {"stamp": stamp(0.95), "frame_id": ""}
    recording.mcap(tmp_path / "drive.mcap")
    assert import_case([tmp_path / "drive.mcap"], tmp_path / "case")[0].imported.counts["gyro_z"] == 39


def test_infinite_values_are_named(tmp_path):
    recording = turtlebot(2.0)
    for t, topic, _, message in recording.messages:
        if topic == "/imu" and 1.0 < t < 1.04:
            message["angular_velocity"]["z"] = math.inf
    recording.mcap(tmp_path / "drive.mcap")
    assert "topic /imu, message 21: a value is infinite" in refused(tmp_path / "drive.mcap", tmp_path)


def _scaled(topic, change):
    def make():
        recording = turtlebot(6.0)
        for t, name, _, message in recording.messages:
            if name == topic:
                change(message, t)
        return recording

    return make


def _twist_in_degrees(message, t):
    message["angular"]["z"] = math.degrees(message["angular"]["z"])


def _velocities(factor):
    def change(message, t):
        message["velocity"] = [factor * v for v in message["velocity"]]

    return change


@pytest.mark.parametrize(
    "topic, change, complaint",
    [
        ("/joint_states", _velocities(1 / RADIUS), "w_l reaches 90.* rad/s, 12.* times the nominal no-load speed"),
        ("/joint_states", _velocities(RADIUS), r"w_l is 0.033 times the slope of th_l: is it in m/s\?"),
        ("/joint_states", _velocities(-1.0), "w_l has the opposite sign of the slope of th_l"),
        (
            "/imu",
            lambda m, t: m["angular_velocity"].__setitem__("z", math.degrees(m["angular_velocity"]["z"])),
            r"gyro_z is 57.3 times what the wheels' speeds make of it: is it in degrees\?",
        ),
        ("/battery_state", lambda m, t: m.__setitem__("voltage", 87.0), "v_bus is 87 V, the nominal supply is 12 V"),
        ("/battery_state", lambda m, t: m.__setitem__("voltage", 11900.0), "v_bus is 1.19e"),
    ],
)
def test_units_that_cannot_be_right_stop_the_import(tmp_path, topic, change, complaint):
    import re

    _scaled(topic, change)().mcap(tmp_path / "drive.mcap")
    message = refused(tmp_path / "drive.mcap", tmp_path)
    assert re.search(complaint, message), message
    assert "--trust-units" in message
    run = import_case([tmp_path / "drive.mcap"], tmp_path / "case", trust_units=True)[0]
    assert any(re.search(complaint, notice) for notice in run.imported.notices)


def test_a_pose_in_millimetres_is_noticed(tmp_path):
    recording = turtlebot(6.0)
    x = 0.0
    for k in range(120):
        t = 0.05 * k
        x += 0.05 * RADIUS * (wheel(t, 0)[0] + wheel(t, 1)[0]) / 2
        recording.add(
            t,
            "/mocap",
            "geometry_msgs/PoseStamped",
            {
                "header": {"stamp": stamp(t), "frame_id": "hall"},
                "pose": {"position": {"x": 1e3 * x, "y": 0.0, "z": 0.0}, "orientation": turned(0.0)},
            },
        )
    recording.mcap(tmp_path / "drive.mcap")
    mapping = tmp_path / "map.toml"
    mapping.write_text(
        'schema = "rtds-mapping/1"\nbase = "turtlebot3"\n[signal]\nyaw = []\n'
        'x = { topic = "/mocap", field = "pose.position.x" }\n'
        'y = { topic = "/mocap", field = "pose.position.y" }\n'
    )
    assert "times as far as the wheels roll: is it in millimetres?" in refused(
        tmp_path / "drive.mcap", tmp_path, mapping=mapping
    )


def test_a_robot_that_is_merely_wrong_is_not_complained_about(tmp_path):
    """Gains of 2, swapped leads, a dead sensor: that is for the diagnosis to say."""
    for n, change in enumerate((_velocities(2.0), _velocities(0.0))):
        _scaled("/joint_states", change)().mcap(tmp_path / f"{n}.mcap")
        assert import_case([tmp_path / f"{n}.mcap"], tmp_path / f"case{n}")[0].imported.counts["w_l"] == 120
    recording = turtlebot(6.0)
    for _, topic, _, message in recording.messages:
        if topic == "/cmd_vel":
            message.update(twist(-message["linear"]["x"], -message["angular"]["z"]))
    recording.mcap(tmp_path / "swapped.mcap")
    import_case([tmp_path / "swapped.mcap"], tmp_path / "swapped")


def test_the_command_says_it_in_one_line(tmp_path, monkeypatch, capsys):
    turtlebot(2.0).drop("/cmd_vel").mcap(tmp_path / "drive.mcap")
    monkeypatch.setattr(sys, "argv", ["rtds", "import", str(tmp_path / "drive.mcap"), "--out", str(tmp_path / "case")])
    with pytest.raises(SystemExit) as end:
        main()
    said = capsys.readouterr()
    assert end.value.code == 2 and said.out == ""
    assert said.err.count("\n") == 1 and said.err.startswith(f"rtds: {tmp_path / 'drive.mcap'}: no command signal")


def test_delayed_samples_of_a_short_series():
    series = Series(np.array([0, NS, 2 * NS]), np.array([1.0, 2.0, 3.0]), "here")
    assert series.earlier(1, 0.0).values.tolist() == [2.0, 3.0]
    assert series.earlier(1, 0.0).t_ns.tolist() == [0, NS]
    assert series.earlier(2, 0.25).t_ns.tolist() == [-NS // 4]
    assert len(series.earlier(3, 0.0)) == 0


@pytest.mark.parametrize("count", ["'3'", "[1]"])
def test_a_count_of_messages_that_is_no_number_is_one_clear_line(whole, tmp_path, count):
    shutil.copytree(whole / "humble", tmp_path / "humble")
    file = tmp_path / "humble" / "metadata.yaml"
    text = file.read_text()
    start = text.index("message_count:", text.index("topics_with_message_count"))
    file.write_text(text[:start] + f"message_count: {count}" + text[text.index("\n", start) :])
    assert "humble: is truncated or damaged" in refused(tmp_path / "humble", tmp_path)
