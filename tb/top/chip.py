"""The chip's bench: drives what is around the pins, predicts every code on the DAC, watches what must never happen."""

from __future__ import annotations

import random

import cocotb
import numpy as np
from agents.dac7624 import unpack
from agents.dac7624 import violated as dac_violated
from agents.ltc2308 import Ltc2308
from agents.serial_line import BridgedTransport, SerialLine
from cocotb.task import bridge
from cocotb.triggers import FallingEdge, ReadOnly, RisingEdge, Timer, ValueChange, with_timeout
from cocotb.utils import get_sim_time

from rtds_host.link.registers import RegisterClient, load_map, word_float
from rtds_host.link.scaling import DAC_OUTPUTS, AdcScale, DacScale
from rtds_host.motor.model import CoreModel

MAP = load_map()
CONFIG = [r.name for r in MAP.config]
SAFE = (2048,) * 4
STEP_CLOCKS = 500
BIT_PS = 8 * 20_000


# LEDs from 0 on, as docs/chip.md has them.
LED_NAMES = (
    "clock alive", "locked", "halted", "safe value", "parameter fault", "ADC alive", "serial traffic", "running",
)  # fmt: skip


def lit(dut):
    """Names of the LEDs that light."""
    return {name for k, name in enumerate(LED_NAMES) if int(dut.led.value) >> k & 1}


async def write_inside(dut, name, word):
    """A bus write at a chosen clock: what a frame ends in, without its 90 bit times."""
    regs = dut.chip.u_port.u_bridge
    regs.frame_q.value = (
        0x02 << 56 | MAP.named(name).address << 48 | int.from_bytes(word.to_bytes(4, "little"), "big") << 16
    )
    regs.write_q.value = 1
    await RisingEdge(dut.clk_sys)
    await RisingEdge(dut.clk_sys)


async def read_inside(dut, name):
    """A bus read: the word that a frame would bring, without its 180 bit times."""
    regs = dut.chip.u_port.u_bridge
    regs.frame_q.value = 0x01 << 56 | MAP.named(name).address << 48
    regs.read_q.value = 1
    for _ in range(8):
        await RisingEdge(dut.clk_sys)
        await ReadOnly()
        if int(dut.chip.u_port.avs_readdatavalid.value):
            word = int(dut.chip.u_port.avs_readdata.value)
            await RisingEdge(dut.clk_sys)
            return word
    raise AssertionError(f"no answer from {name}")


class Record:
    """One ADC record as the pipeline gets it, and what became of it."""

    def __init__(self, word, time_ps):
        fields = [word >> 12 * k & 0xFFF for k in range(5)]
        self.v_l, self.v_r, self.t_l, self.t_r, self.p = fields
        self.index = word >> 60 & 3
        self.time_ps = time_ps


class Chip:
    """Everything around the pins of `chip_tb`, and the prediction of what the pins do."""

    def __init__(self, dut, seed=1):
        self.dut = dut
        self.ctrl = dut.chip.u_ctrl
        self.rng = random.Random(seed)
        self.adc = Ltc2308(
            dut.adc_codes, dut.conversions, dut.adc_channel, dut.adc_channel_known, dut.adc_last_convst,
            dut.adc_violations, seed,
        )  # fmt: skip
        self.line = SerialLine(dut.uart_rx, dut.uart_tx, BIT_PS)
        self.records: list[Record] = []
        self.shown: list[tuple[int, ...]] = []  # codes of every change at the DAC's outputs
        self.latencies: list[int] = []  # clocks from the record to LDAC
        self.nanoseconds: list[float] = []  # from the end of the sequence in 40 MHz to LDAC
        self.steps = 0
        self.forget()
        self._started = None  # times of a record on its way to the DAC, and of its sequence's end
        self._end_ps = 0
        for watch in (self._pipeline, self._writes, self._ends, self._resets, self._outputs):
            cocotb.start_soon(watch())

    # --- prediction ---------------------------------------------------------------------------------------------

    def forget(self):
        """The state of a chip that was reset."""
        self.core = CoreModel()
        self.parameters = np.zeros(4, np.uint32)  # B J Km Kb from the ADC
        self.read = set()
        self.predicted = SAFE
        self.allowed = {SAFE}
        self.observed = {}  # words to be observed after the last step but for the record's codes, name -> word

    def config(self, from_next_clock=False):
        """The configuration in force, name -> word (a white look: which set counts is tested by `tb/regs`)."""
        regs = self.dut.chip.u_port.u_regs
        word = int((regs.shadow_q if from_next_clock and int(regs.take_q.value) else self.dut.chip.cfg).value)
        return {name: word >> 32 * k & 0xFFFFFFFF for k, name in enumerate(CONFIG)}

    def _predict(self, record):
        """Codes after the step that this record starts; None when it starts none."""
        cfg = self.config(from_next_clock=True)  # nothing of it is read in the clock of the record
        bits = {f.name: cfg["CONFIG"] >> f.bit & 1 for f in MAP.named("CONFIG").fields}

        def scaled(name, code, signed):
            gain, offset = (np.float32(word_float(cfg[f"ADC_{name}_{what}"])) for what in ("GAIN", "OFFSET"))
            value = np.float32(AdcScale(gain, offset, signed).decode(code))
            return int(value.view(np.uint32)) if not np.isnan(value) else 0x7FC00000

        parameter = ("B", "J", "KM", "KB")[record.index]
        self.parameters[record.index] = scaled(parameter, record.p, False)
        self.read.add(record.index)
        sources = [bits[f"{name.lower()}_from_adc"] for name in ("B", "J", "KM", "KB")]
        if any(sources) and len(self.read) < 4:
            return None
        b, j, km, kb = (
            int(self.parameters[k]) if sources[k] else cfg[name] for k, name in enumerate(("B", "J", "KM", "KB"))
        )
        codes = {"V_L": record.v_l, "V_R": record.v_r, "T_L": record.t_l, "T_R": record.t_r}
        v, t = (
            [
                scaled(n, codes[n], True) if bits[f"{kind}_from_adc"] else cfg[n]
                for n in (f"{kind.upper()}_L", f"{kind.upper()}_R")
            ]
            for kind in ("v", "t")
        )
        words = np.array([cfg["R"], cfg["L"], km, kb, j, b, cfg["H"]], np.uint32)
        state = self.core.strobe(np.array(v, np.uint32), np.array(t, np.uint32), words, bits["method"])
        self.steps += 1
        values = dict(zip(DAC_OUTPUTS, np.ascontiguousarray(state[:, :2]).view(np.float32).ravel()))
        now = np.ascontiguousarray(state[:, :2]).ravel().view(np.uint32).tolist()  # i_l, w_l, i_r, w_r
        self.observed = dict(zip(("NOW_I_L", "NOW_W_L", "NOW_I_R", "NOW_W_R"), now, strict=True))
        self.observed |= {"NOW_V_L": v[0], "NOW_V_R": v[1], "NOW_T_L": t[0], "NOW_T_R": t[1]}
        self.observed |= {"NOW_B": b, "NOW_J": j, "NOW_KM": km, "NOW_KB": kb}
        shown = []
        for name in DAC_OUTPUTS:
            gain, offset = (np.float32(word_float(cfg[f"DAC_{name.upper()}_{what}"])) for what in ("GAIN", "OFFSET"))
            shown.append(int(DacScale(gain, offset).encode(values[name])[0]))
        self.observed |= {"CODES_L": shown[1] << 16 | shown[0], "CODES_R": shown[3] << 16 | shown[2]}
        return tuple(shown)

    async def _pipeline(self):
        """Follow each admitted record: its prediction becomes what the DAC may show."""
        chip = self.dut.chip
        while True:
            await RisingEdge(chip.record_valid)
            await ReadOnly()
            record = Record(int(chip.record.value), get_sim_time("ps"))
            self.records.append(record)
            if int(chip.scale_start.value):
                codes = self._predict(record)
                if codes is not None:
                    self.predicted = codes
                    self.allowed = self.allowed | {codes}
                    self._started = (record.time_ps, self._end_ps)

    async def _writes(self):
        """The LDAC edge of each step: how long it took, and from here on its codes alone (or the safe ones) count."""
        while True:
            await FallingEdge(self.dut.dac_ldac_n)
            now = get_sim_time("ps")
            await ReadOnly()
            if self._started and int(self.ctrl.written_q.value) and int(self.dut.chip.rst_run_n.value):
                start, end = self._started
                self.latencies.append(round((now - start) / 20_000))
                self.nanoseconds.append((now - end) / 1000)
                self.allowed = {self.predicted, SAFE}
                self._started = None

    async def _ends(self):
        while True:
            await RisingEdge(self.dut.chip.u_front.valid_adc)
            self._end_ps = get_sim_time("ps")

    async def _resets(self):
        while True:
            await FallingEdge(self.dut.chip.rst_run_n)
            self._started = None

    async def _outputs(self):
        """Whatever the DAC shows is one whole predicted set, or the safe one: never torn, never anything else."""
        while True:
            await ValueChange(self.dut.dac_codes)
            await ReadOnly()
            codes = unpack(int(self.dut.dac_codes.value))
            self.shown.append(codes)
            assert codes in self.allowed, f"the DAC shows {codes}, allowed are {sorted(self.allowed)}"

    # --- driving ------------------------------------------------------------------------------------------------

    async def power_up(self, lock=True):
        """Reset, then lock."""
        dut = self.dut
        dut.ext_rst_n.value = 0
        dut.locked.value = 0
        dut.agent_clear.value = 1
        dut.forgive.value = 1
        dut.jitter.value = 0
        dut.adc_stopped.value = 0
        dut.sys_stopped.value = 0
        dut.sdo_stuck.value = 0
        await Timer(300, "ns")
        dut.forgive.value = 0
        dut.agent_clear.value = 0
        dut.ext_rst_n.value = 1
        await Timer(1, "us")
        dut.locked.value = int(lock)

    async def clocks(self, count):
        for _ in range(count):
            await RisingEdge(self.dut.clk_sys)

    async def until_steps(self, count, timeout_us=None):
        """Until `count` more steps have reached the DAC. Raises SimTimeoutError when they do not."""
        goal = len(self.latencies) + count

        async def wait():
            while len(self.latencies) < goal:
                await RisingEdge(self.dut.dac_ldac_n)

        await with_timeout(wait(), timeout_us or 60 + 10 * count + 60, "us")
        await Timer(100, "ns")

    async def client(self, function, *args):
        """Run a blocking function of the register client against the serial pins."""

        def use():
            return function(RegisterClient(BridgedTransport(self.line, 200 * BIT_PS), where="simulation"), *args)

        return await bridge(use)()

    def fixed(self, v=(2048, 2048), t=(2048, 2048), b=1800, j=1700, km=1714, kb=1714):
        """Codes that every conversion gives from now on (the default: the default motor at rest)."""
        self.adc.fixed = [*v, *t, b, j, km, kb]

    def check(self):
        """No time of either part's data sheet was violated, and the outputs are those of the last step."""
        self.adc.check()
        broken = dac_violated(int(self.dut.dac_violations.value))
        assert not broken, f"DAC data sheet violated: {sorted(broken)}"

    @property
    def now(self):
        """What the DAC shows."""
        return unpack(int(self.dut.dac_codes.value))


async def running(dut, seed=1, steps=1):
    """A chip with a motor at its pins, `steps` steps done."""
    chip = Chip(dut, seed)
    chip.fixed(v=(3000, 2600), t=(2100, 2000))
    await chip.power_up()
    await chip.until_steps(steps)
    return chip
