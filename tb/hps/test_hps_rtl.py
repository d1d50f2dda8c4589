"""The AXI slave in front of the registers, spoken to by cocotbext-axi's master."""

import pytest
from common.runner import SIMULATORS, run_cocotb


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_axi_slave(simulator):
    run_cocotb("axi_slave", ["rtl/hps/axi_slave.v"], "tb_axi_slave", "tb/hps", simulator, parameters={"LEN_BITS": 8})
