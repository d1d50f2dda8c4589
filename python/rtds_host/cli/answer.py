"""Answers for programs: one JSON object on standard output, and nothing else."""

from __future__ import annotations

import json
import math
import os
import sys
from dataclasses import asdict, is_dataclass
from typing import Annotated, Any

import typer

# The option of every command that answers.
AsJson = Annotated[bool, typer.Option("--json", help="Print the answer as one JSON object, and nothing else.")]

# The option of every command that takes a while.
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress on the terminal.")]

# Scripts give it: a diagnosis used random numbers once.
Seed = Annotated[int | None, typer.Option("--seed", help="Has no effect, which is said.", hidden=True)]


def say_if_seeded(seed: int | None, quiet: bool) -> None:
    """Say on the standard error that a seed changes nothing."""
    if seed is not None and not quiet:
        print("--seed has no effect: a diagnosis uses no random numbers", file=sys.stderr)


def plain(value: Any) -> Any:
    """A value as JSON has it: paths and names as text, arrays as lists, dataclasses as objects, and numbers that are
    not finite as null, for which JSON has no other word."""
    if hasattr(value, "tolist"):
        # Of numpy, which is not loaded for this.
        value = value.tolist()
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, dict):
        return {str(name): plain(one) for name, one in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(one) for one in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return value


def answer(content: dict[str, Any]) -> None:
    """Print an answer for a program."""
    # ASCII: a name of a file that is no text would stop the printing otherwise.
    print(json.dumps(plain(content), indent=1, allow_nan=False), flush=True)
