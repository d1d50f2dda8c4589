"""Effects that are alike in principle: what no algorithm tells apart on runs like these (contract, section 3).

Each rule names effects and what the runs must lack for them to be one. Look-alikes that follow from the sizes met (bridge drop
and dead zone while voltage and current agree in sign) are found by fitting them in each other's place, see `account`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rtds_host.contract import Case

Member = tuple[str, str]


def _logged(case: Case, *channels: str) -> bool:
    """Whether any of these channels, named without side, is logged in any run."""
    return any(log.has(c) for log in case.runs for c in log.columns if c.split("_")[0] in channels)


def _no_pose(case: Case) -> bool:
    return not _logged(case, "x", "y", "yaw")


def _no_place(case: Case) -> bool:
    return not _logged(case, "x", "y")


def _speed_alone(case: Case) -> bool:
    return not _logged(case, "i", "gyro", "x", "y", "yaw")


def _one_way(case: Case) -> bool:
    """Whether each wheel is commanded one way only, over all runs."""
    commands = np.concatenate([log.commands(case.robot.driver.mode) for log in case.runs])
    return bool(np.all((commands >= 0.0).all(axis=0) | (commands <= 0.0).all(axis=0)))


def _no_current_no_reversal(case: Case) -> bool:
    return not _logged(case, "i") and _one_way(case)


RULES: tuple[tuple[tuple[str, ...], Callable[[Case], bool]], ...] = (
    (("command_delay", "measurement_delay"), _no_pose),
    (("driver_gain", "speed_gain"), _speed_alone),
    (("wheel_radius_error", "track_width_error"), _no_place),
    # Beside section 3: how far the robot turns is seen by the gyro alone.
    (("gyro_gain", "track_width_error", "wheel_radius_error"), _no_pose),
    (("coulomb_friction", "driver_deadzone", "bridge_drop"), _no_current_no_reversal),
    (("coulomb_friction", "friction_asymmetry"), _one_way),
)


def twins(case: Case, member: Member) -> list[Member]:
    """The other effects that these runs could as well be blamed on, each on the member's side.

    `wheel_radius_error` is like `track_width_error` on both sides only.
    """
    effect, side = member
    found = []
    for names, holds in RULES:
        if effect in names and ("track_width_error" not in names or side == "both") and holds(case):
            found += [(name, side) for name in names if name != effect and (name, side) not in found]
    return found
