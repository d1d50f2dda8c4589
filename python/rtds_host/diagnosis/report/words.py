"""A diagnosis in words: effects, values with their units, the verdict in a sentence."""

from __future__ import annotations

import math
from typing import Any

from rtds_host.diagnosis.effects import CATALOGUE

SUBSYSTEM_WORDS = {"driver": "driver and supply", "winding": "winding", "drivetrain": "drivetrain",
                   "wheel_ground": "wheel and ground", "chassis": "chassis", "sensing": "sensing", "timing": "timing"}
SIDE_WORDS = {"both": "both sides", "left": "left side", "right": "right side"}


def number(value: float | None, digits: int = 3) -> str:
    """A figure with so many significant digits, no exponent where it can be avoided; a dash for None."""
    if value is None or not math.isfinite(value):
        return "–"
    if value != 0 and not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{digits - 1}e}"
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e" in text else text


def percent(value: float | None) -> str:
    """A share as whole per cent, with a decimal close to 0 and 1."""
    if value is None or not math.isfinite(value):
        return "–"
    shown = 100.0 * value
    return f"{shown:.1f} %" if 0 < abs(shown) < 1 or 99 < shown < 100 else f"{shown:.0f} %"


def effect_name(effect: dict[str, Any]) -> str:
    """`coulomb_friction`, both -> "Coulomb friction, both sides"; no side where an effect has none."""
    name = effect["id"].replace("_", " ")
    name = {"coulomb friction": "Coulomb friction", "stribeck friction": "Stribeck friction",
            "com offset": "centre of mass off the axle"}.get(name, name)
    known = CATALOGUE.get(effect["id"])
    if known is not None and not known.sided:
        return name
    return f"{name}, {SIDE_WORDS[effect['side']]}"


def explanation_name(effects: list[dict[str, Any]] | str) -> str:
    """An alternative of the contract as words."""
    if effects == "unknown":
        return "none of the catalogue"
    return " and ".join(effect_name(e) for e in effects) if effects else "no effect"


def unit_of(effect_id: str, parameter: str) -> str:
    """Unit of an effect's parameter, "" for a plain number."""
    known = CATALOGUE.get(effect_id)
    for p in known.parameters if known else ():
        for name, unit in ((p.name, p.unit), *(p.declared or {}).values()):
            if name == parameter:
                return "" if unit in ("1", "") else unit
    return ""


def value_words(effect_id: str, parameter: str, entry: Any) -> str:
    """A parameter with unit and interval."""
    value, interval = (entry.get("value"), entry.get("ci90")) if isinstance(entry, dict) else (entry, None)
    unit = unit_of(effect_id, parameter)
    text = number(value, 4) + (f" {unit}" if unit else "")
    if interval is not None and all(v is not None for v in interval):
        text += f" ({number(interval[0], 4)} to {number(interval[1], 4)})"
    return text


def budget_words(diagnosis: dict[str, Any]) -> list[tuple[str, float]]:
    """What the gap is made of: words and shares, effects first, what has no name last."""
    rows = []
    for row in diagnosis["budget"]:
        if row["what"] == "effect":
            text = effect_name(row)
        elif row["what"] == "tolerance":
            text = "tolerances of the motors"
        else:
            text = "no name, " + (SUBSYSTEM_WORDS[row["subsystem"]] if row["subsystem"] else "place not known")
        rows.append((text, row["share"]))
    return rows


def verdict_sentence(diagnosis: dict[str, Any]) -> str:
    """The verdict in a few sentences."""
    gap, effects = diagnosis["gap"], diagnosis["effects"]
    after, refit = gap.get("after"), gap.get("refit")
    if diagnosis["verdict"] == "none":
        return (f"Nothing is missing: with its motor values refitted, the nominal robot explains these runs; the gap is "
                f"{number(refit)} times the sensors' noise.")
    rest = gap.get("rest") or {}
    place = SUBSYSTEM_WORDS.get(rest.get("subsystem") or "")
    if not effects:
        text = "There is a gap, and no effect of the catalogue stands on its own evidence"
        return text + (f"; most of it lies in the {place}." if place else ".")
    names = "; ".join(
        f"{effect_name(e)} ({', '.join(value_words(e['id'], n, {'value': p['value']}) for n, p in e['parameters'].items())})"
        for e in effects)
    closed = gap.get("effect_closed")
    share = f", {percent(closed)} of it closed" if closed is not None else ""
    sure = min((e["probability"] for e in effects), default=0.0)
    each = "each at least " if len(effects) > 1 else ""
    text = (f"{names[:1].upper()}{names[1:]}: {each}{percent(sure)} probable. On runs not used for the fit the gap falls "
            f"from {number(refit)} to {number(after)} times the sensors' noise{share}.")
    if diagnosis["verdict"] == "partial":
        text += f" {percent(rest.get('share'))} of it has no name" + (f", most of that in the {place}." if place else ".")
    blamed = {(e["id"], e["side"]) for e in effects}
    for members in diagnosis["indistinguishable"]:
        mine = [m for m in members if (m["id"], m["side"]) in blamed]
        others = [m for m in members if (m["id"], m["side"]) not in blamed]
        if mine and others:
            text += (f" These runs cannot tell {effect_name(mine[0])} from "
                     + " or ".join(effect_name(m) for m in others) + ".")
    return text
