"""`report.html`: one self-contained page, no network, the same bytes for the same input."""

from __future__ import annotations

import itertools
import json
import math
import re
from collections.abc import Iterable
from html import escape
from importlib import resources
from typing import Any

import numpy as np

from rtds_host.contract.clock import moment
from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.report.advice import exportable, next_steps
from rtds_host.diagnosis.report.budget_bar import budget_bar
from rtds_host.diagnosis.report.chain import chain
from rtds_host.diagnosis.report.details import Details, Trace
from rtds_host.diagnosis.report.words import (
    SUBSYSTEM_WORDS,
    by_share,
    channel_name,
    effect_name,
    enumerated,
    explanation_name,
    headline,
    key_unit,
    listed_name,
    manoeuvre,
    number,
    percent,
    sureness,
    twins_of,
    unit_of,
    value_words,
)

# Layout: points a line keeps: two a bucket, so that peaks survive.
BUCKETS = 450
MODELS = (("before", "nominal"), ("refit", "refitted"), ("after", "with effects"))
# Layout: more than a screen shows of a line.
DIGITS = 6
# Layout: decimals of a time, s: finer than any log's rows.
TIME_DECIMALS = 6
UNITS = {"v_bus": "V", "i": "A", "w": "rad/s", "th": "rad", "gyro_z": "rad/s", "x": "m", "y": "m", "yaw": "rad"}

SETUP_WORDS = {
    "latency_s": ("what is read of a speed command comes later by", 1e3, "ms"),
    "anti_windup": ("share of what its limit cuts by which the servo's integral gives way", 1.0, ""),
    "gyro_late_s": ("the gyro's clock is behind the wheels' by", 1e3, "ms"),
    "pose_late_s": ("the pose's clock is behind the wheels' by", 1e3, "ms"),
}


def _asset(name: str) -> str:
    return resources.files("rtds_host.diagnosis.report").joinpath(name).read_text(encoding="utf-8")


def _json(data: Any) -> str:
    """JSON that may stand inside a script element: no `<` in it, so that nothing ends the element or opens a
    comment.
    """
    return json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _decimated(trace: Trace, unit: str, noise: float | None, blamed: bool) -> dict[str, Any]:
    """A trace with at most two samples a bucket: where the measured signal is smallest and largest."""
    good = np.flatnonzero(np.isfinite(trace.measured))
    if len(good) == 0:
        good = np.arange(len(trace.t))
    if len(good) > 2 * BUCKETS:
        edges = np.linspace(0, len(good), BUCKETS + 1).astype(int)
        keep = []
        for a, b in itertools.pairwise(edges):
            rows = good[a:b]
            values = trace.measured[rows]
            keep += [rows[values.argmin()], rows[values.argmax()]]
        good = np.unique(keep)

    def plain(values: np.ndarray) -> list[float | None]:
        # To so many digits of the line's largest: what a plot can show, also zoomed in.
        kept = values[good]
        finite = np.isfinite(kept)
        largest = np.abs(kept[finite]).max(initial=1e-300)
        rounded = np.round(kept, DIGITS - 1 - math.floor(math.log10(largest)) if largest > 1e-300 else 0)
        return [v if ok else None for v, ok in zip(rounded.tolist(), finite.tolist())]

    # From the run's start: a log's clock may be a Unix time, of which so many digits would be one and the same.
    times = np.round(trace.t[good] - trace.t[0], TIME_DECIMALS).tolist()
    result: dict[str, Any] = {"unit": unit, "noise": noise, "t": times, "measured": plain(trace.measured)}
    for name in ("nominal", "refit", "after") if blamed else ("nominal", "refit"):
        line = getattr(trace, name)
        if line is not None:
            result[name] = plain(np.asarray(line))
    return result


def _table(
    head: Iterable[tuple[str, bool]], rows: Iterable[Iterable[str]], attributes: list[str] | None = None, name: str = ""
) -> str:
    """A table; each cell carries its column's title, which a narrow page shows in place of the head."""
    head = list(head)
    lines = [
        f"<table{f' id={chr(34)}{name}{chr(34)}' if name else ''}><thead><tr>"
        + "".join(f"<th{' class=n' if n else ''}>{escape(h)}</th>" for h, n in head)
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


def _bar(value: float | None, top: float, kind: str = "", width: int = 120) -> str:
    if value is None or not math.isfinite(value) or top <= 0:
        return ""
    return f'<span class="bar {kind}" style="width:{max(1, round(width * min(value / top, 1.0)))}px"></span>'


def _gap_bars(entry: dict[str, float | None], top: float, models: Iterable[tuple[str, str]]) -> str:
    scale = math.log10(max(top, 1.1)) + 0.3

    def size(v: float | None) -> float | None:
        return None if v is None else max(math.log10(max(v, 0.5)) + 0.3, 0.02)

    return "<br>".join(_bar(size(entry.get(k)), scale, k, 160) for k, _ in models)


def _gap_table(first: str, gaps: dict[str, dict[str, float | None]], name: str, blamed: bool) -> str:
    if not gaps:
        return ""
    models = MODELS if blamed else MODELS[:2]
    values = [entry.get(k) for entry in gaps.values() for k, _ in models]
    top = max((v for v in values if v is not None and math.isfinite(v)), default=1.0)
    rows = [
        [escape(label), *(number(e.get(k)) for k, _ in models), _gap_bars(e, top, models)] for label, e in gaps.items()
    ]
    return _table(
        [(first, False), *((title, True) for _, title in models), ("(logarithmic)", False)],
        rows,
        [f'data-name="{escape(k)}"' for k in gaps],
        name,
    )


def _head(diagnosis: dict[str, Any], details: Details) -> str:
    """The first screen: the verdict, what the gap is made of, and how large it is, in words that need no statistics."""
    gap, case, effects = diagnosis["gap"], details.case, diagnosis["effects"]
    held = diagnosis.get("held_out_runs") or []
    judged, by = ("Each half of the run", "the whole run") if len(held) == 1 else ("Each run", "all runs together")
    figures = [
        ("before", number(gap.get("before")), "simulator as it is"),
        ("refit", number(gap.get("refit")), "motor values adjusted within their tolerance"),
    ]
    if effects:
        figures += [("after", number(gap.get("after")), "with the named effects")]
    named = "".join(
        f"<li><b>{escape(listed_name(e))}</b>: {escape('; '.join(_sizes(e, details)))}. "
        f"{escape(_sure(diagnosis, e))}.</li>"
        for e in by_share(diagnosis)
    )
    return (
        f"<section><h1>{escape(case.name)} · {escape(case.robot.name)} · {len(case.runs)} run"
        f"{'s' if len(case.runs) != 1 else ''}</h1>"
        f'<p id="verdict"><span class="badge {diagnosis["verdict"]}">{diagnosis["verdict"]}</span>'
        f"{escape(headline(diagnosis))}</p>"
        + budget_bar(diagnosis)
        + (f'<ul id="named">{named}</ul>' if named else "")
        + '<h3>How far simulator and robot are apart</h3><div class="figures" id="gap">'
        + "".join(f'<div data-name="{k}"><b>{v}</b><span>{escape(t)}</span></div>' for k, v, t in figures)
        + '</div><p class="soft small">In units of each sensor\'s own noise: 1 is as close as the sensors can tell.'
        f" {judged} is judged with motor values and sizes worked out without it; which causes are named rests on"
        f" {by}.</p></section>"
    )


def _sizes(effect: dict[str, Any], details: Details) -> list[str]:
    """Each parameter of an effect in a phrase: "8.1 Ω in place of 8.6 Ω (resistance_ohm)"."""
    found = []
    for name, p in effect["parameters"].items():
        shown, nominal, fitted, unit = _parameter(effect, name, p["value"], details, 3)
        text = f"{fitted} {unit}".strip() + (f" in place of {nominal} {unit}".rstrip() if shown != name else "")
        found.append(text + (f" ({shown})" if shown != name or len(effect["parameters"]) > 1 else ""))
    return found


def _sure(diagnosis: dict[str, Any], effect: dict[str, Any]) -> str:
    """How sure one may be of an effect; of one with twins, what else it may be."""
    if twins := twins_of(diagnosis, effect):
        return f"Or {enumerated([listed_name(twin) for twin in twins], 'or')}"
    return sureness(effect["probability"]).capitalize()


def _with_code(text: str) -> str:
    """A text whose commands stand between backquotes, as HTML."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text))


def _do(diagnosis: dict[str, Any], details: Details) -> str:
    steps = "".join(
        f"<li>{escape(title)}"
        + ("<ul>" + "".join(f"<li>{_with_code(line)}</li>" for line in below) + "</ul>" if below else "")
        + "</li>"
        for title, below in next_steps(diagnosis, details)
    )
    return f'<section><h2>What to do next</h2><ol id="do">{steps}</ol></section>'


def _parameter(
    effect: dict[str, Any], name: str, value: float | None, details: Details, digits: int = 4
) -> tuple[str, str, str, str]:
    """Name, nominal value, fitted value and unit of an effect's parameter: in the robot's own terms where it is a
    factor of one of its values."""
    known = CATALOGUE.get(effect["id"])
    for p in known.parameters if known else ():
        if p.of and p.name == name and value is not None:
            table, key = p.of.split(".")
            nominal = getattr(getattr(details.case.robot, table), key)
            return key, number(nominal, digits), number(nominal * value, digits), key_unit(key)
        if name in (p.name, *(n for n, _ in (p.declared or {}).values())):
            nominal = "–" if p.shape or p.null not in (0.0, 1.0) else number(p.null)
            return (
                name,
                nominal,
                number(value, digits),
                unit_of(effect["id"], name) or ("times" if p.null == 1.0 else ""),
            )
    return name, "–", number(value, digits), unit_of(effect["id"], name)


def _where(diagnosis: dict[str, Any], details: Details) -> str:
    located = diagnosis["located"]
    parts = ["<section><h2>Where the gap lies</h2>", chain(located)]
    local = details.localisation
    if not located:
        parts.append('<p class="soft">No part of the chain stands out.</p>')
    if local is not None and local.blocks:
        corrected = details.localisation_after if diagnosis["effects"] else None
        after = {b.name: b.score for b in corrected.blocks} if corrected else {}
        # What is beyond a perfect robot's score, on a scale on which a good one has hardly a bar.
        top = max(2.0, *(b.score - 1.0 for b in local.blocks))
        rows = []
        for b in local.blocks:
            regimes = sorted(b.regimes.items(), key=lambda p: -p[1])
            worst = ", ".join(f"{escape(r)} {number(v)}" for r, v in regimes[:3]) if b.score > 1.3 else ""
            rows.append(
                [
                    escape(b.title),
                    escape(SUBSYSTEM_WORDS[b.subsystem]),
                    _bar(max(b.score - 1.0, 0.0), top) + f'<span class="value">{number(b.score)}</span>',
                    *([number(after.get(b.name))] if after else []),
                    worst,
                ]
            )
        parts.append(
            "<h3>Each block on its own, driven by measured signals (units of noise; a perfect robot scores 1)</h3>"
        )
        parts.append(
            _table(
                [
                    ("block", False),
                    ("speaks of", False),
                    ("score", True),
                    *([("with effects", True)] if after else []),
                    ("worst where", False),
                ],
                rows,
                [f'data-block="{b.name}"' for b in local.blocks],
                "blocks",
            )
        )
        if local.lost:
            parts.append('<p class="small soft" id="lost">' + escape("; ".join(local.lost)).capitalize() + ".</p>")
    rest = diagnosis["gap"].get("rest") or {}
    if rest.get("share") is not None and diagnosis["verdict"] != "none":
        text = (
            "The gap is"
            if not diagnosis["effects"]
            else (f"The blamed effects leave {percent(rest['share'])} of the refitted robot's gap beyond 1")
        )
        text += (
            (", with structure" if rest.get("structured") else ", without structure")
            if diagnosis["effects"]
            else (" structured" if rest.get("structured") else " without structure")
        )
        if rest.get("structured") and rest.get("subsystem"):
            text += f", mostly in the {SUBSYSTEM_WORDS.get(rest['subsystem'], rest['subsystem'])}"
        parts.append(f'<p id="rest">{escape(text)}.</p>')
    return "".join(parts) + "</section>"


def _what(diagnosis: dict[str, Any], details: Details) -> str:
    parts = ["<section><h2>What causes it</h2>"]
    if diagnosis["effects"]:
        rows, attributes = [], []
        for effect in diagnosis["effects"]:
            decided = details.decided.get((effect["id"], effect["side"]))
            for k, (name, p) in enumerate(effect["parameters"].items()):
                shown, nominal, fitted, unit = _parameter(effect, name, p["value"], details)
                interval = p.get("ci90")
                pinned = (
                    "not pinned by these runs"
                    if interval is None
                    else " to ".join(_parameter(effect, name, v, details)[2] for v in interval)
                )
                sure = percent(effect["probability"]) + (", beside its twins" if twins_of(diagnosis, effect) else "")
                rows.append(
                    [
                        escape(effect_name(effect)) if k == 0 else "",
                        sure if k == 0 else "",
                        escape(shown) + _meaning(effect, name),
                        nominal,
                        fitted,
                        escape(unit),
                        pinned,
                        number(effect["gap_without"]) if k == 0 else "",
                        escape(
                            f"{channel_name(decided[0])}: {number(decided[1])} without it, {number(decided[2])} with it"
                        )
                        if decided and k == 0
                        else "",
                    ]
                )
                attributes.append(
                    f'class="effect" data-id="{effect["id"]}" data-side="{effect["side"]}" '
                    f'data-parameter="{escape(name)}"'
                )
        parts.append(
            _table(
                [
                    ("effect", False),
                    ("probability", True),
                    ("parameter", False),
                    ("nominal", True),
                    ("fitted", True),
                    ("unit", False),
                    ("90 % interval", True),
                    ("gap without it", True),
                    ("channel that decided", False),
                ],
                rows,
                attributes,
                "effects",
            )
        )
        for effect in diagnosis["effects"]:
            known = CATALOGUE.get(effect["id"])
            if known:
                parts.append(f'<p class="small soft">{escape(effect_name(effect))}: {escape(known.equation)}</p>')
    else:
        parts.append('<p class="soft">No effect is blamed.</p>')

    parts.append("<h3>Explanations, best first</h3>")
    reasons = {_key(c.effects): c for c in details.candidates}
    blamed = _key(diagnosis["effects"])
    rows, attributes, seen = [], [], set()
    for alternative in diagnosis["alternatives"]:
        key = _key(alternative["effects"])
        seen.add(key)
        c = reasons.get(key)
        rows.append(_explanation(alternative["effects"], alternative["probability"], c))
        attributes.append(
            f'data-probability="{alternative["probability"]:.6g}"'
            + (' class="blamed"' if key == blamed and diagnosis["verdict"] != "unknown" else "")
        )
    head = [("explanation", False), ("probability", True), ("explains, noise²", True), ("why", False)]
    parts.append(_table(head, rows, attributes, "alternatives"))
    others = [c for c in details.candidates if _key(c.effects) not in seen]
    if others:
        parts.append(f"<details><summary>{len(others)} more that were tried</summary>")
        parts.append(_table(head, [_explanation(c.effects, c.probability, c) for c in others], None, "rejected"))
        parts.append("</details>")
    moved = {s: v for s, v in (diagnosis.get("nominal_fit") or {}).items() if v}
    if moved:
        parts.append("<h3>Motor values refitted within their tolerance (no cause)</h3>")
        rows = [
            [
                {"l": "left", "r": "right"}.get(s, s),
                escape(name),
                number(_nominal(details, name), 5),
                number(value, 5),
                escape(key_unit(name)),
            ]
            for s, values in sorted(moved.items())
            for name, value in values.items()
        ]
        parts.append(
            _table(
                [("side", False), ("value", False), ("nominal", True), ("refitted", True), ("unit", False)],
                rows,
                None,
                "nominal_fit",
            )
        )
    if setup := diagnosis.get("setup"):
        parts.append("<h3>Clocks and servo (no cause)</h3>")
        rows = [
            [escape(text), number(one * value, 3), unit]
            for (text, one, unit), value in ((SETUP_WORDS[name], value) for name, value in setup.items())
        ]
        parts.append(_table([("what", False), ("refitted", True), ("unit", False)], rows, None, "setup"))
    return "".join(parts) + "</section>"


def _meaning(effect: dict[str, Any], name: str) -> str:
    known = CATALOGUE.get(effect["id"])
    text = next((p.meaning for p in known.parameters if p.name == name), "") if known else ""
    return f'<br><span class="small soft">{escape(text)}</span>' if text else ""


def _nominal(details: Details, key: str) -> float | None:
    robot = details.case.robot
    return next((getattr(table, key) for table in (robot.motor, robot.servo) if hasattr(table, key)), None)


def _key(effects: list[dict[str, Any]] | str) -> Any:
    return effects if isinstance(effects, str) else tuple(sorted((e["id"], e["side"]) for e in effects))


def _explanation(effects: list[dict[str, Any]] | str, probability: float | None, candidate: Any) -> list[str]:
    fitted = ""
    if candidate is not None and candidate.parameters:
        fitted = (
            '<br><span class="small soft">'
            + escape(
                "; ".join(
                    f"{name} = {value_words(e['id'], name, entry)}"
                    for e, values in zip(candidate.effects, candidate.parameters, strict=False)
                    for name, entry in values.items()
                )
            )
            + "</span>"
        )
    share = percent(probability) if probability is not None else "–"
    return [
        escape(explanation_name(effects)) + fitted,
        _bar(probability, 1.0, "", 60) + f'<span class="value">{share}</span>',
        number(candidate.improvement) if candidate else "–",
        escape(candidate.reason) if candidate else "",
    ]


def _plots(diagnosis: dict[str, Any], details: Details) -> str:
    blamed, noise = bool(diagnosis["effects"]), details.case.robot.noise
    data = {
        run: {
            channel: _decimated(trace, UNITS.get(channel, UNITS.get(channel[:-2], "")), noise(channel), blamed)
            for channel, trace in channels.items()
        }
        for run, channels in details.traces.items()
        if channels
    }
    if not data:
        return ""
    return (
        '<section><h2>Measured against replay</h2><div class="controls"><label>run <select'
        ' id="run"></select></label><span id="keys"></span><button id="reset" type="button">whole run</button><span'
        ' class="soft small">wheel zooms, dragging moves, double click shows all</span></div><p class="soft'
        ' small">Beside each channel what the replay misses of it, measured minus replay; the band is what the'
        " sensor's noise alone hardly ever leaves (3 sigma). Times count from the run's start; where that lies on"
        ' the log\'s own clock stands with the runs at the end.</p><div id="plots"></div><script'
        f' type="application/json" id="traces">{_json(data)}</script></section>'
    )


def _gaps(diagnosis: dict[str, Any], details: Details) -> str:
    gap, blamed = diagnosis["gap"], bool(diagnosis["effects"])
    parts = [
        "<section><h2>The gap by channel, regime and run</h2>",
        (
            '<p class="small soft">Root mean square of replay minus measured in units of noise, of each run by the fit'
            " without it (one step from the fit to all; of a single run each half). Which effects that holds was"
            " decided by all runs.</p>"
        ),
        _gap_table("channel", gap.get("channels") or {}, "channels", blamed),
    ]
    if blamed and gap.get("closed") is not None:
        interval = gap.get("closed_ci90")
        another = (
            f"; of another run of this robot {percent(interval[0])} to {percent(interval[1])} (90 % interval)"
            if (interval and None not in interval)
            else ""
        )
        parts.append(
            f'<p id="closed">{percent(gap["closed"])} of the way from the nominal robot\'s gap to 1 is'
            f" closed{another}.</p>"
        )
    if details.regimes:
        parts += ["<h3>By regime</h3>", _gap_table("regime", details.regimes, "regimes", blamed)]
    if details.run_gaps:
        parts += ["<h3>By run</h3>", _gap_table("run", details.run_gaps, "runs", blamed)]
    return "".join(parts) + "</section>"


def _next(diagnosis: dict[str, Any], details: Details) -> str:
    parts = ["<section><h2>What these runs cannot tell, and the next experiment</h2>"]
    sets = diagnosis["indistinguishable"]
    if sets:
        parts.append(
            '<p>Alike in these runs:</p><ul id="indistinguishable">'
            + "".join("<li>" + escape(" · ".join(effect_name(m) for m in s)) + "</li>" for s in sets)
            + "</ul>"
        )
    else:
        parts.append('<p id="indistinguishable" class="soft">No rival fits as well as what is blamed.</p>')
    plan = diagnosis.get("next_experiment")
    if plan:
        separation = plan.get("expected_separation")
        parts.append(
            f'<p id="next">Record <b>{escape(manoeuvre(plan))}</b> next: {escape(str(plan.get("why", "")))}'
            + (f" Expected separation: {number(separation)} standard errors." if separation else "")
            + "</p>"
        )
        if exportable(details.case.robot):
            parts.append("<pre>rtds plan diagnosis.json --robot robot.toml --floor 3x3 --out plan</pre>")
        if plan.get("separates"):
            parts.append(
                '<p class="small">It separates '
                + escape(" from ".join(effect_name(e) for e in plan["separates"]))
                + ".</p>"
            )
    else:
        parts.append('<p id="next" class="soft">No further experiment is needed to tell rivals apart.</p>')
    for note in details.notes:
        parts.append(f'<p class="small soft">{escape(note)}</p>')
    return "".join(parts) + "</section>"


def _condition(details: Details) -> str:
    parts = ["<section><h2>The data's condition</h2>"]
    findings = details.gate.findings if details.gate is not None else ()
    if findings:
        rows = [
            [
                f'<span class="{f.severity}">{f.severity}</span>',
                escape(f.run or "all"),
                escape(f.channel),
                escape(f.text),
            ]
            for f in findings
        ]
        parts.append(
            _table(
                [("", False), ("run", False), ("channel", False), ("finding", False)],
                rows,
                [f'data-kind="{escape(f.kind)}"' for f in findings],
                "findings",
            )
        )
    else:
        parts.append('<p id="findings" class="soft">Nothing to complain about.</p>')
    rows = []
    for log in details.case.runs:
        meta = log.meta
        channels = ", ".join(c for c in log.columns if log.has(c) and not c.startswith("w_ref"))
        rows.append(
            [
                escape(log.name),
                f"{moment(log.t[0])} s",
                f"{log.t[-1] - log.t[0]:.1f} s",
                str(len(log.t)),
                f"{1 / float(np.median(np.diff(log.t))):.3g} Hz",
                f"{meta.payload_kg:g} kg",
                f"{meta.slope_rad:g} rad",
                escape(channels),
            ]
        )
    parts.append("<h3>Runs</h3>")
    parts.append(
        _table(
            [
                ("run", False),
                ("starts at t", True),
                ("length", True),
                ("rows", True),
                ("rate", True),
                ("payload", True),
                ("slope", True),
                ("channels", False),
            ],
            rows,
            None,
            "recorded",
        )
    )
    return "".join(parts) + "</section>"


def report_page(diagnosis: dict[str, Any], details: Details) -> str:
    """The whole report, `report.html`, as a string."""
    title = f"{details.case.name}: {diagnosis['verdict']}"
    body = "".join(
        [
            _head(diagnosis, details),
            _do(diagnosis, details),
            _where(diagnosis, details),
            _what(diagnosis, details),
            _plots(diagnosis, details),
            _gaps(diagnosis, details),
            _next(diagnosis, details),
            _condition(details),
        ]
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><meta name="color-scheme" content="light'
        ' dark">'
        # The page may load nothing: what it shows is all inside it.
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
        "script-src 'unsafe-inline'; img-src data:\">"
        '<link rel="icon" href="data:,">'
        f"<title>{escape(title)}</title><style>{_asset('style.css')}</style></head><body><main>{body}</main>"
        f'<script type="application/json" id="diagnosis">{_json(diagnosis)}</script>'
        f"<script>{_asset('plots.js')}</script></body></html>\n"
    )
