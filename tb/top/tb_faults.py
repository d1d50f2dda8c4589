"""What the chip does when something is wrong: it recovers or stops safely, a flag tells, the DAC shows nothing torn.

`Chip` checks in the background, at every change of the DAC's outputs, that they are one whole predicted set or the
safe one; each test below adds what has to happen for its fault. LONG widens the sweeps.
"""

import os

import cocotb
from chip import SAFE, STEP_CLOCKS, Chip, running, write_inside
from cocotb.handle import Force, Release
from cocotb.triggers import ReadOnly, RisingEdge, Timer, ValueChange
from cocotb.utils import get_sim_time

from rtds_host.link.registers import float_word, load_map, word_float

LONG = bool(os.environ.get("LONG"))
MAP = load_map()
STATUS = {f.name: 1 << f.bit for f in MAP.named("STATUS").fields}
LIVE = {f.name: 1 << f.bit for f in MAP.named("LIVE").fields}
REGISTERS_ONLY = 0  # CONFIG: nothing from the ADC
NUMBERS = {"nan": float("nan"), "inf": float("inf"), "minus_inf": float("-inf"), "zero": 0.0, "negative": -1.0}


def status(dut):
    """The sticky flags, looked at without the serial line."""
    word = int(dut.chip.u_port.u_regs.status_q.value)
    return {name for name, mask in STATUS.items() if word & mask}


async def clear_status(dut):
    """Forget the flags, as a written 1 would."""
    dut.chip.u_port.u_regs.status_q.value = 0
    await RisingEdge(dut.clk_sys)
    await RisingEdge(dut.clk_sys)


async def into_the_shadow(dut):
    """What was written last stands there, on either simulator seen after its edge."""
    for _ in range(3):
        await RisingEdge(dut.clk_sys)


async def stays(chip, codes, microseconds):
    """The outputs hold these codes all the time."""
    for _ in range(microseconds * 2):
        await Timer(500, "ns")
        assert chip.now == codes, f"{chip.now} instead of {codes}"


def phases(count_long, count_light):
    """Clocks of a step at which a fault is tried: all of them, or some that hit every part of it over time."""
    count = count_long if LONG else count_light
    return [round(k * STEP_CLOCKS / count) for k in range(count)]


async def at_phase(dut, phase):
    """That many clocks after the next record."""
    await RisingEdge(dut.chip.record_valid)
    for _ in range(phase):
        await RisingEdge(dut.clk_sys)


@cocotb.test()
async def reset_at_every_phase(dut):
    """The button at any moment of a conversion and of a step: mid-scale at once, then as after power-up."""
    chip = await running(dut)
    for phase in phases(500, 7):
        chip.fixed(v=(chip.rng.randrange(1, 4095), 2600))
        await at_phase(dut, phase)
        await Timer(chip.rng.randint(1, 20000), "ps")  # off the clock
        dut.ext_rst_n.value = 0
        dut.agent_clear.value = 1
        dut.forgive.value = 1
        await Timer(30, "ns")
        assert chip.now == SAFE, "a DAC7624 in reset shows mid-scale, without a clock"
        chip.forget()
        await Timer(chip.rng.randint(1, 200), "ns")
        dut.agent_clear.value = 0
        dut.forgive.value = 0
        dut.ext_rst_n.value = 1
        await chip.until_steps(2)
        assert chip.now == chip.predicted != SAFE
    chip.check()


@cocotb.test()
async def lock_lost_at_every_phase(dut):
    """A lost lock at any moment: safe at once, registers live and tell, and with the lock it starts from rest."""
    chip = await running(dut)
    await write_inside(dut, "SCRATCH", 0x5CA7C4)
    for number, phase in enumerate(phases(500, 7)):
        await clear_status(dut)
        await at_phase(dut, phase)
        await Timer(chip.rng.randint(1, 20000), "ps")
        dut.locked.value = 0
        dut.adc_stopped.value = number % 2  # with or without the PLL's clocks
        dut.agent_clear.value = 1
        await Timer(30, "ns")
        assert chip.now == SAFE
        chip.forget()
        await Timer(1 if number % 3 == 0 else 3000, "ns")
        dut.locked.value = 1
        dut.adc_stopped.value = 0
        dut.forgive.value = 1  # the cut cycle and the cut reset
        await Timer(200, "ns")
        dut.forgive.value = 0
        dut.agent_clear.value = 0
        assert "lock_lost" in status(dut)
        assert int(dut.chip.u_port.u_regs.scratch_q.value) == 0x5CA7C4, "registers survive"
        await chip.until_steps(2)
        assert chip.now == chip.predicted != SAFE
    chip.check()


async def moves_with_the_clock(dut, signal):
    """Ends the test when the signal changes between two edges of the 50 MHz."""
    edge = -1

    async def edges():
        nonlocal edge
        while True:
            await RisingEdge(dut.clk_sys)
            edge = get_sim_time("ps")

    cocotb.start_soon(edges())
    while True:
        await ValueChange(signal)
        await ReadOnly()
        assert get_sim_time("ps") == edge, f"{signal._name} moves {get_sim_time('ps') - edge} ps after the clock"


async def commit_and_clear(dut, number):
    """Another configuration into the shadow after the next record, then both commands; its words, {name: word}, and the
    sets of before and after."""
    regs = dut.chip.u_port.u_regs
    await RisingEdge(dut.chip.record_valid)
    values = {"R": 8.6 * (1 + number % 5), "DAC_W_R_OFFSET": 50.0 * (-1) ** number}
    words = {name: MAP.named(name).to_word(value) for name, value in values.items()}
    for name, word in words.items():
        await write_inside(dut, name, word)
    await into_the_shadow(dut)
    old, new = int(regs.active_q.value), int(regs.shadow_q.value)
    await write_inside(dut, "COMMAND", 3)
    return words, old, new


async def clocks_to_the_take_over(dut, number):
    """Clocks from the commands to the edge at which the configuration is another one, with a lock that holds."""
    _, old, new = await commit_and_clear(dut, number)
    for clock in range(STEP_CLOCKS):
        if int(dut.chip.u_port.u_regs.active_q.value) == new != old:
            return clock
        await RisingEdge(dut.clk_sys)
        await ReadOnly()
    raise AssertionError("not taken over before the next record")


@cocotb.test()
async def lock_lost_at_every_clock_of_a_commit(dut):
    """A lock lost while a commit and a clear wait: what takes them over moves with the clock alone, and takes all of
    it.
    """
    chip = await running(dut)
    regs = dut.chip.u_port.u_regs
    for signal in (regs.commit_now, regs.clear_now, regs.fx_ready_i, regs.step_i):
        cocotb.start_soon(moves_with_the_clock(dut, signal))
    # The commands are carried out when the step is done, 127 clocks after its record. The sweep follows that clock: of
    # a lock lost 4 clocks before the take-over the reset comes as it is asked for, 3 before in its own clock.
    taken_over = await clocks_to_the_take_over(dut, 2)
    chip.core.clear()
    await chip.until_steps(1)
    clocks = range(taken_over + 10) if LONG else (0, 3, 60, *range(taken_over - 8, taken_over + 4), taken_over + 9)
    done = []  # whether the take-over was behind when the lock was lost
    for number, clock in enumerate(clocks):
        words, old, new = await commit_and_clear(dut, number)
        for _ in range(clock):
            await RisingEdge(dut.clk_sys)
        await Timer(chip.rng.randint(1, 19999), "ps")  # off the clock
        dut.locked.value = 0
        dut.agent_clear.value = 1
        done.append(int(regs.active_q.value) == new)
        for _ in range(12):
            assert int(regs.active_q.value) in (old, new), "half of a configuration"
            await RisingEdge(dut.clk_sys)
        assert {name: chip.config()[name] for name in words} == words, "taken over while the core stands in reset"
        assert not int(regs.commit_pending_q.value) and not int(regs.clear_pending_q.value)
        chip.forget()
        dut.locked.value = 1
        dut.forgive.value = 1  # the cut cycle
        await Timer(200, "ns")
        dut.forgive.value = 0
        dut.agent_clear.value = 0
    assert done == [clock >= taken_over for clock in clocks], (
        f"the take-over at {taken_over} was not where it was measured"
    )
    await chip.until_steps(2)
    assert chip.now == chip.predicted != SAFE


@cocotb.test()
async def one_lost_record_is_told_once(dut):
    """A dead line for one sequence: one event, none after the line has been repaired. The clocks stand so that the
    crossing takes now a clock more, now one less: then the next good record comes 20 us after the last one, or a clock
    later."""
    chip = await running(dut)
    await RisingEdge(dut.chip.u_front.valid_adc)
    request = round(get_sim_time("ps")) + 25_000
    dut.phase.value = (10_000 - request) % 20_000  # onto a rising edge of the 50 MHz
    dut.jitter.value = 100
    dut.forgive.value = 1
    await Timer(100, "ns")  # the moved edge
    dut.forgive.value = 0
    events = []

    async def watch():
        while True:
            await RisingEdge(dut.clk_sys)
            if int(dut.chip.silent_event.value):
                events.append(get_sim_time("ns"))

    cocotb.start_soon(watch())
    for trial in range(60 if LONG else 16):
        await chip.until_steps(1)
        events.clear()
        dut.sdo_stuck.value = 1
        await RisingEdge(dut.chip.u_front.silent_adc)
        dut.sdo_stuck.value = 0
        await RisingEdge(dut.chip.record_valid)
        await Timer(1, "us")
        assert len(events) == 1, f"trial {trial}: events at {events} ns"
        assert int(dut.chip.alive.value)


@cocotb.test()
async def dead_sdo(dut):
    """SDO at 0, at 1, undefined, floating: no step, the safe value, the flag; afterwards the motor goes on."""
    chip = await running(dut, steps=3)
    for level in (0, 1, "X", "Z"):
        await clear_status(dut)
        before = chip.steps
        dut.sdo_level.value = level
        dut.sdo_stuck.value = 1
        await Timer(45, "us")
        assert "adc_silent" in status(dut), f"SDO at {level}"
        assert chip.now == SAFE
        assert chip.steps <= before + 2, "at most the sequence in which it began"
        assert not int(dut.chip.alive.value)
        halted = chip.steps
        await stays(chip, SAFE, 30)
        assert chip.steps == halted
        dut.sdo_stuck.value = 0
        await chip.until_steps(2)
        assert chip.now == chip.predicted != SAFE, "the state was kept"
        assert int(dut.chip.alive.value)
    # Stopped, repaired, started again: nothing is left of the dead line.
    dut.sdo_stuck.value = 1
    await Timer(45, "us")
    await write_inside(dut, "CONTROL", 0)
    await Timer(25, "us")  # the sequence in hand ends, still dead
    dut.sdo_stuck.value = 0
    await clear_status(dut)
    await write_inside(dut, "CONTROL", 1)
    await chip.until_steps(2)
    assert chip.now == chip.predicted != SAFE
    assert "adc_silent" not in status(dut)
    chip.check()


@cocotb.test()
async def silent_clock(dut):
    """The ADC's clocks stop while the lock says nothing: 20 us later the DAC is safe and the flag is up."""
    chip = await running(dut, steps=2)
    dut.adc_stopped.value = 1
    dut.agent_clear.value = 1
    await Timer(25, "us")
    assert chip.now == SAFE
    assert "adc_silent" in status(dut)
    dut.forgive.value = 1
    dut.adc_stopped.value = 0
    await Timer(4, "us")  # the cycle that was cut
    dut.forgive.value = 0
    dut.agent_clear.value = 0
    await chip.until_steps(4)
    assert chip.now == chip.predicted != SAFE


@cocotb.test()
async def system_clock_falters(dut):
    """The 50 MHz stands while records go on coming: one that cannot be taken is told, and no step is half of two.

    Every record brings other parameters. Even so the core is ready again before a record is admitted: no overrun.
    """
    chip = await running(dut, steps=5)
    chip.adc.fixed = None
    # Clocks from the restart, with a record waiting in the crossing, to the next record (< 0: that one came before it).
    for clocks, told in ((-50, {"dropped"}), (40, {"dropped"}), (145, set())):
        await chip.until_steps(5)
        await clear_status(dut)
        await RisingEdge(dut.chip.u_front.valid_adc)
        await Timer(8, "us")
        dut.sys_stopped.value = 1
        await Timer(12_000 - 20 * clocks, "ns")
        dut.sys_stopped.value = 0
        await chip.until_steps(3)
        assert status(dut) & {"dropped", "overrun"} == told, f"{clocks} clocks: {status(dut)}"
        assert chip.now == chip.predicted
        await clear_status(dut)
        await chip.until_steps(2)
        assert not status(dut) & {"dropped", "overrun"}, "once"
    chip.check()


@cocotb.test()
async def nothing_is_begun_while_the_core_is_busy(dut):
    """A core that is not ready for longer than any step: its records are not taken and told, a commit waits, then it
    goes on.
    """
    chip = await running(dut, steps=3)
    regs = dut.chip.u_port.u_regs
    await clear_status(dut)
    await at_phase(dut, 300)
    before = chip.steps
    dut.chip.core_ready.value = Force(0)
    await write_inside(dut, "COMMAND", 1)
    for _ in range(2):
        await at_phase(dut, 200)
    assert chip.steps == before and status(dut) == {"dropped"}
    assert int(regs.commit_pending_q.value), "a configuration waits for the core"
    dut.chip.core_ready.value = Release()
    await RisingEdge(dut.clk_sys)
    await RisingEdge(dut.clk_sys)
    await RisingEdge(dut.clk_sys)
    assert not int(regs.commit_pending_q.value)
    await chip.until_steps(2)
    assert chip.now == chip.predicted != SAFE
    assert "overrun" not in status(dut)
    chip.check()


@cocotb.test()
async def every_phase_between_the_clocks(dut):
    """40 against 50 MHz in steps of 100 ps (light: 1 ns), +-100 ps of jitter: every record makes one step."""
    chip = await running(dut, steps=2)
    dut.jitter.value = 100
    steps = 250 if LONG else 25
    for k in range(steps):
        dut.phase.value = 25_000 * k // steps
        dut.forgive.value = 1
        await Timer(100, "ns")  # the moved edge may cut one SCK period
        dut.forgive.value = 0
        await chip.until_steps(1)
    assert set(chip.latencies) == {chip.latencies[0]}, "from the record on, nothing depends on the phase"
    assert max(chip.nanoseconds) - min(chip.nanoseconds) <= 20.0 + 0.5, "the crossing costs one clock at most"
    assert max(chip.nanoseconds) <= 75 * 20
    assert not status(dut), status(dut)
    assert not int(dut.adc_violations.value) & ~0x10F0, "but for the edge that was moved"


@cocotb.test()
async def configuration_at_the_worst_moment(dut):
    """A whole new configuration committed at any clock of a step: each step is wholly the old or wholly the new one."""
    chip = await running(dut, steps=2)
    gains = {name: MAP.named(name).reset for name in ("ADC_B_GAIN", "ADC_J_GAIN", "ADC_KM_GAIN", "ADC_KB_GAIN")}
    # The clocks about the next record, too: of what a step reads of the configuration a parameter's gain comes first.
    for number, phase in enumerate(phases(125, 20) + list(range(STEP_CLOCKS - 6, STEP_CLOCKS + 2))):
        small = number % 2
        values = {
            "R": 8.6 * (1 + number % 5), "L": 1e-3 * (1 + number % 3), "CONFIG": 0x3F00 | number % 2,
            "DAC_I_L_GAIN": 1024.0 if small else 700.0, "ADC_V_L_GAIN": 0.004 if small else 0.008,
            "DAC_W_R_OFFSET": 50.0 if small else -50.0,
        } | {name: word_float(word) * (1.0 if small else 0.75) for name, word in gains.items()}  # fmt: skip
        await at_phase(dut, 0)
        before = chip.config()
        for name, value in values.items():
            register = MAP.named(name)
            shadow = register.address - MAP.config[0].address
            await write_inside(dut, name, register.to_word(value))
            await into_the_shadow(dut)
            assert chip.config() == before, "not before the commit"
            assert int(dut.chip.u_port.u_regs.shadow_q.value) >> 32 * shadow & 0xFFFFFFFF == register.to_word(value)
        await at_phase(dut, phase)
        await write_inside(dut, "COMMAND", 1)
        await chip.until_steps(2)
        assert {name: chip.config()[name] for name in values} == {n: MAP.named(n).to_word(v) for n, v in values.items()}
        assert chip.now == chip.predicted
    assert not status(dut) - {"sat_i_l", "sat_w_l", "sat_i_r", "sat_w_r"}
    chip.check()


@cocotb.test()
async def unusable_parameters(dut):
    """NaN, infinities, zero and a negative number in every parameter: refused, told, the old coefficients go on."""
    chip = await running(dut, steps=2)
    await write_inside(dut, "CONFIG", 0x3000)  # parameters from registers
    await write_inside(dut, "COMMAND", 1)
    await chip.until_steps(3)
    for name in ("R", "L", "KM", "KB", "J", "B", "H"):
        for kind, number in NUMBERS.items():
            await clear_status(dut)
            await write_inside(dut, name, float_word(number))
            await write_inside(dut, "COMMAND", 1)
            await chip.until_steps(2)
            assert chip.core.fault, f"the model takes {kind} in {name}"
            assert "param_fault" in status(dut), f"{name} = {kind}"
            assert "nonfinite" not in status(dut)
            assert chip.now == chip.predicted
        await write_inside(dut, name, MAP.named(name).reset)
        await write_inside(dut, "COMMAND", 1)
        await chip.until_steps(2)
        await clear_status(dut)
        await chip.until_steps(1)
        assert not status(dut), f"after {name} was repaired: {status(dut)}"
    chip.check()


@cocotb.test()
async def nonfinite_state(dut):
    """NaN or infinity in an input: steps stop, the safe value, the flag; COMMAND.clear starts from rest."""
    chip = await running(dut, steps=2)
    for name, kind in (
        ("V_L", "nan"),
        ("T_R", "inf"),
        ("V_R", "minus_inf"),
        ("ADC_V_L_GAIN", "nan"),
        ("ADC_T_L_OFFSET", "inf"),
    ):
        await clear_status(dut)
        register = MAP.named(name)
        source = 0x3F00 if name.startswith("ADC") else 0x0F00
        await write_inside(dut, "CONFIG", source)
        await write_inside(dut, name, float_word(NUMBERS[kind]))
        await write_inside(dut, "COMMAND", 1)
        await Timer(40, "us")
        assert "nonfinite" in status(dut), name
        assert chip.now == SAFE
        halted = chip.steps
        await stays(chip, SAFE, 15)
        assert chip.steps == halted, "no step while halted"
        last, largest = (int(dut.chip.latency.value) >> shift & 0xFFFF for shift in (0, 16))
        assert last == largest == chip.latencies[0], "the write of the safe value is no step's"
        await write_inside(dut, name, register.reset)
        await write_inside(dut, "CONFIG", 0x3F00)
        await write_inside(dut, "COMMAND", 3)
        chip.core.clear()
        await chip.until_steps(2)
        assert chip.now == chip.predicted != SAFE
        await clear_status(dut)
        await chip.until_steps(1)
        assert not status(dut)
    chip.check()


@cocotb.test()
async def bad_scalings_stay_bounded(dut):
    """Zero, huge and undefined scalings of the outputs: clamped or mid-scale, with the flag of that output."""
    chip = await running(dut, steps=3)
    for flag, name in (("sat_i_l", "I_L"), ("sat_w_l", "W_L"), ("sat_i_r", "I_R"), ("sat_w_r", "W_R")):
        output = ("I_L", "W_L", "I_R", "W_R").index(name)
        for gain, codes in ((1e30, {0, 4095}), (-1e30, {0, 4095}), (float("nan"), {2048}), (float("inf"), {0, 4095})):
            await write_inside(dut, f"DAC_{name}_GAIN", float_word(gain))
            await write_inside(dut, "COMMAND", 1)
            await chip.until_steps(1)
            await clear_status(dut)
            await chip.until_steps(1)
            assert status(dut) == {flag}, f"{name} gain {gain}: {status(dut)}"
            assert chip.now[output] in codes
        # Stopped: the flag of the last step has been told, and once cleared it does not come again.
        await write_inside(dut, "CONTROL", 0)
        await Timer(25, "us")
        await clear_status(dut)
        await Timer(2, "us")
        assert not status(dut), f"{name}: {status(dut)} without a step"
        await write_inside(dut, "CONTROL", 1)
        await write_inside(dut, f"DAC_{name}_GAIN", float_word(0.0))
        await write_inside(dut, "COMMAND", 1)
        await chip.until_steps(1)
        assert chip.now[output] == 2048
        await write_inside(dut, f"DAC_{name}_GAIN", MAP.named(f"DAC_{name}_GAIN").reset)
        await write_inside(dut, "COMMAND", 1)
        await chip.until_steps(1)
        await clear_status(dut)
    chip.check()


@cocotb.test()
async def run_blank_and_clear(dut):
    """CONTROL.run stops after the step in hand and goes on from there; blank shows the safe value between steps."""
    chip = await running(dut, steps=3)
    for phase in phases(50, 5):
        await at_phase(dut, phase)
        await write_inside(dut, "CONTROL", 0)
        await Timer(25, "us")
        held = chip.now
        assert held == chip.predicted
        await stays(chip, held, 10)
        assert not status(dut), "a chip at rest is not silent"
        await write_inside(dut, "CONTROL", 1)
        await chip.until_steps(2)
        await at_phase(dut, phase)
        await write_inside(dut, "CONTROL", 3)
        await Timer(25, "us")
        assert chip.now == SAFE
        await stays(chip, SAFE, 15)
        await write_inside(dut, "CONTROL", 1)
        await chip.until_steps(1)
        assert chip.now == chip.predicted != SAFE
        await at_phase(dut, phase)
        before = get_sim_time("ns")
        await write_inside(dut, "COMMAND", 2)
        while not int(dut.chip.clear.value):
            await RisingEdge(dut.clk_sys)
        assert get_sim_time("ns") - before < 4000, "a clear waits for the step in hand only"
        chip.core.clear()
        await chip.until_steps(2)
        assert chip.now == chip.predicted
    chip.check()


@cocotb.test()
async def through_the_serial_pins(dut):
    """The same as on a board: identify, watch, set parameters and sources, read the flags, all over two pins."""
    chip = await running(dut, steps=2)

    def use(client):
        client.identify()
        live = client.flags("LIVE")
        assert live["locked"] and live["adc_alive"] and not live["halted"] and not live["blanked"]
        assert not any(client.take_status().values())
        client.configure({"CONFIG": REGISTERS_ONLY, "V_L": 6.0, "V_R": -3.0, "T_R": 1e-4})
        first = client.counters()
        assert client.read("NOW_V_L") == 6.0 and client.read("NOW_V_R") == -3.0
        assert client.read("CODES_V") == (2600 << 16 | 3000)
        second = client.counters()
        assert abs((second[0] - first[0]) / 500 - (second[1] - first[1])) <= 1, "a step each 500 clocks"
        client.write_flags("COMMAND", clear=True)
        assert client.counters()[1] < 40
        latency = client.read("LATENCY")
        assert latency & 0xFFFF == latency >> 16 == chip.latencies[0]

    def clear_model():
        chip.core.clear()

    async def watch_clear():
        await RisingEdge(dut.chip.clear)
        clear_model()

    cocotb.start_soon(watch_clear())
    await chip.client(use)
    assert chip.now == chip.predicted
    chip.check()


@cocotb.test()
async def nothing_before_the_lock(dut):
    """Without a lock: the DAC is held safe, the ADC is left alone, the registers answer and say so."""
    chip = Chip(dut)
    chip.fixed()
    await chip.power_up(lock=False)
    before = int(dut.conversions.value)
    await Timer(5, "us")

    def use(client):
        client.identify()
        return client.flags("LIVE")

    live = await chip.client(use)
    assert not live["locked"] and not live["adc_alive"]
    assert int(dut.dac_reset_n.value) == 0 and int(dut.conversions.value) == before
    assert chip.now == SAFE
