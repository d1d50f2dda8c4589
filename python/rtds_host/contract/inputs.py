"""Reading what a person points at: a file, not something that never ends."""

from __future__ import annotations

import errno
import os
import stat
from typing import BinaryIO


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


def regular_bytes(path: str | os.PathLike) -> bytes:
    """Content of a regular file. OSError as `open_regular`."""
    with open_regular(path) as stream:
        return stream.read()
