"""rtds_core on both simulators: its ports clock by clock (cocotb), and long runs word for word (C++ bench)."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from common.runner import SIMULATORS, VERILATOR, include_flags, read_file_list, run_cocotb, verilate

from core.core_script import drive_script, expected, random_script

SOURCES = ["rtl/fp/fp.f", "rtl/core/core.f"]
COLUMNS = ("i_l", "w_l", "i_r", "w_r", "i_l_lo", "w_l_lo", "i_r_lo", "w_r_lo", "fault and nonfinite")
needs_verilator = [s for s in SIMULATORS if s == "verilator"]
needs_icarus = [s for s in SIMULATORS if s == "icarus"]


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_core_keeps_the_contract_of_its_ports(simulator):
    run_cocotb("rtds_core", SOURCES, "tb_core", "tb/core", simulator)


def assert_every_word_equal(script: np.ndarray, folder: Path, extra: int) -> None:
    """Run the script on Verilator; every step's words, flags and latencies are the model's."""
    program = verilate("rtds_core", SOURCES, "tb/core/core_bench.cpp")
    script.astype("<u4").tofile(folder / "script.bin")
    command = [program, folder / "script.bin", folder / "out.bin", str(extra)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    got = np.fromfile(folder / "out.bin", dtype="<u4").reshape(-1, len(COLUMNS))
    want = expected(script)
    assert len(got) == len(want)
    wrong = np.argwhere(got != want)
    shown = [f"step {n} {COLUMNS[k]}: {got[n, k]:08x}, model {want[n, k]:08x}" for n, k in wrong[:6]]
    assert not len(wrong), f"{len(wrong)} words differ: {'; '.join(shown)}"


@pytest.mark.parametrize("simulator", needs_verilator)
def test_every_word_of_random_steps_and_parameters_equals_the_model(simulator, tmp_path):
    assert_every_word_equal(random_script(4000, strobes=8, seed=31, wild=0.0), tmp_path, extra=3)


@pytest.mark.parametrize("simulator", needs_verilator)
def test_every_word_equals_the_model_with_arbitrary_words_as_inputs(simulator, tmp_path):
    assert_every_word_equal(random_script(4000, strobes=4, seed=32, wild=0.3), tmp_path, extra=0)


@pytest.mark.parametrize("simulator", needs_verilator)
def test_every_word_of_two_seconds_of_driving_equals_the_model(simulator, tmp_path):
    assert_every_word_equal(drive_script(2.0, seed=33), tmp_path, extra=0)


@pytest.mark.long
@pytest.mark.parametrize("simulator", needs_verilator)
def test_every_word_of_a_minute_of_driving_equals_the_model(simulator, tmp_path):
    assert_every_word_equal(drive_script(60.0, seed=34), tmp_path, extra=0)


@pytest.mark.long
@pytest.mark.parametrize("simulator", needs_verilator)
def test_every_word_of_many_random_parameter_sets_equals_the_model(simulator, tmp_path):
    assert_every_word_equal(random_script(100_000, strobes=8, seed=35, wild=0.1), tmp_path, extra=2)


@pytest.mark.long
@pytest.mark.parametrize("simulator", needs_icarus)
def test_icarus_agrees_over_many_random_steps(simulator):
    environment = {"CORE_STEPS": "20000", "CORE_SEED": "2"}
    testcase = "random_steps_equal_the_model_word_for_word"
    run_cocotb("rtds_core", SOURCES, "tb_core", "tb/core", simulator, testcase=testcase, extra_env=environment)


@pytest.mark.parametrize("simulator", needs_verilator)
@pytest.mark.parametrize("source", [path.name for path in read_file_list("rtl/core/core.f")])
def test_lint_is_clean(simulator, source):
    files = [str(path) for name in SOURCES for path in read_file_list(name)]
    command = [VERILATOR, "--lint-only", "-Wall", "--top-module", Path(source).stem, *include_flags(SOURCES), *files]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
