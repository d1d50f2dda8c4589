"""What `rtds view` and `rtds run --live` share: reading runs, serving the page, waiting for Ctrl-C."""

from __future__ import annotations

import os
import threading
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rtds_host.contract import Robot, load_robot, read_run
from rtds_host.diagnosis.predict import read_diagnosis
from rtds_host.errors import InputError
from rtds_host.view.lines import Lines, lines_of_run
from rtds_host.view.live import Feed
from rtds_host.view.server import Viewer

# More side by side than a page can show.
MOST_RUNS = 24


def _folders(places: list[Path]) -> list[Path]:
    """Run folders of runs and cases, in the order given, a case's by name."""
    found: list[Path] = []
    for place in places:
        if (place / "run.json").is_file() or not (place / "robot.toml").is_file():
            found.append(place)
        else:
            inside = sorted(path.parent for path in place.glob("*/run.json"))
            if not inside:
                raise InputError(f"{place}: holds no run")
            found += inside
    if len(found) > MOST_RUNS:
        raise InputError(f"{len(found)} runs; at most {MOST_RUNS} can be shown at once")
    return found


def _robot_of(run: Path, given: Path | None) -> Robot | None:
    if given is not None:
        return load_robot(given)
    # Not `run.parent`: of "." that is "." again.
    near = (run / "robot.toml", Path(os.path.realpath(run)).parent / "robot.toml")
    return next((load_robot(path) for path in near if path.is_file()), None)


def recorded(places: list[Path], robot: Path | None, diagnosis: Path | None) -> list[Lines]:
    """Runs of folders with their replays.

    Raises
    ------
    InputError : a run, robot or diagnosis that cannot be read; a run or diagnosis that needs a robot where none is.
    """
    found = []
    for folder in _folders(places):
        nominal = _robot_of(folder, robot)
        if nominal is None:
            raise InputError(f"{folder}: neither there nor above it is a robot.toml; name one by --robot")
        corrected = read_diagnosis(diagnosis, nominal) if diagnosis is not None else None
        found.append(lines_of_run(read_run(folder, nominal), nominal, corrected))
    return found


def _print_address(address: str) -> None:
    print(f"{address}  (Ctrl-C ends it)", flush=True)


@contextmanager
def serve(
    feed: Feed, port: int = 0, browser: bool = True, say: Callable[[str], None] | None = None
) -> Iterator[Callable[[], None]]:
    """Serve the page and say where; gives a function that waits until Ctrl-C, which ends it in order.

    say : takes the address; by default it is printed.
    """
    with Viewer(feed, port) as viewer:
        (say or _print_address)(viewer.address)
        if browser:
            # Nobody's fault where there is no browser: the address is printed above.
            with suppress(webbrowser.Error):
                webbrowser.open(viewer.address)

        def wait() -> None:
            with suppress(KeyboardInterrupt):
                threading.Event().wait()

        yield wait
