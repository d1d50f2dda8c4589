"""The catalogue of effects: one module an effect, found by being there.

To add one, write a module next to these that defines `EFFECT`, and its test; see docs/add-an-effect.md.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Sequence

from rtds_host.contract import Robot, RunLog
from rtds_host.diagnosis.effects.base import SIDES, Condition, Effect, Parameter, inside
from rtds_host.diagnosis.scales import scales_of

CATALOGUE: dict[str, Effect] = {}
for _module in sorted(info.name for info in pkgutil.iter_modules(__path__)):
    if _module in ("base", "exported"):
        continue
    _effect = importlib.import_module(f"{__name__}.{_module}").EFFECT
    CATALOGUE[_effect.id] = _effect


def catalogue(robot: Robot, runs: Sequence[RunLog] = ()) -> dict[str, Effect]:
    """The effects with their numbers in SI on a machine; `runs`: its logs, see `scales_of`.

    What acts before a speed loop is left out where a robot has none.
    """
    scales = scales_of(robot, runs)
    bench = robot.axis is not None and robot.driver.mode != "torque"
    return {
        name: (effect if bench else effect.off_bench()).on(scales)
        for name, effect in CATALOGUE.items()
        if robot.driver.mode == "speed" or not effect.before_loop
    }


# Effects that may be behind a form, by its term and the quantity that it runs over.
RESEMBLES: dict[tuple[str, str], tuple[str, ...]] = {
    form: tuple(name for name, effect in CATALOGUE.items() if form in effect.resembles)
    for form in sorted({form for effect in CATALOGUE.values() for form in effect.resembles})
}
SUBSYSTEMS = ("driver", "winding", "drivetrain", "wheel_ground", "chassis", "sensing", "timing")

__all__ = ["CATALOGUE", "RESEMBLES", "SIDES", "SUBSYSTEMS", "Condition", "Effect", "Parameter", "catalogue", "inside"]
