"""`rtds close`: the gap in the real-time simulator before and after, next to the replay's own."""

import json
from dataclasses import replace

import numpy as np
import pytest
from correction_cases import ROBOT, commands, diagnosis_of, model_with, replayed_case, write_case
from typer.testing import CliRunner

from rtds_host.cli.close import app
from rtds_host.contract import Case
from rtds_host.correction.close import VARIATIONS, close, close_folder, held_out
from rtds_host.correction.simulate import Setting, simulate
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.errors import InputError
from rtds_host.robot import available_engines

FRICTION = ("coulomb_friction", "both", {"torque_nm": 0.04})


@pytest.fixture(scope="module")
def case():
    return replayed_case(model_with(FRICTION))


@pytest.fixture(scope="module")
def found(case):
    return close(case, diagnosis=diagnosis_of(FRICTION), causes=False)


def test_the_gap_closes_in_the_simulator_as_in_the_replay(found):
    gap = found.content["gap"]
    assert gap["simulator"]["before"] > 3.0
    assert gap["simulator"]["after"] == pytest.approx(1.0, abs=0.1)
    assert gap["share_of_replays_closure"] > 0.98


def test_simulator_and_replay_lie_far_within_the_noise(found):
    for which in ("nominal", "corrected"):
        assert found.content["difference"][which]["gap"] < 0.1


def test_every_channel_is_told(found):
    channels = found.content["gap"]["channels"]
    assert {"i_l", "w_r", "gyro_z", "x", "yaw"} <= channels.keys()
    for entry in channels.values():
        assert entry.keys() == {"replay_before", "replay_after", "simulator_before", "simulator_after"}


def test_late_stamps_are_put_right_before_runs_are_replayed(case, found):
    """As a diagnosis does: what the robot answered is compared with what it was asked then."""
    rng = np.random.default_rng(6)

    def stamped(log):
        late = np.maximum.accumulate(log.t + 0.001 * rng.standard_normal(len(log.t))) + 1e-9 * np.arange(len(log.t))
        return replace(log, t=late)

    late = close(
        replace(case, runs=tuple(stamped(log) for log in case.runs)), diagnosis=diagnosis_of(FRICTION), causes=False
    )
    assert any("rows come evenly" in note for note in late.notes)
    for which in ("simulator", "replay"):
        assert late.content["gap"][which]["after"] == pytest.approx(found.content["gap"][which]["after"], abs=0.1)


def test_what_differs_is_varied_one_at_a_time(case):
    found = close(Case(case.name, case.robot, (case.runs[0],)), diagnosis=diagnosis_of(FRICTION), hold_out=None)
    causes = {row["varied"]: row for row in found.content["difference"]["causes"]}
    assert {text for text, _, _ in VARIATIONS} <= causes.keys()
    late = causes["torques exchanged each 32 ms, one exchange late"]
    told = causes["torques exchanged each 1 ms, one exchange late"]
    assert late["from_replay"] > 5.0 * told["from_replay"] > causes["nothing"]["from_replay"] > 0.0


def test_without_a_diagnosis_the_last_run_is_held_out():
    case = replayed_case(model_with(FRICTION), seconds=1.0, count=3)
    assert held_out(case, None) == ("run2",)
    assert held_out(case, ["run0", "run1"]) == ("run0", "run1")
    with pytest.raises(InputError, match="no run would be left"):
        held_out(case, ["run0", "run1", "run2"])
    with pytest.raises(InputError, match="no such run"):
        held_out(case, ["other"])


def test_files_are_written_whole(case, tmp_path):
    folder = write_case(Case(case.name, case.robot, case.runs[:1]), tmp_path / "case")
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps(diagnosis_of(FRICTION)))
    close_folder(folder, tmp_path / "out", path, causes=False)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["close.json", "close.png", "diagnosis.json"]
    content = json.loads((tmp_path / "out" / "close.json").read_text())
    assert content["schema"] == "rtds-close/1"
    assert content["runs"] == ["run0"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--link", "chip"], "--link chip: unknown"),
        (["--engine", "dart"], "--engine 'dart': unknown"),
        (["--diagnosis", "missing.json"], "missing.json: cannot be read"),
        (["--hold-out", "nobody"], "--hold-out nobody"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(case, tmp_path, options, words):
    folder = write_case(Case(case.name, case.robot, case.runs[:1]), tmp_path / "case")
    got = CliRunner().invoke(app, [str(folder), "--out", str(tmp_path / "out"), *options])
    assert isinstance(got.exception, InputError)
    assert words in str(got.exception)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "driver", ['mode = "torque"\ntorque_nm_per_v = 0.1', 'mode = "speed"\n[servo]\nlimit_v = 12\nperiod_s = 0.001']
)
def test_a_robot_that_is_not_driven_by_voltage_is_refused_before_it_is_diagnosed(case, tmp_path, monkeypatch, driver):
    monkeypatch.setattr("rtds_host.correction.close.diagnose", lambda *a, **k: pytest.fail("diagnosed"))
    runs = [
        replace(run, columns={**run.columns, "w_cmd_l": run.columns["w_l"], "w_cmd_r": run.columns["w_r"]})
        for run in case.runs
    ]
    folder = write_case(replace(case, runs=tuple(runs)), tmp_path / "case")
    with open(folder / "robot.toml", "a") as file:
        file.write(f"\n[driver]\n{driver}\n")
    with pytest.raises(InputError, match=r"robot\.toml: \[driver\] mode is '(torque|speed)'.* drives by voltage"):
        close_folder(folder, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("engine", available_engines())
def test_uneven_times_delays_and_slow_channels_are_taken_as_they_are(engine):
    model = model_with(
        ("command_delay", "both", {"seconds": 0.0137}), ("measurement_delay", "both", {"seconds": 0.0061})
    )
    log = commands(1.5, 5)
    rng = np.random.default_rng(0)
    t = np.round(np.cumsum(rng.uniform(0.003, 0.007, len(log.t))), 4)
    log = type(log)(log.name, log.meta, t, log.columns)
    out = simulate(log, ROBOT, model, Setting(engine=engine)).out
    replayed = replay_run(model, run_inputs(log, ROBOT), 1e-4)
    noise = np.array([ROBOT.noise(c) for c in ("i_l", "w_l", "gyro_z", "yaw")])
    for k, one in zip((1, 3, 7, 10), noise, strict=True):
        assert np.sqrt(np.mean((out[:, k] - replayed[:, k]) ** 2)) < 0.1 * one


def test_a_log_that_starts_in_motion_is_noted():
    log = commands(0.5, 1)
    columns = dict(log.columns)
    columns["w_l"] = np.full(len(log.t), 2.0)
    moving = type(log)(log.name, log.meta, log.t, columns)
    assert "starts in motion" in simulate(moving, ROBOT, nominal_model(ROBOT)).notes[0]


@pytest.mark.parametrize("verdict", [None, 5, "perhaps"])
def test_a_diagnosis_with_another_verdict_is_refused_and_nothing_is_written(case, tmp_path, verdict):
    folder = write_case(case, tmp_path / "case")
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps(diagnosis_of(FRICTION, verdict=verdict)))
    with pytest.raises(InputError, match=r"diagnosis\.json: verdict"):
        close_folder(folder, tmp_path / "out", path, causes=False)
    assert not (tmp_path / "out").exists()
