"""SDF for Gazebo: a model whose wheels take a force a topic, or, behind a servo, a speed (sdformat.org/spec, version
1.9).

JointController with force commands is the servo's loop: a PI on the joint's speed, integral and command within limits
(gz-sim, systems/joint_controller; gz-math, PID). It goes by the world's step, which is 1 ms where a world says nothing.
"""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

from rtds_host.export.figures import SIDES, Figures
from rtds_host.export.joints import drive, torque_loop
from rtds_host.export.mjcf import vector
from rtds_host.export.urdf import driven
from rtds_host.robot.body import SKID_RADIUS_M
from rtds_host.robot.urdf import base_inertia, supports


def _inertial(mass: float, at: tuple[float, ...], moments: tuple[float, ...]) -> str:
    return (
        f"      <inertial>\n        <pose>{vector(*at)} 0 0 0</pose>\n        <mass>{mass:.9g}</mass>\n"
        f"        <inertia><ixx>{moments[0]:.9g}</ixx><iyy>{moments[1]:.9g}</iyy><izz>{moments[2]:.9g}</izz>"
        "<ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia>\n      </inertial>\n"
    )


def _sphere(name: str, radius: float, at: tuple[float, ...], friction: float) -> str:
    shape = (
        f"        <pose>{vector(*at)} 0 0 0</pose>\n       "
        f" <geometry><sphere><radius>{radius:.9g}</radius></sphere></geometry>\n"
    )
    return (
        f'      <collision name="{name}">\n{shape}       '
        f" <surface><friction><ode><mu>{friction:g}</mu><mu2>{friction:g}</mu2></ode></friction></surface>\n     "
        f' </collision>\n      <visual name="{name}">\n{shape}      </visual>\n'
    )


def _imu(figures: Figures) -> str:
    noise = figures.noise.get("gyro_rad_s", 0.0)
    return (
        '      <sensor name="imu" type="imu">\n        <always_on>true</always_on>\n       '
        ' <update_rate>100</update_rate>\n        <imu><angular_velocity><z><noise type="gaussian">\n         '
        f" <mean>0</mean><stddev>{noise:.9g}</stddev>"
        f"<bias_mean>{figures.gyro_bias_rad_s:.9g}</bias_mean><bias_stddev>0</bias_stddev>\n"
        "        </noise></z></angular_velocity></imu>\n      </sensor>\n"
    )


def _plugin(figures: Figures, k: int) -> str:
    name = SIDES[k]
    if figures.loop is None:
        return (
            '    <plugin filename="gz-sim-apply-joint-force-system" name="gz::sim::systems::ApplyJointForce">\n'
            f"      <joint_name>wheel_{name}</joint_name>\n    </plugin>\n"
        )
    loop = torque_loop(figures, figures.sides[k])
    return (
        '    <plugin filename="gz-sim-joint-controller-system" name="gz::sim::systems::JointController">\n'
        f"      <joint_name>wheel_{name}</joint_name>\n      <use_force_commands>true</use_force_commands>\n"
        f"      <p_gain>{loop.p:.9g}</p_gain>\n      <i_gain>{loop.i:.9g}</i_gain>\n"
        f"      <i_max>{loop.integral:.9g}</i_max>\n      <i_min>{-loop.integral:.9g}</i_min>\n"
        f"      <cmd_max>{loop.effort:.9g}</cmd_max>\n      <cmd_min>{-loop.effort:.9g}</cmd_min>\n    </plugin>\n"
    )


def write(figures: Figures, comment: str) -> str:
    """The robot as an SDF model; `comment` is at its head."""
    body = figures.body
    base = base_inertia(body)
    spin = body.wheel_inertia_kg_m2
    skids = "".join(_sphere(name, SKID_RADIUS_M, (x, body.com_m[1], SKID_RADIUS_M), 0.0) for name, x in supports(body))
    slope = ""
    if figures.slope_extra_rad:
        slope = (
            f"The ground climbs by {figures.slope_extra_rad:.9g} rad more than it was said to: tilt <gravity> of the"
            " world by it.\n"
        )
    text = (
        f'<?xml version="1.0"?>\n<!--\n{comment}{driven(figures)}{slope}-->\n<sdf version="1.9">\n  <model'
        f" name={quoteattr(figures.name)}>\n    <link"
        f' name="base">\n{_inertial(base.mass_kg, base.com_m, base.inertia_kg_m2)}{skids}{_imu(figures)}    </link>\n'
    )
    for name, side, half in zip(SIDES, figures.sides, (0.5, -0.5), strict=True):
        joint = drive(figures, side)
        moments = (spin / 2, spin, spin / 2)
        text += (
            f'    <link name="wheel_{name}">\n      <pose>{vector(0.0, half * body.track_width_m, side.radius_m)} 0 0'
            " 0</pose>\n"
            f"{_inertial(body.wheel_mass_kg, (0.0, 0.0, 0.0), moments)}"
            f"{_sphere('tyre', side.radius_m, (0.0, 0.0, 0.0), body.tyre_friction)}    </link>\n"
            f'    <joint name="wheel_{name}" type="revolute">\n      <parent>base</parent>\n     '
            f" <child>wheel_{name}</child>\n"
            "      <axis>\n        <xyz>0 1 0</xyz>\n"
            f"        <dynamics><damping>{joint.viscous + joint.braking:.9g}</damping>"
            f"<friction>{joint.friction:.9g}</friction></dynamics>\n"
            f"        <limit><lower>-1e16</lower><upper>1e16</upper><effort>{joint.effort:.9g}</effort>"
            f"<velocity>{joint.speed:.9g}</velocity></limit>\n      </axis>\n    </joint>\n"
            f"{_plugin(figures, SIDES.index(name))}"
        )
    return text + "  </model>\n</sdf>\n"
