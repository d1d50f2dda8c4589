"""Bags by another hand: they import as what they hold, and the writer knows nothing of the program."""

from __future__ import annotations

import ast
import random
import sys
from pathlib import Path

import numpy as np
import pytest

from rtds_host.contract import read_case
from rtds_host.diagnosis.gap import errors, gap, pooled
from rtds_host.diagnosis.gate import examine
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.importers import import_case

TESTS = Path(__file__).parents[1]
sys.path.insert(0, str(TESTS))

from foreign.__main__ import right  # noqa: E402  after the path above
from foreign.bag import Clock, record  # noqa: E402  after the path above
from foreign.draw import CAUSES, fault  # noqa: E402  after the path above
from foreign.robot import Burger, Fault, Servo  # noqa: E402  after the path above


@pytest.mark.parametrize("name", ["robot", "bag", "draw"])
def test_the_writer_shares_no_code_with_the_program(name):
    tree = ast.parse((TESTS / "foreign" / f"{name}.py").read_text())
    modules = [a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names]
    modules += [n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)]
    assert modules and not any(m.startswith("rtds_host") for m in modules)


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    return bring(tmp_path_factory.mktemp("nominal"), Fault())


def bring(folder, fault, battery=11.1, late=0.001):
    record(
        folder / "turns.mcap",
        Burger(fault, Servo(smooth=0.0), battery_v=battery),
        "turns",
        Clock(late),
        random.Random(7),
    )
    import_case([folder / "turns.mcap"], folder / "case")
    return read_case(folder / "case")


def missed(case):
    """The gap of the nominal replay, by channel."""
    return pooled(
        [errors(r, case.robot, replay_run(nominal_model(case.robot), run_inputs(r, case.robot))) for r in case.runs]
    )


def test_a_foreign_bag_imports_in_speed_mode_on_its_own_battery(nominal):
    (run,) = nominal.runs
    assert (nominal.robot.driver.mode, nominal.robot.driver.bus) == ("speed", "measured")
    assert np.nanmedian(run.columns["v_bus"]) == pytest.approx(11.1, abs=0.05)
    assert np.nanmax(run.columns["w_l"]) == pytest.approx(2.0, rel=0.05)  # rad/s: 0.8 rad/s of yaw, not m/s at the rim
    assert [f.kind for f in examine(nominal).warnings] == ["rate", "one_run"]


def test_a_cause_that_is_planted_shows_in_the_bag(nominal, tmp_path):
    friction = missed(bring(tmp_path, Fault(coulomb_nm=(0.12, 0.0))))
    plain = missed(nominal)
    assert friction["w_l"] > 2.0 * plain["w_l"] and friction["gyro_z"] > 1.5 * plain["gyro_z"]
    assert gap(plain) < 4.0


def test_a_bag_without_a_battery_takes_the_nominal_bus_and_says_so(tmp_path):
    from import_recordings import turtlebot

    recording = turtlebot().drop("/battery_state", "/sensor_state")
    recording.mcap(tmp_path / "bare.mcap")
    (run,) = import_case([tmp_path / "bare.mcap"], tmp_path / "case")
    case = read_case(tmp_path / "case")
    assert (run_inputs(case.runs[0], case.robot)[3] == 12.0).all()
    assert any("v_bus is not there" in notice for notice in run.imported.notices)


@pytest.mark.parametrize("cause", CAUSES)
def test_the_truth_says_what_was_planted(cause):
    made, (effect,) = fault(cause, random.Random(3))
    (value,) = effect["parameters"].values()
    told = {
        "coulomb_friction": made.coulomb_nm,
        "driver_deadzone": made.deadzone_v,
        "driver_gain": made.gain,
        "wheel_radius_error": made.radius,
        "command_delay": (made.delay_s, made.delay_s),
    }[cause]
    assert effect["id"] == cause and value in told
    assert {
        "left": told[0] == value != told[1],
        "right": told[1] == value != told[0],
        "both": told[0] == told[1] == value,
    }[effect["side"]]


def test_an_answer_is_right_where_the_cause_is_named_or_in_its_set():
    delay, other = {"id": "command_delay", "side": "both"}, {"id": "measurement_delay", "side": "both"}
    truth = {"effects": [{**delay, "parameters": {"seconds": 0.1}}]}
    assert right({"effects": []}, {"verdict": "none", "effects": [], "indistinguishable": []})
    assert not right({"effects": []}, {"verdict": "known", "effects": [delay], "indistinguishable": []})
    assert right(truth, {"verdict": "partial", "effects": [delay], "indistinguishable": []})
    assert right(truth, {"verdict": "known", "effects": [other], "indistinguishable": [[delay, other]]})
    assert not right(truth, {"verdict": "known", "effects": [other], "indistinguishable": []})
    assert not right(truth, {"verdict": "unknown", "effects": [], "indistinguishable": [[delay, other]]})
