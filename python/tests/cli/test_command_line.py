"""A name that is nearly right is recognised, a place that cannot hold the result is refused before the work, nothing is
cut on a narrow terminal, and shells complete."""

import re
import subprocess
import sys

import pytest

from rtds_host.cli.commands import COMMANDS, main
from rtds_host.cli.completion import known_commands, script
from rtds_host.contract import read_run
from rtds_host.export.table import TARGETS


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
    assert line.startswith("rtds: no such command: 'quux' (known: demo, ") and "did you mean" not in line


def test_a_diagnosis_that_cannot_be_written_is_refused_before_the_case_is_read(tmp_path, monkeypatch, capsys):
    (tmp_path / "file").write_text("")
    status, line = said(["diagnose", tmp_path / "no-case", "--out", tmp_path / "file" / "out"], monkeypatch, capsys)
    assert (status, line) == (2, f"rtds: {tmp_path}/file: is a file, a folder is needed for the output")


@pytest.mark.parametrize("words", [
    ["run", "linear", "--link", "model"], ["calibrate", "--link", "chip"], ["diagnose", "no-case"], ["close",
    "no-case"],
    ["predict", "no-run", "--robot", "no.toml"], ["export", "no.json", "--robot", "no.toml", "--to", "urdf"],
    ["export", "no.json", "--robot", "no.toml", "--to", "urdf", "--samples", "2"], ["plan", "no.toml"],
    ["import", "no.mcap"], ["blind", "make", "--n", "1"], ["blind", "answer"], ["blind", "score"],
])  # fmt: skip
def test_every_command_looks_at_its_output_before_the_work(words, tmp_path, monkeypatch, capsys):
    """Its inputs do not exist, or the work would take minutes; the place of the result is what it complains of."""
    (tmp_path / "file").write_text("")
    monkeypatch.chdir(tmp_path)
    status, line = said([*words, "--out", "file/out"], monkeypatch, capsys)
    assert (status, line) == (2, f"rtds: {tmp_path}/file: is a file, a folder is needed for the output")


@pytest.mark.parametrize(("words", "meant"), [
    (["run", "steps", "--set", "strech=2"], "stretch"),
    (["run", "all", "--set", "radius=2"], "radius_m"),
    (["run", "linear", "--robot", "burgr"], "burger"),
    (["run", "linear", "--engine", "mujico"], "mujoco"),
    (["run", "linear", "--controller", "exakt"], "exact"),
    (["run", "linear", "--effect", "driver_gain.ration=2"], "ratio"),
    (["import", "no.csv", "--mapping", "bad.toml", "--out", "case"], "gyro_z"),
    (["import", "no.csv", "--mapping", "turtlebot", "--out", "case"], "turtlebot3"),
])  # fmt: skip
def test_parameters_engines_and_channels_that_are_nearly_right_are_recognised(
    words, meant, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "no.csv").write_text("t\n0\n")
    (tmp_path / "bad.toml").write_text('schema = "rtds-mapping/1"\n[signal]\ngyroz = {column = "g", unit = "rad/s"}\n')
    status, line = said(words, monkeypatch, capsys)
    assert status == 2 and f"did you mean {meant!r}?" in line


def test_a_column_that_is_nearly_a_channel_is_named(tmp_path):
    (tmp_path / "run.json").write_text('{"schema": "rtds-run/1"}')
    (tmp_path / "log.csv").write_text("t,v_cmd_l,v_cmd_r,vbus,temperature\n0,0,0,0,20\n1,0,0,0,20\n")
    one, other = read_run(tmp_path).notices
    assert one.endswith("column 'vbus' is not in the format, ignored; did you mean 'v_bus'?")
    assert other.endswith("'temperature' is not in the format, ignored")


def shown(words, monkeypatch, capsys, columns):
    """What `rtds WORDS…` prints on a terminal so many columns wide."""
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    monkeypatch.setattr(sys, "argv", ["rtds", *words])
    with pytest.raises(SystemExit):
        main()
    return re.sub(r"\x1b\[[\d;]*m", "", capsys.readouterr().out)


def commands():
    """Every command and sub-command."""
    found = [[]]
    for name, one in known_commands().items():
        found += [[name], *([name, child] for child in one.commands)]
    return found


@pytest.mark.parametrize(
    "words",
    [*([*c, "--help"] for c in commands()), ["effects"], ["run", "--list"], ["effects", "longitudinal_slip"]],
    ids=" ".join,
)
def test_nothing_is_cut_at_eighty_columns(words, monkeypatch, capsys):
    narrow = shown(words, monkeypatch, capsys, 80)
    assert max(map(len, narrow.splitlines())) <= 80
    assert "…" not in narrow
    # Every word of the wide one is there whole.
    wide = shown(words, monkeypatch, capsys, 400)
    plain = "".join(narrow.split()).replace("│", "")
    missing = [word for word in re.findall(r"[\w.=,/-]{4,}", wide) if word not in plain]
    assert not missing


def test_a_shell_completes_commands_options_scenarios_and_effects():
    def complete(*words, part=""):
        """What may stand behind these words, beginning with `part`."""
        told = 'source /dev/stdin; COMP_WORDS=(rtds "$@"); COMP_CWORD=$#; _rtds; printf "%s\\n" "${COMPREPLY[@]}"'
        done = subprocess.run(
            ["bash", "-c", told, "bash", *words, part], input=script("bash"), capture_output=True, text=True, check=True
        )
        return done.stdout.split()

    assert set(complete()) == set(COMMANDS)
    assert complete("run", "linear", part="--li") == ["--list", "--link", "--live"]
    assert complete("blind", "make", part="--se") == ["--seed"]
    assert {"circle", "linear", "all"} <= set(complete("run"))
    assert complete("export", "x.json", "--to") == list(TARGETS)
    assert "coulomb_friction" in complete("effects") and "driver_gain.ratio=" in complete("run", "eight", "--effect")
    assert complete("blind") == ["make", "answer", "score"]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_completion_names_every_command_and_option(shell):
    text = script(shell)
    for name, one in known_commands().items():
        assert name in text
        for option in one.options:
            assert (option if shell != "fish" else f"-l {option.removeprefix('--')}") in text


@pytest.mark.parametrize("command", ["diagnose", "close"])
def test_a_seed_of_scripts_is_taken_and_said_to_change_nothing(command, tmp_path, monkeypatch, capsys):
    """The case is missing, which is found after the words are read: none of them is refused."""
    words = ["rtds", command, str(tmp_path / "no-case"), "--out", str(tmp_path / "out"), "--seed", "1"]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as ended:
        main()
    lines = capsys.readouterr().err.splitlines()
    assert ended.value.code == 2
    assert "--seed has no effect: a diagnosis uses no random numbers" in lines
    assert "no-case" in lines[-1] and not any("No such option" in line for line in lines)
