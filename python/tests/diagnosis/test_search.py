"""The search: what it holds for one effect, what it looks at in a long log, how finely it knows a ripple."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_machine import write_axis_case
from diagnosis_cases import changed, make_case, make_run, without

from rtds_host.contract import Case, builtin_robot, read_case
from rtds_host.diagnosis import ripple
from rtds_host.diagnosis.attribution import attribute
from rtds_host.diagnosis.diagnose import diagnose, explanations, said_of_end
from rtds_host.diagnosis.effects import catalogue
from rtds_host.diagnosis.evidence import CONVINCING, distinguishable, excess
from rtds_host.diagnosis.fit import (
    AT_ONCE,
    SETTLED_GAIN,
    Fit,
    Fitter,
    Proposal,
    joined,
    scaled,
    side_by_side,
    to_values,
)
from rtds_host.diagnosis.intervals import bias, command_shift, intervals, sigmas_of
from rtds_host.diagnosis.practically_indistinguishable import opens_gap, practically_indistinguishable, substitutes_for
from rtds_host.diagnosis.problem import SEARCHED_S, Problem
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.scatter import scatter, scattered
from rtds_host.diagnosis.screen import Screen, changes_by_missing, sensitivities_of
from rtds_host.diagnosis.search import driver
from rtds_host.diagnosis.search.driver import Search
from rtds_host.diagnosis.search.moves import exchanging, refining, removing, renaming
from rtds_host.diagnosis.search.stepwise import Selection
from rtds_host.diagnosis.search.store import FAR
from rtds_host.diagnosis.start import DECLARED
from rtds_host.diagnosis.structurally_indistinguishable import nearly_indistinguishable, structurally_indistinguishable
from rtds_host.diagnosis.thresholds import Z90
from rtds_host.plant.schema import OUTPUT_INDEX

POSE = ("x", "y", "yaw")


def forwards(case: Case) -> Case:
    """The case with every command and speed made positive, and no angle that goes back: no reversal."""
    of = {"v": np.abs, "w": np.abs, "t": np.maximum.accumulate}
    runs = tuple(
        replace(r, columns={c: of.get(c[0], np.asarray)(v) if c != "v_bus" else v for c, v in r.columns.items()})
        for r in case.runs
    )
    return replace(case, runs=runs)


def there_and_back(case: Case) -> Case:
    """Two runs of it, one all forwards and one all backwards: no reversal within either."""
    on, back = forwards(case).runs[:2]
    return replace(
        case,
        runs=(
            on,
            replace(back, columns={c: -v if c[0] in "vwt" and c != "v_bus" else v for c, v in back.columns.items()}),
        ),
    )


def straight(case: Case) -> Case:
    """The case with the left wheel commanded as the right one is."""
    runs = tuple(replace(r, columns={**r.columns, "v_cmd_l": r.columns["v_cmd_r"]}) for r in case.runs)
    return replace(case, runs=runs)


@pytest.mark.parametrize(
    "case,cause,expected",
    [
        (make_case(), ("command_delay", "both"), []),
        (without(make_case(), *POSE), ("command_delay", "both"), [("measurement_delay", "both")]),
        (without(make_case(), *POSE, "i_l", "i_r", "gyro_z"), ("speed_gain", "left"), [("driver_gain", "left")]),
        (without(make_case(), *POSE, "gyro_z"), ("speed_gain", "left"), []),
        (without(make_case(), "x", "y"), ("wheel_radius_error", "both"), [("track_width_error", "both")]),
        (without(make_case(), "x", "y"), ("wheel_radius_error", "left"), []),
        (
            without(make_case(), *POSE),
            ("gyro_gain", "both"),
            [("track_width_error", "both"), ("wheel_radius_error", "both")],
        ),
        (without(straight(make_case()), *POSE), ("wheel_radius_error", "both"), [("track_width_error", "both")]),
        (without(make_case(), "i_l", "i_r"), ("driver_deadzone", "right"), []),
        (
            without(forwards(make_case()), "i_l", "i_r"),
            ("driver_deadzone", "right"),
            [("coulomb_friction", "right"), ("bridge_drop", "right"), ("friction_asymmetry", "right")],
        ),
        (
            without(there_and_back(make_case()), "i_l", "i_r"),
            ("driver_deadzone", "right"),
            [("coulomb_friction", "right"), ("bridge_drop", "right")],
        ),
        (
            without(there_and_back(make_case()), "i_l", "i_r"),
            ("rolling_resistance", "both"),
            [("coulomb_friction", "both"), ("driver_deadzone", "both"), ("bridge_drop", "both")],
        ),
        (there_and_back(make_case()), ("friction_asymmetry", "right"), []),
        (forwards(make_case()), ("friction_asymmetry", "both"), [("coulomb_friction", "both")]),
        (
            replace(forwards(make_case()), runs=forwards(make_case()).runs[:2]),
            ("rolling_resistance", "both"),
            [("coulomb_friction", "both"), ("friction_asymmetry", "both")],
        ),
        (
            replace(make_case(), runs=make_case().runs[:2]),
            ("rolling_resistance", "both"),
            [("coulomb_friction", "both")],
        ),
        (make_case(), ("rolling_resistance", "both"), []),
    ],
    ids=lambda v: v[0] if isinstance(v, tuple) else "",
)
def test_indistinguishable_effects_are_what_the_runs_lack_the_channels_or_motions_to_part(case, cause, expected):
    assert structurally_indistinguishable(case, cause) == expected


@pytest.mark.parametrize(
    "case,cause,expected",
    [
        (
            without(make_case(), "i_l", "i_r"),
            ("resistance_error", "both"),
            [("torque_constant_error", "both"), ("payload_error", "both")],
        ),
        (without(make_case(), "i_l", "i_r"), ("resistance_error", "left"), [("torque_constant_error", "left")]),
        (make_case(), ("resistance_error", "both"), []),
        (make_case(), ("payload_error", "both"), []),
        (straight(make_case()), ("wheel_radius_error", "both"), []),
        (without(straight(make_case()), *POSE), ("wheel_radius_error", "both"), [("payload_error", "both")]),
        (without(straight(make_case()), *POSE), ("payload_error", "both"), [("wheel_radius_error", "both")]),
        (replace(make_case(), runs=make_case().runs[1:2]), ("payload_error", "both"), [("slope_error", "both")]),
    ],
    ids=lambda v: v[0] if isinstance(v, tuple) else "",
)
def test_nearly_indistinguishable_effects_are_what_the_runs_lack_the_current_or_a_second_slope_to_part(
    case, cause, expected
):
    assert nearly_indistinguishable(case, cause) == expected


def delayed_case(command_delays: dict[str, float]) -> Case:
    """Four runs with a command delay of 0.15 s, of some of which the commands were recorded so much too early, s."""
    robot = builtin_robot("burger")
    model = nominal_model(robot)
    model.put("command_delay", 0.15)
    runs = []
    for k in range(4):
        run = make_run(f"r{k}", model, robot, ("steps", "weave")[k % 2], 8.0, k)
        late = command_delays.get(run.name, 0.0)
        commands = {c: np.interp(run.t + late, run.t, run.columns[c]) for c in ("v_cmd_l", "v_cmd_r")}
        runs.append(replace(run, columns={**run.columns, **commands}))
    return Case("late", robot, tuple(runs))


def test_a_run_whose_commands_act_later_than_the_others_does_not_bend_the_delay():
    """One link in four was set up 0.2 s late: the delay is that of the three, the one run's is noted, and gaps are
    judged without.
    """
    problem = Problem(delayed_case({"r1": 0.2}))
    model = problem.nominal.copy()
    model.put("command_delay", 0.15)
    before = problem.gap(model)
    start = problem.aligned_commands(model)
    assert dict(start.command_delays) == {"r1": pytest.approx(0.2, abs=0.01)}
    assert problem.gap_as_fitted(model.with_start(start)) < 0.5 * before
    assert problem.gap_as_fitted(model) == problem.gap(model.with_start(start)) == before
    diagnosis, details = diagnose(delayed_case({"r1": 0.2}), quick=True)
    (delay,) = diagnosis["effects"]
    assert delay["id"] == "command_delay"
    low, high = delay["parameters"]["seconds"]["ci90"]
    assert low < 0.15 < high and delay["parameters"]["seconds"]["value"] == pytest.approx(0.15, abs=0.005)
    assert any(note.startswith("r1: its commands act") for note in details.notes)


@pytest.mark.parametrize(
    "command_delays,delay",
    [({}, 0.15), ({"r1": 0.2, "r2": 0.2}, 0.15), ({"r1": 0.2}, 0.0)],
    ids=["all alike", "half of them: no delay is common", "no delay known"],
)
def test_commands_are_late_in_single_runs_only_next_to_the_delay_of_most(command_delays, delay):
    problem = Problem(delayed_case(command_delays))
    model = problem.nominal.copy()
    model.put("command_delay", delay)
    assert problem.aligned_commands(model) == DECLARED


def test_a_delay_without_a_pose_is_declared_with_what_is_indistinguishable_and_named_once():
    def late(model):
        model.put("command_delay", 0.02)

    diagnosis, _ = diagnose(without(make_case(late), *POSE), quick=True)
    delays = [e["id"] for e in diagnosis["effects"] if e["id"].endswith("_delay")]
    assert len(delays) == 1
    declared = next(s for s in diagnosis["indistinguishable"] if any(m["id"] == delays[0] for m in s))
    assert {"command_delay", "measurement_delay"} <= {m["id"] for m in declared}


@pytest.mark.parametrize("off", [-0.03, 0.002, 0.05])
def test_a_ripples_cycles_are_fitted_to_a_share_of_what_a_run_turns(off):
    def change(model):
        for quantity, value in (("ripple", 0.02), ("ripple_cycles", 12.0), ("ripple_phase", 0.7)):
            model.put(quantity, value)

    start = {
        "amplitude_nm": 0.015,
        "cycles_per_rev": 12.0 + off,
        "phase_rad": 0.5,
        "second_in_phase": 0.0,
        "second_in_quadrature": 0.0,
    }
    _, fit = fitted(make_case(change, seconds=20.0), (("torque_ripple", "both"), start))
    (values,) = fit.values
    assert values["cycles_per_rev"] == pytest.approx(12.0, abs=0.003) and values["amplitude_nm"] == pytest.approx(
        0.02, rel=0.02
    )


@pytest.mark.parametrize("side, scaled_cycles", [("left", 12.24), ("both", 12.24), ("right", 12.0)])
def test_a_ripple_starts_in_step_with_an_angle_that_a_gain_scales(side, scaled_cycles):
    """It was found over the measured angle. With 12 cycles of each true turn it would be out of step after a few turns
    of a wheel whose sensor counts 2 % too many, and the exchange for that gain would never be tried in earnest."""

    def change(model):
        for name, value in (("ripple", 0.1), ("ripple_cycles", 12.0), ("ripple_phase", 1.0)):
            model.put(name, value, (0,))

    search = Search(Problem(make_case(change, seed=28, seconds=4.0), 1), quick=True)
    wave, gain = ("torque_ripple", "left"), ("speed_gain", side)
    found = {"amplitude_nm": 0.1, "cycles_per_rev": 12.0, "phase_rad": 1.0}
    effects = search.store.effects
    wave_alone = search.begin().proposal({wave: effects[wave[0]].scaled(effects[wave[0]].within(found))})
    (fit,) = search.store.try_fits([wave_alone], rough=True)
    started = fit.proposal({gain: effects[gain[0]].scaled({"ratio": 1.02})})
    cycles = dict(zip(started.hypothesis, to_values(effects, started.hypothesis, started.u)))[wave]["cycles_per_rev"]
    own = fit.values[0]["cycles_per_rev"]
    assert own == pytest.approx(12.0, abs=0.1)
    assert cycles / own == pytest.approx(scaled_cycles / 12.0)
    (both,) = search.store.try_fits([started], rough=True)
    assert dict(zip(both.hypothesis, both.values))[gain]["ratio"] == pytest.approx(1.0, abs=0.01)


def test_only_factors_are_searched_by_their_logarithm():
    """A number of cycles is no factor: over a run it is wrong by so many cycles."""
    assert {
        p.name for effect in catalogue(builtin_robot("burger")).values() for p in effect.parameters if p.logarithmic
    } == {"ratio", "grip"}


def test_the_spectrum_of_a_ripple_is_as_fine_as_its_peak():
    """Over many turns a peak is narrower than any round number of cycles: here 11.63, as an encoder's scale would make
    it.
    """
    robot = builtin_robot("burger")
    model = nominal_model(robot)
    for quantity, value in (("ripple", 0.02), ("ripple_cycles", 11.63)):
        model.put(quantity, value, (0,))
    case = Case("rippled", robot, tuple(make_run(f"r{k}", model, robot, "weave", 20.0, k) for k in range(2)))
    problem = Problem(case)
    found = ripple.spectra(problem, problem.replay(problem.nominal))
    strongest = found["left"].cycles[np.argmax(found["left"].power)]
    turns = np.ptp(case.runs[0].columns["th_l"]) / (2 * np.pi)
    assert abs(strongest - 11.63) < 0.5 / turns
    assert found["left"].power.max() > 20 * found["right"].power.max()


def test_an_encoders_scale_counts_from_its_zero():
    """Contract, section 3: the angle is reported as ratio times the true one, so a run that begins at 9 rad began at 9
    / ratio.
    """
    robot = builtin_robot("burger")
    log = make_run("r", nominal_model(robot), robot, "steps", 2.0)
    inputs = run_inputs(log, robot)
    start = inputs[6].copy()
    start[3] = 9.0
    scaled = nominal_model(robot)
    scaled.put("speed_gain", 1.5)
    out = replay_run(scaled, (*inputs[:6], start))
    plain = replay_run(nominal_model(robot), (*inputs[:6], np.where(np.arange(len(start)) == 3, 6.0, inputs[6])))
    th = OUTPUT_INDEX["th_l"]
    assert out[0, th] == pytest.approx(9.0)
    np.testing.assert_allclose(out[:, th], 1.5 * plain[:, th], atol=1e-9)


def test_a_long_run_is_searched_in_stretches_from_all_over_and_judged_whole():
    robot = builtin_robot("burger")
    model = nominal_model(robot)
    model.put("coulomb", 0.04, (0,))
    seconds = 2.0 * SEARCHED_S
    case = Case("long", robot, (make_run("hours", model, robot, "weave", seconds, 3),))
    problem = Problem(case)
    assert problem.searched == pytest.approx(0.5, rel=0.01)
    first = [data.inputs[0][0] for data in problem.runs]
    assert first[0] == 0.0
    assert max(first) > 0.9 * seconds
    assert sum(data.inputs[0][-1] - data.inputs[0][0] for data in problem.runs) == pytest.approx(SEARCHED_S, rel=0.02)
    # Each stretch is replayed from what was measured there: the true model leaves noise and no more.
    residual = problem.residual(model)
    assert np.sqrt(np.mean(residual**2)) < 1.2
    diagnosis, details = diagnose(case, quick=True)
    assert [(e["id"], e["side"]) for e in diagnosis["effects"]] == [("coulomb_friction", "left")]
    assert any("50 % of them" in note for note in details.notes)
    assert len(details.traces["hours"]["w_l"].t) == len(case.runs[0].t)


def fitted(case: Case, *causes: tuple[tuple[str, str], dict[str, float]]):
    """A search of a case, and the fit of some effects from given sizes."""
    problem = Problem(case, 1)
    search = Search(problem, quick=True)
    store = search.store
    store.fits[()] = store.fitter.fit((), np.empty(0), np.zeros(store.fitter.count), problem.white())
    hypothesis = tuple(cause for cause, _ in causes)
    start = scaled(store.effects, hypothesis, [values for _, values in causes])
    return search, store.try_fit(hypothesis, start, store.fits[()])


def screened(search: Search, fit: Fit) -> list[Screen]:
    """The screenings of a fit, which the search's next ones begin with."""
    screens, search.screening = search.screening.renewed(search.store, fit)
    return screens


def test_the_lag_of_the_speeds_may_be_one_of_all_that_is_measured_in_part():
    search, fit = fitted(
        make_case(lambda m: m.put("speed_tau", 0.04)),
        (("speed_filter", "both"), {"time_constant_s": 0.04, "delay_s": 0.0}),
    )
    lag, delay = ("speed_filter", "both"), ("measurement_delay", "both")
    ((hypothesis, u, _),) = renaming.halved(search.store, fit, lag)
    values = dict(zip(hypothesis, to_values(search.store.effects, hypothesis, u)))
    assert values[lag]["time_constant_s"] == pytest.approx(0.02, rel=0.05) and values[delay][
        "seconds"
    ] == pytest.approx(0.02, rel=0.05)


def test_a_delay_under_the_other_delays_name_is_renamed():
    """8.3 ms of the commands read as 8.3 ms of the samples: next to no gap is left, and no slope leads from one to the
    other.
    """
    search, fit = fitted(
        make_case(lambda m: m.put("command_delay", 0.0083)), (("measurement_delay", "both"), {"seconds": 0.0083})
    )
    assert renaming.renamed(search.store, fit).hypothesis == (("command_delay", "both"),)
    search, fit = fitted(
        make_case(lambda m: m.put("command_delay", 0.0083)), (("command_delay", "both"), {"seconds": 0.0083})
    )
    assert renaming.renamed(search.store, fit) is fit


def soft_tyre(model):
    """One that slips by half a per cent a newton, whose tread gives 66 micrometres and swings little."""
    for name, value in (("slip", 0.005), ("slip_relaxation", 0.0132), ("slip_damping", 50.0), ("slip_grip", 20.0)):
        model.put(name, value, (0,))


SLIP, GEAR = ("longitudinal_slip", "left"), ("gear_compliance", "left")


def test_a_soft_tyre_is_found_under_a_soft_gear():
    """A tread of 15 N a millimetre is, about the axle, a spring of 16.5 N m a radian: most of what it does; the slip is
    the rest.
    """
    search, fit = fitted(make_case(soft_tyre), (GEAR, {"stiffness_nm_per_rad": 16.5, "damping_nm_s_per_rad": 0.054}))
    found = renaming.substitutes(search.store, fit, GEAR)[SLIP]
    assert search.store.score(found) < search.store.score(fit) - 2.0 * np.log(CONVINCING)
    assert found.values[0]["slip_per_newton"] == pytest.approx(0.005, rel=0.1)
    assert found.values[0]["softness_m_per_n"] == pytest.approx(6.6e-5, rel=0.05)


def test_a_soft_gear_is_found_under_a_soft_tyre():
    def soft_gear(model):
        model.put("stiffness", 7.4, (0,))
        model.put("damping", 0.008, (0,))

    search, fit = fitted(
        make_case(soft_gear),
        (SLIP, {"slip_per_newton": 0.005, "softness_m_per_n": 1.5e-4, "damping_n_s_per_m": 7.0, "grip": 4.0}),
    )
    found = renaming.substitutes(search.store, fit, SLIP)[GEAR]
    assert search.store.score(found) < search.store.score(fit)
    assert found.values[0]["stiffness_nm_per_rad"] == pytest.approx(7.4, rel=0.02)


def test_two_springs_in_a_row_become_one_where_one_does():
    """Half the tread's softness in the gear: neither can be taken out by itself, both together are the tyre's."""
    search, fit = fitted(
        make_case(soft_tyre),
        (GEAR, {"stiffness_nm_per_rad": 33.0, "damping_nm_s_per_rad": 0.1}),
        (SLIP, {"slip_per_newton": 0.005, "softness_m_per_n": 3.3e-5, "damping_n_s_per_m": 100.0, "grip": 20.0}),
    )
    assert removing.pruned(search.store, fit).hypothesis == (SLIP,)


def test_a_part_of_a_slip_is_promised_where_all_of_it_would_be_too_much():
    """A half of the only one that a first, quick screening looks at."""

    def slippery(model):
        soft_tyre(model)
        model.put("slip", 0.0076, (0,))
        model.put("slip_relaxation", 0.0013, (0,))

    search, fit = fitted(make_case(slippery))
    size, screens = search.store.effects["longitudinal_slip"].parameters[0], screened(search, fit)
    looked_at = search.screening.last.sensitivities
    assert {dict(s.values)["slip_per_newton"] for s in looked_at if s.effect == SLIP[0]} == {size.starts[1]}
    for screen in screens:
        slip = next(c for c in screen.candidates() if c.cause == SLIP)
        assert slip.gain > 0.0
        assert 0.3 * size.starts[1] < size.value(slip.start[0]) < 0.8 * size.starts[1]


def test_one_delay_that_is_two_is_distinguished():
    """A command late by 20 ms and samples by 30 read as samples late by 50: on top of their sum no screening promises
    the other.
    """

    def late(model):
        model.put("command_delay", 0.02)
        model.put("measurement_delay", 0.03)

    search, fit = fitted(make_case(late), (("measurement_delay", "both"), {"seconds": 0.05}))
    screened(search, fit)
    found = exchanging.exchanged(search.store, search.screening, fit, 2)
    assert found.hypothesis == (("command_delay", "both"), ("measurement_delay", "both"))
    assert [values["seconds"] for values in found.values] == pytest.approx([0.02, 0.03], abs=0.002)


@pytest.mark.parametrize("start", [0.0025, 0.05])
def test_free_play_is_found_from_the_wrong_valley(start):
    """Impacts come at other times with every angle: from a fourth or five times of it no slope leads to the
    right one.
    """
    search, fit = fitted(
        make_case(lambda m: m.put("backlash", 0.01, (0,))),
        (("backlash", "left"), {"angle_rad": start, "restitution": 0.0}),
    )
    found = refining.refine_locally(search.store, fit, fit.hypothesis)
    assert found.values[0]["angle_rad"] == pytest.approx(0.01, rel=0.05)


def test_two_effects_are_exchanged_for_two_others_at_once():
    """A winding of less resistance and a weaker torque constant read as two gains, a driver's and a current sensor's:
    exchanging one of them leads nowhere, exchanging both to the truth."""

    def weak(model):
        model.scale("resistance", 0.8)
        model.scale("torque_constant", 0.92)
        model.scale("back_emf", 0.92)

    search, fit = fitted(
        make_case(weak), (("current_gain", "both"), {"ratio": 1.12}), (("driver_gain", "both"), {"ratio": 1.1})
    )
    screened(search, fit)
    assert exchanging.exchanged(search.store, search.screening, fit, 4).hypothesis == fit.hypothesis
    found = exchanging.pairs_exchanged(search.store, search.screening, fit)
    assert found.hypothesis == (("resistance_error", "both"), ("torque_constant_error", "both"))
    assert [values["ratio"] for values in found.values] == pytest.approx([0.8, 0.92], rel=0.03)


def test_a_ratio_takes_over_what_its_sides_have_of_its_tolerance_in_common():
    """A resistance of 0.8 with both tolerances three sigmas down reads as 0.824: the residuals are those of the
    truth.
    """
    search, fit = fitted(
        make_case(lambda m: m.scale("resistance", 0.8)), (("resistance_error", "both"), {"ratio": 0.8})
    )
    mine = [k for k, nuisance in enumerate(search.problem.nuisances) if nuisance.name == "resistance"]
    leaning = fit.z.copy()
    leaning[mine] -= 3.0
    start = scaled(search.store.effects, fit.hypothesis, [{"ratio": fit.values[0]["ratio"] * np.exp(0.03)}])
    found = search.store.fitter.fit(fit.hypothesis, start, leaning, fit.noise)
    assert len(mine) == 2 and np.all(np.abs(found.z[mine]) < 1.0)
    assert found.values[0]["ratio"] == pytest.approx(0.8, rel=0.01)
    assert found.cost == pytest.approx(fit.cost, abs=0.5)


def test_an_explanation_begun_twice_alike_is_fitted_once():
    search, fit = fitted(
        make_case(lambda m: m.put("command_delay", 0.0083)), (("command_delay", "both"), {"seconds": 0.0083})
    )
    started, fitting = [], search.store.fitter.fitting
    search.store.fitter.fitting = lambda *given, **named: started.append(given) or fitting(*given, **named)
    start, other = (
        scaled(search.store.effects, fit.hypothesis, [{"seconds": seconds}]) for seconds in (0.0083, 0.0084)
    )
    assert search.store.try_fit(fit.hypothesis, start, search.store.fits[()]) is fit
    assert not started
    search.store.try_fits([Proposal(fit.hypothesis, other, search.store.fits[()])] * 2)
    assert len(started) == 1


def test_two_effects_that_are_one_are_fitted_though_rounding_hides_their_prior():
    """Coulomb friction next to Stribeck friction without its extra torque: their derivatives are the same, and only the
    prior says how to share. Of a gap of a hundred million, as a replay that went astray leaves, nothing of it is left
    in double precision. The fit is one all the same, and not the most probable one."""
    case = make_case(lambda model: model.add("coulomb", 0.05), seconds=4.0)
    fine = {channel: 1e-9 * sigma for channel, sigma in case.robot.sensors.items()}
    problem = Problem(replace(case, robot=replace(case.robot, sensors=fine)), 1)
    fitter, effects = Fitter(problem), problem.effects
    both = tuple((effect, "both") for effect in ("coulomb_friction", "stribeck_friction"))
    values = [{"torque_nm": 0.01}, {"torque_nm": 0.01, "extra_torque_nm": 0.0, "speed_rad_s": 2.0}]
    start, z = scaled(effects, both, values), np.zeros(fitter.count)
    fit = fitter.fit(both, start, z, problem.white(), fixed=True)
    alone = fitter.fit(both[:1], start[:1], z, problem.white(), fixed=True)
    assert fit.cost == pytest.approx(alone.cost, rel=0.05)
    assert sum(v["torque_nm"] for v in fit.values) == pytest.approx(0.05, rel=0.05)
    assert fit.score > alone.score


def test_fits_go_side_by_side_as_they_go_alone():
    """More fits than go on at a time, one of which asks for nothing at all: the same fits, in their order, of fewer
    calls for residuals.
    """
    causes = [
        ("resistance_error", "both"),
        ("driver_gain", "both"),
        ("coulomb_friction", "both"),
        ("command_delay", "both"),
        ("gyro_gain", "both"),
    ]
    search, none = fitted(make_case(lambda m: m.scale("resistance", 1.1)))
    starts = [
        Proposal((cause,), u, none)
        for cause in causes
        for u in (np.full(len(search.store.effects[cause[0]].parameters), size) for size in (0.1, 0.2))
    ]
    asked, residuals = [], search.problem.residuals
    search.problem.residuals = lambda *given: asked.append(given) or residuals(*given)

    def works():
        first, *others = (search.store.fitter.fitting_to(start, True) for start in starts)
        return [first, (nothing for nothing in ()), *others]

    alone = [side_by_side(search.problem, [work])[0] for work in works()]
    calls = len(asked)
    together = side_by_side(search.problem, works())
    assert len(starts) > AT_ONCE and len(asked) - calls < 0.5 * calls
    assert [fit and fit.hypothesis for fit in together] == [
        starts[0][0],
        None,
        *(hypothesis for hypothesis, _, _ in starts[1:]),
    ]
    for one, other in zip(alone, together):
        if one is not None:
            np.testing.assert_allclose(other.u, one.u, atol=1e-3)
            assert other.cost == pytest.approx(one.cost, abs=0.1)


def test_a_rough_fit_keeps_the_derivatives_of_what_stays_as_it_is():
    """Those of an effect that begins at another size are taken again there."""
    gain, friction = ("driver_gain", "both"), ("coulomb_friction", "both")
    search, fit = fitted(
        make_case(lambda m: m.scale("voltage_gain", 0.9)), (friction, {"torque_nm": 0.001}), (gain, {"ratio": 0.9})
    )
    kept, fitting = [], search.store.fitter.fitting
    search.store.fitter.fitting = lambda *given, **named: kept.append(set(given[5])) or fitting(*given, **named)
    for parts in (fit.parts, {**fit.parts, gain: scaled(search.store.effects, (gain,), [{"ratio": 0.7}])}):
        search.store.try_fit(*joined(parts), fit, rough=True)
    assert kept == [{friction, gain}, {friction}]


@pytest.mark.parametrize(("behind", "earnest"), [(-1.0, True), (1.0, False)])
def test_a_restart_that_is_far_behind_in_a_rough_fit_is_left(monkeypatch, behind, earnest):
    cause = ("longitudinal_slip", "both")
    search, fit = fitted(
        make_case(lambda m: m.scale("resistance", 1.1)),
        (cause, {"slip_per_newton": 0.05, "softness_m_per_n": 0.0005, "damping_n_s_per_m": 2.4, "grip": 0.9}),
    )
    store, tried = search.store, []
    monkeypatch.setattr(store, "within_noise", lambda fit: False)
    monkeypatch.setattr(store, "scores_of", lambda proposals, rough: [store.score(fit) + FAR + behind])
    monkeypatch.setattr(refining, "lower", lambda store, fit, cause: [])
    monkeypatch.setattr(store, "try_fits", lambda proposals: [tried.append(one) or fit for one in proposals])
    refining.refine_locally(search.store, fit, [cause])
    assert len(tried) == (len(search.store.effects[cause[0]].restarts) if earnest else 0)


def test_what_is_no_larger_than_its_noise_leaves_nothing_without_a_name():
    """The true explanation has next to no excess over white noise, a wrong one at least half as much as noise
    itself.
    """
    search, fit = fitted(
        make_case(lambda m: m.put("command_delay", 0.0083)), (("command_delay", "both"), {"seconds": 0.0083})
    )
    assert excess(search.problem, fit) < 0.02 * search.problem.size
    assert excess(search.problem, search.store.fits[()]) > 0.2 * search.problem.size


def late_in(runs: tuple[int, ...], case: Case, seconds: float = 0.03) -> Case:
    """The case with all that is measured late in some of its runs, as if their commands had been."""

    def delayed(log):
        shift = round(seconds / float(log.t[1] - log.t[0]))
        columns = {
            c: v if c.startswith("v_cmd") else np.concatenate([np.repeat(v[:1], shift), v[:-shift]])
            for c, v in log.columns.items()
        }
        return replace(log, columns=columns)

    return replace(case, runs=tuple(delayed(log) if k in runs else log for k, log in enumerate(case.runs)))


BLOCKS, KNOWN = np.arange(100.0), np.full(100, 50.0)


@pytest.mark.parametrize(
    "shares,low,high",
    [
        (np.ones(100), 0.0, 0.0),
        (1.0 + 0.3 * np.sign(BLOCKS - 49.5), 0.28, 0.31),
        (1.0 + 0.3 * np.sin(37.0 * BLOCKS), 0.0, 0.0),
        (1.0 + np.random.default_rng(1).normal(size=100) / np.sqrt(KNOWN), 0.0, 0.0),
    ],
    ids=["of one size", "of another where the setting is higher", "of any size in any setting", "known no better"],
)
def test_a_size_scatters_where_it_follows_a_setting(shares, low, high):
    assert low <= scatter(BLOCKS, KNOWN * shares, KNOWN) <= high


def bent(_, columns):
    for side in "lr":
        current = columns[f"i_{side}"]
        columns[f"i_{side}"] = current * (1.0 + (current / 0.5) ** 2)


def test_a_gain_that_stands_in_for_a_bend_scatters_and_a_gain_does_not():
    gain = (("current_gain", "both"), {"ratio": 1.1})
    search, fit = fitted(changed(make_case(seconds=20.0), bent), gain)
    scatter, setting = scattered(search.problem, fit)[gain[0]]
    assert scatter > 0.05 and setting is not None
    # Of such a gain no more is known than it scatters by.
    low, high = intervals(search.problem, fit)[gain[0], "ratio"]
    assert high - low > 2.0 * Z90 * scatter * abs(fit.values[0]["ratio"] - 1.0)
    search, fit = fitted(make_case(lambda m: m.scale("current_gain", 1.1), seconds=20.0), gain)
    assert scattered(search.problem, fit)[gain[0]] == (0.0, None)
    low, high = intervals(search.problem, fit)[gain[0], "ratio"]
    assert low < 1.1 < high and high - low < 0.02


@pytest.mark.parametrize("unmodelled", [0.01, 0.02, 0.04])
def test_what_is_missing_biases_a_size_by_about_as_much_as_is_said(unmodelled):
    """Dry friction that the explanation lacks is taken for viscous friction in part, which no scatter shows. Of one
    missing effect that is known, the bias is known within a factor of four."""
    viscous = ("viscous_friction", "both"), {"nm_s_per_rad": 0.01}

    def rubs(model):
        model.add("viscous_wheel", 0.01)
        model.add("coulomb", unmodelled)

    search, usual = fitted(make_case(rubs, seconds=20.0), viscous)
    (fit,) = search.store.settled([usual])
    changes = changes_by_missing(sensitivities_of(search.store.fitter, fit, {}, {"coulomb_friction"}, {}), fit)
    off = float((fit.u - scaled(search.store.effects, (viscous[0],), [{"nm_s_per_rad": 0.01}]))[0])
    assert off > 3.0 * sigmas_of(search.problem, fit)[0]
    assert off / 4.0 < bias(fit, changes)[-1] < 4.0 * off


def test_settled_fits_end_at_one_optimum_wherever_they_began():
    """The usual fits of a case with a gap end wherever their few steps led them."""

    def rubs(model):
        model.add("viscous_wheel", 0.01)
        model.add("coulomb", 0.02)

    usual, settled = [], []
    for start in (0.005, 0.01, 0.02, 0.04):
        search, fit = fitted(make_case(rubs), (("viscous_friction", "both"), {"nm_s_per_rad": start}))
        (end,) = search.store.settled([fit])
        assert end.cost <= fit.cost and search.store.fits[fit.hypothesis] is end
        usual.append(fit.cost)
        settled.append(end)
    assert max(usual) - min(usual) > 100.0
    assert max(end.cost for end in settled) - min(end.cost for end in settled) < 10.0 * SETTLED_GAIN
    sizes = [end.values[0]["nm_s_per_rad"] for end in settled]
    assert max(sizes) < 1.01 * min(sizes)


def test_nothing_missing_biases_nothing():
    viscous = ("viscous_friction", "both"), {"nm_s_per_rad": 0.01}
    search, fit = fitted(make_case(lambda m: m.add("viscous_wheel", 0.01), seconds=20.0), viscous)
    changes = changes_by_missing(sensitivities_of(search.store.fitter, fit, {}, {"coulomb_friction"}, {}), fit)
    assert bias(fit, changes)[-1] < sigmas_of(search.problem, fit)[0]
    assert not bias(fit, []).any()


def test_a_search_with_one_run_aligned_counts_only_if_it_leaves_less(monkeypatch):
    """What a tick of the driver's own makes of commands may look like a late link."""
    case = delayed_case({})
    search = Search(Problem(case, 1), quick=True)
    best = search.begin()
    gaps_found, states = iter((3.0, 5.0)), []

    class Scripted(Selection):
        """Whose choice leaves a larger gap with a run aligned."""

        @classmethod
        def of_beams(cls, searches, start):
            states.append([(one.store.fitter.start, one.store.fits) for one in searches])
            one = cls(searches)
            one.scripted = searches[0], SimpleNamespace(fit=searches[0].store.fits[()], gap=next(gaps_found))
            return one

        def choice(self):
            return self.scripted

        def stepwise(self):
            return self.scripted[0], self.scripted[1].fit

    def aligned(problem, model):
        return model.start.with_command_delays({"r1": 0.1})

    monkeypatch.setattr("rtds_host.diagnosis.diagnose.Selection", Scripted)
    monkeypatch.setattr(Problem, "aligned_commands", aligned)
    owner, taken = explanations(case, search, best, 1, frozenset()).stepwise()
    assert [dict(start.command_delays) for start, _ in states[1]] == [{"r1": 0.1}] * 2
    assert taken is best and (owner.store.fitter.start, owner.store.fits) == states[0][0]


def test_a_gyro_that_is_upside_down_has_no_lookalike_of_a_negative_width():
    """Without x and y a gyro's gain, the track's width and the wheels' radius are alike; but no width is negative."""
    case = without(make_case(lambda m: m.scale("gyro_gain", -1.0)), *POSE)
    upside, slower = (("gyro_gain", "both"), {"ratio": -1.0}), (("gyro_gain", "both"), {"ratio": 0.8})
    search, fit = fitted(case, upside)
    assert practically_indistinguishable(search, fit, [(upside[0], search.store.fits[()])])[0] == ()
    search, fit = fitted(without(make_case(lambda m: m.scale("gyro_gain", 0.8)), *POSE), slower)
    ((first, *others),) = practically_indistinguishable(search, fit, [(slower[0], search.store.fits[()])])[0]
    assert first == slower[0] and ("track_width_error", "both") in others


@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_of_a_base_in_speed_mode_counts_and_radius_are_each_tried_at_the_inverse_of_the_other(ratio):
    """Twice the counts halve the way of a base whose loop holds the speed that it counts; no slope leads from one to
    the other."""
    search, fit = fitted(make_case(), (("wheel_radius_error", "both"), {"ratio": ratio}))
    start = renaming.approximations(search.store, fit, ("wheel_radius_error", "both"))["speed_gain", "both"]
    ((value,),) = [v.values() for v in to_values(search.store.effects, (("speed_gain", "both"),), start)]
    assert value == pytest.approx(1.0 / fit.values[0]["ratio"])


def test_the_other_delay_is_tried_in_a_delay_s_place_at_its_size():
    """No screening promises it: a delay's misfit falls only near the right size. Where clocks may be off it can be the
    one that is there.
    """
    delay, other = ("command_delay", "both"), ("measurement_delay", "both")
    search, fit = fitted(make_case(lambda m: m.put("command_delay", 0.0083)), (delay, {"seconds": 0.0083}))
    swapped = substitutes_for(search, fit, delay, removing.without(search.store, fit, delay)[0])[other]
    assert swapped.hypothesis == (other,) and swapped.values[0]["seconds"] == pytest.approx(0.0083, rel=0.1)


def test_what_the_search_met_is_weighed_in_an_effects_place():
    """An effect that gave way to a look-alike is one of that, whether or not a screening promises it."""
    gain, other, beside = ("driver_gain", "both"), ("gyro_bias", "both"), ("coulomb_friction", "left")
    search, fit = fitted(
        make_case(lambda m: m.scale("voltage_gain", 0.95)), (gain, {"ratio": 0.95}), (beside, {"torque_nm": 0.001})
    )
    (alone,) = removing.without(search.store, fit, gain)
    assert other not in substitutes_for(search, fit, gain, alone)
    met = search.store.try_fit(*joined({other: np.zeros(1), beside: fit.parts[beside]}), fit, rough=True)
    assert substitutes_for(search, fit, gain, alone)[other] is met


def test_the_next_effect_is_one_that_every_run_asks_for():
    """One run of four is late, and the gyro's gain is off in all: a delay is not supported, the gain is."""
    robot = builtin_robot("burger")
    model = nominal_model(robot)
    model.scale("gyro_gain", 0.8)
    logs = tuple(make_run(f"steps-{k}", model, robot, "steps", 8.0, k) for k in range(4))
    gain, delay = ("gyro_gain", "both"), ("command_delay", "both")
    search, wanted = fitted(late_in((1,), Case("example", robot, logs), 0.01), (gain, {"ratio": 0.8}))
    nothing = search.store.fits[()]
    search.store.fits = {
        f.hypothesis: f
        for f in (
            nothing,
            search.store.try_fit((delay,), scaled(search.store.effects, (delay,), [{"seconds": 0.003}]), nothing),
        )
    }
    assert search.best_supported(nothing, search.store.gap(nothing)) is None
    search.store.fits[wanted.hypothesis] = wanted
    assert search.best_supported(nothing, search.store.gap(nothing)).hypothesis == (gain,)


@pytest.mark.parametrize(
    "rest,least,most", [(0.0, 0.0, 0.1), (0.02, 2.0, np.inf)], ids=["nothing left", "a slope that has no name"]
)
def test_a_size_is_known_no_better_than_two_ways_to_weigh_the_residual_agree(rest, least, most):
    gain = ("gyro_gain", "both")
    search, fit = fitted(
        make_case(lambda m: (m.scale("gyro_gain", 0.95), m.add("slope_extra", rest))), (gain, {"ratio": 0.95})
    )
    fit = search.store.fitter.fit(fit.hypothesis, fit.u, fit.z, fit.noise.estimated(fit.residual))
    shift, own = abs(command_shift(fit)[-1]), np.sqrt(fit.covariance[-1, -1])
    assert least * own <= shift <= most * own
    assert sigmas_of(search.problem, fit)[-1] >= np.hypot(shift, own)


def test_an_account_says_what_stands_in_its_plainer_form():
    """Coulomb friction, found with an extra at low speed that is not there."""
    stribeck = ("stribeck_friction", "both"), {"torque_nm": 0.03, "extra_torque_nm": 0.002, "speed_rad_s": 1.0}
    search, fit = fitted(make_case(lambda m: m.add("coulomb", 0.03)), stribeck)
    assert [one.cause for one in attribute(search, fit).included] == [("coulomb_friction", "both")]


def test_signatures_that_are_one_and_large_promise_no_pair():
    """A speed sensor's gain and a driver's are in proportion here, and a hundred thousand noises large."""
    case = make_case()
    robot = replace(case.robot, sensors={name: 1e-5 * value for name, value in case.robot.sensors.items()})
    problem = Problem(replace(case, robot=robot), 1)
    search = Search(problem, quick=True)
    fitter = search.store.fitter
    fit = search.store.fits[()] = fitter.fit((), np.empty(0), np.zeros(fitter.count), problem.white(), 0)
    sensitivities = sensitivities_of(fitter, fit, {}, {"driver_gain"}, {})
    one = next(iter(sensitivities))
    equal = replace(one, effect="speed_gain", values=one.values)
    screen = Screen(problem, fit, {one: sensitivities[one], equal: 2.0 * sensitivities[one]}, problem.white())
    assert all(np.isfinite(gain) for gain, *_ in screen.pairs([("driver_gain", one.side), ("speed_gain", one.side)]))


def test_a_limit_is_tried_below_what_is_commanded():
    """A quick screening looks at one limit alone; where this is above all commands, at the others, too."""
    case = make_case()
    search = Search(Problem(replace(case, runs=case.runs[:1]), 1), quick=True)
    highest = max(np.abs(case.runs[0].columns[f"v_cmd_{side}"]).max() for side in "lr")
    found = sensitivities_of(search.store.fitter, search.begin(), {}, {"voltage_limit"}, {}, coarse=True)
    changed = {dict(one.values)["volts"]: bool(change.any()) for one, change in found.items()}
    assert {limit < highest for limit in changed} == {True, False}
    assert all(change == (limit < highest) for limit, change in changed.items())


def uneven(model):
    """Drivers of 80 and 64 % of what is commanded."""
    model.scale("voltage_gain", 0.8, (0,))
    model.scale("voltage_gain", 0.64, (1,))


def test_an_effect_of_both_sides_is_parted_where_they_differ():
    """One gain for both leaves half of what they differ by on each side; the screening proposes a gain of its own for
    one, from that of both, and with the other's kept."""
    search, fit = fitted(make_case(uneven), (("driver_gain", "both"), {"ratio": 0.72}))
    extended = search.extend(fit)
    assert extended.hypothesis == (("driver_gain", "left"), ("driver_gain", "right"))
    assert [values["ratio"] for values in extended.values] == pytest.approx([0.8, 0.64], rel=0.02)


def test_what_one_side_has_next_to_an_effect_of_both_may_be_that_effect_of_another_size():
    """Whatever stands on the right next to a gain of both: without it, each side has a gain of its own, roughly
    fitted. What stands on both may not."""
    search, alone = fitted(make_case(uneven), (("driver_gain", "both"), {"ratio": 0.8}))
    (found,) = search.store.try_fits(renaming.parted_sides(search.store, alone, ("pwm_curve", "right")), rough=True)
    assert found.hypothesis == (("driver_gain", "left"), ("driver_gain", "right"))
    assert [values["ratio"] for values in found.values] == pytest.approx([0.8, 0.64], rel=0.05)
    assert renaming.parted_sides(search.store, alone, ("pwm_curve", "both")) == []


@pytest.mark.parametrize(("delay_s", "named"), [(0.0, True), (0.05, True), (0.0999, False), (0.1, False)])
def test_a_parameter_that_shapes_an_effect_lies_at_no_bound_either_but_where_it_is_absent(delay_s, named):
    """A filter whose delay is as long as is looked at, or nearly, is a delay of all samples."""
    filtered = ("speed_filter", "both"), {"time_constant_s": 0.4, "delay_s": delay_s}
    search, fit = fitted(make_case(), filtered)
    assert search.store.admissible(replace(fit, u=scaled(search.store.effects, (filtered[0],), [filtered[1]]))) is named


def test_no_dead_zone_exceeds_the_largest_command():
    """A driver that passes none of the commands on is one without gain; beyond them every dead zone is as good as
    another.
    """
    case = make_case()
    asked = max(float(np.abs(run.commands("voltage")).max()) for run in case.runs)
    bound = {
        name: catalogue(case.robot, case.runs)[name].parameters[0].high for name in ("driver_deadzone", "bridge_drop")
    }
    assert bound == {name: pytest.approx(min(asked, 0.7 * case.robot.supply_v)) for name in bound}
    weak = changed(case, lambda t, columns: [columns[c].__imul__(0.1) for c in ("v_cmd_l", "v_cmd_r")] and None)
    assert catalogue(case.robot, weak.runs)["driver_deadzone"].parameters[0].high == pytest.approx(0.1 * asked)


@pytest.mark.parametrize(
    ("gain", "t", "part", "told"),
    [
        (60.0, 4.1, 0.05, True),  # in most blocks, and five blocks' share of the rest
        (60.0, 4.1, 0.003, False),  # in most blocks, and less of the rest than chance takes
        (
            60.0,
            4.1,
            -0.01,
            False,
        ),  # blocks that convince too much count as twenty to one: all in all the other is as likely
        (60.0, 1.0, 0.05, False),  # in a few stretches
    ],
)
def test_what_distinguishes_two_effects_is_more_of_the_residual_than_chance_takes(gain, t, part, told):
    assert distinguishable(gain, t, part, 100) is told
    # What is known to be confused is distinguished by more than a slight part of what the other leaves.
    assert not distinguishable(gain, t, part, 100, least=0.1)
    assert distinguishable(60.0, 4.1, 0.15, 100, least=0.1)


@pytest.mark.parametrize(
    "other,gap,opens", [(1.05, 0.5, False), (15.0, 0.5, True), (9.5, 9.0, False), (20.0, 9.0, True)]
)
def test_a_look_alike_opens_no_gap(other, gap, opens):
    """Of noise alone (a gap of 1) one explanation leaves no more than another; next to a rest no more than half of that
    comes on top.
    """
    assert opens_gap(other, gap) is opens


def test_noise_that_is_larger_than_declared_is_told_with_its_size():
    """A user's guess in [sensors] that is three times too small makes a gap of its own on a sound robot."""
    rng = np.random.default_rng(11)

    def edit(t, columns):
        columns["w_l"] = columns["w_l"] + 2.83 * case.robot.noise("w_l") * rng.standard_normal(len(t))

    case = make_case()
    _, details = diagnose(changed(case, edit), quick=True, threads=1)
    told = [note for note in details.notes if "as noisy as" in note]
    assert len(told) == 1 and told[0].startswith("w_l") and "3 times" in told[0]
    _, details = diagnose(case, quick=True, threads=1)
    assert not [note for note in details.notes if "as noisy as" in note]


@pytest.mark.parametrize("share", [0.0, 0.2], ids=["none", "some"])
def test_a_search_ends_with_what_its_work_has_found(monkeypatch, share):
    """Next to a large rest, or where much slips and swings, there is always something more to try."""
    several = make_case(
        lambda m: (
            m.put("command_delay", 0.05),
            m.add("coulomb", 0.03),
            m.scale("resistance", 1.3),
            m.put("gyro_bias", 0.05),
        )
    )
    whole = Search(Problem(several), quick=True)
    found = whole.run()
    assert not whole.limits.ended and len(found.hypothesis) == 4
    monkeypatch.setattr(driver, "QUICK_WORK", share * whole.problem.work)
    short = Search(Problem(several), quick=True)
    less = short.run()
    assert short.limits.ended and short.problem.work < whole.problem.work
    assert set(less.hypothesis) < set(found.hypothesis)
    assert bool(less.hypothesis) == bool(share)


def test_an_account_that_has_done_as_much_again_looks_for_no_look_alike_that_was_not_met(monkeypatch):
    """What is alike in principle is declared all the same; a search that did not end early is said to have, since its
    attribution did.
    """
    screened, rivals = [], exchanging.rivals
    monkeypatch.setattr(exchanging, "rivals", lambda *given: screened.append(given[1]) or rivals(*given))
    late = without(make_case(lambda m: m.put("measurement_delay", 0.05)), *POSE)
    for share, ended in ((1e9, False), (0.5, True)):
        search = Search(Problem(late), quick=True)
        fit = search.run()
        (found,) = fit.hypothesis
        assert not search.limits.ended
        monkeypatch.setattr(search.limits, "attribution_until", share * search.problem.work)
        screened.clear()
        alike, _ = practically_indistinguishable(search, fit, [(found, search.store.fits[()])])
        assert bool(screened) is not ended and search.limits.ended is ended
        assert alike[0] == (found, structurally_indistinguishable(late, found)[0])


def test_work_is_the_same_on_any_number_of_cores():
    """Where a search ends must not depend on the machine."""
    done = []
    for threads in (1, 3):
        problem = Problem(make_case(lambda m: m.put("slip", 0.01)), threads)
        model = nominal_model(problem.robot)
        problem.residuals([model, model])
        problem.residuals([model])
        done.append(problem.work)
    assert done[0] == done[1] > 0.0


def test_a_fit_by_the_starts_derivatives_ends_where_another_does_with_fewer_replays():
    """Viscous friction is linear in its coefficient: its derivatives at the start serve to the end."""
    search = Search(Problem(make_case(lambda m: m.add("viscous_wheel", 0.02)), 1), quick=True)
    fitter, cause = search.store.fitter, (("viscous_friction", "both"),)
    start, nothing = scaled(search.store.effects, cause, [{"nm_s_per_rad": 0.01}]), search.begin()
    found = []
    for chord in (False, True):
        before = search.problem.work
        work = fitter.fitting(cause, start, nothing.z, nothing.noise, by_nuisance=nothing.by_nuisance, chord=chord)
        (fit,) = side_by_side(search.problem, [work])
        found.append((fit.values[0]["nm_s_per_rad"], search.problem.work - before))
    (full, full_work), (chord, chord_work) = found
    assert chord == pytest.approx(full, rel=0.01) and full == pytest.approx(0.02, rel=0.1)
    assert chord_work < full_work


def test_work_counts_what_a_step_of_an_axis_takes(tmp_path):
    """A friction by the load is found by a second pass; with free play the lanes of a batch wait for one another."""
    problem = Problem(read_case(write_axis_case(tmp_path / "case", "inertia", "voltage")), 1)
    work = {}
    for name, changes in {"plain": {}, "play": {"backlash": 0.01}, "load": {"load_share": 0.1}}.items():
        model, before = problem.nominal.copy(), problem.work
        model.declare(**changes)
        problem.residuals([model], [model.step_s])
        work[name] = problem.work - before
    assert work["plain"] < work["load"] < work["play"]


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_a_replay_is_the_same_to_the_bit_on_any_number_of_cores(count):
    """Of two explanations that are as good as each other the last digit of a replay chooses."""
    case = make_case(lambda m: m.put("coulomb", 0.004))
    found = []
    for threads in (1, 2, 8):
        problem = Problem(case, threads)
        model = problem.nominal.copy()
        model.put("coulomb", 0.003)
        residuals = problem.residuals([model] * count)
        found.append((*(one.tobytes() for one in residuals), problem.gap(model)))
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize("quick", [True, False])
def test_a_report_says_that_a_search_ended_early(quick):
    assert said_of_end(SimpleNamespace(ended=False, quick=quick)) == []
    (note,) = said_of_end(SimpleNamespace(ended=True, quick=quick))
    assert "before it was done" in note and ("without --quick" in note) == quick


@pytest.mark.parametrize("moved", [0.0, 0.3], ids=["as thought", "elsewhere"])
def test_where_runs_began_elsewhere_the_effect_that_led_there_is_weighed_against_the_others(monkeypatch, moved):
    """A gyro's gain promises most while headings are wrong, and sets them right: by these a driver's gain explains
    more.
    """
    weak = make_case(lambda m: (m.scale("voltage_gain", 0.9, (0,)), m.scale("gyro_gain", 1.1)))
    search = Search(Problem(weak), quick=True)
    gyro, driver = ("gyro_gain", "both"), ("driver_gain", "left")
    nothing = search.store.fits[()] = search.store.nuisances_only()
    promised = iter([gyro, driver])
    aligned = iter([moved])

    def extend(fit):
        cause = next(promised, None) if fit.hypothesis == () else None
        return cause and search.store.try_fit((cause,), scaled(search.store.effects, (cause,), [{"ratio": 0.95}]), fit)

    monkeypatch.setattr(search, "extend", extend)

    def started(model):
        angle = next(aligned, 0.0)
        return model.start.with_headings({"no run": angle}) if angle else model.start

    monkeypatch.setattr(search.problem, "aligned", started)
    found = search.select_forward(nothing)
    assert found.hypothesis == ((driver,) if moved else (gyro,))
