"""Pieces of HTML that the sections of the report share: tables, bars, text with commands, data inside of scripts."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable
from html import escape
from importlib import resources
from typing import Any

# Layout: width of a bar in a table's cell, pixels.
BAR = 120


def asset(name: str) -> str:
    """A file of this package as text."""
    return resources.files("rtds_host.diagnosis.report").joinpath(name).read_text(encoding="utf-8")


def embedded(name: str, data: Any) -> str:
    """Data for a script, in an element of its own: no `<` in it, so that nothing ends the element or opens a
    comment."""
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{text}</script>'


def section(name: str, title: str, body: str) -> str:
    """A section with its heading; `name` is what the contents link to."""
    return f'<section id="{name}" aria-labelledby="h-{name}"><h2 id="h-{name}">{escape(title)}</h2>{body}</section>'


def table(
    head: Iterable[tuple[str, bool]], rows: Iterable[Iterable[str]], attributes: list[str] | None = None, name: str = ""
) -> str:
    """A table; each cell carries its column's title, which a narrow page shows in place of the head.

    head : title and whether the column holds numbers. rows : cells as HTML. attributes : of each row.
    """
    head = list(head)
    lines = [
        f"<table{f' id={chr(34)}{name}{chr(34)}' if name else ''}><thead><tr>"
        + "".join(f'<th scope="col"{" class=n" if n else ""}>{escape(h)}</th>' for h, n in head)
        + "</tr></thead><tbody>"
    ]
    for k, row in enumerate(rows):
        extra = " " + attributes[k] if attributes and attributes[k] else ""
        lines.append(
            f"<tr{extra}>"
            + "".join(
                f'<td{" class=n" if n else ""} data-h="{escape(h)}">{cell}</td>'
                for cell, (h, n) in zip(row, head, strict=True)
            )
            + "</tr>"
        )
    return "\n".join(lines) + "</tbody></table>"


def bar(value: float | None, top: float, kind: str = "", width: int = BAR) -> str:
    """A bar as long as `value` in shares of `top`, "" where there is nothing to show."""
    if value is None or not math.isfinite(value) or top <= 0:
        return ""
    return f'<span class="bar {kind}" style="width:{max(1, round(width * min(value / top, 1.0)))}px"></span>'


def with_code(text: str) -> str:
    """A text whose commands stand between backquotes, as HTML; the files in a command are marked, see `placed`."""

    def command(found: re.Match) -> str:
        inside = re.sub(
            r"(?<!\S)(diagnosis\.json|robot\.toml|CASE)(?!\S)",
            lambda name: f'<span data-file="{name[1]}">{name[1]}</span>',
            found[1],
        )
        return f"<code>{inside}</code>"

    return re.sub(r"`([^`]+)`", command, escape(text))


def placed(page: str, places: dict[str, str], made: str = "") -> str:
    """The page with real paths in its commands.

    places : name of a file as commands have it (`diagnosis.json`, `robot.toml`, `CASE`) -> the word for a shell.
    made : what is said of how the page was made, as HTML; it takes the place that `report_page` left for it.
    """
    for name, word in places.items():
        page = page.replace(
            f'<span data-file="{name}">{name}</span>', f'<span data-file="{name}">{escape(word)}</span>'
        )
    return page.replace(MADE, made, 1)


def unplaced(page: str) -> str:
    """The page as `report_page` gave it, without what `placed` put into it: what two reports of one diagnosis share."""
    page = re.sub(r'<span data-file="([^"]*)">[^<]*</span>', r'<span data-file="\1">\1</span>', page)
    return re.sub(r'<footer id="made".*?</footer>', MADE, page, count=1, flags=re.DOTALL)


# Where a page that is written says when, by what and by which command it was made.
MADE = "<!--made-->"
