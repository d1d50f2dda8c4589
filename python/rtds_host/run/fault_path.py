"""Faults of the sensors, in the signal path of a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rtds_host.faults.script import SENSOR_CHANNELS, SIDES
from rtds_host.faults.timeline import Injection, Timed
from rtds_host.link.scaling import DacScale, default_scaling
from rtds_host.run.path import Sample, SignalPath

_OUTPUTS = ("i_l", "i_r")


class FaultPath(SignalPath):
    """A signal path whose sensors have the faults of an injection; everything else goes on to `path`.

    A stuck encoder counts no more: its angle stays, its speed reads zero. What it has missed is lost, so after the
    fault the angle goes on from where it stuck. A stuck current sensor repeats its code. A dip of the supply shows
    in the bus' voltage, unless it is not measured.
    """

    watches = True

    def __init__(self, path: SignalPath, injection: Injection):
        super().__init__(path.supply_v)
        self.path, self.injection = path, injection
        self._encoders = injection.of_kind("encoder_stuck")
        self._adc = tuple(one for one in injection.of_kind("adc_stuck") if one.fault.channel in SENSOR_CHANNELS)
        self._dips = tuple(one for one in injection.of_kind("supply_dip") if one.fault.measured)
        self._at_start: dict[Timed, Sample] = {}
        self._at_end: dict[Timed, Sample] = {}
        self._past: tuple[float, Sample] | None = None
        scales = default_scaling()
        self._scales: tuple[DacScale, ...] = tuple(scales.output(name) for name in _OUTPUTS)

    def watch(self, t_s: float, sample: Sample) -> None:
        """Take note of the truth, and of it at the very step in which a fault begins or ends."""
        if self.path.watches:
            self.path.watch(t_s, sample)
        for one in (*self._encoders, *self._adc):
            for step, kept in ((one.start, self._at_start), (one.end, self._at_end)):
                at = step * self.injection.step_s
                if one not in kept and at <= t_s + 0.5 * self.injection.step_s:
                    kept[one] = self._between(at, t_s, sample)
        self._past = (t_s, sample)

    def _between(self, at: float, t_s: float, sample: Sample) -> Sample:
        """Angles and currents at a time between the last look and this one, as they would be in a straight line."""
        if self._past is None or t_s <= self._past[0]:
            return sample
        before, share = self._past[1], (at - self._past[0]) / (t_s - self._past[0])
        share = min(max(share, 0.0), 1.0)

        def mean(a: np.ndarray, b: np.ndarray) -> np.ndarray:
            return a + share * (b - a)

        return replace(
            sample,
            angles_rad=mean(before.angles_rad, sample.angles_rad),
            currents_a=mean(before.currents_a, sample.currents_a),
        )

    def voltages(self, t_s: float, commanded_v: np.ndarray, sample: Sample) -> np.ndarray:
        """See `SignalPath.voltages`."""
        return self.path.voltages(t_s, commanded_v, sample)

    def loads(self, t_s: float, torques_nm: np.ndarray, sample: Sample) -> np.ndarray:
        """See `SignalPath.loads`."""
        return self.path.loads(t_s, torques_nm, sample)

    def wheels(self, speeds_rad_s: np.ndarray, torques_nm: np.ndarray) -> np.ndarray:
        """See `SignalPath.wheels`."""
        return self.path.wheels(speeds_rad_s, torques_nm)

    def sensors(self, t_s: float, sample: Sample) -> Sample:
        """See `SignalPath.sensors`."""
        seen = self.path.sensors(t_s, sample)
        step = round(t_s / self.injection.step_s)
        speeds, angles, currents = (
            np.array(x, dtype=float) for x in (seen.speeds_rad_s, seen.angles_rad, seen.currents_a)
        )
        for one in reversed(self._encoders):
            side = SIDES.index(one.fault.side)
            if one.start > step:
                continue
            # An encoder has a gain of its own in the path: the same share of what it missed is missing.
            gain = seen.angles_rad[side] / sample.angles_rad[side] if sample.angles_rad[side] else 1.0
            start = self._at_start[one].angles_rad[side]
            if one.acts(step):
                speeds[side] = 0.0
                angles[side] = gain * start
            else:
                angles[side] -= gain * (self._at_end[one].angles_rad[side] - start)
        for one in self._adc:
            if one.acts(step):
                side = SENSOR_CHANNELS.index(one.fault.channel)
                code = one.fault.code
                if code is None:
                    code = int(self._scales[side].encode(self._at_start[one].currents_a[side])[0])
                currents[side] = float(self._scales[side].decode(code))
        bus = seen.v_bus
        for one in self._dips:
            if one.acts(step):
                bus *= one.fault.volts / self.injection.supply_v
        return replace(seen, v_bus=bus, speeds_rad_s=speeds, angles_rad=angles, currents_a=currents)
