"""A world of Webots (.wbt) with the robot of `robot.toml` on its slope.

Nodes and fields are those of Webots' reference manual. Gravity points down in Webots, so that the ground is tilted;
the robot's axes are x forward, y to the left, z up (ENU, the default since R2022a). Wheels collide as spheres of their
radius and the base as two frictionless skids, as in the other engines (docs/robot.md).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtds_host.contract import GRAVITY_M_S2, Motor, Robot
from rtds_host.robot import Body
from rtds_host.robot.body import SKID_RADIUS_M
from rtds_host.robot.urdf import base_inertia, supports
from rtds_host.webots.names import CONTROLLER, GPS, GYRO, WHEEL_MOTORS, WHEEL_SENSORS

# The first release that has every node used here (Pose came with it).
RELEASE = "R2023b"
# The wheels' speeds are given. Both limits lie where no run on the ground gets: of the no-load speed, of the stall
# torque.
SPEED_MARGIN = 10.0
TORQUE_MARGIN = 10.0
# The camera looks along y and down.
VIEW_FROM_M = (0.0, -3.0, 1.5)
VIEW_DOWN_RAD = 0.4
GROUND_SIZE_M = (30.0, 30.0, 1.0)
# Constraint force mixing of ODE, which lets a tyre creep: a hundredth of Webots' defaults.
WORLD_CFM = 1e-7
CONTACT_CFM = 1e-5


@dataclass(frozen=True)
class Limits:
    """Limits of a wheel's motor in the world, rad/s and N m."""

    speed_rad_s: float
    torque_nm: float


def limits_of(motor: Motor, supply_v: float) -> Limits:
    """The limits that a world gives to the motors of its wheels."""
    no_load = supply_v / (motor.gear_ratio * motor.back_emf_constant_v_s_per_rad)
    stall = motor.gear_ratio * motor.torque_constant_nm_per_a * supply_v / motor.resistance_ohm
    return Limits(SPEED_MARGIN * no_load, TORQUE_MARGIN * stall)


def ground_rotation(slope_rad: float, uphill_yaw_rad: float) -> np.ndarray:
    """Rotation (3, 3) from the ground's axes to the world's: the ground rises along `uphill_yaw_rad`."""
    return rotation_of(ground_axis(uphill_yaw_rad), slope_rad)


def ground_axis(uphill_yaw_rad: float) -> np.ndarray:
    """Unit axis (3,) about which the ground is tilted."""
    return np.array([math.sin(uphill_yaw_rad), -math.cos(uphill_yaw_rad), 0.0])


def rotation_of(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross


def axis_angle(rotation: np.ndarray) -> np.ndarray:
    """Axis and angle (4,) of a rotation (3, 3), by its quaternion; about z where it does not turn at all."""
    # The largest of the four components is found first: none is divided by a small number (Shepperd 1978).
    m = rotation
    four = np.array([m.trace(), 2.0 * m[0, 0] - m.trace(), 2.0 * m[1, 1] - m.trace(), 2.0 * m[2, 2] - m.trace()])
    k = int(np.argmax(four))
    largest = 0.5 * math.sqrt(1.0 + four[k])
    skew = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    if k == 0:
        quaternion = np.array([largest, *(skew / (4.0 * largest))])
    else:
        i = k - 1
        quaternion = np.array([skew[i], *(m[i] + m[:, i])]) / (4.0 * largest)
        quaternion[k] = largest
    if quaternion[0] < 0.0:
        quaternion = -quaternion
    length = float(np.linalg.norm(quaternion[1:]))
    if length == 0.0:
        return np.array([0.0, 0.0, 1.0, 0.0])
    return np.array([*(quaternion[1:] / length), 2.0 * math.atan2(length, quaternion[0])])


def _vector(values: Sequence[float] | np.ndarray) -> str:
    # What rotations leave of a zero is written as one.
    return " ".join("0" if abs(value) < 1e-15 else f"{value:.12g}" for value in values)


def _quoted(text: str) -> str:
    plain = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{plain}"'


def _indented(text: str, spaces: int) -> str:
    return text.replace("\n", "\n" + " " * spaces)


def _shape(geometry: str, colour: tuple[float, float, float]) -> str:
    return (
        f"Shape {{ appearance PBRAppearance {{ baseColor {_vector(colour)} roughness 0.7 metalness 0 }} "
        f"geometry {geometry} }}"
    )


def _inertia(moments: Sequence[float]) -> str:
    return f"inertiaMatrix [ {_vector(moments)} 0 0 0 ]"


def _wheel(body: Body, side: int, limits: Limits) -> str:
    name = ("left", "right")[side]
    radius, spin = body.wheel_radius_m[side], body.wheel_inertia_kg_m2
    place = _vector((0.0, (0.5 - side) * body.track_width_m, radius))
    width = 0.5 * radius
    tyre = _shape(f"Cylinder {{ height {width:.12g} radius {radius:.12g} }}", (0.1, 0.1, 0.1))
    return f"""HingeJoint {{
  jointParameters HingeJointParameters {{ axis 0 1 0 anchor {place} }}
  device [
    RotationalMotor {{
      name "{WHEEL_MOTORS[side]}"
      maxVelocity {limits.speed_rad_s:.12g}
      maxTorque {limits.torque_nm:.12g}
      sound ""
    }}
    PositionSensor {{ name "{WHEEL_SENSORS[side]}" }}
  ]
  endPoint Solid {{
    translation {place}
    name "{name} wheel"
    contactMaterial "tyre"
    children [ Pose {{ rotation 1 0 0 {0.5 * math.pi:.12g} children [ {tyre} ] }} ]
    boundingObject Sphere {{ radius {radius:.12g} }}
    physics Physics {{
      density -1
      mass {body.wheel_mass_kg:.12g}
      centerOfMass [ 0 0 0 ]
      {_inertia((0.5 * spin, spin, 0.5 * spin))}
    }}
  }}
}}"""


def _looks(body: Body) -> str:
    """The body and its payload as boxes; they weigh nothing and touch nothing."""
    radius, track = max(body.wheel_radius_m), body.track_width_m
    width = 0.75 * track
    boxes = [(0.5 * radius, 2.0 * radius, (0.25, 0.3, 0.35))]
    if body.payload_kg > 0.0:
        boxes.append((2.6 * radius, radius, (0.75, 0.35, 0.15)))
    return "\n".join(
        f"Pose {{ translation {_vector((0.0, 0.0, base + 0.5 * height))} "
        f"children [ {_shape(f'Box {{ size {_vector((width, width, height))} }}', colour)} ] }}"
        for base, height, colour in boxes
    )


def _robot(body: Body, pose: tuple[float, float, float], scenario: str, limits: Limits) -> str:
    base = base_inertia(body)
    tilt = ground_rotation(body.slope_rad, body.uphill_yaw_rad)
    turned = tilt @ rotation_of(np.array([0.0, 0.0, 1.0]), pose[2])
    skids = "\n".join(
        f"Pose {{ translation {_vector((x, body.com_m[1], SKID_RADIUS_M))} "
        f"children [ Sphere {{ radius {SKID_RADIUS_M:.12g} }} ] }}"
        for _, x in supports(body)
    )
    axle = 0.5 * sum(body.wheel_radius_m)
    children = "\n".join((_wheel(body, 0, limits), _wheel(body, 1, limits), _looks(body)))
    return f"""DEF ROBOT Robot {{
  translation {_vector(tilt @ np.array([pose[0], pose[1], 0.0]))}
  rotation {_vector(axis_angle(turned))}
  name "robot"
  controller "{CONTROLLER}"
  customData "{scenario}"
  supervisor TRUE
  contactMaterial "skid"
  children [
    {_indented(children, 4)}
    GPS {{ translation {_vector((0.0, 0.0, axle))} name "{GPS}" }}
    Gyro {{ name "{GYRO}" }}
  ]
  boundingObject Group {{
    children [
      {_indented(skids, 6)}
    ]
  }}
  physics Physics {{
    density -1
    mass {base.mass_kg:.12g}
    centerOfMass [ {_vector(base.com_m)} ]
    {_inertia(base.inertia_kg_m2)}
  }}
}}"""


def _ground(body: Body) -> str:
    tilt = ground_rotation(body.slope_rad, body.uphill_yaw_rad)
    box = f"Box {{ size {_vector(GROUND_SIZE_M)} }}"
    return f"""DEF GROUND Solid {{
  translation {_vector(tilt @ np.array([0.0, 0.0, -0.5 * GROUND_SIZE_M[2]]))}
  rotation {_vector((*ground_axis(body.uphill_yaw_rad), body.slope_rad))}
  name "ground"
  contactMaterial "ground"
  children [ {_shape(box, (0.6, 0.65, 0.6))} ]
  boundingObject {box}
}}"""


def _contact(material: str, friction: float) -> str:
    return f"""ContactProperties {{
  material1 "{material}"
  material2 "ground"
  coulombFriction [ {friction:.12g} ]
  bounce 0
  softCFM {CONTACT_CFM:g}
}}"""


def make_world(robot: Robot, body: Body, pose: tuple[float, float, float], scenario: str, time_step_ms: int = 1) -> str:
    """The text of a .wbt file.

    Parameters
    ----------
    body : the robot with payload and slope; where a correction changes it, as changed.
    pose : x m, y m, yaw rad in the tilted ground, where the axle's middle starts.
    scenario : its name, which the controller reads.
    time_step_ms : Webots' own step, `basicTimeStep`.

    Raises
    ------
    InputError : see `rtds_host.robot.urdf.base_inertia`.
    """
    contacts = "\n".join((_contact("tyre", body.tyre_friction), _contact("skid", 0.0)))
    title = _quoted(f"{robot.name}: {scenario}")
    looks = rotation_of(np.array([0.0, 0.0, 1.0]), 0.5 * math.pi)
    looks = looks @ rotation_of(np.array([0.0, 1.0, 0.0]), VIEW_DOWN_RAD)
    return f"""#VRML_SIM {RELEASE} utf8
WorldInfo {{
  title {title}
  info [ "Motors outside Webots: their speeds turn the wheels, the wheels' torques load them." ]
  gravity {GRAVITY_M_S2:.12g}
  CFM {WORLD_CFM:g}
  basicTimeStep {time_step_ms}
  FPS 30
  physicsDisableLinearThreshold 0
  physicsDisableAngularThreshold 0
  contactProperties [
    {_indented(contacts, 4)}
  ]
}}
Viewpoint {{
  orientation {_vector(axis_angle(looks))}
  position {_vector(VIEW_FROM_M)}
  follow "robot"
}}
Background {{ skyColor [ 0.75 0.85 0.95 ] }}
DirectionalLight {{ direction 0.4 0.3 -1 intensity 2 }}
{_ground(body)}
{_robot(body, pose, scenario, limits_of(robot.motor, robot.supply_v))}
"""
