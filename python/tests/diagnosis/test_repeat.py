"""How often each named effect is found again on halves of the data: `rtds diagnose --repeat`."""

from dataclasses import replace

import numpy as np
from diagnosis_cases import make_case

from rtds_host.diagnosis.diagnose import diagnose
from rtds_host.diagnosis.repeat import halves, repeats
from rtds_host.errors import InputError


def rows(case):
    return {(log.name, t) for log in case.runs for t in log.t}


def test_each_pair_of_halves_shares_no_row_and_holds_all():
    case = make_case(seconds=2.0)
    parts = halves(case)
    assert len(parts) == 4
    for one, other in zip(parts[0::2], parts[1::2]):
        assert not rows(one) & rows(other)
        assert rows(one) | rows(other) == rows(case)


def test_a_single_run_is_cut_in_the_middle_of_its_time():
    case = replace(make_case(seconds=2.0), runs=make_case(seconds=2.0).runs[:1])
    first, last = halves(case)
    assert np.allclose(
        [first.runs[0].t[-1] - first.runs[0].t[0], last.runs[0].t[-1] - last.runs[0].t[0]], 1.0, atol=0.02
    )


def test_a_strong_effect_is_found_on_every_half():
    case = make_case(lambda model: model.add("coulomb", 0.05), seconds=4.0)
    diagnosis, _ = diagnose(case, quick=True)
    assert [effect["id"] for effect in diagnosis["effects"]] == ["coulomb_friction"]
    assert repeats(case, diagnosis) == {("coulomb_friction", "both"): (4, 4)}


def test_a_diagnosis_that_names_nothing_is_not_repeated(monkeypatch):
    monkeypatch.setattr("rtds_host.diagnosis.repeat.diagnose", lambda *_, **__: 1 / 0)
    assert repeats(make_case(seconds=1.0), {"effects": [], "indistinguishable": []}) == {}


def test_a_half_that_makes_no_case_finds_nothing(monkeypatch):
    def refused(*_, **__):
        raise InputError("no channel can be compared")

    monkeypatch.setattr("rtds_host.diagnosis.repeat.diagnose", refused)
    diagnosis = {"effects": [{"id": "coulomb_friction", "side": "both"}], "indistinguishable": []}
    assert repeats(make_case(seconds=1.0), diagnosis) == {("coulomb_friction", "both"): (0, 4)}
