"""Run the commands of a documentation page and put their real output below them.

    .venv/bin/python examples/run_tutorial.py docs/tutorial-bag.md            # rewrite the page
    .venv/bin/python examples/run_tutorial.py docs/tutorial-bag.md --print    # only show it

In a page every block that starts with ```console holds commands after "$ ", and whatever stood below a command is
replaced by what it prints now. Commands run one after the other in one scratch folder that holds a copy of
examples/, so that a page reads like a session in the repository and leaves nothing behind.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def run(command: str, folder: Path) -> str:
    """Output of a command (both streams), and its exit status where that is not 0."""
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "COLUMNS": "110",
                   "NO_COLOR": "1"}
    done = subprocess.run(["bash", "-c", command], cwd=folder, env=environment, text=True, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, check=False)
    text = "\n".join(line.rstrip() for line in done.stdout.splitlines())
    return text + (f"\n[exit status {done.returncode}]" if done.returncode else "")


def refreshed(page: str, only: str = "") -> str:
    """The page with the output of its commands; commands that do not start with `only` keep what stands there."""
    result: list[str] = []
    with tempfile.TemporaryDirectory() as scratch:
        shutil.copytree(ROOT / "examples", Path(scratch) / "examples", ignore=shutil.ignore_patterns("__pycache__"))
        inside = keep = False
        for line in page.splitlines():
            if line.startswith("```"):
                inside = line == "```console"
                keep = False
                result.append(line)
            elif not inside:
                result.append(line)
            elif line.startswith("$ "):
                result.append(line)
                keep = not line[2:].startswith(only)
                if not keep and (output := run(line[2:], Path(scratch))):
                    result += output.splitlines()
            elif keep:
                result.append(line)
    return "\n".join(result) + "\n"


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
