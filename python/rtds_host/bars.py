"""Progress on standard error, where that is a terminal: what is done, how much is left, and about how long it takes.

A bar is moved by work, not by guesses: a diagnosis by the work of its search (`rtds_host.diagnosis.effort`), many cases
by cases, a drive by simulated time. The time left is what the work left takes at the pace so far; of a search it is the
most that it can be, since a search may end early.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeElapsedColumn
from rich.text import Text

# Stage -> what a person reads.
WORDS = {
    "reading": "reading",
    "gate": "checking the logs",
    "replay": "first replay",
    "candidates": "searching",
    "attribution": "weighing effects",
    "gap": "runs left out",
    "forms": "free curves",
    "report": "writing",
    "done": "writing",
}
# Numerical: share of the whole and seconds before which a pace says nothing.
LEAST_SHARE, LEAST_S = 0.02, 2.0


def watched(quiet: bool = False) -> bool:
    """Whether there is somebody to show progress to."""
    return not quiet and sys.stderr.isatty()


def time_left(share: float, began_share: float, passed_s: float) -> float | None:
    """Seconds that the rest of the work takes at the pace so far; None where there is no pace yet."""
    done = share - began_share
    if done < LEAST_SHARE or passed_s < LEAST_S:
        return None
    return passed_s * (1.0 - share) / done


class TimeLeft(ProgressColumn):
    """The most that is left, from the time at which the work that is counted began."""

    def __init__(self) -> None:
        super().__init__()
        self._began: dict[int, tuple[float, float]] = {}

    def render(self, task: Task) -> Text:
        """`at most 1:20 left`, nothing before there is a pace."""
        share = task.completed / task.total if task.total else 0.0
        began = self._began.setdefault(task.id, (share, time.monotonic()))
        left = time_left(share, began[0], time.monotonic() - began[1])
        if left is None:
            return Text("")
        return Text(f"at most {int(left) // 60}:{int(left) % 60:02d} left")


@contextmanager
def stages(quiet: bool = False) -> Iterator[Callable[[str, float], None]]:
    """A bar of one diagnosis, moved by (stage, share of the whole); words of other stages are shown as they are."""
    columns = (
        TextColumn("{task.description:<17}", markup=False),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeLeft(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True, disable=not watched(quiet)) as bar:
        task = bar.add_task(WORDS["reading"], total=1.0)

        def report(stage: str, share: float) -> None:
            before, colon, last = stage.rpartition(": ")
            bar.update(task, description=f"{before}{colon}{WORDS.get(last, last)}", completed=share)

        yield report
