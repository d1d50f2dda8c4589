"""Many independent jobs, on the cores of this machine or on a Dask cluster: one bad job costs no other.

Only the caller writes results: a job returns its value, so that a worker that dies, or whose work is done again
elsewhere, leaves nothing behind, and each outcome arrives once.
"""

from __future__ import annotations

import concurrent.futures
import multiprocessing
import multiprocessing.connection
import os
import re
import signal
import threading
import traceback
import uuid
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from rtds_host import __version__
from rtds_host.errors import LinkError, RtdsError, said_of_file
from rtds_host.remains import end_running

CONNECT_S = 20.0
WORKERLESS_S = 60.0
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

    def watch() -> None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)

    if parent is not None:
        threading.Thread(target=watch, daemon=True).start()


@contextmanager
def process_pool(processes: int) -> Iterator[concurrent.futures.ProcessPoolExecutor]:
    """Processes that end with this one, however it ends, and leave Ctrl-C to it; ended where the block does not end well."""
    others = set(multiprocessing.active_children())
    pool = concurrent.futures.ProcessPoolExecutor(
        processes, mp_context=multiprocessing.get_context("spawn"), initializer=_start_worker)
    finished = False
    try:
        yield pool
        finished = True
    finally:
        if not finished:
            # Interrupted, or the results cannot be written: what still runs is of no use.
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
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


def on_cores(function: Callable, jobs: Mapping[str, tuple], processes: int) -> Iterator[Outcome]:
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
                done = concurrent.futures.wait(running, return_when=concurrent.futures.FIRST_COMPLETED).done \
                    if running else ()
                for future in done:
                    job = running.pop(future)
                    error = future.exception()
                    if isinstance(error, BrokenProcessPool):
                        lost.append(job)
                    elif error is not None:
                        yield Outcome(job[0], error=one_line(error))
                    else:
                        yield Outcome(job[0], future.result())
        lost += running.values()
        if lost and alone:
            yield Outcome(lost[0][0], error=why)
        else:
            suspects.extend(lost)


def on_threads(function: Callable, jobs: Mapping[str, Callable[[], tuple]], width: int) -> Iterator[Outcome]:
    """Like `on_cores` for jobs that start processes (`run_guarded`): a thread waits for each. Arguments as `on_cluster`'s.

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


@contextmanager
def _client(scheduler: str) -> Iterator[Any]:
    import dask
    import distributed

    # A case travels inside its task, on purpose: scattered data would be lost with the worker that holds it.
    with dask.config.set({"distributed.admin.large-graph-warning-threshold": "10GB"}):
        try:
            client = distributed.Client(scheduler, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError, ImportError) as error:
            raise LinkError(f"scheduler {scheduler}: does not answer ({' '.join(str(error).split())})") from error
        try:
            try:
                client.wait_for_workers(1, timeout=CONNECT_S)
                found = set(client.run(_version).values())
            except TimeoutError as error:
                raise LinkError(f"scheduler {scheduler}: has no worker") from error
            except ImportError as error:
                raise LinkError(f"scheduler {scheduler}: a worker lacks this program ({error})") from error
            if found - {__version__}:
                raise LinkError(f"scheduler {scheduler}: a worker has version {min(found - {__version__})} of this "
                                f"program, here is {__version__}")
            yield client
        finally:
            # A scheduler that is gone is no news by now.
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                client.close(timeout=5)


def on_cluster(function: Callable, jobs: Mapping[str, Callable[[], tuple]], scheduler: str) -> Iterator[Outcome]:
    """Run `function(*arguments)` of each job on a Dask cluster; yield outcomes as they come, each job once.

    The work of a worker that dies is done again by another. A job that keeps killing workers is run once more with no
    other job beside it before it is blamed.

    Parameters
    ----------
    function : importable on the workers. jobs : name -> function that makes the arguments (here, shortly before they
        are sent, so that cases beyond counting need no memory); an `RtdsError` of it is the job's outcome.
    scheduler : address as Dask writes it, `tcp://host:8786`.

    Raises
    ------
    LinkError : nobody answers at the address, no worker is there or none is left, a worker has another version.
    """
    import distributed

    with _client(scheduler) as client:
        waiting, suspects = deque(jobs.items()), deque()
        running: dict[Any, tuple[str, Callable]] = {}
        blamed: set[str] = set()
        try:
            while waiting or suspects or running:
                width = 2 * max(1, sum(client.nthreads().values()))
                while waiting and len(running) < width and not blamed & {name for name, _ in running.values()}:
                    name, make = waiting.popleft()
                    try:
                        arguments = make()
                    except RtdsError as error:
                        yield Outcome(name, error=str(error))
                        continue
                    future = client.submit(function, *arguments, key=f"rtds-{name}-{uuid.uuid4().hex}", pure=False)
                    running[future] = (name, make)
                if not running and not waiting and suspects:
                    name, make = suspects.popleft()
                    blamed.add(name)
                    future = client.submit(function, *make(), key=f"rtds-{name}-{uuid.uuid4().hex}", pure=False)
                    running[future] = (name, make)
                if not running:
                    continue
                try:
                    with client.as_current():
                        done = distributed.wait(list(running), timeout=WORKERLESS_S,
                                                return_when="FIRST_COMPLETED").done
                except TimeoutError:
                    if not client.nthreads():
                        raise LinkError(f"scheduler {scheduler}: no worker is left; call again to go on") from None
                    continue
                for future in done:
                    name, make = running.pop(future)
                    error = future.exception()
                    if isinstance(error, distributed.scheduler.KilledWorker):
                        if name in blamed:
                            yield Outcome(name, error="its workers died (killed, out of memory, or crashed)")
                        else:
                            suspects.append((name, make))
                    elif error is not None:
                        trace = "".join(traceback.format_tb(future.traceback()))
                        yield Outcome(name, error=_said(error, trace))
                    else:
                        yield Outcome(name, future.result())
                    future.release()
        except (concurrent.futures.CancelledError, OSError) as error:
            raise LinkError(f"scheduler {scheduler}: is gone ({' '.join(str(error).split())[:200]}); call again to go "
                            "on") from error
        finally:
            client.cancel(list(running), force=True)
