"""The gap by channel, regime and run, what these runs cannot tell, and the run to record next."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

from rtds_host.diagnosis.report.advice import exportable
from rtds_host.diagnosis.report.details import Details
from rtds_host.diagnosis.report.html import bar, section, table, with_code
from rtds_host.diagnosis.report.traces import misfit, why_not_counted
from rtds_host.diagnosis.report.words import channel_name, effect_name, manoeuvre, number, percent, percent_closed

MODELS = (("before", "nominal"), ("refit", "refitted"), ("after", "with effects"))


def _gap_bars(entry: Mapping[str, float | None], top: float, models: Iterable[tuple[str, str]]) -> str:
    scale = math.log10(max(top, 1.1)) + 0.3

    def size(v: float | None) -> float | None:
        return None if v is None else max(math.log10(max(v, 0.5)) + 0.3, 0.02)

    return "<br>".join(bar(size(entry.get(k)), scale, k, 160) for k, _ in models)


def _gap_table(
    first: str,
    gaps: Mapping[str, Mapping[str, float | None]],
    name: str,
    included: bool,
    words: dict[str, str] | None = None,
) -> str:
    if not gaps:
        return ""
    models = MODELS if included else MODELS[:2]
    values = [entry.get(k) for entry in gaps.values() for k, _ in models]
    top = max((v for v in values if v is not None and math.isfinite(v)), default=1.0)
    rows = [
        [
            escape((words or {}).get(label, label)),
            *(number(e.get(k)) for k, _ in models),
            _gap_bars(e, top, models),
        ]
        for label, e in gaps.items()
    ]
    return table(
        [(first, False), *((title, True) for _, title in models), ("(logarithmic)", False)],
        rows,
        [f'data-name="{escape(k)}"' for k in gaps],
        name,
    )


def _not_counted(details: Details, counted: Iterable[str]) -> str:
    """Channels that were measured and do not count, each with the reason."""
    known = set(counted)
    measured = dict.fromkeys(c for run in details.case.runs for c in run.columns if run.has(c))
    lines = [
        f"<li>{escape(channel_name(c))}: {escape(why)}</li>"
        for c in measured
        if c not in known and not c.startswith(("v_cmd", "w_cmd", "w_ref")) and (why := why_not_counted(c, details))
    ]
    return f'<ul id="uncounted" class="small soft">{"".join(lines)}</ul>' if lines else ""


def gaps(diagnosis: dict[str, Any], details: Details) -> str:
    """The section on the gap's size."""
    gap, included = diagnosis["gap"], bool(diagnosis["effects"])
    channels = gap.get("channels") or {}
    worst_first = dict(sorted(channels.items(), key=lambda item: -misfit(diagnosis, item[0])))
    names = {c: channel_name(c) for c in channels}
    parts = [
        '<p class="small soft">Root mean square of replay minus measured in units of noise, of each run by the fit '
        "without it (one step from the fit to all; of a single run each half). Which effects that holds was decided by "
        "all runs. Channels are in order of misfit.</p>",
        _gap_table("channel", worst_first, "channels", included, names),
        _not_counted(details, channels),
    ]
    if included and gap.get("closed") is not None:
        interval = gap.get("closed_ci90")
        another = (
            f"; of another run of this robot {percent(interval[0])} to {percent(interval[1])} (90 % interval)"
            if (interval and None not in interval)
            else ""
        )
        parts.append(
            f'<p id="closed">{percent_closed(gap["closed"])} of the way from the nominal robot\'s gap to 1 is closed'
            f"{another}.</p>"
        )
    if details.regimes:
        parts += ["<h3>By regime</h3>", _gap_table("regime", details.regimes, "regimes", included)]
    if details.run_gaps:
        parts += ["<h3>By run</h3>", _gap_table("run", details.run_gaps, "runs", included)]
    return section("sizes", "The gap by channel, regime and run", "".join(parts))


def open_questions(diagnosis: dict[str, Any], details: Details) -> str:
    """The section on what these runs cannot tell."""
    parts = []
    sets = diagnosis["indistinguishable"]
    if sets:
        parts.append(
            '<p>Indistinguishable in these runs:</p><ul id="indistinguishable">'
            + "".join("<li>" + escape(" · ".join(effect_name(m) for m in s)) + "</li>" for s in sets)
            + "</ul>"
        )
    else:
        parts.append('<p id="indistinguishable" class="soft">No other effect fits as well as those named.</p>')
    plan = diagnosis.get("next_experiment")
    if plan:
        separation = plan.get("expected_separation")
        parts.append(
            f'<p id="next">Record <b>{escape(manoeuvre(plan))}</b> next: {escape(str(plan.get("why", "")))}'
            + (f" Expected separation: {number(separation)} standard errors." if separation else "")
            + "</p>"
        )
        if exportable(details.case.robot):
            command = "`rtds plan diagnosis.json --robot robot.toml --floor 3x3 --out plan`"
            parts.append(f"<p>{with_code(command)}</p>")
        if plan.get("separates"):
            parts.append(
                '<p class="small">It separates '
                + escape(" from ".join(effect_name(e) for e in plan["separates"]))
                + ".</p>"
            )
    else:
        parts.append('<p id="next" class="soft">No further experiment is needed.</p>')
    parts += [f'<p class="small soft">{escape(note)}</p>' for note in details.notes]
    return section("open", "What these runs cannot tell, and the next experiment", "".join(parts))
