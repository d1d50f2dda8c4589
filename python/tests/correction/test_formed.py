"""Forms in the real-time simulator: in the units' tables, between units and engine, and in the sensors."""

from dataclasses import replace

import numpy as np
import pytest

from rtds_host.contract import Case, builtin_robot
from rtds_host.correction.close import FINE_STEP_S, distance
from rtds_host.correction.formed import beyond, needs_command
from rtds_host.correction.simulate import Setting, simulate
from rtds_host.correction.translate import translate
from rtds_host.diagnosis.forms.curves import points_of, put
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.errors import InputError
from rtds_host.motor.effects import Curve
from rtds_host.plant import forms as plant
from rtds_host.run.path import Sample
from rtds_host.run.sensors import CorrectedPath
from rtds_host.studies.agreement import designed_run, measured

ROBOT = builtin_robot("burger")
TURN = plant.FULL_TURN


def formed(*each):
    """The nominal model with forms (term, over, low, high, law, time constant of a heat) on both sides."""
    model = nominal_model(ROBOT)
    for term, over, low, high, law, *tau in each:
        put(model, (0, 1), term, over, low, high, law(points_of(over, low, high)), *tau)
    return model


# Three forms at a time: a robot holds no more on a side.
TOGETHER = {
    "body": [
        ("force", "x", -1.0, 1.0, lambda x: -2.0 * np.tanh(6.0 * (x - 0.3))),
        ("yaw_torque", "yaw_rate", -4.0, 4.0, lambda x: -0.02 * np.sign(x) - 0.01 * x),
        ("torque", "t", 0.0, 2.0, lambda x: -0.05 + 0.05 * x),
    ],
    "motor": [
        ("torque_constant", "i", -0.3, 0.3, lambda x: -0.5 * np.abs(x)),
        ("voltage", "t", 0.0, 2.0, lambda x: -1.0 * x),
        ("current_sensor", "i", -0.3, 0.3, lambda x: 0.2 * x),
    ],
    "history": [
        ("voltage", "command_history", -12.0, 12.0, lambda x: -0.4 * np.sign(x) - 0.03 * x),
        ("torque", "load", -0.4, 0.4, lambda x: -0.2 * np.abs(x) + 0.1 * x),
        ("voltage", "t", 0.0, 2.0, lambda x: -0.2 * x),
    ],
    "heat": [
        ("voltage", "heat", 0.0, 0.03, lambda x: -10.0 * x, 0.5),
        ("torque_constant", "heat", 0.0, 0.03, lambda x: -5.0 * x, 1.0),
        ("torque", "heat", 0.0, 0.03, lambda x: -1.0 * x, 0.3),
    ],
    "grease": [
        ("damping", "t", 0.0, 2.0, lambda x: 0.03 * np.exp(-2.0 * x)),
        ("damping", "heat", 0.0, 0.03, lambda x: -0.1 * x, 0.3),
    ],
    "warm driver": [("voltage", "heat", 0.0, 0.03, lambda x: -10.0 * x, 0.5)],
    "constant": [("torque_constant", "i", -0.3, 0.3, lambda x: -0.5 * np.abs(x))],
    "load": [("torque", "load", -0.4, 0.4, lambda x: -0.3 * np.abs(x))],
    "heading": [
        ("force", "yaw", 0.0, TURN, lambda x: 3.0 * np.cos(x - 0.5)),
        ("gyro_sensor", "t", 0.0, 2.0, lambda x: 0.05 * x),
        ("voltage", "th", 0.0, TURN, lambda x: 0.4 * np.sin(x)),
    ],
    "tables": [
        ("voltage", "i", -0.3, 0.3, lambda x: -0.5 * np.tanh(x / 0.05)),
        ("torque", "motor_angle", 0.0, TURN, lambda x: 0.03 * np.sin(x + 0.4)),
        ("torque", "th", 0.0, TURN, lambda x: 0.03 * np.sin(2.0 * x)),
    ],
}


@pytest.mark.parametrize("which", TOGETHER)
def test_forms_run_in_the_simulator_as_in_the_replay(which):
    log = designed_run(1.5)
    model, inputs = formed(*TOGETHER[which]), run_inputs(log, ROBOT)
    truth, plain = (replay_run(one, inputs, FINE_STEP_S) for one in (model, nominal_model(ROBOT)))
    out = simulate(log, ROBOT, model, Setting()).out
    log = measured(log, truth)
    case = Case("formed", ROBOT, (log,))
    moved, _ = distance(case, [(log, truth, plain)])
    apart, _ = distance(case, [(log, truth, out)])
    print(f"{which}: apart by {apart / moved:.4f} of what the forms move", flush=True)
    assert moved > 1.0
    assert apart < 0.02 * moved


def test_a_second_torque_over_an_angle_acts_between_units_and_engine():
    correction = translate(formed(*TOGETHER["tables"]), ROBOT)
    left = correction.units[0]
    assert left.ripple_periods_per_rad == pytest.approx(1.0 / TURN)
    assert left.ripple.at(0.0) == pytest.approx(0.03 * np.sin(0.4) / ROBOT.motor.gear_ratio)
    assert left.drop.at(0.3) == pytest.approx(0.5, rel=1e-3)
    rows = correction.forms[0]
    assert rows[rows[:, plant.TERM] > 0.0][:, plant.OVER].tolist() == [plant.OVER_CODE["th"]]


def test_a_voltage_that_falls_with_the_current_faster_than_the_winding_takes_it_is_in_no_table():
    steep = formed(("voltage", "i", -0.3, 0.3, lambda x: 2.0 * ROBOT.motor.resistance_ohm * x))
    correction = translate(steep, ROBOT)
    assert correction.units[0].drop is None
    assert correction.forms[0, 0, plant.TERM] == plant.TERM_CODE["voltage"]


def test_a_command_goes_on_beyond_the_supply_by_what_a_form_adds():
    curve = beyond(Curve((-12.0, 12.0), (-6.0, 6.0)), 12.0, 1.5)
    assert curve.at(12.0) == 6.0
    assert curve.at(13.5) == 7.5
    assert curve.at(-20.0) == -7.5
    model = formed(("voltage", "t", 0.0, 2.0, lambda x: -1.5 * x))
    assert needs_command(model.forms[0], 12.0) == pytest.approx(3.0)
    weaker = formed(("torque_constant", "i", -0.3, 0.3, lambda x: -0.5 * np.abs(x)))
    assert needs_command(weaker.forms[0], 12.0) == pytest.approx(1.8)


def test_a_voltage_over_time_behind_a_driver_that_turns_back_is_refused_in_one_line():
    model = formed(("voltage", "t", 0.0, 2.0, lambda x: -x))
    model.add("pwm_curve", 3.0)
    log = designed_run(0.1)
    with pytest.raises(InputError, match="forms: a voltage over more than the command"):
        simulate(log, ROBOT, model, Setting())


def test_sensors_of_a_run_read_with_their_forms():
    model = formed(
        ("speed_sensor", "w", -20.0, 20.0, lambda x: 0.1 * x),
        ("gyro_sensor", "yaw_rate", -4.0, 4.0, lambda x: 0.2 * np.abs(x)),
    )
    sensors = translate(model, ROBOT).sensors
    seen = Sample(12.0, np.array([0.1, 0.2]), np.array([5.0, -5.0]), np.zeros(2), -1.0, 0.0, 0.0, 0.0)
    path = CorrectedPath(12.0, sensors)
    read = path.sensors(0.0, seen)
    assert read.speeds_rad_s == pytest.approx([5.5, -5.5])
    assert read.gyro_rad_s == pytest.approx(-0.8)
    assert read.currents_a == pytest.approx([0.1, 0.2])
    assert CorrectedPath(12.0, replace(sensors, forms=plant.no_forms())).sensors(0.0, seen).gyro_rad_s == -1.0


@pytest.mark.parametrize(("share", "refused"), [(1.1, True), (0.3, False)])
def test_a_wheel_that_would_drive_itself_is_refused_and_one_that_its_back_emf_holds_is_not(share, refused):
    motor = ROBOT.motor
    brakes = motor.torque_constant_nm_per_a * motor.back_emf_constant_v_s_per_rad / motor.resistance_ohm
    all_of_it = motor.gear_ratio**2 * (motor.viscous_friction_nm_s_per_rad + brakes)
    model = formed(("damping", "t", 0.0, 2.0, lambda x: -share * all_of_it + 0.0 * x))
    if refused:
        with pytest.raises(InputError, match="forms: viscous friction is negative all over its curve"):
            translate(model, ROBOT)
    else:
        assert np.abs(simulate(designed_run(0.3), ROBOT, model, Setting()).out).max() < 1e3


# One of each equation. The first four are in tables of the units; the others act on units, body or readings, once a
# millisecond.
IN_RTL = {
    "friction": ("torque", "w", -25.0, 25.0, lambda x: -0.05 * np.sign(x) - 0.001 * x),
    "command": ("voltage", "v_cmd", -12.0, 12.0, lambda x: -0.02 * x * np.abs(x)),
    "drop": ("voltage", "i", -0.3, 0.3, lambda x: -0.5 * np.tanh(x / 0.05)),
    "ripple": ("torque", "motor_angle", 0.0, TURN, lambda x: 0.03 * np.sin(x + 0.4)),
    "constant": ("torque_constant", "i", -0.3, 0.3, lambda x: -0.5 * np.abs(x)),
    "history": ("voltage", "command_history", -12.0, 12.0, lambda x: -0.4 * np.sign(x) - 0.03 * x),
    "load": ("torque", "load", -0.4, 0.4, lambda x: -0.3 * np.abs(x)),
    "voltage": ("voltage", "t", 0.0, 2.0, lambda x: -1.0 * x),
    "heat": ("voltage", "heat", 0.0, 0.03, lambda x: -10.0 * x, 0.5),
    "grease": ("damping", "t", 0.0, 2.0, lambda x: 0.03 * np.exp(-2.0 * x)),
    "force": ("force", "yaw", 0.0, TURN, lambda x: 3.0 * np.cos(x - 0.5)),
    "turning": ("yaw_torque", "yaw_rate", -4.0, 4.0, lambda x: -0.06 * np.sign(x) - 0.01 * x),
    "sensor": ("current_sensor", "i", -0.3, 0.3, lambda x: 0.2 * x),
}


IN_TABLES = ("friction", "command", "drop", "ripple")


@pytest.mark.long
@pytest.mark.parametrize("which", IN_RTL)
def test_a_form_closes_in_the_rtl_with_the_bytes_of_the_model(which):
    log = designed_run(0.6)
    model, inputs = formed(IN_RTL[which]), run_inputs(log, ROBOT)
    truth = replay_run(model, inputs, FINE_STEP_S)
    rtl = Setting(link="rtl", link_options={"sim": "verilator", "step_clocks": "min"})
    by_rtl, by_model = (simulate(log, ROBOT, model, setting).out for setting in (rtl, Setting()))
    assert by_rtl.tobytes() == by_model.tobytes()
    nominal = simulate(log, ROBOT, None, Setting()).out
    log = measured(log, truth)
    case = Case("formed", ROBOT, (log,))
    before, after = (distance(case, [(log, truth, out)])[0] for out in (nominal, by_rtl))
    print(f"{which}: gap before {before:.3g}, after {after:.2g}", flush=True)
    assert before > 1.0
    assert after < (0.02 if which in IN_TABLES else 0.03) * before
