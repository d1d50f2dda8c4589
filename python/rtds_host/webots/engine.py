"""Webots behind the engine's interface: wheel speeds to its motors, their torques and the robot's pose back.

It uses only what Webots' reference manual documents of its Python interface: motors in velocity control with torque
feedback, position sensors, a GPS in the middle of the axle, a gyro, and the supervisor's orientation of the robot.
What is commanded before `step` acts in that step, and sensors are those of its end.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rtds_host.compat import Self
from rtds_host.contract import GRAVITY_M_S2
from rtds_host.errors import InputError, RtdsError
from rtds_host.robot import STEP_S, Body, RobotState
from rtds_host.robot.split import inertia_of
from rtds_host.robot.urdf import yaw_inertia_kg_m2
from rtds_host.webots.names import GPS, GYRO, WHEEL_MOTORS, WHEEL_SENSORS
from rtds_host.webots.world import ground_rotation

SETTLE_S = 0.5
# The share of settling, at its end, over which the holding torque is averaged.
SETTLED = 0.1
# A world of another slope, or of another robot, is no world for this run: angle, and share of the weight's torque.
SLOPE_TOLERANCE_RAD = 0.005
HOLD_TOLERANCE = 0.02


class RunEnded(RtdsError):
    """Webots ended the controller: its world was reloaded or closed."""


class WebotsEngine:
    """See `rtds_host.robot.engine.Engine`.

    Parameters
    ----------
    robot : Webots' `Supervisor`, of a world by `rtds_host.webots.world.make_world`.
    body : the body of that world.
    pose : where the robot starts in the tilted ground, m, m, rad.

    Raises
    ------
    InputError : a world that does not fit the body: a missing device, another slope or weight, a time step that is no
        whole number of milliseconds. RunEnded : see there.
    """

    def __init__(self, robot: Any, body: Body, pose: tuple[float, float, float]):
        self.step_s = STEP_S
        self._robot, self._body, self._start = robot, body, pose
        step_ms = robot.getBasicTimeStep()
        self._every = round(step_ms / (1e3 * STEP_S))
        if self._every < 1 or self._every != step_ms:
            raise InputError(f"basicTimeStep: is {step_ms:g} ms, it must be a whole number of milliseconds")
        self._tilt = ground_rotation(body.slope_rad, body.uphill_yaw_rad)
        self._motors = [self._device(name) for name in WHEEL_MOTORS]
        self._sensors = [self._device(name) for name in WHEEL_SENSORS]
        self._gps, self._gyro = self._device(GPS), self._device(GYRO)
        for sensor in (*self._sensors, self._gps, self._gyro):
            sensor.enable(self._every)
        for motor in self._motors:
            # Velocity control: the position to reach is infinite.
            motor.setPosition(float("inf"))
            motor.setVelocity(0.0)
            motor.enableTorqueFeedback(self._every)
        self._speed_limits = [motor.getMaxVelocity() for motor in self._motors]
        self._torque_limits = [motor.getMaxTorque() for motor in self._motors]
        self._node = robot.getSelf()
        self._step()
        self._place = self._before = self._position()
        self._turned = self._turned_before = self._angles()
        settle = max(1, round(SETTLE_S / STEP_S / self._every))
        last = max(1, round(SETTLED * settle))
        self.advance(np.zeros(((settle - last) * self._every, 2)))
        self._held = self.advance(np.zeros((last * self._every, 2)))
        self._check_world()
        self._origin = (0.0, 0.0, 0.0)
        # Settling moves the robot by micrometres; the run's pose counts from where it then stands.
        self._origin = self._planar()
        self._turns = 0.0
        self._yaw_before = self._origin[2]

    def _device(self, name: str) -> Any:
        found = self._robot.getDevice(name)
        if found is None:
            raise InputError(f"world: the robot has no device {name!r}; write the world again with `rtds webots`")
        return found

    def _step(self) -> None:
        if self._robot.step(self._every) == -1:
            raise RunEnded("Webots ended the run before its time; nothing is written")

    def _position(self) -> np.ndarray:
        """Middle of the axle (3,) m in the ground's axes."""
        return self._tilt.T @ np.array(self._gps.getValues())

    def _angles(self) -> np.ndarray:
        return np.array([sensor.getValue() for sensor in self._sensors])

    def _check_world(self) -> None:
        body, local = self._body, self._local()
        off = math.acos(max(-1.0, min(1.0, float(local[2, 2]))))
        # On wheels of two sizes it leans.
        lean = abs(body.wheel_radius_m[0] - body.wheel_radius_m[1]) / body.track_width_m
        if off > SLOPE_TOLERANCE_RAD + lean:
            raise InputError(
                f"world: the robot is {off:.3g} rad off a slope of {body.slope_rad:g} rad; write the world again "
                "with `rtds webots`"
            )
        weight = body.total_mass_kg * GRAVITY_M_S2 * 0.5 * sum(body.wheel_radius_m)
        asked = -float(body.gravity_m_s2 @ local[:, 0]) / GRAVITY_M_S2 * weight
        found = float(self._held.sum())
        if not abs(found - asked) <= HOLD_TOLERANCE * weight:
            raise InputError(
                f"world: the wheels hold the robot with {found:.4g} N m, its mass and slope ask for {asked:.4g} N m: "
                "it is another robot, or Webots counts torques with another sign"
            )

    def _local(self) -> np.ndarray:
        """Rotation (3, 3) from the robot's axes to the ground's."""
        return self._tilt.T @ np.array(self._node.getOrientation()).reshape(3, 3)

    def hold(self) -> np.ndarray:
        return self._held.copy()

    def advance(self, speeds_rad_s: np.ndarray) -> np.ndarray:
        speeds = np.asarray(speeds_rad_s, dtype=float)
        if len(speeds) % self._every:
            raise InputError(
                f"basicTimeStep: {self._every} ms do not divide the {len(speeds)} ms after which the robot is looked "
                "at; take a shorter one, or a longer log interval (effects, and bodies that outweigh their rotors, "
                "need 1 ms)"
            )
        total = np.zeros(2)
        steps = speeds[self._every - 1 :: self._every].tolist()
        for k, targets in enumerate(steps, start=1):
            for motor, speed, limit in zip(self._motors, targets, self._speed_limits, strict=True):
                if not abs(speed) <= limit:
                    raise InputError(f"world: a wheel is to turn at {speed:.4g} rad/s, its motor allows {limit:.4g}")
                motor.setVelocity(speed)
            self._step()
            torques = np.array([motor.getTorqueFeedback() for motor in self._motors])
            if not (np.abs(torques) < self._torque_limits).all():
                raise InputError(
                    f"world: a wheel's motor gives all it has ({max(self._torque_limits):.4g} N m), or reports no "
                    "torque: the wheel does not follow"
                )
            total += torques
            if k >= len(steps) - 1:
                # The last two places and angles are all that is looked at.
                self._before, self._place = self._place, self._position()
                self._turned_before, self._turned = self._turned, self._angles()
        return total * self._every / len(speeds)

    def _velocity(self) -> np.ndarray:
        # ODE moves a body by its speed at the end of a step, which the difference of two places therefore is.
        return (self._place - self._before) / (self._every * STEP_S)

    def _planar(self) -> tuple[float, float, float]:
        """x, y and wrapped yaw of the axle's middle; half a step's travel taken off, as in the other engines."""
        half = 0.5 * self._every * STEP_S
        local = self._local()
        place = self._place - half * self._velocity()
        yaw = math.atan2(local[1, 0], local[0, 0]) - half * self._gyro.getValues()[2]
        return float(place[0]), float(place[1]), yaw

    def state(self) -> RobotState:
        local = self._local()
        x, y, yaw = self._planar()
        self._turns += math.remainder(yaw - self._yaw_before, 2.0 * math.pi)
        self._yaw_before = yaw
        turn = self._start[2] - self._origin[2]
        dx, dy = x - self._origin[0], y - self._origin[1]
        return RobotState(
            x_m=self._start[0] + math.cos(turn) * dx - math.sin(turn) * dy,
            y_m=self._start[1] + math.sin(turn) * dx + math.cos(turn) * dy,
            yaw_rad=self._start[2] + self._turns,
            speed_m_s=float(self._velocity() @ local[:, 0]),
            yaw_rate_rad_s=float(self._gyro.getValues()[2]),
            pitch_rad=-math.asin(max(-1.0, min(1.0, float(local[2, 0])))),
        )

    def wheel_speeds(self) -> np.ndarray:
        return (self._turned - self._turned_before) / (self._every * STEP_S)

    def energy_j(self) -> float:
        body, local = self._body, self._local()
        # The wheels roll: two speeds describe all of the motion.
        mass, _ = inertia_of(
            body.total_mass_kg, body.com_m[1], yaw_inertia_kg_m2(body), body.wheel_radius_m, body.track_width_m
        )
        wheels = self.wheel_speeds()
        kinetic = 0.5 * float(wheels @ (mass + body.wheel_inertia_kg_m2 * np.eye(2)) @ wheels)
        height = 0.5 * sum(body.wheel_radius_m)
        centre = self._place + local @ (np.array(body.com_m) - np.array([0.0, 0.0, height]))
        return kinetic - body.total_mass_kg * float(body.gravity_m_s2 @ centre)

    def close(self) -> None:
        """Let the wheels stand, where Webots still runs."""
        for motor in self._motors:
            motor.setVelocity(0.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()
