"""Scales and signs: units and sides that cannot be right end a diagnosis, signs that look swapped are named.

Gains of the catalogue reach from -1 over 0.4 to 2; friction takes any part of a motion. So a channel that shows too
much is refused beyond `ROOM` times the nominal, one that shows too little only where it follows the nominal robot
closely, at the very factor of a unit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from rtds_host.contract import Case, Robot, RunLog
from rtds_host.contract.clock import PER_SECOND, is_rate, likely_unit
from rtds_host.diagnosis.gate.findings import Finding
from rtds_host.diagnosis.gate.limits import ROOM, Limits, channels, kind_of
from rtds_host.diagnosis.gate.timing import CLOSE, clock_ratio, rolled_over_turned
from rtds_host.diagnosis.nuisances import LATENCY_S
from rtds_host.diagnosis.replay.model import LONGEST_DELAY_S, nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.thresholds import (
    CLOSELY_CORRELATED,
    CORRELATED,
    FEW_SHARE,
    FEWEST_SAMPLES,
    MINOR_SHARE,
    SIGNIFICANT,
)
from rtds_host.errors import InputError
from rtds_host.plant.schema import OUTPUT_INDEX

# Numerical: how finely a lag is looked for, s, first and last, and on how many samples.
GRID_S, FINE_S, SAMPLES = 0.01, 0.001, 1500


def _factors(robot: Robot) -> dict[str, dict[str, float]]:
    """Quantity -> unit -> how much larger its numbers are than SI's."""
    radius = robot.chassis.wheel_radius_m if robot.chassis else math.nan
    gear = robot.motor.gear_ratio
    degrees = 180 / math.pi
    length = {"millimetres": 1000.0, "centimetres": 100.0}
    # What happens most often first: a gear forgotten, then degrees and turns, then the rest.
    known = {
        "w": {
            "radians per second of the motor": gear,
            "degrees per second": degrees,
            "revolutions per minute": 30 / math.pi,
            "metres per second at the rim": radius,
            "millimetres per second at the rim": 1e3 * radius,
            "revolutions per second": 0.5 / math.pi,
            "revolutions per minute of the motor": gear * 30 / math.pi,
            "milliradians per second": 1e3,
        },
        "th": {"radians of the motor": gear, "degrees": degrees, "turns": 0.5 / math.pi, "milliradians": 1e3},
        "i": {"milliamperes": 1000.0},
        "gyro": {"degrees per second": degrees, "milliradians per second": 1e3},
        "yaw": {"degrees": degrees, "milliradians": 1e3},
        "x": length,
        "y": length,
        "v_bus": {"millivolts": 1000.0},
        "v_cmd": {"millivolts": 1000.0},
    }
    return {
        q: {u: f for u, f in units.items() if math.isfinite(f) and not 1.0 / ROOM < f < ROOM}
        for q, units in known.items()
    }


def _unit(ratio: float, factors: dict[str, float]) -> str:
    """The unit whose factor is nearest to a ratio."""
    return min(factors, key=lambda u: abs(math.log(abs(ratio) / factors[u])))


def _units(ratio: float, unit: str, factors: dict[str, float]) -> str:
    """A unit by name, and a likelier one of the same size to within what a ratio is known: a gear before degrees."""
    if unit not in factors:
        return unit
    close = [u for u in factors if abs(math.log(abs(ratio) / factors[u])) < math.log(CLOSE)]
    return f"{close[0]} or in {unit}" if unit in close and close[0] != unit else unit


def _refusal(log: RunLog, names: list[str], what: str, unit: str) -> InputError:
    joined = " and ".join(names) if len(names) < 3 else ", ".join(names)
    return InputError(f"{log.path or log.name}: {joined}: {what}: in {unit}?")


def check_commands(case: Case, bounds: Limits) -> None:
    """Refuse commands and buses that are no volts, and commanded speeds beyond all motors. Needs no replay.

    Raises
    ------
    InputError : names the run, the channels, how far beyond, and the likely unit.
    """
    robot = case.robot
    factors = _factors(robot)
    # Nearer to millivolts than to volts: what a controller asks for in volts may be more than the supply.
    volts = math.sqrt(factors["v_cmd"]["millivolts"]) * robot.supply_v
    for log in case.runs:
        commands = [f"w_cmd_{s}" if robot.driver.mode == "speed" else f"v_cmd_{s}" for s in robot.sides]
        tops = {c: _scale_of(log.columns[c]) for c in commands}
        if robot.driver.mode == "speed":
            free = bounds.values["w_l"] / ROOM
            if any(top > ROOM * free for top in tops.values()):
                ratio = max(tops.values()) / free
                raise _refusal(
                    log, commands, f"reach {ratio:.3g} times the nominal no-load speed", _unit(ratio, factors["w"])
                )
        elif robot.driver.mode == "voltage" and any(top > volts for top in tops.values()):
            raise _refusal(
                log, commands, f"reach {max(tops.values()):.4g} at a supply of {robot.supply_v:g} V", "millivolts"
            )
        if log.has("v_bus"):
            level = float(np.nanmedian(np.abs(log.columns["v_bus"])))
            if level > volts:
                raise _refusal(log, ["v_bus"], f"is {level:.4g} at a supply of {robot.supply_v:g} V", "millivolts")


def _scale_of(values: np.ndarray) -> float:
    """What all but a handful of samples stay within: isolated ones may be anything."""
    return float(np.nanquantile(np.abs(values), 1.0 - FEW_SHARE))


@dataclass
class Compared:
    """What a comparison of one run with the nominal replay gave.

    wrong : channel -> how many times the nominal it is, and the likely unit; right : channels that follow it closely at
    its scale; ratios : channel -> how many times the nominal (of a turn: what the wheels show) it is, and how closely
    it follows that.
    """

    findings: list[Finding] = field(default_factory=list)
    lags: list[tuple[str, float]] = field(default_factory=list)
    wrong: dict[str, tuple[float, str]] = field(default_factory=dict)
    right: set[str] = field(default_factory=set)
    ratios: dict[str, tuple[float, float]] = field(default_factory=dict)


def _match(t: np.ndarray, v: np.ndarray, grid: np.ndarray, replayed: np.ndarray, lag: float) -> float:
    r = np.interp(t - lag, grid, replayed)
    r = r - r.mean()
    v = v - v.mean()
    norm = float(np.sqrt(np.sum(r * r) * np.sum(v * v)))
    return float(np.sum(r * v)) / norm if norm > 0 else 0.0


def lag_and_ratio(
    log: RunLog, channel: str, replayed: np.ndarray, search: bool
) -> tuple[float | None, float, float] | None:
    """Lag (s, positive: the measured comes later), root-mean-square ratio and correlation to the nominal replay.

    The lag is None where it is not certain, or not searched for. None in place of all with too few samples.
    """
    good = np.isfinite(log.columns[channel])
    v, t = log.columns[channel][good], log.t[good]
    if len(v) < FEWEST_SAMPLES:
        return None
    thin = max(1, len(v) // SAMPLES)
    some, at = v[::thin], t[::thin]
    lag, certain = 0.0, False
    if search:

        def by(x: float) -> float:
            return abs(_match(at, some, log.t, replayed, x))

        # Clocks that disagree may do so by as much as a delay; of lags that serve alike the shortest.
        lag = max(sorted(np.arange(-LONGEST_DELAY_S, LONGEST_DELAY_S + 0.5 * GRID_S, GRID_S), key=abs), key=by)
        lag = float(max(lag + np.arange(FINE_S - GRID_S, GRID_S - 0.5 * FINE_S, FINE_S), key=by))
        # A lag counts only if it explains much of what the replay misses: distortion shifts a peak a little, too. And
        # it has to do so on the same samples of both: how a run begins in the replay, from a speed that no friction
        # held, is in no lag's way.
        shared = (at - abs(lag) >= log.t[0]) & (at + abs(lag) <= log.t[-1])
        if shared.sum() < FEWEST_SAMPLES:
            shared[:] = True
        misses = [1.0 - abs(_match(at[shared], some[shared], log.t, replayed, x)) for x in (lag, 0.0)]
        certain = misses[0] <= 0.5 * misses[1]
        if not certain:
            # Nor is a peak within a step of none at all a lag.
            certain = abs(lag) <= float(np.median(np.diff(t)))
            lag = 0.0
    match = _match(at, some, log.t, replayed, lag)
    r = np.interp(t - lag, log.t, replayed)
    scale = float(np.sqrt(np.sum(v**2) / max(np.sum(r**2), 1e-30)))
    return lag if certain else None, math.copysign(scale, match), abs(match)


def compare(log: RunLog, robot: Robot, replayed: np.ndarray, bounds: Limits) -> Compared:
    """Scales, signs and lags of a run against the nominal replay (n, 11), and magnitudes beyond all bounds.

    A run without a command is a coast or a brake from the measured start: how far it goes is friction's affair, and
    proves no unit.
    """
    result = Compared()
    factors = _factors(robot)
    ratios = {}
    driven = bool(log.commands(robot.driver.mode).any())
    for c in (c for c in channels(robot) if log.has(c)):
        values = log.columns[c]
        if c == "v_bus":
            level = float(np.nanmedian(np.abs(values)))
            if not robot.supply_v / ROOM < level < ROOM * robot.supply_v:
                result.findings.append(
                    Finding(
                        log.name,
                        c,
                        "level",
                        "warning",
                        f"v_bus is {level:.3g} V, the nominal supply {robot.supply_v:g} V.",
                    )
                )
            continue
        column: np.ndarray | None = replayed[:, OUTPUT_INDEX[c]]
        if c in ("gyro_z", "yaw"):
            # A turn is a small difference of two sides: where one of them is weaker than nominal, the replay hardly
            # turns.
            column = turned_by_wheels(log, robot, c)
        beyond = _scale_of(values) / bounds.values.get(c, math.inf)
        if beyond > 1.0:
            # At least so many times the nominal; a comparison below may know it better.
            result.wrong[c] = ROOM * beyond, _unit(ROOM * beyond, factors[kind_of(c)])
        noise = robot.noise(c)
        if (
            noise is None
            or column is None
            or not np.isfinite(column).all()
            or float(np.std(column)) < SIGNIFICANT * noise
        ):
            continue
        if not driven and c not in ("gyro_z", "yaw"):
            continue
        way = c.startswith(("th", "x", "y"))
        found = lag_and_ratio(
            log, c, column - column[0] if way else column, c[0] == "w" and robot.driver.mode == "voltage"
        )
        if found is None:
            continue
        lag, ratio, match = found
        if way:
            # A straight drive has next to no y of its own, and a heading a little off brings some: lengths are compared
            # in the plane.
            along = ["x", "y"] if c in ("x", "y") and log.has("x") and log.has("y") else [c]
            moved = _way_from_start(np.stack([log.columns[a] for a in along]))
            could = _way_from_start(np.stack([replayed[:, OUTPUT_INDEX[a]] for a in along]))
            ratio = math.copysign(moved / max(could, 1e-30), ratio)
        if ratio == 0.0:
            continue
        ratios[c] = ratio
        result.ratios[c] = ratio, match
        _scale(result, c, ratio, match, factors[kind_of(c)])
        _sign(result, log, c, ratio, match)
        if c[0] == "w" and match > CLOSELY_CORRELATED and lag is not None:
            _lag(result, log, c, lag)
    _turn(result, log, robot, ratios)
    _side_by_side(result, log, robot, factors)
    return result


def _way_from_start(values: np.ndarray) -> float:
    """Root-mean-square distance from the first sample, of coordinates (1 or 2, n)."""
    known = values[:, np.isfinite(values).all(axis=0)]
    return float(np.sqrt(np.mean(np.sum((known - known[:, :1]) ** 2, axis=0)))) if known.shape[1] else 0.0


def turned_by_wheels(log: RunLog, robot: Robot, channel: str) -> np.ndarray | None:
    """Yaw rate, rad/s (of `yaw`: the heading gained, rad) by the measured wheels, (n,); None where one is not
    measured.
    """
    speeds = []
    for side in "lr":
        w, th = log.columns.get(f"w_{side}"), log.columns.get(f"th_{side}")
        source = w if w is not None and np.isfinite(w).sum() > 1 else th
        if source is None or np.isfinite(source).sum() < 2:
            return None
        good = np.isfinite(source)
        values = np.interp(log.t, log.t[good], source[good])
        speeds.append(values if source is w else np.gradient(values, log.t))
    rate = (speeds[1] - speeds[0]) * robot.wheeled.wheel_radius_m / robot.wheeled.track_width_m
    return np.concatenate([[0.0], np.cumsum(rate[:-1] * np.diff(log.t))]) if channel == "yaw" else rate


def _side_by_side(result: Compared, log: RunLog, robot: Robot, factors: dict[str, dict[str, float]]) -> None:
    """Name the unit of a speed by its angle, which friction and gains leave alone."""
    for s in robot.sides:
        w, th = f"w_{s}", f"th_{s}"
        if w not in result.wrong or not log.has(th):
            continue
        if th in result.wrong:
            # Both in a unit of one kind, which is the angle's.
            unit = _unit(result.wrong[th][0], factors["th"])
            result.wrong[w] = (
                result.wrong[w][0],
                {
                    "degrees": "degrees per second",
                    "milliradians": "milliradians per second",
                    "radians of the motor": "radians per second of the motor",
                }.get(unit, result.wrong[w][1]),
            )
            continue
        ratio = clock_ratio(log, log.columns[w], log.columns[th], robot.noise(th) or 0.0)
        if ratio is not None and abs(ratio) > ROOM:
            result.wrong[w] = ratio, _unit(ratio, factors["w"])


def _scale(result: Compared, c: str, ratio: float, match: float, factors: dict[str, float]) -> None:
    freely = c[0] == "i" or c in ("x", "y")
    # Turns are compared with what the wheels' sensors say, which may be clipped, or slip: there a unit has to be met.
    bound = not freely and c not in ("gyro_z", "yaw")
    unit = _unit(ratio, factors)
    near = abs(math.log(abs(ratio) / factors[unit])) < math.log(ROOM if freely else CLOSE)
    too_much = abs(ratio) > ROOM and (near or bound)
    # Too little may be friction and a gain; but friction follows no voltage closely at a slight part of the speed.
    too_little = factors[unit] < MINOR_SHARE and near and match > CLOSELY_CORRELATED
    if too_little or too_much and match > CORRELATED:
        result.wrong[c] = ratio, unit
    elif match > CLOSELY_CORRELATED and 1.0 / ROOM < abs(ratio) < ROOM:
        result.right.add(c)


def _sign(result: Compared, log: RunLog, c: str, ratio: float, match: float) -> None:
    # A pose runs against the replay's wherever the robot turned otherwise.
    if ratio >= 0 or c in ("x", "y") or match < (CORRELATED if c[0] == "i" else CLOSELY_CORRELATED):
        return
    if c[0] == "w":
        text = f"{c} runs against its command (correlation {-match:.2f}): leads or sign swapped?"
    else:
        text = f"{c} has the opposite sign of the nominal robot's (correlation {-match:.2f}): sign swapped?"
    result.findings.append(Finding(log.name, c, "sign", "note", text))


def _turn(result: Compared, log: RunLog, robot: Robot, ratios: dict[str, float]) -> None:
    """Refuse a yaw that runs against wheels which follow their commands, and against the gyro: no effect does so.

    Raises
    ------
    InputError : names the run.
    """
    signs = {f.channel for f in result.findings if f.kind == "sign"}
    sound = all(ratios.get(f"w_{s}", ratios.get(f"th_{s}", 0.0)) > 0.0 for s in robot.sides)
    if "yaw" in signs and sound and ratios.get("gyro_z", 1.0) > 0.0:
        seen = "the wheels and the gyro" if "gyro_z" in ratios else "the wheels"
        raise InputError(
            f"{log.path or log.name}: yaw: runs against what {seen} turn: counted to the right? Left is positive"
        )


def _lag(result: Compared, log: RunLog, c: str, lag: float) -> None:
    result.lags.append((c, lag))
    step = float(np.median(np.diff(log.t[np.isfinite(log.columns[c])])))
    if abs(lag) > max(LATENCY_S, (1.0 + FEW_SHARE) * step):
        # The catalogue has delays, and nothing that answers before it is asked.
        late = lag > 0
        result.findings.append(
            Finding(
                log.name,
                c,
                "delay",
                "note" if late else "warning",
                f"{c} answers the command {1e3 * abs(lag):.0f} ms {'later' if late else 'earlier'} than the nominal "
                "robot" + ("." if late else ": clocks that do not agree?"),
            )
        )


def _refuse_duty(compared: list[tuple[RunLog, Compared]], robot: Robot) -> None:
    """Refuse commands between -1 and 1 that drive as voltages of many times that would, in every run that is driven.

    Raises
    ------
    InputError : names the first driven run.
    """
    if robot.driver.mode != "voltage" or robot.supply_v <= ROOM:
        return
    for s in robot.sides:
        name = f"v_cmd_{s}"
        driven = [(log, found) for log, found in compared if log.columns[name].any()]
        if not driven or max(float(np.max(np.abs(log.columns[name]))) for log, _ in driven) > 1.0 + MINOR_SHARE:
            continue
        told = [
            (log, abs(found.ratios[f"w_{s}" if f"w_{s}" in found.ratios else f"th_{s}"][0]))
            for log, found in driven
            if f"w_{s}" in found.ratios or f"th_{s}" in found.ratios
        ]
        if told and all(ROOM < ratio < 2.0 * robot.supply_v for _, ratio in told):
            names = [f"v_cmd_{other}" for other in robot.sides]
            ratio = float(np.median([ratio for _, ratio in told]))
            raise _refusal(
                told[0][0],
                names,
                f"the wheels turn {ratio:.3g} times as fast as it drives them in volts",
                "shares of the supply (a duty)",
            )


def refuse(compared: list[tuple[RunLog, Compared]], robot: Robot, bounds: Limits) -> list[Finding]:
    """Refuse a case with a channel whose scale is certainly a unit's; what is said of channels whose scale is not.

    One logger wrote all runs, so the evidence is the whole case's: a channel is in another unit where most of the runs
    that can tell say so and none follows the nominal robot closely at its scale. What a single run shows next to that
    is what the robot did, unless no robot can: one that slides down a slope goes a hundred times as far as its wheels.

    Raises
    ------
    InputError : names the first such run, the channels of the first unit, and the unit.
    """
    _refuse_duty(compared, robot)
    factors = _factors(robot)
    right = set().union(*(found.right for _, found in compared))
    told = []
    for log, found in compared:
        wrong = {
            c: one
            for c, one in found.wrong.items()
            if not right & _pose_of(c)
            and _in_most(compared, c)
            or log.has(c)
            and _scale_of(log.columns[c]) > bounds.values.get(c, math.inf)
        }
        if wrong:
            raise _wrong_unit(log, wrong, factors)
        told += [
            Finding(
                log.name,
                c,
                "scale",
                "warning",
                f"{c} shows {abs(ratio):.3g} times what the nominal robot would in this run, and in "
                f"others what it would: not in {unit}, unless in this run alone.",
            )
            for c, (ratio, unit) in found.wrong.items()
        ]
    return told + _counts(compared)


def _in_most(compared: list[tuple[RunLog, Compared]], c: str) -> bool:
    """Whether a channel's scale is a unit's in most of the runs that tell its scale."""
    tell = [found for _, found in compared if c in found.wrong or found.ratios.get(c, (0.0, 0.0))[1] > CORRELATED]
    return 2 * sum(c in found.wrong for found in tell) > len(tell)


def _counts(compared: list[tuple[RunLog, Compared]]) -> list[Finding]:
    """What is said of a channel that closely shows twice or four times what it should, or as many times less, in every
    run that tells: edges of an encoder counted or not, a gear ratio, a wheel's size."""
    told = []
    for c in dict.fromkeys(c for _, found in compared for c in found.ratios):
        seen = [found.ratios[c] for _, found in compared if c in found.ratios]
        ratios = np.abs([ratio for ratio, match in seen if match > CLOSELY_CORRELATED])
        if c[0] == "i" or c in ("x", "y") or len(ratios) < len(seen):
            continue
        for times in (2.0, 4.0, 0.5, 0.25):
            if np.all(np.abs(ratios / times - 1.0) < 0.5 * MINOR_SHARE):
                turns = c in ("gyro_z", "yaw")
                what = "what the wheels' sensors say" if turns else "what the nominal robot would"
                cause = "are the encoders' edges counted otherwise, or the gear ratio or the wheels another?"
                told.append(
                    Finding("", c, "counts", "note", f"{c} shows {np.median(ratios):.3g} times {what}: {cause}")
                )
    return told


def _pose_of(channel: str) -> set[str]:
    """Channels that are in a unit together with one: itself, and both lengths of a pose."""
    return {"x", "y"} if channel in ("x", "y") else {channel}


def _wrong_unit(log: RunLog, wrong: dict[str, tuple[float, str]], factors: dict[str, dict[str, float]]) -> InputError:
    first = next(iter(wrong))
    ratio, unit = wrong[first]
    alike = [c for c in wrong if wrong[c][1] == unit]
    what = f"{abs(ratio):.3g} times what the nominal robot would show"
    return _refusal(log, alike, what, _units(ratio, unit, factors[kind_of(first)]))


def check_minutes(log: RunLog, case: Case) -> None:
    """Refuse a run whose `t` counts minutes where neither its rate nor two channels of one motion show it.

    Taken for seconds, its wheels answer commands of that pace as no motor of this robot does; taken for minutes, the
    nominal robot follows them closely.

    Raises
    ------
    InputError : names the run and the unit.
    """
    robot, minute = case.robot, 1.0 / PER_SECOND["minutes"]
    if not is_rate(minute * float(np.median(np.diff(log.t)))) or rolled_over_turned(log, case) is not None:
        return
    commands = np.abs(log.commands(robot.driver.mode)).max(axis=1)
    first = max(0, int(np.argmax(commands > MINOR_SHARE * commands.max())) - 1)
    part = log.rows(first, int(np.searchsorted(log.t, log.t[first] + 1.0 / PER_SECOND["minutes"] / minute)))
    names = [
        c
        for c in (f"{kind}_{s}" for kind in ("w", "th") for s in robot.sides)
        if c in part.columns and np.isfinite(part.columns[c]).sum() >= FEWEST_SAMPLES and robot.noise(c)
    ]
    if not names:
        return
    model, pace = nominal_model(robot), []
    for factor in (1.0, minute):
        taken = replace(part, t=factor * (part.t - part.t[0]))
        out = replay_run(model, run_inputs(taken, robot))
        columns = {c: out[:, OUTPUT_INDEX[c]] for c in names}
        if (
            not np.isfinite(out).all()
            or factor == minute
            and any(np.std(v) < SIGNIFICANT * robot.known_noise(c) for c, v in columns.items())
        ):
            return
        pace.append(
            [
                abs(_match(taken.t[good], part.columns[c][good], taken.t, v, 0.0))
                for c, v in columns.items()
                for good in (np.isfinite(part.columns[c]),)
            ]
        )
    if max(pace[0]) < CORRELATED and min(pace[1]) > CLOSELY_CORRELATED:
        raise InputError(
            f"{log.path or log.name}: t: is it in minutes? With seconds, the wheels answer commands as no motor of "
            "this robot does"
        )


def check_staircase(case: Case) -> None:
    """Refuse runs of a row a second or slower whose wheels answer their commands as in a faster unit of time.

    Settled speeds follow the commands of their own row or of the one before, whatever lies between. Taken for the unit
    in which the rows would be a robot's log, the nominal robot follows a true staircase no more closely.

    Raises
    ------
    InputError : names the run and the unit.
    """
    robot, model = case.robot, nominal_model(case.robot)
    for log in case.runs:
        step = float(np.median(np.diff(log.t)))
        unit = likely_unit(step)
        if unit is None:
            continue
        part = log.rows(0, min(len(log.t), SAMPLES // 10))
        missed = []
        for factor in (1.0, 1.0 / PER_SECOND[unit]):
            taken = replace(part, t=factor * (part.t - part.t[0]))
            out = replay_run(model, run_inputs(taken, robot))
            missed.append(1.0 - _follows(taken, robot, out))
        if missed[1] < 0.5 * missed[0]:
            raise InputError(
                f"{log.path or log.name}: t: a row every {step:.3g} s, is it in {unit}? With seconds, the wheels "
                "answer their commands as no motor of this robot does"
            )


def _follows(log: RunLog, robot: Robot, replayed: np.ndarray) -> float:
    """How closely the wheels follow a replay (n, 11), the worst of them, rows of both as they stand or a row apart; 0
    where none tells."""
    found = []
    for c in (c for s in robot.sides for c in (f"w_{s}", f"th_{s}")):
        if not log.has(c) or robot.noise(c) is None:
            continue
        good = np.isfinite(log.columns[c])
        v, r = log.columns[c], replayed[:, OUTPUT_INDEX[c]]
        if (
            good.sum() < FEWEST_SAMPLES
            or not np.isfinite(r).all()
            or np.std(v[good]) < SIGNIFICANT * robot.known_noise(c)
        ):
            continue
        rows = np.arange(len(v), dtype=float)
        shifts = (0.0, -1.0) if c[0] == "w" else (0.0,)
        found.append(max(abs(_match(rows[good], v[good], rows, r, shift)) for shift in shifts))
    return min(found, default=0.0)


def refuse_exchanged(case: Case, replays: list[tuple[RunLog, np.ndarray]]) -> None:
    """Refuse a case whose wheels' sum follows the commands while their difference runs against them: no robot does so.

    replays : each run with its nominal replay (n, 11).

    Raises
    ------
    InputError : names the first run, and which of the channels are exchanged, as far as the gyro tells.
    """
    if case.robot.chassis is None:
        return
    sums, differences, turns = [], [], []
    for log, out in replays:
        if not (log.has("w_l") and log.has("w_r")) or not np.isfinite(out).all():
            continue
        left, right = log.columns["w_l"], log.columns["w_r"]
        good = np.isfinite(left) & np.isfinite(right)
        n_l, n_r = out[good, OUTPUT_INDEX["w_l"]], out[good, OUTPUT_INDEX["w_r"]]
        sums.append(np.stack([(left + right)[good], n_l + n_r]))
        differences.append(np.stack([(right - left)[good], n_r - n_l]))
        if log.has("gyro_z"):
            good &= np.isfinite(log.columns["gyro_z"])
            turns.append(np.stack([(right - left)[good], log.columns["gyro_z"][good]]))
    if (
        not sums
        or _together(sums) < CORRELATED
        or _together(differences) > -CORRELATED
        or _together(_apart(differences, sums)) > -CORRELATED
    ):
        return
    turn = _together(turns) if turns else 0.0
    which = "v_cmd_l and v_cmd_r" if turn > CORRELATED else "w_l and w_r" if turn < -CORRELATED else "left and right"
    log = replays[0][0]
    raise InputError(
        f"{log.path or log.name}: the sum of both wheels follows the commands and their difference runs against them: "
        f"are {which} exchanged?"
    )


def _apart(differences: list[np.ndarray], sums: list[np.ndarray]) -> list[np.ndarray]:
    """Differences of both wheels (2, n), measured and nominal, of each run, less what a wheel that is weaker than the
    other makes of the sum; 0 where no more than half of the nominal ones is left, since on such runs a weak wheel does
    what an exchange does."""
    found, left, whole = [], 0.0, 0.0
    total = [sum(float(s[k] @ s[k]) for s in sums) for k in range(2)]
    share = [
        sum(float(d[k] @ s[k]) for d, s in zip(differences, sums)) / total[k] if total[k] > 0 else 0.0 for k in range(2)
    ]
    for difference, both in zip(differences, sums):
        found.append(np.stack([difference[k] - share[k] * both[k] for k in range(2)]))
        left += float(found[-1][1] @ found[-1][1])
        whole += float(difference[1] @ difference[1])
    return found if left > 0.5 * whole else [np.zeros_like(pair) for pair in found]


def _together(pairs: list[np.ndarray]) -> float:
    """Correlation, about 0, of pairs (2, n) of several runs."""
    a, b = np.concatenate(pairs, axis=1)
    norm = math.sqrt(float(a @ a) * float(b @ b))
    return float(a @ b) / norm if norm > 0 else 0.0
