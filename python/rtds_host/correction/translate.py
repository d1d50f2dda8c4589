"""From the replay's numbers to the simulator's: the one place that knows both.

An effect of the catalogue writes its numbers into a `Model` (`rtds_host.diagnosis.replay`), once, in its own file; so
do a diagnosis' `nominal_fit` and effects. Here each of the model's parameters is handed to where it acts in the
real-time simulator: its place and its name there stand in the schema (`rtds_host.plant.schema`). A translation that
leaves a parameter unread raises `LookupError`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np

from rtds_host.contract import Robot
from rtds_host.correction import formed
from rtds_host.correction.correction import BodyValues, BridgeValues, Correction, GearValues, SensorValues
from rtds_host.diagnosis.effects import Effect
from rtds_host.diagnosis.forms.curves import named, points_of
from rtds_host.diagnosis.replay.model import Model, nominal_model
from rtds_host.errors import InputError
from rtds_host.motor.effects import Curve, MotorParameters, SupplyEffects, UnitEffects
from rtds_host.plant import forms
from rtds_host.plant.driver import after_bridge_drop, duty
from rtds_host.plant.elementary import exponential
from rtds_host.plant.friction import rolling, stribeck
from rtds_host.plant.schema import COMMON, LOG, PLACES, REFUSED, SIDE
from rtds_host.plant.torque import ANGLE, SPEED, Torque
from rtds_host.plant.torques import TORQUES
from rtds_host.robot.split import share

# Where an effect runs, in a reader's words.
PLACE_NAMES = {"rtl": "motor unit", "robot": "robot", "signal": "signal path", "refused": "replay, exports"}
NO_LIMIT_V = 1e8
# Friction against speed: points of a curve, over so many of its widths.
STRIBECK_POINTS, STRIBECK_WIDTHS = 97, 3.5
# A bent command against the asked one: points of a curve.
PWM_POINTS = 129
RIPPLE_POINTS = 129
# Drop against current: points of a curve, over so many widths of its bend.
DROP_POINTS, DROP_WIDTHS = 65, 4.0
# Torques against speed: points of a curve.
SPEED_POINTS = 129
# Numerical: two branches of a form that differ at zero by less than this share of its size do not jump there.
NO_JUMP = 1e-3
# Beyond any speed of the motors, rad/s at the wheel.
FAST_RAD_S = 16.0


# What a correction holds as a pair, left and right, of the sensors: its name there, and the parameter's.
_PAIRS = {
    SIDE[name].export: name for name in ("speed_gain", "current_gain", "current_bias", "speed_tau", "speed_delay")
}


class _Parameters:
    """A model's entries, with a list of those that nobody has read."""

    def __init__(self, model: Model):
        self._model = model
        self.unread = {name for name in SIDE.keys() | COMMON.keys() if PLACES[name] != LOG}

    def __call__(self, name: str, side: int = 0) -> float:
        self.unread = self.unread - {name}
        return self._model.get(name, side)

    def pair(self, name: str) -> tuple[float, float]:
        return self(name, 0), self(name, 1)

    def pairs(self) -> dict[str, Any]:
        """What `SensorValues` holds as pairs, left and right, by its names."""
        return {at: self.pair(name) for at, name in _PAIRS.items()}

    def named(self, kind: type, side: int = 0) -> dict[str, Any]:
        """Arguments of a dataclass by the names that the schema exports parameters under."""
        there = {entry.export: name for name, entry in (SIDE | COMMON).items()}
        return {f.name: self(there[f.name], side) for f in fields(kind) if f.name in there and f.name not in _PAIRS}


def translate(
    model: Model,
    robot: Robot,
    payload_kg: float = 0.0,
    start_angles: tuple[float, float] = (0.0, 0.0),
    step_s: float = 1e-5,
) -> Correction:
    """What makes the simulator the robot that a replay's model describes.

    Parameters
    ----------
    robot : the nominal robot. payload_kg : of the run, which rolling resistance grows with.
    start_angles : rad, wheel angles as the run begins, for what depends on the angle.
    step_s : of the motor units; a command's delay is a whole number of them.

    Raises
    ------
    InputError : a robot that is no two-wheeled one driven by voltage, or a value no motor unit can hold.
    LookupError : a parameter that this function does not know.
    """
    get = _Parameters(model)
    _refuse(get, robot)
    nominal = nominal_model(robot)
    if get("gear_ratio") != nominal.get("gear_ratio") or get("supply") != nominal.get("supply"):
        raise InputError("gear_ratio, supply: no effect changes them, they are the robot's own")
    mass = get("mass") + payload_kg
    units = (_unit(get, k, robot, mass, start_angles[k]) for k in (0, 1))
    placed = tuple(_placed(unit, model.forms[k], robot, start_angles[k]) for k, unit in enumerate(units))
    bridges = _bridge(get, 0), _bridge(get, 1)
    left, right = (_reaching(one.unit, bridge) for one, bridge in zip(placed, bridges, strict=True))
    supply = SupplyEffects(
        voltage_v=get("supply"),
        source_resistance_ohm=get("source_resistance"),
        decline_v_per_s=get("decline"),
        command_delay_s=round(get("command_delay") / step_s) * step_s,
    )
    body = BodyValues(**get.named(BodyValues), wheel_radius_m=get.pair("radius"))
    gears = GearValues(**get.named(GearValues, 0)), GearValues(**get.named(GearValues, 1))
    sensors = SensorValues(
        **get.named(SensorValues),
        **get.pairs(),
        delay_s=get("measurement_delay") + get("latency"),
        forms=np.stack([one.sensors for one in placed]),
    )
    loaded = partial(_loaded_motor, body=body, payload_kg=payload_kg, robot=robot)
    correction = Correction(
        units=(left, right),
        supply=supply,
        body=body,
        gears=gears,
        scrub_nm=get("scrub"),
        sensors=sensors,
        bus_measured=get("bus_measured") > 0,
        loaded_motors=(loaded(left, gears[0]), loaded(right, gears[1])),
        forms=np.stack([one.between for one in placed]),
        start_angles=start_angles,
        bridges=bridges,
    )
    if get.unread:
        raise LookupError(f"parameters of the plant that nothing translates: {', '.join(sorted(get.unread))}")
    return correction


def _loaded_motor(
    unit: UnitEffects, gear: GearValues, body: BodyValues, payload_kg: float, robot: Robot
) -> MotorParameters | None:
    """Motor of a unit that includes a part of the body's inertia: where the body is heavy compared with the rotor, and
    nothing gives between them. None elsewhere.

    Raises
    ------
    InputError : friction that grows with the load, where the unit would see a part of the load only.
    """
    n = robot.motor.gear_ratio
    own = unit.motor or MotorParameters(*robot.motor.constants)
    reflected = share(body.at_wheels(payload_kg), n * n * own.rotor_inertia_kg_m2).reflected_kg_m2
    if reflected == 0.0 or gear.stiffness_nm_per_rad or gear.backlash_rad:
        return None
    if unit.load_share:
        raise InputError(
            f"robot {robot.name!r}: gear friction that grows with the load cannot be simulated where the body "
            "is heavy compared with the rotor: the motor unit then includes inertia of the body and sees only the "
            "remaining load"
        )
    return replace(own, rotor_inertia_kg_m2=own.rotor_inertia_kg_m2 + reflected / n**2)


def _refuse(get: _Parameters, robot: Robot) -> None:
    axis, mode = get("axis"), get("mode")
    for name, place in PLACES.items():
        if place == REFUSED:
            get(name)
    if axis != 0 or robot.chassis is None:
        raise InputError(f"robot {robot.name!r}: is a single axis, the real-time simulator has a robot on two wheels")
    if mode != 0:
        raise InputError(
            f"robot {robot.name!r}: [driver] mode is {robot.driver.mode!r}, the real-time simulator drives by voltage"
        )


def _unit(get: _Parameters, k: int, robot: Robot, mass: float, start_angle: float) -> UnitEffects:
    n = get("gear_ratio")
    forward, backward = _friction(get, k, n, mass)
    limit = get("limit", k)
    heat, tau = get("heat_rise", k), get("heat_tau", k)
    over_angle, periods, start = _over_angle(get, k, n, start_angle)
    return UnitEffects(
        motor=_motor(get, k, robot, n),
        command=_command(get, k),
        limit_v=limit if limit < NO_LIMIT_V else math.inf,
        drop=_drop(get, k),
        friction_forward=forward,
        friction_backward=backward,
        torque=_over_speed(get, k, n),
        load_share=get("load_share", k),
        ripple=over_angle,
        ripple_periods_per_rad=periods,
        ripple_start_rad=start,
        heat_rise_per_w=heat,
        heat_tau_s=tau if heat else math.inf,
    )


# The forms that motor units have a table for.
IN_UNITS = (("torque", "w"), ("voltage", "v_cmd"), ("voltage", "i"), ("torque", "th"), ("torque", "motor_angle"))


@dataclass(frozen=True)
class _Placed:
    """A side's forms where they act: its `unit` with those that its tables hold, rows (MOST_FORMS, WIDTH) of what acts
    `between` units and engine, and of the `sensors`."""

    unit: UnitEffects
    between: np.ndarray
    sensors: np.ndarray


def _placed(unit: UnitEffects, rows: np.ndarray, robot: Robot, start: float) -> _Placed:
    """Put a side's forms (MOST_FORMS, WIDTH) where they act: friction by speed and direction, a torque over an angle,
    the command's curve and a voltage over the current into the unit, as far as it has a free table.

    start : rad, the wheel's angle as the run begins.

    Raises
    ------
    InputError : see `formed.beyond`; a wheel that drives itself.
    """
    if formed.drives_itself(rows, unit.motor or MotorParameters(*robot.motor.constants), robot.motor.gear_ratio):
        raise InputError(
            f"robot {robot.name!r}: forms: viscous friction is negative all over its curve, by more than the back-EMF "
            "brakes: the wheel would drive itself"
        )
    between, sensors = np.array(rows), np.zeros_like(rows)
    for k, row in enumerate(rows):
        name = named(row)
        if name is None:
            continue
        term, over = name
        if term in formed.READINGS:
            sensors[k] = row
        elif (term, over) not in IN_UNITS or (held := _held(unit, row, over, robot, start)) is None:
            continue
        else:
            unit = held
        between[k] = 0.0
    if (more := formed.needs_command(between, robot.supply_v)) > 0.0:
        unit = replace(unit, command=formed.beyond(unit.command, robot.supply_v, more))
    return _Placed(unit, between, sensors)


def _held(unit: UnitEffects, row: np.ndarray, over: str, robot: Robot, start: float) -> UnitEffects | None:
    """The unit with a form of `IN_UNITS` in its table, None where that is taken or cannot hold it."""
    high, values, n, supply = float(row[forms.HIGH]), forms.values_in(row), robot.motor.gear_ratio, robot.supply_v
    if over == "w":
        speeds = n * np.linspace(0.0, high, forms.HALF)
        ahead = Curve(tuple(speeds), tuple(-values[forms.HALF :] / n))
        back = Curve(tuple(speeds), tuple(values[: forms.HALF][::-1] / n))
        forward, backward = _sum(unit.friction_forward, ahead), _sum(unit.friction_backward, back)
        return replace(unit, friction_forward=forward, friction_backward=backward)
    if over == "v_cmd":
        x = points_of("v_cmd", -high, high)
        more = Curve((*x[: forms.HALF], 0.0, *x[forms.HALF :]), (*values[: forms.HALF], 0.0, *values[forms.HALF :]))
        plain = unit.command or Curve((-supply, supply), (-supply, supply))
        return replace(unit, command=_sum(plain, more))
    if over == "i":
        ohm = unit.motor.resistance_ohm if unit.motor else robot.motor.resistance_ohm
        return _with_drop(unit, high, values, ohm)
    if unit.ripple is not None:
        return None
    cycles = formed.angle_of(over, n)
    return replace(
        unit,
        ripple=formed.period_table(row, n),
        ripple_periods_per_rad=cycles / (2.0 * math.pi * n),
        ripple_start_rad=(cycles * start - float(row[forms.LOW])) % (2.0 * math.pi),
    )


def _with_drop(unit: UnitEffects, high: float, values: np.ndarray, ohm: float) -> UnitEffects | None:
    """The unit with a voltage over the current, (points,) V up to `high` A, in its table of drops; None where voltage
    over winding and drop does not grow with the current, which that table is looked up by."""
    half = np.linspace(0.0, high, forms.HALF)
    x = np.concatenate([-half[::-1], half])
    drops = -values
    if abs(drops[forms.HALF] - drops[forms.HALF - 1]) < NO_JUMP * float(np.abs(values).max()):
        drops[forms.HALF - 1 : forms.HALF + 1] = 0.5 * (drops[forms.HALF] + drops[forms.HALF - 1])
    if unit.drop:
        drops += [*map(unit.drop.before, x[: forms.HALF]), *map(unit.drop.at, x[forms.HALF :])]
    if (np.diff(ohm * x + drops) < 0.0).any():
        return None
    return replace(unit, drop=Curve(tuple(x), tuple(drops)))


def _sum(one: Curve | None, other: Curve) -> Curve:
    """The sum of two curves without jumps, a point where either has one."""
    if one is None:
        return other
    x = sorted({*one.x, *other.x})
    return Curve(tuple(x), tuple(one.at(v) + other.at(v) for v in x))


def _motor(get: _Parameters, k: int, robot: Robot, n: float) -> MotorParameters | None:
    own = [get(name, k) for name in ("resistance", "inductance", "torque_constant", "back_emf", "rotor_inertia")]
    viscous = get("viscous", k) + get("viscous_wheel", k) / n**2
    if (*own, viscous) == robot.motor.constants:
        return None
    # A unit's friction is above zero; a billionth of a typical one is none.
    return MotorParameters(*(*own, max(viscous, 1e-16)))


def _command(get: _Parameters, k: int) -> Curve | None:
    """The driver's curve, dead zone and gain as a curve: the law at its bends, or at many points where it is bent."""
    gain, dead, top, bend = get("voltage_gain", k), max(get("deadzone", k), 0.0), get("supply"), get("pwm_curve", k)
    if get("fast_decay", k):
        bend = 0.0  # what a bridge in fast decay gives follows the back EMF
    if gain == 1.0 and dead == 0.0 and bend == 0.0:
        return None
    if dead >= top and not bend:
        return Curve((0.0,), (0.0,))
    x = np.linspace(-top, top, PWM_POINTS).tolist() if bend else sorted({-top, -dead, dead, top} - {0.0, -0.0})
    return Curve(tuple(x), tuple(duty.py_func(volts, top, bend, dead, gain) for volts in x))


def _bridge(get: _Parameters, k: int) -> BridgeValues | None:
    """A side's bridge in fast decay, None of another one."""
    share, periods = get("fast_decay", k), get("pwm_periods", k)
    if not share:
        return None
    dead = max(get("deadzone", k), 0.0)
    return BridgeValues(share, periods, get("pwm_curve", k), dead, get("voltage_gain", k), get("supply"))


def _reaching(unit: UnitEffects, bridge: BridgeValues | None) -> UnitEffects:
    """The unit with a driver's curve that reaches each voltage of a bridge in fast decay."""
    if bridge is None:
        return unit
    return replace(unit, command=formed.beyond(unit.command, bridge.supply_v, bridge.supply_v))


def _drop(get: _Parameters, k: int) -> Curve | None:
    """Drop over the current, V over A: two levels, or the law at points of the voltage that drives the current."""
    drop, knee, ohm = get("drop", k), get("drop_knee", k), get("resistance", k)
    if not drop:
        return None
    if not knee:
        return Curve((0.0, 0.0), (-drop, drop))
    drives = (drop + knee * ohm) * np.linspace(-DROP_WIDTHS, DROP_WIDTHS, DROP_POINTS)
    dropped = [u - after_bridge_drop.py_func(u, 0.0, drop, knee, ohm) for u in drives.tolist()]
    return Curve(tuple((drives - dropped) / ohm), tuple(dropped))


def _friction(get: _Parameters, k: int, n: float, mass: float) -> tuple[Curve | None, Curve | None]:
    """Dry friction against turning forwards and backwards.

    Rolling resistance is dry friction of the same shaft: two of them in a row hold and slip as one.
    """
    dry = get("coulomb", k) + rolling.py_func(get("rolling"), mass, get("radius", k))
    extra, width, apart = get("stribeck", k), get("stribeck_speed", k), get("asymmetry", k)
    if not (dry or extra or apart):
        return None, None
    speeds = np.linspace(0.0, STRIBECK_WIDTHS * abs(width), STRIBECK_POINTS) if extra else np.zeros(1)
    level = np.array([dry + stribeck.py_func(v / width, extra, exponential.py_func) for v in speeds.tolist()])
    x = tuple(n * speeds)
    return Curve(x, tuple((level + apart) / n)), Curve(x, tuple((level - apart) / n))


def _present(get: _Parameters, k: int, over: str) -> list[tuple[Torque, dict[str, float]]]:
    """Torques of a side over the angle or the speed, each with its parameters; those of no size left out."""
    found = [(t, {entry.name: get(entry.name, k) for entry in t.entries}) for t in TORQUES.values() if t.over == over]
    return [(torque, numbers) for torque, numbers in found if numbers[torque.size]]


def _over_angle(get: _Parameters, k: int, n: float, start_angle: float) -> tuple[Curve | None, float, float]:
    """A torque by the wheel's angle as one period of a unit's table: N·m at the shaft over rad, periods a radian of the
    shaft, and where a run begins, rad.

    Raises
    ------
    InputError : more than one of them.
    """
    present = _present(get, k, ANGLE)
    if not present:
        return None, 0.0, 0.0
    if len(present) > 1:
        names = ", ".join(torque.size for torque, _ in present)
        raise InputError(f"{names}: a motor unit holds one torque that repeats with the angle")
    torque, numbers = present[0]
    cycles = numbers[torque.cycles]
    start = (cycles * start_angle + (numbers[torque.phase] if torque.phase else 0.0)) % (2.0 * math.pi)
    one = {**numbers, torque.size: numbers[torque.size] / n, torque.cycles: 1.0}
    if torque.phase:
        one[torque.phase] = 0.0
    x = np.linspace(0.0, 2.0 * math.pi, RIPPLE_POINTS)
    curve = Curve(tuple(x), tuple(torque.at(angle, one, math.sin) for angle in x.tolist()))
    return curve, cycles / (2.0 * math.pi * n), start


def _over_speed(get: _Parameters, k: int, n: float) -> Curve | None:
    """Torque against the shaft's speed as a unit takes it, N·m that brakes: friction by direction, laws by speed."""
    fluid, fast = get("asymmetry_viscous", k) / n**2, n * FAST_RAD_S
    present = _present(get, k, SPEED)
    if not present:
        return Curve((-fast, 0.0, fast), (fluid * fast, 0.0, fluid * fast)) if fluid else None
    x = np.linspace(-fast, fast, SPEED_POINTS).tolist()
    drives = (sum(torque.at(speed / n, numbers, math.sin) for torque, numbers in present) / n for speed in x)
    return Curve(tuple(x), tuple(fluid * abs(speed) - drive for speed, drive in zip(x, drives, strict=True)))


def places_of(effect: Effect, robot: Robot) -> set[str]:
    """Where an effect's numbers go, of `PLACES`: what its `apply` changes in the nominal model."""
    return {PLACES[name] for name in effect.written(robot)}
