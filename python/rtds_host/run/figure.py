"""The paper's figure of a run: six panels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from rtds_host.figures import STYLE, caption, save
from rtds_host.run.loop import Record
from rtds_host.run.plan import Plan

LEFT, RIGHT, PLAIN = "#1f5fa8", "#c8501e", "#444444"
SIZE_IN = (12.0, 6.6)


def draw(plan: Plan, record: Record, folder: Path) -> list[Path]:
    """Write `figure.png` and `figure.pdf` into `folder`; returns their paths.

    Panels: (a) path, (b) speed references and simulated speeds, (c) armature currents, (d) x, y and yaw over time,
    (e) speed errors, (f) load torques and supply voltages.
    """
    with rc_context(STYLE):
        # Without pyplot: a notebook keeps its own way to show figures.
        figure = Figure(figsize=SIZE_IN, layout="constrained")
        fill(figure.subplots(2, 3), plan, record)
        paths = [folder / "figure.png", folder / "figure.pdf"]
        save(figure, paths[0], dpi=130, metadata={"Software": None})
        save(figure, paths[1], metadata={"CreationDate": None})
    return paths


def fill(axes: np.ndarray, plan: Plan, record: Record) -> None:
    """Draw the six panels into (2, 3) axes of one figure, and its caption."""
    _path(axes[0, 0], record)
    _speeds(axes[0, 1], record)
    _pair(axes[0, 2], record.t_s, 1e3 * record.currents, "(c) armature currents", "current (mA)")
    axes[0, 2].axhline(0.0, color=PLAIN, linewidth=0.6)
    _pose(axes[1, 0], record)
    _errors(axes[1, 1], record)
    _loads(axes[1, 2], plan, record)
    caption(
        axes[0, 0].figure,
        f"{plan.scenario.name}: {plan.robot.name}, payload {plan.body.payload_kg:g} kg, slope "
        f"{plan.body.slope_rad:g} rad, {plan.controller or 'voltages given'}",
    )


def _pair(axis, t: np.ndarray, values: np.ndarray, title: str, label: str, style: str = "-") -> None:
    axis.plot(t, values[:, 0], style, color=LEFT, label="left")
    axis.plot(t, values[:, 1], style, color=RIGHT, label="right")
    axis.set(title=title, xlabel="t (s)", ylabel=label)
    axis.legend(loc="best")


def _poses(record: Record) -> np.ndarray:
    return np.array([[s.x_m, s.y_m, s.yaw_rad] for s in record.truth])


def _path(axis, record: Record) -> None:
    poses = _poses(record)
    if record.reference_poses is not None:
        axis.plot(*record.reference_poses[:, :2].T, "--", color=PLAIN, label="reference")
    axis.plot(poses[:, 0], poses[:, 1], color=LEFT, label="robot")
    axis.plot(*poses[0, :2], "o", color=PLAIN, markersize=4, label="start")
    axis.set(title="(a) path", xlabel="x (m)", ylabel="y (m)")
    axis.axis("equal")
    axis.legend(loc="best")


def _speeds(axis, record: Record) -> None:
    _pair(axis, record.t_s, record.speeds, "(b) wheel speeds", "speed (rad/s)")
    if record.references is not None:
        axis.plot(record.t_s, record.references[:, 0], "--", color=PLAIN, label="references")
        axis.plot(record.t_s, record.references[:, 1], "--", color=PLAIN)
        axis.legend(loc="best")


def _pose(axis, record: Record) -> None:
    poses, t = _poses(record), record.t_s[record.rows]
    axis.plot(t, poses[:, 0], color=LEFT, label="x (m)")
    axis.plot(t, poses[:, 1], color=RIGHT, label="y (m)")
    axis.plot(t, poses[:, 2], color=PLAIN, label="yaw (rad)")
    axis.set(title="(d) pose", xlabel="t (s)", ylabel="x, y (m), yaw (rad)")
    axis.legend(loc="best")


def _errors(axis, record: Record) -> None:
    if record.references is None:
        axis.set(title="(e) speed errors", xlabel="t (s)")
        axis.text(0.5, 0.5, "driven by voltage: no reference", ha="center", va="center", transform=axis.transAxes)
        return
    _pair(axis, record.t_s, 1e3 * (record.speeds - record.references), "(e) speed errors", "error (mrad/s)")


def _loads(axis, plan: Plan, record: Record) -> None:
    t = record.t_s[record.starts]
    wheel = record.shaft_torques.astype(float) * plan.robot.motor.gear_ratio
    gained = (record.speeds[record.ends] - record.speeds[record.starts]) / (record.t_s[record.ends] - t)[:, None]
    wheel = wheel + record.reflected_kg_m2 * gained
    for side, colour, name in ((0, LEFT, "left"), (1, RIGHT, "right")):
        axis.step(t, 1e3 * wheel[:, side], where="post", color=colour, linestyle=":", label=f"torque {name}")
    axis.set(title="(f) load torques at the wheel, supply voltages", xlabel="t (s)", ylabel="torque (mN m)")
    other = axis.twinx()
    other.grid(False)
    for side, colour, name in ((0, LEFT, "left"), (1, RIGHT, "right")):
        other.step(t, record.applied[:, side], where="post", color=colour, label=f"voltage {name}")
    other.set_ylabel("voltage (V)")
    other.spines["right"].set_visible(True)
    handles = [line for one in (axis, other) for line in one.get_lines()]
    axis.legend(
        handles, [line.get_label() for line in handles], loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=4
    )
