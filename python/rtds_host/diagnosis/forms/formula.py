"""A formula for a form's curve: the simplest of a few that closes nearly all of what the curve closes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rtds_host.diagnosis.forms.curves import SPACING, Form, shapes
from rtds_host.diagnosis.thresholds import MINOR_SHARE, Z90
from rtds_host.plant import forms as plant

# What a formula must close of what the curve closes: all but a slight part.
ENOUGH = 1.0 - MINOR_SHARE
# Numerical: gaps that are computed to find the place of a jump.
MOST_TRIALS = 40
# Numerical: sizes from which a bend of a formula is fitted, in shares of the range, and powers of it.
SCALES, POWERS = (0.1, 0.25, 0.5, 1.0), (0.5, 2.0, 3.0)


@dataclass(frozen=True)
class Law:
    """A formula: `text` of x; `names` and `units` of its parameters (x, y: the units of the axes); of(x, values) its
    values; `starts` of those that enter it bent, in shares of the range where their unit is x's; `jumps_at`: the
    parameter that is the place of a jump; `nothing_beyond`: whether it is zero beyond that place, on both sides."""

    text: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    of: Callable[..., np.ndarray]
    starts: tuple[tuple[float, ...], ...] = ((),)
    jumps_at: str | None = None
    nothing_beyond: bool = False


def _scaled(*each: float) -> tuple[tuple[float, ...], ...]:
    return tuple((one,) for one in each)


_ODD = (
    Law("a·sgn(x)", ("a",), ("y",), lambda x, a: a * np.sign(x)),
    Law("a·x", ("a",), ("y/x",), lambda x, a: a * x),
    Law("a·x·|x|", ("a",), ("y/x²",), lambda x, a: a * x * np.abs(x)),
    Law("a·|x|", ("a",), ("y/x",), lambda x, a: a * np.abs(x)),
    Law("a·x²", ("a",), ("y/x²",), lambda x, a: a * x**2),
    Law("a·sgn(x) + b·x", ("a", "b"), ("y", "y/x"), lambda x, a, b: a * np.sign(x) + b * x),
    Law("a·x + b·x·|x|", ("a", "b"), ("y/x", "y/x²"), lambda x, a, b: a * x + b * x * np.abs(x)),
    Law(
        "a·tanh(x/b)",
        ("a", "b"),
        ("y", "x"),
        lambda x, a, b: a * np.tanh(x / b),
        _scaled(*SCALES),
    ),
    Law(
        "a·sgn(x)·exp(-|x|/b)",
        ("a", "b"),
        ("y", "x"),
        lambda x, a, b: a * np.sign(x) * np.exp(-np.abs(x / b)),
        _scaled(*SCALES),
    ),
    Law(
        "a·x·exp(-|x|/b)",
        ("a", "b"),
        ("y/x", "x"),
        lambda x, a, b: a * x * np.exp(-np.abs(x / b)),
        _scaled(*SCALES),
    ),
    Law(
        "a·sgn(x)·|x|^p",
        ("a", "p"),
        ("y", "1"),
        lambda x, a, p: a * np.sign(x) * np.abs(x) ** p,
        _scaled(*POWERS),
    ),
    Law(
        "a·sgn(x)·(1 - exp(-|x|/b))",
        ("a", "b"),
        ("y", "x"),
        lambda x, a, b: a * np.sign(x) * (1.0 - np.exp(-np.abs(x / b))),
        _scaled(*SCALES),
    ),
)
# Numerical: how sharp a change of law at a place is, in shares of a curve's range: less than the distance of two knots.
_SHARP = 240.0


def _within(x: np.ndarray, place: float) -> np.ndarray:
    """1 where |x| is below a place and 0 beyond, smooth enough that a fit finds the place."""
    return 1.0 / (1.0 + np.exp(np.clip((np.abs(x) - place) * _SHARP / np.ptp(x), -60.0, 60.0)))


# What changes at a size of x: readings that are cut off above it or read nothing below it, free play.
_PLACES = (
    Law(
        "a·x for |x| < b",
        ("a", "b"),
        ("y/x", "x"),
        lambda x, a, b: a * x * _within(x, b),
        _scaled(0.25, 0.5, 0.75, 0.9),
        jumps_at="b",
        nothing_beyond=True,
    ),
    Law(
        "a·(x - b·sgn(x)) for |x| > b",
        ("a", "b"),
        ("y/x", "x"),
        lambda x, a, b: a * np.sign(x) * np.maximum(np.abs(x) - np.abs(b), 0.0),
        _scaled(0.25, 0.5, 0.75),
    ),
)
# Over a command's history: x is the command, and ẋ its last change. Curves are of the command's size, negative while
# it falls, and act along the command: a sign there is that of ẋ here.
_LOOPS = (
    Law("a·sgn(ẋ)", ("a",), ("y",), lambda x, a: a * np.sign(x)),
    Law("a·|x|·sgn(ẋ)", ("a",), ("y/x",), lambda x, a: a * x),
    Law("a·x + b·sgn(ẋ)", ("a", "b"), ("y/x", "y"), lambda x, a, b: a * np.abs(x) + b * np.sign(x)),
    Law("a·x + b·|x|·sgn(ẋ)", ("a", "b"), ("y/x", "y/x"), lambda x, a, b: a * np.abs(x) + b * x),
    Law(
        "a·sgn(ẋ)·exp(-|x|/b)",
        ("a", "b"),
        ("y", "x"),
        lambda x, a, b: a * np.sign(x) * np.exp(-np.abs(x / b)),
        _scaled(*SCALES),
    ),
    Law(
        "a·sgn(ẋ)·(1 - exp(-|x|/b))",
        ("a", "b"),
        ("y", "x"),
        lambda x, a, b: a * np.sign(x) * (1.0 - np.exp(-np.abs(x / b))),
        _scaled(*SCALES),
    ),
)
# Over a gear's load: losses along the motion, driving and driven.
_LOSSES = (
    Law("a·|x|", ("a",), ("y/x",), lambda x, a: a * np.abs(x)),
    Law("a·x²", ("a",), ("y/x²",), lambda x, a: a * x**2),
    Law("a·|x| + b·x", ("a", "b"), ("y/x", "y/x"), lambda x, a, b: a * np.abs(x) + b * x),
    Law("a·|x|^p", ("a", "p"), ("y", "1"), lambda x, a, p: a * np.abs(x) ** p, _scaled(*POWERS)),
    Law(
        "a·(1 - exp(-|x|/b))",
        ("a", "b"),
        ("y", "x"),
        lambda x, a, b: a * (1.0 - np.exp(-np.abs(x / b))),
        _scaled(*SCALES),
    ),
)
# Over a heat: nothing without one. What protects itself does so from a heat on.
_WARM = (
    Law("a·x", ("a",), ("y/x",), lambda x, a: a * x),
    Law("a·x²", ("a",), ("y/x²",), lambda x, a: a * x**2),
    Law("a·(1 - exp(-x/b))", ("a", "b"), ("y", "x"), lambda x, a, b: a * (1.0 - np.exp(-x / b)), _scaled(*SCALES)),
    Law(
        "a·(x - b) for x > b",
        ("a", "b"),
        ("y/x", "x"),
        lambda x, a, b: a * np.maximum(x - np.abs(b), 0.0),
        _scaled(0.25, 0.5, 0.75),
    ),
)
_EVEN = (
    Law("a", ("a",), ("y",), lambda x, a: a + 0.0 * x),
    Law("a·x", ("a",), ("y/x",), lambda x, a: a * x),
    Law("a + b·x", ("a", "b"), ("y", "y/x"), lambda x, a, b: a + b * x),
    Law("a·x·|x|", ("a",), ("y/x²",), lambda x, a: a * x * np.abs(x)),
    Law("a·x²", ("a",), ("y/x²",), lambda x, a: a * x**2),
    Law("a·tanh(x/b)", ("a", "b"), ("y", "x"), lambda x, a, b: a * np.tanh(x / b), _scaled(*SCALES)),
    Law("a·(1 - exp(-x/b))", ("a", "b"), ("y", "x"), lambda x, a, b: a * (1.0 - np.exp(-x / b)), _scaled(*SCALES)),
)
# A step at a place keeps its place within the range.
_STEP = Law(
    "a for x > b",
    ("a", "b"),
    ("y", "x"),
    lambda x, a, b: a / (1.0 + np.exp(-np.clip((x - b) * 40.0 / np.ptp(x), -60.0, 60.0))),
    _scaled(0.25, 0.5, 0.75),
    jumps_at="b",
)
_TURNS = tuple(
    Law(
        f"a·sin({n}·x + φ)" if n > 1 else "a·sin(x + φ)",
        ("a", "φ"),
        ("y", "rad"),
        lambda x, a, p, n=n: a * np.sin(n * x + p),
        _scaled(0.0, 1.6, 3.1, 4.7),
    )
    for n in range(1, 6)
)


# Of time alone: what fades from the start of a run on.
_FADES = (
    Law("a·exp(-x/b)", ("a", "b"), ("y", "x"), lambda x, a, b: a * np.exp(-np.abs(x / b)), _scaled(*SCALES)),
    Law(
        "a + c·exp(-x/b)",
        ("a", "c", "b"),
        ("y", "y", "x"),
        lambda x, a, c, b: a + c * np.exp(-np.abs(x / b)),
        _scaled(*SCALES),
    ),
)


def laws(over: str) -> tuple[Law, ...]:
    """The formulas that are tried over a quantity, simple ones first."""
    if over in plant.PERIODIC:
        return _TURNS
    if over == "command_history":
        return _LOOPS
    if over == "load":
        return _LOSSES
    if over == "heat":
        return _WARM
    if over == "t":
        return (*_EVEN, *_FADES, _STEP)
    return (*_ODD, *_PLACES) if over in plant.BRANCHES else (*_EVEN, _STEP)


@dataclass(frozen=True)
class Formula:
    """A formula with its parameters: values, standard errors, and the curve (points,) that it makes."""

    law: Law
    values: np.ndarray
    errors: np.ndarray
    curve: np.ndarray

    def entry(self) -> dict[str, dict]:
        """The parameters as a diagnosis has them; an interval is null where the runs do not pin it."""
        found = {}
        for name, value, error in zip(self.law.names, self.values, self.errors, strict=True):
            reach = Z90 * error
            pinned = np.isfinite(error) and reach < abs(value)
            found[name] = {
                "value": _round(value),
                "ci90": [_round(value - reach), _round(value + reach)] if pinned else None,
            }
        return found


def fitted(law: Law, form: Form, values: np.ndarray, covariance: np.ndarray) -> Formula | None:
    """A formula fitted to a curve by what the runs know of its coefficients.

    values : (points,) in the term's unit; covariance : (n, n) of its coefficients, SI.
    """
    from scipy.optimize import least_squares  # a third of a second, which few cases have to spend

    basis, _ = shapes(form.over)
    # Residuals in the metric of the coefficients' covariance, in which the runs speak.
    # By eigenvalues: variances that span many orders of magnitude come out slightly negative.
    variances, directions = np.linalg.eigh(0.5 * (covariance + covariance.T))
    deviations = np.sqrt(np.maximum(variances, 0.0) + 1e-12 * variances.sum())
    metric = (directions / deviations).T @ np.linalg.pinv(basis)
    x, size = form.points, max(float(np.abs(values).max()), 1e-30)
    reach = float(np.abs(x).max())
    units = [_unit(unit, size, reach) for unit in law.units]
    best = None
    for start in law.starts:
        with np.errstate(all="ignore"):
            first = _first_guess(law, metric, x, values, units, start)
            found = least_squares(
                lambda p: np.nan_to_num(metric @ (law.of(x, *(p * units)) - values), nan=1e9, posinf=1e9, neginf=-1e9),
                first,
                max_nfev=200,
            )
        if best is None or found.cost < best.cost:
            best = found
    if best is None or not np.isfinite(best.x).all():
        return None
    spread = np.sqrt(np.diag(np.linalg.pinv(best.jac.T @ best.jac)))
    errors = spread * units
    if law.jumps_at is not None:
        # A curve says between which two points a jump lies, and no more.
        place = law.names.index(law.jumps_at)
        apart = float(np.diff(x).max()) * (SPACING if form.over in plant.BRANCHES else 1)
        errors[place] = np.hypot(errors[place], apart / np.sqrt(12.0))
    return Formula(law, best.x * units, errors, law.of(x, *(best.x * units)))


def sharpened(formula: Formula, form: Form, gap: Callable[[Form, np.ndarray], float]) -> tuple[Formula, Form] | None:
    """A formula with its jump where it leaves least, and the form whose grid holds it between its last two points; None
    of a formula that does not jump to zero.

    A free curve is straight between its knots. It blurs a jump, and what is fitted to it does not know the place any
    better.

    Parameters
    ----------
    formula : as fitted to the curve of `form`. gap : of a form with a curve (points,), with all else as it is.
    """
    from scipy.optimize import minimize

    law = formula.law
    if law.jumps_at is None or not law.nothing_beyond:
        return None
    place = law.names.index(law.jumps_at)

    def ending(values: np.ndarray) -> tuple[Form, np.ndarray]:
        # The place lies in the middle of the last interval: the law as if it went on, and zero at both ends.
        end = abs(float(values[place])) * (plant.HALF - 1.0) / (plant.HALF - 1.5)
        near = replace(form, low=-end, high=end)
        curve = law.of(near.points, *np.where(np.arange(len(values)) == place, np.inf, values))
        curve[[0, -1]] = 0.0
        return near, curve

    steps = np.abs(formula.values) * MINOR_SHARE
    found = minimize(
        lambda values: gap(*ending(values)),
        formula.values,
        method="Nelder-Mead",
        options={
            "initial_simplex": formula.values + np.vstack([np.zeros(len(steps)), np.diag(steps)]),
            "maxfev": MOST_TRIALS,
        },
    )
    near, curve = ending(found.x)
    errors = formula.errors.copy()
    errors[place] = float(np.diff(near.points).max()) / np.sqrt(12.0)
    return Formula(law, found.x, errors, curve), near


def _first_guess(
    law: Law, metric: np.ndarray, x: np.ndarray, values: np.ndarray, units: list[float], start: tuple[float, ...]
) -> np.ndarray:
    """Parameters to start a fit from, in their units: those that enter bent as given, the others, which enter straight,
    as fit best with them."""
    straight = len(units) - len(start)
    scaled = np.array(units)
    columns = [metric @ law.of(x, *(np.array([*one, *start]) * scaled)) for one in np.eye(straight)]
    best, *_ = np.linalg.lstsq(np.nan_to_num(np.stack(columns, axis=1)), metric @ values, rcond=None)
    return np.array([*best, *start])


def _unit(unit: str, size: float, reach: float) -> float:
    powers = {"y": size, "x": reach, "y/x": size / reach, "y/x²": size / reach**2, "1": 1.0, "rad": 1.0}
    return powers[unit]


def _round(value: float) -> float:
    return float(f"{value:.5g}")
