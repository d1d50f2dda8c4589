"""The motor pair: when parameters act, what is refused, how samples are taken, and the balance of energy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rtds_host.errors import InputError
from rtds_host.motor import CoreModel, MotorPair, coefficients, parameter_words, reference
from rtds_host.motor.accuracy import NOMINAL
from rtds_host.motor.parameters import METHODS, PARAMETER_NAMES

STEP_S = 1e-5


def pair(method: str = "backward_euler", **options) -> MotorPair:
    made = MotorPair(**options)
    made.set_parameters(*NOMINAL, STEP_S, method)
    return made


def as_words(values) -> np.ndarray:
    return np.asarray(values, dtype=np.float32).view(np.uint32)


def test_first_step_rests_for_want_of_coefficients():
    motors = pair()
    assert not motors.step((12.0, 12.0), (0.0, 0.0), 1).any()
    assert motors.step((12.0, 12.0), (0.0, 0.0), 1).all()


def test_input_acts_in_its_own_step_and_parameter_one_step_later():
    motors, twin = pair(), pair()
    for both in (motors, twin):
        both.step((12.0, 6.0), (0.0, 0.0), 100)
    motors.set_parameters(4.3, *NOMINAL[1:], STEP_S)
    same = motors.step((-12.0, 6.0), (0.0, 0.0), 1), twin.step((-12.0, 6.0), (0.0, 0.0), 1)
    assert np.array_equal(*same), "the step after set_parameters still uses the old coefficients"
    other = motors.step((-12.0, 6.0), (0.0, 0.0), 1), twin.step((-12.0, 6.0), (0.0, 0.0), 1)
    assert not np.array_equal(*other), "the one after it uses the new ones"


@pytest.mark.parametrize("method", METHODS)
def test_pair_and_core_model_give_the_same_words(method):
    motors, core = pair(method), CoreModel()
    words = as_words((*NOMINAL, STEP_S))
    rng = np.random.default_rng(5)
    for _ in range(50):
        v, t, n = rng.uniform(-12, 12, 2), rng.uniform(-5e-3, 5e-3, 2), int(rng.integers(1, 40))
        samples = motors.step(v, t, n, sample_every=1)
        states = core.run(as_words(v), as_words(t), words, METHODS.index(method), n)
        assert np.array_equal(samples.view(np.uint32), states[:, :, :2].reshape(n, 4))
        assert np.array_equal(motors.words(), states[-1])
    assert motors.step_count == core.step_count


@pytest.mark.parametrize("n_steps, every, rows", [(1, None, 1), (10, None, 1), (10, 10, 1), (10, 3, 4), (10, 99, 1)])
def test_samples_stand_at_multiples_and_at_the_end(n_steps, every, rows):
    fine = pair().step((12.0, -3.0), (0.0, 1e-3), n_steps, sample_every=1)
    samples = pair().step((12.0, -3.0), (0.0, 1e-3), n_steps, sample_every=every)
    assert samples.dtype == np.float32
    kept = sorted({*range(every or n_steps, n_steps + 1, every or n_steps), n_steps})
    assert np.array_equal(samples, fine[np.array(kept) - 1])
    assert len(samples) == rows


def test_splitting_a_run_changes_nothing():
    whole, parts = pair(), pair()
    whole.step((9.0, -4.0), (1e-3, 0.0), 1000)
    for n in (1, 1, 98, 900):
        parts.step((9.0, -4.0), (1e-3, 0.0), n)
    assert np.array_equal(whole.words(), parts.words())


def test_energy_option_changes_no_word():
    plain, counted = pair(), pair(energy=True)
    for v in (12.0, -3.0, 5.0):
        samples = [motors.step((v, -v), (1e-3, -2e-3), 777, sample_every=10) for motors in (plain, counted)]
        assert np.array_equal(*samples)
    assert np.array_equal(plain.words(), counted.words())


def test_clear_returns_to_rest_and_keeps_the_parameters():
    motors = pair(energy=True)
    motors.step((12.0, 6.0), (0.0, 0.0), 50)
    motors.clear()
    assert not motors.words().any() and motors.step_count == 0 and not motors.energy.drawn_j.any()
    assert motors.step((12.0, 6.0), (0.0, 0.0), 1).all()


def test_nan_in_the_state_is_seen_and_canonical():
    motors = pair()
    motors.step((math.inf, 1.0), (0.0, 0.0), 3)
    assert not motors.finite
    assert motors.words()[0, 0] == 0x7FC00000
    motors.clear()
    assert motors.finite


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf, -math.inf, 1e-40, 1e39])
@pytest.mark.parametrize("index", range(7))
def test_unusable_parameter_is_refused_by_name_and_the_old_ones_stay(index, bad):
    motors, twin = pair(), pair()
    values = [*NOMINAL, STEP_S]
    values[index] = bad
    with pytest.raises(InputError, match=PARAMETER_NAMES[index]):
        motors.set_parameters(*values)
    assert np.array_equal(motors.step((1.0, 2.0), (0.0, 0.0), 9), twin.step((1.0, 2.0), (0.0, 0.0), 9))


def test_overflowing_coefficient_is_refused_by_name():
    with pytest.raises(InputError, match="G11"):
        parameter_words((1e30, 1e30, *NOMINAL[2:4], 1e30, NOMINAL[5], STEP_S), "backward_euler")


def test_unknown_method_is_refused():
    with pytest.raises(InputError, match="dormand"):
        pair("dormand")


def test_energy_terms_need_the_option():
    with pytest.raises(InputError, match="energy=True"):
        _ = pair().energy


@pytest.mark.parametrize("n_steps, every", [(0, None), (-1, None), (5, 0)])
def test_fewer_than_one_step_is_refused(n_steps, every):
    with pytest.raises(InputError, match="at least 1"):
        pair().step((0.0, 0.0), (0.0, 0.0), n_steps, every)


@pytest.mark.parametrize("method", METHODS)
def test_coefficients_are_those_of_the_linear_solver(method):
    """G from the closed form equals (I - theta h A)^-1 h B with the sign of the load taken out."""
    rng = np.random.default_rng(6)
    for _ in range(200):
        values = np.array([*NOMINAL, STEP_S]) * 10.0 ** rng.uniform(-1, 1, 7)
        words, index = parameter_words(values, method)
        got = coefficients(words, index)[0][4:8].astype(np.float64).reshape(2, 2)
        _, d = reference.difference_matrices(words.astype(np.float64), method)
        want = d * np.array([[1.0, 1.0], [1.0, -1.0]])
        assert np.allclose(got, want, rtol=6e-7, atol=0.0)


def test_increment_matrix_is_minus_g_times_s():
    """C of x+ = x + C x + D u is -G S with S = [[R, Kb], [-Km, B]]: the factored form is the same equation."""
    values = [*NOMINAL, STEP_S]
    r, _, km, kb, _, b, _ = values
    for method in METHODS:
        c, d = reference.difference_matrices(values, method)
        g = d * np.array([1.0, -1.0])
        assert np.allclose(c, -g @ np.array([[r, kb], [-km, b]]), rtol=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_drawn_energy_is_accounted_for(method):
    """Driving, coasting and braking, both motors differently loaded: within 1e-5, and each term has its sign."""
    motors = pair(method, energy=True)
    for k in range(2000):
        v = 11.0 * math.sin(3e-3 * k)
        motors.step((v, -0.5 * v), (2e-3 * math.cos(5e-3 * k), 1e-3), 100)
    energy = motors.energy
    assert (energy.imbalance < 1e-5).all()
    assert (energy.copper_j > 0).all() and (energy.viscous_j > 0).all()
    assert (energy.supplied_j > 0).all() and (energy.recovered_j > 0).all()
    assert (energy.numerical_j == 0).all() if method == "trapezoidal" else (energy.numerical_j > 0).all()
    assert (energy.conversion_j == 0).all(), "Km = Kb converts without loss"


def test_energy_is_accounted_for_when_the_constants_differ():
    motors = MotorPair(energy=True)
    motors.set_parameters(*NOMINAL[:3], 1.1 * NOMINAL[3], *NOMINAL[4:], STEP_S)
    motors.step((12.0, -12.0), (1e-3, -1e-3), 20_000)
    assert (motors.energy.imbalance < 1e-5).all()
    assert (motors.energy.conversion_j > 0).all()


def test_load_that_drives_the_motor_gives_energy_back():
    """At 0.5 V and a pulling load the current is negative: the supply gets energy, from the load alone."""
    motors = pair(energy=True)
    motors.step((0.5, 0.5), (-5e-3, -5e-3), 50_000)
    assert (motors.step((0.5, 0.5), (-5e-3, -5e-3), 1)[0, ::2] < 0).all()
    energy = motors.energy
    assert (energy.recovered_j > energy.supplied_j).all()
    assert (energy.shaft_j < 0).all()
