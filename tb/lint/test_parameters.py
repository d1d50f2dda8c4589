"""Parameters out of range end the elaboration, with the parameter's name; the ends of the range do not."""

import shutil
import subprocess

import pytest
from common.runner import ROOT, include_flags, read_file_list

INFRA = "rtl/io/infra.f"
CTRL = ["rtl/io/rtds_ctrl.v"]
RANGES = {
    "pll_restart.WAIT": (["rtl/io/pll_restart.v"], 17, 131071),
    "pll_restart.PULSE": (["rtl/io/pll_restart.v"], 1, 131070),
    "uart_rx.CLKS_PER_BIT": ([], 8, 65535),
    "uart_tx.CLKS_PER_BIT": ([], 8, 65535),
    "serial_bridge.TIMEOUT_CLKS": ([], 1, 1048575),
    "reset_ctrl.LOCK_CLOCKS": ([], 1, 255),
    "rtds_ctrl.SILENT_CLOCKS": (CTRL, 1, 1023),
    "rtds_ctrl.BUSY_CLOCKS": (CTRL, 1, 127),
}


def elaborate(name, value):
    """Icarus's status and words for a module with one parameter set."""
    more, _, _ = RANGES[name]
    sources = [*read_file_list(INFRA), *(ROOT / path for path in more)]
    flags = [*include_flags([INFRA]), f"-I{ROOT / 'rtl/core'}"]
    command = ["iverilog", "-g2005", "-t", "null", "-s", name.split(".")[0], f"-P{name}={value}", *flags]
    done = subprocess.run([*command, *map(str, sources)], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus is not installed")
@pytest.mark.parametrize("name", RANGES)
def test_a_parameter_out_of_range_is_named_and_the_ends_are_taken(name):
    _, least, most = RANGES[name]
    for value in (least, most):
        assert elaborate(name, value)[0] == 0, f"{name} = {value}"
    for value in (least - 1, most + 1):
        status, said = elaborate(name, value)
        assert status != 0, f"{name} = {value}"
        assert "_must_be_" in said and name.split(".")[1] in said, said
