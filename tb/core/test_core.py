"""rtds_core on both simulators: its ports clock by clock (cocotb), and long runs word for word (C++ bench)."""

from __future__ import annotations

import pytest
from common.runner import SIMULATORS, run_cocotb

SOURCES = ["rtl/fp/fp.f", "rtl/core/core.f"]


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_core_keeps_the_contract_of_its_ports(simulator):
    run_cocotb("rtds_core", SOURCES, "tb_core", "tb/core", simulator)
