"""The signal chain as a picture: each block with its share of the gap."""

from __future__ import annotations

from html import escape
from typing import Any

from rtds_host.diagnosis.report.words import SUBSYSTEM_WORDS, percent

_ORDER = ("timing", "driver", "winding", "drivetrain", "wheel_ground", "chassis", "sensing")
# What goes into each block.
_SIGNALS = ("command", "", "voltage", "current, torque", "wheel speed", "force", "motion")


def chain(located: list[dict[str, Any]]) -> str:
    """The chain from command to log, in a row or, on a narrow page, in a column; `located` as in the contract.

    The darker a block, the larger its share, which is in it as well.
    """
    shares = {entry["subsystem"]: entry["share"] for entry in located}
    parts = []
    for subsystem, signal in zip(_ORDER, _SIGNALS, strict=True):
        share = shares.get(subsystem, 0.0)
        heat = round(100 * min(max(share, 0.0), 1.0) ** 0.7)
        parts.append(
            f'<li class="block{" large" if share >= 0.2 else ""}" data-subsystem="{subsystem}" '
            f'data-share="{share:.6g}" '
            f'style="--heat:{heat}%"><i>{escape(signal)}</i><div><span>{escape(SUBSYSTEM_WORDS[subsystem])}</span>'
            f"<b>{percent(share) if share >= 0.0005 else '·'}</b></div></li>"
        )
    return f'<ol id="chain" aria-label="signal chain with the share of the gap at each block">{"".join(parts)}</ol>'
