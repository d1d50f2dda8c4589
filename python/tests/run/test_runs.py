"""The loop as a whole, on the bit-exact model: paths, currents, energies, logs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rtds_host.contract import RunMeta, read_run
from rtds_host.errors import InputError
from rtds_host.link import open_link
from rtds_host.robot import available_engines, make_body
from rtds_host.run import LinkChoice, Options, SignalPath, drive_with, figure, make_plan, perform, write_outcome
from rtds_host.run.energy import audit
from rtds_host.run.log import log_columns
from rtds_host.run.summary import lines

MODEL = LinkChoice("model")
# Position m, yaw deg at the end.
BOUNDS = {"linear": (0.010, 0.5), "circle": (0.020, 1.0), "eight": (0.020, 1.0)}
END = {"linear": (4.0, 0.0, 0.0), "circle": (0.0, 0.0, 2 * math.pi), "eight": (0.0, 0.75, 0.0)}


@pytest.fixture(scope="module")
def outcomes():
    """The three scenarios with the paper's robot, each also with the other controller."""
    return {name: perform(make_plan(name, options=Options(robot="paper")), MODEL) for name in BOUNDS}


def short(name="linear", options=None, **values):
    defaults = {"linear": {"duration_s": 1.6, "length_m": 0.15, "ramp_s": 0.5, "stop_s": 0.5}}.get(name, {})
    return make_plan(name, {**defaults, **values}, options)


@pytest.mark.parametrize("name", BOUNDS)
def test_robot_ends_where_it_should(outcomes, name):
    last, (position, degrees) = outcomes[name].record.truth[-1], BOUNDS[name]
    x, y, yaw = END[name]
    assert math.hypot(last.x_m - x, last.y_m - y) < position
    assert abs(math.degrees(last.yaw_rad - yaw)) < degrees


@pytest.mark.parametrize("name", BOUNDS)
def test_speed_error_is_at_least_ten_times_below_the_papers_controller(outcomes, name):
    summary = outcomes[name].summary
    assert (summary.controller, summary.exchange_s) == ("exact", 0.032)
    assert (summary.compared_controller, summary.compared_exchange_s) == ("paper", 0.128)
    assert summary.compared_error_rms_rad_s > 10.0 * summary.speed_error_rms_rad_s


@pytest.mark.parametrize("name", BOUNDS)
def test_energy_balances_at_every_step_and_with_the_robot(outcomes, name):
    summary = outcomes[name].summary
    drawn = np.subtract(summary.drawn_j, summary.recovered_j)
    spent = np.sum(
        [summary.copper_j, summary.viscous_j, summary.shaft_j, summary.stored_j, summary.numerical_j], axis=0
    )
    scale = np.max(np.abs([summary.drawn_j, summary.viscous_j, summary.shaft_j]), axis=0)
    assert np.all(np.abs(drawn - spent) < 1e-5 * scale)
    assert summary.energy_imbalance < 1e-5
    assert abs(summary.robot_energy_gap) < 5e-3
    assert summary.model_agrees


def test_what_backward_euler_damps_away_is_nothing_next_to_the_rest(outcomes):
    for outcome in outcomes.values():
        assert np.all(np.abs(outcome.summary.numerical_j) < 1e-3 * np.array(outcome.summary.drawn_j))


def test_robot_gains_the_hill_it_has_gone_down(outcomes):
    gained = outcomes["linear"].record.engine_energy_j
    assert gained == pytest.approx(-3.0 * 9.80665 * 4.0 * math.sin(0.1), rel=1e-3)


def test_on_the_circle_the_left_current_turns_negative_for_seconds_and_the_right_does_not(outcomes):
    record = outcomes["circle"].record
    below = record.t_s[record.currents[:, 0] < 0.0]
    assert 2.0 < len(below) * 1e-3 < 8.0
    assert 12.0 < below[0] and below[-1] < 22.0, "as it goes downhill"
    assert np.all(record.currents[:, 1] >= 0.0)


def test_on_the_eight_both_motors_brake(outcomes):
    assert min(outcomes["eight"].summary.current_negative_s) > 0.5
    assert min(outcomes["eight"].summary.recovered_j) > 0.0


def test_steps_an_exchange_are_counted(outcomes):
    assert outcomes["linear"].summary.step_ratio == pytest.approx(3200)


def test_log_says_what_acted_and_when(outcomes):
    """Putting a log's voltages and the recorded torques through a motor once more gives the log's speeds."""
    record, columns = outcomes["circle"].record, log_columns(outcomes["circle"].record)
    assert columns["t"][:3].tolist() == [0.0, 0.008, 0.016]
    assert np.all(np.diff(columns["t"]) > 0) and columns["t"][-1] == 24.0
    for row in (0, 4, 1000, 2996):
        exchange = row // 4
        assert columns["v_cmd_l"][row : row + 4].tolist() == [record.commanded[exchange, 0]] * 4
        assert columns["w_l"][row] == record.speeds[round(columns["t"][row] * 1e3), 0], "just before v_cmd acts"
    assert columns["w_l"][0] == columns["i_l"][0] == columns["th_l"][0] == 0.0
    assert np.all(columns["v_cmd_r"] == columns["v_cmd_r"].astype(np.float32)), "exact in single precision"


def test_wheel_angle_is_the_integral_of_speed_and_drives_the_path(outcomes):
    columns = log_columns(outcomes["linear"].record)
    assert 0.033 * columns["th_l"][-1] == pytest.approx(columns["x"][-1], abs=1e-4)


def test_run_folder_is_the_contracts(tmp_path, outcomes):
    write_outcome(outcomes["linear"], tmp_path / "linear")
    run = read_run(tmp_path / "linear", outcomes["linear"].plan.robot, need_measured=True)
    assert run.meta == RunMeta("linear", 2.0, 0.1, math.pi, run.meta.notes)
    assert run.notices == ()
    assert {p.name for p in (tmp_path / "linear").iterdir()} == {
        "run.json",
        "log.csv",
        "robot.toml",
        "summary.json",
        "figure.png",
        "figure.pdf",
    }
    written = log_columns(outcomes["linear"].record)
    for name in ("v_cmd_l", "w_r", "i_l", "x", "yaw"):
        assert run.columns[name] == pytest.approx(written[name], rel=1e-8, abs=1e-300)


def test_figure_has_the_papers_six_panels(tmp_path, outcomes, monkeypatch):
    kept = []
    monkeypatch.setattr(figure, "save", lambda drawn, *_, **__: kept.append(drawn))
    figure.draw(outcomes["eight"].plan, outcomes["eight"].record, tmp_path)
    titles = [axis.get_title()[:3] for axis in kept[0].axes if axis.get_title()]
    assert titles == ["(a)", "(b)", "(c)", "(d)", "(e)", "(f)"]


def test_same_plan_gives_the_same_bytes(tmp_path):
    for name in ("one", "two"):
        write_outcome(perform(short(), MODEL, compare=False), tmp_path / name)
    for file in ("log.csv", "run.json", "figure.png", "figure.pdf"):
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes(), file


def test_rtl_and_model_give_the_same_log(tmp_path):
    """Every step in RTL; the three scenarios at full length are among the long tests."""
    for link in (LinkChoice("rtl", {"sim": "verilator", "step_clocks": "min"}), MODEL):
        outcome = perform(short(), link, compare=False)
        assert outcome.summary.model_agrees
        write_outcome(outcome, tmp_path / link.name, figure=False)
    assert (tmp_path / "rtl" / "log.csv").read_bytes() == (tmp_path / "model" / "log.csv").read_bytes()


@pytest.mark.long
@pytest.mark.parametrize("name", BOUNDS)
def test_rtl_and_model_give_the_same_log_over_a_whole_scenario(tmp_path, name):
    plan = make_plan(name, options=Options(robot="paper"))
    for link in (LinkChoice("rtl", {"sim": "verilator", "step_clocks": "min"}), MODEL):
        write_outcome(perform(plan, link, compare=False), tmp_path / link.name, figure=False)
    assert (tmp_path / "rtl" / "log.csv").read_bytes() == (tmp_path / "model" / "log.csv").read_bytes()


@pytest.mark.long
def test_icarus_gives_the_same_log_too(tmp_path):
    for link in (LinkChoice("rtl", {"sim": "icarus", "step_clocks": "min", "timeout_s": 120.0}), MODEL):
        write_outcome(
            perform(short(duration_s=0.128, length_m=0.002, ramp_s=0.05, stop_s=0.05), link, compare=False),
            tmp_path / link.name,
            figure=False,
        )
    assert (tmp_path / "rtl" / "log.csv").read_bytes() == (tmp_path / "model" / "log.csv").read_bytes()


@pytest.mark.long
@pytest.mark.parametrize("engine", available_engines())
@pytest.mark.parametrize("name", BOUNDS)
def test_default_robot_keeps_the_bounds_in_both_engines(name, engine):
    outcome = perform(make_plan(name, options=Options(engine=engine)), MODEL)
    position, degrees = BOUNDS[name]
    summary = outcome.summary
    assert summary.end_position_error_m < position
    assert abs(math.degrees(summary.end_yaw_error_rad)) < degrees
    assert summary.compared_error_rms_rad_s > 10.0 * summary.speed_error_rms_rad_s
    assert summary.energy_imbalance < 1e-5 and abs(summary.robot_energy_gap) < 5e-3


@pytest.mark.skipif(len(available_engines()) < 2, reason="PyBullet has no wheel for this Python")
def test_engines_agree_on_a_run():
    gap = perform(short(), MODEL, compare=False, against="mujoco").summary.engine_gap
    assert gap.engine == "mujoco"
    assert gap.end_position_m < 2e-5 and abs(gap.end_yaw_rad) < 1e-5
    assert gap.speed_rms_rad_s < 1e-4 and gap.current_rms_a < 1e-5 and gap.load_rms_nm < 1e-4


def test_paper_coupling_lets_the_robot_follow_the_reference_and_the_motors_next_to_it():
    plan = short(options=Options(coupling="paper", controller="paper"))
    record = drive_with(plan, "model")
    assert record.truth[-1].x_m == pytest.approx(0.15, abs=1e-5), "whatever the motors do"
    closed = drive_with(short(options=Options(controller="paper")), "model")
    assert np.abs(record.speeds - record.references).max() == pytest.approx(
        np.abs(closed.speeds - closed.references).max(), rel=0.3
    )


def test_voltages_are_held_as_the_log_says_in_an_open_loop_run():
    plan = make_plan("steps", {"stretch": 0.2})
    record = drive_with(plan, "model")
    columns = log_columns(record)
    assert (plan.exchange_s, plan.controller, record.references) == (0.002, None, None)
    asked = plan.motion.voltages(columns["t"][:-1])
    logged = np.column_stack([columns["v_cmd_l"], columns["v_cmd_r"]])[:-1]
    assert np.array_equal(logged, asked.astype(np.float32))
    assert "w_ref_l" not in columns
    assert audit(plan, record).imbalance < 1e-5


def test_standing_on_a_slope_without_voltage_the_robot_rolls():
    record = drive_with(make_plan("standstill", {"duration_s": 1.0}, Options(slope_rad=0.1)), "model")
    assert record.truth[-1].x_m < -1e-3


def test_last_exchange_may_be_shorter():
    record = drive_with(short(options=Options(controller="paper"), duration_s=1.0, length_m=0.05), "model")
    assert (record.ends - record.starts).tolist() == [128] * 7 + [104]
    assert record.t_s[record.rows][-1] == 1.0


def ringing(payload_kg):
    """Largest change of acceleration from one millisecond to the next, rad/s, long after the last step of voltage,
    with an exchange each millisecond and the check left out."""
    plan = make_plan("steps", {"stretch": 0.1, "peak_v": 2.0}, Options(exchange_s=0.001))
    plan = replace(plan, body=make_body(plan.robot, payload_kg))
    return np.abs(np.diff(drive_with(plan, "model").speeds, n=2, axis=0))[-40:].max()


def test_split_is_quiet_at_the_limit_and_rings_above_one():
    """0.8 of the rotor's inertia at 8.7 kg of payload, 1.23 at 14 kg: there only slipping tyres bound it."""
    assert ringing(8.7) < 1e-3
    assert ringing(14.0) > 0.1


@pytest.fixture(scope="module")
def low_geared(tmp_path_factory):
    """Path of a robot whose rotors are 200 times lighter than the burger's: its body outweighs them 50 times."""
    from rtds_host.contract import builtin_robot_path

    place = tmp_path_factory.mktemp("robot") / "robot.toml"
    text = builtin_robot_path("burger").read_text()
    assert "rotor_inertia_kg_m2 = 1.0e-7 " in text
    place.write_text(text.replace("rotor_inertia_kg_m2 = 1.0e-7 ", "rotor_inertia_kg_m2 = 5.0e-10 "))
    return str(place)


@pytest.mark.parametrize("engine", available_engines())
def test_a_robot_of_low_gearing_drives_and_its_energy_balances_as_tightly(low_geared, engine):
    plan = short(options=Options(robot=low_geared, engine=engine))
    assert plan.split.ratio > 40.0
    record = drive_with(plan, "model")
    found = audit(plan, record)
    assert found.imbalance < 1e-5 and abs(found.robot_gap) < 5e-4 and found.same
    assert record.truth[-1].x_m == pytest.approx(0.15, abs=1e-3)
    # What its units carry is the robot's: nothing but 1/200 of the burger's own rotors is stored at speed.
    assert np.all(np.abs(found.terms.stored_j) < 1e-5 * np.abs(found.terms.shaft_j).max())


def test_a_robot_of_low_gearing_comes_to_rest_without_ringing(low_geared):
    plan = make_plan("steps", {"stretch": 0.1, "peak_v": 1.0}, Options(robot=low_geared, exchange_s=0.002))
    assert np.abs(np.diff(drive_with(plan, "model").speeds, n=2, axis=0))[-40:].max() < 1e-3


@pytest.mark.parametrize("engine", available_engines())
def test_a_robot_that_is_thrown_off_its_wheels_is_refused_not_simulated(low_geared, engine):
    """8 V one way and 8 V the other: 160 m/s^2, at which the skids 0.25 m off cannot keep the wheels down."""
    plan = make_plan(
        "steps", {"stretch": 0.1, "peak_v": 8.0}, Options(robot=low_geared, exchange_s=0.002, engine=engine)
    )
    with pytest.raises(InputError, match="the wheels have lost the ground at"):
        drive_with(plan, "model")


def test_a_robot_of_low_gearing_has_the_same_log_in_rtl_and_model(tmp_path, low_geared):
    plan = short(options=Options(robot=low_geared), duration_s=0.64, length_m=0.02, ramp_s=0.2, stop_s=0.2)
    for link in (LinkChoice("rtl", {"sim": "verilator", "step_clocks": "min"}), MODEL):
        outcome = perform(plan, link, compare=False)
        assert outcome.summary.model_agrees
        assert dict(lines(outcome.summary))["inertia"].startswith("the body's at the wheel is 49.5 times the rotor's")
        write_outcome(outcome, tmp_path / link.name, figure=False)
    assert (tmp_path / "rtl" / "log.csv").read_bytes() == (tmp_path / "model" / "log.csv").read_bytes()


class Trimmed(SignalPath):
    """A driver that gives less, a wheel that reports too much, a load nobody told of."""

    def voltages(self, t_s, commanded_v, sample):
        return 0.5 * commanded_v

    def loads(self, t_s, torques_nm, sample):
        return torques_nm + np.array([0.01, 0.0])

    def sensors(self, t_s, sample):
        return replace(sample, speeds_rad_s=2.0 * sample.speeds_rad_s)


def test_signal_path_stands_between_controller_motors_robot_and_log():
    plan = make_plan("steps", {"stretch": 0.1})
    nominal, trimmed = drive_with(plan, "model"), drive_with(plan, "model", path=Trimmed(12.0))
    assert trimmed.applied == pytest.approx(0.5 * nominal.applied)
    assert log_columns(trimmed)["v_cmd_l"] == pytest.approx(log_columns(nominal)["v_cmd_l"])
    assert trimmed.shaft_torques[0, 0] - nominal.shaft_torques[0, 0] == pytest.approx(0.01 / 258.5, rel=1e-4)
    assert log_columns(trimmed)["w_l"] == pytest.approx(2.0 * trimmed.speeds[trimmed.rows, 0])


@pytest.mark.parametrize(
    "options, words",
    [
        (Options(robot="r2d2"), "robot 'r2d2': unknown .known: burger, paper, 3pi, create3, "),
        (Options(robot="jakal"), "robot 'jakal': unknown .*; did you mean 'jackal'"),
        (Options(robot="no/such.toml"), "no/such.toml: cannot be read"),
        (Options(controller="pid"), "controller 'pid': unknown"),
        (Options(coupling="loose"), "coupling 'loose': unknown .known: closed, paper"),
        (Options(engine="chaos"), "engine 'chaos': unknown"),
        (Options(exchange_s=0.0325), r"exchange: is 0\.0325 s, it must be a whole number of 0\.001 s"),
        (Options(exchange_s=-1.0), "exchange: is -1 s, it must be above 0"),
        (Options(log_s=0.005), r"log interval: is 0\.005 s, it must divide 0\.032 s"),
    ],
)
def test_a_plan_that_cannot_be_driven_is_refused(options, words):
    with pytest.raises(InputError, match=words):
        make_plan("linear", options=options)


def test_a_motor_beyond_any_is_named_before_the_run(tmp_path):
    from rtds_host.contract import builtin_robot_path

    text = builtin_robot_path("burger").read_text().replace("inductance_h = 1.0e-3", "inductance_h = 1.0e-40")
    (tmp_path / "robot.toml").write_text(text)
    with pytest.raises(InputError, match="inductance_h"):
        short(options=Options(robot=str(tmp_path / "robot.toml")))


def test_model_link_is_what_runs_are_made_with():
    with open_link("model") as link:
        assert link.step_s == 0.0
