"""The whole chip between models of its converters and a serial line."""

import pytest
from common.runner import SIMULATORS, run_cocotb

SOURCES = ["tb/top/chip_tb.vlt", "rtl/top/top.f", "tb/agents/ltc2308.v", "tb/agents/dac7624.v", "tb/top/chip_tb.v"]

# One simulator by default: Icarus, which knows X and builds at once. Verilator with the parts' real times takes long.
DEFAULT = SIMULATORS[-1]
BOTH = [pytest.param(s, marks=[] if s == DEFAULT else [pytest.mark.long]) for s in SIMULATORS]


def bench(simulator, module, long=False, **more):
    run_cocotb(
        "chip_tb",
        SOURCES,
        module,
        "tb/top",
        simulator,
        build_args=["--timing", "-CFLAGS", "-std=c++20 -O1"],
        extra_env={"LONG": "1" if long else ""},
        **more,
    )


@pytest.mark.parametrize("simulator", BOTH)
def test_chip(simulator):
    bench(simulator, "tb_chip")


VIEWS = (
    "every_step_is_the_models",
    "every_pad_and_conversion_time",
    "nothing_is_released_before_the_lock_has_proved_itself",
    "each_observed_word_is_the_one_it_is_called",
    "each_led_shows_its_own_cause",
)


@pytest.mark.long
@pytest.mark.parametrize("name", VIEWS)
def test_one_view(name):
    """One test of the sound chip alone (for the mutants)."""
    bench(DEFAULT, "tb_chip", testcase=[name])


FAULTS = (
    "reset_at_every_phase",
    "lock_lost_at_every_phase",
    "lock_lost_at_every_clock_of_a_commit",
    "one_lost_record_is_told_once",
    "dead_sdo",
    "silent_clock",
    "system_clock_falters",
    "nothing_is_begun_while_the_core_is_busy",
    "every_phase_between_the_clocks",
    "configuration_at_the_worst_moment",
    "unusable_parameters",
    "nonfinite_state",
    "bad_scalings_stay_bounded",
    "run_blank_and_clear",
    "through_the_serial_pins",
    "nothing_before_the_lock",
)


@pytest.mark.parametrize("simulator", BOTH)
def test_faults(simulator):
    bench(simulator, "tb_faults")


@pytest.mark.long
@pytest.mark.parametrize("name", FAULTS)
def test_one_fault(name):
    """One of them alone (for the mutants)."""
    bench(DEFAULT, "tb_faults", testcase=[name])


@pytest.mark.long
@pytest.mark.parametrize("name", FAULTS)
def test_faults_at_every_phase(name):
    """The wide sweeps: every clock of a step, every 100 ps between the clocks."""
    bench(SIMULATORS[0], "tb_faults", long=True, testcase=[name])
