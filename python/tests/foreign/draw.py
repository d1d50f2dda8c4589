"""Robots drawn by chance: half of them nominal, the others with one cause; bags and truth. Nothing of the program is
used.
"""

from __future__ import annotations

import json
import random
from pathlib import Path

from foreign.bag import Clock, record
from foreign.robot import Burger, Fault, Servo

DRIVES = ("lanes", "turns", "wander")
CAUSES = ("coulomb_friction", "driver_deadzone", "driver_gain", "wheel_radius_error", "command_delay")
SIDES = {"left": (True, False), "right": (False, True), "both": (True, True)}


def _sided(side: str, value: float, other: float) -> tuple[float, float]:
    left, right = SIDES[side]
    return (value if left else other, value if right else other)


def fault(cause: str | None, chance: random.Random) -> tuple[Fault, list[dict]]:
    """A cause with a size and a side, and the truth in the contract's words."""
    if cause is None:
        return Fault(), []
    side = chance.choice(("left", "right", "both"))
    if cause == "coulomb_friction":
        value, key = chance.uniform(0.05, 0.15), "torque_nm"
        made = Fault(coulomb_nm=_sided(side, value, 0.0))
    elif cause == "driver_deadzone":
        value, key = chance.uniform(0.5, 1.5), "volts"
        made = Fault(deadzone_v=_sided(side, value, 0.0))
    elif cause == "driver_gain":
        value, key = chance.choice((chance.uniform(0.6, 0.85), chance.uniform(1.15, 1.4))), "ratio"
        made = Fault(gain=_sided(side, value, 1.0))
    elif cause == "wheel_radius_error":
        side = chance.choice(("left", "right"))
        value, key = chance.choice((chance.uniform(0.9, 0.96), chance.uniform(1.04, 1.1))), "ratio"
        made = Fault(radius=_sided(side, value, 1.0))
    else:
        side, value, key = "both", chance.uniform(0.05, 0.2), "seconds"
        made = Fault(delay_s=value)
    return made, [{"id": cause, "side": side, "parameters": {key: value}}]


def draw(folder: Path, number: int, seed: int) -> dict:
    """Write the bags of one robot into `folder`, and its truth next to them as truth.json; returns the truth."""
    chance = random.Random(f"{seed}/{number}")
    cause = None if number % 2 == 0 else CAUSES[number // 2 % len(CAUSES)]
    made, effects = fault(cause, chance)
    servo = Servo(
        kp=0.4417 * chance.uniform(0.75, 1.33),
        ki=8.628 * chance.uniform(0.75, 1.33),
        smooth=chance.uniform(0.0, 0.6),
        release=chance.uniform(0.2, 0.9),
    )
    battery, late = chance.uniform(10.8, 12.6), chance.uniform(0.001, 0.020)
    folder.mkdir(parents=True)
    for k, kind in enumerate(DRIVES):
        robot = Burger(
            made,
            servo,
            battery_v=battery - 0.05 * k,
            battery_ohm=chance.uniform(0.03, 0.12),
            drop_v_per_s=chance.uniform(0.0, 0.001),
        )
        record(folder / f"{kind}.mcap", robot, kind, Clock(late, 1_760_000_000 + 300 * k), chance)
    truth = {"effects": effects, "battery_v": battery, "stamps_late_s": late, "kp": servo.kp, "ki": servo.ki}
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    return truth
