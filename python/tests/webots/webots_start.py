"""Starts a world's controller as Webots does, with the mock in place of Webots."""

from __future__ import annotations

import configparser
import os
import subprocess
from pathlib import Path

from wbt import read_world, robot_of

HERE = Path(__file__).parent


def start(world: Path, engine: str = "mujoco", end_ms: int = 0) -> subprocess.CompletedProcess[str]:
    """Run the controller of a world to its end: in its folder, by the Python of its runtime.ini."""
    name = robot_of(read_world(world.read_text()))["controller"]
    folder = world.parent.parent / "controllers" / name
    settings = configparser.ConfigParser()
    settings.read(folder / "runtime.ini")
    path = os.pathsep.join([str(HERE / "mock"), str(HERE), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": path, "MOCK_WORLD": str(world), "MOCK_ENGINE": engine}
    environment["MOCK_END_MS"] = str(end_ms)
    command = [settings["python"]["COMMAND"], f"{name}.py"]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
