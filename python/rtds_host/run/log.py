"""A record as a run folder of the contract."""

from __future__ import annotations

import numpy as np

from rtds_host.contract import RunMeta
from rtds_host.run.loop import Record
from rtds_host.run.plan import Plan


def log_columns(record: Record) -> dict[str, np.ndarray]:
    """Columns (k,) of `log.csv`. A row's `v_cmd` is what acts from it on; the last row's is the one that acted last."""
    which = np.clip(np.searchsorted(record.starts, record.rows, side="right") - 1, 0, len(record.starts) - 1)
    samples = record.samples
    pairs = {
        "v_cmd": record.commanded[which],
        "i": np.array([s.currents_a for s in samples]),
        "w": np.array([s.speeds_rad_s for s in samples]),
        "th": np.array([s.angles_rad for s in samples]),
    }
    columns = {
        "t": record.t_s[record.rows],
        "v_cmd_l": pairs["v_cmd"][:, 0],
        "v_cmd_r": pairs["v_cmd"][:, 1],
        "v_bus": np.array([s.v_bus for s in samples]),
    }
    for name in ("i", "w", "th"):
        columns[f"{name}_l"], columns[f"{name}_r"] = pairs[name].T
    columns |= {
        "gyro_z": np.array([s.gyro_rad_s for s in samples]),
        "x": np.array([s.x_m for s in samples]),
        "y": np.array([s.y_m for s in samples]),
        "yaw": np.array([s.yaw_rad for s in samples]),
    }
    if record.references is not None:
        columns["w_ref_l"], columns["w_ref_r"] = record.references[record.rows].T
    return columns


def run_meta(plan: Plan, notes: str = "") -> RunMeta:
    """`run.json` of a run."""
    return RunMeta(
        scenario=plan.scenario.name,
        payload_kg=plan.body.payload_kg,
        slope_rad=plan.body.slope_rad,
        uphill_yaw_rad=plan.body.uphill_yaw_rad,
        notes=notes,
    )
