"""A run as MCAP with ROS 2 messages, so that Foxglove, PlotJuggler or `ros2 bag play` open it."""

from __future__ import annotations

import io
import math
import os
from collections.abc import Iterator

import numpy as np
from mcap_ros2.writer import Writer

from rtds_host.contract import Chassis, Robot, RunLog, write_atomic
from rtds_host.importers.messages import definition, full_name
from rtds_host.importers.series import NS

JOINTS = {"l": "wheel_left_joint", "r": "wheel_right_joint"}
# One plain number a topic: no standard message carries a commanded voltage or a motor's current.
PLAIN = ("v_cmd_l", "v_cmd_r", "w_cmd_l", "w_cmd_r", "i_l", "i_r", "w_ref_l", "w_ref_r")
NO_COVARIANCE = [0.0] * 36
UNKNOWN = [-1.0] + [0.0] * 8  # sensor_msgs/Imu: "no estimate of this"


def write_mcap(path: str | os.PathLike, run: RunLog, robot: Robot | None = None, start_ns: int = 0) -> None:
    """Write a run as an MCAP file of ROS 2 messages, whole or not at all.

    Topics: /joint_states (wheel angles rad, speeds rad/s at the gear's output, no effort), /imu (yaw rate),
    /battery_state, /odom and /tf (pose), and one std_msgs/Float64 each for commands, currents and references,
    named as the contract's columns. A row without a sample of a channel leaves no message of it.

    Parameters
    ----------
    run : as read by `read_run` or built in memory.
    robot : with it /odom carries speeds too, from the wheels.
    start_ns : time of t = 0 in ns since the epoch; 0 keeps the file the same from run to run.

    Raises
    ------
    OutputError : the place cannot be written.
    """
    columns = {name: np.asarray(values, dtype=float) for name, values in run.columns.items()}
    empty = np.full(len(run.t), math.nan)
    buffer = io.BytesIO()
    with Writer(buffer) as writer:
        schemas: dict[str, object] = {}
        sides = [s for s in JOINTS if f"w_{s}" in columns or f"th_{s}" in columns]
        speeds = np.column_stack([columns.get(f"w_{s}", empty) for s in sides]) if sides else np.empty((len(run.t), 0))
        angles = np.column_stack([columns.get(f"th_{s}", empty) for s in sides]) if sides else np.empty((len(run.t), 0))
        for k, t in enumerate(run.t):
            now = start_ns + round(float(t) * NS)
            stamp = {"sec": now // NS, "nanosec": now % NS}
            row = {name: float(columns[name][k]) for name in columns}
            for topic, kind, message in (
                *_plain(row),
                *_joints(stamp, sides, speeds[k], angles[k]),
                *_sensors(stamp, row),
                *_pose(stamp, row, speeds[k], robot.chassis if robot is not None and len(sides) == 2 else None),
            ):
                if kind not in schemas:
                    schemas[kind] = writer.register_msgdef(full_name(kind), definition(kind))
                writer.write_message(topic, schemas[kind], message, log_time=now, publish_time=now)
    write_atomic(path, buffer.getvalue())


# Topic, type and content of a message.
Message = tuple[str, str, dict]


def _plain(row: dict[str, float]) -> Iterator[Message]:
    """Commands, currents and references of a row, one number each."""
    for name in PLAIN:
        if math.isfinite(row.get(name, math.nan)):
            yield f"/{name}", "std_msgs/Float64", {"data": row[name]}


def _joints(stamp: dict, sides: list[str], speeds: np.ndarray, angles: np.ndarray) -> Iterator[Message]:
    """Wheels' speeds (sides,) rad/s and angles (sides,) rad."""
    moving, turned = np.isfinite(speeds).any(), np.isfinite(angles).any()
    if moving or turned:
        yield (
            "/joint_states",
            "sensor_msgs/JointState",
            {
                "header": {"stamp": stamp, "frame_id": "base_link"},
                "name": [JOINTS[s] for s in sides],
                "position": angles.tolist() if turned else [],
                "velocity": speeds.tolist() if moving else [],
                "effort": [],
            },
        )


def _sensors(stamp: dict, row: dict[str, float]) -> Iterator[Message]:
    """Yaw rate and supply."""
    rate, bus = row.get("gyro_z", math.nan), row.get("v_bus", math.nan)
    if math.isfinite(rate):
        yield (
            "/imu",
            "sensor_msgs/Imu",
            {
                "header": {"stamp": stamp, "frame_id": "imu_link"},
                "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
                "orientation_covariance": UNKNOWN,
                "angular_velocity": {"x": 0.0, "y": 0.0, "z": rate},
                "angular_velocity_covariance": [0.0] * 9,
                "linear_acceleration": {"x": 0.0, "y": 0.0, "z": 0.0},
                "linear_acceleration_covariance": UNKNOWN,
            },
        )
    if math.isfinite(bus):
        unknown = ("temperature", "current", "charge", "capacity", "design_capacity", "percentage")
        yield (
            "/battery_state",
            "sensor_msgs/BatteryState",
            {
                "header": {"stamp": stamp, "frame_id": ""},
                "voltage": bus,
                "present": True,
                **{key: math.nan for key in unknown},
                "power_supply_status": 0,
                "power_supply_health": 0,
                "power_supply_technology": 0,
                "cell_voltage": [],
                "cell_temperature": [],
                "location": "",
                "serial_number": "",
            },
        )


def _pose(stamp: dict, row: dict[str, float], speeds: np.ndarray, body: Chassis | None) -> Iterator[Message]:
    """Pose, and with the `body` the speeds that the wheels' (2,) rad/s make of it."""
    x, y, yaw = (row.get(name, math.nan) for name in ("x", "y", "yaw"))
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(yaw)):
        return
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2.0), "w": math.cos(yaw / 2.0)}
    place = {"x": x, "y": y, "z": 0.0}
    forward = spin = math.nan
    if body is not None:
        forward = body.wheel_radius_m * float(speeds.sum()) / 2.0
        spin = body.wheel_radius_m * float(speeds[1] - speeds[0]) / body.track_width_m
    at = {"header": {"stamp": stamp, "frame_id": "odom"}, "child_frame_id": "base_footprint"}
    linear, angular = {"x": forward, "y": 0.0, "z": 0.0}, {"x": 0.0, "y": 0.0, "z": spin}
    yield (
        "/odom",
        "nav_msgs/Odometry",
        {
            **at,
            "pose": {"pose": {"position": place, "orientation": turn}, "covariance": NO_COVARIANCE},
            "twist": {"twist": {"linear": linear, "angular": angular}, "covariance": NO_COVARIANCE},
        },
    )
    yield (
        "/tf",
        "tf2_msgs/TFMessage",
        {"transforms": [{**at, "transform": {"translation": place, "rotation": turn}}]},
    )
