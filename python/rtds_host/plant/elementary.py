"""Elementary functions without a call, so that a loop over replays goes through a processor's vector unit.

`exponential` is the library's, for loops that take one replay at a time.
"""

from __future__ import annotations

import math

from rtds_host.plant.compiled import law


@law
def exponential(y):
    """exp(-y) by the library."""
    return math.exp(-y)


@law
def turned(c, s, angle):
    """A direction (c, s) turned by an angle, rad, to 1e-12; quickly where that is small, as in a step."""
    if abs(angle) < 0.1:
        q = angle * angle
        dc, ds = 1.0 + cos_less_one(q), sin(angle, q)
    else:
        dc, ds = math.cos(angle), math.sin(angle)
    return c * dc - s * ds, s * dc + c * ds


@law
def cos_less_one(q):
    """cos - 1 of a small angle whose square is q, as in `turned`."""
    return -q * (0.5 - q * (1.0 / 24.0 - q * (1.0 / 720.0)))


@law
def sin(angle, q):
    """sin of a small angle whose square is q."""
    return angle * (1.0 - q * (1.0 / 6.0 - q * (1.0 / 120.0 - q * (1.0 / 5040.0))))


@law
def sine(x):
    """sin(x), x in rad within 1e4 turns, to 1e-11: sine and cosine of half of what is left of the angle after whole
    turns.
    """
    # Next to 1.5 * 2^52 no digits behind the point are left: it rounds.
    turns = (x * (0.5 / math.pi) + 6755399441055744.0) - 6755399441055744.0
    y = 0.5 * ((x - turns * 6.28318530717958623200) - turns * 2.44929359829470635445e-16)
    q = y * y
    s = 1.0 - q * (1.0 / 210.0) * (1.0 - q * (1.0 / 272.0))
    s = 1.0 - q * (1.0 / 110.0) * (1.0 - q * (1.0 / 156.0) * s)
    s = 1.0 - q * (1.0 / 42.0) * (1.0 - q * (1.0 / 72.0) * s)
    s = y * (1.0 - q * (1.0 / 6.0) * (1.0 - q * (1.0 / 20.0) * s))
    c = 1.0 - q * (1.0 / 182.0) * (1.0 - q * (1.0 / 240.0))
    c = 1.0 - q * (1.0 / 90.0) * (1.0 - q * (1.0 / 132.0) * c)
    c = 1.0 - q * (1.0 / 30.0) * (1.0 - q * (1.0 / 56.0) * c)
    c = 1.0 - q * (1.0 / 2.0) * (1.0 - q * (1.0 / 12.0) * c)
    return 2.0 * s * c


@law
def exp_minus(y):
    """exp(-y), y >= 0, to 1e-14 where it is worth anything: without a call, so that a batch stays vectorised."""
    z = min(y, 40.0) * (1.0 / 64.0)
    e = 1.0 - z * (1.0 / 8.0) * (1.0 - z * (1.0 / 9.0))
    e = 1.0 - z * (1.0 / 6.0) * (1.0 - z * (1.0 / 7.0) * e)
    e = 1.0 - z * (1.0 / 4.0) * (1.0 - z * (1.0 / 5.0) * e)
    e = 1.0 - z * (1.0 / 2.0) * (1.0 - z * (1.0 / 3.0) * e)
    e = 1.0 - z * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    return e * e


@law
def tanh(x):
    """The hyperbolic tangent, likewise."""
    e = exp_minus(2.0 * abs(x))
    size = (1.0 - e) / (1.0 + e)
    return size if x > 0.0 else -size
