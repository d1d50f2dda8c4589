"""What may know what in the search: the store no moves, moves no driver, and nothing inherits from any of these."""

import ast
from pathlib import Path

import pytest

import rtds_host.diagnosis.search

ROOT = Path(rtds_host.diagnosis.search.__file__).parent
PACKAGE = "rtds_host.diagnosis.search"
# Each layer may import from itself and from those before it.
LAYERS = ["store", "screening", "moves", "driver", "beam", "stepwise"]
MODULES = sorted(p for p in ROOT.rglob("*.py") if p.name != "__init__.py")


def layer(path: str) -> int:
    """The place of a module in the order, by its dotted path below the package."""
    return LAYERS.index(path.split(".")[0])


def imported(tree: ast.AST) -> set[str]:
    """Modules of the package that a module imports from, dotted below it; a package's own members as its own."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"{PACKAGE}."):
            found.add((node.module or "").removeprefix(f"{PACKAGE}."))
        elif isinstance(node, ast.Import):
            found |= {n.name.removeprefix(f"{PACKAGE}.") for n in node.names if n.name.startswith(f"{PACKAGE}.")}
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_a_module_of_the_search_imports_from_its_own_layer_and_those_before_it(path):
    own = layer(".".join(path.relative_to(ROOT).with_suffix("").parts))
    later = {name for name in imported(ast.parse(path.read_text())) if layer(name) > own}
    assert not later


def test_an_import_from_a_later_layer_is_found():
    tree = ast.parse(f"from {PACKAGE}.moves import adding\nimport {PACKAGE}.driver\nfrom {PACKAGE}.store import Store")
    assert imported(tree) == {"moves", "driver", "store"}
    assert layer("moves.adding") > layer("store") and layer("driver") > layer("moves")


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_no_class_of_the_search_inherits_from_another(path):
    classes = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ClassDef)]
    assert all(not node.bases for node in classes)
