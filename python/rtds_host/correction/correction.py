"""What a robot has beyond the nominal one, as the real-time simulator takes it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from rtds_host.errors import InputError
from rtds_host.motor.effects import MotorParameters, SupplyEffects, UnitEffects
from rtds_host.plant.compiled import loop
from rtds_host.plant.driver import decay_adds, duty
from rtds_host.plant.elementary import exponential
from rtds_host.plant.forms import no_forms
from rtds_host.robot import Body
from rtds_host.robot.split import inertia_of
from rtds_host.robot.urdf import base_inertia, yaw_inertia_kg_m2

# A base with less yaw inertia than this share of what robot.toml says cannot be built from its mass and centre.
LEAST_BASE_SHARE = 0.02
# Tyres and skids of a robot whose wheels are jolted by their gears.
JOLTED_FRICTION, JOLTED_ARM_M = 300.0, 3.0


@dataclass(frozen=True)
class BodyValues:
    """Body and wheels as they are, in place of `robot.toml`'s; SI, `wheel_radius_m` [left, right].

    `slope_extra_rad` adds to a run's slope.
    """

    mass_kg: float
    yaw_inertia_kg_m2: float
    wheel_radius_m: tuple[float, float]
    wheel_inertia_kg_m2: float
    track_width_m: float
    com_x_m: float
    com_y_m: float
    slope_extra_rad: float = 0.0

    def on(self, body: Body) -> Body:
        """The body of a run with these values, as an engine can build it.

        A centre of mass so far off that the base would need less than no yaw inertia about itself gets the least base
        there is; the engine then has too much of it, and `Coupler` takes the difference off the torques.

        Raises
        ------
        InputError : no mass is left, or the slope is beyond what wheels stand on.
        """
        slope = body.slope_rad + self.slope_extra_rad
        if not abs(slope) <= 0.7:
            raise InputError(f"slope: is {slope:g} rad with the effects, it must lie within -0.7 to 0.7")
        changed = replace(
            body,
            mass_kg=self.mass_kg,
            yaw_inertia_kg_m2=self.yaw_inertia_kg_m2,
            wheel_radius_m=self.wheel_radius_m,
            wheel_inertia_kg_m2=self.wheel_inertia_kg_m2,
            track_width_m=self.track_width_m,
            com_m=(self.com_x_m, self.com_y_m, body.com_m[2]),
            slope_rad=slope,
        )
        if self.mass_kg <= 0:
            raise InputError(f"mass: is {self.mass_kg:g} kg with the effects, it must be above 0")
        # `Body` counts the yaw inertia about the axle without the payload's share of the centre's offset.
        offset = yaw_inertia_kg_m2(changed) - self.yaw_inertia_kg_m2
        return replace(changed, yaw_inertia_kg_m2=max(self.yaw_inertia_kg_m2 - offset, self._least(changed)))

    def at_wheels(self, payload_kg: float) -> np.ndarray:
        """Inertia (2, 2) kg m² at the wheels, their own spin included."""
        return inertia_of(
            self.mass_kg + payload_kg, self.com_y_m, self.yaw_inertia_kg_m2, self.wheel_radius_m, self.track_width_m
        )[0] + self.wheel_inertia_kg_m2 * np.eye(2)

    @staticmethod
    def _least(body: Body) -> float:
        """The smallest `yaw_inertia_kg_m2` of a Body that leaves its base a share of the yaw inertia."""
        heavy = replace(body, yaw_inertia_kg_m2=1e3)
        taken = 1e3 - base_inertia(heavy).inertia_kg_m2[2] + LEAST_BASE_SHARE * body.yaw_inertia_kg_m2
        wheels = 0.5 * heavy.wheel_mass_kg * body.track_width_m**2
        # With less yaw inertia the wheels are lighter: they then take a quarter of it (`Body.wheel_mass_kg`).
        return min(taken, (taken - wheels) / 0.75)


@dataclass(frozen=True)
class GearValues:
    """Gear and tyre of one side, at the wheel; 0 is absent (a rigid gear, a tyre that does not slip)."""

    stiffness_nm_per_rad: float = 0.0
    damping_nm_s_per_rad: float = 0.0
    backlash_rad: float = 0.0
    restitution: float = 0.0
    slip_per_newton: float = 0.0
    slip_relaxation_m: float = 0.0
    slip_damping_n_s_per_m: float = 0.0
    grip: float = 0.9


@loop
def _decay_adds(curved, plain, emf, supply, share, periods):
    """`rtds_host.plant.driver.decay_adds`, compiled."""
    return decay_adds(curved, plain, emf, supply, share, periods, exponential)


@dataclass(frozen=True)
class BridgeValues:
    """A side's bridge with a `share` of fast decay: its PWM period over L / R, the curve that the other share has, dead
    zone, gain and nominal bus, see `rtds_host.plant.driver`."""

    share: float
    periods: float
    curve: float
    deadzone_v: float
    gain: float
    supply_v: float

    def more(self, asked: float, emf: float) -> float:
        """Voltage beyond that of dead zone and gain, V at the nominal bus; asked : command, V; emf : back EMF, V."""
        plain, curved = (
            duty.py_func(asked, self.supply_v, curve, self.deadzone_v, self.gain) for curve in (0.0, self.curve)
        )
        return curved - plain + _decay_adds(curved, plain, emf, self.supply_v, self.share, self.periods)


@dataclass(frozen=True)
class SensorValues:
    """How what is reported differs from what is; two-vectors [left, right], SI. `encoder_at_wheel`: 1 where w and th
    are measured behind free play and springs, 0 before them. `forms` (2, MOST_FORMS, WIDTH) are added to readings, see
    `rtds_host.plant.forms.reads`."""

    speed_gain: tuple[float, float] = (1.0, 1.0)
    current_gain: tuple[float, float] = (1.0, 1.0)
    current_bias_a: tuple[float, float] = (0.0, 0.0)
    speed_filter_s: tuple[float, float] = (0.0, 0.0)
    speed_delay_s: tuple[float, float] = (0.0, 0.0)
    gyro_gain: float = 1.0
    gyro_bias_rad_s: float = 0.0
    delay_s: float = 0.0
    encoder_at_wheel: float = 0.0
    forms: np.ndarray = field(default_factory=no_forms, compare=False)


@dataclass(frozen=True)
class Correction:
    """All that makes the simulator another robot than the nominal one.

    `units` and `supply` go to the link, `body` into the physics engine, `gears` and `scrub_nm` into the layer between
    them, `sensors` into the signal path. `bus_measured`: the bus follows the log's `v_bus` (a replay only).
    `loaded_motors`: those of units with a part of the body's inertia (`rtds_host.robot.split`), None of the others.
    `forms` (2, MOST_FORMS, WIDTH): terms that no table of a unit holds, which act between units and engine;
    `start_angles`: rad, wheel angles [left, right] as the run begins, which these terms may run over. `bridges`: those
    in fast decay, whose voltage follows the back EMF and so is sent as another command; None of the others.
    """

    units: tuple[UnitEffects, UnitEffects]
    supply: SupplyEffects
    body: BodyValues
    gears: tuple[GearValues, GearValues] = (GearValues(), GearValues())
    scrub_nm: float = 0.0
    sensors: SensorValues = field(default_factory=SensorValues)
    bus_measured: bool = False
    loaded_motors: tuple[MotorParameters | None, MotorParameters | None] = (None, None)
    forms: np.ndarray = field(default_factory=no_forms, compare=False)
    start_angles: tuple[float, float] = (0.0, 0.0)
    bridges: tuple[BridgeValues | None, BridgeValues | None] = (None, None)

    def body_on(self, body: Body) -> Body:
        """The body of a run with this correction, see `BodyValues.on`.

        Free play and springs let a wheel's speed jump. The planar robot neither pitches nor slides then; the engine's
        would: its centre of mass comes down to the ground, its tyres grip, and its skids stand far out.

        Raises
        ------
        InputError : see `BodyValues.on`.
        """
        changed = self.body.on(body)
        if any(g.backlash_rad or g.stiffness_nm_per_rad for g in self.gears):
            return replace(
                changed, com_m=(*changed.com_m[:2], 0.0), tyre_friction=JOLTED_FRICTION, skid_arm_m=JOLTED_ARM_M
            )
        return changed

    def links_effects(self) -> dict:
        """Arguments of `Link.set_effects`."""
        loaded = (
            unit if motor is None else replace(unit, motor=motor) for unit, motor in zip(self.units, self.loaded_motors)
        )
        left, right = (None if unit.absent else unit for unit in loaded)
        return {
            "left": left,
            "right": right,
            "supply": None if self.supply.absent and left is right is None else self.supply,
        }
