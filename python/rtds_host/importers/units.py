"""Units a log may come in, and their factor to the contract's SI units."""

from __future__ import annotations

import math

from rtds_host.contract import Robot
from rtds_host.errors import InputError

# Column of the contract -> kind of quantity.
QUANTITY = {
    "v_cmd_l": "voltage",
    "v_cmd_r": "voltage",
    "v_bus": "voltage",
    "i_l": "current",
    "i_r": "current",
    "w_cmd_l": "speed",
    "w_cmd_r": "speed",
    "w_ref_l": "speed",
    "w_ref_r": "speed",
    "w_l": "speed",
    "w_r": "speed",
    "th_l": "angle",
    "th_r": "angle",
    "gyro_z": "rate",
    "x": "length",
    "y": "length",
    "yaw": "heading",
}
TURN = 2.0 * math.pi
RPM = TURN / 60.0
DEGREE = math.pi / 180.0

_RATES = {"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": DEGREE, "rpm": RPM, "rev/s": TURN}
_ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": DEGREE, "rev": TURN}
FIXED = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "voltage": {"V": 1.0, "mV": 1e-3},
    "current": {"A": 1.0, "mA": 1e-3, "uA": 1e-6},
    "speed": _RATES,
    "rate": _RATES,
    "angle": _ANGLES,
    "heading": _ANGLES,
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
}
# Units whose factor depends on the robot or on a key of the mapping.
RELATIVE = {
    "voltage": ("duty", "%", "pwm", "N*m"),
    "speed": ("m/s", "mm/s", "counts/s"),
    "angle": ("m", "mm", "counts"),
}


def known_units(quantity: str) -> tuple[str, ...]:
    """Names of the units a quantity may be given in, the SI unit first."""
    return (*FIXED[quantity], *RELATIVE.get(quantity, ()))


def factor(
    place: str,
    quantity: str,
    unit: str,
    robot: Robot,
    full_scale: float | None = None,
    counts_per_rev: float | None = None,
    wheel_radius_m: float | None = None,
    shaft: str = "wheel",
) -> float:
    """Factor that turns a raw number into the contract's unit of `quantity`.

    Parameters
    ----------
    place : file and key, for the message of an error.
    full_scale : counts of a PWM register at full duty (`pwm`).
    counts_per_rev : encoder counts a turn of `shaft` (`counts`, `counts/s`).
    wheel_radius_m : radius that the recorder assumed for a speed or a way at the rim; the robot's if None.
    shaft : "motor" where the value was measured before the gear, else "wheel".

    Raises
    ------
    InputError : a unit that does not exist for this quantity, or one whose key is missing.
    """

    def needs(key: str) -> InputError:
        return InputError(f"{place}: unit {unit!r} needs {key}")

    if unit in FIXED[quantity]:
        value = FIXED[quantity][unit]
    elif unit not in RELATIVE.get(quantity, ()):
        raise InputError(
            f"{place}: unit {unit!r} is not a unit of {quantity}, use one of {', '.join(known_units(quantity))}"
        )
    elif unit in ("duty", "%", "pwm"):
        top = {"duty": 1.0, "%": 100.0, "pwm": full_scale}[unit]
        if top is None:
            raise needs("full_scale (counts at full duty)")
        value = robot.supply_v / top
    elif unit == "N*m":
        if robot.driver.mode != "torque":
            raise InputError(f"{place}: unit 'N*m' needs a robot whose [driver] mode is \"torque\"")
        value = 1.0 / robot.driver.torque_nm_per_v
    elif unit in ("counts", "counts/s"):
        if counts_per_rev is None:
            raise needs("counts_per_rev")
        value = TURN / counts_per_rev
    else:
        radius = wheel_radius_m
        if radius is None and robot.chassis is not None:
            radius = robot.chassis.wheel_radius_m
        if radius is None:
            raise needs("wheel_radius_m")
        value = (1e-3 if unit.startswith("mm") else 1.0) / radius
    if shaft == "motor":
        if quantity not in ("speed", "angle"):
            raise InputError(f'{place}: shaft = "motor" has a meaning for a wheel\'s speed or angle only')
        value /= robot.motor.gear_ratio
    return value
