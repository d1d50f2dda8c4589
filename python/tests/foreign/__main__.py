"""Draw robots, import their bags, diagnose, and print the table: PYTHONPATH=python/tests python -m foreign --n 30 --out
DIR.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from foreign.draw import DRIVES, draw
from rtds_host.contract import read_case
from rtds_host.diagnosis.diagnose import diagnose
from rtds_host.importers import import_case


def right(truth: dict, diagnosis: dict) -> bool:
    """Whether a diagnosis says what is true: none; or the cause, named alone or in a set of at most three with its
    twins.
    """
    if not truth["effects"]:
        return diagnosis["verdict"] == "none"
    cause = {key: truth["effects"][0][key] for key in ("id", "side")}
    named = [{key: effect[key] for key in ("id", "side")} for effect in diagnosis["effects"]]
    sets = [members for members in diagnosis["indistinguishable"] if len(members) <= 3]
    return len(named) >= 1 and (
        cause in named or any(cause in members and any(n in members for n in named) for members in sets)
    )


def _said(effects: list[dict]) -> str:
    return (
        ", ".join(
            f"{e['id']} {e['side']} "
            + ", ".join(f"{(p['value'] if isinstance(p, dict) else p):.3g}" for p in e["parameters"].values())
            for e in effects
        )
        or "-"
    )


def main() -> None:
    """Draw, import, diagnose, print; what is in the folder already is not drawn again."""
    parser = argparse.ArgumentParser(prog="python -m foreign", description=__doc__)
    parser.add_argument("--n", type=int, default=30, help="robots, every other one nominal")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True, help="bags, cases and diagnoses")
    parser.add_argument("--full", action="store_true", help="the full search in place of the quick one")
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    counts = {"nominal": [0, 0], "cause": [0, 0]}
    print(
        "| robot | battery, V | stamps, ms | truth | verdict | named | gap | right |\n|---|---|---|---|---|---|---|---|"
    )
    for number in range(args.n):
        folder = args.out / f"{args.seed}-{number:03d}"
        known = folder / "truth.json"
        truth = json.loads(known.read_text()) if known.is_file() else draw(folder, number, args.seed)
        case = folder / "case"
        if not case.exists():
            import_case([folder / f"{kind}.mcap" for kind in DRIVES], case)
        diagnosis, _ = diagnose(read_case(case), quick=not args.full, threads=args.threads)
        (folder / "diagnosis.json").write_text(json.dumps(diagnosis, indent=1) + "\n")
        ok = right(truth, diagnosis)
        kind = "cause" if truth["effects"] else "nominal"
        counts[kind][0] += ok
        counts[kind][1] += 1
        gap = diagnosis["gap"]
        print(
            f"| {number} | {truth['battery_v']:.1f} | {1e3 * truth['stamps_late_s']:.0f} | {_said(truth['effects'])} | "
            f"{diagnosis['verdict']} | {_said(diagnosis['effects'])} | {gap['before']:.3g}, {gap['refit']:.3g}, "
            f"{gap['after']:.3g} | {'yes' if ok else 'NO'} |",
            flush=True,
        )
    print("\n" + ", ".join(f"{kind}: {good} of {total} right" for kind, (good, total) in counts.items() if total))


if __name__ == "__main__":
    main()
