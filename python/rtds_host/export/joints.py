"""What URDF, SDF and USD share: a wheel's joint that is driven by a torque."""

from __future__ import annotations

from dataclasses import dataclass

from rtds_host.export.figures import Figures, Side

# Beyond any wheel: no limit.
NO_SPEED_RAD_S = 1e4


@dataclass(frozen=True)
class Drive:
    """A wheel's joint, SI. A commanded volt is `torque_per_volt` N·m; at the speed w the back EMF takes `braking` w off
    it. `effort` and `speed` are the largest that the driver's voltage gives; `friction` and `viscous` are the gear's
    and motor's."""

    torque_per_volt: float
    braking: float
    viscous: float
    friction: float
    effort: float
    speed: float


def drive(figures: Figures, side: Side) -> Drive:
    """The joint of one side."""
    top = figures.limit_v(side)
    fast = (
        abs(side.voltage_gain) * top / side.back_emf_v_s_per_rad if side.back_emf_v_s_per_rad > 0.0 else NO_SPEED_RAD_S
    )
    return Drive(
        side.torque_per_volt,
        side.braking,
        side.viscous_nm_s_per_rad,
        side.dry_nm,
        abs(side.torque_per_volt) * top,
        fast,
    )


@dataclass(frozen=True)
class TorqueLoop:
    """The servo's loop in torques, SI: effort = p (c - w) + the integral of i (c - w), c = `scale` times the speed
    asked for. The integral stays within `integral`, the effort within `effort`. With it the joint's damping holds the
    back EMF."""

    p: float
    i: float
    integral: float
    effort: float
    scale: float


def torque_loop(figures: Figures, side: Side) -> TorqueLoop:
    """The loop of one side of a robot that is driven by wheel speeds."""
    loop = figures.loop
    assert loop is not None
    # The servo sees the reported speed, g w: kp (c' - g w) = g kp (c'/g - w).
    gain = side.torque_per_volt * side.speed_gain
    volt = abs(side.torque_per_volt)
    return TorqueLoop(
        p=gain * loop.kp_v_s_per_rad,
        i=gain * loop.ki_v_per_rad,
        integral=volt * loop.limit_v,
        effort=volt * min(loop.limit_v, figures.limit_v(side)),
        scale=side.command_gain / side.speed_gain if side.speed_gain else 0.0,
    )
