"""Memory that a search keeps for itself.

Its arrays have megabytes, and live for milliseconds. The C library gives such blocks back at once, and what it gets
again the system has to clear first: a fifth of a search's processor time.
"""

from __future__ import annotations

import ctypes

# Numerical: options of `mallopt` by their numbers in glibc's malloc.h: (M_ARENA_MAX) threads share what is free;
# (M_MMAP_THRESHOLD) blocks of up to so many bytes come from there; (M_TRIM_THRESHOLD) so many bytes stay free.
_OPTIONS = ((-8, 1), (-3, 2**30), (-1, 2**31 - 1))


def keep_freed() -> None:
    """Let the C library keep what is freed, to hand it out again; elsewhere than with glibc nothing changes.

    For a process that does nothing but diagnose: whoever calls the functions from a program of their own keeps their
    settings.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return
    for option, value in _OPTIONS:
        mallopt(option, value)
