"""`rtds effects`: the catalogue."""

from __future__ import annotations

from typing import Annotated

import typer

from rtds_host.cli.answer import AsJson, answer

app = typer.Typer(add_completion=False)


@app.command()
def effects(
    name: Annotated[str | None, typer.Argument(help="One effect, in full; without it, all of them in a table.")] = None,
    as_json: AsJson = False,
) -> None:
    """List the effects that a diagnosis can name."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from rtds_host.contract.robot import builtin_robot
    from rtds_host.correction.translate import PLACE_NAMES
    from rtds_host.diagnosis.effects import CATALOGUE
    from rtds_host.diagnosis.scales import scales_of
    from rtds_host.errors import InputError, did_you_mean

    console = Console()
    if as_json:
        _print_json(name)
        return
    if name is None:
        table = Table(box=None, pad_edge=False)
        for title in ("effect", "sides", "runs in", "parameters"):
            table.add_column(title, no_wrap=title != "parameters", overflow="fold")
        subsystem = ""
        for effect in sorted(CATALOGUE.values(), key=lambda e: (e.subsystem, e.id)):
            if effect.subsystem != subsystem:
                subsystem = effect.subsystem
                table.add_row(Text(subsystem, style="bold"))
            table.add_row(
                f"  {effect.id}",
                "each" if effect.sided else "both",
                PLACE_NAMES[effect.runs_in],
                Text("\n".join(f"{p.name} [{p.unit}]" for p in effect.parameters)),
            )
        console.print(table)
        console.print("each: on both sides, or on left or right alone")
        return
    if name not in CATALOGUE:
        raise InputError(
            f"effect {name!r}: not in the catalogue (`rtds effects` lists it){did_you_mean(name, CATALOGUE)}"
        )
    effect = CATALOGUE[name].on(scales_of(builtin_robot("burger")))
    lines = [
        f"{effect.id}: {effect.subsystem}, {' or '.join(effect.sides)}",
        f"  {effect.equation}",
        f"  source: {effect.source}",
    ]
    lines += [
        f"  {p.name} [{p.unit}]: {p.meaning or 'see the equation'}; within {p.low:.4g} to {p.high:.4g}, absent at"
        f" {p.null:.4g}"
        for p in effect.parameters
    ]
    lines += [
        f"  taken for: {', '.join(effect.confused_with)}",
        f"  shown by: {effect.shown_by}",
        f"  in the simulator: {PLACE_NAMES[effect.runs_in]}",
        f"  to check: {effect.check}",
        f"  on the robot: {effect.advice}",
    ]
    console.print("\n".join(lines), highlight=False, markup=False)


def _print_json(name: str | None) -> None:
    """The catalogue, or one effect of it, with its parameters."""
    from rtds_host.diagnosis.effects import CATALOGUE as known
    from rtds_host.errors import InputError, did_you_mean

    if name is not None and name not in known:
        raise InputError(f"effect {name!r}: not in the catalogue{did_you_mean(name, known)}")
    content = [
        {
            "id": effect.id,
            "subsystem": effect.subsystem,
            "sided": bool(effect.sided),
            "parameters": [{"name": p.name, "unit": p.unit, "meaning": p.meaning} for p in effect.parameters],
        }
        for effect in known.values()
        if name in (None, effect.id)
    ]
    answer({"effects": content})
