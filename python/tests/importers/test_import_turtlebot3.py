"""A stock TurtleBot3's bag becomes a case of the contract, with every oddity of its topics put right."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from import_recordings import (
    COUNT,
    EPOCH_NS,
    NS,
    RADIUS,
    TICK,
    TRACK,
    Recording,
    stamp,
    turned,
    turtlebot,
    twist,
    wheel,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, Writer
from rosbags.typesys import Stores, get_typestore

from rtds_host.contract import RunMeta, builtin_robot, read_case
from rtds_host.errors import InputError
from rtds_host.importers import import_case, load_mapping
from rtds_host.importers.assemble import wheel_speeds


def run_of(source, tmp_path, **options):
    out = tmp_path / "case"
    imported = import_case([source], out, **options)
    case = read_case(out)
    assert len(case.runs) == 1
    return case, case.runs[0], imported[0].imported.notices


def expected(run, side, what):
    return np.array([wheel(t, side)[what] for t in run.t])


@pytest.fixture
def bag(tmp_path):
    path = tmp_path / "drive.mcap"
    turtlebot().mcap(path)
    return path


def test_joint_velocities_in_metres_per_second_become_wheel_speeds(bag, tmp_path):
    _, run, _ = run_of(bag, tmp_path)
    for side, name in enumerate(("w_l", "w_r")):
        has = np.isfinite(run.columns[name])
        assert has.sum() == 100
        assert run.columns[name][has] == pytest.approx(expected(run, side, 0)[has], abs=1e-6)


def test_fresh_encoder_counts_are_preferred_to_late_positions(bag, tmp_path):
    _, run, _ = run_of(bag, tmp_path)
    has = np.isfinite(run.columns["th_l"])
    assert has.sum() == 100
    assert run.columns["th_l"][has] == pytest.approx(expected(run, 0, 1)[has], abs=TICK)


@pytest.mark.parametrize("lost", [(), (30, 31, 70)])
def test_positions_one_sample_late_are_put_back_to_the_time_they_were_read(tmp_path, lost):
    path = tmp_path / "drive.mcap"
    turtlebot(lost=lost).drop("/sensor_state").mcap(path)
    _, run, _ = run_of(path, tmp_path)
    has = np.isfinite(run.columns["th_l"])
    assert has.sum() == 99 - len(lost)
    # Where read-outs are lost, the position in the next message still belongs to the read-out before it.
    assert run.columns["th_l"][has] == pytest.approx(expected(run, 0, 1)[has], abs=1e-6)


def test_commands_are_cut_as_the_node_and_the_firmware_cut_them():
    sent = load_mapping("turtlebot3").twist
    robot = builtin_robot("burger")

    def asked(linear, angular):
        return wheel_speeds(sent, robot, np.array([linear]), np.array([angular]))[0]

    # 0.153 m/s leaves the node as 15 and becomes whole counts of 0.229 rpm, cut toward zero.
    assert asked(0.153, 0.0) == pytest.approx([math.floor(0.15 / RADIUS / COUNT) * COUNT] * 2, abs=1e-6)
    assert asked(-0.153, 0.0) == pytest.approx(-asked(0.153, 0.0))
    # 0.07 * 100 is 7.000000000000001, 0.29 * 100 is 28.999999999999996: the cast keeps 7 and 28.
    assert asked(0.0, 0.29)[1] == pytest.approx(math.floor(0.28 * TRACK / 2 / RADIUS / COUNT) * COUNT, abs=1e-6)
    # Nothing beyond what 61 rpm allow.
    assert asked(0.5, 0.0) == pytest.approx([math.floor(0.2108 / RADIUS / COUNT) * COUNT] * 2, abs=COUNT)
    assert np.all(asked(0.009, 0.0) == 0.0)


def test_the_case_is_in_speed_mode_with_the_servos_inner_loop(bag, tmp_path):
    case, run, _ = run_of(bag, tmp_path)
    assert case.robot.driver.mode == "speed"
    assert case.robot.servo.kp_v_s_per_rad == pytest.approx(100 / 128 * (12 / 885) / COUNT, rel=1e-3)
    assert case.robot.servo.limit_v == 12.0
    assert case.robot.motor == builtin_robot("burger").motor
    assert case.robot.chassis == builtin_robot("burger").chassis
    assert not any(name.startswith("v_cmd") for name in run.columns)


def test_commands_stand_at_the_time_they_came_and_zero_before_the_first(bag, tmp_path):
    _, run, _ = run_of(bag, tmp_path)
    assert run.t[0] == 0.0
    first = np.flatnonzero(run.t > 0.505)[0]
    assert np.all(run.columns["w_cmd_l"][:first] == 0.0)
    raw = (tmp_path / "case" / "drive" / "log.csv").read_text().splitlines()
    cells = [line.split(",") for line in raw[1:]]
    w_cmd = raw[0].split(",").index("w_cmd_l")
    given = [float(row[0]) for row in cells if row[w_cmd]]
    assert given[1:] == pytest.approx(np.arange(0.51, 4.951, 0.1), abs=1e-6)


def test_the_bus_comes_from_the_voltage_and_the_percentage_is_ignored(bag, tmp_path):
    _, run, _ = run_of(bag, tmp_path)
    assert np.nanmax(np.abs(run.columns["v_bus"] - 11.9)) < 1e-5


def test_odometry_is_no_measurement_from_outside(bag, tmp_path):
    _, run, _ = run_of(bag, tmp_path)
    assert not {"x", "y", "yaw"} & set(run.columns)


def test_on_a_declared_slope_the_first_heading_is_kept_and_only_that(bag, tmp_path):
    _, run, _ = run_of(bag, tmp_path, meta=RunMeta("hill", 0.5, 0.1, 0.2, "ramp"))
    assert (run.meta.slope_rad, run.meta.payload_kg, run.meta.uphill_yaw_rad) == (0.1, 0.5, 0.2)
    assert run.columns["yaw"][0] == pytest.approx(0.7)
    assert np.isfinite(run.columns["yaw"]).sum() == 1


def test_without_joint_states_speeds_come_from_the_odometry(tmp_path):
    path = tmp_path / "drive.mcap"
    turtlebot().drop("/joint_states").mcap(path)
    _, run, _ = run_of(path, tmp_path)
    has = np.isfinite(run.columns["w_r"])
    # The node's odometry speed is a mean over the last but one interval: it belongs 75 ms before its stamp, so the
    # run starts 75 ms earlier, and the commands come that much later in it.
    assert run.columns["w_r"][has] == pytest.approx(expected(run, 1, 0)[has], abs=1e-6)
    assert run.t[np.flatnonzero(run.columns["w_cmd_l"])[0]] == pytest.approx(0.61 + 0.075, abs=1e-6)


def test_bags_of_three_writers_give_the_same_run(bag, tmp_path):
    columns = []
    for n, source in enumerate(
        (bag, turtlebot().mcap_folder(tmp_path / "folder"), turtlebot().sqlite(tmp_path / "humble"))
    ):
        _, run, _ = run_of(source, tmp_path / str(n))
        columns.append(run)
    for other in columns[1:]:
        assert np.array_equal(other.t, columns[0].t)
        assert set(other.columns) == set(columns[0].columns)
        for name, values in columns[0].columns.items():
            assert np.array_equal(other.columns[name], values, equal_nan=True), name


@pytest.mark.parametrize("version", [8, 9])
def test_a_bag_of_a_newer_ros_with_definitions_in_sqlite3(tmp_path, version):
    store = get_typestore(Stores.ROS2_JAZZY)
    kinds = store.types
    with Writer(tmp_path / "jazzy", version=version) as writer:
        joints = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        command = writer.add_connection("/cmd_vel", "geometry_msgs/msg/TwistStamped", typestore=store)
        for k in range(60):
            now = EPOCH_NS + k * 50_000_000
            head = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](now // NS, now % NS), "")
            message = kinds["sensor_msgs/msg/JointState"](
                head,
                ["wheel_right_joint", "wheel_left_joint"],
                np.array([2.0, 1.0]) + 0.05 * k * np.array([1.5, 1.0]),
                np.array([1.5, 1.0]) * RADIUS,
                np.array([]),
            )
            writer.write(joints, now + 1_000_000, store.serialize_cdr(message, message.__msgtype__))
            vector = kinds["geometry_msgs/msg/Vector3"]
            message = kinds["geometry_msgs/msg/TwistStamped"](
                head, kinds["geometry_msgs/msg/Twist"](vector(0.04, 0.0, 0.0), vector(0.0, 0.0, 0.1))
            )
            writer.write(command, now, store.serialize_cdr(message, message.__msgtype__))
    _, run, _ = run_of(tmp_path / "jazzy", tmp_path)
    assert np.nanmedian(run.columns["w_l"]) == pytest.approx(1.0)
    assert np.nanmedian(run.columns["w_r"]) == pytest.approx(1.5)
    assert run.columns["th_l"][0] == pytest.approx(1.05)
    assert run.columns["w_cmd_r"][0] == pytest.approx(
        math.floor((0.04 + 0.1 * TRACK / 2) / RADIUS / COUNT) * COUNT, abs=1e-6
    )


@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_compressed_bags(bag, tmp_path, mode):
    writer = Writer(tmp_path / "small", version=8)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with Reader(bag) as reader, writer:
        there = {
            c.id: writer.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, rihs01="RIHS01_0")
            for c in reader.connections
        }
        for connection, when, raw in reader.messages():
            writer.write(there[connection.id], when, raw)
    _, whole, _ = run_of(bag, tmp_path / "a")
    _, small, _ = run_of(tmp_path / "small", tmp_path / "b")
    assert np.array_equal(small.t, whole.t)
    for name, values in whole.columns.items():
        assert np.array_equal(small.columns[name], values, equal_nan=True), name


def test_a_stamped_command_counts_when_it_arrives_not_when_another_computer_thinks_it_left(tmp_path):
    recording = turtlebot()
    recording.messages = [
        (
            t,
            topic,
            "geometry_msgs/TwistStamped",
            {"header": {"stamp": stamp(t - 0.3), "frame_id": ""}, "twist": message},
        )
        if topic == "/cmd_vel"
        else (t, topic, kind, message)
        for t, topic, kind, message in recording.messages
    ]
    recording.mcap(tmp_path / "stamped.mcap")
    turtlebot().mcap(tmp_path / "plain.mcap")
    _, stamped, _ = run_of(tmp_path / "stamped.mcap", tmp_path / "a")
    _, plain, _ = run_of(tmp_path / "plain.mcap", tmp_path / "b")
    assert np.array_equal(stamped.t, plain.t)
    assert np.array_equal(stamped.columns["w_cmd_l"], plain.columns["w_cmd_l"])


def test_stamps_of_another_clock_give_way_to_the_recorders(tmp_path):
    path = tmp_path / "drive.mcap"
    # A node on simulated time: its stamps count from zero, the recorder's clock does not.
    turtlebot(stamp_epoch_ns=0, log_delay_s=0.0).mcap(path)
    _, run, notices = run_of(path, tmp_path)
    assert any("recorder's times were used" in notice for notice in notices)
    has = np.isfinite(run.columns["w_l"])
    assert run.columns["w_l"][has] == pytest.approx(expected(run, 0, 0)[has], abs=1e-6)


@pytest.mark.parametrize("without", ["/scan", "/joint_states"])
def test_a_robot_that_moves_before_the_first_command_is_cut_to_it(tmp_path, without):
    recording = turtlebot().drop(without, "/odom")
    recording.messages = [m for m in recording.messages if m[1] != "/cmd_vel" or m[0] > 2.0]
    path = tmp_path / "late.mcap"
    recording.mcap(path)
    _, run, notices = run_of(path, tmp_path)
    assert any("moves before the first command" in notice for notice in notices)
    # It starts with the first measurement that has a command, so that the first row tells how the robot moves.
    assert run.columns["th_l"][0] == pytest.approx(wheel(2.05, 0)[1], abs=TICK)
    assert "w_l" not in run.columns or run.columns["w_l"][0] == pytest.approx(wheel(2.05, 0)[0])
    assert run.t[-1] == pytest.approx(4.95 - 2.05)


def test_a_message_that_does_not_fit_its_type_is_passed_over_where_another_topic_serves(tmp_path):
    recording = turtlebot()
    # The message of ROS 1 has another layout; the bag of Humble carries no definition that could tell.
    recording.messages = [
        (
            t,
            topic,
            "std_msgs/String" if topic == "/sensor_state" else kind,
            {"data": "x"} if topic == "/sensor_state" else message,
        )
        for t, topic, kind, message in recording.messages
    ]
    folder = recording.sqlite(tmp_path / "old")
    import sqlite3

    base = sqlite3.connect(folder / "old_0.db3")
    base.execute("UPDATE topics SET type = 'turtlebot3_msgs/msg/SensorState' WHERE name = '/sensor_state'")
    base.commit()
    base.close()
    text = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(text.replace("std_msgs/msg/String", "turtlebot3_msgs/msg/SensorState"))
    _, run, notices = run_of(folder, tmp_path)
    assert any("does not fit its type" in notice and "th_l is taken from /joint_states" in notice for notice in notices)
    assert np.isfinite(run.columns["th_l"]).sum() == 99


def test_the_origin_stands_in_run_json(bag, tmp_path):
    run_of(bag, tmp_path)
    said = json.loads((tmp_path / "case" / "drive" / "run.json").read_text())
    assert said["scenario"] == "drive"
    assert "drive.mcap" in said["notes"] and "2023-11-14T22:13:20Z" in said["notes"]


def test_effort_may_be_empty_or_mapped(tmp_path):
    path = tmp_path / "drive.mcap"
    turtlebot().mcap(path)
    more = tmp_path / "more.toml"
    more.write_text(
        'schema = "rtds-mapping/1"\nbase = "turtlebot3"\n[signal.i_l]\ntopic = "/joint_states"\n'
        'field = "effort"\njoint = "wheel_left_joint"\nunit = "mA"\n'
    )
    _, run, notices = run_of(path, tmp_path, mapping=more)
    assert "i_l" not in run.columns
    assert any("effort holds nothing, i_l is left out" in notice for notice in notices)


def test_part_of_a_recording(bag, tmp_path):
    _, run, _ = run_of(bag, tmp_path, start_s=1.0, end_s=3.0)
    assert run.t[0] == 0.0 and run.t[-1] == pytest.approx(2.0, abs=0.051)
    assert run.columns["w_cmd_l"][0] != 0.0
    with pytest.raises(InputError, match="do not overlap"):
        run_of(bag, tmp_path / "again", start_s=60.0)


def test_a_pose_from_outside_is_taken_where_the_mapping_names_it(tmp_path):
    recording: Recording = turtlebot()
    for k in range(100):
        yaw = 3.0 + 0.02 * k
        recording.add(
            0.05 * k,
            "/mocap",
            "geometry_msgs/PoseStamped",
            {
                "header": {"stamp": stamp(0.05 * k), "frame_id": "hall"},
                "pose": {"position": {"x": 0.1, "y": -0.2, "z": 0.3}, "orientation": turned(yaw)},
            },
        )
    path = tmp_path / "drive.mcap"
    recording.mcap(path)
    more = tmp_path / "more.toml"
    more.write_text(
        'schema = "rtds-mapping/1"\nbase = "turtlebot3"\n[signal]\n'
        'x = { topic = "/mocap", field = "pose.position.x" }\n'
        'y = { topic = "/mocap", field = "pose.position.y", unit = "m" }\n'
        'yaw = { topic = "/mocap", field = "pose.orientation" }\n'
    )
    _, run, _ = run_of(path, tmp_path, mapping=more, trust_units=True)
    yaw = run.columns["yaw"][np.isfinite(run.columns["yaw"])]
    # The heading goes on beyond pi: a quaternion wraps, the contract's yaw does not.
    assert yaw == pytest.approx(3.0 + 0.02 * np.arange(100))
    assert np.nanmin(run.columns["x"]) == 0.1


def test_twist_helpers_agree_on_left_and_right():
    speeds = wheel_speeds(load_mapping("turtlebot3").twist, builtin_robot("burger"), np.array([0.0]), np.array([1.0]))
    assert speeds[0, 0] < 0 < speeds[0, 1]
    assert twist(0.0, 1.0)["angular"]["z"] == 1.0
