"""One recording into the rows and columns of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from rtds_host.contract import Robot
from rtds_host.contract.clock import is_rate, is_staircase
from rtds_host.errors import InputError
from rtds_host.importers.bag import Bag, is_bag
from rtds_host.importers.mapping import Mapping, Source, Twist
from rtds_host.importers.namespaces import find_namespace, within
from rtds_host.importers.plausible import complaints, faint
from rtds_host.importers.series import NS, Series
from rtds_host.importers.sysid import SysIdTable, angle_is_told, check_units
from rtds_host.importers.table import Table
from rtds_host.importers.units import FIXED, QUANTITY, factor
from rtds_host.importers.wpilog import WpiLog, is_wpilog

AT_REST_RAD_S, AT_REST_RAD = 0.2, 0.05
# A counter that starts again jumps by nearly all its range, where it otherwise goes by small steps.
JUMP, SMALL = 0.8, 0.05


@dataclass(frozen=True)
class Imported:
    """A recording in the contract's terms.

    `mode`: "voltage", "torque" or "speed"; `columns`: name -> (n,), `t` first, NaN where a row has no sample;
    `start_ns`: time of the first row on the recording's clock; `counts`: samples a channel; `notices`: what was
    left out, repaired or assumed.
    """

    path: Path
    mode: str
    columns: dict[str, np.ndarray]
    start_ns: int
    counts: dict[str, int]
    notices: tuple[str, ...] = field(default=())


def assemble(
    path: Path,
    mapping: Mapping,
    robot: Robot,
    start_s: float = 0.0,
    end_s: float = math.inf,
    trust_units: bool = False,
    sloped: bool = False,
    form: str = "csv",
    namespace: str | None = None,
    part: str = "",
) -> Imported:
    """Read a bag or a table and bring it into the contract's columns.

    Parameters
    ----------
    start_s, end_s : part of the recording to take, in seconds from its first command or sample.
    trust_units : a suspicious unit becomes a notice instead of an error.
    sloped : the run was on a declared slope, so a pose that only says where the robot started is of use.
    form : "csv" rounds times so that nine digits keep them apart; "parquet" keeps nanoseconds.
    namespace : of the robot's topics in a bag; the only one there is, if None. part : the test of a SysId file.

    Raises
    ------
    InputError : one line that names the file, the topic or column, and what is wrong.
    """
    file = SysIdTable(path, mapping, part) if part else _opened(path, mapping)
    space = find_namespace(path, file.topics, mapping, namespace) if isinstance(file, Bag) else ""
    if space:
        mapping = within(mapping, space)
        file.notices.append(f"{path.name}: topics are those in {space}")
    requests: list[Source | Twist] = [s for sources in mapping.signals.values() for s in sources]
    if mapping.twist is not None:
        requests.append(mapping.twist)
    file.read([r for r in requests if file.available(r)])
    notices = list(file.notices)
    doubts = _clock(file, mapping) + (
        check_units(path, robot) if part and mapping.name.startswith("wpilib_sysid") else []
    )
    if part and mapping.name == "wpilib_sysid" and not angle_is_told(path, robot):
        mapping = replace(mapping, signals={k: v for k, v in mapping.signals.items() if k != "gyro_z"})
        notices.append(
            f"{path.name}: angle and angular rate are left out: the robot does not turn, and nothing else says whether "
            "they are in rad or degrees (a mapping of your own can)"
        )
    signals = _signals(file, mapping, robot, notices)
    mode = _commands(file, mapping, robot, signals, notices)
    sides = robot.sides
    commands = [f"{'w_cmd' if mode == 'speed' else 'v_cmd'}_{s}" for s in sides]
    _check_wheels(file, mapping, robot, signals)
    for name in ("x", "y", "yaw"):
        used = [source for source in mapping.signals.get(name, ()) if source.use == "start"]
        if used and name in signals:
            if sloped:
                signals[name] = signals[name].keep(np.arange(len(signals[name])) == 0)
            else:
                del signals[name]
    found = doubts + complaints(
        {k: v for k, v in signals.items() if k not in ("x", "y", "yaw") or len(v) > 1}, robot, mode
    )
    if found:
        if not trust_units:
            raise InputError(f"{path}: {'; '.join(found)} (mapping {mapping.path.name}; --trust-units if it is right)")
        notices += [f"{path.name}: {text}" for text in found]
    notices += [f"{path.name}: {text}" for text in faint(signals, robot)]

    signals, start_ns = _span(path, signals, commands, mapping, start_s, end_s, notices)
    columns = _columns(signals, commands, start_ns, form)
    return Imported(
        path, mode, columns, start_ns, {n: int(np.isfinite(c).sum()) for n, c in columns.items()}, tuple(notices)
    )


def _opened(path: Path, mapping: Mapping) -> Bag | Table:
    kind = Bag if is_bag(path) else WpiLog if is_wpilog(path) else Table
    return kind(path, mapping)


def _check_wheels(file: Bag | Table, mapping: Mapping, robot: Robot, signals: dict[str, Series]) -> None:
    """Whether a wheel's speed or angle is measured.

    Raises
    ------
    InputError : none is; says what the recording lacks.
    """
    if any(f"{kind}_{s}" in signals for kind in ("w", "th") for s in robot.sides):
        return
    lacking = "; ".join(
        dict.fromkeys(
            file.wanting(source)
            for kind in ("w", "th")
            for s in robot.sides
            for source in mapping.signals.get(f"{kind}_{s}", ())
        )
    )
    raise InputError(
        f"{file.path}: no measured wheel speed or angle (w_*, th_*): {lacking or str(mapping.path) + ' maps none'}"
    )


def _columns(signals: dict[str, Series], commands: list[str], start_ns: int, form: str) -> dict[str, np.ndarray]:
    """The log's columns, NaN where a row has no sample of one."""
    t_ns = np.unique(np.concatenate([series.t_ns for series in signals.values()]))
    longest = (t_ns[-1] - t_ns[0]) / NS
    # A csv's nine digits hold microseconds up to 1000 s, ten of them up to 10000 s.
    grid = 1 if form == "parquet" else 1000 if longest < 999.0 else 10_000 if longest < 9999.0 else 100_000
    ticks = np.unique((t_ns - start_ns + grid // 2) // grid)
    columns = {"t": ticks * (grid / NS)}
    for name in (*commands, *(n for n in QUANTITY if n not in commands)):
        if name not in signals:
            continue
        series = signals[name]
        column = np.full(len(ticks), math.nan)
        column[np.searchsorted(ticks, (series.t_ns - start_ns + grid // 2) // grid)] = series.values
        columns[name] = column
    return columns


def _clock(file: Bag | Table, mapping: Mapping) -> list[str]:
    """What speaks against the declared unit of a table's time (those of bags and data logs have none to declare)."""
    if isinstance(file, Bag | WpiLog):
        return []
    times = np.unique(file.t_ns) / NS
    step = float(np.median(np.diff(times)))
    # Whether a row a second is a staircase of settled speeds, a diagnosis tells by the wheels.
    if is_rate(step) or is_staircase(times):
        return []
    raw = step / FIXED["time"][mapping.time_unit]
    fitting = [unit for unit, seconds in FIXED["time"].items() if is_rate(raw * seconds)]
    return [
        f"{mapping.time_column} in {mapping.time_unit} is a row every {step:.3g} s: "
        + (f"is it in {fitting[0]}?" if fitting else "no robot's log has such a rate")
    ]


def _signals(file: Bag | Table, mapping: Mapping, robot: Robot, notices: list[str]) -> dict[str, Series]:
    """The first source of each channel that is there and holds samples, in SI units at the time of reading."""
    signals: dict[str, Series] = {}
    for channel, sources in mapping.signals.items():
        if channel.endswith("_r") and "r" not in robot.sides:
            continue
        there = [source for source in sources if file.available(source)]
        if not there:
            if not channel.startswith(("v_cmd", "w_cmd", "w_ref")):
                notices.append(
                    f"{file.path.name}: {channel} is left out, "
                    f"{' and '.join(dict.fromkeys(file.wanting(s) for s in sources))}"
                )
            continue
        for n, source in enumerate(there):
            rest = there[n + 1 :]
            damage = file.broken.get(source.topic or "") if isinstance(file, Bag) else None
            if rest and damage is not None:
                notices.append(f"{damage}; {channel} is taken from {rest[0].topic}")
                continue
            raw = file.series(source)
            if len(raw) < 2:
                notices.append(
                    f"{raw.origin}: {source.field or channel} holds {'one sample' if len(raw) else 'nothing'}"
                    + (
                        f", {channel} is taken from {rest[0].topic or rest[0].column}"
                        if rest
                        else f", {channel} is left out"
                    )
                )
                continue
            signals[channel] = _convert(raw, source, robot, notices)
            break
    for a, b in (("v_cmd_l", "v_cmd_r"), ("w_cmd_l", "w_cmd_r")):
        if a in signals and b in signals:
            same = {s.where for s in mapping.signals[a]} & {s.where for s in mapping.signals[b]} - {None}
            if same:
                source = next(s for s in mapping.signals[a] if s.where in same)
                notices.append(
                    f"{file.path.name}: {a} and {b} are the same {source.named}: both wheels are commanded alike"
                )
    return signals


def _unwrapped(raw: Series, source: Source, notices: list[str]) -> np.ndarray:
    """Raw numbers without the jumps where they start again.

    Raises
    ------
    InputError : numbers that wrap at `wraps_at` lie within one round of it; these do not.
    """
    values = raw.values
    span = float(np.ptp(values))
    if source.wraps_at is not None:
        # A counter that wraps at 4096 shows 0 to 4095; a rounded heading may show 360 next to 0.
        if span > source.wraps_at * (1.0 + 1e-3):
            raise InputError(
                f"{source.place}: wraps_at is {source.wraps_at:g}, but {raw.origin} spans {span:.6g}, from "
                f"{float(values.min()):.6g} to {float(values.max()):.6g}: it wraps elsewhere"
            )
        return np.unwrap(values, period=source.wraps_at)
    steps = np.abs(np.diff(values))
    jumps = np.flatnonzero(steps > JUMP * span)
    if QUANTITY[source.channel] in ("angle", "heading") and jumps.size and float(np.median(steps)) < SMALL * span:
        notices.append(
            f"{raw.origin}: jumps {jumps.size} time(s) by nearly its whole range ({span:.6g}): if it wraps "
            f"there, say so in {source.place} (wraps_at)"
        )
    return values


def _convert(raw: Series, source: Source, robot: Robot, notices: list[str]) -> Series:
    quantity = QUANTITY[source.channel]
    place = source.place
    values = raw.values
    if source.pair is not None:
        radius, track = _geometry(source, robot)
        sign = -0.5 if source.channel.endswith("_l") else 0.5
        values = (values[:, 0] + sign * values[:, 1] * track) / radius
        gain = 1.0
    else:
        quaternion = source.channel == "yaw" and source.unit is None and source.wraps_at is None
        values = np.unwrap(values) if quaternion else _unwrapped(raw, source, notices)
        gain = factor(
            place,
            quantity,
            source.unit or next(iter(FIXED[quantity])),
            robot,
            source.full_scale,
            source.counts_per_rev,
            source.wheel_radius_m,
            source.shaft,
        )
    values = (values * source.scale + source.offset) * gain
    series = replace(raw, values=-values if source.reverse else values)
    return series.earlier(source.delay_samples, source.delay_s).last_of_equal_times()


def _geometry(source: Source | Twist, robot: Robot) -> tuple[float, float]:
    if robot.chassis is None:
        raise InputError(f"{source.place}: a twist has no meaning for a single axis")
    return (source.wheel_radius_m or robot.chassis.wheel_radius_m, source.track_width_m or robot.chassis.track_width_m)


def wheel_speeds(twist: Twist, robot: Robot, linear: np.ndarray, angular: np.ndarray) -> np.ndarray:
    """Wheel speeds (n, 2) rad/s that the firmware asks of its servos for a twist, `linear` m/s, `angular` rad/s."""

    def cut(values: np.ndarray, step: float) -> np.ndarray:
        # As in C: multiply, drop the fraction. 0.29 * 100 is 28.999..., so 0.28 goes out, on the robot and here.
        return np.trunc(values * (1.0 / step)) * step if step else values

    linear = np.clip(cut(linear, twist.cut), -twist.linear_limit, twist.linear_limit)
    angular = np.clip(cut(angular, twist.cut), -twist.angular_limit, twist.angular_limit)
    radius, track = _geometry(twist, robot)
    wheels = np.column_stack([linear - angular * track / 2.0, linear + angular * track / 2.0]) / radius
    return np.clip(cut(wheels, twist.wheel_cut_rad_s), -twist.wheel_limit_rad_s, twist.wheel_limit_rad_s)


def _commands(file: Bag | Table, mapping: Mapping, robot: Robot, signals: dict[str, Series], notices: list[str]) -> str:
    """Decide the mode and leave its commands in `signals`; names what is missing where there are none."""
    voltages = [f"v_cmd_{s}" for s in robot.sides]
    speeds = [f"w_cmd_{s}" for s in robot.sides]
    twist = mapping.twist
    if not any(name in signals for name in speeds) and twist is not None and file.available(twist):
        raw = file.series(twist)
        if len(raw):
            linear = raw.values[:, 0] * {"m/s": 1.0, "mm/s": 1e-3}[twist.linear_unit]
            wheels = wheel_speeds(twist, robot, linear, raw.values[:, 1] * FIXED["rate"][twist.angular_unit])
            for name, values in zip(speeds, wheels.T):
                signals[name] = replace(raw, values=values).last_of_equal_times()
            track = _geometry(twist, robot)[1]
            if abs(track / robot.wheeled.track_width_m - 1.0) > 0.05:
                notices.append(
                    f"{file.path.name}: {twist.topic or 'twist'} became wheel speeds with the mapping's track "
                    f"of {track:g} m, the nominal robot's is {robot.wheeled.track_width_m:g} m"
                )
    for names in (voltages, speeds):
        missing = [name for name in names if name not in signals]
        if missing and len(missing) < len(names):
            raise InputError(
                f"{file.path}: {missing[0]} is missing while {names[1 - names.index(missing[0])]} is there"
            )
    if all(name in signals for name in voltages):
        for name in speeds:
            if name in signals:
                signals.setdefault(name.replace("w_cmd", "w_ref"), signals[name])
                del signals[name]
        return "torque" if robot.driver.mode == "torque" else "voltage"
    if all(name in signals for name in speeds):
        return "speed"
    lacking = [file.wanting(s) for name in (*voltages, *speeds) for s in mapping.signals.get(name, ())]
    if twist is not None:
        lacking.append(file.wanting(twist) if not file.available(twist) else f"{twist.topic or 'twist'} is empty")
    there = ""
    if isinstance(file, Bag):
        names = sorted(file.topics)
        there = f" (topics there: {', '.join(names[:12])}{', ...' if len(names) > 12 else ''})"
    raise InputError(
        f"{file.path}: no command signal: neither voltages ({', '.join(voltages)}) nor wheel speeds "
        f"({', '.join(speeds)}) can be had: {'; '.join(dict.fromkeys(lacking)) or 'none is mapped'}{there}"
    )


def _span(
    path: Path,
    signals: dict[str, Series],
    commands: list[str],
    mapping: Mapping,
    start_s: float,
    end_s: float,
    notices: list[str],
) -> tuple[dict[str, Series], int]:
    """Cut to the part that has commands and measurements; give the first row its commands."""
    measured = {n: s for n, s in signals.items() if n not in commands and not n.startswith("w_ref") and len(s)}
    first = min(s.t_ns[0] for s in (*measured.values(), *(signals[c] for c in commands)))
    last = max(s.t_ns[-1] for s in measured.values())
    low = first + round(start_s * NS)
    high = last if math.isinf(end_s) else min(last, first + round(end_s * NS))

    held: dict[str, Series] = {}
    for name in commands:
        series = signals[name]
        if math.isfinite(mapping.timeout_s):
            series = _with_timeout(series, round(mapping.timeout_s * NS))
        held[name] = series
    known = max(series.t_ns[0] for series in held.values())
    if known > low and mapping.before_first is not None:
        moving = []
        for name, series in measured.items():
            before = series.values[(series.t_ns >= low) & (series.t_ns < known)]
            if (
                name in ("w_l", "w_r")
                and np.abs(before).max(initial=0.0) > AT_REST_RAD_S
                or name in ("th_l", "th_r")
                and len(before)
                and np.ptp(before) > AT_REST_RAD
            ):
                moving.append(name)
        if not moving:
            for name, series in held.items():
                if series.t_ns[0] > low:
                    held[name] = replace(
                        series, t_ns=np.append(low, series.t_ns), values=np.append(mapping.before_first, series.values)
                    )
            known = low
        else:
            notices.append(
                f"{path.name}: {', '.join(moving)} moves before the first command, so "
                f"{(known - low) / NS:.3g} s are left out"
            )
    elif known > low and (known - low) / NS > 0.5:
        notices.append(f"{path.name}: {(known - low) / NS:.3g} s before the first command are left out")
    low = max(low, known)
    # The first row tells how the robot starts (speeds, angles), so it is a row that says so.
    wheel = next(measured[name] for name in ("w_l", "w_r", "th_l", "th_r") if name in measured)
    low = int(wheel.t_ns[min(np.searchsorted(wheel.t_ns, low), len(wheel) - 1)])
    if low >= high or low < known:
        raise InputError(
            f"{path}: commands and measurements do not overlap in time (commands from "
            f"{(known - first) / NS:.3g} s, measurements until {(last - first) / NS:.3g} s)"
        )

    result: dict[str, Series] = {}
    for name, series in {**signals, **held}.items():
        if name in commands:
            now = int(np.searchsorted(series.t_ns, low, side="right")) - 1
            inside = (series.t_ns > low) & (series.t_ns <= high)
            result[name] = replace(
                series,
                t_ns=np.append(low, series.t_ns[inside]),
                values=np.append(series.values[now], series.values[inside]),
            )
            continue
        kept = series.keep((series.t_ns >= low) & (series.t_ns <= high))
        if len(kept):
            result[name] = kept
        elif len(series) == 1:  # where the robot started, read before the first command
            result[name] = replace(series, t_ns=np.asarray([low]))
    if not any(name in result for name in ("w_l", "w_r", "th_l", "th_r")):
        raise InputError(f"{path}: no sample of a wheel's speed or angle lies between {start_s:g} and {end_s:g} s")
    return result, int(low)


def _with_timeout(series: Series, timeout_ns: int) -> Series:
    """Add the zero that a base puts in by itself when no command comes for `timeout_ns`."""
    following = np.append(series.t_ns[1:], np.iinfo(np.int64).max)
    late = following - series.t_ns > timeout_ns
    t_ns = np.concatenate([series.t_ns, series.t_ns[late] + timeout_ns])
    values = np.concatenate([series.values, np.zeros(int(late.sum()))])
    order = np.argsort(t_ns, kind="stable")
    return replace(series, t_ns=t_ns[order], values=values[order])
