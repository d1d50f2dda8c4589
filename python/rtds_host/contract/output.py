"""Writing that leaves either a complete output or none."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rtds_host.errors import OutputError


def _reason(error: OSError) -> str:
    return error.strerror or str(error)


@contextmanager
def staged_folder(target: str | os.PathLike, replace: bool = False) -> Iterator[Path]:
    """Yield a scratch folder beside `target`; its files move into `target` only if the block succeeds.

    Parameters
    ----------
    target : folder to fill; made if missing. Files already there that the block did not write are kept,
        unless `replace`.
    replace : drop what was in `target` before.

    Raises
    ------
    OutputError : the place cannot be written (no right, disk full); the scratch folder is removed.
    """
    target = Path(target)
    scratch = None
    try:
        if target.exists() and not target.is_dir():
            raise OutputError(f"{target}: is a file, a folder is needed for the output")
        target.parent.mkdir(parents=True, exist_ok=True)
        scratch = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
        yield scratch
        if replace or not target.exists():
            if target.exists():
                shutil.rmtree(target)
            scratch.chmod(0o755)
            os.replace(scratch, target)
        else:
            for item in sorted(scratch.iterdir()):
                destination = target / item.name
                if item.is_dir() and destination.is_dir():
                    shutil.rmtree(destination)
                os.replace(item, destination)
    except OSError as error:
        raise OutputError(f"{error.filename or target}: cannot write ({_reason(error)})") from error
    finally:
        if scratch is not None:
            shutil.rmtree(scratch, ignore_errors=True)


def write_atomic(path: str | os.PathLike, data: str | bytes) -> None:
    """Write one file so that a reader sees the old content or the new one, never a part.

    Raises
    ------
    OutputError : the place cannot be written (no right, disk full).
    """
    path = Path(path)
    scratch = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, scratch = tempfile.mkstemp(prefix=f".{path.name}-", dir=path.parent)
        with os.fdopen(handle, "wb") as stream:
            stream.write(data.encode() if isinstance(data, str) else data)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(scratch, 0o644)
        os.replace(scratch, path)
        scratch = None
    except OSError as error:
        raise OutputError(f"{path}: cannot write ({_reason(error)})") from error
    finally:
        if scratch is not None and os.path.exists(scratch):
            os.unlink(scratch)
