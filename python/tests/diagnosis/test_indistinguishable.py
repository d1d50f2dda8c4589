"""Which effects are indistinguishable in principle is in the effects' own files, alike in both of a pair."""

from dataclasses import replace

import numpy as np
import pytest

from rtds_host.contract import Case, Driver, RunLog, RunMeta, Servo, builtin_robot
from rtds_host.diagnosis.effects import CATALOGUE, SIDES, catalogue
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.structurally_indistinguishable import nearly_indistinguishable, structurally_indistinguishable
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
