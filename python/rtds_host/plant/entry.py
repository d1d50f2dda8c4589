"""What one parameter of the plant is."""

from __future__ import annotations

import math
from dataclasses import dataclass

# Where a parameter acts in the real-time simulator: in the motor unit, in the physics engine or the layer before it, on
# the way of the measured values, in a log's clocks (the simulator has one), or nowhere (it has no such robot).
RTL, ROBOT, SIGNAL, LOG, REFUSED = "rtl", "robot", "signal", "log", "refused"


@dataclass(frozen=True)
class Entry:
    """One parameter.

    unit : SI. nominal : of a robot without effects; None: its file says. low, high : what is physically possible.
    place : where it acts in the simulator. export : its name, with its unit, in exports and corrections.
    """

    name: str
    unit: str
    nominal: float | None
    place: str
    export: str
    meaning: str
    low: float = -math.inf
    high: float = math.inf
