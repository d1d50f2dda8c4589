"""All blocks of one run, as they are and less what they leave of the model's own replay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rtds_host.contract import Robot, RunLog
from rtds_host.diagnosis.localise.electrical import bus_block, current_block
from rtds_host.diagnosis.localise.ground import turn_block, way_block
from rtds_host.diagnosis.localise.mechanical import torque_block
from rtds_host.diagnosis.localise.signals import Signals
from rtds_host.diagnosis.localise.twice import speed_twice_block, yaw_twice_block
from rtds_host.diagnosis.replay.model import Model, replay_run, run_inputs
from rtds_host.plant.schema import OUTPUT_INDEX


def replay_blocks(log: RunLog, robot: Robot, model: Model, signatures: bool = True) -> Signals:
    """All blocks of one run, each driven by measured signals, with every cause's signature in them unless it is not
    asked for."""
    run = Signals(log, robot, model, signatures)
    bus_block(run)
    for k in run.sides:
        current_block(run, k)
    for k in run.sides:
        torque_block(run, k)
    if run.body:
        turn_block(run)
        way_block(run)
    for k in run.sides:
        speed_twice_block(run, k)
    yaw_twice_block(run)
    return run


def _as_replayed(log: RunLog, out: np.ndarray) -> RunLog:
    """The run as its replay (n, 11) would have been logged, without noise."""
    measured = {
        c: np.where(np.isfinite(log.columns[c]), out[:, k], np.nan) for c, k in OUTPUT_INDEX.items() if c in log.columns
    }
    return replace(log, columns={**log.columns, **measured})


def own_blocks(log: RunLog, robot: Robot, model: Model, signatures: bool = True) -> Signals:
    """A run's blocks less what they leave of the model's own replay; parameters as of `replay_blocks`."""
    run = replay_blocks(log, robot, model, signatures)
    out = replay_run(model, run_inputs(log, robot))
    if not np.isfinite(out).all():
        return run  # a replay that ran away says nothing of the blocks
    own = replay_blocks(_as_replayed(log, out), robot, model, signatures=False)
    for name, (residual, noise, rows) in run.blocks.items():
        run.blocks[name] = residual - own.blocks[name][0], noise, rows
    return run
