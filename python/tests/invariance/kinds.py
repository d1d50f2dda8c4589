"""Ten cases of different kinds for the table: sound, one cause of each subsystem, several at once, few channels, one
without a name.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from diagnosis_cases import make_case, without

from rtds_host.contract import Case, RunLog, builtin_robot
from rtds_host.diagnosis.replay.model import Model, nominal_model, replay_run, run_inputs
from rtds_host.plant.schema import OUTPUTS

SECONDS = 8.0


def _two(model: Model) -> None:
    model.add("deadzone", 0.6, (1,))
    model.put("command_delay", 0.02)


def _three(model: Model) -> None:
    model.add("coulomb", 0.05)
    model.scale("current_gain", 0.85, (0,))
    model.scale("track", 1.05)


def _weak_forwards() -> Case:
    """Dry friction, and a driver that gives a tenth less one way: the catalogue has no name for that."""
    case = make_case(lambda m: m.add("coulomb", 0.08), seconds=SECONDS)
    robot, model = builtin_robot("burger"), nominal_model(builtin_robot("burger"))
    model.add("coulomb", 0.08)
    runs = []
    for k, log in enumerate(case.runs):
        given = {c: np.where(v > 0.0, 0.9 * v, v) for c, v in log.columns.items() if c.startswith("v_cmd")}
        out = replay_run(model, run_inputs(RunLog(log.name, log.meta, log.t, given), robot))
        rng = np.random.default_rng(k)
        seen = {c: out[:, j] + robot.noise(c) * rng.standard_normal(len(log.t)) for j, c in enumerate(OUTPUTS)}
        runs.append(RunLog(log.name, log.meta, log.t, {**log.columns, **seen}))
    return Case("example", robot, tuple(runs))


def _one(change: Callable[[Model], None] | None) -> Callable[[], Case]:
    return lambda: make_case(change, seconds=SECONDS)


KINDS: dict[str, Callable[[], Case]] = {
    "sound": _one(None),
    "friction left": _one(lambda m: m.add("coulomb", 0.05, (0,))),
    "driver gain": _one(lambda m: m.scale("voltage_gain", 0.85)),
    "resistance left": _one(lambda m: m.scale("resistance", 1.6, (0,))),
    "radius right": _one(lambda m: m.scale("radius", 1.04, (1,))),
    "gyro offset": _one(lambda m: m.add("gyro_bias", 0.02)),
    "dead zone right, delay": _one(_two),
    "friction, current gain left, track": _one(_three),
    "viscous friction, few channels": lambda: without(
        make_case(lambda m: m.add("viscous_wheel", 0.02), seconds=SECONDS), "i_l", "i_r", "x", "y", "yaw"
    ),
    "friction, one without a name": _weak_forwards,
}
