"""Where the encoder sits (contract, section 2), and the gain before a speed loop."""

import re
from dataclasses import replace

import numpy as np
import pytest

from rtds_host.contract import Driver, RunLog, RunMeta, Servo, builtin_robot, builtin_robot_path
from rtds_host.contract.robot import load_robot
from rtds_host.diagnosis.effects import SIDES, catalogue
from rtds_host.diagnosis.replay.model import ReplayBatch, nominal_model, replay_run, run_inputs
from rtds_host.errors import InputError
from rtds_host.plant.schema import OUTPUT_INDEX

ROBOT = builtin_robot("burger")
SERVO = replace(ROBOT, driver=Driver(mode="speed"), servo=Servo(0.44, 8.6, 12.0, 0.001))
GIVING = {
    "gear_compliance": {"stiffness_nm_per_rad": 0.5, "damping_nm_s_per_rad": 0.003},
    "backlash": {"angle_rad": 0.1},
}


def run(mode="voltage"):
    t = np.arange(0.0, 2.0, 0.01)
    asked = np.where(t < 1.0, 6.0, -4.0)
    prefix = {"voltage": "v_cmd", "speed": "w_cmd"}[mode]
    return RunLog("steps", RunMeta("steps", 0.0, 0.0, 0.0), t, {f"{prefix}_l": asked, f"{prefix}_r": 0.5 * asked})


def model_with(robot=ROBOT, **effects):
    model = nominal_model(robot)
    for name, values in effects.items():
        effect = catalogue(robot)[name]
        effect.apply(model, SIDES["both"], {p.name: values.get(p.name, p.starts[0]) for p in effect.parameters})
    return model


def robot_of(tmp_path, line):
    text = builtin_robot_path("burger").read_text(encoding="utf-8")
    path = tmp_path / "robot.toml"
    path.write_text(re.sub(r"^\[sensors\].*$", f"[sensors]\n{line}", text, flags=re.MULTILINE), encoding="utf-8")
    return load_robot(path)


def test_the_file_says_where_the_encoder_is_or_does_not(tmp_path):
    assert ROBOT.encoder is None
    for place in ("motor", "gear", "wheel"):
        robot = robot_of(tmp_path, f'encoder = "{place}"')
        assert robot.encoder == place and not robot.notices
        assert nominal_model(robot).get("encoder_at_wheel") == (place == "wheel")


@pytest.mark.parametrize("value", ['"shaft"', "1", "[]"])
def test_another_place_is_refused(tmp_path, value):
    with pytest.raises(InputError, match=r"robot.toml: \[sensors\] encoder: is .* motor, gear, wheel"):
        robot_of(tmp_path, f"encoder = {value}")


def test_while_nothing_gives_the_places_are_one():
    near, far = (model_with(coulomb_friction={"torque_nm": 0.02}, speed_filter={"time_constant_s": 0.02}) for _ in "12")
    far.put("encoder_at_wheel", 1.0)
    inputs = run_inputs(run(), ROBOT)
    assert np.array_equal(replay_run(near, inputs), replay_run(far, inputs))


@pytest.mark.parametrize("name", GIVING)
def test_behind_what_gives_speed_and_angle_are_the_wheels_and_nothing_else_changes(name):
    near = model_with(**{name: GIVING[name]})
    far = near.copy()
    far.put("encoder_at_wheel", 1.0)
    inputs = run_inputs(run(), ROBOT)
    a, b = replay_run(near, inputs), replay_run(far, inputs)
    encoders = [OUTPUT_INDEX[c] for c in ("w_l", "w_r", "th_l", "th_r")]
    others = [k for k in OUTPUT_INDEX.values() if k not in encoders]
    assert np.array_equal(a[:, others], b[:, others]) and (np.abs(a - b)[:, encoders].max(axis=0) > 1e-4).all()
    # Wheels that roll: the yaw rate is that of the wheels' own speeds.
    speeds = b[:, OUTPUT_INDEX["w_r"]] - b[:, OUTPUT_INDEX["w_l"]]
    chassis = ROBOT.chassis
    rate = speeds * chassis.wheel_radius_m / chassis.track_width_m
    assert np.abs(rate - b[:, OUTPUT_INDEX["gyro_z"]]).max() < 1e-9


@pytest.mark.parametrize("name", GIVING)
def test_the_vectorised_replay_has_the_encoder_where_the_scalar_one_has_it(name):
    models = []
    for place in (0.0, 1.0):
        models.append(model_with(speed_filter={"time_constant_s": 0.02}, **{name: GIVING[name]}))
        models[-1].put("encoder_at_wheel", place)
    inputs = run_inputs(run(), ROBOT)
    for model, out in zip(models, ReplayBatch([inputs]).replay(models), strict=True):
        assert np.abs(out - replay_run(model, inputs)).max() < 1e-6


def test_a_command_gain_is_a_gain_on_the_speeds_asked_for():
    log = run("speed")
    scaled = replace(log, columns={name: 0.9 * column for name, column in log.columns.items()})
    gained = replay_run(model_with(SERVO, command_gain={"ratio": 0.9}), run_inputs(log, SERVO))
    assert np.allclose(gained, replay_run(nominal_model(SERVO), run_inputs(scaled, SERVO)), rtol=0, atol=1e-9)


def test_a_robot_without_a_speed_loop_has_no_command_gain():
    assert "command_gain" in catalogue(SERVO) and "command_gain" not in catalogue(ROBOT)
