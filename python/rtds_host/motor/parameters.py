"""The parameter unit, bit for bit: from motor constants and step to the coefficients of the update.

The update of one step is x+ = x + G (u - S x) with the state x = (i, w), the inputs u = (V, -T), and

    S = [[R, Kb], [-Km, B]]        G = h / D * [[J', -c], [d, L']]
    L' = L + a   a = th R          c = th Kb          th = theta h
    J' = J + b   b = th B          d = th Km          D  = L' J' + c d

which is x+ = x + C x + D_u u of (I - theta h A)^-1 h (A x + B u) with C = -G S and D_u = G, factored so that a fixed
point, u = S x, does not depend on the rounding of G at all. Nothing is subtracted, so nothing cancels; all
coefficients are positive and the update carries the signs. Derivation: docs/motor-unit.md.
"""

from __future__ import annotations

import math

import numpy as np

from rtds_host.errors import InputError
from rtds_host.vectors import Vector

METHODS = ("backward_euler", "trapezoidal")  # index = METHOD of the core's settings

# The order of the words on the core's parameter inputs, as `set_parameters` takes them.
PARAMETER_NAMES = (
    "resistance_ohm",
    "inductance_h",
    "torque_constant_nm_per_a",
    "back_emf_constant_v_s_per_rad",
    "rotor_inertia_kg_m2",
    "viscous_friction_nm_s_per_rad",
    "step_s",
)

# Their values, SI.
Parameters = tuple[float, float, float, float, float, float, float]

COEFFICIENT_NAMES = ("R", "Kb", "Km", "B", "G11", "G12", "G21", "G22", "h")


def usable(word: np.float32) -> bool:
    """The parameter unit's rule for a parameter and for a coefficient: a positive normal binary32 number.

    It refuses zero, negative numbers, NaN, infinity, and subnormals (which have lost the precision the bounds on
    the state rely on).
    """
    bits = int(np.float32(word).view(np.uint32))
    exponent = (bits >> 23) & 0xFF
    return bits >> 31 == 0 and exponent not in (0, 255)


def coefficients(words: Vector, method: int) -> tuple[np.ndarray, bool]:
    """The coefficients in the RTL's operations and their order.

    Parameters
    ----------
    words : (7,) float32 in the order of `PARAMETER_NAMES`, SI.
    method : 0 backward Euler, 1 trapezoidal (index into `METHODS`).

    Returns
    -------
    coefficients : (9,) float32, R, Kb, Km, B (ohm, V s/rad, N m/A, N m s/rad), G11 (A/V), G12 (A/(N m)),
        G21 (rad/s/V), G22 (rad/s/(N m)) and the step (s).
    fault : True when a parameter or a coefficient is unusable; the core then keeps the old coefficients.
    """
    r, l, km, kb, j, b, h = (np.float32(word) for word in words)
    theta = np.float32(0.5 if method else 1.0)
    with np.errstate(all="ignore"):
        th = h * theta
        lp = l + th * r
        jp = j + th * b
        c = th * kb
        d = th * km
        det = lp * jp + c * d
        scale = h / det
        g11 = scale * jp
        g12 = scale * c
        g21 = scale * d
        g22 = scale * lp
    fault = not all(usable(word) for word in (r, l, km, kb, j, b, h, g11, g12, g21, g22))
    return np.array([r, kb, km, b, g11, g12, g21, g22, h], dtype=np.float32), fault


def parameter_words(values: Vector, method: str) -> tuple[np.ndarray, int]:
    """Seven parameters checked by the parameter unit's rule and rounded to binary32.

    Parameters
    ----------
    values : (7,) in the order of `PARAMETER_NAMES`, SI.
    method : one of `METHODS`.

    Returns
    -------
    words : (7,) float32.
    method : 0 or 1, as METHOD of the core's settings.

    Raises
    ------
    InputError : names the parameter that is zero, negative, NaN, infinite or outside binary32's normal numbers, or
        the coefficient that overflows or underflows; or an unknown method.
    """
    if method not in METHODS:
        raise InputError(f"method: {method!r} is unknown, choose one of {', '.join(METHODS)}")
    words = np.empty(len(PARAMETER_NAMES), dtype=np.float32)
    for index, (name, value) in enumerate(zip(PARAMETER_NAMES, values, strict=True)):
        value = float(value)
        if not math.isfinite(value):
            raise InputError(f"{name}: {value} is not a finite number")
        if value <= 0.0:
            raise InputError(f"{name}: {value:g} must be greater than zero")
        with np.errstate(over="ignore", under="ignore"):
            words[index] = value
        if not usable(words[index]):
            raise InputError(f"{name}: {value:g} is outside the normal numbers of single precision")
    method_index = METHODS.index(method)
    coefficient_words, fault = coefficients(words, method_index)
    if fault:
        bad = next(k for k, word in enumerate(coefficient_words) if not usable(word))
        raise InputError(
            f"{', '.join(PARAMETER_NAMES)}: together they give the coefficient {COEFFICIENT_NAMES[bad]} = "
            f"{coefficient_words[bad]:g}, outside the normal numbers of single precision"
        )
    return words, method_index
