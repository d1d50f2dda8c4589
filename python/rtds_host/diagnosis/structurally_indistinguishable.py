"""Effects that are structurally indistinguishable: what no algorithm can decide on such runs (formats, section 3).

Each effect's file names the others and the condition on the runs (`conditions`). Those that follow from the sizes met
(bridge drop and dead zone while voltage and current agree in sign) are in `practically_indistinguishable`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from rtds_host.contract import Case
from rtds_host.diagnosis.conditions import axis_without_gravity, logged
from rtds_host.diagnosis.effects import CATALOGUE, Condition

Cause = tuple[str, str]


def structurally_indistinguishable(case: Case, cause: Cause, included: Iterable[Cause] = ()) -> list[Cause]:
    """The other effects that explain these runs as well, by the same replays, each on the effect's side.

    `included`: the other effects of the explanation; the friction among them makes more effects indistinguishable.
    What is indistinguishable from one of these is one of these, too.
    """
    friction, found = any(CATALOGUE[effect].friction for effect, _ in included), [cause]
    for one in found:
        effect = CATALOGUE[one[0]]
        others = _holding(case, one, effect.same_as, effect.same_with_friction if friction else {})
        found += [other for other in others if other not in found]
    return found[1:]


def scale_all(case: Case, causes: Iterable[Cause]) -> bool:
    """Whether effects scale the command and all that is measured of an axis without gravity: one of them too many.

    The equations of such an axis are homogeneous: k times the voltage makes k times the speed and the current where
    friction is k times as large, too. So k is free with all these scales, and one of them less makes the same replays.
    """
    if not axis_without_gravity(case):
        return False
    scaled = {what for effect, _ in causes for what in CATALOGUE[effect].scales}
    measured = {channel for channel in ("w", "th", "i") if logged(case, channel)}
    return bool(measured) and {"command", *measured} <= scaled


def nearly_indistinguishable(case: Case, cause: Cause) -> list[Cause]:
    """What is nearly alike for want of a channel or a setting (formats, section 3), each on the effect's side."""
    return _holding(case, cause, CATALOGUE[cause[0]].nearly_as)


def _holding(case: Case, cause: Cause, *tables: Mapping[str, Condition]) -> list[Cause]:
    """The effects of some tables whose condition these runs meet, each on the effect's side."""
    axis, found = case.robot.axis is not None, []
    for name, holds in (rule for table in tables for rule in table.items()):
        # An effect of both sides only is like one on both; a single axis has the one side.
        side = ("left" if axis else cause[1]) if CATALOGUE[name].sided else "both"
        if (axis or side == cause[1]) and holds(case):
            found.append((name, side))
    return list(dict.fromkeys(found))
