"""Scoring of sealed answers, the way people who judge diagnoses would.

Every share comes with its Wilson interval (Wilson 1927, 95 %). Closure is measured here, on runs that no diagnoser
saw, with a gap of the scorer's own (`gap.py`), the nominal robot of the planar world before and the diagnoser's
`rtds predict` after.
"""

from __future__ import annotations

import csv
import hashlib
import json
import math
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rtds_host.blind import formed
from rtds_host.blind.cases import KINDS, TIERS, WORLDS
from rtds_host.blind.gap import channel_gaps, total
from rtds_host.blind.planar import noises, nominal_machine, replay_gap
from rtds_host.blind.seal import check_truths, hash_file, open_truths, what_was_drawn
from rtds_host.blind.vocabulary import EFFECTS
from rtds_host.cleanup import run_supervised, temporary_folder
from rtds_host.contract import load_robot, read_run, write_atomic
from rtds_host.errors import InputError
from rtds_host.figures import name_ticks, save

VISIBLE_SIGMA = 5.0  # smaller effects are reported apart
ASKED_GAP = 1.5  # an effect whose absence leaves less is not asked for
REST_GAP = 1.2  # nor is the place of a rest that is hardly there
LEAST_CLOSABLE = 0.2  # of less, a share of what can be closed says nothing
LARGEST_SET = 3  # larger declared sets count as no answer (contract, section 5)
SCHEMA = "rtds-blind-score/1"
PACKAGE = Path(__file__).parents[1]


def wilson(hits: int, count: int, z: float = 1.959964) -> tuple[float, float]:
    """95 % interval of a share (Wilson's score interval); (0, 1) for no trial."""
    if count == 0:
        return 0.0, 1.0
    p, z2 = hits / count, z * z
    middle = (p + z2 / (2 * count)) / (1 + z2 / count)
    half = z / (1 + z2 / count) * math.sqrt(p * (1 - p) / count + z2 / (4 * count * count))
    return max(0.0, middle - half), min(1.0, middle + half)


def predict_command() -> list[str]:
    """Command of the project's own prediction; ``RUN --robot R --diagnosis D --out F`` is added behind it."""
    return [sys.executable, "-m", "rtds_host.cli.main", "predict"]


def _read_prediction(path: Path) -> dict[str, np.ndarray]:
    with open(path, newline="") as stream:
        rows = list(csv.reader(stream))
    table = np.array([[float(cell) for cell in row] for row in rows[1:]])
    return {name: table[:, k] for k, name in enumerate(rows[0])}


def pooled(gaps: list[dict[str, float]]) -> dict[str, float]:
    """Root mean square of each channel's gap over runs."""
    names = sorted({name for gap in gaps for name in gap})
    return {name: float(np.sqrt(np.mean([gap[name] ** 2 for gap in gaps if name in gap]))) for name in names}


def predicted(run: Path, robot: Path, diagnosis: Path, command: list[str] | None = None) -> dict[str, np.ndarray] | str:
    """A run replayed with a diagnosis by the program's own `rtds predict`: column -> (n,), or its last complaint."""
    with temporary_folder() as scratch:
        target = scratch / "pred.csv"
        done = run_supervised(
            [
                *(command or predict_command()),
                str(run),
                "--robot",
                str(robot),
                "--diagnosis",
                str(diagnosis),
                "--out",
                str(target),
            ]
        )
        if done.returncode or not target.is_file():
            return (done.stderr.strip().splitlines() or ["no prediction"])[-1][:300]
        return _read_prediction(target)


def share_closed(before: float, after: float) -> float | None:
    """Share of a gap that is closed (contract, section 4); None where there was hardly one."""
    return round((before - after) / (before - 1), 4) if before >= 1.1 else None


def closure(
    case: Path, held_out: Path, diagnosis: Path, command: list[str] | None = None, rounded: dict | None = None
) -> dict:
    """Gap before and after on the held-out runs of a case; `rounded`: noise of channels that a logger rounds.

    Returns
    -------
    {"before", "after", "closed" (None where before is below 1.1), "channels": {name: [before, after]}, "runs": closed
    of each run} or {"error": last line of the prediction's complaint}.
    """
    robot = load_robot(case / "robot.toml")
    noise = noises(robot, rounded)
    before, after = [], []
    for folder in sorted(p for p in held_out.iterdir() if p.is_dir()):
        run = read_run(folder, robot)
        before.append(replay_gap(nominal_machine(robot), robot, run, rounded))
        columns = predicted(folder, case / "robot.toml", diagnosis, command)
        if isinstance(columns, str):
            return {"error": columns}
        after.append(channel_gaps(run.t, run.columns, columns, noise))
    b, a = pooled(before), pooled(after)
    start, end = total(b), total(a)
    return {
        "before": round(start, 4),
        "after": round(end, 4),
        "closed": share_closed(start, end),
        "runs": [share_closed(total(one), total(other)) for one, other in zip(before, after)],
        "channels": {name: [round(b[name], 3), round(a[name], 3)] for name in b if name in a},
    }


def _parameters(truth: dict, included: dict) -> list[dict]:
    """Error and coverage of each parameter of an effect that was found."""
    out = []
    for name, value in truth["parameters"].items():
        given = included.get("parameters", {}).get(name)
        if not isinstance(given, dict) or given.get("value") is None:
            continue
        error = given["value"] - value
        if name == "phase_rad":
            error = math.remainder(error, 2 * math.pi)
            relative = error / math.pi
        else:
            relative = error / abs(value) if value else math.inf
        interval = given.get("ci90")
        covered = None
        if interval and all(isinstance(x, (int, float)) for x in interval):
            covered = bool(interval[0] <= value <= interval[1])
            if name == "phase_rad":
                middle, half = (interval[0] + interval[1]) / 2, (interval[1] - interval[0]) / 2
                covered = bool(abs(math.remainder(value - middle, 2 * math.pi)) <= half)
        out.append(
            {
                "effect": truth["id"],
                "name": name,
                "truth": value,
                "value": given["value"],
                "relative_error": round(relative, 5),
                "covered": covered,
            }
        )
    return out


def said_of_residual(answer: dict) -> str | None:
    """Subsystem in which an answer places what it has no name for.

    Schema 2 says so (`gap.rest`, or else the largest placed rest of the budget); schema 1 only by the place that it
    attributes most to without naming an effect there.
    """
    rest = (answer.get("gap") or {}).get("rest") or {}
    if rest.get("subsystem"):
        return rest["subsystem"]
    placed = [part for part in answer.get("budget") or [] if part.get("what") == "rest" and part.get("subsystem")]
    if placed:
        return max(placed, key=lambda part: part.get("share") or 0)["subsystem"]
    named = {EFFECTS[e["id"]][0] for e in answer.get("effects") or [] if e["id"] in EFFECTS}
    return next((part["subsystem"] for part in answer.get("located") or [] if part["subsystem"] not in named), None)


Cause = tuple[str, str]  # an effect's id and its side


@dataclass(frozen=True)
class Named:
    """What an answer names, next to what is there.

    actual : causes that are there. shaped : nearest names of what is there in another form. included : causes that are
    named. sets : declared sets that are small enough and hold a named one.
    """

    actual: set[Cause]
    shaped: set[str]
    included: list[Cause]
    sets: list[set[Cause]]

    @classmethod
    def of(cls, truth: dict, answer: dict) -> Named:
        """Of an opened truth and an answer, which may lack any part."""
        included = [(e["id"], e["side"]) for e in answer.get("effects") or []]
        sets = [{(e["id"], e["side"]) for e in group} for group in answer.get("indistinguishable") or []]
        return cls(
            {(e["id"], e["side"]) for e in truth["effects"]},
            {name for form in truth.get("forms", ()) for name in form["names"]},
            included,
            [group for group in sets if len(group) <= LARGEST_SET and group & set(included)],
        )

    @property
    def reached(self) -> set[Cause]:
        """Causes that are there and are named, or are in a declared set."""
        return {e for e in self.actual if e in self.included or any(e in group for group in self.sets)}

    @property
    def false(self) -> list[Cause]:
        """Named causes that are neither there nor declared to be confusable with one that is.

        What is there in another form counts under its nearest names, on whichever side of a robot.
        """
        return [
            b
            for b in self.included
            if b not in self.actual
            and b[0] not in self.shaped
            and not any(
                b in group and (group & self.actual or {name for name, _ in group} & self.shaped) for group in self.sets
            )
        ]

    @property
    def said(self) -> set[str]:
        """Ids that are named, or are in a declared set."""
        return {name for name, _ in self.included} | {name for group in self.sets for name, _ in group}

    @property
    def sizes(self) -> list[int]:
        """The smallest declared set around each cause that was reached."""
        return [min((len(group) for group in self.sets if e in group), default=1) for e in self.reached]


def judge(truth: dict, answer: dict | None, entry: dict) -> dict:
    """What one answer is worth.

    Parameters
    ----------
    truth : opened truth. answer : `diagnosis.json`, None where there is none. entry : the ledger's line.

    Returns
    -------
    dict of figures; a figure that does not apply to the case is None.
    """
    given = answer or {"verdict": None}
    named = Named.of(truth, given)
    return {
        "tier": truth["tier"],
        "world": truth.get("world", "planar"),
        "kind": truth["verdict"],
        "truth": sorted(map(list, named.actual)),
        "outside": truth.get("outside", {}).get("id"),
        "size_sigma": truth.get("size_sigma"),
        "seconds": entry["seconds"],
        "answered": answer is not None,
        "said": entry["said"] if answer is None else "",
        **_asked_and_named(truth, given, named),
        **_what_is_right(truth, given, named),
        **_sizes_and_probabilities(truth, given, named),
    }


def _asked_and_named(truth: dict, answer: dict, named: Named) -> dict:
    """What was to be found, what was named, and where what has no name was placed."""
    rest, forms = truth.get("rest"), truth.get("forms", ())
    worth = [(e["id"], e["side"]) for e in truth["effects"] if e.get("gap_without", ASKED_GAP) >= ASKED_GAP]
    placed, false = said_of_residual(answer), named.false
    return {
        "verdict": answer.get("verdict"),
        "included": [list(b) for b in named.included],
        "located": [part["subsystem"] for part in answer.get("located") or []][:3],
        "verdict_right": answer.get("verdict") in (("known", "partial") if rest or forms else (truth["verdict"],)),
        "asked": [[*effect, effect in named.reached] for effect in worth]
        + [[form["id"], form["side"], bool(named.said & set(form["names"]))] for form in forms if form["matters"]],
        "named": [[*b, b not in false] for b in named.included],
        "rest": rest and rest["id"],
        "rest_said": placed,
        "rest_right": placed == rest["subsystem"] if rest and rest["gap_without"] >= REST_GAP else None,
        "closable": closable(truth),
        # The interval is that of effects alone, and a prediction has the forms in it (contract, section 5).
        "closed_ci90": None if answer.get("forms") else (answer.get("gap") or {}).get("closed_ci90"),
    }


def _what_is_right(truth: dict, answer: dict, named: Named) -> dict:
    """Shares that the page counts, each None where the case's kind does not ask for it."""
    kind, actual, included = truth["verdict"], named.actual, named.included
    known, reached, false, sizes = kind == "known", named.reached, named.false, named.sizes
    located = [part["subsystem"] for part in answer.get("located") or []]
    subsystems = {e["subsystem"] for e in truth["effects"]}
    if kind == "unknown":
        subsystems.add(truth["outside"]["subsystem"])
    return {
        "cause_right": (set(included) == actual) if known else None,
        "first_right": (bool(included) and included[0] in actual) if known else None,
        "id_right": ({b[0] for b in included} == {a[0] for a in actual}) if known else None,
        "in_set": (len(reached) == len(actual) and not false) if known else None,
        "any_right": bool(set(included) & actual or reached) if known else None,
        "set_size": max(sizes) if known and sizes else None,
        "subsystem_right": (bool(located) and located[0] in subsystems) if kind != "none" else None,
        "false_cause": bool(included) if kind == "none" else None,
        "extra_cause": bool(false) if known else None,
        "unknown_right": (answer.get("verdict") == "unknown") if kind == "unknown" else None,
        "wrongly_unknown": (answer.get("verdict") == "unknown") if kind != "unknown" else None,
    }


def _sizes_and_probabilities(truth: dict, answer: dict, named: Named) -> dict:
    """Errors of the parameters of what was found, and each stated probability with whether it is true."""
    effects = answer.get("effects") or []
    return {
        "parameters": [
            p
            for e in truth["effects"]
            for b in effects
            if (b["id"], b["side"]) == (e["id"], e["side"])
            for p in _parameters(e, b)
        ],
        "calibration": [
            [e.get("probability"), (e["id"], e["side"]) in named.actual]
            for e in effects
            if e.get("probability") is not None
        ],
    }


def closable(truth: dict) -> float | None:
    """Share of the gap on the held-out runs that all effects with a name close; None where the truth does not say."""
    gaps = truth.get("held_out_gap")
    return share_closed(gaps["before"], gaps["known"]) if gaps else None


# Next to the page of figures.
PICTURES = ("confusion.png", "calibration.png")
FIGURES = (
    ("verdict_right", "verdict right"),
    ("cause_right", "cause and side right, nothing else named"),
    ("first_right", "strongest named effect is true"),
    ("id_right", "cause right, side aside"),
    ("in_set", "right or in a declared set of at most 3"),
    ("any_right", "at least one true effect found"),
    ("subsystem_right", "subsystem right"),
    ("extra_cause", "an effect named that is not there"),
    ("false_cause", "false cause on a case without effect"),
    ("unknown_right", "unknown recognised"),
    ("wrongly_unknown", "wrongly unknown"),
    ("rest_right", "place of the unmodelled part right"),
    ("false_form", "a form where everything has a name"),
)
# Shares over effects and runs of all cases of a group.
POOLED = (
    ("asked", f"effects worth {ASKED_GAP:g} or more that are named, or in a set of at most {LARGEST_SET}"),
    ("named", "named effects that are there, or in such a set"),
    ("coverage90", "90 % intervals of sizes that hold the truth"),
    ("fresh_held", "90 % intervals of the closure that hold a fresh run's"),
    ("formed", f"unmodelled functions of a state with a form that closes {formed.CLOSES:g} or more of them"),
)


def share(records: list[dict], figure: str) -> dict | None:
    """Hits, count, share and Wilson interval of one figure; None where it applies to no record."""
    values = [record[figure] for record in records if record.get(figure) is not None]
    if not values:
        return None
    hits = sum(map(bool, values))
    low, high = wilson(hits, len(values))
    return {
        "hits": hits,
        "count": len(values),
        "share": round(hits / len(values), 4),
        "wilson95": [round(low, 4), round(high, 4)],
    }


def summarise(records: list[dict]) -> dict:
    """All figures of a group of records."""
    closed = [
        r["closure"]["closed"]
        for r in records
        if r["kind"] == "known" and r.get("closure") and r["closure"].get("closed") is not None
    ]
    parameters = [p for r in records for p in r["parameters"]]
    pools = {
        "asked": [e[-1] for r in records for e in r["asked"]],
        "named": [e[-1] for r in records for e in r["named"]],
        "coverage90": [p["covered"] for p in parameters if p["covered"] is not None],
        "fresh_held": [held for r in records for held in fresh_held(r)],
        "formed": [right for r in records for *_, right in r.get("formed", ())],
    }
    reach = [
        r["closure"]["closed"] / r["closable"]
        for r in records
        if r.get("closure") and r["closure"].get("closed") is not None and (r["closable"] or 0) >= LEAST_CLOSABLE
    ]
    errors = [abs(p["relative_error"]) for p in parameters if math.isfinite(p["relative_error"])]
    seconds = [r["seconds"] for r in records if r["seconds"] is not None]
    return {
        "cases": len(records),
        "answered": sum(r["answered"] for r in records),
        **{name: share(records, name) for name, _ in FIGURES},
        "predictions_failed": sum(bool(r.get("closure")) and "error" in r["closure"] for r in records),
        "closure": {
            "count": len(closed),
            "median": _rounded(np.median(closed)) if closed else None,
            "quartiles": [_rounded(q) for q in np.percentile(closed, [25, 75])] if closed else None,
        },
        "parameter_error_median": _rounded(np.median(errors)) if errors else None,
        **{name: share([{name: hit} for hit in pools[name]], name) for name, _ in POOLED},
        "of_closable": {"count": len(reach), "median": _rounded(np.median(reach)) if reach else None},
        "seconds_median": _rounded(np.median(seconds)) if seconds else None,
        "seconds_max": _rounded(max(seconds)) if seconds else None,
    }


def fresh_held(record: dict) -> list[bool]:
    """For each held-out run of a case with a gap and an answer with an interval: does it hold the run's closure."""
    interval, measured = record.get("closed_ci90"), record.get("closure") or {}
    if not interval or any(not isinstance(x, (int, float)) for x in interval):
        return []
    return [interval[0] <= closed <= interval[1] for closed in measured.get("runs", ()) if closed is not None]


def _rounded(value: float) -> float:
    return round(float(value), 4)


def calibration(records: list[dict], bins: int = 5) -> list[dict]:
    """Probability against truth: for each bin of stated probability its mean and the share that was true."""
    pairs = np.array([pair for r in records for pair in r["calibration"]], dtype=float).reshape(-1, 2)
    edges = np.linspace(0, 1, bins + 1)
    out = []
    for k in range(bins):
        inside = (pairs[:, 0] >= edges[k]) & ((pairs[:, 0] < edges[k + 1]) | (k == bins - 1))
        count = int(inside.sum())
        if count:
            hits = int(pairs[inside, 1].sum())
            low, high = wilson(hits, count)
            out.append(
                {
                    "stated": _rounded(pairs[inside, 0].mean()),
                    "true": _rounded(hits / count),
                    "count": count,
                    "wilson95": [_rounded(low), _rounded(high)],
                }
            )
    return out


def confusion(records: list[dict]) -> tuple[list[str], list[str], np.ndarray]:
    """Rows: what was there (single effects, none, unknown). Columns: what was included first.

    Returns
    -------
    (row labels, column labels, counts (rows, columns)).
    """
    order = [*EFFECTS, "none", "unknown"]
    cells: dict[tuple[str, str], int] = {}
    for r in records:
        if len(r["truth"]) > 1 or not r["answered"]:
            continue
        row = r["truth"][0][0] if r["truth"] else r["kind"]
        column = (
            r["included"][0][0]
            if r["included"] and r["verdict"] != "unknown"
            else ("unknown" if r["verdict"] == "unknown" else "none")
        )
        cells[row, column] = cells.get((row, column), 0) + 1

    def place(name: str) -> int:
        return order.index(name) if name in order else len(order)

    rows = sorted({row for row, _ in cells}, key=place)
    columns = sorted({column for _, column in cells} | set(rows), key=place)
    counts = np.zeros((len(rows), len(columns)), dtype=int)
    for (row, column), count in cells.items():
        counts[rows.index(row), columns.index(column)] = count
    return rows, columns, counts


def draw(records: list[dict], folder: Path) -> None:
    """Write `PICTURES`."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    rows, columns, counts = confusion(records)
    if rows:
        figure, axes = plt.subplots(figsize=(3.5 + 0.28 * len(columns), 2.5 + 0.28 * len(rows)), layout="tight")
        shown = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
        axes.imshow(shown, cmap="Blues", vmin=0, vmax=1, aspect="auto")
        for (k, j), count in np.ndenumerate(counts):
            if count:
                axes.text(
                    j,
                    k,
                    str(count),
                    ha="center",
                    va="center",
                    fontsize=7,
                    color="white" if shown[k, j] > 0.6 else "black",
                )
        # The columns are what a diagnoser, of whatever make, has named.
        name_ticks(axes.xaxis, columns, rotation=90, fontsize=7)
        name_ticks(axes.yaxis, rows, fontsize=7)
        axes.set_xlabel("included first")
        axes.set_ylabel("what was there (single effects)")
        save(figure, folder / "confusion.png", dpi=130, metadata={"Software": None})
        plt.close(figure)
    points = calibration(records)
    figure, axes = plt.subplots(figsize=(4.2, 4.0), layout="tight")
    axes.plot([0, 1], [0, 1], color="0.7", lw=1)
    if points:
        x, y = [p["stated"] for p in points], [p["true"] for p in points]
        spread = [[p["true"] - p["wilson95"][0] for p in points], [p["wilson95"][1] - p["true"] for p in points]]
        axes.errorbar(x, y, yerr=np.maximum(spread, 0), fmt="o", capsize=3)
        for p in points:
            axes.annotate(
                f"n = {p['count']}", (p["stated"], p["true"]), xytext=(4, -10), textcoords="offset points", fontsize=7
            )
    axes.set(xlabel="stated probability", ylabel="share that is true (95 % Wilson)", xlim=(0, 1.02), ylim=(0, 1.02))
    save(figure, folder / "calibration.png", dpi=130, metadata={"Software": None})
    plt.close(figure)


def _write_table(records: list[dict], path: Path) -> None:
    """One row a case; what was there and what was included as text."""
    import io

    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = []
    for r in records:
        measured = r["closure"] or {}
        row = {
            name: r[name]
            for name in (
                "case",
                "tier",
                "world",
                "kind",
                "verdict",
                "size_sigma",
                "seconds",
                "answered",
                "set_size",
                *(name for name, _ in FIGURES),
            )
        }
        row["there"] = ", ".join(f"{i} {s}" for i, s in r["truth"]) or (r["outside"] or "")
        row["included"] = ", ".join(f"{i} {s}" for i, s in r["included"])
        row.update({name: measured.get(name) for name in ("before", "after", "closed")})
        rows.append(row)
    buffer = io.BytesIO()
    pq.write_table(pa.Table.from_pylist(rows), buffer, compression="zstd")
    write_atomic(path, buffer.getvalue())


def open_answers(out: Path, diagnoses: Path) -> tuple[dict[str, dict], dict[str, dict], list[dict]]:
    """Truths, and the diagnoses of a folder that has one a case: `DIAGNOSES/<case>/diagnosis.json`.

    For whoever made the cases and looks while working: no ledger, nothing says that these answers were blind.

    Returns
    -------
    (truths, answers, ledger) as `seal.open_truths`; the ledger's lines hold what a batch of diagnoses wrote down of
    its times.

    Raises
    ------
    InputError : a truth or case was changed, the folder holds no diagnosis of these cases, or one is no JSON.
    """
    import pyarrow.parquet as pq

    truths, answers = check_truths(out), {}
    table = diagnoses / "cases.parquet"
    seconds = {row["case"]: row.get("seconds") for row in pq.read_table(table).to_pylist()} if table.is_file() else {}
    ledger = []
    for case in truths:
        path = diagnoses / case / "diagnosis.json"
        if path.is_file():
            try:
                answers[case] = json.loads(path.read_text())
            except ValueError as error:
                raise InputError(f"{path}: is not JSON ({error})") from error
        ledger.append(
            {
                "case": case,
                "seconds": seconds.get(case),
                "said": "",
                "quick": False,
                "sha256": hash_file(path) if path.is_file() else None,
            }
        )
    if not answers:
        raise InputError(f"{diagnoses}: holds no diagnosis of a case of {out} ({next(iter(truths))}/diagnosis.json, …)")
    return truths, answers, ledger


def program_state() -> str:
    """SHA-256 of the sources that predict and judge: what another state measured is measured again."""
    sources = sorted(PACKAGE.rglob("*.py"))
    return hashlib.sha256("".join(f"{p.relative_to(PACKAGE)} {hash_file(p)}\n" for p in sources).encode()).hexdigest()


def score(
    out: Path,
    jobs: int = 1,
    command: list[str] | None = None,
    with_closure: bool = True,
    progress=None,
    diagnoses: Path | None = None,
) -> dict:
    """Open the truth, check every hash, judge every answer, write `OUT/score/`.

    With `diagnoses`, a folder with a diagnosis a case, these are judged in place of the sealed answers, and
    `DIAGNOSES/score/` is written.

    Returns
    -------
    The content of `score.json`: groups ("everything", every tier, every world), calibration, one record a case.

    Raises
    ------
    InputError : anything was tampered with, or not every case has been asked (see `seal.open_truths`).
    """
    truths, answers, ledger = open_answers(out, diagnoses) if diagnoses else open_truths(out)
    by_case = {entry["case"]: entry for entry in ledger}
    folder = (diagnoses or out) / "score"
    said = diagnoses or out / "answers"
    program = program_state()

    def one(case: str) -> dict:
        truth, answer, diagnosis = truths[case], answers.get(case), said / case / "diagnosis.json"
        record = {"case": case, **judge(truth, answer, by_case[case]), "closure": None}

        def closed(diagnosis: Path) -> dict:
            held_out = out / "sealed" / case / "held-out"
            return closure(out / "public" / case, held_out, diagnosis, command, truth.get("noise"))

        if case in answers and with_closure:
            record["closure"] = _closure_kept(
                folder / "cases" / f"{case}.json",
                [by_case[case]["sha256"], program],
                lambda: {**closed(diagnosis), "effects_alone": formed.effects_alone(diagnosis, closed)},
            )
        record["formed"] = formed.judged(truth, answer, record["closure"])
        record["false_form"] = formed.false_form(truth, answer)
        return record

    records = []
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        for done, record in enumerate(pool.map(one, sorted(truths)), 1):
            records.append(record)
            if progress:
                progress(done, len(truths))
    result = _summary(records, what_was_drawn(out), ledger, blind=diagnoses is None)
    folder.mkdir(parents=True, exist_ok=True)
    write_atomic(folder / "score.json", json.dumps(result, indent=1) + "\n")
    draw(records, folder)
    _write_table(records, folder / "cases.parquet")
    write_atomic(folder / "page.md", page(result))
    return result


def _closure_kept(store: Path, mark: list, measure: Callable[[], dict]) -> dict:
    """What was closed in a case, from `store` where it was measured of the same answer by the same program (`mark`)."""
    if store.is_file():
        old = json.loads(store.read_text())
        if old.get("answer") == mark and "runs" in old["closure"]:
            return old["closure"]
    found = measure()
    write_atomic(store, json.dumps({"answer": mark, "closure": found}) + "\n")
    return found


def _summary(records: list[dict], seed: dict, ledger: list[dict], blind: bool) -> dict:
    """The content of `score.json`; seed : what was drawn; blind : the answers were sealed before the truth."""
    # Without a size in sigmas an effect was drawn to be seen.
    visible = [
        r for r in records if r["kind"] != "known" or r["size_sigma"] is None or r["size_sigma"] >= VISIBLE_SIGMA
    ]
    return {
        "schema": SCHEMA,
        "seed": seed["seed"],
        "count": seed["count"],
        "made_by": made_by(seed),
        "quick": any(entry.get("quick") for entry in ledger),
        "blind": blind,
        "everything": summarise(records),
        "visible": summarise(visible),
        "tiers": {
            tier: summarise([r for r in visible if r["tier"] == tier])
            for tier in KINDS
            if any(r["tier"] == tier for r in visible)
        },
        "worlds": {
            world: summarise([r for r in visible if r["world"] == world])
            for world in sorted({r["world"] for r in visible})
        },
        "hardly_visible": summarise([r for r in records if r not in visible]),
        "calibration": calibration(records),
        "cases": records,
    }


def share_cell(value: dict | None) -> str:
    if value is None:
        return "–"
    low, high = value["wilson95"]
    return f"{100 * value['share']:.0f} % ({value['hits']}/{value['count']}; {100 * low:.0f}–{100 * high:.0f})"


def made_by(drawn: dict) -> str:
    """The command that draws the same cases again."""
    only = "".join(f" --tier {tier}" for tier in drawn["tiers"]) if set(drawn["tiers"]) != set(TIERS) else ""
    only += "".join(f" --world {world}" for world in drawn["worlds"]) if set(drawn["worlds"]) != set(WORLDS) else ""
    return f"rtds blind make --n {drawn['count']} --seed {drawn['seed']}{only}"


def by_effect(records: list[dict]) -> list[tuple[str, int, int, int, int]]:
    """(effect, times asked for, times reached, times named, times named rightly), by name."""
    counts: dict[str, list[int]] = {}
    for r in records:
        for name, _, hit in r["asked"]:
            row = counts.setdefault(name, [0, 0, 0, 0])
            row[0] += 1
            row[1] += hit
        for name, _, hit in r["named"]:
            row = counts.setdefault(name, [0, 0, 0, 0])
            row[2] += 1
            row[3] += hit
    return [(name, row[0], row[1], row[2], row[3]) for name, row in sorted(counts.items())]


def _closure(t: dict) -> str:
    """Median and quartiles of what was closed."""
    c = t["closure"]
    return "–" if c["median"] is None else f"{c['median']:.2f} ({c['quartiles'][0]:.2f} to {c['quartiles'][1]:.2f})"


def _case_row(r: dict) -> str:
    """The row of one case: what was there against what was named."""
    missed = {(name, side) for name, side, hit in r["asked"] if not hit}
    there = ", ".join(f"**{i} {s}**" if (i, s) in missed else f"{i} {s}" for i, s in r["truth"]) or (
        f"outside: {r['outside']}" if r["outside"] else "nothing"
    )
    there += f"; rest: {r['rest']}" if r["rest"] else ""
    included = ", ".join(f"{i} {s}" for i, s in r["included"]) or "nothing"
    c = r["closure"] or {}
    return (
        f"| {r['case']} | {r['tier']} | {r['world']} | {there} | {included} | {r['verdict'] or 'no answer'} |"
        f" {r['size_sigma'] if r['size_sigma'] is not None else '–'} |"
        f" {'–' if c.get('closed') is None else format(c['closed'], '.2f')} |"
        f" {'–' if r['seconds'] is None else format(r['seconds'], '.0f')} s |"
    )


def page(result: dict) -> str:
    """A page in Markdown with the figures of a scored check."""
    groups = [*result["tiers"], "visible", *result["worlds"]]
    tables = {**result["tiers"], "visible": result["visible"], **result["worlds"]}
    titles = {"visible": "all tiers", "planar": "planar world", "mujoco": "MuJoCo world"}
    lines = [
        "# Blind check: figures of one run",
        "",
        (
            f"{result['count']} sealed cases, seed {result['seed']}, made by `{result['made_by']}`, "
            + (
                f"answered by `rtds blind answer{' --quick' if result['quick'] else ''}`, scored by `rtds blind"
                " score`. "
                if result["blind"]
                else "scored with open truths by `rtds blind score --diagnoses`: not a blind check. "
            )
            + f"Shares with hits, count and the 95 % Wilson interval. Effects below {VISIBLE_SIGMA:g} sigma after the"
            " motors' tolerance is projected off are left out here and reported below."
        ),
        "",
        "| | " + " | ".join(titles.get(g, g) for g in groups) + " |",
        "|---|" + "---|" * len(groups),
    ]
    lines.append(
        "| cases (answered) | " + " | ".join(f"{tables[g]['cases']} ({tables[g]['answered']})" for g in groups) + " |"
    )
    for name, title in FIGURES:
        lines.append(f"| {title} | " + " | ".join(share_cell(tables[g][name]) for g in groups) + " |")

    def line(title: str, text) -> str:
        return f"| {title} | " + " | ".join(text(tables[g]) for g in groups) + " |"

    lines.append(line("closure on unseen runs, median (quartiles)", _closure))
    lines.append(
        line(
            "of what the known part can close, median",
            lambda t: "–" if t["of_closable"]["median"] is None else f"{t['of_closable']['median']:.2f}",
        )
    )
    lines.append(line("predictions that failed", lambda t: str(t["predictions_failed"])))
    lines.append(
        line(
            "parameter error, median",
            lambda t: "–" if t["parameter_error_median"] is None else f"{100 * t['parameter_error_median']:.1f} %",
        )
    )
    for name, title in POOLED:
        lines.append(line(title, lambda t, name=name: share_cell(t[name])))
    lines.append(
        line(
            "time a case, median (longest)",
            lambda t: "–" if t["seconds_median"] is None else f"{t['seconds_median']:.0f} s ({t['seconds_max']:.0f} s)",
        )
    )
    small = result["hardly_visible"]
    lines += [
        "",
        (
            f"Hardly visible effects: {small['cases']} cases, cause and side right {share_cell(small['cause_right'])}, "
            f"in a set {share_cell(small['in_set'])}, otherwise nothing named or something else."
        ),
        "",
        "![what was there against what was named](confusion.png)",
        "",
        "![stated probability against truth](calibration.png)",
        "",
        "| effect | asked for | named, or in a set | all named | of these there, or in a set |",
        "|---|---|---|---|---|",
        *(
            f"| {name} | {asked} | {reached} | {named} | {right} |"
            for name, asked, reached, named, right in by_effect(result["cases"])
        ),
        "",
        "In bold what is worth asking for and was not reached.",
        "",
        "| case | kind | world | there | named | verdict | size (sigma) | closed | time |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [_case_row(r) for r in result["cases"]]
    return "\n".join(lines) + "\n"
