"""The process `rtds`: from its first moment to its last, Ctrl-C ends it with one line and status 130 or not at all."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress


def main() -> None:
    """Entry point: exit status 0 done, 1 some of several cases failed, 2 unusable input, 130 interrupted."""
    status = None
    try:
        # Here, since Ctrl-C may strike while modules load, too.
        from rtds_host.cli import commands

        try:
            commands.main()
        except SystemExit as end:
            status = end.code
        # The work is done and said: while Python leaves, Ctrl-C would meet nobody who answers it.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        with suppress(OSError):  # whoever read it has gone first
            print("rtds: interrupted", file=sys.stderr, flush=True)
            sys.stdout.flush()
        # Had the signal struck while some import executed a string, Python would end by the signal, whatever status it
        # is given.
        os._exit(130)
    sys.exit(status)


if __name__ == "__main__":
    main()
