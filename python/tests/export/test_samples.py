"""Robots drawn from a diagnosis' intervals."""

import numpy as np
import pytest
from export_cases import ROBOT, diagnosis_of

from rtds_host.export.samples import draw

EFFECTS = [("coulomb_friction", "left", {"torque_nm": 0.05}), ("driver_gain", "both", {"ratio": 0.9})]


def sizes(drawn, effect, name):
    return np.array([e["parameters"][name]["value"] for one in drawn for e in one["effects"] if e["id"] == effect])


def test_sizes_spread_as_their_intervals_say():
    diagnosis = diagnosis_of(EFFECTS)
    friction = diagnosis["effects"][0]["parameters"]["torque_nm"]
    friction["ci90"] = [0.045, 0.065]
    drawn, fixed = draw(diagnosis, ROBOT, 4000, seed=1)
    found = sizes(drawn, "coulomb_friction", "torque_nm")
    # 90 % within, 5 % to either side, the value in the middle: three binomial deviations of 4000 draws.
    assert np.mean(found < 0.045) == pytest.approx(0.05, abs=0.011)
    assert np.mean(found > 0.065) == pytest.approx(0.05, abs=0.011)
    assert np.median(found) == pytest.approx(0.05, abs=0.0004)
    assert fixed == []


def test_the_same_seed_gives_the_same_robots_and_another_one_others():
    diagnosis = diagnosis_of(EFFECTS)
    assert draw(diagnosis, ROBOT, 3, seed=5) == draw(diagnosis, ROBOT, 3, seed=5)
    assert draw(diagnosis, ROBOT, 3, seed=5) != draw(diagnosis, ROBOT, 3, seed=6)
    assert diagnosis == diagnosis_of(EFFECTS)


def test_a_size_without_an_interval_stays_and_is_named():
    drawn, fixed = draw(diagnosis_of(EFFECTS, intervals=None), ROBOT, 3, seed=1)
    assert set(sizes(drawn, "coulomb_friction", "torque_nm")) == {0.05}
    assert fixed == ["coulomb_friction (left) torque_nm", "driver_gain (both) ratio"]


def test_no_draw_leaves_the_effects_bounds():
    diagnosis = diagnosis_of([("coulomb_friction", "left", {"torque_nm": 0.001})], intervals=30.0)
    found = sizes(draw(diagnosis, ROBOT, 200, seed=2)[0], "coulomb_friction", "torque_nm")
    assert found.min() == 0.0 and found.max() > 0.01
