"""The crossing between the clock domains, the resets and the PLL wrapper."""

import pytest
from common.runner import SIMULATORS, run_cocotb

INFRA = "rtl/io/infra.f"


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_crossing_keeps_every_word(simulator):
    run_cocotb(
        "cdc_handshake",
        [INFRA],
        "tb_cdc",
        "tb/cdc",
        simulator,
        parameters={"WIDTH": 62},
        testcase=["random_clocks", "offered_too_early"],
    )


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_crossing_at_every_phase_of_40_and_50_mhz(simulator):
    run_cocotb(
        "cdc_handshake", [INFRA], "tb_cdc", "tb/cdc", simulator, parameters={"WIDTH": 62}, testcase=["phase_sweep"]
    )


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_resets(simulator):
    run_cocotb("reset_ctrl", [INFRA], "tb_reset", "tb/cdc", simulator)


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_pll_restart(simulator):
    run_cocotb(
        "pll_restart", [INFRA, "rtl/io/pll_restart.v"], "tb_pll_restart", "tb/cdc", simulator, parameters={"WAIT": 200}
    )


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_pll_restart_of_the_board_waits_longer_than_a_pll_needs(simulator):
    run_cocotb("pll_restart", [INFRA, "rtl/io/pll_restart.v"], "tb_pll_wait", "tb/cdc", simulator)


# With its clock in Verilog the PLL takes Verilator a minute to build: one simulator is enough unless asked.
@pytest.mark.parametrize(
    "simulator",
    [pytest.param(s, marks=[pytest.mark.long] if s == "verilator" and len(SIMULATORS) > 1 else []) for s in SIMULATORS],
)
def test_pll(simulator):
    run_cocotb(
        "pll_adc",
        ["rtl/io/pll_adc.v"],
        "tb_pll",
        "tb/cdc",
        simulator,
        build_args=["--timing", "-CFLAGS", "-std=c++20 -fcoroutines"],
    )
