"""Bags of the simulated Burger as turtlebot3_node leaves them (MCAP); nothing of the program is used here.

Sources: ROBOTIS-GIT/turtlebot3 (turtlebot3_node), ROBOTIS-GIT/OpenCR, XL430-W250-T e-manual.
"""

from __future__ import annotations

import io
import math
import random
from dataclasses import dataclass
from pathlib import Path

from mcap_ros2.writer import Writer

from foreign.robot import RADIUS, RPM_COUNT, STEP_S, TRACK, Burger

NS = 1_000_000_000
READ_S, COMMAND_S = 0.05, 0.1
ENCODER = 2.0 * math.pi / 4096.0
TOP_M_S = RADIUS * 2.0 * math.pi * 61.0 / 60.0
# One standard deviation, as robots/burger.toml declares: gyro rad/s, bus V.
GYRO, BUS = 0.003, 0.03
LINE = "\n" + "=" * 80 + "\n"
TIME = "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec"
HEADER = "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id"
VECTOR = "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z"
QUATERNION = "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w"
POINT = "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z"
TWIST = "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular"
TYPES = {
    "geometry_msgs/msg/Twist": LINE.join([TWIST, VECTOR]),
    "sensor_msgs/msg/JointState": LINE.join(
        [
            "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort",
            HEADER,
            TIME,
        ]
    ),
    "sensor_msgs/msg/Imu": LINE.join(
        [
            (
                "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
                "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
                "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance"
            ),
            HEADER,
            TIME,
            QUATERNION,
            VECTOR,
        ]
    ),
    "sensor_msgs/msg/BatteryState": LINE.join(
        [
            (
                "std_msgs/Header header\nfloat32 voltage\nfloat32 temperature\nfloat32 current\nfloat32 charge\nfloat32"
                " capacity\nfloat32 design_capacity\nfloat32 percentage\nuint8 power_supply_status\nuint8"
                " power_supply_health\nuint8 power_supply_technology\nbool present\nfloat32[] cell_voltage\nfloat32[]"
                " cell_temperature\nstring location\nstring serial_number"
            ),
            HEADER,
            TIME,
        ]
    ),
    "turtlebot3_msgs/msg/SensorState": LINE.join(
        [
            (
                "std_msgs/Header header\nuint8 bumper\nfloat32 cliff\nfloat32 sonar\nfloat32 illumination\nuint8"
                " led\nuint8 button\nbool torque\nint32 left_encoder\nint32 right_encoder\nfloat32 battery"
            ),
            HEADER,
            TIME,
        ]
    ),
    "nav_msgs/msg/Odometry": LINE.join(
        [
            (
                "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
                "geometry_msgs/TwistWithCovariance twist"
            ),
            HEADER,
            TIME,
            "MSG: geometry_msgs/PoseWithCovariance\ngeometry_msgs/Pose pose\nfloat64[36] covariance",
            "MSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
            POINT,
            QUATERNION,
            "MSG: geometry_msgs/TwistWithCovariance\ngeometry_msgs/Twist twist\nfloat64[36] covariance",
            "MSG: geometry_msgs/Twist\n" + TWIST,
            VECTOR,
        ]
    ),
}


@dataclass(frozen=True)
class Clock:
    """How a recording is stamped: the latest a read-out is stamped after it happened, s; when it began, s since
    1970.
    """

    stamp_delay_s: float = 0.002
    start_s: int = 1_760_000_000


def _firmware(linear: float, angular: float) -> list[float]:
    """Goals of both servos, rad/s, of a twist: whole hundredths, limits, whole counts."""
    linear = max(-TOP_M_S, min(TOP_M_S, math.trunc(linear * 100.0) / 100.0))
    most = TOP_M_S / (TRACK / 2.0)
    angular = max(-most, min(most, math.trunc(angular * 100.0) / 100.0))
    return [
        math.trunc((linear + sign * angular * TRACK / 2.0) / RADIUS / RPM_COUNT) * RPM_COUNT for sign in (-1.0, 1.0)
    ]


def _flat(yaw: float) -> dict:
    return {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2.0), "w": math.cos(yaw / 2.0)}


def _vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> dict:
    return {"x": x, "y": y, "z": z}


def plan(kind: str, chance: random.Random) -> list[tuple[float, float, float]]:
    """Parts of a drive: seconds, m/s, rad/s."""
    rest = [(1.2, 0.0, 0.0)]
    if kind == "lanes":
        return (
            rest + [(2.0, 0.17, 0.0), (0.7, 0.0, 0.0), (1.6, -0.12, 0.0), (0.7, 0.0, 0.0), (1.2, 0.05, 0.0)] * 3 + rest
        )
    if kind == "turns":
        return rest + [(1.8, 0.0, 1.5), (0.7, 0.0, 0.0), (1.6, 0.0, -0.8), (0.7, 0.0, 0.0), (1.0, 0.0, 0.4)] * 3 + rest
    return (
        rest
        + [(chance.uniform(0.6, 1.7), chance.uniform(-0.18, 0.18), chance.uniform(-0.9, 0.9)) for _ in range(16)]
        + rest
    )


def record(path: Path, robot: Burger, kind: str, clock: Clock, chance: random.Random) -> None:
    """Drive a plan and write the bag."""
    parts = plan(kind, chance)
    ends = [sum(seconds for seconds, _, _ in parts[: k + 1]) for k in range(len(parts))]
    latency = chance.uniform(0.001, 0.004)
    commands = [0.4 + COMMAND_S * k + chance.uniform(0.0, 0.005) for k in range(int((ends[-1] - 0.5) / COMMAND_S))]
    acting = [(t + latency + robot.fault.delay_s, t) for t in commands]
    reads = [READ_S * k + chance.uniform(0.0, 0.003) for k in range(int(ends[-1] / READ_S))]
    before, last, odometry = [0.0, 0.0], None, [0.0, 0.0, 0.0]
    asked = iter([*acting, (math.inf, 0.0)])
    due, since = next(asked)
    buffer = io.BytesIO()
    with Writer(buffer) as writer:
        schemas = {name: writer.register_msgdef(name, text) for name, text in TYPES.items()}

        def put(topic: str, kind: str, message: dict, at_s: float) -> None:
            now = clock.start_s * NS + round(at_s * NS)
            writer.write_message(topic, schemas[kind], message, log_time=now, publish_time=now)

        def drive(until: float) -> None:
            nonlocal due, since
            while robot.time_s < until:
                while robot.time_s >= due:
                    _, linear, angular = parts[next(k for k, end in enumerate(ends) if since < end)]
                    robot.goal = _firmware(linear, angular)
                    due, since = next(asked)
                robot.step()

        for t in commands:
            _, linear, angular = parts[next(k for k, end in enumerate(ends) if t < end)]
            put("/cmd_vel", "geometry_msgs/msg/Twist", {"linear": _vector(x=linear), "angular": _vector(z=angular)}, t)
        for t in reads:
            drive(t - 0.5 * STEP_S)
            stamped = t + chance.uniform(0.0, clock.stamp_delay_s)
            ns = clock.start_s * NS + round(stamped * NS)
            head = {"stamp": {"sec": ns // NS, "nanosec": ns % NS}, "frame_id": ""}
            heard = stamped + chance.uniform(0.0005, 0.002)
            ticks = [math.floor(a / ENCODER) for a in robot.angle]
            volts = round(robot.bus_v + chance.gauss(0.0, BUS), 2)
            put(
                "/sensor_state",
                "turtlebot3_msgs/msg/SensorState",
                {
                    "header": head,
                    "bumper": 0,
                    "cliff": 0.0,
                    "sonar": 0.0,
                    "illumination": 0.0,
                    "led": 0,
                    "button": 0,
                    "torque": True,
                    "left_encoder": ticks[0],
                    "right_encoder": ticks[1],
                    "battery": volts,
                },
                heard,
            )
            # The node divides by nothing: metres a second at the rim. Positions are those of the read-out before.
            put(
                "/joint_states",
                "sensor_msgs/msg/JointState",
                {
                    "header": head,
                    "name": ["wheel_left_joint", "wheel_right_joint"],
                    "position": list(before),
                    "velocity": [
                        RADIUS * RPM_COUNT * round(w / RPM_COUNT + chance.gauss(0.0, 0.5)) for w in robot.speed
                    ],
                    "effort": [],
                },
                heard,
            )
            put(
                "/imu",
                "sensor_msgs/msg/Imu",
                {
                    "header": head,
                    "orientation": _flat(robot.pose[2]),
                    "orientation_covariance": [0.0] * 9,
                    "angular_velocity": _vector(
                        chance.gauss(0.0, GYRO), chance.gauss(0.0, GYRO), robot.yaw_rate + chance.gauss(0.0, GYRO)
                    ),
                    "angular_velocity_covariance": [0.0] * 9,
                    "linear_acceleration": _vector(z=9.81),
                    "linear_acceleration_covariance": [0.0] * 9,
                },
                heard,
            )
            put(
                "/battery_state",
                "sensor_msgs/msg/BatteryState",
                {
                    "header": head,
                    "voltage": volts,
                    "temperature": 0.0,
                    "current": 0.0,
                    "charge": 0.0,
                    "capacity": 0.0,
                    "design_capacity": 1.8,
                    "percentage": 100.0 * (volts - 10.5) / 2.1,
                    "power_supply_status": 0,
                    "power_supply_health": 0,
                    "power_supply_technology": 0,
                    "present": True,
                    "cell_voltage": [],
                    "cell_temperature": [],
                    "location": "",
                    "serial_number": "",
                },
                heard,
            )
            if last is not None:
                rolled = [RADIUS * (b - a) for a, b in zip(last, before)]
                turned, way = (rolled[1] - rolled[0]) / TRACK, 0.5 * (rolled[0] + rolled[1])
                odometry = [
                    odometry[0] + way * math.cos(odometry[2] + turned / 2.0),
                    odometry[1] + way * math.sin(odometry[2] + turned / 2.0),
                    odometry[2] + turned,
                ]
                put(
                    "/odom",
                    "nav_msgs/msg/Odometry",
                    {
                        "header": head,
                        "child_frame_id": "base_footprint",
                        "pose": {
                            "pose": {"position": _vector(odometry[0], odometry[1]), "orientation": _flat(odometry[2])},
                            "covariance": [0.0] * 36,
                        },
                        "twist": {
                            "twist": {"linear": _vector(x=way / READ_S), "angular": _vector(z=turned / READ_S)},
                            "covariance": [0.0] * 36,
                        },
                    },
                    heard,
                )
                last = list(before)
            elif any(before):
                last = list(before)
            before = [k * ENCODER for k in ticks]
    path.write_bytes(buffer.getvalue())
