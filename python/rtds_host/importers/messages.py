"""Definitions of the ROS 2 messages that are written, as MCAP's "ros2msg" schemas want them."""

from __future__ import annotations

import re
from collections.abc import Mapping

# Only fields and constants that the wire format needs; comments of the originals are left out.
FIELDS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "std_msgs/Float64": "float64 data",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist\nfloat64[36] covariance",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/TransformStamped": "std_msgs/Header header\nstring child_frame_id\n"
    "geometry_msgs/Transform transform",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "nav_msgs/Odometry": "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
    "geometry_msgs/TwistWithCovariance twist",
    "sensor_msgs/JointState": "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
    "float64[] effort",
    "sensor_msgs/Imu": "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n"
    "float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n"
    "float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n"
    "float64[9] linear_acceleration_covariance",
    "sensor_msgs/BatteryState": "std_msgs/Header header\nfloat32 voltage\nfloat32 temperature\nfloat32 current\n"
    "float32 charge\nfloat32 capacity\nfloat32 design_capacity\nfloat32 percentage\n"
    "uint8 power_supply_status\nuint8 power_supply_health\n"
    "uint8 power_supply_technology\nbool present\nfloat32[] cell_voltage\n"
    "float32[] cell_temperature\nstring location\nstring serial_number",
}


def definition(name: str, extra: Mapping[str, str] | None = None) -> str:
    """Definition of "package/Type" followed by those of all types it is made of; `extra` adds types to `FIELDS`."""
    known = {**FIELDS, **(extra or {})}
    needed: list[str] = []

    def collect(of: str) -> None:
        for part in re.findall(r"\b(\w+/\w+)\b", known[of]):
            if part not in needed:
                needed.append(part)
                collect(part)

    collect(name)
    return "\n".join([known[name], *(f"{'=' * 80}\nMSG: {part}\n{known[part]}" for part in needed), ""])


def full_name(name: str) -> str:
    """ "package/Type" as ROS 2 spells it: "package/msg/Type"."""
    return name.replace("/", "/msg/")
