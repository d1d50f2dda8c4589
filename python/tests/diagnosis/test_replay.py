"""The replay: the contract's nominal robot against scipy at tight tolerance, and what each effect does to it."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from axis_machine import write_axis_case
from diagnosis_cases import commands, make_case, make_run
from scipy.integrate import solve_ivp

from rtds_host.contract import GRAVITY_M_S2, Axis, Case, RunLog, RunMeta, Servo, builtin_robot, read_case
from rtds_host.diagnosis.effects import SIDES, SUBSYSTEMS, catalogue
from rtds_host.diagnosis.fit import apply
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.kernel import load_inertia
from rtds_host.diagnosis.replay.model import (
    FINE_STEP_S,
    LONGEST_DELAY_S,
    REPORT_STEP_S,
    STEP_S,
    ReplayBatch,
    nominal_model,
    piece_inputs,
    replay_run,
    row_inputs,
    run_inputs,
    stretch_inputs,
)
from rtds_host.diagnosis.replay.simd import SIMD_WIDTH
from rtds_host.diagnosis.replayer import shares_of
from rtds_host.diagnosis.residual import CHANNELS, run_residual
from rtds_host.diagnosis.screen import available, start_values
from rtds_host.plant import forms
from rtds_host.plant.elementary import sine
from rtds_host.plant.schema import OUTPUT_INDEX, OUTPUTS

ROBOT = builtin_robot("burger")
SERVO = Servo(kp_v_s_per_rad=0.44, ki_v_per_rad=8.6, limit_v=12.0, period_s=0.007)
CATALOGUE = catalogue(ROBOT)


def run(kind="steps", seconds=4.0, seed=3, slope=0.1, payload=1.0, uphill=0.4):
    t, v = commands(kind, seconds, seed)
    return RunLog(kind, RunMeta(kind, payload, slope, uphill), t, {"v_cmd_l": v[:, 0], "v_cmd_r": v[:, 1]})


def integrated(log, rates, state, **how):
    """States (n, len(state)) at the rows of a log, integrated by scipy from one command to the next."""
    rows = [state]
    for k in range(len(log.t) - 1):
        volts = np.array([log.columns["v_cmd_l"][k], log.columns["v_cmd_r"][k]])
        rows.append(solve_ivp(rates, log.t[k : k + 2], rows[-1], args=(volts,), **how).y[:, -1])
    return np.array(rows)


def scipy_reference(log):
    """The equations of the contract's section 2, integrated from one command to the next at 1e-10."""
    m, c = ROBOT.motor, ROBOT.chassis
    n, r, b = m.gear_ratio, c.wheel_radius_m, c.track_width_m
    mass = c.mass_kg + log.meta.payload_kg
    pull = mass * GRAVITY_M_S2 * math.sin(log.meta.slope_rad)
    spin = n * n * m.rotor_inertia_kg_m2 + c.wheel_inertia_kg_m2
    # Mass matrix of the two wheel speeds, the body's inertia seen through r and b.
    own, cross = r * r * (mass / 4 + c.yaw_inertia_kg_m2 / b**2), r * r * (mass / 4 - c.yaw_inertia_kg_m2 / b**2)
    inverse = np.linalg.inv([[spin + own, cross], [cross, spin + own]])

    def rates(_, s, v):
        il, ir, wl, wr = s[:4]
        yaw = s[8]
        current, w = np.array([il, ir]), np.array([wl, wr])
        di = (v - m.resistance_ohm * current - m.back_emf_constant_v_s_per_rad * n * w) / m.inductance_h
        torque = n * m.torque_constant_nm_per_a * current - n * n * m.viscous_friction_nm_s_per_rad * w
        dw = inverse @ (torque - r * pull * math.cos(yaw - log.meta.uphill_yaw_rad) / 2)
        speed, rate = r * (wl + wr) / 2, r * (wr - wl) / b
        return [*di, *dw, wl, wr, speed * math.cos(yaw), speed * math.sin(yaw), rate]

    s = integrated(log, rates, np.zeros(9), method="DOP853", rtol=1e-10, atol=1e-12)
    rate = r * (s[:, 3] - s[:, 2]) / b
    return np.column_stack([np.full(len(s), ROBOT.supply_v), s[:, :6], rate, s[:, 6:]])


@pytest.mark.parametrize("kind", ["steps", "weave", "spin"])
def test_nominal_replay_is_within_a_fraction_of_the_noise_of_scipy(kind):
    log = run(kind)
    reference = scipy_reference(log)
    for step, share in ((STEP_S, 0.3), (REPORT_STEP_S, 0.1)):
        out = replay_run(nominal_model(ROBOT), run_inputs(log, ROBOT), step)
        for name in ("i_l", "i_r", "w_l", "w_r", "gyro_z"):
            worst = np.abs(out[:, OUTPUT_INDEX[name]] - reference[:, OUTPUT_INDEX[name]]).max()
            assert worst < share * ROBOT.noise(name), (name, step, worst)
        for name in ("th_l", "th_r", "x", "y", "yaw"):
            worst = np.abs(out[:, OUTPUT_INDEX[name]] - reference[:, OUTPUT_INDEX[name]]).max()
            assert worst < ROBOT.noise(name), (name, step, worst)


def test_halving_the_step_brings_the_replay_four_times_nearer():
    log = run("steps")
    reference = scipy_reference(log)[:, OUTPUT_INDEX["w_l"]]
    errors = [
        np.sqrt(
            np.mean(
                (replay_run(nominal_model(ROBOT), run_inputs(log, ROBOT), h)[:, OUTPUT_INDEX["w_l"]] - reference) ** 2
            )
        )
        for h in (2e-3, 1e-3, 5e-4)
    ]
    assert errors[0] / errors[1] > 3.3 and errors[1] / errors[2] > 3.3


def test_a_bus_that_sags_is_that_of_its_differential_equation():
    log, source = run("steps", slope=0.0, payload=0.0), 0.3
    m, c = ROBOT.motor, ROBOT.chassis
    n, r, half = m.gear_ratio, c.wheel_radius_m, 0.5 * c.track_width_m
    spin = n * n * m.rotor_inertia_kg_m2 + c.wheel_inertia_kg_m2
    own, cross = (r * r / 4 * (c.mass_kg + sign * c.yaw_inertia_kg_m2 / half**2) for sign in (1, -1))
    inverse = np.linalg.inv([[spin + own, cross], [cross, spin + own]])

    def rates(_, s, volts):
        current, w = s[:2], s[2:]
        level = 1.0 - source * current @ volts / ROBOT.supply_v**2
        di = (volts * level - m.resistance_ohm * current - m.back_emf_constant_v_s_per_rad * n * w) / m.inductance_h
        return [
            *di,
            *inverse @ (n * m.torque_constant_nm_per_a * current - n * n * m.viscous_friction_nm_s_per_rad * w),
        ]

    s = integrated(log, rates, np.zeros(4), method="DOP853", rtol=1e-10, atol=1e-12)
    model = nominal_model(ROBOT)
    model.put("source_resistance", source)
    inputs = run_inputs(log, ROBOT)
    for step, share in ((STEP_S, 0.3), (REPORT_STEP_S, 0.1)):
        for out in (replay_run(model, inputs, step), ReplayBatch([inputs]).replay([model], [step])[0]):
            for k, name in enumerate(("i_l", "i_r", "w_l", "w_r")):
                worst = np.abs(out[:, OUTPUT_INDEX[name]] - s[:, k]).max()
                assert worst < share * ROBOT.noise(name), (name, step, worst)


def scipy_slip(log, slip, length, damping, grip):
    """Yaw rate (n,) rad/s and way (n,) m of a robot whose tyres slip: Pacejka's transient slip in its differential
    form.
    """
    m, c = ROBOT.motor, ROBOT.chassis
    n, r, half = m.gear_ratio, c.wheel_radius_m, 0.5 * c.track_width_m
    mass = c.mass_kg + log.meta.payload_kg
    pull = mass * GRAVITY_M_S2 * math.sin(log.meta.slope_rad)
    most = grip * 0.5 * mass * GRAVITY_M_S2
    spin = n * n * m.rotor_inertia_kg_m2 + c.wheel_inertia_kg_m2

    def rates(_, s, volts):
        current, w, z, (v, rate, yaw, _way) = s[:2], s[2:4], s[4:6], s[6:]
        dz = r * w - np.array([v - half * rate, v + half * rate]) - np.abs(r * w) * z / length
        force = most * np.tanh((z / (slip * length) + damping * dz) / most)
        di = (volts - m.resistance_ohm * current - m.back_emf_constant_v_s_per_rad * n * w) / m.inductance_h
        torque = n * m.torque_constant_nm_per_a * current - n * n * m.viscous_friction_nm_s_per_rad * w
        dv = (force.sum() - pull * math.cos(yaw - log.meta.uphill_yaw_rad)) / mass
        return [
            *di,
            *((torque - r * force) / spin),
            *dz,
            dv,
            half * (force[1] - force[0]) / c.yaw_inertia_kg_m2,
            rate,
            v,
        ]

    s = integrated(log, rates, np.zeros(10), method="LSODA", rtol=1e-8, atol=1e-10)
    return s[:, 7], s[:, 9]


@pytest.mark.parametrize(
    "slip,length,damping,grip",
    [
        (0.03, 0.002, 60.0, 0.9),  # reversals at full voltage exceed the grip
        (0.006, 0.011, 50.0, 4.0),  # a soft tyre that never slides
    ],
)
def test_slip_is_that_of_its_differential_equation(slip, length, damping, grip):
    log = run("steps", seconds=2.0, payload=0.0)
    for side, period in (("l", 0.3), ("r", 0.45)):
        log.columns[f"v_cmd_{side}"][:] = np.where(log.t // period % 2 == 0, 9.0, -7.0)
    model = nominal_model(ROBOT)
    CATALOGUE["longitudinal_slip"].apply(
        model,
        (0, 1),
        {"slip_per_newton": slip, "softness_m_per_n": slip * length, "damping_n_s_per_m": damping, "grip": grip},
    )
    rate, way = scipy_slip(log, slip, length, damping, grip)
    inputs = run_inputs(log, ROBOT)
    effect = replay_run(nominal_model(ROBOT), inputs)[:, OUTPUT_INDEX["gyro_z"]] - rate
    assert np.std(effect) > 3 * ROBOT.noise("gyro_z")
    for step, share in ((model.step_s, 0.05), (REPORT_STEP_S, 0.02)):
        out = replay_run(model, inputs, step)
        assert np.std(out[:, OUTPUT_INDEX["gyro_z"]] - rate) < share * np.std(effect)
        travelled = np.hypot(np.diff(out[:, 8]), np.diff(out[:, 9])).sum()
        assert travelled == pytest.approx(np.abs(np.diff(way)).sum(), abs=ROBOT.noise("x"))


def test_a_wheel_that_climbs_slowly_slips_by_the_share_the_contract_says():
    slope, payload, slip = 0.1, 1.0, 0.01
    log = run("steps", seconds=6.0, slope=slope, payload=payload, uphill=0.0)
    for side in "lr":
        log.columns[f"v_cmd_{side}"][:] = 6.0
    model = nominal_model(ROBOT)
    CATALOGUE["longitudinal_slip"].apply(
        model,
        (0, 1),
        {"slip_per_newton": slip, "softness_m_per_n": slip * 0.002, "damping_n_s_per_m": 50.0, "grip": 100.0},
    )
    out = replay_run(model, run_inputs(log, ROBOT))
    last = np.flatnonzero(log.t > 5.0)
    speed = np.polyfit(log.t[last], out[last, OUTPUT_INDEX["x"]], 1)[0]
    force = 0.5 * (ROBOT.chassis.mass_kg + payload) * GRAVITY_M_S2 * math.sin(slope)
    wheel = ROBOT.chassis.wheel_radius_m * out[last, OUTPUT_INDEX["w_l"]].mean()
    assert speed / wheel == pytest.approx(1.0 - slip * force, abs=1e-5)


@pytest.mark.parametrize("length", [0.0, 0.003])
@pytest.mark.parametrize("slip,grip", [(0.02, 0.9), (0.1, 0.9), (0.02, 0.4)])
def test_a_tyre_gives_no_more_than_its_grip_however_short_it_is(length, slip, grip):
    log = run("steps", seconds=2.0, slope=0.0, payload=1.0)
    for side in "lr":
        log.columns[f"v_cmd_{side}"][:] = np.where(log.t // 0.5 % 2 == 0, 12.0, -12.0)
    model = nominal_model(ROBOT)
    CATALOGUE["longitudinal_slip"].apply(
        model,
        (0, 1),
        {"slip_per_newton": slip, "softness_m_per_n": slip * length, "damping_n_s_per_m": 50.0, "grip": grip},
    )
    inputs = run_inputs(log, ROBOT)
    for step in (model.step_s, 1e-4):
        x = replay_run(model, inputs, step)[:, OUTPUT_INDEX["x"]]
        dt = log.t[2] - log.t[0]
        acceleration = np.abs(x[4:] - 2 * x[2:-2] + x[:-4]).max() / dt**2
        assert acceleration < 1.02 * grip * GRAVITY_M_S2


@pytest.mark.parametrize("change", [{"mass": 0.0}, {"mass": -0.05}, {"rotor_inertia": 0.0}, {"axis": 1.0}])
def test_a_spring_on_a_body_without_inertia_takes_the_finest_step(change):
    model = nominal_model(ROBOT)
    model.put("stiffness", 3.0)
    assert model.step_s > FINE_STEP_S
    for quantity, value in change.items():
        model.put(quantity, value)
    assert model.step_s == FINE_STEP_S


def effect_cases():
    return [(e.id, side) for e in CATALOGUE.values() for side in e.sides]


@pytest.mark.parametrize("effect,side", effect_cases())
def test_every_effect_is_absent_at_its_null_and_seen_at_its_start(effect, side):
    entry = CATALOGUE[effect]
    assert entry.subsystem in SUBSYSTEMS
    log = run("weave", slope=0.1, payload=2.0)
    # Standing still, crawling and braking from full speed, so that each effect has something to act on.
    log.columns["v_cmd_l"][100:140] = log.columns["v_cmd_r"][100:140] = 12.0
    inputs = run_inputs(log, ROBOT)
    nominal = replay_run(nominal_model(ROBOT), inputs)

    def with_values(values):
        model = nominal_model(ROBOT)
        entry.apply(model, SIDES[side], values)
        return replay_run(model, inputs)

    if effect not in ("gear_compliance", "voltage_limit"):  # their null is a bound at infinity
        null = with_values({p.name: p.null for p in entry.parameters})
        assert np.allclose(null, nominal, atol=1e-9)
    starts = start_values(entry) or [entry.within({"amplitude_nm": 0.02, "cycles_per_rev": 12.0, "phase_rad": 0.5})]
    noise = np.array([ROBOT.noise(name) for name in OUTPUTS])
    largest = max(np.abs((with_values(values) - nominal) / noise).max() for values in starts)
    assert largest > 1.0


PAIRS = [
    pair for pair in itertools.combinations(CATALOGUE.values(), 2) if start_values(pair[0]) and start_values(pair[1])
]


@pytest.mark.parametrize("side", ["right", "both"])
def test_any_two_effects_together_keep_the_replay_finite(side):
    # From a standstill too: one wheel that sticks next to a scrub has to be replayed as well.
    log = run("spin", seconds=2.0)
    inputs = run_inputs(log, ROBOT)
    for pair in PAIRS:
        model = nominal_model(ROBOT)
        for effect in pair:
            effect.apply(model, SIDES[side if effect.sided else "both"], start_values(effect)[-1])
        out = replay_run(model, inputs)
        assert np.abs(out[:, [OUTPUT_INDEX["w_l"], OUTPUT_INDEX["w_r"], OUTPUT_INDEX["gyro_z"]]]).max() < 100.0, pair


def test_the_sine_of_lanes_is_that_of_the_library_within_ten_thousand_turns():
    x = np.random.default_rng(2).uniform(-6e4, 6e4, 10000)
    assert max(abs(sine(v) - math.sin(v)) for v in x) < 1e-11


@pytest.mark.parametrize("side,mode", [("left", "voltage"), ("both", "voltage"), ("both", "torque"), ("left", "speed")])
def test_replays_in_a_batch_are_those_one_by_one(side, mode):
    robot = replace(ROBOT, driver=replace(ROBOT.driver, mode=mode, torque_nm_per_v=1e-4), servo=SERVO)
    logs = [run("steps", seconds=2.0), run("spin", seconds=3.0, slope=0.0), run("weave", seconds=1.0)]
    if mode == "speed":
        for log in logs:
            log.columns.update(w_cmd_l=log.columns["v_cmd_l"], w_cmd_r=log.columns["v_cmd_r"])
    inputs = [run_inputs(log, robot) for log in logs]
    # One that begins in motion, with speeds that are reported late.
    inputs[2][6][[5, 6, 9, 10]] = 3.0, 3.0, 2.0, 2.5
    models = [nominal_model(robot)]
    for pair in PAIRS:
        model = nominal_model(robot)
        for effect in pair:
            effect.apply(model, SIDES[side if effect.sided else "both"], start_values(effect)[-1])
        if len(models) % 3 == 0:
            model.put("speed_delay", 0.0137, SIDES[side])
        models.append(model)
    # One that runs away leaves those next to it as they are.
    models[1].put("mass", -1.0)
    noise = np.array([ROBOT.noise(name) for name in OUTPUTS])
    runs = ReplayBatch(inputs)
    for model, mine in zip(models, runs.replay(models), strict=True):
        for one, out in zip(inputs, np.split(mine, runs.rows[1:-1]), strict=True):
            alone = replay_run(model, one)
            assert np.abs((out - alone) / noise).max() < 1e-3


@pytest.mark.parametrize("mode", ["voltage", "torque", "speed"])
@pytest.mark.parametrize("kind", ["inertia", "pendulum", "linear"])
def test_replays_of_an_axis_in_a_batch_are_those_one_by_one(kind, mode, tmp_path):
    case = read_case(write_axis_case(tmp_path / "case", kind, mode))
    robot, problem = case.robot, Problem(case, 1, pieces=True)
    problem.follow_angles(True)
    inputs = [data.inputs for data in problem.runs]
    sizes = {e.id: e for e in available(problem) if start_values(e)}
    rng = np.random.default_rng(8)
    models = [nominal_model(robot)]
    for pair in itertools.combinations(sizes.values(), 2):
        model = nominal_model(robot)
        for effect in pair:
            effect.apply(model, SIDES["left"], start_values(effect)[rng.integers(len(start_values(effect)))])
        if len(models) % 3 == 0:
            model.declare(encoder_at_wheel=1.0)
        models.append(model)
    formed = nominal_model(robot)
    for row, (term, over) in zip(formed.forms[0], [("torque", "w"), ("torque", "load"), ("speed_sensor", "w")]):
        row[[forms.TERM, forms.OVER, forms.LOW, forms.HIGH]] = forms.TERM_CODE[term], forms.OVER_CODE[over], 0.0, 3.0
        forms.values_in(row)[:] = 0.01 * np.repeat([1.0, -1.0], forms.HALF)  # friction, with a jump at zero
    models.append(formed)
    # One that runs away leaves those next to it as they are.
    models[1].put("rotor_inertia", -1.01 * load_inertia(models[1].common, 0.0) / models[1].get("gear_ratio") ** 2)
    noise = np.array([robot.noise(name) or 1.0 for name in OUTPUTS])
    runs = ReplayBatch(inputs)
    assert len(models) > 100
    for k, (model, mine) in enumerate(zip(models, runs.replay(models), strict=True)):
        alone = runs.replay_alone(model, 0, len(inputs), model.step_s)
        assert (np.abs(mine - alone) / noise).max() < 1e-3 if k != 1 else mine.max() == 1e6, model


def test_a_body_that_cannot_be_runs_away_within_the_finite_numbers():
    model = nominal_model(ROBOT)
    model.put("com_y", 0.22)  # more than its yaw inertia allows
    out = replay_run(model, run_inputs(run("weave"), ROBOT))
    assert np.isfinite(out).all() and np.abs(out).max() < 1e9


def test_a_motor_below_its_breakaway_torque_stands_still_and_leaves_above_it():
    model = nominal_model(ROBOT)
    model.put("coulomb", 0.06)
    m = ROBOT.motor
    stall = 0.06 * m.resistance_ohm / (m.gear_ratio * m.torque_constant_nm_per_a)
    t = np.arange(0, 2.0, 0.01)
    for volts, moves in ((0.98 * stall, False), (1.02 * stall, True)):
        v = np.full(len(t), volts)
        log = RunLog("stall", RunMeta(), t, {"v_cmd_l": v, "v_cmd_r": v})
        w = replay_run(model, run_inputs(log, ROBOT))[:, OUTPUT_INDEX["w_l"]]
        assert (np.abs(w).max() > 0) == moves
        assert np.count_nonzero(np.diff(np.sign(w[w != 0]))) == 0, "chatters"


@pytest.mark.parametrize("delay", [0.003, 0.01, 0.0237])
def test_a_delayed_command_shifts_everything_and_a_delayed_measurement_all_but_the_pose(delay):
    log = run("weave", slope=0.0)
    fine = np.arange(0, log.t[-1], 0.001)
    smooth = {c: np.interp(fine, log.t, v) for c, v in log.columns.items()}
    inputs = run_inputs(RunLog("fine", log.meta, fine, smooth), ROBOT)
    nominal = replay_run(nominal_model(ROBOT), inputs, 1e-3)
    late = {}
    for quantity in ("command_delay", "measurement_delay"):
        model = nominal_model(ROBOT)
        model.put(quantity, delay)
        late[quantity] = replay_run(model, inputs, 1e-3)
    inside = fine > 0.1
    # Currents jump with the command: between samples they cannot be interpolated.
    whole = abs(delay / 0.001 - round(delay / 0.001)) < 1e-9 and round(delay / 0.001) % 10 == 0
    for name in ("w_l", "gyro_z", "i_r") if whole else ("w_l", "gyro_z"):
        k = OUTPUT_INDEX[name]
        shifted = np.interp(fine - delay, fine, nominal[:, k])
        for quantity in late:
            assert np.abs(late[quantity][inside, k] - shifted[inside]).max() < 0.5 * ROBOT.noise(name)
    assert np.allclose(late["measurement_delay"][:, 8:], nominal[:, 8:], atol=1e-6)
    assert np.abs(late["command_delay"][:, 8:] - nominal[:, 8:]).max() > ROBOT.noise("x")


def test_free_play_lets_the_encoder_run_ahead_by_its_angle_and_no_more():
    model = nominal_model(ROBOT)
    model.put("backlash", 0.1)
    log = run("steps", slope=0.0)
    inputs = run_inputs(log, ROBOT)
    played, tight = replay_run(model, inputs), replay_run(nominal_model(ROBOT), inputs)
    # Distance rolled over the wheel's radius is the wheel's angle; the encoder sits before the play.
    spin = ROBOT.chassis.track_width_m * played[:, 10] / ROBOT.chassis.wheel_radius_m
    ahead = (played[:, OUTPUT_INDEX["th_r"]] - played[:, OUTPUT_INDEX["th_l"]]) - spin
    assert 0.05 < np.abs(ahead).max() <= 0.1 + 1e-3
    spin = ROBOT.chassis.track_width_m * tight[:, 10] / ROBOT.chassis.wheel_radius_m
    assert np.abs(tight[:, 6] - tight[:, 5] - spin).max() < 1e-3


@pytest.mark.parametrize("angle", [0.02, 0.06, 0.1])
def test_long_steps_while_flanks_touch_change_little_of_what_free_play_does(angle):
    inputs = run_inputs(run("steps"), ROBOT)
    model = nominal_model(ROBOT)
    model.put("backlash", angle)
    fine = replay_run(model, inputs, 1e-4)
    moved = fine - replay_run(nominal_model(ROBOT), inputs, 1e-4)
    error = replay_run(model, inputs) - fine
    for k in (OUTPUT_INDEX["w_l"], OUTPUT_INDEX["w_r"]):
        assert np.std(error[:, k]) < 0.05 * np.std(moved[:, k])


@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.7])
def test_flanks_part_after_an_impact_at_the_stated_share_of_the_speed_at_which_they_met(restitution):
    t = np.arange(0.0, 0.2, 5e-4)
    v = np.full(len(t), 6.0)
    log = RunLog("kick", RunMeta(scenario="kick"), t, {"v_cmd_l": v, "v_cmd_r": v})
    model = nominal_model(ROBOT)
    model.put("backlash", 0.08)
    model.put("restitution", restitution)
    out = replay_run(model, run_inputs(log, ROBOT))
    wheel = np.gradient(out[:, OUTPUT_INDEX["x"]], t) / ROBOT.chassis.wheel_radius_m
    rotor = out[:, OUTPUT_INDEX["w_l"]]
    before = int(np.argmax(wheel > 0.05))  # the last sample before the blow
    met, rotor_after, wheel_after = rotor[before], rotor[before + 1], wheel[before + 3]
    gained = 2 * (rotor[before] - rotor[before - 1])  # by the motor, over the samples between
    assert wheel_after - rotor_after == pytest.approx(restitution * met, abs=gained)
    body = ROBOT.chassis
    load = 0.5 * body.mass_kg * body.wheel_radius_m**2 + body.wheel_inertia_kg_m2
    inertia = ROBOT.motor.gear_ratio**2 * ROBOT.motor.rotor_inertia_kg_m2
    assert inertia * rotor_after + load * wheel_after == pytest.approx(inertia * met, abs=inertia * gained)


def test_both_sides_are_the_two_sides_together_where_the_effect_is_linear():
    inputs = run_inputs(run("weave"), ROBOT)

    def change(side):
        model = nominal_model(ROBOT)
        CATALOGUE["current_bias"].apply(model, SIDES[side], {"amperes": 0.01})
        return replay_run(model, inputs) - replay_run(nominal_model(ROBOT), inputs)

    assert np.allclose(change("both"), change("left") + change("right"), atol=1e-12)


def test_a_run_that_begins_in_motion_was_under_its_first_command_before():
    """Commands that come late leave it that command meanwhile, and not none; from rest it has none."""
    robot = builtin_robot("burger")
    model = nominal_model(robot)
    model.put("command_delay", 0.05)
    t = np.arange(0.0, 0.2, 0.01)
    columns = {"v_cmd_l": np.full(len(t), 6.0), "v_cmd_r": np.full(len(t), 6.0)}
    # The speed that six volts hold, without friction but the nominal one.
    steady = replay_run(
        nominal_model(robot),
        run_inputs(
            RunLog("steady", RunMeta(), np.arange(0.0, 5.0, 0.01), {c: np.full(500, 6.0) for c in columns}), robot
        ),
    )[-1, 3:5]
    moving = {**columns, "w_l": np.full(len(t), steady[0]), "w_r": np.full(len(t), steady[1])}
    log = RunLog("moving", RunMeta(), t, moving)
    assert np.allclose(replay_run(model, run_inputs(log, robot))[5:, 3], steady[0], rtol=0.02)
    assert np.abs(replay_run(model, run_inputs(RunLog("rest", RunMeta(), t, columns), robot))[:5, 3]).max() == 0.0
    assert [len(part) for part in row_inputs(log, robot)[:4]] == [len(t)] * 4


def test_friction_that_falls_with_speed_does_not_drive_a_robot_far_beyond_its_free_speed():
    """What turns twice as fast as its motor can has another gain; friction that differs by direction gives no energy
    back.
    """
    robot = builtin_robot("burger")
    effect = catalogue(robot)["friction_asymmetry"]
    t = np.arange(0.0, 6.0, 0.01)
    top = []
    for share in (0.0, 1.0):
        model = nominal_model(robot)
        effect.apply(model, (0, 1), {"torque_nm": 0.0, "nm_s_per_rad": share * effect.parameters[1].low})
        run = RunLog("run", RunMeta(), t, {c: np.full(len(t), 6.0) for c in ("v_cmd_l", "v_cmd_r")})
        top.append(replay_run(model, run_inputs(run, robot))[-1, OUTPUT_INDEX["w_l"]])
    assert top[0] < top[1] < 1.5 * top[0]


@pytest.mark.parametrize("step_s", [0.001, 0.01, 0.03])
def test_a_stretch_of_a_run_knows_every_command_that_may_still_act_at_its_start(step_s):
    log = make_run("steps", nominal_model(ROBOT), ROBOT, "steps", 4.0, step_s=step_s)
    first = len(log.t) // 2
    t, t_cmd, *_ = stretch_inputs(log, ROBOT, first, first + 50)
    assert t[0] - LONGEST_DELAY_S - step_s < t_cmd[0] <= t[0] - LONGEST_DELAY_S
    assert stretch_inputs(log, ROBOT, 10, 60)[1][0] == 0.0


@pytest.mark.parametrize("effect", ["command_delay", "measurement_delay"])
def test_no_delay_is_looked_for_beyond_what_a_replay_knows(effect):
    assert CATALOGUE[effect].parameters[0].high == LONGEST_DELAY_S


def test_what_an_effect_changes_is_seen_by_longer_steps_too():
    problem = Problem(make_case(), threads=1)
    model = problem.nominal
    models = [
        apply(problem.effects, model, ((effect.id, "left" if effect.sided else "both"),), [values])
        for effect in available(problem)
        for values in start_values(effect)
    ]
    coarse = [m.coarse_s for m in models]
    base, *moved = problem.residuals([model, *models])
    for m, short, long, long_base in zip(
        models, moved, problem.residuals(models, coarse), problem.residuals([model] * len(models), coarse)
    ):
        change = short - base
        assert np.linalg.norm(change - (long - long_base)) <= 0.2 * np.linalg.norm(change), m


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("runs", range(1, 10))
def test_shares_of_models_are_all_models_and_fill_the_lanes(runs, threads):
    """But for the last share, where there are more shares than cores."""
    for models in range(1, 100):
        shares = np.split(np.arange(models), shares_of(models, runs, threads))
        assert np.concatenate(shares).tolist() == list(range(models)) and all(map(len, shares))
        if len(shares) > threads:
            assert all(len(share) * runs % SIMD_WIDTH == 0 for share in shares[:-1])


@pytest.mark.parametrize("late", [0.004, -0.004, 0.0137, 50.0, -50.0])
@pytest.mark.parametrize(("quantity", "late_ones"), [("gyro_delay", {"gyro_z"}), ("pose_delay", {"x", "y", "yaw"})])
def test_a_clock_that_is_late_reports_what_was_earlier_between_samples_too(quantity, late_ones, late):
    """Before the first sample and behind the last one it reports these."""
    run = make_run("weave", nominal_model(ROBOT), ROBOT, "weave", seed=3)
    uneven = run.t[np.sort(np.random.default_rng(6).choice(len(run.t), 300, replace=False))]
    inputs = (uneven, *run_inputs(run, ROBOT)[1:])
    model = nominal_model(ROBOT)
    on_time = replay_run(model, inputs)
    model.put(quantity, late)
    out = replay_run(model, inputs)
    for channel, k in OUTPUT_INDEX.items():
        expected = np.interp(uneven - late, uneven, on_time[:, k]) if channel in late_ones else on_time[:, k]
        np.testing.assert_array_equal(out[:, k], expected)


@pytest.mark.parametrize("share", [0.25, 1.0])
@pytest.mark.parametrize("side", ["left", "both"])
def test_what_of_a_speeds_lag_is_a_delay_shifts_what_its_filter_gives_and_leaves_the_angle(side, share):
    """Between samples too: the delay is no whole number of rows."""
    coarse, lag = run("weave"), 0.0308
    ticks = np.arange(0.0, coarse.t[-1], 0.001)
    held = np.searchsorted(coarse.t, ticks + 1e-9, side="right") - 1
    fine = RunLog("fine", coarse.meta, ticks, {c: v[held] for c, v in coarse.columns.items()})

    def reported(log, delay, lag):
        values = {"time_constant_s": lag, "delay_s": delay}
        return replay_run(
            apply(CATALOGUE, nominal_model(ROBOT), (("speed_filter", side),), [values]), run_inputs(log, ROBOT)
        )

    filtered, late = reported(fine, 0.0, (1.0 - share) * lag), reported(coarse, share * lag, lag)
    on_time = reported(coarse, 0.0, (1.0 - share) * lag)
    inside = coarse.t > 0.5
    for k, w in enumerate(("w_l", "w_r")):
        column = OUTPUT_INDEX[w]
        expected = (
            np.interp(coarse.t - share * lag, fine.t, filtered[:, column]) if k in SIDES[side] else on_time[:, column]
        )
        assert np.abs(late[inside, column] - expected[inside]).max() < 0.3 * ROBOT.noise(w)
    for name in OUTPUT_INDEX.keys() - {"w_l", "w_r"}:
        # Samples between the rows part the integration's steps.
        assert np.abs(late - on_time)[:, OUTPUT_INDEX[name]].max() < 0.02 * ROBOT.noise(name)


def test_pieces_of_an_axis_begin_with_what_its_late_speed_reports():
    """A piece starts at the angle's slope; what the speed was before is known by what is reported of it as the piece
    begins.
    """
    robot = replace(ROBOT, chassis=None, axis=Axis("inertia", 1e-3))
    model = nominal_model(robot)
    model.put("speed_delay", 0.02, (0,))
    model.put("speed_tau", 0.01, (0,))
    t = np.arange(0.0, 4.0, 0.001)
    volts = 5.0 * np.sin(2.0 * np.pi * t / 0.7)
    log = RunLog("swing", RunMeta(), t, {"v_cmd_l": volts})
    out = replay_run(model, run_inputs(log, robot))
    log.columns.update({c: out[:, OUTPUT_INDEX[c]] for c in ("w_l", "th_l")})
    problem = Problem(Case("swing", robot, (log,)), 1, pieces=True)
    speeds = problem.channels_of == CHANNELS.index("w_l")
    assert len(problem.runs) > 10
    assert np.median(np.abs(problem.residual(model)[speeds])) < 0.1
    model.put("speed_delay", 0.0, (0,))
    assert np.median(np.abs(problem.residual(model)[speeds])) > 1.0


@pytest.mark.parametrize("mode", ["voltage", "torque", "speed"])
@pytest.mark.parametrize("pieces", [False, True], ids=["whole runs", "pieces"])
def test_runs_replayed_one_after_another_leave_what_each_leaves_by_itself(tmp_path, mode, pieces):
    """Many short pieces are replayed and compared in one go, in shares for the cores; sums differ in their last digits
    alone.
    """
    case = read_case(write_axis_case(tmp_path / "case", "pendulum", mode))
    case = replace(case, robot=replace(case.robot, sensors={**case.robot.sensors, "v_bus_v": 0.02}))
    for log in case.runs:
        log.columns["v_bus"] = 12.0 + 0.1 * np.sin(log.t)
    problem = Problem(case, 3, pieces=pieces)
    model = problem.nominal.copy()
    model.put("coulomb", 0.01)
    alone = [run_residual(data, replay_run(model, data.inputs)) for data in problem.runs_starting(model.start)]
    assert {CHANNELS[k] for k in problem.channels_of} >= {"v_bus", "w_l", "th_l"}
    np.testing.assert_allclose(problem.residual(model), np.concatenate(alone), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("late_s", [0.013, -0.021], ids=["clocks behind", "clocks ahead"])
@pytest.mark.parametrize("missing", [(), ("x", "y"), ("yaw",)], ids=["all channels", "no position", "no yaw"])
def test_a_robots_runs_leave_together_what_each_leaves_by_itself(late_s, missing):
    """With a gyro and a pose on clocks of their own, for which `np.interp` is the reference."""
    case = make_case()
    for k, log in enumerate(case.runs):
        log.columns["v_bus"] = 12.0 + 0.1 * np.sin(log.t)
        for channel in missing:
            del log.columns[channel]
        log.columns["w_l"][k::7] = np.nan
    robot = replace(case.robot, sensors={**case.robot.sensors, "v_bus_v": 0.02})
    problem = Problem(replace(case, robot=robot), 2)
    model = problem.nominal.copy()
    model.put("coulomb", 0.01)
    alone = []
    late = model.copy()
    late.declare(gyro_delay=late_s, pose_delay=late_s)
    for data in problem.runs_starting(model.start):
        out = replay_run(model, data.inputs)
        for column in ("gyro_z", "x", "y", "yaw"):
            values = out[:, OUTPUT_INDEX[column]]
            values[:] = np.interp(data.log.t - late_s, data.log.t, values.copy())
        alone.append(run_residual(data, out))
    for residual in problem.residuals([late] * 5):
        np.testing.assert_allclose(residual, np.concatenate(alone), rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("count", [1, 9], ids=["too few for a batch", "in a batch"])
def test_a_run_replayed_with_a_model_of_its_own_is_what_it_gives_by_itself(count):
    case = make_case()
    inputs = [run_inputs(log, case.robot) for log in case.runs]
    models, runs = [], [k % len(inputs) for k in range(count)]
    for k in range(count):
        models.append(nominal_model(case.robot))
        models[-1].declare(coulomb=0.002 * k, gyro_delay=0.004 * (k % 2), command_delay=0.003 * k)
    for model, run, out in zip(models, runs, ReplayBatch(inputs).replay_each(models, runs), strict=True):
        np.testing.assert_allclose(out, replay_run(model, inputs[run]), rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("load", [0.0, 0.2], ids=["no load friction", "load friction"])
def test_an_amplifier_commands_no_more_torque_than_its_limit_allows(load):
    robot = replace(
        ROBOT,
        chassis=None,
        axis=Axis("inertia", 1e-3),
        driver=replace(ROBOT.driver, mode="torque", torque_nm_per_v=0.001),
    )
    t = np.arange(0.0, 3.0, 0.01)
    volts = 9.0 * np.sin(2.0 * np.pi * t / 1.1)
    asked, clipped = (RunLog("swing", RunMeta(), t, {"v_cmd_l": v}) for v in (volts, np.clip(volts, -5.0, 5.0)))
    model = nominal_model(robot)
    model.put("load_share", load)
    free = replay_run(model, run_inputs(asked, robot))
    less = replay_run(model, run_inputs(clipped, robot))
    model.put("limit", 5.0)
    limited = replay_run(model, run_inputs(asked, robot))
    assert np.allclose(limited, less) and np.abs(limited - free)[:, OUTPUT_INDEX["w_l"]].max() > 10.0 * ROBOT.noise(
        "w_l"
    )


@pytest.mark.parametrize(("gain", "bias"), [(1.0, -0.0551), (0.5, 0.2), (-1.0, 0.1)])
@pytest.mark.parametrize("delay_s", [0.0, 0.009])
def test_a_current_at_the_start_is_what_its_sensor_makes_of_it(gain, bias, delay_s):
    """The first row's current is the starting state (contract, section 7) as the sensor reports it: its bias is in it
    once, and stays the report until the first later one is through."""
    log = run()
    log.columns["i_r"] = np.full(len(log.t), bias)
    model = nominal_model(ROBOT)
    model.put("current_bias", bias, (1,))
    model.scale("current_gain", gain, (1,))
    model.put("measurement_delay", delay_s)
    inputs = run_inputs(log, ROBOT)
    alone = replay_run(model, inputs)[:, OUTPUT_INDEX["i_r"]]
    still = log.t <= delay_s
    assert alone[still] == pytest.approx(bias, abs=1e-12)
    assert ReplayBatch([inputs]).replay([model] * 4)[2][still, OUTPUT_INDEX["i_r"]] == pytest.approx(bias, abs=1e-12)


def test_a_piece_begins_with_the_current_that_its_winding_carries(tmp_path):
    """Estimated from voltage and speed, not read: a sensor's bias is no part of it."""
    case = read_case(write_axis_case(tmp_path / "case", "inertia", "voltage"))
    log, model = case.runs[0], nominal_model(case.robot)
    inputs = piece_inputs(log, case.robot, 100, 160)
    model.put("current_bias", 0.5, (0,))
    plain, biased = (replay_run(m, inputs) for m in (nominal_model(case.robot), model))
    assert biased[:, OUTPUT_INDEX["i_l"]] == pytest.approx(plain[:, OUTPUT_INDEX["i_l"]] + 0.5, abs=1e-9)
