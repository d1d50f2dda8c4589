"""The data's condition: what the gate found, and the runs as they were recorded."""

from __future__ import annotations

from html import escape

import numpy as np

from rtds_host.contract.clock import moment
from rtds_host.diagnosis.report.details import Details
from rtds_host.diagnosis.report.html import section, table

RUNS_HEAD = (
    ("run", False),
    ("starts at t", True),
    ("length", True),
    ("rows", True),
    ("rate", True),
    ("payload", True),
    ("slope", True),
    ("channels", False),
)


def _findings(details: Details) -> str:
    findings = details.gate.findings if details.gate is not None else ()
    if not findings:
        return '<p id="findings" class="soft">Nothing to complain about.</p>'
    rows = [
        [f'<span class="{f.severity}">{f.severity}</span>', escape(f.run or "all"), escape(f.channel), escape(f.text)]
        for f in findings
    ]
    return table(
        [("kind", False), ("run", False), ("channel", False), ("finding", False)],
        rows,
        [f'data-kind="{escape(f.kind)}"' for f in findings],
        "findings",
    )


def condition(details: Details) -> str:
    """The section on the data."""
    rows = []
    for log in details.case.runs:
        channels = ", ".join(c for c in log.columns if log.has(c) and not c.startswith("w_ref"))
        rows.append(
            [
                escape(log.name),
                f"{moment(log.t[0])} s",
                f"{log.t[-1] - log.t[0]:.1f} s",
                str(len(log.t)),
                f"{1 / float(np.median(np.diff(log.t))):.3g} Hz",
                f"{log.meta.payload_kg:g} kg",
                f"{log.meta.slope_rad:g} rad",
                escape(channels),
            ]
        )
    return section(
        "data", "The data's condition", _findings(details) + "<h3>Runs</h3>" + table(RUNS_HEAD, rows, None, "recorded")
    )
