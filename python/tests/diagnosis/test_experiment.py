"""The next experiment: what it is for is said as it is."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_cases import make_case

from rtds_host.contract import Servo
from rtds_host.diagnosis.experiment import next_experiment, purpose_of
from rtds_host.diagnosis.problem import Problem

DELAYS = (("command_delay", "both"), ("measurement_delay", "both"))


@pytest.fixture(scope="module")
def problem():
    return Problem(make_case(seconds=2.0), 1)


def asked(problem, place, alike=()):
    fit = SimpleNamespace(z=np.empty(0), precision=np.empty((0, 0)), parts={}, hypothesis=tuple(alike[:1]))
    fits = {(cause,): fit for cause in alike}
    attribution = SimpleNamespace(indistinguishable=(alike,) if alike else (), fit=fit)
    diagnosis = {"verdict": "unknown", "gap": {"rest": {"subsystem": place}}}
    return next_experiment(problem, SimpleNamespace(fits=fits), attribution, diagnosis)


def by_speed(problem):
    robot = problem.robot
    return SimpleNamespace(
        robot=replace(robot, driver=replace(robot.driver, mode="speed"), servo=Servo(0.44, 8.6, 12.0, 0.001)),
        effects=problem.effects,
    )


def test_of_a_residual_without_a_place_nothing_is_promised(problem):
    plan = asked(problem, None)
    assert (plan["scenario"], plan["separates"], plan["expected_separation"]) == ("teleop", [], 0.0)
    assert plan["why"] == (
        "the place of the unmodelled part is not known; this manoeuvre is a general mix of motions: driven as a "
        "person would: forward, back, round corners, stops"
    )


def test_no_manoeuvre_is_said_to_separate_what_none_was_tried_on(problem):
    plan = asked(by_speed(problem), None, DELAYS)
    assert plan["expected_separation"] == 0.0 and [m["id"] for m in plan["separates"]] == [name for name, _ in DELAYS]
    assert plan["why"].startswith("the best manoeuvre could not be computed for this robot; this one is a general mix")


@pytest.mark.parametrize(
    ("alike", "place", "compared", "said"),
    [
        (True, None, True, "it separates best what is indistinguishable in these runs"),
        (
            False,
            "wheel_ground",
            True,
            "most of the unmodelled part is in the wheel and ground, which this manoeuvre excites most",
        ),
        (
            False,
            "wheel_ground",
            False,
            "most of the unmodelled part is in the wheel and ground, but the best manoeuvre could not be computed",
        ),
    ],
)
def test_what_a_manoeuvre_is_for(alike, place, compared, said):
    assert purpose_of(alike, place, compared).startswith(said)
