"""What an effect is: everything the program knows of it, in one place."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from rtds_host.contract import Case, Robot
from rtds_host.contract.robot import Axis
from rtds_host.diagnosis.effects.exported import How
from rtds_host.diagnosis.replay.model import Model, nominal_model
from rtds_host.diagnosis.scales import Scales
from rtds_host.plant.schema import COMMON, SIDE

SIDES = {"both": (0, 1), "left": (0,), "right": (1,)}


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    scale : what of a machine (an attribute of `Scales`) null, low, high, spread and starts are shares of; `on` makes
    them SI. least : the scale below whose negative it cannot fall; most : the one that it cannot exceed; reach : the
    one that the upper bound is raised to, where that is larger; floor : what it cannot fall below on any machine, in
    SI. null : value at which the effect is absent; low, high : bounds; spread : one sigma of what is met in practice,
    about `null` (sets the price of a free parameter); starts : values to start a fit from; difference : step of a
    derivative, in spreads;
    optional : a diagnosis may leave it out, it is `null` then; shape : it gives the effect's form, not its size; switch
    : a fit that starts without it never takes it up, so its starts are modes of the effect; bench : looked for on
    a single axis that is driven by voltage or speed alone; steep
    : by it steps of a signal come late, and a misfit falls only near its right value; of : the value of robot.toml that
    it is a factor of, as "table.key"; declared : by the kind of a single axis, the value of `[axis]` that it adds to,
    and its unit: a fit then works in shares of that value, since loads of axes span many orders of magnitude.
    """

    name: str
    unit: str
    null: float
    low: float
    high: float
    prior_width: float
    starts: tuple[float, ...]
    meaning: str = ""
    difference: float = 0.01
    optional: bool = False
    shape: bool = False
    switch: bool = False
    bench: bool = False
    steep: bool = False
    of: str = ""
    declared: Mapping[str, tuple[str, str]] | None = None
    scale: str = "one"
    least: str = ""
    most: str = ""
    reach: str = ""
    floor: float = -math.inf

    def on(self, scales: Scales) -> Parameter:
        """The same in SI on a machine."""
        unit = getattr(scales, self.scale)
        low = max(unit * self.low, -getattr(scales, self.least)) if self.least else unit * self.low
        low = max(low, self.floor)
        high = min(unit * self.high, getattr(scales, self.most)) if self.most else unit * self.high
        starts = tuple(unit * start for start in self.starts)
        if self.reach and getattr(scales, self.reach) > high:
            high = getattr(scales, self.reach)
        return replace(
            self,
            scale="one",
            least="",
            most="",
            reach="",
            floor=-math.inf,
            null=unit * self.null,
            low=low,
            high=high,
            prior_width=unit * self.prior_width,
            starts=tuple(min(max(start, low), high) for start in starts),
        )

    @property
    def logarithmic(self) -> bool:
        """Whether it is searched by its logarithm: a factor that cannot change its sign, as the nuisances' are."""
        return self.null == 1.0 and self.low > 0.0

    def value(self, u: float) -> float:
        """The value at `u` spreads from absent, within its bounds."""
        plain = self.null * math.exp(self.prior_width * u) if self.logarithmic else self.null + self.prior_width * u
        return min(max(plain, self.low), self.high)

    def scaled(self, value: float) -> float:
        """The inverse of `value`."""
        return math.log(value) / self.prior_width if self.logarithmic else (value - self.null) / self.prior_width

    def slope(self, value: float) -> float:
        """Change of the value by one spread, about a value."""
        return self.prior_width * value if self.logarithmic else self.prior_width

    def reported(self, axis: Axis | None) -> tuple[str, str, float]:
        """Name, unit and what one unit of the fit is in it, on this machine."""
        if axis is None or self.declared is None:
            return self.name, self.unit, 1.0
        name, unit = self.declared[axis.kind]
        return name, unit, getattr(axis, name)


# Numerical: how far a bound moves when it is written to four digits or more, and how near to a bound, in prior widths,
# a fit may end that leads there.
WRITTEN, AT_END = 1e-4, 0.01


def inside(value: float, low: float, high: float) -> float | None:
    """The value where it is within the bounds, the bound where it is that one as written in a report, else None."""
    held = min(max(value, low), high)
    return held if abs(value - held) <= WRITTEN * abs(held) else None


# Parameters of another effect from one's own, `existing` those that it has already; None where there are no such.
Conversion = Callable[..., dict[str, float] | None]
# Whether the runs of a case lack what would distinguish two effects, see `rtds_host.diagnosis.conditions`.
Condition = Callable[[Case], bool]


@dataclass(frozen=True)
class Effect:
    """One unmodelled effect of the catalogue.

    apply(model, sides, values) puts it into a replay's model. `nuisance` marks a ratio that is no cause within 3 %
    of 1 (contract, section 2). `axis`: it exists on a single axis. `contains`: effects it turns into when its further
    parameters rest. `separate`: each parameter is a part of its own, absent where only
    another one is there. `nonlinear`: its signature changes its form with its size, and with what the other side does.
    `periodic`: its first parameters are amplitude, cycles a turn and phase. `scales`: what its first parameter
    multiplies, "command" or channels without side; a curve that does so too, by about as much everywhere, counts.
    `rough`: its misfit has many minima.
    `without_winding`: it exists on a machine whose torque is commanded. `before_loop`: it acts before a loop on the
    speed, which a robot in speed mode alone has. `exports`: how each target of `rtds export` has it (`exported.row`);
    `exports_behind_servo`: the same by target where a robot in speed mode has it otherwise; `exports_dcmotor`: the
    same where MuJoCo's own motor has it otherwise; `exports_as`: another
    effect whose parameters of the plant it writes, and whose `exports` it has.
    `gives`: the wheel may turn next to the gear with it, so that it matters where the encoder sits.
    `compared_at`: sizes in SI at which simulator and replay are compared, where the middle start would not be met;
    `agrees_within`: a wider bound on their difference, in units of noise, and its reason; of an effect with switches
    where one is on. `check`: a measurement by hand that shows this effect and none of `confused_with`; `advice`: what
    to do once it is shown. `seen_by`:
    channels (without side) of which one must be logged. `runs_in` says where it acts in the real-time simulator: "rtl",
    "robot", "signal", or "refused" where it has no such robot. `restarts`: parameters to fit from as well, where the
    misfit has more than one minimum; `starts_in_loop`: parameters to take signatures at as well in speed mode, where
    the loop bends what they do. `form`: what share of its size formulations of it differ by, one sigma: next to
    nothing where a definition or a law stands behind it, more where a model of friction or contact does. `former`:
    parameters that earlier diagnoses hold, and the two whose quotient each was: the present one's name, and the one it
    was divided by. `approximated_by`: other effects that do most of what it does, and with which parameters,
    where no screening shows it: a spring in front of the wheel, and one behind it.
    `resembles`: forms that it may be behind, as (term, quantity it runs over).
    `same_as`: effects that make the same replays on runs that meet a condition; only one of them is ever in an
    explanation. `same_with_friction`: likewise where the explanation has `friction`, dry or viscous, that no data sheet
    states. `nearly_as`: effects that make nearly the same replays then. All three are mutual.
    """

    id: str
    subsystem: str
    sided: bool
    parameters: tuple[Parameter, ...]
    apply: Callable[[Model, tuple[int, ...], Mapping[str, float]], None]
    equation: str
    source: str
    confused_with: tuple[str, ...]
    shown_by: str
    check: str
    advice: str
    runs_in: str
    nuisance: bool = False
    axis: bool = True
    contains: tuple[str, ...] = ()
    separate: bool = False
    nonlinear: bool = False
    periodic: bool = False
    scales: tuple[str, ...] = ()
    rough: bool = False
    without_winding: bool = True
    gives: bool = False
    before_loop: bool = False
    exports: Mapping[str, How] = field(default_factory=dict)
    exports_behind_servo: Mapping[str, How] = field(default_factory=dict)
    exports_dcmotor: How | None = None
    exports_as: str = ""
    resembles: tuple[tuple[str, str], ...] = ()
    compared_at: Mapping[str, float] = field(default_factory=dict)
    agrees_within: tuple[float, str] | None = None
    seen_by: tuple[str, ...] = ()
    restarts: tuple[Mapping[str, float], ...] = ()
    starts_in_loop: tuple[Mapping[str, float], ...] = ()
    form: float = 0.001
    former: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    approximated_by: Mapping[str, Conversion] = field(default_factory=dict)
    same_as: Mapping[str, Condition] = field(default_factory=dict)
    same_with_friction: Mapping[str, Condition] = field(default_factory=dict)
    nearly_as: Mapping[str, Condition] = field(default_factory=dict)
    friction: bool = False

    @property
    def sides(self) -> tuple[str, ...]:
        """Sides it can have, in the contract's words."""
        return ("both", "left", "right") if self.sided else ("both",)

    def on(self, scales: Scales) -> Effect:
        """The same with its numbers in SI on a machine."""
        units = {p.name: getattr(scales, p.scale) for p in self.parameters}
        return replace(
            self,
            parameters=tuple(p.on(scales) for p in self.parameters),
            approximated_by={other: partial(like, scales=scales) for other, like in self.approximated_by.items()},
            restarts=tuple({name: units[name] * value for name, value in start.items()} for start in self.restarts),
        )

    def off_bench(self) -> Effect:
        """The same, with what is looked for on a bench alone absent at its starts."""
        return replace(self, parameters=tuple(replace(p, starts=(p.null,)) if p.bench else p for p in self.parameters))

    @property
    def steep(self) -> bool:
        """Whether its misfit falls only near the right size (steps of a signal that come late)."""
        return self.parameters[0].steep

    @property
    def sized(self) -> bool:
        """Whether a number, its size, moves its replay along a straight line."""
        return not (self.nonlinear or self.separate or self.periodic)

    def sizes(self, values: Mapping[str, float], factors: Iterable[float]) -> list[dict[str, float]]:
        """Parameters with its size multiplied by each factor, within its bounds."""
        p = self.parameters[0]
        return [{**values, p.name: min(max(factor * values[p.name], p.low), p.high)} for factor in factors]

    def scaled(self, values: Mapping[str, float]) -> np.ndarray:
        """Its parameters as a fit has them, (n,), from their values in SI."""
        return np.array([p.scaled(values[p.name]) for p in self.parameters])

    def mode(self, values: Mapping[str, float]) -> tuple[bool, ...]:
        """Which of its switches are on, by values in SI."""
        return tuple(values[p.name] != p.null for p in self.parameters if p.switch)

    def within(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values of all its parameters within their bounds, SI; of one that is missing its first start."""
        return {p.name: min(max(values.get(p.name, p.starts[0]), p.low), p.high) for p in self.parameters}

    def at_its_bound(self, values: Mapping[str, float]) -> bool:
        """Whether a parameter lies at an end of what was looked at, its absence left out, or closer to it than a fit
        comes.

        The end at which a parameter is absent is none of these.
        """
        for p in self.parameters:
            value = p.scaled(values[p.name])
            if value >= p.scaled(p.high) - AT_END or (p.low != p.null and value <= p.scaled(p.low) + AT_END):
                return True
        return False

    def absent(self, values: Mapping[str, float], robot: Robot) -> bool:
        """Whether the effect at this size changes nothing of a nominal robot."""
        if all(values[p.name] != p.null for p in self.parameters):
            return False
        model = nominal_model(robot)
        before = model.copy()
        self.apply(model, (0, 1), values)
        return bool(np.array_equal(model.side, before.side) and np.array_equal(model.common, before.common))

    def written(self, robot: Robot) -> set[str]:
        """Parameters of the plant (`rtds_host.plant.schema`) that it changes in a nominal robot."""
        model = nominal_model(robot)
        before = model.copy()
        self.apply(model, (0, 1), {p.name: p.starts[0] for p in self.parameters})
        found = {name for name, row, old in zip(SIDE, model.side.T, before.side.T) if (row != old).any()}
        return found | {name for name, value, old in zip(COMMON, model.common, before.common) if value != old}

    def side_on(self, axis: Axis | None, side: str) -> str:
        """The side as a report names it: a single axis has one (contract, section 7)."""
        return side if axis is None else "left"


def scale(quantity: str, parameter: str = "ratio") -> Callable:
    """An effect that multiplies one entry of the model."""

    def apply(model: Model, sides: tuple[int, ...], values: Mapping[str, float]) -> None:
        model.scale(quantity, values[parameter], sides)

    return apply


def add(**quantities: str) -> Callable:
    """An effect that adds parameters to entries of the model: entry = parameter's name."""

    def apply(model: Model, sides: tuple[int, ...], values: Mapping[str, float]) -> None:
        for quantity, parameter in quantities.items():
            model.add(quantity, values[parameter], sides)

    return apply


def put(**quantities: str) -> Callable:
    """An effect that sets entries of the model: entry = parameter's name."""

    def apply(model: Model, sides: tuple[int, ...], values: Mapping[str, float]) -> None:
        for quantity, parameter in quantities.items():
            model.put(quantity, values[parameter], sides)

    return apply
