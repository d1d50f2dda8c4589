"""The account of the gap: where before^2 - 1 comes from, and where the part without a name lies.

Shares are Shapley values (L. S. Shapley, Contributions to the Theory of Games II, 1953): what an effect takes off the
squared gap, averaged over all orders in which effects and tolerances could be put in. What they leave is the residual,
placed by the blocks that are replayed from measured signals (`localise`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Hashable, Sequence

import numpy as np

from rtds_host.diagnosis.fit import Fit, apply
from rtds_host.diagnosis.localise import Localisation
from rtds_host.diagnosis.problem import Problem

TOLERANCE = "tolerance"


def shapley(players: Sequence[Hashable], worth: Callable[[frozenset], float]) -> dict[Hashable, float]:
    """Fair share of each player in worth(all) - worth(none)."""
    n = len(players)
    known: dict[frozenset, float] = {}

    def of(members: frozenset) -> float:
        if members not in known:
            known[members] = worth(members)
        return known[members]

    shares = {}
    for player in players:
        others = [p for p in players if p != player]
        shares[player] = sum(
            math.factorial(count)
            * math.factorial(n - count - 1)
            / math.factorial(n)
            * (of(frozenset(members) | {player}) - of(frozenset(members)))
            for count in range(n)
            for members in itertools.combinations(others, count)
        )
    return shares


def explained(problem: Problem, fit: Fit) -> dict[Hashable, float]:
    """What each effect, and `TOLERANCE`, takes off the squared gap."""
    values = dict(zip(fit.hypothesis, fit.values))

    def worth(members: frozenset) -> float:
        z = fit.z if TOLERANCE in members else np.zeros_like(fit.z)
        chosen = tuple(h for h in fit.hypothesis if h in members)
        model = apply(fit.effects, problem.with_nuisances(z, fit.start), chosen, [values[h] for h in chosen])
        # A coalition that lets the replay run away is worth no more than the worst that a sensor could show.
        return -(min(problem.declared_gap(model), 1e6) ** 2)

    return shapley([*fit.hypothesis, TOLERANCE], worth)


def shares(problem: Problem, fit: Fit, after: float, place: Localisation) -> list[dict]:
    """The contract's `budget`: effects, tolerances and the residual by subsystem, at least 0, summing to 1; [] without
    a gap.
    """
    parts = {key: max(value, 0.0) for key, value in explained(problem, fit).items()}
    residual = max(after**2 - 1.0, 0.0)
    total = sum(parts.values()) + residual
    if total <= 0.0:
        return []
    rows = [
        {
            "what": "effect",
            "id": key[0],
            "side": fit.effects[key[0]].side_on(problem.robot.axis, key[1]),
            "share": value / total,
        }
        for key, value in sorted(parts.items(), key=lambda p: -p[1])
        if isinstance(key, tuple)  # all but `TOLERANCE`
    ]
    rows.append({"what": TOLERANCE, "share": parts[TOLERANCE] / total})
    located = place.shares()
    rows += [
        {"what": "rest", "subsystem": row["subsystem"], "share": residual / total * row["share"]} for row in located
    ]
    if not located:
        rows.append({"what": "rest", "subsystem": None, "share": residual / total})
    return rows


def located(problem: Problem, rows: list[dict]) -> list[dict]:
    """The contract's `located`: each subsystem's share of included effects and of the residual, largest first."""
    found: dict[str, float] = {}
    for row in rows:
        place = problem.effects[row["id"]].subsystem if row["what"] == "effect" else row.get("subsystem")
        if place is not None:
            found[place] = found.get(place, 0.0) + row["share"]
    whole = sum(found.values())
    if whole <= 0.0:
        return []
    return [{"subsystem": s, "share": v / whole} for s, v in sorted(found.items(), key=lambda p: -p[1]) if v > 0.0]
