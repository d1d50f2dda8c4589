"""One run from plan to folder."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rtds_host.contract import staged_folder, write_run
from rtds_host.contract.runlog import as_table
from rtds_host.faults.timeline import Injection
from rtds_host.robot import open_engine
from rtds_host.run.log import log_columns, run_meta
from rtds_host.run.loop import OpenEngine, Record, drive_with
from rtds_host.run.path import SignalPath
from rtds_host.run.plan import Plan, other_controller
from rtds_host.run.summary import Effects, Summary, summarise

if TYPE_CHECKING:
    import pandas

Progress = Callable[[str, float], None]
# What an earlier run may have left in the folder, and would pass for a part of this one.
OWNED = ("log.csv", "log.parquet", "figure.png", "figure.pdf", "run.mcap")


@dataclass(frozen=True)
class LinkChoice:
    """Which link, and its options (see `rtds_host.link.open_link`)."""

    name: str = "model"
    options: dict | None = None
    label: str = ""

    @property
    def text(self) -> str:
        """How the link is named in a summary."""
        return self.label or self.name


@dataclass(frozen=True)
class Outcome:
    """A run that has been driven."""

    plan: Plan
    record: Record
    summary: Summary

    def to_pandas(self) -> pandas.DataFrame:
        """The log's rows as a table: index `t`, s, and a column a channel, SI, named as in `log.csv`.

        Raises
        ------
        InputError : pandas is not installed.
        """
        return as_table(log_columns(self.record))


def perform(
    plan: Plan,
    link: LinkChoice,
    compare: bool = True,
    path: SignalPath | None = None,
    progress: Progress | None = None,
    against: str | None = None,
    effects: Effects | None = None,
    engine_of: OpenEngine = open_engine,
    injection: Injection | None = None,
) -> Outcome:
    """Drive the plan and, where there is a controller and `compare`, once more with the other one.

    The comparison is driven on the bit-exact model whatever the link: the RTL gives the same bits
    (`Summary.model_agrees` says whether it did so here), and neither a simulator's time nor a board's is spent twice.
    Through converters (links `chip` and `ad2`) the model's end differs from the run's.

    `engine_of` opens the engine of the run and of the comparison; `against` is one that comes with the package.

    Parameters
    ----------
    path : see `rtds_host.run.loop.drive`. against : another engine to drive in. injection : faults and played signals.

    Raises
    ------
    InputError, LinkError : see `rtds_host.run.loop.drive`.
    """

    def report(label: str) -> Callable[[float], None] | None:
        return None if progress is None else lambda t: progress(label, t)

    change = effects.correction if effects else None
    record = drive_with(plan, link.name, link.options, path, report(plan.scenario.name), change, engine_of, injection)
    in_model = LinkChoice("model")
    compared = rival = None
    if compare and plan.controller is not None:
        other = other_controller(plan)
        compared = (
            other,
            drive_with(
                other,
                in_model.name,
                in_model.options,
                None,
                report(f"{plan.scenario.name} ({other.controller})"),
                change,
                engine_of,
                injection,
            ),
        )
    if against is not None and against != plan.engine:
        rival = (
            against,
            drive_with(
                replace(plan, engine=against),
                in_model.name,
                in_model.options,
                path,
                report(f"{plan.scenario.name} ({against})"),
                change,
                injection=injection,
            ),
        )
    return Outcome(plan, record, summarise(plan, record, link.text, compared, rival, effects, injection))


def write_outcome(outcome: Outcome, folder: Path, figure: bool = True, form: str = "csv") -> None:
    """Fill a run folder: `run.json`, `log.csv`, `robot.toml`, `summary.json`, `figure.png`, `figure.pdf`.

    Raises
    ------
    OutputError : the place cannot be written; nothing is left half-written.
    """
    with staged_folder(folder, owned=OWNED) as scratch:
        plan = outcome.plan
        notes = f"driven by rtds: {plan.robot.name}, coupling {plan.coupling}, {plan.engine}"
        if outcome.summary.effects or outcome.summary.faults:
            notes += "; with " + "; ".join((*outcome.summary.effects, *outcome.summary.faults))
        write_run(scratch, run_meta(plan, notes), log_columns(outcome.record), form)
        (scratch / "robot.toml").write_bytes(plan.robot_path.read_bytes())
        (scratch / "summary.json").write_text(json.dumps(outcome.summary.to_json(), indent=1) + "\n")
        if figure:
            from rtds_host.run.figure import draw

            draw(plan, outcome.record, scratch)
