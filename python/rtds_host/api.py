"""The functions for Python programs and notebooks: the sub-commands of `rtds` without a terminal.

All raise `rtds_host.RtdsError`, whose text is one line that names the place and what is wrong: `InputError` for
unusable input, `OutputError` where a result cannot be written (nothing is left half-written), `LinkError` where a
simulator of the Verilog cannot be built or started. Units are SI; the formats are those of the command line.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

    from rtds_host.contract import Case, Robot, RunLog
    from rtds_host.correction.result import Result
    from rtds_host.plan.make import Plan
    from rtds_host.run.session import Outcome

__all__ = ["close", "diagnose", "export", "import_case", "plan", "predict", "read_case", "run"]

Path_ = str | os.PathLike[str]


def read_case(folder: Path_) -> Case:
    """Read a case: one robot (`robot.toml`) and the runs recorded on it, a sub-folder each.

    Returns
    -------
    Case with `robot` and `runs`; a run's `t` (n,) is in s, its `columns` are (n,) arrays by channel, NaN where a
    channel has no sample at that time.

    Raises
    ------
    InputError : a file is missing or does not keep the format; file, row or key are named.
    """
    from rtds_host import contract

    return contract.read_case(folder)


def diagnose(case: Case | Path_, *, quick: bool = False, threads: int = 0, out: Path_ | None = None) -> dict[str, Any]:
    """Say where the gap between simulation and robot lies, and which effects cause it (`rtds diagnose`).

    Parameters
    ----------
    case : as read, or its folder.
    quick : a narrower search, with a third of the full one's limit of work; most searches end before it.
    threads : cores to use; 0 = all.
    out : folder for `diagnosis.json` and `report.html`; nothing is written without it.

    Returns
    -------
    The content of `diagnosis.json`: "verdict", "effects" with values and 90 % intervals, "gap" before and after in
    units of the sensors' noise, each run judged by the fit without it, and more.

    Raises
    ------
    InputError : the data make a diagnosis impossible. OutputError : `out` cannot be written.
    """
    from rtds_host.contract import Case, check_writable
    from rtds_host.diagnosis.batch import refuse_case, write_result
    from rtds_host.diagnosis.diagnose import diagnose as diagnose_case
    from rtds_host.diagnosis.report import report_page, validate
    from rtds_host.workers import cores

    if out is not None:
        check_writable(Path(out))
        place = case.path if isinstance(case, Case) else Path(case)
        if place is not None:
            refuse_case(place, Path(out))
    result, details = diagnose_case(_case(case), quick=quick, threads=threads or cores())
    validate(result)
    if out is not None:
        write_result(Path(out), result, report_page(result, details), place, quick)
    return result


def predict(
    run: RunLog | Path_, robot: Robot | Path_, diagnosis: Mapping[str, Any] | Path_ | None = None
) -> dict[str, np.ndarray]:
    """Replay a run from its commands, by the nominal robot or with a diagnosis in it (`rtds predict`).

    Parameters
    ----------
    run : as read, or its folder. robot : nominal robot as read, or its `robot.toml`.
    diagnosis : content of a `diagnosis.json`, or its path.

    Returns
    -------
    (n,) arrays by channel at the run's times "t": what sensors without noise would have reported.

    Raises
    ------
    InputError : a file is unusable, or the diagnosis names what the catalogue of effects does not hold.
    """
    from rtds_host.contract import Robot, RunLog, load_robot, read_run
    from rtds_host.correction.close import model_of
    from rtds_host.diagnosis.predict import predicted_columns, read_diagnosis

    nominal = robot if isinstance(robot, Robot) else load_robot(robot)
    log = run if isinstance(run, RunLog) else read_run(run, nominal)
    model = None
    if isinstance(diagnosis, Mapping):
        model = model_of(dict(diagnosis), nominal)
    elif diagnosis is not None:
        model = read_diagnosis(diagnosis, nominal)
    return predicted_columns(log, nominal, model)


def run(
    scenario: str,
    *,
    robot: Path_ = "burger",
    link: str = "rtl",
    sim: str = "verilator",
    engine: str | None = None,
    values: Mapping[str, float] | None = None,
    effects: Path_ | None = None,
    effect: Sequence[str] = (),
    compare: bool = False,
    figure: bool = True,
    out: Path_ | None = None,
) -> Outcome:
    """Drive a scenario in the real-time simulator: motors in Verilog or its model, robot in a physics engine (`rtds
    run`).

    Parameters
    ----------
    scenario : "linear", "circle", "eight" or another name of `rtds run --list`.
    robot : a robot that comes along ("burger", "jackal", ...: docs/ready-robots.md) or the path of a `robot.toml`.
    link : what computes the motors: "rtl" (the Verilog in `sim`, "verilator" or "icarus"; built when first used) or
        "model", which gives the same bits without a compiler.
    engine : "pybullet" or "mujoco"; None takes PyBullet, or MuJoCo where PyBullet has no wheel.
    values : parameters of the scenario by name, SI, such as {"duration_s": 4.0}.
    effects : a `diagnosis.json`: drive the robot it describes. effect : effects of the catalogue, each
        "id.parameter=value,side=left".
    compare : drive once more with the other controller, for the summary.
    out : folder for log, robot, summary and, with `figure`, the figure; nothing is written without it.

    Returns
    -------
    Outcome: `record` has times, (n, 2) speeds in rad/s and currents in A [left, right], poses, and the log's rows;
    `summary` errors, peaks and energies.

    Raises
    ------
    InputError : unknown name, a figure out of range, a motion the motors cannot follow. LinkError : no simulator.
    OutputError : `out` cannot be written.
    """
    from rtds_host.contract import check_writable
    from rtds_host.robot import default_engine

    # Not from the package, whose face `rtds_host.run` calls this function.
    from rtds_host.run.plan import Options, make_plan
    from rtds_host.run.session import LinkChoice, perform, write_outcome
    from rtds_host.run.summary import Effects
    from rtds_host.vectors import given

    options = Options(robot=str(robot), engine=default_engine() if engine is None else engine)
    plan = make_plan(scenario, dict(values or {}), options)
    change = None
    if effects is not None or effect:
        from rtds_host.correction.choose import choose
        from rtds_host.correction.translate import translate

        chosen = given(choose(plan.robot, None if effects is None else Path(effects), list(effect)), "what was chosen")
        change = Effects(
            translate(chosen.model, plan.robot, plan.body.payload_kg, step_s=plan.simulator_step_s), chosen.names
        )
    if out is not None:
        check_writable(Path(out))
    choice = LinkChoice(link, {"sim": sim, "step_clocks": "min"} if link == "rtl" else {})
    outcome = perform(plan, choice, compare, effects=change)
    if out is not None:
        write_outcome(outcome, Path(out), figure)
    return outcome


def close(
    case: Case | Path_,
    *,
    diagnosis: Mapping[str, Any] | Path_ | None = None,
    hold_out: Sequence[str] | None = None,
    link: str = "model",
    engine: str | None = None,
    quick: bool = True,
    causes: bool = False,
    threads: int = 0,
) -> Result:
    """Put a diagnosis into the real-time simulator and measure the gap there before and after (`rtds close`).

    Parameters
    ----------
    case : as read, or its folder.
    diagnosis : content of a `diagnosis.json`, or its path; without it the runs that are not held out are diagnosed,
    `quick` or
        not.
    hold_out : runs to replay; by default the last one, with a given diagnosis all.
    link, engine : as of `run`. causes : vary the simulator one thing at a time, to say where it differs from the
    replay. threads : cores for the diagnosis; 0 = all.

    Returns
    -------
    Result: `content` is that of `close.json` ("gap" in "simulator" and in "replay", each "before", "after", "closed"),
    `diagnosis` that of `diagnosis.json`.

    Raises
    ------
    InputError : a case that the simulator cannot drive, or a diagnosis that is impossible. LinkError : no simulator.
    """
    import json

    from rtds_host.contract.runlog import read_object
    from rtds_host.correction.close import close as close_case
    from rtds_host.correction.simulate import Setting
    from rtds_host.diagnosis.predict import read_diagnosis
    from rtds_host.workers import cores

    read = _case(case)
    given: dict[str, Any] | None = None
    path: Path | None = None
    if isinstance(diagnosis, Mapping):
        given = json.loads(json.dumps(dict(diagnosis)))
    elif diagnosis is not None:
        path = Path(diagnosis)
        read_diagnosis(path, read.robot)
        given = read_object(path)
    options: dict[str, Any] = {} if engine is None else {"engine": engine}
    setting = Setting(
        link=link, link_options={"sim": "verilator", "step_clocks": "min"} if link == "rtl" else {}, **options
    )
    return close_case(
        read,
        setting,
        given,
        path,
        list(hold_out) if hold_out else None,
        quick,
        causes,
        threads=threads or cores(),
    )


def import_case(
    sources: Sequence[Path_],
    out: Path_,
    *,
    robot: Path_ | None = None,
    mapping: Path_ | None = None,
    append: bool = False,
    trust_units: bool = False,
) -> Case:
    """Turn bags or csv files of a real robot into a case, one run each (`rtds import`).

    Parameters
    ----------
    sources : bags (a folder, .mcap or .db3), csv files, or SysId's .json. out : folder of the case.
    robot : a robot that comes along or a `robot.toml`; by default the mapping's. mapping : a mapping's file or name; by
        default the one that fits. append : add runs to a case that exists. trust_units : import even where a unit looks
        wrong.

    Returns
    -------
    The case as `read_case` reads it.

    Raises
    ------
    InputError : a recording, mapping or robot that cannot be used. OutputError : `out` cannot be written.
    """
    from rtds_host.importers.case import import_case as import_folder

    import_folder(
        [os.fspath(source) for source in sources],
        os.fspath(out),
        robot=None if robot is None else os.fspath(robot),
        mapping=None if mapping is None else os.fspath(mapping),
        append=append,
        trust_units=trust_units,
    )
    return read_case(out)


def export(diagnosis: Path_, to: str, *, robot: Robot | Path_ | None = None, out: Path_ | None = None) -> str:
    """The robot with a diagnosis in it for another simulator (`rtds export`).

    Parameters
    ----------
    diagnosis : path of a `diagnosis.json`. to : "mjcf", "urdf", "sdf", "usd-json" or "python".
    robot : nominal robot as read, or its `robot.toml`; by default the one of the case next to the diagnosis.
    out : file for the text; nothing is written without it.

    Returns
    -------
    The file's text, whose head says how each effect is in it.

    Raises
    ------
    InputError : an unusable file, an unknown target, or a robot that cannot be exported. OutputError : `out` cannot be
    written.
    """
    from rtds_host.contract import Robot, load_robot, write_atomic
    from rtds_host.export.export import default_robot, read_source
    from rtds_host.export.export import export as write

    path = Path(diagnosis)
    nominal = robot if isinstance(robot, Robot) else load_robot(default_robot(path) if robot is None else robot)
    text, _ = write(read_source(path, nominal), to)
    if out is not None:
        write_atomic(Path(out), text)
    return text


def plan(
    robot: Robot | Path_,
    scenario: str | None = None,
    *,
    floor_m: tuple[float, float] = (3.0, 3.0),
    margin_m: float = 0.3,
    kind: str | None = None,
    speed_m_s: float = math.inf,
    out: Path_ | None = None,
) -> Plan:
    """A manoeuvre for a robot, fitted to a floor (`rtds plan` of a robot.toml).

    Parameters
    ----------
    robot : as read, or its `robot.toml`. scenario : a name of `rtds run --list`; None takes the one on which the fewest
        effects look alike. floor_m : width and depth, m; margin_m : room to its edges, m. kind : "voltage" or
        "cmd_vel"; by default what the robot's driver takes. speed_m_s : fastest forward speed, m/s.
    out : folder for commands.csv, drive.py and plan.json; nothing is written without it.

    Returns
    -------
    Plan: `commands` with knots `t` (n,) s and `values` (n, 2), `payload_kg`, `start` (x m, y m, heading rad).

    Raises
    ------
    InputError : an unusable robot, an unknown scenario, a floor that is too small. OutputError : `out` cannot be
    written.
    """
    from rtds_host.contract import Robot, load_robot, staged_folder
    from rtds_host.diagnosis.replay.model import nominal_model
    from rtds_host.plan.make import Floor, check_robot, choose, driven_by_voltage, fit
    from rtds_host.plan.write import write
    from rtds_host.scenario import find_scenario

    nominal = robot if isinstance(robot, Robot) else load_robot(robot)
    kind = kind or ("cmd_vel" if nominal.driver.mode == "speed" else "voltage")
    check_robot(nominal, kind)
    wheels, room = driven_by_voltage(nominal), Floor(*floor_m, margin_m)
    models = [nominal_model(wheels)]
    if scenario is None:
        made, why = choose(wheels, kind, room, models, speed_m_s), "the fewest effects look alike on it"
    else:
        chosen, why = find_scenario(scenario), "asked for"
        made = fit(chosen, wheels, kind, room, models, chosen.payload_kg, speed_m_s)
    if out is not None:
        with staged_folder(Path(out)) as scratch:
            write(made, scratch, why)
    return made


def _case(case: Case | Path_) -> Case:
    from rtds_host.contract import Case

    return case if isinstance(case, Case) else read_case(case)
