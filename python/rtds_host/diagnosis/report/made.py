"""When, by which program and by which command a report was made: what belongs to a file and not to a diagnosis."""

from __future__ import annotations

import os
import shlex
import sys
import time
from html import escape
from pathlib import Path

from rtds_host import __version__
from rtds_host.diagnosis.report.html import placed
from rtds_host.errors import visible


def date() -> str:
    """Today in UTC, or the day of SOURCE_DATE_EPOCH where that is set: builds that must not differ set it
    (reproducible-builds.org/specs/source-date-epoch)."""
    given = os.environ.get("SOURCE_DATE_EPOCH", "")
    return time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime(int(given) if given.isdigit() else time.time()))


def command_of(case: Path | None, out: Path, quick: bool) -> str:
    """The command that makes this very diagnosis again, its paths absolute; of a case that is no folder (made in
    Python) how that was called."""
    if case is None:
        return "rtds_host.diagnose(case, out=…)"
    words = ["rtds", "diagnose", os.path.realpath(case), "--out", os.path.realpath(out)]
    return visible(shlex.join(words + (["--quick"] if quick else [])))


def written(page: str, case: Path | None, out: Path, quick: bool) -> str:
    """A report as it is written into `out`: real paths in its commands, and who made it, when and how."""
    places = {"diagnosis.json": out / "diagnosis.json"}
    if case is not None:
        places |= {"robot.toml": case / "robot.toml", "CASE": case}
    words = {name: visible(shlex.quote(os.path.realpath(path))) for name, path in places.items()}
    made = (
        f'<footer id="made" class="soft small"><p>Made by rtds {escape(__version__)} '
        f"(Python {sys.version_info[0]}.{sys.version_info[1]}) on {date()} with</p>"
        f'<pre tabindex="0">{escape(command_of(case, out, quick))}</pre></footer>'
    )
    return placed(page, words, made)
