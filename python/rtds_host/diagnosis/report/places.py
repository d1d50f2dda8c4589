"""Where the gap lies: the signal chain, each block on its own, and what is left."""

from __future__ import annotations

from html import escape
from typing import Any

from rtds_host.diagnosis.report.chain import chain
from rtds_host.diagnosis.report.details import Details
from rtds_host.diagnosis.report.html import bar, section, table
from rtds_host.diagnosis.report.words import SUBSYSTEM_WORDS, number, percent

# Layout: a block is worth a word on where it fails from this score on.
POOR = 1.3


def _blocks(details: Details, included: bool) -> str:
    local = details.localisation
    if local is None or not local.blocks:
        return ""
    corrected = details.localisation_after if included else None
    after = {b.name: b.score for b in corrected.blocks} if corrected else {}
    # What is beyond a perfect robot's score, on a scale on which a good one has hardly a bar.
    top = max(2.0, *(b.score - 1.0 for b in local.blocks))
    rows = []
    for b in local.blocks:
        regimes = sorted(b.regimes.items(), key=lambda p: -p[1])
        worst = ", ".join(f"{escape(r)} {number(v)}" for r, v in regimes[:3]) if b.score > POOR else ""
        rows.append(
            [
                escape(b.title),
                escape(SUBSYSTEM_WORDS[b.subsystem]),
                bar(max(b.score - 1.0, 0.0), top) + f'<span class="value">{number(b.score)}</span>',
                *([number(after.get(b.name))] if after else []),
                worst,
            ]
        )
    head = [
        ("block", False),
        ("subsystem", False),
        ("score", True),
        *([("with effects", True)] if after else []),
        ("worst where", False),
    ]
    undetermined = (
        '<p class="small soft" id="lost">' + escape("; ".join(local.undetermined)).capitalize() + ".</p>"
        if local.undetermined
        else ""
    )
    return (
        "<h3>Each block on its own, driven by measured signals (units of noise; a perfect robot scores 1)</h3>"
        + table(head, rows, [f'data-block="{b.name}"' for b in local.blocks], "blocks")
        + undetermined
    )


def _rest(diagnosis: dict[str, Any]) -> str:
    residual = diagnosis["gap"].get("rest") or {}
    if residual.get("share") is None or diagnosis["verdict"] == "none":
        return ""
    structured = residual.get("structured")
    if diagnosis["effects"]:
        text = f"The named effects leave {percent(residual['share'])} of the refitted robot's gap beyond 1"
        text += f", {'with' if structured else 'without'} structure"
    else:
        text = f"The gap is {'structured' if structured else 'without structure'}"
    if structured and residual.get("subsystem"):
        text += f", mostly in the {SUBSYSTEM_WORDS.get(residual['subsystem'], residual['subsystem'])}"
    return f'<p id="rest">{escape(text)}.</p>'


def where(diagnosis: dict[str, Any], details: Details) -> str:
    """The section on places."""
    parts = [chain(diagnosis["located"])]
    if not diagnosis["located"]:
        parts.append('<p class="soft">No part of the chain stands out.</p>')
    parts += [_blocks(details, bool(diagnosis["effects"])), _rest(diagnosis)]
    return section("where", "Where the gap lies", "".join(parts))
