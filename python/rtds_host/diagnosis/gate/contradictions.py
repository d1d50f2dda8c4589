"""Channels that contradict what else shows the same motion: an angle its speed, a gyro the wheels and the yaw.

What two channels show of one motion is compared over stretches of all runs: ways turned, against the integral of a
speed. A filter or a delay of the speed, of first order, adds its time constant times the speed's change, which is
fitted with it; a gain, whatever its sign, and an offset of a gyro are effects of the catalogue and no contradiction.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rtds_host.contract import Case, Robot, RunLog
from rtds_host.diagnosis.gate.findings import Finding
from rtds_host.diagnosis.gate.sensors import without
from rtds_host.diagnosis.gate.timing import STRETCHES, hole_s
from rtds_host.diagnosis.thresholds import (
    CLEAR_RATIO,
    CLOSELY_CORRELATED,
    CORRELATED,
    EQUAL_WITHIN,
    FEWEST_SAMPLES,
    SIGNIFICANT,
)
from rtds_host.plant.schema import OUTPUT_INDEX

# Numerical: samples of a stretch.
ROWS = 10
NAMES = {"l": "left", "r": "right"}


def repeated(case: Case) -> tuple[Case, list[Finding]]:
    """The case with each run once, and what is said of runs that are given twice: they are no further evidence."""
    kept: list[RunLog] = []
    found = []
    for log in case.runs:
        first = next((other for other in kept if _same(log, other)), None)
        if first is None:
            kept.append(log)
            continue
        found.append(
            Finding(
                log.name,
                "",
                "repeated",
                "warning",
                f"The run {log.name} holds the same samples as {first.name}: it is counted once.",
            )
        )
    return replace(case, runs=tuple(kept)), found


def _same(a: RunLog, b: RunLog) -> bool:
    """Whether two runs hold the same samples, whatever their clocks count from: sensors' noise never repeats itself."""
    if len(a.t) != len(b.t) or {c for c in a.columns if a.has(c)} != {c for c in b.columns if b.has(c)}:
        return False
    if replace(a.meta, scenario="", notes="") != replace(b.meta, scenario="", notes=""):
        return False
    step = float(np.median(np.diff(a.t)))
    digits = 2.0 * float(max(np.spacing(np.abs(a.t[-1])), np.spacing(np.abs(b.t[-1]))))
    if np.max(np.abs((a.t - a.t[0]) - (b.t - b.t[0]))) > 1e-6 * step + digits:
        return False
    return all(
        np.allclose(a.columns[c], b.columns[c], rtol=1e-6, atol=0.0, equal_nan=True) for c in a.columns if a.has(c)
    )


def settled(case: Case, replays: list[np.ndarray]) -> tuple[Case, list[Finding]]:
    """The case without channels that contradict what else shows their motion, and what is said of them.

    replays : the nominal robot's, (n, 11) a run, which tell which of two is right where nothing else does.
    """
    aside: dict[str, str] = {}
    for s in case.robot.sides:
        aside |= _angle(case, s, replays)
    if case.robot.chassis is not None:
        aside |= _turn(case)
    found = [Finding("", c, "contradicts", "warning", text, 1.0) for c, text in aside.items()]
    runs = tuple(without(log, {c: np.arange(len(log.t)) for c in aside if log.has(c)}) for log in case.runs)
    return replace(case, runs=runs), found


def _stretches(log: RunLog, speed: np.ndarray, angle: np.ndarray) -> np.ndarray | None:
    """Ways turned, the speed's integral, its change and the duration (4, stretches) between samples of an angle; None
    where one of them has too few."""
    good = np.isfinite(speed)
    rows = np.flatnonzero(np.isfinite(angle))
    if good.sum() < FEWEST_SAMPLES or len(rows) < FEWEST_SAMPLES:
        return None
    t, v = log.t[good], speed[good]
    rows = rows[(log.t[rows] >= t[0]) & (log.t[rows] <= t[-1])]
    if len(rows) < ROWS:
        return None
    # Long against a sample, whose stamp may be off by a good part of the time to the next.
    count = min(STRETCHES, len(rows) // ROWS)
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, count + 1).astype(int))]
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    at = log.t[rows]
    whole = np.concatenate([[0.0], np.cumsum(np.diff(t) > hole_s(t))])
    # Across a hole of its samples a speed's integral is a guess.
    known = np.diff(np.interp(at, t, whole)) == 0.0
    parts = (angle[rows], np.interp(at, t, integral), np.interp(at, t, v), at)
    return np.stack([np.diff(part)[known] for part in parts])


def _pooled(pairs: list[np.ndarray | None]) -> np.ndarray | None:
    found = [pair for pair in pairs if pair is not None and pair.shape[1]]
    return np.concatenate(found, axis=1) if found else None


def _left(parts: np.ndarray, offset: bool = False) -> tuple[float, float, float]:
    """What a speed leaves of the ways turned (rms), the ways themselves (rms), and how many times the speed's they are.

    offset : whether the speed's sensor may have an offset.
    """
    turned, columns = parts[0], np.stack([parts[1], parts[2], *([parts[3]] if offset else [])], axis=1)
    scale = np.linalg.norm(columns, axis=0)
    columns = columns / np.where(scale > 0.0, scale, 1.0)
    by = np.linalg.lstsq(columns, turned, rcond=None)[0]
    rms = float(np.sqrt(np.mean((turned - columns @ by) ** 2)))
    return rms, float(np.sqrt(np.mean(turned**2))), float(by[0] / scale[0]) if scale[0] > 0.0 else 0.0


def _angle(case: Case, s: str, replays: list[np.ndarray]) -> dict[str, str]:
    """Channel that is set aside of a wheel's speed and angle -> why; nothing where they agree."""
    robot, w, th = case.robot, f"w_{s}", f"th_{s}"
    runs = [log for log in case.runs if log.has(w) and log.has(th)]
    own = _pooled([_stretches(log, log.columns[w], log.columns[th]) for log in runs])
    noise = robot.noise(th)
    if own is None or noise is None or own.shape[1] < FEWEST_SAMPLES:
        return {}
    left, way, times = _left(own)
    if left < SIGNIFICANT * noise or way < SIGNIFICANT * noise:
        return {}
    other = {"l": "r", "r": "l"}[s]
    theirs = None
    if other in robot.sides and all(log.has(f"w_{other}") for log in runs):
        theirs = _pooled([_stretches(log, log.columns[f"w_{other}"], log.columns[th]) for log in runs])
    swapped = theirs is not None and theirs.shape[1] >= FEWEST_SAMPLES and _left(theirs)[0] < left / CLEAR_RATIO
    if not swapped and left < EQUAL_WITHIN * way and times > 0.0:
        return {}
    # A speed counts, and its angle then does not: it goes only where it is seen to be the other wheel's.
    wrong, right = (w, th) if _is_the_other_s(runs, robot, s, other) and _believed(case, s, replays) else (th, w)
    if wrong == w or swapped:
        why = f"it turns as the {NAMES[other]} wheel does"
    elif times <= 0.0:
        why = "it turns the other way"
    else:
        why = f"{100.0 * left / way:.0f} % of the way that it shows is not the other's"
    return {wrong: f"{wrong} contradicts {right}: {why}; {wrong} is set aside."}


def _is_the_other_s(runs: list[RunLog], robot: Robot, s: str, other: str) -> bool:
    """Whether a wheel's speed differs from the other wheel's by no more than noise, in every run."""
    noise = robot.noise(f"w_{s}")
    if other not in robot.sides or noise is None or not all(log.has(f"w_{other}") for log in runs):
        return False
    apart = [log.columns[f"w_{s}"] - log.columns[f"w_{other}"] for log in runs]
    return all(
        np.isfinite(d).any() and float(np.nanquantile(np.abs(d), CORRELATED)) < SIGNIFICANT * noise for d in apart
    )


def _believed(case: Case, s: str, replays: list[np.ndarray]) -> bool:
    """Whether the nominal robot turns a wheel more as its angle says than as its speed does."""
    matches = {}
    for name in ("w", "th"):
        pairs = []
        for log, out in zip(case.runs, replays):
            if not (log.has(f"w_{s}") and log.has(f"th_{s}")) or not np.isfinite(out).all():
                continue
            rows = np.flatnonzero(np.isfinite(log.columns[f"{name}_{s}"]))
            v, r = log.columns[f"{name}_{s}"][rows], out[rows, OUTPUT_INDEX[f"{name}_{s}"]]
            if name == "th":
                rows = rows[:: max(1, len(rows) // STRETCHES)]
                v, r = (np.diff(x) for x in (log.columns[f"th_{s}"][rows], out[rows, OUTPUT_INDEX[f"th_{s}"]]))
            pairs.append(np.stack([v, r]))
        joined = np.concatenate(pairs, axis=1) if pairs else np.zeros((2, 1))
        norm = float(np.linalg.norm(joined[0]) * np.linalg.norm(joined[1]))
        matches[name] = float(joined[0] @ joined[1]) / norm if norm > 0.0 else 0.0
    return 1.0 - matches["th"] < (1.0 - matches["w"]) / CLEAR_RATIO


def _turn(case: Case) -> dict[str, str]:
    """Of gyro, yaw and wheels, which the same turns show, the one that the other two contradict -> why."""
    pairs: dict[tuple[str, str], list[np.ndarray | None]] = {}
    for log in case.runs:
        shown = _turns(log, case.robot)
        for a in shown:
            for b in shown:
                if a < b:
                    pairs.setdefault((a, b), []).append(_stretches(log, shown[a][1], shown[b][0]))
    follows = {}
    for pair, parts in pairs.items():
        pooled = _pooled(parts)
        noise = case.robot.noise("yaw") or 0.0
        if pooled is None or pooled.shape[1] < FEWEST_SAMPLES:
            continue
        left, way, _ = _left(pooled, offset=True)
        if way > SIGNIFICANT * noise and way > 0.0:
            follows[pair] = np.sqrt(max(0.0, 1.0 - (left / way) ** 2))
    for odd in ("gyro_z", "yaw"):
        against = [m for pair, m in follows.items() if odd in pair]
        among = [m for pair, m in follows.items() if odd not in pair]
        if len(against) == 2 and among and max(against) < CORRELATED and among[0] > CLOSELY_CORRELATED:
            rest = "the wheels and the yaw" if odd == "gyro_z" else "the wheels and the gyro"
            return {odd: f"{odd} contradicts what {rest} say alike of the robot's turns; {odd} is set aside."}
    return {}


def _turns(log: RunLog, robot: Robot) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """What shows the robot's turns -> the angle turned (n,) rad and its rate (n,) rad/s, each from its own channel."""
    found = {}
    if log.has("gyro_z"):
        found["gyro_z"] = _integrated(log.t, log.columns["gyro_z"]), log.columns["gyro_z"]
    if log.has("yaw"):
        good = np.isfinite(log.columns["yaw"])
        if good.sum() > 2:
            rate = np.full(len(log.t), np.nan)
            rate[good] = np.gradient(log.columns["yaw"][good], log.t[good])
            found["yaw"] = log.columns["yaw"], rate
    if log.has("w_l") and log.has("w_r"):
        rate = (log.columns["w_r"] - log.columns["w_l"]) * robot.wheeled.wheel_radius_m / robot.wheeled.track_width_m
        if np.isfinite(rate).sum() > 2:
            found["wheels"] = _integrated(log.t, rate), rate
    return found


def _integrated(t: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """The angle that a rate (n,) makes by each row, NaN where it has no sample."""
    good = np.isfinite(rate)
    result = np.full(len(t), np.nan)
    step = 0.5 * (rate[good][1:] + rate[good][:-1]) * np.diff(t[good])
    result[good] = np.concatenate([[0.0], np.cumsum(step)])
    return result
