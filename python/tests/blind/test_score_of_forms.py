"""Which unmodelled effects ask for a form, and which forms count as right."""

import json

import pytest

from rtds_host.blind import formed, score
from rtds_host.blind.hard import ALIKE
from rtds_host.blind.vocabulary import OUTSIDE, UNMODELLED
from rtds_host.plant.forms import TERMS

GREASE = {"id": "cold_grease", "side": "both", "subsystem": "drivetrain", "gap_without": 3.0}


def messy(**rest) -> dict:
    return {"tier": "messy", "verdict": "known", "effects": [], "rest": {**GREASE, **rest}}


def hard(beyond: float, known: float, name: str = "flux_droop") -> dict:
    return {"effects": [], "gap": {"known": known}, "forms": [{"id": name, "gap_beyond_names": beyond}]}


def said(*terms: str) -> dict:
    return {"forms": [{"term": term} for term in terms]}


def test_every_unmodelled_effect_and_term_that_is_listed_exists():
    assert set(formed.EQUATIONS) <= {*OUTSIDE, *UNMODELLED, *ALIKE}
    assert {term for terms in formed.EQUATIONS.values() for term in terms} <= set(TERMS)


@pytest.mark.parametrize(
    ("answer", "closure", "row"),
    [
        (said("damping"), {"effects_alone": 3.0, "after": 1.5}, [True, 0.75, True]),
        (said("damping"), {"effects_alone": 3.0, "after": 1.7}, [True, 0.65, False]),
        (said("damping"), {"effects_alone": 1.0, "after": 1.0}, [True, None, False]),
        (said("damping"), None, [True, None, False]),
        (said("force"), {"effects_alone": 3.0, "after": 1.0}, [False, None, False]),
        ({}, {"after": 1.0}, [False, None, False]),
        (None, None, [False, None, False]),
    ],
)
def test_a_form_is_right_in_its_equation_if_it_closes_enough_of_unseen_runs(answer, closure, row):
    assert formed.judged(messy(), answer, closure) == [["cold_grease", *row]]


def test_an_effect_that_makes_no_gap_or_is_no_function_of_a_state_asks_for_no_form():
    assert formed.judged(messy(gap_without=1.19), said("damping"), {}) == []
    assert formed.judged(messy(id="dahl_friction"), said("torque"), {}) == []
    clipped = {"effects": [], "outside": {"id": "speed_clipped"}}
    assert formed.judged(clipped, None, {"before": 1.1}) == []
    assert formed.judged(clipped, None, {"before": 2.0}) == [["speed_clipped", False, None, False]]


def test_of_a_hard_case_a_form_has_to_close_what_its_own_law_makes():
    """Of 12 squares that the nearest machine leaves, 8 are the droop's; the rest is of laws that no form has."""
    truth = hard(beyond=3.0, known=13.0**0.5)
    half = {"effects_alone": 13.0**0.5, "after": 9.0**0.5}
    nearly = {"effects_alone": 13.0**0.5, "after": 6.0**0.5}
    assert formed.judged(truth, said("torque_constant"), half)[0][2:] == [pytest.approx(0.442, abs=1e-3), False]
    assert formed.judged(truth, said("torque_constant"), nearly)[0][2:] == [pytest.approx(0.844, abs=1e-3), True]
    assert formed.judged(hard(beyond=2.0, known=4.0), said("torque_constant"), nearly) == []


def test_a_form_is_false_where_everything_has_a_name():
    assert formed.false_form({"effects": []}, said("torque"))
    assert formed.false_form({"effects": []}, said()) is False
    assert formed.false_form({"effects": []}, None) is False
    assert formed.false_form(messy(), said("torque")) is None


def test_the_gap_of_effects_alone_is_measured_without_the_forms(tmp_path):
    path = tmp_path / "diagnosis.json"
    seen = []

    def measured(diagnosis):
        seen.append(json.loads(diagnosis.read_text()))
        return {"after": 2.5}

    answer = {"verdict": "partial", **said("torque")}
    path.write_text(json.dumps(answer))
    assert formed.effects_alone(path, measured) == 2.5
    assert seen == [{**answer, "forms": []}] and json.loads(path.read_text()) == answer
    path.write_text(json.dumps(said()))
    assert formed.effects_alone(path, measured) is None and len(seen) == 1


def test_a_page_counts_the_functions_of_a_state_that_got_a_form():
    records = [{"formed": [["cold_grease", True, 0.9, True], ["flux_droop", False, None, False]]}, {"formed": []}]
    rows = [{**score.judge(messy(), None, ENTRY), **record, "closure": None} for record in records]
    assert score.summarise(rows)["formed"]["hits"] == 1 and score.summarise(rows)["formed"]["count"] == 2


ENTRY = {"seconds": 1.0, "said": "", "quick": True, "sha256": None}
