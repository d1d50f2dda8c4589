"""What an explanation predicts of runs that it was not fitted to: as a fit without them does, and no better by what
they lack.
"""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import make_run

from rtds_host.contract import Axis, Case, RunLog, RunMeta, builtin_robot
from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis import left_out
from rtds_host.diagnosis.attribution import attribute
from rtds_host.diagnosis.evidence import enough_to_include
from rtds_host.diagnosis.fit import Fit, joined, scaled, side_by_side
from rtds_host.diagnosis.left_out import left_out_gap, left_out_in_few_steps, over_pieces, parted, predicted
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.search.driver import Search
from rtds_host.diagnosis.search.store import ABSENT, AT_BOUND, TOLERATED
from rtds_host.plant.schema import OUTPUT_INDEX

COULOMB = ("coulomb_friction", "both")


def fitted(case: Case, parts: dict[tuple[str, str], dict[str, float]]) -> tuple[Search, Fit]:
    """An explanation of a case, fitted from the values given by effect."""
    search = Search(Problem(case, 1))
    noise = search.problem.white()
    store = search.store
    store.fits[()] = store.fitter.fit((), np.empty(0), np.zeros(store.fitter.count), noise)
    hypothesis, start = joined({cause: scaled(store.effects, (cause,), [values]) for cause, values in parts.items()})
    return search, store.try_fit(hypothesis, start, store.fits[()])


def rows_of(problem: Problem) -> list[np.ndarray]:
    """The rows of each part that is left out."""
    return [rows for mine in parted(problem) for *_, rows in mine]


def with_frictions(*frictions: float) -> Case:
    """A run with each of some dry frictions, N·m at the wheel."""
    robot, runs = builtin_robot("burger"), []
    for seed, friction in enumerate(frictions):
        model = nominal_model(robot)
        model.add("coulomb", friction)
        runs.append(make_run(f"steps-{seed}", model, robot, "steps", seed=seed))
    return Case("frictions", robot, tuple(runs))


def test_a_run_left_out_is_predicted_as_by_a_fit_without_it():
    """Dry friction that is another in each run: what the others know of it is not what the run itself asks for."""
    case = with_frictions(0.029, 0.03, 0.031)
    search, fit = fitted(case, {COULOMB: {"torque_nm": 0.02}})
    found = []
    for k, run in enumerate(case.runs):
        others = replace(case, runs=tuple(r for j, r in enumerate(case.runs) if j != k))
        other, own = fitted(others, {COULOMB: {"torque_nm": 0.02}})
        found.append(gaps.errors(run, case.robot, replay_run(own.model(other.problem), search.problem.whole[k].inputs)))
    alone = gaps.gap(gaps.pooled(found))
    assert left_out_gap(search.problem, fit) == pytest.approx(alone, rel=0.05)
    assert search.problem.gap(fit.model(search.problem)) < alone


def test_where_a_step_without_a_run_fails_the_explanation_is_fitted_to_the_others(monkeypatch):
    """The second of three runs has more friction. As long as the sizes stay those of the fit to all, it is predicted
    better than by what never saw it.
    """
    case = with_frictions(0.02, 0.03, 0.021)
    search, fit = fitted(case, {COULOMB: {"torque_nm": 0.03}})
    kept = fit.model(search.problem)
    monkeypatch.setattr(left_out, "left_out_in_few_steps", lambda *_: ([kept] * 3, [False, True, False]))
    first, found, last = left_out.left_out(search.problem, fit, rows_of(search.problem))
    other, own = fitted(replace(case, runs=case.runs[::2]), {COULOMB: {"torque_nm": 0.03}})
    run, inputs = case.runs[1], search.problem.whole[1].inputs
    flattered, converged, alone = (
        gaps.gap(gaps.pooled([gaps.errors(run, case.robot, replay_run(model, inputs))]))
        for model in (kept, found, own.model(other.problem))
    )
    assert first is last is kept and flattered < 0.8 * alone
    assert converged == pytest.approx(alone, rel=0.01)


def test_an_effect_that_the_other_runs_do_not_show_keeps_its_size(monkeypatch):
    """At rest nothing shows a friction: it neither supports nor refutes what the run that moves says."""
    moving = with_frictions(0.03)
    rest = replace(moving.runs[0], name="rest", columns={c: 0.0 * v for c, v in moving.runs[0].columns.items()})
    search, fit = fitted(replace(moving, runs=(*moving.runs, rest)), {COULOMB: {"torque_nm": 0.02}})
    kept = fit.model(search.problem)
    monkeypatch.setattr(left_out, "left_out_in_few_steps", lambda *_: ([kept] * 2, [True, False]))
    found, _ = left_out.left_out(search.problem, fit, rows_of(search.problem))
    assert fit.values[0]["torque_nm"] == pytest.approx(0.03, rel=0.02)
    assert found.get("coulomb") == pytest.approx(kept.get("coulomb"))


@pytest.mark.parametrize("alike", [True, False])
def test_a_second_step_without_a_run_is_taken_only_where_the_first_was_long(monkeypatch, alike):
    """Of five runs that are one and the same any four say what all do; without the one that has a tenth of the friction
    the others say something else.
    """
    case = with_frictions(0.03, 0.003)
    runs = [replace(case.runs[0], name=f"again-{k}") for k in range(5 if alike else 4)]
    search, fit = fitted(replace(case, runs=(*runs, *([] if alike else case.runs[1:]))), {COULOMB: {"torque_nm": 0.02}})
    counts, replayed = [], search.problem.residuals
    monkeypatch.setattr(search.problem, "residuals", lambda models: counts.append(len(models)) or replayed(models))
    left_out_in_few_steps(search.problem, fit, rows_of(search.problem))
    assert counts[0] == 5 and len(counts) == (1 if alike else 2)


@pytest.mark.parametrize("searched", [1.0, 0.5], ids=["whole", "in stretches"])
def test_of_a_single_run_each_half_is_left_out_in_turn(monkeypatch, searched):
    """Its friction grows by a half on the way: each half is predicted by what the other says, and that is worse than
    what both say.
    """
    robot = builtin_robot("burger")
    light, heavy = nominal_model(robot), nominal_model(robot)
    light.add("coulomb", 0.024)
    heavy.add("coulomb", 0.036)
    runs = [make_run("steps", model, robot, "steps", 24.0, 7) for model in (light, heavy)]
    late = runs[0].t >= 12.0
    run = replace(
        runs[0],
        columns={
            c: np.where(late, runs[1].columns[c], v) for c, v in runs[0].columns.items() if c not in ("x", "y", "yaw")
        },
    )
    if searched < 1.0:
        monkeypatch.setattr("rtds_host.diagnosis.problem.SEARCHED_S", searched * 24.0)
        monkeypatch.setattr("rtds_host.diagnosis.problem.STRETCH_S", 4.0)
    search, fit = fitted(Case("halves", robot, (run,)), {COULOMB: {"torque_nm": 0.02}})
    assert search.problem.searched == searched
    ((first, second),) = parted(search.problem)
    assert first[:2] == (0, second[0]) and second[1] == len(run.t)
    assert np.array_equal(np.sort(np.concatenate([first[2], second[2]])), np.arange(search.problem.size))
    together = search.problem.gap(fit.model(search.problem))
    assert left_out_gap(search.problem, fit) > together > 1.1


@pytest.mark.parametrize(("measured", "counted"), [(("w_l", "th_l"), {"w_l"}), (("th_l",), {"th_l"})])
def test_pieces_judge_by_the_channels_that_the_gap_counts(measured, counted):
    """An angle next to a speed helps to find an effect, and has no vote."""
    robot = replace(builtin_robot("burger"), chassis=None, axis=Axis("inertia", 1e-3))
    t = np.arange(0.0, 4.0, 0.005)
    log = RunLog("swing", RunMeta(), t, {"v_cmd_l": 5.0 * np.sin(9.0 * t)})
    out = replay_run(nominal_model(robot), run_inputs(log, robot))
    log.columns.update({c: out[:, OUTPUT_INDEX[c]] for c in measured})
    problem = Problem(Case("swing", robot, (log, replace(log, name="again"))), 1)
    fit = Search(problem).begin()
    assert [set(errors) for errors in over_pieces(problem, predicted(problem, fit))] == [counted, counted]


def test_what_one_run_alone_knows_of_and_fits_amiss_in_the_others_is_not_included():
    """A driver that was weak in one run of four: its gain follows that run, and the others are predicted worse
    with it.
    """
    robot = builtin_robot("burger")
    sound, heavy = nominal_model(robot), nominal_model(robot)
    for model in (sound, heavy):
        model.add("coulomb", 0.05)
    heavy.scale("voltage_gain", 0.8)
    runs = tuple(
        make_run(f"{kind}-{seed}", heavy if seed == 3 else sound, robot, kind, seed=seed)
        for seed, kind in enumerate(("steps", "weave", "steps", "weave"))
    )
    search, fit = fitted(
        Case("one of four", robot, runs), {COULOMB: {"torque_nm": 0.04}, ("driver_gain", "both"): {"ratio": 0.9}}
    )
    found = attribute(search, fit)
    assert [one.cause for one in found.included] == [COULOMB]
    assert "held-out runs" in found.rejected["driver_gain", "both"]


@pytest.mark.parametrize(
    ("cause", "size", "why"),
    [
        (("measurement_delay", "both"), {"seconds": 0.0}, ABSENT),
        (("pwm_curve", "both"), {"curvature": 10.0, "fast_decay": 0.0}, AT_BOUND),
        (("resistance_error", "left"), {"ratio": 1.01}, TOLERATED),
    ],
)
def test_an_effect_that_is_no_cause_at_its_size_is_not_included(monkeypatch, cause, size, why):
    """Fitted again without another effect, a size may become nothing or move to the end of what is searched, and a fit
    that is settled may end there.
    """
    robot = builtin_robot("burger")
    model = nominal_model(robot)
    model.add("coulomb", 0.05)
    runs = tuple(make_run(kind, model, robot, kind, seed=k) for k, kind in enumerate(("steps", "weave")))
    search, fit = fitted(Case("friction", robot, runs), {COULOMB: {"torque_nm": 0.04}})
    hypothesis, sizes = joined(fit.parts | {cause: scaled(search.store.effects, (cause,), [size])})
    moved = replace(search.store.try_fit(hypothesis, sizes, fit), u=sizes)
    monkeypatch.setattr("rtds_host.diagnosis.attribution._simplest", lambda _, one: one)
    monkeypatch.setattr(type(search.store), "within_noise", lambda *_: False)
    monkeypatch.setattr(type(search.store), "settled", lambda _, fits: fits)
    found = attribute(search, moved)
    assert [one.cause for one in found.included] == [COULOMB]
    assert found.rejected[cause] == why


@pytest.mark.parametrize(
    "without,gap,share,worth",
    [
        (1.2, 1.0, 0.0, True),  # makes a gap of 1.2 out of none
        (1.05, 1.0, 0.5, False),  # makes none
        (1.12, 1.04, 0.0, True),  # makes none of a gap, for the larger part
        (1.12, 1.09, 0.0, False),  # takes less than half of what a small gap has beyond noise
        (3.0, 2.0, 0.0, True),  # outweighs what is left
        (9.0, 8.0, 0.01, False),  # a quarter of what is left: any form may take that
        (9.0, 8.0, 0.4, True),  # little of the gap, but much of what the likelihood sees
    ],
)
def test_an_effect_is_worth_naming_if_it_outweighs_half_of_the_residual_or_is_much_of_what_the_likelihood_sees(
    without, gap, share, worth
):
    assert enough_to_include(without, gap, share) is worth


def test_plain_squares_find_another_optimum_of_an_explanation_than_the_likelihood():
    """Two runs say one friction and a third another one: the likelihood lets the third go, plain squares do not."""
    search, fit = fitted(with_frictions(0.02, 0.02, 0.035), {COULOMB: {"torque_nm": 0.02}})
    optima = search.store.local_optima([fit])[0]
    plain = next(one for one in optima if one.noise.root is None)
    assert optima[0] is fit
    assert [one.hypothesis for one in optima] == [fit.hypothesis] * len(optima)
    assert float(plain.residual @ plain.residual) < 0.98 * float(fit.residual @ fit.residual)
    assert plain.values[0]["torque_nm"] > 1.03 * fit.values[0]["torque_nm"]


def test_a_graduated_fit_ends_in_one_optimum_wherever_it_starts():
    """Three runs say three frictions, and each is an optimum of the likelihood: fits end in the one nearest to their
    start. By ever less noise they end in the middle one, which is the most probable."""
    search, fit = fitted(with_frictions(0.01, 0.03, 0.06), {COULOMB: {"torque_nm": 0.02}})
    fitter, white = search.store.fitter, search.problem.white()
    direct_ends, graduated_ends = [], []
    for start in (0.01, 0.03, 0.06):
        u = scaled(fit.effects, fit.hypothesis, [{"torque_nm": start}])
        plain = fitter.fit(fit.hypothesis, u, np.zeros_like(fit.z), white, fixed=True)
        (graduated,) = side_by_side(search.problem, [fitter.graduating(plain)])
        direct = fitter.fit(fit.hypothesis, u, np.zeros_like(fit.z), white)
        direct_ends.append(direct)
        graduated_ends.append(graduated)
    assert [one.values[0]["torque_nm"] for one in direct_ends] == pytest.approx([0.01, 0.03, 0.06], rel=0.05)
    assert [one.values[0]["torque_nm"] for one in graduated_ends] == pytest.approx([0.03] * 3, rel=0.02)
    assert max(one.cost for one in graduated_ends) < min(one.cost for one in direct_ends) + 2.0


def test_an_explanation_with_a_spring_is_not_graduated(monkeypatch):
    """A spring has many optima of its own, and by the likelihood of much noise what is missing elsewhere would choose
    among them."""
    spring = ("gear_compliance", "both")
    stiff = {"stiffness_nm_per_rad": 3.0, "damping_nm_s_per_rad": 0.01}
    search, fit = fitted(with_frictions(0.02), {COULOMB: {"torque_nm": 0.02}, spring: stiff})
    without = search.store.try_fit((COULOMB,), fit.parts[COULOMB], search.store.fits[()])
    graduated, real = [], search.store.fitter.graduating
    monkeypatch.setattr(
        search.store.fitter, "graduating", lambda plain: (graduated.append(plain.hypothesis), real(plain))[1]
    )
    search.store.local_optima([fit, without])
    assert spring in fit.hypothesis
    assert graduated == [(COULOMB,)]
