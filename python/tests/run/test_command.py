"""`rtds run` as it is typed."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from rtds_host.cli.commands import main
from rtds_host.contract import builtin_robot_path, read_case

SHORT = ["--duration", "1.6", "--length", "0.15", "--set", "ramp_s=0.5", "--set", "stop_s=0.5"]


def command(*words):
    return [sys.executable, "-m", "rtds_host.cli.main", "run", *map(str, words)]


def rtds(*words, cwd=None):
    return subprocess.run(command(*words), capture_output=True, text=True, cwd=cwd, timeout=300, check=False)


def test_a_run_prints_its_figures_and_leaves_a_run_folder(tmp_path):
    done = rtds("linear", "--link", "model", *SHORT, "--out", tmp_path / "run")
    assert (done.returncode, done.stderr) == (0, "")
    for words in (
        "end of the path",
        "speed error (rms)",
        "'exact' at 32 ms",
        "'paper' at 128 ms",
        "peak current",
        "energy drawn",
        "recovered",
        "balance",
        "3200 simulator steps",
        "about 2000",
        "times real time",
    ):
        assert words in done.stdout, words
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["scenario"] == "linear" and summary["simulated_s"] == 1.6
    assert (tmp_path / "run" / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "run" / "figure.pdf").read_bytes().startswith(b"%PDF")


def test_all_writes_a_case(tmp_path):
    out = tmp_path / "case"
    done = rtds(
        "all",
        "--link",
        "model",
        "--duration",
        14,
        "--length",
        0.5,
        "--set",
        "scale=0.05",
        "--radius",
        0.12,
        "--set",
        "turns=0.5",
        "--robot",
        "paper",
        "--no-compare",
        "--no-figure",
        "--out",
        out,
    )
    assert (done.returncode, done.stderr) == (0, "")
    case = read_case(out)
    assert [run.name for run in case.runs] == ["circle", "eight", "linear"]
    assert (out / "robot.toml").read_bytes() == builtin_robot_path("paper").read_bytes()


def test_a_manoeuvre_is_driven_by_voltage_and_has_no_reference(tmp_path):
    done = rtds("steps", "--link", "model", "--set", "stretch=0.1", "--no-figure", "--out", tmp_path / "run")
    assert done.returncode == 0
    assert "speed error" not in done.stdout
    assert "w_ref" not in (tmp_path / "run" / "log.csv").read_text().splitlines()[0]


def test_a_robot_that_stands_still_has_no_share_of_nothing(tmp_path):
    done = rtds("standstill", "--link", "model", "--duration", 1, "--no-figure", "--out", tmp_path / "run")
    assert (done.returncode, done.stderr) == (0, "")
    assert "stood still" in done.stdout and "%" not in done.stdout
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["robot_energy_gap"] is None


def test_list_names_every_scenario_with_its_parameters():
    done = rtds("--list")
    assert done.returncode == 0
    for words in ("linear", "circle", "eight", "teleop", "radius_m = 0.5", "duration_s = 60"):
        assert words in done.stdout


@pytest.mark.parametrize(
    "words, said",
    [
        (["waltz"], "scenario 'waltz': unknown (known: linear, circle, eight"),
        ([], "no scenario given"),
        (["circle", "--radius", "0"], "radius_m is 0, it must be above half the track"),
        (["linear", "--duration", "10"], "beyond the motors' reach"),
        (["linear", "--robot", "none.toml"], "none.toml: cannot be read"),
        (["linear", "--set", "length_m"], "--set length_m: name=number is needed"),
        (["linear", "--set", "colour=3"], "has no parameter 'colour'"),
        (["all", "--set", "colour=3"], "none of linear, circle, eight has a parameter 'colour'"),
        (["linear", "--link", "telepathy"], "'telepathy' is unknown"),
        (["linear", "--step-clocks", "few"], "--step-clocks few"),
        (["linear", "--against", "chaos"], "--against 'chaos': unknown (known: pybullet, mujoco)"),
        (["linear", "--format", "xls"], "--format xls: unknown"),
        (["linear", "--method", "magic", "--link", "model"], "method: 'magic'"),
        (["linear", "--set", "length_m=nan"], "length_m is nan, a finite number is needed"),
        (["linear", "--step", "1e-12", "--link", "model"], "step: is 1e-12 s, it must be at least 1e-07"),
        (["linear", "--uphill-yaw", "180.5"], "uphill yaw: is 180.5 rad, it must lie within -100 to 100"),
    ],
)
def test_bad_input_is_one_line_and_status_2_and_writes_nothing(tmp_path, monkeypatch, capfd, words, said):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["rtds", "run", *words])
    with pytest.raises(SystemExit) as left:
        main()
    printed = capfd.readouterr()
    assert left.value.code == 2
    assert said in printed.err and printed.err.count("\n") == 1
    assert printed.out == "" and list(tmp_path.iterdir()) == []


def test_an_output_that_cannot_be_written_is_said_before_the_run(tmp_path):
    (tmp_path / "taken").write_text("here already")
    done = rtds("eight", "--link", "model", "--out", tmp_path / "taken")
    assert done.returncode == 2 and "is a file" in done.stderr
    assert (tmp_path / "taken").read_text() == "here already"


def test_interrupted_it_leaves_nothing_half_written(tmp_path):
    child = subprocess.Popen(
        command("all", "--link", "model", "--out", tmp_path / "case"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 120
    while not any(tmp_path.iterdir()) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert any(tmp_path.iterdir()), "the scratch folder stands beside the target while the runs go on"
    time.sleep(0.5)
    os.kill(child.pid, signal.SIGINT)
    _, errors = child.communicate(timeout=120)
    assert child.returncode == 130 and "interrupted" in errors
    assert list(tmp_path.iterdir()) == []
