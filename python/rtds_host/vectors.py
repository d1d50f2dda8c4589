"""Types of values that many modules pass: a short vector, and a value that may be absent but is there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

# A vector as a caller gives it: a list, a tuple or an array of numbers.
Vector = Sequence[float] | np.ndarray

T = TypeVar("T")


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a x b of two vectors (3,): the bits of `numpy.cross`, which takes ten times as long for two of them."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def given(value: T | None, name: str) -> T:
    """`value`, which is there wherever the caller asks for it.

    Raises
    ------
    ValueError : it is absent; names it.
    """
    if value is None:
        raise ValueError(f"{name} is absent here")
    return value
