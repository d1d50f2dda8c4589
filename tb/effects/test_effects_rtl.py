"""The core with effects on both simulators: every word of every step against the model, and its ports clock by clock."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from common.runner import ROOT, SIMULATORS, run_cocotb, verilate

from effects.effect_script import Script, sensible, wild
from rtds_host.motor import effect_program

SOURCES = ["rtl/fp/fp.f", "rtl/core/core.f"]
COLUMNS = ("i_l", "w_l", "i_r", "w_r", "i_l_lo", "w_l_lo", "i_r_lo", "w_r_lo", "fault and nonfinite")
needs_verilator = [s for s in SIMULATORS if s == "verilator"]
needs_icarus = [s for s in SIMULATORS if s == "icarus"]


def test_the_program_in_the_rtl_is_the_one_of_the_model():
    assert (ROOT / "rtl/effects/effect_program.v").read_text() == effect_program.verilog()


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_the_ports_with_effects_clock_by_clock(simulator):
    run_cocotb("rtds_core", SOURCES, "tb_effects", "tb/effects", simulator)


@pytest.mark.long
@pytest.mark.parametrize("simulator", needs_icarus)
def test_thousands_of_random_steps_with_effects_on_icarus(simulator):
    run_cocotb("rtds_core", SOURCES, "tb_effects", "tb/effects", simulator,
               testcase="random_effects_switched_and_changed_while_the_motors_turn", extra_env={"EFFECT_STEPS": "4000"})  # fmt: skip


def test_no_operation_reads_what_is_not_written_yet_and_none_overwrites_what_is_still_needed():
    """In the program as issued, carried out with the engine's latencies: reads see what the list of operations means."""
    instructions = effect_program.schedule()
    written = {instruction.target: instruction.pair for instruction in instructions}
    for instruction in instructions:
        operands = [] if instruction.a_outside else [instruction.a]
        if not instruction.b_outside and instruction.op in ("mul", "add", "sub", "pos", "neg", "clamp"):
            operands.append(instruction.b)
        for address in operands:
            if address >= effect_program.STATE_FIRST:  # the old value: read before the new one is written
                assert instruction.pair <= written[address] + 1
            elif address >= effect_program.TEMPORARY_FIRST:
                assert instruction.pair >= written[address] + effect_program.LATENCY_PAIRS + instruction.across
    assert len({instruction.pair for instruction in instructions}) == len(instructions)


def assert_every_word_equal(script: Script, folder: Path, extra: int) -> None:
    """Run the script on Verilator; every step's words, flags and latencies are the model's."""
    program = verilate("rtds_core", SOURCES, "tb/effects/effect_bench.cpp", name="rtds_core-effects-bench")
    script.data.astype("<u4").tofile(folder / "script.bin")
    command = [program, folder / "script.bin", folder / "out.bin", str(extra)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    got = np.fromfile(folder / "out.bin", dtype="<u4").reshape(-1, len(COLUMNS))
    want = script.expected
    assert len(got) == len(want)
    wrong = np.argwhere(got != want)
    shown = [f"step {n} {COLUMNS[k]}: {got[n, k]:08x}, model {want[n, k]:08x}" for n, k in wrong[:6]]
    assert not len(wrong), f"{len(wrong)} words differ: {'; '.join(shown)}"


@pytest.mark.parametrize("simulator", needs_verilator)
def test_every_word_of_random_effects_and_motors_equals_the_model(simulator, tmp_path):
    script = sensible(np.random.default_rng(41), parts=100, strobes=60)
    states = script.expected.view(np.float32)[:, :8]
    # The script is worth something: motors turn, stick at exactly zero, and start again.
    for speed in (states[:, 1], states[:, 3]):
        assert np.abs(speed).max() > 100.0
        assert 0.02 < (speed == 0.0).mean() < 0.9
        assert ((speed[1:] != 0.0) & (speed[:-1] == 0.0)).sum() > 20
    assert_every_word_equal(script, tmp_path, extra=3)


@pytest.mark.parametrize("simulator", needs_verilator)
def test_every_word_equals_the_model_with_arbitrary_words_everywhere(simulator, tmp_path):
    assert_every_word_equal(wild(np.random.default_rng(42), parts=150), tmp_path, extra=0)


@pytest.mark.long
@pytest.mark.parametrize("simulator", needs_verilator)
def test_every_word_of_many_random_effects_equals_the_model(simulator, tmp_path):
    assert_every_word_equal(sensible(np.random.default_rng(43), parts=4000, strobes=60), tmp_path, extra=3)
    assert_every_word_equal(wild(np.random.default_rng(44), parts=4000), tmp_path, extra=0)
