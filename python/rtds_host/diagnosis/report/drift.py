"""Sizes that differ between runs, drawn over the runs in their order: an effect or a form that drifts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from rtds_host.diagnosis.report.details import Details
from rtds_host.diagnosis.report.html import section
from rtds_host.diagnosis.report.words import effect_name, form_name, number
from rtds_host.diagnosis.scatter import RunSize

# Layout: the drawing, in its own units.
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 440, 200, 46, 12, 12, 46


def _name(cause: tuple[str, str]) -> str:
    kind, *form = cause[0].split(":")
    if kind != "form":
        return effect_name({"id": cause[0], "side": cause[1]})
    return form_name({"term": form[0], "over": form[1], "side": cause[1]})


def _drawing(name: str, sizes: Sequence[RunSize]) -> str:
    """Sizes with their 90 % intervals over the runs, as SVG; a run that says nothing has no mark."""
    said = [one for one in sizes if math.isfinite(one.reach)]
    low = min(0.0, *(one.size - one.reach for one in said))
    high = max(1.2, *(one.size + one.reach for one in said))
    floor = HEIGHT - BOTTOM

    def px(k: int) -> float:
        return LEFT + (k + 0.5) * (WIDTH - LEFT - RIGHT) / len(sizes)

    def py(value: float) -> float:
        return TOP + (high - value) / (high - low) * (floor - TOP)

    parts = [
        f'<line class="{kind}" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{py(v):.1f}" y2="{py(v):.1f}"/>'
        f'<text x="{LEFT - 6}" y="{py(v) + 4:.1f}" text-anchor="end">{number(v)}</text>'
        for v, kind in ((0.0, "grid"), (1.0, "zero"))
    ]
    line = " ".join(f"{px(k):.1f},{py(one.size):.1f}" for k, one in enumerate(sizes) if math.isfinite(one.reach))
    parts.append(f'<polyline class="curve" points="{line}"/>')
    for k, one in enumerate(sizes):
        parts.append(f'<text x="{px(k):.1f}" y="{floor + 18}" text-anchor="middle">{k + 1}</text>')
        if math.isfinite(one.reach):
            ends = py(one.size - one.reach), py(one.size + one.reach)
            parts.append(
                f'<line class="reach" x1="{px(k):.1f}" x2="{px(k):.1f}" y1="{ends[0]:.1f}" y2="{ends[1]:.1f}"/>'
                f'<circle class="curve" cx="{px(k):.1f}" cy="{py(one.size):.1f}" r="3">'
                f"<title>{escape(one.run)}: {number(one.size)} ± {number(one.reach)}</title></circle>"
            )
    parts.append(f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 8}" text-anchor="middle">run</text>')
    words = "; ".join(f"{one.run}: {number(one.size)}" for one in said)
    return (
        f'<svg class="form" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(f"{name}: {words}")}">'
        + "".join(parts)
        + "</svg>"
    )


def drift(details: Details) -> str:
    """The section on sizes that differ between runs, "" where none does."""
    if not details.over_runs:
        return ""
    lead = (
        "<p>These sizes differ between the runs beyond chance. 1 is the size of all runs together, bars are 90 % "
        "intervals. A steady rise or fall is a drift; a jump is a change between two runs.</p>"
    )
    figures = []
    for cause, sizes in details.over_runs.items():
        name = _name(cause)
        runs = ", ".join(f"{k + 1} {one.run}" for k, one in enumerate(sizes))
        figures.append(
            f'<figure class="shape"><figcaption><h3>{escape(name[:1].upper() + name[1:])}</h3></figcaption>'
            f'{_drawing(name, sizes)}<p class="small soft">Runs: {escape(runs)}.</p></figure>'
        )
    return section("drift", "Sizes that differ between runs", lead + "".join(figures))
