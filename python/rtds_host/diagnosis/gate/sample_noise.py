"""The noise that samples show, whatever `[sensors]` declares.

The search for effects takes this noise, so that names and sizes do not depend on the declared one (contract, section
5). The declared noise says which gap matters, and how sensors compare with one another: only its ratio to that of the
samples is estimated, the same for all channels.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from rtds_host.contract import Case
from rtds_host.diagnosis.gap import gap_channels
from rtds_host.diagnosis.replay.model import nominal_model, replay_run, run_inputs
from rtds_host.diagnosis.thresholds import MINOR_SHARE
from rtds_host.plant.schema import OUTPUT_INDEX

# Numerical: rows of a block whose differences give one value of the noise.
NOISE_ROWS = 20
# Numerical: the median over blocks of the root mean square of third differences of unit white noise, over sqrt(20).
MEDIAN_OF_WHITE = 0.958


def sample_noise(case: Case, replays: Sequence[np.ndarray] | None = None) -> dict[str, float]:
    """Channel -> one standard deviation of the white noise in its samples, SI.

    Of channels with a declared noise and enough samples, of which most are no copies of the one before. By third
    differences, which motion hardly has: the median over blocks of `NOISE_ROWS` rows of their root mean square, over
    sqrt(20), that of white noise of one unit (J. von Neumann et al., Ann. Math. Statist. 12, 153, 1941, for first
    differences). Where rows are few, motion is not smooth from row to row. So each block takes the smaller value of the
    samples and of what the nominal robot's replay differs from them by, which lacks the most of that motion.

    replays : (n, 11) of the nominal robot, one a run, where they are known.
    """
    found: dict[str, list[np.ndarray]] = {}
    if replays is None:
        model = nominal_model(case.robot)
        replays = [replay_run(model, run_inputs(log, case.robot)) for log in case.runs]
    for log, out in zip(case.runs, replays, strict=True):
        for channel, values in log.columns.items():
            there = np.isfinite(values)
            samples = values[there]
            held = bool(np.median(np.abs(np.diff(samples))) == 0.0) if len(samples) > 1 else True
            if case.robot.noise(channel) and len(samples) >= 2 * NOISE_ROWS and not held:
                sizes = [_by_block(samples), _by_block(samples - out[there, OUTPUT_INDEX[channel]])]
                found.setdefault(channel, []).append(np.fmin(*sizes))
    medians = {channel: float(np.median(np.concatenate(blocks))) for channel, blocks in found.items()}
    return {channel: size for channel, size in medians.items() if size > 0.0}


def _by_block(samples: np.ndarray) -> np.ndarray:
    """One standard deviation of white noise in each block of some samples (n,): (blocks,)."""
    with np.errstate(over="ignore", invalid="ignore"):  # of a replay that ran away
        third = np.diff(samples, 3) / (math.sqrt(20.0) * MEDIAN_OF_WHITE)
        # As `np.array_split` parts them: the first ones have a row more than the last.
        count = len(third) // NOISE_ROWS
        rows = np.full(count, len(third) // count) + (np.arange(count) < len(third) % count)
        return np.sqrt(np.add.reduceat(np.square(third), np.cumsum(rows) - rows) / rows)


def noise_ratio(case: Case, rounding: Mapping[str, float], replays: Sequence[np.ndarray] | None = None) -> float:
    """The noise that samples show over the declared one, the same for all channels that a gap counts; 1 where samples
    of none show it.

    Over these channels the geometric mean of what samples show is that of the declared noise times the ratio, with
    rounding. Rounding has a known size and is not scaled. So n times the declared noise has exactly an n-th of the
    ratio, and the search the same noise.

    Parameters
    ----------
    case : its robot's noise is as the file declares it. rounding : channel -> what it adds, one standard deviation, SI.
    replays : as of `sample_noise`.
    """
    counted = {channel for log in case.runs for channel in gap_channels(log, case.robot)}
    shown = {channel: size for channel, size in sample_noise(case, replays).items() if channel in counted}
    if not shown:
        return 1.0
    squares = [(case.robot.known_noise(c) / size) ** 2 for c, size in shown.items()]
    rounded = [(rounding.get(c, 0.0) / size) ** 2 for c, size in shown.items()]

    def excess(log_ratio: float) -> tuple[float, float]:
        """The mean logarithm of the squared noise with this ratio over that of the samples, and its slope."""
        factor = math.exp(2.0 * log_ratio)
        scaled = [factor * s for s in squares]
        mean = sum(math.log(s + r) for s, r in zip(scaled, rounded)) / len(squares)
        return mean, 2.0 * sum(s / (s + r) for s, r in zip(scaled, rounded)) / len(squares)

    # Without rounding this ratio is exact, with it too large: the excess rises and is convex, so that Newton's steps
    # never go too far, and end where one goes nowhere. Rounding alone may be more than what samples show, where they
    # move by less than a step from row to row: the declared noise is then a slight part.
    unrounded = -0.5 * sum(map(math.log, squares)) / len(squares)
    log_ratio, least = unrounded, unrounded + math.log(MINOR_SHARE)
    while log_ratio > least:
        above, slope = excess(log_ratio)
        before, log_ratio = log_ratio, log_ratio - above / slope
        if not log_ratio < before:
            return math.exp(before)
    return math.exp(least)
