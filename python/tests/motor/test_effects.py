"""The motor unit with effects, as a specification: what each effect does, and how exactly the unit does it."""

import math

import numpy as np
import pytest

from rtds_host.errors import InputError
from rtds_host.link import open_link
from rtds_host.motor import METHODS, effect_reference
from rtds_host.motor.effect_model import EffectPair
from rtds_host.motor.effect_tables import Deviation, tables_of
from rtds_host.motor.effects import Curve, MotorParameters, SupplyEffects, UnitEffects

R, L, KM, KB, J, B, H = PARAMETERS = (8.6, 1e-3, 6.538e-3, 6.538e-3, 1e-7, 4.372e-7, 1e-5)
SUPPLY_V = 12.0
# Of full scale V / R and V / Kb, as for the ideal unit (docs/motor-unit.md).
CURRENT_BOUND, SPEED_BOUND = 1e-6, 5e-7
DRY = Curve((0.0,), (2e-4,))
BREAKAWAY_V = 2e-4 / KM * R


def drive(
    left, volts, torques=(0.0, 0.0), seconds=0.2, sample_s=1e-4, right=None, supply=None, method="backward_euler"
):
    """Speeds and currents of both sides with effects on the left (and right), inputs held."""
    with open_link("model") as link:
        link.set_effects(left, right, supply)
        link.set_parameters(*PARAMETERS, method)
        return link.exchange(volts, torques, seconds, sample_s)


# ---- dry friction
# ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_below_its_breakaway_torque_a_motor_stands_still_without_chatter(method, sign):
    unit = UnitEffects(friction_forward=DRY, friction_backward=DRY)
    got = drive(unit, (sign * 0.99 * BREAKAWAY_V, 0.0), sample_s=H, method=method)
    assert (got.speeds[:, 0] == 0.0).all()
    # and draws what its voltage drives through its resistance
    assert got.currents[-1, 0] == pytest.approx(sign * 0.99 * BREAKAWAY_V / R, rel=1e-6)
    assert (np.diff(sign * got.currents[:, 0]) >= 0.0).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_above_it_the_motor_leaves_and_turns_as_fast_as_what_is_left_of_its_torque_allows(sign):
    unit = UnitEffects(friction_forward=DRY, friction_backward=DRY)
    got = drive(unit, (sign * 1.01 * BREAKAWAY_V, 0.0), seconds=0.4)
    settled = (KM * 1.01 * BREAKAWAY_V / R - 2e-4) / (B + KM * KB / R)
    assert got.speeds[-1, 0] == pytest.approx(sign * settled, rel=1e-4)


def test_it_leaves_when_the_torque_passes_the_level_at_rest_and_not_before():
    unit = UnitEffects(friction_forward=Curve((0.0, 50.0), (2e-4, 1e-4)), friction_backward=DRY)
    with open_link("model") as link:
        link.set_effects(unit, None, None)
        link.set_parameters(*PARAMETERS)
        speeds = []
        volts = np.linspace(0.9, 1.1, 201) * BREAKAWAY_V
        for v in volts:
            speeds.append(float(link.exchange((v, 0.0), (0.0, 0.0), 2e-3).speeds[-1, 0]))
    assert np.flatnonzero(speeds)[0] == np.flatnonzero(volts > BREAKAWAY_V)[0]


def test_a_load_is_held_up_to_the_level_in_either_direction():
    unit = UnitEffects(friction_forward=DRY, friction_backward=Curve((0.0,), (1e-4,)))
    # A positive load pushes backward, where the level is the lower one.
    assert drive(unit, (0.0, 0.0), (0.99e-4, 0.0)).speeds[-1, 0] == 0.0
    assert drive(unit, (0.0, 0.0), (1.01e-4, 0.0)).speeds[-1, 0] < 0.0
    assert drive(unit, (0.0, 0.0), (-1.99e-4, 0.0)).speeds[-1, 0] == 0.0
    assert drive(unit, (0.0, 0.0), (-2.01e-4, 0.0)).speeds[-1, 0] > 0.0


def test_coasting_ends_at_rest_and_stays_there():
    with open_link("model") as link:
        link.set_effects(UnitEffects(friction_forward=DRY, friction_backward=DRY), None, None)
        link.set_parameters(*PARAMETERS)
        link.exchange((6.0, 0.0), (0.0, 0.0), 0.3)
        speeds = link.exchange((0.0, 0.0), (0.0, 0.0), 0.3, H).speeds[:, 0]
    stopped = np.flatnonzero(speeds == 0.0)
    assert (speeds >= 0.0).all()
    assert len(stopped) > 1000
    assert (speeds[stopped[0] :] == 0.0).all()


def test_turning_round_passes_through_rest_for_as_long_as_the_torque_is_within_the_band():
    unit = UnitEffects(friction_forward=DRY, friction_backward=DRY)
    with open_link("model") as link:
        link.set_effects(unit, None, None)
        link.set_parameters(*PARAMETERS)
        link.exchange((3.0, 0.0), (0.0, 0.0), 0.2)
        volts = np.linspace(3.0, -3.0, 1001)
        speeds = np.array([link.exchange((v, 0.0), (0.0, 0.0), 1e-3).speeds[-1, 0] for v in volts])
    rest = np.flatnonzero(speeds == 0.0)
    assert (np.diff(rest) == 1).all()
    assert (speeds[: rest[0]] > 0.0).all()
    assert (speeds[rest[-1] + 1 :] < 0.0).all()
    assert volts[rest[-1]] == pytest.approx(-BREAKAWAY_V, abs=2 * 6e-3)


def test_friction_that_differs_by_direction_may_be_negative_in_one():
    """Half the difference alone: it holds nothing against the way it drives."""
    unit = UnitEffects(friction_forward=DRY, friction_backward=Curve((0.0,), (-2e-4,)))
    forward = drive(unit, (4.0, 0.0), seconds=0.4).speeds[-1, 0]
    backward = drive(unit, (-4.0, 0.0), seconds=0.4).speeds[-1, 0]
    ideal = drive(None, (4.0, 0.0), seconds=0.4).speeds[-1, 0]
    less = 2e-4 / (B + KM * KB / R)
    assert forward == pytest.approx(ideal - less, rel=1e-4)
    assert backward == pytest.approx(-(ideal + less), rel=1e-4)
    assert drive(unit, (0.0, 0.0)).speeds[-1, 0] == 0.0


@pytest.mark.parametrize(("volts", "loss"), [(6.0, 0.25 / 0.75), (-6.0, 0.25)])
def test_a_gear_loses_a_share_of_the_torque_before_the_loss(volts, loss):
    load = 4e-4  # opposes forward rotation: driving forward works against it, turning backward goes with it
    got = drive(UnitEffects(load_share=0.25), (volts, volts), (load, load), seconds=0.5).speeds[-1]
    lost = math.copysign(loss * load / (B + KM * KB / R), volts)
    assert got[0] == pytest.approx(got[1] - lost, rel=1e-4)


# ---- torque
# ------------------------------------------------------------------------------------------------------------


def test_torque_against_speed_differs_by_direction():
    unit = UnitEffects(torque=Curve((-2000.0, 0.0, 2000.0), (-1e-3, 0.0, 2e-3)))
    forward = drive(unit, (6.0, 0.0), seconds=0.4).speeds[-1, 0]
    backward = drive(unit, (-6.0, 0.0), seconds=0.4).speeds[-1, 0]
    assert forward == pytest.approx(6.0 * KM / R / (B + KM * KB / R + 1e-6), rel=1e-4)
    assert backward == pytest.approx(-6.0 * KM / R / (B + KM * KB / R + 5e-7), rel=1e-4)


def test_ripple_follows_the_angle_in_periods_of_its_own():
    angles = np.linspace(0.0, 2.0 * math.pi, 253)
    curve = Curve(tuple(angles), tuple(4e-5 * np.sin(angles)))
    periods = 0.37  # a radian of the shaft: not a whole number a turn
    got = drive(UnitEffects(ripple=curve, ripple_periods_per_rad=periods), (1.5, 1.5), seconds=0.5, sample_s=H)
    speed = got.speeds[:, 0].astype(float)
    angle = np.cumsum(speed) * H * periods
    # Two periods apart the speed has settled into the same cycle.
    late = angle > angle[-1] - 2.0
    shape = speed[late] - speed[late].mean()
    assert np.ptp(shape) > 1.0
    phase = 2.0 * math.pi * angle[late]
    design = np.column_stack([np.sin(phase), np.cos(phase), np.ones(late.sum())])
    fitted = design @ np.linalg.lstsq(design, shape, rcond=None)[0]
    assert np.abs(shape - fitted).max() < 0.1 * np.ptp(shape)


def test_a_run_may_begin_within_a_period_of_the_ripple():
    square = Curve((0.0, math.pi, math.pi, 2.0 * math.pi), (3e-5, 3e-5, -3e-5, -3e-5))
    held = {"friction_forward": Curve((0.0,), (2e-5,)), "friction_backward": Curve((0.0,), (2e-5,))}
    first = UnitEffects(ripple=square, ripple_periods_per_rad=1e-3, ripple_start_rad=0.5 * math.pi, **held)
    second = UnitEffects(ripple=square, ripple_periods_per_rad=1e-3, ripple_start_rad=1.5 * math.pi, **held)
    got = drive(first, (0.0, 0.0), seconds=0.05, right=second).speeds[-1]
    assert got[0] > 0.0
    assert got[1] == -got[0]


# ---- voltage
# -----------------------------------------------------------------------------------------------------------


def test_a_dead_zone_and_a_limit_act_on_the_command():
    unit = UnitEffects(command=Curve((-12.0, -0.5, 0.5, 12.0), (-11.5, 0.0, 0.0, 11.5)), limit_v=4.0)
    ideal = drive(None, (3.5, 4.0), seconds=0.4).speeds[-1]
    assert drive(unit, (0.49, 0.0)).currents[-1, 0] == 0.0
    assert drive(unit, (4.0, 0.0), seconds=0.4).speeds[-1, 0] == pytest.approx(ideal[0], rel=1e-6)
    assert drive(unit, (9.0, 0.0), seconds=0.4).speeds[-1, 0] == pytest.approx(ideal[1], rel=1e-6)


def test_a_bridge_drop_lets_no_current_pass_below_it_and_does_not_chatter():
    unit = UnitEffects(drop=Curve((0.0, 0.0), (-0.3, 0.3)))
    assert drive(unit, (0.29, 0.0), sample_s=H).currents[:, 0].max() == 0.0
    got = drive(unit, (0.8, 0.5), (1.0, 1.0), seconds=1e-3, sample_s=H)  # before anything moves
    moved = drive(unit, (4.3, 4.0), seconds=0.4, sample_s=H)
    assert got.currents[0, 0] == 0.0
    assert moved.speeds[-1, 0] == pytest.approx(moved.speeds[-1, 1], rel=1e-6)
    assert np.ptp(moved.currents[-1000:, 0]) < 1e-6


def test_a_supply_sags_under_what_both_motors_draw():
    supply = SupplyEffects(voltage_v=SUPPLY_V, source_resistance_ohm=2.0)
    stall = (10.0, 10.0)
    held = UnitEffects(friction_forward=Curve((0.0,), (1.0,)), friction_backward=Curve((0.0,), (1.0,)))
    one = drive(held, (10.0, 0.0), supply=supply, right=held).currents[-1, 0]
    both = drive(held, stall, supply=supply, right=held).currents[-1, 0]

    def current(sides):  # i = 10 (1 - Rs sides 10 i / V^2) / R
        return 10.0 / (R + 2.0 * sides * 100.0 / SUPPLY_V**2)

    assert one == pytest.approx(current(1), rel=1e-5)
    assert both == pytest.approx(current(2), rel=1e-5)


def test_a_battery_falls_by_time():
    held = UnitEffects(friction_forward=Curve((0.0,), (1.0,)), friction_backward=Curve((0.0,), (1.0,)))
    supply = SupplyEffects(voltage_v=SUPPLY_V, decline_v_per_s=0.5)
    got = drive(held, (10.0, 0.0), seconds=2.0, sample_s=1.0, supply=supply).currents[:, 0]
    assert got == pytest.approx([10.0 * (1.0 - 0.5 * t / SUPPLY_V) / R for t in (1.0, 2.0)], rel=1e-5)


@pytest.mark.parametrize("delay_s", [1e-5, 7e-5, 3e-3, 0.04095])
def test_a_command_is_late_by_the_delay_to_the_step(delay_s):
    supply = SupplyEffects(command_delay_s=delay_s)
    plain = drive(None, (3.0, -2.0), seconds=0.06, sample_s=H).currents
    late = drive(None, (3.0, -2.0), seconds=0.06, sample_s=H, supply=supply).currents
    steps = round(delay_s / H)
    # The first step brings the parameters and rests: the plain link begins with the second.
    assert (late[:steps] == 0.0).all()
    assert np.abs(late[steps:] - plain[1 : len(plain) - steps + 1]).max() < 1e-6


def test_a_delay_longer_than_the_memory_is_held_in_coarser_entries_and_says_so():
    words = tables_of(None, None, SupplyEffects(command_delay_s=0.5), PARAMETERS)
    assert words.stride == 13
    assert words.delay_error_s < 2e-4
    late = drive(None, (3.0, 0.0), seconds=0.52, sample_s=H, supply=SupplyEffects(command_delay_s=0.5)).currents[:, 0]
    assert np.flatnonzero(late)[0] * H == pytest.approx(0.5, abs=words.delay_error_s)


def test_a_winding_warms_with_its_loss_and_a_time_constant():
    held = UnitEffects(
        friction_forward=Curve((0.0,), (1.0,)),
        friction_backward=Curve((0.0,), (1.0,)),
        heat_rise_per_w=0.1,
        heat_tau_s=0.2,
    )
    got = drive(held, (6.0, 0.0), seconds=2.0, sample_s=1e-2).currents[:, 0].astype(float)
    # rise' = (rise_w i^2 R (1 + rise) - rise) / tau with i = V / (R (1 + rise)), solved finely
    rise, exact = 0.0, []
    for _ in range(200):
        for _ in range(100):
            slope = (0.1 * 36.0 / (R * (1.0 + rise)) - rise) / 0.2
            middle = rise + 0.5e-4 * slope
            rise += 1e-4 * (0.1 * 36.0 / (R * (1.0 + middle)) - middle) / 0.2
        exact.append(6.0 / (R * (1.0 + rise)))
    # The unit's current takes L / R = 0.12 ms to build up, in which the winding would have warmed by 2.5e-4.
    assert got[5:] == pytest.approx(exact[5:], rel=4e-4)
    assert got[-1] == pytest.approx(exact[-1], rel=1e-6)


# ---- motors that differ
# ------------------------------------------------------------------------------------------------


def test_each_side_has_a_motor_of_its_own():
    own = MotorParameters(9.5, 1.2e-3, 6e-3, 7e-3, 1.5e-7, 6e-7)
    got = drive(UnitEffects(motor=own), (6.0, 6.0), (1e-4, 1e-4), sample_s=H)
    with open_link("model") as link:
        link.set_parameters(*own.values, H)
        alone = link.exchange((6.0, 6.0), (1e-4, 1e-4), 0.2, H)
    ideal = drive(None, (6.0, 6.0), (1e-4, 1e-4), sample_s=H)
    assert got.speeds[:, 0].tobytes() == alone.speeds[:, 0].tobytes()
    assert got.speeds[:, 1].tobytes() == ideal.speeds[:, 1].tobytes()
    assert got.currents[:, 0].tobytes() == alone.currents[:, 0].tobytes()


def test_all_absent_is_the_ideal_unit_bit_for_bit():
    absent = drive(UnitEffects(), (6.0, -3.0), (1e-4, 0.0), right=UnitEffects(), supply=SupplyEffects(), sample_s=H)
    ideal = drive(None, (6.0, -3.0), (1e-4, 0.0), sample_s=H)
    assert absent.speeds.tobytes() == ideal.speeds.tobytes()
    assert absent.currents.tobytes() == ideal.currents.tobytes()


def test_effects_come_before_the_first_exchange():
    with open_link("model") as link:
        link.set_parameters(*PARAMETERS)
        link.exchange((1.0, 1.0), (0.0, 0.0), 1e-3)
        with pytest.raises(InputError, match="before the first"):
            link.set_effects(None, None, None)


# ---- accuracy
# ----------------------------------------------------------------------------------------------------------

_SPEEDS = np.linspace(0.0, 600.0, 201)
STRIBECK = Curve(tuple(_SPEEDS), tuple(2e-5 + 3e-5 * np.exp(-((_SPEEDS / 75.0) ** 2))))
_ANGLES = np.linspace(0.0, 2.0 * math.pi, 201)
SINE = Curve(tuple(_ANGLES), tuple(3e-5 * np.sin(_ANGLES)))
ACCURACY = {
    "dry friction": (UnitEffects(friction_forward=DRY, friction_backward=Curve((0.0,), (1e-4,))), None, None),
    "Stribeck": (UnitEffects(friction_forward=STRIBECK, friction_backward=STRIBECK),) * 2 + (None,),
    "dead zone, limit": (
        UnitEffects(command=Curve((-12.0, -0.3, 0.3, 12.0), (-11.7, 0.0, 0.0, 11.7)), limit_v=5.0), None, None,
    ),
    "drop": (UnitEffects(drop=Curve((-2.0, 0.0, 0.0, 2.0), (-0.5, -0.3, 0.3, 0.5))),) * 2 + (None,),
    "torque": (UnitEffects(torque=Curve((-2000.0, 0.0, 2000.0), (-1e-4, 0.0, 3e-4))), None, None),
    "ripple": (UnitEffects(ripple=SINE, ripple_periods_per_rad=0.3, ripple_start_rad=1.0), None, None),
    "heat": (UnitEffects(heat_rise_per_w=0.2, heat_tau_s=1.0), None, None),
    "sag, decline, delay": (
        None, None, SupplyEffects(voltage_v=12.0, source_resistance_ohm=1.0, decline_v_per_s=0.5, command_delay_s=3e-3),
    ),
    "load": (UnitEffects(load_share=0.3), None, None),
    "own motor, friction": (
        UnitEffects(motor=MotorParameters(9.0, 1.1e-3, 6e-3, 6.2e-3, 2e-7, 5e-7), friction_forward=DRY,
                    friction_backward=DRY), None, None,
    ),
}  # fmt: skip


def deviation(left, right, supply, method, step=H):
    """Largest difference to the float64 reference at any of 50,000 steps, of full scale: (current, speed)."""
    values = [float(np.float32(value)) for value in (*PARAMETERS[:6], step)]
    t = np.arange(500) * 100 * H  # the same drive at every step: at a shorter one it is as much quicker
    volts = np.column_stack([5.0 * np.sin(9.0 * t) + 0.5, -6.0 * np.sin(7.0 * t) * np.sign(np.sin(40.0 * t))])
    torques = np.column_stack([3e-4 * np.sin(23.0 * t), 2e-4 * np.cos(11.0 * t)])
    volts, torques = volts.astype(np.float32).astype(float), torques.astype(np.float32).astype(float)
    words = tables_of(left, right, supply, values)
    pair = EffectPair()
    pair.set_parameters(words.side_values(values), method)
    pair.load(words)
    got = np.concatenate([pair.step(v, load, 100, 1) for v, load in zip(volts, torques, strict=True)])
    want = effect_reference.run(
        (left or UnitEffects(), right or UnitEffects()), supply or SupplyEffects(), values, method,
        np.repeat(volts, 100, axis=0), np.repeat(torques, 100, axis=0),
    )  # fmt: skip
    miss = np.abs(got[1:, :, :2].astype(float) - want)
    return miss[:, :, 0].max() / (SUPPLY_V / R), miss[:, :, 1].max() / (SUPPLY_V / KB)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("step", [H, 1e-6])
@pytest.mark.parametrize("effect", ACCURACY)
def test_the_unit_keeps_to_the_float64_reference_with_the_effect_on(effect, step, method):
    current, speed = deviation(*ACCURACY[effect], method, step)
    print(f"{effect}, {step:g} s, {method}: {current:.2e} in current, {speed:.2e} in speed")
    assert current < CURRENT_BOUND
    assert speed < SPEED_BOUND


# ---- what a table holds
# ------------------------------------------------------------------------------------------------


def test_points_on_a_grid_through_zero_are_held_exactly_but_for_the_rounding():
    curve = Curve((-12.0, -0.5, 0.5, 12.0), (-11.5, 0.0, 0.0, 11.5))
    (found,) = tables_of(UnitEffects(command=curve), None, None, PARAMETERS).deviations
    assert (found.side, found.table, found.shift) == ("left", "command", 0.0)
    assert found.value < 1e-6


def test_a_kink_off_the_grid_is_cut_and_a_jump_moved_by_at_most_half_a_cell_and_both_are_told():
    kink = Curve((0.0, math.pi, 100.0), (1e-4, 2e-5, 3e-5))
    jump = Curve((0.0, math.sqrt(2.0) * 10.0, math.sqrt(2.0) * 10.0, 100.0), (1e-4, 1e-4, 2e-4, 2e-4))
    found = tables_of(UnitEffects(friction_forward=kink, friction_backward=jump), None, None, PARAMETERS).deviations
    forward, backward = found
    assert isinstance(forward, Deviation)
    assert 1e-9 < forward.value < 4e-5 * forward.cell / math.pi
    assert 0.0 < backward.shift <= 0.5 * backward.cell
    assert backward.value < 1e-10


@pytest.mark.parametrize(
    ("unit", "line"),
    [
        (UnitEffects(drop=Curve((0.0, 0.1), (0.0, -2.0))), "left: drop: it falls"),
        (UnitEffects(heat_rise_per_w=0.1, heat_tau_s=5e-6), "left: heat_tau_s"),
        (UnitEffects(limit_v=3.0, command=Curve((0.0, 1.0), (0.0, 1e39))), "left: effects: .* single precision"),
    ],
)
def test_what_the_unit_cannot_hold_is_refused_by_name(unit, line):
    with open_link("model") as link:
        link.set_effects(unit, None, None)
        with pytest.raises(InputError, match=line):
            link.set_parameters(*PARAMETERS)


def test_a_delay_is_a_whole_number_of_steps():
    with pytest.raises(InputError, match="command_delay_s: 2.5e-05 s is not a whole number"):
        tables_of(None, None, SupplyEffects(command_delay_s=2.5e-5), PARAMETERS)


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (lambda: Curve((1.0, 0.0), (0.0, 0.0)), r"x\[1\] = 0 is less than x\[0\] = 1"),
        (lambda: Curve((0.0, math.nan), (0.0, 0.0)), r"x\[1\]: nan is not a finite number"),
        (lambda: Curve((0.0,), (0.0, 1.0)), "1 points of x and 2 of y"),
        (lambda: Curve((0.0, 0.0, 0.0), (0.0, 1.0, 2.0)), "three points at x = 0"),
        (lambda: UnitEffects(friction_forward=DRY), "one of them is absent"),
        (lambda: UnitEffects(friction_forward=Curve((-1.0,), (0.0,)), friction_backward=DRY), "a point at -1 rad/s"),
        (lambda: UnitEffects(load_share=1.0), "load_share: 1 must be"),
        (lambda: UnitEffects(limit_v=-1.0), "limit_v: -1"),
        (lambda: UnitEffects(ripple=DRY), "ripple_periods_per_rad"),
        (lambda: UnitEffects(ripple=Curve((0.0, 7.0), (0.0, 1.0))), "one period from 0 to 2 pi"),
        (lambda: UnitEffects(heat_tau_s=0.0), "heat_tau_s"),
        (lambda: SupplyEffects(source_resistance_ohm=1.0), "voltage_v: sag and decline need"),
        (lambda: SupplyEffects(command_delay_s=-1.0), "command_delay_s: -1"),
        (lambda: MotorParameters(0.0, 1.0, 1.0, 1.0, 1.0, 1.0), "resistance_ohm: 0 must be greater"),
    ],
)
def test_effects_that_cannot_be_meant_are_refused(make, line):
    with pytest.raises(InputError, match=line):
        make()
