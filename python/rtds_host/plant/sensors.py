"""Sensors: what is reported of a state."""

from __future__ import annotations

import numpy as np

from rtds_host.plant.compiled import law

# Numerical: of a current sensor's gain below this no current is told.
LEAST_GAIN = 0.1


@law
def scaled(value, gain, bias):
    """A reading of a sensor with a gain (1) and a bias, in the value's unit (contract, section 3)."""
    return value * gain + bias


@law
def low_pass(filtered, value, before, h, tau, fade):
    """A first-order filter after a step in which its input moved linearly, exactly; in the input's unit.

    y' = (x - y) / tau. before, value : its input at the step's begin and end; h, tau : s; fade : exp(-h / tau).
    """
    ramp = (value - before) / h
    return value - ramp * tau + (filtered - before + ramp * tau) * fade


@law
def behind(speed, reported, tau, delay):
    """A speed's filter at a start, where the speed and what is reported of it are known, in rad/s.

    tau, delay : s, the filter's and a further delay; of a steady change the filter has its share of the lag.
    """
    lag = tau + delay
    return speed + (reported - speed) * tau / lag if lag > 0.0 else reported


@law
def speed_read(filtered, direct, tau, gain):
    """What a speed sensor reads, rad/s: what its filter gives where it has one (tau > 0 s), else the speed itself."""
    return (filtered if tau > 0.0 else direct) * gain


@law
def within_step(began, ended, left):
    """What a sensor says within a step, at whose ends it says `began` and `ended`: it changes evenly, as `low_pass`
    takes what it filters, too. left : share of the step that is still to come.
    """
    return ended + (began - ended) * left


@law
def initial_current(current, reported, noise, gain, bias):
    """A current at a start, A, of what its sensor reported: what gain and bias make that, none where that is noise.

    `current` where it reported nothing, NaN, or hardly reports at all (gain near 0).
    """
    beyond = reported - bias
    seen = beyond / gain if abs(beyond) > noise else 0.0
    return seen if abs(reported) < np.inf and abs(gain) > LEAST_GAIN else current
