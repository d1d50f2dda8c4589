"""Bridge between the host's socket and rtds_sim_top, as one cocotb test that ends when the host leaves.

It awaits nothing but a toggle of sync_o (and one Timer for the reset), because the C++ main of the Verilator
build lets cocotb in at these events only. While it waits for the host simulated time stands still.
"""

from __future__ import annotations

from typing import ClassVar

import bridge
import cocotb
from cocotb.triggers import Timer, ValueChange

from rtds_host.link import core_records, protocol

CLOCK_PERIOD_PS = 20_000


class CoreBridge(bridge.Bridge):
    """Requests of the ideal link, carried out on rtds_sim_top."""

    def __init__(self, dut) -> None:
        super().__init__(dut)
        self.fx_go = 0
        self.go = 0
        self.done = ValueChange(dut.sync_o)

    async def reset(self) -> None:
        """Reset with every input at zero; the clock runs."""
        dut = self.dut
        for port in (dut.inputs_i, dut.motor_l_i, dut.motor_r_i, dut.settings_i, dut.step_clocks_i, dut.go_i,
            dut.steps_i,
                     dut.sample_steps_i, dut.fx_go_i, dut.word_i, dut.rst_ni):  # fmt: skip
            port.value = 0
        await Timer(10 * CLOCK_PERIOD_PS, unit="ps")
        dut.rst_ni.value = 1
        await Timer(2 * CLOCK_PERIOD_PS, unit="ps")

    async def set_parameters(self, payload: bytes) -> tuple[int, bytes]:
        words = protocol.PARAMETERS_PAYLOAD.unpack(payload)
        method, step_clocks, on, own, delay, stride = words[13:]
        dut = self.dut
        dut.motor_l_i.value = core_records.motor(words[:6])
        dut.motor_r_i.value = core_records.motor(words[7:13])
        dut.settings_i.value = core_records.settings(words[6], method, on, own, delay, stride)
        dut.step_clocks_i.value = step_clocks
        return protocol.DONE, b""

    async def set_effects(self, payload: bytes) -> tuple[int, bytes]:
        dut = self.dut
        for address, word in protocol.EFFECT_WORD.iter_unpack(payload):
            dut.word_i.value = core_records.effect_word(address, word)
            self.fx_go ^= 1
            dut.fx_go_i.value = self.fx_go
            await self.done
        return protocol.DONE, b""

    async def exchange(self, payload: bytes) -> tuple[int, bytes]:
        *words, steps, sample_steps = protocol.EXCHANGE_PAYLOAD.unpack(payload)
        rows = -(-steps // sample_steps) if sample_steps else 0
        if not 1 <= rows <= protocol.MAX_SAMPLES:
            raise bridge.Refused(f"{rows} samples asked for in one request, 1 to {protocol.MAX_SAMPLES} are kept")
        dut = self.dut
        dut.inputs_i.value = core_records.inputs(words)
        dut.steps_i.value = steps
        dut.sample_steps_i.value = sample_steps
        self.go ^= 1
        dut.go_i.value = self.go
        await self.done
        flags = bridge.word(dut.flags_o)
        if flags & protocol.FLAG_STUCK:
            head = protocol.SAMPLES_HEAD.pack(flags, 0, 0)
            return protocol.SAMPLES, head
        samples = bridge.low_bits(dut.samples_q, 128 * rows)
        head = protocol.SAMPLES_HEAD.pack(flags, bridge.word(dut.step_count_o), bridge.now_ps() // CLOCK_PERIOD_PS)
        return protocol.SAMPLES, head + samples.to_bytes(16 * rows, "little")

    handlers: ClassVar = {
        protocol.PARAMETERS: set_parameters,
        protocol.EFFECTS: set_effects,
        protocol.EXCHANGE: exchange,
    }


@cocotb.test()
async def serve(dut) -> None:
    """Answer the host until it leaves."""
    await CoreBridge(dut).serve()
