"""The first screens of the report: verdict, causes a line each, size of the gap, what to do next, contents."""

from __future__ import annotations

from html import escape
from typing import Any

from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.report.advice import next_steps
from rtds_host.diagnosis.report.budget_bar import budget_bar
from rtds_host.diagnosis.report.details import Details
from rtds_host.diagnosis.report.html import section, with_code
from rtds_host.diagnosis.report.words import (
    by_share,
    enumerated,
    form_name,
    headline,
    indistinguishable_from,
    key_unit,
    listed_name,
    number,
    parameter_name,
    percent,
    scatter_words,
    sureness,
    unit_of,
)


def parameter(
    effect: dict[str, Any], name: str, value: float | None, details: Details, digits: int = 4
) -> tuple[str, str, str, str]:
    """Key, nominal value, fitted value and unit of an effect's parameter: in the robot's own terms where it is a
    factor of one of its values."""
    known = CATALOGUE.get(effect["id"])
    for p in known.parameters if known else ():
        if p.of and p.name == name and value is not None:
            place, key = p.of.split(".")
            nominal = getattr(getattr(details.case.robot, place), key)
            return key, number(nominal, digits), number(nominal * value, digits), key_unit(key)
        if name in (p.name, *(n for n, _ in (p.declared or {}).values())):
            nominal = "–" if p.shape or p.null not in (0.0, 1.0) else number(p.null)
            unit = unit_of(effect["id"], name) or ("times" if p.null == 1.0 else "")
            return name, nominal, number(value, digits), unit
    return name, "–", number(value, digits), unit_of(effect["id"], name)


def in_words(shown: str, name: str) -> str:
    """A parameter's name for a sentence; `shown` is the key, `name` what the file calls it."""
    return parameter_name(shown, of_robot=shown != name)


def sizes(effect: dict[str, Any], details: Details) -> list[str]:
    """Each parameter of an effect in a phrase: "winding resistance 8.1 Ω in place of 8.6 Ω"."""
    found = []
    for name, p in effect["parameters"].items():
        shown, nominal, fitted, unit = parameter(effect, name, p["value"], details, 3)
        text = f"{fitted} {unit}".strip() + (f" in place of {nominal} {unit}".rstrip() if shown != name else "")
        alone = len(effect["parameters"]) == 1 and shown == name
        found.append(text if alone else f"{in_words(shown, name)} {text}")
    return found


def _cause(diagnosis: dict[str, Any], effect: dict[str, Any], details: Details, share: float | None) -> str:
    """One line: name, size, share, how sure, how constant, what it may be confused with."""
    indistinguishable = indistinguishable_from(diagnosis, effect)
    pieces = [
        ", ".join(sizes(effect, details)),
        f"{percent(share)} of the difference" if share is not None else "",
        "" if indistinguishable else sureness(effect["probability"]),
        scatter_words(effect),
        f"looks the same here: {enumerated([listed_name(equal) for equal in indistinguishable], 'or')}"
        if indistinguishable
        else "",
    ]
    listed = " · ".join(escape(piece) for piece in pieces if piece)
    return f'<li data-id="{escape(effect["id"])}"><b>{escape(listed_name(effect))}</b>: {listed}</li>'


def _named(diagnosis: dict[str, Any], details: Details) -> str:
    shares = {(row["id"], row["side"]): row["share"] for row in diagnosis["budget"] if row["what"] == "effect"}
    lines = [
        _cause(diagnosis, effect, details, shares.get((effect["id"], effect["side"]))) for effect in by_share(diagnosis)
    ]
    formed = {(r["term"], r["side"], r["over"]): r["share"] for r in diagnosis["budget"] if r["what"] == "form"}
    for form in diagnosis.get("forms") or []:
        share = formed.get((form["term"], form["side"], form["over"]))
        pieces = [form["formula"] or "a free curve", f"{percent(share)} of the difference" if share is not None else ""]
        listed = " · ".join(escape(piece) for piece in pieces if piece)
        lines.append(
            f'<li>Unmodelled term, <a href="#forms">free curve</a>: <b>{escape(form_name(form))}</b>: {listed}</li>'
        )
    return f'<ul id="named">{"".join(lines)}</ul>' if lines else ""


def head(diagnosis: dict[str, Any], details: Details) -> str:
    """The first screen: the verdict, what the gap is made of, and how large it is, in words that need no
    statistics."""
    gap, case = diagnosis["gap"], details.case
    held = diagnosis.get("held_out_runs") or []
    judged, by = ("Each half of the run", "the whole run") if len(held) == 1 else ("Each run", "all runs together")
    figures = [
        ("before", number(gap.get("before")), "simulator as it is"),
        ("refit", number(gap.get("refit")), "motor values adjusted within their tolerance"),
    ]
    if diagnosis["effects"]:
        figures += [("after", number(gap.get("after")), "with the named effects")]
    if gap.get("with_forms") is not None:
        figures += [("with_forms", number(gap["with_forms"]), "with effects and free curves")]
    return (
        f'<section id="answer"><h1>{escape(case.name)} · {escape(case.robot.name)} · {len(case.runs)} run'
        f"{'s' if len(case.runs) != 1 else ''}</h1>"
        f'<p id="verdict"><span class="badge {diagnosis["verdict"]}">{diagnosis["verdict"]}</span>'
        f"{escape(headline(diagnosis))}</p>"
        + budget_bar(diagnosis)
        + _named(diagnosis, details)
        + '<h2 class="minor">How far simulator and robot are apart</h2><div class="figures" id="gap">'
        + "".join(f'<div data-name="{k}"><b>{v}</b><span>{escape(t)}</span></div>' for k, v, t in figures)
        + "</div>"
        '<p class="soft small">In units of each sensor\'s own noise: 1 is as close as the sensors can tell. '
        f"{judged} is judged with motor values and sizes worked out without it; the causes were chosen with "
        f"{by}.</p>"
        "</section>"
    )


def do(diagnosis: dict[str, Any], details: Details) -> str:
    """What to do next, for every verdict."""
    steps = "".join(
        f"<li>{escape(title)}"
        + ("<ul>" + "".join(f"<li>{with_code(line)}</li>" for line in below) + "</ul>" if below else "")
        + "</li>"
        for title, below in next_steps(diagnosis, details)
    )
    return section("next-steps", "What to do next", f'<ol id="do">{steps}</ol>')


def contents(titles: list[tuple[str, str]]) -> str:
    """Links to the sections that the page has; titles: id and heading."""
    links = "".join(f'<li><a href="#{name}">{escape(title)}</a></li>' for name, title in titles)
    return f'<nav id="contents" aria-label="contents"><ol>{links}</ol></nav>'
