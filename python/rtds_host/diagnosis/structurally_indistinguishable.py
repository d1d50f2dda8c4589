"""Effects that are indistinguishable in principle: what no algorithm can decide on such runs (formats, section 3).

Each effect's file names the others and the condition on the runs (`conditions`). Look-alikes that follow from the sizes
met (bridge drop and dead zone while voltage and current agree in sign) are found by fitting them in each other's place,
see `practically_indistinguishable`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from rtds_host.contract import Case
from rtds_host.diagnosis.effects import CATALOGUE, Condition

Cause = tuple[str, str]


def _holding(case: Case, cause: Cause, *tables: Mapping[str, Condition]) -> list[Cause]:
    """The effects of some tables whose condition these runs meet, each on the member's side."""
    side = cause[1]
    found: list[Cause] = []
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


def structurally_indistinguishable(case: Case, cause: Cause, included: Iterable[Cause] = ()) -> list[Cause]:
    """The other effects that explain these runs as well, by the same replays, each on the member's side.

    `included`: the other effects of the explanation; the friction among them makes more effects indistinguishable.
    What is indistinguishable from one of these is one of these, too.
    """
    friction = any(CATALOGUE[effect].friction for effect, _ in included)

    def others(one: Cause) -> list[Cause]:
        effect = CATALOGUE[one[0]]
        return _holding(case, one, effect.same_as, effect.same_with_friction if friction else {})

    found = others(cause)
    for equal in found:
        found += [other for other in others(equal) if other != cause and other not in found]
    return found


def nearly_indistinguishable(case: Case, cause: Cause) -> list[Cause]:
    """What is nearly alike for want of a channel or a setting (formats, section 3), each on the member's side."""
    return _holding(case, cause, CATALOGUE[cause[0]].nearly_as)
