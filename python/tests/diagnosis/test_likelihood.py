"""The likelihood whose model error is of unknown size: exact where only noise is left, free of the declared noise where
more is."""

import numpy as np
import pytest

from rtds_host.diagnosis.likelihood import CURVATURE_SHARE, Likelihood, correlated

GROUPS = np.repeat(np.arange(20), 50)
ONE = np.ones(20)


def noise(seed=1, size=1.0):
    return size * np.random.default_rng(seed).standard_normal(len(GROUPS))


def exact(residual, samples=ONE):
    return Likelihood(GROUPS, samples).exact_cost(residual)


def test_residuals_no_larger_than_their_noise_cost_their_squares():
    residual = noise()
    assert exact(residual) == pytest.approx(residual @ residual)


@pytest.mark.parametrize("samples", [ONE, 5.0 * ONE], ids=["a block", "a run of five blocks"])
def test_what_an_explanation_gains_does_not_hang_on_the_declared_noise_where_much_is_left(samples):
    """Halving residuals of a hundred noises gains the same if the noise is declared three times as large."""
    large, small = noise(size=100.0), noise(size=50.0)
    gain = exact(large, samples) - exact(small, samples)
    assert exact(large / 3.0, samples) - exact(small / 3.0, samples) == pytest.approx(gain, rel=0.01)
    assert gain == pytest.approx(samples.sum() * np.log(4.0), rel=0.15)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("worst", [1e200, np.inf, np.nan])
def test_a_replay_that_runs_away_costs_more_than_any_and_warns_of_nothing(worst):
    """A cost that is no number would be the smallest of several."""
    ran_away = noise()
    ran_away[7] = worst
    assert exact(ran_away) == np.inf
    assert Likelihood(GROUPS, ONE).cost(ran_away) == np.inf


@pytest.mark.parametrize(("size", "left"), [(1.0, 0.0), (100.0, 20.0)], ids=["noise alone", "a hundred noises"])
def test_a_misfit_is_one_sample_a_group_where_much_is_left_and_none_where_only_noise_is(size, left):
    assert Likelihood(GROUPS, ONE).misfit(noise(size=size)) == pytest.approx(left, rel=0.01, abs=1.0)


def test_weights_bound_the_cost_from_above_and_touch_it_where_they_were_taken():
    """So each least squares step with them lowers the cost itself."""
    at = Likelihood(GROUPS, ONE).estimated(noise(size=7.0))
    assert at.cost(noise(size=7.0)) == pytest.approx(exact(noise(size=7.0)))
    for seed in range(2, 12):
        other = noise(seed, size=float(seed))
        assert at.cost(other) >= exact(other) - 1e-9


def test_with_noise_of_another_variance_residuals_count_in_its_unit():
    """Cost, weights and curvature are those of residuals that are as many times smaller, and of derivatives too."""
    residual, column = noise(size=7.0), noise(3)[:, None]
    one, other = (
        Likelihood(GROUPS, ONE).with_variance(v).estimated(r) for v, r in ((9.0, residual), (1.0, residual / 3))
    )
    assert one.exact_cost(residual) == pytest.approx(other.exact_cost(residual / 3))
    assert one.cost(2.0 * residual) == pytest.approx(other.cost(2.0 * residual / 3))
    assert 3.0 * one.whiten(column[:, 0]) == pytest.approx(other.whiten(column[:, 0]))
    curvatures = [
        at.curvature(at.whitened(column.T, float), at.whiten(r)) for at, r in ((one, residual), (other, residual / 3))
    ]
    assert curvatures[0] * 9.0 == pytest.approx(curvatures[1], rel=1e-5)
    within = Likelihood(GROUPS, ONE).with_variance(100.0).estimated(residual)
    assert within.exact_cost(residual) == pytest.approx(residual @ residual / 100.0)
    assert not within.curvature(column, within.whiten(residual)).any()
    assert one.misfit(residual) == pytest.approx(other.misfit(residual / 3)) != 0.0
    assert within.misfit(residual) == 0.0


def slopes_and_curvature(residual, jacobian):
    """Derivatives (N, p) with the weights of a residual (N,), and what the logarithm takes off their Hessian."""
    at = Likelihood(GROUPS, ONE).estimated(residual)
    weighted = jacobian * at.whiten(np.ones(len(residual)))[:, None]
    return weighted, at.curvature(weighted, at.whiten(residual))


def test_the_logarithm_takes_off_less_than_its_second_derivative_and_leaves_the_hessian_positive_definite():
    """A parameter that scales all that is left is the worst: half the cost is b ln|x| there, which bends down."""
    residual, step = noise(size=30.0), 1e-3
    weighted, curvature = slopes_and_curvature(residual, residual[:, None])
    squares = float((weighted.T @ weighted)[0, 0])
    half = [0.5 * exact(residual * (1.0 + k * step)) for k in (-1, 0, 1)]
    second = (half[0] - 2.0 * half[1] + half[2]) / step**2
    assert second < 0.0 < squares - curvature[0, 0] < squares
    assert curvature[0, 0] == pytest.approx(CURVATURE_SHARE * squares)


def test_the_logarithm_takes_nothing_off_where_a_parameter_leaves_the_size_of_every_group():
    residual = noise(size=30.0)
    across = np.random.default_rng(3).standard_normal(len(GROUPS))
    sums = [np.bincount(GROUPS, residual * one) for one in (across, residual)]
    across -= (sums[0] / sums[1])[GROUPS] * residual
    weighted, curvature = slopes_and_curvature(residual, across[:, None])
    assert abs(curvature[0, 0]) < 1e-9 * float((weighted.T @ weighted)[0, 0])


def test_the_logarithm_takes_nothing_off_where_only_noise_is_left():
    assert not slopes_and_curvature(noise(size=0.9), np.ones((len(GROUPS), 2)))[1].any()
    assert not Likelihood(GROUPS, ONE).curvature(np.ones((len(GROUPS), 2)), noise()).any()


def test_a_column_is_weighted_as_the_residual_is():
    at = Likelihood(GROUPS, ONE).estimated(noise(size=30.0))
    column = noise(3).astype(np.float32)
    assert np.allclose(at.whitened([column])[:, 0], at.whiten(column))
    assert float(at.whiten(noise(4)) @ at.whiten(noise(4))) == pytest.approx(at.cost(noise(4)) - at.log.sum())


@pytest.mark.parametrize("period", [5, 40, 500], ids=["a few rows", "a part of a block", "many blocks"])
def test_residuals_that_follow_one_another_are_correlated(period):
    """Whatever the time in which they come and go; a sound channel next to does not hide it."""
    wave = np.sin(np.arange(len(GROUPS)) * 2.0 * np.pi / period)
    channels = np.repeat([0, 1], len(GROUPS))
    assert correlated(np.concatenate([noise(2), noise() + wave]), channels, 4.9)


def test_white_noise_is_not_correlated_however_loud_and_wherever_it_is_louder():
    channels = np.zeros(len(GROUPS), int)
    assert not correlated(noise(size=40.0), channels, 4.9)
    assert not correlated(noise() * (1.0 + 9.0 * (GROUPS % 4 == 0)), channels, 4.9)


def test_differences_of_white_noise_are_not_correlated_and_those_of_a_wave_are():
    """Of angles and poses residuals are displacements, which share a sample with their neighbours."""
    white, wave = noise(), 9.0 * np.sin(np.arange(len(GROUPS)) * 2.0 * np.pi / 40)
    channels = np.zeros(len(GROUPS) - 1, int)
    assert correlated(np.diff(white), channels, 4.9)
    assert not correlated(np.diff(white), channels, 4.9, [0])
    assert correlated(np.diff(white + wave), channels, 4.9, [0])


def test_sums_over_groups_are_those_of_each_column_and_of_nothing_nothing():
    """Five columns, one more than are summed at a time, and groups of one row and of several."""
    rng = np.random.default_rng(4)
    groups, residual, jacobian = np.array([0, 1, 1, 1, 2, 2]), 30.0 * rng.normal(size=6), rng.normal(size=(6, 5))
    noise = Likelihood(groups, np.ones(3)).estimated(residual)
    white = noise.whiten(residual)
    products = np.array([np.bincount(groups, white * column) for column in jacobian.T])
    squares = np.where(noise.weight < 1.0, np.bincount(groups, white * white), np.inf)
    expected = (products * (CURVATURE_SHARE / squares)) @ products.T
    assert np.any(expected != 0.0)
    assert noise.curvature(jacobian, white) == pytest.approx(expected, rel=1e-12)
    none = Likelihood(np.empty(0, int), np.empty(0), np.empty(0))
    assert none.cost(np.empty(0)) == 0.0
    assert np.array_equal(none.curvature(np.empty((0, 5)), np.empty(0)), np.zeros((5, 5)))
