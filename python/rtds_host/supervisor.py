"""Runs a program and ends it, with all of its session, when the process at the other end of a pipe is gone.

``python supervisor.py DESCRIPTOR COMMAND...``: the descriptor is the pipe's reading end, on which nothing ever comes
but its end. It leaves as the program leaves: with its exit status, or by the signal that ended it. Standard library
only: it starts before every program that is guarded.
"""

import os
import signal
import sys
import threading


def main() -> None:
    """Start the program and wait for it, or for the end of whoever wanted it."""
    pipe, command = int(sys.argv[1]), sys.argv[2:]
    os.set_inheritable(pipe, False)
    try:
        child = os.posix_spawnp(command[0], command, os.environ)
    except OSError as error:
        print(f"{command[0]}: cannot be started ({error.strerror})", file=sys.stderr)
        sys.exit(127)

    def watch() -> None:
        os.read(pipe, 1)
        os.killpg(0, signal.SIGKILL)

    threading.Thread(target=watch, daemon=True).start()
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        signal.signal(-code, signal.SIG_DFL) if -code not in (signal.SIGKILL, signal.SIGSTOP) else None
        os.kill(os.getpid(), -code)
    os._exit(code)


if __name__ == "__main__":
    main()
