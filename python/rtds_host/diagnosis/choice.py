"""The choice between explanations: by what they leave of runs that they were not fitted to.

One criterion, wherever a gap remains: on held-out runs each effect must reduce the residual to at most
`MAX_RESIDUAL_RATIO` of what it is without the effect (contract, section 5: what does not help there is not included,
however likely it is). The residual is G^2 - f, the squared gap minus that of noise, f being 1 where the noise is as
declared. It is taken over all channels at once, and as the geometric mean over channels, so that an effect that one
quiet channel shows is not lost next to a loud one.

f is measured (`sample_noise`), so that the choice does not depend on the noise that a file declares: declared three
times too small, white noise would count as unexplained, and each effect would seem to leave more than it does.

An axis is judged over two horizons, whole runs and pieces that start from the measured state, by the geometric mean of
what is left over both. Over a whole run slow effects add up, but where the motion is unstable, as near an upright
pendulum, no model follows it, and one that hardly moves comes closest; over pieces such a model is far off.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.fit import Fit
from rtds_host.diagnosis.left_out import Errors, over_pieces, over_runs, predicted
from rtds_host.diagnosis.problem import Problem

# The residual with an effect over that without it, at most, on held-out runs. A judgement, set with open cases at hand.
MAX_RESIDUAL_RATIO = 0.75
# Gaps on held-out runs within this ratio do not distinguish explanations: as much is no gap.
EQUIVALENT_GAP_RATIO = gaps.LEAST
# Of a channel or a case, what counts as no gap (contract, section 4).
NO_GAP = gaps.LEAST**2 - 1.0


@dataclass(frozen=True)
class HeldOutScore:
    """A fit, the problem that it is a fit of (whole runs or pieces), and its errors on held-out runs over each horizon:
    whole runs and, of an axis, pieces that start from the measured state."""

    fit: Fit
    problem: Problem
    horizons: tuple[Sequence[Errors], ...]

    @classmethod
    def of(cls, problem: Problem, fit: Fit) -> HeldOutScore:
        """The score of a fit."""
        parts = predicted(problem, fit)
        return cls(fit, problem, tuple(filter(None, (over_runs(problem, parts), over_pieces(problem, parts)))))

    @cached_property
    def residual_power(self) -> float:
        """The squared gap beyond noise, of all channels at once: geometric mean over the horizons."""
        return _mean([self._beyond_noise(gaps.pooled(parts)) for parts in self.horizons])

    @cached_property
    def residual_power_by_channel(self) -> Mapping[tuple[int, str], float]:
        """The same of each channel by itself, by horizon and channel."""
        pooled = [(horizon, gaps.pooled(parts)) for horizon, parts in enumerate(self.horizons)]
        return {(horizon, c): self._beyond_noise({c: gap}) for horizon, found in pooled for c, gap in found.items()}

    @property
    def gap(self) -> float:
        """The gap that would leave as much."""
        return math.sqrt(self._noise(gaps.pooled(self.horizons[0])) + self.residual_power)

    def _beyond_noise(self, gap_of: dict[str, float]) -> float:
        """The squared gap of some channels beyond that of noise, at the least what counts as none."""
        noise = self._noise(gap_of)
        return max(gaps.gap(gap_of) ** 2 - noise, NO_GAP * noise)

    def _noise(self, channels: Collection[str]) -> float:
        """The squared gap that the sensors' noise alone makes in some channels, 1 where it is as declared."""
        return sum(self.problem.sample_noise.get(channel, 1.0) ** 2 for channel in channels) / len(channels)


def _mean(values: Collection[float]) -> float:
    """Geometric mean."""
    return math.exp(sum(map(math.log, values)) / len(values))


def pooled(one: HeldOutScore, other: HeldOutScore) -> float:
    """The residual of one explanation over that of another, over all channels at once."""
    return one.residual_power / other.residual_power


def residual_ratio(one: HeldOutScore, other: HeldOutScore) -> float:
    """The residual of one explanation over that of another on held-out runs: the smaller of the ratio over all channels
    at once and of the geometric mean over channels."""
    ratio, powers = pooled(one, other), other.residual_power_by_channel
    mean = _mean([value / powers[key] for key, value in one.residual_power_by_channel.items() if key in powers])
    # What brings one channel closer and opens the whole is no explanation of it. But equivalent gaps of the whole say
    # nothing: a loud channel makes them, and by a sensor that lags the others cannot come closer.
    return min(ratio, mean) if ratio <= EQUIVALENT_GAP_RATIO**2 else ratio


def chosen(found: Mapping[int, list[HeldOutScore]], prior: Callable[[Fit], float]) -> HeldOutScore:
    """The largest explanation whose every effect reduces the residual of held-out runs by enough.

    Looks ahead: j effects may help only together, if they leave at most `MAX_RESIDUAL_RATIO`^j. Of the explanations of
    that many effects that do so and leave equivalent gaps, the most probable one: smaller and more usual effects go
    before large ones that cancel, unless these leave less in many runs. A held-out run counts as one sample of unknown
    size: its blocks of time are off in the same way.

    Parameters
    ----------
    found : explanations by their number of effects; prior : -2 log prior density of a fit.
    """
    count = min(found)
    helpful, best = found[count], min(found[count], key=lambda one: one.gap)
    for n in sorted(found):
        limit = MAX_RESIDUAL_RATIO ** (n - count)
        if n > count and (better := [one for one in found[n] if residual_ratio(one, best) < limit]):
            count, helpful, best = n, better, min(better, key=lambda one: one.gap)
    alike = [one for one in helpful if one.gap <= EQUIVALENT_GAP_RATIO * best.gap]
    return min(alike, key=lambda one: prior(one.fit) + len(one.horizons[0]) * math.log(one.residual_power))
