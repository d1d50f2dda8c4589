"""WPILib SysId: its JSON files of up to four tests, each a table.

Format: wpilibsuite/sysid, docs/data-collection.md. A test of a drivetrain has rows of time, voltages, positions,
velocities (left, right), angle and its rate; any other mechanism's of time, voltage, position and velocity. Positions
are to be in turns of the output, whatever `units` says; not every team's code does so, and the angle's unit is said
nowhere. Both are found out here by what the nominal motor and the wheels say, or asked for.

Its forerunner, frc-characterization, has the same tests with other rows: time, battery, autospeed, voltages, positions,
velocities and the gyro's angle of a drivetrain; time, battery, autospeed, voltage, position and velocity of any other
mechanism (its robot projects, `numberArray`). It has no rate of the angle, which then stays empty.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np

from rtds_host.contract import Robot
from rtds_host.contract.inputs import regular_bytes
from rtds_host.errors import InputError
from rtds_host.importers.mapping import Mapping
from rtds_host.importers.table import Table

# A value that a row of frc-characterization does not hold.
ABSENT = math.nan
TESTS = ("slow-forward", "slow-backward", "fast-forward", "fast-backward")
DRIVETRAIN = (
    "timestamp",
    "l voltage",
    "r voltage",
    "l position",
    "r position",
    "l velocity",
    "r velocity",
    "angle",
    "angular rate",
)
SIMPLE = ("timestamp", "voltage", "position", "velocity")
# Columns of a row of frc-characterization that a row of SysId has, in that order, by the length of the row.
FORERUNNER = {10: (0, 3, 4, 5, 6, 7, 8, 9), 6: (0, 3, 4, 5)}
# Units of `units`, as turns of a wheel of circumference c.
LENGTHS_M = {"Meters": 1.0, "Feet": 0.3048, "Inches": 0.0254}
TURNS = {"Rotations": 1.0, "Radians": 1.0 / (2.0 * math.pi), "Degrees": 1.0 / 360.0}
FITS, MOVING = 0.35, 0.3


def is_sysid(path: Path) -> bool:
    """Whether a path is a JSON file, which only SysId writes."""
    return path.suffix == ".json"


def read_sysid(path: Path) -> dict:
    """A checked file: the tests that hold rows, "test" and "units".

    Raises
    ------
    InputError : unreadable, no SysId data, no test with rows, a row of another length, a value that is no number.
    """
    try:
        data = json.loads(regular_bytes(path))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not JSON ({error})") from error
    if not isinstance(data, dict) or not any(name in data for name in TESTS):
        raise InputError(f"{path}: is not a SysId file: none of {', '.join(TESTS)} is there")
    data = _as_sysid(data)
    kind = data.get("test", "")
    if not isinstance(kind, str) or not isinstance(data.get("units", ""), str):
        raise InputError(f"{path}: test and units must be texts")
    columns = columns_of(kind)
    for name in TESTS:
        rows = data.get(name, [])
        if not isinstance(rows, list):
            raise InputError(f"{path}: {name} is not a list of rows")
        for number, row in enumerate(rows, start=1):
            if not isinstance(row, list) or len(row) != len(columns):
                raise InputError(
                    f"{path}: {name}, row {number}: {len(columns)} numbers are needed ({', '.join(columns)}), test "
                    f"is {kind!r}"
                )
            for value in row:
                if value is ABSENT:
                    continue
                if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                    raise InputError(f"{path}: {name}, row {number}: {str(value)[:20]} is not a finite number")
    if not tests_in(data):
        raise InputError(f"{path}: no test has as many as two rows")
    return data


def _as_sysid(data: dict) -> dict:
    """A file of frc-characterization with the rows that SysId would have written; any other as it is."""
    rows = [row for name in TESTS if isinstance(data.get(name), list) for row in data[name]]
    lengths = {len(row) if isinstance(row, list) else 0 for row in rows}
    if data.get("sysid") or len(lengths) != 1 or not lengths <= FORERUNNER.keys():
        return data
    (length,) = lengths
    drivetrain, columns = length == max(FORERUNNER), FORERUNNER[length]
    absent = [ABSENT] * (len(DRIVETRAIN) - len(columns)) if drivetrain else []
    tests = {name: [[row[k] for k in columns] + absent for row in data[name]] for name in TESTS if name in data}
    return {**data, **tests, "test": "Drivetrain" if drivetrain else "Simple"}


def columns_of(kind: str) -> tuple[str, ...]:
    """Columns of a row, by the file's "test"."""
    return DRIVETRAIN if kind.startswith("Drivetrain") else SIMPLE


def tests_in(data: dict) -> list[str]:
    """Names of the tests that were made."""
    return [name for name in TESTS if len(data.get(name, [])) >= 2]


def test_of(path: Path) -> str:
    """What kind of mechanism a file is of."""
    return read_sysid(path).get("test", "")


class SysIdTable(Table):
    """One test of a SysId file as a table.

    Raises
    ------
    InputError : as `read_sysid`, and a time that is missing or goes back.
    """

    def __init__(self, path: Path, mapping: Mapping, test: str):
        self.path, self.mapping, self.notices = path, mapping, []
        data = read_sysid(path)
        self.names = list(columns_of(data.get("test", "")))
        self.rows = [
            (number, ["" if value is ABSENT else repr(float(value)) for value in row])
            for number, row in enumerate(data[test], start=1)
        ]
        self._set_clock()


def check_units(path: Path, robot: Robot) -> list[str]:
    """What speaks against positions in turns of the output; and which unit they seem to be in.

    At a slowly rising voltage a motor's speed is V / (N Kb), near enough: in turns, metres, feet and inches of the same
    wheel that is another number each.
    """
    data = read_sysid(path)
    columns = columns_of(data.get("test", ""))
    sides = (
        [("l voltage", "l velocity"), ("r voltage", "r velocity")]
        if columns is DRIVETRAIN
        else [("voltage", "velocity")]
    )
    ratios = []
    motor = robot.motor
    for name in tests_in(data):
        if not name.startswith("slow"):
            continue
        rows = np.array(data[name], dtype=float)
        for volts, speed in sides:
            v, w = np.abs(rows[:, columns.index(volts)]), np.abs(rows[:, columns.index(speed)])
            fast = w > MOVING * w.max()
            if fast.sum() >= 2 and w.max() > 0:
                # Slopes: friction takes a constant part of the voltage.
                ratios.append(np.polyfit(v[fast], w[fast], 1)[0] if np.ptp(v[fast]) > 0 else math.nan)
    ratios = [r for r in ratios if math.isfinite(r) and r > 0]
    if not ratios:
        return [f"{path.name}: there is no slow test, so nothing says whether positions are in turns"]
    expected = 1.0 / (
        2.0
        * math.pi
        * motor.gear_ratio
        * (
            motor.back_emf_constant_v_s_per_rad
            + motor.resistance_ohm * motor.viscous_friction_nm_s_per_rad / motor.torque_constant_nm_per_a
        )
    )
    found = float(np.median(ratios)) / expected
    factors = {unit: 1.0 / turns for unit, turns in TURNS.items()}
    if robot.chassis is not None:
        round_m = 2.0 * math.pi * robot.chassis.wheel_radius_m
        factors |= {unit: round_m / metres for unit, metres in LENGTHS_M.items()}
    best = min(factors, key=lambda unit: abs(math.log(found / factors[unit])))
    if best == "Rotations" and abs(math.log(found)) < FITS:
        return []
    hint = f": is it in {best.lower()}?" if abs(math.log(found / factors[best])) < FITS else ""
    return [f"{path.name}: the velocity is {found:.3g} times what turns of the wheel would be at these voltages{hint}"]


def angle_is_told(path: Path, robot: Robot) -> bool:
    """Whether the robot turned enough for its wheels to tell radians from degrees."""
    data = read_sysid(path)
    if columns_of(data.get("test", "")) is not DRIVETRAIN or robot.chassis is None:
        return True
    for name in tests_in(data):
        rows = np.array(data[name], dtype=float)
        left, right = rows[:, 5], rows[:, 6]
        if np.abs(right - left).max() > MOVING * np.abs(rows[:, 5:7]).max():
            return True
    return False
