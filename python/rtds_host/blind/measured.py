"""Sealed draws on measured data: one thing is planted in the logs of a real machine, and must be found.

Nobody knows the whole truth of a real machine, but whoever declares its mass 20 % too high knows that much. From every
data set come one untouched case, the base, and so many planted ones, shuffled and named alike; all are sealed, answered
and opened like the other blind cases (`seal.py`). The diagnoser cannot tell the base from the rest.

One run in four of each data set, the same for all its cases, is withheld from the diagnoser. On them the score measures
how much of the gap that the planted change opened is closed again. Of fewer than four runs none is withheld, since what
is left would no longer be that machine's evidence. The gap is then one of runs that the diagnoser saw.

Here the cases are made. `measured_answer.py` judges an answer, `measured_gaps.py` measures gaps, and
`measured_score.py` writes the score.
"""

from __future__ import annotations

import json
import math
import secrets
import shutil
from pathlib import Path

import numpy as np

from rtds_host.blind.plants import Plant, kinds
from rtds_host.blind.seal import lock, publish, refuse_again, what_was_drawn
from rtds_host.compat import tomllib
from rtds_host.contract import Case, RunLog, places_of_case, read_case, refuse_inputs, write_run
from rtds_host.errors import InputError
from rtds_host.vectors import given

KIND = "measured"
DRAWS = 20
# One run in so many is withheld.
WITHHELD_SHARE = 4


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
        withheld[name] = {runs[k] for k in rng.choice(len(runs), len(runs) // WITHHELD_SHARE, replace=False)}
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
