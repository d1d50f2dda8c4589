"""Cases with several causes: every cause is worth what the truth says, the unmodelled one has no name in the
catalogue.
"""

import json
import math

import numpy as np
import pytest

from rtds_host.blind import accounts, planar, scales, score, seal
from rtds_host.blind.gap import channel_gaps, total
from rtds_host.blind.vocabulary import EFFECTS, UNMODELLED, UNNAMED
from rtds_host.contract import builtin_robot, read_case
from rtds_host.errors import InputError

ROBOT = builtin_robot("burger")
NOISE = planar.noises(ROBOT)
OF = scales.scale_of(ROBOT, 0.01, 15.0)


def drive(seconds=5.0):
    """At rest, ahead, in a bend, turning about itself, back in a bend."""
    t = np.round(np.arange(0.0, seconds, 0.01), 4)
    volts = np.array([(8.0, 8.0), (8.0, 3.0), (-6.0, 6.0), (-8.0, -4.0)])[np.minimum(t * 4 / seconds, 3).astype(int)]
    volts[t < 0.1 * seconds] = 0.0
    return accounts.Drive(t, volts, np.zeros(5), {"payload_kg": 0.0, "slope_rad": 0.0, "uphill": 0.0}, 5)


def build(effects, rest, tolerance):
    spec = {"tolerance": tolerance, "effects": effects, "outside": None, "rest": rest}
    return planar.build_machine(ROBOT, spec, np.random.default_rng(2))


def effect(name, side="both", **parameters):
    return {"id": name, "side": side, "subsystem": EFFECTS[name][0], "parameters": parameters}


def test_an_effect_is_worth_the_gap_that_it_alone_leaves():
    """Two effects on channels apart: without the one, nothing but its own channel is wrong."""
    bias, gain = effect("gyro_bias", rad_s=0.03), effect("current_gain", "left", ratio=1.3)
    gaps = accounts.worth(NOISE, build, [bias, gain], None, [drive()], set())
    channels = 8
    assert gaps["without"][0] == pytest.approx(math.sqrt(1 + (0.03 / ROBOT.noise("gyro_z")) ** 2 / channels), rel=1e-6)
    assert gaps["known"] == 1.0 and min(gaps["before"], gaps["refit"]) > max(gaps["without"])


def test_the_gap_in_expectation_is_that_of_a_noisy_log():
    run, machine = drive(10.0), build([effect("driver_gain", ratio=1.05)], None, False)
    raw, plain = run.replay(machine, planar.STEP_S), run.replay(build([], None, False), planar.STEP_S)
    expected = accounts.gap_between(NOISE, [run], [raw], [plain], set())
    rng = np.random.default_rng(1)
    noisy = {name: values + ROBOT.noise(name) * rng.standard_normal(run.t.size) for name, values in raw.items()}
    noise = {name: ROBOT.noise(name) for name in planar.CHANNELS}
    assert total(channel_gaps(run.t, noisy, plain, noise)) == pytest.approx(expected, rel=0.02)


def test_tolerances_are_not_a_cause():
    gaps = accounts.worth(
        NOISE,
        lambda e, r, t: planar.build_machine(
            ROBOT,
            {"tolerance": t, "normal_tolerance": True, "effects": e, "outside": None, "rest": r},
            np.random.default_rng(4),
        ),
        [],
        None,
        [drive()],
        set(),
    )
    assert gaps["refit"] == 1.0 and gaps["before"] > 1.02


# Those outside of the catalogue that were there before are shown for the second world in test_world.py.
WITH_STRENGTH = [("planar", name) for name in sorted(scales.STRENGTH)] + [
    ("mujoco", name) for name in sorted(UNMODELLED)
]


@pytest.mark.parametrize(("world", "name"), WITH_STRENGTH)
def test_every_unmodelled_effect_acts_more_the_stronger_it_is(world, name):
    rng = np.random.default_rng(3)
    subsystem, _ = UNNAMED[name]
    unmodelled = {
        "id": name,
        "side": "left",
        "subsystem": subsystem,
        "parameters": scales.unmodelled_parameters(rng, name, OF),
    }
    run = drive()

    def raw(machine):
        return planar.run_machine(machine, run.t, run.v_cmd.copy(), run.start, **run.where, seed=run.seed, world=world)

    plain, sizes = raw(build([], None, False)), []
    for factor in (1.0, 3.0):
        machine = build([], scales.strengthened(unmodelled, factor), False)
        sizes.append(accounts.gap_between(NOISE, [run], [raw(machine)], [plain], set()))
    assert 1.005 < sizes[0] < sizes[1] < 1e3, sizes


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_sizes_follow_the_machines_own_scales(name):
    """A machine with twice the torque and mass gets twice the friction, at the same voltage and current."""
    large = scales.Scale(
        **{
            **OF.__dict__,
            "torque": 2 * OF.torque,
            "viscous": 2 * OF.viscous,
            "mass": 2 * OF.mass,
            "force": 2 * OF.force,
        }
    )
    one = scales.draw_sized(np.random.default_rng(8), name, OF)
    two = scales.draw_sized(np.random.default_rng(8), name, large)
    assert one["subsystem"] == EFFECTS[name][0] and one["side"] == two["side"]
    expected = {
        "torque_nm": 2,
        "extra_torque_nm": 2,
        "nm_s_per_rad": 2,
        "stiffness_nm_per_rad": 2,
        "amplitude_nm": 2,
        "damping_nm_s_per_rad": 2,
        "mass_kg": 2,
        "slip_per_newton": 0.5,
    }
    for key, value in one["parameters"].items():
        assert two["parameters"][key] == pytest.approx(expected.get(key, 1) * value, rel=1e-4), key


def test_several_causes_are_mostly_of_different_subsystems():
    rng = np.random.default_rng(1)
    apart = 0
    for _ in range(200):
        names = accounts.draw_names(rng, 4)
        assert len(set(names)) == 4
        apart += len({EFFECTS[name][0] for name in names}) == 4
    assert 0.7 < apart / 200 < 0.95


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    """One case of each kind with its truth, as a check holds them."""
    out = tmp_path_factory.mktemp("accounts") / "check"
    seal.make(out, 2, ["many", "messy"], ["planar"], seed=2, jobs=1)
    return out, {truth["tier"]: (case, truth) for case, truth in seal.check_truths(out).items()}


def test_each_cause_of_many_matters_and_the_truth_says_how_much(cases):
    out, truths = cases
    case, truth = truths["many"]
    assert truth["verdict"] == "known" and 3 <= len(truth["effects"]) <= 5 and "rest" not in truth
    assert set(truth["nominal_fit"]) == {"l", "r"}
    assert all(e["gap_without"] > 1.2 for e in truth["effects"])
    assert truth["gap"]["known"] == truth["held_out_gap"]["known"] == 1.0 < truth["gap"]["before"]
    assert len(read_case(out / "public" / case).runs) >= 3


def test_the_rest_of_a_messy_case_has_no_name_and_is_the_smaller_part(cases):
    _, truths = cases
    _, truth = truths["messy"]
    assert 1 <= len(truth["effects"]) <= 2
    rest = truth["rest"]
    assert rest["id"] not in EFFECTS and rest["subsystem"] in {place for place, _ in EFFECTS.values()}
    assert rest["gap_without"] == pytest.approx(truth["gap"]["known"], abs=1e-3)
    share = (truth["gap"]["known"] - 1) / (truth["gap"]["before"] - 1)
    assert rest["share"] == pytest.approx(share, abs=1e-3) and 0 < share < 0.8


def test_a_folder_of_diagnoses_is_scored_without_a_ledger(cases, tmp_path):
    out, truths = cases
    said = tmp_path / "diagnoses"
    with pytest.raises(InputError, match="holds no diagnosis"):
        score.score(out, with_closure=False, diagnoses=said)
    case, truth = truths["many"]
    (said / case).mkdir(parents=True)
    effects = [{**e, "probability": 0.9, "parameters": {}} for e in truth["effects"]]
    (said / case / "diagnosis.json").write_text(
        json.dumps({"schema": "rtds-diagnosis/2", "verdict": "known", "effects": effects})
    )
    result = score.score(out, with_closure=False, diagnoses=said)
    assert result["tiers"]["many"]["cause_right"]["share"] == 1 and result["everything"]["answered"] == 1
    assert not result["blind"] and (said / "score" / "page.md").is_file() and not (out / "score").exists()
