"""Operands for the binary32 operators, directed and random, and numpy's answers."""

from __future__ import annotations

import itertools

import numpy as np

CANONICAL_NAN = 0x7FC00000
RESULTS = (
    *("add", "sub", "mul", "div"),
    *("from_int", "from_fix16", "from_fix63", "to_int", "to_fix16", "to_fix31", "to_flags"),
)
FROM_PLACES = (0, 16, 63)
TO_PLACES = (0, 16, 31)

# Positive words whose every pair, with all four pairs of signs, is tried.
_DIRECTED = (
    0x00000000,  # zero
    0x00000001,  # least subnormal
    0x00000002,
    0x00000003,
    0x00400000,  # middle subnormal
    0x007FFFFE,
    0x007FFFFF,  # largest subnormal
    0x00800000,  # least normal
    0x00800001,
    0x00FFFFFF,
    0x01000000,  # the next exponent
    0x01000001,
    0x01800000,
    0x0B800000,  # a binade above 2^-104: sticky distances from the subnormals
    0x0C000000,
    0x0C800001,
    0x19800000,
    0x1FFFFFFF,  # squares underflow
    0x20000000,
    0x20400000,
    0x33800000,  # 2^-24: half an ulp of one
    0x33800001,
    0x337FFFFF,
    0x34000000,  # 2^-23: an ulp of one
    0x34400000,
    0x3EFFFFFF,
    0x3F000000,  # a half
    0x3F000001,
    0x3F7FFFFE,
    0x3F7FFFFF,  # just below one
    0x3F800000,  # one
    0x3F800001,
    0x3F800002,
    0x3F800003,
    0x3FAAAAAB,
    0x3FC00000,  # one and a half: ties
    0x3FFFFFFF,
    0x40000000,
    0x40200000,  # two and a half
    0x40400000,  # three
    0x4B000000,  # 2^23
    0x4B000001,
    0x4B7FFFFF,
    0x4B800000,  # 2^24
    0x4B800001,
    0x4EFFFFFF,
    0x4F000000,  # 2^31
    0x4F000001,
    0x5EFFFFFF,  # squares overflow
    0x5F000000,
    0x5F7FFFFF,
    0x7E800000,
    0x7EFFFFFF,  # twice it is the largest
    0x7F000000,  # twice it overflows
    0x7F7FFFFE,
    0x7F7FFFFF,  # largest
    0x7F800000,  # infinity
    0x7F800001,  # signalling NaN
    0x7FBFFFFF,
    0x7FC00000,  # quiet NaN
    0x7FFFFFFF,
)


def directed() -> np.ndarray:
    """(n, 2) uint32: every pair of the directed words with every pair of signs, small differences, integers at ties and
    ends.
    """
    words = [word | sign for word in _DIRECTED for sign in (0, 0x80000000)]
    pairs = np.array(list(itertools.product(words, words)), dtype=np.uint32)
    # Differences of near operands at small exponents: they would lose more places than the exponent has.
    large = [exponent << 23 | mantissa for exponent in range(1, 28) for mantissa in (0, 1, 0x400000, 0x7FFFFF)]
    near = [(a, (a - (1 << place)) | 0x80000000) for a in large for place in range(24) if a > 1 << place]
    # Integers (operand a of from_int): around the places where 32 bits lose their last ones.
    around = [(1 << bit) + offset for bit in range(22, 32) for offset in range(-3, 4)]
    around += [(3 << bit) + offset for bit in range(22, 30) for offset in range(-3, 4)]
    integers = np.array([value & 0xFFFFFFFF for base in around for value in (base, -base)], dtype=np.uint32)
    # Halves and their neighbours (operand a of to_int).
    halves = (np.arange(-40, 41) / 2).astype(np.float32).view(np.uint32)
    singles = np.concatenate([integers, halves, halves + 1, halves - 1])
    return np.concatenate([pairs, np.array(near, dtype=np.uint32), np.stack([singles, np.flip(singles)], axis=1)])


def random_pairs(count: int, seed: int) -> np.ndarray:
    """(count, 2) uint32, a mixture that reaches each branch: any bits, near exponents, ties, subnormals, ends."""
    rng = np.random.default_rng(seed)
    words = rng.integers(0, 2**32, size=(count, 2), dtype=np.uint64).astype(np.uint32)
    kind = rng.integers(0, 8, size=count)
    a, b = words[:, 0].copy(), words[:, 1].copy()
    exponent = (a >> 23) & 0xFF

    def with_exponent(word: np.ndarray, new: np.ndarray) -> np.ndarray:
        return (word & 0x807FFFFF) | (np.clip(new, 0, 255).astype(np.uint32) << 23)

    # 1: exponents within 30 of each other, for alignment and guard bits.
    near = with_exponent(b, exponent.astype(np.int64) + rng.integers(-30, 31, size=count))
    b = np.where(kind == 1, near, b)
    # 2: nearly equal magnitudes, for cancellation.
    close = (a ^ np.uint32(0x80000000)) + rng.integers(-40, 41, size=count).astype(np.uint32)
    b = np.where(kind == 2, close, b)
    # 3: few significant bits, for exact results and ties.
    keep = np.uint32(0xFFFFFFFF) << rng.integers(8, 23, size=count).astype(np.uint32)
    keep2 = np.uint32(0xFFFFFFFF) << rng.integers(8, 23, size=count).astype(np.uint32)
    few_a, few_b = a & keep, with_exponent(b & keep2, exponent.astype(np.int64) + rng.integers(-26, 27, size=count))
    a, b = np.where(kind == 3, few_a, a), np.where(kind == 3, few_b, b)
    # 4: products and quotients at the lower end; 5: at the upper end.
    for which, low, high in ((4, -30, 6), (5, -6, 6)):
        target = (1 if which == 4 else 254) + rng.integers(low, high, size=count)
        product = with_exponent(b, target + 127 - exponent)
        quotient = with_exponent(b, exponent - target + 127)
        chosen = np.where(rng.integers(0, 2, size=count) == 0, product, quotient)
        b = np.where(kind == which, chosen, b)
    # 6: one operand subnormal, with any number of leading zeros.
    tiny = (a & np.uint32(0x80000000)) | ((a & 0x7FFFFF) >> rng.integers(0, 23, size=count).astype(np.uint32))
    swap = rng.integers(0, 2, size=count) == 0
    a, b = np.where((kind == 6) & swap, tiny, a), np.where((kind == 6) & ~swap, tiny, b)
    # 7: integers of any size, and numbers near the range of integers.
    small = words[:, 0].astype(np.int32) >> rng.integers(0, 32, size=count).astype(np.int32)
    ranged = with_exponent(a, 120 + rng.integers(0, 45, size=count))
    a = np.where(kind == 7, np.where(swap, small.astype(np.uint32), ranged), a)
    return np.stack([a, b], axis=1).astype(np.uint32)


def canonical(values: np.ndarray) -> np.ndarray:
    """Words of float32 values, every NaN as the operators' one NaN."""
    return np.where(np.isnan(values), np.uint32(CANONICAL_NAN), values.astype(np.float32).view(np.uint32))


def from_int(words: np.ndarray, frac: int) -> np.ndarray:
    """numpy's conversion of int32 words / 2**frac to float32; the scaling is exact."""
    return canonical(words.view(np.int32).astype(np.float32) * np.float32(2.0**-frac))


def to_int(words: np.ndarray, frac: int) -> tuple[np.ndarray, np.ndarray]:
    """float32 words times 2**frac to int32, half to even, clamped; and the flags {saturated, NaN}."""
    values = words.view(np.float32).astype(np.float64) * 2.0**frac
    nan = np.isnan(values)
    rounded = np.rint(np.where(nan, 0.0, values))
    clipped = np.clip(rounded, -(2.0**31), 2.0**31 - 1.0)
    flags = np.where(nan, 1, np.where(rounded != clipped, 2, 0)).astype(np.uint32)
    return clipped.astype(np.int64).astype(np.uint32), flags


def expected(pairs: np.ndarray) -> np.ndarray:
    """(n, 11) uint32, columns as RESULTS, from numpy's float32."""
    a, b = (np.ascontiguousarray(pairs[:, k]).view(np.float32) for k in (0, 1))
    words = np.ascontiguousarray(pairs[:, 0])
    with np.errstate(all="ignore"):
        columns = [canonical(y) for y in (a + b, a - b, a * b, a / b)]
        columns += [from_int(words, places) for places in FROM_PLACES]
        converted = [to_int(words, places) for places in TO_PLACES]
    columns += [whole for whole, _ in converted]
    columns.append(sum(flags << np.uint32(2 * k) for k, (_, flags) in enumerate(converted)))
    return np.stack(columns, axis=1)
