"""`rtds export --to mjcf --actuator dcmotor`: agreement with the replay, the module along with it, bad options."""

import runpy
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from export_cases import LABELLED, ROBOT, SERVO, SIZES, apart, model_of_one, model_with, speed_run, write_labelled
from typer.testing import CliRunner

from rtds_host.cli.export import app
from rtds_host.correction.close import FINE_STEP_S
from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.errors import RtdsError
from rtds_host.export import mjcf
from rtds_host.export.check import apart as differences
from rtds_host.export.check import verdict
from rtds_host.export.figures import figures_of
from rtds_host.export.mujoco_replay import ExportedRobot, driver_class
from rtds_host.export.table import DCMOTOR, markdown_of_dcmotor
from rtds_host.plant.schema import OUTPUTS
from rtds_host.studies.agreement import designed_run, values_of

LOG = designed_run(3.3)
# Units of noise: the bound of the other actuator's test, which steps twice as long.
BOUND = 0.6
PAGE = Path(__file__).resolve().parents[3] / "docs" / "mujoco-dcmotor.md"
SPEED_MODE = [name for name in DCMOTOR if name == "command_gain"]
MANY = [
    ("driver_gain", "left", {"ratio": -0.9}),
    ("torque_constant_error", "right", {"ratio": 1.1}),
    ("stribeck_friction", "both", values_of("stribeck_friction")),
    ("torque_ripple", "both", SIZES["torque_ripple"]),
    ("winding_heating", "both", values_of("winding_heating")),
    ("load_friction", "right", {"ratio": 0.2}),
    ("bridge_drop", "both", {"volts": 0.3, "knee_a": 0.02}),
    ("measurement_delay", "both", {"seconds": 0.008}),
]


def written(model, folder, robot=ROBOT):
    file = folder / "robot.xml"
    file.write_text(mjcf.write(figures_of(model, robot), "", "dcmotor"))
    return file


def within_a_hundredth(model, out, log=LOG, robot=ROBOT):
    truth = replay_run(model, run_inputs(log, robot), FINE_STEP_S)
    found = differences("run", log.t, out, truth)
    assert [one.channel for one in found] == ["i_l", "i_r", "w_l", "w_r", "path"]
    return max(one.largest for one in found) <= 0.01


@pytest.mark.parametrize(
    "effect", ["nominal", "spin_scrub", "voltage_limit", "command_delay", *sorted(set(DCMOTOR) - set(SPEED_MODE))]
)
def test_currents_speeds_and_path_are_the_replays_within_a_hundredth(effect, tmp_path):
    model = nominal_model(ROBOT) if effect == "nominal" else model_of_one(effect)
    out = ExportedRobot(written(model, tmp_path)).replay(LOG, run_inputs(LOG, ROBOT)[-1])
    assert within_a_hundredth(model, out)
    far, size = apart(LOG, model, out)
    # What no bound shows: that the effect is there at all.
    assert far <= BOUND and (effect == "nominal" or far < 0.7 * size)


def test_friction_by_direction_and_speed_is_that_of_the_replay(tmp_path):
    model = model_with(
        ("friction_asymmetry", "both", {"torque_nm": 0.02, "nm_s_per_rad": 0.01}),
        ("coulomb_friction", "both", {"torque_nm": 0.03}),
    )
    out = ExportedRobot(written(model, tmp_path)).replay(LOG, run_inputs(LOG, ROBOT)[-1])
    far, size = apart(LOG, model, out)
    assert within_a_hundredth(model, out) and far <= BOUND < size


def test_many_effects_at_once_and_a_reversed_driver_are_those_of_the_replay(tmp_path):
    model = model_with(*MANY)
    out = ExportedRobot(written(model, tmp_path)).replay(LOG, run_inputs(LOG, ROBOT)[-1])
    far, size = apart(LOG, model, out)
    assert within_a_hundredth(model, out) and far <= 1.0 < 5.0 < size


@pytest.mark.parametrize("effects", [(), (("command_gain", "both", {"ratio": 1.1}),)])
def test_a_robot_with_a_servo_follows_wheel_speeds_as_the_replay_does(effects, tmp_path):
    model, log = model_with(*effects, robot=SERVO), speed_run()
    out = ExportedRobot(written(model, tmp_path, SERVO)).replay(log, run_inputs(log, SERVO)[-1])
    assert within_a_hundredth(model, out, log, SERVO)


def test_a_wheel_breaks_away_as_in_the_replay_and_a_second_run_of_a_model_is_the_first(tmp_path):
    values = {"torque_nm": 0.03, "extra_torque_nm": 0.12, "speed_rad_s": 0.5}
    model = model_with(("stribeck_friction", "both", values), ("load_friction", "both", {"ratio": 0.1}))
    exported = ExportedRobot(written(model, tmp_path))
    start = run_inputs(LOG, ROBOT)[-1]
    first = exported.replay(LOG, start)
    assert within_a_hundredth(model, first)
    # The model of a driver is changed by its steps, not by its making.
    once, again = (driver_class()(exported.model).dry for _ in range(2))
    assert once == again == pytest.approx([0.03, 0.03])


def test_without_its_module_a_file_has_lugre_friction_that_yields_and_comes_to_rest_before_it_breaks_away(tmp_path):
    values = values_of("stribeck_friction")
    model = mujoco.MjModel.from_xml_path(str(written(model_with(("stribeck_friction", "both", values)), tmp_path)))
    data, motor = mujoco.MjData(model), ROBOT.motor
    level = values["torque_nm"] + values["extra_torque_nm"]
    per_volt = motor.gear_ratio * motor.torque_constant_nm_per_a / motor.resistance_ohm
    turned = []
    for share in (0.3, 0.3, 1.5):
        data.ctrl[:2] = share * level / per_volt
        mujoco.mj_step(model, data, 2000)
        turned.append(float(data.joint("wheel_left").qpos[0]))
    # A bristle that rattled would creep by some 1e-4 rad in half a second.
    assert 2e-5 < turned[0] < 2e-4 and turned[1] == pytest.approx(turned[0], abs=1e-5) and turned[2] > 0.02


def test_the_elements_are_a_data_sheets_where_nothing_is_diagnosed():
    root = ElementTree.fromstring(mjcf.write(figures_of(nominal_model(ROBOT), ROBOT), "", "dcmotor"))
    found, motor = root.findall("actuator/*"), ROBOT.motor
    assert [one.tag for one in found] == ["dcmotor", "dcmotor"]
    numbers = {key: [float(word) for word in found[0].get(key).split()] for key in ("motorconst", "inductance")}
    assert numbers["motorconst"] == pytest.approx([motor.torque_constant_nm_per_a] * 2)
    assert numbers["inductance"] == pytest.approx([motor.inductance_h, 0.0])
    assert float(found[0].get("resistance")) == pytest.approx(motor.resistance_ohm)
    assert float(found[0].get("gear")) == pytest.approx(motor.gear_ratio)


def test_the_written_module_drives_the_written_file_without_this_package(tmp_path):
    case = write_labelled("friction", tmp_path / "case")
    done = CliRunner().invoke(
        app,
        [str(case / "diagnosis.json"), "--to", "mjcf", "--actuator", "dcmotor", "--out", str(tmp_path / "robot.xml")],
    )
    assert done.exit_code == 0, done.output
    source = (tmp_path / "robot_driver.py").read_text()
    assert "rtds_host" not in source
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    data = mujoco.MjData(model)
    driver = runpy.run_path(str(tmp_path / "robot_driver.py"))["Driver"](model)
    for _ in range(4000):
        driver.step(data, 6.0, 6.0)
    found, motor = driver.readings(data), ROBOT.motor
    # At a settled speed R i = v - N Kb w, and the left wheel's dry friction takes its share of the torque.
    constant = motor.gear_ratio * motor.back_emf_constant_v_s_per_rad
    for side in "lr":
        volts = motor.resistance_ohm * found[f"i_{side}"] + constant * found[f"w_{side}"]
        assert volts == pytest.approx(6.0, rel=1e-3)
    torque = motor.gear_ratio * motor.torque_constant_nm_per_a
    viscous = motor.gear_ratio**2 * motor.viscous_friction_nm_s_per_rad
    loss = sum(torque * found[f"i_{side}"] - viscous * found[f"w_{side}"] for side in "lr")
    assert loss == pytest.approx(LABELLED["friction"][0][2]["torque_nm"], rel=0.05)


def test_the_command_lists_writes_and_compares(tmp_path):
    case = write_labelled("driver", tmp_path / "case")
    done = CliRunner().invoke(
        app,
        [str(case / "diagnosis.json"), "--to", "mjcf", "--actuator", "dcmotor"]
        + ["--out", str(tmp_path / "robot.xml"), "--check", str(case / "run")],
    )
    assert done.exit_code == 0, done.output
    assert "number    driver_deadzone (left) volts = 0.5" in done.output and "driver module" in done.output
    rows = [line.split() for line in done.output.splitlines() if line.startswith("run  ")]
    assert [row[1] for row in rows] == ["i_l", "i_r", "w_l", "w_r", "path"]
    assert all(float(row[2].rstrip("%")) < 1.0 for row in rows)
    assert "all within 1% of full scale; the largest is " in done.output
    head = (tmp_path / "robot.xml").read_text().partition("-->")[0]
    assert "<dcmotor>" in head and "driver_deadzone (left)" in head


def test_what_is_not_within_a_hundredth_is_said_with_place_time_and_rows():
    t = np.arange(5) * 0.008
    truth = np.zeros((5, len(OUTPUTS)))
    truth[:, OUTPUTS.index("i_l")] = [0.0, 1.0, 2.0, 2.0, 2.0]
    out = truth.copy()
    out[2:4, OUTPUTS.index("i_l")] += [0.03, 0.05]
    found = differences("linear", t, out, truth)
    assert [one.channel for one in found] == ["i_l"]
    assert verdict(found) == (
        "not all within 1% of full scale: 2 of 5 rows; the largest is i_l of linear, 2.50% at 0.024 s"
    )


def test_drawn_robots_share_one_module(tmp_path):
    case = write_labelled("friction", tmp_path / "case")
    done = CliRunner().invoke(
        app,
        [str(case / "diagnosis.json"), "--to", "mjcf", "--actuator", "dcmotor", "--samples", "2"]
        + ["--out", str(tmp_path / "many")],
    )
    assert done.exit_code == 0, done.output
    names = sorted(place.name for place in (tmp_path / "many").iterdir())
    assert names == ["driver.py", "sample-0.xml", "sample-1.xml", "samples.json"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--to", "mjcf", "--actuator", "dcmoter"], "--actuator dcmoter: unknown"),
        (["--to", "urdf", "--actuator", "dcmotor"], "--actuator dcmotor: only with --to mjcf"),
        (["--to", "c", "--actuator", "dcmotor"], "--to c: goes without --actuator"),
    ],
)
def test_a_wrong_actuator_is_refused_and_nothing_written(words, complaint, tmp_path):
    case = write_labelled("friction", tmp_path / "case")
    done = CliRunner().invoke(app, [str(case / "diagnosis.json"), *words, "--out", str(tmp_path / "robot.xml")])
    assert isinstance(done.exception, RtdsError) and complaint in str(done.exception)
    assert not list(tmp_path.glob("robot*"))


def test_the_page_shows_what_differs_and_each_row_is_an_effect():
    assert DCMOTOR.keys() <= CATALOGUE.keys()
    assert markdown_of_dcmotor() in PAGE.read_text()
