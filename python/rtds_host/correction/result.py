"""What `rtds close` finds."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rtds_host.contract import RunLog


@dataclass(frozen=True)
class Run:
    """One held-out run: its log, where it starts, and four (n, 11) answers to its commands."""

    log: RunLog
    start: np.ndarray
    replayed: dict[str, np.ndarray]
    simulated: dict[str, np.ndarray]


@dataclass
class Result:
    """What `close` found: `content` of close.json, the runs, the diagnosis."""

    content: dict
    runs: list[Run]
    diagnosis: dict
    notes: list[str] = field(default_factory=list)
