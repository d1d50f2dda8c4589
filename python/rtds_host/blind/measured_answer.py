"""What an answer to a planted case is worth, compared with the answer to the untouched case (docs/blind.md)."""

from __future__ import annotations

import math

from rtds_host.blind.vocabulary import EFFECTS

# A size counts as right within this factor.
FACTOR = 2.0
# Of these delays one may be in the base and another in the answer; the answer's then holds both sizes.
DELAYS = {"measurement_delay": "seconds", "command_delay": "seconds", "speed_filter": "time_constant_s"}
# What an effect has that is not there, of a ratio (True) and of anything else.
ABSENT = {True: 1.0, False: 0.0}
# A form of an effect that holds another one as a part of it.
WIDER = {"stribeck_friction": "coulomb_friction"}


def _value(included: dict, parameter: str) -> tuple[float | None, list | None]:
    given = included.get("parameters", {}).get(parameter)
    if isinstance(given, dict):
        return given.get("value"), given.get("ci90")
    return given, None


def _over_planted(want: dict, value: float, base: float | None) -> float | None:
    """The change from the base's size to another one over the planted change; None where it has another direction, or
    is off by more than the factor that counts as right."""
    ratio = want["parameter"] == "ratio"
    change = _change(value, base, ratio)
    target = min(max(change, _change(want["low"], None, ratio)), _change(want["high"], None, ratio))
    return change / target if target * change > 0 and 1 / FACTOR <= change / target <= FACTOR else None


def _change(value: float, base: float | None, ratio: bool) -> float:
    """Size of a change: log of a ratio's, difference of anything else's."""
    if ratio:
        return math.log(abs(value) / abs(base if base else 1.0)) if value else -math.inf
    return value - (base or 0.0)


class Answer:
    """Blamed effects of an answer, sides aside where there is one side only."""

    def __init__(self, answer: dict | None, axis: bool):
        self.axis = axis
        self.verdict = answer["verdict"] if answer else None
        self.effects = {self.key(e["id"], e["side"]): e for e in (answer or {}).get("effects") or []}
        sets = [
            {self.key(e["id"], e["side"]) for e in group} for group in (answer or {}).get("indistinguishable") or []
        ]
        self.sets = [group for group in sets if len(group) <= 3 and group & set(self.effects)]

    def key(self, effect: str, side: str) -> tuple[str, str]:
        return effect, "" if self.axis else side

    def on(self, effect: str, side: str) -> dict | None:
        """An effect that is blamed on a side, alone or with the other; None where it is not."""
        return self.effects.get(self.key(effect, side)) or self.effects.get(self.key(effect, "both"))


def _replaced(want: dict, side: str, answer: Answer, base: Answer, sharing: list[dict]) -> float | None:
    """The ratio that the base gives to equivalents of the planted change whose place `want` takes in the answer; None
    where it gives none.

    A base that names a speed's gain of 0.76 and an answer that names a driver's gain of 0.57 in its place differ by
    0.57 / 0.76 where either does as well.
    """
    found, planted = [], math.log(want["low"])
    for other in sharing:
        if other["parameter"] != "ratio" or other["id"] == want["id"]:
            continue
        places = {answer.key(other["id"], where) for where in (side, "both")}
        size = math.log(other["low"]) / planted
        if places & set(answer.effects) or not math.isclose(abs(size), 1.0, rel_tol=1e-3):
            continue
        ratios = [_value(base.effects[key], "ratio")[0] for key in places & set(base.effects)]
        found += [ratio ** round(size) for ratio in ratios if ratio]
    return math.prod(found) if found else None


def _match(want: dict, side: str, answer: Answer, base: Answer, sharing: list[dict]) -> dict | None:
    """How an answer holds one equivalent of the planted change; None where it does not. sharing : all equivalents."""
    side = side if EFFECTS[want["id"]][1] else "both"
    key, parameter, ratio = answer.key(want["id"], side), want["parameter"], want["parameter"] == "ratio"
    had = base.on(want["id"], side)
    before, _ = _value(had, parameter) if had else (None, None)
    nothing = not any(answer.on(other["id"], side) for other in sharing)
    if nothing and before is not None and _over_planted(want, ABSENT[ratio], before):
        # The change undoes what the machine has of its own, and the answer names nothing of that kind.
        return {"effect": want["id"], "named": False, "undone": True}
    if key not in answer.effects:
        return {"effect": want["id"], "named": False} if any(key in group for group in answer.sets) else None
    value, interval = _value(answer.effects[key], parameter)
    if value is None:
        return None
    if before is None and want["id"] in DELAYS:
        gone = [k for k in base.effects if k[0] in DELAYS and k not in answer.effects]
        sizes = [_value(base.effects[k], DELAYS[k[0]])[0] for k in gone]
        before = sum(x for x in sizes if x is not None) or None
    if before is None and ratio:
        before = _replaced(want, side, answer, base, sharing)
    change = _over_planted(want, value, before)
    if change is None:
        return None

    def expected(end: float) -> float:
        return end * (before or 1.0) if ratio else end + (before or 0.0)

    ends = sorted((expected(want["low"]), expected(want["high"])))
    covered = None
    if interval and all(isinstance(x, (int, float)) for x in interval):
        covered = bool(interval[0] <= ends[1] and interval[1] >= ends[0])
    return {
        "effect": want["id"],
        "named": True,
        "parameter": want["parameter"],
        "expected": ends,
        "value": value,
        "ci90": interval,
        "covered": covered,
        "size_error": round(change - 1, 4),
    }


def judge_planted(truth: dict, said: dict | None, base_said: dict | None, entry: dict) -> dict:
    """What one answer to a planted case is worth, with the answer to the untouched case as base.

    Parameters
    ----------
    truth : opened truth. said, base_said : `diagnosis.json` of the case and of its data set's untouched case, or
    None where there is none. entry : the ledger's line.

    Returns
    -------
    dict of figures (docs/blind.md says what they mean).
    """
    axis = truth["axis"]
    answer, base = Answer(said, axis), Answer(base_said, axis)
    equivalents = [*truth["same"], *truth["alike"]]
    same = [m for want in truth["same"] if (m := _match(want, truth["side"], answer, base, equivalents))]
    alike = [m for want in truth["alike"] if (m := _match(want, truth["side"], answer, base, equivalents))]
    named = [m for m in same if m["named"]]
    sharing = {want["id"] for want in equivalents}
    forms = set(base.effects) | {
        (wide, side) for wide, part in WIDER.items() for name, side in base.effects if name == part
    }
    kept = set(answer.effects) | {(WIDER[name], side) for name, side in answer.effects if name in WIDER}
    new = [key[0] for key in answer.effects if key not in forms and key[0] not in sharing]
    return {
        "set": truth["set"],
        "kind": truth["kind"],
        "said": truth["said"],
        "side": truth["side"],
        "seconds": entry["seconds"],
        "answered": said is not None,
        "complaint": "" if said else entry["said"],
        "verdict": answer.verdict,
        "included": sorted(key[0] for key in answer.effects),
        "want": [want["id"] for want in truth["same"]],
        "named": bool(named),
        "found": bool(same),
        "near": bool(same or any(m["named"] for m in alike)),
        "match": next(iter(named or same or [m for m in alike if m["named"]]), None),
        "covered": named[0]["covered"] if named else None,
        "size_error": named[0]["size_error"] if named else None,
        "silent": answer.verdict == "known" and set(answer.effects) == set(base.effects) and not same,
        "new_false": bool(new),
        "false": sorted(new),
        "unknown": answer.verdict == "unknown",
        "base_kept": (set(base.effects) <= kept) if base.effects else None,
    }
