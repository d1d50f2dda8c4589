"""What an explanation foretells of runs that it was not fitted to: as a fit without them does, and no better by what they lack."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import make_case, make_run

from rtds_host.contract import Case, builtin_robot
from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.account import _standing, _unforetold
from rtds_host.diagnosis.evidence import worth_naming
from rtds_host.diagnosis.fit import Fit, joined, scaled
from rtds_host.diagnosis.left_out import left_out_gap
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import nominal_model, replay_run
from rtds_host.diagnosis.search import Search

COULOMB = ("coulomb_friction", "both")


def fitted(case: Case, parts: dict[tuple[str, str], dict[str, float]]) -> tuple[Search, Fit]:
    """An explanation of a case, fitted from the values given by effect."""
    search = Search(Problem(case, 1))
    noise = search.problem.discrepancy()
    search.fits[()] = search.fitter.fit((), np.empty(0), np.zeros(search.fitter.count), noise)
    hypothesis, start = joined({member: scaled(search.effects, (member,), [values]) for member, values in parts.items()})
    return search, search.try_fit(hypothesis, start, search.fits[()])


def test_a_run_left_out_is_foretold_as_by_a_fit_without_it():
    case = make_case(lambda m: m.add("coulomb", 0.03), seed=31)
    search, fit = fitted(case, {COULOMB: {"torque_nm": 0.02}})
    found = []
    for k, run in enumerate(case.runs):
        others = replace(case, runs=tuple(r for j, r in enumerate(case.runs) if j != k))
        problem, own = fitted(others, {COULOMB: {"torque_nm": 0.02}})
        out = replay_run(own.model(problem.problem), search.problem.whole[k].inputs)
        found.append(gaps.errors(run, case.robot, out))
    assert left_out_gap(search.problem, fit) == pytest.approx(gaps.gap(gaps.pooled(found)), rel=0.01)


def test_of_a_single_run_each_half_is_left_out_in_turn():
    case = make_case(lambda m: m.add("coulomb", 0.03), seed=32, seconds=12.0)
    search, fit = fitted(replace(case, runs=case.runs[1:2]), {COULOMB: {"torque_nm": 0.02}})
    truth = nominal_model(case.robot)
    truth.add("coulomb", 0.03)
    out = replay_run(truth, search.problem.whole[0].inputs)
    halves = [(0, len(out) // 2), (len(out) // 2, len(out))]
    expected = gaps.gap(gaps.pooled([gaps.errors(case.runs[1].rows(a, b), case.robot, out[a:b]) for a, b in halves]))
    assert left_out_gap(search.problem, fit) == pytest.approx(expected, rel=0.02)


def test_what_one_run_alone_knows_of_and_fits_amiss_in_the_others_does_not_stand():
    """A weight that was in one run of four: an effect's size follows that run, and the others are foretold worse with it."""
    robot = builtin_robot("burger")
    sound, heavy = nominal_model(robot), nominal_model(robot)
    for model in (sound, heavy):
        model.add("coulomb", 0.05)
    heavy.scale("voltage_gain", 0.8)
    runs = tuple(make_run(f"{kind}-{seed}", heavy if seed == 3 else sound, robot, kind, seed=seed)
                 for seed, kind in enumerate(("steps", "weave", "steps", "weave")))
    search, fit = fitted(Case("one of four", robot, runs), {COULOMB: {"torque_nm": 0.04}, ("driver_gain", "both"): {"ratio": 0.9}})
    standing = [_standing(search, fit, member, rough=False) for member in fit.hypothesis]
    one, reason = _unforetold(search, fit, standing)
    assert one.member == ("driver_gain", "both") and "not fitted to" in reason


@pytest.mark.parametrize("without,gap,share,worth", [
    (1.2, 1.0, 0.0, True),        # makes a gap of 1.2 out of none
    (1.05, 1.0, 0.5, False),      # makes none
    (3.0, 2.0, 0.0, True),        # outweighs what is left
    (9.0, 8.0, 0.01, False),      # a quarter of what is left: any form may take that
    (9.0, 8.0, 0.4, True),        # little of the gap, but much of what the likelihood sees
])
def test_an_effect_is_worth_naming_if_it_outweighs_half_of_the_rest_or_is_much_of_what_the_likelihood_sees(without, gap, share, worth):
    assert worth_naming(without, gap, share) is worth
