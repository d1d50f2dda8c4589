"""The rules of the code's style are stated once, enforced by `make lint`, and run before each commit."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from rtds_host.compat import tomllib

ROOT = Path(__file__).resolve().parents[3]
SOURCES = ["python", "tb", "sim", "examples", "setup.py"]
RULES = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["ruff"]


def ruff(*words: str, cwd: Path = ROOT) -> subprocess.CompletedProcess:
    command = [f"{sys.prefix}/bin/ruff", *words]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


def test_the_rules_are_stated_and_hold_the_length_of_lines():
    assert RULES["line-length"] == 120
    assert {"E", "F", "W", "I"} <= set(RULES["lint"]["select"])
    assert not any(rule.startswith("E5") for rule in RULES["lint"].get("ignore", []))


def test_every_file_keeps_the_rules():
    done = ruff("check", *SOURCES)
    assert done.returncode == 0, done.stdout


def test_a_line_that_is_too_long_is_found(tmp_path):
    (tmp_path / "long.py").write_text(f'TEXT = "{"x" * 120}"\n')
    done = ruff("check", "--config", str(ROOT / "pyproject.toml"), "long.py", cwd=tmp_path)
    assert done.returncode == 1 and "E501" in done.stdout


# Where a function has the parameters of an interface, and need not use all of them.
INTERFACES = {
    "bench/sysid.py": "what MuJoCo's identification calls",
    "blind": "draws of a kind, and equations of a world",
    "cli/main.py": "a signal's handler",
    "diagnosis/effects": "what an effect's file gives",
    "scenario": "what builds a motion",
    "webots/controller.py": "what opens an engine",
}


def unused(*words: str, cwd: Path = ROOT) -> list[str]:
    """Parameters of functions that nothing uses: place and name, a line each."""
    done = ruff("check", "--select", "ARG001", "--output-format", "concise", *words, cwd=cwd)
    return [line for line in done.stdout.splitlines() if "ARG001" in line]


def test_no_parameter_of_a_function_does_nothing():
    places = tuple(f"python/rtds_host/{place}" for place in INTERFACES)
    found = unused("python/rtds_host")
    assert [line for line in found if not line.startswith(places)] == []
    assert all(any(line.startswith(place) for line in found) for place in places), "an exception that nothing needs"


def test_a_parameter_that_does_nothing_is_found(tmp_path):
    (tmp_path / "one.py").write_text("def area(width, height, colour):\n    return width * height\n")
    assert [line.split("`")[1] for line in unused("--isolated", "one.py", cwd=tmp_path)] == ["colour"]


def test_make_lint_checks_what_the_rules_are_for():
    (recipe,) = re.findall(r"^lint: setup\n((?:\t.*\n)+)", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert f"ruff check {' '.join(SOURCES)}" in recipe
    assert "$(BIN)/mypy\n" in recipe


def test_the_types_of_bodies_are_checked_and_nothing_is_left_out():
    types = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["mypy"]
    assert types["files"] == ["python/rtds_host"] and types["check_untyped_defs"] is True
    assert not {"exclude", "disable_error_code", "ignore_errors"} & types.keys()
    for part in types.get("overrides", []):
        assert not [name for name in part["module"] if name.startswith("rtds_host")]
    for path in (ROOT / "python" / "rtds_host").rglob("*.py"):
        assert not re.search(r"type: ignore(?!\[)", path.read_text()), path


def hooks() -> list[dict]:
    (repository,) = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
    assert repository["repo"] == "local"
    return repository["hooks"]


def test_the_hooks_fetch_nothing():
    assert len(hooks()) >= 4
    assert all(hook["language"] == "system" for hook in hooks())
    assert "://" not in (ROOT / ".pre-commit-config.yaml").read_text()


# Half a minute where there is no cache yet; `make lint` has run it.
SLOW = {"types": pytest.mark.long}


@pytest.mark.parametrize(
    "hook", [pytest.param(hook, marks=SLOW.get(hook["id"], ()), id=hook["id"]) for hook in hooks()]
)
def test_a_hook_passes_on_the_repository(hook):
    words = shlex.split(hook["entry"])
    if words[0].startswith(".venv/"):
        words[0] = words[0].replace(".venv", sys.prefix)
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
