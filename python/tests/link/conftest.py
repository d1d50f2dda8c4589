import shutil

import pytest

SIMULATORS = ("verilator", "icarus") if shutil.which("iverilog") else ("verilator",)


@pytest.fixture(params=SIMULATORS)
def simulator(request):
    return request.param
