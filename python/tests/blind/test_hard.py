"""Cases as hard as measured machines: every part of another form, loose constants, and a gap that no name closes."""

import math

import numpy as np
import pytest

from rtds_host.blind import hard, machines, planar, scales, seal, unnamed
from rtds_host.blind.score import judge
from rtds_host.blind.vocabulary import EFFECTS, FAMILIAR, OUTSIDE, UNMODELLED
from rtds_host.contract import builtin_robot, read_case

ROBOT = builtin_robot("burger")
OF = scales.scale_of(ROBOT, 0.01, 16.0)
ENTRY = {"seconds": 1.0, "said": "", "case": "case-001"}


def axis_of(kind="inertia"):
    """`robot.toml` of an axis that is driven by voltage."""
    return next(
        text
        for text in (machines.draw_machine(np.random.default_rng(k), kind) for k in range(50))
        if machines.robot_of(text).driver.mode != "torque"
    )


@pytest.fixture(scope="module")
def spec():
    """A case on an axis with short runs, drawn as the tier draws it."""
    old, hard.draw_machine = hard.draw_machine, lambda rng: ("inertia", (0.5, 0.9))
    try:
        for seed in range(15, 25):
            made = {"tier": "hard", "tolerance": True, "outside": None, "rest": None, "jitter": 0.0}
            hard.draw_case(np.random.default_rng(seed), made)
            if machines.robot_of(made["robot"]).driver.mode != "torque":
                return made
        raise AssertionError("no axis that is driven by voltage")
    finally:
        hard.draw_machine = old


def test_the_best_fit_of_the_catalogue_leaves_two_to_ten_times_the_noise(spec):
    truth = hard.account(spec)
    assert hard.LEFT_GAP[0] <= truth["gap"]["known"] <= hard.LEFT_GAP[1]
    assert truth["gap"]["before"] > 1.5 * truth["gap"]["known"]
    assert truth["held_out_gap"]["known"] > 1.0


def test_every_effect_of_a_hard_case_outweighs_what_no_name_closes(spec):
    truth = hard.account(spec)
    known = truth["gap"]["known"] ** 2 - 1
    assert 1 <= len(truth["effects"]) <= 2
    for effect in truth["effects"]:
        assert effect["id"] in EFFECTS and effect["id"] not in hard.CALIBRATED
        assert effect["gap_without"] ** 2 - 1 > 1.9 * known
    for form in truth["forms"]:
        if form["matters"]:
            assert form["names"] and form["gap_without"] ** 2 - 1 > 1.9 * known


def test_names_make_up_for_a_part_of_what_a_form_changes_and_never_for_more(spec):
    robot = machines.robot_of(spec["robot"])
    truth = hard.Truth(np.random.default_rng(0), robot, spec, spec["runs"])
    beyond, changed = {}, {}
    for form in hard.account(spec)["forms"]:
        less = {**spec, "forms": [other for other in spec["forms"] if other["id"] != form["id"]]}
        change = truth.errors(planar.build_machine(robot, less, np.random.default_rng(0)))
        changed[form["id"]], beyond[form["id"]] = float(change @ change), form["gap_beyond_names"] ** 2 - 1.0
    assert set(beyond) == {form["id"] for form in spec["forms"]}
    for name, part in beyond.items():
        assert -1e-3 <= part <= 1.001 * changed[name] + 1e-3, name
    assert 0.0 < beyond["power_drag"] < 0.5 * changed["power_drag"]  # viscous and dry friction are most of it


def test_constants_are_off_by_what_the_file_declares(spec):
    robot = machines.robot_of(spec["robot"])
    sigma = robot.tolerance_of("resistance_ohm")
    assert 0.1 <= sigma <= 0.4 and robot.tolerance_of("inertia_kg_m2") > 0
    machine = planar.build_machine(robot, {**spec, "effects": [], "forms": []}, np.random.default_rng(0))
    ratio = machine.side[planar.SIDE_NAMES.index("resistance"), 0] / robot.motor.resistance_ohm
    assert ratio == pytest.approx(spec["constants"]["l"]["resistance_ohm"])
    assert abs(math.log(ratio)) < 2.2 * math.sqrt(math.log1p(sigma**2))
    load = machine.world[planar.WORLD_NAMES.index("wheel_inertia")] / robot.axis.inertia_kg_m2
    assert load == pytest.approx(spec["constants"]["whole"]["inertia_kg_m2"])
    assert machine.tolerance["l"]["resistance_ohm"] == pytest.approx(ratio * robot.motor.resistance_ohm)


def test_a_pendulums_wrong_mass_swings_and_weighs_alike():
    text, ratios = hard.loosened(np.random.default_rng(3), axis_of("pendulum"))
    robot = machines.robot_of(text)
    machine, plain = planar.nominal_machine(robot), planar.nominal_machine(robot)
    planar.put_ratios(machine, ratios, robot)
    weight = planar.WORLD_NAMES.index("pendulum")
    assert machine.world[weight] / plain.world[weight] == pytest.approx(ratios["whole"]["mass_kg"])


def test_a_fit_finds_constants_that_are_all_that_differs():
    """With no form and no effect the nearest machine is the truth itself."""
    text, ratios = hard.loosened(np.random.default_rng(5), axis_of())
    robot = machines.robot_of(text)
    spec = {"constants": ratios, "tolerance": True, "effects": [], "outside": None, "forms": [], "missing": []}
    run = {"name": "steps", "plan": 4, "payload_kg": 0.0, "slope_rad": 0.0, "uphill_yaw_rad": 0.0, "duration": 0.8}
    spec |= {"rate": 500.0, "machine": "inertia", "drive": 0.8}
    truth = hard.Truth(np.random.default_rng(0), robot, spec, [run])
    known = hard.nearest(robot, ratios, [], [])
    assert np.abs(truth.errors(known.machine(np.zeros(len(known.knobs))))).max() == 0.0
    wrong = {**ratios, "l": {name: 1.0 for name in ratios["l"]}, "whole": {"inertia_kg_m2": 1.0}}
    model = hard.nearest(robot, wrong, [], [])
    fit = hard.fitted(model, truth.errors)
    again = hard.fitted(model, truth.errors, fit.at)
    assert again.left < 0.02 * np.sum(truth.errors(model.machine(np.zeros(len(model.knobs)))) ** 2)


def test_a_form_whose_nearest_effect_stands_for_another_form_changes_nothing_itself():
    """A delay of the commands takes what a filter lacks of a moving mean, where the tick itself is of no account: it is
    a half of the log's period, and rows set the commands.
    """
    text, ratios = hard.loosened(np.random.default_rng(5), axis_of())
    robot = machines.robot_of(text)
    mean = {"id": "speed_mean", "side": "left", "parameters": {"mean_s": 0.06}}
    tick = {"id": "sampled_commands", "side": "left", "parameters": {"tick_s": 0.001}}
    made = {
        "constants": ratios,
        "tolerance": True,
        "effects": [],
        "outside": None,
        "forms": [mean, tick],
        "rate": 500.0,
    }
    made |= {"missing": ["i", "v_bus", "gyro_z", "pose"], "machine": "inertia", "drive": 0.8}
    run = {"payload_kg": 0.0, "slope_rad": 0.0, "uphill_yaw_rad": 0.0, "duration": 0.8}
    runs = [{**run, "name": "steps", "plan": 4}, {**run, "name": "prbs", "plan": 5}]
    truth = hard.Truth(np.random.default_rng(0), robot, made, runs)
    model = hard.nearest(robot, ratios, made["forms"], [])
    fit = hard.fitted(model, truth.errors, rounds=hard.LEAST_ROUNDS)

    def own(left: list, cause: str) -> float:
        less = planar.build_machine(robot, {**made, "forms": left}, np.random.default_rng(0))
        return hard.own_change(model, fit, truth.errors(less), cause)

    assert (
        hard.without(model, truth.errors, fit, "sampled_commands")
        > 2.0 * fit.left
        > 100.0 * own([mean], "sampled_commands")
    )
    assert (
        hard.without(model, truth.errors, fit, "speed_mean") > 2.0 * fit.left and own([tick], "speed_mean") > fit.left
    )


def test_sensors_are_scaled_and_nothing_else():
    text = axis_of()
    louder = machines.robot_of(hard.with_noise(text, 3.0))
    assert louder.noise("w_l") == pytest.approx(3.0 * machines.robot_of(text).noise("w_l"), rel=1e-3)
    assert louder.motor == machines.robot_of(text).motor
    table = '[sensors]  # of all\nencoder = "motor"\nw_rad_s = 0.02  # noise\n[supply]\nvoltage_v = 12.0\n'
    assert hard.with_noise(table, 2.0) == table.replace("0.02", "0.04")


# ---- the forms -----------------------------------------------------------------------------------


def test_a_brush_film_drops_less_at_a_small_current():
    p = np.zeros(len(unnamed.SIDE))
    p[unnamed.FILM_VOLTS], p[unnamed.FILM_AMPS] = 0.6, 0.2

    def drop(amps):
        return (unnamed.resistance(p, 2.0, amps, 0.0) - 2.0) * amps

    assert drop(2.0) == pytest.approx(0.6, rel=1e-3) and drop(0.2) == pytest.approx(0.6 * (1 - math.exp(-1)))
    assert drop(0.02) < 0.1 * 0.6 and drop(-2.0) == pytest.approx(-0.6, rel=1e-3)


def test_flux_falls_with_the_current_and_stays_low_once_a_magnet_is_weakened():
    p, state = np.zeros(len(unnamed.SIDE)), np.zeros(unnamed.STATES)
    p[unnamed.DROOP], p[unnamed.DROOP_AMPS] = 0.2, 1.0
    p[unnamed.DEMAGNETISED], p[unnamed.DEMAGNETISE_AMPS] = 0.1, 5.0
    assert unnamed.flux(p, state, 0.0) == 1.0 and unnamed.flux(p, state, 1.0) == pytest.approx(0.9)
    unnamed.flux(p, state, 6.0)
    assert unnamed.flux(p, state, 0.0) == pytest.approx(0.9)


def test_elements_slip_one_after_the_other_and_return_on_another_way():
    p, state = np.zeros(len(unnamed.SIDE)), np.zeros(unnamed.STATES)
    p[unnamed.SLIP_TORQUE], p[unnamed.SLIP_RAD] = 1.0, 0.01
    there = [unnamed.torque(p, state, 1e-3, 1.0) for _ in range(200)]
    assert there[0] < 0 and there[5] > there[50] > there[-1] == pytest.approx(-1.0)
    back = [unnamed.torque(p, state, 1e-3, -1.0) for _ in range(400)]
    assert back[10] > there[-11] + 0.4 and back[-1] == pytest.approx(1.0)


def test_a_moving_mean_and_a_slow_tick_of_the_driver_are_what_they_say():
    t = np.round(np.arange(0, 2.0, 0.01), 4)
    volts = np.where(t < 0.5, 0.0, 8.0)[:, None] * np.ones(2)
    out = {}
    for name, key, value in (("plain", "mean_s", 0.0), ("mean", "mean_s", 0.1), ("tick", "tick_s", 0.3)):
        machine = planar.nominal_machine(ROBOT)
        machine.set(key, value)
        out[name] = planar.run_machine(machine, t, volts.copy(), np.zeros(5), 0.0, 0.0, 0.0)
    behind = (out["plain"]["th_l"][60] - out["plain"]["th_l"][50]) / 0.1
    assert out["mean"]["w_l"][60] == pytest.approx(behind, rel=1e-3)
    assert out["mean"]["th_l"] == pytest.approx(out["plain"]["th_l"], abs=1e-9)
    assert np.abs(out["tick"]["w_l"][t < 0.6]).max() == 0.0 and out["tick"]["w_l"][-1] > 1.0


def test_switching_shows_most_at_half_duty_and_not_at_all_at_full():
    t = np.round(np.arange(0, 4.0, 0.01), 4)
    spread = {}
    for volts in (6.0, 12.0):
        machine, plain = planar.nominal_machine(ROBOT), planar.nominal_machine(ROBOT)
        form = {"id": "switching_ripple", "side": "both", "parameters": {"ripple_amps": 0.05, "ripple_hz": 7.0}}
        planar.apply_outside(machine, form)
        both = [
            planar.run_machine(m, t, np.full((t.size, 2), volts), np.zeros(5), 0, 0, 0)["i_l"] for m in (machine, plain)
        ]
        spread[volts] = np.abs(both[0] - both[1]).max()
    assert spread[6.0] == pytest.approx(0.05, rel=0.1) and spread[12.0] == 0.0


def test_a_stalled_link_lets_the_last_command_act():
    t = np.round(np.arange(0, 3.0, 0.01), 4)
    volts = np.where((t * 4).astype(int) % 2 == 0, 6.0, -6.0)[:, None] * np.ones(2)
    machine, plain = planar.nominal_machine(ROBOT), planar.nominal_machine(ROBOT)
    planar.apply_outside(machine, {"id": "link_stalls", "side": "both", "parameters": {"stalls": 1, "stall_s": 0.4}})
    late, free = (planar.run_machine(m, t, volts.copy(), np.zeros(5), 0, 0, 0, seed=3) for m in (machine, plain))
    differs = np.flatnonzero(np.abs(late["w_l"] - free["w_l"]) > 0.5)
    assert 10 < differs.size < 120


# ---- what is drawn, sealed and scored ---------------------------------------------------------------


def test_no_unmodelled_effect_that_is_drawn_is_one_that_the_diagnoser_has_a_signature_of():
    drawn = {scales.draw_unmodelled(np.random.default_rng(k), OF)["id"] for k in range(300)}
    drawn |= {scales.draw_outside(np.random.default_rng(k), OF)["id"] for k in range(300)}
    assert not drawn & set(FAMILIAR) and len(drawn) >= 24
    assert not set(FAMILIAR) & (set(OUTSIDE) | set(UNMODELLED))


def test_a_hard_case_is_sealed_and_read_like_the_others(tmp_path, monkeypatch, spec):
    monkeypatch.setattr(hard, "draw_case", lambda rng, made: made.update(spec, colour=(0.0, 0.0)))
    seal.make(tmp_path, 1, ["hard"], ["planar"], seed=3, jobs=1)
    truth = seal.check_truths(tmp_path)["case-001"]
    case = read_case(tmp_path / "public" / "case-001")
    assert len(case.runs) == len(spec["runs"]) and case.robot.tolerance["motor"] >= 0.1
    assert truth["tier"] == "hard" and {form["id"] for form in truth["forms"]} == set(hard.FORMS)
    text = "".join(p.read_text() for p in (tmp_path / "public" / "case-001").rglob("*.toml"))
    assert not any(form in text for form in hard.FORMS)


def test_a_form_is_reached_by_its_nearest_names_and_none_of_them_is_false():
    form = {"id": "presliding", "side": "left", "names": ["coulomb_friction", "stribeck_friction"], "matters": True}
    effect = {
        "id": "speed_gain",
        "side": "left",
        "subsystem": "sensing",
        "parameters": {"ratio": 1.2},
        "gap_without": 4.0,
    }
    truth = {"tier": "hard", "verdict": "known", "effects": [effect], "forms": [form]}

    def says(*names):
        effects = [{"id": name, "side": "left", "probability": 0.9, "parameters": {}} for name in names]
        return judge(truth, {"verdict": "partial", "effects": effects}, ENTRY)

    both = says("speed_gain", "coulomb_friction")
    assert [item[-1] for item in both["asked"]] == [True, True] and not both["extra_cause"] and both["verdict_right"]
    one = says("speed_gain", "supply_sag")
    assert [item[-1] for item in one["asked"]] == [True, False] and one["extra_cause"]
    assert [item[-1] for item in one["named"]] == [True, False]
