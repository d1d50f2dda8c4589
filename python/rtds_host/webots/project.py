"""A project folder for Webots: worlds, the controller's start-up, and what it is to do."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

from rtds_host.cli.calibrate import link_options
from rtds_host.cli.run import chosen_effects, link_choice, parse_settings
from rtds_host.contract import staged_folder
from rtds_host.contract.runlog import read_json
from rtds_host.errors import InputError, OutputError, did_you_mean
from rtds_host.link import LINKS
from rtds_host.run import Effects, LinkChoice, Options, Plan, make_plan
from rtds_host.scenario import find_scenario
from rtds_host.scenario import scenarios as scenarios_known
from rtds_host.webots.names import CONTROLLER, SETTINGS
from rtds_host.webots.world import make_world

SCHEMA = "rtds-webots/1"
PAPER = ("linear", "circle", "eight")
LONGEST_STEP_MS = 64
SCRIPT = '''"""Webots starts this; the work is done in the package, in the Python of runtime.ini."""

from rtds_host.webots.controller import main

main()
'''


@dataclass(frozen=True)
class Settings:
    """What the controller is to do, as `webots.json` holds it. Paths are below the project's folder, or absolute.

    `time_step_ms` is the worlds' `basicTimeStep`; `against` an engine of the package that drives the run once more;
    `quit` ends Webots after the run. The others are the options of `rtds run`.
    """

    robot: str = "robot.toml"
    link: str = "rtl"
    sim: str = "verilator"
    step_clocks: str = "min"
    calibration: str | None = None
    ad2: tuple[str, ...] = ()
    serial: str = ""
    controller: str = "exact"
    coupling: str = "closed"
    scaled: bool = False
    setting: tuple[str, ...] = ()
    diagnosis: str | None = None
    effect: tuple[str, ...] = ()
    time_step_ms: int = 1
    against: str | None = None
    quit: bool = False

    def plan(self, scenario: str, folder: Path) -> Plan:
        """The run of a scenario.

        Raises
        ------
        InputError : see `rtds_host.run.make_plan`; or a time step that does not fit.
        """
        if not 1 <= self.time_step_ms <= LONGEST_STEP_MS:
            raise InputError(f"time step: is {self.time_step_ms} ms, it must lie within 1 to {LONGEST_STEP_MS}")
        options = Options(
            robot=str(folder / self.robot), controller=self.controller, coupling=self.coupling, scaled=self.scaled
        )
        found = find_scenario(scenario)
        values = {k: v for k, v in parse_settings(self.setting).items() if k in found.parameters}
        plan = make_plan(found, values, options)
        step = self.time_step_ms
        if plan.log_steps % step:
            # Rows lie at steps of Webots; a row an exchange is the fewest there may be.
            if plan.exchange_steps % step:
                raise InputError(
                    f"time step: {step} ms do not divide the exchange interval of {1e3 * plan.exchange_s:g} ms"
                )
            plan = make_plan(found, values, replace(options, log_s=plan.exchange_s))
        if step > 1 and (plan.reflected_kg_m2 or self.diagnosis or self.effect):
            raise InputError(
                f"time step: is {step} ms; with effects, and where the body outweighs the rotors, torques are "
                "exchanged each millisecond: it must be 1"
            )
        if plan.total_steps % step:
            raise InputError(f"time step: {step} ms do not divide the run of {plan.duration_s:g} s")
        return replace(plan, engine="webots")

    def effects(self, plan: Plan, folder: Path) -> Effects | None:
        """What the robot has beyond the nominal one."""
        diagnosis = None if self.diagnosis is None else folder / self.diagnosis
        return chosen_effects(plan, diagnosis, list(self.effect))

    def choice(self, folder: Path) -> LinkChoice:
        """The link that carries the motors.

        Raises
        ------
        InputError : options that do not go together, a calibration that cannot be read.
        """
        if self.link not in LINKS:
            raise InputError(f"link {self.link!r}: unknown (known: {', '.join(LINKS)}){did_you_mean(self.link, LINKS)}")
        calibration = None if self.calibration is None else folder / self.calibration
        options = link_options(self.link, calibration, None, list(self.ad2), self.serial)
        return link_choice(self.link, self.sim, self.step_clocks, options)


def read_settings(path: Path) -> Settings:
    """Read `webots.json`.

    Raises
    ------
    InputError : it cannot be read, or holds what no setting is; the message names file and key.
    """
    content = read_json(path)
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise InputError(f"{path}: schema is not {SCHEMA!r}")
    defaults = asdict(Settings())
    given = {}
    for key, value in content.items():
        if key == "schema":
            continue
        if key not in defaults:
            raise InputError(f"{path}: {key!r} is not a setting{did_you_mean(key, defaults)}")
        if isinstance(defaults[key], tuple):
            right = isinstance(value, list) and all(isinstance(one, str) for one in value)
            value = tuple(value) if right else value
        elif isinstance(defaults[key], bool):
            right = isinstance(value, bool)
        elif isinstance(defaults[key], int):
            right = isinstance(value, int) and not isinstance(value, bool)
        else:
            right = isinstance(value, str) or (value is None and defaults[key] is None)
        if not right:
            raise InputError(f"{path}: {key}: {value!r} is not of the kind that is needed")
        given[key] = value
    return Settings(**given)


def _refuse_others(folder: Path) -> None:
    """The folders of worlds and controllers are replaced: nothing else may be in them."""
    ours = {CONTROLLER, *(f"{name}.wbt" for name in scenarios_known())}
    for part in ("worlds", "controllers"):
        # Webots keeps its windows' places in hidden files.
        for place in sorted((folder / part).glob("[!.]*")):
            if place.name not in ours:
                raise OutputError(f"{place}: is not by `rtds webots`, which replaces this folder; choose another --out")


def write_project(
    folder: Path, settings: Settings, source: Path, python: str, scenarios: Sequence[str] = PAPER
) -> list[str]:
    """Write the folder whole or not at all; one of an earlier project is replaced, its `runs` stay.

    Parameters
    ----------
    settings : paths in it are those of the caller; a diagnosis and a calibration are copied into the folder.
    source : the robot.toml. python : the interpreter that has this package, for `runtime.ini`.

    Returns
    -------
    The worlds' paths below the folder.

    Raises
    ------
    InputError : a scenario, a robot or an option that cannot be used. OutputError : the place cannot be written.
    """
    copies = {"robot.toml": source}
    inside: dict[str, str] = {}
    for key, place in (("diagnosis", settings.diagnosis), ("calibration", settings.calibration)):
        if place is not None:
            inside[key] = f"{key}{Path(place).suffix}"
            copies[inside[key]] = Path(place)
    settings = replace(settings, diagnosis=inside.get("diagnosis"), calibration=inside.get("calibration"))
    _refuse_others(folder)
    known = {name for scenario in scenarios for name in find_scenario(scenario).parameters}
    for name in parse_settings(settings.setting):
        if name not in known:
            raise InputError(
                f"--set {name}: no scenario here has it (known: {', '.join(sorted(known))}){did_you_mean(name, known)}"
            )
    worlds = [f"worlds/{name}.wbt" for name in scenarios]
    start = f"controllers/{CONTROLLER}"
    with staged_folder(folder, owned=("diagnosis.json",)) as scratch:
        for name, origin in copies.items():
            try:
                shutil.copyfile(origin, scratch / name)
            except OSError as error:
                raise InputError(f"{origin}: {error.strerror or error}") from error
        settings.choice(scratch)
        (scratch / "worlds").mkdir()
        for name, place in zip(scenarios, worlds, strict=True):
            plan = settings.plan(name, scratch)
            change = settings.effects(plan, scratch)
            body = plan.body if change is None else change.correction.body_on(plan.body)
            text = make_world(plan.robot, body, plan.motion.start, name, settings.time_step_ms)
            (scratch / place).write_text(text, encoding="utf-8")
        (scratch / start).mkdir(parents=True)
        (scratch / start / f"{CONTROLLER}.py").write_text(SCRIPT, encoding="utf-8")
        (scratch / start / "runtime.ini").write_text(f"[python]\nCOMMAND = {os.path.abspath(python)}\n", "utf-8")
        content = {"schema": SCHEMA, **{f.name: getattr(settings, f.name) for f in fields(settings)}}
        (scratch / SETTINGS).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return worlds
