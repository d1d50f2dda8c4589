"""Which equations may lack a term, over what, in which range, and how large it may be."""

from __future__ import annotations

import numpy as np

from rtds_host.diagnosis.conditions import angles_known
from rtds_host.diagnosis.forms.curves import BODY, KNOTS, Form
from rtds_host.diagnosis.forms.warmth import time_constants
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import Model
from rtds_host.diagnosis.scales import Scales, scales_of
from rtds_host.diagnosis.thresholds import CLEAR_RATIO, FEW_SHARE, MINOR_SHARE
from rtds_host.plant import forms as plant
from rtds_host.plant.schema import OUTPUT_INDEX

# What each term may run over.
RUNS_OVER = {
    "torque": ("w", "th", "motor_angle", "i", "load", "t", "heat"),
    "damping": ("t", "heat"),
    "voltage": ("v_cmd", "command_history", "i", "th", "t", "heat"),
    "torque_constant": ("i", "heat"),
    "force": ("speed", "x", "y", "yaw"),
    "yaw_torque": ("yaw_rate", "speed_yaw_rate"),
    "current_sensor": ("i",),
    "speed_sensor": ("w",),
    "gyro_sensor": ("yaw_rate", "t"),
}
# The channels of which a sensor's term needs one in the logs.
NEEDS = {"current_sensor": ("i_l", "i_r"), "speed_sensor": ("w_l", "w_r"), "gyro_sensor": ("gyro_z",)}
# Quantities that mean the same in all runs only where angles do.
ANGLES = ("th", "motor_angle")
# Numerical: ratio of one end of a sensor's curve to the next.
NEARER = 4.0


def scale_of(term: str, scales: Scales) -> float:
    """What is large of a term on a machine, in its unit."""
    return {
        "torque": scales.torque,
        "damping": scales.torque / scales.speed,
        "voltage": scales.volts,
        "torque_constant": 1.0,
        "force": scales.torque / scales.radius,
        "yaw_torque": scales.spin,
        "current_sensor": scales.amps,
        "speed_sensor": scales.speed,
        "gyro_sensor": scales.turn,
    }[term]


def ranges(problem: Problem, model: Model) -> dict[str, list[tuple[float, float]]]:
    """Ends of what a model's replays pass through, by quantity; of what is counted from zero alike on both sides.

    Of most samples, and of all where a few peaks reach so much farther that a grid over them is another one: what a
    motor loses at its largest currents shows there only.
    """
    replayed = problem.replay(model)
    outs = [out[np.abs(out).max(axis=1) < 1e6] for out in replayed]
    out = np.concatenate(outs)
    sides = ["lr".index(side) for side in problem.robot.sides]
    tail = 0.5 * FEW_SHARE

    def reach(values: np.ndarray) -> list[tuple[float, float]]:
        if not values.size:
            return []
        most, whole = (float(np.quantile(np.abs(values), end)) for end in (1.0 - tail, 1.0))
        return [(-end, end) for end in (most, *([whole] if whole > CLEAR_RATIO * most else []))]

    column = {name: out[:, k] for name, k in OUTPUT_INDEX.items()}
    w = out[:, [OUTPUT_INDEX["w_l"] + k for k in sides]]
    found = {
        "i": reach(out[:, [OUTPUT_INDEX["i_l"] + k for k in sides]]),
        "w": reach(w),
        "th": [(0.0, plant.FULL_TURN)],
        "motor_angle": [(0.0, plant.FULL_TURN)],
        "t": [(0.0, max(float(data.log.t[-1] - data.log.t[0]) for data in problem.whole))],
    }
    asked = np.concatenate([np.abs(data.inputs[2]).ravel() for data in problem.runs])
    most = model.get("supply") if problem.robot.driver.mode == "speed" else min(float(asked.max()), model.get("supply"))
    found["v_cmd"] = found["command_history"] = [(-most, most)]
    if problem.robot.driver.mode != "torque":
        starting = problem.runs_starting(model.start)
        loads = [_loads(data.inputs[0], one, model, sides) for data, one in zip(starting, replayed, strict=True)]
        found["load"] = reach(np.concatenate(loads))
    if problem.robot.axis is None:
        speed = 0.5 * (w @ [model.get("radius", 0), model.get("radius", 1)])
        found["speed"] = reach(speed)
        found["yaw"] = [(0.0, plant.FULL_TURN)]
        found["yaw_rate"] = reach(column["gyro_z"])
        found["speed_yaw_rate"] = reach(speed * column["gyro_z"])
        for name in ("x", "y"):
            found[name] = [(float(column[name].min()), float(column[name].max()))]
    return found


def of_own_reading(term: str, over: str) -> bool:
    """Whether a sensor's term runs over what the sensor reads."""
    return term in NEEDS and over != "t"


def _nearer(ends: list[tuple[float, float]], noise: float) -> list[tuple[float, float]]:
    """Ends of a sensor's curve within those of most that it reads, as long as its points are farther apart than its
    noise, in the unit of what it reads: what is too small to be read shows next to zero only."""
    found: list[tuple[float, float]] = []
    high = ends[0][1] / NEARER if ends else 0.0
    while high > KNOTS * noise:
        found.append((-high, high))
        high /= NEARER
    return found


def _loads(t: np.ndarray, out: np.ndarray, model: Model, sides: list[int]) -> np.ndarray:
    """Torques that the gears of some sides deliver in a replay (n, 11) at times t (n,) s, N·m: what the motor makes,
    less its friction and what accelerates its rotor (contract, section 2)."""
    ratio, found = model.get("gear_ratio"), [np.zeros(0)]
    if len(t) < 2 or np.abs(out).max() >= 1e6:
        return found[0]
    for k in sides:
        i, w = out[:, OUTPUT_INDEX["i_l"] + k], out[:, OUTPUT_INDEX["w_l"] + k]
        inertia, fluid = (ratio**2 * model.get(name, k) for name in ("rotor_inertia", "viscous"))
        found.append(ratio * model.get("torque_constant", k) * i - fluid * w - inertia * np.gradient(w, t))
    return np.concatenate(found)


def candidates(problem: Problem, model: Model) -> list[Form]:
    """Terms that a case's equations may lack, with the range that its runs pass through."""
    robot = problem.robot
    scales = scales_of(robot, problem.case.runs)
    known, heats = ranges(problem, model), time_constants(problem, model)
    found = []
    # One sigma of a term that nobody knew of is slight against the machine's own scale.
    for term, overs in RUNS_OVER.items():
        if robot.axis is not None and term in BODY:
            continue
        if robot.driver.mode == "torque" and term in ("torque_constant", "current_sensor"):
            continue
        if term in NEEDS and not any(c in log.columns for log in problem.case.runs for c in NEEDS[term]):
            continue
        for over in overs:
            if over == "heat":
                # A voltage over the heat is a share of the command.
                size = MINOR_SHARE * (1.0 if term == "voltage" else scale_of(term, scales))
                found += [Form(term, over, 0.0, high, size, tau) for tau, high in heats]
            if over not in known or (over == "i" and robot.driver.mode == "torque"):
                continue
            if over == "motor_angle" and robot.motor.gear_ratio == 1.0:
                continue
            if over in ANGLES and not angles_known(problem.case):
                continue
            size = MINOR_SHARE * scale_of(term, scales)
            ends = known[over]
            if of_own_reading(term, over):
                logged = {c for log in problem.case.runs for c in NEEDS[term] if c in log.columns}
                noises = [noise for noise in map(robot.noise, logged) if noise]
                ends = [*ends, *(_nearer(ends, min(noises)) if noises else [])]
            found += [Form(term, over, low, high, size) for low, high in ends if high > low]
    return found
