"""The signal chain as a picture: each block with its share of the gap."""

from __future__ import annotations

from html import escape
from typing import Any

from rtds_host.diagnosis.report.words import SUBSYSTEM_WORDS, percent

_ORDER = ("timing", "driver", "winding", "drivetrain", "wheel_ground", "chassis", "sensing")
_SIGNALS = ("command", "", "voltage", "current, torque", "wheel speed", "force", "motion", "log")
_WIDTH, _HEIGHT, _STEP = 126, 64, 160


def _colour(share: float) -> str:
    """White to orange-red with the share."""
    share = min(max(share, 0.0), 1.0)
    low, high = (255, 255, 255), (234, 110, 40)
    return "#" + "".join(f"{round(a + (b - a) * share**0.7):02x}" for a, b in zip(low, high))


def chain_svg(located: list[dict[str, Any]]) -> str:
    """Inline SVG of the chain from command to log; `located` as in the contract."""
    shares = {entry["subsystem"]: entry["share"] for entry in located}
    width = _STEP * len(_ORDER) + 40
    parts = [(f'<svg id="chain" viewBox="0 0 {width} 128" width="100%" role="img" '
             'aria-label="signal chain with the share of the gap at each block">')]
    for k, subsystem in enumerate(_ORDER):
        x = 30 + k * _STEP
        share = shares.get(subsystem, 0.0)
        if k:
            parts.append(f'<path d="M{x - 34} 56 H{x - 3} m-7 -4 l7 4 l-7 4" fill="none" stroke="#5c6b7a" '
                         'stroke-width="1.4"/>')
        parts.append(f'<g class="block" data-subsystem="{subsystem}" data-share="{share:.6g}">'
                     f'<rect x="{x}" y="24" width="{_WIDTH}" height="{_HEIGHT}" rx="8" fill="{_colour(share)}" '
                     f'stroke="#5c6b7a" stroke-width="{2 if share >= 0.2 else 1}"/>'
                     f'<text x="{x + _WIDTH / 2}" y="50" text-anchor="middle">{escape(SUBSYSTEM_WORDS[subsystem])}</text>'
                     f'<text x="{x + _WIDTH / 2}" y="74" text-anchor="middle" font-weight="700" font-size="16">'
                     f'{percent(share) if share > 0 else "·"}</text></g>')
        if _SIGNALS[k + 1] and k + 1 < len(_ORDER):
            parts.append(f'<text x="{x + _WIDTH + 17}" y="110" text-anchor="middle" font-size="11" fill="#5c6b7a">'
                         f'{_SIGNALS[k + 1]}</text>')
    parts.append('<path d="M2 56 H27 m-7 -4 l7 4 l-7 4" fill="none" stroke="#5c6b7a" stroke-width="1.4"/>')
    parts.append("</svg>")
    return "".join(parts)
