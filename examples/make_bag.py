"""Make the example recordings: three TurtleBot3 bags and one csv log, of a robot whose left gear runs tight.

    .venv/bin/python examples/make_bag.py --out examples

The robot is simulated here from scratch (nothing of the diagnosis is used): two gearmotors, wheels that roll
without slip, and the servo's speed loop. Against the nominal robot it has one fault that no file but truth.json
mentions. What is recorded is what turtlebot3_node records at 20 Hz, oddities included: joint velocities in m/s,
positions one sample late, no effort, commands cut to 0.01 and to whole counts of the servo, battery percentage
from 0 to 100, an odometry worked out from the wheels.

The same seed gives the same bytes.
"""

from __future__ import annotations

import argparse
import io
import json
import math
from pathlib import Path

import numpy as np
from mcap_ros2.writer import Writer

from rtds_host.importers.messages import definition, full_name

SEED = 20260611
NS = 1_000_000_000
EPOCH_S = 1_781_164_800  # 2026-06-11 08:00:00 UTC

# The nominal robot (robots/burger.toml), written down again so that this file stands alone.
R, KM, J, B, N = 8.6, 6.538e-3, 1.0e-7, 4.372e-7, 258.5
SUPPLY, MASS, YAW_INERTIA, RADIUS, WHEEL_INERTIA, TRACK = 12.0, 1.0, 2.5e-3, 0.033, 2.07e-5, 0.160
# The servo's speed loop, and its count of speed.
KP, KI, PERIOD = 0.4417, 8.628, 0.001
COUNT = 0.229 * 2.0 * math.pi / 60.0
ENCODER = 2.0 * math.pi / 4096.0
# What the nominal robot does not have: dry friction in the left gear, N*m at the wheel.
TIGHT = (0.12, 0.0)

SENSOR_STATE = {
    "turtlebot3_msgs/SensorState": """std_msgs/Header header
uint8 bumper
float32 cliff
float32 sonar
float32 illumination
uint8 led
uint8 button
bool torque
int32 left_encoder
int32 right_encoder
float32 battery"""
}


class Robot:
    """Planar robot; the armature's 0.1 ms are neglected. State: wheel speeds and angles, pose."""

    def __init__(self):
        self.w = np.zeros(2)
        self.th = np.array([37.4, 35.9])
        self.pose = np.zeros(3)
        self.current = np.zeros(2)
        inertia = N * N * J + WHEEL_INERTIA
        forward, spin = MASS * RADIUS**2 / 4.0, YAW_INERTIA * RADIUS**2 / TRACK**2
        self.inverse = np.linalg.inv(
            [[inertia + forward + spin, forward - spin], [forward - spin, inertia + forward + spin]]
        )

    def step(self, volts: np.ndarray, dt: float) -> None:
        """Advance by dt (s) under armature voltages (2,)."""
        volts = np.clip(volts, -SUPPLY, SUPPLY)
        self.current = (volts - KM * N * self.w) / R
        torque = N * KM * self.current - N * N * B * self.w
        free = self.w + dt * (self.inverse @ torque)
        # Dry friction takes speed away until a wheel stands, never more.
        for side, friction in enumerate(TIGHT):
            most = dt * self.inverse[side, side] * friction
            free[side] -= math.copysign(min(most, abs(free[side])), free[side])
        self.th += dt * (self.w + free) / 2.0
        speed = RADIUS * (self.w + free).sum() / 4.0
        turn = RADIUS * ((free[1] + self.w[1]) - (free[0] + self.w[0])) / (2.0 * TRACK)
        heading = self.pose[2] + turn * dt / 2.0
        self.pose += dt * np.array([speed * math.cos(heading), speed * math.sin(heading), turn])
        self.w = free


def goal(linear: float, angular: float) -> np.ndarray:
    """Wheel speeds (2,) rad/s the servos are asked for, after every cut between /cmd_vel and their registers."""
    top = RADIUS * 2.0 * math.pi * 61.0 / 60.0
    linear = min(max(int(linear * 100) / 100, -top), top)
    angular = min(max(int(angular * 100) / 100, -top / 0.08), top / 0.08)
    return np.array([int((linear + sign * angular * TRACK / 2.0) / RADIUS / COUNT) * COUNT for sign in (-1.0, 1.0)])


def plan(name: str, rng: np.random.Generator) -> list[tuple[float, float, float]]:
    """(seconds, m/s, rad/s) one after the other."""
    if name == "square":
        return [(1.0, 0.0, 0.0)] + [(2.6, 0.153, 0.0), (0.6, 0.0, 0.0), (1.5, 0.0, 1.047), (0.6, 0.0, 0.0)] * 4
    if name == "spin":
        return [
            (1.0, 0.0, 0.0),
            (3.0, 0.0, 1.2),
            (1.5, 0.0, -1.2),
            (1.0, 0.0, 0.0),
            (3.0, 0.0, -2.05),
            (1.5, 0.0, 0.6),
            (1.5, 0.0, -0.6),
            (1.0, 0.0, 0.0),
        ] * 2
    return (
        [(1.0, 0.0, 0.0)]
        + [
            (float(rng.uniform(0.5, 1.6)), float(rng.uniform(-0.19, 0.19)), float(rng.uniform(-0.9, 0.9)))
            for _ in range(22)
        ]
        + [(1.0, 0.0, 0.0)]
    )


def record(name: str, rng: np.random.Generator, start_s: int) -> bytes:
    """Drive one plan and return the bag, as MCAP."""
    dt = PERIOD / 2.0
    robot = Robot()
    phases = plan(name, rng)
    ends = np.cumsum([seconds for seconds, _, _ in phases])
    total = float(ends[-1])
    # A teleoperation node repeats its command at 10 Hz; the driver node reads the board at 20 Hz; both jitter.
    command_times = np.arange(0.35, total, 0.1) + rng.uniform(0.0, 0.004, len(np.arange(0.35, total, 0.1)))
    read_times = np.arange(0.0, total, 0.05) + rng.uniform(0.0, 0.002, len(np.arange(0.0, total, 0.05)))
    wanted, integral, volts = np.zeros(2), np.zeros(2), np.zeros(2)
    late = robot_position = np.zeros(2)
    odometry, last_late = np.zeros(3), None
    next_command = next_read = 0
    buffer = io.BytesIO()
    with Writer(buffer) as writer:
        schemas = {}

        def put(topic: str, kind: str, message: dict, now_ns: int) -> None:
            if kind not in schemas:
                schemas[kind] = writer.register_msgdef(full_name(kind), definition(kind, SENSOR_STATE))
            writer.write_message(topic, schemas[kind], message, log_time=now_ns, publish_time=now_ns)

        for k in range(round(total / dt)):
            t = k * dt
            if next_read < len(read_times) and t >= read_times[next_read]:
                # One read-out of the board: everything below is the state at this moment.
                next_read += 1
                stamp_ns = start_s * NS + round(t * NS)
                arrived = stamp_ns + int(rng.uniform(1.0e6, 3.0e6))
                stamp = {"sec": stamp_ns // NS, "nanosec": stamp_ns % NS}
                counts = [math.floor(a / ENCODER) for a in robot.th]
                speeds = [round((w + rng.normal(0.0, 0.02)) / COUNT) for w in robot.w]
                rate = RADIUS * (robot.w[1] - robot.w[0]) / TRACK + rng.normal(0.0, 0.003)
                volt = round(SUPPLY + rng.normal(0.0, 0.03), 2)
                put(
                    "/battery_state",
                    "sensor_msgs/BatteryState",
                    {
                        "header": {"stamp": stamp, "frame_id": ""},
                        "voltage": volt,
                        "temperature": 0.0,
                        "current": 0.0,
                        "charge": 0.0,
                        "capacity": 0.0,
                        "design_capacity": 1.8,
                        "percentage": (volt - 10.5) / 1.8 * 100.0,
                        "power_supply_status": 0,
                        "power_supply_health": 0,
                        "power_supply_technology": 0,
                        "present": True,
                        "cell_voltage": [],
                        "cell_temperature": [],
                        "location": "",
                        "serial_number": "",
                    },
                    arrived,
                )
                half = robot.pose[2] / 2.0
                put(
                    "/imu",
                    "sensor_msgs/Imu",
                    {
                        "header": {"stamp": stamp, "frame_id": "imu_link"},
                        "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)},
                        "orientation_covariance": [0.0] * 9,
                        "angular_velocity": {"x": rng.normal(0.0, 0.003), "y": rng.normal(0.0, 0.003), "z": rate},
                        "angular_velocity_covariance": [0.0] * 9,
                        "linear_acceleration": {
                            "x": rng.normal(0.0, 0.05),
                            "y": rng.normal(0.0, 0.05),
                            "z": 9.81 + rng.normal(0.0, 0.05),
                        },
                        "linear_acceleration_covariance": [0.0] * 9,
                    },
                    arrived + 20_000,
                )
                put(
                    "/sensor_state",
                    "turtlebot3_msgs/SensorState",
                    {
                        "header": {"stamp": stamp, "frame_id": ""},
                        "bumper": 0,
                        "cliff": 0.0,
                        "sonar": 0.0,
                        "illumination": 0.0,
                        "led": 0,
                        "button": 0,
                        "torque": True,
                        "left_encoder": counts[0],
                        "right_encoder": counts[1],
                        "battery": volt,
                    },
                    arrived + 40_000,
                )
                # The node publishes the positions of the read-out before this one.
                late, robot_position = robot_position, np.array(counts) * ENCODER
                put(
                    "/joint_states",
                    "sensor_msgs/JointState",
                    {
                        "header": {"stamp": stamp, "frame_id": "base_link"},
                        "name": ["wheel_left_joint", "wheel_right_joint"],
                        "position": late.tolist(),
                        "velocity": [RADIUS * COUNT * s for s in speeds],
                        "effort": [],
                    },
                    arrived + 60_000,
                )
                rolled = np.zeros(2) if last_late is None else RADIUS * (late - last_late)
                last_late = late if next_read > 1 else None
                turned = float(rolled[1] - rolled[0]) / TRACK
                odometry = odometry + [
                    rolled.mean() * math.cos(odometry[2] + turned / 2.0),
                    rolled.mean() * math.sin(odometry[2] + turned / 2.0),
                    turned,
                ]
                half = odometry[2] / 2.0
                put(
                    "/odom",
                    "nav_msgs/Odometry",
                    {
                        "header": {"stamp": stamp, "frame_id": "odom"},
                        "child_frame_id": "base_footprint",
                        "pose": {
                            "pose": {
                                "position": {"x": float(odometry[0]), "y": float(odometry[1]), "z": 0.0},
                                "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)},
                            },
                            "covariance": [0.0] * 36,
                        },
                        "twist": {
                            "twist": {
                                "linear": {"x": float(rolled.mean()) / 0.05, "y": 0.0, "z": 0.0},
                                "angular": {"x": 0.0, "y": 0.0, "z": turned / 0.05},
                            },
                            "covariance": [0.0] * 36,
                        },
                    },
                    arrived + 400_000,
                )
            if next_command < len(command_times) and t >= command_times[next_command]:
                next_command += 1
                _, linear, angular = phases[int(np.searchsorted(ends, t, side="right"))]
                put(
                    "/cmd_vel",
                    "geometry_msgs/Twist",
                    {"linear": {"x": linear, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": angular}},
                    start_s * NS + round(t * NS),
                )
                wanted = goal(linear, angular)
            if k % 2 == 0:
                miss = wanted - robot.w
                integral = np.clip(integral + KI * PERIOD * miss, -SUPPLY, SUPPLY)
                volts = KP * miss + integral
            robot.step(volts, dt)
    return buffer.getvalue()


def table(rng: np.random.Generator) -> str:
    """A logger of its own kind, on the same robot with a plain PWM driver: ms, counts, rpm, degrees, mA, mV."""
    robot = Robot()
    dt = 0.0005
    lines = [
        (
            "time_ms;pwm_left;pwm_right;rpm_left;rpm_right;angle_left_deg;angle_right_deg;"
            "current_left_mA;current_right_mA;yaw_rate_dps;battery_mV"
        )
    ]
    pwm = np.zeros(2, dtype=int)
    for row in range(900):
        if row % 30 == 0 and row >= 30:
            pwm = rng.integers(-200, 201, 2)
        rpm = (robot.w + rng.normal(0.0, 0.02, 2)) * 60.0 / (2.0 * math.pi)
        angle = np.degrees(np.floor(robot.th / ENCODER) * ENCODER)
        milliamperes = 1e3 * (robot.current + rng.normal(0.0, 0.004, 2))
        rate = math.degrees(RADIUS * (robot.w[1] - robot.w[0]) / TRACK + rng.normal(0.0, 0.003))
        # The current sensor is slower than the rest: every other row.
        currents = ";".join(f"{value:.1f}" if row % 2 == 0 else "" for value in milliamperes)
        lines.append(
            f"{row * 20};{pwm[0]};{pwm[1]};{rpm[0]:.2f};{rpm[1]:.2f};{angle[0]:.3f};{angle[1]:.3f};"
            f"{currents};{rate:.2f};{1e3 * SUPPLY + rng.normal(0.0, 30.0):.0f}"
        )
        for _ in range(40):
            robot.step(pwm / 255.0 * SUPPLY, dt)
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("examples"))
    parser.add_argument("--seed", type=int, default=SEED)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    for n, name in enumerate(("square", "spin", "wander")):
        data = record(name, np.random.default_rng([args.seed, n]), EPOCH_S + 120 * n)
        (args.out / f"{name}.mcap").write_bytes(data)
        print(f"{args.out / name}.mcap: {len(data) / 1024:.0f} KiB")
    (args.out / "rover.csv").write_text(table(np.random.default_rng([args.seed, 9])))
    truth = {"effects": [{"id": "coulomb_friction", "side": "left", "parameters": {"torque_nm": TIGHT[0]}}]}
    (args.out / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")


if __name__ == "__main__":
    main()
