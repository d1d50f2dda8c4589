"""MuJoCo behind the engine's interface."""

from __future__ import annotations

import copy
import math

import mujoco
import numpy as np

from rtds_host.compat import Self
from rtds_host.robot.body import SKID_RADIUS_M, Body, inertia_at_wheel_kg_m2
from rtds_host.robot.engine import STEP_S, RobotState
from rtds_host.robot.urdf import base_inertia, supports
from rtds_host.robot.window import windowed
from rtds_host.vectors import cross

# A wheel's speed is given, not found: an armature far above anything on the ground lets a wheel turn as it is told
# whatever its contact does, and the contact's torque is read off the solver. 10 kg m2 is enough for what would see
# 0.005 kg m2; heavier robots get more.
ARMATURE_KG_M2 = 10.0
ARMATURE_OF_BODY = 2000.0
SETTLE_S = 0.5
# MuJoCo's contacts yield: with these a wheel under 3 kg uphill creeps by less than a millionth of its speed.
CONTACT = 'solref="0.004 1" solimp="0.9999 0.9999 0.001"'


def armature_kg_m2(body: Body) -> float:
    """Armature of a wheel, next to which the body's inertia at the wheel is nothing."""
    return max(ARMATURE_KG_M2, ARMATURE_OF_BODY * inertia_at_wheel_kg_m2(body))


def make_mjcf(body: Body, step_s: float) -> str:
    """The robot as MJCF text, from the same figures as the URDF."""
    base = base_inertia(body)

    def vector(values) -> str:
        return " ".join(f"{value:.12g}" for value in values)

    skids = "".join(
        f'<geom name="{name}" type="sphere" size="{SKID_RADIUS_M:g}" '
        f'pos="{vector((x, body.com_m[1], SKID_RADIUS_M))}" condim="1" contype="2" conaffinity="1" {CONTACT}/>\n'
        for name, x in supports(body)
    )
    spin = body.wheel_inertia_kg_m2
    wheels = "".join(
        f'<body name="wheel_{name}" pos="{vector((0.0, side * body.track_width_m, radius))}">\n'
        f'<inertial pos="0 0 0" mass="{body.wheel_mass_kg:.12g}" diaginertia="{vector((spin / 2, spin, spin / 2))}"/>\n'
        f'<joint name="wheel_{name}" type="hinge" axis="0 1 0" armature="{armature_kg_m2(body):g}" damping="0" '
        'frictionloss="0"/>\n'
        f'<geom name="wheel_{name}" type="sphere" size="{radius:.12g}" condim="3" '
        f'friction="{body.tyre_friction:g} 0 0" '
        f'contype="2" conaffinity="1" {CONTACT}/>\n</body>\n'
        for name, side, radius in zip(("left", "right"), (0.5, -0.5), body.wheel_radius_m, strict=True)
    )
    return (
        f'<mujoco model="burger">\n<option timestep="{step_s:.12g}" gravity="{vector(body.gravity_m_s2)}" '
        'integrator="Euler" cone="elliptic" solver="Newton" iterations="100" tolerance="1e-14" impratio="10">'
        "</option>\n<worldbody>\n"
        f'<geom name="ground" type="plane" size="0 0 1" condim="1" friction="{body.tyre_friction:g} 0 0" contype="1" '
        f'conaffinity="2" {CONTACT}/>\n'
        '<body name="base">\n<freejoint/>\n'
        f'<inertial pos="{vector(base.com_m)}" mass="{base.mass_kg:.12g}" '
        f'diaginertia="{vector(base.inertia_kg_m2)}"/>\n{skids}{wheels}</body>\n</worldbody>\n</mujoco>\n'
    )


class MujocoEngine:
    """See `rtds_host.robot.engine.Engine`."""

    def __init__(self, body: Body, pose: tuple[float, float, float] = (0.0, 0.0, 0.0), step_s: float = STEP_S):
        self.step_s = step_s
        self._body = body
        self._model = mujoco.MjModel.from_xml_string(make_mjcf(body, step_s))
        self._data = mujoco.MjData(self._model)
        self._viewer = None
        self._data.qpos[:7] = [pose[0], pose[1], 0.0, math.cos(0.5 * pose[2]), 0.0, 0.0, math.sin(0.5 * pose[2])]
        # Degrees of freedom: six of the free base, then the wheels.
        self._wheels = slice(6, 8)
        self._height = 0.5 * sum(body.wheel_radius_m)
        self._origin = (0.0, 0.0, 0.0)
        self._start = pose
        settle = max(1, round(SETTLE_S / step_s))
        self.advance(np.zeros((settle, 2)))
        self._held = self.advance(np.zeros((max(1, settle // 10), 2)))
        # Settling moves the robot by micrometres; the run's pose counts from where it then stands.
        self._origin = self._planar()
        self._turns = 0.0
        self._yaw_before = self._origin[2]
        if windowed():
            from mujoco.viewer import launch_passive

            self._viewer = launch_passive(self._model, self._data, show_left_ui=False, show_right_ui=False)

    def hold(self) -> np.ndarray:
        return self._held.copy()

    def advance(self, speeds_rad_s: np.ndarray) -> np.ndarray:
        model, data, wheels = self._model, self._data, self._wheels
        speeds = np.asarray(speeds_rad_s, dtype=float)
        contact = np.zeros(2)
        before = data.qvel[wheels].copy()
        inertia = armature_kg_m2(self._body) / self.step_s
        for target in speeds:
            data.qfrc_applied[wheels] = inertia * (target - data.qvel[wheels])
            mujoco.mj_step(model, data)
            contact += data.qfrc_constraint[wheels]
        if self._viewer is not None and self._viewer.is_running():
            self._viewer.sync()
        gain = self._body.wheel_inertia_kg_m2 * (data.qvel[wheels] - before) / (len(speeds) * self.step_s)
        return gain - contact / len(speeds)

    def _base(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Rotation (3, 3), origin, its velocity and angular velocity of the base, all in the ground's axes."""
        flat = np.zeros(9)
        mujoco.mju_quat2Mat(flat, self._data.qpos[3:7])
        rotation = flat.reshape(3, 3)
        return (rotation, self._data.qpos[:3].copy(), self._data.qvel[:3].copy(), rotation @ self._data.qvel[3:6])

    def _planar(self) -> tuple[float, float, float]:
        """x, y and wrapped yaw of the axle's mid-point; half a step's travel taken off, which turns the engine's own
        rule (speed at the end of a step) into the trapezoidal one."""
        rotation, origin, linear, angular = self._base()
        arm = rotation @ np.array([0.0, 0.0, self._height])
        axle = origin + arm - 0.5 * self.step_s * (linear + cross(angular, arm))
        yaw = math.atan2(rotation[1, 0], rotation[0, 0]) - 0.5 * self.step_s * angular[2]
        return float(axle[0]), float(axle[1]), yaw

    def state(self) -> RobotState:
        rotation, _, linear, angular = self._base()
        x, y, yaw = self._planar()
        self._turns += math.remainder(yaw - self._yaw_before, 2.0 * math.pi)
        self._yaw_before = yaw
        velocity = linear + cross(angular, rotation @ np.array([0.0, 0.0, self._height]))
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
        return self._data.qvel[self._wheels].copy()

    def energy_j(self) -> float:
        # On a copy: the run itself must not depend on whether somebody looked.
        data = copy.copy(self._data)
        mujoco.mj_forward(self._model, data)
        velocity, gravity = np.zeros(6), self._body.gravity_m_s2
        energy = 0.0
        for k in range(1, self._model.nbody):
            # mjOBJ_BODY is the frame of a body's inertia: at its centre of mass, along its principal axes.
            mujoco.mj_objectVelocity(self._model, data, mujoco.mjtObj.mjOBJ_BODY, k, velocity, 1)
            turn, speed = velocity[:3], velocity[3:]
            energy += self._model.body_mass[k] * (0.5 * speed @ speed - gravity @ data.xipos[k])
            energy += 0.5 * turn @ (self._model.body_inertia[k] * turn)
        return float(energy)

    def close(self) -> None:
        """Close the window, where there is one."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc) -> None:
        self.close()
