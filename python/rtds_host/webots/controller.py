"""The controller that Webots starts: the motor units turn the wheels, and a run folder is written."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rtds_host.errors import RtdsError, visible
from rtds_host.robot import Body, check_engine
from rtds_host.run import Outcome, perform, write_outcome
from rtds_host.run.summary import lines
from rtds_host.webots.engine import WebotsEngine
from rtds_host.webots.names import SETTINGS
from rtds_host.webots.project import Settings, read_settings

# Simulated seconds between two lines of progress.
TELL_S = 5.0


def drive_world(
    supervisor: Any, folder: Path, settings: Settings, tell: Callable[[str], None] | None = None
) -> tuple[Outcome, Path]:
    """Drive the scenario of the world that Webots has open, and write its run folder.

    Parameters
    ----------
    supervisor : Webots' `Supervisor`. folder : the project's. tell : is given a line now and then.

    Raises
    ------
    RtdsError : unusable settings, a world that does not fit, a link that fails, a place that cannot be written; and
        `rtds_host.webots.engine.RunEnded`. Nothing is written then.
    """
    scenario = supervisor.getCustomData()
    plan = settings.plan(scenario, folder)
    if settings.against is not None:
        check_engine(settings.against, f"{SETTINGS}: against")
    told = 0.0

    def progress(label: str, t_s: float) -> None:
        nonlocal told
        if tell is not None and (t_s >= told + TELL_S or t_s < told):
            told = t_s
            tell(f"{label}: {t_s:.1f} s of {plan.duration_s:g} s")

    def engine_of(name: str, body: Body, pose: tuple[float, float, float]) -> WebotsEngine:
        return WebotsEngine(supervisor, body, pose)

    outcome = perform(
        plan,
        settings.choice(folder),
        compare=False,
        progress=progress,
        against=settings.against,
        effects=settings.effects(plan, folder),
        engine_of=engine_of,
    )
    place = folder / "runs" / scenario
    write_outcome(outcome, place)
    return outcome, place


def main() -> None:
    """Entry point of the controller: status 0 done, 2 unusable input, 1 ended by Webots or by what nobody foresaw."""
    # Webots puts its module on the path of the controllers it starts, and nowhere else.
    supervisor = importlib.import_module("controller").Supervisor()
    # A controller runs in its own folder, controllers/NAME of the project.
    folder = Path(sys.argv[0]).absolute().parent.parent.parent
    status, ends = 0, False
    try:
        settings = read_settings(folder / SETTINGS)
        ends = settings.quit
        outcome, place = drive_world(supervisor, folder, settings, lambda line: print(line, flush=True))
        print(visible(f"{outcome.plan.scenario.name}  ->  {place}"))
        for label, text in lines(outcome.summary):
            print(visible(f"{label:<24}{text}"))
    except RtdsError as error:
        print("rtds: " + visible(" ".join(str(error).split())), file=sys.stderr, flush=True)
        status = 2
    if ends:
        supervisor.simulationQuit(status)
    sys.stdout.flush()
    sys.exit(status)
