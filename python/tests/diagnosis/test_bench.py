"""The comparison with what one would do today: the same searches, judged by two common methods."""

import json
import shutil

import pytest
from diagnosis_cases import make_case

from rtds_host.contract import builtin_robot_path, write_run
from rtds_host.studies import bench


@pytest.mark.parametrize(
    ("change", "truth"),
    [
        (
            lambda m: m.add("coulomb", 0.03),
            [{"id": "coulomb_friction", "side": "both", "subsystem": "drivetrain", "parameters": {"torque_nm": 0.03}}],
        ),
        (None, []),
    ],
    ids=["friction", "nothing"],
)
def test_a_case_is_answered_by_each_method_and_counted_on_the_page(tmp_path, change, truth):
    for run in make_case(change).runs:
        write_run(tmp_path / "case" / run.name, run.meta, {"t": run.t, **run.columns})
    shutil.copy(builtin_robot_path("burger"), tmp_path / "case" / "robot.toml")
    said = {"verdict": "known" if truth else "none", "effects": truth, "size_sigma": 50.0}
    (tmp_path / "truth.json").write_text(json.dumps(said))
    row = bench.answers_to(
        ("all" if truth else "none", str(tmp_path / "case"), str(tmp_path / "truth.json"), True, None)
    )
    expected = {(e["id"], e["side"]) for e in truth}
    assert bench.causes_named(row["diagnosis"]) == expected
    # A rest of white noise alone is what both methods are made for.
    assert {tuple(cause) for cause in row["others"]["BIC over candidates"]} == expected
    assert len(row["others"]["largest improvement of fit"]) == 1
    page = bench.page([row], "the command")
    assert "Made by `the command`: 1 cases" in page
    assert ("| right cause and side, all channels, no tolerance | 1/1" in page) is bool(truth)
    assert ("| false cause where there is none | 0/1" in page) is (not truth)
    assert ("| 90 % intervals that hold the truth | 1/1" in page) is bool(truth)
