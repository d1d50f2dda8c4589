"""What the chip does when nothing is wrong: every code on the DAC is the bit-exact model's, always as late."""

import itertools
import os

import cocotb
import numpy as np
from chip import LED_NAMES, SAFE, Chip, lit, read_inside, running, write_inside
from cocotb.triggers import RisingEdge, Timer, ValueChange

from rtds_host.link.registers import load_map
from rtds_host.link.scaling import DAC_OUTPUTS

LONG = bool(os.environ.get("LONG"))
DAC_PROTOCOL_CLOCKS = 22
LIMIT_CLOCKS = 75
LOCK_CLOCKS = 63  # of a good lock before anything is released, of the 50 MHz
LOCK_SYNC_CLOCKS = 11  # from there to the release: synchronisers on both ends, see reset_ctrl
MAP = load_map()
ALWAYS = {"locked", "ADC alive", "running"}  # what lights when all is well, but for the one that blinks


@cocotb.test()
async def every_step_is_the_models(dut):
    """Random codes in every conversion, parameters included: each LDAC shows exactly what the model predicts."""
    chip = await running(dut)
    chip.adc.fixed = None
    await chip.until_steps(400 if LONG else 60)
    assert len(set(chip.shown)) > 40, "the outputs move"
    assert set(chip.latencies) == {chip.latencies[0]}, f"clocks from record to LDAC: {sorted(set(chip.latencies))}"
    chip.check()
    spread = max(chip.nanoseconds) - min(chip.nanoseconds)
    assert spread < 0.001, "with both clocks of one PLL the whole path has one length"
    clocks = chip.nanoseconds[0] / 20.0
    dut._log.info(
        f"record to LDAC {chip.latencies[0]} clocks, end of sequence to LDAC {chip.nanoseconds[0]:.1f} ns"
        f" = {clocks:.2f} clocks of 50 MHz, of which the DAC's protocol takes {DAC_PROTOCOL_CLOCKS}"
    )
    assert clocks <= LIMIT_CLOCKS
    last, largest = (int(dut.chip.latency.value) >> shift & 0xFFFF for shift in (0, 16))
    assert (last, largest) == (chip.latencies[0], chip.latencies[0]), "register LATENCY tells the same"
    assert chip.now != SAFE
    made = int(dut.chip.u_port.u_regs.steps_q.value)
    assert made == chip.steps, f"{made} steps, {chip.steps} of them from a record after all parameters were read"


PADS_PS = (0, 2_500, 5_000) if LONG else (0, 5_000)
CONVERSIONS_PS = (1_300_000, 1_600_000)  # the LTC2308's typical and longest


async def conversions_of_any_length(chip):
    """Each conversion takes its own time, the two ends often among them."""
    while True:
        ends = chip.rng.random() < 0.5
        chip.dut.t_conv.value = chip.rng.choice(CONVERSIONS_PS) if ends else chip.rng.randint(*CONVERSIONS_PS)
        await ValueChange(chip.dut.conversions)


@cocotb.test()
async def every_pad_and_conversion_time(dut):
    """Pads of 0 to 5 ns, each its own, conversions from the typical to the longest: codes right, no time violated.

    Of the ADC's four pins every combination, the DAC's pins and the conversions at random.
    """
    chip = await running(dut)
    chip.adc.fixed = None
    cocotb.start_soon(conversions_of_any_length(chip))
    for corner in itertools.product(PADS_PS, repeat=4):
        for pad, delay in zip((dut.d_convst, dut.d_sck, dut.d_sdi, dut.d_sdo), corner, strict=True):
            pad.value = delay
        for pad in (dut.d_bus, dut.d_cs, dut.d_ldac, dut.d_reset):
            pad.value = chip.rng.choice(PADS_PS)
        chip.forget()
        await chip.power_up()
        await chip.until_steps(2)
        assert chip.now == chip.predicted, f"pads {corner}"
        chip.check()
    # What the clocks leave of the data sheet's window of 10 ns with pads 5 ns apart, as seen by the part: nothing, and
    # no less.
    seen = {name: int(getattr(dut.adc, name).value) for name in ("first_sck_min", "acquisition_min", "convst_high_min")}
    assert seen == {"first_sck_min": 1_600_000, "acquisition_min": 240_000, "convst_high_min": 25_000}
    assert set(chip.latencies) == {chip.latencies[0]}, "the parts' times are not the chip's"


@cocotb.test()
async def nothing_is_released_before_the_lock_has_proved_itself(dut):
    """At the chip's own parameters: so many clocks of a good lock, and a lock a little shorter releases nothing."""
    chip = Chip(dut)
    chip.fixed()
    await chip.power_up(lock=False)
    await RisingEdge(dut.clk_sys)
    dut.locked.value = 1
    await chip.clocks(LOCK_CLOCKS - 1)
    dut.locked.value = 0
    await chip.clocks(2 * LOCK_CLOCKS)
    assert int(dut.chip.rst_run_n.value) == 0 and int(dut.chip.rst_adc_n.value) == 0
    dut.locked.value = 1
    count = 0
    while not int(dut.chip.rst_run_n.value):
        await RisingEdge(dut.clk_sys)
        count += 1
        assert count < 4 * LOCK_CLOCKS
    assert abs(count - LOCK_CLOCKS - LOCK_SYNC_CLOCKS) <= 1, f"released {count} clocks after the lock"


@cocotb.test()
async def each_observed_word_is_the_one_it_is_called(dut):
    """States, inputs, parameters and codes, all different, read at their addresses: none at another one's."""
    chip = await running(dut, steps=2)
    chip.adc.fixed = [3000, 2600, 2100, 1950, 1803, 1705, 1716, 1727]
    await chip.until_steps(9)  # every parameter channel has been read with these codes
    await write_inside(dut, "CONTROL", 0)
    await Timer(25, "us")  # the step in hand and the DAC's write are done
    record = chip.records[-1]  # the last one that came, whether a step was made of it or not
    wanted = chip.observed | {
        "CODES_V": record.v_r << 16 | record.v_l,
        "CODES_T": record.t_r << 16 | record.t_l,
        "CODES_P": record.index << 16 | record.p,
    }
    words = {name: await read_inside(dut, name) for name in wanted}
    assert not {name: (word, wanted[name]) for name, word in words.items() if word != wanted[name]}
    assert len(set(words.values())) == len(words), "no two of them alike, so that none can stand for another"
    assert {name.removeprefix("NOW_").lower() for name in words} >= set(DAC_OUTPUTS)
    chip.check()


@cocotb.test()
async def each_led_shows_its_own_cause(dut):
    """LEDs 0 to 7: clock alive, locked, halted, safe value, parameter fault, ADC alive, serial traffic, running."""
    chip = Chip(dut)
    chip.fixed(v=(3000, 2600))
    await chip.power_up(lock=False)
    assert lit(dut) <= {"running", "safe value"}, "without a lock"
    assert "locked" not in lit(dut) and "ADC alive" not in lit(dut)
    dut.locked.value = 1
    await chip.until_steps(2)
    assert lit(dut) == ALWAYS
    # The clock's LED changes with bit 24 of a counter (0.34 s): from just below it to just above.
    dut.chip.u_report.blink_q.value = (1 << 24) - 3
    await chip.clocks(2)
    assert "clock alive" not in lit(dut)
    await chip.clocks(5)
    assert lit(dut) == ALWAYS | {"clock alive"}
    dut.chip.u_report.blink_q.value = 0
    await chip.clocks(2)
    dut.uart_rx.value = 0
    await Timer(100, "ns")
    assert lit(dut) == ALWAYS | {"serial traffic"}
    dut.uart_rx.value = 1
    # A parameter that is none.
    await write_inside(dut, "CONFIG", 0x3000)
    await write_inside(dut, "R", 0)
    await write_inside(dut, "COMMAND", 1)
    await chip.until_steps(3)
    assert lit(dut) == ALWAYS | {"parameter fault"}
    await write_inside(dut, "R", MAP.named("R").reset)
    await write_inside(dut, "COMMAND", 1)
    await chip.until_steps(3)
    assert lit(dut) == ALWAYS
    # Safe value without a halt, halted with it, stopped.
    await write_inside(dut, "CONTROL", 3)
    await Timer(25, "us")
    assert lit(dut) == ALWAYS | {"safe value"}
    await write_inside(dut, "CONTROL", 1)
    await chip.until_steps(2)
    await write_inside(dut, "CONTROL", 0)
    await Timer(25, "us")
    assert lit(dut) == {"locked"}
    await write_inside(dut, "CONTROL", 1)
    await chip.until_steps(1)
    await write_inside(dut, "CONFIG", 0)
    await write_inside(dut, "V_L", int(np.array(np.nan, np.float32).view(np.uint32)))
    await write_inside(dut, "COMMAND", 1)
    await Timer(40, "us")
    assert lit(dut) == ALWAYS | {"halted", "safe value"}
    # A dead line.
    dut.sdo_stuck.value = 1
    await Timer(45, "us")
    assert lit(dut) == (ALWAYS | {"halted", "safe value"}) - {"ADC alive"}
    assert len(LED_NAMES) == 8
