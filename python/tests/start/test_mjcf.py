"""`rtds init --mjcf`: a `<dcmotor>` read into robot.toml and effects, there and back, and what is refused."""

import re
import sys
from dataclasses import astuple
from pathlib import Path
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from rtds_host.cli.init import app
from rtds_host.contract import builtin_robot, load_robot
from rtds_host.diagnosis.predict import read_diagnosis
from rtds_host.diagnosis.replay.model import nominal_model
from rtds_host.errors import RtdsError
from rtds_host.export import mjcf
from rtds_host.export.figures import figures_of

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "export"))
from export_cases import ROBOT, SIZES, model_with  # noqa: E402

ARM = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.80665"/><worldbody><body pos="0 0 1">
<joint name="j" type="hinge" axis="0 1 0" damping="0.02" frictionloss="0.1"/>
<inertial pos="0.1 0 0" mass="0.5" diaginertia="1e-4 2e-4 1e-4"/></body></worldbody>
<actuator><dcmotor name="m" joint="j" gear="20" MORE/></actuator></mujoco>"""
FULL = 'nominal="12 0.5 300" inductance="0 0.0004" ctrlrange="-9 9" ctrllimited="true" armature="1e-5"'


def init(*words):
    return CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=True)


def arm(folder, more=FULL, text=ARM):
    place = folder / "arm.xml"
    place.write_text(text.replace("MORE", more))
    return place


def there_and_back(effects, folder):
    """A robot with effects written as MJCF, and the robot with effects that is read from that."""
    model = model_with(*effects)
    (folder / "robot.xml").write_text(mjcf.write(figures_of(model, ROBOT), "", "dcmotor"))
    done = init(folder / "read", "--mjcf", folder / "robot.xml")
    assert done.exit_code == 0, (done.output, done.exception)
    robot = load_robot(folder / "read" / "robot.toml")
    place = folder / "read" / "effects.json"
    return model, robot, read_diagnosis(place, robot) if place.exists() else nominal_model(robot)


@pytest.mark.parametrize("name", ["burger", "waffle"])
def test_a_robot_that_is_written_is_read_as_it_was(name, tmp_path):
    robot = builtin_robot(name)
    (tmp_path / "robot.xml").write_text(mjcf.write(figures_of(nominal_model(robot), robot), "", "dcmotor"))
    done = init(tmp_path / "read", "--mjcf", tmp_path / "robot.xml")
    assert done.exit_code == 0, (done.output, done.exception)
    found = load_robot(tmp_path / "read" / "robot.toml")
    assert not (tmp_path / "read" / "effects.json").exists()
    assert astuple(found.motor) == pytest.approx(astuple(robot.motor), rel=1e-6)
    # A payload's body of a millionth of a kilogram goes along.
    assert astuple(found.chassis) == pytest.approx(astuple(robot.chassis), rel=1e-4, abs=1e-6)
    assert found.supply_v == robot.supply_v


def test_effects_that_an_element_holds_come_back_and_are_written_the_same(tmp_path):
    effects = [
        ("stribeck_friction", "left", {"torque_nm": 0.02, "extra_torque_nm": 0.04, "speed_rad_s": 0.5}),
        ("coulomb_friction", "right", {"torque_nm": 0.03}),
        # The second harmonic is written as an element of its own, which is not read.
        ("torque_ripple", "both", {**SIZES["torque_ripple"], "second_in_phase": 0.0, "second_in_quadrature": 0.0}),
        ("winding_heating", "both", {"rise_per_watt": 0.2, "time_constant_s": 4.0}),
        ("command_delay", "both", {"seconds": 0.0127}),
    ]
    model, robot, found = there_and_back(effects, tmp_path)
    for name in ("coulomb", "stribeck", "stribeck_speed", "ripple", "ripple_cycles", "heat_rise", "heat_tau"):
        for side in (0, 1):
            assert found.get(name, side) == pytest.approx(model.get(name, side), rel=1e-5), (name, side)
    assert found.get("command_delay") == pytest.approx(0.0127)
    texts = [mjcf.write(figures_of(one, nominal), "", "dcmotor") for one, nominal in ((model, ROBOT), (found, robot))]
    motors = [[dict(one.attrib) for one in ElementTree.fromstring(text).findall("actuator/*")] for text in texts]
    for was, now in zip(*motors, strict=True):
        assert was.keys() == now.keys()
        for key in ("motorconst", "resistance", "inductance", "lugre", "cogging", "thermal", "delay"):
            if key in was:
                mine, other = ([float(word) for word in one[key].split()] for one in (was, now))
                assert other == pytest.approx(mine, rel=1e-5), key


def test_one_motor_is_an_axis_with_its_pendulum(tmp_path):
    done = init(tmp_path / "read", "--mjcf", arm(tmp_path))
    assert done.exit_code == 0, (done.output, done.exception)
    robot = load_robot(tmp_path / "read" / "robot.toml")
    constant = 12.0 / 300.0
    assert robot.motor.torque_constant_nm_per_a == pytest.approx(constant)
    assert robot.motor.resistance_ohm == pytest.approx(constant * 12.0 / 0.5)
    assert robot.motor.inductance_h == pytest.approx(0.0004 * constant * 12.0 / 0.5)
    assert robot.motor.rotor_inertia_kg_m2 == pytest.approx(1e-5) and robot.supply_v == 9.0
    assert robot.motor.viscous_friction_nm_s_per_rad == pytest.approx(0.02 / 20**2)
    axis = robot.axis
    assert (axis.kind, axis.mass_kg, axis.length_m) == ("pendulum", 0.5, pytest.approx(0.1))
    # Turning about +y takes +x down: it hangs at a quarter of a turn.
    assert axis.inertia_kg_m2 == pytest.approx(2e-4) and axis.zero_rad == pytest.approx(1.5707963, rel=1e-6)
    assert read_diagnosis(tmp_path / "read" / "effects.json", robot).get("coulomb") == pytest.approx(0.1)


def test_what_no_file_of_ours_holds_is_said(tmp_path):
    more = f'{FULL} saturation="0.3 0 50"'
    done = init(tmp_path / "read", "--mjcf", arm(tmp_path, more))
    assert done.exit_code == 0, (done.output, done.exception)
    for line in ("not read: m: saturation of 0.3 N·m", "not read: m: limit of the current's rate, 50 A/s"):
        assert line in done.output
    assert "# Not in here: m: saturation" in (tmp_path / "read" / "robot.toml").read_text()


@pytest.mark.parametrize(
    ("text", "words", "complaint"),
    [
        ("<mujoco", [], "arm.xml: MuJoCo does not take it: XML"),
        ("<mujoco/>", [], "arm.xml: holds no <dcmotor> that drives a joint"),
        (ARM.replace("MORE", 'motorconst="1 1" resistance="-1"'), [], "arm.xml: MuJoCo does not take it"),
        (ARM.replace("MORE", 'motorconst="1 1" resistance="1"'), [], "<dcmotor> m: has no ctrlrange; give the supply"),
        (ARM.replace('"hinge"', '"slide"').replace("MORE", FULL), [], "<dcmotor> m: drives no hinge"),
        (ARM.replace("MORE", FULL), ["--motor", "n"], "--motor n: "),
        (ARM.replace("MORE", FULL), ["--like", "burger"], "goes without --like"),
        (ARM.replace("MORE", FULL), ["--gear-ratio", "3"], "goes without --gear-ratio"),
        (ARM.replace('frictionloss="0.1"', "").replace("MORE", 'motorconst="1e7 1e7" resistance="1"'),
         ["--voltage", "5"], "arm.xml: gives no robot: robot.toml: [motor] torque_constant_nm_per_a"),
    ],
)  # fmt: skip
def test_a_bad_model_is_one_line_and_nothing_is_written(text, words, complaint, tmp_path):
    done = init(tmp_path / "read", "--mjcf", arm(tmp_path, "", text), *words)
    assert isinstance(done.exception, RtdsError), (done.output, done.exception)
    assert complaint in str(done.exception) and "\n" not in str(done.exception)
    assert not (tmp_path / "read").exists()


def test_a_missing_file_and_a_motor_without_a_model_are_refused(tmp_path):
    done = init(tmp_path / "read", "--mjcf", tmp_path / "none.xml")
    assert isinstance(done.exception, RtdsError) and re.search("none.xml: no such file", str(done.exception))
    done = init(tmp_path / "read", "--motor", "m")
    assert isinstance(done.exception, RtdsError) and "--motor m: only with --mjcf" in str(done.exception)


@pytest.mark.parametrize("more", [FULL.replace('300"', '300" resistance="nan"'), FULL.replace("1e-5", "nan")])
def test_a_nan_is_one_line_and_mujoco_leaves_no_log(more, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    done = init("read", "--mjcf", arm(tmp_path, more))
    assert isinstance(done.exception, RtdsError) and "arm.xml" in str(done.exception) and "NaN" in str(done.exception)
    assert sorted(place.name for place in tmp_path.iterdir()) == ["arm.xml"]
    assert "WARNING" not in capfd.readouterr().err


def test_a_folder_is_no_model(tmp_path):
    done = init(tmp_path / "read", "--mjcf", tmp_path)
    assert isinstance(done.exception, RtdsError) and "is a folder" in str(done.exception)


def test_noise_of_the_sensors_in_a_model_comes_back(tmp_path):
    _, robot, _ = there_and_back([], tmp_path)
    for name in ("th_rad", "w_rad_s", "gyro_rad_s"):
        assert robot.sensors[name] == pytest.approx(ROBOT.sensors[name], rel=1e-6), name
    text = (tmp_path / "read" / "robot.toml").read_text()
    assert text.count("noise of the file's sensor") == 3
    assert init(tmp_path / "axis", "--mjcf", arm(tmp_path)).exit_code == 0
    assert "noise of the file's sensor" not in (tmp_path / "axis" / "robot.toml").read_text()
