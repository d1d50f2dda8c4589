"""Forms of sensors: where their curves end, their derivatives without a replay, and a name that one of them refutes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_cases import make_case

from rtds_host.contract import Case
from rtds_host.diagnosis.fit import Fitter
from rtds_host.diagnosis.forms import alike, forms_of
from rtds_host.diagnosis.forms.candidates import NEARER, NEEDS, candidates
from rtds_host.diagnosis.forms.curves import KNOTS, Form, points_of, put
from rtds_host.diagnosis.forms.screen import columns, columns_of_reading, only_read
from rtds_host.diagnosis.forms.search import searched
from rtds_host.diagnosis.problem import Problem
from rtds_host.plant import forms as plant


def explained(case):
    """A case and the fit of its tolerances alone."""
    problem = Problem(case, 1)
    return problem, Fitter(problem).fit((), np.empty(0), np.zeros(len(problem.nuisances)), problem.white())


def floor(model, side: int, size: float) -> None:
    """Let the current of a side read nothing below a size, A."""
    points = points_of("i", -0.7 * size, 0.7 * size)
    put(
        model,
        (side,),
        "current_sensor",
        "i",
        -1.4 * size,
        1.4 * size,
        np.where(np.abs(points) < 0.5 * size, -2.0, 0.0) * points,
    )


@pytest.fixture(scope="module")
def plain():
    return explained(make_case(seconds=8.0))


def test_a_sensors_curves_end_ever_nearer_to_zero_until_their_points_are_as_close_as_its_noise(plain):
    problem, fit = plain
    found = candidates(problem, fit.model(problem))
    for term, channels in NEEDS.items():
        over = {"current_sensor": "i", "speed_sensor": "w", "gyro_sensor": "yaw_rate"}[term]
        ends = sorted({form.high for form in found if (form.term, form.over) == (term, over)})
        assert len(ends) > 1
        assert ends[0] > KNOTS * problem.robot.noise(channels[0]) >= ends[0] / NEARER
    others = [form.high for form in found if form.term == "torque" and form.over == "w"]
    assert min(others) > 0.5 * max(others)


@pytest.mark.parametrize(
    ("term", "over", "side"),
    [("speed_sensor", "w", (0,)), ("current_sensor", "i", (0, 1)), ("gyro_sensor", "yaw_rate", (0, 1))],
)
def test_what_is_only_read_has_the_derivatives_that_replays_give(plain, term, over, side):
    problem, fit = plain
    form = next(form for form in candidates(problem, fit.model(problem)) if (form.term, form.over) == (term, over))
    assert only_read(problem, fit, form)
    model = fit.model(problem)
    (base,) = problem.residuals([model], [model.coarse_s])
    outs = problem.replay(model, model.coarse_s)
    again = problem.residual_of(model, outs)
    assert again == pytest.approx(base, abs=1e-6)
    replayed = columns(problem, fit, form, side, base)
    direct = columns_of_reading(problem, model, outs, form, side, again)
    # They differ where a standing wheel reads nothing but rounding, of either sign.
    moves = np.abs(replayed - direct).max(axis=1) < 1e-3 * np.abs(replayed).max()
    assert moves.mean() > 0.9
    assert np.abs(direct[moves]).max() > 0.0


def test_a_drift_a_torque_and_a_second_form_of_a_sensor_are_replayed(plain):
    problem, fit = plain
    assert not only_read(problem, fit, Form("gyro_sensor", "t", 0.0, 8.0, 0.1))
    assert not only_read(problem, fit, Form("torque", "w", -8.0, 8.0, 0.1))
    drifts = replace(fit, hypothesis=(("form:gyro_sensor:t", "both"),))
    assert not only_read(problem, drifts, Form("gyro_sensor", "yaw_rate", -2.0, 2.0, 0.1))
    assert only_read(problem, drifts, Form("speed_sensor", "w", -8.0, 8.0, 0.1))


@pytest.mark.parametrize("mode", ["speed", "voltage"])
def test_a_speed_loop_follows_what_its_sensor_tells(plain, mode):
    problem, fit = plain
    machine = SimpleNamespace(robot=SimpleNamespace(driver=SimpleNamespace(mode=mode)))
    assert only_read(machine, fit, Form("speed_sensor", "w", -8.0, 8.0, 0.1)) == (mode == "voltage")


def test_the_noise_of_the_channel_that_is_there_says_how_near_a_curve_ends():
    case = make_case(seconds=4.0)
    runs = tuple(replace(run, columns={k: v for k, v in run.columns.items() if k != "i_l"}) for run in case.runs)
    robot = replace(case.robot, rounding={"i_r": 0.02})
    problem, fit = explained(Case("one side", robot, runs))
    ends = [form.high for form in candidates(problem, fit.model(problem)) if form.term == "current_sensor"]
    assert min(ends) > KNOTS * problem.robot.noise("i_r") >= min(ends) / NEARER


def test_a_current_that_reads_nothing_below_a_size_is_no_gain():
    """Least squares make a gain of it, which is one shape of the curve. Left out, the curve has to change much."""
    problem, bare = explained(make_case(lambda model: floor(model, 0, 0.1), seconds=10.0))
    cause = ("current_gain", "left")
    start = np.array([problem.effects[cause[0]].parameters[0].scaled(0.6)])
    named = Fitter(problem).fit((cause,), start, bare.z, bare.noise)
    found = searched(problem, named, True, {cause: bare})
    assert [(form.term, side) for form, side in found.forms] == [("current_sensor", "left")]
    assert found.superseded == [cause]
    forms = forms_of(problem, named, problem.gap(named.model(problem)), True, {cause: bare})
    assert forms.entries[0]["formula"] != "a·x"


def test_curves_are_alike_whatever_their_size():
    curve = np.linspace(1.0, 2.0, plant.POINTS)
    assert alike(curve, -3.0 * curve)
    assert not alike(curve, curve[::-1])
    assert not alike(curve, np.zeros(plant.POINTS))


def test_a_floors_formula_knows_its_place_better_than_the_knots_of_its_curve():
    """A free curve is straight between seven knots. The formula's jump is then moved to where the replay leaves least,
    and the curve that is written has it there. The truth falls from the last of its points inside to the next."""
    size = 0.06

    def change(model):
        points = points_of("i", -0.12, 0.12)
        put(model, (0, 1), "current_sensor", "i", -0.12, 0.12, np.where(np.abs(points) < size, -points, 0.0))

    problem, fit = explained(make_case(change, seconds=8.0))
    found = forms_of(problem, fit, problem.gap(fit.model(problem)), True)
    (entry,) = found.entries
    assert (entry["term"], entry["over"], entry["formula"]) == ("current_sensor", "i", "a·x for |x| < b")
    place = entry["parameters"]["b"]
    assert place["value"] == pytest.approx(size, rel=0.05)
    low, high = place["ci90"]
    points = points_of("i", -0.12, 0.12)
    middle = 0.5 * (points[points < size].max() + points[points >= size].min())
    assert low < middle < high and high - low < 0.1 * size
    curve = np.array(entry["curve"])
    inside = np.abs(curve[:, 0]) < 0.9 * size
    assert curve[inside, 1] == pytest.approx(-curve[inside, 0], abs=0.003) and inside.sum() > 20
    assert curve[0, 1] == curve[-1, 1] == 0.0 and middle < curve[-1, 0] == -curve[0, 0] < 1.05 * size
