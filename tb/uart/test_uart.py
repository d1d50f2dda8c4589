"""The serial port to the registers, spoken to by the same client that speaks to a board."""

import pytest
from common.runner import SIMULATORS, run_cocotb


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_serial_port(simulator):
    run_cocotb(
        "serial_tb", ["rtl/io/infra.f", "rtl/top/rtds_port.v", "tb/uart/serial_tb.v"], "tb_uart", "tb/uart", simulator
    )


# Two thousand bit times are 200,000 clocks: the other simulator in the long run only.
@pytest.mark.parametrize(
    "simulator", [pytest.param(s, marks=[] if s == SIMULATORS[-1] else [pytest.mark.long]) for s in SIMULATORS]
)
def test_the_boards_own_pause_and_rate(simulator):
    sources = ["rtl/io/infra.f", "rtl/top/rtds_port.v", "tb/uart/board_port_tb.v"]
    run_cocotb("board_port_tb", sources, "tb_board_port", "tb/uart", simulator)
