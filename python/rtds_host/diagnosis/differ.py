"""Two diagnoses side by side: of two days, or of two robots."""

from __future__ import annotations

import os
from html import escape
from pathlib import Path
from typing import Any

from rtds_host.contract.runlog import read_json
from rtds_host.diagnosis.report.html import asset, table
from rtds_host.diagnosis.report.page import skeleton
from rtds_host.diagnosis.report.schema import validate
from rtds_host.diagnosis.report.words import effect_name, form_name, number, parameter_name, percent, unit_of
from rtds_host.errors import InputError

# In words, what became of a cause from the first diagnosis to the second.
CHANGES = {"gone": "only in the first", "new": "only in the second", "moved": "another size", "same": "the same size"}


def read(place: Path) -> dict[str, Any]:
    """A `diagnosis.json`, or the one in a folder.

    Raises
    ------
    InputError : unreadable, or no diagnosis of this program.
    """
    path = place / "diagnosis.json" if place.is_dir() else place
    data = read_json(path)
    try:
        if not isinstance(data, dict):
            raise ValueError("diagnosis.json: top level: an object is needed")
        validate(data)
    except ValueError as error:
        raise InputError(f"{path}: {str(error).removeprefix('diagnosis.json: ')[:300]}") from error
    return data


def _overlap(one: list[float] | None, two: list[float] | None) -> bool | None:
    """Whether two intervals share a value; None where one of them is open."""
    return None if one is None or two is None else max(one[0], two[0]) <= min(one[1], two[1])


def _parameters(first: dict[str, Any], second: dict[str, Any]) -> list[dict[str, Any]]:
    rows = []
    for name in dict.fromkeys([*first, *second]):
        a, b = first.get(name), second.get(name)
        apart = _overlap(a["ci90"], b["ci90"]) is False if a and b else False
        rows.append({"name": name, "first": a, "second": b, "apart": apart})
    return rows


def compare(first: dict[str, Any], second: dict[str, Any]) -> dict[str, Any]:
    """What differs: verdicts, gap, each cause (`change`: gone, new, moved, same), forms.

    A size has moved where the two 90 % intervals of a parameter share no value. What the first cannot tell from a cause
    of the second is named in `alike`: such a change of name is none.
    """

    def included(diagnosis: dict[str, Any]) -> dict[tuple[str, str], dict[str, Any]]:
        return {(e["id"], e["side"]): e for e in diagnosis["effects"]}

    one, two = included(first), included(second)
    sets = [{(m["id"], m["side"]) for m in s} for d in (first, second) for s in d["indistinguishable"]]
    causes = []
    for key in dict.fromkeys([*one, *two]):
        a, b = one.get(key), two.get(key)
        parameters = _parameters((a or {}).get("parameters", {}), (b or {}).get("parameters", {}))
        change = (
            "new" if a is None else "gone" if b is None else "moved" if any(p["apart"] for p in parameters) else "same"
        )
        other = two if b is None else one
        alike = [{"id": m[0], "side": m[1]} for s in sets if key in s for m in sorted(s - {key}) if m in other]
        entry = {"id": key[0], "side": key[1], "change": change, "parameters": parameters}
        causes.append({**entry, "alike": alike if change in ("new", "gone") else []})
    gap = {name: [d["gap"].get(name) for d in (first, second)] for name in ("before", "refit", "after", "with_forms")}
    forms = [[form_name(form) for form in d.get("forms") or []] for d in (first, second)]
    return {"verdict": [first["verdict"], second["verdict"]], "gap": gap, "causes": causes, "forms": forms}


def _size(cause: dict[str, Any], p: dict[str, Any], which: str) -> str:
    entry = p[which]
    if entry is None:
        return "–"
    unit = unit_of(cause["id"], p["name"])
    text = f"{number(entry['value'], 4)} {unit}".strip()
    ends = entry["ci90"]
    return text + (f" ({number(ends[0], 4)} to {number(ends[1], 4)})" if ends else " (not determined)")


def _said(cause: dict[str, Any]) -> str:
    text = CHANGES[cause["change"]]
    if cause["alike"]:
        text += ", where the other names what looks the same: " + ", ".join(effect_name(m) for m in cause["alike"])
    return text


def lines(found: dict[str, Any], names: tuple[str, str]) -> list[str]:
    """The comparison for a terminal."""
    gap = found["gap"]
    said = [
        f"first   {names[0]}: {found['verdict'][0]}, gap {number(gap['before'][0])} nominal, "
        f"{number(gap['after'][0])} left",
        f"second  {names[1]}: {found['verdict'][1]}, gap {number(gap['before'][1])} nominal, "
        f"{number(gap['after'][1])} left",
    ]
    for cause in found["causes"]:
        said.append(f"{effect_name(cause)}: {_said(cause)}")
        for p in cause["parameters"]:
            mark = "  intervals apart" if p["apart"] else ""
            said.append(
                f"    {parameter_name(p['name'])}: {_size(cause, p, 'first')} -> {_size(cause, p, 'second')}{mark}"
            )
    if not found["causes"]:
        said.append("neither names a cause")
    for which, forms in zip(("first", "second"), found["forms"], strict=True):
        said += [f"an unmodelled term in the {which}: {form}" for form in forms]
    return said


def page(found: dict[str, Any], names: tuple[str, str]) -> str:
    """The comparison as a page that needs nothing but itself."""
    head = [("cause", False), ("change", False), ("parameter", False), ("first", True), ("second", True)]
    rows = [
        [
            escape(effect_name(cause)) if k == 0 else "",
            escape(_said(cause)) if k == 0 else "",
            escape(parameter_name(p["name"])) + (" <b>(intervals apart)</b>" if p["apart"] else ""),
            escape(_size(cause, p, "first")),
            escape(_size(cause, p, "second")),
        ]
        for cause in found["causes"]
        for k, p in enumerate(cause["parameters"])
    ]
    words = {
        "before": "nominal",
        "refit": "refitted",
        "after": "with effects",
        "with_forms": "with effects and free curves",
    }
    gaps = [
        [word, *(number(v) for v in found["gap"][key])]
        for key, word in words.items()
        if any(v is not None for v in found["gap"][key])
    ]
    badges = "".join(
        f'<p><span class="badge {verdict}">{verdict}</span>{escape(name)}</p>'
        for verdict, name in zip(found["verdict"], names, strict=True)
    )
    body = (
        f"<main><section><h1>Two diagnoses</h1>{badges}</section><section><h2>Causes</h2>"
        + (table(head, rows, None, "causes") if rows else "<p>Neither names a cause.</p>")
        + "</section><section><h2>Gap, in units of the sensors' noise</h2>"
        + table([("", False), ("first", True), ("second", True)], gaps, None, "gaps").replace(
            '<th scope="col"></th>', "<td></td>"
        )
        + f'</section><p class="soft small">{percent(0.9)} intervals in brackets.</p></main>'
    )
    return skeleton("Two diagnoses", asset("style.css"), body)


def label(place: Path) -> str:
    """What a diagnosis is called: the folder it lies in."""
    path = Path(os.path.realpath(place))
    return path.name if path.is_dir() else f"{path.parent.name}/{path.name}"
