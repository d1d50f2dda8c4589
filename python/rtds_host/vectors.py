"""Types of values that many modules pass: a short vector, and a value that may be absent but is there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

# A vector as a caller gives it: a list, a tuple or an array of numbers.
Vector = Sequence[float] | np.ndarray

T = TypeVar("T")


def given(value: T | None, name: str) -> T:
    """`value`, which is there wherever the caller asks for it.

    Raises
    ------
    ValueError : it is absent; names it.
    """
    if value is None:
        raise ValueError(f"{name} is absent here")
    return value
