"""Scaling units against their Python twin, bit for bit."""

from __future__ import annotations

from pathlib import Path

import pytest
from common.runner import SIMULATORS, run_cocotb


@pytest.mark.parametrize("simulator", SIMULATORS)
@pytest.mark.parametrize("unit", ("adc_scale", "dac_scale"))
def test_scale(unit, simulator):
    run_cocotb(
        unit,
        ("rtl/fp/fp.f", f"rtl/io/{unit}.v"),
        f"tb_{unit}",
        Path("tb/scale"),
        simulator,
        build_args=["-CFLAGS", "-O0"],  # few clocks: compiling takes longer than running
    )
