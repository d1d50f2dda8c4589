"""The link with 12-bit converters: each stage rounds its own quantity, by half a step at most, and tells of
clipping.
"""

from __future__ import annotations

import numpy as np
import pytest

from rtds_host.contract import builtin_robot
from rtds_host.link import open_link
from rtds_host.link.quantised import STAGES, QuantisedLink
from rtds_host.link.scaling import default_scaling
from rtds_host.studies.quantisation import cost, ranges

MOTOR = builtin_robot("burger").motor
SCALING = default_scaling()


def parameters(**changes):
    values = {
        "resistance_ohm": MOTOR.resistance_ohm,
        "inductance_h": MOTOR.inductance_h,
        "torque_constant_nm_per_a": MOTOR.torque_constant_nm_per_a,
        "back_emf_constant_v_s_per_rad": MOTOR.back_emf_constant_v_s_per_rad,
        "rotor_inertia_kg_m2": MOTOR.rotor_inertia_kg_m2,
        "viscous_friction_nm_s_per_rad": MOTOR.viscous_friction_nm_s_per_rad,
        "step_s": 1e-5,
    }
    return values | changes


def run(stages, voltages=(5.003, -3.001), torques=(1.0003e-4, -2.0007e-5)):
    with QuantisedLink(open_link("model"), stages=stages) as link:
        link.set_parameters(**parameters())
        return link.exchange(voltages, torques, 0.05, 0.001), link.clipped


IDEAL, _ = run(())


def test_without_stages_it_is_the_ideal_link():
    with open_link("model") as link:
        link.set_parameters(**parameters())
        plain = link.exchange((5.003, -3.001), (1.0003e-4, -2.0007e-5), 0.05, 0.001)
    assert np.array_equal(plain.speeds, IDEAL.speeds) and np.array_equal(plain.currents, IDEAL.currents)


@pytest.mark.parametrize("stage", STAGES)
def test_each_stage_alone_costs_something_and_clips_nothing(stage):
    got, clipped = run((stage,))
    assert not clipped
    assert not np.array_equal(got.speeds, IDEAL.speeds)


def test_outputs_are_off_by_half_a_step_at_most():
    got, _ = run(("outputs",))
    assert np.abs(got.currents - IDEAL.currents).max() <= 0.5 / float(SCALING.output("i_l").gain) * (1 + 1e-6)
    assert np.abs(got.speeds - IDEAL.speeds).max() <= 0.5 / float(SCALING.output("w_l").gain) * (1 + 1e-6)


def test_inputs_on_a_code_cost_nothing():
    step_v, step_t = float(SCALING.channel("v_l").gain), float(SCALING.channel("t_l").gain)
    inputs = {"voltages": (700 * step_v, -300 * step_v), "torques": (100 * step_t, -7 * step_t)}
    assert np.array_equal(run(("voltages", "torques"), **inputs)[0].speeds, run((), **inputs)[0].speeds)


def test_steady_speed_is_off_by_what_half_a_step_of_voltage_and_torque_makes():
    got, _ = run(("voltages", "torques"))
    resistance, km, kb, b = 8.6, MOTOR.torque_constant_nm_per_a, MOTOR.back_emf_constant_v_s_per_rad, 4.372e-7
    stiffness = kb * km / resistance + b
    volts, torque = 0.5 * float(SCALING.channel("v_l").gain), 0.5 * float(SCALING.channel("t_l").gain)
    bound = (volts * km / resistance + torque) / stiffness
    assert np.abs(got.speeds - IDEAL.speeds).max() <= bound * 1.001


def test_what_a_range_cuts_is_named():
    assert run(STAGES, voltages=(20.0, 0.0))[1] == {"v_l", "w_l"}
    assert run(STAGES, torques=(0.0, 3e-3))[1] == {"t_r"}
    with QuantisedLink(open_link("model")) as link:
        link.set_parameters(**parameters(rotor_inertia_kg_m2=1e-6))
        assert link.clipped == {"j"}


def test_cost_is_the_worst_and_the_rms_over_both_motors():
    figures = cost(np.array([[3e-3, -4e-3], [0.0, 0.0]]), np.array([[0.0, 1.0], [1.0, -2.0]]), ["i_l"])
    assert figures.current_max_a == 4e-3 and figures.speed_max_rad_s == 2.0
    assert figures.current_rms_a == pytest.approx(2.5e-3) and figures.speed_rms_rad_s == pytest.approx(np.sqrt(1.5))


def test_table_of_ranges_has_a_line_for_every_converter():
    assert len(ranges().splitlines()) == 2 + 12
