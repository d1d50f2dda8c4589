"""The whole chip between models of its converters and a serial line."""

import pytest

from common.runner import SIMULATORS, run_cocotb

SOURCES = ["rtl/top/top.f", "tb/agents/ltc2308.v", "tb/agents/dac7624.v", "tb/top/chip_tb.v"]

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
