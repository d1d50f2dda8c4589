"""The gap on runs that were not used for the fit (contract, section 4), as it is reported: each run is left out in turn
(`left_out`) and replayed in short steps."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.special import stdtrit

from rtds_host.contract import RunLog
from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.attribution import Attribution
from rtds_host.diagnosis.fit import Fit
from rtds_host.diagnosis.left_out import left_out, parted
from rtds_host.diagnosis.localise.regimes import Motion, regimes
from rtds_host.diagnosis.problem import STRETCH_S, Problem
from rtds_host.diagnosis.replay.model import REPORT_STEP_S, replay_run
from rtds_host.diagnosis.report.details import Trace
from rtds_host.plant.schema import OUTPUTS

# Ends of a 90 % interval (contract, section 5).
LEVELS = (0.05, 0.95)
SHOWN = ("v_bus", "i_l", "i_r", "w_l", "w_r", "th_l", "th_r", "gyro_z", "x", "y", "yaw")


@dataclass
class HeldOut:
    """Gaps on held-out runs: channels by model ("before", "refit", "after"); without : by effect, the gap without it;
    decided : by effect, the channel that misses it most, and that channel's gap without and with it; runs, regimes : by
    name, gap by model; interval : 90 % of the share closed on another run, None where it cannot be said."""

    channels: dict[str, dict[str, float]]
    without: dict[tuple[str, str], float]
    decided: dict[tuple[str, str], tuple[str, float, float]]
    runs: dict[str, dict[str, float]]
    regimes: dict[str, dict[str, float]]
    traces: dict[str, dict[str, Trace]]
    interval: tuple[float, float] | None
    notes: list[str] = field(default_factory=list)

    def gap(self, model: str) -> float:
        """The gap of one of the models."""
        return gaps.gap(self.channels[model])


def held_out(problem: Problem, attribution: Attribution) -> HeldOut:
    """Gaps of the nominal robot, the refitted one, and the one with the effects that stand, on runs left out."""
    robot = problem.declared
    models: dict[str | tuple[str, str], Fit] = {"refit": attribution.base, "after": attribution.fit}
    models.update({s.cause: s.without for s in attribution.included})
    step = min(REPORT_STEP_S, attribution.fit.model(problem).step_s)
    parts: dict[str | tuple[str, str], list[dict[str, gaps.Squares]]] = {name: [] for name in ("before", *models)}
    by_regime: dict[str, dict[str, list[dict[str, gaps.Squares]]]] = {}
    runs, traces, stretches = {}, {}, []
    notes = [
        f"{name}: no heading in the log; the slope's pull says that the run began at {heading:.2f} rad"
        for name, heading in attribution.fit.start.headings
    ]
    notes += [
        f"{name}: its commands act {late:+.2g} s later than those of the other runs; effects were fitted with that,"
        " every gap shown is without it"
        for name, late in attribution.fit.start.command_delays
    ]
    if problem.searched < 1.0:
        notes.append(
            f"these runs are long: effects were looked for in {100 * problem.searched:.2g} % of them, in stretches of "
            f"up to {STRETCH_S:g} s from all over; every gap shown is of all rows"
        )
    pieces = parted(problem)
    if len(problem.whole) == 1:
        notes.append(
            "one run only: each half was held out in turn, which is weaker evidence than another run"
            if len(pieces[0]) > 1
            else "one run, too short to hold a part of it out: every gap is of samples that were fitted"
        )
    fitted = {
        name: iter(left_out(problem, fit, [rows for mine in pieces for _, _, rows in mine]))
        for name, fit in models.items()
    }
    for data, mine in zip(problem.whole_runs_starting(attribution.fit.start), pieces):
        nominal = replay_run(problem.nominal, data.inputs, step)
        own: dict[str | tuple[str, str], list[dict[str, gaps.Squares]]] = {name: [] for name in parts}
        shown = {"refit": np.empty_like(nominal), "after": np.empty_like(nominal)}
        for first, last, _ in mine:
            log = data.log.rows(first, last)
            motion: dict[str, np.ndarray] = {}
            # One replay at a time, and of its errors the squares: a run may have a million rows.
            names: list[str | tuple[str, str]] = ["after", "before", *(n for n in models if n != "after")]
            for name in names:
                out = nominal if name == "before" else replay_run(next(fitted[name]), data.inputs, step)
                motion = motion or _regimes(problem, log, out[first:last])
                found = gaps.errors_at(log, robot, out[first:last])
                own[name].append({channel: gaps.squares(error) for channel, (_, error) in found.items()})
                if not isinstance(name, str):
                    continue
                for regime, inside in motion.items():
                    part = {channel: gaps.squares(error[inside[rows]]) for channel, (rows, error) in found.items()}
                    by_regime.setdefault(regime, {}).setdefault(name, []).append(part)
                if name in shown:
                    shown[name][first:last] = out[first:last]
            ends = gaps.gap(gaps.pooled(own["before"][-1:])), gaps.gap(gaps.pooled(own["after"][-1:]))
            stretches.append(ends)
        for name, squares in own.items():
            parts[name] += squares
        runs[data.log.name] = {name: gaps.gap(gaps.pooled(own[name])) for name in ("before", "refit", "after")}
        traces[data.log.name] = {
            c: Trace(data.log.t, data.log.columns[c], nominal[:, n], shown["refit"][:, n], shown["after"][:, n])
            for n, c in enumerate(SHOWN)
            if data.log.has(c)
        }
    channels = {name: gaps.pooled(parts[name]) for name in ("before", "refit", "after")}
    lacking = {s.cause: gaps.pooled(parts[s.cause]) for s in attribution.included}
    without = {cause: gaps.gap(found) for cause, found in lacking.items()}
    decided = {
        cause: max(
            ((c, value, channels["after"][c]) for c, value in found.items()), key=lambda d: d[1] ** 2 - d[2] ** 2
        )
        for cause, found in lacking.items()
    }
    return HeldOut(channels, without, decided, runs, _by_regime(by_regime), traces, _for_another(stretches), notes)


def _for_another(stretches: list[tuple[float, float]]) -> tuple[float, float] | None:
    """90 % interval of the share closed on another run of the same robot: Student's prediction from the runs
    there are.
    """
    counted = [(before, after) for before, after in stretches if before >= gaps.LEAST]
    if len(counted) < 2:
        return None
    shares = np.array([gaps.closed(before, after) for before, after in counted])
    mean, spread = float(shares.mean()), float(shares.std(ddof=1)) * math.sqrt(1.0 + 1.0 / len(shares))
    low, high = (mean + float(stdtrit(len(shares) - 1, level)) * spread for level in LEVELS)
    # By chance a gap comes out below that of the noise, hardly by more than what counts as one.
    return low, min(
        high, max(1.0 + (1.0 - 1.0 / gaps.LEAST) / (min(before for before, _ in counted) - 1.0), float(shares.max()))
    )


def _regimes(problem: Problem, log: RunLog, out: np.ndarray) -> dict[str, np.ndarray]:
    """Regime -> rows of a log in it, by how the corrected replay `out` moves, which no sensor has to measure."""
    column = {name: out[:, k] for k, name in enumerate(OUTPUTS)}
    speeds = [column[f"w_{s}"] for s in problem.robot.sides]
    body = problem.robot.chassis is not None
    motion = Motion(log.t, speeds, column["yaw"] if body else None, column["gyro_z"] if body else None)
    half = max(1, round(0.015 / float(np.median(np.diff(log.t)))))
    return regimes(motion, log.meta, log.meta.slope_rad, half)


def _by_regime(parts: dict[str, dict[str, list[dict[str, gaps.Squares]]]]) -> dict[str, dict[str, float]]:
    """Gap of each regime, of those that hold some of the samples and not all of them."""
    counts = {
        regime: sum(e.count for part in named["before"] for e in part.values()) for regime, named in parts.items()
    }
    whole = counts.get("first half", 0) + counts.get("second half", 0)
    return {
        regime: {name: gaps.gap(gaps.pooled(p)) for name, p in named.items()}
        for regime, named in parts.items()
        if max(1, min(50, 0.02 * whole)) <= counts[regime] < 0.98 * whole
    }
