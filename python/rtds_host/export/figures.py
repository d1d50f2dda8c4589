"""The robot of a diagnosis in an exporter's terms: numbers of body, wheels and motors, at the wheel's side of
the gear.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rtds_host.contract import GRAVITY_M_S2, Robot
from rtds_host.correction.correction import BodyValues
from rtds_host.diagnosis.replay.model import Model
from rtds_host.errors import InputError
from rtds_host.robot import Body, make_body

SIDES = ("left", "right")
NO_LIMIT_V = 1e8


@dataclass(frozen=True)
class Side:
    """One wheel with its motor. `gear` times the current is the torque at the wheel: N·Km; `rotor_kg_m2` is N²J and
    `viscous_nm_s_per_rad` all damping but the back EMF's; `dry_nm` is dry friction at speed, rolling resistance of the
    robot without payload included; the others are the replay's slots of that name."""

    resistance_ohm: float
    gear_nm_per_a: float
    back_emf_v_s_per_rad: float
    rotor_kg_m2: float
    viscous_nm_s_per_rad: float
    voltage_gain: float
    limit_v: float
    deadzone_v: float
    drop_v: float
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
    ripple_nm: float
    ripple_cycles: float
    ripple_phase_rad: float
    radius_m: float
    speed_gain: float
    current_gain: float
    current_bias_a: float
    speed_filter_s: float
    speed_late_s: float

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
    is driven by volts."""

    name: str
    body: Body
    sides: tuple[Side, Side]
    supply_v: float
    source_resistance_ohm: float
    decline_v_per_s: float
    rolling: float
    scrub_nm: float
    slope_extra_rad: float
    gyro_gain: float
    gyro_bias_rad_s: float
    command_delay_s: float
    measurement_delay_s: float
    noise: dict[str, float]
    loop: Loop | None = None

    def limit_v(self, side: Side) -> float:
        """Largest command, V, that still has an effect: the supply, or the driver's own limit before its gain."""
        gain = abs(side.voltage_gain)
        return self.supply_v if gain == 0.0 else min(self.supply_v, side.limit_v / gain)


def figures_of(model: Model, robot: Robot) -> Figures:
    """The numbers of a model (`read_diagnosis`, `nominal_model`).

    Raises
    ------
    InputError : no robot on two wheels driven by voltage or wheel speed, or a body that cannot be built.
    """
    if robot.chassis is None:
        raise InputError(f"robot {robot.name!r}: is a single axis, a robot on two wheels can be exported")
    if robot.driver.mode == "torque":
        raise InputError(
            f"robot {robot.name!r}: [driver] mode is 'torque', the motors of an exported robot take volts or wheel"
            " speeds"
        )
    get = model.get
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
        loop = Loop(get("servo_kp"), get("servo_ki"), min(get("servo_limit"), get("supply")), get("servo_period"))
    sides = []
    for k in (0, 1):
        rolling = get("rolling") * get("mass") * GRAVITY_M_S2 * 0.5 * get("radius", k)
        limit = get("limit", k)
        sides.append(
            Side(
                resistance_ohm=get("resistance", k),
                gear_nm_per_a=n * get("torque_constant", k),
                back_emf_v_s_per_rad=n * get("back_emf", k),
                rotor_kg_m2=n**2 * get("rotor_inertia", k),
                viscous_nm_s_per_rad=max(n**2 * get("viscous", k) + get("viscous_wheel", k), 0.0),
                voltage_gain=get("voltage_gain", k),
                limit_v=limit if limit < NO_LIMIT_V else math.inf,
                deadzone_v=max(get("deadzone", k), 0.0),
                drop_v=get("drop", k),
                pwm_curve=get("pwm_curve", k),
                heat_rise_per_w=get("heat_rise", k),
                heat_tau_s=get("heat_tau", k),
                dry_nm=get("coulomb", k) + rolling,
                stribeck_nm=get("stribeck", k),
                stribeck_rad_s=abs(get("stribeck_speed", k)),
                asymmetry_nm=get("asymmetry", k),
                asymmetry_nm_s_per_rad=get("asymmetry_viscous", k),
                load_share=get("load_share", k),
                stiffness_nm_per_rad=get("stiffness", k),
                damping_nm_s_per_rad=get("damping", k),
                backlash_rad=get("backlash", k),
                ripple_nm=get("ripple", k),
                ripple_cycles=get("ripple_cycles", k),
                ripple_phase_rad=get("ripple_phase", k),
                radius_m=get("radius", k),
                speed_gain=get("speed_gain", k),
                current_gain=get("current_gain", k),
                current_bias_a=get("current_bias", k),
                speed_filter_s=get("speed_tau", k),
                speed_late_s=get("speed_late", k),
            )
        )
    return Figures(
        name=robot.name,
        body=body,
        sides=(sides[0], sides[1]),
        supply_v=get("supply"),
        source_resistance_ohm=get("source_resistance"),
        decline_v_per_s=get("decline"),
        rolling=get("rolling"),
        scrub_nm=get("scrub"),
        slope_extra_rad=get("slope_extra"),
        gyro_gain=get("gyro_gain"),
        gyro_bias_rad_s=get("gyro_bias"),
        command_delay_s=get("command_delay"),
        measurement_delay_s=get("measurement_delay"),
        noise=dict(robot.sensors),
        loop=loop,
    )
