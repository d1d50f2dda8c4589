"""The mock of Webots' Python module, for tests that call it in process."""

import importlib
import sys
from pathlib import Path

import pytest

MOCK = Path(__file__).parent / "mock"


@pytest.fixture
def mock(monkeypatch):
    """The module `controller`, as a controller's process has it: new, without a robot."""
    monkeypatch.syspath_prepend(str(MOCK))
    monkeypatch.delitem(sys.modules, "controller", raising=False)
    module = importlib.import_module("controller")
    yield module
    sys.modules.pop("controller", None)


@pytest.fixture
def supervisor(mock, monkeypatch):
    """Makes the mock's robot of a world."""

    def make(world: Path):
        monkeypatch.setenv("MOCK_WORLD", str(world))
        monkeypatch.setenv("MOCK_ENGINE", "mujoco")
        return mock.Supervisor()

    return make
