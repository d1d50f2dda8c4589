"""From effects to the words that the effect unit and its model take, and what these cannot hold exactly.

A table has 256 cells of equal width, each a straight line (slope and intercept, binary32); the grid runs through zero.
The width is chosen so that the points of a curve fall on the grid wherever they can; a jump that cannot is moved to the
nearest line of the grid. `EffectWords.deviations` says by how much a table misses its curve.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rtds_host.errors import InputError
from rtds_host.motor.effect_program import CELLS, CONSTANTS, REGISTERS, SIDES, TABLE_ORIGIN, TABLES
from rtds_host.motor.effects import FULL_TURN, Curve, MotorParameters, SupplyEffects, UnitEffects
from rtds_host.vectors import Vector

SIDE_NAMES = ("left", "right")
DELAY_ENTRIES = 4096
MAX_STRIDE = 65535
TABLE_WORDS = SIDES * 8 * CELLS * 2  # addresses of the table memory; the constants follow
# A point counts as on the grid when it misses it by less than this part of a cell: rounding of decimal fractions.
_ON_GRID = 1e-6
_PROBES = 9  # points a cell at which a table is compared with its curve


@dataclass(frozen=True)
class Deviation:
    """By how much a table misses its curve.

    Attributes
    ----------
    side, table : which.
    value : largest difference, in the unit of y, away from jumps that were moved.
    shift : farthest that a jump was moved, in the unit of x.
    cell : width of a cell, in the unit of x.
    """

    side: str
    table: str
    value: float
    shift: float
    cell: float


@dataclass(frozen=True)
class EffectWords:
    """Everything the effect unit is loaded with.

    Attributes
    ----------
    on : the unit runs; without it the ideal motor unit is what it was.
    constants : (2, len(CONSTANTS)) float32; tables : (2, len(TABLES), 256, 2) float32, {intercept, slope}.
    cells : (2, len(TABLES)) bool: the table is more than one line.
    delay, stride : the command is late by so many entries of so many steps, beyond the one step of the unit.
    motors : this side's own parameters or None, left and right.
    deviations : of the tables that hold more than one line; delay_error_s : by how much the delay misses, s.
    """

    on: bool
    constants: np.ndarray
    tables: np.ndarray
    cells: np.ndarray
    delay: int
    stride: int
    motors: tuple[MotorParameters | None, MotorParameters | None]
    deviations: tuple[Deviation, ...]
    delay_error_s: float

    def side_values(self, parameters: Vector) -> np.ndarray:
        """(2, 7) the parameters of [left, right], SI: the sides' own, or those of `set_parameters`; the step is
        shared.
        """
        shared = [float(value) for value in parameters]
        return np.array([(*motor.values, shared[6]) if motor else shared for motor in self.motors])

    @property
    def own(self) -> bool:
        """A side has a motor of its own."""
        return self.motors != (None, None)

    @property
    def ideal(self) -> bool:
        """Nothing differs from two ideal motor units with the parameters of `set_parameters`."""
        return not (self.on or self.own)

    def writes(self) -> Iterator[tuple[int, int]]:
        """(address, word) of everything to load through the register port, in ascending addresses by block."""
        for side in range(SIDES):
            for table, name in enumerate(TABLES):
                used = range(CELLS) if self.cells[side, table] else [TABLE_ORIGIN[name]]
                for cell in used:
                    for word in range(2):
                        yield (
                            table_address(side, table, cell, word),
                            int(self.tables[side, table, cell, word].view(np.uint32)),
                        )
        for side in range(SIDES):
            for k in range(len(CONSTANTS)):
                yield constant_address(side, k), int(self.constants[side, k].view(np.uint32))


def table_address(side: int, table: int, cell: int, word: int) -> int:
    """Address at the register port of a table's word (0 intercept, 1 slope)."""
    return ((side * 8 + table) * CELLS + cell) * 2 + word


def constant_address(side: int, constant: int) -> int:
    """Address at the register port of a constant."""
    return TABLE_WORDS + side * REGISTERS + constant


def tables_of(
    left: UnitEffects | None,
    right: UnitEffects | None,
    supply: SupplyEffects | None,
    parameters: Vector,
) -> EffectWords:
    """Compile effects for motors and a step.

    Parameters
    ----------
    left, right, supply : None is absent.
    parameters : (7,) R, L, Km, Kb, J, B, step of `set_parameters`, SI: what a side without a motor of its own has.

    Raises
    ------
    InputError : names the side and the effect that the unit cannot hold.
    """
    units = (left or UnitEffects(), right or UnitEffects())
    supply = supply or SupplyEffects()
    step_s = float(parameters[6])
    motors = (units[0].motor, units[1].motor)
    on = not supply.absent or not all(unit.plain for unit in units)
    constants = np.zeros((SIDES, len(CONSTANTS)), np.float64)
    tables = np.zeros((SIDES, len(TABLES), CELLS, 2), np.float32)
    cells = np.zeros((SIDES, len(TABLES)), bool)
    deviations = []
    for side, unit in enumerate(units):
        resistance = unit.motor.resistance_ohm if unit.motor else float(parameters[0])
        try:
            curves = _curves(unit, resistance)
            for table, name in enumerate(TABLES):
                with np.errstate(over="ignore", invalid="ignore"):  # found below
                    k, tables[side, table], deviation = _table(curves[name], name)
                constants[side, CONSTANTS.index(f"{name}_k")] = -k if name == "backward" else k
                if deviation is not None:
                    cells[side, table] = True
                    deviations.append(Deviation(SIDE_NAMES[side], name, *deviation))
            constants[side, len(TABLES) :] = _numbers(unit, supply, step_s)
        except InputError as error:
            raise InputError(f"{SIDE_NAMES[side]}: {error}") from None
    with np.errstate(over="ignore"):
        words = constants.astype(np.float32)
    finite = np.isfinite(words)
    finite[:, CONSTANTS.index("limit")] = True
    if not finite.all() or not np.isfinite(tables).all():
        side = 0 if not finite[0].all() or not np.isfinite(tables[0]).all() else 1
        raise InputError(f"{SIDE_NAMES[side]}: effects: a number is beyond single precision")
    delay, stride, delay_error = _delay(supply.command_delay_s, step_s)
    return EffectWords(on, words, tables, cells, delay, stride, motors, tuple(deviations), delay_error)


def _numbers(unit: UnitEffects, supply: SupplyEffects, step_s: float) -> list[float]:
    """The constants after those of the tables, in their order."""
    volts = supply.voltage_v
    heat_out = step_s / unit.heat_tau_s
    if heat_out >= 1.0:
        raise InputError(f"heat_tau_s: {unit.heat_tau_s:g} s is not longer than a step of {step_s:g} s")
    return [
        supply.source_resistance_ohm / (volts * volts),
        supply.decline_v_per_s / volts * step_s,
        1.0,
        unit.limit_v,
        unit.heat_rise_per_w * heat_out,
        heat_out,
        unit.ripple_periods_per_rad * step_s if unit.ripple else 0.0,
        unit.load_share / (1.0 - unit.load_share),
        -unit.load_share,
    ]


def _delay(delay_s: float, step_s: float) -> tuple[int, int, float]:
    """(entries, steps an entry, error in s) of a delay; one step of it is the unit's own register."""
    wanted = delay_s / step_s
    steps = round(wanted)
    if abs(wanted - steps) > 1e-6 * max(1.0, wanted):
        raise InputError(f"command_delay_s: {delay_s:g} s is not a whole number of simulation steps of {step_s:g} s")
    beyond = max(steps - 1, 0)
    stride = max(1, -(-beyond // (DELAY_ENTRIES - 1)))
    if stride > MAX_STRIDE:
        most = MAX_STRIDE * (DELAY_ENTRIES - 1) * step_s
        raise InputError(f"command_delay_s: {delay_s:g} s is more than the delay line's {most:g} s")
    # A command that changes anywhere within an entry waits half an entry for the next one, on average.
    entries = max(0, round((beyond - 0.5 * (stride - 1)) / stride))
    error = 0.0 if stride == 1 else (abs(entries * stride + 0.5 * (stride - 1) - beyond) + 0.5 * (stride - 1)) * step_s
    return entries, stride, error if steps else step_s


def _curves(unit: UnitEffects, resistance: float) -> dict[str, Curve | None]:
    """The curve of each table, in the tables' own arguments."""
    ripple = None
    if unit.ripple is not None:
        ripple = _turned(unit.ripple, unit.ripple_start_rad)
    backward = unit.friction_backward
    return {
        "command": unit.command,
        "drop": None if unit.drop is None else _against_driving(unit.drop, resistance),
        "torque": unit.torque,
        "ripple": ripple,
        "forward": unit.friction_forward,
        "backward": backward,
    }


def _against_driving(drop: Curve, resistance: float) -> Curve:
    """Drop over the voltage u = V - Kb w that drives current through resistance and drop: u = R i + drop(i).

    A jump of the drop at no current becomes the stretch of u that drives none.
    """
    u = [resistance * x + y for x, y in zip(drop.x, drop.y, strict=True)]
    for k in range(1, len(u)):
        if u[k] < u[k - 1]:
            raise InputError(
                f"drop: it falls from {drop.y[k - 1]:g} V at {drop.x[k - 1]:g} A to {drop.y[k]:g} V at {drop.x[k]:g} A,"
                f" faster than the voltage across {resistance:g} ohm rises"
            )
    return Curve(tuple(u), drop.y)


def _turned(ripple: Curve, start: float) -> Curve:
    """The ripple over a period from 0 to 1, from the angle at which a run begins; closed, whatever its ends."""
    points = sorted({0.0, 1.0, *(_fraction((x - start) / FULL_TURN) for x in ripple.x if x < FULL_TURN)})
    if start == 0.0:
        return Curve(tuple(min(x / FULL_TURN, 1.0) for x in ripple.x), ripple.y)
    xs, ys = [], []
    largest = max(map(abs, ripple.y))
    for p in points:
        angle = p * FULL_TURN + start
        angle -= FULL_TURN * math.floor(angle / FULL_TURN)
        near = min((*ripple.x, 0.0), key=lambda x: abs(x - angle))
        angle = near if abs(near - angle) < 1e-9 else angle
        below = ripple.before(angle) if angle > 0.0 else ripple.before(FULL_TURN)
        above = ripple.at(angle)
        if p > 0.0:
            xs.append(p)
            ys.append(below)
        if p < 1.0 and (p == 0.0 or abs(above - below) > _ON_GRID * largest):
            xs.append(p)
            ys.append(above)
    return Curve(tuple(xs), tuple(ys))


def _fraction(x: float) -> float:
    return x - math.floor(x)


def _table(curve: Curve | None, name: str) -> tuple[float, np.ndarray, tuple[float, float, float] | None]:
    """(cells a unit of x, (256, 2) words, (value, shift, width) or None when one line is all) of a curve."""
    words = np.zeros((CELLS, 2), np.float32)
    origin = TABLE_ORIGIN[name]
    if curve is None:
        words[:, 1] = 1.0 if name == "command" else 0.0
        return 0.0, words, None
    if len(set(curve.y)) == 1:
        words[:, 0] = curve.y[0]
        return 0.0, words, None
    reach = max(abs(x) for x in curve.x)
    if reach == 0.0:
        reach = 1.0  # nothing but a jump at zero
    width, exact = _width(curve, reach, CELLS - 1 - origin)
    moved, shift = (curve, 0.0) if exact else _jumps_on_grid(curve, width)
    first, last = -origin, CELLS - 1 - origin
    lowest = moved.before(first * width) if origin > 1 else moved.at(0.0)
    words[0] = lowest, 0.0
    words[CELLS - 1] = moved.at(last * width), 0.0
    for cell in range(first + 1, last):
        words[cell + origin] = _line(moved, cell * width, (cell + 1) * width)
    if name == "backward":
        words[:, 1] = -words[:, 1]  # looked up with the speed itself, which is negative there
    value = _misses(moved, words, width, origin, -1.0 if name == "backward" else 1.0)
    return 1.0 / width, words, (value, shift, width)


def _width(curve: Curve, reach: float, most: int) -> tuple[float, bool]:
    """Width of a cell, and whether every point falls on the grid: `reach` in as many cells as fit, at most `most`."""
    points = np.array(curve.x)
    best = (math.inf, reach / (most - 1))
    for n in range(most - 1, 0, -1):
        miss = np.abs(points / (reach / n) - np.round(points / (reach / n))).max()
        if miss < _ON_GRID:
            return reach / n, True
        if n > most // 2:
            best = min(best, (float(miss), reach / n))
    return best[1], False


def _jumps_on_grid(curve: Curve, width: float) -> tuple[Curve, float]:
    """The curve with each jump moved to the nearest line of the grid, and the farthest move."""
    x = np.array(curve.x)
    jump = np.zeros(len(x), bool)
    jump[1:] |= x[1:] == x[:-1]
    jump[:-1] |= x[1:] == x[:-1]
    to = np.where(jump, np.round(x / width) * width, x)
    if not jump.any():
        return curve, 0.0
    # A point may not overtake a jump that moved towards it; where three meet the middle ones are left out.
    for k in np.flatnonzero(jump):
        to[:k] = np.minimum(to[:k], to[k])
        to[k:] = np.maximum(to[k:], to[k])
    keep = [k for k in range(len(to)) if not (0 < k < len(to) - 1 and to[k - 1] == to[k] == to[k + 1])]
    shift = float(np.abs(to - x)[jump].max())
    return Curve(tuple(to[keep]), tuple(np.array(curve.y)[keep])), shift


def _line(curve: Curve, start: float, end: float) -> tuple[float, float]:
    """(intercept, slope) of a cell, rounded so that the line passes the middle of the cell as it should."""
    a, b = curve.at(start), curve.before(end)
    slope = (b - a) / (end - start)
    through_zero = abs(a - slope * start) <= 1e-12 * (abs(a) + abs(b))
    rounded = float(np.float32(slope))
    middle = 0.5 * (start + end)
    return (0.0 if through_zero else 0.5 * (a + b) - rounded * middle), rounded


def _misses(curve: Curve, words: np.ndarray, width: float, origin: int, sign: float) -> float:
    """Largest difference between the words' lines, as the unit computes them, and the curve."""
    worst = 0.0
    for cell in range(1, CELLS - 1):
        at = (cell - origin + np.linspace(0.0, 1.0, _PROBES + 2)[1:-1]) * width
        x = (sign * at).astype(np.float32)
        got = words[cell, 1] * x + words[cell, 0]
        want = np.array([curve.at(value) for value in at])
        worst = max(worst, float(np.abs(got.astype(np.float64) - want).max()))
    return worst
