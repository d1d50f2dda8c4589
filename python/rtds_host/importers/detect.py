"""Which of the mappings that come along a recording is read with, where none is given."""

from __future__ import annotations

from pathlib import Path

from rtds_host.errors import InputError
from rtds_host.importers.bag import Bag, is_bag, refuse_other
from rtds_host.importers.mapping import Mapping
from rtds_host.importers.sysid import is_sysid, test_of
from rtds_host.importers.wpilog import is_wpilog

# Topics (their ends, for they may be in a namespace) that only one kind of robot has; the first that is there counts.
TELLING = (
    ("create3", "/wheel_vels"),
    ("jackal", "/platform/feedback"),
    ("jackal", "/feedback"),
    ("turtlebot3", "/sensor_state"),
    ("turtlebot3_gazebo", "/clock"),
)


def likely_mapping(path: Path) -> str:
    """Name of a mapping for a recording.

    Raises
    ------
    InputError : a table, whose columns nobody can guess.
    """
    if is_sysid(path):
        return "wpilib_sysid" if test_of(path).startswith("Drivetrain") else "wpilib_sysid_simple"
    if not is_bag(path):
        refuse_other(path)
        if is_wpilog(path):
            raise InputError(f"{path}: a WPILib data log needs --mapping, which says what its entries are")
        raise InputError(f"{path}: a table needs --mapping, which says what its columns are")
    topics = set(Bag(path, Mapping(path, "")).topics)
    for name, end in TELLING:
        if any(topic.endswith(end) for topic in topics):
            return name
    return "turtlebot3"
