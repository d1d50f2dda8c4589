"""The robot of a diagnosis in an exporter's terms: numbers of body, wheels and motors, at the wheel's side of
the gear.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np

from rtds_host.contract import Robot
from rtds_host.correction.correction import BodyValues
from rtds_host.diagnosis.replay.model import Model
from rtds_host.errors import InputError
from rtds_host.plant.forms import no_forms
from rtds_host.plant.friction import rolling
from rtds_host.plant.schema import COMMON, SIDE, Entry
from rtds_host.plant.torques import TORQUES
from rtds_host.robot import Body, make_body

SIDES = ("left", "right")
NO_LIMIT_V = 1e8


@dataclass(frozen=True)
class Side:
    """One wheel with its motor. `gear` times the current is the torque at the wheel: N·Km; `rotor_kg_m2` is N²J and
    `viscous_nm_s_per_rad` all damping but the back EMF's; `dry_nm` is dry friction at speed, rolling resistance of the
    robot without payload included; `torques` are the parameters of torques by angle or speed by their exported
    names (`rtds_host.plant.torques`); the others are the plant's parameters under their exported names."""

    resistance_ohm: float
    inductance_h: float
    gear_nm_per_a: float
    back_emf_v_s_per_rad: float
    rotor_kg_m2: float
    viscous_nm_s_per_rad: float
    voltage_gain: float
    limit_v: float
    deadzone_v: float
    drop_v: float
    drop_knee_a: float
    pwm_curve: float
    heat_rise_per_w: float
    heat_tau_s: float
    dry_nm: float
    stribeck_nm: float
    stribeck_rad_s: float
    asymmetry_nm: float
    asymmetry_nm_s_per_rad: float
    load_share: float
    stiffness_nm_per_rad: float
    damping_nm_s_per_rad: float
    backlash_rad: float
    torques: Mapping[str, float]
    radius_m: float
    speed_gain: float
    current_gain: float
    current_bias_a: float
    speed_filter_s: float
    speed_delay_s: float
    command_gain: float

    @property
    def torque_per_volt(self) -> float:
        """N·m at the wheel that a commanded volt gives at rest."""
        return self.gear_nm_per_a * self.voltage_gain / self.resistance_ohm

    @property
    def braking(self) -> float:
        """N·m·s/rad that the back EMF damps the wheel with."""
        return self.gear_nm_per_a * self.back_emf_v_s_per_rad / self.resistance_ohm


@dataclass(frozen=True)
class Loop:
    """The servo's speed loop of a robot that is driven by wheel speeds: a PI controller that reads the reported speed
    each `period_s`; its integrator and its voltage stay within `limit_v` (contract, section 7)."""

    kp_v_s_per_rad: float
    ki_v_per_rad: float
    limit_v: float
    period_s: float


@dataclass(frozen=True)
class Figures:
    """A robot: `body` as an engine builds it, without payload on level ground, and two sides. `loop` is None where it
    is driven by volts. `forms` (2, MOST_FORMS, WIDTH): rows of free curves, see `rtds_host.plant.forms`."""

    name: str
    body: Body
    sides: tuple[Side, Side]
    supply_v: float
    gear_ratio: float
    source_resistance_ohm: float
    decline_v_per_s: float
    rolling: float
    scrub_nm: float
    slope_extra_rad: float
    gyro_gain: float
    gyro_bias_rad_s: float
    command_delay_s: float
    measurement_delay_s: float
    encoder_at_wheel: float
    noise: dict[str, float]
    loop: Loop | None = None
    forms: np.ndarray = field(default_factory=no_forms, compare=False)

    def limit_v(self, side: Side) -> float:
        """Largest command, V, that still has an effect: the supply, or the driver's own limit before its gain."""
        gain = abs(side.voltage_gain)
        return self.supply_v if gain == 0.0 else min(self.supply_v, side.limit_v / gain)


def _named(model: Model, entries: Mapping[str, Entry], kind: type, side: int = 0) -> dict[str, float]:
    """A model's parameters that a dataclass has under the names by which the schema exports them."""
    there = {f.name for f in fields(kind)}
    return {entry.export: model.get(name, side) for name, entry in entries.items() if entry.export in there}


def figures_of(model: Model, robot: Robot) -> Figures:
    """The numbers of a model (`read_diagnosis`, `nominal_model`).

    Raises
    ------
    InputError : no robot on two wheels driven by voltage or wheel speed, a body that cannot be built, or a bridge in
    fast decay.
    """
    if robot.chassis is None:
        raise InputError(f"robot {robot.name!r}: is a single axis, a robot on two wheels can be exported")
    if robot.driver.mode == "torque":
        raise InputError(
            f"robot {robot.name!r}: [driver] mode is 'torque', the motors of an exported robot take volts or wheel"
            " speeds"
        )
    get = model.get
    if get("fast_decay", 0) or get("fast_decay", 1):
        raise InputError(
            f"robot {robot.name!r}: pwm_curve: fast_decay is not 0, the voltage of an exported motor follows the duty"
            " cycle alone"
        )
    n = get("gear_ratio")
    body = BodyValues(
        mass_kg=get("mass"),
        yaw_inertia_kg_m2=get("yaw_inertia"),
        wheel_radius_m=(get("radius", 0), get("radius", 1)),
        wheel_inertia_kg_m2=get("wheel_inertia"),
        track_width_m=get("track"),
        com_x_m=get("com_x"),
        com_y_m=get("com_y"),
    ).on(make_body(robot))
    loop = None
    if robot.driver.mode == "speed":
        loop = replace(Loop(**_named(model, COMMON, Loop)), limit_v=min(get("servo_limit"), get("supply")))
    sides = []
    for k in (0, 1):
        limit = get("limit", k)
        dry = get("coulomb", k) + rolling.py_func(get("rolling"), get("mass"), get("radius", k))
        changed = {
            "gear_nm_per_a": n * get("torque_constant", k),
            "back_emf_v_s_per_rad": n * get("back_emf", k),
            "rotor_kg_m2": n**2 * get("rotor_inertia", k),
            "viscous_nm_s_per_rad": max(n**2 * get("viscous", k) + get("viscous_wheel", k), 0.0),
            "limit_v": limit if limit < NO_LIMIT_V else math.inf,
            "deadzone_v": max(get("deadzone", k), 0.0),
            "dry_nm": dry,
            "stribeck_rad_s": abs(get("stribeck_speed", k)),
        }
        torques = {e.export: get(e.name, k) for torque in TORQUES.values() for e in torque.entries}
        sides.append(Side(**{**_named(model, SIDE, Side, k), **changed}, torques=torques))
    return Figures(
        name=robot.name,
        body=body,
        sides=(sides[0], sides[1]),
        **_named(model, COMMON, Figures),
        noise=dict(robot.sensors),
        loop=loop,
        forms=np.array(model.forms),
    )
