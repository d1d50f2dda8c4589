"""The stand-in of Webots' Python module, for tests that call it in process."""

import importlib
import sys
from pathlib import Path

import pytest

STANDIN = Path(__file__).parent / "standin"


@pytest.fixture
def standin(monkeypatch):
    """The module `controller`, as a controller's process has it: new, without a robot."""
    monkeypatch.syspath_prepend(str(STANDIN))
    monkeypatch.delitem(sys.modules, "controller", raising=False)
    module = importlib.import_module("controller")
    yield module
    sys.modules.pop("controller", None)


@pytest.fixture
def supervisor(standin, monkeypatch):
    """Makes the stand-in's robot of a world."""

    def make(world: Path):
        monkeypatch.setenv("STANDIN_WORLD", str(world))
        monkeypatch.setenv("STANDIN_ENGINE", "mujoco")
        return standin.Supervisor()

    return make
