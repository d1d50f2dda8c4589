"""`diagnosis.json` against its JSON Schema and the rules that a schema cannot say."""

from __future__ import annotations

import itertools
import json
from functools import lru_cache
from importlib import resources
from typing import Any

import jsonschema


@lru_cache(maxsize=1)
def schema() -> dict[str, Any]:
    """The JSON Schema (2020-12) of `diagnosis.json`."""
    return json.loads(resources.files("rtds_host.diagnosis").joinpath("diagnosis.schema.json").read_text("utf-8"))


def validate(diagnosis: dict[str, Any]) -> None:
    """Check a diagnosis.

    Raises
    ------
    ValueError : names the place that breaks the contract's section 5.
    """
    validator = jsonschema.Draft202012Validator(schema())
    error = min(validator.iter_errors(diagnosis), key=lambda e: list(map(str, e.absolute_path)), default=None)
    if error is not None:
        place = "/".join(map(str, error.absolute_path)) or "top level"
        raise ValueError(f"diagnosis.json: {place}: {error.message}")
    for name in ("located", "budget"):
        shares = [entry["share"] for entry in diagnosis[name]]
        if shares and abs(sum(shares) - 1.0) > 1e-3:
            raise ValueError(f"diagnosis.json: {name}: shares sum to {sum(shares):g}, not to 1")
    verdict = diagnosis["verdict"]
    if verdict == "none" and (diagnosis["effects"] or diagnosis["located"] or diagnosis["budget"]):
        raise ValueError("diagnosis.json: verdict: is none, but effects are named or a place is given")
    if (verdict in ("known", "partial")) != bool(diagnosis["effects"]):
        raise ValueError(
            f"diagnosis.json: effects: {len(diagnosis['effects'])} of them although the verdict is {verdict}"
        )
    _check_forms(diagnosis)
    included = {(e["id"], e["side"]) for e in diagnosis["effects"]}
    for causes in diagnosis["indistinguishable"]:
        if not included & {(m["id"], m["side"]) for m in causes}:
            raise ValueError("diagnosis.json: indistinguishable: a set holds no named effect")
    open_end = verdict in ("partial", "unknown") or diagnosis["indistinguishable"]
    if open_end and diagnosis["next_experiment"] is None:
        raise ValueError("diagnosis.json: next_experiment: missing although something is open")
    chances = [a["probability"] for a in diagnosis["alternatives"]]
    if chances and not 0.985 <= sum(chances) <= 1.001:
        raise ValueError(f"diagnosis.json: alternatives: probabilities sum to {sum(chances):g}")
    if any(a < b - 1e-9 for a, b in itertools.pairwise(chances)):
        raise ValueError("diagnosis.json: alternatives: not best first")


def _check_forms(diagnosis: dict[str, Any]) -> None:
    """What a schema cannot say of forms: curves run upwards, and the gap is given with them."""
    forms = diagnosis.get("forms") or []
    for k, form in enumerate(forms):
        if any(a[0] >= b[0] for a, b in itertools.pairwise(form["curve"])):
            raise ValueError(f"diagnosis.json: forms/{k}/curve: not in ascending order")
    if forms and diagnosis["gap"].get("with_forms") is None:
        raise ValueError("diagnosis.json: gap/with_forms: missing although there are forms")
