"""The register file on its Avalon-MM bus, and the files made from its description."""

import subprocess
import sys

import pytest
from common.runner import ROOT, SIMULATORS, run_cocotb

from rtds_host.link.register_files import made_files
from rtds_host.link.registers import load_map


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_register_file(simulator):
    run_cocotb("rtds_regs", ["rtl/io/infra.f"], "tb_regs", "tb/regs", simulator, parameters={"BUILD_ID": 0x1234ABCD})


def test_header_and_page_are_made_from_the_description():
    for path, text in made_files(load_map()).items():
        assert (ROOT / path).read_text(encoding="utf-8") == text, f"{path} is stale: make registers"


def test_generator_writes_both_files(tmp_path):
    for folder in ("rtl/io", "docs"):
        (tmp_path / folder).mkdir(parents=True)
    command = [sys.executable, "-m", "rtds_host.link.register_files", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [f"wrote {path}" for path in made_files(load_map())]
    for path, text in made_files(load_map()).items():
        assert (tmp_path / path).read_text(encoding="utf-8") == text
