"""A commented `robot.toml` from the figures of a shop page, each with the tolerance of the way it was had.

At the gear's output, with speed w, current i and supply V, a motor without gear loss obeys V = R i + K w and K i =
torque. At a standstill R = V / i_stall; without load K = (V - R i_0) / w_0, and what i_0 drives is friction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rtds_host.contract.robot import LONGEST_NAME
from rtds_host.errors import InputError, did_you_mean, shown, visible

ENCODERS = ("motor", "gear", "wheel")
RPM = 2.0 * math.pi / 60.0
# What no shop page says. Brushed motors of this size: L / R of a fifth of a millisecond, R J / K^2 of twenty.
ELECTRICAL_S, MECHANICAL_S = 0.2e-3, 20e-3
# A body whose mass lies about the axle, (0.32 b)^2 m; a wheel of 3 % of the mass, a disc; a centre of mass above it.
GYRATION, WHEEL_SHARE, HEIGHT_RADII = 0.32, 0.03, 1.7
# s between two samples that a speed is taken over.
SAMPLE_S = 0.02
# Relative standard deviations by how a value was had: given, worked out from given ones, assumed.
GIVEN, WORKED_OUT, ASSUMED = 0.03, 0.1, 0.5


@dataclass(frozen=True)
class Sheet:
    """Figures of a gear motor at its gear's output and of the robot that two of them drive. SI, but for rpm.

    `stall_torque_nm` None: not given. `counts` a turn of what the encoder sits on (`encoder`), all edges counted.
    """

    name: str
    voltage_v: float
    stall_current_a: float
    no_load_rpm: float
    no_load_current_a: float
    gear_ratio: float
    wheel_radius_m: float
    track_width_m: float
    mass_kg: float
    counts: float
    encoder: str = "motor"
    stall_torque_nm: float | None = None


@dataclass(frozen=True)
class AxisSheet:
    """Figures of a gear motor at its gear's output, as of `Sheet`, and of the load that it alone moves.

    `kind`: one of `LOADS`, which says what of the load it needs; the others are None. `travel_m` a turn of the output.
    """

    name: str
    kind: str
    voltage_v: float
    stall_current_a: float
    no_load_rpm: float
    no_load_current_a: float
    gear_ratio: float
    counts: float
    encoder: str = "motor"
    stall_torque_nm: float | None = None
    load_inertia_kg_m2: float | None = None
    load_mass_kg: float | None = None
    arm_length_m: float | None = None
    travel_m: float | None = None


# Field of `Sheet` -> what is asked, lowest and highest value.
FIGURES: dict[str, tuple[str, float, float]] = {
    "voltage_v": ("Supply voltage of the motors, V", 0.1, 1e3),
    "stall_current_a": ("Stall current at that voltage, A", 1e-3, 1e4),
    "no_load_rpm": ("No-load speed at the gear's output at that voltage, rpm", 1e-2, 1e5),
    "no_load_current_a": ("No-load current, A", 0.0, 1e3),
    "stall_torque_nm": ("Stall torque at the gear's output, N·m (empty: not given; 1 kg·cm is 0.0981 N·m)", 1e-6, 1e5),
    "gear_ratio": ("Gear ratio, motor turns a turn of the output", 1.0, 1e5),
    "wheel_radius_m": ("Wheel radius, m", 1e-3, 10.0),
    "track_width_m": ("Distance between both wheels' middles, m", 1e-3, 100.0),
    "mass_kg": ("Mass of the whole robot, kg", 1e-3, 1e4),
    "counts": ("Encoder counts a turn of what it sits on, all edges counted", 1.0, 1e8),
}
# Of a load, likewise; and the figures of each kind of load.
LOAD_FIGURES: dict[str, tuple[str, float, float]] = {
    "load_inertia_kg_m2": ("Inertia of the load at the gear's output, kg·m²", 1e-12, 1e6),
    "load_mass_kg": ("Mass at the arm's end, or of the carriage, kg", 1e-6, 1e5),
    "arm_length_m": ("Distance of that mass from the axis, m", 1e-4, 100.0),
    "travel_m": ("Travel of the carriage for one turn of the gear's output, m", 1e-7, 100.0),
}
LOADS = {
    "inertia": ("load_inertia_kg_m2",),
    "pendulum": ("load_mass_kg", "arm_length_m"),
    "linear": ("load_mass_kg", "travel_m"),
}
OF_ROBOT = ("wheel_radius_m", "track_width_m", "mass_kg")


def figures_of(kind: str | None) -> dict[str, tuple[str, float, float]]:
    """What is asked of a robot with two wheels (None), or of a motor with a kind of load.

    Raises
    ------
    InputError : there is no such kind.
    """
    if kind is None:
        return FIGURES
    if kind not in LOADS:
        raise InputError(f"--axis {shown(kind)}: unknown (known: {', '.join(LOADS)}){did_you_mean(kind, LOADS)}")
    motor = {name: asked for name, asked in FIGURES.items() if name not in OF_ROBOT}
    return {**motor, **{name: LOAD_FIGURES[name] for name in LOADS[kind]}}


def check(sheet: Sheet | AxisSheet) -> None:
    """Refuse figures that no motor has.

    Raises
    ------
    InputError : names the figure, and what it must be.
    """
    for name, (_, low, high) in figures_of(sheet.kind if isinstance(sheet, AxisSheet) else None).items():
        value = getattr(sheet, name)
        if value is not None and not low <= value <= high:
            raise InputError(f"{option(name)} {value:g}: it must lie within {low:g} to {high:g}")
    if sheet.encoder not in ENCODERS:
        raise InputError(f"--encoder {sheet.encoder}: unknown (known: {', '.join(ENCODERS)})")
    if sheet.no_load_current_a >= sheet.stall_current_a:
        raise InputError(
            f"--no-load-current {sheet.no_load_current_a:g}: it must be below the stall current, "
            f"{sheet.stall_current_a:g} A"
        )
    if len(sheet.name) > LONGEST_NAME or visible(sheet.name) != sheet.name:
        raise InputError(f"--name {shown(sheet.name)}: one line of at most {LONGEST_NAME} characters is needed")


# Units that end the names of figures and are not in their options.
UNITS = ("_kg_m2", "_v", "_a", "_nm", "_m", "_kg")


def option(name: str) -> str:
    """The option that gives a figure: its name without the unit."""
    unit = next((unit for unit in UNITS if name.endswith(unit)), "")
    return "--" + name.removesuffix(unit).replace("_", "-")


@dataclass(frozen=True)
class Constants:
    """What follows from a sheet, at the motor's shaft, SI."""

    resistance_ohm: float
    inductance_h: float
    constant: float
    inertia_kg_m2: float
    friction_nm_s: float
    angle_noise_rad: float
    gear_loss: float | None


def constants(sheet: Sheet | AxisSheet) -> Constants:
    """Motor constants of a sheet; the equations are this module's. InputError as `check`."""
    check(sheet)
    resistance = sheet.voltage_v / sheet.stall_current_a
    speed = sheet.no_load_rpm * RPM
    output = (sheet.voltage_v - resistance * sheet.no_load_current_a) / speed
    constant = output / sheet.gear_ratio
    loss = None
    if sheet.stall_torque_nm is not None:
        loss = 1.0 - sheet.stall_torque_nm / (output * (sheet.stall_current_a - sheet.no_load_current_a))
    turn = sheet.counts * (sheet.gear_ratio if sheet.encoder == "motor" else 1.0)
    return Constants(
        resistance_ohm=resistance,
        inductance_h=ELECTRICAL_S * resistance,
        constant=constant,
        inertia_kg_m2=MECHANICAL_S * constant**2 / resistance,
        friction_nm_s=constant * sheet.no_load_current_a / (speed * sheet.gear_ratio),
        angle_noise_rad=2.0 * math.pi / turn / math.sqrt(12.0),
        gear_loss=loss,
    )


def _loss(found: Constants) -> str:
    if found.gear_loss is None:
        return "# No stall torque was given: what the gear loses is not known, and a diagnosis may find it."
    if found.gear_loss < -0.1:
        return (
            f"# The stall torque is {-100 * found.gear_loss:.0f} % more than the current can make by the no-load speed:"
            " the sheet's figures do not agree."
        )
    return (
        f"# By the stall torque the gear loses about {100 * max(found.gear_loss, 0.0):.0f} % at a standstill. The"
        " nominal gear is lossless: a diagnosis names it `load_friction`."
    )


def _motor(sheet: Sheet | AxisSheet, found: Constants, what: str) -> str:
    """Head, [motor] and [supply] of a file."""
    given = (
        f"{sheet.voltage_v:g} V, stall {sheet.stall_current_a:g} A"
        + (f" and {sheet.stall_torque_nm:g} N·m" if sheet.stall_torque_nm is not None else "")
        + f", no load {sheet.no_load_rpm:g} rpm and {sheet.no_load_current_a:g} A"
    )
    name = sheet.name.replace("\\", "\\\\").replace('"', '\\"')
    return f"""\
# A nominal {what} made by `rtds init` from a data sheet: {given}.
# SI units. Motor values are at the motor's shaft, before the gear. Put in what you know better.
{_loss(found)}
schema = "rtds-robot/1"
name = "{name}"

[motor]{"                                    # the same for both sides" if isinstance(sheet, Sheet) else ""}
resistance_ohm = {found.resistance_ohm:.5g}                # worked out: voltage / stall current
inductance_h = {found.inductance_h:.3g}                  # assumed: {1e3 * ELECTRICAL_S:g} ms times the resistance
torque_constant_nm_per_a = {found.constant:.5g}     # worked out: from the no-load speed, equal to the next one
back_emf_constant_v_s_per_rad = {found.constant:.5g}
rotor_inertia_kg_m2 = {found.inertia_kg_m2:.3g}           # assumed: settles in {1e3 * MECHANICAL_S:g} ms
viscous_friction_nm_s_per_rad = {found.friction_nm_s:.3g}  # worked out: what the no-load current drives
gear_ratio = {sheet.gear_ratio:.9g}                         # given

[supply]
voltage_v = {sheet.voltage_v:.9g}                          # given
"""


def _sensors(sheet: Sheet | AxisSheet, found: Constants) -> str:
    """What every file says of its sensors."""
    speed_noise = found.angle_noise_rad * math.sqrt(2.0) / SAMPLE_S
    return f"""\
th_rad = {found.angle_noise_rad:.3g}                        # worked out: one count, evenly spread
w_rad_s = {speed_noise:.3g}                       # worked out: two angles {SAMPLE_S:g} s apart
i_a = {0.01 * sheet.stall_current_a:.3g}                             # assumed: 1 % of the stall current
v_bus_v = {0.0025 * sheet.voltage_v:.3g}                            # assumed: 0.25 % of the supply
"""


TOLERANCE_OF_MOTOR = f"""\
[tolerance]                                # one standard deviation, relative
resistance_ohm = {WORKED_OUT:g}
torque_constant_nm_per_a = {WORKED_OUT:g}
back_emf_constant_v_s_per_rad = {WORKED_OUT:g}
inductance_h = {ASSUMED:g}
rotor_inertia_kg_m2 = {ASSUMED:g}
viscous_friction_nm_s_per_rad = {ASSUMED:g}
"""


def robot_text(sheet: Sheet) -> str:
    """The text of `robot.toml` for a sheet. InputError as `check`."""
    found = constants(sheet)
    yaw_inertia = sheet.mass_kg * (GYRATION * sheet.track_width_m) ** 2
    wheel_inertia = 0.5 * WHEEL_SHARE * sheet.mass_kg * sheet.wheel_radius_m**2
    return f"""\
{_motor(sheet, found, "robot")}
[chassis]
mass_kg = {sheet.mass_kg:.9g}                             # given: everything but payload, wheels included
yaw_inertia_kg_m2 = {yaw_inertia:.3g}            # assumed: mass ({GYRATION:g} track)^2
wheel_radius_m = {sheet.wheel_radius_m:.9g}                    # given
wheel_inertia_kg_m2 = {wheel_inertia:.3g}        # assumed: a disc of {100 * WHEEL_SHARE:g} % of the mass
track_width_m = {sheet.track_width_m:.9g}                      # given
com_x_m = 0.0                              # centre of mass: on the middle of the axle
com_y_m = 0.0
com_z_m = {HEIGHT_RADII * sheet.wheel_radius_m:.3g}                            # assumed: for physics engines only

[sensors]                                  # one standard deviation of white noise on a sample
encoder = "{sheet.encoder}"                         # where the encoder sits: motor, gear or wheel
{_sensors(sheet, found)}gyro_rad_s = 0.003                         # assumed
xy_m = 0.001                               # assumed
yaw_rad = 0.002                            # assumed

{TOLERANCE_OF_MOTOR}mass_kg = {GIVEN:g}
yaw_inertia_kg_m2 = {ASSUMED:g}
wheel_inertia_kg_m2 = {ASSUMED:g}
"""


def axis_text(sheet: AxisSheet) -> str:
    """The text of `robot.toml` for a motor with a load of its own (docs/formats.md, section 7). InputError as `check`,
    or where a figure of the load is missing.
    """
    missing = [option(name) for name in LOADS.get(sheet.kind, ()) if getattr(sheet, name) is None]
    if missing:
        raise InputError(f"{', '.join(missing)}: missing for --axis {sheet.kind}")
    found = constants(sheet)
    if sheet.kind == "inertia":
        load = [f"inertia_kg_m2 = {sheet.load_inertia_kg_m2:.9g}    # given, at the gear's output"]
        known = [f"inertia_kg_m2 = {WORKED_OUT:g}"]
    elif sheet.kind == "pendulum":
        load = [
            f"mass_kg = {sheet.load_mass_kg:.9g}           # given: a point at the arm's end",
            f"length_m = {sheet.arm_length_m:.9g}          # given",
            "inertia_kg_m2 = 0.0     # the arm's own, about the axis: put it in where it counts",
            "zero_rad = 0.0          # th_l when it hangs straight down",
        ]
        known = [f"mass_kg = {GIVEN:g}", f"length_m = {GIVEN:g}"]
    else:
        load = [
            f"mass_kg = {sheet.load_mass_kg:.9g}           # given: the carriage with what it carries",
            f"metres_per_rad = {(sheet.travel_m or 0.0) / (2.0 * math.pi):.9g}    # worked out: travel a turn / 2 pi",
        ]
        known = [f"mass_kg = {GIVEN:g}"]
    body = "\n".join([f'kind = "{sheet.kind}"', *load])
    return (
        f"{_motor(sheet, found, 'axis')}\n[axis]                   # what it moves, seen from the gear's output\n"
        f"{body}\n\n[sensors]                                  # one standard deviation of white noise on a sample\n"
        f"{_sensors(sheet, found)}\n{TOLERANCE_OF_MOTOR}" + "\n".join(known) + "\n"
    )
