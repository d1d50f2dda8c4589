"""Blocks of the driver and the winding: the bus, and command and speed -> current."""

from __future__ import annotations

import numpy as np

from rtds_host.diagnosis.localise.series import filled, middles, smooth
from rtds_host.diagnosis.localise.signals import Signals

# Numerical: delays whose signatures are taken.
DELAYS_S = (0.002, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.06, 0.08)
# Numerical: parts of the largest command that a driver is limited to, time constants of a winding's heat, s, and the
# share of the stall current over which a current's sign turns over.
LIMITS = (0.5, 0.7, 0.85)
HEATS_S = (8.0, 40.0)
SIGN_CURRENT = 0.015


def bus_block(run: Signals) -> None:
    """Nominal supply against the measured bus."""
    if run.bus is None or run.robot.driver.bus == "measured":
        return
    rows = np.isfinite(run.bus)
    run.block("bus", run.bus - (run.supply - run.sag), run.robot.known_noise("v_bus"), rows)
    if not run.signatures:
        return
    run.put("driver:sag", "bus", -run.draw)
    run.put("driver:decline", "bus", -(run.t - run.t[0]))


def current_block(run: Signals, k: int) -> None:
    """Command and speed -> current, and the driver's and winding's signatures."""
    if not run.voltage_mode:
        return
    s = run.robot.sides[k]
    model = run.model
    res, tau, ke, settled = run.electric[k]
    i, w, t = run.i[k], run.w[k], run.t
    if run.has_i[k]:
        decay = np.concatenate([[0.0], np.exp(-run.dt / tau)])
        expected = settled + decay * (np.concatenate([[i[0]], i[:-1]]) - settled)
        noise_i = run.robot.known_noise(f"i_{s}") / abs(model.get("current_gain", k))
        # Speeds filled in between slow samples are less certain than the samples.
        noise = np.sqrt(noise_i**2 * (1 + decay**2) + (ke / res * np.hypot(run.w_noise[k], run.w_extra[k])) ** 2)
        rows = run.i_rows[k] & run.w_rows[k]
        rows[0] = False
        run.block(f"current_{s}", i - expected, noise, rows)
    if not run.signatures:
        return

    volts = run.volts[k]
    end, mean = run.held(volts, run.delay)
    top = float(np.max(np.abs(volts), initial=0.0))
    run.volt_columns(f"driver:gain_{s}", k, end, mean)
    run.volt_columns(f"driver:deadzone_{s}", k, -np.sign(end), -np.sign(mean))
    over = SIGN_CURRENT * run.scales.amps
    run.volt_columns(f"driver:drop_{s}", k, -np.tanh(i / over), -np.tanh(middles(i) / over))
    for part in LIMITS:
        cut_end, cut_mean = (-np.sign(v) * np.maximum(np.abs(v) - part * top, 0.0) for v in (end, mean))
        run.volt_columns(f"driver:limit{part:g}_{s}", k, cut_end, cut_mean)
    ramp = (t - t[0]) / run.supply
    run.volt_columns("driver:decline", k, -ramp * end, -middles(ramp) * mean)
    run.volt_columns("driver:sag", k, -run.draw / run.supply * end, -middles(run.draw) / run.supply * mean)
    if run.bus is not None and run.robot.driver.bus == "nominal":
        bus = smooth(filled(t, run.bus) - (run.supply - run.sag), run.half) / run.supply
        run.volt_columns("driver:bus", k, bus * end, middles(bus) * mean)
    for delay in DELAYS_S:
        delayed_end, delayed_mean = run.held(volts, run.delay + delay)
        run.volt_columns(f"timing:delay@{delay:g}", k, delayed_end - end, delayed_mean - mean, delayed=True)

    run.volt_columns(f"winding:resistance_{s}", k, -res * i, -middles(res * i))
    for seconds in HEATS_S:
        heat = run.heat(i, float(res[0]), seconds)
        run.volt_columns(f"winding:heating{seconds:g}_{s}", k, -res * i * heat, -middles(res * i * heat))
    run.volt_columns(f"winding:constant_{s}", k, -ke * w, -ke * middles(w))
