"""The table of the instrument's constants: each has a reason, and what the contract sets is said once."""

from pathlib import Path

import pytest

import rtds_host.diagnosis
from rtds_host.diagnosis.constants import KINDS, by_folder, constants, kind, main

ROWS = constants(Path(rtds_host.diagnosis.__file__).parent)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row[0]}: {row[1]}")
def test_each_constant_has_its_reason(row):
    assert row[3], f"{row[0]}: {row[1]} = {row[2]} stands there without a reason"


def test_each_constant_is_counted_in_one_room():
    assert sum(len(mine) for mine in by_folder(ROWS).values()) == len(ROWS) > 50


def test_what_the_contract_sets_is_said_once():
    agreed = [(name, value) for _, name, value, reason in ROWS if kind(reason) == "contract"]
    assert len({name for name, _ in agreed}) == len(agreed)


def test_a_constant_without_a_comment_has_no_reason(tmp_path):
    (tmp_path / "one.py").write_text("# Numerical: a step.\nSTEP = 0.1\n\nOTHER = 3\n")
    assert constants(tmp_path) == [("one.py", "STEP", "0.1", "Numerical: a step."), ("one.py", "OTHER", "3", "")]


@pytest.mark.parametrize(
    ("reason", "which"),
    [
        ("Numerical: a step.", "numerical"),
        ("Physical: a sensor's bandwidth.", "physical"),
        ("Probability: of a false alarm.", "probability"),
        ("Layout: pixels.", "layout"),
        ("So near that it counts (contract, section 4).", "contract"),
        ("The contract's delays reach a second.", "judgement"),
        ("Numerically it hardly matters.", "judgement"),
        ("", "judgement"),
    ],
)
def test_the_kind_of_a_constant_is_the_first_word_of_its_reason_or_the_section_that_sets_it(reason, which):
    assert kind(reason) == which and which in KINDS


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("ONE, OTHER = 0.1, (1, 2)", [("ONE", "0.1"), ("OTHER", "(1, 2)")]),
        ("HALF = -1.0 / 2", [("HALF", "-1.0 / 2")]),
        ("PRIOR = math.log(2.0)", [("PRIOR", "math.log(2.0)")]),
        ("DERIVED = 2.0 * ONE", []),
        ("FEWEST = of_chance(0.5)", []),
        ('NAME = "x"', []),
        ("FREE, HELD, LOST = 0, 1, 2", []),
        ("YES = True", []),
    ],
)
def test_what_is_set_to_numbers_alone_is_a_constant_and_each_name_counts(tmp_path, line, found):
    (tmp_path / "one.py").write_text(f"# Why.\n{line}\n")
    assert [row[1:] for row in constants(tmp_path)] == [(*pair, "Why.") for pair in found]


def test_the_folders_counts_add_up_to_the_table(capsys):
    main()
    table = [line.strip("| ").split(" | ") for line in capsys.readouterr().out.splitlines() if line.startswith("| ")]
    head, *folders = table[len(ROWS) + 1 :]
    *folders, whole = [[int(cell) for cell in row[1:]] for row in folders]
    assert whole == [sum(column) for column in zip(*folders)] and whole[0] == sum(whole[1:-1]) == len(ROWS)
    assert whole[-1] == sum(whole[head.index(which) - 1] for which in ("physical", "probability", "judgement"))


def test_the_gate_s_thresholds_follow_from_what_chance_and_a_robot_do():
    judged = {
        (module, name)
        for module, name, _, reason in ROWS
        if kind(reason) == "judgement" and module.startswith(("chance", "gate"))
    }
    assert judged <= {
        ("chance.py", "HANDFUL"),
        ("chance.py", "SLIGHT"),
        ("chance.py", "APART"),
        ("chance.py", "MOST"),
        ("chance.py", "SAME"),
    }


def test_what_is_beyond_numerics_contract_and_layout_stands_in_few_constants():
    assert sum(kind(row[3]) in ("physical", "probability", "judgement") for row in ROWS) <= 22
