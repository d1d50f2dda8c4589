"""The answer on the terminal: a few lines."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.markup import escape as plain_markup
from rich.table import Table

from rtds_host.diagnosis.report.advice import exportable
from rtds_host.diagnosis.report.details import Details
from rtds_host.diagnosis.report.words import (
    SUBSYSTEM_WORDS,
    budget_words,
    effect_name,
    explanation_name,
    manoeuvre,
    number,
    percent,
    percent_closed,
    value_words,
    verdict_sentence,
)
from rtds_host.errors import visible

_STYLE = {"none": "green", "known": "cyan", "partial": "yellow", "unknown": "red"}


def escape(text: object) -> str:
    """A text from outside, neither markup nor codes for the terminal in it."""
    return plain_markup(visible(text))


def print_summary(console: Console, diagnosis: dict[str, Any], details: Details) -> None:
    """Print verdict, place, causes, rivals, gap, warnings and the next experiment."""
    verdict = diagnosis["verdict"]
    console.print(
        f"[bold]{escape(details.case.name)}[/] [{_STYLE[verdict]} bold]{verdict}[/]  "
        f"{escape(verdict_sentence(diagnosis))}"
    )
    if diagnosis["located"]:
        console.print(
            "  located  "
            + ", ".join(
                f"{SUBSYSTEM_WORDS[e['subsystem']]} {percent(e['share'])}"
                for e in diagnosis["located"]
                if e["share"] >= 0.005
            )
        )
    if diagnosis["budget"]:
        console.print(
            "  made of  "
            + escape(", ".join(f"{text} {percent(share)}" for text, share in budget_words(diagnosis) if share >= 0.005))
        )
    for effect in diagnosis["effects"]:
        values = ", ".join(f"{name} = {value_words(effect['id'], name, p)}" for name, p in effect["parameters"].items())
        console.print(f"  effect   {escape(effect_name(effect))}: {escape(values)}")
    rivals = diagnosis["alternatives"]
    if len(rivals) > 1:
        console.print(
            "  odds     "
            + escape("; ".join(f"{explanation_name(a['effects'])} {percent(a['probability'])}" for a in rivals[:4]))
        )
    for (effect, side), (found, of) in details.repeats.items():
        again = explanation_name([{"id": effect, "side": side}])
        console.print(f"  repeated {escape(again)}: found again on {found} of {of} halves of the data")
    gap = diagnosis["gap"]
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_edge=False)
    table.add_column("  gap", style="bold")
    figures = [("nominal", number(gap.get("before"))), ("refitted", number(gap.get("refit")))]
    if diagnosis["effects"]:
        figures += [("with effects", number(gap.get("after"))), ("closed", percent_closed(gap.get("closed")))]
    for name, _ in figures:
        table.add_column(name, justify="right")
    table.add_row("  held out", *(value for _, value in figures))
    console.print(table)
    warnings = details.gate.warnings if details.gate is not None else ()
    for finding in warnings[:5]:
        console.print(
            f"  [yellow]{finding.severity}[/]  {escape(' '.join(p for p in (finding.run, finding.text) if p))}"
        )
    if len(warnings) > 5:
        console.print(f"  [yellow]and {len(warnings) - 5} more warnings, see the report[/]")
    plan = diagnosis.get("next_experiment")
    if plan:
        how = " (rtds plan gives its commands)" if exportable(details.case.robot) else ""
        console.print(f"  next     record {escape(manoeuvre(plan))}{how}: {escape(str(plan.get('why', '')))}")
    if details.seconds is not None:
        console.print(f"  [dim]{details.seconds:.1f} s[/]")
