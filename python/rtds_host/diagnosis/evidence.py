"""Evidence between two explanations where neither is exact.

They are compared block by block of time. The odds of one block are limited to `CONVINCING` to one: larger ones follow
from the models' error. The gain of log likelihood G, the sum of the gains g_b of B blocks, is compared with its own
scatter (Q. H. Vuong, Econometrica 57, 1989): with t = G / (sqrt(B) sd(g)), the odds are at most exp(t^2 / 2) to one. A
gain in nearly all blocks is evidence for an effect. A gain in a few blocks is evidence of another cause.

An effect must also reduce the squared gap by at least what counts as a gap. Next to a residual it must reduce it by
half of that residual, or the likelihood's excess by a tenth: any form reduces a large residual by a little. Where the
residuals are no larger than their noise, the likelihood is exact (`attribution`).
"""

from __future__ import annotations

import math

import numpy as np

from rtds_host.diagnosis.fit import Fit
from rtds_host.diagnosis.gap import LEAST
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.thresholds import MAJORITY, MINOR_SHARE

# Probability: odds at which one block of time, and a comparison of two explanations, convinces.
CONVINCING = 20.0
# Of the squared gap: what opens one of 1.1 where there is none (contract, section 4).
MIN_GAP_REDUCTION = LEAST**2 - 1.0


def enough_to_extend(without: float, gap: float) -> bool:
    """Whether an effect that lowers the gap from `without` to `gap` reduces it by what counts as a gap and a tenth of
    the residual: enough to continue with it."""
    return without**2 - gap**2 >= max(MIN_GAP_REDUCTION, MINOR_SHARE * (gap**2 - 1.0))


def enough_to_include(without: float, gap: float, share: float = 0.0) -> bool:
    """Whether an effect that lowers the gap from `without` to `gap` reduces it by more than a substitute for the
    residual would; `share`: by how much it reduces the likelihood's excess over white noise, of that without it."""
    reduction = without**2 - gap**2
    # It closes the gap, or the larger part of it.
    if without >= LEAST > gap and reduction >= MAJORITY * (without**2 - 1.0):
        return True
    # An effect that reduces less than half of the residual could be replaced by any of a hundred forms.
    return reduction >= MIN_GAP_REDUCTION and (reduction >= MAJORITY * (gap**2 - 1.0) or share >= MINOR_SHARE)


def excess(problem: Problem, fit: Fit) -> float:
    """By how much a fit's -2 log likelihood exceeds that of white noise, whose mean is 1 a residual; 0 at the least."""
    return max(fit.noise.cost(fit.residual) - problem.size, 0.0)


def likelihood_gain(problem: Problem, fit: Fit, other: Fit) -> tuple[float, float]:
    """Gain of log likelihood of `fit` over `other`, and that gain over its scatter between blocks of time."""
    return _summed(problem, *(f.noise.blocks(f.residual, problem.blocks, problem.block_count) for f in (fit, other)))


def gap_gain(problem: Problem, fit: Fit, other: Fit) -> tuple[float, float]:
    """The same by the gap's measure: white noise as large as all that `fit` leaves.

    A discrepancy that grows over a run or comes in strokes is no noise of one size: by it a likelihood may prefer in
    most blocks what replays every run worse.
    """
    size, count = max(float(np.mean(fit.residual**2)), 1.0), problem.block_count
    return _summed(problem, *(np.bincount(problem.blocks, f.residual**2 / size, count) for f in (fit, other)))


def _summed(problem: Problem, fit: np.ndarray, other: np.ndarray) -> tuple[float, float]:
    """Gain of log likelihood and that over its scatter, from -2 log likelihoods by block (blocks,)."""
    used = np.bincount(problem.blocks, minlength=problem.block_count) > 0
    most = math.log(CONVINCING)
    gains = np.clip(0.5 * (other - fit)[used], -most, most)
    gain = float(gains.sum())
    # At least the scatter of one block that says nothing: where all blocks convince equally there would be none.
    return gain, gain / math.sqrt(float(((gains - gains.mean()) ** 2).sum()) + 1.0)


def log_odds(gain: float, t: float) -> float:
    """Log odds by a gain of log likelihood, no more than its scatter allows: min(|gain|, t^2 / 2), with its sign."""
    return math.copysign(min(abs(gain), 0.5 * t * t), gain)


def distinguishable(gain: float, t: float, share: float, blocks: int, least: float = 0.0) -> bool:
    """Whether an explanation is distinguishable from another, which has another effect in one's place.

    gain, t : as of `likelihood_gain`; share : by how much it reduces the other's excess over white noise, of that, and
    at least `least`; blocks : of time. A form that is not quite the robot's own errs alike in every block, which no
    scatter between blocks shows. But of a residual that is spread over so many blocks any form reduces one block's
    share by chance.
    """
    return log_odds(gain, t) >= math.log(CONVINCING) and share * blocks >= 1.0 and share >= least
