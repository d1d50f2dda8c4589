"""The catalogue of effects: one module an effect, found by being there.

To add one, write a module beside these that defines `EFFECT`, and its test; see docs/add-an-effect.md.
"""

from __future__ import annotations

import importlib
import pkgutil

from rtds_host.diagnosis.effects.base import SIDES, Effect, Parameter

CATALOGUE: dict[str, Effect] = {}
for _module in sorted(info.name for info in pkgutil.iter_modules(__path__)):
    if _module == "base":
        continue
    _effect = importlib.import_module(f"{__name__}.{_module}").EFFECT
    CATALOGUE[_effect.id] = _effect

SUBSYSTEMS = ("driver", "winding", "drivetrain", "wheel_ground", "chassis", "sensing", "timing")

__all__ = ["CATALOGUE", "SIDES", "SUBSYSTEMS", "Effect", "Parameter"]
