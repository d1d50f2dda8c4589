"""The two copies of the plant that check it use nothing of it."""

import ast
from pathlib import Path

import pytest

import rtds_host

ROOT = Path(rtds_host.__file__).parent
APART = sorted((ROOT / "blind").glob("*.py")) + [ROOT / "motor" / "effect_reference.py"]
# Of the package, what a simulation of the blind worlds may rest on: files, errors, scores; no equation.
WORLD = ("kernel", "world", "plants", "planar", "machines", "scales")


def imported(path: Path) -> set[str]:
    """Full names of all that a module imports, wherever in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


@pytest.mark.parametrize("path", APART, ids=lambda path: path.stem)
def test_a_copy_kept_apart_imports_nothing_of_the_plant(path):
    assert not [name for name in imported(path) if name.startswith("rtds_host.plant")]


@pytest.mark.parametrize("path", [ROOT / "blind" / f"{name}.py" for name in WORLD], ids=lambda path: path.stem)
def test_a_blind_world_does_not_reach_the_plant_by_way_of_the_replay_or_the_simulator(path):
    roundabout = ("rtds_host.diagnosis", "rtds_host.correction", "rtds_host.export")
    assert not [name for name in imported(path) if name.startswith(roundabout)]


def test_the_replay_does_import_the_plant():
    assert "rtds_host.plant.motor" in imported(ROOT / "diagnosis" / "replay" / "kernel.py")
