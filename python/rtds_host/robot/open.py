"""A physics engine by its name; engines are loaded when they are asked for."""

from __future__ import annotations

from rtds_host.robot.body import Body
from rtds_host.robot.engine import STEP_S, Engine, check_engine


def open_engine(
    name: str, body: Body, pose: tuple[float, float, float] = (0.0, 0.0, 0.0), step_s: float = STEP_S
) -> Engine:
    """A physics engine with the robot standing at `pose` (x m, y m, yaw rad), settled, at rest.

    Raises
    ------
    InputError : unknown engine, or one that is not installed.
    """
    check_engine(name)
    if name == "pybullet":
        from rtds_host.robot.pybullet_engine import PyBulletEngine

        return PyBulletEngine(body, pose, step_s)
    from rtds_host.robot.mujoco_engine import MujocoEngine

    return MujocoEngine(body, pose, step_s)
