"""Worlds for Webots: what the reader of world files accepts, with the figures of `robot.toml`."""

import math

import numpy as np
import pytest
from wbt import WorldError, read_world, robot_of

from rtds_host.contract import GRAVITY_M_S2, builtin_robot, builtin_robots
from rtds_host.robot import make_body
from rtds_host.robot.urdf import yaw_inertia_kg_m2
from rtds_host.webots import names
from rtds_host.webots.world import axis_angle, ground_rotation, make_world, rotation_of

SLOPES = {"linear": (2.0, 0.1, math.pi), "circle": (2.0, 0.1, 0.5 * math.pi), "eight": (0.0, 0.1, math.pi)}
START = (0.3, -1.0, 0.4)


def world_of(robot, scenario="linear", pose=START):
    body = make_body(robot, *SLOPES[scenario])
    return body, make_world(robot, body, pose, scenario, 2)


@pytest.mark.parametrize("scenario", SLOPES)
@pytest.mark.parametrize("name", builtin_robots())
def test_a_world_has_the_masses_inertias_places_and_slope_of_the_robot(mock, name, scenario):
    body, text = world_of(builtin_robot(name), scenario)
    found, pose = mock.body_of(read_world(text))
    assert found.total_mass_kg == pytest.approx(body.total_mass_kg)
    assert found.com_m == pytest.approx(body.com_m)
    assert found.yaw_inertia_kg_m2 == pytest.approx(yaw_inertia_kg_m2(body))
    assert found.wheel_radius_m == pytest.approx(body.wheel_radius_m)
    assert found.wheel_inertia_kg_m2 == pytest.approx(body.wheel_inertia_kg_m2)
    assert found.track_width_m == pytest.approx(body.track_width_m)
    assert (found.tyre_friction, found.skid_arm_m) == pytest.approx((body.tyre_friction, body.skid_arm_m))
    assert found.slope_rad == pytest.approx(body.slope_rad)
    assert math.remainder(found.uphill_yaw_rad - body.uphill_yaw_rad, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert pose == pytest.approx(START)


def test_gravity_of_the_tilted_ground_is_that_of_the_other_engines():
    for payload, slope, uphill in SLOPES.values():
        body = make_body(builtin_robot("burger"), payload, slope, uphill)
        down = ground_rotation(slope, uphill).T @ np.array([0.0, 0.0, -GRAVITY_M_S2])
        assert down == pytest.approx(body.gravity_m_s2)


def test_a_world_has_the_devices_the_controller_asks_for():
    robot = builtin_robot("burger")
    nodes = read_world(world_of(robot)[1])
    node = robot_of(nodes)
    for joint, motor, sensor in zip(node.all("HingeJoint"), names.WHEEL_MOTORS, names.WHEEL_SENSORS, strict=True):
        assert [one["name"] for one in joint["device"]] == [motor, sensor]
        # A positive angle rolls the robot forward, along its x.
        assert joint["jointParameters"]["axis"] == (0.0, 1.0, 0.0)
        no_load = robot.supply_v / (robot.motor.gear_ratio * robot.motor.back_emf_constant_v_s_per_rad)
        assert joint["device"][0]["maxVelocity"] == pytest.approx(10.0 * no_load)
    assert [one["name"] for one in node.all("GPS") + node.all("Gyro")] == [names.GPS, names.GYRO]
    assert node["controller"] == names.CONTROLLER and node["customData"] == "linear" and node["supervisor"]
    assert nodes[0]["basicTimeStep"] == 2.0


def test_bodies_at_rest_are_not_put_to_sleep():
    world = read_world(world_of(builtin_robot("burger"))[1])[0]
    assert world["physicsDisableLinearThreshold"] == world["physicsDisableAngularThreshold"] == 0.0


def test_a_robot_of_any_name_makes_a_world_that_can_be_read():
    from dataclasses import replace

    name = 'a "robot" \\ with # and { in its name'
    text = world_of(replace(builtin_robot("burger"), name=name))[1]
    assert read_world(text)[0]["title"] == f"{name}: linear"


@pytest.mark.parametrize(
    ("wrong", "right", "said"),
    [
        ("  maxTorque", "  maxTorqe", "no field 'maxTorqe'"),
        ("RotationalMotor {", "RotaryMotor {", "no node"),
        ("density -1", "density 1000", "density must be -1"),
        ("mass ", "mass -", "density must be -1"),
        ('name "gyro" }', 'name "gyro"', "ends within a node|no field"),
        ("#VRML_SIM R2023b utf8", "#VRML V2.0 utf8", "release"),
        ("axis 0 1 0", "axis 0 2 0", "no unit vector"),
        ("anchor 0 0.08 0.033", "anchor 0 0.09 0.033", "anchor"),
        ("supervisor TRUE", "supervisor yes", "TRUE or FALSE"),
        ("gravity 9.80665", "gravity nan", "finite"),
        ("right wheel sensor", "left wheel sensor", "two devices"),
        ("boundingObject Sphere { radius 0.033 }", "", "without a bounding object"),
    ],
)
def test_the_reader_refuses_a_world_that_webots_would_not_load(wrong, right, said):
    text = world_of(builtin_robot("burger"))[1]
    assert wrong in text
    with pytest.raises(WorldError, match=said):
        read_world(text.replace(wrong, right))


def test_axis_and_angle_give_back_any_rotation():
    rng = np.random.default_rng(5)
    for angle in (0.0, 1e-9, 0.3, 0.5 * math.pi, 3.0, math.pi):
        for _ in range(20):
            axis = rng.normal(size=3)
            rotation = rotation_of(axis / np.linalg.norm(axis), angle)
            found = axis_angle(rotation)
            assert rotation_of(found[:3], found[3]) == pytest.approx(rotation, abs=1e-7)
