"""Recordings for the tests, written by other libraries than the one that reads them (`rosbags`).

MCAP files come from `mcap` and `mcap_ros2`; sqlite3 bags from Python's own `sqlite3`, with the tables of ROS 2
Humble and messages serialised by `mcap_ros2`.
"""

from __future__ import annotations

import io
import math
import sqlite3
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.writer import Writer

from rtds_host.importers.messages import definition, full_name

NS = 1_000_000_000
EPOCH_NS = 1_700_000_000 * NS
RADIUS, TRACK = 0.033, 0.160
COUNT = 0.229 * 2 * math.pi / 60
TICK = 2 * math.pi / 4096

EXTRA = {
    "rosgraph_msgs/Clock": "builtin_interfaces/Time clock\n",
    "irobot_create_msgs/WheelVels": "std_msgs/Header header\nfloat32 velocity_left\nfloat32 velocity_right\n",
    "irobot_create_msgs/WheelTicks": "std_msgs/Header header\nint32 ticks_left\nint32 ticks_right\n",
    "jackal_msgs/DriveFeedback": (
        "float32 current\nfloat32 duty_cycle\nfloat32 measured_velocity\nfloat32 measured_travel\n"
    ),
    "jackal_msgs/Feedback": "std_msgs/Header header\njackal_msgs/DriveFeedback[2] drivers\n",
    "turtlebot3_msgs/SensorState": (
        "std_msgs/Header header\nuint8 bumper\nfloat32 cliff\nfloat32 sonar\n"
        "float32 illumination\nuint8 led\nuint8 button\nbool torque\nint32 left_encoder\n"
        "int32 right_encoder\nfloat32 battery"
    ),
    "std_msgs/String": "string data",
    "std_msgs/Float64MultiArray": "std_msgs/MultiArrayLayout layout\nfloat64[] data",
    "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset",
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride",
    "geometry_msgs/TwistStamped": "std_msgs/Header header\ngeometry_msgs/Twist twist",
    "geometry_msgs/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose",
    "rover_msgs/Wheel": "std_msgs/Header header\nint16 pwm\nfloat32 rpm\nint32 milliamps\nuint16 ticks",
}


def stamp(t_s: float, epoch_ns: int = EPOCH_NS) -> dict:
    """A time as builtin_interfaces/Time."""
    now = epoch_ns + round(t_s * NS)
    return {"sec": now // NS, "nanosec": now % NS}


class Recording:
    """Messages in memory: (log time in s, topic, "package/Type", message)."""

    def __init__(self):
        self.messages: list[tuple[float, str, str, dict]] = []

    def add(self, t_s: float, topic: str, kind: str, message: dict) -> None:
        self.messages.append((t_s, topic, kind, message))

    def drop(self, *topics: str) -> Recording:
        """Without these topics."""
        self.messages = [m for m in self.messages if m[1] not in topics]
        return self

    def mcap(self, path: Path | None = None, log_epoch_ns: int = EPOCH_NS) -> bytes:
        """The recording as MCAP; written to `path` if given."""
        buffer = io.BytesIO()
        with Writer(buffer) as writer:
            schemas = {}
            for t, topic, kind, message in sorted(self.messages, key=lambda m: m[0]):
                if kind not in schemas:
                    schemas[kind] = writer.register_msgdef(full_name(kind), definition(kind, EXTRA))
                now = log_epoch_ns + round(t * NS)
                writer.write_message(topic, schemas[kind], message, log_time=now, publish_time=now)
        if path is not None:
            path.write_bytes(buffer.getvalue())
        return buffer.getvalue()

    def mcap_folder(self, folder: Path) -> Path:
        """As `ros2 bag record -s mcap` leaves it: a folder with metadata.yaml."""
        folder.mkdir()
        self.mcap(folder / f"{folder.name}_0.mcap")
        _metadata(folder, "mcap", f"{folder.name}_0.mcap", self.mcap())
        return folder

    def sqlite(self, folder: Path) -> Path:
        """As `ros2 bag record` of ROS 2 Humble leaves it: sqlite3, and no definitions of messages."""
        folder.mkdir()
        data = self.mcap()
        file = f"{folder.name}_0.db3"
        base = sqlite3.connect(folder / file)
        base.executescript("""
            CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
            CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);
            CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
                                serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
            CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
                                  data BLOB NOT NULL);
            CREATE INDEX timestamp_idx ON messages (timestamp ASC);
            INSERT INTO schema(schema_version, ros_distro) VALUES (3, 'humble');""")
        ids: dict[str, int] = {}
        for schema, channel, message in make_reader(io.BytesIO(data)).iter_messages():
            if channel.topic not in ids:
                ids[channel.topic] = len(ids) + 1
                base.execute(
                    "INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')", (ids[channel.topic], channel.topic, schema.name)
                )
            base.execute(
                "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)",
                (ids[channel.topic], message.log_time, message.data),
            )
        base.commit()
        base.close()
        _metadata(folder, "sqlite3", file, data)
        return folder


def _metadata(folder: Path, storage: str, file: str, data: bytes) -> None:
    counts: dict[tuple[str, str], int] = {}
    times = []
    for schema, channel, message in make_reader(io.BytesIO(data)).iter_messages():
        counts[channel.topic, schema.name] = counts.get((channel.topic, schema.name), 0) + 1
        times.append(message.log_time)
    topics = "".join(
        f"""
    - topic_metadata:
        name: {topic}
        type: {kind}
        serialization_format: cdr
        offered_qos_profiles: ""
      message_count: {count}"""
        for (topic, kind), count in counts.items()
    )
    (folder / "metadata.yaml").write_text(f"""rosbag2_bagfile_information:
  version: 5
  storage_identifier: {storage}
  duration:
    nanoseconds: {max(times) - min(times)}
  starting_time:
    nanoseconds_since_epoch: {min(times)}
  message_count: {len(times)}
  topics_with_message_count:{topics}
  compression_format: ""
  compression_mode: ""
  relative_file_paths:
    - {file}
  files:
    - path: {file}
      starting_time:
        nanoseconds_since_epoch: {min(times)}
      duration:
        nanoseconds: {max(times) - min(times)}
      message_count: {len(times)}
""")


def twist(linear: float, angular: float) -> dict:
    return {"linear": {"x": linear, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": angular}}


def turned(yaw: float) -> dict:
    return {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}


def wheel(t: float, side: int) -> tuple[float, float]:
    """Speed (rad/s) and angle (rad) of a wheel of the test robot: at rest until 0.5 s, then a smooth wave."""
    top = (3.0, 2.0)[side]
    if t < 0.5:
        return 0.0, (10.0, 20.0)[side]
    return top * math.sin(t - 0.5), (10.0, 20.0)[side] + top * (1 - math.cos(t - 0.5))


def turtlebot(
    seconds: float = 5.0, lost: tuple[int, ...] = (), log_delay_s: float = 0.002, stamp_epoch_ns: int = EPOCH_NS
) -> Recording:
    """What a stock TurtleBot3 whose wheels follow `wheel` records; read-outs `lost` never reach the bag."""
    recording = Recording()
    times = np.arange(0.0, seconds, 0.05)
    before = [0.0, 0.0]
    for k, t in enumerate(float(t) for t in times):
        (wl, al), (wr, ar) = wheel(t, 0), wheel(t, 1)
        head = {"stamp": stamp(t, stamp_epoch_ns), "frame_id": ""}
        positions, before = before, [al, ar]
        if k in lost:
            continue
        log = t + log_delay_s
        recording.add(
            log,
            "/joint_states",
            "sensor_msgs/JointState",
            {
                "header": head,
                "name": ["wheel_left_joint", "wheel_right_joint"],
                "position": positions,
                "velocity": [wl * RADIUS, wr * RADIUS],
                "effort": [],
            },
        )
        recording.add(
            log,
            "/sensor_state",
            "turtlebot3_msgs/SensorState",
            {
                "header": head,
                "bumper": 0,
                "cliff": 0.0,
                "sonar": 0.0,
                "illumination": 0.0,
                "led": 0,
                "button": 0,
                "torque": True,
                "left_encoder": round(al / TICK),
                "right_encoder": round(ar / TICK),
                "battery": 11.9,
            },
        )
        recording.add(
            log,
            "/imu",
            "sensor_msgs/Imu",
            {
                "header": head,
                "orientation": turned(0.0),
                "orientation_covariance": [0.0] * 9,
                "angular_velocity": {"x": 0.0, "y": 0.0, "z": RADIUS * (wr - wl) / TRACK},
                "angular_velocity_covariance": [0.0] * 9,
                "linear_acceleration": {"x": 0.0, "y": 0.0, "z": 9.8},
                "linear_acceleration_covariance": [0.0] * 9,
            },
        )
        recording.add(
            log,
            "/battery_state",
            "sensor_msgs/BatteryState",
            {
                "header": head,
                "voltage": 11.9,
                "temperature": 0.0,
                "current": 0.0,
                "charge": 0.0,
                "capacity": 0.0,
                "design_capacity": 1.8,
                "percentage": 87.0,
                "power_supply_status": 0,
                "power_supply_health": 0,
                "power_supply_technology": 0,
                "present": True,
                "cell_voltage": [],
                "cell_temperature": [],
                "location": "",
                "serial_number": "",
            },
        )
        recording.add(
            log,
            "/odom",
            "nav_msgs/Odometry",
            {
                "header": head,
                "child_frame_id": "base_footprint",
                "pose": {
                    "pose": {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": turned(0.7)},
                    "covariance": [0.0] * 36,
                },
                "twist": {"twist": twist(RADIUS * (wl + wr) / 2, RADIUS * (wr - wl) / TRACK), "covariance": [0.0] * 36},
            },
        )
    for t in np.arange(0.51, seconds, 0.1):
        (wl, _), (wr, _) = wheel(float(t), 0), wheel(float(t), 1)
        recording.add(
            float(t), "/cmd_vel", "geometry_msgs/Twist", twist(RADIUS * (wl + wr) / 2, RADIUS * (wr - wl) / TRACK)
        )
    return recording
