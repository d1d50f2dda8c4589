"""Every command in the documentation is run, or says why not.

Commands stand in blocks that begin with ```sh (a command a line) or ```console (a command after "$ "). The blocks of a
page run in their order, in one folder that holds a copy of examples/ and the environment as `.venv`. A comment before a
block, <!-- test: REASON -->, keeps it from being run; <!-- test: long --> leaves it to the long tests, where the page
runs whole. Commands inside of sentences are not run, but options, targets, modules and paths in them must exist.

What a page shows as a command's output is compared with what the command prints (see examples/page_answers.py for how
exactly): the lines below a command in a console block, a ```text block that follows a block of commands (it belongs to
the last of them), and figures in sentences that carry a mark. A block marked "run in docs/PAGE" must show what that
page shows.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import typer.main
from page_answers import compare_output, compare_prose, read_answers

from rtds_host.cli.commands import COMMANDS, MODULES
from rtds_host.contract import builtin_robot
from rtds_host.robot import make_body
from rtds_host.scenario import check_reach

ROOT = Path(__file__).resolve().parents[3]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
MARK = re.compile(r"\s*<!-- test: (.+?) -->\s*")
# First words of what is a command wherever it stands.
WORDS = ("rtds", "make", "pytest", "python", "sh", "dask", "mkdocs", "quartus_pgm")


@dataclass(frozen=True)
class Block:
    """One block of commands: where it stands, what it says, and why it is not run ("" if it is, "long" if later)."""

    line: int
    commands: tuple[str, ...]
    mark: str
    said: tuple[str, ...]  # what the page shows of each command's output, "" where it shows none


def command_word(line: str) -> bool:
    """Whether a line is a command of this project."""
    word = line.strip().removeprefix("$ ").removeprefix(".venv/bin/").split(" ")[0]
    return word in WORDS or line.strip().startswith((".venv/bin/", "SIM_ONLY="))


def joined(lines: list[str]) -> list[str]:
    """Commands a line, with lines that end in a backslash and quotes that span lines put together."""
    commands: list[str] = []
    for line in lines:
        if commands and (commands[-1].endswith("\\") or commands[-1].count('"') % 2):
            commands[-1] = commands[-1].removesuffix("\\") + ("\n" if commands[-1].count('"') % 2 else " ") + line
        elif line.strip() and not line.lstrip().startswith("#"):
            commands.append(line)
    return commands


def outputs(body: list[str]) -> tuple[str, ...]:
    """What stands below each "$ " line of a console block."""
    found: list[list[str]] = []
    for line in body:
        if line.startswith("$ "):
            found.append([])
        elif found:
            found[-1].append(line)
    return tuple("\n".join(lines) for lines in found)


def blocks(page: Path) -> list[Block]:
    """Blocks of commands of a page; fails on a command that is in a block without a language or is indented."""
    found: list[Block] = []
    mark, language, body, start, follows = "", None, [], 0, False
    for number, line in enumerate(page.read_text().splitlines(), 1):
        fence = re.match(r"\s*```(\S*)", line)
        if language is None and fence:
            language, body, start = fence[1], [], number
            indent = len(line) - len(line.lstrip())
        elif language is not None and fence:
            if language in ("sh", "console"):
                typed = [x.removeprefix("$ ") for x in body if x.startswith("$ ")] if language == "console" else body
                commands = tuple(joined(typed))
                said = outputs(body) if language == "console" else ("",) * len(commands)
                assert len(said) == len(commands), f"{page.name}:{start}: a command of a console block spans lines"
                found.append(Block(start, commands, mark, said))
                follows = True
            elif language == "text" and follows and found[-1].commands and not found[-1].mark:
                found[-1] = replace(found[-1], said=(*found[-1].said[:-1], "\n".join(body)))
            elif language == "text":
                assert mark or not read_answers("\n".join(body)), (
                    f"{page.name}:{start}: an answer that no command gives"
                )
            elif not language:
                stray = [x for x in body if command_word(x)]
                assert not stray, f"{page.name}:{start}: a block of commands needs sh or console: {stray[0]}"
            language, mark = None, ""
        elif language is not None:
            body.append(line[indent:])
        elif MARK.fullmatch(line):
            mark = MARK.fullmatch(line)[1]
        elif line.strip():
            mark, follows = "", False
            assert not (line.startswith("    ") and command_word(line)), f"{page.name}:{number}: commands need a fence"
    return found


def inline(page: Path) -> list[str]:
    """Commands inside of sentences and tables."""
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    return [span for span in re.findall(r"`([^`\n]+)`", text) if command_word(span)]


def options_of(words: list[str]) -> set[str] | None:
    """Options of `rtds WORDS…`; None where these words name no command."""
    name = next((w for w in words if not w.startswith("-")), None)
    if name is None or not name.islower() or name not in COMMANDS:
        return {"--help", "-h", "--version"} if name is None or not name.islower() else None
    command = typer.main.get_command(importlib.import_module(f"rtds_host.cli.{MODULES.get(name, name)}").app)
    children = getattr(command, "commands", None)
    if children:
        child = next((w for w in words[words.index(name) + 1 :] if not w.startswith("-")), None)
        if child is None:
            return {"--help"}
        if child not in children:
            return None
        command = children[child]
    return {"--help"} | {o for p in command.params for o in (*p.opts, *p.secondary_opts)}


def check_words(command: str) -> None:
    """Options, targets, modules and paths of a command must exist; placeholders in capitals may stand anywhere."""
    try:
        words = shlex.split(command.split("#")[0].split(" | ")[0])
    except ValueError:
        words = command.split()
    while words and re.fullmatch(r"\w+=\S*", words[0]):
        words.pop(0)
    program = words[0].removeprefix(".venv/bin/")
    rest = words[1:]
    if program == "python" and rest[:1] == ["-m"]:
        program, rest = rest[1], rest[2:]
        assert importlib.util.find_spec(program), f"{command}: no module {program}"
    elif program == "python" and rest and rest[0].endswith(".py"):
        assert (ROOT / rest[0]).is_file(), f"{command}: no {rest[0]}"
    if program == "make":
        targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        assert all(w in targets for w in rest if "=" not in w), command
    elif program in ("sh", "mkdocs"):
        assert program != "sh" or (ROOT / rest[0]).is_file(), command
    elif program == "pytest":
        for path in (w.split("::")[0] for w in rest if "/" in w):
            assert (ROOT / path).exists(), f"{command}: no {path}"
    elif program == "rtds":
        options = options_of(rest)
        assert options is not None, f"{command}: no such command"
        for word in rest:
            if word.startswith("--"):
                assert word.split("=")[0].rstrip(",;…") in options, f"{command}: no option {word}"


def run_page(page: Path, scratch: Path, long: bool, installed=None) -> None:
    """Run a page's blocks in their order; a failure shows the command and its last words.

    installed : an environment to run them in, with the examples and nothing else of the checkout.
    """
    shutil.copytree(ROOT / "examples", scratch / "examples", ignore=shutil.ignore_patterns("__pycache__"))
    if installed is None:
        for name in ("python", "tb", "sim", "rtl", "quartus", "docs", "Makefile", "pyproject.toml", "mkdocs.yml"):
            (scratch / name).symlink_to(ROOT / name)
    (scratch / ".venv").symlink_to(installed.prefix if installed else sys.prefix)
    environment = {
        **(installed.environment if installed else os.environ | {"PATH": f"{sys.prefix}/bin:{os.environ['PATH']}"}),
        "NO_COLOR": "1",
        "COLUMNS": "110",
    }
    wrong: list[str] = []
    for block in blocks(page):
        if block.mark and not (long and block.mark.startswith("long")):
            continue
        for command, said in zip(block.commands, block.said, strict=True):
            done = subprocess.run(
                ["bash", "-c", command],
                cwd=scratch,
                env=environment,
                text=True,
                check=False,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
            )
            assert done.returncode == 0, (
                f"{page.name}:{block.line}: {command}\n[exit status {done.returncode}]\n" + done.stdout[-2000:]
            )
            if said.strip():
                wrong += [
                    f"{page.name}:{block.line}: {command[:60]}: {w}"
                    for w in compare_output(command, said, done.stdout, scratch)
                ]
    wrong += [f"{page.name}: {w}" for w in compare_prose(page.read_text(), scratch)]
    assert not wrong, (
        "the page says what is not so (examples/run_tutorial.py PAGE brings it up to date):\n" + "\n".join(wrong)
    )


def marks(page: Path) -> set[str]:
    return {block.mark for block in blocks(page)}


QUICK = [page for page in PAGES if "" in marks(page)]
LONG = [page for page in PAGES if any(mark.startswith("long") for mark in marks(page))]


@pytest.mark.parametrize("page", QUICK, ids=lambda p: p.name)
def test_the_commands_of_a_page_work_one_after_the_other(page, tmp_path):
    run_page(page, tmp_path, long=False)


@pytest.mark.long
@pytest.mark.parametrize("page", LONG, ids=lambda p: p.name)
def test_the_long_commands_of_a_page_work_too(page, tmp_path):
    run_page(page, tmp_path, long=True)


@pytest.mark.long  # dependencies are fetched, and all of numba is compiled again
@pytest.mark.parametrize("name", ["tutorial.md", "tutorial-bag.md"])
def test_a_tutorial_works_from_an_installed_wheel(name, fresh, tmp_path):
    run_page(ROOT / "docs" / name, tmp_path, long=True, installed=fresh)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_options_targets_and_paths_that_a_page_names_exist(page):
    for command in [*inline(page), *(c for block in blocks(page) for c in block.commands)]:
        if command_word(command):
            check_words(command)


def test_a_block_that_is_not_run_says_why():
    for page in PAGES:
        for block in blocks(page):
            assert not block.mark or block.mark.startswith("long") or len(block.mark.split()) >= 2, (page.name, block)


def test_nothing_escapes_the_collector(tmp_path):
    page = tmp_path / "page.md"
    for text, complaint in (
        ("```\nrtds run linear\n```\n", "needs sh or console"),
        ("Like this:\n\n    rtds run linear\n", "need a fence"),
    ):
        page.write_text(text)
        with pytest.raises(AssertionError, match=complaint):
            blocks(page)
    page.write_text("<!-- test: needs the board -->\n```sh\nrtds run a \\\n  b\n```\n```console\n$ ls\nout\n```\n")
    assert [(b.commands, b.mark, b.said) for b in blocks(page)] == [
        (("rtds run a    b",), "needs the board", ("",)),
        (("ls",), "", ("out",)),
    ]
    for wrong in (
        "rtds runn linear",
        "rtds run linear --lnk model",
        "make tset",
        "pytest python/tests/nowhere",
        "python -m rtds_host.nothing",
    ):
        with pytest.raises(AssertionError):
            check_words(wrong)


def test_a_block_that_is_run_on_another_page_shows_what_that_page_shows():
    for page in PAGES:
        for block in blocks(page):
            if m := re.fullmatch(r"run in (docs/\S+\.md)", block.mark):
                there = [
                    answer for other in blocks(ROOT / m[1]) for said in other.said for answer in read_answers(said)
                ]
                for said in block.said:
                    for answer in read_answers(said):
                        same = [
                            o
                            for o in there
                            if (o.case, o.verdict, o.effects.keys())
                            == (answer.case, answer.verdict, answer.effects.keys())
                        ]
                        assert any(answer.gap.items() <= o.gap.items() for o in same), (
                            f"{page.name}:{block.line}: {answer}"
                        )


def test_the_start_page_begins_with_the_demo_and_then_the_two_commands_of_the_repository():
    found = [list(block.commands) for block in blocks(ROOT / "README.md")]
    assert [c.split("  ")[0] for c in found[0]] == ["pip install .", "rtds demo"]
    assert [c.split("  ")[0].strip() for c in found[2]] == ["make run", "make test"]


def test_every_link_in_the_site_leads_somewhere(tmp_path):
    """`make docs`: strict, so that a link, anchor or page of the navigation that is missing fails."""
    done = subprocess.run(
        [f"{sys.prefix}/bin/mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "site" / "index.html").is_file()


def test_every_link_of_the_start_page_leads_to_a_file():
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", (ROOT / "README.md").read_text()):
        assert target.startswith("http") or (ROOT / target).exists(), target


def test_the_collector_knows_every_command_of_the_program():
    assert isinstance(options_of(["blind", "make"]), set) and options_of(["blind", "nothing"]) is None
    assert all(options_of([name]) for name in COMMANDS)


def python_blocks(page: Path) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", page.read_text(), flags=re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("page", [page for page in PAGES if python_blocks(page)], ids=lambda p: p.name)
def test_python_in_a_page_is_python_and_imports_what_there_is(page):
    for block in python_blocks(page):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.ImportFrom):
                module = importlib.import_module(node.module)
                assert all(hasattr(module, name.name) for name in node.names), (page.name, ast.unparse(node))


def test_the_example_of_a_scenario_is_within_reach_of_the_robot(tmp_path):
    (code,) = python_blocks(ROOT / "docs" / "add-a-scenario.md")
    (tmp_path / "swing.py").write_text(code)
    spec = importlib.util.spec_from_file_location("swing", tmp_path / "swing.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    scenario, robot = module.SCENARIO, builtin_robot("burger")
    motion = check_reach(scenario, scenario.values(), robot, make_body(robot, 0.0, 0.0, 0.0))
    assert motion.voltages(np.array([0.0, 0.5])) == pytest.approx(np.array([[0.0, 0.0], [4.0, 4.0]]))
