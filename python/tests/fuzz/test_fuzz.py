"""A few inputs of the fuzz harness, and that it sees what it is there to see."""

import random

import fuzz
import pytest
from findings import FINDINGS


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind, found in FINDINGS.items() for name in found])
def test_what_was_found_before_stays_right(tmp_path, kind, name):
    assert fuzz.attempt(0, 0, kind, name, tmp_path)[0] in (fuzz.REFUSED, fuzz.RIGHT)


@pytest.mark.parametrize("kind", [kind for kind in fuzz.SHARES if kind != "bag"])
@pytest.mark.parametrize("seed", range(6))
def test_inputs_that_are_almost_right_are_answered_or_refused(tmp_path, kind, seed):
    result, why = fuzz.attempt(seed, 0, kind, None, tmp_path)
    assert result not in fuzz.BAD, why


def test_a_reader_that_reads_what_is_not_there_is_seen(tmp_path, monkeypatch):
    read = fuzz.read_run

    def wrong(*arguments, **options):
        log = read(*arguments, **options)
        log.columns["w_l"] = 1.01 * log.columns["w_l"]
        return log

    monkeypatch.setattr(fuzz, "read_run", wrong)
    files = fuzz.case_files(random.Random(0))
    assert fuzz.predicted(tmp_path, files)[0] == fuzz.MISREAD


def test_an_internal_error_and_a_half_written_output_are_seen(tmp_path):
    assert fuzz.one_line("rtds: internal error at x.py:3: KeyError: 'a'\n") is not None
    assert fuzz.one_line("rtds: log.csv: row 3: w_l is 'x', not a number\n") is None
    (tmp_path / "p.csv").write_text("")
    assert fuzz.told(tmp_path, 2, "rtds: log.csv: is empty\n", ("p.csv",), set(), lambda: None)[0] == fuzz.TROUBLE


def test_the_plan_holds_every_finding_and_every_kind():
    steps = fuzz.plan(3000, 5)
    assert len(steps) == 3000 and steps == fuzz.plan(3000, 5)
    assert {kind for kind, _ in steps} == set(fuzz.KINDS)
    assert sum(name is not None for _, name in steps) == sum(map(len, FINDINGS.values()))
