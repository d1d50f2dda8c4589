"""The serial port to the registers, spoken to by the same client that speaks to a board."""

import pytest
from common.runner import SIMULATORS, run_cocotb


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_serial_port(simulator):
    run_cocotb(
        "serial_tb", ["rtl/io/infra.f", "rtl/top/rtds_port.v", "tb/uart/serial_tb.v"], "tb_uart", "tb/uart", simulator
    )
