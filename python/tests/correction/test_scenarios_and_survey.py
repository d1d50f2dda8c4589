"""The commands that make the figures of the page on effects in the simulator."""

import json

import numpy as np
import pytest
from correction_cases import diagnosis_of, model_with, replayed_case, write_case
from typer.testing import CliRunner

from rtds_host.contract import builtin_robot
from rtds_host.correction.choose import choose
from rtds_host.errors import InputError
from rtds_host.robot import available_engines
from rtds_host.run import LinkChoice
from rtds_host.studies import scenarios
from rtds_host.studies.survey import Line, cases_of, markdown, survey

SHORT = {"duration_s": 1.2, "length_m": 0.05, "ramp_s": 0.4, "stop_s": 0.4}
DELAY = ("command_delay", "both", {"seconds": 0.02})


@pytest.fixture(scope="module")
def scored(tmp_path_factory):
    """A scored check as `rtds blind` leaves it, of two cases with one held-out run each."""
    out = tmp_path_factory.mktemp("blind")
    (out / "score").mkdir()
    (out / "score" / "score.json").write_text("{}")
    for name, effects in (("case-001", (DELAY,)), ("case-002", ())):
        case = replayed_case(model_with(*effects), seconds=2.0, count=1)
        (out / "public").mkdir(exist_ok=True)
        (out / "sealed" / name).mkdir(parents=True)
        write_case(case, out / "public" / name)
        write_case(case, out / "sealed" / name / "held-out")
        (out / "answers" / name).mkdir(parents=True)
        verdict = "known" if effects else "none"
        (out / "answers" / name / "diagnosis.json").write_text(json.dumps(diagnosis_of(*effects, verdict=verdict)))
    return out


def test_a_survey_tells_the_share_of_the_replays_closure(scored):
    first, second = survey(scored)
    assert (first.case, first.effects) == ("case-001", "command_delay (both)")
    assert first.share > 0.98
    assert first.apart < 0.1
    assert second.share is None, "nothing to close"
    text = markdown([first, second])
    assert "| 2 | 1 | " in text


def test_cases_the_simulator_closes_less_of_are_named():
    line = Line("case-009", "known", "backlash (left)", (5.0, 1.0, 1.0), (5.0, 2.0, 0.75), 0.75, 1.3)
    assert "case-009, backlash (left): the replay's gap falls from 5 to 1, the simulator's from 5 to 2." in markdown(
        [line]
    )


def test_held_out_runs_stay_closed_until_the_score(tmp_path):
    with pytest.raises(InputError, match="rtds blind score"):
        cases_of(tmp_path)


def test_a_sample_is_spread_evenly(scored):
    assert cases_of(scored) == ["case-001", "case-002"]
    assert cases_of(scored, 1) == ["case-001"]


@pytest.mark.skipif(len(available_engines()) < 2, reason="PyBullet has no wheel for this Python")
def test_scenarios_with_and_without_effects_in_both_engines(tmp_path):
    chosen = choose(builtin_robot("burger"), None, ["coulomb_friction.torque_nm=0.08,side=left"])
    (pair,) = scenarios.drive(chosen, "burger", LinkChoice("model"), "mujoco", names=("linear",), values=SHORT)
    assert pair.nominal.summary.effects == ()
    assert pair.changed.summary.effects
    more = pair.changed.record.currents[:, 0] - pair.nominal.record.currents[:, 0]
    assert more[np.argmax(pair.nominal.record.speeds[:, 0])] > 0.03, "the friction takes current"
    assert pair.changed.summary.engine_gap.engine == "pybullet"
    assert pair.changed.summary.engine_gap.end_position_m < 1e-3
    scenarios.draw([pair], tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 20_000
    assert scenarios.markdown([pair]).count("\n") == 4


def test_bad_input_ends_in_one_line():
    got = CliRunner().invoke(scenarios.app, ["--effect", "nothing.x=1"])
    assert got.exit_code == 2
    assert "not in the catalogue" in got.stderr
