"""The float64 reference of the motor units with effects. Shares no arithmetic with `effect_model` or `effect_tables`.

The difference equation x+ = x + C x + D u of `rtds_host.motor.reference`, with V and T changed by the curves themselves
(no tables), the delay as a list, and dry friction f as a complementarity problem of every step (J. J. Moreau,
"Unilateral contact and dry friction in finite freedom dynamics", 1988):

    w+ = w_free + D22 f      f = level_f if w+ > 0,  f = -level_b if w+ < 0,  -level_b <= f <= level_f if w+ = 0

As in the unit, what depends on the state is taken at the old state, and inputs act one step late.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numba
import numpy as np

from rtds_host.motor.effects import FULL_TURN, Curve, SupplyEffects, UnitEffects
from rtds_host.motor.reference import difference_matrices


@numba.njit(cache=True)
def _at(xs, ys, x):
    """Piecewise linear; at a jump the value behind it; held beyond the ends."""
    n = len(xs)
    if x < xs[0]:
        return ys[0]
    if x >= xs[n - 1]:
        return ys[n - 1]
    k = n - 2
    while xs[k] > x:
        k -= 1
    return ys[k] + (ys[k + 1] - ys[k]) * ((x - xs[k]) / (xs[k + 1] - xs[k]))


@numba.njit(cache=True)
def _curve_at(curves, which, x):
    """Curve `which` of the packed curves (starts, xs, ys) at x."""
    starts, xs, ys = curves
    a, b = starts[which], starts[which + 1]
    return _at(xs[a:b], ys[a:b], x)


@numba.njit(cache=True)
def _run(c, d, curves, n_curves, numbers, shared, late, volts, torques, out):
    """Fill out (n, 2, 2). c, d (2, 2, 2); numbers (2, 9): R, Kb, limit, load share, heat rise, heat tau, periods a rad,
    start, step."""
    x = np.zeros((2, 2))
    rise = np.zeros(2)
    turned = np.zeros(2)
    v_next, t_next = np.zeros(2), np.zeros(2)
    level_f, level_b = np.zeros(2), np.zeros(2)
    supply, source, decline = shared
    n = len(volts)
    for step in range(-1, n - 1):
        # the step with what was prepared (before the first there is rest)
        if step >= 0:
            for m in range(2):
                free = x[m] + c[m] @ x[m] + d[m, :, 0] * v_next[m] + d[m, :, 1] * t_next[m]
                gain = -d[m, 1, 1]  # speed that a torque of 1 N m takes in a step
                f = 0.0
                if free[1] > max(gain * level_f[m], 0.0):
                    f = level_f[m]
                elif free[1] < -max(gain * level_b[m], 0.0):
                    f = -level_b[m]
                else:
                    f = free[1] / gain
                stuck = free[1] == gain * f
                x[m] = free + d[m, :, 1] * f
                if stuck:
                    x[m, 1] = 0.0
            for m in range(2):
                out[step, m] = x[m]
        # what the next one works with; input k is read by strobe k
        k = step + 1
        vc = volts[k - late] if k >= late else np.zeros(2)
        draw = x[0, 0] * vc[0] + x[1, 0] * vc[1]
        bus = 1.0
        if source != 0.0 or decline != 0.0:
            bus = (supply - source * draw / supply - decline * numbers[0, 8] * (k + 1)) / supply
        for m in range(2):
            base = m * n_curves
            r, kb, limit, share, heat, tau, periods, start, h = numbers[m]
            i, w = x[m, 0], x[m, 1]
            v = _curve_at(curves, base, vc[m]) * bus
            v = min(max(v, -limit), limit)
            v -= _curve_at(curves, base + 1, v - kb * w)
            v_next[m] = v - rise[m] * r * i
            rise[m] += h / tau * (heat * (1.0 + rise[m]) * r * i * i - rise[m])
            turned[m] += periods * h * w
            phase = turned[m] + start / (2.0 * math.pi)
            phase -= math.floor(phase)
            t_next[m] = (
                torques[k, m] + _curve_at(curves, base + 2, w) - _curve_at(curves, base + 3, phase * 2.0 * math.pi)
            )
            against, along = share / (1.0 - share) * abs(torques[k, m]), share * abs(torques[k, m])
            level_f[m] = _curve_at(curves, base + 4, max(w, 0.0)) + (against if torques[k, m] > 0.0 else along)
            level_b[m] = _curve_at(curves, base + 5, max(-w, 0.0)) + (against if torques[k, m] < 0.0 else along)


def run(
    units: Sequence[UnitEffects],
    supply: SupplyEffects,
    parameters: Sequence[float],
    method: str,
    volts: np.ndarray,
    torques: np.ndarray,
) -> np.ndarray:
    """Both motors from rest with effects.

    Parameters
    ----------
    units : [left, right]. supply : shared.
    parameters : (7,) R, L, Km, Kb, J, B, step, SI, of a side without a motor of its own.
    volts, torques : (n, 2) float64, V and N·m, the inputs read by each strobe; input k acts in step k + 1.

    Returns
    -------
    (n - 1, 2, 2) float64: current (A) and speed (rad/s) of [left, right] after step k + 1, k = 0 the first.
    """
    step_s = float(parameters[6])
    zero, through = Curve((0.0,), (0.0,)), Curve((-1e9, 1e9), (-1e9, 1e9))
    xs: list[float] = []
    ys: list[float] = []
    starts, c, d, numbers = [0], [], [], []
    for unit in units:
        values = (*(unit.motor.values if unit.motor else parameters[:6]), step_s)
        matrices = difference_matrices(values, method)
        c.append(matrices[0])
        d.append(matrices[1])
        drop = unit.drop or zero
        resting = Curve(tuple(values[0] * x + y for x, y in zip(drop.x, drop.y, strict=True)), drop.y)
        curves = (unit.command or through, resting, unit.torque or zero, unit.ripple or zero,
                  unit.friction_forward or zero, unit.friction_backward or zero)  # fmt: skip
        for curve in curves:
            xs += curve.x
            ys += curve.y
            starts.append(len(xs))
        numbers.append((values[0], values[3], unit.limit_v, unit.load_share, unit.heat_rise_per_w, unit.heat_tau_s,
                        unit.ripple_periods_per_rad * FULL_TURN / (2.0 * math.pi), unit.ripple_start_rad,
                        step_s))  # fmt: skip
    packed = np.array(starts), np.array(xs, float), np.array(ys, float)
    # The command's way is one step long at least: the unit's register.
    late = max(round(supply.command_delay_s / step_s) - 1, 0)
    shared = (supply.voltage_v, supply.source_resistance_ohm, supply.decline_v_per_s)
    out = np.empty((len(volts) - 1, 2, 2))
    _run(np.array(c), np.array(d), packed, len(starts) // 2, np.array(numbers), shared, late,
         np.asarray(volts, float), np.asarray(torques, float), out)  # fmt: skip
    return out
