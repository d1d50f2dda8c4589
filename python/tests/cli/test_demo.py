"""`rtds demo`: the example bags are found and diagnosed."""

from __future__ import annotations

import hashlib
import zipfile
from pathlib import Path

import pytest
from typer.testing import CliRunner

import rtds_host.cli.demo
from rtds_host.cli.demo import BAGS, app, example_bags
from rtds_host.errors import InputError

ROOT = Path(__file__).resolve().parents[3]


def test_the_demo_imports_the_bags_and_asks_for_a_diagnosis_of_them(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr("rtds_host.diagnosis.batch.run_one", lambda *args, **options: asked.append((args, options)))
    done = CliRunner().invoke(app, ["--out", str(tmp_path / "demo")])
    assert done.exit_code == 0, done.output
    assert sorted(p.name for p in (tmp_path / "demo" / "case").iterdir()) == ["robot.toml", "spin", "square", "wander"]
    ((args, options),) = asked
    assert args == (tmp_path / "demo" / "case", tmp_path / "demo" / "report") and options["quick"]
    assert done.output.rstrip().endswith("report.html")


def test_a_package_without_the_bags_says_so_in_a_line(tmp_path, monkeypatch):
    monkeypatch.setattr(rtds_host.cli.demo, "__file__", str(tmp_path / "a" / "b" / "c" / "demo.py"))
    with pytest.raises(InputError, match="the example bags are missing"):
        example_bags()


def test_the_wheel_holds_the_bags(wheel):
    with zipfile.ZipFile(wheel) as content:
        for name in BAGS:
            packed = hashlib.sha256(content.read(f"rtds_host/examples/{name}")).digest()
            assert packed == hashlib.sha256((ROOT / "examples" / name).read_bytes()).digest()


@pytest.mark.long  # the whole diagnosis
def test_the_demo_names_the_fault_that_is_there(tmp_path):
    import json

    done = CliRunner().invoke(app, ["--out", str(tmp_path / "demo")])
    assert done.exit_code == 0, done.output
    diagnosis = json.loads((tmp_path / "demo" / "report" / "diagnosis.json").read_text())
    (truth,) = json.loads((ROOT / "examples" / "truth.json").read_text())["effects"]
    named = {(m["id"], m["side"]) for m in [*diagnosis["effects"], *sum(diagnosis["indistinguishable"], [])]}
    assert (truth["id"], truth["side"]) in named
