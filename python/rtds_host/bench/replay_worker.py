"""Replays of one source tree, timed on request: `replays` runs this file with that tree's package on the path.

    replay_worker.py ARRAYS

Writes the residuals of all models to ARRAYS (npz, one array a model) and a line when that is done. Each line that comes
in is the name of a measurement; the answer is its processor time, s. Only what every tree since the laws were moved
into `plant/` has is used here.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from rtds_host.contract import Case, RunLog, RunMeta, builtin_robot
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay import replay_run

RUNS, SECONDS, STEP_S, SEED = 5, 8.0, 0.01, 1
# What models differ by from the nominal robot: entries, the value on each side (relative where the nominal is no zero).
CHANGES: dict[str, dict[str, float]] = {
    "nominal": {},
    "winding": {"resistance": 1.2, "inductance": 0.8, "torque_constant": 0.9, "back_emf": 1.1, "rotor_inertia": 1.5},
    "friction": {"coulomb": 0.05, "viscous_wheel": 2e-3},
    "stribeck": {"coulomb": 0.02, "stribeck": 0.04},
    "asymmetry": {"asymmetry": 0.03, "asymmetry_viscous": 1e-3},
    "load": {"load_share": 0.2, "coulomb": 0.01},
    "driver": {"voltage_gain": 0.9, "deadzone": 0.5, "drop": 0.7, "pwm_curve": 0.3, "limit": 1e-8},
    "supply": {"source_resistance": 0.8, "decline": 0.02},
    "heating": {"heat_rise": 0.05, "heat_tau": 2e-8},
    "ripple": {"ripple": 0.02, "ripple_cycles": 12.0, "ripple_phase": 0.4},
    "free play": {"backlash": 0.02, "coulomb": 0.02},
    "free play that bounces": {"backlash": 0.03, "restitution": 0.5},
    "spring": {"stiffness": 4.0, "damping": 0.01},
    "slip": {"slip": 0.05, "slip_relaxation": 0.02, "slip_damping": 5.0, "slip_grip": 0.5},
    "scrub": {"scrub": 0.02, "rolling": 0.02},
    "body": {"mass": 1.3, "yaw_inertia": 1.4, "com_x": 0.02, "com_y": 0.01, "track": 1.05, "radius": 0.97},
    "slope": {"slope_extra": 0.05, "com_x": 0.01},
    "sensors": {"speed_gain": 1.1, "current_gain": 0.8, "current_bias": 0.02, "speed_tau": 0.03, "gyro_gain": 1.1},
    "delays": {"command_delay": 0.023, "measurement_delay": 0.011},
    "clocks": {"gyro_delay": 0.013, "pose_delay": 0.021, "gyro_bias": 0.05},
}
# Names that earlier states give the same entries.
FORMER = {"gyro_delay": "gyro_late", "pose_delay": "pose_late"}


def fixed_case() -> Case:
    """Runs of the built-in robot: steps of voltage by a fixed seed, and logs that no model has made."""
    robot = builtin_robot("burger")
    rng = np.random.default_rng(SEED)
    t = np.arange(int(SECONDS / STEP_S) + 1) * STEP_S
    runs = []
    for k in range(RUNS):
        volts = rng.uniform(-9.0, 9.0, (int(SECONDS / 0.8) + 1, 2))[(t / 0.8).astype(int)]
        columns = {"v_cmd_l": volts[:, 0], "v_cmd_r": volts[:, 1]}
        for channel in ("v_bus", "i_l", "i_r", "w_l", "w_r", "th_l", "th_r", "gyro_z", "x", "y", "yaw"):
            columns[channel] = 0.05 * rng.standard_normal(len(t)).cumsum()
        for channel in ("x", "y", "yaw", "th_l", "th_r", "w_l", "w_r", "i_l", "i_r"):
            columns[channel] -= columns[channel][0]
        meta = RunMeta(scenario="steps", slope_rad=0.1 * (k % 2), payload_kg=0.3 * (k % 3))
        runs.append(RunLog(f"run-{k}", meta, t, columns))
    return Case("fixed", robot, tuple(runs))


def models_of(problem: Problem) -> dict:
    """Name -> model, in the order of `CHANGES`."""
    found = {}
    for name, change in CHANGES.items():
        model = problem.nominal.copy()
        for entry, value in change.items():
            try:
                now = model.get(entry)
            except KeyError:
                entry = FORMER[entry]
                now = model.get(entry)
            if now == 0.0:
                model.put(entry, value)
            else:
                model.scale(entry, value)
        found[name] = model
    return found


def main(arrays: str) -> None:
    """Serve until the input ends."""
    problem = Problem(fixed_case(), threads=1)
    models = models_of(problem)
    found = {}
    for name, model in models.items():
        found[f"alone: {name}"] = np.concatenate([replay_run(model, run.inputs).ravel() for run, _ in problem.rows])
    together = problem.residuals(list(models.values()))
    found |= {f"in batches: {name}": residual for name, residual in zip(models, together)}
    # Its annotation takes any name for that of an option.
    np.savez(arrays, **found)  # type: ignore[arg-type]
    plain = [name for name in models if not models[name].slow]
    batches = {
        "batch": [models[name] for name in plain if name not in ("load", "supply", "heating", "ripple", "slope")],
        "batch, all effects": list(models.values()),
    }
    print("done", flush=True)
    for line in sys.stdin:
        what = line.strip()
        start = time.process_time()
        if what in batches:
            problem.residuals(batches[what])
        else:
            for run, _ in problem.rows:
                replay_run(models[what], run.inputs)
        print(time.process_time() - start, flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
