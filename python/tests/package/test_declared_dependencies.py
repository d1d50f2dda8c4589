"""What the package imports when it is loaded is what it declares: a fresh environment has nothing else."""

from __future__ import annotations

import ast
import re
import sys
from importlib.metadata import packages_distributions, requires
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PACKAGE = ROOT / "python" / "rtds_host"


def normal(name: str) -> str:
    """A distribution's name as package indices compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def declared() -> set[str]:
    """Names of all distributions that pyproject.toml asks for without an extra, and of those that a distribution pinned
    there with `==` brings: what a pinned one needs does not change.
    """
    text = (ROOT / "pyproject.toml").read_text()
    block = re.search(r"^dependencies = \[\n(.*?)^\]", text, re.MULTILINE | re.DOTALL)[1]
    found = set()
    for name, rule in re.findall(r'^  "([A-Za-z0-9._-]+)([^"]*)"', block, re.MULTILINE):
        found.add(normal(name))
        if rule.startswith("=="):
            found |= {
                normal(re.match(r"[A-Za-z0-9._-]+", one)[0]) for one in requires(name) or [] if "extra" not in one
            }
    return found


def imported(path: Path) -> set[str]:
    """Top-level packages that a module imports while it is loaded: not those inside of functions or of `try`."""
    found, open_ = set(), [ast.parse(path.read_text())]
    while open_:
        node = open_.pop()
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Try):
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            found.add(node.module.split(".")[0])
        open_ += ast.iter_child_nodes(node)
    return found - set(sys.stdlib_module_names) - {"rtds_host"}


def test_every_module_imports_only_what_is_declared():
    bring, known = packages_distributions(), declared()
    places = sorted(PACKAGE.rglob("*.py"))
    assert len(places) > 100 and {"numpy", "typer", "click"} <= known
    missing = [
        f"{place.relative_to(PACKAGE)}: {name}"
        for place in places
        for name in sorted(imported(place))
        if not {normal(one) for one in bring.get(name, [name])} & known
    ]
    assert not missing, "not among the dependencies in pyproject.toml: " + ", ".join(missing)
