"""Robots that are driven by wheel speeds: what each target has of the servo's loop, and that it does what the replay
does.
"""

import json
import runpy
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from export_cases import ROBOT, SERVO, apart, diagnosis_of, measured_run, model_with, speed_run
from typer.testing import CliRunner

from rtds_host.cli.export import app
from rtds_host.contract import Driver, RunLog, builtin_robot_path, write_run
from rtds_host.diagnosis.replay.model import replay_run, run_inputs
from rtds_host.errors import InputError
from rtds_host.export import mjcf, python, sdf, urdf, usd
from rtds_host.export.check import check
from rtds_host.export.export import Source, export
from rtds_host.export.figures import figures_of
from rtds_host.export.mujoco_replay import ExportedRobot
from rtds_host.export.table import AS_NUMBER, LEFT_OUT, OWN
from rtds_host.plant.schema import OUTPUTS

LOG = speed_run()
EFFECTS = {
    "nominal": [],
    "coulomb_friction": [("coulomb_friction", "left", {"torque_nm": 0.12})],
    "driver_deadzone": [("driver_deadzone", "both", {"volts": 0.8})],
    "driver_gain": [("driver_gain", "left", {"ratio": 0.6})],
    "speed_gain": [("speed_gain", "left", {"ratio": 0.94})],
    "command_gain": [("command_gain", "left", {"ratio": 0.94})],
    "command_delay": [("command_delay", "both", {"seconds": 0.037})],
    "measurement_delay": [("measurement_delay", "both", {"seconds": 0.023})],
    "wheel_radius_error": [("wheel_radius_error", "both", {"ratio": 1.05})],
}
# Units of noise, as for robots driven by volts, and what a loop that acts at MuJoCo's or the module's own steps adds.
BOUND = 0.8


def mujoco_robot(folder, *effects, robot=SERVO):
    file = folder / "robot.xml"
    file.write_text(mjcf.write(figures_of(model_with(*effects, robot=robot), robot), ""))
    return ExportedRobot(file)


@pytest.mark.parametrize("name", EFFECTS)
def test_the_mujoco_robot_follows_speeds_as_the_replay_does(name, tmp_path):
    out = mujoco_robot(tmp_path, *EFFECTS[name]).replay(LOG, run_inputs(LOG, SERVO)[-1])
    far, size = apart(LOG, model_with(*EFFECTS[name], robot=SERVO), out, SERVO)
    assert far <= BOUND
    assert name == "nominal" or far < 0.5 * size


@pytest.mark.parametrize("name", EFFECTS)
def test_the_python_robot_follows_speeds_as_the_replay_does(name, tmp_path):
    model = model_with(*EFFECTS[name], robot=SERVO)
    file = tmp_path / "robot.py"
    file.write_text(python.write(figures_of(model, SERVO), "a robot"))
    log = speed_run(1.65)
    start = run_inputs(log, SERVO)[-1]
    robot = runpy.run_path(str(file))["Robot"](
        pose=tuple(start[:5]),
        payload_kg=log.meta.payload_kg,
        slope_rad=log.meta.slope_rad,
        uphill_yaw_rad=log.meta.uphill_yaw_rad,
    )
    rows = []
    for k, speeds in enumerate(log.commands("speed")):
        rows.append([robot.sensors()[channel] for channel in OUTPUTS])
        if k + 1 < len(log.t):
            robot.step(*speeds, log.t[k + 1] - log.t[k])
    far, size = apart(log, model, np.array(rows), SERVO)
    assert far <= BOUND
    assert name == "nominal" or far < 0.5 * size


def test_a_loop_at_its_limit_stays_there_and_comes_back_as_in_the_replay(tmp_path):
    robot = replace(SERVO, servo=replace(SERVO.servo, limit_v=3.0))
    out = mujoco_robot(tmp_path, robot=robot).replay(LOG, run_inputs(LOG, robot)[-1])
    assert apart(LOG, model_with(robot=robot), out, robot)[0] <= BOUND
    free = replay_run(model_with(robot=SERVO), run_inputs(LOG, SERVO))
    assert np.abs(out[:, 3:5] - free[:, 3:5]).max() > 1.0, "the limit is met"


@pytest.mark.parametrize("robot", [ROBOT, SERVO], ids=["volts", "speeds"])
def test_a_measured_bus_is_the_supply_of_the_check(robot, tmp_path):
    robot = replace(robot, driver=replace(robot.driver, bus="measured"))
    log = measured_run([]) if robot.servo is None else LOG
    bus = np.linspace(12.0, 8.0, len(log.t))
    model = model_with(("coulomb_friction", "both", {"torque_nm": 0.1}), robot=robot)
    log = RunLog(log.name, log.meta, log.t, {**log.columns, "v_bus": bus})
    true = replay_run(model, run_inputs(log, robot))
    columns = {**log.columns, **{name: true[:, k] for k, name in enumerate(OUTPUTS) if name != "v_bus"}}
    file = tmp_path / "robot.xml"
    file.write_text(mjcf.write(figures_of(model, robot), ""))
    checked = check(file, robot, model, [RunLog(log.name, log.meta, log.t, columns)])
    assert checked.mujoco.before > 2.0 and checked.mujoco.after < 1.0


def test_gazebo_has_the_loop_as_torques_and_a_scaled_encoder_in_it():
    figures = figures_of(model_with(("speed_gain", "left", {"ratio": 0.8}), robot=SERVO), SERVO)
    motor = ROBOT.motor
    volt = motor.gear_ratio * motor.torque_constant_nm_per_a / motor.resistance_ohm
    root = ElementTree.fromstring(sdf.write(figures, ""))
    left, right = (plugin for plugin in root.iter("plugin"))
    assert left.get("name") == right.get("name") == "gz::sim::systems::JointController"
    assert left.find("joint_name").text == "wheel_left" and left.find("use_force_commands").text == "true"

    def values(plugin):
        return [float(plugin.find(key).text) for key in ("p_gain", "i_gain", "i_max", "i_min", "cmd_max", "cmd_min")]

    top = 12.0 * volt
    assert values(right) == pytest.approx([0.44 * volt, 8.6 * volt, top, -top, top, -top])
    assert values(left) == pytest.approx([0.8 * 0.44 * volt, 0.8 * 8.6 * volt, top, -top, top, -top])
    text = urdf.write(figures, "")
    assert f"left: p = {0.8 * 0.44 * volt:.9g} N·m·s/rad" in text and "scale 1.25" in text
    content = json.loads(usd.write(figures, ""))
    assert content["rtds"]["actuators"]["servo"] == {
        "kp_v_s_per_rad": 0.44,
        "ki_v_per_rad": 8.6,
        "limit_v": 12.0,
        "period_s": 0.001,
    }


def test_gazebos_loop_drives_a_wheel_as_the_replay_does():
    """The plugin's controller as gz-math has it, on the joint that the file describes: a wheel in the air."""
    friction = ("coulomb_friction", "both", {"torque_nm": 0.05})
    heavy = replace(SERVO, chassis=replace(SERVO.chassis, wheel_radius_m=1e-6))
    model = model_with(friction, robot=heavy)
    root = ElementTree.fromstring(sdf.write(figures_of(model, heavy), ""))
    plugin, joint = next(root.iter("plugin")), next(root.iter("joint"))
    p, i, most, effort = (float(plugin.find(key).text) for key in ("p_gain", "i_gain", "i_max", "cmd_max"))
    damping, dry = (float(joint.find(f"axis/dynamics/{key}").text) for key in ("damping", "friction"))
    # Gazebo's joints have no armature: the rotor's inertia is put next to the wheel's here, which the replay has too.
    inertia = heavy.chassis.wheel_inertia_kg_m2 + heavy.motor.gear_ratio**2 * heavy.motor.rotor_inertia_kg_m2
    t = np.arange(0, 1.0, 0.001)
    asked = np.where(t < 0.5, 4.0, -2.0)
    log = RunLog("air", LOG.meta, t, {"w_cmd_l": asked, "w_cmd_r": asked})
    log = RunLog(log.name, replace(log.meta, slope_rad=0.0, payload_kg=0.0), t, log.columns)
    true = replay_run(model, run_inputs(log, heavy))[:, 3]
    w, integral, mine = 0.0, 0.0, []
    for target in asked:
        mine.append(w)
        error = w - target
        integral = min(max(integral + i * 0.001 * error, -most), most)
        force = min(max(-p * error - integral, -effort), effort)
        for _ in range(20):
            slips = (inertia * w + 5e-5 * force) / (inertia + 5e-5 * damping)
            held = 5e-5 * dry / (inertia + 5e-5 * damping)
            w = slips - min(max(slips, -held), held)
    assert np.abs(np.array(mine) - true).max() < 0.05 and np.abs(true).max() > 3.0


def test_the_lists_say_how_the_loop_and_what_lies_before_it_are_there():
    def source(*effects):
        return Source(diagnosis_of(effects), model_with(*effects, robot=SERVO), SERVO, "diagnosis.json")

    effects = [("command_delay", "both", {"seconds": 0.02}), ("speed_gain", "left", {"ratio": 0.9})]
    kinds = {}
    for target in ("mjcf", "urdf", "sdf", "usd-json", "python"):
        text, parts = export(source(*effects), target)
        kinds[target] = tuple(part.kind for part in parts)
        assert "Driven by wheel speeds, rad/s, through the servo's loop" in text
        assert "r = 0.033 m, b = 0.16 m" in text
    assert kinds == {
        "mjcf": (AS_NUMBER, AS_NUMBER),
        "urdf": (LEFT_OUT, AS_NUMBER),
        "sdf": (LEFT_OUT, AS_NUMBER),
        "usd-json": (AS_NUMBER, AS_NUMBER),
        "python": (OWN, OWN),
    }


def test_torque_driven_robots_are_refused_with_the_reason():
    robot = replace(ROBOT, driver=Driver(mode="torque", torque_nm_per_v=0.1))
    with pytest.raises(
        InputError, match=r"mode is 'torque', the motors of an exported robot take volts or wheel speeds"
    ):
        figures_of(model_with(robot=robot), robot)


def test_the_command_exports_and_checks_a_case_in_speed_mode(tmp_path):
    effects = [("coulomb_friction", "left", {"torque_nm": 0.12})]
    model = model_with(*effects, robot=SERVO)
    rng = np.random.default_rng(1)
    true = replay_run(model, run_inputs(LOG, SERVO))
    columns = {name: values for name, values in LOG.columns.items() if name.startswith("w_cmd")}
    columns |= {
        name: true[:, k] + ROBOT.noise(name) * rng.standard_normal(len(LOG.t))
        for k, name in enumerate(OUTPUTS)
        if name in ("w_l", "w_r", "gyro_z")
    }
    (tmp_path / "robot.toml").write_text(
        builtin_robot_path("burger").read_text()
        + """
[driver]
mode = "speed"
[servo]
kp_v_s_per_rad = 0.44
ki_v_per_rad = 8.6
limit_v = 12.0
period_s = 0.001
"""
    )
    (tmp_path / "diagnosis.json").write_text(json.dumps(diagnosis_of(effects)))
    write_run(tmp_path / "run", LOG.meta, {"t": LOG.t, **columns})
    done = CliRunner().invoke(
        app,
        [
            str(tmp_path / "diagnosis.json"),
            "--to",
            "mjcf",
            "--out",
            str(tmp_path / "robot.xml"),
            "--check",
            str(tmp_path / "run"),
        ],
    )
    assert done.exit_code == 0, done.output
    assert (
        "driven by wheel speeds, rad/s, through the servo's loop, which is in the file for whoever drives it:"
        " custom" in done.output
    )
    assert float(done.output.rpartition("MuJoCo closes ")[2].split()[0]) >= 0.9
