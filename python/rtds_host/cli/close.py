"""`rtds close`: put a diagnosis into the real-time simulator and see whether the gap closes there."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rtds_host.cli.answer import AsJson, Quiet, Seed, answer, say_if_seeded

if TYPE_CHECKING:
    from rich.console import Console

app = typer.Typer(add_completion=False)
LINKS = ("model", "rtl")


@app.command()
def close(
    case: Annotated[Path, typer.Argument(help="Case folder: robot.toml and one sub-folder per run.")],
    out: Annotated[Path, typer.Option(help="Folder for close.json, diagnosis.json and close.png.")],
    diagnosis: Annotated[
        Path | None,
        typer.Option(
            help="A diagnosis.json of the case; without it the case is diagnosed, all runs but those held out."
        ),
    ] = None,
    hold_out: Annotated[
        list[str] | None,
        typer.Option(
            help="Run to keep out of the diagnosis and to replay; may be repeated. "
            "Default: the last; with --diagnosis, all."
        ),
    ] = None,
    link: Annotated[str, typer.Option(help="What computes the motors: model (bit for bit the RTL) or rtl.")] = "model",
    sim: Annotated[str, typer.Option(help="rtl: verilator or icarus.")] = "verilator",
    engine: Annotated[
        str | None,
        typer.Option(
            help="Physics engine: pybullet or mujoco. Default: pybullet, or mujoco where PyBullet has no wheel."
        ),
    ] = None,
    full: Annotated[
        bool,
        typer.Option(
            "--full",
            help="Diagnose by the full search, with a limit of work three times as large; most searches end earlier.",
        ),
    ] = False,
    table: Annotated[
        bool, typer.Option("--table", help="Load the residual of the diagnosis as a table, where one fits.")
    ] = False,
    causes: Annotated[
        bool,
        typer.Option(
            help="Vary the simulator one thing at a time, to say where it differs from the diagnosis' own replay."
        ),
    ] = True,
    figure: Annotated[bool, typer.Option(help="Draw close.png.")] = True,
    jobs: Annotated[int, typer.Option(help="Cores for the diagnosis; 0 = all.", min=0)] = 0,
    seed: Seed = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Diagnose CASE, put the effects into the real-time simulator, and report the gap there before and after."""
    from rich.console import Console

    from rtds_host.bars import stages
    from rtds_host.cli.first_use import say_if_first
    from rtds_host.contract import check_writable
    from rtds_host.correction.close import close_folder
    from rtds_host.correction.simulate import Setting
    from rtds_host.errors import InputError, did_you_mean
    from rtds_host.robot import check_engine, default_engine
    from rtds_host.workers import cores

    if link not in LINKS:
        raise InputError(f"--link {link}: unknown (known: {', '.join(LINKS)}){did_you_mean(link, LINKS)}")
    engine = engine or default_engine(lambda line: print(line, file=sys.stderr))
    check_engine(engine, "--engine")
    check_writable(out)
    setting = Setting(
        link=link, link_options={"sim": sim, "step_clocks": "min"} if link == "rtl" else {}, engine=engine
    )
    say_if_first(quiet)
    say_if_seeded(seed, quiet)
    with stages(quiet) as report:
        result = close_folder(
            case,
            out,
            diagnosis,
            figure,
            setting=setting,
            hold_out=hold_out,
            quick=not full,
            causes=causes,
            table=table,
            threads=jobs if jobs > 0 else cores(),
            progress=report,
        )
    if as_json:
        answer({"folder": out, **result.content})
        return
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=120)
    _show(console, result.content, out)


def _number(value: float | None, form: str = ".3g") -> str:
    return "-" if value is None else format(value, form)


def _show(console: Console, content: dict, out: Path) -> None:
    from rich.table import Table

    from rtds_host.diagnosis.report.summary import escape

    gap, simulator = content["gap"], content["simulator"]
    effects = (
        "; ".join(
            f"{e['id']} ({e['side']}) " + ", ".join(f"{name} = {p['value']:.4g}" for name, p in e["parameters"].items())
            for e in content["effects"]
        )
        or "no effect"
    )
    console.print(f"[bold]{escape(content['case'])}[/]  {content['verdict']}: {escape(effects)}")
    console.print(
        f"  held out {escape(', '.join(content['runs']))}; motors in {simulator['link']}, robot in "
        f"{simulator['engine']}  ->  {escape(out)}"
    )
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_edge=False)
    for title in ("  gap", "nominal", "corrected", "closed"):
        table.add_column(title, justify="left" if title == "  gap" else "right")
    for which, text in (("simulator", "  in the simulator"), ("replay", "  in the diagnosis' replay")):
        table.add_row(
            text,
            _number(gap[which]["before"]),
            _number(gap[which]["after"]),
            "-" if gap[which]["closed"] is None else f"{100 * gap[which]['closed']:.1f} %",
        )
    console.print(table)
    difference = content["difference"]
    console.print(
        f"  simulator and replay lie {_number(difference['nominal']['gap'])} (nominal) and "
        f"{_number(difference['corrected']['gap'])} (corrected) units of noise apart"
    )
    if "table" in content:
        entry = content["table"]
        console.print(
            f"  table    {escape(entry['kind'])}, sides {', '.join(entry['curves'])}: explains "
            f"{100 * entry['explained']:.0f} % of what is left in its block"
        )
    if difference.get("causes"):
        causes = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_edge=False)
        for title in (f"  varied, on {escape(difference['causes_on'])}", "moves", "from replay"):
            causes.add_column(title, justify="left" if title.startswith("  ") else "right")
        for row in difference["causes"]:
            causes.add_row(
                f"  {escape(row['varied'])}", _number(row["moves"], ".2g"), _number(row["from_replay"], ".2g")
            )
        console.print(causes)
    for note in content["notes"]:
        console.print(f"  [yellow]note[/]  {escape(note)}")
