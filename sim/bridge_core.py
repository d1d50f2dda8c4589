"""Bridge between the host's socket and rtds_sim_top, as one cocotb test that ends when the host leaves.

It awaits nothing but a toggle of sync_o (and one Timer for the reset), because the C++ main of the Verilator
build lets cocotb in at these events only. While it waits for the host simulated time stands still.
"""

from __future__ import annotations

from typing import ClassVar

import bridge
import cocotb
from cocotb.triggers import Timer, ValueChange

from rtds_host.link import protocol

PARAMETER_PORTS = ("p_r_i", "p_l_i", "p_km_i", "p_kb_i", "p_j_i", "p_b_i", "p_h_i")
SECOND_PORTS = ("p2_r_i", "p2_l_i", "p2_km_i", "p2_kb_i", "p2_j_i", "p2_b_i")
SETTING_PORTS = ("method_i", "step_clocks_i", "fx_on_i", "fx_own_i", "fx_delay_i", "fx_stride_i")
INPUT_PORTS = ("v_l_i", "v_r_i", "t_l_i", "t_r_i")
CLOCK_PERIOD_PS = 20_000


class CoreBridge(bridge.Bridge):
    """Requests of the ideal link, carried out on rtds_sim_top."""

    def __init__(self, dut) -> None:
        super().__init__(dut)
        self.inputs = [getattr(dut, name) for name in INPUT_PORTS]
        self.parameters = [getattr(dut, name) for name in (*PARAMETER_PORTS, *SECOND_PORTS, *SETTING_PORTS)]
        self.fx_go = 0
        self.go = 0
        self.done = ValueChange(dut.sync_o)

    async def reset(self) -> None:
        """Reset with every input at zero; the clock runs."""
        dut = self.dut
        for port in (*self.inputs, *self.parameters):
            port.value = 0
        for port in (dut.go_i, dut.steps_i, dut.sample_steps_i, dut.fx_go_i, dut.fx_addr_i, dut.fx_data_i, dut.rst_ni):
            port.value = 0
        await Timer(10 * CLOCK_PERIOD_PS, unit="ps")
        dut.rst_ni.value = 1
        await Timer(2 * CLOCK_PERIOD_PS, unit="ps")

    async def set_parameters(self, payload: bytes) -> tuple[int, bytes]:
        for port, word in zip(self.parameters, protocol.PARAMETERS_PAYLOAD.unpack(payload)):
            port.value = word
        return protocol.DONE, b""

    async def set_effects(self, payload: bytes) -> tuple[int, bytes]:
        dut = self.dut
        for address, word in protocol.EFFECT_WORD.iter_unpack(payload):
            dut.fx_addr_i.value = address
            dut.fx_data_i.value = word
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
        for port, word in zip(self.inputs, words):
            port.value = word
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
