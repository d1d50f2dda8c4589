"""How exact the motor unit is: ``python -m rtds_host.motor.accuracy [--seconds 300]`` prints docs/motor-unit.md's
tables.

Three figures: the model (which is the RTL, bit for bit) against the same difference equation in float64 with float64
coefficients; both methods against the exact solution of the differential equation; the balance of energy.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

from rtds_host.motor import reference
from rtds_host.motor.model import MotorPair, step_motors
from rtds_host.motor.parameters import METHODS, coefficients, parameter_words
from rtds_host.vectors import Vector

# Nominal motor of the contract's robot: R, L, Km, Kb, J, B (SI, motor shaft) and its supply.
NOMINAL = (8.6, 1.0e-3, 6.538e-3, 6.538e-3, 1.0e-7, 4.372e-7)
SUPPLY_V = 12.0
STEPS_S = (1e-5, 1e-6)
# Part of the stall torque Km V / R that loads the motor.
LOADS = {"no load": 0.0, "part load": 0.4, "stall": 1.0}

SPEED_BOUND = 5e-7  # of full scale V / Kb
CURRENT_BOUND = 1e-6  # of full scale V / R


@numba.njit(cache=True)
def _compare(x32, c32, x64, c, d, v, t, n_steps):
    """Advance both; the largest differences: current and speed of the high words, then of both words."""
    i, w, i_lo, w_lo = x32[0], x32[1], x32[2], x32[3]
    r, kb, km, b, g11, g12, g21, g22 = c32[0], c32[1], c32[2], c32[3], c32[4], c32[5], c32[6], c32[7]
    a, o = x64[0], x64[1]
    v64, t64 = np.float64(v), np.float64(t)
    da = d[0, 0] * v64 + d[0, 1] * t64
    do = d[1, 0] * v64 + d[1, 1] * t64
    worst_i, worst_w, worst_i2, worst_w2 = 0.0, 0.0, 0.0, 0.0
    for _ in range(n_steps):
        i, w, i_lo, w_lo = step_motors(i, w, i_lo, w_lo, r, kb, km, b, g11, g12, g21, g22, v, t)
        a, o = a + (c[0, 0] * a + c[0, 1] * o + da), o + (c[1, 0] * a + c[1, 1] * o + do)
        worst_i = max(worst_i, abs(np.float64(i) - a))
        worst_w = max(worst_w, abs(np.float64(w) - o))
        worst_i2 = max(worst_i2, abs(np.float64(i) + np.float64(i_lo) - a))
        worst_w2 = max(worst_w2, abs(np.float64(w) + np.float64(w_lo) - o))
    x32[0], x32[1], x32[2], x32[3] = i, w, i_lo, w_lo
    x64[0], x64[1] = a, o
    return worst_i, worst_w, worst_i2, worst_w2


@dataclass(frozen=True)
class Deviation:
    """Largest difference over a run, as part of full scale (V / R and V / Kb).

    Attributes
    ----------
    current, speed : of the high words, which are the outputs.
    current_both, speed_both : of the sum of both words.
    current_end, speed_end : of the high words after the last step.
    """

    current: float
    speed: float
    current_both: float
    speed_both: float
    current_end: float
    speed_end: float


def deviation(
    values: Vector, method: str, segments: Sequence[tuple[float, float, float]], supply_v: float = SUPPLY_V
) -> Deviation:
    """The model against the same difference equation in float64, from rest, compared at every step.

    Parameters
    ----------
    values : (7,) in the order of `PARAMETER_NAMES`. The float64 equation takes them as rounded to float32, since that
        is what both are given.
    segments : (V, N m, s) held one after the other.
    supply_v : V, sets the full scale.
    """
    words, method_index = parameter_words(values, method)
    exact = [float(word) for word in words]
    c, d = reference.difference_matrices(exact, method)
    c32 = coefficients(words, method_index)[0]
    x32, x64 = np.zeros(4, np.float32), np.zeros(2)
    worst = np.zeros(4)
    for v, t, seconds in segments:
        n_steps = round(seconds / float(values[6]))
        worst = np.maximum(worst, _compare(x32, c32, x64, c, d, np.float32(v), np.float32(t), n_steps))
    full_i, full_w = supply_v / exact[0], supply_v / exact[3]
    return Deviation(
        worst[0] / full_i,
        worst[1] / full_w,
        worst[2] / full_i,
        worst[3] / full_w,
        abs(float(x32[0]) - x64[0]) / full_i,
        abs(float(x32[1]) - x64[1]) / full_w,
    )


def method_error(values: Vector, method: str, seconds: float = 0.1) -> tuple[float, float]:
    """Largest error of the difference equation (in float64) against the exact solution, on a step to SUPPLY_V.

    Returns (current, speed) as parts of full scale.
    """
    n_steps = round(seconds / float(values[6]))
    c, d = reference.difference_matrices(values, method)
    got = reference.run(np.zeros(2), c, d, SUPPLY_V, 0.0, n_steps, 1)
    c, d = reference.exact_matrices(values)
    want = reference.run(np.zeros(2), c, d, SUPPLY_V, 0.0, n_steps, 1)
    worst = np.abs(got - want).max(axis=0)
    return worst[0] / (SUPPLY_V / values[0]), worst[1] / (SUPPLY_V / values[3])


def energy_imbalance(method: str, step_s: float) -> float:
    """Largest relative imbalance of the model's energy terms over two seconds of driving and braking."""
    pair = MotorPair(energy=True)
    pair.set_parameters(*NOMINAL, step_s, method)
    per_ms = round(1e-3 / step_s)
    for k in range(2000):
        v = 11.0 * math.sin(3e-3 * k)
        pair.step((v, -0.5 * v), (2e-3 * math.cos(5e-3 * k), 1e-3), per_ms)
    return float(pair.energy.imbalance.max())


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables; ends with status 1 if a bound is broken."""
    parser = argparse.ArgumentParser(prog="python -m rtds_host.motor.accuracy", description=__doc__)
    parser.add_argument("--seconds", type=float, default=300.0, help="simulated time of each run (default 300)")
    seconds = parser.parse_args(arguments).seconds
    if not 0.0 < seconds < math.inf:
        parser.error(f"argument --seconds: {seconds} must be greater than zero")
    stall = NOMINAL[2] * SUPPLY_V / NOMINAL[0]
    broken = False
    print(f"Against the same difference equation in float64: largest difference over {seconds:g} s, of full scale")
    print(f"(bounds: current {CURRENT_BOUND:g}, speed {SPEED_BOUND:g})")
    print("step    method          load       current   speed     both words: current, speed    at the end")
    for step_s in STEPS_S:
        for method in METHODS:
            for load, part in LOADS.items():
                d = deviation((*NOMINAL, step_s), method, [(SUPPLY_V, part * stall, seconds)])
                broken |= d.current > CURRENT_BOUND or d.speed > SPEED_BOUND
                print(
                    f"{step_s * 1e6:3g} us  {method:15s} {load:10s} {d.current:.2e}  {d.speed:.2e}  "
                    f"{d.current_both:.2e}  {d.speed_both:.2e}            {d.current_end:.2e}  {d.speed_end:.2e}"
                )
    print(f"\nAgainst the exact solution on a {SUPPLY_V:g} V step from rest: largest error in 0.1 s, of full scale")
    print("step    method          current   speed")
    for step_s in STEPS_S:
        for method in METHODS:
            current, speed = method_error((*NOMINAL, step_s), method)
            print(f"{step_s * 1e6:3g} us  {method:15s} {current:.2e}  {speed:.2e}")
    print("\nBalance of energy over 2 s of driving and braking: |drawn - accounted| over the largest term")
    for step_s in STEPS_S:
        for method in METHODS:
            print(f"{step_s * 1e6:3g} us  {method:15s} {energy_imbalance(method, step_s):.2e}")
    if broken:
        raise SystemExit("a bound is broken")


if __name__ == "__main__":
    main()
