"""Whether an answer's forms are there: unmodelled effects that are functions of a state, and the curves for them.

A form (contract, section 5) is a free curve in one equation over one state. An unmodelled effect that is such a
function asks for a form in its own equation that closes `CLOSES` of what the effect makes, on runs that no diagnoser
saw. What it makes is known from the truth. It is all that the effects leave (a curve of the tier `formed`, too), or in
the tier `hard`, where much else has another form, the part that the nearest machine of the catalogue does not make up
for.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rtds_host.cleanup import temporary_folder

CLOSES = 0.7  # share of what an unmodelled effect makes
LEAST_GAP = 1.2  # an effect that makes less is not asked for
LEAST_SHARE = 0.5  # nor, in `hard`, one that makes less of the squared residual that the nearest machine leaves
# Unmodelled effects that are functions of a state, and the terms of the equation that lacks each: friction over the
# speed or over time is a torque or a damping of the same equation of motion.
EQUATIONS = {
    "command_quantised": ("voltage",),
    "current_chopped": ("voltage",),
    "driver_foldback": ("voltage",),
    "brush_film": ("voltage",),
    "flux_droop": ("torque_constant",),
    "eddy_drag": ("torque", "damping"),
    "cold_grease": ("damping", "torque"),
    "power_drag": ("torque", "damping"),
    "carpet_nap": ("force",),
    "speed_clipped": ("speed_sensor",),
    "speed_floor": ("speed_sensor",),
    "current_floor": ("current_sensor",),
    "gyro_drift": ("gyro_sensor",),
}
# Curves that were drawn at random name their equation. Friction by speed or over time is of one and the same.
ALIKE = {"torque": ("torque", "damping"), "damping": ("damping", "torque")}


def unmodelled(truth: dict) -> list[dict]:
    """What a truth has beside effects: entries with `id`, and `side` where it has one."""
    there = [truth.get("outside"), truth.get("rest"), *truth.get("forms", ())]
    return [entry for entry in there if entry]


def effects_alone(diagnosis: Path, measured: Callable[[Path], dict]) -> float | None:
    """Gap that a diagnosis' effects leave of unseen runs without its forms; None without forms or a prediction.

    measured : diagnosis file -> closure, see `score.closure`.
    """
    answer = json.loads(diagnosis.read_text())
    if not answer.get("forms"):
        return None
    with temporary_folder() as scratch:
        bare = scratch / "diagnosis.json"
        bare.write_text(json.dumps({**answer, "forms": []}))
        return measured(bare).get("after")


def judged(truth: dict, answer: dict | None, closure: dict | None) -> list[list[Any]]:
    """Each unmodelled effect that asks for a form, with whether an answer has one that closes enough.

    Parameters
    ----------
    truth, answer : of one case. closure : what `score.closure` measured, with `effects_alone`.

    Returns
    -------
    rows [id, whether a form lies in its equation, share of what it makes that is closed (None if unknown), right].
    """
    forms = (answer or {}).get("forms") or []
    rows = []
    for entry in unmodelled(truth):
        terms = (
            ALIKE.get(entry["equation"], (entry["equation"],)) if "equation" in entry else EQUATIONS.get(entry["id"])
        )
        if not terms or not _asked(truth, entry, closure or {}):
            continue
        placed = any(form["term"] in terms for form in forms)
        share = _share(entry, closure or {}) if placed else None
        rows.append([entry["id"], placed, share, bool(placed and share is not None and share >= CLOSES)])
    return rows


def _asked(truth: dict, entry: dict, closure: dict) -> bool:
    """Whether an unmodelled effect makes a gap that can be seen next to all else that has no name."""
    if "gap_beyond_names" not in entry:
        alone = closure.get("before", 0.0)  # of a case that has nothing else
        return bool(entry.get("gap_without", alone) >= LEAST_GAP)
    own = entry["gap_beyond_names"] ** 2 - 1.0
    return entry["gap_beyond_names"] >= LEAST_GAP and own >= LEAST_SHARE * (truth["gap"]["known"] ** 2 - 1.0)


def _share(entry: dict, closure: dict) -> float | None:
    """Share of what an effect makes of unseen runs that the forms close."""
    before, after = closure.get("effects_alone"), closure.get("after")
    if before is None or after is None:
        return None
    left = 1.0
    if "gap_beyond_names" in entry and "equation" not in entry:
        left = math.sqrt(max(before**2 - (entry["gap_beyond_names"] ** 2 - 1.0), 1.0))
    return round((before - after) / (before - left), 4) if before > left else None


def false_form(truth: dict, answer: dict | None) -> bool | None:
    """Whether an answer has a form where nothing is without a name; None where something is."""
    return None if unmodelled(truth) else bool((answer or {}).get("forms"))
