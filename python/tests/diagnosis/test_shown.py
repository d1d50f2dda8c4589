"""Which effects of a diagnosis the runs of another case show."""

import pytest
from diagnosis_cases import make_case

from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.shown import gaps_without, smallest_gap
from rtds_host.errors import InputError

FRICTION = {"id": "coulomb_friction", "side": "both", "parameters": {"torque_nm": {"value": 0.02}}}
BIAS = {"id": "gyro_bias", "side": "both", "parameters": {"rad_s": {"value": 0.01}}}


def test_runs_show_the_effect_that_they_have_at_its_own_size_and_no_other():
    """The machine's friction is 0.05 N m, and its gyro has no bias."""
    problem = Problem(make_case(lambda model: model.add("coulomb", 0.05)), 1)
    found = gaps_without(problem, {"effects": [FRICTION, BIAS]})
    left, without = found["coulomb_friction", "both"]
    assert left < 1.1 and without > 1.5 * left
    left, without = found["gyro_bias", "both"]
    assert without == pytest.approx(left, rel=0.02)


@pytest.mark.parametrize("given", [0.02, 0.5])
def test_other_sizes_of_the_same_effects_are_found_from_afar(given):
    """The machine's friction is 0.05 N m; a bias of the gyro cannot stand in for it."""
    case = make_case(lambda model: model.add("coulomb", 0.05))
    friction = {**FRICTION, "parameters": {"torque_nm": {"value": given}}}
    assert smallest_gap(case, {"effects": [friction]}) < 1.1
    assert smallest_gap(case, {"effects": [BIAS]}) > 1.5


def test_an_effect_that_the_machine_cannot_have_is_refused():
    with pytest.raises(InputError, match="pendulum_spring: this machine has no such effect"):
        gaps_without(Problem(make_case(), 1), {"effects": [{**FRICTION, "id": "pendulum_spring"}]})
