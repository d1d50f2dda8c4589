"""How runs began is a value that a fit keeps: whatever is estimated later, its replays are those it was fitted to."""

import numpy as np
import pytest
from diagnosis_cases import make_case, without

from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.search.store import Store
from rtds_host.diagnosis.start import DECLARED

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
