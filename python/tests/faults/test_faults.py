"""Timed faults and played signals: the file, the exact step, RTL and model alike, and what the gate says."""

import dataclasses
import math
import shutil

import numpy as np
import pytest

from rtds_host.contract import builtin_robot_path, read_case
from rtds_host.diagnosis.gate import examine
from rtds_host.errors import InputError
from rtds_host.faults import Fault, FaultLink, Injection, read_faults, read_stimulus
from rtds_host.link import open_link
from rtds_host.link.chip import ChipLink
from rtds_host.link.hps import HpsLink, SimulatedBus
from rtds_host.link.quantised import QuantisedLink
from rtds_host.motor.effects import Curve, SupplyEffects, UnitEffects
from rtds_host.run import LinkChoice, make_plan, perform, write_outcome
from rtds_host.run.log import log_columns

STEP_S, SUPPLY_V = 1e-5, 12.0
MOTOR = {
    "resistance_ohm": 8.6,
    "inductance_h": 1e-3,
    "torque_constant_nm_per_a": 6.538e-3,
    "back_emf_constant_v_s_per_rad": 6.538e-3,
    "rotor_inertia_kg_m2": 1e-7,
    "viscous_friction_nm_s_per_rad": 4.372e-7,
    "step_s": STEP_S,
}
# Of each kind one, within 2 ms.
SCRIPTS = {
    "phase_open": (Fault("phase_open", 3e-4, 9e-4, side="left"),),
    "phase_open_both": (Fault("phase_open", 0.0, 5e-4, side="left"), Fault("phase_open", 1e-5, 4e-4, side="right")),
    "supply_dip": (Fault("supply_dip", 3e-4, 7e-4, volts=5.0),),
    "adc_code": (Fault("adc_stuck", 2e-4, 6e-4, channel="v_right", code=3000),),
    "adc_held": (Fault("adc_stuck", 2e-4, channel="t_left"),),
    "one_step": (Fault("supply_dip", 3e-4, 3.1e-4, volts=0.0), Fault("phase_open", 5e-4, 5.1e-4, side="right")),
}


def injection(*faults, stimulus=None, duration_s=10.0, **more):
    return Injection.of(faults, stimulus, STEP_S, SUPPLY_V, duration_s, **more)


def exchanges(link, effects=False, method="backward_euler"):
    """(n, 4) float32 speeds and currents at every step of 2 ms of changing inputs."""
    with link:
        if effects:
            level = Curve((0.0, 0.0), (1e-4, 1e-4))
            dry = UnitEffects(friction_forward=level, friction_backward=level)
            link.set_effects(dry, None, SupplyEffects(voltage_v=12.0, source_resistance_ohm=0.5))
        link.set_parameters(**MOTOR, method=method)
        found = []
        for volts, load, steps in (((6.0, -9.0), (1e-4, 0.0), 70), ((9.0, 3.0), (0.0, 2e-4), 130)):
            got = link.exchange(volts, load, steps * STEP_S, STEP_S)
            found.append(np.hstack([got.speeds, got.currents]))
    return np.vstack(found)


def model(*faults, **more):
    return exchanges(FaultLink(open_link("model"), injection(*faults)), **more)


@pytest.mark.parametrize("script", SCRIPTS)
@pytest.mark.parametrize("effects", [False, True])
def test_the_rtl_and_the_model_give_the_same_bytes_under_each_fault(script, effects):
    faults = SCRIPTS[script]
    rtl = exchanges(FaultLink(open_link("rtl"), injection(*faults)), effects)
    assert rtl.tobytes() == model(*faults, effects=effects).tobytes()
    assert rtl.tobytes() != model(effects=effects).tobytes()


def test_icarus_and_the_simulated_bus_give_the_same_bytes_too():
    faults = (*SCRIPTS["phase_open"], *SCRIPTS["supply_dip"], *SCRIPTS["adc_code"])
    want = model(*faults).tobytes()
    for link in (open_link("rtl", sim="icarus", timeout_s=120.0), HpsLink(SimulatedBus(), step_clocks="min")):
        assert exchanges(FaultLink(link, injection(*faults))).tobytes() == want


def test_without_a_fault_in_force_no_bit_differs():
    """Also of a motor whose phase will open later: its own parameters are those of the other."""
    with open_link("model") as link:
        plain = exchanges(link)
    assert model().tobytes() == plain.tobytes()
    assert model(Fault("phase_open", 5.0, side="left")).tobytes() == plain.tobytes()
    late = model(Fault("phase_open", 3e-4, side="left"))
    assert late[:29].tobytes() == plain[:29].tobytes()


def test_a_fault_acts_from_its_very_step_to_its_end():
    """Before step 30 nothing; in it an open phase has no current to speak of; after the dip the full voltage acts."""
    plain = model()
    opened = model(Fault("phase_open", 3e-4, 6e-4, side="left"))
    assert np.array_equal(opened[:30], plain[:30])
    assert np.abs(opened[30:60, 2]).max() < 1e-4 < 0.1 < abs(plain[30, 2])
    assert opened[60, 2] != opened[59, 2] and abs(opened[65, 2]) > 0.01
    assert np.array_equal(opened[:30, 3], plain[:30, 3]) and np.array_equal(opened[:, 3], plain[:, 3])
    dip = model(Fault("supply_dip", 3e-4, 6e-4, volts=6.0))
    with open_link("model") as link:
        link.set_parameters(**MOTOR)
        rows = []
        for volts, load, steps in (
            ((6.0, -9.0), (1e-4, 0.0), 30),
            ((3.0, -4.5), (1e-4, 0.0), 30),
            ((6.0, -9.0), (1e-4, 0.0), 10),
            ((9.0, 3.0), (0.0, 2e-4), 130),
        ):
            got = link.exchange(volts, load, steps * STEP_S, STEP_S)
            rows.append(np.hstack([got.speeds, got.currents]))
    assert dip.tobytes() == np.vstack(rows).tobytes()


def test_samples_lie_where_they_do_without_faults():
    """An exchange that a fault cuts has its samples at the same steps."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        steps, every = int(rng.integers(1, 90)), int(rng.integers(1, 40))
        cuts = np.sort(rng.choice(np.arange(1, 91), 2, replace=False)) * STEP_S
        fault = Fault("supply_dip", float(cuts[0]), float(cuts[1]), volts=4.0)
        with (
            FaultLink(open_link("model"), injection(fault)) as cut,
            FaultLink(open_link("model"), injection(fault)) as one,
        ):
            for link in (cut, one):
                link.set_parameters(**MOTOR)
            got = cut.exchange((6.0, 6.0), (0.0, 0.0), steps * STEP_S, every * STEP_S)
            each = one.exchange((6.0, 6.0), (0.0, 0.0), steps * STEP_S, STEP_S)
        at = [*range(every, steps, every), steps]
        assert np.allclose(got.t_s, np.array(at) * STEP_S, rtol=0, atol=1e-12)
        assert got.speeds.tobytes() == each.speeds[np.array(at) - 1].tobytes()


def test_a_stuck_code_is_what_the_chips_scaling_makes_of_it():
    held = model(Fault("adc_stuck", 0.0, channel="v_left", code=2048 + 768))
    with open_link("model") as link:
        link.set_parameters(**MOTOR)
        got = link.exchange((6.0, -9.0), (1e-4, 0.0), 70 * STEP_S, STEP_S)
    assert np.array_equal(held[:70, 2], got.currents[:, 0])


def test_a_stimulus_is_played_at_the_motors_own_step(tmp_path):
    t = np.arange(3, 40) * STEP_S
    volts = 5.0 * np.sin(2e3 * t)
    path = tmp_path / "play.csv"
    path.write_text("t,v_l,t_r\n" + "".join(f"{a:.5f},{v!r},{1e-4!r}\n" for a, v in zip(t, volts.tolist())))
    played = Injection.of((), read_stimulus(path), STEP_S, SUPPLY_V, 1.0)
    found = {}
    for name, link in (("model", open_link("model")), ("rtl", open_link("rtl"))):
        found[name] = exchanges(FaultLink(link, played))
    assert found["model"].tobytes() == found["rtl"].tobytes()
    with open_link("model") as link:
        link.set_parameters(**MOTOR)
        link.exchange((6.0, -9.0), (1e-4, 0.0), 3 * STEP_S)
        for v in volts[:20]:
            last = link.exchange((v, -9.0), (1e-4, 1e-4), STEP_S)
    assert np.array_equal(found["model"][22, :2], last.speeds[0])
    assert played.played_mean(0, 3).tolist()[1:] != [0.0] and np.isnan(played.played_mean(0, 2)).all()
    assert played.played_mean(3, 5)[0] == pytest.approx(volts[:2].mean())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('schema = "rtds-faults/2"', "schema: is 'rtds-faults/2'"),
        ("", "fault: at least one table"),
        ('[[fault]]\nkind = "phase_opened"\nfrom_s = 1', "fault 1: kind: is 'phase_opened'.*did you mean 'phase_open'"),
        ('[[fault]]\nkind = "phase_open"\nfrom_s = 1', "fault 1: side: is missing"),
        ('[[fault]]\nkind = "phase_open"\nside = "middle"\nfrom_s = 1', "side: is 'middle'"),
        ('[[fault]]\nkind = "supply_dip"\nvolts = 6\nfrom_s = 2\nto_s = 1', "to_s: is 1 s, it must be after"),
        ('[[fault]]\nkind = "supply_dip"\nvolts = -6\nfrom_s = 2', "volts: is -6"),
        ('[[fault]]\nkind = "supply_dip"\nvolts = 6\nfrom_s = nan', "from_s: is nan"),
        ('[[fault]]\nkind = "supply_dip"\nvolts = 6\nside = "left"\nfrom_s = 1', "side: supply_dip has none"),
        ('[[fault]]\nkind = "adc_stuck"\nchannel = "v_left"\ncode = 4096\nfrom_s = 1', "code: is 4096"),
        ('faults = 1\n[[fault]]\nkind = "supply_dip"\nvolts = 6\nfrom_s = 1', "faults: unknown.*did you mean 'fault'"),
        (
            2 * '[[fault]]\nkind = "supply_dip"\nvolts = 6\nfrom_s = 1\n',
            "begins while another",
        ),
    ],
)
def test_a_script_that_cannot_be_meant_ends_in_one_line(tmp_path, text, says):
    path = tmp_path / "faults.toml"
    path.write_text(text if text.startswith("schema") else f'schema = "rtds-faults/1"\n{text}\n')
    with pytest.raises(InputError, match=says) as caught:
        read_faults(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("fault", "more", "says"),
    [
        (Fault("supply_dip", 1.000005, volts=5.0), {}, "not a whole number of simulation steps"),
        (Fault("supply_dip", 11.0, volts=5.0), {}, "begins after the run"),
        (Fault("supply_dip", 1.0, volts=12.0), {}, "is not a dip"),
        (Fault("phase_open", 1.0, side="left"), {"method": "trapezoidal", "inductance_h": 1e-3}, "needs the method"),
    ],
)
def test_a_fault_that_a_run_cannot_have_ends_in_one_line(fault, more, says):
    with pytest.raises(InputError, match=says):
        injection(fault, **more)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("t,v\n0,1\n1,2\n", "row 1: the columns t and some of v_l"),
        ("t,v_l\n0,1\n0.1,\n", "row 3: v_l is missing"),
        ("t,v_l\n-1,1\n0.1,2\n", "row 2: t is -1 s"),
        ("t,v_l\n0,1\n0.000015,2\n", "row 3: t is 1.5e-05 s, no whole number of steps"),
    ],
)
def test_a_stimulus_that_cannot_be_played_ends_in_one_line(tmp_path, text, says):
    path = tmp_path / "play.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=says):
        Injection.of((), read_stimulus(path), STEP_S, SUPPLY_V, 1.0)


CHIP_FAULTS = (
    Fault("phase_open", 0.0, 5.3e-4, side="left"),
    Fault("phase_open", 1.15e-3, 1.77e-3, side="right"),
    Fault("phase_open", 2.39e-3, side="left"),
    Fault("phase_open", 2.39e-3, 3.02e-3, side="right"),
)


@pytest.mark.parametrize("effects", [False, pytest.param(True, marks=pytest.mark.long)])
def test_a_phase_opens_behind_the_chips_serial_line_at_the_very_step_of_the_model(effects):
    """The words go over the line while steps run, and the commit's last byte ends in the step before they are taken."""
    found = []
    for link in (ChipLink(), QuantisedLink(open_link("model"), None, ("voltages", "torques", "outputs"))):
        with FaultLink(link, injection(*CHIP_FAULTS)) as faulty:
            if effects:
                level = Curve((0.0, 0.0), (1e-4, 1e-4))
                dry = UnitEffects(friction_forward=level, friction_backward=level)
                faulty.set_effects(dry, None, SupplyEffects(voltage_v=12.0, source_resistance_ohm=0.5))
            faulty.set_parameters(**MOTOR)
            if isinstance(link, QuantisedLink):  # the chip is one step on before its first exchange
                link.exchange((0.0, 0.0), (0.0, 0.0), STEP_S)
            for volts, load, steps in (((6.0, -9.0), (1e-4, 0.0), 70), ((9.0, 3.0), (0.0, 2e-4), 280)):
                got = faulty.exchange(volts, load, steps * STEP_S, STEP_S)
                found.append(np.hstack([got.speeds, got.currents]))
    chip, model = np.vstack(found[:2]), np.vstack(found[2:])
    assert np.array_equal(chip, model)
    # Each change lies between these rows: an open phase has no current at the DAC, a closed one has.
    for side, begins, ends in ((0, 1, 53), (1, 115, 177), (0, 239, 350), (1, 239, 302)):
        assert not chip[begins:ends, 2 + side].any() and chip[ends : ends + 1, 2 + side].all()
        assert begins == 1 or chip[begins - 1, 2 + side] != 0.0


def test_two_changes_that_a_serial_line_has_no_time_for_end_in_one_line():
    with ChipLink() as link:
        link.set_parameters(**MOTOR)
        link.set_resistances((1e6, None))
        link.exchange((6.0, 6.0), (0.0, 0.0), 20 * STEP_S)
        link.set_resistances((None, None))
        link.exchange((6.0, 6.0), (0.0, 0.0), 20 * STEP_S)
        with pytest.raises(InputError, match="still busy with the change before"):
            link.set_resistances((1e6, None))
        link.exchange((6.0, 6.0), (0.0, 0.0), (link.resistance_spacing_steps - 20) * STEP_S)
        link.set_resistances((1e6, None))


@pytest.mark.parametrize(
    ("times", "says"),
    [
        ((2e-5, 1.0), "takes 52 steps to change a resistance: one changes at the run's beginning or 53 steps later"),
        ((5.2e-4, 1.0), "or 53 steps later"),
        ((1.0, 1.00061), "takes 62 steps from one change of a resistance to the next, and 61 are asked for at step"),
    ],
)
def test_a_fault_that_a_slow_line_cannot_bring_in_time_ends_in_one_line(times, says):
    class Slow:
        resistance_lead_steps = ChipLink.resistance_lead_steps
        resistance_spacing_steps = ChipLink.resistance_spacing_steps

        def set_resistances(self, ohm):
            raise AssertionError("not to be called")

    with pytest.raises(InputError, match=says):
        FaultLink(Slow(), injection(Fault("phase_open", *times, side="left")))
    FaultLink(Slow(), injection(Fault("phase_open", 5.3e-4, 1.15e-3, side="left")))


def test_a_link_without_exact_steps_says_so():
    """What cannot change a resistance at all."""

    class Board:
        def close(self):
            pass

    with pytest.raises(InputError, match="this link cannot change a motor's resistance"):
        FaultLink(Board(), injection(Fault("phase_open", 1.0, side="left")))


# ---- runs ----------------------------------------------------------------------------------------------------------


def steps_run(*faults, link="model", seconds=2.6, **more):
    plan = dataclasses.replace(make_plan("steps", {"stretch": 0.4}), total_steps=round(1000 * seconds))
    injected = Injection.of(faults, more.get("stimulus"), STEP_S, SUPPLY_V, plan.duration_s)
    return perform(plan, LinkChoice(link), compare=False, injection=injected)


STUCK = Fault("encoder_stuck", 1.20003, 2.2, side="left")
STUCK_VOLTAGE = Fault("adc_stuck", 1.20003, 2.2, channel="v_left")
FAULTS = (
    STUCK,
    Fault("phase_open", 1.20003, 2.2, side="left"),
    Fault("supply_dip", 1.20003, 2.2, volts=8.0),
    Fault("adc_stuck", 1.20003, 2.2, channel="i_left"),
)


def test_a_run_with_every_kind_writes_the_same_log_in_rtl_and_model(tmp_path):
    logs = []
    for link in ("model", "rtl"):
        outcome = steps_run(
            Fault("encoder_stuck", 0.30003, 0.34, side="left"),
            Fault("phase_open", 0.30003, 0.34, side="right"),
            Fault("supply_dip", 0.35001, 0.37, volts=7.0),
            Fault("adc_stuck", 0.37, 0.38, channel="v_left"),
            Fault("adc_stuck", 0.37, channel="i_right"),
            link=link,
            seconds=0.4,
        )
        assert outcome.summary.model_agrees and len(outcome.summary.faults) == 5
        write_outcome(outcome, tmp_path / link, figure=False)
        logs.append((tmp_path / link / "log.csv").read_bytes())
    assert logs[0] == logs[1]


def test_a_stuck_encoder_keeps_its_angle_loses_counts_and_reads_no_speed():
    seen, true = log_columns(steps_run(STUCK).record), log_columns(steps_run().record)
    t = true["t"]
    during, after = (t >= 1.20003) & (t < 2.2), t >= 2.2
    assert np.array_equal(seen["th_l"][t < 1.2], true["th_l"][t < 1.2])
    assert np.ptp(seen["th_l"][during]) == 0.0 and not seen["w_l"][during].any()
    lost = true["th_l"][after] - seen["th_l"][after]
    assert np.ptp(lost) < 1e-12 and abs(lost[0]) > 0.1
    # 3/100 of a millisecond after the row at 1.2 s, to a straight line.
    assert seen["th_l"][during][0] == pytest.approx(np.interp(1.20003, t, true["th_l"]), abs=1e-6)
    for name in ("i_l", "w_r", "th_r", "x", "yaw", "v_bus"):
        assert np.array_equal(seen[name], true[name]), name


def test_a_stimulus_takes_the_commands_place_in_the_log(tmp_path):
    path = tmp_path / "play.csv"
    path.write_text("t,v_l\n0,3\n0.10005,-2\n0.2,1\n")
    plan = dataclasses.replace(make_plan("steps"), total_steps=300)
    played = Injection.of((), read_stimulus(path), STEP_S, SUPPLY_V, 0.3)
    columns = log_columns(perform(plan, LinkChoice("model"), compare=False, injection=played).record)
    t, v = columns["t"], columns["v_cmd_l"]
    assert set(v[t < 0.1]) == {3.0} and set(v[t > 0.2]) == {1.0}
    row = int(np.flatnonzero(np.isclose(t, 0.1))[0])
    share = 5e-5 / (t[row + 1] - t[row])
    assert v[row] == pytest.approx(3.0 * share - 2.0 * (1.0 - share))


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """Findings of the gate on a run of each fault, kind -> findings."""
    folder = tmp_path_factory.mktemp("cases")
    found = {}
    for fault in (None, *FAULTS, STUCK_VOLTAGE):
        case = folder / ("none" if fault is None else "voltage_stuck" if fault is STUCK_VOLTAGE else fault.kind)
        case.mkdir()
        shutil.copy(builtin_robot_path("burger"), case / "robot.toml")
        write_outcome(steps_run(*([fault] if fault else [])), case / "steps", figure=False)
        found[case.name] = examine(read_case(case)).findings
    return found


@pytest.mark.parametrize("kind", [*(fault.kind for fault in FAULTS), "voltage_stuck"])
def test_the_gate_names_each_fault_with_its_time(told, kind):
    mine = [f for f in told[kind] if f.kind == kind]
    assert len(mine) == 1 and mine[0].severity == "warning"
    # A voltage that sticks shows at the command's next step.
    assert f"t = {'1.325' if kind == 'voltage_stuck' else '1.20'}" in mine[0].text


def test_the_gate_names_none_of_them_in_a_run_without(told):
    names = {*(fault.kind for fault in FAULTS), "voltage_stuck"}
    assert not [f for f in told["none"] if f.kind in names]
    for kind in names:
        assert {f.kind for f in told[kind]} & names == {kind}


def test_a_wheel_that_is_blocked_is_no_stuck_encoder(told, tmp_path):
    """The current of a stalled motor says that the wheel stands, whatever gyro and other wheel do."""
    case = tmp_path / "case"
    case.mkdir()
    shutil.copy(builtin_robot_path("burger"), case / "robot.toml")
    write_outcome(steps_run(STUCK), case / "steps", figure=False)
    held = read_case(case)
    log = held.runs[0]
    columns = {name: values.copy() for name, values in log.columns.items()}
    rows = (log.t >= 1.2) & (log.t < 2.2)
    before = np.concatenate([[0.0], columns["v_cmd_l"][:-1]])
    columns["i_l"][rows] = before[rows] / held.robot.motor.resistance_ohm
    blocked = dataclasses.replace(held, runs=(dataclasses.replace(log, columns=columns),))
    assert not [f for f in examine(blocked).findings if f.kind == "encoder_stuck"]


def test_a_wheel_that_settles_without_noise_after_a_stuck_encoder_is_not_held(tmp_path):
    """The few samples near the level are those of the smooth way to it, not of noise about it."""
    plan = dataclasses.replace(make_plan("steps"), total_steps=5710)
    fault = Fault("encoder_stuck", 3.00003, 5.5, side="left")
    outcome = perform(plan, LinkChoice("model"), compare=False, injection=injection(fault, duration_s=plan.duration_s))
    case = tmp_path / "case"
    case.mkdir()
    shutil.copy(builtin_robot_path("burger"), case / "robot.toml")
    write_outcome(outcome, case / "steps", figure=False)
    told = [f.kind for f in examine(read_case(case)).findings if f.kind in ("frozen", "encoder_stuck")]
    assert told == ["encoder_stuck"]


def test_the_text_of_a_fault_says_what_and_when():
    assert str(STUCK) == "encoder stuck, left, from 1.20003 s to 2.2 s"
    assert str(Fault("adc_stuck", 1.0, channel="t_left", code=7)) == "ADC t_left stuck at code 7, from 1 s to the end"
    assert math.isinf(Fault("phase_open", 1.0, side="left").to_s)
