"""A servo whose gains nobody declares: the runs say them, with an integral or without, whatever else is amiss."""

from dataclasses import replace

import numpy as np
import pytest

from rtds_host.contract import Case, Driver, RunLog, RunMeta, Servo, builtin_robot
from rtds_host.contract.robot import SERVO_GAINS
from rtds_host.diagnosis.gate import examine
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.plant.schema import OUTPUTS


def case_with(kp, ki, left_out=SERVO_GAINS, change=None):
    """Two runs of a speed-mode burger with gains (kp, ki), of which a file leaves some out."""
    servo = Servo(kp_v_s_per_rad=kp, ki_v_per_rad=ki, limit_v=12.0, period_s=0.005)
    true = replace(builtin_robot("burger"), driver=Driver(mode="speed"), servo=servo)
    model = nominal_model(true)
    if change is not None:
        change(model)
    guess = replace(
        servo,
        kp_v_s_per_rad=1.69 if "kp_v_s_per_rad" in left_out else kp,
        ki_v_per_rad=8.45 if "ki_v_per_rad" in left_out else ki,
        left_out=frozenset(left_out),
    )
    runs = []
    for k in range(2):
        t = np.arange(0.0, 6.0, 0.02)
        rng = np.random.default_rng(k)
        levels = rng.uniform(-4.0, 4.0, (8, 2))[(t / 0.8).astype(int)] * (t > 0.3)[:, None]
        columns = {"w_cmd_l": levels[:, 0], "w_cmd_r": levels[:, 1]}
        out = replay_run(model, run_inputs(RunLog("run", RunMeta(), t, columns), true))
        for j, c in enumerate(OUTPUTS):
            if c in ("w_l", "w_r", "gyro_z"):
                columns[c] = out[:, j] + true.noise(c) * rng.standard_normal(len(t))
        runs.append(RunLog(f"run{k}", RunMeta(), t, columns))
    return Case("case", replace(true, servo=guess), tuple(runs))


@pytest.mark.parametrize("drag", [0.0, 0.08])
@pytest.mark.parametrize("kp, ki", [(0.44, 0.0), (0.44, 8.6), (1.5, 0.0), (0.2, 4.0)])
def test_gains_begin_near_those_of_the_loop(kp, ki, drag):
    gate = examine(case_with(kp, ki, change=lambda m: m.put("scrub", drag)))
    found = gate.case.robot.servo
    assert found.left_out == SERVO_GAINS and gate.of("gains")
    assert 0.5 < found.kp_v_s_per_rad / kp < 2.0
    if ki:
        assert 0.4 < found.ki_v_per_rad / ki < 2.5
    else:
        assert found.ki_v_per_rad < 0.2 * kp


def test_a_gain_that_is_declared_stays():
    found = examine(case_with(0.44, 8.6, {"ki_v_per_rad"})).case.robot.servo
    assert found.kp_v_s_per_rad == 0.44 and 0.4 < found.ki_v_per_rad / 8.6 < 2.5
    assert not examine(case_with(0.44, 8.6, set())).of("gains")
