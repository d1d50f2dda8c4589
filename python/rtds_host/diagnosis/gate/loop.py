"""A servo whose gains the file leaves out: those that bring the nominal robot's replay closest, to fit them from."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from rtds_host.contract import Case
from rtds_host.contract.robot import SERVO_GAINS
from rtds_host.diagnosis.gap import errors, gap, pooled
from rtds_host.diagnosis.gate.findings import Finding
from rtds_host.diagnosis.replay.model import Model, nominal_model, replay_run, run_inputs

# Numerical: factors of a guessed proportional gain, and integral gains over the proportional one, 1/s, that are tried
# first; then those between. The least is next to no integral at all, and leaves its logarithm finite.
TRIED, RATES, BETWEEN = (0.03, 0.1, 0.3, 1.0, 3.0), (1e-4, 1.0, 5.0, 20.0, 60.0), (0.4, 0.63, 1.0, 1.6, 2.5)


def estimated(case: Case) -> tuple[Case, list[Finding]]:
    """The case with gains of its servo in place of those that the file leaves out, and what is said of it.

    One loop that integrates and one that does not are different valleys of a fit: both are looked at.
    """
    servo = case.robot.servo
    if servo is None or servo.declared:
        return case, []
    inputs = [run_inputs(log, case.robot) for log in case.runs]
    model = nominal_model(case.robot)

    def score(kp: float, ki: float) -> float:
        tried = _with(model, kp, ki)
        found = gap(pooled([errors(log, case.robot, replay_run(tried, run)) for log, run in zip(case.runs, inputs)]))
        return found if np.isfinite(found) else np.inf

    def choices(kp: float, ki: float, by_kp: tuple[float, ...], rates: list[float]) -> tuple[float, float]:
        gains = [kp * by for by in by_kp] if "kp_v_s_per_rad" in servo.left_out else [kp]
        pairs = [
            (p, p * rate if "ki_v_per_rad" in servo.left_out else ki) for p, rate in itertools.product(gains, rates)
        ]
        return min(dict.fromkeys(pairs), key=lambda pair: score(*pair))

    kp, ki = choices(servo.kp_v_s_per_rad, servo.ki_v_per_rad, TRIED, list(RATES))
    kp, ki = choices(kp, ki, BETWEEN, [ki / kp * by for by in BETWEEN] if kp > 0.0 else [0.0])
    found = replace(servo, kp_v_s_per_rad=kp, ki_v_per_rad=ki)
    names = " and ".join(sorted(SERVO_GAINS & servo.left_out))
    told = Finding(
        "",
        "",
        "gains",
        "note",
        f"[servo] {names} {'are' if len(servo.left_out) > 1 else 'is'} not in robot.toml: estimated from the runs, "
        f"from {kp:.3g} V·s/rad and {ki:.3g} V/rad.",
    )
    return replace(case, robot=replace(case.robot, servo=found)), [told]


def _with(model: Model, kp: float, ki: float) -> Model:
    moved = model.copy()
    moved.put("servo_kp", kp)
    moved.put("servo_ki", ki)
    return moved
