"""Checks on the data before any analysis: what is wrong with a log, said in a sentence, and what makes it useless.

Units and delays are judged against the nominal replay; a gain within the reach of the catalogue is left to the
diagnosis, only a factor that is a unit's is suspected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rtds_host.contract import Case, Robot, RunLog
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.replay.slots import OUTPUT_INDEX
from rtds_host.errors import InputError

SLOW_HZ = 30.0
SHORT_S = 2.0
DELAY_S = 0.01
SEVERITIES = ("note", "warning", "fatal")


@dataclass(frozen=True)
class Finding:
    """One thing about the data: `run` and `channel` may be empty (all of them); `text` is a whole sentence."""

    run: str
    channel: str
    kind: str
    severity: str
    text: str


@dataclass(frozen=True)
class Gate:
    """Findings of a case, worst first."""

    findings: tuple[Finding, ...]

    def of(self, kind: str) -> tuple[Finding, ...]:
        """Findings of one kind."""
        return tuple(f for f in self.findings if f.kind == kind)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings that may spoil the result."""
        return tuple(f for f in self.findings if f.severity != "note")


def _channels(log: RunLog, robot: Robot) -> list[str]:
    ends = tuple(f"_{s}" for s in robot.sides)
    names = [f"{c}{e}" for c in ("i", "w", "th") for e in ends]
    names += ["v_bus"] + (["gyro_z", "x", "y", "yaw"] if robot.chassis is not None else [])
    return [c for c in names if log.has(c)]


def _timing(log: RunLog) -> list[Finding]:
    dt = np.diff(log.t)
    step = float(np.median(dt))
    rate = 1.0 / step
    found = []
    if step >= 0.5:
        found.append(Finding(log.name, "t", "unit", "warning",
                             f"t advances by {step:.3g} s a row: is it in milliseconds?"))
    elif rate < SLOW_HZ * 0.98:
        found.append(Finding(log.name, "t", "rate", "warning",
                             f"{rate:.3g} rows a second are few: below {SLOW_HZ:.0f} Hz parameters of fast parts "
                             "are biased."))
    holes = np.flatnonzero(dt > max(5.0 * step, 0.1))
    if holes.size:
        worst = int(holes[np.argmax(dt[holes])])
        found.append(Finding(log.name, "t", "gap", "warning",
                             f"{holes.size} hole(s) without a row, the longest {dt[worst]:.3g} s at "
                             f"t = {log.t[worst]:.4g} s."))
    regular = dt[dt <= max(5.0 * step, 0.1)]
    jitter = float(np.std(regular[regular < 1.7 * step])) / step if len(regular) > 2 else 0.0
    if jitter > 0.02:
        found.append(Finding(log.name, "t", "jitter", "note",
                             f"rows are unevenly spaced: {1e3 * step:.3g} ms ± {100 * jitter:.0f} %."))
    missed = float(np.sum(np.round(regular / step) - 1)) / len(dt)
    if jitter < 0.3 and missed > 0.002:
        found.append(Finding(log.name, "t", "dropped", "note", f"about {100 * missed:.1f} % of the rows are missing."))
    length = float(log.t[-1] - log.t[0])
    if length < SHORT_S:
        found.append(Finding(log.name, "t", "short", "warning", f"the run lasts {length:.3g} s only."))
    elif len(log.t) < 50:
        found.append(Finding(log.name, "t", "short", "warning", f"the run has {len(log.t)} rows only."))
    return found


def _commands(log: RunLog, robot: Robot) -> list[Finding]:
    found = []
    names = [f"w_cmd_{s}" if robot.driver.mode == "speed" else f"v_cmd_{s}" for s in robot.sides]
    for name in names:
        values = log.columns[name]
        if robot.driver.mode != "voltage":
            continue
        top = float(np.max(np.abs(values)))
        beyond = float(np.mean(np.abs(values) > robot.supply_v * (1 + 1e-6)))
        if top > 30.0 * robot.supply_v:
            found.append(Finding(log.name, name, "unit", "warning",
                                 f"{name} reaches {top:.4g} at a supply of {robot.supply_v:g} V: is it in "
                                 "millivolts?"))
        elif beyond > 0:
            found.append(Finding(log.name, name, "beyond_supply", "warning" if beyond > 0.05 else "note",
                                 f"{name} asks for up to {top:.3g} V, more than the supply's {robot.supply_v:g} V, in "
                                 f"{100 * beyond:.1f} % of the rows; the replay clips it."))
    return found


def _samples(log: RunLog, robot: Robot, replayed: np.ndarray) -> list[Finding]:
    """Sampling of each channel, dead, clipped and wrapped channels."""
    found = []
    rows = len(log.t)
    channels = _channels(log, robot)
    moves = any(float(np.nanstd(log.columns[c])) > 5.0 * (robot.noise(c) or 1e-9)
                for c in channels if c.startswith(("w_", "th_", "x", "y")))
    for c in channels:
        values = log.columns[c]
        good = np.isfinite(values)
        v, t = values[good], log.t[good]
        noise = robot.noise(c)
        if noise is None:
            found.append(Finding(log.name, c, "no_noise", "note",
                                 f"robot.toml declares no noise for {c}: it is shown, not used."))
            continue
        if len(v) < 0.9 * rows and len(v) > 1:
            found.append(Finding(log.name, c, "slow", "note",
                                 f"{c} has a sample in {len(v)} of {rows} rows ({1 / float(np.median(np.diff(t))):.3g} "
                                 "Hz)."))
            if float(np.max(np.diff(t))) > max(1.0, 10 * float(np.median(np.diff(t)))):
                found.append(Finding(log.name, c, "gap", "warning",
                                     f"{c} has no sample for {float(np.max(np.diff(t))):.3g} s."))
        if len(v) < 10:
            found.append(Finding(log.name, c, "short", "warning", f"{c} has {len(v)} samples only."))
            continue
        steps = np.diff(v)
        if not steps.any():
            column = replayed[good, OUTPUT_INDEX[c]]
            expected = float(np.std(column))
            if c == "v_bus":
                found.append(Finding(log.name, c, "constant", "note",
                                     f"v_bus is {v[0]:.4g} V to the last digit: it was not measured, or held."))
            elif (moves and expected > 20.0 * noise) or (c[0] == "i" and moves):
                found.append(Finding(log.name, c, "dead", "warning",
                                     f"{c} stays at {v[0]:.4g} to the last digit while the robot moves: a dead sensor?"))
            continue
        if not np.isfinite(replayed).all() or c.startswith("th_") or c in ("x", "y", "yaw"):
            pass
        else:
            found += _clipped(log, c, v, replayed[good, OUTPUT_INDEX[c]], noise)
            found += _frozen(log, c, v, t, noise)
        if c == "yaw" or c.startswith("th_"):
            turns = np.flatnonzero(np.abs(np.abs(steps) - 2 * math.pi) < 0.8)
            if turns.size and np.median(np.abs(steps)) < 0.5:
                found.append(Finding(log.name, c, "wrapped", "warning",
                                     f"{c} jumps by a whole turn {turns.size} time(s), first at "
                                     f"t = {t[turns[0] + 1]:.4g} s: it is wrapped; unwrap it."))
    return found


def _clipped(log: RunLog, c: str, v: np.ndarray, replayed: np.ndarray, noise: float) -> list[Finding]:
    for edge, word in ((v.max(), "above"), (v.min(), "below")):
        at = v == edge
        count = int(at.sum())
        if count < max(20, 0.005 * len(v)) or edge == 0:
            continue
        beside = (np.abs(v - edge) < 4.0 * noise) & ~at
        near = np.unique(v[beside], return_counts=True)[1]
        levels = 1 if near.size == 0 else int(near.max())
        quantum = float(np.min(np.diff(np.unique(v))))
        # A settled reading of a coarse sensor also repeats; there the replay stands still too.
        moved = float(np.std(replayed[at]))
        if count > 5 * levels and moved > 3.0 * max(noise, min(quantum, 10 * noise)):
            return [Finding(log.name, c, "clipped", "warning",
                            f"{c} never goes {word} {edge:.4g} and sits there in {100 * count / len(v):.1f} % of its "
                            "samples: it is clipped.")]
    return []


def _frozen(log: RunLog, c: str, v: np.ndarray, t: np.ndarray, noise: float) -> list[Finding]:
    """A noisy channel that repeats one value for long."""
    same = np.diff(v) == 0
    if len(v) < 50 or np.mean(same) > 0.3 or float(np.min(np.diff(np.unique(v)))) > 0.3 * noise:
        # A coarse sensor repeats itself.
        return []
    change = np.flatnonzero(np.concatenate([[True], ~same, [True]]))
    runs = np.diff(change)
    longest = int(np.argmax(runs))
    if runs[longest] < 8:
        return []
    first = change[longest]
    long = t[min(first + runs[longest] - 1, len(t) - 1)] - t[first]
    if long < 0.05:
        return []
    return [Finding(log.name, c, "frozen", "warning",
                    f"{c} repeats {v[first]:.4g} for {long:.3g} s from t = {t[first]:.4g} s: samples were held.")]


def _lag_and_ratio(log: RunLog, channel: str, replayed: np.ndarray,
                   search: bool) -> tuple[float, float, float] | None:
    """Lag (s, positive: the measured comes later), root-mean-square ratio and correlation to the nominal replay.

    Without `search` the lag is taken as 0.
    """
    good = np.isfinite(log.columns[channel])
    v, t = log.columns[channel][good], log.t[good]
    if len(v) < 50:
        return None
    thin = max(1, len(v) // 1500)
    some, at = v[::thin] - v[::thin].mean(), t[::thin]

    def match(lag: float) -> float:
        r = np.interp(at - lag, log.t, replayed)
        r = r - r.mean()
        norm = float(np.sqrt(np.sum(r * r) * np.sum(some * some)))
        return float(np.sum(r * some)) / norm if norm > 0 else 0.0

    if not search:
        lag = 0.0
    else:
        lag = max(np.arange(-0.1, 0.301, 0.01), key=lambda x: abs(match(x)))
        lag = float(max(lag + np.arange(-0.009, 0.0095, 0.001), key=lambda x: abs(match(x))))
        # A lag counts only if it explains much of what the replay misses: distortion shifts a peak a little, too.
        if 1.0 - abs(match(lag)) > 0.5 * (1.0 - abs(match(0.0))):
            lag = 0.0
    best = (lag, match(lag))
    r = np.interp(t - best[0], log.t, replayed)
    scale = float(np.sqrt(np.sum(v**2) / max(np.sum(r**2), 1e-30)))
    return best[0], math.copysign(scale, best[1]), abs(best[1])


def _units(log: RunLog, robot: Robot, replayed: np.ndarray) -> list[Finding]:
    """Units that cannot be right, delays and swapped signs, from a comparison with the nominal replay."""
    found = []
    radius = robot.chassis.wheel_radius_m if robot.chassis else math.nan
    gear = robot.motor.gear_ratio
    speed = {"degrees per second": 180 / math.pi, "revolutions per minute": 30 / math.pi,
             "metres per second at the rim": radius, "millimetres per second at the rim": 1e3 * radius,
             "radians per second of the motor": gear, "revolutions per minute of the motor": gear * 30 / math.pi}
    angle = {"degrees": 180 / math.pi, "turns": 0.5 / math.pi, "radians of the motor": gear}
    factors = {"w": speed, "th": angle, "i": {"milliamperes": 1000.0}, "gyro": {"degrees per second": 180 / math.pi},
               "yaw": {"degrees": 180 / math.pi}, "x": {"millimetres": 1000.0, "centimetres": 100.0},
               "y": {"millimetres": 1000.0, "centimetres": 100.0}}
    ratios = {}
    for c in _channels(log, robot):
        values = log.columns[c]
        if c == "v_bus":
            level = float(np.nanmedian(np.abs(values)))
            if level > 200.0 * robot.supply_v:
                found.append(Finding(log.name, c, "unit", "warning",
                                     f"v_bus is {level:.4g} at a supply of {robot.supply_v:g} V: millivolts?"))
            elif not robot.supply_v / 3 < level < 3 * robot.supply_v:
                found.append(Finding(log.name, c, "level", "warning",
                                     f"v_bus is {level:.3g} V, the nominal supply {robot.supply_v:g} V."))
            continue
        column = replayed[:, OUTPUT_INDEX[c]]
        noise = robot.noise(c)
        if noise is None or not np.isfinite(column).all() or float(np.std(column)) < 10 * noise:
            continue
        result = _lag_and_ratio(log, c, column - column[0] if c.startswith(("th", "x", "y")) else column,
                                c[0] == "w" and robot.driver.mode == "voltage")
        if result is None:
            continue
        lag, ratio, match = result
        if c.startswith(("th", "x", "y")):
            first = values[np.isfinite(values)][0]
            moved = float(np.sqrt(np.nanmean((values - first) ** 2)))
            ratio = math.copysign(moved / max(float(np.sqrt(np.mean((column - column[0]) ** 2))), 1e-30), ratio)
        ratios[c] = ratio
        # Currents and ways depend on friction too; speeds are held by the back-EMF.
        loose = 3.0 if c[0] in "ixy" else 1.25
        if match > 0.8 or (c[0] in "ixy" and match > 0.3):
            for unit, factor in factors[c.split("_")[0]].items():
                if math.isfinite(factor) and not 1 / 3 < factor < 3 and 1 / loose < abs(ratio) / factor < loose:
                    found.append(Finding(log.name, c, "unit", "warning",
                                         f"{c} is {abs(ratio):.3g} times what the nominal robot would show: is it in "
                                         f"{unit}? (factor {factor:.3g})"))
                    break
        if c[0] == "w" and match > 0.97:
            if ratio < 0:
                found.append(Finding(log.name, c, "sign", "note",
                                     f"{c} runs against its command (correlation {-match:.2f}): leads or sign swapped?"))
            step = float(np.median(np.diff(log.t[np.isfinite(values)])))
            if abs(lag) > max(DELAY_S, 1.01 * step):
                late = lag > 0
                found.append(Finding(log.name, c, "delay", "warning" if not late or lag > 0.05 else "note",
                                     f"{c} answers the command {1e3 * abs(lag):.0f} ms {'later' if late else 'earlier'}"
                                     " than the nominal robot" + ("." if late else ": clocks that do not agree?")))
    if robot.driver.mode == "voltage":
        for s in robot.sides:
            top = float(np.max(np.abs(log.columns[f"v_cmd_{s}"])))
            ratio = ratios.get(f"w_{s}", ratios.get(f"th_{s}"))
            if ratio is not None and robot.supply_v > 3 and top <= 1.05 and abs(ratio) / robot.supply_v > 0.6:
                found = [f for f in found if not (f.kind == "unit" and f.channel in (f"w_{s}", f"th_{s}", f"i_{s}"))]
                found.append(Finding(log.name, f"v_cmd_{s}", "unit", "warning",
                                     f"v_cmd_{s} never exceeds {top:.3g} V, too little for the speeds measured: is it "
                                     "a duty?"))
    return found


def _merged(found: list[Finding], case: Case) -> list[Finding]:
    """One finding in place of the same in every run."""
    runs = len(case.runs)
    groups: dict[tuple[str, str], list[Finding]] = {}
    for f in found:
        groups.setdefault((f.channel, f.kind), []).append(f)
    result = []
    for group in groups.values():
        names = list(dict.fromkeys(f.run for f in group))
        if runs > 1 and len(names) == runs or len(names) > 4:
            worst = max(group, key=lambda f: SEVERITIES.index(f.severity))
            where = "every run" if len(names) == runs else f"{len(names)} of {runs} runs"
            result.append(Finding("", worst.channel, worst.kind, worst.severity,
                                  f"In {where}, as in {worst.run}: {worst.text}"))
        else:
            result += group
    return result


def examine(case: Case) -> Gate:
    """Check the data of a case.

    Raises
    ------
    InputError : no run holds enough to diagnose anything: too short, nothing commanded and nothing moves, all
        speeds and angles dead.
    """
    robot = case.robot
    model = nominal_model(robot)
    found: list[Finding] = []
    moving, excited, alive, longest = [], [], [], 0.0
    for log in case.runs:
        inputs = run_inputs(log, robot)
        replayed = replay_run(model, inputs)
        found += _timing(log) + _commands(log, robot) + _samples(log, robot, replayed) + _units(log, robot, replayed)
        found += [Finding(log.name, "", "notice", "note", f"{text[0].upper()}{text[1:]}.") for text in log.notices]
        longest = max(longest, float(log.t[-1] - log.t[0]))
        wheels = [c for c in _channels(log, robot) if c.startswith(("w_", "th_"))]
        alive.append(any(np.nanstd(log.columns[c]) > 0 for c in wheels))
        spread = [float(np.nanstd(log.columns[c])) / (robot.noise(c) or float(np.nanstd(log.columns[c])) or 1.0)
                  for c in wheels]
        moving.append(max(spread, default=0.0) > 3.0)
        command = inputs[1]
        excited.append(bool(np.abs(command).max() > 1e-6))
        if moving[-1] and not np.ptp(command, axis=0).any() and excited[-1]:
            found.append(Finding(log.name, "", "excitation", "note", "The command never changes in this run."))
        if excited[-1] and not moving[-1]:
            found.append(Finding(log.name, "", "still", "note", "The wheels do not move in this run although a command "
                                                                "is given."))
    first = case.runs[0]
    where = first.path or first.name
    if longest < 0.5 or max(len(log.t) for log in case.runs) < 20:
        raise InputError(f"{where}: the longest run of the case lasts {longest:.3g} s with "
                         f"{max(len(log.t) for log in case.runs)} rows, at least 0.5 s and 20 rows are needed")
    if not any(alive):
        raise InputError(f"{where}: w_*, th_*: constant to the last digit in every run, the sensors are dead or "
                         "nothing moves")
    if not any(moving):
        raise InputError(f"{where}: w_*, th_*: the wheels move in no run by more than their noise"
                         + ("" if any(excited) else " and every command is 0") + ", there is nothing to diagnose")
    if robot.chassis is not None and len(case.runs):
        found += _motions(case)
    found = _merged(found, case)
    if len(case.runs) == 1:
        found.append(Finding(first.name, "", "one_run", "warning",
                             "The case has one run only: what is held out is a part of it, and comes from the same "
                             "motion."))
    found.sort(key=lambda f: -SEVERITIES.index(f.severity))
    return Gate(tuple(found))


def _motions(case: Case) -> list[Finding]:
    """What the motions of all runs together leave out."""
    names = [f"w_{s}" for s in case.robot.sides]
    if not all(log.has(n) for log in case.runs for n in names):
        return []
    left, right = (np.concatenate([log.columns[n][np.isfinite(log.columns[n])] for log in case.runs]) for n in names)
    found = []
    for side, w in (("left", left), ("right", right)):
        top = float(np.max(np.abs(w)))
        back = float(np.quantile(w, 0.01)) if np.mean(w) > 0 else -float(np.quantile(w, 0.99))
        if top > 0 and back > -0.05 * top:
            found.append(Finding("", f"w_{side[0]}", "one_sign", "note",
                                 f"The {side} wheel turns one way only: friction that depends on the direction cannot "
                                 "be told from friction that does not."))
    return found
