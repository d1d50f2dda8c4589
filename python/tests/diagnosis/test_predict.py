"""`rtds predict`: the nominal robot and a diagnosis, replayed from a run's commands."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from diagnosis_cases import changed, example_diagnosis, make_case

from rtds_host.contract import builtin_robot_path, read_run, write_run
from rtds_host.diagnosis.effects import catalogue
from rtds_host.diagnosis.gap import errors, gap, pooled, squares
from rtds_host.diagnosis.predict import predicted_columns, read_diagnosis
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.errors import InputError
from rtds_host.plant.schema import OUTPUTS

RTDS = [str(Path(sys.executable).with_name("rtds"))]


@pytest.fixture
def run_folder(tmp_path):
    run = make_case(seconds=2.0).runs[1]
    columns = {"t": run.t, **{c: run.columns[c] for c in ("v_cmd_l", "v_cmd_r")}}
    write_run(tmp_path / "steps", run.meta, columns)
    return tmp_path / "steps"


def test_a_run_without_any_measurement_is_predicted_from_rest(run_folder, tmp_path):
    out = tmp_path / "pred.csv"
    done = subprocess.run(
        RTDS + ["predict", str(run_folder), "--robot", str(builtin_robot_path("burger")), "--out", str(out)],
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    names = out.read_text().splitlines()[0].split(",")
    assert names == [
        "t",
        "v_cmd_l",
        "v_cmd_r",
        "v_bus",
        "i_l",
        "i_r",
        "w_l",
        "w_r",
        "th_l",
        "th_r",
        "gyro_z",
        "x",
        "y",
        "yaw",
    ]
    table = np.loadtxt(out, delimiter=",", skiprows=1)
    assert np.isfinite(table).all() and np.all(table[0, 4:] == 0)
    assert len(table) == len(read_run(run_folder).t)


def test_times_come_back_to_the_last_digit_and_what_was_ignored_is_told(run_folder, tmp_path):
    lines = (run_folder / "log.csv").read_text().splitlines()[:12]
    rows = [line.split(",")[1:] for line in lines[1:]]
    times = [f"{1700000000 + 0.02 * k:.2f}" for k in range(len(rows))]
    (run_folder / "log.csv").write_text(
        "\n".join([lines[0] + ",W_L", *(",".join([t, *row, "1"]) for t, row in zip(times, rows))]) + "\n"
    )
    out = tmp_path / "pred.csv"
    done = subprocess.run(
        RTDS + ["predict", str(run_folder), "--robot", str(builtin_robot_path("burger")), "--out", str(out)],
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert [float(line.split(",")[0]) for line in out.read_text().splitlines()[1:]] == list(map(float, times))
    assert "'W_L'" in done.stderr and "ignored" in done.stderr


def late(run_case, seconds=0.002):
    """The case with stamps that scatter by so much about the times when rows were taken."""
    rng = np.random.default_rng(5)
    return changed(
        run_case,
        lambda t, _: np.maximum.accumulate(t + seconds * rng.standard_normal(len(t))) + 1e-9 * np.arange(len(t)),
    )


def test_late_stamps_do_not_count_against_a_prediction():
    """A diagnosis puts the clock of its runs right; what it predicts of another run of the same logger must not be
    worse for that.
    """
    exact = make_case(lambda m: m.put("command_delay", 0.05))
    model = nominal_model(exact.robot)
    model.put("command_delay", 0.05)
    for log, stamped in zip(exact.runs, late(exact).runs):
        wanted, found = (predicted_columns(one, exact.robot, model) for one in (log, stamped))
        assert np.array_equal(found["t"], stamped.t)
        off = errors(stamped, exact.robot, np.column_stack([found[c] for c in OUTPUTS]))
        assert gap(pooled([{c: squares(error) for c, error in off.items()}])) < 1.1
        assert np.abs(found["w_l"] - wanted["w_l"]).max() < 0.05
        believed = errors(stamped, exact.robot, replay_run(model, run_inputs(stamped, exact.robot)))
        assert gap(pooled([{c: squares(error) for c, error in believed.items()}])) > 1.5


def test_the_command_line_tells_of_a_clock_that_it_put_right(tmp_path):
    run = late(make_case()).runs[1]
    write_run(tmp_path / "steps", run.meta, {"t": run.t, **run.columns})
    done = subprocess.run(
        RTDS
        + [
            "predict",
            str(tmp_path / "steps"),
            "--robot",
            str(builtin_robot_path("burger")),
            "--out",
            str(tmp_path / "pred.csv"),
        ],
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0 and "rows come evenly" in done.stderr
    times = np.loadtxt(tmp_path / "pred.csv", delimiter=",", skiprows=1)[:, 0]
    assert np.array_equal(times, read_run(tmp_path / "steps").t)


def test_a_replay_that_runs_away_is_told(run_folder, tmp_path):
    (tmp_path / "robot.toml").write_text(
        builtin_robot_path("burger").read_text() + "\n[driver]\nmode = 'torque'\ntorque_nm_per_v = 1000\n"
    )
    done = subprocess.run(
        RTDS
        + ["predict", str(run_folder), "--robot", str(tmp_path / "robot.toml"), "--out", str(tmp_path / "pred.csv")],
        check=False,
        capture_output=True,
        text=True,
    )
    assert "runs away" in done.stderr


def test_a_diagnosis_brings_its_effects_and_its_refit(run_folder, tmp_path):
    robot = make_case(seconds=1.0).robot
    (tmp_path / "d.json").write_text(json.dumps(example_diagnosis()))
    model = read_diagnosis(tmp_path / "d.json", robot)
    assert model.get("coulomb", 0) == model.get("coulomb", 1) == 0.048
    assert (model.get("resistance", 0), model.get("resistance", 1)) == (8.66, 8.57)
    log = read_run(run_folder)
    assert np.abs(predicted_columns(log, robot, model)["w_l"] - predicted_columns(log, robot)["w_l"]).max() > 0.1


def test_a_tyre_of_an_earlier_diagnosis_is_the_same_tyre(tmp_path):
    """Earlier ones hold the length over which its traction builds up, later ones what it gives a newton: length times
    slip, up to the largest of both that there could be."""
    robot = make_case(seconds=1.0).robot
    diagnosis = example_diagnosis()
    diagnosis["effects"] = [
        {
            "id": "longitudinal_slip",
            "side": "left",
            "probability": 0.9,
            "parameters": {
                "slip_per_newton": {"value": 0.02, "ci90": [0.01, 0.03]},
                "relaxation_m": {"value": 0.003, "ci90": None},
            },
        }
    ]
    (tmp_path / "d.json").write_text(json.dumps(diagnosis))
    assert read_diagnosis(tmp_path / "d.json", robot).get("slip_relaxation", 0) == pytest.approx(0.003)
    slip, length = (
        diagnosis["effects"][0]["parameters"]["slip_per_newton"],
        diagnosis["effects"][0]["parameters"]["relaxation_m"],
    )
    slip["value"], length["value"] = (
        catalogue(robot)["longitudinal_slip"].parameters[0].high,
        1.5 * robot.chassis.wheel_radius_m,
    )
    (tmp_path / "d.json").write_text(json.dumps(diagnosis))
    assert read_diagnosis(tmp_path / "d.json", robot).get("slip_relaxation", 0) == pytest.approx(length["value"])
    length["value"] = "long"
    (tmp_path / "d.json").write_text(json.dumps(diagnosis))
    with pytest.raises(InputError, match="parameters.relaxation_m"):
        read_diagnosis(tmp_path / "d.json", robot)


def test_a_size_on_its_bound_is_read_as_a_report_writes_it(tmp_path):
    """A report has five digits, and half of all bounds are within what they are rounded to."""
    robot = make_case(seconds=1.0).robot
    for effect in catalogue(robot).values():
        for at in ("low", "high"):
            diagnosis = example_diagnosis()
            diagnosis["effects"] = [
                {
                    "id": effect.id,
                    "side": effect.sides[0],
                    "probability": 0.9,
                    "parameters": {
                        p.name: {"value": float(f"{getattr(p, at):.5g}"), "ci90": None} for p in effect.parameters
                    },
                }
            ]
            (tmp_path / "d.json").write_text(json.dumps(diagnosis))
            read_diagnosis(tmp_path / "d.json", robot)


@pytest.mark.parametrize(
    "edit,words",
    [
        (lambda d: d["effects"][0].update(id="gremlins"), "effects[0].id"),
        (lambda d: d["effects"][0].update(side="front"), "effects[0].side"),
        (lambda d: d["effects"][0]["parameters"].clear(), "torque_nm"),
        (lambda d: d["effects"][0]["parameters"]["torque_nm"].update(value=-1.0), "torque_nm"),
        (lambda d: d["nominal_fit"]["l"].update(resistance_ohm="much"), "nominal_fit.l.resistance_ohm"),
        (lambda d: d["nominal_fit"]["l"].update(resistance_ohm=10**400), "nominal_fit.l.resistance_ohm"),
        (lambda d: d["nominal_fit"]["l"].update(resistance_ohm=1e300), "nominal_fit.l.resistance_ohm: is 1e+300,"),
        (lambda d: d["nominal_fit"]["r"].update(mass_kg=1e5), "nominal_fit.r.mass_kg: is 100000, it must lie within"),
        (lambda d: d["effects"][0]["parameters"].update(torque=0.1), "effects[0].parameters.torque"),
        (lambda d: d["effects"][0].update(parameters=3), "effects[0].parameters"),
        (lambda d: d["effects"][0].update(id=["coulomb_friction"]), "effects[0].id"),
        (lambda d: d.update(effects=5), "effects"),
        (lambda d: d.update(nominal_fit=[1]), "nominal_fit"),
        (lambda d: d.update(schema="other"), "schema"),
        (lambda d: d.update(setup={"gyro": 0.001}), "setup.gyro"),
        (lambda d: d.update(setup={"latency_s": -0.01}), "setup.latency_s"),
    ],
)
def test_a_broken_diagnosis_is_named_by_file_and_key(tmp_path, edit, words):
    diagnosis = example_diagnosis()
    edit(diagnosis)
    (tmp_path / "d.json").write_text(json.dumps(diagnosis))
    with pytest.raises(InputError, match="d.json") as error:
        read_diagnosis(tmp_path / "d.json", make_case(seconds=1.0).robot)
    assert words in str(error.value)


def test_a_diagnosis_of_an_earlier_version_is_read_with_the_names_that_it_has(tmp_path):
    robot = make_case(seconds=1.0).robot
    read = []
    for name in ("gyro_late_s", "gyro_delay_s"):
        (tmp_path / "d.json").write_text(json.dumps({**example_diagnosis(), "setup": {name: 0.004}}))
        read.append(read_diagnosis(tmp_path / "d.json", robot))
    assert read[0].common.tobytes() == read[1].common.tobytes()


def test_the_catalogue_is_listed_and_each_effect_explained():
    listed = subprocess.run([*RTDS, "effects"], check=False, capture_output=True, text=True, env={"COLUMNS": "200"})
    assert listed.returncode == 0 and "coulomb_friction" in listed.stdout and "command_delay" in listed.stdout
    one = subprocess.run([*RTDS, "effects", "backlash"], check=False, capture_output=True, text=True)
    assert one.returncode == 0 and "angle_rad" in one.stdout and "Nordin" in one.stdout
    wrong = subprocess.run([*RTDS, "effects", "gremlins"], check=False, capture_output=True, text=True)
    assert wrong.returncode == 2 and len(wrong.stderr.splitlines()) == 1
