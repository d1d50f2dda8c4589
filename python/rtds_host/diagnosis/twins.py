"""Effects that are indistinguishable in principle: what no algorithm can decide on such runs (formats, section 3).

Each effect's file names the others and the condition on the runs (`conditions`). Look-alikes that follow from the sizes
met (bridge drop and dead zone while voltage and current agree in sign) are found by fitting them in each other's place,
see `account`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from rtds_host.contract import Case
from rtds_host.diagnosis.effects import CATALOGUE, Condition

Member = tuple[str, str]


def _holding(case: Case, member: Member, *tables: Mapping[str, Condition]) -> list[Member]:
    """The effects of some tables whose condition these runs meet, each on the member's side."""
    side = member[1]
    found: list[Member] = []
    for name, holds in (rule for table in tables for rule in table.items()):
        if not holds(case):
            continue
        # What exists on both sides only is like what is on both; a single axis has the one side.
        own = side if CATALOGUE[name].sided else "both"
        if case.robot.axis is not None and CATALOGUE[name].sided:
            own = "left"
        fits = case.robot.axis is not None or own == side
        if fits and (name, own) not in found:
            found.append((name, own))
    return found


def twins(case: Case, member: Member, beside: Iterable[Member] = ()) -> list[Member]:
    """The other effects that these runs could as well be blamed on, for the same replays, each on the member's side.

    `beside`: the other effects of the explanation; the friction among them makes more effects indistinguishable.
    What is indistinguishable from one of these is one of these, too.
    """
    friction = any(CATALOGUE[effect].friction for effect, _ in beside)

    def others(one: Member) -> list[Member]:
        effect = CATALOGUE[one[0]]
        return _holding(case, one, effect.same_as, effect.same_with_friction if friction else {})

    found = others(member)
    for twin in found:
        found += [other for other in others(twin) if other != member and other not in found]
    return found


def near_twins(case: Case, member: Member) -> list[Member]:
    """What is nearly alike for want of a channel or a setting (formats, section 3), each on the member's side."""
    return _holding(case, member, CATALOGUE[member[0]].nearly_as)
