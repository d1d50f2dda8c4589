"""What must stay of a diagnosis when a case is transformed, and what may change."""

from __future__ import annotations

import itertools
import math

from invariance.transform import MIRROR, Transformation

# Parameters with a sign that a mirror turns round.
TURNED = ("y_m", "rad_s")


def _named(effects: list[dict], mirrored: bool) -> dict[tuple[str, str], dict]:
    return {(e["id"], MIRROR[e["side"]] if mirrored else e["side"]): e for e in effects}


def _sets(answer: dict, mirrored: bool) -> list[set[tuple[str, str]]]:
    return [set(_named(members, mirrored)) for members in answer["indistinguishable"]]


def differences(base: dict, other: dict, change: Transformation) -> list[str]:
    """What of the answer `other` is not as it should be next to `base`, one clause each; [] is a good cell.

    Where the answer must stay: the verdict, the effects with their sides, and each size within the base's 90 % interval
    (a null interval bounds nothing; of what changes its sign in a mirror the magnitude counts; where samples get other
    noise, within both intervals together; effects that both answers declare as twins may stand for each other). Where
    information is lost: no effect may be named that the base does not name or hold for a twin of what it names.
    """
    told, known = _named(other["effects"], change.mirrored), _named(base["effects"], False)
    if not change.same:
        twins = {
            (e["id"], e["side"])
            for members in (*base["indistinguishable"], *other["indistinguishable"])
            if any((m["id"], m["side"]) in known for m in members)
            for e in members
        }
        return [f"{effect} {side} is named" for effect, side in told if (effect, side) not in {*known, *twins}]
    found = []
    if other["verdict"] != base["verdict"]:
        found.append(f"{base['verdict']} became {other['verdict']}")
    lost, new = [key for key in known if key not in told], [key for key in told if key not in known]
    declared = [_sets(base, False), _sets(other, change.mirrored)]
    for was, now in itertools.product(tuple(lost), tuple(new)):
        # Both answers say that these two cannot be distinguished: which one stands for both is no difference.
        if was in lost and now in new and all(any({was, now} <= members for members in sets) for sets in declared):
            lost.remove(was)
            new.remove(now)
    found += [f"{effect} {side} is lost" for effect, side in lost]
    found += [f"{effect} {side} is named" for effect, side in new]
    for key in known.keys() & told.keys():
        for name, was in known[key]["parameters"].items():
            now = told[key]["parameters"].get(name)
            if was["ci90"] is None or now is None:
                continue
            low, high = was["ci90"]
            value = now["value"]
            if change.mirrored and name in TURNED:
                value = -value
            if change.noisier and now["ci90"] is not None:
                # Other noise in the samples: what two draws of a size may differ by.
                wide = math.hypot(high - low, now["ci90"][1] - now["ci90"][0]) / 2.0
                low, high = (low + high) / 2.0 - wide, (low + high) / 2.0 + wide
            if not low <= value <= high:
                found.append(f"{key[0]} {key[1]}: {name} {value:.3g} outside of {low:.3g} to {high:.3g}")
    return found
