"""What chance alone does: how far noise reaches, how often a value repeats, how many samples say something; all from
one probability.
"""

from __future__ import annotations

import math
from statistics import NormalDist

# Probability: that noise alone passes for something in a sound channel.
FALSE_ALARM = 1e-6
# A handful, as a share of the samples: what fewer do is an accident, what more do is how the channel or its logger
# works.
FEW_SHARE = 0.01
# The larger part: more is so than is not.
MAJORITY = 0.5
# A tenth: a part of a thing that is slight against it.
MINOR_SHARE = 0.1
# What is of one size is so to a fifth where little else is wrong; a factor that is missed by more is a gain.
EQUAL_WITHIN = 0.2
# An outlier is so many times what is next to it.
CLEAR_RATIO = 3.0


def sigmas(count: int = 1) -> float:
    """Standard deviations beyond which no one of `count` normal samples lies, to either side."""
    return -NormalDist().inv_cdf(0.5 * FALSE_ALARM / max(count, 1))


def in_a_row(share: float, count: int = 1) -> float:
    """How often in a row what happens to a share of the samples does not happen by chance at any of `count` places."""
    return (
        math.log(FALSE_ALARM / max(count, 1)) / math.log(share)
        if 0.0 < share < 1.0
        else math.inf
        if share >= 1.0
        else 1.0
    )


def few(count: int) -> float:
    """Most of `count` samples that are a handful: one always is."""
    return max(1.0, FEW_SHARE * count)


# Numerical: lower quarter, median and mean of the magnitude of a normal variable of unit variance.
QUARTER_OF_NORMAL, MEDIAN_OF_NORMAL, MEAN_OF_NORMAL = (
    NormalDist().inv_cdf(0.625),
    NormalDist().inv_cdf(0.75),
    math.sqrt(2.0 / math.pi),
)
# Standard deviations to either side of 90 % of a normal (contract: 90 % intervals).
Z90 = 1.6448536269514722
# Numerical: correlation of what follows at all: most of it is explained.
CORRELATED = math.sqrt(MAJORITY)
# One sample that is so many standard deviations off is more than noise.
SIGNIFICANT = sigmas()
# Fewest samples that say anything: so many lie on one side of their median as seldom.
FEWEST_SAMPLES = math.ceil(in_a_row(0.5))
# Correlation of what is followed closely: all that differs is noise, of a motion that is just more than it.
CLOSELY_CORRELATED = SIGNIFICANT / math.hypot(1.0, SIGNIFICANT)
