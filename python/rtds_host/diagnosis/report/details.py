"""What the report shows beyond `diagnosis.json`: filled by the diagnosis, drawn by the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rtds_host.contract import Case
from rtds_host.diagnosis.scatter import RunSize

if TYPE_CHECKING:
    from rtds_host.diagnosis.gate import Gate
    from rtds_host.diagnosis.localise import Localisation


@dataclass
class Trace:
    """One channel of one run: `t` (n,) s; the others (n,) in the channel's unit, NaN where there is no sample.

    `nominal` is the replay of robot.toml as it is, `refit` with nuisances, `after` with the included effects too;
    None leaves a line out.
    """

    t: np.ndarray
    measured: np.ndarray
    nominal: np.ndarray | None = None
    refit: np.ndarray | None = None
    after: np.ndarray | None = None


@dataclass
class Candidate:
    """One explanation that was tried, best first in the list.

    effects : list of {"id", "side"}, [] for "no effect".
    parameters : the effects' fitted values, a dict an effect (same order), name -> value or
        {"value", "ci90"}.
    improvement : what it explains, in units of noise squared per sample (mean fall of the squared error), None where it
    was
        not fitted.
    verdict : "included", "alike" (indistinguishable from what is included) or "rejected".
    reason : one clause, why it was rejected or accepted.
    """

    effects: list[dict[str, str]]
    parameters: list[dict[str, Any]] = field(default_factory=list)
    improvement: float | None = None
    probability: float | None = None
    verdict: str = "rejected"
    reason: str = ""


@dataclass
class Details:
    """Everything the report shows that `diagnosis.json` does not hold.

    case : as read. gate : findings on the data. localisation : blocks on the refitted nominal model.
    localisation_after : the same with the included effects, or None.
    candidates : what was tried, best first.
    traces : run -> channel -> Trace; any number, the report decimates them.
    regimes : regime -> {"before", "refit", "after"}, gap in units of noise, on held-out runs.
    run_gaps : run -> {"before", "refit", "after"}.
    decided : (id, side) of an included effect -> the channel that misses it most, and that channel's gap without and
    with it. repeats : (id, side) of an included effect -> on how many halves of the data it was found again, and of how
    many.
    over_runs : (id, side) of an included effect or "form:term:over" and side -> its size in each run, of what differs
    between runs.
    seconds : time the diagnosis took; printed on the terminal only, so that the report stays the same to the byte.
    """

    case: Case
    gate: Gate | None = None
    localisation: Localisation | None = None
    localisation_after: Localisation | None = None
    candidates: list[Candidate] = field(default_factory=list)
    traces: dict[str, dict[str, Trace]] = field(default_factory=dict)
    regimes: dict[str, dict[str, float | None]] = field(default_factory=dict)
    run_gaps: Mapping[str, Mapping[str, float | None]] = field(default_factory=dict)
    decided: dict[tuple[str, str], tuple[str, float, float]] = field(default_factory=dict)
    repeats: dict[tuple[str, str], tuple[int, int]] = field(default_factory=dict)
    over_runs: dict[tuple[str, str], list[RunSize]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    seconds: float | None = None
