"""Reading robots, runs and cases: what is accepted, and the one line that bad input gets."""

import json
import math

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rtds_host.contract import RunMeta, builtin_robot, builtin_robot_path, load_robot, read_case, read_run, write_run
from rtds_host.errors import InputError

HEADER = "t,v_cmd_l,v_cmd_r,w_l,w_r\n"


@pytest.fixture
def case(tmp_path):
    (tmp_path / "robot.toml").write_text(builtin_robot_path("burger").read_text())
    run = tmp_path / "run-1"
    run.mkdir()
    (run / "run.json").write_text(json.dumps(RunMeta("steps").to_json()))
    (run / "log.csv").write_text(HEADER + "0,1,1,0,0\n0.01,1,1,0.1,0.1\n0.02,1,1,0.2,0.2\n")
    return tmp_path


def refuse(folder, *words):
    with pytest.raises(InputError) as error:
        read_case(folder)
    line = str(error.value)
    assert "\n" not in line
    for word in words:
        assert word in line, line


@pytest.mark.parametrize(
    "text,words",
    [
        ("t,v_cmd_l,w_l\n0,1,0\n1,1,0\n", ["log.csv", "v_cmd_r", "missing"]),
        ("t,v_cmd_l,v_cmd_r\n0,1,1\n1,1,1\n", ["w_*", "th_*"]),
        (HEADER + "0,1,1,0,0\n0.01,1,1,0,0\n0.005,1,1,0,0\n", ["row 4", "time goes back"]),
        (HEADER + "0,1,1,0,0\n0,1,1,0,0\n", ["row 3", "stands still"]),
        (HEADER + "0,1,1,nan,0\n1,1,1,0,0\n", ["row 2", "w_l"]),
        (HEADER + "0,1,1,inf,0\n1,1,1,0,0\n", ["row 2", "w_l"]),
        (HEADER + "0,1,1,fast,0\n1,1,1,0,0\n", ["row 2", "w_l", "fast"]),
        (HEADER + "0,,1,0,0\n1,1,1,0,0\n", ["row 2", "v_cmd_l", "empty"]),
        (HEADER + "0,1,1,0,0\n1,1,1,0\n", ["row 3", "truncated"]),
        (HEADER + "0,1,1,0,0\n1,1,1,0", ["row 3", "truncated"]),
        (HEADER + "0,1,1,0,0\n", ["at least 2"]),
        (HEADER + "0,1e6,1,0,0\n1,1,1,0,0\n", ["row 2", "v_cmd_l"]),
        ("t,t,v_cmd_l,v_cmd_r,w_l\n0,0,1,1,1\n", ["twice"]),
        ("", ["empty"]),
        (HEADER + "# begin\n0,1,1,0,0\n1,1,1,0,0\n", ["row 2", "cells"]),
        (HEADER + "0,1,1,0,0 # first\n1,1,1,0,0\n", ["row 2", "w_r", "not a number"]),
        (HEADER + "0,1_0,1,0,0\n1,1,1,0,0\n", ["row 2", "v_cmd_l", "1_0"]),
        (HEADER + "0,\uff13,1,0,0\n1,1,1,0,0\n", ["row 2", "v_cmd_l", "not a number"]),
        (HEADER + '"0\n",1,1,0,0\n1,1,1,0,0\n', ["row 2", "cells"]),
        (HEADER + "0,1,1,0,0\n1,1,1,1e300,0\n", ["row 3", "w_l", "beyond anything"]),
        (HEADER + "0,1,1,0,0\n\n1,1,1,0,0\n0.5,1,1,0,0\n", ["row 5", "time goes back"]),
        (HEADER + "0,1,1,0,0\n20000000,1,1,0,0\n", ["row 3", "t is", "seconds"]),
        (HEADER + "-1e308,1,1,0,0\n1e308,1,1,0,0\n", ["row 3", "t is", "seconds"]),
        ((HEADER + "0,1,1,0,0\n1,1,1,0,0\n").replace(",", ";"), ["row 1", "semicolons"]),
        ("0,1,1,0,0\n1,1,1,0,0\n", ["row 1", "header"]),
    ],
)
def test_a_bad_log_is_named_by_file_row_and_column(case, text, words):
    (case / "run-1" / "log.csv").write_text(text)
    refuse(case, "run-1", *words)


def test_a_truncated_parquet_file_is_named(case):
    run = case / "run-1"
    (run / "log.csv").unlink()
    t = np.arange(500) * 0.01
    write_run(run, RunMeta("x"), {"t": t, "v_cmd_l": t, "v_cmd_r": t, "w_l": t}, form="parquet")
    data = (run / "log.parquet").read_bytes()
    (run / "log.parquet").write_bytes(data[: len(data) // 2])
    refuse(case, "log.parquet", "Parquet")


@pytest.mark.parametrize(
    "column,words",
    [
        ({"t": [1700000000000000000, 1700000000020000000]}, ["row 2", "t is", "seconds"]),
        ({"t": [1.0, 0.5]}, ["row 2", "time goes back"]),
        ({"w_l": [0.0, math.inf]}, ["row 2", "w_l"]),
        ({"w_l": ["0", "1"]}, ["w_l", "string"]),
    ],
)
def test_a_bad_parquet_value_is_named_by_its_row_counted_without_a_header(case, column, words):
    (case / "run-1" / "log.csv").unlink()
    pq.write_table(
        pa.table({"t": [0.0, 0.1], "v_cmd_l": [1, 1], "v_cmd_r": [1, 1], "w_l": [0.0, 0.1], **column}),
        case / "run-1" / "log.parquet",
    )
    refuse(case, "log.parquet", *words)


@pytest.mark.parametrize(
    "edit,words",
    [
        (lambda d: d.update(schema="rtds-run/9"), ["schema"]),
        (lambda d: d.update(payload_kg=10**400), ["payload_kg", "within"]),
        (lambda d: d.update(scenario={"name": "eight"}), ["scenario", "text"]),
        (lambda d: d.update(slope_rad=5.7), ["slope_rad", "degrees"]),
        (lambda d: d.update(payload_kg=-1), ["payload_kg"]),
        (lambda d: d.update(uphill_yaw_rad="north"), ["uphill_yaw_rad"]),
    ],
)
def test_a_bad_run_json_is_named_by_key(case, edit, words):
    path = case / "run-1" / "run.json"
    data = json.loads(path.read_text())
    edit(data)
    path.write_text(json.dumps(data))
    refuse(case, "run.json", *words)


@pytest.mark.parametrize(
    "old,new,words",
    [
        ("resistance_ohm = 8.6", "", ["[motor]", "resistance_ohm", "missing"]),
        ("resistance_ohm = 8.6", "resistance_ohm = 0", ["resistance_ohm", "above 0"]),
        ("resistance_ohm = 8.6", "resistance_ohm = nan", ["resistance_ohm", "finite"]),
        ("resistance_ohm = 8.6", "resistance_ohm = '8.6'", ["resistance_ohm", "number"]),
        ("wheel_radius_m = 0.033", "wheel_radius_m = 33", ["wheel_radius_m", "within"]),
        ("gear_ratio = 258.5", "gear_ratio = -258.5", ["gear_ratio", "above 0"]),
        ("[supply]", "[suply]", ["[supply]", "missing"]),
        ('schema = "rtds-robot/1"', 'schema = "rtds-robot/2"', ["schema"]),
        ("[motor]", "[motor", ["TOML"]),
        ("resistance_ohm = 8.6", f"resistance_ohm = {10**400}", ["resistance_ohm", "finite"]),
        ("mass_kg = 1.0", "mass_kg = 1e-300", ["mass_kg", "within"]),
        ("w_rad_s = 0.02", "w_rad_s = 1e300", ["w_rad_s", "within"]),
        ("[motor]", "[driver]\nmode = 'torque'\ntorque_nm_per_v = 0\n[motor]", ["torque_nm_per_v", "is 0"]),
        (
            "[motor]",
            (
                "[servo]\nkp_v_s_per_rad = 1\nki_v_per_rad = 1\nlimit_v = 12\nperiod_s = 1e-9\n"
                "[driver]\nmode = 'speed'\n[motor]"
            ),
            ["period_s", "within"],
        ),
        ("[motor]", f"a = {'[' * 5000}{']' * 5000}\n[motor]", ["TOML"]),
    ],
)
def test_a_bad_robot_is_named_by_table_and_key(case, old, new, words):
    path = case / "robot.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    refuse(case, "robot.toml", *words)


def test_wheels_without_a_noise_to_count_in_are_said_to_be_just_that(case):
    path = case / "robot.toml"
    path.write_text(path.read_text().replace("w_rad_s = 0.02", ""))
    refuse(case, "robot.toml", "[sensors]", "w_*")
    assert len(read_case(case, need_measured=False).runs) == 1


def test_an_empty_folder_and_a_folder_without_runs_are_refused(tmp_path, case):
    empty = tmp_path / "empty"
    empty.mkdir()
    refuse(empty, "empty")
    bare = tmp_path / "bare"
    bare.mkdir()
    (bare / "robot.toml").write_text(builtin_robot_path("burger").read_text())
    refuse(bare, "no run")


def test_runs_of_different_robots_in_one_case_are_refused(case):
    text = builtin_robot_path("burger").read_text().replace("wheel_radius_m = 0.033", "wheel_radius_m = 0.04")
    (case / "run-1" / "robot.toml").write_text(text)
    refuse(case, "another robot")


def test_a_robot_without_a_name_is_the_same_robot_in_every_folder(case):
    text = builtin_robot_path("burger").read_text().replace('name = "burger-nominal"', "")
    (case / "robot.toml").write_text(text)
    (case / "run-1" / "robot.toml").write_text(text)
    assert len(read_case(case).runs) == 1


def test_names_that_the_contract_does_not_know_are_ignored_with_a_notice(case):
    with open(case / "robot.toml", "a") as stream:
        stream.write("w = 0.02\n[drivers]\nmode = 'torque'\n")
    path = case / "run-1" / "run.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "payload": 1.0}))
    notices = " ".join(read_case(case).notices)
    assert "[sensors] w " in notices and "'drivers'" in notices and "'payload'" in notices


def test_a_bus_that_was_to_be_measured_and_was_not_is_told(case):
    with open(case / "robot.toml", "a") as stream:
        stream.write("[driver]\nbus = 'measured'\n")
    assert any("no v_bus" in notice for notice in read_case(case).notices)


def test_marks_that_editors_put_before_the_text_are_no_part_of_it(case):
    for path in (case / "robot.toml", case / "run-1" / "run.json", case / "run-1" / "log.csv"):
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert list(read_case(case).runs[0].t) == [0, 0.01, 0.02]


def test_times_of_a_clock_that_counts_since_1970_stay_apart_when_written(tmp_path):
    t = 1.7e9 + np.arange(5) * 0.02
    write_run(tmp_path / "run", RunMeta("x"), {"t": t, "v_cmd_l": t * 0, "v_cmd_r": t * 0})
    assert np.allclose(read_run(tmp_path / "run").t, t, rtol=0, atol=1e-5)


def test_empty_cells_keep_commands_and_leave_measurements_out_and_strange_columns_are_ignored_with_a_notice(case):
    (case / "run-1" / "log.csv").write_text("t,v_cmd_l,v_cmd_r,w_l,mood\n0,1,2,0,9\n0.01,,,,\n0.03,3,,0.2,good\n")
    run = read_case(case).runs[0]
    assert list(run.columns["v_cmd_l"]) == [1, 1, 3] and list(run.columns["v_cmd_r"]) == [2, 2, 2]
    assert np.isnan(run.columns["w_l"][1]) and "mood" not in run.columns
    assert any("mood" in notice for notice in run.notices)


def test_what_is_written_is_read_back_the_same(tmp_path):
    t = np.arange(5) * 0.01
    w = np.array([0, np.nan, 0.1, np.nan, 0.25])
    for form in ("csv", "parquet"):
        write_run(
            tmp_path / form,
            RunMeta("x", 2.0, 0.1, 1.5, "n"),
            {"t": t, "v_cmd_l": t, "v_cmd_r": -t, "w_l": w},
            form=form,
        )
        run = read_run(tmp_path / form)
        assert run.meta == RunMeta("x", 2.0, 0.1, 1.5, "n")
        assert np.array_equal(run.columns["w_l"], w, equal_nan=True) and np.array_equal(run.t, t)


def test_an_axis_needs_only_the_left_columns_and_torque_mode_no_winding(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text("""
schema = "rtds-robot/1"
[motor]
rotor_inertia_kg_m2 = 0.0
viscous_friction_nm_s_per_rad = 1e-5
gear_ratio = 1.0
[supply]
voltage_v = 10.0
[axis]
kind = "linear"
mass_kg = 95.0
metres_per_rad = 4e-4
[driver]
mode = "torque"
torque_nm_per_v = 0.014
[sensors]
w_rad_s = 0.02
""")
    robot = load_robot(path)
    assert robot.sides == ("l",) and np.isnan(robot.motor.resistance_ohm)
    assert builtin_robot("burger").sides == ("l", "r")


@pytest.mark.parametrize(
    ("y_m", "sound"), [(0.0, True), (0.0499, True), (-0.0499, True), (0.0501, False), (-0.5, False)]
)
def test_the_yaw_inertia_about_the_axle_holds_its_own_mass_beside_it(case, y_m, sound):
    """By the parallel axes at least m y^2: of the burger's 1 kg and 0.0025 kg m^2, up to 0.05 m."""
    path = case / "robot.toml"
    text = path.read_text()
    path.write_text(text.replace("com_y_m = 0.0 ", f"com_y_m = {y_m} "))
    if sound:
        assert load_robot(path).wheeled.com_y_m == y_m
    else:
        refuse(case, "robot.toml: [chassis] com_y_m: is", "yaw_inertia_kg_m2")


@pytest.mark.parametrize("value", ["3", "true", "0.5", "[1, 2]", "[[1], [2]]", '"motor"'])
def test_a_value_in_place_of_the_tolerances_is_named(case, value):
    path = case / "robot.toml"
    path.write_text(f"tolerance = {value}\n{path.read_text()}")
    refuse(case, "robot.toml: [tolerance]: is ", "table")
