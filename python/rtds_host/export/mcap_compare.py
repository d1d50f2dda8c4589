"""Measured, nominal and corrected channels of runs side by side as MCAP, for Foxglove and PlotJuggler."""

from __future__ import annotations

import io
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from mcap_ros2.writer import Writer

from rtds_host.contract import RunLog, write_atomic
from rtds_host.contract.runlog import MEASURED
from rtds_host.export.mcap import NO_COVARIANCE
from rtds_host.importers.messages import definition, full_name
from rtds_host.importers.series import NS

COMMANDS = ("v_cmd_l", "v_cmd_r", "w_cmd_l", "w_cmd_r")
POSE = ("x", "y", "yaw")


@dataclass(frozen=True)
class Compared:
    """A run and what was replayed of it: by name ("nominal", "corrected") the columns of `predicted_columns`."""

    log: RunLog
    replayed: Mapping[str, Mapping[str, np.ndarray]]


def topic_name(text: str) -> str:
    """A run's name as a part of a ROS 2 topic: letters, digits and underscores, no digit first."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", text)
    return name if re.match(r"[A-Za-z_]", name) else f"run_{name}"


def write_comparison(path: str | os.PathLike, runs: Sequence[Compared]) -> None:
    """Write runs as one MCAP file of ROS 2 messages, whole or not at all.

    Topics are /measured/w_l, /nominal/w_l, /corrected/w_l and so on, one std_msgs/Float64 a channel, with
    /measured/odom, /nominal/odom, /corrected/odom (nav_msgs/Odometry, frame "odom") for the pose, and /command/v_cmd_l;
    of several runs each under its own name (/spin/measured/w_l). Every run begins at time 0, so that they lie over each
    other. A row without a sample of a channel leaves no message of it.

    Raises
    ------
    OutputError : the place cannot be written.
    """
    buffer = io.BytesIO()
    names: dict[str, int] = {}
    with Writer(buffer) as writer:
        schemas: dict[str, object] = {}

        def put(topic: str, kind: str, message: dict, now: int) -> None:
            if kind not in schemas:
                schemas[kind] = writer.register_msgdef(full_name(kind), definition(kind))
            writer.write_message(topic, schemas[kind], message, log_time=now, publish_time=now)

        for run in runs:
            space = ""
            if len(runs) > 1:
                space = "/" + topic_name(run.log.name)
                names[space] = names.get(space, 0) + 1
                # Two names that differ in what a topic cannot hold stay two.
                space += f"_{names[space]}" if names[space] > 1 else ""
            times = np.round((run.log.t - run.log.t[0]) * NS).astype(np.int64)
            commands = {name: run.log.columns[name] for name in COMMANDS if name in run.log.columns}
            measured = {name: run.log.columns[name] for name in MEASURED if name in run.log.columns}
            sources: dict[str, Mapping[str, np.ndarray]] = {"command": commands, "measured": measured}
            for name, columns in run.replayed.items():
                sources[name] = {channel: columns[channel] for channel in MEASURED if channel in columns}
            for k, stamp in enumerate(times):
                now = int(stamp)
                for source, columns in sources.items():
                    for channel, values in columns.items():
                        if math.isfinite(values[k]):
                            put(f"{space}/{source}/{channel}", "std_msgs/Float64", {"data": float(values[k])}, now)
                    pose = [float(columns[c][k]) for c in POSE if c in columns]
                    if len(pose) == len(POSE) and all(map(math.isfinite, pose)):
                        put(
                            f"{space}/{source}/odom",
                            "nav_msgs/Odometry",
                            _odometry(pose, now, f"{space}/{source}"),
                            now,
                        )
    write_atomic(path, buffer.getvalue())


def _odometry(pose: Sequence[float], now: int, frame: str) -> dict:
    x, y, yaw = pose
    return {
        "header": {"stamp": {"sec": now // NS, "nanosec": now % NS}, "frame_id": "odom"},
        "child_frame_id": frame.lstrip("/") + "/base_footprint",
        "pose": {
            "pose": {
                "position": {"x": x, "y": y, "z": 0.0},
                "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2.0), "w": math.cos(yaw / 2.0)},
            },
            "covariance": NO_COVARIANCE,
        },
        "twist": {
            "twist": {"linear": {"x": 0.0, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}},
            "covariance": NO_COVARIANCE,
        },
    }
