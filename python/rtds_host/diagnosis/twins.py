"""Effects that are alike in principle: what no algorithm tells apart on runs like these (contract, section 3).

Each rule names effects and what the runs must lack for them to be one. Look-alikes that follow from the sizes met
(bridge drop and dead zone while voltage and current agree in sign) are found by fitting them in each other's place, see
`account`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from rtds_host.contract import Case, Robot, RunLog
from rtds_host.diagnosis.chance import MOVES
from rtds_host.diagnosis.effects import CATALOGUE

Member = tuple[str, str]

# Numerical: commands of both wheels that differ by no more than this share of the largest are alike.
STRAIGHT = 0.02


def _logged(case: Case, *channels: str) -> bool:
    """Whether any of these channels, named without side, is logged in any run."""
    return any(log.has(c) for log in case.runs for c in log.columns if c.split("_")[0] in channels)


def _no_pose(case: Case) -> bool:
    return not _logged(case, "x", "y", "yaw")


def _no_place(case: Case) -> bool:
    return not _logged(case, "x", "y")


def _straight(case: Case) -> bool:
    """Whether both wheels are commanded alike in all runs: a robot that drives straight, as far as it is sound."""
    return case.robot.chassis is not None and all(
        bool(np.all(np.ptp(commands, axis=1) <= STRAIGHT * float(np.abs(commands).max(initial=0.0))))
        for log in case.runs
        for commands in (log.commands(case.robot.driver.mode),)
    )


def _turns_unplaced(case: Case) -> bool:
    return _no_pose(case) and not _straight(case)


def _straight_unplaced(case: Case) -> bool:
    return _no_place(case) and _straight(case)


def _speed_alone(case: Case) -> bool:
    return not _logged(case, "i", "gyro", "x", "y", "yaw")


def _one_way(case: Case) -> bool:
    """Whether each wheel turns one way only, over all runs: by its speed, else its angle, else its commands."""
    for k, side in enumerate(case.robot.sides):
        ways = [_ways(log, case.robot, k, side) for log in case.runs]
        if any(back for back, _ in ways) and any(on for _, on in ways):
            return False
    return True


def _ways(log: RunLog, robot: Robot, k: int, side: str) -> tuple[bool, bool]:
    """Whether a wheel turns backwards in a run, and forwards, by more than noise."""
    for channel in (f"w_{side}", f"th_{side}"):
        if log.has(channel):
            values, noise = (
                log.columns[channel][np.isfinite(log.columns[channel])],
                MOVES * (robot.noise(channel) or 0.0),
            )
            if channel[0] == "w":
                return bool((values < -noise).any()), bool((values > noise).any())
            noise *= math.sqrt(2.0)
            return (
                bool((values < np.maximum.accumulate(values) - noise).any()),
                bool((values > np.minimum.accumulate(values) + noise).any()),
            )
    commands = log.commands(robot.driver.mode)[:, k]
    return bool((commands < 0.0).any()), bool((commands > 0.0).any())


def _no_current_no_reversal(case: Case) -> bool:
    """Whether no current is logged, and no wheel turns back within a run: forwards in one and backwards in another
    shows no more.
    """
    return not _logged(case, "i") and all(_one_way(replace(case, runs=(log,))) for log in case.runs)


def _axis_without_gravity(case: Case) -> bool:
    return case.robot.axis is not None and case.robot.axis.kind != "pendulum"


def _rotor_counts(case: Case) -> bool:
    """Whether, on an axis without gravity, the rotor is more than a hundredth of the load, so that it can be mistaken
    for it.
    """
    robot = case.robot
    if not _axis_without_gravity(case):
        return False
    axis, motor = robot.axis, robot.motor
    load = axis.inertia_kg_m2 if axis.kind == "inertia" else axis.mass_kg * axis.metres_per_rad**2
    return motor.rotor_inertia_kg_m2 * motor.gear_ratio**2 >= 0.01 * load


def _torque_drives(case: Case) -> bool:
    return case.robot.driver.mode == "torque" and _axis_without_gravity(case)


def _no_current(case: Case) -> bool:
    return not _logged(case, "i") and case.robot.driver.mode != "torque"


def _same_load(case: Case) -> bool:
    """Whether all runs have one payload: against the motion of its wheel, dry friction is what rolling resistance is,
    in a spin, too.
    """
    return case.robot.axis is None and len({log.meta.payload_kg for log in case.runs}) == 1


def _one_slope(case: Case) -> bool:
    """Whether all runs are on the same slope."""
    slopes = {log.meta.slope_rad for log in case.runs}
    return len(slopes) == 1 and slopes != {0.0}


# What makes the same replays: of these only one is ever in an explanation.
SAME: tuple[tuple[tuple[str, ...], Callable[[Case], bool]], ...] = (
    (("command_delay", "measurement_delay"), _no_pose),
    (("driver_gain", "speed_gain"), _speed_alone),
    (("wheel_radius_error", "track_width_error"), _no_place),
    # Beside section 3: how far the robot turns is seen by the gyro alone.
    (("gyro_gain", "track_width_error", "wheel_radius_error"), _turns_unplaced),
    (("coulomb_friction", "driver_deadzone", "bridge_drop"), _no_current_no_reversal),
    (("coulomb_friction", "friction_asymmetry"), _one_way),
    (("coulomb_friction", "rolling_resistance"), _same_load),
    (("payload_error", "rotor_inertia_error"), _rotor_counts),
)
# Beside section 3: a drive that is stronger, a load that is lighter and a speed that reads too high differ by the size
# of friction alone, m w' = g T - c sgn w - b w, and are the same where an explanation has friction that no sheet knows.
FRICTION = {"coulomb_friction", "stribeck_friction", "viscous_friction", "friction_asymmetry"}
WITH_FRICTION: tuple[tuple[tuple[str, ...], Callable[[Case], bool]], ...] = (
    (("payload_error", "driver_gain", "speed_gain"), _torque_drives),
)
# What makes nearly the same replays: each may be there beside the other.
ALIKE: tuple[tuple[tuple[str, ...], Callable[[Case], bool]], ...] = (
    (("resistance_error", "torque_constant_error", "payload_error"), _no_current),
    (("payload_error", "slope_error"), _one_slope),
    # Beside section 3: of a robot that drives straight, m r^2 is all that its wheels feel of either.
    (("wheel_radius_error", "payload_error"), _straight_unplaced),
)


def _others(
    rules: tuple[tuple[tuple[str, ...], Callable[[Case], bool]], ...], case: Case, member: Member
) -> list[Member]:
    effect, side = member
    found = []
    for names, holds in rules:
        if effect not in names or not holds(case):
            continue
        for name in names:
            # What exists on both sides only is like what is on both; a single axis has the one side.
            own = (
                "left"
                if case.robot.axis is not None and CATALOGUE[name].sided
                else side
                if CATALOGUE[name].sided
                else "both"
            )
            fits = case.robot.axis is not None or own == side
            if name != effect and fits and (name, own) not in found:
                found.append((name, own))
    return found


def twins(case: Case, member: Member, beside: Iterable[Member] = ()) -> list[Member]:
    """The other effects that these runs could as well be blamed on, for the same replays, each on the member's side;
    `beside`: what else is in the explanation. What is like a twin is one, too."""
    rules = SAME + (WITH_FRICTION if FRICTION & {effect for effect, _ in beside} else ())
    found = _others(rules, case, member)
    for twin in found:
        found += [other for other in _others(rules, case, twin) if other != member and other not in found]
    return found


def near_twins(case: Case, member: Member) -> list[Member]:
    """What is nearly alike for want of a channel or a setting (contract, section 3), each on the member's side."""
    return _others(ALIKE, case, member)
