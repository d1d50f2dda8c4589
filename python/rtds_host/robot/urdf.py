"""URDF of the robot, generated from the same figures as everything else (`robot.toml`)."""

from __future__ import annotations

from dataclasses import dataclass

from rtds_host.errors import InputError
from rtds_host.robot.body import CASTER_X_M, SKID_RADIUS_M, Body

WHEEL_JOINTS = ("wheel_left_joint", "wheel_right_joint")


@dataclass(frozen=True)
class BaseInertia:
    """The base link: everything but the wheels, payload included. SI, centre of mass from the body's origin."""

    mass_kg: float
    com_m: tuple[float, float, float]
    inertia_kg_m2: tuple[float, float, float]


def base_inertia(body: Body) -> BaseInertia:
    """What is left for the base link once the wheels are taken out, so that mass, centre of mass and yaw inertia of
    the whole are those of `robot.toml`.

    Raises
    ------
    InputError : the wheels alone already have more yaw inertia than the robot.
    """
    wheel = body.wheel_mass_kg
    mass = body.mass_kg - 2.0 * wheel + body.payload_kg
    total = body.total_mass_kg
    height = 0.5 * sum(body.wheel_radius_m)
    com = (
        total * body.com_m[0] / mass,
        total * body.com_m[1] / mass,
        (total * body.com_m[2] - 2.0 * wheel * height) / mass,
    )
    # Each wheel is a disc that stands upright: m r^2/4 about the vertical through its centre.
    upright = 0.5 * body.wheel_inertia_kg_m2
    yaw = body.yaw_inertia_kg_m2 - 2.0 * (wheel * (0.5 * body.track_width_m) ** 2 + upright)
    # The payload adds no yaw inertia of its own; the robot's is given about the axle's mid-point.
    yaw -= body.mass_kg / total * mass * (com[0] ** 2 + com[1] ** 2)
    if yaw <= 0:
        raise InputError(f"robot: yaw_inertia_kg_m2 {body.yaw_inertia_kg_m2:g} is less than the wheels' alone")
    # Roll and pitch play no part: three points of support hold the body on the plane.
    return BaseInertia(mass_kg=mass, com_m=com, inertia_kg_m2=(yaw, yaw, yaw))


def yaw_inertia_kg_m2(body: Body) -> float:
    """Yaw inertia about the axle's mid-point of all that an engine builds, payload included."""
    base = body.mass_kg - 2.0 * body.wheel_mass_kg + body.payload_kg
    total = body.total_mass_kg
    # Steiner's term of the payload's share, which `Body.yaw_inertia_kg_m2` does not hold.
    return body.yaw_inertia_kg_m2 + body.payload_kg * total * (body.com_m[0] ** 2 + body.com_m[1] ** 2) / base


def supports(body: Body) -> list[tuple[str, float]]:
    """Frictionless points of support: name and x [m]. Skids stand fore and aft of the centre of mass; the caster is the
    Turtlebot3's own, behind the axle alone.
    """
    if body.support == "caster":
        return [("caster", CASTER_X_M)]
    return [("skid_front", body.com_m[0] + body.skid_arm_m), ("skid_rear", body.com_m[0] - body.skid_arm_m)]


def make_urdf(body: Body) -> str:
    """The robot as URDF text. Wheels collide as spheres of their radius: one contact point at the right place."""
    base = base_inertia(body)

    def vector(values) -> str:
        return " ".join(f"{value:.12g}" for value in values)

    def inertial(mass: float, origin, moments) -> str:
        return (
            f'    <inertial><origin xyz="{vector(origin)}"/><mass value="{mass:.12g}"/>'
            f'<inertia ixx="{moments[0]:.12g}" iyy="{moments[1]:.12g}" izz="{moments[2]:.12g}" '
            'ixy="0" ixz="0" iyz="0"/></inertial>\n'
        )

    text = [
        '<?xml version="1.0"?>\n<robot name="burger">\n',
        '  <link name="base">\n',
        inertial(base.mass_kg, base.com_m, base.inertia_kg_m2),
    ]
    text.append("  </link>\n")
    for name, x in supports(body):
        # A link of its own gives it a friction of its own; its mass is negligible next to the robot's.
        text.append(
            f'  <link name="{name}">\n    <inertial><mass value="1e-9"/><inertia ixx="1e-15" iyy="1e-15" '
            'izz="1e-15" ixy="0" ixz="0" iyz="0"/></inertial>\n'
            f'    <collision><geometry><sphere radius="{SKID_RADIUS_M:g}"/></geometry></collision>\n'
            "  </link>\n"
            f'  <joint name="{name}_joint" type="fixed"><parent link="base"/><child link="{name}"/>'
            f'<origin xyz="{vector((x, body.com_m[1], SKID_RADIUS_M))}"/></joint>\n'
        )
    for joint, side, radius in zip(WHEEL_JOINTS, (0.5, -0.5), body.wheel_radius_m, strict=True):
        link = joint.removesuffix("_joint")
        moments = (0.5 * body.wheel_inertia_kg_m2, body.wheel_inertia_kg_m2, 0.5 * body.wheel_inertia_kg_m2)
        text.append(
            f'  <link name="{link}">\n'
            + inertial(body.wheel_mass_kg, (0, 0, 0), moments)
            + f'    <collision><geometry><sphere radius="{radius:.12g}"/></geometry></collision>\n  </link>\n'
            f'  <joint name="{joint}" type="continuous"><parent link="base"/><child link="{link}"/>'
            f'<origin xyz="{vector((0, side * body.track_width_m, radius))}"/><axis xyz="0 1 0"/>'
            '<dynamics damping="0" friction="0"/></joint>\n'
        )
    text.append("</robot>\n")
    return "".join(text)
