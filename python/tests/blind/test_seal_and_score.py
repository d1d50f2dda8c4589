"""Sealing and scoring: tampering is noticed, the truth stays closed until every case is asked, figures mean what they
say.
"""

import json
import shutil
import subprocess
import sys

import numpy as np
import pyarrow.parquet as pq
import pytest

from rtds_host.blind import cases, kernel, score, seal
from rtds_host.contract import read_case
from rtds_host.errors import InputError

# A diagnoser that always says "no effect", and notes what it could see.
SILENT = """
import json, os, pathlib, sys
case, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[3])
out.mkdir(parents=True)
seen = sorted(str(p.relative_to(case)) for p in case.rglob("*"))
beside = sorted(p.name for p in case.parent.iterdir())
(out / "diagnosis.json").write_text(json.dumps({"schema": "rtds-diagnosis/1", "verdict": "none", "located": [],
  "effects": [], "indistinguishable": [], "alternatives": [], "seen": seen, "beside": beside}))
"""
FAILING = "import sys; print('rtds: case: no good', file=sys.stderr); sys.exit(2)"


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    """A small check, made and answered by the silent diagnoser."""
    out = tmp_path_factory.mktemp("check") / "blind"
    seal.make(out, 3, ["all", "none", "unknown"], ["planar"], seed=5, jobs=1)
    script = out.parent / "silent.py"
    script.write_text(SILENT)
    seal.answer(out, command=[sys.executable, str(script)])
    return out


@pytest.fixture
def copied(checked, tmp_path):
    shutil.copytree(checked, tmp_path / "blind")
    return tmp_path / "blind"


def test_seals_are_published_before_any_answer(checked):
    seals = seal.read_seals(checked)
    assert sorted(seals) == ["case-001", "case-002", "case-003"]
    assert all(len(value) == 64 for value in seals.values())
    first = seal.read_ledger(checked)[0]
    assert first["before"] == seal.hash_file(checked / "public" / "SEALS.json")


def test_the_diagnoser_sees_the_public_case_and_nothing_else(checked):
    for case in seal.read_seals(checked):
        told = json.loads((checked / "answers" / case / "diagnosis.json").read_text())
        assert not any("truth" in name or "held" in name or "seed" in name for name in told["seen"])
        assert told["beside"] in (["answer", "case"], ["case"])
        held = {p.name for p in (checked / "sealed" / case / "held-out").iterdir()}
        assert len(held) == cases.HELD_OUT


def test_untouched_truths_open(checked):
    truths, answers, ledger = seal.open_truths(checked)
    assert sorted(truth["tier"] for truth in truths.values()) == ["all", "none", "unknown"]
    assert len(answers) == len(ledger) == 3


@pytest.mark.parametrize("what", ["truth", "salt", "held-out", "case", "answer", "ledger", "seals", "extra answer"])
def test_tampering_is_noticed(copied, what):
    case = "case-001"
    truth = copied / "sealed" / case / "truth.json"
    answer = copied / "answers" / case / "diagnosis.json"
    ledger = copied / "answers" / "LEDGER.jsonl"
    if what in ("truth", "salt"):
        data = json.loads(truth.read_text())
        if what == "salt":
            data["salt"] = "0" * 32
        else:
            data["truth"]["verdict"] = "none" if data["truth"]["verdict"] != "none" else "known"
        truth.write_text(json.dumps(data))
    elif what in ("held-out", "case"):
        root = copied / "sealed" / case / "held-out" if what == "held-out" else copied / "public" / case
        path = next(p for p in sorted(root.rglob("run.json")))
        path.write_text(path.read_text().replace('"notes": ""', '"notes": "x"'))
    elif what == "answer":
        answer.write_text(answer.read_text().replace('"none"', '"unknown"'))
    elif what == "ledger":
        ledger.write_text(ledger.read_text().replace('"seconds":', '"seconds":1', 1))
    elif what == "seals":
        data = json.loads(truth.read_text())
        data["truth"]["verdict"] = "unknown"
        truth.write_text(json.dumps(data))
        seals = json.loads((copied / "public" / "SEALS.json").read_text())
        seals["cases"][case] = seal.seal(data["salt"], data["truth"])
        (copied / "public" / "SEALS.json").write_text(json.dumps(seals))
    else:
        lines = ledger.read_text().splitlines()
        ledger.write_text("\n".join(lines[:-1]) + "\n")
    with pytest.raises(InputError, match="differs|changed|not been asked"):
        seal.open_truths(copied)


def test_the_truth_stays_closed_until_every_case_is_asked(copied):
    shutil.rmtree(copied / "answers")
    with pytest.raises(InputError, match="stays closed"):
        seal.open_truths(copied)


def test_a_case_that_fails_is_recorded_and_the_others_are_answered(copied, tmp_path):
    shutil.rmtree(copied / "answers")
    script = tmp_path / "failing.py"
    script.write_text(FAILING)
    ledger = seal.answer(copied, command=[sys.executable, str(script)])
    assert [entry["status"] for entry in ledger] == [2, 2, 2]
    assert all(entry["sha256"] is None and "no good" in entry["said"] for entry in ledger)
    result = score.score(copied, with_closure=False)
    assert result["everything"]["answered"] == 0
    assert result["everything"]["verdict_right"]["hits"] == 0


def test_an_interrupted_answering_goes_on_where_it_stopped(copied, tmp_path):
    ledger = copied / "answers" / "LEDGER.jsonl"
    kept = ledger.read_text().splitlines()[:1]
    ledger.write_text(kept[0] + "\n")
    for line in ("case-002", "case-003"):
        shutil.rmtree(copied / "answers" / line)
    script = tmp_path / "silent.py"
    script.write_text(SILENT)
    again = seal.answer(copied, command=[sys.executable, str(script)])
    assert [entry["case"] for entry in again] == ["case-001", "case-002", "case-003"]
    assert ledger.read_text().splitlines()[0] == kept[0]


def test_a_long_check_has_enough_cases_of_every_tier():
    plan = seal.shares(310, list(cases.TIERS))
    assert len(plan) == 310 and plan.count("none") >= 60
    assert all(plan.count(tier) >= 30 for tier in cases.TIERS)
    assert set(seal.shares(60, list(cases.TIERS))) == set(cases.TIERS)


def test_a_check_is_not_made_twice_and_bad_requests_are_refused(copied, tmp_path):
    with pytest.raises(InputError, match="not made again"):
        seal.make(copied, 3)
    with pytest.raises(InputError, match="tier 'al': unknown"):
        seal.make(tmp_path / "x", 3, ["al"])
    with pytest.raises(InputError, match="missing, make a check first"):
        seal.read_seals(tmp_path / "x")


def test_the_same_seed_makes_the_same_public_cases(checked, tmp_path):
    seal.make(tmp_path / "again", 3, ["all", "none", "unknown"], ["planar"], seed=5, jobs=1)
    for case in seal.read_seals(checked):
        assert seal.hash_folder(tmp_path / "again" / "public" / case) == seal.hash_folder(checked / "public" / case)
    assert seal.read_seals(tmp_path / "again") != seal.read_seals(checked)  # the salt is new


def test_a_case_that_becomes_unstable_is_drawn_again(tmp_path, monkeypatch):
    whole, specs = seal.make_case, []

    def unstable_at_first(number, spec, folder, **rest):
        specs.append(spec)
        if len(specs) == 1:
            (folder / "begun").mkdir(parents=True)
            raise kernel.Diverged("unstable")
        spec["runs"], spec["held_out"] = [dict(spec["runs"][0], duration=2.0)], []
        return whole(number, spec, folder, **rest)

    monkeypatch.setattr(seal, "make_case", unstable_at_first)
    assert len(seal.make(tmp_path, 1, ["none"], ["planar"], seed=1, jobs=1)) == 1
    assert len(specs) == 2 and specs[0] != specs[1]
    assert not (tmp_path / "public" / "case-001" / "begun").exists()
    assert read_case(tmp_path / "public" / "case-001").runs


def test_the_silent_diagnoser_scores_what_it_deserves(checked):
    result = score.score(checked, with_closure=False)
    tiers = result["tiers"]
    assert tiers["none"]["verdict_right"]["share"] == 1 and tiers["none"]["false_cause"]["share"] == 0
    assert result["everything"]["cause_right"]["hits"] == 0
    assert result["everything"]["unknown_right"]["hits"] == 0
    assert (checked / "score" / "page.md").read_text().startswith("# Blind check")
    table = pq.read_table(checked / "score" / "cases.parquet").to_pylist()
    assert [row["case"] for row in table] == ["case-001", "case-002", "case-003"]
    assert (checked / "score" / "calibration.png").stat().st_size > 1000


def test_closures_are_kept_until_the_answer_or_the_program_is_another(copied, monkeypatch):
    asked = []

    def counted(case, *rest, **named):
        asked.append(case.name)
        return {"runs": [], "closed": None}

    monkeypatch.setattr(score, "closure", counted)
    count = len(seal.read_seals(copied))
    for state, times in (("one", 1), ("one", 1), ("other", 2)):
        monkeypatch.setattr(score, "program_state", lambda state=state: state)
        score.score(copied)
        assert len(asked) == times * count


def truth(*effects, verdict="known", **more):
    subsystems = {"coulomb_friction": "drivetrain", "rolling_resistance": "wheel_ground", "driver_gain": "driver"}
    return {
        "tier": "all",
        "verdict": verdict,
        "size_sigma": 50.0,
        "effects": [{"id": i, "side": s, "subsystem": subsystems[i], "parameters": p} for i, s, p in effects],
        **more,
    }


def answer(*effects, verdict="known", sets=(), located=("drivetrain",)):
    return {
        "verdict": verdict,
        "located": [{"subsystem": x, "share": 1.0} for x in located],
        "effects": [{"id": i, "side": s, "probability": 0.9, "parameters": p} for i, s, p in effects],
        "indistinguishable": [[{"id": i, "side": s} for i, s in group] for group in sets],
    }


ENTRY = {"seconds": 3.0, "said": ""}
COULOMB = ("coulomb_friction", "both", {"torque_nm": 0.05})


def test_a_right_answer_counts_in_every_respect():
    said = answer(("coulomb_friction", "both", {"torque_nm": {"value": 0.055, "ci90": [0.04, 0.06]}}))
    r = score.judge(truth(COULOMB), said, ENTRY)
    assert r["cause_right"] and r["first_right"] and r["in_set"] and r["subsystem_right"] and r["verdict_right"]
    assert r["set_size"] == 1 and not r["extra_cause"] and not r["wrongly_unknown"]
    assert r["parameters"][0]["relative_error"] == pytest.approx(0.1) and r["parameters"][0]["covered"]
    assert r["calibration"] == [[0.9, True]]


def test_the_wrong_side_is_not_the_right_cause():
    r = score.judge(truth(COULOMB), answer(("coulomb_friction", "left", {})), ENTRY)
    assert not r["cause_right"] and r["id_right"] and not r["in_set"] and r["extra_cause"]


def test_a_rival_in_a_declared_set_of_three_is_right_and_in_one_of_four_is_not():
    group = [("rolling_resistance", "both"), ("coulomb_friction", "both"), ("driver_deadzone", "both")]
    said = answer(("rolling_resistance", "both", {}), sets=[group])
    r = score.judge(truth(COULOMB), said, ENTRY)
    assert not r["cause_right"] and r["in_set"] and r["set_size"] == 3 and not r["extra_cause"]
    said = answer(("rolling_resistance", "both", {}), sets=[[*group, ("bridge_drop", "both")]])
    assert not score.judge(truth(COULOMB), said, ENTRY)["in_set"]


def test_one_of_a_pair_is_not_both():
    pair = truth(COULOMB, ("driver_gain", "left", {"ratio": 1.1}))
    r = score.judge(pair, answer(COULOMB[:2] + ({},)), ENTRY)
    assert r["any_right"] and not r["cause_right"] and not r["in_set"]
    r = score.judge(pair, answer(COULOMB[:2] + ({},), ("driver_gain", "left", {})), ENTRY)
    assert r["cause_right"]


def test_false_causes_and_unknown_are_counted_where_they_belong():
    r = score.judge(truth(verdict="none"), answer(COULOMB[:2] + ({},)), ENTRY)
    assert r["false_cause"] and r["cause_right"] is None and r["unknown_right"] is None
    outside = {"id": "cable_drag", "subsystem": "chassis"}
    r = score.judge(truth(verdict="unknown", outside=outside), answer(verdict="unknown", located=("chassis",)), ENTRY)
    assert r["unknown_right"] and r["subsystem_right"] and r["wrongly_unknown"] is None
    r = score.judge(truth(COULOMB), answer(verdict="unknown"), ENTRY)
    assert r["wrongly_unknown"] and not r["any_right"]


def test_phases_are_compared_around_the_circle():
    effect = ("driver_gain", "both", {"phase_rad": 3.1})
    said = answer(("driver_gain", "both", {"phase_rad": {"value": -3.1, "ci90": [-3.3, -2.9]}}))
    p = score.judge(truth(effect), said, ENTRY)["parameters"][0]
    assert abs(p["relative_error"]) < 0.03 and p["covered"]


def test_wilson_intervals_are_those_of_the_literature():
    low, high = score.wilson(9, 10)
    assert (low, high) == (pytest.approx(0.5958, abs=1e-4), pytest.approx(0.9821, abs=1e-4))
    assert score.wilson(0, 0) == (0.0, 1.0)
    assert score.wilson(0, 20)[0] == 0 and score.wilson(20, 20)[1] == 1


def test_calibration_bins_stated_probability_against_truth():
    records = (
        [{"calibration": [[0.9, True]]}] * 8 + [{"calibration": [[0.9, False]]}] * 2 + [{"calibration": [[0.1, False]]}]
    )
    points = score.calibration(records)
    assert [(p["stated"], p["true"], p["count"]) for p in points] == [(0.1, 0.0, 1), (0.9, 0.8, 10)]


def test_closure_is_measured_on_unseen_runs_through_a_prediction(tmp_path):
    """A prediction by the true machine closes the gap; one by the nominal robot closes nothing."""
    spec = cases.draw_spec(np.random.default_rng(1), "all")
    effect = {"id": "driver_gain", "side": "both", "subsystem": "driver", "parameters": {"ratio": 1.2}}
    spec.update(effects=[effect], missing=[], slow={}, dropped=0.0)
    cases.make_case(3, spec, tmp_path / "case", held_out=tmp_path / "held")
    (tmp_path / "d.json").write_text("{}")
    script = tmp_path / "predict.py"
    script.write_text(
        "import sys\nimport numpy as np\nfrom rtds_host.blind import planar\n"
        "from rtds_host.contract import load_robot, read_run, write_csv\nfrom pathlib import Path\n"
        "ratio, run, robot, out = float(sys.argv[1]), read_run(sys.argv[2]), load_robot(sys.argv[4]), sys.argv[8]\n"
        "m = planar.nominal_machine(robot)\nm.scale('gain', ratio)\n"
        "start = np.array([run.columns[c][0] for c in ('x', 'y', 'yaw', 'th_l', 'th_r')])\n"
        "raw = planar.run_machine(m, run.t, run.commands().copy(), start, run.meta.payload_kg, run.meta.slope_rad,"
        " run.meta.uphill_yaw_rad)\nwrite_csv(Path(out), {'t': run.t, **raw})\n"
    )

    def closed(ratio):
        return score.closure(
            tmp_path / "case", tmp_path / "held", tmp_path / "d.json", [sys.executable, str(script), str(ratio)]
        )

    assert closed(1.2)["closed"] == pytest.approx(1.0, abs=0.02)
    assert closed(1.0)["closed"] == pytest.approx(0.0, abs=0.02)
    assert "error" in score.closure(
        tmp_path / "case", tmp_path / "held", tmp_path / "d.json", [sys.executable, "-c", FAILING]
    )


def test_the_command_line_makes_and_reports_in_one_line(tmp_path):
    run = [sys.executable, "-m", "rtds_host.cli.main", "blind"]
    done = subprocess.run([*run, "score", "--out", str(tmp_path / "none")], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and "rtds blind make" in done.stderr
    done = subprocess.run(
        [
            *run,
            "make",
            "--out",
            str(tmp_path / "b"),
            "--n",
            "1",
            "--tier",
            "none",
            "--world",
            "planar",
            "--jobs",
            "1",
            "--seed",
            "3",
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert read_case(tmp_path / "b" / "public" / "case-001").runs


MANY = [
    {**e, "gap_without": gap}
    for e, gap in (
        ({"id": "coulomb_friction", "side": "left", "subsystem": "drivetrain", "parameters": {"torque_nm": 0.05}}, 6.0),
        ({"id": "driver_gain", "side": "both", "subsystem": "driver", "parameters": {"ratio": 1.1}}, 3.0),
        ({"id": "gyro_bias", "side": "both", "subsystem": "sensing", "parameters": {"rad_s": 0.01}}, 1.3),
    )
]


def many(rest=None):
    more = {"rest": rest} if rest else {}
    return {
        "tier": "messy" if rest else "many",
        "verdict": "known",
        "effects": MANY,
        "size_sigma": 90.0,
        "held_out_gap": {"before": 9.0, "refit": 8.5, "known": 5.0 if rest else 1.0},
        **more,
    }


def test_only_effects_that_matter_are_asked_for_and_each_name_counts():
    said = answer(
        ("rolling_resistance", "both", {}),
        ("driver_gain", "both", {}),
        ("payload_error", "both", {}),
        sets=[[("rolling_resistance", "both"), ("coulomb_friction", "left")]],
    )
    r = score.judge(many(), said, ENTRY)
    assert r["asked"] == [["coulomb_friction", "left", True], ["driver_gain", "both", True]]
    assert [hit for *_, hit in r["named"]] == [True, True, False]
    summary = score.summarise([{**r, "closure": None}])
    assert summary["asked"]["share"] == 1 and summary["named"]["hits"] == 2 and summary["named"]["count"] == 3
    assert ("payload_error", 0, 0, 1, 0) in score.by_effect([r])


def test_a_small_effect_that_is_named_is_right_but_not_asked_for():
    r = score.judge(many(), answer(("gyro_bias", "both", {})), ENTRY)
    assert [hit for *_, hit in r["asked"]] == [False, False] and r["named"] == [["gyro_bias", "both", True]]


def test_a_case_with_a_residual_may_be_called_known_or_partial_and_the_residual_has_a_place():
    rest = {"id": "cable_drag", "subsystem": "chassis", "gap_without": 2.0, "share": 0.2}
    for verdict, right in (("known", True), ("partial", True), ("unknown", False)):
        said = {**answer(("driver_gain", "both", {}), verdict=verdict), "gap": {"rest": {"subsystem": "chassis"}}}
        r = score.judge(many(rest), said, ENTRY)
        assert r["verdict_right"] is right and r["rest_right"]
    said["gap"] = {"rest": {"subsystem": None}}
    said["budget"] = [
        {"what": "rest", "subsystem": "driver", "share": 0.1},
        {"what": "rest", "subsystem": None, "share": 0.3},
    ]
    assert score.judge(many(rest), said, ENTRY)["rest_said"] == "driver"
    assert score.judge(many({**rest, "gap_without": 1.05}), said, ENTRY)["rest_right"] is None
    first = answer(("driver_gain", "both", {}), located=("driver", "chassis"))
    assert score.judge(many(rest), first, ENTRY)["rest_right"]  # schema 1: the next place


def test_closure_is_measured_against_what_names_can_close_and_against_the_stated_interval():
    rest = {"id": "cable_drag", "subsystem": "chassis", "gap_without": 2.0, "share": 0.2}
    said = {**answer(("driver_gain", "both", {})), "gap": {"closed_ci90": [0.3, 0.5]}}
    r = score.judge(many(rest), said, ENTRY)
    assert r["closable"] == 0.5  # from 9 to 5, of 9 to 1
    r["closure"] = {"before": 9.0, "after": 5.8, "closed": 0.4, "runs": [0.45, 0.6, None]}
    assert score.fresh_held(r) == [True, False]
    summary = score.summarise([r])
    assert summary["of_closable"]["median"] == 0.8 and summary["fresh_held"]["hits"] == 1
    # A prediction has forms in it, and the interval has not.
    formed = {**said, "forms": [{"term": "voltage", "side": "left", "over": "i"}]}
    assert score.judge(many(rest), formed, ENTRY)["closed_ci90"] is None


def test_the_page_says_how_its_cases_were_drawn():
    drawn = {"seed": 4, "count": 9, "tiers": ["many", "messy"], "worlds": list(cases.WORLDS)}
    assert score.made_by(drawn) == "rtds blind make --n 9 --seed 4 --tier many --tier messy"
    assert score.made_by({**drawn, "tiers": list(cases.TIERS)}) == "rtds blind make --n 9 --seed 4"
