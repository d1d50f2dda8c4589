"""What a documentation page says a command prints, against what it prints now.

Three kinds of statement are compared:

- an answer of `rtds diagnose`, below its command. Verdict, effects and sides are compared exactly, sizes with the
  interval of today's answer, gaps to 10 % (or 0.05 units of noise, whichever is more), shares and probabilities to 0.1.
  So are the lines below it: where the gap lies (`located`), its shares (`made of`), the alternatives (`odds`), and the
  next experiment (`next`), word for word. Today's answer is the `diagnosis.json` that the command wrote, of any schema;
  the words on the page are read with the program's own names.
- JSON inside of an output: the same, by its keys. The table of `rtds close`: its gaps and shares. Any other line of
  output exactly, though lines may be left out.
- a figure in a sentence with a mark behind it, `11.5<!-- answer: report/diagnosis.json gap.refit -->`: figures as
  above, words (a verdict, an effect's id, a side) exactly. A list's entry is named by its number:
  `effects.0.parameters.torque_nm.value`.
"""

from __future__ import annotations

import json
import math
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.report.words import (
    SUBSYSTEM_WORDS,
    budget_words,
    effect_name,
    explanation_name,
    manoeuvre,
)

VERDICTS = ("none", "known", "partial", "unknown")
NUMBER = r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?"
HEADLINE = re.compile(rf"(?P<case>\S+) +(?P<verdict>{'|'.join(VERDICTS)})  ?(?P<text>\S.*)")
# A line below the headline begins with two spaces and a label; the headline itself is wrapped without.
DETAIL = re.compile(r"  \S")
PROSE = re.compile(r"(?P<said>[-+.\deE]+ %|[^\s<>()*|`]+)[*`]*<!-- answer: (?P<file>\S+) (?P<key>\S+) -->")
GAP_FACTOR, GAP_UNITS, SHARE = 0.1, 0.05, 0.1
SECONDS = re.compile(r"\s*[\d.]+ s")
# A list of shares, and what separates its entries: a name may hold commas, so an entry ends with its per cent.
SHARES = re.compile(r"(?P<name>[^;]+?) (?P<share>[\d.]+) %(?:[,;] |$)")


def near_gap(said: float, now: float | None) -> bool:
    """Whether a gap on a page is today's."""
    return now is not None and abs(said - now) <= max(GAP_FACTOR * abs(now), GAP_UNITS)


def near_share(said: float, now: float | None) -> bool:
    """Whether a share or a probability on a page is today's."""
    return now is not None and abs(said - now) <= SHARE


def names() -> dict[str, tuple[str, str]]:
    """Every effect in the program's words, in lower case -> (id, side); the longest first."""
    found = {
        effect_name({"id": name, "side": side}).lower(): (name, side if effect.sided else "both")
        for name, effect in CATALOGUE.items()
        for side in ("left", "right", "both")
    }
    return dict(sorted(found.items(), key=lambda entry: -len(entry[0])))


@dataclass
class Answer:
    """An answer as a page prints it: effects (id, side) -> sizes by name, or by place where the page gives no name."""

    case: str
    verdict: str
    effects: dict[tuple[str, str], dict[str | int, float]] = field(default_factory=dict)
    gap: dict[str, float] = field(default_factory=dict)
    shares: dict[str, float] = field(default_factory=dict)
    lists: dict[str, dict[str, float]] = field(default_factory=dict)  # located, made of, odds: share by name
    following: str = ""  # the next experiment and why, without where its commands are


def _effects(text: str) -> Iterator[tuple[tuple[str, str], str]]:
    """Effects named in a text, each with what follows up to the next."""
    known = names()
    pattern = re.compile("|".join(map(re.escape, known)), re.IGNORECASE)
    hits = list(pattern.finditer(text))
    for hit, after in zip(hits, [*(h.start() for h in hits[1:]), len(text)]):
        yield known[hit[0].lower()], text[hit.end() : after]


def read_answers(text: str) -> list[Answer]:
    """The answers of `rtds diagnose` in an output, or in what a page shows of it."""
    answers: list[Answer] = []
    lines = text.splitlines()
    for number, line in enumerate(lines):
        head = HEADLINE.fullmatch(line.rstrip())
        if head is None:
            if answers and DETAIL.match(line):
                _read_detail(" ".join([line, *_wrapped(lines[number + 1 :])]), answers[-1])
            continue
        answer = Answer(head["case"], head["verdict"])
        _read_sentence(" ".join([head["text"], *_wrapped(lines[number + 1 :])]), answer)
        answers.append(answer)
    return answers


def _wrapped(lines: list[str]) -> Iterator[str]:
    """What of the next lines belongs to the one before them, since the terminal wraps without an indent."""
    for line in lines:
        if not line.strip() or DETAIL.match(line) or HEADLINE.fullmatch(line.rstrip()):
            return
        yield line.strip()


def _read_sentence(text: str, answer: Answer) -> None:
    told, _, _twins = text.partition("cannot distinguish")
    for effect, rest in _effects(told):
        sizes = re.match(r"\s*\(([^()]*)\)", rest)
        values = re.findall(rf"(?:^|, ){NUMBER}", sizes[1]) if sizes else []
        answer.effects[effect] = {place: float(v.removeprefix(", ")) for place, v in enumerate(values)}
    if m := re.search(rf"from ({NUMBER}) to ({NUMBER}) times", told):
        answer.gap |= {"refit": float(m[1]), "after": float(m[2])}
        if m := re.search(rf"nominal ({NUMBER})\)", told):
            answer.gap["before"] = float(m[1])
    elif m := re.search(rf"gap is ({NUMBER}) times", told):
        answer.gap["refit"] = float(m[1])
    if m := re.search(rf"({NUMBER}) % closed", told):
        answer.shares["effect_closed"] = float(m[1]) / 100.0
    if m := re.search(rf"({NUMBER}) % probable", told):
        answer.shares["probability"] = float(m[1]) / 100.0


def _read_detail(line: str, answer: Answer) -> None:
    label, _, rest = line.strip().partition("  ")
    if label == "effect":
        for effect, values in _effects(rest):
            answer.effects[effect] = {m[1]: float(m[2]) for m in re.finditer(rf"(\w+) = ({NUMBER})", values)}
    elif label == "held out":
        figures = re.findall(NUMBER, rest)
        answer.gap |= dict(zip(("before", "refit", "after"), map(float, figures)))
    elif label in LISTS:
        answer.lists[label] = {m["name"].strip(): float(m["share"]) / 100.0 for m in SHARES.finditer(rest.strip())}
    elif label == "next":
        answer.following = " ".join(rest.replace(" (rtds plan gives its commands)", "").split())


def lists_now(now: dict[str, Any]) -> dict[str, dict[str, float]]:
    """What `located`, `made of` and `odds` hold of a `diagnosis.json`: share by name, in the program's words."""
    return {
        "located": {SUBSYSTEM_WORDS[e["subsystem"]]: e["share"] for e in now.get("located") or []},
        "made of": dict(budget_words(now)) if now.get("budget") else {},
        "odds": {explanation_name(a["effects"]): a["probability"] for a in now.get("alternatives") or []},
    }


LISTS = ("located", "made of", "odds")


def compare_details(said: Answer, now: dict[str, Any]) -> list[str]:
    """What the lines below an answer say that today's `diagnosis.json` does not. A name that is missing on either side
    counts as a share of nothing.
    """
    wrong = []
    for label, shares in lists_now(now).items():
        if label not in said.lists:
            continue
        shown = said.lists[label]
        # Of many alternatives the terminal shows the first four: what is not shown may be less than the last of these.
        hidden = min(shown.values(), default=0.0) if label == "odds" and len(shown) == 4 else 0.0
        for name in dict.fromkeys([*shown, *shares]):
            least = hidden if name not in shown else 0.0
            share = shares.get(name, 0.0)
            if not near_share(shown.get(name, 0.0), max(share - least, 0.0)):
                wrong.append(f"{label}: {name} {shown.get(name, 0.0):g}, now {share:g}")
    plan = now.get("next_experiment")
    following = " ".join(f"record {manoeuvre(plan)}: {plan.get('why', '')}".split()) if plan else ""
    if said.following and said.following != following:
        wrong.append(f"next: {said.following!r}, now {following!r}")
    return wrong


def compare_answer(said: Answer, now: dict[str, Any]) -> list[str]:
    """What an answer on a page says that today's `diagnosis.json` does not; [] where they agree."""
    wrong = [] if said.verdict == now["verdict"] else [f"verdict {said.verdict}, now {now['verdict']}"]
    real = {(e["id"], e["side"]): e for e in now["effects"]}
    wrong += [f"effect {' '.join(e)}, now not included" for e in said.effects if e not in real]
    wrong += [f"effect {' '.join(e)} not there, now included" for e in real if e not in said.effects]
    for effect in said.effects.keys() & real.keys():
        parameters = real[effect]["parameters"]
        for key, value in said.effects[effect].items():
            names_now = list(parameters)
            name = key if isinstance(key, str) else names_now[key] if key < len(names_now) else None
            if name not in parameters:
                wrong.append(f"{' '.join(effect)} {key} = {value:g}, now no such parameter")
            else:
                wrong += _compare_size(f"{' '.join(effect)} {name}", value, parameters[name])
    gap = now["gap"]
    wrong += [
        f"gap {key} {value:g}, now {gap.get(key)}"
        for key, value in said.gap.items()
        if not near_gap(value, gap.get(key))
    ]
    sure = min((e["probability"] for e in now["effects"]), default=None)
    closed = gap.get("effect_closed")
    # The sentence says at most 100 %, of a replay that is closer than the declared noise.
    shares = {"probability": sure, "effect_closed": None if closed is None else min(closed, 1.0)}
    wrong += [
        f"{key} {value:g}, now {shares[key]}"
        for key, value in said.shares.items()
        if not near_share(value, shares[key])
    ]
    return wrong + compare_details(said, now)


def _compare_size(name: str, said: float, now: dict[str, Any]) -> list[str]:
    interval = now.get("ci90")
    if interval is None or any(v is None for v in interval):
        inside = abs(said - now["value"]) <= GAP_FACTOR * abs(now["value"])
    else:
        inside = interval[0] <= said <= interval[1]
    return [] if inside else [f"{name} = {said:g}, now {now['value']:g} in {interval}"]


def compare_json(said: Any, now: Any, where: str = "") -> list[str]:
    """What JSON on a page says that today's does not. Sizes with an interval, gaps and shares as everywhere, the rest
    exactly.
    """
    if isinstance(said, dict) and isinstance(now, dict):
        if "value" in said and "ci90" in now:
            return _compare_size(where, said["value"], now)
        wrong = [
            f"{where}: {key} {how}"
            for keys, how in ((said.keys() - now.keys(), "is gone"), (now.keys() - said.keys(), "is new"))
            for key in sorted(keys)
        ]
        return wrong + [
            w for key in said if key in now for w in compare_json(said[key], now[key], f"{where}.{key}".strip("."))
        ]
    if isinstance(said, list) and isinstance(now, list):
        if len(said) != len(now):
            return [f"{where}: {len(said)} entries, now {len(now)}"]
        return [w for i, (a, b) in enumerate(zip(said, now)) for w in compare_json(a, b, f"{where}.{i}".strip("."))]
    if _is_number(said) and _is_number(now):
        is_share = where.rsplit(".", 1)[-1] in ("probability", "share", "closed", "effect_closed")
        return [] if (near_share if is_share else near_gap)(said, now) else [f"{where}: {said:g}, now {now:g}"]
    return [] if said == now else [f"{where}: {said!r}, now {now!r}"]


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _pieces(text: str) -> tuple[list[str], list[Any]]:
    """An output as (lines of words, JSON values in it)."""
    decoder, values, words, at = json.JSONDecoder(), [], [], 0
    for start in re.finditer(r"[{\[]", text):
        if start.start() < at:
            continue
        try:
            value, end = decoder.raw_decode(text, start.start())
        except ValueError:
            continue
        if not isinstance(value, (dict, list)):
            continue
        words.append(text[at : start.start()])
        values.append(value)
        at = end
    words.append(text[at:])
    return [" ".join(line.split()) for line in "\n".join(words).splitlines() if line.strip()], values


def compare_output(command: str, said: str, printed: str, folder: Path) -> list[str]:
    """What a page shows below a command that the command does not print now; [] where they agree.

    Parameters
    ----------
    said, printed : what stands on the page, and what the command has printed.
    folder : where it was run; `rtds diagnose` and `rtds close` have left their JSON there.
    """
    words = shlex.split(command, comments=True)
    out = folder / words[words.index("--out") + 1] if "--out" in words[:-1] else folder
    if words[:2] == ["rtds", "diagnose"]:
        answers = read_answers(said)
        wrong = [] if answers else ["no answer below the command"]
        for answer in answers:
            place = next(
                (p for p in (out / answer.case / "diagnosis.json", out / "diagnosis.json") if p.is_file()), None
            )
            if place is None:
                wrong.append(f"{answer.case}: the command leaves no diagnosis.json")
            else:
                found = compare_answer(answer, json.loads(place.read_text(encoding="utf-8")))
                # What the terminal says must be what the file says, or the page would be compared with neither.
                spoken = [a for a in read_answers(printed) if a.case == answer.case]
                if not spoken:
                    found.append("the terminal shows no such answer")
                wrong += [f"{answer.case}: {w}" for w in found]
        return wrong
    if words[:2] == ["rtds", "close"]:
        return _compare_close(said, json.loads((out / "close.json").read_text(encoding="utf-8")))
    lines, values = _pieces(said)
    lines_now, values_now = _pieces(printed)
    wrong = compare_json(values, values_now, "JSON") if values else []
    rest = iter(lines_now)
    # What an export writes are a diagnosis' sizes and gaps: figures that another machine's last digits move.
    same = _same_but_for_figures if words[:2] == ["rtds", "export"] else str.__eq__
    return wrong + [
        f"{line!r} is not printed"
        for line in lines
        if not SECONDS.fullmatch(line) and not any(same(line, now) for now in rest)
    ]


def _same_but_for_figures(line: str, now: str) -> bool:
    """Whether two lines have the same words, and figures that are the same to a tenth."""
    figures = [[float(f) for f in re.findall(NUMBER, text)] for text in (line, now)]
    return re.sub(NUMBER, "#", line) == re.sub(NUMBER, "#", now) and all(
        math.isclose(a, b, rel_tol=0.1) for a, b in zip(*figures)
    )


def _compare_close(said: str, now: dict[str, Any]) -> list[str]:
    wrong, rows = [], 0
    for words, which in (("in the simulator", "simulator"), ("in the diagnosis' replay", "replay")):
        for m in re.finditer(rf"{words} +({NUMBER}|-) +({NUMBER}|-) +(?:({NUMBER}) %|-)", said):
            rows += 1
            gap = now["gap"][which]
            wrong += [
                f"{words}: gap {key} {value}, now {gap[key]}"
                for key, value in zip(("before", "after"), m.groups())
                if (value == "-") != (gap[key] is None) or value != "-" and not near_gap(float(value), gap[key])
            ]
            closed = None if m[3] is None else float(m[3]) / 100.0
            if (
                (closed is None) != (gap["closed"] is None)
                or closed is not None
                and not near_share(closed, gap["closed"])
            ):
                wrong.append(f"{words}: closed {closed}, now {gap['closed']}")
    return wrong if rows else ["no gap below the command"]


def value_at(folder: Path, file: str, key: str) -> tuple[Any, Any]:
    """The value that a mark in a sentence names, and what holds it.

    Raises
    ------
    KeyError : there is no such file, key or entry.
    """
    try:
        value: Any = json.loads((folder / file).read_text(encoding="utf-8"))
        holder: Any = None
        for part in key.split("."):
            holder, value = value, value[int(part)] if isinstance(value, list) else value[part]
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise KeyError(f"{file} {key}") from error
    return value, holder


def compare_prose(page: str, folder: Path) -> list[str]:
    """What marked figures and words of a page's sentences say that the files left by its commands do not."""
    wrong = []
    for m in PROSE.finditer(page):
        try:
            now, holder = value_at(folder, m["file"], m["key"])
        except KeyError:
            wrong.append(f"{m['said']}: {m['file']} has no {m['key']}")
            continue
        where = m["key"]
        if isinstance(now, str):
            wrong += [] if m["said"] == now else [f"{where}: {m['said']}, now {now}"]
            continue
        percent = m["said"].endswith("%")
        try:
            said = float(m["said"].rstrip("%").rstrip()) / (100.0 if percent else 1.0)
        except ValueError:
            wrong.append(f"{where}: {m['said']} is not a number, now {now}")
            continue
        if where.endswith(".value"):
            wrong += _compare_size(where, said, holder)
        else:
            wrong += compare_json(said, now, where)
    return wrong
