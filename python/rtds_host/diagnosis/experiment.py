"""The next experiment: the safe manoeuvre that separates the remaining rivals best.

Each manoeuvre of the scenarios' menu is replayed with every rival as it was fitted; what their residuals differ by,
in units of noise and projected off the nuisances as far as these are known by now, is the expected separation. The
manoeuvre that separates the two most alike rivals best is proposed (max-min design: A. C. Atkinson, V. V. Fedorov,
Biometrika 62, 1975).
"""

from __future__ import annotations

import itertools

import numpy as np

from rtds_host.contract import Case, RunLog, RunMeta
from rtds_host.diagnosis.fit import Fit, Hypothesis
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import Model, replay_run, run_inputs
from rtds_host.diagnosis.replay.slots import OUTPUTS
from rtds_host.diagnosis.verdict import Decision
from rtds_host.errors import InputError
from rtds_host.robot import make_body
from rtds_host.scenario import scenarios
from rtds_host.scenario.base import Scenario, VoltageMotion
from rtds_host.scenario.reach import needed_voltage

SAMPLE_S = 0.01
# Variants of a manoeuvre worth having: as it is, and with payload.
PAYLOADS_KG = (0.0, 2.0)
ENOUGH = 3.0                                      # sigma: below it a manoeuvre is not worth the trouble


def _plan(scenario: Scenario, problem: Problem, payload_kg: float) -> RunLog | None:
    """The manoeuvre as a run without measurements, or None where these motors cannot do it."""
    robot = problem.robot
    try:
        motion = scenario.build(scenario.values(), robot)
        body = make_body(robot, payload_kg, scenario.slope_rad, scenario.uphill_yaw_rad)
        if isinstance(motion, VoltageMotion):
            t = np.arange(0.0, motion.duration_s, SAMPLE_S)
            volts = motion.voltages(np.floor(t / motion.period_s + 1e-9) * motion.period_s)
        else:
            volts, t = needed_voltage(motion, robot, body)
    except InputError:
        return None
    if np.abs(volts).max() > robot.supply_v:
        return None
    meta = RunMeta(scenario.name, payload_kg, scenario.slope_rad, scenario.uphill_yaw_rad)
    columns = {"v_cmd_l": volts[:, 0], "v_cmd_r": volts[:, 1]}
    return RunLog(scenario.name, meta, t, columns)


def _with_sensors(plan: RunLog, model: Model, problem: Problem) -> Problem:
    """The manoeuvre as a problem whose measurements are what `model` does, on the channels this case has."""
    out = replay_run(model, run_inputs(plan, problem.robot))
    columns = dict(plan.columns)
    for k, name in enumerate(OUTPUTS):
        if any(run.log.has(name) for run in problem.runs):
            columns[name] = out[:, k]
    log = RunLog(plan.name, plan.meta, plan.t, columns)
    return Problem(Case(plan.name, problem.robot, (log,)), problem.threads)


def _separation(plan: RunLog, problem: Problem, a: Fit, b: Fit) -> float:
    """Expected difference of two rivals on a manoeuvre, in sigma, nuisances refitted."""
    there = _with_sensors(plan, a.model(problem), problem)
    difference = there.residual(b.model(problem))
    k = len(b.z)
    steps = np.eye(k)
    models = [b.model_at(problem, b.z + step) for step in steps]
    jacobian = np.column_stack([r - difference for r in there.residuals(models)]) if k else np.empty(
        (len(difference), 0))
    known = b.precision()[:k, :k]
    cross = jacobian.T @ difference
    left = difference @ difference - cross @ np.linalg.solve(jacobian.T @ jacobian + known, cross)
    return float(np.sqrt(max(left, 0.0)))


def next_experiment(problem: Problem, decision: Decision, fits: dict[Hypothesis, Fit]) -> dict | None:
    """The manoeuvre to run next (contract, section 5).

    Returns
    -------
    None where nothing is left to separate, where no manoeuvre of the menu would, or on a single axis (the menu drives
    a robot); else {"scenario", "separates", "expected_separation", "why"}, `scenario` with the options of `rtds run`.
    """
    if not decision.alike or problem.robot.axis is not None or problem.robot.driver.mode != "voltage":
        return None
    members = decision.alike[0]
    rest = [h for h in decision.fit.hypothesis if h != members[0]]
    rivals = [fits[tuple(sorted(rest + [m]))] for m in members]
    best: tuple[float, str] | None = None
    for scenario in scenarios().values():
        if scenario.family != "diagnosis":
            continue
        for payload in PAYLOADS_KG:
            plan = _plan(scenario, problem, payload)
            if plan is None:
                continue
            value = min(_separation(plan, problem, a, b) for a, b in itertools.combinations(rivals, 2))
            if best is None or value > best[0]:
                best = (value, scenario.name + (f" --payload {payload:g}" if payload else ""))
    if best is None or best[0] < ENOUGH:
        return None
    about = scenarios()[best[1].split()[0]]
    return {"scenario": best[1], "separates": [{"id": e, "side": s} for e, s in members],
            "expected_separation": float(f"{best[0]:.3g}"),
            "why": f"{about.about}: separates {about.separates or 'the rivals'}"}
