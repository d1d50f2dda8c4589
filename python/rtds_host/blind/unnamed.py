"""Laws of the planar world that no effect of the catalogue and no signature of the diagnoser has.

They come in two uses. Unmodelled effects (`vocabulary.UNNAMED`) are one such law at a time. The tier `hard` gives a
machine many of them at once: measured machines have every part slightly of another form (`hard.py`).

Sources of the forms: contact films of brushes, R. Holm, Electric Contacts (1967); Maxwell-slip elements, W. D. Iwan,
J. Appl. Mech. 33 (1966), 893; friction that ages at rest, J. H. Dieterich, J. Geophys. Res. 77 (1972), 3690; drag of
eddy currents, W. R. Smythe, AIEE Trans. 61 (1942), 681.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

SIDE = (
    "film_volts",  # brush film: volts at large current, and the current by which it has formed, A
    "film_amps",
    "droop",  # share of the flux that a large current takes, and the current that takes half of it, A
    "droop_amps",
    "segment",  # share by which the resistance is larger over a sector of the turn: its middle and half width, rad
    "segment_angle",
    "segment_width",
    "demagnetised",  # share of the flux that is lost for the rest of a run once the current has passed this, A
    "demagnetise_amps",
    "current_limit",  # A, at which the driver chops
    "foldback",  # share of the output voltage that a warm driver loses a watt of loss, and its time constant, s
    "foldback_tau",
    "slip_torque",  # three elements that slip one after the other: torque N m of all, travel of the first, rad
    "slip_rad",
    "power_drag",  # N m at `power_speed` rad/s, times the speed's share of it to a power
    "power_speed",
    "power",
    "eddy",  # N m s/rad at low speed, and the speed of the largest drag, rad/s
    "eddy_speed",
    "lag_drag",  # N m s/rad of a drag that follows the speed this late, s
    "lag_drag_tau",
    "dwell",  # N m by which rest of e times `dwell_s` raises dry friction
    "dwell_s",
    "growth",  # share by which a wheel's radius grows, a square of its speed, s2/rad2
    "mean_s",  # moving mean of the reported speed, and of the reported current, s
    "current_mean_s",
)
WORLD = (
    "tick_s",  # the driver takes a command only so often, s
    "choke_ohm",  # volts an ampere by which a supply gives way beyond its current limit, the limit A, time constant s
    "choke_amps",
    "choke_tau",
    "caster",  # N m of a caster that stands across, and its trail, m
    "caster_length",
    "nap",  # N of a carpet against its nap, which lies along this yaw, rad
    "nap_yaw",
    "slosh",  # share of the mass that swings, its frequency, 1/s, and damping ratio
    "slosh_rate",
    "slosh_ratio",
)
# What may not be 0 where nothing is asked for.
NEUTRAL = {
    "film_amps": 1.0,
    "droop_amps": 1.0,
    "segment_width": 1.0,
    "demagnetise_amps": 1.0,
    "foldback_tau": 1.0,
    "slip_rad": 1.0,
    "power_speed": 1.0,
    "power": 1.0,
    "eddy_speed": 1.0,
    "lag_drag_tau": 1.0,
    "dwell_s": 1.0,
    "choke_tau": 1.0,
    "caster_length": 1.0,
    "slosh_rate": 1.0,
}
ELEMENTS = ((0.5, 1.0), (0.3, 4.0), (0.2, 16.0))  # share of the torque, travel in that of the first
ELEMENT_SHARES = np.array([share for share, _ in ELEMENTS])
ELEMENT_TRAVELS = np.array([travel for _, travel in ELEMENTS])
RESTS_SHARE = 0.002  # of `power_speed`: below it a power of the speed is drawn straight to 0
DWELL_SPEED = 0.01  # rad/s, below which a contact ages
DWELL_RAD = 0.05  # travel that makes it young again
NAP_M_S = 0.002  # speed over which a carpet's drag turns over
# Rows of the state of a side.
WARM, WORN, LAGGING, AGE, FIRST_ELEMENT = range(5)
STATES = FIRST_ELEMENT + len(ELEMENTS)
# Columns of a side's parameters.
(
    FILM_VOLTS,
    FILM_AMPS,
    DROOP,
    DROOP_AMPS,
    SEGMENT,
    SEGMENT_ANGLE,
    SEGMENT_WIDTH,
    DEMAGNETISED,
    DEMAGNETISE_AMPS,
    CURRENT_LIMIT,
    FOLDBACK,
    FOLDBACK_TAU,
    SLIP_TORQUE,
    SLIP_RAD,
    POWER_DRAG,
    POWER_SPEED,
    POWER,
    EDDY,
    EDDY_SPEED,
    LAG_DRAG,
    LAG_DRAG_TAU,
    DWELL,
    DWELL_S,
    GROWTH,
    MEAN_S,
    CURRENT_MEAN_S,
) = range(len(SIDE))


@njit(cache=True)
def resistance(p, ohm, amps, angle):
    """Resistance of a winding with its brushes, ohm: a film whose voltage saturates, a sector that conducts badly.

    p : parameters of a side, see `SIDE`. angle : of the gear's output, rad.
    """
    if p[SEGMENT] != 0.0:
        away = (angle - p[SEGMENT_ANGLE] + math.pi) % (2.0 * math.pi) - math.pi
        if abs(away) < p[SEGMENT_WIDTH]:
            ohm *= 1.0 + p[SEGMENT]
    if p[FILM_VOLTS] != 0.0:
        share = abs(amps) / p[FILM_AMPS]
        ohm += p[FILM_VOLTS] / p[FILM_AMPS] * (1.0 if share < 1e-6 else (1.0 - math.exp(-share)) / share)
    return ohm


@njit(cache=True)
def flux(p, state, amps):
    """Share of the nominal flux that is left."""
    if p[DEMAGNETISED] != 0.0 and abs(amps) > p[DEMAGNETISE_AMPS]:
        state[WORN] = 1.0
    left = 1.0 - p[DEMAGNETISED] * state[WORN]
    if p[DROOP] != 0.0:
        left -= p[DROOP] * abs(amps) / (abs(amps) + p[DROOP_AMPS])
    return left


@njit(cache=True)
def output(p, state, h, volts, amps, ohm, emf):
    """Voltage that a driver puts out which chops at a current and gives less when it is warm."""
    if p[FOLDBACK] != 0.0:
        state[WARM] += h * (amps * amps * ohm - state[WARM]) / p[FOLDBACK_TAU]
        volts /= 1.0 + p[FOLDBACK] * state[WARM]
    if p[CURRENT_LIMIT] > 0.0:
        if volts > 0.0:
            volts = min(volts, max(emf + p[CURRENT_LIMIT] * ohm, 0.0))
        else:
            volts = max(volts, min(emf - p[CURRENT_LIMIT] * ohm, 0.0))
    return volts


@njit(cache=True)
def aged(p, state, h, speed):
    """Dry friction that rest has added, N m."""
    if p[DWELL] == 0.0:
        return 0.0
    if abs(speed) < DWELL_SPEED:
        state[AGE] += h
    else:
        state[AGE] *= math.exp(-abs(speed) * h / DWELL_RAD)
    return p[DWELL] * math.log1p(state[AGE] / p[DWELL_S])


@njit(cache=True)
def torque(p, state, h, speed):
    """Torque of friction at the gear's output, N m."""
    total = 0.0
    if p[SLIP_TORQUE] != 0.0:
        for k in range(ELEMENT_SHARES.shape[0]):
            stretch = state[FIRST_ELEMENT + k] + speed * h / (p[SLIP_RAD] * ELEMENT_TRAVELS[k])
            state[FIRST_ELEMENT + k] = min(max(stretch, -1.0), 1.0)
            total -= p[SLIP_TORQUE] * ELEMENT_SHARES[k] * state[FIRST_ELEMENT + k]
    if p[POWER_DRAG] != 0.0:
        share = speed / p[POWER_SPEED]
        total -= p[POWER_DRAG] * share * math.sqrt(share * share + RESTS_SHARE**2) ** (p[POWER] - 1.0)
    if p[EDDY] != 0.0:
        total -= p[EDDY] * speed / (1.0 + (speed / p[EDDY_SPEED]) ** 2)
    if p[LAG_DRAG] != 0.0:
        state[LAGGING] += h * (speed - state[LAGGING]) / p[LAG_DRAG_TAU]
        total -= p[LAG_DRAG] * state[LAGGING]
    return total


@njit(cache=True)
def against_nap(newtons, lies, yaw, speed):
    """Force along the body of a carpet that drags against its nap and not along it, N."""
    travels = math.copysign(1.0, speed) * math.cos(yaw - lies)
    return -newtons * math.tanh(speed / NAP_M_S) * 0.5 * (1.0 - travels)
