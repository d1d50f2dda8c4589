"""Run the commands of a documentation page and put their real output below them.

    .venv/bin/python examples/run_tutorial.py docs/tutorial-bag.md            # rewrite the page
    .venv/bin/python examples/run_tutorial.py docs/tutorial-bag.md --print    # only show it

In a page every block that starts with ```console holds commands after "$ ", and whatever stood below a command is
replaced by what it prints now. The commands of ```sh blocks are run too; a ```text block that follows one shows what
matters of its last command's output, and gets today's lines of the same kind. A figure with a mark behind it (see
page_answers.py) gets today's value. Blocks with a comment "test: REASON" before them are left alone. Commands run one
after the other in one scratch folder that holds a copy of examples/, so that a page reads like a session in the
repository and leaves nothing behind.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from page_answers import DETAIL, HEADLINE, NUMBER, PROSE, read_answers, value_at

ROOT = Path(__file__).resolve().parents[1]


def run(command: str, folder: Path) -> str:
    """Output of a command (both streams), and its exit status where that is not 0."""
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "COLUMNS": "110",
        "NO_COLOR": "1",
    }
    done = subprocess.run(
        ["bash", "-c", command],
        cwd=folder,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=False,
    )
    text = "\n".join(line.rstrip() for line in done.stdout.splitlines())
    return text + (f"\n[exit status {done.returncode}]" if done.returncode else "")


def cut(shown: str, output: str) -> str:
    """Of an output what a page shows: the headlines of answers, else the lines that differ from those shown in figures
    alone.
    """
    if read_answers(shown):
        kept, inside = [], False
        for line in output.splitlines():
            inside = bool(HEADLINE.fullmatch(line)) or inside and bool(line.strip()) and not DETAIL.match(line)
            kept += [line] * inside
        return "\n".join(kept)

    def words(line: str) -> str:
        return " ".join(re.sub(rf"{NUMBER}|(?<= )-(?= |$)", "", line).split())

    kinds = {words(line) for line in shown.splitlines()}
    return "\n".join(line for line in output.splitlines() if words(line) in kinds)


def commands(body: list[str]) -> list[str]:
    """Commands of a ```sh block: a line each; one that ends in a backslash or inside of a quote goes on in the next
    line.
    """
    found: list[str] = []
    for line in body:
        if found and (found[-1].endswith("\\") or found[-1].count('"') % 2):
            found[-1] += "\n" + line
        elif line.strip() and not line.lstrip().startswith("#"):
            found.append(line)
    return found


def in_prose(line: str, folder: Path) -> str:
    """A line whose marked figures and words are today's, figures with as many digits as before."""

    def today(m: re.Match[str]) -> str:
        value, _ = value_at(folder, m["file"], m["key"])
        if isinstance(value, str):
            return m[0].replace(m["said"], value, 1)
        share = m["said"].endswith("%")
        digits = len(re.sub(r"\D", "", m["said"]).lstrip("0")) or 1
        text = f"{value * (100.0 if share else 1.0):.{digits}g}" + (" %" if share else "")
        return m[0].replace(m["said"], text, 1)

    return PROSE.sub(today, line)


def refreshed(page: str, only: str = "") -> str:
    """The page with the output of its commands; console commands that do not start with `only` keep what stands
    there.
    """
    result: list[str] = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        shutil.copytree(ROOT / "examples", folder / "examples", ignore=shutil.ignore_patterns("__pycache__"))
        language, mark, body, output = None, False, [], None
        for line in page.splitlines():
            if language is None and line.startswith("```"):
                language, body = line[3:], []
                result.append(line)
            elif language is None:
                if line.strip():
                    mark = line.startswith("<!-- test: ")
                    output = None
                result.append(line)
            elif line == "```":
                if language == "console" and not mark:
                    body = console(body, folder, only)
                elif language == "sh" and not mark:
                    for command in commands(body):
                        output = run(command, folder)
                elif language == "text" and output is not None:
                    body = cut("\n".join(body), output).splitlines()
                result += [*body, line]
                language, mark = None, False
            else:
                body.append(line)
        text = "\n".join(in_prose(line, folder) for line in result) + "\n"
    return text


def console(body: list[str], folder: Path, only: str) -> list[str]:
    """A console block with what its commands print now."""
    result, keep = [], False
    for line in body:
        if line.startswith("$ "):
            result.append(line)
            keep = not line[2:].startswith(only)
            if not keep and (printed := run(line[2:], folder)):
                result += printed.splitlines()
        elif keep:
            result.append(line)
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("page", type=Path)
    parser.add_argument("--print", action="store_true", help="show the page instead of rewriting it")
    args = parser.parse_args()
    text = refreshed(args.page.read_text())
    if args.print:
        print(text, end="")
    else:
        args.page.write_text(text)


if __name__ == "__main__":
    main()
