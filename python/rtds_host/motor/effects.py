"""What makes a motor unit differ from the ideal one, as the effect unit takes it.

Everything is SI at the **motor shaft**. The default of every field is "absent": a unit of which all is absent computes
what it computes without an effect unit, bit for bit. What the fields do in a step: docs/effect-unit.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from rtds_host.errors import InputError

FULL_TURN = 2.0 * math.pi
MAX_POINTS = 4096
# Roundings of degrees or revolutions into 2 pi: what an angle may lie beyond the full turn.
_TURN_SLACK = 1e-9


@dataclass(frozen=True)
class MotorParameters:
    """One side's own motor constants, at the motor shaft; each greater than zero."""

    resistance_ohm: float
    inductance_h: float
    torque_constant_nm_per_a: float
    back_emf_constant_v_s_per_rad: float
    rotor_inertia_kg_m2: float
    viscous_friction_nm_s_per_rad: float

    def __post_init__(self) -> None:
        """Raises InputError: a value is not finite, zero or negative."""
        for entry in fields(self):
            value = getattr(self, entry.name)
            _finite(f"motor: {entry.name}", value)
            if value <= 0.0:
                raise InputError(f"motor: {entry.name}: {value:g} must be greater than zero")

    @property
    def values(self) -> tuple[float, ...]:
        """(6,) in the order of `Link.set_parameters`."""
        return tuple(float(getattr(self, entry.name)) for entry in fields(self))


@dataclass(frozen=True)
class Curve:
    """Piecewise linear y(x): linear between the points, the value of the last point beyond either end.

    Two points of equal x are a jump; at x itself the value is that of the second of them. A single point is a
    constant.

    Attributes
    ----------
    x : (n,) ascending, finite.
    y : (n,) finite.
    """

    x: tuple[float, ...]
    y: tuple[float, ...]

    def __post_init__(self) -> None:
        """Raises InputError: no points, x and y of unlike length, not ascending, NaN, or three points of equal x."""
        object.__setattr__(self, "x", tuple(float(value) for value in self.x))
        object.__setattr__(self, "y", tuple(float(value) for value in self.y))
        if not self.x or len(self.x) != len(self.y):
            raise InputError(f"curve: {len(self.x)} points of x and {len(self.y)} of y, as many of both are needed")
        if len(self.x) > MAX_POINTS:
            raise InputError(f"curve: {len(self.x)} points, at most {MAX_POINTS} are taken")
        for name, values in (("x", self.x), ("y", self.y)):
            for k, value in enumerate(values):
                _finite(f"curve: {name}[{k}]", value)
        for k in range(1, len(self.x)):
            if self.x[k] < self.x[k - 1]:
                raise InputError(f"curve: x[{k}] = {self.x[k]:g} is less than x[{k - 1}] = {self.x[k - 1]:g}")
            if k > 1 and self.x[k] == self.x[k - 2]:
                raise InputError(f"curve: three points at x = {self.x[k]:g}, a jump has two")

    def at(self, x: float) -> float:
        """The value at x, in float64."""
        return self._value(float(x), after=True)

    def before(self, x: float) -> float:
        """The value just below x: differs from `at` where there is a jump."""
        return self._value(float(x), after=False)

    def _value(self, x: float, after: bool) -> float:
        xs, ys = self.x, self.y
        if x > xs[-1] or (x == xs[-1] and after):
            return ys[-1]
        if x < xs[0] or (x == xs[0] and not after):
            return ys[0]
        # The segment k..k+1 with xs[k] <= x < xs[k+1] (after), or xs[k] < x <= xs[k+1] (before).
        k = max(j for j in range(len(xs)) if (xs[j] <= x if after else xs[j] < x))
        return ys[k] + (ys[k + 1] - ys[k]) * ((x - xs[k]) / (xs[k + 1] - xs[k]))


@dataclass(frozen=True)
class UnitEffects:
    """The effects of one motor unit.

    Attributes
    ----------
    motor : this side's own constants; None: those of `set_parameters`.
    command : V asked for -> V of the bridge at the nominal bus (dead zone, gain).
    limit_v : V, |V| at the terminals never exceeds it; infinite: no limit.
    drop : A -> V subtracted (bridge and brushes).
    friction_forward, friction_backward : |rad/s| -> N·m, torque of dry friction against turning forward and against
        turning backward; both or neither. At rest the shaft is held by what it needs, up to the levels at zero speed (a
        negative level holds nothing: it drives a shaft that turns that way).
    torque : rad/s -> N·m against positive speed (viscous, asymmetric viscous): smooth, does not hold at rest.
    load_share : share c of the torque that a gear loses: the level of dry friction grows by c / (1 - c) |T| for a
        motion against the load torque T (the torque before the loss is T / (1 - c)), by c |T| for one with it.
    ripple : angle in [0, 2 pi] of one period -> N·m that drives the motor forward.
    ripple_periods_per_rad : periods a radian of the motor shaft.
    ripple_start_rad : the angle, of a period, at which a run begins.
    heat_rise_per_w, heat_tau_s : relative rise of the resistance in the steady state for each watt of copper loss,
        and the time constant, s, with which it is reached.
    """

    motor: MotorParameters | None = None
    command: Curve | None = None
    limit_v: float = math.inf
    drop: Curve | None = None
    friction_forward: Curve | None = None
    friction_backward: Curve | None = None
    torque: Curve | None = None
    load_share: float = 0.0
    ripple: Curve | None = None
    ripple_periods_per_rad: float = 0.0
    ripple_start_rad: float = 0.0
    heat_rise_per_w: float = 0.0
    heat_tau_s: float = math.inf

    def __post_init__(self) -> None:
        """Raises InputError: names the field that cannot be meant."""
        if math.isnan(self.limit_v) or self.limit_v < 0.0:
            raise InputError(f"limit_v: {self.limit_v:g} must be zero or greater")
        if (self.friction_forward is None) != (self.friction_backward is None):
            raise InputError("friction_forward, friction_backward: one of them is absent, give both or neither")
        for name in ("friction_forward", "friction_backward"):
            curve = getattr(self, name)
            if curve is not None and curve.x[0] < 0.0:
                raise InputError(f"{name}: a point at {curve.x[0]:g} rad/s, the curve is of the size of the speed")
        _finite("load_share", self.load_share)
        if not 0.0 <= self.load_share < 1.0:
            raise InputError(f"load_share: {self.load_share:g} must be at least 0 and less than 1")
        if self.ripple is not None and not (
            self.ripple.x[0] >= 0.0 and self.ripple.x[-1] <= FULL_TURN * (1.0 + _TURN_SLACK)
        ):
            raise InputError(
                f"ripple: angles from {self.ripple.x[0]:g} to {self.ripple.x[-1]:g} rad, one period from 0 to 2 pi is"
                " taken"
            )
        _finite("ripple_periods_per_rad", self.ripple_periods_per_rad)
        _finite("ripple_start_rad", self.ripple_start_rad)
        if self.ripple is not None and self.ripple_periods_per_rad <= 0.0:
            raise InputError(f"ripple_periods_per_rad: {self.ripple_periods_per_rad:g} must be greater than zero")
        _finite("heat_rise_per_w", self.heat_rise_per_w)
        if self.heat_rise_per_w < 0.0:
            raise InputError(f"heat_rise_per_w: {self.heat_rise_per_w:g} must be zero or greater")
        if math.isnan(self.heat_tau_s) or self.heat_tau_s <= 0.0:
            raise InputError(f"heat_tau_s: {self.heat_tau_s:g} s must be greater than zero")

    @property
    def plain(self) -> bool:
        """At most the motor's own parameters differ from the ideal motor unit."""
        curves = (self.command, self.drop, self.friction_forward, self.torque, self.ripple)
        return not any(curves) and math.isinf(self.limit_v) and not (self.load_share or self.heat_rise_per_w)

    @property
    def absent(self) -> bool:
        """Nothing differs from the ideal motor unit."""
        return self.plain and self.motor is None


@dataclass(frozen=True)
class SupplyEffects:
    """What both motor units share.

    Attributes
    ----------
    voltage_v : nominal voltage of the bus, at which a command stands for itself; needed for sag and decline, for which
        the bridge's voltage is command · bus / voltage_v.
    source_resistance_ohm : the bus sags by it times the current drawn, the sum of i · command / voltage_v.
    decline_v_per_s : the bus falls by it, from the start of the run.
    command_delay_s : s, a whole number of steps; commands reach the bridge so much later.
    """

    voltage_v: float = math.inf
    source_resistance_ohm: float = 0.0
    decline_v_per_s: float = 0.0
    command_delay_s: float = 0.0

    def __post_init__(self) -> None:
        """Raises InputError: names the field that cannot be meant."""
        if math.isnan(self.voltage_v) or self.voltage_v <= 0.0:
            raise InputError(f"voltage_v: {self.voltage_v:g} must be greater than zero")
        for name in ("source_resistance_ohm", "decline_v_per_s", "command_delay_s"):
            _finite(name, getattr(self, name))
        for name in ("source_resistance_ohm", "command_delay_s"):
            if getattr(self, name) < 0.0:
                raise InputError(f"{name}: {getattr(self, name):g} must be zero or greater")
        if (self.source_resistance_ohm or self.decline_v_per_s) and math.isinf(self.voltage_v):
            raise InputError("voltage_v: sag and decline need the nominal voltage of the bus")

    @property
    def absent(self) -> bool:
        """Nothing differs from an ideal supply."""
        return not (self.source_resistance_ohm or self.decline_v_per_s or self.command_delay_s)


def _finite(name: str, value: float) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{name}: {value!r} is not a number")
    if not math.isfinite(value):
        raise InputError(f"{name}: {value} is not a finite number")
