"""The next experiment: the safe manoeuvre that separates the remaining rivals best.

Each manoeuvre of the scenarios' menu is replayed with every rival as it was fitted; what their residuals differ by,
in units of noise and projected off the nuisances as far as these are known by now, is the expected separation. The
manoeuvre that separates the two most alike rivals best is proposed (max-min design: A. C. Atkinson, V. V. Fedorov,
Biometrika 62, 1975).
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from rtds_host.contract import Case, Robot, RunLog, RunMeta
from rtds_host.diagnosis.attribution import Attribution
from rtds_host.diagnosis.fit import Fit, joined, scaled
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import Model, replay_run, run_inputs
from rtds_host.diagnosis.report.words import SUBSYSTEM_WORDS
from rtds_host.diagnosis.screen import available, clashes, start_values
from rtds_host.diagnosis.search.store import Store
from rtds_host.diagnosis.start import DECLARED
from rtds_host.errors import InputError
from rtds_host.plant.schema import OUTPUTS
from rtds_host.robot import make_body
from rtds_host.scenario import scenarios
from rtds_host.scenario.base import Scenario, VoltageMotion
from rtds_host.scenario.reach import needed_voltage

# Numerical: how finely the menu's manoeuvres are replayed.
SAMPLE_S = 0.01
# Numerical: variants of a manoeuvre that are tried: as it is, and with so many times the robot's own mass as payload.
PAYLOADS = (0.0, 2.0)
# Numerical: how many effects of a subsystem stand for what could be the residual.
SUPPOSED = 2


def as_run(scenario: Scenario, robot: Robot, payload_kg: float, t: np.ndarray, volts: np.ndarray) -> RunLog:
    """A manoeuvre's voltages (n, sides) at times (n,) as a run without measurements."""
    meta = RunMeta(scenario.name, payload_kg, scenario.slope_rad, scenario.uphill_yaw_rad)
    return RunLog(scenario.name, meta, t, {f"v_cmd_{side}": volts[:, k] for k, side in enumerate(robot.sides)})


def _plan(scenario: Scenario, problem: Problem, payload_kg: float) -> RunLog | None:
    """The manoeuvre as a run without measurements, or None where these motors cannot do it."""
    robot = problem.robot
    try:
        motion = scenario.build(scenario.values(), robot)
        if isinstance(motion, VoltageMotion):
            t = np.arange(0.0, motion.duration_s, SAMPLE_S)
            volts = motion.voltages(np.floor(t / motion.period_s + 1e-9) * motion.period_s)
        elif robot.axis is not None:
            return None
        else:
            body = make_body(robot, payload_kg, scenario.slope_rad, scenario.uphill_yaw_rad)
            volts, t = needed_voltage(motion, robot, body)
    except InputError:
        return None
    top = np.abs(volts).max()
    if top > robot.supply_v:
        volts = volts * (robot.supply_v / top)
    return as_run(scenario, robot, payload_kg, t, volts)


def _with_sensors(plan: RunLog, model: Model, problem: Problem) -> Problem:
    """The manoeuvre as a problem whose measurements are what `model` does, on the channels this case has."""
    out = replay_run(model, run_inputs(plan, problem.robot))
    columns = dict(plan.columns)
    for k, name in enumerate(OUTPUTS):
        if any(run.log.has(name) for run in problem.runs):
            columns[name] = out[:, k]
    log = RunLog(plan.name, plan.meta, plan.t, columns)
    return Problem(Case(plan.name, problem.robot, (log,)), problem.threads)


def _separation(plan: RunLog, problem: Problem, a: Fit, b: Fit, known: np.ndarray) -> float:
    """Expected difference of two rivals on a manoeuvre, in sigma, nuisances refitted as far as they are not `known` (k,
    k).
    """
    there = _with_sensors(plan, a.model(problem), problem)
    # Where runs of the case began says nothing of the manoeuvre, whatever its name.
    difference = there.residual(b.model(problem).with_start(DECLARED))
    k = len(b.z)
    models = [b.model_at(problem, b.z + step).with_start(DECLARED) for step in np.eye(k)]
    jacobian = (
        np.column_stack([r - difference for r in there.residuals(models)]) if k else np.empty((len(difference), 0))
    )
    cross = jacobian.T @ difference
    left = difference @ difference - cross @ np.linalg.solve(jacobian.T @ jacobian + known, cross)
    return float(np.sqrt(max(left, 0.0)))


def _in_its_place(store: Store, attribution: Attribution, cause: tuple[str, str], other: tuple[str, str]) -> Fit:
    """The explanation with another effect in place of an included one where the search did not fit it."""
    without = next(one.without for one in attribution.included if one.cause == cause)
    start = scaled(store.effects, (other,), start_values(store.effects[other[0]])[:1])
    return store.try_fit(*joined({**without.parts, other: start}), without, rough=True)


def _supposed(problem: Problem, fit: Fit, subsystem: str | None) -> list[Fit]:
    """The explanation with one effect more that could be the residual: of its subsystem, at a usual size."""
    found = []
    for effect in available(problem):
        side = effect.sides[0]
        values = start_values(effect)
        if (
            effect.subsystem != subsystem
            or effect.nonlinear
            or not values
            or clashes((effect.id, side), fit.hypothesis)
        ):
            continue
        hypothesis, u = joined(
            {**fit.parts, (effect.id, side): scaled(problem.effects, ((effect.id, side),), values[-1:])}
        )
        found.append(replace(fit, hypothesis=hypothesis, u=u))
    return found[:SUPPOSED]


def next_experiment(problem: Problem, store: Store, attribution: Attribution, diagnosis: dict) -> dict | None:
    """The manoeuvre to run next (contract, section 5): the one that separates indistinguishable effects, or that would
    tell most about the residual.

    Returns
    -------
    None where the verdict is `none`, or `known` without indistinguishable effects; else {"scenario", "separates",
    "expected_separation", "why"}, `scenario` with the options of `rtds run`.
    """
    verdict = diagnosis["verdict"]
    if verdict == "none" or (verdict == "known" and not attribution.indistinguishable):
        return None
    place = diagnosis["gap"]["rest"]["subsystem"]
    if attribution.indistinguishable:
        causes = attribution.indistinguishable[0]
        kept = {h for h in attribution.fit.hypothesis if h != causes[0]}
        rivals = [
            store.fits.get(tuple(sorted({*kept, m}))) or _in_its_place(store, attribution, causes[0], m) for m in causes
        ]
        separates = [{"id": e, "side": problem.effects[e].side_on(problem.robot.axis, s)} for e, s in causes]
    else:
        supposed = _supposed(problem, attribution.fit, place)
        rivals = [attribution.fit, *supposed]
        new = [h for fit in supposed for h in fit.hypothesis if h not in attribution.fit.hypothesis]
        separates = [{"id": e, "side": problem.effects[e].side_on(problem.robot.axis, s)} for e, s in new]
    count = len(attribution.fit.z)
    known = attribution.fit.precision[:count, :count]
    best: tuple[float, str, Scenario] | None = None
    for scenario in scenarios().values():
        if scenario.family != "diagnosis" or len(rivals) < 2 or problem.robot.driver.mode == "speed":
            continue
        for payload in PAYLOADS if problem.robot.axis is None else PAYLOADS[:1]:
            payload_kg = payload * (problem.robot.chassis.mass_kg if problem.robot.chassis else 0.0)
            plan = _plan(scenario, problem, payload_kg)
            if plan is None:
                continue
            value = min(_separation(plan, problem, a, b, known) for a, b in itertools.combinations(rivals, 2))
            if best is None or value > best[0]:
                best = (value, scenario.name + (f" --payload {payload_kg:g}" if payload else ""), scenario)
    compared = best is not None
    # Nothing of the menu can be replayed on this machine, or nothing is there to compare: the one that is a
    # general mix of motions.
    value, text, scenario = best or (0.0, "teleop", scenarios()["teleop"])
    return {
        "scenario": text,
        "separates": separates,
        "expected_separation": float(f"{value:.3g}"),
        "why": f"{purpose_of(bool(attribution.indistinguishable), place, compared)}: {scenario.about}",
    }


def purpose_of(alike: bool, place: str | None, compared: bool) -> str:
    """What the manoeuvre is for, in a clause: to separate indistinguishable effects (`alike`), or to excite an
    unmodelled part at `place`; `compared`: whether that of the menu was chosen by replays."""
    blind = "the best manoeuvre could not be computed for this robot; this one is a general mix of motions"
    if alike:
        return "it separates best what is indistinguishable in these runs" if compared else blind
    if place is None:
        return "the place of the unmodelled part is not known; this manoeuvre is a general mix of motions"
    where = f"most of the unmodelled part is in the {SUBSYSTEM_WORDS[place]}"
    return f"{where}, which this manoeuvre excites most" if compared else f"{where}, but {blind}"
