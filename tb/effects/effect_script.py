"""Random scripts for the core with effects, and what they have to give (effect_bench.cpp has the format)."""

from __future__ import annotations

import math

import numpy as np

from rtds_host.motor.effect_model import EffectCore
from rtds_host.motor.effect_program import CELLS, CONSTANTS, SIDES, TABLES
from rtds_host.motor.effect_tables import constant_address, table_address, tables_of
from rtds_host.motor.effects import FULL_TURN, Curve, MotorParameters, SupplyEffects, UnitEffects

NOMINAL = (8.6, 1.0e-3, 6.538e-3, 6.538e-3, 1.0e-7, 4.372e-7, 1e-5)


def words(values) -> np.ndarray:
    """uint32 patterns of values rounded to binary32."""
    with np.errstate(over="ignore"):
        return np.asarray(values, np.float64).astype(np.float32).view(np.uint32)


def random_curve(rng: np.random.Generator, low: float, high: float, size: float) -> Curve:
    """A curve of a few points within low..high, some of them jumps, sized about `size`."""
    count = int(rng.integers(1, 9))
    x = np.sort(rng.uniform(low, high, count))
    if count > 3 and rng.random() < 0.5:
        x[1] = x[2]
    if rng.random() < 0.3:
        x = np.sort(np.round(x / (high - low) * 20) * (high - low) / 20)
    x = np.unique(x) if len(np.unique(x)) < len(x) - 1 else x
    return Curve(tuple(x), tuple(rng.normal(0.0, size, len(x))))


def random_unit(rng: np.random.Generator) -> UnitEffects:
    """A motor unit with each effect or without it."""

    def maybe(make):
        return make() if rng.random() < 0.6 else None

    forward = maybe(lambda: random_curve(rng, 0.0, 800.0, 2e-4))
    drop = maybe(lambda: rng.uniform(0.01, 1.0))
    ripple = maybe(lambda: random_curve(rng, 0.0, FULL_TURN, 5e-5))
    return UnitEffects(
        motor=maybe(lambda: MotorParameters(*(np.array(NOMINAL[:6]) * np.exp(rng.normal(0, 0.3, 6))))),
        command=maybe(lambda: random_curve(rng, -12.0, 12.0, 6.0)),
        limit_v=float(rng.choice([math.inf, 4.0, 0.0])),
        drop=None if drop is None else Curve((-1.0, 0.0, 0.0, 1.0), (-1.5 * drop, -drop, drop, 2.0 * drop)),
        friction_forward=forward,
        friction_backward=None if forward is None else random_curve(rng, 0.0, 800.0, 2e-4),
        torque=maybe(lambda: random_curve(rng, -900.0, 900.0, 1e-4)),
        load_share=float(rng.choice([0.0, 0.3, 0.9])),
        ripple=ripple,
        ripple_periods_per_rad=float(rng.choice([0.01, 3.0, 400.0])),
        ripple_start_rad=float(rng.uniform(0.0, 6.0)),
        heat_rise_per_w=float(rng.choice([0.0, 0.5])),
        heat_tau_s=float(rng.choice([1e-3, 1.0])),
    )


class Script:
    """Records for the bench, and beside them what the model makes of them."""

    def __init__(self) -> None:
        self._parts: list[np.ndarray] = []
        self._expected: list[np.ndarray] = []
        self.model = EffectCore()

    def write(self, pairs) -> None:
        """Words through the register port, (address, word)."""
        pairs = list(pairs)
        self._parts.append(np.array([0, len(pairs), *(value for pair in pairs for value in pair)], np.uint32))
        for address, word in pairs:
            self.model.write(address, word)

    def strobes(self, v, t, parameters, method, n, *, on=True, own=None, delay=0, stride=1, clear=False) -> None:
        """n strobes with the raw words held; clear: clear_i for a clock before the first."""
        second = np.zeros(6, np.uint32) if own is None else np.asarray(own, np.uint32)
        record = [1, *v, *t, *parameters, *second, method, on, own is not None, delay, stride, n, int(clear)]
        self._parts.append(np.array(record, np.uint32))
        if clear:
            self.model.clear()
        got = self.model.run(np.asarray(v, np.uint32), np.asarray(t, np.uint32), np.asarray(parameters, np.uint32),
            method,
                             n, on=on, own=own, delay=delay, stride=stride)  # fmt: skip
        finite = ((got[:, :, :2] >> 23) & 0xFF != 0xFF).all(axis=(1, 2))
        flags = np.uint32(2 * self.model.fault) | ~finite
        high, low = got[:, :, :2].reshape(-1, 4), got[:, :, 2:].reshape(-1, 4)
        self._expected.append(np.concatenate([high, low, flags[:, None]], axis=1, dtype=np.uint32, casting="unsafe"))

    @property
    def data(self) -> np.ndarray:
        """The whole script, uint32."""
        return np.concatenate(self._parts)

    @property
    def expected(self) -> np.ndarray:
        """(strobes, 9) uint32, as the bench writes them."""
        return np.concatenate(self._expected)


def sensible(rng: np.random.Generator, parts: int, strobes: int) -> Script:
    """Random effects on random motors that are driven about, parameters, effects and tables changing while they
    turn.
    """
    script = Script()
    for part in range(parts):
        step = float(rng.choice([1e-5, 1e-6, 3e-5]))
        supply = SupplyEffects(
            voltage_v=12.0,
            source_resistance_ohm=float(rng.choice([0.0, 1.0])),
            decline_v_per_s=float(rng.choice([0.0, 100.0])),
            command_delay_s=float(rng.choice([0, 1, 2, 30, 200])) * step,
        )
        left, right = random_unit(rng), random_unit(rng)
        shared = (*NOMINAL[:6], step)
        found = tables_of(left, right, supply, shared)
        script.write(found.writes())
        values = words(found.side_values(shared))
        own = None if found.motors == (None, None) else values[1, :6]
        method = int(rng.integers(2))
        for k in range(8):
            v, t = words(rng.normal(0.0, 5.0, 2)), words(rng.normal(0.0, 3e-4, 2) * rng.integers(0, 2, 2))
            script.strobes(v, t, values[0], method, int(rng.integers(1, strobes)), on=bool(part % 5), own=own,
                           delay=found.delay, stride=found.stride if part % 3 else 3,
                           clear=k == 0 and part % 2 == 1)  # fmt: skip
            if k == 5:  # tables change under way
                script.write([pair for pair in found.writes() if rng.random() < 0.02])
                script.write(
                    (table_address(int(rng.integers(SIDES)), int(rng.integers(len(TABLES))), int(rng.integers(CELLS)),
                        0),
                     int(words(rng.normal(0.0, 1e-4))))
                    for _ in range(50)
                )  # fmt: skip
    return script


def wild(rng: np.random.Generator, parts: int) -> Script:
    """Arbitrary words everywhere: inputs, parameters, tables, constants; NaN and infinity among them."""
    script = Script()

    def arbitrary(n):
        kinds = rng.integers(0, 10, n)
        value = rng.integers(0, 2**32, n, dtype=np.uint32)
        special = np.array([0, 0x80000000, 0x7F800000, 0xFF800000, 0x7FC00000, 0x3F800000, 0x00000001, 0xBF800000])
        value = np.where(kinds == 0, rng.choice(special, n), value)
        ordinary = words(rng.normal(0.0, 1.0, n) * 10.0 ** rng.integers(-8, 4, n))
        return np.where(kinds > 3, ordinary, value).astype(np.uint32)

    nominal = words(NOMINAL)
    every = [
        table_address(s, t, c, w)
        for s in range(SIDES)
        for t in range(len(TABLES))
        for c in range(CELLS)
        for w in (0, 1)
    ]
    script.write(zip(every, arbitrary(len(every)).tolist(), strict=True))
    for part in range(parts):
        script.write(
            (constant_address(s, k), int(word))
            for s in range(SIDES)
            for k, word in enumerate(arbitrary(len(CONSTANTS)))
        )
        some = rng.choice(every, 40, replace=False)
        script.write(zip(some.tolist(), arbitrary(40).tolist(), strict=True))
        for _ in range(4):
            parameters = nominal.copy()
            own = nominal[:6].copy()
            if rng.random() < 0.4:
                parameters[rng.integers(7)] = arbitrary(1)[0]
                own[rng.integers(6)] = arbitrary(1)[0]
            script.strobes(arbitrary(2), arbitrary(2), parameters, int(rng.integers(2)), int(rng.integers(1, 12)),
                           on=bool(rng.random() < 0.8), own=own if rng.random() < 0.5 else None,
                           delay=int(rng.integers(0, 5)), stride=int(rng.integers(1, 4)),
                           clear=part % 2 == 0)  # fmt: skip
    return script
