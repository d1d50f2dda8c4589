"""Declared tolerances and servo gains that are left out: read, checked, and fitted as what they are."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from rtds_host.contract import Case, RunLog, RunMeta, builtin_robot, builtin_robot_path, load_robot
from rtds_host.diagnosis.nuisances import band, nuisances_of
from rtds_host.diagnosis.predict import read_diagnosis
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.errors import InputError
from rtds_host.plant.schema import OUTPUT_INDEX

AXIS = """schema = "rtds-robot/1"
[motor]
resistance_ohm = 3.3
inductance_h = 6.6e-3
torque_constant_nm_per_a = 0.0105
back_emf_constant_v_s_per_rad = 0.0105
rotor_inertia_kg_m2 = 1.3e-6
viscous_friction_nm_s_per_rad = 3.0e-6
gear_ratio = 9.69
[supply]
voltage_v = 12.0
[axis]
kind = "linear"
mass_kg = 2.0
metres_per_rad = -0.01
[sensors]
w_rad_s = 0.29
"""


def written(tmp_path, text):
    path = tmp_path / "robot.toml"
    path.write_text(text)
    return path


def burger(tmp_path, tolerance):
    return load_robot(written(tmp_path, builtin_robot_path("burger").read_text() + f"\n[tolerance]\n{tolerance}\n"))


def case_of(robot, row_s=0.01):
    t = np.arange(0.0, 1.0, row_s)
    columns = {f"{kind}_{s}": np.zeros(len(t)) for kind in ("v_cmd", "w_cmd", "w") for s in robot.sides}
    return Case("case", robot, (RunLog("run", RunMeta(), t, columns),))


def sigmas(robot):
    found = nuisances_of(case_of(robot), nominal_model(robot))
    return {(key, n.side): n.sigma for n in found for key in n.keys}


def test_without_a_declared_tolerance_four_constants_are_known_to_a_hundredth():
    found = sigmas(builtin_robot("burger"))
    assert set(found.values()) == {0.01} and len({key for key, _ in found}) == 5


@pytest.mark.parametrize("share", [0.05, 0.2, 0.4])
def test_a_tolerance_is_the_relative_deviation_of_a_positive_constant(tmp_path, share):
    robot = burger(tmp_path, f"motor = {share}")
    found = sigmas(robot)
    assert set(found.values()) == {math.sqrt(math.log1p(share**2))}
    assert ("inductance_h", 0) in found and ("gear_ratio", None) not in found
    z = np.random.default_rng(1).standard_normal(200_000)
    drawn = np.exp(next(iter(found.values())) * z)
    assert np.std(drawn) / np.mean(drawn) == pytest.approx(share, rel=0.02) and drawn.min() > 0.0


def test_a_single_name_goes_before_and_the_body_s_constants_are_the_whole_robot_s(tmp_path):
    robot = burger(
        tmp_path, "motor = 0.1\nrotor_inertia_kg_m2 = 0.3\ngear_ratio = 0.02\nmass_kg = 0.2\ntrack_width_m = 0.05"
    )
    found = sigmas(robot)
    assert found["rotor_inertia_kg_m2", 1] > found["resistance_ohm", 1] > found["gear_ratio", None]
    assert {"mass_kg", "track_width_m", "gear_ratio"} == {
        key for key, side in found if side is None and key[-2:] != "_s"
    }
    assert band(robot, "chassis.track_width_m") == pytest.approx(3.0 * found["track_width_m", None])
    assert band(robot, "motor.torque_constant_nm_per_a") == pytest.approx(3.0 * found["resistance_ohm", 0])
    assert band(robot, "chassis.wheel_radius_m") == 0.0
    assert band(builtin_robot("burger"), "motor.resistance_ohm") == pytest.approx(0.03)


def test_every_nuisance_moves_the_model_as_the_diagnosis_that_reports_it_does(tmp_path):
    robots = [
        burger(
            tmp_path,
            "motor = 0.3\ngear_ratio = 0.1\n"
            + "\n".join(
                f"{key} = 0.2"
                for key in ("mass_kg", "yaw_inertia_kg_m2", "wheel_radius_m", "wheel_inertia_kg_m2", "track_width_m")
            ),
        ),
        load_robot(written(tmp_path, AXIS + "[tolerance]\nmotor = 0.3\nmass_kg = 0.3\nmetres_per_rad = 0.05\n")),
    ]
    for robot in robots:
        nominal = nominal_model(robot)
        moved, fit = nominal.copy(), {}
        for k, nuisance in enumerate(n for n in nuisances_of(case_of(robot), nominal) if n.nominal):
            nuisance.apply(moved, 0.5 + 0.1 * k)
            for s in robot.sides if nuisance.side is None else ("lr"[nuisance.side],):
                fit.setdefault(s, {}).update(nuisance.values(0.5 + 0.1 * k))
        path = tmp_path / "diagnosis.json"
        path.write_text(json.dumps({"schema": "rtds-diagnosis/2", "nominal_fit": fit, "effects": []}))
        read = read_diagnosis(path, robot)
        sides = slice(0, len(robot.sides))
        assert read.side[sides] == pytest.approx(moved.side[sides], rel=1e-12)
        assert read.common == pytest.approx(moved.common, rel=1e-12)
        assert not np.array_equal(read.common, nominal.common)


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("resistance_ohms = 0.1", r"\[tolerance\] resistance_ohms: is not a constant .*resistance_ohm"),
        ("length_m = 0.1", r"length_m: is not a constant of \[motor\] or \[chassis\]"),
        ("motor = 20", r"motor: is 20, it must lie within 0 to 1 \(per cent"),
        ("motor = -0.1", "motor: is -0.1"),
        ("motor = true", "motor: is True, a number is needed"),
        ('motor = "wide"', "motor: is 'wide', a number is needed"),
    ],
)
def test_a_tolerance_that_is_none_is_named(tmp_path, line, complaint):
    with pytest.raises(InputError, match=complaint):
        burger(tmp_path, line)


def test_a_constant_that_is_declared_exact_is_no_nuisance(tmp_path):
    assert {key for key, _ in sigmas(burger(tmp_path, "motor = 0\nresistance_ohm = 0.1"))} == {"resistance_ohm"}


@pytest.mark.parametrize("known", ["", "kp_v_s_per_rad = 0.44\n", "ki_v_per_rad = 8.6\n", "ki_v_per_rad = 0.0\n"])
def test_servo_gains_that_are_left_out_are_estimated_and_the_others_are_not_loose(tmp_path, known):
    text = (
        builtin_robot_path("burger").read_text()
        + '\n[driver]\nmode = "speed"\n[servo]\nlimit_v = 12\nperiod_s = 0.001\n'
    )
    robot = load_robot(written(tmp_path, text + known))
    gains = {
        key: n for n in nuisances_of(case_of(robot), nominal_model(robot)) for key in n.keys if key[:2] in ("kp", "ki")
    }
    assert {key: n.estimated for key, n in gains.items()} == {
        key: key not in known for key in ("kp_v_s_per_rad", "ki_v_per_rad") if f"{key} = 0.0" not in known
    }
    assert all((n.sigma > 2.0) == n.estimated for n in gains.values())
    assert replace(robot.servo, left_out=frozenset()).declared


@pytest.mark.parametrize(("row_s", "fitted"), [(0.002, False), (0.01, False), (0.02, True), (0.1, True)])
def test_a_command_may_have_acted_up_to_a_row_before_where_the_logger_is_slower_than_controllers(row_s, fitted):
    robot = builtin_robot("burger")
    found = [n for n in nuisances_of(case_of(robot, row_s), nominal_model(robot)) if "command_early_s" in n.keys]
    assert len(found) == fitted
    for nuisance in found:
        ends = [nuisance.values(z)["command_early_s"] for z in (nuisance.low, nuisance.high)]
        assert ends == pytest.approx([0.0, row_s])


def test_a_command_that_acts_early_moves_the_motor_before_its_row():
    robot = builtin_robot("burger")
    log = case_of(robot).runs[0]
    log = replace(log, columns={**log.columns, **{f"v_cmd_{s}": np.where(log.t < 0.5, 0.0, 5.0) for s in "lr"}})
    model, half = nominal_model(robot), nominal_model(robot)
    half.put("command_early", 0.005)
    on_rows, early = (replay_run(m, run_inputs(log, robot)) for m in (model, half))
    # In one half of the row before the motor has begun to turn.
    first = int(np.flatnonzero(early[:, OUTPUT_INDEX["w_l"]] > 0.0)[0])
    assert log.t[first] == pytest.approx(0.5) and on_rows[first, OUTPUT_INDEX["w_l"]] == 0.0
