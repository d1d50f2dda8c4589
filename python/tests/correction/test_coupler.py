"""Motors and robot exchange torques without lag, whatever stands between them."""

from dataclasses import replace

import numpy as np
import pytest

from rtds_host.contract import builtin_robot
from rtds_host.correction.correction import BodyValues
from rtds_host.correction.coupler import Coupler, set_effects
from rtds_host.correction.translate import translate
from rtds_host.diagnosis.effects import CATALOGUE, SIDES
from rtds_host.diagnosis.replay.model import nominal_model
from rtds_host.errors import InputError
from rtds_host.link import open_link
from rtds_host.robot import available_engines, default_engine, make_body, open_engine
from rtds_host.robot.split import wheel_inertia
from rtds_host.robot.urdf import base_inertia, yaw_inertia_kg_m2

ROBOT = builtin_robot("burger")
ENGINE = default_engine()
M = ROBOT.motor


def body_values(**changes):
    chassis = ROBOT.chassis
    values = {
        "mass_kg": chassis.mass_kg,
        "yaw_inertia_kg_m2": chassis.yaw_inertia_kg_m2,
        "wheel_radius_m": (chassis.wheel_radius_m,) * 2,
        "wheel_inertia_kg_m2": chassis.wheel_inertia_kg_m2,
        "track_width_m": chassis.track_width_m,
        "com_x_m": 0.0,
        "com_y_m": 0.0,
    } | changes
    return BodyValues(**values)


def drive(
    volts, seconds=0.4, payload=0.0, exchange_steps=1, predict=True, engine=ENGINE, slope=0.0, effects=(), robot=ROBOT
):
    """Speeds (n, 2) rad/s at the wheel each millisecond, with voltages (2,) from rest."""
    body = make_body(robot, payload, slope)
    model = nominal_model(robot)
    rotor = robot.motor.rotor_inertia_kg_m2
    for effect, values in effects:
        CATALOGUE[effect].apply(model, SIDES["both"], values)
    correction = translate(model, robot, payload)
    body = correction.body_on(body)
    with open_link("model") as link:
        link.set_parameters(
            M.resistance_ohm,
            M.inductance_h,
            M.torque_constant_nm_per_a,
            M.back_emf_constant_v_s_per_rad,
            rotor,
            M.viscous_friction_nm_s_per_rad,
            1e-5,
        )
        set_effects(link, correction)
        with open_engine(engine, body) as world:
            coupler = Coupler(robot, body, link, world, correction, exchange_steps, predict)
            rows = [
                coupler.advance([(np.array(volts, float), 1e-3 * exchange_steps)]).speeds[-1]
                for _ in range(round(seconds / 1e-3 / exchange_steps))
            ]
            return np.array(rows), world.state()


def exact(volts, seconds, inertia, rotor=M.rotor_inertia_kg_m2):
    """Speed at the wheel of a motor with so much inertia at the wheel next to its rotor, after a voltage step."""
    n = M.gear_ratio
    total = rotor + inertia / n**2
    km, r, inductance, b = M.torque_constant_nm_per_a, M.resistance_ohm, M.inductance_h, M.viscous_friction_nm_s_per_rad
    a = np.array([[-r / inductance, -km / inductance], [km / total, -b / total]])
    values, vectors = np.linalg.eig(a)
    still = np.linalg.solve(-a, [volts / inductance, 0.0])
    t = (np.arange(round(seconds / 1e-3)) + 1)[:, None] * 1e-3
    free = (vectors * np.linalg.solve(vectors, -still))[1] * np.exp(values * t)
    return (still[1] + free.sum(axis=1).real) / n


@pytest.mark.parametrize("engine", available_engines())
def test_a_voltage_step_accelerates_rotor_body_and_wheels_together(engine):
    speeds, _ = drive((6.0, 6.0), payload=2.0, engine=engine)
    body = make_body(ROBOT, 2.0)
    inertia = 0.5 * body.total_mass_kg * 0.033**2 + body.wheel_inertia_kg_m2
    assert np.abs(speeds[:, 0] - exact(6.0, 0.4, inertia)).max() < 2e-3


def test_without_prediction_the_load_comes_an_exchange_late():
    inertia = 0.5 * 3.0 * 0.033**2 + ROBOT.chassis.wheel_inertia_kg_m2
    truth = exact(6.0, 0.4, inertia)
    late, told = (np.abs(drive((6.0, 6.0), payload=2.0, predict=f)[0][:, 0] - truth).max() for f in (False, True))
    assert late > 10.0 * told


def test_a_body_heavier_than_the_plain_split_allows_stays_quiet():
    # 14 kg of payload: 1.2 times the rotor's inertia, at which the plain exchange rings (docs/robot.md).
    speeds, _ = drive((6.0, 6.0), payload=14.0)
    rise = np.diff(speeds[:, 0])
    assert (rise > -1e-6).all()


LIGHT = replace(ROBOT, motor=replace(M, rotor_inertia_kg_m2=M.rotor_inertia_kg_m2 / 200.0))


@pytest.mark.parametrize("engine", available_engines())
def test_rotors_far_lighter_than_the_body_go_with_it(engine):
    speeds, _ = drive((2.0, 2.0), payload=2.0, engine=engine, robot=LIGHT)
    inertia = 0.5 * 3.0 * 0.033**2 + ROBOT.chassis.wheel_inertia_kg_m2
    # The motors take the voltage up two of their steps late, in which the body would gain this much.
    late = 2e-5 * 2.0 / (M.gear_ratio * M.back_emf_constant_v_s_per_rad) / 5e-3
    assert np.abs(speeds[:, 0] - exact(2.0, 0.4, inertia, M.rotor_inertia_kg_m2 / 200.0)).max() < 2e-3 + late


def test_light_rotors_that_friction_holds_keep_still_and_turn_free_again():
    effects = [("coulomb_friction", {"torque_nm": 0.05})]
    held, _ = drive((0.2, 0.2), effects=effects, robot=LIGHT)
    assert np.all(held == 0.0)
    moving, _ = drive((1.0, 1.0), effects=effects, robot=LIGHT, seconds=0.2)
    assert np.all(np.diff(moving[:, 0]) > -1e-6)
    # Coulomb friction takes its share of the voltage, R T / (N Km), and none of the body's inertia stays behind.
    n = M.gear_ratio
    left = 1.0 - M.resistance_ohm * 0.05 / (n * M.torque_constant_nm_per_a)
    slope = n * (
        M.back_emf_constant_v_s_per_rad
        + M.resistance_ohm * M.viscous_friction_nm_s_per_rad / M.torque_constant_nm_per_a
    )
    assert moving[-1] == pytest.approx([left / slope] * 2, rel=1e-3)


def test_friction_that_grows_with_the_load_is_refused_where_the_unit_would_see_a_part_of_it():
    with pytest.raises(InputError, match="gear friction that grows with the load"):
        drive((1.0, 1.0), effects=[("load_friction", {"ratio": 0.2})], robot=LIGHT)


def test_what_was_predicted_wrongly_is_made_good():
    # A gear in free play hits without warning; wheels and rotor must end at a common speed all the same.
    # After a rebound the body coasts through the play, and closes it later.
    for restitution, seconds in ((0.0, 1.0), (0.4, 4.0)):
        play = {"angle_rad": 0.05, "restitution": restitution}
        speeds, state = drive((4.0, 4.0), seconds, effects=[("backlash", play)])
        assert speeds[-1, 0] * 0.033 == pytest.approx(state.speed_m_s, abs=1e-4)


def test_scrub_holds_the_heading_and_then_gives_way():
    _, straight = drive((3.0, 3.1), effects=[("spin_scrub", {"torque_nm": 0.2})])
    _, turned = drive((-3.0, 3.0), effects=[("spin_scrub", {"torque_nm": 0.2})])
    _, free = drive((-3.0, 3.0))
    assert abs(straight.yaw_rad) < 1e-5
    assert 0.1 < turned.yaw_rad < 0.95 * free.yaw_rad


@pytest.mark.parametrize("volts", [(0.5, -0.5), (0.5, 0.5), (-0.5, 0.0)])
def test_wheels_that_stick_hold_the_turn_without_the_scrub(volts):
    # The impulse of the scrub that stops a turn is 0/0 where two wheels that stick leave none.
    effects = [("spin_scrub", {"torque_nm": 0.05}), ("coulomb_friction", {"torque_nm": 0.3})]
    speeds, state = drive(volts, seconds=0.1, effects=effects)
    assert np.abs(speeds).max() < 1e-9
    assert abs(state.yaw_rate_rad_s) < 1e-7


def test_a_spring_lets_the_wheel_swing_about_the_rotor():
    soft, _ = drive(
        (6.0, 6.0), effects=[("gear_compliance", {"stiffness_nm_per_rad": 2.0, "damping_nm_s_per_rad": 0.0})]
    )
    stiff, _ = drive((6.0, 6.0))
    assert 0.05 < np.abs(soft - stiff).max() < 1.0
    assert soft[200:, 0].mean() == pytest.approx(stiff[200:, 0].mean(), abs=0.02)


@pytest.mark.parametrize("payload", [0.0, 2.0])
@pytest.mark.parametrize("com", [(0.0, 0.0), (0.02, 0.01), (-0.05, 0.015)])
def test_the_engine_has_the_inertia_the_layer_counts_with(com, payload):
    body = body_values(com_x_m=com[0], com_y_m=com[1]).on(make_body(ROBOT, payload))
    inertia, _ = wheel_inertia(body, yaw_inertia_kg_m2(body))
    with open_engine(ENGINE, body) as engine:
        rise = np.array([0.03, -0.02])
        # From rest and within a millisecond nothing but inertia acts.
        torque = engine.advance(rise[None, :]) - engine.hold()
    assert torque == pytest.approx((inertia + body.wheel_inertia_kg_m2 * np.eye(2)) @ rise / 1e-3, rel=2e-3, abs=1e-5)


def test_a_centre_of_mass_too_far_off_is_built_as_near_as_it_goes():
    body = body_values(com_x_m=-0.05, com_y_m=0.0).on(make_body(ROBOT, 2.0))
    assert base_inertia(body).inertia_kg_m2[2] > 0.0
    assert yaw_inertia_kg_m2(body) > ROBOT.chassis.yaw_inertia_kg_m2


def test_little_yaw_inertia_leaves_a_base():
    body = body_values(yaw_inertia_kg_m2=1.3e-4).on(make_body(ROBOT))
    assert base_inertia(body).inertia_kg_m2[2] > 0.0
    assert yaw_inertia_kg_m2(body) == pytest.approx(1.3e-4)


@pytest.mark.parametrize(("changes", "word"), [({"mass_kg": -0.2}, "mass"), ({"slope_extra_rad": 0.8}, "slope")])
def test_a_body_that_cannot_be_is_refused(changes, word):
    with pytest.raises(InputError, match=word):
        body_values(**changes).on(make_body(ROBOT))
