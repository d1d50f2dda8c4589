"""One description of an effect: what its `apply` writes into the replay's model reaches the simulator whole."""

import math
from dataclasses import replace

import pytest

from rtds_host.contract import builtin_robot
from rtds_host.correction import translate as module
from rtds_host.correction.translate import places_of, translate
from rtds_host.diagnosis.effects import SIDES, catalogue
from rtds_host.diagnosis.replay.model import nominal_model
from rtds_host.errors import InputError
from rtds_host.plant.schema import COMMON, PLACES, SIDE, Entry

ROBOT = builtin_robot("burger")
CATALOGUE = catalogue(ROBOT)
# Values at which a parameter matters: with another that gives it a meaning, or away from its nominal value.
WITH = {
    "stribeck_speed": {"stribeck": 0.02},
    "ripple_cycles": {"ripple": 0.02},
    "ripple_phase": {"ripple": 0.02},
    "drop_knee": {"drop": 0.3},
    "ripple_in_phase": {"ripple": 0.02},
    "ripple_in_quadrature": {"ripple": 0.02},
    "heat_tau": {"heat_rise": 0.1},
    "pwm_periods": {"fast_decay": 1.0},
}
ODD = {"limit": 6.0, "heat_tau": 20.0}
SMALL = ("stribeck_speed", "ripple_cycles")


def nudged(name, side=0):
    """Two models that differ in one parameter alone."""
    model = nominal_model(ROBOT)
    for other, value in WITH.get(name, {}).items():
        model.put(other, value)
    other = model.copy()
    old = model.get(name, side)
    other.put(name, ODD.get(name, 1.3 * old if old else 0.011), (side,))
    return model, other


@pytest.mark.parametrize(
    "name", [n for n, place in PLACES.items() if place not in ("refused", "log") and n not in ("gear_ratio", "supply")]
)
def test_every_parameter_changes_the_simulator(name):
    for side in (0, 1) if name in SIDE else (0,):
        before, after = (translate(m, ROBOT, payload_kg=1.0) for m in nudged(name, side))
        assert before != after


def test_nominal_robot_needs_no_effect():
    correction = translate(nominal_model(ROBOT), ROBOT)
    assert correction.links_effects() == {"left": None, "right": None, "supply": None}
    chassis = ROBOT.chassis
    assert correction.body.mass_kg == chassis.mass_kg
    assert correction.body.wheel_radius_m == (chassis.wheel_radius_m,) * 2
    assert correction.scrub_nm == 0.0


@pytest.mark.parametrize("name", ["gear_ratio", "supply"])
def test_the_robots_own_figures_cannot_change(name):
    with pytest.raises(InputError, match="gear_ratio, supply"):
        translate(nudged(name)[1], ROBOT)


def test_a_parameter_that_nothing_translates_is_an_error(monkeypatch):
    monkeypatch.setitem(COMMON, "new_parameter", Entry("new_parameter", "1", 0.0, "rtl", "", "something"))
    monkeypatch.setitem(PLACES, "new_parameter", "rtl")
    with pytest.raises(LookupError, match="new_parameter"):
        translate(nominal_model(ROBOT), ROBOT)


def test_every_parameter_acts_at_a_known_place():
    assert set(PLACES.values()) == {*module.PLACE_NAMES, "log"}


@pytest.mark.parametrize("effect", CATALOGUE.values(), ids=list(CATALOGUE))
def test_the_catalogue_says_where_an_effect_runs(effect):
    assert places_of(effect, ROBOT) == {effect.runs_in}
    assert effect.runs_in in module.PLACE_NAMES


def corrected(effect, side="both", payload=0.0, angles=(0.0, 0.0), **values):
    model = nominal_model(ROBOT)
    CATALOGUE[effect].apply(model, SIDES[side], values)
    return translate(model, ROBOT, payload, angles)


def test_torques_at_the_wheel_become_torques_at_the_shaft():
    unit, other = corrected("coulomb_friction", "left", torque_nm=0.05).units
    n = ROBOT.motor.gear_ratio
    assert unit.friction_forward.at(0.0) == unit.friction_backward.at(100.0) == pytest.approx(0.05 / n)
    assert other.absent


def test_rolling_resistance_is_dry_friction_of_the_shaft_and_grows_with_payload():
    light, heavy = (
        corrected("rolling_resistance", payload=kg, coefficient=0.02).units[0].friction_forward.at(0.0)
        for kg in (0.0, 2.0)
    )
    assert heavy == pytest.approx(3.0 * light)
    assert light == pytest.approx(0.02 * 1.0 * 9.80665 / 2 * 0.033 / ROBOT.motor.gear_ratio)


def test_asymmetric_friction_may_drive_in_one_direction():
    unit = corrected("friction_asymmetry", torque_nm=0.02, nm_s_per_rad=0.004).units[0]
    assert unit.friction_forward.at(0.0) == -unit.friction_backward.at(0.0) > 0.0
    for speed in (-200.0, 200.0):
        assert unit.torque.at(speed) == pytest.approx(200.0 * 0.004 / ROBOT.motor.gear_ratio**2)


def test_stribecks_curve_is_followed_between_its_points():
    unit = corrected("stribeck_friction", torque_nm=0.03, extra_torque_nm=0.05, speed_rad_s=0.4).units[0]
    n = ROBOT.motor.gear_ratio
    for w in (0.0, 0.1, 0.33, 0.7, 1.2, 5.0):
        assert n * unit.friction_forward.at(n * w) == pytest.approx(0.03 + 0.05 * math.exp(-((w / 0.4) ** 2)), abs=5e-5)


RIPPLE = {
    "amplitude_nm": 0.02,
    "cycles_per_rev": 4.37,
    "phase_rad": 0.3,
    "second_in_phase": 0.3,
    "second_in_quadrature": -0.2,
}


def test_ripple_counts_from_the_angle_at_which_the_run_begins():
    here, there = (corrected("torque_ripple", angles=(angle, 0.0), **RIPPLE) for angle in (0.0, 1.1))
    turn = there.units[0].ripple_start_rad - here.units[0].ripple_start_rad
    assert math.remainder(turn - 4.37 * 1.1, 2 * math.pi) == pytest.approx(0.0, abs=1e-12)
    assert here.units[0].ripple_periods_per_rad * 2 * math.pi * ROBOT.motor.gear_ratio == pytest.approx(4.37)


def test_viscous_friction_that_takes_all_of_the_nominal_away_leaves_a_motor_the_unit_holds():
    motor = corrected("viscous_friction", nm_s_per_rad=-0.4).units[0].motor
    assert 0.0 < motor.viscous_friction_nm_s_per_rad < 1e-6 * ROBOT.motor.viscous_friction_nm_s_per_rad


def test_a_delay_is_whole_steps():
    assert corrected("command_delay", seconds=0.0123456).supply.command_delay_s == pytest.approx(0.01235, abs=1e-9)


def test_a_single_axis_is_refused():
    model = nominal_model(ROBOT)
    model.put("axis", 1.0)
    with pytest.raises(InputError, match="single axis"):
        translate(model, ROBOT)
    model = nominal_model(ROBOT)
    model.put("mode", 2.0)
    with pytest.raises(InputError, match="drives by voltage"):
        translate(model, replace(ROBOT, name="servo"))
