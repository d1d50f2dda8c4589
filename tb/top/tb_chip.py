"""What the chip does when nothing is wrong: every code on the DAC is the bit-exact model's, always as late."""

import os

import cocotb
from chip import SAFE, running

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
    made = int(dut.chip.u_regs.steps_q.value)
    assert made == chip.steps, f"{made} steps, {chip.steps} of them from a record after all parameters were read"
