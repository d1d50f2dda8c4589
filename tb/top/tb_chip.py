"""What the chip does when nothing is wrong: every code on the DAC is the bit-exact model's, always as late."""

import itertools
import os

import cocotb
from chip import SAFE, running
from cocotb.triggers import ValueChange

LONG = bool(os.environ.get("LONG"))
DAC_PROTOCOL_CLOCKS = 22
LIMIT_CLOCKS = 75


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
