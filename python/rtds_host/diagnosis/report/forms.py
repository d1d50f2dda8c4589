"""Unmodelled terms as free curves: each curve with its band, where the data lie, formula, and what to look for."""

from __future__ import annotations

import math
from html import escape
from typing import Any

import numpy as np

from rtds_host.diagnosis.effects import CATALOGUE
from rtds_host.diagnosis.report.details import Details
from rtds_host.diagnosis.report.html import section
from rtds_host.diagnosis.report.words import (
    AXIS_WORDS,
    OVER_WORDS,
    X_WORDS,
    form_name,
    listed_name,
    number,
    parameter_name,
    percent,
    value_name,
)
from rtds_host.diagnosis.thresholds import Z90
from rtds_host.plant import forms as plant

# Layout: the drawing, and its bars of data, in the drawing's own units.
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM, BARS = 440, 280, 62, 12, 12, 84, 34
BINS = 32
# Where nothing of the catalogue resembles it: where to look, by the term.
LOOK = {
    "voltage": "Measure the voltage at the motor's terminals at several values of it.",
    "torque": "Turn the wheel in the air at several values of it and watch the current.",
    "damping": "Turn the wheel in the air at several speeds and watch the current.",
    "torque_constant": "Hold the wheel and measure its torque at several currents.",
    "yaw_torque": "Turn the robot on the spot and on a curve and watch the currents.",
    "force": "Pull the robot along with a spring balance at several values of it.",
    "gyro_sensor": "Turn the robot by hand through whole turns and compare the integral of the yaw rate.",
    "current_sensor": "Put an ammeter in series with the motor at several values of it.",
    "speed_sensor": "Count the wheel's turns by hand over a minute at several values of it.",
}
# What changes with time or heat has to be looked at twice.
AGAIN = {
    "heat": "Do so cold, and again right after a loaded run.",
    "t": "Do so at the start of a run, and again at its end.",
}


def _history(volts: np.ndarray, most: float) -> np.ndarray:
    """Sizes of commands (n,) V, negative once they have fallen back; most : V, what they are clipped at."""
    rows, past, found = plant.no_forms()[0], np.zeros(plant.PAST), np.zeros(len(volts))
    over = plant.OVER_CODE["command_history"]
    rows[0, : plant.TAU] = plant.TERM_CODE["voltage"], over, -most, most
    for k, volt in enumerate(np.clip(volts, -most, most)):
        if np.isfinite(volt):
            plant.follow(rows, volt, past)
        found[k] = past[plant.DIRECTION] * abs(volt)
    return found


def _samples(form: dict[str, Any], details: Details) -> np.ndarray:
    """Measured values of what a form runs over, (n,) in its unit; empty where no channel holds them."""
    robot, over = details.case.robot, form["over"]
    sides = {"both": robot.sides, "left": ("l",), "right": ("r",)}[form["side"]]
    found: list[np.ndarray] = []
    for run in details.case.runs:
        columns = run.columns
        if over in ("v_cmd", "i", "w", "th", "wheel_angle", "motor_angle"):
            stem = "th" if over.endswith("angle") else over
            scale = robot.motor.gear_ratio if over == "motor_angle" else 1.0
            found += [scale * columns[f"{stem}_{s}"] for s in sides if f"{stem}_{s}" in columns]
        elif over == "command_history":
            found += [_history(columns[f"v_cmd_{s}"], robot.supply_v) for s in sides if f"v_cmd_{s}" in columns]
        elif over == "heat":
            amps = [columns[f"i_{s}"] for s in sides if f"i_{s}" in columns]
            found += [plant.heats(run.t, np.nan_to_num(one), form["time_constant"]) for one in amps]
        elif over == "yaw_rate" and "gyro_z" in columns:
            found.append(columns["gyro_z"])
        elif over in ("x", "y", "yaw") and over in columns:
            found.append(columns[over])
        elif over == "t":
            found.append(run.t - run.t[0])
    values = np.concatenate(found) if found else np.zeros(0)
    return values[np.isfinite(values)]


def density(form: dict[str, Any], details: Details) -> np.ndarray:
    """(BINS,) how many samples lie in each part of the curve's range; all zero where that cannot be known."""
    curve = np.asarray(form["curve"], dtype=float)
    low, high = curve[0, 0], curve[-1, 0]
    values = _samples(form, details)
    if form["over"] in plant.PERIODIC:
        values = low + np.mod(values - low, high - low)
    return np.histogram(values, BINS, (low, high))[0]


def _ticks(low: float, high: float, count: int) -> list[float]:
    raw = (high - low) / count or 1.0
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(k * power for k in (1, 2, 5, 10) if k * power >= raw)
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def _drawing(form: dict[str, Any], details: Details, name: str) -> str:
    """The curve as SVG: band, line, points, axes, and bars where data lie."""
    curve = np.asarray(form["curve"], dtype=float)
    x, y, error = curve.T
    low, high = float((y - Z90 * error).min()), float((y + Z90 * error).max())
    low, high = min(low, 0.0), max(high, 0.0)
    pad = 0.06 * (high - low) or 0.5
    low, high = low - pad, high + pad
    floor = HEIGHT - BOTTOM

    def px(v: float) -> float:
        return LEFT + (v - x[0]) / (x[-1] - x[0]) * (WIDTH - LEFT - RIGHT)

    def py(v: float) -> float:
        return TOP + (high - v) / (high - low) * (floor - TOP)

    def points(ys: np.ndarray, order: slice = slice(None)) -> str:
        return " ".join(f"{px(a):.1f},{py(b):.1f}" for a, b in zip(x[order], ys[order], strict=True))

    unit_x, unit_y = form["units"]
    over = AXIS_WORDS.get(form["over"], OVER_WORDS.get(form["over"], form["over"]))
    term = value_name(form)
    counts = density(form, details)
    parts = [
        f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{py(v):.1f}" y2="{py(v):.1f}"/>'
        f'<text x="{LEFT - 6}" y="{py(v) + 4:.1f}" text-anchor="end">{number(v)}</text>'
        for v in _ticks(low, high, 5)
    ]
    bottom = floor + BARS
    parts += [
        f'<line class="grid" x1="{px(v):.1f}" x2="{px(v):.1f}" y1="{TOP}" y2="{bottom}"/>'
        f'<text x="{px(v):.1f}" y="{bottom + 16}" text-anchor="middle">{number(v)}</text>'
        for v in _ticks(float(x[0]), float(x[-1]), 6)
    ]
    width = (WIDTH - LEFT - RIGHT) / BINS
    parts += [
        f'<rect class="data" x="{LEFT + k * width:.1f}" y="{bottom - (BARS - 4) * n / counts.max():.1f}" '
        f'width="{width - 0.8:.1f}" height="{(BARS - 4) * n / counts.max():.1f}"/>'
        for k, n in enumerate(counts)
        if n
    ]
    parts += [
        f'<polygon class="band" points="{points(y + Z90 * error)} {points(y - Z90 * error, slice(None, None, -1))}"/>',
        f'<line class="zero" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{py(0):.1f}" y2="{py(0):.1f}"/>',
        f'<polyline class="curve" points="{points(y)}"/>',
        *(
            f'<circle class="curve" cx="{px(a):.1f}" cy="{py(b):.1f}" r="2.4"><title>{number(a)} {escape(unit_x)}: '
            f"{number(b)} ± {number(Z90 * e)} {escape(unit_y)}</title></circle>"
            for a, b, e in curve
        ),
        f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 12}" text-anchor="middle">{escape(over)} '
        f"[{escape(unit_x)}]</text>",
        f'<text transform="translate(14 {(TOP + floor) / 2}) rotate(-90)" text-anchor="middle">{escape(term)} '
        f"[{escape(unit_y)}]</text>",
    ]
    said = (
        f"{form_name(form)}: from {number(y[0])} at {number(x[0])} to {number(y[-1])} {unit_y} at {number(x[-1])} "
        f"{unit_x}; "
        f"smallest {number(y.min())}, largest {number(y.max())}"
    )
    return (
        f'<svg class="form" id="{name}" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(said)}">'
        + "".join(parts)
        + "</svg>"
    )


def _by_hand(form: dict[str, Any]) -> str:
    again = AGAIN.get(form["over"], "")
    # Their checks by hand show what is behind the form, too.
    alike = [name for name, effect in CATALOGUE.items() if (form["term"], form["over"]) in effect.resembles]
    if alike:
        checks = "".join(
            f"<li>{escape(listed_name({'id': name, 'side': form['side']}))}: {escape(CATALOGUE[name].check)}</li>"
            for name in alike
        )
        return f"<p>Look by hand for what resembles it:</p><ul>{checks}</ul>" + (f"<p>{again}</p>" if again else "")
    return f"<p>{escape(LOOK[form['term']])} {again}</p>" if form["term"] in LOOK else ""


def _one(form: dict[str, Any], details: Details, k: int) -> str:
    title = form_name(form)
    formula = form["formula"]
    rows = "".join(
        f"<li>{escape(parameter_name(name))} = {number(p['value'], 4)}"
        + (f" ({number(p['ci90'][0], 4)} to {number(p['ci90'][1], 4)}, 90 %)" if p["ci90"] else " (not determined)")
        + "</li>"
        for name, p in form["parameters"].items()
    )
    said = (
        f'<p>Formula: <span class="formula">{escape(formula)}</span>, where x is the '
        f"{escape(X_WORDS.get(form['over'], OVER_WORDS.get(form['over'], form['over'])))}</p>"
        + (f"<ul>{rows}</ul>" if rows else "")
        if formula
        else "<p>No simple formula describes this curve; simulators take it as a table.</p>"
    )
    if form["over"] == "heat":
        said = f"<p>The heat's time constant is {number(form['time_constant'])} s.</p>{said}"
    known = density(form, details).any()
    below = "bars below: how much of the data lies there" if known else "no channel holds what it runs over"
    return (
        f'<figure class="shape"><figcaption><h3>{escape(title[:1].upper() + title[1:])}</h3></figcaption>'
        + _drawing(form, details, f"form-{k}")
        + f'<p class="small soft">Line: the curve; band: 90 % of what these runs allow; {below}.</p>'
        + f"<p>On runs left out it closes {percent(form['closes'])} of what the effects leave.</p>"
        + said
        + _by_hand(form)
        + "</figure>"
    )


def shapes(diagnosis: dict[str, Any], details: Details) -> str:
    """The section on forms, "" where the diagnosis has none."""
    forms = diagnosis.get("forms") or []
    if not forms:
        return ""
    gap = diagnosis["gap"].get("with_forms")
    note = (
        f"<p>With effects and free curves the gap is {number(gap)} times the sensors' noise.</p>"
        if gap is not None
        else ""
    )
    lead = (
        "<p>These terms are missing in the model's equations. No effect of the catalogue makes them as well. "
        "The simulator can run them like any effect.</p>"
    )
    body = lead + note + "".join(_one(form, details, k) for k, form in enumerate(forms))
    return section("forms", "Unmodelled terms as free curves", body)
