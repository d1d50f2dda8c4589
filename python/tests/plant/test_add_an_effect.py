"""`docs/add-an-effect.md` does what it says: its own text, in a scratch copy of the package."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import rtds_host

PAGE = Path(__file__).resolve().parents[3] / "docs" / "add-an-effect.md"
PACKAGE = Path(rtds_host.__file__).parent
BLOCK = re.compile(r'^```python title="python/([^"]+)"\n(.*?)^```$', re.MULTILINE | re.DOTALL)
USED = """
from html import unescape
import numpy as np
from diagnosis_cases import example_details, example_diagnosis
from rtds_host.contract import RunLog, RunMeta, builtin_robot
from rtds_host.correction.simulate import simulate
from rtds_host.correction.translate import places_of, translate
from rtds_host.diagnosis.effects import catalogue
from rtds_host.diagnosis.replay.model import ReplayBatch, nominal_model, replay_run, run_inputs
from rtds_host.plant.schema import OUTPUT_INDEX
from rtds_host.diagnosis.report import report_page, validate
from rtds_host.export import python
from rtds_host.export.figures import figures_of
from rtds_host.export.table import TABLE

SIZES = {"cogging": {"amplitude_nm": 0.01, "detents": 12.0, "second_harmonic": 0.3}, "air_drag": {"drag": 0.05}}
robot = builtin_robot("frc_cim")
t = np.arange(0.0, 1.0, 0.002)
log = RunLog("slow", RunMeta("slow", 0.0, 0.0, 0.0), t, {"v_cmd_l": 0.0 * t + 1.5, "v_cmd_r": 0.0 * t + 2.0})
inputs = run_inputs(log, robot)
ideal = nominal_model(robot)
plain = replay_run(ideal, inputs)
w = OUTPUT_INDEX["w_l"]


def alone(model):
    scope = {}
    exec(python.write(figures_of(model, robot), ""), scope)
    one, speeds = scope["Robot"](), []
    for _ in t:
        speeds.append(one.sensors()["w_l"])
        one.step(1.5, 2.0, 0.002)
    return np.array(speeds)


for name, values in SIZES.items():
    effect, model = catalogue(robot)[name], nominal_model(robot)
    effect.apply(model, (0, 1), values)
    out = replay_run(model, inputs)
    moved = np.abs(out - plain)[:, w].max()
    print(name, "replay", moved > 1e-3 * np.abs(plain[:, w]).max())
    both = ReplayBatch([inputs]).replay([model, ideal])
    print(name, "vectorised", np.abs(both[0] - out).max() < 1e-4 and np.abs(both[1] - plain).max() < 1e-9)
    here = simulate(log, robot, model).out
    print(name, "simulator", np.abs(here - out)[:, w].max() < 0.05 * moved, places_of(effect, robot) == {"rtl"})
    waved = np.abs(alone(model) - alone(ideal)).max()
    print(name, "export", 0.5 * moved < waved < 2.0 * moved, TABLE[name]["mjcf"].kind)
    diagnosis = example_diagnosis()
    numbers = {p.name: {"value": values[p.name], "ci90": None} for p in effect.parameters}
    diagnosis["effects"][0] |= {"id": name, "side": "both", "parameters": numbers}
    diagnosis["indistinguishable"] = []
    validate(diagnosis)
    page = unescape(report_page(diagnosis, example_details()))
    print(name, "report", effect.check.split(":")[0] in page)
model = nominal_model(robot)
catalogue(robot)["cogging"].apply(model, (0, 1), SIZES["cogging"])
unit = translate(model, robot).units[0]
print("turns", round(unit.ripple_periods_per_rad * 2.0 * np.pi, 6))
"""
# A torque over the speed, as the page says that there can be, too.
LAW = '''"""Drag of the air on a wheel."""

from rtds_host.plant.compiled import law
from rtds_host.plant.entry import RTL, Entry
from rtds_host.plant.torque import SPEED, Torque


@law
def air_drag(speed, drag, sin):
    """Torque against the motion, N·m: -d |w| w. speed : rad/s; drag : N·m·s²."""
    return -drag * abs(speed) * speed


TORQUE = Torque(air_drag, (Entry("air_drag", "N·m·s²", 0.0, RTL, "air_drag_nm_s2", "at the wheel"),), SPEED)
'''
EFFECT = '''"""air_drag: a torque that grows with the speed squared."""

from rtds_host.diagnosis.effects.base import Effect, Parameter, put
from rtds_host.diagnosis.effects.exported import left_out, row

EFFECT = Effect(
    id="air_drag",
    subsystem="drivetrain",
    sided=True,
    parameters=(Parameter("drag", "N·m·s²", null=0, low=0, high=1, prior_width=0.01, starts=(0.01,)),),
    apply=put(air_drag="drag"),
    equation="-d |w| w",
    source="a test",
    confused_with=("viscous_friction",),
    shown_by="runs at several speeds",
    check="Let the wheel coast in the air: its speed falls faster than by friction alone.",
    advice="Take off the fan.",
    runs_in="rtl",
    exports=row(*[left_out("no such torque")] * 4),
)
'''


@pytest.fixture(scope="module")
def scratch(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scratch")
    shutil.copytree(PACKAGE, folder / "rtds_host")
    blocks = BLOCK.findall(PAGE.read_text(encoding="utf-8"))
    for name, text in blocks:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "rtds_host" / "plant" / "torques" / "air_drag.py").write_text(LAW, encoding="utf-8")
    (folder / "rtds_host" / "diagnosis" / "effects" / "air_drag.py").write_text(EFFECT, encoding="utf-8")
    return folder, [name for name, _ in blocks]


def run(folder, *arguments):
    path = os.pathsep.join([str(folder), str(Path(__file__).parents[1] / "diagnosis")])
    # The copy's lines are no lines of the package: they do not count in its coverage.
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_")}
    environment = {**inherited, "PYTHONPATH": path, "COLUMNS": "200"}
    done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_page_needs_at_most_six_files_with_page_and_test(scratch):
    assert 1 <= len(scratch[1]) <= 4


def test_effects_with_laws_of_their_own_are_in_replay_batch_simulator_exports_and_report(scratch):
    lines = run(scratch[0], "-c", USED).splitlines()
    expected = [
        line
        for name in ("cogging", "air_drag")
        for line in (
            f"{name} replay True",
            f"{name} vectorised True",
            f"{name} simulator True True",
            f"{name} export True lost",
            f"{name} report True",
        )
    ]
    # Twelve detents a turn of the motor.
    assert lines == [*expected, "turns 12.0"]


def test_the_new_effect_has_its_words_in_the_program(scratch):
    told = run(scratch[0], "-m", "rtds_host.cli.main", "effects", "cogging")
    assert "N A (sin(n N th)" in told and "rests at even steps" in told and "skewed slots" in told
