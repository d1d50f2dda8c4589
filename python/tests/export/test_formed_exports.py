"""Forms in exports: they act in MuJoCo, Python and the FMU as in the replay, and are tables elsewhere."""

import json
from types import ModuleType

import numpy as np
import pytest
from typer.testing import CliRunner

from rtds_host.cli.export import app
from rtds_host.contract import builtin_robot, builtin_robot_path
from rtds_host.correction.close import FINE_STEP_S, model_of
from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.forms.curves import Form, points_of, written
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.export.check import check
from rtds_host.export.export import Source, export
from rtds_host.export.figures import figures_of
from rtds_host.export.mjcf import driver_source, forms_source
from rtds_host.export.python import write
from rtds_host.plant import forms as plant
from rtds_host.plant.schema import OUTPUTS
from rtds_host.studies.agreement import designed_run, measured

ROBOT = builtin_robot("burger")
TURN = plant.FULL_TURN
# Long enough for commands that no engine's step blurs.
SECONDS = 4.5
SETS = {
    "ground": [
        ("torque", "w", -25.0, 25.0, lambda x: -0.06 * np.sign(x) - 0.001 * x),
        ("force", "x", -1.0, 1.0, lambda x: -2.0 * np.tanh(6.0 * (x - 0.3))),
        ("yaw_torque", "yaw_rate", -4.0, 4.0, lambda x: -0.06 * np.sign(x)),
    ],
    "motor": [
        ("voltage", "i", -0.3, 0.3, lambda x: -0.8 * np.tanh(x / 0.2)),
        ("torque_constant", "i", -0.3, 0.3, lambda x: -0.5 * np.abs(x)),
        ("torque", "th", 0.0, TURN, lambda x: 0.03 * np.sin(2.0 * x)),
    ],
    "history": [
        ("voltage", "command_history", -12.0, 12.0, lambda x: -0.6 * np.sign(x) - 0.03 * x),
        ("torque", "load", -0.4, 0.4, lambda x: -0.2 * np.abs(x) + 0.1 * x),
        ("torque_constant", "i", -0.3, 0.3, lambda x: -0.3 * np.abs(x)),
    ],
    "heat": [
        ("voltage", "heat", 0.0, 0.02, lambda x: -25.0 * x, 1.5),
        ("torque_constant", "heat", 0.0, 0.02, lambda x: -10.0 * x, 4.0),
        ("torque", "heat", 0.0, 0.02, lambda x: -3.0 * x, 0.8),
    ],
    "grease": [
        ("damping", "t", 0.0, 5.0, lambda x: 0.1 * np.exp(-x / 1.5)),
        ("damping", "heat", 0.0, 0.02, lambda x: -0.1 * x, 0.8),
    ],
    "heading": [
        ("force", "yaw", 0.0, TURN, lambda x: 2.0 * np.cos(x - 0.5)),
        ("gyro_sensor", "t", 0.0, 5.0, lambda x: 0.05 * x),
        ("voltage", "th", 0.0, TURN, lambda x: 0.4 * np.sin(x)),
    ],
    "readings": [
        ("voltage", "v_cmd", -12.0, 12.0, lambda x: 0.01 * x * np.abs(x)),
        ("speed_sensor", "w", -25.0, 25.0, lambda x: 0.002 * x * np.abs(x)),
        ("current_sensor", "i", -0.3, 0.3, lambda x: 0.2 * x),
    ],
}


def content_of(name):
    """A diagnosis without effects and with a set of forms."""
    entries = []
    for term, over, low, high, law, *tau in SETS[name]:
        form = Form(term, over, low, high, 1.0, *tau)
        values = law(points_of(over, low, high))
        curve = written(form, values, np.full(len(values), 1e-3))
        entries.append(
            {
                "term": term,
                "side": "both",
                "over": over,
                "units": list(form.units),
                **({"time_constant": tau[0]} if tau else {}),
                "curve": curve,
                "formula": "a·x" if over == "w" else None,
                "parameters": {"a": {"value": 0.25, "ci90": None}} if over == "w" else {},
                "closes": 0.5,
            }
        )
    return {"schema": "rtds-diagnosis/3", "effects": [], "nominal_fit": {}, "forms": entries}


def source_of(name):
    content = content_of(name)
    return Source(content, model_of(content, ROBOT), ROBOT, "diagnosis.json")


def truth_of(source):
    """A run of the robot with forms, as a log with the noise that its sensors declare."""
    log = designed_run(SECONDS)
    out = replay_run(source.model, run_inputs(log, ROBOT), FINE_STEP_S)
    sigma = np.array([ROBOT.noise(name) or 0.0 for name in OUTPUTS])
    noisy = out + sigma * np.random.default_rng(5).standard_normal(out.shape)
    noisy[0] = out[0]
    return measured(log, noisy)


def module_of(text, name):
    """A Python module of its source."""
    module = ModuleType(name)
    exec(compile(text, f"{name}.py", "exec"), module.__dict__)
    return module


def by_module(figures, log):
    """Answer (n, 11) of the Python module to a log's commands."""
    start, meta = run_inputs(log, ROBOT)[-1], log.meta
    robot = module_of(write(figures, ""), "robot").Robot(
        None, tuple(start[:5]), meta.payload_kg, meta.slope_rad, meta.uphill_yaw_rad
    )
    out = np.zeros((len(log.t), len(OUTPUTS)))
    for k, volts in enumerate(log.commands("voltage")):
        found = robot.sensors()
        out[k] = [found[name] for name in OUTPUTS]
        if k + 1 < len(log.t):
            robot.step(*volts.tolist(), float(log.t[k + 1] - log.t[k]))
    return out


def closed(log, nominal, formed):
    gap = [gaps.gap(gaps.pooled([gaps.errors(log, ROBOT, out)])) for out in (nominal, formed)]
    return gaps.closed(*gap)


@pytest.mark.parametrize("name", SETS)
def test_forms_close_in_mujoco_and_in_python_what_they_close_in_the_replay(tmp_path, name):
    source = source_of(name)
    log = truth_of(source)
    text, parts = export(source, "mjcf")
    path = tmp_path / "robot.xml"
    path.write_text(text, encoding="utf-8")
    found = check(path, ROBOT, source.model, [log])
    assert found.replay.closed > 0.9
    assert found.share == pytest.approx(1.0, abs=0.02)
    assert {part.kind for part in parts} == {"number"}
    plain, formed = figures_of(nominal_model(ROBOT), ROBOT), figures_of(source.model, ROBOT)
    in_python = closed(log, by_module(plain, log), by_module(formed, log))
    assert in_python == pytest.approx(found.replay.closed, abs=0.02)


def test_forms_close_behind_mujocos_dcmotor_too(tmp_path):
    source = source_of("motor")
    path = tmp_path / "robot.xml"
    path.write_text(export(source, "mjcf", "dcmotor")[0], encoding="utf-8")
    assert check(path, ROBOT, source.model, [truth_of(source)], "dcmotor").share == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("target", ["urdf", "sdf"])
def test_joints_without_a_driver_have_a_form_as_a_table_and_a_formula_in_the_comment(target):
    text, parts = export(source_of("ground"), target)
    comment = text[text.index("<!--") : text.index("-->")]
    assert "torque (both), N·m, over w, rad/s; a·x, a = 0.25:" in comment
    assert "    25 - 0.055" in comment or "    25 -0.085" in comment
    assert all(part.kind == "number" and part.where.startswith("comment") for part in parts)


def test_tables_of_a_form_over_the_heat_have_its_time_constant():
    comment, _ = export(source_of("heat"), "urdf")
    assert "voltage (both), 1, over heat, A², of 1.5 s:" in comment
    text, _ = export(source_of("heat"), "usd-json")
    forms = json.loads(text)["rtds"]["forms"]
    assert [(form["units"], form["time_constant"]) for form in forms[:2]] == [(["A²", "1"], 1.5), (["A²", "1"], 4.0)]


def test_usd_has_the_points_of_each_side():
    text, _ = export(source_of("ground"), "usd-json")
    forms = json.loads(text)["rtds"]["forms"]
    assert [(form["term"], form["side"]) for form in forms][:2] == [("torque", "left"), ("force", "left")]
    assert forms[0]["curve"][-1] == [25.0, -0.085]


def test_the_module_along_is_whole():
    for text, name in ((forms_source(), "Forms"), (driver_source(), "Driver")):
        assert "rtds_host" not in text
        assert callable(getattr(module_of(text, name), name))


def test_a_command_of_export_writes_the_module_along(tmp_path):
    diagnosis, robot = tmp_path / "diagnosis.json", tmp_path / "robot.toml"
    diagnosis.write_text(json.dumps(content_of("ground")))
    robot.write_bytes(builtin_robot_path("burger").read_bytes())
    result = CliRunner().invoke(app, [str(diagnosis), "--to", "mjcf", "--out", str(tmp_path / "r.xml")])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "r_forms.py").read_text() == forms_source()
