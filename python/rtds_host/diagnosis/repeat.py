"""How often each named effect is found again on halves of the data (N. Meinshausen, P. Buehlmann, J. R. Stat. Soc. B
72, 2010: what survives on subsets of the data is stable)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from rtds_host.contract import Case, RunLog
from rtds_host.diagnosis.diagnose import diagnose
from rtds_host.errors import InputError

Cause = tuple[str, str]


def halves(case: Case) -> list[Case]:
    """Halves of a case in pairs that share no row: of its runs by turns, and first runs and last ones.

    Two runs make one pair. A single run is cut in the middle of its time.
    """
    runs = case.runs
    if len(runs) == 1:
        return [replace(case, runs=(part,)) for part in _cut(runs[0])]
    pairs = [(runs[0::2], runs[1::2])]
    if len(runs) > 2:
        middle = len(runs) // 2
        pairs.append((runs[:middle], runs[middle:]))
    return [replace(case, runs=tuple(part)) for pair in pairs for part in pair]


def _cut(log: RunLog) -> tuple[RunLog, RunLog]:
    row = int(np.searchsorted(log.t, 0.5 * (log.t[0] + log.t[-1])))
    return log.rows(0, row), log.rows(row, len(log.t))


def repeats(
    case: Case,
    diagnosis: dict[str, Any],
    threads: int = 2,
    say: Callable[[str, float], None] = lambda *_: None,
) -> dict[Cause, tuple[int, int]]:
    """Each named effect of a diagnosis -> on how many halves it was found again, by name or declared as
    indistinguishable, and how many halves there were. A half that makes no case of its own finds nothing.

    Halves are searched as with `quick`.
    """
    wanted = [(effect["id"], effect["side"]) for effect in diagnosis["effects"]]
    parts = halves(case) if wanted else []
    found = []
    for k, part in enumerate(parts):
        say(f"half {k + 1}/{len(parts)}", k / len(parts))
        try:
            found.append(_members(diagnose(part, quick=True, threads=threads)[0]))
        except InputError:
            found.append(set())
    return {cause: (sum(cause in there for there in found), len(found)) for cause in wanted}


def _members(diagnosis: dict[str, Any]) -> set[Cause]:
    """Named effects, and what was declared as indistinguishable from one."""
    rows = [*diagnosis["effects"], *(cause for causes in diagnosis["indistinguishable"] for cause in causes)]
    return {(row["id"], row["side"]) for row in rows}
