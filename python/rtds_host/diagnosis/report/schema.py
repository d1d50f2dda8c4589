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
    shares = [entry["share"] for entry in diagnosis["located"]]
    if shares and abs(sum(shares) - 1.0) > 1e-3:
        raise ValueError(f"diagnosis.json: located: shares sum to {sum(shares):g}, not to 1")
    if diagnosis["verdict"] == "none" and (diagnosis["effects"] or diagnosis["located"]):
        raise ValueError("diagnosis.json: verdict: is none, but effects are blamed or a place is given")
    if diagnosis["verdict"] == "known" and not diagnosis["effects"]:
        raise ValueError("diagnosis.json: effects: empty although the verdict is known")
    chances = [a["probability"] for a in diagnosis["alternatives"]]
    if chances and not 0.985 <= sum(chances) <= 1.001:
        raise ValueError(f"diagnosis.json: alternatives: probabilities sum to {sum(chances):g}")
    if any(a < b - 1e-9 for a, b in itertools.pairwise(chances)):
        raise ValueError("diagnosis.json: alternatives: not best first")
