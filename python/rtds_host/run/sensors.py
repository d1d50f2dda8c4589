"""Sensors that do not report what is, in the signal path of a run."""

from __future__ import annotations

import bisect
import math
from collections import deque
from dataclasses import fields, replace

import numpy as np

from rtds_host.correction.correction import SensorValues
from rtds_host.correction.formed import read_with_forms
from rtds_host.run.path import Sample, SignalPath


def filtered(values: np.ndarray, before: np.ndarray, state: np.ndarray, dt_s: float, tau_s: np.ndarray) -> np.ndarray:
    """A first-order low-pass over a straight piece (2,): exact for values that move linearly from `before`."""
    out = np.array(values, dtype=float)
    for k in range(len(out)):
        tau = tau_s[k]
        if tau > 0.0 and dt_s > 0.0:
            ramp = (values[k] - before[k]) / dt_s
            out[k] = values[k] - ramp * tau + (state[k] - before[k] + ramp * tau) * math.exp(-dt_s / tau)
    return out


class CorrectedPath(SignalPath):
    """Gains, biases, filters and delay of a correction's sensors.

    `watches`: the loop has to call `watch` with the truth at every engine step, in the order of time.
    """

    def __init__(self, supply_v: float, sensors: SensorValues):
        super().__init__(supply_v)
        self.values = sensors
        self._filters = np.array(sensors.speed_filter_s)
        self._delay = sensors.delay_s
        self._speed_delays = self._delay + np.array(sensors.speed_delay_s)
        self.watches = bool(self._speed_delays.max() > 0.0 or (self._filters > 0.0).any())
        self._past: deque[tuple[float, Sample]] = deque()
        self._speeds = self._filtered = np.zeros(2)

    def watch(self, t_s: float, sample: Sample) -> None:
        """Take note of the truth, a filter's state with it."""
        if self._past:
            dt_s = t_s - self._past[-1][0]
            self._filtered = filtered(sample.speeds_rad_s, self._speeds, self._filtered, dt_s, self._filters)
        else:
            self._filtered = np.array(sample.speeds_rad_s, dtype=float)
        self._speeds = np.array(sample.speeds_rad_s, dtype=float)
        self._past.append((t_s, replace(sample, speeds_rad_s=self._filtered)))
        while len(self._past) > 2 and self._past[1][0] <= t_s - self._speed_delays.max():
            self._past.popleft()

    def _delayed(self, t_s: float, sample: Sample) -> Sample:
        """What left the sensors' inputs `delay` ago, speeds by their own delay before; before the run began, what it
        began with.
        """
        if not self.watches:
            return sample
        others = self._between(t_s, self._delay)
        speeds = [others if own == self._delay else self._between(t_s, own) for own in self._speed_delays.tolist()]
        return replace(
            others,
            speeds_rad_s=np.array([seen.speeds_rad_s[k] for k, seen in enumerate(speeds)]),
            x_m=sample.x_m,
            y_m=sample.y_m,
            yaw_rad=sample.yaw_rad,
        )

    def _between(self, t_s: float, delay_s: float) -> Sample:
        """What was there `delay_s` before, between two engine steps."""
        if delay_s <= 0.0:
            return self._past[-1][1]
        k = bisect.bisect_right(self._past, t_s - delay_s, key=lambda one: one[0])
        (t0, before), (t1, after) = self._past[max(k - 1, 0)], self._past[min(k, len(self._past) - 1)]
        share = 0.0 if t1 <= t0 else min(max((t_s - delay_s - t0) / (t1 - t0), 0.0), 1.0)
        return Sample(
            **{f.name: (1.0 - share) * getattr(before, f.name) + share * getattr(after, f.name) for f in fields(Sample)}
        )

    def sensors(self, t_s: float, sample: Sample) -> Sample:
        """What is reported. The pose is measured from outside: neither late nor wrong."""
        seen, v = self._delayed(t_s, sample), self.values
        gain = np.array(v.speed_gain)
        currents, speeds, rate = read_with_forms(
            v.forms,
            seen.currents_a * np.array(v.current_gain) + np.array(v.current_bias_a),
            seen.speeds_rad_s * gain,
            seen.gyro_rad_s * v.gyro_gain + v.gyro_bias_rad_s,
            t_s - self._delay,
        )
        return Sample(
            v_bus=seen.v_bus,
            currents_a=currents,
            speeds_rad_s=speeds,
            angles_rad=seen.angles_rad * gain,
            gyro_rad_s=rate,
            x_m=sample.x_m,
            y_m=sample.y_m,
            yaw_rad=sample.yaw_rad,
        )
