"""PyBullet behind the engine's interface."""

from __future__ import annotations

import contextlib
import math
import os
import sys

import numpy as np

from rtds_host.cleanup import temporary_folder
from rtds_host.compat import Self
from rtds_host.errors import InputError
from rtds_host.robot.body import Body, inertia_at_wheel_kg_m2
from rtds_host.robot.engine import STEP_S, RobotState
from rtds_host.robot.urdf import WHEEL_JOINTS, make_urdf, supports
from rtds_host.robot.window import windowed
from rtds_host.vectors import cross


@contextlib.contextmanager
def _silent():
    """PyBullet greets on standard error, below Python, when it is imported."""
    sys.stderr.flush()
    kept = os.dup(2)
    sink = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(sink, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(sink)


with _silent():
    import pybullet

# The contact solver goes from a wheel's motor to its contact and back until both agree. A light wheel (0.02 kg at its
# rim) between a motor and a body of 3 kg makes that slow: 2.6 % of speed is missing after 50 iterations, 0.02 ppm after
# 1000. The wheels' speeds are given here, so their spin inertia acts on nothing but the motor's own torque: the engine
# gets wheels with a flywheel of the body's inertia, which converges ten times sooner, and the flywheel's torque,
# known exactly from the given speeds, is taken off what the engine reports.
ITERATIONS = 1000
RESIDUAL = 1e-13
FLYWHEEL = 1.0
MOTOR_LIMIT_NM = 1e3
SETTLE_S = 0.5

Pose = tuple[float, float, float]  # x, y in m, yaw in rad


class PyBulletEngine:
    """See `rtds_host.robot.engine.Engine`."""

    def __init__(
        self,
        body: Body,
        pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
        step_s: float = STEP_S,
        iterations: int = ITERATIONS,
    ):
        self.step_s = step_s
        self._body = body
        with _silent():
            self._client = pybullet.connect(pybullet.GUI if windowed() else pybullet.DIRECT)
        if self._client < 0:
            raise InputError("--gui: PyBullet cannot open its window")
        self._load(pose, iterations)
        self._origin = (0.0, 0.0, 0.0)
        self._start = pose
        self._spin = self.wheel_speeds()  # after the last step
        self._held = self.advance(np.zeros((max(1, round(SETTLE_S / step_s)), 2)), last=0.1)
        # Settling moves the robot by micrometres; the run's pose counts from where it then stands.
        self._origin = self._planar(*self._axle())
        self._turns = 0.0
        self._yaw_before = self._origin[2]

    def _load(self, pose: tuple[float, float, float], iterations: int) -> None:
        p, client = pybullet, self._client
        p.setPhysicsEngineParameter(
            fixedTimeStep=self.step_s,
            numSolverIterations=iterations,
            numSubSteps=0,
            deterministicOverlappingPairs=1,
            solverResidualThreshold=RESIDUAL,
            enableConeFriction=1,
            physicsClientId=client,
        )
        p.setGravity(*self._body.gravity_m_s2, physicsClientId=client)
        ground = p.createMultiBody(
            0, p.createCollisionShape(p.GEOM_PLANE, physicsClientId=client), physicsClientId=client
        )
        p.changeDynamics(
            ground,
            -1,
            lateralFriction=1.0,
            rollingFriction=0.0,
            spinningFriction=0.0,
            restitution=0.0,
            physicsClientId=client,
        )
        with temporary_folder() as folder:
            path = os.path.join(folder, "robot.urdf")
            with open(path, "w", encoding="ascii") as stream:
                stream.write(make_urdf(self._body))
            flags = p.URDF_USE_INERTIA_FROM_FILE | p.URDF_MAINTAIN_LINK_ORDER
            self._robot = p.loadURDF(
                path,
                [pose[0], pose[1], 0.0],
                p.getQuaternionFromEuler([0.0, 0.0, pose[2]]),
                flags=flags,
                physicsClientId=client,
            )
        links = {
            p.getJointInfo(self._robot, k, physicsClientId=client)[12].decode(): k
            for k in range(p.getNumJoints(self._robot, physicsClientId=client))
        }
        self._wheels = [links[joint.removesuffix("_joint")] for joint in WHEEL_JOINTS]
        slippery = [links[name] for name, _ in supports(self._body)]
        for link in range(-1, len(links)):
            p.changeDynamics(
                self._robot,
                link,
                lateralFriction=0.0 if link in slippery else self._body.tyre_friction,
                rollingFriction=0.0,
                spinningFriction=0.0,
                restitution=0.0,
                linearDamping=0.0,
                angularDamping=0.0,
                jointDamping=0.0,
                physicsClientId=client,
            )
        p.changeDynamics(self._robot, -1, activationState=p.ACTIVATION_STATE_DISABLE_SLEEPING, physicsClientId=client)
        spin = self._body.wheel_inertia_kg_m2
        self._flywheel = FLYWHEEL * inertia_at_wheel_kg_m2(self._body)
        for wheel in self._wheels:
            p.changeDynamics(
                self._robot,
                wheel,
                localInertiaDiagonal=[0.5 * spin, spin + self._flywheel, 0.5 * spin],
                physicsClientId=client,
            )
        self._com_local = np.array(p.getDynamicsInfo(self._robot, -1, physicsClientId=client)[3])

    def hold(self) -> np.ndarray:
        return self._held.copy()

    def advance(self, speeds_rad_s: np.ndarray, last: float = 1.0) -> np.ndarray:
        # `last`: the share of the steps, counted from the end, that the mean is taken over.
        p, client, robot, wheels = pybullet, self._client, self._robot, self._wheels
        limit = [MOTOR_LIMIT_NM, MOTOR_LIMIT_NM]
        left = right = 0.0
        first = len(speeds_rad_s) - max(1, round(last * len(speeds_rad_s)))
        before = self._spin
        for k, targets in enumerate(np.asarray(speeds_rad_s, dtype=float).tolist()):
            p.setJointMotorControlArray(
                robot, wheels, p.VELOCITY_CONTROL, targetVelocities=targets, forces=limit, physicsClientId=client
            )
            p.stepSimulation(physicsClientId=client)
            if k >= first:
                one, two = p.getJointStates(robot, wheels, physicsClientId=client)
                left += one[3]
                right += two[3]
        count = len(speeds_rad_s) - first
        # The last step's states hold the wheels' speeds, too, and no call but this one moves them.
        self._spin = np.array([one[1], two[1]])
        gain = self._flywheel * (self._spin - before) / (count * self.step_s)
        return np.array([left / count, right / count]) - gain

    def _base(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Rotation (3, 3), centre of mass, velocity there and angular velocity of the base link."""
        position, quaternion = pybullet.getBasePositionAndOrientation(self._robot, physicsClientId=self._client)
        linear, angular = pybullet.getBaseVelocity(self._robot, physicsClientId=self._client)
        rotation = np.array(pybullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)
        return rotation, np.array(position), np.array(linear), np.array(angular)

    def _axle(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Rotation (3, 3) of the base, mid-point of the axle, velocity there and angular velocity."""
        rotation, com, linear, angular = self._base()
        arm = rotation @ (np.array([0.0, 0.0, 0.5 * sum(self._body.wheel_radius_m)]) - self._com_local)
        return rotation, com + arm, linear + cross(angular, arm), angular

    def _planar(self, rotation: np.ndarray, axle: np.ndarray, velocity: np.ndarray, angular: np.ndarray) -> Pose:
        """x, y and wrapped yaw of the axle's mid-point, to second order in the step.

        The engine integrates position with the speed at the end of a step; half a step's travel of the present speed
        is taken off, which turns that into the trapezoidal rule.
        """
        axle = axle - 0.5 * self.step_s * velocity
        yaw = math.atan2(rotation[1, 0], rotation[0, 0]) - 0.5 * self.step_s * angular[2]
        return float(axle[0]), float(axle[1]), yaw

    def state(self) -> RobotState:
        rotation, axle, velocity, angular = self._axle()
        x, y, yaw = self._planar(rotation, axle, velocity, angular)
        self._turns += math.remainder(yaw - self._yaw_before, 2.0 * math.pi)
        self._yaw_before = yaw
        turn = self._start[2] - self._origin[2]
        dx, dy = x - self._origin[0], y - self._origin[1]
        return RobotState(
            x_m=self._start[0] + math.cos(turn) * dx - math.sin(turn) * dy,
            y_m=self._start[1] + math.sin(turn) * dx + math.cos(turn) * dy,
            yaw_rad=self._start[2] + self._turns,
            speed_m_s=float(velocity @ rotation[:, 0]),
            yaw_rate_rad_s=float(angular @ rotation[:, 2]),
            pitch_rad=-math.asin(rotation[2, 0]),
        )

    def wheel_speeds(self) -> np.ndarray:
        states = pybullet.getJointStates(self._robot, self._wheels, physicsClientId=self._client)
        return np.array([state[1] for state in states])

    def energy_j(self) -> float:
        p, client = pybullet, self._client
        gravity = self._body.gravity_m_s2
        rotation, com, linear, angular = self._base()
        info = p.getDynamicsInfo(self._robot, -1, physicsClientId=client)
        local = rotation.T @ angular
        energy = info[0] * (0.5 * linear @ linear - gravity @ com) + 0.5 * local @ (np.array(info[2]) * local)
        for link in self._wheels:
            info = p.getDynamicsInfo(self._robot, link, physicsClientId=client)
            state = p.getLinkState(self._robot, link, computeLinkVelocity=1, physicsClientId=client)
            rotation = np.array(p.getMatrixFromQuaternion(state[1])).reshape(3, 3)
            velocity, local = np.array(state[6]), rotation.T @ np.array(state[7])
            energy += info[0] * (0.5 * velocity @ velocity - gravity @ np.array(state[0]))
            moments = np.array(info[2]) - np.array([0.0, self._flywheel, 0.0])
            energy += 0.5 * local @ (moments * local)
        return float(energy)

    def close(self) -> None:
        if self._client is not None:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc) -> None:
        self.close()
