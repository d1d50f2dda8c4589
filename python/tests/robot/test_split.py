"""Who carries the body's inertia, and that whatever comes back late dies out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from rtds_host.robot import make_body, make_split
from rtds_host.robot.split import share, wheel_inertia
from rtds_host.robot.urdf import yaw_inertia_kg_m2


def lighter(robot, times):
    """The robot with a rotor so many times lighter."""
    return replace(robot, motor=replace(robot.motor, rotor_inertia_kg_m2=robot.motor.rotor_inertia_kg_m2 / times))


def growth(robot, body, carried, interval_s):
    """Spectral radius of an exchange: motors of (i, w) with their torques held, which the body answers with one
    exchange later; both sides coupled through the body, the motors' exact solution, no voltage."""
    motor, n = robot.motor, robot.motor.gear_ratio
    inertia = motor.rotor_inertia_kg_m2 + carried / n**2
    a = np.array(
        [
            [
                -motor.resistance_ohm / motor.inductance_h,
                -motor.back_emf_constant_v_s_per_rad / motor.inductance_h,
                0.0,
            ],
            [motor.torque_constant_nm_per_a / inertia, -motor.viscous_friction_nm_s_per_rad / inertia, -1.0 / inertia],
            [0.0, 0.0, 0.0],
        ]
    )
    step = expm(interval_s * a)
    whole = wheel_inertia(body, yaw_inertia_kg_m2(body))[0] + body.wheel_inertia_kg_m2 * np.eye(2)
    back = (whole - carried * np.eye(2)) / n**2 / interval_s
    # State: i, w, T of the left, then of the right.
    matrix = np.kron(np.eye(2), np.vstack([step[:2], np.zeros(3)]))
    gained = np.vstack([matrix[1] - np.eye(6)[1], matrix[4] - np.eye(6)[4]])
    matrix[[2, 5]] = back @ gained
    return np.abs(np.linalg.eigvals(matrix)).max()


def test_a_body_light_next_to_its_rotors_is_the_engines_alone(burger):
    split = make_split(burger, make_body(burger, payload_kg=2.0))
    assert split.ratio == pytest.approx(0.2476, abs=1e-4)
    assert split.reflected_kg_m2 == 0.0 and split.motor(burger.motor) is burger.motor
    assert make_split(burger, make_body(burger, payload_kg=8.7)).reflected_kg_m2 == 0.0
    assert make_split(burger, make_body(burger, payload_kg=9.0)).reflected_kg_m2 > 0.0


def test_a_heavier_body_is_carried_in_the_mean_of_driving_and_turning(burger):
    body = make_body(burger, payload_kg=14.0)
    split = make_split(burger, body)
    straight, turning = 0.5 * 15.0 * 0.033**2, 2.0 * 2.5e-3 * 0.033**2 / 0.160**2
    assert split.ratio == pytest.approx((straight + 2.07e-5) / (258.5**2 * 1e-7))
    assert split.reflected_kg_m2 == pytest.approx(0.5 * (straight + turning) + 2.07e-5)
    n2 = burger.motor.gear_ratio**2
    assert n2 * split.motor(burger.motor).rotor_inertia_kg_m2 == pytest.approx(n2 * 1e-7 + split.reflected_kg_m2)


@pytest.mark.parametrize("times", [4.0, 20.0, 1e3, 1e6])
@pytest.mark.parametrize("interval_s", [0.001, 0.002, 0.032, 0.128])
@pytest.mark.parametrize("com", [(0.0, 0.0), (0.03, 0.0), (-0.03, 0.02)])
def test_what_comes_back_late_dies_out_whatever_the_gear(burger, times, interval_s, com):
    robot = lighter(burger, times)
    robot = replace(robot, chassis=replace(robot.chassis, com_x_m=com[0], com_y_m=com[1]))
    body = make_body(robot, payload_kg=2.0)
    split = make_split(robot, body)
    assert split.ratio > 0.8 and split.returned < 1.0
    assert growth(robot, body, split.reflected_kg_m2, interval_s) < 1.0


def test_without_it_the_exchange_grows_above_a_ratio_of_one(burger):
    for payload, grows in ((2.0, False), (8.7, False), (14.0, True)):
        body = make_body(burger, payload_kg=payload)
        assert (growth(burger, body, 0.0, 0.001) > 1.0) == grows


@pytest.mark.parametrize("seed", range(20))
def test_any_inertia_of_two_wheels_is_shared_so_that_less_than_all_comes_back(seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(2, 2)) * 10.0 ** rng.uniform(-3, 3, size=(2, 1))
    whole = root @ root.T
    split = share(whole, rotor=1e-6 * np.trace(whole))
    late = np.linalg.eigvalsh(whole - split.reflected_kg_m2 * np.eye(2)) / (
        1e-6 * np.trace(whole) + split.reflected_kg_m2
    )
    assert np.abs(late).max() == pytest.approx(split.returned, rel=1e-9)
    assert split.returned < 1.0
