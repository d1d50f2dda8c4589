"""Whatever the search can end with is taken back by a prediction, on every run of the robot."""

import json
from dataclasses import replace

import numpy as np
import pytest

from rtds_host.contract import Axis, Driver, RunLog, RunMeta, Servo, builtin_robot
from rtds_host.diagnosis.diagnose import SCHEMA
from rtds_host.diagnosis.effects import catalogue
from rtds_host.diagnosis.predict import carrying, check_body, predicted_columns, read_diagnosis
from rtds_host.diagnosis.replay.model import nominal_model

BURGER = builtin_robot("burger")
ROBOTS = {
    "voltage": BURGER,
    "speed": replace(
        BURGER,
        driver=Driver(mode="speed"),
        servo=Servo(kp_v_s_per_rad=0.44, ki_v_per_rad=8.6, limit_v=12.0, period_s=0.01),
    ),
    "torque": replace(
        BURGER,
        chassis=None,
        axis=Axis(kind="pendulum", mass_kg=0.5, length_m=0.3),
        driver=Driver(mode="torque", torque_nm_per_v=0.01),
    ),
    "linear": replace(BURGER, chassis=None, axis=Axis(kind="linear", mass_kg=0.5, metres_per_rad=-0.01)),
}


def run_of(robot, name="run", payload=0.0, seconds=0.5, most=3.0):
    t = np.arange(0.0, seconds, 0.01)
    command = most * np.sin(6.0 * t)
    kind = "w_cmd" if robot.driver.mode == "speed" else "v_cmd"
    columns = {f"{kind}_{s}": command for s in robot.sides} | {f"w_{s}": 0.5 * command for s in robot.sides}
    return RunLog(name, RunMeta(payload_kg=payload), t, columns)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("payloads", [(0.0,), (2.0,), (0.0, 3.0)])
def test_an_effect_at_either_end_of_its_search_is_read_again(tmp_path, name, payloads):
    robot = ROBOTS[name]
    runs = tuple(run_of(robot, f"run{k}", payload) for k, payload in enumerate(payloads))
    searched = catalogue(robot, runs)
    for effect in searched.values():
        side = effect.sides[0]
        for end in ("low", "high"):
            parameters = {}
            for p in effect.parameters:
                reported, _, unit = p.reported(robot.axis)
                parameters[reported] = {"value": float(f"{unit * getattr(p, end):.5g}"), "ci90": None}
            entry = {"id": effect.id, "side": effect.side_on(robot.axis, side), "parameters": parameters}
            path = tmp_path / "diagnosis.json"
            path.write_text(json.dumps({"schema": SCHEMA, "effects": [entry]}))
            read_diagnosis(path, robot)


@pytest.mark.parametrize("payload", [0.0, 0.5, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("y_m", [0.0, 0.02, -0.045])
def test_a_centre_of_mass_is_predicted_with_every_payload(y_m, payload):
    model = nominal_model(BURGER)
    model.add("com_x", 0.02)
    model.add("com_y", y_m)
    log = run_of(BURGER, payload=payload)
    columns = predicted_columns(log, BURGER, model)
    assert all(np.isfinite(values).all() for values in columns.values())
    check_body(carrying(model, log), log)
    # What was already possible is left as it is.
    possible = model.get("yaw_inertia") > (model.get("mass") + payload) * y_m**2
    assert (carrying(model, log) is model) == possible


def test_a_run_that_begins_with_garbage_is_predicted_from_its_first_angle():
    robot = ROBOTS["linear"]
    log = run_of(robot, seconds=1.0)
    angle = 2.0 + 0.1 * np.sin(log.t)
    sound = replace(log, columns={**log.columns, "th_l": angle})
    garbage = replace(log, columns={**log.columns, "th_l": np.where(log.t < 0.025, -8.2e6, angle)})
    one, other = (predicted_columns(run, robot)["th_l"] for run in (sound, garbage))
    assert np.max(np.abs(one - other)) < 0.01
