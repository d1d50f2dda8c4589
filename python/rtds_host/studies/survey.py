"""Does the gap close in the simulator as in the replay? Over many sealed cases, on runs that no diagnosis has seen.

    python -m rtds_host.studies.survey build/blind --n 12

takes the folder of `rtds blind` after its score: each case's diagnosis as it was answered, and the runs that were held
out of the case. Where the nominal gap is below 1.1 there is nothing to close.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from rtds_host.contract import Case, load_robot, read_run
from rtds_host.correction.close import close
from rtds_host.correction.simulate import Setting
from rtds_host.errors import InputError, RtdsError
from rtds_host.robot import default_engine

WANTED_SHARE = 0.9
# A replay that closes less than this tells nothing of the simulator.
LEAST_CLOSED = 0.2


@dataclass(frozen=True)
class Line:
    """One case: gaps before and after in the replay and in the simulator, and how far both lie apart when corrected."""

    case: str
    verdict: str
    effects: str
    replay: tuple[float, float, float | None]
    simulator: tuple[float, float, float | None]
    share: float | None
    apart: float


def cases_of(out: Path, count: int | None = None) -> list[str]:
    """Names of the cases of a scored check that have an answer, evenly thinned to `count`.

    Raises
    ------
    InputError : no score yet (the truth and the held-out runs stay closed until then).
    """
    if not (out / "score" / "score.json").is_file():
        raise InputError(f"{out / 'score' / 'score.json'}: missing; held-out runs are opened by `rtds blind score`")
    names = sorted(
        p.name for p in (out / "public").iterdir() if (out / "answers" / p.name / "diagnosis.json").is_file()
    )
    if count is None or count >= len(names):
        return names
    return [names[k] for k in np.unique(np.linspace(0, len(names) - 1, count).round().astype(int))]


def survey_one(out: Path, name: str, setting: Setting | None = None, runs: int | None = None) -> Line:
    """One case of a scored check. `runs`: at most so many of its held-out runs.

    Raises
    ------
    InputError : see `close`.
    """
    robot = load_robot(out / "public" / name / "robot.toml")
    held = sorted(p for p in (out / "sealed" / name / "held-out").iterdir() if p.is_dir())[:runs]
    case = Case(name, robot, tuple(read_run(folder, robot) for folder in held))
    path = out / "answers" / name / "diagnosis.json"
    diagnosis = json.loads(path.read_text(encoding="utf-8"))
    content = close(
        replace(case, path=out / "public" / name), setting or Setting(), diagnosis, path, causes=False
    ).content
    gap = content["gap"]
    effects = ", ".join(f"{e['id']} ({e['side']})" for e in content["effects"]) or "none"
    rows = [(gap[which]["before"], gap[which]["after"], gap[which]["closed"]) for which in ("replay", "simulator")]
    closed = rows[0][2]
    share = gap["share_of_replays_closure"] if closed is not None and closed >= LEAST_CLOSED else None
    return Line(name, content["verdict"], effects, rows[0], rows[1], share, content["difference"]["corrected"]["gap"])


def survey(
    out: Path,
    count: int | None = None,
    setting: Setting | None = None,
    runs: int | None = None,
    say: Callable[[Line], None] = lambda line: None,
) -> list[Line]:
    """Lines of several cases. Cases the simulator does not have (a single axis) are left out."""
    lines = []
    for name in cases_of(out, count):
        if load_robot(out / "public" / name / "robot.toml").axis is not None:
            continue
        lines.append(survey_one(out, name, setting, runs))
        say(lines[-1])
    return lines


def markdown(lines: list[Line]) -> str:
    """What the cases say together, and those the simulator closes less of than wanted."""
    shares = np.array([line.share for line in lines if line.share is not None])
    apart = np.array([line.apart for line in lines])
    head = (
        "cases",
        "of them with a gap that the replay closes",
        "median share of the replay's closure",
        "least share",
        "simulator less replay, median and largest",
    )
    text = [f"| {' | '.join(head)} |", "|---|---|---|---|---|"]
    if len(shares):
        middle, least = f"{np.median(shares):.3f}", f"{shares.min():.3f}"
    else:
        middle = least = "-"
    text.append(f"| {len(lines)} | {len(shares)} | {middle} | {least} | {np.median(apart):.2g}, {apart.max():.2g} |")
    low = [line for line in lines if line.share is not None and line.share < WANTED_SHARE]
    text += [
        f"\n{line.case}, {line.effects}: the replay's gap falls from {line.replay[0]:.3g} to {line.replay[1]:.3g}, the "
        f"simulator's from {line.simulator[0]:.3g} to {line.simulator[1]:.3g}."
        for line in low
    ]
    return "\n".join(text) + "\n"


app = typer.Typer(add_completion=False)


@app.command()
def main(
    out: Annotated[Path, typer.Argument(help="Folder of a scored `rtds blind`.")],
    n: Annotated[int | None, typer.Option("--n", help="So many cases, evenly over all.")] = None,
    runs: Annotated[int | None, typer.Option(help="At most so many held-out runs of each.")] = None,
    link: Annotated[str, typer.Option(help="model or rtl.")] = "model",
    engine: Annotated[str, typer.Option(help="pybullet or mujoco.")] = default_engine(),
    into: Annotated[Path | None, typer.Option(help="Page to put the table into, between its marks.")] = None,
) -> None:
    """Replay held-out runs of sealed cases in the simulator; status 1 where the median share is below 0.9."""
    from rtds_host.contract.output import write_between

    setting = Setting(
        link=link, link_options={"sim": "verilator", "step_clocks": "min"} if link == "rtl" else {}, engine=engine
    )

    def say(line: Line) -> None:
        share = "-" if line.share is None else f"{line.share:.4f}"
        print(
            f"{line.case}  {line.effects:44}  replay {line.replay[0]:.3g} -> {line.replay[1]:.3g}  simulator "
            f"{line.simulator[0]:.3g} -> {line.simulator[1]:.3g}  share {share}",
            file=sys.stderr,
            flush=True,
        )

    try:
        lines = survey(out, n, setting, runs, say)
        table = markdown(lines)
        if into is None:
            print(table, end="")
        else:
            write_between(into, table, "<!-- survey: begin -->", "<!-- survey: end -->")
    except RtdsError as error:
        print("rtds: " + " ".join(str(error).split()), file=sys.stderr)
        raise typer.Exit(2) from error
    shares = [line.share for line in lines if line.share is not None]
    if shares and np.median(shares) < WANTED_SHARE:
        raise typer.Exit(1)


if __name__ == "__main__":
    app()
