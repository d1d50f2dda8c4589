"""A bridge in fast decay: its replay and its diagnosis, of a motor whose bridge switches."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rtds_host.contract import RunMeta, builtin_robot, load_robot, read_case, write_run
from rtds_host.diagnosis.diagnose import diagnose
from rtds_host.diagnosis.effects import catalogue
from rtds_host.diagnosis.effects.pwm_curve import DUTY, NO_LOAD, periods
from rtds_host.diagnosis.fit import Fitter
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.search.driver import Search
from rtds_host.diagnosis.search.screening import ranked
from rtds_host.plant.driver import fast_decay
from rtds_host.plant.elementary import exponential

BUS, OHM, HENRY, KM, GEAR, J_OUT = 12.0, 1.3, 1e-3, 0.019, 19.2, 1.2e-3
PERIOD_S, FRICTION, LAG_S, NOISE = 2e-3, 0.05, 0.035, 0.1
ROBOT = f"""schema = "rtds-robot/1"
name = "bench"
[motor]
resistance_ohm = {OHM}
inductance_h = {HENRY}
torque_constant_nm_per_a = {KM}
back_emf_constant_v_s_per_rad = {KM}
rotor_inertia_kg_m2 = 3e-6
viscous_friction_nm_s_per_rad = 1e-8
gear_ratio = {GEAR}
[supply]
voltage_v = {BUS}
[axis]
kind = "inertia"
inertia_kg_m2 = {J_OUT - 3e-6 * GEAR**2!r}
[sensors]
w_rad_s = {NOISE}
"""


def law(volts, emf, ratio):
    """`fast_decay` as a function of Python, with PWM periods over L / R."""
    return fast_decay.py_func(volts, emf, BUS, ratio, exponential.py_func)


@pytest.mark.parametrize("curvature", [-0.5, 0.0, 0.3, 1.0, 2.0, 3.0])
def test_a_curvature_says_the_same_voltage_of_a_curve_and_of_fast_decay_at_small_duty_without_load(curvature):
    volts = BUS * DUTY * (1.0 + curvature * (1.0 - DUTY))
    assert law(BUS * DUTY, volts - NO_LOAD * BUS, periods(curvature)) == pytest.approx(volts, rel=1e-6)


def driven(levels, hold_s=1.0, rate=100, seed=1):
    """Rows t, v_cmd, w of a motor behind a bridge that switches, through a filter, with noise; 10 µs steps."""
    h, n = 1e-5, round(len(levels) * hold_s * rate)
    every, on_off = round(1.0 / (rate * h)), round(PERIOD_S / h)
    w = current = seen = 0.0
    rows = np.empty((n, 3))
    for k in range(n * every):
        if k % every == 0:
            row = k // every
            volts = levels[min(int(row / (rate * hold_s)), len(levels) - 1)]
            rows[row] = row / rate, volts, seen
        sign, emf = math.copysign(1.0, volts), KM * GEAR * w
        if k % on_off < round(abs(volts) / BUS * on_off):
            current += h / HENRY * (sign * BUS - emf - OHM * current)
        elif current != 0.0:
            # Both diodes: the current falls against the bus, and ends at zero.
            after = current + h / HENRY * (-math.copysign(BUS, current) - emf - OHM * current)
            current = after if after * current > 0.0 else 0.0
        free, grip = w + h * KM * GEAR * current / J_OUT, h * FRICTION / J_OUT
        w = 0.0 if abs(free) <= grip else free - math.copysign(grip, free)
        seen += h / LAG_S * (w - seen)
    rows[:, 2] += NOISE * np.random.default_rng(seed).standard_normal(n)
    return rows


# V, whole steps of the simulation in a period.
STEPS = [0.78, -1.38, 2.4, -3.3, 4.2, -5.22, 6.6, -8.52]
STAIRS = [1.2, 1.92, 2.82, 3.78, 5.22, 7.08, 9.0, 10.8]


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A case of two runs of that motor."""
    folder = tmp_path_factory.mktemp("bench") / "case"
    folder.mkdir()
    (folder / "robot.toml").write_text(ROBOT)
    for name, levels in (("steps", STEPS), ("stairs", STAIRS)):
        t, volts, w = driven(levels).T
        write_run(folder / name, RunMeta(scenario=name), {"t": t, "v_cmd_l": volts, "w_l": w})
    return folder


def test_the_replay_of_a_motor_behind_such_a_bridge_is_that_of_the_switches_within_the_noise(bench):
    robot = load_robot(bench / "robot.toml")
    model = nominal_model(robot)
    model.put("fast_decay", 1.0, (0,))
    model.put("pwm_periods", PERIOD_S * OHM / HENRY, (0,))
    model.put("coulomb", FRICTION, (0,))
    model.put("speed_tau", LAG_S, (0,))
    for log in read_case(bench).runs:
        found = replay_run(model, run_inputs(log, robot))[:, 3]
        assert math.sqrt(np.mean((found - log.columns["w_l"]) ** 2)) < 1.5 * NOISE


def test_the_diagnosis_names_the_bridge_its_share_and_what_else_there_is(bench):
    content, _ = diagnose(read_case(bench), quick=True)
    found = {effect["id"]: effect["parameters"] for effect in content["effects"]}
    assert found.keys() == {"pwm_curve", "speed_filter", "coulomb_friction"}
    assert found["pwm_curve"]["fast_decay"]["value"] == pytest.approx(1.0, abs=0.05)
    assert periods(found["pwm_curve"]["curvature"]["value"]) == pytest.approx(PERIOD_S * OHM / HENRY, rel=0.15)
    assert found["speed_filter"]["time_constant_s"]["value"] == pytest.approx(LAG_S, rel=0.1)
    assert found["coulomb_friction"]["torque_nm"]["value"] == pytest.approx(FRICTION, rel=0.15)
    assert content["gap"]["after"] < 1.5


def test_a_fit_that_starts_without_fast_decay_never_takes_it_up_and_one_that_starts_with_it_fits_its_share(bench):
    problem = Problem(read_case(bench), 1)
    cause, effect, fitter = ("pwm_curve", "left"), problem.effects["pwm_curve"], Fitter(problem)
    for share, free in ((0.0, False), (1.0, True)):
        start = effect.scaled({"curvature": 1.0, "fast_decay": share})
        fit = fitter.fit((cause,), start, np.zeros(fitter.count), problem.white())
        assert bool(fit.free[-1]) is free
        assert (fit.values[0]["fast_decay"] == 0.0) is not free


def test_a_screening_that_ranks_an_effect_proposes_each_of_its_modes(bench):
    search = Search(Problem(read_case(bench), 1), quick=True)
    fit = search.begin()
    screens, _ = search.screening.renewed(search.store, fit)
    found = {one.mode for one in ranked(search.store, screens, 12) if one.cause == ("pwm_curve", "left")}
    assert found == {(False,), (True,)}


def test_it_is_looked_for_on_an_axis_driven_by_voltage_alone(bench):
    axis = load_robot(bench / "robot.toml")
    by_torque = replace(axis, driver=replace(axis.driver, mode="torque", torque_nm_per_v=0.1))
    for robot, starts in ((axis, (0.0, 1.0)), (by_torque, (0.0,)), (builtin_robot("burger"), (0.0,))):
        *_, share = catalogue(robot)["pwm_curve"].parameters
        assert share.starts == starts
