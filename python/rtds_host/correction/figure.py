"""The figure of `rtds close`: measured, nominal and corrected, and what each misses."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from rtds_host.contract import Case
from rtds_host.diagnosis import gap as gaps
from rtds_host.figures import STYLE, caption, save
from rtds_host.plant.schema import OUTPUT_INDEX

if TYPE_CHECKING:
    from rtds_host.correction.result import Result, Run

MEASURED, NOMINAL, CORRECTED = "#222222", "#c8501e", "#1f5fa8"
UNITS = {"i": ("current", "mA", 1e3), "w": ("wheel speed", "rad/s", 1.0), "g": ("yaw rate", "rad/s", 1.0)}
ROWS = 4


def _worst(case: Case, runs: list[Run]) -> Run:
    """The run with the largest gap before."""
    return max(runs, key=lambda r: gaps.gap(gaps.pooled([gaps.errors(r.log, case.robot, r.simulated["before"])])))


def draw(case: Case, result: Result, path: Path) -> None:
    """Write the figure: on the left the channels with the largest gap, on the right their errors in units of noise."""
    run = _worst(case, result.runs)
    before, after = (gaps.errors_at(run.log, case.robot, run.simulated[name]) for name in ("before", "after"))
    sizes = {c: float(np.sqrt(np.mean(e**2))) for c, (_, e) in before.items() if c in gaps.SAMPLED and len(e)}
    shown = sorted(sorted(sizes, key=lambda c: -sizes[c])[: ROWS - 1], key=gaps.SAMPLED.index)
    with rc_context(STYLE):
        # Without pyplot: a notebook keeps its own way to show figures.
        figure = Figure(figsize=(11.0, 2.0 * (len(shown) + 1)), layout="constrained")
        axes = figure.subplots(len(shown) + 1, 2, squeeze=False)
        t = run.log.t
        for (left, right), channel in zip(axes, shown):
            title, unit, scale = UNITS[channel[0]]
            side = {"_l": ", left", "_r": ", right"}.get(channel[-2:], "")
            values = run.log.columns[channel]
            good = np.isfinite(values)
            left.plot(t[good], scale * values[good], ".", color=MEASURED, markersize=1.5, label="measured")
            for name, colour, text in (("before", NOMINAL, "nominal"), ("after", CORRECTED, "corrected")):
                left.plot(t, scale * run.simulated[name][:, OUTPUT_INDEX[channel]], color=colour, label=text)
            left.set(title=f"{title}{side}", ylabel=unit)
            for errors, colour in ((before, NOMINAL), (after, CORRECTED)):
                rows, error = errors[channel]
                right.plot(t[rows], error, color=colour, linewidth=0.6, label=f"rms {np.sqrt(np.mean(error**2)):.3g}")
            right.set(title=f"{title}{side}: simulated less measured", ylabel="units of noise")
            right.legend(loc="upper right", ncols=2)
            left.legend(loc="upper right", ncols=3)
        _path(axes[-1, 0], run)
        _bars(axes[-1, 1], result)
        effects = ", ".join(f"{e['id']} ({e['side']})" for e in result.content["effects"]) or "no effect"
        sim = result.content["simulator"]
        caption(
            figure, f"{case.name}, run {run.log.name}: {effects}; motors in {sim['link']}, robot in {sim['engine']}"
        )
        save(figure, path, dpi=130, metadata={"Software": None})


def _path(axis, run: Run) -> None:
    if run.log.has("x") and run.log.has("y"):
        axis.plot(run.log.columns["x"], run.log.columns["y"], ".", color=MEASURED, markersize=1.5, label="measured")
    for name, colour, text in (("before", NOMINAL, "nominal"), ("after", CORRECTED, "corrected")):
        axis.plot(run.simulated[name][:, 8], run.simulated[name][:, 9], color=colour, label=text)
    axis.set(title="path", xlabel="x (m)", ylabel="y (m)")
    axis.set_aspect("equal", adjustable="datalim")
    axis.legend(loc="best")


def _bars(axis, result: Result) -> None:
    gap = result.content["gap"]
    names = list(gap["channels"])
    x = np.arange(len(names) + 1)
    for shift, which, colour in ((-0.2, "before", NOMINAL), (0.2, "after", CORRECTED)):
        heights = [gap["simulator"][which]] + [gap["channels"][c][f"simulator_{which}"] for c in names]
        replays = [gap["replay"][which]] + [gap["channels"][c][f"replay_{which}"] for c in names]
        axis.bar(x + shift, heights, 0.38, color=colour, label="nominal" if which == "before" else "corrected")
        axis.plot(x + shift, replays, "_", color=MEASURED, markersize=9, label="replay" if shift > 0 else None)
    axis.axhline(1.0, color=MEASURED, linewidth=0.6, linestyle="--")
    axis.set_yscale("log")
    axis.set_xticks(x, ["all", *names])
    axis.set(title="gap in the simulator, channel by channel (1 = noise alone)")
    axis.legend(loc="best")
