"""A run written as MCAP opens elsewhere, and comes back as it was."""

from __future__ import annotations

import io
import math
import sys

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from rtds_host.cli.commands import main
from rtds_host.contract import RunLog, RunMeta, builtin_robot, read_case, read_run
from rtds_host.errors import OutputError
from rtds_host.export.mcap import write_mcap
from rtds_host.importers import import_case


def log(mode="voltage", n=120):
    """A run with every channel, some at half the rate."""
    rng = np.random.default_rng(5)
    t = np.round(0.01 * np.arange(n) + 0.001 * rng.integers(0, 5, n), 6)
    speed = 3.0 * np.sin(2 * t)
    command = "v_cmd" if mode == "voltage" else "w_cmd"
    columns = {
        f"{command}_l": 1.7 * speed,
        f"{command}_r": 1.2 * speed,
        "w_l": speed,
        "w_r": 0.7 * speed,
        "th_l": 1.5 * (1 - np.cos(2 * t)),
        "th_r": 1.05 * (1 - np.cos(2 * t)),
        "gyro_z": 0.033 * (0.7 - 1.0) * speed / 0.16,
    }
    if mode == "voltage":
        columns |= {
            "i_l": 0.1 * speed,
            "i_r": 0.2 * speed,
            "v_bus": np.full(n, 11.75),
            "x": 0.3 + 0.01 * t,
            "y": -0.02 * t,
            "yaw": 3.0 + t,
            "w_ref_l": speed,
            "w_ref_r": speed,
        }
        for name in ("i_l", "x", "y", "yaw", "v_bus"):
            columns[name] = np.where(np.arange(n) % 2 == 0, columns[name], math.nan)
        columns["th_r"] = np.where(np.arange(n) % 3 == 0, columns["th_r"], math.nan)
    return RunLog("run", RunMeta(), t, columns)


@pytest.mark.parametrize("mode", ["voltage", "speed"])
def test_a_run_survives_the_way_through_a_bag(tmp_path, mode):
    run = log(mode)
    write_mcap(tmp_path / "run.mcap", run)
    extra = tmp_path / "rtds-servo.toml"
    extra.write_text(
        'schema = "rtds-mapping/1"\nbase = "rtds"\n[servo]\nkp_v_s_per_rad = 1.0\nki_v_per_rad = 1.0\nperiod_s = 0.01\n'
    )
    import_case([tmp_path / "run.mcap"], tmp_path / "case", mapping=extra, trust_units=True, form="parquet")
    case = read_case(tmp_path / "case")
    back = case.runs[0]
    assert case.robot.driver.mode == mode
    assert back.t == pytest.approx(run.t - run.t[0], abs=1e-9)
    assert set(back.columns) == set(run.columns)
    for name, values in run.columns.items():
        exact = 1e-6 if name == "v_bus" else 1e-12  # BatteryState.voltage is a float32
        assert back.columns[name] == pytest.approx(values, abs=exact, nan_ok=True), name


def decoded(path):
    """(topic, type, log time, message) as the `mcap` library itself reads them."""
    with open(path, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, schema.name, message.log_time, value)
            for schema, channel, message, value in reader.iter_decoded_messages()
        ]


def test_viewers_find_standard_messages_with_times_and_frames(tmp_path):
    run = log()
    write_mcap(tmp_path / "run.mcap", run, builtin_robot("burger"), start_ns=1_000_000_000)
    messages = decoded(tmp_path / "run.mcap")
    kinds = {topic: kind for topic, kind, _, _ in messages}
    assert kinds == {
        "/joint_states": "sensor_msgs/msg/JointState",
        "/imu": "sensor_msgs/msg/Imu",
        "/odom": "nav_msgs/msg/Odometry",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/battery_state": "sensor_msgs/msg/BatteryState",
        **{f"/{name}": "std_msgs/msg/Float64" for name in ("v_cmd_l", "v_cmd_r", "i_l", "i_r", "w_ref_l", "w_ref_r")},
    }
    joints = [m for topic, _, _, m in messages if topic == "/joint_states"]
    assert len(joints) == 120 and joints[0].name == ["wheel_left_joint", "wheel_right_joint"]
    assert list(joints[0].effort) == []
    odometry = [m for topic, _, _, m in messages if topic == "/odom"]
    assert len(odometry) == 60
    assert odometry[30].twist.twist.linear.x == pytest.approx(0.033 * 1.7 / 2 * run.columns["w_l"][60])
    head = odometry[30].header
    assert (head.stamp.sec, head.frame_id) == (1 + int(run.t[60]), "odom")
    times = [when for _, _, when, _ in messages]
    assert times == sorted(times)


def test_a_wheel_without_speeds_and_a_single_axis(tmp_path):
    t = 0.02 * np.arange(10)
    write_mcap(tmp_path / "axis.mcap", RunLog("axis", RunMeta(), t, {"v_cmd_l": t, "th_l": 2 * t}))
    joints = [m for topic, _, _, m in decoded(tmp_path / "axis.mcap") if topic == "/joint_states"]
    assert joints[3].name == ["wheel_left_joint"]
    assert list(joints[3].position) == pytest.approx([0.12]) and list(joints[3].velocity) == []


def test_the_same_run_gives_the_same_bytes(tmp_path):
    write_mcap(tmp_path / "a.mcap", log())
    write_mcap(tmp_path / "b.mcap", log())
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_an_output_that_cannot_be_written_leaves_nothing(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError):
        write_mcap(tmp_path / "file" / "run.mcap", log())
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file"]


def test_the_file_is_complete_for_readers_that_stream(tmp_path):
    write_mcap(tmp_path / "run.mcap", log())
    summary = make_reader(io.BytesIO((tmp_path / "run.mcap").read_bytes())).get_summary()
    assert summary.statistics.message_count == len(decoded(tmp_path / "run.mcap"))


def test_rtds_run_writes_a_bag_that_comes_back_as_the_run_it_wrote(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(
        sys,
        "argv",
        [
            "rtds",
            "run",
            "linear",
            "--link",
            "model",
            "--length",
            "0.5",
            "--duration",
            "9",
            "--no-compare",
            "--no-figure",
            "--mcap",
            "--out",
            str(tmp_path / "run"),
        ],
    )
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 0, capsys.readouterr().err
    import_case([tmp_path / "run" / "run.mcap"], tmp_path / "case", mapping="rtds", form="parquet")
    run, back = read_run(tmp_path / "run"), read_case(tmp_path / "case").runs[0]
    assert back.t == pytest.approx(run.t - run.t[0], abs=1e-9)
    for name in ("v_cmd_l", "v_cmd_r", "i_l", "w_r", "th_l"):
        assert back.columns[name] == pytest.approx(run.columns[name], abs=1e-12, nan_ok=True), name
