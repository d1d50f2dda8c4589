"""A `robot.toml` from the `<dcmotor>` actuators of an MJCF file, and what such a file cannot hold as effects.

The motors' numbers are those of MuJoCo's compiled model: a nominal point is resolved to R and K, a time constant to L.
Masses, inertias and distances are those of the model in its initial pose. Meaning of MuJoCo's parameters: MuJoCo, XML
Reference, actuator/dcmotor, and "DC Motor Model".
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rtds_host.contract import GRAVITY_M_S2
from rtds_host.errors import InputError, visible
from rtds_host.start.datasheet import ASSUMED, ELECTRICAL_S, HEIGHT_RADII, MECHANICAL_S

# MuJoCo's order of a <dcmotor>'s compiled numbers.
RESISTANCE, CONSTANT, TEMPERATURE_PER_K = 0, 1, 2
ELECTRICAL, THERMAL_K_PER_W, THERMAL_J_PER_K, STIFFNESS = 0, 2, 3, 5
COGGING, COULOMB, STATIC, STRIBECK = slice(0, 3), 3, 4, 5
# Axes, and the motors of a robot, are alike where they differ by less.
ALIKE = 1e-6
# Shares of a turn and of a second that stand for an encoder that nobody described: 4096 counts, 20 ms.
ANGLE_RAD, SPEED_RAD_S = 2.0 * math.pi / 4096.0 / math.sqrt(12.0), 0.03


@dataclass(frozen=True)
class Drive:
    """A `<dcmotor>` on a hinge, SI, at the motor's shaft; friction at the hinge. `sign`: -1 turns the hinge backwards.
    `anchor`, `axis` (3,): the hinge in the world; `body`: its body's id."""

    name: str
    body: int
    anchor: np.ndarray
    axis: np.ndarray
    sign: float
    gear: float
    resistance_ohm: float
    inductance_h: float
    constant: float
    rotor_kg_m2: float
    viscous_nm_s_per_rad: float
    top_v: float
    effects: tuple[tuple[str, dict[str, float]], ...]
    lost: tuple[str, ...]


@dataclass
class Read:
    """What was read: the text of `robot.toml`, effects as (id, side, values), and what neither has, in words."""

    text: str
    effects: list[tuple[str, str, dict[str, float]]]
    lost: list[str] = field(default_factory=list)


def compiled(path: Path) -> Any:
    """MuJoCo's model of a file.

    Raises
    ------
    InputError : it cannot be read or holds a NaN, or MuJoCo is too old or takes it for no model.
    """
    import mujoco

    if not hasattr(mujoco.mjtGain, "mjGAIN_DCMOTOR"):
        raise InputError(f"{path}: MuJoCo {mujoco.__version__} has no <dcmotor>, 3.7 or later has")
    if path.is_dir():
        raise InputError(f"{path}: is a folder, an MJCF file is needed")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    # MuJoCo's own handler writes to stderr and leaves MUJOCO_LOG.TXT in the folder of work.
    warned: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(warned.append)
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, UnicodeError) as error:
        raise InputError(f"{path}: MuJoCo does not take it: {visible(' '.join(str(error).split()))}") from error
    finally:
        mujoco.set_mju_user_warning(before)
    for line in warned:
        said = visible(" ".join(line.split()))
        if "'NaN'" in said:
            raise InputError(f"{path}: MuJoCo warns of it: {said}")
        print(f"rtds: {path}: MuJoCo warns of it: {said}", file=sys.stderr)
    return model


def _effects(model: Any, k: int, dof: int, gear: float) -> tuple[tuple[str, dict[str, float]], ...]:
    """What robot.toml has no place for and the catalogue has an effect for."""
    gain, bias, dyn = model.actuator_gainprm[k], model.actuator_biasprm[k], model.actuator_dynprm[k]
    found: list[tuple[str, dict[str, float]]] = []
    dry = float(model.dof_frictionloss[dof])
    if dyn[STIFFNESS] > 0.0:
        coulomb, static = gear * float(bias[COULOMB]), gear * float(bias[STATIC])
        if static > coulomb and bias[STRIBECK] > 0.0:
            numbers = {
                "torque_nm": dry + coulomb,
                "extra_torque_nm": static - coulomb,
                "speed_rad_s": float(bias[STRIBECK]) / gear,
            }
            found.append(("stribeck_friction", numbers))
            dry = 0.0
        else:
            dry += coulomb
    if dry > 0.0:
        found.append(("coulomb_friction", {"torque_nm": dry}))
    amplitude, poles, phase = (float(value) for value in bias[COGGING])
    if amplitude and poles:
        numbers = {"amplitude_nm": gear * amplitude, "cycles_per_rev": gear * poles, "phase_rad": phase}
        found.append(("torque_ripple", numbers))
    if dyn[THERMAL_K_PER_W] > 0.0 and gain[TEMPERATURE_PER_K] > 0.0:
        numbers = {
            "rise_per_watt": float(gain[TEMPERATURE_PER_K] * dyn[THERMAL_K_PER_W]),
            "time_constant_s": float(dyn[THERMAL_K_PER_W] * dyn[THERMAL_J_PER_K]),
        }
        found.append(("winding_heating", numbers))
    if model.actuator_delay[k] > 0.0:
        found.append(("command_delay", {"seconds": float(model.actuator_delay[k])}))
    return tuple(found)


def _lost(model: Any, k: int, name: str) -> tuple[str, ...]:
    """What neither robot.toml nor an effect can say of a motor."""
    found = []
    if model.actuator_forcelimited[k]:
        found.append(f"{name}: saturation of {float(model.actuator_forcerange[k][1]):.4g} N·m")
    if model.actuator_dynprm[k][1] > 0.0:
        found.append(f"{name}: limit of the current's rate, {float(model.actuator_dynprm[k][1]):.4g} A/s")
    if model.actuator_gainprm[k][4:8].any():
        found.append(f"{name}: its on-board controller; commands of the robot are volts")
    return tuple(found)


def drives(path: Path, model: Any, wanted: Sequence[str], voltage: float | None) -> list[Drive]:
    """The `<dcmotor>` actuators that drive hinges, or those of the names `wanted`.

    Raises
    ------
    InputError : there is none, or an unknown name, no supply, or a joint that is no hinge.
    """
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    is_motor = model.actuator_gaintype == int(mujoco.mjtGain.mjGAIN_DCMOTOR)
    there = {model.actuator(k).name or f"number {k}": k for k in np.flatnonzero(is_motor).tolist()}
    there = {name: k for name, k in there.items() if model.actuator_gainprm[k][CONSTANT] > 0.0}
    if not there:
        raise InputError(f"{path}: holds no <dcmotor> that drives a joint")
    for name in wanted:
        if name not in there:
            raise InputError(f"--motor {name}: {path} has no such <dcmotor> (it has {', '.join(there)})")
    found = []
    for name in wanted or there:
        k = there[name]
        joint = int(model.actuator_trnid[k][0])
        ways = int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)
        if int(model.actuator_trntype[k]) not in ways or model.jnt_type[joint] != int(mujoco.mjtJoint.mjJNT_HINGE):
            raise InputError(f"{path}: <dcmotor> {name}: drives no hinge, which alone is read")
        top = float(model.actuator_ctrlrange[k][1]) if model.actuator_ctrllimited[k] else 0.0
        top = voltage or _supply(model) or top
        if top <= 0.0:
            raise InputError(f"{path}: <dcmotor> {name}: has no ctrlrange; give the supply by --voltage")
        gear, dof = float(model.actuator_gear[k][0]), int(model.jnt_dofadr[joint])
        if not gear:
            raise InputError(f"{path}: <dcmotor> {name}: gear is 0")
        resistance = float(model.actuator_gainprm[k][RESISTANCE])
        ratio = abs(gear)
        found.append(
            Drive(
                name=name,
                body=int(model.jnt_bodyid[joint]),
                anchor=data.xanchor[joint].copy(),
                axis=data.xaxis[joint].copy(),
                sign=math.copysign(1.0, gear),
                gear=ratio,
                resistance_ohm=resistance,
                inductance_h=float(model.actuator_dynprm[k][ELECTRICAL]) * resistance,
                constant=float(model.actuator_gainprm[k][CONSTANT]),
                rotor_kg_m2=float(model.actuator_armature[k]) + float(model.dof_armature[dof]) / ratio**2,
                viscous_nm_s_per_rad=float(model.actuator_damping[k]) + float(model.dof_damping[dof]) / ratio**2,
                top_v=top,
                effects=_effects(model, k, dof, ratio),
                lost=_lost(model, k, name),
            )
        )
    return found


def _supply(model: Any) -> float | None:
    """The supply that a file of `rtds export` says, V."""
    for k in range(model.nnumeric):
        if model.numeric(k).name == "supply_v":
            return float(model.numeric(k).data[0])
    return None


@dataclass(frozen=True)
class Masses:
    """Bodies as one: kg, centre (3,) m in the world, inertia (3, 3) about the centre, kg·m²."""

    mass_kg: float
    centre_m: np.ndarray
    inertia_kg_m2: np.ndarray

    def about(self, axis: np.ndarray, point: np.ndarray) -> float:
        """Inertia about an axis (unit, (3,)) through a point, kg·m²."""
        arm = self.centre_m - point
        return float(axis @ self.inertia_kg_m2 @ axis + self.mass_kg * (arm @ arm - (arm @ axis) ** 2))


def masses(model: Any, root: int) -> Masses:
    """A body with all that hangs on it."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    inside = [root]
    for body in range(root + 1, model.nbody):
        if model.body_parentid[body] in inside:
            inside.append(body)
    weights = model.body_mass[inside]
    total = float(weights.sum())
    centre = (weights[:, None] * data.xipos[inside]).sum(axis=0) / total if total > 0.0 else data.xpos[root].copy()
    inertia = np.zeros((3, 3))
    for body in inside:
        turned = data.ximat[body].reshape(3, 3)
        arm = data.xipos[body] - centre
        inertia += turned @ np.diag(model.body_inertia[body]) @ turned.T
        inertia += model.body_mass[body] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return Masses(total, centre, inertia)


def _radius(path: Path, model: Any, drive: Drive) -> float:
    """Radius of a wheel: of its largest round geom, or half the height of its largest other one."""
    import mujoco

    kind = mujoco.mjtGeom
    round_ones = [int(one) for one in (kind.mjGEOM_SPHERE, kind.mjGEOM_CYLINDER, kind.mjGEOM_CAPSULE)]
    inside = [k for k in range(model.ngeom) if model.geom_bodyid[k] == drive.body]
    of_round = [float(model.geom_size[k][0]) for k in inside if model.geom_type[k] in round_ones]
    others = [float(np.sort(model.geom_aabb[k][3:])[1]) for k in inside]
    if not inside:
        raise InputError(f"{path}: the body of <dcmotor> {drive.name} has no geom; give --wheel-radius")
    return max(of_round or others)


def _same(found: Sequence[Drive]) -> list[str]:
    """What differs between two motors, of which the first is taken."""
    lines = []
    for name in ("gear", "resistance_ohm", "inductance_h", "constant", "rotor_kg_m2", "viscous_nm_s_per_rad", "top_v"):
        values = [getattr(drive, name) for drive in found]
        if max(values) - min(values) > ALIKE * max(values):
            said = ", ".join(f"{value:.5g}" for value in values)
            lines.append(f"{name} differs between the motors ({said}): the first is taken")
    if len({drive.sign for drive in found}) > 1 or abs(found[0].axis @ found[-1].axis - 1.0) > ALIKE:
        lines.append("the motors turn opposite ways: v_cmd counts forwards on both sides")
    return lines


def _motor_text(drive: Drive) -> str:
    inductance, rotor = drive.inductance_h, drive.rotor_kg_m2
    assumed = inductance <= 0.0, rotor <= 0.0
    if assumed[0]:
        inductance = ELECTRICAL_S * drive.resistance_ohm
    if assumed[1]:
        rotor = MECHANICAL_S * drive.constant**2 / drive.resistance_ohm
    times = (ELECTRICAL_S, MECHANICAL_S)
    notes = [f"  # assumed: {1e3 * tau:g} ms" if no else "" for no, tau in zip(assumed, times, strict=True)]
    return f"""[motor]
resistance_ohm = {drive.resistance_ohm:.9g}
inductance_h = {inductance:.9g}{notes[0]}
torque_constant_nm_per_a = {drive.constant:.9g}
back_emf_constant_v_s_per_rad = {drive.constant:.9g}
rotor_inertia_kg_m2 = {rotor:.9g}{notes[1]}
viscous_friction_nm_s_per_rad = {drive.viscous_nm_s_per_rad:.9g}
gear_ratio = {drive.gear:.9g}

[supply]
voltage_v = {drive.top_v:.9g}
"""


def _noise(model: Any, drive: Drive) -> dict[str, float]:
    """Noise that the file gives sensors of a motor's hinge, and a gyro: by the name in robot.toml, rad and rad/s."""
    import mujoco

    kinds = {
        int(mujoco.mjtSensor.mjSENS_JOINTPOS): "th_rad",
        int(mujoco.mjtSensor.mjSENS_JOINTVEL): "w_rad_s",
        int(mujoco.mjtSensor.mjSENS_GYRO): "gyro_rad_s",
    }
    found: dict[str, float] = {}
    for kind, place, noise in zip(model.sensor_type, model.sensor_objid, model.sensor_noise, strict=True):
        name = kinds.get(int(kind))
        if name is None or noise <= 0.0 or (name != "gyro_rad_s" and model.jnt_bodyid[place] != drive.body):
            continue
        found.setdefault(name, float(noise))
    return found


def _sensor_text(model: Any, drive: Drive, robot: bool) -> str:
    numbers = {
        "th_rad": f"{ANGLE_RAD:.3g}",
        "w_rad_s": f"{SPEED_RAD_S:g}",
        "i_a": f"{0.01 * drive.top_v / drive.resistance_ohm:.3g}",
        "v_bus_v": f"{0.0025 * drive.top_v:.3g}",
    }
    if robot:
        numbers |= {"gyro_rad_s": "0.003", "xy_m": "0.001", "yaw_rad": "0.002"}
    read = {name: f"{value:.9g}  # noise of the file's sensor" for name, value in _noise(model, drive).items()}
    numbers |= {name: text for name, text in read.items() if name in numbers}
    lines = "".join(f"{name} = {text}\n" for name, text in numbers.items())
    return f"[sensors]                       # assumed where nothing else is said\n{lines}"


def _axis_text(model: Any, drive: Drive) -> str:
    """The load on one hinge: a pendulum where gravity turns it, or an inertia."""
    load = masses(model, drive.body)
    way = drive.axis * drive.sign
    arm = load.centre_m - drive.anchor
    arm = arm - (arm @ way) * way
    gravity = np.array(model.opt.gravity)
    down = gravity - (gravity @ way) * way
    length, pull = float(np.linalg.norm(arm)), float(np.linalg.norm(down))
    whole = load.about(way, drive.anchor)
    if length * load.mass_kg * pull <= ALIKE * max(whole, 1e-12):
        return f'[axis]\nkind = "inertia"\ninertia_kg_m2 = {whole:.9g}\n'
    angle = math.atan2(float(way @ np.cross(arm, down)), float(arm @ down))
    # The contract's pendulum stands upright on level ground: where gravity acts less, its arm is shorter.
    effective = length * pull / GRAVITY_M_S2
    return (
        f'[axis]\nkind = "pendulum"\nmass_kg = {load.mass_kg:.9g}\nlength_m = {effective:.9g}\n'
        f"inertia_kg_m2 = {max(whole - load.mass_kg * effective**2, 0.0):.9g}\nzero_rad = {angle:.9g}\n"
    )


def _chassis_text(path: Path, model: Any, left: Drive, right: Drive, given: dict[str, float | None]) -> str:
    """The body of a robot on two wheels, about the middle of their axle."""
    root = int(model.body_rootid[left.body])
    if root != int(model.body_rootid[right.body]):
        raise InputError(f"{path}: <dcmotor> {left.name} and {right.name}: drive two bodies apart; name one by --motor")
    whole, wheel = masses(model, root), masses(model, left.body)
    middle = 0.5 * (left.anchor + right.anchor)
    side = left.axis * left.sign
    up = -np.array(model.opt.gravity)
    up = np.array([0.0, 0.0, 1.0]) if not up.any() else up / np.linalg.norm(up)
    track = given["track_width_m"] or abs(float((left.anchor - right.anchor) @ side))
    if track <= ALIKE:
        raise InputError(f"{path}: <dcmotor> {left.name} and {right.name}: their hinges are no axle's two ends")
    radius = given["wheel_radius_m"] or _radius(path, model, left)
    arm = whole.centre_m - middle
    height = float(arm @ up) + radius
    return f"""[chassis]
mass_kg = {given["mass_kg"] or whole.mass_kg:.9g}
yaw_inertia_kg_m2 = {whole.about(up, middle):.9g}
wheel_radius_m = {radius:.9g}
wheel_inertia_kg_m2 = {wheel.about(left.axis, left.anchor):.9g}
track_width_m = {track:.9g}
com_x_m = {float(arm @ np.cross(side, up)):.9g}
com_y_m = {float(arm @ side):.9g}
com_z_m = {height if height > 0.0 else HEIGHT_RADII * radius:.9g}
"""


def read_mjcf(
    path: Path,
    name: str,
    wanted: Sequence[str] = (),
    given: dict[str, float | None] | None = None,
) -> Read:
    """A robot of two `<dcmotor>`, or an axis of one.

    Parameters
    ----------
    wanted : names of the motors, where the file has others, too. given : `voltage_v`, `wheel_radius_m`,
        `track_width_m`, `mass_kg` in the place of the file's.

    Raises
    ------
    InputError : names the file and what is missing or wrong in it.
    """
    numbers = {key: (given or {}).get(key) for key in ("voltage_v", "wheel_radius_m", "track_width_m", "mass_kg")}
    model = compiled(path)
    found = drives(path, model, wanted, numbers["voltage_v"])
    if len(found) > 2:
        names = ", ".join(drive.name for drive in found)
        raise InputError(f"{path}: holds {len(found)} <dcmotor> ({names}); name one or two by --motor")
    lost = [line for drive in found for line in drive.lost]
    if len(found) == 2:
        side = found[0].axis * found[0].sign
        found.sort(key=lambda drive: -float(drive.anchor @ side))
        lost = _same(found) + lost
        load = _chassis_text(path, model, found[0], found[1], numbers)
    else:
        load = _axis_text(model, found[0])
    effects = _by_side(found, lost)
    quoted = name.replace("\\", "\\\\").replace('"', '\\"')
    text = (
        f"# Made by `rtds init --mjcf` from {visible(path.name)}: {', '.join(visible(one.name) for one in found)}.\n"
        "# SI units; motor values are at the motor's shaft.\n"
        + "".join(f"# Not in here: {line}\n" for line in lost)
        + f'schema = "rtds-robot/1"\nname = "{quoted}"\n\n{_motor_text(found[0])}\n{load}\n'
        + f"{_sensor_text(model, found[0], len(found) == 2)}\n"
        + f"[tolerance]                     # assumed\nmotor = {ASSUMED:g}\n"
    )
    return Read(text, effects, lost)


def _by_side(found: Sequence[Drive], lost: list[str]) -> list[tuple[str, str, dict[str, float]]]:
    """Effects as (id, side, values): of both sides where both have the same; what has no sides must, or is lost."""
    from rtds_host.diagnosis.effects import CATALOGUE

    each = [dict(drive.effects) for drive in found]
    if len(each) == 1:
        return [(effect, "left", values) for effect, values in each[0].items()]
    listed = []
    for effect in dict.fromkeys(name for one in each for name in one):
        if each[0].get(effect) == each[1].get(effect):
            listed.append((effect, "both", each[0][effect]))
            continue
        if not CATALOGUE[effect].sided:
            lost.append(f"{effect}: differs between the motors")
            continue
        for side, one in zip(("left", "right"), each, strict=True):
            if effect in one:
                listed.append((effect, side, one[effect]))
    return listed


def check(path: Path, found: Read) -> None:
    """Whether what was read is a robot with effects that the program takes.

    Raises
    ------
    InputError : a value of the model lies out of what a robot or an effect may have.
    """
    from rtds_host.cleanup import temporary_folder
    from rtds_host.contract import load_robot
    from rtds_host.diagnosis.predict import read_diagnosis

    with temporary_folder() as folder:
        (folder / "robot.toml").write_text(found.text, encoding="utf-8")
        (folder / "effects.json").write_text(json.dumps(diagnosis_of(found.effects)), encoding="utf-8")
        try:
            read_diagnosis(folder / "effects.json", load_robot(folder / "robot.toml"))
        except InputError as error:
            raise InputError(f"{path}: gives no robot: {str(error).removeprefix(f'{folder}/')}") from error


def diagnosis_of(effects: Sequence[tuple[str, str, dict[str, float]]]) -> dict:
    """Effects as a file that `rtds export`, `predict` and `close` take in the place of a diagnosis."""
    from rtds_host.diagnosis.effects import CATALOGUE

    return {
        "schema": "rtds-diagnosis/2",
        "verdict": "known" if effects else "none",
        "nominal_fit": {},
        "effects": [
            {
                "id": effect,
                "side": side,
                "subsystem": CATALOGUE[effect].subsystem,
                "probability": 1.0,
                "parameters": {key: {"value": value, "ci90": None} for key, value in values.items()},
            }
            for effect, side, values in effects
        ],
    }
