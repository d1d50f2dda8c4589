"""URDF: links, wheel joints with damping, friction and limits (wiki.ros.org/urdf/XML)."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

from rtds_host.export.figures import SIDES, Figures
from rtds_host.export.joints import drive, torque_loop
from rtds_host.export.mjcf import vector
from rtds_host.robot.body import SKID_RADIUS_M
from rtds_host.robot.urdf import base_inertia, supports

HOW_DRIVEN = (
    "A commanded volt is a torque at the wheel: effort = {left:.9g} V (left), {right:.9g} V (right), N·m; the joint's\n"
    "damping holds the motor's back EMF, so that wheels driven by that effort behave as driven by volts."
)


def driven(figures: Figures) -> str:
    """How the joints' efforts follow from voltages, as a line of a comment."""
    left, right = (side.torque_per_volt for side in figures.sides)
    text = HOW_DRIVEN.format(left=left, right=right) + "\n"
    if figures.loop is not None:
        text += (
            "The servo's loop: effort = p (c - w) + integral of i (c - w), c the speed asked for times a scale, w the"
            " wheel's, rad/s:\n"
        )
        for name, side in zip(SIDES, figures.sides, strict=True):
            loop = torque_loop(figures, side)
            text += (
                f"  {name}: p = {loop.p:.9g} N·m·s/rad, i = {loop.i:.9g} N·m/rad, integral within {loop.integral:.9g}"
                f" N·m, effort within {loop.effort:.9g} N·m, scale {loop.scale:.9g}\n"
            )
    return text


def _inertial(mass: float, at: tuple[float, ...], moments: tuple[float, ...]) -> str:
    return (
        f'    <inertial>\n      <origin xyz="{vector(*at)}"/>\n      <mass value="{mass:.9g}"/>\n      <inertia'
        f' ixx="{moments[0]:.9g}" iyy="{moments[1]:.9g}" izz="{moments[2]:.9g}" ixy="0" ixz="0" iyz="0"/>\n   '
        " </inertial>\n"
    )


def _sphere(radius: float, at: tuple[float, ...] = (0.0, 0.0, 0.0)) -> str:
    return "".join(
        f'    <{kind}>\n      <origin xyz="{vector(*at)}"/>\n      <geometry><sphere'
        f' radius="{radius:.9g}"/></geometry>\n    </{kind}>\n'
        for kind in ("visual", "collision")
    )


def write(figures: Figures, comment: str) -> str:
    """The robot as URDF; `comment` is at its head."""
    body = figures.body
    base = base_inertia(body)
    spin = body.wheel_inertia_kg_m2
    skids = "".join(_sphere(SKID_RADIUS_M, (x, body.com_m[1], SKID_RADIUS_M)) for _, x in supports(body))
    text = (
        f'<?xml version="1.0"?>\n<!--\n{comment}{driven(figures)}-->\n<robot name={quoteattr(figures.name)}>\n'
        f'  <link name="base">\n{_inertial(base.mass_kg, base.com_m, base.inertia_kg_m2)}{skids}  </link>\n'
    )
    for name, side, half in zip(SIDES, figures.sides, (0.5, -0.5), strict=True):
        joint = drive(figures, side)
        text += (
            "  <link"
            f' name="wheel_{name}">\n{_inertial(body.wheel_mass_kg, (0.0, 0.0, 0.0), (spin / 2, spin, spin / 2))}'
            f"{_sphere(side.radius_m)}"
            f'  </link>\n  <joint name="wheel_{name}" type="continuous">\n    <parent link="base"/>\n    <child'
            f' link="wheel_{name}"/>\n    <origin xyz="{vector(0.0, half * body.track_width_m, side.radius_m)}"/>\n   '
            f' <axis xyz="0 1 0"/>\n    <dynamics damping="{joint.viscous + joint.braking:.9g}"'
            f' friction="{joint.friction:.9g}"/>\n    <limit effort="{joint.effort:.9g}"'
            f' velocity="{joint.speed:.9g}"/>\n  </joint>\n'
        )
    return text + "</robot>\n"
