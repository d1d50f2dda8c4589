"""Where the gap lies: each block of the robot replayed on its own, driven by measured signals.

Blocks and what drives them (contract, section 2, for the equations):

- bus: the nominal supply against the measured bus voltage;
- current: command and measured speed -> current (driver and winding);
- torque: measured current -> speed, in windows of `WINDOW_S` that start at the measured speed (gear, wheels, body);
- turn, way: measured wheel speeds -> yaw rate, and wheel angles -> how the pose moves (ground contact, geometry);
- speed_twice, yaw_twice: a channel against another one of the same quantity (sensors).

Each block's residual is divided by the noise that the sensors alone would leave in it, so a perfect robot scores 1.
What a model holds and a block does not, a filtered reading, free play, a spring, is in the model's own replay, too: the
residual that a block leaves of that is no error and is taken off.
The blocks' residuals are linear in small errors of the robot. Shares follow from a regression of all blocks at once
on such errors' signatures, nuisances with their prior always in it: an error that explains most of what is left
hands its energy to its subsystem, and what no signature explains stays with the block it is seen in.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from rtds_host.contract import Case, Robot, RunLog
from rtds_host.diagnosis.effects import SUBSYSTEMS
from rtds_host.diagnosis.localise.electrical import bus_block, current_block
from rtds_host.diagnosis.localise.ground import Extent, extent, floor_columns, turn_block, way_block
from rtds_host.diagnosis.localise.lost import lost
from rtds_host.diagnosis.localise.mechanical import torque_block
from rtds_host.diagnosis.localise.shares import BLOCKS, Sums, in_noise, share
from rtds_host.diagnosis.localise.signals import Signals
from rtds_host.diagnosis.localise.twice import speed_twice_block, yaw_twice_block
from rtds_host.diagnosis.replay.model import Model, replay_run, run_inputs
from rtds_host.diagnosis.replay.slots import OUTPUT_INDEX

TITLES = {
    "bus": "supply voltage", "current_l": "command and speed → current, left",
    "current_r": "command and speed → current, right", "torque_l": "current → speed, left",
    "torque_r": "current → speed, right",
    "turn": "wheel speeds → yaw rate", "way": "wheel angles → pose",
    "speed_twice_l": "speed against angle, left", "speed_twice_r": "speed against angle, right",
    "yaw_twice": "gyro against yaw",
}


@dataclass(frozen=True)
class Block:
    """One block: `score` root mean square residual in units of noise (a perfect robot scores 1), `n` residuals,
    `regimes` the score in each regime, `share` of all excess energy."""

    name: str
    subsystem: str
    title: str
    score: float
    n: int
    regimes: dict[str, float] = field(default_factory=dict)
    share: float = 0.0


@dataclass(frozen=True)
class Localisation:
    """Blocks of a case, the share of each subsystem and the signatures that made it; `lost`: what missing channels
    keep from being told apart; `lag_s`: delay of `DELAYS_S` that fits the blocks best, 0 without one."""

    blocks: tuple[Block, ...]
    located: dict[str, float]
    signatures: tuple[tuple[str, str, float], ...]
    lost: tuple[str, ...]
    lag_s: float

    def shares(self) -> list[dict[str, object]]:
        """The contract's `located`: subsystems with their share, largest first, summing to 1; [] where no gap is."""
        return [{"subsystem": s, "share": v}
                for s, v in sorted(self.located.items(), key=lambda p: (-p[1], SUBSYSTEMS.index(p[0]))) if v > 0]


def replay_blocks(log: RunLog, robot: Robot, model: Model, where: Extent | None = None, signatures: bool = True) -> Signals:
    """All blocks of one run, each driven by measured signals, with every cause's signature in them unless it is not asked for;
    `where`: where all runs went, for what a floor does at a place."""
    run = Signals(log, robot, model, signatures)
    bus_block(run)
    for k in run.sides:
        current_block(run, k)
    for k in run.sides:
        torque_block(run, k)
    if run.body:
        turn_block(run)
        way_block(run)
        if where is not None and signatures:
            floor_columns(run, where)
    for k in run.sides:
        speed_twice_block(run, k)
    yaw_twice_block(run)
    return run


def _as_replayed(log: RunLog, out: np.ndarray) -> RunLog:
    """The run as its replay (n, 11) would have been logged, without noise."""
    measured = {c: np.where(np.isfinite(log.columns[c]), out[:, k], np.nan) for c, k in OUTPUT_INDEX.items() if c in log.columns}
    return replace(log, columns={**log.columns, **measured})


def _own(log: RunLog, robot: Robot, model: Model, where: Extent | None = None, signatures: bool = True) -> Signals:
    """A run's blocks less what they leave of the model's own replay; parameters as of `replay_blocks`."""
    run = replay_blocks(log, robot, model, where, signatures)
    out = replay_run(model, run_inputs(log, robot))
    if not np.isfinite(out).all():
        return run                          # a replay that ran away says nothing of the blocks
    own = replay_blocks(_as_replayed(log, out), robot, model, signatures=False)
    for name, (residual, noise, rows) in run.blocks.items():
        run.blocks[name] = residual - own.blocks[name][0], noise, rows
    return run


def excess_energy(case: Case, model: Model) -> tuple[float, int]:
    """What all blocks' residuals have beyond their noise, of a model with effects, and their number.

    A sum of squares in units of noise less one for each, 0 for a block that has no more: noise is bounded from above.
    """
    squares: dict[str, float] = {}
    counts: dict[str, int] = {}
    for log in case.runs:
        run = _own(log, case.robot, model, signatures=False)
        for name in run.blocks:
            z, *_ = in_noise(run, name)
            squares[name] = squares.get(name, 0.0) + float(z @ z)
            counts[name] = counts.get(name, 0) + len(z)
    return sum(max(squares[name] - counts[name], 0.0) for name in squares), sum(counts.values())


def localise(case: Case, model: Model, held: bool = False) -> Localisation:
    """Replay each block of a case from measured signals and say where the gap lies.

    Parameters
    ----------
    case : the runs. model : the robot as far as it is known: nominal, with nuisances refitted, or with effects. held : take
    off what blocks leave of the model's own replay, which must then be close: of a model with effects.

    Returns
    -------
    blocks in the order of the signal chain, scores in units of noise, shares of the subsystems.
    """
    where = extent(case.runs) if case.robot.chassis is not None else None
    runs = [(_own if held else replay_blocks)(log, case.robot, model, where) for log in case.runs]
    sums = Sums(runs, held)
    located, chosen, lag = share(sums)
    excess = {b: max(sums.energy[b] - sums.count[b], 0.0) for b in sums.blocks}
    whole = sum(excess.values())
    found = tuple(
        Block(name=b, subsystem=BLOCKS[b], title=TITLES[b], n=sums.count[b],
              score=float(np.sqrt(sums.energy[b] / sums.count[b])) if sums.count[b] else float("nan"),
              regimes={r: float(np.sqrt(e / n)) for r, (e, n) in sums.regimes[b].items()},
              share=excess[b] / whole if whole > 0 else 0.0)
        for b in sums.blocks)
    return Localisation(found, located, tuple(chosen), lost(case), lag)
