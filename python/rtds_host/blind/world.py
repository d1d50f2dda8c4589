"""The second world: the robot in MuJoCo, with the driver, the bus and the wires around it.

The motors are MuJoCo's `dcmotor` actuators (armature current with inductance, winding temperature, and as passive
devices at the gear's output LuGre friction and cogging); the wheels are spheres that roll on a plane through MuJoCo's
frictional contact with soft constraints, elliptic cones and its implicit-fast integrator. The body may move along x,
y and z and turn about z: a differential drive without pitch and roll needs no caster, and carries its weight on the
wheels.

Effects come in nature's form, which differs from the catalogue's formula:

==================== =======================================================================================
supply_sag           a cell with an internal resistance feeds a buffer capacitor of 470 uF
driver_deadzone      the lost voltage fades in smoothly around zero command
voltage_limit        the limiter bends before it clips
bridge_drop          the bridge blocks while the voltage cannot overcome its drop (no current flows)
winding_heating      thermal resistance, capacity and copper's temperature coefficient (`dcmotor` thermal)
friction             LuGre bristles (`dcmotor` lugre) at the gear's output
load_friction        a share of the torque measured at the gear's input in the step before
backlash             the wheel's own joint with limits, teeth that give
longitudinal_slip    a tread that turns on its rim against a torque (creep)
spin_scrub           dry friction about the vertical axis
rolling_resistance   a dry friction constraint on the wheel, proportional to its own normal force
==================== =======================================================================================
"""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numba import njit

from rtds_host.blind.kernel import (
    S_ASYM_TORQUE,
    S_ASYM_VISCOUS,
    S_BACK_EMF,
    S_BACKLASH,
    S_COULOMB,
    S_CROSSTALK,
    S_CURRENT_TAU,
    S_CURVE,
    S_DAHL,
    S_DAHL_RAD,
    S_DAMPING,
    S_DEADZONE,
    S_DETENT,
    S_DETENT_CYCLES,
    S_DETENT_PHASE,
    S_DROP,
    S_FILTER_TAU,
    S_FRICTION_PER_S,
    S_GAIN,
    S_GREASE,
    S_GREASE_TAU,
    S_HEAT_PER_WATT,
    S_HEAT_TAU,
    S_HYSTERESIS,
    S_INDUCTANCE,
    S_INERTIA,
    S_LIMIT,
    S_LOAD_FRICTION,
    S_QUADRATIC,
    S_QUANTUM,
    S_RADIUS,
    S_RESISTANCE,
    S_RIPPLE,
    S_RIPPLE_CYCLES,
    S_RIPPLE_PHASE,
    S_ROLLING,
    S_RUB_ANGLE,
    S_RUB_TORQUE,
    S_RUB_WIDTH,
    S_SATURATION,
    S_SLEW,
    S_SLIP,
    S_STIFFNESS,
    S_STRIBECK,
    S_STRIBECK_SPEED,
    S_SWING,
    S_SWING_PHASE,
    S_TORQUE_CONSTANT,
    S_TRACTION,
    S_VISCOSITY,
    S_VISCOUS,
    W_BUMP_LENGTH,
    W_BUMPS,
    W_BUS_NOISE,
    W_BUS_TAU,
    W_CABLE,
    W_CLOCK_DRIFT,
    W_COM_X,
    W_COM_Y,
    W_COMMAND_DELAY,
    W_DECLINE,
    W_GEAR,
    W_GUST,
    W_GUST_TAU,
    W_LATERAL_SLOPE,
    W_MASS,
    W_MEASUREMENT_DELAY,
    W_PATCH_FORCE,
    W_PATCH_X,
    W_RELAX_OHM,
    W_RELAX_TAU,
    W_SAG,
    W_SCRUB,
    W_SLOPE,
    W_TRACK,
    W_TURN_DRAG,
    W_UPHILL,
    W_VOLTAGE,
    W_WHEEL_INERTIA,
    W_YAW_INERTIA,
    Diverged,
)

STEP_S = 2e-4
# What MuJoCo counts of positions, speeds and accelerations that are no numbers, or huge.
UNSTABLE = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
GRAVITY_M_S2 = 9.80665
WHEEL_KG = 0.0285  # URDF of the TurtleBot3 Burger; part of the declared mass
WHEEL_TILT_KG_M2 = 1.1e-5  # about a diameter
BUS_FARAD = 470e-6
COPPER_PER_K = 0.0039
PRESLIDING_RAD = 2e-3


def _actuators(label: str, p: np.ndarray, gear: float) -> list[str]:
    """Motor, dry friction and cogging of one side; `p`: its column of `side`."""
    actuators = []
    thermal = ""
    if p[S_HEAT_TAU] > 0:
        thermal = f'thermal="{p[S_HEAT_PER_WATT] / COPPER_PER_K:.9g} 0 {p[S_HEAT_TAU]:.9g} {COPPER_PER_K} 25 25"'
    actuators.append(
        f'<dcmotor name="motor_{label}" joint="gear_{label}" gear="{gear:.9g}" resistance="{p[S_RESISTANCE]:.9g}" '
        f'motorconst="{p[S_TORQUE_CONSTANT]:.9g} {p[S_BACK_EMF]:.9g}" inductance="{p[S_INDUCTANCE]:.9g} 0" '
        f"{thermal}/>"
    )
    coulomb, extra = p[S_COULOMB], p[S_STRIBECK]
    if coulomb + extra > 0:
        stiff = (coulomb + extra) / PRESLIDING_RAD
        actuators.append(
            f'<dcmotor name="dry_{label}" joint="gear_{label}" input="none" motorconst="0 0" resistance="1" '
            f'lugre="{stiff:.9g} {0.3 * math.sqrt(stiff * 7e-3):.9g} {max(coulomb, 1e-6):.9g} '
            f'{coulomb + extra:.9g} {p[S_STRIBECK_SPEED]:.9g}"/>'
        )
    if p[S_RIPPLE] != 0:
        actuators.append(
            f'<dcmotor name="cogs_{label}" joint="gear_{label}" input="none" motorconst="0 0" resistance="1" '
            f'cogging="{p[S_RIPPLE]:.9g} {round(p[S_RIPPLE_CYCLES])} {p[S_RIPPLE_PHASE]:.9g}"/>'
        )
    return actuators


def model_xml(side: np.ndarray, world: np.ndarray) -> str:
    """The robot as MJCF.

    Parameters
    ----------
    side : (len(SIDE_NAMES), 2), world : (len(WORLD_NAMES),): the planar world's parameters of one run (mass with
        payload, slope with its error).
    """
    track, mass, gear = world[W_TRACK], world[W_MASS], world[W_GEAR]
    slope, up, lateral = world[W_SLOPE], world[W_UPHILL], world[W_LATERAL_SLOPE]
    gx = -math.sin(slope) * math.cos(up) + math.sin(lateral) * math.sin(up)
    gy = -math.sin(slope) * math.sin(up) - math.sin(lateral) * math.cos(up)
    gz = -math.sqrt(max(1.0 - gx * gx - gy * gy, 0.0))
    body_kg = mass - 2 * WHEEL_KG
    cx, cy = world[W_COM_X] * mass / body_kg, world[W_COM_Y] * mass / body_kg
    izz = world[W_YAW_INERTIA] - 2 * (WHEEL_KG * (track / 2) ** 2 + WHEEL_TILT_KG_M2) - body_kg * (cx * cx + cy * cy)
    izz = max(izz, 1e-5)

    wheels, actuators = [], []
    for s, label in enumerate("lr"):
        p = side[:, s]
        radius = p[S_RADIUS]
        grip = 1.5 if p[S_TRACTION] <= 0 else p[S_TRACTION] / (0.5 * mass * GRAVITY_M_S2)
        roll = p[S_ROLLING] * radius * 0.5 * mass * GRAVITY_M_S2 * abs(gz)
        geom = (
            f'<geom type="sphere" size="{radius:.9g}" contype="2" conaffinity="1" mass="0" '
            f'friction="{grip:.9g} 1e-5 1e-6" condim="3"/>'
        )
        full = (
            f'<inertial pos="0 0 0" mass="{WHEEL_KG}" diaginertia="{WHEEL_TILT_KG_M2} '
            f'{world[W_WHEEL_INERTIA]:.9g} {WHEEL_TILT_KG_M2}"/>'
        )
        small = '<inertial pos="0 0 0" mass="1e-4" diaginertia="1e-7 1e-7 1e-7"/>'
        inner = full + geom
        if p[S_SLIP] > 0:
            inner = (
                f'{small}<body name="tread_{label}"><joint name="tread_{label}" axis="0 1 0"'
                f' damping="1"/>{inner}</body>'
            )
        if p[S_BACKLASH] > 0 and p[S_STIFFNESS] <= 0:
            half = 0.5 * p[S_BACKLASH]
            joint = (
                f'<joint name="play_{label}" axis="0 1 0" limited="true" range="{-half:.9g} {half:.9g}" '
                'solreflimit="0.0015 1" solimplimit="0.95 0.999 0.0005" damping="1e-6"/>'
            )
            inner = f'{small}<body name="rim_{label}">{joint}{inner}</body>'
        elif p[S_STIFFNESS] > 0 and p[S_BACKLASH] <= 0:
            joint = (
                f'<joint name="play_{label}" axis="0 1 0" stiffness="{p[S_STIFFNESS]:.9g}" '
                f'damping="{p[S_DAMPING]:.9g}"/>'
            )
            inner = f'{small}<body name="rim_{label}">{joint}{inner}</body>'
        elif p[S_STIFFNESS] > 0:
            inner = f'{small}<body name="rim_{label}"><joint name="play_{label}" axis="0 1 0"/>{inner}</body>'
        damping = gear * gear * p[S_VISCOSITY] + p[S_VISCOUS]
        wheels.append(
            f'<body name="gear_{label}" pos="0 {(1 - 2 * s) * track / 2:.9g} {radius:.9g}"><joint name="gear_{label}" '
            f'axis="0 1 0" armature="{gear * gear * p[S_INERTIA]:.9g}" damping="{max(damping, 0.0):.9g}" '
            f'frictionloss="{roll:.9g}"/>{inner}</body>'
        )
        actuators += _actuators(label, p, gear)
    return (
        f'<mujoco model="second-world"><compiler angle="radian"/><option timestep="{STEP_S}" integrator="implicitfast"'
        f' cone="elliptic" impratio="10" iterations="30" tolerance="1e-10" gravity="{GRAVITY_M_S2 * gx:.9g}'
        f' {GRAVITY_M_S2 * gy:.9g} {GRAVITY_M_S2 * gz:.9g}"/><default><geom solimp="0.99 0.9999 0.0001" solref="0.002'
        ' 1"/></default><worldbody><geom type="plane" size="0 0 1" contype="1" conaffinity="2" friction="1e-4 1e-6'
        ' 1e-7"/><body name="base"><joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1'
        ' 0"/><joint name="z" type="slide" axis="0 0 1"/><joint name="yaw" type="hinge" axis="0 0 1"'
        f' frictionloss="{world[W_SCRUB]:.9g}" damping="{world[W_TURN_DRAG]:.9g}"/><inertial pos="{cx:.9g} {cy:.9g}'
        f' 0.055" mass="{body_kg:.9g}" diaginertia="{izz:.9g} {izz:.9g} {izz:.9g}"/>'
        + "".join(wheels)
        + "</body></worldbody><actuator>"
        + "".join(actuators)
        + "</actuator></mujoco>"
    )


@njit(cache=True)
def _drive(t, h, asked, side, world, events, state, i, w, th, accel, x, y, yaw, volts, torques, pull):
    """Electronics and whatever acts from outside, before one step.

    `state` (12,): bus after its capacitor, bus noise, gust, played l r, slewed l r, start x, start y, presliding l r,
    the cell's slow voltage drop.
    Fills `volts` (2,) at the motors, `torques` (2,) at the gears' outputs and `pull` (2,) N on the body; returns the
    bus.
    """
    vn = world[W_VOLTAGE]
    cell = vn - world[W_DECLINE] * t
    if world[W_BUS_NOISE] > 0.0:
        state[1] += (
            -state[1] * h / world[W_BUS_TAU]
            + world[W_BUS_NOISE] * math.sqrt(2.0 * h / world[W_BUS_TAU]) * np.random.normal()
        )
        cell += state[1]
    drawn = 0.0
    for s in range(2):
        u = asked[s] + side[S_CROSSTALK, s] * asked[1 - s]
        if side[S_QUANTUM, s] > 0.0:
            u = side[S_QUANTUM, s] * math.floor(u / side[S_QUANTUM, s] + 0.5)
        if side[S_HYSTERESIS, s] > 0.0:
            half = 0.5 * side[S_HYSTERESIS, s]
            state[3 + s] = min(max(state[3 + s], u - half), u + half)
            u = state[3 + s]
        if side[S_SLEW, s] > 0.0:
            change = side[S_SLEW, s] * h
            state[5 + s] += min(max(u - state[5 + s], -change), change)
            u = state[5 + s]
        u = min(max(u, -vn), vn)
        drawn += i[s] * u / vn
        u *= side[S_GAIN, s] * (1.0 + side[S_CURVE, s] * (1.0 - abs(u) / vn))
        dead = side[S_DEADZONE, s]
        if dead > 0.0:
            u -= dead * math.tanh((u / dead) ** 3) if abs(u) < 3.0 * dead else math.copysign(dead, u)
        volts[s] = u
    if world[W_RELAX_OHM] > 0.0:
        state[11] += (world[W_RELAX_OHM] * drawn - state[11]) * (1.0 - math.exp(-h / world[W_RELAX_TAU]))
        cell -= state[11]
    if world[W_SAG] > 0.0:
        keep = math.exp(-h / (world[W_SAG] * BUS_FARAD))
        end = cell - world[W_SAG] * drawn
        state[0] = end + (state[0] - end) * keep
    else:
        state[0] = cell
    bus = state[0]
    for s in range(2):
        u = volts[s] * bus / vn
        top = side[S_LIMIT, s]
        if top < 1e6:
            u = u / (1.0 + abs(u / top) ** 24) ** (1.0 / 24)
        drop = side[S_DROP, s]
        if drop > 0.0:
            emf = side[S_BACK_EMF, s] * world[W_GEAR] * w[s]
            over = u - emf
            u = emf if abs(over) <= drop else u - math.copysign(drop, over)
        volts[s] = u
        gear = world[W_GEAR]
        smooth = math.tanh(w[s] / 0.03)
        dry = side[S_FRICTION_PER_S, s] * t
        if side[S_RUB_TORQUE, s] > 0.0:
            away = (th[s] - side[S_RUB_ANGLE, s] + math.pi) % (2.0 * math.pi) - math.pi
            if abs(away) < side[S_RUB_WIDTH, s]:
                dry += side[S_RUB_TORQUE, s] * (1.0 + math.cos(math.pi * away / side[S_RUB_WIDTH, s])) * 0.5
        if world[W_PATCH_FORCE] > 0.0 and x > world[W_PATCH_X]:
            dry += side[S_RADIUS, s] * world[W_PATCH_FORCE] * 0.5
        for e in range(events.shape[0]):
            if int(events[e, 2]) == s and events[e, 0] <= t < events[e, 1]:
                dry += events[e, 3]
        dry += side[S_SWING, s] * 0.5 * (1.0 + math.cos(th[s] - side[S_SWING_PHASE, s]))
        torque = -dry * smooth - side[S_QUADRATIC, s] * w[s] * abs(w[s])
        torque -= side[S_ASYM_TORQUE, s] * abs(smooth) + side[S_ASYM_VISCOUS, s] * abs(w[s])
        if side[S_DAHL, s] > 0.0:
            state[9 + s] += w[s] * h / side[S_DAHL_RAD, s] * (1.0 - state[9 + s] * math.copysign(1.0, w[s]))
            state[9 + s] = min(max(state[9 + s], -1.0), 1.0)
            torque -= side[S_DAHL, s] * state[9 + s]
        if side[S_GREASE, s] > 0.0:
            torque -= side[S_GREASE, s] * math.exp(-t / side[S_GREASE_TAU, s]) * w[s]
        if side[S_DETENT, s] != 0.0:
            torque += (
                side[S_DETENT, s]
                * 0.5
                * (1.0 + math.cos(th[s] - side[S_DETENT_PHASE, s]))
                * math.sin(side[S_DETENT_CYCLES, s] * th[s])
            )
        km = gear * side[S_TORQUE_CONSTANT, s]
        if side[S_SATURATION, s] > 0.0:
            torque -= km * i[s] * (1.0 - 1.0 / (1.0 + (i[s] / side[S_SATURATION, s]) ** 2))
        if side[S_LOAD_FRICTION, s] > 0.0:
            share = side[S_LOAD_FRICTION, s]
            into = km * i[s] - gear * gear * (side[S_VISCOSITY, s] * w[s] + side[S_INERTIA, s] * accel[s])
            if into * w[s] < 0.0:
                share = share / (1.0 - share)
            torque -= share * abs(into) * smooth
        torques[s] = torque
    pull[0] = 0.0
    pull[1] = 0.0
    if world[W_CABLE] != 0.0:
        pull[0] -= world[W_CABLE] * (x - state[7])
        pull[1] -= world[W_CABLE] * (y - state[8])
    if world[W_BUMPS] != 0.0:
        wave = 2.0 * math.pi / world[W_BUMP_LENGTH]
        tilt = world[W_BUMPS] * world[W_MASS] * GRAVITY_M_S2
        pull[0] -= tilt * math.cos(wave * x)
        pull[1] -= tilt * math.cos(wave * y)
    if world[W_GUST] > 0.0:
        state[2] += (
            -state[2] * h / world[W_GUST_TAU]
            + world[W_GUST] * math.sqrt(2.0 * h / world[W_GUST_TAU]) * np.random.normal()
        )
        pull[0] += state[2] * math.cos(yaw)
        pull[1] += state[2] * math.sin(yaw)
    return bus


@njit(cache=True)
def _seed(seed):
    np.random.seed(seed)


def _needs_every_step(side: np.ndarray, world: np.ndarray, events: np.ndarray) -> bool:
    """Whether anything outside of MuJoCo acts within a row of the log."""
    names = (
        S_HYSTERESIS,
        S_SLEW,
        S_DROP,
        S_FRICTION_PER_S,
        S_RUB_TORQUE,
        S_QUADRATIC,
        S_ASYM_TORQUE,
        S_ASYM_VISCOUS,
        S_SATURATION,
        S_LOAD_FRICTION,
        S_FILTER_TAU,
        S_SLIP,
        S_DAHL,
        S_SWING,
        S_GREASE,
        S_DETENT,
        S_CURRENT_TAU,
    )
    worldly = (
        W_SAG,
        W_DECLINE,
        W_BUS_NOISE,
        W_GUST,
        W_CABLE,
        W_PATCH_FORCE,
        W_COMMAND_DELAY,
        W_MEASUREMENT_DELAY,
        W_BUMPS,
        W_CLOCK_DRIFT,
        W_RELAX_OHM,
    )
    both = (side[S_STIFFNESS] > 0) & (side[S_BACKLASH] > 0)
    return bool(
        np.any(side[list(names)] != 0)
        or np.any(world[list(worldly)] != 0)
        or len(events)
        or both.any()
        or np.any(side[S_VISCOUS] < -(world[W_GEAR] ** 2) * side[S_VISCOSITY])
    )


class _Robot:
    """The robot in MuJoCo while a scenario runs, with what acts on it from outside. Arguments as of `simulate`."""

    def __init__(self, side: np.ndarray, world: np.ndarray, start: np.ndarray, events: np.ndarray, seed: int) -> None:
        self.side, self.world, self.events = side, world, events
        self.model = model = mujoco.MjModel.from_xml_string(model_xml(side, world))
        self.data = data = mujoco.MjData(model)
        self.gear = np.array([self._dof("gear_l"), self._dof("gear_r")])
        self.play = [self._dof("play_l"), self._dof("play_r")]
        self.tread = [self._dof("tread_l"), self._dof("tread_r")]
        actuator = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, f"motor_{c}") for c in "lr"]
        # The current is the last of the motor's own states (the temperature comes before it).
        self.current = np.array([int(model.actuator_actadr[k] + model.actuator_actnum[k] - 1) for k in actuator])
        self.control = np.array([int(model.actuator_ctrladr[k]) for k in actuator])
        self.px, self.py, self.pyaw = (self._dof(name) for name in ("x", "y", "yaw"))
        data.qpos[[self.px, self.py, self.pyaw]] = start[:3]
        data.qpos[self.gear] = start[3:]
        mujoco.mj_forward(model, data)
        _seed(seed)
        self.state = np.zeros(12)
        self.state[0] = world[W_VOLTAGE]
        self.state[7:9] = start[:2]
        self.volts, self.torques, self.pull = np.zeros(2), np.zeros(2), np.zeros(2)
        # Sides whose wheel has both free play and a spring.
        both = (side[S_BACKLASH] > 0) & (side[S_STIFFNESS] > 0)
        self.sprung = [s for s in range(2) if self.play[s] is not None and both[s]]
        self.filter_keep = [_kept(side[S_FILTER_TAU, s]) for s in range(2)]
        self.current_keep = [_kept(side[S_CURRENT_TAU, s]) for s in range(2)]
        self.filtered, self.seen = np.zeros(2), np.zeros(2)
        self.bus = world[W_VOLTAGE]

    def _dof(self, name: str) -> int | None:
        k = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, name)
        return None if k < 0 else int(self.model.jnt_dofadr[k])

    def reading(self) -> list[float]:
        """Bus V, i_l, i_r, w_l, w_r, th_l, th_r, yaw rate, as the sensors have them now."""
        data, gear = self.data, self.gear
        return [
            self.bus,
            *(self.seen[s] if self.current_keep[s] else data.act[self.current[s]] for s in range(2)),
            *(self.filtered[s] if self.filter_keep[s] else data.qvel[gear[s]] for s in range(2)),
            data.qpos[gear[0]],
            data.qpos[gear[1]],
            data.qvel[self.pyaw],
        ]

    def pose(self) -> tuple[float, float, float]:
        """x, y m and yaw rad."""
        qpos = self.data.qpos
        return qpos[self.px], qpos[self.py], qpos[self.pyaw]

    def drive(self, t: float, asked: np.ndarray) -> None:
        """Let the electronics take the commands (2,), V, at time t, s, and find what acts from outside."""
        data, gear = self.data, self.gear
        self.bus = _drive(
            t,
            STEP_S,
            asked,
            self.side,
            self.world,
            self.events,
            self.state,
            data.act[self.current],
            data.qvel[gear],
            data.qpos[gear],
            data.qacc[gear],
            *self.pose(),
            self.volts,
            self.torques,
            self.pull,
        )
        data.ctrl[self.control] = self.volts

    def steps(self, count: int) -> None:
        """Go on by some steps in which nothing outside of MuJoCo acts."""
        mujoco.mj_step(self.model, self.data, count)

    def step(self, t: float, asked: np.ndarray) -> None:
        """One step with all that acts; arguments as of `drive`."""
        side, data = self.side, self.data
        w = data.qvel[self.gear]
        self.drive(t, asked)
        applied = data.qfrc_applied
        applied[self.gear] = self.torques
        applied[self.px], applied[self.py] = self.pull
        for s in range(2):
            if self.tread[s] is not None:
                self.model.dof_damping[self.tread[s]] = side[S_RADIUS, s] ** 2 / (
                    side[S_SLIP, s] * side[S_RADIUS, s] * max(abs(w[s]), 0.05)
                )
        for s in self.sprung:
            twist, rate = -data.qpos[self.play[s]], -data.qvel[self.play[s]]
            half = 0.5 * side[S_BACKLASH, s]
            over = twist - min(max(twist, -half), half)
            applied[self.play[s]] = 0.0 if over == 0 else (side[S_STIFFNESS, s] * over + side[S_DAMPING, s] * rate)
        mujoco.mj_step(self.model, data)
        for s in range(2):
            if keep := self.current_keep[s]:
                now = data.act[self.current[s]]
                self.seen[s] = now + (self.seen[s] - now) * keep
            if keep := self.filter_keep[s]:
                now = data.qvel[self.gear[s]]
                self.filtered[s] = now + (self.filtered[s] - now) * keep


def _kept(tau: float) -> float:
    """What a low-pass filter of time constant `tau`, s, keeps of its value in a step; 0 without a filter."""
    return math.exp(-STEP_S / tau) if tau > 0 else 0.0


class _Link:
    """The link to the driver: commands (n, 2), V, of rows at `times` (n,), s, act with its delay, unless it stalls."""

    def __init__(self, times: np.ndarray, v_cmd: np.ndarray, delay: float, events: np.ndarray) -> None:
        self.times, self.v_cmd, self.delay, self.events = times, v_cmd, delay, events
        self.acting = -1  # row whose command reaches the driver
        self.asked = np.zeros(2)

    def commands(self, t: float, row: int) -> np.ndarray:
        """Commands (2,) in the step that begins at t, averaged over it; row : the last one that is known."""
        times, asked = self.times, self.asked
        stalled = any(side_of < 0 and begin <= t < end for begin, end, side_of, _ in self.events)
        while not stalled and self.acting + 1 <= row and times[self.acting + 1] + self.delay <= t + 1e-9:
            self.acting += 1
        asked[:] = self.v_cmd[self.acting] if self.acting >= 0 else 0.0
        if not stalled and self.acting + 1 <= row:
            change = times[self.acting + 1] + self.delay - t
            if change < STEP_S - 1e-9:
                asked += (1.0 - change / STEP_S) * (self.v_cmd[self.acting + 1] - asked)
        return asked


def _between(history: np.ndarray, when: float, upto: int) -> np.ndarray:
    """Readings at a time, s, between those of steps; upto : the last step that is known."""
    at = min(max(when / STEP_S, 0.0), float(upto))
    low = int(at)
    high = min(low + 1, upto)
    return history[low] + (at - low) * (history[high] - history[low])


def simulate(
    times: np.ndarray,
    v_cmd: np.ndarray,
    side: np.ndarray,
    world: np.ndarray,
    start: np.ndarray,
    closed: bool,
    w_ref: np.ndarray,
    w_noise: np.ndarray,
    period_rows: int,
    gains: np.ndarray,
    events: np.ndarray,
    seed: int,
) -> np.ndarray:
    """Run one scenario; arguments and result as in `kernel.simulate` (`times` in multiples of `STEP_S`).

    Raises
    ------
    Diverged : MuJoCo found the simulation unstable, and began it again from its first state.
    """
    robot = _Robot(side, world, start, events, seed)
    link = _Link(times, v_cmd, world[W_COMMAND_DELAY], events)
    dense = _needs_every_step(side, world, events)
    history = np.zeros((round(times[-1] / STEP_S) + 2, 8)) if dense else np.zeros((0, 8))
    rows = times.size
    out = np.zeros((rows, 11))
    row_step = np.round(times / STEP_S).astype(int)
    pace = 1.0 - world[W_CLOCK_DRIFT]
    integral = np.zeros(2)
    for row in range(rows):
        k0 = row_step[row]
        if dense:
            history[k0] = robot.reading()
            out[row, :8] = _between(history, pace * times[row] - world[W_MEASUREMENT_DELAY], k0)
        else:
            out[row, :8] = robot.reading()
        out[row, 8:] = robot.pose()
        if closed:
            if row % period_rows == 0:
                last = max(row - period_rows, 0)
                measured = out[row, 3:5] * gains[4:6] + w_noise[row]
                error = w_ref[row] - measured
                u = gains[0] * w_ref[row] + gains[1] * error + gains[2] * integral
                integral[np.abs(u) < gains[3]] += (error * (times[row] - times[last]))[np.abs(u) < gains[3]]
                v_cmd[row] = np.round(np.clip(u, -gains[3], gains[3]), 3)
            else:
                v_cmd[row] = v_cmd[row - 1]
        if row == rows - 1:
            break
        count = row_step[row + 1] - k0
        if not dense:
            robot.drive(k0 * STEP_S, v_cmd[row])
            robot.steps(count)
            continue
        for k in range(k0, k0 + count):
            if k > k0:
                history[k] = robot.reading()
            robot.step(k * STEP_S, link.commands(k * STEP_S, row))
    if any(robot.data.warning[kind].number for kind in UNSTABLE):
        raise Diverged("MuJoCo: the simulation is unstable")
    return out
