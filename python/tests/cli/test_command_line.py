"""A name that is nearly right is recognised, and a place that cannot hold the result is refused before the work."""

import sys

import pytest

from rtds_host.cli.main import main


def said(words, monkeypatch, capsys):
    """Exit status and the one line on standard error of `rtds WORDS…`."""
    monkeypatch.setattr(sys, "argv", ["rtds", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main()
    (line,) = capsys.readouterr().err.splitlines()
    return ended.value.code, line


@pytest.mark.parametrize(("words", "meant"), [
    (["diagnos"], "diagnose"),
    (["run", "circel"], "circle"),
    (["effects", "coulomb_fricton"], "coulomb_friction"),
    (["run", "linear", "--effect", "Driver_deadzon.volts=0.3"], "driver_deadzone"),
])  # fmt: skip
def test_a_name_that_is_nearly_right_is_recognised(words, meant, monkeypatch, capsys):
    status, line = said(words, monkeypatch, capsys)
    assert status == 2
    assert line.endswith(f"; did you mean {meant!r}?")


def test_a_name_like_no_other_gets_no_guess(monkeypatch, capsys):
    status, line = said(["quux"], monkeypatch, capsys)
    assert status == 2
    assert line.startswith("rtds: no such command: 'quux' (known: run, ") and "did you mean" not in line


def test_a_diagnosis_that_cannot_be_written_is_refused_before_the_case_is_read(tmp_path, monkeypatch, capsys):
    (tmp_path / "file").write_text("")
    status, line = said(["diagnose", tmp_path / "no-case", "--out", tmp_path / "file" / "out"], monkeypatch, capsys)
    assert (status, line) == (2, f"rtds: {tmp_path}/file: is a file, a folder is needed for the output")
