"""The robot as a physics engine sees it: body and wheels from `robot.toml`, PyBullet or MuJoCo behind one interface."""

from rtds_host.robot.body import Body, inertia_at_wheel_kg_m2, make_body
from rtds_host.robot.engine import (
    ENGINES,
    STEP_S,
    Engine,
    RobotState,
    available_engines,
    check_engine,
    default_engine,
)
from rtds_host.robot.open import open_engine
from rtds_host.robot.split import Split, make_split
from rtds_host.robot.urdf import make_urdf

__all__ = [
    "ENGINES",
    "STEP_S",
    "Body",
    "Engine",
    "RobotState",
    "Split",
    "available_engines",
    "check_engine",
    "default_engine",
    "inertia_at_wheel_kg_m2",
    "make_body",
    "make_split",
    "make_urdf",
    "open_engine",
]
