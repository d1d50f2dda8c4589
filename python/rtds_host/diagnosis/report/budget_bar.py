"""What the gap is made of, as one bar: a colour and a pattern for each effect, what has no name hatched."""

from __future__ import annotations

from html import escape
from typing import Any

from rtds_host.diagnosis.report.words import budget_words, percent

# M. Okabe, K. Ito, 2008: distinguished by colour-blind readers, too; a pattern each, for print without colours. The ink
# that can be read on each.
_COLOURS = (
    ("#0072b2", "#ffffff"),
    ("#e69f00", "#000000"),
    ("#009e73", "#000000"),
    ("#cc79a7", "#000000"),
    ("#56b4e9", "#000000"),
    ("#d55e00", "#000000"),
    ("#f0e442", "#000000"),
)
_PATTERNS = (
    "",
    '<path d="M0 8 L8 0" {0}/>',
    '<circle cx="4" cy="4" r="1.6" fill="{1}" fill-opacity="0.55"/>',
    '<path d="M0 4 H8" {0}/>',
    '<path d="M4 0 V8" {0}/>',
    '<path d="M0 0 L8 8 M0 8 L8 0" {0}/>',
    '<path d="M0 0 L8 8" {0}/>',
)
_TOLERANCE = ("#9aa5b1", "#000000")
# Layout: the narrowest part that has room for its figure, and the bar's height in pixels.
LABELLED = 0.12
HEIGHT = 44


def _pattern(name: str, ground: str, drawing: str) -> str:
    return (
        f'<pattern id="{name}" width="8" height="8" patternUnits="userSpaceOnUse"><rect width="8" height="8" '
        f'fill="{ground}"/>{drawing}</pattern>'
    )


def budget_bar(diagnosis: dict[str, Any]) -> str:
    """The bar and its key as HTML, "" where there is no gap to share out; each part carries `data-what` and
    `data-share`.
    """
    rows = diagnosis["budget"]
    if not rows:
        return ""
    patterns = [
        _pattern(
            "unmodelled",
            "var(--paper)",
            '<path d="M-2 2 L2 -2 M0 8 L8 0 M6 10 L10 6" stroke="var(--soft)" stroke-width="2.4"/>',
        ),
        _pattern("tolerance", _TOLERANCE[0], ""),
    ]
    spoken = "shares of the difference: " + "; ".join(
        f"{text} {percent(share)}" for text, share in budget_words(diagnosis)
    )
    at, parts, key, effects = 0.0, [], [], 0
    for row, (text, share) in zip(rows, budget_words(diagnosis), strict=True):
        if row["what"] in ("effect", "form"):
            name, (ground, ink) = f"effect{effects}", _COLOURS[effects % len(_COLOURS)]
            stroke = f'stroke="{ink}" stroke-opacity="0.45" stroke-width="1.3" fill="none"'
            patterns.append(_pattern(name, ground, _PATTERNS[effects % len(_PATTERNS)].format(stroke, ink)))
            effects += 1
        elif row["what"] == "tolerance":
            name, (ground, ink) = "tolerance", _TOLERANCE
        else:
            name, ground, ink = "unmodelled", "var(--paper)", "var(--ink)"
        width = max(share, 0.0)
        label = (
            f'<text x="{100 * (at + width / 2):.3f}%" y="{HEIGHT / 2 + 5:g}" text-anchor="middle" style="fill:{ink};'
            f'stroke:{ground}">{percent(share)}</text>'
            if width >= LABELLED
            else ""
        )
        parts.append(
            f'<g data-what="{escape(row["what"])}" data-share="{share:.6g}"><title>{escape(text)}: '
            f"{percent(share)}</title>"
            f'<rect x="{100 * at:.3f}%" y="1" width="{100 * width:.3f}%" height="{HEIGHT - 2}" fill="url(#{name})" '
            f'stroke="var(--ink)" stroke-width="1"/>{label}</g>'
        )
        if share >= 0.0005:
            key.append(
                '<li><svg width="22" height="14" aria-hidden="true"><rect x="0.5" y="0.5" width="21" height="13" '
                f'fill="url(#{name})" stroke="var(--ink)"/></svg><span>{escape(text)} '
                f"<b>{percent(share)}</b></span></li>"
            )
        at += width
    return (
        '<h2 class="minor">What the difference is made of</h2>'
        f'<svg id="budget" width="100%" height="{HEIGHT}" role="img" aria-label="{escape(spoken)}"><defs>'
        + "".join(patterns)
        + "</defs>"
        + "".join(parts)
        + f'</svg><ul class="legend">{"".join(key)}</ul>'
        '<p class="soft small">Shares of the square of the difference, in which causes add up.</p>'
    )
