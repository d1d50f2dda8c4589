"""The C library of the motor units gives the model's bytes, whatever it is loaded with."""

import re
import subprocess

import numpy as np
import pytest

from rtds_host.errors import InputError, LinkError
from rtds_host.link import open_link
from rtds_host.motor.effect_model import EffectPair
from rtds_host.motor.effect_program import CONSTANTS, TABLES
from rtds_host.motor.effect_tables import tables_of
from rtds_host.motor.effects import Curve, MotorParameters, SupplyEffects, UnitEffects
from rtds_host.motor.model import canonical_words
from rtds_host.motor.parameters import METHODS
from rtds_host.native.library import SOURCES, NativeLink, NativePair, compile_shared

PARAMETERS = (8.6, 1e-3, 6.538e-3, 6.538e-3, 1e-7, 4.372e-7, 1e-5)


def drawn_parameters(rng):
    """(2, 7) parameters within two decades of the burger's; a shared step."""
    values = np.array(PARAMETERS) * 10.0 ** rng.uniform(-1.0, 1.0, (2, 7))
    values[:, 6] = 10.0 ** rng.uniform(-6.0, -4.0)
    return values


def drawn_words(rng):
    """Constants and tables of the sizes that effects have, some of them absent, some out of all proportion."""
    scale = np.array([10.0, 10.0, 0.1, 255.0, 0.1, -0.1, 1e-3, 1e-6, 1.0, 8.0, 1e-4, 1e-4, 1e-4, 0.3, -0.2])
    constants = (scale * rng.uniform(0.0, 2.0, (2, len(CONSTANTS)))).astype(np.float32)
    constants[rng.random(constants.shape) < 0.2] = 0.0
    constants[:, CONSTANTS.index("nominal")] = 1.0
    if rng.random() < 0.3:
        constants[0, CONSTANTS.index("limit")] = np.inf
    tables = np.zeros((2, len(TABLES), 256, 2), np.float32)
    for k, (intercept, slope) in enumerate(
        ((0.5, 1.0), (0.3, 0.05), (1e-4, 1e-6), (1e-5, 1e-5), (1e-4, 1e-7), (1e-4, 1e-7))
    ):
        tables[:, k, :, 0] = rng.normal(0.0, intercept, (2, 256))
        tables[:, k, :, 1] = rng.normal(0.0, slope, (2, 256))
    if rng.random() < 0.1:
        tables[1, rng.integers(6)] *= np.float32(1e30)
    return constants, tables


@pytest.mark.parametrize("seed", range(8))
def test_a_quarter_million_random_steps_with_effects_are_bit_equal_with_the_model(motor_library, seed):
    rng = np.random.default_rng(seed)
    steps = 0
    while steps < 250_000:
        model, native = EffectPair(), NativePair(motor_library)
        values, method = drawn_parameters(rng), METHODS[rng.integers(2)]
        constants, tables = drawn_words(rng)
        on, delay, stride = rng.random() < 0.8, int(rng.integers(0, 50)), int(rng.integers(1, 4))
        model.constants[:], model.tables[:] = constants, tables
        model.switch(on, delay, stride)
        model.set_parameters(values, method)
        native.set_effects(on, constants, tables, delay, stride)
        native.set_parameters(values, method)
        for number in range(25):
            v, t = rng.uniform(-12.0, 12.0, 2).astype(np.float32), rng.normal(0.0, 3e-4, 2).astype(np.float32)
            count, every = int(rng.integers(1, 2000)), int(rng.integers(1, 400))
            expected = model.samples(model.step(v, t, count, every))
            got = native.step(v, t, count, every)
            assert np.array_equal(canonical_words(got), canonical_words(expected)), (seed, steps, number)
            assert np.array_equal(canonical_words(native.state), model.words())
            assert native.step_count == model.step_count
            steps += count
            if number == 12:  # parameters change as it runs, and act a step later
                values[:, :6] *= rng.uniform(0.8, 1.25, (2, 6))
                model.set_parameters(values, method)
                native.set_parameters(values, method)
            if number == 18:
                model.clear()
                native.clear()


def test_a_link_on_the_library_gives_the_bytes_of_the_model_link(motor_library):
    level = Curve((0.0, 100.0), (2e-4, 1e-4))
    left = UnitEffects(
        motor=MotorParameters(9.0, 1.1e-3, 6e-3, 6.2e-3, 2e-7, 5e-7),
        friction_forward=level, friction_backward=level, drop=Curve((0.0, 0.0), (-0.3, 0.3)),
        heat_rise_per_w=0.2, heat_tau_s=1e-2, load_share=0.2,
    )  # fmt: skip
    supply = SupplyEffects(voltage_v=12.0, source_resistance_ohm=1.0, decline_v_per_s=2.0, command_delay_s=3e-4)
    rng = np.random.default_rng(1)
    for effects in ((), (left, None, supply), (None, UnitEffects(motor=left.motor), None)):
        with open_link("model") as model, NativeLink(motor_library) as native:
            for link in (model, native):
                if effects:
                    link.set_effects(*effects)
                link.set_parameters(*PARAMETERS)
            for _ in range(40):
                v, t = rng.uniform(-12.0, 12.0, 2), rng.normal(0.0, 1e-4, 2)
                expected, got = (link.exchange(v, t, 0.032, 1e-3) for link in (model, native))
                assert got.speeds.tobytes() == expected.speeds.tobytes()
                assert got.currents.tobytes() == expected.currents.tobytes()
                assert np.array_equal(got.t_s, expected.t_s)


def test_what_cannot_be_a_motor_is_refused_and_the_old_parameters_stay(motor_library):
    pair, same = NativePair(motor_library), NativePair(motor_library)
    good = np.array([PARAMETERS, PARAMETERS])
    for each in (pair, same):
        each.set_parameters(good, METHODS[0])
        each.step([6.0, 6.0], [0.0, 0.0], 10)
    for bad in (0.0, -1.0, np.nan, np.inf, 1e-40):
        values = good.copy()
        values[1, 0] = bad
        with pytest.raises(InputError, match="outside single precision"):
            pair.set_parameters(values, METHODS[0])
    words = tables_of(None, None, None, PARAMETERS)
    with pytest.raises(InputError, match="number of steps"):
        pair.set_effects(True, words.constants, words.tables, 4096, 1)
    assert np.array_equal(pair.step([6.0, 6.0], [0.0, 0.0], 10), same.step([6.0, 6.0], [0.0, 0.0], 10))


def test_the_header_counts_what_the_model_has():
    text = (SOURCES / "rtds_motor.h").read_text()
    for kind, names in (("constant", CONSTANTS), ("table", TABLES)):
        found = re.search(rf"enum rtds_{kind} {{(.*?)}};", text, re.DOTALL)
        assert found is not None
        assert [name.lower() for name in re.findall(r"RTDS_(\w+)", found.group(1))] == list(names)


def test_it_does_not_compile_where_the_compiler_may_reorder(tmp_path):
    done = subprocess.run(
        ["g++", "-x", "c++", "-std=c++11", "-ffast-math", "-c", SOURCES / "rtds_motor.c", "-o", tmp_path / "m.o"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode != 0 and "fast-math" in done.stderr


def test_a_compiler_that_is_not_there_or_fails_is_said_in_one_line(tmp_path, monkeypatch):
    (tmp_path / "bad.c").write_text("int f(void) { return nothing; }\n")
    with pytest.raises(LinkError, match="compiling out.so failed: .*nothing"):
        compile_shared([tmp_path / "bad.c"], tmp_path / "out.so")
    assert not (tmp_path / "out.so").exists()
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(LinkError, match="no C compiler"):
        compile_shared([tmp_path / "bad.c"], tmp_path / "out.so")
