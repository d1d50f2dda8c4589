"""The recordings in examples/ are what the documentation says they are."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

from rtds_host.contract import read_case
from rtds_host.diagnosis.replay.model import OUTPUTS, nominal_model, replay_run, run_inputs
from rtds_host.importers import import_case

EXAMPLES = Path(__file__).parents[3] / "examples"


@pytest.fixture(scope="module")
def make_bag():
    spec = importlib.util.spec_from_file_location("make_bag", EXAMPLES / "make_bag.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def misses(case):
    """Root mean square of replayed minus measured, in units of the noise, by run and channel."""
    result = {}
    for run in case.runs:
        out = replay_run(nominal_model(case.robot), run_inputs(run, case.robot))
        for name in ("w_l", "w_r", "gyro_z", "i_l", "i_r"):
            if run.has(name):
                error = out[:, OUTPUTS.index(name)] - run.columns[name]
                result[run.name, name] = float(np.sqrt(np.nanmean(error**2))) / case.robot.noise(name)
    return result


def test_the_committed_files_are_what_the_script_makes(make_bag):
    assert (EXAMPLES / "square.mcap").read_bytes() == make_bag.record(
        "square", np.random.default_rng([make_bag.SEED, 0]), make_bag.EPOCH_S
    )
    assert (EXAMPLES / "rover.csv").read_text() == make_bag.table(np.random.default_rng([make_bag.SEED, 9]))
    truth = json.loads((EXAMPLES / "truth.json").read_text())
    assert truth["effects"][0]["parameters"]["torque_nm"] == make_bag.TIGHT[0]


def test_only_the_tight_gear_separates_the_example_from_the_nominal_robot(tmp_path):
    bags = [EXAMPLES / f"{name}.mcap" for name in ("square", "spin", "wander")]
    import_case(bags, tmp_path / "case")
    found = misses(read_case(tmp_path / "case"))
    for run in ("square", "spin", "wander"):
        assert found[run, "w_l"] > 4.0
        assert found[run, "w_r"] < 1.2


def test_a_bag_of_the_nominal_robot_replays_down_to_its_noise(make_bag, tmp_path, monkeypatch):
    """Speed, lateness, cuts and clocks are all put right: else the replay would be off by many times the noise."""
    monkeypatch.setattr(make_bag, "TIGHT", (0.0, 0.0))
    (tmp_path / "wander.mcap").write_bytes(make_bag.record("wander", np.random.default_rng(3), make_bag.EPOCH_S))
    import_case([tmp_path / "wander.mcap"], tmp_path / "case")
    for value in misses(read_case(tmp_path / "case")).values():
        # 1.06 = noise of 0.02 rad/s and the servo's count of 0.024 rad/s together.
        assert 0.9 < value < 1.15


def test_the_csv_example(make_bag, tmp_path):
    import_case([EXAMPLES / "rover.csv"], tmp_path / "case", mapping=EXAMPLES / "rover.toml")
    case = read_case(tmp_path / "case")
    assert case.robot.driver.mode == "voltage"
    assert set(case.runs[0].columns) == {
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
    }
    found = misses(case)
    assert found["rover", "w_l"] > 4.0 and found["rover", "w_r"] < 1.2


def test_the_tutorials_imports_print_what_stands_there():
    spec = importlib.util.spec_from_file_location("run_tutorial", EXAMPLES / "run_tutorial.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    page = (EXAMPLES.parent / "docs" / "tutorial-bag.md").read_text()
    assert module.refreshed(page, only="rtds import") == page
