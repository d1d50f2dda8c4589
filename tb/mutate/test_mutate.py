"""The mutation run itself: what it keeps, and that it goes on where it was."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))
import mutate


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """A small project with two mutants; `ran` lists the tests that were run and the RTL each saw."""
    (tmp_path / "rtl").mkdir()
    (tmp_path / "rtl" / "a.v").write_text("one two")
    (tmp_path / "mutants.toml").write_text(
        "".join(
            f'[[mutant]]\nname = "{old}"\nfile = "a.v"\nold = "{old}"\nnew = "other"\ntest = "fp"\n'
            for old in ("one", "two")
        )
    )
    ran = []

    def run_test(folder, test):
        ran.append((folder / "rtl" / "a.v").read_text())
        return ran[-1] == "one two"

    monkeypatch.setattr(mutate, "ROOT", tmp_path)
    monkeypatch.setattr(mutate, "HERE", tmp_path)
    monkeypatch.setattr(mutate, "WORK", tmp_path / "build")
    monkeypatch.setattr(mutate, "COPIED", ("rtl",))
    monkeypatch.setattr(mutate, "run_test", run_test)
    return tmp_path, ran


def test_a_run_that_was_interrupted_goes_on_where_it_was(tree, capsys):
    _, ran = tree
    assert mutate.main(["mutate.py", "one"]) == 0
    assert ran == ["one two", "other two"]
    ran.clear()
    assert mutate.main(["mutate.py"]) == 0
    assert ran == ["one other"]
    assert "2 of 2 mutants killed" in capsys.readouterr().out
    ran.clear()
    assert mutate.main(["mutate.py", "--again"]) == 0
    assert ran == ["one two", "other two", "one other"]


def test_another_state_of_the_design_knows_no_verdict(tree):
    folder, ran = tree
    assert mutate.main(["mutate.py"]) == 0
    ran.clear()
    (folder / "rtl" / "b.v").write_text("more")
    assert mutate.main(["mutate.py"]) == 0
    assert len(ran) == 3


def test_a_mutant_that_lives_is_run_again_and_ends_with_status_1(tree, monkeypatch, capsys):
    monkeypatch.setattr(mutate, "run_test", lambda folder, test: True)
    assert mutate.main(["mutate.py"]) == 1
    monkeypatch.setattr(mutate, "run_test", lambda folder, test: False)
    assert mutate.main(["mutate.py"]) == 0
    assert "0 of 2 mutants killed" in capsys.readouterr().out
    assert mutate.main(["mutate.py", "--again"]) == 1  # and a test that fails without a fault proves nothing
    assert "fails without any fault" in capsys.readouterr().err


def test_a_mutant_that_no_longer_fits_is_named(tree, capsys):
    folder, _ = tree
    (folder / "rtl" / "a.v").write_text("one two")
    toml = folder / "mutants.toml"
    toml.write_text(toml.read_text().replace('old = "two"', 'old = "three"'))
    assert mutate.main(["mutate.py"]) == 1
    assert "two: a.v has changed, this mutant no longer fits" in capsys.readouterr().err
