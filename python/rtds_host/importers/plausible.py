"""Does a log's unit make sense? Compares channels with the nominal robot and with each other.

A wrong unit is off by a factor of 10 to 1000, no fault of a robot comes near; a suspicion therefore stops an
import unless the user insists. Factors within 3 of 1 are never complained about: they may be what is to be found.
"""

from __future__ import annotations

import math

import numpy as np

from rtds_host.contract import Chassis, Robot
from rtds_host.importers.series import NS, Series
from rtds_host.importers.units import DEGREE, RPM, TURN

WINDOW_S = 0.5
TOLERATED = 3.0
# A live sensor's readings spread by several times its noise; a hundredth of it is another unit.
STILLER = 100.0


def _top(series: Series) -> float:
    return float(np.quantile(np.abs(series.values), 0.99))


def _means(series: Series, edges: np.ndarray) -> np.ndarray:
    """Mean of a speed over each interval between `edges` (s), from its trapezoidal integral."""
    t = series.t_ns / NS
    integral = np.concatenate([[0.0], np.cumsum(np.diff(t) * (series.values[1:] + series.values[:-1]) / 2.0)])
    return np.diff(np.interp(edges, t, integral)) / np.diff(edges)


def _slopes(series: Series, edges: np.ndarray) -> np.ndarray:
    """Mean slope of an angle or a way over each interval between `edges` (s)."""
    return np.diff(np.interp(edges, series.t_ns / NS, series.values)) / np.diff(edges)


def _edges(*several: Series) -> np.ndarray:
    start = max(series.t_ns[0] for series in several) / NS
    end = min(series.t_ns[-1] for series in several) / NS
    count = int((end - start) / WINDOW_S)
    return start + WINDOW_S * np.arange(count + 1) if count >= 4 else np.empty(0)


def _ratio(values: np.ndarray, reference: np.ndarray) -> float | None:
    """Slope of `values` against `reference` where they clearly belong together, else None."""
    norm = float(np.sum(reference**2) * np.sum(values**2))
    if norm <= 0.0:
        return None
    product = float(np.sum(values * reference))
    if abs(product) < 0.9 * math.sqrt(norm):
        return None
    return product / float(np.sum(reference**2))


def _guess(ratio: float, factors: dict[str, float]) -> str:
    for unit, factor in factors.items():
        if abs(abs(ratio) / factor - 1.0) < 0.25:
            return f": is it in {unit}?"
    return ""


def _driven(speed: Series | None) -> float:
    """The largest speed that commands alone can have brought, rad/s: 0 of a wheel that was fastest when its run began
    (a coast, or a brake)."""
    if speed is None:
        return 0.0
    top = _top(speed)
    first, last = np.abs(speed.values[[0, -1]])
    return 0.0 if last < first / TOLERATED and first > top / TOLERATED else top


def faint(signals: dict[str, Series], robot: Robot) -> list[str]:
    """Channels that change, but by next to nothing: one clause each. A simulator without noise has such
    channels, too.
    """
    found = []
    for name, series in signals.items():
        noise, moved = robot.noise(name), float(np.ptp(series.values)) if len(series) > 1 else 0.0
        if noise is not None and 0.0 < moved < noise / STILLER:
            found.append(f"{name} changes by {moved:.3g} in all, its sensor's noise is {noise:.3g}: unit or scale?")
    return found


def complaints(signals: dict[str, Series], robot: Robot, mode: str) -> list[str]:
    """What looks like a wrong unit: one clause a channel, naming it. `signals`: contract's channel -> SI series."""
    signals = {name: series for name, series in signals.items() if len(series) >= 2}
    found = _beyond_motor(signals, robot, mode)
    if not found:
        found = _at_odds(signals, robot)
    if not found and robot.chassis is not None:
        found = _other_turns(signals, robot.chassis)
    return found


def _beyond_motor(signals: dict[str, Series], robot: Robot, mode: str) -> list[str]:
    """Values that the motor and its supply cannot bring."""
    found = []
    sides = robot.sides
    motor = robot.motor
    back_emf = motor.back_emf_constant_v_s_per_rad * motor.gear_ratio
    electrical = mode != "torque" and math.isfinite(back_emf) and math.isfinite(motor.resistance_ohm)
    if electrical:
        no_load = robot.supply_v / back_emf
        for name in [f"{kind}_{s}" for kind in ("w", "w_cmd") for s in sides]:
            if name in signals and _top(signals[name]) > TOLERATED * no_load:
                top = _top(signals[name])
                found.append(f"{name} reaches {top:.3g} rad/s, {top / no_load:.3g} times the nominal no-load speed")
        stall = robot.supply_v / motor.resistance_ohm
        for name in [f"i_{s}" for s in sides]:
            if name in signals and _top(signals[name]) > TOLERATED * stall:
                found.append(f"{name} reaches {_top(signals[name]):.3g} A, the nominal stall current is {stall:.3g} A")
        for s in sides:
            name = f"v_cmd_{s}"
            if name not in signals or mode != "voltage":
                continue
            top = _top(signals[name])
            if top > TOLERATED * robot.supply_v:
                found.append(f"{name} reaches {top:.3g} V at a supply of {robot.supply_v:.3g} V")
            elif 0.0 < top and _driven(signals.get(f"w_{s}")) * back_emf > TOLERATED * top:
                found.append(
                    f"{name} never exceeds {top:.3g} V, too little for the speeds in w_{s}"
                    + (": is it a duty?" if top <= 1.0 else "")
                )
    if "v_bus" in signals:
        bus = float(np.median(signals["v_bus"].values))
        if not robot.supply_v / TOLERATED < bus < TOLERATED * robot.supply_v:
            found.append(f"v_bus is {bus:.3g} V, the nominal supply is {robot.supply_v:.3g} V")
    return found


def _at_odds(signals: dict[str, Series], robot: Robot) -> list[str]:
    """Speeds that the same wheel's angle or command contradicts by a factor that is a unit's."""
    found = []
    radius = robot.chassis.wheel_radius_m if robot.chassis else math.nan
    speed_factors = {
        "rpm": 1.0 / RPM,
        "deg/s": 1.0 / DEGREE,
        "rev/s": 1.0 / TURN,
        "m/s": radius,
        "mm/s": 1e3 * radius,
        "rad/s of the motor": robot.motor.gear_ratio,
    }
    for s in robot.sides:
        w, th, command = (signals.get(f"{kind}_{s}") for kind in ("w", "th", "w_cmd"))
        if w is not None and th is not None and len(edges := _edges(w, th)):
            ratio = _ratio(_means(w, edges), _slopes(th, edges))
            if ratio is not None and not 1.0 / TOLERATED < ratio < TOLERATED:
                what = "has the opposite sign of" if -TOLERATED < ratio < -1.0 / TOLERATED else f"is {ratio:.3g} times"
                found.append(f"w_{s} {what} the slope of th_{s}{_guess(ratio, speed_factors)}")
                continue
        if w is not None and command is not None and len(edges := _edges(w, command)):
            held = np.maximum(np.searchsorted(command.t_ns, w.t_ns, side="right") - 1, 0)
            ratio = _ratio(_means(w, edges), _means(Series(w.t_ns, command.values[held], ""), edges))
            # A weak motor may be far below its command, so only a factor that is a unit's counts.
            if ratio is not None and not 1.0 / TOLERATED < abs(ratio) < TOLERATED:
                guess = _guess(ratio, speed_factors)
                if guess:
                    found.append(f"w_{s} is {ratio:.3g} times w_cmd_{s}{guess}")
    return found


def _other_turns(signals: dict[str, Series], body: Chassis) -> list[str]:
    """Turns and ways that the wheels contradict."""
    found: list[str] = []
    radius = body.wheel_radius_m
    wheels = [signals[f"w_{s}"] for s in "lr" if f"w_{s}" in signals]
    slope_of = _means
    if len(wheels) < 2:
        wheels = [signals[f"th_{s}"] for s in "lr" if f"th_{s}" in signals]
        slope_of = _slopes
    if len(wheels) < 2:
        return found
    for name, slope in (("gyro_z", _means), ("yaw", _slopes)):
        series = signals.get(name)
        if series is not None and len(edges := _edges(series, *wheels)):
            left, right = (slope_of(wheel, edges) for wheel in wheels)
            ratio = _ratio(slope(series, edges), radius * (right - left) / body.track_width_m)
            if ratio is not None and not 1.0 / TOLERATED < abs(ratio) < TOLERATED:
                found.append(
                    f"{name} is {ratio:.3g} times what the wheels' speeds make of it"
                    + _guess(ratio, {"degrees": 1.0 / DEGREE})
                )
    if "x" in signals and "y" in signals and len(edges := _edges(signals["x"], signals["y"], *wheels)):
        left, right = (slope_of(wheel, edges) for wheel in wheels)
        speed = np.hypot(_slopes(signals["x"], edges), _slopes(signals["y"], edges))
        ratio = _ratio(speed, np.abs(radius * (left + right) / 2.0))
        if ratio is not None and not 1.0 / TOLERATED < ratio < TOLERATED:
            found.append(
                f"x and y move {ratio:.3g} times as far as the wheels roll"
                + _guess(ratio, {"millimetres": 1e3, "centimetres": 1e2, "kilometres": 1e-3})
            )
    return found
