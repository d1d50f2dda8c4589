"""The planar world: what it makes is readable, repeatable, says nothing of the truth, and obeys physics."""

import ast
import json
import math
from pathlib import Path

import numpy as np
import pytest

import rtds_host.blind
from rtds_host.blind import cases, planar, scales, vocabulary
from rtds_host.blind.gap import channel_gaps, displacements, total
from rtds_host.contract import builtin_robot, read_case

ROBOT = builtin_robot("burger")
G = 9.80665


def settled(machine, volts, seconds=3.0, payload=0.0, slope=0.0, yaw=0.0, rate=200):
    """Channels after a step of constant voltages (left, right) from rest."""
    t = np.arange(int(seconds * rate) + 1) / rate
    v = np.tile(np.asarray(volts, float), (t.size, 1))
    return t, planar.run_machine(machine, t, v, np.array([0, 0, yaw, 0, 0.0]), payload, slope, 0.0)


def with_effect(name, side="both", **parameters):
    machine = planar.nominal_machine(ROBOT)
    planar.apply_effect(machine, {"id": name, "side": side, "parameters": parameters})
    return machine


def output_constants():
    m = ROBOT.motor
    n = m.gear_ratio
    return n * m.torque_constant_nm_per_a, n * n * m.viscous_friction_nm_s_per_rad, m.resistance_ohm


def test_nothing_is_shared_with_the_diagnoser():
    for path in Path(rtds_host.blind.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = (
                [a.name for a in node.names]
                if isinstance(node, ast.Import)
                else [node.module or ""]
                if isinstance(node, ast.ImportFrom)
                else []
            )
            for name in names:
                if name.startswith("rtds_host"):
                    assert name.split(".")[1] in (
                        "blind",
                        "contract",
                        "errors",
                        "figures",
                        "cli",
                        "workers",
                        "cleanup",
                        "compat",
                        "vectors",
                    ), (path.name, name)


def test_no_load_speed_is_that_of_the_motor_equations():
    k, b, r = output_constants()
    _, out = settled(planar.nominal_machine(ROBOT), (6.0, 6.0))
    assert out["w_l"][-1] == pytest.approx(6.0 / (k + r * b / k), rel=1e-5)
    assert out["i_r"][-1] == pytest.approx(b * out["w_r"][-1] / k, rel=1e-4)


def test_a_robot_left_alone_on_a_slope_rolls_down():
    _, out = settled(planar.nominal_machine(ROBOT), (0, 0), payload=2.0, slope=0.1)
    k, b, r = output_constants()
    w = -3.0 * G * math.sin(0.1) * 0.033 / 2 / (b + k * k / r)
    assert out["w_l"][-1] == pytest.approx(w, rel=1e-4)
    assert out["x"][-1] < 0


def test_wheels_roll_and_turn_the_body_without_slip():
    _, out = settled(planar.nominal_machine(ROBOT), (3.0, 5.0))
    assert out["gyro_z"][-1] == pytest.approx(0.033 * (out["w_r"][-1] - out["w_l"][-1]) / 0.16, rel=1e-6)
    forward = 0.033 * (out["th_l"][-1] + out["th_r"][-1]) / 2
    yaw = 0.033 * (out["th_r"][-1] - out["th_l"][-1]) / 0.16
    assert out["yaw"][-1] == pytest.approx(yaw, abs=2e-5)
    assert math.hypot(out["x"][-1], out["y"][-1]) < forward


def test_dry_friction_costs_current_and_holds_on_a_slope():
    k, b, _ = output_constants()
    machine = with_effect("coulomb_friction", torque_nm=0.05)
    _, out = settled(machine, (6.0, 6.0))
    assert k * out["i_l"][-1] - b * out["w_l"][-1] == pytest.approx(0.05, rel=1e-4)
    _, out = settled(machine, (0, 0), payload=2.0, slope=0.1)  # 0.0485 N m a wheel would be needed
    assert abs(out["x"][-1]) < 1e-5


def test_load_friction_loses_its_share_driving_and_driven():
    k, b, _ = output_constants()
    machine = with_effect("load_friction", ratio=0.2)
    load = 3.0 * G * math.sin(0.1) * 0.033 / 2
    _, up = settled(machine, (6.0, 6.0), payload=2.0, slope=0.1)
    assert (k * up["i_l"][-1] - b * up["w_l"][-1]) * 0.8 == pytest.approx(load * math.cos(up["yaw"][-1]), rel=1e-3)
    _, down = settled(machine, (6.0, 6.0), payload=2.0, slope=-0.1)
    assert k * down["i_l"][-1] - b * down["w_l"][-1] == pytest.approx(-load * 0.8, rel=1e-3)


def test_slip_depends_on_the_force_and_not_on_the_direction():
    for volts in (6.0, -6.0):
        _, out = settled(with_effect("longitudinal_slip", slip_per_newton=0.03), (volts, volts), payload=2.0, slope=0.1)
        force = 3.0 * G * math.sin(0.1) / 2
        v = (out["x"][-1] - out["x"][-2]) * 200
        sign = 1 if volts > 0 else -1
        assert v / (0.033 * out["w_l"][-1]) == pytest.approx(1 - sign * 0.03 * force, abs=2e-4)


def test_delays_shift_the_response_but_not_the_pose():
    _, plain = settled(planar.nominal_machine(ROBOT), (6.0, 6.0), seconds=0.5)
    _, late = settled(with_effect("command_delay", seconds=0.02), (6.0, 6.0), seconds=0.5)
    _, told = settled(with_effect("measurement_delay", seconds=0.02), (6.0, 6.0), seconds=0.5)
    assert late["w_l"][4:] == pytest.approx(plain["w_l"][:-4], abs=1e-6)
    assert told["w_l"][4:] == pytest.approx(plain["w_l"][:-4], abs=1e-6)
    assert told["x"] == pytest.approx(plain["x"], abs=1e-9)
    assert late["x"][4:] == pytest.approx(plain["x"][:-4], abs=1e-9)


@pytest.mark.parametrize("name", sorted(vocabulary.EFFECTS))
def test_every_effect_of_the_catalogue_changes_what_is_measured(name):
    rng = np.random.default_rng(7)
    t = np.round(np.arange(0, 4.0, 0.01), 4)
    volts, _ = planar.scenario("steps", np.linspace(0, 14, t.size), rng, ROBOT)
    volts = np.clip(volts * 1.5, -12, 12)
    plain = planar.run_machine(planar.nominal_machine(ROBOT), t, volts.copy(), np.zeros(5), 2.0, 0.1, 0.3)
    machine = planar.nominal_machine(ROBOT)
    planar.apply_effect(machine, vocabulary.draw_effect(rng, name))
    out = planar.run_machine(machine, t, volts.copy(), np.zeros(5), 2.0, 0.1, 0.3)
    assert all(np.isfinite(values).all() for values in out.values())
    noise = {c: ROBOT.noise(c) for c in planar.CHANNELS}
    assert total(channel_gaps(t, out, plain, noise)) > 0.02


@pytest.mark.parametrize("name", sorted(vocabulary.UNNAMED))
def test_every_effect_outside_of_the_catalogue_changes_what_is_measured(name):
    rng = np.random.default_rng(3)
    t = np.round(np.arange(0, 6.0, 0.01), 4)
    volts, _ = planar.scenario("coast", np.linspace(0, 14, t.size), rng, ROBOT)
    plain = planar.run_machine(planar.nominal_machine(ROBOT), t, volts.copy(), np.zeros(5), 0.0, 0.0, 0.0)
    machine = planar.nominal_machine(ROBOT)
    planar.apply_outside(machine, scales.draw_outside(rng, scales.scale_of(ROBOT, 0.01, 16.0), name))
    out = planar.run_machine(machine, t, volts.copy(), np.zeros(5), 0.0, 0.0, 0.0, seed=5)
    assert all(np.isfinite(values).all() for values in out.values())
    noise = {c: ROBOT.noise(c) for c in planar.CHANNELS}
    assert total(channel_gaps(t, out, plain, noise)) > 0.02


def test_a_case_is_readable_repeatable_and_silent_about_its_truth(tmp_path):
    truths = [cases.make_case(11, "few", tmp_path / name) for name in ("a", "b")]
    assert truths[0] == truths[1]
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file())
    assert {p.name for p in files} <= {"robot.toml", "run.json", "log.csv", "log.parquet"}
    for path in files:
        assert (tmp_path / "a" / path).read_bytes() == (tmp_path / "b" / path).read_bytes()
        if path.name == "run.json":
            assert json.loads((tmp_path / "a" / path).read_text())["notes"] == ""
    case = read_case(tmp_path / "a")
    assert 3 <= len(case.runs) <= 7
    assert truths[0]["size_sigma"] > 0


def test_without_an_effect_only_noise_is_left(tmp_path):
    spec = cases.draw_spec(np.random.default_rng(2), "none")
    spec.update(tolerance=False, colour=(0.0, 0.0), slow={})
    truth = cases.make_case(4, spec, tmp_path / "case")
    assert truth["verdict"] == "none" and truth["effects"] == []
    case = read_case(tmp_path / "case")
    for run in case.runs:
        gaps = planar.replay_gap(planar.nominal_machine(case.robot), case.robot, run)
        assert total(gaps) == pytest.approx(1.0, abs=0.15)
        assert gaps["w_l"] == pytest.approx(1.0, abs=0.05)


def test_a_robot_without_a_measured_pose_starts_where_a_replay_of_its_log_starts(tmp_path):
    spec = cases.draw_spec(np.random.default_rng(2), "few")
    effect = {"id": "driver_gain", "side": "both", "subsystem": "driver", "parameters": {"ratio": 1.1}}
    spec.update(tolerance=False, colour=(0.0, 0.0), slow={}, dropped=0.0, missing=["pose", "th"], effects=[effect])
    for run in spec["runs"]:
        run.update(slope_rad=0.1, uphill_yaw_rad=0.5)
    cases.make_case(4, spec, tmp_path / "case", sizes=False)
    case = read_case(tmp_path / "case")
    machine = planar.nominal_machine(case.robot)
    planar.apply_effect(machine, effect)
    assert max(total(planar.replay_gap(machine, case.robot, run)) for run in case.runs) < 1.15


def test_the_gap_counts_moves_seen_from_the_heading_at_each_window():
    t = np.arange(0, 3.001, 0.01)
    turned = {"x": 0.2 * t, "y": 0 * t, "yaw": 0 * t}
    ahead = {"x": 0 * t, "y": 0.2 * t, "yaw": 0 * t + math.pi / 2}
    gaps = channel_gaps(t, turned, ahead, {"x": 0.001, "y": 0.001, "yaw": 0.002})
    assert gaps == pytest.approx({"x": 0, "y": 0, "yaw": 0}, abs=1e-9)
    shifted = dict(turned, x=0.21 * t)
    assert channel_gaps(t, shifted, turned, {"x": 0.001})["x"] == pytest.approx(0.01 / 0.001 / math.sqrt(2))
    assert displacements(t, {"x": np.full(t.size, np.nan)}, ("x",), None)["x"].size == 3


def test_the_angle_counts_only_where_the_speed_is_missing():
    t = np.arange(0, 2.001, 0.01)
    noise = {"th_l": 0.001, "w_l": 0.02, "th_r": 0.001}
    measured = {"th_l": t, "w_l": 0 * t, "th_r": t}
    replayed = {"th_l": 0 * t, "w_l": 0 * t, "th_r": 1.001 * t, "yaw": 0 * t}
    gaps = channel_gaps(t, measured, replayed, noise)
    assert set(gaps) == {"w_l", "th_r"}
    assert gaps["th_r"] == pytest.approx(1 / math.sqrt(2))
