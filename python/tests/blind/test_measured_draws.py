"""Sealed draws on measured data: what is planted is what the truth says, nothing tells it, and the score is fair."""

import json
import math
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from axis_machine import write_axis_case

from rtds_host.blind import measured, plants, seal
from rtds_host.blind.measured_answer import judge_planted
from rtds_host.blind.measured_gaps import VISIBLE, carried_over
from rtds_host.blind.measured_score import score_measured
from rtds_host.contract import load_robot, read_case
from rtds_host.errors import InputError

# A diagnoser that names Coulomb friction in every case.
SAME = """
import json, pathlib, sys
out = pathlib.Path(sys.argv[3])
out.mkdir(parents=True)
(out / "diagnosis.json").write_text(json.dumps({"schema": "rtds-diagnosis/1", "verdict": "known", "located": [],
  "effects": [{"id": "coulomb_friction", "side": "left", "probability": 1.0,
               "parameters": {"torque_nm": {"value": 0.03, "ci90": None}}}], "indistinguishable": [],
               "nominal_fit": {}}))
"""


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """Two data sets of machines with dry friction: a pendulum on a measured bus with four runs, a linear axis in torque
    mode with three."""
    root = tmp_path_factory.mktemp("measured")
    arm = write_axis_case(root / "arm", "pendulum", "voltage", bus="measured", coulomb=0.03, seconds=3.0)
    shutil.copytree(next(p for p in arm.iterdir() if p.is_dir()), arm / "one-more")
    return [arm, write_axis_case(root / "slide", "linear", "torque", coulomb=0.03, seconds=3.0)]


@pytest.fixture(scope="module")
def check(sources, tmp_path_factory):
    out = tmp_path_factory.mktemp("check") / "out"
    measured.make_measured(out, sources, 9, seed=4)
    return out


def truths(out):
    return {p.parent.name: json.loads(p.read_text())["truth"] for p in sorted(out.glob("sealed/case-*/truth.json"))}


def drawn(source, kind, seed=0):
    case = read_case(source)
    return case, plants.kinds(case)[kind](np.random.default_rng(seed))


def test_each_data_set_gives_its_draws_and_one_untouched_case_in_no_order(check):
    kinds = [(t["set"], t["kind"]) for t in truths(check).values()]
    assert len(kinds) == 20
    assert kinds.count(("arm", "base")) == kinds.count(("slide", "base")) == 1
    assert kinds != sorted(kinds)
    assert {kind for name, kind in kinds if name == "slide"} == {
        "base",
        "mass",
        "length",
        "torque constant",
        "command gain",
        "command bias",
        "speed gain",
        "speed delayed",
        "all delayed",
    }


def test_a_public_case_holds_robot_and_runs_and_nothing_that_tells(check, sources):
    for case, truth in truths(check).items():
        public = check / "public" / case
        read = read_case(public)
        assert read.robot.name == "measured" and "#" not in (public / "robot.toml").read_text()
        assert sorted(p.name for p in public.iterdir()) == sorted(["robot.toml", *(run.name for run in read.runs)])
        held = {p.name for p in (check / "sealed" / case / "held-out").iterdir()}
        source = next(s for s in sources if s.name == truth["set"])
        # One in four: of three runs none.
        assert len(held) == (truth["set"] == "arm")
        assert held | {r.name for r in read.runs} == {r.name for r in read_case(source).runs}


def test_the_untouched_case_is_the_data_as_they_are(check, sources):
    for case, truth in truths(check).items():
        if truth["kind"] == "base":
            source = read_case(next(s for s in sources if s.name == truth["set"]))
            for run in read_case(check / "public" / case).runs:
                was = next(r for r in source.runs if r.name == run.name)
                assert all(np.array_equal(run.columns[c], was.columns[c]) for c in was.columns)


def test_every_planted_case_differs_from_the_untouched_one_in_what_the_truth_says(check):
    all_truths = truths(check)
    base = {t["set"]: read_case(check / "public" / c) for c, t in all_truths.items() if t["kind"] == "base"}
    for case, truth in all_truths.items():
        if truth["kind"] == "base":
            continue
        planted, plain = read_case(check / "public" / case), base[truth["set"]]
        declared = truth["kind"] in ("mass", "length", "torque constant", "voltage", "resistance")
        assert (planted.robot != plain.robot) == declared, truth["said"]
        same = all(
            len(a.t) == len(b.t) and all(np.array_equal(a.columns[c], b.columns[c]) for c in b.columns)
            for a, b in zip(planted.runs, plain.runs)
        )
        assert same == declared, truth["said"]


def test_a_wrong_mass_is_the_mass_that_is_missing(sources):
    case, plant = drawn(sources[1], "mass")
    declared = plant.declared["axis", "mass_kg"]
    same = {e.effect: e for e in plant.same}
    assert same["payload_error"].low == pytest.approx(case.robot.axis.mass_kg - declared)
    # Seen from the motor it is the rotor's inertia.
    rotor = case.robot.motor.rotor_inertia_kg_m2 * case.robot.motor.gear_ratio**2
    inertia = (case.robot.axis.mass_kg - declared) * case.robot.axis.metres_per_rad**2
    assert same["rotor_inertia_error"].low == pytest.approx(1 + inertia / rotor)


def test_a_wrong_arm_lies_between_what_gravity_and_what_inertia_ask_for(sources):
    _, plant = drawn(sources[0], "length")
    mass, length, declared = 0.3, 0.1, plant.declared["axis", "length_m"]
    (wanted,) = [e for e in plant.same if e.effect == "payload_error"]
    ends = sorted(((mass * length / declared) - mass, mass * (length / declared) ** 2 - mass))
    assert [wanted.low, wanted.high] == pytest.approx(ends)


def test_a_stronger_drive_and_a_larger_reading_are_one_thing_where_gravity_is_not(sources):
    _, slide = drawn(sources[1], "torque constant")
    _, arm = drawn(sources[0], "command gain")
    assert {e.effect for e in slide.same} == {"driver_gain", "speed_gain"}
    assert {e.effect for e in arm.same} == {"driver_gain"} and "speed_gain" in {e.effect for e in arm.alike}


def test_a_supply_declared_too_high_is_a_drive_that_is_too_strong(sources):
    _, plant = drawn(sources[0], "voltage")
    (same,) = [e for e in plant.same if e.effect == "driver_gain"]
    assert same.low == pytest.approx(plant.declared["supply", "voltage_v"] / 12.0)


@pytest.mark.parametrize("moving", [False, True])
def test_late_columns_show_what_was_there_before_and_the_commands_stay(sources, moving):
    """Before a run that begins at rest there was rest. Before one that begins moving nobody knows what was there."""
    case, plant = drawn(sources[0], "all delayed")
    late = plant.same[0].low
    run = case.runs[0]
    columns = run.columns | {"w_l": run.columns["w_l"] + (9.0 if moving else -run.columns["w_l"][0])}
    run = replace(run, columns=columns)
    t, columns = plant.alter(run)
    if moving:
        assert t[0] >= run.t[0] + late and len(t) < len(run.t)
    else:
        assert np.array_equal(t, run.t) and columns["w_l"][0] == 0.0
    k = len(t) // 2
    assert columns["w_l"][k] == pytest.approx(np.interp(t[k] - late, run.t, run.columns["w_l"]))
    assert columns["v_cmd_l"][k] == run.columns["v_cmd_l"][len(run.t) - len(t) + k]


def test_empty_cells_stay_empty_when_a_channel_is_shifted():
    t = np.arange(6) * 0.1
    values = np.array([0.0, np.nan, 2.0, np.nan, 4.0, np.nan])
    assert plants.shifted(t, values, 0.1) == pytest.approx([0, np.nan, 1, np.nan, 3, np.nan], nan_ok=True)


def test_a_command_off_by_a_constant_is_a_torque_that_has_one_sign(sources):
    case, plant = drawn(sources[1], "command bias")
    volts = plant.alter(case.runs[0])[1]["v_cmd_l"][0] - case.runs[0].columns["v_cmd_l"][0]
    (same,) = plant.same
    assert (same.effect, same.parameter) == ("friction_asymmetry", "torque_nm")
    assert same.low == pytest.approx(volts * 0.0025 * 50.0)


def test_sizes_are_random_and_within_their_range(sources):
    case = read_case(sources[0])
    ratios = [plants.kinds(case)["speed gain"](np.random.default_rng(k)).same[0].low for k in range(40)]
    sizes = np.abs(np.log(ratios))
    assert 0.08 <= sizes.min() < 0.1 and 0.28 < sizes.max() <= 0.34
    assert 8 < sum(r > 1 for r in ratios) < 32


def test_a_robot_without_comments_reads_as_the_same_robot(sources, tmp_path):
    from rtds_host.compat import tomllib

    text = (sources[0] / "robot.toml").read_text()
    (tmp_path / "robot.toml").write_text(measured.dump_toml(tomllib.loads(text)))
    assert load_robot(tmp_path / "robot.toml") == load_robot(sources[0] / "robot.toml")


def test_the_same_seed_plants_the_same(check, sources, tmp_path):
    measured.make_measured(tmp_path / "again", sources, 9, seed=4)
    for case, truth in truths(tmp_path / "again").items():
        assert {k: v for k, v in truth.items() if k not in ("case", "held_out")} == {
            k: v for k, v in truths(check)[case].items() if k not in ("case", "held_out")
        }


def test_bad_requests_end_in_one_line(check, sources, tmp_path):
    with pytest.raises(InputError, match="not made again"):
        measured.make_measured(check, sources, 1)
    with pytest.raises(InputError, match="second data set of the name 'arm'"):
        measured.make_measured(tmp_path / "x", [sources[0], sources[0]], 1)
    with pytest.raises(InputError, match="0 draws"):
        measured.make_measured(tmp_path / "x", sources, 0)


# What an answer is worth.

MASS = {
    "set": "arm",
    "kind": "mass",
    "side": "left",
    "said": "mass",
    "axis": True,
    "same": [{"id": "payload_error", "subsystem": "chassis", "parameter": "mass_kg", "low": 0.1, "high": 0.1}],
    "alike": [{"id": "driver_gain", "subsystem": "driver", "parameter": "ratio", "low": 0.8, "high": 0.8}],
}
GAIN = {
    **MASS,
    "kind": "command gain",
    "alike": [],
    "same": [{"id": "driver_gain", "subsystem": "driver", "parameter": "ratio", "low": 0.8, "high": 0.8}],
}
ENTRY = {"seconds": 1.0, "said": ""}


def effect(name, side="left", **parameters):
    return {
        "id": name,
        "side": side,
        "parameters": {
            k: {"value": v[0], "ci90": v[1]} if isinstance(v, tuple) else {"value": v, "ci90": None}
            for k, v in parameters.items()
        },
    }


def says(*effects, verdict="known", sets=()):
    return {
        "verdict": verdict,
        "effects": list(effects),
        "indistinguishable": [[{"id": i, "side": s} for i, s in group] for group in sets],
    }


COULOMB = effect("coulomb_friction", torque_nm=0.03)
BASE = says(COULOMB)


def test_the_planted_cause_next_to_the_machines_own_is_right_on_whichever_side_an_axis_has():
    for side in ("left", "both"):
        r = judge_planted(MASS, says(COULOMB, effect("payload_error", side, mass_kg=(0.12, [0.09, 0.15]))), BASE, ENTRY)
        assert r["named"] and r["found"] and r["covered"] and r["base_kept"] and not r["new_false"]
        assert r["size_error"] == pytest.approx(0.2)


@pytest.mark.parametrize("mass", [-0.1, 0.04, 0.25])
def test_a_wrong_direction_or_a_size_off_by_more_than_a_factor_of_two_is_not_right(mass):
    r = judge_planted(MASS, says(COULOMB, effect("payload_error", mass_kg=mass)), BASE, ENTRY)
    assert not r["found"] and not r["new_false"]


WHEEL = {
    **GAIN,
    "set": "rover",
    "side": "left",
    "axis": False,
    "same": [
        {"id": name, "subsystem": "driver", "parameter": "ratio", "low": 1.3, "high": 1.3}
        for name in ("speed_gain", "driver_gain")
    ],
}


@pytest.mark.parametrize("own", [effect("speed_gain", "both", ratio=0.78), effect("speed_gain", "left", ratio=0.78)])
def test_a_change_that_undoes_what_the_machine_has_is_found_where_nothing_of_its_kind_is_named(own):
    """With 1.3 times 0.78 there is no gain left to name: what is not named has a ratio of 1."""
    right = effect("speed_gain", "right", ratio=0.78)
    for answer in (says(COULOMB, right), says(COULOMB)):
        r = judge_planted(WHEEL, answer, says(COULOMB, own), ENTRY)
        assert r["found"] and not r["named"] and r["match"]["undone"]
    # Something of the kind is named there, the machine has none of it, or one that the change does not undo.
    for answer, base in (
        (says(effect("driver_gain", ratio=0.6)), says(own)),
        (says(effect("speed_gain", "both", ratio=0.78)), says(own)),
        (says(COULOMB), says(COULOMB)),
        (says(COULOMB), says(effect("speed_gain", "both", ratio=1.3))),
        (says(COULOMB), says(effect("speed_gain", "both", ratio=0.95))),
        (says(COULOMB), says(effect("speed_gain", "both", ratio=0.4))),
    ):
        assert not judge_planted(WHEEL, answer, base, ENTRY)["found"]


def test_a_gain_of_one_side_counts_from_what_both_sides_had():
    base = says(effect("speed_gain", "both", ratio=0.7))
    r = judge_planted(WHEEL, says(effect("speed_gain", ratio=(0.92, [0.88, 0.96]))), base, ENTRY)
    assert r["named"] and r["covered"] and r["match"]["expected"] == pytest.approx([0.91, 0.91])


def test_a_substitute_is_near_and_anything_else_blamed_again_is_a_false_cause():
    r = judge_planted(MASS, says(COULOMB, effect("driver_gain", ratio=0.85)), BASE, ENTRY)
    assert r["near"] and not r["found"] and not r["new_false"]
    r = judge_planted(MASS, says(COULOMB, effect("backlash", angle_rad=0.1)), BASE, ENTRY)
    assert not r["near"] and r["new_false"] and r["false"] == ["backlash"]


def test_a_declared_set_of_three_counts_and_one_of_four_does_not():
    group = [("coulomb_friction", "left"), ("payload_error", "both"), ("backlash", "left")]
    r = judge_planted(MASS, says(COULOMB, sets=[group]), BASE, ENTRY)
    assert r["found"] and not r["named"] and r["covered"] is None
    r = judge_planted(MASS, says(COULOMB, sets=[[*group, ("speed_gain", "left")]]), BASE, ENTRY)
    assert not r["found"]


def test_an_effect_that_the_untouched_case_has_must_move_by_what_was_planted():
    base = says(effect("driver_gain", ratio=0.9))
    r = judge_planted(GAIN, says(effect("driver_gain", ratio=(0.72, [0.7, 0.75]))), base, ENTRY)
    assert r["named"] and r["covered"] and r["match"]["expected"] == pytest.approx([0.72, 0.72])
    r = judge_planted(GAIN, says(effect("driver_gain", ratio=0.9)), base, ENTRY)
    assert not r["found"] and r["silent"]


def test_an_answer_of_unknown_or_none_at_all_finds_nothing():
    r = judge_planted(MASS, says(verdict="unknown"), BASE, ENTRY)
    assert r["unknown"] and not r["found"] and not r["silent"] and not r["base_kept"]
    r = judge_planted(MASS, None, BASE, {"seconds": 1.0, "said": "no good"})
    assert not r["answered"] and not r["near"] and r["complaint"] == "no good"


def test_answers_are_sealed_and_scored_like_all_others(check, tmp_path):
    """A diagnoser that always says the same finds nothing, keeps the base, and closes nothing of what was opened."""
    out = tmp_path / "out"
    shutil.copytree(check, out)
    script = tmp_path / "same.py"
    script.write_text(SAME)
    with pytest.raises(InputError, match="stays closed"):
        score_measured(out)
    seal.answer(out, command=[sys.executable, str(script)])
    bases = [case for case, truth in truths(out).items() if truth["kind"] == "base"]
    # The prediction of a test: the untouched machine stands still, the others run away.
    still = tmp_path / "still.py"
    still.write_text(
        "import sys\nfrom pathlib import Path\nimport numpy as np\nfrom rtds_host.contract import *\n"
        "robot = load_robot(sys.argv[3])\nrun = read_run(sys.argv[1], robot)\n"
        f"speed = 0.0 if set(Path(sys.argv[1]).parts) & {set(bases)!r} else 1e3\n"
        "write_csv(Path(sys.argv[7]), {'t': run.t, **{c: speed + 0 * run.t for c in ('i_l', 'w_l', 'th_l')}})\n"
    )
    # The refit of a test: other sizes leave 1 of the untouched cases, and of the planted ones what is asked for.
    refit = tmp_path / "refit.py"
    refit.write_text(
        "import json, sys\nfrom pathlib import Path\nleft, *bases, case, _, option = sys.argv[1:]\n"
        "assert option == '--all'\n"
        "print(json.dumps({'gap': 1.0 if Path(case).name in bases else float(left)}))\n"
    )

    def scored(left):
        fitter = [sys.executable, str(refit), str(left), *bases]
        return score_measured(out, command=[sys.executable, str(still)], fitter=fitter)

    result = scored(9.0)
    assert result["all"]["cases"] == 18 and not any(r["named"] or r["new_false"] for r in result["cases"])
    assert result["bases"]["arm"]["included"] == ["coulomb_friction"]
    assert all(r["gap_opened"] == r["gap_left"] and r["base_kept"] for r in result["cases"])
    assert all(r["visible"] == (r["gap_opened"] >= VISIBLE * r["gap_base"]) for r in result["cases"])
    assert all(r["restored"] == 0.0 for r in result["cases"] if r["visible"])
    seen = sum(r["visible"] for r in result["cases"])
    assert result["all"]["visible"] == result["all"]["judged"] == seen > 0
    # What other sizes of the machine's own effects take in is not judged, and said so.
    taken = scored(1.2)
    assert taken["all"]["visible"] == seen and taken["all"]["judged"] == 0
    assert all(r["taken_in"] for r in taken["cases"] if r["visible"])
    assert "| taken in | " in (out / "score" / "page.md").read_text()
    assert "| slide | " in (out / "score" / "page.md").read_text()
    truth = out / "sealed" / "case-001" / "truth.json"
    data = json.loads(truth.read_text())
    data["truth"]["said"] = "something else"
    truth.write_text(json.dumps(data))
    with pytest.raises(InputError, match="differs"):
        score_measured(out)


def test_the_command_line_makes_draws_and_scores_them(sources, tmp_path):
    def rtds(*arguments):
        return subprocess.run(
            [sys.executable, "-m", "rtds_host.cli.main", "blind", *map(str, arguments)],
            capture_output=True,
            text=True,
            check=False,
        )

    out = tmp_path / "out"
    done = rtds("make", "--measured", sources[1], "--n", 1, "--seed", 6, "--out", out)
    assert done.returncode == 0 and done.stdout.startswith("2 cases"), done.stderr
    done = rtds("make", "--measured", sources[1], "--tier", "none", "--out", tmp_path / "x")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    script = tmp_path / "same.py"
    script.write_text(SAME)
    seal.answer(out, command=[sys.executable, str(script)])
    done = rtds("score", "--out", out, "--page", tmp_path / "page.md")
    assert done.returncode == 0 and "planted cause" in (tmp_path / "page.md").read_text(), done.stderr
    assert math.isfinite(json.loads((out / "score" / "score.json").read_text())["bases"]["slide"]["gap"])


def test_a_delay_that_takes_the_place_of_the_bases_filter_holds_both_sizes():
    late = {
        **MASS,
        "kind": "all delayed",
        "alike": [],
        "same": [{"id": "measurement_delay", "subsystem": "timing", "parameter": "seconds", "low": 0.01, "high": 0.01}],
    }
    base = says(effect("speed_filter", time_constant_s=0.02))
    r = judge_planted(late, says(effect("measurement_delay", seconds=(0.031, [0.029, 0.033]))), base, ENTRY)
    assert r["named"] and r["covered"] and r["match"]["expected"] == pytest.approx([0.03, 0.03])
    both = says(effect("speed_filter", time_constant_s=0.02), effect("measurement_delay", seconds=0.011))
    assert judge_planted(late, both, base, ENTRY)["match"]["expected"] == pytest.approx([0.01, 0.01])


def test_a_gain_that_takes_the_place_of_the_bases_equivalent_holds_both_sizes():
    reading = {"id": "speed_gain", "subsystem": "sensing", "parameter": "ratio", "low": 0.8, "high": 0.8}
    winding = {"id": "resistance_error", "subsystem": "motor", "parameter": "ratio", "low": 1.25, "high": 1.25}
    gain = {**GAIN, "alike": [reading, winding]}
    answer = says(effect("driver_gain", ratio=(0.6, [0.58, 0.63])))
    for base in (says(effect("speed_gain", "both", ratio=0.75)), says(effect("resistance_error", ratio=1 / 0.75))):
        r = judge_planted(gain, answer, base, ENTRY)
        assert r["named"] and r["covered"] and r["match"]["expected"] == pytest.approx([0.6, 0.6])
    # What the answer names as well holds its own size.
    kept = says(effect("driver_gain", ratio=0.6), effect("speed_gain", ratio=0.75))
    assert not judge_planted(gain, kept, says(effect("speed_gain", ratio=0.75)), ENTRY)["named"]


def test_a_wider_form_of_what_the_base_names_is_neither_new_nor_lost():
    wider = effect("stribeck_friction", torque_nm=0.03, extra_torque_nm=0.01, speed_rad_s=1.0)
    r = judge_planted(MASS, says(wider, effect("payload_error", mass_kg=0.1)), BASE, ENTRY)
    assert r["named"] and r["base_kept"] and not r["new_false"]


def test_the_bases_refit_goes_along_with_what_is_declared(sources, tmp_path):
    """Else a resistance declared wrongly would be put right by the base's answer, and open no gap."""
    text = (sources[0] / "robot.toml").read_text()
    (tmp_path / "robot.toml").write_text(text.replace("resistance_ohm = 4.0", "resistance_ohm = 5.0"))
    base, planted = load_robot(sources[0] / "robot.toml"), load_robot(tmp_path / "robot.toml")
    said = {"effects": [], "nominal_fit": {"l": {"resistance_ohm": 4.04, "rotor_inertia_kg_m2": 3.9e-7}}}
    fitted = carried_over(said, base, planted)["nominal_fit"]["l"]
    assert fitted == pytest.approx({"resistance_ohm": 5.05, "rotor_inertia_kg_m2": 3.9e-7})
