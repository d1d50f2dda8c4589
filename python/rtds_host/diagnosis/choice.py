"""The choice between explanations: by what they leave of runs that they were not fitted to.

One criterion, wherever a gap remains: each effect must leave at most `WORTH` of what is left without it, on runs left
out (contract, section 5: what does not help there is not included, however likely it is). What is left is G^2 - 1, the
squared gap less that of noise; it is taken over all channels at once, and as the geometric mean over channels, so that
an effect that one quiet channel shows is not lost beside a loud one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.fit import Fit
from rtds_host.diagnosis.left_out import left_out_channels
from rtds_host.diagnosis.problem import Problem

# What an effect leaves at most of the squared gap on runs left out. A judgement, set with open cases at hand.
WORTH = 0.75
# Explanations whose gaps on runs left out are within this ratio are indistinguishable by them: what makes a gap of
# none.
AS_MUCH = gaps.LEAST
# Of a channel or a case, what counts as no gap (contract, section 4).
NO_GAP = gaps.LEAST**2 - 1.0


@dataclass(frozen=True)
class Judged:
    """A fit, the problem that it is a fit of (whole runs or pieces), and its gap on runs left out by channel."""

    fit: Fit
    problem: Problem
    channels: Mapping[str, float]

    @classmethod
    def of(cls, problem: Problem, fit: Fit) -> Judged:
        return cls(fit, problem, left_out_channels(problem, fit))

    @property
    def gap(self) -> float:
        return gaps.gap(self.channels)

    @property
    def left(self) -> float:
        """What is left of the squared gap, beyond noise."""
        return max(self.gap**2 - 1.0, 0.0)


def pooled(one: Judged, other: Judged) -> float:
    """What an explanation leaves of what another leaves over all channels at once, a ratio."""
    if other.gap < gaps.LEAST:
        return 1.0 if one.gap <= other.gap else math.inf
    return one.left / other.left


def leaves(one: Judged, other: Judged) -> float:
    """What an explanation leaves of what another leaves, a ratio: the smaller of that over all channels at once and of
    the geometric mean over channels."""
    ratio = pooled(one, other)
    if other.gap < gaps.LEAST:
        return ratio
    logs = [
        math.log(max(one.channels[c] ** 2 - 1.0, NO_GAP) / max(value**2 - 1.0, NO_GAP))
        for c, value in other.channels.items()
        if c in one.channels
    ]
    mean = math.exp(sum(logs) / len(logs)) if logs else 1.0
    # What brings one channel closer and opens the whole is no explanation of it.
    return min(ratio, mean) if ratio <= 1.0 else ratio


def chosen(found: Mapping[int, list[Judged]], prior: Callable[[Fit], float]) -> Judged:
    """The explanation whose every effect is worth it.

    Looks ahead: two effects may be worth it only together, j of them where they leave at most `WORTH`^j. Of the
    explanations of that many effects that leave as much, the most probable before any run was seen: smaller and more
    usual effects go before large ones that cancel.

    Parameters
    ----------
    found : explanations by their number of effects; prior : -2 log prior density of a fit.
    """
    best = {count: min(mine, key=lambda j: j.gap) for count, mine in found.items()}
    count = min(best)
    while more := [n for n in sorted(best) if n > count and leaves(best[n], best[count]) < WORTH ** (n - count)]:
        count = more[0]
    alike = [j for j in found[count] if j.gap <= AS_MUCH * best[count].gap]
    return min(alike or [best[count]], key=lambda j: prior(j.fit))
