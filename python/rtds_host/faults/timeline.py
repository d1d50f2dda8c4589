"""Faults and stimulus of one run on the time of the motor units, in whole steps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rtds_host.errors import InputError
from rtds_host.faults.script import Fault
from rtds_host.faults.stimulus import VOLTAGES, Stimulus
from rtds_host.link.base import STEP_TOLERANCE, whole_steps

NEVER = 2**62


@dataclass(frozen=True)
class Timed:
    """A fault from step `start` on and no longer at step `end` of the motor units."""

    fault: Fault
    start: int
    end: int

    def acts(self, step: int) -> bool:
        """Whether it acts in the step of this number, the first is 0."""
        return self.start <= step < self.end


@dataclass(frozen=True)
class Injection:
    """What is injected into one run, with its times in steps of the motor units.

    Attributes
    ----------
    step_s : of the motor units, s. supply_v : nominal voltage of the bus, V.
    faults : in the order of time. stimulus : None without. rows : (n,) int64, steps at which its rows begin.
    """

    step_s: float
    supply_v: float
    faults: tuple[Timed, ...]
    stimulus: Stimulus | None
    rows: np.ndarray

    @classmethod
    def of(
        cls,
        faults: tuple[Fault, ...],
        stimulus: Stimulus | None,
        step_s: float,
        supply_v: float,
        duration_s: float,
        method: str = "backward_euler",
        inductance_h: float = math.inf,
    ) -> Injection:
        """Put faults and a stimulus on the steps of a run.

        Parameters
        ----------
        step_s, method, inductance_h : of the motor units. supply_v : of the robot. duration_s : of the run.

        Raises
        ------
        InputError : a time is no whole number of steps, a fault begins after the run, a dip is no dip, or the method
            cannot hold an open phase.
        """
        timed = []
        for fault in faults:
            start = _step(f"{fault}: from_s", fault.from_s, step_s)
            end = NEVER if math.isinf(fault.to_s) else _step(f"{fault}: to_s", fault.to_s, step_s)
            if fault.from_s >= duration_s:
                raise InputError(f"{fault}: begins after the run, which lasts {duration_s:g} s")
            if fault.kind == "supply_dip" and fault.volts >= supply_v:
                raise InputError(f"{fault}: is not a dip, the supply's voltage is {supply_v:g} V")
            # The trapezoidal rule lets a current ring where a step is longer than twice the time constant L/R.
            if method != "backward_euler" and fault.kind == "phase_open":
                if step_s * fault.resistance_ohm > 2.0 * inductance_h:
                    raise InputError(f"{fault}: needs the method backward_euler, with {method} the current would ring")
            timed.append(Timed(fault, start, end))
        rows = np.zeros(0, np.int64)
        if stimulus is not None:
            exact = stimulus.t_s / step_s
            rows = np.round(exact).astype(np.int64)
            bad = np.flatnonzero((np.abs(exact - rows) > STEP_TOLERANCE * np.maximum(1.0, 1e-6 * exact)) | (exact < 0))
            if bad.size:
                raise InputError(
                    f"{stimulus.path}: row {bad[0] + 2}: t is {stimulus.t_s[bad[0]]:.9g} s, no whole number of steps "
                    f"of {step_s:g} s"
                )
        return cls(step_s, supply_v, tuple(timed), stimulus, rows)

    @property
    def names(self) -> tuple[str, ...]:
        """One line a fault, and one for the stimulus."""
        return (*(str(one.fault) for one in self.faults), *([str(self.stimulus)] if self.stimulus else []))

    def of_kind(self, kind: str) -> tuple[Timed, ...]:
        """The faults of a kind."""
        return tuple(one for one in self.faults if one.fault.kind == kind)

    def played(self, name: str, step: int) -> float | None:
        """Value of a stimulus' column in a step, None where it plays none."""
        if self.stimulus is None or name not in self.stimulus.values:
            return None
        row = int(np.searchsorted(self.rows, step, side="right")) - 1
        return None if row < 0 else float(self.stimulus.values[name][row])

    def played_mean(self, start: int, end: int) -> np.ndarray:
        """(2,) V: mean of the voltages that were played in the steps start to end; NaN for a side without."""
        out = np.full(2, np.nan)
        if self.stimulus is None:
            return out
        first = int(np.searchsorted(self.rows, start, side="right")) - 1
        last = int(np.searchsorted(self.rows, end, side="left"))
        if first < 0:
            return out
        edges = np.clip(np.append(self.rows[first:last], end), start, end)
        width = np.diff(edges)
        for k, name in enumerate(VOLTAGES):
            if name in self.stimulus.values:
                out[k] = float(width @ self.stimulus.values[name][first:last]) / (end - start)
        return out


def _step(name: str, time_s: float, step_s: float) -> int:
    return 0 if time_s == 0.0 else whole_steps(name, time_s, step_s)
