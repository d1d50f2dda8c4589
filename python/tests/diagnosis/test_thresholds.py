"""What chance alone does: thresholds and sample counts follow from one probability."""

import numpy as np
import pytest

from rtds_host.diagnosis.thresholds import (
    CLOSELY_CORRELATED,
    FALSE_ALARM,
    FEWEST_SAMPLES,
    MEAN_OF_NORMAL,
    MEDIAN_OF_NORMAL,
    SIGNIFICANT,
    few,
    in_a_row,
    sigmas,
)


@pytest.mark.parametrize("count", [1, 1000, 1_000_000])
def test_no_sample_of_noise_lies_beyond_what_chance_reaches(count):
    noise = np.random.default_rng(4).standard_normal(count)
    assert np.abs(noise).max() < sigmas(count)


def test_more_samples_reach_farther():
    assert SIGNIFICANT == sigmas(1) < sigmas(1000) < sigmas(1_000_000)


def test_what_happens_to_half_of_the_samples_tells_the_fewest_that_say_anything():
    assert 0.5**FEWEST_SAMPLES <= FALSE_ALARM < 0.5 ** (FEWEST_SAMPLES - 1)


def test_what_happens_often_may_happen_often_in_a_row():
    assert in_a_row(0.01, 1000) < in_a_row(0.3, 1000) < in_a_row(0.9, 1000)
    assert in_a_row(1.0) == np.inf and in_a_row(0.0) == 1.0


def test_a_motion_just_beyond_its_noise_is_followed_closely():
    rng = np.random.default_rng(2)
    motion = SIGNIFICANT * np.sin(np.linspace(0, 40, 200_000)) * np.sqrt(2.0)
    assert np.corrcoef(motion, motion + rng.standard_normal(len(motion)))[0, 1] == pytest.approx(
        CLOSELY_CORRELATED, abs=1e-3
    )


def test_the_magnitude_of_noise_has_its_median_and_its_mean():
    noise = np.abs(np.random.default_rng(3).standard_normal(400_000))
    assert np.median(noise) == pytest.approx(MEDIAN_OF_NORMAL, abs=5e-3) and noise.mean() == pytest.approx(
        MEAN_OF_NORMAL, abs=5e-3
    )


def test_one_sample_is_a_handful_of_any_number():
    assert few(10) == 1.0 and few(1000) == 10.0
