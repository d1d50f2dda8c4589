"""How equations are compiled: inlined into the loops that use them, and cached under the state of this package.

Numba keeps a compiled loop by the date of its own source file. A loop here also holds the equations it inlines and the
positions of the parameters. Its cache entry is therefore keyed by a digest of this package's sources.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache


def digest_of(folder: Path) -> str:
    """A digest (hexadecimal) of a package's sources, names and contents, folders in it included."""
    found = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        found.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()


DIGEST = digest_of(Path(__file__).parent)


class KeyedCache(FunctionCache):
    """Numba's cache of a function on disk, whose entries hold for one state of this package only."""

    digest = DIGEST

    def _index_key(self, sig: Any, codegen: Any) -> tuple:
        return (*super()._index_key(sig, codegen), self.digest)


def law(function: Callable) -> Any:
    """Compile an equation: pure, of scalars, inlined wherever a compiled loop calls it."""
    return numba.njit(nogil=True, error_model="numpy", inline="always")(function)


def loop(function: Callable) -> Any:
    """Compile a loop that uses equations or positions of parameters, with a cache entry that follows both."""
    return _cached(function)


def allocation_free(function: Callable) -> Any:
    """The same of a loop that allocates no array. Nothing in it is counted by reference: at each step of a replay,
    counting the rows that a form is read from costs as much as the rest of the step.

    `_nrt` is an option that Numba's manual leaves out; where a loop does allocate, it refuses to compile.
    """
    return _cached(function, _nrt=False)


def _cached(function: Callable, **options: Any) -> Any:
    dispatcher = numba.njit(nogil=True, error_model="numpy", **options)(function)
    # Numba has no public way to give a function another cache.
    dispatcher._cache = KeyedCache(dispatcher.py_func)
    return dispatcher
