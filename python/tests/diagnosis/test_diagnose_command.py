"""The command line of `rtds diagnose`: both files and status 0, or one line, the right status, and nothing written."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time

import pytest
from diagnosis_cases import make_case

from rtds_host.cli.commands import main
from rtds_host.contract import builtin_robot_path, write_run
from rtds_host.diagnosis.report import validate

COMMAND = [sys.executable, "-m", "rtds_host.cli.main", "diagnose", "--quick"]


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A good case on disk, 3 runs of 3 s."""
    folder = tmp_path_factory.mktemp("case") / "good"
    folder.mkdir()
    shutil.copy(builtin_robot_path("burger"), folder / "robot.toml")
    for run in make_case(lambda m: m.add("coulomb", 0.05), seconds=3).runs:
        write_run(folder / run.name, run.meta, {"t": run.t, **run.columns})
    return folder


@pytest.fixture
def case(good, tmp_path):
    return shutil.copytree(good, tmp_path / "case")


def called(*arguments):
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, check=False)


def test_a_good_case_gives_both_files_a_summary_and_status_0(case, tmp_path):
    done = called(case, "--out", tmp_path / "out")
    assert done.returncode == 0 and done.stderr == ""
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["diagnosis.json", "report.html"]
    diagnosis = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    validate(diagnosis)
    assert [(e["id"], e["side"]) for e in diagnosis["effects"]] == [("coulomb_friction", "both")]
    assert "Coulomb friction" in done.stdout
    assert "By regime" in (tmp_path / "out" / "report.html").read_text()


def test_one_run_only_works_with_a_caveat(case, tmp_path):
    for name in ("spin", "weave"):
        shutil.rmtree(case / name)
    done = called(case, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "one run only" in (tmp_path / "out" / "report.html").read_text()


def _edit(name, old, new):
    def spoil(case):
        path = case / name
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))

    return spoil


def _rows(edit):
    def spoil(case):
        path = case / "steps" / "log.csv"
        path.write_text("\n".join(edit(path.read_text().splitlines())) + "\n")

    return spoil


def _rename_columns(*names):
    def edit(lines):
        return [",".join("other_" + c if c in names else c for c in lines[0].split(",")), *lines[1:]]

    return _rows(edit)


def _no_log(case):
    (case / "steps" / "log.csv").unlink()


def _empty(case):
    shutil.rmtree(case)
    case.mkdir()


def _no_runs(case):
    for name in ("spin", "steps", "weave"):
        shutil.rmtree(case / name)


def _other_robot(case):
    shutil.copy(builtin_robot_path("paper"), case / "steps" / "robot.toml")


def _still(case):
    for path in case.glob("*/log.csv"):
        lines = path.read_text().splitlines()
        path.write_text(
            "\n".join([lines[0], *[",".join([line.split(",")[0]] + ["0"] * line.count(",")) for line in lines[1:]]])
            + "\n"
        )


def _moment(case):
    for path in case.glob("*/log.csv"):
        path.write_text("\n".join(path.read_text().splitlines()[:6]) + "\n")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (_edit("robot.toml", "resistance_ohm", "resistance"), ("robot.toml", "[motor] resistance_ohm", "missing")),
        (_edit("robot.toml", "mass_kg = ", "mass_kg = -"), ("robot.toml", "[chassis] mass_kg", "above 0")),
        (_edit("robot.toml", "[motor]", "[motor"), ("robot.toml", "not valid TOML")),
        (lambda case: (case / "robot.toml").unlink(), ("robot.toml", "cannot be read")),
        (_edit("steps/run.json", "rtds-run/1", "rtds-run/9"), ("run.json", "schema")),
        (_rename_columns("v_cmd_r"), ("steps/log.csv", "column v_cmd_r", "missing")),
        (_rename_columns("w_l", "w_r", "th_l", "th_r"), ("steps/log.csv", "neither w_* nor th_*")),
        (_rows(lambda lines: [*lines[:40], lines[39], *lines[40:]]), ("steps/log.csv", "row 41", "time goes back")),
        (
            _rows(lambda lines: [*lines[:40], lines[40].replace(lines[40].split(",")[1], "fast", 1), *lines[41:]]),
            ("steps/log.csv", "row 41", "v_cmd_l", "'fast'"),
        ),
        (_rows(lambda lines: [*lines[:-1], lines[-1][:9]]), ("steps/log.csv", "truncated")),
        (_no_log, ("steps", "neither log.csv nor log.parquet")),
        (_other_robot, ("steps/robot.toml", "another robot")),
        (_empty, ("case", "is empty")),
        (_no_runs, ("case", "no run")),
        (_still, ("nothing",)),
        (_moment, ("spin/log.csv", "0.04 s")),
    ],
    ids=[
        "missing key",
        "impossible value",
        "no TOML",
        "no robot",
        "schema",
        "no command",
        "nothing measured",
        "time back",
        "no number",
        "truncated",
        "no log",
        "other robot",
        "empty folder",
        "no runs",
        "nothing moves",
        "too short",
    ],
)
def test_bad_input_ends_with_one_line_status_2_and_nothing_written(case, tmp_path, monkeypatch, capsys, spoil, words):
    """The entry point itself, in this process: sixteen interpreters would take longer than all the rest."""
    spoil(case)
    monkeypatch.setattr(sys, "argv", ["rtds", "diagnose", "--quick", str(case), "--out", str(tmp_path / "out")])
    with pytest.raises(SystemExit) as end:
        main()
    said = capsys.readouterr()
    assert end.value.code == 2
    assert said.err.count("\n") == 1 and said.err.startswith("rtds: ") and said.out == ""
    assert all(word in said.err for word in words), said.err
    assert [p.name for p in tmp_path.iterdir()] == ["case"]


def test_as_a_command_too_bad_input_is_one_line_and_status_2(case, tmp_path):
    (case / "robot.toml").unlink()
    done = called(case, "--out", tmp_path / "out")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"rtds: {case / 'robot.toml'}: cannot be read (No such file or directory)\n"
    assert [p.name for p in tmp_path.iterdir()] == ["case"]


def test_one_bad_case_of_two_ends_with_status_1_and_the_other_is_complete(case, tmp_path):
    bad = tmp_path / "bad"
    bad.mkdir()
    done = called(bad, case, "--out", tmp_path / "out")
    assert done.returncode == 1
    assert done.stderr.splitlines() == [
        f"rtds: {bad}: is empty, a case needs robot.toml and at least one run folder",
        "rtds: 1 of 2 cases failed: bad",
    ]
    assert sorted(p.name for p in (tmp_path / "out").iterdir() if p.name[0] != ".") == [
        "case",
        "cases.parquet",
        "index.html",
    ]
    assert sorted(p.name for p in (tmp_path / "out" / "case").iterdir()) == ["diagnosis.json", "report.html"]


def test_a_place_that_cannot_be_written_ends_with_one_line_and_status_2(case, tmp_path):
    (tmp_path / "file").write_text("")
    done = called(case, "--out", tmp_path / "file" / "out")
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and "file: is a file" in done.stderr


# The command, held while it writes, so that the signal always finds it there.
HELD = """
import time
from contextlib import contextmanager
from rtds_host.cli.main import main
from rtds_host.diagnosis import batch

staged = batch.staged_folder

@contextmanager
def held(*arguments):
    with staged(*arguments) as scratch:
        (scratch / "diagnosis.json").write_text("half")
        print("writing", flush=True)
        time.sleep(60)
        yield scratch

batch.staged_folder = held
if __name__ == "__main__":
    main()
"""


@pytest.mark.parametrize("many", [False, True], ids=["one case", "several"])
def test_ctrl_c_leaves_nothing_half_written_and_ends_with_130(case, tmp_path, many):
    script = tmp_path / "held.py"
    script.write_text(HELD)
    cases = [case, shutil.copytree(case, tmp_path / "second")] if many else [case]
    process = subprocess.Popen(
        [sys.executable, str(script), "diagnose", "--quick", *map(str, cases), "--out", str(tmp_path / "out")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stdout.readline() == "writing\n"
    # As a terminal does it: to the whole group.
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate()
    assert process.returncode == 130
    # Behind the ^C that a terminal shows, on a line of its own.
    assert said == "\nrtds: interrupted\n"
    left = [p for p in (tmp_path / "out").rglob("*") if p.is_file() and ".rtds" not in p.parts]
    assert left == []
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")]


def test_ctrl_c_in_the_middle_of_the_search_ends_with_130(case, tmp_path):
    """Early on, while modules load, or in the search: wherever it strikes, one line and no output."""
    process = subprocess.Popen(
        [*COMMAND, str(case), "--out", str(tmp_path / "out")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    # The first thread of the search's own tells that it has begun.
    while len(os.listdir(f"/proc/{process.pid}/task")) < 2:
        assert process.poll() is None
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate()
    assert (process.returncode, said) == (130, "\nrtds: interrupted\n")
    assert [p.name for p in tmp_path.iterdir()] == ["case"]
