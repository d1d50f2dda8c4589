"""How large a load of an axis can turn out: by what its motor could move, whatever is declared."""

from dataclasses import replace

import pytest

from rtds_host.contract import GRAVITY_M_S2, Axis, Driver, builtin_robot
from rtds_host.diagnosis.effects import catalogue

BURGER = builtin_robot("burger")


def axis(kind, load, **driver):
    told = {"inertia": {"inertia_kg_m2": load}, "pendulum": {"mass_kg": load}, "linear": {"mass_kg": load}}[kind]
    full = {"inertia_kg_m2": 0.0, "mass_kg": 0.0, "length_m": 0.1, "metres_per_rad": 0.02, "zero_rad": 0.0, **told}
    return replace(BURGER, chassis=None, axis=Axis(kind=kind, **full), driver=Driver(**driver))


def bound(robot):
    """Upper bound of the load beyond the declared, in its own unit."""
    parameter = catalogue(robot)["payload_error"].parameters[0]
    return parameter.high * parameter.reported(robot.axis)[2]


@pytest.mark.parametrize("kind", ["inertia", "pendulum", "linear"])
@pytest.mark.parametrize("driver", [{}, {"mode": "torque", "torque_nm_per_v": 0.05}], ids=["voltage", "torque"])
def test_the_bound_is_the_motors_and_not_the_declared_loads(kind, driver):
    light, lighter = bound(axis(kind, 1e-3, **driver)), bound(axis(kind, 1e-6, **driver))
    assert light == pytest.approx(lighter) and light > 5e-3


def test_a_pendulum_may_weigh_what_its_motor_holds_level():
    motor = BURGER.motor
    stall = motor.gear_ratio * motor.torque_constant_nm_per_a * BURGER.supply_v / motor.resistance_ohm
    assert bound(axis("pendulum", 1e-3)) >= stall / (GRAVITY_M_S2 * 0.1)


def test_a_heavy_load_keeps_its_five_times_and_a_robot_its_own():
    assert bound(axis("inertia", 1e3)) == pytest.approx(5e3)
    assert catalogue(BURGER)["payload_error"].parameters[0].high == pytest.approx(5.0 * BURGER.chassis.mass_kg)


def test_a_search_starts_from_loads_far_above_the_declared_one_too():
    starts = catalogue(axis("inertia", 1e-6))["payload_error"].parameters[0].starts
    assert max(starts) > 30.0 and len(starts) == len(catalogue(BURGER)["payload_error"].parameters[0].starts) + 1
