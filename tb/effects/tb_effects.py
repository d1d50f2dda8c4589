"""cocotb tests of rtds_core with effects: latencies, clear, parameters and words under way, NaN; every word the
model's.

`EFFECT_STEPS` in the environment sets the length of the random test.
"""

from __future__ import annotations

import os
import random

import cocotb
import numpy as np
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, ReadOnly, RisingEdge

from effects.effect_script import NOMINAL, random_unit, words
from rtds_host.link import core_records
from rtds_host.motor.effect_model import EffectCore
from rtds_host.motor.effect_tables import constant_address, tables_of
from rtds_host.motor.effects import Curve, MotorParameters, SupplyEffects, UnitEffects

VALID_CLOCKS, LOW_CLOCKS, READY_CLOCKS = 15, 22, 50
CHANGED_CLOCKS = 147  # ready after changed parameters
OWN_CLOCKS = 271  # and where each side has its own
DRY = Curve((0.0,), (2e-4,))
HELD = UnitEffects(friction_forward=DRY, friction_backward=DRY)
RICH = UnitEffects(
    friction_forward=DRY, friction_backward=DRY, drop=Curve((0.0, 0.0), (-0.3, 0.3)), heat_rise_per_w=0.5,
    heat_tau_s=1e-3,
    torque=Curve((-900.0, 0.0, 900.0), (-1e-4, 0.0, 2e-4)), load_share=0.2,
)  # fmt: skip
OTHER = MotorParameters(9.0, 1.1e-3, 6e-3, 6.2e-3, 2e-7, 5e-7)
SUPPLY = SupplyEffects(voltage_v=12.0, source_resistance_ohm=1.0, decline_v_per_s=100.0, command_delay_s=3e-5)


class TB:
    """The core, its clock, and the model that it is compared with."""

    def __init__(self, dut) -> None:
        self.dut = dut
        self.model = EffectCore()
        self.parameters, self.own, self.method = words(NOMINAL), None, 0
        self.on, self.delay, self.stride = True, 0, 1
        self.now = False  # the next strobe without a clock between
        Clock(dut.clk_i, 20, unit="ns", impl="gpi").start()

    async def reset(self) -> None:
        dut = self.dut
        for port in (dut.rst_ni, dut.strobe_i, dut.clear_i, dut.word_valid_i, dut.word_i):
            port.value = 0
        self.drive([0, 0], [0, 0])
        for _ in range(3):
            await RisingEdge(dut.clk_i)
        dut.rst_ni.value = 1
        await RisingEdge(dut.clk_i)

    def drive(self, v, t) -> None:
        dut = self.dut
        dut.inputs_i.value = core_records.inputs([*v, *t])
        dut.motor_l_i.value = core_records.motor(self.parameters[:6])
        dut.motor_r_i.value = core_records.motor([0] * 6 if self.own is None else self.own)
        self.set(self.parameters[6], self.method, self.on, self.own is not None)

    def set(self, h, method, on, own) -> None:
        """The settings; the delay's numbers hold between the strobes, too, as they do on the chip."""
        self.dut.settings_i.value = core_records.settings(h, method, on, own, self.delay, self.stride)

    def high(self) -> list[int]:
        """Words i_l, w_l, i_r, w_r; an X raises."""
        return core_records.state(int(self.dut.state_o.value))

    def low_words(self) -> list[int]:
        """Their low words."""
        return core_records.state(int(self.dut.low_o.value))

    async def load(self, left, right=None, supply=None, parameters=NOMINAL) -> None:
        """Words of these effects through the port, and what they say of delay and own motors."""
        found = tables_of(left, right, supply, parameters)
        for address, word in found.writes():
            await self.write(address, word)
        values = words(found.side_values(parameters))
        self.parameters, self.own = values[0], values[1, :6] if found.own else None
        self.delay, self.stride = found.delay, found.stride

    async def write(self, address, word) -> None:
        dut = self.dut
        await RisingEdge(dut.clk_i)
        dut.word_valid_i.value, dut.word_i.value = 1, core_records.effect_word(address, word)
        await RisingEdge(dut.clk_i)
        dut.word_valid_i.value = 0
        await RisingEdge(dut.clk_i)
        await RisingEdge(dut.clk_i)
        assert int(dut.word_ready_o.value), "while no run is in hand a word is written in a clock"
        self.model.write(address, word)

    async def strobe(self, v, t) -> None:
        """The edge that starts a step; afterwards inputs and switches carry random words."""
        dut = self.dut
        if self.now:
            await FallingEdge(dut.clk_i)
        else:
            await RisingEdge(dut.clk_i)
        self.now = False
        self.drive(v, t)
        dut.strobe_i.value = 1
        await RisingEdge(dut.clk_i)
        dut.strobe_i.value = 0
        for port in (dut.inputs_i, dut.motor_l_i, dut.motor_r_i):
            port.value = random.getrandbits(len(port))
        self.set(random.getrandbits(32), *(random.getrandbits(1) for _ in range(3)))
        await ReadOnly()

    async def step(self, v, t, write=None) -> np.ndarray:
        """A strobe until ready; words and latencies are asserted. write: (clock, address, word) under way."""
        dut = self.dut
        v, t = words(v) if isinstance(v[0], float) else v, words(t) if isinstance(t[0], float) else t
        await self.strobe(v, t)
        want = self.model.run(v, t, self.parameters, self.method, 1, on=self.on, own=self.own, delay=self.delay,
                              stride=self.stride)[0]  # fmt: skip
        high, low = want[:, :2].ravel().tolist(), want[:, 2:].ravel().tolist()
        self.valid = self.ready = self.low = None
        clocks = 0
        while self.ready is None:
            await RisingEdge(dut.clk_i)
            clocks += 1
            if write and clocks == write[0]:
                dut.word_valid_i.value, dut.word_i.value = 1, core_records.effect_word(write[1], write[2])
            elif write and clocks == write[0] + 1:
                dut.word_valid_i.value = 0
            await ReadOnly()
            assert clocks < 400, "ready_o must come back within 400 clocks"
            if int(dut.valid_o.value):
                assert self.valid is None, "one valid_o a step"
                self.valid = clocks
                assert self.high() == high
            if int(dut.ready_o.value):
                self.ready = clocks + 1
            if clocks == (LOW_CLOCKS if self.on else 18):
                assert self.low_words() == low
        assert self.high() == high, "high words must hold"
        assert self.low_words() == low, "low words must hold"
        assert int(dut.param_fault_o.value) == self.model.fault
        return want.view(np.float32)


async def bench(dut, *effects, parameters=NOMINAL):
    tb = TB(dut)
    await tb.reset()
    if effects:
        await tb.load(*effects, parameters=parameters)
    return tb


@cocotb.test()
async def latencies_are_the_documented_ones(dut):
    tb = await bench(dut, RICH, UnitEffects(), SUPPLY)
    await tb.step([6.0, -3.0], [0.0, 1e-4])
    assert (tb.valid, tb.ready) == (VALID_CLOCKS, CHANGED_CLOCKS)
    for _ in range(10):
        await tb.step([6.0, -3.0], [0.0, 1e-4])
        assert (tb.valid, tb.ready) == (VALID_CLOCKS, READY_CLOCKS)
    tb.own = words(OTHER.values)
    await tb.step([6.0, -3.0], [0.0, 1e-4])
    assert (tb.valid, tb.ready) == (VALID_CLOCKS, OWN_CLOCKS)
    await tb.step([6.0, -3.0], [0.0, 1e-4])
    assert (tb.valid, tb.ready) == (VALID_CLOCKS, READY_CLOCKS)
    tb.on = False
    await tb.step([6.0, -3.0], [0.0, 1e-4])
    assert tb.valid == 11
    await tb.step([6.0, -3.0], [0.0, 1e-4])
    assert (tb.valid, tb.ready) == (11, 26)


@cocotb.test()
async def a_motor_below_breakaway_stands_still_and_leaves_above_it(dut):
    tb = await bench(dut, HELD, HELD)
    breakaway = 2e-4 / NOMINAL[2] * NOMINAL[0]
    for _ in range(60):
        state = await tb.step([0.98 * breakaway, -0.98 * breakaway], [0.0, 0.0])
        assert (state[:, 1] == 0.0).all() and (state[:, 3] == 0.0).all()
    for _ in range(40):
        state = await tb.step([2.0 * breakaway, -2.0 * breakaway], [0.0, 0.0])
    assert state[0, 1] > 0.0 > state[1, 1]


@cocotb.test()
async def clear_at_any_clock_of_a_step_leaves_rest_and_nothing_else(dut):
    """The step under way is dropped, motors and effects are at rest, tables and coefficients stay."""
    tb = await bench(dut, RICH, RICH, SUPPLY)
    for clocks in range(56):
        for _ in range(2):
            await tb.step([8.0, -8.0], [1e-4, 0.0])
        await tb.strobe(words([8.0, -8.0]), words([0.0, 0.0]))
        for _ in range(clocks):
            await RisingEdge(dut.clk_i)
        await RisingEdge(dut.clk_i)
        dut.clear_i.value = 1
        await RisingEdge(dut.clk_i)
        dut.clear_i.value = 0
        tb.model.clear()
        for _ in range(40):
            await RisingEdge(dut.clk_i)
            await ReadOnly()
            assert not int(dut.valid_o.value), f"a step cleared {clocks} clocks after its strobe must give no valid"
        assert self_ready(dut) and tb.high() == [0, 0, 0, 0] == tb.low_words()
    await tb.step([8.0, -8.0], [1e-4, 0.0])
    await tb.step([8.0, -8.0], [1e-4, 0.0])


@cocotb.test()
async def a_strobe_in_the_clock_after_a_clear_starts_from_rest(dut):
    """Whatever was under way: what the step before had prepared is gone, too, and no friction is left."""
    tb = await bench(dut, RICH, RICH, SUPPLY)
    for clocks in range(56):
        for _ in range(2):
            await tb.step([8.0, -8.0], [1e-4, 0.0])
        await tb.strobe(words([8.0, -8.0]), words([0.0, 0.0]))
        for _ in range(clocks + 1):
            await RisingEdge(dut.clk_i)
        dut.clear_i.value = 1
        await RisingEdge(dut.clk_i)
        dut.clear_i.value = 0
        tb.model.clear()
        tb.now = True
        state = await tb.step([8.0, -8.0], [1e-4, 0.0])
        assert (state == 0.0).all(), "inputs act a step later"
        assert (tb.valid, tb.ready) == (VALID_CLOCKS, READY_CLOCKS)


@cocotb.test()
async def strobes_as_soon_as_they_may_come_with_effects_and_without(dut):
    """Every change between the two at the shortest distance: the first step with effects starts from what the plain one
    left.
    """
    tb = await bench(dut, RICH, UnitEffects(limit_v=5.0), SUPPLY)
    await tb.step([6.0, -3.0], [0.0, 1e-4])
    for k, on in enumerate((1, 1, 0, 0, 1, 0, 1, 1, 1, 0, 1, 1, 0, 0, 0, 1)):
        if tb.on != bool(on):
            tb.on, tb.now = bool(on), True
            await tb.step([6.0, -3.0], [1e-4 * k, 1e-4])  # ready later: the parameter unit finds rho, too
        for _ in range(3):
            tb.now = True
            await tb.step([6.0 - k, -3.0], [0.0, 1e-4 * (k % 3)])
            assert (tb.valid, tb.ready) == ((VALID_CLOCKS, READY_CLOCKS) if on else (11, 26))


def self_ready(dut) -> bool:
    """ready_o, read as a number."""
    return bool(int(dut.ready_o.value))


@cocotb.test()
async def words_written_at_any_clock_act_after_the_run_in_hand(dut):
    """A limit that changes under way: the run of this step has the old one, and the next the new."""
    tb = await bench(dut, UnitEffects(limit_v=6.0), UnitEffects(limit_v=6.0))
    limit = constant_address(1, 9)
    await tb.step([9.0, 9.0], [0.0, 0.0])
    for k, clock in enumerate((1, 5, 17, *range(25, 31), 42, 46, 47, 48)):
        word = int(words(1.0 + 0.5 * k))
        await tb.step([9.0, 9.0], [0.0, 0.0], write=(clock, limit, word))
        tb.model.write(limit, word)
        await RisingEdge(dut.clk_i)
        await RisingEdge(dut.clk_i)
    await tb.step([9.0, 9.0], [0.0, 0.0])


@cocotb.test()
async def addresses_beyond_the_constants_reach_no_register_of_the_engine(dut):
    """Behind the sixteen constants of a side stand temporaries and the state of its effects: no word gets there."""
    tb = await bench(dut, RICH, RICH, SUPPLY)
    for _ in range(3):
        await tb.step([8.0, -8.0], [1e-4, 0.0])
    for side in range(2):
        for register in range(16, 128):
            await RisingEdge(dut.clk_i)
            dut.word_valid_i.value = 1
            dut.word_i.value = core_records.effect_word(8192 + 128 * side + register, int(words(1000.0 + register)))
            await RisingEdge(dut.clk_i)
            dut.word_valid_i.value = 0
            await RisingEdge(dut.clk_i)
    for _ in range(3):
        await tb.step([8.0, -8.0], [1e-4, 0.0])


@cocotb.test()
async def a_nan_spreads_as_in_the_model_and_clear_ends_it(dut):
    tb = await bench(dut, RICH, UnitEffects(), SUPPLY)
    await tb.step([6.0, 6.0], [0.0, 0.0])
    nan = np.array([0x7FC00000, *words([6.0])], np.uint32)
    for v in (nan, words([6.0, 6.0]), words([6.0, 6.0]), words([6.0, 6.0]), words([6.0, 6.0]), words([6.0, 6.0])):
        await tb.step(v, words([0.0, 0.0]))
    assert int(dut.nonfinite_o.value)
    await RisingEdge(dut.clk_i)
    dut.clear_i.value = 1
    await RisingEdge(dut.clk_i)
    dut.clear_i.value = 0
    tb.model.clear()
    await RisingEdge(dut.clk_i)
    for _ in range(6):
        state = await tb.step([6.0, 6.0], [0.0, 0.0])
    assert np.isfinite(state).all()
    assert not int(dut.nonfinite_o.value)


@cocotb.test()
async def an_unusable_motor_on_one_side_keeps_both_sides_coefficients(dut):
    tb = await bench(dut, RICH, UnitEffects(motor=OTHER))
    for _ in range(3):
        await tb.step([6.0, 6.0], [0.0, 0.0])
    good, tb.own = tb.own, np.array([*tb.own[:4], 0, tb.own[5]], np.uint32)
    for _ in range(3):
        await tb.step([5.0, 6.0], [0.0, 0.0])
    assert int(dut.param_fault_o.value)
    tb.own = good
    for _ in range(3):
        await tb.step([5.0, 6.0], [0.0, 0.0])
    assert not int(dut.param_fault_o.value)


@cocotb.test()
async def random_effects_switched_and_changed_while_the_motors_turn(dut):
    rng = np.random.default_rng(5)
    tb = await bench(dut)
    left = steps = int(os.environ.get("EFFECT_STEPS", "120"))
    while left > 0:
        # Few points a curve in few tables keep the load short: one cell tables, and one of 256.
        unit = random_unit(rng)
        await tb.load(UnitEffects(motor=unit.motor, limit_v=unit.limit_v, load_share=unit.load_share, drop=unit.drop,
                                  heat_rise_per_w=unit.heat_rise_per_w, heat_tau_s=unit.heat_tau_s),
                      HELD, SUPPLY)  # fmt: skip
        for _ in range(10):
            tb.on = bool(rng.random() < 0.85)
            for _ in range(4):
                await tb.step(words(rng.normal(0.0, 4.0, 2)), words(rng.normal(0.0, 2e-4, 2)))
                left -= 1
    assert steps - left >= steps
