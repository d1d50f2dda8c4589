"""The likelihood: white noise of known size, and a model error of unknown size in each stretch of time.

A group is one channel in one block of time: n residuals in units of the sensor's noise, mean square V. Where the model
is exact, V is 1 but for chance, and the group counts as n exact samples. Where V is far above 1, the model's error
speaks and not the sensor's noise: the group then counts as one sample of unknown size. With V0, the largest V that
noise alone makes,

    -2 log L = sum over groups of  n V                             where V <= V0,
                                   n V0 + b ln(1 + n (V - V0) / b) elsewhere;   V0 = 1 + 2 sqrt(2 / n)

with b = 1. A group may also be a channel of a whole run, whose b blocks share one unknown size: that is least squares
with a scale of its own for each channel and run, which finds what acts in few blocks and strongly, a delay.

The logarithm does not change when the noise is declared otherwise: an explanation that halves the residuals gains the
same whatever their unit, so sizes and names do not depend on the declared noise while V is far above 1. It is bounded
from above by its tangent in V,
so that least squares with the weight 1 / (1 + n (V - V0) / b) on a group's rows, renewed
after each step, lowers the cost in each step (a majorant: D. R. Hunter, K. Lange, The American Statistician 58, 2004).
The majorant is steeper than the logarithm, so its steps are too short. `Likelihood.curvature` is what the logarithm
takes off its Hessian.

References: J. W. Miller, D. B. Dunson, JASA 114, 2019 (inference at the scale of the model's error); P. G. Bissiri,
C. C. Holmes, S. G. Walker, J. R. Stat. Soc. B 78, 2016.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from functools import cached_property

import numba
import numpy as np

# Numerical: mean squares of a group that noise alone makes, in standard deviations sqrt(2 / n) of its chi-square.
CHANCE_SIGMAS = 2.0
# Numerical: the share of what makes a group's Hessian singular that is taken off it for the logarithm's curvature.
CURVATURE_SHARE = 0.8
# Numerical: products of residuals whose mean says something.
FEWEST_PRODUCTS = 16


class Likelihood:
    """The likelihood with the weight of each group as it was at some residuals.

    Parameters
    ----------
    groups : (N,) the group of each residual, 0 to m - 1, each with at least one residual.
    samples : (m,) how many samples of unknown size each group is worth, b.
    weight : (m,) weight of the rows of each group; None: white noise alone.
    constant : (m,) what the tangent of each group's cost has beyond the weighted squares.
    sizes : (m,) rows of each group, where they are known.
    variance : of the white noise, in units of the sensors'.
    """

    def __init__(
        self,
        groups: np.ndarray,
        samples: np.ndarray,
        weight: np.ndarray | None = None,
        constant: np.ndarray | None = None,
        sizes: np.ndarray | None = None,
        variance: float = 1.0,
    ):
        self.groups, self.samples, self.count, self.variance = groups, samples, len(groups), variance
        self.sizes = np.bincount(groups).astype(float) if sizes is None else sizes
        self.weight = weight
        self.constant = np.zeros(len(self.sizes)) if constant is None else constant

    @cached_property
    def root(self) -> np.ndarray | None:
        """Square root of each residual's weight, (N,); None for white noise alone."""
        return None if self.weight is None else np.sqrt(self.weight)[self.groups]

    @cached_property
    def log(self) -> np.ndarray:
        """What each residual's cost has beyond its weighted square, (N,)."""
        return (self.constant / self.sizes)[self.groups]

    def whiten(self, column: np.ndarray) -> np.ndarray:
        """A column (N,) times the square root of the weights, in the type it comes in; itself without weights."""
        return column if self.root is None else column * self.root.astype(column.dtype)

    def whitened(self, columns: Sequence[np.ndarray], kind: type = np.float32) -> np.ndarray:
        """Several weighted columns, (N,) float32 each: (N, p), each in one piece. They are weighted in float32, also
        where they are wanted in another `kind`.
        """
        out: np.ndarray = np.empty((self.count, len(columns)), kind, order="F")
        self.whiten_into(columns, list(out.T))
        return out

    def whiten_into(self, columns: Sequence[np.ndarray], out: Sequence[np.ndarray]) -> None:
        """Weight columns (N,) each into others."""
        root = None if self.root is None else self.root.astype(np.float32)
        for column, into in zip(columns, out, strict=True):
            if root is None:
                into[:] = column
            else:
                multiply_into(column, root, into)

    def cost(self, residual: np.ndarray) -> float:
        """-2 log likelihood of residuals (N,) by the tangent, at least that of the likelihood itself; infinite where a
        replay ran away."""
        squares = _squares(self.groups, residual, len(self.sizes))
        with np.errstate(over="ignore", invalid="ignore"):
            cost = float(np.sum(squares if self.weight is None else squares * self.weight) + self.constant.sum())
        return cost if math.isfinite(cost) else math.inf

    def exact_cost(self, residual: np.ndarray) -> float:
        """-2 log likelihood of residuals (N,) itself, which the tangent meets where it is `estimated`; infinite where a
        replay ran away."""
        _, _, costs = self._by_group(residual)
        cost = float(costs.sum())
        return cost if math.isfinite(cost) else math.inf

    def with_variance(self, variance: float) -> Likelihood:
        """The likelihood of white noise alone, of another variance, in units of the sensors', to estimate another
        from: groups then count as exact up to that."""
        return Likelihood(self.groups, self.samples, sizes=self.sizes, variance=variance)

    def blocks(self, residual: np.ndarray, blocks: np.ndarray, count: int) -> np.ndarray:
        """The same by block of time, (count,); `blocks` (N,) says which block a residual is in."""
        white = self.whiten(residual)
        return np.bincount(blocks, white * white + self.log, minlength=count)

    def estimated(self, residual: np.ndarray) -> Likelihood:
        """The likelihood with the tangent at these residuals (N,), where its cost is exact."""
        square, unknown, costs = self._by_group(residual)
        with np.errstate(over="ignore", invalid="ignore"):  # of a replay that ran away
            constant = costs - self.sizes * square / unknown
        weight = 1.0 / (unknown * self.variance)
        return Likelihood(self.groups, self.samples, weight, constant, self.sizes, self.variance)

    def _by_group(self, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of each group (m,): the mean square V of residuals (N,) over the variance, 1 + n (V - V0) / b or 1 where
        V <= V0, and -2 log likelihood."""
        square, unknown, within = _mean_squares(self.groups, residual, self.sizes, self.samples, self.variance)
        return square, unknown, within + self.samples * np.log(unknown)

    def curvature(self, jacobian: np.ndarray, white: np.ndarray) -> np.ndarray:
        """What the logarithm takes off the Hessian of the weighted squares, (p, p).

        Its second derivative takes w (J' r)(J' r)' / (r' r), about twice, off w J' J of each group of unknown size.
        Once makes that singular where parameters change a group's residuals by a common factor, and twice indefinite.
        So `CURVATURE_SHARE` of it once is taken off.

        Parameters
        ----------
        jacobian : (N, p) derivatives, and white : (N,) residuals, both times the square root of the weights.
        """
        if self.weight is None:
            return np.zeros((jacobian.shape[1],) * 2)
        products = _products(self.groups, white, jacobian.T, len(self.sizes))
        squares = np.where(self.weight < 1.0 / self.variance, _squares(self.groups, white, len(self.sizes)), np.inf)
        return (products * (CURVATURE_SHARE / squares)) @ products.T

    def misfit(self, residual: np.ndarray) -> float:
        """Weighted sum of squares of residuals (N,), over the variance, beyond what noise alone makes: less than one a
        sample of unknown size; 0 where only noise is left.
        """
        n = self.sizes
        square = _squares(self.groups, residual, len(n)) / (n * self.variance)
        over = n * np.maximum(square - 1.0 - CHANCE_SIGMAS * np.sqrt(2.0 / n), 0.0)
        return float(np.sum(over / (1.0 + over / self.samples)))


@numba.njit(cache=True, nogil=True, error_model="numpy")
def multiply_into(column, weights, into):
    """Fill in a column (N,) times weights (N,), computed in the wider type of the two."""
    for k in range(len(column)):
        into[k] = column[k] * weights[k]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _squares(groups, residual, count):
    """Sum of the squares of residuals (N,) in each of `count` groups (N,), (count,). Rows of a group are neighbours."""
    found = np.zeros(count)
    if len(residual) == 0:
        return found
    total, at = 0.0, groups[0]
    for k in range(len(residual)):
        if groups[k] != at:
            found[at] += total
            total, at = 0.0, groups[k]
        total += residual[k] * residual[k]
    found[at] += total
    return found


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _mean_squares(groups, residual, sizes, samples, variance):
    """Of each group (m,): the mean square V of residuals (N,) over the variance, 1 + n (V - V0) / b or 1 where V <= V0,
    and n V or n V0, whichever is less."""
    square = _squares(groups, residual, len(sizes))
    unknown, within = np.empty(len(sizes)), np.empty(len(sizes))
    for k in range(len(sizes)):
        n = sizes[k]
        square[k] /= n * variance
        largest = 1.0 + CHANCE_SIGMAS * math.sqrt(2.0 / n)
        over = square[k] - largest
        unknown[k] = 1.0 + n * over / samples[k] if over > 0.0 else 1.0
        within[k] = n * largest if over > 0.0 else n * square[k]
    return square, unknown, within


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _products(groups, white, columns, count):
    """Sum of a column (N,) times each of others (p, N) in each group, (p, count). Four at a time, since a sum waits for
    the one before."""
    found = np.zeros((len(columns), count))
    if len(white) == 0:
        return found
    for first in range(0, len(columns), 4):
        last = len(columns) - 1
        a, b = columns[first], columns[min(first + 1, last)]
        c, d = columns[min(first + 2, last)], columns[min(first + 3, last)]
        sums, at = (0.0, 0.0, 0.0, 0.0), groups[0]
        for k in range(len(white) + 1):
            if k == len(white) or groups[k] != at:
                for j in range(min(4, len(columns) - first)):
                    found[first + j, at] += sums[j]
                if k == len(white):
                    break
                sums, at = (0.0, 0.0, 0.0, 0.0), groups[k]
            one = white[k]
            sums = (sums[0] + one * a[k], sums[1] + one * b[k], sums[2] + one * c[k], sums[3] + one * d[k])
    return found


def correlated(residual: np.ndarray, channels: np.ndarray, sigmas: float, differences: Collection[int] = ()) -> bool:
    """Whether residuals (N,), in order of time in each channel, are correlated or biased: no white noise of any size.

    In each channel the mean, and the mean product of residuals l rows apart for l = 1, 2, 3, ..., 8, 16, 32, ..., are
    compared with their own standard errors, since some stretches are louder than others.

    Parameters
    ----------
    channels : (N,) the channel of each residual; sigmas : standard errors that count as more than chance; differences :
        channels whose residuals are differences of neighbouring samples. White noise makes these correlated at a lag
        of one row, by -1/2, and at no other.
    """
    for channel in np.unique(channels):
        mine = residual[channels == channel]
        lags = [*range(2 if channel in differences else 1, 9), *(2**k for k in range(4, 20))]
        for products in (mine, *(mine[lag:] * mine[:-lag] for lag in lags if len(mine) - lag >= FEWEST_PRODUCTS)):
            if len(products) >= FEWEST_PRODUCTS:
                error = float(products.std(ddof=1)) / np.sqrt(len(products))
                if abs(float(products.mean())) > sigmas * error:
                    return True
    return False
