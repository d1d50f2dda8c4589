"""Faults with a beginning: an encoder or a current sensor that sticks, an open motor phase, a dip of the supply.

No effect of the catalogue begins in the middle of a run, so a fit would put another cause in the place of such a fault.
"""

from __future__ import annotations

import math

import numpy as np

from rtds_host.contract import Robot, RunLog
from rtds_host.contract.clock import moment
from rtds_host.diagnosis.gate.findings import Finding, percent
from rtds_host.diagnosis.gate.limits import ROOM
from rtds_host.diagnosis.gate.sensors import without
from rtds_host.diagnosis.thresholds import CLEAR_RATIO, FEWEST_SAMPLES, MAJORITY, SIGNIFICANT

# Noises by which something moves where any live sensor would show it.
SHOWS = ROOM * SIGNIFICANT
SIDES = {"l": "left", "r": "right"}


def timed_faults(log: RunLog, robot: Robot) -> tuple[list[Finding], dict[str, np.ndarray]]:
    """Findings on faults of a run that begin in it, and channel -> rows (k,) that are no measurement."""
    found: list[Finding] = []
    aside: dict[str, np.ndarray] = {}
    told = [judge(log, robot, side) for judge in (_open, _voltage) for side in SIDES]
    for tell in (_dip(log, robot), *told):
        if tell is not None:
            found.append(tell)
    for side in SIDES:
        for judge in (_encoder, _current):
            said = judge(log, robot, side)
            if said is not None:
                found.append(said[0])
                aside |= said[1]
                # What a stuck encoder says of the speed is no evidence against the current.
                log = without(log, said[1])
    return found, aside


def _stretches(v: np.ndarray) -> list[slice]:
    """Rows of a channel in which one value repeats to the last digit, `FEWEST_SAMPLES` of them or more."""
    same = np.concatenate([[False], np.diff(v) == 0.0, [False]]).astype(int)
    edges = np.flatnonzero(np.diff(same))
    pairs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [slice(a, b + 1) for a, b in pairs if b + 1 - a >= FEWEST_SAMPLES]


def _median(log: RunLog, c: str, rows: slice) -> float:
    v = log.columns[c][rows] if log.has(c) else np.empty(0)
    v = v[np.isfinite(v)]
    return float(np.median(v)) if len(v) else math.nan


def _volts(log: RunLog, robot: Robot, side: str) -> np.ndarray | None:
    """(n,) V at a motor just before each row, by its command; None of a robot that is not driven by voltage."""
    c = f"v_cmd_{side}"
    if robot.driver.mode != "voltage" or not log.has(c):
        return None
    # A row's command acts from it on.
    before = np.concatenate([[0.0], log.columns[c][:-1]])
    volts = np.clip(before, -robot.supply_v, robot.supply_v)
    if robot.driver.bus != "measured":
        return volts
    bus = log.columns["v_bus"]
    return volts * np.concatenate([bus[:1], bus[:-1]]) / robot.supply_v


def _encoder(log: RunLog, robot: Robot, side: str) -> tuple[Finding, dict[str, np.ndarray]] | None:
    """An angle that stays while gyro and the other wheel say that this wheel turns, and its motor does not contradict.

    A wheel that is blocked takes the current V/R of a stalled motor: then the encoder is believed.
    """
    angle, speed, other = f"th_{side}", f"w_{side}", "w_r" if side == "l" else "w_l"
    body = robot.chassis

    def noise(c: str) -> float:
        return robot.noise(c) or 0.0

    if body is None or not all(log.has(c) and noise(c) for c in (angle, other, "gyro_z")):
        return None
    th = log.columns[angle]
    steps = np.abs(np.diff(th[np.isfinite(th)]))
    steps = steps[steps > 0.0]
    if not len(steps):
        return None
    lever = body.track_width_m / body.wheel_radius_m
    least = SHOWS * math.hypot(noise(other), noise("gyro_z") * lever)
    rate = log.columns[other] + (-lever if side == "l" else lever) * log.columns["gyro_z"]
    turned = np.cumsum(np.nan_to_num(rate) * np.gradient(log.t))
    stuck: list[tuple[slice, float]] = []
    for rows in _stretches(th):
        neighbour = _median(log, other, rows)
        values = rate[rows][np.isfinite(rate[rows])]
        expected = float(np.median(values)) if len(values) else 0.0
        missed = float(turned[rows.stop - 1] - turned[rows.start])
        reads = _median(log, speed, rows)
        if (
            abs(expected) > max(least, MAJORITY * abs(neighbour))
            and abs(missed) > SHOWS * max(noise(angle), float(steps.min()))
            and not abs(reads) > SIGNIFICANT * (noise(speed) or noise(other))
            and _turns(log, robot, side, rows, expected)
        ):
            stuck.append((rows, expected))
    if not stuck:
        return None
    rows, expected = max(stuck, key=lambda one: one[0].stop - one[0].start)
    counts: list[np.ndarray] = []
    for part, _ in stuck:
        counts.append(np.arange(part.start + 1, part.stop))
        missed = float(turned[part.stop - 1] - turned[part.start])
        after = th[part.stop : part.stop + 1]
        if len(after) and abs(after[0] - th[part.stop - 1] - missed) > MAJORITY * abs(missed):
            # What was not counted is lost: every later angle lacks it.
            counts.append(np.arange(part.stop, len(th)))
    angles = np.unique(np.concatenate(counts))
    speeds = np.concatenate([np.arange(part.start, part.stop) for part, _ in stuck])
    text = (
        f"{angle} stays at {th[rows.start]:.4g} for {np.ptp(log.t[rows]):.3g} s from "
        f"t = {moment(log.t[rows.start])} s, while the gyro and the {SIDES[other[-1]]} wheel say "
        f"that it turns at {expected:.3g} rad/s: the {SIDES[side]} encoder was stuck; "
        f"{percent(len(angles) / len(th))} of its angles are set aside."
    )
    finding = Finding(log.name, angle, "encoder_stuck", "warning", text, len(angles) / len(th))
    return finding, {angle: angles} | ({speed: speeds} if log.has(speed) else {})


def _turns(log: RunLog, robot: Robot, side: str, rows: slice, expected: float) -> bool:
    """Whether voltage and current of a motor allow for a wheel that turns so, rad/s: unknown counts as yes."""
    volts = _volts(log, robot, side)
    if volts is None or not log.has(f"i_{side}"):
        return True
    m = robot.motor
    emf = volts[rows] - m.resistance_ohm * log.columns[f"i_{side}"][rows]
    emf = emf[np.isfinite(emf)]
    turning = m.back_emf_constant_v_s_per_rad * m.gear_ratio * expected
    return not len(emf) or float(np.median(emf)) / turning > MAJORITY


def _current(log: RunLog, robot: Robot, side: str) -> tuple[Finding, dict[str, np.ndarray]] | None:
    """A current at one value while (V - Kb w) / R, what the motor takes in the steady state, changes by far."""
    c, noise = f"i_{side}", robot.noise(f"i_{side}")
    known = _expected_current(log, robot, side)
    if known is None or not noise:
        return None
    taken, sigma = known
    i = log.columns[c]
    levels = np.unique(i[np.isfinite(i)])
    if len(levels) < 2 or CLEAR_RATIO * float(np.min(np.diff(levels))) > noise:
        # A coarse sensor repeats itself.
        return None
    stuck = [
        rows
        for rows in _stretches(i)
        if abs(i[rows.start]) > SIGNIFICANT * noise
        and np.isfinite(taken[rows]).sum() >= FEWEST_SAMPLES
        and float(np.nanstd(taken[rows])) > SIGNIFICANT * sigma
    ]
    if not stuck:
        return None
    longest = max(stuck, key=lambda rows: rows.stop - rows.start)
    aside = np.concatenate([np.arange(rows.start, rows.stop) for rows in stuck])
    text = (
        f"{c} stays at {i[longest.start]:.4g} for {np.ptp(log.t[longest]):.3g} s from "
        f"t = {moment(log.t[longest.start])} s, while voltage and speed ask for another current: its converter was "
        f"stuck; {percent(len(aside) / len(i))} of its samples are set aside."
    )
    return Finding(log.name, c, "adc_stuck", "warning", text, len(aside) / len(i)), {c: aside}


def _expected_current(log: RunLog, robot: Robot, side: str) -> tuple[np.ndarray, float] | None:
    """(n,) A that a motor takes in the steady state, (V - Kb w) / R, and its noise; None where it is not known."""
    volts, noise = _volts(log, robot, side), robot.noise(f"i_{side}")
    if volts is None or not noise or not log.has(f"i_{side}") or not log.has(f"w_{side}"):
        return None
    m = robot.motor
    emf = m.back_emf_constant_v_s_per_rad * m.gear_ratio
    sigma = math.hypot(noise, (robot.noise(f"w_{side}") or 0.0) * emf / m.resistance_ohm)
    return (volts - emf * log.columns[f"w_{side}"]) / m.resistance_ohm, sigma


def _open(log: RunLog, robot: Robot, side: str) -> Finding | None:
    """A motor without current while voltage and speed ask for one.

    A dead zone or a bridge's drop takes the current away by the size of the voltage: then less voltage gets none.
    """
    known = _expected_current(log, robot, side)
    if known is None:
        return None
    taken, sigma = known
    i = log.columns[f"i_{side}"]
    asked = np.abs(taken) > SHOWS * sigma
    quiet = np.abs(i) < SIGNIFICANT * (robot.noise(f"i_{side}") or 0.0)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], quiet, [False]]).astype(int)))
    parts = [slice(a, b) for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)]
    parts = [rows for rows in parts if asked[rows].sum() >= FEWEST_SAMPLES]
    if not parts:
        return None
    longest = max(parts, key=lambda rows: rows.stop - rows.start)
    volts, noise = _volts(log, robot, side), robot.noise(f"i_{side}") or 0.0
    assert volts is not None
    rows = np.flatnonzero(asked[longest]) + longest.start
    # Driven by less, with less before it: neither a dead zone nor a drop lets it through and not the other.
    less = (np.abs(i) > SIGNIFICANT * noise) & (i * volts > 0.0) & (i * taken > 0.0)
    for what in (volts, taken):
        less &= np.abs(what) < float(np.median(np.abs(what[rows])))
    if less.sum() < FEWEST_SAMPLES:
        return None
    missing = float(np.median(taken[rows]))
    text = (
        f"i_{side} is zero for {np.ptp(log.t[longest]):.3g} s from t = {moment(log.t[longest.start])} s, while voltage "
        f"and speed ask for {missing:.3g} A, and less voltage gets a current elsewhere: the {SIDES[side]} motor's "
        "phase was open, or its driver off. No effect begins at a time: leave these seconds out."
    )
    return Finding(log.name, f"i_{side}", "phase_open", "warning", text, float(quiet[longest].sum()) / len(i))


def _voltage(log: RunLog, robot: Robot, side: str) -> Finding | None:
    """A motor at one voltage, R i + Kb w, above what changing commands ask for.

    A limit or a dead zone takes voltage away, and a gain or a curve moves with the command.
    """
    known = _expected_current(log, robot, side)
    volts = _volts(log, robot, side)
    if known is None or volts is None:
        return None
    taken, sigma = known
    sigma *= robot.motor.resistance_ohm
    at = volts + robot.motor.resistance_ohm * (log.columns[f"i_{side}"] - taken)
    beyond = (np.abs(at) > np.abs(volts) + SHOWS * sigma) | (at * volts < 0.0) & (np.abs(at) > SHOWS * sigma)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], beyond, [False]]).astype(int)))
    stuck = [
        slice(a, b)
        for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
        if b - a >= FEWEST_SAMPLES and np.std(at[a:b]) < SIGNIFICANT * sigma and np.ptp(volts[a:b]) > SHOWS * sigma
    ]
    if not stuck:
        return None
    rows = max(stuck, key=lambda part: part.stop - part.start)
    text = (
        f"The {SIDES[side]} motor takes {float(np.median(at[rows])):.3g} V for {np.ptp(log.t[rows]):.3g} s from "
        f"t = {moment(log.t[rows.start])} s, while its commands go from {volts[rows].min():.3g} to "
        f"{volts[rows].max():.3g} V: its input was stuck. No effect begins at a time: leave these seconds out."
    )
    return Finding(log.name, f"v_cmd_{side}", "voltage_stuck", "warning", text, (rows.stop - rows.start) / len(at))


def _dip(log: RunLog, robot: Robot) -> Finding | None:
    """A step down of the bus while the motors draw less. Over a supply's resistance it falls when they draw more."""
    noise = robot.noise("v_bus")
    if not noise or robot.driver.bus == "measured" or not all(log.has(c) for c in ("v_bus", "i_l", "i_r")):
        return None
    volts = [_volts(log, robot, side) for side in SIDES]
    if volts[0] is None or volts[1] is None or len(log.t) < FEWEST_SAMPLES:
        return None
    bus = log.columns["v_bus"]
    draw = (volts[0] * log.columns["i_l"] + volts[1] * log.columns["i_r"]) / robot.supply_v
    fall = bus[1:-2] - bus[2:-1]
    # The current of the row after next: by then the windings have followed.
    less = draw[1:-2] - draw[3:]
    sigma = math.sqrt(2.0) * noise
    steps = np.flatnonzero((fall > SHOWS * sigma) & (less > 0.0) & (np.abs(bus[3:] - bus[2:-1]) < 0.5 * fall))
    if not len(steps):
        return None
    first = int(steps[0]) + 2
    after = np.flatnonzero(bus[first:] > bus[first] + MAJORITY * fall[first - 2])
    end = first + int(after[0]) if len(after) else len(bus) - 1
    text = (
        f"v_bus falls from {bus[first - 1]:.4g} to {bus[first]:.4g} V at t = {moment(log.t[first])} s while the motors "
        f'draw less, for {log.t[end] - log.t[first]:.3g} s: the supply dipped. A robot.toml with bus = "measured" in '
        "[driver] lets the replay follow it."
    )
    return Finding(log.name, "v_bus", "supply_dip", "warning", text, (end - first) / len(bus))
