"""Whether an exported MuJoCo robot closes the gap: runs replayed from the files alone, before and after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rtds_host.cleanup import temporary_folder
from rtds_host.contract import Case, Robot, RunLog
from rtds_host.diagnosis import gap as gaps
from rtds_host.diagnosis.problem import Problem
from rtds_host.diagnosis.replay.model import REPORT_STEP_S, Model, nominal_model, replay_run, row_inputs
from rtds_host.export import mjcf
from rtds_host.export.figures import figures_of
from rtds_host.export.mujoco_replay import ExportedRobot
from rtds_host.plant.schema import OUTPUT_INDEX

# Share of full scale within which currents, speeds and paths are called those of the replay.
CLOSE = 0.01


@dataclass(frozen=True)
class Closing:
    """A gap before and after, in units of the sensors' noise; `closed` is None where `before` is none."""

    before: float
    after: float

    @property
    def closed(self) -> float | None:
        return gaps.closed(self.before, self.after)


@dataclass(frozen=True)
class Apart:
    """How far MuJoCo is from the replay of the same robot in one channel of one run: root mean square and largest
    difference as shares of `full`, the channel's largest value in the replay (SI). `at_s`: when it is largest, s;
    `beyond`: rows that differ by more than `CLOSE`, of `rows`."""

    run: str
    channel: str
    rms: float
    largest: float
    full: float
    at_s: float
    beyond: int
    rows: int


@dataclass(frozen=True)
class Checked:
    """The gap in MuJoCo and in the diagnosis' own replay, over the same runs, and the difference between the two."""

    mujoco: Closing
    replay: Closing
    apart: tuple[Apart, ...] = ()

    @property
    def share(self) -> float | None:
        """What MuJoCo closes of what the replay closes."""
        ours, theirs = self.mujoco.closed, self.replay.closed
        return None if ours is None or theirs is None or theirs <= 0.0 else ours / theirs


def apart(run: str, t: np.ndarray, mujoco: np.ndarray, replay: np.ndarray) -> list[Apart]:
    """Differences in currents, speeds and path of two answers (n, 11) at times t (n,), s; columns as the replay's
    `OUTPUTS`.

    Full scale of the path is its largest distance from where it starts. A channel that never moves is left out.
    """
    found = []
    for channel in ("i_l", "i_r", "w_l", "w_r"):
        k = OUTPUT_INDEX[channel]
        found.append((channel, np.abs(mujoco[:, k] - replay[:, k]), float(np.abs(replay[:, k]).max())))
    place = [OUTPUT_INDEX["x"], OUTPUT_INDEX["y"]]
    far = np.hypot(*(replay[:, place] - replay[0, place]).T)
    found.append(("path", np.hypot(*(mujoco[:, place] - replay[:, place]).T), float(far.max())))
    return [
        Apart(
            run,
            channel,
            rms=float(np.sqrt(np.mean(miss**2))) / full,
            largest=float(miss.max()) / full,
            full=full,
            at_s=float(t[int(miss.argmax())]),
            beyond=int(np.count_nonzero(miss > CLOSE * full)),
            rows=len(t),
        )
        for channel, miss, full in found
        if full > 0.0
    ]


def verdict(found: Sequence[Apart]) -> str:
    """Whether all channels are within `CLOSE` of full scale, in a sentence."""
    far = max(found, key=lambda one: one.largest)
    where = f"{far.channel} of {far.run}, {far.largest:.2%} at {far.at_s:.3f} s"
    if far.largest <= CLOSE:
        return f"all within {CLOSE:.0%} of full scale; the largest is {where}"
    return f"not all within {CLOSE:.0%} of full scale: {far.beyond} of {far.rows} rows; the largest is {where}"


def check(corrected: Path, robot: Robot, model: Model, runs: Sequence[RunLog], actuator: str = "general") -> Checked:
    """Replay runs by the nominal robot's export and by a corrected one.

    Parameters
    ----------
    corrected : MJCF file of `rtds export`; the nominal one is written by the same writer.
    model : what `corrected` holds, for the diagnosis' own replay. actuator : of both files.

    Raises
    ------
    InputError : a file that MuJoCo does not take, a robot that cannot be exported.
    """
    case = Case("export", robot, tuple(runs))
    problem = Problem(case, 1)
    # A heading that a log does not hold is found from the slope's pull, as in a diagnosis.
    start = problem.aligned(model)
    plain = nominal_model(robot)
    parts: dict[str, list[dict[str, np.ndarray]]] = {
        name: [] for name in ("before", "after", "replay before", "replay after")
    }
    differences: list[Apart] = []
    with temporary_folder() as folder:
        nominal = folder / "nominal.xml"
        nominal.write_text(mjcf.write(figures_of(plain, robot), "", actuator), encoding="utf-8")
        for data in problem.whole_runs_starting(start):
            log, initial = data.log, data.inputs[-1]
            bus = row_inputs(log, robot)[3] if robot.driver.bus == "measured" else None
            outs = {
                "before": ExportedRobot(nominal).replay(log, initial, bus),
                "after": ExportedRobot(corrected).replay(log, initial, bus),
                "replay before": replay_run(plain, data.inputs, REPORT_STEP_S),
                "replay after": replay_run(model, data.inputs, min(REPORT_STEP_S, model.step_s)),
            }
            differences += apart(log.name, log.t, outs["after"], outs["replay after"])
            for name, out in outs.items():
                parts[name].append(gaps.errors(log, robot, out))
    total = {name: gaps.gap(gaps.pooled(errors)) for name, errors in parts.items()}
    return Checked(
        Closing(total["before"], total["after"]),
        Closing(total["replay before"], total["replay after"]),
        tuple(differences),
    )
