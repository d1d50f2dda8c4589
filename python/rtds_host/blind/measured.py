"""Sealed draws on measured data: one thing is planted in the logs of a real machine, and must be found.

Nobody knows the whole truth of a real machine, but whoever declares its mass 20 % too high knows that much. From every
data set come one untouched case, the base, and so many planted ones, shuffled and named alike; all are sealed, answered
and opened like the other blind cases (`seal.py`). The diagnoser cannot tell the base from the rest.

Some runs of each data set, the same for all its cases, are withheld from the diagnoser. On them the score measures how
much of the gap that the planted change opened is closed again.
"""

from __future__ import annotations

import json
import math
import secrets
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from rtds_host.blind.gap import channel_gaps, total
from rtds_host.blind.plants import Plant, kinds
from rtds_host.blind.score import pooled, predicted, share
from rtds_host.blind.seal import lock, open_truths, publish, refuse_again, what_was_drawn
from rtds_host.blind.vocabulary import EFFECTS
from rtds_host.cleanup import temporary_folder
from rtds_host.compat import tomllib
from rtds_host.contract import (
    Case,
    Robot,
    RunLog,
    load_robot,
    places_of_case,
    read_case,
    read_run,
    refuse_inputs,
    write_atomic,
    write_run,
)
from rtds_host.errors import InputError
from rtds_host.vectors import given

KIND = "measured"
SCHEMA = "rtds-blind-measured/1"
DRAWS = 20
# One run in so many is withheld (none of a single run).
WITHHELD_SHARE = 4
# A planted change counts as visible where it outweighs all that the machine leaves anyway: twice its mean square.
VISIBLE = math.sqrt(2.0)
# A size counts as right within this factor.
FACTOR = 2.0
# Of these delays one may be in the base and another in the answer; the answer's then holds both sizes.
DELAYS = {"measurement_delay": "seconds", "command_delay": "seconds", "speed_filter": "time_constant_s"}
# What an effect has that is not there, of a ratio (True) and of anything else.
ABSENT = {True: 1.0, False: 0.0}
# A form of an effect that holds another one as a part of it.
WIDER = {"stribeck_friction": "coulomb_friction"}


def dump_toml(data: dict) -> str:
    """A robot.toml (tables of plain values) without the comments it may have had: they may tell the former value."""

    def text(value: object) -> str:
        return json.dumps(value) if isinstance(value, (str, bool)) else repr(value)

    lines = [f"{key} = {text(value)}" for key, value in data.items() if not isinstance(value, dict)]
    for name, table in data.items():
        if isinstance(table, dict):
            lines += ["", f"[{name}]", *(f"{key} = {text(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def _write_run(run: RunLog, plant: Plant | None, folder: Path) -> None:
    t, columns = plant.alter(run) if plant is not None and plant.alter is not None else (run.t, run.columns)
    write_run(folder, run.meta, {"t": t, **columns}, form="parquet")


def _write_case(case: Case, plant: Plant | None, withheld: set[str], public: Path, sealed: Path) -> None:
    """A case as planted: what the diagnoser may see, and the withheld runs next to the truth."""
    data = tomllib.loads((given(case.path, "case.path") / "robot.toml").read_text())
    for (section, key), value in (plant.declared if plant is not None else {}).items():
        data.setdefault(section, {})[key] = value
    data["name"] = "measured"
    public.mkdir(parents=True)
    (sealed / "held-out").mkdir(parents=True)
    (public / "robot.toml").write_text(dump_toml(data))
    for run in case.runs:
        _write_run(run, plant, (sealed / "held-out" if run.name in withheld else public) / run.name)


def make_measured(
    out: Path, cases: list[Path], draws: int | None = None, seed: int | None = None, progress=None
) -> dict[str, str]:
    """Plant `draws` changes in each data set, seal what was planted, publish the seals.

    Parameters
    ----------
    out : folder of the check. cases : case folders of measured data, each a data set; their names must differ.
    draws : planted cases a data set (default 20), next to one that is left as it was.
    seed : default drawn from the system; kept with the sealed truth. progress : called with (done, count).

    Returns
    -------
    case -> seal.

    Raises
    ------
    InputError : a check is there already, a case cannot be read, or two have one name. OutputError : the check would
    take
        the place of a case.
    """
    draws = DRAWS if draws is None else draws
    if draws < 1:
        raise InputError(f"{draws} draws: at least 1 is needed")
    refuse_again(out)
    places = [
        folder / f"case-{number:03d}"
        for folder in (out / "public", out / "sealed")
        for number in range(1, len(cases) * (draws + 1) + 1)
    ]
    refuse_inputs(
        [out, out / "public", out / "sealed", *places],
        [place for case in cases for place in places_of_case(Path(case))],
    )
    sets = {}
    for folder in cases:
        case = read_case(folder)
        if case.name in sets:
            raise InputError(f"{folder}: a second data set of the name {case.name!r}")
        sets[case.name] = case
    seed = secrets.randbits(63) if seed is None else seed
    rng = np.random.default_rng(seed)
    plan: list[tuple[str, Plant | None]] = []
    withheld = {}
    for name, case in sets.items():
        runs = [run.name for run in case.runs]
        count = 0 if len(runs) == 1 else max(1, len(runs) // WITHHELD_SHARE)
        withheld[name] = {runs[k] for k in rng.choice(len(runs), count, replace=False)}
        known = kinds(case)
        # Every kind about equally often, in an order that says nothing.
        order = [kind for _ in range(math.ceil(draws / len(known))) for kind in rng.permutation(list(known))][:draws]
        plan += [(name, None), *((name, known[kind](rng)) for kind in order)]
    plan = [plan[k] for k in rng.permutation(len(plan))]
    seals = {}
    for number, (name, plant) in enumerate(plan, 1):
        label = f"case-{number:03d}"
        public, hidden = out / "public" / label, out / "sealed" / label
        shutil.rmtree(public, ignore_errors=True)  # remains of an interrupted make
        shutil.rmtree(hidden, ignore_errors=True)
        _write_case(sets[name], plant, withheld[name], public, hidden)
        truth = {"tier": KIND, "set": name, "kind": "base", "axis": sets[name].robot.axis is not None}
        if plant is not None:
            truth.update(
                kind=plant.kind,
                side=plant.side,
                said=plant.said,
                same=[e.to_json() for e in plant.same],
                alike=[e.to_json() for e in plant.alike],
            )
        seals[label] = lock(truth, public, hidden)
        if progress:
            progress(number, len(plan))
    publish(out, seals, {"kind": KIND, "seed": seed, "count": len(plan), "draws": draws, "sets": list(sets)})
    return seals


def is_measured(out: Path) -> bool:
    """Whether a check was made from measured data."""
    return what_was_drawn(out).get("kind") == KIND


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


class _Answer:
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


def _replaced(want: dict, side: str, answer: _Answer, base: _Answer, sharing: list[dict]) -> float | None:
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


def _match(want: dict, side: str, answer: _Answer, base: _Answer, sharing: list[dict]) -> dict | None:
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
    answer, base = _Answer(said, axis), _Answer(base_said, axis)
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


FIGURES = (
    ("named", "planted cause and side named, size within a factor of two"),
    ("found", "named, or in a declared set of at most 3"),
    ("near", "found, or an effect named that takes its place"),
    ("covered", "named: size within its 90 % interval"),
    ("base_kept", "all that the untouched case names is still named"),
    ("silent", "nothing new seen"),
    ("unknown", "called unknown"),
    ("new_false", "another effect newly named"),
)


def carried_over(diagnosis: dict, base: Robot, planted: Robot) -> dict:
    """The base's answer for the planted robot: what it refitted of R, K, J and B is kept relative to what is
    declared.
    """
    fitted = {
        side: {key: value * getattr(planted.motor, key) / getattr(base.motor, key) for key, value in values.items()}
        for side, values in (diagnosis.get("nominal_fit") or {}).items()
    }
    return {**diagnosis, "nominal_fit": fitted}


def _gap(robot_path: Path, held_out: Path, diagnosis: Path, command: list[str] | None) -> float | str | None:
    """Gap of a diagnosis on the withheld runs: a number, the prediction's complaint, or None without such runs."""
    robot = load_robot(robot_path)
    gaps = []
    for folder in sorted(p for p in held_out.iterdir() if p.is_dir()):
        run = read_run(folder, robot)
        columns = predicted(folder, robot_path, diagnosis, command)
        if isinstance(columns, str):
            return columns
        noise = {name: size for name in run.columns if (size := robot.noise(name))}
        columns.setdefault("yaw", np.zeros(len(run.t)))  # an axis has no heading
        gaps.append(channel_gaps(run.t, run.columns, columns, noise))
    return total(pooled(gaps)) if gaps else None


def score_measured(
    out: Path, jobs: int = 1, command: list[str] | None = None, with_gap: bool = True, progress=None
) -> dict:
    """Open the truth of a check on measured data, check every hash, judge every answer, write `OUT/score/`.

    Returns
    -------
    The content of `score.json`: figures a data set and of all, and one record a case.

    Raises
    ------
    InputError : anything was tampered with, or not every case has been asked (see `seal.open_truths`).
    """
    truths, answers, ledger = open_truths(out)
    entries = {entry["case"]: entry for entry in ledger}
    bases = {truth["set"]: case for case, truth in truths.items() if truth["kind"] == "base"}

    def answered(case: str) -> Path | None:
        return out / "answers" / case / "diagnosis.json" if case in answers else None

    def gap(case: str, answer_of: str) -> float | str | None:
        path = answered(answer_of)
        if path is None or not with_gap:
            return None
        robots = [out / "public" / name / "robot.toml" for name in (answer_of, case)]
        held = out / "sealed" / case / "held-out"
        if case == answer_of:
            return _gap(robots[1], held, path, command)
        with temporary_folder() as scratch:
            carried = scratch / "diagnosis.json"
            carried.write_text(json.dumps(carried_over(answers[answer_of], *map(load_robot, robots))))
            return _gap(robots[1], held, carried, command)

    rest = {name: gap(case, case) for name, case in bases.items()}

    def one(case: str) -> dict:
        truth = truths[case]
        base = bases[truth["set"]]
        record = {"case": case, **judge_planted(truth, answers.get(case), answers.get(base), entries[case])}
        opened, left, bottom = gap(case, base), gap(case, case), rest[truth["set"]]
        record.update(gap_base=bottom, gap_opened=opened, gap_left=left, visible=None, restored=None)
        if isinstance(opened, float) and isinstance(bottom, float):
            record["visible"] = opened >= VISIBLE * bottom
            if record["visible"] and isinstance(left, float):
                record["restored"] = round((opened - left) / (opened - bottom), 4)
        return record

    planted = sorted(case for case, truth in truths.items() if truth["kind"] != "base")
    records = []
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        for done, record in enumerate(pool.map(one, planted), 1):
            records.append(record)
            if progress:
                progress(done, len(planted))
    drawn = what_was_drawn(out)
    result = {
        "schema": SCHEMA,
        "seed": drawn["seed"],
        "draws": drawn["draws"],
        "quick": any(entry.get("quick") for entry in ledger),
        "gaps": with_gap,
        "sets": {name: _group([r for r in records if r["set"] == name]) for name in drawn["sets"]},
        "all": _group(records),
        "bases": {
            name: {
                "verdict": (answers.get(case) or {}).get("verdict"),
                "gap": rest[name],
                "case": case,
                "included": [e["id"] for e in (answers.get(case) or {}).get("effects", [])],
            }
            for name, case in bases.items()
        },
        "cases": records,
    }
    write_atomic(out / "score" / "score.json", json.dumps(result, indent=1) + "\n")
    write_atomic(out / "score" / "page.md", page(result))
    return result


def _group(records: list[dict]) -> dict:
    seen = [r for r in records if r["visible"] is not False]
    restored = [r["restored"] for r in records if r["restored"] is not None]
    errors = [abs(r["size_error"]) for r in seen if r["size_error"] is not None]
    return {
        "cases": len(records),
        "answered": sum(r["answered"] for r in records),
        "visible": len(seen),
        **{name: share(seen, name) for name, _ in FIGURES},
        "size_error_median": round(float(np.median(errors)), 4) if errors else None,
        "restored_median": round(float(np.median(restored)), 4) if restored else None,
        "hidden_named": share([r for r in records if r["visible"] is False], "named"),
        "all_found": share(records, "found"),
        "all_near": share(records, "near"),
    }


def _cell(value: dict | None) -> str:
    if value is None:
        return "–"
    low, high = value["wilson95"]
    return f"{value['hits']}/{value['count']} ({100 * low:.0f} to {100 * high:.0f} %)"


def _number(value: float | str | None, form: str = ".3g") -> str:
    return format(value, form) if isinstance(value, float) else "–"


def page(result: dict) -> str:
    """The figures of a scored check on measured data, in Markdown."""
    sets = {**result["sets"], "all": result["all"]}
    sources = " ".join(f"--measured {name}" for name in result["sets"])
    lines = [
        (
            f"`rtds blind make {sources} --n {result['draws']} --seed {result['seed']} --out check`, `rtds blind"
            f" answer{' --quick' if result['quick'] else ''} --out check`, `rtds blind"
            f" score{'' if result['gaps'] else ' --no-closure'} --out check`."
        ),
        "",
        "| | " + " | ".join(sets) + " |",
        "|---|" + "---|" * len(sets),
        "| draws (answered) | " + " | ".join(f"{g['cases']} ({g['answered']})" for g in sets.values()) + " |",
        *(
            []
            if not result["gaps"]
            else [
                "| of these the planted part outweighs what the machine leaves anyway | "
                + " | ".join(str(g["visible"]) for g in sets.values())
                + " |"
            ]
        ),
    ]
    lines += [f"| {title} | " + " | ".join(_cell(g[name]) for g in sets.values()) + " |" for name, title in FIGURES]
    lines.append(
        "| error of the size, median | "
        + " | ".join(
            "–" if g["size_error_median"] is None else f"{100 * g['size_error_median']:.0f} %" for g in sets.values()
        )
        + " |"
    )
    if result["gaps"]:
        lines.append(
            "| of the gap opened on withheld runs, closed again (median) | "
            + " | ".join(_number(g["restored_median"], ".2f") for g in sets.values())
            + " |"
        )
        lines += [
            f"| of all draws: {title} | " + " | ".join(_cell(g[name]) for g in sets.values()) + " |"
            for name, title in (("all_found", "found"), ("all_near", "found, or one in its place named"))
        ]
    lines.append("")
    for name, base in result["bases"].items():
        lines.append(
            f"{name} untouched: {base['verdict']}, named {', '.join(base['included']) or 'nothing'}, gap "
            f"{_number(base['gap'])} on the withheld runs."
        )
    lines += [
        "",
        "| set | planted | answered | named | in a set or near | size: expected, found | gap: opened, left |",
        "|---|---|---|---|---|---|---|",
    ]
    for r in sorted(result["cases"], key=lambda r: (r["set"], r["kind"], r["case"])):
        m = r["match"]
        size = "–"
        if m and m.get("named"):
            ends = " to ".join(f"{x:.3g}" for x in dict.fromkeys(m["expected"]))
            size = f"{m['effect']}: {ends}, {m['value']:.3g}"
        where = "yes" if r["found"] and not r["named"] else "near" if r["near"] and not r["found"] else ""
        included = ", ".join(r["included"]) or r["verdict"] or "no answer"
        lines.append(
            f"| {r['set']} | {r['said']} | {included} | {'yes' if r['named'] else 'no'} | {where} | {size} | "
            f"{_number(r['gap_opened'])}, {_number(r['gap_left'])} |"
        )
    return "\n".join(lines) + "\n"
