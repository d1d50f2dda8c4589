"""`rtds import`: ROS bags and csv files of real robots into a case."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from rtds_host.cli.answer import AsJson, answer
from rtds_host.contract import RunMeta
from rtds_host.errors import InputError, visible
from rtds_host.importers.mapping import builtin_mappings

app = typer.Typer(add_completion=False)


@app.command()
def import_(
    sources: Annotated[
        list[Path],
        typer.Argument(
            metavar="BAG_OR_CSV",
            help="ROS bags (a folder, .mcap, .db3 or .bag), csv files, one run each, or SysId's .json.",
        ),
    ],
    out: Annotated[Path | None, typer.Option("--out", metavar="CASE", help="Folder of the case.")] = None,
    robot: Annotated[
        str | None,
        typer.Option(
            help="Nominal robot: a built-in name or a robot.toml (default: the mapping's; with --append the case's)."
        ),
    ] = None,
    mapping: Annotated[
        str | None,
        typer.Option(
            help="Mapping file, or the name of one in the package "
            f"({', '.join(builtin_mappings())}). Default: the one that fits."
        ),
    ] = None,
    namespace: Annotated[
        str | None,
        typer.Option(help="Namespace of the robot's topics, as /tb3_0; needed where a bag holds several robots."),
    ] = None,
    append: Annotated[bool, typer.Option("--append", help="Add runs to a case that exists.")] = False,
    name: Annotated[list[str] | None, typer.Option(help="Name of a run; give it once per source.")] = None,
    scenario: Annotated[str, typer.Option(help="What was driven, for run.json (default: the run's name).")] = "",
    payload_kg: Annotated[float, typer.Option(help="Payload during the runs.")] = 0.0,
    slope_rad: Annotated[float, typer.Option(help="Slope of the ground.")] = 0.0,
    uphill_yaw_rad: Annotated[float, typer.Option(help="Heading that climbs the slope.")] = 0.0,
    notes: Annotated[str, typer.Option(help="Free text for run.json (default: the recording's name and time).")] = "",
    start_s: Annotated[float, typer.Option(help="Take the recordings from here on.")] = 0.0,
    end_s: Annotated[float, typer.Option(help="Take the recordings up to here.")] = math.inf,
    trust_units: Annotated[bool, typer.Option("--trust-units", help="Import even where a unit looks wrong.")] = False,
    parquet: Annotated[bool, typer.Option("--parquet", help="Write log.parquet instead of log.csv.")] = False,
    as_json: AsJson = False,
    list_topics: Annotated[
        bool, typer.Option("--list", help="Only list topics with their fields, or columns with guesses.")
    ] = False,
) -> None:
    """Import ROS bags or csv files as the runs of a case.

    Bags of a TurtleBot3 (also in Gazebo), a Create 3 or a Jackal and SysId's JSON files need no mapping. For other
    robots a small TOML file says which topic, field or column holds what, and in which unit: docs/import.md.
    """
    if list_topics:
        from rtds_host.importers.listing import contents, held

        if as_json:
            answer({"recordings": [held(source) for source in sources]})
            return
        for source in sources:
            for line in contents(source):
                print(visible(line))
        return
    if out is None:
        raise InputError("--out CASE: missing, the folder to write to")
    from rtds_host.contract import check_writable
    from rtds_host.importers.case import import_case
    from rtds_host.importers.mapping import unconfirmed

    check_writable(out)
    runs = import_case(
        sources,
        out,
        robot=robot,
        mapping=mapping,
        append=append,
        names=name or [],
        meta=RunMeta(scenario, payload_kg, slope_rad, uphill_yaw_rad, notes),
        start_s=start_s,
        end_s=end_s,
        trust_units=trust_units,
        form="parquet" if parquet else "csv",
        namespace=namespace,
    )
    if as_json:
        said = [
            {
                "folder": str(out / run.name),
                "mode": run.imported.mode,
                "duration_s": float(run.imported.columns["t"][-1]),
                "rows": len(run.imported.columns["t"]),
                "samples": {name: int(count) for name, count in run.imported.counts.items()},
                "assumed": run.assumed,
                "notices": list(run.imported.notices),
            }
            for run in runs
        ]
        answer({"case": out, "runs": said})
        return
    print(visible(runs[0].assumed))
    if mapping and (guesses := unconfirmed(mapping)):
        print(f"  note: {visible(mapping)}: {guesses} lines still say `guess`: nobody has confirmed them")
    for run in runs:
        t = run.imported.columns["t"]
        counts = ", ".join(f"{channel} {count}" for channel, count in run.imported.counts.items() if channel != "t")
        print(f"{visible(out / run.name)}: {run.imported.mode} mode, {t[-1]:.3f} s, {len(t)} rows; samples: {counts}")
        for notice in run.imported.notices:
            print(f"  note: {visible(notice)}")
