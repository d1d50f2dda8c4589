"""Effects by name: `--effect` and `--effects`, what they refuse, and what a run says of them."""

import json
from dataclasses import replace

import numpy as np
import pytest

from rtds_host.cli.run import chosen_effects
from rtds_host.contract import builtin_robot, read_run
from rtds_host.correction.choose import choose, effect_text, parse_effect
from rtds_host.diagnosis.effects import catalogue
from rtds_host.errors import InputError
from rtds_host.run import LinkChoice, Options, drive_with, make_plan, perform, write_outcome
from rtds_host.run.sensors import CorrectedPath

ROBOT = builtin_robot("burger")
CATALOGUE = catalogue(ROBOT)
SHORT = {"duration_s": 1.2, "length_m": 0.05, "ramp_s": 0.4, "stop_s": 0.4}


def test_several_parameters_and_a_side():
    name, side, values = parse_effect("stribeck_friction.torque_nm=0.02, extra_torque_nm=0.03,side=left", CATALOGUE)
    assert (name, side) == ("stribeck_friction", "left")
    absent = CATALOGUE["stribeck_friction"].parameters[2].null
    assert values == {"torque_nm": 0.02, "extra_torque_nm": 0.03, "speed_rad_s": absent}


def test_what_is_not_given_stays_as_if_absent():
    assert parse_effect("com_offset.y_m=0.01", CATALOGUE)[2] == {"x_m": 0.0, "y_m": 0.01}


@pytest.mark.parametrize("effect", CATALOGUE.values(), ids=list(CATALOGUE))
def test_names_of_effects_can_be_given_back(effect):
    values = {p.name: p.starts[0] for p in effect.parameters}
    assert parse_effect(effect_text(effect.id, effect.sides[-1], values), CATALOGUE) == (
        effect.id,
        effect.sides[-1],
        pytest.approx(values, rel=1e-5),
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("friction.torque_nm=1", "'friction' is not in the catalogue"),
        ("coulomb_friction.torque=1", "'torque' is not a parameter of coulomb_friction"),
        ("coulomb_friction.torque_nm=11", "within 0 to 4.7"),
        ("coulomb_friction.torque_nm=nan", "not a finite number"),
        ("coulomb_friction.torque_nm=much", "'much' is not a finite number"),
        ("coulomb_friction.torque_nm=1,side=front", "side 'front' must be one of both, left, right"),
        ("gyro_bias.rad_s=0.01,side=left", "side 'left' must be one of both"),
        ("coulomb_friction.torque_nm", "must be parameter=number"),
        ("coulomb_friction", "no value given"),
        ("coulomb_friction.side=left", "no value given"),
    ],
)
def test_what_cannot_be_meant_is_refused_in_one_line(text, words):
    with pytest.raises(InputError, match="--effect") as error:
        parse_effect(text, CATALOGUE)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_a_diagnosis_brings_its_nominal_fit_and_its_effects(tmp_path):
    path = tmp_path / "diagnosis.json"
    path.write_text(
        json.dumps(
            {
                "schema": "rtds-diagnosis/1",
                "effects": [
                    {
                        "id": "coulomb_friction",
                        "side": "right",
                        "parameters": {"torque_nm": {"value": 0.05, "ci90": None}},
                    }
                ],
                "nominal_fit": {"l": {"resistance_ohm": 8.7}},
            }
        )
    )
    chosen = choose(ROBOT, path, ["gyro_bias.rad_s=0.01"])
    assert chosen.model.get("resistance", 0) == 8.7
    assert chosen.model.get("coulomb", 1) == 0.05
    assert chosen.model.get("gyro_bias") == 0.01
    assert len(chosen.names) == 3


def test_nothing_chosen_is_nothing():
    assert choose(ROBOT) is None


def test_a_run_says_what_was_on(tmp_path):
    plan = make_plan("linear", SHORT, Options(slope_rad=0.0))
    effects = chosen_effects(plan, None, ["coulomb_friction.torque_nm=0.05,side=left"])
    outcome = perform(plan, LinkChoice("model"), compare=False, effects=effects)
    write_outcome(outcome, tmp_path / "run", figure=False)
    assert outcome.summary.model_agrees
    assert outcome.summary.effects == ("coulomb_friction.torque_nm=0.05,side=left",)
    assert outcome.summary.drawn_j is None
    log = read_run(tmp_path / "run", ROBOT)
    assert "coulomb_friction.torque_nm=0.05,side=left" in log.meta.notes
    # The friction's torque at 0.24 rad/s or more: 0.05 N m need 30 mA.
    at = np.argmax(log.columns["w_ref_l"])
    extra = log.columns["i_l"][at] - log.columns["i_r"][at]
    assert extra == pytest.approx(0.05 / ROBOT.motor.gear_ratio / ROBOT.motor.torque_constant_nm_per_a, rel=0.05)


def test_without_effects_a_run_is_what_it_was():
    plan = make_plan("linear", SHORT)
    assert chosen_effects(plan, None, None) is None
    assert chosen_effects(plan, None, []) is None


@pytest.mark.parametrize(("delay", "held"), [(0.01, 0.0), (0.01, 0.015), (0.0, 0.015)])
def test_sensors_report_late_filtered_scaled_and_the_pose_as_it_is(delay, held):
    """Speeds by a delay of their own as well, of `held` s."""
    plan = make_plan("linear", SHORT)
    names = [
        f"measurement_delay.seconds={delay}",
        f"speed_filter.time_constant_s={0.02 + held},delay_s={held}",
        "speed_gain.ratio=1.1,side=left",
        "current_bias.amperes=0.2,side=right",
        "gyro_bias.rad_s=0.3",
    ]
    correction = chosen_effects(plan, None, names).correction
    record = drive_with(plan, "model", correction=correction)
    t = record.t_s[record.rows]
    seen = np.array([s.speeds_rad_s for s in record.samples])
    lagging = np.zeros((len(record.t_s), 2))
    for k in range(1, len(lagging)):
        middle = 0.5 * (record.speeds[k] + record.speeds[k - 1])
        lagging[k] = lagging[k - 1] + (1 - np.exp(-1e-3 / 0.02)) * (middle - lagging[k - 1])
    for side, gain in ((0, 1.1), (1, 1.0)):
        assert seen[:, side] == pytest.approx(
            gain * np.interp(t - delay - held, record.t_s, lagging[:, side]), abs=2e-3
        )
    current = np.array([s.currents_a[1] for s in record.samples])
    assert current == pytest.approx(np.interp(t - delay, record.t_s, record.currents[:, 1]) + 0.2, abs=1e-3)
    assert record.samples[0].gyro_rad_s == pytest.approx(0.3, abs=1e-6)
    assert [s.x_m for s in record.samples] == [s.x_m for s in record.truth]


def test_the_bus_of_a_run_sags_and_falls():
    plan = make_plan("linear", SHORT)
    effects = chosen_effects(plan, None, ["supply_sag.resistance_ohm=2", "battery_decline.rate_v_per_s=0.5"])
    record = drive_with(plan, "model", correction=effects.correction)
    bus = np.array([s.v_bus for s in record.truth])
    t = record.t_s[record.rows]
    # What acts just before a row is the command of the millisecond before.
    before = np.vstack([[0.0, 0.0], record.applied])[record.rows].astype(float)
    draw = (record.currents[record.rows] * before).sum(axis=1) / 12.0
    assert np.abs(draw).max() > 0.01
    assert bus == pytest.approx(12.0 - 0.5 * t - 2.0 * draw, abs=1e-9)


def test_effects_need_the_closed_coupling():
    plan = make_plan("linear", SHORT, Options(coupling="paper"))
    effects = chosen_effects(plan, None, ["gyro_bias.rad_s=0.01"])
    with pytest.raises(InputError, match="closed"):
        drive_with(plan, "model", correction=effects.correction)


def test_an_ideal_sensor_path_remembers_nothing():
    plan = make_plan("linear", SHORT)
    sensors = chosen_effects(plan, None, ["gyro_gain.ratio=1.1"]).correction.sensors
    assert not CorrectedPath(12.0, sensors).watches


@pytest.mark.parametrize("name", ["backlash.angle_rad=0.3", "gear_compliance.stiffness_nm_per_rad=0.5"])
def test_an_encoder_on_the_wheel_reports_what_the_wheel_does(name):
    plan = make_plan("linear", SHORT)
    there = replace(plan, robot=replace(plan.robot, encoder="wheel"))
    chassis = plan.robot.chassis

    def seen(plan):
        """Angles (n, 2), rad, and how far wheels that turn so, without slip, turn the robot beyond its measured yaw."""
        record = drive_with(plan, "model", correction=chosen_effects(plan, None, [f"{name},side=left"]).correction)
        angles = np.array([s.angles_rad for s in record.samples])
        turned = (angles[:, 1] - angles[:, 0]) * chassis.wheel_radius_m / chassis.track_width_m
        return angles, np.abs(turned - [s.yaw_rad for s in record.truth])

    (motors, astray), (wheels, rolls) = seen(plan), seen(there)
    assert rolls.max() < 0.1 * astray.max()
    assert np.abs(wheels - motors)[:, 0].max() > 0.01
