"""Isolated samples far off their neighbours: a logger's glitches, as distinct from steps, impacts, stalls and starts.

A sample is judged by the two samples to either side of it, against the scatter about it, and by one of two further
marks: the robot cannot do it (a pose or an angle would have to move faster than the motors turn, both ways; a value is
beyond all bounds), or it is isolated (nothing else on the robot is off its neighbours then, commands do not go there
and back by enough, and nothing else in its own channel comes near it). What moves a robot there and back shows in more
than one channel: an impact in both wheels, the current and the gyro. A sample that the robot cannot do is no witness of
one next to it. A step moves others too, but there alone; a current may follow one for a sample, and a turn, the
difference of two wheels, so that nothing else may change at all where these are within what the last commands can do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rtds_host.contract import Case, RunLog
from rtds_host.diagnosis.gate.limits import ROOM, Limits, channels, kind_of
from rtds_host.diagnosis.replay.model import LONGEST_DELAY_S
from rtds_host.diagnosis.thresholds import (
    CLEAR_RATIO,
    FEW_SHARE,
    FEWEST_SAMPLES,
    MAJORITY,
    MEDIAN_OF_NORMAL,
    SIGNIFICANT,
    sigmas,
)
from rtds_host.plant.schema import OUTPUT_INDEX

# Channels of which one at least must be there, for what really moves a channel to show elsewhere, too.
WITNESSES = {
    "v_bus": ("i_l", "i_r", "v_cmd_l", "v_cmd_r", "w_cmd_l", "w_cmd_r"),
    "i_l": ("w_l",),
    "i_r": ("w_r",),
    "w_l": ("i_l", "gyro_z"),
    "w_r": ("i_r", "gyro_z"),
    "th_l": ("w_l",),
    "th_r": ("w_r",),
    "gyro_z": ("w_l", "w_r", "yaw"),
    "x": ("w_l", "w_r", "yaw"),
    "y": ("w_l", "w_r", "yaw"),
    "yaw": ("w_l", "w_r", "gyro_z"),
}


def _local(size: np.ndarray) -> np.ndarray:
    """(n,) median of `size` in blocks of `FEWEST_SAMPLES`, the largest of a sample's own block and the two next to
    it."""
    n = len(size)
    blocks = max(1, n // FEWEST_SAMPLES)
    if blocks == 1:
        return np.full(n, np.median(size))
    level = np.median(size[: blocks * FEWEST_SAMPLES].reshape(blocks, FEWEST_SAMPLES), axis=1)
    wide = np.maximum(level, np.maximum(np.append(level[1:], level[-1]), np.insert(level[:-1], 0, level[0])))
    return np.append(np.repeat(wide, FEWEST_SAMPLES), np.full(n - blocks * FEWEST_SAMPLES, wide[-1]))


def exceedance(v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far each sample lies outside what its two neighbours to either side span, and that span, (n,) each.

    A first or last sample is judged by the three next to it; the second from an end by the one and the two.
    """
    n = len(v)
    padded = np.concatenate([[v[3], v[2]], v, [v[-3], v[-4]]])
    around = np.stack([padded[:n], padded[1 : n + 1], padded[3 : n + 3], padded[4 : n + 4]])
    low, high = around.min(axis=0), around.max(axis=0)
    return np.maximum(np.maximum(v - high, low - v), 0.0), high - low


def _events(log: RunLog, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """For each measured channel the times of its changes out of the ordinary, (k,) ascending."""
    result = {}
    for c in names:
        good = np.isfinite(log.columns[c])
        v, t = log.columns[c][good], log.t[good]
        if len(v) < FEWEST_SAMPLES:
            continue
        change = np.abs(np.diff(v))
        # A coarse channel changes rarely, one step at a time: that is ordinary.
        floor = np.median(change[change > 0]) if (change > 0).any() else 0.0
        at = np.flatnonzero(change > SIGNIFICANT / MEDIAN_OF_NORMAL * np.maximum(_local(change), 0.5 * floor))
        result[c] = np.unique(np.concatenate([t[at], t[at + 1]]))
    return result


def _candidates(log: RunLog, c: str, noise: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None:
    """Rows with a sample, exceedance (k,), whether far off (k,), and the shorter time to a neighbour's (k,)."""
    rows = np.flatnonzero(np.isfinite(log.columns[c]))
    if len(rows) < FEWEST_SAMPLES:
        return None
    v, t = log.columns[c][rows], log.t[rows]
    off, way = exceedance(v)
    second = np.zeros(len(v))
    second[1:-1] = np.abs(v[1:-1] - 0.5 * (v[:-2] + v[2:]))
    # Of a smooth motion the top is above its neighbours by a third of the way between them.
    most = sigmas(len(v))
    far = (off > most * noise) & (off > CLEAR_RATIO * way) & (off > most / MEDIAN_OF_NORMAL * _local(second))
    dt = np.diff(t)
    before, after = np.insert(dt, 0, dt[0]), np.append(dt, dt[-1])
    return rows, off, far, np.maximum(before, after)


def isolated(
    log: RunLog, case: Case, bounds: Limits, noise: dict[str, float]
) -> dict[str, tuple[np.ndarray, np.ndarray, int]]:
    """Channel -> rows of a run's isolated samples that cannot be (k,), of those that only stand alone (m,), and how
    many samples the channel has.

    What was found is taken out and the rest judged again, until nothing more is found: a glitch is no witness of the
    one next to it.
    """
    found = _found(log, case, bounds, noise)
    more = found
    while any(len(sure) + len(lone) for sure, lone, _ in more.values()):
        columns = dict(log.columns)
        for c, (sure, lone, _) in found.items():
            columns[c] = columns[c].copy()
            columns[c][np.concatenate([sure, lone])] = np.nan
        more = _found(replace(log, columns=columns), case, bounds, noise)
        found = {
            c: (np.concatenate([sure, more[c][0]]), np.concatenate([lone, more[c][1]]), count)
            if c in more
            else (sure, lone, count)
            for c, (sure, lone, count) in found.items()
        }
    return found


def _found(
    log: RunLog, case: Case, bounds: Limits, noise: dict[str, float]
) -> dict[str, tuple[np.ndarray, np.ndarray, int]]:
    """As `isolated`, of one look."""
    names = tuple(c for c in channels(case.robot) if log.has(c))
    events = None
    result = {}
    every = {c: judged for c in names if (judged := _candidates(log, c, noise.get(c, 0.0))) is not None}
    cannot_be = {c: _cannot_be(log, c, judged, bounds, noise.get(c, 0.0)) for c, judged in every.items()}
    # What cannot be is no witness of another channel's motion.
    spikes = {c: log.t[rows[far & ~cannot_be[c]]] for c, (rows, _, far, _) in every.items()}
    for c, (rows, off, far, span) in every.items():
        v, sure = log.columns[c][rows], cannot_be[c]
        doubtful = far & ~sure
        # A first or last sample has neighbours on one side only: a start or an end may be sudden.
        doubtful[[0, 1, -2, -1]] = False
        if doubtful.any():
            if events is None:
                events = _events(log, names)
            # Without a witness a speed or a current that is back within half a time constant still was no motion.
            seen = any(w in events for w in WITNESSES[c])
            usual = float(np.quantile(np.abs(np.diff(v[~far])), 1.0 - FEW_SHARE))
            alone = np.array(
                [
                    _is_isolated(log, case, bounds, c, rows, k, off[k], span[k], events, spikes)
                    and (
                        seen
                        or c[0] in "wi"
                        and 2.0 * span[k] < bounds.time_constant_s
                        or c[0] == "i"
                        and off[k] > bounds.values[c] / ROOM
                        or c[0] in "wt"
                        and not bounds.time_constant_s > 0
                        and off[k] > SIGNIFICANT * usual
                    )
                    and off[k] > _commanded(log, case, bounds, c, rows, k, span[k])
                    for k in np.flatnonzero(doubtful).tolist()
                ]
            )
            lone = np.flatnonzero(doubtful)[alone]
            elsewhere = np.ones(len(rows), bool)
            # A sample far off makes its neighbours look off by part of its own way.
            for shift in (-2, -1, 0, 1, 2):
                elsewhere[np.clip(np.concatenate([lone, np.flatnonzero(sure)]) + shift, 0, len(rows) - 1)] = False
            # A supply may jump there and back; what counts there is how far it jumps at all.
            other = off if c != "v_bus" else np.abs(np.diff(v, append=v[-1]))
            top = float(other[elsewhere].max(initial=0.0))
            lone = lone[off[lone] > CLEAR_RATIO * top]
        else:
            lone = np.empty(0, int)
        result[c] = rows[sure], rows[lone], len(rows)
    return result


def _cannot_be(log: RunLog, c: str, judged: tuple[np.ndarray, ...], bounds: Limits, noise: float) -> np.ndarray:
    """Which samples of channel c, judged as of `_candidates`, are what the robot cannot do, (k,)."""
    rows, off, far, span = judged
    v = log.columns[c][rows]
    beyond = np.abs(v) > bounds.values.get(c, np.inf)
    if c == "v_bus":
        # A supply is never negative either.
        beyond |= v < -sigmas(len(v)) * noise
    if c in bounds.rates:
        beyond |= off > bounds.rates[c] * span
    return far & beyond


def _commanded(log: RunLog, case: Case, bounds: Limits, c: str, rows: np.ndarray, k: int, span: float) -> float:
    """How far a change of the commands about sample k may move channel c there and back, in the channel's unit."""
    commands = log.commands(case.robot.driver.mode)
    first, last = max(int(rows[k - 2]) - 1, 0), int(rows[k + 2]) + 1
    about = commands[first:last]
    swing = np.ptp(about, axis=0)
    # A speed there and back asks for a command there and back; a current follows a step alone, of which a time constant
    # takes it back.
    alone = _comes_back(span, bounds) if c[0] == "i" else 0.0
    swing = swing - (1.0 - alone) * np.abs(about[-1] - about[0])
    swing = float(np.max(swing))
    reach = bounds.rates[c] * span if c in bounds.rates else bounds.values.get(c, np.inf)
    if not np.isfinite(reach):
        reach = float(np.ptp(np.quantile(log.columns[c][rows], (FEW_SHARE, 1.0 - FEW_SHARE))))
    return min(1.0, swing / _full(log, case, bounds)) * reach


def _comes_back(span: float, bounds: Limits) -> float:
    """Share of a motor's answer that is there and gone within two samples `span` seconds apart, at most; 1 where that
    is not known.
    """
    return min(1.0, 2.0 * span / bounds.time_constant_s) if bounds.time_constant_s > 0.0 else 1.0


def _full(log: RunLog, case: Case, bounds: Limits) -> float:
    """The largest command that there is: V, rad/s, or what the run has of it."""
    free = bounds.values.get("w_l", np.inf) / ROOM
    full = {"voltage": case.robot.supply_v, "speed": free}.get(case.robot.driver.mode, np.inf)
    return full if np.isfinite(full) else float(np.max(np.abs(log.commands(case.robot.driver.mode)))) or 1.0


def _is_isolated(
    log: RunLog,
    case: Case,
    bounds: Limits,
    c: str,
    rows: np.ndarray,
    k: int,
    off: float,
    span: float,
    events: dict[str, np.ndarray],
    spikes: dict[str, np.ndarray],
) -> bool:
    """Whether nothing else goes there and back with sample k; of what a late command could do, whether nothing else
    changes.
    """
    # Within half a time constant the motor has not come up to speed, and its current stays.
    if kind_of(c) == "gyro" or (c[0] == "i" and not 2.0 * span < bounds.time_constant_s):
        # A reversal of the motor, or of the turn, of the file, as far as the commands went since the longest delay
        # before.
        first = int(np.searchsorted(log.t, log.t[rows[k]] - LONGEST_DELAY_S))
        swing = float(
            np.max(
                np.ptp(log.commands(case.robot.driver.mode)[first : int(rows[min(k + 2, len(rows) - 1)]) + 1], axis=0)
            )
        )
        reversal = (1.0 if c[0] == "i" else 2.0) * bounds.values.get(c, np.inf) / ROOM
        if c[0] != "i":
            # A turn takes its time as a wheel does.
            reversal *= _comes_back(span, bounds)
        if off <= min(1.0, swing / _full(log, case, bounds)) * reversal:
            return _alone(log, rows, k, c, events)
    # What moved the robot is in all its channels at once: one that was read in the same row and is not off there saw
    # nothing.
    return _alone(
        log,
        rows,
        k,
        c,
        {
            name: times[times == log.t[rows[k]]] if np.isfinite(log.columns[name][rows[k]]) else times
            for name, times in spikes.items()
        },
    )


def _alone(log: RunLog, rows: np.ndarray, k: int, c: str, events: dict[str, np.ndarray]) -> bool:
    """Whether nothing happens to another channel about sample k of channel c, of `events`: their times by channel,
    ascending.
    """
    first, last = log.t[rows[k - 2]], log.t[rows[k + 2]]
    return not any(
        np.searchsorted(times, last, "right") > np.searchsorted(times, first, "left")
        for name, times in events.items()
        if name != c
    )


def against_replay(
    log: RunLog, case: Case, bounds: Limits, noise: dict[str, float], replayed: np.ndarray
) -> dict[str, np.ndarray]:
    """Channel -> rows (k,) of samples that stand out of all else that the nominal robot leaves of a run.

    What commands drive there and back is in the replay, too: what is left of it is small, or as large wherever they
    change as much. A sample that is off by several times all that is left elsewhere, in a row where no other channel is
    off, was no motion; a current next to a step only if it is more than the step can drive.

    replayed : (n, 11) the nominal robot's, columns as `OUTPUTS`.
    """
    standing: dict[str, np.ndarray] = {}
    spikes: dict[str, np.ndarray] = {}
    for c in (c for c in channels(case.robot) if log.has(c) and c.startswith(("i_", "w_", "gyro"))):
        rows = np.flatnonzero(np.isfinite(log.columns[c]))
        measured = log.columns[c][rows]
        left = measured - replayed[rows, OUTPUT_INDEX[c]]
        if len(rows) < FEWEST_SAMPLES or not np.isfinite(left).all():
            continue
        off, way = exceedance(left)
        off[off < sigmas(len(rows)) * noise.get(c, 0.0)] = 0.0
        far = off > CLEAR_RATIO * way
        spikes[c] = rows[far]
        standing[c] = np.array(
            [
                rows[k]
                for k in _outstanding(measured, left, off, far)
                if off[k] > _driven(log, case, bounds, c, int(rows[k]), left[k])
            ],
            int,
        )
    commands = log.commands(case.robot.driver.mode)
    change = np.abs(np.diff(commands, axis=0, prepend=commands[:1])).max(axis=1)
    found = {
        c: np.array(
            [
                k
                for k in rows
                if not any(k in others for name, others in spikes.items() if name != c)
                and _driven_elsewhere(log.t, change, int(k))
            ],
            int,
        )
        for c, rows in standing.items()
    }
    return {c: rows for c, rows in found.items() if len(rows)}


def _outstanding(measured: np.ndarray, left: np.ndarray, off: np.ndarray, far: np.ndarray) -> np.ndarray:
    """Samples, at most a handful, that stand out of all the others of a channel, (k,).

    measured, left : the channel and what a replay leaves of it; off, far : how far and whether what is left lies
    outside what its neighbours span; all (n,).
    """
    out, between = exceedance(measured)
    peaks = np.flatnonzero(far & (out > between) & (off >= np.maximum(np.roll(off, 1), np.roll(off, -1))))
    # A first or last sample has neighbours on one side only.
    peaks = peaks[(peaks > 1) & (peaks < len(left) - 2)]
    peaks = peaks[np.argsort(-off[peaks])]
    level = np.abs(left - np.median(left))
    for count in range(min(len(peaks), max(1, int(FEW_SHARE * len(left)))), 0, -1):
        elsewhere = np.ones(len(left), bool)
        # One far off makes its neighbours look off, too.
        for shift in (-2, -1, 0, 1, 2):
            elsewhere[peaks[:count] + shift] = False
        if off[peaks[count - 1]] > CLEAR_RATIO * max(
            float(off[elsewhere].max(initial=0.0)), float(level[elsewhere].max(initial=0.0))
        ):
            return peaks[:count]
    return peaks[:0]


def _driven(log: RunLog, case: Case, bounds: Limits, c: str, k: int, towards: float) -> float:
    """The largest current that a step of its command next to row k can drive in a direction, either side of none; of
    speeds 0.
    """
    if c[0] != "i":
        return 0.0
    command = log.commands(case.robot.driver.mode)[:, case.robot.sides.index(c[-1])]
    step = float(np.max(np.sign(towards) * np.diff(command[max(k - 2, 0) : k + 2])))
    stall = bounds.values.get(c, np.inf) / ROOM
    return 2.0 * stall * min(1.0, step / _full(log, case, bounds)) if step > 0.0 else 0.0


def _driven_elsewhere(t: np.ndarray, change: np.ndarray, k: int) -> bool:
    """Whether commands change (n,) by half as much as they do before row k, for as long as they may act late, in
    several other rows.
    """
    first = int(np.searchsorted(t, t[k] - LONGEST_DELAY_S))
    about = np.zeros(len(t), bool)
    about[first : k + 2] = True
    return int(np.sum(change[~about] >= MAJORITY * float(change[about].max()))) >= CLEAR_RATIO
