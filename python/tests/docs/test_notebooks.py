"""The notebooks hold what their cells print and draw, and a run gives the same again."""

import ast
import base64
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import notebooks
import pytest

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))
# What must hold behind the last cell.
THEN = {
    "from_a_log_to_a_simulator": """
assert (work / "report" / "report.html").is_file()
assert diagnosis["gap"]["before"] > 5.0 and distance(nominal, "w_l") > 5.0
assert distance(corrected, "w_l") < 1.2 and distance(corrected, "w_r") < 1.2
assert closed.content["gap"]["simulator"]["closed"] > 0.95
assert drive.summary.effects
""",
    "batch_study": """
assert len(found) == 6
assert all(e["id"] == "coulomb_friction" and e["side"] == "left" for d in found.values() for e in d["effects"])
assert all(abs(e) < 0.005 for e in error.values())
""",
}
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


def outputs(notebook):
    """Outputs of each code cell."""
    return [cell["outputs"] for cell in notebook["cells"] if cell["cell_type"] == "code"]


def same(said, now):
    """Whether two texts have the same words, and figures that are the same to a tenth, or to 0.2."""
    if NUMBER.sub("#", said) != NUMBER.sub("#", now):
        return False
    pairs = zip(NUMBER.findall(said), NUMBER.findall(now), strict=True)
    return all(abs(float(a) - float(b)) <= max(0.1 * abs(float(a)), 0.2) for a, b in pairs)


def test_a_figure_that_moved_is_noticed():
    assert same("gap 5.0 of 2 runs", "gap 5.1 of 2 runs")
    assert not same("gap 5.0 of 2 runs", "gap 8.0 of 2 runs") and not same("none", "known")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_notebook_holds_its_outputs_with_pictures_and_is_small(path):
    notebook = json.loads(path.read_text())
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    pictures = [o["data"]["image/png"] for one in outputs(notebook) for o in one if "image/png" in o.get("data", {})]
    assert pictures and all(base64.b64decode(one).startswith(b"\x89PNG") for one in pictures)
    assert path.stat().st_size < 300_000
    assert "/tmp/" not in path.read_text()
    for cell in cells:
        ast.parse("".join(cell["source"]))


@pytest.mark.parametrize(
    "path", [pytest.param(p, marks=[pytest.mark.long] if p.stem == "batch_study" else [], id=p.stem) for p in NOTEBOOKS]
)
def test_a_notebook_gives_the_same_again(path, tmp_path):
    out = tmp_path / path.name
    command = [sys.executable, EXAMPLES / "notebooks.py", path, "--out", out, "--then", THEN[path.stem]]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stderr
    said, now = outputs(json.loads(path.read_text())), outputs(json.loads(out.read_text()))
    assert [[o["output_type"] for o in one] for one in said] == [[o["output_type"] for o in one] for one in now]
    for old, new in zip(sum(said, []), sum(now, []), strict=True):
        if old["output_type"] == "stream":
            assert same("".join(old["text"]), "".join(new["text"]))


def test_a_cell_prints_shows_its_last_value_and_draws():
    names = {}
    assert notebooks.run_cell("x = 2\nprint(x)\nx + 1", names, 4) == [
        {"output_type": "stream", "name": "stdout", "text": ["2\n"]},
        {"output_type": "execute_result", "execution_count": 4, "metadata": {}, "data": {"text/plain": ["3"]}},
    ]
    assert notebooks.run_cell("x;", names, 5) == []
    drawn = "import matplotlib\nmatplotlib.use('agg')\nimport matplotlib.pyplot as plt\nplt.subplots();"
    (picture,) = notebooks.run_cell(drawn, names, 6)
    assert picture["output_type"] == "display_data" and "image/png" in picture["data"]
