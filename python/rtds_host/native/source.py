"""What a robot's motors are made of: a diagnosis, a robot.toml, or a robot that comes along."""

from __future__ import annotations

from pathlib import Path

from rtds_host.contract import builtin_robot, builtin_robots, load_robot
from rtds_host.diagnosis.replay.model import nominal_model
from rtds_host.errors import InputError, did_you_mean
from rtds_host.export.export import Source, default_robot, read_source


def source_of(name: str | Path, robot: Path | None = None) -> Source:
    """The robot to export or to serve.

    Parameters
    ----------
    name : path of a diagnosis or of a robot.toml, or a built-in robot's name.
    robot : the nominal robot of a diagnosis; None: the one in the same folder or the one above.

    Raises
    ------
    InputError : no such robot or file, an unusable one, or `robot` without a diagnosis.
    """
    path = Path(name)
    nominal = None
    if str(name) in builtin_robots() and not path.exists():
        nominal = builtin_robot(str(name))
    elif path.suffix == ".toml":
        nominal = load_robot(path)
    if nominal is None:
        if not path.exists():
            robots = builtin_robots()
            guess = did_you_mean(str(name), robots)
            raise InputError(f"{name}: no such file, and no robot of the package ({', '.join(robots)}){guess}")
        return read_source(path, load_robot(robot or default_robot(path)))
    if robot is not None:
        raise InputError(f"--robot {robot}: {name} is a robot itself, --robot goes with a diagnosis")
    return Source({}, nominal_model(nominal), nominal, path.name)
