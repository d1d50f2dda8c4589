"""A plan as csv, as a ROS 2 script and as JSON."""

from __future__ import annotations

import inspect
import json
import math
from pathlib import Path

import numpy as np

from rtds_host.contract.runlog import write_csv
from rtds_host.plan import ros_script
from rtds_host.plan.make import Plan

# What `write` makes.
FILES = ("plan.json", "commands.csv", "drive.py")
SCHEMA = "rtds-plan/1"
CSV_STEP_S = 0.02
PLACES = ('KIND = "cmd_vel"\n', "KNOTS: list = []\n")


def script(plan: Plan) -> str:
    """The ROS 2 script (rclpy) that drives a plan."""
    text = "#!/usr/bin/env python3\n" + inspect.getsource(ros_script)
    rows = "".join(f"    ({t:.4f}, {a:.6g}, {b:.6g}),\n" for t, (a, b) in zip(plan.commands.t, plan.commands.values))
    for place, new in zip(PLACES, (f'KIND = "{plan.kind}"\n', f"KNOTS = [\n{rows}]\n"), strict=True):
        if place not in text:
            raise LookupError(f"ros_script.py holds no line {place!r}")
        text = text.replace(place, new, 1)
    return text


def summary(plan: Plan, why: str) -> dict:
    """The content of plan.json."""
    x, y, yaw = plan.start
    return {
        "schema": SCHEMA,
        "scenario": plan.scenario.name,
        "about": plan.scenario.about,
        "why": why,
        "kind": plan.kind,
        "scale": round(plan.scale, 3),
        "duration_s": round(plan.commands.duration_s, 3),
        "payload_kg": plan.payload_kg,
        "slope_rad": plan.scenario.slope_rad,
        "uphill_yaw_rad": plan.scenario.uphill_yaw_rad,
        "floor_m": [plan.floor.width_m, plan.floor.depth_m],
        "margin_m": plan.floor.margin_m,
        "start": {"x_m": round(x, 3), "y_m": round(y, 3), "heading_rad": round(yaw, 4)},
        "extent_m": [round(e, 3) for e in plan.extent_m],
        "largest": {name: round(v, 4) for name, v in plan.tops.items()},
    }


def write(plan: Plan, folder: Path, why: str) -> None:
    """Write plan.json, commands.csv (every 20 ms) and drive.py into a folder that exists."""
    t = np.arange(math.ceil(plan.commands.duration_s / CSV_STEP_S) + 1) * CSV_STEP_S
    values = plan.commands.at(t)
    values[-1] = 0.0
    write_csv(folder / "commands.csv", {"t": t, **{name: values[:, k] for k, name in enumerate(plan.commands.names)}})
    (folder / "plan.json").write_text(json.dumps(summary(plan, why), indent=1) + "\n", encoding="utf-8")
    place = folder / "drive.py"
    place.write_text(script(plan), encoding="utf-8")
    place.chmod(0o755)
