"""Errors a user can cause or meet; the command line turns each into one line and an exit status."""


class RtdsError(Exception):
    """Base class. ``str(error)`` is one line that names the place and what is wrong."""


class InputError(RtdsError):
    """The input is unusable (exit status 2): the message names the file, the row or key, and what is wrong."""


class LinkError(RtdsError):
    """The simulator or the board does not answer, died, or cannot be started (exit status 2)."""


class OutputError(RtdsError):
    """The result cannot be written (exit status 2); nothing is left half-written."""
