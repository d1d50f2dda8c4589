"""What a gain of likelihood is worth where no explanation is exact.

Two explanations are compared block by block of time. The gain of log likelihood G, the sum of g_b over B blocks, is judged
against its own scatter (Q. H. Vuong, Econometrica 57, 1989): with t = G / (sqrt(B) sd(g)), no more than exp(t^2 / 2) to one
can be believed of it, however large it is. What is missed steadily, nearly wherever it acts, is there; what is missed in a
few stretches stands in for something else.
"""

from __future__ import annotations

import math

import numpy as np

from rtds_host.diagnosis.fit import Fit
from rtds_host.diagnosis.problem import Problem


def compared(problem: Problem, fit: Fit, other: Fit) -> tuple[float, float]:
    """Gain of log likelihood of `fit` over `other`, and that gain over its scatter between blocks of time."""
    blocks = [f.noise.blocks(f.residual, problem.blocks, problem.block_count) for f in (other, fit)]
    used = np.bincount(problem.blocks, minlength=problem.block_count) > 0
    gains = 0.5 * (blocks[0] - blocks[1])[used]
    scatter = math.sqrt(len(gains)) * float(gains.std())
    gain = float(gains.sum())
    return gain, gain / scatter if scatter > 0 else 0.0


def believed(gain: float, t: float) -> float:
    """Log odds that a gain with such scatter is worth, of its sign."""
    return math.copysign(min(abs(gain), 0.5 * t * t), gain)
