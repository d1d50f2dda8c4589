"""Channels that do not follow the robot: dead, clipped, frozen, wrapped, slow; and what of them is set aside."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rtds_host.contract import Case, Robot, RunLog
from rtds_host.contract.clock import moment
from rtds_host.diagnosis.gate.findings import Finding, percent
from rtds_host.diagnosis.gate.limits import ROOM, channels
from rtds_host.diagnosis.gate.timing import hole_s
from rtds_host.diagnosis.thresholds import (
    CLEAR_RATIO,
    FEW_SHARE,
    FEWEST_SAMPLES,
    MAJORITY,
    MEDIAN_OF_NORMAL,
    MINOR_SHARE,
    SIGNIFICANT,
    in_a_row,
)
from rtds_host.plant.schema import OUTPUT_INDEX

# Noises that the nominal robot moves by where any live sensor would show that it moves, however little of it.
SHOWS = ROOM * SIGNIFICANT
# Numerical: parts that a stretch is looked at in.
PARTS = 8


def in_samples(log: RunLog, robot: Robot, replayed: np.ndarray) -> tuple[list[Finding], dict[str, np.ndarray]]:
    """Findings on each channel of a run, and channel -> rows (k,) that are certainly no measurement.

    replayed : (n, 11) the nominal robot's, columns as `OUTPUTS`.
    """
    found: list[Finding] = []
    aside: dict[str, np.ndarray] = {}
    rows = len(log.t)
    names = [c for c in channels(robot) if log.has(c)]
    moves = any(
        float(np.nanstd(log.columns[c])) > SIGNIFICANT * (robot.noise(c) or 1e-9)
        for c in names
        if c.startswith(("w_", "th_", "x", "y"))
    )
    for c in names:
        good = np.flatnonzero(np.isfinite(log.columns[c]))
        v, t = log.columns[c][good], log.t[good]
        noise = robot.noise(c)
        if noise is None:
            found.append(
                Finding(
                    log.name, c, "no_noise", "note", f"robot.toml declares no noise for {c}: it is shown, not used."
                )
            )
            continue
        if len(v) < (1.0 - MINOR_SHARE) * rows and len(v) > 1:
            found += _slow(log, c, t)
        if len(v) < FEWEST_SAMPLES:
            found.append(Finding(log.name, c, "short", "warning", f"{c} has {len(v)} samples only."))
            continue
        if not np.ptp(v):
            expected = float(np.std(replayed[good, OUTPUT_INDEX[c]]))
            if c == "v_bus":
                found.append(
                    Finding(
                        log.name,
                        c,
                        "constant",
                        "note",
                        f"v_bus is {v[0]:.4g} V to the last digit: it was not measured, or held.",
                    )
                )
            elif (moves and expected > SHOWS * noise) or (c[0] == "i" and moves):
                found.append(
                    Finding(
                        log.name,
                        c,
                        "dead",
                        "warning",
                        f"{c} stays at {v[0]:.4g} to the last digit while the robot moves: a dead sensor?",
                        1.0,
                    )
                )
            continue
        if np.isfinite(replayed).all() and not c.startswith("th_") and c not in ("x", "y", "yaw"):
            for judge in (
                _clipped(log, c, v, replayed[good, OUTPUT_INDEX[c]], noise),
                _frozen(log, c, v, t, noise, robot, replayed),
            ):
                if judge is not None:
                    found.append(judge[0])
                    aside[c] = np.union1d(aside.get(c, np.empty(0, int)), good[judge[1]])
        if c == "yaw" or c.startswith("th_"):
            found += _wrapped(log, c, v, t, noise)
    return found, aside


def _wrapped(log: RunLog, c: str, v: np.ndarray, t: np.ndarray, noise: float) -> list[Finding]:
    """Whether an angle (n,) rad jumps by whole turns."""
    steps = np.diff(v)
    # Against the steps next to it: a fast wheel may turn by a whole turn from sample to sample.
    usual = float(np.quantile(np.abs(steps), 1.0 - FEW_SHARE))
    turns = np.flatnonzero(
        (np.abs(np.abs(steps) - 2 * math.pi) < max(usual, SIGNIFICANT * noise))
        & (np.abs(steps - np.append(steps[1:], steps[-2])) > math.pi)
    )
    if not turns.size or not np.median(np.abs(steps)) < MINOR_SHARE * 2 * math.pi:
        return []
    text = (
        f"{c} jumps by a whole turn {turns.size} time(s), first at t = {moment(t[turns[0] + 1])} s: it is wrapped; "
        "unwrap it."
    )
    return [Finding(log.name, c, "wrapped", "warning", text)]


def _slow(log: RunLog, c: str, t: np.ndarray) -> list[Finding]:
    dt = np.diff(t)
    found = [
        Finding(
            log.name,
            c,
            "slow",
            "note",
            f"{c} has a sample in {len(t)} of {len(log.t)} rows ({1 / float(np.median(dt)):.3g} Hz).",
        )
    ]
    if float(dt.max()) > hole_s(t):
        found.append(
            Finding(
                log.name,
                c,
                "gap",
                "warning",
                f"{c} has no sample for {float(dt.max()):.3g} s.",
                float(dt.max() / (log.t[-1] - log.t[0])),
            )
        )
    return found


def _stretches(same: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First index and length of each run of True in (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int)))
    return edges[::2], edges[1::2] - edges[::2]


def _clipped(
    log: RunLog, c: str, v: np.ndarray, replayed: np.ndarray, noise: float
) -> tuple[Finding, np.ndarray] | None:
    for edge, word in ((v.max(), "above"), (v.min(), "below")):
        at = v == edge
        count = int(at.sum())
        if count < max(FEWEST_SAMPLES, FEW_SHARE * len(v)) or edge == 0:
            continue
        neighbour = (np.abs(v - edge) < SIGNIFICANT * noise) & ~at
        near = np.unique(v[neighbour], return_counts=True)[1]
        levels = 1 if near.size == 0 else int(near.max())
        quantum = float(np.min(np.diff(np.unique(v))))
        # A settled reading of a coarse sensor also repeats; there the replay stands still too.
        moved = float(np.std(replayed[at]))
        if count > CLEAR_RATIO * levels and moved > max(SIGNIFICANT * noise, min(quantum, SHOWS * noise)):
            share = count / len(v)
            return Finding(
                log.name,
                c,
                "clipped",
                "warning",
                f"{c} never goes {word} {edge:.4g} and sits there in {percent(share)} of its samples: it is clipped; "
                "they are set aside.",
                share,
            ), np.flatnonzero(at)
    return None


def _repeats_about(v: np.ndarray, same: np.ndarray, first: np.ndarray, long: np.ndarray, noise: float) -> np.ndarray:
    """Of the samples (n,) about the value of each stretch (k,), the share that repeats the one before, without the
    stretch itself.

    same : (n - 1,) which do. A channel of few significant digits is coarse where it is large. By the rule of
    succession: where nothing else is about, half of them.
    """
    order = np.argsort(v[1:])
    values, repeats = v[1:][order], np.concatenate([[0], np.cumsum(same[order])])
    low, high = (np.searchsorted(values, v[first] + off) for off in (-SHOWS * noise, SHOWS * noise))
    return (repeats[high] - repeats[low] - long + 1.0) / (high - low - long + 2.0)


def _noisy_about(v: np.ndarray, value: float, noise: float) -> bool:
    """Whether a channel scatters from sample to sample about a value: a simulator's log, or a filtered one, settles and
    then repeats itself without being held.

    Noise bends the curve there and back: of two neighbouring second differences three quarters have opposite signs. On
    the smooth way to a level none have.
    """
    near = np.abs(v - value) < SHOWS * noise
    bend = np.where(near[2:] & near[1:-1] & near[:-2], v[2:] - 2.0 * v[1:-1] + v[:-2], 0.0)
    size = np.abs(bend[bend != 0.0])
    pairs = bend[1:] * bend[:-1]
    back = pairs[pairs != 0.0] < 0.0
    return (
        len(back) > 0
        and float(np.mean(back)) > MAJORITY
        and float(np.median(size)) > MEDIAN_OF_NORMAL * math.sqrt(6.0) * noise / CLEAR_RATIO
    )


def _moves_within(log: RunLog, robot: Robot, c: str, rows: slice) -> bool:
    """Whether a channel next to `c` moves beyond its noise in these rows: a robot at rest may well repeat itself."""
    for other in channels(robot):
        if other == c or other in ("v_bus", "i_l", "i_r") or not log.has(other) or robot.noise(other) is None:
            continue
        v = log.columns[other][rows]
        v = v[np.isfinite(v)]
        if not len(v):
            continue
        # Medians of parts: in many samples the noise alone spans more than a few of its sigmas.
        parts = np.array([np.median(part) for part in np.array_split(v, min(len(v), PARTS))])
        # A gyro has an offset: its level alone says little.
        level = abs(float(np.median(v))) / {"w": SIGNIFICANT, "g": SHOWS}.get(other[0], math.inf)
        if max(level, float(np.ptp(parts)) / 2.0 / SIGNIFICANT) > robot.known_noise(other):
            return True
    return False


def _change(log: RunLog, c: str, rows: slice) -> float:
    """What a channel changes by within rows, NaN where it has no two samples."""
    v = log.columns[c][rows] if log.has(c) else np.empty(0)
    v = v[np.isfinite(v)]
    return float(v[-1] - v[0]) if len(v) > 1 else math.nan


def _level(log: RunLog, c: str, rows: slice) -> float:
    v = log.columns[c][rows] if log.has(c) else np.empty(0)
    v = v[np.isfinite(v)]
    return float(np.median(v)) if len(v) else math.nan


def _at_rest(log: RunLog, robot: Robot, c: str, value: float, rows: slice, replayed: np.ndarray) -> bool:
    """Whether a channel that repeats about 0 may mean it: a wheel that stands, a body that does not turn, no current.

    Only what sees the same thing contradicts it: the wheel's angle, or gyro and other wheel; the yaw, or both wheels;
    of a current the nominal robot's. What nothing contradicts is believed.
    """
    noise = robot.known_noise(c)
    if abs(value) > SIGNIFICANT * noise:
        return False
    seconds = float(np.ptp(log.t[rows]))
    if c[0] == "i":
        return not float(np.median(np.abs(replayed[rows, OUTPUT_INDEX[c]]))) > SHOWS * noise
    own, other = (f"th_{c[-1]}", "w_r" if c[-1] == "l" else "w_l") if c[0] == "w" else ("yaw", "")
    if np.isfinite(turned := _change(log, own, rows)) and (sigma := robot.noise(own)):
        return abs(turned - value * seconds) <= SIGNIFICANT * math.hypot(sigma, noise * seconds)
    body = robot.chassis
    if body is None:
        return True
    if c == "gyro_z":
        expected = body.wheel_radius_m / body.track_width_m * (_level(log, "w_r", rows) - _level(log, "w_l", rows))
        return not abs(expected - value) > SHOWS * noise
    turn = _level(log, "gyro_z", rows) * body.track_width_m / body.wheel_radius_m
    neighbour = _level(log, other, rows)
    expected = neighbour + (turn if other == "w_l" else -turn)
    return not abs(expected - value) > max(SHOWS * noise, 0.5 * abs(neighbour))


def _frozen(
    log: RunLog, c: str, v: np.ndarray, t: np.ndarray, noise: float, robot: Robot, replayed: np.ndarray
) -> tuple[Finding, np.ndarray] | None:
    """A noisy channel that repeats one value for long while the robot moves."""
    same = np.diff(v) == 0
    if CLEAR_RATIO * float(np.min(np.diff(np.unique(v)))) > noise:
        # A coarse sensor repeats itself.
        return None
    first, long = _stretches(same)
    held = []
    for a, n, share in zip(first, long, _repeats_about(v, same, first, long, noise)):
        if n < in_a_row(float(share), len(v)):
            continue
        rows = slice(*np.searchsorted(log.t, [t[a], t[a + n] + 1e-12]))
        if (
            _noisy_about(v, v[a], noise)
            and _moves_within(log, robot, c, rows)
            and not _at_rest(log, robot, c, v[a], rows, replayed)
        ):
            held.append((a, n))
    if not held:
        return None
    at, n = max(held, key=lambda h: h[1])
    # The first of equal samples was still a measurement.
    aside = np.concatenate([np.arange(a + 1, a + n + 1) for a, n in held])
    share = len(aside) / len(v)
    return Finding(
        log.name,
        c,
        "frozen",
        "warning",
        f"{c} repeats {v[at]:.4g} for {t[at + n] - t[at]:.3g} s from t = {moment(t[at])} s while the robot moves: "
        f"samples were held; {percent(share)} of them are set aside.",
        share,
    ), aside


def without(log: RunLog, aside: dict[str, np.ndarray]) -> RunLog:
    """The run with some samples (channel -> rows) set aside."""
    columns = dict(log.columns)
    for c, rows in aside.items():
        if len(rows):
            columns[c] = columns[c].copy()
            columns[c][rows] = np.nan
    return replace(log, columns=columns)


def scatter(values: np.ndarray) -> float:
    """Noise of a channel (n,) by how its samples scatter about their neighbours, which nobody had to declare; more
    where it moves fast.
    """
    v = values[np.isfinite(values)]
    return float(np.sqrt(np.mean((v[2:] - 2.0 * v[1:-1] + v[:-2]) ** 2) / 6.0)) if len(v) > 2 else math.inf


def motion(log: RunLog, robot: Robot) -> list[Finding]:
    """A run that shows little: wheels that stand still under a command, a command that never changes."""
    command = log.commands(robot.driver.mode)
    wheels = [c for c in channels(robot) if c.startswith(("w_", "th_")) and log.has(c)]
    moves = any(
        float(np.nanstd(log.columns[c])) > SIGNIFICANT * min(robot.noise(c) or math.inf, scatter(log.columns[c]))
        for c in wheels
    )
    if not command.any():
        return []
    if wheels and not moves:
        return [
            Finding(log.name, "", "still", "note", "The wheels do not move in this run although a command is given.")
        ]
    if not np.ptp(command, axis=0).any():
        return [Finding(log.name, "", "excitation", "note", "The command never changes in this run.")]
    return []


def motions(case: Case) -> list[Finding]:
    """What the motions of all runs of a robot together leave out."""
    names = [f"w_{s}" for s in case.robot.sides]
    if not all(log.has(n) for log in case.runs for n in names):
        return []
    left, right = (np.concatenate([log.columns[n][np.isfinite(log.columns[n])] for log in case.runs]) for n in names)
    found = []
    for side, w in (("left", left), ("right", right)):
        top = float(np.max(np.abs(w)))
        back = float(np.quantile(w, FEW_SHARE)) if np.mean(w) > 0 else -float(np.quantile(w, 1.0 - FEW_SHARE))
        if top > 0 and back > -MINOR_SHARE * top:
            found.append(
                Finding(
                    "",
                    f"w_{side[0]}",
                    "one_sign",
                    "note",
                    f"The {side} wheel turns one way only: friction that depends on the direction cannot "
                    "be distinguished from friction that does not.",
                )
            )
    return found
