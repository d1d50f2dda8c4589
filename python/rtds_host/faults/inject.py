"""A link with faults and a stimulus at its inputs and in its motors, at an exact step.

An exchange is cut where something begins or ends, so each part has constant inputs and parameters. The parts are
ordinary exchanges of the link inside: the bit-exact model and the RTL see the same words at the same steps.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rtds_host.errors import InputError
from rtds_host.faults.script import INPUT_CHANNELS, SENSOR_CHANNELS, SIDES
from rtds_host.faults.stimulus import TORQUES, VOLTAGES
from rtds_host.faults.timeline import NEVER, Injection, Timed
from rtds_host.link import Exchange, Link
from rtds_host.link.base import Around, input_words, sample_times, whole_steps
from rtds_host.link.scaling import ADC_CHANNELS, AdcScale, default_scaling
from rtds_host.vectors import Vector


class FaultLink(Around):
    """`link` with what is injected. Everything but `exchange` and `set_parameters` goes on to it.

    Parameters
    ----------
    link : open, nothing exchanged yet. injection : what goes wrong, and when.

    Raises
    ------
    InputError : the link cannot open a motor's phase at an exact step.
    """

    def __init__(self, link: Link, injection: Injection) -> None:
        super().__init__(link)
        self.injection = injection
        self.step_s = 0.0
        self._step = 0
        self._open = injection.of_kind("phase_open")
        if self._open and not hasattr(link, "set_resistances"):
            raise InputError(f"{self._open[0].fault}: this link cannot change a motor's resistance at an exact step")
        self._lead = getattr(link, "resistance_lead_steps", 1)
        self._check_changes(getattr(link, "resistance_spacing_steps", 1))
        self._dips = injection.of_kind("supply_dip")
        adc = injection.of_kind("adc_stuck")
        self._stuck = tuple(one for one in adc if one.fault.channel not in SENSOR_CHANNELS)
        self._held: dict[Timed, float] = {}
        self._wanted: list[float | None] = [None, None]
        scales = default_scaling()
        self._scales: tuple[AdcScale, ...] = tuple(scales.channel(name) for name in ADC_CHANNELS[:4])
        # Steps before which an exchange is cut. Resistances given before a step act so many steps later.
        cuts = [at for one in (*self._dips, *self._stuck) for at in (one.start, one.end)]
        cuts += [at - self._lead for at in self._changes()]
        self._cuts = np.unique(np.array([*cuts, *injection.rows.tolist(), NEVER], np.int64))

    def _changes(self) -> list[int]:
        """Steps from which on motors have other resistances than in the step before, in order; the first is 0.

        What changes by the second step does so before the run: nothing acts in a link's very first step, which brings
        the first parameters.
        """
        return sorted({at for one in self._open for at in (one.start, one.end) if 1 < at < NEVER})

    def _check_changes(self, spacing: int) -> None:
        """Whether the link can bring each change of resistances in time; a slow line takes a while for each."""
        if not self._open or self._lead == spacing == 1:
            return
        changes = self._changes()
        if changes and changes[0] <= self._lead:
            raise InputError(
                f"{self._open[0].fault}: this link takes {self._lead} steps to change a resistance: one changes at "
                f"the run's beginning or {self._lead + 1} steps later"
            )
        for before, after in zip(changes, changes[1:]):
            if after - before < spacing:
                raise InputError(
                    f"{self._open[0].fault}: this link takes {spacing} steps from one change of a resistance to the "
                    f"next, and {after - before} are asked for at step {after}"
                )

    def __getattr__(self, name: str) -> Any:
        return getattr(self.inner, name)

    def set_parameters(self, *values: Any, **named: Any) -> None:
        """See `Link.set_parameters`."""
        self.inner.set_parameters(*values, **named)
        self.step_s = self.inner.step_s
        if self._open:
            self._set_resistances(force=True)

    def exchange(
        self,
        voltages: Vector,
        torques: Vector,
        interval_s: float,
        sample_s: float | None = None,
    ) -> Exchange:
        """See `Link.exchange`: the inputs given are those without faults."""
        v, t = input_words("voltages", voltages), input_words("torques", torques)
        steps = whole_steps("interval_s", interval_s, self.step_s)
        every = steps if sample_s is None else whole_steps("sample_s", sample_s, self.step_s)
        begin, end = self._step, self._step + steps
        first = int(np.searchsorted(self._cuts, begin, side="right"))
        last = int(np.searchsorted(self._cuts, end, side="left"))
        marks = [begin, *self._cuts[first:last].tolist(), end]
        parts: list[tuple[np.ndarray, np.ndarray]] = []
        for a, b in zip(marks, marks[1:]):
            self._step = a
            if self._open:
                self._set_resistances()
            inputs = self._inputs(v, t, a)
            parts += self._part(inputs, a - begin, b - begin, steps, every)
        self._step = end
        return Exchange(
            sample_times(steps, every, self.step_s),
            np.concatenate([speeds for speeds, _ in parts]),
            np.concatenate([currents for _, currents in parts]),
        )

    def _part(
        self, inputs: tuple[np.ndarray, np.ndarray], a: int, b: int, steps: int, every: int
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Steps a to b of an exchange of `steps`: speeds and currents where the whole exchange has samples."""
        found = []
        # To the next sample of the whole exchange, then as one exchange of its own.
        lead = min(-a % every, b - a)
        for at, to in ((a, a + lead), (a + lead, b)):
            if at == to:
                continue
            volts, torques = (values.tolist() for values in inputs)
            got = self.inner.exchange(volts, torques, (to - at) * self.step_s, min(every, to - at) * self.step_s)
            wanted = to % every == 0 or to == steps
            count = len(got.t_s) if wanted else len(got.t_s) - 1
            found.append((got.speeds[:count], got.currents[:count]))
        return found

    def _inputs(self, v: np.ndarray, t: np.ndarray, step: int) -> tuple[np.ndarray, np.ndarray]:
        """Inputs (2,) float32 V and N m that act from a step on: played, then the dip, then stuck codes."""
        v, t = v.copy(), t.copy()
        for k in range(2):
            volts = self.injection.played(VOLTAGES[k], step)
            if volts is not None:
                v[k] = np.clip(volts, -self.injection.supply_v, self.injection.supply_v)
            torque = self.injection.played(TORQUES[k], step)
            if torque is not None:
                t[k] += np.float32(torque)
        for dip in self._dips:
            if dip.acts(step):
                v *= np.float32(dip.fault.volts / self.injection.supply_v)
        for stuck in self._stuck:
            if stuck.acts(step):
                which = INPUT_CHANNELS.index(stuck.fault.channel)
                values = v if which < 2 else t
                if stuck not in self._held:
                    scale = self._scales[which]
                    code = stuck.fault.code
                    code = int(scale.encode(float(values[which % 2]))) if code is None else code
                    self._held[stuck] = float(scale.decode(code))
                values[which % 2] = self._held[stuck]
        return v, t

    def _set_resistances(self, force: bool = False) -> None:
        """Give the motors the resistances of the step in which a change made now acts, where they change there.

        force : before the run; those of its second step, the first in which parameters act.
        """
        wanted: list[float | None] = [None, None]
        for one in self._open:
            if one.acts(1 if force else self._step + self._lead):
                wanted[SIDES.index(one.fault.side)] = one.fault.resistance_ohm
        if force or wanted != self._wanted:
            self._wanted = wanted
            self.inner.set_resistances((wanted[0], wanted[1]))  # type: ignore[attr-defined]
