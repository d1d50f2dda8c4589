"""The process `rtds`: from its first moment to its last, Ctrl-C ends it with one line and status 130 or not at all."""

from __future__ import annotations

# What is loaded here comes with Python: a Ctrl-C while more loaded would be answered with a traceback. The rest is
# imported where `main` waits for one.
import os
import sys

# Numerical: objects that are made before the collector looks for circles among them. What is imported stays, and by
# default it is looked through so often that a short diagnosis takes a thirtieth longer.
YOUNG = 100_000


def _end(number: int, frame: object) -> None:
    """A request to end is answered as Ctrl-C is: what runs is put away, and the process leaves by its own status."""
    import signal

    for asked in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(asked, signal.SIG_IGN)
    raise KeyboardInterrupt(number)


def _asked(error: BaseException | None, otherwise: int) -> int:
    """Number of the signal that an interruption came from; Click and Typer raise another in its place."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt) and error.args and isinstance(error.args[0], int):
            return error.args[0]
        error = error.__cause__ or error.__context__
    return otherwise


def _release() -> None:
    """Give back what multiprocessing holds in the system: it would warn of semaphores that nobody returned."""
    util = sys.modules.get("multiprocessing.util")
    if util is not None:
        try:
            util._run_finalizers(0)
        except Exception:
            # Whatever a finalizer meets half-way through an interruption: the process leaves in the next line, and its
            # one line is already said.
            return


def main() -> None:
    """Entry point: exit status 0 done, 1 some of several cases failed, 2 unusable input, 130 interrupted, 143 ended by
    SIGTERM, 129 by a terminal that was closed.
    """
    status = None
    try:
        import gc
        import signal

        gc.set_threshold(YOUNG)
        for asked in (signal.SIGTERM, signal.SIGHUP):
            # One that is ignored (nohup) stays so.
            if signal.getsignal(asked) is signal.SIG_DFL:
                signal.signal(asked, _end)
        # Here, since Ctrl-C may strike while modules load, too.
        from rtds_host.cli import commands

        try:
            commands.main()
        except SystemExit as end:
            status = end.code
        # The work is done and said: while Python leaves, Ctrl-C would meet nobody who answers it.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    except KeyboardInterrupt as error:
        import signal

        signal.signal(signal.SIGINT, signal.SIG_IGN)
        by = _asked(error, int(signal.SIGINT))
        try:
            print(f"rtds: {'interrupted' if by == signal.SIGINT else 'ended by a signal'}", file=sys.stderr, flush=True)
            sys.stdout.flush()
        except OSError:
            pass  # whoever read it has gone first
        _release()
        # Had the signal struck while some import executed a string, Python would end by the signal, whatever status it
        # is given.
        os._exit(128 + by)
    sys.exit(status)


if __name__ == "__main__":
    main()
