"""A log's clock: in which unit it counts, as far as the rate of its rows tells, and its times in sentences."""

from __future__ import annotations

import numpy as np

# Rates at which robots are logged (5 Hz to 2 kHz), with room to either side; outside them a clock's unit is asked for.
FASTEST_HZ, SLOWEST_HZ = 10_000.0, 3.0
# A staircase of settled speeds has a row a step, which is a second or a few; nobody takes more than so many of them.
SETTLED_S, MOST_SETTLED = 10.0, 1000
# Units that people write times in, and how many of them a second has.
PER_SECOND = {
    "milliseconds": 1e3,
    "microseconds": 1e6,
    "nanoseconds": 1e9,
    "minutes": 1.0 / 60.0,
    "hours": 1.0 / 3600.0,
}


def moment(t: float) -> str:
    """A time of a log's clock, s, as it is in the log, so that it can be searched for there: no exponent,
    to 1 µs.
    """
    # A Unix time in binary64 has no more digits.
    return np.format_float_positional(np.round(t, 6), trim="-")


def is_rate(step: float) -> bool:
    """Whether rows `step` seconds apart are a robot's log."""
    return 1.0 / FASTEST_HZ <= step <= 1.0 / SLOWEST_HZ


def is_staircase(t: np.ndarray) -> bool:
    """Whether rows at `t` (n,) s may be a staircase of settled speeds, a row a step, as far as their clock tells."""
    return 1.0 / SLOWEST_HZ < float(np.median(np.diff(t))) <= SETTLED_S and len(t) <= MOST_SETTLED


def likely_unit(step: float) -> str | None:
    """The unit in which rows `step` apart would be a robot's log, None where it is seconds or none at all."""
    if is_rate(step):
        return None
    return next((unit for unit, per_second in PER_SECOND.items() if is_rate(step / per_second)), None)
