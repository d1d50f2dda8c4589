"""The choice: what is included on replays whose cause is known, and what is not.

The truths here are made by the replay itself, so they test the choice and not the physics; the independent worlds of
`rtds_host.blind` test both.
"""

import dataclasses
import math

import numpy as np
import pytest
from diagnosis_cases import make_case, make_run, without

from rtds_host.contract import Case, RunLog, RunMeta, builtin_robot
from rtds_host.contract.robot import Servo
from rtds_host.diagnosis import ripple
from rtds_host.diagnosis.diagnose import diagnose
from rtds_host.diagnosis.forms.candidates import candidates
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.report import validate
from rtds_host.diagnosis.screen import available
from rtds_host.plant.schema import OUTPUTS


def included(diagnosis):
    return [(e["id"], e["side"]) for e in diagnosis["effects"]]


def run(case, **options):
    diagnosis, details = diagnose(case, quick=True, threads=2, **options)
    validate(diagnosis)
    return diagnosis, details


def test_no_effect_is_none_even_with_motors_that_scatter():
    def scatter(model):
        model.scale("resistance", 1.012, (0,))
        model.scale("torque_constant", 0.991, (1,))
        model.scale("back_emf", 0.991, (1,))
        model.scale("rotor_inertia", 0.985)

    diagnosis, _ = run(make_case(scatter, seed=21))
    assert diagnosis["verdict"] == "none" and diagnosis["effects"] == [] and diagnosis["located"] == []
    assert diagnosis["nominal_fit"]["l"]["resistance_ohm"] == pytest.approx(8.6 * 1.012, rel=0.005)
    assert diagnosis["gap"]["refit"] < 1.05


def test_clocks_of_gyro_and_pose_that_are_some_milliseconds_off_are_no_cause():
    """At a fifth of a metre a second a millimetre of noise is five milliseconds of a sample's, half of one of a
    run's.
    """

    def skewed(model):
        model.put("gyro_delay", 0.004)
        model.put("pose_delay", -0.003)

    diagnosis, _ = run(make_case(skewed, seed=21))
    assert diagnosis["verdict"] == "none" and diagnosis["gap"]["before"] > 1.2 and diagnosis["gap"]["refit"] < 1.05
    assert diagnosis["setup"] == {
        "gyro_delay_s": pytest.approx(0.004, abs=2e-4),
        "pose_delay_s": pytest.approx(-0.003, abs=1e-3),
    }


@pytest.mark.parametrize(
    "quantity,amount,sides,effect,side,parameter",
    [
        ("coulomb", 0.03, (0, 1), "coulomb_friction", "both", "torque_nm"),
        ("command_delay", 0.006, (0, 1), "command_delay", "both", "seconds"),
        ("current_bias", 0.012, (1,), "current_bias", "right", "amperes"),
    ],
)
def test_one_effect_is_named_with_its_side_and_size(quantity, amount, sides, effect, side, parameter):
    diagnosis, details = run(make_case(lambda m: m.add(quantity, amount, sides), seed=22))
    assert diagnosis["verdict"] == "known" and included(diagnosis) == [(effect, side)]
    ((who, (channel, lacking, explained)),) = details.decided.items()
    assert who == (effect, side) and lacking > 2.0 and explained == pytest.approx(1.0, abs=0.1)
    assert channel == "i_r" or quantity != "current_bias"
    assert lacking == pytest.approx(diagnosis["gap"]["channels"][channel]["refit"], rel=0.02)
    entry = diagnosis["effects"][0]["parameters"][parameter]
    assert entry["value"] == pytest.approx(amount, rel=0.1)
    assert entry["ci90"][0] <= amount * 1.05 and entry["ci90"][1] >= amount * 0.95
    assert diagnosis["gap"]["after"] < 1.05 and sum(a["probability"] for a in diagnosis["alternatives"]) > 0.98


def test_the_gap_is_split_by_regime_before_and_after():
    # A wrong track width shows while the robot turns.
    _, details = run(make_case(lambda m: m.scale("track", 1.05), seed=25))
    gap = details.regimes
    assert {"slow", "fast", "reversal", "straight", "first half", "second half"} <= set(gap)
    assert gap["turning left"]["before"] > 2.0 * gap["straight"]["before"]
    assert max(row["after"] for row in gap.values()) < 1.3


def test_two_effects_are_both_named():
    def change(model):
        model.add("coulomb", 0.03)
        model.scale("radius", 1.04)

    diagnosis, _ = run(make_case(change, seed=23))
    assert set(included(diagnosis)) == {("coulomb_friction", "both"), ("wheel_radius_error", "both")}
    assert {row["subsystem"] for row in diagnosis["located"]} == {"drivetrain", "wheel_ground"}
    assert sum(row["share"] for row in diagnosis["located"]) == pytest.approx(1.0, abs=1e-3)


def test_how_a_servos_integral_gives_way_at_its_limit_is_no_cause():
    """The replay clamps the integral (`[servo]` says nothing of it); this servo draws it back by 0.7 of what the limit
    cuts.
    """
    burger = builtin_robot("burger")
    servo = Servo(kp_v_s_per_rad=0.44, ki_v_per_rad=8.6, limit_v=6.0, period_s=0.002)
    robot = dataclasses.replace(burger, driver=dataclasses.replace(burger.driver, mode="speed"), servo=servo)
    model = nominal_model(robot)
    model.put("servo_release", 0.7)
    runs = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        t = np.arange(0.0, 8.0, 0.01)
        # Levels beyond what six volts can hold, and below.
        asked = rng.uniform(-5.0, 5.0, (11, 2))[(t / 0.8).astype(int)] * (t > 0.3)[:, None]
        columns = {"w_cmd_l": asked[:, 0], "w_cmd_r": asked[:, 1]}
        log = RunLog(f"steps-{seed}", RunMeta(), t, columns)
        out = replay_run(model, run_inputs(log, robot))
        seen = {c: out[:, k] + robot.noise(c) * rng.standard_normal(len(t)) for k, c in enumerate(OUTPUTS)}
        runs.append(RunLog(log.name, log.meta, t, {**columns, **seen}))
    diagnosis, _ = run(Case("wound up", robot, tuple(runs)))
    assert diagnosis["verdict"] == "none" and diagnosis["gap"]["before"] > 1.5
    # Any share above a tenth is through within rows of ten milliseconds.
    assert 0.1 < diagnosis["setup"]["anti_windup"] <= 1.0


def test_a_speed_that_alone_is_late_is_the_speeds_lag_and_no_delay_of_all():
    """Drivers that count over a span of time, or send the speed later than the angle: the angle shows which."""
    diagnosis, _ = run(make_case(lambda m: m.put("speed_delay", 0.02), seed=61))
    assert diagnosis["verdict"] == "known" and included(diagnosis) == [("speed_filter", "both")]
    parameters = diagnosis["effects"][0]["parameters"]
    assert (
        parameters["time_constant_s"]["value"] == pytest.approx(0.02, rel=0.03)
        and parameters["delay_s"]["value"] > 0.018
    )


def test_a_filter_of_the_speeds_and_a_delay_of_all_are_two():
    def change(model):
        model.put("speed_tau", 0.03)
        model.put("measurement_delay", 0.02)

    diagnosis, _ = run(make_case(change, seed=63))
    assert sorted(included(diagnosis)) == [("measurement_delay", "both"), ("speed_filter", "both")]


def test_two_small_effects_that_tolerances_nearly_make_are_included_where_they_do_not():
    """Tolerances leave less than a gap in the place of either, but more than noise; in that of both they leave
    a gap.
    """

    def change(model):
        model.scale("resistance", 0.9, (1,))
        for quantity, value in (("ripple", 0.007), ("ripple_cycles", 4.0), ("ripple_phase", -1.9)):
            model.put(quantity, value, (1,))

    diagnosis, _ = run(make_case(change, seed=62, seconds=20.0))
    assert 1.1 <= diagnosis["gap"]["refit"] < 1.2
    assert sorted(included(diagnosis)) == [("resistance_error", "right"), ("torque_ripple", "right")]


def test_an_effect_that_the_catalogue_lacks_is_unknown():
    case = make_case(lambda m: m.put("speed_tau", 0.05), seed=24)
    diagnosis, _ = run(case, without=frozenset({"speed_filter", "measurement_delay", "gear_compliance"}))
    assert diagnosis["verdict"] == "unknown" and diagnosis["effects"] == []
    assert diagnosis["alternatives"][0]["effects"] == "unknown" and diagnosis["located"]


def test_what_a_substitute_leaves_is_said_to_have_structure():
    # Larger wheels turn as a wider track does, and drive further than the pose says: nine tenths of the gap go, not
    # all.
    diagnosis, _ = run(make_case(lambda m: m.scale("track", 1.08), seed=53), without=frozenset(["track_width_error"]))
    rest = diagnosis["gap"]["rest"]
    assert rest["structured"] and diagnosis["gap"]["after"] > 1.1
    assert diagnosis["gap"]["channels"]["x"]["after"] > 2.0 * diagnosis["gap"]["channels"]["x"]["refit"]


def test_several_effects_are_included_next_to_a_residual_without_a_name():
    # A filter that the catalogue is not asked about stays as the rest; friction and a gain are named all the same.
    def change(model):
        model.put("speed_tau", 0.05)
        model.add("coulomb", 0.06)
        model.scale("gyro_gain", 0.93)

    diagnosis, _ = run(
        make_case(change, seed=56), without=frozenset({"speed_filter", "measurement_delay", "gear_compliance"})
    )
    assert {("coulomb_friction", "both"), ("gyro_gain", "both")} <= set(included(diagnosis))
    assert diagnosis["verdict"] == "partial" and diagnosis["gap"]["rest"]["structured"]
    assert diagnosis["next_experiment"] is not None
    shares = {row.get("id", row["what"]): row["share"] for row in diagnosis["budget"]}
    assert sum(row["share"] for row in diagnosis["budget"]) == pytest.approx(1.0, abs=1e-3) and shares["rest"] > 0.05
    for effect in diagnosis["effects"]:
        assert effect["gap_without"] > diagnosis["gap"]["after"]


def test_headings_that_a_wrong_robot_suggests_do_not_hold_its_explanation():
    # Without a pose the slope's pull says where a run began; a robot whose right side is weak would have begun askew.
    robot = builtin_robot("burger")
    model = nominal_model(robot)
    model.scale("voltage_gain", 0.95, (1,))
    kinds = (("steps", 0.1), ("weave", 0.1), ("spin", 0.0), ("weave", 0.0))
    runs = tuple(
        make_run(f"{kind}-{n}", model, robot, kind, seed=51 + n, slope=slope) for n, (kind, slope) in enumerate(kinds)
    )
    diagnosis, details = run(without(Case("askew", robot, runs), "x", "y", "yaw", "gyro_z"))
    assert included(diagnosis) == [("driver_gain", "right")]
    assert not any("heading" in note for note in details.notes)


def test_what_the_channels_cannot_separate_is_declared_with_a_run_that_would():
    """From rest and without a pose the two delays are one (contract, section 3)."""
    case = without(make_case(lambda m: m.put("command_delay", 0.012), seed=25), "x", "y", "yaw", "v_bus")
    case = Case(case.name, case.robot, tuple(r for r in case.runs if r.meta.slope_rad == 0.0))
    diagnosis, _ = run(case)
    assert len(diagnosis["indistinguishable"]) == 1
    causes = {m["id"] for m in diagnosis["indistinguishable"][0]}
    assert {"command_delay", "measurement_delay"} <= causes and len(causes) <= 3
    # They share the probability that one of them is there.
    assert diagnosis["effects"][0]["probability"] == pytest.approx(1.0 / len(causes), abs=0.02)


def test_one_run_works_with_halves_held_out_and_says_so():
    case = make_case(lambda m: m.add("coulomb", 0.05), seed=26, seconds=12.0)
    diagnosis, details = run(Case("one", case.robot, case.runs[1:2]))
    assert included(diagnosis) == [("coulomb_friction", "both")]
    assert any("one run only" in note for note in details.notes)


def test_the_same_seed_gives_the_same_diagnosis_to_the_byte():
    case = make_case(lambda m: m.add("coulomb", 0.02), seed=27, seconds=5.0)
    first, _ = run(case)
    again, _ = diagnose(case, quick=True, threads=1)
    assert first == again


def test_ripple_is_found_by_its_spectrum():
    def change(model):
        model.put("ripple", 0.03)
        model.put("ripple_cycles", 23.0)
        model.put("ripple_phase", 1.0)

    diagnosis, _ = run(make_case(change, seed=28, seconds=12.0))
    assert included(diagnosis) == [("torque_ripple", "both")]
    found = diagnosis["effects"][0]["parameters"]
    assert found["cycles_per_rev"]["value"] == pytest.approx(23.0, abs=0.1)
    assert np.isclose(found["amplitude_nm"]["value"], 0.03, rtol=0.1)


def test_a_ripple_may_have_a_second_harmonic():
    """Cogging and meshing teeth are no pure sine; a sine alone would get another phase and leave a rest."""

    def change(model):
        model.put("ripple", 0.03)
        model.put("ripple_cycles", 12.0)
        model.put("ripple_phase", 1.0)
        model.put("ripple_in_phase", -0.2)
        model.put("ripple_in_quadrature", 0.3)

    diagnosis, _ = run(make_case(change, seed=28, seconds=12.0))
    assert included(diagnosis) == [("torque_ripple", "both")]
    found = diagnosis["effects"][0]["parameters"]
    assert found["second_in_phase"]["value"] == pytest.approx(-0.2, abs=0.1)
    assert found["second_in_quadrature"]["value"] == pytest.approx(0.3, abs=0.1)
    assert found["amplitude_nm"]["value"] == pytest.approx(0.03, rel=0.1)


def test_a_neighbouring_ripple_keeps_step_in_the_middle_of_the_runs():
    """Otherwise a change of the number of cycles alone would leave the runs out of step, however right it is."""
    values = {"amplitude_nm": 0.06, "cycles_per_rev": 9.98, "phase_rad": -1.26}
    steps = [
        (n["cycles_per_rev"] * 11.6 + n["phase_rad"] - 9.98 * 11.6 + 1.26) for n in ripple.neighbours(values, 11.6)
    ]
    assert sorted({round(math.remainder(s, 2 * math.pi), 6) for s in steps}) == [-0.5, 0.0, 0.5]
    assert all(n["amplitude_nm"] == 0.06 and abs(n["phase_rad"]) <= math.pi for n in ripple.neighbours(values, 11.6))


def test_ripple_is_found_in_angles_and_gyro_where_no_speed_and_no_current_is_measured():
    def change(model):
        model.put("ripple", 0.03, (1,))
        model.put("ripple_cycles", 7.0, (1,))

    case = without(make_case(change, seed=29, seconds=12.0), "w_l", "w_r", "i_l", "i_r", "v_bus")
    diagnosis, _ = run(case)
    assert included(diagnosis) == [("torque_ripple", "right")]
    assert diagnosis["effects"][0]["parameters"]["cycles_per_rev"]["value"] == pytest.approx(7.0, abs=0.1)


@pytest.mark.parametrize(
    "runs, lacking, shown",
    [(slice(None), (), True), (slice(None), ("th_l", "th_r"), False), (slice(1), ("th_l", "th_r"), True)],
    ids=["logged angles", "no angles", "no angles, one run"],
)
def test_what_varies_with_the_angle_is_looked_for_where_all_runs_count_it_from_one_zero(runs, lacking, shown):
    """Without a logged angle each run of a machine begins at another one. A ripple with the same phase in all of them
    would be a curve over the way from the start, which any error of a model is."""
    case = make_case(seconds=2.0)
    problem = Problem(without(dataclasses.replace(case, runs=case.runs[runs]), *lacking), 1)
    assert ("torque_ripple" in {effect.id for effect in available(problem)}) == shown
    quantities = {form.over for form in candidates(problem, problem.nominal)}
    assert ("th" in quantities) == shown and "w" in quantities


def test_a_blemish_next_to_a_large_effect_is_not_blamed():
    # A gain that is off by 0.2 % shows in the residuals, and is no cause anyone would look for.
    def change(model):
        model.add("coulomb", 0.05)
        model.scale("speed_gain", 1.002)

    diagnosis, _ = run(make_case(change, seed=30))
    assert included(diagnosis) == [("coulomb_friction", "both")]


@pytest.mark.parametrize("quantity,gain", [("gyro_gain", 1.001), ("speed_gain", 1.002), ("current_gain", 1.004)])
def test_a_blemish_without_a_gap_is_none(quantity, gain):
    # Samples enough show a scale that is off by a few thousandths, as any two simulators of one robot are, however sure
    # it is.
    diagnosis, _ = run(make_case(lambda m: m.scale(quantity, gain), seed=32))
    assert diagnosis["verdict"] == "none" and diagnosis["effects"] == []
    assert diagnosis["gap"]["refit"] < 1.1 and diagnosis["alternatives"][0]["effects"] == []


def test_a_fair_effect_is_no_blemish_for_a_small_one_next_to_it_that_explains_more():
    def change(model):
        model.add("command_delay", 0.0029)
        model.scale("resistance", 1.15, (0,))

    diagnosis, _ = run(make_case(change, seed=34))
    assert set(included(diagnosis)) == {("command_delay", "both"), ("resistance_error", "left")}


def test_intervals_have_room_for_another_formulation_of_friction():
    diagnosis, _ = run(make_case(lambda m: m.add("coulomb", 0.1), seed=31))
    entry = diagnosis["effects"][0]["parameters"]["torque_nm"]
    assert entry["ci90"][1] - entry["ci90"][0] >= 2 * 1.6 * 0.02 * entry["value"]


def test_intervals_of_what_is_so_by_definition_are_as_narrow_as_the_data_allow():
    diagnosis, _ = run(make_case(lambda m: m.scale("speed_gain", 1.06), seed=31))
    entry = diagnosis["effects"][0]["parameters"]["ratio"]
    low, high = entry["ci90"]
    assert low < 1.06 < high
    assert high - low < 0.03 * 0.06


def test_the_interval_of_a_speeds_lag_has_room_for_half_a_row_that_counting_takes():
    def change(model):
        model.put("speed_tau", 0.03)
        model.put("speed_delay", 0.005)

    # Rows of 10 ms: the counts of one are on average half of it old.
    diagnosis, _ = run(make_case(change, seed=31))
    assert included(diagnosis) == [("speed_filter", "both")]
    entry = diagnosis["effects"][0]["parameters"]["time_constant_s"]
    low, high = entry["ci90"]
    assert entry["value"] == pytest.approx(0.035, abs=0.001)
    assert low < 0.0305 and high - low < 0.012


def swinging_gear(quantity, value, stiffness):
    """A change of the truth: a spring in the right gear, and another effect."""

    def change(model):
        model.put("stiffness", stiffness, (1,))
        model.put("damping", 0.004, (1,))
        model.add(quantity, value)

    return change


def test_a_swinging_gear_is_found_under_a_delay_that_hides_it():
    diagnosis, _ = run(make_case(swinging_gear("command_delay", 0.012, stiffness=3.0), seed=41))
    assert {(e["id"], e["side"]) for e in diagnosis["effects"]} == {
        ("gear_compliance", "right"),
        ("command_delay", "both"),
    }


def test_a_small_effect_next_to_a_large_one_is_named_where_it_takes_all_of_a_residual_that_is_a_gap():
    diagnosis, _ = run(make_case(swinging_gear("coulomb", 0.008, stiffness=1.0), seed=42))
    assert {e["id"] for e in diagnosis["effects"]} == {"gear_compliance", "coulomb_friction"}
