"""Measured against replay: what the page's script draws, and its controls."""

from __future__ import annotations

import itertools
import math
from html import escape
from typing import Any

import numpy as np

from rtds_host.diagnosis.report.details import Details, Trace
from rtds_host.diagnosis.report.html import embedded, section
from rtds_host.diagnosis.report.words import channel_name, number

# Layout: points a line keeps: two a bucket, so that peaks survive.
BUCKETS = 450
# Layout: more than a screen shows of a line.
DIGITS = 6
# Layout: decimals of a time, s: finer than any log's rows.
TIME_DECIMALS = 6
UNITS = {"v_bus": "V", "i": "A", "w": "rad/s", "th": "rad", "gyro_z": "rad/s", "x": "m", "y": "m", "yaw": "rad"}


def unit_of_channel(channel: str) -> str:
    """Unit of a channel of the contract, "" for another name."""
    return UNITS.get(channel, UNITS.get(channel[:-2], ""))


def _buckets(values: np.ndarray) -> np.ndarray:
    """Rows that keep a line's peaks: of each bucket where the signal is smallest and largest."""
    good = np.flatnonzero(np.isfinite(values))
    if len(good) == 0:
        good = np.arange(len(values))
    if len(good) <= 2 * BUCKETS:
        return good
    keep = []
    for a, b in itertools.pairwise(np.linspace(0, len(good), BUCKETS + 1).astype(int)):
        rows = good[a:b]
        keep += [rows[values[rows].argmin()], rows[values[rows].argmax()]]
    return np.unique(keep)


def _plain(values: np.ndarray) -> list[float | None]:
    """To so many digits of the line's largest: what a plot can show, also zoomed in."""
    finite = np.isfinite(values)
    largest = np.abs(values[finite]).max(initial=1e-300)
    # A zero has no sign: that of what is rounded away may depend on the number of threads.
    rounded = np.round(values, DIGITS - 1 - math.floor(math.log10(largest)) if largest > 1e-300 else 0) + 0.0
    return [v if ok else None for v, ok in zip(rounded.tolist(), finite.tolist(), strict=True)]


def _times(trace: Trace, rows: np.ndarray) -> list[float]:
    # From the run's start: a log's clock may be a Unix time, of which so many digits would be one and the same.
    return np.round(trace.t[rows] - trace.t[0], TIME_DECIMALS).tolist()


def _lines(trace: Trace, included: bool) -> dict[str, np.ndarray]:
    names = ("nominal", "refit", "after") if included else ("nominal", "refit")
    found = {name: getattr(trace, name) for name in names}
    return {
        "measured": trace.measured,
        **{name: np.asarray(line) for name, line in found.items() if line is not None},
    }


def decimated(trace: Trace, unit: str, noise: float | None, included: bool) -> dict[str, Any]:
    """A trace with at most two samples a bucket, as the script takes it."""
    rows = _buckets(trace.measured)
    lines = {name: _plain(values[rows]) for name, values in _lines(trace, included).items()}
    return {"unit": unit, "noise": noise, "t": _times(trace, rows), **lines}


def path_of(channels: dict[str, Trace], included: bool) -> dict[str, Any] | None:
    """The way over the floor: times and, of each line, x and y at the same rows; None without a pose."""
    if "x" not in channels or "y" not in channels or len(channels["x"].t) != len(channels["y"].t):
        return None
    x, y = channels["x"], channels["y"]
    both = np.where(np.isfinite(y.measured), x.measured, np.nan)
    if not np.isfinite(both).any():
        return None
    rows = np.unique(np.concatenate([_buckets(both), _buckets(np.where(np.isfinite(both), y.measured, np.nan))]))
    ways = {name: values for name, values in _lines(x, included).items() if name in _lines(y, included)}
    of_y = _lines(y, included)
    return {
        "t": _times(x, rows),
        "x": {name: _plain(values[rows]) for name, values in ways.items()},
        "y": {name: _plain(of_y[name][rows]) for name in ways},
    }


def why_not_counted(channel: str, details: Details) -> str:
    """Why a channel does not count in the gap, "" where it does (contract, section 4)."""
    robot = details.case.robot
    if channel == "v_bus":
        return "does not count in the gap: the bus voltage never does"
    if robot.noise(channel) is None:
        return "does not count in the gap: [sensors] names no noise for it"
    if channel.startswith("th_"):
        speed = f"w_{channel[3:]}"
        if any(run.has(speed) for run in details.case.runs) and robot.noise(speed) is not None:
            return f"does not count in the gap: the speed of this wheel ({speed}) does"
    return ""


def misfit(diagnosis: dict[str, Any], channel: str) -> float:
    """The gap of a channel that the best replay here leaves, -1 where it has none."""
    entry = (diagnosis["gap"].get("channels") or {}).get(channel) or {}
    value = entry.get("after" if diagnosis["effects"] else "refit")
    return -1.0 if value is None else value


def _note(diagnosis: dict[str, Any], channel: str, details: Details) -> str:
    if why := why_not_counted(channel, details):
        return why
    entry = (diagnosis["gap"].get("channels") or {}).get(channel)
    if entry is None:
        return ""
    words = [("before", "nominal"), ("refit", "refitted")] + (
        [("after", "with effects")] if diagnosis["effects"] else []
    )
    return "gap " + ", ".join(f"{number(entry.get(key))} {name}" for key, name in words)


CONTROLS = (
    '<div class="controls"><label>run <select id="run"></select></label><span id="keys"></span></div>'
    '<div class="controls" role="group" aria-label="time shown">'
    '<button id="earlier" type="button" aria-label="earlier">←</button>'
    '<button id="later" type="button" aria-label="later">→</button>'
    '<button id="closer" type="button" aria-label="zoom in">+</button>'
    '<button id="farther" type="button" aria-label="zoom out">−</button>'
    '<button id="reset" type="button">whole run</button>'
    '<span class="soft small">Drag over a plot to zoom, Ctrl and wheel or two fingers too; double click for the '
    "whole run. "
    "Keys on a plot: arrows read, + and − zoom, 0 for the whole run.</span></div>"
    '<p id="readout" role="status" class="small" aria-live="polite"></p>'
)


def plots(diagnosis: dict[str, Any], details: Details) -> str:
    """The section with the plots, "" where there are no traces. Channels stand in order of misfit."""
    included, noise = bool(diagnosis["effects"]), details.case.robot.noise
    data, paths, names = {}, {}, {}
    for run, channels in details.traces.items():
        if not channels:
            continue
        order = sorted(channels, key=lambda c: -misfit(diagnosis, c))
        data[run] = {c: decimated(channels[c], unit_of_channel(c), noise(c), included) for c in order}
        path = path_of(channels, included)
        if path is not None:
            paths[run] = path
        names.update({c: {"name": channel_name(c), "note": _note(diagnosis, c, details)} for c in order})
    if not data:
        return ""
    body = (
        CONTROLS + '<p class="soft small">Dots: measured. Lines: replays. Below: what a replay misses, measured '
        "minus replay; the band is what the sensor's noise alone hardly ever leaves (3 sigma). Times count from the "
        "run's start. The list of runs at the end gives that time on the log's own clock.</p>"
        f'<div id="plots" data-top="{escape(next(iter(data[next(iter(data))])))}"></div>'
    )
    return section(
        "signals",
        "Measured against replay",
        body + embedded("traces", data) + embedded("paths", {"paths": paths, "channels": names}),
    )
