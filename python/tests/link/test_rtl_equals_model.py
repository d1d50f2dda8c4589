"""The RTL in either simulator and the bit-exact model give the same bytes, whatever the exchange."""

import dataclasses
import os
import re

import numpy as np
import pytest
from link_cases import BURGER, STEP_S

from rtds_host.link import open_link
from rtds_host.link.rtl import RtlLink
from rtds_host.link.tops import TOPS
from rtds_host.motor.effects import Curve, SupplyEffects, UnitEffects


def assert_same(got, want):
    assert got.t_s.tobytes() == want.t_s.tobytes()
    assert got.speeds.dtype == got.currents.dtype == np.float32
    assert got.speeds.tobytes() == want.speeds.tobytes()
    assert got.currents.tobytes() == want.currents.tobytes()


def random_session(seed, exchanges):
    """Calls of one session: now and then new parameters, then inputs, an interval and a sample interval."""
    rng = np.random.default_rng(seed)
    for number in range(exchanges):
        if number == 0 or rng.random() < 0.3:
            scale = 1.0 if number == 0 else rng.uniform(0.7, 1.4, len(BURGER))
            values = dict(zip(BURGER, np.array(list(BURGER.values())) * scale, strict=True))
            values["step_s"] = STEP_S if rng.random() < 0.8 else 1e-6
            yield "parameters", values, str(rng.choice(["backward_euler", "trapezoidal"]))
        steps = int(rng.integers(1, 120))
        every = int(rng.integers(1, 40)) if rng.random() < 0.7 else None
        yield "exchange", rng.uniform(-12.0, 12.0, 2), rng.uniform(-1.5e-3, 1.5e-3, 2), steps, every


def play(session, *links):
    """Give every call to all links; the answers of the first are held against those of the others."""
    for kind, *call in session:
        if kind == "parameters":
            for link in links:
                link.set_parameters(**call[0], method=call[1])
        else:
            voltages, torques, steps, every = call
            step_s = links[0].step_s
            answers = [
                link.exchange(voltages, torques, steps * step_s, None if every is None else every * step_s)
                for link in links
            ]
            for answer in answers[1:]:
                assert_same(answers[0], answer)


@pytest.mark.parametrize("step_clocks", ["min", 500])
def test_random_sessions_are_byte_equal_to_the_model(simulator, step_clocks):
    exchanges = {("verilator", "min"): 150, ("verilator", 500): 40, ("icarus", "min"): 12, ("icarus", 500): 2}
    with open_link("rtl", sim=simulator, step_clocks=step_clocks) as rtl, open_link("model") as model:
        play(random_session(7, exchanges[simulator, step_clocks]), rtl, model)


def test_no_result_depends_on_the_step_period():
    periods = ("min", 1, 37, 500, 3001)
    links = [open_link("rtl", step_clocks=period) for period in periods]
    try:
        play(random_session(11, 12), *links)
        assert links[0].clocks < links[2].clocks < links[3].clocks < links[4].clocks
    finally:
        for link in links:
            link.close()


def test_the_step_period_is_what_was_asked_for():
    with open_link("rtl", step_clocks=500) as link:
        link.set_parameters(**BURGER)
        link.exchange([1.0, 1.0], [0.0, 0.0], 10 * STEP_S)
        before = link.clocks
        link.exchange([1.0, 1.0], [0.0, 0.0], 100 * STEP_S)
        link.exchange([2.0, 1.0], [0.0, 0.0], 100 * STEP_S)
        assert link.clocks - before == 200 * 500


def steps_of(link, session):
    """Bytes of every exchange's samples, and the clocks after it."""
    results = []
    for kind, *call in session:
        if kind == "parameters":
            link.set_parameters(**call[0], method=call[1])
        else:
            voltages, torques, steps, every = call
            got = link.exchange(voltages, torques, steps * link.step_s, (every or 1) * link.step_s)
            results.append((got.speeds.tobytes(), got.currents.tobytes(), link.clocks))
    return results


@pytest.mark.parametrize("effects", [False, True])
@pytest.mark.parametrize("step_clocks", [28, 30, 31, 32, 51, 500, 3001])
def test_jumped_clocks_change_neither_states_nor_counts(step_clocks, effects):
    """Idle clocks jumped and evaluated one by one: every sampled state and the count of clocks after each exchange."""
    level = Curve((0.0, 0.0), (1e-4, 1e-4))
    dry = UnitEffects(friction_forward=level, friction_backward=level)
    results = []
    for every_clock in (True, False):
        with open_link("rtl", step_clocks=step_clocks, every_clock=every_clock) as link:
            if effects:
                link.set_effects(dry, None, SupplyEffects(voltage_v=12.0, command_delay_s=3e-4))
            results.append(steps_of(link, random_session(13, 8)))
    assert results[0] == results[1]


@pytest.mark.parametrize("effects", [False, True])
def test_an_idle_clock_moves_nothing_but_the_period(monkeypatch, effects):
    """The simulator compares its whole model after each clock that would be jumped with the one before; it ends when a
    byte has moved that is not the count of clocks."""
    monkeypatch.setenv("RTDS_EVERY_CLOCK", "check")
    level = Curve((0.0, 0.0), (1e-4, 1e-4))
    with open_link("rtl", step_clocks=500) as checked, open_link("model") as model:
        if effects:
            for link in (checked, model):
                link.set_effects(UnitEffects(friction_forward=level, friction_backward=level), None, None)
        play(random_session(17, 6), checked, model)


def test_at_the_least_a_step_takes_at_most_27_clocks():
    with open_link("rtl") as link:
        link.set_parameters(**BURGER)
        link.exchange([1.0, 1.0], [0.0, 0.0], 10 * STEP_S)
        before = link.clocks
        link.exchange([1.0, 1.0], [0.0, 0.0], 1000 * STEP_S)
        assert link.clocks - before <= 27 * 1000 + 10


def test_an_exchange_longer_than_one_request_is_put_together_again(monkeypatch):
    monkeypatch.setattr("rtds_host.link.rtl.REQUEST_CLOCKS", {"verilator": 27 * 50})
    with open_link("rtl") as rtl, open_link("model") as model:
        for link in (rtl, model):
            link.set_parameters(**BURGER)
        for steps, every in (
            (1000, None),
            (1000, 1),
            (1000, 7),
            (1000, 130),
            (1000, 333),
            (49, 50),
            (51, 50),
            (50, 50),
        ):
            sample_s = None if every is None else every * STEP_S
            answers = [link.exchange([9.0, -7.0], [1e-4, -1e-4], steps * STEP_S, sample_s) for link in (rtl, model)]
            assert_same(*answers)
            assert len(answers[0].t_s) == (1 if every is None else -(-steps // every))
            assert answers[0].t_s[-1] == steps * STEP_S


def test_first_step_after_new_parameters_still_uses_the_old_ones():
    with open_link("rtl") as link:
        link.set_parameters(**BURGER)
        first = link.exchange([12.0, 12.0], [0.0, 0.0], 2 * STEP_S, STEP_S)
        assert (first.currents[0] == 0.0).all()  # no coefficients yet: the state rests
        assert (first.currents[1] > 0.0).all()


def test_a_clip_of_a_long_run_sampled_every_millisecond_is_byte_equal():
    with open_link("rtl") as rtl, open_link("model") as model:
        for link in (rtl, model):
            link.set_parameters(**BURGER)
        rng = np.random.default_rng(3)
        for _ in range(20):
            call = rng.uniform(-12, 12, 2), rng.uniform(-1e-3, 1e-3, 2), 0.032, 0.001
            assert_same(rtl.exchange(*call), model.exchange(*call))


def test_the_top_without_the_effect_unit_has_the_same_states_and_clocks():
    """What runs where no effect is on, against the whole core with its effects off: bytes and clocks of every
    exchange.
    """
    results = []
    for top in (TOPS["core"], dataclasses.replace(TOPS["core"], parameters=())):
        with RtlLink(top=top) as link:
            results.append(steps_of(link, random_session(19, 12)))
    assert results[0] == results[1]


def with_effects(link, effects):
    if effects:
        level = Curve((0.0, 0.0), (1e-4, 1e-4))
        dry = UnitEffects(friction_forward=level, friction_backward=level)
        link.set_effects(dry, None, SupplyEffects(voltage_v=12.0, command_delay_s=3e-4))


@pytest.mark.parametrize("effects", [False, True])
@pytest.mark.parametrize("step_clocks", ["min", 500])
def test_verilators_plain_model_has_the_same_states_and_clocks(step_clocks, effects):
    """The host's arithmetic and an evaluation a phase against the RTL's own operators and one evaluation: bytes and
    clocks of every exchange, among changes of parameters and of the method."""
    results = []
    for plain in (False, True):
        with RtlLink(step_clocks=step_clocks, plain=plain) as link:
            with_effects(link, effects)
            results.append(steps_of(link, random_session(23, 12)))
    assert results[0] == results[1]


@pytest.mark.parametrize("effects", [False, True])
@pytest.mark.parametrize("step_clocks", ["min", 500])
def test_each_phases_evaluation_leaves_the_whole_model_as_the_general_one_does(step_clocks, effects):
    """The simulator evaluates each pinned clock twice from the same start and ends when a byte of the model differs."""
    with RtlLink(step_clocks=step_clocks, environment={"RTDS_LOOP": "check"}) as checked, open_link("model") as model:
        for link in (checked, model):
            with_effects(link, effects)
        play(random_session(29, 8), checked, model)


def clocks_by_kind(link):
    """(clocks evaluated by phase, in general), which the simulator says on its standard error."""
    last = link.said().splitlines()[-1]
    return tuple(int(number) for number in re.findall(r"\d+", last))


@pytest.mark.parametrize(("effects", "most"), [(False, 0.01), (True, 0.35)], ids=["plain", "effects"])
@pytest.mark.parametrize("step_clocks", ["min", 500])
def test_nearly_all_clocks_of_a_run_are_evaluated_by_phase(step_clocks, effects, most):
    """With effects a quarter of the clocks begin unlike their phase, and are evaluated in general."""
    with RtlLink(step_clocks=step_clocks, environment={"RTDS_LOOP": "count"}) as link:
        with_effects(link, effects)
        link.set_parameters(**BURGER)
        link.exchange([6.0, -3.0], [1e-5, 2e-5], 3200 * STEP_S, 100 * STEP_S)
        before = clocks_by_kind(link)
        link.exchange([-6.0, 5.0], [1e-5, 2e-5], 3200 * STEP_S, 100 * STEP_S)
        by_phase, general = (now - then for now, then in zip(clocks_by_kind(link), before, strict=True))
    assert by_phase > 3200 * 25
    assert general < most * by_phase


def test_a_clock_that_begins_unlike_its_phase_is_evaluated_in_general():
    """New parameters are computed next to the steps: control is not what it was in the runs that were watched."""
    with RtlLink(environment={"RTDS_LOOP": "count"}) as link:
        link.set_parameters(**BURGER)
        link.exchange([6.0, -3.0], [0.0, 0.0], 100 * STEP_S)
        before = clocks_by_kind(link)[1]
        link.set_parameters(**{**BURGER, "resistance_ohm": 9.0})
        link.exchange([6.0, -3.0], [0.0, 0.0], 100 * STEP_S)
        assert clocks_by_kind(link)[1] - before > 50


def test_effects_start_the_top_that_has_them():
    level = Curve((0.0, 0.0), (1e-4, 1e-4))
    with open_link("rtl") as link:
        link.set_parameters(**BURGER)
        ideal = link.pid
        link.set_effects(None, None, None)
        assert link.pid == ideal
        link.set_effects(UnitEffects(friction_forward=level, friction_backward=level), None, None)
        whole = link.pid
        assert whole != ideal and not os.path.exists(f"/proc/{ideal}")
        link.exchange([1.0, 1.0], [0.0, 0.0], 10 * STEP_S)
        assert link.pid == whole
