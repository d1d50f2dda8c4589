"""Measured, nominal and corrected side by side: one topic a channel and source, as the usual viewers want them."""

import io
import json
import sys

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from rtds_host.cli.commands import main
from rtds_host.contract import RunLog, RunMeta, builtin_robot, builtin_robot_path, write_run
from rtds_host.export.mcap_compare import Compared, topic_name, write_comparison

ROBOT = builtin_robot("burger")


def log(name="spin"):
    """A run with a Unix time, gaps in the speed and a pose."""
    t = 1.7e9 + 0.1 * np.arange(6)
    w = np.array([0.0, 1.0, np.nan, 3.0, np.nan, 5.0])
    return RunLog(
        name,
        RunMeta(),
        t,
        {
            "v_cmd_l": np.full(6, 2.0),
            "v_cmd_r": np.full(6, -2.0),
            "w_l": w,
            "x": 0.1 * np.arange(6),
            "y": np.zeros(6),
            "yaw": np.full(6, np.pi / 2),
        },
    )


def topics(path):
    """Topic -> [(time in s, message)], and topic -> type."""
    found, kinds = {}, {}
    reader = make_reader(io.BytesIO(path.read_bytes()), decoder_factories=[DecoderFactory()])
    for schema, channel, message, value in reader.iter_decoded_messages():
        found.setdefault(channel.topic, []).append((message.log_time * 1e-9, value))
        kinds[channel.topic] = schema.name
    return found, kinds


def test_a_channel_stands_side_by_side_and_holes_stay_holes(tmp_path):
    replayed = {
        name: {"w_l": np.arange(6) + k, "x": np.ones(6), "y": np.ones(6), "yaw": np.zeros(6)}
        for k, name in enumerate(("nominal", "corrected"), 1)
    }
    write_comparison(tmp_path / "spin.mcap", [Compared(log(), replayed)])
    found, kinds = topics(tmp_path / "spin.mcap")
    assert [(pytest.approx(t), m.data) for t, m in found["/measured/w_l"]] == [
        (0.0, 0.0),
        (0.1, 1.0),
        (0.3, 3.0),
        (0.5, 5.0),
    ]
    assert [m.data for _, m in found["/nominal/w_l"]] == [1, 2, 3, 4, 5, 6]
    assert [m.data for _, m in found["/corrected/w_l"]] == [2, 3, 4, 5, 6, 7]
    assert found["/command/v_cmd_r"][0][1].data == -2.0
    assert kinds["/measured/w_l"] == "std_msgs/msg/Float64" and kinds["/corrected/odom"] == "nav_msgs/msg/Odometry"
    _, pose = found["/measured/odom"][3]
    assert pose.pose.pose.position.x == pytest.approx(0.3) and pose.pose.pose.orientation.z == pytest.approx(
        np.sqrt(0.5)
    )


def test_several_runs_stand_apart_and_begin_together(tmp_path):
    write_comparison(
        tmp_path / "all.mcap", [Compared(log("teleop-2"), {}), Compared(log("teleop_2"), {}), Compared(log("2nd"), {})]
    )
    found, _ = topics(tmp_path / "all.mcap")
    assert {topic.split("/")[1] for topic in found} == {"teleop_2", "teleop_2_2", "run_2nd"}
    assert {messages[0][0] for topic, messages in found.items() if topic.endswith("/measured/x")} == {0.0}


@pytest.mark.parametrize(("name", "topic"), [("teleop-2", "teleop_2"), ("2nd", "run_2nd"), ("Fahrt 1", "Fahrt_1")])
def test_a_run_gets_a_name_that_ros_allows(name, topic):
    assert topic_name(name) == topic


@pytest.fixture
def case(tmp_path):
    """A case folder with one run, and a diagnosis."""
    folder = tmp_path / "case"
    folder.mkdir()
    (folder / "robot.toml").write_bytes(builtin_robot_path("burger").read_bytes())
    run = log()
    write_run(folder / "spin", run.meta, {"t": run.t, **run.columns})
    (folder / "diagnosis.json").write_text(
        json.dumps(
            {
                "schema": "rtds-diagnosis/2",
                "effects": [
                    {"id": "driver_gain", "side": "both", "parameters": {"ratio": {"value": 0.5, "ci90": None}}}
                ],
            }
        )
    )
    return folder


def rtds(words, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["rtds", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code


def test_predict_writes_all_three(case, tmp_path, monkeypatch):
    words = ["predict", case / "spin", "--robot", case / "robot.toml", "--out", tmp_path / "p.csv"]
    assert rtds([*words, "--mcap", tmp_path / "p.mcap", "--diagnosis", case / "diagnosis.json"], monkeypatch) == 0
    found, _ = topics(tmp_path / "p.mcap")
    slow, fast = (found[f"/{source}/w_l"][-1][1].data for source in ("corrected", "nominal"))
    assert slow == pytest.approx(0.5 * fast, rel=1e-6)
    assert rtds([*words, "--mcap", tmp_path / "plain.mcap"], monkeypatch) == 0
    assert "/corrected/w_l" not in topics(tmp_path / "plain.mcap")[0]


@pytest.mark.parametrize(("words", "complaint"), [
    (["predict", "case/spin", "--robot", "case/robot.toml", "--out", "same", "--mcap", "same"],
        "--out and --mcap name one file"),
    (["predict", "case/spin", "--robot", "case/robot.toml", "--out", "p.csv", "--mcap", "case"], "is a folder"),
    (["predict", "case/spin", "--robot", "case/robot.toml", "--out", "p.csv", "--mcap", "case/robot.toml"],
        "an input of this very"),
    (["diagnose", "case", "case", "--out", "out", "--mcap", "m.mcap"], "takes one case, without --scheduler"),
    (["diagnose", "case", "--out", "out", "--mcap", "case"], "is a folder"),
])  # fmt: skip
def test_a_place_that_cannot_be_is_refused_before_the_work(words, complaint, case, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    before = (case / "robot.toml").read_bytes()
    assert rtds(words, monkeypatch) == 2
    assert complaint in capsys.readouterr().err
    assert (
        not (tmp_path / "out").exists()
        and not (tmp_path / "p.csv").exists()
        and (case / "robot.toml").read_bytes() == before
    )
