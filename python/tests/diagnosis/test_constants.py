"""The table of the instrument's constants: each has a reason, and what the contract sets is said once."""

from pathlib import Path

import pytest

import rtds_host.diagnosis
from rtds_host.diagnosis.constants import by_room, constants, kind

ROWS = constants(Path(rtds_host.diagnosis.__file__).parent)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row[0]}: {row[1]}")
def test_each_constant_has_its_reason(row):
    assert row[3], f"{row[0]}: {row[1]} = {row[2]} stands there without a reason"


def test_each_constant_is_counted_in_one_room():
    assert sum(len(mine) for mine in by_room(ROWS).values()) == len(ROWS) > 50


def test_what_the_contract_sets_is_said_once():
    agreed = [(name, value) for _, name, value, reason in ROWS if kind(reason) == "contract"]
    assert len({name for name, _ in agreed}) == len(agreed)


def test_a_constant_without_a_comment_has_no_reason(tmp_path):
    (tmp_path / "one.py").write_text("# Numerical: a step.\nSTEP = 0.1\n\nOTHER = 3\n")
    assert constants(tmp_path) == [("one.py", "STEP", "0.1", "Numerical: a step."), ("one.py", "OTHER", "3", "")]
