"""Runs a notebook's cells and keeps what they print and draw, without Jupyter.

    python examples/notebooks.py examples/batch_study.ipynb            # runs it and writes its outputs into it
    python examples/notebooks.py examples/batch_study.ipynb --out FILE # writes the executed notebook elsewhere

As in Jupyter each cell's text, its last value and the figures that it left open follow it. Pictures are small PNGs
without a date, so that the same program gives the same file. A cell that fails ends the program with its traceback.
"""

from __future__ import annotations

import argparse
import ast
import base64
import io
import json
import os
import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

DPI = 60


def _pictures() -> list[dict[str, Any]]:
    """The figures that are open, which are then closed."""
    import matplotlib.pyplot as plt

    found = []
    for number in plt.get_fignums():
        target = io.BytesIO()
        plt.figure(number).savefig(target, format="png", dpi=DPI, metadata={"Software": None})
        picture = base64.b64encode(target.getvalue()).decode("ascii")
        found.append({"output_type": "display_data", "metadata": {}, "data": {"image/png": picture}})
    plt.close("all")
    return found


def _stream(text: str) -> list[dict[str, Any]]:
    if not text:
        return []
    return [{"output_type": "stream", "name": "stdout", "text": text.splitlines(keepends=True)}]


def run_cell(source: str, names: dict[str, Any], number: int) -> list[dict[str, Any]]:
    """Run a cell in a namespace; its outputs as a notebook keeps them."""
    tree = ast.parse(source)
    last = None
    if tree.body and isinstance(tree.body[-1], ast.Expr) and not source.rstrip().endswith(";"):
        last = ast.Expression(tree.body.pop().value)
    printed = io.StringIO()
    with redirect_stdout(printed):
        exec(compile(tree, f"cell {number}", "exec"), names)
        value = None if last is None else eval(compile(last, f"cell {number}", "eval"), names)
    outputs = _stream(printed.getvalue())
    if value is not None:
        text = repr(value).splitlines(keepends=True)
        result = {"output_type": "execute_result", "execution_count": number, "metadata": {}}
        outputs.append({**result, "data": {"text/plain": text}})
    return outputs + _pictures()


def run(path: Path, then: str = "") -> dict[str, Any]:
    """The notebook with the outputs of its cells, run in its own folder; `then` is run behind them."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    names: dict[str, Any] = {"__name__": "__main__"}
    os.chdir(path.resolve().parent)
    number = 0
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            number += 1
            cell["execution_count"] = number
            cell["outputs"] = run_cell("".join(cell["source"]), names, number)
    exec(compile(then, "then", "exec"), names)
    return notebook


def main() -> None:
    """The program."""
    arguments = argparse.ArgumentParser(description="Run a notebook and keep its outputs.")
    arguments.add_argument("notebook", type=Path)
    arguments.add_argument("--out", type=Path)
    arguments.add_argument("--then", default="", help="Python to run behind the last cell.")
    given = arguments.parse_args()
    os.environ["MPLBACKEND"] = "agg"
    out = (given.out or given.notebook).resolve()
    done = run(given.notebook, given.then)
    out.write_text(json.dumps(done, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(out, file=sys.stderr)


if __name__ == "__main__":
    main()
