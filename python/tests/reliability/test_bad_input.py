"""What a person can cause ends in one line and status 2: names, values, files and options that are none."""

import sys

import pytest

from rtds_host.cli.main import main


@pytest.fixture
def rtds(monkeypatch, capfd):
    """Call the command; (status, what it printed, the lines it said on standard error)."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["rtds", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capfd.readouterr()
        return ended.value.code, out, err.splitlines()

    return call


def test_escape_codes_of_a_name_are_spelled_out(rtds, tmp_path):
    status, _, said = rtds("diagnose", tmp_path / "\x1b[31mred\nand more\udcff", "--out", tmp_path / "out")
    assert status == 2
    assert said == [rf"rtds: {tmp_path}/\x1b[31mred and more\udcff: is no case folder"]
