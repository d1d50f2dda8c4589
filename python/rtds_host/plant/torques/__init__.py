"""Torques by a wheel's angle or speed: one file each, found by being there (`TORQUE`).

Replays, simulator, exports and the blocks driven by measured signals take all of them. A new one is a file here and the
effect that sets its parameters, see docs/add-an-effect.md.
"""

from __future__ import annotations

import importlib
import pkgutil

from rtds_host.plant.torque import Torque

TORQUES: dict[str, Torque] = {}
# The ripple first, whose place in sums was before there were others.
for _name in sorted((info.name for info in pkgutil.iter_modules(__path__)), key=lambda name: (name != "ripple", name)):
    TORQUES[_name] = importlib.import_module(f"{__name__}.{_name}").TORQUE
