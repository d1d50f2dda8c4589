"""The physics engine's own window, for whoever wants to see the robot in it."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from rtds_host.errors import InputError

_OPEN: ContextVar[bool] = ContextVar("rtds_window", default=False)


def windowed() -> bool:
    """Whether an engine that is opened now shall have a window."""
    return _OPEN.get()


@contextmanager
def window(wanted: bool) -> Iterator[None]:
    """Engines that are opened inside have a window, if it is wanted; what they compute does not change by it."""
    token = _OPEN.set(wanted)
    try:
        yield
    finally:
        _OPEN.reset(token)


def check_display(option: str) -> None:
    """Whether there is a display that a window could be on.

    Raises
    ------
    InputError : there is none, as on a machine that one reaches through a terminal only.
    """
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InputError(f"{option}: there is no display here (DISPLAY is not set); --live needs none")
