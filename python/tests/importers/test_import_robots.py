"""Recordings of robots that come along: namespaces, Gazebo, Create 3, Jackal, and WPILib's SysId; no unit silently
wrong.
"""

import json
import math

import numpy as np
import pytest
from import_recordings import RADIUS, TRACK, Recording, stamp, turtlebot, twist, wheel

from rtds_host.cli.commands import main
from rtds_host.contract import builtin_robot, read_case
from rtds_host.diagnosis.predict import predicted_columns
from rtds_host.errors import InputError
from rtds_host.importers import import_case, load_mapping
from rtds_host.importers.mapping import builtin_mappings
from rtds_host.importers.sysid import read_sysid


def renamed(recording, prefix):
    other = Recording()
    other.messages = [(t, prefix + topic, kind, message) for t, topic, kind, message in recording.messages]
    return other


def columns_of(folder):
    (run,) = read_case(folder).runs
    return {"t": run.t, **run.columns}


@pytest.mark.parametrize("name", builtin_mappings())
def test_every_mapping_that_comes_along_is_read_and_its_robot_is_there(name):
    mapping = load_mapping(name)
    assert mapping.name == name
    if mapping.robot is not None:
        builtin_robot(mapping.robot)


def test_topics_in_a_namespace_are_found_and_said(tmp_path):
    turtlebot().mcap(tmp_path / "plain.mcap")
    renamed(turtlebot(), "/tb3_0").mcap(tmp_path / "spaced.mcap")
    import_case([tmp_path / "plain.mcap"], tmp_path / "plain")
    (run,) = import_case([tmp_path / "spaced.mcap"], tmp_path / "spaced")
    assert "spaced.mcap: topics are those in /tb3_0" in run.imported.notices
    one, two = columns_of(tmp_path / "plain"), columns_of(tmp_path / "spaced")
    assert one.keys() == two.keys()
    assert all(np.array_equal(one[k], two[k], equal_nan=True) for k in one)


def test_two_robots_in_a_bag_are_asked_for(tmp_path):
    both = renamed(turtlebot(), "/tb3_0")
    both.messages += renamed(turtlebot(), "/tb3_1").messages
    both.mcap(tmp_path / "two.mcap")
    with pytest.raises(InputError, match=r"several robots \(/tb3_0, /tb3_1\): say which with --namespace"):
        import_case([tmp_path / "two.mcap"], tmp_path / "case")
    with pytest.raises(InputError, match=r"--namespace tb3_9: no topic of the mapping turtlebot3 .*/tb3_0, /tb3_1"):
        import_case([tmp_path / "two.mcap"], tmp_path / "case", namespace="tb3_9")
    (run,) = import_case([tmp_path / "two.mcap"], tmp_path / "case", namespace="tb3_1")
    assert "two.mcap: topics are those in /tb3_1" in run.imported.notices


def test_the_import_says_which_mapping_and_robot_it_assumed(tmp_path, capsys, monkeypatch):
    turtlebot().mcap(tmp_path / "drive.mcap")

    def said(*more):
        monkeypatch.setattr("sys.argv", ["rtds", "import", str(tmp_path / "drive.mcap"), *more])
        with pytest.raises(SystemExit) as ended:
            main()
        assert not ended.value.code
        return capsys.readouterr().out.splitlines()[0]

    assert (
        said("--out", str(tmp_path / "a"))
        == "mapping turtlebot3 (taken for this recording; --mapping NAME for another); nominal robot burger-nominal"
        " (the mapping's; --robot NAME for another)"
    )
    assert said("--out", str(tmp_path / "b"), "--mapping", "turtlebot3", "--robot", "paper") == (
        "mapping turtlebot3 (given); nominal robot burger-paper (given)"
    )
    assert said("--out", str(tmp_path / "a"), "--append", "--name", "again").endswith(
        "nominal robot burger-nominal (the case's)"
    )


def gazebo(velocity_scale=1.0):
    """What TurtleBot3 in Gazebo records: joint states in rad and rad/s, a clock, no board."""
    recording = Recording()
    for k, t in enumerate(np.arange(0.0, 5.0, 0.05).tolist()):
        (wl, al), (wr, ar) = wheel(t, 0), wheel(t, 1)
        recording.add(t, "/clock", "rosgraph_msgs/Clock", {"clock": stamp(t)})
        recording.add(
            t,
            "/joint_states",
            "sensor_msgs/JointState",
            {
                "header": {"stamp": stamp(t), "frame_id": ""},
                "name": ["wheel_left_joint", "wheel_right_joint"],
                "position": [al, ar],
                "velocity": [velocity_scale * wl, velocity_scale * wr],
                "effort": [],
            },
        )
        if k % 2 == 0:
            recording.add(
                t, "/cmd_vel", "geometry_msgs/Twist", twist(RADIUS * (wl + wr) / 2, RADIUS * (wr - wl) / TRACK)
            )
    return recording


def test_gazebos_turtlebot3_is_told_from_the_real_one_and_its_speeds_are_rad_per_second(tmp_path):
    gazebo().mcap(tmp_path / "sim.mcap")
    (run,) = import_case([tmp_path / "sim.mcap"], tmp_path / "case")
    assert run.assumed.startswith("mapping turtlebot3_gazebo (taken")
    columns = columns_of(tmp_path / "case")
    has = np.isfinite(columns["w_l"])
    assert columns["w_l"][has] == pytest.approx([wheel(t, 0)[0] for t in columns["t"][has]], abs=1e-3)


def test_the_wrong_ones_units_stop_the_import(tmp_path):
    gazebo().mcap(tmp_path / "sim.mcap")
    with pytest.raises(InputError, match="w_l .*"):
        import_case([tmp_path / "sim.mcap"], tmp_path / "case", mapping="turtlebot3")
    gazebo(velocity_scale=RADIUS).mcap(tmp_path / "odd.mcap")
    with pytest.raises(InputError, match="w_l is .* times the slope of th_l: is it in m/s"):
        import_case([tmp_path / "odd.mcap"], tmp_path / "case")
    assert not (tmp_path / "case").exists()


def test_a_create_3_in_a_namespace_is_known_by_its_topics(tmp_path):
    recording = Recording()
    for t in np.arange(0.0, 5.0, 0.05).tolist():
        (wl, al), (wr, ar) = wheel(t, 0), wheel(t, 1)
        head = {"stamp": stamp(t), "frame_id": ""}
        recording.add(
            t,
            "/bot/wheel_vels",
            "irobot_create_msgs/WheelVels",
            {"header": head, "velocity_left": wl, "velocity_right": wr},
        )
        recording.add(
            t,
            "/bot/wheel_ticks",
            "irobot_create_msgs/WheelTicks",
            {
                "header": head,
                "ticks_left": round(al / (2 * math.pi) * 508.8),
                "ticks_right": round(ar / (2 * math.pi) * 508.8),
            },
        )
        recording.add(
            t, "/bot/cmd_vel", "geometry_msgs/Twist", twist(0.03575 * (wl + wr) / 2, 0.03575 * (wr - wl) / 0.233)
        )
    recording.mcap(tmp_path / "tb4.mcap")
    (run,) = import_case([tmp_path / "tb4.mcap"], tmp_path / "case", robot="turtlebot4")
    assert run.assumed.startswith("mapping create3 (taken") and run.assumed.endswith("nominal robot turtlebot4 (given)")
    columns = columns_of(tmp_path / "case")
    assert columns["w_cmd_l"][-1] == pytest.approx(wheel(columns["t"][-1], 0)[0], abs=0.2)
    assert np.ptp(columns["th_r"]) == pytest.approx(np.ptp([wheel(t, 1)[1] for t in columns["t"]]), abs=0.05)


def test_a_jackals_feedback_gives_voltages(tmp_path):
    recording = Recording()
    for t in np.arange(0.0, 5.0, 0.05).tolist():
        drivers = [
            {
                "current": 1.0,
                "duty_cycle": 0.05 * wheel(t, side)[0],
                "measured_velocity": wheel(t, side)[0],
                "measured_travel": wheel(t, side)[1],
            }
            for side in (0, 1)
        ]
        recording.add(
            t, "/feedback", "jackal_msgs/Feedback", {"header": {"stamp": stamp(t), "frame_id": ""}, "drivers": drivers}
        )
    recording.mcap(tmp_path / "j.mcap")
    (run,) = import_case([tmp_path / "j.mcap"], tmp_path / "case")
    assert run.assumed.startswith("mapping jackal (taken") and run.imported.mode == "voltage"
    columns = columns_of(tmp_path / "case")
    assert columns["v_cmd_r"] == pytest.approx(24.0 * 0.05 * columns["w_r"], abs=1e-5)
    assert "i_l" not in columns, "what flows into the bridge is not the motor's current"


ROBOT = builtin_robot("frc_cim")


def sysid(units="Rotations", factor=1.0, turning=False, angle_factor=1.0, test="Drivetrain"):
    """A SysId file of the nominal FRC drivetrain: a slow ramp each way and a step each way."""
    from rtds_host.contract import RunLog, RunMeta

    data = {"sysid": True, "test": test, "units": units, "unitsPerRotation": 1.0}
    for name in ("slow-forward", "slow-backward", "fast-forward", "fast-backward"):
        t = np.arange(0.0, 6.0 if name.startswith("slow") else 1.5, 0.02)
        volts = (t if name.startswith("slow") else np.full(len(t), 4.0)) * (1.0 if name.endswith("forward") else -1.0)
        left, right = (-volts, volts) if turning else (volts, volts)
        log = RunLog(name, RunMeta(name), t, {"v_cmd_l": left, "v_cmd_r": right})
        c = predicted_columns(log, ROBOT)
        turns = factor / (2.0 * math.pi)
        columns = (
            [
                t + 3.0,
                left,
                right,
                turns * c["th_l"],
                turns * c["th_r"],
                turns * c["w_l"],
                turns * c["w_r"],
                0.0 * t,
                angle_factor * c["gyro_z"],
            ]
            if test.startswith("Drivetrain")
            else [t + 3.0, left, turns * c["th_l"], turns * c["w_l"]]
        )
        data[name] = np.column_stack(columns).tolist()
    return data


def written(tmp_path, data):
    path = tmp_path / "sysid_data.json"
    path.write_text(json.dumps(data))
    return path


def test_a_sysid_file_becomes_a_run_a_test(tmp_path):
    runs = import_case([written(tmp_path, sysid())], tmp_path / "case", robot="frc_cim")
    assert [run.name for run in runs] == ["slow-forward", "slow-backward", "fast-forward", "fast-backward"]
    assert runs[0].assumed == (
        "mapping wpilib_sysid (taken for this recording; --mapping NAME for another); nominal robot frc-kit-cim (given)"
    )
    assert any("angle and angular rate are left out" in notice for notice in runs[0].imported.notices)
    case = read_case(tmp_path / "case")
    fast = next(run for run in case.runs if run.name == "fast-forward")
    assert "gyro_z" not in fast.columns
    truth = predicted_columns(fast, case.robot)
    assert fast.columns["w_l"] == pytest.approx(truth["w_l"], abs=1e-6)


@pytest.mark.parametrize("turning", [False, True])
def test_a_file_of_its_forerunner_holds_the_same_but_for_the_rate_of_the_angle(tmp_path, turning):
    """frc-characterization logged battery and throttle as well, and the gyro's angle alone."""
    new = sysid(turning=turning)
    rows = {name: [[r[0], 12.1, 0.3, *r[1:7], r[7]] for r in new[name]] for name in new if name.endswith("ward")}
    old = {**{key: new[key] for key in ("units", "unitsPerRotation")}, **rows}
    runs = []
    for name, data in (("new", new), ("old", old)):
        (tmp_path / name).mkdir()
        import_case([written(tmp_path / name, data)], tmp_path / f"case-{name}", robot="frc_cim")
        runs.append(read_case(tmp_path / f"case-{name}").runs)
    for one, other in zip(*runs, strict=True):
        assert one.name == other.name and "gyro_z" not in other.columns
        for channel in ("v_cmd_l", "v_cmd_r", "th_l", "w_r"):
            assert np.array_equal(one.columns[channel], other.columns[channel])


def test_a_mechanism_of_the_forerunner_becomes_an_axis_of_one_side(tmp_path):
    new = sysid(test="Simple")
    old = {name: [[r[0], 12.1, 0.3, *r[1:]] for r in new[name]] for name in new if name.endswith("ward")}
    assert read_sysid(written(tmp_path, {**old, "test": "Arm"}))["slow-forward"] == new["slow-forward"]


def test_a_robot_must_be_named_for_it(tmp_path):
    with pytest.raises(InputError, match="no nominal robot: give --robot NAME"):
        import_case([written(tmp_path, sysid())], tmp_path / "case")


@pytest.mark.parametrize(
    "unit, factor",
    [
        ("meters", 2 * math.pi * 0.0762),
        ("inches", 2 * math.pi * 0.0762 / 0.0254),
        ("radians", 2 * math.pi),
        ("degrees", 360.0),
    ],
)
def test_positions_in_anything_but_turns_stop_the_import_with_the_unit(tmp_path, unit, factor):
    with pytest.raises(InputError, match=f"times what turns of the wheel would be at these voltages: is it in {unit}"):
        import_case([written(tmp_path, sysid(factor=factor))], tmp_path / "case", robot="frc_cim")
    assert not (tmp_path / "case").exists()


def test_an_angle_is_taken_where_the_wheels_tell_its_unit(tmp_path):
    import_case([written(tmp_path, sysid(turning=True))], tmp_path / "case", robot="frc_cim")
    assert all("gyro_z" in run.columns for run in read_case(tmp_path / "case").runs)
    with pytest.raises(InputError, match="gyro_z is .* is it in degrees"):
        import_case(
            [written(tmp_path, sysid(turning=True, angle_factor=180.0 / math.pi))], tmp_path / "other", robot="frc_cim"
        )


@pytest.mark.parametrize(
    "change, words",
    [
        ({"slow-forward": [[0.0, 1.0]]}, "slow-forward, row 1: 9 numbers are needed"),
        ({"slow-forward": [[0.0] * 8 + ["x"]] * 2}, "slow-forward, row 1: x is not a finite number"),
        ({"slow-forward": "none"}, "slow-forward is not a list of rows"),
        ({"test": 3}, "test and units must be texts"),
    ],
)
def test_a_damaged_sysid_file_is_named_with_the_place(tmp_path, change, words):
    with pytest.raises(InputError, match=words):
        import_case([written(tmp_path, {**sysid(), **change})], tmp_path / "case", robot="frc_cim")


def test_json_that_is_no_sysid_is_refused(tmp_path):
    path = written(tmp_path, {"a": 1})
    with pytest.raises(InputError, match="is not a SysId file"):
        import_case([path], tmp_path / "case", robot="frc_cim")
    path.write_text("{")
    with pytest.raises(InputError, match="is not JSON"):
        import_case([path], tmp_path / "case", robot="frc_cim")
