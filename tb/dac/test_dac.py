"""DAC path: dac_parallel against a model of the DAC7624 and 7625, and faults that the model must notice."""

from __future__ import annotations

from pathlib import Path

import pytest
from common.runner import BUILD, ROOT, SIMULATORS, run_cocotb

RTL = "rtl/io/dac_parallel.v"
BENCH = ("tb/agents/dac7624.v", "tb/dac/dac_tb.v")

# name: (text of the right design, text of the fault, what must be noticed)
FAULTS = {
    "cs_too_short": ("(phase_q < 3'd3)", "(phase_q < 3'd2)", "CS_SHORT"),
    "no_hold_after_cs": ("(phase_q < 3'd3)", "(phase_q != 3'd5)", "ADDRESS_MOVED"),
    "no_setup_before_cs": (
        "cs = busy_q && !ldac_slot && (phase_q < 3'd3);",
        "cs = start || (busy_q && !ldac_slot && (phase_q < 3'd2 || (phase_last && slot_q != 3'd3)));",
        "DATA_MOVED",
    ),
    "ldac_too_short": ("(phase_q != 3'd0) && !phase_last", "(phase_q == 3'd1 || phase_q == 3'd2)", "LDAC_SHORT"),
    "ldac_too_early": (
        "ldac = busy_q && ldac_slot && (phase_q != 3'd0) && !phase_last",
        "ldac = busy_q && (ldac_slot ? phase_q < 3'd2 : slot_q == 3'd3 && phase_last)",
        "CS_TO_LDAC",
    ),
    "ldac_after_each_output": (
        "ldac = busy_q && ldac_slot && (phase_q != 3'd0)",
        "ldac = busy_q && (ldac_slot ? phase_q != 3'd0 : phase_q == 3'd3)",
        "TORN",
    ),
    "ldac_missing": ("ldac = busy_q && ldac_slot", "ldac = 1'b0 && ldac_slot", "WRONG_CODE"),
    "one_output_left_out": ("(slot_q < 3'd3)", "(slot_q < 3'd2)", "TORN"),
    "outputs_swapped": ("data_q[47:12]};", "data_q[35:12], data_q[47:36]};", "WRONG_CODE"),
}


def bench(simulator: str, sources=(*BENCH, RTL), **more) -> None:
    run_cocotb(
        "dac_tb",
        sources,
        "tb_dac",
        Path("tb/dac"),
        simulator,
        build_args=["--timing", "-CFLAGS", "-std=c++20 -O0"],  # coroutines
        **more,
    )


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_dac7624(simulator):
    bench(simulator)


@pytest.mark.parametrize("simulator", SIMULATORS[-1:])
def test_dac7625_comes_out_of_reset_at_zero_scale(simulator):
    bench(
        simulator,
        parameters={"RESET_CODE": 0},
        testcase=["reset_at_every_clock_leaves_the_safe_value", "sets_arrive_whole_with_every_pad_delay"],
    )


# A mutated copy is built in 0.1 s by Icarus and in 10 s by Verilator, which alone gets one of them.
@pytest.mark.parametrize("name", FAULTS if "icarus" in SIMULATORS else ("ldac_too_early",))
def test_fault_is_caught(name):
    right, wrong, expected = FAULTS[name]
    text = (ROOT / RTL).read_text()
    assert text.count(right) == 1, f"{name}: the design has changed, this fault no longer fits"
    copy = BUILD / "dac-faults" / f"{name}.v"
    copy.parent.mkdir(parents=True, exist_ok=True)
    copy.write_text(text.replace(right, wrong))
    bench(
        SIMULATORS[-1],
        sources=(*BENCH, copy),
        testcase="a_fault_is_caught",
        defines={f"FAULT_{name}": 1},
        extra_env={"FAULT_EXPECTED": expected},
    )
