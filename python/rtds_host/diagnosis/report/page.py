"""`report.html`: one self-contained page, no network, the same text for the same input; see `made` for what a file
that is written says of when and how."""

from __future__ import annotations

import re
from html import escape, unescape
from typing import Any

from rtds_host.diagnosis.report.causes import what
from rtds_host.diagnosis.report.data import condition
from rtds_host.diagnosis.report.details import Details
from rtds_host.diagnosis.report.drift import drift
from rtds_host.diagnosis.report.first import contents, do, head
from rtds_host.diagnosis.report.forms import shapes
from rtds_host.diagnosis.report.gaps import gaps, open_questions
from rtds_host.diagnosis.report.html import MADE, asset, embedded
from rtds_host.diagnosis.report.places import where
from rtds_host.diagnosis.report.traces import plots

# The page may load nothing: what it shows is all inside it.
POLICY = (
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; img-src data:\">"
)
_HEADING = re.compile(r'<section id="([\w-]+)" aria-labelledby="[^"]*"><h2[^>]*>(.*?)</h2>')


def skeleton(title: str, style: str, body: str) -> str:
    """A page that needs nothing but itself. title : as text; style : CSS; body : HTML."""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><meta name="color-scheme" '
        'content="light dark">'
        f'{POLICY}<link rel="icon" href="data:,">'
        f"<title>{escape(title)}</title><style>{style}</style></head><body>{body}</body></html>\n"
    )


def report_page(diagnosis: dict[str, Any], details: Details) -> str:
    """The whole report, `report.html`, as a string."""
    first = head(diagnosis, details)
    others = [
        do(diagnosis, details),
        where(diagnosis, details),
        what(diagnosis, details),
        shapes(diagnosis, details),
        drift(details),
        plots(diagnosis, details),
        gaps(diagnosis, details),
        open_questions(diagnosis, details),
        condition(details),
    ]
    titles = [(m[1], unescape(m[2])) for text in others if (m := _HEADING.match(text))]
    body = (
        f"<main>{first}{contents(titles)}{''.join(others)}{MADE}</main>"
        f"{embedded('diagnosis', diagnosis)}<script>{asset('plots.js')}</script>"
    )
    return skeleton(f"{details.case.name}: {diagnosis['verdict']}", asset("style.css"), body)
