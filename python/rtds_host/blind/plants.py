"""What can be planted in measured data: a nominal value declared wrongly, or a column altered, and what either looks
like.

A real machine has effects that nobody knows, so a planted change is the only part of its truth that is known. Each
change comes with the effects of the catalogue that are the same thing: `same` makes the same replays (or the nearest
ones the catalogue can make), `alike` those that stand in for it only roughly or on some data; see docs/blind.md.

Where a declared value is k times the former one, the machine is 1/k times what is declared, which is the effect's
ratio. On a load without gravity, a drive that is g times stronger and a speed that is reported g times too large differ
by nothing but the size of the friction torques, which are free: m w' = g T - c sgn w - b w is, for g w, m (g w)' = g (g
T) - ... and so on; `driver_gain` and `speed_gain` are then the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from rtds_host.blind.vocabulary import EFFECTS
from rtds_host.contract import Case, Robot, RunLog

# Sizes: ratios differ from 1 by 8 to 40 %, shifts are 5 to 60 ms, biases 5 to 25 % of the column's own rms.
RATIO_LOG = (0.08, 0.34)
SHIFT_S = (0.005, 0.06)
BIAS_SHARE = (0.05, 0.25)
ROUNDING = 5
# A machine is at rest where its speeds are within so many sigmas of zero.
REST = 3.0


@dataclass(frozen=True)
class Equivalent:
    """An effect that does the same as a plant: `parameter` changes by `low` to `high` (equal but for a nearest effect).

    A ratio multiplies what the undisturbed case was found to have, anything else is added to it.
    """

    effect: str
    parameter: str
    low: float
    high: float

    @property
    def ratio(self) -> bool:
        """Whether sizes multiply."""
        return self.parameter == "ratio"

    def to_json(self) -> dict:
        """As it is in a sealed truth."""
        return {
            "id": self.effect,
            "subsystem": EFFECTS[self.effect][0],
            "parameter": self.parameter,
            "low": float(f"{self.low:.6g}"),
            "high": float(f"{self.high:.6g}"),
        }


@dataclass(frozen=True)
class Plant:
    """One planted change.

    kind : its name; said : one sentence with its size; declared : (section, key) -> value to write into robot.toml;
    alter : changes a run's log (None: nothing); same, alike : equivalents.
    """

    kind: str
    side: str
    said: str
    same: tuple[Equivalent, ...]
    alike: tuple[Equivalent, ...] = ()
    declared: dict[tuple[str, str], float] = field(default_factory=dict)
    alter: Callable[[RunLog], tuple[np.ndarray, dict[str, np.ndarray]]] | None = None


def _exact(effect: str, parameter: str, value: float) -> Equivalent:
    return Equivalent(effect, parameter, value, value)


def _log(rng: np.random.Generator, bounds: tuple[float, float]) -> float:
    return float(math.exp(rng.uniform(math.log(bounds[0]), math.log(bounds[1]))))


def _ratio(rng: np.random.Generator) -> float:
    return math.exp(_log(rng, RATIO_LOG) * (1 if rng.random() < 0.5 else -1))


def _declare(value: float, factor: float) -> float:
    return float(f"{value * factor:.{ROUNDING}g}")


def _rms(case: Case, channel: str) -> float:
    values = np.concatenate([run.columns[channel] for run in case.runs if channel in run.columns])
    return float(np.sqrt(np.nanmean(values**2)))


def _has(case: Case, channel: str) -> bool:
    return all(run.has(channel) for run in case.runs)


def _columns_of(case: Case, names: tuple[str, ...], side: str) -> list[str]:
    sides = [s for s in case.robot.sides if side == "both" or side[0] == s]
    return [f"{name}_{s}" for name in names for s in sides]


def _gain(names: list[str], factor: float) -> Callable[[RunLog], tuple[np.ndarray, dict[str, np.ndarray]]]:
    def alter(run: RunLog) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        return run.t, {c: v * factor if c in names else v for c, v in run.columns.items()}

    return alter


def _bias(names: list[str], offset: float) -> Callable[[RunLog], tuple[np.ndarray, dict[str, np.ndarray]]]:
    def alter(run: RunLog) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        return run.t, {c: v + offset if c in names else v for c, v in run.columns.items()}

    return alter


def shifted(t: np.ndarray, values: np.ndarray, delay_s: float) -> np.ndarray:
    """A channel (n,) as it is reported `delay_s` late, at the same times; empty cells stay empty."""
    good = np.isfinite(values)
    out = np.full(len(t), np.nan)
    if good.any():
        out[good] = np.interp(t[good] - delay_s, t[good], values[good])
    return out


def _at_rest(run: RunLog, robot: Robot) -> bool:
    """Whether a run shows that it begins at rest, by its first speeds."""
    first = {c: run.columns[c][np.isfinite(run.columns[c])][:1] for c in ("w_l", "w_r") if c in run.columns}
    return bool(first) and all(abs(v) <= REST * (robot.noise(c) or 0.0) for c, values in first.items() for v in values)


def _delayed(
    names: list[str], delay_s: float, robot: Robot
) -> Callable[[RunLog], tuple[np.ndarray, dict[str, np.ndarray]]]:
    def alter(run: RunLog) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        # A machine at rest was at rest before. Of one that moves, what was not recorded yet when the log begins cannot
        # be reported: these rows are cut, in all channels.
        keep = np.full(len(run.t), True) if _at_rest(run, robot) else run.t >= run.t[0] + delay_s
        columns = {c: (shifted(run.t, v, delay_s) if c in names else v)[keep] for c, v in run.columns.items()}
        return run.t[keep], columns

    return alter


class _Facts:
    """What of a case decides which changes make sense and what they are the same as."""

    def __init__(self, case: Case):
        robot = self.robot = case.robot
        self.case, self.mode, self.axis = case, robot.driver.mode, robot.axis
        self.kind = robot.axis.kind if robot.axis is not None else "robot"
        self.gravity = self.kind in ("pendulum", "robot")
        self.current = any(_has(case, f"i_{s}") for s in robot.sides)
        self.sides = ("left",) if robot.axis is not None else ("both", "left", "right")

    @property
    def mass_kg(self) -> float:
        """The declared mass of the load."""
        return self.robot.sole_axis.mass_kg if self.axis is not None else self.robot.wheeled.mass_kg

    def load_factor(self, factor: float) -> list[Equivalent]:
        """What a load declared `factor` times too heavy looks like roughly: a weaker or stronger drive."""
        drive = [_exact("driver_gain", "ratio", factor), _exact("speed_gain", "ratio", factor)]
        if self.mode == "voltage" and not self.current:
            drive += [_exact("torque_constant_error", "ratio", factor), _exact("resistance_error", "ratio", 1 / factor)]
        return drive

    def beyond(self, low: float, high: float | None = None) -> list[Equivalent]:
        """Mass (of an inertia: inertia) beyond the declared, and the rotor's where gravity does not tell them apart."""
        high = low if high is None else high
        motor = self.robot.motor
        name = "inertia_kg_m2" if self.kind == "inertia" else "mass_kg"
        same = [Equivalent("payload_error", name, min(low, high), max(low, high))]
        rotor = motor.rotor_inertia_kg_m2 * motor.gear_ratio**2
        if self.kind in ("inertia", "linear") and rotor > 0:
            arm = 1.0 if self.kind == "inertia" else self.robot.sole_axis.metres_per_rad**2
            ratio = 1.0 + low * arm / rotor
            if ratio > 0:
                same.append(_exact("rotor_inertia_error", "ratio", ratio))
        return same

    def drive(self, factor: float) -> tuple[list[Equivalent], list[Equivalent]]:
        """(same, alike) of a drive that is `factor` times what is declared."""
        same = [_exact("driver_gain", "ratio", factor)]
        alike: list[Equivalent] = []
        (alike if self.gravity else same).append(_exact("speed_gain", "ratio", factor))
        if self.mode == "voltage":
            alike.append(_exact("torque_constant_error", "ratio", factor))
            if not self.current:
                alike.append(_exact("resistance_error", "ratio", 1 / factor))
        if self.axis is not None:
            load = self.axis.inertia_kg_m2 if self.kind == "inertia" else self.axis.mass_kg
            alike += self.beyond(load * (1 / factor - 1))[:1]
        return same, alike


def _mass(f: _Facts, rng: np.random.Generator) -> Plant:
    section = "axis" if f.axis is not None else "chassis"
    mass = f.mass_kg
    declared = _declare(mass, _ratio(rng))
    return Plant(
        "mass",
        f.sides[0],
        f"mass declared {declared:g} kg in place of {mass:g} kg",
        tuple(f.beyond(mass - declared)),
        tuple(f.load_factor(declared / mass)),
        {(section, "mass_kg"): declared},
    )


def _inertia(f: _Facts, rng: np.random.Generator) -> Plant:
    inertia = f.robot.sole_axis.inertia_kg_m2
    declared = _declare(inertia, _ratio(rng))
    return Plant(
        "inertia",
        "left",
        f"inertia declared {declared:g} kg m2 in place of {inertia:g} kg m2",
        tuple(f.beyond(inertia - declared)),
        tuple(f.load_factor(declared / inertia)),
        {("axis", "inertia_kg_m2"): declared},
    )


def _length(f: _Facts, rng: np.random.Generator) -> Plant:
    length, mass = f.robot.sole_axis.length_m, f.mass_kg
    declared = _declare(length, _ratio(rng))
    k = declared / length
    # No effect is a wrong arm. The nearest is the mass: 1/k makes gravity's torque right, 1/k^2 the inertia.
    return Plant(
        "length",
        "left",
        f"length declared {declared:g} m in place of {length:g} m",
        tuple(f.beyond(mass * (1 / k - 1), mass * (1 / k**2 - 1))),
        tuple(f.load_factor(k)),
        {("axis", "length_m"): declared},
    )


def _transmission(f: _Facts, rng: np.random.Generator) -> Plant:
    metres, mass = f.robot.sole_axis.metres_per_rad, f.mass_kg
    declared = _declare(metres, _ratio(rng))
    k = declared / metres
    # Nothing but the mass is behind the transmission, so that it is the mass in all respects.
    return Plant(
        "length",
        "left",
        f"travel a radian declared {declared:g} m in place of {metres:g} m",
        tuple(f.beyond(mass * (1 / k**2 - 1))),
        tuple(f.load_factor(k**2)),
        {("axis", "metres_per_rad"): declared},
    )


def _torque_per_volt(f: _Facts, rng: np.random.Generator) -> Plant:
    value = f.robot.driver.torque_nm_per_v
    declared = _declare(value, _ratio(rng))
    same, alike = f.drive(value / declared)
    return Plant(
        "torque constant",
        f.sides[0],
        f"torque a volt declared {declared:g} in place of {value:g} N m/V",
        tuple(same),
        tuple(alike),
        {("driver", "torque_nm_per_v"): declared},
    )


def _torque_constant(f: _Facts, rng: np.random.Generator) -> Plant:
    motor, k = f.robot.motor, _ratio(rng)
    declared = {
        ("motor", key): _declare(getattr(motor, key), k)
        for key in ("torque_constant_nm_per_a", "back_emf_constant_v_s_per_rad")
    }
    alike = [_exact("driver_gain", "ratio", 1 / k), _exact("speed_gain", "ratio", 1 / k)]
    if not f.current:
        alike.append(_exact("resistance_error", "ratio", k))
        if f.axis is not None:
            load = f.axis.inertia_kg_m2 if f.kind == "inertia" else f.axis.mass_kg
            alike += f.beyond(load * (k - 1))[:1]
    return Plant(
        "torque constant",
        f.sides[0],
        f"torque constant and back-EMF declared {k:.4g} times what they were",
        (_exact("torque_constant_error", "ratio", 1 / k),),
        tuple(alike),
        declared,
    )


def _resistance(f: _Facts, rng: np.random.Generator) -> Plant:
    value = f.robot.motor.resistance_ohm
    declared = _declare(value, _ratio(rng))
    ratio = value / declared
    alike = []
    if not f.current:
        alike = [_exact("torque_constant_error", "ratio", 1 / ratio), _exact("driver_gain", "ratio", 1 / ratio)]
        if f.axis is not None:
            load = f.axis.inertia_kg_m2 if f.kind == "inertia" else f.axis.mass_kg
            alike += f.beyond(load * (ratio - 1))[:1]
    return Plant(
        "resistance",
        f.sides[0],
        f"resistance declared {declared:g} ohm in place of {value:g} ohm",
        (_exact("resistance_error", "ratio", ratio),),
        tuple(alike),
        {("motor", "resistance_ohm"): declared},
    )


def _voltage(f: _Facts, rng: np.random.Generator) -> Plant:
    value, k = f.robot.supply_v, _ratio(rng)
    if k < 1 and any(np.nanmax(np.abs(run.commands())) > k * value for run in f.case.runs):
        k = 1 / k  # commands would be clipped, which is another change
    declared = _declare(value, k)
    # V = v_cmd v_bus / voltage_v: declared too high, the replay's voltage is too low.
    same, alike = f.drive(declared / value)
    return Plant(
        "voltage",
        f.sides[0],
        f"supply declared {declared:g} V in place of {value:g} V",
        tuple(same),
        tuple(alike),
        {("supply", "voltage_v"): declared},
    )


def _command_gain(f: _Facts, rng: np.random.Generator) -> Plant:
    side, k = str(rng.choice(f.sides)), _ratio(rng)
    same, alike = f.drive(1 / k)
    return Plant(
        "command gain",
        side,
        f"v_cmd recorded {k:.4g} times what it was",
        tuple(same),
        tuple(alike),
        alter=_gain(_columns_of(f.case, ("v_cmd",), side), k),
    )


def _command_bias(f: _Facts, rng: np.random.Generator) -> Plant:
    volts = _rms(f.case, "v_cmd_l") * _log(rng, BIAS_SHARE) * (1 if rng.random() < 0.5 else -1)
    volts = float(f"{volts:.{ROUNDING}g}")
    motor = f.robot.motor
    per_volt = (
        f.robot.driver.torque_nm_per_v if f.mode == "torque" else motor.torque_constant_nm_per_a / motor.resistance_ohm
    ) * motor.gear_ratio
    # The machine gets less torque than the log says, whichever way it turns.
    return Plant(
        "command bias",
        "left",
        f"v_cmd recorded {volts:+.4g} V off",
        (_exact("friction_asymmetry", "torque_nm", volts * per_volt),),
        alter=_bias(["v_cmd_l"], volts),
    )


def _speed_gain(f: _Facts, rng: np.random.Generator) -> Plant:
    side, k = str(rng.choice(f.sides)), _ratio(rng)
    same = [_exact("speed_gain", "ratio", k)]
    alike: list[Equivalent] = []
    (alike if f.gravity else same).append(_exact("driver_gain", "ratio", k))
    if f.mode == "voltage" and not f.current:
        alike.append(_exact("torque_constant_error", "ratio", 1 / k))
    return Plant(
        "speed gain",
        side,
        f"speed and angle recorded {k:.4g} times what they were",
        tuple(same),
        tuple(alike),
        alter=_gain(_columns_of(f.case, ("w", "th"), side), k),
    )


def _current_gain(f: _Facts, rng: np.random.Generator) -> Plant:
    side, k = str(rng.choice(f.sides)), _ratio(rng)
    return Plant(
        "current gain",
        side,
        f"current recorded {k:.4g} times what it was",
        (_exact("current_gain", "ratio", k),),
        (_exact("torque_constant_error", "ratio", 1 / k),),
        alter=_gain(_columns_of(f.case, ("i",), side), k),
    )


def _current_bias(f: _Facts, rng: np.random.Generator) -> Plant:
    side = str(rng.choice(f.sides))
    names = _columns_of(f.case, ("i",), side)
    offset = float(f"{_rms(f.case, names[0]) * _log(rng, BIAS_SHARE) * (1 if rng.random() < 0.5 else -1):.{ROUNDING}g}")
    return Plant(
        "current bias",
        side,
        f"current recorded {offset:+.4g} A off",
        (_exact("current_bias", "amperes", offset),),
        alter=_bias(names, offset),
    )


def _all_delayed(f: _Facts, rng: np.random.Generator) -> Plant:
    delay = float(f"{_log(rng, SHIFT_S):.4g}")
    names = [f"{c}_{s}" for c in ("i", "w", "th") for s in f.robot.sides] + ["gyro_z"]
    if f.robot.driver.bus == "nominal":
        names.append("v_bus")
    same = [_exact("measurement_delay", "seconds", delay)]
    alike = [_exact("speed_filter", "time_constant_s", delay)]
    (alike if any(_has(f.case, c) for c in ("x", "y", "yaw")) else same).append(
        _exact("command_delay", "seconds", delay)
    )
    return Plant(
        "all delayed",
        "both",
        f"all measured columns {1e3 * delay:.4g} ms late",
        tuple(same),
        tuple(alike),
        alter=_delayed(names, delay, f.robot),
    )


def _speed_delayed(f: _Facts, rng: np.random.Generator) -> Plant:
    delay = float(f"{_log(rng, SHIFT_S):.4g}")
    # The contract's filter has no delay; for motion slower than this one a filter of that time constant does the same.
    return Plant(
        "speed delayed",
        f.sides[0],
        f"speed alone {1e3 * delay:.4g} ms late",
        (_exact("speed_filter", "time_constant_s", delay),),
        (_exact("measurement_delay", "seconds", delay),),
        alter=_delayed([f"w_{s}" for s in f.robot.sides], delay, f.robot),
    )


def kinds(case: Case) -> dict[str, Callable[[np.random.Generator], Plant]]:
    """Changes that make sense for a case: name -> draws one of random size."""
    f = _Facts(case)
    found: list[tuple[str, Callable[[_Facts, np.random.Generator], Plant]]] = []
    if f.kind != "inertia" and f.mass_kg > 0:
        found.append(("mass", _mass))
    if f.kind == "inertia":
        found.append(("inertia", _inertia))
    if f.kind == "pendulum" and f.robot.sole_axis.length_m > 0:
        found.append(("length", _length))
    if f.kind == "linear":
        found.append(("length", _transmission))
    if f.mode == "torque":
        found.append(("torque constant", _torque_per_volt))
    else:
        found += [("torque constant", _torque_constant), ("resistance", _resistance)]
    if f.mode != "speed":
        if f.mode == "voltage" and f.robot.driver.bus == "measured":
            found.append(("voltage", _voltage))
        found.append(("command gain", _command_gain))
        if f.axis is not None and not f.current:
            # A measured current shows that volts are missing and no torque: no effect is both.
            found.append(("command bias", _command_bias))
    if _has(case, "w_l"):
        found.append(("speed gain", _speed_gain))
        if _has(case, "th_l"):
            found.append(("speed delayed", _speed_delayed))
    if f.current:
        found += [("current gain", _current_gain), ("current bias", _current_bias)]
    found.append(("all delayed", _all_delayed))
    return {name: partial(draw, f) for name, draw in found}
