"""The choice between explanations: by their residuals on held-out runs (cross-validation).

One criterion, wherever a gap remains: on held-out runs each effect must reduce the residual to at most
`MAX_RESIDUAL_RATIO` of what it is without the effect (contract, section 5). An effect that does not is not included,
however large its likelihood. The residual is G^2 - 1, the squared gap minus that of noise. It is computed over all
channels at once, and as the geometric mean over channels. So a channel with a large residual does not hide an effect
that only a channel with a small one shows.

What a file declares of constants is evidence as well. A ratio within three sigmas of a tolerance is no effect, and one
beyond them is (contract, section 2). So constants that are moved by three sigmas, together, count as much as one
effect. Else an explanation whose constants lie at the ends of their tolerances would hide the effects that they make up
for.

The unit of the gap is here the noise that samples show (`gate.sample_noise`), so that the choice does not depend on the
noise that a file declares. If that were three times too small, white noise would count as unexplained, and each effect
would seem to reduce the residual by a smaller share.

For an axis there are two prediction horizons: whole runs, and pieces that start from the measured state. Its residual
is the geometric mean over both. Over a whole run slow effects accumulate. But where the motion is unstable, as that of
an upright pendulum, no model predicts a whole run, and one that hardly moves has the smallest error. Over pieces the
error of such a model is large.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.fit import Fit
from rtds_host.diagnosis.left_out import (
    Errors,
    Prediction,
    as_fitted,
    over_pieces,
    over_runs,
    predicted,
    predicted_in_few_steps,
)
from rtds_host.diagnosis.nuisances import SIGMAS
from rtds_host.diagnosis.problem import Problem

# The residual with an effect over that without it, at most, on held-out runs. A heuristic, set on cases whose causes
# were known (docs/decisions.md).
MAX_RESIDUAL_RATIO = 0.8
# As how many samples of unknown size a residual counts next to priors: the least gain of an effect in its logarithm is
# worth a constant that stays as declared in place of moving by three sigmas.
SAMPLES = SIGMAS**2 / -math.log(MAX_RESIDUAL_RATIO)
# Explanations are equivalent if the ratio of their gaps on held-out runs is at most this. A gap that is at most as many
# times that of noise counts as none.
EQUIVALENT_GAP_RATIO = gaps.LEAST
# The squared gap beyond that of noise that still counts as no gap (contract, section 4).
NO_GAP = gaps.LEAST**2 - 1.0


@dataclass(frozen=True)
class HeldOutScore:
    """A fit, the problem that it solves (over whole runs or over pieces), and its errors on held-out runs.

    horizons : errors by channel of each held-out run; over whole runs and, of an axis, over pieces that start from the
    measured state. converged : False where a fit without a run is not, which makes the score too good.
    """

    fit: Fit
    problem: Problem
    horizons: tuple[Sequence[Errors], ...]
    converged: bool = True

    @classmethod
    def of(cls, problem: Problem, fit: Fit) -> HeldOutScore:
        """The score of a fit."""
        return cls._of_parts(problem, fit, predicted(problem, fit))

    @classmethod
    def in_few_steps(cls, problem: Problem, fit: Fit) -> HeldOutScore:
        """The score with fits without a run by a few steps each, at a fraction of the cost."""
        parts = predicted_in_few_steps(problem, fit)
        return replace(cls._of_parts(problem, fit, parts), converged=all(one.converged for one in parts))

    @classmethod
    def in_sample(cls, problem: Problem, fit: Fit) -> HeldOutScore:
        """The score that a fit would have if no run had been held out: a lower bound but for chance, at a fraction
        of the cost.
        """
        return cls._of_parts(problem, fit, as_fitted(problem, fit))

    @classmethod
    def _of_parts(cls, problem: Problem, fit: Fit, parts: Sequence[Prediction]) -> HeldOutScore:
        return cls(fit, problem, tuple(filter(None, (over_runs(problem, parts), over_pieces(problem, parts)))))

    @cached_property
    def residual_power(self) -> float:
        """The residual: the squared gap beyond that of noise, over all channels; geometric mean over the horizons."""
        return _mean([_beyond_noise(gaps.pooled(parts)) for parts in self.horizons])

    @cached_property
    def residual_power_by_channel(self) -> Mapping[tuple[int, str], float]:
        """The same for each channel alone: (horizon, channel) -> residual."""
        pooled = [(horizon, gaps.pooled(parts)) for horizon, parts in enumerate(self.horizons)]
        return {(horizon, c): _beyond_noise({c: gap}) for horizon, found in pooled for c, gap in found.items()}

    @property
    def gap(self) -> float:
        """The gap over whole runs that gives this residual: the root of it plus the squared gap of noise."""
        return math.sqrt(1.0 + self.residual_power)


def _beyond_noise(gap_of: dict[str, float]) -> float:
    """The squared gap of some channels beyond that of noise, 1; at least what counts as no gap."""
    return max(gaps.gap(gap_of) ** 2 - 1.0, NO_GAP)


def _mean(values: Collection[float]) -> float:
    """Geometric mean."""
    return math.exp(sum(map(math.log, values)) / len(values))


def pooled(one: HeldOutScore, other: HeldOutScore) -> float:
    """The residual of one explanation over that of another, over all channels at once."""
    return one.residual_power / other.residual_power


def residual_ratio(one: HeldOutScore, other: HeldOutScore) -> float:
    """The residual of one explanation over that of another on held-out runs: the smaller of the ratio over all channels
    at once and of the geometric mean over channels, times what declared constants moved further are worth."""
    ratio, powers = pooled(one, other), other.residual_power_by_channel
    mean = _mean([value / powers[key] for key, value in one.residual_power_by_channel.items() if key in powers])
    # An effect that reduces the residual of some channels but raises the total is no explanation. Equivalent totals are
    # no evidence against it: a channel with a large residual dominates them, such as that of a sensor with a lag.
    return (min(ratio, mean) if ratio <= EQUIVALENT_GAP_RATIO**2 else ratio) * moved(one, other)


def moved(one: HeldOutScore, other: HeldOutScore) -> float:
    """The factor of a residual that one explanation is worth less for moving declared constants further than another:
    what a file declares is evidence as runs are."""
    return math.exp(float(one.fit.z @ one.fit.z - other.fit.z @ other.fit.z) / SAMPLES)


def posterior(one: HeldOutScore, prior: Callable[[Fit], float]) -> float:
    """-2 log posterior density of an explanation but for a constant; prior : -2 log prior density of a fit."""
    return prior(one.fit) + SAMPLES * math.log(one.residual_power)


def deciding(found: Mapping[int, list[HeldOutScore]], prior: Callable[[Fit], float]) -> list[HeldOutScore]:
    """The supported explanations that decide the choice, fewest effects first; the last one is chosen.

    Some effects reduce the residual only together. So j further effects are supported if they reduce it to less than
    `MAX_RESIDUAL_RATIO`^j of that of the most probable explanation with fewer effects. Of the supported explanations
    with that many effects, the most probable one is chosen. Small and common effects are therefore preferred to large
    ones that cancel, unless the latter leave a smaller residual.

    Parameters
    ----------
    found : number of effects -> explanations; prior : -2 log prior density of a fit.
    """
    count = min(found)
    chain = [min(found[count], key=lambda one: posterior(one, prior))]
    for n in sorted(found):
        limit = MAX_RESIDUAL_RATIO ** (n - count)
        if n > count and (larger := [one for one in found[n] if residual_ratio(one, chain[-1]) < limit]):
            count = n
            chain.append(min(larger, key=lambda one: posterior(one, prior)))
    return chain
