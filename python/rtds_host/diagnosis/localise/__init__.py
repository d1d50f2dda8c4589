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

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rtds_host.contract import Case
from rtds_host.diagnosis.effects import SUBSYSTEMS
from rtds_host.diagnosis.localise.blocks import own_blocks, replay_blocks
from rtds_host.diagnosis.localise.missing import undetermined
from rtds_host.diagnosis.localise.shares import BLOCKS, Sums, share
from rtds_host.diagnosis.replay.model import Model

TITLES = {
    "bus": "supply voltage",
    "current_l": "command and speed → current, left",
    "current_r": "command and speed → current, right",
    "torque_l": "current → speed, left",
    "torque_r": "current → speed, right",
    "turn": "wheel speeds → yaw rate",
    "way": "wheel angles → pose",
    "speed_twice_l": "speed against angle, left",
    "speed_twice_r": "speed against angle, right",
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
    """Blocks of a case, the share of each subsystem and the signatures that made it; `undetermined`: what missing
    channels keep from being distinguished; `lag_s`: delay of `DELAYS_S` that fits the blocks best, 0 without one."""

    blocks: tuple[Block, ...]
    located: dict[str, float]
    signatures: tuple[tuple[str, str, float], ...]
    undetermined: tuple[str, ...]
    lag_s: float

    def shares(self) -> list[dict[str, Any]]:
        """The contract's `located`: subsystems with their share, largest first, summing to 1; [] where no gap is."""
        return [
            {"subsystem": s, "share": v}
            for s, v in sorted(self.located.items(), key=lambda p: (-p[1], SUBSYSTEMS.index(p[0])))
            if v > 0
        ]


def localise(case: Case, model: Model, held: bool = False) -> Localisation:
    """Replay each block of a case from measured signals and say where the gap lies.

    Parameters
    ----------
    case : the runs. model : the robot as far as it is known: nominal, with nuisances refitted, or with effects. held :
    take off what blocks leave of the model's own replay, which must then be close: of a model with effects.

    Returns
    -------
    blocks in the order of the signal chain, scores in units of noise, shares of the subsystems.
    """
    runs = [(own_blocks if held else replay_blocks)(log, case.robot, model) for log in case.runs]
    sums = Sums(runs, held)
    located, chosen, lag = share(sums)
    excess = {b: max(sums.energy[b] - sums.count[b], 0.0) for b in sums.blocks}
    whole = sum(excess.values())
    found = tuple(
        Block(
            name=b,
            subsystem=BLOCKS[b],
            title=TITLES[b],
            n=sums.count[b],
            score=float(np.sqrt(sums.energy[b] / sums.count[b])) if sums.count[b] else float("nan"),
            regimes={r: float(np.sqrt(e / n)) for r, (e, n) in sums.regimes[b].items()},
            share=excess[b] / whole if whole > 0 else 0.0,
        )
        for b in sums.blocks
    )
    return Localisation(found, located, tuple(chosen), undetermined(case), lag)
