"""What a process that is killed leaves: scratch files and folders, which the next start takes away, and no processes.

A scratch file or folder is locked by its owner (`flock`), and the kernel frees the lock when the owner dies, whatever
the way. So what is not locked is nobody's any more. A program that is started runs next to a guard (`supervisor.py`),
which ends it and all that it started when this process is gone.
"""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

SUFFIX = ".rtds"
_SUPERVISOR = Path(__file__).with_name("supervisor.py")
_TEMPORARY = re.compile(r"rtds-[a-z0-9_]{8}" + re.escape(SUFFIX))
_running: set[subprocess.Popen] = set()
_lifeline: tuple[int, int] | None = None
_lock = threading.Lock()


# ---- scratch ---------------------------------------------------------------------------------------------------------


def _hold(path: str | os.PathLike, handle: int) -> bool:
    """Lock what `handle` has open; False where a sweep was faster and `path` is not it any more."""
    with suppress(OSError):  # no locks in this file system: then nothing is swept there either
        fcntl.flock(handle, fcntl.LOCK_EX)
    try:
        return os.stat(path).st_ino == os.fstat(handle).st_ino
    except FileNotFoundError:
        return False


def scratch_name(name: str) -> re.Pattern:
    """Names of the scratch files and folders of a file or folder called `name`."""
    return re.compile(r"\." + re.escape(name) + r"-[a-z0-9_]{8}" + re.escape(SUFFIX))


def sweep(place: str | os.PathLike, *known: re.Pattern) -> None:
    """Take away what dead processes left in a folder, by the names of `scratch_name`; what is in use stays."""
    try:
        names = [name for name in os.listdir(place) if any(pattern.fullmatch(name) for pattern in known)]
    except OSError:
        return
    for name in names:
        path = os.path.join(place, name)
        try:
            handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        except OSError:
            continue
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.isdir(path):
                shutil.rmtree(path, ignore_errors=True)
            else:
                os.unlink(path)
        except OSError:
            continue  # in use, or another's
        finally:
            os.close(handle)


def new_folder(place: str | os.PathLike, name: str) -> tuple[Path, int]:
    """(a scratch folder for `name` in `place`, the handle that holds its lock), after a sweep. Raises OSError."""
    sweep(place, scratch_name(name))
    return _held_folder(place, f".{name}-")


def _held_folder(place: str | os.PathLike, prefix: str) -> tuple[Path, int]:
    """(a new scratch folder, the handle that holds its lock). Another process's sweep may take it before it is
    locked.
    """
    while True:
        path = tempfile.mkdtemp(prefix=prefix, suffix=SUFFIX, dir=place)
        try:
            handle = os.open(path, os.O_RDONLY)
        except FileNotFoundError:
            continue
        if _hold(path, handle):
            return Path(path), handle
        os.close(handle)


def new_file(place: str | os.PathLike, name: str) -> tuple[str, int]:
    """(a scratch file for `name` in `place`, its handle, locked), after a sweep. Raises OSError."""
    sweep(place, scratch_name(name))
    while True:
        handle, path = tempfile.mkstemp(prefix=f".{name}-", suffix=SUFFIX, dir=place)
        if _hold(path, handle):
            return path, handle
        os.close(handle)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A folder among the system's temporary files, removed at the end, or by the next such call where this process
    dies.
    """
    place = tempfile.gettempdir()
    sweep(place, _TEMPORARY)
    path, handle = _held_folder(place, "rtds-")
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)
        os.close(handle)


# ---- processes -------------------------------------------------------------------------------------------------------


def supervisor() -> tuple[list[str], int]:
    """(what to put before a command, the descriptor to pass on to it), for a process in a session of its own.

    The program then ends when this process is gone, with all that it started in its session. The descriptor is the
    reading end of a pipe that this process keeps open to its end and tells nobody else of.
    """
    global _lifeline
    with _lock:
        if _lifeline is None:
            _lifeline = os.pipe()
        return [sys.executable, "-E", "-S", str(_SUPERVISOR), str(_lifeline[0])], _lifeline[0]


def run_supervised(
    command: Sequence[str], timeout_s: float | None = None, cwd: str | os.PathLike | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a program that ends with this process; its output comes back as text.

    Raises
    ------
    subprocess.TimeoutExpired : it took longer than `timeout_s` and was ended. OSError : no process can be started.
    """
    before, descriptor = supervisor()
    with subprocess.Popen(
        [*before, *map(str, command)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        cwd=cwd,
        pass_fds=(descriptor,),
        start_new_session=True,
    ) as process:
        with _lock:
            _running.add(process)
        try:
            out, err = process.communicate(timeout=timeout_s)
        finally:
            with _lock:
                _running.discard(process)
            end_session(process)
    return subprocess.CompletedProcess(list(command), process.returncode, out, err)


def end_session(process: subprocess.Popen) -> None:
    """End a process that leads a session of its own, with all that is in it, unless it has left."""
    if process.poll() is None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def end_running() -> None:
    """End every program that `run_supervised` waits for in this process, in whatever thread."""
    with _lock:
        for process in _running:
            if process.returncode is None:
                with suppress(ProcessLookupError, PermissionError):
                    os.killpg(process.pid, signal.SIGKILL)
