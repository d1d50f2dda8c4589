"""Which forms are chosen: by moved ends, next to earlier ones, and next to later ones."""

from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_cases import make_case

from rtds_host.diagnosis.choice import HeldOutScore
from rtds_host.diagnosis.fit import Fit, Fitter, joined
from rtds_host.diagnosis.forms import search
from rtds_host.diagnosis.forms.backward import eliminated, supported
from rtds_host.diagnosis.forms.curves import Form, points_of, put
from rtds_host.diagnosis.problem import Problem
from rtds_host.plant import forms as plant

TURN = plant.FULL_TURN
# Its grid has other ends than that of the truth, so that the truth is no curve of the fit's own.
OVER_COMMAND = Form("voltage", "v_cmd", -9.0, 9.0, 0.5)
OVER_ANGLE = Form("torque", "th", 0.0, TURN, 0.02)
# A voltage over the wheel's angle makes most of what a torque over it makes.
STAND_IN = Form("voltage", "th", 0.0, TURN, 0.5)


def bent_command(model) -> None:
    values = 0.8 * np.sign(points_of("v_cmd", -10.0, 10.0)) * (points_of("v_cmd", -10.0, 10.0) / 9.0) ** 2
    put(model, (0, 1), "voltage", "v_cmd", -10.0, 10.0, values)


def ripple(model) -> None:
    put(model, (0, 1), "torque", "th", 0.0, TURN, 0.05 * np.sin(2.0 * points_of("th", 0.0, TURN) + 0.4))


def case_of(*changes) -> tuple[Problem, Fit]:
    """A case whose truth has some terms without a name, and the fit of its tolerances alone."""

    def change(model):
        for one in changes:
            one(model)

    problem = Problem(make_case(change), 1)
    return problem, Fitter(problem).fit((), np.empty(0), np.zeros(len(problem.nuisances)), problem.white())


def one_after_the_other(problem: Problem, bare: Fit, *forms: Form) -> list[HeldOutScore]:
    """The explanation without a form and with one after the other, each fitted to all runs."""
    judged, fit = [HeldOutScore.in_few_steps(problem, bare)], bare
    for form in forms:
        fitter = Fitter(problem, fit.start)
        fitter.effects = {**fit.effects, form.id: form.effect()}
        hypothesis, start = joined({**fit.parts, (form.id, "both"): np.zeros(len(form.effect().parameters))})
        fit = fitter.fit(hypothesis, start, fit.z, fit.noise)
        judged.append(HeldOutScore.in_few_steps(problem, fit))
    return judged


def both(*forms: Form) -> list[tuple[Form, str]]:
    return [(form, "both") for form in forms]


def test_a_form_that_stood_in_for_a_later_one_is_dropped():
    problem, bare = case_of(ripple)
    judged = one_after_the_other(problem, bare, STAND_IN, OVER_ANGLE)
    # It had been taken with good reason: nothing better was there.
    assert supported(judged[1], judged[0])
    kept, forms = eliminated(problem, judged, both(STAND_IN, OVER_ANGLE))
    assert forms == both(OVER_ANGLE)
    assert kept[-1].fit.hypothesis == ((OVER_ANGLE.id, "both"),)
    assert kept[0] is judged[0] and len(kept) == 2
    assert not supported(judged[-1], kept[-1])


def test_each_form_that_is_left_is_judged_next_to_those_before_it_alone():
    problem, bare = case_of(ripple, bent_command)
    forms = STAND_IN, OVER_COMMAND, OVER_ANGLE
    kept, left = eliminated(problem, one_after_the_other(problem, bare, *forms), both(*forms))
    assert left == both(OVER_COMMAND, OVER_ANGLE)
    assert [{name for name, _ in one.fit.hypothesis} for one in kept] == [
        set(),
        {OVER_COMMAND.id},
        {OVER_COMMAND.id, OVER_ANGLE.id},
    ]
    assert all(supported(more, fewer) for fewer, more in zip(kept, kept[1:]))


def test_forms_that_are_supported_next_to_each_other_stay():
    problem, bare = case_of(bent_command, ripple)
    judged = one_after_the_other(problem, bare, OVER_ANGLE, OVER_COMMAND)
    kept, forms = eliminated(problem, judged, both(OVER_ANGLE, OVER_COMMAND))
    assert forms == both(OVER_ANGLE, OVER_COMMAND)
    assert all(one is before for one, before in zip(kept, judged, strict=True))


@pytest.fixture
def stand_in_first(monkeypatch):
    """At the first turn of the search there are only voltages over the wheel's angle to choose from."""
    turns = []

    def candidates(problem, model):
        turns.append(model)
        found = all_of(problem, model)
        return [one for one in found if len(turns) > 1 or (one.term, one.over) == ("voltage", "th")]

    all_of = search.candidates
    monkeypatch.setattr(search, "candidates", candidates)
    return turns


def test_the_search_ends_with_the_form_that_makes_its_first_one_needless(stand_in_first):
    problem, bare = case_of(ripple)
    found = search.searched(problem, bare, True)
    # No third turn: nothing is left.
    assert len(stand_in_first) == 2
    assert [(form.term, form.over, side) for form, side in found.forms] == [("torque", "th", "both")]
    assert [len(one.fit.hypothesis) for one in found.judged] == [0, 1]
    assert found.judged[-1].gap <= search.LEAST_GAP


def tried(form: Form, gap: float, score: float) -> tuple:
    """A rough fit with a form, the explanation without it, whose score is 0, and the form."""
    rough = SimpleNamespace(gap=gap, fit=SimpleNamespace(score=score))
    return rough, SimpleNamespace(score=0.0), SimpleNamespace(form=form)


def test_a_form_with_evidence_against_its_ends_competes_until_they_are_moved(monkeypatch):
    """The evidence is asked again once they are, and without it those are chosen from that have it."""
    monkeypatch.setattr(search, "fitted", lambda problem, fit, known, one: fit)
    for name in ("derived", "renewed"):
        monkeypatch.setattr(search, name, lambda problem, fit: fit)
    problem = SimpleNamespace(follow_angles=lambda on: None)
    reading = Form("current_sensor", "i", -0.03, 0.03, 0.01)
    against, good = tried(reading, 2.1, 300.0), tried(OVER_COMMAND, 2.6, -20.0)
    monkeypatch.setattr(search.HeldOutScore, "in_few_steps", lambda problem, fit: good[0])

    def gaps(judged):
        return [[best.gap for _, best in pool] for pool in search.choices(problem, {}, judged, True)]

    assert [pool[-1] for pool in gaps([against, good])] == [2.1, 2.6]
    assert gaps([against]) == [[2.1]]
    # One that leaves more of held-out runs than those which have evidence for them is of no use.
    assert [set(pool) for pool in gaps([good, tried(reading, 2.7, 300.0)])] == [{2.6}]


def test_a_rough_form_is_judged_by_derivatives_of_its_own(monkeypatch):
    """By those of the screening its fits without a run leave 2.4, by its own 3.9."""
    rough = tried(OVER_COMMAND, 2.4, -20.0)
    own = SimpleNamespace(score=-20.0, gap=3.9)
    monkeypatch.setattr(search, "fitted", lambda problem, fit, known, one: own)
    monkeypatch.setattr(search, "derived", lambda problem, fit: own if fit is rough[0].fit else fit)
    monkeypatch.setattr(search, "renewed", lambda problem, fit: fit)
    monkeypatch.setattr(search.HeldOutScore, "in_few_steps", lambda problem, fit: fit)
    pools = search.choices(SimpleNamespace(follow_angles=lambda on: None), {}, [rough], True)
    assert [[best.gap for _, best in pool] for pool in pools] == [[3.9, 3.9]]


def test_evidence_is_compared_by_the_likelihood_of_each_where_the_explanation_is_one_by_plain_squares():
    """The explanation without effects is fitted by plain squares, whose cost is many times that of a likelihood."""
    problem, _ = case_of(bent_command)
    white = problem.white()
    plain = Fitter(problem).fit((), np.empty(0), np.zeros(len(problem.nuisances)), white, fixed=True)
    assert plain.noise.root is None
    found = search.searched(problem, plain, True)
    first = found.judged[0].fit
    assert first.noise.root is not None
    assert first.noise.cost(first.residual) == pytest.approx(white.estimated(plain.residual).cost(plain.residual))
    assert found.forms[0][0].term == "voltage" and found.fit.score < first.score
