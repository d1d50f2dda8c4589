"""Pictures of runs and diagnoses for notebooks and scripts, each a function that returns matplotlib's axes.

    from rtds_host import plots

    plots.channel(run, "w_l", replays={"nominal": rtds_host.predict(run, robot)})

Axes that are given are drawn into; without them a new figure is made by pyplot, in whatever way it shows figures here.
Colours are those of the report: measured dots are dark, the nominal replay orange, the corrected one blue.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rtds_host.errors import InputError, did_you_mean, shown, visible
from rtds_host.figures import name_ticks

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rtds_host.contract import RunLog
    from rtds_host.run.session import Outcome

__all__ = ["channel", "gap", "panels", "path", "shares", "sizes"]

MEASURED, OTHERS = "#222222", ("#c8501e", "#1f5fa8", "#3f7d3a", "#7a4fa3")
UNITS = {"v": "V", "i": "A", "w": "rad/s", "g": "rad/s", "t": "rad", "y": "rad", "x": "m"}

Columns = Mapping[str, np.ndarray]


def path(run: RunLog | Outcome, *, replays: Mapping[str, Columns] | None = None, ax: Axes | None = None) -> Axes:
    """The way over the floor: measured, and as replayed.

    Parameters
    ----------
    run : a run of a case, or what `rtds_host.run` gives.
    replays : name -> channels as `rtds_host.predict` gives them, drawn as lines below the measured dots.
    ax : axes to draw into.

    Returns
    -------
    The axes; x and y in m, to one scale.

    Raises
    ------
    InputError : neither the run nor a replay has a pose.
    """
    columns = _columns(run)
    lines = {name: one for name, one in (replays or {}).items() if {"x", "y"} <= set(one)}
    if not lines and not _has(columns, "x", "y"):
        raise InputError("no path: the run has no pose (x, y), and no replay of it is given")
    axes = _axes(ax)
    for (name, one), colour in zip(lines.items(), itertools.cycle(OTHERS), strict=False):
        axes.plot(one["x"], one["y"], color=colour, label=visible(name))
    if _has(columns, "x", "y"):
        axes.plot(columns["x"], columns["y"], ".", color=MEASURED, markersize=2.0, zorder=3, label="measured")
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(frameon=False)
    return axes


def channel(
    run: RunLog | Outcome, name: str, *, replays: Mapping[str, Columns] | None = None, ax: Axes | None = None
) -> Axes:
    """A channel over time: measured as dots, replays as lines below them.

    Parameters
    ----------
    run, replays, ax : as of `path`. name : a channel of the log format ("w_l", "i_r", "gyro_z", "yaw", ...).

    Returns
    -------
    The axes; time in s, the channel in its SI unit.

    Raises
    ------
    InputError : neither the run nor a replay has the channel.
    """
    columns = _columns(run)
    lines = {title: one for title, one in (replays or {}).items() if name in one}
    if not lines and not _has(columns, name):
        known = sorted(set(columns) | {key for one in (replays or {}).values() for key in one})
        raise InputError(f"channel {shown(name)}: the run has no sample of it{did_you_mean(name, known)}")
    axes = _axes(ax)
    for (title, one), colour in zip(lines.items(), itertools.cycle(OTHERS), strict=False):
        axes.plot(one["t"], one[name], color=colour, label=visible(title))
    if _has(columns, name):
        axes.plot(columns["t"], columns[name], ".", color=MEASURED, markersize=2.0, zorder=3, label="measured")
    axes.set(xlabel="t (s)", ylabel=f"{name} ({UNITS.get(name[:1], '')})")
    axes.legend(frameon=False)
    return axes


def panels(outcome: Outcome) -> np.ndarray:
    """The paper's six panels of a drive: path, speeds, currents, pose, speed errors, loads and voltages.

    Returns
    -------
    (2, 3) axes of a new figure.
    """
    import matplotlib.pyplot as plt

    from rtds_host.run.figure import SIZE_IN, STYLE, fill

    with plt.rc_context(STYLE):
        _, axes = plt.subplots(2, 3, figsize=SIZE_IN, layout="constrained")
        fill(axes, outcome.plan, outcome.record)
    return axes


def gap(diagnosis: Mapping[str, Any], *, ax: Axes | None = None) -> Axes:
    """The gap as it is, with motor values refitted, and with the effects, as bars; the line at 1 is noise alone.

    Parameters
    ----------
    diagnosis : content of a `diagnosis.json`. ax : axes to draw into.
    """
    axes = _axes(ax)
    said = [(label, diagnosis["gap"].get(key)) for key, label in _GAPS.items()]
    found = [(label, float(value)) for label, value in said if value is not None]
    axes.bar(range(len(found)), [value for _, value in found], 0.6, color=OTHERS[: len(found)])
    for k, (_, value) in enumerate(found):
        axes.annotate(f"{value:.3g}", (k, value), ha="center", va="bottom")
    axes.axhline(1.0, color=MEASURED, linewidth=0.8, linestyle="--")
    name_ticks(axes.xaxis, [label for label, _ in found])
    axes.set(ylabel="gap (units of noise)")
    return axes


_GAPS = {"before": "nominal", "refit": "values refitted", "after": "with effects"}


def shares(diagnosis: Mapping[str, Any], *, ax: Axes | None = None) -> Axes:
    """What the gap is made of (`budget` of a `diagnosis.json`), as bars from the largest down, in percent.

    Parameters
    ----------
    diagnosis : content of a `diagnosis.json` of the present schema. ax : axes to draw into.
    """
    from rtds_host.diagnosis.report.words import budget_words

    entries = sorted(budget_words(dict(diagnosis)), key=lambda entry: entry[1])
    axes = _axes(ax)
    axes.barh(range(len(entries)), [100.0 * share for _, share in entries], 0.6, color=OTHERS[1])
    name_ticks(axes.yaxis, [words for words, _ in entries])
    axes.set(xlabel="share of the gap (%)")
    return axes


def sizes(
    diagnoses: Mapping[str, Mapping[str, Any]],
    effect: str,
    parameter: str,
    *,
    side: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """One size over many cases in their order, with its 90 % intervals: what drifts from day to day.

    Parameters
    ----------
    diagnoses : name of a case -> content of its `diagnosis.json`. effect, parameter : as `rtds effects` has them.
    side : "left", "right" or "both"; None takes whatever side a case names. ax : axes to draw into.

    Returns
    -------
    The axes; cases that do not name the effect have no dot.

    Raises
    ------
    InputError : the catalogue has no such effect, or the effect no such parameter.
    """
    from rtds_host.diagnosis.effects import CATALOGUE
    from rtds_host.diagnosis.report.words import effect_name, parameter_name, unit_of

    if effect not in CATALOGUE:
        raise InputError(f"effect {shown(effect)}: not in the catalogue{did_you_mean(effect, CATALOGUE)}")
    known = [one.name for one in CATALOGUE[effect].parameters]
    if parameter not in known:
        raise InputError(f"effect {effect}: has no parameter {shown(parameter)} (known: {', '.join(known)})")
    axes = _axes(ax)
    drawn: dict[str, list[tuple[int, float, Sequence[float] | None]]] = {}
    for k, content in enumerate(diagnoses.values()):
        for one in content.get("effects", ()):
            if one["id"] == effect and side in (None, one["side"]):
                value = one["parameters"][parameter]
                drawn.setdefault(one["side"], []).append((k, value["value"], value["ci90"]))
    for (of_side, points), colour in zip(sorted(drawn.items()), itertools.cycle(OTHERS), strict=False):
        for k, _, ends in points:
            if ends is not None:
                axes.vlines(k, ends[0], ends[1], color=colour)
        axes.plot([k for k, _, _ in points], [v for _, v, _ in points], "o", color=colour, label=of_side)
    if drawn:
        axes.legend(frameon=False)
    name_ticks(axes.xaxis, list(diagnoses), rotation=45, ha="right")
    unit = unit_of(effect, parameter)
    title = f"{effect_name({'id': effect, 'side': side or 'both'})}: {parameter_name(parameter)}"
    axes.set(ylabel=visible(title) + (f" ({unit})" if unit else ""), xlim=(-0.5, len(diagnoses) - 0.5))
    return axes


def _axes(given: Axes | None) -> Axes:
    if given is not None:
        return given
    import matplotlib.pyplot as plt

    return plt.subplots(figsize=(6.4, 3.4), layout="constrained")[1]


def _has(columns: Columns, *names: str) -> bool:
    return all(name in columns and bool(np.isfinite(columns[name]).any()) for name in names)


def _columns(run: RunLog | Outcome) -> Columns:
    """Channels of a run by name, `t` among them."""
    from rtds_host.contract import RunLog

    if isinstance(run, RunLog):
        return {"t": run.t, **run.columns}
    from rtds_host.run.log import log_columns

    return log_columns(run.record)
