"""`rtds calibrate`, and `rtds run` through the chip's pins, as they are typed."""

import json
import sys

import pytest

from rtds_host.cli.commands import main
from rtds_host.link.analog import load_paths

WIRES = """format = 1
[to_chip.v_l]
gain = 1.03
offset_v = -0.05
[to_chip.t_r]
offset_v = 0.01
[from_chip.w_l]
gain = 0.97
offset_v = 0.03
"""
SHORT = ["--duration", 0.32, "--no-figure"]


def rtds(monkeypatch, *words):
    """Exit status of the command."""
    monkeypatch.setattr(sys, "argv", ["rtds", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code


def test_a_calibrated_run_through_the_pins_of_the_chip(tmp_path, monkeypatch, capsys):
    wires, calibration = tmp_path / "wires.toml", tmp_path / "calibration.toml"
    wires.write_text(WIRES)
    words = ["calibrate", "--link", "chip", "--wires", wires, "--out", calibration, "--points", 11, "--reads", 1]
    assert rtds(monkeypatch, *words) == 0
    printed = capsys.readouterr().out
    assert "error without it" in printed and "w_l" in printed
    found = load_paths(calibration)
    assert found.to_chip[0].gain == pytest.approx(1.03, abs=1e-3)
    assert found.from_chip[1].offset_v == pytest.approx(0.03, abs=1e-3)
    assert found.about["link"] == "chip"

    folder = tmp_path / "run"
    words = ["run", "crawl", "--link", "chip", "--wires", wires, "--calibration", calibration, *SHORT, "--out", folder]
    assert rtds(monkeypatch, *words) == 0
    printed = capsys.readouterr().out
    assert "the whole chip" in printed and "clocks of 50 MHz (idle clocks left out)" in printed
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["link_report"]["chip_steps"] >= round(summary["simulated_s"] / 1e-5)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("run", "linear", "--link", "model", "--calibration", "c.toml"),
            "--calibration: has no meaning with --link model",
        ),
        (("run", "linear", "--link", "ad2", "--wires", "c.toml"), "--wires: has no meaning with --link ad2"),
        (("run", "linear", "--link", "chip", "--ad2", "1"), "--ad2: has no meaning with --link chip"),
        (("run", "linear", "--link", "chip", "--serial", "p"), "--serial: has no meaning with --link chip"),
        (("run", "linear", "--link", "chip", "--calibration", "none.toml"), "none.toml: cannot be read"),
        (("run", "linear", "--link", "chip", "--sim", "icarus"), "simulated by verilator only"),
        (("run", "linear", "--link", "chip", "--step-clocks", "100"), "the chip's step is 500 clocks, or min"),
        (("run", "linear", "--link", "chip", "--step-clocks", "x"), "a whole number or min is needed"),
        (("run", "linear", "--link", "ad2"), "the serial port of the chip's registers is needed"),
        (("run", "linear", "--link", "ad2", "--serial", "p", "--ad2", "1"), "two different serial numbers"),
        (("calibrate", "--link", "model"), "there are no wires to calibrate"),
        (("calibrate", "--link", "chip", "--points", "2"), "at least 3"),
        (("calibrate", "--link", "chip", "--wires", "none.toml"), "none.toml: cannot be read"),
    ],
)
def test_a_bad_line_ends_with_status_2_and_one_line(tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    assert rtds(monkeypatch, *words) == 2
    said = capsys.readouterr()
    assert message in said.err and said.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
