"""Writing that leaves either a complete output or none."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rtds_host.cleanup import new_file, new_folder
from rtds_host.errors import InputError, OutputError


def _reason(error: OSError) -> str:
    if isinstance(error, (FileExistsError, NotADirectoryError)):
        return "is a file, a folder is needed"
    return f"cannot write ({error.strerror or error})"


def _scratch_place(target: Path) -> Path:
    """Where a scratch folder can be moved from: next to the target, or inside where it is a mount or its parent
    is shut.
    """
    if target.is_dir():
        sibling = os.access(target.parent, os.W_OK | os.X_OK) and target.parent.stat().st_dev == target.stat().st_dev
        return target.parent if sibling else target
    return target.parent


def _keep(folder: Path) -> None:
    """Have all that is below a folder on the disk: else a machine that goes down may leave a name without its
    content.
    """
    for top, _, files in os.walk(folder):
        for path in (top, *(os.path.join(top, name) for name in files)):
            handle = os.open(path, os.O_RDONLY)
            try:
                os.fsync(handle)
            finally:
                os.close(handle)


def check_writable(folder: Path) -> None:
    """Find out before a long run whether its result can be written.

    Raises
    ------
    OutputError : it cannot.
    """
    place = folder.absolute()
    if place.is_symlink() and not place.exists():
        raise OutputError(f"{place}: is a broken link")
    while not place.exists():
        place = place.parent
    if not place.is_dir():
        raise OutputError(f"{place}: is a file, a folder is needed for the output")
    if not os.access(place, os.W_OK | os.X_OK):
        raise OutputError(f"{place}: cannot write (no permission)")


def check_writable_file(path: Path) -> None:
    """The same for a file.

    Raises
    ------
    OutputError : it cannot be written, or is a folder.
    """
    if path.is_dir():
        raise OutputError(f"{path}: is a folder, a file is needed for the output")
    if path.exists():
        if not os.access(path, os.W_OK):
            raise OutputError(f"{path}: cannot write (no permission)")
        return
    check_writable(path.absolute().parent)


def refuse_inputs(outputs: Iterable[Path], inputs: Iterable[Path | None]) -> None:
    """Find out before the work whether the result would take the place of what it is made from.

    Parameters
    ----------
    outputs : files to be written, and folders to be filled. inputs : files and folders to be read; None is passed over.
    None
        of all need exist.

    Raises
    ------
    OutputError : one of the outputs is one of the inputs, whatever names or links lead there.
    """

    def marks(place: Path) -> set:
        # Not `resolve`: a link that leads to itself is an error of its own there.
        found: set = {os.path.realpath(place)}
        with contextlib.suppress(OSError):
            status = os.stat(place)
            found.add((status.st_dev, status.st_ino))
        return found

    read = set().union(*(marks(Path(place)) for place in inputs if place is not None))
    for place in outputs:
        if marks(place) & read:
            kind = "folder" if place.is_dir() else "file"
            raise OutputError(f"{place}: is an input of this very command; choose another {kind}")


@contextmanager
def staged_folder(target: str | os.PathLike, replace: bool = False, owned: Collection[str] = ()) -> Iterator[Path]:
    """Yield a scratch folder; its files move into `target` only if the block succeeds.

    Should the process be killed, the next call for the same target takes the scratch folder away.

    Parameters
    ----------
    target : folder to fill; made if missing. Files already there that the block did not write are kept,
        unless `replace`.
    replace : drop what was in `target` before.
    owned : names of files that go when the block did not write them: an earlier output's, which would pass for this
    one's.

    Raises
    ------
    OutputError : the place cannot be written (no right, disk full); the scratch folder is removed.
    """
    target = Path(target).absolute()
    scratch = lock = None
    try:
        if target.is_symlink() and not target.exists():
            raise OutputError(f"{target}: is a broken link")
        if target.exists() and not target.is_dir():
            raise OutputError(f"{target}: is a file, a folder is needed for the output")
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            scratch, lock = new_folder(_scratch_place(target), target.name)
        except OSError as error:
            # Its own name is one that nobody gave.
            raise OutputError(f"{target}: {_reason(error)}") from error
        yield scratch
        _keep(scratch)
        if replace or not target.exists():
            if target.exists():
                shutil.rmtree(target)
            scratch.chmod(0o755)
            os.replace(scratch, target)
        else:
            items = sorted(scratch.iterdir())
            for item in items:
                if item.is_dir() != (target / item.name).is_dir() and (target / item.name).exists():
                    kind = "file, a folder" if item.is_dir() else "folder, a file"
                    raise OutputError(f"{target / item.name}: is a {kind} is needed for the output")
            for name in set(owned) - {item.name for item in items}:
                (target / name).unlink(missing_ok=True)
            for item in items:
                destination = target / item.name
                if item.is_dir() and destination.is_dir():
                    shutil.rmtree(destination)
                os.replace(item, destination)
    except (OSError, OutputError) as error:
        said = str(error) if isinstance(error, OutputError) else f"{error.filename or target}: {_reason(error)}"
        # The scratch folder is gone when this is read.
        raise OutputError(said.replace(str(scratch), str(target)) if scratch is not None else said) from error
    finally:
        if scratch is not None:
            shutil.rmtree(scratch, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def write_atomic(path: str | os.PathLike, data: str | bytes) -> None:
    """Write one file so that a reader sees the old content or the new one, never a part.

    A link is followed; a device or a pipe (`/dev/stdout`) is written to, not replaced.

    Raises
    ------
    OutputError : the place cannot be written (no right, disk full).
    """
    path = Path(path)
    content = data.encode() if isinstance(data, str) else data
    scratch = stream = None
    try:
        if path.is_dir():
            raise OutputError(f"{path}: is a folder, a file is needed for the output")
        if path.exists() and not path.is_file():
            path.write_bytes(content)
            return
        if path.is_symlink():
            with contextlib.suppress(FileNotFoundError):
                os.stat(path)  # a link that leads to itself
        path = Path(os.path.realpath(path))
        path.parent.mkdir(parents=True, exist_ok=True)
        scratch, handle = new_file(path.parent, path.name)
        # Open until it has its name: with the lock goes what keeps it from a sweep.
        stream = os.fdopen(handle, "wb", buffering=0)
        view = memoryview(content)
        while view:
            view = view[stream.write(view) :]
        os.fsync(handle)
        os.chmod(scratch, 0o644)
        os.replace(scratch, path)
        scratch = None
    except OSError as error:
        raise OutputError(
            f"{error.filename if isinstance(error, (FileExistsError, NotADirectoryError)) else path}: {_reason(error)}"
        ) from error
    finally:
        if scratch is not None and os.path.exists(scratch):
            os.unlink(scratch)
        if stream is not None:
            stream.close()


def write_between(page: Path, text: str, start: str, end: str) -> None:
    """Replace what is between two marks of a page.

    Raises
    ------
    InputError : the page cannot be read or has no such marks. OutputError : it cannot be written.
    """
    try:
        content = page.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{page}: cannot be read ({error.strerror})") from error
    if start not in content or end not in content:
        raise InputError(f"{page}: the marks {start} and {end} are missing")
    head, rest = content.split(start, 1)
    write_atomic(page, f"{head}{start}\n{text}{end}{rest.split(end, 1)[1]}")
