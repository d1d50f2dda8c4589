"""`rtds close`: a diagnosis put into the real-time simulator, and whether the gap closes there."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from rtds_host.cleanup import temporary_folder
from rtds_host.contract import Case, Robot, RunLog, places_of_case, read_writable_case, refuse_inputs, staged_folder
from rtds_host.contract.runlog import read_object
from rtds_host.correction.correction import Correction
from rtds_host.correction.remainder import Remainder, estimate
from rtds_host.correction.result import Result, Run
from rtds_host.correction.simulate import Setting, simulate
from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.diagnose import diagnose
from rtds_host.diagnosis.predict import on_its_clock, read_diagnosis
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import REPORT_STEP_S, Model, nominal_model, replay_run
from rtds_host.errors import InputError, did_you_mean
from rtds_host.plant.schema import OUTPUTS

SCHEMA = "rtds-close/1"
# A replay so fine that its own step does not count.
FINE_STEP_S = 5e-5
# What is varied, one at a time, to say where simulator and replay differ.
VARIATIONS: tuple[tuple[str, str, dict], ...] = (
    ("torques exchanged each 32 ms, predicted", "exchange interval", {"exchange_steps": 32}),
    ("torques exchanged each 32 ms, one exchange late", "exchange interval", {"exchange_steps": 32, "predict": False}),
    ("torques exchanged each 1 ms, one exchange late", "exchange interval", {"predict": False}),
    ("the other physics engine", "contact solver", {"engine": None}),
    ("motor units at half their step", "step of the motor units", {"step_s": None}),
    ("12-bit converters on all wires", "link quantisation", {"converters": True}),
)

Progress = Callable[[str, float], None]


def held_out(case: Case, names: list[str] | None) -> tuple[str, ...]:
    """Which runs to keep out of the diagnosis: those named, else the last of several.

    Raises
    ------
    InputError : no such run, or none would be left to diagnose.
    """
    known = [run.name for run in case.runs]
    for name in names or []:
        if name not in known:
            raise InputError(
                f"--hold-out {name}: the case has no such run (it has {', '.join(known)}){did_you_mean(name, known)}"
            )
    chosen = tuple(dict.fromkeys(names or known[-1:]))
    if len(known) == 1:
        return chosen
    if len(chosen) == len(known):
        raise InputError("--hold-out: no run would be left to diagnose")
    return chosen


def _inputs(case: Case, model: Model, logs: Iterable[RunLog]) -> dict[str, tuple[np.ndarray, ...]]:
    """Inputs of the replay for each run, with the heading where the log holds none, see `Problem.aligned`."""
    problem = Problem(replace(case, runs=tuple(logs)), 1)
    return {data.log.name: data.inputs for data in problem.whole_runs_starting(problem.aligned(model))}


def _gap(parts: list[dict[str, np.ndarray]]) -> tuple[float, dict[str, float]]:
    channels = gaps.pooled(parts)
    return gaps.gap(channels), channels


def as_measured(log: RunLog, out: np.ndarray) -> RunLog:
    """A log whose measured channels hold an answer `out` (n, 11) instead, in the rows that have samples."""
    columns = dict(log.columns)
    for k, name in enumerate(OUTPUTS):
        if log.has(name):
            columns[name] = np.where(np.isfinite(log.columns[name]), out[:, k], np.nan)
    return replace(log, columns=columns)


def distance(case: Case, runs: Iterable[tuple[RunLog, np.ndarray, np.ndarray]]) -> tuple[float, dict[str, float]]:
    """How far answers lie apart, (log, one, other) each, measured as a gap is: in units of the sensors' noise."""
    return _gap([gaps.errors(as_measured(log, one), case.robot, other) for log, one, other in runs])


def _tell(say: Callable[[str, float], None], stage: str, base: float, per_s: float, t_s: float) -> None:
    """Say how far a run is: a share that grows from `base` with the time."""
    say(stage, base + per_s * t_s)


def _round(value: float | None, digits: int = 5) -> float | None:
    return None if value is None else float(f"{value:.{digits}g}")


def _check_driven(case: Case) -> None:
    """Whether the simulator can drive the robot, before it is diagnosed.

    Raises
    ------
    InputError : a single axis, or a robot that is commanded speeds or torques.
    """
    robot = case.robot
    if robot.axis is not None:
        raise InputError(f"{case.path}: is a single axis, the real-time simulator has a robot on two wheels")
    if robot.driver.mode != "voltage":
        place = f"robot {robot.name!r}" if case.path is None else case.path / "robot.toml"
        raise InputError(f"{place}: [driver] mode is {robot.driver.mode!r}, the real-time simulator drives by voltage")


def close(
    case: Case,
    setting: Setting | None = None,
    diagnosis: dict | None = None,
    diagnosis_path: Path | None = None,
    hold_out: list[str] | None = None,
    quick: bool = True,
    causes: bool = True,
    table: bool = False,
    remainder: Remainder | None = None,
    threads: int = 2,
    progress: Progress | None = None,
) -> Result:
    """Diagnose a case, or take its diagnosis, and replay held-out runs in the real simulator.

    Parameters
    ----------
    setting : of the simulator. diagnosis : content of a diagnosis.json and the path it was read from; without it the
        runs that are not held out are diagnosed (`quick`: by a narrower search).
    hold_out : names of the runs to replay; by default the last one, with a given diagnosis all.
    causes : vary the simulator one thing at a time on the first of them, to say where it differs from the replay.
    table : estimate what the diagnosis leaves as a table and load it too. remainder : a table estimated before.

    Raises
    ------
    InputError : a case the simulator cannot drive, or that a diagnosis is impossible for. LinkError : no answer.
    """
    setting = setting or Setting()
    say = progress or (lambda stage, share: None)
    robot = case.robot
    _check_driven(case)
    notes: list[str] = []
    if diagnosis is None:
        names = held_out(case, hold_out)
        kept = tuple(run for run in case.runs if run.name not in names) or case.runs
        if len(kept) == len(case.runs):
            notes.append("one run only: it was diagnosed and replayed, nothing is held out")
        fitted = replace(case, runs=kept)
        diagnosis, _ = diagnose(
            fitted,
            quick=quick,
            threads=threads,
            progress=lambda stage, share: say(f"diagnosis: {stage}", 0.5 * share),
        )
    else:
        names = held_out(case, hold_out) if hold_out else tuple(run.name for run in case.runs)
        fitted = case
        notes.append("the diagnosis was given: its parameters may have been fitted to the runs replayed here")
    model = model_of(diagnosis, robot, diagnosis_path)
    # The diagnosis has put the clock of its runs right by itself; the ones that are replayed need it, too.
    case, told = on_its_clock(case, model)
    notes += [finding.text for finding in told]
    inputs = _inputs(case, model, logs := [run for run in case.runs if run.name in names])
    if table and remainder is None:
        remainder = estimate(on_its_clock(fitted, model)[0], model, diagnosis)
        if remainder is None:
            notes.append("--table: no table explains enough of what is left; none was loaded")
    change = remainder.load if remainder is not None else None

    runs = []
    for k, log in enumerate(logs):
        run, notes_on_them = _driven(
            log, robot, model, setting, inputs[log.name], change, say, (0.5 + 0.5 * k / len(logs), 0.5 / len(logs))
        )
        runs.append(run)
        notes += [note for note in notes_on_them if note not in notes]
    content = _content(case, setting, diagnosis, names, runs)
    if remainder is not None:
        content["table"] = remainder.to_json()
    if causes:
        say("causes", 0.97)
        first = runs[0]
        why = _causes(case, model, first, inputs[first.log.name], setting, change)
        content["difference"] |= {"causes": why, "causes_on": first.log.name}
    content["notes"] = notes
    say("done", 1.0)
    return Result(content, runs, diagnosis, notes)


def _driven(
    log: RunLog,
    robot: Robot,
    model: Model,
    setting: Setting,
    inputs: tuple[np.ndarray, ...],
    change: Callable[[Correction, np.ndarray], Correction] | None,
    say: Callable[[str, float], None],
    share: tuple[float, float],
) -> tuple[Run, list[str]]:
    """One run in replay and simulator, nominal and corrected, and what is said of it; `share`: where its part of the
    work begins and how much of it that is.
    """
    start, notes = inputs[-1], []
    step = min(REPORT_STEP_S, model.step_s)
    replayed = {"before": replay_run(nominal_model(robot), inputs, step), "after": replay_run(model, inputs, step)}
    simulated = {}
    for name, wanted in (("before", None), ("after", model)):
        stage = f"{log.name}: {'nominal' if wanted is None else 'corrected'}"
        base = share[0] + 0.5 * share[1] * (name == "after")
        per_s = 0.5 * share[1] / max(log.t[-1] - log.t[0], 1e-9)
        told = partial(_tell, say, stage, base, per_s)
        got = simulate(log, robot, wanted, setting, start, change if wanted is not None else None, told)
        simulated[name] = got.out
        notes += [note for note in got.notes if note not in notes]
    return Run(log, start, replayed, simulated), notes


def model_of(diagnosis: dict, robot, path: Path | None = None) -> Model:
    """The replay's model of a diagnosis: its nominal fit and its effects.

    Raises
    ------
    InputError : see `read_diagnosis`; the message names `path`, where the content came from.
    """
    if path is not None:
        return read_diagnosis(path, robot)
    with temporary_folder() as folder:
        place = folder / "diagnosis.json"
        place.write_text(json.dumps(diagnosis), encoding="utf-8")
        return read_diagnosis(place, robot)


def _content(case: Case, setting: Setting, diagnosis: dict, names: tuple[str, ...], runs: list[Run]) -> dict:
    robot = case.robot
    gap: dict[str, dict] = {}
    channels: dict[str, dict[str, float | None]] = {}
    for which, outs in (("replay", "replayed"), ("simulator", "simulated")):
        before, by_before = _gap([gaps.errors(r.log, robot, getattr(r, outs)["before"]) for r in runs])
        after, by_after = _gap([gaps.errors(r.log, robot, getattr(r, outs)["after"]) for r in runs])
        gap[which] = {"before": _round(before), "after": _round(after), "closed": _round(gaps.closed(before, after))}
        for channel in by_before:
            entry = channels.setdefault(channel, {})
            entry[f"{which}_before"], entry[f"{which}_after"] = _round(by_before[channel]), _round(by_after[channel])
    ours, theirs = gap["simulator"]["closed"], gap["replay"]["closed"]
    share = None if ours is None or not theirs or theirs <= 0 else ours / theirs
    difference: dict = {}
    for name in ("before", "after"):
        total, by_channel = distance(case, ((r.log, r.replayed[name], r.simulated[name]) for r in runs))
        difference["nominal" if name == "before" else "corrected"] = {
            "gap": _round(total),
            "channels": {c: _round(v) for c, v in by_channel.items()},
        }
    return {
        "schema": SCHEMA,
        "case": case.name,
        "runs": list(names),
        "verdict": diagnosis["verdict"],
        "effects": diagnosis.get("effects") or [],
        "nominal_fit": diagnosis.get("nominal_fit") or {},
        "simulator": {
            "link": setting.link,
            "engine": setting.engine,
            "exchange_s": setting.exchange_steps * 1e-3,
            "predicted": setting.predict,
            "step_s": setting.step_s,
        },
        "gap": {**gap, "share_of_replays_closure": _round(share), "channels": channels},
        "difference": difference,
    }


def _varied(setting: Setting, change: dict) -> Setting:
    values = dict(change)
    if "engine" in values:
        values["engine"] = "mujoco" if setting.engine == "pybullet" else "pybullet"
    if "step_s" in values:
        values["step_s"] = 0.5 * setting.step_s
    # The RTL gives the model's bits; the model is what is varied.
    return replace(setting, link="model", link_options={}, **values)


def _causes(
    case: Case,
    model: Model,
    run: Run,
    inputs: tuple[np.ndarray, ...],
    setting: Setting,
    change: Callable[[Correction, np.ndarray], Correction] | None,
) -> list[dict]:
    """What each variation of the simulator moves, and how far it then lies from a replay of a very fine step."""
    log, start = run.log, run.start
    fine = replay_run(model, inputs, FINE_STEP_S)
    here = run.simulated["after"]
    own, _ = distance(case, [(log, fine, run.replayed["after"])])
    total, _ = distance(case, [(log, fine, here)])
    rows: list[dict] = [
        {"varied": "nothing", "cause": "all that is left", "moves": 0.0, "from_replay": _round(total)},
        {"varied": "the replay's step", "cause": "step of the replay", "moves": _round(own), "from_replay": None},
    ]
    for text, cause, values in VARIATIONS:
        try:
            out = simulate(log, case.robot, model, _varied(setting, values), start, change).out
        except InputError as error:
            rows.append({"varied": text, "cause": cause, "moves": None, "from_replay": None, "note": str(error)})
            continue
        moved, _ = distance(case, [(log, here, out)])
        away, _ = distance(case, [(log, fine, out)])
        rows.append({"varied": text, "cause": cause, "moves": _round(moved), "from_replay": _round(away)})
    return rows


# What `close_folder` writes.
FILES = ("close.json", "diagnosis.json", "close.png")


def close_folder(folder: Path, out: Path, diagnosis: Path | None = None, figure: bool = True, **options) -> Result:
    """`close` of a case folder, its result written to `out`: close.json, diagnosis.json, close.png.

    Raises
    ------
    InputError : see `close`. OutputError : the place cannot be written, or is an input; nothing is left half-written.
    """
    refuse_inputs([out, *(out / name for name in FILES)], [*places_of_case(folder), diagnosis])
    case = read_writable_case(folder)
    given = None
    if diagnosis is not None:
        read_diagnosis(diagnosis, case.robot)
        given = read_object(diagnosis)
        if given.get("verdict") not in ("none", "known", "partial", "unknown"):
            raise InputError(
                f"{diagnosis}: verdict: is {given.get('verdict')!r}, it must be none, known, partial or unknown"
            )
    result = close(case, diagnosis=given, diagnosis_path=diagnosis, **options)
    with staged_folder(out) as scratch:
        (scratch / "close.json").write_text(
            json.dumps(result.content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )
        (scratch / "diagnosis.json").write_text(
            json.dumps(result.diagnosis, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )
        if figure:
            from rtds_host.correction.figure import draw

            draw(case, result, scratch / "close.png")
    return result
