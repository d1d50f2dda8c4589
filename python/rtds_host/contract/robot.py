"""The nominal robot: `robot.toml` of the contract (sections 2 and 7), checked when it is read."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field, fields, replace
from importlib import resources
from pathlib import Path

from rtds_host.contract.inputs import read_toml
from rtds_host.errors import InputError, did_you_mean, listed, shown, visible
from rtds_host.vectors import given

SCHEMA = "rtds-robot/1"
GRAVITY_M_S2 = 9.80665
# Characters of a robot's name; notices of what is ignored, one each.
LONGEST_NAME, MOST_NOTICES = 200, 50
# A loop that is closed more often than this is indistinguishable from one that is closed all the time: no wheel
# answers within a tenth of a millisecond. The replay takes each of its steps.
SHORTEST_PERIOD_S = 1e-4
# Positive values below are no unit of anything: the replay's matrices would be singular.
TINY = 1e-15

# Least and largest value of the constants of a robot, in its file and in a diagnosis that refits them: table -> key ->
# (low, high). They reject slips of unit (mm for m, mH for H), not unusual machines.
BOUNDS: dict[str, dict[str, tuple[float, float]]] = {
    "motor": {
        "resistance_ohm": (TINY, 1e5),
        "inductance_h": (TINY, 100.0),
        "torque_constant_nm_per_a": (TINY, 1e3),
        "back_emf_constant_v_s_per_rad": (TINY, 1e3),
        "rotor_inertia_kg_m2": (0.0, 1e3),
        "viscous_friction_nm_s_per_rad": (0.0, 1e3),
        "gear_ratio": (TINY, 1e5),
    },
    "chassis": {
        "mass_kg": (TINY, 1e4),
        "yaw_inertia_kg_m2": (TINY, 1e5),
        "wheel_radius_m": (TINY, 10.0),
        "wheel_inertia_kg_m2": (0.0, 1e3),
        "track_width_m": (TINY, 100.0),
        "com_x_m": (-10.0, 10.0),
        "com_y_m": (-10.0, 10.0),
    },
    "axis": {
        "inertia_kg_m2": (0.0, 1e6),
        "mass_kg": (0.0, 1e6),
        "length_m": (0.0, 1e3),
        "metres_per_rad": (-1e3, 1e3),
    },
    "servo": {"kp_v_s_per_rad": (0.0, 1e9), "ki_v_per_rad": (0.0, 1e9)},
}

# Gains of [servo] that a file may leave out, to be estimated from the runs (contract, section 7).
SERVO_GAINS = {"kp_v_s_per_rad", "ki_v_per_rad"}

# Numerical: what samples show of a noise is known to this share, that of several thousand samples.
NOISE_STEP = 0.01

# Channel of a log -> key of its noise in [sensors] (contract, section 2).
NOISE_KEYS = {
    "i_l": "i_a",
    "i_r": "i_a",
    "w_l": "w_rad_s",
    "w_r": "w_rad_s",
    "th_l": "th_rad",
    "th_r": "th_rad",
    "gyro_z": "gyro_rad_s",
    "x": "xy_m",
    "y": "xy_m",
    "yaw": "yaw_rad",
    "v_bus": "v_bus_v",
}


@dataclass(frozen=True)
class Motor:
    """One gearmotor, values at the motor shaft, SI. In torque mode the electrical values may be NaN (absent)."""

    resistance_ohm: float
    inductance_h: float
    torque_constant_nm_per_a: float
    back_emf_constant_v_s_per_rad: float
    rotor_inertia_kg_m2: float
    viscous_friction_nm_s_per_rad: float
    gear_ratio: float

    @property
    def constants(self) -> tuple[float, float, float, float, float, float]:
        """R, L, Km, Kb, J and B, in the order of `Link.set_parameters`."""
        return (
            self.resistance_ohm,
            self.inductance_h,
            self.torque_constant_nm_per_a,
            self.back_emf_constant_v_s_per_rad,
            self.rotor_inertia_kg_m2,
            self.viscous_friction_nm_s_per_rad,
        )


@dataclass(frozen=True)
class Chassis:
    """Body and wheels of the planar robot, SI."""

    mass_kg: float
    yaw_inertia_kg_m2: float
    wheel_radius_m: float
    wheel_inertia_kg_m2: float
    track_width_m: float
    com_x_m: float = 0.0
    com_y_m: float = 0.0
    com_z_m: float = 0.0


@dataclass(frozen=True)
class Axis:
    """The declared load of a single-axis case (contract, section 7), SI, seen from the gear's output."""

    kind: str
    inertia_kg_m2: float = 0.0
    mass_kg: float = 0.0
    length_m: float = 0.0
    metres_per_rad: float = 0.0
    zero_rad: float = 0.0


# Where the wheels' encoders can sit: on the motor's shaft, at the gear's output, on the wheel. Free play and springs
# lie beyond the first two and before the third.
ENCODERS = ("motor", "gear", "wheel")


@dataclass(frozen=True)
class Driver:
    """How `v_cmd` (or `w_cmd`) becomes the motor's voltage or torque (contract, section 7)."""

    mode: str = "voltage"
    torque_nm_per_v: float = math.nan
    bus: str = "nominal"


@dataclass(frozen=True)
class Servo:
    """Inner speed loop of `mode = "speed"`: a saturated PI controller on the wheel's speed.

    `left_out` names the gains that the file leaves out: they are then a guess to estimate them from.
    """

    kp_v_s_per_rad: float
    ki_v_per_rad: float
    limit_v: float
    period_s: float
    left_out: frozenset[str] = frozenset()

    @property
    def declared(self) -> bool:
        """Whether the file names both gains."""
        return not self.left_out


@dataclass(frozen=True)
class Robot:
    """A nominal robot or a single axis: exactly one of `chassis` and `axis` is set.

    Two that differ in `name` or in `notices` (what of the file was ignored) alone are equal. `encoder`: where w and th
    are measured, one of `ENCODERS`; None where the file does not say it (contract, section 2).
    """

    name: str = field(compare=False)
    motor: Motor
    supply_v: float
    chassis: Chassis | None
    axis: Axis | None
    driver: Driver
    servo: Servo | None
    sensors: dict[str, float] = field(default_factory=dict)
    notices: tuple[str, ...] = field(default=(), compare=False)
    rounding: dict[str, float] = field(default_factory=dict, compare=False)
    noise_ratio: float = field(default=1.0, compare=False)
    encoder: str | None = None
    tolerance: dict[str, float] = field(default_factory=dict)

    @property
    def wheeled(self) -> Chassis:
        """The chassis of a robot with two wheels; a caller that may meet a single axis asks `chassis`.

        Raises
        ------
        ValueError : a single axis.
        """
        return given(self.chassis, "the chassis of a single axis")

    @property
    def sole_axis(self) -> Axis:
        """The load of a single axis; a caller that may meet a robot with wheels asks `axis`.

        Raises
        ------
        ValueError : a robot with a chassis.
        """
        return given(self.axis, "the single axis of a robot with wheels")

    @property
    def sides(self) -> tuple[str, ...]:
        """Suffixes of the sides that exist: ("l", "r"), or ("l",) for a single axis."""
        return ("l",) if self.axis is not None else ("l", "r")

    def noise(self, channel: str) -> float | None:
        """One standard deviation of white noise on a sample of `channel`, or None where it is not declared.

        Where a log was looked at: the declared one times the ratio that its samples show (`noise_ratio`), and what
        rounding adds to it (`rounding`, by channel, SI), which a file does not declare. Samples do not show a noise
        to more than `NOISE_STEP`, and a search takes another path for a millionth more. So it sees whole steps, which
        are the same whatever digits a file has.
        """
        declared = self.sensors.get(NOISE_KEYS.get(channel, ""))
        if declared is None:
            return None
        shown = declared if self.noise_ratio == 1.0 else _in_steps(self.noise_ratio * declared)
        return math.hypot(shown, self.rounding.get(channel, 0.0))

    @property
    def as_declared(self) -> Robot:
        """The same robot with the noise that is declared, and what rounding adds to it: the unit of a gap."""
        return replace(self, noise_ratio=1.0)

    def known_noise(self, channel: str) -> float:
        """`noise` of a channel that has one, in its unit.

        Raises
        ------
        ValueError : the channel has none.
        """
        return given(self.noise(channel), f"the noise of {channel}")

    def tolerance_of(self, name: str) -> float | None:
        """Relative standard deviation that `[tolerance]` declares for a constant of [motor], [axis] or [chassis], by
        its name; None where it declares none. What it says of `motor` holds for all of [motor] but the gear ratio.
        """
        if name in self.tolerance:
            return self.tolerance[name]
        of_motor = name in {f.name for f in fields(Motor)} and name != "gear_ratio"
        return self.tolerance.get("motor") if of_motor else None


def _in_steps(noise: float) -> float:
    """The nearest whole power of 1 + `NOISE_STEP`; nothing stays nothing."""
    step = math.log1p(NOISE_STEP)
    return math.exp(step * round(math.log(noise) / step)) if noise > 0.0 else noise


class _Section:
    """A table of the file that knows its place, so that each complaint names file, table and key."""

    def __init__(self, path: Path, name: str, table: dict):
        self.path, self.name, self.table = path, name, table

    def fail(self, key: str, what: str) -> InputError:
        return InputError(f"{self.path}: [{self.name}] {key}: {what}")

    def number(
        self,
        key: str,
        default: float | None = None,
        low: float = -math.inf,
        high: float = math.inf,
        positive: bool = False,
    ) -> float:
        if key not in self.table:
            if default is not None:
                return default
            raise self.fail(key, "missing")
        value = self.table[key]
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.fail(key, f"is {shown(value)}, a number is needed")
        try:
            value = float(value)
        except OverflowError:
            value = math.inf
        if not math.isfinite(value):
            raise self.fail(key, f"is {value}, a finite number is needed")
        if positive and value <= 0:
            raise self.fail(key, f"is {value:g}, it must be above 0")
        low = max(low, TINY) if positive else low
        if not low <= value <= high:
            raise self.fail(key, f"is {value:g}, it must lie within {low:g} to {high:g}")
        return value

    def constant(self, key: str, default: float | None = None) -> float:
        """A number within `BOUNDS`."""
        low, high = BOUNDS[self.name][key]
        return self.number(key, default, low, high, positive=low == TINY)

    def choice(self, key: str, allowed: tuple[str, ...], default: str | None = None) -> str:
        value = self.table.get(key, default)
        if value is None:
            raise self.fail(key, "missing")
        if value not in allowed:
            raise self.fail(key, f"is {shown(value)}, it must be one of {', '.join(allowed)}")
        return value


def load_robot(path: str | os.PathLike) -> Robot:
    """Read and check a `robot.toml`.

    Raises
    ------
    InputError : unreadable file, missing key, a value that is no finite number or physically impossible.
    """
    path = Path(path)
    data = read_toml(path)
    return _parse(path, data)


def builtin_robot(name: str) -> Robot:
    """A robot that comes with the package: ``burger`` (the contract's), ``jackal``, ... (`builtin_robots`).

    Raises
    ------
    InputError : no robot of that name.
    """
    return load_robot(builtin_robot_path(name))


def builtin_robot_path(name: str) -> Path:
    """Path of the `robot.toml` of a robot that comes with the package."""
    folder = Path(str(resources.files("rtds_host.contract"))) / "robots"
    path = folder / f"{name}.toml"
    if not path.is_file():
        known = builtin_robots()
        raise InputError(
            f"robot {name!r}: unknown (known: {', '.join(known)}; or give the path of a robot.toml)"
            f"{did_you_mean(name, known)}"
        )
    return path


def builtin_robots() -> tuple[str, ...]:
    """Names of the robots that come with the package: the contract's two, then the others by name."""
    found = {path.stem for path in (Path(str(resources.files("rtds_host.contract"))) / "robots").glob("*.toml")}
    return tuple(
        sorted(found, key=lambda name: (("burger", "paper").index(name) if name in ("burger", "paper") else 2, name))
    )


def _parse(path: Path, data: dict) -> Robot:
    """The robot of a file's tables; of two faults the one that is named is the first in this order.

    Raises
    ------
    InputError : a table or key that is missing, or a value that is not allowed.
    """
    if data.get("schema") != SCHEMA:
        raise InputError(f"{path}: schema: is {shown(data.get('schema'))}, this program reads {SCHEMA!r}")
    name, told = _name(path, data)
    if ("chassis" in data) == ("axis" in data):
        raise InputError(f"{path}: exactly one of [chassis] and [axis] is needed")
    driver = _driver(_optional(path, data, "driver"))
    motor = _motor(_section(path, data, "motor"), driver.mode != "torque", "chassis" in data)
    supply_v = _section(path, data, "supply").number("voltage_v", high=1e4, positive=True)
    chassis = _chassis(_section(path, data, "chassis")) if "chassis" in data else None
    axis = None if "chassis" in data else _axis(_section(path, data, "axis"), motor)
    servo = None
    if driver.mode == "speed":
        servo, more = _servo(_section(path, data, "servo"), motor)
        told += more
    table = _section(path, data, "sensors")
    sensors = {
        key: table.number(key, positive=True, high=1e9)
        for key in sorted(set(NOISE_KEYS.values()))
        if key in table.table
    }
    return Robot(
        name=name,
        motor=motor,
        supply_v=supply_v,
        chassis=chassis,
        axis=axis,
        driver=driver,
        servo=servo,
        sensors=sensors,
        notices=(*told, *_strange(path, data)),
        encoder=table.choice("encoder", ENCODERS) if "encoder" in table.table else None,
        tolerance=_tolerance(_optional(path, data, "tolerance"), Axis if chassis is None else Chassis),
    )


def _section(path: Path, data: dict, name: str) -> _Section:
    """A table of the file.

    Raises
    ------
    InputError : the table is missing, or its name stands for a value.
    """
    table = _optional(path, data, name)
    if table is None:
        raise InputError(f"{path}: [{name}]: missing")
    return table


def _optional(path: Path, data: dict, name: str) -> _Section | None:
    """A table of the file, or None where there is none.

    Raises
    ------
    InputError : its name stands for a value.
    """
    table = data.get(name)
    if table is None:
        return None
    if not isinstance(table, dict):
        raise InputError(f"{path}: [{name}]: is not a table")
    return _Section(path, name, table)


def _driver(table: _Section | None) -> Driver:
    if table is None:
        return Driver()
    mode = table.choice("mode", ("voltage", "torque", "speed"), "voltage")
    driver = Driver(
        mode=mode,
        torque_nm_per_v=table.number("torque_nm_per_v", low=-1e3, high=1e3) if mode == "torque" else math.nan,
        bus=table.choice("bus", ("nominal", "measured"), "nominal"),
    )
    if driver.torque_nm_per_v == 0:
        raise table.fail("torque_nm_per_v", "is 0, no command would do anything")
    return driver


def _motor(table: _Section, electrical: bool, wheeled: bool) -> Motor:
    """The motor's constants; without `electrical` ones where a torque is commanded."""
    absent = None if electrical else math.nan
    motor = Motor(
        resistance_ohm=table.constant("resistance_ohm", absent),
        inductance_h=table.constant("inductance_h", absent),
        torque_constant_nm_per_a=table.constant("torque_constant_nm_per_a", absent),
        back_emf_constant_v_s_per_rad=table.constant("back_emf_constant_v_s_per_rad", absent),
        rotor_inertia_kg_m2=table.constant("rotor_inertia_kg_m2"),
        viscous_friction_nm_s_per_rad=table.constant("viscous_friction_nm_s_per_rad"),
        gear_ratio=table.constant("gear_ratio"),
    )
    if electrical and wheeled and motor.rotor_inertia_kg_m2 <= 0:
        raise table.fail("rotor_inertia_kg_m2", "is 0, it must be above 0 for a robot")
    return motor


def _chassis(table: _Section) -> Chassis:
    """Body and wheels.

    Raises
    ------
    InputError : a key that is missing or not allowed, or less yaw inertia than the mass has where it lies: about the
        axle's mid-point it is m y^2 at least (parallel axes).
    """
    chassis = Chassis(
        mass_kg=table.constant("mass_kg"),
        yaw_inertia_kg_m2=table.constant("yaw_inertia_kg_m2"),
        wheel_radius_m=table.constant("wheel_radius_m"),
        wheel_inertia_kg_m2=table.constant("wheel_inertia_kg_m2"),
        track_width_m=table.constant("track_width_m"),
        com_x_m=table.constant("com_x_m", 0.0),
        com_y_m=table.constant("com_y_m", 0.0),
        com_z_m=table.number("com_z_m", 0.0, low=0, high=10),
    )
    # It holds m x^2, too, but the equations of motion stay regular without it: no file is refused for that.
    least = chassis.mass_kg * chassis.com_y_m**2
    if chassis.yaw_inertia_kg_m2 <= least:
        raise table.fail(
            "com_y_m",
            f"is {chassis.com_y_m:g}, for that yaw_inertia_kg_m2 must be above mass_kg times its square, {least:g}; "
            f"it is {chassis.yaw_inertia_kg_m2:g}",
        )
    return chassis


def _axis(table: _Section, motor: Motor) -> Axis:
    kind = table.choice("kind", ("inertia", "pendulum", "linear"))
    axis = Axis(
        kind=kind,
        inertia_kg_m2=table.constant("inertia_kg_m2", None if kind == "inertia" else 0.0),
        mass_kg=table.constant("mass_kg", None if kind != "inertia" else 0.0),
        length_m=table.constant("length_m", None if kind == "pendulum" else 0.0),
        metres_per_rad=table.constant("metres_per_rad", None if kind == "linear" else 0.0),
        zero_rad=table.number("zero_rad", 0.0, low=-1e6, high=1e6),
    )
    load = {
        "inertia": axis.inertia_kg_m2,
        "pendulum": axis.inertia_kg_m2 + axis.mass_kg * axis.length_m**2,
        "linear": axis.mass_kg * axis.metres_per_rad**2,
    }[kind]
    if load + motor.rotor_inertia_kg_m2 * motor.gear_ratio**2 <= 0:
        raise InputError(f"{table.path}: [axis]: load and rotor have no inertia at all")
    return axis


def _servo(table: _Section, motor: Motor) -> tuple[Servo, tuple[str, ...]]:
    """The speed loop, and what is said of a period that the replay does not take."""
    left_out = frozenset(SERVO_GAINS - table.table.keys())
    # A loop that asks for the whole supply at an error of the no-load speed, and takes a fifth of a second to settle.
    guess = motor.back_emf_constant_v_s_per_rad * motor.gear_ratio
    # A period in other units than seconds would keep the replay busy for ever.
    period = table.number("period_s", positive=True, low=1e-6, high=10.0)
    told: tuple[str, ...] = ()
    if period < SHORTEST_PERIOD_S:
        told = (
            f"{table.path.name}: [servo] period_s is {period:g}, replayed in steps of {SHORTEST_PERIOD_S:g} s: no "
            "wheel shows the difference",
        )
    servo = Servo(
        kp_v_s_per_rad=table.constant("kp_v_s_per_rad", guess),
        ki_v_per_rad=table.constant("ki_v_per_rad", 5.0 * guess),
        limit_v=table.number("limit_v", positive=True, high=1e4),
        period_s=max(period, SHORTEST_PERIOD_S),
        left_out=left_out,
    )
    return servo, told


def _tolerance(table: _Section | None, body: type[Axis | Chassis]) -> dict[str, float]:
    """Relative standard deviations by name, of `[tolerance]`.

    Raises
    ------
    InputError : a name that is no constant of the robot, or a value that is no share of 0 to 1.
    """
    if table is None:
        return {}
    # A height plays no part in the plane, and an angle's zero has no relative error.
    known = ["motor", *(f.name for f in fields(Motor)), *(f.name for f in fields(body))]
    known = [name for name in known if name not in ("kind", "zero_rad", "com_z_m")]
    for name in table.table:
        if name not in known:
            where = "[axis]" if body is Axis else "[chassis]"
            raise table.fail(
                name, f"is not a constant of [motor] or {where} that has a tolerance{did_you_mean(name, known)}"
            )
        value = table.table[name]
        if isinstance(value, (int, float)) and not isinstance(value, bool) and 1.0 < value <= 100.0:
            raise table.fail(
                name, f"is {value:g}, it must lie within 0 to 1 (per cent? {value:g} % is {value / 100:g})"
            )
    return {name: table.number(name, low=0.0, high=1.0) for name in table.table}


def _name(path: Path, data: dict) -> tuple[str, tuple[str, ...]]:
    """The robot's name as it goes into other files, and what is said of one that cannot go there as it is.

    A character that no XML and no terminal takes is spelled out.
    """
    given = data.get("name", path.parent.name or path.stem)
    if isinstance(given, list | dict) or len(str(given)) > LONGEST_NAME:
        raise InputError(f"{path}: name: is {shown(given)}, a text of at most {LONGEST_NAME} characters is needed")
    name = visible(given)
    if name == str(given):
        return name, ()
    return name, (f"{path.name}: name holds characters that cannot be written, it is read as {shown(name)}",)


def _keys(table: object) -> tuple[str, ...]:
    return tuple(table) if isinstance(table, dict) else ()


def _strange(path: Path, data: dict) -> tuple[str, ...]:
    """Notices of tables and keys that the contract does not name: a slip of the pen would pass for a default."""
    known = {
        name: {f.name for f in fields(kind)}
        for name, kind in (("motor", Motor), ("chassis", Chassis), ("axis", Axis), ("driver", Driver), ("servo", Servo))
    }
    known["servo"].discard("left_out")
    known |= {"supply": {"voltage_v"}, "sensors": {"encoder", *NOISE_KEYS.values()}}
    # What is wrong in it ends in an error.
    known["tolerance"] = set(_keys(data.get("tolerance")))
    names = [name for name in data if name not in known and name not in ("schema", "name")]
    keys = [(name, key) for name in known for key in _keys(data.get(name)) if key not in known[name]]
    found = [f"{path.name}: {shown(name)} is not in the format, ignored" for name in names[:MOST_NOTICES]]
    found += [
        f"{path.name}: [{name}] {listed([key])} is not in the format, ignored" for name, key in keys[:MOST_NOTICES]
    ]
    more = max(len(names) - MOST_NOTICES, 0) + max(len(keys) - MOST_NOTICES, 0)
    return tuple(found + ([f"{path.name}: {more} more names are not in the format, ignored"] if more else []))
