"""What the code's text must hold: how long functions are, and that no module reaches into another's private names."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PACKAGE = ROOT / "python" / "rtds_host"
LONGEST = 80
# A compiled loop is one function, since what it calls would have to be handed all of its state.
COMPILED = {"loop", "njit"}
# Public in spite of the underscore: those of named tuples, and what the standard library documents.
DOCUMENTED = {"_asdict", "_exit", "_fields", "_make", "_replace"}
# Where another library has no public way: attribute -> whose it is.
FOREIGN = {
    "_cache": "numba's dispatchers",
    "_log": "cocotb's handles",
    "_name": "cocotb's handles",
    "_result_queue": "concurrent.futures",
    "_run_finalizers": "multiprocessing.util",
    "_writer": "concurrent.futures",
}
# Names that other libraries call: click's of a group of commands, http.server's of a request.
CALLED_BY_OTHERS = {"do_" + "GET", "format_" + "commands", "list_" + "commands"}
BY_NAME = {"delattr", "getattr", "hasattr", "setattr"}


def long_functions(tree: ast.AST) -> Iterator[tuple[str, int, set[str]]]:
    """Functions of more lines than allowed: name, lines, the names of their decorators.

    The parameters of a command are its options with their help, and count no more than any other table.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            named = (d.func if isinstance(d, ast.Call) else d for d in node.decorator_list)
            decorators = {d.attr if isinstance(d, ast.Attribute) else ast.unparse(d) for d in named}
            first = node.body[0].lineno if "command" in decorators else node.lineno
            lines = node.end_lineno - first + 1
            if lines > LONGEST:
                yield node.name, lines, decorators


def private(name: str) -> bool:
    return name.startswith("_") and name != "_" and not name.startswith("__") and name not in DOCUMENTED


def defined(tree: ast.AST) -> set[str]:
    """Names that a module defines: functions, classes, variables, attributes of its own objects."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and own(node.value):
            found.add(node.attr)
    return found


def own(node: ast.expr) -> bool:
    """Whether an expression is the object, the class or the base class that a method belongs to."""
    if isinstance(node, ast.Call):
        node = node.func
    return isinstance(node, ast.Name) and node.id in ("self", "cls", "super")


def reached(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Private names of other modules that a module imports or uses: line and name."""
    names = defined(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            yield from ((node.lineno, alias.name) for alias in node.names if private(alias.name))
        elif isinstance(node, ast.Attribute) and private(node.attr) and not own(node.value):
            if node.attr not in names and node.attr not in FOREIGN:
                yield node.lineno, node.attr
        elif isinstance(node, ast.Call) and len(node.args) > 1 and isinstance(node.args[1], ast.Constant):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if called in BY_NAME and not own(node.args[0]) and private(str(node.args[1].value)):
                yield node.lineno, str(node.args[1].value)


def test_functions_are_short_but_for_compiled_loops():
    found = [
        f"{path.relative_to(ROOT)}: {name} has {lines} lines"
        for path in sorted(PACKAGE.rglob("*.py"))
        for name, lines, decorators in long_functions(ast.parse(path.read_text()))
        if not decorators & COMPILED
    ]
    assert not found, "\n".join(found)


def test_no_module_reaches_into_the_private_names_of_another():
    found = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for folder in ("python", "tb", "sim", "examples")
        for path in sorted((ROOT / folder).rglob("*.py"))
        for line, name in reached(ast.parse(path.read_text()))
    ]
    assert not found, "\n".join(found)


def places_in_memory(tree: ast.AST) -> list[int]:
    """Lines that ask for an object's place in memory, which another object may have later."""
    calls = (n for n in ast.walk(tree) if isinstance(n, ast.Call))
    return [n.lineno for n in calls if isinstance(n.func, ast.Name) and n.func.id == "id"]


def test_nothing_is_looked_up_by_its_place_in_memory():
    found = {p.relative_to(ROOT): places_in_memory(ast.parse(p.read_text())) for p in sorted(PACKAGE.rglob("*.py"))}
    assert {path: lines for path, lines in found.items() if lines} == {}
    assert places_in_memory(ast.parse("kept = {}\nkept[id(model)] = 1\nfit.id()")) == [2]


def defined_functions(tree: ast.AST) -> set[str]:
    """Functions, classes and methods that a module defines, without those that Python itself calls."""
    kinds = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
    return {n.name for n in ast.walk(tree) if isinstance(n, kinds) and not n.name.startswith("__")}


def mentioned_once(definitions: set[str], texts: list[str]) -> set[str]:
    """Of some names those that all texts together hold once: where they are defined."""
    words = Counter(word for text in texts for word in re.findall(r"\w+", text))
    return {name for name in definitions if words[name] < 2}


def test_nothing_is_defined_that_nothing_uses():
    places = [ROOT / name for name in ("python", "tb", "sim", "examples", "docs")]
    sources = [p for place in places for kind in ("py", "md", "ipynb") for p in place.rglob(f"*.{kind}")]
    names = set().union(*(defined_functions(ast.parse(p.read_text())) for p in PACKAGE.rglob("*.py")))
    assert mentioned_once(names, [p.read_text(errors="replace") for p in sources]) == CALLED_BY_OTHERS


def test_what_nothing_uses_is_found():
    text = "def used(): pass\ndef left(): used()\n"
    assert mentioned_once(defined_functions(ast.parse(text)), [text]) == {"left"}


@pytest.mark.parametrize(
    "text",
    [
        "from rtds_host.link.base import _steps",
        "from rtds_host.link import base\nbase._steps(1)",
        "import rtds_host\nrtds_host._steps",
        "def test(monkeypatch, base):\n    monkeypatch.setattr(base, '_steps', None)",
    ],
)
def test_a_private_name_of_another_module_is_found(text):
    assert [name for _, name in reached(ast.parse(text))] == ["_steps"]


def test_a_long_function_is_found_unless_it_is_compiled():
    body = "    x = 1\n" * LONGEST
    ((name, lines, decorators),) = long_functions(ast.parse(f"def slow():\n{body}"))
    assert (name, lines, decorators) == ("slow", LONGEST + 1, set())
    ((_, _, decorators),) = long_functions(ast.parse(f"@numba.njit(cache=True)\ndef fast():\n{body}"))
    assert decorators & COMPILED
