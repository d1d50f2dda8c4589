"""Many independent jobs, on the cores of this machine or on a Dask cluster: one bad job costs no other.

Only the caller writes results: a job returns its value, so that a worker that dies, or whose work is done again
elsewhere, leaves nothing behind, and each outcome arrives once.
"""

from __future__ import annotations

import concurrent.futures
import logging
import multiprocessing
import multiprocessing.connection
import os
import queue
import re
import signal
import socket
import sys
import threading
import time
import traceback
import uuid
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

from rtds_host import __version__
from rtds_host.cleanup import end_running
from rtds_host.errors import InputError, LinkError, RtdsError, said_of_file

CONNECT_S = 4.0
WORKERS_S = 20.0
WORKERLESS_S = 60.0
GONE_S = 2.0
_LOOK_S = 0.5
LOST = "its process died (killed, out of memory, or crashed)"


@dataclass(frozen=True)
class Outcome:
    """What became of one job: its value, or one line that says why there is none."""

    name: str
    value: Any = None
    error: str | None = None


def cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0))


def _said(error: BaseException, trace: str) -> str:
    """One line for a failed job; of an unexpected error also its kind and its place."""
    text = " ".join(str(error).split())
    if isinstance(error, RtdsError):
        return text
    if isinstance(error, MemoryError):
        return "out of memory"
    if isinstance(error, OSError) and error.errno is not None:
        return said_of_file(error)
    places = re.findall(r'File "([^"]+)", line (\d+)', trace)
    place = f" at {os.path.basename(places[-1][0])}:{places[-1][1]}" if places else ""
    return f"internal error{place}: {type(error).__name__}: {text}".rstrip(": ")


def one_line(error: BaseException) -> str:
    """What an error that was caught here says, in one line; of an unexpected one also its kind and its place."""
    return _said(error, "".join(traceback.format_exception(error)))


# ---- cores of this machine -------------------------------------------------------------------------------------------


def _start_worker() -> None:
    """A worker leaves Ctrl-C to its parent, and ends when the parent is gone, however it went."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    """End this process when the one that `sentinel` belongs to has ended."""
    multiprocessing.connection.wait([sentinel])
    os._exit(1)


@contextmanager
def process_pool(processes: int) -> Iterator[concurrent.futures.ProcessPoolExecutor]:
    """Processes that end with this one, however it ends, and leave Ctrl-C to it; ended where the block does not end
    well.
    """
    others = set(multiprocessing.active_children())
    pool = concurrent.futures.ProcessPoolExecutor(
        processes, mp_context=multiprocessing.get_context("spawn"), initializer=_start_worker
    )
    finished = False
    try:
        yield pool
        finished = True
    finally:
        if not finished:
            # Interrupted, or the results cannot be written: what still runs is of no use.
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
            # One that ends in the middle of a result leaves half of it in the pipe. The pool would wait for the other
            # half for as long as anybody could write it, and that is this process itself.
            pool._result_queue._writer.close()  # type: ignore[attr-defined]  # no public way
        pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Ctrl-C waits: a process started meanwhile does not meet it before it can ignore it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def on_cores(function: Callable, jobs: Mapping[str, tuple], processes: int) -> Generator[Outcome, None, None]:
    """Run `function(*arguments)` of each job in a pool of processes; yield outcomes as they come, each job once.

    A process that dies takes the whole pool with it. Those jobs that ran at that moment are then run again, each alone,
    and the one that kills its process again is the one to blame.

    Parameters
    ----------
    function : importable by name in a new process; jobs : name -> arguments, both picklable.
    """
    waiting = deque(jobs.items())
    suspects: deque = deque()
    while waiting or suspects:
        alone = not waiting
        queue = deque([suspects.popleft()]) if alone else waiting
        width = 1 if alone else max(1, min(processes, len(waiting)))
        running: dict[concurrent.futures.Future, tuple[str, tuple]] = {}
        lost: list[tuple[str, tuple]] = []
        why = LOST
        with process_pool(width) as pool:
            while (queue or running) and not lost:
                while queue and len(running) < width and not lost:
                    job = queue.popleft()
                    try:
                        with _interrupts_held():
                            running[pool.submit(function, *job[1])] = job
                    except (BrokenProcessPool, OSError, MemoryError) as error:
                        # Also where no process can be started: no memory, no more processes allowed.
                        why = LOST if isinstance(error, BrokenProcessPool) else one_line(error)
                        lost.append(job)
                done = (
                    concurrent.futures.wait(running, return_when=concurrent.futures.FIRST_COMPLETED).done
                    if running
                    else ()
                )
                for future in done:
                    job = running.pop(future)
                    raised = future.exception()
                    if isinstance(raised, BrokenProcessPool):
                        lost.append(job)
                    elif raised is not None:
                        yield Outcome(job[0], error=one_line(raised))
                    else:
                        yield Outcome(job[0], future.result())
        lost += running.values()
        if lost and alone:
            yield Outcome(lost[0][0], error=why)
        else:
            suspects.extend(lost)


def on_threads(
    function: Callable, jobs: Mapping[str, Callable[[], tuple]], width: int
) -> Generator[Outcome, None, None]:
    """Like `on_cores` for jobs that start processes (`run_supervised`): a thread waits for each. Arguments as
    `on_cluster`'s.

    When it is closed early, jobs that have not begun are dropped and the programs of those that have are ended.
    """
    pool = concurrent.futures.ThreadPoolExecutor(max(1, width))
    finished = False
    try:
        running = {pool.submit(lambda make: function(*make()), make): name for name, make in jobs.items()}
        for future in concurrent.futures.as_completed(running):
            error = future.exception()
            if error is not None:
                yield Outcome(running[future], error=one_line(error))
            else:
                yield Outcome(running[future], future.result())
        finished = True
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        if not finished:
            end_running()
        pool.shutdown(wait=True)


# ---- a Dask cluster --------------------------------------------------------------------------------------------------


def _version() -> str:
    """Version of this package where it runs."""
    return __version__


def check_reachable(scheduler: str) -> None:
    """Whether the address is one, and somebody listens there: in words and at once, not after Dask's own patience.

    Raises
    ------
    InputError : no address. LinkError : no such host, or nobody listens.
    """
    found = re.fullmatch(r"(tcp|tls)://(\[[0-9A-Fa-f:.%]+\]|[^\s:/\[\]@]+):(\d{1,5})/?", scheduler)
    if found is None or not 0 < int(found[3]) < 65536:
        raise InputError(
            f"--scheduler {scheduler}: is not an address of a scheduler, tcp://host:8786 or tls://host:8786 is needed"
        )
    answer: queue.SimpleQueue = queue.SimpleQueue()

    def ask() -> None:
        try:
            socket.create_connection((found[2].strip("[]"), int(found[3])), timeout=CONNECT_S).close()
            answer.put(None)
        except (OSError, UnicodeError) as error:
            answer.put(error)

    # In a thread: looking a name up knows no time limit.
    threading.Thread(target=ask, daemon=True).start()
    try:
        error = answer.get(timeout=CONNECT_S)
    except queue.Empty:
        raise LinkError(f"scheduler {scheduler}: does not answer within {CONNECT_S:g} s") from None
    if error is not None:
        raise LinkError(f"scheduler {scheduler}: does not answer ({' '.join(str(error).split())})") from error


def _quiet() -> None:
    """Dask tells of a lost scheduler in tracebacks, also when its client is closed already; the caller gets a line."""
    names = [
        name for name in logging.root.manager.loggerDict if name.split(".")[0] in ("distributed", "tornado", "asyncio")
    ]
    # Dask gives loggers of its own levels and handlers, which what is said of their parents does not reach.
    for name in ("distributed", "tornado", "asyncio", *names):
        logger = logging.getLogger(name)
        logger.setLevel(logging.CRITICAL + 1)
        logger.propagate = False


def _started(start: Callable[[], Any], scheduler: str) -> Any:
    """A client that is connected. Somebody who takes the connection and says nothing would be waited for
    without end.
    """
    answer: queue.SimpleQueue = queue.SimpleQueue()

    def run() -> None:
        try:
            answer.put((start(), None))
        except Exception as error:  # noqa: BLE001 - whatever Dask makes of what it meets there
            answer.put((None, error))

    threading.Thread(target=run, daemon=True).start()
    try:
        client, error = answer.get(timeout=CONNECT_S + 0.5)
    except queue.Empty:
        raise LinkError(
            f"scheduler {scheduler}: does not answer within {CONNECT_S:g} s, it may be no Dask scheduler"
        ) from None
    if error is not None:
        raise LinkError(f"scheduler {scheduler}: does not answer ({' '.join(str(error).split())})") from error
    return client


def _certified(scheduler: str) -> None:
    """Whether this machine has what `tls://` needs of it; Dask reads the same configuration and says it in its own
    terms.

    Raises
    ------
    InputError : no certificate is configured, or it cannot be read.
    """
    from distributed.security import Security

    if not scheduler.startswith("tls:"):
        return
    try:
        known = Security().get_connection_args("client").get("ssl_context") is not None
    except (OSError, ValueError, TypeError) as error:
        raise InputError(
            f"--scheduler {scheduler}: the certificate of this machine cannot be used ({' '.join(str(error).split())})"
        ) from error
    if not known:
        raise InputError(
            f"--scheduler {scheduler}: no certificate of this machine is configured, DASK_DISTRIBUTED__COMM__TLS__"
            "CA_FILE, CLIENT__CERT and CLIENT__KEY name its files"
        )


def check_cluster(scheduler: str) -> None:
    """What can be found out of a cluster before work is handed to it.

    Raises
    ------
    InputError : no address, or no certificate for it. LinkError : nobody listens there, or Dask is not installed.
    """
    check_reachable(scheduler)
    try:
        import dask  # noqa: F401
        import distributed  # noqa: F401
    except ImportError as error:
        raise LinkError(f"scheduler {scheduler}: Dask is not installed: pip install 'rtds-host[cluster]'") from error
    _certified(scheduler)


@contextmanager
def client_of(scheduler: str) -> Iterator[Any]:
    check_cluster(scheduler)
    import dask
    import distributed

    class Client(distributed.Client):
        def __del__(self) -> None:
            """One that never started is left as it is: Dask would wait for its end for seconds, and tell of it in a
            traceback.
            """

    # A case travels inside its task, on purpose: scattered data would be lost with the worker that holds it.
    settings = {
        "distributed.admin.large-graph-warning-threshold": "10GB",
        "distributed.comm.timeouts.connect": f"{CONNECT_S}s",
        "distributed.comm.retry.count": 0,
    }
    _quiet()
    with dask.config.set(settings), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        client = _started(partial(Client, scheduler, timeout=CONNECT_S, set_as_default=False), scheduler)
        try:
            try:
                client.wait_for_workers(1, timeout=WORKERS_S)
                found = set(client.run(_version).values())
            except TimeoutError as error:
                raise LinkError(f"scheduler {scheduler}: has no worker") from error
            except ImportError as error:
                raise LinkError(f"scheduler {scheduler}: a worker lacks this program ({error})") from error
            except (OSError, concurrent.futures.CancelledError) as error:
                raise LinkError(f"scheduler {scheduler}: is gone ({' '.join(str(error).split())[:200]})") from error
            if found - {__version__}:
                raise LinkError(
                    f"scheduler {scheduler}: a worker has version {min(found - {__version__})} of this "
                    f"program, here is {__version__}"
                )
            yield client
        finally:
            with suppress(concurrent.futures.CancelledError, OSError, TimeoutError, RuntimeError):
                client.close(timeout=2)


def _portable(function: Callable) -> None:
    """Only a name goes to the workers, never code: what a name stands for is what is installed there."""
    module = sys.modules.get(function.__module__)
    if function.__module__ == "__main__" or getattr(module, function.__qualname__, None) is not function:
        raise ValueError(f"{function.__module__}.{function.__qualname__}: is not to be found by its name on a worker")


class _Watch:
    """Notices that the scheduler is gone: Dask itself goes on trying to reach it."""

    def __init__(self, client: Any, scheduler: str):
        self.client_of, self._scheduler = client, scheduler
        self._seen = time.monotonic()

    def look(self) -> None:
        """Raises LinkError when it has been gone for a while."""
        now = time.monotonic()
        if self.client_of.status == "running":
            self._seen = now
        elif now - self._seen > GONE_S:
            raise LinkError(f"scheduler {self._scheduler}: is gone; call again to go on")


def _submitted(client: Any, function: Callable, name: str, arguments: tuple) -> Any:
    """The future of one job on the cluster."""
    return client.submit(function, *arguments, key=f"rtds-{name}-{uuid.uuid4().hex}", pure=False)


def on_cluster(
    function: Callable, jobs: Mapping[str, Callable[[], tuple]], scheduler: str
) -> Generator[Outcome, None, None]:
    """Run `function(*arguments)` of each job on a Dask cluster; yield outcomes as they come, each job once.

    The work of a worker that dies is done again by another. A job that keeps killing workers is run once more with no
    other job next to it before it is blamed.

    Parameters
    ----------
    function : importable on the workers. jobs : name -> function that makes the arguments (here, shortly before they
        are sent, so that cases beyond counting need no memory); an `RtdsError` of it is the job's outcome.
    scheduler : address as Dask writes it, `tcp://host:8786`.

    Raises
    ------
    InputError : no address. LinkError : nobody answers there, no worker is there or none is left, a worker has another
    version, the scheduler is lost on the way. ValueError : `function` is not importable.
    """
    _portable(function)
    with client_of(scheduler) as client:
        import distributed

        watch, idle_since = _Watch(client, scheduler), None
        waiting = deque(jobs.items())
        suspects: deque[tuple[str, Callable]] = deque()
        running: dict[Any, tuple[str, Callable]] = {}
        blamed: set[str] = set()
        try:
            while waiting or suspects or running:
                width = 2 * max(1, sum(client.nthreads().values()))
                while waiting and len(running) < width and not blamed & {name for name, _ in running.values()}:
                    name, make = waiting.popleft()
                    try:
                        arguments = make()
                    except (RtdsError, OSError, MemoryError) as error:
                        yield Outcome(name, error=one_line(error))
                        continue
                    running[_submitted(client, function, name, arguments)] = (name, make)
                if not running and not waiting and suspects:
                    name, make = suspects.popleft()
                    blamed.add(name)
                    running[_submitted(client, function, name, make())] = (name, make)
                if not running:
                    continue
                try:
                    with client.as_current():
                        done = distributed.wait(list(running), timeout=_LOOK_S, return_when="FIRST_COMPLETED").done
                except TimeoutError:
                    watch.look()
                    if client.status != "running" or client.nthreads():
                        idle_since = None
                    elif idle_since is None:
                        idle_since = time.monotonic()
                    elif time.monotonic() - idle_since > WORKERLESS_S:
                        raise LinkError(f"scheduler {scheduler}: no worker is left; call again to go on") from None
                    continue
                for future in done:
                    name, make = running.pop(future)
                    raised = future.exception()
                    if isinstance(raised, distributed.scheduler.KilledWorker):
                        if name in blamed:
                            yield Outcome(name, error="its workers died (killed, out of memory, or crashed)")
                        else:
                            suspects.append((name, make))
                    elif raised is not None:
                        trace = "".join(traceback.format_tb(future.traceback()))
                        yield Outcome(name, error=_said(raised, trace))
                    else:
                        yield Outcome(name, future.result())
                    future.release()
        except (concurrent.futures.CancelledError, OSError) as error:
            raise LinkError(
                f"scheduler {scheduler}: is gone ({' '.join(str(error).split())[:200]}); call again to go on"
            ) from error
        finally:
            if client.status == "running":
                with suppress(concurrent.futures.CancelledError, OSError, TimeoutError):
                    client.cancel(list(running), force=True)
