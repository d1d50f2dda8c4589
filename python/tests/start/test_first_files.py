"""A robot's file from a data sheet, a draft mapping from a recording, what is installed, scenarios of one's own."""

import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from rtds_host.cli.commands import main
from rtds_host.compat import tomllib
from rtds_host.contract import builtin_robot_path, load_robot, read_case
from rtds_host.errors import InputError
from rtds_host.scenario import own_scenario
from rtds_host.start.datasheet import FIGURES, LOAD_FIGURES, LOADS, Sheet, check, constants, option, robot_text
from rtds_host.start.doctor import findings
from rtds_host.start.draft import channel_of, unit_of

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
# The XL430-W250's data sheet at 12 V, on a TurtleBot3 Burger.
SHEET = Sheet("mine", 12.0, 1.4, 61.0, 0.14, 258.5, 0.033, 0.160, 1.0, 4096.0, "gear", 1.5)
WORDS = [
    "--voltage",
    "12",
    "--stall-current",
    "1.4",
    "--stall-torque",
    "1.5",
    "--no-load-rpm",
    "61",
    "--no-load-current",
    "0.14",
    "--gear-ratio",
    "258.5",
    "--wheel-radius",
    "0.033",
    "--track-width",
    "0.16",
    "--mass",
    "1.0",
    "--counts",
    "4096",
    "--encoder",
    "gear",
]


@pytest.fixture
def rtds(monkeypatch, capfd):
    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["rtds", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capfd.readouterr()
        return ended.value.code, out, err.splitlines()

    return call


def test_a_data_sheet_gives_the_constants_that_it_was_made_from():
    found = constants(SHEET)
    # By hand: 12 / 1.4; (12 - 1.2) / (61 rpm) / 258.5.
    assert found.resistance_ohm == pytest.approx(8.571, rel=1e-3)
    assert found.constant == pytest.approx(10.8 / (61 * 2 * math.pi / 60) / 258.5, rel=1e-12)
    speed = 61 * 2 * math.pi / 60 * 258.5
    assert found.friction_nm_s * speed == pytest.approx(found.constant * 0.14)
    assert found.gear_loss == pytest.approx(1.0 - 1.5 / (found.constant * 258.5 * 1.26))


def test_the_file_says_of_each_value_how_it_was_had_and_is_read(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text(robot_text(SHEET))
    data, robot = tomllib.loads(path.read_text()), load_robot(path)
    assert robot.name == "mine" and data["sensors"]["encoder"] == "gear"
    assert data["tolerance"]["resistance_ohm"] == 0.1 and data["tolerance"]["rotor_inertia_kg_m2"] == 0.5
    assert robot.motor.resistance_ohm == pytest.approx(12.0 / 1.4, rel=1e-3)
    for line in path.read_text().split("[tolerance]")[0].splitlines():
        if "=" in line and line.split(" = ")[0] in data["motor"] | data["chassis"]:
            assert line.startswith(("back_emf", "com_y")) or "#" in line, line


@pytest.mark.parametrize(
    ("figure", "value", "said"),
    [
        ("voltage_v", 0.0, "--voltage 0: it must lie within 0.1 to 1000"),
        ("wheel_radius_m", 33.0, "--wheel-radius 33: it must lie within 0.001 to 10"),
        ("no_load_current_a", 2.0, "--no-load-current 2: it must be below the stall current, 1.4 A"),
        ("encoder", "shaft", "--encoder shaft: unknown (known: motor, gear, wheel)"),
        ("voltage_v", math.nan, "--voltage nan: it must lie within 0.1 to 1000"),
    ],
)
def test_figures_that_no_motor_has_are_named_by_their_option(figure, value, said):
    with pytest.raises(InputError) as refused:
        check(Sheet(**{**SHEET.__dict__, figure: value}))
    assert str(refused.value) == said


def test_every_figure_has_an_option_of_the_command(rtds):
    status, out, _ = rtds("init", "--help")
    assert status == 0 and all(option(name) in out for name in (*FIGURES, *LOAD_FIGURES))


def test_a_script_gives_options_and_gets_a_robot(rtds, tmp_path):
    status, out, said = rtds("init", tmp_path / "mine", *WORDS)
    assert (status, said) == (0, []) and str(tmp_path / "mine" / "robot.toml") in out
    assert load_robot(tmp_path / "mine" / "robot.toml").name == "mine"
    status, _, said = rtds("init", tmp_path / "mine", *WORDS)
    assert status == 2 and said[0].endswith("already exists; choose another folder")


def test_what_is_missing_is_named_and_nothing_is_written(rtds, tmp_path):
    status, _, said = rtds("init", tmp_path / "mine", "--voltage", "12")
    assert status == 2 and "--stall-current, --no-load-rpm" in said[0] and "missing" in said[0]
    assert not (tmp_path / "mine").exists()


MOTOR = WORDS[: WORDS.index("--wheel-radius")] + ["--counts", "4096", "--encoder", "gear"]
OF_LOAD = {
    "inertia": ["--load-inertia", "1.5e-3"],
    "pendulum": ["--load-mass", "0.4", "--arm-length", "0.2"],
    "linear": ["--load-mass", "2.5", "--travel", "0.008"],
}


@pytest.mark.parametrize("kind", LOADS)
def test_a_motor_with_a_load_of_its_own_is_an_axis_with_tolerances(rtds, tmp_path, kind):
    status, _, said = rtds("init", tmp_path / "arm", "--axis", kind, *MOTOR, *OF_LOAD[kind])
    assert (status, said) == (0, [])
    robot = load_robot(tmp_path / "arm" / "robot.toml")
    assert robot.chassis is None and robot.axis.kind == kind and robot.notices == ()
    assert robot.motor.resistance_ohm == pytest.approx(12.0 / 1.4, rel=1e-4)
    load = {
        "inertia": {"inertia_kg_m2": 1.5e-3},
        "pendulum": {"mass_kg": 0.4, "length_m": 0.2, "zero_rad": 0.0},
        "linear": {"mass_kg": 2.5, "metres_per_rad": 0.008 / (2.0 * math.pi)},
    }[kind]
    for name, value in load.items():
        assert getattr(robot.axis, name) == pytest.approx(value)
    declared = {name for name in load if name in ("inertia_kg_m2", "mass_kg", "length_m")}
    assert declared <= set(robot.tolerance) and robot.tolerance_of("rotor_inertia_kg_m2") == 0.5
    assert robot.noise("th_l") == pytest.approx(2 * math.pi / 4096 / math.sqrt(12), rel=1e-2)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--axis", "arm", *MOTOR], "--axis 'arm': unknown (known: inertia, pendulum, linear)"),
        (["--axis", "linear", *MOTOR, "--load-mass", "1"], "--travel: missing"),
        (["--axis", "inertia", *MOTOR, "--load-inertia", "-1"], "--load-inertia -1: it must lie within"),
        (["--axis", "inertia", *MOTOR, "--track-width", "1"], "--track-width: has no meaning for --axis inertia"),
        ([*WORDS, "--travel", "1"], "--travel: has no meaning for a robot on two wheels"),
        (["--like", "burger", "--axis", "linear"], "--like burger: a built-in robot has its own figures"),
    ],
)
def test_an_axis_that_cannot_be_is_a_line_and_nothing_is_written(rtds, tmp_path, words, said):
    status, _, lines = rtds("init", tmp_path / "arm", *words)
    assert status == 2 and len(lines) == 1 and lines[0].startswith(f"rtds: {said}")
    assert not (tmp_path / "arm").exists()


def test_a_robot_that_comes_along_is_copied_word_for_word(rtds, tmp_path):
    assert rtds("init", tmp_path / "mine", "--like", "waffle")[0] == 0
    assert (tmp_path / "mine" / "robot.toml").read_text() == builtin_robot_path("waffle").read_text()
    status, _, said = rtds("init", tmp_path / "other", "--like", "wafle")
    assert status == 2 and "did you mean 'waffle'?" in said[0]


@pytest.mark.parametrize(
    ("name", "channel", "unit"),
    [
        ("left_pwm", "v_cmd_l", "pwm"),
        ("motorRight_rpm", "w_r", "rpm"),
        ("enc_left_ticks", "th_l", "counts"),
        ("current_right_mA", "i_r", "mA"),
        ("battery_mV", "v_bus", "mV"),
        ("gyro_z_dps", "gyro_z", "deg/s"),
        ("w_l", "w_l", "rad/s"),
        ("temperature", None, ""),
        ("speed", None, ""),
    ],
)
def test_channels_and_units_are_guessed_by_names(name, channel, unit):
    assert channel_of(name) == channel
    assert channel is None or unit_of(name, channel) == unit


def test_a_draft_of_a_csv_is_a_mapping_that_imports_it(rtds, tmp_path):
    t = np.arange(200) * 20
    rows = np.column_stack(
        [t, 100 * np.sin(t / 500), 100 * np.sin(t / 500), 30 * np.sin(t / 500), 30 * np.sin(t / 500)]
    )
    log = tmp_path / "drive.csv"
    text = "\n".join(",".join(f"{v:.6g}" for v in row) for row in rows)
    log.write_text("time_ms,left_pwm,right_pwm,left_rpm,right_rpm,temp\n" + text.replace("\n", ",20\n") + ",20\n")
    status, out, _ = rtds("init", tmp_path / "mine", *WORDS, "--log", log)
    draft = (tmp_path / "mine" / "mapping.toml").read_text()
    assert status == 0 and "rtds import" in out and draft.count("guess") >= 6 and "# Not used: temp" in draft
    status, out, said = rtds(
        "import", log, "--mapping", tmp_path / "mine" / "mapping.toml", "--robot", tmp_path / "mine" / "robot.toml",
        "--out", tmp_path / "case",
    )  # fmt: skip
    assert status == 0, said
    assert f"mapping.toml: {draft.count('# guess')} lines still say `guess`" in out
    log_read = read_case(tmp_path / "case").runs[0]
    assert np.nanmax(np.abs(log_read.columns["w_l"])) == pytest.approx(30 * 2 * math.pi / 60, rel=0.01)


def test_a_draft_of_a_bag_names_its_topics(rtds, tmp_path):
    status, _, said = rtds("init", tmp_path / "mine", "--log", EXAMPLES / "square.mcap")
    assert status == 0, said
    data = tomllib.loads((tmp_path / "mine" / "mapping.toml").read_text())
    assert data["signal"]["w_l"]["topic"] == "/joint_states" and data["twist"]["topic"] == "/cmd_vel"


def test_a_listing_shows_columns_with_guesses_and_topics_with_fields(rtds):
    status, out, _ = rtds("import", "--list", EXAMPLES / "rover.csv")
    assert status == 0 and "first value" in out and "guess: " in out
    status, out, _ = rtds("import", "--list", EXAMPLES / "square.mcap")
    assert status == 0 and "    velocity  float64[]" in out and "    angular_velocity.z  float64" in out


@pytest.mark.parametrize(
    ("name", "start", "said"),
    [
        ("a.bag", b"#ROSBAG V1.2\n", "is a ROS 1 bag of an old format"),
        ("a.mat", b"MATLAB 5.0", "is a MATLAB file"),
        ("a.log", b"WPILOG\x00\x01", "is a WPILib data log"),
    ],
)
@pytest.mark.parametrize("command", [("import", "--list"), ("import", "--out", "case"), ("init", "mine", "--log")])
def test_recordings_of_other_kinds_are_refused_by_what_they_are(
    rtds, tmp_path, monkeypatch, name, start, said, command
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_bytes(start + bytes(100))
    status, _, lines = rtds(*command, name)
    assert status == 2 and len(lines) == 1 and f"{name}: {said}" in lines[0]


def test_the_doctor_says_what_is_missing_and_how_to_get_it(rtds, monkeypatch):
    from rtds_host.start import doctor

    monkeypatch.setitem(doctor.PACKAGES, "nothing-of-this-name", "nobody")
    status, out, _ = rtds("doctor")
    assert status == 0 and "to get it: pip install nothing-of-this-name" in out
    status, out, _ = rtds("doctor", "--json")
    assert {one["name"] for one in json.loads(out)["findings"]} >= {"python", "numpy", "g++", "nothing-of-this-name"}
    assert any(one.name == "numpy" and one.found for one in findings())


# ---- scenarios of one's own ------------------------------------------------------------------------------------------

SWING = """
import numpy as np
from rtds_host.scenario import Parameter, Scenario, VoltageMotion

def build(values, robot):
    return VoltageMotion(0.5, lambda t: values["peak_v"] * np.sin(6.0 * t)[:, None] * np.ones(2))

SCENARIO = Scenario(name="swing", about="a sine of voltage", build=build,
                    parameters={"peak_v": Parameter(4.0, "its peak", 0.01, 100.0)}, exchange_s=0.01)
"""


def test_a_python_file_is_driven_with_its_parameters_and_nothing_goes_into_the_package(rtds, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(SWING)
    options = ("--link", "model", "--no-compare", "--no-figure")
    status, _, said = rtds("run", "mine.py", "--set", "peak_v=3", *options)
    assert status == 0, said
    commands = np.loadtxt("out/swing/log.csv", delimiter=",", skiprows=1, usecols=(1, 2))
    assert np.abs(commands).max() == pytest.approx(3.0, rel=0.01)
    assert json.loads(Path("out/swing/run.json").read_text())["scenario"] == "swing"


def test_a_csv_of_voltages_is_driven_row_by_row(rtds, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("drive.csv").write_text("t,v_cmd_l,v_cmd_r\n10,2,-2\n10.1,5,1\n10.25,0,0\n10.4,0,0\n")
    assert rtds("run", "drive.csv", "--link", "model", "--no-compare", "--no-figure", "--out", "o")[0] == 0
    t, left, right = np.loadtxt("o/log.csv", delimiter=",", skiprows=1, usecols=(0, 1, 2)).T
    assert np.array_equal(left, np.where(t < 0.0995, 2.0, np.where(t < 0.2495, 5.0, 0.0)))
    assert right[0] == -2.0 and t[-1] == pytest.approx(0.4, abs=0.003)


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("a.py", "x = 1\n", "SCENARIO: missing"),
        ("a.py", "def f(:\n", "row 1: "),
        ("a.py", "1 / 0\n", "ends in ZeroDivisionError: division by zero"),
        ("a.py", SWING.replace("np.ones(2)", "np.ones(3)"), "build: its motion makes an array (11, 3)"),
        ("a.py", SWING.replace('"peak_v"]', '"peek_v"]'), "build: ends in KeyError: 'peek_v'"),
        ("a.py", SWING.replace('name="swing"', 'name="../x"'), "name: is '../x'"),
        ("a.csv", "t,left\n0,1\n1,2\n", "row 1: the columns t, v_cmd_l and v_cmd_r (V)"),
        ("a.csv", "t,v_cmd_l,v_cmd_r\n0,1,1\n1,,1\n", "row 3: a command is missing"),
        ("a.csv", "t,v_cmd_l,v_cmd_r\n0,1,1\n0,1,1\n", "row 3: time goes back or stands still"),
        ("a.csv", "t,v_cmd_l,v_cmd_r\n0,1,1\n9999,1,1\n", "lasts 9999 s"),
    ],
)
def test_a_file_that_is_no_scenario_is_named_with_what_it_lacks(tmp_path, file, text, said):
    from rtds_host.contract import builtin_robot

    (tmp_path / file).write_text(text)
    with pytest.raises(InputError) as refused:
        scenario = own_scenario(str(tmp_path / file))
        scenario.build(scenario.values(), builtin_robot("burger"))
    assert str(refused.value).startswith(f"{tmp_path / file}: {said}")
