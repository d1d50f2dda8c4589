"""A word before what takes long once: the first command after an installation compiles the replay."""

from __future__ import annotations

import os
import sys
from pathlib import Path

SAID = "rtds: compiling the replay, once, about a minute"


def is_compiled(package: Path, elsewhere: str | None = None) -> bool:
    """Whether compiled functions of the replay are kept, next to its source or in the folder of NUMBA_CACHE_DIR."""
    places = [package / "__pycache__", *([Path(elsewhere)] if elsewhere else [])]
    return any(place.is_dir() and next(place.rglob("*.nbi"), None) is not None for place in places)


def say_if_first(quiet: bool = False) -> None:
    """Say on a terminal that compiling comes first, where nothing is compiled yet."""
    from rtds_host.diagnosis import replay

    package = Path(str(replay.__file__)).parent
    if not quiet and sys.stderr.isatty() and not is_compiled(package, os.environ.get("NUMBA_CACHE_DIR")):
        print(SAID, file=sys.stderr, flush=True)
