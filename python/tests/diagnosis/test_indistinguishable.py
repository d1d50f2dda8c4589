"""Which effects are indistinguishable: in principle, as the effects' own files say, alike in both of a pair; and on the
runs of a case, where one fits as well in the other's place.
"""

from dataclasses import replace

import numpy as np
import pytest
from axis_machine import write_axis_case
from replayed_case import altered

from rtds_host.contract import Case, Driver, RunLog, RunMeta, Servo, builtin_robot, read_case
from rtds_host.diagnosis.effects import CATALOGUE, SIDES, catalogue
from rtds_host.diagnosis.practically_indistinguishable import practically_indistinguishable
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.search.driver import Search
from rtds_host.diagnosis.structurally_indistinguishable import (
    nearly_indistinguishable,
    scale_all,
    structurally_indistinguishable,
)
from rtds_host.plant.schema import OUTPUT_INDEX

TABLES = ("same_as", "same_with_friction", "nearly_as")
SERVO = replace(builtin_robot("burger"), driver=Driver(mode="speed"), servo=Servo(0.44, 8.6, 12.0, 0.001))


def speed_case(*channels):
    t = np.arange(0.0, 3.0, 0.01)
    asked = np.where(t < 1.5, 4.0, -2.0)
    columns = {"w_cmd_l": asked, "w_cmd_r": 0.5 * asked, **{name: 0.0 * t for name in channels}}
    return Case("case", SERVO, (RunLog("steps", RunMeta("steps", 0.0, 0.0, 0.0), t, columns),))


@pytest.mark.parametrize("table", TABLES)
def test_what_is_like_another_effect_is_so_mutually_and_by_the_same_condition(table):
    rules = {
        (name, other): holds for name, effect in CATALOGUE.items() for other, holds in getattr(effect, table).items()
    }
    assert rules
    for (name, other), holds in rules.items():
        assert rules.get((other, name)) is holds, (name, other)


@pytest.mark.parametrize(
    ("channels", "alike"),
    [
        (("w_l", "w_r", "th_l", "th_r"), True),
        (("gyro_z", "x", "y", "yaw"), True),
        (("w_l", "w_r", "gyro_z"), False),
        (("w_l", "w_r", "x", "y", "yaw"), False),
    ],
)
def test_a_scaled_command_is_a_scaled_speed_unless_wheels_and_motion_are_both_measured(channels, alike):
    case = speed_case(*channels)
    for one, other in (("command_gain", "speed_gain"), ("speed_gain", "command_gain")):
        assert ((other, "both") in nearly_indistinguishable(case, (one, "both"))) == alike
        assert (other, "both") not in structurally_indistinguishable(case, (one, "both"))
    voltage = replace(case, robot=builtin_robot("burger"))
    assert ("command_gain", "both") not in nearly_indistinguishable(voltage, ("speed_gain", "both"))


def test_seen_by_pose_and_gyro_a_command_gain_is_a_speed_gains_inverse():
    log = speed_case().runs[0]
    found = []
    for name, ratio in (("command_gain", 0.9), ("speed_gain", 1.0 / 0.9), ("speed_gain", 1.0)):
        model = nominal_model(SERVO)
        catalogue(SERVO)[name].apply(model, SIDES["both"], {"ratio": ratio})
        found.append(replay_run(model, run_inputs(log, SERVO)))
    # As the loop has settled, at the end of each step of the command.
    settled, rate, speed = [149, 299], OUTPUT_INDEX["gyro_z"], OUTPUT_INDEX["w_l"]
    apart, size = (np.abs(found[k] - found[0])[settled, rate].max() for k in (1, 2))
    assert apart < 0.02 * size
    assert np.abs(found[1] - found[0])[settled, speed].min() > 0.1


def axis_case(tmp_path, kind="inertia", missing=()):
    case = read_case(write_axis_case(tmp_path / kind, kind, "voltage"))
    for log in case.runs:
        for channel in missing:
            log.columns.pop(channel, None)
    return case


def test_a_scale_of_the_command_and_of_all_that_is_measured_is_one_scale_too_many(tmp_path):
    """An axis without gravity is homogeneous: with friction as much larger, such scales cancel to the last digits."""
    case = axis_case(tmp_path)
    axis, k = catalogue(case.robot), 3.0
    assert {"w_l", "i_l"} <= case.runs[0].columns.keys()
    gains = {"driver_gain": {"ratio": k}, "speed_gain": {"ratio": 1.0 / k}, "current_gain": {"ratio": 1.0 / k}}
    found = []
    for factor, effects in ((1.0, {}), (k, gains)):
        model = nominal_model(case.robot)
        axis["coulomb_friction"].apply(model, SIDES["left"], {"torque_nm": factor * 0.001})
        for name, values in effects.items():
            axis[name].apply(model, SIDES["left"], values)
        found.append(replay_run(model, run_inputs(case.runs[0], case.robot)))
    for channel in ("w_l", "i_l"):
        one, other = (out[:, OUTPUT_INDEX[channel]] for out in found)
        assert np.abs(one).max() > 0.0 and np.allclose(one, other, rtol=1e-6, atol=1e-6 * np.abs(one).max())
    causes = [(name, "left") for name in gains]
    assert scale_all(case, causes) and scale_all(case, [("pwm_curve", "left"), *causes[1:]])
    assert not any(scale_all(case, causes[:k] + causes[k + 1 :]) for k in range(3))


def test_the_weight_of_a_pendulum_tells_a_scale_of_everything_from_none(tmp_path):
    gains = [(name, "left") for name in ("driver_gain", "speed_gain", "current_gain")]
    assert not scale_all(axis_case(tmp_path, "pendulum"), gains)


def test_a_rival_whose_further_parameter_is_at_rest_has_no_more_parameters(tmp_path):
    """A lag may have a dead time, too. Without any it leaves as little as a delay, by one number as well."""
    case = read_case(write_axis_case(tmp_path / "case", "inertia", "torque", seconds=2.0))
    lagged = altered(case, speed_tau=0.02, coulomb=0.02)
    speed_alone = tuple(
        replace(log, columns={c: v for c, v in log.columns.items() if c != "th_l"}) for log in lagged.runs
    )
    search = Search(Problem(replace(lagged, runs=speed_alone), 1), quick=True)
    nothing, late = search.begin(), ("measurement_delay", "both")
    size = search.store.effects[late[0]].scaled({"seconds": 0.02})
    fit = search.store.try_fit((late,), size, nothing)
    lag = search.store.try_fit((("speed_filter", "left"),), np.array([0.02, 0.0]) / 0.02, nothing)
    assert not search.store.within_noise(fit)
    assert len(lag.u) == 2 and lag.values[0]["delay_s"] == 0.0
    ((_, *others),), _ = practically_indistinguishable(search, fit, [(late, nothing)])
    assert ("speed_filter", "left") in others
