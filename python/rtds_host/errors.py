"""Errors a user can cause or meet; the command line turns each into one line and an exit status."""

from __future__ import annotations

import difflib
import itertools
import os
import unicodedata
from collections.abc import Iterable

# Characters of a value and of a whole message, and names of a list, that a line repeats. A path may have 4,096.
LONGEST_VALUE, LONGEST_MESSAGE, MOST_NAMES = 80, 6000, 30
# Names that a wrong one is compared with: 100,000 take seconds.
MOST_COMPARED = 2000
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


def shown(value: object, most: int = LONGEST_VALUE) -> str:
    """A value of a file as a message repeats it: its `repr`, cut to its first characters where it is long."""
    if isinstance(value, str | bytes):
        part = repr(value[:most])
        return (
            part
            if len(value) <= most
            else f"{part}… ({len(value)} {'characters' if isinstance(value, str) else 'bytes'})"
        )
    if isinstance(value, int) and value.bit_length() > 4 * most:
        # Python refuses to write such a number in decimals.
        return f"a whole number of {value.bit_length()} bits"
    try:
        text = repr(value)
    except (ValueError, RecursionError):
        text = f"a {type(value).__name__}"
    return text if len(text) <= most else text[:most] + "…"


def listed(names: Iterable[str], most: int = MOST_NAMES) -> str:
    """Names with commas between them, the first ones where there are many, each cut where it is long."""
    names = list(names)
    said = [name if len(name) <= LONGEST_VALUE else name[:LONGEST_VALUE] + "…" for name in names[:most]]
    return ", ".join(said) + (f" and {len(names) - most} more" if len(names) > most else "")


def brief(text: str) -> str:
    """A message of a length that a terminal can show: what is too long loses its middle."""
    if len(text) <= LONGEST_MESSAGE:
        return text
    kept = LONGEST_MESSAGE // 2
    return f"{text[:kept]} … ({len(text) - 2 * kept} characters left out) … {text[-kept:]}"


class _Brief(type):
    """What `help` lists of an error: nothing that every Python exception has, which is seventy lines."""

    def __dir__(cls) -> list[str]:
        return []


class RtdsError(Exception, metaclass=_Brief):
    """A person can cause or meet it. ``str(error)`` is one line that names the place and what is wrong."""

    def __init__(self, *parts: object):
        super().__init__(*(brief(part) if isinstance(part, str) else part for part in parts))


class InputError(RtdsError):
    """The input is unusable (exit status 2): the message names the file, the row or key, and what is wrong."""


class LinkError(RtdsError):
    """The simulator or the board does not answer, died, or cannot be started (exit status 2)."""


class OutputError(RtdsError):
    """The result cannot be written (exit status 2); nothing is left half-written."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """ "; did you mean 'circle'?" where one of the known names is close, "" where none is."""
    if len(name) > LONGEST_VALUE:
        return ""  # nobody's slip of the pen, and slow to compare
    close = difflib.get_close_matches(name.lower(), list(itertools.islice(known, MOST_COMPARED)), 1)
    return f"; did you mean {close[0]!r}?" if close else ""
