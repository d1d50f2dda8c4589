"""The mean voltage of a bridge in fast decay, against one that switches, and where it has no part."""

from dataclasses import replace

import numpy as np
import pytest

from rtds_host.contract import RunLog, RunMeta, builtin_robot
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.errors import InputError
from rtds_host.export.figures import figures_of
from rtds_host.plant.driver import fast_decay
from rtds_host.plant.elementary import exponential

BUS = 12.0


def law(volts, emf, ratio):
    """`fast_decay` as a function of Python, with PWM periods over L / R."""
    return fast_decay.py_func(volts, emf, BUS, ratio, exponential.py_func)


def switched(duty, emf, ratio, parts=4000, count=60):
    """Mean voltage at a winding, V, over a period of steady switching at a constant back EMF, by small steps."""
    h, current, total = ratio / parts, 0.0, 0.0
    for k in range(parts * count):
        on = k % parts < duty * parts
        volts = BUS if on else (-BUS if current > 0.0 else emf)
        current = max(current + h * (volts - emf - current), 0.0)
        total += volts if k >= parts * (count - 1) else 0.0
    return total / parts


@pytest.mark.parametrize("duty, emf, ratio", [(0.1, 3.0, 2.0), (0.3, 8.0, 2.0), (0.3, -4.0, 1.0), (0.7, 2.0, 0.5)])
def test_the_law_is_the_mean_of_a_bridge_that_switches(duty, emf, ratio):
    assert law(duty * BUS, emf, ratio) == pytest.approx(switched(duty, emf, ratio), abs=0.01 * BUS)
    assert law(-duty * BUS, -emf, ratio) == -law(duty * BUS, emf, ratio)


def test_at_no_duty_the_motor_coasts_at_full_duty_it_has_the_bus_and_continuous_current_sees_the_off_time():
    for emf in (-5.0, 0.0, 7.0):
        assert law(0.0, emf, 2.0) == emf
        assert law(BUS, emf, 2.0) == BUS
    assert law(0.8 * BUS, 0.0, 0.01) == pytest.approx((2 * 0.8 - 1) * BUS)


def test_in_torque_mode_it_changes_nothing():
    robot = builtin_robot("burger")
    robot = replace(robot, driver=replace(robot.driver, mode="torque", torque_nm_per_v=1e-4))
    t = 0.01 * np.arange(200)
    volts = np.resize([1.0, -2.0, 3.0, 0.5], len(t))
    inputs = run_inputs(RunLog("a", RunMeta("a"), t, {"v_cmd_l": volts, "v_cmd_r": volts}), robot)
    model = nominal_model(robot)
    plain = replay_run(model, inputs)
    model.put("fast_decay", 1.0, (0, 1))
    assert np.array_equal(replay_run(model, inputs), plain)


def test_no_export_takes_it_and_says_so():
    robot = builtin_robot("burger")
    model = nominal_model(robot)
    model.put("fast_decay", 1.0, (0, 1))
    with pytest.raises(InputError, match="pwm_curve: fast_decay"):
        figures_of(model, robot)
