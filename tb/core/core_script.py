"""Scripts for the long comparisons of rtds_core with the model: what the strobes bring, and the words expected."""

from __future__ import annotations

import numpy as np

from rtds_host.motor import CoreModel

NOMINAL = (8.6, 1e-3, 6.538e-3, 6.538e-3, 1e-7, 4.372e-7, 1e-5)
RECORD = 14  # words of a record, see core_bench.cpp
_ODD = (0, 0x80000000, 1, 0x007FFFFF, 0x7F7FFFFF, 0x7F800000, 0xFF800000, 0x7FC00000, 0x7F800001, 0xBF800000)


def words(values) -> np.ndarray:
    """float32 words of numbers."""
    with np.errstate(all="ignore"):
        return np.asarray(values, dtype=np.float64).astype(np.float32).view(np.uint32)


def random_script(records: int, strobes: int, seed: int, wild: float) -> np.ndarray:
    """(records, 14) uint32: random inputs, parameter sets near and far, both methods.

    strobes : of each record, on average.
    wild : part of the records with arbitrary words as inputs, or an unusable parameter.
    """
    rng = np.random.default_rng(seed)
    script = np.zeros((records, RECORD), dtype=np.uint32)
    parameters, method = words(NOMINAL), 0
    for record in script:
        record[:2] = words(rng.uniform(-12, 12, 2))
        record[2:4] = words(rng.uniform(-5e-3, 5e-3, 2) * (rng.random(2) < 0.8))
        if rng.random() < 0.4:
            spread = rng.choice((0.01, 0.3, 2.0))
            parameters = words(np.array(NOMINAL) * 10.0 ** rng.uniform(-spread, spread, 7))
            method = int(rng.integers(2))
        record[4:11], record[11] = parameters, method
        record[12] = 1 + rng.poisson(strobes - 1)
        if rng.random() < wild:
            chosen = rng.integers(0, 11)
            record[chosen] = rng.choice(_ODD) if rng.random() < 0.5 else rng.integers(0, 2**32)
        record[13] = rng.random() < wild
    return script


def drive_script(seconds: float, seed: int) -> np.ndarray:
    """(n, 14) uint32: a robot's drive at 10 us, the inputs changing every millisecond, parameters four times."""
    rng = np.random.default_rng(seed)
    records = round(seconds * 1000)
    script = np.zeros((records, RECORD), dtype=np.uint32)
    t = np.arange(records) * 1e-3
    script[:, :2] = words(np.stack([9 * np.sin(0.5 * t), 9 * np.sin(0.5 * t + 0.3)], axis=1))
    script[:, 2:4] = words(3e-3 * np.sin(0.9 * t)[:, None] + rng.normal(0, 1e-4, (records, 2)))
    for quarter in range(4):
        part = slice(quarter * records // 4, (quarter + 1) * records // 4)
        script[part, 4:11] = words(np.array(NOMINAL) * [1, 1, 1, 1, 1, 1 + 0.1 * quarter, 1])
        script[part, 11] = quarter % 2
    script[:, 12] = 100
    return script


def expected(script: np.ndarray) -> np.ndarray:
    """(strobes, 9) uint32, as core_bench.cpp writes them: high words, low words, {fault, nonfinite}."""
    model = CoreModel()
    parts = []
    for record in script:
        if record[13]:
            model.clear()
        got = model.run(record[:2], record[2:4], record[4:11], int(record[11]), int(record[12]))
        finite = ((got[:, :, :2] >> 23) & 0xFF != 0xFF).all(axis=(1, 2))
        flags = np.uint32(2 * model.fault) | ~finite
        high, low = got[:, :, :2].reshape(-1, 4), got[:, :, 2:].reshape(-1, 4)
        parts.append(np.concatenate([high, low, flags[:, None]], axis=1, dtype=np.uint32, casting="unsafe"))
    return np.concatenate(parts)
