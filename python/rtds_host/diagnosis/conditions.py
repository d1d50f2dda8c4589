"""What runs lack, so that some effects make the same replays on them, whatever the algorithm (formats, section 3).

An effect's own file says which others it is alike with, and by which of these conditions; `indistinguishable` reads
them.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rtds_host.contract import Case, Robot, RunLog
from rtds_host.diagnosis.replay.model import measured_angle
from rtds_host.diagnosis.thresholds import SIGNIFICANT

# Numerical: commands of both wheels that differ by no more than this share of the largest are alike.
STRAIGHT = 0.02


def logged(case: Case, *channels: str) -> bool:
    """Whether any of these channels, named without side, is logged in any run."""
    return any(log.has(c) for log in case.runs for c in log.columns if c.split("_")[0] in channels)


def no_pose(case: Case) -> bool:
    """Whether no pose is logged, neither place nor heading."""
    return not logged(case, "x", "y", "yaw")


def no_place(case: Case) -> bool:
    """Whether no x and no y is logged."""
    return not logged(case, "x", "y")


def angles_known(case: Case) -> bool:
    """Whether the wheels' angles count from the same zero in all runs.

    They do where they are logged, in a single run, and of a pendulum, which hangs down at rest. Else a wheel may begin
    each run at another angle. A replay begins at zero (contract, section 1), but what varies with the angle has another
    phase in each run then.
    """
    pendulum = case.robot.axis is not None and case.robot.axis.kind == "pendulum"
    return pendulum or len(case.runs) == 1 or logged(case, "th")


def measured_turns(case: Case, side: str) -> float:
    """Turns between the lowest and the highest angle of a side's wheel in all runs; infinite where no sensor says."""
    known = [log for log in case.runs if log.has(f"th_{side}") or log.has(f"w_{side}")]
    if not known:
        return math.inf
    angles = np.concatenate([measured_angle(log, side, 0.0) for log in known])
    return float(np.ptp(angles)) / (2.0 * math.pi)


def _straight(case: Case) -> bool:
    """Whether both wheels are commanded alike in all runs: a robot that drives straight, as far as it is sound."""
    return case.robot.chassis is not None and all(
        bool(np.all(np.ptp(commands, axis=1) <= STRAIGHT * float(np.abs(commands).max(initial=0.0))))
        for log in case.runs
        for commands in (log.commands(case.robot.driver.mode),)
    )


def turns_without_pose(case: Case) -> bool:
    """Whether the wheels are commanded differently and no pose is logged."""
    return no_pose(case) and not _straight(case)


def straight_without_place(case: Case) -> bool:
    """Whether both wheels are commanded alike and no place is logged."""
    return no_place(case) and _straight(case)


def speed_alone(case: Case) -> bool:
    """Whether nothing but speeds and angles of wheels, and the bus, is logged."""
    return not logged(case, "i", "gyro", "x", "y", "yaw")


def one_way(case: Case) -> bool:
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
                SIGNIFICANT * (robot.noise(channel) or 0.0),
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


def no_current_no_reversal(case: Case) -> bool:
    """Whether no current is logged, and no wheel turns back within a run: forwards in one and backwards in another
    shows no more.
    """
    return not logged(case, "i") and all(one_way(replace(case, runs=(log,))) for log in case.runs)


def axis_without_gravity(case: Case) -> bool:
    """Whether it is a single axis on which no weight acts."""
    return case.robot.axis is not None and case.robot.axis.kind != "pendulum"


def rotor_counts(case: Case) -> bool:
    """Whether, on an axis without gravity, the rotor is more than a hundredth of the load, so that it can be mistaken
    for it.
    """
    robot = case.robot
    axis, motor = robot.axis, robot.motor
    if axis is None or not axis_without_gravity(case):
        return False
    load = axis.inertia_kg_m2 if axis.kind == "inertia" else axis.mass_kg * axis.metres_per_rad**2
    return motor.rotor_inertia_kg_m2 * motor.gear_ratio**2 >= 0.01 * load


def torque_drives(case: Case) -> bool:
    """Whether torque is commanded on an axis without gravity."""
    return case.robot.driver.mode == "torque" and axis_without_gravity(case)


def no_current(case: Case) -> bool:
    """Whether no current is logged of motors that are not driven by torque."""
    return not logged(case, "i") and case.robot.driver.mode != "torque"


def same_load(case: Case) -> bool:
    """Whether all runs have one payload: against the motion of its wheel, dry friction is what rolling resistance is,
    in a spin, too.
    """
    return case.robot.axis is None and len({log.meta.payload_kg for log in case.runs}) == 1


def one_slope(case: Case) -> bool:
    """Whether all runs are on the same slope."""
    slopes = {log.meta.slope_rad for log in case.runs}
    return len(slopes) == 1 and slopes != {0.0}


def loop_on_wheels(case: Case) -> bool:
    """Whether a base in speed mode is seen at its wheels alone, or not at all there.

    Its loop holds the speed that it reports. A scale of the command and one of the reported speed then differ by how
    the loop settles only: seen at the wheels, a base may count its own speed apart from what it reports; seen by pose
    and gyro, one is the other's inverse.
    """
    wheels = any(log.has(f"{channel}_{side}") for log in case.runs for channel in ("w", "th") for side in "lr")
    motion = logged(case, "i", "gyro", "x", "y", "yaw")
    return case.robot.driver.mode == "speed" and not (wheels and motion)


def loop_beyond_wheels(case: Case) -> bool:
    """Whether a base in speed mode is seen by its wheels and by pose or gyro, and no current is logged.

    Its loop holds the speed that it counts. Wheels that count at another scale and wheels of another radius then differ
    by how the loop settles only.
    """
    return case.robot.driver.mode == "speed" and not logged(case, "i") and logged(case, "gyro", "x", "y", "yaw")
