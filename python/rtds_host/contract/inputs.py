"""Reading what a person points at: a file, not something that never ends."""

from __future__ import annotations

import errno
import os
import re
import stat
from typing import BinaryIO

from rtds_host.compat import tomllib
from rtds_host.errors import InputError

# Bytes of a file of settings, of a JSON file; dotted parts of one key. A parser of TOML keeps every beginning of a key:
# one of 50,000 parts takes ten gigabytes.
LARGEST_TOML, LARGEST_JSON, MOST_PARTS = 2**18, 2**28, 16
# What may stand around a dot of a key, strings and comments each as a whole, so that dots inside them do not count.
_TOKEN = re.compile(
    r'''"""(?:[^"\\]|\\.|"(?!""))*"""|\'{3}(?:[^\']|\'(?!\'\'))*\'{3}'''
    r"""|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'|(?P<comment>\#[^\n]*)|(?P<dot>\.)|[ \t]+|[A-Za-z0-9_-]+|(?P<end>.)""",
    re.DOTALL,
)


def open_regular(path: str | os.PathLike) -> BinaryIO:
    """A regular file, open for reading its bytes.

    Raises
    ------
    OSError : as `open`; also for a pipe, a socket or a device: nobody may ever write to it, or never stop.
    """
    mode = os.stat(path).st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise OSError(errno.EINVAL, "it is a pipe or a device, a file is needed", str(path))
    return open(path, "rb")


def regular_bytes(path: str | os.PathLike, most: int | None = None) -> bytes:
    """Content of a regular file. OSError as `open_regular`; InputError where it is longer than `most` bytes."""
    with open_regular(path) as stream:
        data = stream.read() if most is None else stream.read(most + 1)
    if most is not None and len(data) > most:
        raise InputError(f"{path}: is longer than {most / 2**20:.3g} MiB, the most that is read")
    return data


def longest_key(text: str) -> tuple[int, int]:
    """Parts of the longest dotted key of a TOML text, and the line that it ends in; (1, 1) where there is none."""
    longest, parts, line, where = 1, 1, 1, 1
    for token in _TOKEN.finditer(text):
        if token["dot"]:
            parts += 1
            if parts > longest:
                longest, where = parts, line
        elif token["end"] or token["comment"]:
            parts = 1
        line += token[0].count("\n")
    return longest, where


def read_toml(path: str | os.PathLike) -> dict:
    """Content of a TOML file, with or without a byte order mark.

    Raises
    ------
    InputError : it cannot be read, is too long, no TOML, or has a key of too many dotted parts; names the file.
    """
    try:
        text = regular_bytes(path, LARGEST_TOML).decode("utf-8-sig")
        # Only where some line has as many dots at all: going through a text piece by piece takes its time.
        dots = max(line.count(".") for line in text.split("\n"))
        parts, line = longest_key(text) if dots >= MOST_PARTS else (1, 0)
        if parts > MOST_PARTS:
            raise InputError(f"{path}: line {line}: a key has {parts} dotted parts, at most {MOST_PARTS} are read")
        return tomllib.loads(text)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    # An integer beyond what Python turns into a number is a plain ValueError.
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not valid TOML ({error})") from error
