"""`rtds export`: files, lists, the check in MuJoCo, draws, and what it refuses."""

import json
import re

import pytest
from export_cases import LABELLED, ROBOT, measured_run, model_with, write_labelled
from typer.testing import CliRunner

from rtds_host.cli.export import app
from rtds_host.errors import RtdsError
from rtds_host.export.check import check
from rtds_host.export.figures import figures_of
from rtds_host.export.mjcf import write

RUNNER = CliRunner()


def export(*words):
    return RUNNER.invoke(app, [str(w) for w in words], catch_exceptions=True)


@pytest.mark.parametrize("name", LABELLED)
def test_the_exported_mujoco_robot_closes_what_the_replay_closes(name, tmp_path):
    file = tmp_path / "robot.xml"
    model = model_with(*LABELLED[name])
    file.write_text(write(figures_of(model, ROBOT), ""))
    checked = check(file, ROBOT, model, [measured_run(LABELLED[name], seed=3)])
    assert checked.replay.before > 2.0 and checked.replay.closed > 0.9
    assert checked.share >= 0.8


def test_a_robot_without_the_effects_closes_nothing(tmp_path):
    file = tmp_path / "robot.xml"
    file.write_text(write(figures_of(model_with(), ROBOT), ""))
    checked = check(file, ROBOT, model_with(*LABELLED["friction"]), [measured_run(LABELLED["friction"])])
    assert checked.mujoco.closed == pytest.approx(0.0, abs=1e-9) and checked.share == pytest.approx(0.0, abs=1e-9)


def test_the_command_writes_lists_and_checks(tmp_path):
    case = write_labelled("driver", tmp_path / "case")
    done = export(case / "diagnosis.json", "--to", "mjcf", "--out", tmp_path / "robot.xml", "--check", case / "run")
    assert done.exit_code == 0, done.output
    assert "own       driver_gain (both) ratio = 0.9" in done.output
    assert "number    driver_deadzone (left) volts = 0.5" in done.output
    share = float(re.search(r"MuJoCo closes ([\d.]+) of what the replay closes", done.output)[1])
    assert share >= 0.8
    assert "driver_deadzone (left)" in (tmp_path / "robot.xml").read_text()


def test_draws_are_files_with_their_sizes(tmp_path):
    case = write_labelled("friction", tmp_path / "case")
    done = export(case / "diagnosis.json", "--to", "urdf", "--samples", 3, "--seed", 7, "--out", tmp_path / "many")
    assert done.exit_code == 0, done.output
    content = json.loads((tmp_path / "many" / "samples.json").read_text())
    values = [sample["effects"][0]["parameters"]["torque_nm"] for sample in content["samples"]]
    assert len(set(values)) == 3 and content["seed"] == 7
    for sample, value in zip(content["samples"], values, strict=True):
        assert f'friction="{value:.9g}"' in (tmp_path / "many" / sample["name"]).read_text()


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--to", "mjfc"], "--to mjfc: unknown"),
        (["--to", "urdf", "--check", "run"], "only what is exported --to mjcf"),
        (["--to", "mjcf", "--samples", "2", "--check", "run"], "--check: not with --samples"),
    ],
)
def test_a_wrong_option_is_refused_and_nothing_written(words, complaint, tmp_path):
    case = write_labelled("friction", tmp_path / "case")
    done = export(case / "diagnosis.json", *words, "--out", tmp_path / "robot.xml")
    assert isinstance(done.exception, RtdsError) and complaint in str(done.exception)
    assert not (tmp_path / "robot.xml").exists()


def test_without_a_robot_next_to_the_diagnosis_one_is_asked_for(tmp_path):
    case = write_labelled("friction", tmp_path / "case")
    (case / "robot.toml").unlink()
    done = export(case / "diagnosis.json", "--to", "mjcf", "--out", tmp_path / "robot.xml")
    assert isinstance(done.exception, RtdsError) and "name the nominal robot by --robot" in str(done.exception)


def test_a_file_of_another_kind_is_no_robot(tmp_path):
    from rtds_host.export.mujoco_replay import ExportedRobot

    (tmp_path / "other.xml").write_text("<mujoco/>")
    with pytest.raises(RtdsError, match=r"other.xml: is not a robot of `rtds export --to mjcf`"):
        ExportedRobot(tmp_path / "other.xml")


def test_a_missing_source_is_named_as_missing(tmp_path):
    for to, name, complaint in (
        ("mjcf", "none.json", "none.json: no such file"),
        ("c", "none.json", "none.json: no such file, and no robot of the package"),
        ("fmu", "burgr", "did you mean 'burger'?"),
    ):
        done = export(name, "--to", to, "--out", tmp_path / "out")
        assert isinstance(done.exception, RtdsError) and complaint in str(done.exception), to
    assert not list(tmp_path.iterdir())


def test_an_unknown_target_lists_the_compiled_ones(tmp_path):
    done = export("burger", "--to", "fmu-robot", "--out", tmp_path / "out")
    assert isinstance(done.exception, RtdsError) and "python, fmu, fmu-motors, c)" in str(done.exception)


def test_a_module_of_another_origin_is_not_replaced_by_the_driver(tmp_path):
    case = write_labelled("friction", tmp_path / "case")
    other = tmp_path / "robot_driver.py"
    other.write_text("print('mine')\n")
    words = (case / "diagnosis.json", "--to", "mjcf", "--actuator", "dcmotor", "--out", tmp_path / "robot.xml")
    done = export(*words)
    assert isinstance(done.exception, RtdsError) and "robot_driver.py" in str(done.exception)
    assert other.read_text() == "print('mine')\n" and not (tmp_path / "robot.xml").exists()
    other.unlink()
    assert export(*words).exit_code == 0 and export(*words).exit_code == 0
