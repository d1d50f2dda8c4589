"""What the blocks say of each effect of a model: whether it opens them, and whether it stands in for a cause without a
name.

In the blocks, which measured signals drive, what an effect does is known exactly: the residual without it less the one
with it. All these differences, the nuisances and the signature of a cause that no effect is named for are fitted to
what the model leaves there. If that cause explains most of what is left, and an effect shrinks to less than half beside
it, the effect was a part of that cause.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from rtds_host.contract import Case
from rtds_host.diagnosis.chance import MOST, SLIGHT, sigmas
from rtds_host.diagnosis.effects.base import SIDES
from rtds_host.diagnosis.localise.blocks import excess_energy, own_blocks
from rtds_host.diagnosis.localise.electrical import DRIFTS_S, SLEWS
from rtds_host.diagnosis.localise.ground import extent
from rtds_host.diagnosis.localise.mechanical import TRACTIONS
from rtds_host.diagnosis.localise.shares import FAINT, Sums
from rtds_host.diagnosis.replay.model import Model

Member = tuple[str, str]

# Causes among the signatures that no effect of the catalogue is named for, and what a report calls them.
NAMELESS = {
    "driver:crosstalk": "the other side's command",
    "driver:hysteresis": "a driver that hangs on the way its command came",
    "driver:relax": "a battery that follows its load late",
    **{f"driver:slew{slew:g}": "a driver that slews" for slew in SLEWS},
    "winding:saturation": "a torque that falls behind its current",
    "drivetrain:quadratic": "a drag by the square of the speed",
    "drivetrain:growing": "a friction that grows",
    "drivetrain:place": "a friction at one place of the turn",
    "drivetrain:detent": "a ripple at one place of the turn",
    "wheel_ground:turn_drag": "a drag by the yaw rate",
    "wheel_ground:patch_x": "a patch of the floor",
    "wheel_ground:patch_y": "a patch of the floor",
    **{f"wheel_ground:traction{part:g}": "a tyre that gives way" for part in TRACTIONS},
    "chassis:drag": "a drag on the body",
    "chassis:tether": "a tether",
    "sensing:current_bend": "a current sensor that bends",
    "sensing:current_lag": "a current sensor that lags",
    "timing:pose_drift": "clocks that drift",
    **{f"timing:drift{drift:g}": "clocks that drift" for drift in DRIFTS_S},
}
# Of these, what is of another size at another place of the turn, the effects that it is a constant of elsewhere, and
# the sizes in a model (N m) that the constant is the sum of. A friction pushes nowhere: where one changes by so much
# over the turn, so much of its mean is not constant.
OVER_A_TURN = {
    "drivetrain:place": {"coulomb_friction": ("coulomb",), "stribeck_friction": ("coulomb", "stribeck")},
    "drivetrain:detent": {"torque_ripple": ("ripple",)},
}
# Signatures that could be anything of a block: whatever a sensor or a torque does, a floor's bumps, a wheel out of
# true, any delay.
ANYTHING = (
    "drivetrain:steady",
    "sensing:current_fault",
    "sensing:speed_fault",
    "sensing:speed_wobble",
    "wheel_ground:eccentric",
    "wheel_ground:bumps",
    "timing:",
    "driver:bus",
    "effect:",
)


@dataclass(frozen=True)
class Absences:
    """left : excess energy of all blocks with every effect in, of `count` residuals; opened : effect -> how much of it
    the effect brought; kept : effect -> the share of it that is left beside `cause`, empty where no cause without a
    name explains most of what is left."""

    left: float
    count: int
    opened: dict[Member, float]
    kept: dict[Member, float]
    cause: str


def absences(case: Case, model: Model, gone: Mapping[Member, Model]) -> Absences:
    """Judge effects by the blocks; model : with all of them; gone : effect -> the model with all but that one."""
    where = extent(case.runs) if case.robot.chassis is not None else None
    names = {member: "effect:{}@{}".format(*member) for member in gone}
    runs, without = [], {member: [] for member in gone}
    for log in case.runs:
        run = own_blocks(log, case.robot, model, where)
        for member, other in gone.items():
            less = own_blocks(log, case.robot, other, signatures=False)
            without[member].append(less)
            run.columns[names[member]] = {
                b: less.blocks[b][0] - run.blocks[b][0] for b in run.blocks if b in less.blocks
            }
        runs.append(run)
    left, count = excess_energy(runs)
    opened = {member: left - excess_energy(found)[0] for member, found in without.items()}
    return Absences(left, count, opened, *_kept(Sums(runs, known=True), names, model))


def _kept(sums: Sums, names: Mapping[Member, str], model: Model) -> tuple[dict[Member, float], str]:
    """`kept` and `cause` of `Absences`, of the effects that show in the blocks at all."""
    shown = {j for columns in sums.groups.values() for j in columns}
    effects = {member: j for member, name in names.items() if (j := sums.names.index(name)) in shown}
    picked = [*sums.always, *effects.values()]
    left = _left(sums, picked)
    if left < FAINT * sums.floor:
        return {}, ""
    named = [
        columns for group, columns in sums.groups.items() if group not in NAMELESS and not group.startswith(ANYTHING)
    ]
    gains = {}
    for group in NAMELESS.keys() & sums.groups.keys():
        columns = sums.groups[group]
        if all(_its_own(sums, columns, others, picked) for others in [picked, *named]):
            gains[group] = left - _left(sums, [*picked, *columns]) - 2.0 * len(columns)
    best = max(sorted(gains), key=gains.get, default="")
    if not best or gains[best] < max(MOST * left, sigmas(len(gains)) ** 2):
        return {}, ""
    beside = [*picked, *sums.groups[best]]
    sizes = dict(zip(beside, sums.explained(beside, set())[1]))
    changes = {
        side: math.hypot(*(sizes[j] for j in sums.groups[best] if sums.names[j].endswith((f"_{side}", f"_{side}b"))))
        for side in "lr"
    }
    return {
        member: min(1.0 + float(sizes[j]), _constant(best, member, changes, model)) for member, j in effects.items()
    }, NAMELESS[best]


def _constant(cause: str, member: Member, changes: Mapping[str, float], model: Model) -> float:
    """The share of an effect that is the same all over the turn, where it is one of those that a cause changes by so
    much, side -> N m.
    """
    slots = OVER_A_TURN.get(cause, {}).get(member[0], ())
    sizes = {k: sum(abs(model.get(slot, k)) for slot in slots) for k in SIDES[member[1]]}
    return min((1.0 - changes["lr"[k]] / size for k, size in sizes.items() if size), default=1.0)


def _its_own(sums: Sums, columns: list[int], others: list[int], picked: list[int]) -> bool:
    """Whether a cause is more than what effects and tolerances (`others`) make.

    On a robot that drives straight the other side's command is a gain; where none turns back within a run, a driver
    that hangs on the way its command came is a dead zone. By a tenth that is its own a cause takes a part of any rest;
    but nearly all of it, beside those others and all that is in (`picked`), only if it is there: a bend and viscous
    friction make most of a drag by the square.
    """
    if max(sums.own(j, others) for j in columns) >= SLIGHT:
        return True
    beside = [*picked, *(j for j in others if j not in picked)]
    left = _left(sums, beside)
    return left >= FAINT * sums.floor and _left(sums, [*beside, *columns]) <= SLIGHT * left


def _left(sums: Sums, columns: list[int]) -> float:
    """Energy beyond noise that some columns leave of the blocks."""
    return sum(sums.energy.values()) - sums.explained(columns, set())[0] - sums.floor
