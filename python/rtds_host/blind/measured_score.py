"""The score of a check on measured data, and its page."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from rtds_host.blind.measured_answer import judge_planted
from rtds_host.blind.measured_gaps import UNKNOWN, Gaps
from rtds_host.blind.score import share
from rtds_host.blind.seal import open_truths, what_was_drawn
from rtds_host.contract import write_atomic

SCHEMA = "rtds-blind-measured/1"
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


def score_measured(
    out: Path,
    jobs: int = 1,
    command: list[str] | None = None,
    with_gap: bool = True,
    progress=None,
    fitter: list[str] | None = None,
) -> dict:
    """Open the truth of a check on measured data, check every hash, judge every answer, write `OUT/score/`.

    Parameters
    ----------
    out : folder of the check. jobs : cases at a time. command : replays a run with a diagnosis (default `rtds
    predict`). with_gap : measure gaps. progress : called with (done, count). fitter : prints the gap of a diagnosis'
    effects once they are fitted to a case (default `shown.py`).

    Returns
    -------
    The content of `score.json`: figures a data set and of all, and one record a case.

    Raises
    ------
    InputError : anything was tampered with, or not every case has been asked (see `seal.open_truths`).
    """
    truths, answers, ledger = open_truths(out)
    entries = {entry["case"]: entry for entry in ledger}
    gaps = Gaps(out, truths, answers, command, fitter)
    rest = gaps.rest if with_gap else {}

    def one(case: str) -> dict:
        truth = truths[case]
        judged = judge_planted(truth, answers.get(case), answers.get(gaps.bases[truth["set"]]), entries[case])
        return {"case": case, **judged, **(gaps.judged(case) if with_gap else UNKNOWN)}

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
                "gap": rest.get(name),
                "case": case,
                "included": [e["id"] for e in (answers.get(case) or {}).get("effects", [])],
            }
            for name, case in gaps.bases.items()
        },
        "cases": records,
    }
    write_atomic(out / "score" / "score.json", json.dumps(result, indent=1) + "\n")
    write_atomic(out / "score" / "page.md", page(result))
    return result


def _group(records: list[dict]) -> dict:
    outweighing = [r for r in records if r["visible"] is not False]
    seen = [r for r in outweighing if not r["taken_in"]]
    restored = [r["restored"] for r in records if r["restored"] is not None]
    errors = [abs(r["size_error"]) for r in seen if r["size_error"] is not None]
    return {
        "cases": len(records),
        "answered": sum(r["answered"] for r in records),
        "visible": len(outweighing),
        "judged": len(seen),
        **{name: share(seen, name) for name, _ in FIGURES},
        "size_error_median": round(float(np.median(errors)), 4) if errors else None,
        "restored_median": round(float(np.median(restored)), 4) if restored else None,
        "hidden_named": share([r for r in records if r["visible"] is False], "named"),
        "visible_found": share(outweighing, "found"),
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


def _judged(record: dict) -> str:
    """Whether a planted change is judged, and why not."""
    if record["visible"] is False:
        return "small"
    return "taken in" if record["taken_in"] else "yes"


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
                + " |",
                "| of these no other sizes of the machine's own effects take it in: judged | "
                + " | ".join(str(g["judged"]) for g in sets.values())
                + " |",
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
            "| of the gap opened, closed again (median) | "
            + " | ".join(_number(g["restored_median"], ".2f") for g in sets.values())
            + " |"
        )
        lines += [
            f"| of all draws: {title} | " + " | ".join(_cell(g[name]) for g in sets.values()) + " |"
            for name, title in (("all_found", "found"), ("all_near", "found, or one in its place named"))
        ]
        lines.append(
            "| of all that outweigh the machine's rest: found | "
            + " | ".join(_cell(g["visible_found"]) for g in sets.values())
            + " |"
        )
    lines.append("")
    for name, base in result["bases"].items():
        lines.append(
            f"{name} untouched: {base['verdict']}, named {', '.join(base['included']) or 'nothing'}, gap "
            f"{_number(base['gap'])} on the withheld runs, or on all where none is withheld."
        )
    lines += [
        "",
        "| set | planted | judged | answered | named | in a set or near | size: expected, found | gap: opened, left |",
        "|---|---|---|---|---|---|---|---|",
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
            f"| {r['set']} | {r['said']} | {_judged(r)} | {included} | {'yes' if r['named'] else 'no'} | {where} | "
            f"{size} | {_number(r['gap_opened'])}, {_number(r['gap_left'])} |"
        )
    return "\n".join(lines) + "\n"
