"""Does an answer depend on the declared noise, on which runs were given, or on their last rows? None needs a truth.

``python -m rtds_host.blind.steady CASE… --out DIR [--noise 0.333 --noise 3] [--halves] [--cut 1 --cut 3]`` lets the
diagnoser answer each case as it is, with its `[sensors]` multiplied by each factor, on two disjoint halves of its runs,
or with runs that lack their last rows. It prints how often the names are the same. Answers stay in DIR, and an
interrupted call goes on where it stopped.

Two answers have the same names where each effect that counts in the one is named in the other, or declared there as
indistinguishable from a named one, and the other way round. Which effects count:

- noise: all, where both answers leave a gap above 2. Below that the noise does say how much can be seen.
- halves: those that both halves can show. In each, the gap without the effect is at least 1.5 times the gap with it;
  in the half that names it by the answer's own `gap_without`, in the other half by a fit of the same effects there.
  So the names are counted, not the cases.
- cut runs: those of either answer without which it leaves at least 1.5 times the gap. They, too, are counted.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import sys
from pathlib import Path

from rtds_host.blind.hard import with_noise
from rtds_host.blind.score import ASKED_GAP, LARGEST_SET, wilson
from rtds_host.blind.seal import SHOWER, diagnoser_command
from rtds_host.cleanup import run_supervised, temporary_folder
from rtds_host.contract import read_case, write_run
from rtds_host.contract.output import write_atomic
from rtds_host.errors import InputError

LEFT_GAP = 2.0
NOISE = (1 / 3, 0.5, 2.0, 3.0)

Cause = tuple[str, str]


def named(answer: dict) -> set[Cause]:
    """Effects that an answer names."""
    return {(effect["id"], effect["side"]) for effect in answer["effects"]}


def seen(answer: dict) -> set[Cause]:
    """Effects without which an answer leaves at least `ASKED_GAP` times its gap, or that of noise if it is larger."""
    least = ASKED_GAP * max(answer["gap"]["after"], 1.0)
    # An effect without that figure was named for another reason, so it counts.
    return {(e["id"], e["side"]) for e in answer["effects"] if (e.get("gap_without") or math.inf) >= least}


def said(answer: dict) -> set[Cause]:
    """Effects that an answer names, and those of small declared sets with a named one."""
    names = named(answer)
    sets = [{(member["id"], member["side"]) for member in group} for group in answer["indistinguishable"]]
    return names.union(*(group for group in sets if len(group) <= LARGEST_SET and group & names))


def same(one: dict | None, other: dict | None) -> bool | None:
    """Whether two answers have the same names, see above; None where one is missing."""
    if one is None or other is None:
        return None
    return named(one) <= said(other) and named(other) <= said(one)


def scaled(case: Path, target: Path, factor: float) -> Path:
    """A copy of a case whose robot declares `factor` times the noise."""
    shutil.copytree(case, target)
    robot = target / "robot.toml"
    robot.write_text(with_noise(robot.read_text(), factor))
    return target


def half(case: Path, target: Path, which: int) -> Path:
    """A copy of a case with every other of its runs, from the first (0) or the second (1) on.

    Raises
    ------
    InputError : it has a single run.
    """
    runs = sorted(p for p in case.iterdir() if p.is_dir())
    if len(runs) < 2:
        raise InputError(f"{case}: has one run, halves need two")
    target.mkdir()
    shutil.copyfile(case / "robot.toml", target / "robot.toml")
    for run in runs[which::2]:
        shutil.copytree(run, target / run.name)
    return target


def cut(case: Path, target: Path, rows: int) -> Path:
    """A copy of a case whose runs lack their last `rows` rows.

    Raises
    ------
    InputError : a run has no more rows, or none are to be cut.
    """
    runs = read_case(case).runs
    for run in runs:
        if not 0 < rows < len(run.t) - 1:
            raise InputError(f"{case / run.name}: has {len(run.t)} rows, {rows} cannot be cut")
    target.mkdir()
    shutil.copyfile(case / "robot.toml", target / "robot.toml")
    for run in runs:
        kept = slice(0, len(run.t) - rows)
        columns = {name: values[kept] for name, values in run.columns.items()}
        write_run(target / run.name, run.meta, {"t": run.t[kept], **columns}, form="parquet")
    return target


def answered(case: Path, change, out: Path, command: list[str], timeout_s: float = 900.0) -> dict | None:
    """The diagnosis of a changed copy of a case, kept in `out`; None where the diagnoser gave none.

    Parameters
    ----------
    change : (case, target) -> folder to diagnose.
    """
    kept = out / "diagnosis.json"
    if not kept.is_file():
        with temporary_folder() as scratch:
            run_supervised([*command, str(change(case, scratch / "case")), "--out", str(out)], timeout_s, scratch)
    return json.loads(kept.read_text()) if kept.is_file() else None


def _line(title: str, hits: list[bool]) -> str:
    low, high = wilson(sum(hits), len(hits))
    return f"{title}: {sum(hits)}/{len(hits)}, 95 % {100 * low:.0f} to {100 * high:.0f} %"


def _names(answer: dict | None) -> str:
    if answer is None:
        return "no answer"
    left = (answer.get("gap") or {}).get("after")
    return f"{', '.join(' '.join(member) for member in sorted(named(answer))) or answer['verdict']} ({left})"


def noise_of(case: Path, factors: list[float], out: Path, command: list[str]) -> list[tuple[float, bool | None]]:
    """For each factor whether the names are those of the case as it is; None where a gap of 2 or less is left."""
    plain = answered(case, lambda source, target: shutil.copytree(source, target), out / "plain", command)
    result = []
    for factor in factors:
        other = answered(case, lambda a, b, by=factor: scaled(a, b, by), out / f"noise-{factor:.3g}", command)
        gaps = [(answer or {}).get("gap", {}).get("after") for answer in (plain, other)]
        counts = all(gap is not None and gap > LEFT_GAP for gap in gaps)
        verdict = same(plain, other) if counts else None
        result.append((factor, verdict))
        print(f"{case.name}: noise × {factor:.3g}: {_names(plain)}; {_names(other)}: {verdict}", flush=True)
    return result


def shown(case: Path, out: Path, command: list[str], timeout_s: float = 900.0) -> set[Cause]:
    """Effects of the diagnosis in `out` that the runs of another case show: without one they leave at least
    `ASKED_GAP` times the gap, or that of noise if it is larger. No effect where the case's machine cannot have them.

    Parameters
    ----------
    command : prints the gap with and without each effect; the case and the diagnosis come behind it.

    Raises
    ------
    InputError : the command failed by itself; only status 2 says that the case cannot have the effects.
    """
    kept = out / "shown.json"
    if not kept.is_file():
        with temporary_folder() as scratch:
            ended = run_supervised([*command, str(case), str(out / "diagnosis.json")], timeout_s, scratch)
        if ended.returncode not in (0, 2):
            raise InputError(f"{case}: {command[-1]} ended with status {ended.returncode}")
        write_atomic(kept, ended.stdout if ended.returncode == 0 else "{}")
    found = {tuple(cause.split()): pair for cause, pair in json.loads(kept.read_text()).items()}
    return {cause for cause, (gap, without) in found.items() if without >= ASKED_GAP * max(gap, 1.0)}


def halves_of(case: Path, out: Path, command: list[str], shower: list[str]) -> list[bool]:
    """For each name that both halves of a case's runs can show, whether the other half names or declares it."""
    parts = [answered(case, lambda a, b, which=k: half(a, b, which), out / f"half-{k}", command) for k in (0, 1)]
    verdicts = []
    with temporary_folder() as scratch:
        for k, (one, other) in enumerate([parts, parts[::-1]]):
            if one is None or other is None:
                continue
            there = half(case, scratch / f"half-{1 - k}", 1 - k)
            asked = seen(one) and seen(one) & shown(there, out / f"half-{k}", shower)
            verdicts += [cause in said(other) for cause in sorted(asked)]
    print(f"{case.name}: halves: {_names(parts[0])}; {_names(parts[1])}: {sum(verdicts)}/{len(verdicts)}", flush=True)
    return verdicts


def cuts_of(case: Path, rows: list[int], out: Path, command: list[str]) -> list[bool]:
    """For each name that counts in the answer to a case as it is, or with so many rows less, whether the other answer
    names or declares it."""
    plain = answered(case, lambda source, target: shutil.copytree(source, target), out / "plain", command)
    verdicts = []
    for count in rows:
        other = answered(case, lambda a, b, less=count: cut(a, b, less), out / f"cut-{count}", command)
        pairs = [] if plain is None or other is None else [(plain, other), (other, plain)]
        mine = [cause in said(two) for one, two in pairs for cause in sorted(seen(one))]
        verdicts += mine
        print(f"{case.name}: {count} rows less: {_names(plain)}; {_names(other)}: {sum(mine)}/{len(mine)}", flush=True)
    return verdicts


def main(argv: list[str] | None = None) -> None:
    """Entry point, see the module."""
    parser = argparse.ArgumentParser(prog="rtds_host.blind.steady", description=__doc__)
    parser.add_argument("cases", nargs="+", type=Path, metavar="CASE")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--noise", type=float, action="append", help="factor on [sensors]; default 1/3, 1/2, 2, 3")
    parser.add_argument("--halves", action="store_true", help="compare halves of the runs in place of noises")
    parser.add_argument("--cut", type=int, action="append", help="last rows that each run lacks, in place of noises")
    args = parser.parse_args(argv)
    command, out = diagnoser_command(True, 1), args.out.resolve()
    hits: dict[str, list[bool]] = {}
    try:
        for case in args.cases:
            if args.halves:
                hits.setdefault("names of halves", []).extend(halves_of(case, out / case.name, command, SHOWER))
                continue
            if args.cut:
                hits.setdefault("names with rows less", []).extend(cuts_of(case, args.cut, out / case.name, command))
                continue
            for factor, verdict in noise_of(case, args.noise or list(NOISE), out / case.name, command):
                if verdict is not None:
                    hits.setdefault(f"noise × {factor:.3g}", []).append(verdict)
    except InputError as error:
        sys.exit(f"{error}")
    for title, values in hits.items():
        print(_line(title, values))


if __name__ == "__main__":
    main()
