"""A simulator as a child process at the other end of a socket, which never outlives its link."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import tempfile
import weakref
from collections.abc import Mapping

from rtds_host.errors import LinkError
from rtds_host.link import protocol
from rtds_host.link.build import Built

EXIT_GRACE_S = 2.0
_STDERR_LINES = 3
STDERR_CHARACTERS = 300


def _end(process: subprocess.Popen[bytes], sock: socket.socket) -> None:
    """Leave no simulator behind (also run when the interpreter ends with the link still open)."""
    sock.close()
    if process.poll() is None:
        process.kill()  # SIGKILL ends a stopped process too
    process.wait()


class Child:
    """One process of a built simulator.

    Parameters
    ----------
    built : how it is started. environment : more variables for it.

    Attributes
    ----------
    process, pid : the process. socket : this side's end. stderr : what it writes to both its outputs.

    Raises
    ------
    LinkError : it cannot be started.
    """

    def __init__(self, built: Built, environment: Mapping[str, str]) -> None:
        self.stderr = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the child
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self.process = subprocess.Popen(
                built.command,
                stdin=subprocess.DEVNULL,
                stdout=self.stderr,
                stderr=self.stderr,
                env={
                    **os.environ,
                    **built.environment,
                    **environment,
                    protocol.FD_VARIABLE: str(theirs.fileno()),
                },
                pass_fds=(theirs.fileno(),),
                start_new_session=True,  # Ctrl-C reaches the host alone, which ends the simulator
            )
        except OSError as error:
            ours.close()
            raise LinkError(f"{built.command[0]}: the simulator cannot be started ({error.strerror})") from error
        finally:
            theirs.close()
        self.socket = ours
        self.pid = self.process.pid
        self._finalizer = weakref.finalize(self, _end, self.process, ours)

    def end(self) -> None:
        """Kill it if it still runs. May be called more than once."""
        self._finalizer()

    def how_it_went(self) -> str:
        """Why it has closed the link: its exit status, a signal, or none of these."""
        try:
            status = self.process.wait(EXIT_GRACE_S)
        except subprocess.TimeoutExpired:
            return "it closed the link without leaving; it has been ended"
        if status < 0:
            return f"it was killed by {signal.Signals(-status).name}"
        return f"it ended with exit status {status}"

    def failure(self, name: str, what: str) -> LinkError:
        """End it and put all there is to say into one line."""
        self.end()
        lines = [line.strip() for line in self.said().splitlines() if line.strip()]
        said = " | ".join(lines[-_STDERR_LINES:])[-STDERR_CHARACTERS:]
        return LinkError(f"{name} simulator (process {self.pid}): {what}" + (f"; it said: {said}" if said else ""))

    def said(self) -> str:
        """All that it has written so far."""
        self.stderr.seek(0)
        return self.stderr.read().decode(errors="replace")
