"""Robots and runs for the tests of the export: effects in the replay's model, and small labelled runs of the
independent planar world.
"""

import json
from dataclasses import replace

import numpy as np

from rtds_host.blind import planar
from rtds_host.contract import Case, Driver, RunLog, RunMeta, Servo, builtin_robot, builtin_robot_path, write_run
from rtds_host.correction.close import FINE_STEP_S, distance
from rtds_host.diagnosis.effects import CATALOGUE, SIDES
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.plant.schema import OUTPUTS
from rtds_host.studies.agreement import designed_run, values_of

ROBOT = builtin_robot("burger")
# The same behind a servo, with a loop as a TurtleBot3's.
SERVO = replace(ROBOT, driver=Driver(mode="speed"), servo=Servo(0.44, 8.6, 12.0, 0.001))
# Where the size at which effects are compared elsewhere cannot be had by a target.
SIZES = {
    "torque_ripple": {
        "amplitude_nm": 0.03,
        "cycles_per_rev": 4.0,
        "phase_rad": 0.7,
        "second_in_phase": 0.2,
        "second_in_quadrature": -0.1,
    },
    "com_offset": {"x_m": 0.0, "y_m": 0.03},
}
# Labelled cases of the planar world: an effect alone, two on one side, three of several subsystems.
LABELLED = {
    "friction": [("coulomb_friction", "left", {"torque_nm": 0.06})],
    "driver": [("driver_gain", "both", {"ratio": 0.9}), ("driver_deadzone", "left", {"volts": 0.5})],
    # No whole number of the log's rows: where a late command and a sample meet, rounding decides which comes first.
    "late": [("command_delay", "both", {"seconds": 0.0127}), ("wheel_radius_error", "both", {"ratio": 1.05}),
             ("viscous_friction", "right", {"nm_s_per_rad": 0.02})],
}  # fmt: skip


def model_with(*effects, robot=ROBOT):
    """The nominal model with (id, side, values) in it."""
    model = nominal_model(robot)
    for effect, side, values in effects:
        CATALOGUE[effect].apply(model, SIDES[side], values)
    return model


def model_of_one(effect, robot=ROBOT):
    """A model with one effect, at the size at which effects are compared."""
    values = SIZES.get(effect) or values_of(effect)
    if effect == "friction_asymmetry":
        # A torque next to dry friction that is at least as large.
        return model_with(
            (effect, "both", {**values, "nm_s_per_rad": 0.0}), ("coulomb_friction", "both", {"torque_nm": 0.03})
        )
    return model_with((effect, CATALOGUE[effect].sides[0], values), robot=robot)


def apart(log, model, out, robot=ROBOT):
    """How far an answer lies from the diagnosis' replay of a model, and how far the model from the nominal one; in
    units of noise.
    """
    inputs = run_inputs(log, robot)
    truth = replay_run(model, inputs, FINE_STEP_S)
    plain = replay_run(nominal_model(robot), inputs, FINE_STEP_S)
    seen = RunLog(log.name, log.meta, log.t, {**log.columns, **{name: truth[:, k] for k, name in enumerate(OUTPUTS)}})
    case = Case("one", robot, (seen,))
    return distance(case, [(seen, truth, out)])[0], distance(case, [(seen, truth, plain)])[0]


def speed_run(seconds=3.3):
    """The designed run with wheel speeds in the place of its volts: half a rad/s a volt."""
    log = designed_run(seconds)
    columns = {name: values for name, values in log.columns.items() if not name.startswith("v_cmd")}
    columns |= {f"w_cmd_{side}": 0.5 * log.columns[f"v_cmd_{side}"] for side in "lr"}
    return RunLog("speeds", log.meta, log.t, columns)


def diagnosis_of(effects, intervals=0.05):
    """The content of a diagnosis.json; `intervals`: half of each 90 % interval, as a share of its value (None: no
    interval).
    """

    def size(value):
        return {
            "value": value,
            "ci90": None if intervals is None else sorted((value * (1 - intervals), value * (1 + intervals))),
        }

    return {
        "schema": "rtds-diagnosis/2",
        "verdict": "known",
        "nominal_fit": {},
        "effects": [
            {
                "id": e,
                "side": side,
                "subsystem": CATALOGUE[e].subsystem,
                "probability": 1.0,
                "parameters": {name: size(value) for name, value in values.items()},
            }
            for e, side, values in effects
        ],
    }


def measured_run(effects, seconds=6.0, seed=0):
    """A run of the planar world with effects: 100 rows a second, noise of the robot's sensors."""
    machine = planar.nominal_machine(ROBOT)
    for effect, side, values in effects:
        planar.apply_effect(machine, {"id": effect, "side": side, "parameters": values})
    t = np.arange(round(seconds * 100) + 1) / 100
    rng = np.random.default_rng(seed)
    v = rng.uniform(-8.0, 8.0, (int(seconds / 0.5) + 1, 2))[(t / 0.5).astype(int)]
    v[t < 0.2] = 0.0
    channels = planar.run_machine(machine, t, v, np.zeros(5), 0.0, 0.05, 0.3)
    columns = {"v_cmd_l": v[:, 0], "v_cmd_r": v[:, 1]}
    for name, values in planar.apply_sensors(channels, machine, t).items():
        if name in OUTPUTS:
            columns[name] = values + ROBOT.noise(name) * rng.standard_normal(len(t))
    return RunLog(f"run{seed}", RunMeta(scenario="steps", slope_rad=0.05, uphill_yaw_rad=0.3), t, columns)


def write_labelled(name, folder):
    """A folder with a robot, a measured run that no fit has seen, and the case's diagnosis with the true sizes."""
    folder.mkdir()
    (folder / "robot.toml").write_bytes(builtin_robot_path("burger").read_bytes())
    (folder / "diagnosis.json").write_text(json.dumps(diagnosis_of(LABELLED[name])))
    run = measured_run(LABELLED[name])
    write_run(folder / "run", run.meta, {"t": run.t, **run.columns})
    return folder
