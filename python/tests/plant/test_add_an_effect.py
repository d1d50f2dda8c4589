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
import numpy as np
from rtds_host.contract import RunLog, RunMeta, builtin_robot
from rtds_host.correction.translate import places_of, translate
from rtds_host.diagnosis.effects import catalogue
from rtds_host.diagnosis.replay.model import Abreast, nominal_model, replay_run, run_inputs
from rtds_host.export import mjcf, python
from rtds_host.export.figures import figures_of
from rtds_host.export.table import TABLE

robot = builtin_robot("frc_cim")
effect = catalogue(robot)["cogging"]
model, ideal = nominal_model(robot), nominal_model(robot)
effect.apply(model, (0, 1), {"amplitude_nm": 0.01, "detents": 12.0})
t = np.arange(0.0, 1.0, 0.002)
log = RunLog("slow", RunMeta("slow", 0.0, 0.0, 0.0), t, {"v_cmd_l": 0.0 * t + 1.5, "v_cmd_r": 0.0 * t + 2.0})
inputs = run_inputs(log, robot)
plain, waving = replay_run(ideal, inputs), replay_run(model, inputs)
print("replay", np.abs(waving - plain)[:, 3].max() > 1e-3 * np.abs(plain[:, 3]).max())
both = Abreast([inputs]).replay([model, ideal])
print("vectorised", np.abs(both[0] - waving).max() < 1e-4 and np.abs(both[1] - plain).max() < 1e-9)
unit = translate(model, robot).units[0]
turns = unit.ripple_periods_per_rad * 2.0 * np.pi
print("simulator", max(unit.ripple.y) > 0.0, round(turns, 6), places_of(effect, robot) == {effect.runs_in})
figures = figures_of(model, robot)
written = all(writer(figures, "") != writer(figures_of(ideal, robot), "") for writer in (mjcf.write, python.write))
print("export", written, set(TABLE["cogging"]) == set(TABLE["torque_ripple"]))
"""


@pytest.fixture(scope="module")
def scratch(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scratch")
    shutil.copytree(PACKAGE, folder / "rtds_host")
    blocks = BLOCK.findall(PAGE.read_text(encoding="utf-8"))
    for name, text in blocks:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder, [name for name, _ in blocks]


def run(folder, *arguments):
    environment = {**os.environ, "PYTHONPATH": str(folder), "COLUMNS": "200"}
    done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_page_needs_at_most_six_files(scratch):
    assert 1 <= len(scratch[1]) <= 6


def test_the_new_effect_is_in_replay_batch_simulator_and_exports(scratch):
    lines = dict(line.split(" ", 1) for line in run(scratch[0], "-c", USED).splitlines())
    assert lines == {
        "replay": "True",
        "vectorised": "True",
        # Twelve detents a turn of the motor.
        "simulator": "True 12.0 True",
        "export": "True True",
    }


def test_the_new_effect_has_its_words_in_the_program(scratch):
    told = run(scratch[0], "-m", "rtds_host.cli.main", "effects", "cogging")
    assert "N A sin(n N th)" in told and "rests at even steps" in told and "skewed slots" in told
