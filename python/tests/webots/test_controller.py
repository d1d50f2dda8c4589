"""The controller for Webots, started as Webots starts it, against a mock of Webots' documented interface.

It has never been run in Webots itself.
"""

import json
import shutil
import sys
from dataclasses import replace

import numpy as np
import pytest
from webots_start import start

from rtds_host.contract import builtin_robot_path, load_robot, read_run
from rtds_host.errors import InputError, OutputError
from rtds_host.run import LinkChoice, Options, make_plan, perform, write_outcome
from rtds_host.webots.controller import drive_world
from rtds_host.webots.engine import RunEnded, WebotsEngine
from rtds_host.webots.project import Settings, read_settings, write_project

BURGER = builtin_robot_path("burger")
SHORT = ("duration_s=3", "length_m=0.3", "ramp_s=1", "stop_s=1")
SHORT_VALUES = {"duration_s": 3.0, "length_m": 0.3, "ramp_s": 1.0, "stop_s": 1.0}
MODEL = Settings(link="model")
# Files of a run folder, by the contract and for the reader.
FILES = {"run.json", "log.csv", "robot.toml", "summary.json", "figure.png", "figure.pdf"}


def project(folder, settings=MODEL, *scenarios):
    write_project(folder, settings, BURGER, sys.executable, scenarios or ("linear",))
    return folder


def driven(folder, scenario="linear", **options):
    done = start(folder / "worlds" / f"{scenario}.wbt", **options)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return done.stdout


@pytest.fixture
def drive_here(supervisor, mock):
    """Drives a project's world in this process; the outcome."""

    def drive(folder, scenario="linear"):
        mock.Robot.created = False
        settings = read_settings(folder / "webots.json")
        return drive_world(supervisor(folder / "worlds" / f"{scenario}.wbt"), folder, settings)[0]

    return drive


def log_of(folder):
    run = read_run(folder, load_robot(BURGER))
    return {"t": run.t, **run.columns}


def reference(folder, scenario="linear", values=None, effects=None, link="model", **options):
    plan = make_plan(scenario, values, Options(engine="mujoco", **options))
    outcome = perform(plan, LinkChoice(link), compare=False, effects=effects)
    write_outcome(outcome, folder, figure=False)
    return outcome


def assert_logs_agree(here, there, exchange_rows):
    """Equal times, and every channel within what it changes by in one exchange; here it is even far closer."""
    ours, theirs = log_of(here), log_of(there)
    assert ours.keys() == theirs.keys() and np.array_equal(ours["t"], theirs["t"])
    for name in ours:
        off = np.abs(ours[name] - theirs[name])
        windows = np.lib.stride_tricks.sliding_window_view(
            np.pad(theirs[name], exchange_rows, mode="edge"), 2 * exchange_rows + 1
        )
        assert (off <= np.ptp(windows, axis=1) + 1e-6).all(), name
        assert off.max() <= 1e-5, (name, off.max())


@pytest.fixture(scope="module")
def paper(tmp_path_factory):
    return project(tmp_path_factory.mktemp("paper"), MODEL, "linear", "circle", "eight")


@pytest.mark.parametrize("scenario", ["linear", "circle", "eight"])
def test_the_paper_s_trajectories_are_those_of_rtds_run_within_one_exchange(paper, tmp_path, scenario):
    said = driven(paper, scenario)
    run = paper / "runs" / scenario
    assert {place.name for place in run.iterdir()} == FILES
    reference(tmp_path / "run", scenario)
    assert_logs_agree(run, tmp_path / "run", exchange_rows=4)
    summary = json.loads((run / "summary.json").read_text())
    assert summary["engine"] == "webots" and summary["model_agrees"]
    assert summary["robot_energy_gap"] < 1e-3
    assert "end of the path" in said


def test_the_motors_in_rtl_write_the_log_of_those_in_the_model(tmp_path, drive_here):
    for link in ("model", "rtl"):
        drive_here(project(tmp_path / link, Settings(link=link, setting=SHORT)))
    logs = [(tmp_path / link / "runs/linear/log.csv").read_bytes() for link in ("model", "rtl")]
    assert logs[0] == logs[1]
    assert "rtl (verilator" in json.loads((tmp_path / "rtl/runs/linear/summary.json").read_text())["link"]


def test_a_robot_with_effects_is_the_one_of_rtds_run(tmp_path, drive_here):
    effect = ("coulomb_friction.torque_nm=0.05,side=left", "payload_error.mass_kg=0.3", "wheel_radius_error.ratio=1.02")
    settings = Settings(link="model", setting=SHORT, effect=effect)
    folder = project(tmp_path / "project", settings)
    drive_here(folder)
    plan = settings.plan("linear", folder)
    reference(tmp_path / "run", values=SHORT_VALUES, effects=settings.effects(plan, folder))
    assert_logs_agree(folder / "runs/linear", tmp_path / "run", exchange_rows=4)
    assert len(json.loads((folder / "runs/linear/summary.json").read_text())["effects"]) == 3


def test_webots_own_step_may_be_the_papers_32_ms(tmp_path, drive_here):
    settings = Settings(link="model", setting=("duration_s=3.072", *SHORT[1:]), time_step_ms=32, controller="paper")
    drive_here(project(tmp_path / "project", settings))
    run = read_run(tmp_path / "project/runs/linear", load_robot(BURGER))
    assert np.allclose(np.diff(run.t), 0.128)
    summary = json.loads((tmp_path / "project/runs/linear/summary.json").read_text())
    # The wheel takes a step of speed in one step of Webots, and the path is still the reference's.
    assert summary["exchange_s"] == 0.128 and summary["end_position_error_m"] < 0.005


def test_the_run_is_driven_once_more_in_an_engine_of_the_package(tmp_path):
    said = driven(project(tmp_path, Settings(link="model", setting=SHORT, against="mujoco", quit=True)))
    assert "webots - mujoco" in said and said.splitlines()[-1] == "simulationQuit(0)"
    assert json.loads((tmp_path / "runs/linear/summary.json").read_text())["engine_gap"]["end_position_m"] < 1e-6


def test_a_run_that_webots_ends_writes_nothing(tmp_path):
    folder = project(tmp_path, Settings(link="model", setting=SHORT))
    done = start(folder / "worlds/linear.wbt", end_ms=1200)
    assert done.returncode == 2 and not (folder / "runs").exists()
    assert done.stderr == "rtds: Webots ended the run before its time; nothing is written\n"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("rotation 0 1 0 0.1", "rotation 0 1 0 0.05", "off a slope of 0.1"),
        ("mass 2.92396694215", "mass 0.92396694215", "its mass and slope ask for"),
        ('"left wheel motor"', '"left motor"', "no device 'left wheel motor'"),
        ("maxVelocity 71.0028501727", "maxVelocity 0.05", "its motor allows 0.05"),
        ("maxTorque 23.5824139535", "maxTorque 0.01", "gives all it has"),
        ("basicTimeStep 1", "basicTimeStep 5", "5 ms do not divide"),
        ('customData "linear"', 'customData "lienar"', "did you mean 'linear'"),
    ],
)
def test_a_world_that_does_not_fit_is_refused_and_writes_nothing(tmp_path, drive_here, old, new, said):
    folder = project(tmp_path, Settings(link="model", setting=SHORT))
    world = folder / "worlds/linear.wbt"
    text = world.read_text()
    assert old in text
    world.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=said):
        drive_here(folder)
    assert not (folder / "runs").exists()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ('{"schema": "rtds-webots/1", "lnik": "model"}', "'lnik' is not a setting; did you mean 'link'"),
        ('{"schema": "rtds-webots/1", "quit": "yes"}', "quit: 'yes' is not of the kind"),
        ('{"schema": "rtds-webots/1", "time_step_ms": 1.5}', "time_step_ms: 1.5"),
        ('{"schema": "rtds-webots/1", "effect": "x"}', "effect: 'x'"),
        ('{"schema": "other"}', "schema is not"),
        ("[1]", "schema is not"),
    ],
)
def test_settings_that_cannot_be_used_are_named(tmp_path, content, said):
    place = tmp_path / "webots.json"
    place.write_text(content)
    with pytest.raises(InputError) as caught:
        read_settings(place)
    assert said in str(caught.value) and str(place) in str(caught.value)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (replace(MODEL, time_step_ms=0), "it must lie within 1 to 64"),
        (replace(MODEL, time_step_ms=5), "do not divide the exchange interval"),
        (replace(MODEL, time_step_ms=8, effect=("coulomb_friction.torque_nm=0.05",)), "it must be 1"),
        (replace(MODEL, time_step_ms=8, setting=("duration_s=24.001",)), "do not divide the run"),
        (replace(MODEL, setting=("lenght_m=1",)), "did you mean 'length_m'"),
        (replace(MODEL, link="modle"), "modle"),
        (replace(MODEL, effect=("nothing.x=1",)), "not in the catalogue"),
        (replace(MODEL, diagnosis="missing.json"), "missing.json"),
    ],
)
def test_a_project_that_could_not_run_is_not_written(tmp_path, settings, said):
    with pytest.raises(InputError, match=said):
        project(tmp_path / "project", settings)
    assert not (tmp_path / "project").exists()


def test_a_folder_with_other_worlds_is_left_alone(tmp_path):
    project(tmp_path)
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs/kept").write_text("")
    project(tmp_path, MODEL, "circle")
    assert (tmp_path / "runs/kept").exists() and not (tmp_path / "worlds/linear.wbt").exists()
    (tmp_path / "worlds/mine.wbt").write_text("")
    with pytest.raises(OutputError, match="mine.wbt"):
        project(tmp_path)
    assert (tmp_path / "worlds/circle.wbt").exists()


def test_a_diagnosis_goes_along_and_the_folder_can_be_moved(tmp_path, drive_here):
    diagnosis = {
        "schema": "rtds-diagnosis/1",
        "case": "x",
        "verdict": "known",
        "effects": [
            {"id": "coulomb_friction", "side": "left", "parameters": {"torque_nm": {"value": 0.05, "unit": "N*m"}}}
        ],
        "nominal_fit": {},
    }
    place = tmp_path / "diagnosis.json"
    place.write_text(json.dumps(diagnosis))
    project(tmp_path / "first", Settings(link="model", setting=SHORT, diagnosis=str(place)))
    place.unlink()
    shutil.move(tmp_path / "first", tmp_path / "second")
    drive_here(tmp_path / "second")
    summary = json.loads((tmp_path / "second/runs/linear/summary.json").read_text())
    assert summary["effects"] == ["coulomb_friction.torque_nm=0.05,side=left"]


def test_the_mock_refuses_what_webots_refuses(tmp_path, mock, supervisor):
    robot = supervisor(project(tmp_path, replace(MODEL, time_step_ms=4)) / "worlds/linear.wbt")
    motor, sensor, gps = (robot.getDevice(name) for name in ("left wheel motor", "left wheel sensor", "gps"))
    assert robot.getDevice("camera") is None
    refused = [
        lambda: mock.Supervisor(),
        lambda: motor.setPosition(float("nan")),
        lambda: motor.setVelocity(float("nan")),
        lambda: motor.setVelocity(-1.0),
        lambda: motor.setVelocity(1e3),
        lambda: motor.setAvailableTorque(1e3),
        lambda: motor.getTorqueFeedback(),
        lambda: sensor.getValue(),
        lambda: gps.getValues(),
        lambda: sensor.enable(-4),
        lambda: sensor.enable(6),
        lambda: robot.step(6),
        lambda: robot.step(0),
        lambda: robot.step(4.0),
        lambda: robot.step(4),
    ]
    for k, act in enumerate(refused):
        with pytest.raises(mock.Refused):
            act()
            pytest.fail(f"the mock took number {k}")
    sensor.enable(8)
    for one in robot.motors:
        one.setPosition(float("inf"))
        one.setVelocity(0.5)
    robot.step(4)
    with pytest.raises(mock.Refused, match="first sampling period"):
        sensor.getValue()
    robot.step(4)
    assert sensor.getValue() == pytest.approx(0.004)
    motor.setVelocity(-0.5)
    robot.step(4)
    assert sensor.getValue() == pytest.approx(0.002)


def test_a_torque_of_the_other_sign_is_noticed(tmp_path, mock, supervisor, monkeypatch):
    folder = project(tmp_path)
    monkeypatch.setattr(
        mock.Motor, "getTorqueFeedback", lambda motor: -motor.torque if motor.feedback.check_ready() is None else 0.0
    )
    with pytest.raises(InputError, match="another sign"):
        drive_world(supervisor(folder / "worlds/linear.wbt"), folder, MODEL)


def test_the_engine_reports_pose_wheels_and_energy_of_the_world(tmp_path, supervisor):
    folder = project(tmp_path, MODEL, "eight")
    plan = MODEL.plan("eight", folder)
    robot = supervisor(folder / "worlds/eight.wbt")
    with WebotsEngine(robot, plan.body, plan.motion.start) as engine:
        state = engine.state()
        assert (state.x_m, state.y_m, state.yaw_rad) == pytest.approx(plan.motion.start, abs=1e-9)
        before = engine.energy_j()
        ramp = np.linspace(0.0, 2.0, 501)[1:, None] * np.array([[0.9, 1.1]])
        work = 0.0
        for k in range(0, 500, 10):
            torque = engine.advance(ramp[k : k + 10])
            work += 0.01 * float(torque @ ramp[k : k + 10].mean(axis=0))
        assert engine.wheel_speeds() == pytest.approx([1.8, 2.2])
        assert engine.state().yaw_rate_rad_s == pytest.approx(0.033 * 0.4 / 0.16, rel=1e-4)
        assert engine.energy_j() - before == pytest.approx(work, rel=0.01)
        with pytest.raises(InputError, match="its motor allows"):
            engine.advance(np.full((1, 2), 100.0))
    robot.ends_ms = 1
    with pytest.raises(RunEnded):
        engine.advance(np.zeros((1, 2)))
