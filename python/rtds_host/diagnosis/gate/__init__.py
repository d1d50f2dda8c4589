"""Checks on the data before any analysis: what is wrong with a log, said in a sentence, and what makes it useless.

`examine` refuses what cannot be a log at all, sets aside what is certainly no measurement, cuts runs at holes, and
measures what the rest of a diagnosis takes as given: each channel's noise with its rounding, and the clock.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rtds_host.contract import Case, Robot, RunLog
from rtds_host.contract.clock import moment
from rtds_host.diagnosis.gap import counts
from rtds_host.diagnosis.gate import (
    contradictions,
    cuts,
    glitches,
    loop,
    rounding,
    sensors,
    stamps,
    starts,
    timing,
    units,
)
from rtds_host.diagnosis.gate.findings import SEVERITIES, Finding, Gate, Timing, merged, percent
from rtds_host.diagnosis.gate.limits import Limits, channels, limits
from rtds_host.diagnosis.gate.sample_noise import noise_ratio
from rtds_host.diagnosis.gate.stuck import timed_faults
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.thresholds import MINOR_SHARE, SIGNIFICANT, few
from rtds_host.errors import InputError

__all__ = ["Finding", "Gate", "Timing", "examine"]


def examine(case: Case) -> Gate:
    """Check the data of a case, and set aside what is certainly no measurement.

    Raises
    ------
    InputError : no log at all (a clock or a channel in another unit than the contract's, a hole of minutes), or no run
        holds enough to diagnose anything: too short, nothing commanded and nothing moves, all speeds and angles dead.
    """
    case, repeats = contradictions.repeated(case)
    timing.check_clock(case)
    bounds = limits(case)
    case, asleep = starts.awake(case, bounds)
    units.check_commands(case, bounds)
    units.check_staircase(case)
    declared = {c: case.robot.noise(c) for c in channels(case.robot)}
    noise, steps = rounding.effective_noise(case)
    found = _notices(case) + repeats + asleep
    for log in case.runs:
        found += timing.clock_findings(log, case)
    runs, told = cuts.cut(case)
    found += told
    cleaned = replace(case, runs=runs)
    rounded = {c: rounding.noise_of(step) for c, step in steps.items()}
    cleaned, told = _without_glitches(cleaned, bounds, _shown(cleaned, rounded))
    found += told
    cleaned, told = loop.estimated(cleaned)
    found += told
    cleaned, told, lags = _compared(cleaned, bounds, rounded)
    found += told
    _enough(cleaned)
    stamped, shown = cleaned, _shown(cleaned, rounded)
    cleaned, told = stamps.evened(cleaned, shown, float(np.median([lag for _, lag in lags])) if lags else 0.0)
    found += told
    cleaned, stamps_s, told = stamps.settled(cleaned, shown)
    found += told
    found += _rounded(noise, steps, declared)
    commands = [timing.command_findings(log, cleaned, bounds.time_constant_s) for log in cleaned.runs]
    found += [f for findings, _, _ in commands for f in findings]
    if case.robot.chassis is not None:
        found += sensors.motions(cleaned)
    found = merged(found, len(cleaned.runs))
    if len(cleaned.runs) == 1:
        found.append(
            Finding(
                cleaned.runs[0].name,
                "",
                "one_run",
                "warning",
                "The case has one run only: what is held out is a part of it, and comes from the same motion.",
            )
        )
    found.sort(key=lambda f: -SEVERITIES.index(f.severity))
    apart = [a for _, a, _ in commands if math.isfinite(a)]
    times = [timing.sampled(log, case) for log in stamped.runs]
    clock = Timing(
        step_s=float(np.median([np.median(np.diff(t)) for t in times])),
        jitter_s=float(np.median([timing.jitter(t) for t in times])),
        stamps_s=stamps_s,
        lag_s=timing.lags_of(lags),
        command_step_s=float(np.median(apart)) if apart else math.nan,
        commands_enough=all(enough for _, _, enough in commands),
    )
    rounding_known = replace(cleaned, robot=replace(cleaned.robot, rounding=rounded))
    return Gate(tuple(found), rounding_known, noise_ratio(cleaned, rounded), clock)


def _notices(case: Case) -> list[Finding]:
    """What reading a run ignored or repaired."""
    return [
        Finding(log.name, "", "notice", "note", f"{text[0].upper()}{text[1:]}.")
        for log in case.runs
        for text in log.notices
    ]


def _without_glitches(case: Case, bounds: Limits, noise: dict[str, float]) -> tuple[Case, list[Finding]]:
    """The case without isolated samples, unless a channel has more than a handful of them, or of those that cannot be a
    tenth.
    """
    per_run = [glitches.isolated(log, case, bounds, noise) for log in case.runs]
    found: list[Finding] = []
    aside: list[dict[str, np.ndarray]] = [{} for _ in case.runs]
    for c in channels(case.robot):
        rows = sum(run[c][2] for run in per_run if c in run)
        sure = sum(len(run[c][0]) for run in per_run if c in run)
        count = sure + sum(len(run[c][1]) for run in per_run if c in run)
        if not count:
            continue
        if sure > max(1.0, MINOR_SHARE * rows) or count - sure > few(rows):
            found.append(
                Finding(
                    "",
                    c,
                    "isolated",
                    "warning",
                    f"{c} has {count} samples far off their neighbours ({percent(count / rows)}), too many "
                    "for glitches: none is set aside.",
                    count / rows,
                )
            )
            continue
        for log, run, out in zip(case.runs, per_run, aside):
            if c in run and len(run[c][0]) + len(run[c][1]):
                out[c] = np.union1d(run[c][0], run[c][1])
                found.append(_glitch(log, c, out[c], run[c][2]))
    runs = tuple(sensors.without(log, out) for log, out in zip(case.runs, aside))
    return replace(case, runs=runs), found


def _glitch(log: RunLog, c: str, rows: np.ndarray, of: int) -> Finding:
    """What is said of samples of a channel of so many that were set aside as glitches."""
    n = len(rows)
    some = ", ".join(moment(log.t[k]) for k in rows[:3]) + (" …" if n > 3 else "")
    return Finding(
        log.name,
        c,
        "glitch",
        "warning",
        f"{n} isolated sample{'s' if n > 1 else ''} of {c} far off their neighbours set "
        f"aside ({percent(n / of)}), at t = {some} s.",
        n / of,
    )


def _counting(case: Case, rounded: Mapping[str, float], replays: Sequence[np.ndarray] | None = None) -> Robot:
    """The case's robot with the noise that its samples show and what rounding adds; with the declared noise where they
    show next to none, as a simulator's do.

    Parameters
    ----------
    rounded : what rounding adds to each channel's noise; replays : as of `noise_ratio`.
    """
    ratio = noise_ratio(case, rounded, replays)
    return replace(case.robot, rounding=dict(rounded), noise_ratio=ratio if ratio > MINOR_SHARE else 1.0)


def _shown(case: Case, rounded: Mapping[str, float]) -> dict[str, float]:
    """Channel -> one standard deviation of its samples' noise, SI, as they show it: what is a fault, and whether stamps
    are wrong, does not depend on what a file declares."""
    return _noises(_counting(case, rounded), rounded)


def _noises(robot: Robot, channels: Iterable[str]) -> dict[str, float]:
    """Channel -> one standard deviation of its noise, SI, as a robot has it."""
    return {channel: robot.known_noise(channel) for channel in channels}


def _compared(
    case: Case, bounds: Limits, rounded: dict[str, float]
) -> tuple[Case, list[Finding], list[tuple[str, float]]]:
    """The case without clipped and frozen stretches, what a comparison with the nominal robot tells, and lags.

    rounded : what rounding adds to each channel's noise.
    """
    robot = case.robot
    model = nominal_model(robot)
    replayed_runs = [replay_run(model, run_inputs(log, robot)) for log in case.runs]
    # A sensor of few counts sits on each of them, its largest one, too. Held samples repeat themselves where others
    # show noise, whatever the file declares.
    counting = _counting(case, rounded, replayed_runs)
    noise = _noises(counting, rounded)
    found: list[Finding] = []
    lags: list[tuple[str, float]] = []
    runs, replays = [], []
    seen = []
    for log, replayed in zip(case.runs, replayed_runs):
        seen.append((log, units.compare(log, robot, replayed, bounds)))
        units.check_minutes(log, case)
    found += units.refuse(seen, robot, bounds)
    for (log, compared), replayed in zip(seen, replayed_runs):
        told, aside = sensors.in_samples(log, counting, replayed)
        timed, stuck = timed_faults(log, robot)
        told += timed
        for c, rows in stuck.items():
            aside[c] = np.union1d(aside[c], rows) if c in aside else rows
        for c, rows in glitches.against_replay(log, case, bounds, noise, replayed).items():
            aside[c] = np.union1d(aside[c], rows) if c in aside else rows
            told.append(_glitch(log, c, rows, int(np.isfinite(log.columns[c]).sum())))
        found += _commands(log, case) + told + compared.findings + sensors.motion(log, robot)
        lags += compared.lags
        runs.append(sensors.without(log, aside))
        replays.append((runs[-1], replayed))
    units.refuse_exchanged(case, replays)
    cleaned, notes_on_them = contradictions.settled(replace(case, runs=tuple(runs)), replayed_runs)
    return cleaned, found + notes_on_them, lags


def _commands(log: RunLog, case: Case) -> list[Finding]:
    """Commands that the supply cannot give."""
    robot = case.robot
    found: list[Finding] = []
    if robot.driver.mode != "voltage":
        return found
    for name in (f"v_cmd_{s}" for s in robot.sides):
        values = np.abs(log.columns[name])
        beyond = float(np.mean(values > robot.supply_v * (1 + 1e-6)))
        if beyond > 0:
            found.append(
                Finding(
                    log.name,
                    name,
                    "beyond_supply",
                    "warning" if beyond > MINOR_SHARE else "note",
                    f"{name} asks for up to {float(values.max()):.3g} V, more than the supply's "
                    f"{robot.supply_v:g} V, in {percent(beyond)} of the rows; the replay clips it.",
                    beyond,
                )
            )
    return found


def _rounded(noise: dict[str, float], steps: dict[str, float], declared: dict[str, float | None]) -> list[Finding]:
    """Channels whose rounding counts against their noise."""
    return [
        Finding(
            "",
            c,
            "rounded",
            "note",
            f"{c} is rounded to steps of {steps[c]:.3g}: its noise counts as {noise[c]:.3g} in place of "
            f"{declared[c]:.3g}.",
        )
        for c in noise
        if (size := declared.get(c)) and noise[c] > (1.0 + MINOR_SHARE) * size
    ]


def _enough(case: Case) -> None:
    """Refuse a case that holds nothing to diagnose."""
    robot, first = case.robot, case.runs[0]
    where = first.path or first.name
    wheels = [c for c in channels(robot) if c.startswith(("w_", "th_"))]
    alive = moving = excited = False
    for log in case.runs:
        for c in (c for c in wheels if log.has(c)):
            spread = float(np.nanstd(log.columns[c]))
            alive |= spread > 0
            # What turns steadily moves, too.
            moved = math.sqrt(float(np.nanmean(log.columns[c] ** 2))) if c.startswith("w_") else spread
            moving |= moved > SIGNIFICANT * min(robot.noise(c) or math.inf, sensors.scatter(log.columns[c]))
        excited |= bool(np.abs(log.commands(robot.driver.mode)).max() > 1e-6)
    longest = max(float(log.t[-1] - log.t[0]) for log in case.runs)
    rows = max(len(log.t) for log in case.runs)
    if all(timing.shorter_than_any(log.t) for log in case.runs) or rows < cuts.FEWEST_ROWS:
        raise InputError(
            f"{where}: the longest run of the case lasts {longest:.3g} s with {rows} rows, at least "
            f"{timing.SHORTEST_S:g} s and {cuts.FEWEST_ROWS} rows are needed"
        )
    if not alive:
        raise InputError(
            f"{where}: w_*, th_*: constant to the last digit in every run, the sensors are dead or nothing moves"
        )
    if not moving:
        raise InputError(
            f"{where}: w_*, th_*: the wheels move in no run by more than their noise"
            + ("" if excited else " and every command is 0")
            + ", there is nothing to diagnose"
        )
    if not any(counts(log, robot) for log in case.runs):
        raise InputError(
            f"{where}: nothing in it counts: no channel has both samples and a noise in [sensors], or of angles and "
            f"poses alone no run has a whole second"
        )
