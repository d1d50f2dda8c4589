"""A run as it goes on, for the page: a signal path that takes notes of what passes through it."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from rtds_host.run.path import Sample, SignalPath
from rtds_host.run.plan import Plan
from rtds_host.scenario import SpeedMotion, reference_poses, wheel_references
from rtds_host.view.lines import Lines, figure

# Layout: rows a second that are kept for the page, which redraws about as often as it can be seen.
RATE_HZ = 50.0


class Feed:
    """Runs for the page, complete ones and those that grow; may be read and written by different threads."""

    def __init__(self, runs: list[Lines] | None = None):
        self._lock = threading.Lock()
        self._runs = list(runs or [])

    def add(self, lines: Lines) -> int:
        """A further run; returns its number."""
        with self._lock:
            self._runs.append(lines)
            return len(self._runs) - 1

    def extend(self, number: int, layer: str, row: dict[str, float | None]) -> None:
        """A row more of a run's layer; every row of a layer has the same columns."""
        with self._lock:
            columns = self._runs[number].layers.setdefault(layer, {name: [] for name in row})
            for name, value in row.items():
                columns[name].append(value)

    def finish(self, number: int) -> None:
        """Nothing more comes of a run."""
        with self._lock:
            self._runs[number].done = True

    def json(self, since: list[int]) -> dict[str, Any]:
        """All runs, each from the row on that the page has not yet; rows it does not know of from 0."""
        with self._lock:
            return {"runs": [run.json(since[k] if k < len(since) else 0) for k, run in enumerate(self._runs)]}


class LivePath(SignalPath):
    """The signal path of a run, as it would be without it, which tells a feed what is measured on the way.

    It changes nothing: every call goes on to `path`, and what that gives is given back.
    """

    def __init__(self, path: SignalPath, plan: Plan, feed: Feed):
        super().__init__(path.supply_v)
        self.path, self.plan, self.feed = path, plan, feed
        self.watches = path.watches
        self.number = feed.add(Lines(plan.scenario.name, plan.robot.name, done=False))
        self._next = 0.0
        self._ended = False
        # The last row that was left out, for the run's end.
        self._last: tuple[float, Sample] | None = None
        self._volts = np.zeros(2)
        self._loads = np.zeros(2)
        if isinstance(plan.motion, SpeedMotion):
            self._note_reference()

    def _note_reference(self) -> None:
        """The way that is asked for, whole from the start."""
        motion = self.plan.motion
        assert isinstance(motion, SpeedMotion)
        step = 1.0 / RATE_HZ
        poses = reference_poses(motion, step)
        for k, (x, y, _) in enumerate(poses.tolist()):
            self.feed.extend(self.number, "reference", {"t": figure(k * step), "x": figure(x), "y": figure(y)})

    def watch(self, t_s: float, sample: Sample) -> None:
        self.path.watch(t_s, sample)

    def voltages(self, t_s: float, commanded_v: np.ndarray, sample: Sample) -> np.ndarray:
        volts = self.path.voltages(t_s, commanded_v, sample)
        self._volts = np.array(volts, dtype=float)
        return volts

    def loads(self, t_s: float, torques_nm: np.ndarray, sample: Sample) -> np.ndarray:
        loads = self.path.loads(t_s, torques_nm, sample)
        self._loads = np.array(loads, dtype=float)
        return loads

    def wheels(self, speeds_rad_s: np.ndarray, torques_nm: np.ndarray) -> np.ndarray:
        return self.path.wheels(speeds_rad_s, torques_nm)

    def sensors(self, t_s: float, sample: Sample) -> Sample:
        seen = self.path.sensors(t_s, sample)
        if not self._ended:
            self._last = (t_s, seen)
            if t_s + 1e-9 >= self._next:
                self._next = t_s + 1.0 / RATE_HZ
                self._note(*self._last)
                self._last = None
        return seen

    def end(self) -> None:
        """The run is over; what another engine drives after it is not noted."""
        self._ended = True
        if self._last is not None:
            self._note(*self._last)
        self.feed.finish(self.number)

    def _note(self, t_s: float, seen: Sample) -> None:
        row = {"t": t_s, "x": seen.x_m, "y": seen.y_m, "yaw": seen.yaw_rad}
        pairs = {
            "w": seen.speeds_rad_s,
            "i": seen.currents_a,
            "v_cmd": self._volts,
            "torque": self._loads,
        }
        if isinstance(self.plan.motion, SpeedMotion):
            pairs["w_ref"] = wheel_references(self.plan.motion, self.plan.robot, np.array([t_s]))[0]
        row |= {f"{name}_{side}": float(pair[k]) for name, pair in pairs.items() for k, side in enumerate("lr")}
        self.feed.extend(self.number, "measured", {name: figure(value) for name, value in row.items()})
