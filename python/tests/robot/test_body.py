"""The body is taken from robot.toml once, and the coupling's stability is judged before anything moves."""

import math
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from rtds_host.contract import load_robot
from rtds_host.errors import InputError
from rtds_host.robot import inertia_at_wheel_kg_m2, make_body, make_urdf


def links_of(body):
    """name -> (mass, centre of mass in the robot's frame, izz, iyy) of every link of the URDF."""
    root = ET.fromstring(make_urdf(body))
    place = {"base": np.zeros(3)}
    for joint in root.findall("joint"):
        place[joint.find("child").get("link")] = np.fromstring(joint.find("origin").get("xyz"), sep=" ")
    found = {}
    for link in root.findall("link"):
        inertial = link.find("inertial")
        origin = inertial.find("origin")
        own = np.fromstring(origin.get("xyz"), sep=" ") if origin is not None else np.zeros(3)
        inertia = inertial.find("inertia")
        found[link.get("name")] = (
            float(inertial.find("mass").get("value")),
            place[link.get("name")] + own,
            float(inertia.get("izz")),
            float(inertia.get("iyy")),
        )
    return found


@pytest.mark.parametrize("payload", [0.0, 2.0])
def test_urdf_has_the_mass_centre_and_yaw_inertia_of_robot_toml(burger, payload):
    links = links_of(make_body(burger, payload_kg=payload))
    mass = sum(one[0] for one in links.values())
    centre = sum(one[0] * one[1] for one in links.values()) / mass
    chassis = burger.chassis
    yaw = sum(m * (at[0] ** 2 + at[1] ** 2) + izz for m, at, izz, _ in links.values())
    assert mass == pytest.approx(chassis.mass_kg + payload, rel=1e-7)
    assert centre == pytest.approx([chassis.com_x_m, chassis.com_y_m, chassis.com_z_m], abs=1e-7)
    assert yaw == pytest.approx(chassis.yaw_inertia_kg_m2, rel=1e-6), "the payload adds no yaw inertia"
    for side in ("left", "right"):
        assert links[f"wheel_{side}"][3] == pytest.approx(chassis.wheel_inertia_kg_m2, rel=1e-9)


def test_urdf_follows_robot_toml(tmp_path, burger):
    from rtds_host.contract import builtin_robot_path

    text = builtin_robot_path("burger").read_text().replace("wheel_radius_m = 0.033", "wheel_radius_m = 0.040")
    text = text.replace("track_width_m = 0.160", "track_width_m = 0.200")
    (tmp_path / "robot.toml").write_text(text)
    urdf = make_urdf(make_body(load_robot(tmp_path / "robot.toml")))
    assert '<sphere radius="0.04"/>' in urdf
    assert '<origin xyz="0 0.1 0.04"/>' in urdf


def test_urdf_holds_no_damping_friction_or_rotor(burger):
    root = ET.fromstring(make_urdf(make_body(burger)))
    for joint in root.findall("joint"):
        dynamics = joint.find("dynamics")
        if joint.get("type") == "continuous":
            assert (dynamics.get("damping"), dynamics.get("friction")) == ("0", "0")
    rotor = burger.motor.gear_ratio**2 * burger.motor.rotor_inertia_kg_m2
    assert all(one[3] < 0.5 * rotor for one in links_of(make_body(burger)).values())


def test_two_skids_by_default_and_the_true_caster_by_choice(burger):
    assert {"skid_front", "skid_rear"} <= set(links_of(make_body(burger)))
    caster = links_of(make_body(burger, support="caster"))
    assert caster["caster"][1][0] == pytest.approx(-0.081)
    assert "skid_front" not in caster


def test_inertia_seen_at_the_wheel(burger):
    body = make_body(burger, payload_kg=2.0)
    assert inertia_at_wheel_kg_m2(body) == pytest.approx(3.0 * 0.033**2 / 2 + 2.07e-5, rel=1e-12)


@pytest.mark.parametrize(
    "given, words",
    [
        ({"payload_kg": -1.0}, "payload: is -1 kg"),
        ({"payload_kg": math.nan}, "payload"),
        ({"slope_rad": 1.0}, "slope"),
        ({"uphill_yaw_rad": math.inf}, "uphill"),
        ({"support": "stilts"}, "'stilts': unknown .known: skids, caster"),
    ],
)
def test_impossible_bodies_are_refused(burger, given, words):
    with pytest.raises(InputError, match=words):
        make_body(burger, **given)


def test_a_wheel_heavier_to_turn_than_the_robot_is_refused(burger):
    chassis = replace(burger.chassis, yaw_inertia_kg_m2=1e-6)
    with pytest.raises(InputError, match="yaw_inertia_kg_m2 1e-06"):
        make_urdf(make_body(replace(burger, chassis=chassis)))
