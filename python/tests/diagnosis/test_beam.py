"""The beam's starts for resonances, what it keeps, and what is no cause."""

from dataclasses import replace

import numpy as np
import pytest
from axis_machine import write_axis_case
from replayed_case import altered

from rtds_host.contract import read_case
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.search.beam import additions, confused, screenings
from rtds_host.diagnosis.search.driver import Search
from rtds_host.diagnosis.search.screening import further_starts
from rtds_host.diagnosis.search.store import SHOWN_ONCE

SPRING, DELAY, RIPPLE = ("gear_compliance", "left"), ("command_delay", "both"), ("torque_ripple", "left")
STIFFNESS = 8.0


@pytest.fixture(scope="module")
def search(tmp_path_factory):
    folder = write_axis_case(tmp_path_factory.mktemp("beam") / "case", "inertia", "torque", seconds=2.0)
    # A spring in the gear that rings, and commands that act 20 ms late.
    rung = altered(read_case(folder), stiffness=STIFFNESS, damping=1e-3, command_delay=0.02)
    return Search(Problem(rung, 1), quick=True)


def test_a_resonance_is_tried_at_its_stiffness_though_alone_it_is_out_of_phase(search):
    """With the delay missing, a spring of the right stiffness rings out of phase: by the likelihood no size of it
    promises a gain.
    """
    nothing = search.begin()
    screens = screenings(search, nothing)(nothing)[:1]
    promised = [one.gain for screen in screens for one in screen.candidates() if one.cause == SPRING]
    assert max(promised) < 0.0
    tried = [one for one in additions(search, nothing, screens) if one.hypothesis == (SPRING,)]
    stiffness = search.store.effects[SPRING[0]].parameters[0]
    assert any(stiffness.value(one.u[0]) == pytest.approx(STIFFNESS, rel=0.3) for one in tried)


@pytest.mark.parametrize(
    ("channels", "cycles", "why"),
    [
        (("th_l", "w_l"), 3.0, SHOWN_ONCE),
        (("w_l",), 3.0, SHOWN_ONCE),
        (("th_l", "w_l"), 30.0, None),
        (("w_l",), 30.0, None),
        ((), 3.0, None),
    ],
    ids=["a part", "a part, by speed", "several", "several, by speed", "nobody knows"],
)
def test_a_ripple_is_a_cause_where_runs_show_that_it_comes_back(tmp_path, channels, cycles, why):
    """Over a fifth of a turn, three cycles a turn are two thirds of a period, which any torque over the angle fits."""
    case = read_case(write_axis_case(tmp_path / "case", "inertia", "torque", seconds=2.0))
    slowly = [replace(log, columns={**log.columns, "v_cmd_l": 0.03 * log.columns["v_cmd_l"]}) for log in case.runs]
    rippled = altered(replace(case, runs=tuple(slowly)), ripple=0.001, ripple_cycles=cycles, ripple_phase=0.5)
    assert 0.1 < np.ptp([log.columns["th_l"] for log in rippled.runs]) / (2.0 * np.pi) < 1.0 / 3.0
    kept = tuple(
        replace(log, columns={c: v for c, v in log.columns.items() if c in (*channels, "v_cmd_l")})
        for log in rippled.runs[:1]
    )
    search = Search(Problem(replace(rippled, runs=kept), 1), quick=True)
    effect = search.store.effects[RIPPLE[0]]
    size = {p.name: p.null for p in effect.parameters} | {"amplitude_nm": 0.001, "cycles_per_rev": cycles}
    fit = replace(search.begin(), hypothesis=(RIPPLE,), u=effect.scaled(size))
    assert search.store.refused(fit).get(RIPPLE) == why


@pytest.mark.parametrize(("mode", "tried"), [("speed", [{"ratio": 0.5}, {"ratio": 2.0}]), ("voltage", None)])
def test_counts_of_another_factor_are_tried_where_a_servo_s_loop_bends_what_they_do(tmp_path, mode, tried):
    """A servo turns the wheel twice as far for half the counts, until it saturates: no slope at one says so."""
    case = read_case(write_axis_case(tmp_path / "case", "inertia", mode, seconds=1.0))
    search = Search(Problem(case, 1), quick=True)
    assert further_starts(search.store, search.begin()).get(("speed_gain", "left")) == tried


def test_a_winding_is_never_hot_within_less_than_a_second(tmp_path):
    """The smallest motors' windings take four; what is faster is another effect's."""
    case = read_case(write_axis_case(tmp_path / "case", "inertia", "voltage", seconds=1.0))
    _, slow = Problem(case, 1).effects["winding_heating"].parameters
    assert slow.low == 1.0 and min(slow.starts) >= slow.low


def test_explanations_that_differ_by_effects_confused_with_each_other_are_one_in_the_beam(search):
    nothing = search.begin()
    effects = search.store.effects

    def one(*causes):
        parts = {
            cause: effects[cause[0]].scaled({p.name: p.starts[0] for p in effects[cause[0]].parameters})
            for cause in causes
        }
        return search.store.try_fit(*nothing.proposal(parts)[:2], nothing, rough=True)

    coulomb, load, gain = (
        one(("coulomb_friction", "left")),
        one(("load_friction", "left")),
        one(("driver_gain", "left")),
    )
    assert confused(search.store, coulomb, load)
    assert not confused(search.store, coulomb, gain)
    assert not confused(search.store, coulomb, one(("coulomb_friction", "left"), ("driver_gain", "left")))
