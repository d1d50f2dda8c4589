"""Every ready robot on the paper's three scenarios, scaled to it, in every engine: the table of
docs/ready-robots.md.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from rtds_host.contract import builtin_robots
from rtds_host.errors import InputError
from rtds_host.robot import available_engines
from rtds_host.run.loop import drive_with
from rtds_host.run.plan import Options, Plan, make_plan
from rtds_host.run.summary import Summary, summarise
from rtds_host.vectors import given

SCENARIOS = ("linear", "circle", "eight")
START, END = "<!-- ready robots: begin -->", "<!-- ready robots: end -->"


@dataclass(frozen=True)
class Drive:
    """One robot on one scenario in one engine; `refused` says which limit forbids it, and there is no summary then."""

    robot: str
    scenario: str
    engine: str
    plan: Plan | None = None
    summary: Summary | None = None
    refused: str = ""


def drive_one(robot: str, scenario: str, engine: str, link: str = "model") -> Drive:
    """Drive a ready robot on a scenario scaled to it; what forbids it, before the run or in it, is in `refused`."""
    try:
        plan = make_plan(scenario, options=Options(robot=robot, engine=engine, scaled=True))
        return Drive(robot, scenario, engine, plan, summarise(plan, drive_with(plan, link), link))
    except InputError as error:
        return Drive(robot, scenario, engine, refused=str(error))


def survey(robots: Sequence[str] = (), engines: Sequence[str] = ()) -> Iterator[Drive]:
    """All of them, robot by robot."""
    for robot in robots or builtin_robots():
        for scenario in SCENARIOS:
            for engine in engines or available_engines():
                yield drive_one(robot, scenario, engine)


def table(drives: Sequence[Drive]) -> str:
    """The drives as Markdown, a row a robot and scenario: the worse of both engines, or which of them forbids it and
    why.
    """
    rows = [
        (
            "| robot | scenario | payload, way, time | body / rotor | end of the path | speed error (rms) | energy:"
            " balance, robot |"
        ),
        "|---|---|---|---|---|---|---|",
    ]
    for key in dict.fromkeys((one.robot, one.scenario) for one in drives):
        same = [one for one in drives if (one.robot, one.scenario) == key]
        refused = {one.engine: one.refused for one in same if one.refused}
        if refused:
            why = "; ".join(f"{engine}: {text}" for engine, text in refused.items())
            rows.append(f"| `{key[0]}` | {key[1]} | {why} | | | | |")
            continue
        plan, found = given(same[0].plan, "plan"), [given(one.summary, "summary") for one in same]
        errors = [s.tracking for s in found]
        way = ", ".join(
            f"{name.removesuffix('_m')} {plan.values[name]:.3g}{' m' if name.endswith('_m') else ''}"
            for name in ("length_m", "radius_m", "scale")
            if name in plan.values
        )
        rows.append(
            f"| `{key[0]}` | {key[1]} | {plan.body.payload_kg:.3g} kg, {way}, {plan.duration_s:g} s |"
            f" {found[0].inertia_ratio:.2f} | {1e3 * max(at.position_m for at in errors):.2f} mm,"
            f" {max(abs(math.degrees(at.yaw_rad)) for at in errors):.3f}° |"
            f" {1e3 * max(at.speed_rad_s for at in errors):.2f} mrad/s |"
            f" {max(given(s.energy_imbalance, 'energy_imbalance') for s in found):.0e},"
            f" {max(abs(given(s.robot_energy_gap, 'robot_energy_gap')) for s in found):.0e} |"
        )
    return "\n".join(rows) + "\n"


app = typer.Typer(add_completion=False)


@app.command()
def main(
    robot: Annotated[list[str] | None, typer.Argument(help="Ready robots; all of them without.")] = None,
    into: Annotated[Path | None, typer.Option(help="Page to put the table into, between its marks.")] = None,
) -> None:
    """Drive every ready robot on linear, circle and eight, scaled to it, in every engine."""
    from rtds_host.contract.output import write_between

    drives = []
    for drive in survey(robot or ()):
        drives.append(drive)
        print(
            f"{drive.robot} {drive.scenario} {drive.engine}: {drive.refused or 'driven'}", file=sys.stderr, flush=True
        )
    text = table(drives)
    if into is None:
        print(text, end="")
    else:
        write_between(into, text, START, END)


if __name__ == "__main__":
    app()
