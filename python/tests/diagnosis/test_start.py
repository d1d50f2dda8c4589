"""How runs began is a value that a fit keeps: whatever is estimated later, its replays are those it was fitted to."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import make_case, without

from rtds_host.contract import Driver, RunLog, RunMeta, Servo, builtin_robot
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.search.store import Store
from rtds_host.diagnosis.start import DECLARED
from rtds_host.plant.schema import OUTPUT_INDEX

STARTS = {
    "heading": DECLARED.with_headings({"steps": 0.4}),
    "commands": DECLARED.with_command_delays({"weave": 0.05}),
}


@pytest.fixture(scope="module")
def store():
    return Store(Problem(without(make_case(seconds=2.0), "yaw", "x", "y"), 1))


@pytest.mark.parametrize("start", STARTS.values(), ids=STARTS)
def test_a_fit_replays_as_it_was_fitted_whatever_is_estimated_afterwards(store, start):
    problem, nothing = store.problem, (np.empty(0), np.zeros(store.fitter.count))
    fit = store.fitter.fit((), *nothing, problem.white(), 1)
    gap = problem.gap_as_fitted(fit.model(problem))
    store.fitter.start = start
    other = store.fitter.fit((), *nothing, problem.white(), 1)
    try:
        assert not np.array_equal(problem.residual(other.model(problem)), problem.residual(fit.model(problem)))
        for one in (fit, other):
            assert np.array_equal(problem.residual(one.model(problem)), one.residual)
        assert problem.gap_as_fitted(fit.model(problem)) == gap != problem.gap_as_fitted(other.model(problem))
    finally:
        store.fitter.start = DECLARED


def test_models_that_begin_differently_are_replayed_together_as_alone(store):
    problem = store.problem
    models = [problem.nominal, *(problem.nominal.with_start(start) for start in STARTS.values()), problem.nominal]
    together = problem.residuals(models)
    for model, residual in zip(models, together, strict=True):
        assert np.array_equal(residual, problem.residual(model))
    assert len({residual.tobytes() for residual in together}) == 3


def test_an_estimate_of_a_start_changes_nothing_but_what_it_returns(store):
    problem = store.problem
    model = problem.nominal.copy()
    model.scale("voltage_gain", 0.9, (1,))
    before = problem.residual(model)
    start = problem.aligned(model)
    assert dict(start.headings).keys() == {"steps"} and model.start == DECLARED
    assert np.array_equal(problem.residual(model), before)
    assert float(np.sum(problem.residual(model.with_start(start)) ** 2)) < float(np.sum(before**2))


@pytest.mark.parametrize("reported", [("w_l", "w_r"), ("w_l", "w_r", "i_l", "i_r")], ids=["speeds", "currents"])
@pytest.mark.parametrize("ki", [8.45, 0.0])
@pytest.mark.parametrize("coulomb", [0.0, 0.05])
def test_a_speed_loop_whose_log_begins_in_motion_goes_on_as_it_did(reported, ki, coulomb):
    """A logger that is started late says nothing of the loop's integral, which by then holds the speed."""
    robot = replace(
        builtin_robot("burger"),
        driver=Driver(mode="speed"),
        servo=Servo(kp_v_s_per_rad=1.69, ki_v_per_rad=ki, limit_v=12.0, period_s=0.005),
    )
    model = nominal_model(robot)
    model.put("coulomb", coulomb)
    t = np.arange(0.0, 5.0, 0.02)
    columns = {"w_cmd_l": np.where(t < 3.0, 3.0, -2.0), "w_cmd_r": np.where(t < 3.0, 4.0, 1.0)}
    whole = replay_run(model, run_inputs(RunLog("run", RunMeta(), t, columns), robot))
    late = slice(100, None)  # 2 s after its start from rest
    cut = {name: values[late] for name, values in columns.items()}
    cut |= {name: whole[late, OUTPUT_INDEX[name]] for name in reported}
    after = replay_run(model, run_inputs(RunLog("run", RunMeta(), t[late], cut), robot))
    for name in ("w_l", "w_r"):
        error = after[:, OUTPUT_INDEX[name]] - whole[late, OUTPUT_INDEX[name]]
        assert np.abs(error).max() < 0.5 * robot.noise(name)
