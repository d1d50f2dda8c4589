"""The bounds of the motor unit: current within 1e-6 and speed within 5e-7 of full scale, at every step."""

from __future__ import annotations

import numpy as np
import pytest

from rtds_host.motor import reference
from rtds_host.motor.accuracy import (
    CURRENT_BOUND,
    LOADS,
    NOMINAL,
    SPEED_BOUND,
    STEPS_S,
    SUPPLY_V,
    deviation,
    main,
    method_error,
)
from rtds_host.motor.parameters import METHODS

STALL_NM = NOMINAL[2] * SUPPLY_V / NOMINAL[0]


def assert_within_bounds(values, method, segments):
    found = deviation(values, method, segments)
    assert found.current < CURRENT_BOUND and found.current_both < CURRENT_BOUND
    assert found.speed < SPEED_BOUND and found.speed_both < SPEED_BOUND


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("step_s", STEPS_S)
@pytest.mark.parametrize("load", LOADS)
def test_within_the_bounds_of_the_same_equation_in_float64(step_s, method, load):
    assert_within_bounds((*NOMINAL, step_s), method, [(SUPPLY_V, LOADS[load] * STALL_NM, 2.0)])


@pytest.mark.long
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("step_s", STEPS_S)
@pytest.mark.parametrize("load", LOADS)
def test_within_the_bounds_over_300_seconds(step_s, method, load):
    assert_within_bounds((*NOMINAL, step_s), method, [(SUPPLY_V, LOADS[load] * STALL_NM, 300.0)])


@pytest.mark.parametrize("method", METHODS)
def test_within_the_bounds_when_inputs_change_all_the_time(method):
    rng = np.random.default_rng(7)
    segments = [(rng.uniform(-12, 12), rng.uniform(-5e-3, 5e-3), 2e-3) for _ in range(500)]
    assert_within_bounds((*NOMINAL, 1e-5), method, segments)


@pytest.mark.parametrize("method", METHODS)
def test_within_the_bounds_for_motors_three_times_larger_or_smaller(method):
    rng = np.random.default_rng(8)
    for _ in range(12):
        values = (np.array(NOMINAL) * 10.0 ** rng.uniform(-0.5, 0.5, 6)).tolist()
        stall = values[2] * SUPPLY_V / values[0]
        step_s = 10.0 ** rng.uniform(-6, -4.5)
        assert_within_bounds((*values, step_s), method, [(SUPPLY_V, rng.uniform(0, 1) * stall, 1.0)])


def test_both_methods_against_the_exact_solution_on_a_voltage_step():
    """First and second order: a tenth of the step divides the error by ten, and by a hundred."""
    coarse = {method: method_error((*NOMINAL, 1e-5), method) for method in METHODS}
    fine = {method: method_error((*NOMINAL, 1e-6), method) for method in METHODS}
    for k in range(2):
        assert coarse["backward_euler"][k] / fine["backward_euler"][k] == pytest.approx(10, rel=0.1)
        assert coarse["trapezoidal"][k] / fine["trapezoidal"][k] == pytest.approx(100, rel=0.02)
    assert coarse["backward_euler"] == pytest.approx((1.5e-2, 0.93e-4), rel=0.05)
    assert coarse["trapezoidal"] == pytest.approx((2.3e-4, 1.3e-6), rel=0.05)


def test_exact_solution_settles_where_physics_says():
    """No load: Km i = B w and V = R i + Kb w, by hand."""
    values = (*NOMINAL, 1e-3)
    r, _, km, kb, _, b, _ = values
    end = reference.run(np.zeros(2), *reference.exact_matrices(values), SUPPLY_V, 0.0, 1000, 1000)[0]
    speed = SUPPLY_V * km / (kb * km + r * b)
    assert end == pytest.approx([b * speed / km, speed], rel=1e-9)


def test_exact_solution_composes():
    """Ten steps of 1 us are one of 10 us: the references' only check that needs no other reference."""
    fine = reference.run(np.zeros(2), *reference.exact_matrices((*NOMINAL, 1e-6)), 12.0, 1e-3, 100, 100)[0]
    coarse = reference.run(np.zeros(2), *reference.exact_matrices((*NOMINAL, 1e-5)), 12.0, 1e-3, 10, 10)[0]
    assert fine == pytest.approx(coarse, rel=1e-11)


def test_report_prints_every_table(capsys):
    main(["--seconds", "0.05"])
    printed = capsys.readouterr().out
    assert printed.count("no load") == len(STEPS_S) * len(METHODS)
    assert "exact solution" in printed and "energy" in printed
    assert "nan" not in printed and "inf" not in printed


@pytest.mark.parametrize("seconds", ["0", "-1", "nan", "x"])
def test_report_refuses_an_impossible_time(seconds, capsys):
    with pytest.raises(SystemExit) as ended:
        main([f"--seconds={seconds}"])
    assert ended.value.code == 2
    assert "--seconds" in capsys.readouterr().err
