"""A form as the diagnosis handles it: a curve that is linear in a few coefficients, and its entry in a file.

Coefficients belong to shapes, smooth ones first: discrete Legendre polynomials on an even grid; a jump and polynomials
of the distance from zero, odd and even ones, on two branches; sines and cosines over a turn. The prior on each
coefficient narrows with its wiggliness, which is a penalty on roughness (P. H. C. Eilers, B. D. Marx, Statistical
Science 11(2), 1996); its tails are heavy, so that the runs decide how much of each shape there is. A form thereby is an
effect like those of the catalogue, and fits, intervals and runs left out need nothing of their own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rtds_host.diagnosis.effects import SIDES, Effect, Parameter
from rtds_host.diagnosis.replay.model import Model
from rtds_host.plant import forms as plant

# Numerical: points of a branch between which a free curve is straight; points of its grid, which is finer for formulas,
# from one of them to the next.
KNOTS = 7
SPACING = (plant.HALF - 1) // (KNOTS - 1)
# Numerical: shapes of a curve: of an even grid, odd and even ones of two branches, pairs of a turn, and over a heat.
EVEN, ODD_SHAPES, EVEN_SHAPES, TURNS, WARM_SHAPES = 9, KNOTS, 4, 5, 4
# Numerical: where a curve with a jump is written next to zero, in shares of its range.
BESIDE_ZERO = 1e-4
# Numerical: what the seven digits of a file leave of a share.
ROUNDING = 1e-6
# Numerical: a derivative's step, and bounds, in spreads of a coefficient.
STEP, BOUND = 0.1, 200.0
# Where a term is, for who reads about it.
SUBSYSTEM = {
    "torque": "drivetrain",
    "damping": "drivetrain",
    "voltage": "driver",
    "torque_constant": "winding",
    "force": "wheel_ground",
    "yaw_torque": "wheel_ground",
    "current_sensor": "sensing",
    "speed_sensor": "sensing",
    "gyro_sensor": "sensing",
}
# Terms of the robot's body have no side.
BODY = ("force", "yaw_torque", "gyro_sensor")


def _polynomials(s: np.ndarray, count: int) -> np.ndarray:
    """Orthogonal polynomials of degree 0 to count - 1 on points s (n,), each of mean square 1: (n, count)."""
    q, r = np.linalg.qr(np.vander(s, count, increasing=True))
    return q * np.sign(np.diag(r)) * math.sqrt(len(s))


def _rising(s: np.ndarray, count: int) -> np.ndarray:
    """A constant and orthogonal polynomials of degree 1 to count - 1 that begin at nothing, (n, count) alike.

    The constant alone has a jump where two branches meet. A derivative by a shape with one would say that a wheel
    sticks, even where the curve that is sought has none.
    """
    q, r = np.linalg.qr(np.vander(s, count, increasing=True)[:, 1:])
    return np.column_stack([np.ones(len(s)), q * np.sign(np.diag(r)) * math.sqrt(len(s))])


def _finer(half: np.ndarray) -> np.ndarray:
    """Shapes (KNOTS, n) of a branch on its grid, (HALF, n)."""
    at, knots = np.linspace(0.0, 1.0, plant.HALF), np.linspace(0.0, 1.0, KNOTS)
    return np.column_stack([np.interp(at, knots, shape) for shape in half.T])


def shapes(over: str) -> tuple[np.ndarray, np.ndarray]:
    """Shapes of a curve over a quantity, (points, n), and each one's prior width over that of the first, (n,)."""
    if over == "load":
        # What a gear loses by its load is none without one, and much alike whichever way it is loaded.
        half = _finer(_rising(np.linspace(0.0, 1.0, KNOTS), ODD_SHAPES))[:, 1:]
        even, odd = half, half[:, : EVEN_SHAPES - 1]
        basis = np.hstack([np.vstack([even[::-1], even]), np.vstack([-odd[::-1], odd])])
        return basis, np.concatenate([1.0 / (1.0 + np.arange(even.shape[1])), 1.0 / (2.0 + np.arange(odd.shape[1]))])
    if over == "heat":
        # What a constant brings is there before anything is warm.
        basis = _rising(np.linspace(0.0, 1.0, plant.POINTS), 1 + WARM_SHAPES)[:, 1:]
        return basis, 1.0 / (1.0 + np.arange(WARM_SHAPES))
    if over in plant.BRANCHES:
        half = _finer(_rising(np.linspace(0.0, 1.0, KNOTS), max(ODD_SHAPES, EVEN_SHAPES)))
        odd, even = half[:, :ODD_SHAPES], half[:, :EVEN_SHAPES]
        basis = np.hstack([np.vstack([-odd[::-1], odd]), np.vstack([even[::-1], even])])
        # Directions are nearly alike in frictions, bridges and sensors: an even shape counts as one rougher.
        return basis, np.concatenate([1.0 / (1.0 + np.arange(ODD_SHAPES)), 1.0 / (2.0 + np.arange(EVEN_SHAPES))])
    if over in plant.PERIODIC:
        angle = plant.FULL_TURN * np.arange(plant.POINTS) / plant.POINTS
        count = 1 + np.arange(TURNS)
        basis = np.hstack([np.cos(np.outer(angle, count)), np.sin(np.outer(angle, count))]) * math.sqrt(2.0)
        return basis, np.tile(1.0 / count, 2)
    return _polynomials(np.linspace(-1.0, 1.0, plant.POINTS), EVEN), 1.0 / (1.0 + np.arange(EVEN))


@dataclass(frozen=True)
class Form:
    """A term of an equation as a free curve: `low`, `high` the ends of its grid; `spread` one sigma of its first
    coefficient, in the term's unit; `tau` the time constant of a heat that it runs over, s."""

    term: str
    over: str
    low: float
    high: float
    prior_width: float
    tau: float = 0.0

    @property
    def id(self) -> str:
        """Its name among effects."""
        return f"form:{self.term}:{self.over}"

    @property
    def units(self) -> tuple[str, str]:
        """Of what it runs over, and of the term."""
        return plant.units_of(self.term, self.over)

    @property
    def points(self) -> np.ndarray:
        """Where its values lie, (points,), ascending; next to zero on both sides where it has two branches."""
        return points_of(self.over, self.low, self.high)

    def effect(self) -> Effect:
        """The same as an effect, whose parameters are the coefficients."""
        basis, widths = shapes(self.over)
        names = [f"c{k}" for k in range(len(widths))]

        def apply(model: Model, sides: tuple[int, ...], values: Mapping[str, float]) -> None:
            curve = basis @ [values[name] for name in names]
            put(model, sides, self.term, self.over, self.low, self.high, curve, self.tau)

        return Effect(
            id=self.id,
            subsystem=SUBSYSTEM[self.term],
            sided=self.term not in BODY,
            parameters=tuple(
                Parameter(
                    name,
                    self.units[1],
                    null=0.0,
                    low=-BOUND * self.prior_width,
                    high=BOUND * self.prior_width,
                    prior_width=self.prior_width * width,
                    starts=(self.prior_width * width,),
                    difference=STEP,
                )
                for name, width in zip(names, widths, strict=True)
            ),
            apply=apply,
            equation=f"{self.term} gains f({self.over})",
            source="a free curve",
            confused_with=(),
            shown_by="",
            check="",
            advice="",
            runs_in="rtl",
        )


def points_of(over: str, low: float, high: float) -> np.ndarray:
    """Points of a grid over a quantity, (points,), see `Form.points`; a turn's end is its beginning."""
    if over in plant.BRANCHES:
        half = np.linspace(0.0, high, plant.HALF)
        half[0] = BESIDE_ZERO * high
        return np.concatenate([-half[::-1], half])
    if over in plant.PERIODIC:
        return low + (high - low) * np.arange(plant.POINTS) / plant.POINTS
    return np.linspace(low, high, plant.POINTS)


def put(
    model: Model,
    sides: Sequence[int],
    term: str,
    over: str,
    low: float,
    high: float,
    values: np.ndarray,
    tau: float = 0.0,
) -> None:
    """Put a form's values (points,) into the first free rows of a model; tau : s, of the heat that it runs over.

    Raises
    ------
    ValueError : a side has as many forms as it can hold.
    """
    for side in sides:
        free = np.flatnonzero(model.forms[side, :, plant.TERM] == 0.0)
        if not len(free):
            raise ValueError(f"a robot has at most {plant.MOST_FORMS} forms a side")
        row = model.forms[side, free[0]]
        row[: plant.VALUES] = plant.TERM_CODE[term], plant.OVER_CODE[over], low, high, tau
        plant.values_in(row)[:] = values


def told_by(over: str, values: np.ndarray) -> np.ndarray:
    """Indices of the points that a file needs: of a curve that is straight between its knots, these alone."""
    if over in plant.BRANCHES:
        at = np.arange(plant.HALF)
        half = at[::SPACING]
        straight = [np.interp(at, half, branch[half]) for branch in (values[: plant.HALF], values[plant.HALF :])]
        if np.allclose(np.concatenate(straight), values, rtol=0.0, atol=ROUNDING * float(np.abs(values).max())):
            return np.concatenate([half, plant.HALF + half])
    return np.arange(len(values))


def written(form: Form, values: np.ndarray, errors: np.ndarray) -> list[list[float]]:
    """The points [over, value, standard error] of a file; of a turn with its end."""
    told = told_by(form.over, values)
    x, y, e = form.points[told], values[told], errors[told]
    if form.over in plant.PERIODIC:
        x, y, e = np.append(x, form.high), np.append(y, y[0]), np.append(e, e[0])
    return [[float(f"{v:.7g}") for v in point] for point in zip(x, y, e, strict=True)]


def read(curve: np.ndarray, over: str) -> tuple[float, float, np.ndarray]:
    """Ends of the grid and values (points,) of a curve's points (n, 2 or 3) in a file, whoever wrote it."""
    x, y = curve[:, 0], curve[:, 1]
    if over in plant.BRANCHES:
        high = float(max(-x[0], x[-1]))
        back, ahead = (_branch_through(sign * x[::sign], y[::sign], high) for sign in (-1, 1))
        return -high, high, np.concatenate([back[::-1], ahead])
    low, high = float(x[0]), float(x[-1])
    if over in plant.PERIODIC:
        return low, low + plant.FULL_TURN, np.interp(points_of(over, low, low + plant.FULL_TURN), x, y)
    return low, high, np.interp(points_of(over, low, high), x, y)


def _branch_through(x: np.ndarray, y: np.ndarray, high: float) -> np.ndarray:
    """Values (HALF,) of the branch above zero of a curve through points, x ascending."""
    size, value = x[x > 0.0], y[x > 0.0]
    if len(size) and size[0] <= (1.0 + ROUNDING) * BESIDE_ZERO * high:
        size[0] = 0.0  # the branch's own value there, which the other's need not be
    else:
        size, value = np.append(0.0, size), np.append(np.interp(0.0, x, y), value)
    return np.interp(np.linspace(0.0, high, plant.HALF), size, value)


def named(row: np.ndarray) -> tuple[str, str] | None:
    """Term and quantity of a model's row (WIDTH,), None of a row without a form."""
    if not row[plant.TERM]:
        return None
    return list(plant.TERMS)[int(row[plant.TERM]) - 1], list(plant.OVERS)[int(row[plant.OVER]) - 1]


def sides_of(side: str) -> tuple[int, ...]:
    """Rows of a side by its name."""
    return SIDES[side]
