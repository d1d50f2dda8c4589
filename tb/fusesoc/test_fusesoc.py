"""The FuseSoC cores: the same files as the lists beside the sources, and FuseSoC lints and simulates them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from common.runner import ROOT, VERILATOR, headers, read_file_list

CORES = ("rtl", "tb/fusesoc")
OPERATORS = ("fp_add", "fp_mul", "fp_div", "fp_from_int", "fp_to_int")
CHIP_WITHOUT_OPERATORS = "rtl/top/chip.f"


def listed(core):
    """(sources, headers) of a core's `rtl` files."""
    text = yaml.safe_load((ROOT / "rtl" / core).read_text().removeprefix("CAPI=2:"))
    sources, found = [], []
    for entry in text["filesets"]["rtl"]["files"]:
        name, options = next(iter(entry.items())) if isinstance(entry, dict) else (entry, {})
        (found if options.get("is_include_file") else sources).append(ROOT / "rtl" / name)
    return sources, found


@pytest.mark.parametrize(
    "core, lists", [("rtds_fp.core", ["rtl/fp/fp.f"]), ("rtds_chip.core", [CHIP_WITHOUT_OPERATORS])]
)
def test_a_core_has_the_files_of_its_list(core, lists):
    operators = read_file_list("rtl/fp/fp.f")
    wanted = [path for path in read_file_list(lists[0]) if core == "rtds_fp.core" or path not in operators]
    sources, found = listed(core)
    assert sources == wanted
    beside = {header for header in headers(lists) if header.parent in {path.parent for path in wanted}}
    assert set(found) == beside


def fusesoc(folder, target, core):
    """What FuseSoC says of a target, with this environment's Verilator as `verilator` and its settings in `folder`."""
    tools = folder / "bin"
    tools.mkdir()
    script = Path(VERILATOR).with_name("verilator")
    (tools / "verilator").write_text(f'#!/bin/sh\nexec perl "{script}" "$@"\n')
    (tools / "verilator").chmod(0o755)
    env = {
        **os.environ,
        "PATH": f"{tools}:{Path(sys.executable).parent}:{os.environ['PATH']}",
        "HOME": str(folder),
        "XDG_CONFIG_HOME": str(folder / "config"),
        "XDG_DATA_HOME": str(folder / "data"),
        "XDG_CACHE_HOME": str(folder / "cache"),
    }
    roots = [argument for root in CORES for argument in ("--cores-root", str(ROOT / root))]
    command = [sys.executable, "-m", "fusesoc.main", *roots, "run", "--build-root", str(folder / "build")]
    done = subprocess.run(
        [*command, "--target", target, core], cwd=folder, env=env, capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize("operator", OPERATORS)
def test_fusesoc_lints_each_operator(tmp_path, operator):
    status, said = fusesoc(tmp_path, f"lint_{operator}", "rtds:lib:fp")
    assert status == 0 and "%Warning" not in said, said


def test_fusesoc_lints_the_chip(tmp_path):
    status, said = fusesoc(tmp_path, "lint", "rtds:sim:chip")
    assert status == 0 and "%Warning" not in said, said


@pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus is not installed")
@pytest.mark.parametrize("target", ["fp", "chip"])
def test_fusesoc_simulates(tmp_path, target):
    status, said = fusesoc(tmp_path, target, "rtds:test:smoke")
    assert status == 0 and f"{target}_smoke: passed" in said, said
