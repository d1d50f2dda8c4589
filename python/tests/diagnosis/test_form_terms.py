"""The page on forms says which terms run over what, by the driver's mode and the kind of robot."""

import re
from dataclasses import replace
from pathlib import Path

import pytest
from axis_machine import write_axis_case
from diagnosis_cases import make_case, without

from rtds_host.contract import read_case
from rtds_host.diagnosis.forms.candidates import RUNS_OVER, candidates
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.report.words import OVER_WORDS, TERM_WORDS

PAGE = Path(__file__).parents[3] / "docs" / "forms.md"
# What the page calls terms, where the report has other words.
PAGE_WORDS = {
    "torque at the wheel": "torque",
    "voltage behind the driver": "voltage",
    "torque constant and back-EMF, relative": "torque_constant",
    "force along the way": "force",
    "gyro reading": "gyro_sensor",
}
TERMS = {**{words: term for term, words in TERM_WORDS.items()}, **PAGE_WORDS}
OVERS = {OVER_WORDS[over]: over for overs in RUNS_OVER.values() for over in overs}


def some_of(overs: list[str], said: str) -> set[str]:
    """Those of a term's quantities that a cell of the table says: all, none, or all but some."""
    assert re.fullmatch("all|none|all but .+", said)
    if said == "none":
        return set()
    others = re.split(", | and ", said.removeprefix("all").removeprefix(" but "))
    return set(overs) - {OVERS[one] for one in others if one}


def said(torque_mode: bool, axis: bool) -> set[tuple[str, str]]:
    """Terms and what each runs over, as the page's table has them."""
    text = PAGE.read_text(encoding="utf-8")
    table = re.search(r"\| term \| runs over \|.*\n\|[-|]+\|\n((?:\|.*\n)+)", text)
    found = set()
    for line in table[1].splitlines():
        term, overs, in_torque_mode, on_axis = (cell.strip() for cell in line.strip("|").split("|"))
        names = [OVERS[one] for one in overs.split(", ")]
        held = set(names)
        held &= some_of(names, in_torque_mode) if torque_mode else held
        held &= some_of(names, on_axis) if axis else held
        found |= {(TERMS[term], over) for over in held}
    return found


def tried(case) -> set[tuple[str, str]]:
    problem = Problem(case, 1)
    return {(form.term, form.over) for form in candidates(problem, problem.nominal)}


@pytest.mark.parametrize("mode", ["voltage", "torque", "speed"])
def test_an_axis_has_the_terms_that_the_page_says(tmp_path, mode):
    case = read_case(write_axis_case(tmp_path / "case", "pendulum", mode))
    # A servo with a loop of its own reports no current.
    unread = {("current_sensor", "i")} if mode == "speed" else set()
    assert not unread or not any("i_l" in log.columns for log in case.runs)
    assert tried(case) == said(mode == "torque", axis=True) - unread


@pytest.mark.parametrize("mode", ["voltage", "torque"])
def test_a_robot_has_the_terms_that_the_page_says(mode):
    case = make_case(seconds=2.0)
    if mode == "torque":
        case = replace(
            case, robot=replace(case.robot, driver=replace(case.robot.driver, mode=mode, torque_nm_per_v=1e-4))
        )
    assert tried(case) == said(mode == "torque", axis=False)


def test_without_a_gear_there_is_no_motor_angle_and_without_a_sensor_no_reading():
    case = without(make_case(seconds=2.0), "gyro_z", "i_l", "i_r")
    case = replace(case, robot=replace(case.robot, motor=replace(case.robot.motor, gear_ratio=1.0)))
    lost = {("torque", "motor_angle"), ("current_sensor", "i"), ("gyro_sensor", "yaw_rate"), ("gyro_sensor", "t")}
    assert tried(case) == said(torque_mode=False, axis=False) - lost
