"""Controllers against the motor they invert."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from rtds_host.contract import builtin_robot
from rtds_host.control import CONTROLLERS, Observation, make_controller
from rtds_host.errors import InputError

MOTOR = builtin_robot("burger").motor


class ExactMotors:
    """Two motors, exactly, inputs held; a torque may act that nobody is told of."""

    def __init__(self, motor=MOTOR, hidden_nm=0.0):
        r, l, km, kb = (
            motor.resistance_ohm,
            motor.inductance_h,
            motor.torque_constant_nm_per_a,
            motor.back_emf_constant_v_s_per_rad,
        )
        j, b = motor.rotor_inertia_kg_m2, motor.viscous_friction_nm_s_per_rad
        self.generator = np.block(
            [[np.array([[-r / l, -kb / l], [km / j, -b / j]]), np.diag([1 / l, -1 / j])], [np.zeros((2, 4))]]
        )
        self.state, self.hidden = np.zeros((2, 2)), hidden_nm

    def hold(self, volts, torques, seconds):
        step = expm(seconds * self.generator)
        self.state = np.array(
            [
                step[:2, :2] @ x + step[:2, 2:] @ [v, t + self.hidden]
                for x, v, t in zip(self.state, volts, torques, strict=True)
            ]
        )

    def seen(self, torques):
        return Observation(self.state[:, 1], self.state[:, 0], np.asarray(torques, dtype=float))


def follow(controller, motors, reference, interval, torques=(0.0, 0.0), parts=32):
    """Speeds (n, 2) at `parts` times in each interval, and the reference there."""
    speeds, asked = [], []
    for k in range(len(reference) - 1):
        volts = controller.command(motors.seen(torques), reference[k], reference[k + 1], interval)
        for part in range(parts):
            motors.hold(volts, torques, interval / parts)
            speeds.append(motors.state[:, 1])
            asked.append(reference[k] + (part + 1) / parts * (reference[k + 1] - reference[k]))
    return np.array(speeds), np.array(asked)


def ramp(count, slope, interval):
    """A reference (n, 2) that rises by `slope` rad/s^2 at the shaft, the right one half as fast."""
    return np.arange(count)[:, None] * interval * slope * np.array([1.0, 0.5])


def test_exact_hits_a_steady_reference_from_any_state():
    motors, controller = ExactMotors(), make_controller("exact", MOTOR, 12.0)
    motors.state = np.array([[0.05, 300.0], [-0.02, 280.0]])
    wanted = np.array([320.0, 300.0])
    torques = np.array([2e-4, -1e-4])
    motors.hold(controller.command(motors.seen(torques), wanted, wanted, 0.032), torques, 0.032)
    assert motors.state[:, 1] == pytest.approx(wanted, abs=1e-9)


def test_exact_keeps_its_error_on_a_ramp_on_both_sides_of_zero():
    motors, controller = ExactMotors(), make_controller("exact", MOTOR, 12.0)
    speeds, asked = follow(controller, motors, ramp(30, 400.0, 0.032), 0.032)
    error = (speeds - asked)[-5 * 32 :]
    assert np.abs(error.mean(axis=0)).max() < 0.05 * np.sqrt((error**2).mean(axis=0)).max()


def test_paper_inverts_one_step_of_backward_euler():
    """The voltage, put into the difference equation it came from, gives the speed that was asked for."""
    controller = make_controller("paper", MOTOR, 1e9)
    h, m = 0.128, MOTOR
    seen = Observation(np.array([200.0, -50.0]), np.array([0.03, -0.01]), np.array([1e-4, 2e-4]))
    wanted = np.array([250.0, -80.0])
    volts = controller.command(seen, wanted, wanted, h)
    for side in range(2):
        matrix = np.eye(2) - h * np.array(
            [
                [-m.resistance_ohm / m.inductance_h, -m.back_emf_constant_v_s_per_rad / m.inductance_h],
                [
                    m.torque_constant_nm_per_a / m.rotor_inertia_kg_m2,
                    -m.viscous_friction_nm_s_per_rad / m.rotor_inertia_kg_m2,
                ],
            ]
        )
        right = [
            seen.currents_a[side] + h * volts[side] / m.inductance_h,
            seen.speeds_rad_s[side] - h * seen.torques_nm[side] / m.rotor_inertia_kg_m2,
        ]
        assert np.linalg.solve(matrix, right)[1] == pytest.approx(wanted[side], rel=1e-9)


def test_paper_uses_the_interval_that_was_measured():
    controller = make_controller("paper", MOTOR, 12.0)
    seen = Observation(np.zeros(2), np.zeros(2), np.zeros(2))
    wanted = np.array([100.0, 100.0])
    assert controller.command(seen, wanted, wanted, 0.128)[0] < controller.command(seen, wanted, wanted, 0.064)[0]


def test_exact_is_ten_times_better_than_paper_on_a_ramp_each_at_its_interval():
    errors = {}
    for name, interval in CONTROLLERS.items():
        count = round(2.048 / interval) + 1
        speeds, asked = follow(
            make_controller(name, MOTOR, 12.0),
            ExactMotors(),
            ramp(count, 400.0, interval),
            interval,
            parts=round(interval / 1e-3),
        )
        errors[name] = np.sqrt(((speeds - asked) ** 2).mean())
    assert errors["paper"] > 10.0 * errors["exact"]


@pytest.mark.parametrize("name", CONTROLLERS)
def test_voltage_stays_within_the_supply(name):
    controller = make_controller(name, MOTOR, 12.0)
    seen = Observation(np.zeros(2), np.zeros(2), np.zeros(2))
    volts = controller.command(seen, np.zeros(2), np.array([1e5, -1e5]), 0.032)
    assert volts.tolist() == [12.0, -12.0]


def test_exact_finds_a_torque_nobody_told_it_of():
    """Without the estimate 2e-4 N m (Coulomb friction's size) would leave a steady error of several rad/s."""
    motors, controller = ExactMotors(hidden_nm=2e-4), make_controller("exact", MOTOR, 12.0)
    speeds, _ = follow(controller, motors, np.full((60, 2), 300.0), 0.032, parts=1)
    assert speeds[-1] == pytest.approx([300.0, 300.0], abs=1e-6)


def test_exact_withstands_a_motor_that_is_not_the_nominal_one():
    weak = replace(MOTOR, torque_constant_nm_per_a=0.9 * MOTOR.torque_constant_nm_per_a, resistance_ohm=9.5)
    speeds, _ = follow(
        make_controller("exact", MOTOR, 12.0), ExactMotors(weak), np.full((80, 2), 300.0), 0.032, parts=1
    )
    assert speeds[-1] == pytest.approx([300.0, 300.0], abs=1e-3)


def test_unknown_controller_is_named():
    with pytest.raises(InputError, match="controller 'fuzzy': unknown .known: exact, paper"):
        make_controller("fuzzy", MOTOR, 12.0)
