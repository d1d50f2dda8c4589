"""Cases for the tests: replays of the built-in robot with noise, and a diagnosis with all its details."""

import numpy as np

from rtds_host.contract import Case, RunLog, RunMeta, builtin_robot
from rtds_host.diagnosis.gate import examine
from rtds_host.diagnosis.localise import localise
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.report import Candidate, Details, Trace
from rtds_host.plant.schema import OUTPUTS

STEP_S = 0.01


def commands(kind: str, seconds: float, seed: int = 0, step_s: float = STEP_S) -> tuple[np.ndarray, np.ndarray]:
    """t (n,) and v_cmd (n, 2): reversing steps, a spin, or a weave with braking."""
    t = np.arange(int(seconds / step_s) + 1) * step_s
    rng = np.random.default_rng(seed)
    if kind == "steps":
        levels = rng.uniform(-9, 9, (int(seconds / 0.8) + 1, 2))
        v = levels[(t / 0.8).astype(int)]
    elif kind == "spin":
        a = 5.0 * np.sin(2 * np.pi * t / 5.0)
        v = np.column_stack([-a, a])
    else:
        a = 6.0 * np.sin(2 * np.pi * t / 6.0)
        v = np.column_stack([a + 2 * np.sin(1.9 * t), a - 2 * np.sin(1.9 * t)])
    v[t < 0.3] = 0.0
    return t, v


def make_run(
    name: str,
    model,
    robot,
    kind: str,
    seconds: float = 8.0,
    seed: int = 0,
    slope: float = 0.0,
    payload: float = 0.0,
    step_s: float = STEP_S,
) -> RunLog:
    """A run of `model`, with the white noise that the robot's sensors declare."""
    t, v = commands(kind, seconds, seed, step_s)
    meta = RunMeta(scenario=kind, slope_rad=slope, payload_kg=payload)
    columns = {"v_cmd_l": v[:, 0], "v_cmd_r": v[:, 1]}
    out = replay_run(model, run_inputs(RunLog(name, meta, t, columns), robot))
    rng = np.random.default_rng(seed + 1000)
    for k, channel in enumerate(OUTPUTS):
        columns[channel] = out[:, k] + robot.noise(channel) * rng.standard_normal(len(t))
    return RunLog(name, meta, t, columns)


def make_case(change=None, seed: int = 0, seconds: float = 8.0, step_s: float = STEP_S) -> Case:
    """Three runs of the burger robot, flat and on a slope, with `change(model)` applied to the truth."""
    robot = builtin_robot("burger")
    model = nominal_model(robot)
    if change is not None:
        change(model)
    runs = (
        make_run("spin", model, robot, "spin", seconds, seed, step_s=step_s),
        make_run("steps", model, robot, "steps", seconds, seed + 1, slope=0.1, step_s=step_s),
        make_run("weave", model, robot, "weave", seconds, seed + 2, payload=1.0, step_s=step_s),
    )
    return Case("example", robot, runs)


def without(case: Case, *channels: str) -> Case:
    """The case without some channels."""
    runs = tuple(
        RunLog(r.name, r.meta, r.t, {c: v for c, v in r.columns.items() if c not in channels}) for r in case.runs
    )
    return Case(case.name, case.robot, runs)


def changed(case: Case, edit) -> Case:
    """The case with `edit(t, columns)` applied to a copy of each run's columns; it may return another t."""
    runs = []
    for r in case.runs:
        columns = {c: v.copy() for c, v in r.columns.items()}
        t = edit(r.t, columns)
        runs.append(RunLog(r.name, r.meta, r.t if t is None else t, columns))
    return Case(case.name, case.robot, tuple(runs))


def example_diagnosis() -> dict:
    """A `known` diagnosis of the form that section 5 of the contract shows."""
    coulomb = {"id": "coulomb_friction", "side": "both"}
    return {
        "schema": "rtds-diagnosis/2",
        "verdict": "known",
        "located": [{"subsystem": "drivetrain", "share": 0.91}, {"subsystem": "driver", "share": 0.09}],
        "effects": [
            {
                **coulomb,
                "subsystem": "drivetrain",
                "probability": 0.96,
                "parameters": {"torque_nm": {"value": 0.048, "ci90": [0.046, 0.050]}},
                "gap_without": 13.9,
            }
        ],
        "budget": [
            {"what": "effect", **coulomb, "share": 0.95},
            {"what": "tolerance", "share": 0.04},
            {"what": "rest", "subsystem": None, "share": 0.01},
        ],
        "nominal_fit": {"l": {"resistance_ohm": 8.66}, "r": {"resistance_ohm": 8.57}},
        "alternatives": [
            {"effects": [coulomb], "probability": 0.95},
            {"effects": [{"id": "rolling_resistance", "side": "both"}], "probability": 0.03},
            {"effects": [coulomb, {"id": "speed_filter", "side": "both"}], "probability": 0.01},
            {"effects": "unknown", "probability": 0.01},
        ],
        "indistinguishable": [],
        "gap": {
            "before": 14.2,
            "refit": 13.9,
            "after": 1.08,
            "closed": 0.994,
            "closed_ci90": [0.991, 0.997],
            "effect_closed": 0.994,
            "channels": {"w_l": {"before": 20.1, "refit": 19.8, "after": 1.05}},
            "rest": {"share": 0.006, "structured": False, "subsystem": None},
        },
        "held_out_runs": ["steps"],
        "next_experiment": {
            "scenario": "crawl",
            "separates": [coulomb, {"id": "rolling_resistance", "side": "both"}],
            "expected_separation": 7.5,
            "why": "payload changes the one and not the other.",
        },
    }


def example_of(verdict: str) -> dict:
    """The same with another verdict: `partial` and `unknown` with a rest of 40 % and 90 %, `none` without a gap."""
    diagnosis = example_diagnosis()
    diagnosis["verdict"] = verdict
    if verdict == "none":
        diagnosis.update(
            effects=[],
            next_experiment=None,
            located=[],
            budget=[],
            alternatives=[{"effects": [], "probability": 0.99}, {"effects": "unknown", "probability": 0.01}],
        )
        diagnosis["gap"].update(
            before=1.2,
            refit=1.02,
            after=1.02,
            closed=None,
            closed_ci90=None,
            effect_closed=None,
            channels={"w_l": {"before": 1.3, "refit": 1.02, "after": 1.02}},
        )
    elif verdict == "partial":
        diagnosis["budget"] = [
            {"what": "effect", "id": "coulomb_friction", "side": "both", "share": 0.55},
            {"what": "tolerance", "share": 0.05},
            {"what": "rest", "subsystem": "wheel_ground", "share": 0.4},
        ]
        diagnosis["gap"].update(
            after=9.0,
            closed=0.6,
            closed_ci90=[0.5, 0.7],
            effect_closed=0.6,
            channels={"w_l": {"before": 20.1, "refit": 19.8, "after": 12.4}},
            rest={"share": 0.4, "structured": True, "subsystem": "wheel_ground"},
        )
    elif verdict == "unknown":
        diagnosis.update(
            effects=[],
            budget=[{"what": "tolerance", "share": 0.1}, {"what": "rest", "subsystem": "drivetrain", "share": 0.9}],
        )
        diagnosis["gap"].update(
            after=13.9,
            effect_closed=0.0,
            closed=0.02,
            channels={"w_l": {"before": 20.1, "refit": 19.8, "after": 19.8}},
            rest={"share": 0.9, "structured": True, "subsystem": "drivetrain"},
        )
    return diagnosis


def example_details() -> Details:
    """Details of a case with friction: replays before and after as traces."""
    truth = nominal_model(builtin_robot("burger"))
    truth.add("coulomb", 0.048)
    case = make_case(lambda m: m.add("coulomb", 0.048))
    nominal = nominal_model(case.robot)
    traces = {}
    for run in case.runs:
        inputs = run_inputs(run, case.robot)
        before, after = replay_run(nominal, inputs), replay_run(truth, inputs)
        traces[run.name] = {
            c: Trace(run.t, run.columns[c], before[:, k], before[:, k], after[:, k]) for k, c in enumerate(OUTPUTS)
        }
    candidates = [
        Candidate(
            [{"id": "coulomb_friction", "side": "both"}],
            [{"torque_nm": {"value": 0.048, "ci90": [0.046, 0.05]}}],
            190.0,
            0.95,
            "included",
            "explains most and nothing beside it earns its place",
        ),
        Candidate(
            [{"id": "rolling_resistance", "side": "both"}],
            [{"coefficient": 0.2}],
            150.0,
            0.03,
            "rejected",
            "misses the runs with payload",
        ),
        Candidate(
            [{"id": "supply_sag", "side": "both"}],
            [],
            3.0,
            None,
            "rejected",
            "gains less than two standard errors <on other runs>",
        ),
    ]
    return Details(
        case=case,
        gate=examine(case),
        localisation=localise(case, nominal),
        localisation_after=localise(case, truth),
        candidates=candidates,
        traces=traces,
        regimes={"slow": {"before": 20.0, "refit": 19.0, "after": 1.1}},
        run_gaps={"steps": {"before": 14.2, "refit": 13.9, "after": 1.08}},
        decided={("coulomb_friction", "both"): ("w_l", 19.8, 1.05)},
        seconds=1.0,
    )
