"""The float64 references the bit-exact model is judged by. Shares no arithmetic with `rtds_host.motor.model`.

The matrices come from numpy's linear solver and the matrix exponential of the differential equation

    L di/dt = V - R i - Kb w        J dw/dt = Km i - B w - T

not from the closed forms of the parameter unit.
"""

from __future__ import annotations

import numba
import numpy as np
import scipy.linalg

from rtds_host.motor.parameters import METHODS
from rtds_host.vectors import Vector


def continuous_matrices(values: Vector) -> tuple[np.ndarray, np.ndarray]:
    """A (2, 2) and B (2, 2) of dx/dt = A x + B u, with x = (i, w) in A, rad/s and u = (V, T) in V, N m.

    values : (7,) in the order of `rtds_host.motor.PARAMETER_NAMES`, SI; the step is not used.
    """
    r, l, km, kb, j, b, _ = (float(value) for value in values)
    return np.array([[-r / l, -kb / l], [km / j, -b / j]]), np.array([[1.0 / l, 0.0], [0.0, -1.0 / j]])


def difference_matrices(values: Vector, method: str) -> tuple[np.ndarray, np.ndarray]:
    """C, D (2, 2) of x+ = x + C x + D u, [C, D] = (I - theta h A)^-1 h [A, B]; theta = 1 or 1/2."""
    a, b = continuous_matrices(values)
    h = float(values[6])
    theta = (1.0, 0.5)[METHODS.index(method)]
    system = np.eye(2) - theta * h * a
    return np.linalg.solve(system, h * a), np.linalg.solve(system, h * b)


def exact_matrices(values: Vector) -> tuple[np.ndarray, np.ndarray]:
    """As `difference_matrices`, for the exact solution with inputs held: C = e^(hA) - I, D = A^-1 C B."""
    a, b = continuous_matrices(values)
    h = float(values[6])
    held = scipy.linalg.expm(h * np.block([[a, b], [np.zeros((2, 4))]]))
    return held[:2, :2] - np.eye(2), held[:2, 2:]


@numba.njit(cache=True)
def run(x, c, d, v, t, n_steps, every):
    """n_steps of x+ = x + C x + D u in float64 with the inputs held.

    x : (2,) float64, current (A) and speed (rad/s), updated in place. v in V, t in N m.
    Returns (n_steps // every, 2) float64, the state after every `every` steps.
    """
    out = np.empty((n_steps // every, 2))
    du_i = d[0, 0] * v + d[0, 1] * t
    du_w = d[1, 0] * v + d[1, 1] * t
    i, w = x[0], x[1]
    for k in range(1, n_steps + 1):
        i, w = i + (c[0, 0] * i + c[0, 1] * w + du_i), w + (c[1, 0] * i + c[1, 1] * w + du_w)
        if k % every == 0:
            out[k // every - 1, 0], out[k // every - 1, 1] = i, w
    x[0], x[1] = i, w
    return out
