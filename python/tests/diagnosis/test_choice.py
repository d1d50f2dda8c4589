"""The one criterion where a gap remains: what an effect leaves on runs that it was not fitted to."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rtds_host.diagnosis.choice import MAX_RESIDUAL_RATIO, HeldOutScore, deciding, residual_ratio
from rtds_host.diagnosis.gap import Squares


def judged(*horizons, prior=0.0, z=0.0):
    """An explanation by its gaps in speed and current; with two lists of them over whole runs and over pieces.

    z : by how many sigmas a declared constant was moved."""
    each = horizons if isinstance(horizons[0], tuple) else (horizons,)
    parts = [[{c: Squares(gap**2, 1) for c, gap in zip(("w_l", "i_l"), gaps)}] for gaps in each]
    return HeldOutScore(SimpleNamespace(prior=prior, z=np.array([z])), SimpleNamespace(), tuple(parts))


def taken(found):
    return deciding(found, lambda fit: fit.prior)[-1]


@pytest.mark.parametrize(
    ("one", "other", "left"),
    [
        (judged(2.0, 2.0), judged(3.0, 3.0), 3.0 / 8.0),
        (judged(9.0, 1.05), judged(9.0, 3.0), 0.162),  # the current alone shows it, next to a loud speed
        (judged(10.5, 1.0), judged(9.0, 2.0), 1.32),  # what clearly opens the whole explains no part of it
        (judged(9.2, 1.0), judged(9.0, 2.0), 0.27),  # where the whole is alike the current alone decides
        (judged(1.0, 1.0), judged(1.05, 1.05), 1.0),  # no gap
    ],
)
def test_what_is_left_is_taken_over_all_channels_and_over_each(one, other, left):
    assert residual_ratio(one, other) == pytest.approx(left, rel=0.01)


def test_an_effect_is_taken_that_leaves_little_on_runs_left_out():
    none, good = judged(5.0, 5.0), judged(2.0, 2.0)
    assert taken({0: [none], 1: [good]}) is good
    assert taken({0: [none], 1: [judged(4.9, 4.9)]}) is none


def test_two_effects_that_help_only_together_are_taken_together():
    none, alone, both = judged(5.0, 5.0), judged(4.9, 4.9), judged(2.0, 2.0)
    assert taken({0: [none], 1: [alone], 2: [both]}) is both


def test_a_further_effect_is_not_taken_for_a_little_less():
    one, two = judged(3.0, 3.0), judged(2.9, 2.9)
    assert taken({0: [judged(9.0, 9.0)], 1: [one], 2: [two]}) is one
    assert residual_ratio(two, one) > MAX_RESIDUAL_RATIO


def test_one_explanation_of_that_many_effects_is_enough_to_be_worth_them():
    """The one with the smallest gap is not: of the quiet current it brings nothing closer."""
    loud, both = judged(4.45, 2.0), judged(4.7, 1.4)
    assert loud.gap < both.gap
    none = judged(5.0, 2.0)
    assert residual_ratio(loud, none) > MAX_RESIDUAL_RATIO > residual_ratio(both, none)
    assert taken({0: [none], 1: [loud, both]}) is both


def test_of_explanations_that_leave_as_much_the_one_more_probable_before_is_taken():
    """Two large effects that cancel leave a little less than two small ones."""
    large, small, worse = judged(2.0, 2.0, prior=30.0), judged(2.1, 2.1, prior=20.0), judged(2.5, 2.5, prior=10.0)
    assert taken({0: [judged(9.0, 9.0)], 2: [large, small, worse]}) is small


@pytest.mark.parametrize(("left", "closer"), [(1.0, False), (0.5, True)])
def test_a_much_smaller_residual_outweighs_what_was_more_probable_before(left, closer):
    """It counts as so many samples that an effect's least gain is worth a constant three sigmas off."""
    usual, better = judged(3.0, 3.0, prior=20.0), judged(*[math.sqrt(1.0 + 8.0 * left)] * 2, prior=29.0)
    assert taken({0: [judged(9.0, 9.0)], 1: [usual, better]}) is (better if closer else usual)


def test_constants_that_move_by_three_sigmas_count_as_one_effect():
    moved, declared = judged(3.0, 3.0, z=3.0), judged(3.0, 3.0)
    assert residual_ratio(declared, moved) == pytest.approx(MAX_RESIDUAL_RATIO)
    assert residual_ratio(moved, declared) == pytest.approx(1.0 / MAX_RESIDUAL_RATIO)


def test_an_explanation_that_bends_what_is_declared_does_not_hide_one_with_more_effects():
    """Constants at the ends of their tolerances make up for most of what a spring does."""
    none, bent = judged(9.0, 9.0, prior=5.0), judged(6.0, 6.0, prior=50.0, z=6.0)
    spring = judged(5.5, 5.5, prior=40.0, z=1.0)
    assert residual_ratio(spring, bent) < MAX_RESIDUAL_RATIO < spring.residual_power / bent.residual_power
    assert taken({0: [none], 1: [bent], 2: [spring]}) is spring


def test_of_explanations_that_leave_as_much_one_that_is_not_worth_it_is_not_taken():
    """The more probable one leaves 0.84 of the squared gap, the better one 0.7."""
    none, better, usual = judged(9.0, 9.0), judged(7.55, 7.55, prior=20.0), judged(8.25, 8.25, prior=10.0)
    assert residual_ratio(better, none) < MAX_RESIDUAL_RATIO < residual_ratio(usual, none)
    assert taken({0: [none], 1: [better, usual]}) is better


def test_an_explanation_that_is_closer_over_whole_runs_alone_is_not_taken():
    """A model that hardly moves is nearest to an unstable motion over a whole run, and far off over a piece."""
    none, friction = judged((24.0, 24.0), (4.0, 4.0)), judged((16.0, 16.0), (3.0, 3.0))
    still = judged((8.0, 8.0), (6.0, 6.0))
    assert taken({0: [none], 1: [friction], 2: [still]}) is friction
