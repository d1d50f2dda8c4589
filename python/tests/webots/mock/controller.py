"""A mock of Webots' Python module `controller`: what its reference manual documents, and only that.

The world's file says what robot there is. It moves in one of this project's physics engines, with the masses, moments
of inertia, places and slope of the file. What Webots refuses, or clips with a warning, raises `Refused` here.
"""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
from wbt import DEVICES, Node, read_world, robot_of

from rtds_host.robot import Body, RobotState, open_engine


class Refused(Exception):
    """What Webots refuses, clips or answers with NaN."""


def _rotation(axis_angle: tuple[float, ...]) -> np.ndarray:
    """A rotation (3, 3) by the half angle's quaternion."""
    x, y, z = math.sin(0.5 * axis_angle[3]) * np.array(axis_angle[:3])
    w = math.cos(0.5 * axis_angle[3])
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _argument(value: object, what: str) -> float:
    if not isinstance(value, int | float) or math.isnan(value):
        raise Refused(f"{what}() called with an invalid argument ({value!r})")
    return float(value)


class Device:
    """A device of the robot."""

    def __init__(self, robot: Robot, name: str):
        self._robot, self._name = robot, name

    def getName(self) -> str:
        return self._name


class Sensor(Device):
    """A sensor: enabled first, and of value once a sampling period has passed."""

    def __init__(self, robot: Robot, name: str):
        super().__init__(robot, name)
        self._period, self._since = 0, 0

    def enable(self, sampling_period: int) -> None:
        if not isinstance(sampling_period, int) or sampling_period < 0:
            raise Refused(f"{self._name}: enable() called with sampling period {sampling_period!r}")
        if sampling_period % self._robot.basic_ms:
            raise Refused(f"{self._name}: a sampling period of {sampling_period} ms is no multiple of basicTimeStep")
        self._period, self._since = sampling_period, self._robot.now_ms

    def getSamplingPeriod(self) -> int:
        return self._period

    def check_ready(self) -> None:
        if self._period <= 0:
            raise Refused(f"{self._name}: read for a disabled device")
        if self._robot.now_ms < self._since + self._period:
            raise Refused(f"{self._name}: read before the first sampling period has passed")


class PositionSensor(Sensor):
    """Angle of a wheel, rad."""

    def getValue(self) -> float:
        self.check_ready()
        return float(self._robot.angles[self._robot.side_of(self._name)])


class GPS(Sensor):
    """Place of the device in the world, m."""

    def getValues(self) -> list[float]:
        self.check_ready()
        return self._robot.place_of(self._robot.nodes[self._name]["translation"]).tolist()


class Gyro(Sensor):
    """Angular velocity in the robot's axes, rad/s."""

    def getValues(self) -> list[float]:
        self.check_ready()
        return [0.0, 0.0, self._robot.state.yaw_rate_rad_s]


class Motor(Device):
    """A wheel's motor, in velocity control alone: the engine behind knows no other."""

    def __init__(self, robot: Robot, name: str):
        super().__init__(robot, name)
        node = robot.nodes[name]
        self._max_velocity, self._max_torque = node["maxVelocity"], node["maxTorque"]
        self.position, self.velocity, self.torque = 0.0, self._max_velocity, math.nan
        self.feedback = Sensor(robot, name)

    def setPosition(self, position: float) -> None:
        self.position = _argument(position, "setPosition")

    def setVelocity(self, velocity: float) -> None:
        value = _argument(velocity, "setVelocity")
        if value < 0.0 and not math.isinf(self.position):
            raise Refused("setVelocity() called with a negative velocity in position control")
        if abs(value) > self._max_velocity:
            raise Refused(f"The requested velocity {value} exceeds 'maxVelocity' = {self._max_velocity}")
        self.velocity = value

    def setAvailableTorque(self, torque: float) -> None:
        value = _argument(torque, "setAvailableTorque")
        if not 0.0 <= value <= self._max_torque:
            raise Refused(f"The requested available motor torque {value} exceeds 'maxTorque' = {self._max_torque}")

    def getMaxVelocity(self) -> float:
        return self._max_velocity

    def getMaxTorque(self) -> float:
        return self._max_torque

    def enableTorqueFeedback(self, sampling_period: int) -> None:
        self.feedback.enable(sampling_period)

    def getTorqueFeedback(self) -> float:
        self.feedback.check_ready()
        return self.torque


class Solid:
    """The supervisor's handle of the robot's node."""

    def __init__(self, robot: Robot):
        self._robot = robot

    def getOrientation(self) -> list[float]:
        return self._robot.orientation().ravel().tolist()


KINDS = {"RotationalMotor": Motor, "PositionSensor": PositionSensor, "GPS": GPS, "Gyro": Gyro}


def body_of(nodes: list[Node]) -> tuple[Body, tuple[float, float, float]]:
    """The body that a world's file describes, and where it starts in the tilted ground (x m, y m, yaw rad).

    The parts' masses, centres and moments are put together again: wheels are discs that stand upright.
    """
    robot = robot_of(nodes)
    (ground,) = (node for node in nodes if node.name == "GROUND")
    tilt = _rotation(ground["rotation"])
    wheels = [joint["endPoint"] for joint in robot.all("HingeJoint")]
    base, wheel = robot["physics"], wheels[0]["physics"]
    mass, com = base["mass"], np.array(base["centerOfMass"][0])
    masses = [one["physics"]["mass"] for one in wheels]
    places = [np.array(one["translation"]) for one in wheels]
    total = mass + sum(masses)
    centre = (mass * com + sum(m * p for m, p in zip(masses, places, strict=True))) / total
    yaw = base["inertiaMatrix"][0][2] + mass * float(com[:2] @ com[:2])
    for one, place in zip(wheels, places, strict=True):
        yaw += one["physics"]["inertiaMatrix"][0][2] + one["physics"]["mass"] * float(place[:2] @ place[:2])
    (contact,) = (c for c in nodes[0]["contactProperties"] if c["material1"] == "tyre")
    skids = [one["translation"] for one in robot["boundingObject"]["children"]]
    uphill = tilt.T @ np.array([0.0, 0.0, 1.0])
    turned = tilt.T @ _rotation(robot["rotation"])
    at = tilt.T @ np.array(robot["translation"])
    body = Body(
        mass_kg=total,
        payload_kg=0.0,
        yaw_inertia_kg_m2=yaw,
        wheel_radius_m=tuple(one["boundingObject"]["radius"] for one in wheels),
        wheel_inertia_kg_m2=wheel["inertiaMatrix"][0][1],
        track_width_m=places[0][1] - places[1][1],
        com_m=tuple(centre.tolist()),
        slope_rad=math.acos(min(1.0, float(tilt[2, 2]))),
        uphill_yaw_rad=math.atan2(uphill[1], uphill[0]),
        tyre_friction=contact["coulombFriction"][0],
        skid_arm_m=0.5 * (max(s[0] for s in skids) - min(s[0] for s in skids)),
    )
    return body, (float(at[0]), float(at[1]), math.atan2(turned[1, 0], turned[0, 0]))


class Robot:
    """The robot of the world that the environment names (`MOCK_WORLD`), in the engine `MOCK_ENGINE`.

    `MOCK_END_MS`: simulated time at which Webots ends the controller, as when its world is reloaded.
    """

    created = False

    def __init__(self) -> None:
        if Robot.created:
            raise Refused("only one Robot instance can be created per controller process")
        Robot.created = True
        world = read_world(Path(os.environ["MOCK_WORLD"]).read_text())
        self._node, self._tilt = robot_of(world), _rotation(next(n for n in world if n.name == "GROUND")["rotation"])
        self.nodes = {one["name"]: one for kind in DEVICES for one in self._node.all(kind)}
        step = world[0]["basicTimeStep"]
        self.basic_ms, self.now_ms = int(step), 0
        self.ends_ms = int(os.environ.get("MOCK_END_MS", "0"))
        body, pose = body_of(world)
        self._engine = open_engine(os.environ["MOCK_ENGINE"], body, pose, 1e-3 * step)
        self._state: RobotState | None = None
        self.angles = np.zeros(2)
        self._devices = {name: KINDS[node.type](self, name) for name, node in self.nodes.items()}
        joints = self._node.all("HingeJoint")
        self.motors = [self._devices[joint["device"][0]["name"]] for joint in joints]
        self._sides = {one["name"]: k for k, joint in enumerate(joints) for one in joint["device"]}

    @property
    def state(self) -> RobotState:
        """Where the robot is now; asked of the engine when somebody looks."""
        if self._state is None:
            self._state = self._engine.state()
        return self._state

    def side_of(self, name: str) -> int:
        """0 of a device on the left, 1 on the right."""
        return self._sides[name]

    def orientation(self) -> np.ndarray:
        """Rotation (3, 3) from the robot's axes to the world's."""
        # What an engine reports has half a step's travel taken off; Webots reports where its bodies are.
        yaw = self.state.yaw_rad + 0.5e-3 * self.basic_ms * self.state.yaw_rate_rad_s
        return self._tilt @ _rotation((0.0, 0.0, 1.0, yaw))

    def place_of(self, inside: tuple[float, ...]) -> np.ndarray:
        """Place (3,) in the world of a point of the robot."""
        half, state = 0.5e-3 * self.basic_ms, self.state
        yaw = state.yaw_rad + half * state.yaw_rate_rad_s
        ahead = half * state.speed_m_s * np.array([math.cos(yaw), math.sin(yaw), 0.0])
        return self._tilt @ (np.array([state.x_m, state.y_m, 0.0]) + ahead) + self.orientation() @ np.array(inside)

    def getBasicTimeStep(self) -> float:
        return float(self.basic_ms)

    def getTime(self) -> float:
        return 1e-3 * self.now_ms

    def getCustomData(self) -> str:
        return self._node["customData"]

    def getDevice(self, name: str) -> Device | None:
        return self._devices.get(name)

    def step(self, time_step: int) -> int:
        if not isinstance(time_step, int) or time_step <= 0 or time_step % self.basic_ms:
            raise Refused(f"step({time_step!r}): no multiple of basicTimeStep = {self.basic_ms} ms")
        for _ in range(time_step // self.basic_ms):
            if self.ends_ms and self.now_ms >= self.ends_ms:
                return -1
            if not all(math.isinf(motor.position) for motor in self.motors):
                raise Refused("a motor is in position control, which is not what this robot is driven with")
            speeds = np.array([[motor.velocity for motor in self.motors]])
            torques = self._engine.advance(speeds)
            for motor, torque in zip(self.motors, torques.tolist(), strict=True):
                motor.torque = torque
            self.angles = self.angles + 1e-3 * self.basic_ms * speeds[0]
            self._state = None
            self.now_ms += self.basic_ms
        return 0


class Supervisor(Robot):
    """A robot whose node has `supervisor TRUE`."""

    def __init__(self) -> None:
        super().__init__()
        if not self._node["supervisor"]:
            raise Refused("the robot is no supervisor")

    def getSelf(self) -> Solid:
        return Solid(self)

    def simulationQuit(self, status: int) -> None:
        print(f"simulationQuit({status})", flush=True)
