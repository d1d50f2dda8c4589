"""How often each law of the plant is written: `python python/tests/plant/laws.py [PACKAGE]`.

Of each law its expressions of `LEAST` nodes or more, whatever their names are, are looked for in every module. A form
that several laws have, such as a sum of two products, is arithmetic: it says nothing of any of them. The copies kept
apart on purpose (`test_apart.py`) do not count.
"""

from __future__ import annotations

import ast
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2] / "rtds_host"
LAWS = ("driver", "friction", "gear", "ground", "motor", "sensors", "torque")
# An expression of fewer nodes is arithmetic that many formulas share.
LEAST = 12
SAME = (ast.BinOp, ast.Call, ast.IfExp, ast.UnaryOp)


def form(expression: ast.AST) -> str:
    """An expression with its variables numbered as they come, so that only the formula is compared."""
    names: dict[str, str] = {}

    def said(node: ast.AST) -> Iterator[str]:
        if isinstance(node, (ast.Name, ast.Subscript)):
            yield names.setdefault(ast.unparse(node), f"x{len(names)}")
        elif isinstance(node, ast.Constant):
            yield repr(node.value)
        elif not isinstance(node, ast.expr_context):
            yield node.attr if isinstance(node, ast.Attribute) else type(node).__name__
            for child in ast.iter_child_nodes(node):
                yield from said(child)

    return " ".join(said(expression))


def size(expression: ast.AST) -> int:
    return len(form(expression).split())


def formulas(tree: ast.AST) -> Iterator[str]:
    """The forms of all expressions that are large enough."""
    for node in ast.walk(tree):
        if isinstance(node, SAME) and size(node) >= LEAST:
            yield form(node)


def laws() -> dict[str, set[str]]:
    """Law -> the forms of its expressions that no other law has."""
    found = {}
    for name in LAWS:
        for node in ast.parse((ROOT / "plant" / f"{name}.py").read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef):
                found[f"{name}.{node.name}"] = set(formulas(node))
    several = {form for form, times in Counter(form for own in found.values() for form in own).items() if times > 1}
    return {law: own - several for law, own in found.items() if own - several}


def counted(root: Path = ROOT) -> dict[str, list[str]]:
    """Law -> the modules in which one of its formulas is written, its own among them."""
    known = laws()
    found: dict[str, list[str]] = {law: [] for law in known}
    for path in sorted(root.rglob("*.py")):
        name = path.relative_to(root).as_posix()
        if name.startswith("blind/") or name == "motor/effect_reference.py":
            continue
        there = set(formulas(ast.parse(path.read_text(encoding="utf-8"))))
        for law, own in known.items():
            if own & there:
                found[law].append(name)
    return found


if __name__ == "__main__":
    for law, places in counted(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT).items():
        print(f"{len(places)}  {law}: {', '.join(places)}")
