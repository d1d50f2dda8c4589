"""The drop of a bridge: whole at any current, or from its knee on."""

import numpy as np
import pytest

from rtds_host.plant.driver import after_bridge_drop

OHM, DROP, EMF = 8.0, 0.4, 1.5


def current(volts, knee):
    """The steady current through winding and drop, A."""
    return (after_bridge_drop.py_func(volts, EMF, DROP, knee, OHM) - EMF) / OHM


@pytest.mark.parametrize("knee", [0.005, 0.02, 0.05])
def test_the_drop_follows_the_current_up_to_its_knee_within_three_percent(knee):
    for volts in EMF + np.linspace(-3.0, 3.0, 61):
        i = current(volts, knee)
        assert volts - EMF - OHM * i == pytest.approx(DROP * np.tanh(i / knee), abs=0.03 * DROP)


def test_without_a_knee_it_is_the_formats_drop_and_without_a_drop_nothing():
    for volts in (-2.0, 0.3, 1.5, 1.7, 4.0):
        u = volts - EMF
        assert after_bridge_drop.py_func(volts, EMF, DROP, 0.0, OHM) == pytest.approx(volts - np.clip(u, -DROP, DROP))
        assert after_bridge_drop.py_func(volts, EMF, 0.0, 0.02, OHM) == volts
