"""The robot as a physics engine sees it: body and wheels from `robot.toml`, PyBullet or MuJoCo behind one interface."""

from rtds_host.robot.body import Body, check_split, inertia_at_wheel_kg_m2, make_body
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
from rtds_host.robot.urdf import make_urdf

__all__ = ["ENGINES", "STEP_S", "Body", "Engine", "RobotState", "available_engines", "check_engine", "check_split", "default_engine",
           "inertia_at_wheel_kg_m2", "make_body", "make_urdf", "open_engine"]
