"""Cases for the tests of what a diagnosis changes in the simulator: runs of the simulator or the replay, with noise."""

import numpy as np

from rtds_host.contract import Case, RunLog, RunMeta, builtin_robot, write_run
from rtds_host.correction.simulate import simulate
from rtds_host.diagnosis.effects import SIDES, catalogue
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.plant.schema import OUTPUTS

ROBOT = builtin_robot("burger")
CATALOGUE = catalogue(ROBOT)
STEP_S = 0.005


def model_with(*effects):
    """The nominal model with (id, side, values) in it."""
    model = nominal_model(ROBOT)
    for effect, side, values in effects:
        CATALOGUE[effect].apply(model, SIDES[side], values)
    return model


def commands(seconds, seed, top=9.0, hold_s=0.6):
    """A log of voltage steps, differing left and right."""
    t = np.arange(round(seconds / STEP_S) + 1) * STEP_S
    levels = np.random.default_rng(seed).uniform(-top, top, (int(seconds / hold_s) + 1, 2))
    v = levels[(t / hold_s).astype(int)]
    v[t < 0.2] = 0.0
    return RunLog(f"run{seed}", RunMeta(scenario="steps", slope_rad=0.05), t, {"v_cmd_l": v[:, 0], "v_cmd_r": v[:, 1]})


def with_noise(log, out, seed):
    """The log with an answer (n, 11) in its columns and the sensors' noise on it."""
    rng = np.random.default_rng(seed)
    noisy = {name: out[:, k] + ROBOT.noise(name) * rng.standard_normal(len(log.t)) for k, name in enumerate(OUTPUTS)}
    return RunLog(log.name, log.meta, log.t, {**log.columns, **noisy})


def replayed_case(model, seconds=3.0, count=2):
    """Runs of the replay."""
    runs = []
    for seed in range(count):
        log = commands(seconds, seed)
        runs.append(with_noise(log, replay_run(model, run_inputs(log, ROBOT), 2e-4), seed + 100))
    return Case("example", ROBOT, tuple(runs))


def simulated_case(change, seconds=4.0, count=3, model=None, **options):
    """Runs of the simulator with a correction that no effect of the catalogue makes."""
    runs = []
    for seed in range(count):
        log = commands(seconds, seed, **options)
        runs.append(with_noise(log, simulate(log, ROBOT, model or nominal_model(ROBOT), change=change).out, seed + 100))
    return Case("outside", ROBOT, tuple(runs))


def diagnosis_of(*effects, verdict="known", located="drivetrain"):
    """The content of a diagnosis.json."""
    return {
        "schema": "rtds-diagnosis/1",
        "verdict": verdict,
        "located": [{"subsystem": located, "share": 1.0}],
        "effects": [
            {"id": e, "side": side, "parameters": {n: {"value": v, "ci90": None} for n, v in values.items()}}
            for e, side, values in effects
        ],
        "nominal_fit": {},
        "gap": {"rest": {"share": 0.0, "structured": verdict == "unknown", "subsystem": None}},
    }


def write_case(case, folder):
    """A case folder of a case."""
    from rtds_host.contract import builtin_robot_path

    folder.mkdir()
    (folder / "robot.toml").write_bytes(builtin_robot_path("burger").read_bytes())
    for run in case.runs:
        write_run(folder / run.name, run.meta, {"t": run.t, **run.columns})
    return folder
