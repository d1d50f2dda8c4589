"""Errors a user can cause or meet; the command line turns each into one line and an exit status."""

from __future__ import annotations

import difflib
import os
import unicodedata
from collections.abc import Iterable

# Control and format characters, surrogates (bytes of a file name that are no text), characters without a meaning, line
# ends.
_UNSEEN = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")


def visible(text: object) -> str:
    """A text as one line that may go to a terminal: what would steer it, or cannot be written, is spelled out as
    `\\x1b`.
    """
    return "".join(
        c if c.isprintable() or unicodedata.category(c) not in _UNSEEN else c.encode("unicode_escape").decode("ascii")
        for c in str(text)
    )


def said_of_file(error: OSError) -> str:
    """What the system refused, with the place if it names one."""
    what = " ".join(str(error.strerror or error).split())
    return f"{os.fsdecode(error.filename)}: {what}" if isinstance(error.filename, str | bytes) else what


class RtdsError(Exception):
    """Base class. ``str(error)`` is one line that names the place and what is wrong."""


class InputError(RtdsError):
    """The input is unusable (exit status 2): the message names the file, the row or key, and what is wrong."""


class LinkError(RtdsError):
    """The simulator or the board does not answer, died, or cannot be started (exit status 2)."""


class OutputError(RtdsError):
    """The result cannot be written (exit status 2); nothing is left half-written."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """ "; did you mean 'circle'?" where one of the known names is close, "" where none is."""
    close = difflib.get_close_matches(name.lower(), list(known), 1)
    return f"; did you mean {close[0]!r}?" if close else ""
