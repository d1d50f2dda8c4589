"""A log's clock: its unit, its holes, its jitter, and whether commands are logged often enough."""

from __future__ import annotations

import math

import numpy as np

from rtds_host.contract import Case, RunLog
from rtds_host.contract.clock import PER_SECOND, SLOWEST_HZ, is_rate, is_staircase, likely_unit, moment
from rtds_host.diagnosis.gap import WINDOW_S
from rtds_host.diagnosis.gate.findings import Finding, percent
from rtds_host.diagnosis.gate.limits import limits
from rtds_host.diagnosis.thresholds import CLEAR_RATIO, CORRELATED, EQUAL_WITHIN, FEW_SHARE, FEWEST_SAMPLES, SIGNIFICANT
from rtds_host.errors import InputError

# A run that is shorter than this shows nothing (contract, section 1).
SHORTEST_S = 0.1
# After so long a hole the rest is another recording (contract, section 1).
BREAK_S = 60.0
# How near to a unit's factor what speeds, angles and clocks make of each other must be: gains come between.
CLOSE = 1.0 / (1.0 - EQUAL_WITHIN)
# Numerical: stretches that speeds and angles are compared in, and chords that a way is measured by.
STRETCHES, CHORDS = 30, 100


def rolled_over_turned(log: RunLog, case: Case) -> float | None:
    """Way by the integral of a speed over the clock, over the way measured: seconds a unit of `t`, about 1.

    From each pair of channels that shows both, (speed, angle): w and th, gyro and yaw, wheels and pose; the median.
    """
    ratios = []
    pairs = [(f"w_{s}", f"th_{s}") for s in case.robot.sides] + [("gyro_z", "yaw")]
    for speed, angle in pairs:
        if log.has(speed) and log.has(angle):
            ratios.append(clock_ratio(log, log.columns[speed], log.columns[angle], case.robot.noise(angle) or 0.0))
    if case.robot.chassis is not None and all(log.has(c) for c in ("w_l", "w_r", "x", "y")):
        both = np.isfinite(log.columns["x"]) & np.isfinite(log.columns["y"])
        way = np.full(len(log.t), np.nan)
        # Chords in place of steps: noise adds to the sum of every one.
        rows = np.flatnonzero(both)[:: max(1, int(both.sum()) // CHORDS)]
        if len(rows) > 1:
            way[rows] = np.concatenate(
                [[0.0], np.cumsum(np.hypot(np.diff(log.columns["x"][rows]), np.diff(log.columns["y"][rows])))]
            )
            rim = 0.5 * case.robot.chassis.wheel_radius_m * np.abs(log.columns["w_l"] + log.columns["w_r"])
            ratios.append(clock_ratio(log, rim, way, (case.robot.noise("x") or 0.0) * CHORDS / STRETCHES))
    known = [r for r in ratios if r is not None]
    return float(np.median(known)) if known else None


def clock_ratio(log: RunLog, speed: np.ndarray, angle: np.ndarray, noise: float) -> float | None:
    """Magnitude of the integral of a speed over that of the angle's change, in stretches; None where neither moves."""
    good = np.isfinite(speed)
    if good.sum() < FEWEST_SAMPLES or np.isfinite(angle).sum() < FEWEST_SAMPLES:
        return None
    t, v = log.t[good] - log.t[0], speed[good]
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    rows = np.flatnonzero(np.isfinite(angle))
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), STRETCHES)).astype(int)]
    turned = np.diff(angle[rows])
    rolled = np.diff(np.interp(log.t[rows] - log.t[0], t, integral))
    if float(np.max(np.abs(turned))) < SIGNIFICANT * noise or not turned.any() or not rolled.any():
        return None
    if (
        len(turned) > 2
        and np.std(turned) * np.std(rolled) > 0
        and abs(float(np.corrcoef(turned, rolled)[0, 1])) < CORRELATED
    ):
        return None
    return float(np.sqrt(np.sum(rolled**2) / np.sum(turned**2)))


def check_clock(case: Case) -> None:
    """Refuse a log whose clock cannot be in seconds, or that holds two recordings. Needs no replay.

    Raises
    ------
    InputError : names the run, the unit that `t` looks like, and what speaks for it; or the hole.
    """
    for log in case.runs:
        where = f"{log.path or log.name}: t"
        dt = np.diff(log.t)
        step = float(np.median(dt))
        hole = int(np.argmax(dt))
        clock = rolled_over_turned(log, case)
        unit = None if clock is None else _nearest(clock)
        # A speed and its angle may also disagree by a unit of their own: then the rows' rate is a robot's as it stands.
        if unit is not None and (is_rate(step / PER_SECOND[unit]) or not is_rate(step)):
            raise InputError(
                f"{where}: is it in {unit}? With seconds, speeds make {clock:.3g} times the ways and angles "
                "that were measured"
            )
        # Whether a staircase is one, its wheels tell: `units.check_staircase`.
        if not is_rate(step) and not is_staircase(log.t):
            unit = likely_unit(step)
            raise InputError(
                f"{where}: a row every {step:.3g} s, "
                + (f"is it in {unit}?" if unit else f"at least {SLOWEST_HZ:g} rows a second are needed")
            )
        if dt[hole] >= BREAK_S:
            raise InputError(
                f"{where}: no row for {dt[hole]:.4g} s after {moment(log.t[hole])} s: two recordings in one "
                "file, or a jump of the clock? Make each a run of its own"
            )


def _nearest(ratio: float) -> str | None:
    """Unit that a ratio of clocks means, None where it means none."""
    # Angles in degrees look nearly like minutes; the median of the pairs is known better than the twentieth between
    # them.
    sizes = {**PER_SECOND, "degrees": math.pi / 180.0}
    if not 0.0 < ratio < math.inf:
        return None
    name = min(sizes, key=lambda u: abs(math.log(ratio / sizes[u])))
    return name if name != "degrees" and abs(math.log(ratio / sizes[name])) < math.log(CLOSE) else None


def jitter(t: np.ndarray) -> float:
    """Standard deviation of stamps (n,) about an even clock, s: what makes one step long makes the next one short.

    Steps that are uneven on their own, without that, are none.
    """
    dt = np.diff(t)
    step = float(np.median(dt))
    dt = dt[np.round(dt / step) < 2]
    if len(dt) < FEWEST_SAMPLES:
        return 0.0
    dt = dt - dt.mean()
    square, product = float(np.mean(dt**2)), -float(np.mean(dt[1:] * dt[:-1]))
    # Of stamps that jitter alone the variance of a step is twice theirs, and its covariance with the next minus theirs.
    # Nearer to those than to steps that are uneven on their own, it is theirs.
    return math.sqrt(0.5 * (0.5 * square + product)) if product > 0.25 * square else math.sqrt(max(0.0, product))


def shorter_than_any(t: np.ndarray) -> bool:
    """Whether a run's times (n,) s last less than the shortest run, to the digits that they have: few, since 1970."""
    return float(t[-1] - t[0]) < SHORTEST_S * (1.0 - 1e-9) - 2.0 * float(np.spacing(np.abs(t[-1])))


def hole_s(t: np.ndarray) -> float:
    """Steps longer than this are holes, s: no shorter than the shortest run, for what a logger's buffers do is
    jitter.
    """
    return max(CLEAR_RATIO * float(np.median(np.diff(t))), SHORTEST_S)


def sampled(log: RunLog, case: Case) -> np.ndarray:
    """Times at which the wheels are measured, (n,) s: rows that hold a command only are no sampling."""
    good = np.zeros(len(log.t), bool)
    for c in (f"{kind}_{s}" for kind in ("w", "th") for s in case.robot.sides):
        if c in log.columns:
            good |= np.isfinite(log.columns[c])
    return log.t[good] if good.sum() >= FEWEST_SAMPLES else log.t


def clock_findings(log: RunLog, case: Case) -> list[Finding]:
    """Rate, jitter, missing rows, length."""
    t = sampled(log, case)
    dt = np.diff(t)
    step = float(np.median(dt))
    rate = 1.0 / step
    found = []
    # NaN, which no step exceeds, where torque is commanded.
    time_constant = limits(case).time_constant_s
    if not is_rate(step):
        found.append(
            Finding(
                log.name,
                "t",
                "staircase",
                "note",
                f"a row every {step:.3g} s: each is taken as a settled speed; what is over sooner is not seen.",
            )
        )
    elif step > time_constant * (1.0 + FEW_SHARE):
        found.append(
            Finding(
                log.name,
                "t",
                "rate",
                "warning",
                f"{rate:.3g} rows a second are few for a mechanical time constant of {1e3 * time_constant:.2g} ms: "
                "parameters of fast parts are biased.",
            )
        )
    regular = dt[dt <= hole_s(t)]
    uneven = float(np.std(regular[np.round(regular / step) < 2])) / step if len(regular) > 2 else 0.0
    if uneven > FEW_SHARE:
        stamps = jitter(t)
        told = f", stamps jitter by {1e3 * stamps:.2g} ms" if stamps > uneven * step / CLEAR_RATIO else ""
        found.append(
            Finding(
                log.name,
                "t",
                "jitter",
                "note",
                f"rows are unevenly spaced: {1e3 * step:.3g} ms ± {100 * uneven:.0f} %{told}.",
            )
        )
    missed = float(np.sum(np.round(regular / step) - 1)) / len(dt)
    if uneven < 1.0 / CLEAR_RATIO and missed > FEW_SHARE:
        found.append(
            Finding(log.name, "t", "dropped", "note", f"about {percent(missed)} of the rows are missing.", missed)
        )
    length = float(log.t[-1] - log.t[0])
    if length < WINDOW_S:
        found.append(Finding(log.name, "t", "short", "warning", f"the run lasts {length:.3g} s only."))
    elif len(log.t) < FEWEST_SAMPLES:
        found.append(Finding(log.name, "t", "short", "warning", f"the run has {len(log.t)} rows only."))
    return found


def command_findings(log: RunLog, case: Case, time_constant_s: float) -> tuple[list[Finding], float, bool]:
    """Findings on how often commands are logged, the median time between their changes, s, and whether that is enough.

    Between rows a command is held. A command that changes in most rows is a controller's, and may have changed between
    them, too; where the rows are further apart than the motor's time constant the replay cannot know.
    """
    commands = log.commands(case.robot.driver.mode)
    changes = np.flatnonzero((np.diff(commands, axis=0) != 0.0).any(axis=1)) + 1
    if len(changes) < 2:
        return [], math.nan, True
    apart = float(np.median(np.diff(log.t[changes])))
    # A servo follows its command in no less time than the motor alone; torque mode has no time constant to compare.
    few = len(changes) > 0.5 * len(log.t) and math.isfinite(time_constant_s) and apart > time_constant_s
    # Whoever takes a row a step holds the command until the speed has settled.
    if not few or not is_rate(float(np.median(np.diff(log.t)))):
        return [], apart, True
    return (
        [
            Finding(
                log.name,
                "",
                "command_rate",
                "warning",
                f"the command changes in {percent(len(changes) / len(log.t))} of the rows, {1e3 * apart:.3g} ms "
                f"apart, and the motor answers within {1e3 * time_constant_s:.2g} ms: what was commanded between "
                "rows is not known.",
                len(changes) / len(log.t),
            )
        ],
        apart,
        False,
    )


def lags_of(found: list[tuple[str, float]]) -> dict[str, float]:
    """Channel -> median of its lags over runs, s, of (channel, lag) pairs."""
    names = dict.fromkeys(c for c, _ in found)
    return {c: float(np.median([lag for name, lag in found if name == c])) for c in names}
